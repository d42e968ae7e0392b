"""The figures: whose axes they draw on, what the labels say, what is written to disk. No window, no global state."""

from __future__ import annotations

import dataclasses
import itertools
import math
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.text import Text

import assessments as examples
from rthstrack import plots
from rthstrack.errors import SettingError
from rthstrack.verdict import Assessment, Limits

ONE = (plots.plot_time_history, plots.plot_error, plots.plot_loop, plots.plot_spectra)
SEVERAL = ((plots.plot_frequency_response, 3), (plots.plot_moving, 2), (plots.plot_indices, 2))


@pytest.fixture(scope="module")
def judged() -> Assessment:
    return examples.judged(
        *examples.synthetic(), 200.0, start_s=2.5, limits=Limits(delay_s=0.05, amplitude=0.1), hop_s=0.5
    )


def labels(axes: list[Axes]) -> list[str]:
    return [text for axis in axes for text in (axis.get_xlabel(), axis.get_ylabel())]


@pytest.mark.parametrize("plot", ONE)
def test_a_plot_draws_on_the_axes_it_is_given_and_returns_them(plot: Callable[..., Axes], judged: Assessment) -> None:
    page = Figure()
    ax = page.add_subplot()
    assert plot(judged, ax=ax) is ax
    assert ax.lines
    own = plot(judged)
    assert own.figure is not page
    assert own.figure.get_figwidth() == plots.SINGLE_COLUMN_IN


@pytest.mark.parametrize(("plot", "n"), SEVERAL)
def test_a_plot_of_several_draws_on_the_axes_it_is_given_and_returns_them(
    plot: Callable[..., Any], n: int, judged: Assessment
) -> None:
    axes = Figure().subplots(n, 1)
    assert plot(judged, ax=axes) is axes
    assert all(ax.lines for ax in axes)
    as_list = list(Figure().subplots(n, 1))
    assert plot(judged, ax=as_list) is as_list
    assert len(plot(judged)) == n
    with pytest.raises(SettingError, match=f"needs {n} axes"):
        plot(judged, ax=list(Figure().subplots(n + 1, 1)))
    with pytest.raises(SettingError, match=f"needs {n} axes"):
        plot(judged, ax=Figure().add_subplot())


def test_every_axis_says_its_unit(judged: Assessment) -> None:
    assert labels([plots.plot_time_history(judged)]) == ["Time (s)", "Displacement (mm)"]
    assert labels([plots.plot_error(judged)]) == ["Time (s)", "Error (mm)"]
    assert labels([plots.plot_loop(judged)]) == ["Target (mm)", "Measured (mm)"]
    assert labels([plots.plot_spectra(judged)]) == ["Frequency (Hz)", "Fourier amplitude (mm s)"]
    response = list(plots.plot_frequency_response(judged))
    assert [ax.get_ylabel() for ax in response] == ["Gain (-)", "Delay (ms)", "Coherence (-)"]
    assert response[-1].get_xlabel() == "Frequency (Hz)"
    moving = list(plots.plot_moving(judged))
    assert [ax.get_ylabel() for ax in moving] == ["A (-)", "d (ms)"]
    assert moving[-1].get_xlabel() == "Time (s)"
    assert [ax.get_ylabel() for ax in plots.plot_indices(judged)] == ["Error so far (mm)", "TI (mm²)"]


def test_the_parts_of_a_test_are_called_by_their_names() -> None:
    _, compensator, actuator = examples.parts_of_a_test()
    legend = plots.plot_time_history(compensator).get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["target", "command"]
    assert labels([plots.plot_loop(actuator)]) == ["Command (mm)", "Measured (mm)"]


def test_curves_are_the_assessments_numbers_at_its_own_time(judged: Assessment) -> None:
    time_s = 2.5 + np.arange(judged.target.size) / 200.0
    target, measured = plots.plot_time_history(judged).lines
    np.testing.assert_allclose(target.get_xdata(), time_s, rtol=1e-14)
    np.testing.assert_array_equal(target.get_ydata(), judged.target)
    np.testing.assert_array_equal(measured.get_ydata(), judged.measured)
    error = plots.plot_error(judged).lines[-1]
    np.testing.assert_array_equal(error.get_ydata(), judged.measured - judged.target)
    moving = judged.moving
    assert moving is not None
    amplitude_axis, delay_axis = plots.plot_moving(judged)
    (delay,) = [line for line in delay_axis.lines if line.get_label() == "trusted"]
    np.testing.assert_allclose(np.asarray(delay.get_ydata())[moving.valid], 1e3 * moving.delay_s[moving.valid])
    assert np.isnan(np.asarray(delay.get_ydata())[~moving.valid]).all()
    np.testing.assert_allclose(delay.get_xdata(), 2.5 + moving.time_s)
    # limits at 1 +- 0.1 and +-50 ms, dashed
    assert {0.9, 1.1} <= {float(np.asarray(line.get_ydata())[0]) for line in amplitude_axis.lines}
    assert {-50.0, 50.0} <= {float(np.asarray(line.get_ydata())[0]) for line in delay_axis.lines}


