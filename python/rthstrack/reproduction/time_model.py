"""Five constants that explain the 273 printed computing times, and with them what P and Q cost and save there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.reproduction import paper

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Samples of each case (sections 3.1.1 and 3.2).
_LENGTHS = {"mu2035": 24577, "chy101-n": 92161, "experiment": 51160}
_ITERATIONS = 100


@dataclass(frozen=True, slots=True, eq=False)
class TimeModel:
    """t = fixed + transform n log2 n + bin p/(P Q) + (P > 1) (overhead + filter L), n = 2p/P; all in ms.

    L: samples; 2p: the next power of two. transform, filter and bin are of one point, sample and bin of the pair.
    printed_ms, model_ms: a row each of `keys`, (case, P, Q); median_error: of |model/printed - 1|.
    """

    fixed_ms: float
    transform_ms: float
    bin_ms: float
    filter_ms: float
    overhead_ms: float
    keys: tuple[tuple[str, int, int], ...]
    printed_ms: NDArray[np.float64]
    model_ms: NDArray[np.float64]

    @property
    def median_error(self) -> float:
        """The median of |model / printed - 1|."""
        return float(np.median(np.abs(self.model_ms / self.printed_ms - 1)))

    def at(self, case: str, P: int, Q: int) -> float:
        """The model's time of a case in ms."""
        constants = (self.fixed_ms, self.transform_ms, self.bin_ms, self.filter_ms, self.overhead_ms)
        return float(np.dot(_terms(case, P, Q), constants))


def time_model() -> TimeModel:
    """Fitted to the printed times for the least sum of |model / printed - 1|, by weighted least squares, repeated."""
    keys = tuple((case, P, Q) for case, table in paper.TIMES_MS.items() for P, Q in table)
    printed = np.array([paper.TIMES_MS[case][P, Q] for case, P, Q in keys])
    terms = np.array([_terms(*key) for key in keys])
    weights = 1 / printed
    constants: NDArray[np.float64] = np.zeros(terms.shape[1])
    for _ in range(_ITERATIONS):
        constants = np.asarray(np.linalg.lstsq(terms * weights[:, None], printed * weights, rcond=None)[0])
        weights = 1 / printed / np.sqrt(np.maximum(np.abs(terms @ constants / printed - 1), 1e-3))
    fixed, transform, each_bin, filtering, overhead = constants.tolist()
    return TimeModel(fixed, transform, each_bin, filtering, overhead, keys, printed, terms @ constants)


def _terms(case: str, P: int, Q: int) -> tuple[float, ...]:
    length = next(n for name, n in _LENGTHS.items() if name in case)
    padded = 2 ** math.ceil(math.log2(length))
    n = padded / P
    return 1.0, n * math.log2(n), padded / 2 / (P * Q), length * (P > 1), float(P > 1)
