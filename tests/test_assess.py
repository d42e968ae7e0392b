"""`assess` of recordings: the likely pair, the words and the errors of the command; one or many in a report."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rthstrack
from rthstrack.cli import main

RATE = 200.0


def motion(delay_s: float = 0.0) -> np.ndarray:
    t = np.arange(4000) / RATE - delay_s
    return 10 * np.sin(2 * np.pi * 2 * t) * np.exp(-((t - 10) ** 2) / 8)


def written(path: Path, header: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack(columns), fmt="%.9g", delimiter=",", header=header, comments="")
    return path


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    time_s = np.arange(4000) / RATE
    header = "Time (s),target (mm),measured (mm),late (m)"
    return written(tmp_path / "test.csv", header, time_s, motion(), motion(0.02), motion(0.03) / 1000)


def of_command(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, Any]:
    main(["evaluate", *map(str, arguments), "--json"])
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    return document


@pytest.mark.parametrize("named", [{}, {"target": "target", "measured": "#3"}])
def test_a_recording_is_judged_as_the_command_judges_its_file(
    recorded: Path, named: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    found = rthstrack.assess(rthstrack.read_recording(recorded), **named)
    options = [word for name, channel in named.items() for word in (f"--{name}", channel)]
    (expected,) = of_command(capsys, recorded, *options)["results"]
    # Converted to millimetres, where it is named.
    assert found.tracking.delay_s == pytest.approx(0.03 if named else 0.02, abs=2e-5)
    assert found.tracking.amplitude == pytest.approx(1, abs=1e-3)
    assert (found.tracking.amplitude, found.tracking.delay_s) == (expected["amplitude"], expected["delay_s"])
    assert [*found.warnings, *found.exceeded] == expected["warnings"]
    assert found.argument == expected["argument"]
    assert (found.file, found.target_name, found.measured_name, found.unit, found.rate_hz) == (
        str(recorded), expected["target"], expected["measured"], "mm", RATE,
    )  # fmt: skip
    assert found.settings["rate_source"] == expected["settings"]["rate_source"]


def test_settings_windows_and_limits_are_taken(recorded: Path) -> None:
    recording = rthstrack.read_recording(recorded)
    found = rthstrack.assess(
        recording, settings=rthstrack.Settings(window="hann"), moving_s=2.0, limits=rthstrack.Limits(delay_s=0.001)
    )
    assert found.tracking.settings.window == "hann"
    assert found.moving is not None
    assert found.moving.window_s == 2.0
    assert [one.code for one in found.exceeded] == ["limit_delay"]


@pytest.mark.parametrize(
    ("header", "code"),
    [("Time (s),a,b", "channel"), ("Time (s),target,x", "channel"), ("a,target,measured", "recording")],
)
def test_an_error_is_that_of_the_command(
    tmp_path: Path, header: str, code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(1)
    first = np.arange(400) / RATE if header.startswith("Time") else rng.normal(size=400)
    path = written(tmp_path / "odd.csv", header, first, *rng.normal(size=(2, 400)))
    (failure,) = of_command(capsys, path)["failures"]
    with pytest.raises(rthstrack.RecordingError) as told:
        rthstrack.assess(rthstrack.read_recording(path))
    assert told.value.code == failure["code"] == code
    # But for what is done about it, which is said in the command's options there.
    said, options = str(told.value), failure["error"]
    assert said.rpartition("; ")[0] == options.rpartition("; ")[0]


def test_samples_that_are_missing_are_told_with_what_fills_them(recorded: Path) -> None:
    recording = rthstrack.read_recording(recorded)
    values = recording["measured"].values.copy()
    values[1000] = np.nan
    channels = tuple(dataclasses.replace(c, values=values) if c is recording["measured"] else c for c in recording)
    holed = dataclasses.replace(recording, channels=channels)
    with pytest.raises(
        rthstrack.SignalError, match=r"measured .measured \(mm\).: .*; filled\(SAMPLES\) interpolates short"
    ):
        rthstrack.assess(holed)
    assert rthstrack.assess(holed.filled(1)).tracking.delay_s == pytest.approx(0.02, abs=1e-4)


def test_of_several_pairs_one_is_asked_for(tmp_path: Path) -> None:
    header = "Time (s),target_1 (mm),measured_1 (mm),target_2 (mm),measured_2 (mm)"
    columns = (np.arange(4000) / RATE, motion(), motion(0.01), 2 * motion(0.3), 2 * motion(0.32))
    recording = rthstrack.read_recording(written(tmp_path / "two.csv", header, *columns))
    with pytest.raises(
        rthstrack.ChannelError, match=r"2 pairs: .target_1 \(mm\). and .measured_1 \(mm\)., .target_2 "
    ) as e:
        rthstrack.assess(recording)
    assert e.value.code == "several_pairs"
    pairs, _ = rthstrack.propose_pair(recording)
    both = [rthstrack.assess(recording, *pair, actuator=i) for i, pair in enumerate(pairs)]
    assert [one.tracking.delay_s for one in both] == pytest.approx([0.01, 0.02], abs=2e-5)
    assert [one.actuator for one in both] == [0, 1]
    with pytest.raises(rthstrack.SettingError, match="name both"):
        rthstrack.assess(recording, target="target_1")


def test_arrays_are_judged_by_place_and_by_name() -> None:
    target, measured = motion(), motion(0.02)
    one = rthstrack.assess(target, measured, RATE)
    two = rthstrack.assess(target=target, measured=measured, rate_hz=RATE)
    three = rthstrack.assess(target, measured=measured, rate_hz=RATE, unit="mm")
    assert one.tracking.delay_s == two.tracking.delay_s == three.tracking.delay_s
    assert three.unit == "mm"
    with pytest.raises(TypeError, match="a Recording, or target, measured and rate_hz"):
        rthstrack.assess(target, measured)  # type: ignore[call-overload]


def test_a_report_takes_one_or_many(recorded: Path, tmp_path: Path) -> None:
    found = rthstrack.assess(rthstrack.read_recording(recorded))
    one, many = tmp_path / "one.html", tmp_path / "many.html"
    rthstrack.write_report(found, one)
    rthstrack.write_report([found], many)
    assert "<title>" in one.read_text(encoding="utf-8")
    assert len(one.read_text(encoding="utf-8")) == len(many.read_text(encoding="utf-8"))
    rthstrack.write_report((found, found), many)
    assert "2 pairs in 1 file" in many.read_text(encoding="utf-8")
