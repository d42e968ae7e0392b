"""The evaluation written a second time, as plainly as NumPy and SciPy allow: whole transforms, boolean masks, loops.

It follows the definitions (Guo, Xu and Chen 2014, Eqs 1-12, as settled in the method) and shares no code with the
package, so that where the two agree the formula has been computed twice. Speed is no concern here.

Signs: delay_s > 0 means measured lags target. I is the target, O the measured displacement, as in the paper.
"""

from __future__ import annotations

import math
from typing import Any, TypedDict

import numpy as np
import scipy.integrate
import scipy.signal
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class Reading(TypedDict):
    """One evaluation, with the words of the package's result."""

    amplitude: float
    phase_rad: float
    delay_s: float
    equivalent_frequency_hz: float
    fei: complex
    n_bins: int
    delta_f_hz: float


class Moving(TypedDict):
    """Readings of moving windows, arrays (n_readings,)."""

    time_s: Floats
    amplitude: Floats
    phase_rad: Floats
    delay_s: Floats
    equivalent_frequency_hz: Floats
    valid: NDArray[np.bool_]


class Uncertainty(TypedDict):
    """What noise on measured does to an aligned Welch estimate, arrays (n_bins,)."""

    response: Complexes
    gain_std: Floats
    delay_std_s: Floats
    degrees: Floats


class Response(TypedDict):
    """Welch's estimate over frequency, arrays (n_bins,)."""

    frequency_hz: Floats
    response: Complexes
    coherence: Floats
    target_psd: Floats
    measured_psd: Floats


def window_shape(name: str, length: int) -> Floats:
    """Symmetric window of `length` samples; tukey tapers half of them."""
    if name == "tukey":
        return np.asarray(scipy.signal.windows.tukey(length, alpha=0.5, sym=True))
    return np.asarray(getattr(scipy.signal.windows, name)(length, sym=True))


def detrended(samples: Floats, detrend: str) -> Floats:
    """The samples less their mean, or less their least-squares line."""
    if detrend == "none":
        return samples
    return np.asarray(scipy.signal.detrend(samples, type={"mean": "constant", "linear": "linear"}[detrend]))


def spectra(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    data_decimation: int = 1,
    frequency_decimation: int = 1,
    decimator: str = "spectral",
    window: str = "boxcar",
    detrend: str = "none",
    band_hz: tuple[float, float] | None = None,
) -> tuple[Floats, Complexes, Complexes]:
    """Frequencies and both DFTs at the bins kept: DC out, Nyquist in, a band with both its ends (Eqs 1, 8, 9).

    Order of work: chebyshev decimation, detrend, window, zeros up to the next power of two.
    """
    I = np.asarray(target, dtype=np.float64)
    O = np.asarray(measured, dtype=np.float64)
    P, Q, rate = data_decimation, frequency_decimation, float(rate_hz)
    if decimator == "chebyshev" and P > 1:
        I = scipy.signal.decimate(I, P, ftype="iir", zero_phase=True)
        O = scipy.signal.decimate(O, P, ftype="iir", zero_phase=True)
        rate = rate / P
    shape = window_shape(window, len(I))
    n = 2 ** math.ceil(math.log2(len(I)))
    p = n // 2
    I_k = np.fft.fft(detrended(I, detrend) * shape, n)[1 : p + 1]
    O_k = np.fft.fft(detrended(O, detrend) * shape, n)[1 : p + 1]
    k = np.arange(1, p + 1)
    f_k = k * rate / n
    kept = k % Q == 0
    if decimator == "spectral":
        kept &= k <= p // P
    if band_hz is not None:
        kept &= (f_k >= band_hz[0]) & (f_k <= band_hz[1])
    return f_k[kept], I_k[kept], O_k[kept]


