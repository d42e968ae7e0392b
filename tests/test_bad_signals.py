"""Bad input: one line that says what was wrong, never a wrong number, a traceback from inside or a silent repair."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

import rthstrack
from published import published, published_evaluator, published_moving
from tolerances import physical

RATE = 100.0
CALLS: dict[str, Callable[..., Any]] = {
    "evaluate": published,
    "evaluate_moving": lambda *a, **k: published_moving(*a, window_s=1.0, hop_s=0.5, **k),
    "frequency_response": rthstrack.frequency_response,
    "indices": rthstrack.indices,
    "index_histories": rthstrack.index_histories,
}
every_call = pytest.mark.parametrize("call", [pytest.param(f, id=name) for name, f in CALLS.items()])
SETTINGS: dict[str, Callable[..., Any]] = {
    "evaluate": published,
    "evaluate_moving": CALLS["evaluate_moving"],
    "Evaluator": lambda target, measured, rate, **k: published_evaluator(len(target), rate, **k),
}
every_setting = pytest.mark.parametrize("call", [pytest.param(f, id=name) for name, f in SETTINGS.items()])


def signals(length: int = 500) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A clean pair: measured is 1.1 times the target two samples later."""
    t = np.arange(length) / RATE
    shape = np.sin(2 * np.pi * 1.3 * t) + 0.4 * np.sin(2 * np.pi * 3.1 * t)
    later = np.sin(2 * np.pi * 1.3 * (t - 0.02)) + 0.4 * np.sin(2 * np.pi * 3.1 * (t - 0.02))
    return shape, 1.1 * later


def refuses(error: type[Exception], words: str, call: Callable[..., Any], *arguments: Any, **keywords: Any) -> str:
    """The call raises `error` with one line in which `words` (a pattern) is found."""
    with pytest.raises(error) as caught:
        call(*arguments, **keywords)
    message = str(caught.value)
    assert isinstance(caught.value, rthstrack.RthstrackError)
    assert isinstance(caught.value, ValueError)
    assert message
    assert "\n" not in message
    assert re.search(words, message), f"{words!r} is not in {message!r}"
    return message


# --- the samples ----------------------------------------------------------------------------------------------------


@every_call
def test_different_lengths_are_refused_with_both_named(call: Callable[..., Any]) -> None:
    target, measured = signals()
    refuses(rthstrack.SignalError, "499.*500|500.*499", call, target, measured[:-1], RATE)
    refuses(rthstrack.SignalError, "499.*500|500.*499", call, target[:-1], measured, RATE)


def test_different_numbers_of_actuators_are_refused() -> None:
    target, measured = signals()
    three, two = np.column_stack([target] * 3), np.column_stack([measured] * 2)
    for call in (published, CALLS["evaluate_moving"]):
        refuses(rthstrack.SignalError, "3.*2|2.*3", call, three, two, RATE)
        refuses(rthstrack.SignalError, "3.*2|2.*3", call, two, three, RATE)
        refuses(rthstrack.SignalError, "measured|shape", call, three, measured, RATE)
        refuses(rthstrack.SignalError, "measured|shape", call, target, two, RATE)


@every_call
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("where", ["target", "measured"])
def test_nan_and_infinity_are_refused_with_their_count_and_the_first_index(
    call: Callable[..., Any], bad: float, where: str
) -> None:
    target, measured = signals()
    spoilt = target if where == "target" else measured
    spoilt[[123, 200, 499]] = bad
    refuses(rthstrack.SignalError, rf"{where}.*\b3\b.*\b123\b", call, target, measured, RATE)
    spoilt[:] = signals()[0]
    spoilt[0] = bad
    refuses(rthstrack.SignalError, rf"{where}.*\b1\b.*\b0\b", call, target, measured, RATE)
    spoilt[0], spoilt[-1] = 0.0, bad
    refuses(rthstrack.SignalError, rf"{where}.*\b1\b.*\b499\b", call, target, measured, RATE)


@pytest.mark.parametrize(
    "setting",
    [
        {},
        {"window": "hann"},
        {"detrend": "linear"},
        {"data_decimation": 8},
        {"data_decimation": 64},
        {"estimator": "fei", "data_decimation": 8, "decimator": "chebyshev"},
        {"frequency_decimation": 16},
        {"estimator": "fei", "weight_power": 1},
        {"estimator": "fei", "weight_power": 3},
        {"band_hz": (1.0, 4.0)},
    ],
    ids=str,
)
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_no_setting_hides_a_bad_sample_wherever_it_is(setting: dict[str, Any], bad: float) -> None:
    clean = signals(2000)
    for index in (0, 1, 2, 3, 500, 999, 1024, 1777, 1998, 1999):
        for i, where in enumerate(("target", "measured")):
            pair = [signal.copy() for signal in clean]
            pair[i][index] = bad
            refuses(rthstrack.SignalError, rf"{where}.*\b1\b.*\b{index}\b", published, *pair, RATE, **setting)


