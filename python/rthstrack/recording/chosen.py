"""From a file to the signals that are judged: read, propose, fill, put on one clock, scale, convert, cut."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from rthstrack.errors import ChannelError, RecordingError, SettingError
from rthstrack.recording.clocks import on_one_clock
from rthstrack.recording.pairing import propose_pair
from rthstrack.recording.rate import time_columns
from rthstrack.recording.readers import read_contents
from rthstrack.recording.reading import checked_rates, recording_from
from rthstrack.recording.recording import frozen, select
from rthstrack.said import Said
from rthstrack.units import is_unit, quantity, size_in_si

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rthstrack.recording.readers.contents import Contents
    from rthstrack.recording.recording import Recording


class ChosenPairs(NamedTuple):
    """A recording as it is judged, its rate, (target, measured) as selectors, and why these if they were proposed."""

    recording: Recording
    rate_hz: float
    pairs: list[tuple[str, str]]
    proposal: str | None


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
) -> ChosenPairs:
    """Reads a file, takes the pairs named or proposes them, fills gaps, puts pairs on one clock, scales and cuts.

    units: {selector: unit}, with "" for all channels of pairs that state none. Where target and measured state units
    that differ, measured (and its command) is converted, and the notes say so.
    Raises RecordingError, ChannelError, SettingError, with the file named; no sampling rate is an error.
    """
    file = os.fspath(path)
    checked_rates(rate_hz, resample_hz)
    contents = read_contents(path)
    contents, units, scale = of_time(contents, time, units or {}, scale or {}, file)
    recording = recording_from(contents, file, rate_hz=rate_hz, time=time, resample_hz=resample_hz)
    if recording.rate_hz is None and all(c.time is None or c.time.rate_hz is None for c in recording.channels):
        why = f"no sampling rate: {recording.rate_source}"
        raise RecordingError(why, file=file, advice="give {rate_hz} or {time}")
    pairs, proposal = list(zip(targets, measured, strict=False)), None
    if len(targets) != len(measured):
        raise SettingError(f"one measured for each target is needed, found {len(measured)} for {len(targets)}")
    if not pairs:
        pairs, proposal = propose_pair(recording)
    judged = [one for pair in pairs for one in pair]
    for one in (*judged, *commands):
        if recording.channel(one).is_time:
            raise ChannelError(f"'{recording.channel(one).path}' holds the time, and no motion", file=file, code="time")
    if fill:
        recording = recording.filled(fill)
    recording = on_one_clock(recording, (*judged, *commands))
    recording = _in_units(recording, units, judged)
    recording = recording.scaled(scale)
    for i, (target, answered) in enumerate(pairs):
        for one in (answered, *commands[i : i + 1]):
            recording = _converted(recording, target, one)
    if start_s is not None or end_s is not None:
        recording = recording.cut(start_s, end_s)
    if recording.rate_hz is None:
        why = f"no sampling rate: {recording.rate_source}"
        raise RecordingError(why, file=file, advice="give {rate_hz} or {time}")
    return ChosenPairs(recording, recording.rate_hz, pairs, proposal)


def of_time(
    contents: Contents, time: str | None, units: Mapping[str, str], scale: Mapping[str, float], file: str
) -> tuple[Contents, dict[str, str], dict[str, float]]:
    """The contents with what is said of columns of time done, and the units and factors that are left to do."""
    for unit in units.values():
        if not is_unit(unit):
            raise SettingError(f"unit: expected a unit (mm, m, in, kN, V, ms, ...), found '{unit}'")
    series = list(contents.series)
    names = [(s.name, s.path) for s in series]
    left_units, left_scale, notes = dict(units), dict(scale), list(contents.notes)
    if not (any(units) or scale):
        return contents, left_units, left_scale
    places = {column.index for column in time_columns(contents, time, file)}
    for selector in [one for one in units if one]:
        if (at := select(selector, names, file)) in places:
            series[at] = replace(series[at], unit=left_units.pop(selector))
    for selector, factor in scale.items():
        if (at := select(selector, names, file)) in places:
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
