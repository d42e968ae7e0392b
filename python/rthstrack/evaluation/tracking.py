"""The evaluation of Guo, Xu and Chen (2014) and the estimators beside it, for whole records and moving windows.

Signs: delay_s > 0 means measured lags target; amplitude 1 is perfect. Units are SI; displacements keep the unit they
come in. Signals are arrays of shape (n_samples,) or (n_samples, n_actuators).
"""

from __future__ import annotations

import dataclasses
import math
import threading
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeAlias, TypeVar, Unpack, overload

import numpy as np

from rthstrack._core import Evaluator as CoreEvaluator
from rthstrack._core import bridged as core_bridged
from rthstrack._core import evaluate_moving as core_evaluate_moving
from rthstrack.errors import RthstrackError, SignalError
from rthstrack.evaluation.bad_samples import _bad_samples, bad_words
from rthstrack.evaluation.inputs import _count, _number, _pair, merged, of_each, settled
from rthstrack.evaluation.results import NUMBERS, _made, _Numbers
from rthstrack.evaluation.settings import MovingSettings, Settings
from rthstrack.values import Shown, extent

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from rthstrack.evaluation.bad_samples import BadSamples
    from rthstrack.evaluation.settings import EvaluationKeywords, MovingKeywords

_T = TypeVar("_T")


if TYPE_CHECKING:
    from collections.abc import Sequence

    from typing_extensions import (
        TypeVar as _TypeVar,  # the checkers' own: a tracking is one pair's unless it says other
    )

    _Number = _TypeVar("_Number", covariant=True, default=float)
    _Interval = _TypeVar("_Interval", covariant=True, default=tuple[float, float])
    _Fei = _TypeVar("_Fei", covariant=True, default=complex)
    _Bad = _TypeVar("_Bad", covariant=True, default=tuple[BadSamples, ...])
    _Words = _TypeVar("_Words", covariant=True, default=str)
    _Values = _TypeVar("_Values", covariant=True, default=tuple[float, ...])
else:
    _Number, _Interval, _Fei, _Bad, _Words, _Values = map(
        TypeVar, ("_Number", "_Interval", "_Fei", "_Bad", "_Words", "_Values")
    )

# Of one pair; as defaults of any type.
_NOTHING: Any = ()
_NO_WORDS: Any = ""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Tracking(_Numbers[_Number, _Interval], Generic[_Number, _Interval, _Fei, _Bad, _Words, _Values]):
    """Amplitude and delay of measured over target for one record (Eqs 6-12, or by alignment).

    Scalars for one pair, arrays of shape (n_actuators,) for several; intervals are (low, high), or (n_actuators, 2).
    `amplitude_std`, `amplitude_interval`, `delay_std_s`, `delay_interval_s`: standard deviation and 95 % interval, from
    the spectrum of what the fit leaves; `residual_coherence`: how far that still follows the target, 0 to 1;
    `goodness`: the share of measured that one gain and one delay explain. All are NaN for "fei", and where not
    determined. `target_noise_std`: standard deviation of the noise that is the target's own, in its unit, where it was
    taken into account, else 0. `bad_samples`: what was found and left out, for each actuator. `reason` says why there
    is no number, or no interval, and is empty where nothing is missing; `reason_code` is its name, which never changes,
    `reason_values` what it says in numbers, in SI units.
    With `weights=True` also, per kept bin (n_bins,) or (n_bins, n_actuators): `frequency_hz` (n_bins,), `weights`
    (sum to one), `target_spectrum` and `measured_spectrum` (complex DFT of the windowed, zero-padded signals).
    """

    fei: _Fei
    n_bins: int
    delta_f_hz: float
    rate_hz: float
    n_samples: int
    settings: Settings
    bad_samples: _Bad = _NOTHING
    reason: _Words = _NO_WORDS
    reason_code: _Words = _NO_WORDS
    reason_values: _Values = _NOTHING
    frequency_hz: NDArray[np.float64] | None = None
    weights: NDArray[np.float64] | None = None
    target_spectrum: NDArray[np.complex128] | None = None
    measured_spectrum: NDArray[np.complex128] | None = None

    def _shown(self) -> Shown:
        reason: Any = self.reason
        each: list[tuple[str, str]] = []
        if not isinstance(reason, str):
            n = len(reason)
            told = (", ".join(f"{label} {text}" for label, text in self._number_rows(i)) for i in range(n))
            each = [(f"actuator {i}", text) for i, text in enumerate(told, start=1)]
        of = f" of {len(each)} actuators" if each else ""
        heading = f"Tracking{of}, {self.settings.estimator}: {self.n_samples} samples at {self.rate_hz:g} Hz"
        why = dict.fromkeys([reason] if isinstance(reason, str) else reason)
        return Shown(heading, [*(each or self._number_rows()), *(("", text) for text in why if text)])

    def _columns(self) -> dict[str, Any]:
        several = isinstance(self.reason, tuple)
        each: dict[str, Any] = {
            name: getattr(self, name) if several else (getattr(self, name),)
            for name in ("reason", "reason_code", "reason_values", "bad_samples")
        }
        each["bad_samples_found"] = [bad_words(found) for found in each.pop("bad_samples")]
        n = len(each["reason"])
        same = {name: getattr(self, name) for name in ("n_bins", "delta_f_hz", "rate_hz", "n_samples")}
        same |= dataclasses.asdict(self.settings)
        return (
            {"actuator": np.arange(n), "actuator_number": np.arange(1, n + 1)}
            | self._number_columns()
            | {"fei": np.atleast_1d(np.asarray(self.fei))}
            | {name: list(values) for name, values in each.items()}
            | {name: [value] * n for name, value in same.items()}
        )


