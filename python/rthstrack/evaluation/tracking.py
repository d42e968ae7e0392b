"""The evaluation of Guo, Xu and Chen (2014), for whole records, moving windows and over frequency.

Signs: delay_s > 0 means measured lags target; amplitude 1 is perfect. Units are SI; displacements keep the unit they
come in. Signals are arrays of shape (n_samples,) or (n_samples, n_actuators).
"""

from __future__ import annotations

import dataclasses
import math
import operator
import threading
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

import rthstrack._core as _core
from rthstrack.errors import RthstrackError, SettingError, SignalError

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas as pd
    from numpy.typing import ArrayLike, NDArray


_T = TypeVar("_T")


class _Result:
    """What all results can do."""

    __slots__ = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain Python values: numbers, strings, lists, dicts; a complex number is [real, imaginary]."""
        return cast("dict[str, Any]", _plain(self))

    def to_frame(self) -> pd.DataFrame:
        """A pandas DataFrame, a row an actuator, reading, frequency or sample; needs pandas."""
        try:
            import pandas as pd
        except ImportError:
            raise RthstrackError(
                "to_frame needs pandas, which is not installed: pip install 'rthstrack[pandas]'"
            ) from None
        return pd.DataFrame(self._columns())

    def _columns(self) -> dict[str, Any]:
        raise NotImplementedError


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, np.ndarray):
        return [_plain(v) for v in value] if value.ndim else _plain(value.item())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    return value


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


def _band(band_hz: Any) -> tuple[float, float] | None:
    if band_hz is None:
        return None
    try:
        low, high = band_hz
        return float(low), float(high)
    except (TypeError, ValueError):
        raise SettingError(f"band_hz must be two frequencies (low, high) in Hz, not {band_hz!r}") from None


def _count(name: str, value: Any) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        raise SettingError(f"{name} must be a whole number, not {value!r}") from None
    if not 0 < number < 2**32:
        raise SettingError(f"{name} must be a whole number from 1 to 2**32 - 1, not {number}")
    return number


def _number(name: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise SettingError(f"{name} must be a number, not {value!r}") from None


def _samples(name: str, samples: ArrayLike) -> NDArray[np.float64]:
    """C-contiguous float64 of one or two dimensions; no copy where it already is."""
    if (
        type(samples) is np.ndarray
        and samples.dtype == np.float64
        and samples.flags.c_contiguous
        and samples.flags.aligned
    ):
        array = samples
    else:
        try:
            # A masked sample is a missing one.
            array = samples.filled(np.nan) if isinstance(samples, np.ma.MaskedArray) else np.asarray(samples)
        except (TypeError, ValueError) as error:
            raise SignalError(f"{name} must be an array of numbers: {str(error).splitlines()[0]}") from None
        if array.dtype.kind not in "fiu":
            raise SignalError(f"{name} must hold real numbers, not {array.dtype}")
        array = np.require(array, np.float64, ["C", "A"])
    if array.ndim not in (1, 2):
        raise SignalError(f"{name} must have the shape (n_samples,) or (n_samples, n_actuators), not {array.shape}")
    return array


def _pair(target: ArrayLike, measured: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    t, m = _samples("target", target), _samples("measured", measured)
    if t.shape != m.shape:
        if t.ndim == m.ndim == 1:
            raise SignalError(
                f"measured has {m.size} samples but target has {t.size}: both must cover the same samples"
            )
        raise SignalError(f"target and measured must have the same shape, not {t.shape} and {m.shape}")
    if t.ndim == 2 and t.shape[1] == 0:
        raise SignalError(f"target has the shape {t.shape}: at least one actuator is needed")
    return t, m


def _single(target: ArrayLike, measured: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    t, m = _pair(target, measured)
    if t.ndim != 1:
        raise SignalError(f"one actuator at a time is taken here: pass one column, not an array of shape {t.shape}")
    return t, m


def _time_s(n_samples: int, rate_hz: float) -> NDArray[np.float64]:
    return np.arange(n_samples) / rate_hz


_SPREADS = ("amplitude_std", "delay_std_s", "residual_coherence", "goodness", "target_noise_std")
_INTERVALS = ("amplitude_interval", "delay_interval_s")


def _ends(name: str, interval: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Two columns of an interval (n, 2): its name with _low and _high before the unit."""
    stem, unit = (name[:-2], "_s") if name.endswith("_s") else (name, "")
    return {f"{stem}_low{unit}": interval[:, 0], f"{stem}_high{unit}": interval[:, 1]}


