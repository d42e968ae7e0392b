"""Everything that is known of one target/measured pair, as plain frozen data.

The command, the report and the figures take an `Assessment` and compute nothing themselves.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack import verdict as words
from rthstrack.errors import SettingError, SignalError
from rthstrack.tracking import Evaluator, Settings, evaluate_moving, frequency_response, index_histories, indices

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from rthstrack.tracking import FrequencyResponse, IndexHistories, Indices, MovingTracking, Tracking

#: Length of a moving window unless told otherwise, in seconds, but never more than a quarter of the record.
MOVING_S = 4.0
#: Readings a window's length.
READINGS_PER_WINDOW = 16


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


def assess(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    *,
    settings: Settings | None = None,
    moving_s: float | None = None,
    hop_s: float | None = None,
    limits: Limits | None = None,
    file: str = "",
    actuator: int = 0,
    part: str = "whole",
    target_name: str = "target",
    measured_name: str = "measured",
    unit: str | None = None,
    measured_unit: str | None = None,
    start_s: float = 0.0,
    origin: Mapping[str, Any] | None = None,
) -> Assessment:
    """Judges one pair in every way there is: whole record, moving windows, over frequency, indices, warnings.

    target, measured: (n_samples,) in `unit` (and `measured_unit`, the same unless given); settings: of `evaluate`.
    moving_s, hop_s: moving windows; by default 4 s but at most a quarter of the record, sixteen readings a window.
    limits: apply to |delay| and |amplitude - 1|. `origin` says what was done to the samples before.

    Raises SignalError, SettingError; where only the moving evaluation or the frequency response is impossible, it is
    None and its note says why, unless `moving_s` or `hop_s` asked for it.
    """
    settings = settings or Settings()
    t = np.ascontiguousarray(target, dtype=np.float64)
    m = np.ascontiguousarray(measured, dtype=np.float64)
    tracking = Evaluator(max(t.size, 1), rate_hz, settings).evaluate(t, m, weights=True)
    asked = moving_s is not None or hop_s is not None
    window_s = min(MOVING_S, t.size / rate_hz / 4) if moving_s is None else moving_s
    hop_s = max(window_s / READINGS_PER_WINDOW, 1 / rate_hz) if hop_s is None else hop_s
    moving, moving_note = None, None
    try:
        moving = evaluate_moving(t, m, rate_hz, window_s=window_s, hop_s=hop_s, **dataclasses.asdict(tracking.settings))
    except (SettingError, SignalError) as error:
        if asked:
            raise type(error)(f"moving windows of {window_s:g} s: {error}") from None
        moving_note = f"not determined: {error}"
    response, response_note = None, None
    try:
        response = frequency_response(t, m, rate_hz)
    except (SettingError, SignalError) as error:
        response_note = f"not determined: {error}"
    limits = limits or Limits()
    names = (target_name, measured_name)
    evaluation = dataclasses.asdict(tracking.settings)
    return Assessment(
        file=file,
        actuator=actuator,
        part=part,
        target_name=target_name,
        measured_name=measured_name,
        unit=unit,
        rate_hz=tracking.rate_hz,
        start_s=start_s,
        target=t,
        measured=m,
        tracking=tracking,
        moving=moving,
        moving_note=moving_note,
        response=response,
        response_note=response_note,
        indices=indices(t, m, rate_hz),
        histories=index_histories(t, m, rate_hz),
        settings=evaluation | {"moving_s": window_s, "hop_s": hop_s} | dict(origin or {}),
        verdict=words.sentence(tracking, *_ROLES[part]),
        warnings=words.warnings(t, m, tracking, moving, response, (unit, measured_unit or unit), names),
        limits=limits,
        exceeded=words.exceeded(tracking, limits),
    )


_ROLES = {
    "whole": ("target", "measured"),
    "compensator": ("target", "command"),
    "actuator": ("command", "measured"),
}
