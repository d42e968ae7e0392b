"""What numbers of a ground motion may be; every mistake as (key, message)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rthstrack.keyed_table import POSITIVE, finite

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

_LONGEST_PERIOD_S = 100.0
MOST_SAMPLES = 20_000_000


Mistakes = list[tuple[str, str]]


def oscillator_mistakes(period_s: Any, damping_ratio: Any, step_s: float = 0.0) -> Mistakes:
    mistakes: Mistakes = []
    if not max(step_s, 1e-6) <= _number(period_s) <= _LONGEST_PERIOD_S:
        least = f"{step_s:g} s (one sample)" if step_s else "one sample"
        mistakes.append(("period_s", f"expected a period from {least} to {_LONGEST_PERIOD_S:g} s, found {period_s!r}"))
    if not 0 <= _number(damping_ratio) < 1:
        mistakes.append(("damping_ratio", f"expected a number from 0 to below 1, found {damping_ratio!r}"))
    return mistakes


def not_positive(table: Mapping[str, Any], keys: Iterable[str]) -> Mistakes:
    return [
        (key, f"expected {POSITIVE.expected}, found {table[key]!r}")
        for key in keys
        if key in table and POSITIVE.read(table[key]) is None
    ]


def _number(value: Any) -> float:
    found = finite(value)
    return math.nan if found is None else found