@dataclass(frozen=True, slots=True)
class BadSamples:
    """Samples of one channel that are no motion: their kind and number, and where the first is.

    channel: "target" or "measured". kind: "spike" (one sample that leaves and returns), "dropout" (a stretch of one
    value to which the signal jumps), "frozen" (a stretch of the last value), "clipped" (peaks cut off), "held" (each
    value is repeated until the next: `every` samples from one fresh value to the next; else 0). first: index; first_s:
    seconds.
    """

    channel: str
    kind: str
    count: int
    first: int
    first_s: float
    every: int = 0


def _bad_samples(entries: list[tuple[str, str, int, int, int]], rate_hz: float) -> tuple[BadSamples, ...]:
    return tuple(
        BadSamples(channel, kind, count, first, first / rate_hz, every)
        for channel, kind, count, first, every in entries
    )


def bad_words(found: tuple[BadSamples, ...]) -> str:
    """What was found, for a table: "5 spike in measured from 1.2 s; ..."."""
    return "; ".join(f"{b.count} {b.kind} in {b.channel} from {b.first_s:.6g} s" for b in found)


@dataclass(frozen=True, slots=True, eq=False)
class Tracking(_Result):
    """Amplitude and delay of measured over target for one record (Eqs 6-12, or by alignment).

    Scalars for one pair, arrays of shape (n_actuators,) for several; intervals are (low, high), or (n_actuators, 2).
    `amplitude_std`, `amplitude_interval`, `delay_std_s`, `delay_interval_s`: standard deviation and 95 % interval, from
    the spectrum of what the fit leaves; `residual_coherence`: how far that still follows the target, 0 to 1;
    `goodness`: the share of measured that one gain and one delay explain. All are NaN for "fei", and where not
    determined. `target_noise_std`: standard deviation of the noise that is the target's own, in its unit, where it was
    taken into account, else 0. `bad_samples`: what was found and left out, for each actuator. `reason` says why there
    is no number, or no interval, and is empty where nothing is missing.
    With `weights=True` also, per kept bin (n_bins,) or (n_bins, n_actuators): `frequency_hz` (n_bins,), `weights`
    (sum to one), `target_spectrum` and `measured_spectrum` (complex DFT of the windowed, zero-padded signals).
    """

    amplitude: float | NDArray[np.float64]
    phase_rad: float | NDArray[np.float64]
    delay_s: float | NDArray[np.float64]
    equivalent_frequency_hz: float | NDArray[np.float64]
    fei: complex | NDArray[np.complex128]
    n_bins: int
    delta_f_hz: float
    rate_hz: float
    n_samples: int
    settings: Settings
    amplitude_std: float | NDArray[np.float64] = math.nan
    amplitude_interval: tuple[float, float] | NDArray[np.float64] = (math.nan, math.nan)
    delay_std_s: float | NDArray[np.float64] = math.nan
    delay_interval_s: tuple[float, float] | NDArray[np.float64] = (math.nan, math.nan)
    residual_coherence: float | NDArray[np.float64] = math.nan
    goodness: float | NDArray[np.float64] = math.nan
    target_noise_std: float | NDArray[np.float64] = 0.0
    bad_samples: tuple[BadSamples, ...] | tuple[tuple[BadSamples, ...], ...] = ()
    reason: str | tuple[str, ...] = ""
    frequency_hz: NDArray[np.float64] | None = None
    weights: NDArray[np.float64] | None = None
    target_spectrum: NDArray[np.complex128] | None = None
    measured_spectrum: NDArray[np.complex128] | None = None

    def _columns(self) -> dict[str, Any]:
        numbers = {
            name: np.atleast_1d(getattr(self, name))
            for name in ("amplitude", "phase_rad", "delay_s", "equivalent_frequency_hz", "fei", *_SPREADS)
        }
        for name in _INTERVALS:
            numbers |= _ends(name, np.atleast_2d(np.asarray(getattr(self, name))))
        numbers["reason"] = np.atleast_1d(np.asarray(self.reason, dtype=object))
        each: Any = self.bad_samples if isinstance(self.reason, tuple) else (self.bad_samples,)
        numbers["bad_samples_found"] = np.array([bad_words(found) for found in each], dtype=object)
        same = {
            "n_bins": self.n_bins,
            "delta_f_hz": self.delta_f_hz,
            "rate_hz": self.rate_hz,
            "n_samples": self.n_samples,
        }
        n = len(numbers["amplitude"])
        settings = {key: [value] * n for key, value in dataclasses.asdict(self.settings).items()}
        return {"actuator": np.arange(n)} | numbers | {key: [value] * n for key, value in same.items()} | settings


