"""The compiled core. Use the functions of `rthstrack`, which check and convert what they are given."""

from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from rthstrack.tracking import Settings

__all__ = [
    "Evaluator",
    "__version__",
    "evaluate_moving",
    "frequency_response",
    "index_histories",
    "indices",
    "read_text",
]

_Numbers = tuple[float, float, float, float, complex]
_Array = NDArray[np.float64]
_Spectra = tuple[_Array, _Array, NDArray[np.complex128], NDArray[np.complex128]]

__version__: str

@final
class Evaluator:
    def __new__(cls, n_samples: int, rate_hz: float, settings: Settings) -> Evaluator: ...
    @property
    def n_bins(self) -> int: ...
    @property
    def delta_f_hz(self) -> float: ...
    def evaluate(self, target: NDArray[Any], measured: NDArray[Any]) -> list[_Numbers]: ...
    def evaluate_with_spectra(
        self, target: NDArray[Any], measured: NDArray[Any]
    ) -> list[tuple[_Numbers, _Spectra]]: ...

def evaluate_moving(
    target: NDArray[Any],
    measured: NDArray[Any],
    rate_hz: float,
    window_s: float,
    hop_s: float,
    minimum_std_ratio: float,
    settings: Settings,
) -> tuple[_Array, _Array, _Array, _Array, _Array, NDArray[np.bool_]]: ...
def frequency_response(
    target: NDArray[Any],
    measured: NDArray[Any],
    rate_hz: float,
    segment_s: float | None,
    overlap: float,
    window: str,
    detrend: str,
) -> tuple[tuple[_Array, _Array, _Array, _Array, _Array, _Array, _Array], int, float]: ...
def indices(
    target: NDArray[Any],
    measured: NDArray[Any],
    rate_hz: float,
    force: NDArray[Any] | None,
    max_lag_s: float,
) -> tuple[float, float, float, float, float, float, float, float, float | None]: ...
def index_histories(
    target: NDArray[Any],
    measured: NDArray[Any],
    rate_hz: float,
    force: NDArray[Any] | None,
) -> tuple[_Array, _Array, _Array, _Array | None]: ...
def read_text(content: bytes) -> dict[str, Any]: ...
