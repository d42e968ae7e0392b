"""Channels with a time of their own: which time column is whose, and several channels put on one clock."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import RecordingError
from rthstrack.recording.names import role, words
from rthstrack.recording.readers.stamps import Irregular, Uniform
from rthstrack.recording.recording import OwnTime, Recording, frozen
from rthstrack.said import Said

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rthstrack.recording.rate import Rate, TimeColumn
    from rthstrack.recording.readers.contents import Contents, Series
    from rthstrack.recording.recording import Channel

# Rates that differ by less are of two clocks that should run alike, and do not by so many ppm.
_ALIKE = 0.01
# A shift this near to a whole number of samples is one, in samples.
_WHOLE = 1e-6
# What two clocks are apart is told from this share of a sample on.
_APART = 1e-3
# Words of a time that a whole table may have beside another.
_KINDS = {"elapsed", "running", "relative", "test", "total", "run", "record", "simulation", "sim", "cycle", "segment"}
# Words of time, which do not say whose time it is.
_OF_TIME = {"t", "time", "times", "stamp", "timestamp", "x", "value", "values", "s", "sec", "ms", "zeit", "temps"}


@dataclass(frozen=True, slots=True, eq=False)
class Timelines:
    """`of`: the time column of each series, None where it has none; `main`: the columns of most of them; `paths`: those
    of the series."""

    of: tuple[TimeColumn | None, ...]
    main: tuple[TimeColumn, ...]
    notes: tuple[Said, ...] = ()
    paths: tuple[str, ...] = ()


def timelines(contents: Contents, columns: Sequence[TimeColumn], file: str, *, given: bool = False) -> Timelines:
    """Which of the time columns tells whose time: that of its length, nearest in path, name and order.

    given: the rate is the user's, so that it need not be known. Else raises RecordingError where it is not.
    """
    if not columns:
        return Timelines((None,) * len(contents.series), ())
    blocks = _blocks(contents, columns)
    of: list[tuple[TimeColumn, ...]] = []
    counted: dict[tuple[TimeColumn, ...], int] = {}
    places = {column.index for column in columns}
    behind = len(set(blocks.values())) > 1 and min(places) > 0 and max(places) > len(contents.series) - 1.5
    for index, series in enumerate(contents.series):
        own = () if index in places else _nearest(series, index, columns, blocks, behind=behind)
        # Dates beside a better time are of the same samples.
        own = tuple(column for column in own if not column.is_clock) or own
        of.append(own)
        counted[own] = counted.get(own, 0) + len(series.values) * (index not in places)
    untimed = counted.pop((), 0)
    if not counted:
        return Timelines((None,) * len(contents.series), tuple(columns))
    main = max(counted, key=counted.__getitem__)
    if any(s.channel is None for s in contents.statements) and untimed > counted[main]:
        # The file's rate is that of the channels without a time.
        main = ()
    notes: list[Said] = []
    chosen = {}
    for group in counted:
        chosen[group] = group[0]
        uniform = [column for column in group if isinstance(column.examine(), Uniform)]
        if uniform:
            chosen[group] = _unless_contradicted(uniform)
            notes += _contradictions(uniform, of, file, given=given)
    paths = tuple(series.path for series in contents.series)
    return Timelines(tuple(chosen.get(group) for group in of), main, tuple(notes), paths)


def _blocks(contents: Contents, columns: Sequence[TimeColumn]) -> dict[float, int]:
    """Time columns that stand side by side are in one block: they speak of the same channels."""
    places = sorted(column.index for column in columns)
    others = [index for index in range(len(contents.series)) if index not in places]
    blocks = {places[0]: 0}
    for before, after in itertools.pairwise(places):
        blocks[after] = blocks[before] + any(before < index < after for index in others)
    return blocks


def _parents(path: str) -> list[str]:
    return re.split(r"[/.]", path)[:-1]


def _last(path: str) -> list[str]:
    return words(re.split(r"[/.]", path)[-1])


def _nearest(
    series: Series, index: int, columns: Sequence[TimeColumn], blocks: dict[float, int], *, behind: bool
) -> tuple[TimeColumn, ...]:
    """behind: times stand behind their channels, as the table ends with one and does not begin with one."""
    alike = [column for column in columns if len(column.stamps) == len(series.values)]
    if len(alike) < 2:
        return tuple(alike)
    own = _parents(series.path)

    def shared(column: TimeColumn) -> int:
        pairs = zip(own, _parents(column.path), strict=False)
        return next((i for i, (a, b) in enumerate(pairs) if a != b), min(len(own), len(_parents(column.path))))

    most = max(map(shared, alike))
    alike = [column for column in alike if shared(column) == most]
    said = _last(series.path)

    def named(column: TimeColumn) -> int:
        theirs = _last(column.path)
        same_role = role(said).name is not None and role(theirs).name == role(said).name
        return len(set(said) & (set(theirs) - _OF_TIME)) + 2 * same_role

    best = max(map(named, alike))
    if best:
        alike = [column for column in alike if named(column) == best]
    homes = [_parents(column.path) for column in alike]
    if any(home != homes[0] for home in homes) and not any(home == own[: len(home)] for home in homes):
        # In groups beside the channel's, none is nearer than another.
        return tuple(alike)
    before = [blocks[column.index] for column in alike if column.index < index]
    after = [blocks[column.index] for column in alike if column.index > index]
    follows = bool(after) if behind else not before
    block = min(after) if follows else max(before)
    return tuple(column for column in alike if blocks[column.index] == block)


def _unless_contradicted(uniform: Sequence[TimeColumn]) -> TimeColumn:
    """The first of time columns that speak of the same samples, useless where another says another rate."""
    first = uniform[0].examine()
    assert isinstance(first, Uniform)
    for other in uniform[1:]:
        verdict = other.examine()
        assert isinstance(verdict, Uniform)
        if abs(verdict.rate_hz / first.rate_hz - 1) > _ALIKE:
            problem = (
                f"says {first.rate_hz:g} Hz, but {other.what} {verdict.rate_hz:g} Hz, and nothing tells which holds"
            )
            return replace(uniform[0], verdicts=[Irregular(problem, False, math.nan)])
    return uniform[0]


def _contradictions(
    uniform: Sequence[TimeColumn], of: Sequence[tuple[TimeColumn, ...]], file: str, *, given: bool
) -> list[Said]:
    """Time columns side by side that begin at other times: of the same samples, or each of another channel?"""
    first = uniform[0].examine()
    assert isinstance(first, Uniform)
    notes = []
    for other in uniform[1:]:
        verdict = other.examine()
        assert isinstance(verdict, Uniform)
        if abs(verdict.rate_hz / first.rate_hz - 1) > _ALIKE:
            continue
        apart_s = verdict.origin_s - first.origin_s
        if abs(apart_s) * first.rate_hz < _APART:
            continue
        n_channels = sum(uniform[0] in group for group in of)
        alike = {re.sub(r"[\d_ ]+", "", plain) for plain in (uniform[0].path.casefold(), other.path.casefold())}
        if len(alike) == 1 and n_channels == len(uniform) and not given:
            raise RecordingError(
                f"{uniform[0].what} and {other.what} begin {1e3 * abs(apart_s):.6g} ms apart, and no name tells whose "
                "time each is",
                file=file,
                code="whose_time",
                values=(apart_s,),
                advice="choose one for all channels: {time}",
            )
        words = (
            f"{other.what} begins {1e3 * abs(apart_s):.6g} ms {'after' if apart_s > 0 else 'before'} "
            f"{uniform[0].what}, which was followed"
        )
        notes.append(Said(words, "time_not_followed", [apart_s]))
    return notes


def not_followed(own: Timelines, chosen: TimeColumn) -> list[Said]:
    """Which channels' own times say otherwise than the one that the user chose for all."""
    said = []
    first = chosen.examine()
    for other in dict.fromkeys(column for column in own.of if column is not None and column.index != chosen.index):
        verdict = other.examine()
        if other.is_clock or not (isinstance(first, Uniform) and isinstance(verdict, Uniform)):
            continue
        apart_s = verdict.origin_s - first.origin_s
        if abs(verdict.rate_hz / first.rate_hz - 1) <= _ALIKE and abs(apart_s) * first.rate_hz < _APART:
            continue
        names = ", ".join(f"'{p}'" for p, column in zip(own.paths, own.of, strict=True) if column is other)
        words = (
            f"{chosen.what} was followed for all channels, as asked, though {names} may have {other.what}, which "
            f"begins {1e3 * abs(apart_s):.6g} ms {'later' if apart_s > 0 else 'earlier'}, at {verdict.rate_hz:.6g} Hz"
        )
        said.append(Said(words, "time_not_followed", [apart_s]))
    return said