@dataclass(frozen=True, slots=True, eq=False)
class MovingTracking(_Result):
    """The same over moving windows: arrays (n_readings,) or (n_readings, n_actuators), intervals with (low, high) last.

    `time_s` is each window's centre, counted from the first sample. Where `valid` is False the window could not be
    judged, most often for want of energy, and the numbers are NaN; `reason` says why, or why there is no interval, for
    each reading (a tuple, or a tuple of them, one an actuator).
    """

    time_s: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    phase_rad: NDArray[np.float64]
    delay_s: NDArray[np.float64]
    equivalent_frequency_hz: NDArray[np.float64]
    valid: NDArray[np.bool_]
    window_s: float
    hop_s: float
    minimum_std_ratio: float
    rate_hz: float
    settings: Settings
    amplitude_std: NDArray[np.float64]
    amplitude_interval: NDArray[np.float64]
    delay_std_s: NDArray[np.float64]
    delay_interval_s: NDArray[np.float64]
    residual_coherence: NDArray[np.float64]
    goodness: NDArray[np.float64]
    target_noise_std: NDArray[np.float64]
    bad_samples: tuple[BadSamples, ...] | tuple[tuple[BadSamples, ...], ...]
    reason: tuple[str, ...] | tuple[tuple[str, ...], ...]

    def _columns(self) -> dict[str, Any]:
        n_actuators = 1 if self.amplitude.ndim == 1 else self.amplitude.shape[1]
        names = ("amplitude", "phase_rad", "delay_s", "equivalent_frequency_hz", "valid", *_SPREADS)
        columns: dict[str, Any] = {
            "time_s": np.repeat(self.time_s, n_actuators),
            "actuator": np.tile(np.arange(n_actuators), self.time_s.size),
        } | {name: getattr(self, name).reshape(-1) for name in names}
        for name in _INTERVALS:
            columns |= _ends(name, getattr(self, name).reshape(-1, 2))
        reason = np.array(self.reason, dtype=object).reshape(n_actuators, -1)
        return columns | {"reason": reason.T.reshape(-1)}


@dataclass(frozen=True, slots=True, eq=False)
class FrequencyResponse(_Result):
    """Gain, phase, delay and coherence of measured over target by Welch's method: arrays (n_bins,).

    gain = |S_IO| / S_II (H1); phase_rad is unwrapped; delay_s = -phase_rad / (2 pi f); coherence is 0..1.
    `target_psd`, `measured_psd` are one-sided densities in unit^2/Hz.
    `gain_std`, `delay_std_s` are standard errors; `gain_interval`, `delay_interval_s` (n_bins, 2) hold the lower and
    upper ends of 95 % intervals. NaN where nothing supports them, see `frequency_response`.
    `align_s` is the delay at which segments were aligned; where it was to be found and could not be had it is 0, and
    `unaligned` says why.
    """

    frequency_hz: NDArray[np.float64]
    gain: NDArray[np.float64]
    phase_rad: NDArray[np.float64]
    delay_s: NDArray[np.float64]
    coherence: NDArray[np.float64]
    target_psd: NDArray[np.float64]
    measured_psd: NDArray[np.float64]
    gain_std: NDArray[np.float64]
    gain_interval: NDArray[np.float64]
    delay_std_s: NDArray[np.float64]
    delay_interval_s: NDArray[np.float64]
    segment_s: float
    overlap: float
    n_segments: int
    window: str
    detrend: str
    align_s: float
    dispersion: bool
    rate_hz: float
    unaligned: str = ""

    def _columns(self) -> dict[str, Any]:
        names = ("frequency_hz", "gain", "phase_rad", "delay_s", "coherence", "target_psd", "measured_psd")
        columns = {name: getattr(self, name) for name in names}
        return columns | {
            "gain_std": self.gain_std,
            "gain_low": self.gain_interval[:, 0],
            "gain_high": self.gain_interval[:, 1],
            "delay_std_s": self.delay_std_s,
            "delay_low_s": self.delay_interval_s[:, 0],
            "delay_high_s": self.delay_interval_s[:, 1],
        }


