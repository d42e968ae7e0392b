"""An assessment as an entry of the JSON output."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from rthstrack.evaluation.bad_samples import BadSamples
from rthstrack.evaluation.results import json_ready
from rthstrack.verdict.sentence import reason

if TYPE_CHECKING:
    from rthstrack.evaluation.response import FrequencySlopes
    from rthstrack.evaluation.tracking import Tracking
    from rthstrack.verdict.assessment import Assessment


def result_entry(a: Assessment) -> dict[str, Any]:
    """One result as `rthstrack evaluate --json` prints it: numbers at full precision, None where not determined."""
    t, i = a.tracking, a.indices
    entry: dict[str, Any] = {
        "file": a.file,
        "actuator": a.actuator,
        "target": a.target_name,
        "measured": a.measured_name,
        "unit": a.unit,
        "rate_hz": a.rate_hz,
        "n_samples": t.n_samples,
        "amplitude": t.amplitude,
        "delay_s": t.delay_s,
        "phase_rad": t.phase_rad,
        "equivalent_frequency_hz": t.equivalent_frequency_hz,
        "n_bins": t.n_bins,
        "delta_f_hz": t.delta_f_hz,
        **_precision(t),
        "residual_coherence": t.residual_coherence,
        "goodness": t.goodness,
        "reason": reason(t),
        "trusted": _trusted_entry(a.trusted),
        "slopes": _slopes_entry(a.slopes, a.slopes_note),
        "depends_on": a.depends_on,
        "dependence": None if a.dependence is None else a.dependence.to_dict(),
        "settings": a.settings,
        "indices": {
            "max_tracking_error": i.max_tracking_error,
            "max_tracking_error_percent": i.max_tracking_error_percent,
            "rms_error": i.rms_error,
            "rms_error_percent": i.rms_error_percent,
            "tracking_indicator": i.tracking_indicator,
            "j1_s": i.j1_s,
            "j2_percent": i.j2_percent,
            "j3_percent": i.j3_percent,
        },
        "argument": a.argument,
        "warnings": [*a.warnings, *a.exceeded],
    }
    return {key: json_ready(value) for key, value in entry.items()}


def _precision(t: Tracking) -> dict[str, Any]:
    return {
        "amplitude_std": t.amplitude_std,
        "amplitude_interval": _ends(t.amplitude_interval),
        "delay_std_s": t.delay_std_s,
        "delay_interval_s": _ends(t.delay_interval_s),
    }


def _ends(interval: Any) -> list[float] | None:
    """Lower and upper end; None where there is no interval, rather than two ends that are none."""
    ends = [float(end) for end in interval]
    return ends if all(map(math.isfinite, ends)) else None


def _trusted_entry(t: Tracking) -> dict[str, Any]:
    return {
        "estimator": t.settings.estimator,
        "amplitude": t.amplitude,
        "amplitude_interval": _ends(t.amplitude_interval),
        "delay_s": t.delay_s,
        "delay_interval_s": _ends(t.delay_interval_s),
        "target_noise_std": t.target_noise_std,
        "bad_samples": [dataclasses.asdict(bad) for bad in t.bad_samples if isinstance(bad, BadSamples)],
        "reason": reason(t),
    }


_SLOPES = (
    "equivalent_frequency_hz", "gain", "gain_interval", "gain_per_hz", "gain_per_hz_interval", "gain_misfit",
    "gain_varies", "delay_s", "delay_interval_s", "delay_s_per_hz", "delay_s_per_hz_interval", "delay_misfit_s",
    "delay_varies", "band_hz",
)  # fmt: skip


def _slopes_entry(slopes: FrequencySlopes | None, note: str | None) -> dict[str, Any]:
    entry: dict[str, Any] = {name: None if slopes is None else getattr(slopes, name) for name in _SLOPES}
    for name in _SLOPES:
        if slopes is not None and "interval" in name:
            entry[name] = _ends(entry[name])
    return entry | {"reason": note}
