"""Recordings: a file's named channels, with units and one sampling rate."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.errors import ChannelError, RecordingError, SettingError
from rthstrack.said import Said
from rthstrack.units import stem_and_unit, units_from_names
from rthstrack.values import Shown, Value, extent, frame, needed

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

    from rthstrack.recording.readers.contents import Contents, Series


@dataclass(frozen=True, slots=True)
class OwnTime:
    """A channel's own clock: where it comes from, its rate, the time of the first sample; or what is wrong with it.

    Its stamps allow the rates `low_hz` to `high_hz`. kind: what its name says it counts ("total", "running"), if any.
    said: what is to be told wherever it is followed.
    """

    source: str
    rate_hz: float | None
    start_s: float
    low_hz: float = math.nan
    high_hz: float = math.nan
    problem: str = ""
    kind: str = ""
    said: tuple[Said, ...] = ()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Channel(Value):
    """One channel: `values` (n_samples,), read-only. `path` is its place in the file; `unit` None if not stated.

    time: its own clock where a file has several (`on_one_clock`), None where it is the recording's.
    is_time: it holds the time, and no motion.
    """

    name: str
    path: str
    unit: str | None
    values: NDArray[np.float64]
    time: OwnTime | None = None
    is_time: bool = False

    def __len__(self) -> int:
        return len(self.values)

    def _shown(self) -> Shown:
        rows = [("path", self.path)] if self.path != self.name else []
        rows.append(("values", extent(self.values, 1.0, self.unit or "")))
        if self.time is not None:
            rows.append(("time", self.time.source))
        return Shown(f"Channel '{self.name}': {len(self)} samples", rows)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Recording(Value):
    """A file's channels, sampled at `rate_hz` (None if the file does not say) from `start_s` of its own time.

    `rate_source` says in words where the rate comes from, or why there is none. `notes` says what else was found,
    left out or done, mostly with a code; `n_filled` how many samples of which channel (by path) were filled.
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

    def __len__(self) -> int:
        """How many channels there are."""
        return len(self.channels)

    def __iter__(self) -> Iterator[Channel]:
        return iter(self.channels)

    def __contains__(self, selector: object) -> bool:
        """Whether `selector` names one channel, or is one of them."""
        if not isinstance(selector, str):
            return any(selector is channel for channel in self.channels)
        try:
            self.channel(selector)
        except ChannelError:
            return False
        return True

    @property
    def time_s(self) -> NDArray[np.float64]:
        """The times of the samples, of the longest channel on the recording's clock: start_s + i / rate_hz.

        Raises RecordingError without a rate.
        """
        if self.rate_hz is None:
            raise RecordingError(f"no times: {self.rate_source}", file=self.file, advice="give {rate_hz}")
        n = max((len(channel) for channel in self.channels if channel.time is None), default=0)
        return frozen(self.start_s + np.arange(n) / self.rate_hz)

    def to_frame(self) -> pd.DataFrame:
        """The channels but those of the time as columns of a pandas DataFrame, times (time_s) as its index.

        Without a rate the index counts samples; a channel that ends sooner ends in NaN; `attrs["units"]` has the units.
        Raises RecordingError for channels with clocks of their own, RthstrackError without pandas.
        """
        needed("pandas", "to_frame")
        index, columns = self._on_index()
        made = frame({name: values for name, (values, _) in columns.items()}, index[1])
        made.index.name = index[0]
        made.attrs["units"] = {name: unit for name, (_, unit) in columns.items()}
        return made

    def to_xarray(self) -> xr.Dataset:
        """The same as an xarray Dataset along `time_s`, each channel with its unit in `attrs`."""
        xarray = needed("xarray", "to_xarray")
        (name, index), columns = self._on_index()
        units = {channel: {} if unit is None else {"units": unit} for channel, (_, unit) in columns.items()}
        data = {channel: (name, values, units[channel]) for channel, (values, _) in columns.items()}
        about: dict[str, Any] = {"file": self.file, "rate_source": self.rate_source}
        about |= {} if self.rate_hz is None else {"rate_hz": self.rate_hz}
        seconds = {"units": "s"} if self.rate_hz is not None else {}
        made: xr.Dataset = xarray.Dataset(data, {name: (name, index, seconds)}, about)
        return made

    def _on_index(
        self,
    ) -> tuple[tuple[str, NDArray[np.generic]], dict[str, tuple[NDArray[np.float64], str | None]]]:
        """The index with its name, and each channel of one length with its unit, by a name that only it has."""
        channels = [channel for channel in self.channels if not channel.is_time]
        if own := [channel for channel in channels if channel.time is not None]:
            raise RecordingError(
                f"{len(own)} of {len(channels)} channels have clocks of their own, such as '{own[0].path}'",
                file=self.file,
                code="own_times",
                advice="put those you need on one: rthstrack.recording.on_one_clock(recording, names)",
            )
        n = max(map(len, channels), default=0)
        has_rate = self.rate_hz is not None
        index: NDArray[np.generic] = self.time_s[:n] if has_rate else np.arange(n)
        index_name = "time_s" if has_rate else "sample"
        columns = {}
        for i, channel in enumerate(self.channels):
            if channel.is_time:
                continue
            taken = [index_name, *(one for c in self.channels if c is not channel for one in (c.name, c.path))]
            name = next((one for one in (channel.name, channel.path) if one not in taken), f"#{i}")
            missing = np.full(n - len(channel), np.nan)
            columns[name] = (np.concatenate((channel.values, missing)), channel.unit)
        return (index_name, index), columns

    def _shown(self) -> Shown:
        rows = [(c.name, f"{len(c)} samples{f' in {c.unit}' if c.unit else ''}") for c in self.channels]
        rate = "no rate" if self.rate_hz is None else f"{self.rate_hz:g} Hz"
        n = len(self.channels)
        return Shown(f"Recording {self.file} ({self.format}): {n} channel{'s' * (n != 1)}, {rate}", rows)

    def channel(self, selector: str) -> Channel:
        """The channel that `selector` names.

        By exact name or path, else by either without regard to case and blanks, else by name without its unit
        (`target` for `target (mm)`), else `#0`, `#1`, ... in the order of `channels` (as `rthstrack channels` lists
        them). Raises ChannelError if there is none or more than one.
        """
        return self.channels[select(selector, [(c.name, c.path) for c in self.channels], self.file)]

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
            channels[at] = replace(old, unit=unit, values=frozen(old.values * factor))
            words = f"channel '{old.path}' scaled by {factor:g}" + (f" (was in {old.unit})" if old.unit else "")
            notes.append(Said(words, "scaled", [factor]))
        return replace(self, channels=tuple(channels), notes=tuple(notes))

    def cut(self, start_s: float | None = None, end_s: float | None = None) -> Recording:
        """The samples from `start_s` up to, but not including, `end_s`, in seconds from the recording's first sample.

        Raises RecordingError without a rate or where nothing is left, SettingError for an impossible range.
        """
        if self.rate_hz is None:
            raise RecordingError(f"cannot cut by time: {self.rate_source}", file=self.file, advice="give {rate_hz}")
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
                f"nothing left between {start:g} and {end:g} s; the recording is {length:g} s long", file=self.file
            )
        notes = [
            *self.notes,
            Said(
                f"cut to {first / self.rate_hz:g} s .. {last / self.rate_hz:g} s ({last - first} samples)",
                "cut",
                (first / self.rate_hz, last / self.rate_hz),
            ),
        ]
        if end_s is not None and end_s * self.rate_hz > longest + 1e-6:
            ends_s = longest / self.rate_hz
            words = f"the recording ends at {ends_s:g} s, before the end of the cut at {end_s:g} s"
            notes.append(Said(words, "cut_short", (ends_s, end_s)))
        channels = tuple(self._cut(channel, first, last) for channel in self.channels)
        return replace(self, channels=channels, start_s=self.start_s + first / self.rate_hz, notes=tuple(notes))

    def _cut(self, channel: Channel, first: int, last: int) -> Channel:
        """A channel from one sample of the recording's clock to another; one with its own clock at the same times."""
        time = channel.time
        if time is not None and time.rate_hz is not None and self.rate_hz is not None:
            n, early = len(channel.values), self.start_s - time.start_s
            first, last = (
                min(max(math.ceil((early + edge / self.rate_hz) * time.rate_hz - 1e-6), 0), n) for edge in (first, last)
            )
            time = replace(time, start_s=time.start_s + first / time.rate_hz)
        return replace(channel, values=frozen(channel.values[first:last].copy()), time=time)

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
                words = f"channel '{old.path}': {n_samples} samples in {n_gaps} gap(s) filled by interpolation"
                notes.append(Said(words, "filled", (n_samples, n_gaps)))
            channels.append(replace(old, values=values))
        return replace(self, channels=tuple(channels), notes=tuple(notes), n_filled=MappingProxyType(n_filled))