@dataclass(frozen=True, slots=True)
class FrequencySlopes(_Result):
    """Gain and delay as straight lines over the frequencies that carry the energy.

    A(f) = gain + gain_per_hz (f - f_eq), d(f) = delay_s + delay_s_per_hz (f - f_eq), f_eq = `equivalent_frequency_hz`.
    `_std` are standard errors, `_interval` 95 % intervals (low, high): what noise on measured does to each number.
    `gain_misfit`, `delay_misfit_s`: weighted root mean square of what the curves depart from their lines.
    `gain_varies`, `delay_varies`: whether over `band_hz` the curve changes, by slope or bend, by more than noise
    explains and by enough to matter: 1 % of the gain; 2 % of the delay and a twentieth of a sample.
    """

    equivalent_frequency_hz: float
    gain: float
    gain_std: float
    gain_interval: tuple[float, float]
    gain_per_hz: float
    gain_per_hz_std: float
    gain_per_hz_interval: tuple[float, float]
    gain_misfit: float
    gain_varies: bool
    delay_s: float
    delay_std_s: float
    delay_interval_s: tuple[float, float]
    delay_s_per_hz: float
    delay_s_per_hz_std: float
    delay_s_per_hz_interval: tuple[float, float]
    delay_misfit_s: float
    delay_varies: bool
    band_hz: tuple[float, float]
    n_bins: int
    align_s: float
    dispersion: bool
    segment_s: float
    overlap: float
    n_segments: int
    window: str
    detrend: str
    rate_hz: float

    def _columns(self) -> dict[str, Any]:
        columns: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, tuple):
                columns |= {f"{field.name}_{end}": [v] for end, v in zip(("low", "high"), value, strict=True)}
            else:
                columns[field.name] = [value]
        return columns


@dataclass(frozen=True, slots=True)
class Indices(_Result):
    """The time-domain indices in use beside the FEI (method section 9). Lag makes `tracking_indicator` positive.

    `energy_error` is None unless the measured force was given.
    """

    max_tracking_error: float
    max_tracking_error_percent: float
    rms_error: float
    rms_error_percent: float
    tracking_indicator: float
    j1_s: float
    j2_percent: float
    j3_percent: float
    energy_error: float | None = None

    def _columns(self) -> dict[str, Any]:
        return {f.name: [getattr(self, f.name)] for f in dataclasses.fields(self)}


@dataclass(frozen=True, slots=True, eq=False)
class IndexHistories(_Result):
    """Those indices that are histories, at every sample: arrays (n_samples,)."""

    max_tracking_error: NDArray[np.float64]
    rms_error: NDArray[np.float64]
    tracking_indicator: NDArray[np.float64]
    energy_error: NDArray[np.float64] | None
    rate_hz: float

    def _columns(self) -> dict[str, Any]:
        names = ("max_tracking_error", "rms_error", "tracking_indicator", "energy_error")
        columns = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        return {"time_s": _time_s(self.rms_error.size, self.rate_hz)} | columns


#: Samples of all plans that are kept for the next call: with its buffers a plan takes some 50 to 250 bytes a sample.
_MOST_PLANNED = 1 << 22
_plans: OrderedDict[tuple[int, float, Settings], _core.Evaluator] = OrderedDict()
_plans_lock = threading.Lock()


def _plan(n_samples: int, rate_hz: float, settings: Settings) -> _core.Evaluator:
    """A plan of these, made anew unless it is among the latest."""
    key = (n_samples, rate_hz, settings)
    with _plans_lock:
        if key in _plans:
            _plans.move_to_end(key)
            return _plans[key]
    made = _core.Evaluator(n_samples, rate_hz, settings)
    if n_samples <= _MOST_PLANNED:
        with _plans_lock:
            _plans[key] = made
            while sum(n for n, *_ in _plans) > _MOST_PLANNED:
                _plans.popitem(last=False)
    return made


class Evaluator:
    """A plan for many records of one length and rate: checked and computed once, immutable, usable from many threads.

    Takes the settings of `evaluate`; raises SettingError or SignalError where they are impossible for that length.
    """

    __slots__ = ("_plan", "n_samples", "rate_hz", "settings")

    def __init__(self, n_samples: int, rate_hz: float, settings: Settings | None = None, **changes: Any) -> None:
        try:
            self.settings = dataclasses.replace(settings or Settings(), **changes)._checked()
        except TypeError:
            known = [f.name for f in dataclasses.fields(Settings)]
            unknown = [name for name in changes if name not in known]
            raise SettingError(f"unknown setting {', '.join(unknown)}: expected {', '.join(known)}") from None
        self.n_samples = _count("n_samples", n_samples)
        self.rate_hz = _number("rate_hz", rate_hz)
        self._plan = _plan(self.n_samples, self.rate_hz, self.settings)

    @property
    def n_bins(self) -> int:
        """Number of frequency bins that P, Q and the band keep."""
        return self._plan.n_bins

    @property
    def delta_f_hz(self) -> float:
        """Spacing of the kept bins, Q rate / n (Eq 9), in hertz."""
        return self._plan.delta_f_hz

    def evaluate(self, target: ArrayLike, measured: ArrayLike, *, weights: bool = False) -> Tracking:
        """As the function `evaluate`, for signals of this length and rate."""
        t, m = _pair(target, measured)
        if len(t) != self.n_samples:
            raise SignalError(f"this evaluator is planned for {self.n_samples} samples, not for {len(t)}")
        return _tracking(self._plan, self.settings, self.rate_hz, t, m, weights)


