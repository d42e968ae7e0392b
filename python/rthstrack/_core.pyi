"""The compiled core. Use the functions of `rthstrack`, which check and convert what they are given."""

from typing import Any, TypedDict, final

import numpy as np
from numpy.typing import NDArray

from rthstrack.evaluation.settings import MonitorSettings, MovingSettings, Settings
from rthstrack.virtual_test import parts as virtual_test

__all__ = [
    "Evaluator",
    "KeyFrequencies",
    "Live",
    "Monitor",
    "VirtualTest",
    "__version__",
    "alarm_settings",
    "bridged",
    "causal_decimate",
    "check_test",
    "checked_settings",
    "choose_factors",
    "evaluate_moving",
    "frequency_response",
    "frequency_slopes",
    "from_matrices",
    "index_histories",
    "indices",
    "is_unit_suffix",
    "prior_bounds",
    "read_text",
    "sdof",
    "settings_table",
    "shear_building",
    "unit",
]

_Averaged = tuple[float, float, float, float, complex]
_Bad = list[tuple[str, str, int, int, int]]
_Precision = tuple[float, tuple[float, float], float, tuple[float, float], float, float, float, _Bad, str]
_Numbers = tuple[_Averaged, _Precision]
_Array = NDArray[np.float64]
_Readings = tuple[
    tuple[_Array, _Array, _Array, _Array, _Array, NDArray[np.bool_]],
    tuple[_Array, _Array, _Array, _Array, _Array, _Array, _Array, _Bad, list[str]],
]
_Spectra = tuple[_Array, _Array, NDArray[np.complex128], NDArray[np.complex128]]

__version__: str

class SettingRow(TypedDict):
    name: str
    kind: str
    choices: list[str]
    least: int
    most: int
    optional: bool
    required: bool
    in_study: bool
    expected: str
    unit: str
    label: str
    help: str
    default: Any

def settings_table(of: str) -> list[SettingRow]: ...
def checked_settings(of: str, given: object) -> dict[str, Any]: ...

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

_Columns = tuple[
    tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]],
    tuple[_Array, _Array, _Array, _Array, _Array, _Array],
    tuple[_Array, _Array, list[str]],
]

@final
class Monitor:
    def __new__(cls, settings: MonitorSettings) -> Monitor: ...
    @property
    def update_hz(self) -> float: ...
    @property
    def latency_s(self) -> float: ...
    @property
    def age_s(self) -> float: ...
    @property
    def evaluated_rate_hz(self) -> float: ...
    @property
    def samples_until_reading(self) -> int: ...
    def process(self, target: _Array, measured: _Array) -> _Columns: ...
    def restart(self, index: int) -> None: ...

def bridged(
    target: _Array, measured: _Array, rate_hz: float, settings: Settings
) -> tuple[list[_Array], list[list[tuple[int, int]]]] | None: ...
def causal_decimate(samples: _Array, data_decimation: int) -> tuple[_Array, int]: ...

_Whole = NDArray[np.uint64]
_Changes = tuple[_Whole, _Whole, _Whole, _Array, _Array]

@final
class KeyFrequencies:
    def __new__(cls, target: NDArray[Any], rate_hz: float, share: float, settings: Settings) -> KeyFrequencies: ...
    @property
    def frequency_hz(self) -> _Array: ...
    @property
    def share_held(self) -> float: ...
    @property
    def direct(self) -> bool: ...
    @property
    def delta_f_hz(self) -> float: ...
    def evaluate(self, target: NDArray[Any], measured: NDArray[Any]) -> _Numbers: ...

@final
class Live:
    def __new__(
        cls, monitor: dict[str, Any], source: dict[str, Any], alarms: dict[str, Any], outputs: dict[str, Any]
    ) -> Live: ...
    def start(self) -> None: ...
    def stop(self) -> None: ...
    def wait(self, timeout_s: float) -> bool: ...
    def address(self) -> str: ...
    def control_address(self) -> str: ...
    def fatal(self) -> str | None: ...
    def reset(self) -> None: ...
    def summary(self) -> dict[str, int]: ...
    def alarmed(self) -> bool: ...
    def hello(self) -> str: ...
    def frame(self, cursor: int) -> tuple[str, int]: ...
    def status(self) -> str: ...
    def take_samples(self) -> dict[str, Any]: ...
    def take_readings(self) -> dict[str, Any]: ...
    def note_log(self, state: str | None, why: str | None = None) -> None: ...

def alarm_settings() -> list[dict[str, Any]]: ...
def choose_factors(
    evaluator: Evaluator,
    target: NDArray[Any],
    measured: NDArray[Any],
    tolerance: float,
    data_decimation: int | None,
    frequency_decimation: int | None,
) -> tuple[int, int, float, float, bool, _Numbers, _Changes]: ...
def prior_bounds(
    evaluator: Evaluator, target: NDArray[Any], measured: NDArray[Any]
) -> tuple[_Changes, _Changes, bool]: ...

_Mistakes = list[tuple[str, str]]
_Structure = tuple[tuple[_Array, _Array, _Array, _Array] | None, _Mistakes]

@final
class VirtualTest:
    def __new__(cls, test: virtual_test.VirtualTest) -> VirtualTest: ...
    def run(
        self, ground: NDArray[Any], noise: list[list[float] | None]
    ) -> tuple[tuple[_Array, _Array, _Array, _Array, _Array, int, float] | None, tuple[float, float] | None]: ...
    def follow(
        self, target: NDArray[Any], noise: list[list[float] | None]
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
    settings: MovingSettings,
) -> _Readings: ...

_ResponseSettings = tuple[float | None, float, str, str, float | None, bool]

def frequency_response(
    target: NDArray[Any],
    measured: NDArray[Any],
    rate_hz: float,
    settings: _ResponseSettings,
) -> tuple[
    tuple[_Array, _Array, _Array, _Array, _Array, _Array, _Array],
    tuple[_Array, _Array, _Array, _Array],
    int,
    float,
    float,
    str,
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
def unit(text: str) -> tuple[str, float] | None: ...
def is_unit_suffix(text: str) -> bool: ...
