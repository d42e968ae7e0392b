"""The command `rthstrack replay`: what arrives is what the file holds, at its own pace."""

from __future__ import annotations

import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rthstrack.cli import main
from rthstrack.virtual_test.run import write_run
from test_simulate_command import a_run

RATE = 500.0
N = 300
T = np.arange(N) / RATE
TARGET, MEASURED = 10 * np.sin(9 * T), 9 * np.sin(9 * (T - 0.01))


class Listener:
    """A socket on loopback and everything that came to it, with the time."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.3)
        self.port = self.socket.getsockname()[1]
        self.came: list[tuple[float, bytes]] = []
        self._over = False
        self._thread = threading.Thread(target=self._receive)
        self._thread.start()

    def _receive(self) -> None:
        while True:
            try:
                datagram = self.socket.recv(65536)
            except TimeoutError:
                # Only now is nothing left that has come already.
                if self._over:
                    return
                continue
            self.came.append((time.monotonic(), datagram))

    def close(self) -> list[bytes]:
        """What came, in order; may be called again."""
        self._over = True
        self._thread.join()
        self.socket.close()
        return [datagram for _, datagram in self.came]


@pytest.fixture
def listener() -> Iterator[Listener]:
    made = Listener()
    yield made
    made.close()


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    path = tmp_path / "test.npz"
    np.savez(path, target=TARGET, measured=MEASURED, rate_hz=RATE)
    return path


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, list[str]]:
    try:
        status = main(["replay", *map(str, arguments)])
    except SystemExit as stop:
        status = int(stop.code or 0)
    out, err = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in err
    return status, err.splitlines()


def test_every_sample_arrives_to_the_bit_with_a_counter_from_0_at_the_files_own_pace(
    capsys: pytest.CaptureFixture[str], recorded: Path, listener: Listener
) -> None:
    status, err = run(capsys, recorded, "--to", f"udp://127.0.0.1:{listener.port}")
    assert status == 0
    datagrams = listener.close()
    samples = np.array([struct.unpack("<3d", datagram) for datagram in datagrams])
    np.testing.assert_array_equal(samples, np.column_stack([np.arange(N), TARGET, MEASURED]))
    times = np.array([when for when, _ in listener.came])
    # On the clock from the first to the last; how late one may be depends on the machine.
    assert times[-1] - times[0] > (N - 1) / RATE - 0.05
    assert times[-1] - times[0] < (N - 1) / RATE + 1.0
    assert err[0] == (
        f"rthstrack: sending 300 samples of target 'target', measured 'measured', at 500 Hz to "
        f"udp://127.0.0.1:{listener.port}; Ctrl-C ends"
    )
    assert re.fullmatch(r"rthstrack: sent 300 samples in 0\.\d{3} s, at worst [\d.]+ ms late", err[1])
    assert len(err) == 2


def test_it_may_be_faster_with_several_samples_in_a_datagram_and_the_last_one_short(
    capsys: pytest.CaptureFixture[str], recorded: Path, listener: Listener
) -> None:
    status, err = run(
        capsys, recorded, "--to", f"udp://127.0.0.1:{listener.port}", "--speed", 4, "--samples-per-datagram", 7
    )
    assert status == 0
    assert float(err[1].split()[5]) < N / RATE
    assert "at 2000 Hz" in err[0]
    datagrams = listener.close()
    assert [len(datagram) // 24 for datagram in datagrams] == [7] * 42 + [6]
    samples = np.frombuffer(b"".join(datagrams), "<f8").reshape(-1, 3)
    np.testing.assert_array_equal(samples, np.column_stack([np.arange(N), TARGET, MEASURED]))


def test_the_layout_says_how_it_is_sent(
    capsys: pytest.CaptureFixture[str], recorded: Path, listener: Listener, tmp_path: Path
) -> None:
    layout = tmp_path / "layout.toml"
    layout.write_text(
        """
        byte_order = "big"
        header_bytes = 3
        sample_bytes = 12
        counter = { offset = 2, type = "u16" }
        [[actuator]]
        measured = { offset = 4, type = "f32" }
        target = { offset = 8, type = "i16", scale = 0.001, zero = 100 }
        """
    )
    status, _ = run(capsys, recorded, "--to", f"udp://127.0.0.1:{listener.port}", "--layout", layout, "--speed", 5)
    assert status == 0
    datagrams = listener.close()
    assert {len(datagram) for datagram in datagrams} == {15}
    samples = np.array([struct.unpack(">3x2xHfh2x", datagram) for datagram in datagrams])
    np.testing.assert_array_equal(samples[:, 0], np.arange(N))
    np.testing.assert_array_equal(samples[:, 1], MEASURED.astype(np.float32))
    # Half a step is what rounding may cost.
    assert np.abs((samples[:, 2] - 100) * 0.001 - TARGET).max() <= 0.0005 * (1 + 1e-9)


def test_a_part_of_several_actuators_can_be_chosen(
    capsys: pytest.CaptureFixture[str], listener: Listener, tmp_path: Path
) -> None:
    path = tmp_path / "two.npz"
    np.savez(path, target_1=TARGET, measured_1=MEASURED, target_2=2 * TARGET, measured_2=2 * MEASURED, rate_hz=RATE)
    to = ("--to", f"udp://127.0.0.1:{listener.port}", "--speed", 10)
    assert run(capsys, path, *to, "--start", 0.1, "--end", 0.2)[0] == 0
    assert run(capsys, path, *to, "--target", "target_2", "--measured", "measured_2", "--end", 0.1)[0] == 0
    datagrams = listener.close()
    first = np.array([struct.unpack("<5d", datagram) for datagram in datagrams[:50]])
    np.testing.assert_array_equal(first[:, 3], 2 * TARGET[50:100])
    np.testing.assert_array_equal(first[:, 0], np.arange(50))
    then = np.array([struct.unpack("<3d", datagram) for datagram in datagrams[50:]])
    np.testing.assert_array_equal(then[:, 2], 2 * MEASURED[:50])


def test_a_run_of_simulate_is_replayed_without_flags(
    capsys: pytest.CaptureFixture[str], listener: Listener, tmp_path: Path
) -> None:
    path = tmp_path / "run.h5"
    made = a_run()
    write_run(made, path)
    status, _ = run(capsys, path, "--to", f"udp://127.0.0.1:{listener.port}", "--speed", 10)
    assert status == 0
    samples = np.frombuffer(b"".join(listener.close()), "<f8").reshape(-1, 3)
    np.testing.assert_array_equal(samples[:, 1], made.target)
    np.testing.assert_array_equal(samples[:, 2], made.measured)


def test_two_files_are_sent_on_the_clock_they_have_in_common(
    capsys: pytest.CaptureFixture[str], recorded: Path, listener: Listener
) -> None:
    t = np.arange(N) / RATE
    other = recorded.with_name("daq.csv")
    np.savetxt(other, np.column_stack([t + 0.1, MEASURED]), delimiter=",", header="time,xm", comments="")
    first = recorded.with_name("control.csv")
    np.savetxt(first, np.column_stack([t, TARGET]), delimiter=",", header="time,xt", comments="")
    to = ("--to", f"udp://127.0.0.1:{listener.port}")
    status, err = run(capsys, *to, "--target", f"{first}:xt", "--measured", f"{other}:xm", "--speed", "10")
    assert status == 0, err
    samples = np.array([struct.unpack("<3d", datagram) for datagram in listener.close()])
    later = round(0.1 * RATE)
    np.testing.assert_array_equal(samples[:, 1], TARGET[later:])
    np.testing.assert_array_equal(samples[:, 2], MEASURED[: N - later])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_loop_cleanly_and_its_counter_goes_on(
    recorded: Path, listener: Listener, number: signal.Signals
) -> None:
    command = [sys.executable, "-m", "rthstrack", "replay", str(recorded), "--loop", "--speed", "4"]
    with subprocess.Popen(
        [*command, "--to", f"udp://127.0.0.1:{listener.port}"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        end = time.monotonic() + 20
        while len(listener.came) < 2 * N + 10 and time.monotonic() < end:
            time.sleep(0.02)
        process.send_signal(number)
        out, err = process.communicate(timeout=20)
    assert (process.returncode, out) == (0, "")
    datagrams = listener.close()
    assert re.search(rf"sent {len(datagrams)} samples in ", err.splitlines()[-1])
    samples = np.array([struct.unpack("<3d", datagram) for datagram in datagrams])
    np.testing.assert_array_equal(samples[:, 0], np.arange(len(samples)))
    np.testing.assert_array_equal(samples[: 2 * N, 1], np.tile(TARGET, 2))


def test_eight_actuators_at_4096_hz_keep_pace(
    capsys: pytest.CaptureFixture[str], listener: Listener, tmp_path: Path
) -> None:
    path = tmp_path / "eight.npz"
    n = 2 * 4096
    columns = {f"{role}_{i}": np.full(n, float(i)) for i in range(1, 9) for role in ("target", "measured")}
    np.savez(path, rate_hz=4096.0, **columns)
    status, err = run(capsys, path, "--to", f"udp://127.0.0.1:{listener.port}")
    assert status == 0
    assert "in bursts of a millisecond" in err[0]
    assert "and 5 more pairs" in err[0]
    datagrams = listener.close()
    assert len(datagrams) == n
    times = np.array([when for when, _ in listener.came])
    # Never ahead of its pace; how late it is, is the machine's doing.
    assert times[-1] - times[0] > n / 4096 - 0.1


def test_nobody_listening_is_told_and_no_error(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    status, err = run(capsys, recorded, "--to", f"udp://127.0.0.1:{port}", "--speed", 20)
    assert status == 0
    assert re.search(r"; \d+ datagrams found nobody listening$", err[-1])


def test_a_folder_is_refused(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    status, err = run(capsys, recorded.parent, "--to", "udp://127.0.0.1:5005")
    assert status == 1
    assert err == [f"rthstrack: {recorded.parent}: a folder; one test is sent at a time; name one of its files"]
    status, err = run(capsys, "--to", "udp://127.0.0.1:5005")
    assert status == 2
    assert "required: FILE" in err[0]


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["--to", "127.0.0.1:5005"], 2, "expected udp://HOST:PORT"),
        (["--to", "udp://127.0.0.1:5005", "--speed", "0"], 2, "expected a positive number"),
        (["--to", "udp://127.0.0.1:5005", "--target", "target"], 2, "go in pairs"),
        (["--to", "udp://127.0.0.1:5005", "--target", "x", "--measured", "measured"], 1, "no channel 'x'"),
        (["--to", "udp://127.0.0.1:5005", "--samples-per-datagram", "3000"], 2, "expected at most 2729"),
        (["--to", "udp://127.0.0.1:5005", "--layout", "no.toml"], 2, "no.toml: cannot be read"),
        (["--to", "udp://127.0.0.1:5005", "--layout", "two.toml"], 2, "for each target and measured, 1, found 2"),
        (["--to", "udp://127.0.0.1:5005", "--layout", "i16.toml"], 2, "target of actuator 1 cannot be sent as i16"),
    ],
)
def test_a_mistake_is_told_before_anything_is_sent(
    capsys: pytest.CaptureFixture[str],
    recorded: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    status: int,
    message: str,
) -> None:
    monkeypatch.chdir(recorded.parent)
    two = 'fields = ["counter", "target_1", "measured_1", "target_2", "measured_2"]\n'
    Path("two.toml").write_text(two)
    Path("i16.toml").write_text('fields = ["target", "measured"]\ntype = "i16"\nscale = 0.0001\n')
    found, err = run(capsys, recorded, *arguments)
    assert found == status
    assert any(message in line for line in err)
    assert not any("sending" in line for line in err)
