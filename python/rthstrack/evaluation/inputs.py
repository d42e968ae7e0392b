"""What callers give, checked and made what the core takes: numbers, bands, samples."""

from __future__ import annotations

import operator
from dataclasses import fields, replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from rthstrack._core import usual_detrend
from rthstrack.errors import SettingError, SignalError, UnknownSettingError
from rthstrack.evaluation.settings import MonitorSettings, MovingSettings, Settings

if TYPE_CHECKING:
    from collections.abc import Mapping

    from _typeshed import DataclassInstance
    from numpy.typing import ArrayLike, NDArray


def _band(band_hz: Any) -> tuple[float, float] | None:
    if band_hz is None:
        return None
    try:
        low, high = band_hz
        return float(low), float(high)
    except (TypeError, ValueError):
        raise SettingError(f"band_hz must be two frequencies (low, high) in Hz, not {band_hz!r}") from None


_Kind = TypeVar("_Kind", bound="DataclassInstance")


def merged(kind: type[_Kind], settings: DataclassInstance | None, changes: Mapping[str, Any]) -> _Kind:
    """Settings with changes, which go before them; raises SettingError for a name that there is not."""
    if not changes:
        if isinstance(settings, kind):
            return settings
        if settings is None:
            usual: _Kind = _usual(kind)
            return usual
    given = {} if settings is None else {one.name: getattr(settings, one.name) for one in fields(settings)}
    given |= changes
    try:
        return kind(**given)
    except TypeError:
        known = [one.name for one in fields(kind)]
        unknown = [name for name in given if name not in known]
        if not unknown:
            raise
        from rthstrack.keyed_table import suggestion

        near = suggestion(unknown[0], known) or f"; there are: {', '.join(known)}"
        raise UnknownSettingError(f"unknown setting {', '.join(unknown)}{near}") from None


#: Largest relative change of amplitude and delay by P and Q that are chosen, unless told otherwise.
TOLERANCE = 0.005
#: Settings of what is made of the published average alone.
PUBLISHED = Settings(estimator="fei")


_Estimated = TypeVar("_Estimated", Settings, MovingSettings, MonitorSettings)


def settled(settings: _Estimated) -> _Estimated:
    """The same with what follows from the estimator where nothing was asked for: what is subtracted."""
    if settings.detrend is not None:
        return settings
    return _with_detrend(settings)  # type: ignore[no-any-return]


@lru_cache(64)
def _with_detrend(settings: Any) -> Any:
    return replace(settings, detrend=usual_detrend(settings.estimator))


@cache
def _usual(kind: type[_Kind]) -> _Kind:
    """The defaults, which are immutable."""
    return kind()


def of_each(settings: Settings) -> Settings:
    """How each of the windows is evaluated."""
    return Settings(**{one.name: getattr(settings, one.name) for one in fields(Settings)})


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
            of_channel = "; of a channel take its .values" if hasattr(samples, "values") else ""
            raise SignalError(f"{name} must hold real numbers, not {array.dtype}{of_channel}")
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
