"""Recordings: a file's named channels, with units and one sampling rate."""

from __future__ import annotations

import difflib
import math
import os
import re
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import ChannelError, RecordingError, SettingError
from rthstrack.recording.pairing import propose_pair
from rthstrack.recording.readers import read_contents
from rthstrack.recording.readers.stamps import Irregular, Uniform, examine
from rthstrack.units import length_factor, seconds_in, split_unit, units_from_names

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from rthstrack.recording.readers.contents import Clock, Contents, Series

__all__ = ["Channel", "Recording", "length_factor", "propose_pair", "read_recording"]

# Two statements of the rate that differ by more contradict each other.
_AGREEMENT = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """One channel: `values` (n_samples,), read-only. `path` is its place in the file; `unit` None if not stated."""

    name: str
    path: str
    unit: str | None
    values: NDArray[np.float64] = field(repr=False)


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A file's channels, sampled at `rate_hz` (None if the file does not say) from `start_s` of its own time.

    `rate_source` says in words where the rate comes from, or why there is none. `notes` says what else was found,
    left out or done; `n_filled` how many samples of which channel (by path) were filled.
    """

    file: str
    format: str
    channels: tuple[Channel, ...]
    rate_hz: float | None
    rate_source: str
    start_s: float
    notes: tuple[str, ...]
    n_filled: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))

    def __getitem__(self, selector: str) -> Channel:
        """The channel of this name, path, or `#index`."""
        return self.channel(selector)

    def channel(self, selector: str) -> Channel:
        """The channel that `selector` names.

        By exact name or path, else by either without regard to case and blanks, else `#0`, `#1`, ... in the order of
        `channels` (as `rthstrack channels` lists them). Raises ChannelError if there is none or more than one.
        """
        return self.channels[_select(selector, [(c.name, c.path) for c in self.channels], self.file)]

    def scaled(self, factors: Mapping[str, float]) -> Recording:
        """The recording with some channels multiplied: {selector: factor}.

        A factor other than 1 or -1 makes the unit unknown. Raises SettingError for a factor that is zero or not finite.
        """
        channels = list(self.channels)
        notes = list(self.notes)
        for selector, factor in factors.items():
            if not (math.isfinite(factor) and factor != 0):
                raise SettingError(f"scale of '{selector}': expected a finite number other than zero, found {factor}")
            old = self.channel(selector)
            at = self.channels.index(old)
            if channels[at] is not old:
                raise SettingError(f"scale: '{selector}' names channel '{old.path}', which is scaled already")
            unit = old.unit if abs(factor) == 1 else None
            channels[at] = replace(old, unit=unit, values=_frozen(old.values * factor))
            notes.append(f"channel '{old.path}' scaled by {factor:g}" + (f" (was in {old.unit})" if old.unit else ""))
        return replace(self, channels=tuple(channels), notes=tuple(notes))

    def cut(self, start_s: float | None = None, end_s: float | None = None) -> Recording:
        """The samples from `start_s` up to, but not including, `end_s`, in seconds from the recording's first sample.

        Raises RecordingError without a rate or where nothing is left, SettingError for an impossible range.
        """
        if self.rate_hz is None:
            raise RecordingError(f"{self.file}: cannot cut by time: {self.rate_source}; give --rate HZ")
        start = 0.0 if start_s is None else start_s
        end = math.inf if end_s is None else end_s
        if not (0 <= start < end):
            raise SettingError(f"cut: expected 0 <= start < end in seconds, found start {start:g}, end {end:g}")
        longest = max(len(c.values) for c in self.channels)
        # Products with the rate are rounded: a bound within 1e-6 of a sample is on it.
        first = math.ceil(min(start * self.rate_hz, longest) - 1e-6)
        last = math.ceil(min(end * self.rate_hz, longest) - 1e-6)
        if first >= last:
            length = longest / self.rate_hz
            raise RecordingError(
                f"{self.file}: nothing left between {start:g} and {end:g} s; the recording is {length:g} s long"
            )
        notes = [
            *self.notes,
            f"cut to {first / self.rate_hz:g} s .. {last / self.rate_hz:g} s ({last - first} samples)",
        ]
        if end_s is not None and end_s * self.rate_hz > longest + 1e-6:
            notes.append(
                f"the recording ends at {longest / self.rate_hz:g} s, before the end of the cut at {end_s:g} s"
            )
        channels = tuple(replace(c, values=_frozen(c.values[first:last].copy())) for c in self.channels)
        return replace(self, channels=channels, start_s=self.start_s + first / self.rate_hz, notes=tuple(notes))

    def filled(self, max_gap_samples: int) -> Recording:
        """Gaps of up to `max_gap_samples` NaN or infinite samples replaced by linear interpolation.

        Longer gaps and those at the ends stay. `n_filled` and `notes` say how many samples were filled in each channel.
        """
        if max_gap_samples < 1:
            raise SettingError(f"fill: expected a gap of at least 1 sample, found {max_gap_samples}")
        channels = []
        notes = list(self.notes)
        n_filled = dict(self.n_filled)
        for old in self.channels:
            values, n_samples, n_gaps = _filled(old.values, max_gap_samples)
            if n_samples:
                n_filled[old.path] = n_filled.get(old.path, 0) + n_samples
                notes.append(f"channel '{old.path}': {n_samples} samples in {n_gaps} gap(s) filled by interpolation")
            channels.append(replace(old, values=values))
        return replace(self, channels=tuple(channels), notes=tuple(notes), n_filled=MappingProxyType(n_filled))


def read_recording(
    path: str | os.PathLike[str],
    *,
    rate_hz: float | None = None,
    time: str | None = None,
    resample_hz: float | None = None,
) -> Recording:
    """Reads a file of any known format, chosen by its content.

    The sampling rate comes from the first of: `rate_hz`; the channel named by `time`; a statement in the file; a time
    column known by its name; a column of dates or times of day. It may stay None. `resample_hz` interpolates every
    channel from the time stamps onto a uniform grid (cubic, without a low-pass).
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
    return recording_from(read_contents(path), file, rate_hz=rate_hz, time=time, resample_hz=resample_hz)


