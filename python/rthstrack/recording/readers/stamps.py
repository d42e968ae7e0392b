"""Time stamps: are they those of uniform sampling, and at which rate?"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.values import median

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A stamp may lie this share of a step beside its place.
_JITTER = 0.01
# Stamps may be this many quanta beside the exact time: half of one is rounding, the rest is round-off.
_ROUNDING = 0.51
# A rate is rounded to a nice value only where the stamps leave less than this open.
_NICE = 5e-4
# Even exact stamps are known to round-off only.
_ROUND_OFF = 1e-9


@dataclass(frozen=True, slots=True)
class Uniform:
    """Stamps of uniform sampling. `low_hz` and `high_hz` bound the rates that the stamps allow.

    `rounded` says that the steps are uneven, as rounding makes them; `origin_s` is when the first sample was taken by
    all stamps together, which rounding does not move.
    """

    rate_hz: float
    low_hz: float
    high_hz: float
    start_s: float
    rounded: bool
    origin_s: float = math.nan


@dataclass(frozen=True, slots=True)
class Irregular:
    """Stamps that are not: what is wrong with them, in words, and whether they can be interpolated from."""

    problem: str
    increasing: bool
    mean_rate_hz: float


def examine(stamps: NDArray[np.float64], unit_s: float = 1.0) -> Uniform | Irregular:
    """Judges time stamps (n_samples,), of which one unit is `unit_s` seconds.

    Uniform if every stamp is within 1 % of a step of t0 + i dt, or if rounding explains the rest: all stamps are
    multiples of one decimal quantum q and some line t0 + i dt stays within 0.51 q of all of them. (One or two odd
    steps among equal ones are a lost or repeated sample, not rounding: that would come back at an even spacing.)

    The rate is the inverse slope of the least-squares line, replaced by the first of these that lies within what the
    stamps allow, if they leave less than 0.05 % open: one or two significant digits; a step of one or two significant
    digits; three to six significant digits.
    """
    with np.errstate(all="ignore"):
        return _examine(stamps, unit_s)


def _examine(stamps: NDArray[np.float64], unit_s: float) -> Uniform | Irregular:
    n = len(stamps)
    if n < 2:
        return Irregular(f"has {n} stamp(s); two are needed", False, math.nan)
    broken = np.flatnonzero(~np.isfinite(stamps))
    if broken.size:
        return Irregular(f"has {broken.size} of {n} stamps missing (first at sample {broken[0]})", False, math.nan)
    steps = np.diff(stamps)
    span = float(stamps[-1] - stamps[0])
    if span <= 0 or not math.isfinite(span):
        return _describe(stamps, steps, unit_s)
    index = np.arange(n) - (n - 1) / 2
    middle = float(stamps.mean())
    slope = float(index @ (stamps - middle)) / (n * (n * n - 1) / 12)
    off = float(np.abs(stamps - middle - slope * index).max())
    quantum = _quantum(stamps)
    round_off = 8 * float(np.finfo(float).eps) * float(np.abs(stamps).max())
    rounded = not (slope > 0 and off <= _JITTER * slope)
    if not rounded:
        spread = max(2 * off, quantum) + round_off
        shortest, longest = slope - spread / (n - 1), slope + spread / (n - 1)
    elif quantum > 0 and _evenly_odd(steps, quantum):
        half = _ROUNDING * quantum + round_off
        longest, shortest = _steepest(stamps, half), -_steepest(-stamps, half)
        if longest < shortest or longest <= 0:
            return _describe(stamps, steps, unit_s)
        slope = min(max(slope, shortest), longest)
    else:
        return _describe(stamps, steps, unit_s)
    low = 1 / (longest * unit_s)
    high = 1 / (shortest * unit_s) if shortest > 0 else math.inf
    rate = 1 / (slope * unit_s)
    if not 1e-12 < rate < 1e12:
        return _describe(stamps, steps, unit_s)
    nice, start = _nice(rate, low, high), float(stamps[0]) * unit_s
    origin = middle * unit_s - (n - 1) / 2 / nice if rounded else start
    return Uniform(nice, low, high, start, rounded, origin)


def _quantum(stamps: NDArray[np.float64]) -> float:
    """The largest power of ten, 1 to 1e-9, of which all stamps are multiples, or the spacing of float32; else 0."""
    largest = float(np.abs(stamps).max())
    ends = np.concatenate([stamps[:1000], stamps[-1000:]])
    for decimals in range(10):
        scale = 10.0**decimals
        tolerance = 1e-6 + 4 * np.finfo(float).eps * largest * scale
        if tolerance > 0.05:
            break
        if all(np.abs(s * scale - np.rint(s * scale)).max() <= tolerance for s in (ends, stamps)):
            return 1 / scale
    if largest < 1e30 and np.array_equal(stamps.astype(np.float32).astype(float), stamps):
        return float(np.spacing(np.float32(largest)))
    return 0.0


def _evenly_odd(steps: NDArray[np.float64], quantum: float) -> bool:
    """Whether the steps are of two neighbouring sizes in quanta, the rarer one at least three times."""
    quanta = np.rint(steps / quantum)
    least, greatest = float(quanta.min()), float(quanta.max())
    if greatest - least != 1 or least < 0:
        return False
    n_greatest = int(np.count_nonzero(quanta == greatest))
    return min(n_greatest, len(steps) - n_greatest) >= 3


def _steepest(stamps: NDArray[np.float64], half: float) -> float:
    """The steepest line that stays within `half` of all stamps: min over i < j of (t_j - t_i + 2 half) / (j - i).

    Dinkelbach's iteration for a least ratio: each round is one pass and ends at a better pair.
    """
    index = np.arange(len(stamps), dtype=float)
    slope = (float(stamps[-1] - stamps[0]) + 2 * half) / (len(stamps) - 1)
    for _ in range(100):
        level = stamps - slope * index
        room = level[1:] + 2 * half - np.maximum.accumulate(level)[:-1]
        j = int(room.argmin()) + 1
        i = int(level[:j].argmax())
        better = (float(stamps[j] - stamps[i]) + 2 * half) / (j - i)
        if better >= slope:
            break
        slope = better
    return slope


def _nice(rate: float, low: float, high: float) -> float:
    """The roundest rate within the bounds (see `examine`)."""
    if not high - low < 2 * _NICE * rate:
        low = high = rate
    low, high = min(low, rate * (1 - _ROUND_OFF)), max(high, rate * (1 + _ROUND_OFF))
    candidates = [float(f"{rate:.{digits}e}") for digits in range(2)]
    candidates += [1 / float(f"{1 / rate:.{digits}e}") for digits in range(2)]
    candidates += [float(f"{rate:.{digits}e}") for digits in range(2, 6)]
    return next((c for c in candidates if low <= c <= high), rate)


def _describe(stamps: NDArray[np.float64], steps: NDArray[np.float64], unit_s: float) -> Irregular:
    """Which steps are odd, how many, where first, and the steps' statistics."""
    middle = median(steps)
    usual = middle if middle > 0 else float(stamps[-1] - stamps[0]) / len(steps)
    back, repeats, jumps = steps < 0, steps == 0, steps > 1.5 * abs(usual)
    jitter = ~(back | repeats | jumps) & (np.abs(steps - usual) > _JITTER * abs(usual))
    kinds = [(back, "step(s) back"), (repeats, "repeat(s)"), (jumps, "jump(s)"), (jitter, "step(s) of odd length")]
    counts = [(int(np.count_nonzero(odd)), words) for odd, words in kinds]
    odd = back | repeats | jumps | jitter
    where = f" (first at sample {int(odd.argmax()) + 1})" if odd.any() else ""
    said = ", ".join(f"{count} {words}" for count, words in counts if count) or "a step that drifts"
    low, mid, high = (f"{float(v) * unit_s:.6g}" for v in (steps.min(), middle, steps.max()))
    span = float(stamps[-1] - stamps[0]) * unit_s
    return Irregular(
        f"is not uniform: {said} among {len(steps)} steps{where}; steps in s: median {mid}, least {low}, greatest "
        f"{high}",
        bool(np.all(steps > 0)),
        len(steps) / span if span > 0 else math.nan,
    )
