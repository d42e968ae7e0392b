"""The three kinds of tolerance that the tests use: a bare number is a guess, these say what they allow for."""

from __future__ import annotations

import sys
from typing import Final

EXACT: Final = 0.0
"""The same bits: block independence, reuse of a plan, anything that must not depend on how it was asked for."""

_UNITS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "Hz": 1.0, "rad": 1.0, "relative": 1.0, "%": 1e-2}


def round_off(k: float, n: int, scale: float = 1.0) -> float:
    """k n eps scale: what the rounding of n additions of numbers of size `scale` may do, k times over."""
    return k * n * sys.float_info.epsilon * abs(scale)


def physical(amount: float, unit: str) -> float:
    """`amount` of `unit` in SI: an error that is stated and accepted because the method, not the rounding, makes it."""
    return amount * _UNITS[unit]
