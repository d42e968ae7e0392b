"""The paper's 23 figures and three beside them, one function a figure: what is drawn, as data, of a `Reproduction`.

A `Plate` is drawn by `draw` and written as CSV by `rows`, so that the file holds exactly what the figure shows.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import matplotlib.ticker
import numpy as np
from matplotlib.figure import Figure

from rthstrack.plots.style import DOUBLE_COLUMN_IN, MEASURED, MUTED, SECOND, TARGET, VALUE, _style
from rthstrack.reproduction import paper
from rthstrack.reproduction.cases import CASES, Case
from rthstrack.reproduction.claims.rows import component_seen, errors
from rthstrack.reproduction.results import CHEBYSHEV, HANN, LOWERED, ROUTES, SCIPY, SPECTRAL, TRANSFER, TUKEY
from rthstrack.reproduction.time_model import time_model
from rthstrack.verdict import display

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from rthstrack.reproduction.results import Results

#: A history is drawn by the extremes of so many groups of neighbouring samples.
_GROUPS = 1500
_RECORD_COLOURS = {"MU2035": MEASURED, "CHY101-N": VALUE}
_ALPHA_COLOURS = {15: VALUE, 29: TARGET, 45: MEASURED}
_GRADED = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#c9b51a")
_PALE = "#a8b0b8"
_WINDOWS = "Windows with the mean removed."
_TIME_ROUTES = (
    (SCIPY, "paper's form in SciPy", MEASURED, "s"),
    (CHEBYSHEV, "ours, chebyshev", SECOND, "^"),
    (SPECTRAL, "ours, spectral", VALUE, "o"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One curve; NaN is a gap. `dash` and `marker` as Matplotlib has them."""

    label: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    colour: str
    marker: str = ""
    dash: Any = "-"
    hollow: bool = False
    width: float = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One pair of axes; `note` is written inside.

    scale: "time" is linear, "factors" P or Q on a logarithmic axis of base 2, "times" that with a logarithmic vertical
    axis, "shares" the same with a line at 1, "logarithmic" both axes so, "distribution" only the horizontal one.
    """

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    scale: Literal["time", "factors", "times", "shares", "logarithmic", "distribution"] = "factors"
    y_range: tuple[float, float] | None = None
    note: str = ""
    note_at: float = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Plate:
    """A figure: panels in rows of `columns`, and what must be said on it."""

    name: str
    panels: tuple[Panel, ...]
    columns: int
    remark: str
    height_in: float = 2.9
    widths: tuple[float, ...] | None = None


def plates(r: Results) -> Iterator[Plate]:
    """All figures in the paper's order, then those beside them."""
    for number, make in enumerate(FIGURES, start=1):
        yield make(r, f"figure-{number:02d}")
    for number, make in enumerate(SUPPLEMENTS, start=1):
        if make is not distributions or r.far_field:
            yield make(r, f"supplement-{number}")


def histories(r: Results, name: str, *, kind: str) -> Plate:
    """Figs 1, 4: displacement with the delay, and without delay and amplitude error."""
    panels = []
    for case in _cases(kind):
        run, true = r.runs[case.key], r.perfect[case.key]
        time_s = np.arange(run.target.size) / run.rate_hz
        with_delay, without = 1e3 * run.target, 1e3 * true.target
        kept = display.extremes((with_delay, without), display.even_edges(time_s.size, _GROUPS))
        tau_ms = 1e3 * paper.DELAY_S[kind]
        panels.append(
            Panel(
                f"{_kind_words(kind)}, {_record_name(r, case)}",
                "Time (s)",
                "Displacement (mm)",
                (
                    _below("no delay, no amplitude error", time_s[kept], without[kept]),
                    Series(f"$\\tau$ = {tau_ms:g} ms, $K$ = 1.1", time_s[kept], with_delay[kept], MEASURED, width=0.5),
                ),
                "time",
            )
        )
    return Plate(name, tuple(panels), 1, _remark(r, kind), 4.2)


