"""Is the cause named right? Actuators whose gain and delay depend on one thing, by definition, and what is said.

Frequency (first and second order), amplitude (dead band, play, friction), time (steps, drift), two clocks, two of them
at once, and none. Each on earthquake responses, random motion and sweeps, with 1 % of noise on measured. A pair counts
where its gain or delay varies by more than a tenth over the middle nine tenths of the motion's energy, worked out from
the definition; nothing here knows how the package decides.

    python benchmarks/causes.py [--runs 100] [--only time clock ...] [--noise 0.01] [--show]
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

sys.path.insert(0, str(Path(__file__).resolve().parent))
import rthstrack
from accuracy import Row
from rthstrack.reproduction.cases import linear, nonlinear

Floats = NDArray[np.float64]

RATE_HZ = 1024.0
#: Of delay or gain, from which a variation must be named; and below which a pair is not asked about.
VARIES = 0.1
#: Of two at once, the larger one does so many times what the other does to measured.
LARGER = 1.5
#: Of earthquakes, far-field records (extra `records`).
EARTHQUAKES = ("MUL009", "MUL279", "CHY101-N")
NO_CAUSE = "none"
#: On either side of a step is to be this share of the motion's energy.
STIRS = 0.01


# Motions --------------------------------------------------------------------------------------------------------------


def oscillator(name: str, frequency_hz: float, damping: float = 0.05, seconds: float = 50.0) -> Floats:
    """Displacement of an elastic oscillator under a record, by its transfer function; 20 mm at most."""
    ground = rthstrack.record(name).resampled(RATE_HZ, seconds)
    n = ground.acceleration_m_s2.size
    w, w0 = 2 * np.pi * np.fft.rfftfreq(2 * n, 1 / RATE_HZ), 2 * np.pi * frequency_hz
    force = np.fft.rfft(ground.acceleration_m_s2, 2 * n)
    x = np.fft.irfft(-force / (w0**2 - w**2 + 2j * damping * w0 * w), 2 * n)[:n]
    return 20 * x / np.abs(x).max()


def frame(name: str) -> Floats:
    """Two modes under a record, at 1 and 4 Hz, as a storey moves."""
    x = oscillator(name, 1.0, 0.03) + 0.4 * oscillator(name, 4.0, 0.03)
    return 20 * x / np.abs(x).max()


def band_limited(low_hz: float, high_hz: float, seed: int, slow: bool, seconds: float = 50.0) -> Floats:
    """Random phases, even power; `slow`: under an envelope that rises and falls over the record."""
    n = round(seconds * RATE_HZ)
    f = np.fft.rfftfreq(n, 1 / RATE_HZ)
    phases = np.random.default_rng(seed).random(f.size)
    x = np.fft.irfft(np.where((f > low_hz) & (f < high_hz), np.exp(2j * np.pi * phases), 0), n)
    t = np.arange(n) / RATE_HZ
    if slow:
        x = x * (0.05 + np.exp(-(((t - 0.4 * seconds) / (0.2 * seconds)) ** 2)))
    x = x * np.clip(np.minimum(t, seconds - t), 0, 1)
    return 20 * x / np.abs(x).max()


def swept(low_hz: float, high_hz: float, power: float, there_and_back: bool, seconds: float = 50.0) -> Floats:
    """A sine whose frequency grows by the same factor each second, its amplitude as f^-power; there and back if asked.

    On a sweep one way frequency and time are one thing, so what varies over time is asked about on the others only.
    """
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    u = 1 - np.abs(2 * t / seconds - 1) if there_and_back else t / seconds
    f = low_hz * (high_hz / low_hz) ** u
    x = f**-power * np.sin(2 * np.pi * np.cumsum(f) / RATE_HZ) * np.clip(np.minimum(t, seconds - t), 0, 1)
    return 20 * x / np.abs(x).max()


def beating(x: Floats, every_s: float = 7.3) -> Floats:
    """The same, smaller by up to five times and back, at a pace of its own."""
    t = np.arange(x.size) / RATE_HZ
    x = x * (0.6 + 0.4 * np.sin(2 * np.pi * t / every_s))
    return 20 * x / np.abs(x).max()


@dataclass(frozen=True, eq=False)
class Motion:
    name: str
    samples: Floats
    one_way: bool = False
    tied: bool = False  # its amplitude is even, or goes with its frequency: nothing can be said of it alone

    @property
    def time_s(self) -> Floats:
        return np.arange(self.samples.size) / RATE_HZ

    def at(self, later_s: Floats | float) -> Floats:
        """The target so much later; at rest before its beginning."""
        return spline(self.name)(np.clip(self.time_s - later_s, 0.0, self.time_s[-1]))

    def energy(self) -> tuple[Floats, Floats]:
        n = self.samples.size
        return np.fft.rfftfreq(n, 1 / RATE_HZ), np.abs(np.fft.rfft(self.samples - self.samples.mean())) ** 2

    def middle_hz(self) -> tuple[float, float, float]:
        """The frequencies of 5 %, of the middle, and of 95 % of the energy."""
        f, energy = self.energy()
        share = np.cumsum(energy) / energy.sum()
        low, middle, high = (float(f[np.searchsorted(share, s)]) for s in (0.05, 0.5, 0.95))
        return low, middle, high

    def amplitudes(self) -> tuple[float, float]:
        """Local amplitudes that 5 % and 95 % of the energy lie below, over a period each."""
        _, f, _ = self.middle_hz()
        period = max(1, round(RATE_HZ / f))
        squares = np.concatenate(([0.0], np.cumsum(self.samples**2)))
        local = np.sqrt(2 * (squares[period:] - squares[:-period]) / period)
        local = np.sort(local)
        share = np.cumsum(local**2) / (local**2).sum()
        low, high = (float(local[np.searchsorted(share, s)]) for s in (0.05, 0.95))
        return low, high


@cache
def motions() -> tuple[Motion, ...]:
    found = [
        *(Motion(f"{name} {f:g} Hz", oscillator(name, f)) for name in EARTHQUAKES for f in (1.0, 2.5)),
        *(Motion(f"{name} frame", frame(name)) for name in EARTHQUAKES),
        *(Motion(f"random {seed}", band_limited(0.5, high, seed, slow=False)) for seed, high in ((1, 5.0), (2, 10.0))),
        *(Motion(f"burst {seed}", band_limited(0.5, high, seed, slow=True)) for seed, high in ((3, 5.0), (4, 10.0))),
        Motion("sweep", swept(0.3, 10, 0.7, False), one_way=True, tied=True),
        Motion("sweep, even", swept(0.3, 10, 0.0, False), one_way=True, tied=True),
        Motion("sweep and back", swept(0.3, 10, 0.7, True), tied=True),
        Motion("sweep and back, beating", beating(swept(0.3, 10, 0.4, True))),
    ]
    return tuple(found)


@cache
def spline(name: str) -> CubicSpline:
    motion = next(m for m in motions() if m.name == name)
    return CubicSpline(motion.time_s, motion.samples)


# Actuators ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Actuator:
    """What it makes of a motion; `change`: of delay and gain, from the definition, the larger as a share of itself."""

    what: str
    kind: str
    measured: Callable[[Motion], Floats]
    change: Callable[[Motion], float]


def filtered(motion: Motion, response: Callable[[Floats], NDArray[np.complex128]], late_s: float) -> Floats:
    n = motion.samples.size
    f = np.fft.rfftfreq(2 * n, 1 / RATE_HZ)
    return np.fft.irfft(np.fft.rfft(motion.samples, 2 * n) * response(f) * np.exp(-2j * np.pi * f * late_s), 2 * n)[:n]


def over_frequency(response: Callable[[Floats], NDArray[np.complex128]], late_s: float, what: str) -> Actuator:
    def change(motion: Motion) -> float:
        low, _, high = motion.middle_hz()
        f = np.linspace(low, high, 50)
        h = response(f)
        delay = late_s - np.unwrap(np.angle(h)) / (2 * np.pi * f)
        gain = np.abs(h)
        return max(float(np.ptp(delay) / np.median(delay)), float(np.ptp(gain) / np.median(gain)))

    return Actuator(what, "frequency", lambda motion: filtered(motion, response, late_s), change)


def first_order(corner_hz: float, late_s: float) -> Actuator:
    return over_frequency(lambda f: 1 / (1 + 1j * f / corner_hz), late_s, f"first order {corner_hz:.1f} Hz")


def second_order(own_hz: float, damping: float, late_s: float) -> Actuator:
    def response(f: Floats) -> NDArray[np.complex128]:
        return 1 / (1 - (f / own_hz) ** 2 + 2j * damping * f / own_hz)

    return over_frequency(response, late_s, f"second order {own_hz:.1f} Hz, {damping:.2f}")


def dead_band(x: Floats, half_width: float) -> Floats:
    return np.sign(x) * np.maximum(np.abs(x) - half_width, 0)


def play(x: Floats, half_width: float) -> Floats:
    """Backlash: moved only when the gap is closed on one side."""
    y = np.empty_like(x)
    last = 0.0
    for i, value in enumerate(x.tolist()):
        last = min(max(last, value - half_width), value + half_width)
        y[i] = last
    return y


def friction(x: Floats, rate_per_s: float, held: float) -> Floats:
    """y' = rate (x - y) where |x - y| exceeds what friction holds, less that; else at rest."""
    y = np.empty_like(x)
    last, gain = 0.0, 1 - math.exp(-rate_per_s / RATE_HZ)
    for i, value in enumerate(x.tolist()):
        error = value - last
        if error > held:
            last += gain * (error - held)
        elif error < -held:
            last += gain * (error + held)
        y[i] = last
    return y