def own_times(contents: Contents, lines: Timelines, rate: Rate, *, given: bool) -> list[OwnTime | None]:
    """The clock of every channel, None for all where there is but one.

    given: the rate is the user's, so that stamps are not followed.
    """
    of_channel = {s.channel: s for s in contents.statements if s.channel is not None}
    from_column = not given and (rate.by_column or rate.hz is None)
    main = next((column for column in lines.main if isinstance(column.examine(), Uniform)), None)
    length = len(main.stamps) if main is not None and from_column else None
    mixed = len({column.is_clock for column in lines.of if column is not None}) > 1
    seen: dict[TimeColumn, OwnTime] = {}
    found: list[OwnTime] = []
    for series, column in zip(contents.series, lines.of, strict=True):
        stated = of_channel.get(series.path)
        hz = rate.hz if rate.hz is not None or stated is None else stated.rate_hz
        if stated is not None and not given:
            hz = stated.rate_hz
        if series.start_s is not None:
            source = stated.source if stated is not None else rate.source
            found.append(OwnTime(source, hz, series.start_s))
        elif column is not None and (not given or _agrees(column, rate)):
            if column not in seen:
                seen[column] = _of_column(column, rate if given or column in lines.main else None)
                if mixed and column.is_clock:
                    seen[column] = replace(seen[column], kind="dates")
            found.append(seen[column])
        elif length is not None and len(series.values) != length:
            assert main is not None
            problem = f"{main.what} has {length} samples, this channel {len(series.values)}: its own time is not known"
            found.append(OwnTime(rate.source, None, 0.0, problem=problem))
        else:
            source = stated.source if stated is not None else rate.source
            found.append(OwnTime(source, hz, rate.origin_s))
    times = {id(column) for column in lines.of if column is not None} | {id(column) for column in lines.main}
    places = {column.index for column in (*lines.of, *lines.main) if column is not None and id(column) in times}
    judged = [one for i, one in enumerate(found) if i not in places]
    if all(_same(judged[0], one) for one in judged[1:]):
        return [None] * len(found)
    return list(found)


