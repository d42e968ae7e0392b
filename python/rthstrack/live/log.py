"""The monitor's log: raw samples and readings as two Arrow IPC streams, a batch each time what came is fetched.

Samples, FILE: `index` (of the sample since the start), `time_s`, `counter` (as it was sent), `filled` (true: not
received but put on a straight line over a short gap), `target_1`, `measured_1`, `target_2`, ... in the user's unit. A
gap too long to be filled is a step in `index`.

Readings, FILE with `.readings` before its suffix: a row a reading, `index` to `reason` as in the JSON lines (`actuator`
from 0, `actuator_number` from 1, `actuator_name`; intervals as `amplitude_low`, `amplitude_high`, `delay_low_s`,
`delay_high_s`), then the totals at that time, `received`, `lost`, `repeated`, `reordered`, `malformed`, and `alarms`,
the names of those raised.

The schemas' metadata have `program`, `version`, `content`, `started` (UTC), `settings` (JSON), and of
samples `rate_hz`.

A batch is handed to the operating system whole and at once, so a process that is killed loses what it had not fetched,
and at worst leaves a batch that is cut off, which the reader leaves out. The log never holds up the monitor: where it
cannot be written any further it stops, says so, and what comes is thrown away.
"""

from __future__ import annotations

import contextlib
import datetime
import errno
import json
import os
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import pyarrow as pa

from rthstrack._core import LIVE_NUMBERS, __version__
from rthstrack.evaluation.results import end_names, is_interval
from rthstrack.recording.readers.arrow import END_OF_STREAM, SAMPLE_LOG

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

# What came is fetched so often; it is what a kill may cost.
PERIOD_S = 0.2
_TOTALS = ("received", "lost", "repeated", "reordered", "malformed")


class Source(Protocol):
    """What is logged."""

    def take_samples(self) -> dict[str, Any]: ...
    def take_readings(self) -> dict[str, Any]: ...
    def note_log(self, state: str | None, why: str | None = None) -> None: ...


def readings_path(path: Path) -> Path:
    """Where the readings go that belong to a log of samples: run.arrows, run.readings.arrows."""
    return path.with_name(f"{path.stem}.readings{path.suffix}")


