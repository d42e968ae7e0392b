"""Gates: what the user allows, held against the whole record and its moving windows. In doubt a gate is closed.

A number passes where its interval lies within the limit whole, and exceeds it where the interval lies beyond whole; an
interval on both sides, or no number, cannot be judged. Without an interval the number itself is held against the limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rthstrack.errors import SettingError
from rthstrack.said import Said, of_core
from rthstrack.values import stretches
from rthstrack.verdict.sentence import _undetermined

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from rthstrack.evaluation.tracking import MovingTracking, Tracking

    Floats = NDArray[np.float64]

PASSED, EXCEEDED, NOT_JUDGED = "passed", "exceeded", "not_judged"

# More than this share of the windows in which target moves must be judged.
_MOST_UNJUDGED = 0.5
# Target moves strongly in a window from this share of the record's standard deviation on.
_STRONG = 0.3


@dataclass(frozen=True, slots=True)
class Limits:
    """What the user allows: |delay_s| <= delay_s, |amplitude - 1| <= amplitude.

    critical_delay_s: the delay at which the test becomes unstable, of which a lag may reach critical_fraction; a lead
    does not come near it.
    """

    delay_s: float | None = None
    amplitude: float | None = None
    critical_delay_s: float | None = None
    critical_fraction: float = 1.0

    def __post_init__(self) -> None:
        for name in ("delay_s", "amplitude", "critical_delay_s", "critical_fraction"):
            value = getattr(self, name)
            if value is None and name != "critical_fraction":
                continue
            is_number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
            # A loop that is unstable without any delay has a critical delay of 0.
            if not is_number or math.isnan(value) or value < 0 or (value == 0 and name != "critical_delay_s"):
                raise SettingError(f"limits: {name} must be a number above 0, not {value!r}")
        if self.amplitude is not None and self.amplitude >= 1:
            raise SettingError(
                f"limit_amplitude: expected a share below 1 of |amplitude - 1|, found {self.amplitude:g}; 5 % is 0.05"
            )
        if self.critical_fraction > 1:
            raise SettingError(
                f"critical_fraction: expected at most 1, the critical delay itself, found {self.critical_fraction:g}"
            )

    def _rows(self) -> list[_Row]:
        found = [_Row(kind, limit) for kind, limit in ((_DELAY, self.delay_s), (_AMPLITUDE, self.amplitude)) if limit]
        if (critical := self.critical_delay_s) is not None:
            found.append(_Row(_CRITICAL, self.critical_fraction * critical, critical))
        return found

    def check(self, longest_s: float, looked_for: str) -> None:
        """Raises SettingError for a limit of the delay that no reading could exceed.

        longest_s: the longest delay that is looked for; `looked_for` says what bounds it.
        """
        for row in self._rows():
            if row.kind is _AMPLITUDE or row.limit < longest_s:
                continue
            name = "critical_delay_s" if row.kind is _CRITICAL else "limit_delay_s"
            milli = f"; {row.limit:g} ms is {row.limit / 1000:g} s" if row.limit / 1000 < longest_s else ""
            raise SettingError(
                f"{name}: {row.limit:g} s can never be exceeded, because only delays up to {looked_for}, {longest_s:g} "
                f"s, are looked for: expected less{milli}",
                code="limit_never_exceeded",
                values=(row.limit, longest_s),
            )


@dataclass(frozen=True, slots=True)
class Held:
    """One number held against a limit: `low` and `high` are the ends of its interval, NaN where there is none."""

    state: str
    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Gate:
    """One limit, and what was found: of the whole record, and of the worst moving window.

    name: "delay" (|delay_s|), "amplitude" (|amplitude - 1|) or "critical_delay" (delay_s); `limit` and the values are
    these numbers, in seconds or none. `state`: "passed", "exceeded" or "not_judged". `worst_s` is the centre of the
    worst window, in the recording's time; `over_s` lists from when to when the windows' centres exceed the limit.
    `reason` says in one sentence why, with its code.
    """

    name: str
    limit: float
    state: str
    whole: Held
    worst: Held | None
    worst_s: float
    window_s: float
    n_moving: int
    n_undetermined: int
    over_s: tuple[tuple[float, float], ...]
    reason: Said

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and lists; None where there is no number."""

        def held(one: Held | None) -> dict[str, Any] | None:
            if one is None:
                return None
            interval = None if math.isnan(one.low) else [one.low, one.high]
            return {"state": one.state, "value": None if math.isnan(one.value) else one.value, "interval": interval}

        return {
            "name": self.name,
            "limit": self.limit,
            "state": self.state,
            "whole": held(self.whole),
            "worst_window": held(self.worst),
            "worst_window_time_s": None if math.isnan(self.worst_s) else self.worst_s,
            "window_s": None if math.isnan(self.window_s) else self.window_s,
            "windows_that_move": self.n_moving,
            "windows_undetermined": self.n_undetermined,
            "over_limit_s": [list(span) for span in self.over_s],
            "reason": str(self.reason),
            "reason_code": self.reason.code,
        }