def clocks_told(channels: Sequence[Channel]) -> list[Said]:
    """That channels have clocks of their own, which whoever takes their samples by index must know."""
    own = list(dict.fromkeys(c.time.source for c in channels if c.time is not None and not c.is_time))
    if not own:
        return []
    known = [c.time for c in channels if c.time is not None and not c.is_time and not c.time.problem]
    starts = [time.start_s for time in known]
    if all(_same(known[0], time) for time in known[1:]):
        return []
    words = f"channels have times of their own, beginning up to {1e3 * (max(starts) - min(starts)):.6g} ms apart"
    return [Said(words, "own_times", [max(starts) - min(starts)])]


def _agrees(column: TimeColumn, rate: Rate) -> bool:
    """Whether stamps say what the user does, so that they may tell when a channel begins."""
    verdict = column.examine()
    return isinstance(verdict, Uniform) and rate.hz is not None and abs(rate.hz / verdict.rate_hz - 1) < _ALIKE


def _of_column(column: TimeColumn, rate: Rate | None) -> OwnTime:
    verdict = column.examine()
    if not isinstance(verdict, Uniform):
        return OwnTime(column.what, None, 0.0, problem=f"{column.what} {verdict.problem}")
    if column.unit.doubt and rate is None:
        return OwnTime(column.what, None, 0.0, problem=f"{column.what} {column.unit.doubt}")
    said = () if column.unit.said is None else (column.unit_said(),)
    # Only rounding leaves open what the rate is.
    kind = " ".join(word for word in _last(column.path) if word in _KINDS)
    allowed = (verdict.low_hz, verdict.high_hz) if verdict.rounded else (math.nan, math.nan)
    if rate is not None and rate.hz is not None and abs(rate.hz / verdict.rate_hz - 1) < _ALIKE:
        return OwnTime(rate.source, rate.hz, verdict.origin_s, *allowed, kind=kind, said=said)
    return OwnTime(column.what, verdict.rate_hz, verdict.origin_s, *allowed, kind=kind, said=said)


