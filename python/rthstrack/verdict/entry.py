"""An assessment as an entry of the JSON output."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from rthstrack.evaluation.bad_samples import BadSamples
from rthstrack.evaluation.results import NUMBERS, is_interval, json_ready
from rthstrack.said import coded
from rthstrack.verdict.sentence import reason

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rthstrack.evaluation.response import FrequencyResponse, FrequencySlopes
    from rthstrack.evaluation.tracking import Tracking
    from rthstrack.said import Said
    from rthstrack.verdict.assessment import Assessment


def result_entry(a: Assessment, *, curves: bool = True) -> dict[str, Any]:
    """One result as `rthstrack evaluate --json` prints it: numbers at full precision, None where not determined.

    curves: with those over time and frequency.
    """
    t, moving = a.tracking, a.moving
    warnings = (*a.warnings, *a.exceeded, *a.not_judged)
    entry: dict[str, Any] = {
        "file": a.file,
        "actuator": a.actuator,
        "actuator_number": a.actuator_number,
        "actuator_name": a.actuator_name,
        "target": a.target_name,
        "measured": a.measured_name,
        "unit": a.unit,
        "rate_hz": a.rate_hz,
        "verdict": a.verdict,
        "estimator": t.settings.estimator,
        "n_samples": t.n_samples,
        **numbers(t, NUMBERS[:4]),
        "n_bins": t.n_bins,
        "delta_f_hz": t.delta_f_hz,
        **numbers(t, [name for name in NUMBERS[4:] if name not in OF_TRUSTED]),
        **_told(reason(t)),
        "trusted": _estimate_entry(a.trusted),
        "published": _estimate_entry(a.published),
        "slopes": _slopes_entry(a.slopes, a.slopes_note),
        "depends_on": a.depends_on,
        "dependence": None if a.dependence is None else a.dependence.to_dict(),
        "settings": a.settings,
        # The force that others need is not given.
        "indices": {name: value for name, value in dataclasses.asdict(a.indices).items() if value is not None},
        "argument": a.argument,
        "limits": dataclasses.asdict(a.limits),
        "outcome": a.outcome,
        "exceeded": a.exceeded,
        "not_judged": a.not_judged,
        "gates": [gate.to_dict() for gate in a.gates],
        "conclusion": a.conclusion or None,
        "loop": None if a.loop is None else a.loop.to_dict(),
        "warnings": warnings,
        "warning_codes": [{"code": said.code, "values": said.values} for said in map(coded, warnings)],
        "moving": None if moving is None or not curves else {name: getattr(moving, name) for name in _MOVING},
        "moving_note": a.moving_note,
        "frequency_response": None if a.response is None or not curves else _curves(a.response),
        "frequency_response_note": a.response_note,
    }
    if not curves:
        del entry["moving"], entry["frequency_response"]
    return {key: json_ready(value) for key, value in entry.items()}


#: What is told of the trusted estimate alone.
OF_TRUSTED = ("target_noise_std",)


def numbers(t: Tracking, names: Iterable[str]) -> dict[str, Any]:
    """The numbers of these names."""
    return {name: _ends(getattr(t, name)) if is_interval(name) else getattr(t, name) for name in names}


def _told(why: Said | None) -> dict[str, Any]:
    """Why a number or an interval is missing, in words and as code and values."""
    if why is None:
        return {"reason": None, "reason_code": None, "reason_values": []}
    why = coded(why)
    return {"reason": why, "reason_code": why.code, "reason_values": why.values}


def _ends(interval: Any) -> list[float] | None:
    """Lower and upper end; None where there is no interval, rather than two ends that are none."""
    ends = [float(end) for end in interval]
    return ends if all(map(math.isfinite, ends)) else None


#: What JSON holds of the moving windows, arrays.
_MOVING = (
    "window_s", "hop_s", "time_s", "amplitude", "delay_s", "amplitude_interval", "delay_interval_s", "valid",
    "reason_code",
)  # fmt: skip


def _curves(response: FrequencyResponse) -> dict[str, Any]:
    """Gain and delay over frequency, a list each."""
    return {name: json_ready(column) for name, column in response.columns().items()}


def _estimate_entry(t: Tracking) -> dict[str, Any]:
    return {
        "estimator": t.settings.estimator,
        **numbers(t, ("amplitude", "amplitude_interval", "delay_s", "delay_interval_s", *OF_TRUSTED)),
        "bad_samples": [dataclasses.asdict(bad) for bad in t.bad_samples if isinstance(bad, BadSamples)],
        **_told(reason(t)),
    }


_SLOPES = (
    "equivalent_frequency_hz", "gain", "gain_interval", "gain_per_hz", "gain_per_hz_interval", "gain_misfit",
    "gain_varies", "delay_s", "delay_interval_s", "delay_s_per_hz", "delay_s_per_hz_interval", "delay_misfit_s",
    "delay_varies", "band_hz",
)  # fmt: skip


def _slopes_entry(slopes: FrequencySlopes | None, note: Said | None) -> dict[str, Any]:
    entry: dict[str, Any] = {name: None if slopes is None else getattr(slopes, name) for name in _SLOPES}
    for name in _SLOPES:
        if slopes is not None and is_interval(name):
            entry[name] = _ends(entry[name])
    return entry | _told(note)