def over_amplitude(law: Callable[[Floats], Floats], late_s: float, what: str) -> Actuator:
    def fundamental(amplitude: float, f_hz: float) -> tuple[float, float]:
        t = np.arange(round(12 * RATE_HZ / f_hz)) / RATE_HZ
        wave = np.exp(-2j * np.pi * f_hz * t)
        y = law(amplitude * np.sin(2 * np.pi * f_hz * t))
        last = slice(round(4 * RATE_HZ / f_hz), round(12 * RATE_HZ / f_hz))
        h = complex((y * wave)[last].mean()) / complex((amplitude * np.sin(2 * np.pi * f_hz * t) * wave)[last].mean())
        return late_s - float(np.angle(h)) / (2 * np.pi * f_hz), abs(h)

    def change(motion: Motion) -> float:
        _, f_hz, _ = motion.middle_hz()
        (d_small, k_small), (d_large, k_large) = (fundamental(a, f_hz) for a in motion.amplitudes())
        return max(abs(d_small / d_large - 1), abs(k_small / k_large - 1))

    return Actuator(what, "amplitude", lambda motion: law(motion.at(late_s)), change)


def over_time(delay_s: Callable[[Floats], Floats], gain: Callable[[Floats], Floats], what: str, kind: str) -> Actuator:
    """delay and gain as functions of u = t over the record's length; a step counts where there is motion about it."""

    def measured(motion: Motion) -> Floats:
        u = np.linspace(0, 1, motion.samples.size)
        return gain(u) * motion.at(delay_s(u))

    def change(motion: Motion) -> float:
        share = np.cumsum(motion.samples**2) / (motion.samples**2).sum()
        u = np.linspace(0, 1, motion.samples.size)
        # What changes little by little does so over the whole record; a step may lie where nothing moves.
        if "step" in what:
            u = u[(share > STIRS) & (share < 1 - STIRS)]
        d, k = delay_s(u), gain(u)
        return max(float(np.ptp(d) / np.abs(d).mean()), float(np.ptp(k) / k.mean()))

    return Actuator(what, kind, measured, change)


