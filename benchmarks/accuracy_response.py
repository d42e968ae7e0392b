"""How far gain and delay over frequency can be trusted: the section of docs/accuracy.md on frequency responses.

`frequency_response` is taken as it is by default (aligned at the trusted delay of the same draw), at the true delay, at
the alignment that `frequency_slopes` finds in the draw, and not aligned.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.interpolate
import scipy.signal

import rthstrack
from rthstrack.ground_motion import record
from rthstrack.virtual_test import Actuator, BoucWen, Spring, Structure, VirtualTest

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

ROOT = Path(__file__).resolve().parent.parent
RATE_HZ = 1024.0
DRAWS = int(os.environ.get("RTHSTRACK_DRAWS", "1000"))
#: `frequency_slopes` takes the response several times over.
SLOPE_DRAWS = max(1, DRAWS // 4)
#: Noise's standard deviation over measured's about its mean.
NOISE = 0.01
#: Bins whose target density is at least this share of the highest are judged.
JUDGED = 1e-3
STIFFNESS = 11.765e6


@dataclass(frozen=True)
class Case:
    """A pair without noise, and the frequency response that made measured of target."""

    name: str
    target: Floats
    measured: Floats
    truth: Callable[[Floats], Complexes]
    dispersion: bool = False
    #: None as by default; "slopes": what `frequency_slopes` finds in every draw.
    align_s: float | str | None = "slopes"

    @property
    def draws(self) -> int:
        return SLOPE_DRAWS if self.align_s == "slopes" else DRAWS


def constant(gain: float, delay_s: float) -> Callable[[Floats], Complexes]:
    return lambda f: gain * np.exp(-2j * np.pi * f * delay_s)


def first_order(f: Floats) -> Complexes:
    """H(z) = 1 / (29 - 28 z^-1), the actuator of the published laboratory tests."""
    return np.asarray(1 / (29 - 28 * np.exp(-2j * np.pi * f / RATE_HZ)))


def cases() -> list[Case]:
    """The paper's two structures under CHY101-N, and what the first-order actuator makes of their targets."""
    ground = record(19, "b", "farfield")
    linear = simulated(5.0, Spring(), 0.001, ground)
    bouc_wen = simulated(1.0, BoucWen(STIFFNESS), 0.005, ground)
    found = [
        Case("linear, 1 ms", *linear, constant(1.1, 0.001)),
        Case("Bouc-Wen, 5 ms", *bouc_wen, constant(1.1, 0.005)),
    ]
    for name, (target, _) in (("linear", linear), ("Bouc-Wen", bouc_wen)):
        measured = np.asarray(scipy.signal.lfilter([1.0], [29.0, -28.0], target))
        found.append(Case(f"first order, {name} target", target, measured, first_order, dispersion=True))
    return found


def simulated(
    frequency_hz: float, law: Spring | BoucWen, delay_s: float, ground: rthstrack.GroundMotion
) -> tuple[Floats, Floats]:
    structure = Structure.sdof(frequency_hz, 0.02, STIFFNESS / (2 * np.pi * frequency_hz) ** 2)
    run = rthstrack.simulate(VirtualTest(structure, (Actuator((law,), gain=1.1, delay_s=delay_s),)), ground)
    return run.target, run.measured


def noise(kind: str, n_samples: int, rng: np.random.Generator) -> Floats:
    """White, or AR(1) with coefficient 0.9; standard deviation 1."""
    white = rng.standard_normal(n_samples + 200)
    coloured = white if kind == "white" else scipy.signal.lfilter([np.sqrt(1 - 0.9**2)], [1.0, -0.9], white)
    return np.asarray(coloured[200:])


def true_delay(case: Case, f: Floats) -> Floats:
    return np.asarray(-np.unwrap(np.angle(case.truth(f))) / (2 * np.pi * f))


def judged_bins(response: rthstrack.FrequencyResponse) -> NDArray[np.bool_]:
    """Where the target has energy; not the first bin, which has no interval."""
    strong = response.target_psd >= JUDGED * response.target_psd.max()
    return np.asarray(strong & np.isfinite(response.gain_std))


