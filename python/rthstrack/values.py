"""Frozen values: their arrays are read-only, after pickling too, and they show themselves in a few lines."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rthstrack.errors import RthstrackError

if TYPE_CHECKING:
    import pandas as pd

_WIDTH = 79
_MOST_ROWS = 12


class Shown(NamedTuple):
    """A value for people: what it is, and rows of a name and a text."""

    heading: str
    rows: Sequence[tuple[str, str]]


class Value:
    """Base of frozen dataclasses (with `repr=False`) that hold arrays or much else."""

    __slots__ = ()

    def __post_init__(self) -> None:
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray) and value.flags.writeable:
                object.__setattr__(self, field.name, read_only(value))

    def __reduce__(self) -> tuple[Any, ...]:
        state = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        proxies = {name: dict(value) for name, value in state.items() if isinstance(value, MappingProxyType)}
        return _rebuilt, (type(self), state | proxies, tuple(proxies))

    def _shown(self) -> Shown:
        rows = [(field.name, _text(getattr(self, field.name))) for field in fields(self)]  # type: ignore[arg-type]
        return Shown(type(self).__name__, rows)

    def __repr__(self) -> str:
        heading, rows = self._shown()
        few, left = _few(rows)
        width = max((len(name) for name, _ in few), default=0)
        lines = _wrapped(heading, "")
        for name, text in few:
            lines += _wrapped(f"  {name:{width}}  {text}", " " * (width + 4))
        return "\n".join([*lines, f"  {left}"] if left else lines)

    def _repr_html_(self) -> str:
        """The same as a table, which a notebook shows."""
        from html import escape

        heading, rows = self._shown()
        few, left = _few(rows)
        if left:
            few = [*few, ("", left)]
        left_aligned = ' style="text-align:left"'
        cells = "".join(
            f"<tr><th{left_aligned}>{escape(name)}</th><td{left_aligned}>{escape(text)}</td></tr>" for name, text in few
        )
        return f"<table><caption{left_aligned}>{escape(heading)}</caption><tbody>{cells}</tbody></table>"


def read_only(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The same samples under a view that cannot be written to; whoever owns them still can."""
    view = array.view()
    view.setflags(write=False)
    return view


def needed(package: str, what: str) -> Any:
    """A package that comes with an extra of its name; RthstrackError names it where it is not there."""
    try:
        return import_module(package)
    except ImportError:
        words = f"{what} needs {package}, which is not installed: pip install 'rthstrack[{package}]'"
        raise RthstrackError(words, code="not_installed") from None


def frame(columns: Mapping[str, Any], index: Any = None) -> pd.DataFrame:
    """A pandas DataFrame of these columns."""
    return needed("pandas", "to_frame").DataFrame(columns, index=index)


def _rebuilt(kind: type[Any], state: dict[str, Any], proxies: tuple[str, ...]) -> Any:
    made = object.__new__(kind)
    for name, value in state.items():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(made, name, MappingProxyType(value) if name in proxies else value)
    return made


def _few(rows: Sequence[tuple[str, str]]) -> tuple[Sequence[tuple[str, str]], str]:
    """The rows that are shown, and how many are not."""
    if len(rows) <= _MOST_ROWS:
        return rows, ""
    return rows[: _MOST_ROWS - 1], f"and {len(rows) - _MOST_ROWS + 1} more"


def _wrapped(line: str, indent: str) -> list[str]:
    """A line as up to three."""
    more = "\N{HORIZONTAL ELLIPSIS}"
    return textwrap.wrap(line, _WIDTH, subsequent_indent=indent or "  ", max_lines=3, placeholder=more) or [""]


def _text(value: Any) -> str:
    """A field of any kind, short."""
    if isinstance(value, float | np.floating):
        return f"{value:.6g}"
    if isinstance(value, np.ndarray):
        return extent(value)
    if isinstance(value, tuple) and len(value) == 2 and all(isinstance(end, float) for end in value):
        return f"{value[0]:.6g} to {value[1]:.6g}"
    if is_dataclass(value) and not isinstance(value, type):
        return type(value).__name__
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_text(one)}" for name, one in value.items()) or "none"
    if isinstance(value, tuple | list) and any(is_dataclass(one) for one in value):
        return f"{len(value)} of {type(value[0]).__name__}"
    return str(value)


# NumPy's own median, quantile and unique load its masked arrays: more than all of ours.


def median(values: np.ndarray[Any, Any]) -> float:
    """The median of some numbers, NaN where one is."""
    n = values.size
    parted = np.partition(values, sorted({(n - 1) // 2, n // 2, n - 1}))
    return math.nan if np.isnan(parted[-1]) else float(parted[(n - 1) // 2 : n // 2 + 1].mean())


def quantile(values: np.ndarray[Any, Any], share: float) -> float:
    """What this share of some finite numbers lies below, in a straight line between neighbours."""
    place = share * (values.size - 1)
    at = int(place)
    low, high = np.sort(values)[[at, min(at + 1, values.size - 1)]]
    part = place - at
    return float(low + part * (high - low) if part < 0.5 else high - (1 - part) * (high - low))


def stretches(where: np.ndarray[Any, Any]) -> list[tuple[int, int]]:
    """First and one past last of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], where, [False])).astype(np.int8))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def n_distinct(values: np.ndarray[Any, Any]) -> int:
    """How many different numbers there are."""
    ordered = np.sort(values)
    return int(np.count_nonzero(ordered[1:] != ordered[:-1])) + 1


def extent(values: np.ndarray[Any, Any], factor: float = 1.0, unit: str = "") -> str:
    """The least and the greatest of many: "6.33 to 12.11 ms"."""
    known = values[np.isfinite(values)] if values.dtype.kind in "fiu" else values
    if not known.size:
        return "none determined" if values.size else "none"
    low, high = (f"{factor * float(end):.4g}" for end in (known.min(), known.max()))
    return (low if low == high else f"{low} to {high}") + (f" {unit}" if unit else "")


def with_interval(value: float, interval: Sequence[float], unit: str = "") -> str:
    """A number with its interval, "12.0034 ms (12.0012 to 12.0056)", to the second digit of half the interval's width.

    Never more than seven significant digits, and four where there is no interval.
    """
    tail = f" {unit}" if unit else ""
    if not math.isfinite(value):
        return "not determined"
    low, high = (float(end) for end in interval)
    if not math.isfinite(high - low):
        return f"{value:.4g}{tail}"
    most = 6 - math.floor(math.log10(abs(value))) if value else 9
    half = (high - low) / 2
    wanted = 1 - int(f"{half:.1e}".split("e")[1]) if half > 0 else most
    places = max(min(wanted, most), 0)
    return f"{value:.{places}f}{tail} ({low:.{places}f} to {high:.{places}f})"
