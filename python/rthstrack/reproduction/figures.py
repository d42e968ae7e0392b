"""The paper's 23 figures and one beside them, one function a figure: what is drawn, as data, from a `Reproduction`.

A `Plate` is drawn by `draw` and written as CSV by `rows`, so that the file holds exactly what the figure shows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import matplotlib.ticker
import numpy as np
from matplotlib.figure import Figure

from rthstrack import display
from rthstrack.plots import DOUBLE_COLUMN_IN, MEASURED, MUTED, SECOND, TARGET, VALUE, _style
from rthstrack.reproduction import CHEBYSHEV, LOWERED, SCIPY, SPECTRAL, TRANSFER, paper
from rthstrack.reproduction.cases import CASES, Case

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from rthstrack.reproduction import Reproduction

#: A history is drawn by the extremes of so many groups of neighbouring samples.
_GROUPS = 1500
_RECORD_COLOURS = {"MU2035": MEASURED, "CHY101-N": VALUE}
_ALPHA_COLOURS = {15: VALUE, 29: TARGET, 45: MEASURED}
_GRADED = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#c9b51a")
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
    """One pair of axes. `scale`: factors on logarithmic axes of base 2; `note` is written inside."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    scale: Literal["time", "factors", "shares"] = "factors"
    y_range: tuple[float, float] | None = None
    note: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Plate:
    """A figure: panels in rows of `columns`, and what must be said on it."""

    name: str
    panels: tuple[Panel, ...]
    columns: int
    remark: str
    height_in: float = 2.9
    widths: tuple[float, ...] | None = None


def plates(r: Reproduction) -> Iterator[Plate]:
    """All figures in the paper's order, then those beside them."""
    for number, make in enumerate(FIGURES, start=1):
        yield make(r, f"figure-{number:02d}")
    yield decimation_filters(r, "supplement-1")


def histories(r: Reproduction, name: str, *, kind: str) -> Plate:
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
                    Series(f"$\\tau$ = {tau_ms:g} ms, $K$ = 1.1", time_s[kept], with_delay[kept], MEASURED, width=0.6),
                    Series("no delay, no amplitude error", time_s[kept], without[kept], TARGET, width=0.6),
                ),
                "time",
            )
        )
    return Plate(name, tuple(panels), 1, _remark(r, kind), 4.2)


def experiment_histories(r: Reproduction, name: str) -> Plate:
    """Fig 8: displacement of the frame, virtual experiment; the second around its peak, with what was measured."""
    panels = []
    for case in _cases("experiment"):
        run, true = r.runs[case.key], r.perfect[case.key]
        time_s = np.arange(run.target.size) / run.rate_hz
        target, measured, perfect = (1e3 * x for x in (run.target, run.measured, true.target))
        kept = display.extremes((target, perfect), display.even_edges(time_s.size, _GROUPS))
        peak = int(np.abs(target).argmax())
        near = np.arange(max(peak - 512, 0), min(peak + 512, target.size), 4)
        for title, part, drawn in (
            (
                f"virtual experiment, {_alpha(case)}",
                kept,
                ((target, "target", TARGET), (perfect, "perfect actuator", SECOND)),
            ),
            (
                "around the peak",
                near,
                ((target, "target", TARGET), (perfect, "perfect actuator", SECOND), (measured, "measured", MEASURED)),
            ),
        ):
            series = tuple(Series(label, time_s[part], y[part], colour, width=0.7) for y, label, colour in drawn)
            panels.append(Panel(title, "Time (s)", "Displacement (mm)", series, "time"))
    return Plate(name, tuple(panels), 2, _remark(r, "experiment"), 5.6, (2.2, 1.0))


