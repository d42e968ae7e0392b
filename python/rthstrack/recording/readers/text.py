"""Delimited text of any form; the parsing is done by the core."""

from __future__ import annotations

import contextlib
import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rthstrack._core import read_text as core_read_text
from rthstrack.errors import RecordingError
from rthstrack.recording.names import quantities, role, words
from rthstrack.recording.readers.arrays import tidy
from rthstrack.recording.readers.contents import WHOLE, Clock, Contents, Part, RateStatement, Series
from rthstrack.said import Said
from rthstrack.units import size_in_si

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

# A number by decimal mark; a comma between groups of three digits only in `key: 1,000`.
_NUMBERS = {mark: rf"[-+]?(?:\d+(?:[{mark}]\d*)?|[{mark}]\d+)(?:[eEdD][-+]?\d+)?" for mark in ".,"}
_GROUPED = r"(?<=[:=;\s])\d{1,3}(?:,\d{3})+(?:\.\d*)?(?![\d,])"
_RATE_KEY = (
    r"(?:sampl(?:e|es|ing)|scan|acquisition|acq|daq|data|logging|log|recording)[ _-]*(?:rate|freq(?:uency)?)(?:[ _]hz)?"
    r"|(?:abtast|mess)(?:rate|frequenz)|fr[ée]quence d.[ée]chantillonnage|frecuencia de muestreo|rate_hz|fs"
)
# Not "sampling time", which may be how long the sampling took.
_STEP_KEY = (
    r"(?:sampl(?:e|es|ing)|scan)[ _-]*(?:interval|period|step)|time[ _-]*(?:step|interval|increment)"
    r"|abtastintervall|delta[ _]?[tx]|dt"
)


def _statement(key: str, mark: str) -> re.Pattern[str]:
    """The words, perhaps a unit in brackets, a separator, a number that is no date or time of day, perhaps a unit.

    A word behind the number that is followed by more is the next key, and no unit; in the next cell only a known unit
    is one.
    """
    number = _NUMBERS[mark] if mark == "," else f"{_GROUPED}|{_NUMBERS[mark]}"
    return re.compile(
        rf"(?<![a-zäöüé_])(?P<key>{key})\s*(?:[\[(]\s*(?P<unit>[^\])]{{1,12}})[\])])?\s*[:=,;\t ]\s*[\"']?\s*"
        rf"(?P<value>{number})(?![\d]|[.:/-]\d)(?:[ ]*(?P<behind>[a-zµ1][a-zµ/1]*)(?!\s*[:=\w])"
        r"|(?=\s*[,;\t]\s*(?P<cell>[a-zµ1][a-zµ/1]*)(?![\w/])))?",
        re.IGNORECASE,
    )


def read(path: Path, part: Part = WHOLE) -> Contents:
    """Reads a text file: comma, semicolon, tab, bar or blanks between columns, with any preamble."""
    content = path.read_bytes()
    found = contents_of(content, part)
    apart = [one.path for one in found.series if _holds_thousands(one.values)]
    if not apart:
        return found
    mark = "," if "decimal comma" in found.format else "."
    group = rb"(?<![\d.,])([-+]?[1-9]\d{0,2})" + re.escape(mark).encode() + rb"(?=\d{3}(?![\d.,]))"
    joined = contents_of(re.sub(group, rb"\1", content), part)
    whole = [
        np.array_equal(one.values, np.rint(one.values), equal_nan=True) for one in joined.series if one.path in apart
    ]
    # One with a decimal or two is none of whole thousands.
    if len(whole) != len(apart) or not all(whole):
        return found
    words = f"'{apart[0]}' has whole numbers and others of three decimals: '{mark}' was taken to set thousands apart"
    return replace(joined, notes=(*joined.notes, Said(words, "thousands")))


def _holds_thousands(values: NDArray[np.float64]) -> bool:
    """Whether numbers such as 567 and 1.234, and no 0.567 or 1234, show that the mark parts thousands."""
    for some in (values[:_LOOKED_AT], values):
        some = some[np.isfinite(some)]
        size = np.abs(some)
        odd = size != np.rint(size)
        n_odd = int(np.count_nonzero(odd))
        if not n_odd or size.max() >= 1000 or size[odd].min() < 1:
            return False
    thousandths = 1e3 * size[odd]
    fine = np.abs(thousandths / 10 - np.rint(thousandths / 10)) > 1e-3
    return bool(
        len(some) >= _LEAST
        and np.abs(thousandths - np.rint(thousandths)).max() < 1e-6
        and 2 * np.count_nonzero(fine) > n_odd
        and np.count_nonzero(~odd & (size >= 1)) > len(some) // 10
        and n_odd > len(some) // 20
    )


