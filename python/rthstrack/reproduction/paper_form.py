"""The evaluation as the paper describes it, straightforwardly in SciPy, and the two filters of `decimate` in use then.

It stands beside ours: computing times are compared like with like, and what P does in the paper's figures is rebuilt.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
import scipy.fft
import scipy.signal

if TYPE_CHECKING:
    from numpy.typing import NDArray

Decimate: TypeAlias = "Callable[[NDArray[np.float64], int], NDArray[np.float64]]"

#: Rounds of timing, at least 2.
_ROUNDS = 10


class Timing(NamedTuple):
    """Processor time of a call: the median of all rounds, of every other round, and of the rounds between."""

    time_s: float
    first_s: float
    second_s: float


@dataclass(frozen=True, slots=True)
class Reading:
    """A and d by the paper's form, NaN where the filter left nothing finite.

    The times are those of `Timing`, NaN if not timed: a statement on them must hold in both halves of the rounds.
    """

    amplitude: float
    delay_s: float
    equivalent_frequency_hz: float
    computing_time_s: float = math.nan
    first_time_s: float = math.nan
    second_time_s: float = math.nan


def second_order_sections(x: NDArray[np.float64], P: int) -> NDArray[np.float64]:
    """Chebyshev I of order 8 forwards and backwards as second-order sections: `decimate` of SciPy."""
    return np.asarray(scipy.signal.decimate(x, P, ftype="iir", zero_phase=True)) if P > 1 else x


def transfer_function(x: NDArray[np.float64], P: int) -> NDArray[np.float64]:
    """The same filter as one quotient of polynomials, as Octave's `decimate`: unstable from P = 128."""
    if P == 1:
        return x
    b, a = scipy.signal.cheby1(8, 0.05, 0.8 / P)
    with np.errstate(all="ignore"):
        return np.asarray(scipy.signal.filtfilt(b, a, x)[::P])


def lowered_order(x: NDArray[np.float64], P: int) -> NDArray[np.float64]:
    """As MATLAB's `decimate`: a quotient of polynomials of lowered order (see below); the last sample is kept."""
    if P == 1:
        return x
    b, a = scipy.signal.cheby1(order_of_matlab(P), 0.05, 0.8 / P)
    filtered = scipy.signal.filtfilt(b, a, x, padlen=3 * (len(a) - 1))
    return np.asarray(filtered[(len(x) - 1) % P :: P])


@functools.cache
def order_of_matlab(P: int) -> int:
    """The largest order up to 8 whose gain at 0.8/P is within 1e-6 dB of the ripple, 0.05 dB."""
    for order in range(8, 1, -1):
        b, a = scipy.signal.cheby1(order, 0.05, 0.8 / P)
        z = np.exp(-0.8j * np.pi / P * np.arange(order + 1))
        if abs(20 * math.log10(abs((z @ b) / (z @ a))) + 0.05) <= 1e-6:
            return order
    return 1


def largest_pole(P: int) -> float:
    """The largest modulus among the roots of the eighth-order denominator as its rounded coefficients give them."""
    _, a = scipy.signal.cheby1(8, 0.05, 0.8 / P)
    return float(np.abs(np.roots(a)).max())


def evaluate(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    rate_hz: float,
    P: int,
    Q: int,
    decimate: Decimate = second_order_sections,
) -> Reading:
    """Decimate, transform whole, weigh every Q-th bin (Eqs 7-12 as printed, l = 2)."""
    target, measured = decimate(target, P), decimate(measured, P)
    if not (np.isfinite(target).all() and np.isfinite(measured).all()):
        return Reading(math.nan, math.nan, math.nan)
    n = 1 << (len(target) - 1).bit_length()
    i, o = (scipy.fft.rfft(x, n)[Q::Q] for x in (target, measured))
    f = np.arange(Q, n // 2 + 1, Q) * (rate_hz / P / n)
    with np.errstate(all="ignore"):
        weights = np.abs(i) ** 2
        weights /= weights.sum()
        fei = np.sum(o / i * weights)
        f_eq = np.sum(weights * f)
        return Reading(float(abs(fei)), float(-np.angle(fei) / (2 * np.pi * f_eq)), float(f_eq))


def measured(calls: Sequence[Callable[[], object]], done: Callable[[int, int], object]) -> list[Timing]:
    """The processor time of each call, in rounds, as if the machine always ran at the same speed.

    What else runs there slows a processor down by up to half, for seconds: a yardstick, a transform and a filter of
    always the same samples, is timed before and after each call, and the call's time divided by how slow it was.
    """
    found: list[list[float]] = [[] for _ in calls]
    yardsticks = []
    for number in range(_ROUNDS):
        for i, call in enumerate(calls):
            before = _yardstick_s()
            call_s = _processor_s(call)
            yardstick = (before + _yardstick_s()) / 2
            found[i].append(call_s / yardstick)
            yardsticks.append(yardstick)
            done(number * len(calls) + i + 1, _ROUNDS * len(calls))
    unhindered_s = float(np.quantile(yardsticks, 0.05))
    return [Timing(*(unhindered_s * float(np.median(x)) for x in (one, one[::2], one[1::2]))) for one in found]


def _yardstick_s() -> float:
    return min(_processor_s(_yardstick) for _ in range(2))


def _yardstick() -> None:
    samples, filter_b, filter_a = _yardstick_parts()
    scipy.fft.rfft(samples)
    scipy.signal.lfilter(filter_b, filter_a, samples)


@functools.cache
def _yardstick_parts() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    return np.sin(np.arange(16384.0) ** 1.5), *scipy.signal.cheby1(4, 0.05, 0.3)


def _processor_s(call: Callable[[], object]) -> float:
    start = time.thread_time()
    call()
    return max(time.thread_time() - start, 1e-9)
