"""The warnings a good engineer would give, each on a signal made to deserve it, and none on one that does not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rthstrack

RATE, N = 256.0, 256 * 60
T = np.arange(N) / RATE


def response(delay_s: float = 0.0, f_hz: float = 1.0) -> np.ndarray:
    t = T - delay_s
    return np.sin(2 * np.pi * f_hz * t) * np.exp(-((t - 25) ** 2) / 120) * 10


def narrow_noise() -> np.ndarray:
    """Noise of unit standard deviation between 0.7 and 1.5 Hz, where the response is."""
    f = np.fft.rfftfreq(N, 1 / RATE)
    noise = np.fft.irfft(np.fft.rfft(np.random.default_rng(1).standard_normal(N)) * ((f > 0.7) & (f < 1.5)), N)
    return noise / noise.std()


def warned(target: np.ndarray, measured: np.ndarray, **options: Any) -> str:
    """All that is said beside the published average: the argument, and the warnings that it does not say itself."""
    settings = options.pop("settings", rthstrack.Settings(estimator="fei"))
    assessment = rthstrack.assess(target, measured, RATE, settings=settings, **options)
    return "\n".join((assessment.argument, *assessment.warnings))


def test_a_plain_lag_deserves_no_warning() -> None:
    assessment = rthstrack.assess(response(), 0.99 * response(0.01), RATE, unit="mm", measured_unit="mm")
    assert assessment.warnings == ()


@pytest.mark.parametrize(
    ("words", "target", "measured"),
    [
        ("an offset", response() + 8, response(0.01) + 8),
        ("residual displacement", response() + 8 * (T > 25), response(0.01) + 8 * (T > 25.01)),
        ("above", response() + 1.5 * np.sin(2 * np.pi * 40 * T), response(0.01)),
        ("half a cycle", response(), -response(0.01)),
        ("opposite sign", response(), -response(0.01)),
        ("coherence", response(), response(0.01) + 6 * narrow_noise()),
        ("distinct values", np.round(response() / 2), response(0.01)),
        ("clipped", response(), np.clip(response(0.01), -6, 6)),
        ("far from 1", response(), 10 * response(0.01)),
        ("nearly still", response() * (np.abs(T - 25) < 4), response(0.01) * (np.abs(T - 25) < 4)),
    ],
)
def test_each_warning_is_given_where_it_is_due(words: str, target: np.ndarray, measured: np.ndarray) -> None:
    assert words in warned(target, measured)


def test_unlike_units_are_warned_of_with_the_factor() -> None:
    text = warned(response(), response(0.01) / 10, unit="mm", measured_unit="cm")
    assert "unlike units: target is in mm, measured in cm" in text
    assert "--scale 'measured=10'" in text
    assert "unlike units" not in warned(response(), response(0.01), unit="mm", measured_unit=None)


def test_a_delay_that_varies_with_frequency_is_not_one_number() -> None:
    rng = np.random.default_rng(2)
    f = np.fft.rfftfreq(N, 1 / RATE)
    spectrum = np.where((f > 0.5) & (f < 10), np.exp(2j * np.pi * rng.random(f.size)), 0)
    target = np.fft.irfft(spectrum, N)
    lag = np.fft.irfft(spectrum / (1 + 1j * f / 5), N)
    assert "not one number" in warned(target, lag)
    constant = np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * 0.02), N)
    assert "not one number" not in warned(target, constant)


def test_detrending_takes_the_warning_of_an_offset_away() -> None:
    settings = rthstrack.Settings(estimator="fei", detrend="mean")
    assert "offset" not in warned(response() + 8, response(0.01) + 8, settings=settings)


@pytest.mark.parametrize(
    ("delay_s", "amplitude", "expected"),
    [
        (0.0132, 1.018, "measured lags target by 13.2 ms and is 1.8 % too large, judged at 1 Hz"),
        (-0.005, 0.5, "measured leads target by 5 ms and is 50 % too small, judged at 1 Hz"),
        (0.0, 1.0, "measured is in time with target and has the right amplitude, judged at 1 Hz"),
        (0.1, 3.0, "measured lags target by 100 ms and is 3 times as large, judged at 1 Hz"),
    ],
)
def test_the_sentence_says_which_way_and_how_much(delay_s: float, amplitude: float, expected: str) -> None:
    assert rthstrack.assess(response(), amplitude * response(delay_s), RATE).verdict == expected


def test_a_sensor_that_does_not_move_has_no_delay() -> None:
    assessment = rthstrack.assess(response(), np.zeros(N), RATE)
    assert assessment.verdict == "measured does not move: it has no delay"


def test_limits_are_told_only_where_exceeded() -> None:
    def told(**limits: float) -> tuple[str, ...]:
        return rthstrack.assess(response(), 1.1 * response(0.01), RATE, limits=rthstrack.Limits(**limits)).exceeded

    assert told() == told(delay_s=0.0101, amplitude=0.101) == ()
    assert len(told(delay_s=0.0099)) == len(told(amplitude=0.099)) == 1
    assert len(told(delay_s=0.001, amplitude=0.001)) == 2


def test_a_quantised_peak_is_not_taken_for_clipping() -> None:
    slow = np.round(response(0.01, f_hz=0.3) / 0.01) * 0.01
    assert "clipped" not in warned(response(f_hz=0.3), slow)


def test_a_coarsely_quantised_peak_is_not_taken_for_clipping_and_a_clipped_one_is() -> None:
    peak = np.round(response(0.01, f_hz=0.3) / 0.1) * 0.1
    assert "clipped" not in warned(response(f_hz=0.3), peak)
    assert "clipped" in warned(response(f_hz=0.3), np.clip(peak, -7, 7))


def noisy(x: np.ndarray, share: float, seed: int) -> np.ndarray:
    return x + share * x.std() * np.random.default_rng(seed).standard_normal(x.size)


def test_noise_on_the_target_is_told_with_its_level_and_taken_for_the_cause() -> None:
    assessment = rthstrack.assess(noisy(response(), 0.03, 1), noisy(0.95 * response(0.0123), 0.03, 2), RATE)
    (told,) = assessment.warnings
    assert "target contains noise, 3 % of its standard deviation" in told
    assert assessment.trusted.target_noise_std == pytest.approx(0.03 * response().std(), rel=0.05)
    assert "this is the trusted estimate" in assessment.argument
    assert "noise" in assessment.argument
    assert "mean" not in assessment.argument


@pytest.mark.parametrize("levels", [None, 2**16, 2**24])
def test_a_target_as_a_good_converter_writes_it_is_not_called_noisy(levels: int | None) -> None:
    def written(x: np.ndarray) -> np.ndarray:
        return x if levels is None else np.round(x * levels / 40) * 40 / levels

    assert "noise" not in warned(written(response()), written(0.95 * response(0.0123)))


def test_each_number_is_told_its_own_cause() -> None:
    """Noise on the target makes the published delay too short; phases that spread make its amplitude too small."""
    f = np.fft.rfftfreq(N, 1 / RATE)
    rng = np.random.default_rng(3)
    spectrum = np.where((f > 0.5) & (f < 10), np.exp(2j * np.pi * rng.random(f.size)), 0)
    target = np.fft.irfft(spectrum, N)
    late = np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * 0.0123), N)
    argument = rthstrack.assess(noisy(target, 0.03, 4), noisy(late, 0.03, 5), RATE).argument
    assert " ms less, because noise above " in argument
    assert "% less amplitude, because it averages phases from" in argument


@pytest.mark.parametrize(("delay_s", "advice"), [(0.4, "try --max-delay 0.5"), (-0.3, "try --max-delay 0.5")])
def test_a_delay_out_of_reach_is_called_so_with_an_advice_that_works(delay_s: float, advice: str) -> None:
    target, measured = response(f_hz=2.5) + response(f_hz=0.9), response(delay_s, 2.5) + response(delay_s, 0.9)
    said = rthstrack.assess(target, measured, RATE).argument
    assert f"the delay seems to lie beyond max_delay_s, 0.25 s: {advice}" in said
    found = rthstrack.assess(target, measured, RATE, settings=rthstrack.Settings(max_delay_s=0.5)).trusted
    assert found.delay_s == pytest.approx(delay_s, abs=1e-5)


def test_an_inverted_sensor_is_no_delay_that_varies() -> None:
    target, measured = response(f_hz=2.5) + response(f_hz=0.9), -response(0.06, 2.5) - response(0.06, 0.9)
    said = warned(target, measured)
    assert "measured moves against target" in said
    assert "--scale" in said
    assert "not one number" not in said
