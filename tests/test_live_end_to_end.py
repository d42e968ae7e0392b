"""The monitor from a virtual test to its readings, at true speed, beside the evaluation of the same samples afterwards.

What the tests measure they print: `pytest -s tests/test_live_end_to_end.py`.
"""

from __future__ import annotations

import re
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rthstrack
from live_monitor import COMMAND, Monitored, lines, monitored, readings_in
from rthstrack import _core, propose_pair, read_recording
from rthstrack.cli import main

pytestmark = [
    pytest.mark.skipif(not hasattr(_core, "Live"), reason="this build has no rthstrack._core.Live"),
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="times of arrival are those of Linux"),
]

RATE_HZ = 1024.0
P = 8
BAND_HZ = (0.0, 32.0)


def simulated(configuration: Path, to: Path) -> Path:
    """The virtual test's run file; with a made-up ground motion where the recorded one is not to be had."""
    if main(["simulate", str(configuration), "-o", str(to)]) == 0:
        return to
    text, n = re.subn(r'record = ".*"', "synthetic = { seed = 3, duration_s = 40.0, peak_m_s2 = 3.0 }",
                      configuration.read_text())  # fmt: skip
    assert n == 1
    changed = to.with_suffix(".toml")
    changed.write_text(text)
    assert main(["simulate", str(changed), "-o", str(to)]) == 0
    return to


def samples_of(run: Path, start_s: float, end_s: float) -> tuple[np.ndarray, np.ndarray]:
    """What `rthstrack replay` sends of it."""
    recording = read_recording(run)
    assert recording.rate_hz == RATE_HZ
    ((target, measured),), _ = propose_pair(recording)
    cut = recording.cut(start_s, end_s)
    return cut.channel(target).values, cut.channel(measured).values


Senders = list[subprocess.Popen[str]]


@contextmanager
def replayed(run: Path, monitors: list[Monitored], start_s: float, end_s: float) -> Iterator[Senders]:
    """The test sent to each at its own pace."""
    senders: Senders = []
    try:
        for monitor in monitors:
            command = [*COMMAND, "replay", str(run), "--to", f"udp://127.0.0.1:{monitor.port}", "--start",
                       f"{start_s:g}", "--end", f"{end_s:g}"]  # fmt: skip
            senders.append(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))
        yield senders
    finally:
        for sender in senders:
            sender.kill()
            sender.communicate()


def ended(senders: Senders, patience_s: float) -> list[str]:
    """What each said last, all having sent everything."""
    said = [sender.communicate(timeout=patience_s)[1].splitlines()[-1] for sender in senders]
    assert [sender.returncode for sender in senders] == [0] * len(senders)
    return said


# ------------------------------------------------------------------------------------------------- the paper's test


