"""Section 3.1: data decimation P, the linear and the nonlinear structure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.reproduction import paper
from rthstrack.reproduction.cases import Trial
from rthstrack.reproduction.claims.rows import (
    ENDS,
    FILTER,
    MOST,
    TESTS,
    WORDS,
    Claim,
    Seen,
    about,
    by_own_filter,
    by_window,
    constant,
    errors,
    errors_text,
    in_how_many,
    in_ways,
    judged,
    like_printed,
    ms,
    near,
    not_compared,
    read_run,
    rounds_to,
    saves_without_loss,
    setting,
    share,
    share_about,
    shares_text,
    slip,
    stand_in,
    steady,
    timed,
    used_name,
    within,
)
from rthstrack.reproduction.far_field import WINDOWS, discrepancy, largest_indicator
from rthstrack.reproduction.paper_form import order_of_matlab
from rthstrack.reproduction.results import CHEBYSHEV, LOWERED, SCIPY, SPECTRAL
from rthstrack.virtual_test.parts import BoucWen

if TYPE_CHECKING:
    from rthstrack.reproduction.results import Results

RECORDS = ("MU2035", "CHY101-N")
_BELOW_64, _BELOW_128, _ABOVE_128 = (1, 2, 4, 8, 16, 32), (1, 2, 4, 8, 16, 32, 64), (256, 512)
_EARLY, _LATE = [(P, 1) for P in (2, 4, 8, 16)], [(P, 1) for P in (16, 32, 64, 128, 256, 512)]


def general(r: Results) -> Iterator[Claim]:
    """Section 3, before 3.1."""
    yield not_compared("3", "sampling rates of up-to-date equipment", "up to 2048 Hz", "-", "a remark on equipment")
    cells = [
        r.studies[route].cell(source="linear-chy101-n", P=P) for route in (SPECTRAL, CHEBYSHEV) for P in paper.POWERS
    ]
    same = len({c.delta_f_hz for c in cells}) == 1
    yield setting(
        "3",
        "P lowers the highest frequency and leaves the interval",
        "unchanged",
        f"interval {cells[0].delta_f_hz:.7f} Hz for every P" if same else "interval changes",
        same,
    )
    table = paper.TIMES_MS["linear-mu2035"]
    yield slip(
        "3",
        "a greater P is more efficient",
        "higher efficiency",
        f"Table 1, MU2035, Q = 2: {table[1, 2]:g} ms for P = 1, {table[2, 2]:g} for P = 2, {table[64, 2]:g} for P = 64",
        table[2, 2] > table[1, 2],
        "true only of Q = 1 and only up to P = 8 or 16: from Q = 2 on the filter costs more than it saves",
    )


def linear_structure(r: Results) -> Iterator[Claim]:
    """Section 3.1.1, the tests."""
    run = r.runs["linear-chy101-n"]
    structure = run.test.structure
    f_hz = float(structure.natural_frequencies_hz[0])
    yield setting("3.1.1", "natural frequency, linear", "5.0 Hz", f"{f_hz:.3f} Hz", f"{f_hz:.1f}" == "5.0")
    yield _other_frequencies(r)
    damping, stiffness, mass = (
        float(m[0, 0]) for m in (structure.damping_n_s_per_m, structure.stiffness_n_per_m, structure.mass_kg)
    )
    zeta = damping / (2 * math.sqrt(stiffness * mass))
    yield setting("3.1.1", "inherent damping ratio", "0.02", f"{zeta:.4f}", f"{zeta:.2f}" == "0.02")
    five, one = r.trials["linear, 6.4 ms, K = 1"], r.trials["elastic 1 Hz, perfect"]
    yield slip(
        "3.1.1",
        "critical delay of the 5 Hz structure",
        "6.4 ms",
        f"{ms(_critical_s(five), 2)} at 5 Hz, {ms(_critical_s(one), 2)} at 1 Hz (K = 1); at 5 Hz with 6.4 ms "
        + (f"out of bounds after {five.unstable_at_s:.1f} s" if five.run is None else "stable"),
        five.run is None and not rounds_to(1e3 * _critical_s(five), "6.4"),
        "the number is that of the 1 Hz structure of section 3.1.2",
        "last digit",
    )
    used = r.trials["linear, 1 ms, K = 1.1"]
    yield judged(
        "3.1.1",
        "a delay of 1 ms keeps the simulation stable",
        "stable",
        f"stable; with K = 1.1 the limit is {ms(_critical_s(used), 2)}",
        used.run is not None,
        "runs to its end",
    )
    actuator = run.test.actuators[0]
    yield setting("3.1.1", "amplitude error introduced", "1.1", f"{actuator.gain:g}", actuator.gain == paper.GAIN)
    yield setting(
        "3.1.1", "sampling rate of the simulation", "1024 Hz", f"{run.rate_hz:g} Hz", run.rate_hz == paper.RATE_HZ
    )
    for name, rate, length, key in (
        ("MU2035", 100, 24577, "linear-mu2035"),
        ("CHY101-N", 200, 92161, "linear-chy101-n"),
    ):
        found, n, missing = r.records[name].motion.rate_hz, r.runs[key].target.size, stand_in(r, name)
        for what, printed, ours, same in (
            ("sampling rate", f"{rate} Hz", f"{found:g} Hz", found == rate),
            ("data length after interpolation", str(length), str(n), n == length),
        ):
            if missing:
                yield not_compared("3.1.1", f"{what}, {name}", printed, ours, missing)
            else:
                yield setting("3.1.1", f"{what}, {name}", printed, ours, same)
    yield _scale(r)
    gaps = {name: _discrepancy(r, "linear", name) for name in RECORDS}
    yield in_how_many(
        r, "3.1.1, Fig 1", "delay and amplitude error change the response greatly", "large discrepancy",
        "rms of the difference over the true response's: "
        + ", ".join(f"{used_name(r, n)} {100 * g:.0f} %" for n, g in gaps.items()),
        min(gaps.values()) > 0.5, [c.discrepancy["linear"] > 0.5 for c in r.far_field], MOST,
        "half of the true rms, in three of four records",
        note=stand_in(r, "MU2035"),
    )  # fmt: skip
    for name, printed, key in zip(RECORDS, ("0.0313", "0.0078"), ("linear-mu2035", "linear-chy101-n"), strict=True):
        df = r.studies[SPECTRAL].cell(source=key).delta_f_hz
        yield setting("3.1.1", f"frequency interval, {name}", f"{printed} Hz", f"{df:.7g} Hz", rounds_to(df, printed))


def _other_frequencies(r: Results) -> Claim:
    """At 1, 2 and 10 Hz; the last with half the delay, for it is not stable with 1 ms."""
    told, good, note = [], True, ""
    for name, delay_s in (("1 Hz", 1e-3), ("2 Hz", 1e-3), ("10 Hz", 1e-3), ("10 Hz, 0.5 ms", 0.5e-3)):
        trial = r.trials[f"linear, {name}"]
        if trial.run is None:
            note = (
                f"at {name} a delay of {ms(delay_s, 0)} is too long (critical {ms(_critical_s(trial))}): out of bounds "
                f"after {trial.unstable_at_s:.1f} s"
            )
            continue
        a, d = read_run(trial.run, "none")
        told.append(f"{name}: A = {a:.4f}, d = {ms(d)}")
        good = good and near(a, paper.GAIN, 0.01) and near(d, delay_s, 0.01)
    return judged(
        "3.1.1", "other natural frequencies give similar results", "similar", "; ".join(told), good, "1 %", note=note,
        window="none",
    )  # fmt: skip


def _scale(r: Results) -> Claim:
    small = r.trials["nonlinear, scaled by 0.1"].run
    assert small is not None
    found = {w: read_run(small, w) for w in WINDOWS}
    held = {w: near(a, paper.GAIN, 0.01) and near(d, paper.DELAY_S["nonlinear"], 0.02) for w, (a, d) in found.items()}
    return in_ways(
        "3.1.1",
        "the scale of the ground motion does not affect the approach (CHY101-N times 0.1, nonlinear)",
        "not affected",
        "; ".join(f"{WORDS[w]}: A = {a:.4f}, d = {ms(d)}" for w, (a, d) in found.items()) + " (1.1, 5 ms)",
        held,
        "A 1 %, d 2 %",
        "a motion of another scale leaves another residual displacement at the record's end",
    )


def linear_by_p(r: Results) -> Iterator[Claim]:
    """Section 3.1.1, Figs 2 and 3."""
    highest = [r.studies[SPECTRAL].cell(source="linear-chy101-n", P=P).highest_frequency_hz for P in paper.POWERS]
    yield setting(
        "3.1.1",
        "highest frequencies for P = 1 to 512",
        ", ".join(paper.HIGHEST_FREQUENCY_HZ) + " Hz",
        ", ".join(f"{f:g}" for f in highest) + " Hz",
        all(f == float(printed) for f, printed in zip(highest, paper.HIGHEST_FREQUENCY_HZ, strict=True)),
    )
    for name in RECORDS:
        yield by_window(
            r, "3.1.1, 4.1.1, Figs 2, 11", f"A and d at P = Q = 1, linear, {name}", "1.1 and 1 ms, exactly", (name,),
            *within("linear", 1e-3, 1e-3), "0.1 %",
        )  # fmt: skip
    yield by_window(
        r, "3.1.1, Fig 2", "A and d almost the same for all P below 64, linear", "almost the same", RECORDS,
        *steady("linear", 0.01, _BELOW_64), "1 % of P = 1", ENDS,
    )  # fmt: skip
    orders = ", ".join(str(order_of_matlab(P)) for P in (128, 256, 512))
    yield by_own_filter(
        r, "3.1.1, Fig 2", "A and d quite different from the truth for P above 128", "poor accuracy", RECORDS,
        _beyond("linear", 0.01), _words("linear"), "more than 1 %; ours less",
        f"the loss is the filter's, whose order MATLAB lowers to {orders} at P = 128, 256, 512; without a filter, or "
        "with it in second-order sections, nothing is lost",
        lambda see: max(errors(see, "linear", _ABOVE_128)) < 0.01,
    )  # fmt: skip
    yield from _times(r, "linear", "3.1.1, Fig 3", half=True)
    yield saves_without_loss(r, "3.1.1", ("linear",), (16, 1), ("linear-mu2035", "linear-chy101-n"))


def _beyond(test: str, share: float) -> Callable[[Seen], bool]:
    """An error of A or d of more than this share above P = 128."""
    return lambda see: max(errors(see, test, _ABOVE_128)) > share


def _words(test: str) -> Callable[[Seen], str]:
    return lambda see: errors_text(see, test, _ABOVE_128)


def _times(r: Results, test: str, section: str, half: bool) -> Iterator[Claim]:
    for name in RECORDS:
        key = f"{test}-{name.lower()}"
        table = paper.TIMES_MS[key]
        note = stand_in(r, name)
        yield timed(
            section, f"time falls with P up to 16, {test}, {name}", "falls", shares_text(r, key, _EARLY),
            partial(like_printed, r, key, _EARLY), "factor 1.5 of the printed shares", FILTER,
            in_tables=table[16, 1] <= 0.75 * table[1, 1], note=note,
        )  # fmt: skip
        longest, shortest = (f([share(r, key, *at) for at in _LATE]) for f in (max, min))
        yield timed(
            section, f"time almost constant for P above 16, {test}, {name}", "constant",
            f"longest over shortest {longest / shortest:.2f} in SciPy's form",
            partial(constant, r, key, _LATE), "1.5", "the filter's time depends on P here",
            in_tables=_constant_in(table), note=note,
        )  # fmt: skip
        if half:
            yield timed(
                section, f"P = 16 takes about half the time of P = 1, linear, {name}",
                f"50 % (Table 1: {100 * table[16, 1] / table[1, 1]:.0f} %)", shares_text(r, key, [(16, 1)]),
                partial(share_about, r, key, (16, 1), 0.5), "a factor 4/3", FILTER,
                in_tables=about(table[16, 1] / table[1, 1], 0.5), note=note,
            )  # fmt: skip


def _constant_in(table: dict[tuple[int, int], float]) -> bool:
    later = [table[P, 1] for P in paper.TABLE_P if P >= 16]
    return max(later) <= 1.5 * min(later)


def nonlinear_structure(r: Results) -> Iterator[Claim]:
    """Section 3.1.2, the tests."""
    run = r.runs["nonlinear-chy101-n"]
    law, structure, delay_s = run.test.actuators[0].specimen[0], run.test.structure, run.test.actuators[0].delay_s
    assert isinstance(law, BoucWen)
    assert isinstance(delay_s, float)
    yielding, elastic = r.trials["nonlinear 1 Hz, 20 ms, K = 1"], r.trials["elastic 1 Hz, 20 ms, K = 1"]
    true_elastic = r.trials["elastic 1 Hz, perfect"].run
    assert true_elastic is not None
    peaks = [float(np.abs(x.target).max()) for x in (r.perfect["nonlinear-chy101-n"], true_elastic)]
    yield in_how_many(
        r, "3.1.2", "yielding usually makes the displacement larger", "larger",
        f"CHY101-N, 1 Hz: peak {1e3 * peaks[0]:.0f} mm yielding, {1e3 * peaks[1]:.0f} mm elastic",
        peaks[0] > peaks[1], [c.peak_m["yielding"] > c.peak_m["elastic"] for c in r.far_field], MOST,
        "in three of four records", "at 1 Hz yielding makes the displacement smaller in about as many records",
    )  # fmt: skip
    late_elastic = r.trials["elastic 1 Hz, 5 ms"].run
    assert late_elastic is not None
    ti = [largest_indicator(x) for x in (run, late_elastic)]
    yield in_how_many(
        r, "3.1.2", "yielding thereby makes indices such as TI larger", "larger",
        f"CHY101-N, 5 ms, K = 1.1: TI {ti[0]:.3g} m2 yielding, {ti[1]:.3g} m2 elastic",
        ti[0] > ti[1],
        [c.tracking_indicator["yielding"] > c.tracking_indicator["elastic"] for c in r.far_field], MOST,
        "in three of four records",
        "TI adds up over all cycles, and the elastic structure moves back and forth far longer",
    )  # fmt: skip
    k = float(structure.stiffness_n_per_m[0, 0])
    shape = ", ".join(f"{getattr(law, a):g}" for a in ("beta", "gamma", "exponent"))
    for what, printed, value in (
        ("yield displacement", "10 mm", f"{1e3 * law.yield_displacement_m:g} mm"),
        ("elastic stiffness", "11.765 kN/mm", f"{k / 1e6:.3f} kN/mm"),
        ("ratio of post-yield to elastic stiffness", "0.01", f"{law.post_yield_ratio:g}"),
        ("beta, gamma, q", "0.55, 0.45, 2", shape),
        ("natural frequency, nonlinear", "1.0 Hz", f"{float(structure.natural_frequencies_hz[0]):.1f} Hz"),
        ("delay, nonlinear", "5 msec.", f"{1e3 * delay_s:g} msec."),
    ):
        yield setting("3.1.2", what, printed, value, value == printed)
    frame = r.runs["experiment-29"].test.structure
    yield not_compared(
        "3.1.2",
        "11.765 kN/mm is the stiffness of this 1 Hz structure, whose mass is not given",
        "11.765 kN/mm, 1.0 Hz",
        f"with 1 Hz it implies {float(structure.mass_kg[0, 0]) / 1e3:.0f} t; the 503.4 t of section 3.2 at 0.77 Hz "
        f"have {float(frame.stiffness_n_per_m[0, 0]) / 1e6:.3f} kN/mm",
        "the mass is not printed; the stiffness looks like that of the laboratory's frame",
    )
    yield judged(
        "3.1.2",
        "yielding may help to stabilise the delayed loop (20 ms, three times the critical delay)",
        "may help",
        f"yielding: {_outcome(yielding)}; elastic: {_outcome(elastic)}",
        yielding.run is not None and elastic.run is None,
        "runs to its end",
        "both are stable, or both are not",
    )
    gaps = {name: [_discrepancy(r, kind, name) for kind in TESTS] for name in RECORDS}
    yield in_how_many(
        r, "3.1.2, Fig 4", "smaller difference from the true response than in Fig 1", "smaller",
        "rms over the true response's: "
        + ", ".join(f"{used_name(r, n)} {100 * g[1]:.0f} % (Fig 1: {100 * g[0]:.0f} %)" for n, g in gaps.items()),
        all(g[1] < g[0] for g in gaps.values()),
        [c.discrepancy["nonlinear"] < c.discrepancy["linear"] for c in r.far_field], MOST,
        "smaller, in three of four records", "the delay moves the residual displacement", stand_in(r, "MU2035"),
    )  # fmt: skip


def nonlinear_by_p(r: Results) -> Iterator[Claim]:
    """Section 3.1.2, Figs 5 to 7."""
    missing = stand_in(r, "MU2035")
    cell = r.cell(SPECTRAL, "nonlinear-mu2035")
    ours = f"{cell.amplitude:.4f} and {ms(cell.delay_s)}"
    printed = "1.102 and 5.0 msec."
    if missing:
        yield not_compared("3.1.2, Fig 5", "A and d at P = 1, nonlinear, MU2035", printed, ours, missing)
    else:
        yield judged(
            "3.1.2, Fig 5", "A and d at P = 1, nonlinear, MU2035", printed, ours,
            rounds_to(cell.amplitude, "1.102") and rounds_to(1e3 * cell.delay_s, "5.0"), "last digit",
            "plain FEI's bias hangs on the record's ends", window="none",
        )  # fmt: skip
    for name in RECORDS:
        yield by_window(
            r, "3.1.2, Fig 5", f"A and d at P = 1 within 1 %, nonlinear, {name}", "below 1 %", (name,),
            *within("nonlinear", 0.01, 0.01), "1 %", ENDS,
        )  # fmt: skip
    yield by_window(
        r, "3.1.2, Fig 5", "A and d almost constant for P below 128, nonlinear", "around 1.1 and 5 msec.", RECORDS,
        *steady("nonlinear", 0.01, _BELOW_128), "1 % of P = 1",
        "the step that a residual displacement leaves at the record's end reaches to the highest frequencies",
    )  # fmt: skip
    yield by_own_filter(
        r, "3.1.2, Fig 5", "a significant relative error for P above 128, nonlinear, MU2035", "about 10 %", ("MU2035",),
        lambda see: 0.05 <= max(errors(see, "nonlinear", _ABOVE_128)) <= 0.2, _words("nonlinear"),
        "5 to 20 %; ours less than 1 %",  "the filter's loss again, not the method's",
        lambda see: max(errors(see, "nonlinear", _ABOVE_128)) < 0.01,
    )  # fmt: skip
    yield by_own_filter(
        r, "3.1.2, Fig 5", "accurate for P above 128, nonlinear, CHY101-N", "accurate", ("CHY101-N",),
        lambda see: max(errors(see, "nonlinear", _ABOVE_128)) <= 0.01, _words("nonlinear"), "1 %",
        "a yielding structure moves at low frequencies, where even the lowered filters are flat",
    )  # fmt: skip
    yield from _times(r, "nonlinear", "3.1.2, Fig 6", half=False)
    yield saves_without_loss(r, "3.1.2", ("nonlinear",), (16, 1), ("nonlinear-mu2035", "nonlinear-chy101-n"))
    spent = [r.decimation[LOWERED, P] for P in paper.POWERS]

    def grows(field: str) -> bool:
        once, twice, most = (getattr(spent[i], field.replace("_time", "")) for i in (0, 1, -1))
        return bool(once < 0.1 * twice and most > 1.1 * twice)

    sections = r.decimation[SCIPY, 512].time_s
    yield timed(
        "3.1.2, Fig 7",
        "the time for decimation is nearly 0 at P = 1 and in general grows with P",
        "grows",
        f"its filter, P = 1: {ms(spent[0].time_s)}; 2: {ms(spent[1].time_s, 2)}; 16: {ms(spent[4].time_s, 2)}; 512: "
        f"{ms(spent[-1].time_s, 2)}; in second-order sections, P = 512: {ms(sections, 2)}",
        grows,
        "a tenth of that at P = 2; a tenth more at P = 512",
        "the filter runs over all samples at every P, whose number does not change",
        note=missing,
    )


def _outcome(trial: Trial) -> str:
    if trial.run is None:
        return f"out of bounds after {trial.unstable_at_s:.1f} s"
    return f"peak {1e3 * np.abs(trial.run.target).max():.0f} mm"


def _critical_s(trial: Trial) -> float:
    assert trial.critical_delay is not None
    return trial.critical_delay.delay_s


def _discrepancy(r: Results, kind: str, record: str) -> float:
    key = f"{kind}-{record.lower()}"
    return discrepancy(r.runs[key], r.perfect[key])