def recording_from(
    contents: Contents,
    file: str,
    *,
    rate_hz: float | None = None,
    time: str | None = None,
    resample_hz: float | None = None,
) -> Recording:
    """Settles the sampling rate of a file's contents, as `read_recording` describes."""
    columns = _time_columns(contents, time, file)
    if resample_hz is not None:
        return _resampled(contents, file, columns, resample_hz)
    if rate_hz is not None:
        rate = _Rate(float(rate_hz), "--rate", 0.0, tuple(_doubts(contents, columns, rate_hz)))
    else:
        rate = _settle(contents, columns, chosen=time is not None, file=file)
    channels = _channels(contents, contents.series)
    return Recording(
        file, contents.format, channels, rate.hz, rate.source, rate.start_s, (*contents.notes, *rate.notes)
    )


@dataclass(frozen=True, slots=True)
class _Rate:
    hz: float | None
    source: str
    start_s: float = 0.0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _TimeColumn:
    """A column that may tell the time: `what` names it in messages; `exact` unless it is a computer's clock."""

    what: str
    path: str
    stamps: NDArray[np.float64]
    unit_s: float
    is_clock: bool = False

    def examine(self) -> Uniform | Irregular:
        return examine(self.stamps, self.unit_s)


_TIME_NAMES = re.compile(
    r"t|times?|tout|zeit|messzeit|temps|tiempo|tempo|x[_ ]values?|time[ _-]?stamps?|time[ _-]?(?:axis|vector|base|\d+)|"
    r"(?:elapsed|running|relative|test|total|run|sample|measurement|record|simulation|sim)[ _-]?time",
    re.IGNORECASE,
)


def _time_columns(contents: Contents, chosen: str | None, file: str) -> list[_TimeColumn]:
    """The columns that may tell the time, best first; only the chosen one where one is."""
    series, clocks = contents.series, contents.clocks
    if chosen is not None:
        at = _select(chosen, [(c.name, c.path) for c in series] + [(c.name, c.path) for c in clocks], file)
        if at < len(series):
            return [_numeric_time(series[at], seconds_in(_unit(series[at])) or 1.0, "--time")]
        return [_clock_time(clocks[at - len(series)])]
    lengths = [len(s.values) for s in series]
    usual = max(lengths, key=lengths.count)
    found = []
    for one in series:
        unit_s = seconds_in(_unit(one))
        if len(one.values) == usual and _is_time(one, unit_s) and np.isfinite(one.values).any():
            found.append(_numeric_time(one, unit_s or 1.0))
    return found + [_clock_time(clock) for clock in clocks if np.isfinite(clock.seconds).any()]


