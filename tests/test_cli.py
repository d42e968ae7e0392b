"""The command `rthstrack evaluate`, run as a user runs it; values from the issue tables and the definitions."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rthstrack.cli import arguments, main

RATE = 200.0
KEYS = {
    "file", "actuator", "target", "measured", "unit", "rate_hz", "n_samples", "amplitude", "delay_s", "phase_rad",
    "equivalent_frequency_hz", "n_bins", "delta_f_hz", "settings", "indices", "warnings", "amplitude_std",
    "amplitude_interval", "delay_std_s", "delay_interval_s", "residual_coherence", "goodness", "reason", "trusted",
    "slopes", "depends_on", "dependence", "argument", "reason_code", "reason_values", "warning_codes",
    "actuator_number", "actuator_name", "verdict", "estimator", "published", "limits", "outcome", "exceeded",
    "not_judged", "gates", "conclusion", "loop", "moving", "moving_note", "frequency_response",
    "frequency_response_note",
}  # fmt: skip
TRUSTED = {
    "estimator", "amplitude", "amplitude_interval", "delay_s", "delay_interval_s", "target_noise_std", "bad_samples",
    "reason", "reason_code", "reason_values",
}  # fmt: skip
INDICES = {
    "max_tracking_error", "max_tracking_error_percent", "rms_error", "rms_error_percent", "tracking_indicator", "j1_s",
    "j2_percent", "j3_percent",
}  # fmt: skip


def burst(delay_s: float = 0.0, amplitude: float = 1.0) -> np.ndarray:
    """A burst of 2 Hz that has died down at both ends, in mm."""
    t = np.arange(4000) / RATE - delay_s
    return amplitude * 10 * np.sin(2 * np.pi * 2 * t) * np.exp(-((t - 10) ** 2) / 8)


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """A CSV with time, target, command and two answers: 20 ms late and 5 % too large, and 10 ms early."""
    path = tmp_path / "test.csv"
    columns = [np.arange(4000) / RATE, burst(), burst(-0.005), burst(0.02, 1.05), burst(-0.01)]
    header = "Time (s),target_1 (mm),cmd (mm),measured_1 (mm),other (mm)"
    np.savetxt(path, np.column_stack(columns), fmt="%.9g", delimiter=",", header=header, comments="")
    return path


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of the command in this process."""
    try:
        status = main(["evaluate", *map(str, arguments)])
    except SystemExit as stop:
        status = int(stop.code or 0)
    out, err = capsys.readouterr()
    return status, out, err


def run_json(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, dict[str, Any]]:
    """Exit status and the JSON on standard output, which holds nothing else."""
    status, out, _ = run(capsys, *arguments, "--json")

    def refuse(token: str) -> None:
        raise AssertionError(f"{token} is no JSON")

    return status, json.loads(out, parse_constant=refuse)


def test_the_real_machine_gives_the_stated_amplitude_and_delay(
    capsys: pytest.CaptureFixture[str], shared: Path
) -> None:
    file = shared / "records" / "utfsm_15Hz_0A.txt"
    status, document = run_json(capsys, file, "--target", "CHANNEL2", "--measured", "CHANNEL0")
    assert status == 0
    (result,) = document["results"]
    assert result["published"]["amplitude"] == pytest.approx(0.7169693617709628, rel=1e-9)
    assert result["published"]["delay_s"] == pytest.approx(0.01350753731, rel=1e-6)
    assert result["n_samples"] == 46800
    assert result["rate_hz"] == 1000


