"""Motions and noise that are hard on the estimates: that they are what they say, and the tables in their short form."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize_scalar

import rthstrack

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "benchmarks"))
import accuracy
import accuracy_hostile
import hostile
from tolerances import physical, round_off

RATE_HZ = 1024.0
#: Standard deviations by which a figure made of draws may be off before it is a failure.
FAR = 4.0

TONES = (hostile.ramped(20.0), hostile.modulated(12.5), hostile.narrow(10.0, 0.1, seed=1), hostile.stepped())


# What the motions are -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motion", [*TONES, hostile.broad(), hostile.chirp()], ids=lambda m: m.name)
def test_a_motion_late_by_whole_samples_is_itself_so_many_samples_later(motion: hostile.Motion) -> None:
    x, late = motion.samples(RATE_HZ), motion.samples(RATE_HZ, 7 / RATE_HZ)
    early = motion.samples(RATE_HZ, -7 / RATE_HZ)
    allowed = physical(1e-9, "relative") * np.max(np.abs(x))
    assert_allclose(late[7:], x[:-7], rtol=0, atol=allowed)
    assert_allclose(early[:-7], x[7:], rtol=0, atol=allowed)


@pytest.mark.parametrize("motion", [hostile.broad(), hostile.chirp()], ids=lambda m: m.name)
def test_a_motion_late_by_half_a_sample_is_every_other_sample_at_twice_the_rate(motion: hostile.Motion) -> None:
    fast = motion.samples(2 * RATE_HZ)
    allowed = round_off(100, 60, np.max(np.abs(fast)))
    assert_allclose(motion.samples(RATE_HZ), fast[::2], rtol=0, atol=allowed)
    assert_allclose(motion.samples(RATE_HZ, -0.5 / RATE_HZ), fast[1::2], rtol=0, atol=allowed)


def test_a_narrow_band_is_the_sum_of_its_sines() -> None:
    f, half_width_hz, seed, count = 20.0, 0.5, 3, 24
    rng = np.random.Generator(np.random.PCG64(seed))
    offsets, phases = rng.uniform(-half_width_hz, half_width_hz, count), rng.uniform(0, 2 * np.pi, count)
    t = np.arange(20480) / RATE_HZ - 0.0123
    expected = np.cos(2 * np.pi * np.multiply.outer(t, f + offsets) + phases).sum(axis=1)
    found = hostile.narrow(f, half_width_hz, seed).samples(RATE_HZ, 0.0123)
    assert_allclose(found, expected, rtol=0, atol=physical(1e-7, "relative") * count)


@pytest.mark.parametrize("kind", accuracy_hostile.STRENGTHS)
def test_noise_has_the_level_asked_for_whatever_its_strength_follows(kind: str) -> None:
    strength = hostile.strength(kind, hostile.broad(), RATE_HZ, 0.0123)
    assert_allclose(np.mean(strength**2), 1.0, rtol=physical(1e-12, "relative"))


def test_a_burst_is_ten_times_stronger_for_one_second_about_the_peak() -> None:
    motion = hostile.response("5 Hz")
    strength, x = hostile.strength("burst", motion, RATE_HZ, 0.0), motion.samples(RATE_HZ)
    loud = np.flatnonzero(strength > 1.01 * strength.min())
    assert_allclose(strength.max() / strength.min(), 10.0, rtol=physical(1e-12, "relative"))
    assert abs(len(loud) - RATE_HZ) <= 1
    assert loud[0] < np.argmax(np.abs(x)) < loud[-1]


def test_the_velocity_that_noise_follows_is_the_slope_of_the_motion() -> None:
    motion = hostile.chirp()
    step = 1e-5
    between = motion.samples(RATE_HZ, -step) - motion.samples(RATE_HZ, step)
    slope = motion.samples(RATE_HZ, slope=True)
    assert_allclose(slope, between / (2 * step), rtol=0, atol=physical(1e-6, "relative") * np.max(np.abs(slope)))


# What can be known of the turn ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("coefficient", [0.0, 0.9])
@pytest.mark.parametrize("motion", TONES[:3], ids=lambda m: m.name)
def test_the_margin_between_turns_is_that_of_two_fits_by_hand(motion: hostile.Timed, coefficient: float) -> None:
    delay_s, std = 0.0123, 0.005
    rng = np.random.Generator(np.random.PCG64(8))
    noise = std * hostile.unit_noise(rng, (round(motion.seconds * RATE_HZ),), coefficient)
    measured = 0.9 * motion.samples(RATE_HZ, delay_s) + noise
    first, last = 4096, 8192
    turns = hostile.Turns(motion, RATE_HZ, coefficient)
    found_s, margin = turns.best(measured, std, first, last)

    def whitened(x: np.ndarray) -> np.ndarray:
        w = x[1:] - coefficient * x[:-1]
        return w[first : last - 1] - w[first : last - 1].mean()

    observed = whitened(measured)

    def log_likelihood(tau: float) -> float:
        shifted = whitened(motion.samples(RATE_HZ, tau))
        left = observed - shifted * (shifted @ observed) / (shifted @ shifted)
        return float(-(left @ left) / (2 * std**2 * (1 - coefficient**2)))

    # Each turn by hand: the best near where the period puts it, of all turns that are searched.
    period_s = 1 / float(motion.name.split()[1] if motion.name[0].isalpha() else motion.name.split()[0])
    best = []
    for k in range(-5, 5):
        near = delay_s + k * period_s
        if abs(near) < 0.25:
            turn = minimize_scalar(
                lambda tau: -log_likelihood(tau), bounds=(near - 0.1 * period_s, near + 0.1 * period_s),
                method="bounded", options={"xatol": 1e-8},
            )  # fmt: skip
            best.append((-float(turn.fun), float(turn.x)))
    best.sort()
    assert_allclose(margin, best[-1][0] - best[-2][0], rtol=0.001, atol=0.01)
    if margin > 1:  # of a sine, any turn is as good as the others
        assert_allclose(found_s, best[-1][1], rtol=0, atol=physical(1.0, "us"))


# What is asked of the estimates ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bench() -> accuracy_hostile.Bench:
    return accuracy_hostile.computed(accuracy_hostile.SHORT, ["tones", "both", "varying", "small"])


def rows(bench: accuracy_hostile.Bench, *words: str) -> list[accuracy_hostile.Row]:
    found = [row for row in bench.rows if all(word in row.case for word in words)]
    assert found, words
    return found


def test_no_tone_is_read_off_by_a_turn(bench: accuracy_hostile.Bench) -> None:
    for row in rows(bench, "readings off by a turn"):
        assert row.value == 0, row


def test_with_a_delay_to_expect_every_tone_is_determined_and_right(bench: accuracy_hostile.Bench) -> None:
    for row in rows(bench, "a delay expected"):
        assert row.value == 0, row


def test_a_tone_is_ambiguous_where_the_likelihoods_of_its_turns_do_not_tell(bench: accuracy_hostile.Bench) -> None:
    # The package has to estimate the noise that is known here: a reading or two may lie on the edge.
    for row in rows(bench, "ambiguous where the likelihoods tell"):
        assert row.value <= 2, row


def test_noise_on_both_channels_draws_no_estimate_to_half_samples(bench: accuracy_hostile.Bench) -> None:
    for row in rows(bench, "both channels", "bias over sd"):
        assert row.value < 0.2 + FAR / np.sqrt(bench.size.both_draws), row


def test_the_worse_estimate_is_not_recommended(bench: accuracy_hostile.Bench) -> None:
    for row in rows(bench, "'use the trusted estimate'"):
        assert row.value == 0, row


@pytest.mark.parametrize(
    "words", [["both channels"], *(["noise on measured", kind] for kind in accuracy_hostile.STRENGTHS)], ids=" ".join
)
def test_intervals_hold_about_as_often_as_they_say_and_are_seldom_missing(
    bench: accuracy_hostile.Bench, words: list[str]
) -> None:
    for row in rows(bench, *words, "cover of"):
        assert abs(row.value - 0.95) < 0.03, row
    for row in rows(bench, *words, "no interval"):
        assert row.value <= 0.15, row


def test_content_too_high_for_the_rate_has_no_interval(bench: accuracy_hostile.Bench) -> None:
    for row in rows(bench, "above 0.35 of the rate"):
        assert row.value == 0, row


def test_a_delay_beyond_the_search_is_said_to_be_beyond(bench: accuracy_hostile.Bench) -> None:
    for row in rows(bench, "a delay of 400 ms"):
        assert row.value == 0, row


def test_what_was_asked_joins_the_document(
    bench: accuracy_hostile.Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(accuracy, "SIBLINGS", ("accuracy_hostile",))
    monkeypatch.setattr(accuracy_hostile, "_full", lambda: bench)
    run = accuracy.computed(rthstrack, tmp_path, short=True, sections=[])
    text = accuracy.document(run, accuracy.siblings(run))
    head, _, body = text.partition("\n## Under attack\n")
    for row in bench.rows:
        assert f"| {row.case} | {row.asked} |" in head
    for title in ("Tones", "The same noise", "Noise that changes", "Smaller"):
        assert f"\n### {title}" in body