def contents_of(content: bytes, part: Part = WHOLE) -> Contents:
    """The contents of a text, given as its bytes."""
    try:
        table = core_read_text(content, part.block, part.lines)
    except ValueError as error:
        words, line = error.args
        if line is None:
            raise RecordingError(words) from None
        raise RecordingError(
            words, code="broken_row", values=(line,), advice="or read only lines that are whole: {lines}"
        ) from None
    encoding = table["encoding"]
    names = [name for _, name, *_ in table["columns"]]
    if encoding == "Latin-1" and (found := _code_page([name for name in names if name])):
        encoding = found
        names = [name and name.encode("latin-1").decode(found) for name in names]
    series: list[Series] = []
    clocks: list[Clock] = []
    notes: list[str] = [Said(*note) for note in table["notes"]]
    nameless = True
    for (index, _, unit, kind, values), name in zip(table["columns"], names, strict=True):
        if unit and encoding in _CODE_PAGES:
            unit = unit.encode("latin-1").decode(encoding, "replace")
        nameless &= name is None
        label = f"column {index}" if name is None else name
        if kind == "numbers":
            series.append(Series(label, label, unit, values))
        elif kind == "text":
            notes.append(f"'{label}' {f'holds text in {values} lines' if values else 'is empty'}, no channel")
        else:
            first = next((int(one) for one in values if one != np.iinfo(np.int64).min), None)
            seconds = seconds_since_first(values, dated=kind == "dates")
            clocks.append(Clock(label, label, seconds, first, len(series)))
    statements = rate_statements(table["preamble"], notes, decimal_comma=table["decimal_comma"])
    waveforms = _waveforms(table["preamble"], decimal_comma=table["decimal_comma"])
    if waveforms is not None:
        series = _own_starts(series, waveforms)
        statements = _of_channels(statements, series, waveforms)
    form = f"text, {table['delimiter']} between columns" if len(table["columns"]) > 1 else "text, one column"
    if table["decimal_comma"]:
        form += ", decimal comma"
    if encoding != "UTF-8":
        form += f", {encoding}"
    return Contents(form, tuple(series), tuple(clocks), tuple(statements), tuple(notes), nameless)


# Of fewer numbers nothing is concluded; so many show most columns that hold no thousands.
_LEAST, _LOOKED_AT = 50, 1000
# Older ways to spell names outside western Europe.
_CODE_PAGES = ("GB18030", "Shift-JIS", "EUC-KR", "Windows-1251", "Big5")


def _code_page(names: list[str]) -> str | None:
    """In which code page the names, read as Latin-1, hold the most words that are known; None where in no other."""
    if all(name.isascii() for name in names):
        return None
    known: dict[str | None, int] = {None: sum(map(_n_known, names))}
    for page in _CODE_PAGES:
        with contextlib.suppress(UnicodeDecodeError):
            known[page] = sum(_n_known(name.encode("latin-1").decode(page)) for name in names)
    return max(known, key=known.__getitem__)


def _n_known(name: str) -> int:
    found = words(name)
    return (role(found).name is not None) + len(quantities(found))


class _Waveforms(NamedTuple):
    """What LabVIEW's header says of channels: which series is the first of them, and each how many, and X0 in s."""

    first: int
    step: int
    starts: list[float]


def _waveforms(preamble: list[str], *, decimal_comma: bool) -> _Waveforms | None:
    """None where the text is not LabVIEW's, or its header says of no channel when it begins."""
    cells = {line.split(mark)[0].strip(): line.split(mark) for line in preamble for mark in "\t,;" if mark in line}
    kind = [cell.strip().lower() for cell in cells.get("X_Columns", [])][1:2]
    first, step = {"no": (0, 1), "one": (1, 1), "multi": (1, 2)}.get("".join(kind), (0, 0))
    texts = [cell.strip().replace(",", ".") if decimal_comma else cell.strip() for cell in cells.get("X0", [])[1:]]
    starts = [_start(text) for text in texts if text]
    times = [_time_of_day(cell) for cell in cells.get("Time", [])[1:] if cell.strip()]
    if len(times) == len(starts) and not any(map(math.isnan, times)):
        starts = [start + time - min(times) for start, time in zip(starts, times, strict=True)]
    if not step or any(map(math.isnan, starts)):
        return None
    return _Waveforms(first, step, starts)