def even(value: float) -> Callable[[Floats], Floats]:
    return lambda u: np.full_like(u, value)


def constant(rng: np.random.Generator) -> Actuator:
    delay, gain = float(rng.uniform(0.003, 0.03)), float(rng.uniform(0.85, 1.15))
    return over_time(even(delay), even(gain), f"{1e3 * delay:.1f} ms, {gain:.2f}", NO_CAUSE)


def frequency(rng: np.random.Generator) -> Actuator:
    late = float(rng.uniform(0, 0.01))
    if rng.random() < 0.6:
        return first_order(float(np.exp(rng.uniform(np.log(3), np.log(20)))), late)
    return second_order(float(rng.uniform(8, 20)), float(rng.uniform(0.4, 1.0)), late)


def amplitude(rng: np.random.Generator) -> Actuator:
    late, width = float(rng.uniform(0.003, 0.015)), float(np.exp(rng.uniform(np.log(0.1), np.log(1.0))))
    which = int(rng.integers(3))
    if which == 0:
        return over_amplitude(lambda x: dead_band(x, width), late, f"dead band {width:.2f} mm")
    if which == 1:
        return over_amplitude(lambda x: play(x, width), late, f"play {width:.2f} mm")
    rate = float(rng.uniform(60, 250))
    return over_amplitude(lambda x: friction(x, rate, width), late, f"friction {width:.2f} mm, {rate:.0f} /s")


