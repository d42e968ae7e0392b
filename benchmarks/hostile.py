"""Motions and noise that are hard on an estimate of gain and delay, written from their definitions.

Every pair is exact: measured(t) = K target(t - d) at any d, because each motion is known between its samples, as a
formula in time or as a sum of sines. What noise there is, is added by whoever uses them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np
import scipy.signal
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, make_interp_spline

import rthstrack
from rthstrack.reproduction.cases import linear, nonlinear
from rthstrack.virtual_test import VirtualTest

Floats = NDArray[np.float64]


class Motion(Protocol):
    """A motion that is known at any time. `high_hz`: above it there is no energy worth the name."""

    @property
    def name(self) -> str: ...

    @property
    def high_hz(self) -> float: ...

    def samples(self, rate_hz: float, late_s: float = 0.0) -> Floats:
        """x(n / rate - late) for every sample of the record."""
        ...


# Tones ----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Timed:
    """A motion given as a function of time; it is heard over `seconds`."""

    name: str
    at: Callable[[Floats], Floats]
    seconds: float
    high_hz: float

    def samples(self, rate_hz: float, late_s: float = 0.0) -> Floats:
        return self.at(np.arange(round(self.seconds * rate_hz)) / rate_hz - late_s)


def ramped(f: float, seconds: float = 20.0, ramp_s: float = 2.0) -> Timed:
    """A sine that rises from nothing over `ramp_s`, and falls likewise at the end; nothing outside."""

    def at(t: Floats) -> Floats:
        return np.clip(np.minimum(t, seconds - t) / ramp_s, 0, 1) * np.sin(2 * np.pi * f * t)

    return Timed(f"ramped {f:g} Hz", at, seconds, f)


def modulated(f: float, seconds: float = 20.0, depth: float = 0.5, beat_hz: float = 0.3) -> Timed:
    """(1 + depth sin(2 pi beat t)) sin(2 pi f t), from before the record to after it."""

    def at(t: Floats) -> Floats:
        return (1 + depth * np.sin(2 * np.pi * beat_hz * t)) * np.sin(2 * np.pi * f * t)

    return Timed(f"modulated {f:g} Hz", at, seconds, f)


def narrow(f: float, half_width_hz: float, seed: int, seconds: float = 20.0, count: int = 24) -> Timed:
    """`count` sines of equal size at random frequencies within f +- half width, with random phases."""
    rng = np.random.Generator(np.random.PCG64(seed))
    offsets, phases = rng.uniform(-half_width_hz, half_width_hz, count), rng.uniform(0, 2 * np.pi, count)

    def envelope(t: Floats) -> NDArray[np.complex128]:
        return np.asarray(np.exp(1j * (2 * np.pi * np.multiply.outer(t, offsets) + phases)).sum(axis=-1))

    # The envelope is slow: a spline through it, 64 points a second, is exact to 1e-9.
    grid = np.arange(-1.0, seconds + 1.0, 1 / 64)
    slow = CubicSpline(grid, envelope(grid))

    def at(t: Floats) -> Floats:
        return np.asarray((slow(t) * np.exp(2j * np.pi * f * t)).real)

    return Timed(f"{f:g} +- {half_width_hz:g} Hz", at, seconds, f + half_width_hz)


def stepped(
    low_hz: float = 5.0, high_hz: float = 30.0, steps: int = 11, dwell_s: float = 3.0, ramp_s: float = 0.5
) -> Timed:
    """A sine whose frequency rises in equal steps, its phase without a jump; ramps at both ends."""
    frequencies = np.linspace(low_hz, high_hz, steps)
    seconds = steps * dwell_s
    turns = np.concatenate([[0.0], np.cumsum(frequencies * dwell_s)])

    def at(t: Floats) -> Floats:
        step = np.clip(np.floor(t / dwell_s).astype(int), 0, steps - 1)
        phase = turns[step] + frequencies[step] * (t - step * dwell_s)
        return np.clip(np.minimum(t, seconds - t) / ramp_s, 0, 1) * np.sin(2 * np.pi * phase)

    return Timed(f"stepped {low_hz:g} to {high_hz:g} Hz", at, seconds, high_hz)


# Sums of sines --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Periodic:
    """sum of Re c_k exp(2 pi i k t / period), of which the record is `seconds` from `first_s` on.

    `spectrum`: c_k for k = 0, 1, ...; shifted by a phase, sampled at any rate that period times makes whole and even.
    """

    name: str
    spectrum: NDArray[np.complex128]
    period_s: float
    first_s: float
    seconds: float

    @property
    def high_hz(self) -> float:
        return (len(self.spectrum) - 1) / self.period_s

    def samples(self, rate_hz: float, late_s: float = 0.0, slope: bool = False) -> Floats:
        """x(n / rate - late), or its derivative."""
        n = round(self.period_s * rate_hz)
        f = np.arange(len(self.spectrum)) / self.period_s
        shifted = self.spectrum * np.exp(-2j * np.pi * f * (late_s - self.first_s))
        if slope:
            shifted = shifted * 2j * np.pi * f
        full = np.zeros(n // 2 + 1, dtype=complex)
        full[: len(shifted)] = n / 2 * shifted
        return np.fft.irfft(full, n)[: round(self.seconds * rate_hz)]


def from_samples(name: str, x: Floats, rate_hz: float, period_s: float, keep_hz: float) -> Periodic:
    """The motion of `x`, at rest at both ends, without what is above `keep_hz`: from there to 0.7 of it, it fades."""
    n = round(period_s * rate_hz)
    spectrum = 2 / n * np.fft.rfft(x, n)[: round(keep_hz * period_s) + 1]
    spectrum[0] = 0
    f = np.arange(len(spectrum)) / period_s
    fade = 0.5 + 0.5 * np.cos(np.pi * np.clip((f / keep_hz - 0.7) / 0.3, 0, 1))
    return Periodic(name, spectrum * fade, period_s, 0.0, len(x) / rate_hz)


@cache
def response(kind: str, seconds: float = 30.0) -> Periodic:
    """A structure's displacement in an earthquake: "5 Hz", linear, or "1 Hz", yielding. Its last 3 s fade to rest."""
    test = linear(delay_s=0.0) if kind == "5 Hz" else nonlinear(delay_s=0.0)
    ground = rthstrack.synthetic_ground_motion(seed=11, duration_s=seconds)
    run = rthstrack.simulate(VirtualTest(test.structure, test.actuators, rate_hz=1024.0), ground)
    x = np.asarray(run.target)[: round(seconds * 1024)]
    left = np.arange(len(x))[::-1] / (3 * 1024.0)
    x = x * (0.5 - 0.5 * np.cos(np.pi * np.clip(left, 0, 1)))
    return from_samples(f"{kind} structure", x, 1024.0, 40.0, 40.0)