#: Of several actuators.
Trackings: TypeAlias = (
    "Tracking[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128], tuple[tuple[BadSamples, ...], ...], "
    "tuple[str, ...], tuple[tuple[float, ...], ...]]"
)
#: One pair, as far as types tell, and several.
One: TypeAlias = "np.ndarray[tuple[int], np.dtype[Any]] | Sequence[float]"
Several: TypeAlias = "np.ndarray[tuple[int, int], np.dtype[Any]] | Sequence[Sequence[float]]"


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class MovingTracking(_Numbers["NDArray[np.float64]", "NDArray[np.float64]"]):
    """The same over moving windows: arrays (n_readings,) or (n_readings, n_actuators), intervals with (low, high) last.

    `time_s` is each window's centre, counted from the first sample. Where `valid` is False the window could not be
    judged, most often for want of energy, and the numbers are NaN; `reason` says why, or why there is no interval, for
    each reading (a tuple, or a tuple of them, one an actuator), `reason_code` and `reason_values` likewise.
    """

    time_s: NDArray[np.float64]
    valid: NDArray[np.bool_]
    window_s: float
    hop_s: float
    minimum_std_ratio: float
    rate_hz: float
    settings: Settings
    bad_samples: tuple[BadSamples, ...] | tuple[tuple[BadSamples, ...], ...]
    reason: tuple[str, ...] | tuple[tuple[str, ...], ...]
    reason_code: tuple[str, ...] | tuple[tuple[str, ...], ...]
    reason_values: tuple[tuple[float, ...], ...] | tuple[tuple[tuple[float, ...], ...], ...]

    def _shown(self) -> Shown:
        of = f" of {self.amplitude.shape[1]} actuators" if self.amplitude.ndim > 1 else ""
        n, known = self.valid.size, np.count_nonzero(self.valid)
        windows = f"{n} windows of {self.window_s:g} s, one every {self.hop_s:g} s, {known} judged"
        span = extent(self.time_s, 1.0, "s")
        return Shown(
            f"MovingTracking{of}, {self.settings.estimator}: {windows}", [*self._number_rows(), ("centres", span)]
        )

    def _columns(self) -> dict[str, Any]:
        n_actuators = 1 if self.amplitude.ndim == 1 else self.amplitude.shape[1]
        columns: dict[str, Any] = {
            "time_s": np.repeat(self.time_s, n_actuators),
            "actuator": np.tile(np.arange(n_actuators), self.time_s.size),
            "actuator_number": np.tile(np.arange(1, n_actuators + 1), self.time_s.size),
        }
        columns |= self._number_columns() | {"valid": self.valid.reshape(-1)}
        for name in ("reason", "reason_code", "reason_values"):
            each: Any = (getattr(self, name),) if self.amplitude.ndim == 1 else getattr(self, name)
            columns[name] = [value for at_once in zip(*each, strict=True) for value in at_once]
        return columns


#: Samples of all plans that are kept for the next call: with its buffers a plan takes some 50 to 250 bytes a sample.
_MOST_PLANNED = 1 << 22
_plans: OrderedDict[tuple[int, float, Settings], CoreEvaluator] = OrderedDict()
_plans_lock = threading.Lock()