def evaluate(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    *,
    estimator: str = "fei",
    data_decimation: int = 1,
    frequency_decimation: int = 1,
    decimator: str = "spectral",
    weight_power: int = 2,
    window: str = "boxcar",
    detrend: str = "none",
    band_hz: tuple[float, float] | None = None,
    max_delay_s: float = 0.25,
    expected_delay_s: float | None = None,
    noise: str = "white",
    noise_ratio: float = 0.0,
    bad_samples: str = "leave_out",
    weights: bool = False,
) -> Tracking:
    """Amplitude and delay of measured over target for whole records (Guo, Xu and Chen 2014, Eqs 1-12; or by alignment).

    FEI = sum O_k conj(I_k) |I_k|^(l-2) / sum |I_k|^l,  f_eq = sum f_k |I_k|^l / sum |I_k|^l,
    A = |FEI|,  phi = atan2(Im FEI, Re FEI),  d = -phi / (2 pi f_eq),
    over the bins k = Q, 2Q, ... <= p/P of the transform zero-padded to n = 2^ceil(log2 L) = 2p points.

    estimator: "fei", the above. "least_squares": the A and d that minimise sum (O(t) - A I(t - d))^2, and "aligned":
    the d at which the FEI of O(t) and I(t - d) has no phase. Both shift the raw target before it is detrended and
    windowed, so that windows, drift and averaged phases do not bias them, and give 95 % intervals; the samples at the
    ends for which I(t - d) is not known are left out.

    target, measured: (n_samples,) or (n_samples, n_actuators), any one unit; rate_hz: samples a second.
    data_decimation: P, a power of two: keeps frequencies up to rate/(2P); decimator "spectral" keeps exactly the
    bins of the undecimated transform, "chebyshev" filters and resamples as the paper did.
    frequency_decimation: Q, a power of two: keeps every Q-th bin.
    weight_power: l, 1 to 16. window: boxcar, hann, hamming, blackman, flattop or tukey (alpha 0.5).
    detrend: none, mean or linear. band_hz: lowest and highest frequency kept, both included.
    max_delay_s: "aligned" and "least_squares" look for delays and leads up to this, and a quarter of the record.
    expected_delay_s: of delays that fit them equally well (turns of a motion that is one tone, or nearly) the one
    nearest to this; None says "ambiguous".
    noise, noise_ratio: of "least_squares" only. noise "coloured": both signals are whitened by an autoregression of
    what a first fit leaves, and fitted again. noise_ratio: standard deviation of the noise on target over that on
    measured; above 0, total least squares over the bins in which both stand clear of white noise.
    bad_samples: "leave_out" (spikes, dropouts, frozen and clipped stretches have no part in the fit of "aligned" and
    "least_squares", and of held samples the fresh ones are judged) or "keep"; what was found is `bad_samples`.
    weights: also return the kept bins with their weights and spectra.

    delay_s > 0: measured lags. Raises SignalError for samples that cannot be judged, SettingError for settings.

    >>> import numpy as np
    >>> t = np.arange(4096) / 1024
    >>> target = np.sin(2 * np.pi * t) * np.hanning(4096)
    >>> measured = 0.98 * np.interp(t - 0.012, t, target)
    >>> result = evaluate(target, measured, 1024)
    >>> print(f"{result.amplitude:.3f}, lags by {1e3 * result.delay_s:.2f} ms")
    0.980, lags by 12.00 ms
    """
    t, m = _pair(target, measured)
    settings = Settings(
        estimator,
        data_decimation,
        frequency_decimation,
        decimator,
        weight_power,
        window,
        detrend,
        band_hz,
        max_delay_s,
        expected_delay_s,
        noise,
        noise_ratio,
        bad_samples,
    )._checked()
    rate_hz = _number("rate_hz", rate_hz)
    return _tracking(_plan(len(t), rate_hz, settings), settings, rate_hz, t, m, weights)


