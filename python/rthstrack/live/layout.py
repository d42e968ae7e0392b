"""Where counter, target and measured stand in a datagram or a line: read from TOML, checked, written by `replay`."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

import numpy as np

from rthstrack.errors import ConfigurationError, SettingError, printable
from rthstrack.keyed_table import NUMBER, Kind, Table, one_of, read_toml, shown, suggestion, whole

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

Source = Literal["udp", "lines"]


_TYPES = {"f32": "f4", "f64": "f8", "i16": "i2", "u16": "u2", "i32": "i4", "u32": "u4", "i64": "i8", "u64": "u8"}
# What one UDP datagram can hold over IPv4.
_MOST_BYTES = 65507
_MOST_ACTUATORS = 256
_OF_DATAGRAMS = ("byte_order", "header_bytes", "sample_bytes", "type")
_OF_LINES = ("format", "delimiter")
_WHOLE = Kind("a whole number from 0 on", whole)
_TEXT = Kind(
    "a text without control characters",
    lambda value: value if isinstance(value, str) and value.strip() and value == printable(value) else None,
)
_TYPE = one_of(*_TYPES)
_FACTOR = Kind("a finite number other than zero", lambda value: NUMBER.read(value) or None)
_COLUMN = Kind(
    "a column's name, or its number from 0 on",
    lambda value: value if isinstance(value, str) and value and value == printable(value) else whole(value),
)
_FIELDS = Kind(
    "a list of 'counter', 'target_1', 'measured_1', 'target_2', ... and 'skip', in the order they are sent",
    lambda value: (
        tuple(value) if isinstance(value, list) and value and all(isinstance(v, str) for v in value) else None
    ),
)


@dataclass(frozen=True, slots=True)
class Field:
    """A number in a sample of a datagram, `offset` bytes behind the sample's start: value = (raw - zero) * scale."""

    offset: int
    type: str = "f64"
    scale: float = 1.0
    zero: float = 0.0

    @property
    def end(self) -> int:
        """The first byte behind it."""
        return self.offset + int(_TYPES[self.type][1])


@dataclass(frozen=True, slots=True)
class Column:
    """A number in a line, by its column's name or its number from 0 on: value = number * scale."""

    column: str | int
    scale: float = 1.0


Place = TypeVar("Place", Field, Column)


@dataclass(frozen=True, slots=True)
class Channels(Generic[Place]):
    """One actuator: where its target and measured are, what it is called, in which unit both are."""

    target: Place
    measured: Place
    name: str
    unit: str | None = None


@dataclass(frozen=True, slots=True)
class _Layout(Generic[Place]):
    """What both kinds of layout have."""

    actuators: tuple[Channels[Place], ...]

    @property
    def n_actuators(self) -> int:
        return len(self.actuators)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.actuators)

    @property
    def units(self) -> tuple[str | None, ...]:
        return tuple(one.unit for one in self.actuators)


@dataclass(frozen=True, slots=True)
class DatagramLayout(_Layout[Field]):
    """A datagram: `header_bytes` that are not looked at, then one or several samples of `sample_bytes` each."""

    counter: Field | None
    byte_order: Literal["little", "big"] = "little"
    header_bytes: int = 0
    sample_bytes: int = 0

    def to_dict(self) -> dict[str, Any]:
        """As `_core.Live` takes it."""
        counter = self.counter
        return {
            "byte_order": self.byte_order,
            "header_bytes": self.header_bytes,
            "sample_bytes": self.sample_bytes,
            "counter": None if counter is None else {"offset": counter.offset, "type": counter.type},
            "target": [_field_dict(one.target) for one in self.actuators],
            "measured": [_field_dict(one.measured) for one in self.actuators],
        }

    def encoded(
        self, counter: NDArray[np.int64], target: NDArray[np.float64], measured: NDArray[np.float64]
    ) -> NDArray[np.uint8]:
        """Samples as they are sent, (n_samples, sample_bytes), of a counter (n_samples,) and (n_samples, n_actuators).

        A counter that has outgrown its type begins again at 0. Values have to fit: see `check_range`.
        """
        order = "<" if self.byte_order == "little" else ">"
        out = np.zeros((len(counter), self.sample_bytes), dtype=np.uint8)

        def write(field: Field, raw: NDArray[Any]) -> None:
            kind = np.dtype(order + _TYPES[field.type])
            column = np.ascontiguousarray(raw.astype(kind)).view(np.uint8).reshape(len(raw), kind.itemsize)
            out[:, field.offset : field.end] = column

        if self.counter is not None:
            # Single precision counts no further.
            write(self.counter, counter % (1 << 24) if self.counter.type == "f32" else counter)
        for i, one in enumerate(self.actuators):
            write(one.target, _raw(one.target, target[:, i]))
            write(one.measured, _raw(one.measured, measured[:, i]))
        return out

    def check_range(self, name: str, actuator: int, values: NDArray[np.float64]) -> None:
        """Raises SettingError where `values` of target or measured (the name) cannot be written as the layout says."""
        field: Field = getattr(self.actuators[actuator], name)
        what = f"{name} of {self.actuators[actuator].name} cannot be sent as {field.type}"
        if not field.type.startswith("f") and not np.isfinite(values).all():
            raise SettingError(
                f"{what}: it has samples that are NaN or infinite", advice="{fill} interpolates short gaps"
            )
        kind = np.dtype(_TYPES[field.type])
        info: Any = np.finfo(kind) if field.type.startswith("f") else np.iinfo(kind)
        finite = _raw(field, values[np.isfinite(values)])
        wrong = finite[(finite < float(info.min)) | (finite > float(info.max))]
        if wrong.size:
            raise SettingError(
                f"{what}: with scale {field.scale:g} and zero {field.zero:g} it comes to {wrong[0]:g}; "
                f"expected {float(info.min):g} to {float(info.max):g}"
            )


