"""The sampling rate: what a file states, what its time columns tell, and what contradicts what."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import RecordingError
from rthstrack.recording.names import FILLERS, role, words
from rthstrack.recording.readers.arrays import tidy
from rthstrack.recording.readers.stamps import Irregular, Uniform, examine
from rthstrack.recording.recording import select
from rthstrack.recording.time_units import DOUBTED_SLOW_HZ, SECONDS, CountedIn, counted_in, rounded_step, unwrapped
from rthstrack.said import Said
from rthstrack.units import seconds_in, split_unit
from rthstrack.values import median

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rthstrack.recording.readers.contents import Clock, Contents, Series

# Two statements of the rate that differ by more contradict each other.
_AGREEMENT = 0.01


@dataclass(frozen=True, slots=True)
class Rate:
    hz: float | None
    source: str
    start_s: float = 0.0
    notes: tuple[str, ...] = ()
    origin_s: float = 0.0
    by_column: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class TimeColumn:
    """A column that may tell the time: `what` names it in messages; `index` is its place among the series,
    a half before one for a column of dates."""

    what: str
    path: str
    stamps: NDArray[np.float64]
    unit_s: float
    is_clock: bool = False
    index: float = -1
    unit: CountedIn = SECONDS
    nameless: bool = False
    verdicts: list[Uniform | Irregular] = field(default_factory=list, repr=False)

    def examine(self) -> Uniform | Irregular:
        """Whether its stamps are those of uniform sampling."""
        if not self.verdicts:
            self.verdicts.append(examine(self.stamps, self.unit_s))
        return self.verdicts[0]

    def unit_said(self) -> Said:
        """What is to be told of the unit that it counts in, where there is something."""
        assert self.unit.said is not None
        return Said(f"{self.what}: {self.unit.said}", self.unit.said.code, self.unit.said.values, self.unit.said.cause)

    def rate_of_units(self) -> float:
        """Samples a unit, whatever the unit is; NaN where they are not uniform."""
        verdict = self.examine()
        return verdict.rate_hz * self.unit_s if isinstance(verdict, Uniform) else math.nan


# Names of what may count time, in a unit that nobody knows.
_HINTS = re.compile(r"tick|clock|count|date|stamp", re.IGNORECASE)
_TIME_NAMES = re.compile(
    r"t|times?|tout|zeit|messzeit|temps|tiempo|tempo|x[_ ]values?|time[ _-]?stamps?|time[ _-]?(?:axis|vector|base|\d+)|"
    r"(?:elapsed|running|relative|test|total|run|sample|measurement|record|simulation|sim)[ _-]?time|"
    "tijd|tijdstip|tid|czas|zaman|süre|aika|čas|vrijeme|vreme|timp|idő|waktu|thời[ _-]gian|เวลา|زمان|время|час|χρόνος|"
    "時間|时间|時刻|时刻|経過時間|시간|समय|الزمن|الوقت|זמן",
    re.IGNORECASE,
)


# Names of time that mean other things too.
_TIME_OR_ELSE = re.compile(
    r"(time|zeit)\b.*|(date|datum|fecha)[ _-]?(time|zeit)?|elapsed|duration|dauer|laufzeit|durée|zeitstempel|"
    "horodatage|seconds|sekunden",
    re.IGNORECASE,
)


# So many samples show what rises.
_GLANCE = 1000
_TIME_WORDS = {"time", "times", "zeit", "temps", "tiempo", "tempo", "stamp", "timestamp"}


def time_columns(contents: Contents, chosen: str | None, file: str) -> list[TimeColumn]:
    """The columns that may tell the time, best first; only the chosen one where one is."""
    series, clocks = contents.series, contents.clocks
    if chosen is not None:
        at = select(chosen, [(c.name, c.path) for c in series] + [(c.name, c.path) for c in clocks], file)
        if at < len(series):
            return [_numeric_time(at, series[at], "--time")]
        return _clock_times([clocks[at - len(series)]])
    found = [_numeric_time(i, one) for i, one in enumerate(series) if _is_time(one, seconds_in(_unit(one)))]
    found = [column for column in found if np.isfinite(column.stamps).any()]
    if contents.nameless and not found:
        found = _nameless_times(contents)
    places = {column.index for column in found}
    lengths = {len(one.values) for i, one in enumerate(series) if i not in places}
    # A column of time goes with channels of its length, if there are any.
    found = [column for column in found if len(column.stamps) in lengths or not lengths]
    return found + _clock_times(clocks)


def _time_named(series: Series, unit_s: float | None) -> str:
    """How plainly a name says time: "", "loosely" (as "Time  1 - default sample rate", but not "x_t") or "plainly"."""
    stem, unit = split_unit(re.split(r"[/.]", series.name)[-1])
    stem = re.sub(r"\(.*\)$|\[.*\]$", "", stem).strip(" :_-'\"")
    if (unit or series.unit) is not None and unit_s is None:
        return ""
    if _TIME_NAMES.fullmatch(stem):
        return "plainly" if stem != "T" or unit_s is not None else "loosely"
    if _TIME_OR_ELSE.fullmatch(stem):
        return "loosely"
    # t1, t_target, cmd time, but not x_t.
    found = words(stem)
    rest = [word for i, word in enumerate(found) if word not in _TIME_WORDS and not (word == "t" and i == 0)]
    of_one = all(word.isdigit() or role([word]).name is not None or word in FILLERS for word in rest)
    return "loosely" if len(rest) < len(found) and of_one else ""


def _is_time(series: Series, unit_s: float | None) -> bool:
    """Time by its name; a name that means other things too (T, Time 1) needs a unit of time or rising values."""
    named = _time_named(series, unit_s)
    values = ended(series.values)
    if named == "plainly":
        return True
    if named == "loosely":
        return len(values) > 1 and bool(np.all(np.diff(values) > 0))
    # Whatever its name: what rises evenly in a unit of time is time.
    return unit_s is not None and len(values) > 3 and isinstance(examine(values, unit_s), Uniform)


def ended(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values up to the last that is a number."""
    if not len(values) or not math.isnan(values[-1]):
        return values
    known = np.flatnonzero(~np.isnan(values))
    return values[: known[-1] + 1] if known.size else values[:0]


