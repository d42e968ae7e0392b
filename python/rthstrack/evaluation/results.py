"""What all results can do: plain values, JSON, rows of a table."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

import numpy as np

from rthstrack.values import Value, extent, frame, read_only, with_interval

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray


_T = TypeVar("_T")
_N = TypeVar("_N", covariant=True)
_I = TypeVar("_I", covariant=True)


class _Result(Value):
    """What all results can do."""

    __slots__ = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain Python values: numbers, strings, lists, dicts; a complex number is [real, imaginary]."""
        return cast("dict[str, Any]", _plain(self))

    def to_frame(self) -> pd.DataFrame:
        """A pandas DataFrame, a row an actuator, reading, frequency or sample; needs pandas."""
        return frame(self._columns())

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


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class _Numbers(_Result, Generic[_N, _I]):
    """What every tracking says in numbers, in the order in which it is written; the core's names."""

    amplitude: _N
    delay_s: _N
    phase_rad: _N
    equivalent_frequency_hz: _N
    amplitude_std: _N
    amplitude_interval: _I
    delay_std_s: _N
    delay_interval_s: _I
    residual_coherence: _N
    goodness: _N
    target_noise_std: _N

    def _number_columns(self) -> dict[str, NDArray[np.float64]]:
        """A column a number, two an interval."""
        columns: dict[str, NDArray[np.float64]] = {}
        for name in NUMBERS:
            values = np.asarray(getattr(self, name))
            ends = zip(end_names(name), values.reshape(-1, 2).T, strict=True) if is_interval(name) else ()
            columns |= dict(ends) or {name: values.reshape(-1)}
        return columns

    def _number_rows(self, at: int | None = None) -> list[tuple[str, str]]:
        """Gain, delay and where they hold, of many as least to greatest, or of the one at this place."""
        rows = []
        for label, name, interval, factor, unit in _FIRST:
            values = np.asarray(getattr(self, name) if at is None else getattr(self, name)[at])
            if values.ndim:
                rows.append((label, extent(values, factor, unit)))
                continue
            ends: Any = getattr(self, interval) if interval else (math.nan, math.nan)
            low, high = ends if at is None or not interval else ends[at]
            rows.append((label, with_interval(factor * float(values), (factor * low, factor * high), unit)))
        return rows


_FIRST = (
    ("amplitude", "amplitude", "amplitude_interval", 1.0, ""),
    ("delay", "delay_s", "delay_interval_s", 1e3, "ms"),
    ("at", "equivalent_frequency_hz", "", 1.0, "Hz"),
)


def _made(kind: type[_T], *parts: Mapping[str, Any], scalars: bool = False) -> _T:
    """A frozen dataclass without slots from all of its fields.

    Its own constructor sets them one by one: a fifth of the time in which a short record is evaluated. scalars: no
    field is an array.
    """
    made = object.__new__(kind)
    fields = made.__dict__
    for part in parts:
        fields.update(part)
    for name, value in () if scalars else fields.items():
        if type(value) is np.ndarray:
            fields[name] = read_only(value)
    return made


#: The names of the numbers of a tracking.
NUMBERS = tuple(f.name for f in dataclasses.fields(_Numbers))


def is_interval(name: str) -> bool:
    """Whether the number of this name is two, low and high."""
    return "interval" in name


def end_names(interval: str) -> tuple[str, str]:
    """What the two ends of an interval are called: its name with _low and _high before the unit."""
    stem, unit = (interval[:-2], "_s") if interval.endswith("_s") else (interval, "")
    return f"{stem}_low{unit}", f"{stem}_high{unit}"


def json_ready(value: Any) -> Any:
    """The value in types that JSON knows; NaN and infinities become None."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, complex | np.complexfloating):
        return [json_ready(value.real), json_ready(value.imag)]
    if isinstance(value, Mapping):
        return {str(key): json_ready(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return json_ready(value.tolist())
    if isinstance(value, list | tuple):
        return [json_ready(item) for item in value]
    return value if value is None or isinstance(value, str) else str(value)