def _tracking(
    plan: _core.Evaluator,
    settings: Settings,
    rate_hz: float,
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    weights: bool,
) -> Tracking:
    spectra: tuple[Any, ...] = (None, None, None, None)
    if weights:
        found = plan.evaluate_with_spectra(target, measured)
        numbers = [n for n, _ in found]
        if target.ndim == 1:
            spectra = found[0][1]
        else:
            columns = list(zip(*(s for _, s in found), strict=True))
            spectra = (columns[0][0], *(np.stack(column, axis=1) for column in columns[1:]))
    else:
        numbers = plan.evaluate(target, measured)
    averaged: Any
    reason: str | tuple[str, ...]
    bad: Any
    if target.ndim == 1:
        averaged, (*precision, entries, reason) = numbers[0]
        bad = _bad_samples(entries, rate_hz)
    else:
        averaged = [np.array(v) for v in zip(*(n[0] for n in numbers), strict=True)]
        *found_precision, each, reasons = zip(*(n[1] for n in numbers), strict=True)
        precision, reason = [np.array(v) for v in found_precision], tuple(reasons)
        bad = tuple(_bad_samples(entries, rate_hz) for entries in each)
    about = (plan.n_bins, plan.delta_f_hz, rate_hz, len(target), settings)
    fields: tuple[Any, ...] = (*averaged, *about, *precision, bad, reason, *spectra)
    return Tracking(*fields)


def _each_actuator(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    call: Callable[[NDArray[np.float64], NDArray[np.float64]], _T],
) -> list[_T]:
    """Applies `call` to each column; an error names the actuator."""
    if target.ndim == 1:
        return [call(target, measured)]
    found = []
    for a in range(target.shape[1]):
        try:
            found.append(call(np.ascontiguousarray(target[:, a]), np.ascontiguousarray(measured[:, a])))
        except RthstrackError as error:
            raise type(error)(f"actuator {a}: {error}") from None
    return found


def evaluate_moving(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    *,
    window_s: float = 4.0,
    hop_s: float = 0.25,
    minimum_std_ratio: float = 0.05,
    estimator: str = "fei",
    data_decimation: int = 1,
    frequency_decimation: int = 1,
    decimator: str = "spectral",
    weight_power: int = 2,
    window: str = "boxcar",
    detrend: str = "none",
    band_hz: tuple[float, float] | None = None,
    max_delay_s: float = 0.25,
    expected_delay_s: float | None = None,
    noise: str = "white",
    noise_ratio: float = 0.0,
    bad_samples: str = "leave_out",
) -> MovingTracking:
    """A(t), d(t) and f_eq(t): `evaluate` on windows of window_s, one every hop_s.

    Windows of W = round(window_s rate) samples start at 0, H, 2H, ... with H = round(hop_s rate); each reading of "fei"
    is that of `evaluate` on the window's samples alone, and speaks for the window's centre (start + (W-1)/2) / rate.
    "aligned" and "least_squares" take the shifted target's samples outside the window from the record, and where
    several delays fit a window equally well, the one nearest to expected_delay_s, or else to the whole record's.
    Where the target's standard deviation in the window is below minimum_std_ratio times that of the whole record, or
    nothing is left to judge by, `valid` is False and the numbers are NaN.

    Other arguments, shapes, signs and errors as in `evaluate`; SettingError for a window longer than the record.
    """
    t, m = _pair(target, measured)
    settings = Settings(
        estimator,
        data_decimation,
        frequency_decimation,
        decimator,
        weight_power,
        window,
        detrend,
        band_hz,
        max_delay_s,
        expected_delay_s,
        noise,
        noise_ratio,
        bad_samples,
    )._checked()
    rate_hz, window_s, hop_s = _number("rate_hz", rate_hz), _number("window_s", window_s), _number("hop_s", hop_s)
    ratio = _number("minimum_std_ratio", minimum_std_ratio)
    found = _each_actuator(t, m, lambda x, y: _core.evaluate_moving(x, y, rate_hz, window_s, hop_s, ratio, settings))
    time_s = found[0][0][0]
    averaged: Any
    reasons: Any
    bad: Any
    if t.ndim == 1:
        (_, *averaged), (*precision, entries, reason) = found[0]
        reasons = tuple(reason)
        bad = _bad_samples(entries, rate_hz)
    else:
        averaged = [np.stack(column, axis=1) for column in list(zip(*(f[0] for f in found), strict=True))[1:]]
        *found_precision, each_bad, each = zip(*(f[1] for f in found), strict=True)
        bad = tuple(_bad_samples(entries, rate_hz) for entries in each_bad)
        precision = [np.stack(column, axis=1) for column in found_precision]
        reasons = tuple(tuple(r) for r in each)
    columns = (time_s, *averaged, window_s, hop_s, ratio, rate_hz, settings, *precision, bad, reasons)
    return MovingTracking(*columns)