def experiment_histories(r: Results, name: str) -> Plate:
    """Fig 8: displacement of the frame in the virtual experiment, and measured less target."""
    panels = []
    for case in _cases("experiment"):
        run, true = r.runs[case.key], r.perfect[case.key]
        time_s = np.arange(run.target.size) / run.rate_hz
        target, error, perfect = 1e3 * run.target, 1e3 * (run.measured - run.target), 1e3 * true.target
        edges = display.even_edges(time_s.size, _GROUPS)
        kept, errors = display.extremes((target, perfect), edges), display.extremes((error,), edges)
        panels.append(
            Panel(
                f"virtual experiment, {_alpha(case)}",
                "Time (s)",
                "Displacement (mm)",
                (
                    _below("perfect actuator", time_s[kept], perfect[kept]),
                    Series("target", time_s[kept], target[kept], TARGET, width=0.5),
                ),
                "time",
            )
        )
        series = (Series("measured less target", time_s[errors], error[errors], MEASURED, width=0.6),)
        panels.append(Panel(f"error, {_alpha(case)}", "Time (s)", "Error (mm)", series, "time"))
    return Plate(name, tuple(panels), 2, _remark(r, "experiment"), 5.6)


def tracking(r: Results, name: str, *, kind: str, over: Literal["P", "Q"]) -> Plate:
    """Figs 2, 5, 9 over P, Figs 11, 13, 15 over Q: A and d without a window and with; over P, MATLAB's decimate too."""
    routes: list[tuple[str, str, str, Any, bool]] = [
        (SPECTRAL, ", no window", "o", "-", False),
        (TUKEY, ", tukey", "^", (0, (5, 1.5)), True),
    ]
    if over == "P":
        routes.append((LOWERED, ", no window, MATLAB's decimate", "s", (0, (1, 1.5)), True))
    else:
        routes.append((HANN, ", hann", "v", (0, (2, 1.5)), True))
    curves: list[tuple[str, NDArray[np.float64], NDArray[np.float64], str, str, Any, bool]] = []
    for case in _cases(kind):
        for route, words, marker, dash, hollow in routes:
            a, d = _over(r, route, case.key, over)
            curves.append((_curve_name(r, case) + words, a, d, _colour(case), marker, dash, hollow))
    x = np.array(paper.POWERS, dtype=np.float64)
    amplitude = tuple(Series(label, x, a, c, m, dash, h) for label, a, _, c, m, dash, h in curves)
    delay = tuple(Series(label, x, d, c, m, dash, h) for label, _, d, c, m, dash, h in curves)
    ends, note = x[[0, -1]], ""
    if kind == "experiment":
        for case in _cases(kind):
            alpha_es = case.alpha_es or 0
            printed_ms = paper.EXPERIMENT_DELAY_MS[alpha_es]
            belongs = next(a for a, d in paper.REVERSED_DELAY_MS.items() if d == printed_ms)
            label = f"printed for {alpha_es}, belongs to {belongs}: {printed_ms:g} ms"
            delay += (
                Series(label, ends, np.full(2, printed_ms), _ALPHA_COLOURS[belongs], "", (0, (1, 1.5)), width=1.6),
            )
        note = "dotted: the printed delays; the paper names\n15 and 45 the other way round (see claims)"
    else:
        amplitude += (_level("simulated", ends, paper.GAIN),)
        delay += (_level("simulated", ends, 1e3 * paper.DELAY_S[kind]),)
    panels = (
        Panel(f"A, {_kind_words(kind)}", _factor_label(over), "A (-)", amplitude),
        Panel(f"d, {_kind_words(kind)}", _factor_label(over), "d (ms)", delay, note=note, note_at=0.24),
    )
    return Plate(name, panels, 2, f"{_WINDOWS} {_remark(r, kind)}", 4.2)