def _is_time(series: Series, unit_s: float | None) -> bool:
    """Time by its name; a name that means other things too (T, Time 1) needs a unit of time or rising values."""
    stem, unit = split_unit(re.split(r"[/.]", series.name)[-1])
    stem = re.sub(r"\(.*\)$|\[.*\]$", "", stem).strip(" :_-'\"")
    if (unit or series.unit) is not None and unit_s is None:
        return False
    if _TIME_NAMES.fullmatch(stem):
        return stem != "T" or unit_s is not None or bool(np.all(np.diff(series.values) > 0))
    # "Time  1 - default sample rate" and the like, but not "time delay".
    loose = re.match(r"(time|zeit)\b", stem, re.IGNORECASE) is not None
    return loose and len(series.values) > 1 and bool(np.all(np.diff(series.values) > 0))


def _unit(series: Series) -> str | None:
    return series.unit or split_unit(series.name)[1]


def _numeric_time(series: Series, unit_s: float, how: str = "") -> _TimeColumn:
    what = f"time column '{series.path}'" + (f" ({how})" if how else "")
    return _TimeColumn(what, series.path, series.values, unit_s)


def _clock_time(clock: Clock) -> _TimeColumn:
    return _TimeColumn(f"date-time column '{clock.path}'", clock.path, clock.seconds, 1.0, is_clock=True)


def _settle(contents: Contents, columns: Sequence[_TimeColumn], *, chosen: bool, file: str) -> _Rate:
    """The rate by the order of `read_recording`, every contradiction an error."""
    if chosen:
        verdict = columns[0].examine()
        if isinstance(verdict, Irregular):
            raise RecordingError(f"{file}: {columns[0].what} {verdict.problem}; {_hint(verdict)}")
        ignored = [s for s in contents.statements if not _agree(verdict, s.rate_hz)]
        said = tuple(f"{s.source} says {s.rate_hz:g} Hz, but --time was followed" for s in ignored)
        return _Rate(verdict.rate_hz, columns[0].what, verdict.start_s, said)
    stated = _stated(contents, file)
    numeric = [column for column in columns if not column.is_clock]
    clocks = [column for column in columns if column.is_clock]
    told = _told(numeric, stated, file)
    if stated is not None and stated.hz is None:
        return told if told is not None and told.hz is not None else stated
    rate = stated or told
    if stated is not None and told is not None:
        rate = replace(stated, start_s=told.start_s, notes=(*stated.notes, *told.notes))
    if rate is not None and rate.hz is None:
        return rate
    notes: list[str] = []
    for clock in clocks:
        verdict = clock.examine()
        if rate is None:
            if isinstance(verdict, Irregular):
                raise RecordingError(f"{file}: {clock.what} {verdict.problem}; {_hint(verdict)}")
            rate = _Rate(verdict.rate_hz, clock.what)
        elif rate.hz is not None:
            notes += _compare_clock(rate, clock, verdict, file)
    if rate is not None:
        return replace(rate, notes=(*rate.notes, *notes))
    return _guessed(contents) or _Rate(None, "the file states no sampling rate and has no time column")


def _stated(contents: Contents, file: str) -> _Rate | None:
    """What the file's header, attributes or single numbers say."""
    whole = [s for s in contents.statements if s.channel is None]
    single = [s for s in contents.statements if s.channel is not None]
    for other in whole[1:]:
        if abs(other.rate_hz - whole[0].rate_hz) > _AGREEMENT * whole[0].rate_hz:
            raise RecordingError(
                f"{file}: {whole[0].source} says {whole[0].rate_hz:g} Hz, but {other.source} says {other.rate_hz:g} Hz"
                "; give --rate HZ"
            )
    if whole:
        return _Rate(whole[0].rate_hz, whole[0].source)
    if not single:
        return None
    slow, fast = (pick(single, key=lambda s: s.rate_hz) for pick in (min, max))
    if fast.rate_hz - slow.rate_hz > 1e-6 * fast.rate_hz:
        return _Rate(
            None,
            f"the channels have different sampling rates ({slow.source}: {slow.rate_hz:g} Hz for '{slow.channel}', "
            f"{fast.rate_hz:g} Hz for '{fast.channel}')",
        )
    return _Rate(single[0].rate_hz, single[0].source)


