"""Figures fit for a journal, drawn with Matplotlib from an `Assessment`; nothing is computed here.

Every function takes `ax=` (one Axes, or a sequence of them where it needs several) and returns it; without `ax` it
makes a figure of its own, one column wide, reachable as `ax.figure`. No pyplot: nothing global stays changed and no
window opens. Colours are Okabe and Ito's, as on the report's page.

Called again with the same axes, a function adds a run: in the next colour or in `color`, called `label` in the legend.
Limits then take in all runs, and a target in common is drawn once.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import matplotlib.cm
import matplotlib.colors
import numpy as np

from rthstrack.errors import SettingError
from rthstrack.plots.runs import DASHED, FAINT, Run
from rthstrack.plots.style import (
    BAND,
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
    drawn,
    even_ticks,
    log_ticks,
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
        target, measured = assessment.target[part], assessment.measured[part]
        kept = drawn(target, measured)
        run.draw_target(time_s[kept], target[kept], target_role, target)
        (line,) = ax.plot(time_s[kept], measured[kept], color=run.colour, linewidth=0.7)
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
        error = assessment.measured[part] - assessment.target[part]
        kept = drawn(error)
        (line,) = ax.plot(time_s[kept], error[kept], color=run.colour)
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
        even_ticks(ax, "x")
        even_ticks(ax, "y")
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
        ax.set_xscale("log")
        ax.set_yscale("log")
        run.draw_target(frequency, target, target_role, t.target_spectrum)
        (line,) = ax.plot(frequency, measured, color=run.colour, linewidth=0.7)
        run.name(line, measured_role)
        _frequency_axis(ax, run, *shown)
        peak = max(target[inside].max(initial=0.0), measured[inside].max(initial=0.0))
        low = min(target[inside].min(initial=peak), measured[inside].min(initial=peak))
        if peak > 0:
            ax.set_ylim(max(low, 1e-6 * peak) / 1.5, peak * 4)
        run.keep_y(before)
        log_ticks(ax, "y")
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
            axis.set_xscale("log")
            axis.plot(frequency, values, **faint)
            (line,) = axis.plot(frequency, np.where(sure, values, np.nan), color=run.colour, linewidth=1)
            its.name(line, "")
            relied_on = values[sure & in_view]
            value_range(axis, its.with_earlier(relied_on if relied_on.size else values[in_view]), ideal, least)
        for coherence_axis in ax[2:]:
            coherence_axis.set_xscale("log")
            coherence_axis.plot(frequency, coherence, **faint)
            coherence_axis.plot(frequency, np.where(sure, coherence, np.nan), color=run.colour, linewidth=1)
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
            even_ticks(axis, "y")
            if isinstance(result, Assessment):
                _mark_equivalent_frequency(axis, result, its, labelled=False)
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
    for, its limits (dashed), when they were exceeded (shaded) and the whole record's trusted A and d (dotted). With
    `label` or `color`, and of further runs, the trusted estimate alone.
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
            over = assessment.over_limit_s()
            for axis, name in ((amplitude_axis, "amplitude"), (delay_axis, "delay")):
                for first, last in over[name]:
                    axis.axvspan(first, last, color=LIMIT, alpha=0.15, linewidth=0)
        amplitude_axis.set_ylabel("A (-)")
        delay_axis.set_ylabel("d (ms)")
        for its in runs:
            if assessment is not None:
                its.show_x(assessment.start_s, assessment.start_s + assessment.target.size / assessment.rate_hz)
            elif time_s.size > 1:
                its.show_x(time_s[0], time_s[-1])
        for axis in ax:
            even_ticks(axis, "x")
            even_ticks(axis, "y")
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
        kept = drawn(h.max_tracking_error, h.rms_error, h.tracking_indicator)
        (line,) = error_axis.plot(time_s[kept], h.max_tracking_error[kept], color=run.colour)
        run.name(line, "MTE")
        (line,) = error_axis.plot(time_s[kept], h.rms_error[kept], **beside)
        run.name(line, "RMS")
        error_axis.autoscale(axis="y")
        error_axis.set_ylim(bottom=0)
        error_axis.set_ylabel(_label("Error so far", assessment.unit))
        _legend(error_axis, columns=2)
        if run.first:
            indicator_axis.axhline(0, color=MUTED, linewidth=0.5)
        indicator_axis.plot(time_s[kept], h.tracking_indicator[kept], color=SECOND if alone else run.colour)
        indicator_axis.set_ylabel(_label("TI", f"{assessment.unit}²" if assessment.unit else None))
        for axis, its in zip(ax, runs, strict=True):
            _time_axis(axis, its, time_s)
        shared_label(ax, "Time (s)")
    return ax


def plot_time_frequency(
    assessment: Assessment, *, ax: Sequence[Axes] | NDArray[Any] | None = None
) -> Sequence[Axes] | NDArray[Any]:
    """Gain and delay (ms) over time and frequency on two axes, in half octaves; empty where the coherence is low.

    Drawn only where they change with both; else the axes say so.
    """
    with _style():
        ax = _several(ax, 2, 3.6)
        found = assessment.time_frequency()
        if found is None:
            for one in ax:
                _note(one, "gain and delay do not change with both time and frequency")
            return ax
        low, high = found.bands[0].low_hz, found.bands[-1].high_hz
        for axis, name, factor, label in ((ax[0], "gain", 1.0, "Gain (-)"), (ax[1], "delay_s", 1e3, "Delay (ms)")):
            rows = [factor * values for values in found.known(name)]
            # One odd cell is not to take the contrast of the others.
            ends = np.nanquantile(np.concatenate(rows), (0.02, 0.98))
            norm = matplotlib.colors.Normalize(*ends)
            for band, values in zip(found.bands, rows, strict=True):
                centres = assessment.start_s + band.time_s
                edges = np.append(centres - band.hop_s / 2, centres[-1] + band.hop_s / 2)
                axis.pcolormesh(edges, [band.low_hz, band.high_hz], values[np.newaxis], cmap="cividis", norm=norm)
            axis.set_yscale("log")
            axis.set_ylim(low, high)
            axis.set_xlim(assessment.start_s, assessment.start_s + assessment.target.size / assessment.rate_hz)
            log_ticks(axis, "y")
            even_ticks(axis, "x")
            axis.set_ylabel("Frequency (Hz)")
            axis.set_xlabel("Time (s)")
            # Above the axes, where it takes no width from the time.
            bar = axis.inset_axes((0.6, 1.06, 0.27, 0.05))
            colours = matplotlib.cm.ScalarMappable(norm=norm, cmap="cividis")
            scale = axis.figure.colorbar(colours, cax=bar, orientation="horizontal", ticks=[])
            scale.outline.set_visible(False)
            for at, value, side in ((-0.03, ends[0], "right"), (1.03, ends[1], "left")):
                bar.text(at, 0.5, display.significant(float(value), 3), transform=bar.transAxes, ha=side, va="center")
            bar.text(-0.5, 0.5, label, transform=bar.transAxes, ha="right", va="center")
    return ax


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
    even_ticks(ax, "x")
    even_ticks(ax, "y")


def _weights(ax: Axes, frequency: NDArray[np.float64], weights: NDArray[np.float64], top: float) -> None:
    """The weights of the evaluation, on an axis at the right."""
    weight_axis = ax.twinx()
    weight_axis.fill_between(frequency, weights, color=SECOND, alpha=0.3, linewidth=0)
    weight_axis.set_ylim(0, top)
    weight_axis.set_ylabel("Weight (-)", color=SECOND)
    weight_axis.tick_params(axis="y", colors=SECOND)
    weight_axis.spines["right"].set_visible(True)
    weight_axis.spines["right"].set_color(SECOND)
    even_ticks(weight_axis, "y")
    # The curves belong in front of the weights, although the weights' axis was added later.
    ax.set_zorder(weight_axis.get_zorder() + 1)
    ax.patch.set_visible(False)


def _frequency_axis(ax: Axes, run: Run, low: float, high: float) -> None:
    """A logarithmic axis whose labels are plain numbers."""
    run.show_x(low, high)
    log_ticks(ax, "x")
    ax.set_xlabel("Frequency (Hz)")


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
    low, high = ax.get_xlim()
    # Text has no axes to be cut off by.
    if not low < f_eq < high or f_eq in known:
        return
    known.append(f_eq)
    ax.axvline(f_eq, color=MUTED if run.alone else run.colour, linewidth=0.7, linestyle=(0, (4, 3)))
    if labelled and run.first:
        right = f_eq**2 > low * high
        ax.annotate(
            f"f_eq {display.significant(f_eq, 3)} Hz",
            (f_eq, 1),
            xycoords=("data", "axes fraction"),
            xytext=(-3 if right else 3, -2),
            textcoords="offset points",
            ha="right" if right else "left",
            va="top",
            color=MUTED,
        )


def _note(ax: Axes, text: str) -> Axes:
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color=MUTED, wrap=True)
    ax.set_xticks([])
    ax.set_yticks([])
    return ax