def test_a_bad_sample_of_one_actuator_is_refused_with_the_actuator_named() -> None:
    target, measured = (np.column_stack([signal] * 3) for signal in signals())
    measured[77, 1] = math.nan
    for call in (published, CALLS["evaluate_moving"]):
        refuses(rthstrack.SignalError, r"actuator 2.*\b77\b|\b77\b.*actuator 2", call, target, measured, RATE)


@every_call
@pytest.mark.parametrize("value", [0.0, -0.0, 3.25, -1e9, 1e-300])
def test_a_target_that_never_moves_is_refused(call: Callable[..., Any], value: float) -> None:
    _, measured = signals()
    refuses(rthstrack.SignalError, "target.*constant|constant.*target", call, np.full(500, value), measured, RATE)


@pytest.mark.parametrize("detrend", ["mean", "linear"])
def test_a_target_that_detrending_leaves_nothing_of_is_refused(detrend: str) -> None:
    _, measured = signals()
    straight = 0.1 + 0.3 * np.arange(500.0)
    if detrend == "linear":
        refuses(rthstrack.SignalError, "target", published, straight, measured, RATE, detrend=detrend)
    nearly = np.full(500, 0.1)
    nearly[250] = np.nextafter(0.1, 1)
    refuses(rthstrack.SignalError, "target", published, nearly, measured, RATE, detrend=detrend)


@every_call
@pytest.mark.parametrize("length", [0, 1, 2, 3])
def test_fewer_than_four_samples_are_refused(call: Callable[..., Any], length: int) -> None:
    target, measured = signals(length)
    refuses(rthstrack.SignalError, rf"\b{length}\b.*sample.*\b4\b|\b{length}\b.*sample", call, target, measured, RATE)


def test_four_samples_are_enough() -> None:
    assert published([0.0, 1.0, 0.0, -1.0], [0.0, 1.0, 0.0, -1.0], RATE).amplitude == 1.0


def test_a_sensor_that_reports_nothing_has_no_delay() -> None:
    target, _ = signals()

    def check(r: Any) -> None:
        assert r.amplitude == 0.0
        assert math.isnan(r.delay_s)  # zero would say: perfectly in time
        assert math.isnan(r.phase_rad)

    right_or_refused(lambda: published(target, np.zeros(500), RATE), check, "measured")


# --- the rate -------------------------------------------------------------------------------------------------------


@every_call
@pytest.mark.parametrize("rate", [0.0, -0.0, -100.0, math.nan, math.inf, -math.inf, None, "fast", [100.0], 1j])
def test_a_rate_that_is_no_positive_number_is_refused(call: Callable[..., Any], rate: Any) -> None:
    refuses(rthstrack.SettingError, "rate_hz", call, *signals(), rate)


@every_call
def test_a_missing_rate_is_pythons_own_error(call: Callable[..., Any]) -> None:
    with pytest.raises(TypeError, match="rate_hz"):
        call(*signals())


# --- the settings ---------------------------------------------------------------------------------------------------


@every_setting
@pytest.mark.parametrize("name", ["data_decimation", "frequency_decimation"])
@pytest.mark.parametrize("factor", [0, -1, -2, 3, 6, 12, 1.5, math.nan, "2", None, 2**70])
def test_factors_that_are_no_powers_of_two_are_refused(call: Callable[..., Any], name: str, factor: Any) -> None:
    refuses(rthstrack.SettingError, f"{name}|P|Q", call, *signals(), RATE, **{name: factor})


@every_setting
@pytest.mark.parametrize(
    "setting",
    [
        {"data_decimation": 512},
        {"frequency_decimation": 512},
        {"data_decimation": 32, "frequency_decimation": 16},
        {"data_decimation": 2**40},
        {"frequency_decimation": 2**62},
        {"data_decimation": 2**40, "frequency_decimation": 2**40},
        {"data_decimation": 1024, "decimator": "chebyshev"},
        {"data_decimation": 2**40, "decimator": "chebyshev"},
        {"data_decimation": 64, "frequency_decimation": 64, "decimator": "chebyshev"},
    ],
    ids=str,
)
def test_factors_that_leave_no_bin_are_refused(call: Callable[..., Any], setting: dict[str, Any]) -> None:
    # 500 samples are padded to 512: 256 bins. (A window of one second is padded to 128: 64 bins.)
    refuses(rthstrack.RthstrackError, "P|Q|decimation|sample", call, *signals(), RATE, **setting)


