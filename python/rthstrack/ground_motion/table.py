"""The table [ground_motion] of a configuration."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rthstrack.errors import RthstrackError, SettingError
from rthstrack.ground_motion.checks import _is_number, _is_whole, _near, _not_positive, _oscillator_mistakes, _unknown
from rthstrack.ground_motion.files import _ACCELERATION, read_ground_motion
from rthstrack.ground_motion.records import SETS, _entry, record
from rthstrack.ground_motion.synthetic import _synthetic_mistakes, synthetic_ground_motion
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
    known = (*_SOURCES, *_SCALINGS, *(key for keys in _OF_SOURCE.values() for key in keys))
    mistakes = _unknown(table, known, "ground_motion")
    sources = [key for key in _SOURCES if key in table]
    if len(sources) != 1:
        found = " and ".join(sources) or "none"
        mistakes.append(("ground_motion", f"expected exactly one of {', '.join(_SOURCES)}, found {found}"))
    for source, keys in _OF_SOURCE.items():
        mistakes += [
            (f"ground_motion.{key}", f"goes with {source}, which is not given")
            for key in keys
            if key in table and sources and source not in sources
        ]
    for source, check in (("record", _record_mistakes), ("synthetic", _synthetic_table_mistakes)):
        if source in table:
            mistakes += [(f"ground_motion.{key}", message) for key, message in check(table[source])]
    if "file" in table:
        of_file = file_mistakes(table, base_dir, _ACCELERATION)
        mistakes += [(f"ground_motion.{key}", message) for key, message in of_file]
    if not isinstance(table.get("normalized", False), bool):
        mistakes.append(("ground_motion.normalized", f"expected true or false, found {table['normalized']!r}"))
    return mistakes + [(f"ground_motion.{key}", message) for key, message in _scaling_mistakes(table)]


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


def _record_mistakes(value: object) -> Mistakes:
    if isinstance(value, Mapping):
        mistakes = _unknown(value, ("set", "number", "component"), "record")
        mistakes += [("record", f"{key} is missing") for key in ("number", "component") if key not in value]
        number, component, chosen = value.get("number", 1), value.get("component", "a"), value.get("set", SETS[0])
        if not _is_whole(number):
            mistakes.append(("record.number", f"expected a whole number, found {number!r}"))
        if component not in ("a", "b"):
            mistakes.append(("record.component", f"expected 'a' or 'b', found {component!r}"))
        if chosen not in SETS:
            near = _near(str(chosen), SETS)
            mistakes.append(("record.set", f"expected one of {', '.join(SETS)}, found {chosen!r}{near}"))
        if mistakes:
            return mistakes
    elif not isinstance(value, str):
        return [("record", f"expected a name or a table of set, number and component, found {value!r}")]
    try:
        _entry(*_asked(value))
    except RthstrackError as error:
        return [("record", str(error))]
    return []


def _synthetic_table_mistakes(value: object) -> Mistakes:
    if not isinstance(value, Mapping):
        return [("synthetic", f"expected a table, as {{ seed = 1, duration_s = 40 }}, found {value!r}")]
    defaults = {name: one.default for name, one in inspect.signature(synthetic_ground_motion).parameters.items()}
    unknown = _unknown(value, tuple(defaults), "synthetic")
    return unknown + [(f"synthetic.{key}", message) for key, message in _synthetic_mistakes({**defaults, **value})]


def _scaling_mistakes(table: Mapping[str, Any]) -> Mistakes:
    given = [key for key in _SCALINGS if key in table]
    mistakes: Mistakes = []
    if len(given) > 1:
        mistakes.append((given[1], f"expected at most one of {', '.join(_SCALINGS)}, found {' and '.join(given)}"))
    factor = table.get("factor", 1)
    if not (_is_number(factor) and math.isfinite(factor) and factor != 0):
        mistakes.append(("factor", f"expected a finite number other than zero, found {factor!r}"))
    mistakes += _not_positive(table, ("peak_m_s2", "arias_m_s"))
    spectral = table.get("spectral_acceleration")
    if isinstance(spectral, Mapping):
        keys = ("value_m_s2", "period_s", "damping_ratio")
        found = _unknown(spectral, keys, "spectral_acceleration")
        found += [("spectral_acceleration", f"{key} is missing") for key in keys[:2] if key not in spectral]
        inner = _not_positive(spectral, ("value_m_s2",))
        inner += _oscillator_mistakes(spectral.get("period_s", 1.0), spectral.get("damping_ratio", 0.05))
        return mistakes + found + [(f"spectral_acceleration.{key}", message) for key, message in inner]
    if spectral is not None:
        mistakes.append(("spectral_acceleration", f"expected a table of value_m_s2 and period_s, found {spectral!r}"))
    return mistakes
