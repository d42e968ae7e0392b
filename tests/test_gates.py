"""Limits as gates: the whole record and its windows, with intervals; what is in doubt does not pass."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rthstrack
from rthstrack import Limits
from rthstrack.cli import main
from rthstrack.verdict.limits import gates

RATE = 512.0
T = np.arange(int(40 * RATE)) / RATE
_RNG = np.random.default_rng(0)
_TONES = [(f, a / math.sqrt(f), p) for f, a, p in _RNG.uniform((0.3, 5, 0), (6, 10, 6.28), (25, 3))]

Signal = Any


def motion(t: Signal) -> Signal:
    """25 tones from 0.3 to 6 Hz."""
    return sum(a * np.sin(2 * np.pi * f * t + p) for f, a, p in _TONES)


def late(delay_s: Signal, gain: float = 1.0, noise: float = 0.02, seed: int = 1) -> Signal:
    return gain * motion(T - delay_s) + noise * np.random.default_rng(seed).standard_normal(T.size)


def judged(measured: Signal, settings: rthstrack.Settings | None = None, **limits: Any) -> rthstrack.Assessment:
    return rthstrack.assess(motion(T), measured, RATE, settings=settings, limits=Limits(**limits))


def gate(measured: Signal, **limits: Any) -> Any:
    (found,) = judged(measured, **limits).gates
    return found


def test_an_interval_within_the_limit_passes_and_one_beyond_does_not() -> None:
    passed, over = gate(late(0.008), delay_s=0.010), gate(late(0.008), delay_s=0.006)
    assert (passed.state, over.state) == ("passed", "exceeded")
    assert passed.whole.low < 0.008 < passed.whole.high < 0.010
    assert over.reason.code == "limit_delay"
    # A lead is a delay, too.
    assert gate(late(-0.008), delay_s=0.006).state == "exceeded"
    assert gate(late(0.0, gain=0.9), amplitude=0.05).state == "exceeded"
    assert gate(late(0.0, gain=0.97), amplitude=0.05).state == "passed"


def test_an_interval_on_both_sides_of_the_limit_cannot_be_judged() -> None:
    found = judged(late(0.012, noise=0.2))
    low, high = found.trusted.delay_interval_s
    straddled = gate(late(0.012, noise=0.2), delay_s=(low + high) / 2)
    assert (straddled.state, straddled.reason.code) == ("not_judged", "limit_straddled")


def test_an_average_hides_no_window() -> None:
    ramp = judged(late(0.006 + 0.024 * T / T[-1]), delay_s=0.020)
    assert ramp.tracking.delay_s < 0.020
    (found,) = ramp.gates
    assert found.state == "exceeded"
    # 20 ms are passed at 14/24 of the record.
    ((start, end),) = found.over_s
    assert start == pytest.approx(40 * 14 / 24, abs=0.8)
    assert end == found.worst_s == pytest.approx(38, abs=0.3)
    assert found.worst.value == pytest.approx(0.006 + 0.024 * found.worst_s / 40, abs=2e-4)
    assert "on average" in ramp.verdict


def test_where_half_of_the_windows_have_no_number_nothing_passes() -> None:
    found = judged(late(0.008), delay_s=0.050)
    moving = found.moving
    assert moving is not None
    for every, state in ((4, "passed"), (2, "not_judged")):
        # Every so many windows have a number, so that no stretch is as long as a window.
        known = np.arange(moving.time_s.size) % 4 < (3 if every == 4 else 1)
        gappy = dataclasses.replace(moving, delay_s=np.where(known, moving.delay_s, np.nan))
        (one,) = gates(found.tracking, gappy, found.limits, target=found.target, trusted=found.trusted)
        assert (one.state, one.n_undetermined) == (state, int((~known).sum()))
        assert f"{one.n_undetermined} of the {one.n_moving} windows" in one.reason


def test_a_stretch_as_long_as_a_window_in_which_nothing_is_known_is_no_pass() -> None:
    noise = np.random.default_rng(3).standard_normal(T.size)
    for measured in (np.where((T > 12) & (T < 20), noise, late(0.008)), np.where(T > 32, noise, late(0.008))):
        found = judged(measured, delay_s=0.050)
        assert 0.004 < found.tracking.delay_s < 0.012
        (one,) = found.gates
        assert (one.state, one.reason.code) == ("not_judged", "limit_stretch"), one.reason


def test_windows_that_cannot_be_made_close_the_gate() -> None:
    # Of so narrow a band a window has no bin; the whole record has, and its average is within.
    ramp = late(0.006 + 0.024 * T / T[-1])
    found = judged(ramp, settings=rthstrack.Settings(band_hz=(2.05, 2.2)), delay_s=0.020)
    assert found.moving is None
    assert found.outcome == "not_judged"


def test_what_stands_beside_does_not_switch_the_windows_off() -> None:
    # A sensor frozen for more than a window: the published average of that window is refused.
    held = late(0.006 + 0.024 * T / T[-1])
    held[(T > 12) & (T < 16.6)] = held[np.searchsorted(T, 12)]
    found = judged(held, delay_s=0.022)
    assert found.moving is not None
    assert found.outcome == "exceeded"


def test_windows_in_which_target_rests_are_not_missed() -> None:
    moves = (T > 15) & (T < 25)
    target = np.where(moves, motion(T), 0.0) * np.sin(np.pi * np.clip((T - 15) / 10, 0, 1)) ** 2
    measured = np.interp(T - 0.008, T, target) + 0.02 * np.random.default_rng(4).standard_normal(T.size)
    found = rthstrack.assess(target, measured, RATE, limits=Limits(delay_s=0.012))
    assert found.outcome == "passed", found.conclusion


@pytest.mark.parametrize("measured", [np.full(T.size, 3.7), np.random.default_rng(5).standard_normal(T.size)])
def test_without_a_number_no_gate_passes(measured: Signal) -> None:
    found = judged(measured, delay_s=0.1, amplitude=0.9)
    assert found.outcome == "not_judged"
    assert {one.reason.code for one in found.gates} == {"limit_undetermined"}
    assert found.conclusion.startswith("CANNOT BE JUDGED: ")


def test_without_an_interval_the_number_itself_is_judged_and_said_to_be() -> None:
    # The delay changes with frequency, as a real actuator's: no interval of one number.
    f = np.fft.rfftfreq(T.size, 1 / RATE)
    lag = np.fft.irfft(np.fft.rfft(motion(T)) / (1 + 1j * f / 8), T.size)
    found = gate(lag, delay_s=0.05)
    assert math.isnan(found.whole.low)
    assert found.state == "passed"
    assert "no interval" in found.reason


def test_a_lead_does_not_come_near_the_critical_delay_and_a_share_of_it_may_be_the_limit() -> None:
    assert gate(late(-0.030), critical_delay_s=0.0156).state == "passed"
    assert gate(late(0.010), critical_delay_s=0.0156).state == "passed"
    assert gate(late(0.010), critical_delay_s=0.0156, critical_fraction=0.5).state == "exceeded"
    assert gate(late(0.020), critical_delay_s=0.0156).state == "exceeded"


def test_the_published_average_passes_nothing_that_the_trusted_estimate_does_not() -> None:
    # An offset pulls the published delay to about a half.
    settings = rthstrack.Settings(estimator="fei")
    target, measured = motion(T) + 120, late(0.008) + 120
    found = rthstrack.assess(target, measured, RATE, settings=settings, limits=Limits(delay_s=0.006))
    assert found.tracking.delay_s < 0.006 < found.trusted.delay_s, found.tracking.delay_s
    (one,) = found.gates
    assert one.state != "passed"
    own = rthstrack.assess(target, measured, RATE, limits=Limits(delay_s=0.006))
    assert own.outcome == "exceeded"
    assert own.tracking is own.trusted


def test_a_copy_passes_no_gate() -> None:
    found = judged(motion(T), delay_s=0.1)
    assert (found.outcome, found.gates[0].reason.code) == ("not_judged", "limit_copy")


def test_a_limit_that_no_reading_could_exceed_is_refused() -> None:
    for limits in ({"delay_s": 6.0}, {"critical_delay_s": 15.6}):
        with pytest.raises(rthstrack.SettingError, match=r"can never be exceeded.*ms is 0\.0"):
            judged(late(0.008), **limits)
    # A quarter of a short record is the longest delay that is looked for.
    short = slice(0, int(0.5 * RATE))
    with pytest.raises(rthstrack.SettingError, match="a quarter of the record"):
        rthstrack.assess(motion(T)[short], late(0.008)[short], RATE, limits=Limits(delay_s=0.2))


# --- the command ----------------------------------------------------------------------------------------------------


@pytest.fixture
def run_file(tmp_path: Path) -> Path:
    path = tmp_path / "run.npz"
    np.savez(path, time_s=T, target=motion(T), measured=late(0.008))
    return path


def test_the_exit_status_and_the_closing_line_say_the_same(run_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for options, status, word in (
        (["--limit-delay", "10ms"], 0, "PASS: |delay| 7.99"),
        (["--limit-delay", "0.006"], 3, "FAIL: |delay| 8.0"),
        (["--limit-delay", "10ms", "--limit-amplitude", "5%"], 0, "PASS: "),
        (["--critical-delay", "15.6ms"], 0, "PASS: delay 7.99"),
        (["--critical-delay", "15.6ms", "--critical-fraction", "50 %"], 3, "FAIL: delay 8.0"),
    ):
        assert main(["evaluate", str(run_file), *options]) == status, options
        assert capsys.readouterr().out.rstrip().splitlines()[-1].startswith(word), options


def test_json_holds_everything_that_is_said(run_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", str(run_file), "--limit-delay", "6ms", "--json"]) == 3
    (result,) = json.loads(capsys.readouterr().out)["results"]
    assert result["outcome"] == "exceeded"
    (found,) = result["gates"]
    assert (found["name"], found["limit"], found["state"]) == ("delay", 0.006, "exceeded")
    assert found["whole"]["interval"] == result["delay_interval_s"]
    assert len(found["over_limit_s"]) == 1
    assert found["worst_window"]["interval"][0] > 0.006
    assert result["verdict"].startswith("measured lags target by 8 ms")
    assert result["conclusion"].startswith("FAIL: ")
    assert result["limits"]["delay_s"] == 0.006
    assert result["estimator"] == "least_squares"
    assert (result["actuator"], result["actuator_number"], result["actuator_name"]) == (0, 1, "target")
    assert result["delay_s"] == result["trusted"]["delay_s"] != result["published"]["delay_s"]
    assert len(result["moving"]["time_s"]) == len(result["moving"]["delay_s"])
    assert len(result["frequency_response"]["frequency_hz"]) == len(result["frequency_response"]["delay_s"])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--limit-delay", "6"], "can never be exceeded"),
        (["--limit-delay", "20Hz"], "expected a time (0.02, 20ms), found '20Hz', which is a frequency"),
        (["--limit-amplitude", "20ms"], "expected a number (0.05, '5 %'), found '20ms', which is a time"),
        (["--rate", "20ms"], "expected a frequency (1024, 2kHz), found '20ms', which is a time"),
        (["--moving", "4kHz"], "found '4kHz', which is a frequency"),
        (["--limit-delay", "20 parsecs"], "the unit 'parsecs' is not known here"),
        (["--band", "1ms", "5Hz"], "found '1ms', which is a time"),
        (["--limit-delay", "-20ms"], "--limit-delay"),
        (["--critical-fraction", "0.5"], "--critical-fraction speaks of"),
        (["--critical-delay", "10ms", "--structure", "x.toml"], "--structure tells the critical delay"),
    ],
)
def test_a_number_in_the_wrong_unit_says_which_is_meant(
    run_file: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: str
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["evaluate", str(run_file), *options])
    assert stop.value.code == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("20ms", "s", 0.02), ("0.02", "s", 0.02), ("20 ms", "s", 0.02), ("2e-2s", "s", 0.02), ("1min", "s", 60.0),
        ("2kHz", "Hz", 2000.0), ("2000", "Hz", 2000.0), ("5 %", "", 0.05), ("5%", "", 0.05), (".05", "", 0.05),
        ("5mm", "m", 0.005), ("-20ms", "s", -0.02),
    ],
)  # fmt: skip
def test_a_number_may_have_its_unit(text: str, unit: str, value: float) -> None:
    from rthstrack.cli.quantities import number

    assert number(text, unit) == pytest.approx(value, rel=1e-12)


# --- what the delay means for the structure -------------------------------------------------------------------------


def test_the_structure_tells_the_share_of_its_critical_delay_and_the_damping_that_is_lost(
    run_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # All of an SDOF's stiffness is the specimen: the critical delay is about 2 zeta / omega, and a delay d takes
    # omega d / 2 of damping (Horiuchi 1999; first order in d).
    config = tmp_path / "structure.toml"
    config.write_text(
        "[test]\nstepping = 'continuous'\n[structure]\nfrequency_hz = 1.0\nmass_kg = 1000.0\ndamping_ratio = 0.05\n"
        "[[actuator]]\ndelay_s = 0.5\nspecimen = { law = 'spring' }\n"
    )
    assert main(["evaluate", str(run_file), "--structure", str(config), "--json"]) == 0
    (result,) = json.loads(capsys.readouterr().out)["results"]
    loop = result["loop"]
    assert loop["critical_delay_s"] == pytest.approx(2 * 0.05 / (2 * np.pi), rel=0.02)
    assert loop["share"] == pytest.approx(0.008 / loop["critical_delay_s"], rel=1e-3)
    assert loop["damping_lost"] == pytest.approx(np.pi * 0.008, rel=0.03)
    assert loop["damping_lost_interval"][0] < loop["damping_lost"] < loop["damping_lost_interval"][1]
    assert result["gates"][0]["name"] == "critical_delay"
    assert main(["evaluate", str(run_file), "--structure", str(config), "--critical-fraction", "0.4"]) == 3
    out = capsys.readouterr().out
    assert "of critical damping; the structure has 5 % at" in out


def test_a_structure_that_is_none_or_has_two_actuators_is_refused(
    run_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "alone.toml"
    config.write_text("[test]\nstepping = 'cr'\n[[actuator]]\n[target]\nsine = { frequency_hz = 1, amplitude_m = 1 }\n")
    with pytest.raises(SystemExit) as stop:
        main(["evaluate", str(run_file), "--structure", str(config)])
    assert stop.value.code == 2
    assert "structure: the configuration has none" in capsys.readouterr().err
    assert main(["evaluate", str(run_file), "--structure", str(tmp_path / "none.toml")]) == 2
    assert "none.toml" in capsys.readouterr().err


def test_a_file_that_failed_is_counted_and_passes_nothing(
    run_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", str(run_file), str(tmp_path / "none.csv"), "--limit-delay", "10ms"]) == 1
    last = capsys.readouterr().out.rstrip().splitlines()[-1]
    assert last.startswith("CANNOT BE JUDGED: 1 of 2 could not be read, 1 of 2 are within the limits")


@pytest.mark.parametrize(
    "wrong", [{"delay_s": -0.02}, {"delay_s": "20ms"}, {"amplitude": 5.0}, {"critical_fraction": 1.2}]
)
def test_limits_that_are_none_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(rthstrack.SettingError):
        Limits(**wrong)
    with pytest.raises(rthstrack.SettingError, match="expected Limits"):
        rthstrack.assess(motion(T), late(0.008), RATE, limits={"delay_s": 0.02})  # type: ignore[call-overload]
    with pytest.raises(rthstrack.SettingError, match="settings=Settings"):
        rthstrack.assess(motion(T), late(0.008), RATE, estimator="fei")  # type: ignore[call-overload]
