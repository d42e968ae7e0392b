"""The real `rthstrack monitor` as a process, and somebody who sends it samples: what the tests of the monitor share."""

from __future__ import annotations

import json
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

RATE_HZ, GAIN, DELAY_S = 512, 1.05, 0.012
COMMAND = (sys.executable, "-m", "rthstrack")
PATIENCE_S = 60.0


def motion(t: Any) -> Any:
    return 10 * np.sin(2 * np.pi * 3 * t) + 4 * np.sin(2 * np.pi * 5.3 * t + 1)


def sample(counter: int, index: int | None = None, delay_s: float = DELAY_S) -> bytes:
    """A datagram of the default layout; index: place in the motion, if it is another than the counter."""
    t = (counter if index is None else index) / RATE_HZ
    return struct.pack("<3d", counter, motion(t), GAIN * motion(t - delay_s))


def until(condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> Any:
    """Waits until it is so; returns what the condition returned."""
    end = time.monotonic() + patience_s
    while not (found := condition()):
        assert time.monotonic() < end, f"never came: {what}"
        time.sleep(0.02)
    return found


class Monitored:
    """`rthstrack monitor` from when it listens on, with every line it says."""

    def __init__(self, *arguments: object, rate_hz: float = RATE_HZ, window_s: float = 1.0, **more: Any) -> None:
        prefix: tuple[str, ...] = more.pop("prefix", ())
        command = [*prefix, *COMMAND, "monitor", "--listen", "udp://127.0.0.1:0", "--rate", f"{rate_hz:g}", "--window",
                   f"{window_s:g}", *map(str, arguments)]  # fmt: skip
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more)
        self.said: list[str] = []
        self._reading = threading.Thread(target=self._read, daemon=True)
        self._reading.start()
        self.port = int(self.told(r"monitoring udp 127\.0\.0\.1:(\d+):"))

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.said.append(line.rstrip("\n"))

    def told(self, pattern: str, patience_s: float = PATIENCE_S) -> str:
        """What a line on standard error says, as soon as there is one."""

        def found() -> re.Match[str] | None:
            matches = (re.search(pattern, line) for line in list(self.said))
            return next((match for match in matches if match), None)

        match: re.Match[str] = until(found, f"{pattern}; said {self.said}", patience_s)
        return match[1] if match.re.groups else match[0]

    @property
    def page(self) -> str:
        return self.told(r"live page: (http://127\.0\.0\.1:\d+/)")

    @property
    def page_port(self) -> int:
        return int(self.page.rpartition(":")[2].strip("/"))

    @property
    def control_port(self) -> int:
        return int(self.told(r"udp://127\.0\.0\.1:(\d+) resets"))

    def end(self, number: int | None = signal.SIGTERM) -> tuple[int, dict[str, int]]:
        """Exit status and summary; number: None waits until it ends of itself."""
        if number is not None:
            # What is on its way arrives.
            time.sleep(0.3)
            self.process.send_signal(number)
        assert self.process.stdout is not None
        (line,) = self.process.stdout.read().splitlines()
        self.process.wait(timeout=PATIENCE_S)
        self._reading.join(timeout=PATIENCE_S)
        assert not any("Traceback" in words for words in self.said)
        summary: dict[str, int] = json.loads(line)["summary"]
        return self.process.returncode, summary

    def kill(self) -> None:
        """As `kill -9`; nothing where it has ended."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for stream in (self.process.stdout, self.process.stderr):
            if stream is not None:
                stream.close()


@contextmanager
def monitored(*arguments: object, **more: Any) -> Iterator[Monitored]:
    """The process, which is gone at the end whatever happened."""
    running = None
    try:
        running = Monitored(*arguments, **more)
        yield running
    finally:
        if running is not None:
            running.kill()


class Sender:
    """Sends the motion to a port at its own pace, in bursts of a few milliseconds, between `start` and `stop`."""

    def __init__(self, port: int, first: int = 0) -> None:
        self.port = port
        #: Counter of the next sample, and how many have been sent.
        self.counter, self.sent = first, 0
        self.delay_s = DELAY_S
        self._index = first
        self._over = threading.Event()
        self._thread: threading.Thread | None = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def start(self) -> Sender:
        self._over.clear()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        return self

    def stop(self) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def skip(self, n: int) -> None:
        """As if so many had been sent and lost."""
        self.counter += n
        self._index += n

    def _run(self) -> None:
        begin, first = time.monotonic(), self.sent
        while not self._over.wait(0.004):
            due = int((time.monotonic() - begin) * RATE_HZ)
            while self.sent - first < due:
                self.put(sample(self.counter, self._index, self.delay_s))
                self.skip(1)
                self.sent += 1

    def put(self, datagram: bytes) -> None:
        self._socket.sendto(datagram, ("127.0.0.1", self.port))

    def close(self) -> None:
        self.stop()
        self._socket.close()


@contextmanager
def sending(port: int, first: int = 0) -> Iterator[Sender]:
    """A sender that has been started."""
    sender = Sender(port, first)
    try:
        yield sender.start()
    finally:
        sender.close()


class Lines:
    """A socket on loopback and every line of JSON that came to it, with the time."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 21)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.2)
        self.address = f"udp://127.0.0.1:{self._socket.getsockname()[1]}"
        self.texts: list[str] = []
        self.came_s: list[float] = []
        self._over = False
        self._thread = threading.Thread(target=self._receive, daemon=True)
        self._thread.start()

    def _receive(self) -> None:
        while not self._over:
            try:
                datagram = self._socket.recv(65536)
            except TimeoutError:
                continue
            self.came_s.append(time.monotonic())
            self.texts.append(datagram.decode())

    def all(self) -> list[dict[str, Any]]:
        return [json.loads(text) for text in list(self.texts)]

    def more_than(self, n: int, patience_s: float = PATIENCE_S) -> None:
        """Waits until so many more have come."""
        before = len(self.texts)
        until(lambda: len(self.texts) > before + n, f"{n} more lines", patience_s)

    def close(self) -> None:
        self._over = True
        self._thread.join()
        self._socket.close()


@contextmanager
def lines() -> Iterator[Lines]:
    """A place for readings or alarms to be sent to."""
    made = Lines()
    try:
        yield made
    finally:
        made.close()


def frames(page: str, n: int, timeout_s: float = 10.0) -> list[dict[str, Any]]:
    """The next `n` frames of the page's stream."""
    import urllib.request

    found: list[dict[str, Any]] = []
    with urllib.request.urlopen(f"{page}events", timeout=timeout_s) as stream:
        name = ""
        while len(found) < n:
            line = stream.readline().decode().strip()
            if line.startswith("event: "):
                name = line[7:]
            elif line.startswith("data: ") and name == "frame":
                found.append(json.loads(line[6:]))
    return found


def readings_in(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def all_right(readings: list[dict[str, Any]], delay_s: float = DELAY_S) -> bool:
    """Whether there are readings, all of them valid and those of the motion."""
    return bool(readings) and all(
        r["valid"] and abs(r["amplitude"] - GAIN) < 2e-3 and abs(r["delay_s"] - delay_s) < 2e-4 for r in readings
    )
