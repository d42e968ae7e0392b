"""Gain and delay over time and frequency: Welch's method on windows, longer where frequencies are lower."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from rthstrack.errors import SettingError, SignalError
from rthstrack.evaluation.response import frequency_response

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats: TypeAlias = NDArray[np.float64]

# A segment holds so many periods of an octave's lowest frequency, a window so many segments; so many readings a window.
_PERIODS, _SEGMENTS, _READINGS = 4.0, 4.0, 8.0
# Longer windows than this share of the record tell nothing over time; more readings than this nobody sees.
_LONGEST, _MOST_READINGS = 0.4, 150
# Samples a second by the highest frequency.
_OVERSAMPLING = 16.0
# Changes below these shares of gain and delay are no finding, nor are those of fewer readings.
_LEAST = {"gain": 0.03, "delay_s": 0.07}
_FEWEST = 4
# A band changes where more than this share of its readings lies beyond so many half intervals from their median.
_PART, _SURE = 0.1, 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Gain, delay and coherence of half an octave over time, (n_windows,): means over its bins by target's energy.

    time_s: the windows' centres, from the first sample; `half_width_*`: of 95 % intervals, NaN where there are none.
    """

    low_hz: float
    high_hz: float
    window_s: float
    hop_s: float
    time_s: Floats
    gain: Floats
    delay_s: Floats
    coherence: Floats
    half_width_gain: Floats
    half_width_delay_s: Floats


@dataclass(frozen=True, slots=True, eq=False)
class TimeFrequency:
    """Bands from low to high; readings with a coherence below `least_coherence` are not to be relied on."""

    bands: tuple[Band, ...]
    least_coherence: float

    def known(self, name: str) -> list[Floats]:
        """The readings "gain" or "delay_s" of each band, NaN where the coherence is low."""
        return [np.where(b.coherence >= self.least_coherence, getattr(b, name), np.nan) for b in self.bands]

    @property
    def changes_with_both(self) -> tuple[str, ...]:
        """Which of "gain" and "delay_s" change over time within a band, and from band to band, by more than noise."""
        return tuple(name for name in _LEAST if self._changes(name))

    def _changes(self, name: str) -> bool:
        found = []
        for band, values in zip(self.bands, self.known(name), strict=True):
            there = np.isfinite(values)
            if np.count_nonzero(there) >= _FEWEST:
                found.append((values[there], getattr(band, f"half_width_{name}")[there]))
        if len(found) < 2:
            return False
        means = [float(values.mean()) for values, _ in found]
        least = _LEAST[name] * abs(float(np.mean(means)))
        # No interval is no finding.
        away = [
            np.abs(values - np.median(values)) > np.fmax(least, np.where(np.isnan(half), np.inf, _SURE * half))
            for values, half in found
        ]
        over_time = any(np.mean(one) > _PART for one in away)
        widest = max(float(np.nan_to_num(half).mean()) for _, half in found)
        return over_time and max(means) - min(means) > max(least, widest)


def time_frequency(
    target: Floats,
    measured: Floats,
    rate_hz: float,
    band_hz: tuple[float, float],
    *,
    align_s: float = 0.0,
    dispersion: bool = False,
    least_coherence: float = 0.8,
) -> TimeFrequency | None:
    """Gain and delay of each half octave of `band_hz` over time; None where the record is too short for two octaves.

    target, measured: (n_samples,). align_s, dispersion: of `frequency_response`. delay_s > 0: measured lags.
    """
    low, high = band_hz[0], min(band_hz[1], rate_hz / 4)
    low = max(low, _SEGMENTS * _PERIODS / (_LONGEST * target.size / rate_hz))
    n_bands = math.floor(math.log2(high / low) + 0.3) if high > low else 0
    if n_bands < 2:
        return None
    # All that is looked at lies below `high`: at a lower rate it costs little.
    n = min(target.size, math.ceil(target.size * _OVERSAMPLING * high / rate_hz))
    target, measured, rate_hz = _slower(target, n), _slower(measured, n), rate_hz * n / target.size
    edges = [high * 2.0**-k for k in range(n_bands, -1, -1)]
    bands = [
        band
        for one, next_one in pairwise(edges)
        for band in _octave(target, measured, rate_hz, one, next_one, align_s, dispersion)
    ]
    return TimeFrequency(tuple(bands), least_coherence) if len(bands) > 1 else None


def _slower(signal: Floats, n: int) -> Floats:
    """The same motion by n samples, below half their rate; mirrored at its ends, so that there is no step."""
    if n >= signal.size:
        return signal
    spectrum = np.fft.rfft(np.concatenate((signal, signal[::-1])))[: n + 1]
    spectrum[n] = 0
    slower: Floats = np.fft.irfft(spectrum, 2 * n)[:n] * (n / signal.size)
    return slower


def _octave(
    target: Floats, measured: Floats, rate_hz: float, low: float, high: float, align_s: float, dispersion: bool
) -> list[Band]:
    """The two half octaves that one window and segment serve."""
    segment_s = _PERIODS / low
    window = min(round(_SEGMENTS * segment_s * rate_hz), target.size)
    hop = max(window / _READINGS, (target.size - window) / _MOST_READINGS)
    starts = np.arange(0, target.size - window + 1, hop).astype(np.intp)
    frequency: Floats = np.empty(0)
    rows: list[Floats | None] = []
    for start in starts:
        part = slice(start, start + window)
        try:
            found = frequency_response(
                target[part], measured[part], rate_hz, segment_s=segment_s, align_s=align_s, dispersion=dispersion
            )
        except (SettingError, SignalError):
            rows.append(None)  # a window in which nothing moves
            continue
        frequency = found.frequency_hz
        half = (np.ptp(ends, axis=1) / 2 for ends in (found.gain_interval, found.delay_interval_s))
        rows.append(np.stack((found.target_psd, found.gain, found.delay_s, found.coherence, *half)))
    missing = np.full((6, frequency.size), np.nan)
    stacked = np.stack([missing if row is None else row for row in rows])
    centres = np.asarray((starts + (window - 1) / 2) / rate_hz, dtype=np.float64)
    middle = low * math.sqrt(2)
    bands = []
    for first, last in ((low, middle), (middle, high)):
        inside = (frequency >= first) & (frequency < last)
        # The same weights in all windows: where in the band the energy lies at a time is no change of gain or delay.
        weights = np.nansum(stacked[:, 0, inside], axis=0)
        if not float(weights.sum()) > 0:
            continue
        means: Floats = stacked[:, 1:, inside] @ (weights / weights.sum())
        bands.append(Band(first, last, window / rate_hz, hop / rate_hz, centres, *means.T))
    return bands
