"""A ground motion in m/s2: scaled, resampled; its peak, Arias intensity and spectral acceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import SettingError, SignalError
from rthstrack.ground_motion.checks import MOST_SAMPLES, oscillator_mistakes
from rthstrack.recording.readers.at2 import STANDARD_GRAVITY_M_S2
from rthstrack.values import Shown, Value

if TYPE_CHECKING:
    from numpy.typing import NDArray

# An oscillator is followed at this many points a period at least: its peak is then missed by less than 0.13 %.
_POINTS_PER_PERIOD = 64


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class GroundMotion(Value):
    """Ground acceleration (n_samples,) in m/s2, read-only, at `rate_hz`.

    `source` says where it comes from, `notes` what was done to it, in order.
    Raises SignalError for fewer than two samples or samples that are not finite, SettingError for the rate.
    """

    name: str
    acceleration_m_s2: NDArray[np.float64]
    rate_hz: float
    source: str
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise SettingError(f"{self.name}: rate_hz: expected a positive number of Hz, found {self.rate_hz:g}")
        values = np.array(self.acceleration_m_s2, dtype=np.float64)
        if values.ndim != 1 or values.size < 2:
            raise SignalError(
                f"{self.name}: expected at least 2 samples of one ground motion, found shape {values.shape}"
            )
        broken = np.flatnonzero(~np.isfinite(values))
        if broken.size:
            raise SignalError(
                f"{self.name}: {broken.size} of {values.size} samples are NaN or infinite (first at sample {broken[0]})"
            )
        values.setflags(write=False)
        object.__setattr__(self, "acceleration_m_s2", values)

    def _shown(self) -> Shown:
        n = len(self.acceleration_m_s2)
        rows = [("source", self.source), *(("", note) for note in self.notes)]
        return Shown(f"GroundMotion '{self.name}': {n} samples at {self.rate_hz:g} Hz", rows)

    @property
    def duration_s(self) -> float:
        """n_samples / rate_hz."""
        return len(self.acceleration_m_s2) / self.rate_hz

    @property
    def peak_m_s2(self) -> float:
        """max |a|."""
        return float(np.abs(self.acceleration_m_s2).max())

    @property
    def arias_m_s(self) -> float:
        """Arias intensity pi / (2 g) int a^2 dt in m/s (trapezoidal rule; Arias 1970)."""
        integral = float(np.trapezoid(self.acceleration_m_s2**2)) / self.rate_hz
        return math.pi / (2 * STANDARD_GRAVITY_M_S2) * integral

    def spectral_acceleration_m_s2(self, period_s: float, damping_ratio: float = 0.05) -> float:
        """Pseudo-spectral acceleration omega^2 max |u| of u'' + 2 zeta omega u' + omega^2 u = -a, at rest before.

        Solved exactly for an acceleration that is linear between samples (Nigam and Jennings 1969), over the record and
        one period after it. period_s: from one sample to 100 s; damping_ratio: 0 to below 1.
        """
        from scipy.linalg import expm
        from scipy.signal import lfilter

        mistakes = oscillator_mistakes(period_s, damping_ratio, 1 / self.rate_hz)
        if mistakes:
            raise SettingError("; ".join(f"{key}: {message}" for key, message in mistakes))
        finer = max(1, math.ceil(_POINTS_PER_PERIOD / (period_s * self.rate_hz)))
        n = len(self.acceleration_m_s2)
        a = np.interp(np.arange((n - 1) * finer + 1) / finer, np.arange(n), self.acceleration_m_s2)
        a = np.concatenate([a, np.zeros(math.ceil(period_s * self.rate_hz * finer))])
        omega, dt = 2 * math.pi / period_s, 1 / (self.rate_hz * finer)
        # State and linear acceleration together: x_(i+1) = F x_i + from_now a_i + from_next a_(i+1).
        system = np.zeros((4, 4))
        system[0, 1] = system[2, 3] = 1
        system[1, :3] = -(omega**2), -2 * damping_ratio * omega, -1
        step = expm(system * dt)
        (f11, f12), (f21, f22) = step[:2, :2]
        next_u, next_v = step[:2, 3] / dt
        now_u, now_v = step[:2, 2] - step[:2, 3] / dt
        # The velocity eliminated: a recursion in u alone, started at rest in the first sample.
        b = np.array([next_u, now_u - f22 * next_u + f12 * next_v, f12 * now_v - f22 * now_u])
        start = np.array([-b[0], now_u - b[1]]) * a[0]
        u, _ = lfilter(b, [1, -(f11 + f22), f11 * f22 - f12 * f21], a, zi=start)
        return omega**2 * float(np.abs(u).max())

    def scaled(self, factor: float) -> GroundMotion:
        """The motion times `factor`, which is finite and not zero."""
        if not (math.isfinite(factor) and factor != 0):
            raise SettingError(f"{self.name}: factor: expected a finite number other than zero, found {factor:g}")
        return self._scaled(factor, f"scaled by {factor:g}")

    def scaled_to_peak(self, peak_m_s2: float) -> GroundMotion:
        """Scaled so that max |a| is `peak_m_s2`."""
        return self._scaled_to(peak_m_s2, self.peak_m_s2, 1.0, "peak_m_s2", "a peak of {:g} m/s2")

    def scaled_to_arias(self, arias_m_s: float) -> GroundMotion:
        """Scaled so that the Arias intensity is `arias_m_s`."""
        return self._scaled_to(arias_m_s, self.arias_m_s, 0.5, "arias_m_s", "an Arias intensity of {:g} m/s")

    def scaled_to_spectral_acceleration(
        self, value_m_s2: float, period_s: float, damping_ratio: float = 0.05
    ) -> GroundMotion:
        """Scaled so that the pseudo-spectral acceleration at this period and damping is `value_m_s2`."""
        found = self.spectral_acceleration_m_s2(period_s, damping_ratio)
        at = f"at {period_s:g} s and a damping ratio of {damping_ratio:g}"
        return self._scaled_to(value_m_s2, found, 1.0, "value_m_s2", f"a spectral acceleration of {{:g}} m/s2 {at}")

    def resampled(self, rate_hz: float, duration_s: float | None = None) -> GroundMotion:
        """Interpolated linearly at i / rate_hz, i = 0 .. round(duration_s rate_hz); zero past the last sample.

        duration_s: by default n / rate_hz of the record.
        """
        for what, value in (("rate_hz", rate_hz), ("duration_s", duration_s)):
            if value is not None and not (math.isfinite(value) and value > 0):
                raise SettingError(f"{self.name}: {what}: expected a positive number, found {value:g}")
        seconds = self.duration_s if duration_s is None else duration_s
        if not 1 <= seconds * rate_hz <= MOST_SAMPLES:
            raise SettingError(
                f"{self.name}: expected 1 to {MOST_SAMPLES} steps, found {seconds * rate_hz:g} "
                f"({seconds:g} s at {rate_hz:g} Hz)"
            )
        last = len(self.acceleration_m_s2) - 1
        at = np.arange(round(seconds * rate_hz) + 1) * (self.rate_hz / rate_hz)
        values = np.interp(at, np.arange(last + 1), self.acceleration_m_s2)
        # A quotient of rates is rounded: the record's last sample is not past itself.
        values[at > last * (1 + 1e-12)] = 0.0
        note = f"resampled linearly from {self.rate_hz:g} to {rate_hz:g} Hz, {len(values)} samples ({seconds:g} s)"
        if rate_hz < self.rate_hz:
            note += ", without a low-pass"
        if seconds * self.rate_hz < last:
            note += f"; cut, for the record has {self.duration_s:g} s"
        return replace(self, acceleration_m_s2=values, rate_hz=float(rate_hz), notes=(*self.notes, note))

    def _scaled_to(self, wanted: float, found: float, power: float, key: str, what: str) -> GroundMotion:
        if not (math.isfinite(wanted) and wanted > 0):
            raise SettingError(f"{self.name}: {key}: expected a positive number, found {wanted:g}")
        if not found > 0:
            raise SignalError(f"{self.name}: zero throughout: no factor scales it to {what.format(wanted)}")
        factor = (wanted / found) ** power
        return self._scaled(factor, f"scaled by {factor:.6g} to {what.format(wanted)}")

    def _scaled(self, factor: float, note: str) -> GroundMotion:
        return replace(self, acceleration_m_s2=factor * self.acceleration_m_s2, notes=(*self.notes, note))
