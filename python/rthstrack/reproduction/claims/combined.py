"""Section 5.1: both factors together, and the tables of computing times."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.reproduction import paper
from rthstrack.reproduction.cases import CASES
from rthstrack.reproduction.claims.frequency_decimation import RECORDS
from rthstrack.reproduction.claims.rows import (
    ENDS,
    WHOLE_TRANSFORM,
    Claim,
    Seen,
    about,
    by_window,
    case_stand_in,
    like_printed,
    not_compared,
    percent,
    setting,
    share,
    share_about,
    share_text,
    shares_text,
    slip,
    timed,
    within,
)
from rthstrack.reproduction.results import SCIPY, SPECTRAL

if TYPE_CHECKING:
    from rthstrack.reproduction.results import Results

_PAIRS = tuple(f"{kind}-{record.lower()}" for kind in ("linear", "nonlinear") for record in RECORDS)


def simulations(r: Results) -> Iterator[Claim]:
    """Section 5.1, Figs 17 to 20."""
    most = r.studies[SPECTRAL].settings.combined
    yield setting("5.1", "largest P and Q combined", "64 and 32", f"{most}", most == (64, 32))
    for name in RECORDS:
        yield by_window(
            r, "5.1, Figs 17, 18", f"errors of every combination, linear, {name}", "below 1 %", (name,),
            *within("linear", 0.01, 0.01, paper.TABLE_P, paper.TABLE_Q), "1 %",
        )  # fmt: skip
        yield by_window(
            r, "5.1, Figs 17, 18", f"A and d vary with Q and remain almost constant over P, linear, {name}",
            "Q more than P", (name,), lambda see: all(q > p for q, p in spans(see, "linear")),
            lambda see: "; ".join(
                f"{what} by {percent(q)} with Q, {percent(p)} with P"
                for what, (q, p) in zip("Ad", spans(see, "linear"), strict=True)
            ),
            "A and d both",
        )  # fmt: skip
    for key in _PAIRS:
        table = paper.TIMES_MS[key]
        yield timed(
            "5.1, Tables 1, 2", f"time falls faster with Q than with P, {CASES[key].plain_label}", "Q faster",
            f"Q = 16: {share_text(share(r, key, 1, 16))}, P = 16: {share_text(share(r, key, 16, 1))} in SciPy's form; "
            f"ours {share_text(share(r, key, 1, 16, route=SPECTRAL))} and "
            f"{share_text(share(r, key, 16, 1, route=SPECTRAL))}; the tables {share_text(table[1, 16] / table[1, 1])} "
            f"and {share_text(table[16, 1] / table[1, 1])}",
            partial(_q_faster, r, key),
            "at a factor of 16", "the order is the machine's",
            in_tables=table[1, 16] < table[16, 1], note=case_stand_in(r, key),
        )  # fmt: skip
    for name in RECORDS:
        yield by_window(
            r, "5.1, Figs 19, 20", f"P up to 64 with Q up to 16 is accurate, nonlinear, {name}", "accurate", (name,),
            *within("nonlinear", 0.01, 0.01, paper.TABLE_P, paper.TABLE_Q[:5]), "1 %", ENDS,
        )  # fmt: skip
    for key in _PAIRS:
        table = paper.TIMES_MS[key]
        number = 2 if CASES[key].kind == "nonlinear" else 1
        yield timed(
            f"5.1, Table {number}", f"P = 1, Q = 16 takes about 30 % of P = Q = 1, {CASES[key].plain_label}",
            f"30 % (Table {number}: {100 * table[1, 16] / table[1, 1]:.0f} %)", shares_text(r, key, [(1, 16)]),
            partial(share_about, r, key, (1, 16), 0.3), "a factor 4/3", WHOLE_TRANSFORM,
            in_tables=about(table[1, 16] / table[1, 1], 0.3), note=case_stand_in(r, key),
        )  # fmt: skip
    for key in _PAIRS:
        table = paper.TIMES_MS[key]
        theirs = share(r, key, 16, 16) / share(r, key, 1, 16)
        ours = share(r, key, 16, 16, route=SPECTRAL) / share(r, key, 1, 16, route=SPECTRAL)
        yield slip(
            "5.1",
            f"with Q = 16, P = 16 improves the efficiency further, {CASES[key].plain_label}",
            "faster",
            f"its own table has {table[1, 16]:g} ms for P = 1 and {table[16, 16]:g} ms for P = 16; here SciPy's form "
            f"takes {theirs:.1f} times the time of P = 1, ours {ours:.2f} times",
            table[16, 16] > table[1, 16],
            "the filter costs more than what Q = 16 leaves to save",
        )


def _q_faster(r: Results, key: str, field: str) -> bool:
    return share(r, key, 1, 16, field) < share(r, key, 16, 1, field)


def spans(see: Seen, test: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """Of A and d, relative to the truth: how far they spread over Q at the worst P, and over P at the worst Q."""
    grid = np.array([[see(test, P, Q) for Q in paper.TABLE_Q] for P in paper.TABLE_P])
    grid /= paper.GAIN, paper.DELAY_S[test]
    over_q, over_p = np.ptp(grid, axis=1).max(axis=0), np.ptp(grid, axis=0).max(axis=0)
    return (float(over_q[0]), float(over_p[0])), (float(over_q[1]), float(over_p[1]))


def tables(r: Results) -> Iterator[Claim]:
    """Tables 1 to 3."""
    lines, other = paper.TABLE_1_CHY101_LINES, paper.TIMES_MS["nonlinear-chy101-n"]
    reference = np.array([[other[P, Q] for Q in paper.TABLE_Q] for P in paper.TABLE_P])
    printed, shifted = (float(np.mean(np.abs(np.log(np.array(rows) / reference)))) for rows in (lines[1:], lines[:-1]))
    yield slip(
        "5.1, Table 1",
        "the rows beside CHY101-N belong to P = 1, 2, ... 64 as printed",
        "P = 1: 40.9 to 28.3; P = 64: 39.4 to 14.3",
        f"mean distance from Table 2's CHY101-N: {100 * printed:.0f} % as printed, {100 * shifted:.0f} % one line up",
        shifted < printed,
        "the row for P = 1 stands in the line of the Qs, every row below is one line too low, and the last repeats "
        "the first",
    )
    yield not_compared(
        "5.2, Table 3",
        "computing times with different P and Q",
        "Q = 2, 4, 8, 16, 32",
        "Q = 1 to 32",
        "without a column for Q = 1 the shares of P = Q = 1 that section 5.2 gives cannot be read from Table 3; they "
        "are extrapolated here from Q = 2 and 4",
    )
    for key, table in paper.TIMES_MS.items():
        first = (1, min(Q for _, Q in table))
        number = 3 if CASES[key].kind == "experiment" else 1 if CASES[key].kind == "linear" else 2
        shares = {
            route: [
                r.cell(route, key, *at).computing_time_s / r.cell(route, key, *first).computing_time_s for at in table
            ]
            for route in (SCIPY, SPECTRAL)
        }
        yield timed(
            f"5, Table {number}",
            f"computing times over all P and Q: {CASES[key].plain_label}",
            f"{min(table.values()):g} to {max(table.values()):g} ms, {min(table.values()) / table[first]:.2f} to "
            f"{max(table.values()) / table[first]:.2f} times the first",
            f"SciPy's form {min(shares[SCIPY]):.2f} to {max(shares[SCIPY]):.2f}; ours {min(shares[SPECTRAL]):.2f} "
            f"to {max(shares[SPECTRAL]):.2f}",
            partial(like_printed, r, key, tuple(table)),
            "factor 1.5 of every printed share",
            "filters cost more beside the transform here than they did, and bins less (supplement-2: five constants "
            "explain the printed times); folding (Q) and bins taken without a filter (P) make ours fall both ways",
        )