def _told(columns: Sequence[_TimeColumn], stated: _Rate | None, file: str) -> _Rate | None:
    """What the numeric time columns say; irregular ones are an error unless another one is uniform."""
    verdicts = [(column, column.examine()) for column in columns]
    uniform = [(c, v) for c, v in verdicts if isinstance(v, Uniform)]
    irregular = [(c, v) for c, v in verdicts if isinstance(v, Irregular)]
    if irregular and not uniform:
        column, problem = irregular[0]
        says = f"{stated.source} says {stated.hz:g} Hz, but " if stated and stated.hz else ""
        raise RecordingError(f"{file}: {says}{column.what} {problem.problem}; {_hint(problem)}")
    if not uniform:
        return None
    column, first = uniform[0]
    if stated is not None and stated.hz is not None:
        for other, verdict in uniform:
            if not _agree(verdict, stated.hz):
                raise RecordingError(
                    f"{file}: {stated.source} says {stated.hz:g} Hz, but {other.what} says {verdict.rate_hz:g} Hz; "
                    "give --rate HZ"
                )
    for other, verdict in uniform[1:]:
        if not _agree(verdict, first.rate_hz):
            return _Rate(
                None,
                f"{column.what} says {first.rate_hz:g} Hz, but {other.what} {verdict.rate_hz:g} Hz; "
                "name one with --time",
            )
    notes = [f"{c.what} {v.problem}; it was not used" for c, v in irregular]
    if first.rounded and first.high_hz - first.low_hz > 2e-3 * first.rate_hz:
        notes.append(
            f"{column.what} is rounded: any rate from {first.low_hz:.6g} to {first.high_hz:.6g} Hz fits it; "
            "give --rate HZ if you know better"
        )
    return _Rate(first.rate_hz, column.what, first.start_s, tuple(notes))


def _compare_clock(rate: _Rate, clock: _TimeColumn, verdict: Uniform | Irregular, file: str) -> list[str]:
    """A computer's clock beside a better source: it may jitter (a note), but not run at another rate."""
    assert rate.hz is not None
    if isinstance(verdict, Uniform) and _agree(verdict, rate.hz):
        return []
    if isinstance(verdict, Irregular):
        if not math.isfinite(verdict.mean_rate_hz) or abs(verdict.mean_rate_hz - rate.hz) <= _AGREEMENT * rate.hz:
            return [f"{clock.what} {verdict.problem}; {rate.source} was followed"]
        says = verdict.mean_rate_hz
    else:
        says = verdict.rate_hz
    raise RecordingError(
        f"{file}: {rate.source} says {rate.hz:g} Hz, but {clock.what} says {says:g} Hz; give --rate HZ"
    )


def _guessed(contents: Contents) -> _Rate | None:
    """The first column where columns have no names, if it rises evenly in steps that are no count."""
    first = contents.series[0]
    if not contents.nameless or len(contents.series) < 2 or len(first.values) < 4:
        return None
    verdict = examine(first.values)
    if isinstance(verdict, Irregular) or abs(verdict.rate_hz - 1) < 1e-6:
        return None
    source = f"column '{first.path}' (it has no name, but rises evenly: taken as time in s)"
    return _Rate(verdict.rate_hz, source, verdict.start_s)


def _doubts(contents: Contents, columns: Sequence[_TimeColumn], rate_hz: float) -> list[str]:
    """What in the file contradicts a rate that the user gave."""
    said = [
        f"{s.source} says {s.rate_hz:g} Hz, but --rate was followed"
        for s in contents.statements
        if abs(s.rate_hz - rate_hz) > _AGREEMENT * rate_hz
    ]
    for column in columns:
        verdict = column.examine()
        if isinstance(verdict, Irregular):
            said.append(f"{column.what} {verdict.problem}; --rate was followed")
        elif not _agree(verdict, rate_hz):
            said.append(f"{column.what} says {verdict.rate_hz:g} Hz, but --rate was followed")
    return said


def _agree(verdict: Uniform, rate_hz: float) -> bool:
    return verdict.low_hz * (1 - _AGREEMENT) <= rate_hz <= verdict.high_hz * (1 + _AGREEMENT)


def _hint(problem: Irregular) -> str:
    if problem.increasing:
        return "--resample HZ interpolates onto a uniform grid, --rate HZ ignores the stamps"
    return "--rate HZ ignores the stamps (--resample needs stamps that increase)"