@every_setting
@pytest.mark.parametrize(
    "band",
    [
        (60.0, 80.0),
        (1.001, 1.002),
        (0.0, 0.0),
        (0.0, 1e-9),
        (5.0, 1.0),
        (-1.0, 5.0),
        (math.nan, 5.0),
        (1.0, math.nan),
        (1.0, math.inf),
        (1.0,),
        (1.0, 2.0, 3.0),
        5.0,
        "1 2",
        ("a", "b"),
    ],
    ids=str,
)
def test_bands_that_leave_no_bin_or_are_no_bands_are_refused(call: Callable[..., Any], band: Any) -> None:
    refuses(rthstrack.SettingError, "band", call, *signals(), RATE, band_hz=band)


def test_a_band_above_what_p_keeps_is_refused_with_what_is_kept() -> None:
    message = refuses(
        rthstrack.SettingError, "band", published, *signals(), RATE, data_decimation=8, band_hz=(7.0, 9.0)
    )
    assert "6.25" in message


def test_a_band_includes_both_its_ends() -> None:
    delta_f = RATE / 512
    r = published(*signals(), RATE, band_hz=(3 * delta_f, 9 * delta_f), weights=True)
    assert r.frequency_hz is not None
    assert r.frequency_hz.tolist() == [k * delta_f for k in range(3, 10)]


@every_setting
@pytest.mark.parametrize("name", ["window", "detrend", "decimator", "estimator"])
@pytest.mark.parametrize("word", ["", "Hann ", "nonsense", None, 3, b"hann"])
def test_unknown_words_are_refused_with_the_known_ones(call: Callable[..., Any], name: str, word: Any) -> None:
    if (name, word) == ("detrend", None):
        return  # what suits the estimator
    known = {"window": "flattop", "detrend": "linear", "decimator": "chebyshev", "estimator": "fei"}[name]
    refuses(rthstrack.SettingError, f"{name}.*{known}", call, *signals(), RATE, **{name: word})


@every_setting
@pytest.mark.parametrize("power", [0, -1, 17, 2**40, 1.5, math.nan, "2", None])
def test_weight_powers_out_of_range_are_refused(call: Callable[..., Any], power: Any) -> None:
    refuses(rthstrack.SettingError, "weight_power", call, *signals(), RATE, weight_power=power)


@pytest.mark.parametrize(
    ("name", "value"),
    [(name, value) for name in ("window_s", "hop_s") for value in (0.0, -1.0, math.nan, math.inf, 1e-9, None, "one")]
    + [("window_s", 5.01), ("window_s", 1e300), ("window_s", 0.03)]
    + [("minimum_std_ratio", value) for value in (-0.1, 1.0, math.nan, None)],
)
def test_moving_windows_that_cannot_be_are_refused(name: str, value: Any) -> None:
    setting = {"window_s": 1.0, "hop_s": 0.5, name: value}
    refuses(rthstrack.SettingError, name, published_moving, *signals(), RATE, **setting)


def test_a_window_as_long_as_the_record_gives_one_reading() -> None:
    moving = published_moving(*signals(), RATE, window_s=5.0, hop_s=1e9)
    whole = published(*signals(), RATE)
    assert moving.valid.tolist() == [True]
    assert moving.delay_s.tolist() == [whole.delay_s]


@pytest.mark.parametrize(
    ("name", "value"),
    [("segment_s", value) for value in (0.0, -1.0, math.nan, math.inf, 5.5, 0.05, "one")]
    + [("overlap", value) for value in (-0.1, 1.0, 1.5, math.nan, None)]
    + [("window", "nonsense"), ("detrend", "nonsense")],
)
def test_frequency_response_settings_that_cannot_be_are_refused(name: str, value: Any) -> None:
    refuses(rthstrack.SettingError, name, rthstrack.frequency_response, *signals(), RATE, **{name: value})