def _same(a: OwnTime, b: OwnTime) -> bool:
    """Whether two clocks are one."""
    if a.problem or b.problem:
        return a == b
    if a.rate_hz is None or b.rate_hz is None:
        return a.rate_hz is b.rate_hz and a.start_s == b.start_s
    return _one_rate(a, b) and abs(a.start_s - b.start_s) * a.rate_hz < _whole(a, b)


def _whole(a: OwnTime, b: OwnTime) -> float:
    """How near to a whole number of samples a shift is one: times far from zero are known to round-off only."""
    far_s = max(abs(a.start_s), abs(b.start_s))
    return max(_WHOLE, 4 * float(np.finfo(float).eps) * far_s * max(a.rate_hz or 0.0, b.rate_hz or 0.0))


def _one_rate(a: OwnTime, b: OwnTime) -> bool:
    """Whether the stamps of two clocks allow that they run at one rate."""
    assert a.rate_hz is not None
    assert b.rate_hz is not None
    if abs(a.rate_hz - b.rate_hz) <= 1e-12 * a.rate_hz:
        return True
    return bool(a.low_hz <= b.rate_hz <= a.high_hz or b.low_hz <= a.rate_hz <= b.high_hz)


def on_one_clock(recording: Recording, selectors: Sequence[str]) -> Recording:
    """The recording with these channels on one clock, over the time that they have in common.

    Where one is sampled more slowly, on its clock; else on that of the first. Shifted by whole samples where that is
    all, else interpolated by cubic splines; `notes` say what was done. Raises RecordingError where it cannot be.
    """
    places = list(dict.fromkeys(recording.channels.index(recording.channel(one)) for one in selectors))
    chosen = [recording.channels[i] for i in places]
    if all(channel.time is None for channel in chosen):
        return recording
    times = [_known(recording, channel) for channel in chosen]
    if len({time.kind for time in times}) > 1:
        sources = " and ".join(dict.fromkeys(time.source for time in times))
        raise RecordingError(
            f"{sources} may be of the same samples or each of another channel",
            file=recording.file,
            code="whose_time",
            advice="choose one for all channels: {time}",
        )
    rates = [float(time.rate_hz or math.nan) for time in times]
    slowest = int(np.argmin(rates))
    at = slowest if rates[slowest] < (1 - _ALIKE) * rates[0] else 0
    clock, hz = times[at], rates[at]
    begins = max(time.start_s for time in times)
    ends = min(t.start_s + (len(c.values) - 1) / f for t, c, f in zip(times, chosen, rates, strict=True))
    near = max(_whole(clock, time) for time in times)
    first = math.ceil((begins - clock.start_s) * hz - near)
    last = math.floor((ends - clock.start_s) * hz + near)
    if last - first < 1:
        listed = ", ".join(
            f"'{c.name}' {t.start_s:.10g} to {t.start_s + (len(c.values) - 1) / f:.10g} s"
            for t, c, f in zip(times, chosen, rates, strict=True)
        )
        raise RecordingError(
            f"the channels have no time in common: {listed}", file=recording.file, code="no_common_time"
        )
    channels, notes = list(recording.channels), list(recording.notes)
    notes += [one for one in dict.fromkeys(one for time in times for one in time.said) if one not in notes]
    for place, channel, time in zip(places, chosen, times, strict=True):
        values, how = _moved(channel.values, time, clock, range(first, last + 1))
        channels[place] = replace(channel, values=frozen(values), time=None)
        if channel is not chosen[at] and how:
            notes += _told(channel, time, chosen[at], clock, how)
    start_s = clock.start_s + first / hz
    notes = [note for note in notes if getattr(note, "code", "") != "own_times"]
    return replace(
        recording, channels=tuple(channels), rate_hz=hz, rate_source=clock.source, start_s=start_s, notes=tuple(notes)
    )