class _Kind(NamedTuple):
    """What is limited: from the tracking's number and interval to the number that a limit is held against."""

    name: str
    of: str
    called: str
    unit: str
    factor: float
    of_value: Callable[[Any], Any]
    is_signed: bool

    def text(self, value: float) -> str:
        """The number as people read it."""
        return f"{self.factor * value:.4g}{self.unit}"


_DELAY = _Kind("delay", "delay_s", "|delay|", " ms", 1e3, lambda d: d, is_signed=False)
_AMPLITUDE = _Kind("amplitude", "amplitude", "|amplitude - 1|", "", 1.0, lambda a: a - 1, is_signed=False)
_CRITICAL = _Kind("critical_delay", "delay_s", "delay", " ms", 1e3, lambda d: d, is_signed=True)


class _Row(NamedTuple):
    """A limit; of a critical delay the delay itself, of which the limit may be a share."""

    kind: _Kind
    limit: float
    critical: float = math.nan


def gates(
    tracking: Tracking,
    moving: MovingTracking | None,
    limits: Limits,
    *,
    target: Floats,
    trusted: Tracking,
    copy: Said | None = None,
    start_s: float = 0.0,
) -> tuple[Gate, ...]:
    """Each limit held against an estimate and its moving windows.

    target: (n_samples,), which tells in which windows there is something to judge. An estimate that is not the trusted
    one passes nothing that the trusted one does not pass. `copy` says that measured is a copy of target, which passes
    nothing; start_s: the recording's time at the first sample.
    """
    rows = limits._rows()
    motion = None if moving is None or not rows else motion_in_windows(target, moving)
    return tuple(_gate(row, tracking, moving, motion, trusted, copy, start_s) for row in rows)


def outcome(found: Sequence[Gate]) -> str | None:
    """The worst state of all gates: "exceeded", "not_judged" or "passed"; None where nothing is limited."""
    states = {gate.state for gate in found}
    return next((state for state in (EXCEEDED, NOT_JUDGED, PASSED) if state in states), None)


def _gate(
    row: _Row,
    tracking: Tracking,
    moving: MovingTracking | None,
    motion: Floats | None,
    trusted: Tracking,
    copy: Said | None,
    start_s: float,
) -> Gate:
    whole = _held_one(row, tracking)
    windows = _Windows.of(row, moving, motion, start_s)
    state, reason = _judged(row, whole, windows, tracking, trusted, copy)
    return Gate(
        name=row.kind.name,
        limit=row.limit,
        state=state,
        whole=whole,
        worst=windows.worst,
        worst_s=windows.worst_s,
        window_s=math.nan if moving is None else moving.window_s,
        n_moving=windows.n_moving,
        n_undetermined=windows.n_undetermined,
        over_s=windows.over_s,
        reason=reason,
    )