@pytest.mark.parametrize("example", ["paper_linear"])
def test_the_papers_virtual_test_at_true_speed_reads_as_the_batch_evaluation_of_the_same_windows(
    example: str, root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = simulated(root / "examples" / f"{example}.toml", tmp_path / "run.h5")
    seconds, window_s = 22.0, 2.0
    target, measured = samples_of(run, 0, seconds)
    estimators = ("fei", "least_squares")
    begin = time.monotonic()
    with ExitStack() as stack:
        files = [tmp_path / f"{estimator}.jsonl" for estimator in estimators]
        wires = [stack.enter_context(lines()) for _ in estimators]
        monitors = [
            stack.enter_context(
                monitored("--estimator", estimator, "--readings", file, "--readings", wire.address, "--log",
                          tmp_path / f"{estimator}.arrows", "--silence", "100", rate_hz=RATE_HZ, window_s=window_s)
            )
            for estimator, file, wire in zip(estimators, files, wires, strict=True)
        ]  # fmt: skip
        with replayed(run, monitors, 0, seconds) as senders:
            said = ended(senders, seconds + 30)
        assert time.monotonic() - begin >= seconds - 0.1
        for monitor in monitors:
            status, summary = monitor.end()
            assert status == 0
            assert summary["received"] == len(target)
            assert [summary[name] for name in ("lost", "repeated", "reordered", "malformed")] == [0, 0, 0, 0]
        # The wire and the file carry the same lines.
        for file, wire in zip(files, wires, strict=True):
            assert file.read_text().splitlines() == wire.texts
    capsys.readouterr()
    for estimator, file in zip(estimators, files, strict=True):
        found = readings_in(file)
        beside_the_stream(found, target, measured, window_s, estimator)
        n_valid, apart = beside_the_batch(found, target, measured, window_s, estimator)
        assert n_valid > 20
        told = " and ".join(f"{name} {value:.1e}" for name, value in apart.items())
        with capsys.disabled():
            print(f"\n{example}, {estimator}: {len(found)} readings; of {n_valid} windows evaluated one by one {told} "
                  f"apart at most (relative); {said[0].removeprefix('rthstrack: ')}")  # fmt: skip
        # As any recording.
        assert main(["evaluate", str(tmp_path / f"{estimator}.arrows")]) == 0
        capsys.readouterr()


def beside_the_stream(
    found: list[dict[str, Any]], target: np.ndarray, measured: np.ndarray, window_s: float, estimator: str
) -> None:
    """The program's readings are those of `Monitor` for the same samples, to the last bit that JSON carries."""
    monitor = rthstrack.Monitor(
        RATE_HZ, window_s, 16.0, band_hz=BAND_HZ, data_decimation=P, estimator=estimator, detrend="mean"
    )
    expected = monitor.process(target, measured)
    assert len(found) == len(expected)
    assert [r["index"] for r in found] == expected.index.tolist()
    assert [r["time_s"] for r in found] == expected.time_s.tolist()
    assert [r["centre_s"] for r in found] == expected.centre_s.tolist()
    assert [r["valid"] for r in found] == expected.valid.tolist()
    for name in ("amplitude", "delay_s", "phase_rad", "equivalent_frequency_hz"):
        values = np.array([np.nan if r[name] is None else r[name] for r in found])
        np.testing.assert_allclose(values, getattr(expected, name), rtol=1e-9, atol=0, equal_nan=True)


def beside_the_batch(
    found: list[dict[str, Any]], target: np.ndarray, measured: np.ndarray, window_s: float, estimator: str
) -> tuple[int, dict[str, float]]:
    """The same windows, each evaluated by itself; how many, and how far apart at most."""
    (x, delay), (y, _) = (rthstrack.causal_decimate(signal, P) for signal in (target, measured))
    W, hop = int(window_s * RATE_HZ / P), int(RATE_HZ / P / 16)
    # A band from 0 to what the decimator keeps is the decimator's: least squares judges everything that it passed.
    band_hz = BAND_HZ if estimator == "fei" else None
    settings: dict[str, Any] = {"estimator": estimator, "band_hz": band_hz, "detrend": "mean"}
    apart, n = {"amplitude": 0.0, "delay_s": 0.0}, 0
    # A record for each window of least squares, which takes a while: every seventh.
    for k in range(0, len(found), 1 if estimator == "fei" else 7):
        start = k * hop
        assert found[k]["index"] == (start + W - 1) * P + 2 * delay
        assert found[k]["centre_s"] == pytest.approx(((start + (W - 1) / 2) * P + delay) / RATE_HZ, rel=1e-12)
        if not found[k]["valid"] or start == 0:
            continue
        part = slice(start, start + W)
        if estimator == "fei":
            one = rthstrack.evaluate(x[part], y[part], RATE_HZ / P, **settings)
            expected = {"amplitude": one.amplitude, "delay_s": one.delay_s}
        else:
            # With a second before it, into which a shifted target reaches. A long record would also tell where to look
            # for the delay, and where one tone rings on that shows in the tenth digit of the second.
            before = max(0, start - int(RATE_HZ / P))
            part, hop_s = slice(before, start + W), (start - before) * P / RATE_HZ
            moving = rthstrack.evaluate_moving(
                x[part], y[part], RATE_HZ / P, window_s=window_s, hop_s=hop_s, **settings
            )
            expected = {"amplitude": moving.amplitude[-1], "delay_s": moving.delay_s[-1]}
        n += 1
        # A window of a longer record is told which of two peaks is near, so its search starts elsewhere: the last step,
        # up to 2e-3 of a sample, leaves less than its square.
        left = {"amplitude": 1e-9, "delay_s": 1e-6 * P / RATE_HZ}
        for name, value in expected.items():
            assert found[k][name] == pytest.approx(value, rel=1e-9, abs=left[name])
            apart[name] = max(apart[name], abs(found[k][name] / value - 1))
    return n, apart


# -------------------------------------------------------------------------------------------------- the change of delay


def test_an_injected_change_of_delay_brings_the_alarm_and_the_time_it_took_is_stated(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = simulated(root / "examples" / "delay_change.toml", tmp_path / "run.h5")
    # From 6 to 20 ms between 25.0 and 25.5 s.
    start_s, end_s, change_s = 18.0, 32.0, 25.0
    windows_s = (1.0, 2.0, 4.0)
    limits = ("--limit-delay", "0.010", "--critical-delay", "0.0156")
    settings = ("--minimum-amplitude", "0.001", *limits, "--silence", "100")
    with ExitStack() as stack:
        alarms = [stack.enter_context(lines()) for _ in windows_s]
        monitors = [
            stack.enter_context(
                monitored(*settings, "--alarm-to", wire.address, "--readings", tmp_path / f"{window_s:g}.jsonl",
                          rate_hz=RATE_HZ, window_s=window_s)
            )
            for window_s, wire in zip(windows_s, alarms, strict=True)
        ]  # fmt: skip
        with replayed(run, monitors, start_s, end_s) as senders:
            ended(senders, end_s - start_s + 30)
        for monitor in monitors:
            status, summary = monitor.end()
            assert (status, summary["lost"]) == (0, 0)
    capsys.readouterr()
    target, measured = samples_of(run, start_s, end_s)
    for window_s, wire in zip(windows_s, alarms, strict=True):
        raised = {one["alarm"]["name"]: one["alarm"] for one in reversed(wire.all()) if one["alarm"]["raised"]}
        assert sorted(raised) == ["critical_delay", "delay"]
        took = {name: start_s + alarm["time_s"] - change_s for name, alarm in raised.items()}
        # Not before it began, and before twice what stands in the window is new.
        assert all(0 < seconds < 1.0 + window_s for seconds in took.values())
        assert took["critical_delay"] <= took["delay"]
        # The alarm is that of the first reading beyond the limit.
        found = [r for r in readings_in(tmp_path / f"{window_s:g}.jsonl") if r["valid"]]
        beyond = next(r["time_s"] for r in found if abs(r["delay_s"]) > 0.010)
        assert raised["delay"]["time_s"] == pytest.approx(beyond, rel=1e-12)
        assert found[-1]["delay_s"] == pytest.approx(0.020, abs=0.0015)
        before = [1e3 * r["delay_s"] for r in found if r["time_s"] < change_s - start_s]
        fei = [crossed(target, measured, window_s, "fei", limit_s) + start_s - change_s for limit_s in (0.0078, 0.010)]
        with capsys.disabled():
            print(f"\nwindow {window_s:g} s: from the change to the alarm at half the critical delay, 7.8 ms, "
                  f"{took['critical_delay']:.2f} s, at 10 ms {took['delay']:.2f} s; fei {fei[0]:.2f}, {fei[1]:.2f} s; "
                  f"readings before {min(before):.2f} to {max(before):.2f} ms")  # fmt: skip


def crossed(target: np.ndarray, measured: np.ndarray, window_s: float, estimator: str, limit_s: float) -> float:
    """When a reading first is beyond a limit, in seconds of the stream."""
    monitor = rthstrack.Monitor(RATE_HZ, window_s, 16.0, band_hz=BAND_HZ, data_decimation=P, estimator=estimator,
                                minimum_amplitude=0.001)  # fmt: skip
    readings = monitor.process(target, measured)
    return float(readings.time_s[np.argmax(np.abs(readings.delay_s) > limit_s)])


# ------------------------------------------------------------------------------------------------------------ the time

# Of Linux: with each datagram the time at which the system had it for the listener.
SO_TIMESTAMPNS = 35


def test_a_reading_is_on_the_wire_soon_after_the_last_sample_of_its_window(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    n = int(10 * RATE_HZ)
    for estimator in ("fei", "least_squares"):
        file = tmp_path / f"{estimator}.jsonl"
        with ExitStack() as stack:
            wire = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            wire.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
            wire.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 21)
            wire.bind(("127.0.0.1", 0))
            outputs = ("--readings", f"udp://127.0.0.1:{wire.getsockname()[1]}", "--readings", file, "--log",
                       tmp_path / f"{estimator}.arrows", "--page", "0")  # fmt: skip
            settings = ("--update", "64", "--estimator", estimator, "--silence", "100")
            monitor = stack.enter_context(monitored(*outputs, *settings, rate_hz=RATE_HZ, window_s=2.0))
            sent_ns = paced(monitor.port, n)
            status, summary = monitor.end()
            assert (status, summary["received"], summary["lost"]) == (0, n, 0)
            came = [arrival(wire) for _ in range(summary["readings"])]
        assert [text for text, _ in came] == file.read_text().splitlines()
        assert len(came) > 64 * 7
        pairs = zip(readings_in(file), came, strict=True)
        took_us = np.array([(at_ns - sent_ns[reading["index"]]) / 1e3 for reading, (_, at_ns) in pairs])
        p50, p99 = np.percentile(took_us, (50, 99))
        with capsys.disabled():
            print(f"\n{estimator}: {len(took_us)} readings, from sending a window's last sample to the reading's "
                  f"arrival p50 {p50:.0f} us, p99 {p99:.0f} us, largest {took_us.max():.0f} us")  # fmt: skip
        # On a machine that does other things too.
        assert took_us.min() > 0
        assert p50 < 20_000


def paced(port: int, n: int) -> list[int]:
    """Sends so many samples at their times; when each was sent."""
    sent_ns = []
    t = np.arange(n) / RATE_HZ
    target = np.sin(9 * t) + 0.3 * np.sin(23 * t)
    measured = np.interp(t - 0.012, t, target)
    datagrams = [struct.pack("<3d", *row) for row in zip(range(n), target, measured, strict=True)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(("127.0.0.1", port))
        begin = time.monotonic()
        for i, datagram in enumerate(datagrams):
            if (wait_s := begin + i / RATE_HZ - time.monotonic()) > 0:
                time.sleep(wait_s)
            sent_ns.append(time.time_ns())
            sock.send(datagram)
    return sent_ns


def arrival(wire: socket.socket) -> tuple[str, int]:
    """A line, and when it came."""
    wire.settimeout(5)
    content, ((_, _, stamp),), _, _ = wire.recvmsg(65536, 64)
    seconds, nanoseconds = struct.unpack("@qq", stamp)
    return content.decode(), seconds * 1_000_000_000 + nanoseconds
