"""The trusted estimate beside the published one: its numbers, which of both to use, and why something is missing."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import assessments as examples
import rthstrack
from rthstrack.cli import main
from rthstrack.report import report_html, result_record
from tolerances import physical

RATE, N = 256.0, 256 * 60
T = np.arange(N) / RATE
Signal = np.ndarray[Any, np.dtype[np.float64]]


def burst(delay_s: float = 0.0) -> Signal:
    """A burst of 1 Hz, 10 mm high, at rest at both ends."""
    t = T - delay_s
    return 10 * np.sin(2 * np.pi * t) * np.exp(-((t - 25) ** 2) / 120)


def broad(delay_s: float = 0.0, seed: int = 3, filtered: Callable[[Signal], Any] = lambda f: 1.0) -> Signal:
    """Random motion of even power from 0.5 to 10 Hz, standard deviation about 1, late and filtered as asked."""
    f = np.fft.rfftfreq(N, 1 / RATE)
    phases = np.random.default_rng(seed).random(f.size)
    spectrum = np.where((f > 0.5) & (f < 10), np.exp(2j * np.pi * (phases - f * delay_s)), 0)
    return 450 * np.fft.irfft(spectrum * filtered(f), N)


def noise(std: float, seed: int = 1) -> Signal:
    return std * np.random.default_rng(seed).standard_normal(N)


def first_order(f: Signal) -> Any:
    """An actuator with a corner at 5 Hz: d(f) = atan(f / 5 Hz) / (2 pi f), falling from 31.8 ms."""
    return 1 / (1 + 1j * f / 5)


def sine(t: Signal) -> Signal:
    return np.sin(2 * np.pi * 5 * t)


def assessed(target: Signal, measured: Signal, **options: Any) -> rthstrack.Assessment:
    """The published average, unless another estimate is asked for, with the trusted one beside it."""
    return rthstrack.assess(target, measured, RATE, settings=rthstrack.Settings(**{"estimator": "fei"} | options))


# ------------------------------------------------------------------------------------------------- what is computed


def test_the_trusted_estimate_is_least_squares_on_every_sample_and_frees_the_sensors_of_a_shared_zero() -> None:
    chosen = {"data_decimation": 4, "frequency_decimation": 2, "window": "tukey", "band_hz": (0.5, 5.0)}
    found = assessed(burst(), burst(0.01) + 3, max_delay_s=0.1, **chosen)
    expected = rthstrack.Settings("least_squares", window="tukey", detrend="mean", band_hz=(0.5, 5.0), max_delay_s=0.1)
    assert found.trusted.settings == expected
    assert found.trusted_moving is not None
    assert found.trusted_moving.settings == expected
    assert found.tracking.settings.data_decimation == 4
    assert found.trusted.delay_s == pytest.approx(0.01, abs=physical(1.0, "us"))
    assert assessed(burst(), burst(0.01), detrend="linear").trusted.settings.detrend == "linear"


def test_what_was_asked_for_is_not_computed_twice() -> None:
    for options in ({}, {"detrend": "mean"}):
        found = assessed(burst(), burst(0.01), estimator="least_squares", **options)
        assert found.trusted is found.tracking
        assert found.trusted_moving is found.moving
        assert found.published is found.beside is not found.tracking
    other = assessed(burst(), burst(0.01), estimator="least_squares", detrend="none")
    assert other.trusted is other.beside is not other.tracking
    published = assessed(burst(), burst(0.01))
    assert published.published is published.tracking
    assert published.published_moving is published.moving


def test_trusted_windows_are_those_of_the_moving_evaluation() -> None:
    found = assessed(burst(), burst(0.01))
    assert found.moving is not None
    assert found.trusted_moving is not None
    np.testing.assert_array_equal(found.trusted_moving.time_s, found.moving.time_s)


def test_the_response_is_aligned_at_the_delay_and_carries_intervals() -> None:
    found = assessed(broad(), broad(0.02) + noise(0.1))
    assert found.response is not None
    assert found.slopes is not None
    assert found.response.align_s == found.slopes.align_s == found.trusted.delay_s
    inside = (found.response.frequency_hz > 1) & (found.response.frequency_hz < 9)
    low, high = found.response.delay_interval_s[inside].T
    # 95 of 100 independent bins would hold the truth; that fewer than four fifths do is no chance.
    assert np.mean((low <= 0.02) & (high >= 0.02)) > 0.8


def test_a_burst_of_constant_delay_has_no_slope() -> None:
    found = assessed(burst(), 0.99 * burst(0.01) + noise(0.01))
    assert found.slopes is not None
    assert not found.slopes.delay_varies
    assert "not one number" not in found.argument


def test_a_record_too_short_for_segments_says_why_there_is_no_line() -> None:
    found = rthstrack.assess(burst()[6000:6100], burst(0.01)[6000:6100], RATE)
    assert found.slopes is None
    assert found.slopes_note is not None
    assert found.slopes_note.startswith("not determined: ")


# ------------------------------------------------------------------------------------------------- which one to use


def test_agreement_is_said_in_a_word() -> None:
    found = assessed(burst(), 0.99 * burst(0.01) + noise(0.05))
    low, high = found.trusted.delay_interval_s
    assert low <= found.tracking.delay_s <= high
    assert found.argument == "the published average agrees with the trusted estimate within its interval"
    assert found.variants == {}


def test_agreement_within_a_wide_interval_is_said_to_be_worth_little() -> None:
    found = assessed(burst(), burst(0.01) + noise(5))
    low, high = found.trusted.delay_interval_s
    assert high - low > 0.002  # the test's own premise: more than a tenth of 10 ms to either side
    assert "wide" in found.argument


@pytest.mark.parametrize(
    ("cause", "target", "measured", "settings", "remedy"),
    [
        ("an offset", burst() + 8, burst(0.01) + 8, {}, "--detrend linear"),
        (
            "a residual displacement",
            burst() + 8 * np.tanh((T - 25) / 2),
            burst(0.01) + 8 * np.tanh((T - 25.01) / 2),
            {},
            "--window hann",
        ),
        ("noise above", broad() + noise(0.05), broad(0.002) + noise(0.05, 2), {}, "--band 0"),
        ("phases from 32 to 3", broad(), broad(0.09), {}, ""),
        ("hann window", broad()[2000:2600], broad(0.002)[2000:2600], {"window": "hann"}, "--estimator aligned"),
    ],
    ids=["offset", "drift", "noise", "phases", "window"],
)
def test_the_cause_of_a_difference_is_named_and_removing_it_is_shown_to_help(
    cause: str, target: Signal, measured: Signal, settings: dict[str, Any], remedy: str
) -> None:
    found = assessed(target, measured, **settings)
    assert found.argument.startswith("use the trusted estimate: the published average gives ")
    assert cause in found.argument
    assert remedy in found.argument


def test_a_delay_that_varies_is_told_with_its_slope_instead_of_one_number() -> None:
    found = assessed(broad(), broad(filtered=first_order))
    assert found.argument.startswith("the delay is not one number: ")
    assert "falling by" in found.argument
    told = [
        float(word.strip("();,")) for word in found.argument.split() if word.strip("();,").replace(".", "").isdigit()
    ]
    # The line as told departs from the actuator's own curve by no more than it says, its two ends included.
    value, at, slope, _, _, low, high, misfit = told[:8]
    f = np.linspace(low, high, 101)
    away = np.abs(value - slope * (f - at) - 1e3 * np.arctan(f / 5) / (2 * np.pi * f))
    assert away.max() < misfit + 0.1
    assert not any("not one number" in warning for warning in found.warnings)


def test_a_delay_that_varies_a_little_is_one_number_with_its_slope_added() -> None:
    # d(f) = 20 ms - 0.1 ms f / Hz: 5 % less at 10 Hz than at 0.5 Hz.
    found = assessed(broad(), broad(filtered=lambda f: np.exp(-2j * np.pi * f * (0.02 - 1e-4 * f))))
    sentence, _, slope = found.argument.partition("; ")
    assert sentence.startswith("use the trusted estimate: ")
    words = slope.split()
    assert words[:5] == ["the", "delay", "is", "falling", "by"]
    assert float(words[5]) == pytest.approx(0.1, rel=physical(1, "%"))


def test_a_delay_that_changes_over_time_is_told_with_its_range() -> None:
    delay_s = 0.01 + 0.02 * T / T[-1]
    measured = np.interp(T - delay_s, T, broad()) + noise(0.02)
    found = assessed(broad(), measured)
    assert "the delay is not one number: " in found.argument
    assert "over time" in found.argument


def test_noise_on_target_is_not_taken_for_a_change_over_time() -> None:
    found = assessed(burst() + noise(0.3, 5), burst(0.01) + noise(0.3, 6))
    assert "over time" not in found.argument


def test_foreign_motion_is_not_taken_for_a_change_over_time() -> None:
    found = assessed(burst(), burst(0.01) + 20 * broad(seed=9))
    assert "over time" not in found.argument
    assert any("coherence" in warning for warning in found.warnings)


def test_a_warning_that_the_argument_says_is_not_given_twice() -> None:
    found = assessed(burst() + 8, burst(0.01) + 8)
    assert "an offset" in found.argument
    assert not any("an offset" in warning for warning in found.warnings)


# ------------------------------------------------------------------------------------------------- what is missing

UNDETERMINED = [
    ("does not move", burst(), np.zeros(N), {}),
    ("of a cycle", np.sin(T / 50), np.sin((T - 0.02) / 50) + noise(1e-4), {}),
    ("of measured follows target", broad(), broad(seed=9), {}),
    ("ambiguous", sine(T), sine(T - 0.02) + noise(1e-3), {"max_delay_s": 0.3}),
    ("beyond max_delay_s", broad(), broad(0.09), {"max_delay_s": 0.05}),
    ("opposite sign", burst(), -burst(0.01), {}),
]
NO_INTERVAL = [
    ("the residual follows target", broad(), broad(filtered=first_order), {}),
    ("too few frequency bins", burst(), burst(0.01) + noise(0.1), {"band_hz": (1.0, 1.1)}),
]


def names(cases: list[Any]) -> list[str]:
    return [case[0] for case in cases]


@pytest.mark.parametrize(("words", "target", "measured", "settings"), UNDETERMINED, ids=names(UNDETERMINED))
def test_what_cannot_be_determined_is_data_with_a_reason(
    words: str, target: Signal, measured: Signal, settings: dict[str, Any]
) -> None:
    found = assessed(target, measured, **settings)
    assert words in str(found.trusted.reason)
    assert math.isnan(float(found.trusted.delay_s))
    assert math.isnan(float(found.trusted.amplitude))
    assert words in found.argument
    assert words in report_html([found])
    assert words in result_record(found)["not_determined"]["trusted"]


@pytest.mark.parametrize(("words", "target", "measured", "settings"), NO_INTERVAL, ids=names(NO_INTERVAL))
def test_an_interval_that_nothing_supports_is_withheld(
    words: str, target: Signal, measured: Signal, settings: dict[str, Any]
) -> None:
    found = assessed(target, measured, **settings)
    assert words in str(found.trusted.reason)
    assert math.isfinite(float(found.trusted.delay_s))
    assert math.isnan(found.trusted.delay_interval_s[0])
    record = result_record(found)
    assert record["trusted"]["delay_interval_s"] is None
    assert record["trusted"]["delay_s"] == found.trusted.delay_s


def saved(tmp_path: Path, target: Signal, measured: Signal) -> Path:
    path = tmp_path / "test.npz"
    np.savez(path, target=target, measured=measured, rate_hz=RATE)
    return path


def options_of(settings: dict[str, Any]) -> list[str]:
    found = []
    for name, value in settings.items():
        values = value if isinstance(value, tuple) else (value,)
        found += [f"--{name.removesuffix('_s').removesuffix('_hz').replace('_', '-')}", *map(str, values)]
    return found


@pytest.mark.parametrize(
    ("words", "target", "measured", "settings"), UNDETERMINED + NO_INTERVAL, ids=names(UNDETERMINED + NO_INTERVAL)
)
@pytest.mark.parametrize("estimator", ["fei", "least_squares"])
def test_the_command_ends_well_and_says_why(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    estimator: str,
    words: str,
    target: Signal,
    measured: Signal,
    settings: dict[str, Any],
) -> None:
    file = saved(tmp_path, target, measured)
    arguments = ["evaluate", str(file), "--estimator", estimator, *options_of(settings)]
    assert main([*arguments, "--json"]) == 0

    def refuse(token: str) -> None:
        raise AssertionError(f"{token} is no JSON")

    (result,) = json.loads(capsys.readouterr().out, parse_constant=refuse)["results"]
    trusted = result["trusted"]
    assert words in trusted["reason"]
    assert trusted["estimator"] == "least_squares"
    assert trusted["delay_interval_s"] is None
    assert trusted["amplitude_interval"] is None
    undetermined = words in names(UNDETERMINED)
    assert (trusted["delay_s"] is None) == (trusted["amplitude"] is None) == undetermined
    if estimator == "least_squares":
        assert words in result["reason"]
        assert (result["delay_s"] is None) == undetermined
    assert (
        main([*arguments, "--report", str(tmp_path / "r.html"), "--csv", str(tmp_path / "r.csv"), "--moving", "4"]) == 0
    )
    out = capsys.readouterr().out
    assert words in out
    assert "nan" not in out.lower()
    for row in csv.reader((tmp_path / "r.csv").read_text(encoding="utf-8").splitlines()):
        assert "nan" not in row
    for row in csv.reader((tmp_path / "r_moving.csv").read_text(encoding="utf-8").splitlines()):
        assert "nan" not in row


def test_json_and_csv_hold_the_trusted_numbers(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    target, measured = broad(), 0.97 * broad(0.02) + noise(0.05)
    file, table = saved(tmp_path, target, measured), tmp_path / "r.csv"
    command = ["evaluate", str(file), "--estimator", "fei", "--json", "--csv", str(table), "--moving", "4"]
    assert main(command) == 0
    (result,) = json.loads(capsys.readouterr().out)["results"]
    trusted = assessed(target, measured).trusted
    assert result["trusted"] == {
        "estimator": "least_squares",
        "amplitude": trusted.amplitude,
        "amplitude_interval": list(trusted.amplitude_interval),
        "delay_s": trusted.delay_s,
        "delay_interval_s": list(trusted.delay_interval_s),
        "target_noise_std": 0.0,
        "bad_samples": [],
        "reason": None,
        "reason_code": None,
        "reason_values": [],
    }
    low, high = result["trusted"]["delay_interval_s"]
    # Twice the interval: that chance alone takes the truth out of it happens once in 10,000 noises.
    assert abs(0.02 - trusted.delay_s) < high - low
    assert result["amplitude_interval"] is result["delay_std_s"] is result["reason"] is None
    assert result["slopes"]["reason"] is None
    assert result["slopes"]["delay_varies"] is False
    (row,) = csv.DictReader(table.read_text(encoding="utf-8").splitlines())
    assert float(row["trusted.delay_interval_low_s"]) == low
    assert float(row["trusted.delay_interval_high_s"]) == high
    assert row["delay_interval_low_s"] == ""
    readings = list(csv.DictReader(table.with_stem("r_moving").read_text(encoding="utf-8").splitlines()))
    assert all(reading["delay_interval_low_s"] == "" for reading in readings)
    known = [r for r in readings if r["trusted_delay_interval_low_s"]]
    assert known
    assert all(float(r["trusted_delay_interval_low_s"]) < float(r["trusted_delay_s"]) for r in known)


def test_the_estimator_asked_for_gives_the_top_level_numbers_and_takes_the_limits(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    # The published average of so wide a band loses most of the amplitude, see method: A = |mean of exp(-j 2 pi f d)|.
    file = saved(tmp_path, broad(), broad(0.09) + noise(0.01))
    limited = ["evaluate", str(file), "--limit-amplitude", "0.1", "--json"]
    assert main([*limited, "--estimator", "fei"]) == 3
    assert json.loads(capsys.readouterr().out)["results"][0]["amplitude"] < 0.5
    assert main(limited) == 0
    (result,) = json.loads(capsys.readouterr().out)["results"]
    assert result["amplitude"] == result["trusted"]["amplitude"] == pytest.approx(1, abs=physical(0.1, "%"))
    assert result["amplitude_interval"] == result["trusted"]["amplitude_interval"]
    assert result["settings"]["estimator"] == "least_squares"


@pytest.mark.parametrize(
    "options",
    [
        ["--estimator", "fei", "--noise", "coloured"],
        ["--estimator", "fei", "--noise-ratio", "1"],
        ["--estimator", "aligned", "--noise", "coloured"],
        ["--estimator", "least_squares", "--noise", "coloured", "--noise-ratio", "1"],
        ["--weight-power", "1"],
        ["--estimator", "aligned", "--decimator", "chebyshev", "-P", "4"],
        ["-P", "auto"],
        ["--max-delay", "0"],
        ["--expected-delay", "0.3"],
        ["--expected-delay", "-0.1", "--max-delay", "0.05", "--estimator", "aligned"],
        ["--expected-delay", "nan"],
    ],
    ids=" ".join,
)
def test_settings_that_exclude_each_other_are_misuse(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, options: list[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["evaluate", str(saved(tmp_path, burst(), burst(0.01))), *options])
    assert stop.value.code == 2
    assert "error: " in capsys.readouterr().err.splitlines()[0]


def test_options_of_the_estimators_reach_them(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = saved(tmp_path, broad() + noise(0.2, 5), broad(0.02) + noise(0.2, 6))
    chosen = ["--estimator", "least_squares", "--noise-ratio", "1", "--max-delay", "0.1"]
    assert main(["evaluate", str(file), *chosen, "--json"]) == 0
    (result,) = json.loads(capsys.readouterr().out)["results"]
    told = {"noise_ratio": 1.0, "max_delay_s": 0.1, "expected_delay_s": None, "noise": "white"}
    assert told.items() <= result["settings"].items()


PERIOD_S = 0.2  # of `sine`


@pytest.mark.parametrize("estimator", ["fei", "aligned", "least_squares"])
def test_of_turns_of_a_tone_the_trusted_estimate_takes_the_one_nearest_to_the_expected_delay(estimator: str) -> None:
    target, measured = sine(T), sine(T - 0.02) + noise(1e-3)
    assert "ambiguous" in assessed(target, measured, estimator=estimator).trusted.reason
    for expected, delay in [(0, 0.02), (np.float32(0.15), 0.02 + PERIOD_S), (-0.25, 0.02 - PERIOD_S)]:
        found = assessed(target, measured, estimator=estimator, expected_delay_s=expected)
        assert found.trusted.delay_s == pytest.approx(delay, abs=physical(10.0, "us"))
        assert found.trusted_moving is not None
        np.testing.assert_allclose(found.trusted_moving.delay_s, delay, atol=physical(50.0, "us"))
        assert found.settings["expected_delay_s"] == found.trusted.settings.expected_delay_s == pytest.approx(expected)
        # The published evaluation looks for no turn: half of one is its most.
        own = 0.02 if estimator == "fei" else delay
        assert found.tracking.delay_s == pytest.approx(own, abs=physical(20.0, "us"))


def test_an_expected_delay_is_for_the_estimators_that_look_for_one() -> None:
    for call in (rthstrack.evaluate, rthstrack.evaluate_moving):
        with pytest.raises(rthstrack.SettingError, match=r"expected_delay_s = 0.01 goes only with estimator"):
            call(burst(), burst(), RATE, estimator="fei", expected_delay_s=0.01)
        for wrong in ("soon", 0.3, -0.3, math.nan, math.inf):
            with pytest.raises(rthstrack.SettingError, match=r"expected_delay_s must be (a finite number|at most)"):
                call(burst(), burst(), RATE, estimator="aligned", expected_delay_s=wrong)
    with pytest.raises(rthstrack.SettingError, match=r"expected_delay_s must be at most max_delay_s, 0.25 s, either"):
        assessed(burst(), burst(), expected_delay_s=0.3)


def test_the_expected_delay_of_the_command_line_is_the_trusted_estimates(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = saved(tmp_path, sine(T), sine(T - 0.02) + noise(1e-3))
    report = tmp_path / "report.html"
    assert main(["evaluate", str(file), "--expected-delay", "0", "--json", "--report", str(report)]) == 0
    (result,) = json.loads(capsys.readouterr().out)["results"]
    assert result["trusted"]["delay_s"] == pytest.approx(0.02, abs=physical(10.0, "us"))
    assert (result["settings"]["estimator"], result["settings"]["expected_delay_s"]) == ("least_squares", 0.0)
    page = report.read_text(encoding="utf-8")
    assert '>Expected delay</th><td data-setting="expected_delay_s">0 s<' in page
    assert "of turns that fit equally well the one nearest to 0 s" in page
    study = ["study", str(file), "-P", "1", "-Q", "1", "--windows", "boxcar", "--no-timing", "--json"]
    assert main([*study, "--estimator", "aligned", "--expected-delay", "0.2"]) == 0
    found = json.loads(capsys.readouterr().out)["study"]
    assert found["settings"]["expected_delay_s"] == 0.2
    assert [cell["delay_s"] for cell in found["cells"]] == pytest.approx([0.22], abs=physical(20.0, "us"))
    assert main([*study, "--expected-delay", "0.2"]) == 2
    assert "--expected-delay = 0.2 goes only with estimator aligned or least_squares" in capsys.readouterr().err
    assert main([*study, "--estimator", "aligned", "--expected-delay", "0.3"]) == 2
    assert "--expected-delay must be at most --max-delay, 0.25 s, either way, not 0.3" in capsys.readouterr().err


def test_study_takes_the_estimators_too(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = saved(tmp_path, broad(), broad(0.02))
    study = ["study", str(file), "-P", "1,2", "-Q", "1", "--windows", "boxcar", "--no-timing", "--json"]
    assert main([*study, "--estimator", "least_squares", "--max-delay", "0.1"]) == 0
    found = json.loads(capsys.readouterr().out)["study"]
    assert [cell["delay_s"] for cell in found["cells"]] == pytest.approx([0.02, 0.02], abs=physical(1.0, "us"))
    assert found["settings"]["max_delay_s"] == 0.1
    assert main([*study, "--estimator", "least_squares", "--weight-powers", "1"]) == 2
    assert main([*study, "--estimator", "aligned", "--share", "0.9"]) == 2
    assert main([*study, "--estimator", "least_squares", "--max-delay", "0.005"]) == 0
    cells = json.loads(capsys.readouterr().out)["study"]["cells"]
    assert all(cell["delay_s"] is None and "max_delay_s" in cell["reason"] for cell in cells)


# ------------------------------------------------------------------------------------------------- how it is shown


def test_the_text_shows_both_estimates_side_by_side(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    target, measured = broad(), 0.97 * broad(0.02) + noise(0.05)
    assert main(["evaluate", str(saved(tmp_path, target, measured))]) == 0
    lines = capsys.readouterr().out.splitlines()
    head = next(i for i, line in enumerate(lines) if "published (fei)" in line)
    assert "trusted (least squares), 95 % interval" in lines[head]
    trusted = assessed(target, measured).trusted
    low, high = (1e3 * end for end in trusted.delay_interval_s)
    places = 1 - math.floor(math.log10((high - low) / 2))  # two digits of half the interval
    assert f"{1e3 * trusted.delay_s:.{places}f} ms ({low:.{places}f} to {high:.{places}f})" in lines[head + 2]


@pytest.mark.parametrize(
    ("value", "interval", "text"),
    [
        (12.00341, (12.00123, 12.00567), "12.0034 (12.0012 to 12.0057)"),
        (-3.14159, (-3.3, -2.98), "-3.14 (-3.30 to -2.98)"),
        (250.0, (190.0, 310.0), "250 (190 to 310)"),
        (5.0, (5.0, 5.0), "5.000000 (5.000000 to 5.000000)"),
        (0.02, (math.nan, math.nan), "0.02"),
        (math.nan, (math.nan, math.nan), "not determined"),
    ],
)
def test_half_the_interval_decides_how_many_digits_are_written(
    value: float, interval: tuple[float, float], text: str
) -> None:
    assert rthstrack.verdict.display.with_interval(value, interval) == text


def test_the_figure_shows_both_estimates_with_a_band() -> None:
    from rthstrack import plots

    found = assessed(broad(), broad(0.02) + noise(0.05))
    amplitude_axis, delay_axis = plots.plot_moving(found)
    assert found.moving is not None
    assert found.trusted_moving is not None
    drawn = {line.get_label(): np.asarray(line.get_ydata()) for line in delay_axis.lines}
    np.testing.assert_allclose(drawn["published"], 1e3 * found.moving.delay_s)
    np.testing.assert_allclose(drawn["trusted"], 1e3 * found.trusted_moving.delay_s)
    assert len(amplitude_axis.collections) == len(delay_axis.collections) == 1
    gain_axis, own_delay_axis, _ = plots.plot_frequency_response(found)
    assert len(gain_axis.collections) == len(own_delay_axis.collections) == 1


def test_the_page_says_why_there_is_no_interval() -> None:
    page = report_html([assessed(broad(), broad(filtered=first_order))])
    assert 'data-field="trusted_reason">no interval: ' in page
    assert "trusted_reason" not in report_html([assessed(burst(), burst(0.01) + noise(0.1))])


def test_windows_without_numbers_are_counted_by_their_kind_of_reason() -> None:
    measured = np.where(T < 22, burst(0.01), 3 * broad(seed=9)) + noise(0.05)
    moving = assessed(burst(), measured).trusted_moving
    assert moving is not None
    counted = rthstrack.verdict.display.reasons(moving)
    assert sum(n for n, _ in counted) == sum(bool(reason) for reason in moving.reason)
    assert [n for n, _ in counted] == sorted((n for n, _ in counted), reverse=True)
    assert len(counted) == len({text.split("(")[0].rstrip("0123456789. ") for _, text in counted})
    assert all(text in moving.reason for _, text in counted)


def test_the_page_holds_both_estimates() -> None:
    found = examples.judged(broad(), broad(0.02) + noise(0.05), RATE)
    page = report_html([found])
    assert 'data-field="argument"' in page
    low, high = found.trusted.delay_interval_s
    assert f'data-field="delay_interval_s" data-low="{low!r}" data-high="{high!r}"' in page
    assert f'data-field="published_delay_s" value="{found.published.delay_s!r}"' in page
    record = result_record(found)
    assert record["trusted"]["delay_interval_s"] == [low, high]
    assert record["trusted_moving"]["n_intervals"] > 0


def test_an_estimate_that_is_not_determined_is_not_said_to_agree_and_keeps_no_limit() -> None:
    t = np.arange(8192) / 1024
    target = np.exp(-(((t - 4) / 1.5) ** 2)) * np.sin(2 * np.pi * 1.7 * t)
    measured = np.exp(-(((t - 4.03) / 1.5) ** 2)) * np.sin(2 * np.pi * 1.7 * (t - 0.03))
    settings = rthstrack.Settings(estimator="aligned", max_delay_s=0.01)
    found = rthstrack.assess(target, measured, 1024, settings=settings, limits=rthstrack.Limits(delay_s=0.001))
    assert found.exceeded == ()
    assert found.outcome == "not_judged"
    assert [said.code for said in found.not_judged] == ["limit_undetermined"]
    assert "agrees" not in found.argument
    assert "beyond max_delay_s" in str(found.tracking.reason)
