"""What the checks share: a row and its verdict, readings by window, counts over the far-field set, times."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

from rthstrack.evaluation.tracking import evaluate
from rthstrack.reproduction import paper
from rthstrack.reproduction.cases import CASES
from rthstrack.reproduction.far_field import OWN_FILTER, WINDOWS
from rthstrack.reproduction.results import LOWERED, ROUTES, SCIPY, SPECTRAL

if TYPE_CHECKING:
    from rthstrack.reproduction.far_field import Component
    from rthstrack.reproduction.results import Results
    from rthstrack.virtual_test.run import Run

Verdict: TypeAlias = Literal[
    "agrees", "agrees_in_paper_form", "slip", "setting", "time", "differs", "not_compared", "not_judged"
]

MEANINGS: dict[Verdict, str] = {
    "agrees": "computed anew and found as printed, within the row's tolerance",
    "agrees_in_paper_form": "found as printed with the paper's own form (its filter); ours does better",
    "slip": "the paper contradicts itself or arithmetic; the row shows by computation how",
    "setting": "a setting or definition that was taken over: it cannot fail",
    "time": "a computing time of another machine and program: not so with the same form here",
    "differs": "computed anew and not found as printed",
    "not_compared": "cannot be compared: what it would need is not printed or not to be had, or it hangs on the record",
    "not_judged": "a computing time whose repeats lie on both sides of the limit",
}

TERMS = (
    'Tolerance: stands in every row that has one; "last digit" is half a unit of the last digit printed.',
    "Window: the paper cites one (Harris 1978) for its approach and does not name it. Readings are made without "
    "a window (`none`), with `tukey` (alpha 0.5) and with `hann`; these two with the mean removed. The best "
    "verdict counts, and the column names the windows with which it stands; `any`: it is the same with each of "
    "the three.",
    "Where a record had to be replaced, the statement is judged on all 44 components of the far-field set of "
    "FEMA P695. It agrees if it holds in three of four of them and differs if in less than one of four; between "
    'these it hangs on the record and cannot be compared. "In a, b, c of 44": without a window, with tukey, '
    "with hann. The numbers of the record that stands in are given beside.",
    "Its filter: the filter of MATLAB's `decimate`, rebuilt. What the paper says of large P is judged on it.",
    "Times: of the paper's form written plainly in SciPy (decimate, transform the whole, weigh every Q-th bin), "
    "processor time of one thread, the median of ten rounds, freed of how much else the machine had to do, as "
    'shares of the time at P = Q = 1. They agree if they lie within a factor 1.5 of the printed shares; "about" '
    'is within a factor 4/3, "constant" a longest of at most 1.5 times the shortest. A statement must hold in '
    "both halves of the rounds, else it is not judged. Ours (spectral) is given beside.",
)

#: Within which factor measured shares of times count as the printed ones, times as constant, and a value as "about".
_ALIKE = _CONSTANT = 1.5
_ABOUT = 4 / 3
#: Shares of the far-field set from which a statement on a missing record agrees, and below which it differs.
MOST, FEW = 0.75, 0.25

TESTS = ("linear", "nonlinear")
#: The times of a reading that a statement on times must hold for.
HALVES = ("first_time_s", "second_time_s")
EXPERIMENTS = tuple(f"experiment-{alpha_es}" for alpha_es in paper.ALPHA_ES)
#: How each way of evaluating is called in a row.
WORDS = {"none": "no window", "tukey": "tukey", "hann": "hann", OWN_FILTER: "its filter"}
_ROUTES = {**ROUTES, OWN_FILTER: LOWERED}

#: (A, d in s) of one record by one window: of a test ("linear", "experiment-29", ...) at P and Q.
Seen: TypeAlias = Callable[[str, int, int], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Claim:
    """One statement of the paper, in our words, as printed and as found; `why` says what a difference comes from.

    by_way: the verdict of each way of evaluating, where a statement was judged in all three.
    """

    section: str
    statement: str
    printed: str
    ours: str
    verdict: Verdict
    tolerance: str = ""
    window: str = ""
    why: str = ""
    by_way: tuple[tuple[str, Verdict], ...] = ()


# Rows -----------------------------------------------------------------------------------------------------------------


def judged(
    section: str,
    statement: str,
    printed: str,
    ours: str,
    holds: bool,
    tolerance: str,
    why: str = "",
    note: str = "",
    window: str = "",
) -> Claim:
    """Agrees or differs; `why` explains a difference, `note` belongs to the row however it comes out."""
    verdict: Verdict = "agrees" if holds else "differs"
    return Claim(section, statement, printed, ours, verdict, tolerance, window, joined("" if holds else why, note))


def setting(section: str, what: str, printed: str, ours: str, same: bool, note: str = "") -> Claim:
    """Taken over from the paper or a definition; a difference would be a mistake of ours."""
    return Claim(section, what, printed, ours, "setting" if same else "differs", "last digit", "", note)


def slip(section: str, statement: str, printed: str, ours: str, shown: bool, why: str, tolerance: str = "") -> Claim:
    """A contradiction in the paper; `shown`: the computation shows it."""
    return Claim(section, statement, printed, ours, "slip" if shown else "agrees", tolerance, "", why)


def not_compared(section: str, statement: str, printed: str, ours: str, why: str) -> Claim:
    """What cannot be compared, and why."""
    return Claim(section, statement, printed, ours, "not_compared", "", "", why)


def in_ways(
    section: str,
    statement: str,
    printed: str,
    ours: str,
    held: dict[str, bool],
    tolerance: str,
    why: str = "",
    note: str = "",
) -> Claim:
    """Agrees where it holds in one of these ways; the row says in which, and `why` explains the others."""
    good = [way for way in held if held[way]]
    others = " or ".join(WORDS[way] for way in held if not held[way])
    reason = "" if not others else f"not with {others}: {why}" if good and why else why
    window = "any" if len(good) in (0, len(held)) else ", ".join(good)
    verdict: Verdict = "agrees" if good else "differs"
    by_way: tuple[tuple[str, Verdict], ...] = tuple((way, "agrees" if held[way] else "differs") for way in held)
    return Claim(section, statement, printed, ours, verdict, tolerance, window, joined(reason, note), by_way)


def timed(
    section: str,
    statement: str,
    printed: str,
    ours: str,
    holds: Callable[[str], bool],
    tolerance: str,
    why: str,
    *,
    in_tables: bool = True,
    note: str = "",
) -> Claim:
    """Judged twice: holds("first_time_s") is of one half of the rounds, holds("second_time_s") of the other.

    in_tables: whether the printed times hold it.
    """
    first, second = (holds(field) for field in HALVES)
    verdict: Verdict
    if not in_tables:
        verdict = "slip"
    elif first is not second:
        verdict = "not_judged"
    else:
        verdict = "agrees" if first else "time"
    told = {"slip": "the paper's own tables say otherwise", "not_judged": "its repeats scatter across the limit"}
    reason = joined(told.get(verdict, ""), "" if verdict == "agrees" else why)
    return Claim(section, statement, printed, ours, verdict, tolerance, "", joined(reason, note))


def by_window(
    r: Results,
    section: str,
    statement: str,
    printed: str,
    records: Sequence[str],
    check: Callable[[Seen], bool],
    words: Callable[[Seen], str],
    tolerance: str,
    why: str = "",
    note: str = "",
    ways: Sequence[str] = tuple(ROUTES),
) -> Claim:
    """A statement on A and d, judged in each way on the records at hand and, if one is missing, on all 44 components.

    The best verdict counts, and the row names the ways in which it stands.
    """
    missing = [record for record in records if stand_in(r, record)]
    ours = []
    for record in records:
        told = "; ".join(f"{WORDS[way]}: {words(seen(r, record, way))}" for way in ways)
        ours.append(f"{used_name(r, record)}: {told}" if len(records) > 1 or record in missing else told)
    counts = {way: sum(check(component_seen(c, way)) for c in r.far_field) for way in ways}
    if r.far_field:
        ours.append(f"in {', '.join(map(str, counts.values()))} of {len(r.far_field)}")
    found: dict[str, Verdict] = {}
    for way in ways:
        at_hand = all(check(seen(r, record, way)) for record in records if record not in missing)
        share_held = counts[way] / len(r.far_field) if r.far_field else (MOST + FEW) / 2
        if not at_hand or (missing and share_held < FEW):
            found[way] = "differs"
        else:
            found[way] = "not_compared" if missing and share_held < MOST else "agrees"
    verdict = next(v for v in _BEST_FIRST if v in found.values())
    stands = [way for way in ways if found[way] == verdict]
    others = [WORDS[way] for way in ways if found[way] != verdict]
    reason = "" if verdict == "agrees" and not others else why
    if verdict == "agrees" and others and why:
        reason = f"not with {' or '.join(others)}: {why}"
    hanging = "it hangs on the record" if verdict == "not_compared" else ""
    window = "none" if OWN_FILTER in ways else "any" if not others else ", ".join(stands)
    names = "; ".join(stand_in(r, record) for record in missing)
    return Claim(
        section,
        statement,
        printed,
        " | ".join(ours),
        verdict,
        tolerance,
        window,
        joined(hanging, reason, note, names),
        tuple(found.items()) if len(found) > 1 else (),
    )


_BEST_FIRST: tuple[Verdict, ...] = ("agrees", "not_compared", "differs")


def by_own_filter(
    r: Results,
    section: str,
    statement: str,
    printed: str,
    records: Sequence[str],
    check: Callable[[Seen], bool],
    words: Callable[[Seen], str],
    tolerance: str,
    why: str,
    better: Callable[[Seen], bool] | None = None,
) -> Claim:
    """A statement on large P, judged on the paper's own filter; `better`: what ours does not lose."""
    row = by_window(r, section, statement, printed, records, check, words, tolerance, why, "", (OWN_FILTER,))
    beside = "; ".join(f"{used_name(r, record)} {words(seen(r, record, 'none'))}" for record in records)
    verdict, reason = row.verdict, row.why
    if verdict == "agrees" and better is not None:
        reason = joined(why, row.why)
        if all(better(seen(r, record, "none")) for record in records):
            verdict = "agrees_in_paper_form"
    ours = f"{row.ours} | ours, without a filter: {beside}"
    return replace(row, ours=ours, verdict=verdict, why=reason)


