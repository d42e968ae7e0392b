"""Bad samples: which are found, what they do to the delay, and that real motion is not called bad.

Motions, actuators and faults are written from their definitions; nothing here knows how the package finds them.

    python benchmarks/bad_samples.py [--quick]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent))
import rthstrack

Floats = NDArray[np.float64]
TRUSTED: dict[str, Any] = {"estimator": "least_squares", "detrend": "mean"}
RATE_HZ, GAIN, DELAY_S = 512.0, 0.95, 0.0137
SECONDS = 30.0
SHARES = (0.0003, 0.003, 0.01, 0.05)


REAL = (("utfsm_15Hz_0A.txt", "CHANNEL2", "CHANNEL0"), ("utfsm_chirp_0A.csv", "cmd_mm", "meas_mm"))


# Motions --------------------------------------------------------------------------------------------------------------


def broad(seed: int, low_hz: float, high_hz: float, envelope: bool) -> Callable[[Floats], Floats]:
    """A sum of sines, under an envelope or not."""
    rng = np.random.Generator(np.random.PCG64(seed))
    f, phase = rng.uniform(low_hz, high_hz, 40), rng.uniform(0, 2 * np.pi, 40)
    a = rng.rayleigh(1.0, 40) / np.sqrt(f)
    a /= np.sqrt((a**2).sum() / 2)

    def at(t: Floats) -> Floats:
        shape = (t / 6) * np.exp(1 - t / 6) * (t > 0) if envelope else 1.0
        return np.asarray(shape * (a * np.sin(2 * np.pi * np.multiply.outer(t, f) + phase)).sum(axis=1))

    return at


def motions(count: int) -> list[Callable[[Floats], Floats]]:
    bands = ((0.2, 3), (0.3, 8), (0.1, 1.5), (1, 12), (0.5, 20))
    return [broad(i, *bands[i % len(bands)], envelope=i % 2 == 0) for i in range(count)]


def pair(motion: Callable[[Floats], Floats], share: float, rng: np.random.Generator) -> tuple[Floats, Floats, float]:
    """Target, measured with white noise, and the noise's standard deviation."""
    t = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    clean = GAIN * motion(t - DELAY_S)
    std = share * float(np.std(clean))
    return motion(t), clean + std * rng.standard_normal(t.size), std


# Faults ---------------------------------------------------------------------------------------------------------------


def spikes(x: Floats, share: float, std: float, rng: np.random.Generator, other: Floats) -> Floats:
    """10 to 40 standard deviations of the noise, either way."""
    n = max(1, round(share * x.size))
    at = rng.choice(np.arange(4, x.size - 4), n, replace=False)
    y = x.copy()
    y[at] += rng.choice([-1, 1], n) * rng.uniform(10, 40, n) * std
    return y


def large_spikes(x: Floats, share: float, std: float, rng: np.random.Generator, other: Floats) -> Floats:
    """Once to five times the peak."""
    n = max(1, round(share * x.size))
    at = rng.choice(np.arange(4, x.size - 4), n, replace=False)
    y = x.copy()
    y[at] = rng.choice([-1, 1], n) * rng.uniform(1, 5, n) * np.max(np.abs(x))
    return y


def _stretch(x: Floats, share: float, std: float, rng: np.random.Generator, other: Floats) -> tuple[int, int]:
    """A stretch while the other channel moves by ten standard deviations of the noise and more."""
    n = max(3, round(share * x.size))
    for _ in range(1000):
        a = int(rng.integers(20, x.size - n - 20))
        if np.ptp(other[a : a + n]) > 12 * std and abs(x[a]) > 12 * std and np.ptp(x[a : a + n]) > 12 * std:
            break
    return a, a + n


def dropout(x: Floats, share: float, std: float, rng: np.random.Generator, other: Floats) -> Floats:
    """A stretch of zeros."""
    a, b = _stretch(x, share, std, rng, other)
    y = x.copy()
    y[a:b] = 0
    return y


