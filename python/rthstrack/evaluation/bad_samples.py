"""Samples that are no motion, as data and in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rthstrack._core import _BadEntry as BadEntry


@dataclass(frozen=True, slots=True)
class BadSamples:
    """Samples of one channel that are no motion: their kind and number, and where the first is.

    channel: "target" or "measured". kind: "spike" (one sample that leaves and returns), "dropout" (a stretch of one
    value to which the signal jumps), "frozen" (a stretch of the last value), "clipped" (peaks cut off), "held" (each
    value is repeated until the next: `every` samples from one fresh value to the next; else 0). first: index; first_s:
    seconds.
    """

    channel: str
    kind: str
    count: int
    first: int
    first_s: float
    every: int = 0


def _bad_samples(entries: list[BadEntry], rate_hz: float) -> tuple[BadSamples, ...]:
    return tuple([BadSamples(**entry, first_s=entry["first"] / rate_hz) for entry in entries]) if entries else ()


def bad_words(found: tuple[BadSamples, ...]) -> str:
    """What was found, for a table: "5 spike in measured from 1.2 s; ..."."""
    return "; ".join(f"{b.count} {b.kind} in {b.channel} from {b.first_s:.6g} s" for b in found)