def _judged(
    row: _Row, whole: Held, windows: _Windows, tracking: Tracking, trusted: Tracking, copy: Said | None
) -> tuple[str, Said]:
    """The state of a gate, and why."""
    name, limit, worst = row.kind.name, row.limit, windows.worst
    if copy is not None:
        return NOT_JUDGED, Said(f"no limit is passed: {copy.cause}", "limit_copy")
    asked = f"the limit of {row.kind.text(limit)}"
    found = f"{row.kind.called} {_told(row, whole)}{_share(row, whole)}"
    code = f"limit_{name}"
    if windows.state == EXCEEDED and worst is not None and (whole.state != EXCEEDED or worst.value > whole.value):
        words = f"{row.kind.called} {_told(row, worst)}{_share(row, worst)} in the {windows.where}"
        words += f" exceeds {asked} ({_spans(windows)})"
        return EXCEEDED, Said(words, code, (worst.value, limit))
    if whole.state == EXCEEDED:
        return EXCEEDED, Said(f"{found} exceeds {asked}", code, (whole.value, limit))
    if (why := _undetermined(tracking)) is not None:
        return NOT_JUDGED, Said(f"{row.kind.called} is not determined: {why}", "limit_undetermined")
    if (why := _undetermined(trusted)) is not None:
        words = f"{found} is the published average; the trusted estimate is not determined: {why}"
        return NOT_JUDGED, Said(words, "limit_undetermined")
    if whole.state == NOT_JUDGED:
        return NOT_JUDGED, Said(
            f"{found} may be within or beyond {asked}: its interval contains the limit",
            "limit_straddled",
            (whole.low, whole.high),
        )
    if tracking is not trusted and _held_one(row, trusted).state != PASSED:
        words = f"{found} is within {asked}, but the trusted estimate, {_told(row, _held_one(row, trusted))}, is not"
        return NOT_JUDGED, Said(words, "limit_not_trusted")
    if windows.unknown is not None:
        first, last, cause = windows.unknown
        words = f"from {first:.4g} to {last:.4g} s, where target moves, nothing is known: {cause}"
        return NOT_JUDGED, Said(words, "limit_stretch", (first, last))
    if windows.state == NOT_JUDGED:
        if not windows.n_moving:
            return NOT_JUDGED, Said("no moving window could be judged", "limit_windows", (0, 0))
        if worst is not None and windows.n_undetermined <= _MOST_UNJUDGED * windows.n_moving:
            words = (
                f"{row.kind.called} {_told(row, worst)} in the {windows.where} may be within or beyond {asked}: "
                "its interval contains the limit"
            )
            return NOT_JUDGED, Said(words, "limit_straddled", (worst.low, worst.high))
        return NOT_JUDGED, Said(_missing(windows), "limit_windows", (windows.n_undetermined, windows.n_moving))
    alone = "" if not math.isnan(whole.low) else "; there is no interval, so only the number was compared"
    at_worst = "" if worst is None else f" (at worst {_told(row, worst)} in the {windows.where})"
    missing = f"; {_missing(windows)}" if windows.n_undetermined else ""
    return PASSED, Said(f"{found}{at_worst} is within {asked}{alone}{missing}", "limit_passed", (whole.value, limit))


def _held(row: _Row, value: float, low: float, high: float) -> Held:
    """A number of a tracking, with its interval, against the limit."""
    value, low, high = (float(row.kind.of_value(x)) for x in (value, low, high))
    if not row.kind.is_signed:
        ends = sorted((abs(low), abs(high)))
        low, high = (0.0 if low <= 0 <= high else ends[0]), ends[1]
        value = abs(value)
    if math.isnan(value):
        return Held(NOT_JUDGED, math.nan, math.nan, math.nan)
    if not math.isfinite(high - low):
        return Held(EXCEEDED if value > row.limit else PASSED, value, math.nan, math.nan)
    state = PASSED if high <= row.limit else EXCEEDED if low > row.limit else NOT_JUDGED
    return Held(state, value, low, high)


def _held_one(row: _Row, tracking: Tracking) -> Held:
    name = row.kind.of
    interval = tracking.delay_interval_s if name == "delay_s" else tracking.amplitude_interval
    return _held(row, float(getattr(tracking, name)), float(interval[0]), float(interval[1]))


class _Windows(NamedTuple):
    """All moving windows against one limit."""

    state: str
    worst: Held | None = None
    worst_s: float = math.nan
    window_s: float = math.nan
    n_moving: int = 0
    n_undetermined: int = 0
    over_s: tuple[tuple[float, float], ...] = ()
    unknown: tuple[float, float, str] | None = None

    @property
    def where(self) -> str:
        """The worst window."""
        return f"{self.window_s:.3g} s around {self.worst_s:.4g} s"

    @classmethod
    def of(cls, row: _Row, moving: MovingTracking | None, motion: Floats | None, start_s: float) -> _Windows:
        if moving is None or motion is None:
            return cls(NOT_JUDGED)
        moves, strongly = motion >= moving.minimum_std_ratio, motion >= _STRONG
        name = row.kind.of
        intervals: Floats = moving.delay_interval_s if name == "delay_s" else moving.amplitude_interval
        held = [
            _held(row, float(value), float(low), float(high))
            for value, (low, high) in zip(getattr(moving, name), intervals, strict=True)
        ]
        # An interval wider than the limit, or with the limit in it where target moves but little, says nothing of it.
        says = np.array([_says(one, row.limit, bool(strong)) for one, strong in zip(held, strongly, strict=True)])
        n_moving = int(moves.sum())
        n_undetermined = int((moves & ~says).sum())
        times = start_s + moving.time_s
        known = np.flatnonzero(moves & says)
        if not known.size:
            return cls(
                NOT_JUDGED if n_moving else PASSED, n_moving=n_moving, n_undetermined=n_undetermined,
                window_s=moving.window_s,
            )  # fmt: skip
        over = np.array([one.state == EXCEEDED for one in held], dtype=bool) & moves & says
        among = np.flatnonzero(over) if over.any() else known
        worst = int(max(among, key=lambda i: held[i].value))
        state = held[worst].state
        if state != EXCEEDED and n_undetermined > _MOST_UNJUDGED * n_moving:
            state = NOT_JUDGED
        return cls(
            state,
            held[worst],
            float(times[worst]),
            moving.window_s,
            n_moving,
            n_undetermined,
            _runs(times, over),
            _unknown(moving, np.array([math.isnan(one.value) for one in held]), strongly, start_s),
        )