def times(r: Results, name: str, *, kind: str, over: Literal["P", "Q"]) -> Plate:
    """Figs 3, 6, 10 over P, Figs 12, 14, 16 over Q: computing time in ms, and as a share of that at P = Q = 1."""
    x = np.array(paper.POWERS, dtype=np.float64)
    absolute, shares = [], []
    for case in _cases(kind):
        in_ms, in_shares = [], []
        for route, label, colour, marker in _TIME_ROUTES:
            ms = np.array([1e3 * r.cell(route, case.key, *_factors(over, f)).computing_time_s for f in paper.POWERS])
            in_ms.append(Series(label, x, ms, colour, marker))
            in_shares.append(Series(label, x, ms / ms[0], colour, marker))
        printed = paper.TIMES_MS[case.key]
        there = [f for f in paper.POWERS if _factors(over, f) in printed]
        if there:
            at, ms = np.array(there, dtype=np.float64), np.array([printed[_factors(over, f)] for f in there])
            number = {"linear": 1, "nonlinear": 2, "experiment": 3}[kind]
            label = f"printed in Table {number}"
            in_ms.append(Series(label, at, ms, TARGET, "D", (0, (4, 2)), True))
            if (1, 1) in printed:
                in_shares.append(Series(label, at, ms / ms[0], TARGET, "D", (0, (4, 2)), True))
        title = _alpha(case) if case.alpha_es else f"{_kind_words(kind)}, {_record_name(r, case)}"
        absolute.append(Panel(title, _factor_label(over), "Time (ms)", tuple(in_ms), "times"))
        shares.append(Panel(title, _factor_label(over), "Time over that at P = Q = 1", tuple(in_shares), "shares"))
    remark = "Printed: the paper's records and machine."
    if kind == "experiment":
        remark = "Table 3 has no column for Q = 1." if over == "P" else f"{remark} Table 3 has no column for Q = 1."
    return Plate(name, (*absolute, *shares), len(absolute), f"{remark} {_remark(r, kind)}", 5.0)


def decimation_time(r: Results, name: str) -> Plate:
    """Fig 7: the time that decimating both signals takes."""
    x = np.array(paper.POWERS, dtype=np.float64)
    series = tuple(
        Series(label, x, np.array([1e3 * r.decimation[route, P].time_s for P in paper.POWERS]), colour, marker)
        for route, label, colour, marker in (
            (SCIPY, "second-order sections", MEASURED, "s"),
            (LOWERED, "as MATLAB", TARGET, "D"),
        )
    )
    whole = r.cell(SPECTRAL, "nonlinear-mu2035").computing_time_s
    series += (_level("our whole evaluation at P = 1", x[[0, -1]], 1e3 * whole),)
    title = f"nonlinear structure, {_record_name(r, CASES['nonlinear-mu2035'])}"
    panel = Panel(title, _factor_label("P"), "Time of decimation (ms)", series)
    return Plate(name, (panel,), 1, _remark_of(r, ["nonlinear-mu2035"]), 2.9)


def combined(r: Results, name: str, *, case: str) -> Plate:
    """Figs 17-23: A and d over P, a curve for each Q; without a window, and with."""
    x = np.array(paper.TABLE_P, dtype=np.float64)
    of = CASES[case]
    panels = []
    for route, words in ((SPECTRAL, "no window"), (TUKEY, "tukey, mean removed")):
        for what, label in (("A", "A (-)"), ("d", "d (ms)")):
            series = []
            for Q, colour, marker in zip(paper.TABLE_Q, _GRADED, "os^Dv<", strict=True):
                cells = [r.cell(route, case, P, Q) for P in paper.TABLE_P]
                y = np.array([c.amplitude if what == "A" else 1e3 * c.delay_s for c in cells])
                series.append(Series(f"Q = {Q}", x, y, colour, marker))
            if of.kind != "experiment":
                truth = paper.GAIN if what == "A" else 1e3 * paper.DELAY_S[of.kind]
                series.append(_level("simulated", x[[0, -1]], truth))
            elif what == "d":
                printed_ms = paper.REVERSED_DELAY_MS[of.alpha_es or 0]
                series.append(_level("printed (reversed)", x[[0, -1]], printed_ms))
            panels.append(Panel(f"{what}, {words}, {_curve_name(r, of)}", _factor_label("P"), label, tuple(series)))
    remark = _kind_words(of.kind).capitalize() + "."
    return Plate(name, tuple(panels), 2, f"{remark} {_remark_of(r, [case])}", 5.2)


