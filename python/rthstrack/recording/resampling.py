"""Uneven time stamps interpolated onto a uniform grid."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import RecordingError, SettingError
from rthstrack.recording.readers.stamps import Irregular
from rthstrack.recording.recording import Recording, channels_of
from rthstrack.said import Said

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rthstrack.recording.rate import TimeColumn
    from rthstrack.recording.readers.contents import Contents


def resample(contents: Contents, file: str, columns: Sequence[TimeColumn], hz: float) -> Recording:
    """Every channel on a uniform grid from the first stamp on, by a cubic spline through the samples."""
    from scipy.interpolate import CubicSpline

    if not columns:
        raise RecordingError("cannot resample: no time column", file=file, advice="name one: {time}, or give {rate_hz}")
    column = columns[0]
    stamps = column.stamps * column.unit_s
    verdict = column.examine()
    if not (len(stamps) > 1 and np.isfinite(stamps).all() and np.all(np.diff(stamps) > 0)):
        problem = verdict.problem if isinstance(verdict, Irregular) else "does not increase"
        raise RecordingError(
            f"cannot resample: expected stamps that increase strictly, but {column.what} {problem}", file=file
        )
    stamps = stamps - stamps[0]
    mean_hz = (len(stamps) - 1) / float(stamps[-1])
    if not 0.9 * mean_hz <= hz <= 10 * mean_hz:
        why = (
            "fewer would alias, for there is no low-pass (use P)" if hz < mean_hz else "more would only invent samples"
        )
        raise SettingError(
            f"{file}: resample: expected {0.9 * mean_hz:.6g} to {10 * mean_hz:.6g} Hz (0.9 to 10 times the mean "
            f"rate of {column.what}), found {hz:g} Hz; {why}"
        )
    grid = np.arange(math.floor(float(stamps[-1]) * hz * (1 + 1e-12)) + 1) / hz
    grid = np.minimum(grid, stamps[-1])
    after = np.clip(np.searchsorted(stamps, grid), 1, len(stamps) - 1)
    series, left_out = [], []
    for one in contents.series:
        if one.path == column.path:
            continue
        if len(one.values) != len(stamps):
            left_out.append(one.path)
            continue
        finite = np.isfinite(one.values)
        if np.count_nonzero(finite) < 2:
            values = np.full(len(grid), math.nan)
        else:
            values = CubicSpline(stamps[finite], one.values[finite])(grid)
            # A missing sample leaves a gap: nothing is known between the samples on either side of it.
            on_left, on_right = stamps[after - 1] == grid, stamps[after] == grid
            values[~((finite[after] | on_left) & (finite[after - 1] | on_right))] = math.nan
        series.append(replace(one, values=values))
    if not series:
        raise RecordingError(f"cannot resample: no channel has the {len(stamps)} samples of {column.what}", file=file)
    steps = np.diff(stamps)
    notes = [
        *contents.notes,
        Said(
            f"resampled to {hz:g} Hz by cubic splines from {column.what}: "
            f"steps of {steps.min():.6g} to {steps.max():.6g} s, mean {steps.mean():.6g} s",
            "resampled",
            (hz, steps.min(), steps.max(), steps.mean()),
        ),
    ]
    if left_out:
        words = f"left out when resampling, for their length is not that of {column.what}: {', '.join(left_out)}"
        notes.append(Said(words, "not_resampled", [len(left_out)]))
    start = float(column.stamps[0]) * column.unit_s
    source = f"--resample, from {column.what}"
    return Recording(file, contents.format, channels_of(contents, series), float(hz), source, start, tuple(notes))
