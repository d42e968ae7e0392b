"""Gain and delay by alignment a second time, as plainly as NumPy and SciPy allow; it shares no code with the package.

Model over the samples [start, stop) of a record: O_n = K I(n - tau rate) + e_n. I_tau(t) = I(t - tau) is read from a
spline of degree 9 through the raw target, samples outside [start, stop) included, I'_tau is its time derivative. Both
are detrended and windowed as the measured samples are, always after shifting and differentiating. Speed is no concern.

Signs: delay_s > 0 means measured lags target. I is the target, O the measured displacement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.interpolate
import scipy.linalg
import scipy.optimize
import scipy.signal
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

DEGREE = 9  # of the spline: its error at a fiftieth of the rate is about 1e-11 of the amplitude
STEPS = 1000  # where target is noisy I' is mostly noise and a step goes only a small part of the way
ALIGNING_STEPS = 100
SETTLED_S = 1e-12
LIKELY = 0.98  # of the highest correlation: lower peaks of it are no candidates for another turn


class Estimate(NamedTuple):
    """Gain K, delay tau in seconds and whether the steps came to rest."""

    amplitude: float
    delay_s: float
    settled: bool


class Errors(NamedTuple):
    """Standard deviations of gain and delay."""

    amplitude_std: float
    delay_std_s: float


class Target:
    """A target that can be read between its samples: degree 9 spline through all of them."""

    def __init__(self, samples: Floats, rate_hz: float) -> None:
        self.samples = np.asarray(samples, dtype=np.float64)
        self.rate_hz = float(rate_hz)
        self.spline = scipy.interpolate.make_interp_spline(np.arange(len(self.samples)), self.samples, k=DEGREE)
        self.slope = self.spline.derivative()

    def shifted(self, first: int, last: int, delay_s: float) -> tuple[Floats, Floats]:
        """I_tau and I'_tau (per second) at the samples [first, last), (n,) each."""
        at = np.arange(first, last) - delay_s * self.rate_hz
        return np.asarray(self.spline(at)), np.asarray(self.slope(at)) * self.rate_hz


@dataclass(frozen=True)
class Case:
    """One estimation: the record, the samples judged and how they are prepared.

    `band_hz` keeps the bins of the prepared samples' transform, zero-padded to a power of two, within both ends.
    `whitening` (1, a_1, ...) filters both sides by e_n + a_1 e_{n-1} + ... and leaves out the samples it starts on.
    """

    target: Target
    measured: Floats
    start: int = 0
    stop: int | None = None
    window: str = "boxcar"
    detrend: str = "none"
    band_hz: tuple[float, float] | None = None
    whitening: tuple[float, ...] = (1.0,)
    max_delay_s: float = 0.25

    @property
    def support(self) -> tuple[int, int]:
        """[start, stop) less what the target, moved by up to max_delay_s either way, does not reach."""
        n, reach = len(self.measured), math.ceil(self.max_delay_s * self.target.rate_hz)
        return max(self.start, reach), min(n if self.stop is None else self.stop, n - reach)

    def prepared(self, samples: Floats) -> Floats:
        """Detrended, windowed, whitened samples of the support; with a band: parts of the bins kept, side by side."""
        x = without_trend(samples, self.detrend) * window_shape(self.window, len(samples))
        x = np.asarray(scipy.signal.lfilter(self.whitening, [1.0], x))[len(self.whitening) - 1 :]
        if self.band_hz is None:
            return x
        _, X = bins(x, self.target.rate_hz, self.band_hz)
        return np.concatenate([X.real, X.imag])

    def observed(self) -> Floats:
        """The measured samples, prepared."""
        first, last = self.support
        return self.prepared(self.measured[first:last])

    def design(self, delay_s: float) -> Floats:
        """I_tau and I'_tau, prepared, as two columns."""
        return np.column_stack([self.prepared(x) for x in self.target.shifted(*self.support, delay_s)])


def window_shape(name: str, length: int) -> Floats:
    """Symmetric window; tukey tapers half of it."""
    if name == "tukey":
        return np.asarray(scipy.signal.windows.tukey(length, alpha=0.5, sym=True))
    return np.asarray(getattr(scipy.signal.windows, name)(length, sym=True))


def without_trend(samples: Floats, detrend: str) -> Floats:
    """The samples less their mean or their least-squares line."""
    if detrend == "none":
        return samples
    return np.asarray(scipy.signal.detrend(samples, type={"mean": "constant", "linear": "linear"}[detrend]))