def coverage(case: Case, kind: str, draws: int | None = None) -> tuple[Floats, Floats, Floats, Floats]:
    """Frequency, relative density, and the shares of draws in which gain's and delay's intervals hold the truth."""
    clean = rthstrack.frequency_response(case.target, case.measured, RATE_HZ, align_s=0.0)
    bins = judged_bins(clean)
    f = clean.frequency_hz[bins]
    truths = np.abs(case.truth(f)), true_delay(case, clean.frequency_hz)[bins]

    def draw(seed: int) -> Floats:
        rng = np.random.default_rng([2014, seed])
        measured = case.measured + NOISE * case.measured.std() * noise(kind, case.measured.size, rng)
        found = rthstrack.frequency_slopes(case.target, measured, RATE_HZ).align_s if case.align_s == "slopes" else None
        align_s = float(case.align_s) if isinstance(case.align_s, float) else found
        r = rthstrack.frequency_response(case.target, measured, RATE_HZ, align_s=align_s, dispersion=case.dispersion)
        intervals = (r.gain_interval, r.delay_interval_s)
        return np.array(
            [
                (interval[bins, 0] <= truth) & (truth <= interval[bins, 1])
                for interval, truth in zip(intervals, truths, strict=True)
            ]
        )

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        hits = sum(pool.map(draw, range(draws or case.draws)), np.zeros((2, f.size)))
    return f, clean.target_psd[bins] / clean.target_psd.max(), *(hits / (draws or case.draws))


def coverage_tables(every_case: list[Case]) -> list[str]:
    known = [
        replace(c, name=f"{c.name}, aligned at {how}", align_s=at)
        for c, d in zip(every_case[:2], (0.001, 0.005), strict=True)
        for how, at in (("it", d), ("the trusted delay of each draw, as by default", None))
    ]
    lines = [
        f"Shares of {DRAWS} draws ({SLOPE_DRAWS} where nothing is said of alignment) in which the 95 % intervals hold "
        f"the truth, in percent; noise of {100 * NOISE:g} % of measured's standard deviation, white and AR(1) with "
        f"coefficient 0.9. Listed are the bins whose target density is at least {JUDGED:g} of the highest. Unless "
        "said, each draw is aligned at what `frequency_slopes` finds in it; the intervals do not know the noise of "
        "that, nor of "
        "the correction for dispersion.",
        "",
    ]
    for case in [*known, *every_case]:
        white, coloured = coverage(case, "white"), coverage(case, "ar1")
        shares = np.array([white[2], coloured[2], white[3], coloured[3]])
        lines += [
            f"### {case.name}" + (", `dispersion=True`" if case.dispersion else ""),
            "",
            f"All bins together: {100 * shares.mean():.1f} %; "
            f"single bins {100 * shares.min():.1f} to {100 * shares.max():.1f} %.",
            "",
            "| f, Hz | density | gain, white | gain, AR(1) | delay, white | delay, AR(1) |",
            "| ---: | ---: | ---: | ---: | ---: | ---: |",
        ]
        for i, f in enumerate(white[0]):
            numbers = " | ".join(f"{100 * share:.1f}" for share in shares[:, i])
            lines.append(f"| {f:.3f} | {white[1][i]:.4f} | {numbers} |")
        lines.append("")
    return lines


#: Delays of the cases that are aligned by default, in seconds.
DELAYS_S = (0.009, 0.012, 0.065, 0.2)
#: Gain's and delay's intervals together must hold the truth in this share of all bins.
COVER = (0.93, 0.97)


def late(target: Floats, delay_s: float) -> Floats:
    """target(t - delay), by a cubic spline; it stands still outside the record."""
    room = int(RATE_HZ)
    padded = np.pad(target, room, mode="edge")
    spline = scipy.interpolate.CubicSpline(np.arange(-room, target.size + room), padded)
    return np.asarray(spline(np.arange(target.size) - delay_s * RATE_HZ))