def freeze(x: Floats, share: float, std: float, rng: np.random.Generator, other: Floats) -> Floats:
    """A stretch of the last value."""
    a, b = _stretch(x, share, std, rng, other)
    y = x.copy()
    y[a:b] = y[a - 1]
    return y


def clipped(x: Floats, share: float, std: float, rng: np.random.Generator, other: Floats) -> Floats:
    """5 to 30 % off the peak, one side or both."""
    cut = float(rng.uniform(0.05, 0.3))
    high, low = x.max() * (1 - cut), x.min() * (1 - cut)
    return np.clip(x, low if rng.integers(2) else -np.inf, high)


FAULTS = {
    "spike": spikes, "spike ": large_spikes, "dropout": dropout, "frozen": freeze, "clipped": clipped,
}  # fmt: skip


def found(tracking: Any) -> set[tuple[str, str]]:
    return {(b.channel, b.kind) for b in tracking.bad_samples}


def faults(count: int, tell: Callable[[str], None]) -> dict[str, tuple[float, float, int]]:
    """Kind: share told, rms error over that of the clean record, cases."""
    results = {}
    for name, fault in FAULTS.items():
        kind, told, cases = name.strip(), 0, 0
        errors: list[tuple[float, float]] = []
        for m, motion in enumerate(motions(count)):
            for s, share in enumerate(SHARES if fault is not clipped else SHARES[:1] * 2):
                for channel in ("target", "measured"):
                    rng = np.random.Generator(np.random.PCG64([m, s, len(errors)]))
                    noise = (0.001, 0.01, 0.03)[(m + s) % 3]
                    target, measured, std = pair(motion, noise, rng)
                    clean = rthstrack.evaluate(target, measured, RATE_HZ, **TRUSTED)
                    if channel == "target":
                        bad = (fault(target, share, std, rng, measured), measured)
                    else:
                        bad = (target, fault(measured, share, std, rng, target))
                    t = rthstrack.evaluate(*bad, RATE_HZ, **TRUSTED)
                    cases += 1
                    hit = (channel, kind) in found(t)
                    told += hit
                    errors.append((clean.delay_s - DELAY_S, t.delay_s - DELAY_S))
                    allowed = 5 * clean.delay_std_s
                    if not hit or not abs(errors[-1][1]) < max(allowed, abs(3 * errors[-1][0])):
                        tell(
                            f"  {name} {channel} motion {m} share {share} noise {noise}: told {sorted(found(t))},"
                            f" error {1e6 * errors[-1][1]:.1f} us, clean {1e6 * errors[-1][0]:.1f} us"
                            f" (std {1e6 * clean.delay_std_s:.1f}) {t.reason[:60]}"
                        )
        each = np.array(errors)
        there = np.isfinite(each[:, 1])
        ratio = float(np.sqrt(np.mean(each[there, 1] ** 2) / np.mean(each[there, 0] ** 2)))
        results[name] = (told / cases, ratio, cases)
        tell(f"{name}: told {told} of {cases}; rms error {ratio:.2f} of clean; {np.sum(~there)} not determined")
    return results


def held(count: int, tell: Callable[[str], None]) -> None:
    """Every 2nd to 20th sample fresh."""
    for channel in ("target", "measured"):
        for every in (2, 3, 5, 8, 10, 15, 20):
            wrong, cases, errors = 0, 0, []
            for m, motion in enumerate(motions(count)):
                rng = np.random.Generator(np.random.PCG64([m, every]))
                target, measured, _ = pair(motion, (0.0, 0.01)[m % 2], rng)
                phase = int(rng.integers(every))
                index = np.maximum(np.arange(target.size) - phase, 0) // every * every + phase
                index[:phase] = 0
                pairs = (target[index], measured) if channel == "target" else (target, measured[index])
                t = rthstrack.evaluate(*pairs, RATE_HZ, **TRUSTED)
                cases += 1
                ok = [b.every for b in t.bad_samples if b.kind == "held" and b.channel == channel] == [every]
                wrong += not ok
                errors.append(t.delay_s - DELAY_S)
                if not ok or not abs(errors[-1]) < 2e-4:
                    tell(
                        f"  held {channel} {every} motion {m}: {t.bad_samples},"
                        f" error {1e6 * errors[-1]:.1f} us {t.reason[:50]}"
                    )
            tell(
                f"held, {channel}, every {every}: {cases - wrong} of {cases} told,"
                f" rms error {1e6 * float(np.sqrt(np.nanmean(np.square(errors)))):.1f} us"
            )


