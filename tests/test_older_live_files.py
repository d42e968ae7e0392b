"""What the monitor of 0.1.0 wrote can still be read; tests/data/0.1.0/README.md says what was sent to it."""

from __future__ import annotations

import json
import socket
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from rthstrack.cli import main
from rthstrack.recording import propose_pair, read_recording

FOLDER = Path(__file__).with_name("data") / "0.1.0"
RATE_HZ, GAIN = 64.0, 1.05
FILLED, LOST = range(100, 103), range(170, 180)


def motion(t: Any) -> Any:
    return 10 * np.sin(2 * np.pi * 3 * t) + 4 * np.sin(2 * np.pi * 5.3 * t + 1)


def sent() -> tuple[Any, Any]:
    """Target and measured; NaN where a sample was lost and not filled."""
    counter = np.arange(256.0)
    delay_s = np.where(counter < 1.5 * RATE_HZ, 0.006, 0.030)
    target, measured = motion(counter / RATE_HZ), GAIN * motion(counter / RATE_HZ - delay_s)
    for signal in (target, measured):
        signal[FILLED] = np.interp(FILLED, [99, 103], signal[[99, 103]])
        signal[LOST] = np.nan
    return target, measured


def lines(name: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (FOLDER / name).read_text().splitlines()]


def test_a_log_of_samples_is_a_recording() -> None:
    recording = read_recording(FOLDER / "run.arrows")
    assert recording.rate_hz == RATE_HZ
    assert propose_pair(recording)[0] == [("target_1", "measured_1")]
    for name, values in zip(("target_1", "measured_1"), sent(), strict=True):
        channel = recording.channel(name)
        assert channel.unit == "mm"
        np.testing.assert_allclose(channel.values, values, rtol=0, atol=1e-12)


def test_a_log_of_samples_is_replayed() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        to = f"udp://127.0.0.1:{receiver.getsockname()[1]}"
        assert main(["replay", str(FOLDER / "run.arrows"), "--to", to, "--speed", "16"]) == 0
        came = np.array([struct.unpack("<3d", receiver.recv(64)) for _ in range(256)])
    np.testing.assert_allclose(came, np.column_stack([np.arange(256), *sent()]), rtol=0, atol=1e-12)


def test_a_log_of_readings_says_what_the_lines_say() -> None:
    with pa.ipc.open_stream(FOLDER / "run.readings.arrows") as stream:
        logged = stream.read_all().to_pylist()
    readings = lines("readings.jsonl")
    names = ("index", "time_s", "centre_s", "actuator", "amplitude", "delay_s", "valid", "reason")
    assert [[row[name] for name in names] for row in logged] == [[row[name] for name in names] for row in readings]
    assert abs(readings[0]["amplitude"] - GAIN) < 1e-9
    assert abs(readings[0]["delay_s"] - 0.006) < 1e-9
    assert {row["alarms"] for row in logged} == {"", "delay", "delay,lost"}
    assert logged[-1]["received"] + logged[-1]["lost"] == logged[-1]["index"] + 1


def test_alarms_have_names_that_are_still_known() -> None:
    from rthstrack._core import settings_table

    known = {setting["name"].removeprefix("limit_").removesuffix("_s") for setting in settings_table("alarms")}
    alarms = [line["alarm"] for line in lines("alarms.jsonl")]
    assert [(one["name"], one["actuator"], one["raised"]) for one in alarms] == [
        ("delay", 0, True),
        ("lost", None, True),
        ("silence", None, True),
    ]
    assert {one["name"] for one in alarms} <= known
