"""Estimates under attack: tones, noise on both channels, noise that changes over time, and what it all costs.

A section of docs/accuracy.md with rows of its first table. Motions and noise are those of hostile.py; the truth is
known exactly, and nothing here knows how the package comes to its numbers.

    python benchmarks/accuracy_hostile.py [--quick | --short] [--only tones both varying small cost] [--draws N]

--quick: about two minutes, a line a case as it comes. --short: some seconds, for a test.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent))
import hostile
import rthstrack
from accuracy import Row
from hostile import Floats, Motion, Periodic, unit_noise

RATE_HZ = 1024.0
GAIN = 0.95
TRUSTED: dict[str, Any] = {"estimator": "least_squares", "detrend": "mean"}
COLOURS = {"white": 0.0, "AR(0.9)": 0.9}
FREQUENCIES = (5.0, 8.0, 10.0, 12.0, 12.5, 13.0, 14.0, 15.0, 17.0, 20.0, 25.0, 30.0)
HALF_WIDTHS = (0.05, 0.1, 0.2, 0.5)
#: Of tones; -20 to +40 ms, none a whole number of samples.
DELAYS_S = (0.012, -0.020, 0.040, 0.0043, -0.0071, 0.0257)
#: Log-likelihoods: below RASH nothing may be determined, above NEEDLESS nothing may be called ambiguous.
RASH, NEEDLESS = 5.0, 20.0
#: With a delay to expect, windows whose target has this share of the record's deviation must be determined.
HEARD = 0.3
#: Windows are looked at where the target has this share of the record's deviation.
LEAST_STD = 0.05
WINDOWS_S = (1.0, 2.0, 4.0)
FRACTIONS = np.linspace(0.0, 1.0, 11)
WHOLE = "whole"


@dataclass(frozen=True)
class Size:
    """How much is computed; draws are of a case."""

    frequencies: Sequence[float] = FREQUENCIES
    shares: Sequence[float] = (0.01, 0.02, 0.05, 0.1)
    tone_draws: int = 60
    hop_s: float = 0.5
    margins: int = 4  # readings of a record and place whose likelihoods are compared
    both_shares: Sequence[float] = (0.001, 0.003, 0.01, 0.03)
    bits: Sequence[int] = (10, 12, 16)
    both_draws: int = 1000
    rates_hz: Sequence[float] = (512.0, 1024.0, 2048.0, 4096.0)
    assess_draws: int = 20
    varying_draws: int = 1000
    small_draws: int = 200
    motions: int = 4  # of those that are no tones
    rounds: int = 301


QUICK = Size(
    frequencies=(5.0, 10.0, 12.5, 14.0, 17.0, 20.0, 30.0),
    shares=(0.01, 0.1),
    tone_draws=6,
    margins=2,
    both_draws=44,
    rates_hz=(512.0, 1024.0),
    assess_draws=2,
    varying_draws=40,
    small_draws=20,
    rounds=41,
)
SHORT = replace(
    QUICK,
    frequencies=(20.0,),
    shares=(0.1,),
    tone_draws=2,
    hop_s=1.0,
    margins=1,
    both_shares=(0.003,),
    bits=(10,),
    both_draws=44,
    rates_hz=(1024.0,),
    assess_draws=1,
    varying_draws=16,
    small_draws=6,
    motions=2,
    rounds=15,
)


@dataclass
class Bench:
    """What the sections share. `tell`: each case is printed as it is done."""

    size: Size
    pool: ThreadPoolExecutor
    tell: bool = False
    rows: list[Row] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    def asked(self, case: str, asked: str, measured: str, met: bool | None = None, value: float = np.nan) -> None:
        self.rows.append(Row(case, asked, measured, None if met is None else bool(met), float(value)))
        if self.tell:
            print(f"   {'' if met is None else 'met' if met else 'MISSED'}: {case}: {measured} (asked {asked})")

    def say(self, *lines: str) -> None:
        self.lines += [*lines, ""]

    def head(self, *names: str) -> None:
        self.lines += ["| " + " | ".join(names) + " |", "| --- |" + " ---: |" * (len(names) - 1)]
        if self.tell:
            print("#", " | ".join(names))

    def case(self, *cells: str) -> None:
        self.lines.append("| " + " | ".join(cells) + " |")
        if self.tell:
            print(f"{cells[0]:32}", " | ".join(cells[1:]), flush=True)

    def repeat(self, seed: int, count: int, judge: Callable[[int, np.random.Generator], Any]) -> list[Any]:
        """What `judge` makes of each draw and its own generator."""

        def one(i: int) -> Any:
            return judge(i, np.random.Generator(np.random.PCG64([seed, i])))

        return list(self.pool.map(one, range(count)))


def with_expected(function: Callable[..., Any], *signals: Any, expected_s: float | None, **settings: Any) -> Any:
    """Calls it with the delay to expect, where there is one."""
    if expected_s is not None:
        settings["expected_delay_s"] = expected_s
    return function(*signals, **settings)


def percent(share: float) -> str:
    return f"{100 * share:.3g}"


# Tones ----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Reading:
    """One reading of a tone: over which samples, what it says."""

    place: str
    first: int
    last: int
    delay_s: float
    reason: str


def tone_motions(size: Size) -> Iterator[tuple[str, float, Motion]]:
    """Kind, the frequency whose period counts, motion."""
    for i, f in enumerate(size.frequencies):
        yield "ramped", f, hostile.ramped(f)
        yield "modulated", f, hostile.modulated(f)
        widths = HALF_WIDTHS if size.tone_draws >= 20 else (HALF_WIDTHS[i % len(HALF_WIDTHS)],)
        for width in widths:
            yield "narrow", f, hostile.narrow(f, width, seed=round(100 * f + 1000 * width))
    yield "stepped", 30.0, hostile.stepped()


def tone_readings(target: Floats, measured: Floats, size: Size, expected_s: float | None) -> Iterator[Reading]:
    """Whole record, moving windows, and a monitor at P = 1 and 8."""
    signals, n, least = (target, measured, RATE_HZ), len(target), LEAST_STD * np.std(target)
    whole = with_expected(rthstrack.evaluate, *signals, expected_s=expected_s, **TRUSTED)
    yield Reading(WHOLE, 0, n, float(whole.delay_s), str(whole.reason))
    for window_s in WINDOWS_S:
        moving = with_expected(
            rthstrack.evaluate_moving,
            *signals,
            expected_s=expected_s,
            window_s=window_s,
            hop_s=size.hop_s,
            **TRUSTED,
        )
        length, hop = round(window_s * RATE_HZ), round(size.hop_s * RATE_HZ)
        for i, (delay_s, reason) in enumerate(zip(moving.delay_s, moving.reason, strict=True)):
            first = i * hop
            if np.std(target[first : first + length]) >= least:
                yield Reading(f"{window_s:g} s", first, first + length, float(delay_s), str(reason))
    for factor in (1, 8):
        monitor = rthstrack.Monitor(
            RATE_HZ,
            update_hz=1 / size.hop_s,
            band_hz=(0, 32) if factor > 1 else None,
            data_decimation=factor,
            estimator="least_squares",
            expected_delay_s=expected_s,
        )
        found = monitor.process(target, measured)
        length = round(monitor.settings.window_s * RATE_HZ)
        for centre_s, delay_s, reason in zip(found.centre_s, found.delay_s, found.reason, strict=True):
            first = max(round(float(centre_s) * RATE_HZ) - length // 2, 0)
            yield Reading(f"monitor, P = {factor}", first, min(first + length, n), float(delay_s), str(reason))


def judged_tone(
    period_s: float, motion: Motion, colour: str, turns: hostile.Turns, size: Size, seed: int, i: int
) -> Counter[tuple[str, str]]:
    """Counts, by place, of what was read of one noisy record; draw after draw, every delay meets every noise."""
    rng = np.random.Generator(np.random.PCG64([seed, i]))
    share = size.shares[i % len(size.shares)]
    delay_s = DELAYS_S[(i // len(size.shares) + seed) % len(DELAYS_S)]
    target, clean = motion.samples(RATE_HZ), GAIN * motion.samples(RATE_HZ, delay_s)
    std, heard = share * float(np.std(clean)), HEARD * np.std(target)
    measured = clean + std * unit_noise(rng, clean.shape, COLOURS[colour])
    exact = (i // 3) % 2 == 0
    if not exact:
        target = target + std / GAIN * rng.standard_normal(clean.shape)
    found: Counter[tuple[str, str]] = Counter()
    compared: Counter[str] = Counter()
    for reading in tone_readings(target, measured, size, None):
        place, determined = reading.place, np.isfinite(reading.delay_s)
        ambiguous = "ambiguous" in reading.reason
        found[place, "n"] += 1
        found[place, "wrong"] += bool(determined and abs(reading.delay_s - delay_s) > period_s / 4)
        found[place, "ambiguous"] += ambiguous
        found[place, "otherwise"] += not determined and not ambiguous
        # A moving window may lean on the whole record, so what it determines may be ambiguous alone.
        # The likelihoods that are compared are those of an exact target.
        of_interest = exact and (ambiguous or (determined and (place == WHOLE or "monitor" in place)))
        if of_interest and compared[place, ambiguous] < size.margins:
            compared[place, ambiguous] += 1
            _, margin = turns.best(measured, std, reading.first, reading.last)
            found[place, "needless"] += ambiguous and margin > NEEDLESS
            found[place, "rash"] += determined and margin < RASH
    # Some expect the very limit of what may be expected.
    reach = float(rng.choice([-0.4, 0.4])) if rng.integers(2) else float(rng.uniform(-0.4, 0.4))
    for reading in tone_readings(target, measured, size, delay_s + reach * period_s):
        place, determined = reading.place, np.isfinite(reading.delay_s)
        found[place, "expected n"] += 1
        found[place, "expected wrong"] += bool(determined and abs(reading.delay_s - delay_s) > period_s / 4)
        if not determined and exact:
            found[place, "expected missing"] += bool(np.std(target[reading.first : reading.last]) >= heard)
    return found


PLACES = (WHOLE, *(f"{w:g} s" for w in WINDOWS_S), "monitor, P = 1", "monitor, P = 8")


def tones(bench: Bench) -> None:
    """Whole turns: what a tone allows to know is said, no more and no less."""
    size = bench.size
    bench.say(
        "### Tones and narrow bands",
        "",
        f"Gain {GAIN:g}, {RATE_HZ:g} Hz, delays of -20 to +40 ms, noise of {percent(min(size.shares))} to"
        f" {percent(max(size.shares))} % of measured's deviation, white and AR(0.9), {size.tone_draws} draws of each,"
        " half of them with as much white noise on the target (of these no likelihoods are compared)."
        " Cells: readings; of them wrong by more than a quarter of a period; ambiguous / needlessly so (the turns'"
        f" log-likelihoods, with the noise's own spectrum, more than {NEEDLESS:g} apart; up to {size.margins} of a"
        f" record looked at); rash (determined, though less than {RASH:g} apart; not of moving windows, which lean on"
        " the whole record); not determined for another reason. After the semicolon, with a delay to expect within 0.4"
        f" of a period of the truth: wrong; not determined though the target has {HEARD:g} of the record's deviation.",
    )
    bench.head("case", *PLACES)
    total: Counter[tuple[str, str]] = Counter()
    for number, (_, f, motion) in enumerate(tone_motions(size)):
        case: Counter[tuple[str, str]] = Counter()
        for c, colour in enumerate(COLOURS):
            turns, seed = hostile.Turns(motion, RATE_HZ, COLOURS[colour]), 10_000 + 3 * number + c

            def judge(
                i: int, colour: str = colour, turns: hostile.Turns = turns, seed: int = seed, motion: Motion = motion,
                period_s: float = 1 / f,
            ) -> Counter[tuple[str, str]]:  # fmt: skip
                return judged_tone(period_s, motion, colour, turns, size, seed, i)

            for one in bench.pool.map(judge, range(size.tone_draws)):
                case.update(one)
        total.update(case)
        bench.case(motion.name, *(_tone_cell(case, place) for place in PLACES))
    bench.say()
    _tone_rows(bench, total)


def _tone_cell(case: Counter[tuple[str, str]], place: str) -> str:
    n, wrong, ambiguous, needless, rash, other, late, missing = (
        case[place, key]
        for key in ("n", "wrong", "ambiguous", "needless", "rash", "otherwise", "expected wrong", "expected missing")
    )
    return f"{n}: {wrong}, {ambiguous}/{needless}, {rash}, {other}; {late}, {missing}"


def _tone_rows(bench: Bench, total: Counter[tuple[str, str]]) -> None:
    for name, places in (
        ("whole", PLACES[:1]),
        ("1, 2, 4 s windows", PLACES[1:4]),
        ("Monitor, P = 1 and 8", PLACES[4:]),
    ):
        t = Counter({key: sum(total[place, key] for place in places) for key in {k for _, k in total}})
        bench.asked(
            f"tones and narrow bands, {name}: readings off by a turn",
            "none",
            f"{t['wrong']} of {t['n'] - t['ambiguous'] - t['otherwise']} determined",
            t["wrong"] == 0,
            t["wrong"],
        )
        bench.asked(
            f"the same, {name}, a delay expected: off by a turn, not determined",
            "none, none",
            f"{t['expected wrong']}, {t['expected missing']} of {t['expected n']}",
            t["expected wrong"] == t["expected missing"] == 0,
            t["expected wrong"] + t["expected missing"],
        )
        bench.asked(
            f"the same, {name}: ambiguous where the likelihoods tell (over {NEEDLESS:g} apart), or the reverse"
            f" (below {RASH:g})",
            "none, none",
            f"{t['needless']}, {t['rash']} ({t['ambiguous']} of {t['n']} ambiguous)",
            t["needless"] == t["rash"] == 0,
            t["needless"] + t["rash"],
        )


# Intervals ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Found:
    """Estimates of many draws (rows) in one or more windows (columns)."""

    gain: Floats
    delay_s: Floats
    gain_interval: Floats
    delay_interval_s: Floats

    @staticmethod
    def of(results: Iterable[Any]) -> Found:
        columns = [(r.amplitude, r.delay_s, r.amplitude_interval, r.delay_interval_s) for r in results]
        gain, delay, gain_interval, delay_interval = (np.array(c, dtype=float) for c in zip(*columns, strict=True))
        if gain.ndim == 1:
            gain, delay = gain[:, None], delay[:, None]
            gain_interval, delay_interval = gain_interval[:, None], delay_interval[:, None]
        return Found(gain, delay, gain_interval, delay_interval)

    def taking(self, windows: NDArray[np.bool_]) -> Found:
        return Found(
            self.gain[:, windows],
            self.delay_s[:, windows],
            self.gain_interval[:, windows],
            self.delay_interval_s[:, windows],
        )

    @property
    def withheld(self) -> float:
        """Share of readings without an interval of the delay."""
        missing = np.isnan(self.delay_interval_s[..., 0])
        return float(missing.mean()) if missing.size else np.nan

    def cover(self, gain: float, delay_s: Floats | float, case: str = "") -> tuple[Cover, Cover]:
        """Of delay and gain."""
        covers = []
        for interval, truth in ((self.delay_interval_s, delay_s), (self.gain_interval, gain)):
            there = np.isfinite(interval[..., 0])
            inside = (interval[..., 0] <= truth) & (truth <= interval[..., 1])
            n = int(there.sum())
            covers.append(Cover(float(inside[there].mean()) if n else np.nan, n, case))
        return covers[0], covers[1]


@dataclass(frozen=True)
class Cover:
    """Share of intervals that hold the truth in one case, and of how many."""

    share: float
    n: int
    case: str

    @property
    def near(self) -> bool:
        """93 to 97 %; of few draws, within three standard deviations of 95 %. True where there is none to judge."""
        return self.n == 0 or bool(abs(self.share - 0.95) <= max(0.02, 3 * np.sqrt(0.05 * 0.95 / self.n)))


def asked_of_cover(bench: Bench, name: str, covers: Sequence[Cover]) -> None:
    """A row: the mean of the cases within 93 to 97 %, and each of them but for chance."""
    known = [c for c in covers if c.n]
    if not known:
        bench.asked(name, "93 to 97 %", "no interval at all", False)
        return
    low, high = min(known, key=lambda c: c.share), max(known, key=lambda c: c.share)
    mean = float(np.mean([c.share for c in known]))
    outside = sum(not c.near for c in known)
    bench.asked(
        name,
        "93 to 97 %",
        f"mean {percent(mean)} %, {percent(low.share)} ({low.case}) to {percent(high.share)} %; {outside} of"
        f" {len(known)} cases further off than chance allows",
        0.93 <= mean <= 0.97 and outside == 0,
        mean,
    )


def largest_bias(z: Floats, phase: Floats) -> float:
    """The largest value, over a fraction of a sample, of mean + cos + sin fitted to errors in standard deviations.

    z: (draws, windows), each column over its own deviation; phase: (draws,), fractions of a sample.
    """
    z = z[:, np.isfinite(z).sum(axis=0) > 10]
    z = z / np.nanstd(z, axis=0)
    design = np.stack([np.ones(len(phase)), np.cos(2 * np.pi * phase), np.sin(2 * np.pi * phase)], axis=1)
    there = np.isfinite(z)
    rows = np.broadcast_to(design[:, None, :], (*z.shape, 3))[there]
    fitted, *_ = np.linalg.lstsq(rows, z[there], rcond=None)
    mean, ripple = fitted[0], np.hypot(fitted[1], fitted[2])
    return float(abs(mean) + ripple)


# Noise on both channels -----------------------------------------------------------------------------------------------


def motions(size: Size) -> list[Periodic]:
    """Responses to an earthquake, a broad band, a sweep."""
    made = (partial(hostile.response, "5 Hz"), partial(hostile.response, "1 Hz"), hostile.broad, hostile.chirp)
    return [make() for make in made[: size.motions]]


def _both_pair(
    motion: Periodic, rate_hz: float, dirt: float | int, i: int, rng: np.random.Generator
) -> tuple[Floats, Floats, float]:
    """Target and measured with noise of a share (float) or rounded to so many bits (int), and the true delay."""
    delay_s = (7 + FRACTIONS[i % 11]) / rate_hz
    start_s = float(rng.uniform(0, 1)) / rate_hz  # rounding depends on where the samples fall
    target = motion.samples(rate_hz, start_s)
    measured = GAIN * motion.samples(rate_hz, start_s + delay_s)
    if isinstance(dirt, int):
        # Of one amplitude, or one place between two samples, rounding would make the same error in every draw.
        scale = float(rng.uniform(1.1, 1.5)) * float(np.max(np.abs(target)))
        return hostile.quantised(target, dirt, scale), hostile.quantised(measured, dirt, scale), delay_s
    noise = unit_noise(rng, (2, len(target)))
    return target + dirt * np.std(target) * noise[0], measured + dirt * np.std(measured) * noise[1], delay_s


def both(bench: Bench) -> None:
    """The same noise on both channels, fractions of a sample, rates; quantised signals; the sentence."""
    size = bench.size
    bench.say(
        "### The same noise on target and measured",
        "",
        "White, of a share of each channel's deviation, or both channels rounded to so many bits of 2.2 to 3 times"
        f" the target's peak; delays of 7 to 8 samples, eleven fractions; {size.both_draws} draws a motion, noise and"
        " rate; 30 s. Bias over sd: of the delay and the gain, the largest over the fraction of a sample of a sine"
        " fitted to the draws. Cover of delay and gain; share without an interval.",
    )
    judged = ("bias/sd, d, A", "cover, d, A, %", "none, %")
    bench.head("case", "rms error, plain FEI's, us", *judged, *(f"4 s: {word}" for word in judged))
    dirts: list[float | int] = [*size.both_shares, *size.bits]
    covers: dict[bool, list[Cover]] = {False: [], True: []}
    biases: dict[bool, list[float]] = {False: [], True: []}
    withheld: list[float] = []
    rms: dict[tuple[str, float], Floats] = {}
    for m, motion in enumerate(motions(size)):
        for (r, rate_hz), (d, dirt) in itertools.product(enumerate(size.rates_hz), enumerate(dirts)):
            bits = isinstance(dirt, int)
            if bits and motion.name.startswith("chirp"):
                continue  # of one amplitude: cycle by cycle the same roundings, which no one can tell from a gain
            judge = _both_judge(motion, rate_hz, dirt)
            draws = bench.repeat(20_000 + 1000 * m + 100 * r + d, size.both_draws, judge)
            whole, moving = Found.of(x[0] for x in draws), Found.of(x[1] for x in draws)
            # In weak windows a few steps of the converter are all there is, and rounding is no noise.
            moving = moving.taking(_strong(motion, rate_hz, 4.0, least=0.25 if bits else LEAST_STD))
            truth = np.array([x[2] for x in draws])[:, None]
            label = f"{motion.name}, {rate_hz:g} Hz, {_dirt(dirt)}"
            cells = []
            for found, where in ((whole, WHOLE), (moving, "4 s")):
                bias = [largest_bias(e, truth[:, 0] * rate_hz) for e in (found.delay_s - truth, found.gain - GAIN)]
                cover = found.cover(GAIN, truth, f"{label}, {where}")
                biases[bits] += bias
                covers[bits] += cover
                if not bits and dirt <= 0.01:
                    withheld.append(found.withheld)
                cells += [_listed(f"{b:.2f}" for b in bias), _listed(percent(c.share) for c in cover),
                          percent(found.withheld)]  # fmt: skip
            errors = np.stack([whole.gain - GAIN, whole.delay_s - truth], axis=-1)[:, 0]
            plain = np.array([x[3] for x in draws]) - np.column_stack([np.full(len(truth), GAIN), truth])
            spread = np.sqrt(np.nanmean(np.stack([errors, plain]) ** 2, axis=1))  # (trusted, plain), (gain, delay)
            if rate_hz == RATE_HZ:
                rms[motion.name, dirt] = spread
            bench.case(label, f"{1e6 * spread[0, 1]:.3g}, {1e6 * spread[1, 1]:.3g}", *cells)
    bench.say()
    # Of draws without any bias, the largest fitted value is about 3 over their root, and at most twice that.
    chance = 3 / np.sqrt(size.both_draws)
    for bits, name in ((False, f"noise of {percent(min(size.both_shares))} to {percent(max(size.both_shares))} %"),
                       (True, f"{_listed(map(str, size.bits))} bit")):  # fmt: skip
        worst = max(biases[bits])
        bench.asked(
            f"both channels, {name}: bias over sd of delay and gain, worst case",
            "<= 0.2",
            f"{worst:.2f} (by chance alone about {chance:.2f})",
            worst <= max(0.2, 2 * chance),
            worst,
        )
        asked_of_cover(bench, f"both channels, {name}: cover of delay and gain", covers[bits])
    bench.asked("both channels, up to 1 %: no interval, worst case", "<= 5 %", f"{percent(max(withheld))} %",
                max(withheld) <= 0.05, max(withheld))  # fmt: skip
    _sentences(bench, rms)


def _dirt(dirt: float | int) -> str:
    return f"{dirt} bit" if isinstance(dirt, int) else f"{percent(dirt)} %"


def _listed(values: Iterable[str]) -> str:
    return ", ".join(values)


def _both_judge(motion: Periodic, rate_hz: float, dirt: float | int) -> Callable[[int, np.random.Generator], Any]:
    def judge(i: int, rng: np.random.Generator) -> tuple[Any, Any, float, tuple[float, float]]:
        target, measured, delay_s = _both_pair(motion, rate_hz, dirt, i, rng)
        whole = rthstrack.evaluate(target, measured, rate_hz, **TRUSTED)
        moving = rthstrack.evaluate_moving(target, measured, rate_hz, window_s=4.0, hop_s=4.0, **TRUSTED)
        plain = rthstrack.evaluate(target, measured, rate_hz)
        return whole, moving, delay_s, (float(plain.amplitude), float(plain.delay_s))

    return judge


def _strong(
    motion: Periodic, rate_hz: float, window_s: float, hop_s: float | None = None, least: float = LEAST_STD
) -> NDArray[np.bool_]:
    """Windows, by default one after the other, in which the target has this share of the record's deviation."""
    x, length, hop = motion.samples(rate_hz), round(window_s * rate_hz), round((hop_s or window_s) * rate_hz)
    stds = [np.std(x[s : s + length]) for s in range(0, len(x) - length + 1, hop)]
    return np.array(stds) >= least * np.std(x)


