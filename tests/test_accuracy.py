"""The accuracy tables in their short form: few draws, so that only what no chance explains is a failure."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rthstrack
from tolerances import physical

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "benchmarks"))
import accuracy
import estimate_twin as twin
import generic_delay
import twin_tool

#: Standard deviations by which a figure made of draws may be off before it is a failure.
FAR = 4.0


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> accuracy.Run:
    return accuracy.computed(rthstrack, tmp_path_factory.mktemp("accuracy"), short=True)


def rows(run: accuracy.Run, *words: str) -> list[accuracy.Row]:
    found = [row for row in run.rows if all(word in row.case for word in words)]
    assert found, words
    return found


def test_what_needs_no_noise_is_met(run: accuracy.Run) -> None:
    for words in (["no noise"], ["4 s windows: delay"], ["delays of -100"], ["sine"], ["detrending"]):
        for row in rows(run, *words):
            assert row.met, row


def test_noise_neither_biases_nor_scatters_the_estimate_beyond_the_limit(run: accuracy.Run) -> None:
    for row in rows(run, "bias over sd"):
        assert row.value < 0.1 + FAR / np.sqrt(run.draws), row
    for row in rows(run, "sd over Cramer-Rao"):
        assert row.value < 1.1 * (1 + FAR / np.sqrt(2 * run.draws)), row
    for row in rows(run, "mean error of delay over sd"):
        assert row.value < 0.1 + FAR / np.sqrt(run.draws), row


def test_intervals_hold_about_as_often_as_they_say(run: accuracy.Run) -> None:
    for row in rows(run, "cover"):
        if row.met is not None:
            assert abs(row.value - 95) < 2 + 100 * FAR * np.sqrt(0.05 * 0.95 / run.draws), row


def test_the_document_has_every_section_and_its_figures(run: accuracy.Run) -> None:
    text = accuracy.document(run, ["## Another section"])
    assert text.count("\n## ") == len(accuracy.SECTIONS) + 2
    figures = {path.name for path in run.out.glob("*.png")}
    assert figures == {f"accuracy-{name}.png" for name in ("windows", "noise", "coverage", "delays")}
    for name in figures:
        assert f"({name})" in text


@pytest.mark.parametrize("delay_s", [-0.02, 0.0, 0.03])
def test_generic_estimators_read_the_delay_of_broad_band_noise_with_its_sign(delay_s: float) -> None:
    pair = accuracy.broad_band(delay_s)
    for name, estimator in generic_delay.ESTIMATORS.items():
        found = estimator(pair.target, pair.measured, pair.rate_hz)
        assert_allclose(found, delay_s, rtol=0, atol=physical(1.0, "ms"), err_msg=name)


@pytest.mark.parametrize("estimator", ["least_squares", "aligned"])
@pytest.mark.parametrize("delay_s", [-0.09, 0.0123])
def test_the_twin_reads_a_broad_band_delay_to_a_nanosecond(estimator: str, delay_s: float) -> None:
    pair = accuracy.broad_band(delay_s, seconds=6.0)
    found: Any = twin_tool.evaluate(pair.target, pair.measured, pair.rate_hz, estimator=estimator)
    assert_allclose(found.delay_s, delay_s, rtol=0, atol=physical(1e-3, "us"))
    assert_allclose(found.amplitude, pair.amplitude, rtol=physical(1e-9, "relative"), atol=0)


@pytest.mark.parametrize("coefficient", [0.0, 0.9])
@pytest.mark.parametrize("window", ["boxcar", "hann"])
@pytest.mark.parametrize("estimator", ["least_squares", "aligned"])
def test_the_twins_standard_errors_are_those_of_its_draws(estimator: str, window: str, coefficient: float) -> None:
    pair = accuracy.broad_band(0.0123, seconds=2.0)
    std, n = 0.01 * np.std(pair.measured), len(pair.target)
    rng = np.random.Generator(np.random.PCG64(1))
    between, found = twin.Target(pair.target, pair.rate_hz), []
    case = twin.Case(between, pair.measured, window=window)
    for _ in range(60):
        measured = pair.measured + std * accuracy.unit_noise(rng, (n,), coefficient)
        noisy = twin.Case(between, measured, window=window)
        found.append(getattr(twin, estimator)(noisy, pair.delay_s)[:2])
    covariance = twin.autoregressive_covariance(coefficient, std, n) if coefficient else np.array([std**2])
    told = getattr(twin, f"{estimator}_errors")(case, pair.amplitude, pair.delay_s, covariance)
    assert_allclose(np.std(found, axis=0, ddof=1) / told, 1.0, rtol=0, atol=FAR / np.sqrt(2 * 60))
    limit = twin.cramer_rao(case, pair.amplitude, pair.delay_s, std)
    if estimator == "least_squares" and window == "boxcar" and not coefficient:
        assert_allclose(told, limit, rtol=physical(1e-9, "relative"))


def test_unit_noise_is_stationary_with_the_correlation_asked_for() -> None:
    noise = accuracy.unit_noise(np.random.Generator(np.random.PCG64(2)), (4000, 50), 0.9)
    assert_allclose(np.std(noise, axis=0), 1.0, atol=FAR / np.sqrt(2 * 4000))
    assert_allclose(np.mean(noise[:, 1:] * noise[:, :-1], axis=0), 0.9, atol=FAR * np.sqrt(2 / 4000))
