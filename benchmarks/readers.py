"""How fast text files are read: `python benchmarks/readers.py [MEGABYTES]`.

Makes files of about 100 MB in a temporary folder (a raw DAQ export, a plain CSV, one with decimal commas), reads each
through `read_recording` in a process of its own, and prints the median of five readings in MB/s and the peak memory
beside the file's size. The file is in the system's cache, so that the disk is left out.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

N_READINGS = 5


def daq_export(n_rows: int) -> str:
    """A counter, date and time, three channels, events at both ends (as ../shared/records/utfsm_15Hz_0A.txt)."""
    rng = np.random.default_rng(1)
    values = rng.normal(0, 0.2, (n_rows, 3)).round(4).tolist()
    head = (
        "Header Size:  7\r\nVersion:  2\r\nSampling Interval:  0.001\r\nSampling Rate:  1000\r\n"
        f"Sample Count:  {n_rows}\r\nDevice Serial Number:  0\r\n"
        "Sample Number, Date/Time, CHANNEL0, CHANNEL1, CHANNEL2, Events\r\n"
    )
    start = np.datetime64("2022-05-25T05:00:00.000")
    stamps = np.datetime_as_string(start + np.arange(n_rows) * np.timedelta64(1, "ms"))
    rows = [
        f"{i + 1:10d},   05/25/2022 {stamp[11:]} PM, {a:.4f}, {b:.4f}, {c:.4f}\r\n"
        for i, (stamp, (a, b, c)) in enumerate(zip(stamps.tolist(), values, strict=True))
    ]
    rows[0] = rows[0].replace("\r\n", ", DAQ Start\r\n")
    rows[-1] = rows[-1].replace("\r\n", ", DAQ Stop\r\n")
    return head + "".join(rows)


def plain_csv(n_rows: int) -> str:
    """Time and three channels of three decimals (as ../shared/records/utfsm_chirp_0A.csv)."""
    values = np.random.default_rng(2).normal(0, 1, (n_rows, 3)).tolist()
    rows = (f"{i / 1000:.3f},{a:.3f},{b:.3f},{100 * c:.3f}\n" for i, (a, b, c) in enumerate(values))
    return "t_s,cmd_mm,meas_mm,force_N\n" + "".join(rows)


def full_digits(n_rows: int) -> str:
    """Decimal commas, semicolons, and numbers of 17 digits, which cannot go the fast way."""
    values = np.random.default_rng(3).normal(0, 1, (n_rows, 3)).tolist()
    rows = (f"{i / 1000:.3f};{a!r};{b!r};{c!r}\n" for i, (a, b, c) in enumerate(values))
    return ("t_s;cmd_mm;meas_mm;force_N\n" + "".join(rows)).replace(".", ",")


def read(path: str) -> None:
    """Reads the file some times and prints the median of the seconds and the peak memory in bytes."""
    from rthstrack.recording import read_recording

    before = peak_bytes()
    seconds = []
    for _ in range(N_READINGS):
        start = time.perf_counter()
        recording = read_recording(path)
        seconds.append(time.perf_counter() - start)
        assert recording.rate_hz == 1000.0
        del recording
    print(float(np.median(seconds)), peak_bytes() - before)


def peak_bytes() -> float:
    """The most memory that this process has held so far (Linux; elsewhere not known)."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((float(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM")), float("nan"))


def main(megabytes: float) -> None:
    """Makes the files and prints one line for each."""
    print(f"{'file':30} {'size, MB':>9} {'read, MB/s':>11} {'peak memory / size':>19}")
    with tempfile.TemporaryDirectory() as folder:
        for make in (daq_export, plain_csv, full_digits):
            sample = len(make(1000))
            path = Path(folder, f"{make.__name__}.txt")
            path.write_text(make(int(megabytes * 1e6 / sample * 1000)), newline="")
            size = path.stat().st_size
            command = [sys.executable, __file__, "--read", str(path)]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            seconds, peak = map(float, done.stdout.split())
            print(f"{make.__name__:30} {size / 1e6:9.1f} {size / 1e6 / seconds:11.0f} {peak / size:19.2f}", flush=True)
            path.unlink()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--read"]:
        read(sys.argv[2])
    else:
        main(float(sys.argv[1]) if len(sys.argv) > 1 else 100.0)
