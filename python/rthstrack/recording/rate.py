"""The sampling rate: what a file states, what its time columns tell, and what contradicts what."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.stamps import Irregular, Uniform, examine
from rthstrack.recording.recording import select
from rthstrack.said import Said
from rthstrack.units import seconds_in, split_unit

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


@dataclass(frozen=True, slots=True, eq=False)
class TimeColumn:
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
    r"(?:elapsed|running|relative|test|total|run|sample|measurement|record|simulation|sim)[ _-]?time|"
    "tijd|tid|czas|zaman|aika|čas|время|час|χρόνος|時間|时间|時刻|时刻|経過時間|시간|समय|الزمن|الوقت|זמן",
    re.IGNORECASE,
)


def time_columns(contents: Contents, chosen: str | None, file: str) -> list[TimeColumn]:
    """The columns that may tell the time, best first; only the chosen one where one is."""
    series, clocks = contents.series, contents.clocks
    if chosen is not None:
        at = select(chosen, [(c.name, c.path) for c in series] + [(c.name, c.path) for c in clocks], file)
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
    if loose and len(series.values) > 1:
        return bool(np.all(np.diff(series.values) > 0))
    # Whatever its name: what rises evenly in a unit of time is time.
    return unit_s is not None and len(series.values) > 3 and isinstance(examine(series.values, unit_s), Uniform)


def _unit(series: Series) -> str | None:
    return series.unit or split_unit(series.name)[1]


def _numeric_time(series: Series, unit_s: float, how: str = "") -> TimeColumn:
    what = f"time column '{series.path}'" + (f" ({how})" if how else "")
    return TimeColumn(what, series.path, series.values, unit_s)


def _clock_time(clock: Clock) -> TimeColumn:
    return TimeColumn(f"date-time column '{clock.path}'", clock.path, clock.seconds, 1.0, is_clock=True)


def settle(contents: Contents, columns: Sequence[TimeColumn], *, chosen: bool, file: str) -> Rate:
    """The rate by the order of `read_recording`, every contradiction an error."""
    if chosen:
        verdict = columns[0].examine()
        if isinstance(verdict, Irregular):
            raise RecordingError(f"{columns[0].what} {verdict.problem}", file=file, advice=_hint(verdict))
        ignored = [s for s in contents.statements if not _agree(verdict, s.rate_hz)]
        said = tuple(_not_followed(s.source, s.rate_hz, "named time") for s in ignored)
        return Rate(verdict.rate_hz, columns[0].what, verdict.start_s, said)
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
                raise RecordingError(f"{clock.what} {verdict.problem}", file=file, advice=_hint(verdict))
            rate = Rate(verdict.rate_hz, clock.what)
        elif rate.hz is not None:
            notes += _compare_clock(rate, clock, verdict, file)
    if rate is not None:
        return replace(rate, notes=(*rate.notes, *notes))
    return _guessed(contents) or Rate(None, "the file states no sampling rate and has no time column")


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
    if first.rounded and first.high_hz - first.low_hz > 2e-3 * first.rate_hz:
        words = (
            f"{column.what} is rounded: any rate from {first.low_hz:.6g} to {first.high_hz:.6g} Hz fits it; "
            "give the rate if you know better"
        )
        notes.append(Said(words, "rounded_time", (first.low_hz, first.high_hz)))
    return Rate(first.rate_hz, column.what, first.start_s, tuple(notes))


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


def _guessed(contents: Contents) -> Rate | None:
    """The first column where columns have no names, if it rises evenly in steps that are no count."""
    first = contents.series[0]
    if not contents.nameless or len(contents.series) < 2 or len(first.values) < 4:
        return None
    verdict = examine(first.values)
    if isinstance(verdict, Irregular) or abs(verdict.rate_hz - 1) < 1e-6:
        return None
    source = f"column '{first.path}' (it has no name, but rises evenly: taken as time in s)"
    return Rate(verdict.rate_hz, source, verdict.start_s)


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
