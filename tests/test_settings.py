"""One table of settings: what is made from it is made anew, and every way in refuses the same."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rthstrack import Evaluator, Monitor, SettingError, Settings, evaluate, evaluate_moving
from rthstrack._core import checked_settings, settings_table
from rthstrack.cli import main
from rthstrack.cli.setting_options import option_name
from rthstrack.evaluation.settings import MonitorSettings, MovingSettings

ROOT = Path(__file__).resolve().parent.parent
T = np.arange(4096) / 256
TARGET = np.sin(8 * T) + 0.4 * np.sin(17 * T + 1)
MEASURED = np.sin(8 * (T - 0.01)) + 0.4 * np.sin(17 * (T - 0.01) + 1)

# Of each kind of setting: what it may be, and what it may not, by the table's own words for what it may.
OUT_OF_RANGE: dict[str, list[Any]] = {
    "choice": ["nonsense", "", 1, None],
    "whole": [0, 17, 2.5, "2", None],
    "power_of_two": [0, 3, -2, 2.0, "4", None],
    "positive": [0, -1.0, math.nan, math.inf, "1", (1, 2), None],
    "not_negative": [-1e-9, math.nan, math.inf, "0", None],
    "share": [1.0, -0.1, math.nan, "0", None],
    "number": [math.nan, math.inf, "soon", (1, 2)],
    "band": [(20, 1), (-1, 1), (1, math.inf), (math.nan, 2), 4, (1, 2, 3), "ab"],
    "flag": [1, "yes", None],
}


def test_what_is_kept_in_files_is_what_the_table_says(tmp_path: Path) -> None:
    sys.path.insert(0, str(ROOT / "reference"))
    try:
        from make_settings import DOCUMENT, SETTINGS, document, settings_module
    finally:
        sys.path.pop(0)
    made = tmp_path / "settings.py"
    made.write_text(settings_module(), encoding="utf-8")
    ruff = Path(sys.executable).with_name("ruff")
    subprocess.run([ruff, "format", "--quiet", "--config", ROOT / "pyproject.toml", made], check=True)
    assert made.read_text(encoding="utf-8") == SETTINGS.read_text(encoding="utf-8"), "run: make settings"
    assert document() == DOCUMENT.read_text(encoding="utf-8"), "run: make settings"


@pytest.mark.parametrize("of", ["evaluation", "moving", "monitor"])
def test_what_a_setting_may_not_be_is_refused_in_the_words_of_the_table(of: str) -> None:
    kinds = {"evaluation": Settings, "moving": MovingSettings, "monitor": MonitorSettings}
    first = {"rate_hz": 256.0} if of == "monitor" else {}
    for row in settings_table(of):
        for value in OUT_OF_RANGE[row["kind"]]:
            if (row["optional"] and value is None) or (row["kind"] == "whole" and row["most"] > 16 and value == 17):
                continue
            with pytest.raises(SettingError) as caught:
                kinds[of](**first | {row["name"]: value})  # type: ignore[arg-type]
            message = str(caught.value)
            assert message.startswith(f"{row['name']} must be {row['expected']}"), message
            assert "\n" not in message


@pytest.mark.parametrize("change", [{"weight_power": 17}, {"band_hz": (3, 1)}, {"estimator": "best"}])
def test_every_way_into_the_library_refuses_the_same(change: dict[str, Any]) -> None:
    said = set()
    for way in (
        lambda: evaluate(TARGET, MEASURED, 256, **change),
        lambda: evaluate_moving(TARGET, MEASURED, 256, **change),
        lambda: Evaluator(4096, 256, **change),
        lambda: Settings(**change),
        lambda: dataclasses.replace(Settings(), **change),
        lambda: checked_settings("evaluation", change),
    ):
        with pytest.raises(SettingError) as caught:
            way()
        said.add(str(caught.value))
    assert len(said) == 1, said


def test_an_unknown_setting_is_told_with_what_may_be_meant() -> None:
    with pytest.raises(SettingError, match=r"unknown setting max_delay \(did you mean 'max_delay_s'"):
        evaluate(TARGET, MEASURED, 256, max_delay=0.1)  # type: ignore[call-arg]
    with pytest.raises(SettingError, match=r"unknown setting zzz; there are: rate_hz, window_s"):
        Monitor(256, zzz=1)  # type: ignore[call-arg]


def test_settings_whole_or_by_keyword_are_the_same_and_keywords_go_before() -> None:
    settings = Settings(estimator="least_squares", detrend="mean")
    by_keyword = evaluate(TARGET, MEASURED, 256, estimator="least_squares", detrend="mean")
    assert evaluate(TARGET, MEASURED, 256, settings).to_dict() == by_keyword.to_dict()
    assert evaluate(TARGET, MEASURED, 256, settings, detrend="linear").settings.detrend == "linear"
    moving = evaluate_moving(TARGET, MEASURED, 256, settings, window_s=2.0)
    assert (moving.settings, moving.window_s, moving.hop_s) == (settings, 2.0, 0.25)
    whole = MonitorSettings(256.0, update_hz=8.0, estimator="least_squares", detrend="mean")
    assert Monitor(whole).settings == whole
    assert Monitor(whole, detrend="linear").settings == dataclasses.replace(whole, detrend="linear")


def test_settings_are_of_plain_types_whatever_they_are_given_as() -> None:
    settings = Settings(data_decimation=np.int64(4), max_delay_s=np.float32(0.5), band_hz=np.array([1, 20]))  # type: ignore[arg-type]
    assert settings == Settings(data_decimation=4, max_delay_s=0.5, band_hz=(1.0, 20.0))
    assert [type(settings.data_decimation), type(settings.max_delay_s)] == [int, float]
    assert isinstance(hash(settings), int)


def test_every_setting_is_an_option_of_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    for command, of in (("evaluate", "evaluation"), ("monitor", "monitor")):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        told = capsys.readouterr().out
        for row in settings_table(of):
            if row["name"] != "n_actuators":
                assert option_name(row["name"]) in told, row["name"]
