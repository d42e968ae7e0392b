"""MATLAB's variables as channels, named as MATLAB would name them; what v5 and v7.3 files have in common."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from rthstrack.recording.readers.arrays import columns, rate_of, states_unit
from rthstrack.recording.readers.contents import STARTS, Clock, Contents, RateStatement, Series
from rthstrack.said import Said

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

# Deeper nesting than this is a reference that leads back to itself.
_DEEPEST = 32


@dataclass(frozen=True, slots=True, eq=False)
class Struct:
    """A struct array: the fields of each element, in MATLAB's order."""

    elements: Sequence[Mapping[str, Node]]


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """A cell array in MATLAB's order."""

    elements: Sequence[Node]


@dataclass(frozen=True, slots=True)
class Opaque:
    """What cannot be read outside MATLAB (`what` is its class) or holds no real numbers."""

    what: str
    is_object: bool


SPARSE = Opaque("a sparse matrix (save what full() makes of it)", False)


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Named columns with their units; `label` is what the whole is called in its file."""

    columns: Sequence[tuple[str, Node, str | None]]
    label: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Object:
    """An object of a class that is not known: its properties may hold what is."""

    what: str
    fields: Mapping[str, Node]


@dataclass(frozen=True, slots=True, eq=False)
class Dates:
    """Dates: seconds since the first (n_samples,), and that in ns since 1970."""

    seconds: NDArray[np.float64]
    first_ns: int


Node: TypeAlias = "NDArray[Any] | str | Struct | Cell | Opaque | Table | Object | Dates"


def has_objects(node: Node) -> bool:
    """Whether an object that cannot be read is in it."""
    if isinstance(node, Struct):
        return any(has_objects(one) for fields in node.elements for one in fields.values())
    if isinstance(node, Cell):
        return any(map(has_objects, node.elements))
    return isinstance(node, Opaque) and node.is_object


def contents(form: str, variables: Mapping[str, Node]) -> Contents:
    """The channels of named variables; single numbers named fs, rate, rate_hz, dt or Ts state the rate."""
    walk = _Walk([], [], [], [])
    for name, node in variables.items():
        walk.visit(name, node, None, None, 0)
    objects = list(filter(_is_unread, walk.notes))
    # What cannot be read is the first thing to say where nothing else was found.
    notes = objects + [note for note in walk.notes if note not in objects]
    one_matrix = len(variables) == 1 and isinstance(next(iter(variables.values())), np.ndarray)
    statements = tuple(_by_struct(walk.statements, walk.beside))
    return Contents(form, tuple(walk.series), tuple(walk.clocks), statements, tuple(notes), nameless=one_matrix)


def _by_struct(statements: list[RateStatement], beside: Mapping[str, list[str]]) -> list[RateStatement]:
    """Rates of structs that differ hold for the channels of each alone."""
    if len({one.rate_hz for one in statements}) < 2:
        return statements
    found: list[RateStatement] = []
    for one in statements:
        paths = beside.get(one.source)
        found += [replace(one, channel=path) for path in paths] if paths else [one]
    return found


def indexed(name: str, indices: Sequence[int | None]) -> str:
    """`name(:,2)` for indices (None, 1): from 1, None for all of a dimension."""
    return f"{name}({','.join(':' if i is None else str(i + 1) for i in indices)})"


@dataclass(frozen=True, slots=True, eq=False)
class _Walk:
    series: list[Series]
    clocks: list[Clock]
    statements: list[RateStatement]
    notes: list[str]
    # The channels in the struct of a statement, by its source.
    beside: dict[str, list[str]] = field(default_factory=dict)

    def visit(self, name: str, node: Node, label: str | None, unit: str | None, depth: int) -> None:
        if depth > _DEEPEST:
            self.notes.append(f"'{name}' is nested too deep")
        elif isinstance(node, Struct):
            for i, fields in enumerate(node.elements):
                self.fields(name if len(node.elements) == 1 else f"{name}({i + 1})", fields, depth)
        elif isinstance(node, Cell):
            for i, element in enumerate(node.elements):
                self.visit(f"{name}{{{i + 1}}}", element, None, None, depth + 1)
        elif isinstance(node, Opaque):
            self.notes.append(_not_read(name, node))
        elif isinstance(node, Table):
            for key, column, column_unit in node.columns:
                about = node.label if key != "Time" and len(node.columns) <= 2 else None
                self.visit(f"{name}.{key}", column, about, column_unit, depth + 1)
        elif isinstance(node, Object):
            # What a class keeps beside its signals is nobody's concern.
            inner = _Walk(self.series, self.clocks, [], [])
            n_before = len(self.series)
            inner.fields(name, node.fields, depth)
            if len(self.series) == n_before:
                self.notes.append(_not_read(name, Opaque(node.what, True)))
            else:
                self.notes.extend(filter(_is_unread, inner.notes))
        elif isinstance(node, Dates):
            self.clocks.append(Clock(name, name, node.seconds, node.first_ns, len(self.series)))
        elif isinstance(node, np.ndarray):
            self.array(name, node, label, unit)

    def fields(self, name: str, fields: Mapping[str, Node], depth: int) -> None:
        """One element of a struct; `label` and `unit` beside numbers speak of these (as in Simulink's structures)."""
        label = _text(fields, "label", "name")
        unit = _text(fields, "unit", "units")
        first, start_s, n_stated = len(self.series), _start(fields), len(self.statements)
        for key, node in fields.items():
            about = key.lower() in ("values", "data", "value", "y")
            self.visit(f"{name}.{key}", node, label if about else None, unit if about else None, depth + 1)
        for one in self.statements[n_stated:]:
            self.beside.setdefault(one.source, [series.path for series in self.series[first:]])
        if start_s is not None:
            self.series[first:] = [
                one if one.start_s is not None else replace(one, start_s=start_s) for one in self.series[first:]
            ]

    def array(self, name: str, array: NDArray[Any], label: str | None, unit: str | None) -> None:
        rate = rate_of(name, array) if array.size == 1 and array.dtype.kind in "iuf" else None
        if rate is not None:
            self.statements.append(RateStatement(f"'{name}'", rate, None, states_unit(name)))
            return
        found = columns(name, array, unit, self.notes, indexed)
        if label and len(found) == 1:
            found = [Series(label, found[0].path, found[0].unit, found[0].values)]
        self.series.extend(found)


def _text(fields: Mapping[str, Node], *keys: str) -> str | None:
    for key, node in fields.items():
        if key.lower() in keys and isinstance(node, str) and node.strip():
            return node.strip()
    return None


def _start(fields: Mapping[str, Node]) -> float | None:
    for key, node in fields.items():
        if key.lower() in STARTS and isinstance(node, np.ndarray) and node.size == 1 and node.dtype.kind in "iuf":
            return float(node.reshape(-1)[0]) if np.isfinite(node).all() else None
    return None


def _is_unread(note: str) -> bool:
    return isinstance(note, Said) and note.code == "unread_object"


def _not_read(name: str, node: Opaque) -> str:
    if not node.is_object:
        return f"'{name}' is {node.what}, no channel"
    ways = {
        "timeseries": f"save {name}.Time and {name}.Data",
        "table": f"save table2struct({name},'ToScalar',true)",
        "timetable": f"save table2struct(timetable2table({name}),'ToScalar',true)",
        "Simulink.SimulationData.Dataset": f"save {name}{{1}}.Values.Time and {name}{{1}}.Values.Data",
        "Simulink.SimulationOutput": f"save {name}.tout and {name}.yout{{1}}.Values.Data",
    }
    way = ways.get(node.what, "save its numbers as plain arrays or structs")
    if find_spec("matio") is None:
        why = f"which needs the package mat-io (pip install 'rthstrack[matlab]'); or {way}"
    else:
        why = f"which only MATLAB can read; {way} instead"
    return Said(f"'{name}' is a MATLAB object ({node.what}), {why}", "unread_object")