@dataclass(frozen=True, slots=True)
class LineLayout(_Layout[Column]):
    """A line of text: CSV, or a JSON object. Column numbers are those of CSV; JSON has names."""

    counter: str | int | None
    format: Literal["csv", "json", "auto"] = "auto"
    delimiter: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """As `_core.Live` takes it."""
        return {
            "format": self.format,
            "delimiter": self.delimiter,
            "counter": self.counter,
            "target": [one.target.column for one in self.actuators],
            "measured": [one.measured.column for one in self.actuators],
            "scale": [[one.target.scale, one.measured.scale] for one in self.actuators],
        }


Layout = DatagramLayout | LineLayout


def default_layout(source: Source, n_actuators: int = 1, *, counted: bool = True) -> Layout:
    """What a UDP-send block of Simulink or LabVIEW sends: little-endian doubles counter, target_1, measured_1, ..."""
    names = ["counter"] * counted + [
        f"{role}_{i}" for i in range(1, n_actuators + 1) for role in ("target", "measured")
    ]
    return layout_from({"fields": names}, source)


def read_layout(path: str | os.PathLike[str], source: Source) -> Layout:
    """Reads and checks a TOML file. Raises ConfigurationError with every mistake in it, each with its key."""
    file = Path(path)
    return layout_from(read_toml(file), source, file)


def layout_from(table: Mapping[str, Any], source: Source, file: str | os.PathLike[str] = "") -> Layout:
    """Checks a table as `tomllib` gives it. Raises ConfigurationError with every mistake, `file` before each."""
    root = _Table(table, source)
    layout = _datagram(root) if source == "udp" else _line(root)
    root.close()
    if layout is not None and layout.n_actuators > _MOST_ACTUATORS:
        root.mistakes.append(("", f"expected at most {_MOST_ACTUATORS} actuators, found {layout.n_actuators}"))
    if root.mistakes:
        raise ConfigurationError(file, dict.fromkeys(root.mistakes))
    assert layout is not None
    return layout


def _field_dict(field: Field) -> dict[str, Any]:
    return {"offset": field.offset, "type": field.type, "scale": field.scale, "zero": field.zero}


def _raw(field: Field, values: NDArray[np.float64]) -> NDArray[np.float64]:
    raw = values / field.scale + field.zero
    return raw if field.type.startswith("f") else np.rint(raw)


class _Table(Table):
    """The root of a layout: keys of the other kind of layout are told from unknown ones."""

    def __init__(self, values: Mapping[str, Any], source: Source) -> None:
        super().__init__(values, "", [])
        others, listens = (_OF_LINES, "datagrams") if source == "udp" else (_OF_DATAGRAMS, "lines")
        kind = "lines" if source == "udp" else "datagrams"
        for name in others:
            if name in values:
                self.known.append(name)
                self.note(name, f"goes with {kind}, but this layout is for {listens}")


# Datagrams ------------------------------------------------------------------------------------------------------------


