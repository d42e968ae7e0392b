"""P and Q chosen by the program, and key frequencies: less to compute for an error that is stated.

Signs and units as in `evaluate`: delay_s > 0 means measured lags target. One pair at a time, (n_samples,).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Unpack

import numpy as np

from rthstrack._core import KeyFrequencies as CoreKeyFrequencies
from rthstrack._core import choose_factors as core_choose_factors
from rthstrack._core import prior_bounds as core_prior_bounds
from rthstrack.errors import SignalError
from rthstrack.evaluation.inputs import PUBLISHED, TOLERANCE, _count, _number, _samples, _single, merged, settled
from rthstrack.evaluation.results import _Result
from rthstrack.evaluation.settings import Settings
from rthstrack.evaluation.tracking import _SPECTRA, Tracking, _plan, _tracked
from rthstrack.values import Shown, extent

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from rthstrack.evaluation.settings import EvaluationKeywords, OtherKeywords

#: Share of the weight that key frequencies hold, unless told otherwise.
SHARE = 0.999


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FactorChanges(_Result):
    """What pairs of factors change, or may change: arrays (n,), an entry a pair of P and Q.

    `amplitude` is |A / A_1 - 1|; `delay` is |d / d_1 - 1|, or |phi - phi_1| in rad where `measure` is "phase"; infinite
    where nothing is left to judge by.
    """

    data_decimation: NDArray[np.uint64]
    frequency_decimation: NDArray[np.uint64]
    n_bins: NDArray[np.uint64]
    amplitude: NDArray[np.float64]
    delay: NDArray[np.float64]
    measure: Literal["relative", "phase"]

    def _columns(self) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "measure"}


def _changes_sentence(amplitude_bound: float, delay_bound: float, measure: str) -> str:
    delay = (
        f"d by at most {100 * delay_bound:.2g} %"
        if measure == "relative"
        else f"the phase by at most {delay_bound:.2g} rad (the delay is near zero)"
    )
    return f"A by at most {100 * amplitude_bound:.2g} % and {delay}"


@dataclass(frozen=True, slots=True, repr=False)
class WindowedFactors(_Result):
    """P and Q that the same tolerance allows under another window, and their bounds, as in `Factors`.

    The bounds count from P = Q = 1 under that window, which weighs the record's parts otherwise: A and d there are
    another estimate.
    """

    window: str
    detrend: str
    data_decimation: int
    frequency_decimation: int
    amplitude_bound: float
    delay_bound: float
    delay_measure: Literal["relative", "phase"]

    @property
    def sentence(self) -> str:
        """What the window allows, in one sentence."""
        removed = "trend" if self.detrend == "linear" else "mean"
        return (
            f"window {self.window} with the {removed} removed would allow P = {self.data_decimation}, "
            f"Q = {self.frequency_decimation}: they change "
            f"{_changes_sentence(self.amplitude_bound, self.delay_bound, self.delay_measure)} under that window"
        )

    def _columns(self) -> dict[str, Any]:
        return {f.name: [getattr(self, f.name)] for f in dataclasses.fields(self)}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Factors(_Result):
    """P and Q that were chosen, and how far A and d are from `reference` there at most.

    `amplitude_bound` is relative; `delay_bound` is relative, or a phase in rad where `delay_measure` is "phase".
    `settings` are those of the evaluation, with the chosen factors; `changes` holds all pairs that were considered.
    `windowed`: where the record's two ends keep Q small, the window that would allow a larger one; nothing is changed.
    """

    data_decimation: int
    frequency_decimation: int
    amplitude_bound: float
    delay_bound: float
    delay_measure: Literal["relative", "phase"]
    tolerance: float
    settings: Settings
    reference: Tracking
    changes: FactorChanges
    windowed: WindowedFactors | None = None

    @property
    def sentence(self) -> str:
        """The choice and its bound, in one sentence."""
        r = self.reference.settings
        return (
            f"P = {self.data_decimation}, Q = {self.frequency_decimation} change "
            f"{_changes_sentence(self.amplitude_bound, self.delay_bound, self.delay_measure)} from "
            f"P = {r.data_decimation}, Q = {r.frequency_decimation} (tolerance {100 * self.tolerance:g} %)"
        )

    def _shown(self) -> Shown:
        rows = [] if self.windowed is None else [("", self.windowed.sentence)]
        return Shown("Factors", [("", self.sentence), *rows])

    def _columns(self) -> dict[str, Any]:
        return self.changes._columns()


def choose_factors(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    *,
    tolerance: float = TOLERANCE,
    data_decimation: int | None = None,
    frequency_decimation: int | None = None,
    settings: Settings | None = None,
    **changes: Unpack[OtherKeywords],
) -> Factors:
    """The largest P and Q that change amplitude and delay by no more than a tolerance, and the bound they keep to.

    |A / A_1 - 1| <= tolerance and |d / d_1 - 1| <= tolerance, where 1 is P = Q = 1; where |phi_1| < 0.001 rad the delay
    is near zero, and |phi - phi_1| <= tolerance in rad takes the place of the second. A pair (P, Q) qualifies when it
    and all pairs of smaller factors keep to that; the one of largest P Q is chosen, among equals that of the larger Q.

    The bins that P and Q keep are among those of P = Q = 1: the bound is the true change, plus what round-off and the
    cascade may do (some 1e-9 where the kept bins hold the energy), at the cost of one evaluation at P = Q = 1 and up to
    half as much again. It holds for `evaluate` of this pair with the same settings, not for other records or for parts
    of this one. Where a phase is so near to half a turn that round-off decides the delay's sign, no pair qualifies.

    What Q changes comes from the record's two ends, most of all. Where Q is chosen, could be larger, and no window or
    no detrending is set, `windowed` says what a window with the mean removed would allow: one or two more choices.

    target, measured: (n_samples,), any one unit; rate_hz: samples a second. tolerance: above 0, below 1.
    data_decimation, frequency_decimation: one of them given stays, and changes are counted from it with the other at 1.
    settings, or keywords: the others of `evaluate`; the decimator must be "spectral". Raises SignalError, SettingError.

    >>> import numpy as np
    >>> t = np.arange(8192) / 1024
    >>> target = np.sin(8 * t) * t * np.exp(-t)
    >>> found = choose_factors(target, np.interp(t - 0.012, t, target), 1024)
    >>> found.data_decimation, found.frequency_decimation, found.delay_bound < 0.005
    (512, 8, True)
    """
    t, m = _single(target, measured)
    p = None if data_decimation is None else _count("data_decimation", data_decimation)
    q = None if frequency_decimation is None else _count("frequency_decimation", frequency_decimation)
    base = _without_factors(settings, changes)
    plan = _plan(len(t), rate := _number("rate_hz", rate_hz), base)
    allowed = _number("tolerance", tolerance)
    reference = dataclasses.replace(base, data_decimation=p or 1, frequency_decimation=q or 1)
    choice: Any = core_choose_factors(plan, t, m, allowed, p, q)
    changed = FactorChanges(**choice.pop("changes"), measure=choice["delay_measure"])
    chosen = {name: choice[name] for name in ("data_decimation", "frequency_decimation")}
    choice["reference"] = _tracked(
        [choice["reference"]],
        1,
        n_bins=int(changed.n_bins[0]),
        delta_f_hz=plan.delta_f_hz * reference.frequency_decimation,
        rate_hz=rate,
        n_samples=len(t),
        settings=reference,
        **dict.fromkeys(_SPECTRA),
    )
    found = Factors(
        **choice,
        tolerance=allowed,
        settings=dataclasses.replace(base, **chosen),
        changes=changed,
    )
    if q is None and _may_grow(found):
        return dataclasses.replace(found, windowed=_windowed(t, m, rate, found, base, p))
    return found


def _may_grow(found: Factors) -> bool:
    """Whether bins are left for twice the chosen Q."""
    c = found.changes
    twice = (c.data_decimation == found.data_decimation) & (c.frequency_decimation == 2 * found.frequency_decimation)
    return bool(twice.any())


#: In place of none, in turn; each with the mean removed, where no other detrending is set.
_WINDOWS = ("hann", "tukey")


def _windowed(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    rate_hz: float,
    found: Factors,
    base: Settings,
    data_decimation: int | None,
) -> WindowedFactors | None:
    """The first window that allows a larger Q than the chosen one, at no smaller P Q; None where none does."""
    detrend = base.detrend if base.detrend in ("mean", "linear") else "mean"
    windows = _WINDOWS if base.window == "boxcar" else (base.window,)
    for settings in (dataclasses.replace(base, window=window, detrend=detrend) for window in windows):
        if settings == base:
            continue
        plan = _plan(len(target), rate_hz, settings)
        try:
            choice: Any = core_choose_factors(plan, target, measured, found.tolerance, data_decimation, None)
        except SignalError:
            continue  # nothing is left to judge by
        allowed: Any = {f.name: choice[f.name] for f in dataclasses.fields(WindowedFactors) if f.name in choice}
        p, q = choice["data_decimation"], choice["frequency_decimation"]
        if q > found.frequency_decimation and p * q >= found.data_decimation * found.frequency_decimation:
            return WindowedFactors(window=settings.window, detrend=detrend, **allowed)
    return None


def prior_bounds(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    settings: Settings | None = None,
    **changes: Unpack[OtherKeywords],
) -> tuple[FactorChanges, FactorChanges]:
    """What could be said of P alone and of Q alone without the bins: safe, but shy; to compare `choose_factors` with.

    With C = sum O conj(I) |I|^(l-2), S = sum |I|^l and M = sum f |I|^l, each changed by no more than a share c, s or m
    of itself, FEI = C / S changes by (c + s) / (1 - s) and f_eq = M / S by (m + s) / (1 - s). For P the shares come
    from the energy of target and measured above rate / (2P); for Q from the magnitude of the correlations at the lags
    T_pad m / Q, m = 1 .. Q - 1.

    Arguments and errors as in `choose_factors`; returns the bounds over P and over Q, the other factor at 1.
    """
    t, m = _single(target, measured)
    plan = _plan(len(t), _number("rate_hz", rate_hz), _without_factors(settings, changes))
    found = core_prior_bounds(plan, t, m)
    data, frequency = (FactorChanges(**found[over], measure=found["measure"]) for over in _OVER)
    return data, frequency


_OVER: tuple[Literal["data", "frequency"], ...] = ("data", "frequency")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class KeyFrequencies(_Result):
    """The fewest frequency bins that hold a share of a target's weight, ready to evaluate pairs at them alone.

    `frequency_hz` (n_bins,) ascending; `share` was asked for, `share_held` is what they hold; `delta_f_hz` is the
    spacing of the bins they were chosen among. `direct`: each bin is a sum over the samples by itself; where they are
    too many for that to be the cheaper way, all that lies below the highest is transformed and the others are dropped.
    Immutable, usable from many threads.
    """

    frequency_hz: NDArray[np.float64]
    share: float
    share_held: float
    direct: bool
    delta_f_hz: float
    rate_hz: float
    n_samples: int
    settings: Settings
    _plan: CoreKeyFrequencies

    def evaluate(self, target: ArrayLike, measured: ArrayLike) -> Tracking:
        """Amplitude and delay over these bins alone: Eqs 6-12 with all other weights at zero.

        target, measured: (n_samples,), as many as the bins were chosen from. Raises SignalError.
        """
        t, m = _single(target, measured)
        if len(t) != self.n_samples:
            raise SignalError(f"these key frequencies are planned for {self.n_samples} samples, not for {len(t)}")
        about = {name: getattr(self, name) for name in ("delta_f_hz", "rate_hz", "n_samples", "settings")}
        found = [self._plan.evaluate(t, m)]
        return _tracked(found, 1, n_bins=self.frequency_hz.size, **about, **dict.fromkeys(_SPECTRA))

    def to_dict(self) -> dict[str, Any]:
        """Plain Python values: numbers, strings, lists, dicts."""
        plain = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "_plan"}
        return plain | {"frequency_hz": self.frequency_hz.tolist(), "settings": dataclasses.asdict(self.settings)}

    def _shown(self) -> Shown:
        n = self.frequency_hz.size
        rows = [("frequency", extent(self.frequency_hz, 1.0, "Hz"))]
        return Shown(f"KeyFrequencies: {n}, which hold {100 * self.share_held:.5g} % of the weight", rows)

    def _columns(self) -> dict[str, Any]:
        return {"frequency_hz": self.frequency_hz}


def key_frequencies(
    target: ArrayLike,
    rate_hz: float,
    share: float = SHARE,
    settings: Settings | None = None,
    **changes: Unpack[EvaluationKeywords],
) -> KeyFrequencies:
    """The fewest bins that together hold at least `share` of sum |I|^l, heaviest first (the paper's third wish).

    target: (n_samples,), a whole record or a first window; pairs of the same length are then evaluated at these bins
    alone. share: above 0, at most 1. settings, or keywords: those of `evaluate`; the decimator must be "spectral".
    What they cost beside a plain evaluation is in docs/accuracy.md.

    Raises SignalError, SettingError.

    >>> import numpy as np
    >>> t = np.arange(4096) / 1024
    >>> target = np.sin(2 * np.pi * t) * np.hanning(4096)
    >>> key = key_frequencies(target, 1024, 0.99)
    >>> key.frequency_hz.tolist(), round(key.evaluate(target, 1.1 * target).amplitude, 6)
    ([0.75, 1.0, 1.25], 1.1)
    """
    t = _samples("target", target)
    if t.ndim != 1:
        raise SignalError(f"one actuator at a time is taken here: pass one column, not an array of shape {t.shape}")
    checked = settled(merged(Settings, settings or PUBLISHED, changes))
    rate, wanted = _number("rate_hz", rate_hz), _number("share", share)
    plan = CoreKeyFrequencies(t, rate, wanted, checked)
    return KeyFrequencies(
        plan.frequency_hz, wanted, plan.share_held, plan.direct, plan.delta_f_hz, rate, len(t), checked, plan
    )


def _without_factors(settings: Settings | None, changes: OtherKeywords) -> Settings:
    """Settings with changes at P = Q = 1: the factors are arguments of their own."""
    whole = settled(merged(Settings, settings or PUBLISHED, changes))
    return dataclasses.replace(whole, data_decimation=1, frequency_decimation=1)