@pytest.mark.parametrize("value", [0.0, -0.1, math.nan, math.inf, None, "one"])
def test_a_longest_lag_that_is_no_duration_is_refused(value: Any) -> None:
    refuses(rthstrack.SettingError, "max_lag_s", rthstrack.indices, *signals(), RATE, max_lag_s=value)


def test_a_force_that_does_not_fit_is_refused() -> None:
    target, measured = signals()
    for call in (rthstrack.indices, rthstrack.index_histories):
        refuses(rthstrack.SignalError, "force.*499.*500", call, target, measured, RATE, force=target[:-1])
        broken = target.copy()
        broken[7] = math.nan
        refuses(rthstrack.SignalError, r"force.*\b1\b.*\b7\b", call, target, measured, RATE, force=broken)
        refuses(rthstrack.SignalError, "force", call, target, measured, RATE, force=["a"] * 500)


def test_a_plan_refuses_a_record_of_another_length() -> None:
    evaluator = published_evaluator(400, RATE)
    refuses(rthstrack.RthstrackError, "400.*500|500.*400", evaluator.evaluate, *signals())


@pytest.mark.parametrize("n_samples", [3, 0, -5, 1.5, None, "many", math.nan])
def test_a_plan_for_no_possible_length_is_refused(n_samples: Any) -> None:
    refuses(rthstrack.RthstrackError, "sample", rthstrack.Evaluator, n_samples, RATE)


def test_a_misspelt_setting_is_pythons_own_error() -> None:
    with pytest.raises(TypeError, match="windows"):
        published(*signals(), RATE, windows="hann")  # type: ignore[call-arg]


# --- types and layouts ----------------------------------------------------------------------------------------------


@every_call
@pytest.mark.parametrize(
    "bad",
    [
        np.array(["1.0"] * 500),
        np.array([b"1.0"] * 500),
        np.array([object()] * 500),
        np.array(["2020-01-01"] * 500, dtype="datetime64[D]"),
        np.arange(500) * np.timedelta64(1, "s"),
        np.zeros(500, dtype=[("a", float), ("b", float)]),
        signals()[0] + 0j,
        (signals()[0] + 1j).tolist(),
        [[1.0, 2.0], [3.0]],
        [None] * 500,
        "a string",
        b"bytes",
        7.0,
        None,
        {"a": 1.0},
        np.zeros((5, 10, 10)),
        np.zeros((500, 0)),
        np.zeros((0, 2)),
        {1.0, 2.0, 3.0, 4.0},
    ],
    ids=lambda v: f"{type(v).__name__}-{getattr(v, 'dtype', '')}-{getattr(v, 'shape', '')}",
)
def test_what_is_not_an_array_of_real_numbers_is_refused(call: Callable[..., Any], bad: Any) -> None:
    target, measured = signals()
    refuses(rthstrack.SignalError, "target", call, bad, measured, RATE)
    refuses(rthstrack.SignalError, "measured|target", call, target, bad, RATE)


@pytest.mark.parametrize("name", ["frequency_response", "indices", "index_histories"])
def test_calls_for_one_pair_refuse_several_actuators(name: str) -> None:
    target, measured = (np.column_stack([signal] * 2) for signal in signals())
    refuses(rthstrack.SignalError, "one|1", CALLS[name], target, measured, RATE)


@every_call
def test_masked_samples_are_not_silently_used(call: Callable[..., Any]) -> None:
    target, measured = signals()
    masked = np.ma.masked_array(measured, mask=np.zeros(500, dtype=bool))
    masked[10:13] = np.ma.masked
    refuses(rthstrack.SignalError, r"measured.*\b3\b.*\b10\b", call, target, masked, RATE)


def _same(a: Any, b: Any) -> None:
    for name in a.__dataclass_fields__:
        x, y = getattr(a, name), getattr(b, name)
        if isinstance(x, np.ndarray | float | complex | int):
            assert np.array_equal(x, y, equal_nan=np.asarray(x).dtype.kind in "fc"), name


def _strided(x: NDArray[np.float64]) -> NDArray[np.float64]:
    wide = np.zeros((len(x), 3))
    wide[:, 1] = x
    return wide[:, 1]


LAYOUTS: dict[str, Callable[[NDArray[np.float64]], Any]] = {
    "strided": _strided,
    "reversed twice": lambda x: x[::-1].copy()[::-1],
    "read-only": lambda x: np.frombuffer(x.tobytes()),
    "big-endian": lambda x: x.astype(">f8"),
    "unaligned": lambda x: np.frombuffer(b"\0" + x.tobytes(), dtype=np.uint8)[1:].view(np.float64),
    "list": lambda x: x.tolist(),
    "tuple": lambda x: tuple(x.tolist()),
    "pandas": pd.Series,
    "unmasked": np.ma.masked_array,
    "long double": lambda x: x.astype(np.longdouble),
    "column of one": lambda x: np.asfortranarray(x),
}