# Real motion ----------------------------------------------------------------------------------------------------------


def delayed(x: Floats, rate_hz: float) -> Floats:
    """By a fraction of a sample, linearly between samples."""
    t = np.arange(x.size) / rate_hz
    return GAIN * np.interp(t - DELAY_S, t, x)


def first_order(x: Floats, rate_hz: float) -> Floats:
    """A lag of 20 ms."""
    a = np.exp(-1 / (rate_hz * 0.02))
    y = np.empty_like(x)
    state = x[0]
    for i, v in enumerate(x):
        state = a * state + (1 - a) * v
        y[i] = state
    return y


def rate_limited(x: Floats, rate_hz: float) -> Floats:
    """As fast as the whole range in a third of a second."""
    most = np.ptp(x) * 3 / rate_hz
    y = np.empty_like(x)
    state = x[0]
    for i, v in enumerate(x):
        state += np.clip(v - state, -most, most)
        y[i] = state
    return y


def sticking(x: Floats, rate_hz: float) -> Floats:
    """A dead band of a tenth of the motion: measured rests at turning points."""
    band = 0.05 * np.ptp(x)
    y = np.empty_like(x)
    state = x[0]
    for i, v in enumerate(x):
        state = max(min(state, v + band), v - band)
        y[i] = state
    return y


def shapes(rate_hz: float) -> Iterator[tuple[str, Floats]]:
    t = np.arange(round(20 * rate_hz)) / rate_hz
    for f in (0.2, 0.5, 1.0, 2.0):
        phase = f * t % 1
        yield f"square {f} Hz", np.where(phase < 0.5, 10.0, -10.0)
        yield f"triangle {f} Hz", 40 * np.abs(phase - 0.5) - 10
        yield f"sawtooth {f} Hz", 20 * phase - 10
        yield f"pulses {f} Hz", np.where(phase < 0.1, 10.0, 0.0)
        yield f"trapezoid {f} Hz", np.clip(80 * np.abs(phase - 0.5) - 20, -10, 10)
    yield "one step", np.where(t > 7, 5.0, 0.0)
    yield "step and back", np.where((t > 7) & (t < 9), 5.0, 0.0)
    yield "stairs", np.floor(t)
    yield "ramp and hold", np.interp(t, [0, 5, 8, 12, 20], [0, 0, 10, 10, -5])
    yield "sweep 0.1 to 20 Hz", np.sin(2 * np.pi * (0.1 * t + 19.9 * t**2 / 40))
    yield "sweep to a third of the rate", np.sin(2 * np.pi * (0.1 * t + rate_hz / 3 * t**2 / 40))
    yield "sine from rest", np.where(t > 2, np.sin(2 * np.pi * (t - 2)), 0.0)
    yield "sine, two stops", np.where((t > 2) & ((t < 8) | (t > 10)), np.sin(2 * np.pi * (t - 2)), 0.0)


