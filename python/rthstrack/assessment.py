"""Everything that is known of one target/measured pair, as plain frozen data.

The command, the report and the figures take an `Assessment` and compute nothing themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rthstrack.tracking import FrequencyResponse, IndexHistories, Indices, MovingTracking, Tracking


@dataclass(frozen=True, slots=True)
class Limits:
    """What the user allows: |delay_s| <= delay_s and |amplitude - 1| <= amplitude."""

    delay_s: float | None = None
    amplitude: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Assessment:
    """One pair, judged.

    `part` is "whole" (target to measured), "compensator" (target to command) or "actuator" (command to measured).
    `target` and `measured` are the raw samples, `unit` theirs; `time_s` starts at the recording's own start.
    `settings` holds what was done before the evaluation (cut, fill, resample, scale, rate and where it came from)
    and the evaluation's own settings. `exceeded` names each limit that was exceeded, in one sentence.
    """

    file: str
    actuator: int
    part: str
    target_name: str
    measured_name: str
    unit: str | None
    rate_hz: float
    start_s: float
    target: NDArray[np.float64] = field(repr=False)
    measured: NDArray[np.float64] = field(repr=False)
    tracking: Tracking  # evaluated with weights=True: spectra and weights inside
    moving: MovingTracking | None
    moving_note: str | None  # why there is no moving evaluation, when there is none
    response: FrequencyResponse | None
    response_note: str | None
    indices: Indices
    histories: IndexHistories
    settings: dict[str, Any]
    verdict: str
    warnings: tuple[str, ...]
    limits: Limits
    exceeded: tuple[str, ...]
