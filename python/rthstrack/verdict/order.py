"""The order in which many results are shown, by the terminal's table and by the report's."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rthstrack.verdict.limits import EXCEEDED, NOT_JUDGED, PASSED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rthstrack.verdict.assessment import Assessment

#: What many results may be sorted by.
SORTED_BY = ("worst", "given", "file", "delay", "amplitude", "error")
#: What one result, or several of them, do by their outcome, worst first.
HAPPENED = {
    EXCEEDED: ("exceeds a limit", "exceed a limit"),
    NOT_JUDGED: ("cannot be judged", "cannot be judged"),
    PASSED: ("is within the limits", "are within the limits"),
}
#: Outcomes that come before all others, worst first.
WORST = (EXCEEDED, NOT_JUDGED)


def in_order(assessments: Sequence[Assessment], by: str = "worst") -> list[Assessment]:
    """The assessments, by one of SORTED_BY; "worst": failed gates first, then the largest rms error."""

    def downwards(value: float) -> float:
        return -math.inf if math.isnan(value) else -value

    def place(a: Assessment) -> tuple[float | str, ...]:
        error, delay = downwards(a.indices.rms_error_percent), downwards(abs(float(a.tracking.delay_s)))
        if by == "file":
            return (a.file, a.actuator)
        if by == "delay":
            return (delay,)
        if by == "amplitude":
            return (downwards(abs(float(a.tracking.amplitude) - 1)),)
        if by == "error":
            return (error,)
        rank = WORST.index(a.outcome) if a.outcome in WORST else len(WORST)
        return (rank, error)

    return list(assessments) if by == "given" else sorted(assessments, key=place)
