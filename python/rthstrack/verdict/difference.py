"""Where two estimates of the same pair differ notably."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rthstrack.verdict.sentence import _RIGHT_AMPLITUDE

if TYPE_CHECKING:
    from rthstrack.evaluation.tracking import Tracking

# Two estimates this near may stand for each other, however narrow the interval: a thousandth of the delay, a micro-
# second, and the amplitude as above.
_SAME_DELAY, _SAME_DELAY_S = 1e-3, 1e-6
# Without an interval to hold the difference against, one of a hundredth counts.
_NOTABLE = 1e-2


def differ(tracking: Tracking, trusted: Tracking) -> bool:
    """Whether amplitude or delay differ by more than the trusted interval, and by enough to matter."""
    return bool(_differences(tracking, trusted))


def _differences(tracking: Tracking, trusted: Tracking) -> list[str]:
    """Which of "delay_s" and "amplitude" differ."""
    found = []
    for name, interval, share, least in (
        ("delay_s", trusted.delay_interval_s, _SAME_DELAY, _SAME_DELAY_S),
        ("amplitude", trusted.amplitude_interval, _RIGHT_AMPLITUDE, 0.0),
    ):
        ours, theirs = float(getattr(tracking, name)), float(getattr(trusted, name))
        low, high = (float(end) for end in interval)
        if math.isnan(low):
            share = _NOTABLE
        if abs(ours - theirs) > max(share * abs(theirs), least) and not low <= ours <= high:
            found.append(name)
    return found