def evaluate(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    data_decimation: int = 1,
    frequency_decimation: int = 1,
    decimator: str = "spectral",
    weight_power: int = 2,
    window: str = "boxcar",
    detrend: str = "none",
    band_hz: tuple[float, float] | None = None,
) -> Reading:
    """Amplitude, phase, equivalent frequency and delay of one pair (Eqs 7 and 10-12).

    A bin where the target is exactly zero has no weight and is left out of the sum, whatever `weight_power`.
    """
    f_k, I_k, O_k = spectra(
        target,
        measured,
        rate_hz,
        data_decimation,
        frequency_decimation,
        decimator,
        window,
        detrend,
        band_hz,
    )
    some = I_k != 0
    size = np.abs(I_k[some])
    total = np.sum(size**weight_power)
    fei = complex(np.sum(O_k[some] * np.conj(I_k[some]) * size ** (weight_power - 2.0)) / total)
    f_eq = float(np.sum(f_k[some] * size**weight_power) / total)
    phase = math.atan2(fei.imag, fei.real)
    length = len(np.asarray(target))
    return Reading(
        amplitude=abs(fei),
        phase_rad=phase,
        delay_s=-phase / (2 * math.pi * f_eq),
        equivalent_frequency_hz=f_eq,
        fei=fei,
        n_bins=len(f_k),
        delta_f_hz=frequency_decimation * rate_hz / 2 ** math.ceil(math.log2(length)),
    )


def parseval_real_fei(target: ArrayLike, measured: ArrayLike) -> float:
    """Re FEI for l = 2, P = Q = 1, no window and no band, from sums over time: no transform at all.

    Parseval's theorem over the n bins of the zero-padded DFT, less the DC bin; Nyquist is its own mirror image.
    """
    I = np.asarray(target, dtype=np.float64)
    O = np.asarray(measured, dtype=np.float64)
    n = 2 ** math.ceil(math.log2(len(I)))
    alternating = (-1.0) ** np.arange(len(I))
    I_N, O_N = math.fsum(alternating * I), math.fsum(alternating * O)
    I_0, O_0 = math.fsum(I), math.fsum(O)
    numerator = math.fsum(O * I) - O_0 * I_0 / n + O_N * I_N / n
    denominator = math.fsum(I * I) - I_0**2 / n + I_N**2 / n
    return float(numerator / denominator)


def evaluate_moving(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    window_s: float,
    hop_s: float,
    minimum_std_ratio: float = 0.05,
    **settings: Any,
) -> Moving:
    """`evaluate` of each slice of W samples from 0, H, 2H, ... on; NaN where the target is too small to judge by."""
    I = np.asarray(target, dtype=np.float64)
    O = np.asarray(measured, dtype=np.float64)
    W, H = round(window_s * rate_hz), round(hop_s * rate_hz)
    starts = np.arange(0, len(I) - W + 1, H)
    valid = np.array([np.std(I[s : s + W]) >= minimum_std_ratio * np.std(I) for s in starts])
    numbers = np.full((len(starts), 4), math.nan)
    for row in np.flatnonzero(valid):
        cut = slice(starts[row], starts[row] + W)
        r = evaluate(I[cut], O[cut], rate_hz, **settings)
        numbers[row] = r["amplitude"], r["phase_rad"], r["delay_s"], r["equivalent_frequency_hz"]
    return Moving(
        time_s=np.asarray((starts + (W - 1) / 2) / rate_hz, dtype=np.float64),
        amplitude=numbers[:, 0],
        phase_rad=numbers[:, 1],
        delay_s=numbers[:, 2],
        equivalent_frequency_hz=numbers[:, 3],
        valid=valid,
    )


