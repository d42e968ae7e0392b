"""The table of many files that `rthstrack evaluate` prints: worst first, whole names, each remark once."""

from __future__ import annotations

import dataclasses
import math
import os
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rthstrack.said import coded
from rthstrack.verdict.display import shortened, with_interval
from rthstrack.verdict.limits import CONCLUSIONS, reasons
from rthstrack.verdict.order import HAPPENED, in_order

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rthstrack.cli.lines import Lines
    from rthstrack.evaluation.tracking import Tracking
    from rthstrack.verdict.assessment import Assessment

_OUTCOMES = {None: "", "passed": "pass", "exceeded": "FAIL", "not_judged": "not judged"}
_STYLES = {None: "", "passed": "green", "exceeded": "bold red", "not_judged": "bold yellow"}
# A name is cut to no less than this.
_SHORTEST_NAME = 16
# So many files are named beside a remark.
_NAMED = 3


@dataclass(frozen=True, slots=True)
class _Column:
    """`rank`: the order in which columns go where there is no room; 0 stays."""

    name: str
    rank: int
    text: Callable[[Assessment], str]


def _amplitude(t: Tracking) -> str:
    return _known(float(t.amplitude), ".4f")


def _delay(t: Tracking) -> str:
    return _known(1e3 * float(t.delay_s), ".3f")


def _known(value: float, layout: str) -> str:
    return f"{value:{layout}}" if math.isfinite(value) else "-"


def _delay_interval(t: Tracking) -> str:
    value, interval = 1e3 * float(t.delay_s), [1e3 * float(end) for end in t.delay_interval_s]
    _, opened, rest = with_interval(value, interval).partition(" (")
    return rest.removesuffix(")") if opened else "-"


_WORST_WINDOW = _Column("worst window", 2, lambda a: _known(1e3 * a.largest_delay_s, ".3f"))
_COLUMNS = (
    _Column("amplitude", 0, lambda a: _amplitude(a.tracking)),
    _Column("delay ms", 0, lambda a: _delay(a.tracking)),
    _Column("95 % interval", 1, lambda a: _delay_interval(a.tracking)),
    _WORST_WINDOW,
    _Column("rms error %", 0, lambda a: f"{a.indices.rms_error_percent:.3g}"),
    _Column("at Hz", 4, lambda a: _known(float(a.tracking.equivalent_frequency_hz), ".3g")),
    _Column("target, measured", 5, lambda a: f"{a.target_name}, {a.measured_name}"),
    _Column("trusted ms", 3, lambda a: "-" if a.tracking is a.trusted else _delay(a.trusted)),
    _Column("published ms", 6, lambda a: "-" if a.tracking is a.published else _delay(a.published)),
)


def print_many(out: Lines, assessments: Sequence[Assessment], n_failed: int, sort: str) -> None:
    """Prints the table, then what is odd, each kind once, and one closing line where limits were given."""
    found = in_order(assessments, sort)
    names = _names(found)
    columns = [column for column in _COLUMNS if any(column.text(a) != "-" for a in found)]
    if any(a.outcome for a in found):
        columns.append(_Column("", 0, lambda a: _OUTCOMES[a.outcome]))
    if any(gate.state == "exceeded" != gate.whole.state for a in found for gate in a.gates):
        # What failed by a window alone is not understood without it.
        columns = [dataclasses.replace(c, rank=0) if c is _WORST_WINDOW else c for c in columns]
    cells = {column: [column.text(a) for a in found] for column in columns}
    widths = {column: max(len(column.name), *map(len, cells[column])) for column in columns}
    longest = max(map(len, (*names, "file")))

    def width(shown: Sequence[_Column]) -> int:
        return sum(widths[column] + 2 for column in shown)

    while width(columns) + min(longest, _SHORTEST_NAME) > out.width or (
        width(columns) + longest > out.width and max(column.rank for column in columns)
    ):
        columns.remove(max(columns, key=lambda column: column.rank))
    room = max(_SHORTEST_NAME, min(longest, out.width - width(columns)))
    head = "  ".join([f"{'file':<{room}}", *(f"{column.name:>{widths[column]}}" for column in columns)])
    out.line((head.rstrip(), "bold"))
    for i, (a, name) in enumerate(zip(found, names, strict=True)):
        line = [f"{shortened(name, room):<{room}}", *(f"{cells[column][i]:>{widths[column]}}" for column in columns)]
        out.line(("  ".join(line).rstrip(), _STYLES[a.outcome]))
    _print_remarks(out, found, names)
    print_closing(out, found, names, n_failed)


def print_closing(out: Lines, found: Sequence[Assessment], names: Sequence[str], n_failed: int) -> None:
    """Prints what was asked and found of all of them in one line, where limits were given."""
    if (closing := _closing(found, names, n_failed)) is not None:
        out.line((closing[0], _STYLES[closing[1]]))


def _names(assessments: Sequence[Assessment]) -> list[str]:
    """The files without the folder that all are in; with the actuator where a file has several."""
    files = [a.file for a in assessments]
    common = os.path.commonpath(files) if len({os.path.dirname(file) for file in files}) > 1 and _alike(files) else None
    short = [os.path.relpath(file, common) if common else os.path.basename(file) for file in files]
    actuators: dict[str, set[int]] = {}
    for a in assessments:
        actuators.setdefault(a.file, set()).add(a.actuator)
    named = []
    for a, name in zip(assessments, short, strict=True):
        actuator = f" #{a.actuator_number} {a.actuator_name}" if len(actuators[a.file]) > 1 else ""
        part = "" if a.part == "whole" else f" {a.part}"
        named.append(f"{name}{actuator}{part}")
    return named


def _alike(files: Sequence[str]) -> bool:
    """Whether they can have a folder in common: all from the root, or none."""
    return len({os.path.isabs(file) for file in files}) == 1


def _print_remarks(out: Lines, found: Sequence[Assessment], names: Sequence[str]) -> None:
    """Each kind of warning once, with the files it is of and the words of the first."""
    kinds: dict[str, list[tuple[str, str]]] = {}
    for a, name in zip(found, names, strict=True):
        for warning in a.warnings:
            kinds.setdefault(coded(warning).code, []).append((name, str(warning)))
    for entries in kinds.values():
        of = list(dict.fromkeys(name for name, _ in entries))
        shown = ", ".join(of) if len(of) <= _NAMED else f"{len(of)} of {len(set(names))}, first {of[0]}"
        out.line((f"{shown}: {entries[0][1]}", "yellow"))


def _closing(found: Sequence[Assessment], names: Sequence[str], n_failed: int) -> tuple[str, str] | None:
    """What was asked and found of all of them, in one line, and its outcome."""
    counted = Counter(a.outcome for a in found if a.outcome is not None)
    if not counted:
        return None
    state = next(one for one in HAPPENED if counted[one])
    n = sum(counted.values())
    worst, name = next((a, name) for a, name in zip(found, names, strict=True) if a.outcome == state)
    parts = [f"{counted[one]} of {n + n_failed} {words}" for one, (_, words) in HAPPENED.items() if counted[one]]
    if n_failed:
        parts.insert(0, f"{n_failed} of {n + n_failed} could not be read")
        if state == "passed":
            state = "not_judged"
    return f"{CONCLUSIONS[state]}: {', '.join(parts)}; {name}: {reasons(worst.gates)}", state
