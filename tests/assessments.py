"""Example assessments for the tests of the report and the figures."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rthstrack.said import undetermined
from rthstrack.verdict import Assessment, Limits, assess

Signal = NDArray[np.float64]


def judged(
    target: Signal,
    measured: Signal,
    rate_hz: float,
    *,
    names: tuple[str, str] = ("target", "measured"),
    warnings: tuple[str, ...] | None = None,
    moving_evaluation: bool = True,
    response: bool = True,
    **options: Any,
) -> Assessment:
    """An assessment with everything in it, or without the parts that are switched off."""
    chosen: dict[str, Any] = {"file": "test.csv", "unit": "mm", "origin": {"rate_source": "time column t_s"}, **options}
    found = assess(target, measured, rate_hz, target_name=names[0], measured_name=names[1], **chosen)
    changes: dict[str, Any] = {}
    if warnings is not None:
        changes["warnings"] = warnings
    if not moving_evaluation:
        changes |= {"moving": None, "moving_note": undetermined("the record is shorter than two windows", "setting")}
    if not response:
        changes |= {
            "response": None,
            "response_note": undetermined("the record is too short for two segments", "too_short"),
        }
    return dataclasses.replace(found, **changes)


def synthetic(
    n: int = 12_000, rate_hz: float = 200.0, delay_s: float = 0.03, gain: float = 1.05
) -> tuple[Signal, Signal]:
    """A burst of three sines and its delayed, amplified copy, with a quiet start and a little noise on both."""
    t = np.arange(n) / rate_hz

    def motion(at: Signal) -> Signal:
        part = at * rate_hz / n
        envelope = np.where(part > 0.1, 4 * part * np.exp(1 - 4 * part), 0.0)
        return envelope * sum(a * np.sin(2 * np.pi * f * at) for a, f in ((12.0, 0.8), (6.0, 1.7), (2.0, 3.1)))

    noise = np.random.default_rng(7).normal(size=(2, n)) * 0.01
    return motion(t) + noise[0], gain * motion(t - delay_s) + noise[1]


def varying_over_both(rate_hz: float = 256.0) -> Assessment:
    """A delay that rises by 1.5 ms a hertz and by 6 ms over the record, made from the definition."""
    n = 15_000
    t, rng = np.arange(n) / rate_hz, np.random.default_rng(0)
    f = np.fft.rfftfreq(2 * n, 1 / rate_hz)
    spectrum = (rng.normal(size=f.size) + 1j * rng.normal(size=f.size)) * np.exp(-((f / 4) ** 2)) * (f > 0.2)
    target = np.fft.irfft(spectrum, 2 * n)
    target *= 10 / target.std()
    later = np.fft.irfft(np.fft.rfft(target) * np.exp(-2j * np.pi * f * (0.012 + 0.0015 * np.minimum(f, 6))))[:n]
    measured = np.interp(t - 0.006 * t / t[-1], t, later) + 0.02 * rng.normal(size=n)
    return judged(target[:n], measured, rate_hz)


def parts_of_a_test(limits: Limits | None = None) -> list[Assessment]:
    """Target, command and measured of one actuator as whole, compensator and actuator."""
    target, command = synthetic(delay_s=-0.025, gain=1.0)
    _, measured = synthetic(delay_s=0.004, gain=0.99)
    pairs = (
        ("whole", "target", target, "measured", measured),
        ("compensator", "target", target, "command", command),
        ("actuator", "command", command, "measured", measured),
    )
    return [
        judged(a, b, 200.0, file="tests/frame_07.mat", part=part, names=(m, n), limits=limits)
        for part, m, a, n, b in pairs
    ]


def chirp(shared: Path, **options: Any) -> Assessment:
    """An open-loop sweep on a real machine, 0-15 Hz, 61,500 samples."""
    table = np.loadtxt(shared / "records" / "utfsm_chirp_0A.csv", delimiter=",", skiprows=1)
    file, names = "records/utfsm_chirp_0A.csv", ("cmd_mm", "meas_mm")
    return judged(table[:, 1], table[:, 2], 1000.0, file=file, names=names, **options)


def bouc_wen(shared: Path, **options: Any) -> Assessment:
    """The paper's nonlinear virtual test on CHY101-N, 92,161 samples."""
    with np.load(shared / "reference" / "chy101n_boucwen.npz") as file:
        target, measured, rate_hz = file["target"], file["measured"], float(file["rate_hz"])
    return judged(target, measured, rate_hz, file="reference/chy101n_boucwen.npz", unit="m", **options)


def without_a_number(assessment: Assessment) -> Assessment:
    """The same with a delay that could not be determined."""
    why = "not determined: the iteration did not settle on a delay"
    tracking = dataclasses.replace(assessment.tracking, delay_s=float("nan"), phase_rad=float("nan"), reason=why)
    tracking = dataclasses.replace(tracking, reason_code="no_convergence")
    return dataclasses.replace(assessment, tracking=tracking, verdict="no delay can be told")
