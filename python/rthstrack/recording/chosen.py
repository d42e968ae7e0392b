"""From a file to the signals that are judged: read, propose, fill, put on one clock, scale, convert, cut."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rthstrack.errors import ChannelError, RecordingError, SettingError
from rthstrack.recording.clocks import on_one_clock
from rthstrack.recording.pairing import propose_pair
from rthstrack.recording.rate import time_columns
from rthstrack.recording.readers import read_contents
from rthstrack.recording.reading import checked_rates, recording_from
from rthstrack.recording.recording import OwnTime, Recording, frozen, select
from rthstrack.said import Said
from rthstrack.units import is_unit, quantity, size_in_si

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from rthstrack.recording.readers.contents import Contents
    from rthstrack.recording.recording import Channel


class ChosenPairs(NamedTuple):
    """A recording as it is judged, its rate, (target, measured) as selectors, and why these if they were proposed."""

    recording: Recording
    rate_hz: float
    pairs: list[tuple[str, str]]
    proposal: Said | None


def read_chosen(
    path: str | os.PathLike[str],
    *,
    targets: Sequence[str] = (),
    measured: Sequence[str] = (),
    commands: Sequence[str] = (),
    rate_hz: float | None = None,
    time: str | None = None,
    resample_hz: float | None = None,
    units: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
    fill: int | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    block: int | None = None,
    lines: tuple[int, int] | None = None,
) -> ChosenPairs:
    """Reads a file, takes the pairs named or proposes them, fills gaps, puts pairs on one clock, scales and cuts.

    units: {selector: unit}, with "" for all channels of pairs that state none. Where target and measured state units
    that differ, measured (and its command) is converted, and the notes say so.
    Raises RecordingError, ChannelError, SettingError, with the file named; no sampling rate is an error.
    """
    file = os.fspath(path)
    checked_rates(rate_hz, resample_hz)
    contents = read_contents(path, block=block, lines=lines)
    contents, units, scale = of_time(contents, time, units or {}, scale or {}, file)
    recording = recording_from(contents, file, rate_hz=rate_hz, time=time, resample_hz=resample_hz)
    return choose(
        recording,
        targets=targets,
        measured=measured,
        commands=commands,
        units=units,
        scale=scale,
        fill=fill,
        start_s=start_s,
        end_s=end_s,
    )


def choose(
    recording: Recording,
    *,
    targets: Sequence[str] = (),
    measured: Sequence[str] = (),
    commands: Sequence[str] = (),
    units: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
    fill: int | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
) -> ChosenPairs:
    """The same of a recording that was read."""
    file = recording.file
    if recording.rate_hz is None and all(c.time is None or c.time.rate_hz is None for c in recording.channels):
        raise _no_rate(recording.rate_source, file)
    pairs, proposal = list(zip(targets, measured, strict=False)), None
    if len(targets) != len(measured):
        raise SettingError(f"one measured for each target is needed, found {len(measured)} for {len(targets)}")
    if not pairs:
        pairs, proposal = propose_pair(recording)
    judged = [one for pair in pairs for one in pair]
    for one in (*judged, *commands):
        _refuse_time(recording.channel(one), file)
    if fill:
        recording = recording.filled(fill)
    recording = on_one_clock(recording, (*judged, *commands))
    recording = _in_units(recording, units or {}, judged)
    recording = recording.scaled(scale or {})
    for i, (target, answered) in enumerate(pairs):
        for one in (answered, *commands[i : i + 1]):
            recording = _converted(recording, target, one)
    if start_s is not None or end_s is not None:
        recording = recording.cut(start_s, end_s)
    if recording.rate_hz is None:
        raise _no_rate(recording.rate_source, file)
    _refuse_blank_ends(recording, judged)
    return ChosenPairs(recording, recording.rate_hz, pairs, proposal)


def _no_rate(why: str, file: str) -> RecordingError:
    return RecordingError(f"no sampling rate: {why}", file=file, advice="give {rate_hz} or {time}")


def _refuse_time(channel: Channel, file: str) -> None:
    if channel.is_time:
        raise ChannelError(f"'{channel.path}' holds the time, and no motion", file=file, code="time")


def read_two(
    target: tuple[str, str],
    measured: tuple[str, str],
    *,
    align: bool = False,
    rate_hz: float | None = None,
    time: str | None = None,
    resample_hz: float | None = None,
    units: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
    fill: int | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    block: int | None = None,
    lines: tuple[int, int] | None = None,
) -> ChosenPairs:
    """Target out of one file, measured out of another, each given as (file, channel), on the clock they have in common.

    align: where they have none, measured is laid where it resembles target most; the delay then says nothing.
    Raises RecordingError, ChannelError, SettingError; without a clock in common, unless `align` is asked for.
    """
    checked_rates(rate_hz, resample_hz)
    sides: list[tuple[Channel, str, Recording]] = []
    from_ns, units, scale = 0, dict(units or {}), dict(scale or {})
    for file, selector in (target, measured):
        contents = read_contents(file, block=block, lines=lines)
        contents, units, scale = of_time(contents, time, units, scale, file, lenient=True)
        recording = recording_from(contents, file, rate_hz=rate_hz, time=time, resample_hz=resample_hz)
        channel = recording.channel(selector)
        _refuse_time(channel, file)
        own = channel.time or OwnTime(recording.rate_source, recording.rate_hz, recording.start_s)
        if own.rate_hz is None:
            why = own.problem or recording.rate_source
            raise _no_rate(why, file)
        counts, first_ns = _counts_from(contents, recording, given=rate_hz is not None)
        from_ns = first_ns if not sides else from_ns
        start = (first_ns - from_ns) / 1e9
        label = f"{Path(file).name}:{channel.name}"
        sides.append((replace(channel, path=label, time=replace(own, start_s=own.start_s + start)), counts, recording))
    (asked, asked_from, first), (answered, answered_from, second) = sides
    file = f"{target[0]} and {measured[0]}"
    notes = [*first.notes, *(note for note in second.notes if note not in first.notes)]
    notes = [note for note in notes if getattr(note, "code", "") != "own_times"]
    both = Recording(file, first.format, (asked, answered), None, "two files", 0.0, tuple(notes))
    if fill:
        both = both.filled(fill)
    if align:
        both = _aligned(both)
    elif {"", "rate"} & {asked_from, answered_from} or asked_from != answered_from:
        counted = ((target[0], asked_from), (measured[0], answered_from))
        told = " and ".join(f"{name} {_COUNTS[counts]}" for name, counts in counted)
        raise RecordingError(
            f"the two files have no clock in common: {told}",
            file=file,
            code="no_common_clock",
            advice="{align} lays measured where it resembles target most; the delay then says nothing",
        )
    elif asked_from == "seconds":
        cause = "if both files count their time from one instant"
        words = f"the times of both files are taken to count from one instant, which they do not say ({file})"
        both = replace(both, notes=(*both.notes, Said(words, "clocks_assumed", (), cause)))
    pair = ("#0", "#1")
    both = on_one_clock(both, pair)
    both = _converted(_in_units(both, units, pair).scaled(scale), *pair)
    if start_s is not None or end_s is not None:
        both = both.cut(start_s, end_s)
    assert both.rate_hz is not None
    return ChosenPairs(both, both.rate_hz, [pair], None)


#: What a file's time counts from, in words.
_COUNTS = {
    "": "has no time column",
    "rate": "is read at the rate that was given",
    "seconds": "counts seconds",
    "epoch": "counts seconds since 1970",
    "dates": "has dates",
    "day": "has times of day",
}


def _counts_from(contents: Contents, recording: Recording, *, given: bool) -> tuple[str, int]:
    """From when a file counts its time (a key of `_COUNTS`), and its first entry in ns if that is a date."""
    if given:
        return "rate", 0
    columns = time_columns(contents, None, recording.file)
    if any(not column.is_clock for column in columns):
        return ("epoch" if recording.start_s > _YEAR_S else "seconds"), 0
    first = contents.clocks[0].first_ns if columns else None
    if first is not None:
        return ("dates" if abs(first) > 1e9 * _YEAR_S else "day"), first
    if any(one.start_s is not None for one in contents.series):
        return "seconds", 0
    return "", 0


def _aligned(recording: Recording) -> Recording:
    """Two channels laid where they resemble each other most, to a sample of the slower one."""
    target, measured = recording.channels
    assert target.time is not None
    assert measured.time is not None
    hz = min(float(channel.time.rate_hz or 0) for channel in (target, measured) if channel.time is not None)
    x, y = (_at(channel, hz) for channel in (target, measured))
    n = 1 << (len(x) + len(y)).bit_length()
    product = np.fft.irfft(np.fft.rfft(y, n) * np.conj(np.fft.rfft(x, n)), n)
    lag = int(product.argmax())
    likeness = float(product[lag] / (np.linalg.norm(x) * np.linalg.norm(y)))
    lag -= n if lag > n // 2 else 0
    if not likeness >= _LIKE:
        raise RecordingError(
            f"the two channels do not resemble each other (correlation {likeness:.2f}, expected {_LIKE:g} or more)",
            file=recording.file,
            code="not_alike",
        )
    moved = replace(measured, time=replace(measured.time, start_s=target.time.start_s - lag / hz))
    cause = "with both files aligned by correlation, so that the delay says nothing"
    words = f"the two files were aligned by correlation ({likeness:.3f}), as asked for: the delay says nothing"
    notes = (*recording.notes, Said(words, "clocks_aligned", [lag / hz], cause))
    return replace(recording, channels=(target, moved), notes=notes)


def _at(channel: Channel, hz: float) -> NDArray[np.float64]:
    """A channel at another rate, roughly, less its mean; missing samples are at the mean."""
    assert channel.time is not None
    assert channel.time.rate_hz is not None
    at = np.arange(int(len(channel.values) * hz / channel.time.rate_hz)) * channel.time.rate_hz / hz
    values = np.interp(at, np.arange(len(channel.values)), channel.values)
    values = values - np.nanmean(values)
    return np.where(np.isfinite(values), values, 0.0)


# More than a year from zero is no time since a test began.
_YEAR_S = 3.2e7
# What two channels' correlation must be to be aligned by it.
_LIKE = 0.8


def of_time(
    contents: Contents,
    time: str | None,
    units: Mapping[str, str],
    scale: Mapping[str, float],
    file: str,
    *,
    lenient: bool = False,
) -> tuple[Contents, dict[str, str], dict[str, float]]:
    """The contents with what is said of columns of time done, and the units and factors that are left to do.

    lenient: a channel that is not there is left, too.
    """
    for unit in units.values():
        if not is_unit(unit):
            raise SettingError(f"unit: expected a unit (mm, m, in, kN, V, ms, ...), found '{unit}'")
    series = list(contents.series)
    names = [(s.name, s.path) for s in series]
    left_units, left_scale, notes = dict(units), dict(scale), list(contents.notes)
    if not (any(units) or scale):
        return contents, left_units, left_scale
    places = {column.index for column in time_columns(contents, time, file)}

    def place(selector: str) -> int:
        try:
            return select(selector, names, file)
        except ChannelError:
            if lenient:
                return -1
            raise

    for selector in [one for one in units if one]:
        if (at := place(selector)) in places:
            series[at] = replace(series[at], unit=left_units.pop(selector))
    for selector, factor in scale.items():
        if (at := place(selector)) in places:
            del left_scale[selector]
            series[at] = replace(series[at], unit="s", values=series[at].values * factor)
            notes.append(Said(f"time '{series[at].path}' scaled by {factor:g}, to seconds", "scaled", [factor]))
    return replace(contents, series=tuple(series), notes=tuple(notes)), left_units, left_scale


def _in_units(recording: Recording, units: Mapping[str, str], judged: Sequence[str]) -> Recording:
    """Channels with the units that the user gave them: those named, and of those judged all without one."""
    channels, notes = list(recording.channels), list(recording.notes)
    named = {channels.index(recording.channel(selector)): unit for selector, unit in units.items() if selector}
    for at, unit in named.items():
        if channels[at].unit is not None and channels[at].unit != unit:
            words = f"channel '{channels[at].path}': the file's unit is {channels[at].unit}, but {unit} was followed"
            notes.append(Said(f"{words}, as given", "unit_not_followed"))
        channels[at] = replace(channels[at], unit=unit)
    if "" in units:
        for at in {recording.channels.index(recording.channel(one)) for one in judged}:
            if channels[at].unit is None:
                channels[at] = replace(channels[at], unit=units[""])
    return replace(recording, channels=tuple(channels), notes=tuple(notes))


def _converted(recording: Recording, target: str, other: str) -> Recording:
    """The other channel in the target's unit, where both are stated, measure the same and differ."""
    wanted, old = recording.channel(target).unit, recording.channel(other)
    kind = quantity(wanted)
    if wanted is None or old.unit is None or kind in (None, "other") or quantity(old.unit) != kind:
        return recording
    to, of = size_in_si(wanted, kind), size_in_si(old.unit, kind)
    assert to is not None
    assert of is not None
    if to == of:
        return recording
    # The nearer whole number: mm in m is 1000, not 1 / 0.001 and a rounding.
    factor = of / to if of > to else 1 / (to / of)
    factor = float(round(factor)) if abs(factor - round(factor)) < 1e-9 * factor else factor
    channels = list(recording.channels)
    at = channels.index(old)
    channels[at] = replace(old, unit=wanted, values=frozen(old.values * factor))
    words = f"'{old.name}' converted from {old.unit} to {wanted}, the unit of '{recording.channel(target).name}'"
    return replace(recording, channels=tuple(channels), notes=(*recording.notes, Said(words, "converted", [factor])))


def _refuse_blank_ends(recording: Recording, selectors: Sequence[str]) -> None:
    """Where a channel begins or ends with nothing, no gap can be filled: what is left is told, to be cut to."""
    for selector in selectors:
        channel = recording.channel(selector)
        known = np.flatnonzero(np.isfinite(channel.values))
        n_before, n_after = (int(known[0]), len(channel.values) - 1 - int(known[-1])) if known.size else (0, 0)
        if not n_before and not n_after:
            continue
        assert recording.rate_hz is not None
        first, end = n_before / recording.rate_hz, (len(channel.values) - n_after) / recording.rate_hz
        where = " and ".join(
            f"{n} sample(s) at the {place}" for n, place in ((n_before, "start"), (n_after, "end")) if n
        )
        cut = " and ".join(
            f"{{{key}}} = {at:g}" for n, key, at in ((n_before, "start_s", first), (n_after, "end_s", end)) if n
        )
        raise RecordingError(
            f"channel '{channel.path}' is blank or not finite in {where}",
            file=recording.file,
            code="blank_ends",
            values=(first, end),
            advice=f"cut there: {cut} s",
        )
