"""What a program is told beside the words: codes that never change, and values in SI units."""

from __future__ import annotations

import copy
import json
import pickle
from typing import TYPE_CHECKING

import numpy as np
import pytest

import rthstrack
from rthstrack.cli import main
from rthstrack.said import Said
from rthstrack.verdict import assess

if TYPE_CHECKING:
    from pathlib import Path

RATE = 256.0
T = np.arange(4096) / RATE


def tone(delay_s: float = 0.0) -> np.ndarray:
    return np.sin(2 * np.pi * 2 * (T - delay_s))


def broad(delay_s: float = 0.0) -> np.ndarray:
    t = T - delay_s
    return sum(np.sin(2 * np.pi * f * t + f * f) for f in (0.7, 1.1, 1.9, 2.3, 3.1, 4.7))


def test_a_reason_says_in_numbers_what_it_says_in_words() -> None:
    # Delays of one tone are told apart by nothing but its period, here half a second.
    found = rthstrack.evaluate(tone(), tone(0.02), RATE, estimator="least_squares", max_delay_s=0.6)
    assert found.reason_code == "ambiguous"
    one, other = sorted(found.reason_values)
    assert other - one == pytest.approx(0.5, abs=1e-6)
    assert min(abs(delay - 0.02) for delay in (one, other)) < 1e-6
    clear = rthstrack.evaluate(broad(), broad(0.02), RATE, estimator="least_squares")
    assert (clear.reason, clear.reason_code, clear.reason_values) == ("", "", ())


def test_several_actuators_have_a_reason_each() -> None:
    target = np.column_stack([broad(), tone()])
    measured = np.column_stack([broad(0.02), tone(0.02)])
    found = rthstrack.evaluate(target, measured, RATE, estimator="least_squares", max_delay_s=0.6)
    assert found.reason_code == ("", "ambiguous")
    assert [len(values) for values in found.reason_values] == [0, 2]
    moving = rthstrack.evaluate_moving(target, measured, RATE, estimator="least_squares", max_delay_s=0.6)
    assert [len(codes) for codes in moving.reason_code] == [moving.time_s.size] * 2
    assert set(moving.reason_code[1]) == {"ambiguous"}


def test_windows_and_readings_say_the_same_of_a_target_at_rest() -> None:
    still = np.where(T < 8, broad(), broad()[2048])
    moving = rthstrack.evaluate_moving(still, still, RATE, window_s=4)
    at_rest = moving.time_s > 8 + 2
    assert {code for code, rests in zip(moving.reason_code, at_rest, strict=True) if rests} == {"still"}
    readings = rthstrack.Monitor(RATE, update_hz=4, minimum_amplitude=0.1).process(still, still)
    assert readings.reason_code[-1] == "still"
    assert readings.reason_values[-1] == ()
    assert [code == "" for code in readings.reason_code] == readings.valid.tolist()


def test_readings_have_the_numbers_of_the_evaluation() -> None:
    monitor = rthstrack.Monitor(RATE, window_s=4, update_hz=1, estimator="least_squares")
    rng = np.random.default_rng(3)
    target, measured = broad(), broad(0.02) + 0.01 * rng.standard_normal(T.size)
    readings = monitor.process(target, measured)
    assert len(monitor.process(target[:1], measured[:1])) == 0
    alone = rthstrack.evaluate_moving(target, measured, RATE, window_s=4, hop_s=1, estimator="least_squares",
                                      detrend="mean")  # fmt: skip
    for name in ("amplitude_std", "delay_std_s", "goodness", "residual_coherence"):
        assert getattr(readings, name)[-1] == pytest.approx(getattr(alone, name)[-1], rel=1e-9), name


def test_an_exception_says_in_numbers_what_it_says_in_words() -> None:
    holed = broad()
    holed[[100, 200, 300]] = np.nan
    with pytest.raises(rthstrack.SignalError) as caught:
        rthstrack.evaluate(broad(), holed, RATE)
    assert (caught.value.code, caught.value.values, caught.value.file) == ("not_finite", (3.0, 100.0), "")
    with pytest.raises(rthstrack.SignalError) as caught:
        rthstrack.evaluate_moving(np.column_stack([broad()] * 2), np.column_stack([broad(), holed]), RATE)
    assert str(caught.value).startswith("actuator 2: ")
    assert (caught.value.code, caught.value.values) == ("not_finite", (3.0, 100.0))
    with pytest.raises(rthstrack.SettingError) as caught:
        rthstrack.evaluate(broad(), broad(), RATE, data_decimation=3)
    assert (caught.value.code, caught.value.values) == ("not_power_of_two", (3.0,))


def test_an_exception_knows_its_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = tmp_path / "none.csv"
    with pytest.raises(rthstrack.RecordingError) as caught:
        rthstrack.read_recording(missing)
    assert (caught.value.file, caught.value.words) == (str(missing), "no such file")
    assert str(caught.value) == f"{missing}: no such file"
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.code, again.file) == (str(caught.value), "recording", str(missing))
    holed = broad()
    holed[7] = np.nan
    path = tmp_path / "test.csv"
    np.savetxt(
        path, np.column_stack([T, broad(), holed]), delimiter=",", header="time (s),target,measured", comments=""
    )
    assert main(["evaluate", str(path), str(missing), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert [(f["code"], f["values"]) for f in document["failures"]] == [("not_finite", [1, 7]), ("recording", [])]
    assert all(f["error"].count(f["file"]) == 1 for f in document["failures"])
    assert "--fill" in document["failures"][0]["error"]


def test_warnings_are_texts_with_code_and_values(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target, measured = broad(), 5 * broad(0.02)
    found = {warning.code: warning for warning in assess(target, measured, RATE).warnings}
    assert isinstance(found["odd_amplitude"], str)
    assert found["odd_amplitude"].values == pytest.approx((5.0,), rel=1e-2)
    path = tmp_path / "test.csv"
    np.savetxt(path, np.column_stack([T, target, measured]), delimiter=",", header="time (s),target,measured",
               comments="")  # fmt: skip
    table = tmp_path / "r.csv"
    assert main(["evaluate", str(path), "--json", "--limit-delay", "0.001", "--start", "1", "--csv", str(table)]) == 3
    (result,) = json.loads(capsys.readouterr().out)["results"]
    codes = [warning["code"] for warning in result["warning_codes"]]
    assert len(codes) == len(result["warnings"])
    assert {"channels_proposed", "odd_amplitude", "cut", "limit_delay"} <= set(codes)
    delay_s, limit_s = result["warning_codes"][codes.index("limit_delay")]["values"]
    (gate,) = result["gates"]
    assert (delay_s, limit_s) == (gate["worst_window"]["value"], 0.001)
    assert "; ".join(codes) in table.read_text(encoding="utf-8")


def test_a_text_with_a_code_is_a_text_and_stays_as_it_is() -> None:
    said = Said("too late: by 3 ms", "late", [0.003], "by 3 ms")
    assert said == "too late: by 3 ms"
    for other in (copy.deepcopy(said), pickle.loads(pickle.dumps(said))):
        assert (str(other), other.code, other.values, other.cause) == (str(said), "late", (0.003,), "by 3 ms")
    with pytest.raises(AttributeError):
        said.code = "early"
    assert json.dumps([said]) == '["too late: by 3 ms"]'