@cache
def chirp(low_hz: float = 0.5, high_hz: float = 12.0, seconds: float = 30.0) -> Periodic:
    """A linear sweep with ramps of 1 s."""
    t = np.arange(round(seconds * 1024)) / 1024.0
    envelope = 0.5 - 0.5 * np.cos(np.pi * np.clip(np.minimum(t, seconds - t), 0, 1))
    x = envelope * np.sin(2 * np.pi * (low_hz * t + (high_hz - low_hz) * t**2 / (2 * seconds)))
    return from_samples(f"chirp {low_hz:g} to {high_hz:g} Hz", x, 1024.0, 40.0, 40.0)


@cache
def broad(low_hz: float = 0.1, high_hz: float = 10.0, seconds: float = 30.0, seed: int = 7) -> Periodic:
    """Gaussian noise from `low_hz` to `high_hz`, flat, a stretch of which is seen: a motion cut off at both ends."""
    period_s = 2 * seconds
    rng = np.random.Generator(np.random.PCG64(seed))
    k = np.arange(round(high_hz * period_s) + 1)
    spectrum = rng.standard_normal(len(k)) + 1j * rng.standard_normal(len(k))
    spectrum[k < low_hz * period_s] = 0
    return Periodic(f"broad band {low_hz:g} to {high_hz:g} Hz", spectrum, period_s, seconds / 2, seconds)


# Noise ----------------------------------------------------------------------------------------------------------------


def unit_noise(rng: np.random.Generator, shape: tuple[int, ...], coefficient: float = 0.0) -> Floats:
    """White, or e_n = coefficient e_{n-1} + white from its steady state on; standard deviation 1."""
    white = rng.standard_normal(shape)
    if not coefficient:
        return white
    innovation = np.sqrt(1 - coefficient**2)
    white[..., 0] /= innovation
    return np.asarray(scipy.signal.lfilter([innovation], [1.0, -coefficient], white))


