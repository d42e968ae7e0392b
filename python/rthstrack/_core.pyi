"""The compiled core. Use the functions of `rthstrack`, which check and convert what they are given."""

from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from rthstrack import virtual_test
from rthstrack.tracking import Settings

__all__ = [
    "Evaluator",
    "VirtualTest",
    "__version__",
    "check_test",
    "evaluate_moving",
    "frequency_response",
    "frequency_slopes",
    "from_matrices",
    "index_histories",
    "indices",
    "read_text",
    "sdof",
    "shear_building",
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

_Mistakes = list[tuple[str, str]]
_Structure = tuple[tuple[_Array, _Array, _Array, _Array] | None, _Mistakes]

@final
class VirtualTest:
    def __new__(cls, test: virtual_test.VirtualTest) -> VirtualTest: ...
    def run(
        self, ground: NDArray[Any], noise: list[list[float] | None]
    ) -> tuple[tuple[_Array, _Array, _Array, _Array, _Array, int, float] | None, tuple[float, float] | None]: ...
    def critical_delay(self) -> tuple[float, float, float, bool]: ...
    def delay_damping(self, delay_s: float) -> tuple[_Array, _Array, _Array, _Array]: ...
    def true_response(self, actuator: int, frequency_hz: NDArray[Any]) -> NDArray[np.complex128] | None: ...

def check_test(test: virtual_test.VirtualTest) -> _Mistakes: ...
def sdof(frequency_hz: float, damping_ratio: float, mass_kg: float) -> _Structure: ...
def shear_building(
    masses_kg: list[float], stiffnesses: list[float], damped: virtual_test.ModalDamping | virtual_test.RayleighDamping
) -> _Structure: ...
def from_matrices(
    mass: NDArray[Any],
    stiffness: NDArray[Any],
    damped: NDArray[Any] | virtual_test.ModalDamping | virtual_test.RayleighDamping,
    influence: list[float],
) -> _Structure: ...
def evaluate_moving(
    target: NDArray[Any],
    measured: NDArray[Any],
    rate_hz: float,
    window_s: float,
    hop_s: float,
    minimum_std_ratio: float,
    settings: Settings,
) -> tuple[_Array, _Array, _Array, _Array, _Array, NDArray[np.bool_]]: ...

_ResponseSettings = tuple[float | None, float, str, str, float, bool]

def frequency_response(
    target: NDArray[Any],
    measured: NDArray[Any],
    rate_hz: float,
    settings: _ResponseSettings,
) -> tuple[
    tuple[_Array, _Array, _Array, _Array, _Array, _Array, _Array], tuple[_Array, _Array, _Array, _Array], int, float
]: ...

_Interval = tuple[float, float]
_Slope = tuple[float, float, _Interval, float, float, _Interval, float, bool]

def frequency_slopes(
    target: NDArray[Any],
    measured: NDArray[Any],
    rate_hz: float,
    band_hz: tuple[float, float] | None,
    keep_alignment: bool,
    settings: _ResponseSettings,
) -> tuple[float, _Slope, _Slope, _Interval, int, float, bool, int, float]: ...
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
