"""Figures of a `Study`, fit for a journal: A, d and computing time over P, over Q and over both; nothing is computed.

As in `plots`: every function takes `ax=` and returns it, and without makes a figure of its own, one column wide. Curves
differ by colour, marker and line; what could not be determined is a gap. `sources`, `windows` and `weight_powers`
choose the curves, by default all; only what differs between them is named in the legend.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import matplotlib
import matplotlib.ticker
import numpy as np
from matplotlib.figure import Figure

from rthstrack.errors import SettingError
from rthstrack.plots.style import (
    DOUBLE_COLUMN_IN,
    MEASURED,
    MUTED,
    SECOND,
    SINGLE_COLUMN_IN,
    TARGET,
    THIRD,
    VALUE,
    _axes,
    _several,
    _style,
    shared_label,
    value_range,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from rthstrack.studies.cells import Cell, Study

_COLOURS = (VALUE, MEASURED, SECOND, THIRD, "#e69f00", "#56b4e9", TARGET)
_MARKERS = "os^Dvx+"
_LINES = ("-", (0, (5, 2)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))
_TRUTH: Any = {"color": MUTED, "linestyle": (0, (7, 2.5)), "linewidth": 0.9, "zorder": 1}
_P_LABEL, _Q_LABEL = "Data decimation P", "Frequency decimation Q"

#: The narrowest range shown: this share of the value, and of a delay at least so many ms.
_LEAST_SHARE, _LEAST_MS = 0.02, 0.02


def plot_data_decimation(
    study: Study,
    *,
    Q: int = 1,
    sources: Sequence[str] | None = None,
    windows: Sequence[str] | None = None,
    weight_powers: Sequence[int] | None = None,
    ax: Sequence[Axes] | NDArray[Any] | None = None,
) -> Sequence[Axes] | NDArray[Any]:
    """A and d (ms) over P at one Q, on two axes; the truth, where it is known, is dashed grey."""
    curves = [
        (name, study.select(**kind, Q=Q), "data_decimation")
        for name, kind in _kinds(study, sources, windows, weight_powers)
    ]
    return _plot_tracking(curves, _P_LABEL, ax)


def plot_frequency_decimation(
    study: Study,
    *,
    P: int = 1,
    sources: Sequence[str] | None = None,
    windows: Sequence[str] | None = None,
    weight_powers: Sequence[int] | None = None,
    ax: Sequence[Axes] | NDArray[Any] | None = None,
) -> Sequence[Axes] | NDArray[Any]:
    """A and d (ms) over Q at one P, on two axes; the truth, where it is known, is dashed grey."""
    curves = [
        (name, study.select(**kind, P=P), "frequency_decimation")
        for name, kind in _kinds(study, sources, windows, weight_powers)
    ]
    return _plot_tracking(curves, _Q_LABEL, ax)


def plot_combined(
    study: Study,
    *,
    source: str | None = None,
    window: str | None = None,
    weight_power: int | None = None,
    ax: Sequence[Axes] | NDArray[Any] | None = None,
) -> Sequence[Axes] | NDArray[Any]:
    """A and d (ms) over Q, a curve for each P, on two axes: one source, window, weight power, by default the first."""
    return _plot_tracking(_combined(study, source, window, weight_power), _Q_LABEL, ax, graded=True)


def plot_computing_time(
    study: Study,
    *,
    over: Literal["P", "Q"] = "P",
    sources: Sequence[str] | None = None,
    windows: Sequence[str] | None = None,
    weight_powers: Sequence[int] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Computing time (ms, logarithmic) over P at Q = 1, or over Q at P = 1."""
    along, label = ("data_decimation", _P_LABEL) if over == "P" else ("frequency_decimation", _Q_LABEL)
    fixed: dict[str, Any] = {"Q": 1} if over == "P" else {"P": 1}
    curves: list[_Curve] = [
        (name, study.select(**kind, **fixed), along) for name, kind in _kinds(study, sources, windows, weight_powers)
    ]
    return _plot_time(curves, label, ax)