def _unit(series: Series) -> str | None:
    return series.unit or split_unit(series.name)[1]


def _numeric_time(index: int, series: Series, how: str = "") -> TimeColumn:
    """A column of numbers as time, in the unit that it states or that fits it best."""
    stamps, wraps = unwrapped(series.values)
    unit = counted_in(stamps, seconds_in(_unit(series)))
    what = f"time column '{series.path}'" + (f" ({how})" if how else "")
    if wraps:
        what += f" (begins anew at {wraps:.10g})"
    return TimeColumn(what, series.path, stamps, unit.unit_s, index=index, unit=unit)


def _nameless_times(contents: Contents) -> list[TimeColumn]:
    """Where columns have no names: the first, if it rises evenly in steps that are no count, and others like it."""
    series, found = contents.series, list[TimeColumn]()
    if len(series) < 2 or len(series[0].values) < 4:
        return []
    for index, one in enumerate(series):
        if not np.all(np.diff(one.values[:_GLANCE]) >= 0):
            if index == 0:
                return []
            continue
        verdict = examine(ended(one.values))
        if isinstance(verdict, Irregular) or abs(verdict.rate_hz - 1) < 1e-6:
            if index == 0:
                return []
            continue
        # Another one beside it may count anything; one behind a channel, and with one behind it, is their time.
        alike = found and abs(verdict.rate_hz / found[0].rate_of_units() - 1) <= _AGREEMENT
        between = found and found[-1].index < index - 1 and index + 1 < len(series)
        if not (index == 0 or alike or between):
            continue
        unit = counted_in(one.values, seconds_in(_unit(one)))
        taken = " in s" if unit.said is None else ""
        what = f"column '{one.path}' (it has no name, but rises evenly: taken as time{taken})"
        column = TimeColumn(what, one.path, one.values, unit.unit_s, index=index, unit=unit, nameless=True)
        if unit.unit_s == 1 and not math.isnan(one.values[-1]):
            column.verdicts.append(verdict)
        found.append(column)
    return found


