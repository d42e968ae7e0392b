"""What the user allows, and what exceeds it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rthstrack.said import Said
from rthstrack.verdict.sentence import _undetermined

if TYPE_CHECKING:
    from rthstrack.evaluation.tracking import Tracking


@dataclass(frozen=True, slots=True)
class Limits:
    """What the user allows: |delay_s| <= delay_s and |amplitude - 1| <= amplitude."""

    delay_s: float | None = None
    amplitude: float | None = None


def exceeded(tracking: Tracking, limits: Limits) -> tuple[Said, ...]:
    """Each limit that was exceeded, in one sentence."""
    found = []
    delay_s, error = float(tracking.delay_s), abs(float(tracking.amplitude) - 1)
    if limits.delay_s is not None and abs(delay_s) > limits.delay_s:
        words = f"|delay| {1e3 * abs(delay_s):.4g} ms exceeds the limit of {1e3 * limits.delay_s:.4g} ms"
        found.append(Said(words, "limit_delay", (abs(delay_s), limits.delay_s)))
    if limits.amplitude is not None and error > limits.amplitude:
        words = f"|amplitude - 1| {error:.4g} exceeds the limit of {limits.amplitude:.4g}"
        found.append(Said(words, "limit_amplitude", (error, limits.amplitude)))
    return tuple(found)


def copy_exceeds(copy: Said | None, limits: Limits) -> tuple[Said, ...]:
    """That no limit is passed by a channel that is a copy of target."""
    if copy is None or (limits.delay_s is None and limits.amplitude is None):
        return ()
    return (Said(f"no limit is passed: {copy.cause}", "limit_copy"),)


def unchecked(tracking: Tracking, limits: Limits) -> tuple[Said, ...]:
    """That a limit could not be checked, as there is no number to hold against it."""
    if (limits.delay_s is None and limits.amplitude is None) or _undetermined(tracking) is None:
        return ()
    return (Said("no limit was checked: gain and delay are not determined", "limit_unchecked"),)
