"""Channels that are there twice."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Copies are equal to this share of their range: what scaling them alike may round.
_EQUAL = 1e-9
# What single precision rounds of a value, and what that may be of the range.
_ROUNDED, _ROUNDED_OF_RANGE = 1.2e-7, 1e-5
# So many samples show most channels that are no copies.
_LOOKED_AT = 1000
# Of fewer samples nothing can be said.
_LEAST = 16


def is_copy(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Whether two channels hold the same samples but for rounding to single precision, which two sensors never do."""
    if a.shape != b.shape or a.size <= _LEAST:
        return False
    some = slice(None, None, max(1, a.size // _LOOKED_AT))
    with np.errstate(all="ignore"):
        if not np.allclose(
            a[some], b[some], rtol=1e-6, atol=_ROUNDED_OF_RANGE * float(np.ptp(a[some])), equal_nan=True
        ):
            return False
        finite = np.isfinite(a)
        # Of channels that stand still nothing can be said either.
        if not np.array_equal(finite, np.isfinite(b)) or not finite.any() or not (span := float(np.ptp(a[finite]))) > 0:
            return False
        rounding = min(_ROUNDED * float(np.abs(a[finite]).max()), _ROUNDED_OF_RANGE * span)
        return float(np.abs(a[finite] - b[finite]).max()) <= max(_EQUAL * span, rounding)
