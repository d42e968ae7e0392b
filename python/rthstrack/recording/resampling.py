"""Uneven time stamps interpolated onto a uniform grid."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rthstrack.errors import RecordingError, SettingError
from rthstrack.recording.clocks import clocks_told
from rthstrack.recording.readers.stamps import Irregular, Uniform
from rthstrack.recording.recording import OwnTime, Recording, channels_of
from rthstrack.said import Said

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rthstrack.recording.clocks import Timelines
    from rthstrack.recording.rate import TimeColumn
    from rthstrack.recording.readers.contents import Contents


def resample(contents: Contents, file: str, columns: Sequence[TimeColumn], lines: Timelines, hz: float) -> Recording:
    """Every channel on a uniform grid from the first stamp on, by a cubic spline through the samples.

    Those with a time column of their own stand on the same grid, and begin where that does.
    """
    if not columns:
        raise RecordingError("cannot resample: no time column", file=file, advice="name one: {time}, or give {rate_hz}")
    column = lines.main[0] if lines.main else columns[0]
    column = next((other for other in lines.main if isinstance(other.examine(), Uniform)), column)
    stamps = _checked(column, file)
    origin = float(stamps[0])
    mean_hz = (len(stamps) - 1) / float(stamps[-1] - origin)
    if not 0.9 * mean_hz <= hz <= 10 * mean_hz:
        why = (
            "fewer would alias, for there is no low-pass (use P)" if hz < mean_hz else "more would only invent samples"
        )
        raise SettingError(
            f"{file}: resample: expected {0.9 * mean_hz:.6g} to {10 * mean_hz:.6g} Hz (0.9 to 10 times the mean "
            f"rate of {column.what}), found {hz:g} Hz; {why}"
        )
    series, times, left_out = [], [], []
    grids: dict[float, _Grid] = {}
    for i, one in enumerate(contents.series):
        own = lines.of[i]
        own = column if own is None or own in lines.main else own
        if i == column.index or any(c is not None and i == c.index for c in lines.of):
            continue
        if len(one.values) != len(own.stamps):
            left_out.append(one.path)
            continue
        if own.index not in grids:
            grids[own.index] = _grid(_checked(own, file), origin, hz)
        grid = grids[own.index]
        series.append(replace(one, values=_splined(one.values, grid)))
        times.append(OwnTime(own.what, float(hz), grid.start_s))
    if not series:
        raise RecordingError(f"cannot resample: no channel has the {len(stamps)} samples of {column.what}", file=file)
    steps = np.diff(stamps - origin)
    notes = [
        *contents.notes,
        Said(
            f"resampled to {hz:g} Hz by cubic splines from {column.what}: "
            f"steps of {steps.min():.6g} to {steps.max():.6g} s, mean {steps.mean():.6g} s",
            "resampled",
            (hz, steps.min(), steps.max(), steps.mean()),
        ),
        *lines.notes,
    ]
    if left_out:
        words = f"left out when resampling, for their length is not that of {column.what}: {', '.join(left_out)}"
        notes.append(Said(words, "not_resampled", [len(left_out)]))
    source = f"--resample, from {column.what}"
    channels = channels_of(contents, series, times if len(grids) > 1 else ())
    notes += clocks_told(channels)
    return Recording(file, contents.format, channels, float(hz), source, origin, tuple(notes))


class _Grid(NamedTuple):
    stamps: NDArray[np.float64]
    at: NDArray[np.float64]
    start_s: float


def _checked(column: TimeColumn, file: str) -> NDArray[np.float64]:
    """A column's stamps in seconds, which increase."""
    if column.unit.doubt:
        raise RecordingError(f"cannot resample: {column.what} {column.unit.doubt}", file=file, code="time_unit")
    stamps: NDArray[np.float64] = column.stamps * column.unit_s
    if not (len(stamps) > 1 and np.isfinite(stamps).all() and np.all(np.diff(stamps) > 0)):
        verdict = column.examine()
        problem = verdict.problem if isinstance(verdict, Irregular) else "does not increase"
        raise RecordingError(
            f"cannot resample: expected stamps that increase strictly, but {column.what} {problem}", file=file
        )
    return stamps


def _grid(stamps: NDArray[np.float64], origin: float, hz: float) -> _Grid:
    """The instants of a uniform grid from `origin` on that lie within some stamps; both from the grid's first."""
    first = math.ceil((float(stamps[0]) - origin) * hz - 1e-9)
    start_s = origin + first / hz
    stamps = stamps - start_s
    at = np.arange(math.floor(float(stamps[-1]) * hz * (1 + 1e-12)) + 1) / hz
    return _Grid(stamps, np.clip(at, stamps[0], stamps[-1]), start_s)


def _splined(values: NDArray[np.float64], grid: _Grid) -> NDArray[np.float64]:
    from scipy.interpolate import CubicSpline

    stamps, at, _ = grid
    finite = np.isfinite(values)
    if np.count_nonzero(finite) < 2:
        return np.full(len(at), math.nan)
    found: NDArray[np.float64] = CubicSpline(stamps[finite], values[finite])(at)
    # A missing sample leaves a gap: nothing is known between the samples on either side of it.
    after = np.clip(np.searchsorted(stamps, at), 1, len(stamps) - 1)
    on_left, on_right = stamps[after - 1] == at, stamps[after] == at
    found[~((finite[after] | on_left) & (finite[after - 1] | on_right))] = math.nan
    return found
