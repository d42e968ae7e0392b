"""How an evaluation and a monitor are set."""

from __future__ import annotations

from dataclasses import dataclass

from rthstrack.evaluation.inputs import _band, _count, _number


@dataclass(frozen=True, slots=True)
class Settings:
    """How an evaluation was made; the words and defaults are those of `evaluate`."""

    estimator: str = "fei"
    data_decimation: int = 1
    frequency_decimation: int = 1
    decimator: str = "spectral"
    weight_power: int = 2
    window: str = "boxcar"
    detrend: str = "none"
    band_hz: tuple[float, float] | None = None
    max_delay_s: float = 0.25
    expected_delay_s: float | None = None
    noise: str = "white"
    noise_ratio: float = 0.0
    bad_samples: str = "leave_out"

    def _checked(self) -> Settings:
        """The same with plain Python types, so that it can be hashed, compared and written."""
        return Settings(
            str(self.estimator),
            _count("data_decimation", self.data_decimation),
            _count("frequency_decimation", self.frequency_decimation),
            str(self.decimator),
            _count("weight_power", self.weight_power),
            str(self.window),
            str(self.detrend),
            _band(self.band_hz),
            _number("max_delay_s", self.max_delay_s),
            None if self.expected_delay_s is None else _number("expected_delay_s", self.expected_delay_s),
            str(self.noise),
            _number("noise_ratio", self.noise_ratio),
            str(self.bad_samples),
        )


@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """How a stream is evaluated; the words and defaults are those of `Monitor`."""

    rate_hz: float
    window_s: float = 4.0
    update_hz: float = 64.0
    band_hz: tuple[float, float] | None = None
    window: str = "boxcar"
    detrend: str = "mean"
    estimator: str = "fei"
    data_decimation: int = 1
    frequency_decimation: int = 1
    max_delay_s: float = 0.25
    expected_delay_s: float | None = None
    minimum_amplitude: float = 0.0
    n_actuators: int = 1