def of_time(rng: np.random.Generator) -> Actuator:
    which = int(rng.integers(5))
    start, place = float(rng.uniform(0.008, 0.015)), float(rng.uniform(0.25, 0.5))
    if which == 0:
        start = 0.010
        return over_time(
            lambda u: np.where(u < place, start, 1.101 * start), even(0.97), f"step 10 to 11 ms at {place:.2f}", "time"
        )
    if which == 1:
        more = float(rng.uniform(1.2, 2.0))
        return over_time(lambda u: np.where(u < place, start, more * start), even(0.97), f"step {more:.2f}", "time")
    if which == 2:
        return over_time(even(start), lambda u: 1 - 0.1 * u, "gain 1 to 0.9", "time")
    if which == 3:
        less = float(rng.uniform(0.8, 0.9))
        return over_time(even(start), lambda u: np.where(u < place, 1.0, less), f"gain step {less:.2f}", "time")
    more = float(rng.uniform(1.15, 1.8))
    return over_time(lambda u: start * (1 + (more - 1) * u), lambda u: 1 - 0.08 * u, f"both drift, {more:.2f}", "time")


def clock(rng: np.random.Generator) -> Actuator:
    start, ppm = float(rng.uniform(0.008, 0.015)), float(rng.choice((-1, 1)) * rng.uniform(40, 200))
    return over_time(lambda u: start + 50e-6 * ppm * u, even(0.97), f"clock {ppm:.0f} ppm", "clock")


KINDS: dict[str, Callable[[np.random.Generator], Actuator]] = {
    "frequency": frequency,
    "amplitude": amplitude,
    "time": of_time,
    "clock": clock,
}


# Pairs ----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Pair:
    what: str
    target: Floats
    measured: Floats
    kind: str
    change: float


def fits(actuator: Actuator, motion: Motion) -> bool:
    """Whether the motion can tell this cause from the others at all."""
    if actuator.kind == "amplitude":
        return not motion.tied
    return not motion.one_way or actuator.kind not in ("time", "clock")


def noisy(rng: np.random.Generator, measured: Floats, share: float) -> Floats:
    return measured + share * measured.std() * rng.standard_normal(measured.size)


def single(kind: str, runs: int, noise: float, seed: int = 0) -> Iterator[Pair]:
    rng = np.random.default_rng([seed, len(kind), ord(kind[0])])
    made = 0
    while made < runs:
        motion, actuator = motions()[int(rng.integers(len(motions())))], KINDS[kind](rng)
        if not fits(actuator, motion) or not (change := actuator.change(motion)) > VARIES:
            continue
        made += 1
        measured = noisy(rng, actuator.measured(motion), noise)
        yield Pair(f"{motion.name}: {actuator.what}", motion.samples, measured, kind, change)