def channels_of(
    contents: Contents,
    series: Sequence[Series],
    times: Sequence[OwnTime | None] = (),
    time_places: Collection[int] = (),
) -> tuple[Channel, ...]:
    """The series as channels, with their own times if there are any; those at `time_places` hold the time."""
    # Units are read from all names together: what x_m means depends on whether there is an x_t.
    all_names = [s.name for s in contents.series]
    by_name = dict(zip(all_names, units_from_names(all_names), strict=True))
    own = times or [None] * len(series)
    return tuple(
        Channel(s.name, s.path, s.unit or by_name[s.name], frozen(s.values), time, i in time_places)
        for i, (s, time) in enumerate(zip(series, own, strict=True))
    )


def frozen(values: NDArray[np.float64]) -> NDArray[np.float64]:
    values = np.ascontiguousarray(values, dtype=np.float64)
    values.setflags(write=False)
    return values


def _filled(values: NDArray[np.float64], longest: int) -> tuple[NDArray[np.float64], int, int]:
    """The values with short gaps interpolated, how many samples that were, and in how many gaps."""
    missing = ~np.isfinite(values)
    if not missing.any() or missing.all():
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
    return frozen(out), int(np.count_nonzero(gaps)), int(np.count_nonzero(inner))


def select(selector: str, channels: Sequence[tuple[str, str]], file: str) -> int:
    """The index of the one channel, given as (name, path), that a selector names."""

    def loose(text: str) -> str:
        return re.sub(r"\s+", "", text).casefold()

    matches = [i for i, both in enumerate(channels) if selector in both]
    if not matches:
        matches = [i for i, both in enumerate(channels) if loose(selector) in map(loose, both)]
    if not matches:
        # target, target [mm] and target_mm are target (mm), where there is but one.
        ((stem, unit),), fits = stem_and_unit([selector]), []
        for parts in zip(*(stem_and_unit(list(one)) for one in zip(*channels, strict=True)), strict=True):
            fits.append(any(loose(s) == loose(stem) and (unit is None or u in (None, unit)) for s, u in parts))
        matches = [i for i, fit in enumerate(fits) if fit]
    if len(matches) == 1:
        return matches[0]
    if matches:
        listed = ", ".join(f"#{i} '{channels[i][1]}'" for i in matches)
        raise ChannelError(f"'{selector}' names {len(matches)} channels: {listed}; choose one by #index", file=file)
    listed = ", ".join(f"#{i} '{name}'" for i, (name, _) in enumerate(channels[:20]))
    listed += f" and {len(channels) - 20} more" if len(channels) > 20 else ""
    if index := re.fullmatch(r"#(\d{1,9})", selector.strip()):
        if int(index[1]) < len(channels):
            return int(index[1])
        raise ChannelError(
            f"no channel '{selector}': there are {len(channels)}, #0 to #{len(channels) - 1}: {listed}", file=file
        )
    by_text = {loose(text): i for i, both in enumerate(channels) for text in both}
    import difflib  # nobody waits for it where nothing is wrong

    near = dict.fromkeys(by_text[text] for text in difflib.get_close_matches(loose(selector), by_text, n=3))
    meant = f" (did you mean {' or '.join(repr(channels[i][0]) for i in near)}?)" if near else ""
    raise ChannelError(f"no channel '{selector}'{meant}; there are: {listed}", file=file)
