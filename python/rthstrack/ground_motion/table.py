"""The table [ground_motion] of a configuration."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rthstrack.errors import RthstrackError, SettingError
from rthstrack.ground_motion.checks import oscillator_mistakes
from rthstrack.ground_motion.files import ACCELERATION, read_ground_motion
from rthstrack.ground_motion.records import SETS, entry_of, record
from rthstrack.ground_motion.synthetic import synthetic_ground_motion, synthetic_mistakes
from rthstrack.keyed_table import KINDS, NOT_ZERO, NUMBER, POSITIVE, Table, one_of
from rthstrack.recording.motion_files import KEYS, file_mistakes

if TYPE_CHECKING:
    import os

    from rthstrack.ground_motion.checks import Mistakes
    from rthstrack.ground_motion.motion import GroundMotion

_SOURCES = ("record", "file", "synthetic")
_SCALINGS = ("factor", "peak_m_s2", "arias_m_s", "spectral_acceleration")
_OF_SOURCE = {"record": ("normalized",), "file": KEYS, "synthetic": ()}


def check_ground_motion(table: object, base_dir: str | os.PathLike[str] | None = None) -> Mistakes:
    """Everything wrong with a table [ground_motion], as (key, message); nothing if `ground_motion_from` can take it.

    base_dir: the configuration's folder; without it, it is not looked whether the file exists.
    """
    if not isinstance(table, Mapping):
        return [("ground_motion", f"expected a table, found {table!r}")]
    root = Table(table, "ground_motion", [])
    _read(root, base_dir)
    return root.mistakes


def ground_motion_from(table: Mapping[str, Any], base_dir: str | os.PathLike[str]) -> GroundMotion:
    """The ground motion that a table [ground_motion] asks for; paths are relative to `base_dir`.

    Exactly one of record = "CHY101-N" or {set, number, component} (with normalized), file = "path" (with channel, unit,
    rate_hz, layout: see `read_ground_motion`) and synthetic = {seed, duration_s, ...: see `synthetic_ground_motion`};
    at most one of factor, peak_m_s2, arias_m_s and spectral_acceleration = {value_m_s2, period_s, damping_ratio}.
    Raises SettingError with every mistake and its key, and what reading raises.
    """
    mistakes = check_ground_motion(table, base_dir)
    if mistakes:
        raise SettingError("; ".join(f"{key}: {message}" for key, message in mistakes))
    if "record" in table:
        motion = record(*_asked(table["record"]), normalized=table.get("normalized", False))
    elif "file" in table:
        options = {key: table[key] for key in _OF_SOURCE["file"] if key in table}
        motion = read_ground_motion(Path(base_dir) / table["file"], **options)
    else:
        motion = synthetic_ground_motion(**table["synthetic"])
    if "factor" in table:
        return motion.scaled(table["factor"])
    if "peak_m_s2" in table:
        return motion.scaled_to_peak(table["peak_m_s2"])
    if "arias_m_s" in table:
        return motion.scaled_to_arias(table["arias_m_s"])
    if "spectral_acceleration" in table:
        return motion.scaled_to_spectral_acceleration(**table["spectral_acceleration"])
    return motion


def _asked(value: Any) -> tuple[str | int, str | None, str]:
    """A configuration's record as the arguments of `record`."""
    if isinstance(value, str):
        return value, None, SETS[0]
    return value["number"], value["component"], value.get("set", SETS[0])


def _read(root: Table, base_dir: str | os.PathLike[str] | None) -> None:
    """Notes everything wrong with the table."""
    sources = [key for key in _SOURCES if key in root.values]
    if len(sources) != 1:
        found = " and ".join(sources) or "none"
        root.mistakes.append((root.key, f"expected exactly one of {', '.join(_SOURCES)}, found {found}"))
    for source, keys in _OF_SOURCE.items():
        for key in keys:
            if key in root.values and sources and source not in sources:
                root.note(key, f"goes with {source}, which is not given")
    if "record" in root.values:
        _read_record(root)
    if (synthetic := root.table("synthetic")) is not None:
        defaults = {name: one.default for name, one in inspect.signature(synthetic_ground_motion).parameters.items()}
        for key, message in synthetic_mistakes({**defaults, **synthetic.values}):
            synthetic.note(key, message)
        synthetic.close(defaults)
    if "file" in root.values:
        root.mistakes += [
            (root.path(key), message) for key, message in file_mistakes(root.values, base_dir, ACCELERATION)
        ]
    root.take("normalized", KINDS[bool], False)
    _read_scaling(root)
    root.close((*_SOURCES, *(key for keys in _OF_SOURCE.values() for key in keys)))


def _read_record(root: Table) -> None:
    value, n_mistakes = root.values["record"], len(root.mistakes)
    if isinstance(value, str):
        root.known.append("record")
    elif (table := root.table("record")) is not None:
        table.take("number", KINDS[int])
        table.take("component", one_of("a", "b"))
        table.take("set", one_of(*SETS), SETS[0])
        table.close()
    if len(root.mistakes) == n_mistakes:
        try:
            entry_of(*_asked(value))
        except RthstrackError as error:
            root.note("record", str(error))


def _read_scaling(root: Table) -> None:
    given = [key for key in _SCALINGS if key in root.values]
    if len(given) > 1:
        root.note(given[1], f"expected at most one of {', '.join(_SCALINGS)}, found {' and '.join(given)}")
    root.take("factor", NOT_ZERO, 1.0)
    root.take("peak_m_s2", POSITIVE, None)
    root.take("arias_m_s", POSITIVE, None)
    if (spectral := root.table("spectral_acceleration")) is not None:
        spectral.take("value_m_s2", POSITIVE)
        period_s = spectral.take("period_s", NUMBER, stand_in=1.0)
        damping_ratio = spectral.take("damping_ratio", NUMBER, 0.05)
        for key, message in oscillator_mistakes(period_s, damping_ratio):
            spectral.note(key, message)
        spectral.close()