def test_a_part_of_the_record_can_be_shown(judged: Assessment) -> None:
    line = plots.plot_time_history(judged, span_s=(12.5, 14.5)).lines[0]
    np.testing.assert_allclose(np.asarray(line.get_xdata())[[0, -1]], [12.5, 14.5])
    np.testing.assert_array_equal(line.get_ydata(), judged.target[2000:2401])
    loop = plots.plot_loop(judged, span_s=(12.5, 14.5)).lines[-1]
    np.testing.assert_array_equal(loop.get_xdata(), judged.target[2000:2401])
    with pytest.raises(SettingError, match=r"2\.5 to 62\.495 s"):
        plots.plot_error(judged, span_s=(100.0, 101.0))


def test_low_coherence_is_grey(judged: Assessment) -> None:
    response = judged.response
    assert response is not None
    gain_axis = plots.plot_frequency_response(judged)[0]
    sure = response.coherence[response.frequency_hz > 0] >= 0.8
    coloured = [
        line for line in gain_axis.lines if to_hex(line.get_color()) == plots.VALUE and line.get_linewidth() == 1
    ]
    (curve,) = coloured
    assert (~np.isnan(np.asarray(curve.get_ydata()))).tolist() == sure.tolist()


def test_what_is_grey_does_not_stretch_the_axis(judged: Assessment) -> None:
    response = judged.response
    assert response is not None
    wild = dataclasses.replace(response, delay_s=np.where(response.coherence < 0.8, 100.0, response.delay_s))
    delay_axis = plots.plot_frequency_response(wild)[1]
    assert delay_axis.get_ylim()[1] < 1000  # ms


def test_results_can_be_drawn_without_an_assessment(judged: Assessment) -> None:
    assert judged.response is not None
    assert judged.moving is not None
    assert len(plots.plot_frequency_response(judged.response)) == 3
    assert len(plots.plot_moving(judged.moving)) == 2


def test_what_is_missing_is_said_in_the_axes() -> None:
    bare = examples.judged(*examples.synthetic(1000), 200.0, moving_evaluation=False, response=False, unit=None)
    for ax in plots.plot_moving(bare):
        assert bare.moving_note in ax.texts[0].get_text()
    for ax in plots.plot_frequency_response(bare):
        assert bare.response_note in ax.texts[0].get_text()
    assert plots.plot_error(bare).get_ylabel() == "Error (unit not stated)"


@pytest.mark.parametrize(
    ("name", "start"), [("a.png", b"\x89PNG\r\n\x1a\n"), ("a.pdf", b"%PDF-"), ("a.svg", b"<?xml"), ("A.PDF", b"%PDF-")]
)
def test_the_ending_decides_the_format(name: str, start: bytes, tmp_path: Path, judged: Assessment) -> None:
    path = tmp_path / name
    plots.write_figure(judged, path)
    assert path.read_bytes().startswith(start)


def test_a_pdf_embeds_truetype_fonts_and_fits_two_columns(tmp_path: Path, judged: Assessment) -> None:
    path = tmp_path / "figure.pdf"
    plots.write_figure(judged, path)
    content = path.read_bytes()
    assert b"/Type3" not in content
    assert b"/Subtype /Type3" not in content
    assert b"/FontFile2" in content
    assert b"/MediaBox [ 0 0 518.4 " in content  # 7.2 in of 72 points


@pytest.mark.parametrize(("name", "said"), [("a.jpg", "ends in .jpg"), ("figure", "has no ending")])
def test_another_ending_is_one_clear_line(name: str, said: str, tmp_path: Path, judged: Assessment) -> None:
    with pytest.raises(SettingError, match=said) as caught:
        plots.write_figure(judged, tmp_path / name)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())
    with pytest.raises(SettingError, match="cannot write the figure"):
        plots.write_figure(judged, tmp_path / "missing" / "a.png")