def _sentences(bench: Bench, rms: dict[tuple[str, float], Floats]) -> None:
    """What `assess` says to use, beside what was better: `rms` errors of (trusted, plain), of (gain, delay)."""
    said, worse, count = 0, Counter[str](), 0
    known = {motion.name: motion for motion in motions(bench.size)}
    for m, (name, d) in enumerate(rms):

        def judge(i: int, rng: np.random.Generator, motion: Periodic = known[name], dirt: float | int = d) -> str:
            target, measured, _ = _both_pair(motion, RATE_HZ, dirt, 3 * i + 2, rng)
            # Which to use is asked of whoever takes the published average.
            published = rthstrack.Settings(estimator="fei")
            return str(rthstrack.assess(target, measured, RATE_HZ, settings=published).argument)

        trusted, plain = rms[name, d]
        for sentence in bench.repeat(30_000 + m, bench.size.assess_draws, judge):
            count += 1
            if sentence.startswith("use the trusted estimate"):
                said += 1
                # "... gives 0.03 ms less and 1.2 % more amplitude, ...": of what it speaks.
                gap = sentence.split(",")[0]
                about = {"gain": "% " in gap, "delay": " ms " in gap or "% " not in gap}
                bad = [n for k, n in enumerate(("gain", "delay")) if about[n] and trusted[k] > plain[k]]
                if bad:
                    worse[f"{_listed(bad)} of {name}, {_dirt(d)}"] += 1
    if bench.tell and worse:
        print("   worse:", "; ".join(f"{name} ({n})" for name, n in worse.items()))
    bench.asked(
        "both channels: 'use the trusted estimate' where it is the worse one (rms over the draws)",
        "never",
        f"{worse.total()} of {said} times that it is said, of {count}",
        not worse,
        worse.total(),
    )


