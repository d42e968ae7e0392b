"""The compiled core. Use the functions of `rthstrack`, which check and convert what they are given."""

from typing import Any, Literal, TypedDict, final

import numpy as np
from numpy.typing import NDArray

from rthstrack.evaluation.settings import MonitorSettings, MovingSettings, Settings
from rthstrack.virtual_test import parts as virtual_test

__all__ = [
    "LIVE_NUMBERS",
    "Evaluator",
    "KeyFrequencies",
    "Live",
    "Monitor",
    "VirtualTest",
    "__version__",
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
    "usual_detrend",
]

_Array = NDArray[np.float64]
_Whole = NDArray[np.uint64]
_Interval = tuple[float, float]

class _BadEntry(TypedDict):
    channel: str
    kind: str
    count: int
    first: int
    every: int

class _Found(TypedDict):
    numbers: dict[str, Any]  # by the names of rthstrack.evaluation.results._Numbers
    fei: complex
    bad_samples: list[_BadEntry]
    reason: str
    reason_code: str
    reason_values: tuple[float, ...]

class _Spectra(TypedDict):
    frequency_hz: _Array
    weights: _Array
    target_spectrum: NDArray[np.complex128]
    measured_spectrum: NDArray[np.complex128]

class _Columns(TypedDict):
    time_s: _Array
    numbers: dict[str, _Array]  # by the same names; intervals are (n, 2)
    valid: NDArray[np.bool_]
    reason: list[str]
    reason_code: list[str]
    reason_values: list[tuple[float, ...]]

class _Moving(_Columns):
    bad_samples: list[_BadEntry]

class _Readings(_Columns):
    index: NDArray[np.int64]
    centre_s: _Array
    actuator: NDArray[np.int64]

LIVE_NUMBERS: tuple[str, ...]
__version__: str

class _SettingRow(TypedDict):
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

def settings_table(of: str) -> list[_SettingRow]: ...
def usual_detrend(estimator: str) -> str: ...
def checked_settings(of: str, given: object) -> dict[str, Any]: ...

@final
class Evaluator:
    def __new__(cls, n_samples: int, rate_hz: float, settings: Settings) -> Evaluator: ...
    @property
    def n_bins(self) -> int: ...
    @property
    def delta_f_hz(self) -> float: ...
    def evaluate(self, target: NDArray[Any], measured: NDArray[Any]) -> list[_Found]: ...
    def evaluate_with_spectra(self, target: NDArray[Any], measured: NDArray[Any]) -> list[tuple[_Found, _Spectra]]: ...

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
    @property
    def no_readings(self) -> _Readings: ...
    def process(self, target: _Array, measured: _Array) -> _Readings | None: ...
    def restart(self, index: int) -> None: ...

class _Bridged(TypedDict):
    target: _Array
    measured: _Array
    target_gaps: _Whole  # (n, 2): from and to
    measured_gaps: _Whole

def bridged(target: _Array, measured: _Array, rate_hz: float, settings: Settings) -> _Bridged | None: ...
def causal_decimate(samples: _Array, data_decimation: int) -> tuple[_Array, int]: ...

class _Changes(TypedDict):
    data_decimation: _Whole
    frequency_decimation: _Whole
    n_bins: _Whole
    amplitude: _Array
    delay: _Array

_Measure = Literal["relative", "phase"]

class _Factors(TypedDict):
    data_decimation: int
    frequency_decimation: int
    amplitude_bound: float
    delay_bound: float
    delay_measure: _Measure
    reference: _Found
    changes: _Changes

class _Bounds(TypedDict):
    data: _Changes
    frequency: _Changes
    measure: _Measure

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
    def evaluate(self, target: NDArray[Any], measured: NDArray[Any]) -> _Found: ...

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

def choose_factors(
    evaluator: Evaluator,
    target: NDArray[Any],
    measured: NDArray[Any],
    tolerance: float,
    data_decimation: int | None,
    frequency_decimation: int | None,
) -> _Factors: ...
def prior_bounds(evaluator: Evaluator, target: NDArray[Any], measured: NDArray[Any]) -> _Bounds: ...