def test_the_composed_figure_has_every_panel(judged: Assessment) -> None:
    page = plots.figure(judged)
    assert page.get_figwidth() == plots.DOUBLE_COLUMN_IN
    letters = [ax.get_title(loc="left") for ax in page.axes if ax.get_title(loc="left")]
    assert letters == ["(a)", "(b)", "(c)", "(d)", "(e)", "(f)", "(g)", "(h)"]
    history, zoomed = page.axes[0], page.axes[1]
    low, high = zoomed.get_xlim()
    assert high - low == pytest.approx(4.0, abs=0.02)
    assert history.get_xlim() == pytest.approx((2.5, 2.5 + 11_999 / 200))


def test_panels_are_chosen_by_name_in_order_and_the_figure_has_the_size_asked_for(judged: Assessment) -> None:
    page = plots.figure(judged, panels=("moving", "error"), size_in=(85 / 25.4, 4.0))
    assert page.get_size_inches() == pytest.approx((85 / 25.4, 4.0))
    assert [ax.get_ylabel() for ax in page.axes] == ["A (-)", "d (ms)", "Error (mm)"]
    tops = [ax.get_position().y1 for ax in page.axes]
    assert tops == sorted(tops, reverse=True)
    assert [ax.get_title(loc="left") for ax in plots.figure(judged, panels=("error",)).axes] == [""]
    with pytest.raises(SettingError, match="no panel 'moved'; choose among history, strongest"):
        plots.figure(judged, panels=("moved",))
    with pytest.raises(SettingError, match=r"from 1\.5 to 50 in, found 0\.5 in"):
        plots.figure(judged, size_in=(0.5, None))


@pytest.mark.parametrize("size_in", [None, (85 / 25.4, None)])
def test_no_text_of_a_figure_covers_another_or_is_cut_off(
    size_in: tuple[float, float | None] | None, judged: Assessment
) -> None:
    page = plots.figure(judged, panels=plots.PANELS, size_in=size_in)
    canvas = FigureCanvasAgg(page)
    canvas.draw()
    renderer, whole = canvas.get_renderer(), page.bbox
    for ax in page.axes:
        for axis in (ax.xaxis, ax.yaxis):
            # The loop has no room for more than its axes' own; a note has none.
            low, high = sorted(axis.get_view_interval())
            ticks = [at for at in axis.get_majorticklocs() if low <= at <= high]
            assert len(ticks) >= 3 or ax.texts or not ticks, (ax.get_ylabel(), ticks)
            drawn = [label for label in axis.get_ticklabels() if label.get_visible() and label.get_text()]
            boxes = [label.get_window_extent(renderer) for label in drawn]
            boxes = [box for box, label in zip(boxes, drawn, strict=True) if low <= _place(label, axis) <= high]
            for one, other in itertools.pairwise(boxes):
                assert not one.overlaps(other), (ax.get_ylabel(), [label.get_text() for label in drawn])
            boxes.append(axis.label.get_window_extent(renderer))
            for box in boxes:
                assert box.width == 0 or (whole.x0 <= box.x0 and box.x1 <= whole.x1), ax.get_ylabel()
                assert box.width == 0 or (whole.y0 <= box.y0 and box.y1 <= whole.y1), ax.get_ylabel()


def _place(label: Text, axis: Axis) -> float:
    return float(label.get_position()[0 if isinstance(axis, XAxis) else 1])


def test_the_equivalent_frequency_is_named_once_and_within_its_axes(judged: Assessment) -> None:
    page = plots.figure(judged)
    named = [(ax, text) for ax in page.axes for text in ax.texts if text.get_text().startswith("f_eq")]
    ((ax, text),) = named
    assert text.get_text() == f"f_eq {judged.tracking.equivalent_frequency_hz:.3g} Hz"
    FigureCanvasAgg(page).draw()
    box = text.get_window_extent()
    assert ax.bbox.x0 <= box.x0 < box.x1 <= ax.bbox.x1
    assert ax.bbox.y0 <= box.y0 < box.y1 <= ax.bbox.y1 + 1