def broad_band(n_samples: int, seed: int) -> Floats:
    """Noise of 0.3 to 30 Hz that falls with the square of frequency above 8 Hz."""
    f = np.fft.rfftfreq(n_samples, 1 / RATE_HZ)
    shape = ((f > 0.3) & (f < 30)) / (1 + (f / 8) ** 2)
    bins = np.fft.rfft(np.random.default_rng(seed).standard_normal(n_samples))
    return np.asarray(np.fft.irfft(bins * shape, n_samples))


def default_cases(every_case: list[Case]) -> list[Case]:
    """Targets of broad band, throughout and as a burst, and the two structures' own, late by each of the delays."""
    targets = {
        "broad band, 30 s": broad_band(30720, 5),
        "the same as a burst": broad_band(30720, 6) * np.hanning(30720) ** 4,
        "linear target": every_case[0].target,
        "Bouc-Wen target": every_case[1].target,
    }
    return [
        Case(name, target, late(target, delay_s), constant(1.0, delay_s), align_s=None)
        for name, target in targets.items()
        for delay_s in DELAYS_S
    ]


def default_rows(found: list[Case], draws: int) -> list[tuple[Case, float, float, float, float]]:
    """Each case with shares of intervals that hold the truth: over all bins, least of the two lowest, unaligned.

    The last is the largest share of the delay that an unaligned bin loses, without noise.
    """
    rows = []
    for case in found:
        shares, plain = ([], [])  # type: tuple[list[Floats], list[Floats]]
        for kind in ("white", "ar1"):
            shares.append(np.array(coverage(case, kind, draws)[2:]))
            plain.append(np.array(coverage(replace(case, align_s=0.0), kind, max(1, draws // 10))[2:]))
        r = rthstrack.frequency_response(case.target, case.measured, RATE_HZ, align_s=0.0)
        bins = judged_bins(r)
        lost = np.abs(r.delay_s / true_delay(case, r.frequency_hz) - 1)[bins].max()
        lowest = min(share[:, :2].min() for share in shares)
        rows.append((case, float(np.mean(shares)), float(lowest), float(np.mean(plain)), float(lost)))
    return rows


def default_table(every_case: list[Case]) -> list[str]:
    rows = default_rows(default_cases(every_case), SLOPE_DRAWS)
    low, high = COVER
    missed = [f"{c.name}" for c, share, *_ in rows if not low <= share <= high]
    lines = [
        "### As it is by default",
        "",
        f"Pure delays, {SLOPE_DRAWS} draws each of white and AR(1) noise, aligned at the trusted delay of each draw; "
        f"asked for are {100 * low:.0f} to {100 * high:.0f} % over all bins: "
        + (f"**missed** by {', '.join(missed)}." if missed else "met.")
        + " Beside it what is held without alignment, and the largest share of the delay that a bin then loses without "
        "noise: it does not depend on the delay.",
        "",
        "| target | delay, ms | all bins, % | least of the two lowest bins, % | unaligned, % | lost of the delay, % |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for case, share, lowest, plain, lost in rows:
        delay_ms = 1e3 * float(true_delay(case, np.array([1.0]))[0])
        lines.append(
            f"| {case.name} | {delay_ms:.0f} | {100 * share:.1f} | {100 * lowest:.1f} | {100 * plain:.0f} "
            f"| {100 * lost:.1f} |"
        )
    return [*lines, ""]


def alignment_table(every_case: list[Case]) -> list[str]:
    linear, bouc_wen = every_case[:2]
    lines = [
        "## What alignment gives back",
        "",
        "The largest error over those bins, without noise; late by whole samples where it is not simulated.",
        "",
        "| pair | delay, ms | gain, plain | gain, aligned | delay, plain, us | delay, aligned, us |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    pairs = [(c.name, c.target, c.measured, 1.1, d) for c, d in ((linear, 0.001), (bouc_wen, 0.005))]
    for case, samples in ((linear, 20), (linear, 92), (bouc_wen, 20), (bouc_wen, 92)):
        late = np.concatenate([np.full(samples, case.target[0]), case.target[:-samples]])
        pairs.append((f"{case.name.split(',')[0]} target", case.target, late, 1.0, samples / RATE_HZ))
    for name, target, measured, gain, delay_s in pairs:
        errors = []
        found_s = rthstrack.frequency_slopes(target, measured, RATE_HZ).align_s
        for align_s in (0.0, found_s):
            r = rthstrack.frequency_response(target, measured, RATE_HZ, align_s=align_s)
            bins = judged_bins(r)
            errors.append((np.abs(r.gain / gain - 1)[bins].max(), 1e6 * np.abs(r.delay_s - delay_s)[bins].max()))
        (gain_plain, delay_plain), (gain_aligned, delay_aligned) = errors
        lines.append(
            f"| {name} | {1e3 * delay_s:.2f} | {gain_plain:.1e} | {gain_aligned:.1e} "
            f"| {delay_plain:.3g} | {delay_aligned:.2g} |"
        )
    return [*lines, ""]


def exact_line(case: Case, s: rthstrack.FrequencySlopes) -> tuple[float, float, float, float]:
    """The weighted lines through the exact curves over the bins that were used: A, A', d, d'."""
    r = rthstrack.frequency_response(case.target, case.measured, RATE_HZ)
    inside = (r.frequency_hz >= s.band_hz[0]) & (r.frequency_hz <= s.band_hz[1])
    used = inside & (r.target_psd >= np.sort(r.target_psd[inside])[-s.n_bins])
    f, energy = r.frequency_hz[used], r.target_psd[used]
    gain = np.abs(case.truth(f))
    x = f - s.equivalent_frequency_hz
    slope, value = np.polyfit(x, gain, 1, w=np.sqrt(energy))
    delay_slope, delay = np.polyfit(x, true_delay(case, f), 1, w=np.sqrt(energy) * f * gain)
    return value, slope, delay, delay_slope


def slopes_table(every_case: list[Case]) -> list[str]:
    lines = [
        "## Slopes",
        "",
        "`frequency_slopes` on the same pairs without noise, beside the line through the exact curves with the same "
        "bins and weights, and on a real machine (`examples/data/utfsm_chirp_0A.csv`), whose truth nobody knows.",
        "",
        "| pair | | f_eq, Hz | A | A', 1/Hz | d, ms | d', ms/Hz | gain varies | delay varies |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | --- | --- |",
    ]

    def row(name: str, kind: str, f_eq: float, numbers: tuple[float, float, float, float], says: list[bool]) -> str:
        gain, gain_slope, delay, delay_slope = numbers
        verdict = " | ".join("yes" if v else "no" for v in says) if says else "|"
        return (
            f"| {name} | {kind} | {f_eq:.3f} | {gain:.5f} | {gain_slope:+.5f} | {1e3 * delay:.4f} "
            f"| {1e3 * delay_slope:+.4f} | {verdict} |"
        )

    def found(name: str, s: rthstrack.FrequencySlopes) -> str:
        numbers = (s.gain, s.gain_per_hz, s.delay_s, s.delay_s_per_hz)
        return row(name, "found", s.equivalent_frequency_hz, numbers, [s.gain_varies, s.delay_varies])

    for case in every_case:
        s = rthstrack.frequency_slopes(case.target, case.measured, RATE_HZ)
        lines.append(found(case.name, s))
        lines.append(row("", "exact", s.equivalent_frequency_hz, exact_line(case, s), []))
    recording = rthstrack.read_recording(ROOT / "examples" / "data" / "utfsm_chirp_0A.csv")
    assert recording.rate_hz is not None
    target, measured = recording["cmd_mm"].values, recording["meas_mm"].values
    for band in (None, (1.0, 5.0), (5.0, 10.0), (10.0, 15.0)):
        s = rthstrack.frequency_slopes(target, measured, recording.rate_hz, band_hz=band)
        lines.append(found("chirp" if band is None else f"chirp, {band[0]:g} to {band[1]:g} Hz", s))
    return [*lines, ""]


def section() -> str:
    """The Markdown of the section."""
    every_case = cases()
    lines = [
        "## Gain and delay over frequency",
        "",
        *default_table(every_case),
        *coverage_tables(every_case),
        *alignment_table(every_case),
        *slopes_table(every_case),
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    print(section())