def in_how_many(
    r: Results,
    section: str,
    statement: str,
    printed: str,
    ours: str,
    holds: bool,
    counts: Sequence[bool],
    least: float,
    tolerance: str,
    why: str = "",
    note: str = "",
) -> Claim:
    """A statement on responses: it must hold in at least this share of all components; without any, of the record."""
    if counts:
        ours = f"{ours} | in {sum(counts)} of {len(counts)}"
        holds = sum(counts) >= least * len(counts)
    return judged(section, statement, printed, ours, holds, tolerance, why, note)


def joined(*texts: str) -> str:
    """What there is of these, with semicolons between."""
    return "; ".join(text for text in texts if text)


# Readings -------------------------------------------------------------------------------------------------------------


def seen(r: Results, record: str, window: str) -> Seen:
    """What was read of a record of the paper, or of its stand-in: by window, or with the paper's own filter."""
    suffix = "" if record == "CANOGA" else f"-{record.lower()}"

    def read(test: str, P: int = 1, Q: int = 1) -> tuple[float, float]:
        cell = r.cell(_ROUTES[window], f"{test}{suffix}", P, Q)
        return cell.amplitude, cell.delay_s

    return read


def component_seen(component: Component, window: str) -> Seen:
    """The same of a component of the far-field set."""

    def read(test: str, P: int = 1, Q: int = 1) -> tuple[float, float]:
        return component.readings[window, test, P, Q]

    return read