@every_call
@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_any_layout_of_the_same_numbers_gives_the_same_bits(
    call: Callable[..., Any], layout: Callable[[NDArray[np.float64]], Any]
) -> None:
    target, measured = signals()
    _same(call(layout(target), layout(measured), RATE), call(target, measured, RATE))


@every_call
@pytest.mark.parametrize("dtype", ["float32", "float16", "int8", "int16", "int64", "uint8", ">i4", ">f4"])
def test_other_number_types_count_as_the_numbers_they_hold(call: Callable[..., Any], dtype: str) -> None:
    target, measured = ((40 * signal + 100).astype(dtype) for signal in signals())
    _same(call(target, measured, RATE), call(target.astype(float), measured.astype(float), RATE))


def test_whole_numbers_in_a_list_are_numbers() -> None:
    target = [0, 3, 5, 2, -4, -6, -1, 4]
    _same(published(target, target[::-1], 8), published(np.array(target, float), target[::-1], 8.0))


def test_several_actuators_may_come_in_any_layout() -> None:
    target, measured = (np.column_stack([s, 2 * s, s**2]) for s in signals())
    plain = published(target, measured, RATE)
    for layout in (
        np.asfortranarray,
        lambda x: np.repeat(x, 2, axis=1)[:, ::2],
        lambda x: x.astype(">f8"),
        lambda x: x.tolist(),
        pd.DataFrame,
    ):
        _same(published(layout(target), layout(measured), RATE), plain)


def test_one_actuator_as_a_matrix_gives_arrays_of_one() -> None:
    target, measured = signals()
    r = published(target[:, None], measured[:, None], RATE)
    assert np.shape(r.amplitude) == (1,)
    assert np.asarray(r.amplitude)[0] == published(target, measured, RATE).amplitude


# --- sizes ----------------------------------------------------------------------------------------------------------

SCALES = [1e-320, 1e-310, 1e-200, 1e-160, 1e-150, 1e-120, 1e-100, 1e100, 1e120, 1e150, 1e160, 1e200, 1e300, 1e307]


def right_or_refused(
    call: Callable[[], Any], check: Callable[[Any], None], words: str = "range|rescale|precision|energy"
) -> None:
    """Either the right numbers, or one line that says that the samples are the matter."""
    message = None
    try:
        result = call()
    except rthstrack.SignalError as error:
        message = str(error)
    if message is None:
        check(result)
    else:
        assert re.fullmatch(f".*({words}).*", message), message


@pytest.mark.parametrize("power", [1, 2, 3, 16])
@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("setting", [{}, {"data_decimation": 4}, {"detrend": "linear", "window": "hann"}], ids=str)
def test_huge_and_tiny_signals_are_right_or_refused(power: int, scale: float, setting: dict[str, Any]) -> None:
    target, measured = signals()
    ordinary = published(target, measured, RATE, weight_power=power, **setting)
    # In the subnormal range the samples themselves are rounded.
    tolerance = physical(1e-6, "relative") if scale > 1e-300 else physical(1, "%")

    def check(r: Any) -> None:
        assert_allclose(r.fei, ordinary.fei, rtol=tolerance)
        assert_allclose(r.equivalent_frequency_hz, ordinary.equivalent_frequency_hz, rtol=tolerance)
        assert_allclose(r.delay_s, ordinary.delay_s, rtol=10 * tolerance)

    right_or_refused(lambda: published(scale * target, scale * measured, RATE, weight_power=power, **setting), check)


@pytest.mark.parametrize("power", [1, 2, 3])
@pytest.mark.parametrize("target_scale", [1e-300, 1e-200, 1e-100, 1.0, 1e100, 1e200, 1e300])
@pytest.mark.parametrize("measured_scale", [1e-300, 1e-250, 1e-200, 1e-100, 1e100, 1e200, 1e300])
def test_signals_of_very_different_sizes_are_right_or_refused(
    power: int, target_scale: float, measured_scale: float
) -> None:
    target, measured = signals()
    ordinary = published(target, measured, RATE, weight_power=power)
    log_ratio = math.log10(measured_scale) - math.log10(target_scale)

    def check(r: Any) -> None:
        assert_allclose(
            math.log10(r.amplitude), math.log10(ordinary.amplitude) + log_ratio, atol=physical(1e-6, "relative")
        )
        assert_allclose(r.delay_s, ordinary.delay_s, rtol=physical(1e-6, "relative"))

    right_or_refused(
        lambda: published(target_scale * target, measured_scale * measured, RATE, weight_power=power), check
    )


