"""What LabVIEW states beside the numbers of a waveform: its rate, and when it began."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rthstrack.recording.readers.arrays import rate_of, states_unit, tidy
from rthstrack.recording.readers.contents import RateStatement


def increment(name: str, properties: Any) -> list[RateStatement]:
    """A waveform's own rate."""
    step = properties.get("wf_increment")
    if isinstance(step, (int, float)) and math.isfinite(step) and step > 0:
        return [RateStatement("wf_increment", tidy(1 / step), name)]
    return []


class Origin(NamedTuple):
    """When a waveform began, as its properties state it: a date (ns since 1970) and an offset from it, in s."""

    date_ns: int | None
    offset_s: float | None


def origin(properties: Any) -> Origin:
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
    return Origin(date_ns, float(offset) if number else None)


def starts(origins: list[Origin]) -> list[float | None]:
    """When each channel begins, in s from the earliest date; None for all where nothing tells them apart."""
    dates = [one.date_ns for one in origins if one.date_ns is not None]
    # Where only some state a date, nothing is known of the others.
    first = min(dates, default=0)
    found = [
        ((one.date_ns - first) / 1e9 if one.date_ns is not None else 0.0) + (one.offset_s or 0.0) for one in origins
    ]
    return list(found) if len(set(found)) > 1 else [None] * len(found)


def rates(source: str, properties: Any) -> list[RateStatement]:
    """What a file's or a group's properties state."""
    found = []
    for key, value in properties.items():
        rate = rate_of(key, value) if isinstance(value, (int, float)) else None
        if rate is not None:
            whose = f" of '{source}'" if source else ""
            found.append(RateStatement(f"property '{key}'{whose}", rate, None, states_unit(key)))
    return found
