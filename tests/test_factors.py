"""P and Q chosen by the program, and key frequencies, against sums over numpy.fft; in Python and as commands."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rthstrack import Settings, assess, choose_factors, evaluate, evaluate_moving, key_frequencies
from rthstrack.cli import main
from rthstrack.errors import SettingError, SignalError
from rthstrack.evaluation.factors import prior_bounds
from rthstrack.studies import Pair, Study, study
from tolerances import physical, round_off

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "benchmarks"))
import accuracy_factors

RATE = 200.0
PUBLISHED = Settings("fei")
FEI = ("--estimator", "fei")
NEAR_ZERO_RAD = 0.001


def response(delay_s: float, gain: float = 1.05, n: int = 6000) -> tuple[np.ndarray, np.ndarray]:
    """A decaying 1.7 Hz response with a ripple of 23 Hz, and its late copy; each with noise of its own."""
    noise = np.random.default_rng(4)

    def at(t: np.ndarray) -> np.ndarray:
        t = np.maximum(t, 0)
        return np.exp(-0.6 * t) * np.sin(2 * np.pi * 1.7 * t) + 0.01 * np.exp(-t) * np.sin(2 * np.pi * 23 * t)

    t = np.arange(n) / RATE
    return at(t) + 1e-3 * noise.standard_normal(n), gain * at(t - delay_s) + 1e-3 * noise.standard_normal(n)


def fei_of(target: np.ndarray, measured: np.ndarray, keep: np.ndarray, power: int = 2) -> tuple[float, float, float]:
    """A, phi and d over the bins `keep` of the zero-padded transform, from the definition."""
    n = 1 << (len(target) - 1).bit_length()
    i, o = np.fft.rfft(target, n)[keep], np.fft.rfft(measured, n)[keep]
    weights = np.abs(i) ** power / np.sum(np.abs(i) ** power)
    fei = np.sum(o / i * weights)
    phase = float(np.angle(fei))
    return float(np.abs(fei)), phase, -phase / (2 * np.pi * float(np.sum(keep * RATE / n * weights)))


def kept(n_samples: int, p: int, q: int) -> np.ndarray:
    half = (1 << (n_samples - 1).bit_length()) // 2
    return np.arange(q, half // p + 1, q)


def changes(target: np.ndarray, measured: np.ndarray, p: int, q: int) -> tuple[float, float]:
    """Change of A and of d (of the phase, near zero) from P = Q = 1, from the definition."""
    a1, phase1, d1 = fei_of(target, measured, kept(len(target), 1, 1))
    a, phase, d = fei_of(target, measured, kept(len(target), p, q))
    return abs(a / a1 - 1), abs(phase - phase1) if abs(phase1) < NEAR_ZERO_RAD else abs(d / d1 - 1)


@pytest.mark.parametrize(("delay_s", "measure"), [(0.012, "relative"), (-0.02, "relative"), (0.0, "phase")])
@pytest.mark.parametrize("tolerance", [1e-4, 0.005, 0.05])
def test_the_choice_is_the_largest_whose_smaller_ones_all_qualify(
    delay_s: float, measure: str, tolerance: float
) -> None:
    target, measured = response(delay_s)
    found = choose_factors(target, measured, RATE, tolerance=tolerance)
    assert found.delay_measure == measure
    powers = [1 << s for s in range(13)]
    within = {
        (p, q): kept(len(target), p, q).size > 0 and max(changes(target, measured, p, q)) <= tolerance
        for p in powers
        for q in powers
    }
    best = max(
        (p * q, q, p) for p, q in within if all(within[a, b] for a in powers for b in powers if a <= p and b <= q)
    )
    assert (found.data_decimation, found.frequency_decimation) == (best[2], best[1])
    amplitude, delay = changes(target, measured, best[2], best[1])
    spare = physical(1e-6, "relative")
    assert amplitude <= found.amplitude_bound <= min(tolerance, amplitude + spare)
    assert delay <= found.delay_bound <= min(tolerance, delay + spare)


def test_the_bound_holds_for_the_evaluation_and_the_settings_are_ready_for_it() -> None:
    target, measured = response(0.012)
    settings: dict[str, Any] = {"window": "hann", "detrend": "linear", "weight_power": 3, "band_hz": (0.2, 40.0)}
    found = choose_factors(target, measured, RATE, **settings)
    assert found.settings.window == "hann"
    settings = {"estimator": "fei"} | settings
    reference = evaluate(target, measured, RATE, **settings)
    chosen = evaluate(
        target,
        measured,
        RATE,
        data_decimation=found.data_decimation,
        frequency_decimation=found.frequency_decimation,
        **settings,
    )
    assert abs(chosen.amplitude / reference.amplitude - 1) <= found.amplitude_bound <= 0.005
    assert abs(chosen.delay_s / reference.delay_s - 1) <= found.delay_bound <= 0.005
    assert found.reference.delay_s == pytest.approx(reference.delay_s, rel=round_off(1, 8192))
    assert (found.reference.n_bins, found.reference.delta_f_hz) == (reference.n_bins, reference.delta_f_hz)
    assert f"P = {found.data_decimation}, Q = {found.frequency_decimation} change A by at most" in found.sentence


def test_the_table_holds_every_pair() -> None:
    target, measured = response(0.012)
    found = choose_factors(target, measured, RATE)
    table = found.changes
    pairs = list(zip(table.data_decimation.tolist(), table.frequency_decimation.tolist(), strict=True))
    assert len(pairs) == len(set(pairs)) == sum(13 - i for i in range(13))
    for index in (0, 3, 17, 40):
        p, q = pairs[index]
        amplitude, delay = changes(target, measured, p, q)
        assert table.n_bins[index] == kept(len(target), p, q).size
        assert table.amplitude[index] == pytest.approx(amplitude, rel=1e-5, abs=physical(1e-6, "relative"))
        assert table.delay[index] == pytest.approx(delay, rel=1e-5, abs=physical(1e-6, "relative"))
    assert len(found.to_frame()) == len(pairs)
    with pytest.raises(FrozenInstanceError):
        found.tolerance = 1.0  # type: ignore[misc]


@pytest.mark.parametrize("seeds", [range(k, k + 100) for k in range(0, 600, 100)], ids=lambda r: f"{r[0]} on")
def test_the_bound_holds_on_hostile_pairs(seeds: range) -> None:
    found = [accuracy_factors.judge_hostile(seed) for seed in seeds]
    assert not [f"{f.case.name}, {f.case.kind}: {f.what}" for f in found if not f.kept]
    # Not by taking P = Q = 1.
    assert sum(f.larger for f in found) > sum(f.judged for f in found) / 2


@pytest.mark.parametrize("noise", [0.0, 1e-15, 1e-12])
def test_a_delay_that_may_have_either_sign_has_no_bound(noise: float) -> None:
    target, _ = response(0.0)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        measured = -1.3 * target + noise * target.std() * rng.standard_normal(target.size)
        found = choose_factors(target, measured, RATE, tolerance=0.002)
        assert abs(float(found.reference.phase_rad)) > 3.14159
        assert (found.data_decimation, found.frequency_decimation, found.delay_bound) == (1, 1, 0.0)
        assert np.isinf(found.changes.delay[1:]).all()
        assert np.isfinite(found.changes.amplitude[1:]).any()


def test_a_target_without_noise_leaves_no_direction_to_unit_weights() -> None:
    # l = 1 gives bins that hold only round-off the share of what measured's noise is there.
    n = 4096
    target = np.sin(2 * np.pi * 40 * np.arange(n) / n)
    measured = target + 0.1 * np.random.default_rng(2).standard_normal(n)
    by_power = {
        power: choose_factors(target, measured, RATE, tolerance=0.05, weight_power=power).changes for power in (1, 2)
    }
    assert by_power[1].amplitude[1] > 0.5 > 1e-3 > by_power[2].amplitude[1]


def cut_off(n: int = 3000) -> tuple[np.ndarray, np.ndarray]:
    """A steady motion of many frequencies that neither begins nor ends at rest, and its late copy."""
    steps = np.arange(60)
    pulse = np.hanning(60) * np.sin(steps / 5)
    motion = np.convolve(np.random.default_rng(0).standard_normal(n + 400), pulse, "same") + 0.3
    return motion[200 : 200 + n], 1.05 * motion[196 : 196 + n]


def test_the_window_that_would_allow_a_larger_q_is_said_and_nothing_is_changed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    target, measured = cut_off()
    found = choose_factors(target, measured, RATE)
    windowed = found.windowed
    assert windowed is not None
    assert (found.settings.window, found.settings.detrend) == ("boxcar", "none")
    assert (windowed.window, windowed.detrend) == ("hann", "mean")
    assert windowed.frequency_decimation > found.frequency_decimation
    settings = {"window": windowed.window, "detrend": windowed.detrend}
    own = choose_factors(target, measured, RATE, **settings)
    assert (own.data_decimation, own.frequency_decimation) == (windowed.data_decimation, windowed.frequency_decimation)
    assert (own.amplitude_bound, own.delay_bound) == (windowed.amplitude_bound, windowed.delay_bound)
    assert own.windowed is None, "nothing is left to propose"
    assert choose_factors(target, measured, RATE, frequency_decimation=2).windowed is None, "Q was given"
    path = tmp_path / "cut.csv"
    np.savetxt(path, np.column_stack([np.arange(target.size) / RATE, target, measured]), delimiter=",",
               header="time (s),target (mm),measured (mm)", comments="", fmt="%.17g")  # fmt: skip
    status, out, _ = run(capsys, path, "--estimator", "fei", "-P", "auto", "-Q", "auto")
    assert status == 0
    assert windowed.sentence in " ".join(out.split())
    (entry,) = json.loads(run(capsys, path, "--estimator", "fei", "-P", "auto", "-Q", "auto", "--json")[1])["results"]
    assert entry["settings"]["chosen_factors"]["windowed"]["frequency_decimation"] == windowed.frequency_decimation
    assert entry["settings"]["window"] == "boxcar"


def test_a_given_factor_stays() -> None:
    target, measured = response(0.012)
    found = choose_factors(target, measured, RATE, frequency_decimation=4)
    assert found.frequency_decimation == 4
    assert found.reference.settings.frequency_decimation == 4
    assert set(found.changes.frequency_decimation.tolist()) == {4}
    at_one = evaluate(target, measured, RATE, PUBLISHED, frequency_decimation=4)
    assert found.reference.delta_f_hz == at_one.delta_f_hz
    assert "from P = 1, Q = 4" in found.sentence


def test_prior_bounds_are_safe_but_shy() -> None:
    target, measured = response(0.012)
    for bounds in prior_bounds(target, measured, RATE):
        for p, q, amplitude, delay in zip(
            bounds.data_decimation.tolist(), bounds.frequency_decimation.tolist(), bounds.amplitude, bounds.delay,
            strict=True,
        ):  # fmt: skip
            found = changes(target, measured, p, q)
            assert found[0] <= amplitude + round_off(1, 8192)
            assert found[1] <= delay + round_off(100, 8192)


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        ({"tolerance": 0}, SettingError, "tolerance must be a number between 0 and 1, both excluded, not 0"),
        ({"tolerance": float("nan")}, SettingError, "tolerance must be"),
        ({"tolerance": "small"}, SettingError, "tolerance must be a number, not 'small'"),
        ({"data_decimation": 3}, SettingError, "data_decimation must be a power of two"),
        ({"frequency_decimation": 1 << 20}, SettingError, "no frequency bin is left"),
        ({"decimator": "chebyshev"}, SettingError, "spectral decimator only"),
        ({"windw": "hann"}, SettingError, "unknown setting windw"),
    ],
)
def test_impossible_choices_are_one_clear_line(changed: dict[str, Any], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words) as caught:
        choose_factors(*response(0.012), RATE, **changed)
    assert "\n" not in str(caught.value)


def test_samples_that_cannot_be_judged_are_refused() -> None:
    target, measured = response(0.012)
    broken = np.where(np.arange(target.size) == 9, np.nan, measured)
    with pytest.raises(SignalError, match="measured has 1 NaN or infinite sample"):
        choose_factors(target, broken, RATE)
    with pytest.raises(SignalError, match="one actuator at a time"):
        choose_factors(np.ones((9, 2)), np.ones((9, 2)), RATE)
    silent = choose_factors(target, np.zeros_like(target), RATE)
    assert (silent.data_decimation, silent.frequency_decimation, silent.amplitude_bound) == (1, 1, 0.0)


# --- key frequencies ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.5, 0.9, 0.99, 0.999])
@pytest.mark.parametrize("power", [1, 2, 3])
def test_key_frequencies_are_the_fewest_and_only_they_count(share: float, power: int) -> None:
    target, measured = response(0.012)
    key = key_frequencies(target, RATE, share, weight_power=power)
    everything = kept(len(target), 1, 1)
    n = 2 * everything[-1]
    weights = np.abs(np.fft.rfft(target, n)[everything]) ** power
    weights /= weights.sum()
    order = np.argsort(-weights, kind="stable")
    count = int(np.searchsorted(np.cumsum(weights[order]), share)) + 1
    expected = np.sort(everything[order[:count]])
    assert np.array_equal(np.round(key.frequency_hz * n / RATE).astype(int), expected)
    assert key.share_held == pytest.approx(weights[order[:count]].sum(), rel=round_off(1, n))
    found = key.evaluate(target, measured)
    amplitude, phase, delay_s = fei_of(target, measured, expected, power)
    # the cascade that comes before the sums keeps each bin to 200 dB
    assert found.amplitude == pytest.approx(amplitude, rel=physical(1e-8, "relative"))
    assert found.phase_rad == pytest.approx(phase, abs=physical(1e-8, "rad"))
    assert found.delay_s == pytest.approx(delay_s, rel=physical(1e-6, "relative"))
    assert (found.n_bins, found.settings.weight_power) == (count, power)


def test_key_frequencies_of_a_first_window_serve_the_next() -> None:
    target, measured = response(0.012)
    key = key_frequencies(target[:800], RATE, 0.999, window="hann")
    found = key.evaluate(target[200:1000], measured[200:1000])
    n, window = 1024, np.hanning(800)
    at = np.round(key.frequency_hz * n / RATE).astype(int)
    expected = fei_of(target[200:1000] * window, measured[200:1000] * window, at)
    assert found.amplitude == pytest.approx(expected[0], rel=physical(1e-8, "relative"))
    assert found.delay_s == pytest.approx(expected[2], rel=physical(1e-6, "relative"))
    plain = key.to_dict()
    assert plain["frequency_hz"] == key.frequency_hz.tolist()
    assert "_plan" not in json.dumps(plain)
    assert len(key.to_frame()) == key.frequency_hz.size


def test_key_frequencies_that_cannot_be_are_one_clear_line() -> None:
    target, measured = response(0.012)
    for share in (0, -1, 1.5, float("nan")):
        with pytest.raises(SettingError, match="share must be above 0 and at most 1, not "):
            key_frequencies(target, RATE, share)
    with pytest.raises(SettingError, match="choose the spectral decimator"):
        key_frequencies(target, RATE, decimator="chebyshev")
    with pytest.raises(SettingError, match="unknown setting sahre"):
        key_frequencies(target, RATE, sahre=0.9)
    with pytest.raises(SignalError, match="target is constant"):
        key_frequencies(np.ones(100), RATE)
    with pytest.raises(SignalError, match="one actuator at a time"):
        key_frequencies(np.ones((100, 2)), RATE)
    key = key_frequencies(target, RATE, 0.9)
    with pytest.raises(SignalError, match="planned for 6000 samples, not for 5999"):
        key.evaluate(target[1:], measured[1:])
    with pytest.raises(SignalError, match="measured has 1 NaN"):
        key.evaluate(target, np.where(np.arange(6000) == 5, np.nan, measured))


# --- rthstrack evaluate -----------------------------------------------------------------------------------------------


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    path = tmp_path / "test.csv"
    target, measured = response(0.012)
    np.savetxt(path, np.column_stack([np.arange(target.size) / RATE, target, measured]), delimiter=",",
               header="time (s),target (mm),measured (mm)", comments="", fmt="%.12g")  # fmt: skip
    return path


def run(capsys: pytest.CaptureFixture[str], *arguments: object, command: str = "evaluate") -> tuple[int, str, str]:
    try:
        status = main([command, *map(str, arguments)])
    except SystemExit as stop:
        status = int(stop.code or 0)
    out, err = capsys.readouterr()
    return status, out, err


def test_the_command_prints_the_choice_and_its_bound(
    capsys: pytest.CaptureFixture[str], recorded: Path, tmp_path: Path
) -> None:
    status, out, _ = run(capsys, recorded, *FEI, "-P", "auto", "-Q", "auto", "--tolerance", "0.02", "--json",
                         "--report", tmp_path / "report.html")  # fmt: skip
    assert status == 0
    (entry,) = json.loads(out)["results"]
    target, measured = np.loadtxt(recorded, delimiter=",", skiprows=1, unpack=True)[1:]
    found = choose_factors(target, measured, RATE, tolerance=0.02)
    settings = entry["settings"]
    assert settings["data_decimation"] == found.data_decimation > 1
    assert settings["frequency_decimation"] == found.frequency_decimation
    assert settings["chosen_factors"] == {
        "tolerance": 0.02,
        "amplitude_bound": found.amplitude_bound,
        "delay_bound": found.delay_bound,
        "delay_measure": "relative",
        "reference_data_decimation": 1,
        "reference_frequency_decimation": 1,
        "windowed": None,
    }
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'data-setting="chosen_factors · amplitude_bound"' in report
    status, out, _ = run(capsys, recorded, *FEI, "-P", "auto", "-Q", "auto", "--tolerance", "0.02")
    assert found.sentence in " ".join(out.split())
    assert "windows of 4 s at P = 1, Q = 1: delay" in " ".join(out.split())
    assert "at P = 1, Q = 1" not in run(capsys, recorded)[1]


def test_one_factor_may_be_given(capsys: pytest.CaptureFixture[str], recorded: Path) -> None:
    status, out, _ = run(capsys, recorded, *FEI, "-P", "4", "-Q", "auto", "--json")
    assert status == 0
    settings = json.loads(out)["results"][0]["settings"]
    assert settings["data_decimation"] == settings["chosen_factors"]["reference_data_decimation"] == 4
    assert settings["frequency_decimation"] > 1


def test_moving_windows_keep_the_factors_that_were_given() -> None:
    target, measured = response(0.012)
    found = assess(target, measured, RATE, settings=PUBLISHED, choose=("Q",))
    assert found.tracking.settings.frequency_decimation > 1
    assert found.moving is not None
    assert found.moving.settings.frequency_decimation == 1
    alone = evaluate_moving(target, measured, RATE, PUBLISHED, window_s=found.moving.window_s, hop_s=found.moving.hop_s)
    assert np.array_equal(found.moving.delay_s, alone.delay_s, equal_nan=True)
    with pytest.raises(SettingError, match="estimator = least_squares goes only with P and Q that are given"):
        assess(target, measured, RATE, choose=("Q",))
    with pytest.raises(SettingError, match="choose takes P and Q, not 'R'"):
        assess(target, measured, RATE, choose=("R",))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-P", "3"], "expected a power of two (1, 2, 4, ...) or auto, found '3'"),
        (["-Q", "automatic"], "expected a power of two (1, 2, 4, ...) or auto, found 'automatic'"),
        (["-P", "auto", "--tolerance", "0"], "expected a number between 0 and 1, found '0'"),
        (["-P", "auto", "--tolerance", "1"], "expected a number between 0 and 1, found '1'"),
        (["-P", "auto", "--tolerance", "x"], "expected a number, found 'x'"),
        (["--tolerance", "0.01"], "--tolerance speaks of P and Q that are chosen"),
        (["-P", "auto"], "-P auto and -Q auto need --estimator fei, found least_squares"),
        (
            ["-Q", "auto", *FEI, "--decimator", "chebyshev"],
            "-P auto and -Q auto need --decimator spectral, found chebyshev",
        ),
    ],
)
def test_bad_values_are_misuse(
    capsys: pytest.CaptureFixture[str], recorded: Path, arguments: list[str], words: str
) -> None:
    status, out, err = run(capsys, recorded, *arguments)
    assert (status, out) == (2, "")
    assert words in err.splitlines()[0]


# --- study ----------------------------------------------------------------------------------------------------------


def studied(**asked: Any) -> Study:
    pairs = [Pair(*response(delay_s), RATE, name) for name, delay_s in (("late", 0.012), ("early", -0.02))]
    return study(pairs, P=[1, 2], Q=[1, 2], windows=["boxcar", "hann"], timing=False, **asked)


def test_a_study_holds_the_chosen_factors_and_key_frequencies_beside_its_grid() -> None:
    found = studied(choose=("P", "Q"), tolerance=0.02, shares=(0.9, 0.999))
    assert [c.kind for c in found.cells] == 4 * (["grid"] * 4 + ["chosen", "key", "key"])
    assert [c.kind for c in found.select(source="late")] == ["grid"] * 8
    assert found.cell(source="late", window="hann", P=2).kind == "grid"
    target, measured = response(-0.02)
    reference = evaluate(target, measured, RATE, PUBLISHED, window="hann")
    (chosen,) = found.select(source="early", window="hann", kind="chosen")
    factors = choose_factors(target, measured, RATE, tolerance=0.02, window="hann")
    assert chosen.settings == factors.settings
    assert (chosen.amplitude_bound, chosen.delay_bound) == (factors.amplitude_bound, factors.delay_bound)
    assert (chosen.delay_measure, chosen.tolerance) == ("relative", 0.02)
    assert abs(chosen.delay_change) <= chosen.delay_bound
    few, many = found.select(source="early", window="hann", kind="key")
    key = key_frequencies(target, RATE, 0.999, window="hann").evaluate(target, measured)
    assert (few.share, many.share, many.n_bins, many.delay_s) == (0.9, 0.999, key.n_bins, key.delay_s)
    assert few.n_bins < many.n_bins
    assert many.delay_change == pytest.approx(float(key.delay_s) / float(reference.delay_s) - 1)
    assert {row["kind"] for row in found.rows()} == {"grid", "chosen", "key"}
    (alone,) = studied(choose="P").select(source="late", window="boxcar", kind="chosen")
    assert alone.settings.frequency_decimation == 1 < alone.settings.data_decimation


def test_cells_beside_the_grid_are_timed_too() -> None:
    pair = Pair(*response(0.012), RATE, "late")
    steps: list[tuple[int, int]] = []
    found = study(pair, P=[1], Q=[1], windows="boxcar", choose=("P", "Q"), shares=(0.9,),
                  progress=lambda done, total: steps.append((done, total)))  # fmt: skip
    assert all(cell.computing_time_s > 0 for cell in found.cells)
    assert steps == [(i, 6) for i in range(1, 7)]


def test_what_cannot_be_chosen_is_a_cell_with_a_reason() -> None:
    found = studied(choose=("P", "Q"), shares=(0.9,), band_hz=(0.001, 0.002))
    assert all(cell.reason.startswith("no frequency bin is left") for cell in found.cells)
    assert {cell.kind for cell in found.cells} == {"grid", "chosen", "key"}


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"choose": "R"}, "choose takes P and Q, found 'R'"),
        ({"tolerance": 1}, "tolerance must be a number between 0 and 1"),
        ({"shares": [0]}, "share must be above 0 and at most 1, not 0"),
        ({"shares": [0.9, 0.9]}, "shares hold 0.9 twice"),
        ({"shares": [0.9], "decimator": "chebyshev"}, "for the spectral decimator only, not chebyshev"),
    ],
)
def test_a_study_refuses_nonsense(asked: dict[str, Any], words: str) -> None:
    with pytest.raises(SettingError, match=words):
        studied(**asked)


def test_the_study_command_adds_them_to_its_tables(
    capsys: pytest.CaptureFixture[str], recorded: Path, tmp_path: Path
) -> None:
    asked = ["-P", "1,4,auto", "-Q", "auto", "--tolerance", "0.02", "--share", "0.9,0.99", "--windows", "boxcar"]
    status, out, _ = run(capsys, recorded, *asked, "-o", tmp_path, "--no-figures", command="study")
    assert status == 0
    found = choose_factors(*np.loadtxt(recorded, delimiter=",", skiprows=1, unpack=True)[1:], RATE, tolerance=0.02)
    (line,) = [line for line in out.splitlines() if "chosen: changes A by at most" in line]
    assert line.split()[:2] == [str(found.data_decimation), str(found.frequency_decimation)]
    assert sum("key frequencies hold" in line for line in out.splitlines()) == 2
    with open(tmp_path / "study.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["kind"] for row in rows[-3:]] == ["chosen", "key", "key"]
    assert float(rows[-3]["delay_bound"]) == found.delay_bound
    assert {row["data_decimation"] for row in rows[:-3]} == {"1", "4"}
    assert len({row["frequency_decimation"] for row in rows[:-3]}) == 10, "auto alone keeps the default grid"
    other = tmp_path / "other.csv"
    other.write_bytes(recorded.read_bytes())
    status, out, _ = run(capsys, recorded, other, *asked, "--no-timing", command="study")
    assert sum("chosen: changes A by at most" in line for line in out.splitlines()) == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--tolerance", "0.01"], "--tolerance speaks of P and Q that are chosen"),
        (["-P", "auto", "--tolerance", "2"], "expected a number between 0 and 1, found '2'"),
        (["--share", "0.9,much"], "share must be a number, not 'much'"),
        (["--share", "2"], "share must be above 0 and at most 1, not 2"),
        (["--share", ""], "share is empty: give at least one value"),
        (["-Q", "2,automatic"], "Q must hold powers of two (1, 2, 4, ...), found 'automatic'"),
        (["-P", "auto", "--decimator", "chebyshev"], "for the spectral decimator only, not chebyshev"),
    ],
)
def test_the_study_command_refuses_nonsense(
    capsys: pytest.CaptureFixture[str], recorded: Path, arguments: list[str], words: str
) -> None:
    status, out, err = run(capsys, recorded, *arguments, command="study")
    assert (status, out) == (2, "")
    assert words in err.splitlines()[0]
