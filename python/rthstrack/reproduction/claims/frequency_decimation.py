"""Section 4.1: frequency decimation Q, the linear and the nonlinear structure."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from rthstrack.reproduction import paper
from rthstrack.reproduction.cases import CASES
from rthstrack.reproduction.claims.rows import (
    ENDS,
    WHOLE_TRANSFORM,
    Claim,
    Seen,
    about,
    by_window,
    case_stand_in,
    errors,
    errors_text,
    like_then_constant,
    rounds_to,
    saves_without_loss,
    setting,
    share_about,
    shares_text,
    slip,
    timed,
    within,
)
from rthstrack.reproduction.results import SPECTRAL

if TYPE_CHECKING:
    from rthstrack.reproduction.results import Results

RECORDS = ("MU2035", "CHY101-N")
_ABOVE_32, _ABOVE_128 = (64, 128, 256, 512), (256, 512)


def general(r: Results) -> Iterator[Claim]:
    """Section 4 and 4.1."""
    n = 2 ** math.ceil(math.log2(20 * paper.RATE_HZ)) // 2
    yield slip(
        "4",
        "frequencies to be weighed for 20 s of ground motion",
        "as high as 10240",
        f"{n} by Eq 8 (1024 Hz)",
        n != 10240,
        "10240 is half the number of samples; Eq 8 pads to the next power of two",
    )
    cells = [r.studies[SPECTRAL].cell(source="linear-chy101-n", Q=Q) for Q in (1, 2)]
    yield setting(
        "4", "Q = 2 keeps one frequency of two", "half", f"{cells[0].n_bins} and {cells[1].n_bins}",
        cells[1].n_bins * 2 == cells[0].n_bins,
    )  # fmt: skip
    highest = cells[0].highest_frequency_hz
    yield setting("4.1", "highest frequency with P = 1", "512 Hz", f"{highest:g} Hz", highest == 512)


def interval_list(r: Results, section: str, record: str, key: str) -> Claim:
    """A printed list of frequency intervals, doubled on from a rounded one."""
    found = [r.studies[SPECTRAL].cell(source=key, Q=Q).delta_f_hz for Q in paper.POWERS]
    printed = paper.INTERVAL_HZ[record]
    wrong = [p for f, p in zip(found, printed, strict=True) if not rounds_to(f, p)]
    last = 2 * float(printed[-2])
    why = f"a rounded interval was doubled on; not Q rate/2p to the digits printed: {', '.join(wrong)}"
    if not rounds_to(last, printed[-1]):
        why += f"; the last is not even twice the one before ({last:.4f})"
    return slip(
        section,
        f"frequency intervals for Q = 1 to 512, {record if record != 'CANOGA' else 'the experiment'}",
        ", ".join(printed) + " Hz",
        ", ".join(f"{f:.7g}" for f in found) + " Hz",
        bool(wrong),
        "; ".join(t for t in (why, case_stand_in(r, key)) if t),
        "last digit",
    )


def linear_by_q(r: Results) -> Iterator[Claim]:
    """Section 4.1.1."""
    for name in RECORDS:
        yield interval_list(r, "4.1.1", name, f"linear-{name.lower()}")
    for name in RECORDS:
        yield by_window(
            r, "4.1.1, Fig 11", f"Q from 2 to 512: A almost the same, d within 0.5 %, linear, {name}", "0.5 %", (name,),
            *within("linear", 0.005, 0.005, Q=paper.POWERS[1:]), "0.5 %", ENDS,
        )  # fmt: skip
    yield by_window(
        r, "4.1.1, Fig 11", "both records give almost the same results for Q from 1 to 128, linear", "almost the same",
        RECORDS, *within("linear", 0.01, 0.01, Q=paper.POWERS[:8]), "1 % of the truth", ENDS,
    )  # fmt: skip
    yield by_window(
        r, "4.1.1, Fig 11", "results start to deviate from the truth for large Q, on each record, linear",
        "larger than 256", RECORDS, _deviates,
        lambda see: (
            f"to 128: {errors_text(see, 'linear', Q=paper.POWERS[:8])}, from 256: "
            f"{errors_text(see, 'linear', Q=_ABOVE_128)}"
        ),
        "more than 0.1 %, and twice that up to Q = 128", "a window takes away most of what differs from bin to bin",
    )  # fmt: skip
    for name in RECORDS:
        yield from _times(r, f"linear-{name.lower()}", "4.1.1, Fig 12", quarter=True)
    yield saves_without_loss(r, "4.1.1", ("linear",), (1, 16), ("linear-mu2035", "linear-chy101-n"))


def _deviates(see: Seen) -> bool:
    """Above Q = 128 more than 0.1 % off, and twice as far as up to it."""
    before, after = (max(errors(see, "linear", Q=Q)) for Q in (paper.POWERS[:8], _ABOVE_128))
    return after > max(0.001, 2 * before)


def nonlinear_by_q(r: Results) -> Iterator[Claim]:
    """Section 4.1.2."""
    for name in RECORDS:
        yield by_window(
            r, "4.1.2, Fig 13", f"errors for Q below 32, nonlinear, {name}", "below 0.1 % for A and d", (name,),
            *within("nonlinear", 1e-3, 1e-3, Q=(1, 2, 4, 8, 16)), "0.1 %", ENDS,
        )  # fmt: skip
        yield by_window(
            r, "4.1.2, Fig 13", f"errors for Q above 32, nonlinear, {name}", "0.1 % for A, 1 % for d", (name,),
            *within("nonlinear", 1e-3, 1e-2, Q=_ABOVE_32), "A 0.1 %, d 1 %", ENDS,
        )  # fmt: skip

        def rises(see: Seen) -> bool:
            below = max(errors(see, "nonlinear", Q=paper.TABLE_Q))
            return max(errors(see, "nonlinear", Q=_ABOVE_32)) >= 2 * below

        yield by_window(
            r, "4.1.2", f"errors rise substantially above Q = 32, nonlinear, {name}", "no larger than 32",
            (name,), rises,
            lambda see: (
                f"to 32: {errors_text(see, 'nonlinear', Q=paper.TABLE_Q)}, above: "
                f"{errors_text(see, 'nonlinear', Q=_ABOVE_32)}"
            ),
            "above at least twice that up to 32", "with a window the larger error grows by less than that",
        )  # fmt: skip
        yield from _times(r, f"nonlinear-{name.lower()}", "4.1.2, Fig 14", quarter=False)
    yield saves_without_loss(r, "4.1.2", ("nonlinear",), (1, 16), ("nonlinear-mu2035", "nonlinear-chy101-n"))


def _times(r: Results, key: str, section: str, quarter: bool) -> Iterator[Claim]:
    test, record = CASES[key].kind, CASES[key].record
    early, late = [(1, Q) for Q in (2, 4, 8, 16)], [(1, Q) for Q in (16, 32, 64, 128, 256, 512)]
    table = paper.TIMES_MS[key]
    note = case_stand_in(r, key)
    yield timed(
        section, f"time falls with Q up to 16 and is constant above, {test}, {record}", "falls, then constant",
        shares_text(r, key, [(1, Q) for Q in (2, 16, 512)]),
        partial(like_then_constant, r, key, early, late),
        "factor 1.5 of the printed shares; 1.5 above", WHOLE_TRANSFORM, note=note,
    )  # fmt: skip
    if quarter:
        yield timed(
            section, f"Q = 16 takes about 25 % of the time, {test}, {record}",
            f"25 % (Table 1: {100 * table[1, 16] / table[1, 1]:.0f} %)", shares_text(r, key, [(1, 16)]),
            partial(share_about, r, key, (1, 16), 0.25), "a factor 4/3", WHOLE_TRANSFORM,
            in_tables=about(table[1, 16] / table[1, 1], 0.25), note=note,
        )  # fmt: skip