def _datagram(root: Table) -> DatagramLayout | None:
    byte_order = root.take("byte_order", one_of("little", "big"), "little")
    header_bytes = root.take("header_bytes", _WHOLE, 0)
    sample_bytes = root.take("sample_bytes", _WHOLE, None)
    compact = "fields" in root.values
    counter, actuators, end = _packed(root) if compact else _placed(root)
    if not actuators:
        return None
    if sample_bytes is not None and sample_bytes < end:
        root.note("sample_bytes", f"expected at least the {end} bytes that the fields take, found {sample_bytes}")
    sample_bytes = max(sample_bytes or 0, end)
    if header_bytes + sample_bytes > _MOST_BYTES:
        root.note(
            "sample_bytes",
            f"a header of {header_bytes} and a sample of {sample_bytes} bytes: expected no more than the {_MOST_BYTES} "
            "bytes that one datagram can hold",
        )
    return DatagramLayout(actuators, counter, byte_order, header_bytes, sample_bytes)


def _packed(root: Table) -> tuple[Field | None, tuple[Channels[Field], ...], int]:
    """The compact form: fields of one type, one behind the other."""
    kind = root.take("type", _TYPE, "f64")
    unit = root.take("unit", _TEXT, None)
    scale = root.take("scale", _FACTOR, 1.0)
    size = int(_TYPES[kind][1])
    counter, roles, n = _fields(root)
    actuators = tuple(
        Channels(Field(t * size, kind, scale), Field(m * size, kind, scale), f"actuator {i}", unit)
        for i, (t, m) in enumerate(roles, start=1)
    )
    return None if counter is None else Field(counter * size, kind), actuators, n * size


def _fields(root: Table) -> tuple[int | None, list[tuple[int, int]], int]:
    """Places of the counter and of each actuator's (target, measured) in the list `fields`, and its length."""
    for name in ("counter", "actuator"):
        if name in root.values:
            root.note(name, "does not go with fields, which say it all")
        root.known.append(name)
    fields = root.take("fields", _FIELDS, stand_in=())
    places: dict[str, int] = {}
    for i, name in enumerate(fields):
        name = f"{name}_1" if name in ("target", "measured") else name
        if name == "skip":
            continue
        if not re.fullmatch(r"counter|(target|measured)_[1-9]\d{0,3}", name):
            known = ("counter", "skip", "target_1", "measured_1")
            root.note("fields", f"expected {_FIELDS.expected}, found {shown(name)}{suggestion(name, known)}")
        elif name in places:
            root.note("fields", f"'{name}' is there twice")
        else:
            places[name] = i
    numbers = sorted({int(name.split("_")[1]) for name in places if name != "counter"})
    lacking = [f"{role}_{i}" for i in numbers for role in ("target", "measured") if f"{role}_{i}" not in places]
    if lacking:
        root.note("fields", f"expected target and measured of every actuator, found no {', '.join(lacking[:4])}")
    if numbers != list(range(1, len(numbers) + 1)):
        root.note("fields", f"expected actuators numbered from 1 on, found {', '.join(map(str, numbers))}")
    if not numbers and fields:
        root.note("fields", "expected at least target_1 and measured_1, found neither")
    roles = [] if lacking else [(places[f"target_{i}"], places[f"measured_{i}"]) for i in numbers]
    return places.get("counter"), roles, len(fields)


def _placed(root: Table) -> tuple[Field | None, tuple[Channels[Field], ...], int]:
    """Every field with its own offset and type."""
    for name in ("type", "unit", "scale"):
        if name in root.values:
            root.note(name, "goes with fields, which are not given; a field in an [[actuator]] has its own")
        root.known.append(name)
    n_mistakes = len(root.mistakes)
    counter = _counter(root)
    actuators = _actuators(root, _field)
    if len(root.mistakes) > n_mistakes:
        return counter, (), 0
    found = [] if counter is None else [("counter", counter)]
    for i, one in enumerate(actuators, start=1):
        found += [(f"actuator[{i}].target", one.target), (f"actuator[{i}].measured", one.measured)]
    _no_overlap(root, found)
    return counter, actuators, max(field.end for _, field in found)


def _counter(root: Table) -> Field | None:
    given = root.values.get("counter")
    if given is False:
        root.known.append("counter")
        return None
    if isinstance(given, dict):
        table = root.table("counter")
        assert table is not None
        field = Field(table.take("offset", _WHOLE, 0), table.take("type", _TYPE, "f64"))
        table.close()
        return field
    expected = Kind(
        f"{_TYPE.expected}, a table of offset and type, or false where there is none (losses are then not seen)",
        _TYPE.read,
    )
    kind = root.take("counter", expected)
    return None if kind is None else Field(0, kind)


