"""PEER strong-motion files (.AT2): a header that states unit, number of values and time step, then one acceleration."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.arrays import tidy
from rthstrack.recording.readers.contents import Contents, RateStatement, Series
from rthstrack.units import size_in_si

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

STANDARD_GRAVITY_M_S2 = 9.80665

# The header has four lines; a file may have one or two of its owner's before them.
_HEADER_LINES = 10
_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eEdD][-+]?\d+)?"
_SIZES = re.compile(r"\bNPTS\b.*\bDT\b|\bDT\b.*\bNPTS\b", re.IGNORECASE)
_QUANTITY = re.compile(r"\bUNITS?\b|\b(?:ACCEL|VELOC|DISPL)", re.IGNORECASE)
_NAMED_SIZES = re.compile(
    rf"\s*NPTS\s*[=:]\s*(?P<n>\d{{1,9}})\s*[,;]?\s*DT\s*[=:]\s*(?P<dt>{_NUMBER})\s*(?P<unit>[a-z]*)", re.IGNORECASE
)
_STEP_FIRST = re.compile(
    rf"\s*DT\s*[=:]\s*(?P<dt>{_NUMBER})\s*(?P<unit>[a-z]*?)\s*[,;]?\s*NPTS\s*[=:]\s*(?P<n>\d{{1,9}})", re.IGNORECASE
)
_SIZES_NAMED_BEHIND = re.compile(rf"\s*(?P<n>\d{{1,9}})[\s,;]+(?P<dt>{_NUMBER})[\s,;]+NPTS\s*,?\s*DT", re.IGNORECASE)


def acceleration_unit(text: str) -> tuple[str, float] | None:
    """A unit of acceleration in its usual spelling, and how many m/s2 are in one; None for anything else.

    Spellings such as CM/SEC/SEC, cm/sec^2, m/s**2, m/s² and [m/s2] are understood.
    """
    plain = re.sub(r"[\s\[\]()^*]", "", text).lower().replace("²", "2").replace("sec", "s").replace("gals", "gal")
    size = size_in_si(text, "acceleration")
    return (re.sub(r"/s/s$", "/s2", plain), size) if size else None


def recognised(path: Path) -> bool:
    """Whether a text file is one of PEER's: named .at2, or with a line of NPTS and DT below one of quantity or unit."""
    if path.suffix.lower() == ".at2":
        return True
    with path.open("rb") as opened:
        lines = opened.read(4096).decode("latin-1").splitlines()[:_HEADER_LINES]
    at = next((i for i, line in enumerate(lines) if _SIZES.search(line)), 0)
    return any(_QUANTITY.search(line) for line in lines[:at])


def read(path: Path) -> Contents:
    """Reads an AT2 file: header up to the line of NPTS and DT, then exactly NPTS values, any number to a line."""
    lines = decoded(path.read_bytes()).splitlines()
    at = next((i for i, line in enumerate(lines[:_HEADER_LINES]) if _SIZES.search(line)), None)
    if at is None:
        raise RecordingError(
            f"a PEER AT2 file, but its first {_HEADER_LINES} lines state no number of values and time step; "
            "expected a line such as 'NPTS=  2999, DT=   .0100 SEC'"
        )
    n, step_s = _sizes(lines[at], at + 1)
    unit = _unit(lines[:at])
    values = numbers(lines, at + 1)
    if len(values) != n:
        raise RecordingError(
            f"expected {n} values, as line {at + 1} states ('{lines[at].strip()}'), found {len(values)}; "
            + ("the file is truncated or damaged" if len(values) < n else "NPTS is wrong or the file is damaged")
        )
    notes = tuple(f"header: {' '.join(line.split())}" for line in lines[:at] if line.strip())
    statement = RateStatement("header 'DT'", tidy(1 / step_s))
    return Contents("PEER AT2", (Series("acceleration", "acceleration", unit, values),), (), (statement,), notes)


def decoded(content: bytes) -> str:
    """Text in UTF-8, or else in Latin-1; a DOS end-of-file mark is no part of it."""
    content = content.removesuffix(b"\x1a")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def numbers(lines: list[str], start: int) -> NDArray[np.float64]:
    """The numbers of the lines from `start` on (counted from 0), in reading order, between blanks, commas, semicolons.

    Raises RecordingError naming the line of the first text that is no finite number.
    """
    values: list[float] = []
    number = re.compile(_NUMBER)
    for at in range(start, len(lines)):
        for text in re.split(r"[\s,;]+", lines[at].strip(" \t,;")):
            if not text:
                continue
            value = float(re.sub("[dD]", "e", text)) if number.fullmatch(text) else math.nan
            if not math.isfinite(value):
                raise RecordingError(f"line {at + 1}: expected numbers, found {text[:40]!r}; the file is damaged")
            values.append(value)
    return np.array(values, dtype=np.float64)


def _sizes(line: str, at: int) -> tuple[int, float]:
    """Number of values and time step in seconds, from `NPTS= n, DT= s SEC` or `n s NPTS, DT`."""
    found = _NAMED_SIZES.match(line) or _STEP_FIRST.match(line) or _SIZES_NAMED_BEHIND.match(line)
    unit = (found.groupdict().get("unit") or "s").lower() if found else ""
    n, step_s = (int(found["n"]), float(re.sub("[dD]", "e", found["dt"]))) if found else (0, math.nan)
    if unit not in ("s", "sec", "secs", "second", "seconds") or n < 2 or not 1e-9 < step_s < 1e9:
        raise RecordingError(
            f"line {at}: expected at least 2 values and a time step in seconds, as 'NPTS=  2999, DT=   .0100 SEC', "
            f"found '{line.strip()[:80]}'"
        )
    return n, step_s


def _unit(header: list[str]) -> str:
    """The unit of acceleration that the header's units line states."""
    line = next((line.strip() for line in reversed(header) if re.search(r"\bUNITS?\b", line, re.IGNORECASE)), None)
    expected = "expected 'ACCELERATION TIME SERIES IN UNITS OF G' (or cm/s2, m/s2, gal)"
    if line is None:
        raise RecordingError(f"the header has no units line; {expected}")
    if re.search(r"VELOCITY|DISPLACEMENT", line, re.IGNORECASE):
        raise RecordingError(
            f"the units line is '{line[:80]}': no acceleration; {expected}; give the record's .AT2 file"
        )
    stated = re.search(r".*\bUNITS?\b(?:\s+OF\b|\s*[:=])?\s*(.*)", line, re.IGNORECASE)
    # Behind the unit stands the processing: 'UNITS OF G. FILTER POINTS: ...', 'UNITS OF g (9.81)'.
    unit = acceleration_unit(re.split(r"[.,;]|\s{2,}|(?<=\S)\s*\(", stated[1])[0]) if stated else None
    if unit is None:
        raise RecordingError(f"the units line is '{line[:80]}'; {expected}")
    return unit[0]
