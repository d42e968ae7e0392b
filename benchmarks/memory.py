"""Peak memory of `evaluate` on long records: above what was resident before the call, with the input counted in.

Each estimator runs in a process of its own, in which the record has been made and a short one evaluated before. Linux.

    python benchmarks/memory.py [SAMPLES]
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import scipy.signal

import rthstrack

N_SAMPLES, RATE_HZ = 10_000_000, 1024.0
ESTIMATORS: dict[str, dict[str, Any]] = {
    "fei": {},
    "aligned": {"estimator": "aligned", "detrend": "mean"},
    "least_squares": {"estimator": "least_squares", "detrend": "mean"},
    "least_squares, Hann": {"estimator": "least_squares", "detrend": "mean", "window": "hann"},
    "least_squares, band": {"estimator": "least_squares", "detrend": "mean", "band_hz": (0.0, 50.0)},
    "least_squares, coloured": {"estimator": "least_squares", "detrend": "mean", "noise": "coloured"},
}


def motion(n_samples: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """White noise smoothed over 64 samples; measured comes 12 samples later, with AR(0.9) noise, 0.5 % of it."""
    rng = np.random.default_rng(1)
    smooth = np.convolve(rng.standard_normal(n_samples + 75), np.hanning(64), "valid")[: n_samples + 12]
    noise = scipy.signal.lfilter([0.01], [1, -0.9], rng.standard_normal(n_samples))
    return smooth[12:].copy(), smooth[:n_samples] + noise


def _status(name: str) -> int:
    """A line of this process's status, in bytes."""
    found = re.search(rf"^{name}:\s+(\d+) kB", Path("/proc/self/status").read_text(), re.MULTILINE)
    assert found is not None
    return 1024 * int(found[1])


def measure(name: str, n_samples: int) -> tuple[float, float, float]:
    """Peak of one call and what is left after it, in multiples of the input; the delay found, in samples."""
    settings = ESTIMATORS[name]
    target, measured = motion(n_samples)
    rthstrack.evaluate(target[:4096], measured[:4096], RATE_HZ, **settings)
    Path("/proc/self/clear_refs").write_text("5")  # the peak is counted from here
    before, size = _status("VmRSS"), target.nbytes + measured.nbytes
    found = rthstrack.evaluate(target, measured, RATE_HZ, **settings)
    peak, after = _status("VmHWM") - before + size, _status("VmRSS") - before + size
    return peak / size, after / size, float(found.delay_s) * RATE_HZ


def main() -> None:
    if len(sys.argv) == 3:
        print(*measure(sys.argv[1], int(sys.argv[2])))
        return
    n_samples = int(sys.argv[1]) if len(sys.argv) == 2 else N_SAMPLES
    print(f"{n_samples} samples, {16e-6 * n_samples:.0f} MB of input. Multiples of the input, which is one of them.\n")
    print("| estimator | peak | left after the call |\n| --- | ---: | ---: |")
    for name in ESTIMATORS:
        command = [sys.executable, __file__, name, str(n_samples)]
        peak, after, _ = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
        print(f"| {name} | {float(peak):.2f} | {float(after):.2f} |", flush=True)


if __name__ == "__main__":
    main()
