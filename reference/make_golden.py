"""Writes tests/golden: short signals with the values that the NumPy twin gives for them.

    python reference/make_golden.py

The signals are made up, deterministic and rounded to 0.0001 mm, as a data acquisition system would write them, so that
the text files hold every bit. The values come from tracking_twin.py alone, never from the package.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

import tracking_twin as twin

GOLDEN = Path(__file__).resolve().parent.parent / "tests" / "golden"
DECIMALS = 4


class Signal(NamedTuple):
    """A made-up test: displacements in mm at `rate_hz`, and what is special about it."""

    what: str
    rate_hz: float
    target: twin.Floats
    measured: twin.Floats
    force: twin.Floats


def _signal(what: str, rate_hz: float, target: twin.Floats, measured: twin.Floats) -> Signal:
    """Rounds, and adds the force (kN) of a spring with some friction so that energy can be asked for."""
    target, measured = np.round(target, DECIMALS), np.round(measured, DECIMALS)
    velocity = np.asarray(np.gradient(measured), dtype=np.float64) * rate_hz
    force = np.round(1.3 * measured + 4.0 * np.tanh(velocity / 20.0), DECIMALS)
    return Signal(what, rate_hz, target, measured, force)


def _multisine(t: twin.Floats) -> twin.Floats:
    lines = [(6.0, 0.83, 0.3), (4.0, 2.41, 1.1), (2.5, 3.97, -0.7), (1.0, 7.3, 2.2), (0.4, 14.9, 0.1)]
    x = np.zeros_like(t)
    for a, f, phase in lines:
        x += a * np.sin(2 * np.pi * f * t + phase)
    return x


def _first_order_lag(x: twin.Floats, alpha: float) -> twin.Floats:
    """y_i = y_{i-1} + (x_i - y_{i-1}) / alpha: an actuator that needs alpha steps."""
    y = np.zeros_like(x)
    for i in range(1, len(x)):
        y[i] = y[i - 1] + (x[i] - y[i - 1]) / alpha
    return y


def _hysteretic(t: twin.Floats) -> twin.Floats:
    """Growing and fading cycles that leave a residual displacement behind, as a yielding structure does."""
    strong = np.exp(-(((t - 3.0) / 1.6) ** 2))
    return np.asarray(12.0 * strong * np.sin(2 * np.pi * 1.1 * t) + 7.0 / (1.0 + np.exp(-3.0 * (t - 3.2))))


def signals() -> dict[str, Signal]:
    """All made-up tests by name. Lengths: even, odd, a power of two, one more than a power of two, and very short."""
    noise = np.random.default_rng(20140820)
    made = {}

    t = np.arange(1000) / 256.0
    made["multisine"] = _signal(
        "five sines; measured is 0.93 of the target 12 ms earlier", 256.0, _multisine(t), 0.93 * _multisine(t - 0.012)
    )
    t = np.arange(2049) / 512.0
    sweep = 8.0 * np.sin(2 * np.pi * (0.5 * t + 0.5 * (20.0 - 0.5) / t[-1] * t**2))
    made["chirp_first_order_lag"] = _signal(
        "0.5 to 20 Hz sweep through a first-order actuator of 9 steps; 2^11 + 1 samples",
        512.0,
        sweep,
        _first_order_lag(sweep, 9.0),
    )
    t = np.arange(1501) / 200.0
    made["drifting_hysteretic"] = _signal(
        "residual displacement; measured 1.05 times, 8 ms late, with an offset; odd length",
        200.0,
        _hysteretic(t),
        1.05 * _hysteretic(t - 0.008) + 0.35,
    )
    white = noise.standard_normal((2, 1024))
    coloured = 3.0 * _first_order_lag(white[0], 6.0)
    made["noise_leading"] = _signal(
        "coloured noise; measured leads by 3 samples and has noise of its own; 2^10 samples",
        1000.0,
        coloured,
        0.88 * np.roll(coloured, -3) + 0.05 * white[1],
    )
    t = np.arange(2000) / 1000.0
    tone = 10.0 * np.sin(2 * np.pi * 310.0 * t)
    made["tone_above_the_band"] = _signal(
        "nearly all energy at 310 Hz, the response of interest below 30 Hz is 200 times smaller",
        1000.0,
        tone + 0.05 * _multisine(t),
        0.6 * np.roll(tone, 1) + 0.055 * _multisine(t - 0.005),
    )
    t = np.arange(333) / 100.0
    made["odd_333"] = _signal("odd and short", 100.0, _multisine(t), 1.1 * _multisine(t - 0.031) - 0.5)
    t = np.arange(65) / 50.0
    made["two_to_the_6_plus_1"] = _signal("2^6 + 1 samples", 50.0, _multisine(t), _multisine(t + 0.02))
    made["shortest"] = _signal(
        "the fewest samples that can be judged", 8.0, np.array([0.0, 3.0, -1.0, 2.0]), np.array([0.5, 2.5, -0.25, 1.0])
    )
    return made


def settings_for(signal: Signal) -> list[dict[str, Any]]:
    """Settings to evaluate a signal with: each alone, then several together; only those that keep a bin."""
    many: list[dict[str, Any]] = [{}]
    many += [{"window": w} for w in ("hann", "hamming", "blackman", "flattop", "tukey")]
    many += [{"detrend": d} for d in ("mean", "linear")]
    many += [{"weight_power": power} for power in (1, 3, 4)]
    many += [{"frequency_decimation": Q} for Q in (2, 4, 16)]
    many += [{"data_decimation": P} for P in (2, 4, 8, 16)]
    many += [{"data_decimation": P, "decimator": "chebyshev"} for P in (2, 4, 8, 16)]
    many += [{"data_decimation": 2, "frequency_decimation": Q} for Q in (2, 8)]
    many += [{"data_decimation": 4, "frequency_decimation": 4, "decimator": "chebyshev"}]
    band = (signal.rate_hz / 200.0, signal.rate_hz / 8.0)
    many += [
        {"band_hz": band},
        {"band_hz": band, "frequency_decimation": 2, "window": "hann"},
        {"band_hz": band, "data_decimation": 4, "detrend": "mean"},
        {"window": "hann", "detrend": "linear", "frequency_decimation": 4},
        {"window": "tukey", "detrend": "mean", "data_decimation": 4, "weight_power": 3},
        {"window": "flattop", "detrend": "linear", "data_decimation": 4, "decimator": "chebyshev", "weight_power": 1},
    ]
    if len(signal.target) < 28:  # the padding of the zero-phase filter: 3 (2 * 4 sections + 1) samples at either end
        many = [s for s in many if s.get("decimator") != "chebyshev"]
    return [s for s in many if _keeps_bins(signal, s)]


def _keeps_bins(signal: Signal, settings: dict[str, Any]) -> bool:
    keys = ("data_decimation", "frequency_decimation", "decimator", "window", "detrend", "band_hz")
    return len(twin.spectra(*signal[2:4], signal.rate_hz, **{k: settings[k] for k in keys if k in settings})[0]) > 0


def _plain(value: Any) -> Any:
    """JSON's own types: lists for arrays, null for NaN, a pair for a complex number."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return [_plain(v) for v in value.tolist()]
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, complex):
        return [value.real, value.imag]
    return None if isinstance(value, float) and np.isnan(value) else value


