"""Files of any known format as recordings."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

from rthstrack.errors import SettingError
from rthstrack.recording.clocks import clocks_told, own_times, timelines
from rthstrack.recording.rate import Rate, doubts, settle, time_columns, with_others
from rthstrack.recording.readers import read_contents
from rthstrack.recording.readers.stamps import Uniform
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
) -> Recording:
    """Reads a file of any known format, chosen by its content.

    The sampling rate comes from the first of: `rate_hz`; the channel named by `time`; a statement in the file; a time
    column known by its name; a column of dates or times of day. It may stay None. Channels that have a time of their
    own carry it (`Channel.time`); `on_one_clock` puts some on one. `resample_hz` interpolates every channel from its
    time stamps onto a uniform grid (cubic, without a low-pass).
    Raises RecordingError if the file cannot be read, if time stamps are not uniform, or if two statements of the rate
    differ by more than 1 %; ChannelError for `time`; SettingError for a rate that is not positive.
    """
    checked_rates(rate_hz, resample_hz)
    return recording_from(read_contents(path), os.fspath(path), rate_hz=rate_hz, time=time, resample_hz=resample_hz)


def checked_rates(rate_hz: float | None, resample_hz: float | None) -> None:
    """Raises SettingError for rates that cannot be, or not together."""
    for what, value in (("rate", rate_hz), ("resample", resample_hz)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise SettingError(f"{what}: expected a positive number of Hz, found {value:g}")
    if rate_hz is not None and resample_hz is not None:
        raise SettingError(
            "rate and resample exclude each other: one ignores the time stamps, the other interpolates them"
        )


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
    lines = timelines(contents, [c for c in columns if not c.is_clock] if time is None else [], file)
    if resample_hz is not None:
        return resample(contents, file, columns, lines, resample_hz)
    main = [*lines.main, *(column for column in columns if column.is_clock)] if time is None else columns
    if rate_hz is not None:
        rate = Rate(float(rate_hz), "--rate", 0.0, tuple(doubts(contents, columns, rate_hz)))
    else:
        rate = settle(contents, main, chosen=time is not None, file=file)
        length = len(lines.main[0].stamps) if lines.main else 0
        others = {c for c in lines.of if c is not None and c not in lines.main and len(c.stamps) == length}
        rate = with_others(rate, sorted(others, key=lambda c: c.index), file)
    times = own_times(contents, lines, rate, given=rate_hz is not None)
    places = {column.index for column in columns if isinstance(column.examine(), Uniform)}
    channels = channels_of(contents, contents.series, times, places)
    notes = (*contents.notes, *rate.notes, *lines.notes, *clocks_told(channels))
    return Recording(file, contents.format, channels, rate.hz, rate.source, rate.start_s, notes)
