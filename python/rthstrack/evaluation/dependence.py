"""What gain and delay depend on, where they are not one number each: frequency, amplitude, time, or two clocks.

Measured is fitted by the target, taken earlier by the trusted delay, with gain and delay that follow one cause at a
time; what each takes off the residual is its share of the variation. One currency for all causes, so that the larger of
two is named. Both signals are brought down to the motion's band first: that is some thousand samples, free of the
noise above, and makes this cost little.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from rthstrack.evaluation.chance import f_above, t_975
from rthstrack.evaluation.results import _Result
from rthstrack.values import median, quantile

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from rthstrack.evaluation.response import FrequencyResponse
    from rthstrack.evaluation.tracking import Tracking

    Floats: TypeAlias = NDArray[np.float64]

Kind: TypeAlias = Literal["frequency", "amplitude", "time", "clock"]
Interval: TypeAlias = tuple[float, float]
NO_INTERVAL = (math.nan, math.nan)

# The band holds this share of target's energy; the filter falls off over so much more; samples a second by its edge.
_ENERGY, _ROLL_OFF, _OVERSAMPLING = 0.995, 1.35, 4.0
_MOST_SAMPLES, _FEWEST_SAMPLES, _FEWEST_PERIODS = 16_384, 60, 15
# Near the ends the filter sees what lies outside the record: so many periods of the band's edge are left out.
_ENDS = 3.0
# On either side of a step lies so much of the energy.
_MOVED = 3e-4
# Changes below this are no finding: shares of delay and gain, and of the time between samples.
_LEAST_DELAY, _LEAST_GAIN, _LEAST_SAMPLE = 0.07, 0.03, 0.05
# Nor are changes in less than this share of the motion's energy.
_PART = 0.005
# Nor are those within so many half intervals of the difference; more where the place of the change was sought,
# less over amplitude, whose levels the other causes make scatter.
_SURE, _SURER = 1.2, {"step": 1.6, "amplitude": 0.8}
# Probability of a false finding by noise; the place of a step is sought, which gives noise so many chances.
_CHANCE, _PLACES = 1e-3, 30.0
# Noise is taken to be independent from block to block: so many periods each, and between so many blocks in all.
_BLOCK_PERIODS, _FEWEST_BLOCKS, _MOST_BLOCKS = 2.0, 12, 120
# Of a period: delays that change by less are found in one step.
_LINEAR = 3e-3
# Of white noise in the band so many samples are independent, as a share.
_INDEPENDENT = 0.55
# On a sweep frequency, amplitude and time run together. An actuator always depends on frequency: where that explains
# what another cause does, but for this share, it is named.
_TIE = 0.02
# A clock changes the delay evenly and nothing else: it leaves this share to other causes, and this change to gain.
_CLOCK_SHARE, _CLOCK_GAIN = 0.9, 0.01
# Nor does a course over time fit better, by so many times what noise makes of its numbers.
_UNEVEN = 6.0
# Local amplitude is taken as no less than this share of its root mean square.
_STILL = 0.03
# Octaves of amplitude are told where the delay is known to this share, and the motion is so many times its own noise.
_KNOWN, _CLEAR, _FEW = 0.2, 10.0, 20
# Amplitudes between which nine tenths of the energy lie.
_ENERGY_ENDS = (0.05, 0.95)
# A course over time has so many half waves at most, as many as blocks carry. It bends to anything, so that it must
# explain so much more than a drift and a step, and than the causes that change with the motion.
_HALF_WAVES, _BLOCKS_A_WAVE, _CLEARLY, _FAR = 8, 3, 0.1, 0.25
# It takes off this share of all that one gain and one delay leave, which noise does not; so few blocks prove little
# more. Where it takes off nearly all, they need not.
_BENDS, _LIKELY, _NEARLY_ALL = 0.4, 0.02, 0.8
# What does not matter gives way to the next cause, where that explains at least so much of what it does.
_NEXT = 0.5
# A line over frequency fits where the curve departs from it by no more than this share of delay or gain; by noise, by
# no more than the second.
_STRAIGHT, _ROUGH = 0.05, 0.12
# A bin no farther than this share of the frequency stands for it.
_NEAR = 0.5


@dataclass(frozen=True, slots=True, repr=False)
class Level(_Result):
    """Gain and delay over a part of the motion, with 95 % intervals (NaN where nothing supports one).

    `where`: from, to; Hz for "frequency", target's unit (amplitude of its oscillation) for "amplitude", seconds from
    the first sample for "time" and "clock".
    """

    where: Interval
    delay_s: float
    delay_interval_s: Interval
    gain: float
    gain_interval: Interval


@dataclass(frozen=True, slots=True, repr=False)
class Line(_Result):
    """Delay or gain as a straight line over `band_hz`, from which the curve departs by `misfit` at most, ends included.

    value (s or 1) at `at_hz`, slope a hertz.
    """

    at_hz: float
    value: float
    slope_per_hz: float
    slope_interval_per_hz: Interval
    band_hz: Interval
    misfit: float


@dataclass(frozen=True, slots=True, repr=False)
class Dependence(_Result):
    """What delay and gain depend on: `kind`, and the `share` of their variation that it explains, 0 to 1.

    shares: of every cause, "frequency", "amplitude", "time", "clock"; they overlap, so their sum may exceed 1.
    form: "line" (clock, drift over time, frequency), "step" (at `step_s`, from the first sample), "course" (over time,
    to and fro or unevenly), "levels" (amplitude).
    levels: two, by which the change is judged: low and high frequency, large and small motion, start and end, before
    and after a step, or the two times of a course at which the delay, or else the gain, is farthest apart.
    delay_change, gain_change: from the first to the second, as shares of delay and gain.
    delay_line, gain_line: over frequency, where a line fits anywhere. clock_ppm: by how much measured's clock is slow.
    """

    kind: Kind
    share: float
    shares: Mapping[str, float]
    form: Literal["line", "step", "course", "levels"]
    levels: tuple[Level, Level]
    delay_change: float
    gain_change: float
    delay_line: Line | None = None
    gain_line: Line | None = None
    step_s: float | None = None
    clock_ppm: float | None = None
    clock_ppm_interval: Interval | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """Both signals in the motion's band at a low rate, the target taken earlier by the trusted delay."""

    time_s: Floats
    target: Floats
    slope: Floats  # the target's first and second derivative
    bend: Floats
    measured: Floats
    amplitude: Floats  # of the target's oscillation, over about a period
    by_frequency: tuple[Floats, ...]  # target and slope times g, then g^2, g = (f - f_eq) / spread
    signs: tuple[Floats, ...]  # of target and slope, in the band: what a dead band and friction take away
    starts: NDArray[np.intp]  # of the blocks
    delay_s: float
    f_eq: float
    spread_hz: float
    noise: float  # standard deviation of the target's own, in the band
    middle_hz: Interval  # holds the middle nine tenths of the energy


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """measured = sum over the basis of (c_j target - e_j slope) phi_j: gain sum c phi, more delay sum e phi / gain."""

    coefficients: Floats
    covariance: Floats  # as the blocks' own residuals have it: noise of any colour, that comes and goes
    even: Floats  # as even noise would have it: where few blocks hold the motion, they fit themselves
    squares: float
    n_blocks: int

    @property
    def free(self) -> int:
        return self.n_blocks - self.coefficients.size

    @property
    def known(self) -> bool:
        return self.free >= 3

    def std(self, row: Floats) -> float:
        """Of a sum of the coefficients, by the larger of both."""
        return math.sqrt(max(float(row @ self.covariance @ row), float(row @ self.even @ row), 0.0))

    def odds(self, first: int) -> float:
        """Probability that noise makes the coefficients from `first` on as large as they are."""
        b = self.coefficients[first:]
        if not self.known:
            return 1.0
        p, odds = b.size, 0.0
        for covariance in (self.covariance, self.even):
            wald = float(b @ np.linalg.pinv(covariance[first:, first:], hermitian=True) @ b)
            # Hotelling's: the covariance is known from as many blocks only.
            f = max(wald, 0.0) / p * (self.free - p + 1) / self.free
            odds = max(odds, f_above(p, max(self.free - p + 1, 1), f))
        return odds