def tracking(r: Reproduction, name: str, *, kind: str, over: Literal["P", "Q"]) -> Plate:
    """Figs 2, 5, 9 over P, Figs 11, 13, 15 over Q: A and d, ours and, over P, with MATLAB's decimate rebuilt."""
    routes: list[tuple[str, str, str, Any, bool]] = [(SPECTRAL, "", "o", "-", False)]
    if over == "P":
        routes.append((LOWERED, ", MATLAB's decimate", "s", (0, (4, 2)), True))
    curves: list[tuple[str, NDArray[np.float64], NDArray[np.float64], str, str, Any, bool]] = []
    for case in _cases(kind):
        for route, words, marker, dash, hollow in routes:
            a, d = _over(r, route, case.key, over)
            curves.append((_curve_name(r, case) + words, a, d, _colour(case), marker, dash, hollow))
    x = np.array(paper.POWERS, dtype=np.float64)
    amplitude = tuple(Series(label, x, a, c, m, dash, h) for label, a, _, c, m, dash, h in curves)
    delay = tuple(Series(label, x, d, c, m, dash, h) for label, _, d, c, m, dash, h in curves)
    ends = x[[0, -1]]
    if kind == "experiment":
        delay += tuple(
            Series(
                f"printed for {case.alpha_es}: {paper.EXPERIMENT_DELAY_MS[case.alpha_es or 0]:g} ms",
                ends,
                np.full(2, paper.EXPERIMENT_DELAY_MS[case.alpha_es or 0]),
                _colour(case),
                "",
                (0, (1, 1.5)),
            )
            for case in _cases(kind)
        )
    else:
        amplitude += (_level("simulated", ends, paper.GAIN),)
        delay += (_level("simulated", ends, 1e3 * paper.DELAY_S[kind]),)
    panels = (
        Panel(f"A, {_kind_words(kind)}", _factor_label(over), "A (-)", amplitude),
        Panel(f"d, {_kind_words(kind)}", _factor_label(over), "d (ms)", delay),
    )
    return Plate(name, panels, 2, _remark(r, kind), 3.6 if over == "P" or kind == "experiment" else 3.1)


def times(r: Reproduction, name: str, *, kind: str, over: Literal["P", "Q"]) -> Plate:
    """Figs 3, 6, 10 over P, Figs 12, 14, 16 over Q: computing time as a share of that at P = Q = 1."""
    x = np.array(paper.POWERS, dtype=np.float64)
    panels = []
    for case in _cases(kind):
        series = []
        for route, label, colour, marker in _TIME_ROUTES:
            ms = np.array([1e3 * r.cell(route, case.key, *_factors(over, f)).computing_time_s for f in paper.POWERS])
            series.append(Series(f"{label} ({ms[0]:.2f} ms)", x, ms / ms[0], colour, marker))
        printed = paper.TIMES_MS[case.key]
        if (1, 1) in printed:
            there = [f for f in paper.POWERS if _factors(over, f) in printed]
            ms = np.array([printed[_factors(over, f)] for f in there])
            number = 1 if kind == "linear" else 2
            label = f"printed in Table {number} ({ms[0]:g} ms)"
            series.append(Series(label, np.array(there, dtype=np.float64), ms / ms[0], TARGET, "D", (0, (4, 2)), True))
        title = _alpha(case) if case.alpha_es else f"{_kind_words(kind)}, {_record_name(r, case)}"
        panels.append(Panel(title, _factor_label(over), "Time over that at P = Q = 1", tuple(series), "shares"))
    remark = "In brackets: the time at P = Q = 1. " + _remark(r, kind)
    return Plate(name, tuple(panels), len(panels), remark, 3.4)


