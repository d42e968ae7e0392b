"""Apache Parquet."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from rthstrack.errors import RecordingError
from rthstrack.readers.arrays import as_float, clock, rate_of, unit_in
from rthstrack.readers.contents import Clock, Contents, RateStatement, Series

if TYPE_CHECKING:
    from pathlib import Path

# More values than this are no recording but a damaged count.
_MOST_BYTES = 1 << 35


def read(path: Path) -> Contents:
    """Reads the columns; nulls are NaN, timestamps tell the time, metadata may state units and rate."""
    with pq.ParquetFile(path) as file:
        claimed = file.metadata.num_rows * file.metadata.num_columns * 8
        if claimed > _MOST_BYTES:
            raise RecordingError(f"damaged: it claims {file.metadata.num_rows} rows")
        table = file.read().flatten()
    series: list[Series] = []
    clocks: list[Clock] = []
    notes: list[str] = []
    for field, column in zip(table.schema, table.columns, strict=True):
        unit = unit_in(_plain(field.metadata))
        if pa.types.is_timestamp(field.type) or pa.types.is_duration(field.type):
            clocks.append(clock(field.name, column.to_numpy(zero_copy_only=False)))
        elif pa.types.is_time(field.type):
            nanoseconds = column.cast(pa.time64("ns")).cast(pa.int64()).cast(pa.duration("ns"))
            clocks.append(clock(field.name, nanoseconds.to_numpy(zero_copy_only=False)))
        elif _is_number(field.type):
            values = column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
            series.append(Series(field.name, field.name, unit, as_float(np.asarray(values))))
        else:
            notes.append(f"'{field.name}' holds {field.type}, no channel")
    statements = []
    for key, value in _plain(table.schema.metadata).items():
        rate = rate_of(key, value)
        if rate is not None:
            statements.append(RateStatement(f"metadata '{key}'", rate))
    return Contents("Parquet", tuple(series), tuple(clocks), tuple(statements), tuple(notes))


def _is_number(kind: Any) -> bool:
    types = pa.types
    return bool(types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind) or types.is_decimal(kind))


def _plain(metadata: Any) -> dict[str, Any]:
    """Metadata as text and numbers."""
    found: dict[str, Any] = {}
    for key, value in (metadata or {}).items():
        text = value.decode("utf-8", "replace")
        try:
            found[key.decode("utf-8", "replace")] = json.loads(text)
        except ValueError:
            found[key.decode("utf-8", "replace")] = text
    return found
