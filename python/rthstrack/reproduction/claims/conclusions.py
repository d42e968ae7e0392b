"""Section 6: conclusions and the future work, which is done."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.evaluation.factors import key_frequencies
from rthstrack.evaluation.monitor import Monitor
from rthstrack.evaluation.settings import Settings
from rthstrack.evaluation.tracking import evaluate
from rthstrack.reproduction import paper
from rthstrack.reproduction.claims.combined import spans
from rthstrack.reproduction.claims.frequency_decimation import RECORDS
from rthstrack.reproduction.claims.rows import (
    ENDS,
    TESTS,
    WHOLE_TRANSFORM,
    WORDS,
    Claim,
    about,
    by_window,
    errors,
    errors_text,
    ms,
    percent,
    seen,
    share,
    share_text,
    shares_listed,
    slip,
    timed,
)
from rthstrack.reproduction.results import SCIPY, SPECTRAL

if TYPE_CHECKING:
    from rthstrack.reproduction.results import Results

_KEYS = tuple(f"{kind}-{record.lower()}" for kind in TESTS for record in RECORDS)
_P, _Q = (1, 2, 4, 8, 16, 32), paper.TABLE_Q


def conclusions(r: Results) -> Iterator[Claim]:
    """Section 6, what was found."""
    yield by_window(
        r, "6", "nonlinear behaviour does not affect the approach with decimation (P below 64, Q up to 32)",
        "does not affect", RECORDS,
        lambda see: max(errors(see, "nonlinear", _P) + errors(see, "nonlinear", Q=_Q)) <= 0.01,
        lambda see: f"P: {errors_text(see, 'nonlinear', _P)}, Q: {errors_text(see, 'nonlinear', Q=_Q)}", "1 %", ENDS,
    )  # fmt: skip
    yield _q_matters_more(r)
    table = paper.TIMES_MS["linear-chy101-n"]
    plain = {w: seen(r, "CHY101-N", w) for w in ("none", "tukey")}
    told = "; ".join(
        f"{WORDS[w]}: P = 16 {percent(errors(see, 'nonlinear', (16,))[1])}, Q = 16 "
        f"{percent(errors(see, 'nonlinear', Q=(16,))[1])}, Q = 128 {percent(errors(see, 'nonlinear', Q=(128,))[1])}"
        for w, see in plain.items()
    )
    yield slip(
        "6",
        "take P = 16, and if that is too slow a Q larger than 16",
        "P = 16, then Q > 16",
        f"Table 1: Q = 16 takes {share_text(table[1, 16] / table[1, 1])}, P = 16 "
        f"{share_text(table[16, 1] / table[1, 1])}; error of d, nonlinear CHY101-N: {told}",
        table[1, 16] < table[16, 1],
        "P and Q are exchanged: section 5.1 recommends Q = 16, then P = 16, because Q saves more time",
    )
    printed = [1 - min(paper.TIMES_MS[k].values()) / paper.TIMES_MS[k][1, 1] for k in _KEYS]

    def savings(field: str, route: str = SCIPY) -> list[float]:
        return [1 - min(share(r, k, P, Q, field, route) for P in paper.TABLE_P for Q in paper.TABLE_Q) for k in _KEYS]

    yield timed(
        "6", "the two techniques save as much as 60 % of the time", "60 %",
        f"{shares_listed(savings('computing_time_s'))} in SciPy's form, "
        f"{shares_listed(savings('computing_time_s', SPECTRAL))} ours; the paper's tables {shares_listed(printed)}",
        lambda field: about(max(savings(field)), 0.6), "a factor 4/3", WHOLE_TRANSFORM,
        in_tables=about(max(printed), 0.6), note="section 5.2 says 40 %",
    )  # fmt: skip


def _q_matters_more(r: Results) -> Claim:
    """Accuracy, of A and d, of both structures; and efficiency, by the printed times."""
    row = by_window(
        r, "6", "Q has more influence on accuracy and efficiency than P, both structures", "more influence", RECORDS,
        lambda see: all(q > p for test in TESTS for q, p in spans(see, test)),
        lambda see: ", ".join(
            f"{test} {what} by {percent(q)} with Q, {percent(p)} with P"
            for test in TESTS
            for what, (q, p) in zip("Ad", spans(see, test), strict=True)
        ),
        "accuracy: A and d, each more with Q up to 32 than with P up to 64; efficiency: all four printed tables",
    )  # fmt: skip
    faster = [paper.TIMES_MS[key][1, 16] < paper.TIMES_MS[key][16, 1] for key in _KEYS]
    ours = f"{row.ours} | printed: Q = 16 is faster than P = 16 in {sum(faster)} of {len(faster)} tables"
    return replace(row, ours=ours, verdict=row.verdict if all(faster) else "differs")


def future_work(r: Results) -> Iterator[Claim]:
    """Section 6, what the authors wished for, each tried on a test of known gain and delay."""
    tukey = Settings(estimator="fei", window="tukey", detrend="mean")
    for what, name, delay_s, where in (
        ("more complicated nonlinear properties, as stiffness degradation", "degrading", 5e-3, "Baber-Wen specimen"),
        ("multiple degrees of freedom", "three storeys", 1e-3, "a shear building of three storeys, lowest actuator"),
    ):
        run = r.trials[name].run
        if run is None:
            yield _done(what, f"{where}: unstable", (math.nan, math.nan), delay_s, "docs/virtual-tests.md", "tukey")
            continue
        target, measured = (x.reshape(len(x), -1)[:, 0] for x in (run.target, run.measured))
        found = evaluate(target, measured, run.rate_hz, tukey)
        read = float(found.amplitude), float(found.delay_s)
        yield _done(what, f"{where}, CHY101-N", read, delay_s, "docs/virtual-tests.md", "tukey")
    run = r.runs["nonlinear-chy101-n"]
    key = key_frequencies(run.target, run.rate_hz, 0.99, tukey)
    at_key = key.evaluate(run.target, run.measured)
    n_bins = r.studies[SPECTRAL].cell(source="nonlinear-chy101-n").n_bins
    yield _done(
        "selecting some key frequencies",
        f"nonlinear, CHY101-N, {len(key.frequency_hz)} of {n_bins} bins, which hold 99 % of the weight",
        (float(at_key.amplitude), float(at_key.delay_s)), 5e-3, "docs/accuracy.md", "tukey",
    )  # fmt: skip
    monitor = Monitor(run.rate_hz, window_s=4.0, update_hz=4.0, estimator="least_squares", minimum_amplitude=1e-3)
    readings = monitor.process(run.target, run.measured)
    worst = [
        float(x[np.abs(x / truth - 1).argmax()])
        for x, truth in ((readings.amplitude[readings.valid], paper.GAIN), (readings.delay_s[readings.valid], 5e-3))
    ]
    yield _done(
        "on-line actuator tracking assessment",
        f"nonlinear, CHY101-N, the worst of {int(readings.valid.sum())} readings of a monitor, windows of 4 s, least "
        "squares",
        (worst[0], worst[1]), 5e-3, "docs/online.md", "none",
    )  # fmt: skip


def _done(what: str, how: str, read: tuple[float, float], delay_s: float, where: str, window: str) -> Claim:
    """One wish: nothing is printed to compare it with, but it must read what was simulated."""
    a, d = read
    good = abs(a / paper.GAIN - 1) <= 0.01 and abs(d / delay_s - 1) <= 0.01
    return Claim(
        "6",
        f"future work: {what}",
        "future work",
        f"{how}: A = {a:.4f} (1.1), d = {ms(d)} ({1e3 * delay_s:g} ms)",
        "not_compared" if good else "differs",
        "1 % of what was simulated",
        window,
        f"done here; the paper has no number for it; {where}" if good else f"not read right; {where}",
    )