def _actuators(root: Table, place: Callable[[Table, str], Place | None]) -> tuple[Channels[Place], ...]:
    root.known.append("fields")
    if "actuator" not in root.values:
        root.note("actuator", "missing: expected an [[actuator]] with target and measured for each, or fields")
        root.known.append("actuator")
        return ()
    tables = root.tables("actuator")
    if not tables and root.values["actuator"] == []:
        root.note("actuator", "expected at least one")
    found = []
    for i, table in enumerate(tables, start=1):
        name, unit = table.take("name", _TEXT, f"actuator {i}"), table.take("unit", _TEXT, None)
        target, measured = place(table, "target"), place(table, "measured")
        table.close()
        if target is not None and measured is not None:
            found.append(Channels(target, measured, name, unit))
    return tuple(found)


def _field(actuator: Table, name: str) -> Field | None:
    table = actuator.table(name, required=True)
    if table is None:
        return None
    offset = table.take("offset", _WHOLE)
    field = Field(
        0 if offset is None else offset,
        table.take("type", _TYPE, "f64"),
        table.take("scale", _FACTOR, 1.0),
        table.take("zero", NUMBER, 0.0),
    )
    table.close()
    if field.end > _MOST_BYTES:
        table.note("offset", f"expected it within the {_MOST_BYTES} bytes of a datagram, found {field.offset}")
        return None
    return field


def _no_overlap(root: Table, found: Iterable[tuple[str, Field]]) -> None:
    """Fields may be the same one (a target of two actuators), but not share some bytes only."""
    in_order = sorted(found, key=lambda one: (one[1].offset, one[1].end))
    for (key, field), (other, following) in itertools.pairwise(in_order):
        same = (field.offset, field.type) == (following.offset, following.type) and "counter" not in (key, other)
        if following.offset < field.end and not same:
            where = f"bytes {following.offset} to {following.end - 1}"
            root.mistakes.append((other, f"{where} overlap with {key}, bytes {field.offset} to {field.end - 1}"))


# Lines ----------------------------------------------------------------------------------------------------------------


def _line(root: Table) -> LineLayout | None:
    form = root.take("format", one_of("csv", "json", "auto"), "auto")
    delimiter = root.take(
        "delimiter",
        Kind(
            "one character that is no part of a number, such as ',', ';', ' ' or '\\t'",
            lambda value: value if isinstance(value, str) and re.fullmatch(r"[^\w+\-.\"\r\n]", value) else None,
        ),
        None,
    )
    if form == "json" and delimiter is not None:
        root.note("delimiter", "goes with CSV, but format says json")
    if "fields" in root.values:
        unit, scale = root.take("unit", _TEXT, None), root.take("scale", _FACTOR, 1.0)
        place, roles, _ = _fields(root)
        counter: str | int | None = place
        actuators = tuple(
            Channels(Column(t, scale), Column(m, scale), f"actuator {i}", unit)
            for i, (t, m) in enumerate(roles, start=1)
        )
    else:
        counter = _counter_column(root)
        actuators = _actuators(root, _column)
    _each_once(root, counter, actuators)
    return LineLayout(actuators, counter, form, delimiter) if actuators else None


def _counter_column(root: Table) -> str | int | None:
    if root.values.get("counter") is False:
        root.known.append("counter")
        return None
    expected = Kind(f"{_COLUMN.expected}, or false where there is none (losses are then not seen)", _COLUMN.read)
    counter: str | int | None = root.take("counter", expected)
    return counter


def _column(actuator: Table, name: str) -> Column | None:
    if isinstance(actuator.values.get(name), dict):
        table = actuator.table(name)
        assert table is not None
        column, scale = table.take("column", _COLUMN), table.take("scale", _FACTOR, 1.0)
        table.close()
    else:
        column, scale = actuator.take(name, _COLUMN), 1.0
    return None if column is None else Column(column, scale)


def _each_once(root: Table, counter: str | int | None, actuators: Sequence[Channels[Column]]) -> None:
    for i, one in enumerate(actuators, start=1):
        for role, column in (("target", one.target.column), ("measured", one.measured.column)):
            if column == counter and counter is not None:
                root.mistakes.append((f"actuator[{i}].{role}", f"{shown(column)} is the counter's column"))
        if one.target.column == one.measured.column:
            root.mistakes.append((f"actuator[{i}].measured", f"{shown(one.measured.column)} is the target's column"))