def _fast_length(n: int) -> int:
    """The least 2^i 3^j 5^k that is n or more: a length that a real transform likes."""
    best, fives = 1 << max(n - 1, 1).bit_length(), 1
    while fives < best:
        odd = fives
        while odd < best:
            best = min(best, odd << max(-(-n // odd) - 1, 0).bit_length())
            odd *= 3
        fives *= 5
    return best


def _spectra(target: Floats, measured: Floats, tracking: Tracking) -> tuple[NDArray[np.complex128], Floats, int]:
    """Both signals' low bins, less what rests at the ends; target's energy by bin; the transforms' length.

    Less the line from end to end, where the target goes from one place to another, else less their means: so neither
    jumps where the record ends, and what is lost is a line, which nobody asks for.

    Taken over from the evaluation where it has them.
    """
    n, settings = target.size, tracking.settings
    few = 1 + n // 500
    ends = np.array([(part[:few].mean(), part[-few:].mean()) for part in (target, measured)])
    slope = (ends[:, 1] - ends[:, 0]) / max(n - few, 1)
    first = ends[:, 0] - slope * (few - 1) / 2
    if np.var(target - slope[0] * np.arange(n)) >= np.var(target):
        # Cut off in full motion, not displaced: the line would be none of its own.
        first, slope = np.array((target.mean(), measured.mean())), np.zeros(2)
    whole = settings.window == "boxcar" and settings.data_decimation == settings.frequency_decimation == 1
    if whole and settings.band_hz is None and settings.detrend != "linear" and tracking.target_spectrum is not None:
        assert tracking.measured_spectrum is not None
        size = round(tracking.rate_hz / tracking.delta_f_hz)
        low = min(size // 2, 2 * _MOST_SAMPLES // int(_OVERSAMPLING))
        found = np.zeros((2, low + 1), dtype=complex)
        found[0, 1:], found[1, 1:] = tracking.target_spectrum[:low], tracking.measured_spectrum[:low]
        # Less the line from end to end, by its transform; above the low bins it is nothing beside a motion.
        turn = np.exp(-2j * np.pi * np.arange(1, low + 1) / size)
        last = np.exp(-2j * np.pi * np.arange(1, low + 1) / size * n)
        even = (last - 1) / (turn - 1)
        rising = (n * last - turn * even) / (turn - 1)
        if settings.detrend == "mean":
            first = first - np.array((target.mean(), measured.mean()))
        found[:, 1:] -= first[:, None] * even + slope[:, None] * rising
        spectrum = tracking.target_spectrum
        energy = np.concatenate(([0.0], spectrum.real**2 + spectrum.imag**2))
    else:
        pair = np.stack((target, measured)) - first[:, None] - slope[:, None] * np.arange(n)
        size = _fast_length(n + 16)
        found = np.fft.rfft(pair, size, axis=1)
        energy = found[0].real ** 2 + found[0].imag ** 2
    energy[: found.shape[1]] = found[0].real ** 2 + found[0].imag ** 2
    return found, energy, size


def _motion(target: Floats, measured: Floats, tracking: Tracking, trusted: Tracking) -> _Motion | None:
    n, delay_s, rate_hz = target.size, float(trusted.delay_s), trusted.rate_hz
    spectra, energy, size = _spectra(target, measured, tracking)
    df = rate_hz / size
    # A noisy target is even over all frequencies.
    floor = median(energy[energy.size // 2 :])
    energy = np.where(energy > 4 * floor, energy - floor, 0.0)
    low_hz, high_hz = trusted.settings.band_hz or (0.0, math.inf)
    f_all = df * np.arange(energy.size)
    energy[(f_all < low_hz) | (f_all > high_hz)] = 0.0
    total = np.cumsum(energy)
    if not total[-1] > 0:
        return None
    top = int(np.searchsorted(total, _ENERGY * total[-1])) + 2
    top = min(top, int(_MOST_SAMPLES / _OVERSAMPLING), energy.size - 1)
    last = min(int(_ROLL_OFF * top) + 2, spectra.shape[1] - 1)
    m = _fast_length(max(int(_OVERSAMPLING * top) + 8, 2 * last + 2))
    f = f_all[: last + 1]
    keep = np.where(
        f <= df * top, 1.0, np.cos(np.pi / 2 * np.clip((f - df * top) / max(df * (last - top), df), 0, 1)) ** 2
    )
    if low_hz > 0:
        keep[f < low_hz] = 0.0
    i, o = keep * spectra[0, : last + 1], keep * spectra[1, : last + 1]
    i = i * np.exp(-2j * np.pi * delay_s * f)
    weight = energy[: top + 1]
    f_eq = float(f[: top + 1] @ weight / weight.sum())
    spread = math.sqrt(max(float((f[: top + 1] - f_eq) ** 2 @ weight / weight.sum()), df**2))
    w = 2j * np.pi * f
    g = (f - f_eq) / spread
    rows = np.stack((i, w * i, w * w * i, o, g * i, g * w * i, g * g * i, g * g * w * i))
    series = np.fft.irfft(rows, m, axis=1) * (m / size)
    harmonics = np.fft.rfft(np.sign(series[:2]), axis=1)
    harmonics[:, : last + 1] *= keep
    harmonics[:, last + 1 :] = 0.0
    signs = np.fft.irfft(harmonics, m, axis=1)
    # Only positive frequencies: the modulus is the oscillation's amplitude.
    analytic = np.fft.ifft(2 * i, m) * (m / size)
    step_s = size / (m * rate_hz)
    period = max(1, round(1 / (max(f_eq, df) * step_s)))
    power = np.concatenate(([0.0], np.cumsum(analytic.real**2 + analytic.imag**2)))
    index = np.arange(m)
    low, high = np.maximum(index - period // 2, 0), np.minimum(index + period // 2 + 1, m)
    amplitude = np.sqrt(np.maximum(power[high] - power[low], 0.0) / (high - low))
    margin = min(_ENDS / (df * top), 0.08 * n / rate_hz)
    time_s = np.asarray(index * step_s, dtype=np.float64)
    inside = (time_s >= margin + max(delay_s, 0)) & (time_s <= (n - 1) / rate_hz - margin + min(delay_s, 0))
    if inside.sum() < _FEWEST_SAMPLES or top * n < _FEWEST_PERIODS * size:
        return None
    kept = np.concatenate((series, signs))[:, inside]
    # A line is nobody's motion, see `_spectra`.
    away = np.linspace(-1.0, 1.0, kept.shape[1])
    kept -= kept.mean(axis=1, keepdims=True)
    kept -= (kept @ away)[:, None] / float(away @ away) * away
    count = kept.shape[1]
    blocks = int(np.clip(count / (_BLOCK_PERIODS * period), _FEWEST_BLOCKS, _MOST_BLOCKS))
    share = total / total[-1]
    middle = tuple(float(df * np.searchsorted(share, s)) for s in (0.05, 0.95))
    return _Motion(
        time_s=time_s[inside],
        target=kept[0],
        slope=kept[1],
        bend=kept[2],
        measured=kept[3],
        amplitude=amplitude[inside],
        by_frequency=tuple(kept[4:8]),
        signs=tuple(kept[8:]),
        starts=np.linspace(0, count, blocks, endpoint=False).astype(np.intp),
        delay_s=delay_s,
        f_eq=f_eq,
        spread_hz=spread,
        noise=float(trusted.target_noise_std) * math.sqrt(min(1.0, top / energy.size)),
        middle_hz=(middle[0], middle[1]),
    )


def _solve(x: Floats, y: Floats, starts: NDArray[np.intp]) -> _Fit:
    """Least squares of y by the rows of x."""
    scale = np.sqrt((x * x).mean(axis=1))
    scale[scale == 0] = 1.0
    x = x / scale[:, None]
    inverse = np.linalg.pinv(x @ x.T, hermitian=True)
    b = inverse @ (x @ y)
    rest = y - b @ x
    scores = np.add.reduceat(x * rest, starts, axis=1)
    p, n_blocks, squares = b.size, starts.size, float(rest @ rest)
    covariance = n_blocks / max(n_blocks - p, 1) * inverse @ (scores @ scores.T) @ inverse
    even = squares / max(_INDEPENDENT * y.size - p, 1.0) * inverse
    scales = np.outer(scale, scale)
    return _Fit(b / scale, covariance / scales, even / scales, squares, n_blocks)


def _pairs(target: Floats, slope: Floats, basis: Sequence[Floats]) -> Floats:
    """Rows target, slope; then each times each function of the basis."""
    return np.stack([target, slope, *(part for phi in basis for part in (phi * target, phi * slope))])


def _shifted(motion: _Motion, later_s: Floats) -> tuple[Floats, Floats]:
    """The target and its slope later by what each sample asks, by Hermite's cubics: values and slopes are known."""
    step = float(motion.time_s[1] - motion.time_s[0])
    at = np.arange(motion.time_s.size) - later_s / step
    left = np.clip(np.floor(at).astype(np.intp), 0, motion.time_s.size - 2)
    u = np.clip(at - left, 0.0, 1.0)
    a, b = (1 + 2 * u) * (1 - u) ** 2, u * (1 - u) ** 2 * step
    c, d = u * u * (3 - 2 * u), u * u * (u - 1) * step

    def between(value: Floats, slope: Floats) -> Floats:
        return a * value[left] + b * slope[left] + c * value[left + 1] + d * slope[left + 1]

    return between(motion.target, motion.slope), between(motion.slope, motion.bend)


def _varying(motion: _Motion, basis: Sequence[Floats], gains: bool = True) -> _Fit:
    """Gain and delay as sums over `basis` and a constant; by Newton's steps, as a delay may change by much.

    The coefficients are gain and delay (s, beyond the trusted one) of the constant, then of each function in turn;
    without `gains` only the delay follows the functions.
    """
    functions = [np.ones_like(motion.target), *basis]
    delay = np.zeros_like(motion.target)
    delays = np.zeros(len(functions))
    fit = None
    for _ in range(3):
        moved, slope = (motion.target, motion.slope) if not delay.any() else _shifted(motion, delay)
        x = _pairs(moved, slope, basis)
        if not gains:
            x = np.concatenate((x[:2], x[3::2]))
        fit = _solve(x, motion.measured, motion.starts)
        c = fit.coefficients
        gain = c[0]
        added = -(c[1::2] if gains else c[1:]) / gain if gain else np.zeros(len(functions))
        if not gain or not np.isfinite(added).all():
            break
        delays = delays + added
        change = sum(d * phi for d, phi in zip(added, functions, strict=True))
        delay = delay + change
        # Beyond half a period no linear step means anything.
        if np.abs(delay).max() * motion.f_eq > 0.5 or np.abs(change).max() * motion.f_eq < _LINEAR:
            break
    assert fit is not None
    c = fit.coefficients.copy()
    turn = np.ones(c.size)
    places = slice(1, None, 2) if gains else slice(1, None)
    turn[places] = -1 / c[0] if c[0] else 1.0
    c[places] = delays
    turns = np.outer(turn, turn)
    return _Fit(c, fit.covariance * turns, fit.even * turns, fit.squares, fit.n_blocks)


def _step_place(motion: _Motion) -> int:
    """Where a step of gain and delay explains most: two fits of two numbers, for every place at once."""
    parts = (motion.target, motion.slope, motion.measured)
    sums = {(i, j): np.cumsum(parts[i] * parts[j]) for i in range(3) for j in range(i, 3) if (i, j) != (2, 2)}

    def explained(s: dict[tuple[int, int], Floats]) -> Floats:
        det = s[0, 0] * s[1, 1] - s[0, 1] ** 2
        found = s[1, 1] * s[0, 2] ** 2 - 2 * s[0, 1] * s[0, 2] * s[1, 2] + s[0, 0] * s[1, 2] ** 2
        enough = det > 1e-9 * sums[0, 0][-1] * sums[1, 1][-1]
        return np.where(enough, found / np.where(enough, det, 1.0), 0.0)

    before, after = explained(sums), explained({key: value[-1] - value for key, value in sums.items()})
    n = before.size
    inner = slice(max(2, n // 50), n - max(2, n // 50))
    # A side that has hardly moved says nothing.
    share = sums[0, 0] / sums[0, 0][-1]
    total = np.where((share > _MOVED) & (share < 1 - _MOVED), before + after, -np.inf)
    return int(np.argmax(total[inner])) + inner.start + 1


def _level(motion: _Motion, rows: NDArray[np.bool_], where: Interval) -> Level:
    """Gain and delay of some of the samples alone."""
    at = np.flatnonzero(rows)
    starts = np.flatnonzero(np.diff(np.searchsorted(motion.starts, at, "right"), prepend=-1))
    fit = _solve(np.stack((motion.target[at], motion.slope[at])), motion.measured[at], starts)
    gain, slope = (float(c) for c in fit.coefficients)
    later = -slope / gain if gain else math.nan
    toward = np.array((1.0, 0.0)), np.array((0.0, 1 / gain if gain else 0.0))
    return _known(fit, where, gain, toward[0], motion.delay_s + later, toward[1])


def _known(fit: _Fit, where: Interval, gain: float, by_gain: Floats, delay: float, by_delay: Floats) -> Level:
    """A level with the intervals of gain and delay, as sums of the coefficients."""
    if not fit.known:
        return Level(where, delay, NO_INTERVAL, gain, NO_INTERVAL)
    t = t_975(fit.free)
    gain_half, delay_half = t * fit.std(by_gain), t * fit.std(by_delay)
    return Level(where, delay, (delay - delay_half, delay + delay_half), gain, (gain - gain_half, gain + gain_half))


def _along(motion: _Motion, fit: _Fit, phi: Sequence[float], where: Interval, gains: bool = True) -> Level:
    """What a fit says where its functions have these values."""
    functions = np.array((1.0, *phi))
    row_gain, row_delay = np.zeros(fit.coefficients.size), np.zeros(fit.coefficients.size)
    if gains:
        row_gain[::2], row_delay[1::2] = functions, functions
    else:
        row_gain[0], row_delay[1:] = 1.0, functions
    gain, later = float(row_gain @ fit.coefficients), float(row_delay @ fit.coefficients)
    return _known(fit, where, gain, row_gain, motion.delay_s + later, row_delay)


def _octaves(motion: _Motion) -> tuple[Level, Level] | None:
    """Large motion, and the smallest in which gain and delay can be told; each an octave of amplitude."""
    found: list[Level] = []
    high = quantile(motion.amplitude, 0.995)
    for _ in range(8):
        low = high / 2
        if low < _CLEAR * motion.noise:
            break
        rows = (motion.amplitude >= low) & (motion.amplitude < (high if found else math.inf))
        if rows.sum() >= _FEW:
            level = _level(motion, rows, (low, high))
            delay_half, gain_half = (
                (interval[1] - interval[0]) / 2 for interval in (level.delay_interval_s, level.gain_interval)
            )
            if delay_half <= _KNOWN * abs(level.delay_s) and gain_half <= _KNOWN * abs(level.gain):
                found.append(level)
        high = low
    return (found[0], found[-1]) if len(found) > 1 else None


def _by_fit(motion: _Motion, fit: _Fit) -> tuple[Level, Level]:
    """The same by the fit over amplitude, at amplitudes above and below which a twentieth of the energy lies."""
    order = np.argsort(motion.amplitude)
    share = np.cumsum(motion.amplitude[order] ** 2)
    small, large = (float(motion.amplitude[order[np.searchsorted(share, part * share[-1])]]) for part in _ENERGY_ENDS)

    def at(amplitude: float) -> Level:
        c = fit.coefficients
        functions = [1.0, *(float(p[0]) for p in _of_amplitude(np.array([amplitude]), motion))]
        # The fundamental of a square wave is 4 / pi times its height.
        square = 4 / (math.pi * max(amplitude, 1e-300))
        by_gain, by_delay = np.zeros(c.size), np.zeros(c.size)
        by_gain[:-2:2], by_gain[-2] = functions, square
        by_delay[1:-2:2], by_delay[-1] = functions, square / (2 * math.pi * motion.f_eq)
        gain = float(by_gain @ c)
        by_delay /= -gain if gain else 1.0
        return _known(fit, (amplitude, amplitude), gain, by_gain, motion.delay_s + float(by_delay @ c), by_delay)

    return at(large), at(small)


def _of_amplitude(amplitude: Floats, motion: _Motion) -> list[Floats]:
    """A dead band takes a part that falls as one over the amplitude; what saturates goes about as its logarithm."""
    rms = float(np.sqrt(np.mean(motion.amplitude**2)))
    relative = np.maximum(amplitude / rms, max(_STILL, 3 * motion.noise / rms))
    return [np.log(relative), 1 / relative]


def dependence(
    target: Floats,
    measured: Floats,
    tracking: Tracking,
    trusted: Tracking,
    response: FrequencyResponse | None,
) -> Dependence | None:
    """What gain and delay depend on; None where they are one number each, as far as the record can tell.

    tracking: with weights, for its spectra; trusted: the least-squares estimate, whose delay all is measured from;
    response: for the line over frequency.
    """
    if not (math.isfinite(float(trusted.delay_s)) and float(trusted.amplitude) > 0):
        return None
    motion = _motion(target, measured, tracking, trusted)
    if motion is None:
        return None
    middle = (motion.time_s[0] + motion.time_s[-1]) / 2
    clock_time = (motion.time_s - middle) / (motion.time_s[-1] - middle)
    place = _step_place(motion)
    after = np.where(np.arange(motion.time_s.size) >= place, 1.0, 0.0)
    shape = _pairs(motion.target, motion.slope, _of_amplitude(motion.amplitude, motion))
    signs, by_frequency = np.stack(motion.signs), np.stack(motion.by_frequency)
    over_time = _pairs(motion.target, motion.slope, [clock_time, after])[2:]
    fits = {
        "frequency": _solve(np.concatenate((shape[:2], by_frequency)), motion.measured, motion.starts),
        "amplitude": _solve(np.concatenate((shape, signs)), motion.measured, motion.starts),
        "drift": _varying(motion, [clock_time]),
        "step": _varying(motion, [after]),
        "clock": _varying(motion, [clock_time], gains=False),
    }
    u = (motion.time_s - motion.time_s[0]) / (motion.time_s[-1] - motion.time_s[0])
    # Blocks half as long, as there are more numbers.
    blocks = min(2 * motion.starts.size, _MOST_BLOCKS)
    finer = replace(motion, starts=np.linspace(0, motion.time_s.size, blocks, endpoint=False).astype(np.intp))
    waves = min(_HALF_WAVES, (blocks - 6) // _BLOCKS_A_WAVE)
    course = [np.cos(math.pi * k * u) for k in range(1, waves + 1)]
    fits["course"] = _varying(finer, course)
    constant = _solve(shape[:2], motion.measured, motion.starts).squares
    families = {"frequency": by_frequency, "amplitude": np.concatenate((shape[2:], signs)), "time": over_time}

    def left(*names: str) -> float:
        """What all causes leave together, but for some."""
        x = np.concatenate((shape[:2], *(rows for name, rows in families.items() if name not in names)))
        return _solve(x, motion.measured, motion.starts).squares

    everything = left()
    least = min(everything, *(fit.squares for fit in fits.values()))
    # What the least change that counts would leave, were it in this part of the motion only.
    delay = max(_LEAST_DELAY * abs(motion.delay_s), _LEAST_SAMPLE / trusted.rate_hz)
    change = float(trusted.amplitude) * min(_LEAST_GAIN, 2 * math.pi * motion.f_eq * delay)
    if not constant - least > _PART * change**2 * float(motion.target @ motion.target):
        return None
    shares = {name: max(0.0, (constant - fit.squares) / (constant - least)) for name, fit in fits.items()}
    # Causes overlap: what counts is the mean of what each takes off alone and what it takes off last.
    last = {name: max(0.0, (left(name) - everything) / (constant - least)) for name in families}
    last["drift"] = last["step"] = last["time"]
    plain = ("frequency", "amplitude", "drift", "step")
    weight = {name: (shares[name] + last[name]) / 2 for name in plain}
    order = sorted(weight, key=lambda name: -weight[name])
    if shares["frequency"] > max(shares[name] for name in weight) - _TIE:
        order.remove("frequency")
        order.insert(0, "frequency")
    told = {name: shares[name] for name in ("frequency", "amplitude", "clock")}
    told["time"] = max(shares["drift"], shares["step"])
    bends = 1 - fits["course"].squares / constant
    beyond = shares["course"] - max(shares["drift"], shares["step"])
    apart = shares["course"] - max(shares["frequency"], shares["amplitude"])
    if bends > _BENDS and beyond > _CLEARLY and apart > _FAR:
        order.insert(0, "course")
        weight["course"] = max(weight.values())
        told["time"] = shares["course"]
    for name in order:
        if weight[name] < _NEXT * weight[order[0]]:
            continue
        likely = _LIKELY if name == "course" else _CHANCE
        if fits[name].odds(2) * (_PLACES if name == "step" else 1.0) > likely and not (
            name == "course" and bends > _NEARLY_ALL
        ):
            continue
        if name == "course":
            found, levels = _over_course(motion, fits[name], told, course)
        else:
            found, levels = _told(motion, name, fits, told, place, trusted.rate_hz, response)
        if any(_matters(pair, trusted.rate_hz, _SURER.get(name, 1.0)) for pair in levels):
            return found
    return None


def _matters(levels: tuple[Level, Level], rate_hz: float, sure: float = 1.0) -> bool:
    """Whether delay or gain change by enough to be told, and by more than they are known to."""
    first, second = levels
    for low, high, least in (
        ((first.delay_s, *first.delay_interval_s), (second.delay_s, *second.delay_interval_s),
         max(_LEAST_DELAY * abs(first.delay_s), _LEAST_SAMPLE / rate_hz)),
        ((first.gain, *first.gain_interval), (second.gain, *second.gain_interval), _LEAST_GAIN * abs(first.gain)),
    ):  # fmt: skip
        # Half the width of the difference's interval; NaN is no finding.
        half = math.hypot(low[2] - low[1], high[2] - high[1]) / 2
        if abs(high[0] - low[0]) > max(least, sure * _SURE * half) and math.isfinite(half):
            return True
    return False


def _told(
    motion: _Motion,
    name: str,
    fits: Mapping[str, _Fit],
    shares: Mapping[str, float],
    place: int,
    rate_hz: float,
    response: FrequencyResponse | None,
) -> tuple[Dependence, list[tuple[Level, Level]]]:
    """The figures of one cause, and pairs of levels, any of which may show that it matters."""
    start, end = float(motion.time_s[0]), float(motion.time_s[-1])
    fit = fits[name]
    if name == "frequency":
        return _over_frequency(motion, fit, shares, response)
    if name == "amplitude":
        levels = _by_fit(motion, fit)
        shown = _octaves(motion)
        # The octaves are what the record shows; they are told where they show it, too.
        if shown is not None and _matters(shown, rate_hz):
            levels = shown
        return _found("amplitude", shares, "levels", levels), [levels]
    if name == "step":
        at = float(motion.time_s[place])
        levels = (_along(motion, fit, (0.0,), (start, at)), _along(motion, fit, (1.0,), (at, end)))
        return _found("time", shares, "step", levels, step_s=at), [levels]
    even = abs(2 * fit.coefficients[2] / fit.coefficients[0]) < _CLOCK_GAIN
    if even and shares["clock"] > _CLOCK_SHARE * shares["time"] and not _is_uneven(motion, fits):
        clock = fits["clock"]
        levels = (
            _along(motion, clock, (-1.0,), (start, start), gains=False),
            _along(motion, clock, (1.0,), (end, end), gains=False),
        )
        rate = 2e6 / (end - start)
        ppm, std = rate * float(clock.coefficients[2]), rate * clock.std(np.array((0.0, 0.0, 1.0)))
        t = t_975(max(clock.free, 2))
        interval = (ppm - t * std, ppm + t * std)
        return _found("clock", shares, "line", levels, clock_ppm=ppm, clock_ppm_interval=interval), [levels]
    levels = (_along(motion, fit, (-1.0,), (start, start)), _along(motion, fit, (1.0,), (end, end)))
    return _found("time", shares, "line", levels), [levels]


def _is_uneven(motion: _Motion, fits: Mapping[str, _Fit]) -> bool:
    """Whether a course over time leaves less than an even drift of the delay, by far more than its numbers cost."""
    clock, course = fits["clock"], fits["course"]
    more = course.coefficients.size - clock.coefficients.size
    free = max(_INDEPENDENT * motion.time_s.size - course.coefficients.size, 1.0)
    return (clock.squares - course.squares) / more > _UNEVEN * course.squares / free


def _over_course(
    motion: _Motion, fit: _Fit, shares: Mapping[str, float], course: Sequence[Floats]
) -> tuple[Dependence, list[tuple[Level, Level]]]:
    """The two times at which the delay is farthest apart, or the gain where that varies more."""
    basis = np.stack((np.ones_like(motion.target), *course))
    gain, later = fit.coefficients[::2] @ basis, fit.coefficients[1::2] @ basis
    # Where the target rests a course is free to go anywhere.
    moves = motion.amplitude > 0.3 * float(np.sqrt(np.mean(motion.amplitude**2)))
    ends = []
    for values in (later, gain):
        known = np.where(moves, values, np.nan)
        ends.append(sorted((int(np.nanargmin(known)), int(np.nanargmax(known)))))
    phase = [2 * math.pi * motion.f_eq * float(np.ptp(later[ends[0]])), float(np.ptp(np.log(np.abs(gain[ends[1]]))))]
    pairs = []
    for places in ends:
        first, second = (
            _along(motion, fit, [float(wave[at]) for wave in course], (float(motion.time_s[at]),) * 2) for at in places
        )
        pairs.append((first, second))
    return _found("time", shares, "course", pairs[0] if phase[0] >= phase[1] else pairs[1]), pairs


def _found(
    kind: Kind, shares: Mapping[str, float], form: str, levels: tuple[Level, Level], **more: object
) -> Dependence:
    first, second = levels

    def change(a: float, b: float) -> float:
        return (b - a) / abs(a) if a else math.inf

    return Dependence(
        kind=kind,
        share=shares[kind],
        shares=dict(shares),
        form=form,  # type: ignore[arg-type]
        levels=levels,
        delay_change=change(first.delay_s, second.delay_s),
        gain_change=change(first.gain, second.gain),
        **more,  # type: ignore[arg-type]
    )


def _over_frequency(
    motion: _Motion, fit: _Fit, shares: Mapping[str, float], response: FrequencyResponse | None
) -> tuple[Dependence, list[tuple[Level, Level]]]:
    """Delay and gain at both ends of the band that holds nine tenths of the energy, and the lines between."""
    low, high = motion.middle_hz
    c = fit.coefficients

    def at(f: float) -> Level:
        g = (f - motion.f_eq) / motion.spread_hz
        powers = np.array((1.0, g, g * g))
        real, slope = float(powers @ c[::2]), float(powers @ c[1::2])
        # H = real + i w slope, of measured over the target that is already late by the trusted delay.
        w = 2 * math.pi * f
        gain, later = math.hypot(real, w * slope), -math.atan2(w * slope, real) / w if w else -slope / real
        toward = np.zeros(c.size)
        toward[::2], toward[1::2] = powers * real / gain, powers * w * w * slope / gain
        turned = np.zeros(c.size)
        turned[::2], turned[1::2] = powers * slope / gain**2, -powers * real / gain**2
        return _known(fit, (f, f), gain, toward, motion.delay_s + later, turned)

    ends = (at(low), at(high))
    if response is None:
        return _found("frequency", shares, "line", ends), [ends]
    # Two numbers bend little; the curve says what is at the ends, where it is known there.
    told = (_of_curve(response, low) or ends[0], _of_curve(response, high) or ends[1])
    lines = {
        "delay_line": _line(response, response.delay_s, response.delay_std_s, motion),
        "gain_line": _line(response, response.gain, response.gain_std, motion),
    }
    return _found("frequency", shares, "line", told, **lines), [ends, told]


def _of_curve(response: FrequencyResponse, frequency_hz: float) -> Level | None:
    """What the curves over frequency say at the nearest bin where they are known, if any is near."""
    known = np.isfinite(response.delay_interval_s[:, 0]) & np.isfinite(response.gain_interval[:, 0])
    away = np.where(known, np.abs(response.frequency_hz - frequency_hz), np.inf)
    at = int(np.argmin(away))
    if not away[at] < _NEAR * frequency_hz:
        return None
    delay, gain = (
        (float(low), float(high)) for low, high in (response.delay_interval_s[at], response.gain_interval[at])
    )
    f = float(response.frequency_hz[at])
    return Level((f, f), float(response.delay_s[at]), delay, float(response.gain[at]), gain)


def _line(response: FrequencyResponse, values: Floats, std: Floats, motion: _Motion) -> Line | None:
    """The straight line about f_eq over the widest band in which the curve keeps near to it."""
    f = response.frequency_hz
    known = np.isfinite(values) & np.isfinite(std) & (f > 0)
    known &= (f >= motion.middle_hz[0]) & (f <= motion.middle_hz[1])
    x, y, s = f[known], values[known], std[known]
    while x.size >= 4:
        # Even weights: a line that is to hold at its ends must not be drawn by its middle.
        centred = x - x.mean()
        slope = float(centred @ y / (centred @ centred))
        rest = y - y.mean() - slope * centred
        worst, level = float(np.abs(rest).max()), max(abs(float(y.mean())), 1e-12)
        if worst <= min(max(_STRAIGHT, 3 * median(s) / level), _ROUGH) * level:
            at = min(max(motion.f_eq, float(x[0])), float(x[-1]))
            error = math.sqrt(float((centred**2) @ (s**2))) / float(centred @ centred)
            return Line(
                at, float(y.mean() + slope * (at - x.mean())), slope,
                (slope - 1.96 * error, slope + 1.96 * error), (float(x[0]), float(x[-1])), worst,
            )  # fmt: skip
        drop = 1 + x.size // 50
        # The end that departs more goes.
        if np.abs(rest[: drop + 1]).max() > np.abs(rest[-drop - 1 :]).max():
            x, y, s = x[drop:], y[drop:], s[drop:]
        else:
            x, y, s = x[:-drop], y[:-drop], s[:-drop]
    return None
