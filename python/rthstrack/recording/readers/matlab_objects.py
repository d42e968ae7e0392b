"""MATLAB's own classes as channels: timeseries, table, timetable, and what holds them, from their properties."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.recording.readers.arrays import as_float
from rthstrack.recording.readers.matlab import Dates, Node, Object, Opaque, Struct, Table

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

# Properties that a class makes at run time are filed under this prefix and a number.
_DYNAMIC = "__dynamic_property__"


def object_node(class_name: str, properties: Mapping[str, Any], node: Callable[[Any], Node]) -> Node:
    """An object of this class with these properties; `node` makes a node of a property."""
    if class_name == "table":
        return _table(properties, node)
    if class_name == "timetable":
        return _timetable(properties, node)
    if class_name in ("duration", "datetime"):
        return _seconds(class_name, properties)
    if list(properties) == ["any"]:
        # What the class itself hands out to be saved.
        return node(properties["any"])
    fields = {name.replace(_DYNAMIC, "property"): node(value) for name, value in properties.items()}
    return _timeseries(fields) or Object(class_name, fields)


def _timeseries(fields: Mapping[str, Node]) -> Table | None:
    """Its data lie in Data_ or Storage_.Data, its time in TimeInfo.Time_, or in TimeInfo's Start_ and Increment_."""
    info = _inner(fields.get("TimeInfo"))
    data = fields.get("Data_")
    if not _is_filled(data):
        data = next((value for key, value in _inner(fields.get("Storage_")).items() if key.rstrip("_") == "Data"), None)
    if not info or not isinstance(data, np.ndarray):
        return None
    time = next((info[key] for key in ("Time_", "Time") if _is_filled(info.get(key))), None)
    if time is None:
        start, step, length = (_number(info.get(key)) for key in ("Start_", "Increment_", "Length"))
        # An even timeseries may be filed without its length.
        length = max(data.shape) if length is None else length
        time = None if step is None else (start or 0.0) + step * np.arange(int(length))
    unit = _text(info.get("Units"))
    name = _text(fields.get("Name"))
    columns: list[tuple[str, Node, str | None]] = [("Data", data, _text(_inner(fields.get("DataInfo")).get("Units")))]
    if time is not None:
        columns.insert(0, ("Time", time, "s" if unit in (None, "seconds") else unit))
    return Table(columns, name if name not in (None, "unnamed") else None)


def _table(properties: Mapping[str, Any], node: Callable[[Any], Node]) -> Node:
    about = _fields(properties.get("props"))
    names = _names(about, properties.get("varnames"), "VariableNames2048", "VariableNamesOriginal")
    return _columns(properties.get("data"), names, about.get("VariableUnits"), node)


def _timetable(properties: Mapping[str, Any], node: Callable[[Any], Node]) -> Node:
    about = _fields(properties.get("any"))
    names = _names(about, about.get("varNames"), "varNames2048", "varNamesOrig")
    found = _columns(about.get("data"), names, about.get("varUnits"), node)
    called = _names(about, about.get("dimNames"), "dimNames2048", "dimNamesOrig")
    time = _row_times(about.get("rowTimes"), _number(about.get("numRows")), node)
    if not isinstance(found, Table) or time is None:
        return Opaque("timetable", True)
    return Table([(called[0] if called else "Time", time, "s"), *found.columns])


def _row_times(times: Any, n_rows: float | None, node: Callable[[Any], Node]) -> Node | None:
    """Row times in seconds: stated one by one, or by a start with a rate or a step."""
    even = _fields(times)
    if not even:
        stated = None if times is None else node(times)
        return stated if isinstance(stated, np.ndarray | Dates) else None
    start, step = (node(even[key]) if key in even else None for key in ("origin", "stepSize"))
    rate = _number(even.get("sampleRate"))
    index = np.arange(int(n_rows or 0))
    if _number(even.get("specifiedAsRate")) and rate:
        passed = as_float(index / rate)
    elif isinstance(step, np.ndarray) and step.size == 1:
        passed = as_float(index * float(step.ravel()[0]))
    else:
        return None
    if isinstance(start, Dates):
        return Dates(passed, start.first_ns)
    return np.asarray(passed + (float(start.ravel()[0]) if isinstance(start, np.ndarray) and start.size else 0.0))


def _seconds(class_name: str, properties: Mapping[str, Any]) -> Node:
    """A duration in seconds, a datetime as dates. Both are filed in milliseconds, a datetime's since 1970."""
    found = properties.get("millis" if class_name == "duration" else "data")
    if not isinstance(found, np.ndarray) or found.dtype.kind not in "fciu" or not found.size:
        return Opaque(class_name, True)
    # What a double cannot hold of a date stands in the imaginary part.
    whole, rest = np.real(found), np.imag(found)
    if class_name == "duration":
        return np.asarray((whole + rest) / 1e3)
    whole, rest = whole.ravel(), rest.ravel()
    finite = np.flatnonzero(np.isfinite(whole))
    if not finite.size:
        return Opaque("datetime without any date", False)
    first, more = float(whole[finite[0]]), float(rest[finite[0]])
    first_ns = int(first) * 10**6 + round((first - int(first) + more) * 1e6)
    seconds = as_float(((whole - first) + (rest - more)) / 1e3)
    if not np.nan_to_num(rest).any():
        # A double alone holds today's dates to a quarter of a microsecond.
        return Dates(np.round(seconds, 6), round(first_ns, -3))
    return Dates(seconds, first_ns)


def _columns(data: Any, names: list[str], units: Any, node: Callable[[Any], Node]) -> Node:
    cells = list(data.ravel()) if isinstance(data, np.ndarray) and data.dtype.kind == "O" else []
    if len(cells) != len(names):
        return Opaque("table", True)
    stated = [_text(one) for one in units.ravel()] if isinstance(units, np.ndarray) and units.dtype.kind == "O" else []
    stated += [None] * (len(names) - len(stated))
    return Table([(name, node(cell), unit) for name, cell, unit in zip(names, cells, stated, strict=False)])


def _names(about: Mapping[str, Any], usual: Any, *others: str) -> list[str]:
    """Names; those that are no words of MATLAB's language are filed apart, with a flag."""
    for key in others:
        flag = _number(about.get("use" + key[0].upper() + key[1:]))
        if flag and key in about:
            usual = about[key]
            break
    cells = list(usual.ravel()) if isinstance(usual, np.ndarray) and usual.dtype.kind == "O" else []
    return [_text(one) or f"Var{i + 1}" for i, one in enumerate(cells)]


def _fields(value: Any) -> dict[str, Any]:
    """The fields of a struct of one element, as arrays."""
    if not isinstance(value, np.ndarray) or not value.dtype.names or not value.size:
        return {}
    return {key: value[key].ravel()[0] for key in value.dtype.names}


def _inner(node: Node | None) -> Mapping[str, Node]:
    if isinstance(node, Object):
        return node.fields
    return node.elements[0] if isinstance(node, Struct) and node.elements else {}


def _is_filled(node: Node | None) -> bool:
    return isinstance(node, np.ndarray) and node.size > 0


def _number(value: Any) -> float | None:
    """The one number in it."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "iufb" and value.size == 1:
        found = float(value.ravel()[0])
        return found if np.isfinite(found) else None
    return None


def _text(value: NDArray[Any] | Node | None) -> str | None:
    if isinstance(value, np.ndarray):
        value = "".join(map(str, value.ravel())) if value.dtype.kind in "US" else None
    return value.strip() or None if isinstance(value, str) else None