# Noise that changes over time -----------------------------------------------------------------------------------------

STRENGTHS = ("stationary", "velocity", "envelope", "burst")
VARYING_SHARE, VARYING_DELAY_S = 0.01, 0.0123


def varying(bench: Bench) -> None:
    """Noise whose strength changes over time."""
    size = bench.size
    bench.say(
        "### Noise that changes over time",
        "",
        f"On measured, {percent(VARYING_SHARE)} % of its deviation over the record, {1e3 * VARYING_DELAY_S:g} ms late;"
        f" {size.varying_draws} draws. Cover of delay, gain, in percent, all windows together in which the target has"
        " 5 % of the record's deviation; in brackets the share without an interval.",
    )
    spans = (WHOLE, "4 s", "2 s", "1 s", "0.125 s")
    bench.head("case", *spans)
    covers: dict[tuple[str, bool], list[Cover]] = {}
    none: dict[tuple[str, bool], list[float]] = {}
    colours = {**COLOURS, "AR(0.99)": 0.99}
    for (m, motion), (c, colour), (k, kind) in itertools.product(
        enumerate(motions(size)[:3]), enumerate(colours), enumerate(STRENGTHS)
    ):
        target, clean = motion.samples(RATE_HZ), GAIN * motion.samples(RATE_HZ, VARYING_DELAY_S)
        if colour == "AR(0.99)" and kind != "stationary":
            continue
        shape = VARYING_SHARE * np.std(clean) * hostile.strength(kind, motion, RATE_HZ, VARYING_DELAY_S)

        def judge(
            i: int, rng: np.random.Generator, target: Floats = target, clean: Floats = clean, shape: Floats = shape,
            coefficient: float = colours[colour],
        ) -> list[Any]:  # fmt: skip
            measured = clean + shape * unit_noise(rng, clean.shape, coefficient)
            results = [rthstrack.evaluate(target, measured, RATE_HZ, **TRUSTED)]
            for span in spans[1:]:
                window_s = float(span.split()[0])
                # A record has 240 windows of 128 samples: some of them do.
                hop_s = max(window_s, 0.5)
                results.append(
                    rthstrack.evaluate_moving(target, measured, RATE_HZ, window_s=window_s, hop_s=hop_s, **TRUSTED)
                )
            return results

        draws = bench.repeat(40_000 + 1000 * m + 10 * c + k, size.varying_draws, judge)
        cells = []
        for s, span in enumerate(spans):
            found = Found.of(x[s] for x in draws)
            if span != WHOLE:
                window_s = float(span.split()[0])
                found = found.taking(_strong(motion, RATE_HZ, window_s, max(window_s, 0.5)))
            cover = found.cover(GAIN, VARYING_DELAY_S, f"{colour}, {motion.name}, {span}")
            cells.append(f"{_listed(percent(c.share) for c in cover)} ({percent(found.withheld)})")
            judged = span != "0.125 s" and (colour == "white" or (colour == "AR(0.9)" and span in (WHOLE, "4 s")))
            covers.setdefault((kind, judged), []).extend(cover)
            none.setdefault((kind, judged), []).append(found.withheld)
        bench.case(f"{motion.name}, {colour}, {kind}", *cells)
    bench.say()
    for kind in STRENGTHS:
        name = f"noise on measured, {kind}"
        asked_of_cover(bench, f"{name}: cover of delay and gain, white from 1 s, AR(0.9) from 4 s", covers[kind, True])
        withheld = max(none[kind, True])
        bench.asked(f"{name}: no interval, worst case", "<= 5 %", f"{percent(withheld)} %", withheld <= 0.05, withheld)
        rest = [c.share for c in covers[kind, False] if c.n]
        bench.asked(f"{name}: cover, shorter coloured windows, AR(0.99), 128 samples", "reported",
                    f"{percent(min(rest))} to {percent(max(rest))} %")  # fmt: skip