def _known(recording: Recording, channel: Channel) -> OwnTime:
    time = channel.time or OwnTime(recording.rate_source, recording.rate_hz, recording.start_s)
    if time.problem:
        raise RecordingError(
            f"'{channel.path}': {time.problem}",
            file=recording.file,
            advice="{resample_hz} interpolates uneven stamps, {rate_hz} ignores them",
        )
    if time.rate_hz is None:
        raise RecordingError(
            f"'{channel.path}': no sampling rate: {time.source}", file=recording.file, advice="give {rate_hz} or {time}"
        )
    return time


def _moved(
    values: NDArray[np.float64], time: OwnTime, clock: OwnTime, samples: range
) -> tuple[NDArray[np.float64], str]:
    """A channel's values at some samples of a clock, and how they were had: "", "shifted" or "interpolated"."""
    assert time.rate_hz is not None
    assert clock.rate_hz is not None
    offset = (clock.start_s - time.start_s) * time.rate_hz
    first = offset + samples[0] * time.rate_hz / clock.rate_hz
    if _one_rate(time, clock) and abs(offset - round(offset)) <= _whole(time, clock):
        begin = samples[0] + round(offset)
        return values[begin : begin + len(samples)].copy(), "shifted" if round(offset) else ""
    step = 1.0 if _one_rate(time, clock) else time.rate_hz / clock.rate_hz
    return _between(values, np.clip(first + step * np.arange(len(samples)), 0, len(values) - 1)), "interpolated"


def _between(values: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values between samples by a cubic spline; beside a missing sample nothing is known."""
    from scipy.interpolate import CubicSpline

    finite = np.isfinite(values)
    if np.count_nonzero(finite) < 2:
        return np.full(len(at), math.nan)
    index = np.arange(len(values))
    found: NDArray[np.float64] = CubicSpline(index[finite], values[finite])(at)
    left = np.floor(at).astype(np.int64)
    right = np.minimum(left + (at > left), len(values) - 1)
    found[~(finite[left] & finite[right])] = math.nan
    return found


def _told(channel: Channel, time: OwnTime, other: Channel, clock: OwnTime, how: str) -> list[Said]:
    assert time.rate_hz is not None
    assert clock.rate_hz is not None
    late_s = time.start_s - clock.start_s
    begins = f"begins {1e3 * abs(late_s):.7g} ms {'after' if late_s > 0 else 'before'} '{other.name}'"
    if abs(late_s) * clock.rate_hz <= _whole(time, clock):
        begins = f"begins with '{other.name}'"
    ratio = 1.0 if _one_rate(time, clock) else time.rate_hz / clock.rate_hz
    notes = []
    if abs(ratio - 1) > _ALIKE:
        begins += f" and has {time.rate_hz:.10g} Hz in place of {clock.rate_hz:.10g} Hz"
    elif abs(ratio - 1) * len(channel.values) > _APART:
        ppm = 1e6 * (ratio - 1)
        how_so = "faster" if ppm > 0 else "slower"
        words = f"by their stamps '{channel.name}' has a clock {abs(ppm):.3g} ppm {how_so} than '{other.name}'"
        notes.append(Said(words, "clock_rates", [ratio - 1]))
    n = round(abs(late_s) * clock.rate_hz)
    done = f"shifted by {n} sample{'s' if n != 1 else ''}" if how == "shifted" else "interpolated (cubic)"
    notes.append(Said(f"'{channel.name}' {begins}: {done}, to be on one clock", "one_clock", (late_s, ratio)))
    return notes
