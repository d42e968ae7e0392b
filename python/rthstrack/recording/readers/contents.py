"""What a reader hands back: everything a file holds, before a sampling rate is settled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: Names, in lower case, of a number that says when a channel was first sampled, in s.
STARTS = ("t0", "t_0", "tstart", "t_start", "start_s", "start_time", "starttime", "x0", "wf_start_offset")


@dataclass(frozen=True, slots=True)
class Part:
    """Which part of a text file or workbook is read: a block of rows (a sheet), from 1; the first and the last line."""

    block: int | None = None
    lines: tuple[int, int] | None = None


WHOLE = Part()


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One column of numbers (n_samples,). `unit` is what the file states apart from the name.

    start_s: the time of the first sample, where the file states it for this column alone; None if it does not.
    """

    name: str
    path: str
    unit: str | None
    values: NDArray[np.float64]
    start_s: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Clock:
    """A column of dates or times of day: seconds since its first entry (n_samples,), NaN where a cell is empty.

    first_ns: its first entry, in ns from any day that all clocks of the file share; None if not known. after: how many
    series stand before it.
    """

    name: str
    path: str
    seconds: NDArray[np.float64]
    first_ns: int | None = None
    after: int = 0


@dataclass(frozen=True, slots=True)
class RateStatement:
    """A sampling rate that the file states, and where. `channel` is the path it holds for, None for the whole file.

    in_unit: whether the file says in which unit.
    """

    source: str
    rate_hz: float
    channel: str | None = None
    in_unit: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """A file's contents. `nameless` says that columns have no names, so that time cannot be recognised by one."""

    format: str
    series: tuple[Series, ...]
    clocks: tuple[Clock, ...] = ()
    statements: tuple[RateStatement, ...] = ()
    notes: tuple[str, ...] = ()
    nameless: bool = False
