"""Channels that are there twice."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Copies are equal to this share of their range: what scaling them alike may round.
_EQUAL = 1e-9
# Of fewer samples nothing can be said.
_LEAST = 16


def is_copy(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Whether two channels hold the same samples, which two sensors never do."""
    if a.shape != b.shape or a.size <= _LEAST:
        return False
    if np.array_equal(a, b, equal_nan=True):
        return True
    with np.errstate(all="ignore"):
        span = float(np.nanmax(a) - np.nanmin(a)) if np.isfinite(a).any() else 0.0
        same_gaps = np.array_equal(np.isfinite(a), np.isfinite(b))
        return bool(same_gaps and span > 0 and np.nanmax(np.abs(a - b)) <= _EQUAL * span)
