"""The on-line monitor under load: eight actuators at 4096 Hz over loopback, garbage beside them in the second half.

    python benchmarks/online_load.py [SECONDS]        (600; make load)

`rthstrack monitor` runs as a user runs it, with log, page and a file of readings; a browser's stream is read all the
time. Senders (benchmarks/online_load.c, built with gcc) and reader are processes and threads of their own. Processor
time and memory are those of the monitor's process, from /proc: Linux only. Everything ends by itself.

Exit status: 1 if a sample was lost or memory grew by more than 5 % from a tenth of the time to the end (in a shorter
run from its first minute or half, for the page's charts fill meanwhile).
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from dataclasses import dataclass, field
from pathlib import Path

RATE_HZ = 4096
N_ACTUATORS = 8
GARBAGE_HZ = 10_000
MOST_GROWTH = 0.05
# What the page shows has been filled by then.
FILLED_S = 60.0
SOURCE = Path(__file__).with_suffix(".c")
OPTIONS = ("--window", "4", "--update", "16")


def main() -> int:
    """Runs it and prints the table; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("seconds", type=float, nargs="?", default=600.0, help="of samples, 10 to 7200 (%(default)g)")
    parser.add_argument("-P", help="data decimation (the monitor's choice)")
    args = parser.parse_args()
    if not 10 <= args.seconds <= 7200:
        parser.error(f"SECONDS: expected 10 to 7200, found {args.seconds:g}")
    with tempfile.TemporaryDirectory(prefix="rthstrack-load-") as folder:
        return measured(Path(folder), args.seconds, ["-P", args.P] if args.P else [])


def measured(folder: Path, seconds: float, options: list[str]) -> int:
    program = folder / "online_load"
    subprocess.run(["gcc", "-O2", "-o", str(program), str(SOURCE), "-lm"], check=True)
    command = [sys.executable, "-m", "rthstrack", "monitor", "--listen", "udp://127.0.0.1:0", "--rate", str(RATE_HZ),
               "--actuators", str(N_ACTUATORS), *OPTIONS, *options, "--silence", "10", "--page", "0",
               "--log", str(folder / "run.arrows"), "--readings", str(folder / "readings.jsonl"),
               "--duration", str(seconds + 60)]  # fmt: skip
    children: list[subprocess.Popen[str]] = []
    try:
        monitor = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        children.append(monitor)
        said = Said(monitor)
        port = int(said.find(r"monitoring udp 127\.0\.0\.1:(\d+)"))
        threading.Thread(target=watch, args=(said.find(r"live page: (\S+)"),), daemon=True).start()

        def send(kind: str, for_s: float, rate_hz: float) -> subprocess.Popen[str]:
            arguments = [str(program), kind, str(port), f"{for_s:g}", f"{rate_hz:g}", str(N_ACTUATORS)]
            children.append(subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True))
            return children[-1]

        course = Course(monitor.pid)
        time.sleep(1)
        begin = time.monotonic()
        samples, garbage = send("samples", seconds, RATE_HZ), None
        course.note(0.0)
        while (now := time.monotonic() - begin) < seconds:
            if garbage is None and now >= seconds / 2:
                garbage = send("garbage", seconds / 2, GARBAGE_HZ)
                course.note(now)
                course.half = len(course.at_s) - 1
            time.sleep(max(0.0, min(1.0, seconds / 2 - now if now < seconds / 2 else seconds - now) + 1e-3))
            course.note(time.monotonic() - begin)
        assert garbage is not None
        sent = [tuple(map(int, child.communicate(timeout=60)[0].split())) for child in (samples, garbage)]
        time.sleep(1)
        dropped = kernel_drops(port)
        monitor.terminate()
        assert monitor.stdout is not None
        summary = json.loads(monitor.stdout.readlines()[-1])["summary"]
        monitor.wait(timeout=60)
    finally:
        for child in children:
            if child.poll() is None:
                child.kill()
                child.wait()
    log_bytes = (folder / "run.arrows").stat().st_size
    return told(seconds, options, summary, sent, dropped, course, log_bytes, said.rest())