def test_windows_over_a_limit_are_shaded(judged: Assessment) -> None:
    tight = examples.judged(*examples.synthetic(), 200.0, limits=Limits(delay_s=0.02), hop_s=0.5)
    (gate,) = tight.gates
    assert gate.over_s
    amplitude_axis, delay_axis = plots.plot_moving(tight)
    spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in delay_axis.patches]
    assert spans == [pytest.approx((first - 0.25, last + 0.25)) for first, last in gate.over_s]
    assert not list(amplitude_axis.patches)
    assert not [patch for ax in plots.plot_moving(judged) for patch in ax.patches]


def test_a_long_record_is_drawn_by_its_extremes() -> None:
    target, measured = examples.synthetic(100_000, 1000.0)
    target[54_321] = 99.0
    long = examples.judged(target, measured, 1000.0, moving_evaluation=False, response=False)
    line = plots.plot_time_history(long).lines[0]
    values = np.asarray(line.get_ydata())
    assert values.size < 10_000
    assert values.max() == 99.0
    assert np.asarray(line.get_xdata())[values.argmax()] == pytest.approx(54.321)


def test_time_and_frequency_are_drawn_where_gain_or_delay_change_with_both(judged: Assessment) -> None:
    for ax in plots.plot_time_frequency(judged):
        assert "do not change with both" in ax.texts[0].get_text()
    both = examples.varying_over_both()
    found = both.time_frequency()
    assert found is not None
    assert "delay_s" in found.changes_with_both
    for band in found.bands:
        middle = math.sqrt(band.low_hz * band.high_hz)
        true = 0.012 + 0.0015 * middle + 0.006 * band.time_s / (both.target.size / both.rate_hz)
        np.testing.assert_allclose(band.delay_s, true, atol=0.0012)
    gain_axis, delay_axis = plots.plot_time_frequency(both)
    assert len(delay_axis.collections) == len(found.bands) == len(gain_axis.collections)
    assert delay_axis.get_ylim() == pytest.approx((found.bands[0].low_hz, found.bands[-1].high_hz))
    assert "time-frequency" in plots.PANELS
    assert len(plots.figure(both).axes) > len(plots.figure(judged).axes)


def test_low_coherence_is_empty_over_time_and_frequency() -> None:
    both = examples.varying_over_both()
    found = both.time_frequency()
    assert found is not None
    band = found.bands[0]
    noisy = dataclasses.replace(band, coherence=np.where(np.arange(band.time_s.size) == 1, 0.5, 1.0))
    (known,) = dataclasses.replace(found, bands=(noisy,)).known("delay_s")
    assert np.flatnonzero(np.isnan(known)).tolist() == [1]


def test_many_figures_are_written_by_several_processes(tmp_path: Path, judged: Assessment) -> None:
    paths = [tmp_path / f"{number}.svg" for number in range(3)]
    done: list[int] = []
    plots.write_figures(
        [(judged, path) for path in paths],
        panels=("error",),
        meanwhile=lambda: done.append(len(list(tmp_path.iterdir()))),
    )
    assert len(done) == 1
    assert all(path.read_bytes().startswith(b"<?xml") for path in paths)
    with pytest.raises(SettingError, match="cannot write the figure"):
        plots.write_figures([(judged, tmp_path / "missing" / f"{n}.svg") for n in range(3)], panels=("error",))


def test_a_unit_with_a_dollar_sign_is_a_unit_and_not_a_formula(tmp_path: Path) -> None:
    odd = examples.judged(*examples.synthetic(2000), 200.0, unit="$x_{$")
    plots.write_figure(odd, tmp_path / "odd.svg")


def test_matplotlibs_own_settings_are_left_as_they_were_by_threads_too(tmp_path: Path, judged: Assessment) -> None:
    before = dict(matplotlib.rcParams)
    failures: list[BaseException] = []

    def draw(number: int) -> None:
        try:
            plots.write_figure(judged, tmp_path / f"{number}.svg")
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=draw, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    assert len(list(tmp_path.iterdir())) == 4
    assert dict(matplotlib.rcParams) == before


def test_neither_pyplot_nor_a_display_is_needed() -> None:
    code = "import sys, rthstrack.plots; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# Two runs on one axes -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def two_runs() -> tuple[Assessment, Assessment]:
    """One late and too large; one of another target, longer, larger and later."""
    target, measured = examples.synthetic(14_000, delay_s=0.07, gain=1.2)
    first = examples.judged(*examples.synthetic(), 200.0, limits=Limits(delay_s=0.05))
    return first, examples.judged(1.5 * target, 1.5 * measured, 200.0, limits=Limits(delay_s=0.05))