def read_run(run: Run, window: str) -> tuple[float, float]:
    """A and d of a run by window."""
    shape, detrend = WINDOWS[window]
    found = evaluate(run.target, run.measured, run.rate_hz, estimator="fei", window=shape, detrend=detrend)
    return float(found.amplitude), float(found.delay_s)


def stand_in(r: Results, record: str) -> str:
    """Which record stands in for one of the paper's; empty where none does."""
    return r.records[record].short_remark


def case_stand_in(r: Results, key: str) -> str:
    """The same of a case."""
    return stand_in(r, CASES[key].record)


def used_name(r: Results, record: str) -> str:
    """The name of the record that was used for one of the paper's."""
    return r.records[record].motion.name if stand_in(r, record) else record


def errors(see: Seen, test: str, P: Iterable[int] = (1,), Q: Iterable[int] = (1,)) -> tuple[float, float]:
    """The largest relative errors of A and d of a simulation with known gain and delay; NaN counts as infinite."""
    found = [see(test, p, q) for p, q in itertools.product(P, tuple(Q))]
    a, d = (
        max(e if e == e else float("inf") for e in (abs(one[i] / truth - 1) for one in found))
        for i, truth in enumerate((paper.GAIN, paper.DELAY_S[test]))
    )
    return a, d


def errors_text(see: Seen, test: str, P: Iterable[int] = (1,), Q: Iterable[int] = (1,)) -> str:
    """The same in words."""
    a, d = errors(see, test, P, Q)
    return f"A {percent(a)}, d {percent(d)}"


