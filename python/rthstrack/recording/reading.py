"""Files of any known format as recordings."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

from rthstrack.errors import SettingError
from rthstrack.recording.rate import Rate, doubts, settle, time_columns
from rthstrack.recording.readers import read_contents
from rthstrack.recording.recording import Recording, channels_of
from rthstrack.recording.resampling import resample

if TYPE_CHECKING:
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
    column known by its name; a column of dates or times of day. It may stay None. `resample_hz` interpolates every
    channel from the time stamps onto a uniform grid (cubic, without a low-pass). `block` (from 1) chooses among the
    blocks of rows of a text file or the sheets of a workbook; `lines`, the first and the last, are those that are read.
    Raises RecordingError if the file cannot be read, if time stamps are not uniform, or if two statements of the rate
    differ by more than 1 %; ChannelError for `time`; SettingError for a rate that is not positive.
    """
    file = os.fspath(path)
    for what, value in (("rate", rate_hz), ("resample", resample_hz)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise SettingError(f"{what}: expected a positive number of Hz, found {value:g}")
    if rate_hz is not None and resample_hz is not None:
        raise SettingError(
            "rate and resample exclude each other: one ignores the time stamps, the other interpolates them"
        )
    contents = read_contents(path, block=block, lines=lines)
    return recording_from(contents, file, rate_hz=rate_hz, time=time, resample_hz=resample_hz)


def recording_from(
    contents: Contents,
    file: str,
    *,
    rate_hz: float | None = None,
    time: str | None = None,
    resample_hz: float | None = None,
) -> Recording:
    """Settles the sampling rate of a file's contents, as `read_recording` describes."""
    columns = time_columns(contents, time, file)
    if resample_hz is not None:
        return resample(contents, file, columns, resample_hz)
    if rate_hz is not None:
        rate = Rate(float(rate_hz), "--rate", 0.0, tuple(doubts(contents, columns, rate_hz)))
    else:
        rate = settle(contents, columns, chosen=time is not None, file=file)
    channels = channels_of(contents, contents.series)
    return Recording(
        file, contents.format, channels, rate.hz, rate.source, rate.start_s, (*contents.notes, *rate.notes)
    )