def frequency_response(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    segment: int,
    overlap: int,
    window: str = "hann",
    detrend: str = "mean",
) -> Response:
    """H1 = S_IO / S_II with its coherence, by Welch's method over segments of `segment` samples, `overlap` shared.

    Symmetric windows and zeros up to the next power of two, as in the evaluation; the bin at zero is left out.
    """
    I = np.asarray(target, dtype=np.float64)
    O = np.asarray(measured, dtype=np.float64)
    removed: dict[str, str | bool] = {"none": False, "mean": "constant", "linear": "linear"}
    kw: dict[str, Any] = {
        "fs": rate_hz,
        "window": window_shape(window, segment),
        "noverlap": overlap,
        "nfft": 2 ** math.ceil(math.log2(segment)),
        "detrend": removed[detrend],
    }
    f, S_IO = scipy.signal.csd(I, O, **kw)
    S_II = scipy.signal.welch(I, **kw)[1]
    S_OO = scipy.signal.welch(O, **kw)[1]
    coherence = scipy.signal.coherence(I, O, **kw)[1]
    return Response(
        frequency_hz=f[1:],
        response=S_IO[1:] / S_II[1:],
        coherence=coherence[1:],
        target_psd=S_II[1:],
        measured_psd=S_OO[1:],
    )


def shifted_window(name: str, length: int, shift: float) -> Floats:
    """A sum of cosines at i + shift instead of i, zero outside its ends."""
    a = {"hann": [0.5, 0.5], "hamming": [0.54, 0.46], "blackman": [0.42, 0.5, 0.08]}[name]
    x = np.arange(length) + shift
    w = sum((-1) ** m * a_m * np.cos(2 * math.pi * m * x / (length - 1)) for m, a_m in enumerate(a))
    return np.asarray(np.where((x >= 0) & (x <= length - 1), w, 0.0))