def decimation_filters(r: Results, name: str) -> Plate:
    """Beside the paper's: what three forms of the same Chebyshev filter make of P, linear structure, CHY101-N."""
    case, x = "linear-chy101-n", np.array(paper.POWERS, dtype=np.float64)
    routes = (
        (SPECTRAL, "no filter (spectral)", VALUE, "o", "-"),
        (CHEBYSHEV, "second-order sections", SECOND, "^", "-"),
        (LOWERED, "transfer function, order lowered (MATLAB)", TARGET, "D", (0, (4, 2))),
        (TRANSFER, "transfer function, order 8 (Octave)", MEASURED, "s", (0, (1, 1.5))),
    )
    series: dict[str, list[Series]] = {"A": [], "d": []}
    for route, label, colour, marker, dash in routes:
        a, d = _over(r, route, case, "P")
        series["A"].append(Series(label, x, a, colour, marker, dash, route in (LOWERED, TRANSFER)))
        series["d"].append(Series(label, x, d, colour, marker, dash, route in (LOWERED, TRANSFER)))
    broken = [f"{P}" for P in paper.POWERS if not math.isfinite(r.cell(TRANSFER, case, P).amplitude)]
    beyond = r.cell(TRANSFER, case, 128)
    note = "order 8 as a transfer function:\n" + (
        f"A = {beyond.amplitude:.3g}, d = {1e3 * beyond.delay_s:.3g} ms at P = 128,\n"
        if math.isfinite(beyond.amplitude)
        else ""
    )
    note += f"not a number at P = {', '.join(broken)}" if broken else ""
    panels = (
        Panel(
            "A, linear structure, CHY101-N", _factor_label("P"), "A (-)", tuple(series["A"]), y_range=(1.0985, 1.1015)
        ),
        Panel(
            "d, linear structure, CHY101-N",
            _factor_label("P"),
            "d (ms)",
            tuple(series["d"]),
            y_range=(0, 1.2),
            note=note,
        ),
    )
    return Plate(name, panels, 2, _remark_of(r, [case]), 3.6)


def printed_times(r: Results, name: str) -> Plate:
    """Beside the paper's: the printed times explained by five constants."""
    model = time_model()
    at = {n: [i for i, (case, _, _) in enumerate(model.keys) if _table_number(case) == n] for n in (1, 2, 3)}
    series = [
        Series(f"Table {n}", model.model_ms[rows], model.printed_ms[rows], colour, "o", "")
        for (n, rows), colour in zip(at.items(), (MEASURED, VALUE, SECOND), strict=True)
    ]
    ends = np.array([3.0, 50.0])
    series.append(Series("equal", ends, ends, MUTED, "", (0, (7, 2.5))))
    note = (
        f"{model.fixed_ms:.1f} ms\n+ {1e6 * model.transform_ms:.1f} ns n log2 n\n+ {1e3 * model.bin_ms:.2f} us a bin\n"
        f"+ {model.overhead_ms:.1f} ms and {1e3 * model.filter_ms:.2f} us a sample if P > 1\n"
        f"median error {100 * model.median_error:.0f} %"
    )
    case, x = "nonlinear-chy101-n", np.array(paper.TABLE_Q, dtype=np.float64)
    over_q = []
    for P, colour, marker in zip((1, 2, 16), _GRADED[::2], "os^", strict=True):
        printed = np.array([paper.TIMES_MS[case][P, Q] for Q in paper.TABLE_Q])
        over_q.append(Series(f"P = {P}, printed", x, printed, colour, marker, ""))
        over_q.append(Series(f"P = {P}, model", x, np.array([model.at(case, P, Q) for Q in paper.TABLE_Q]), colour))
    panels = (
        Panel("273 printed times", "Model (ms)", "Printed (ms)", tuple(series), "logarithmic", note=note),
        Panel("Table 2, CHY101-N", _factor_label("Q"), "Time (ms)", tuple(over_q), "times"),
    )
    return Plate(name, panels, 2, "n: points transformed; bins and samples of the pair.", 3.8)


def distributions(r: Results, name: str) -> Plate:
    """Beside the paper's: the largest errors of A and d over the 44 components of the far-field set."""
    panels = []
    for kind in ("linear", "nonlinear"):
        for words, P, Q, limit in (
            ("P to 32", paper.POWERS[:6], (1,), 1.0),
            ("Q to 16", (1,), (1, 2, 4, 8, 16), 0.1 if kind == "nonlinear" else 0.5),
            ("Q from 64 to 512", (1,), (64, 128, 256, 512), 1.0 if kind == "nonlinear" else 0.5),
        ):
            series = []
            for window, colour in zip(ROUTES, (MEASURED, VALUE, SECOND), strict=True):
                worst = [max(errors(component_seen(c, window), kind, P, Q)) for c in r.far_field]
                x = 100 * np.sort(np.clip(worst, 1e-6, 1e3))
                label = "no window" if window == "none" else f"{window}, mean removed"
                series.append(Series(label, x, np.arange(1, x.size + 1) / x.size, colour))
            series.append(
                Series("limit in claims.md", np.array([limit, limit]), np.array([0.0, 1.0]), MUTED, "", (0, (7, 2.5)))
            )
            label = "Largest error of A and d (%)"
            panels.append(Panel(f"{kind}, {words}", label, "Share of the components", tuple(series), "distribution"))
    return Plate(name, tuple(panels), 3, "The 44 components of the far-field set of FEMA P695, whole.", 5.0)