class Log:
    """Two streams that exist, with their schemas, once constructed, and grow between `start` and `stop`.

    names: of the actuators. units: of each one's channels, None where not stated. say: called with one line if logging
    stops.
    Errors: OSError where a file cannot be made; FileExistsError where one is there already and is not empty.
    """

    def __init__(
        self,
        source: Source,
        path: Path,
        *,
        rate_hz: float,
        names: Sequence[str],
        units: Sequence[str | None],
        settings: Mapping[str, Any],
        say: Callable[[str], None],
    ) -> None:
        self._source = source
        self._names = np.array(names, dtype=object)
        self._say = say
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        #: Why logging stopped before its time; None while it goes on.
        self.problem: str | None = None
        metadata = {
            "rate_hz": repr(float(rate_hz)),
            "program": "rthstrack",
            "version": __version__,
            "started": datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds"),
            "settings": json.dumps(settings),
        }
        samples = _schema(_sample_fields(units), metadata | {SAMPLE_LOG[0].decode(): SAMPLE_LOG[1].decode()})
        # What holds one row an update has no sampling rate.
        del metadata["rate_hz"]
        readings = _schema(_reading_fields(), metadata | {"content": "rthstrack readings"})
        self._samples = _Stream(path, samples)
        try:
            self._readings = _Stream(readings_path(path), readings)
        except OSError:
            self._samples.close()
            with contextlib.suppress(OSError):
                path.unlink()
            raise
        # The first array makes pyarrow import pandas where there is one: half a second that is not to be spent later.
        pa.array(np.zeros(1))
        source.note_log("writing")

    def start(self) -> None:
        """Logs in a thread of its own; once only."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="rthstrack log", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Writes what is left and the end markers; may be called again."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
            self._write()
        for stream in (self._samples, self._readings):
            try:
                stream.end()
            except OSError as error:
                self._fail(error)

    def _run(self) -> None:
        while not self._stopping.wait(PERIOD_S):
            self._write()

    def _write(self) -> None:
        """Fetches what came, which must not stay in the queue whatever happens, and writes it."""
        samples, readings = self._source.take_samples(), self._source.take_readings()
        if self.problem is not None:
            return
        try:
            self._samples.append(_sample_columns(samples))
            self._readings.append(_reading_columns(readings, self._names))
        except Exception as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        if self.problem is not None:
            return
        why = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error) or repr(error)
        self.problem = why
        for stream in (self._samples, self._readings):
            with contextlib.suppress(OSError):
                stream.end()
        self._source.note_log("stopped", why)
        self._say(f"the log {self._samples.path} stopped: {why}; what is in it can be read, monitoring goes on")


class _Stream:
    """An Arrow IPC stream, to which whole messages are appended; a message that did not fit is taken out again."""

    def __init__(self, path: Path, schema: Any) -> None:
        self.path = path
        self._schema = schema
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o666)
        self._open = True
        self._length = 0
        try:
            if os.fstat(self._file).st_size:
                raise FileExistsError(errno.EEXIST, "is there already and holds something", str(path))
            self._put(schema.serialize())
        except OSError:
            self.close()
            raise

    def append(self, columns: Sequence[Any]) -> None:
        """A batch, unless it has no rows."""
        batch = pa.record_batch(columns, schema=self._schema)
        if batch.num_rows:
            self._put(batch.serialize())

    def end(self) -> None:
        """The end marker, and no more."""
        if self._open:
            try:
                self._put(END_OF_STREAM)
            finally:
                self.close()

    def close(self) -> None:
        if self._open:
            self._open = False
            os.close(self._file)

    def _put(self, message: Any) -> None:
        rest = memoryview(message)
        try:
            while rest:
                rest = rest[os.write(self._file, rest) :]
        except OSError:
            # A device has no length to go back to.
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, self._length)
            raise
        self._length += memoryview(message).nbytes


def _schema(fields: Sequence[Any], metadata: Mapping[str, str]) -> Any:
    return pa.schema(fields, metadata=dict(metadata))


def _sample_fields(units: Sequence[str | None]) -> list[Any]:
    fields = [
        pa.field("index", pa.int64()),
        pa.field("time_s", pa.float64(), metadata={"unit": "s"}),
        pa.field("counter", pa.int64()),
        pa.field("filled", pa.bool_()),
    ]
    for i, unit in enumerate(units, start=1):
        stated = None if unit is None else {"unit": unit}
        fields += [pa.field(f"{role}_{i}", pa.float64(), metadata=stated) for role in ("target", "measured")]
    return fields


def _sample_columns(taken: Mapping[str, Any]) -> list[Any]:
    columns = [taken["index"], taken["time_s"], taken["counter"], taken["filled"]]
    target, measured = taken["target"], taken["measured"]
    for i in range(target.shape[1]):
        columns += [np.ascontiguousarray(target[:, i]), np.ascontiguousarray(measured[:, i])]
    return [pa.array(column) for column in columns]


def _reading_fields() -> list[Any]:
    def number(name: str) -> Any:
        unit = next((u for end, u in (("_s", "s"), ("_rad", "rad"), ("_hz", "Hz")) if name.endswith(end)), None)
        return pa.field(name, pa.float64(), metadata=None if unit is None else {"unit": unit})

    return [
        pa.field("index", pa.int64()),
        number("time_s"),
        number("centre_s"),
        pa.field("actuator", pa.int64()),
        pa.field("actuator_number", pa.int64()),
        pa.field("actuator_name", pa.string()),
        *(number(one) for name in LIVE_NUMBERS for one in _logged(name)),
        pa.field("valid", pa.bool_()),
        pa.field("reason", pa.string()),
        pa.field("reason_code", pa.string()),
        pa.field("reason_values", pa.list_(pa.float64())),
        *(pa.field(name, pa.int64()) for name in _TOTALS),
        pa.field("alarms", pa.string()),
    ]


def _logged(name: str) -> tuple[str, ...]:
    """What a number is called in the log, an interval by its two ends."""
    return end_names(name.replace("_interval", "")) if is_interval(name) else (name,)


def _reading_columns(taken: Mapping[str, Any], names: NDArray[np.object_]) -> list[Any]:
    def column(name: str, kind: Any) -> Any:
        return pa.array(np.asarray(taken[name], dtype=kind))

    columns = [column("index", np.int64), column("time_s", np.float64), column("centre_s", np.float64)]
    actuator = np.asarray(taken["actuator"], dtype=np.int64)
    columns += [pa.array(actuator), pa.array(actuator + 1), pa.array(names[actuator], pa.string())]
    for name in LIVE_NUMBERS:
        values = np.asarray(taken[name], dtype=np.float64)
        ends = values.reshape(-1, 2).T if is_interval(name) else [values]
        columns += [pa.array(np.ascontiguousarray(end)) for end in ends]
    columns.append(column("valid", np.bool_))
    columns += [pa.array([text or None for text in taken[name]], pa.string()) for name in ("reason", "reason_code")]
    columns.append(pa.array([list(values) for values in taken["reason_values"]], pa.list_(pa.float64())))
    columns += [column(name, np.int64) for name in _TOTALS]
    columns.append(pa.array(list(taken["alarms"]), pa.string()))
    return columns