def response_uncertainty(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    segment: int,
    overlap: int,
    window: str = "hann",
    align_s: float = 0.0,
) -> Uncertainty:
    """H1 of aligned segments less their mean, with its standard errors, by matrices over the segments at every bin.

    Measured's segments start round(align_s rate) samples after target's, the window over target is read earlier by the
    rest. With noise N of covariance S R over the segments, R_ab = sum_t w(t - t_a) w(t - t_b) exp(i w (t_a - t_b)) over
    sum w^2: H - H_true = u^H N / |I|, E = (1 - u u^H) N.
    """
    I = np.asarray(target, dtype=np.float64)
    O = np.asarray(measured, dtype=np.float64)
    lag = round(align_s * rate_hz)
    w_O = window_shape(window, segment)
    w_I = shifted_window(window, segment, align_s * rate_hz - lag)
    starts = np.arange(0, len(I) - abs(lag) - segment + 1, segment - overlap)
    n = 2 ** math.ceil(math.log2(segment))

    def transforms(x: Floats, w: Floats, first: int) -> Complexes:
        cut = [x[first + s : first + s + segment] for s in starts]
        return np.array([np.fft.fft(w * (c - c.mean()), n)[1 : n // 2 + 1] for c in cut])

    I_s, O_s = transforms(I, w_I, max(-lag, 0)), transforms(O, w_O, max(lag, 0))
    shared = np.zeros((len(starts), len(starts)))
    for a, t_a in enumerate(starts):
        for b, t_b in enumerate(starts):
            gap = abs(t_a - t_b)
            if gap < segment:
                shared[a, b] = np.sum(w_O[gap:] * w_O[: segment - gap]) / np.sum(w_O**2)
    found = Uncertainty(
        response=np.zeros(n // 2, complex),
        gain_std=np.zeros(n // 2),
        delay_std_s=np.zeros(n // 2),
        degrees=np.zeros(n // 2),
    )
    for k in range(1, n // 2 + 1):
        omega = 2 * math.pi * k / n
        R = shared * np.exp(1j * omega * (starts[:, None] - starts[None, :]))
        i, o = I_s[:, k - 1], O_s[:, k - 1]
        norm = np.linalg.norm(i)
        u = i / norm
        H = np.vdot(i, o) / norm**2
        P = np.eye(len(starts)) - np.outer(u, np.conj(u))
        PR = P @ R
        E = o - H * i
        S = np.vdot(E, E).real / np.trace(PR).real
        std = math.sqrt(S * np.vdot(u, R @ u).real / norm**2 / 2)
        found["response"][k - 1] = H * np.exp(-1j * omega * lag)
        found["gain_std"][k - 1] = std
        found["delay_std_s"][k - 1] = std / abs(H) / (omega * rate_hz)
        found["degrees"][k - 1] = 2 * np.trace(PR).real ** 2 / np.trace(PR @ PR).real
    return found


def correlation_lag(target: ArrayLike, measured: ArrayLike, rate_hz: float, max_lag_s: float = 0.5) -> float:
    """J1 of the benchmark problem: the whole-sample lag, in s, where Pearson's correlation is highest.

    Both signs are searched, |lag| <= max_lag_s; the benchmark itself looked at 0 to 49 samples of lag.
    """
    I = np.asarray(target, dtype=np.float64)
    O = np.asarray(measured, dtype=np.float64)
    N, K = len(I), round(max_lag_s * rate_hz)
    best, best_lag = -math.inf, 0
    for k in range(-K, K + 1):
        i, o = (I[: N - k], O[k:]) if k >= 0 else (I[-k:], O[: N + k])
        if np.ptp(i) == 0 or np.ptp(o) == 0:
            continue  # a constant correlates with nothing
        correlation = float(np.corrcoef(i, o)[0, 1])
        if correlation > best:
            best, best_lag = correlation, k
    return best_lag / rate_hz


def index_histories(target: ArrayLike, measured: ArrayLike, force: ArrayLike | None = None) -> dict[str, Floats]:
    """The indices that are histories, at every sample: largest error so far, RMS so far, indicator, energy error.

    The indicator is (A - TA)/2 with A the area under target over measured, TA under measured over target; it rises on
    lag. The energy error is the work of the force over measured less its work over target.
    """
    I = np.asarray(target, dtype=np.float64)
    O = np.asarray(measured, dtype=np.float64)
    error = O - I
    histories = {
        "max_tracking_error": np.maximum.accumulate(np.abs(error)),
        "rms_error": np.sqrt(np.cumsum(error**2) / np.arange(1, len(I) + 1)),
    }
    A = np.zeros(len(I))
    TA = np.zeros(len(I))
    for i in range(len(I) - 1):
        A[i + 1] = A[i] + (I[i + 1] + I[i]) * (O[i + 1] - O[i]) / 2
        TA[i + 1] = TA[i] + (O[i + 1] + O[i]) * (I[i + 1] - I[i]) / 2
    histories["tracking_indicator"] = (A - TA) / 2
    if force is not None:
        F = np.asarray(force, dtype=np.float64)
        work_measured = scipy.integrate.cumulative_trapezoid(F, O, initial=0)
        work_target = scipy.integrate.cumulative_trapezoid(F, I, initial=0)
        histories["energy_error"] = np.asarray(work_measured - work_target)
    return histories


def indices(
    target: ArrayLike, measured: ArrayLike, rate_hz: float, force: ArrayLike | None = None, max_lag_s: float = 0.5
) -> dict[str, float]:
    """The time-domain indices over the whole record; percentages are of max|I|, rms I, std I and max|I| in turn."""
    I = np.asarray(target, dtype=np.float64)
    O = np.asarray(measured, dtype=np.float64)
    error = O - I
    histories = index_histories(I, O, force)
    over_all = {
        "max_tracking_error": float(np.max(np.abs(error))),
        "max_tracking_error_percent": float(100 * np.max(np.abs(error)) / np.max(np.abs(I))),
        "rms_error": float(np.sqrt(np.mean(error**2))),
        "rms_error_percent": float(100 * np.sqrt(np.mean(error**2)) / np.sqrt(np.mean(I**2))),
        "tracking_indicator": float(histories["tracking_indicator"][-1]),
        "j1_s": correlation_lag(I, O, rate_hz, max_lag_s),
        "j2_percent": float(100 * np.std(error) / np.std(I)),
        "j3_percent": float(100 * np.max(np.abs(error)) / np.max(np.abs(I))),
    }
    if force is not None:
        over_all["energy_error"] = float(histories["energy_error"][-1])
    return over_all