def within(
    test: str, a: float, d: float, P: Iterable[int] = (1,), Q: Iterable[int] = (1,)
) -> tuple[Callable[[Seen], bool], Callable[[Seen], str]]:
    """Check and words of errors that stay within `a` and `d`."""
    P, Q = tuple(P), tuple(Q)

    def check(see: Seen) -> bool:
        found = errors(see, test, P, Q)
        return found[0] <= a and found[1] <= d

    return check, lambda see: errors_text(see, test, P, Q)


def drifts(see: Seen, test: str, P: Iterable[int] = (1,), Q: Iterable[int] = (1,)) -> tuple[float, float]:
    """The largest relative changes of A and d from P = Q = 1; NaN counts as infinite."""
    start = see(test, 1, 1)
    found = [see(test, p, q) for p, q in itertools.product(P, tuple(Q))]
    a, d = (max(e if e == e else float("inf") for e in (abs(one[i] / start[i] - 1) for one in found)) for i in (0, 1))
    return a, d


def drifts_text(see: Seen, test: str, P: Iterable[int] = (1,), Q: Iterable[int] = (1,)) -> str:
    """The same in words."""
    a, d = drifts(see, test, P, Q)
    return f"A by {percent(a)}, d by {percent(d)}"


def steady(
    test: str, most: float, P: Iterable[int] = (1,), Q: Iterable[int] = (1,)
) -> tuple[Callable[[Seen], bool], Callable[[Seen], str]]:
    """Check and words of A and d that stay within a share of what they are at P = Q = 1."""
    P, Q = tuple(P), tuple(Q)
    return lambda see: max(drifts(see, test, P, Q)) <= most, lambda see: drifts_text(see, test, P, Q)


def changes(see: Seen, tests: Iterable[str], P: Iterable[int] = (1,), Q: Iterable[int] = (1,)) -> tuple[float, float]:
    """The largest changes of A, and of d in seconds, from P = Q = 1."""
    P, Q = tuple(P), tuple(Q)
    pairs = [(see(test, 1, 1), see(test, p, q)) for test in tests for p in P for q in Q]
    return max(abs(c[0] - o[0]) for o, c in pairs), max(abs(c[1] - o[1]) for o, c in pairs)


def changes_text(see: Seen, tests: Iterable[str], P: Iterable[int] = (1,), Q: Iterable[int] = (1,)) -> str:
    """The same in words."""
    a, d = changes(see, tests, P, Q)
    return f"A by {a:.4f}, d by {ms(d, 2)}"


def unchanged(
    tests: Sequence[str], P: Iterable[int] = (1,), Q: Iterable[int] = (1,)
) -> tuple[Callable[[Seen], bool], Callable[[Seen], str]]:
    """Check and words of an experiment's A within 0.01 and d within 0.3 ms of P = Q = 1."""
    P, Q = tuple(P), tuple(Q)

    def check(see: Seen) -> bool:
        a, d = changes(see, tests, P, Q)
        return a <= 0.01 and d <= 0.3e-3

    return check, lambda see: changes_text(see, tests, P, Q)


UNCHANGED = "A 0.01, d 0.3 ms"


# Times ----------------------------------------------------------------------------------------------------------------


def share(r: Results, key: str, P: int, Q: int, field: str = "computing_time_s", route: str = SCIPY) -> float:
    """The time at P and Q over that at P = Q = 1."""
    return float(getattr(r.cell(route, key, P, Q), field) / getattr(r.cell(route, key), field))


def like_printed(r: Results, key: str, factors: Iterable[tuple[int, int]], field: str) -> bool:
    """Whether the shares of the paper's form here lie within a factor of the printed ones."""
    table = printed_from_one(key)
    return all(
        1 / _ALIKE <= share(r, key, *at, field) / (table[at] / table[1, 1]) <= _ALIKE for at in factors if at in table
    )


def constant(r: Results, key: str, factors: Iterable[tuple[int, int]], field: str) -> bool:
    """Whether the times of the paper's form are constant."""
    times = [float(getattr(r.cell(SCIPY, key, *at), field)) for at in factors]
    return max(times) <= _CONSTANT * min(times)


def like_then_constant(
    r: Results, key: str, early: Sequence[tuple[int, int]], late: Sequence[tuple[int, int]], field: str
) -> bool:
    """Both: like the printed shares first, then constant."""
    return like_printed(r, key, early, field) and constant(r, key, late, field)