def _plan(n_samples: int, rate_hz: float, settings: Settings) -> CoreEvaluator:
    """A plan of these, made anew unless it is among the latest."""
    key = (n_samples, rate_hz, settings)
    with _plans_lock:
        if key in _plans:
            _plans.move_to_end(key)
            return _plans[key]
    made = CoreEvaluator(n_samples, rate_hz, settings)
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

    def __init__(
        self,
        n_samples: int,
        rate_hz: float,
        settings: Settings | None = None,
        **changes: Unpack[EvaluationKeywords],
    ) -> None:
        self.settings = settled(merged(Settings, settings, changes))
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

    @overload
    def evaluate(self, target: One, measured: One, *, weights: bool = False) -> Tracking: ...

    @overload
    def evaluate(  # type: ignore[overload-overlap]
        self, target: Several, measured: Several, *, weights: bool = False
    ) -> Trackings: ...

    @overload
    def evaluate(self, target: ArrayLike, measured: ArrayLike, *, weights: bool = False) -> Tracking: ...

    def evaluate(self, target: ArrayLike, measured: ArrayLike, *, weights: bool = False) -> Any:
        """As the function `evaluate`, for signals of this length and rate."""
        t, m = _pair(target, measured)
        if len(t) != self.n_samples:
            raise SignalError(f"this evaluator is planned for {self.n_samples} samples, not for {len(t)}")
        return _tracking(self._plan, self.settings, self.rate_hz, t, m, weights)


@overload
def evaluate(
    target: One,
    measured: One,
    rate_hz: float,
    settings: Settings | None = None,
    *,
    weights: bool = False,
    **changes: Unpack[EvaluationKeywords],
) -> Tracking: ...


@overload
def evaluate(  # type: ignore[overload-overlap]
    target: Several,
    measured: Several,
    rate_hz: float,
    settings: Settings | None = None,
    *,
    weights: bool = False,
    **changes: Unpack[EvaluationKeywords],
) -> Trackings: ...


@overload
def evaluate(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    settings: Settings | None = None,
    *,
    weights: bool = False,
    **changes: Unpack[EvaluationKeywords],
) -> Tracking: ...