_Mistakes = list[tuple[str, str]]

class _Matrices(TypedDict):
    mass_kg: _Array
    damping_n_s_per_m: _Array
    stiffness_n_per_m: _Array
    natural_frequencies_hz: _Array

_Structure = tuple[_Matrices | None, _Mistakes]

class _Signals(TypedDict):
    target: _Array
    command: _Array
    measured: _Array
    force: _Array
    displacement: _Array
    steps_per_sample: int
    error_estimate: float

class _Critical(TypedDict):
    delay_s: float
    frequency_hz: float
    gain: float
    exact: bool

class _Damped(TypedDict):
    frequency_hz: _Array
    damping_ratio: _Array
    damping_ratio_without: _Array
    first_order_change: _Array

@final
class VirtualTest:
    def __new__(cls, test: virtual_test.VirtualTest) -> VirtualTest: ...
    # The signals, or when and at which bound it became unstable.
    def run(
        self, ground: NDArray[Any], noise: list[list[float] | None]
    ) -> tuple[_Signals | None, tuple[float, float] | None]: ...
    def follow(
        self, target: NDArray[Any], noise: list[list[float] | None]
    ) -> tuple[_Signals | None, tuple[float, float] | None]: ...
    def critical_delay(self) -> _Critical: ...
    def delay_damping(self, delay_s: float) -> _Damped: ...
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
) -> _Moving: ...

class _ResponseSettings(TypedDict):
    segment_s: float | None
    overlap: float
    window: str
    detrend: str
    align_s: float | None
    dispersion: bool

class _Response(TypedDict):
    frequency_hz: _Array
    gain: _Array
    phase_rad: _Array
    delay_s: _Array
    coherence: _Array
    target_psd: _Array
    measured_psd: _Array
    gain_std: _Array
    gain_interval: _Array
    delay_std_s: _Array
    delay_interval_s: _Array
    n_segments: int
    segment_s: float
    align_s: float
    unaligned: str

def frequency_response(
    target: NDArray[Any], measured: NDArray[Any], rate_hz: float, settings: _ResponseSettings
) -> _Response: ...

class _Slopes(TypedDict):
    equivalent_frequency_hz: float
    gain: float
    gain_std: float
    gain_interval: _Interval
    gain_per_hz: float
    gain_per_hz_std: float
    gain_per_hz_interval: _Interval
    gain_misfit: float
    gain_varies: bool
    delay_s: float
    delay_std_s: float
    delay_interval_s: _Interval
    delay_s_per_hz: float
    delay_s_per_hz_std: float
    delay_s_per_hz_interval: _Interval
    delay_misfit_s: float
    delay_varies: bool
    band_hz: _Interval
    n_bins: int
    align_s: float
    dispersion: bool
    n_segments: int
    segment_s: float

def frequency_slopes(
    target: NDArray[Any],
    measured: NDArray[Any],
    rate_hz: float,
    band_hz: tuple[float, float] | None,
    keep_alignment: bool,
    settings: _ResponseSettings,
) -> _Slopes: ...
def indices(
    target: NDArray[Any],
    measured: NDArray[Any],
    rate_hz: float,
    force: NDArray[Any] | None,
    max_lag_s: float,
) -> dict[str, float | None]: ...

class _Histories(TypedDict):
    max_tracking_error: _Array
    rms_error: _Array
    tracking_indicator: _Array
    energy_error: _Array | None

def index_histories(
    target: NDArray[Any],
    measured: NDArray[Any],
    rate_hz: float,
    force: NDArray[Any] | None,
) -> _Histories: ...
def read_text(content: bytes, block: int | None = None, lines: tuple[int, int] | None = None) -> dict[str, Any]: ...
def unit(text: str) -> tuple[str, float] | None: ...
def is_unit_suffix(text: str) -> bool: ...
