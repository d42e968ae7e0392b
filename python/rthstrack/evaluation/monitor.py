"""The evaluation while the test runs: samples in as they come, gain and delay of the latest window out."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from rthstrack._core import Monitor as CoreMonitor
from rthstrack._core import causal_decimate as core_causal_decimate
from rthstrack.errors import SettingError, SignalError
from rthstrack.evaluation.inputs import _count, _samples, merged, settled
from rthstrack.evaluation.results import _made, _Numbers
from rthstrack.evaluation.settings import MonitorSettings
from rthstrack.values import Shown, extent

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from rthstrack.evaluation.settings import MonitorKeywords


@dataclass(frozen=True, kw_only=True, repr=False)
class Readings(_Numbers["NDArray[np.float64]", "NDArray[np.float64]"]):
    """Readings of one call, a row an actuator and window; intervals with (low, high) last.

    `actuator` counts from 0. `index` is that of the sample that completed the window, `time_s` its time from sample 0,
    `centre_s` the window's centre in the same time, the decimator's delay taken out. The numbers are those of
    `Tracking`. Where `valid` is False they are NaN and `reason` says why; where it is True it says why there is no
    interval, or is empty. `reason_code` is its name, which never changes, `reason_values` what it says in numbers, in
    SI units.
    """

    index: NDArray[np.int64]
    time_s: NDArray[np.float64]
    centre_s: NDArray[np.float64]
    actuator: NDArray[np.int64]
    valid: NDArray[np.bool_]
    reason: tuple[str, ...]
    reason_code: tuple[str, ...]
    reason_values: tuple[tuple[float, ...], ...]
    settings: MonitorSettings

    def __len__(self) -> int:
        return len(self.index)

    def _shown(self) -> Shown:
        heading = f"Readings, {self.settings.estimator}: {len(self)}, {np.count_nonzero(self.valid)} judged"
        return Shown(heading, [*self._number_rows(), ("time", extent(self.time_s, 1.0, "s"))])

    def _columns(self) -> dict[str, Any]:
        columns: dict[str, Any] = {name: getattr(self, name) for name in ("index", "time_s", "centre_s", "actuator")}
        columns["actuator_number"] = self.actuator + 1
        columns |= self._number_columns() | {"valid": self.valid}
        return columns | {name: list(getattr(self, name)) for name in ("reason", "reason_code", "reason_values")}


def largest_decimation(rate_hz: float, high_hz: float, update_hz: float = 0.0) -> int:
    """The largest P, a power of two, at which the causal decimator passes up to `high_hz`: rate / (4 P) >= high.

    It leaves a sample for every reading: rate / P >= update.

    >>> largest_decimation(1024, 32)
    8
    """
    factor = 1
    while high_hz * (1 - 1e-9) <= rate_hz / (8 * factor) and update_hz <= rate_hz / (2 * factor) and factor < 2**17:
        factor *= 2
    return factor


class Monitor:
    """Gain and delay while samples come: each reading is the evaluation of the latest `window_s` seconds.

    Each reading equals `evaluate` on the window's samples (for the other estimators, `evaluate_moving` on a record that
    ends with them), computed anew: nothing drifts, and a sample that is NaN or infinite spoils just the windows that
    hold it.

    rate_hz: samples a second, or `MonitorSettings` whole. window_s: length of the window. update_hz: readings a second
    (rounded to a whole number of decimated samples). Other settings by the names of `MonitorSettings`, in
    docs/settings.md. data_decimation: samples are low-passed and decimated as they come, which keeps up to
    rate / (4 P); None chooses the largest for the band. With P above 1 "least_squares" leaves a band from 0 to just
    that to the low-pass, as if `band_hz` were None.

    A monitor has a state and belongs to one thread. Raises SettingError.

    >>> import numpy as np
    >>> t = np.arange(8192) / 1024
    >>> def motion(t): return np.sin(9 * t) + 0.3 * np.sin(23 * t) + 0.2 * np.cos(41 * t)
    >>> monitor = Monitor(1024, update_hz=16, band_hz=(0, 32), data_decimation=None)
    >>> for first in range(0, 8192, 1000):
    ...     block = t[first : first + 1000]
    ...     readings = monitor.process(motion(block), 0.95 * motion(block - 0.020))
    >>> print(f"{readings.time_s[-1]:.3f} s: {readings.amplitude[-1]:.3f}, {1e3 * readings.delay_s[-1]:.2f} ms")
    7.992 s: 0.950, 20.00 ms
    """

    __slots__ = ("_nothing", "_stream", "settings")

    def __init__(
        self,
        rate_hz: float | MonitorSettings,
        window_s: float | None = None,
        update_hz: float | None = None,
        **changes: Unpack[MonitorKeywords],
    ) -> None:
        given: dict[str, Any] = dict(changes)
        settings = rate_hz if isinstance(rate_hz, MonitorSettings) else None
        given |= {} if settings else {"rate_hz": rate_hz}
        given |= {} if window_s is None else {"window_s": window_s}
        given |= {} if update_hz is None else {"update_hz": update_hz}
        is_chosen = "data_decimation" in given and given["data_decimation"] is None
        if is_chosen:
            given["data_decimation"] = 1
        self.settings = settled(merged(MonitorSettings, settings, given))
        if is_chosen and (band_hz := self.settings.band_hz) is not None and band_hz[1] > 0:
            factor = largest_decimation(self.settings.rate_hz, band_hz[1], self.settings.update_hz)
            self.settings = dataclasses.replace(self.settings, data_decimation=factor)
        self._stream = CoreMonitor(self.settings)
        self._nothing = self._readings(self._stream.no_readings)

    @property
    def update_hz(self) -> float:
        """Readings a second as they come."""
        return self._stream.update_hz

    @property
    def latency_s(self) -> float:
        """The decimator's delay: by how much the newest evaluated sample is older than the newest one given."""
        return self._stream.latency_s

    @property
    def age_s(self) -> float:
        """From a window's centre to the sample that brings its reading: time_s - centre_s."""
        return self._stream.age_s

    @property
    def evaluated_rate_hz(self) -> float:
        """Rate after decimation, rate_hz / P."""
        return self._stream.evaluated_rate_hz

    @property
    def samples_until_reading(self) -> int:
        """Samples until the next reading, the one that brings it included."""
        return self._stream.samples_until_reading

    def process(self, target: ArrayLike, measured: ArrayLike) -> Readings:
        """Takes the next samples, (n_samples,) or (n_samples, n_actuators); returns the readings that they bring.

        Any split of a stream into blocks gives the same readings, bit for bit. Raises SignalError for another shape.
        """
        t, m = _samples("target", np.atleast_1d(target)), _samples("measured", np.atleast_1d(measured))
        n = self.settings.n_actuators
        if t.ndim == 1 and n == 1:
            t = t[:, None]
        if m.ndim == 1 and n == 1:
            m = m[:, None]
        if t.shape != m.shape or t.ndim != 2 or t.shape[1] != n:
            expected = "(n_samples,)" if n == 1 else f"(n_samples, {n})"
            raise SignalError(f"target and measured must both have the shape {expected}, not {t.shape} and {m.shape}")
        found = self._stream.process(t, m)
        return self._nothing if found is None else self._readings(found)

    def _readings(self, found: Any) -> Readings:
        numbers = found.pop("numbers")
        for name in ("reason", "reason_code", "reason_values"):
            found[name] = tuple(found[name])
        return _made(Readings, numbers, found, {"settings": self.settings})

    def restart(self, index: int = 0) -> None:
        """Forgets all samples; the next one has this index, from 0 on. Raises SettingError."""
        if isinstance(index, bool) or not isinstance(index, int | np.integer) or not 0 <= index < 1 << 63:
            raise SettingError(f"index must be a whole number from 0 on, not {index!r}")
        self._stream.restart(int(index))

    def __repr__(self) -> str:
        settings = ", ".join(f"{k}={v!r}" for k, v in dataclasses.asdict(self.settings).items())
        return f"Monitor({settings})"


def causal_decimate(samples: ArrayLike, data_decimation: int) -> tuple[NDArray[np.float64], int]:
    """What a `Monitor` makes of one signal before it evaluates it, and the delay of that in samples.

    y_m = sum_j h_j x_(m P + 16 P - j), j = 0 .. 16 P, speaks for sample m P + delay, delay = 8 P. h: Kaiser-windowed
    sinc, flat within 2e-6 up to rate / (4 P). samples: (n_samples,). Raises SettingError, SignalError.
    """
    x = _samples("samples", samples)
    if x.ndim != 1:
        raise SignalError(f"samples must have the shape (n_samples,), not {x.shape}")
    return core_causal_decimate(x, _count("data_decimation", data_decimation))