# Smaller things -------------------------------------------------------------------------------------------------------


def small(bench: Bench) -> None:
    """Pickup from the mains on-line, two noises at once, content too high for the rate, delays beyond the reach."""
    bench.say("### Smaller things", "")
    bench.head("case", "asked", "measured")
    for piece in (_pickup, _two_noises, _too_high, _beyond):
        piece(bench)
    bench.say()


def _small_row(bench: Bench, case: str, asked: str, measured: str, met: bool | None, value: float) -> None:
    bench.lines.append(f"| {case} | {asked} | {measured} |")
    bench.asked(case, asked, measured, met, value)


def _pickup(bench: Bench) -> None:
    for motion in motions(bench.size)[:3]:
        target, clean = motion.samples(RATE_HZ), GAIN * motion.samples(RATE_HZ, VARYING_DELAY_S)
        t, std = np.arange(len(target)) / RATE_HZ, float(np.std(clean))

        def judge(
            i: int, rng: np.random.Generator, target: Floats = target, clean: Floats = clean, t: Floats = t,
            std: float = std,
        ) -> Any:  # fmt: skip
            hum = np.sqrt(2) * 0.05 * std * np.sin(2 * np.pi * (50 + rng.uniform(-0.1, 0.1)) * t + rng.uniform(0, 7))
            measured = clean + hum + 0.002 * std * unit_noise(rng, clean.shape)
            monitor = rthstrack.Monitor(
                RATE_HZ, update_hz=1.0, band_hz=(0, 32), window="hann", data_decimation=8, estimator="least_squares"
            )
            return monitor.process(target, measured)

        draws = bench.repeat(50_000, bench.size.small_draws, judge)
        found = Found.of(draws)
        found = found.taking(_strong_readings(motion, draws[0]))
        delay, gain = found.cover(GAIN, VARYING_DELAY_S)
        _small_row(
            bench,
            f"Monitor, P = 8, Hann, 5 % pickup at 50 Hz, {motion.name}: cover of delay and gain",
            "93 to 97 %",
            f"{percent(delay.share)}, {percent(gain.share)} %, none in {percent(found.withheld)} %",
            delay.near and gain.near and found.withheld <= 0.05,
            delay.share,
        )


