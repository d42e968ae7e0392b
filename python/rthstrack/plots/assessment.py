"""Figures fit for a journal, drawn with Matplotlib from an `Assessment`; nothing is computed here.

Every function takes `ax=` (one Axes, or a sequence of them where it needs several) and returns it; without `ax` it
makes a figure of its own, one column wide, reachable as `ax.figure`. No pyplot: nothing global stays changed and no
window opens. Colours are Okabe and Ito's, as on the report's page.

Called again with the same axes, a function adds a run: in the next colour or in `color`, called `label` in the legend.
Limits then take in all runs, and a target in common is drawn once.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import matplotlib.font_manager
import matplotlib.ticker
import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from rthstrack.errors import SettingError
from rthstrack.plots.runs import DASHED, FAINT, Run
from rthstrack.plots.style import (
    BAND,
    DOUBLE_COLUMN_IN,
    DOUBTFUL,
    ERROR,
    LIMIT,
    MEASURED,
    MUTED,
    SECOND,
    THIRD,
    VALUE,
    _axes,
    _legend,
    _several,
    _style,
    shared_label,
    value_range,
)
from rthstrack.verdict import display
from rthstrack.verdict.assessment import Assessment
from rthstrack.verdict.limits import Limits

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.typing import ColorType
    from numpy.typing import NDArray

    from rthstrack.evaluation.response import FrequencyResponse, FrequencySlopes
    from rthstrack.evaluation.tracking import MovingTracking

_FORMATS = ("png", "pdf", "svg")


def plot_time_history(
    assessment: Assessment,
    *,
    ax: Axes | None = None,
    span_s: tuple[float, float] | None = None,
    label: str | None = None,
    color: ColorType | None = None,
) -> Axes:
    """Target and measured over time, in the signals' unit; `span_s` limits the time shown (s, the recording's own)."""
    with _style():
        ax = _axes(ax, 1.8)
        run = Run(ax, label, color, MEASURED, assessment.unit)
        target_role, measured_role = display.signal_roles(assessment.part)
        time_s, part = _span(assessment, span_s)
        run.draw_target(time_s, assessment.target[part], target_role, assessment.target[part])
        (line,) = ax.plot(time_s, assessment.measured[part], color=run.colour, linewidth=0.7)
        run.name(line, measured_role)
        ax.set_ylabel(_label(display.quantity(assessment.unit), assessment.unit))
        _time_axis(ax, run, time_s)
        _legend(ax, columns=2)
    return ax


def plot_error(
    assessment: Assessment,
    *,
    ax: Axes | None = None,
    span_s: tuple[float, float] | None = None,
    label: str | None = None,
    color: ColorType | None = None,
) -> Axes:
    """The error, measured less target, over time."""
    with _style():
        ax = _axes(ax, 1.5)
        run = Run(ax, label, color, ERROR, assessment.unit)
        target_role, measured_role = display.signal_roles(assessment.part)
        time_s, part = _span(assessment, span_s)
        if run.first:
            ax.axhline(0, color=MUTED, linewidth=0.5)
        (line,) = ax.plot(time_s, assessment.measured[part] - assessment.target[part], color=run.colour)
        run.name(line, "", f"{measured_role} \N{MINUS SIGN} {target_role}")
        ax.set_ylabel(_label("Error", assessment.unit))
        _time_axis(ax, run, time_s)
        _legend(ax)
    return ax


def plot_loop(
    assessment: Assessment,
    *,
    ax: Axes | None = None,
    span_s: tuple[float, float] | None = None,
    label: str | None = None,
    color: ColorType | None = None,
) -> Axes:
    """Measured against target, same scale both ways; the opening shows the lag, the dashed line is perfect tracking."""
    with _style():
        ax = _axes(ax, 3.2)
        run = Run(ax, label, color, VALUE, assessment.unit)
        target_role, measured_role = display.signal_roles(assessment.part)
        _, part = _span(assessment, span_s)
        target, measured = assessment.target[part], assessment.measured[part]
        ends = [min(target.min(), measured.min()), max(target.max(), measured.max())]
        # One dashed line for all runs, from the least to the greatest.
        perfect = next((line for line in ax.lines if line.get_gid() == "perfect"), None)
        if run.first or perfect is None:
            (perfect,) = ax.plot(ends, ends, color=MUTED, linestyle=(0, (5, 3)), linewidth=0.6, gid="perfect")
        there = np.asarray(perfect.get_xdata())
        ends = [min(*ends, *there), max(*ends, *there)]
        perfect.set_data(ends, ends)
        ax.relim()
        # A long record crosses itself many thousand times; as vectors it would be slow to open and to print.
        rasterized = target.size > 20_000
        (line,) = ax.plot(target, measured, color=run.colour, linewidth=0.6, rasterized=rasterized)
        run.name(line, "")
        ax.set_aspect("equal", adjustable="box")
        ax.set_xlabel(_label(target_role.capitalize(), assessment.unit))
        ax.set_ylabel(_label(measured_role.capitalize(), assessment.unit))
        _few_ticks(ax)
        if not run.alone:
            _legend(ax, columns=2)
    return ax


def plot_spectra(
    assessment: Assessment, *, ax: Axes | None = None, label: str | None = None, color: ColorType | None = None
) -> Axes:
    """Fourier amplitudes of both signals (unit*s, log/log) and, on an axis at the right, the weights of the evaluation.

    Many bins are drawn by the extremes of groups of neighbours. The dashed line marks the equivalent frequency. Of
    several runs the weights are the first's.
    """
    with _style():
        ax = _axes(ax, 2.3)
        t = assessment.tracking
        target_role, measured_role = display.signal_roles(assessment.part)
        if t.frequency_hz is None or t.weights is None or t.target_spectrum is None or t.measured_spectrum is None:
            return _note(ax, "no spectra: evaluated without weights")
        run = Run(ax, label, color, MEASURED, assessment.unit)
        before = ax.get_ylim()
        scale = display.fourier_scale(t)
        target, measured = np.abs(t.target_spectrum) * scale, np.abs(t.measured_spectrum) * scale
        edges = display.log_edges(t.frequency_hz.size, 3_000)
        kept = display.extremes((target, measured, t.weights), edges)
        frequency, target, measured, weights = (
            column[kept] for column in (t.frequency_hz, target, measured, t.weights)
        )
        shown = display.judged_range(t) or (float(frequency[0]), float(frequency[-1]))
        inside = (frequency >= shown[0]) & (frequency <= shown[1])
        if run.first:
            _weights(ax, frequency, weights, 1.15 * float(weights[inside].max(initial=0.0)) or 1.0)
        run.draw_target(frequency, target, target_role, t.target_spectrum, logarithmic=True)
        (line,) = ax.loglog(frequency, measured, color=run.colour, linewidth=0.7)
        run.name(line, measured_role)
        _frequency_axis(ax, run, *shown)
        peak = max(target[inside].max(initial=0.0), measured[inside].max(initial=0.0))
        low = min(target[inside].min(initial=peak), measured[inside].min(initial=peak))
        if peak > 0:
            ax.set_ylim(max(low, 1e-6 * peak) / 1.5, peak * 4)
        run.keep_y(before)
        _mark_equivalent_frequency(ax, assessment, run)
        ax.set_ylabel(_label("Fourier amplitude", f"{assessment.unit} s" if assessment.unit else None))
        _legend(ax, columns=2)
    return ax


def plot_frequency_response(
    result: Assessment | FrequencyResponse,
    *,
    ax: Sequence[Axes] | NDArray[Any] | None = None,
    label: str | None = None,
    color: ColorType | None = None,
) -> Sequence[Axes] | NDArray[Any]:
    """Gain, delay (ms) and coherence over frequency on three axes, with 95 % intervals; grey where coherence is low.

    Two axes in place of three leave the coherence out. An assessment also gives the straight lines over the frequencies
    that hold the energy (dashed).
    """
    with _style():
        ax = _several(ax, 2 if np.shape(np.array(ax, dtype=object)) == (2,) else 3, 3.8)
        response = result.response if isinstance(result, Assessment) else result
        limits = result.limits if isinstance(result, Assessment) else Limits()
        gain_axis, delay_axis = ax[:2]
        if response is None:
            for one in ax:
                _note(one, (result.response_note if isinstance(result, Assessment) else None) or "not determined")
            return ax
        runs = [Run(one, label, color, VALUE) for one in ax]
        run, alone = runs[0], runs[0].alone
        faint: Any = {"color": DOUBTFUL} if alone else {"color": run.colour, "alpha": FAINT}
        above_zero = response.frequency_hz > 0
        frequency, coherence = response.frequency_hz[above_zero], response.coherence[above_zero]
        sure = coherence >= display.DRAWN_GREY_BELOW
        shown = display.judged_range(result.tracking) if isinstance(result, Assessment) else None
        low, high = shown or (float(frequency[0]), float(frequency[-1]))
        low = max(low, float(frequency[0]))
        if not run.first:
            low, high = min(low, gain_axis.get_xlim()[0]), max(high, gain_axis.get_xlim()[1])
        in_view = (frequency >= low) & (frequency <= high)
        for axis, its, values, interval, ideal, least in (
            (gain_axis, runs[0], response.gain[above_zero], response.gain_interval[above_zero], 1.0, 0.02),
            (
                delay_axis,
                runs[1],
                response.delay_s[above_zero] * 1e3,
                response.delay_interval_s[above_zero] * 1e3,
                0.0,
                0.5,
            ),
        ):
            if its.first:
                axis.axhline(ideal, color=MUTED, linewidth=0.5)
            axis.fill_between(frequency, interval[:, 0], interval[:, 1], color=run.colour, alpha=BAND, linewidth=0)
            axis.semilogx(frequency, values, **faint)
            (line,) = axis.semilogx(frequency, np.where(sure, values, np.nan), color=run.colour, linewidth=1)
            its.name(line, "")
            relied_on = values[sure & in_view]
            value_range(axis, its.with_earlier(relied_on if relied_on.size else values[in_view]), ideal, least)
        for coherence_axis in ax[2:]:
            coherence_axis.semilogx(frequency, coherence, **faint)
            coherence_axis.semilogx(frequency, np.where(sure, coherence, np.nan), color=run.colour, linewidth=1)
            coherence_axis.axhline(display.DRAWN_GREY_BELOW, color=MUTED, linewidth=0.5, linestyle=(0, (1, 2)))
            coherence_axis.set_ylim(0, 1.05)
            coherence_axis.set_ylabel("Coherence (-)")
        if isinstance(result, Assessment):
            _slope_lines(gain_axis, delay_axis, result.slopes, SECOND if alone else run.colour)
        _limit_lines(gain_axis, delay_axis, runs, limits)
        gain_axis.set_ylabel("Gain (-)")
        delay_axis.set_ylabel("Delay (ms)")
        for axis, its in zip(ax, runs, strict=True):
            _frequency_axis(axis, its, low, high)
            if isinstance(result, Assessment):
                _mark_equivalent_frequency(axis, result, its, labelled=axis is gain_axis)
        if not alone:
            _legend(gain_axis, columns=3)
        shared_label(ax, "Frequency (Hz)")
    return ax


def plot_moving(
    result: Assessment | MovingTracking,
    *,
    ax: Sequence[Axes] | NDArray[Any] | None = None,
    label: str | None = None,
    color: ColorType | None = None,
) -> Sequence[Axes] | NDArray[Any]:
    """A(t) and d(t) (ms) of moving windows, at their centres, on two axes; gaps where nothing could be determined.

    An assessment gives the trusted estimate with its 95 % intervals as a band beside the published or the one asked
    for, its limits (dashed) and the whole record's trusted A and d (dotted). With `label` or `color`, and
    of further runs, the trusted estimate alone.
    """
    with _style():
        ax = _several(ax, 2, 2.8)
        assessment = result if isinstance(result, Assessment) else None
        moving = result.beside_moving if isinstance(result, Assessment) else result
        amplitude_axis, delay_axis = ax
        if moving is None:
            for one in ax:
                _note(one, (assessment.moving_note if assessment else None) or "not determined")
            return ax
        runs = [Run(one, label, color, VALUE) for one in ax]
        run, alone = runs[0], runs[0].alone
        time_s = moving.time_s + (assessment.start_s if assessment else 0.0)
        trusted = assessment.trusted_moving if assessment else moving
        if trusted is moving:
            trusted = moving if moving.settings.estimator == "least_squares" else None
        for axis, its, name, factor, ideal, least in (
            (amplitude_axis, runs[0], "amplitude", 1.0, 1.0, 0.02),
            (delay_axis, runs[1], "delay_s", 1e3, 0.0, 0.5),
        ):
            if its.first:
                axis.axhline(ideal, color=MUTED, linewidth=0.5)
            shown = []
            if trusted is not moving and (alone or trusted is None):
                values = np.where(moving.valid, getattr(moving, name), np.nan) * factor
                colour, width = (run.colour, 1.0) if trusted is None else (THIRD, 0.7)
                (line,) = axis.plot(time_s, values, color=colour, linewidth=width)
                called = display.ESTIMATORS[moving.settings.estimator]
                if trusted is None:
                    its.name(line, "", called)
                else:
                    line.set_label(called)
                shown.append(values)
            if trusted is not None:
                values = np.where(trusted.valid, getattr(trusted, name), np.nan) * factor
                ends = (trusted.amplitude_interval if name == "amplitude" else trusted.delay_interval_s) * factor
                axis.fill_between(time_s, ends[:, 0], ends[:, 1], color=run.colour, alpha=BAND, linewidth=0)
                (line,) = axis.plot(time_s, values, color=run.colour, linewidth=1)
                its.name(line, "", "trusted")
                shown.append(values)
            value_range(axis, its.with_earlier(np.concatenate(shown)), ideal, least)
        if not alone or (assessment is not None and trusted is not None and trusted is not moving):
            _legend(amplitude_axis, columns=2)
        if assessment is not None:
            whole = assessment.trusted if math.isfinite(float(assessment.trusted.delay_s)) else assessment.tracking
            dotted: Any = {"color": run.colour, "linewidth": 0.6, "linestyle": (0, (1, 2))}
            amplitude_axis.axhline(float(whole.amplitude), **dotted)
            delay_axis.axhline(float(whole.delay_s) * 1e3, **dotted)
            _limit_lines(amplitude_axis, delay_axis, runs, assessment.limits)
        amplitude_axis.set_ylabel("A (-)")
        delay_axis.set_ylabel("d (ms)")
        for its in runs:
            if assessment is not None:
                its.show_x(assessment.start_s, assessment.start_s + assessment.target.size / assessment.rate_hz)
            elif time_s.size > 1:
                its.show_x(time_s[0], time_s[-1])
        shared_label(ax, "Time (s)")
    return ax


def plot_indices(
    assessment: Assessment,
    *,
    ax: Sequence[Axes] | NDArray[Any] | None = None,
    label: str | None = None,
    color: ColorType | None = None,
) -> Sequence[Axes] | NDArray[Any]:
    """Histories of the time-domain indices on two axes: largest and RMS error so far, and the tracking indicator."""
    with _style():
        ax = _several(ax, 2, 2.8)
        error_axis, indicator_axis = ax
        runs = [Run(one, label, color, ERROR, assessment.unit) for one in ax]
        run, alone = runs[0], runs[0].alone
        beside: Any = {"color": THIRD} if alone else {"color": run.colour, "linestyle": DASHED}
        h = assessment.histories
        time_s = assessment.start_s + np.arange(h.rms_error.size) / h.rate_hz
        (line,) = error_axis.plot(time_s, h.max_tracking_error, color=run.colour)
        run.name(line, "MTE")
        (line,) = error_axis.plot(time_s, h.rms_error, **beside)
        run.name(line, "RMS")
        error_axis.autoscale(axis="y")
        error_axis.set_ylim(bottom=0)
        error_axis.set_ylabel(_label("Error so far", assessment.unit))
        _legend(error_axis, columns=2)
        if run.first:
            indicator_axis.axhline(0, color=MUTED, linewidth=0.5)
        indicator_axis.plot(time_s, h.tracking_indicator, color=SECOND if alone else run.colour)
        indicator_axis.set_ylabel(_label("TI", f"{assessment.unit}²" if assessment.unit else None))
        for axis, its in zip(ax, runs, strict=True):
            _time_axis(axis, its, time_s)
        shared_label(ax, "Time (s)")
    return ax


def figure(assessment: Assessment) -> Figure:
    """One figure, two columns wide: histories, their strongest 4 s, loop, spectra, A and d over time and frequency."""
    with _style():
        page = Figure(figsize=(DOUBLE_COLUMN_IN, 8.2), layout=ConstrainedLayoutEngine(w_pad=0.05, h_pad=0.05))
        # Grids within a grid: columns of one width for all rows would have no room for the labels between them.
        rows = page.add_gridspec(4, 1, height_ratios=(1.1, 1.7, 1.7, 2.6))
        enlarged, curves = rows[1].subgridspec(1, 5), rows[3].subgridspec(2, 2)
        first, end = display.strongest_span(assessment.target, assessment.rate_hz)
        strongest = (
            assessment.start_s + first / assessment.rate_hz,
            assessment.start_s + (end - 1) / assessment.rate_hz,
        )
        history = plot_time_history(assessment, ax=page.add_subplot(rows[0]))
        history.axvspan(*strongest, color="#000000", alpha=0.08, linewidth=0)
        zoomed = plot_time_history(assessment, ax=page.add_subplot(enlarged[:3]), span_s=strongest)
        loop = plot_loop(assessment, ax=page.add_subplot(enlarged[3:]), span_s=strongest)
        spectra = plot_spectra(assessment, ax=page.add_subplot(rows[2]))
        moving = [page.add_subplot(curves[row, 0]) for row in (0, 1)]
        plot_moving(assessment, ax=moving)
        response = [page.add_subplot(curves[row, 1]) for row in (0, 1)]
        plot_frequency_response(assessment, ax=response)
        for axis, letter in zip((history, zoomed, loop, spectra, *moving, *response), "abcdefgh", strict=True):
            axis.set_title(f"({letter})", loc="left", fontweight="bold", pad=3)
    return page


def write_figure(assessment: Assessment, path: str | Path) -> None:
    """Write `figure(assessment)` as PNG (600 dpi), PDF or SVG, by the ending of `path`.

    Errors: SettingError where the ending is another, or the file cannot be written.
    """
    ending = Path(path).suffix.lower().removeprefix(".")
    if ending not in _FORMATS:
        found = f"ends in .{ending}" if ending else "has no ending"
        raise SettingError(f"{path}: a figure is written as .png, .pdf or .svg, this name {found}; choose one of these")
    page = figure(assessment)
    try:
        with _style():
            page.savefig(path, format=ending)
    except OSError as error:
        raise SettingError(
            f"{path}: cannot write the figure there ({error.strerror}); name a file in an existing, writable folder"
        ) from error


def _label(name: str, unit: str | None) -> str:
    """A label with its unit; a dollar sign in it would otherwise start a formula."""
    return display.with_unit(name, unit).replace("$", r"\$")


def _span(assessment: Assessment, span_s: tuple[float, float] | None) -> tuple[NDArray[np.float64], slice]:
    """The times of the samples within `span_s` and the slice that takes them."""
    n, rate_hz = assessment.target.size, assessment.rate_hz
    first, end = 0, n
    if span_s is not None:
        first = max(int(np.ceil((span_s[0] - assessment.start_s) * rate_hz - 1e-6)), 0)
        end = min(int(np.floor((span_s[1] - assessment.start_s) * rate_hz + 1e-6)) + 1, n)
    if end - first < 2:
        last = assessment.start_s + (n - 1) / rate_hz
        raise SettingError(
            f"span_s {span_s} holds fewer than two samples; the record runs from {assessment.start_s:g} to {last:g} s"
        )
    return assessment.start_s + np.arange(first, end) / rate_hz, slice(first, end)


def _time_axis(ax: Axes, run: Run, time_s: NDArray[np.float64]) -> None:
    run.show_x(time_s[0], time_s[-1])
    ax.set_xlabel("Time (s)")


def _weights(ax: Axes, frequency: NDArray[np.float64], weights: NDArray[np.float64], top: float) -> None:
    """The weights of the evaluation, on an axis at the right."""
    weight_axis = ax.twinx()
    weight_axis.fill_between(frequency, weights, color=SECOND, alpha=0.3, linewidth=0)
    weight_axis.set_ylim(0, top)
    weight_axis.set_ylabel("Weight of a bin (-)", color=SECOND)
    weight_axis.tick_params(axis="y", colors=SECOND)
    weight_axis.spines["right"].set_visible(True)
    weight_axis.spines["right"].set_color(SECOND)
    # The curves belong in front of the weights, although the weights' axis was added later.
    ax.set_zorder(weight_axis.get_zorder() + 1)
    ax.patch.set_visible(False)


def _frequency_axis(ax: Axes, run: Run, low: float, high: float) -> None:
    """A logarithmic axis whose labels are plain numbers: 1 2 5 over a few decades, whole decades over more."""
    run.show_x(low, high)
    low, high = ax.get_xlim()
    few = high < 300 * low
    ax.xaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5) if few else (1,)))
    ax.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    ax.set_xlabel("Frequency (Hz)")


def _few_ticks(ax: Axes) -> None:
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(matplotlib.ticker.MaxNLocator(5, steps=[1, 2, 5, 10]))


def _slope_lines(gain_axis: Axes, delay_axis: Axes, slopes: FrequencySlopes | None, colour: ColorType) -> None:
    """Gain and delay as straight lines over frequency, which a logarithmic axis bends."""
    if slopes is None:
        return
    frequency = np.linspace(*slopes.band_hz, 100)
    away = frequency - slopes.equivalent_frequency_hz
    for axis, value, slope in (
        (gain_axis, slopes.gain, slopes.gain_per_hz),
        (delay_axis, slopes.delay_s * 1e3, slopes.delay_s_per_hz * 1e3),
    ):
        axis.plot(frequency, value + slope * away, color=colour, linewidth=0.8, linestyle=(0, (5, 3)))


def _limit_lines(amplitude_axis: Axes, delay_axis: Axes, runs: Sequence[Run], limits: Limits) -> None:
    """Limits as dashed lines; one far from the curve stays out of view."""
    for axis, run, limit, around in (
        (amplitude_axis, runs[0], limits.amplitude, 1.0),
        (delay_axis, runs[1], _ms(limits.delay_s), 0.0),
    ):
        low, high = axis.get_ylim()
        span = high - low
        known = run.marks("limit")
        for value in [*known, *(() if limit is None else (around - limit, around + limit))]:
            if low - 2 * span < value < high + 2 * span:
                if value not in known:
                    axis.axhline(value, color=LIMIT, linewidth=0.7, linestyle=(0, (5, 3)))
                    known.append(value)
                low, high = min(low, value - 0.05 * span), max(high, value + 0.05 * span)
        axis.set_ylim(low, high)


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else 1e3 * seconds


def _mark_equivalent_frequency(ax: Axes, assessment: Assessment, run: Run, labelled: bool = True) -> None:
    f_eq = float(assessment.tracking.equivalent_frequency_hz)
    known = run.marks("f_eq")
    if not np.isfinite(f_eq) or f_eq in known:
        return
    known.append(f_eq)
    ax.axvline(f_eq, color=MUTED if run.alone else run.colour, linewidth=0.7, linestyle=(0, (4, 3)))
    if labelled and run.first:
        ax.annotate(
            r"$f_\mathrm{eq}$",
            (f_eq, 1),
            xycoords=("data", "axes fraction"),
            xytext=(3, -2),
            textcoords="offset points",
            va="top",
            color=MUTED,
        )


def _note(ax: Axes, text: str) -> Axes:
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color=MUTED, wrap=True)
    ax.set_xticks([])
    ax.set_yticks([])
    return ax