@pytest.mark.parametrize("scale", SCALES)
def test_huge_and_tiny_signals_in_moving_windows_are_right_or_refused(scale: float) -> None:
    target, measured = signals()
    ordinary = CALLS["evaluate_moving"](target, measured, RATE)

    def check(r: Any) -> None:
        assert r.valid.all()
        rtol = physical(1e-6, "relative") if scale > 1e-300 else physical(1, "%")
        assert_allclose(r.delay_s, ordinary.delay_s, rtol=rtol)
        assert_allclose(r.amplitude, ordinary.amplitude, rtol=rtol)

    right_or_refused(lambda: CALLS["evaluate_moving"](scale * target, scale * measured, RATE), check)


@pytest.mark.parametrize("scale", SCALES)
def test_huge_and_tiny_signals_over_frequency_are_right_or_refused(scale: float) -> None:
    target, measured = signals()
    ordinary = rthstrack.frequency_response(target, measured, RATE)
    strong = ordinary.target_psd > 1e-3 * ordinary.target_psd.max()

    def check(r: Any) -> None:
        rtol = physical(1e-6, "relative") if scale > 1e-300 else physical(1, "%")
        for name in ("gain", "delay_s", "coherence"):
            assert_allclose(getattr(r, name)[strong], getattr(ordinary, name)[strong], rtol=rtol, err_msg=name)
        log_psd = np.log10(ordinary.target_psd[strong]) + 2 * math.log10(scale)
        assert_allclose(np.log10(r.target_psd[strong]), log_psd, atol=rtol)

    right_or_refused(lambda: rthstrack.frequency_response(scale * target, scale * measured, RATE), check)


@pytest.mark.parametrize("scale", SCALES)
def test_indices_of_huge_and_tiny_signals_are_right_or_refused(scale: float) -> None:
    target, measured = signals()
    ordinary = rthstrack.indices(target, measured, RATE)
    rtol = physical(1e-6, "relative") if scale > 1e-300 else physical(1, "%")

    def check(r: Any) -> None:
        assert r.j1_s == ordinary.j1_s
        for name in ("max_tracking_error_percent", "rms_error_percent", "j2_percent", "j3_percent"):
            assert_allclose(getattr(r, name), getattr(ordinary, name), rtol=rtol, err_msg=name)
        for name, power in (("max_tracking_error", 1), ("rms_error", 1), ("tracking_indicator", 2)):
            expected = math.log10(getattr(ordinary, name)) + power * math.log10(scale)
            assert getattr(r, name) > 0, name
            assert_allclose(math.log10(getattr(r, name)), expected, atol=rtol, err_msg=name)

    right_or_refused(lambda: rthstrack.indices(scale * target, scale * measured, RATE), check)


@pytest.mark.parametrize("scale", SCALES)
def test_histories_of_huge_and_tiny_signals_are_right_or_refused(scale: float) -> None:
    target, measured = signals()
    ordinary = rthstrack.index_histories(target, measured, RATE)

    def check(r: Any) -> None:
        rtol = physical(1e-6, "relative") if scale > 1e-300 else physical(1, "%")
        for name, power in (("max_tracking_error", 1), ("rms_error", 1), ("tracking_indicator", 2)):
            expected = getattr(ordinary, name)[-1]
            assert np.isfinite(getattr(r, name)).all(), name
            assert getattr(r, name)[-1] > 0, name
            log_expected = math.log10(expected) + power * math.log10(scale)
            assert_allclose(math.log10(getattr(r, name)[-1]), log_expected, atol=rtol, err_msg=name)

    right_or_refused(lambda: rthstrack.index_histories(scale * target, scale * measured, RATE), check)


def test_extreme_rates_only_stretch_time() -> None:
    target, measured = signals()
    ordinary = published(target, measured, RATE)
    for rate in (1e-300, 1e-9, 1e9, 1e300):
        r = published(target, measured, rate)
        assert_allclose(r.delay_s, ordinary.delay_s * RATE / rate, rtol=physical(1e-9, "relative"))
        assert r.fei == ordinary.fei