def test_the_json_has_exactly_the_promised_keys(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    status, document = run_json(capsys, recorded)
    assert status == 0
    assert set(document) == {"results", "failures"}
    assert document["failures"] == []
    (result,) = document["results"]
    assert set(result) == KEYS
    assert set(result["indices"]) == INDICES
    assert set(result["trusted"]) == set(result["published"]) == TRUSTED
    assert (result["target"], result["measured"], result["unit"]) == ("target_1 (mm)", "measured_1 (mm)", "mm")
    assert result["actuator"] == 0
    assert result["amplitude"] == pytest.approx(1.05, rel=1e-4)
    assert result["delay_s"] == pytest.approx(0.02, rel=1e-4)
    assert result["indices"]["j1_s"] == pytest.approx(0.02)
    assert any("no channels were named" in w for w in result["warnings"])


def test_a_lead_is_a_negative_delay_and_said_to_lead(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    status, out, _ = run(capsys, recorded, "--target", "target_1 (mm)", "--measured", "other (mm)")
    assert status == 0
    assert out.startswith("measured leads target by 10 ms and has the right amplitude, judged at 2 Hz")


def test_the_verdict_comes_first_then_the_table_then_warnings(
    capsys: pytest.CaptureFixture[str], recorded: Path
) -> None:
    status, out, err = run(capsys, recorded)
    assert status == 0
    lines = out.splitlines()
    assert lines[0] == "measured lags target by 20 ms and is 5 % too large, judged at 2 Hz"
    assert "delay" in out
    assert lines.index(next(x for x in lines if x.startswith("amplitude"))) < lines.index(
        next(x for x in lines if x.startswith("warning"))
    )
    assert err == ""


def test_with_the_command_compensator_and_actuator_are_judged_apart(
    capsys: pytest.CaptureFixture[str], recorded: Path
) -> None:
    names = ("--target", "#1", "--measured", "#3", "--command", "#2")
    status, document = run_json(capsys, recorded, *names)
    assert status == 0
    found = [(r["target"], r["measured"], round(r["delay_s"], 5)) for r in document["results"]]
    assert found == [
        ("target_1 (mm)", "measured_1 (mm)", 0.02),
        ("target_1 (mm)", "cmd (mm)", -0.005),
        ("cmd (mm)", "measured_1 (mm)", 0.025),
    ]
    _, out, _ = run(capsys, recorded, *names)
    assert "compensator: command leads target by 5 ms" in out
    assert "actuator: measured lags command by 25 ms" in out


def test_pairs_may_be_repeated_one_for_each_actuator(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    names = ("--target", "#1", "--measured", "#3", "--target", "#1", "--measured", "#4")
    _, document = run_json(capsys, recorded, *names)
    assert [(r["actuator"], round(r["delay_s"], 5)) for r in document["results"]] == [(0, 0.02), (1, -0.01)]


def test_settings_reach_the_evaluation_and_the_json(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    options = [
        "--estimator",
        "fei",
        "-P",
        4,
        "-Q",
        2,
        "--decimator",
        "chebyshev",
        "--weight-power",
        3,
        "--window",
        "tukey",
    ]
    status, document = run_json(capsys, recorded, *options, "--detrend", "mean", "--band", 0.5, 8)
    assert status == 0
    settings = document["results"][0]["settings"]
    expected = {
        "estimator": "fei", "data_decimation": 4, "frequency_decimation": 2, "decimator": "chebyshev",
        "weight_power": 3, "window": "tukey", "detrend": "mean", "band_hz": [0.5, 8.0],
    }  # fmt: skip
    assert expected.items() <= settings.items()


def test_cutting_scaling_and_sign_are_applied(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    options = ("--start", 5, "--end", 15, "--scale", "measured_1 (mm)=0.5", "--rate", RATE)
    _, document = run_json(capsys, recorded, *options)
    (result,) = document["results"]
    assert result["n_samples"] == 2000
    assert result["amplitude"] == pytest.approx(0.525, rel=1e-2)
    assert result["settings"]["start_s"] == 5.0
    assert result["settings"]["scale"] == {"measured_1 (mm)": 0.5}


def test_limits_decide_the_exit_status(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    assert run(capsys, recorded, "--limit-delay", 0.021, "--limit-amplitude", 0.06)[0] == 0
    status, out, _ = run(capsys, recorded, "--limit-delay", 0.019)
    assert status == 3
    assert out.rstrip().splitlines()[-1].startswith("FAIL: |delay| 20.00")
    assert "exceeds the limit of 19 ms" in out
    assert run(capsys, recorded, "--limit-amplitude", 0.04)[0] == 3
    assert run(capsys, recorded, "--limit-delay", 0.019, "--json")[0] == 3


def test_one_bad_file_does_not_stop_the_rest(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    missing = recorded.with_name("missing.csv")
    empty = recorded.with_name("empty.csv")
    empty.touch()
    status, document = run_json(capsys, recorded, missing, empty, recorded)
    assert status == 1
    assert len(document["results"]) == 2
    assert [f["file"] for f in document["failures"]] == [str(missing), str(empty)]
    assert all(f["error"] and "\n" not in f["error"] for f in document["failures"])
    status, out, err = run(capsys, recorded, missing)
    assert status == 1
    assert "20.000" in out
    assert err.startswith("rthstrack: ")
    assert str(missing) in err


def test_outputs_are_written_where_asked(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    out = recorded.parent
    options = ["--report", out / "r.html", "--figure", out / "f.svg", "--csv", out / "r.csv", "--moving", 2, "--hop", 1]
    status, _, err = run(capsys, recorded, *options)
    assert status == 0
    assert (out / "r.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert b"<svg" in (out / "f.svg").read_bytes()
    rows = list(csv.DictReader((out / "r.csv").read_text(encoding="utf-8").splitlines()))
    assert float(rows[0]["delay_s"]) == pytest.approx(0.02, rel=1e-4)
    assert rows[0]["indices.j1_s"] == "0.02"
    readings = list(csv.DictReader((out / "r_moving.csv").read_text(encoding="utf-8").splitlines()))
    assert len(readings) == 19
    assert {r["valid"] for r in readings} == {"True", "False"}
    curves = list(csv.DictReader((out / "r_frequency.csv").read_text(encoding="utf-8").splitlines()))
    assert {"frequency_hz", "gain", "delay_s", "delay_low_s", "delay_high_s", "coherence"} <= set(curves[0])
    assert err.count("written to") == 5


def test_a_second_figure_does_not_replace_the_first(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    out = recorded.parent
    figures = [item for name in ("f.svg", "f.pdf") for item in ("--figure", out / name)]
    status, _, err = run(capsys, recorded, *figures, "--panels", "error,loop", "--size", "85x120mm")
    assert status == 0
    assert err.splitlines() == [f"figure written to {out / name}" for name in ("f.svg", "f.pdf")]
    points = 72 / 25.4
    assert f"/MediaBox [ 0 0 {85 * points:.2f}"[:22].encode() in (out / "f.pdf").read_bytes()
    assert (out / "f.svg").read_bytes().startswith(b"<?xml")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("85mm", (85, None)), ("85x120mm", (85, 120)), ("8.5 cm x 12 cm", (85, 120)), ("7.2x9in", (182.88, 228.6)),
        ("85mmx4in", (85, 101.6)),
    ],
)  # fmt: skip
def test_a_size_has_units(text: str, found: tuple[float, float | None]) -> None:
    width, height = arguments.size(text)
    assert 25.4 * width == pytest.approx(found[0])
    assert height is None if found[1] is None else 25.4 * (height or 0) == pytest.approx(found[1])


@pytest.mark.parametrize(
    "options",
    [
        ["-P", 3], ["-P", 0], ["-P", -2], ["-P", "x"], ["-Q", 1.5], ["--weight-power", 0], ["--weight-power", 17],
        ["--window", "kaiser"], ["--detrend", "cubic"], ["--decimator", "fir"], ["--estimator", "magic"],
        ["--band", 5, 1], ["--band", -1, 5], ["--band", 1], ["--band", "nan", 5], ["--rate", 0], ["--rate", -5],
        ["--rate", "inf"], ["--moving", 0], ["--hop", -1], ["--start", -1], ["--start", 5, "--end", 5], ["--fill", 0],
        ["--fill", 1.5], ["--resample", 0], ["--limit-delay", 0], ["--limit-amplitude", "x"], ["--scale", "x"],
        ["--scale", "x=0"], ["--scale", "=2"], ["--target", "#1"], ["--measured", "#1"], ["--report", "r.pdf"],
        ["--figure", "f.bmp"], ["--panels", "error"], ["--figure", "f.pdf", "--panels", "errors"], ["--size", "85mm"],
        ["--figure", "f.pdf", "--size", "85"], ["--figure", "f.pdf", "--size", "x"],
        ["--figure", "f.pdf", "--size", "1mm"], ["--figure", "f.pdf", "--size", "85s"], ["--figure", "nowhere/f.pdf"],
        ["--csv", "r.txt"], ["--report", "nowhere/r.html"], ["--rate", 5, "--time", "t"],
        ["--rate", 5, "--resample", 5], ["--target", "#1", "--measured", "#2", "--command", "#3", "--command", "#4"],
    ],
    ids=lambda options: " ".join(map(str, options)),
)  # fmt: skip
def test_misuse_is_told_with_status_2(capsys: pytest.CaptureFixture[str], recorded: Path, options: list[Any]) -> None:
    status, out, err = run(capsys, recorded, *options)
    assert status == 2
    assert out == ""
    assert "error: " in err.splitlines()[0]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--target", "nothing", "--measured", "#3"], ["nothing", "target_1"]),
        (["--target", "#1", "--measured", "#9"], ["#9"]),
        (["--band", 0.0001, 0.0002], ["no frequency bin"]),
        (["-P", 4096], ["no frequency bin"]),
        (["--moving", 100], ["moving windows", "100"]),
        (["--start", 30], ["30"]),
        (["--scale", "nothing=2"], ["nothing"]),
        (["--command", "#2", "--command", "#2"], ["--command"]),
    ],
    ids=lambda value: " ".join(map(str, value)),
)
def test_what_does_not_fit_the_file_is_one_line_that_names_it(
    capsys: pytest.CaptureFixture[str], recorded: Path, options: list[Any], words: list[str]
) -> None:
    status, document = run_json(capsys, recorded, *options)
    assert status == 1
    (failure,) = document["failures"]
    assert failure["file"] == str(recorded)
    assert failure["error"].count(str(recorded)) == 1
    for word in words:
        assert word in failure["error"]


@pytest.mark.parametrize(
    ("column", "words"),
    [
        (np.full(4000, 3.0), ["target is constant (3)"]),
        (np.zeros(4000), ["target is constant (0)"]),
        (np.where(np.isin(np.arange(4000), [17, 900, 901]), np.nan, burst()), ["3 NaN", "index 17", "--fill"]),
    ],
    ids=["constant", "zero", "missing samples"],
)
def test_bad_samples_name_file_channel_and_remedy(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, column: np.ndarray, words: list[str]
) -> None:
    path = tmp_path / "bad.csv"
    table = np.column_stack([column, burst(0.02)])
    np.savetxt(path, table, delimiter=",", header="target,measured", comments="")
    status, document = run_json(capsys, path, "--rate", RATE)
    assert status == 1
    (failure,) = document["failures"]
    assert str(path) in failure["error"]
    assert "'target'" in failure["error"]
    for word in words:
        assert word in failure["error"]
    if "--fill" in words:
        status, document = run_json(capsys, path, "--rate", RATE, "--fill", 2)
        assert status == 0
        (result,) = document["results"]
        assert result["delay_s"] == pytest.approx(0.02, rel=1e-3)
        assert result["settings"]["n_filled"] == {"target": 3, "measured": 0}
        assert any("3 samples" in w for w in result["warnings"])


def test_a_file_without_a_rate_says_how_to_give_one(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "no_rate.npz"
    np.savez(path, target=burst(), measured=burst(0.02))
    status, document = run_json(capsys, path)
    assert status == 1
    assert "--rate" in document["failures"][0]["error"]
    assert run(capsys, path, "--rate", RATE)[0] == 0


def test_too_short_and_unequal_channels_are_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    short, unequal = tmp_path / "short.npz", tmp_path / "unequal.npz"
    np.savez(short, target=[1.0, 2.0, 1.0], measured=[1.0, 2.0, 1.0], rate_hz=RATE)
    np.savez(unequal, target=burst(), measured=burst()[:-1], rate_hz=RATE)
    status, document = run_json(capsys, short, unequal)
    assert status == 1
    errors = [f["error"] for f in document["failures"]]
    assert "3 samples are too few" in errors[0]
    assert "4000" in errors[1]
    assert "3999" in errors[1]


def test_the_installed_command_runs_and_ends_with_its_status(recorded: Path) -> None:
    command = [sys.executable, "-m", "rthstrack", "evaluate", str(recorded), "--limit-delay", "0.001"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert done.stdout.startswith("measured lags target by 20 ms")
    assert "Traceback" not in done.stderr


def test_a_reader_that_has_had_enough_is_no_error(recorded: Path) -> None:
    command = f"{sys.executable} -m rthstrack evaluate {recorded} --json | head -c 10"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert "BrokenPipe" not in done.stderr
