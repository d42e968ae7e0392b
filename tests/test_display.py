"""Which points are drawn and how numbers are written."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from rthstrack.evaluation.results import NUMBERS
from rthstrack.evaluation.settings import Settings
from rthstrack.evaluation.tracking import Tracking
from rthstrack.verdict import display


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.716969, "0.7170"),
        (13.5075, "13.51"),
        (-44.9812, "\N{MINUS SIGN}44.98"),
        (2611.4, "2611"),
        (123456.7, "123457"),
        (1234567.0, "1.235\N{MULTIPLICATION SIGN}10⁶"),
        (0.00012344, "0.0001234"),
        (-0.000012344, "\N{MINUS SIGN}1.234\N{MULTIPLICATION SIGN}10⁻⁵"),
        (0.0, "0"),
        (65536, "65536"),
        (9.9996, "10.00"),  # rounding takes it up a decade, and a decimal away
    ],
)
def test_numbers_are_written_with_four_significant_digits(value: float, text: str) -> None:
    assert display.significant(value) == text


def test_the_points_drawn_hold_every_group_minimum_and_maximum_of_every_column() -> None:
    columns = list(np.random.default_rng(3).normal(size=(3, 10_007)))
    edges = display.even_edges(10_007, 100)
    kept = display.extremes(columns, edges)
    assert np.all(np.diff(kept) > 0)
    assert kept[0] == 0
    assert kept[-1] == 10_006
    assert kept.size <= 2 * 3 * 100 + 2
    for column in columns:
        for first, end in itertools.pairwise(edges):
            shown = column[kept[(kept >= first) & (kept < end)]]
            assert shown.min() == column[first:end].min()
            assert shown.max() == column[first:end].max()


def test_a_gap_stays_a_gap_when_points_are_left_out() -> None:
    column = np.sin(np.arange(1000) / 10)
    column[205:240] = np.nan
    column[777] = np.nan
    kept = display.extremes([column], display.even_edges(1000, 20))
    assert np.isnan(column[kept[(kept >= 205) & (kept < 240)]]).any()
    assert 777 in kept


def test_groups_on_a_logarithmic_axis_cover_every_point_once_and_start_with_single_points() -> None:
    edges = display.log_edges(65_536, 1000)
    assert edges[0] == 0
    assert edges[-1] == 65_536
    assert np.all(np.diff(edges) > 0)
    assert np.all(np.diff(edges)[:20] == 1)


def test_the_strongest_part_is_where_the_burst_is_whatever_the_offset() -> None:
    target = np.full(10_000, 50.0)
    target[6_000:6_400] += np.sin(np.arange(400) / 5)
    first, end = display.strongest_span(target, rate_hz=100.0, span_s=4.0)
    assert (first, end) == (pytest.approx(6_000, abs=3), pytest.approx(6_400, abs=3))
    assert display.strongest_span(target[:300], rate_hz=100.0, span_s=4.0) == (0, 300)


def test_rest_far_from_the_mean_is_not_the_strongest_part() -> None:
    target = 0.1 * np.sin(np.arange(10_000) / 8) - 0.2
    target[:1_000] = 0.0
    target[7_000:7_400] += 0.1 * np.sin(np.arange(400) / 8 + 7_000 / 8)
    first, _ = display.strongest_span(target, rate_hz=100.0, span_s=4.0)
    assert first == pytest.approx(7_000, abs=20)


def test_the_frequencies_shown_first_hold_the_weight_and_stay_within_the_bins() -> None:
    frequency = np.arange(1, 1001) * 0.1
    weights = np.zeros(1000)
    weights[19:50] = 1 / 31  # 2 to 5 Hz
    numbers = (1.0, 0.0, 0.0, 3.5, 1 + 0j, 1000, 0.1, 200.0, 2000)
    numbers: Any = dict.fromkeys(NUMBERS, float("nan"))
    numbers |= {"equivalent_frequency_hz": 3.5, "frequency_hz": frequency, "weights": weights}
    about: Any = {"fei": 1 + 0j, "n_bins": 1000, "delta_f_hz": 0.1, "rate_hz": 200.0, "n_samples": 2000}
    tracking = Tracking(**numbers, **about, settings=Settings())
    low, high = display.judged_range(tracking) or (0.0, 0.0)
    assert frequency[0] <= low < 2.0
    assert 5.0 < high <= frequency[-1]


@pytest.mark.parametrize(
    ("unit", "label"), [("mm", "Displacement (mm)"), ("kN", "Signal (kN)"), (None, "Signal (unit not stated)")]
)
def test_only_a_length_is_called_a_displacement(unit: str | None, label: str) -> None:
    assert display.with_unit(display.quantity(unit), unit) == label