def _clock_times(clocks: Sequence[Clock]) -> list[TimeColumn]:
    """Columns of dates as time, from the earliest first entry of all."""
    known = [clock for clock in clocks if np.isfinite(clock.seconds).any()]
    earliest = min((clock.first_ns for clock in known if clock.first_ns is not None), default=0)
    found = []
    for place, clock in enumerate(known):
        late_s = 0.0 if clock.first_ns is None else (clock.first_ns - earliest) / 1e9
        stamps = clock.seconds + late_s if late_s else clock.seconds
        what = f"date-time column '{clock.path}'"
        # Two that stand side by side have places of their own, too.
        index = clock.after - 0.5 + 1e-6 * place
        found.append(TimeColumn(what, clock.path, stamps, 1.0, is_clock=True, index=index))
    return found


def settle(contents: Contents, columns: Sequence[TimeColumn], *, chosen: bool, file: str) -> Rate:
    """The rate by the order of `read_recording`, every contradiction an error."""
    if chosen:
        verdict = columns[0].examine()
        if isinstance(verdict, Irregular):
            raise RecordingError(f"{columns[0].what} {verdict.problem}", file=file, advice=_hint(verdict))
        _certain(columns[0], file)
        ignored = [s for s in contents.statements if not _agree(verdict, s.rate_hz)]
        said = (*_unit_told(columns[0]), *(_not_followed(s.source, s.rate_hz, "named time") for s in ignored))
        return Rate(verdict.rate_hz, columns[0].what, verdict.start_s, tuple(said), verdict.origin_s, by_column=True)
    stated = _stated(contents, file)
    named = [column for column in columns if not column.is_clock and not column.nameless]
    nameless = [column for column in columns if column.nameless]
    clocks = [column for column in columns if column.is_clock]
    told = _told(named, stated, file)
    if stated is not None and stated.hz is None:
        return told if told is not None and told.hz is not None else stated
    rate = stated or told
    if stated is not None and told is not None:
        rate = replace(stated, start_s=told.start_s, origin_s=told.origin_s, notes=(*stated.notes, *told.notes))
    if rate is not None and rate.hz is None:
        return rate
    notes: list[str] = []
    for clock in clocks:
        verdict = clock.examine()
        if rate is None:
            if isinstance(verdict, Irregular):
                raise RecordingError(f"{clock.what} {verdict.problem}", file=file, advice=_hint(verdict))
            notes += _rounded_told(clock, verdict)
            rate = Rate(verdict.rate_hz, clock.what, origin_s=verdict.origin_s, by_column=True)
        elif rate.hz is not None:
            notes += _compare_clock(rate, clock, verdict, file)
    if rate is not None:
        return replace(rate, notes=(*rate.notes, *notes))
    if nameless:
        verdict = nameless[0].examine()
        assert isinstance(verdict, Uniform)
        _certain(nameless[0], file)
        told_of = tuple(_unit_told(nameless[0]))
        return Rate(verdict.rate_hz, nameless[0].what, verdict.start_s, told_of, verdict.origin_s, by_column=True)
    return Rate(None, _no_time(contents))


def with_others(rate: Rate, others: Sequence[TimeColumn], file: str) -> Rate:
    """The rate, unless channels of the same length have times of their own at another: then each has its own only."""
    for other in others:
        verdict = other.examine()
        if rate.hz is None or not isinstance(verdict, Uniform) or _agree(verdict, rate.hz):
            continue
        if rate.by_column:
            differ = f"{rate.source} says {rate.hz:g} Hz, but {other.what} {verdict.rate_hz:g} Hz"
            return replace(rate, hz=None, source=differ)
        raise RecordingError(
            f"{rate.source} says {rate.hz:g} Hz, but {other.what} says {verdict.rate_hz:g} Hz",
            file=file,
            advice="give {rate_hz}",
        )
    return rate


def _certain(column: TimeColumn, file: str) -> None:
    """Refuses a column whose unit can only be guessed, or is not what it says."""
    if column.unit.doubt:
        raise RecordingError(
            f"{column.what} {column.unit.doubt}",
            file=file,
            code="time_unit",
            advice=f"give {{rate_hz}}, or {{unit}} '{column.path}={column.unit.else_in}'",
        )


