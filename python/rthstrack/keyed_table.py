"""TOML tables read key by key: every mistake is gathered with its key, and reading goes on."""

from __future__ import annotations

import dataclasses
import math
import re
import typing
from dataclasses import MISSING, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rthstrack.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path


def read_toml(file: Path) -> dict[str, Any]:
    """The tables of a TOML file. Raises ConfigurationError where it cannot be read as one."""
    import tomllib

    try:
        return tomllib.loads(file.read_bytes().decode("utf-8"))
    except OSError as error:
        raise ConfigurationError(file, [("", f"cannot be read: {error.strerror}")]) from None
    except UnicodeDecodeError as error:
        raise ConfigurationError(
            file, [("", f"expected TOML in UTF-8, found byte {error.start} to be no text")]
        ) from None
    except RecursionError:
        raise ConfigurationError(file, [("", "expected TOML, found it nested too deeply")]) from None
    except ValueError as error:
        raise ConfigurationError(file, [("", f"expected TOML: {error}")]) from None


# Values ---------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of value: in words, and how it is read; None is what does not fit."""

    expected: str
    read: Callable[[Any], Any]


def finite(value: Any) -> float | None:
    """A finite number as a float."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def whole(value: Any) -> int | None:
    """A whole number from 0 on."""
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    # What a float64 holds exactly is more than any count or seed needs.
    return int(value) if is_whole and 0 <= value < 1 << 53 else None


def many(read: Callable[[Any], Any], length: int | None = None) -> Callable[[Any], Any]:
    """Reads a list, of which every item must fit."""

    def read_all(value: Any) -> tuple[Any, ...] | None:
        if not isinstance(value, list | tuple) or not value or (length is not None and len(value) != length):
            return None
        found = tuple(read(one) for one in value)
        return None if any(one is None for one in found) else found

    return read_all


def _matrix(value: Any) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    rows = many(many(finite))(value)
    return np.array(rows) if rows and all(len(row) == len(rows) for row in rows) else None


def one_of(*choices: Any) -> Kind:
    """One of these values, of the same type."""

    def read(value: Any) -> Any:
        return next((one for one in choices if type(value) is type(one) and value == one), None)

    return Kind(f"one of {', '.join(map(repr, choices))}", read)


NUMBER = Kind("a finite number", finite)
POSITIVE = Kind("a positive number", lambda value: number if (number := finite(value)) and number > 0 else None)
NOT_ZERO = Kind("a finite number other than zero", lambda value: finite(value) or None)
NUMBERS = Kind("a list of finite numbers", many(finite))
SQUARE = Kind("a square matrix, as a list of rows of finite numbers", _matrix)
KINDS: dict[Any, Kind] = {
    float: NUMBER,
    float | None: NUMBER,
    int: Kind("a whole number from 0 on", whole),
    bool: Kind("true or false", lambda value: value if isinstance(value, bool) else None),
    tuple[float, ...]: NUMBERS,
    tuple[float, float]: Kind("a list of two finite numbers", many(finite, 2)),
    tuple[int, int]: Kind("a list of two whole numbers", many(whole, 2)),
    Literal[1, 2, 3]: one_of(1, 2, 3),
    Literal["continuous", "cr"]: one_of("continuous", "cr"),
}
# What stands in for a value that was wrong, so that the rest can be checked with it. A list has nothing that could.
STAND_INS: dict[Any, Any] = {float: 1.0, Literal[1, 2, 3]: 1}


def shown(value: Any) -> str:
    """A value as a message shows it."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, bool):
        return str(value).lower()
    text = repr(value) if not isinstance(value, int) or abs(value) < 1 << 64 else "a number of too many digits"
    return text if len(text) <= 60 else f"{text[:56]} ..."


def suggestion(name: str, known: Iterable[str]) -> str:
    """What may have been meant, as the end of a message; nothing where nothing is like it."""
    import difflib  # nobody waits for it where nothing is wrong

    near = difflib.get_close_matches(name, [one for one in known if one != name], n=2, cutoff=0.5)
    return f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""


# Tables ---------------------------------------------------------------------------------------------------------------


class Table:
    """One table, read key by key. Mistakes of all tables go to one list of (key, message), and reading goes on."""

    def __init__(self, values: Mapping[str, Any], key: str, mistakes: list[tuple[str, str]]) -> None:
        self.values = values
        self.key = key
        self.mistakes = mistakes
        self.known: list[str] = []

    def path(self, name: str) -> str:
        """The key of one of this table's values, from the root."""
        return f"{self.key}.{name}" if self.key else name

    def note(self, name: str, message: str) -> None:
        """A mistake in one of this table's values."""
        self.mistakes.append((self.path(name), message))

    def take(self, name: str, kind: Kind, default: Any = MISSING, *, stand_in: Any = None) -> Any:
        """The value of this name; where it is not there or wrong the default or, without one, what stands in for it."""
        self.known.append(name)
        fallback = stand_in if default is MISSING else default
        if name not in self.values:
            if default is MISSING:
                self.note(name, f"missing: expected {kind.expected}")
            return fallback
        given = self.values[name]
        value = kind.read(given)
        if value is None:
            near = suggestion(given, re.findall(r"'(\w+)'", kind.expected)) if isinstance(given, str) else ""
            self.note(name, f"expected {kind.expected}, found {shown(given)}{near}")
        return fallback if value is None else value

    def table(self, name: str, *, required: bool = False) -> Table | None:
        """The table of this name, None where there is none."""
        self.known.append(name)
        value = self.values.get(name)
        if isinstance(value, dict):
            return Table(value, self.path(name), self.mistakes)
        if name in self.values:
            self.note(name, f"expected a table, found {shown(value)}")
        elif required:
            self.note(name, "missing: expected a table")
        return None

    def tables(self, name: str) -> list[Table]:
        """The tables of an array of this name, numbered from 1."""
        self.known.append(name)
        value = self.values.get(name, [])
        if isinstance(value, list) and all(isinstance(one, dict) for one in value):
            return [Table(one, f"{self.path(name)}[{i}]", self.mistakes) for i, one in enumerate(value, start=1)]
        self.note(name, f"expected an array of tables, [[{self.path(name)}]], found {shown(value)}")
        return []

    def fields(self, cls: type, *names: str) -> dict[str, Any]:
        """The values of these fields of a dataclass (all, where none is named)."""
        hints = typing.get_type_hints(cls)
        return {
            field.name: self.take(
                field.name, KINDS[hints[field.name]], field.default, stand_in=STAND_INS.get(hints[field.name])
            )
            for field in dataclasses.fields(cls)
            if field.name in names or not names
        }

    def made(self, cls: type) -> Any:
        """A dataclass of this table's values. None if a list is wrong, for its values belong together."""
        values = self.fields(cls)
        self.close()
        lacking = any(values[f.name] is None for f in dataclasses.fields(cls) if f.default is MISSING)
        return None if lacking else cls(**values)

    def one_of(self, tag: str, known: Mapping[str, type]) -> Any:
        """A dataclass of the class that the value of `tag` names; None where it names none."""
        name = self.take(tag, one_of(*known))
        return None if name is None else self.made(known[name])

    def close(self, more: Iterable[str] = ()) -> None:
        """Notes the keys that nobody asked for, nor is yet to ask for."""
        self.known += more
        for name in self.values:
            if name not in self.known:
                self.note(
                    name, "no such key" + (suggestion(name, self.known) or f"; there are: {', '.join(self.known)}")
                )
