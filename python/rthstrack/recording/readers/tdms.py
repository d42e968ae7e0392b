"""LabVIEW TDMS."""

from __future__ import annotations

import contextlib
import logging
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from nptdms import TdmsFile

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.arrays import as_float, clock, is_numeric, rate_of, states_unit, tidy, unit_in
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
    origins: list[_Origin] = []
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
                    clocks.append(clock(name, values, len(series)))
                elif values.size == 0 or not is_numeric(values.dtype):
                    notes.append(f"'{name}' {'holds no numbers' if values.size else 'is empty'}, no channel")
                else:
                    unit = unit_in(channel.properties)
                    series.append(Series(channel.name, name, unit, as_float(values)))
                    statements += _increment(name, channel.properties)
                    origins.append(_origin(channel.properties))
    series = [replace(one, start_s=start) for one, start in zip(series, _starts(origins), strict=True)]
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


class _Origin(NamedTuple):
    """When a waveform began, as its properties state it: a date (ns since 1970) and an offset from it, in s."""

    date_ns: int | None
    offset_s: float | None


def _origin(properties: Any) -> _Origin:
    offset, date = properties.get("wf_start_offset"), properties.get("wf_start_time")
    number = isinstance(offset, (int, float)) and math.isfinite(offset)
    date_ns: int | None = None
    try:
        stamp = np.datetime64(date, "ns") if date is not None else None
        # LabVIEW counts from 1904; what was never set is that day.
        if stamp is not None and not np.isnat(stamp) and stamp > np.datetime64("1905-01-01"):
            date_ns = int(stamp.astype(np.int64))
    except (ValueError, TypeError):
        date_ns = None
    return _Origin(date_ns, float(offset) if number else None)


def _starts(origins: list[_Origin]) -> list[float | None]:
    """When each channel begins, in s from the earliest date; None for all where nothing tells them apart."""
    dates = [origin.date_ns for origin in origins if origin.date_ns is not None]
    # Where only some state a date, nothing is known of the others.
    first = min(dates, default=0)
    starts = [
        ((origin.date_ns - first) / 1e9 if origin.date_ns is not None else 0.0) + (origin.offset_s or 0.0)
        for origin in origins
    ]
    return list(starts) if len(set(starts)) > 1 else [None] * len(starts)


def _rates(source: str, properties: Any) -> list[RateStatement]:
    """What a file's or a group's properties state."""
    found = []
    for key, value in properties.items():
        rate = rate_of(key, value) if isinstance(value, (int, float)) else None
        if rate is not None:
            found.append(
                RateStatement(f"property '{key}'" + (f" of '{source}'" if source else ""), rate, None, states_unit(key))
            )
    return found
