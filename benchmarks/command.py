"""How long the command takes: from a prompt to the verdict of one file, and for many files on two cores.

`python benchmarks/command.py [FILES]`; part of `make bench`. Everything is a ratio of what runs by turns: evaluating
beside a start of NumPy, two cores beside one, evaluating beside reading.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np
import scipy.io

ROOT = Path(__file__).resolve().parent.parent
RATE_HZ, N_SAMPLES = 1024.0, 60_000
#: What evaluating a file took at commit 29ae783, in starts of NumPy, of which the command may take 0.6 today.
BEFORE = {"recorded CSV": 4.1, "CSV": 3.0, "HDF5": 3.1, "MATLAB": 5.2}
SHARE = 0.6
READ = "import sys\nfrom rthstrack import read_recording\nfor path in sys.argv[1:]:\n    read_recording(path)\n"


def motion(seed: int) -> np.ndarray:
    """Time, target and measured, 12 ms late and 2 % too small, with noise: (n_samples, 3)."""
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(2 * N_SAMPLES, 1 / RATE_HZ)
    spectrum = np.exp(2j * np.pi * rng.random(f.size)) * f * np.exp(-((f / 2) ** 2))
    target = np.fft.irfft(spectrum)[:N_SAMPLES]
    measured = 0.98 * np.fft.irfft(spectrum * np.exp(-2j * np.pi * 0.012 * f))[:N_SAMPLES]
    scale = 20 / np.abs(target).max()
    noise = 0.005 * rng.standard_normal(N_SAMPLES)
    return np.column_stack((np.arange(N_SAMPLES) / RATE_HZ, scale * target, scale * measured + noise))


def write(path: Path, seed: int) -> str:
    """Writes a file of that motion, HDF5, MATLAB or text; returns its path."""
    columns, names = motion(seed), ("time_s", "target_mm", "measured_mm")
    if path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            for name, column in zip(names, columns.T, strict=True):
                file[name] = column
    elif path.suffix == ".mat":
        scipy.io.savemat(path, dict(zip(names, columns.T, strict=True)))
    else:
        np.savetxt(path, columns, fmt="%.6f", delimiter=",", header=",".join(names), comments="")
    return str(path)


def seconds(*arguments: str, cores: set[int] | None = None) -> float:
    """Wall time of one run of Python, on these cores."""
    start = time.perf_counter()
    run = subprocess.Popen([sys.executable, *arguments], cwd=ROOT, stdout=subprocess.DEVNULL, env=environment())
    if cores:
        os.sched_setaffinity(run.pid, cores)
    if run.wait() != 0:
        raise SystemExit(f"bench: {' '.join(arguments[:4])} ended with {run.returncode}")
    return time.perf_counter() - start


def environment() -> dict[str, str]:
    """As a user has it: what was compiled once is kept."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def one_file(rounds: int = 15) -> dict[str, float]:
    """Medians of how much longer evaluating one file takes than a start of NumPy in the same turn."""
    with tempfile.TemporaryDirectory() as folder:
        files = {
            "recorded CSV": str(ROOT / "examples" / "data" / "utfsm_chirp_0A.csv"),
            "CSV": write(Path(folder, "one.csv"), 0),
            "HDF5": write(Path(folder, "one.h5"), 0),
            "MATLAB": write(Path(folder, "one.mat"), 0),
        }
        found: dict[str, list[float]] = {name: [] for name in files}
        for turn in range(rounds + 1):
            numpy_s = seconds("-c", "import numpy")
            for name, file in files.items():
                ratio = seconds("-m", "rthstrack", "evaluate", file) / numpy_s
                if turn:
                    found[name].append(ratio)
    return {name: statistics.median(ratios) for name, ratios in found.items()}


def many_files(n_files: int = 200, rounds: int = 3) -> tuple[float, float]:
    """How much faster many files are on two cores than on one, and how much longer that takes than reading them."""
    available = sorted(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as folder:
        files = [write(Path(folder, f"{i:03d}.csv"), i) for i in range(n_files)]
        times: list[tuple[float, float, float]] = []
        for _ in range(rounds):
            command = ("-m", "rthstrack", "evaluate", *files)
            one, two = (seconds(*command, cores=set(available[:n])) for n in (1, 2))
            times.append((one, two, seconds("-c", READ, *files)))
    return (
        statistics.median(one / two for one, two, _ in times),
        statistics.median(two / reading for _, two, reading in times),
    )


def figures(n_files: int = 200) -> list[tuple[str, str, str, bool]]:
    """What is asked for, and what was found."""
    found: list[tuple[str, str, str, bool]] = []
    for name, ratio in one_file().items():
        what = f"`rthstrack evaluate` of 60,000 samples ({name}) over its time at 29ae783, both in starts of NumPy"
        share = ratio / BEFORE[name]
        found.append((what, f"<= {SHARE}", f"{share:.2f} ({ratio:.2f} of {BEFORE[name]})", share <= SHARE))
    faster, over_reading = many_files(n_files)
    what = f"{n_files} files of 60,000 samples, evaluated on two cores"
    found.append((f"{what} over one", ">= 1.8", f"{faster:.2f}", faster >= 1.8))
    found.append((f"{what}, over reading them alone", "<= 3", f"{over_reading:.2f}", over_reading <= 3))
    return found


if __name__ == "__main__":
    for what, asked, value, met in figures(int(sys.argv[1]) if len(sys.argv) > 1 else 200):
        print(f"{what}: asked {asked}, measured {value}{'' if met else ', missed'}", flush=True)