def strength(kind: str, motion: Periodic, rate_hz: float, late_s: float) -> Floats:
    """How strong the noise is at each sample, with a mean square of 1.

    "stationary"; "velocity": as |dx/dt|; "envelope": as the modulus of the analytic signal; "burst": ten times stronger
    for 1 s about the motion's peak.
    """
    x = motion.samples(rate_hz, late_s)
    if kind == "stationary":
        found = np.ones(len(x))
    elif kind == "velocity":
        found = np.abs(motion.samples(rate_hz, late_s, slope=True))
    elif kind == "envelope":
        found = np.abs(scipy.signal.hilbert(x))
    elif kind == "burst":
        away_s = np.abs(np.arange(len(x)) - np.argmax(np.abs(x))) / rate_hz
        found = np.where(away_s <= 0.5, 10.0, 1.0)
    else:
        raise ValueError(kind)
    return np.asarray(found / np.sqrt(np.mean(found**2)))


def quantised(x: Floats, bits: int, full_scale: float) -> Floats:
    """Rounded to one of 2^bits steps from -full_scale to +full_scale."""
    step = 2 * full_scale / 2**bits
    return step * np.round(x / step)


# What could be known of the turn --------------------------------------------------------------------------------------


class Turns:
    """Which turn is the likeliest, and by how much its log-likelihood exceeds that of the next, the noise being known.

    O_n = K x(t_n - tau) + c + e_n, e first-order autoregressive of a known coefficient and deviation:
    log L(tau) = -min over K > 0 and c of sum w_n^2 / (2 s^2), w_n = r_n - a r_{n-1}, s^2 = std^2 (1 - a^2). Its maxima
    over |tau| <= reach are the turns. The reach is left out at both ends of the record: no one may count on more.
    """

    def __init__(self, motion: Motion, rate_hz: float, coefficient: float, reach_s: float = 0.25) -> None:
        self.rate_hz, self.coefficient, self.reach_s = rate_hz, coefficient, reach_s
        # Correlations have no more band than the motion: a spline of degree 7 through 12 points a period is exact.
        self.step = 1 / (12 * motion.high_hz)
        count = int(np.ceil(reach_s / self.step)) + 16  # the spline is less exact towards its ends
        self.taus = self.step * np.arange(-count, count + 1)
        self.rows = np.stack([self._whitened(motion.samples(rate_hz, tau)) for tau in self.taus])

    def _whitened(self, x: Floats) -> Floats:
        return np.asarray(x[1:] - self.coefficient * x[:-1])

    def best(self, measured: Floats, std: float, first: int, last: int) -> tuple[float, float]:
        """tau of the best turn, and its log-likelihood over that of the second, infinite without one.

        From samples `first` to `last` of the record.
        """
        reach = int(np.ceil(self.reach_s * self.rate_hz))
        # A short window is not searched further than to a quarter of its length.
        reach_s = min(self.reach_s, (last - first) / self.rate_hz / 4)
        first, last = max(first, reach), min(last, len(measured) - reach) - 1
        observed = self._whitened(measured)[first:last]
        observed = observed - observed.mean()
        rows = self.rows[:, first:last]
        energies = np.einsum("ij,ij->i", rows, rows) - rows.sum(axis=1) ** 2 / rows.shape[1]
        between = make_interp_spline(self.taus, np.stack([rows @ observed, energies], axis=1), k=7)

        def fitted(tau: Floats) -> Floats:
            """By how much the motion at tau lowers the sum of squares."""
            product, energy = np.moveaxis(between(tau), -1, 0)
            return np.asarray(np.where(product > 0, product**2 / energy, 0.0))

        on_grid = fitted(self.taus)
        inner = np.flatnonzero((on_grid[1:-1] >= on_grid[:-2]) & (on_grid[1:-1] > on_grid[2:])) + 1
        tau, step = self.taus[inner], self.step
        for _ in range(3):
            left, middle, right = (fitted(tau + j * step) for j in (-1, 0, 1))
            bend = np.minimum(left - 2 * middle + right, -np.finfo(float).tiny)
            tau, step = tau + step * np.clip(0.5 * (left - right) / bend, -1, 1), step / 12
        tau = tau[np.abs(tau) <= reach_s]
        peaks = fitted(tau)
        order = np.argsort(peaks)
        if len(peaks) < 2:
            return (float(tau[0]) if len(tau) else np.nan), np.inf
        margin = (peaks[order[-1]] - peaks[order[-2]]) / (2 * std**2 * (1 - self.coefficient**2))
        return float(tau[order[-1]]), float(margin)
