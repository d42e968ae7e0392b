"""The study of P and Q: the numbers against the shared reference, what errors and changes are, the figures."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from rthstrack import plots
from rthstrack.errors import RecordingError, SettingError, SignalError
from rthstrack.evaluation.settings import Settings
from rthstrack.plots import study as study_plots
from rthstrack.studies import Cell, Pair, StudiedSource, Study, StudySettings, read_pairs, study
from tolerances import physical, round_off

RATE = 200.0
PAPER = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512]


def burst(delay_s: float = 0.0, amplitude: float = 1.0, n: int = 4000) -> np.ndarray:
    """A burst of 2 Hz that has died down at both ends."""
    t = np.arange(n) / RATE - delay_s
    return amplitude * np.sin(2 * np.pi * 2 * t) * np.exp(-((t - n / RATE / 2) ** 2) / 8)


def late(name: str = "late", **about: Any) -> Pair:
    """20 ms late and 5 % too large."""
    return Pair(burst(), burst(0.02, 1.05), RATE, name, **about)


@pytest.fixture(scope="module")
def reference(shared: Path) -> dict[str, Pair]:
    pairs = {}
    for name, delay_s in (("chy101n_linear", 0.001), ("chy101n_boucwen", 0.005)):
        with np.load(shared / "reference" / f"{name}.npz") as arrays:
            pairs[name] = Pair(arrays["target"], arrays["measured"], float(arrays["rate_hz"]), name, (1.1, delay_s))
    return pairs


@pytest.fixture(scope="module")
def studied(reference: dict[str, Pair]) -> Study:
    """The two CHY101-N tests of the paper, over its grids."""
    return study(list(reference.values()), weight_powers=(1, 2, 3), timing=False)


# --- numbers --------------------------------------------------------------------------------------------------------


def test_the_linear_test_gives_gain_and_delay_for_every_p_to_512_and_every_q_to_64(studied: Study) -> None:
    about: dict[str, Any] = {"source": "chy101n_linear", "window": "boxcar", "weight_power": 2}
    cells = [studied.cell(P=p, **about) for p in PAPER] + [studied.cell(Q=q, **about) for q in PAPER[:7]]
    for cell in cells:
        assert abs(cell.amplitude / 1.1 - 1) < physical(0.01, "%"), cell.settings
        assert abs(cell.delay_s / 0.001 - 1) < physical(0.1, "%"), cell.settings
    for q in PAPER:
        assert abs(studied.cell(Q=q, **about).delay_s / 0.001 - 1) < physical(0.5, "%")


def test_cells_are_the_shared_reference_values(studied: Study, shared: Path) -> None:
    compared = 0
    for case in json.loads((shared / "reference" / "expected.json").read_text(encoding="utf-8")):
        settings = {"P": 1, "Q": 1, "power": 2, "window": "boxcar", "method": "spectral"} | case["settings"]
        inside = settings["window"] in studied.settings.windows and settings["method"] == "spectral"
        if case["pair"] not in studied.source_names or not inside or {"detrend", "band"} & settings.keys():
            continue
        cell = studied.cell(
            source=case["pair"],
            P=settings["P"],
            Q=settings["Q"],
            window=settings["window"],
            weight_power=settings["power"],
        )
        tolerance = physical(1e-9 if settings["P"] == 1 else 1e-6, "relative")
        for name in ("amplitude", "delay_s", "phase_rad", "equivalent_frequency_hz"):
            assert getattr(cell, name) == pytest.approx(case[name], rel=tolerance), (case["settings"], name)
        assert cell.n_bins == case["n_bins"]
        assert cell.delta_f_hz == case["delta_f_hz"]
        compared += 1
    assert compared == 24


def test_the_other_settings_reach_the_evaluation(reference: dict[str, Pair], shared: Path) -> None:
    pair = reference["chy101n_boucwen"]
    cases = json.loads((shared / "reference" / "expected.json").read_text(encoding="utf-8"))
    known = {json.dumps(case["settings"]): case for case in cases if case["pair"] == pair.name}

    def same(found: Study, key: dict[str, Any], tolerance: float, **cell: Any) -> None:
        assert found.cell(**cell).delay_s == pytest.approx(known[json.dumps(key)]["delay_s"], rel=tolerance)

    boxcar: dict[str, Any] = {"windows": ["boxcar"], "timing": False}
    same(study(pair, P=[1, 64], decimator="chebyshev", **boxcar), {"P": 64, "method": "chebyshev"}, 1e-6, P=64, Q=1)
    same(study(pair, P=[1], Q=[1], band_hz=(0.1, 20), **boxcar), {"band": [0.1, 20.0]}, 1e-9)
    detrended = {"window": "hann", "detrend": "linear", "Q": 4}
    same(study(pair, P=[1], windows="hann", detrend="linear", timing=False), detrended, 1e-9, Q=4)


def test_errors_and_changes_are_relative_to_the_truth_and_to_p_and_q_of_one() -> None:
    found = study(late(truth=(1.0, 0.025)), P=(1, 4), Q=(1, 16), timing=False)
    for window in ("boxcar", "hann"):
        first = found.cell(window=window)
        assert (first.amplitude_change, first.delay_change) == (0, 0)
        for cell in found.select(window=window):
            assert cell.amplitude_change == cell.amplitude / first.amplitude - 1
            assert cell.delay_change == cell.delay_s / first.delay_s - 1
            assert cell.amplitude_error == cell.amplitude - 1
            assert cell.delay_error == cell.delay_s / 0.025 - 1
            assert cell.delay_error_s == cell.delay_s - 0.025
    # the pair is 20 ms late and 5 % too large: 5 ms less than what was called the truth
    assert found.cell(window="boxcar").delay_error_s == pytest.approx(-0.005, abs=physical(0.01, "ms"))
    assert found.cell(window="boxcar").amplitude_error == pytest.approx(0.05, abs=physical(0.01, "%"))


def test_changes_are_known_where_the_grid_lacks_p_and_q_of_one() -> None:
    whole = study(late(), P=(1, 4), Q=(1, 16), windows=["hann"], timing=False)
    alone = study(late(), P=(4,), Q=(16,), windows=["hann"], timing=False)
    (cell,) = alone.cells
    assert (cell.amplitude_change, cell.delay_change) == (
        whole.cell(P=4, Q=16).amplitude_change,
        whole.cell(P=4, Q=16).delay_change,
    )
    assert cell.delay_change != 0


def test_a_truth_that_varies_with_frequency_is_taken_at_each_cells_equivalent_frequency() -> None:
    found = study(late(truth=lambda f: (1 + f, f / 1000)), P=(1, 8), Q=(1, 32), timing=False)
    assert len({cell.equivalent_frequency_hz for cell in found.cells}) > 2
    for cell in found.cells:
        assert cell.true_amplitude == 1 + cell.equivalent_frequency_hz
        assert cell.true_delay_s == cell.equivalent_frequency_hz / 1000


def test_an_unknown_truth_and_a_relative_error_of_no_delay_are_nan() -> None:
    unknown = study(late(truth=lambda f: None), P=[1], Q=[1], timing=False).cells[0]
    assert all(math.isnan(getattr(unknown, name)) for name in ("true_amplitude", "delay_error", "delay_error_s"))
    only_delay = study(late(), P=[1], Q=[1], truth=(math.nan, 0.0), timing=False).cells[0]
    assert math.isnan(only_delay.amplitude_error)
    assert math.isnan(only_delay.delay_error)
    assert only_delay.delay_error_s == only_delay.delay_s


# --- the grid -------------------------------------------------------------------------------------------------------


def test_the_default_grids_are_the_papers() -> None:
    found = study(late(), windows="boxcar", timing=False)
    grid = {(c.settings.data_decimation, c.settings.frequency_decimation) for c in found.cells}
    wanted = {(p, 1) for p in PAPER} | {(1, q) for q in PAPER} | {(p, q) for p in PAPER[:7] for q in PAPER[:6]}
    assert grid == wanted
    assert len(found.cells) == len(wanted)


def test_lists_that_are_given_are_combined_whole_unless_limited() -> None:
    whole = study(late(), P=(1, 128), Q=(64, 1), windows="boxcar", timing=False)
    assert [(c.settings.data_decimation, c.settings.frequency_decimation) for c in whole.cells] == [
        (1, 1), (1, 64), (128, 1), (128, 64),
    ]  # fmt: skip
    limited = study(late(), P=(1, 128), Q=(64, 1), combined=(64, 64), windows="boxcar", timing=False)
    assert len(limited.cells) == 3
    with pytest.raises(SettingError, match=r"no cell is left: P 128 with Q 64, combined up to \(64, 32\)"):
        study(late(), P=(128,), Q=(64,), combined=(64, 32))


NONSENSE: list[tuple[dict[str, Any], str]] = [
    ({"P": [1, 0]}, "P must hold powers of two .*, found 0"),
    ({"P": [3]}, "P must hold powers of two .*, found 3"),
    ({"Q": [-1]}, "Q must hold powers of two .*, found -1"),
    ({"Q": [2.0]}, "Q must hold powers of two .*, found 2.0"),
    ({"Q": [True]}, "Q must hold powers of two .*, found True"),
    ({"P": ["two"]}, "P must hold powers of two .*, found 'two'"),
    ({"P": "16"}, "P must hold powers of two .*, found '1'"),
    ({"P": []}, "P is empty"),
    ({"Q": ()}, "Q is empty"),
    ({"P": 16}, "P must be a list of values, found 16"),
    ({"Q": [4, 2, 4]}, "Q holds 4 twice"),
    ({"P": [2**40]}, "P must be a whole number from 1 to .*, not 1099511627776"),
    ({"combined": (64,)}, r"combined must be .* two numbers, not \(64,\)"),
    ({"combined": (0, 4)}, "combined P must be a whole number from 1 .*, not 0"),
    ({"windows": []}, "windows is empty"),
    ({"windows": ["hann", "hann"]}, "windows holds 'hann' twice"),
    ({"windows": ["hanning"]}, "window must be one of .*, not 'hanning'"),
    ({"weight_powers": [17]}, "weight_power must be a whole number from 1 to 16, not 17"),
    ({"weight_powers": ["x"]}, "weight_powers must be a whole number, not 'x'"),
    ({"detrend": "cubic"}, "detrend must be one of .*, not 'cubic'"),
    ({"decimator": "boxcar"}, "decimator must be one of .*, not 'boxcar'"),
    ({"estimator": "best"}, "estimator must be .*, not 'best'"),
    ({"band_hz": (20, 1)}, "band_hz must be two finite frequencies 0 <= low <= high, not \\(20, 1\\)"),
    ({"band_hz": (-1, 1)}, "band_hz must be two finite frequencies 0 <= low <= high, not \\(-1, 1\\)"),
    ({"band_hz": 4}, "band_hz must be two finite frequencies"),
]


@pytest.mark.parametrize(("settings", "message"), NONSENSE, ids=[str(s) for s, _ in NONSENSE])
def test_nonsense_is_one_line_that_names_the_value(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingError, match=message) as caught:
        study(late(), **settings)
    assert "\n" not in str(caught.value)


def test_a_cell_that_leaves_nothing_to_judge_by_is_nan_with_a_reason() -> None:
    # 4000 samples are padded to 4096: P Q = 4096 leaves no bin; the burst has 1.5 to 2.5 Hz, the last P keeps 0.05 Hz
    found = study(late(truth=(1.05, 0.02)), P=(1, 2048, 8192), Q=(1, 4, 4096), windows="hann")
    invalid = {(c.settings.data_decimation, c.settings.frequency_decimation): c.reason for c in found.cells if c.reason}
    assert set(invalid) == {(2048, 4), (8192, 1), (8192, 4), (1, 4096), (2048, 4096), (8192, 4096)}
    assert invalid[1, 4096].startswith("no frequency bin is left: P = 1 and Q = 4096 on 4096 points")
    empty = found.cell(P=8192)
    for name in ("amplitude", "delay_s", "delay_change", "true_delay_s", "delay_error", "computing_time_s"):
        assert math.isnan(getattr(empty, name))
    assert empty.n_bins == 0
    assert found.cell(P=2048).n_bins == 1
    assert found.cell().computing_time_s > 0


def test_a_band_without_bins_is_a_result_not_a_failure() -> None:
    found = study(late(), P=(1, 64), Q=[1], band_hz=(2, 3), windows="boxcar", timing=False)
    assert found.cell().reason == ""
    assert "the band asks for a bin in 2 to 3 Hz" in found.cell(P=64).reason


# --- sources --------------------------------------------------------------------------------------------------------


def test_several_sources_are_studied_under_their_names() -> None:
    other = Pair(burst(), burst(-0.01), RATE)
    found = study({"slow": late(), "early": other}, P=[1], Q=[1], windows="boxcar", timing=False)
    assert found.source_names == ("slow", "early")
    assert found.cell(source="slow").delay_s == pytest.approx(0.02, abs=physical(0.01, "ms"))
    assert found.cell(source="early").delay_s == pytest.approx(-0.01, abs=physical(0.01, "ms"))
    assert study(other, P=[1], Q=[1], timing=False).source_names == ("test",)
    with pytest.raises(SettingError, match="2 sources are called 'late'"):
        study([late(), late()])
    with pytest.raises(SettingError, match="there is no source"):
        study([])
    with pytest.raises(SettingError, match="must be a Pair, a Run or a file, not ndarray"):
        study([burst(), burst()])  # type: ignore[list-item]


def test_a_pair_that_cannot_be_judged_is_refused_by_its_name() -> None:
    with pytest.raises(SignalError, match="broken: target has 1 NaN"):
        Pair(np.where(np.arange(4000) == 7, np.nan, burst()), burst(), RATE, "broken")
    with pytest.raises(SignalError, match="broken: target is constant"):
        Pair(np.zeros(4000), burst(), RATE, "broken")
    with pytest.raises(SignalError, match="measured has 3999 samples but target has 4000"):
        Pair(burst(), burst()[1:], RATE)
    with pytest.raises(SignalError, match="one actuator at a time"):
        Pair(np.ones((10, 2)), np.ones((10, 2)), RATE)
    with pytest.raises(SettingError, match="rate"):
        Pair(burst(), burst(), -1)


def test_a_recorded_file_is_studied_by_its_channels(tmp_path: Path) -> None:
    path = tmp_path / "test.csv"
    columns = [np.arange(4000) / RATE, burst(), burst(0.02, 1.05), burst(-0.01)]
    header = "Time (s),target (mm),measured (mm),other (cm)"
    np.savetxt(path, np.column_stack(columns), fmt="%.9g", delimiter=",", header=header, comments="")
    found = study(path, P=[1], Q=[1], windows="boxcar", timing=False)
    (source,) = found.sources
    assert (source.name, source.rate_hz, source.n_samples) == (str(path), RATE, 4000)
    assert any("no channels were named" in note for note in source.notes)
    assert found.cells[0].delay_s == pytest.approx(0.02, abs=physical(0.01, "ms"))
    (named,) = read_pairs(path, targets=["target (mm)"], measured=["other (cm)"], start_s=2, end_s=18)
    assert named.target.size == 3200
    assert not any("no channels were named" in note for note in named.notes)
    assert any("'other (cm)' converted from cm to mm" in note for note in named.notes)
    two = read_pairs(path, targets=["target (mm)"] * 2, measured=["measured (mm)", "other (cm)"])
    assert [pair.name for pair in two] == [f"{path}, actuator 1", f"{path}, actuator 2"]
    with pytest.raises(SettingError, match="one measured for each target"):
        read_pairs(path, targets=["#0"])
    with pytest.raises(RecordingError, match=r"absent\.csv: no such file"):
        study(tmp_path / "absent.csv")


# --- computing time -------------------------------------------------------------------------------------------------


def test_times_are_measured_serially_when_all_numbers_are_there(monkeypatch: pytest.MonkeyPatch) -> None:
    module = sys.modules["rthstrack.studies.grid"]
    happened: list[tuple[str, bool]] = []
    evaluated, timed = module._evaluated, module._computing_time_s
    main = threading.get_ident()

    def seen(what: str, function: Any) -> Any:
        def call(*arguments: Any) -> Any:
            happened.append((what, threading.get_ident() == main))
            return function(*arguments)

        return call

    monkeypatch.setattr(module, "_evaluated", seen("number", evaluated))
    monkeypatch.setattr(module, "_computing_time_s", seen("time", timed))
    steps: list[tuple[int, int]] = []
    found = study(
        late(), P=(1, 2), Q=(1, 2), windows="boxcar", progress=lambda done, total: steps.append((done, total))
    )
    assert happened == [("number", False)] * 4 + [("time", True)] * 4
    assert all(cell.computing_time_s > 0 for cell in found.cells)
    assert steps == [(i, 8) for i in range(1, 9)]
    happened.clear()
    untimed = study(late(), P=(1, 2), Q=(1, 2), windows="boxcar", timing=False)
    assert [what for what, _ in happened] == ["number"] * 4
    assert all(math.isnan(cell.computing_time_s) for cell in untimed.cells)


def test_a_large_q_takes_less_time(reference: dict[str, Pair]) -> None:
    # ten to thirty times by the project's own benchmarks
    found = study(reference["chy101n_linear"], P=[1], Q=[1, 512], windows="boxcar")
    assert found.cell(Q=512).computing_time_s < found.cell().computing_time_s / 4


# --- the result -----------------------------------------------------------------------------------------------------


def test_a_study_is_frozen_and_carries_its_settings() -> None:
    found = study(late(), P=(4, 1), Q=[1], windows=["hann", "boxcar"], band_hz=(1, 20), timing=False)
    assert found.settings == StudySettings(
        P=(1, 4), Q=(1,), windows=("hann", "boxcar"), weight_powers=(2,), detrend="none", band_hz=(1.0, 20.0),
        timing=False,
    )  # fmt: skip
    assert found.cells[0].settings == Settings("fei", window="hann", detrend="none", band_hz=(1.0, 20.0))
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.cells = ()  # type: ignore[misc]
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.cells[0].amplitude = 1.0  # type: ignore[misc]
    plain = found.to_dict()
    assert plain["settings"]["P"] == [1, 4]
    assert plain["cells"][1]["settings"]["data_decimation"] == 4
    assert plain["sources"][0]["n_samples"] == 4000


def test_the_csv_and_the_frame_have_a_row_a_cell_with_every_setting(tmp_path: Path) -> None:
    found = study(late(truth=(1.05, 0.02)), P=(1, 8192), Q=(1, 2), windows="hann", band_hz=(0, 20), timing=False)
    found.to_csv(tmp_path / "study.csv")
    with open(tmp_path / "study.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    settings = {f.name for f in dataclasses.fields(Settings)} - {"band_hz"} | {"band_low_hz", "band_high_hz"}
    numbers = {f.name for f in dataclasses.fields(Cell)} - {"settings"}
    assert set(rows[0]) == settings | numbers | {"rate_hz", "n_samples", "target_name", "measured_name"}
    assert len(rows) == 4
    for row, cell in zip(rows, found.cells, strict=True):
        assert row["window"] == "hann"
        assert (row["band_low_hz"], row["band_high_hz"]) == ("0.0", "20.0")
        assert row["reason"] == cell.reason
        assert int(row["data_decimation"]) == cell.settings.data_decimation
        if cell.reason:
            assert row["delay_s"] == row["delay_error"] == ""
        else:
            assert float(row["delay_s"]) == cell.delay_s
            assert float(row["highest_frequency_hz"]) == RATE / 2 / cell.settings.data_decimation
    frame = found.to_frame()
    assert list(frame.columns) == list(rows[0])
    assert frame["delay_s"].isna().sum() == 2
    with pytest.raises(RecordingError, match=r"cannot write .*absent"):
        found.to_csv(tmp_path / "absent" / "study.csv")


def test_a_cell_is_found_by_its_settings() -> None:
    found = study([late("a"), late("b")], P=(1, 2), Q=(1, 2), weight_powers=(2, 3), timing=False)
    cell = found.cell(P=2, Q=1, window="hann", weight_power=3, source="b")
    assert (cell.source, cell.settings.window, cell.settings.weight_power) == ("b", "hann", 3)
    assert (cell.settings.data_decimation, cell.settings.frequency_decimation) == (2, 1)
    assert len(found.select(window="hann", P=2)) == 8
    with pytest.raises(SettingError, match="4 cells have source 'a', P 1, Q 1; name also the window, weight_power"):
        found.cell(source="a")
    with pytest.raises(
        SettingError, match=r"no cell has .*P 16.*; the study holds the sources a, b, .* P 1, 2, Q 1, 2"
    ):
        found.cell(P=16)


# --- figures --------------------------------------------------------------------------------------------------------


def made_up(n_sources: int = 1, truth: bool = True) -> Study:
    """A study whose cells nobody computed: what a figure shows must be these numbers. P = 8 with Q = 1 has none."""
    cells = []
    names = [f"test {i}" for i in range(n_sources)]
    for i, name in enumerate(names):
        for window in ("boxcar", "hann"):
            for p in (1, 2, 4, 8):
                for q in (1, 2, 4):
                    settings = Settings(data_decimation=p, frequency_decimation=q, window=window)
                    if (p, q) == (8, 1):
                        cells.append(Cell(name, settings, reason="made up"))
                        continue
                    value = 1 + 0.01 * p + 0.001 * q + 0.1 * i + (window == "hann") * 0.002
                    cells.append(
                        Cell(
                            name,
                            settings,
                            amplitude=value,
                            delay_s=value / 100,
                            true_amplitude=1.0 if truth else math.nan,
                            true_delay_s=0.01 if truth else math.nan,
                            computing_time_s=1e-3 / p / q,
                        )
                    )
    sources = tuple(StudiedSource(name, "target", "measured", RATE, 4000, ()) for name in names)
    settings = StudySettings(P=(1, 2, 4, 8), Q=(1, 2, 4), windows=("boxcar", "hann"), weight_powers=(2,))
    return Study(sources, settings, tuple(cells))


def curve(ax: Axes, label: str) -> tuple[list[float], list[float]]:
    (line,) = [line for line in ax.lines if line.get_label() == label]
    return list(map(float, line.get_xdata())), list(map(float, line.get_ydata()))


def test_curves_are_the_studys_numbers() -> None:
    amplitude, delay = study_plots.plot_data_decimation(made_up())
    x, y = curve(amplitude, "hann")
    assert x == [1, 2, 4, 8]
    assert y[:3] == pytest.approx([1.013, 1.023, 1.043], rel=round_off(4, 1))
    assert math.isnan(y[3])
    x, y = curve(delay, "boxcar")
    assert y[:3] == pytest.approx([10.11, 10.21, 10.41], rel=round_off(8, 1))
    amplitude, delay = study_plots.plot_data_decimation(made_up(), Q=2, windows=["boxcar"])
    assert [line.get_ydata()[3] for line in amplitude.lines[1:]] == pytest.approx([1.082])
    amplitude, delay = study_plots.plot_frequency_decimation(made_up(), windows=["hann"])
    assert list(delay.lines[-1].get_ydata()) == pytest.approx([10.13, 10.14, 10.16])
    amplitude, delay = study_plots.plot_combined(made_up(), window="hann")
    assert curve(amplitude, "P = 4") == ([1, 2, 4], pytest.approx([1.043, 1.044, 1.046]))
    assert [line.get_label() for line in amplitude.lines] == ["truth", "P = 1", "P = 2", "P = 4", "P = 8"]
    time = study_plots.plot_computing_time(made_up(), over="Q")
    assert curve(time, "boxcar") == ([1, 2, 4], pytest.approx([1.0, 0.5, 0.25]))
    time = study_plots.plot_combined_computing_time(made_up())
    assert curve(time, "P = 2") == ([1, 2, 4], pytest.approx([0.5, 0.25, 0.125]))


def test_the_truth_is_drawn_once_where_it_is_known() -> None:
    for ax, value in zip(study_plots.plot_data_decimation(made_up(2)), (1.0, 10.0), strict=True):
        truths = [line for line in ax.lines if line.get_label() == "truth"]
        assert len(truths) == 1
        assert set(truths[0].get_ydata()) == {value}
        low, high = ax.get_ylim()
        assert low < value < high
    for ax in study_plots.plot_data_decimation(made_up(truth=False)):
        assert all(line.get_label() != "truth" for line in ax.lines)


def test_the_legend_names_what_differs() -> None:
    def names(ax: Any) -> list[str]:
        legend = ax.get_legend()
        return [] if legend is None else [text.get_text() for text in legend.get_texts()]

    assert names(study_plots.plot_data_decimation(made_up())[0]) == ["truth", "boxcar", "hann"]
    both = names(study_plots.plot_data_decimation(made_up(2))[0])
    assert both == ["truth", "test 0, boxcar", "test 0, hann", "test 1, boxcar", "test 1, hann"]
    assert names(study_plots.plot_data_decimation(made_up(2), windows=["hann"])[0]) == ["truth", "test 0", "test 1"]
    assert names(study_plots.plot_computing_time(made_up(), windows=["hann"])) == []
    with pytest.raises(SettingError, match="the study has no window 'tukey'; it has boxcar, hann"):
        study_plots.plot_data_decimation(made_up(), windows=["tukey"])
    with pytest.raises(SettingError, match="the study has no source 'x'"):
        study_plots.plot_combined(made_up(), source="x")


def test_plots_draw_on_the_axes_they_are_given() -> None:
    for plot in (study_plots.plot_data_decimation, study_plots.plot_frequency_decimation, study_plots.plot_combined):
        axes = Figure().subplots(2, 1)
        assert plot(made_up(), ax=axes) is axes
        assert [ax.get_ylabel() for ax in axes] == ["A (-)", "d (ms)"]
        assert plot(made_up())[0].figure.get_figwidth() == plots.SINGLE_COLUMN_IN
        with pytest.raises(SettingError, match="needs 2 axes"):
            plot(made_up(), ax=list(Figure().subplots(3, 1)))
    for plot_time in (study_plots.plot_computing_time, study_plots.plot_combined_computing_time):
        ax = Figure().add_subplot()
        assert plot_time(made_up(), ax=ax) is ax
        assert ax.get_ylabel() == "Computing time (ms)"
        assert ax.get_yscale() == "log"


def test_the_horizontal_axis_has_a_tick_at_each_factor() -> None:
    _, delay = study_plots.plot_data_decimation(made_up())
    assert delay.get_xscale() == "log"
    assert [text.get_text() for text in delay.get_xticklabels()] == ["1", "2", "4", "8"]
    assert delay.get_xlabel() == "Data decimation P"
    assert study_plots.plot_combined(made_up())[1].get_xlabel() == "Frequency decimation Q"


def test_curves_can_be_told_apart_without_colour() -> None:
    for ax in (study_plots.plot_combined(made_up())[0], study_plots.plot_data_decimation(made_up(3))[0]):
        looks = [line.get_marker() for line in ax.lines if line.get_label() != "truth"]
        assert len(set(looks)) == len(looks) > 3
        colours = [to_hex(line.get_color()) for line in ax.lines]
        assert len(set(colours)) == len(colours)


def test_figures_are_written_for_each_source_as_pdf_and_png(tmp_path: Path) -> None:
    names = {"data_decimation", "frequency_decimation", "computing_time", "combined_boxcar_l2", "combined_hann_l2"}
    one = study_plots.write_study_figures(made_up(), tmp_path)
    assert {path.name for path in one} == {f"{name}.{ending}" for name in names for ending in ("pdf", "png")}
    assert all(path.read_bytes()[:4] in (b"%PDF", b"\x89PNG") for path in one)
    several = study_plots.write_study_figures(made_up(2), tmp_path, formats=["png"])
    assert {path.name for path in several} == {f"{i:02d}_test_{i - 1}_{name}.png" for name in names for i in (1, 2)}
    with pytest.raises(SettingError, match="cannot write the figure there"):
        study_plots.write_study_figures(made_up(), tmp_path / "absent")


def test_figures_for_which_there_are_no_cells_are_left_out() -> None:
    alone = study(late(), P=(1, 2), Q=[1], windows="boxcar", timing=False)
    assert set(study_plots.study_figures(alone)) == {"data_decimation"}
    point = study(late(), P=[1], Q=[1], windows="boxcar")
    assert study_plots.study_figures(point) == {}
    assert len(study_plots.plot_combined(point)[0].lines) == 0
