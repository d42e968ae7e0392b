"""The package against its NumPy twin, over settings, lengths and kinds of signal.

Where P = 1 both compute the same sums: 1e-9. Where P > 1 the package may decimate instead of transforming: 1e-6.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import rthstrack
import tracking_twin as twin
from published import published, published_moving
from tolerances import physical, round_off

FULL = physical(1e-9, "relative")
DECIMATED = physical(1e-6, "relative")
PAPER_LENGTHS = (24577, 51160, 92161)
FACTORS = tuple(2**i for i in range(10))
WINDOWS = ("boxcar", "hann", "hamming", "blackman", "flattop", "tukey")
CHEBYSHEV_LEAST = 28  # samples: the zero-phase filter pads 27 at either end


def assert_agrees(
    target: twin.Floats, measured: twin.Floats, rate_hz: float, tolerance: float, **evaluation: Any
) -> None:
    """FEI, equivalent frequency and delay of both; FEI's error is relative to its size, the delay's follows from it."""
    ours = published(target, measured, rate_hz, **evaluation)
    theirs = twin.evaluate(target, measured, rate_hz, **evaluation)
    assert ours.n_bins == theirs["n_bins"]
    assert ours.delta_f_hz == theirs["delta_f_hz"]
    label = str(evaluation)
    assert_allclose(complex(ours.fei), theirs["fei"], rtol=tolerance, atol=0, err_msg=f"fei {label}")
    assert_allclose(ours.amplitude, theirs["amplitude"], rtol=tolerance, atol=0, err_msg=f"amplitude {label}")
    f_eq = theirs["equivalent_frequency_hz"]
    assert_allclose(ours.equivalent_frequency_hz, f_eq, rtol=tolerance, atol=0, err_msg=f"f_eq {label}")
    seconds = tolerance * (abs(theirs["delay_s"]) + 1 / (2 * math.pi * f_eq))
    # At half a turn lag and lead are one and the same, and rounding decides which is said.
    difference = math.remainder(ours.delay_s - theirs["delay_s"], 1 / f_eq)
    assert_allclose(difference, 0, rtol=0, atol=physical(seconds, "s"), err_msg=f"delay {label}")


def earthquake_like(length: int, rate_hz: float, seed: int = 0) -> tuple[twin.Floats, twin.Floats]:
    """A response near 2 Hz under an envelope with a little of everything else, and what a 9 ms lag makes of it."""
    rng = np.random.default_rng(seed)
    t = np.arange(length) / rate_hz
    envelope = np.exp(-(((t - 0.4 * t[-1]) / (0.15 * t[-1])) ** 2))
    target = envelope * np.sin(2 * np.pi * 2.1 * t + 3 * np.sin(0.7 * t)) + 1e-4 * rng.standard_normal(length)
    measured = 1.07 * np.interp(t - 0.009, t, target, left=0.0) + 1e-4 * rng.standard_normal(length)
    return target, measured


def noisy(length: int, seed: int = 0) -> tuple[twin.Floats, twin.Floats]:
    """White target; measured follows by two samples and has noise of its own: energy in every bin."""
    rng = np.random.default_rng(seed)
    target = rng.standard_normal(length)
    return target, 0.8 * np.roll(target, 2) + 0.3 * rng.standard_normal(length) + 0.1


def shrill(length: int, rate_hz: float, ratio: float, seed: int = 0) -> tuple[twin.Floats, twin.Floats]:
    """A response at a fraction of a hertz beneath tones above rate/4 that are `ratio` times larger."""
    rng = np.random.default_rng(seed)
    t = np.arange(length) / rate_hz
    slow = np.sin(2 * np.pi * 0.31 * t) + 0.6 * np.sin(2 * np.pi * 0.77 * t + 1.0)
    tones = rng.uniform(0.26, 0.49, 5) * rate_hz
    high = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(tones, rng.uniform(0, 6, 5), strict=True))
    late = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(tones, rng.uniform(0, 6, 5), strict=True))
    return slow + ratio * high, 1.1 * np.roll(slow, 5) + 0.7 * ratio * late


@st.composite
def evaluations(draw: st.DrawFn) -> tuple[int, float, dict[str, Any]]:
    """A length, a rate and settings that leave at least one bin."""
    length = draw(st.integers(4, 3000) | st.sampled_from([4, 5, 7, 8, 9, 64, 65, 1023, 1024, 1025, 2048, 2049]))
    rate_hz = draw(st.sampled_from([1.0, 100.0, 256.0, 1000.0, 1024.0, 4096.0, 333.3]))
    p = 2 ** math.ceil(math.log2(length)) // 2
    decimator = draw(st.sampled_from(["spectral", "chebyshev"])) if length >= CHEBYSHEV_LEAST else "spectral"
    P = draw(st.sampled_from([f for f in FACTORS if f <= p]))
    if decimator == "chebyshev":
        P = min(P, 2 ** int(math.log2(length / 8)))  # leave some samples to evaluate
    Q = draw(st.sampled_from([f for f in FACTORS if P * f <= p]))
    setting: dict[str, Any] = {
        "data_decimation": P,
        "frequency_decimation": Q,
        "decimator": decimator,
        "weight_power": draw(st.sampled_from([1, 2, 3, 4])),
        # On a handful of samples the tapered windows leave nothing of the record.
        "window": draw(st.sampled_from(WINDOWS)) if length // P >= 16 else "boxcar",
        "detrend": draw(st.sampled_from(["none", "mean", "linear"])) if length // P >= 16 else "none",
    }
    if draw(st.booleans()):
        kept = p // P // Q
        low, high = sorted(draw(st.tuples(st.integers(1, kept), st.integers(1, kept))))
        delta_f = Q * rate_hz / (2 * p)
        setting["band_hz"] = (low * delta_f, high * delta_f)
    return length, rate_hz, setting


@settings(max_examples=400)
@given(evaluations(), st.integers(0, 2**32 - 1))
def test_package_agrees_with_the_twin_on_noise_whatever_the_settings(
    case: tuple[int, float, dict[str, Any]], seed: int
) -> None:
    length, rate_hz, setting = case
    target, measured = noisy(length, seed)
    assert_agrees(target, measured, rate_hz, FULL if setting["data_decimation"] == 1 else DECIMATED, **setting)


@pytest.mark.parametrize("length", PAPER_LENGTHS)
@pytest.mark.parametrize("kind", ["earthquake", "noise", "shrill"])
def test_spectral_p_keeps_the_twins_bins_up_to_512(length: int, kind: str) -> None:
    rate = 1024.0
    target, measured = {
        "earthquake": lambda: earthquake_like(length, rate),
        "noise": lambda: noisy(length),
        "shrill": lambda: shrill(length, rate, 1e3),
    }[kind]()
    for P in FACTORS:
        assert_agrees(target, measured, rate, FULL if P == 1 else DECIMATED, data_decimation=P)


@pytest.mark.parametrize("window", ["boxcar", "hann", "flattop"])
@pytest.mark.parametrize("ratio", [1e2, 1e4, 1e6])
def test_spectral_p_is_not_fooled_by_energy_above_the_band(ratio: float, window: str) -> None:
    rate = 1024.0
    target, measured = shrill(24577, rate, ratio)
    for P in FACTORS:
        assert_agrees(target, measured, rate, FULL if P == 1 else DECIMATED, data_decimation=P, window=window)


def test_energy_just_above_the_band_does_not_leak_into_it() -> None:
    rate, length = 1024.0, 24577
    t = np.arange(length) / rate
    for P in FACTORS[1:]:
        edge = rate / (2 * P)
        for ratio in (1.0, 1e3):
            target = np.sin(2 * np.pi * 0.4 * edge * t) + ratio * np.sin(2 * np.pi * 1.03 * edge * t + 0.4)
            measured = 0.9 * np.sin(2 * np.pi * 0.4 * edge * t - 0.3) + ratio * np.sin(2 * np.pi * 1.03 * edge * t)
            for window in ("boxcar", "hann"):
                assert_agrees(target, measured, rate, DECIMATED, data_decimation=P, window=window)


def test_every_cell_of_the_papers_tables_agrees_with_the_twin() -> None:
    target, measured = earthquake_like(24577, 1024.0)
    for P in FACTORS:
        for Q in FACTORS:
            if P * Q <= 2**14:
                tolerance = FULL if P == 1 else DECIMATED
                assert_agrees(target, measured, 1024.0, tolerance, data_decimation=P, frequency_decimation=Q)


@pytest.mark.parametrize("setting", [{"window": "hann"}, {"detrend": "linear"}, {"weight_power": 3, "window": "tukey"}])
@pytest.mark.parametrize("Q", [1, 4, 32])
def test_p_agrees_with_the_twin_beside_other_settings(setting: dict[str, Any], Q: int) -> None:
    target, measured = earthquake_like(51160, 1024.0)
    for P in (2, 16, 128):
        assert_agrees(target, measured, 1024.0, DECIMATED, data_decimation=P, frequency_decimation=Q, **setting)


@pytest.mark.parametrize("length", PAPER_LENGTHS)
@pytest.mark.parametrize("kind", ["earthquake", "noise"])
def test_chebyshev_agrees_with_scipys_decimate_up_to_512(length: int, kind: str) -> None:
    rate = 1024.0
    target, measured = earthquake_like(length, rate) if kind == "earthquake" else noisy(length)
    for P in FACTORS:
        assert_agrees(target, measured, rate, FULL if P == 1 else DECIMATED, data_decimation=P, decimator="chebyshev")


def test_chebyshev_evaluates_the_shortest_record_its_padding_allows_and_refuses_shorter_ones() -> None:
    target, measured = noisy(CHEBYSHEV_LEAST)
    assert_agrees(target, measured, 100.0, DECIMATED, data_decimation=2, decimator="chebyshev")
    for length in range(4, CHEBYSHEV_LEAST):
        with pytest.raises(rthstrack.SignalError, match=f"{length} samples .*{CHEBYSHEV_LEAST}"):
            published(target[:length], measured[:length], 100.0, data_decimation=2, decimator="chebyshev")
    # Without decimation there is nothing to filter and nothing to refuse.
    assert_agrees(target[:4], measured[:4], 100.0, FULL, decimator="chebyshev")


@settings(max_examples=60)
@given(
    length=st.integers(40, 2500),
    window_share=st.floats(0.05, 1.0),
    hop_share=st.floats(0.1, 1.5),
    power=st.sampled_from([1, 2, 3]),
    P=st.sampled_from([1, 2, 4]),
    Q=st.sampled_from([1, 2]),
    window=st.sampled_from(WINDOWS),
    detrend=st.sampled_from(["none", "mean", "linear"]),
    seed=st.integers(0, 2**32 - 1),
)
def test_moving_readings_agree_with_the_twins_slices(
    length: int,
    window_share: float,
    hop_share: float,
    power: int,
    P: int,
    Q: int,
    window: str,
    detrend: str,
    seed: int,
) -> None:
    rate = 200.0
    W = max(32, int(window_share * length))
    H = max(1, int(hop_share * W))
    target, measured = noisy(length, seed)
    target[: length // 3] *= 1e-3  # a quiet start, so that some windows cannot be judged
    setting: dict[str, Any] = {
        "window_s": W / rate,
        "hop_s": H / rate,
        "data_decimation": P,
        "frequency_decimation": Q,
        "weight_power": power,
        "window": window,
        "detrend": detrend,
    }
    ours = published_moving(target, measured, rate, **setting)
    theirs = twin.evaluate_moving(target, measured, rate, **setting)
    assert_allclose(ours.time_s, theirs["time_s"], rtol=round_off(4, 1), atol=0)
    assert ours.valid.tolist() == theirs["valid"].tolist()
    tolerance = FULL if P == 1 else DECIMATED
    for name in ("amplitude", "phase_rad", "delay_s", "equivalent_frequency_hz"):
        expected = dict(theirs)[name]
        scale = np.nanmax(np.abs(expected), initial=0.0)
        assert_allclose(
            getattr(ours, name), expected, rtol=tolerance, atol=tolerance * scale, equal_nan=True, err_msg=name
        )


def test_long_moving_evaluation_agrees_with_the_twins_slices() -> None:
    rate = 1024.0
    target, measured = earthquake_like(24577, rate)
    ours = published_moving(target, measured, rate, window_s=4.0, hop_s=0.5, data_decimation=16)
    theirs = twin.evaluate_moving(target, measured, rate, window_s=4.0, hop_s=0.5, data_decimation=16)
    assert ours.valid.tolist() == theirs["valid"].tolist()
    assert 10 < ours.valid.sum() < len(ours.valid)
    for name in ("amplitude", "phase_rad", "delay_s", "equivalent_frequency_hz"):
        expected = dict(theirs)[name]
        scale = np.nanmax(np.abs(expected))
        assert_allclose(getattr(ours, name), expected, rtol=0, atol=DECIMATED * scale, equal_nan=True, err_msg=name)
        assert np.array_equal(np.isnan(getattr(ours, name)), ~ours.valid), name


@settings(max_examples=40)
@given(st.integers(40, 1500), st.integers(0, 2**32 - 1), st.floats(0.01, 0.1))
def test_indices_agree_with_the_twin(length: int, seed: int, lag_share: float) -> None:
    rate = 128.0
    target, measured = noisy(length, seed)
    force = np.random.default_rng(seed + 1).standard_normal(length)
    max_lag_s = max(1, int(lag_share * length)) / rate
    ours = rthstrack.indices(target, measured, rate, force=force, max_lag_s=max_lag_s)
    for name, value in twin.indices(target, measured, rate, force, max_lag_s).items():
        scale = np.sum(np.abs(target)) if name in ("tracking_indicator", "energy_error") else abs(value)
        assert_allclose(getattr(ours, name), value, rtol=0, atol=round_off(64, length, scale), err_msg=name)


@settings(max_examples=100)
@given(st.integers(40, 400), st.integers(0, 2**32 - 1), st.sampled_from(["pulse", "step", "offset", "ends"]))
def test_the_correlation_lag_agrees_with_the_twin_on_signals_that_are_mostly_still(
    length: int, seed: int, kind: str
) -> None:
    rate, lag = 100.0, 7
    rng = np.random.default_rng(seed)
    target, measured = np.zeros((2, length))
    if kind == "pulse":
        at = int(rng.integers(lag, length - lag))
        target[at], measured[at + lag - 1] = 1.0, 0.9
    elif kind == "step":
        at = int(rng.integers(lag, length - lag))
        target[at:], measured[at + lag - 1 :] = 1.0, 0.9
    elif kind == "offset":
        target = 1e6 + 1e-2 * rng.standard_normal(length).cumsum()
        measured = np.roll(target, lag) + 3e5
    else:  # what moves in one is cut off at the lags that keep what moves in the other: nothing to correlate
        target[-6:], measured[:6] = rng.standard_normal((2, 6))
    longest = length // 4 / rate
    ours = rthstrack.indices(target, measured, rate, max_lag_s=longest).j1_s

    def correlation(seconds: float) -> float:
        k = round(seconds * rate)
        i, o = (target[: length - k], measured[k:]) if k >= 0 else (target[-k:], measured[: length + k])
        assert np.ptp(i) > 0
        assert np.ptp(o) > 0
        return float(np.corrcoef(i, o)[0, 1])

    # Lags of equal correlation are equally right.
    best = correlation(twin.correlation_lag(target, measured, rate, longest))
    assert_allclose(correlation(ours), best, rtol=0, atol=physical(1e-6, "relative"))