def _says(held: Held, limit: float, strongly: bool) -> bool:
    """Whether a window's number says something of the limit."""
    if held.state == EXCEEDED:
        return True
    if math.isnan(held.value) or held.high - held.low > limit:
        return False
    return strongly or held.state == PASSED or held.value > limit


def _unknown(
    moving: MovingTracking, undetermined: NDArray[np.bool_], strongly: NDArray[np.bool_], start_s: float
) -> tuple[float, float, str] | None:
    """The longest stretch, of a window at least, in which target moves strongly and no window has a number; and why."""
    _, first, end = max(
        ((end - first, first, end) for first, end in stretches(undetermined & strongly)), default=(0, 0, 0)
    )
    if (end - first) * moving.hop_s < moving.window_s:
        return None
    middle = (first + end) // 2
    said: Any = (moving.reason[middle], moving.reason_code[middle], moving.reason_values[middle])
    why = of_core(*said).cause or "measured does not move"
    return start_s + float(moving.time_s[first]), start_s + float(moving.time_s[end - 1]), why


def motion_in_windows(target: Floats, moving: MovingTracking) -> Floats:
    """Target's standard deviation in each window over that of the record, whatever measured does."""
    n = round(moving.window_s * moving.rate_hz)
    starts = np.rint(moving.time_s * moving.rate_hz - (n - 1) / 2).astype(np.intp)
    centred = target - target.mean()
    sums, squares = (np.concatenate(([0.0], np.cumsum(column))) for column in (centred, centred**2))
    mean = (sums[starts + n] - sums[starts]) / n
    variance = (squares[starts + n] - squares[starts]) / n - mean**2
    spread = float(target.std())
    moves: Floats = np.sqrt(np.maximum(variance, 0.0)) / spread if spread > 0 else np.zeros(starts.size)
    return moves


def _runs(times: Floats, over: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """From when to when windows in a row are over the limit."""
    return tuple((float(times[first]), float(times[end - 1])) for first, end in stretches(over))


def _missing(windows: _Windows) -> str:
    return (
        f"{windows.n_undetermined} of the {windows.n_moving} windows in which target moves have no number, or too wide "
        "an interval"
    )


def _spans(windows: _Windows) -> str:
    """When, and how long."""
    spans = windows.over_s
    first, last = spans[0]
    one = f"from {first:.4g} to {last:.4g} s" if first != last else f"at {first:.4g} s"
    return f"exceeded {one}" if len(spans) == 1 else f"exceeded {len(spans)} times, first {one}"


def _share(row: _Row, held: Held) -> str:
    """A lag as a share of the critical delay."""
    if not (math.isfinite(row.critical) and row.critical > 0 and held.value > 0):
        return ""
    return f", {100 * held.value / row.critical:.3g} % of the critical {row.kind.text(row.critical)},"


def _told(row: _Row, held: Held) -> str:
    """A number as people read it, with its interval."""
    text = row.kind.text
    if math.isnan(held.low):
        return text(held.value)
    scale = row.kind.factor
    half = scale * (held.high - held.low) / 2
    places = 3 if half <= 0 else max(0, min(6, 1 - math.floor(math.log10(half))))
    low, value, high = (f"{scale * x:.{places}f}" for x in (held.low, held.value, held.high))
    return f"{value}{row.kind.unit} ({low} to {high})"


#: What a state is called where people read it.
CONCLUSIONS = {PASSED: "PASS", EXCEEDED: "FAIL", NOT_JUDGED: "CANNOT BE JUDGED"}


def conclusion(found: Sequence[Gate]) -> str:
    """What was asked, what was found, passed or not, in one line; nothing where nothing is limited."""
    state = outcome(found)
    return "" if state is None else f"{CONCLUSIONS[state]}: {reasons(found)}"


def reasons(found: Sequence[Gate]) -> str:
    """Why, of all gates: what decides comes first, and one sentence that they share is said once."""
    decides = outcome(found)
    order = sorted(found, key=lambda gate: gate.state != decides)
    return "; ".join(dict.fromkeys(str(gate.reason) for gate in order))