def share_about(r: Results, key: str, at: tuple[int, int], printed: float, field: str) -> bool:
    """Whether a share of the paper's form is about the printed one."""
    return about(share(r, key, *at, field), printed)


def printed_from_one(key: str) -> dict[tuple[int, int], float]:
    """The printed times; where Q = 1 is not printed it is extrapolated from Q = 2 and 4 as constant + bins / Q."""
    table = paper.TIMES_MS[key]
    if (1, 1) in table:
        return table
    return table | {(1, 1): table[1, 2] + 2 * (table[1, 2] - table[1, 4])}


def about(value: float, printed: float) -> bool:
    """Within a factor of 4/3."""
    return 1 / _ABOUT <= value / printed <= _ABOUT


def shares_text(r: Results, key: str, factors: Sequence[tuple[int, int]]) -> str:
    """Shares of the time at P = Q = 1, by SciPy's form and ours."""
    over_p = any(P > 1 for P, _ in factors)
    named = f"{'P' if over_p else 'Q'} = {', '.join(str(P if over_p else Q) for P, Q in factors)}"
    theirs, ours = (
        ", ".join(share_text(share(r, key, *at, route=route)).removesuffix(" %") for at in factors) + " %"
        for route in (SCIPY, SPECTRAL)
    )
    return f"{named}: SciPy's form {theirs}, ours {ours}"


def share_text(value: float) -> str:
    """A share of a time in percent."""
    return f"{100 * value:.0f} %" if value >= 0.1 else f"{100 * value:.1f} %"


def shares_listed(values: Iterable[float]) -> str:
    """Several."""
    return ", ".join(f"{100 * s:.0f}" for s in values) + " %"


def saves_without_loss(
    r: Results, section: str, tests: Sequence[str], at: tuple[int, int], keys: Sequence[str]
) -> Claim:
    """'A value of 16 improves efficiency without losing accuracy': both halves are checked."""
    what = "P" if at[0] > 1 else "Q"
    records = tuple(dict.fromkeys(CASES[key].record for key in keys))
    if tests[0] in TESTS:
        check, words = steady(tests[0], 0.01, (at[0],), (at[1],))
        accuracy = "A and d 1 %"
    else:
        check, words = unchanged(tests, (at[0],), (at[1],))
        accuracy = UNCHANGED
    row = by_window(
        r, section, f"{what} = 16 saves time without a loss of accuracy, {tests[0].partition('-')[0]}", "16", records,
        check, words, f"change from P = Q = 1: {accuracy}; time: less than at P = Q = 1", ENDS,
    )  # fmt: skip
    first, second = (all(share(r, key, *at, field) < 1 for key in keys) for field in HALVES)
    times = "; ".join(f"{CASES[key].plain_label}, {shares_text(r, key, [at])}" for key in keys)
    ours = f"{row.ours} | time: {times}"
    verdict, why = row.verdict, row.why
    if verdict == "agrees" and not (first and second):
        # An inaccurate factor needs no timing.
        verdict = "time" if first is second else "not_judged"
        why = joined(f"accurate; but not faster: {FILTER if what == 'P' else WHOLE_TRANSFORM}", why)
    return replace(row, ours=ours, verdict=verdict, why=why)


#: What limits Q without a window (method.md section 4).
ENDS = "what the record's ends leave (a motion cut off, a residual displacement) is another in every bin"
WHOLE_TRANSFORM = (
    "both whole transforms are paid at every Q, and the bins weigh little beside them here; ours folds first"
)
FILTER = "here the filter costs more than the whole evaluation at P = 1; ours needs none"


# Words ----------------------------------------------------------------------------------------------------------------


def percent(value: float) -> str:
    """A relative error."""
    return f"{100 * value:.3f} %" if value < 0.1 else f"{100 * value:.2f} %"


def ms(seconds: float, digits: int = 3) -> str:
    """Seconds as ms; + 0.0 turns -0.000 into 0.000."""
    return f"{round(1e3 * seconds, digits) + 0.0:.{digits}f} ms"


def near(value: float, expected: float, relative: float) -> bool:
    """Within a relative difference."""
    return abs(value / expected - 1) <= relative


def rounds_to(value: float, printed: str) -> bool:
    """Within half a unit of the last printed digit; a tie, such as 0.03125, may be rounded either way."""
    digits = len(printed.partition(".")[2])
    return abs(value - float(printed)) <= 0.5 * 10.0**-digits * (1 + 1e-9)