def bins(samples: Floats, rate_hz: float, band_hz: tuple[float, float] | None = None) -> tuple[Floats, Complexes]:
    """Frequencies and DFT at the bins k = 1 .. n/2 of the zero-padded samples, those within the band."""
    n = 2 ** math.ceil(math.log2(len(samples)))
    f = np.arange(1, n // 2 + 1) * rate_hz / n
    low, high = band_hz or (0.0, math.inf)
    kept = (f >= low) & (f <= high)
    return f[kept], np.fft.fft(samples, n)[1 : n // 2 + 1][kept]


# Start value ----------------------------------------------------------------------------------------------------------


def correlation(case: Case) -> tuple[Floats, Floats]:
    """Whole-sample lags in s and Pearson's correlation of O_n with I_{n-k} over the support, (2 max lag + 1,).

    r(k) = cov(O, I_k) / sqrt(var O var I_k): each lag is divided by the energy of its own stretch of the target.
    """
    first, last = case.support
    reach, n = math.ceil(case.max_delay_s * case.target.rate_hz), last - first
    O = case.measured[first:last] - np.mean(case.measured[first:last])
    I = case.target.samples[first - reach : last + reach]
    I = I - np.mean(I)
    products = scipy.signal.correlate(I, O, mode="valid")
    sums = np.concatenate([[0.0], np.cumsum(I)])
    squares = np.concatenate([[0.0], np.cumsum(I**2)])
    energy = squares[n:] - squares[:-n] - (sums[n:] - sums[:-n]) ** 2 / n
    r = products / np.sqrt(np.maximum(energy, np.finfo(float).tiny) * np.sum(O**2))
    lags = np.arange(reach, -reach - 1, -1) / case.target.rate_hz
    return lags[::-1], r[::-1]


def start_value_s(case: Case) -> float:
    """The lag of the highest correlation within max_delay_s."""
    lags, r = correlation(case)
    return float(lags[np.argmax(r)])


def turns(case: Case) -> list[tuple[float, Estimate]]:
    """What is left of the energy, and the estimate, from each peak of the correlation: the best first.

    Where the second leaves no more than the first, the target cannot say which turn it is.
    """
    lags, r = correlation(case)
    peaks = scipy.signal.find_peaks(r, height=LIKELY * np.max(r))[0]
    y = case.observed()
    found: list[tuple[float, Estimate]] = []
    for lag in (*lags[peaks], lags[np.argmax(r)]):
        estimate = least_squares(case, float(lag))
        # Noise makes several peaks of one turn.
        if estimate.settled and all(abs(estimate.delay_s - e.delay_s) > 1 / case.target.rate_hz for _, e in found):
            left = y - estimate.amplitude * case.design(estimate.delay_s)[:, 0]
            found.append((float(left @ left / (y @ y)), estimate))
    return sorted(found)


# Estimators -----------------------------------------------------------------------------------------------------------


def least_squares(case: Case, start_s: float | None = None) -> Estimate:
    """Gain and delay that leave the least of O - K I_tau, by Gauss-Newton steps.

    O ~ K I_tau - (K delta) I'_tau solved for (K, K delta); tau <- tau + delta, until delta vanishes.
    """
    tau = start_value_s(case) if start_s is None else start_s
    y = case.observed()
    for _ in range(STEPS):
        (K, minus_K_delta), *_ = np.linalg.lstsq(case.design(tau), y, rcond=None)
        delta = -minus_K_delta / K
        if not abs(tau + delta) <= case.max_delay_s:
            break
        tau += delta
        if abs(delta) < SETTLED_S:
            return Estimate(float(K), float(tau), True)
    return Estimate(math.nan, math.nan, False)


def fei(case: Case, delay_s: float, weight_power: float = 2) -> tuple[complex, float]:
    """FEI of O over I_tau and its equivalent frequency: sum O_k conj(J_k) |J_k|^(l-2) / sum |J_k|^l."""
    first, last = case.support
    f, O = bins(_windowed(case, case.measured[first:last]), case.target.rate_hz, case.band_hz)
    _, J = bins(_windowed(case, case.target.shifted(first, last, delay_s)[0]), case.target.rate_hz, case.band_hz)
    weights = np.abs(J) ** weight_power / np.sum(np.abs(J) ** weight_power)
    return complex(
        np.sum(O * np.conj(J) * np.abs(J) ** (weight_power - 2.0)) / np.sum(np.abs(J) ** weight_power)
    ), float(f @ weights)


def aligned(case: Case, start_s: float | None = None, weight_power: float = 2) -> Estimate:
    """FEI's own delay of what is left, d = -arg FEI / (2 pi f_eq), added until nothing is left; from least squares.

    Steps that do not shrink are halved: the weights' own step is too long in some windows.
    """
    tau = least_squares(case, start_s).delay_s if start_s is None else start_s
    share, before = 1.0, math.inf
    for _ in range(ALIGNING_STEPS):
        value, f_eq = fei(case, tau, weight_power)
        d = -math.atan2(value.imag, value.real) / (2 * math.pi * f_eq)
        if abs(d) < SETTLED_S:
            return Estimate(abs(value), float(tau), True)
        if abs(d) >= before:
            share /= 2
        before = abs(d)
        tau += share * d
        if not abs(tau) <= case.max_delay_s:
            break
    return Estimate(math.nan, math.nan, False)


def total_least_squares(
    case: Case, noise_ratio: float, start_s: float | None = None, reach_s: float = 0.002
) -> Estimate:
    """Gain and delay where target is measured too, its white noise `noise_ratio` times as strong as measured's.

    Least of J = |O - K I_tau|^2 / (1 + (K ratio)^2 g(tau)): the residual over its own variance (Deming 1943, with a
    delay). g is what reading between samples leaves of white noise in the band. It is below 1 between samples:
    without it the least residual would be drawn there. For each tau, K in closed form:
    with a = O.O, b = O.J, c = J.J and r = ratio sqrt(g):  r^2 b K^2 + (c - r^2 a) K - b = 0.
    The noise of both makes hollows a sample wide, so tau is searched on a grid of reach_s around its start.
    """
    tau = start_value_s(case) if start_s is None else start_s
    y = case.observed()

    def solved(tau: float) -> tuple[float, float]:
        J = case.design(tau)[:, 0]
        r2 = noise_ratio**2 * noise_passed(tau * case.target.rate_hz, case.target.rate_hz, case.band_hz)
        a, b, c = y @ y, y @ J, J @ J
        linear = c - r2 * a
        K = 2 * b / (linear + math.sqrt(linear**2 + 4 * r2 * b**2))
        return float((a - 2 * K * b + K**2 * c) / (1 + K**2 * r2)), float(K)

    quarter_s = 0.25 / case.target.rate_hz
    n = math.ceil(reach_s / quarter_s)
    grid = tau + quarter_s * np.arange(-n, n + 1)
    best = float(min(grid, key=lambda tau: solved(float(tau))[0]))
    found = scipy.optimize.minimize_scalar(
        lambda tau: solved(tau)[0],
        bounds=(best - quarter_s, best + quarter_s),
        method="bounded",
        options={"xatol": 1e-11},
    )
    inside = grid[0] < best < grid[-1]
    return Estimate(solved(found.x)[1], float(found.x), bool(found.success and inside))


def noise_passed(samples: float, rate_hz: float, band_hz: tuple[float, float] | None = None) -> float:
    """Variance of unit white noise after the spline has moved it by this many samples, of its part within the band."""
    reach, n = 64, 2**16
    impulse = np.zeros(2 * reach + 1)
    impulse[reach] = 1.0
    spline = scipy.interpolate.make_interp_spline(np.arange(2 * reach + 1), impulse, k=DEGREE)
    f = np.fft.rfftfreq(n, 1 / rate_hz)
    low, high = band_hz or (0.0, math.inf)
    passed = np.abs(np.fft.rfft(spline(np.arange(2 * reach) + samples % 1.0), n)) ** 2
    return float(np.mean(passed[(f >= low) & (f <= high)]))


# What noise does ------------------------------------------------------------------------------------------------------


def cramer_rao(case: Case, amplitude: float, delay_s: float, noise_std: float) -> Errors:
    """Least standard deviations of an unbiased estimate in white noise, the other unknown (Kay 1993, section 3.9).

    sd(tau) >= sigma / (K sqrt(sum I'^2 - (sum I I')^2 / sum I^2)), sd(K) likewise; sums over the raw, unwindowed
    samples. `detrend` counts an offset or a line as unknown too; `whitening` takes coloured noise of this innovation.
    """
    plain = Case(
        case.target,
        case.measured,
        case.start,
        case.stop,
        "boxcar",
        case.detrend,
        None,
        case.whitening,
        case.max_delay_s,
    )
    I, slope = plain.design(delay_s).T
    II, IS, SS = I @ I, I @ slope, slope @ slope
    return Errors(
        noise_std / math.sqrt(II - IS**2 / SS),
        noise_std / (amplitude * math.sqrt(SS - IS**2 / II)),
    )


def least_squares_errors(case: Case, amplitude: float, delay_s: float, autocovariance: Floats) -> Errors:
    """Standard deviations of `least_squares` in stationary noise of known autocovariance (lags 0, 1, ...).

    The sandwich (A^T A)^-1 A^T W D C D W A (A^T A)^-1 with the prepared design A, window W, detrending D and
    the noise's covariance matrix C; sd(tau) = sd(K delta) / K. Without a band and without whitening.
    """
    A = case.design(delay_s)
    rows = np.linalg.pinv(A) * window_shape(case.window, len(A))
    rows = np.array([without_trend(row, case.detrend) for row in rows])
    gain, slope = np.sqrt(np.diag(_covariance(rows, autocovariance)))
    return Errors(float(gain), float(slope / amplitude))


def aligned_errors(
    case: Case, amplitude: float, delay_s: float, autocovariance: Floats, weight_power: float = 2
) -> Errors:
    """Standard deviations of `aligned`, likewise: where Im sum O_k conj(J_k) |J_k|^(l-2) vanishes.

    With S = sum J conj(dJ/dtau) |J|^(l-2) and N = sum e_k conj(J_k) |J_k|^(l-2):
    error of tau = -Im N / (K Im S),  error of A = (Re N - K Re S error of tau) / sum |J|^l.
    """
    first, last = case.support
    rate_hz = case.target.rate_hz
    I, slope = case.target.shifted(first, last, delay_s)
    f, J = bins(_windowed(case, I), rate_hz, case.band_hz)
    _, dJ = bins(_windowed(case, -slope), rate_hz, case.band_hz)
    G = J * np.abs(J) ** (weight_power - 2.0)
    S = complex(np.sum(np.conj(dJ) * G))
    # e_k is a sum over samples: what each sample adds to N is a transform of conj(G) with its bins put back in place.
    n = 2 ** math.ceil(math.log2(len(I)))
    placed = np.zeros(n, dtype=np.complex128)
    placed[np.round(f * n / rate_hz).astype(int)] = np.conj(G)
    each = np.fft.fft(placed)[: len(I)] * window_shape(case.window, len(I))
    re, im = without_trend(each.real, case.detrend), without_trend(each.imag, case.detrend)
    delay = -im / (amplitude * S.imag)
    gain = (re - amplitude * S.real * delay) / np.sum(np.abs(J) ** weight_power)
    gain_std, delay_std = np.sqrt(np.diag(_covariance(np.array([gain, delay]), autocovariance)))
    return Errors(float(gain_std), float(delay_std))


def autoregressive_covariance(coefficient: float, std: float, n: int) -> Floats:
    """Autocovariance of e_n = coefficient e_{n-1} + white, of this standard deviation, at lags 0 .. n-1."""
    return std**2 * np.asarray(coefficient ** np.arange(n), dtype=np.float64)


def autoregression(residual: Floats, order: int) -> Floats:
    """(1, a_1 .. a_order) with e_n + a_1 e_{n-1} + ... white: least squares of each sample on those before it."""
    n = len(residual)
    before = np.column_stack([residual[order - j : n - j] for j in range(1, order + 1)])
    a, *_ = np.linalg.lstsq(before, -residual[order:], rcond=None)
    return np.concatenate([[1.0], a])


def _windowed(case: Case, samples: Floats) -> Floats:
    return without_trend(samples, case.detrend) * window_shape(case.window, len(samples))


def _covariance(rows: Floats, autocovariance: Floats) -> Floats:
    """R C R^T with C the Toeplitz matrix of the autocovariance, padded with zeros where it is shorter."""
    column = np.zeros(rows.shape[1])
    kept = min(len(column), len(autocovariance))
    column[:kept] = autocovariance[:kept]
    return np.asarray(rows @ scipy.linalg.matmul_toeplitz(column, rows.T))
