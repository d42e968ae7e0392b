"""The twin of reference/estimate_twin.py behind the package's two functions: the tables can be made with either.

Slow, and with the simplest intervals there are: white residuals, or an autoregression of order 4 fitted to them.
"""

from __future__ import annotations

import dataclasses
import sys
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

import rthstrack

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "reference"))
import estimate_twin as twin

ORDER = 4
SAME_FIT = 1e-9  # of the energy: two turns that leave the same cannot be told apart

_targets: dict[int, tuple[Any, twin.Target]] = {}
_lock = threading.Lock()


def evaluate(target: Any, measured: Any, rate_hz: float, *, estimator: str = "fei", **settings: Any) -> Any:
    """As rthstrack.evaluate."""
    if estimator == "fei":
        return rthstrack.evaluate(target, measured, rate_hz, **settings)
    return SimpleNamespace(**_judge(target, measured, rate_hz, 0, None, estimator, **settings))


def evaluate_moving(
    target: Any,
    measured: Any,
    rate_hz: float,
    *,
    window_s: float = 4.0,
    hop_s: float = 0.25,
    minimum_std_ratio: float = 0.05,
    estimator: str = "fei",
    **settings: Any,
) -> Any:
    """As rthstrack.evaluate_moving."""
    if estimator == "fei":
        return rthstrack.evaluate_moving(
            target, measured, rate_hz, window_s=window_s, hop_s=hop_s, minimum_std_ratio=minimum_std_ratio, **settings
        )
    W, H = round(window_s * rate_hz), round(hop_s * rate_hz)
    starts = range(0, len(target) - W + 1, H)
    valid = np.array([np.std(target[s : s + W]) >= minimum_std_ratio * np.std(target) for s in starts])
    nothing = _numbers(np.nan, np.nan, np.nan, np.nan, "too little energy")
    found = [
        _judge(target, measured, rate_hz, s, s + W, estimator, **settings) if judged else nothing
        for s, judged in zip(starts, valid, strict=True)
    ]
    columns: dict[str, Any] = {key: np.array([one[key] for one in found]) for key in nothing}
    columns["reason"] = tuple(one["reason"] for one in found)
    return SimpleNamespace(time_s=(np.array(starts) + (W - 1) / 2) / rate_hz, valid=valid, **columns)


def _judge(
    target: Any,
    measured: Any,
    rate_hz: float,
    start: int,
    stop: int | None,
    estimator: str,
    window: str = "boxcar",
    detrend: str = "none",
    band_hz: tuple[float, float] | None = None,
    weight_power: int = 2,
    max_delay_s: float = 0.25,
    noise: str = "white",
    noise_ratio: float = 0.0,
) -> dict[str, Any]:
    case = twin.Case(_target(target, rate_hz), measured, start, stop, window, detrend, band_hz, max_delay_s=max_delay_s)
    if noise_ratio:
        K, tau, settled = twin.total_least_squares(case, noise_ratio)
        return _numbers(K, tau, np.nan, np.nan, "" if settled else "no convergence")
    turns = twin.turns(case)
    if not turns:
        return _numbers(np.nan, np.nan, np.nan, np.nan, "no convergence")
    found = turns[0][1]
    if len(turns) > 1 and turns[1][0] < turns[0][0] + SAME_FIT:
        return _numbers(np.nan, np.nan, np.nan, np.nan, "ambiguous: another turn fits as well")
    if noise == "coloured":
        left = case.observed() - found.amplitude * case.design(found.delay_s)[:, 0]
        case = dataclasses.replace(case, whitening=tuple(twin.autoregression(left, ORDER)))
        found = twin.least_squares(case, found.delay_s)
    elif estimator == "aligned":
        found = twin.aligned(case, found.delay_s, weight_power)
    if not found.settled:
        return _numbers(np.nan, np.nan, np.nan, np.nan, "no convergence")
    K, tau, _ = found
    if band_hz is not None:
        return _numbers(K, tau, np.nan, np.nan, "")
    if noise == "coloured":
        A = case.design(tau)
        left = case.observed() - K * A[:, 0]
        gain, slope = np.sqrt(np.diag(np.linalg.inv(A.T @ A)) * (left @ left) / (len(left) - 2))
        return _numbers(K, tau, gain, slope / K, "")
    plain = dataclasses.replace(case, window="boxcar")
    left = plain.observed() - K * plain.design(tau)[:, 0]
    white = np.array([left @ left / (len(left) - 2)])
    errors = (
        twin.aligned_errors(case, K, tau, white, weight_power)
        if estimator == "aligned"
        else twin.least_squares_errors(case, K, tau, white)
    )
    return _numbers(K, tau, *errors, "")


def _numbers(K: float, tau: float, amplitude_std: float, delay_std_s: float, reason: str) -> dict[str, Any]:
    return {
        "amplitude": K,
        "delay_s": tau,
        "amplitude_std": amplitude_std,
        "delay_std_s": delay_std_s,
        "amplitude_interval": (K - 1.96 * amplitude_std, K + 1.96 * amplitude_std),
        "delay_interval_s": (tau - 1.96 * delay_std_s, tau + 1.96 * delay_std_s),
        "reason": reason,
    }


def _target(samples: Any, rate_hz: float) -> twin.Target:
    """The spline through a target that many draws share is made once; the last few are kept."""
    with _lock:
        kept = _targets.get(id(samples))
        if kept is not None and kept[0] is samples:
            return kept[1]
        if len(_targets) > 4:
            _targets.clear()
        made = twin.Target(samples, rate_hz)
        _targets[id(samples)] = (samples, made)
        return made
