"""Sections 1 and 2: what the introduction says of indices, and the equations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.evaluation.indices import indices
from rthstrack.evaluation.tracking import evaluate
from rthstrack.reproduction import paper
from rthstrack.reproduction.claims.rows import (
    ENDS,
    MOST,
    TESTS,
    WORDS,
    Claim,
    component_seen,
    errors,
    in_how_many,
    in_ways,
    judged,
    ms,
    near,
    percent,
    read_run,
    seen,
    setting,
    slip,
)
from rthstrack.reproduction.far_field import WINDOWS
from rthstrack.reproduction.results import SPECTRAL

if TYPE_CHECKING:
    from rthstrack.reproduction.results import Results
    from rthstrack.virtual_test.run import Run

#: A phase beyond 90 degrees, to show what an arctangent of a ratio forgets; not the paper's.
_EXAMPLE_S, _EXAMPLE_HZ = 0.060, 4.8


def introduction(r: Results) -> Iterator[Claim]:
    """Section 1."""
    run, small = r.runs["nonlinear-chy101-n"], r.trials["nonlinear, scaled by 0.1"].run
    assert small is not None
    of_small, of_run = (indices(x.target, x.measured, x.rate_hz) for x in (small, run))
    named = ("max_tracking_error", "rms_error", "tracking_indicator")
    ratios = [getattr(of_small, name) / getattr(of_run, name) for name in named]
    other = all(abs(x - 1) > 0.1 for x in ratios)
    delays = {w: (read_run(small, w)[1], read_run(run, w)[1]) for w in WINDOWS}
    yield in_ways(
        "1",
        "the same actuator has other MTE, RMS and TI where the ground motion is scaled (and the same d)",
        "different values",
        f"nonlinear, CHY101-N times 0.1: MTE, RMS, TI times {', '.join(f'{x:.2g}' for x in ratios)}; d "
        + "; ".join(f"{WORDS[w]}: {ms(a)} for {ms(b)}" for w, (a, b) in delays.items()),
        {w: other and near(a, b, 0.02) for w, (a, b) in delays.items()},
        "indices change by more than a tenth, d by less than 2 %",
        ENDS,
    )
    worst = {w: [max(errors(component_seen(c, w), test, Q=paper.POWERS)) for c in r.far_field for test in TESTS]
             for w in WINDOWS}  # fmt: skip
    least = [max(better) < none for none, *better in zip(*worst.values(), strict=True)]
    by_record = [
        {w: max(errors(seen(r, record, w), test, Q=paper.POWERS)) for w in WINDOWS}
        for test, record in (("linear", "CHY101-N"), ("nonlinear", "CHY101-N"))
    ]
    yield in_how_many(
        r,
        "1",
        "a window lessens the effect of the spectrum leakage (both structures, Q to 512)",
        "to minimize the effect",
        "largest error of A and d, CHY101-N: "
        + "; ".join(
            f"{test} " + ", ".join(f"{WORDS[w]} {percent(e)}" for w, e in found.items())
            for test, found in zip(TESTS, by_record, strict=True)
        ),
        all(max(found["tukey"], found["hann"]) < found["none"] for found in by_record),
        least,
        MOST,
        "smaller with both windows, in three of four components and structures",
        note="the window is named nowhere in the paper, and whether its readings were made with one is not said",
    )


def formulation(r: Results) -> Iterator[Claim]:
    """Section 2."""
    run, cell = r.runs["linear-chy101-n"], r.studies[SPECTRAL].cell(source="linear-chy101-n")
    n, n_bins = run.target.size, cell.n_bins
    gain, delay_s, f_hz = 1.1, 13.7e-3, 2.0
    t = np.arange(16384) / paper.RATE_HZ
    sine, late = np.sin(2 * np.pi * f_hz * t), gain * np.sin(2 * np.pi * f_hz * (t - delay_s))
    read = evaluate(sine, late, paper.RATE_HZ, estimator="fei")
    found = float(read.amplitude), float(read.phase_rad), float(read.delay_s), float(read.equivalent_frequency_hz)
    expected = gain, -2 * np.pi * f_hz * delay_s, delay_s, f_hz
    yield judged(
        "2",
        "Eqs 2 to 6 and 10: of a sinusoid A is K, the phase -2 pi f tau, d is tau",
        "K, -2 pi f tau, tau",
        f"2 Hz, K = 1.1, tau = 13.7 ms: A = {found[0]:.6f}, phase {found[1]:.6f} rad ({expected[1]:.6f}), d = "
        f"{ms(found[2], 4)}, f_eq = {found[3]:.4f} Hz",
        all(near(a, b, 1e-9) for a, b in zip(found, expected, strict=True)),
        "1e-9",
    )
    wrapped_s = math.atan(math.tan(2 * math.pi * _EXAMPLE_HZ * _EXAMPLE_S)) / (2 * math.pi * _EXAMPLE_HZ)
    yield slip(
        "2",
        "Eqs 6b, 11b: the phase is an arctangent of Im over Re",
        "arctan(Im/Re)",
        f"a delay of {1e3 * _EXAMPLE_S:g} ms at {_EXAMPLE_HZ:g} Hz (our example) reads {1e3 * wrapped_s:.1f} ms that "
        "way",
        abs(wrapped_s - _EXAMPLE_S) > 1e-4,
        "the ratio forgets the quadrant: a phase beyond 90 degrees is read wrong; below it nothing is lost",
    )
    usable = _usable_weights(run)
    yield slip(
        "2",
        "Eq 7: l is 'the number of the displacement signal' and depends on the data length",
        "the number of the signal",
        f"with l = {n}, the samples of CHY101-N, {usable} of {n_bins} bins keep a weight that is finite and not zero",
        usable < n_bins,
        "l is a weight exponent, as the paper's last sentence on it (a value of 2) shows",
    )
    keys = ("linear-mu2035", "linear-chy101-n", "experiment-29")
    counted = [r.studies[SPECTRAL].cell(source=key).n_bins for key in keys]
    by_eq_8 = [2 ** math.ceil(math.log2(r.runs[key].target.size)) // 2 for key in keys]
    yield setting(
        "2",
        f"Eq 8: frequencies considered ({', '.join(map(str, by_eq_8))} for the three lengths)",
        "p = 2^(nextpow2(L) - 1)",
        ", ".join(map(str, counted)),
        counted == by_eq_8,
    )
    df = paper.RATE_HZ / (2 * n_bins)
    yield slip(
        "2",
        "the highest frequency is half the sampling rate and is the interval times L",
        "both",
        f"half the rate is {paper.RATE_HZ / 2:g} Hz; the interval times L is {df * n:.0f} Hz, times p {df * n_bins:g} "
        "Hz (CHY101-N)",
        df * n != paper.RATE_HZ / 2,
        "p, not L, times the interval: L is not a power of two",
    )
    yield setting(
        "2", "Eq 9: frequency interval", "fs / 2p", f"{cell.delta_f_hz:.7f} Hz (CHY101-N)", cell.delta_f_hz == df
    )
    swapped = evaluate(run.measured, run.target, run.rate_hz, estimator="fei")
    yield slip(
        "2",
        "the FEI is, in words, a weighted sum of F[I]/F[O]; in Eq 12 of F[O]/F[I]",
        "both",
        f"linear, CHY101-N (1.1, 1 ms): I over O reads A = {float(swapped.amplitude):.4f}, d = "
        f"{ms(float(swapped.delay_s))}; O over I A = {cell.amplitude:.4f}, d = {ms(cell.delay_s)}",
        not near(float(swapped.amplitude), cell.amplitude, 0.01),
        "Eq 12 is right, the sentence before it has the quotient upside down",
    )
    still = r.perfect["experiment-29"]
    perfect = evaluate(still.target, still.measured, still.rate_hz, estimator="fei")
    yield setting(
        "2",
        "perfect tracking: A = 1, d = 0",
        "1, 0",
        f"{float(perfect.amplitude):.6f}, {ms(float(perfect.delay_s))}",
        abs(float(perfect.amplitude) - 1) < 1e-9 and abs(float(perfect.delay_s)) < 1e-9,
        "the experiment with a perfect actuator",
    )
    cells = {(c.source, c.settings.weight_power): c for c in r.weight_powers.cells}
    by_power = [
        max(abs(cells[s, power].delay_error) for s in r.weight_powers.source_names)
        for power in r.weight_powers.settings.weight_powers
    ]
    yield judged(
        "2",
        "a weight power l of 2 gives good results",
        "2",
        "largest error of d on CHY101-N for l = 1 to 4: " + ", ".join(percent(e) for e in by_power),
        by_power[1] < 0.01,
        "1 %",
        note="the worse of the linear and the nonlinear structure",
        window="none",
    )


def _usable_weights(run: Run) -> int:
    """How many bins keep a finite weight other than zero if l is the number of samples."""
    n = 2 ** math.ceil(math.log2(run.target.size))
    with np.errstate(all="ignore"):
        weights = np.abs(np.fft.rfft(run.target, n)[1:]) ** float(run.target.size)
    return int(np.count_nonzero(np.isfinite(weights) & (weights > 0)))