def plot_combined_computing_time(
    study: Study,
    *,
    source: str | None = None,
    window: str | None = None,
    weight_power: int | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Computing time (ms, logarithmic) over Q, a curve for each P: one source, window and weight power."""
    return _plot_time(_combined(study, source, window, weight_power), _Q_LABEL, ax, graded=True)


def study_figures(study: Study, source: str | None = None) -> dict[str, Figure]:
    """The figures of one source (by default the first), by name; those for which there are no cells are left out.

    data_decimation, frequency_decimation and computing_time show all windows and weight powers, combined_WINDOW_lPOWER
    the whole grid of one.
    """
    source = source or study.source_names[0]
    timed = study.settings.timing
    made: dict[str, Figure] = {}
    with _style():
        if len({c.settings.data_decimation for c in study.select(source=source, Q=1)}) > 1:
            made["data_decimation"] = _page(plot_data_decimation(study, sources=[source]))
        if len({c.settings.frequency_decimation for c in study.select(source=source, P=1)}) > 1:
            made["frequency_decimation"] = _page(plot_frequency_decimation(study, sources=[source]))
        if timed and made:
            sweeps: tuple[tuple[Literal["P", "Q"], str], ...] = (
                ("P", "data_decimation"),
                ("Q", "frequency_decimation"),
            )
            over = [one for one, name in sweeps if name in made]
            width_in = DOUBLE_COLUMN_IN if len(over) > 1 else SINGLE_COLUMN_IN
            page = Figure(figsize=(width_in, 2.3), layout="constrained")
            axes = page.subplots(1, len(over), squeeze=False, sharey=True)[0]
            for ax, one in zip(axes, over, strict=True):
                plot_computing_time(study, over=one, sources=[source], ax=ax)
            for ax in axes[1:]:
                ax.set_ylabel("")
            _one_legend(page, axes)
            made["computing_time"] = page
        for window, power in itertools.product(study.settings.windows, study.settings.weight_powers):
            kind: Any = {"source": source, "window": window, "weight_power": power}
            cells = study.select(**kind)
            if not any(c.settings.data_decimation > 1 and c.settings.frequency_decimation > 1 for c in cells):
                continue
            page = Figure(figsize=(DOUBLE_COLUMN_IN, 2.6), layout="constrained")
            axes = page.subplots(1, 3 if timed else 2)
            plot_combined(study, **kind, ax=axes[:2])
            axes[0].set_xlabel(_Q_LABEL)
            axes[0].tick_params(labelbottom=True)
            if timed:
                plot_combined_computing_time(study, **kind, ax=axes[2])
            _one_legend(page, axes)
            made[f"combined_{window}_l{power}"] = page
    return made


def write_study_figures(study: Study, directory: str | Path, formats: Sequence[str] = ("pdf", "png")) -> list[Path]:
    """Writes `study_figures` of every source as NAME.pdf and NAME.png (600 dpi); returns the paths.

    With several sources the names begin with the source's number and name. Raises SettingError where it cannot write.
    """
    written = []
    for number, source in enumerate(study.source_names, start=1):
        plain = re.sub(r"[^A-Za-z0-9.-]+", "_", Path(source).name).strip("_.")
        before = f"{number:02d}_{plain}_" if len(study.sources) > 1 else ""
        for name, page in study_figures(study, source).items():
            for ending in formats:
                path = Path(directory) / f"{before}{name}.{ending}"
                try:
                    with _style():
                        page.savefig(path, format=ending)
                except OSError as error:
                    raise SettingError(
                        f"{path}: cannot write the figure there ({error.strerror}); name an existing, writable folder"
                    ) from None
                written.append(path)
    return written


# ---------------------------------------------------------------------------------------------------- parts of a plot

_Curve = tuple[str, "tuple[Cell, ...]", str]  # name in the legend, cells, the setting along the horizontal axis


def _kinds(
    study: Study, sources: Sequence[str] | None, windows: Sequence[str] | None, weight_powers: Sequence[int] | None
) -> list[tuple[str, dict[str, Any]]]:
    """A curve's settings each, and its name: what differs between the curves."""
    chosen: dict[str, tuple[Any, ...]] = {}
    for name, asked, there in (
        ("source", sources, study.source_names),
        ("window", windows, study.settings.windows),
        ("weight_power", weight_powers, study.settings.weight_powers),
    ):
        chosen[name] = tuple(there if asked is None else asked)
        for value in chosen[name]:
            if value not in there:
                raise SettingError(f"the study has no {name} {value!r}; it has {', '.join(map(str, there))}")
    kinds = []
    for values in itertools.product(*chosen.values()):
        kind = dict(zip(chosen, values, strict=True))
        words = [
            f"l = {value}" if name == "weight_power" else str(value)
            for name, value in kind.items()
            if len(chosen[name]) > 1
        ]
        kinds.append((", ".join(words), kind))
    return kinds


def _combined(study: Study, source: str | None, window: str | None, weight_power: int | None) -> list[_Curve]:
    """A curve over Q for every P that is combined with several Q."""
    ((_, kind),) = _kinds(
        study,
        [source or study.source_names[0]],
        [window or study.settings.windows[0]],
        [weight_power or study.settings.weight_powers[0]],
    )
    most_q = max(
        (c.settings.frequency_decimation for c in study.select(**kind) if c.settings.data_decimation > 1), default=None
    )
    curves: list[_Curve] = []
    for p in study.settings.P or ():
        cells = study.select(**kind, P=p)
        # P = 1 may go further: it is shown as far as the others.
        cells = tuple(c for c in cells if most_q is None or c.settings.frequency_decimation <= most_q)
        if len(cells) > 1:
            curves.append((f"P = {p}", cells, "frequency_decimation"))
    return curves


def _plot_tracking(
    curves: Sequence[_Curve], label: str, ax: Sequence[Axes] | NDArray[Any] | None, *, graded: bool = False
) -> Sequence[Axes] | NDArray[Any]:
    with _style():
        ax = _several(ax, 2, 3.4)
        for axis, value, truth, factor, name in (
            (ax[0], "amplitude", "true_amplitude", 1.0, "A (-)"),
            (ax[1], "delay_s", "true_delay_s", 1e3, "d (ms)"),
        ):
            drawn: list[NDArray[np.float64]] = []
            for _, cells, along in curves:
                points = factor * np.array([getattr(c, truth) for c in cells])
                known = points[np.isfinite(points)]
                one_for_all = np.unique(known).size == 1
                line = known[:1] if one_for_all else points
                if not known.size or any(np.array_equal(line, other, equal_nan=True) for other in drawn):
                    continue
                label_once = None if drawn else "truth"
                if one_for_all:
                    axis.axhline(float(line[0]), label=label_once, **_TRUTH)
                else:
                    axis.plot([getattr(c.settings, along) for c in cells], line, label=label_once, **_TRUTH)
                drawn.append(line)
            shown = [_draw(axis, curve, i, len(curves), value, factor, graded) for i, curve in enumerate(curves)]
            values = np.concatenate([*shown, *drawn]) if shown else np.empty(0)
            finite = values[np.isfinite(values)]
            if finite.size:
                middle = float(np.median(finite))
                least = max(_LEAST_SHARE * abs(middle), _LEAST_MS if factor != 1 else 0.0)
                value_range(axis, finite, middle, least)
            axis.yaxis.set_major_formatter(matplotlib.ticker.ScalarFormatter(useOffset=False))
            _few_y_ticks(axis)
            axis.set_ylabel(name)
            _power_axis(axis, curves, label)
        shared_label(ax, label)
        _curve_legend(ax[0])
    return ax


def _plot_time(curves: Sequence[_Curve], label: str, ax: Axes | None, *, graded: bool = False) -> Axes:
    with _style():
        ax = _axes(ax, 2.3)
        for i, curve in enumerate(curves):
            _draw(ax, curve, i, len(curves), "computing_time_s", 1e3, graded)
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
        ax.yaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
        ax.set_ylabel("Computing time (ms)")
        _power_axis(ax, curves, label)
        _curve_legend(ax)
    return ax


def _draw(
    ax: Axes, curve: _Curve, index: int, n_curves: int, value: str, factor: float, graded: bool
) -> NDArray[np.float64]:
    """One curve with open markers, the later the smaller, so that curves that coincide are all seen."""
    name, cells, along = curve
    shade = index / max(n_curves - 1, 1)
    colour = matplotlib.colormaps["viridis"](0.82 * shade) if graded else _COLOURS[index % len(_COLOURS)]
    size = max(6.5 - index * min(2.0, 4.0 / max(n_curves - 1, 1)), 2.5) if n_curves > 1 else 4
    values = factor * np.array([getattr(cell, value) for cell in cells])
    ax.plot(
        [getattr(cell.settings, along) for cell in cells],
        values,
        color=colour,
        linestyle=_LINES[index % len(_LINES)],
        marker=_MARKERS[index % len(_MARKERS)],
        markersize=size,
        markerfacecolor="none",
        markeredgewidth=0.8,
        label=name or None,
        zorder=3 + shade,
    )
    return values


def _power_axis(ax: Axes, curves: Sequence[_Curve], label: str) -> None:
    """A logarithmic axis to base 2 with a tick at each factor, at most ten of them labelled."""
    factors = sorted({getattr(cell.settings, along) for _, cells, along in curves for cell in cells})
    ax.set_xscale("log", base=2)
    if factors:
        step = -(-len(factors) // 10)
        ax.set_xticks(factors, [f"{f}" if i % step == 0 else "" for i, f in enumerate(factors)])
        ax.set_xlim(factors[0] / 2**0.4, factors[-1] * 2**0.4)
    ax.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
    ax.set_xlabel(label)


def _few_y_ticks(ax: Axes) -> None:
    ax.yaxis.set_major_locator(matplotlib.ticker.MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))


def _curve_legend(ax: Axes) -> None:
    """Above the axes, as wide as they are; none for a single curve."""
    _, labels = ax.get_legend_handles_labels()
    if labels:
        columns = min(len(labels), 4 if max(map(len, labels)) < 9 else 3 if max(map(len, labels)) < 14 else 2)
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, columnspacing=1.2, handlelength=2.4)


def _one_legend(page: Figure, axes: Sequence[Axes] | NDArray[Any]) -> None:
    """The first axes' legend, above all of them."""
    handles, labels = axes[0].get_legend_handles_labels()
    for ax in axes:
        if (legend := ax.get_legend()) is not None:
            legend.remove()
    if labels:
        page.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 8), columnspacing=1.2)


def _page(axes: Sequence[Axes] | NDArray[Any]) -> Figure:
    page = axes[0].figure
    assert isinstance(page, Figure)
    return page
