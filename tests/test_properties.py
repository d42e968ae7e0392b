"""What must hold whatever the record: laws of the method, checked on made-up records by the hundred."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from numpy.typing import NDArray

import rthstrack
import tracking_twin as twin
from published import published, published_evaluator, published_moving
from tolerances import EXACT, physical, round_off

RATE = 256.0
seeds = st.integers(0, 2**32 - 1)
powers = st.sampled_from([1, 2, 3, 4])
gains = st.floats(0.01, 100.0)
windows = st.sampled_from(["boxcar", "hann", "hamming", "blackman", "flattop", "tukey"])
detrends = st.sampled_from(["none", "mean", "linear"])
decimations = st.sampled_from(
    [{}, {"data_decimation": 4}, {"frequency_decimation": 4}, {"data_decimation": 4, "decimator": "chebyshev"}]
)


def noise(shape: int | tuple[int, int], seed: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).standard_normal(shape)


def numbers(result: Any) -> dict[str, Any]:
    """The arrays and numbers of a result by name, without its settings."""
    fields = {field.name: getattr(result, field.name) for field in dataclasses.fields(result)}
    fields = {name: np.array(v) if name.endswith(("_interval", "_interval_s")) else v for name, v in fields.items()}
    return {name: value for name, value in fields.items() if isinstance(value, float | int | complex | np.ndarray)}


def assert_same_bits(a: Any, b: Any) -> None:
    """Equal to the last bit, NaN where NaN."""
    ours, theirs = numbers(a), numbers(b)
    assert ours.keys() == theirs.keys()
    for name, value in ours.items():
        assert_allclose(value, theirs[name], rtol=EXACT, atol=EXACT, equal_nan=True, err_msg=name)


def column(result: Any, j: int) -> dict[str, Any]:
    """What a result of several actuators says of number `j`."""
    picked = {}
    for name, value in numbers(result).items():
        per_actuator = isinstance(value, np.ndarray) and name not in ("time_s", "frequency_hz")
        if per_actuator:
            # The ends of an interval stand last.
            value = value[..., j, :] if name.endswith(("_interval", "_interval_s")) else value[..., j]
        picked[name] = value
    return picked


# --- recovery -------------------------------------------------------------------------------------------------------


@given(seeds, st.integers(64, 1200), gains, powers, windows, detrends, decimations)
def test_a_pure_gain_is_recovered_with_no_delay(
    seed: int, length: int, gain: float, power: int, window: str, detrend: str, decimation: dict[str, Any]
) -> None:
    target = noise(length, seed)
    r = published(target, gain * target, RATE, weight_power=power, window=window, detrend=detrend, **decimation)
    assert_allclose(r.amplitude, gain, rtol=round_off(16, length), atol=0)
    assert_allclose(r.phase_rad, 0.0, rtol=0, atol=round_off(16, length))
    assert_allclose(r.delay_s, 0.0, rtol=0, atol=round_off(16, length, 1 / r.equivalent_frequency_hz))


@given(seeds, st.integers(64, 1200))
def test_a_reversed_sensor_reads_half_a_turn(seed: int, length: int) -> None:
    target = noise(length, seed)
    r = published(target, -target, RATE)
    assert_allclose(r.amplitude, 1.0, rtol=round_off(16, length), atol=0)
    assert_allclose(abs(r.phase_rad), math.pi, rtol=round_off(16, length), atol=0)


@given(st.integers(6, 12), gains, st.floats(-0.95, 0.95), st.floats(0, 6.3), powers, st.data())
def test_a_sine_gives_back_gain_and_fractional_delay_up_to_half_a_turn(
    log_length: int, gain: float, half_turns: float, start: float, power: int, data: st.DataObject
) -> None:
    n = 2**log_length
    line = data.draw(st.integers(1, n // 2 - 1))
    t = np.arange(n) / RATE
    f = line * RATE / n
    delay = half_turns / (2 * f)
    target = np.sin(2 * np.pi * f * t + start)
    measured = gain * np.sin(2 * np.pi * f * (t - delay) + start)
    r = published(target, measured, RATE, weight_power=power, band_hz=(f, f))
    assert r.n_bins == 1
    assert_allclose(r.equivalent_frequency_hz, f, rtol=round_off(4, 1), atol=0)
    assert_allclose(r.amplitude, gain, rtol=round_off(64, n), atol=0)
    assert_allclose(r.phase_rad, -math.pi * half_turns, rtol=0, atol=round_off(64, n))
    assert_allclose(r.delay_s, delay, rtol=0, atol=round_off(64, n, 1 / f))


@given(seeds, st.integers(5, 11), gains, st.floats(-0.01, 0.01), powers, st.sampled_from([1, 2, 4]))
def test_a_circular_fractional_delay_gives_the_weighted_mean_of_its_phasors(
    seed: int, log_length: int, gain: float, delay: float, power: int, P: int
) -> None:
    # A record of 2^m samples whose spectrum is chosen: O_k = K exp(-i 2 pi f_k tau) I_k holds in every bin but Nyquist.
    n = 2**log_length
    rng = np.random.default_rng(seed)
    f = np.arange(n // 2 + 1) * RATE / n
    I_k = rng.standard_normal(n // 2 + 1) + 1j * rng.standard_normal(n // 2 + 1)
    I_k[[0, -1]] = 0
    turn = np.exp(-2j * np.pi * f * delay)
    target, measured = np.fft.irfft(I_k, n), np.fft.irfft(gain * turn * I_k, n)
    r = published(target, measured, RATE, weight_power=power, data_decimation=P)
    kept = slice(1, n // 2 // P + 1)
    weight = np.abs(I_k[kept]) ** power
    weight /= weight.sum()
    tolerance = round_off(64, n) if P == 1 else physical(1e-6, "relative")
    assert_allclose(r.fei, gain * np.sum(turn[kept] * weight), rtol=0, atol=tolerance * gain)
    assert_allclose(r.equivalent_frequency_hz, np.sum(f[kept] * weight), rtol=tolerance, atol=0)


@given(st.floats(-0.02, 0.02).filter(lambda d: abs(d) > 1e-4), st.floats(0.5, 2.0))
def test_a_narrow_band_delay_is_recovered_within_the_methods_own_error(delay: float, gain: float) -> None:
    t = np.arange(4096) / RATE
    envelope = np.exp(-(((t - 8) / 2.5) ** 2))
    late = np.exp(-(((t - delay - 8) / 2.5) ** 2))
    target = envelope * np.sin(2 * np.pi * 2 * t)
    measured = gain * late * np.sin(2 * np.pi * 2 * (t - delay))
    r = published(target, measured, RATE)
    assert_allclose(r.delay_s, delay, rtol=0, atol=physical(0.01, "%") * abs(delay) + physical(1e-3, "us"))
    assert_allclose(r.amplitude, gain, rtol=physical(0.1, "%"), atol=0)


# --- signs ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("delay", "sign"), [(0.02, 1), (-0.02, -1)], ids=["lag", "lead"])
def test_every_signed_quantity_is_positive_on_lag_and_negative_on_lead(delay: float, sign: int) -> None:
    t = np.arange(4096) / RATE  # 32 whole cycles
    target, measured = np.sin(2 * np.pi * 2 * t), np.sin(2 * np.pi * 2 * (t - delay))
    spring = 3.0 * measured

    whole = published(target, measured, RATE)
    assert_allclose(whole.delay_s, delay, rtol=physical(1, "%"))
    assert math.copysign(1, whole.phase_rad) == -sign
    assert math.copysign(1, whole.fei.imag) == -sign

    moving = published_moving(target, measured, RATE, window_s=4.0, hop_s=1.0, window="hann")
    assert moving.valid.all()
    assert_allclose(moving.delay_s, delay, rtol=physical(5, "%"))
    assert (np.sign(moving.phase_rad) == -sign).all()

    response = rthstrack.frequency_response(target, measured, RATE)
    peak = int(np.argmax(response.target_psd))
    assert_allclose(response.frequency_hz[peak], 2.0, rtol=0, atol=physical(0.2, "Hz"))
    assert_allclose(response.delay_s[peak], delay, rtol=physical(5, "%"))
    assert math.copysign(1, response.phase_rad[peak]) == -sign

    indices = rthstrack.indices(target, measured, RATE, force=spring)
    # 32 loops, each of area pi sin(phase): (A - TA)/2 is that area.
    loops = 32 * math.pi * math.sin(2 * math.pi * 2 * delay)
    assert_allclose(indices.tracking_indicator, loops, rtol=physical(2, "%"))
    # A lagging spring seems to have given more energy than it did: its work over measured is nil, over target negative.
    assert indices.energy_error is not None
    assert_allclose(indices.energy_error, 3.0 * loops, rtol=physical(2, "%"))
    assert_allclose(indices.j1_s, delay, rtol=0, atol=physical(0.5 / RATE, "s"))

    histories = rthstrack.index_histories(target, measured, RATE, force=spring)
    assert histories.energy_error is not None
    assert math.copysign(1, histories.tracking_indicator[-1]) == sign
    assert math.copysign(1, histories.energy_error[-1]) == sign


@given(seeds, st.integers(64, 1200), windows, detrends, powers, st.sampled_from([1, 4]), st.sampled_from([1, 4]))
def test_time_run_backwards_turns_lag_into_lead(
    seed: int, length: int, window: str, detrend: str, power: int, P: int, Q: int
) -> None:
    target, measured = noise((2, length), seed)
    measured = measured + np.roll(target, 3)
    kw: dict[str, Any] = {
        "window": window,
        "detrend": detrend,
        "weight_power": power,
        "data_decimation": P,
        "frequency_decimation": Q,
    }
    forwards = published(target, measured, RATE, **kw)
    backwards = published(target[::-1], measured[::-1], RATE, **kw)
    tolerance = physical(1e-9 if P == 1 else 1e-6, "relative")
    assert_allclose(backwards.fei, np.conj(forwards.fei), rtol=tolerance, atol=0)
    assert_allclose(backwards.equivalent_frequency_hz, forwards.equivalent_frequency_hz, rtol=tolerance, atol=0)


# --- scaling and order ----------------------------------------------------------------------------------------------


@given(seeds, st.integers(64, 1200), gains, gains, powers, decimations, windows, detrends)
def test_scaling_either_signal_scales_the_amplitude_and_leaves_the_delay(
    seed: int, length: int, a: float, b: float, power: int, decimation: dict[str, Any], window: str, detrend: str
) -> None:
    target, measured = noise((2, length), seed)
    measured = measured + np.roll(target, 1)
    kw: dict[str, Any] = {"weight_power": power, "window": window, "detrend": detrend, **decimation}
    plain = published(target, measured, RATE, **kw)
    scaled = published(a * target, b * measured, RATE, **kw)
    tolerance = physical(1e-9 if "data_decimation" not in decimation else 1e-6, "relative")
    assert_allclose(scaled.fei, plain.fei * b / a, rtol=tolerance, atol=0)
    assert_allclose(scaled.equivalent_frequency_hz, plain.equivalent_frequency_hz, rtol=tolerance, atol=0)
    delay_of_one_radian = 1 / (2 * math.pi * plain.equivalent_frequency_hz)
    assert_allclose(scaled.delay_s, plain.delay_s, rtol=tolerance, atol=tolerance * delay_of_one_radian)


@given(seeds, st.integers(64, 600), st.permutations(range(4)), decimations, windows)
def test_exchanging_actuators_exchanges_their_results(
    seed: int, length: int, order: list[int], decimation: dict[str, Any], window: str
) -> None:
    target = noise((length, 4), seed)
    measured = 0.3 * noise((length, 4), seed + 1) + np.roll(target, 2, axis=0)
    kw: dict[str, Any] = {"window": window, **decimation}
    straight = published(target, measured, RATE, **kw)
    permuted = published(target[:, order], measured[:, order], RATE, **kw)
    for j, source in enumerate(order):
        for name, value in column(permuted, j).items():
            assert np.array_equal(value, column(straight, source)[name], equal_nan=True), name


@given(seeds, st.integers(64, 600), st.integers(1, 5), decimations, windows, detrends, powers)
def test_several_actuators_in_one_call_are_each_evaluated_as_if_alone(
    seed: int, length: int, n: int, decimation: dict[str, Any], window: str, detrend: str, power: int
) -> None:
    target = noise((length, n), seed)
    measured = 0.3 * noise((length, n), seed + 1) + np.roll(target, 2, axis=0)
    kw: dict[str, Any] = {"window": window, "detrend": detrend, "weight_power": power, **decimation}
    together = published(target, measured, RATE, weights=True, **kw)
    assert np.shape(together.amplitude) == (n,)
    for j in range(n):
        alone = published(target[:, j].copy(), measured[:, j].copy(), RATE, weights=True, **kw)
        for name, value in numbers(alone).items():
            assert np.array_equal(value, column(together, j)[name], equal_nan=True), name


@given(seeds, st.integers(200, 600), st.integers(1, 3), st.sampled_from([1, 2]))
def test_several_actuators_in_moving_windows_are_each_evaluated_as_if_alone(
    seed: int, length: int, n: int, P: int
) -> None:
    target = noise((length, n), seed)
    measured = 0.3 * noise((length, n), seed + 1) + np.roll(target, 2, axis=0)
    kw: dict[str, Any] = {"window_s": 0.4, "hop_s": 0.1, "window": "hann", "data_decimation": P}
    together = published_moving(target, measured, RATE, **kw)
    for j in range(n):
        alone = published_moving(target[:, j].copy(), measured[:, j].copy(), RATE, **kw)
        for name, value in numbers(alone).items():
            assert np.array_equal(value, column(together, j)[name], equal_nan=True), name


# --- what P, Q and the weights are ----------------------------------------------------------------------------------


@given(seeds, st.integers(64, 1200), st.sampled_from([1, 2, 4, 8, 16]), windows, detrends)
def test_folding_the_record_selects_every_qth_bin(seed: int, length: int, Q: int, window: str, detrend: str) -> None:
    target, measured = noise((2, length), seed)
    kw: dict[str, Any] = {"window": window, "detrend": detrend, "weights": True}
    full = published(target, measured, RATE, **kw)
    folded = published(target, measured, RATE, frequency_decimation=Q, **kw)
    assert folded.n_bins == full.n_bins // Q
    for name in ("frequency_hz", "target_spectrum", "measured_spectrum"):
        every, selected = getattr(full, name), getattr(folded, name)
        scale = float(np.max(np.abs(every)))
        assert_allclose(selected, every[Q - 1 :: Q], rtol=0, atol=round_off(16, length, scale), err_msg=name)


@given(seeds, st.integers(64, 1200), st.sampled_from([2, 4, 8]), windows)
def test_the_bins_of_p_are_the_lowest_of_the_whole_transform(seed: int, length: int, P: int, window: str) -> None:
    target, measured = noise((2, length), seed)
    full = published(target, measured, RATE, window=window, weights=True)
    limited = published(target, measured, RATE, window=window, data_decimation=P, weights=True)
    assert limited.n_bins == full.n_bins // P
    for name in ("frequency_hz", "target_spectrum", "measured_spectrum"):
        every, selected = getattr(full, name), getattr(limited, name)
        scale = float(np.max(np.abs(every)))
        assert_allclose(
            selected, every[: limited.n_bins], rtol=0, atol=physical(1e-6, "relative") * scale, err_msg=name
        )


@given(seeds, st.integers(4, 1200), powers)
def test_weights_sum_to_one_and_make_fei_and_f_eq(seed: int, length: int, power: int) -> None:
    target, measured = noise((2, length), seed)
    r = published(target, measured, RATE, weight_power=power, weights=True)
    assert r.weights is not None
    assert r.frequency_hz is not None
    assert r.target_spectrum is not None
    assert r.measured_spectrum is not None
    assert r.frequency_hz[0] > 0
    assert r.frequency_hz[-1] == RATE / 2
    assert_allclose(r.weights.sum(), 1.0, rtol=round_off(4, length), atol=0)
    assert_allclose(
        np.sum(r.weights * r.measured_spectrum / r.target_spectrum), r.fei, rtol=physical(1e-9, "relative"), atol=0
    )
    assert_allclose(np.sum(r.weights * r.frequency_hz), r.equivalent_frequency_hz, rtol=round_off(4, length), atol=0)
    assert_allclose(r.amplitude, abs(r.fei), rtol=round_off(4, 1), atol=0)
    assert_allclose(r.phase_rad, math.atan2(r.fei.imag, r.fei.real), rtol=round_off(4, 1), atol=0)
    assert_allclose(r.delay_s, -r.phase_rad / (2 * math.pi * r.equivalent_frequency_hz), rtol=round_off(4, 1), atol=0)


@given(seeds, st.integers(4, 3000), st.floats(-3, 3), st.floats(-3, 3))
def test_parsevals_theorem_gives_the_real_part_without_a_transform(
    seed: int, length: int, offset: float, other: float
) -> None:
    target, measured = noise((2, length), seed) + np.array([[offset], [other]])
    # A target of next to nothing but its mean leaves the sums too little to divide by.
    total = float(np.sum(target**2))
    without_mean = total - target.sum() ** 2 / 2 ** math.ceil(math.log2(length))
    r = published(target, measured, RATE)
    scale = math.sqrt(total * float(np.sum(measured**2))) / without_mean
    assert_allclose(r.fei.real, twin.parseval_real_fei(target, measured), rtol=0, atol=round_off(16, length, scale))


@given(seeds, st.integers(65, 1024), powers, st.sampled_from([1, 4]))
def test_zeros_appended_up_to_the_power_of_two_change_nothing(seed: int, length: int, power: int, Q: int) -> None:
    target, measured = noise((2, length), seed)
    n = 2 ** math.ceil(math.log2(length))
    padded = np.zeros((2, n))
    padded[:, :length] = target, measured
    kw: dict[str, Any] = {"weight_power": power, "frequency_decimation": Q}
    a, b = published(target, measured, RATE, **kw), published(*padded, RATE, **kw)
    assert a.n_bins == b.n_bins
    assert_allclose(a.fei, b.fei, rtol=physical(1e-9, "relative"), atol=0)
    assert_allclose(a.equivalent_frequency_hz, b.equivalent_frequency_hz, rtol=physical(1e-9, "relative"), atol=0)


@given(seeds, st.integers(64, 600), st.floats(0.5, 2000.0))
def test_the_rate_only_stretches_time(seed: int, length: int, rate: float) -> None:
    target, measured = noise((2, length), seed)
    one, other = published(target, measured, 1.0), published(target, measured, rate)
    assert other.fei == one.fei
    assert_allclose(other.equivalent_frequency_hz, rate * one.equivalent_frequency_hz, rtol=round_off(8, length))
    assert_allclose(other.delay_s, one.delay_s / rate, rtol=round_off(8, length))


# --- plans ----------------------------------------------------------------------------------------------------------


@given(seeds, st.integers(64, 1200), decimations, windows, detrends, powers)
def test_a_plan_used_again_gives_the_same_bits_as_a_call_of_its_own(
    seed: int, length: int, decimation: dict[str, Any], window: str, detrend: str, power: int
) -> None:
    kw: dict[str, Any] = {"window": window, "detrend": detrend, "weight_power": power, **decimation}
    evaluator = published_evaluator(length, RATE, **kw)
    pairs = [tuple(noise((2, length), seed + i)) for i in range(3)]
    first = [evaluator.evaluate(*pair) for pair in pairs]
    again = [evaluator.evaluate(*pair) for pair in reversed(pairs)][::-1]
    for pair, a, b in zip(pairs, first, again, strict=True):
        assert_same_bits(a, b)
        assert_same_bits(a, published(*pair, RATE, **kw))


def test_evaluating_does_not_touch_the_callers_arrays() -> None:
    target, measured = noise((2, 500), 1)
    target.flags.writeable = measured.flags.writeable = False
    kept = target.copy(), measured.copy()
    for kw in (
        {"window": "hann", "detrend": "linear"},
        {"data_decimation": 4},
        {"data_decimation": 4, "decimator": "chebyshev"},
    ):
        published(target, measured, RATE, **kw)
    published_moving(target, measured, RATE, window_s=0.5, hop_s=0.1, detrend="mean")
    rthstrack.frequency_response(target, measured, RATE)
    rthstrack.indices(target, measured, RATE)
    rthstrack.index_histories(target, measured, RATE)
    assert np.array_equal(target, kept[0])
    assert np.array_equal(measured, kept[1])


def test_the_latest_plans_are_kept_up_to_so_many_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    from rthstrack.evaluation import tracking

    monkeypatch.setattr(tracking, "_MOST_PLANNED", 1000)
    monkeypatch.setattr(tracking, "_plans", type(tracking._plans)())
    chosen = rthstrack.Settings()
    first, second = tracking._plan(400, RATE, chosen), tracking._plan(500, RATE, chosen)
    assert tracking._plan(1001, RATE, chosen) is not tracking._plan(1001, RATE, chosen)
    assert tracking._plan(400, RATE, chosen) is first
    tracking._plan(300, RATE, chosen)  # in place of the one that was not asked for the longest
    assert [n for n, *_ in tracking._plans] == [400, 300]
    assert tracking._plan(500, RATE, chosen) is not second


@settings(max_examples=20)
@given(seeds)
def test_threads_share_a_plan_and_get_the_same_bits(seed: int) -> None:
    from concurrent.futures import ThreadPoolExecutor

    evaluator = published_evaluator(2000, RATE, window="hann")
    pairs = [tuple(noise((2, 2000), seed + i)) for i in range(16)]
    alone = [evaluator.evaluate(*pair) for pair in pairs]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda pair: evaluator.evaluate(*pair), pairs))
    for a, b in zip(alone, together, strict=True):
        assert_same_bits(a, b)