def drawn(plot: Callable[..., Any], n: int, *runs: tuple[Assessment, dict[str, Any]]) -> list[Axes]:
    axes = list(np.atleast_1d(np.asarray(Figure(layout="constrained").subplots(n, 1), dtype=object)))
    for run, how in runs:
        plot(run, ax=axes[0] if n == 1 else axes, **how)
    return axes


def legend_of(ax: Axes) -> dict[str, str]:
    """Each entry with its colour."""
    legend = ax.get_legend()
    assert legend is not None
    colours = [to_hex(handle.get_color()) for handle in legend.get_lines()]
    return dict(zip([text.get_text() for text in legend.get_texts()], colours, strict=True))


ALL = (*((plot, 1) for plot in ONE), *SEVERAL)


@pytest.mark.parametrize(("plot", "n"), ALL)
def test_two_runs_have_their_colours_and_names_and_stay_in_view(
    plot: Callable[..., Any], n: int, two_runs: tuple[Assessment, Assessment]
) -> None:
    one, other = two_runs
    axes = drawn(plot, n, (one, {"label": "before", "color": "#123456"}), (other, {"label": "after"}))
    entries = legend_of(axes[0])
    ours = {name: colour for name, colour in entries.items() if name.startswith(("before", "after"))}
    colours = [{colour for name, colour in ours.items() if name.startswith(run)} for run in ("before", "after")]
    # The first run's target is black, wherever there is one.
    assert colours[0] - {plots.TARGET} == {"#123456"}
    assert len(colours[1]) == 1
    assert not colours[0] & colours[1]
    # What either run shows alone is in view, and a single run looks as it does alone.
    for i, ax in enumerate(axes):
        (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
        for run in two_runs:
            alone = drawn(plot, n, (run, {}))[i]
            assert x0 <= alone.get_xlim()[0] + 1e-9
            assert x1 >= alone.get_xlim()[1] - 1e-9
            for line in alone.lines if plot is not plots.plot_frequency_response else ():
                shown = np.asarray(line.get_ydata(), dtype=float)
                if plot is plots.plot_moving and to_hex(line.get_color()) == plots.THIRD:
                    continue  # of a named run the trusted estimate alone
                if plot is plots.plot_spectra:
                    shown = shown[shown > shown.max() / 100]
                assert np.nanmin(shown) >= y0 - 1e-9 * abs(y0)
                assert np.nanmax(shown) <= y1 + 1e-9 * abs(y1)


@pytest.mark.parametrize(("plot", "n"), ALL)
def test_a_second_run_without_a_name_is_run_2(
    plot: Callable[..., Any], n: int, two_runs: tuple[Assessment, Assessment]
) -> None:
    alone = drawn(plot, n, (two_runs[0], {}))[0].get_legend()
    if alone is not None:
        assert not any("run" in text.get_text() for text in alone.get_texts())
    entries = legend_of(drawn(plot, n, *((run, {}) for run in two_runs))[0])
    assert any(name.startswith("run 1") for name in entries)
    assert any(name.startswith("run 2") for name in entries)


def test_a_target_in_common_is_drawn_once_and_has_no_runs_name(two_runs: tuple[Assessment, Assessment]) -> None:
    one, _ = two_runs
    same = examples.judged(one.target, 0.9 * one.measured, 200.0)
    for plot in (plots.plot_time_history, plots.plot_spectra):
        (ax,) = drawn(plot, 1, (one, {"label": "A"}), (same, {"label": "B"}))
        assert list(legend_of(ax)) == ["target", "A: measured", "B: measured"]


def test_axes_that_were_cleared_are_new(two_runs: tuple[Assessment, Assessment]) -> None:
    one, other = two_runs
    (ax,) = drawn(plots.plot_error, 1, (other, {}))
    ax.clear()
    plots.plot_error(one, ax=ax)
    assert ax.get_xlim() == plots.plot_error(one).get_xlim()
    assert legend_of(ax) == legend_of(plots.plot_error(one))


def test_one_axes_has_one_unit(two_runs: tuple[Assessment, Assessment]) -> None:
    one, other = two_runs
    with pytest.raises(SettingError, match="two units: mm is drawn, in was given"):
        drawn(plots.plot_error, 1, (one, {}), (dataclasses.replace(other, unit="in"), {}))