def golden() -> dict[str, Any]:
    """The twin's values for all signals, as JSON's own types, with their provenance."""
    made = signals()
    evaluations, moving, responses, indices = [], [], [], []
    for name, s in made.items():
        pair = s.target, s.measured
        for settings in settings_for(s):
            values = twin.evaluate(*pair, s.rate_hz, **settings)
            evaluations.append({"signal": name, "settings": settings, **values})
        indices.append(
            {"signal": name, **twin.indices(*pair, s.rate_hz, s.force, longest_lag_s(len(s.target), s.rate_hz))}
        )
    windows: list[tuple[str, dict[str, Any]]] = [
        ("drifting_hysteretic", {"window_s": 1.0, "hop_s": 0.25}),
        ("drifting_hysteretic", {"window_s": 1.5, "hop_s": 0.1, "window": "hann", "detrend": "linear"}),
        ("chirp_first_order_lag", {"window_s": 0.5, "hop_s": 0.125, "data_decimation": 4}),
        ("chirp_first_order_lag", {"window_s": 0.75, "hop_s": 0.25, "data_decimation": 2, "frequency_decimation": 2}),
        ("multisine", {"window_s": 1.0, "hop_s": 1.0, "data_decimation": 2, "decimator": "chebyshev"}),
        ("noise_leading", {"window_s": 0.2, "hop_s": 0.05, "band_hz": (5.0, 120.0), "weight_power": 3}),
    ]
    for name, settings in windows:
        s = made[name]
        readings = twin.evaluate_moving(s.target, s.measured, s.rate_hz, **settings)
        moving.append({"signal": name, "settings": settings, **readings})
    for name, segment, window, detrend in (
        ("multisine", 256, "hann", "mean"),
        ("noise_leading", 128, "hamming", "linear"),
        ("chirp_first_order_lag", 200, "boxcar", "none"),
    ):
        s = made[name]
        response = twin.frequency_response(s.target, s.measured, s.rate_hz, segment, segment // 2, window, detrend)
        welch = {"segment_s": segment / s.rate_hz, "overlap": 0.5, "window": window, "detrend": detrend}
        responses.append({"signal": name, "settings": welch, **response})
    everything: dict[str, Any] = _plain(
        {
            "provenance": {
                "written_by": "reference/make_golden.py",
                "values_from": "reference/tracking_twin.py",
                "numpy": np.__version__,
                "scipy": scipy.__version__,
            },
            "signals": {n: {"rate_hz": s.rate_hz, "n_samples": len(s.target), "what": s.what} for n, s in made.items()},
            "evaluations": evaluations,
            "moving": moving,
            "responses": responses,
            "indices": indices,
        }
    )
    return everything


def longest_lag_s(n_samples: int, rate_hz: float) -> float:
    """Where J1 is searched: a tenth of the record, at least a sample, at most 0.5 s."""
    return min(0.5, max(1, n_samples // 10) / rate_hz)


def write(folder: Path) -> None:
    """One CSV per signal and golden.json, one case a line."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, s in signals().items():
        columns = np.column_stack([s.target, s.measured, s.force])
        header = "target_mm,measured_mm,force_kN"
        np.savetxt(folder / f"{name}.csv", columns, fmt=f"%.{DECIMALS}f", delimiter=",", header=header, comments="")
    lines = []
    for key, value in golden().items():
        if isinstance(value, list):
            cases = ",\n  ".join(json.dumps(case) for case in value)
            lines.append(f'"{key}": [\n  {cases}\n]')
        else:
            lines.append(f'"{key}": {json.dumps(value, indent=2)}')
    (folder / "golden.json").write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    write(GOLDEN)
    print(f"written to {GOLDEN}", file=sys.stderr)