FIGURES: tuple[Callable[[Results, str], Plate], ...] = (
    partial(histories, kind="linear"),
    partial(tracking, kind="linear", over="P"),
    partial(times, kind="linear", over="P"),
    partial(histories, kind="nonlinear"),
    partial(tracking, kind="nonlinear", over="P"),
    partial(times, kind="nonlinear", over="P"),
    decimation_time,
    experiment_histories,
    partial(tracking, kind="experiment", over="P"),
    partial(times, kind="experiment", over="P"),
    partial(tracking, kind="linear", over="Q"),
    partial(times, kind="linear", over="Q"),
    partial(tracking, kind="nonlinear", over="Q"),
    partial(times, kind="nonlinear", over="Q"),
    partial(tracking, kind="experiment", over="Q"),
    partial(times, kind="experiment", over="Q"),
    partial(combined, case="linear-mu2035"),
    partial(combined, case="linear-chy101-n"),
    partial(combined, case="nonlinear-mu2035"),
    partial(combined, case="nonlinear-chy101-n"),
    *(partial(combined, case=f"experiment-{alpha_es}") for alpha_es in paper.ALPHA_ES),
)


SUPPLEMENTS: tuple[Callable[[Results, str], Plate], ...] = (decimation_filters, printed_times, distributions)


# On paper -------------------------------------------------------------------------------------------------------------


def draw(plate: Plate) -> Figure:
    """The plate as a figure two columns wide."""
    with _style():
        page = Figure(figsize=(DOUBLE_COLUMN_IN, plate.height_in), layout="constrained")
        n_rows = math.ceil(len(plate.panels) / plate.columns)
        grid = page.subplots(n_rows, plate.columns, squeeze=False, width_ratios=plate.widths)
        axes = grid.ravel()
        for panel, ax, letter in zip(plate.panels, axes, "abcdef", strict=False):
            _draw_panel(panel, ax, every=2 if plate.columns > 2 else 1)
            ax.set_title(f"({letter}) {panel.title}" if len(plate.panels) > 1 else panel.title, loc="left", pad=4)
        found = [ax.get_legend_handles_labels() for ax in axes]
        handles = {label: handle for hs, ls in found for handle, label in zip(hs, ls, strict=True)}
        longest = max(map(len, handles))
        n_columns = next(n for limit, n in ((36, 2), (20, 3), (10, 4), (0, 7)) if longest > limit)
        page.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=n_columns)
        if plate.remark:
            page.supxlabel(plate.remark, fontsize=6.5, color=MUTED, wrap=True)
        # Laid out once, here, not again for every format.
        page.draw_without_rendering()
        page.set_layout_engine("none")
        return page


def rows(plate: Plate) -> Iterator[tuple[str | float, ...]]:
    """What is drawn, a row a point, after a header."""
    yield "panel", "series", "x_quantity", "x", "y_quantity", "y"
    for panel in plate.panels:
        for series in panel.series:
            named = _plain(panel.title), _plain(series.label)
            for x, y in zip(series.x.tolist(), series.y.tolist(), strict=True):
                yield *named, panel.x_label, x, panel.y_label, y


def _plain(text: str) -> str:
    """Without TeX: what $\\alpha_{es}$ and $\\tau$ say in letters."""
    return re.sub(r"[$\\\\{}]", "", text)


