"""The estimators that shift the target, against the NumPy twin written from their definitions, in noise.

The window judged lies within a longer record, so that both see the same samples.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rthstrack
from tolerances import physical

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "reference"))
import estimate_twin as twin

RATE_HZ = 1024.0
GAIN, DELAY_S = 0.93, 0.0073
WINDOW, HOP = 2048, 512
#: The window judged is the one that starts here: target lies on both sides of it.
START = 2 * HOP


def record(coefficient: float, delay_s: float = DELAY_S, seed: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """A drifting burst and its late copy with noise of 2 %, white or coloured."""
    t = np.arange(WINDOW + 4 * HOP) / RATE_HZ

    def motion(t: np.ndarray) -> np.ndarray:
        burst = np.exp(-(((t - 1.9) / 0.8) ** 2)) * np.sin(2 * np.pi * 2.3 * t)
        return np.asarray(burst + 0.4 * np.tanh(2 * (t - 2.1)) + 0.1 * np.sin(2 * np.pi * 6.1 * t + 1))

    white = np.random.default_rng(seed).standard_normal(t.size)
    noise = np.zeros(t.size)
    for i in range(1, t.size):
        noise[i] = coefficient * noise[i - 1] + np.sqrt(1 - coefficient**2) * white[i]
    return motion(t), GAIN * motion(t - delay_s) + 0.02 * noise


def judged(target: np.ndarray, measured: np.ndarray, **settings: Any) -> dict[str, Any]:
    moving = rthstrack.evaluate_moving(
        target, measured, RATE_HZ, window_s=WINDOW / RATE_HZ, hop_s=HOP / RATE_HZ, minimum_std_ratio=0.0, **settings
    )
    at = START // HOP
    names = ("amplitude", "delay_s", "amplitude_std", "delay_std_s")
    return {name: float(getattr(moving, name)[at]) for name in names} | {"reason": moving.reason[at]}


def case(target: np.ndarray, measured: np.ndarray, **settings: Any) -> twin.Case:
    return twin.Case(twin.Target(target, RATE_HZ), measured, START, START + WINDOW, **settings)


@pytest.mark.parametrize("delay_s", [DELAY_S, -0.0211])
@pytest.mark.parametrize("coefficient", [0.0, 0.9])
@pytest.mark.parametrize("detrend", ["none", "mean", "linear"])
@pytest.mark.parametrize("window", ["boxcar", "hann", "tukey"])
@pytest.mark.parametrize("estimator", ["least_squares", "aligned"])
def test_gain_delay_and_their_errors_are_those_of_the_twin(
    estimator: str, window: str, detrend: str, coefficient: float, delay_s: float
) -> None:
    target, measured = record(coefficient, delay_s)
    found = judged(target, measured, estimator=estimator, window=window, detrend=detrend)
    assert found["reason"] == ""
    plain = case(target, measured, window=window, detrend=detrend)
    amplitude, delay = getattr(twin, estimator)(plain, delay_s)[:2]
    assert_allclose(found["amplitude"], amplitude, rtol=physical(1e-7, "relative"))
    assert_allclose(found["delay_s"], delay, rtol=0, atol=physical(1e-3, "us"))
    if estimator == "least_squares":
        # The twin knows the noise; the program takes it from one residual.
        covariance = twin.autoregressive_covariance(coefficient, 0.02, WINDOW) if coefficient else np.array([0.02**2])
        told = twin.least_squares_errors(plain, amplitude, delay, covariance)
        assert_allclose((found["amplitude_std"], found["delay_std_s"]), told, rtol=physical(0.3, "relative"))


@pytest.mark.parametrize("band_hz", [(1.0, 12.0), (2.0, 40.0)])
@pytest.mark.parametrize("estimator", ["least_squares", "aligned"])
def test_a_band_keeps_the_twins_bins(estimator: str, band_hz: tuple[float, float]) -> None:
    target, measured = record(0.0)
    found = judged(target, measured, estimator=estimator, band_hz=band_hz)
    amplitude, delay = getattr(twin, estimator)(case(target, measured, band_hz=band_hz), DELAY_S)[:2]
    assert_allclose(found["amplitude"], amplitude, rtol=physical(1e-6, "relative"))
    assert_allclose(found["delay_s"], delay, rtol=0, atol=physical(1e-2, "us"))


def test_noise_on_both_signals_is_shared_out_as_the_twin_does() -> None:
    target, measured = record(0.0)
    noisy = target + 0.01 * np.random.default_rng(6).standard_normal(target.size)
    found = judged(noisy, measured, estimator="least_squares", noise_ratio=0.5, band_hz=(0.4, 12.0))
    amplitude, delay = twin.total_least_squares(case(noisy, measured, band_hz=(0.4, 12.0)), 0.5, DELAY_S)[:2]
    # The program also weighs bins by how far they stand clear of the noise: a tenth of a standard deviation.
    assert abs(found["amplitude"] - amplitude) < 0.5 * found["amplitude_std"]
    assert abs(found["delay_s"] - delay) < 0.5 * found["delay_std_s"]


def test_whitening_is_worth_its_while_in_short_windows_of_strongly_coloured_noise() -> None:
    stds = []
    for seed in range(16):
        target, measured = record(0.9, seed=seed)
        white = judged(target, measured, estimator="least_squares")
        coloured = judged(target, measured, estimator="least_squares", noise="coloured")
        assert abs(coloured["delay_s"] - DELAY_S) < 4 * coloured["delay_std_s"]
        stds.append((white["delay_std_s"], coloured["delay_std_s"]))
    # What is known of either from one window scatters by a tenth.
    before, after = np.mean(stds, axis=0)
    assert after < 1.05 * before


def test_several_actuators_have_their_own_intervals_and_reasons() -> None:
    target, measured = record(0.0)
    still = np.full_like(measured, 3.0)
    both = rthstrack.evaluate(
        np.column_stack([target, target]), np.column_stack([measured, still]), RATE_HZ, estimator="least_squares"
    )
    alone = rthstrack.evaluate(target, measured, RATE_HZ, estimator="least_squares")
    assert np.asarray(both.delay_interval_s).shape == (2, 2)
    assert tuple(np.asarray(both.delay_interval_s)[0]) == alone.delay_interval_s
    assert both.reason[0] == ""
    assert both.reason[1].startswith("not determined")
    assert np.isnan(np.asarray(both.delay_s)[1])
    assert np.isnan(np.asarray(both.delay_interval_s)[1]).all()
    frame = both.to_frame()
    assert frame["delay_interval_low_s"][0] == alone.delay_interval_s[0]