def _unit_told(column: TimeColumn) -> list[Said]:
    return [] if column.unit.said is None else [column.unit_said()]


def _no_time(contents: Contents) -> str:
    """That nothing tells the rate; a column that nearly does is named, with its defect."""
    none = "the file states no sampling rate and has no time column"
    lengths = [len(one.values) for one in contents.series]
    for index, one in enumerate(contents.series):
        unit_s = seconds_in(_unit(one))
        named = _time_named(one, unit_s)
        hinted = _HINTS.search(one.name) is not None or (contents.nameless and index == 0)
        if not named and not hinted:
            continue
        sound = one.values[np.isfinite(one.values)]
        if len(sound) < 4:
            continue
        steps = np.diff(sound)
        if not named and (np.count_nonzero(steps > 0) < 0.9 * len(steps) or bool(np.all(steps == 1))):
            continue
        if not steps.any():
            continue
        verdict = examine(one.values, unit_s or 1.0)
        if isinstance(verdict, Irregular):
            return f"the file states no sampling rate, and '{one.path}', which may be the time, {verdict.problem}"
        if lengths.count(len(one.values)) == 1 and len(lengths) > 1:
            usual = max(lengths, key=lengths.count)
            return (
                f"the file states no sampling rate, and '{one.path}', which may be the time, has {len(one.values)} "
                f"samples where channels have {usual}"
            )
    for one in (one for one in contents.series if _HINTS.search(one.name)):
        verdict = examine(one.values)
        if isinstance(verdict, Uniform) and abs(verdict.rate_hz - 1) > 1e-6:
            rises = f"'{one.path}' rises evenly by {median(np.diff(one.values)):.6g}"
            return f"the file states no sampling rate, and {rises}, but no name or unit says that it is the time"
    return none


def _stated(contents: Contents, file: str) -> Rate | None:
    """What the file's header, attributes or single numbers say."""
    whole = [s for s in contents.statements if s.channel is None]
    single = [s for s in contents.statements if s.channel is not None]
    for other in whole[1:]:
        if abs(other.rate_hz - whole[0].rate_hz) > _AGREEMENT * whole[0].rate_hz:
            raise RecordingError(
                f"{whole[0].source} says {whole[0].rate_hz:g} Hz, but {other.source} says {other.rate_hz:g} Hz",
                file=file,
                advice="give {rate_hz}",
            )
    slowest = min(contents.statements, key=lambda s: s.rate_hz, default=None)
    if slowest is not None and slowest.rate_hz < DOUBTED_SLOW_HZ and not slowest.in_unit:
        raise RecordingError(
            f"{slowest.source} states no unit: in s (or Hz) it makes {slowest.rate_hz:g} Hz, in ms (or kHz) "
            f"{tidy(1e3 * slowest.rate_hz):g} Hz",
            file=file,
            code="time_unit",
            advice="give {rate_hz}",
        )
    if whole:
        return Rate(whole[0].rate_hz, whole[0].source)
    if not single:
        return None
    slow, fast = (pick(single, key=lambda s: s.rate_hz) for pick in (min, max))
    if fast.rate_hz - slow.rate_hz > 1e-6 * fast.rate_hz:
        return Rate(
            None,
            f"the channels have different sampling rates ({slow.source}: {slow.rate_hz:g} Hz for '{slow.channel}', "
            f"{fast.rate_hz:g} Hz for '{fast.channel}')",
        )
    return Rate(single[0].rate_hz, single[0].source)


