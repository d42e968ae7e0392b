"""Arrays of any shape as channels; what NumPy files, HDF5 and Parquet have in common."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.recording.readers.contents import Clock, Contents, RateStatement, Series

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

# A matrix whose shorter dimension is longer than this is a picture or a map, not channels.
MOST_CHANNELS = 512

_RATES = {
    "rate_hz",
    "rate",
    "fs",
    "sample_rate",
    "sampling_rate",
    "samplerate",
    "samplingrate",
    "sample_rate_hz",
    "sampling_rate_hz",
    "sampling_frequency",
    "sample_frequency",
    "samplingfrequency",
    "fsamp",
    "srate",
}
_STEPS = {"dt", "ts", "dt_s", "delta_t", "sample_interval", "sampling_interval", "sample_time", "timestep", "time_step"}
_STEPS |= {"wf_increment", "tsample", "sampletime"}
_UNITS = ("unit", "units", "unit_string", "Unit", "Units", "UNIT", "UNITS")


def rate_of(name: str, value: object) -> float | None:
    """The rate in Hz that a single number states by its name (fs, rate_hz, dt, ...), or None."""
    key = re.sub(r"[\s-]+", "_", re.split(r"[/.]", name)[-1].strip().lower())
    if key not in _RATES | _STEPS:
        return None
    try:
        number = float(np.asarray(value).reshape(-1)[0]) if np.size(np.asarray(value)) == 1 else math.nan
    except (TypeError, ValueError):
        return None
    if not (math.isfinite(number) and number > 0):
        return None
    return tidy(number if key in _RATES else 1 / number)


def states_unit(name: str) -> bool:
    """Whether the name of a number that states the rate says in which unit."""
    return re.search(r"(_hz|_s|wf_increment)$", name.strip(), re.IGNORECASE) is not None


def tidy(rate: float) -> float:
    """1 / 0.001 as 1000 to the last bit; 1 / 0.003 stays what it is."""
    return float(round(rate)) if abs(rate - round(rate)) < 1e-9 * rate else rate


def unit_in(attributes: Mapping[str, Any]) -> str | None:
    """The unit among a channel's attributes, if one is stated."""
    for key in _UNITS:
        value = attributes.get(key)
        if isinstance(value, bytes):
            value = value.decode("utf-8", "replace")
        if isinstance(value, str) and value.strip():
            return value.strip()
    return None


def is_numeric(dtype: np.dtype[Any]) -> bool:
    """Whether an array of this type holds real numbers."""
    return dtype.kind in "iufb"


def indexed(name: str, indices: Sequence[int | None]) -> str:
    """`name[:,1]` for indices (None, 1): None for all of a dimension."""
    return f"{name}[{','.join(':' if i is None else str(i) for i in indices)}]"


def columns(
    name: str,
    array: NDArray[Any],
    unit: str | None,
    notes: list[str],
    naming: Callable[[str, Sequence[int | None]], str] = indexed,
) -> list[Series]:
    """An array's channels: a vector is one; a matrix's shorter dimension counts them (`name[:,0]` or `name[0,:]`).

    What is no vector or matrix of real numbers goes to the notes.
    """
    if array.dtype.names:
        parts = (columns(f"{name}/{field}", array[field], unit, notes, naming) for field in array.dtype.names)
        return [series for part in parts for series in part]
    if not is_numeric(array.dtype):
        notes.append(f"'{name}' holds {'complex numbers' if array.dtype.kind == 'c' else 'no numbers'}, no channel")
        return []
    if array.size < 2:
        notes.append(f"'{name}' is {'a single number' if array.size else 'empty'}, no channel")
        return []
    long = [axis for axis, length in enumerate(array.shape) if length > 1]
    if len(long) == 1:
        return [Series(name, name, unit, as_float(array.reshape(-1)))]
    if len(long) > 2 or min(array.shape[axis] for axis in long) > MOST_CHANNELS:
        shape = "x".join(map(str, array.shape))
        notes.append(f"'{name}' is {shape} numbers, no channel: expected a vector or a matrix with a short dimension")
        return []
    matrix = array.reshape([array.shape[axis] for axis in long])
    counting = long[0] if matrix.shape[0] < matrix.shape[1] else long[1]
    series = []
    for i, row in enumerate(matrix if counting == long[0] else matrix.T):
        indices = [i if axis == counting else None if axis in long else 0 for axis in range(array.ndim)]
        path = naming(name, indices)
        series.append(Series(path, path, unit, as_float(row)))
    return series


def as_float(values: NDArray[Any]) -> NDArray[np.float64]:
    """Any real numbers as contiguous float64."""
    return np.ascontiguousarray(values, dtype=np.float64)


def clock(name: str, values: NDArray[Any], after: int = 0) -> Clock:
    """A column of datetime64 or timedelta64 as a clock, behind so many series."""
    ns = values.astype("datetime64[ns]" if values.dtype.kind == "M" else "timedelta64[ns]")
    missing = np.isnat(ns)
    first = ns[~missing][:1]
    seconds = np.full(ns.shape, math.nan)
    if first.size:
        seconds[~missing] = (ns[~missing] - first).astype(np.int64) / 1e9
    return Clock(name, name, seconds, int(first[0].astype(np.int64)) if first.size else None, after)


def collect(
    form: str,
    entries: Iterable[tuple[str, NDArray[Any], str | None]],
    statements: Iterable[RateStatement] = (),
    notes: Iterable[str] = (),
) -> Contents:
    """Named arrays with their units as contents; single numbers may state the rate."""
    series: list[Series] = []
    clocks: list[Clock] = []
    stated = list(statements)
    said = list(notes)
    matrices = 0
    for name, array, unit in entries:
        matrices += array.ndim > 1 and not array.dtype.names
        rate = rate_of(name, array) if array.size == 1 and array.dtype.kind in "iuf" else None
        if rate is not None:
            stated.append(RateStatement(f"'{name}'", rate, None, states_unit(name)))
        elif array.dtype.kind in "Mm" and array.ndim == 1:
            clocks.append(clock(name, array, len(series)))
        else:
            series += columns(name, array, unit, said)
    # The columns of one matrix have no names.
    nameless = matrices == 1 and len({one.name.split("[")[0] for one in series}) == 1
    return Contents(form, tuple(series), tuple(clocks), tuple(stated), tuple(said), nameless)
