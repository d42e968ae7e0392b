"""Values from outside: ../shared/reference/expected.json, and the golden set that lives in the repository.

Every entry within 1e-9 where P = 1 and within 1e-6 where P > 1, relative, as the project promises.
"""

from __future__ import annotations

import csv
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import make_golden
import rthstrack
import tracking_twin as twin
from published import published, published_moving
from tolerances import physical, round_off

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared"
GOLDEN = ROOT / "tests" / "golden"
FULL = physical(1e-9, "relative")
DECIMATED = physical(1e-6, "relative")
NUMBERS = ("amplitude", "phase_rad", "equivalent_frequency_hz", "delay_s")
KEYS = {
    "P": "data_decimation",
    "Q": "frequency_decimation",
    "method": "decimator",
    "power": "weight_power",
    "window": "window",
    "detrend": "detrend",
    "band": "band_hz",
}


def _tolerance(settings: dict[str, Any]) -> float:
    return FULL if settings.get("data_decimation", 1) == 1 else DECIMATED


def _name(case: dict[str, Any]) -> str:
    settings = ",".join(f"{k}={v}" for k, v in case["settings"].items()) or "defaults"
    return f"{case.get('pair', case.get('signal'))}[{settings}]"


# --- ../shared ------------------------------------------------------------------------------------------------------


def _expected() -> list[Any]:
    path = SHARED / "reference" / "expected.json"
    if not path.is_file():
        reason = "../shared (records and reference values) is not beside the repository"
        return [pytest.param({}, marks=pytest.mark.skip(reason=reason), id="absent")]
    return [pytest.param(case, id=_name(case)) for case in json.loads(path.read_text(encoding="utf-8"))]


@cache
def _shared_pair(name: str) -> tuple[twin.Floats, twin.Floats]:
    """Target and measured of a reference pair, read with the plainest means: not with our own readers."""
    if name == "utfsm_chirp_0A":
        columns = np.loadtxt(SHARED / "records" / f"{name}.csv", delimiter=",", skiprows=1)
        return columns[:, 1].copy(), columns[:, 2].copy()
    if name == "utfsm_15Hz_0A":
        with (SHARED / "records" / f"{name}.txt").open(encoding="utf-8", newline="") as lines:
            rows = list(csv.reader(lines))[7:]
        return np.array([float(row[4]) for row in rows]), np.array([float(row[2]) for row in rows])
    with np.load(SHARED / "reference" / f"{name}.npz") as arrays:
        return arrays["target"], arrays["measured"]


@pytest.mark.parametrize("case", _expected())
def test_package_gives_the_shared_reference_value(case: dict[str, Any]) -> None:
    settings = {KEYS[key]: tuple(v) if isinstance(v, list) else v for key, v in case["settings"].items()}
    target, measured = _shared_pair(case["pair"])
    ours = published(target, measured, case["rate_hz"], **settings)
    assert ours.n_bins == case["n_bins"]
    assert ours.delta_f_hz == case["delta_f_hz"]
    for name in NUMBERS:
        assert_allclose(getattr(ours, name), case[name], rtol=_tolerance(settings), atol=0, err_msg=name)


@pytest.mark.parametrize("case", _expected())
def test_twin_gives_the_shared_reference_value(case: dict[str, Any]) -> None:
    settings = {KEYS[key]: tuple(v) if isinstance(v, list) else v for key, v in case["settings"].items()}
    target, measured = _shared_pair(case["pair"])
    theirs = twin.evaluate(target, measured, case["rate_hz"], **settings)
    assert theirs["n_bins"] == case["n_bins"]
    assert theirs["delta_f_hz"] == case["delta_f_hz"]
    for name in NUMBERS:
        assert_allclose(dict(theirs)[name], case[name], rtol=round_off(4, 1024), atol=0, err_msg=name)


# --- tests/golden ---------------------------------------------------------------------------------------------------

STORED = json.loads((GOLDEN / "golden.json").read_text(encoding="utf-8"))


@cache
def _golden_signal(name: str) -> tuple[float, twin.Floats, twin.Floats, twin.Floats]:
    columns = np.loadtxt(GOLDEN / f"{name}.csv", delimiter=",", skiprows=1)
    target, measured, force = (np.ascontiguousarray(column) for column in columns.T)
    return STORED["signals"][name]["rate_hz"], target, measured, force


def _settings(case: dict[str, Any]) -> dict[str, Any]:
    return {k: tuple(v) if isinstance(v, list) else v for k, v in case["settings"].items()}


def _cases(key: str) -> list[Any]:
    assert STORED[key], f"golden.json holds no {key}"
    return [pytest.param(case, id=_name(case)) for case in STORED[key]]


def test_golden_files_are_what_the_script_writes(tmp_path: Path) -> None:
    make_golden.write(tmp_path)
    names = sorted(path.name for path in GOLDEN.iterdir())
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    assert len(names) == len(STORED["signals"]) + 1
    for name in names:
        if name.endswith(".csv"):
            assert (tmp_path / name).read_bytes() == (GOLDEN / name).read_bytes(), name
    again = json.loads((tmp_path / "golden.json").read_text(encoding="utf-8"))
    for key in ("numpy", "scipy"):  # other releases may write other last digits, not other values
        again["provenance"].pop(key)
        assert STORED["provenance"][key]
    _assert_alike(
        again, {**STORED, "provenance": {k: v for k, v in STORED["provenance"].items() if k in again["provenance"]}}
    )