def _told(columns: Sequence[TimeColumn], stated: Rate | None, file: str) -> Rate | None:
    """What the numeric time columns say; irregular ones are an error unless another one is uniform."""
    verdicts = [(column, column.examine()) for column in columns]
    uniform = [(c, v) for c, v in verdicts if isinstance(v, Uniform)]
    irregular = [(c, v) for c, v in verdicts if isinstance(v, Irregular)]
    if irregular and not uniform:
        column, problem = irregular[0]
        says = f"{stated.source} says {stated.hz:g} Hz, but " if stated and stated.hz else ""
        raise RecordingError(f"{says}{column.what} {problem.problem}", file=file, advice=_hint(problem))
    if not uniform:
        return None
    column, first = uniform[0]
    if stated is None or stated.hz is None:
        _certain(column, file)
    if stated is not None and stated.hz is not None:
        for other, verdict in uniform:
            if not _agree(verdict, stated.hz):
                raise RecordingError(
                    f"{stated.source} says {stated.hz:g} Hz, but {other.what} says {verdict.rate_hz:g} Hz",
                    file=file,
                    advice="give {rate_hz}",
                )
    for other, verdict in uniform[1:]:
        if not _agree(verdict, first.rate_hz):
            return Rate(
                None,
                f"{column.what} says {first.rate_hz:g} Hz, but {other.what} {verdict.rate_hz:g} Hz",
            )
    notes: list[str] = [Said(f"{c.what} {v.problem}; it was not used", "irregular_time") for c, v in irregular]
    notes += _unit_told(column)
    rounded = _rounded_told(column, first)
    notes += rounded
    if not rounded and (stated is None or stated.hz is None) and (said := rounded_step(first.rate_hz)) is not None:
        notes.append(said)
    return Rate(first.rate_hz, column.what, first.start_s, tuple(notes), first.origin_s, by_column=True)


def _rounded_told(column: TimeColumn, verdict: Uniform) -> list[Said]:
    """That rounded stamps leave the rate open, where it is more than a trifle."""
    if not verdict.rounded or verdict.high_hz - verdict.low_hz <= 2e-3 * verdict.rate_hz:
        return []
    words = (
        f"{column.what} is rounded: any rate from {verdict.low_hz:.6g} to {verdict.high_hz:.6g} Hz fits it; "
        "give the rate if you know better"
    )
    return [Said(words, "rounded_time", (verdict.low_hz, verdict.high_hz))]


def _compare_clock(rate: Rate, clock: TimeColumn, verdict: Uniform | Irregular, file: str) -> list[str]:
    """A computer's clock beside a better source: it may jitter (a note), but not run at another rate."""
    assert rate.hz is not None
    if isinstance(verdict, Uniform) and _agree(verdict, rate.hz):
        return []
    if isinstance(verdict, Irregular):
        if not math.isfinite(verdict.mean_rate_hz) or abs(verdict.mean_rate_hz - rate.hz) <= _AGREEMENT * rate.hz:
            return [Said(f"{clock.what} {verdict.problem}; {rate.source} was followed", "irregular_time")]
        says = verdict.mean_rate_hz
    else:
        says = verdict.rate_hz
    raise RecordingError(
        f"{rate.source} says {rate.hz:g} Hz, but {clock.what} says {says:g} Hz", file=file, advice="give {rate_hz}"
    )


def doubts(contents: Contents, columns: Sequence[TimeColumn], rate_hz: float) -> list[str]:
    """What in the file contradicts a rate that the user gave."""
    said: list[str] = [
        _not_followed(s.source, s.rate_hz, "given rate")
        for s in contents.statements
        if abs(s.rate_hz - rate_hz) > _AGREEMENT * rate_hz
    ]
    for column in columns:
        verdict = column.examine()
        if isinstance(verdict, Irregular):
            said.append(Said(f"{column.what} {verdict.problem}; the given rate was followed", "irregular_time"))
        elif not _agree(verdict, rate_hz):
            said.append(_not_followed(column.what, verdict.rate_hz, "given rate"))
    return said


def _not_followed(source: str, rate_hz: float, followed: str) -> Said:
    return Said(f"{source} says {rate_hz:g} Hz, but the {followed} was followed", "rate_not_followed", [rate_hz])


def _agree(verdict: Uniform, rate_hz: float) -> bool:
    return verdict.low_hz * (1 - _AGREEMENT) <= rate_hz <= verdict.high_hz * (1 + _AGREEMENT)


def _hint(problem: Irregular) -> str:
    if problem.increasing:
        return "{resample_hz} interpolates onto a uniform grid, {rate_hz} ignores the stamps"
    return "{rate_hz} ignores the stamps ({resample_hz} needs stamps that increase)"