def unchanging(runs: int, noise: float, seed: int = 0, on_target: float = 0.0) -> Iterator[Pair]:
    rng = np.random.default_rng([seed, 99])
    for _ in range(runs):
        motion, actuator = motions()[int(rng.integers(len(motions())))], constant(rng)
        measured = noisy(rng, actuator.measured(motion), noise)
        target = noisy(rng, motion.samples, on_target) if on_target else motion.samples
        yield Pair(f"{motion.name}: {actuator.what}", target, measured, NO_CAUSE, 0.0)


def rehearsed(noise: float) -> Iterator[Pair]:
    """The paper's virtual tests, whose gain and delay are constant by construction."""
    rng = np.random.default_rng(5)
    for name in EARTHQUAKES:
        for test, what in ((linear(), "linear"), (nonlinear(), "Bouc-Wen")):
            run = rthstrack.simulate(test, rthstrack.record(name))
            yield Pair(f"{name} {what}", run.target[:], noisy(rng, run.measured, noise), NO_CAUSE, 0.0)


def effect(motion: Motion, measured: Floats) -> float:
    """What is left of measured by the best constant gain and delay."""
    n = motion.samples.size
    padded = np.fft.rfft(motion.samples, 2 * n), np.fft.rfft(measured, 2 * n)
    f = np.fft.rfftfreq(2 * n, 1 / RATE_HZ)

    def left(late_s: float) -> float:
        turned = padded[0] * np.exp(-2j * np.pi * f * late_s)
        gain = float((np.conj(turned) * padded[1]).real.sum() / (np.abs(turned) ** 2).sum())
        return float((np.abs(padded[1] - gain * turned) ** 2).sum())

    found = min(np.linspace(0, 0.06, 61), key=left)
    for width in (1e-3, 1e-4, 1e-5):
        found = min(found + width * np.linspace(-1, 1, 21), key=left)
    return math.sqrt(left(float(found)))


def two(runs: int, noise: float, seed: int = 0) -> Iterator[Pair]:
    """Two at once: what the second does is done to what the first made of the target."""
    rng = np.random.default_rng([seed, 7])
    made = 0
    pairs = [
        ("frequency", "amplitude"),
        ("frequency", "time"),
        ("frequency", "clock"),
        ("amplitude", "time"),
        ("amplitude", "clock"),
    ]
    while made < runs:
        motion = motions()[int(rng.integers(len(motions())))]
        names = pairs[int(rng.integers(len(pairs)))]
        one, other = (KINDS[name](rng) for name in names)
        if not (fits(one, motion) and fits(other, motion)):
            continue
        changes = [one.change(motion), other.change(motion)]
        effects = [effect(motion, a.measured(motion)) for a in (one, other)]
        if (
            max(effects) < LARGER * min(effects)
            or changes[int(np.argmax(effects))] < VARIES
            or min(changes) < VARIES / 2
        ):
            continue
        made += 1
        first = Motion(motion.name, one.measured(motion))
        # The spline of what the first made, not of the target.
        curve = CubicSpline(first.time_s, first.samples)
        second = other.measured(_Made(first.name, first.samples, curve=curve))
        kind = names[int(np.argmax(effects))]
        what = f"{motion.name}: {one.what} + {other.what} ({effects[0]:.1f}, {effects[1]:.1f})"
        yield Pair(what, motion.samples, noisy(rng, second, noise), kind, max(changes))


@dataclass(frozen=True, eq=False)
class _Made(Motion):
    curve: CubicSpline | None = None

    def at(self, later_s: Floats | float) -> Floats:
        assert self.curve is not None
        return self.curve(np.clip(self.time_s - later_s, 0.0, self.time_s[-1]))


# What is said ---------------------------------------------------------------------------------------------------------


def named(pair: Pair) -> tuple[str, str]:
    found = rthstrack.assess(pair.target, pair.measured, RATE_HZ, unit="mm")
    return found.depends_on or NO_CAUSE, found.argument


@dataclass(frozen=True)
class Tally:
    name: str
    asked: float  # share that must be right; NaN where it is only reported
    right: int
    total: int
    said: Counter[str]
    seconds: float


