"""The numbers of one assessment at full precision, as the page carries them."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.evaluation.results import json_ready
from rthstrack.said import coded
from rthstrack.verdict import display
from rthstrack.verdict.entry import result_entry
from rthstrack.verdict.sentence import reason

if TYPE_CHECKING:
    from rthstrack.said import Said
    from rthstrack.verdict.assessment import Assessment

NOT_DETERMINED = "not determined"


def result_record(assessment: Assessment) -> dict[str, Any]:
    """The numbers of one assessment at full precision, ready for JSON; a number that is not determined is None."""
    a = assessment
    # The page draws the curves.
    record = result_entry(a, curves=False)
    record |= {
        "part": a.part,
        "start_s": a.start_s,
        "indices": dataclasses.asdict(a.indices),
        "moving": None,
        "trusted_moving": None,
        "response": None,
        "warnings": a.warnings,
        "not_determined": _reasons(a),
    }
    if a.moving is not None:
        record["moving"] = {
            "window_s": a.moving.window_s,
            "hop_s": a.moving.hop_s,
            "minimum_std_ratio": a.moving.minimum_std_ratio,
            "n_readings": int(a.moving.time_s.size),
            "n_valid": int(np.count_nonzero(a.moving.valid)),
        }
    if a.trusted_moving is not None:
        known = a.trusted_moving.valid
        record["trusted_moving"] = {
            "n_valid": int(np.count_nonzero(known)),
            "n_intervals": int(np.count_nonzero(np.isfinite(a.trusted_moving.delay_interval_s[:, 0]))),
            "reasons": [{"n": n, "first": text} for n, text in display.reasons(a.trusted_moving)],
        }
    if a.response is not None:
        names = ("segment_s", "overlap", "n_segments", "window", "detrend", "align_s", "dispersion")
        record["response"] = {name: getattr(a.response, name) for name in names}
    return {key: json_ready(value) for key, value in record.items()}


def _reasons(a: Assessment) -> dict[str, str]:
    reasons: dict[str, str] = {}
    for name in ("amplitude", "delay_s", "phase_rad", "equivalent_frequency_hz"):
        if not math.isfinite(getattr(a.tracking, name)):
            reasons[name] = _why(reason(a.tracking))
    for index in dataclasses.fields(a.indices):
        value = getattr(a.indices, index.name)
        if value is None:
            needs_force = index.name == "energy_error"
            reasons[index.name] = "needs the measured force" if needs_force else "was not evaluated"
        elif not math.isfinite(value):
            reasons[index.name] = "the evaluation gave no finite number"
    if (text := reason(a.trusted)) is not None:
        reasons["trusted"] = _why(text)
    if a.slopes is None:
        reasons["slopes"] = _why(a.slopes_note)
    if a.moving is None:
        reasons["moving"] = _why(a.moving_note)
    if a.response is None:
        reasons["response"] = _why(a.response_note)
    return reasons


def _why(note: Said | None) -> str:
    """A note of the assessment as the reason alone; what it is the reason for is said where it is shown."""
    return "was not evaluated" if note is None else coded(note).cause
