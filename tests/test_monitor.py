"""The monitor's binding; what it computes is held to the batch evaluation."""

from __future__ import annotations

import numpy as np
import pytest

import rthstrack
from rthstrack.errors import SettingError, SignalError

RATE_HZ = 512.0


def motion(t):
    return np.sin(9 * t) + 0.3 * np.sin(23 * t + 1) + 0.2 * np.cos(41 * t)


@pytest.fixture(scope="module")
def signals():
    rng = np.random.default_rng(5)
    t = np.arange(8192) / RATE_HZ
    return motion(t), 0.95 * motion(t - 0.020) + 0.01 * rng.standard_normal(t.size)


def causally_decimated(x, factor):
    """By the formula: Kaiser-windowed sinc of 16 P + 1 taps, beta 12.5, at every P-th sample for which it is full."""
    j = np.arange(16 * factor + 1)
    h = np.sinc((j - 8 * factor) / factor) * np.kaiser(16 * factor + 1, 12.5)
    return np.convolve(x, h / h.sum(), mode="valid")[::factor]


@pytest.mark.parametrize("factor", [2, 4, 16])
def test_the_causal_decimator_follows_its_formula(signals, factor):
    y, delay = rthstrack.causal_decimate(signals[0], factor)
    np.testing.assert_allclose(y, causally_decimated(signals[0], factor), rtol=0, atol=1e-13)
    assert delay == 8 * factor


@pytest.mark.parametrize("estimator", ["fei", "least_squares", "aligned"])
def test_readings_are_those_of_evaluate_on_the_decimated_window(signals, estimator):
    P, W, hop = 4, 256, 32
    monitor = rthstrack.Monitor(
        RATE_HZ, 2.0, 4.0, band_hz=(0.2, 24), estimator=estimator, data_decimation=P, detrend="mean"
    )
    readings = monitor.process(*signals)
    x, y = (causally_decimated(s, P) for s in signals)
    settings = {"estimator": estimator, "band_hz": (0.2, 24), "detrend": "mean"}
    assert len(readings) == (x.size - W) // hop + 1
    for k in range(len(readings)):
        start = k * hop
        if estimator == "fei":
            expected = rthstrack.evaluate(x[start : start + W], y[start : start + W], RATE_HZ / P, **settings)
            amplitude, delay_s, low = expected.amplitude, expected.delay_s, np.nan
        elif start:
            moving = rthstrack.evaluate_moving(
                x[: start + W],
                y[: start + W],
                RATE_HZ / P,
                window_s=W * P / RATE_HZ,
                hop_s=start * P / RATE_HZ,
                **settings,
            )
            amplitude, delay_s = moving.amplitude[-1], moving.delay_s[-1]
            low = moving.delay_interval_s[-1, 0]
        else:
            continue
        assert readings.amplitude[k] == pytest.approx(amplitude, rel=1e-9)
        assert readings.delay_s[k] == pytest.approx(delay_s, rel=1e-9)
        assert readings.delay_interval_s[k, 0] == pytest.approx(low, rel=1e-9, nan_ok=True)
        assert readings.index[k] == (start + W - 1) * P + 16 * P
        assert readings.centre_s[k] == pytest.approx(((start + (W - 1) / 2) * P + 8 * P) / RATE_HZ, rel=1e-12)
        assert readings.time_s[k] - readings.centre_s[k] == pytest.approx(monitor.age_s, rel=1e-12)


def test_actuators_are_rows_of_their_own_and_splits_change_nothing(signals):
    x, y = signals
    both = np.stack([x, x[::-1]], axis=1), np.stack([y, 2 * x[::-1]], axis=1)
    make = lambda n: rthstrack.Monitor(RATE_HZ, 2.0, 8.0, band_hz=(0, 32), data_decimation=None, n_actuators=n)  # noqa: E731
    whole = make(2).process(*both)
    alone = make(1).process(x, y)
    assert list(whole.actuator[:4]) == [0, 1, 0, 1]
    assert np.array_equal(whole.amplitude[::2], alone.amplitude)
    assert whole.amplitude[1::2] == pytest.approx(2.0, rel=1e-9)
    monitor, found = make(2), []
    for first in range(0, len(x), 77):
        until = monitor.samples_until_reading
        part = monitor.process(*(s[first : first + 77] for s in both))
        assert (len(part) > 0) == (until <= len(x[first : first + 77]))
        found.append(part.amplitude)
    assert np.array_equal(np.concatenate(found), whole.amplitude)
    assert len(whole.to_frame()) == len(whole)


def test_single_samples_are_taken_and_a_gap_is_told(signals):
    monitor = rthstrack.Monitor(RATE_HZ, 1.0, 8.0)
    rows = [
        monitor.process(x if i != 900 else np.nan, y) for i, (x, y) in enumerate(zip(*signals, strict=True)) if i < 2000
    ]
    rows = [r for r in rows if len(r)]
    for r in rows:
        holds = 900 <= r.index[0] < 900 + RATE_HZ
        assert r.valid[0] != holds
        assert r.reason[0] == ("not determined: the window holds samples that are NaN or infinite" if holds else "")


def test_after_a_restart_it_counts_from_the_given_index(signals):
    monitor = rthstrack.Monitor(RATE_HZ, 1.0, 8.0)
    first = monitor.process(*(s[:1000] for s in signals))
    monitor.restart(5000)
    again = monitor.process(*(s[:1000] for s in signals))
    assert np.array_equal(first.index + 5000, again.index)
    assert np.array_equal(first.amplitude, again.amplitude)


@pytest.mark.parametrize("index", [-1, 1.5, 1 << 63, "5", None, True, np.nan])
def test_an_index_that_cannot_be_is_refused(index):
    monitor = rthstrack.Monitor(RATE_HZ)
    with pytest.raises(SettingError, match=r"^index must be a whole number from 0 on, not "):
        monitor.restart(index)
    monitor.restart(np.int64(7))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rate_hz": 0}, "rate_hz must be a positive frequency in hertz, not 0"),
        ({"window_s": 1e12}, "window_s must be from"),
        ({"update_hz": 1e6}, "update_hz must be above 0 and at most 512 Hz"),
        ({"estimator": "best"}, "estimator must be one of fei, aligned, least_squares, not 'best'"),
        ({"data_decimation": 3}, "data_decimation must be a power of two"),
        ({"band_hz": (0, 200), "data_decimation": 4}, "band_hz must be at most 32 Hz at its upper end"),
        ({"n_actuators": 0}, "n_actuators must be a whole number from 1"),
        ({"expected_delay_s": "soon"}, "expected_delay_s must be a finite number in seconds"),
    ],
)
def test_settings_that_cannot_be_are_refused(change, message):
    with pytest.raises(SettingError, match="^" + message.replace("(", "[(]")):
        rthstrack.Monitor(**({"rate_hz": RATE_HZ} | change))


def test_another_shape_is_refused():
    monitor = rthstrack.Monitor(RATE_HZ, n_actuators=2)
    with pytest.raises(SignalError, match=r"must both have the shape \(n_samples, 2\), not \(5,\) and \(5,\)"):
        monitor.process(np.zeros(5), np.zeros(5))