def decimation_time(r: Reproduction, name: str) -> Plate:
    """Fig 7: the time that decimating both signals takes."""
    x = np.array(paper.POWERS, dtype=np.float64)
    series = tuple(
        Series(label, x, np.array([1e3 * r.decimation_s[route, P] for P in paper.POWERS]), colour, marker)
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


def combined(r: Reproduction, name: str, *, case: str) -> Plate:
    """Figs 17-23: A and d over P, a curve for each Q."""
    x = np.array(paper.TABLE_P, dtype=np.float64)
    of = CASES[case]
    panels = []
    for what, label in (("A", "A (-)"), ("d", "d (ms)")):
        series = []
        for Q, colour, marker in zip(paper.TABLE_Q, _GRADED, "os^Dv<", strict=True):
            cells = [r.cell(SPECTRAL, case, P, Q) for P in paper.TABLE_P]
            y = np.array([c.amplitude if what == "A" else 1e3 * c.delay_s for c in cells])
            series.append(Series(f"Q = {Q}", x, y, colour, marker))
        if of.kind != "experiment":
            truth = paper.GAIN if what == "A" else 1e3 * paper.DELAY_S[of.kind]
            series.append(_level("simulated", x[[0, -1]], truth))
        title = f"{what}, {_kind_words(of.kind)}, {_curve_name(r, of)}"
        panels.append(Panel(title, _factor_label("P"), label, tuple(series)))
    return Plate(name, tuple(panels), 2, _remark_of(r, [case]), 3.2)


def decimation_filters(r: Reproduction, name: str) -> Plate:
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


FIGURES: tuple[Callable[[Reproduction, str], Plate], ...] = (
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
            if plate.columns == 1:
                ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, columnspacing=1.2)
            elif panel.scale == "shares":
                ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.24), ncols=1)
        if plate.columns > 1 and plate.panels[0].scale != "shares":
            found = [ax.get_legend_handles_labels() for ax in axes]
            handles = {label: handle for hs, ls in found for handle, label in zip(hs, ls, strict=True)}
            n_columns = 3 if max(map(len, handles)) > 16 else 7
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
            for x, y in zip(series.x.tolist(), series.y.tolist(), strict=True):
                yield panel.title, series.label, panel.x_label, x, panel.y_label, y


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
    else:
        ax.set_xscale("log", base=2)
        ax.xaxis.set_major_locator(matplotlib.ticker.FixedLocator(panel.series[0].x[::every].tolist()))
        ax.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        ax.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
        ax.yaxis.set_major_formatter(matplotlib.ticker.ScalarFormatter(useOffset=False))
    if panel.scale == "shares":
        ax.set_yscale("log")
        ax.axhline(1.0, color=MUTED, linewidth=0.5)
        ax.yaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
        ax.yaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    elif panel.y_range is not None:
        ax.set_ylim(*panel.y_range)
    elif panel.scale == "factors":
        _not_too_fine(ax, panel.series)
    if panel.note:
        ax.text(0.03, 0.05, panel.note, transform=ax.transAxes, color=MEASURED, fontsize=6.5, va="bottom")


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


def _over(r: Reproduction, route: str, case: str, over: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A, and d in ms, over P or Q from 1 to 512."""
    cells = [r.cell(route, case, *_factors(over, factor)) for factor in paper.POWERS]
    return np.array([c.amplitude for c in cells]), np.array([1e3 * c.delay_s for c in cells])


def _level(label: str, x: NDArray[np.float64], value: float) -> Series:
    return Series(label, x, np.full(2, value), MUTED, "", (0, (7, 2.5)))


def _colour(case: Case) -> str:
    return _ALPHA_COLOURS[case.alpha_es] if case.alpha_es else _RECORD_COLOURS[case.record]


def _alpha(case: Case) -> str:
    return rf"$\alpha_{{es}}$ = {case.alpha_es}"


def _record_name(r: Reproduction, case: Case) -> str:
    """The record that was used, and for which."""
    used = r.records[case.record]
    return f"{used.motion.name} for {case.record}" if used.remark else case.record


def _curve_name(r: Reproduction, case: Case) -> str:
    return _alpha(case) if case.alpha_es else _record_name(r, case)


def _factor_label(over: str) -> str:
    return "Data decimation P" if over == "P" else "Frequency decimation Q"


def _kind_words(kind: str) -> str:
    return "virtual experiment" if kind == "experiment" else f"{kind} structure"


def _remark(r: Reproduction, kind: str) -> str:
    return _remark_of(r, [case.key for case in _cases(kind)])


def _remark_of(r: Reproduction, keys: Sequence[str]) -> str:
    return " ".join(dict.fromkeys(f"{r.remark(key)}." for key in keys if r.remark(key)))