def bridged(
    target: NDArray[np.float64], measured: NDArray[np.float64], rate_hz: float, trusted: Tracking
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Both signals of a pair, bad samples as the trusted gain and delay have them, or read between fresh ones.

    What is left at the good samples beside them is carried over in a straight line, so that they speak for no cause.
    """
    found = _core.bridged(target, measured, rate_hz, trusted.settings)
    if found is None:
        return target, measured
    (target, measured), gaps = found
    gain, delay = float(trusted.amplitude), float(trusted.delay_s) * rate_hz
    if not math.isfinite(delay) or gain == 0:
        return target, measured
    index = np.arange(target.size, dtype=np.float64)

    def fill(signal: NDArray[np.float64], gaps: list[tuple[int, int]], model: NDArray[np.float64]) -> None:
        bad = np.zeros(signal.size, dtype=bool)
        for start, end in gaps:
            bad[start:end] = True
        if bad.any() and not bad.all():
            signal[bad] = model[bad] + np.interp(index[bad], index[~bad], (signal - model)[~bad])

    fill(target, gaps[0], np.interp(index + delay, index, measured) / gain)
    fill(measured, gaps[1], gain * np.interp(index - delay, index, target))
    return target, measured


def frequency_response(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    *,
    segment_s: float | None = None,
    overlap: float = 0.5,
    window: str = "hann",
    detrend: str = "mean",
    align_s: float | None = None,
    dispersion: bool = False,
) -> FrequencyResponse:
    """Gain, phase, delay and coherence of measured over target at every frequency, by Welch's method, with intervals.

    S_IO = mean of conj(I) O over overlapping windowed segments; gain = |S_IO| / S_II (H1), phase = arg S_IO unwrapped
    along the delay of the last coherent bin, delay_s = -phase / (2 pi f), coherence = |S_IO|^2 / (S_II S_OO).
    var H = S u^H R u / sum |I_s|^2, with u the target's segments over their norm, R what overlapping segments share of
    their noise and S the noise's power from the residuals; Student's t with their degrees of freedom; 95 %.

    One pair, (n_samples,). segment_s: length of a segment (default: the largest power of two of samples in an eighth of
    the record), zero-padded to a power of two; overlap: share from 0 to below 1.
    align_s: the delay at which target's segments are taken earlier. None: that of `evaluate` with "least_squares" and
    the mean removed; where it cannot be had, or leaves too little of the record, 0, and the result's `unaligned` says
    why. 0.0: not aligned. Unaligned segments lose motion at one end and gain other at the other: over the 44 far-field
    records, of delays from 3 to 200 ms, the gain was off by up to 5 times delay over segment_s (nine bins in ten: 2
    times), and the delay, however short, by up to 1.6 / (f segment_s) of itself (nine in ten: 1). A boxcar cannot be
    moved by less than a sample.
    dispersion: also corrects, to first order, what segments lose where gain and delay change with frequency; where they
    do not it only adds noise. The intervals know nothing of such losses, nor of the noise of the alignment and of that
    correction: they speak of noise on measured, steady over the record and independent of target, white or coloured.
    Aligned by default they held the truth in 94 to 96 % over all bins together, in 91 % at the two lowest bins of a
    target that has most of its energy there.
    Intervals are NaN with fewer than 4 degrees of freedom; where they would be wider than a third of the gain to either
    side (coherence too low); at the bins next to zero and Nyquist; for overlaps above 7/8.
    delay_s > 0: measured lags. Raises SignalError, SettingError.

    Sources: Welch (1967); Bendat and Piersol, Random Data (2010), sections 9.1 and 11.5.
    """
    t, m = _single(target, measured)
    rate_hz = _number("rate_hz", rate_hz)
    segment = None if segment_s is None else _number("segment_s", segment_s)
    share, given_s = _number("overlap", overlap), None if align_s is None else _number("align_s", align_s)
    settings = (segment, share, window, detrend, given_s, bool(dispersion))
    curves, uncertainty, n_segments, length_s, used_s, why = _core.frequency_response(t, m, rate_hz, settings)
    about: Any = (length_s, share, n_segments, window, detrend, used_s, bool(dispersion), rate_hz, why)
    return FrequencyResponse(*curves, *uncertainty, *about)


def frequency_slopes(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    *,
    band_hz: tuple[float, float] | None = None,
    segment_s: float | None = None,
    overlap: float = 0.5,
    window: str = "hann",
    detrend: str = "mean",
    align_s: float | None = None,
) -> FrequencySlopes:
    """Gain and delay at the equivalent frequency and how they change with frequency.

    A(f) = A_eq + A' (f - f_eq) and d(f) = d_eq + d' (f - f_eq), fitted to `frequency_response` over the strongest bins
    that hold 99 % of the target's energy, each weighted by the inverse variance that even noise would give it;
    f_eq = sum f |I|^2 / sum |I|^2 over them.

    band_hz: lowest and highest frequency used, both included. align_s: None aligns at the delay found, again until it
    stands still. `dispersion` of `frequency_response` is used where gain or delay vary.
    Other arguments as in `frequency_response`; at least three bins must be left. The intervals speak of noise, not of
    departures from a straight line, which are `gain_misfit`, `delay_misfit_s`.
    delay_s > 0: measured lags. Raises SignalError, SettingError.

    >>> import numpy as np
    >>> rng = np.random.default_rng(1)
    >>> target = np.convolve(rng.standard_normal(16384), np.hanning(256), "same")
    >>> measured = np.roll(target, 8) + 0.01 * rng.standard_normal(16384)
    >>> found = frequency_slopes(target, measured, 1024)
    >>> print(f"{1e3 * found.delay_s:.2f} ms, changing with frequency: {found.delay_varies}")
    7.81 ms, changing with frequency: False
    """
    t, m = _single(target, measured)
    rate_hz = _number("rate_hz", rate_hz)
    segment = None if segment_s is None else _number("segment_s", segment_s)
    share = _number("overlap", overlap)
    start_s = 0.0 if align_s is None else _number("align_s", align_s)
    settings = (segment, share, window, detrend, start_s, False)
    f_eq, gain, delay, band, n_bins, found_s, dispersion, n_segments, length_s = _core.frequency_slopes(
        t, m, rate_hz, _band(band_hz), align_s is not None, settings
    )
    return FrequencySlopes(
        f_eq, *gain, *delay, band, n_bins, found_s, dispersion, length_s, share, n_segments, window, detrend, rate_hz
    )


def indices(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    *,
    force: ArrayLike | None = None,
    max_lag_s: float = 0.5,
) -> Indices:
    """The time-domain indices of the whole record: MTE, RMS, TI, J1, J2, J3 and, with the force, the energy error.

    MTE = max|O-I|; RMS = sqrt(mean (O-I)^2); TI = (A - TA)/2, see `index_histories`; J1 = lag of the highest Pearson
    correlation, searched within +-max_lag_s and half the record (the RTHS benchmark searches 0 to 49 samples);
    J2 = 100 std(O-I)/std(I); J3 = 100 max|O-I|/max|I|. Percentages of MTE and RMS are over max|I| and rms I.

    One pair, (n_samples,); force likewise, in newton for an energy in unit times newton.
    Lag makes TI and J1 positive. Raises SignalError, SettingError.
    """
    t, m = _single(target, measured)
    f = None if force is None else _samples("force", force)
    return Indices(*_core.indices(t, m, _number("rate_hz", rate_hz), f, _number("max_lag_s", max_lag_s)))


def index_histories(
    target: ArrayLike, measured: ArrayLike, rate_hz: float, *, force: ArrayLike | None = None
) -> IndexHistories:
    """The running indices, at every sample: MTE and RMS so far, tracking indicator, energy error.

    TI = (A - TA)/2 with A_{i+1} = A_i + (I_{i+1}+I_i)(O_{i+1}-O_i)/2 and TA the same with I and O exchanged (Mercan
    2007); energy error = sum (F_{i+1}+F_i)/2 ((O-I)_{i+1} - (O-I)_i).

    One pair, (n_samples,). Lag makes TI rise. Raises SignalError.
    """
    t, m = _single(target, measured)
    rate_hz = _number("rate_hz", rate_hz)
    f = None if force is None else _samples("force", force)
    return IndexHistories(*_core.index_histories(t, m, rate_hz, f), rate_hz)