class Said:
    """Standard error of the monitor, read by a thread so that nothing waits for it."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._lines: list[str] = []
        self._process = process
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self._lines.append(line.strip())

    def find(self, pattern: str) -> str:
        end = time.monotonic() + 30
        while time.monotonic() < end:
            for line in list(self._lines):
                if found := re.search(pattern, line):
                    return found[1]
            time.sleep(0.02)
        raise SystemExit("the monitor did not start: " + " / ".join(self._lines))

    def rest(self) -> list[str]:
        """Everything behind the lines that say where it listens."""
        self._thread.join(timeout=5)
        return [line for line in self._lines if not re.search(r"monitoring udp|live page|: log: ", line)]


@dataclass
class Course:
    """Processor time and memory of a process over time."""

    pid: int
    at_s: list[float] = field(default_factory=list)
    processor_s: list[float] = field(default_factory=list)
    resident_kib: list[int] = field(default_factory=list)
    half: int = 0

    def note(self, now_s: float) -> None:
        # What stands behind the name, which may hold anything.
        stat = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        status = Path(f"/proc/{self.pid}/status").read_text()
        self.at_s.append(now_s)
        self.processor_s.append((int(stat[11]) + int(stat[12])) / os.sysconf("SC_CLK_TCK"))
        self.resident_kib.append(int(re.search(r"VmRSS:\s+(\d+)", status)[1]))

    def share(self, first: int, last: int) -> float:
        """Of a core, between two notes."""
        return (self.processor_s[last] - self.processor_s[first]) / (self.at_s[last] - self.at_s[first])

    def resident_at(self, share: float) -> int:
        due = share * self.at_s[-1]
        return next(kib for at_s, kib in zip(self.at_s, self.resident_kib, strict=True) if at_s >= due)


def watch(url: str) -> None:
    """What a browser reads, thrown away."""
    try:
        with urllib.request.urlopen(f"{url}events", timeout=30) as stream:
            while stream.read1(1 << 16):
                pass
    except OSError:
        pass


def kernel_drops(port: int) -> int:
    """Datagrams that the socket's buffer had no room for; -1 where that is not told."""
    for line in Path("/proc/net/udp").read_text().splitlines()[1:]:
        fields = line.split()
        if fields[1].endswith(f":{port:04X}"):
            return int(fields[-1])
    return -1


def told(seconds, options, summary, sent, dropped, course, log_bytes, rest) -> int:
    (n_sent, refused, worst_us), (n_garbage, garbage_refused, garbage_us) = sent
    early, middle, late = (course.resident_at(share) for share in (0.1, 0.5, 1.0))
    since = max(0.1, min(FILLED_S / seconds, 0.5))
    growth = late / course.resident_at(since) - 1
    # What was lost after the last that came is not in the summary of the counter.
    lost = n_sent - summary["received"]
    buffer = Path("/proc/sys/net/core/rmem_max").read_text().strip()
    print(
        f"{N_ACTUATORS} actuators at {RATE_HZ} Hz for {seconds:g} s, {' '.join([*OPTIONS, *options])}; log, page with\n"
        f"one reader, readings as lines; {GARBAGE_HZ} datagrams of garbage a second from {seconds / 2:g} s on\n"
    )
    rows = [
        ("samples sent", f"{n_sent}"),
        ("  not taken by the system", f"{refused}"),
        ("  latest, ms", f"{worst_us / 1e3:.1f}"),
        ("received", f"{summary['received']}"),
        ("lost", f"{lost}"),
        ("repeated, reordered", f"{summary['repeated']}, {summary['reordered']}"),
        ("garbage sent", f"{n_garbage}"),
        ("  not taken by the system", f"{garbage_refused}"),
        ("  latest, ms", f"{garbage_us / 1e3:.1f}"),
        ("malformed", f"{summary['malformed']}"),
        ("dropped by the kernel", f"{dropped} (net.core.rmem_max {buffer})"),
        ("readings", f"{summary['readings']}"),
        ("log, MB", f"{log_bytes / 1e6:.1f}"),
        ("share of a core, without garbage", f"{100 * course.share(0, course.half):.1f} %"),
        ("share of a core, with garbage", f"{100 * course.share(course.half, -1):.1f} %"),
        ("memory at 10 %, MB", f"{early / 1e3:.1f}"),
        ("memory at 50 %, MB", f"{middle / 1e3:.1f}"),
        ("memory at the end, MB", f"{late / 1e3:.1f}"),
        (f"growth from {100 * since:.0f} % to the end", f"{100 * growth:.2f} %"),
    ]
    width = max(len(name) for name, _ in rows)
    print("\n".join(f"{name:<{width}}  {value}" for name, value in rows))
    for line in rest:
        print(line)
    failed = [
        words for words, is_so in [("samples were lost", lost != 0), ("memory grew", growth > MOST_GROWTH)] if is_so
    ]
    print(f"\n{'; '.join(failed) or 'nothing lost, memory flat'}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