def _own_starts(series: list[Series], waveforms: _Waveforms) -> list[Series]:
    """The series with the begin of each channel, where channels differ in it."""
    first, step, starts = waveforms
    if len(set(starts)) < 2:
        return series
    of = {first + step * i: start for i, start in enumerate(starts)}
    return [replace(one, start_s=of.get(i)) for i, one in enumerate(series)]


def _of_channels(statements: list[RateStatement], series: list[Series], waveforms: _Waveforms) -> list[RateStatement]:
    """Statements that hold for one channel each, with that channel's path in place of its number."""
    paths = {str(i): one.path for i, one in enumerate(series[waveforms.first :: waveforms.step])}
    return [
        one if one.channel is None else replace(one, channel=paths[one.channel])
        for one in statements
        if one.channel is None or one.channel in paths
    ]


def _start(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _time_of_day(text: str) -> float:
    found = re.fullmatch(r"\s*(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)\s*", text)
    return 3600 * int(found[1]) + 60 * int(found[2]) + float(found[3].replace(",", ".")) if found else math.nan


def seconds_since_first(stamps: NDArray[np.int64], *, dated: bool) -> NDArray[np.float64]:
    """Nanoseconds (n_samples,), the least int64 for none, as seconds since the first entry.

    A time of day without a date that falls by more than half a day has passed midnight.
    """
    missing = stamps == np.iinfo(np.int64).min
    first = stamps[~missing][:1]
    ns = np.where(missing, 0, stamps - first) if first.size else np.zeros_like(stamps)
    if not dated and not missing.any():
        day = 86_400 * 10**9
        ns = ns + day * np.cumsum(np.diff(ns, prepend=ns[:1]) < -day // 2)
    # A quotient is rounded once, so that 66 ms become exactly float("0.066").
    seconds: NDArray[np.float64] = ns / 1e9
    seconds[missing] = math.nan
    return seconds


def rate_statements(preamble: list[str], notes: list[str], *, decimal_comma: bool = False) -> list[RateStatement]:
    """Sampling rates and intervals stated in lines of text; several values on a line hold for one channel each."""
    mark = "," if decimal_comma else "."
    patterns = ((_statement(_RATE_KEY, mark), "frequency"), (_statement(_STEP_KEY, mark), "time"))
    over_time = not any(re.match(r"x_dimension\b(?!.*time)", line, re.IGNORECASE) for line in preamble)
    statements: list[RateStatement] = []
    for pattern, measures in patterns:
        for line in preamble:
            for found in pattern.finditer(line):
                key = found["key"].strip()
                unit, cell = (found["unit"] or found["behind"] or "").strip(), found["cell"]
                factor = size_in_si(unit, measures) if unit else size_in_si(cell, measures) or 1.0
                # A unit of another kind (mm/s) makes it a statement of something else.
                if factor is None or (key.lower().startswith("delta_x") and not over_time):
                    continue
                others = re.split(r"[\t;]" if decimal_comma else r"[\t;,]", line[found.end() :])[1:]
                texts = [found["value"], *(text for text in others if re.fullmatch(_NUMBERS[mark], text.strip()))]
                for at, text in enumerate(texts):
                    value = _value(text, decimal_comma=decimal_comma)
                    if not (math.isfinite(value) and value > 0):
                        notes.append(f"header '{key}' states {text.strip()}, which was not used")
                        continue
                    rate = value * factor if measures == "frequency" else 1 / (value * factor)
                    statements.append(
                        RateStatement(
                            f"header '{key}'",
                            tidy(rate),
                            str(at) if len(texts) > 1 else None,
                            bool(unit or (cell and size_in_si(cell, measures)) or key.lower().endswith("hz")),
                        )
                    )
    return _unique(statements)


def _value(text: str, *, decimal_comma: bool) -> float:
    plain = text.strip().lower().replace("d", "e")
    return float(plain.replace(",", ".") if decimal_comma and plain.count(",") == 1 else plain.replace(",", ""))


def _unique(statements: list[RateStatement]) -> list[RateStatement]:
    """Statements that say the same of all channels, once."""
    by_source: dict[str, list[RateStatement]] = {}
    for statement in statements:
        by_source.setdefault(statement.source, []).append(statement)
    kept: list[RateStatement] = []
    for group in by_source.values():
        rates = {statement.rate_hz for statement in group}
        kept += [replace(group[0], channel=None)] if len(rates) == 1 else group
    return kept
