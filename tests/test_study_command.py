"""The command `rthstrack study`, run as a user runs it."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rthstrack.cli import main
from rthstrack.ground_motion import synthetic_ground_motion
from rthstrack.studies import study
from rthstrack.virtual_test import Actuator, ModalDamping, Run, Spring, Structure, VirtualTest, simulate
from tolerances import physical

RATE = 200.0
PAPER = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512]
FIGURES = {"data_decimation", "frequency_decimation", "computing_time", "combined_boxcar_l2", "combined_hann_l2"}
CONFIGURATION = """
[structure]
frequency_hz = 5.0
damping_ratio = 0.02

[[actuator]]
gain = 1.1
delay_s = 0.001
specimen = { law = "spring" }

[ground_motion]
synthetic = { seed = 3, duration_s = 20.0 }
"""


def burst(delay_s: float = 0.0, amplitude: float = 1.0) -> np.ndarray:
    """A burst of 2 Hz that has died down at both ends, in mm."""
    t = np.arange(4000) / RATE - delay_s
    return amplitude * 10 * np.sin(2 * np.pi * 2 * t) * np.exp(-((t - 10) ** 2) / 8)


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """A CSV with time, target and two answers: 20 ms late and 5 % too large, and 10 ms early."""
    path = tmp_path / "test.csv"
    columns = [np.arange(4000) / RATE, burst(), burst(0.02, 1.05), burst(-0.01)]
    header = "Time (s),target_1 (mm),measured_1 (mm),other (mm)"
    np.savetxt(path, np.column_stack(columns), fmt="%.9g", delimiter=",", header=header, comments="")
    return path


@pytest.fixture(scope="module")
def tested() -> Run:
    """The paper's linear structure under a synthetic record: gain 1.1, 1 ms late."""
    test = VirtualTest(Structure.sdof(5.0, 0.02), (Actuator((Spring(),), gain=1.1, delay_s=0.001),))
    return simulate(test, synthetic_ground_motion(seed=3, duration_s=20.0))


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of the command in this process."""
    try:
        status = main(["study", *map(str, arguments)])
    except SystemExit as stop:
        status = int(stop.code or 0)
    out, err = capsys.readouterr()
    return status, out, err


def rows_of(path: Path) -> list[dict[str, str]]:
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_study_writes_csv_and_figures_and_prints_tables(
    capsys: pytest.CaptureFixture[str], recorded: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "new" / "study"
    status, out, err = run(
        capsys, recorded, "--true-amplitude", 1.05, "--true-delay", 0.02, "--windows", "boxcar,hann", "-o", folder
    )
    assert status == 0
    files = {f"{name}.{ending}" for name in FIGURES for ending in ("pdf", "png")} | {"study.csv"}
    assert {path.name for path in folder.iterdir()} == files
    rows = rows_of(folder / "study.csv")
    grid = {(p, 1) for p in PAPER} | {(1, q) for q in PAPER} | {(p, q) for p in PAPER[:7] for q in PAPER[:6]}
    assert {(int(r["data_decimation"]), int(r["frequency_decimation"])) for r in rows} == grid
    assert len(rows) == 2 * len(grid)
    first = rows[0]
    assert (first["window"], first["weight_power"], first["detrend"]) == ("boxcar", "2", "none")
    assert float(first["delay_s"]) == pytest.approx(0.02, abs=physical(0.01, "ms"))
    assert float(first["amplitude_error"]) == pytest.approx(0, abs=physical(0.01, "%"))
    assert float(first["computing_time_s"]) > 0
    for words in (
        "boxcar window, weight power 2",
        "hann window",
        "A error %",
        "d error %",
        "time us",
        "P down, Q across",
    ):
        assert words in out
    assert "no channels were named: studied target 'target_1 (mm)'" in out
    assert f"cells written to {folder / 'study.csv'}" in err
    assert "10 figures written to" in err
    assert len(err.splitlines()) == 2, "no progress bar where standard error is no terminal"


def test_the_table_shows_change_where_no_truth_is_known(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    status, out, _ = run(capsys, recorded, "--no-timing", "-P", "1,4", "-Q", "1", "--windows", "boxcar")
    assert status == 0
    assert "d change %" in out
    assert "error %" not in out
    assert "time us" not in out
    (line,) = [line for line in out.splitlines() if line.split()[:2] == ["4", "1"]]
    p, q, amplitude, amplitude_change, delay_ms, delay_change, _ = line.split()
    assert (p, q) == ("4", "1")
    assert (float(amplitude_change), float(delay_change)) == pytest.approx((0, 0), abs=0.01)
    assert float(amplitude) == pytest.approx(1.05, abs=physical(0.01, "%"))
    assert float(delay_ms) == pytest.approx(20, abs=0.01)


def test_settings_reach_the_study(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    chosen = ["-P", "1,4,16", "-Q", "2,1", "--combined", "4", "2", "--windows", "tukey", "--weight-powers", "3,1"]
    method = ["--decimator", "chebyshev", "--detrend", "mean", "--band", "0.5", "20", "--no-timing", "--json"]
    status, out, _ = run(
        capsys, recorded, "--target", "target_1 (mm)", "--measured", "other (mm)", "--rate", 400, *chosen, *method
    )
    assert status == 0
    document = json.loads(out)
    assert document["failures"] == []
    assert document["study"]["settings"] == {
        "P": [1, 4, 16], "Q": [1, 2], "combined": [4, 2], "windows": ["tukey"], "weight_powers": [3, 1],
        "estimator": "fei", "decimator": "chebyshev", "detrend": "mean", "band_hz": [0.5, 20.0], "timing": False,
        "choose": [], "tolerance": 0.005, "shares": [], "max_delay_s": 0.25,
        "expected_delay_s": None, "noise": "white", "noise_ratio": 0.0, "bad_samples": "leave_out",
    }  # fmt: skip
    (source,) = document["study"]["sources"]
    assert (source["measured_name"], source["rate_hz"]) == ("other (mm)", 400)
    cells = document["study"]["cells"]
    assert len(cells) == 2 * 5
    assert cells[0]["settings"]["weight_power"] == 3
    assert cells[0]["delay_s"] == pytest.approx(-0.005, abs=physical(0.05, "ms"))  # 10 ms early at twice the rate
    assert cells[0]["computing_time_s"] is None


NONSENSE = [
    ("-P", "0", "P must hold powers of two (1, 2, 4, ...), found 0"),
    ("-P", "1,3", "P must hold powers of two (1, 2, 4, ...), found 3"),
    ("-Q", "-1", "Q must hold powers of two (1, 2, 4, ...), found -1"),
    ("-Q", "1,two", "Q must hold powers of two (1, 2, 4, ...), found 'two'"),
    ("-Q", "1.5", "Q must hold powers of two (1, 2, 4, ...), found '1.5'"),
    ("-P", "", "P is empty: give at least one value"),
    ("-P", "1,,2", "P must hold powers of two (1, 2, 4, ...), found ''"),
    ("-P", "4,2,4", "P holds 4 twice: give every value once"),
    (
        "--windows",
        "hann,hanning",
        "window must be one of boxcar, hann, hamming, blackman, flattop, tukey, not 'hanning'",
    ),
    ("--weight-powers", "2,x", "--weight-powers must be a whole number, not 'x'"),
    ("--weight-powers", "0", "--weight-powers must be a whole number from 1 to 2**32 - 1, not 0"),
]


@pytest.mark.parametrize(("option", "value", "message"), NONSENSE)
def test_nonsense_is_misuse_in_one_line_and_nothing_is_made(
    capsys: pytest.CaptureFixture[str], recorded: Path, tmp_path: Path, option: str, value: str, message: str
) -> None:
    folder = tmp_path / "study"
    status, out, err = run(capsys, recorded, "-o", folder, f"{option}={value}" if option[1] == "-" else option + value)
    if value == "":
        status, out, err = run(capsys, recorded, "-o", folder, option, value)
    assert (status, out) == (2, "")
    assert err.splitlines()[0] == f"rthstrack: {message}"
    assert not folder.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--target", "#0"], "--target and --measured go in pairs, found 1 and 0"),
        (["--start", "5", "--end", "2"], "--start must come before --end, found 5 and 2"),
        (["--rate", "100", "--resample", "100"], "--resample interpolates the file's time stamps and excludes --rate"),
        (["--no-figures"], "--no-figures speaks of what -o DIR writes: give -o DIR"),
        (["--combined", "4", "0"], "expected a whole number from 1 on, found '0'"),
        (["--band", "20", "1"], "--band must be two finite frequencies 0 <= low <= high, not (20, 1)"),
        (["--true-amplitude", "-1"], "expected a positive number, found '-1'"),
        (["--true-delay", "late"], "expected a number, found 'late'"),
    ],
)
def test_options_that_contradict_each_other_are_misuse(
    capsys: pytest.CaptureFixture[str], recorded: Path, arguments: list[str], message: str
) -> None:
    status, out, err = run(capsys, recorded, *arguments)
    assert (status, out) == (2, "")
    assert message in err.splitlines()[0]


def test_cells_that_leave_nothing_are_rows_with_a_reason(
    capsys: pytest.CaptureFixture[str], recorded: Path, tmp_path: Path
) -> None:
    status, out, err = run(capsys, recorded, "-Q", "1,8192", "-P", "1", "-o", tmp_path, "--no-figures", "--no-timing")
    assert status == 0
    good, bad, *_ = rows_of(tmp_path / "study.csv")
    assert good["reason"] == ""
    assert bad["reason"].startswith("no frequency bin is left")
    assert (bad["delay_s"], bad["frequency_decimation"]) == ("", "8192")
    assert "2 of 4 cells could not be determined, the first: no frequency bin is left: P = 1 and Q = 8192" in out
    assert "nan" not in out + err


def test_one_bad_source_does_not_stop_the_others(
    capsys: pytest.CaptureFixture[str], recorded: Path, tmp_path: Path
) -> None:
    still = tmp_path / "still.csv"
    np.savetxt(still, np.column_stack([np.arange(9) / 10, np.ones(9), np.arange(9)]), delimiter=",",
               header="time_s,target,measured", comments="")  # fmt: skip
    absent = tmp_path / "absent.csv"
    quick = ["-P", "1,2", "-Q", "1", "--no-timing"]
    status, out, err = run(capsys, still, recorded, absent, *quick, "-o", tmp_path / "out")
    assert status == 1
    assert str(recorded) in out
    first, second, *written = err.splitlines()
    assert first.startswith(f"rthstrack: {still}: target is constant")
    assert second.startswith(f"rthstrack: {absent}: no such file")
    assert len(written) == 2
    assert {row["source"] for row in rows_of(tmp_path / "out" / "study.csv")} == {str(recorded)}
    status, out, err = run(capsys, absent, *quick, "--json")
    assert status == 1
    document = json.loads(out)
    assert document["study"] is None
    assert document["failures"][0]["file"] == str(absent)


def test_a_folder_is_taken_as_its_files(capsys: pytest.CaptureFixture[str], recorded: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    runs.mkdir()
    for name in ("b.csv", "a.csv"):
        (runs / name).write_text(recorded.read_text())
    (runs / "0.mat").write_text("nothing\n")
    quick = ["-P", "1,2", "-Q", "1", "--no-timing", "--json"]
    status, out, err = run(capsys, runs, *quick)
    assert status == 1
    document = json.loads(out)
    assert [one["name"] for one in document["study"]["sources"]] == [str(runs / "a.csv"), str(runs / "b.csv")]
    assert [one["file"] for one in document["failures"]] == [str(runs / "0.mat")]
    assert err.count("\n") == 1


def test_target_and_measured_may_stand_in_two_files(
    capsys: pytest.CaptureFixture[str], recorded: Path, tmp_path: Path
) -> None:
    other = tmp_path / "daq.csv"
    t = np.arange(4000) / RATE + 0.05
    np.savetxt(other, np.column_stack([t, burst(0.02 - 0.05, 1.05)]), fmt="%.9g", delimiter=",", header="time_s,xm",
               comments="")  # fmt: skip
    named = ["--target", f"{recorded}:target_1", "--measured", f"{other}:xm"]
    quick = ["-P", "1", "-Q", "1", "--windows", "boxcar", "--weight-powers", "2", "--no-timing", "--json"]
    status, out, _ = run(capsys, *named, *quick)
    assert status == 0
    (source,) = json.loads(out)["study"]["sources"]
    (cell,) = json.loads(out)["study"]["cells"]
    # Of one instant of both clocks: 20 ms, as in one file.
    assert 1e3 * cell["delay_s"] == pytest.approx(20, abs=0.01)
    assert source["name"] == f"{recorded} and {other}"
    assert any("taken to count from one instant" in note for note in source["notes"])
    status, _, err = run(capsys, *named, "--rate", "200", *quick)
    assert status == 1
    assert "no clock in common" in err
    assert "is read at the rate that was given" in err
    for wrong in (["--target", "target_1", "--measured", f"{other}:xm"], [str(recorded), "--align"], []):
        status, _, err = run(capsys, *wrong, *quick)
        assert status == 2, wrong
        assert "SOURCE" in err


def test_several_sources_give_a_line_each_and_figures_by_their_names(
    capsys: pytest.CaptureFixture[str], recorded: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other test.csv"
    other.write_bytes(recorded.read_bytes())
    folder = tmp_path / "out"
    status, out, _ = run(capsys, recorded, other, "-P", "1,2", "-Q", "1", "--windows", "hann", "-o", folder)
    assert status == 0
    assert sum(" hann " in line for line in out.splitlines()) == 2
    names = {path.name for path in folder.iterdir()}
    assert {"01_test.csv_data_decimation.pdf", "02_other_test.csv_data_decimation.png", "study.csv"} <= names


def test_only_its_own_files_are_overwritten(capsys: pytest.CaptureFixture[str], recorded: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    (folder / "study.csv").write_text("old")
    (folder / "data_decimation.png").write_text("old")
    quick = ["-P", "1,2", "-Q", "1", "--windows", "hann", "--no-timing"]
    assert run(capsys, recorded, "-o", folder, *quick)[0] == 0
    assert (folder / "notes.txt").read_text() == "mine"
    assert (folder / "study.csv").read_text().startswith("source,")
    assert (folder / "data_decimation.png").read_bytes().startswith(b"\x89PNG")
    status, out, err = run(capsys, recorded, "-o", folder / "notes.txt", *quick)
    assert (status, out) == (2, "")
    assert err.startswith(f"rthstrack: -o {folder / 'notes.txt'}: cannot make this directory")
    assert "cannot make this directory" in err.splitlines()[0]


# --- virtual tests --------------------------------------------------------------------------------------------------


def test_a_run_brings_its_own_truth(tested: Run) -> None:
    found = study(tested, P=[1, 16], Q=[1], windows="hann", timing=False)
    assert found.source_names == (tested.motion_name,)
    for cell in found.cells:
        assert cell.true_amplitude == pytest.approx(1.1, rel=physical(1e-9, "relative"))
        assert cell.true_delay_s == pytest.approx(0.001, rel=physical(1e-9, "relative"))
        assert abs(cell.delay_error) < physical(0.1, "%")
    given = study(tested, P=[1], Q=[1], truth=(1.0, 0.002), windows="hann", timing=False).cells[0]
    assert (given.true_amplitude, given.true_delay_s) == (1.0, 0.002)


def test_a_run_file_brings_its_own_truth(capsys: pytest.CaptureFixture[str], tested: Run, tmp_path: Path) -> None:
    tested.write(tmp_path / "run.h5")
    quick = ["-P", "1", "-Q", "1", "--windows", "hann", "--no-timing", "--json"]

    def cell(*arguments: object) -> dict[str, Any]:
        status, out, _ = run(capsys, tmp_path / "run.h5", *quick, *arguments)
        assert status == 0
        found: dict[str, Any] = json.loads(out)["study"]["cells"][0]
        return found

    whole = cell()
    assert whole["true_amplitude"] == pytest.approx(1.1, rel=physical(1e-9, "relative"))
    assert whole["true_delay_s"] == pytest.approx(0.001, rel=physical(1e-9, "relative"))
    assert abs(whole["delay_error"]) < physical(0.1, "%")
    given = cell("--true-delay", -0.002)
    assert (given["true_amplitude"], given["true_delay_s"]) == (None, -0.002)
    # of other channels, or scaled ones, the run says nothing
    assert cell("--target", "displacement_1", "--measured", "measured")["true_delay_s"] is None
    assert cell("--scale", "measured=2")["true_amplitude"] is None


def test_each_actuator_of_a_run_has_its_own_truth(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    structure = Structure.shear_building((1000.0, 1000.0), (1e6, 1e6), ModalDamping(0.05))
    small = Spring(1e4)
    actuators = (Actuator((small,), dof=1, gain=0.9, delay_s=0.002), Actuator((small,), dof=2, gain=1.2, delay_s=0.004))
    finished = simulate(VirtualTest(structure, actuators), synthetic_ground_motion(seed=3, duration_s=20.0))
    expected = [(0.9, 0.002), (1.2, 0.004)]
    found = study({"two": finished}, P=[1], Q=[1], windows="hann", timing=False)
    assert found.source_names == ("two, actuator 1", "two, actuator 2")
    assert [(c.true_amplitude, c.true_delay_s) for c in found.cells] == [pytest.approx(e) for e in expected]
    finished.write(tmp_path / "run.h5")
    quick = ["-P", "1", "-Q", "1", "--windows", "hann", "--no-timing", "--json"]
    _, out, _ = run(capsys, tmp_path / "run.h5", "--target", "target_2", "--measured", "measured_2", *quick)
    (cell,) = json.loads(out)["study"]["cells"]
    assert (cell["true_amplitude"], cell["true_delay_s"]) == pytest.approx(expected[1])
    assert cell["delay_s"] == pytest.approx(0.004, rel=physical(1, "%"))
    _, out, _ = run(capsys, tmp_path / "run.h5", "--target", "target_1", "--measured", "measured_2", *quick)
    assert json.loads(out)["study"]["cells"][0]["true_delay_s"] is None


def test_a_configuration_is_simulated_first(capsys: pytest.CaptureFixture[str], tested: Run, tmp_path: Path) -> None:
    path = tmp_path / "test.toml"
    path.write_text(CONFIGURATION)
    status, out, _ = run(capsys, path, "-P", "1", "-Q", "1", "--windows", "hann", "--no-timing", "--json")
    assert status == 0
    (cell,) = json.loads(out)["study"]["cells"]
    same = study(tested, P=[1], Q=[1], windows="hann", timing=False).cells[0]
    assert (cell["source"], cell["delay_s"], cell["delay_error"]) == (str(path), same.delay_s, same.delay_error)
    path.write_text(CONFIGURATION.replace("delay_s = 0.001", "delay_s = 0.01"))
    status, _, err = run(capsys, path, "-P", "1", "-Q", "1", "--no-timing")
    assert status == 1
    assert "unstable" in err
    assert "critical delay is" in err
    path.write_text(CONFIGURATION.replace("gain = 1.1", 'gain = "big"'))
    status, _, err = run(capsys, path, "-P", "1", "-Q", "1", "--no-timing")
    assert status == 1
    assert f"{path}: actuator[1].gain" in err


def test_the_help_tells_grids_files_and_exit_statuses(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "--help")
    assert status == 0
    for words in ("1,2,...,512", "64 32", "boxcar,hann", "--true-delay", "study.csv", "Exit status", "examples:"):
        assert words in out
    assert max(map(len, out.splitlines())) <= 100


def test_a_progress_bar_is_shown_on_a_terminal_only(
    capsys: pytest.CaptureFixture[str], recorded: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    quick = ["-P", "1,2", "-Q", "1", "--no-timing"]
    assert run(capsys, recorded, *quick)[2] == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    assert "studying" in run(capsys, recorded, *quick)[2]