def _resampled(contents: Contents, file: str, columns: Sequence[_TimeColumn], hz: float) -> Recording:
    """Every channel on a uniform grid from the first stamp on, by a cubic spline through the samples."""
    from scipy.interpolate import CubicSpline

    if not columns:
        raise RecordingError(f"{file}: cannot resample: no time column; name one with --time, or give --rate HZ")
    column = columns[0]
    stamps = column.stamps * column.unit_s
    verdict = column.examine()
    if not (len(stamps) > 1 and np.isfinite(stamps).all() and np.all(np.diff(stamps) > 0)):
        problem = verdict.problem if isinstance(verdict, Irregular) else "does not increase"
        raise RecordingError(
            f"{file}: cannot resample: expected stamps that increase strictly, but {column.what} {problem}"
        )
    stamps = stamps - stamps[0]
    mean_hz = (len(stamps) - 1) / float(stamps[-1])
    if not 0.9 * mean_hz <= hz <= 10 * mean_hz:
        why = (
            "fewer would alias, for there is no low-pass (use -P)" if hz < mean_hz else "more would only invent samples"
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
        raise RecordingError(f"{file}: cannot resample: no channel has the {len(stamps)} samples of {column.what}")
    steps = np.diff(stamps)
    notes = [
        *contents.notes,
        f"resampled to {hz:g} Hz by cubic splines from {column.what}: "
        f"steps of {steps.min():.6g} to {steps.max():.6g} s, mean {steps.mean():.6g} s",
    ]
    if left_out:
        notes.append(f"left out when resampling, for their length is not that of {column.what}: {', '.join(left_out)}")
    start = float(column.stamps[0]) * column.unit_s
    source = f"--resample, from {column.what}"
    return Recording(file, contents.format, _channels(contents, series), float(hz), source, start, tuple(notes))


def _channels(contents: Contents, series: Sequence[Series]) -> tuple[Channel, ...]:
    # Units are read from all names together: what x_m means depends on whether there is an x_t.
    all_names = [s.name for s in contents.series]
    by_name = dict(zip(all_names, units_from_names(all_names), strict=True))
    return tuple(Channel(s.name, s.path, s.unit or by_name[s.name], _frozen(s.values)) for s in series)


def _frozen(values: NDArray[np.float64]) -> NDArray[np.float64]:
    values = np.ascontiguousarray(values, dtype=np.float64)
    values.setflags(write=False)
    return values


def _filled(values: NDArray[np.float64], longest: int) -> tuple[NDArray[np.float64], int, int]:
    """The values with short gaps interpolated, how many samples that were, and in how many gaps."""
    missing = ~np.isfinite(values)
    if not missing.any():
        return values, 0, 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]]).astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    inner = (starts > 0) & (ends < len(values)) & (ends - starts <= longest)
    wanted = np.zeros(len(values) + 1, dtype=np.int64)
    np.add.at(wanted, starts[inner], 1)
    np.add.at(wanted, ends[inner], -1)
    gaps = np.cumsum(wanted)[:-1] > 0
    known = np.flatnonzero(~missing)
    out = values.copy()
    out[gaps] = np.interp(np.flatnonzero(gaps), known, values[known])
    return _frozen(out), int(np.count_nonzero(gaps)), int(np.count_nonzero(inner))


def _select(selector: str, channels: Sequence[tuple[str, str]], file: str) -> int:
    """The index of the one channel, given as (name, path), that a selector names."""

    def loose(text: str) -> str:
        return re.sub(r"\s+", "", text).casefold()

    matches = [i for i, both in enumerate(channels) if selector in both]
    if not matches:
        matches = [i for i, both in enumerate(channels) if loose(selector) in map(loose, both)]
    if len(matches) == 1:
        return matches[0]
    if matches:
        listed = ", ".join(f"#{i} '{channels[i][1]}'" for i in matches)
        raise ChannelError(f"{file}: '{selector}' names {len(matches)} channels: {listed}; choose one by #index")
    listed = ", ".join(f"#{i} '{name}'" for i, (name, _) in enumerate(channels[:20]))
    listed += f" and {len(channels) - 20} more" if len(channels) > 20 else ""
    if index := re.fullmatch(r"#(\d{1,9})", selector.strip()):
        if int(index[1]) < len(channels):
            return int(index[1])
        raise ChannelError(
            f"{file}: no channel '{selector}': there are {len(channels)}, #0 to #{len(channels) - 1}: {listed}"
        )
    by_text = {loose(text): i for i, both in enumerate(channels) for text in both}
    near = dict.fromkeys(by_text[text] for text in difflib.get_close_matches(loose(selector), by_text, n=3))
    meant = f" (did you mean {' or '.join(repr(channels[i][0]) for i in near)}?)" if near else ""
    raise ChannelError(f"{file}: no channel '{selector}'{meant}; there are: {listed}")
