"""Example assessments for the tests of the report and the figures, computed with plain NumPy from the definitions."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from rthstrack.assessment import Assessment, Limits
from rthstrack.tracking import FrequencyResponse, IndexHistories, Indices, MovingTracking, Settings, Tracking

Signal = NDArray[np.float64]


def fei(target: Signal, measured: Signal, rate_hz: float, settings: Settings) -> Tracking:
    """Eqs 6-12 as printed: zero-padded DFT without its mean bin, weights |I|^l, atan2."""
    n = 1 << (target.size - 1).bit_length()
    step = settings.frequency_decimation
    keep = np.arange(step, n // 2 // settings.data_decimation + 1, step)
    window = scipy.signal.get_window(settings.window, target.size, fftbins=False)
    I = np.fft.rfft(target * window, n)[keep]
    O = np.fft.rfft(measured * window, n)[keep]
    frequency = keep * rate_hz / n
    if settings.band_hz is not None:
        inside = (frequency >= settings.band_hz[0]) & (frequency <= settings.band_hz[1])
        I, O, frequency = I[inside], O[inside], frequency[inside]
    weights = np.abs(I) ** settings.weight_power
    weights /= weights.sum()
    gain = np.sum(O / I * weights)
    f_eq = float(np.sum(frequency * weights))
    phase = float(np.arctan2(gain.imag, gain.real))
    return Tracking(
        amplitude=float(abs(gain)),
        phase_rad=phase,
        delay_s=-phase / (2 * np.pi * f_eq),
        equivalent_frequency_hz=f_eq,
        fei=complex(gain),
        n_bins=frequency.size,
        delta_f_hz=step * rate_hz / n,
        rate_hz=rate_hz,
        n_samples=target.size,
        settings=settings,
        frequency_hz=frequency,
        weights=weights,
        target_spectrum=I,
        measured_spectrum=O,
    )


def moving(target: Signal, measured: Signal, rate_hz: float, window_s: float, hop_s: float) -> MovingTracking:
    settings = Settings(window="hann")
    n, hop = round(window_s * rate_hz), round(hop_s * rate_hz)
    starts = range(0, target.size - n + 1, hop)
    floor = 0.05 * target.std()
    rows = []
    for first in starts:
        I, O = target[first : first + n], measured[first : first + n]
        t = fei(I, O, rate_hz, settings) if I.std() >= floor else None
        rows.append(
            (t.amplitude, t.phase_rad, t.delay_s, t.equivalent_frequency_hz) if t is not None else (np.nan,) * 4
        )
    amplitude, phase, delay, f_eq = np.array(rows).T
    return MovingTracking(
        time_s=(np.array(starts) + (n - 1) / 2) / rate_hz,
        amplitude=amplitude,
        phase_rad=phase,
        delay_s=delay,
        equivalent_frequency_hz=f_eq,
        valid=~np.isnan(amplitude),
        window_s=window_s,
        hop_s=hop_s,
        minimum_std_ratio=0.05,
        rate_hz=rate_hz,
        settings=settings,
    )


def welch(target: Signal, measured: Signal, rate_hz: float, segment_s: float) -> FrequencyResponse:
    n = min(round(segment_s * rate_hz), target.size)
    options: dict[str, Any] = {"fs": rate_hz, "nperseg": n, "window": "hann", "detrend": "constant"}
    f, cross = scipy.signal.csd(target, measured, **options)
    _, S_ii = scipy.signal.welch(target, **options)
    _, S_oo = scipy.signal.welch(measured, **options)
    phase = np.unwrap(np.angle(cross))
    with np.errstate(divide="ignore", invalid="ignore"):
        delay = np.where(f > 0, -phase / (2 * np.pi * f), np.nan)
        coherence = np.abs(cross) ** 2 / (S_ii * S_oo)
    return FrequencyResponse(
        frequency_hz=f,
        gain=np.abs(cross) / S_ii,
        phase_rad=phase,
        delay_s=delay,
        coherence=coherence,
        target_psd=S_ii,
        measured_psd=S_oo,
        segment_s=n / rate_hz,
        overlap=0.5,
        n_segments=(target.size - n // 2) // (n - n // 2),
        window="hann",
        detrend="mean",
        rate_hz=rate_hz,
    )


def indices(target: Signal, measured: Signal, rate_hz: float) -> tuple[Indices, IndexHistories]:
    error = measured - target
    area = np.concatenate(([0.0], np.cumsum((target[1:] + target[:-1]) * np.diff(measured) / 2)))
    other = np.concatenate(([0.0], np.cumsum((measured[1:] + measured[:-1]) * np.diff(target) / 2)))
    correlation = scipy.signal.correlate(measured, target, method="fft")
    lag = int(np.argmax(correlation)) - (target.size - 1)
    histories = IndexHistories(
        max_tracking_error=np.maximum.accumulate(np.abs(error)),
        rms_error=np.sqrt(np.cumsum(error**2) / np.arange(1, error.size + 1)),
        tracking_indicator=(area - other) / 2,
        energy_error=None,
        rate_hz=rate_hz,
    )
    rms = float(np.sqrt(np.mean(error**2)))
    peak = float(np.abs(error).max())
    last = Indices(
        max_tracking_error=peak,
        max_tracking_error_percent=100 * peak / float(np.abs(target).max()),
        rms_error=rms,
        rms_error_percent=100 * rms / float(np.sqrt(np.mean(target**2))),
        tracking_indicator=float(histories.tracking_indicator[-1]),
        j1_s=lag / rate_hz,
        j2_percent=100 * float(error.std() / target.std()),
        j3_percent=100 * peak / float(np.abs(target).max()),
    )
    return last, histories


def judged(
    target: Signal,
    measured: Signal,
    rate_hz: float,
    *,
    file: str = "test.csv",
    part: str = "whole",
    names: tuple[str, str] = ("target", "measured"),
    unit: str | None = "mm",
    settings: Settings | None = None,
    limits: Limits | None = None,
    warnings: tuple[str, ...] = (),
    start_s: float = 0.0,
    hop_s: float = 0.25,
    moving_evaluation: bool = True,
    response: bool = True,
    done: dict[str, Any] | None = None,
) -> Assessment:
    """An assessment with everything in it, or without the parts that are switched off."""
    tracking = fei(target, measured, rate_hz, settings or Settings())
    limits = limits or Limits()
    last, histories = indices(target, measured, rate_hz)
    exceeded = []
    delay_s, amplitude = float(tracking.delay_s), float(tracking.amplitude)
    if limits.delay_s is not None and abs(delay_s) > limits.delay_s:
        exceeded.append(f"delay {1e3 * delay_s:.4g} ms exceeds the limit of {1e3 * limits.delay_s:.4g} ms")
    if limits.amplitude is not None and abs(amplitude - 1) > limits.amplitude:
        exceeded.append(f"amplitude {amplitude:.4g} is further from 1 than the limit of {limits.amplitude:.4g}")
    size = abs(amplitude - 1) * 100
    verdict = (
        f"measured {'lags' if delay_s > 0 else 'leads'} target by {abs(1e3 * delay_s):.3g} ms and is {size:.2g} % too "
        f"{'large' if amplitude > 1 else 'small'}, judged at {tracking.equivalent_frequency_hz:.2g} Hz"
    )
    return Assessment(
        file=file,
        actuator=0,
        part=part,
        target_name=names[0],
        measured_name=names[1],
        unit=unit,
        rate_hz=rate_hz,
        start_s=start_s,
        target=target,
        measured=measured,
        tracking=tracking,
        moving=moving(target, measured, rate_hz, 4.0, hop_s) if moving_evaluation else None,
        moving_note=None if moving_evaluation else "the record is shorter than two windows",
        response=welch(target, measured, rate_hz, 4.0) if response else None,
        response_note=None if response else "the record is too short for two segments",
        indices=last,
        histories=histories,
        settings=done or {"rate_hz": rate_hz, "rate_from": "time column t_s", "cut_s": None, "filled_samples": 0},
        verdict=verdict,
        warnings=warnings,
        limits=limits,
        exceeded=tuple(exceeded),
    )


def synthetic(
    n: int = 12_000, rate_hz: float = 200.0, delay_s: float = 0.03, gain: float = 1.05
) -> tuple[Signal, Signal]:
    """A burst of three sines and its delayed, amplified copy, with a quiet start; both exact."""
    t = np.arange(n) / rate_hz

    def motion(at: Signal) -> Signal:
        length = n / rate_hz
        envelope = np.where(at > 0.1 * length, (at / length) * np.exp(1 - 4 * (at / length)), 0.0) * 4
        return envelope * sum(a * np.sin(2 * np.pi * f * at) for a, f in ((12.0, 0.8), (6.0, 1.7), (2.0, 3.1)))

    noise = np.random.default_rng(7).normal(size=(2, n)) * 0.01
    return motion(t) + noise[0], gain * motion(t - delay_s) + noise[1]


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
    return judged(
        np.ascontiguousarray(table[:, 1]),
        np.ascontiguousarray(table[:, 2]),
        1000.0,
        file="records/utfsm_chirp_0A.csv",
        names=("cmd_mm", "meas_mm"),
        warnings=(
            "target and measured carry an offset that takes 12 % of the weight; --detrend mean removes it",
            "gain and delay change over the band of the target; see the curves over frequency",
        ),
        **options,
    )


def bouc_wen(shared: Path, **options: Any) -> Assessment:
    """The paper's nonlinear virtual test on CHY101-N, 92,161 samples."""
    with np.load(shared / "reference" / "chy101n_boucwen.npz") as file:
        target, measured, rate_hz = file["target"], file["measured"], float(file["rate_hz"])
    return judged(target, measured, rate_hz, file="reference/chy101n_boucwen.npz", unit="m", **options)


def without_a_number(assessment: Assessment) -> Assessment:
    """The same with a delay that could not be determined."""
    tracking = dataclasses.replace(assessment.tracking, delay_s=float("nan"), phase_rad=float("nan"))
    return dataclasses.replace(assessment, tracking=tracking, verdict="no delay can be told")