def _strong_readings(motion: Periodic, readings: Any) -> NDArray[np.bool_]:
    x, half = motion.samples(RATE_HZ), round(2 * RATE_HZ)
    centres = np.round(np.asarray(readings.centre_s) * RATE_HZ).astype(int)
    stds = np.array([np.std(x[max(c - half, 0) : c + half]) for c in centres])
    return np.asarray(stds >= LEAST_STD * np.std(x))


def _two_noises(bench: Bench) -> None:
    for motion in motions(bench.size)[:3]:
        target, clean = motion.samples(RATE_HZ), GAIN * motion.samples(RATE_HZ, VARYING_DELAY_S)

        def judge(i: int, rng: np.random.Generator, target: Floats = target, clean: Floats = clean) -> Any:
            noise = (unit_noise(rng, clean.shape) + unit_noise(rng, clean.shape, 0.99)) / np.sqrt(2)
            return rthstrack.evaluate(target, clean + 0.01 * np.std(clean) * noise, RATE_HZ, **TRUSTED)

        found = Found.of(bench.repeat(51_000, 2 * bench.size.small_draws, judge))
        delay, gain = found.cover(GAIN, VARYING_DELAY_S)
        _small_row(
            bench,
            f"white and AR(0.99) at once, 1 %, {motion.name}: cover of delay and gain",
            "93 to 97 %",
            f"{percent(delay.share)}, {percent(gain.share)} %, none in {percent(found.withheld)} %",
            delay.near and gain.near and found.withheld <= 0.05,
            gain.share,
        )


