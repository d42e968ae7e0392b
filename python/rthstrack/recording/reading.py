"""Files of any known format as recordings."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import SettingError
from rthstrack.recording.clocks import clocks_told, not_followed, own_times, timelines
from rthstrack.recording.rate import Rate, doubts, ended, settle, time_columns, with_others
from rthstrack.recording.readers import read_contents
from rthstrack.recording.readers.stamps import Uniform
from rthstrack.recording.recording import Recording, channels_of
from rthstrack.recording.resampling import resample

if TYPE_CHECKING:
    from rthstrack.recording.clocks import Timelines
    from rthstrack.recording.rate import TimeColumn
    from rthstrack.recording.readers.contents import Contents


def read_recording(
    path: str | os.PathLike[str],
    *,
    rate_hz: float | None = None,
    time: str | None = None,
    resample_hz: float | None = None,
    block: int | None = None,
    lines: tuple[int, int] | None = None,
) -> Recording:
    """Reads a file of any known format, chosen by its content.

    The sampling rate comes from the first of: `rate_hz`; the channel named by `time`; a statement in the file; a time
    column known by its name; a column of dates or times of day. It may stay None. Channels that have a time of their
    own carry it (`Channel.time`); `on_one_clock` puts some on one. `resample_hz` interpolates every channel from its
    time stamps onto a uniform grid (cubic, without a low-pass). `block` (from 1) chooses among the blocks of rows of a
    text file or the sheets of a workbook; `lines`, the first and the last, are those that are read.
    Raises RecordingError if the file cannot be read, if time stamps are not uniform, or if two statements of the rate
    differ by more than 1 %; ChannelError for `time`; SettingError for a rate that is not positive.
    """
    checked_rates(rate_hz, resample_hz)
    contents = read_contents(path, block=block, lines=lines)
    return recording_from(contents, os.fspath(path), rate_hz=rate_hz, time=time, resample_hz=resample_hz)


def checked_rates(rate_hz: float | None, resample_hz: float | None) -> None:
    """Raises SettingError for rates that cannot be, or not together."""
    for what, value in (("rate", rate_hz), ("resample", resample_hz)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise SettingError(f"{what}: expected a positive number of Hz, found {value:g}")
    if rate_hz is not None and resample_hz is not None:
        raise SettingError(
            "rate and resample exclude each other: one ignores the time stamps, the other interpolates them"
        )


@np.errstate(all="ignore")  # infinite samples are told where they matter
def recording_from(
    contents: Contents,
    file: str,
    *,
    rate_hz: float | None = None,
    time: str | None = None,
    resample_hz: float | None = None,
) -> Recording:
    """Settles the sampling rate of a file's contents, as `read_recording` describes."""
    contents, columns, lines = _lines(contents, time, file, given=rate_hz is not None)
    numeric = [column for column in columns if not column.is_clock]
    if resample_hz is not None:
        return resample(contents, file, columns, lines, resample_hz)
    clocks = [c for c in columns if c.is_clock and numeric and c not in lines.main]
    main = [*lines.main, *clocks] if time is None else columns
    if rate_hz is not None:
        rate = Rate(float(rate_hz), "--rate", 0.0, tuple(doubts(contents, columns, rate_hz)))
    else:
        rate = settle(contents, main, chosen=time is not None, file=file)
        length = len(lines.main[0].stamps) if lines.main else 0
        others = {c for c in lines.of if c is not None and c not in lines.main and len(c.stamps) == length}
        rate = with_others(rate, sorted(others, key=lambda c: c.index), file)
    if time is not None:
        own = timelines(contents, time_columns(contents, None, file), file, given=True)
        rate = replace(rate, notes=(*rate.notes, *not_followed(own, columns[0])))
    times = own_times(contents, lines, rate, given=rate_hz is not None)
    places = {int(c.index) for c in columns if not c.is_clock and isinstance(c.examine(), Uniform)}
    channels = channels_of(contents, contents.series, times, places)
    notes = (*contents.notes, *rate.notes, *lines.notes, *clocks_told(channels))
    return Recording(file, contents.format, channels, rate.hz, rate.source, rate.start_s, notes)


def _lines(
    contents: Contents, time: str | None, file: str, *, given: bool
) -> tuple[Contents, list[TimeColumn], Timelines]:
    """Which columns tell whose time; where one ends before the table, it and its channels end there."""
    columns = time_columns(contents, time, file)
    numeric = [column for column in columns if not column.is_clock]
    lines = timelines(contents, columns if time is None else [], file, given=given)
    ends = {column.index: len(ended(column.stamps)) for column in numeric}
    if time is not None or all(ends[column.index] in (0, len(column.stamps)) for column in numeric):
        return contents, columns, lines
    series = list(contents.series)
    for i, own in enumerate(lines.of):
        last = ends.get(float(i) if own is None else own.index, 0)
        if 0 < last < len(series[i].values) and len(ended(series[i].values)) <= last:
            series[i] = replace(series[i], values=series[i].values[:last])
    contents = replace(contents, series=tuple(series))
    columns = time_columns(contents, None, file)
    return contents, columns, timelines(contents, columns, file, given=given)
