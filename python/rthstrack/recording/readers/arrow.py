"""Apache Arrow: IPC streams, such as the monitor's logs, and files; and what a table of columns is for Parquet too."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.arrays import as_float, clock, rate_of, states_unit, unit_in
from rthstrack.recording.readers.contents import Clock, Contents, RateStatement, Series

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

FILE_MAGIC = b"ARROW1\0\0"
#: A message of a stream begins with this, and a stream ends with it and a length of zero.
CONTINUATION = b"\xff\xff\xff\xff"
END_OF_STREAM = CONTINUATION + bytes(4)

#: Metadata of the monitor's log of samples: key and value.
SAMPLE_LOG = (b"content", b"rthstrack samples")
# A log whose gaps are filled with NaN may take so much memory. A sender that paused for an hour is no damage.
_MOST_BYTES = 1 << 30


def read(path: Path) -> Contents:
    """Reads all whole batches; what a process that was killed had not finished is left out, with a note."""
    content = path.read_bytes()
    form, notes = "Arrow stream", []
    if content.startswith(FILE_MAGIC):
        form = "Arrow file"
        try:
            with pa.ipc.open_file(pa.py_buffer(content)) as file:
                batches = [file.get_batch(i) for i in range(file.num_record_batches)]
                schema = file.schema
            for batch in batches:
                batch.validate(full=True)
        except (pa.ArrowException, OSError):
            # Behind the magic stands a stream; the footer that lists its batches is what comes last.
            notes.append("its end is missing or damaged: read as far as batches are whole")
            schema, batches, _ = _stream(content[len(FILE_MAGIC) :])
    else:
        schema, batches, problem = _stream(content)
        rows = sum(batch.num_rows for batch in batches)
        if problem:
            notes.append(
                f"cut off or damaged behind {rows} rows in {len(batches)} whole batches; the rest was left out"
            )
        elif not content.endswith(END_OF_STREAM):
            notes.append("no end marker: whoever wrote it was stopped, or is still writing")
    table = pa.Table.from_batches(batches, schema)
    return contents_of(form, table, notes)


def contents_of(form: str, table: Any, notes: list[str]) -> Contents:
    """The columns of a table; nulls are NaN, timestamps tell the time, metadata may state units and rate."""
    series: list[Series] = []
    clocks: list[Clock] = []
    said = list(notes)
    metadata = table.schema.metadata or {}
    table = table.flatten()
    for field, column in zip(table.schema, table.columns, strict=True):
        unit = unit_in(_plain(field.metadata))
        if pa.types.is_timestamp(field.type) or pa.types.is_duration(field.type):
            clocks.append(clock(field.name, column.to_numpy(zero_copy_only=False), len(series)))
        elif pa.types.is_time(field.type):
            nanoseconds = column.cast(pa.time64("ns")).cast(pa.int64()).cast(pa.duration("ns"))
            clocks.append(clock(field.name, nanoseconds.to_numpy(zero_copy_only=False), len(series)))
        elif _is_number(field.type):
            values = column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
            series.append(Series(field.name, field.name, unit, as_float(np.asarray(values))))
        else:
            said.append(f"'{field.name}' holds {field.type}, no channel")
    statements = []
    for key, value in _plain(metadata).items():
        rate = rate_of(key, value)
        if rate is not None:
            statements.append(RateStatement(f"metadata '{key}'", rate, None, states_unit(key)))
    if metadata.get(SAMPLE_LOG[0]) == SAMPLE_LOG[1]:
        series = _gaps_shown(series, said)
    return Contents(form, tuple(series), tuple(clocks), tuple(statements), tuple(said))


def _stream(content: bytes) -> tuple[Any, list[Any], bool]:
    """Schema and whole batches of a stream, and whether something else followed."""
    reader = pa.ipc.open_stream(pa.py_buffer(content))
    batches = []
    try:
        for batch in reader:
            # To the last value: damage must not lead outside of the memory that was read.
            batch.validate(full=True)
            batches.append(batch)
    except (pa.ArrowException, OSError):
        return reader.schema, batches, True
    return reader.schema, batches, False


def _gaps_shown(series: list[Series], notes: list[str]) -> list[Series]:
    """A log's samples on an even grid: NaN where a gap was too long to be filled and the monitor wrote nothing."""
    named = {one.name: one.values for one in series}
    _note_restarts(named.get("counter"), notes)
    index, time_s = named.get("index"), named.get("time_s")
    if index is None or time_s is None or len(index) < 2:
        return series
    steps = np.diff(index)
    if not (np.isfinite(index).all() and (steps >= 1).all()) or (steps == 1).all():
        return series
    n = int(index[-1] - index[0]) + 1
    if n * len(series) * 8 > _MOST_BYTES:
        raise RecordingError(
            f"its index goes from {index[0]:.0f} to {index[-1]:.0f} in {len(index)} samples: with its gaps it would "
            f"take {n * len(series) * 8 / 2**30:.3g} GiB, expected at most {_MOST_BYTES / 2**30:g}; it is damaged, or "
            "was written over so long a pause that its parts have to be cut out with pyarrow"
        )
    places = (index - index[0]).astype(np.int64)
    gaps = int(np.count_nonzero(steps > 1))
    notes.append(f"{n - len(index)} samples in {gaps} gap(s) are not in the log and are NaN here")
    grid = np.arange(n)

    def spread(name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
        if name in ("index", "time_s"):
            return np.interp(grid, places, values)
        out = np.full(n, np.nan)
        out[places] = values
        return out

    return [Series(one.name, one.path, one.unit, spread(one.name, one.values)) for one in series]


def _note_restarts(counter: NDArray[np.float64] | None, notes: list[str]) -> None:
    """Where the sender's counter falls another run began: two tests are in one log."""
    if counter is None:
        return
    falls = np.flatnonzero(np.diff(counter) < 0) + 1
    if falls.size:
        rows = ", ".join(map(str, falls[:4])) + (", ..." if falls.size > 4 else "")
        notes.append(
            f"its counter falls {falls.size} time(s), at row {rows} from 0: the sender began anew or its counter "
            "wrapped, so parts before and after may be different tests"
        )


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
