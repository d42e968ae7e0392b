"""What the paper recommends, by name: in Python and in both commands, where what is given beside it goes before it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rthstrack
from rthstrack import PRESETS, SettingError, Settings, preset
from rthstrack.cli import main

NAMES = ("estimator", "data_decimation", "frequency_decimation", "window", "detrend")
PAPER = ("fei", 1, 16, "tukey", "mean")
USUAL = ("least_squares", 1, 1, "boxcar", "mean")


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """Noise below 10 Hz, measured 12 ms late."""
    t = np.arange(4096) / 256
    random = np.random.default_rng(1)
    tones = [(f, random.uniform(0, 2 * np.pi)) for f in np.arange(0.25, 10, 0.3)]
    target, measured = (sum(np.sin(2 * np.pi * f * (t - d) + p) for f, p in tones) for d in (0.0, 0.012))
    path = tmp_path / "test.csv"
    np.savetxt(
        path, np.column_stack((t, target, measured)), delimiter=",", header="time_s,target,measured", comments=""
    )
    return path


def settings_of(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[Any, ...]:
    assert main(["evaluate", *map(str, arguments), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["results"][0]["settings"]
    return tuple(found[name] for name in NAMES)


def test_a_preset_is_settings() -> None:
    assert {name: tuple(getattr(one, n) for n in NAMES) for name, one in PRESETS.items()} == {
        "paper": PAPER,
        "paper-fast": ("fei", 16, 16, "tukey", "mean"),
    }
    assert preset("paper") == Settings("fei", frequency_decimation=16, window="tukey", detrend="mean")
    assert preset("paper-fast", window="hann").window == "hann"
    rng = np.random.default_rng(0)
    x = np.cumsum(rng.standard_normal(4096))
    found = rthstrack.Evaluator(4096, 256.0, preset("paper")).evaluate(x, np.roll(x, 3))
    same = rthstrack.evaluate(
        x, np.roll(x, 3), 256.0, Settings("fei", frequency_decimation=16, window="tukey", detrend="mean")
    )
    assert (found.delay_s, found.amplitude) == (same.delay_s, same.amplitude)


def test_an_unknown_preset_or_setting_is_told_with_those_there_are() -> None:
    with pytest.raises(SettingError, match=r"preset: expected one of paper, paper-fast, found 'papr' \(did you mean "):
        preset("papr")
    with pytest.raises(SettingError, match=r"unknown setting windw \(did you mean 'window'\?\)"):
        preset("paper", windw="hann")


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ("", USUAL),
        ("--preset paper", PAPER),
        ("--preset paper-fast", ("fei", 16, 16, "tukey", "mean")),
        # What is given goes before it, wherever it stands, even where it says the usual value.
        ("--window boxcar --preset paper -Q 4", ("fei", 1, 4, "boxcar", "mean")),
        ("--preset paper --detrend none -P 2 --estimator aligned", ("aligned", 2, 16, "tukey", "none")),
    ],
)
def test_evaluate_takes_a_preset(
    capsys: pytest.CaptureFixture[str], recorded: Path, options: str, expected: tuple[Any, ...]
) -> None:
    assert settings_of(capsys, recorded, *options.split()) == expected


def test_auto_goes_before_a_preset(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    estimator, _, q, window, detrend = settings_of(capsys, recorded, "--preset", "paper", "-P", "auto")
    assert (estimator, q, window, detrend) == ("fei", 16, "tukey", "mean")


def test_study_takes_a_presets_factors_beside_none(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    def cells(*options: str) -> list[tuple[int, int, str, str]]:
        assert main(["study", str(recorded), "--no-timing", "--json", *options]) == 0
        found = json.loads(capsys.readouterr().out)["study"]["cells"]
        names = NAMES[1:]
        return [tuple(cell["settings"][name] for name in names) for cell in found]

    assert cells("--preset", "paper") == [(1, 1, "tukey", "mean"), (1, 16, "tukey", "mean")]
    assert [cell[:2] for cell in cells("--preset", "paper-fast")] == [(1, 1), (1, 16), (16, 1), (16, 16)]
    assert cells("--preset", "paper", "-Q", "2", "--windows", "hann") == [(1, 2, "hann", "mean")]


@pytest.mark.parametrize("command", ["evaluate", "study"])
def test_an_unknown_preset_is_misuse(capsys: pytest.CaptureFixture[str], recorded: Path, command: str) -> None:
    with pytest.raises(SystemExit) as stop:
        main([command, str(recorded), "--preset", "papr"])
    assert stop.value.code == 2
    said = capsys.readouterr().err.replace("'", "")
    assert "expected one of paper, paper-fast, found papr (did you mean paper or paper-fast?)" in said
