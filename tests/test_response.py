"""Gain and delay over frequency: alignment, intervals, and the two straight lines."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import scipy.signal
import scipy.stats
from numpy.testing import assert_allclose
from numpy.typing import NDArray

import rthstrack
import tracking_twin as twin
from tolerances import physical, round_off

RATE = 256.0
Floats = NDArray[np.float64]


def motion(length: int, seed: int = 0, centre_hz: float = 3.0) -> Floats:
    """Noise through a resonance, most of its energy in a few segments, still at both ends."""
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(length, 1 / RATE)
    resonance = 1 / (1 - (f / centre_hz) ** 2 + 0.3j * f / centre_hz) * (f < 20)
    x = np.fft.irfft(resonance * np.fft.rfft(rng.standard_normal(length)), length)
    t = np.arange(length) / length
    return np.asarray(x * (0.1 + np.exp(-(((t - 0.4) / 0.12) ** 2))) * np.minimum(1, 20 * np.minimum(t, 1 - t)))


def through(target: Floats, response: Any) -> Floats:
    """What an actuator of that frequency response makes of it; zeros keep its end from its beginning."""
    n = 2 * len(target)
    f = np.fft.rfftfreq(n, 1 / RATE)
    return np.asarray(np.fft.irfft(np.fft.rfft(target, n) * response(f), n)[: len(target)])


def delayed(target: Floats, gain: float, delay_s: float) -> Floats:
    return through(target, lambda f: gain * np.exp(-2j * math.pi * f * delay_s))


def noises(kind: str, length: int, n_draws: int, seed: int = 1) -> Floats:
    """White, or AR(1) with coefficient 0.9; standard deviation 1, a row a draw."""
    white = np.random.default_rng(seed).standard_normal((n_draws, length + 200))
    if kind == "white":
        return np.asarray(white[:, 200:])
    return np.asarray(scipy.signal.lfilter([math.sqrt(1 - 0.9**2)], [1, -0.9], white)[:, 200:])


def strong(response: Any, share: float = 0.01) -> NDArray[np.bool_]:
    """Bins with energy, but for the first, where detrending takes part."""
    return np.asarray(
        (response.target_psd > share * response.target_psd.max()) & (response.frequency_hz > response.frequency_hz[0])
    )


# --- intervals ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("align_s", [0.0, 0.0213, -0.0213], ids=["plain", "lag", "lead"])
@pytest.mark.parametrize(
    ("segment", "overlap", "window"),
    [(512, 256, "hann"), (512, 384, "blackman"), (400, 100, "hamming"), (512, 0, "hann"), (256, 224, "hann")],
)
def test_standard_errors_are_those_of_the_twins_matrices(
    segment: int, overlap: int, window: str, align_s: float
) -> None:
    target = motion(4096)
    measured = delayed(target, 1.1, 0.02) + 0.01 * noises("white", 4096, 1)[0] * target.std()
    ours = rthstrack.frequency_response(
        target, measured, RATE, segment_s=segment / RATE, overlap=overlap / segment, window=window, align_s=align_s
    )
    theirs = twin.response_uncertainty(target, measured, RATE, segment, overlap, window, align_s)
    stated = np.isfinite(ours.gain_std)
    assert stated.sum() >= 10
    tolerance = physical(1e-6, "relative")
    assert_allclose(ours.gain[stated], np.abs(theirs["response"])[stated], rtol=tolerance)
    turn = np.exp(-2j * math.pi * ours.frequency_hz * ours.delay_s)[stated]
    assert_allclose(turn, (theirs["response"] / np.abs(theirs["response"]))[stated], atol=tolerance)
    for name in ("gain_std", "delay_std_s"):
        assert_allclose(getattr(ours, name)[stated], theirs[name][stated], rtol=tolerance, err_msg=name)
    quantile = scipy.stats.t.ppf(0.975, theirs["degrees"])[stated]
    for value, std, interval in (
        (ours.gain, ours.gain_std, ours.gain_interval),
        (ours.delay_s, ours.delay_std_s, ours.delay_interval_s),
    ):
        assert_allclose((interval[:, 1] - value)[stated], (quantile * std[stated]), rtol=tolerance)
        assert_allclose((value - interval[:, 0])[stated], (quantile * std[stated]), rtol=tolerance)


@pytest.mark.parametrize("kind", ["white", "ar1"])
@pytest.mark.parametrize("delay_s", [0.02, -0.02], ids=["lag", "lead"])
def test_intervals_cover_the_truth_whichever_segments_hold_the_motion(kind: str, delay_s: float) -> None:
    target = motion(8192)
    clean = delayed(target, 1.1, delay_s)
    covered: list[Floats] = []
    for noise in noises(kind, 8192, 300):
        r = rthstrack.frequency_response(target, clean + 0.01 * clean.std() * noise, RATE, align_s=delay_s)
        judged = strong(r)
        covered.append(
            np.array(
                [
                    (low <= truth) & (truth <= high)
                    for (low, high), truth in (
                        (r.gain_interval[judged].T, 1.1),
                        (r.delay_interval_s[judged].T, delay_s),
                    )
                ]
            )
        )
    share = np.mean(covered, axis=0)
    # 300 draws at some 20 bins, of which about every second is new.
    assert share.shape[1] > 15
    assert_allclose(share.mean(axis=1), 0.95, rtol=0, atol=physical(1.5, "%"))
    # A single bin: 4.5 standard deviations of its 300 draws.
    assert share.min() > 0.95 - 4.5 * math.sqrt(0.95 * 0.05 / 300)


def test_an_interval_is_stated_only_where_something_supports_it() -> None:
    target = motion(4096)
    measured = delayed(target, 1.0, 0.01) + 0.01 * target.std() * noises("white", 4096, 1)[0]
    names = ("gain_std", "gain_interval", "delay_std_s", "delay_interval_s")

    def stated(**settings: Any) -> NDArray[np.bool_]:
        r = rthstrack.frequency_response(target, measured, RATE, **settings)
        finite = np.isfinite(r.gain_std)
        for name in names:
            array = getattr(r, name)
            assert (finite == np.isfinite(array).reshape(finite.size, -1).T).all(), name
        return finite

    usual = stated()
    assert usual[1:20].all()
    # Next to zero and at Nyquist the window ties a bin to its mirror image; above 20 Hz there is only noise.
    assert not usual[0]
    assert not usual[-1]
    r = rthstrack.frequency_response(target, measured, RATE)
    assert usual[r.frequency_hz > 21].mean() < 0.05
    half_width = (r.gain_interval[:, 1] - r.gain)[usual]
    assert (half_width <= r.gain[usual] / 3).all()
    # Three segments have a residual, but too little of it; more than 7/8 of overlap adds nothing that is new.
    assert not stated(segment_s=8.0, overlap=0.5).any()
    assert stated(overlap=0.875)[1:20].all()
    assert not stated(overlap=0.9).any()


# --- alignment ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay_s", [0.1013, -0.1013], ids=["lag", "lead"])
def test_alignment_takes_away_what_segments_lose_to_a_delay(delay_s: float) -> None:
    target = motion(8192)
    measured = delayed(target, 1.1, delay_s)
    plain, aligned = (rthstrack.frequency_response(target, measured, RATE, align_s=a) for a in (0.0, delay_s))
    judged = strong(plain)
    assert np.abs(plain.gain - 1.1)[judged].max() > 0.01
    assert_allclose(aligned.gain[judged], 1.1, rtol=physical(1e-5, "relative"))
    assert_allclose(aligned.delay_s[judged], delay_s, rtol=0, atol=physical(1, "us"))
    assert plain.coherence[judged].min() < 0.999 < 1 - 1e-8 < aligned.coherence[judged].min()
    assert aligned.align_s == delay_s
    assert aligned.n_segments == (8192 - round(0.1013 * RATE) - 1024) // 512 + 1


def test_dispersion_corrects_a_gain_and_a_delay_that_change_with_frequency() -> None:
    target = motion(8192)

    def first_order(f: Any) -> Any:
        return 1 / (1 + 2j * math.pi * f * 0.03)

    measured = through(target, first_order)
    errors = []
    for dispersion in (False, True):
        r = rthstrack.frequency_response(target, measured, RATE, align_s=0.03, dispersion=dispersion)
        judged = strong(r)
        truth = first_order(r.frequency_hz)
        errors.append(np.abs(r.gain * np.exp(-2j * math.pi * r.frequency_hz * r.delay_s) / truth - 1)[judged].max())
        assert r.dispersion is dispersion
    assert errors[1] < errors[0] / 4
    assert errors[1] < physical(2e-3, "relative")


def test_a_constant_delay_of_whole_samples_needs_no_correction() -> None:
    target = motion(4096)
    measured = np.concatenate([np.zeros(5), 0.9 * target[:-5]])
    r = rthstrack.frequency_response(target, measured, RATE, align_s=5 / RATE)
    judged = strong(r)
    assert_allclose(r.gain[judged], 0.9, rtol=round_off(1, 4096))
    assert_allclose(r.delay_s[judged], 5 / RATE, rtol=round_off(1, 4096))


@pytest.mark.parametrize("delay_s", [0.009, 0.065, -0.2], ids=["9 ms", "65 ms", "-200 ms"])
def test_segments_are_aligned_at_the_trusted_delay_unless_told_otherwise(delay_s: float) -> None:
    target = motion(8192)
    measured = delayed(target, 1.1, delay_s)
    r, plain = (rthstrack.frequency_response(target, measured, RATE, **s) for s in ({}, {"align_s": 0.0}))
    trusted = rthstrack.evaluate(target, measured, RATE, estimator="least_squares", detrend="mean")
    assert (r.align_s, r.unaligned) == (trusted.delay_s, "")
    assert (plain.align_s, plain.unaligned) == (0.0, "")
    judged = strong(r)
    assert_allclose(r.gain[judged], 1.1, rtol=physical(1e-4, "relative"))
    assert_allclose(r.delay_s[judged], delay_s, rtol=0, atol=physical(5, "us"))
    # What unaligned segments lose of the delay is a share of it, however short it is.
    assert np.abs(plain.delay_s / delay_s - 1)[judged].max() > 0.02


@pytest.mark.parametrize("kind", ["white", "ar1"])
@pytest.mark.parametrize("delay_s", [0.009, 0.2])
def test_intervals_of_what_is_aligned_by_default_cover_the_truth(kind: str, delay_s: float) -> None:
    target = motion(8192, seed=7)
    clean = delayed(target, 1.1, delay_s)
    n_draws, covered = 60, []
    for noise in noises(kind, 8192, n_draws, seed=3):
        r = rthstrack.frequency_response(target, clean + 0.01 * clean.std() * noise, RATE)
        judged = strong(r)
        for (low, high), truth in ((r.gain_interval[judged].T, 1.1), (r.delay_interval_s[judged].T, delay_s)):
            covered.append(np.mean((low <= truth) & (truth <= high)))
    # Some 20 bins of which every second is new, gain and delay: 3.5 standard deviations.
    assert abs(np.mean(covered) - 0.95) < 3.5 * math.sqrt(0.05 * 0.95 / (20 * n_draws))


def test_why_segments_are_not_aligned_is_said() -> None:
    target = motion(4096)
    noise = noises("white", 4096, 1)[0]
    r = rthstrack.frequency_response(target, noise, RATE)
    trusted = rthstrack.evaluate(target, noise, RATE, estimator="least_squares", detrend="mean")
    assert math.isnan(float(trusted.delay_s))
    assert (r.align_s, r.unaligned) == (0.0, trusted.reason)
    # Two segments of 126 of 256 samples leave no room for 50.
    wave = np.sin(2 * np.pi * 3 * np.arange(400) / RATE) * np.linspace(0, 1, 400) ** 2
    short = rthstrack.frequency_response(wave[50:306], wave[:256], RATE, segment_s=126 / RATE, overlap=0.0)
    assert short.align_s == 0
    assert short.unaligned.startswith("the record is too short for two segments")
    assert "\n" not in r.unaligned + short.unaligned
    assert "unaligned" in r.to_dict()


def test_an_assessment_aligns_its_response_at_the_same_delay() -> None:
    target = motion(8192)
    noise = 0.01 * target.std() * noises("white", 8192, 1)[0]
    found = rthstrack.assess(target, delayed(target, 1.1, 0.012) + noise, RATE)
    alone = rthstrack.frequency_response(found.target, found.measured, RATE)
    assert found.response is not None
    assert (found.response.align_s, found.response.unaligned) == (alone.align_s, "")
    assert np.array_equal(found.response.delay_s, alone.delay_s)
    lost = rthstrack.assess(target, noise, RATE)
    assert lost.response is not None
    if lost.response.align_s == 0:
        assert lost.response.unaligned.startswith("not determined")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 17.0, -17.0, 15.5, None, "late"])
@pytest.mark.parametrize("call", [rthstrack.frequency_response, rthstrack.frequency_slopes])
def test_an_alignment_that_leaves_no_record_is_refused(call: Any, value: Any) -> None:
    target = motion(4096)
    if value is None:
        assert call(target, target, RATE, align_s=None).align_s == pytest.approx(0, abs=physical(1e-3, "us"))
        return
    with pytest.raises(rthstrack.SettingError, match="align_s") as caught:
        call(target, target, RATE, align_s=value)
    assert "\n" not in str(caught.value)


# --- slopes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tau_s", [0.03, -0.03], ids=["lag", "lead"])
def test_slopes_are_the_line_through_a_first_order_actuator(tau_s: float) -> None:
    target = motion(16384)

    def first_order(f: Any) -> Any:
        return 1 / (1 + 2j * math.pi * f * tau_s)

    found = rthstrack.frequency_slopes(target, through(target, first_order), RATE)
    r = rthstrack.frequency_response(target, target, RATE)
    low, high = found.band_hz
    inside = (r.frequency_hz >= low) & (r.frequency_hz <= high)
    used = inside & (r.target_psd >= np.sort(r.target_psd[inside])[-found.n_bins])
    f, energy = r.frequency_hz[used], r.target_psd[used]
    gain, delay = np.abs(first_order(f)), np.arctan(2 * math.pi * f * tau_s) / (2 * math.pi * f)
    f_eq = found.equivalent_frequency_hz
    for y, weight, value, slope, unit in (
        (gain, energy, found.gain, found.gain_per_hz, "relative"),
        (delay, energy * (f * gain) ** 2, found.delay_s, found.delay_s_per_hz, "s"),
    ):
        line = np.polyfit(f - f_eq, y, 1, w=np.sqrt(weight))
        assert_allclose(value, line[1], rtol=physical(0.2, "%"), err_msg=unit)
        assert_allclose(slope, line[0], rtol=physical(3, "%"), err_msg=unit)
    assert found.gain_varies
    assert found.delay_varies
    assert found.dispersion
    assert math.copysign(1, found.delay_s) == math.copysign(1, tau_s)


@pytest.mark.parametrize("delay_s", [0.0213, -0.0213, 0.0], ids=["lag", "lead", "none"])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_constant_gain_and_delay_is_said_not_to_vary(delay_s: float, noise: float) -> None:
    target = motion(8192) + np.linspace(0, 3, 8192) ** 2
    measured = 1.1 * (motion(8192) * 0 + target)
    if delay_s:
        drift = (np.clip(np.arange(8192) - delay_s * RATE, 0, 8191) * 3 / 8191) ** 2
        measured = 1.1 * drift + delayed(motion(8192), 1.1, delay_s)
    measured = measured + noise * motion(8192).std() * noises("white", 8192, 1)[0]
    found = rthstrack.frequency_slopes(target, measured, RATE)
    assert not found.gain_varies
    assert not found.delay_varies
    assert_allclose(found.delay_s, delay_s, rtol=0, atol=physical(0.3, "ms"))
    assert_allclose(found.align_s, found.delay_s, rtol=0, atol=physical(10, "us"))


@pytest.mark.parametrize("kind", ["white", "ar1"])
def test_intervals_of_the_lines_cover_the_truth(kind: str) -> None:
    target = motion(8192)
    clean = delayed(target, 1.1, 0.02)
    n_draws = 300
    hits = np.zeros(4)
    claims = 0
    for noise in noises(kind, 8192, n_draws, seed=2):
        s = rthstrack.frequency_slopes(target, clean + 0.01 * clean.std() * noise, RATE)
        intervals = (s.gain_interval, s.gain_per_hz_interval, s.delay_interval_s, s.delay_s_per_hz_interval)
        hits += [low <= truth <= high for (low, high), truth in zip(intervals, (1.1, 0, 0.02, 0), strict=True)]
        claims += s.gain_varies + s.delay_varies
    # 3.5 standard deviations of 300 draws
    assert_allclose(hits / n_draws, 0.95, rtol=0, atol=3.5 * math.sqrt(0.95 * 0.05 / n_draws))
    assert claims == 0


def test_the_real_machines_delay_is_said_to_fall_with_frequency(root: Any) -> None:
    recording = rthstrack.read_recording(root / "examples" / "data" / "utfsm_chirp_0A.csv")
    s = rthstrack.frequency_slopes(
        recording["cmd_mm"].values, recording["meas_mm"].values, recording.rate_hz, band_hz=(1.0, 15.0)
    )
    assert s.delay_varies
    assert s.gain_varies
    assert physical(19, "ms") < s.delay_s < physical(24, "ms")
    assert s.delay_s_per_hz < -physical(0.5, "ms")
    assert s.gain_per_hz < 0
    assert 1.0 <= s.band_hz[0] < s.band_hz[1] <= 15.0


def test_too_few_bins_for_a_line_are_refused_with_what_to_do() -> None:
    target = motion(4096)
    with pytest.raises(rthstrack.SignalError, match="bin") as caught:
        rthstrack.frequency_slopes(target, target, RATE, band_hz=(2.0, 2.2))
    assert "\n" not in str(caught.value)
    unrelated = noises("white", 4096, 1)[0]
    with pytest.raises(rthstrack.SignalError, match="coherence"):
        rthstrack.frequency_slopes(target, unrelated, RATE)
    with pytest.raises(rthstrack.SettingError, match="band_hz"):
        rthstrack.frequency_slopes(target, target, RATE, band_hz=(3.0, 2.0))


def test_samples_that_cannot_be_judged_are_refused() -> None:
    target = motion(4096)
    broken = target.copy()
    broken[7] = math.nan
    for other, words in (
        (broken, r"measured.*\b1\b.*\b7\b"),
        (target[:-1], "4095"),
        (np.stack([target] * 2, 1), "shape"),
    ):
        with pytest.raises(rthstrack.SignalError, match=words):
            rthstrack.frequency_slopes(target, other, RATE)


def test_results_become_tables_and_plain_values() -> None:
    target = motion(4096)
    measured = delayed(target, 1.0, 0.01) + 1e-3 * noises("white", 4096, 1)[0]
    r = rthstrack.frequency_response(target, measured, RATE)
    frame = r.to_frame()
    for name, column in (("gain_low", r.gain_interval[:, 0]), ("delay_high_s", r.delay_interval_s[:, 1])):
        assert_allclose(frame[name], column, rtol=0)
    s = rthstrack.frequency_slopes(target, measured, RATE)
    row = s.to_frame().iloc[0]
    assert (row["delay_interval_s_low"], row["delay_interval_s_high"]) == s.delay_interval_s
    assert s.to_dict()["delay_interval_s"] == list(s.delay_interval_s)
