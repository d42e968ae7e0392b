"""A script as users write it, for `mypy --strict`: every number of one pair is a float, of several an array."""

from pathlib import Path
from typing import Any, assert_type

import numpy as np
import numpy.typing as npt

import rthstrack
from rthstrack import plots
from rthstrack.virtual_test import Actuator, Structure

Signal = npt.NDArray[np.float64]


def delay_ms(path: Path) -> float:
    recording = rthstrack.read_recording(path)
    if recording.rate_hz is None:
        raise SystemExit(f"{path}: {recording.rate_source}")
    target, measured = recording["target"].values, recording["measured"].values
    result = rthstrack.evaluate(target, measured, recording.rate_hz, estimator="least_squares")
    low, high = result.delay_interval_s
    print(f"A = {round(result.amplitude, 3)}, {1e3 * low:.3f} to {1e3 * high:.3f} ms", result.reason.upper())
    return 1e3 * result.delay_s


def within(result: rthstrack.Tracking, limit_s: float) -> bool:
    return abs(result.delay_s) <= limit_s


def worst(target: Signal, measured: Signal) -> float:
    moving = rthstrack.evaluate_moving(target, measured, 1024.0, window_s=2.0)
    return float(np.nanmax(np.abs(moving.delay_s)))


def report(folder: Path) -> None:
    assessments = [rthstrack.assess(rthstrack.read_recording(file)) for file in sorted(folder.glob("*.csv"))]
    rthstrack.write_report(assessments, folder / "report.html")
    rthstrack.write_report(assessments[0], folder / "first.html")
    ax = plots.plot_time_history(assessments[0], label="first")
    plots.plot_time_history(assessments[1], ax=ax, label="second", color="#56b4e9")
    rows = assessments[0].tracking.to_frame()
    print(len(rows), assessments[0].trusted.delay_interval_s[1])


def channels(recording: rthstrack.Recording) -> list[str]:
    assert_type(recording.time_s, npt.NDArray[np.float64])
    return [f"{channel.name}: {len(channel)}" for channel in recording]


def judged(recording: rthstrack.Recording, t: Signal, m: Signal) -> list[rthstrack.Assessment]:
    limits = rthstrack.Limits(delay_s=0.02)
    return [
        rthstrack.assess(recording),
        rthstrack.assess(recording, target="cmd", measured="meas", limits=limits, moving_s=2.0),
        rthstrack.assess(t, m, 1024, unit="mm", settings=rthstrack.Settings(window="hann")),
    ]


def several(both: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> Signal:
    found = rthstrack.evaluate(both, both, 1024.0)
    first: str = found.reason[0]
    print(first)
    return found.delay_s


def rehearsed() -> float:
    test = rthstrack.VirtualTest(Structure.none(), (Actuator(delay_s=0.01),))
    run = rthstrack.simulate(test, rthstrack.SineTarget(frequency_hz=1.0, amplitude_m=0.01, duration_s=10.0))
    evaluator = rthstrack.Evaluator(run.n_samples, run.rate_hz)
    return evaluator.evaluate(run.target, run.measured).delay_s


def published(out: Path) -> Any:
    return rthstrack.reproduction.reproduce(out)