def _draw_panel(panel: Panel, ax: Axes, every: int) -> None:
    for s in panel.series:
        ax.plot(
            s.x,
            s.y,
            color=s.colour,
            marker=s.marker or None,
            linestyle=s.dash,
            linewidth=s.width,
            markersize=3.2,
            markerfacecolor="white" if s.hollow else s.colour,
            markeredgewidth=0.7,
            label=s.label,
        )
    ax.set_xlabel(panel.x_label)
    ax.set_ylabel(panel.y_label)
    if panel.scale == "time":
        ax.set_xlim(float(panel.series[0].x[0]), float(panel.series[0].x[-1]))
    elif panel.scale in ("logarithmic", "distribution"):
        ax.set_xscale("log")
        if panel.scale == "logarithmic":
            ax.xaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
        ax.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        ax.xaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    else:
        ax.set_xscale("log", base=2)
        ax.xaxis.set_major_locator(matplotlib.ticker.FixedLocator(panel.series[0].x[::every].tolist()))
        ax.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        ax.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
        ax.yaxis.set_major_formatter(matplotlib.ticker.ScalarFormatter(useOffset=False))
    if panel.scale in ("times", "shares", "logarithmic"):
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
        ax.yaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    if panel.scale == "shares":
        ax.axhline(1.0, color=MUTED, linewidth=0.5)
    elif panel.y_range is not None:
        ax.set_ylim(*panel.y_range)
    elif panel.scale == "factors":
        _not_too_fine(ax, panel.series)
    if panel.note:
        at, placed = (0.97, "right") if panel.scale == "logarithmic" else (0.03, "left")
        ax.text(
            at, panel.note_at, panel.note, transform=ax.transAxes, color=MUTED, fontsize=6.5, va="bottom", ha=placed
        )


def _not_too_fine(ax: Axes, series: Sequence[Series]) -> None:
    """At least 0.2 % of the value and 2 us high, so that differences nobody could measure look like none."""
    values = np.concatenate([s.y[np.isfinite(s.y)] for s in series])
    low, high = float(values.min()), float(values.max())
    least = max(0.002 * max(abs(low), abs(high)), 0.002)
    if high - low < least:
        middle = (low + high) / 2
        low, high = middle - least / 2, middle + least / 2
    ax.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))


# Choosing and naming --------------------------------------------------------------------------------------------------


def _cases(kind: str) -> list[Case]:
    return [case for case in CASES.values() if case.kind == kind]


def _factors(over: str, factor: int) -> tuple[int, int]:
    return (factor, 1) if over == "P" else (1, factor)


def _over(r: Results, route: str, case: str, over: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A, and d in ms, over P or Q from 1 to 512."""
    cells = [r.cell(route, case, *_factors(over, factor)) for factor in paper.POWERS]
    return np.array([c.amplitude for c in cells]), np.array([1e3 * c.delay_s for c in cells])


def _below(label: str, x: NDArray[np.float64], y: NDArray[np.float64]) -> Series:
    """A curve that another nearly covers: wide and pale, drawn first."""
    return Series(label, x, y, _PALE, width=1.8)


def _table_number(case: str) -> int:
    return {"linear": 1, "nonlinear": 2, "experiment": 3}[CASES[case].kind]


def _level(label: str, x: NDArray[np.float64], value: float) -> Series:
    return Series(label, x, np.full(2, value), MUTED, "", (0, (7, 2.5)))


def _colour(case: Case) -> str:
    return _ALPHA_COLOURS[case.alpha_es] if case.alpha_es else _RECORD_COLOURS[case.record]


def _alpha(case: Case) -> str:
    return rf"$\alpha_{{es}}$ = {case.alpha_es}"


def _record_name(r: Results, case: Case) -> str:
    """The record that was used, and for which."""
    used = r.records[case.record]
    return f"{used.motion.name} for {case.record}" if used.remark else case.record


def _curve_name(r: Results, case: Case) -> str:
    return _alpha(case) if case.alpha_es else _record_name(r, case)


def _factor_label(over: str) -> str:
    return "Data decimation P" if over == "P" else "Frequency decimation Q"


def _kind_words(kind: str) -> str:
    return "virtual experiment" if kind == "experiment" else f"{kind} structure"


def _remark(r: Results, kind: str) -> str:
    return _remark_of(r, [case.key for case in _cases(kind)])


def _remark_of(r: Results, keys: Sequence[str]) -> str:
    return " ".join(dict.fromkeys(f"{r.remark(key)}." for key in keys if r.remark(key)))
