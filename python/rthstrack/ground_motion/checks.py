"""What numbers of a ground motion may be; every mistake as (key, message)."""

from __future__ import annotations

import difflib
import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

_LONGEST_PERIOD_S = 100.0
_MOST_SAMPLES = 20_000_000


def _near(text: str, known: Sequence[str]) -> str:
    """` (did you mean ...?)`, or nothing where nothing is near."""
    by_lower = {one.lower(): one for one in known}
    near = difflib.get_close_matches(text.lower(), by_lower, n=3)
    return f" (did you mean {' or '.join(repr(by_lower[one]) for one in near)}?)" if near else ""


Mistakes = list[tuple[str, str]]


def _oscillator_mistakes(period_s: Any, damping_ratio: Any, step_s: float = 0.0) -> Mistakes:
    mistakes: Mistakes = []
    if not (_is_number(period_s) and max(step_s, 1e-6) <= period_s <= _LONGEST_PERIOD_S):
        least = f"{step_s:g} s (one sample)" if step_s else "one sample"
        mistakes.append(("period_s", f"expected a period from {least} to {_LONGEST_PERIOD_S:g} s, found {period_s!r}"))
    if not (_is_number(damping_ratio) and 0 <= damping_ratio < 1):
        mistakes.append(("damping_ratio", f"expected a number from 0 to below 1, found {damping_ratio!r}"))
    return mistakes


def _not_positive(table: Mapping[str, Any], keys: Iterable[str]) -> Mistakes:
    return [
        (key, f"expected a positive number, found {table[key]!r}")
        for key in keys
        if key in table and not (_is_number(table[key]) and math.isfinite(table[key]) and table[key] > 0)
    ]


def _unknown(table: Mapping[str, Any], known: Sequence[str], where: str) -> Mistakes:
    return [
        (f"{where}.{key}", f"no such key{_near(str(key), known)}; there are: {', '.join(known)}")
        for key in table
        if key not in known
    ]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def _is_whole(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