def innocent(quick: bool) -> Iterator[tuple[str, Floats, Floats, float]]:
    actuators = {"delay": delayed, "first order": first_order, "rate limit": rate_limited, "dead band": sticking}
    for rate_hz in (100.0, 512.0, 1024.0):
        for name, x in shapes(rate_hz):
            for how, actuator in actuators.items():
                y = actuator(x, rate_hz)
                rng = np.random.Generator(np.random.PCG64(len(name)))
                noise = 0.01 * np.std(y) * rng.standard_normal(y.size)
                yield f"{name}, {how}, {rate_hz:g} Hz", x, y, rate_hz
                yield f"{name}, {how}, {rate_hz:g} Hz, noise", x, y + noise, rate_hz
                level = 20 / 2**12
                yield f"{name}, {how}, {rate_hz:g} Hz, 12 bit", *(np.round(v / level) * level for v in (x, y)), rate_hz
                yield f"{name}, {how}, {rate_hz:g} Hz, 12 bit noise", x, np.round((y + noise) / level) * level, rate_hz
    for i, motion in enumerate(motions(20)):
        rng = np.random.Generator(np.random.PCG64([1, i]))
        for noise in (0.0, 0.01, 0.1):
            target, measured, _ = pair(motion, noise, rng)
            yield f"motion {i}, noise {noise:g}", target, measured, RATE_HZ
            noisy = target + noise * np.std(target) * rng.standard_normal(target.size)
            yield f"motion {i}, noise {noise:g} on both", noisy, measured, RATE_HZ
            for bits in (8, 12):
                level = 2.2 * np.max(np.abs(target)) / 2**bits
                yield (
                    f"motion {i}, noise {noise:g}, {bits} bit",
                    *(np.round(v / level) * level for v in (noisy, measured)),
                    RATE_HZ,
                )
    t = np.arange(20 * 512) / 512.0
    for speed in (0.1, 0.01):
        for level in (0.01, 0.001):
            slow = np.round(speed * t / level) * level
            yield (
                f"quantised ramp {speed} a second, level {level}",
                slow,
                np.round(speed * (t - 0.03) / level) * level,
                512.0,
            )
    yield from far_field(2 if quick else 22)
    yield from recordings()


def far_field(count: int) -> Iterator[tuple[str, Floats, Floats, float]]:
    from rthstrack import simulate
    from rthstrack.ground_motion import record
    from rthstrack.reproduction.cases import linear, nonlinear

    for number in range(1, count + 1):
        for component in "ab":
            for kind, test in (("linear", linear()), ("Bouc-Wen", nonlinear())):
                run = simulate(test, record(number, component))
                rng = np.random.Generator(np.random.PCG64([number, ord(component)]))
                noise = 0.01 * np.std(run.measured) * rng.standard_normal(run.measured.size)
                yield f"{kind}, {number}{component}", run.target, run.measured, run.rate_hz
                yield f"{kind}, {number}{component}, noise", run.target, run.measured + noise, run.rate_hz


def recordings() -> Iterator[tuple[str, Floats, Floats, float]]:
    shared = Path(__file__).resolve().parents[2] / "shared" / "records"
    for name, target, measured in REAL:
        if (shared / name).is_file():
            recording = rthstrack.read_recording(shared / name)
            values = {c.path: np.asarray(c.values) for c in recording.channels}
            yield name, values[target], values[measured], float(recording.rate_hz or 1)


def false_finds(quick: bool, tell: Callable[[str], None]) -> tuple[int, int]:
    wrong, cases = 0, 0
    for name, target, measured, rate_hz in innocent(quick):
        t = rthstrack.evaluate(target, measured, rate_hz, **TRUSTED)
        cases += 1
        if t.bad_samples:
            wrong += 1
            tell(f"  {name}: {[(b.channel, b.kind, b.count, b.first, b.every) for b in t.bad_samples]}")
    tell(f"false finds: {wrong} of {cases}")
    return wrong, cases


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only", nargs="*", default=["faults", "held", "false"])
    args = parser.parse_args()
    count = 6 if args.quick else 20
    if "faults" in args.only:
        faults(count, print)
    if "held" in args.only:
        held(count, print)
    if "false" in args.only:
        false_finds(args.quick, print)


if __name__ == "__main__":
    main()
