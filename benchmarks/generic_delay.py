"""Delay estimators that an engineer would take from a textbook instead, each in the form it is usually given.

They know no gain and no window's surroundings: target and measured are two finite pieces of signal. Welch's method,
where it is used, takes segments of an eighth of the piece (a power of two), Hann windows that overlap by half, means
removed.
delay > 0: measured lags target. Results in seconds.

Knapp and Carter (1976) IEEE Trans. ASSP 24, 320; Piersol (1981) IEEE Trans. ASSP 29, 471.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np
import scipy.fft
import scipy.signal
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Weighting = Literal["plain", "phat", "ml"]

#: Correlations are computed this many times finer than the samples before their peak is sought.
FINER = 16
#: Bins where the target has less than this share of its largest density hold leakage, not motion: they are left out
#: wherever a weighting would otherwise lift them to the others' height.
LEAST_DENSITY = 0.01
#: Coherence is taken as at most this: weights g / (1 - g) have no limit where there is no noise.
MOST_COHERENT = 1 - 1e-9


def full_correlation(target: Floats, measured: Floats, rate_hz: float, max_delay_s: float = 0.25) -> float:
    """Peak of sum O_n I_{n-k} over whole-sample lags, means removed, with a parabola through its three highest."""
    lag, values = _lags(_correlation(target, measured), round(max_delay_s * rate_hz))
    return _peak(lag, values) / rate_hz


def generalised_correlation(
    target: Floats, measured: Floats, rate_hz: float, max_delay_s: float = 0.25, *, weighting: Weighting = "plain"
) -> float:
    """Peak of the transform of weighted Welch cross-spectrum, 16 times finer than the samples, with a parabola.

    Weights: plain 1; PHAT 1 / |S|; ML (Hannan and Thomson) g / (|S| (1 - g)) with the squared coherence g.
    """
    S, density, coherence, n = _welch(target, measured)
    if weighting != "plain":
        size = np.maximum(np.abs(S), np.finfo(float).tiny)
        S = np.where(_moving(density), S / size, 0.0)
        S = S if weighting == "phat" else S * coherence / (1 - coherence)
    # The segments say nothing of lags beyond half of them.
    reach = min(round(max_delay_s * rate_hz), n // 2 - 1) * FINER
    lag, values = _lags(scipy.fft.irfft(S, n * FINER), reach)
    return _peak(lag, values) / (FINER * rate_hz)


def phase_slope(target: Floats, measured: Floats, rate_hz: float, max_delay_s: float = 0.25) -> float:
    """Line through the origin of the unwrapped phase of Welch's cross-spectrum, weighted by g / (1 - g) (Piersol).

    phi = -2 pi f d, unwrapped from bin to bin. max_delay_s is not needed: it is there for a common call.
    """
    S, density, coherence, n = _welch(target, measured)
    f = np.arange(len(S)) * rate_hz / n
    kept = _moving(density)[1:]
    f, S, g = f[1:][kept], S[1:][kept], coherence[1:][kept]
    weights = g / (1 - g)
    phase = np.unwrap(np.angle(S))
    return float(-np.sum(weights * f * phase) / (2 * np.pi * np.sum(weights * f**2)))


#: By the names of the tables.
ESTIMATORS: dict[str, Callable[..., float]] = {
    "full correlation, parabola": full_correlation,
    "generalised correlation": generalised_correlation,
    "generalised correlation, PHAT": lambda *pair, **kw: generalised_correlation(*pair, weighting="phat", **kw),
    "generalised correlation, ML": lambda *pair, **kw: generalised_correlation(*pair, weighting="ml", **kw),
    "cross-spectrum phase slope": phase_slope,
}


class _Welch(NamedTuple):
    cross: Complexes
    target_density: Floats
    coherence: Floats
    segment: int


def _welch(target: Floats, measured: Floats) -> _Welch:
    """Mean of conj(I_k) O_k over segments, that of |I_k|^2, the squared coherence, and the length of a segment."""
    n = 2 ** int(np.log2(len(target) / 8))
    shape = scipy.signal.get_window("hann", n)
    I, O = (_segments(x, n, shape) for x in (target, measured))
    cross = np.mean(np.conj(I) * O, axis=0)
    II, OO = np.mean(np.abs(I) ** 2, axis=0), np.mean(np.abs(O) ** 2, axis=0)
    coherence = np.abs(cross) ** 2 / np.maximum(II * OO, np.finfo(float).tiny)
    return _Welch(cross, II, np.minimum(coherence, MOST_COHERENT), n)


def _moving(density: Floats) -> NDArray[np.bool_]:
    return np.asarray(density >= LEAST_DENSITY * np.max(density))


def _segments(samples: Floats, n: int, shape: Floats) -> Complexes:
    pieces = np.lib.stride_tricks.sliding_window_view(samples, n)[:: n // 2]
    spectra: Any = scipy.fft.rfft((pieces - pieces.mean(axis=1, keepdims=True)) * shape, axis=1)
    return np.asarray(spectra)


def _correlation(target: Floats, measured: Floats) -> Floats:
    n = scipy.fft.next_fast_len(2 * len(target), real=True)
    I, O = (scipy.fft.rfft(x - np.mean(x), n) for x in (target, measured))
    return np.asarray(scipy.fft.irfft(np.conj(I) * O, n))


def _lags(circular: Floats, reach: int) -> tuple[NDArray[np.int64], Floats]:
    lag = np.arange(-reach, reach + 1)
    return lag, circular[lag]


def _peak(lag: NDArray[np.int64], values: Floats) -> float:
    """Where the parabola through the highest value and its neighbours peaks; the end itself at an end."""
    k = int(np.argmax(values))
    if not 0 < k < len(values) - 1:
        return float(lag[k])
    before, top, after = values[k - 1 : k + 2]
    bend = before - 2 * top + after
    return float(lag[k] + (0.5 * (before - after) / bend if bend else 0.0))
