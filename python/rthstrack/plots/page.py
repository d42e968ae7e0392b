"""Figures composed of panels, and writing them to files: one, or many by several processes."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from rthstrack.errors import SettingError
from rthstrack.plots.assessment import (
    plot_error,
    plot_frequency_response,
    plot_indices,
    plot_loop,
    plot_moving,
    plot_spectra,
    plot_time_frequency,
    plot_time_history,
)
from rthstrack.plots.style import DOUBLE_COLUMN_IN, _style
from rthstrack.verdict import display
from rthstrack.verdict.display import FIGURE_IN, PANELS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from matplotlib.axes import Axes

    from rthstrack.verdict.assessment import Assessment

_FORMATS = ("png", "pdf", "svg")
# Room for labels and numbers around the axes, in inches: fixed, as measuring them takes half of the time.
_LEFT, _RIGHT, _RIGHT_AXIS, _TOP, _BOTTOM = 0.62, 0.12, 0.62, 0.27, 0.43
# Narrower figures have one panel a row.
_TWO_COLUMNS_IN = 5.0
# Up to so many figures are drawn here: starting a process takes as long.
_FEW_FIGURES = 2


@dataclass(frozen=True, slots=True)
class _Panel:
    """`share` of the width of a figure of two columns, height in inches, axes one above another (or `beside`)."""

    draw: Callable[[Assessment, Any], Any]
    share: float
    height_in: float
    n_axes: int = 1
    right_axis: bool = False
    beside: bool = False


def _strongest(assessment: Assessment) -> tuple[float, float]:
    first, end = display.strongest_span(assessment.target, assessment.rate_hz)
    return assessment.start_s + first / assessment.rate_hz, assessment.start_s + (end - 1) / assessment.rate_hz


_PANELS = {
    "history": _Panel(lambda a, ax: plot_time_history(a, ax=ax), 1.0, 1.65),
    "strongest": _Panel(lambda a, ax: plot_time_history(a, ax=ax, span_s=_strongest(a)), 0.6, 2.1),
    "loop": _Panel(lambda a, ax: plot_loop(a, ax=ax, span_s=_strongest(a)), 0.4, 2.1),
    "error": _Panel(lambda a, ax: plot_error(a, ax=ax), 1.0, 1.5),
    "spectra": _Panel(lambda a, ax: plot_spectra(a, ax=ax), 1.0, 2.1, right_axis=True),
    "moving": _Panel(lambda a, ax: plot_moving(a, ax=ax), 0.5, 2.6, n_axes=2),
    "response": _Panel(lambda a, ax: plot_frequency_response(a, ax=ax), 0.5, 2.6, n_axes=2),
    "indices": _Panel(lambda a, ax: plot_indices(a, ax=ax), 0.5, 2.6, n_axes=2),
    "time-frequency": _Panel(lambda a, ax: plot_time_frequency(a, ax=ax), 1.0, 1.9, n_axes=2, beside=True),
}
_USUAL = ("history", "strongest", "loop", "spectra", "moving", "response")


def figure(
    assessment: Assessment, *, panels: Sequence[str] | None = None, size_in: tuple[float, float | None] | None = None
) -> Figure:
    """One figure of panels, two columns wide: histories, their strongest 4 s, loop, spectra, A and d.

    panels: names of PANELS, in order; by default the usual ones, with "time-frequency" where it says something.
    size_in: width and height in inches, by default 7.2 and what the panels need; below 5 in one panel a row.
    """
    if panels is None:
        panels = (*_USUAL, "time-frequency") if assessment.time_frequency() is not None else _USUAL
    _check(panels, size_in)
    width = DOUBLE_COLUMN_IN if size_in is None else size_in[0]
    rows = list(_rows(panels, width))
    heights = [max(_height(name, width) for name in row) for row in rows]
    height = sum(heights) if size_in is None or size_in[1] is None else size_in[1]
    scale = height / sum(heights)
    with _style():
        page = Figure(figsize=(width, height))
        top, found = height, []
        for row, needed in zip(rows, heights, strict=True):
            left = 0.0
            for name in row:
                share = _PANELS[name].share if len(row) > 1 or width >= _TWO_COLUMNS_IN else 1.0
                box = (left, top - scale * needed, share * width, scale * needed)
                axes = _axes_of(page, _PANELS[name], box, narrow=width < _TWO_COLUMNS_IN)
                _PANELS[name].draw(assessment, axes if len(axes) > 1 else axes[0])
                if name == "history" and "strongest" in panels:
                    axes[0].axvspan(*_strongest(assessment), color="#000000", alpha=0.08, linewidth=0)
                found += axes
                left += share * width
            top -= scale * needed
        if len(found) > 1:
            for axis, letter in zip(found, "abcdefghijklmnopqrstuvwxyz", strict=False):
                axis.set_title(f"({letter})", loc="left", y=1.0, pad=3)
    return page


def write_figure(
    assessment: Assessment,
    path: str | Path,
    *,
    panels: Sequence[str] | None = None,
    size_in: tuple[float, float | None] | None = None,
) -> None:
    """Write `figure(assessment)` as PNG (600 dpi), PDF or SVG, by the ending of `path`; panels, size_in: of `figure`.

    Errors: SettingError where the ending is another, or the file cannot be written.
    """
    ending = Path(path).suffix.lower().removeprefix(".")
    if ending not in _FORMATS:
        found = f"ends in .{ending}" if ending else "has no ending"
        raise SettingError(f"{path}: a figure is written as .png, .pdf or .svg, this name {found}; choose one of these")
    page = figure(assessment, panels=panels, size_in=size_in)
    # Most of a figure is white: packing it harder takes seconds and saves little.
    how: dict[str, Any] = {"pil_kwargs": {"compress_level": 1}} if ending == "png" else {}
    try:
        with _style():
            page.savefig(path, format=ending, **how)
    except OSError as error:
        raise SettingError(
            f"{path}: cannot write the figure there ({error.strerror}); name a file in an existing, writable folder"
        ) from error


def write_figures(
    figures: Sequence[tuple[Assessment, Path]],
    *,
    panels: Sequence[str] | None = None,
    size_in: tuple[float, float | None] | None = None,
    meanwhile: Callable[[], None] | None = None,
) -> None:
    """Write each as `write_figure` does; many at once in processes of their own, as Matplotlib is not for threads.

    `meanwhile` is done while they draw. Errors: those of `write_figure`.
    """
    workers = min(len(figures), os.cpu_count() or 1)
    if len(figures) <= _FEW_FIGURES or workers < 2:
        for assessment, path in figures:
            write_figure(assessment, path, panels=panels, size_in=size_in)
        if meanwhile is not None:
            meanwhile()
        return
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    # A process that was split off would inherit locks that threads of this one hold.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        waiting = [pool.submit(write_figure, a, path, panels=panels, size_in=size_in) for a, path in figures]
        if meanwhile is not None:
            meanwhile()
        for one in waiting:
            one.result()


def _check(panels: Sequence[str], size_in: tuple[float, float | None] | None) -> None:
    if not panels:
        raise SettingError(f"a figure needs at least one panel of {', '.join(PANELS)}")
    for name in panels:
        if name not in _PANELS:
            raise SettingError(f"there is no panel '{name}'; choose among {', '.join(PANELS)}")
    low, high = FIGURE_IN
    for side in size_in or ():
        if side is not None and not low <= side <= high:
            raise SettingError(f"the sides of a figure are from {low:g} to {high:g} in, found {side:g} in")


def _rows(panels: Sequence[str], width: float) -> Iterator[list[str]]:
    """Panels in rows, as many in each as there is room for."""
    row: list[str] = []
    taken = 0.0
    for name in panels:
        share = _PANELS[name].share if width >= _TWO_COLUMNS_IN else 1.0
        if row and taken + share > 1 + 1e-9:
            yield row
            row, taken = [], 0.0
        row.append(name)
        taken += share
    if row:
        yield row


def _height(name: str, width: float) -> float:
    panel = _PANELS[name]
    if width >= _TWO_COLUMNS_IN:
        return panel.height_in
    if name == "loop":
        return min(width, 3.0)
    return panel.height_in * (2 if panel.beside else 1)


def _axes_of(page: Figure, panel: _Panel, box: tuple[float, float, float, float], *, narrow: bool) -> list[Axes]:
    """The axes of a panel in its box (left, bottom, width, height; inches), with room for labels."""
    width, height = page.get_size_inches()
    left, bottom, wide, high = box
    right = _RIGHT_AXIS if panel.right_axis else _RIGHT

    def axes(x: float, y: float, w: float, h: float) -> Axes:
        return page.add_axes((x / width, y / height, max(w, 0.2) / width, max(h, 0.2) / height))

    if panel.beside and not narrow:
        each = wide / panel.n_axes
        return [
            axes(left + k * each + _LEFT, bottom + _BOTTOM, each - _LEFT - right, high - _TOP - _BOTTOM)
            for k in range(panel.n_axes)
        ]
    gap = _TOP + _BOTTOM if panel.beside else _TOP
    each = (high - _TOP - _BOTTOM - gap * (panel.n_axes - 1)) / panel.n_axes
    places = [bottom + _BOTTOM + (each + gap) * k for k in reversed(range(panel.n_axes))]
    return [axes(left + _LEFT, y, wide - _LEFT - right, each) for y in places]
