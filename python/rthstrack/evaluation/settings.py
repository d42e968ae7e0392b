"""How an evaluation, its moving windows and a monitor are set.

Written by `make settings` from the table of settings in the core (crates/core/src/settings.rs, moving.rs, monitor.rs):
a change belongs there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, TypedDict

from rthstrack._core import checked_settings


class _Checked:
    """Each setting is checked by itself and made a plain type; which go together is seen where they are used."""

    __slots__ = ()
    _of: ClassVar[str]

    def __post_init__(self) -> None:
        for name, value in checked_settings(self._of, self).items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True, slots=True)
class Settings(_Checked):
    """How an evaluation is made.

    estimator: How gain and delay are estimated: fei, aligned or least_squares.
    data_decimation: P, a power of two: keeps the frequencies up to rate / (2 P); of a monitor up to rate / (4 P).
    frequency_decimation: Q, a power of two: keeps every Q-th frequency bin.
    decimator: How P is carried out, exactly on the bins of the undecimated transform or filtered as published:
    spectral or chebyshev.
    weight_power: l of Eqs 7 and 12: bins weigh |target|^l.
    window: Window over the record: boxcar, hann, hamming, blackman, flattop or tukey.
    detrend: What is subtracted before the window; where nothing is asked for the mean, of fei nothing: none, mean
    or linear.
    band_hz, Hz: Lowest and highest frequency judged, both included.
    max_delay_s, s: Largest delay or lead looked for by all estimators but fei; where the record does not go on
    beyond what is judged, a quarter of that at most.
    expected_delay_s, s: Of delays that fit equally well, the target being one tone, all estimators but fei take the
    one nearest to this; without it the answer is "ambiguous".
    noise: What least_squares takes the noise on measured for: white or coloured.
    noise_ratio: Standard deviation of the noise on target over that on measured, for least_squares.
    bad_samples: What all estimators but fei do with spikes, dropouts, frozen and clipped samples, and held ones:
    leave_out or keep.

    Raises SettingError.
    """

    _of: ClassVar[str] = "evaluation"

    estimator: str = "least_squares"
    data_decimation: int = 1
    frequency_decimation: int = 1
    decimator: str = "spectral"
    weight_power: int = 2
    window: str = "boxcar"
    detrend: str | None = None
    band_hz: tuple[float, float] | None = None
    max_delay_s: float = 0.25
    expected_delay_s: float | None = None
    noise: str = "white"
    noise_ratio: float = 0.0
    bad_samples: str = "leave_out"


@dataclass(frozen=True, slots=True)
class MovingSettings(Settings):
    """How moving windows are made, and each evaluated.

    window_s, s: Length of the window.
    hop_s, s: From one window to the next.
    minimum_std_ratio: A window is judged where the target's standard deviation in it is at least this share of the
    whole record's.

    Raises SettingError.
    """

    _of: ClassVar[str] = "moving"

    window_s: float = 4.0
    hop_s: float = 0.25
    minimum_std_ratio: float = 0.05


@dataclass(frozen=True, slots=True)
class MonitorSettings(_Checked):
    """How a stream is evaluated.

    rate_hz, Hz: Incoming samples a second.
    window_s, s: Length of the window.
    update_hz, Hz: Readings a second, of each actuator.
    minimum_amplitude: A window is judged where the target's amplitude in it is at least this: sqrt(2) times its
    standard deviation, which is the amplitude of a sine. In the unit of the signals.
    n_actuators: Actuators that are stepped together.
    estimator: How gain and delay are estimated: fei, aligned or least_squares.
    data_decimation: P, a power of two: keeps the frequencies up to rate / (2 P); of a monitor up to rate / (4 P).
    frequency_decimation: Q, a power of two: keeps every Q-th frequency bin.
    window: Window over the record: boxcar, hann, hamming, blackman, flattop or tukey.
    detrend: What is subtracted before the window; where nothing is asked for the mean, of fei nothing: none, mean
    or linear.
    band_hz, Hz: Lowest and highest frequency judged, both included.
    max_delay_s, s: Largest delay or lead looked for by all estimators but fei; where the record does not go on
    beyond what is judged, a quarter of that at most.
    expected_delay_s, s: Of delays that fit equally well, the target being one tone, all estimators but fei take the
    one nearest to this; without it the answer is "ambiguous".

    Raises SettingError.
    """

    _of: ClassVar[str] = "monitor"

    rate_hz: float
    window_s: float = 4.0
    update_hz: float = 64.0
    minimum_amplitude: float = 0.0
    n_actuators: int = 1
    estimator: str = "least_squares"
    data_decimation: int = 1
    frequency_decimation: int = 1
    window: str = "boxcar"
    detrend: str | None = None
    band_hz: tuple[float, float] | None = None
    max_delay_s: float = 0.25
    expected_delay_s: float | None = None


@dataclass(frozen=True, slots=True)
class StudyMethod:
    """What all cells of a study share.

    estimator: How gain and delay are estimated: fei, aligned or least_squares.
    decimator: How P is carried out, exactly on the bins of the undecimated transform or filtered as published:
    spectral or chebyshev.
    detrend: What is subtracted before the window; where nothing is asked for the mean, of fei nothing: none, mean
    or linear.
    band_hz, Hz: Lowest and highest frequency judged, both included.
    max_delay_s, s: Largest delay or lead looked for by all estimators but fei; where the record does not go on
    beyond what is judged, a quarter of that at most.
    expected_delay_s, s: Of delays that fit equally well, the target being one tone, all estimators but fei take the
    one nearest to this; without it the answer is "ambiguous".
    noise: What least_squares takes the noise on measured for: white or coloured.
    noise_ratio: Standard deviation of the noise on target over that on measured, for least_squares.
    bad_samples: What all estimators but fei do with spikes, dropouts, frozen and clipped samples, and held ones:
    leave_out or keep.

    Raises SettingError.
    """

    estimator: str = "fei"
    decimator: str = "spectral"
    detrend: str | None = None
    band_hz: tuple[float, float] | None = None
    max_delay_s: float = 0.25
    expected_delay_s: float | None = None
    noise: str = "white"
    noise_ratio: float = 0.0
    bad_samples: str = "leave_out"


class StudyMethodKeywords(TypedDict, total=False):
    """The same by name."""

    estimator: str
    decimator: str
    detrend: str | None
    band_hz: tuple[float, float] | None
    max_delay_s: float
    expected_delay_s: float | None
    noise: str
    noise_ratio: float
    bad_samples: str


class OtherKeywords(TypedDict, total=False):
    """Settings by name, but P and Q."""

    estimator: str
    decimator: str
    weight_power: int
    window: str
    detrend: str | None
    band_hz: tuple[float, float] | None
    max_delay_s: float
    expected_delay_s: float | None
    noise: str
    noise_ratio: float
    bad_samples: str


class EvaluationKeywords(OtherKeywords, total=False):
    """Settings by name."""

    data_decimation: int
    frequency_decimation: int


class MovingKeywords(EvaluationKeywords, total=False):
    """Settings of moving windows by name."""

    window_s: float
    hop_s: float
    minimum_std_ratio: float


class MonitorKeywords(TypedDict, total=False):
    """A monitor's settings by name; P may be None, to be chosen for the band."""

    minimum_amplitude: float
    n_actuators: int
    estimator: str
    data_decimation: int | None
    frequency_decimation: int
    window: str
    detrend: str | None
    band_hz: tuple[float, float] | None
    max_delay_s: float
    expected_delay_s: float | None