def _too_high(bench: Bench) -> None:
    """Interpolation between samples fails above about a third of the rate."""
    given = held = total = 0
    for i, (low, high) in enumerate([(0.36, 0.45), (0.1, 0.45), (0.01, 0.48), (0.3, 0.42)]):
        motion = hostile.broad(low * RATE_HZ, high * RATE_HZ, seconds=10.0, seed=60 + i)

        def judge(i: int, rng: np.random.Generator, motion: Periodic = motion) -> Any:
            delay_s = (7 + FRACTIONS[i % 11]) / RATE_HZ
            target, clean = motion.samples(RATE_HZ), GAIN * motion.samples(RATE_HZ, delay_s)
            measured = clean + 0.01 * np.std(clean) * unit_noise(rng, clean.shape)
            low, high = rthstrack.evaluate(target, measured, RATE_HZ, **TRUSTED).delay_interval_s
            return np.isfinite(low), low <= delay_s <= high

        draws = np.array(bench.repeat(52_000 + i, bench.size.small_draws, judge))
        given, held, total = given + draws[:, 0].sum(), held + draws[:, 1].sum(), total + len(draws)
    _small_row(
        bench,
        "content above 0.35 of the rate: an interval is given",
        "never",
        f"{given} of {total}, {held} of them hold the truth",
        given == 0,
        given,
    )


