"""LabVIEW TDMS."""

from __future__ import annotations

import contextlib
import logging
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from nptdms import TdmsFile

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.arrays import as_float, clock, is_numeric, rate_of, tidy, unit_in
from rthstrack.recording.readers.contents import Clock, Contents, RateStatement, Series

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def read(path: Path) -> Contents:
    """Reads the channels of all groups, named `group/channel`; `wf_increment` states the rate."""
    series: list[Series] = []
    clocks: list[Clock] = []
    statements: list[RateStatement] = []
    notes: list[str] = []
    with path.open("rb") as raw, _told(notes), TdmsFile.open(raw) as file:
        if file.file_status.incomplete_final_segment:
            raise RecordingError("truncated: its last segment is incomplete")
        for source, properties in [("", file.properties), *((g.name, g.properties) for g in file.groups())]:
            statements += _rates(source, properties)
        for group in file.groups():
            for channel in group.channels():
                name = f"{group.name}/{channel.name}"
                values = np.asarray(channel[:])
                if values.dtype.kind == "M":
                    clocks.append(clock(name, values))
                elif values.size == 0 or not is_numeric(values.dtype):
                    notes.append(f"'{name}' {'holds no numbers' if values.size else 'is empty'}, no channel")
                else:
                    unit = unit_in(channel.properties)
                    series.append(Series(channel.name, name, unit, as_float(values)))
                    statements += _increment(name, channel.properties)
    return Contents("TDMS", tuple(series), tuple(clocks), tuple(statements), tuple(notes))


@contextlib.contextmanager
def _told(notes: list[str]) -> Iterator[None]:
    """What the library logs to the terminal, as notes."""
    handler = logging.Handler(logging.WARNING)
    handler.emit = lambda record: notes.append(record.getMessage())  # type: ignore[method-assign]
    loggers = [logging.getLogger(name) for name in list(logging.root.manager.loggerDict) if name.startswith("nptdms")]
    before = [(logger, logger.handlers, logger.propagate) for logger in loggers]
    try:
        for logger in loggers:
            logger.handlers, logger.propagate = [handler], False
        yield
    finally:
        for logger, handlers, propagate in before:
            logger.handlers, logger.propagate = handlers, propagate


def _increment(name: str, properties: Any) -> list[RateStatement]:
    """A waveform's own rate."""
    step = properties.get("wf_increment")
    if isinstance(step, (int, float)) and math.isfinite(step) and step > 0:
        return [RateStatement("TDMS wf_increment", tidy(1 / step), name)]
    return []


def _rates(source: str, properties: Any) -> list[RateStatement]:
    """What a file's or a group's properties state."""
    found = []
    for key, value in properties.items():
        rate = rate_of(key, value) if isinstance(value, (int, float)) else None
        if rate is not None:
            found.append(RateStatement(f"property '{key}'" + (f" of '{source}'" if source else ""), rate))
    return found