def sources(runs: int, noise: float, seed: int) -> dict[str, tuple[float, Callable[[], Iterator[Pair]]]]:
    found: dict[str, tuple[float, Callable[[], Iterator[Pair]]]] = {
        kind: (0.9, lambda kind=kind: single(kind, runs, noise, seed))  # type: ignore[misc]
        for kind in KINDS
    }
    found["two at once, the larger"] = (0.9, lambda: two(runs, noise, seed))
    found["constant"] = (0.98, lambda: unchanging(runs, noise, seed))
    found["constant, no noise"] = (0.98, lambda: unchanging(runs, 0.0, seed))
    found["constant, 3 % of noise on both"] = (0.98, lambda: unchanging(runs, 0.03, seed, 0.03))
    found["virtual tests of constant gain and delay"] = (0.98, lambda: rehearsed(noise))
    return found


def tally(name: str, asked: float, source: Callable[[], Iterator[Pair]], show: bool = False) -> Tally:
    said: Counter[str] = Counter()
    right = 0
    begun = time.perf_counter()
    for pair in source():
        kind, argument = named(pair)
        said[kind] += 1
        right += kind == pair.kind
        if show and kind != pair.kind:
            print(f"  {kind} for {pair.kind}, {100 * pair.change:.0f} %; {pair.what}\n     {argument}")
    return Tally(name, asked, right, said.total(), said, time.perf_counter() - begun)


@cache
def _full() -> tuple[Tally, ...]:
    return tuple(tally(name, *source) for name, source in sources(100, 0.01, 0).items())


def rows() -> list[Row]:
    """Rows of the first table of docs/accuracy.md."""
    found = [
        Row(
            f"what delay and gain depend on, noise of 1 %: {t.name}"
            if "noise" not in t.name
            else f"the same: {t.name}",
            f"right in >= {100 * t.asked:.0f} %",
            f"{100 * t.right / t.total:.0f} % of {t.total}",
            t.right >= t.asked * t.total,
            t.right / t.total,
        )
        for t in _full()
    ]
    unsaid = sum(t.said[NO_CAUSE] for t in _full() if t.name in KINDS or t.name.startswith("two"))
    case = 'what delay and gain depend on: "constant" where the variation exceeds a tenth'
    return [*found, Row(case, "never", f"{unsaid} times", unsaid == 0, unsaid)]


def section() -> str:
    """The section of docs/accuracy.md, in Markdown."""
    kinds = [*KINDS, NO_CAUSE]
    lines = [
        "## What delay and gain depend on",
        "",
        f"{len(motions())} motions: earthquake responses of one and two modes, random motion, bursts, sweeps.",
        "First and second order, dead band, play and friction, steps and drifts of delay and gain, clocks 40 to 200",
        "ppm apart; in each pair delay or gain varies by more than a tenth. How often which was named:",
        "",
        "| made | " + " | ".join(kinds) + " |",
        "| --- |" + " ---: |" * len(kinds),
        *(f"| {t.name} | " + " | ".join(str(t.said[kind]) for kind in kinds) + " |" for t in _full()),
        "",
        "On a sweep one way frequency and time are one thing, and frequency is named; where amplitude goes with",
        "frequency, likewise; neither is asked about.",
        "A delay that grows evenly at a constant gain is called a clock's, whatever made it so.",
        "",
    ]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description="Rates at which the right cause is named.")
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", default=[], help="first words of the cases")
    parser.add_argument("--show", action="store_true", help="print what was named wrongly")
    options = parser.parse_args()
    for name, (asked, source) in sources(options.runs, options.noise, options.seed).items():
        if options.only and name.split()[0].strip(",") not in options.only:
            continue
        t = tally(name, asked, source, options.show)
        mark = "met" if t.right >= asked * t.total else "MISSED"
        print(
            f"{mark}: {name}: {t.right} of {t.total}; said {dict(t.said.most_common())} ({t.seconds:.0f} s)", flush=True
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