def _beyond(bench: Bench) -> None:
    wrong, total, said = 0, 0, Counter[str]()
    for motion in motions(bench.size):
        target, clean = motion.samples(RATE_HZ), GAIN * motion.samples(RATE_HZ, 0.4)

        def judge(i: int, rng: np.random.Generator, target: Floats = target, clean: Floats = clean) -> str:
            measured = clean + 0.01 * np.std(clean) * unit_noise(rng, clean.shape)
            found = rthstrack.evaluate(target, measured, RATE_HZ, **TRUSTED)
            return str(found.reason) or f"{1e3 * found.delay_s:.1f} ms"

        for reason in bench.repeat(53_000, max(bench.size.small_draws // 5, 2), judge):
            total += 1
            short = "beyond" if "beyond" in reason else reason.split(":")[-1].split(",")[0].split(";")[0]
            wrong += short != "beyond"
            said[f"{motion.name}: {short}" if short != "beyond" else short] += 1
    words = "; ".join(f"{k} ({v})" for k, v in said.items())
    _small_row(bench, "a delay of 400 ms, 250 searched: what is said", "'beyond'", words, wrong == 0, wrong)


# Cost -----------------------------------------------------------------------------------------------------------------


def cost(bench: Bench) -> None:
    """`least_squares` and `aligned` over `fei`, by turns."""
    bench.say("### Cost", "", "Medians over those of plain FEI, P = Q = 1, called by turns on one core.")
    bench.head("case", "fei, us", "least_squares / fei", "aligned / fei")
    motion = hostile.response("1 Hz")
    asked = {"least_squares": 3.5, "aligned": 4.0}
    worst: Counter[tuple[str, float]] = Counter()
    for window, first_s, last_s in (("hann", 8.0, 12.0), ("boxcar", 0.0, 30.0), ("boxcar", 8.0, 12.0)):
        for share in (0.0, 0.01):
            rng = np.random.Generator(np.random.PCG64(60_000))
            target, measured = motion.samples(RATE_HZ), GAIN * motion.samples(RATE_HZ, VARYING_DELAY_S)
            target = target + share * np.std(target) * rng.standard_normal(len(target))
            measured = measured + share * np.std(measured) * rng.standard_normal(len(measured))
            cut = slice(round(first_s * RATE_HZ), round(last_s * RATE_HZ))
            target, measured = target[cut].copy(), measured[cut].copy()
            plans = [
                rthstrack.Evaluator(len(target), RATE_HZ, estimator=e, window=window, detrend=d)
                for e, d in (("fei", "none"), ("least_squares", "mean"), ("aligned", "mean"))
            ]
            times: list[list[float]] = [[], [], []]
            for _ in range(bench.size.rounds):
                for plan, taken in zip(plans, times, strict=True):
                    begun = time.perf_counter()
                    plan.evaluate(target, measured)
                    taken.append(time.perf_counter() - begun)
            fei, *others = (statistics.median(taken) for taken in times)
            ratios = dict(zip(asked, (other / fei for other in others), strict=True))
            for name, ratio in ratios.items():
                worst[name, share] = max(worst[name, share], ratio)
            bench.case(
                f"{last_s - first_s:g} s, {window}, {'no noise' if share == 0 else '1 % on both'}",
                f"{1e6 * fei:.0f}",
                *(f"{ratio:.2f}" for ratio in ratios.values()),
            )
    bench.say()
    for (name, share), ratio in sorted(worst.items(), reverse=True):
        noise = "1 % noise on both channels" if share else "no noise"
        bench.asked(f"cost, `{name}` over `fei`, {noise}, worst case", f"<= {asked[name]:g}", f"{ratio:.2f}",
                    ratio <= asked[name], ratio)  # fmt: skip


# The section ----------------------------------------------------------------------------------------------------------

SECTIONS: dict[str, Callable[[Bench], None]] = {
    "tones": tones,
    "both": both,
    "varying": varying,
    "small": small,
    "cost": cost,
}


def computed(size: Size, only: Sequence[str] = (), tell: bool = False) -> Bench:
    """All sections, or some."""
    with ThreadPoolExecutor(2) as pool:
        bench = Bench(size, pool, tell)
        for name in only or SECTIONS:
            begun = time.perf_counter()
            SECTIONS[name](bench)
            print(f"accuracy_hostile: {name} {time.perf_counter() - begun:.0f} s", file=sys.stderr)
    return bench


@cache
def _full() -> Bench:
    return computed(Size())


def rows() -> list[Row]:
    """Rows of the first table of docs/accuracy.md."""
    return _full().rows


def section() -> str:
    """The section of docs/accuracy.md, in Markdown."""
    return "\n".join(["## Under attack", "", *_full().lines])


def main() -> int:
    parser = argparse.ArgumentParser(description="Estimates of gain and delay under attack.")
    parser.add_argument("--quick", action="store_true", help="about two minutes, a line a case")
    parser.add_argument("--short", action="store_true", help="some seconds")
    parser.add_argument("--only", nargs="*", choices=list(SECTIONS), default=[], help="sections to compute")
    parser.add_argument("--draws", type=int, help="draws a case in place of those of the size")
    a = parser.parse_args()
    size = QUICK if a.quick else SHORT if a.short else Size()
    if a.draws:
        size = replace(size, tone_draws=a.draws, both_draws=a.draws, varying_draws=a.draws, small_draws=a.draws)
    bench = computed(size, a.only, tell=a.quick or a.short)
    marks = {True: "met", False: "MISSED", None: ""}
    print()
    for row in bench.rows:
        print(f"{marks[row.met]:7} {row.case}: {row.measured} (asked: {row.asked})")
    if not (a.quick or a.short):
        print("\n".join(bench.lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
