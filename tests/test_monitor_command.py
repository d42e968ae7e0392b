"""The command `rthstrack monitor`: what it refuses, hands to the compiled part, says, and how it ends."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from fake_live import FakeLive, event
from rthstrack import _core
from rthstrack.cli import addresses, main
from rthstrack.errors import SettingError
from rthstrack.recording.readers.arrow import END_OF_STREAM

FAKE = Path(__file__).with_name("fake_live.py")
UDP = ("--listen", "udp://127.0.0.1:0", "--rate", "1024")
LINES = ("--listen", "-", "--rate", "100")
KEYS = ["received", "lost", "repeated", "reordered", "malformed", "readings", "alarms"]


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> type[FakeLive]:
    """The stand-in, in the place of the compiled class; a test may change it as it likes."""
    own = type("Live", (FakeLive,), {"ends_after_s": 0.0})
    monkeypatch.setattr(_core, "Live", own, raising=False)
    return own


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, list[str]]:
    """Exit status, standard output and the lines of standard error, without the usage that follows a misuse."""
    try:
        status = main(["monitor", *map(str, arguments)])
    except SystemExit as stop:
        status = int(stop.code or 0)
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    lines = err.splitlines()
    return status, out, lines[:-2] if lines[-2:-1] and lines[-2].startswith("usage: ") else lines


# Mistakes -------------------------------------------------------------------------------------------------------------


def test_all_mistakes_are_told_at_once_a_line_each_and_nothing_is_started(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, fake: type[FakeLive]
) -> None:
    layout = tmp_path / "layout.toml"
    layout.write_text('counter = "f63"\nbyte_ordr = "big"\n[[actuator]]\ntarget = { offset = 8 }\n')
    there = tmp_path / "run.arrows"
    there.write_text("something")
    status, out, err = run(
        capsys, "--listen", "tcp://1.2.3.4", "--layout", layout, "--window", "-1", "--band", "5", "x", "--estimator",
        "lsq", "-P", "3", "--critical-fraction", "0.4", "--page-host", "127.0.0.1", "--hysteresis", "1", "--log", there,
        "--readings", tmp_path / "no" / "r.jsonl", "--readings", "udp://127.0.0.1:0", "--control", "70000",
    )  # fmt: skip
    assert (status, out) == (2, "")
    assert "made" not in vars(fake)
    assert all(line.startswith("rthstrack: ") for line in err)
    wanted = [
        "--listen: expected udp://HOST:PORT", "--rate is missing", "counter: expected one of", "byte_ordr: no such key",
        "actuator[1].measured: missing", "--window: expected a positive", "--band: expected two finite frequencies",
        "--estimator: "
        "expected one of", "-P: expected a power of two", "--critical-fraction speaks of", "--page-host speaks of",
        "--hysteresis: expected", "is there already", "there is no directory", "--readings: expected a port",
        "--control: expected a port",
    ]  # fmt: skip
    for text in wanted:
        assert sum(text in line for line in err) == 1, (text, err)
    assert len(err) == len(wanted)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--rate", "1024"], "--listen is missing: give --listen udp://HOST:PORT for datagrams, or --listen -"),
        (["--listen", "-"], "--rate is missing"),
        ([*UDP, "--rate", "nan"], "--rate: expected a finite number, found 'nan'"),
        ([*UDP, "--rate", "0"], "--rate: expected a positive number"),
        ([*UDP, "--actuators", "0"], "--actuators: expected a whole number from 1 on"),
        ([*UDP, "--actuators", "300"], "--actuators: expected at most 256 actuators, found 300"),
        ([*UDP, "--actuators", "2", "--layout", "none.toml"], "give one of them"),
        ([*UDP, "--layout", "none.toml"], "none.toml: cannot be read: No such file"),
        ([*UDP, "--listen", "udp://127.0.0.1:99999"], "--listen: expected a port from 1 to 65535"),
        ([*UDP, "--listen", "udp://no such host:1"], "--listen: expected an address or the name of a machine"),
        ([*UDP, "--listen", "5005"], "--listen: expected udp://HOST:PORT, such as udp://127.0.0.1:5005, found '5005'"),
        ([*UDP, "--fill", "-1"], "--fill: expected a whole number from 0 on"),
        ([*UDP, "--fill", "5000"], "--fill: expected at most the 4096 samples of the window, found 5000"),
        ([*UDP, "--allow", "no such host"], "--allow: expected an address"),
        ([*UDP, "--update", "2000"], "--update: expected at most the 1024 samples a second"),
        ([*UDP, "-P", "64"], "--band: expected HI of at most rate / (4 P), P = 64, 4 Hz, found 32"),
        ([*UDP, "--band", "8", "2"], "--band: expected LO below HI, found 8 and 2"),
        ([*UDP, "--band", "0", "513"], "--band: expected HI of at most half the rate, 512 Hz, found 513"),
        ([*UDP, "--window", "0.001"], "--window: expected at least 8 samples"),
        ([*UDP, "--window", "1e9"], "MiB; take a shorter one"),
        ([*UDP, "--window-shape", "hat"], "--window-shape: expected one of boxcar, hann"),
        ([*UDP, "--detrend", "up"], "--detrend: expected one of none, mean, linear"),
        ([*UDP, "--expected-delay", "0.5"], "--expected-delay: expected at most --max-delay, 0.25 s"),
        (
            [*UDP, "--limit-delay", "20"],
            "--limit-delay: 20 s can never be exceeded, for least_squares looks for delays of "
            "up to --max-delay, 0.25 s: expected less, or a larger --max-delay; in seconds, 20 ms is 0.02",
        ),
        ([*UDP, "--limit-delay", "0.25", "--estimator", "aligned"], "--limit-delay: 0.25 s can never be exceeded"),
        (
            [*UDP, "--critical-delay", "31"],
            "--critical-delay: 15.5 s, 0.5 of it, can never be exceeded, for "
            "least_squares looks for delays of up to --max-delay, 0.25 s: expected less, or a larger --max-delay; in "
            "seconds, 31 ms is 0.031",
        ),
        ([*UDP, "--critical-delay", "0.3", "--critical-fraction", "0.5", "--max-delay", "0.1"], "0.15 s, 0.5 of it,"),
        (
            [*UDP, "--limit-delay", "0.2", "--window", "0.5"],
            "up to a quarter of --window, 0.125 s: expected less, or a larger --window",
        ),
        ([*UDP, "--limit-delay", "-0.01"], "--limit-delay: expected a positive duration"),
        ([*UDP, "--limit-amplitude", "x"], "--limit-amplitude: expected a positive number, found 'x'"),
        ([*UDP, "--limit-lost", "0"], "--limit-lost: expected a whole number from 1 on"),
        ([*UDP, "--silence", "inf"], "--silence: expected a finite number"),
        ([*UDP, "--alarm-to", "127.0.0.1:5"], "--alarm-to: expected udp://HOST:PORT"),
        ([*UDP, "--page", "x"], "--page: expected a port"),
        ([*UDP, "--page-name", "lab"], "--page-name speaks of --page"),
        ([*UDP, "--page", "0", "--page-name", "http://lab/"], "--page-name: expected the name of a machine"),
        ([*UDP, "--page", "0", "--page-name", "lab:80"], "--page-name: expected the name of a machine"),
        ([*UDP, "--log", "/dev/full"], "--log: /dev/full: is a pipe or a device"),
        ([*UDP, "--readings", "/dev/null"], "--readings: /dev/null: is a pipe or a device"),
        ([*UDP, "--target", "x", "--measured", "y"], "--target and --measured name columns of lines: give --listen -"),
        ([*LINES, "--target", "x"], "--measured: expected one for each --target, found 0 for 1"),
        ([*LINES, "--measured", "x"], "--measured: expected one for each --target, found 1 for 0"),
        (
            [*LINES, "--target", "x", "--measured", "x"],
            "--target and --measured: actuator[1].measured: 'x' is the target's column",
        ),
        ([*LINES, "--target", "x", "--measured", "counter"], "actuator[1].measured: 'counter' is the counter's column"),
        ([*LINES, "--target", "x\x1b", "--measured", "y"], "--target: expected a column's name"),
        ([*LINES, "--target", "x", "--measured", "y", "--actuators", "2"], "--actuators speaks of the default layout"),
        ([*LINES, "--target", "x", "--measured", "y", "--counter", "n", "--no-counter"], "--counter names what"),
        ([*LINES, "--counter", "n"], "--counter speaks of columns: give --target and --measured too"),
        ([*LINES, "--no-counter", "--layout", "none.toml"], "--no-counter speaks of the default layout"),
        ([*UDP, "--duration", "0"], "--duration: expected a positive number"),
        ([*UDP, "--readings", "a", "--readings", "b"], "--readings: expected at most one file and one address"),
        ([*UDP, "--readings", "a.arrows", "--log", "a.arrows"], "--readings and --log name the same file"),
        ([*UDP, "--log", "/"], "--log: /: is a directory"),
        ([*UDP, "--view"], "--view: neither standard output nor standard error is a terminal"),
        (["--listen", "-", "--rate", "8", "--allow", "127.0.0.1"], "--allow speaks of datagrams"),
    ],
)
def test_a_mistake_is_one_line_that_names_the_option(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive], arguments: list[str], message: str
) -> None:
    status, out, err = run(capsys, *arguments)
    assert (status, out) == (2, "")
    assert all(line.startswith("rthstrack: ") for line in err)
    assert sum(message in line for line in err) == 1
    # What is missing may make other things wrong, but not many.
    assert len(err) <= 2


@pytest.mark.parametrize(
    "arguments",
    [
        ["--limit-delay", "0.3", "--max-delay", "0.4"],
        ["--critical-delay", "0.4"],
        # It has no largest delay.
        ["--limit-delay", "0.3", "--estimator", "fei"],
    ],
)
def test_a_limit_that_can_be_exceeded_is_taken(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive], arguments: list[str]
) -> None:
    assert run(capsys, *UDP, *arguments)[0] == 0


@pytest.mark.parametrize(
    ("refusal", "expected"),
    [
        (OSError("cannot listen at 127.0.0.1:5005: Address already in use"), 1),
        (SettingError("the window is longer than memory allows"), 2),
    ],
)
def test_what_the_compiled_part_refuses_is_told_in_a_line(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive], refusal: Exception, expected: int
) -> None:
    fake.refusal = refusal
    status, out, err = run(capsys, *UDP)
    assert (status, out, err) == (expected, "", [f"rthstrack: {refusal}"])


def test_a_log_that_cannot_be_written_at_the_start_is_told_in_a_line(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(file: int, message: Any) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "run.arrows"
    monkeypatch.setattr(os, "write", full)
    status, out, err = run(capsys, *UDP, "--log", path)
    assert (status, out) == (1, "")
    (line,) = err
    assert f"--log: {path}: cannot be written: No space left on device" in line
    assert fake.made.ended.is_set()


@pytest.mark.parametrize("option", ["--readings", "--log"])
def test_a_pipe_that_nobody_reads_is_refused_and_not_waited_for(option: str, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with started(*UDP, option, pipe) as process:
        try:
            _, err = process.communicate(timeout=20)
        finally:
            process.kill()
    assert process.returncode == 2
    assert f"{option}: {pipe}: is a pipe or a device" in err


# What is handed over --------------------------------------------------------------------------------------------------


def test_defaults_are_those_that_the_help_states(capsys: pytest.CaptureFixture[str], fake: type[FakeLive]) -> None:
    status, _, _ = run(capsys, *UDP, "--actuators", "2")
    assert status == 0
    made = fake.made
    assert made.monitor == {
        "rate_hz": 1024.0, "window_s": 4.0, "update_hz": 16.0, "band_hz": (0.0, 32.0), "window": "boxcar",
        "detrend": "mean", "estimator": "least_squares", "data_decimation": 8, "frequency_decimation": 1,
        "max_delay_s": 0.25, "expected_delay_s": None, "minimum_amplitude": 0.0, "n_actuators": 2,
    }  # fmt: skip
    assert made.source["layout"]["sample_bytes"] == 40
    assert {key: made.source[key] for key in made.source if key != "layout"} == {
        "kind": "udp", "address": "127.0.0.1:0", "senders": None, "fill_samples": 5, "check_pace": True, "path": None,
    }  # fmt: skip
    assert made.alarms == {
        "limit_delay_s": None, "limit_amplitude": None, "critical_delay_s": None, "critical_fraction": 0.5,
        "limit_lost": None, "silence_s": 1.0, "hysteresis": 0.1, "minimum_duration_s": 0.0, "latch": True,
    }  # fmt: skip
    assert made.outputs == {
        "readings_udp": None, "readings_file": None, "alarm_udp": None, "control": None, "log": False, "page": False,
        "names": ["actuator 1", "actuator 2"],
        "units": [None, None],
    }  # fmt: skip


def test_every_option_reaches_the_compiled_part(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive], tmp_path: Path
) -> None:
    status, _, _ = run(
        capsys, "--listen", "udp://localhost:5005", "--rate", "2048", "--window", "2", "--update", "64", "--band", "1",
        "20", "-P", "4", "-Q", "2", "--estimator", "fei", "--window-shape", "hann", "--detrend", "linear",
        "--max-delay", "0.1", "--expected-delay", "-0.02", "--minimum-amplitude", "0.5", "--limit-delay", "0.02",
        "--limit-amplitude", "0.1", "--critical-delay", "0.03", "--critical-fraction", "0.4", "--limit-lost", "7",
        "--silence", "2", "--hysteresis", "0", "--alarm-after", "0.5", "--no-latch", "--alarm-to",
        "udp://127.0.0.1:7001", "--control", "7002", "--readings", tmp_path / "r.jsonl", "--readings",
        "udp://127.0.0.1:7003", "--log", tmp_path / "l.arrows", "--allow", "127.0.0.1", "--allow", "::1", "--fill", "0",
        "--any-pace",
    )  # fmt: skip
    assert status == 0
    made = fake.made
    assert made.monitor == {
        "rate_hz": 2048.0, "window_s": 2.0, "update_hz": 64.0, "band_hz": (1.0, 20.0), "window": "hann",
        "detrend": "linear", "estimator": "fei", "data_decimation": 4, "frequency_decimation": 2, "max_delay_s": 0.1,
        "expected_delay_s": -0.02, "minimum_amplitude": 0.5, "n_actuators": 1,
    }  # fmt: skip
    assert {key: made.source[key] for key in made.source if key != "layout"} == {
        "kind": "udp", "address": "127.0.0.1:5005", "senders": ["127.0.0.1", "::1"], "fill_samples": 0,
        "check_pace": False, "path": None,
    }  # fmt: skip
    assert made.alarms == {
        "limit_delay_s": 0.02, "limit_amplitude": 0.1, "critical_delay_s": 0.03, "critical_fraction": 0.4,
        "limit_lost": 7, "silence_s": 2.0, "hysteresis": 0.0, "minimum_duration_s": 0.5, "latch": False,
    }  # fmt: skip
    assert made.outputs == {
        "readings_udp": "127.0.0.1:7003", "readings_file": str(tmp_path / "r.jsonl"), "alarm_udp": "127.0.0.1:7001",
        "control": "127.0.0.1:7002", "log": True, "page": False, "names": ["actuator 1"],
        "units": [None],
    }  # fmt: skip


def test_lines_on_standard_input_come_at_any_pace(capsys: pytest.CaptureFixture[str], fake: type[FakeLive]) -> None:
    status, _, err = run(capsys, "--listen", "-", "--rate", "100")
    assert status == 0
    source = fake.made.source
    assert (source["kind"], source["address"], source["check_pace"]) == ("lines", None, False)
    assert source["layout"]["format"] == "auto"
    # A quarter of the rate is less than 32 Hz.
    assert fake.made.monitor["band_hz"] == (0.0, 25.0)
    assert "monitoring lines on standard input" in err[0]


@pytest.mark.parametrize(
    ("arguments", "columns"),
    [
        (["--target", "x", "--measured", "y"], ("counter", ["x"], ["y"])),
        (["--target", "1", "--measured", "2", "--target", "1", "--measured", "3"], (0, [1, 1], [2, 3])),
        (["--target", "x", "--measured", "y", "--counter", "n"], ("n", ["x"], ["y"])),
        (["--target", "0", "--measured", "1", "--no-counter"], (None, [0], [1])),
        (["--no-counter"], (None, [0], [1])),
    ],
)
def test_columns_of_lines_are_named_without_a_layout(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive], arguments: list[str], columns: tuple[Any, ...]
) -> None:
    status, _, err = run(capsys, *LINES, *arguments)
    assert status == 0, err
    layout = fake.made.source["layout"]
    assert (layout["counter"], layout["target"], layout["measured"]) == columns
    assert fake.made.monitor["n_actuators"] == len(columns[1])


def test_datagrams_without_a_counter_need_no_layout(capsys: pytest.CaptureFixture[str], fake: type[FakeLive]) -> None:
    assert run(capsys, *UDP, "--no-counter")[0] == 0
    layout = fake.made.source["layout"]
    assert (layout["counter"], layout["sample_bytes"], layout["target"][0]["offset"]) == (None, 16, 0)


@pytest.mark.parametrize(
    ("rate", "high", "p"), [(1024, 32, 8), (1024, 33, 4), (4096, 32, 32), (1000, 32, 4), (256, 64, 1), (256, 65, 1)]
)
def test_p_is_the_largest_power_of_two_with_the_band_within_a_quarter_of_the_rate_that_is_left(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive], rate: int, high: int, p: int
) -> None:
    run(capsys, "--listen", "-", "--rate", rate, "--band", 0, high)
    assert fake.made.monitor["data_decimation"] == p
    assert p == 1 or high <= rate / (4 * p)
    assert high > rate / (8 * p)


def test_p_leaves_a_sample_for_every_reading(capsys: pytest.CaptureFixture[str], fake: type[FakeLive]) -> None:
    run(capsys, *UDP, "--band", 0, 1, "--update", 64)
    assert fake.made.monitor["data_decimation"] == 16


@pytest.mark.parametrize(
    ("text", "host", "is_loopback"),
    [
        ("udp://[fe80::1%1]:5005", "[fe80::1%1]:5005", False),
        ("udp://[::1]:5005", "[::1]:5005", True),
        ("udp://127.0.0.1:5005", "127.0.0.1:5005", True),
    ],
)
def test_a_link_local_address_keeps_its_interface(text: str, host: str, is_loopback: bool) -> None:
    assert addresses.udp(text) == host
    assert addresses.is_loopback(host) is is_loopback
    # Where a sender sits is not told by its interface.
    assert addresses.senders("fe80::1%1") == ["fe80::1"]
    assert addresses.host("fe80::1%1") == "fe80::1%1"


# What is said ---------------------------------------------------------------------------------------------------------


def test_at_the_end_one_line_on_standard_output_has_the_totals_and_the_rest_is_told_in_words(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive]
) -> None:
    fake.totals = {"received": 9, "lost": 1, "readings": 4, "alarms": 2, "filled": 1, "refused": 3}
    status, out, err = run(capsys, *UDP)
    assert status == 0
    (line,) = out.splitlines()
    summary = json.loads(line)["summary"]
    assert list(summary) == KEYS
    assert list(summary.values()) == [9, 1, 0, 0, 0, 4, 2]
    said = "1 samples filled by a straight line, 3 datagrams of senders that are not allowed"
    assert err[-1] == f"rthstrack: {said}"


def test_where_it_listens_is_told_with_the_port_that_was_free(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive]
) -> None:
    _, _, err = run(capsys, *UDP, "--control")
    assert "monitoring udp 127.0.0.1:54321: 1 actuator at 1024 Hz" in err[0]
    assert "a datagram 'reset' to udp://127.0.0.1:54322 resets alarms" in err[1]
    assert len(err) == 2


@pytest.mark.parametrize(
    ("arguments", "is_told"),
    [
        (["--limit-delay", "0.01"], True),
        (["--limit-lost", "5"], True),
        ([], False),
        (["--limit-delay", "0.01", "--control"], False),
        (["--limit-delay", "0.01", "--no-latch"], False),
        (["--limit-delay", "0.01", "--exit-on-alarm"], False),
    ],
)
def test_alarms_that_nobody_can_reset_are_told_at_the_start(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive], arguments: list[str], is_told: bool
) -> None:
    _, _, err = run(capsys, *UDP, *arguments)
    assert any("an alarm stays until the end, for there is no way to reset it" in line for line in err) is is_told


def test_units_reach_the_page(capsys: pytest.CaptureFixture[str], fake: type[FakeLive], tmp_path: Path) -> None:
    path = tmp_path / "layout.toml"
    path.write_text('fields = ["counter", "target", "measured"]\nunit = "mm"\n')
    assert run(capsys, *UDP, "--layout", path)[0] == 0
    assert fake.made.outputs["units"] == ["mm"]


def test_an_address_that_others_reach_is_told_unless_senders_are_listed(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive]
) -> None:
    anywhere = ("--listen", "udp://0.0.0.0:5005", "--rate", "1024")
    _, _, err = run(capsys, *anywhere)
    assert sum("any machine that reaches 0.0.0.0:5005 may send samples" in line for line in err) == 1
    _, _, err = run(capsys, *anywhere, "--allow", "10.0.0.7")
    assert not any("any machine" in line for line in err)
    assert fake.made.source["senders"] == ["10.0.0.7"]


def test_events_and_alarms_are_a_line_each_and_once(capsys: pytest.CaptureFixture[str], fake: type[FakeLive]) -> None:
    fake.ends_after_s, fake.alarm_after_s = 0.6, 0.2
    fake.events = (event("samples_lost", 0.1, "12 samples lost, the window starts anew", samples=12),)
    status, _, err = run(capsys, *UDP)
    assert status == 0
    assert err[1:] == [
        "rthstrack: at 0.10 s: 12 samples lost, the window starts anew",
        "rthstrack: ALARM at 0.20 s: advisory: actuator 1: lag of up to 21.000 ms, limit 20.000 ms",
    ]


def test_quiet_leaves_only_alarms(capsys: pytest.CaptureFixture[str], fake: type[FakeLive]) -> None:
    fake.ends_after_s, fake.alarm_after_s = 0.3, 0.1
    fake.events = (event("samples_again", 0.1, "something"),)
    _, _, err = run(capsys, *UDP, "--quiet")
    assert len(err) == 1
    assert "ALARM" in err[0]


# How it ends ----------------------------------------------------------------------------------------------------------


def test_an_alarm_ends_it_with_status_3_where_that_is_asked_for(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive]
) -> None:
    fake.ends_after_s, fake.alarm_after_s = None, 0.2
    status, out, err = run(capsys, *UDP, "--exit-on-alarm", "--duration", 20)
    assert status == 3
    assert json.loads(out)["summary"]["received"] < 5 * 1024
    assert any("ALARM" in line for line in err)
    status, _, _ = run(capsys, *UDP, "--duration", 0.4)
    assert status == 0


def test_a_sender_that_is_done_is_an_alarm_to_end_with_only_where_silence_is_given(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive]
) -> None:
    fake.ends_after_s, fake.alarm_after_s, fake.alarm_name = 0.5, 0.2, "silence"
    status, _, err = run(capsys, *UDP, "--exit-on-alarm")
    assert status == 0
    assert any("ALARM at 0.20 s: advisory: no sample for" in line for line in err)
    assert fake.made.alarms["silence_s"] == 1.0
    fake.ends_after_s = None
    assert run(capsys, *UDP, "--exit-on-alarm", "--silence", "0.2", "--duration", 20)[0] == 3
    assert fake.made.alarms["silence_s"] == 0.2


def test_silence_of_zero_is_not_watched(capsys: pytest.CaptureFixture[str], fake: type[FakeLive]) -> None:
    assert run(capsys, *UDP, "--silence", "0")[0] == 0
    assert fake.made.alarms["silence_s"] is None


def test_an_alarm_that_came_and_went_between_two_looks_ends_it_too(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive]
) -> None:
    fake.events = (
        event("alarm_raised", 0.1, "advisory: actuator 1: lag of up to 21.000 ms", alarm="delay", actuator=0),
        event("alarm_over", 0.2, "advisory: actuator 1: alarm 'delay' is over", alarm="delay", actuator=0),
    )
    assert run(capsys, *UDP, "--exit-on-alarm")[0] == 3
    fake.events = fake.events[1:]
    assert run(capsys, *UDP, "--exit-on-alarm")[0] == 0


@pytest.mark.parametrize(
    ("totals", "arguments", "said"),
    [
        ({"received": 0}, UDP, "no sample came: no datagram at 127.0.0.1:54321"),
        ({"received": 0}, ("--listen", "-", "--rate", "8"), "no sample came: no line at standard input"),
        (
            {"received": 0, "malformed": 7},
            UDP,
            "no sample came: none of the 7 datagrams at 127.0.0.1:54321 was as the layout says",
        ),
        (
            {"received": 0, "refused": 7},
            UDP,
            "no sample came: no datagram at 127.0.0.1:54321 but from senders that are not allowed",
        ),
        (
            {"received": 900, "readings": 0},
            UDP,
            "nothing was judged: 900 samples came, but never a whole window of 4 s without a gap that restarts it",
        ),
        (
            {"readings": 12, "valid": 0},
            UDP,
            "nothing was judged: none of 12 readings was valid; the last: not determined: ambiguous",
        ),
    ],
)
def test_a_run_that_judged_nothing_says_so_at_the_end(
    capsys: pytest.CaptureFixture[str],
    fake: type[FakeLive],
    totals: dict[str, int],
    arguments: tuple[str, ...],
    said: str,
) -> None:
    fake.totals, fake.reason = totals, "not determined: ambiguous"
    status, _, err = run(capsys, *arguments, "--quiet")
    assert (status, err[-1]) == (0, f"rthstrack: {said}")


def test_without_a_count_of_valid_readings_nothing_is_said_of_them(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive], monkeypatch: pytest.MonkeyPatch
) -> None:
    summary = fake.summary
    monkeypatch.setattr(fake, "summary", lambda self: {k: v for k, v in summary(self).items() if k != "valid"})
    assert run(capsys, *UDP, "--quiet")[2] == []


def test_it_ends_after_the_duration(capsys: pytest.CaptureFixture[str], fake: type[FakeLive]) -> None:
    fake.ends_after_s = None
    begin = time.monotonic()
    status, _, _ = run(capsys, *UDP, "--duration", 0.35)
    assert status == 0
    assert 0.3 < time.monotonic() - begin < 5


def test_what_makes_it_stop_is_one_line_and_status_1_and_the_totals_are_told(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive]
) -> None:
    fake.end_reason = "the counter goes up by 512 a second, but --rate says 1024 Hz"
    status, out, err = run(capsys, *UDP)
    assert status == 1
    assert list(json.loads(out)["summary"]) == KEYS
    assert err[-1] == f"rthstrack: {fake.end_reason}"


def started(*arguments: object, **more: Any) -> subprocess.Popen[str]:
    command = [sys.executable, str(FAKE), *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_cleanly_with_totals_and_a_whole_log(tmp_path: Path, number: signal.Signals) -> None:
    path = tmp_path / "run.arrows"
    with started(*UDP, "--log", path) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if "log: " in line:
                break
        time.sleep(0.5)
        process.send_signal(number)
        out, err = process.communicate(timeout=20)
    assert (process.returncode, err) == (0, "")
    assert list(json.loads(out)["summary"]) == KEYS
    for file in (path, tmp_path / "run.readings.arrows"):
        assert file.read_bytes().endswith(END_OF_STREAM)
        assert pa.ipc.open_stream(file).read_all().num_rows > 0
    # To the last sample that was received.
    assert pa.ipc.open_stream(path).read_all().num_rows == json.loads(out)["summary"]["received"]


def test_the_terminal_view_shows_readings_takes_keys_and_gives_the_terminal_back(tmp_path: Path) -> None:
    import pty
    import termios

    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    command = [sys.executable, str(FAKE), *UDP, "--duration", "20"]
    with subprocess.Popen(
        command, stdin=theirs, stdout=theirs, stderr=subprocess.PIPE, env=os.environ | {"COLUMNS": "110"}
    ) as process:
        seen = read_until(ours, b"q quits")
        seen += read_until(ours, b"12.3")
        assert not termios.tcgetattr(theirs)[3] & termios.ICANON
        os.write(ours, b"r")
        seen += read_until(ours, b"alarms were reset (1)")
        os.write(ours, b"\x1b[A")
        time.sleep(0.3)
        assert process.poll() is None
        os.write(ours, b"q")
        seen += read_until(ours, b"summary")
        assert process.wait(timeout=20) == 0
    assert b"actuator 1" in seen
    assert b"valid" in seen
    # The alternate screen is left and the cursor shown.
    assert seen.rindex(b"\x1b[?1049l") > seen.rindex(b"\x1b[?1049h")
    assert seen.rindex(b"\x1b[?25h") > seen.rindex(b"\x1b[?25l")
    assert termios.tcgetattr(theirs) == before
    os.close(ours)
    os.close(theirs)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_gives_the_terminal_back_too(number: signal.Signals) -> None:
    import pty
    import termios

    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    command = [sys.executable, str(FAKE), *UDP, "--duration", "20"]
    with subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=subprocess.PIPE) as process:
        read_until(ours, b"q quits")
        process.send_signal(number)
        read_until(ours, b"summary")
        assert process.wait(timeout=20) == 0
    assert termios.tcgetattr(theirs) == before
    os.close(ours)
    os.close(theirs)


def read_until(file: int, text: bytes) -> bytes:
    """What a terminal shows, until it shows this."""
    import select

    seen = b""
    end = time.monotonic() + 20
    while text not in seen:
        assert time.monotonic() < end, seen[-2000:]
        if select.select([file], [], [], 0.1)[0]:
            seen += os.read(file, 65536)
    return seen


def drawn(status: dict[str, Any], names: tuple[str, ...], size: tuple[int, int] = (150, 50), **more: Any) -> str:
    from rich.console import Console

    from rthstrack.live.view import shown

    console = Console(width=size[0], color_system=None)
    events = more.pop("events", ["at 1.00 s: something"])
    with console.capture() as capture:
        console.print(shown(status, "about", names, events, with_keys=False, size=size, **more))
    return capture.get()


def a_status(n_actuators: int, **changes: Any) -> dict[str, Any]:
    """A calm status; changes of the reading of every actuator."""
    reading = {
        "time_s": 9.0, "amplitude": 1.02, "delay_s": 0.0123, "equivalent_frequency_hz": 2.5,
        "amplitude_interval": [1.01, 1.03], "delay_interval_s": [0.0121, 0.0125], "valid": True, "reason": None,
        "reason_code": None, "reason_values": None,
    }  # fmt: skip
    return {
        "time_s": 9.0, "state": "running", "health": {"received": 7, "lost": 0, "pace_hz": 512.0, "log": None},
        "readings": [reading | {"actuator": i} | changes for i in range(n_actuators)], "alarms": [], "events": [],
    }  # fmt: skip


def an_alarm(actuator: int, *, active: bool = True) -> dict[str, Any]:
    text = f"advisory: actuator {actuator + 1}: lag of up to 21.000 ms, limit 20.000 ms"
    return {"name": "delay", "actuator": actuator, "active": active, "latched": not active, "text": text}


@pytest.mark.parametrize("size", [(80, 24), (120, 24), (60, 12), (40, 8), (200, 90)])
@pytest.mark.parametrize("raised", [[], [63], list(range(20, 64)), list(range(64))])
def test_the_view_fits_its_terminal_and_shows_health_and_alarms_first(size: tuple[int, int], raised: list[int]) -> None:
    names = tuple(f"actuator {i + 1}" for i in range(64))
    status = a_status(64) | {"alarms": [an_alarm(i, active=i % 2 == 1) for i in raised]}
    lines = drawn(status, names, size, events=[f"at {i}.00 s: " + 30 * "something " for i in range(6)]).splitlines()
    assert len(lines) <= size[1]
    assert max(map(len, lines)) <= size[0]
    assert lines[1].startswith("running 9.0 s")
    assert lines[1].endswith("lost") or "lost," in lines[1] or size[0] < 50
    if raised:
        assert lines[2].startswith("ALARM advisory: actuator")
        # What is over now comes before what is held.
        assert int(re.findall(r"actuator (\d+):", lines[2])[0]) % 2 == 0
        told = sum(line.startswith("ALARM") for line in lines)
        more = [int(found[1]) for line in lines if (found := re.match(r"and (\d+) more alarms", line))]
        assert told + sum(more) == len(raised)
        in_table = [line for line in lines if re.match(r"actuator \d+ .*12\.3", line)]
        # Eight lines have no room for a table beside alarms.
        assert in_table or size[1] == 8
        assert not in_table or int(in_table[0].split()[1]) == raised[0] + 1 or len(in_table) == 64
    assert "at 5.00 s" in lines[-1]


def test_a_narrow_terminal_shows_numbers_without_intervals() -> None:
    text = drawn(a_status(1), ("north",), (60, 24))
    north = next(line for line in text.splitlines() if line.startswith("north"))
    assert north.split() == ["north", "1.0200", "12.300", "2.5", "valid"]
    assert "12.300 (12.100 to 12.500)" in drawn(a_status(1), ("north",), (110, 24))


def test_the_view_tells_which_actuator_has_long_not_been_judged() -> None:
    from rthstrack.live.view import Judged

    judged = Judged(3, longest_s=6.0)
    # The words of a reason tell people; the program goes by the code.
    ambiguous = {"reason": "in words", "reason_code": "ambiguous", "reason_values": [0.0015, -0.0985]}
    assert judged.missing_s(a_status(3) | {"time_s": None}) == {}
    for now_s in range(20):
        status = a_status(3, time_s=float(now_s)) | {"time_s": float(now_s)}
        status["readings"][1] |= {"valid": True} if now_s < 3 else {"valid": False} | ambiguous
        # One that rests has nothing to be judged by.
        status["readings"][2] |= {"valid": False, "reason": "in words", "reason_code": "still"}
        missing = judged.missing_s(status)
        assert missing == ({1: now_s - 2.0} if now_s > 8 else {})
    lines = drawn(status, ("north", "south", "west"), (170, 50), unjudged_s=missing).splitlines()
    said = "not judged for 17 s: one tone, 1.5000 or -98.5000 ms: choose with --expected-delay S"
    assert said in next(line for line in lines if line.startswith("south"))
    assert "not judged" not in next(line for line in lines if line.startswith("west"))
    # Samples come, readings do not.
    judged = Judged(1, longest_s=6.0)
    for now_s in range(20):
        missing = judged.missing_s({"time_s": float(now_s), "readings": [None]})
    assert missing == {0: 19.0}


ESCAPES = "\x1b]0;owned\x07\x1b[2J\x9b31m\r\n"


def test_what_a_sender_or_a_layout_says_commands_no_terminal(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive]
) -> None:
    fake.events = (event("malformed_line", 0.1, f"the line '{ESCAPES}' is no sample", line=ESCAPES),)
    _, _, err = run(capsys, *UDP)
    assert err[-1] == "rthstrack: at 0.10 s: the line '\\x1b]0;owned\\x07\\x1b[2J\\x9b31m\\r\\n' is no sample"
    status = a_status(1, valid=False, reason=ESCAPES)
    status["health"] |= {"log": ESCAPES, "log_code": "stopped"}
    status["alarms"] = [an_alarm(0) | {"text": f"advisory: {ESCAPES}"}]
    text = drawn(status, (ESCAPES,), events=[ESCAPES])
    assert text.count("\\x1b]0;owned") >= 4
    assert all(c.isprintable() or c == "\n" for c in text)


def test_what_could_not_be_sent_or_written_is_in_the_view() -> None:
    status = a_status(1)
    assert "could not" not in drawn(status, ("north",))
    status["health"] |= {"unsent": 3, "not_written": 4}
    assert "3 datagrams could not be sent, 4 readings could not be written" in drawn(status, ("north",))


def test_the_view_tells_what_is_not_valid_not_there_and_over_with_the_names_of_the_layout() -> None:
    alarm = {
        "name": "delay",
        "actuator": 1,
        "active": False,
        "latched": True,
        "text": "advisory: south: lag of 9",
    }
    silent = {
        "name": "silence",
        "actuator": None,
        "active": True,
        "latched": False,
        "text": "advisory: no sample for 2 s",
    }
    idle = {"name": "lost", "actuator": None, "active": False, "latched": False, "text": "advisory: 0 samples missing"}
    nothing = dict.fromkeys(
        ("amplitude", "delay_s", "equivalent_frequency_hz", "amplitude_interval", "delay_interval_s")
    )
    reading = nothing | {"actuator": 1, "valid": False, "reason": "the target moves less than minimum_amplitude"}
    reading |= {"reason_code": "still", "reason_values": None}
    health = {"received": 7, "lost": 0, "malformed": 3, "pace_hz": None, "log": "stopped: disk full", "log_dropped": 0}
    health["log_code"] = "stopped"
    status = {
        "time_s": None, "state": "silent", "health": health, "readings": [None, reading],
        "alarms": [alarm, silent, idle], "events": [],
    }  # fmt: skip
    text = drawn(status, ("north", "south"))
    lines = text.splitlines()
    assert "no reading yet" in next(line for line in lines if line.startswith("north"))
    south = next(line for line in lines if line.startswith("south"))
    assert south.split()[1:4] == ["-", "-", "-"]
    assert "the target moves less than minimum_amplitude" in south
    assert "silent 7 received, 0 lost, 3 malformed" in text
    assert "log: stopped: disk full" in text
    assert "ALARM advisory: south: lag of 9 (over, held until it is reset)" in text
    assert "ALARM advisory: no sample for 2 s\n" in text
    assert "0 samples missing" not in text
    assert "at 1.00 s: something" in text


def test_nobody_reading_standard_error_is_no_reason_to_stop() -> None:
    with started(*UDP, "--duration", "1") as process:
        assert process.stderr is not None
        process.stderr.close()
        process.stderr = None
        out, _ = process.communicate(timeout=20)
    assert process.returncode == 0
    assert list(json.loads(out)["summary"]) == KEYS


def test_a_page_whose_port_is_taken_is_a_line_and_status_1(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive]
) -> None:
    pytest.importorskip("rthstrack.live.page")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        status, out, err = run(capsys, *UDP, "--page", taken.getsockname()[1])
    assert (status, out) == (1, "")
    assert len(err) == 1
    assert "--page: " in err[0]
    assert "in use" in err[0]


def test_a_name_for_the_page_is_handed_to_it(
    capsys: pytest.CaptureFixture[str], fake: type[FakeLive], monkeypatch: pytest.MonkeyPatch
) -> None:
    from rthstrack.live import page

    given: list[Any] = []
    made = page.Page
    monkeypatch.setattr(page, "Page", lambda *arguments: given.append(arguments[3]) or made(*arguments))
    assert run(capsys, *UDP, "--page", 0, "--page-name", "lab.example", "--page-name", "rig")[0] == 0
    assert given == [["lab.example", "rig"]]


def test_a_page_is_served_at_the_address_that_is_told(capsys: pytest.CaptureFixture[str], fake: type[FakeLive]) -> None:
    pytest.importorskip("rthstrack.live.page")
    fake.ends_after_s = 0.3
    status, _, err = run(capsys, *UDP, "--page", 0)
    assert status == 0
    assert re.search(r"live page: http://127\.0\.0\.1:\d+/", err[1])
    assert fake.made.outputs["page"] is True


# With the compiled part -----------------------------------------------------------------------------------------------

compiled = pytest.mark.skipif(not hasattr(_core, "Live"), reason="this build has no rthstrack._core.Live")
RATE_HZ, GAIN, DELAY_S = 512.0, 1.05, 0.012


def motion(t: np.ndarray) -> np.ndarray:
    return 10 * np.sin(2 * np.pi * 3 * t) + 4 * np.sin(2 * np.pi * 5.3 * t + 1)


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """Three seconds of a motion that is answered 5 % too large and 12 ms late."""
    t = np.arange(3 * int(RATE_HZ)) / RATE_HZ
    path = tmp_path / "test.npz"
    np.savez(path, target=motion(t), measured=GAIN * motion(t - DELAY_S), rate_hz=RATE_HZ)
    return path


class Monitored:
    """`rthstrack monitor` as a process, from when it listens on."""

    def __init__(self, *arguments: object) -> None:
        command = [sys.executable, "-m", "rthstrack", "monitor", "--listen", "udp://127.0.0.1:0", "--rate", "512",
                   "--window", "1", *map(str, arguments)]  # fmt: skip
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stderr is not None
        found = re.search(r"monitoring udp 127\.0\.0\.1:(\d+):", self.process.stderr.readline())
        assert found is not None
        self.port = int(found[1])

    def replay(self, path: Path) -> None:
        assert main(["replay", str(path), "--to", f"udp://127.0.0.1:{self.port}"]) == 0

    def end(self, number: int | None = signal.SIGTERM) -> tuple[int, dict[str, int], str]:
        """Exit status, summary and standard error; number: None waits until it ends of itself."""
        if number is not None:
            time.sleep(0.3)
            self.process.send_signal(number)
        out, err = self.process.communicate(timeout=20)
        (line,) = out.splitlines()
        summary: dict[str, int] = json.loads(line)["summary"]
        assert list(summary) == KEYS
        return self.process.returncode, summary, err


@compiled
def test_what_is_replayed_is_read_with_its_gain_and_delay_and_logged_to_the_last_sample(
    recorded: Path, tmp_path: Path
) -> None:
    lines, log = tmp_path / "readings.jsonl", tmp_path / "run.arrows"
    monitored = Monitored("--readings", lines, "--log", log, "--silence", "100")
    monitored.replay(recorded)
    status, summary, err = monitored.end()
    assert status == 0
    n = 3 * int(RATE_HZ)
    totals = {"received": n, "lost": 0, "repeated": 0, "reordered": 0, "malformed": 0, "alarms": 0}
    assert {key: summary[key] for key in totals} == totals
    assert "ALARM" not in err
    readings = [json.loads(line) for line in lines.read_text().splitlines()]
    assert len(readings) == summary["readings"]
    # From one second, and what the decimator needs to settle, to three, 16 a second.
    assert 30 <= len(readings) <= 33
    assert set(np.diff([reading["index"] for reading in readings])) == {32}
    assert all(reading["valid"] for reading in readings)
    for reading in readings:
        assert reading["amplitude"] == pytest.approx(GAIN, rel=1e-3)
        assert reading["delay_s"] == pytest.approx(DELAY_S, abs=1e-4)
    logged = pa.ipc.open_stream(log).read_all()
    with np.load(recorded) as sent:
        np.testing.assert_array_equal(logged["target_1"].to_numpy(), sent["target"])
        np.testing.assert_array_equal(logged["measured_1"].to_numpy(), sent["measured"])
    assert pa.ipc.open_stream(tmp_path / "run.readings.arrows").read_all().num_rows == len(readings)


@compiled
def test_a_delay_beyond_its_limit_ends_it_with_status_3(recorded: Path) -> None:
    monitored = Monitored("--limit-delay", "0.01", "--exit-on-alarm")
    monitored.replay(recorded)
    status, summary, err = monitored.end(None)
    assert status == 3
    assert summary["alarms"] == 1
    assert re.search(r"ALARM at [\d.]+ s: advisory: actuator 1: lag of up to 1[12]\.\d+ ms, limit 10\.000 ms", err)


@compiled
def test_garbage_is_counted_and_changes_nothing(recorded: Path) -> None:
    monitored = Monitored("--silence", "100")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for length in (0, 1, 23, 25, 1000):
            sock.sendto(os.urandom(length), ("127.0.0.1", monitored.port))
    monitored.replay(recorded)
    status, summary, _ = monitored.end()
    assert status == 0
    assert (summary["malformed"], summary["lost"], summary["received"]) == (5, 0, 3 * 512)


@compiled
def test_a_port_that_is_taken_is_one_line_and_status_1(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        status, out, err = run(capsys, "--listen", f"udp://127.0.0.1:{port}", "--rate", "512")
    assert (status, out, len(err)) == (1, "", 1)
    assert f"127.0.0.1:{port}" in err[0]
    assert "in use" in err[0]


@compiled
def test_a_pace_that_contradicts_the_rate_ends_it_within_five_seconds_with_status_1(recorded: Path) -> None:
    monitored = Monitored("--rate", "1024")
    begin = time.monotonic()
    # Another process, for this one waits.
    command = [sys.executable, "-m", "rthstrack", "replay", str(recorded), "--loop"]
    with subprocess.Popen([*command, "--to", f"udp://127.0.0.1:{monitored.port}"], stderr=subprocess.DEVNULL) as sender:
        status, _, err = monitored.end(None)
        sender.terminate()
    assert status == 1
    # With time for the sender to begin.
    assert time.monotonic() - begin < 10
    assert "--rate says 1024" in err.splitlines()[-1]


@compiled
@pytest.mark.parametrize("header", ["n,target,measured\n", ""])
def test_lines_on_standard_input_are_read_to_their_end(header: str, tmp_path: Path) -> None:
    t = np.arange(1024) / RATE_HZ
    columns = np.column_stack([np.arange(1024), motion(t), GAIN * motion(t - DELAY_S)])
    content = header + "".join(f"{n:.0f},{target:.17g},{measured:.17g}\n" for n, target, measured in columns)
    readings = tmp_path / "readings.jsonl"
    command = [sys.executable, "-m", "rthstrack", "monitor", "--listen", "-", "--rate", "512", "--window", "1"]
    done = subprocess.run(
        [*command, "--readings", str(readings)], input=content, capture_output=True, text=True, timeout=30, check=False
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["summary"]["received"] == 1024
    last = json.loads(readings.read_text().splitlines()[-1])
    assert last["delay_s"] == pytest.approx(DELAY_S, abs=1e-4)


@compiled
@pytest.mark.parametrize("form", ["csv", "json"])
def test_lines_with_named_columns_and_no_counter_need_no_layout_file(form: str, tmp_path: Path) -> None:
    t = np.arange(1024) / RATE_HZ
    rows = list(zip(t, motion(t), GAIN * motion(t - DELAY_S), strict=True))
    content = "time,x,y\n" + "".join(f"{a:.17g},{b:.17g},{c:.17g}\n" for a, b, c in rows)
    if form == "json":
        content = "".join(json.dumps({"time": a, "x": b, "y": c}) + "\n" for a, b, c in rows)
    readings = tmp_path / "readings.jsonl"
    command = [sys.executable, "-m", "rthstrack", "monitor", "--listen", "-", "--rate", "512", "--window", "1",
               "--target", "x", "--measured", "y", "--no-counter", "--readings", str(readings)]  # fmt: skip
    done = subprocess.run(command, input=content, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["summary"]["received"] == 1024
    assert json.loads(readings.read_text().splitlines()[-1])["delay_s"] == pytest.approx(DELAY_S, abs=1e-4)