def evaluate(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    settings: Settings | None = None,
    *,
    weights: bool = False,
    **changes: Unpack[EvaluationKeywords],
) -> Any:
    """Amplitude and delay of measured over target for whole records (Guo, Xu and Chen 2014, Eqs 1-12; or by alignment).

    FEI = sum O_k conj(I_k) |I_k|^(l-2) / sum |I_k|^l,  f_eq = sum f_k |I_k|^l / sum |I_k|^l,
    A = |FEI|,  phi = atan2(Im FEI, Re FEI),  d = -phi / (2 pi f_eq),
    over the bins k = Q, 2Q, ... <= p/P of the transform zero-padded to n = 2^ceil(log2 L) = 2p points.

    estimator: "fei", the above. "least_squares": the A and d that minimise sum (O(t) - A I(t - d))^2, and "aligned":
    the d at which the FEI of O(t) and I(t - d) has no phase. Both shift the raw target before it is detrended and
    windowed, so that windows, drift and averaged phases do not bias them, and give 95 % intervals; the samples at the
    ends for which I(t - d) is not known are left out.

    target, measured: (n_samples,) or (n_samples, n_actuators), any one unit; rate_hz: samples a second.
    settings, or keywords of the same names: `Settings`, listed in docs/settings.md; keywords go before settings.
    noise "coloured": both signals are whitened by an autoregression of what a first fit leaves, and fitted again;
    noise_ratio above 0: total least squares over the bins in which both stand clear of white noise.
    bad_samples "leave_out": spikes, dropouts, frozen and clipped stretches have no part in the fit, and of held samples
    the fresh ones are judged; what was found is `bad_samples` of the result.
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
    settings = settled(merged(Settings, settings, changes))
    rate_hz = _number("rate_hz", rate_hz)
    return _tracking(_plan(len(t), rate_hz, settings), settings, rate_hz, t, m, weights)


def _tracking(
    plan: CoreEvaluator,
    settings: Settings,
    rate_hz: float,
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    weights: bool,
) -> Tracking:
    spectra: dict[str, Any] = dict.fromkeys(_SPECTRA)
    if weights:
        found, each = zip(*plan.evaluate_with_spectra(target, measured), strict=True)
        spectra = {name: [one[name] for one in each] for name in _SPECTRA}
        if target.ndim == 1:
            spectra = {name: column[0] for name, column in spectra.items()}
        else:
            frequency_hz = spectra["frequency_hz"][0]
            spectra = {name: np.stack(column, axis=1) for name, column in spectra.items()}
            spectra["frequency_hz"] = frequency_hz
    else:
        found = plan.evaluate(target, measured)
    return _tracked(
        found,
        target.ndim,
        n_bins=plan.n_bins,
        delta_f_hz=plan.delta_f_hz,
        rate_hz=rate_hz,
        n_samples=len(target),
        settings=settings,
        **spectra,
    )


_SPECTRA = ("frequency_hz", "weights", "target_spectrum", "measured_spectrum")
_REASON = ("reason", "reason_code", "reason_values")


def _tracked(found: Sequence[Any], ndim: int, **about: Any) -> Tracking:
    """What the core found of one pair, or with two dimensions of several, around what it was found of."""
    if ndim == 1:
        fields: dict[str, Any] = found[0]
        numbers = fields.pop("numbers")
        fields["bad_samples"] = _bad_samples(fields["bad_samples"], about["rate_hz"])
    else:
        numbers = {name: np.array([one["numbers"][name] for one in found]) for name in NUMBERS}
        fields = {name: tuple(one[name] for one in found) for name in _REASON}
        fields["fei"] = np.array([one["fei"] for one in found])
        fields["bad_samples"] = tuple(_bad_samples(one["bad_samples"], about["rate_hz"]) for one in found)
    return _made(Tracking, numbers, fields, about, scalars=ndim == 1 and about["weights"] is None)


def _each_actuator(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    call: Callable[[NDArray[np.float64], NDArray[np.float64]], _T],
) -> list[_T]:
    """Applies `call` to each column; an error names the actuator, from 1."""
    if target.ndim == 1:
        return [call(target, measured)]
    found = []
    for a in range(target.shape[1]):
        try:
            found.append(call(np.ascontiguousarray(target[:, a]), np.ascontiguousarray(measured[:, a])))
        except RthstrackError as error:
            raise error.reworded(f"actuator {a + 1}: {error}") from None
    return found


def evaluate_moving(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    settings: Settings | None = None,
    **changes: Unpack[MovingKeywords],
) -> MovingTracking:
    """A(t), d(t) and f_eq(t): `evaluate` on windows of window_s, one every hop_s.

    Windows of W = round(window_s rate) samples start at 0, H, 2H, ... with H = round(hop_s rate); each reading of "fei"
    is that of `evaluate` on the window's samples alone, and speaks for the window's centre (start + (W-1)/2) / rate.
    "aligned" and "least_squares" take the shifted target's samples outside the window from the record, and where
    several delays fit a window equally well, the one nearest to expected_delay_s, or else to the whole record's.
    Where the target's standard deviation in the window is below minimum_std_ratio times that of the whole record, or
    nothing is left to judge by, `valid` is False and the numbers are NaN.

    settings, or keywords: those of `evaluate`, and of `MovingSettings`, in docs/settings.md.

    Other arguments, shapes, signs and errors as in `evaluate`; SettingError for a window longer than the record.
    """
    t, m = _pair(target, measured)
    whole, rate_hz = settled(merged(MovingSettings, settings, changes)), _number("rate_hz", rate_hz)
    found: Any = _each_actuator(t, m, lambda x, y: core_evaluate_moving(x, y, rate_hz, whole))
    fields: dict[str, Any]
    if t.ndim == 1:
        numbers = found[0]["numbers"]
        fields = {name: tuple(found[0][name]) for name in _REASON}
        fields |= {"valid": found[0]["valid"], "bad_samples": _bad_samples(found[0]["bad_samples"], rate_hz)}
    else:
        numbers = {name: np.stack([one["numbers"][name] for one in found], axis=1) for name in NUMBERS}
        fields = {name: tuple(tuple(one[name]) for one in found) for name in _REASON}
        fields["valid"] = np.stack([one["valid"] for one in found], axis=1)
        fields["bad_samples"] = tuple(_bad_samples(one["bad_samples"], rate_hz) for one in found)
    return MovingTracking(
        **numbers,
        **fields,
        time_s=found[0]["time_s"],
        window_s=whole.window_s,
        hop_s=whole.hop_s,
        minimum_std_ratio=whole.minimum_std_ratio,
        rate_hz=rate_hz,
        settings=of_each(whole),
    )


def bridged(
    target: NDArray[np.float64], measured: NDArray[np.float64], rate_hz: float, trusted: Tracking
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Both signals of a pair, bad samples as the trusted gain and delay have them, or read between fresh ones.

    What is left at the good samples beside them is carried over in a straight line, so that they speak for no cause.
    """
    found = core_bridged(target, measured, rate_hz, trusted.settings)
    if found is None:
        return target, measured
    target, measured = found["target"], found["measured"]
    gain, delay = float(trusted.amplitude), float(trusted.delay_s) * rate_hz
    if not math.isfinite(delay) or gain == 0:
        return target, measured
    index = np.arange(target.size, dtype=np.float64)

    def fill(signal: NDArray[np.float64], gaps: NDArray[np.uint64], model: NDArray[np.float64]) -> None:
        bad = np.zeros(signal.size, dtype=bool)
        for start, end in gaps:
            bad[start:end] = True
        if bad.any() and not bad.all():
            signal[bad] = model[bad] + np.interp(index[bad], index[~bad], (signal - model)[~bad])

    fill(target, found["target_gaps"], np.interp(index + delay, index, measured) / gain)
    fill(measured, found["measured_gaps"], gain * np.interp(index - delay, index, target))
    return target, measured
