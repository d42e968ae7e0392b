"""LabVIEW's and DIAdem's TDM: channels described in XML, their numbers in a TDX file beside it."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree

import numpy as np

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.contents import Contents, RateStatement, Series
from rthstrack.recording.readers.waveforms import Origin, increment, origin, starts

if TYPE_CHECKING:
    from pathlib import Path
    from xml.etree.ElementTree import Element

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

# The types of its blocks.
_TYPES = {
    "eInt8Usi": "i1", "eInt16Usi": "i2", "eInt32Usi": "i4", "eInt64Usi": "i8", "eUInt8Usi": "u1", "eUInt16Usi": "u2",
    "eUInt32Usi": "u4", "eUInt64Usi": "u8", "eFloat32Usi": "f4", "eFloat64Usi": "f8",
}  # fmt: skip
_WAY = "save the file as TDMS in LabVIEW or DIAdem"
# More rows that no number stands for are a damaged file.
_MOST_GENERATED = 1 << 27


class _NotReadError(Exception):
    """Why a channel holds nothing that can be read; the others are."""


class _Blocks(NamedTuple):
    """The TDX file, its size and order of bytes, and where in it what stands."""

    path: Path
    n_bytes: int
    order: str
    blocks: dict[str, Element]


def read(path: Path) -> Contents:
    """Reads the channels of all groups, named `group/channel`; `wf_increment` states the rate."""
    if path.suffix.lower() == ".tdx":
        raise RecordingError("the numbers of a TDM file; give the .tdm file beside it")
    content = path.read_bytes()
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise RecordingError("a TDM file with definitions of its own, which none has; it is damaged")
    root = ElementTree.fromstring(content)
    by_id = {element.get("id", ""): element for element in root.iter() if element.get("id")}
    blocks = _blocks(path, root)
    series: list[Series] = []
    statements: list[RateStatement] = []
    origins: list[Origin] = []
    notes: list[str] = []
    for channel in root.iter("tdm_channel"):
        group = next(iter(_linked(channel, "group", by_id)), None)
        called = _text(channel, "name") or "Untitled"
        name = f"{_text(group, 'name')}/{called}" if group is not None and _text(group, "name") else called
        try:
            values = _values(channel, by_id, blocks)
        except _NotReadError as why:
            notes.append(f"'{name}' {why}, no channel")
            continue
        properties = _properties(channel)
        unit = _text(channel, "unit_string")
        if _text(channel, "datatype") == "DT_DATE":
            values, unit = values - values[:1], "s"
        series.append(Series(called, name, unit, values))
        statements += increment(name, properties)
        origins.append(origin(properties))
    begun = [replace(one, start_s=start) for one, start in zip(series, starts(origins), strict=True)]
    return Contents("TDM", tuple(begun), (), tuple(statements), tuple(notes))


def _blocks(path: Path, root: Element) -> _Blocks | None:
    file = next(root.iter("file"), None)
    if file is None:
        return None
    # The folder where it once lay is nobody's concern.
    stated = re.split(r"[/\\]", file.get("url", ""))[-1]
    beside = [path.with_name(stated)] if stated else []
    beside += [path.with_suffix(ending) for ending in (".tdx", ".TDX")]
    tdx = next((one for one in beside if one.is_file()), None)
    if tdx is None:
        raise RecordingError(
            f"its numbers are in {stated or beside[0].name}, which is not beside it; put both together"
        )
    order = {"littleEndian": "<", "bigEndian": ">"}.get(file.get("byteOrder", "littleEndian"))
    if order is None:
        raise RecordingError(f"an order of bytes that is not known ({file.get('byteOrder')}); {_WAY}")
    return _Blocks(tdx, tdx.stat().st_size, order, {block.get("id", ""): block for block in file})


def _values(channel: Element, by_id: dict[str, Element], blocks: _Blocks | None) -> Floats:
    columns = _linked(channel, "local_columns", by_id)
    if len(columns) != 1:
        raise _NotReadError(f"stands in {len(columns)} parts" if columns else "is empty")
    (column,) = columns
    how = _text(column, "sequence_representation") or "explicit"
    if how == "explicit":
        return _sequence(column, by_id, blocks)
    if how not in ("raw_linear", "implicit_linear", "implicit_constant"):
        raise _NotReadError(f"is filed as {how}, which is not read ({_WAY})")
    first, second = _parameters(column, 1 if how == "implicit_constant" else 2)
    if how == "raw_linear":
        return first + second * _sequence(column, by_id, blocks)
    rows = next((_text(one, "number_of_rows") for one in _linked(column, "submatrix", by_id)), None)
    if not (rows and rows.isascii() and rows.isdigit() and int(rows) <= _MOST_GENERATED):
        raise _NotReadError("does not say how many values it has")
    return first + second * np.arange(int(rows), dtype=np.float64)


def _parameters(column: Element, n: int) -> tuple[float, float]:
    """The first value and the step, or what raw numbers are moved and multiplied by; 0 where there is no second."""
    try:
        found = [float(text) for text in (_text(column, "generation_parameters") or "").split()]
    except ValueError:
        found = []
    if len(found) != n or not all(map(math.isfinite, found)):
        raise _NotReadError(f"states no parameters for its values ({_WAY})")
    return found[0], (found[1] if n > 1 else 0.0)


def _sequence(column: Element, by_id: dict[str, Element], blocks: _Blocks | None) -> Floats:
    """The numbers of the block of the TDX file that a column's `values` name."""
    values = next((one.find("values") for one in _linked(column, "values", by_id)), None)
    if values is None:
        raise _NotReadError("is empty")
    named = values.get("external")
    if named is None:
        raise _NotReadError(f"stands in the XML itself, which is not read ({_WAY})")
    block = blocks.blocks.get(named) if blocks is not None else None
    if blocks is None or block is None:
        raise RecordingError(f"block {named} is named, but not described; the file is damaged")
    if block.tag != "block":
        raise _NotReadError(f"is filed row by row, which is not read ({_WAY})")
    kind = _TYPES.get(block.get("valueType", ""))
    if kind is None:
        raise _NotReadError("holds no numbers")
    offset, n = (block.get(key, "") for key in ("byteOffset", "length"))
    if not all(text.isascii() and text.isdigit() for text in (offset, n)):
        raise RecordingError(f"block {named} states no place and length; the file is damaged")
    dtype = np.dtype(blocks.order + kind)
    if int(offset) + int(n) * dtype.itemsize > blocks.n_bytes:
        raise RecordingError(
            f"{blocks.path.name}: expected {n} values from byte {offset} on, found {blocks.n_bytes} bytes; "
            "the file is truncated"
        )
    if int(n) == 0:
        raise _NotReadError("is empty")
    return np.fromfile(blocks.path, dtype, int(n), offset=int(offset)).astype(np.float64)


def _text(element: Element | None, key: str) -> str | None:
    found = element.findtext(key) if element is not None else None
    return found.strip() or None if found else None


def _linked(element: Element, key: str, by_id: dict[str, Element]) -> list[Element]:
    """The elements that a link such as #xpointer(id("usi12") id("usi13")) names."""
    return [by_id[name] for name in re.findall(r'id\("([^"]+)"\)', _text(element, key) or "") if name in by_id]


def _properties(channel: Element) -> dict[str, object]:
    """Attributes of an instance: numbers, and texts of dates to the nanosecond."""
    found: dict[str, object] = {}
    for one in channel.iterfind("instance_attributes/*"):
        text = (one.text or "").strip()
        if one.tag == "double_attribute":
            try:
                found[one.get("name", "")] = float(text)
            except ValueError:
                continue
        elif one.tag == "time_attribute":
            found[one.get("name", "")] = text[:29]
    return found
