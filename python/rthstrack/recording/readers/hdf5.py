"""HDF5: every dataset of numbers is a channel, or several."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.arrays import collect, rate_of, states_unit, unit_in
from rthstrack.recording.readers.contents import STARTS, RateStatement

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from rthstrack.recording.readers.contents import Contents

# A compressed dataset holds at most this many bytes for each one stored (zlib packs 1032 to 1).
_MOST_PACKED = 1100
_SMALL = 1 << 26


def read(path: Path) -> Contents:
    """Reads every dataset of numbers: its path is its name, attributes may state unit and rate.

    Attributes of the file or a group (rate_hz, sample_rate, fs, dt) hold for all datasets. Links to other files are not
    followed.
    """
    entries: list[tuple[str, NDArray[Any], str | None]] = []
    statements: list[RateStatement] = []
    notes: list[str] = []
    starts: dict[str, float] = {}

    def visit(name: str, item: Any) -> None:
        is_dataset = isinstance(item, h5py.Dataset)
        attributes = _attributes(item)
        for key, value in attributes.items():
            rate = rate_of(key, value)
            if rate is not None:
                where = f" of '{name}'" if name else ""
                statements.append(
                    RateStatement(f"attribute '{key}'{where}", rate, name if is_dataset else None, states_unit(key))
                )
        if not is_dataset:
            return
        if item.shape is None or not (item.dtype.kind in "iufb" or item.dtype.names):
            notes.append(f"'{name}' {'is empty' if item.shape is None else 'holds no numbers'}, no channel")
            return
        check_size(item)
        start = next((_number(value) for key, value in attributes.items() if key.lower() in STARTS), None)
        if start is not None:
            starts[name] = start
        entries.append((name, np.asarray(item[()]), unit_in(attributes)))

    with h5py.File(path, "r") as file:
        visit("", file)
        file.visititems(visit)
    found = collect("HDF5", entries, statements, notes)
    return replace(found, series=tuple(replace(s, start_s=starts.get(s.path.partition("[")[0])) for s in found.series))


def _number(value: object) -> float | None:
    array = np.asarray(value)
    number = float(array.reshape(-1)[0]) if array.size == 1 and array.dtype.kind in "iuf" else math.nan
    return number if math.isfinite(number) else None


def check_size(dataset: h5py.Dataset) -> None:
    """Refuses a dataset that claims far more numbers than the file stores: its length is damaged."""
    claimed = dataset.size * dataset.dtype.itemsize
    stored = dataset.id.get_storage_size()
    if claimed > _SMALL and claimed > _MOST_PACKED * max(stored, 1):
        raise RecordingError(f"damaged: '{dataset.name}' claims {dataset.size} values in {stored} stored bytes")


def _attributes(item: Any) -> dict[str, Any]:
    """Attributes that can be read; those of types that NumPy has not are passed over."""
    found = {}
    for key in item.attrs:
        try:
            found[key] = item.attrs[key]
        except (OSError, TypeError, ValueError, RuntimeError):
            continue
    return found
