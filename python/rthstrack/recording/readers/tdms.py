"""LabVIEW TDMS."""

from __future__ import annotations

import contextlib
import logging
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from nptdms import TdmsFile

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.arrays import as_float, clock, is_numeric, unit_in
from rthstrack.recording.readers.contents import Clock, Contents, RateStatement, Series
from rthstrack.recording.readers.waveforms import Origin, increment, origin, rates, starts

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def read(path: Path) -> Contents:
    """Reads the channels of all groups, named `group/channel`; `wf_increment` states the rate."""
    series: list[Series] = []
    clocks: list[Clock] = []
    statements: list[RateStatement] = []
    notes: list[str] = []
    origins: list[Origin] = []
    with path.open("rb") as raw, _told(notes), TdmsFile.open(raw) as file:
        if file.file_status.incomplete_final_segment:
            raise RecordingError("truncated: its last segment is incomplete")
        for source, properties in [("", file.properties), *((g.name, g.properties) for g in file.groups())]:
            statements += rates(source, properties)
        for group in file.groups():
            for channel in group.channels():
                name = f"{group.name}/{channel.name}"
                values = np.asarray(channel[:])
                if values.dtype.kind == "M":
                    clocks.append(clock(name, values, len(series)))
                elif values.size == 0 or not is_numeric(values.dtype):
                    notes.append(f"'{name}' {'holds no numbers' if values.size else 'is empty'}, no channel")
                else:
                    unit = unit_in(channel.properties)
                    series.append(Series(channel.name, name, unit, as_float(values)))
                    statements += increment(name, channel.properties)
                    origins.append(origin(channel.properties))
    series = [replace(one, start_s=start) for one, start in zip(series, starts(origins), strict=True)]
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