def _assert_alike(a: Any, b: Any, path: str = "golden") -> None:
    """The same structure, and numbers that differ by rounding only."""
    if isinstance(a, dict):
        assert a.keys() == b.keys(), path
        for key in a:
            _assert_alike(a[key], b[key], f"{path}.{key}")
    elif isinstance(a, list) and a and not isinstance(a[0], float):
        assert len(a) == len(b), path
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            _assert_alike(x, y, f"{path}[{i}]")
    elif isinstance(a, float) or (isinstance(a, list) and a):
        x, y = np.array(a, dtype=float), np.array(b, dtype=float)
        scale = max(1.0, float(np.nanmax(np.abs(y), initial=0.0)))
        assert_allclose(x, y, rtol=0, atol=round_off(16, 1024, scale), equal_nan=True, err_msg=path)
    else:
        assert a == b, path


@pytest.mark.parametrize("case", _cases("evaluations"))
def test_package_gives_the_golden_value(case: dict[str, Any]) -> None:
    rate, target, measured, _ = _golden_signal(case["signal"])
    settings = _settings(case)
    ours = published(target, measured, rate, **settings)
    assert ours.n_bins == case["n_bins"]
    assert ours.delta_f_hz == case["delta_f_hz"]
    tolerance = _tolerance(settings)
    # A phase near zero has no relative accuracy of its own: the error of FEI is relative to |FEI|.
    fei = complex(*case["fei"])
    assert_allclose(complex(ours.fei), fei, rtol=tolerance, atol=0, err_msg="fei")
    assert_allclose(ours.amplitude, case["amplitude"], rtol=tolerance, atol=0, err_msg="amplitude")
    assert_allclose(
        ours.equivalent_frequency_hz, case["equivalent_frequency_hz"], rtol=tolerance, atol=0, err_msg="f_eq"
    )
    assert_allclose(ours.phase_rad, case["phase_rad"], rtol=tolerance, atol=physical(tolerance, "rad"))
    radian_s = 1 / (2 * np.pi * case["equivalent_frequency_hz"])
    assert_allclose(ours.delay_s, case["delay_s"], rtol=tolerance, atol=physical(tolerance * radian_s, "s"))


@pytest.mark.parametrize("case", _cases("moving"))
def test_package_gives_the_golden_moving_readings(case: dict[str, Any]) -> None:
    rate, target, measured, _ = _golden_signal(case["signal"])
    settings = _settings(case)
    ours = published_moving(target, measured, rate, **settings)
    assert_allclose(ours.time_s, case["time_s"], rtol=round_off(4, 1), atol=0)
    assert ours.valid.tolist() == case["valid"]
    assert len(case["valid"]) > 2
    for name in NUMBERS:
        expected = np.array(case[name], dtype=float)
        scale = np.nanmax(np.abs(expected))
        assert_allclose(
            getattr(ours, name), expected, rtol=0, atol=_tolerance(settings) * scale, equal_nan=True, err_msg=name
        )


@pytest.mark.parametrize("case", _cases("responses"))
def test_package_gives_the_golden_frequency_response(case: dict[str, Any]) -> None:
    rate, target, measured, _ = _golden_signal(case["signal"])
    ours = rthstrack.frequency_response(target, measured, rate, align_s=0.0, **_settings(case))
    expected = np.array([complex(*pair) for pair in case["response"]])
    assert_allclose(ours.frequency_hz, case["frequency_hz"], rtol=round_off(4, 1), atol=0)
    for name in ("target_psd", "measured_psd"):
        density = np.array(case[name])
        assert_allclose(getattr(ours, name), density, rtol=FULL, atol=round_off(64, 1, density.max()), err_msg=name)
    # Where the target has next to nothing, gain and coherence are quotients of rounding errors.
    judged = np.array(case["target_psd"]) > 1e-12 * np.max(case["target_psd"])
    assert judged.sum() > 20
    assert_allclose(ours.gain[judged], np.abs(expected[judged]), rtol=FULL, atol=0)
    turn = np.exp(1j * ours.phase_rad[judged])
    assert_allclose(turn, (expected / np.abs(expected))[judged], rtol=0, atol=physical(FULL, "rad"))
    assert_allclose(ours.coherence[judged], np.array(case["coherence"])[judged], rtol=0, atol=FULL)


@pytest.mark.parametrize("case", [pytest.param(case, id=case["signal"]) for case in STORED["indices"]])
def test_package_gives_the_golden_indices_and_histories(case: dict[str, Any]) -> None:
    rate, target, measured, force = _golden_signal(case["signal"])
    expected = {name: value for name, value in case.items() if name != "signal"}
    max_lag_s = make_golden.longest_lag_s(len(target), rate)
    ours = rthstrack.indices(target, measured, rate, force=force, max_lag_s=max_lag_s)
    for name, value in expected.items():
        assert_allclose(getattr(ours, name), value, rtol=FULL, atol=0, err_msg=name)

    histories = rthstrack.index_histories(target, measured, rate, force=force)
    theirs = twin.index_histories(target, measured, force)
    for name, value in theirs.items():
        history = getattr(histories, name)
        scale = float(np.max(np.abs(value)))
        assert_allclose(history, value, rtol=0, atol=round_off(16, len(value), scale), err_msg=name)
        # The whole record's index is where its history ends.
        assert_allclose(history[-1], expected[name], rtol=FULL, atol=0, err_msg=name)


def test_without_force_there_is_no_energy_error() -> None:
    rate, target, measured, _ = _golden_signal("multisine")
    assert rthstrack.indices(target, measured, rate).energy_error is None
    assert rthstrack.index_histories(target, measured, rate).energy_error is None
