"""How figures look: sizes, colours, fonts, axes. Nothing global stays changed."""

from __future__ import annotations

import functools
import math
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import matplotlib
import matplotlib.font_manager
import matplotlib.ticker
import numpy as np
from matplotlib.figure import Figure

from rthstrack.errors import SettingError
from rthstrack.verdict import display

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

#: Widths of one and of two columns of a journal, in inches.
SINGLE_COLUMN_IN = 3.5
DOUBLE_COLUMN_IN = 7.2

# Published estimates are drawn thin and in THIRD beside the trusted ones, which are VALUE with a band.
TARGET, MEASURED, ERROR, VALUE = "#000000", "#d55e00", "#0072b2", "#0072b2"
SECOND, THIRD, LIMIT, DOUBTFUL, MUTED = "#009e73", "#cc79a7", "#d55e00", "#b9c0c7", "#59636e"

#: Opacity of the band of an interval.
BAND = 0.2
_STYLE: Any = {
    "mathtext.fontset": "stixsans",
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "legend.handlelength": 1.5,
    "legend.borderaxespad": 0.2,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "xtick.minor.size": 1.5,
    "ytick.minor.size": 1.5,
    "lines.linewidth": 0.8,
    "lines.solid_joinstyle": "round",
    "figure.dpi": 150,
    "savefig.dpi": 600,
    "pdf.fonttype": 42,  # TrueType, which journals ask for, instead of Type 3
    "ps.fonttype": 42,
    "svg.fonttype": "path",
    "agg.path.chunksize": 10_000,
    "axes.unicode_minus": True,
}

#: The fonts that journals name, and a free one of the same widths; DejaVu comes with Matplotlib.
_FONTS = ("Arial", "Helvetica", "Liberation Sans", "DejaVu Sans")

# rc_context sets Matplotlib's one global table and puts it back: two threads at once would leave the style behind.
_STYLE_LOCK = threading.RLock()


@contextmanager
def _style() -> Iterator[None]:
    with _STYLE_LOCK, matplotlib.rc_context({**_STYLE, "font.family": _fonts()}):
        yield


@functools.cache
def _fonts() -> list[str]:
    """The fonts that are there, by name: a generic family would be looked up again, without this style, on saving."""
    there = {font.name for font in matplotlib.font_manager.fontManager.ttflist}
    return [name for name in _FONTS if name in there]


def _axes(ax: Axes | None, height_in: float) -> Axes:
    return ax if ax is not None else Figure(figsize=(SINGLE_COLUMN_IN, height_in), layout="constrained").add_subplot()


def _several(ax: Sequence[Axes] | NDArray[Any] | None, n: int, height_in: float) -> Sequence[Axes] | NDArray[Any]:
    if ax is None:
        page = Figure(figsize=(SINGLE_COLUMN_IN, height_in), layout="constrained")
        made: NDArray[Any] = page.subplots(n, 1, sharex=True)
        return made
    shape = np.shape(np.array(ax, dtype=object))
    if shape != (n,):
        raise SettingError(f"this plot needs {n} axes in a row, ax has the shape {shape}; pass a sequence of {n} axes")
    return ax


#: A line of more points than this is drawn by the extremes of so many groups: no print shows more.
DRAWN_SAMPLES, DRAWN_GROUPS = 20_000, 2_000
# Every axis has so many ticks; an inch has room for so many, across and up.
FEWEST_TICKS = 3
_TICKS_PER_IN = (2.0, 3.5)


def drawn(*columns: NDArray[np.float64]) -> NDArray[np.intp] | slice:
    """Which points of lines over time are drawn: all, or the extremes of groups of them."""
    if columns[0].size <= DRAWN_SAMPLES:
        return slice(None)
    return display.extremes(columns, display.even_edges(columns[0].size, DRAWN_GROUPS))


def _room(ax: Axes, which: str) -> int:
    """For how many ticks an axis has room."""
    length = ax.bbox.width if which == "x" else ax.bbox.height
    per_in = _TICKS_PER_IN[which == "y"]
    return max(FEWEST_TICKS, round(per_in * length / ax.figure.dpi))


def even_ticks(ax: Axes, which: str) -> None:
    """Ticks at steps of 1, 2 or 5, as many as there is room for, and three at least."""
    axis = ax.xaxis if which == "x" else ax.yaxis
    steps = [1, 2, 5, 10]
    locator = matplotlib.ticker.MaxNLocator(_room(ax, which), steps=steps, min_n_ticks=FEWEST_TICKS)
    axis.set_major_locator(locator)


def log_ticks(ax: Axes, which: str) -> None:
    """Ticks of a logarithmic axis whose range is set: 1 2 5, 1 3 or whole decades by the room, and three at least."""
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = sorted(axis.get_view_interval())
    room = _room(ax, which)
    ticks: list[float] = []
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    stride = max(1, math.ceil(math.log10(high / low) / room))
    for leads, every in (((1, 2, 5), 1), ((1, 3), 1), ((1,), 1), ((1,), stride)):
        ticks = [lead * 10.0**power for power in powers for lead in leads if power % every == 0]
        ticks = [tick for tick in ticks if low * (1 - 1e-9) <= tick <= high * (1 + 1e-9)]
        if len(ticks) <= 1.6 * room:
            break
    if len(ticks) < FEWEST_TICKS:
        even = matplotlib.ticker.MaxNLocator(room, steps=[1, 2, 5, 10], min_n_ticks=FEWEST_TICKS)
        ticks = [float(tick) for tick in even.tick_values(low, high) if low <= tick <= high and tick > 0]
    axis.set_major_locator(matplotlib.ticker.FixedLocator(ticks))
    axis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: power_of_ten(value)))
    axis.set_minor_locator(matplotlib.ticker.NullLocator())


def power_of_ten(value: float) -> str:
    """A tick's number: plain, or a power of ten where that is shorter."""
    if 1e-3 <= value < 1e5:
        return f"{value:g}"
    power = math.floor(math.log10(value) + 1e-9)
    lead = round(value / 10.0**power)
    return f"{'' if lead == 1 else f'{lead}×'}10{str(power).translate(display.SUPERSCRIPTS)}"


def _legend(ax: Axes, columns: int = 1) -> None:
    """Outside, above the right end of the axes, where it covers no curve."""
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, columnspacing=1.2)


def value_range(ax: Axes, values: NDArray[np.float64], ideal: float, least: float) -> None:
    """The range of the values, not narrower than `least`, with the ideal in it unless that flattens the curve."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return
    low, high = float(finite.min()), float(finite.max())
    short = max(least - (high - low), 0.0)
    low, high = low - short / 2, high + short / 2
    if min(abs(ideal - low), abs(ideal - high)) < 2 * (high - low):
        low, high = min(low, ideal), max(high, ideal)
    air = 0.08 * (high - low)
    ax.set_ylim(low - air, high + air)


def shared_label(ax: Sequence[Axes] | NDArray[Any], label: str) -> None:
    """Stacked axes say their common horizontal axis once, at the bottom."""
    for axis in ax[:-1]:
        axis.set_xlabel("")
        axis.tick_params(labelbottom=False)
    ax[-1].set_xlabel(label)
