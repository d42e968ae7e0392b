"""What `rthstrack evaluate --csv` writes: a row a result, a window, a frequency."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING, Any

from rthstrack.evaluation.results import NUMBERS, end_names, is_interval, json_ready
from rthstrack.verdict.entry import OF_TRUSTED, result_entry

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from rthstrack.verdict.assessment import Assessment

_REASON = ("reason", "reason_code", "reason_values")
_READING = (*NUMBERS[:4], "valid", *(name for name in NUMBERS[4:] if name not in OF_TRUSTED), *_REASON)
_BESIDE = ("amplitude", "delay_s", "valid", "amplitude_interval", "delay_interval_s", *_REASON)
# Tables of their own.
_TABLES = ("moving", "frequency_response")


def write_tables(path: Path, assessments: Sequence[Assessment], *, moving: bool) -> list[str]:
    """Writes the results, beside them curves over frequency and, if asked for, the windows; says what was written."""
    frequency, windows = (path.with_stem(f"{path.stem}_{part}") for part in ("frequency", "moving"))
    _write(path, [_row(a) for a in assessments])
    notes = [f"results written to {path}"]
    if any(a.response is not None for a in assessments):
        _write(frequency, [row for a in assessments for row in _frequencies(a)])
        notes.append(f"gain and delay over frequency written to {frequency}")
    if moving:
        _write(windows, [row for a in assessments for row in _readings(a)])
        notes.append(f"readings written to {windows}")
    return notes


def _row(a: Assessment) -> dict[str, Any]:
    entry = {name: value for name, value in result_entry(a).items() if name not in _TABLES}
    for gate in entry.pop("gates"):
        name = gate.pop("name")
        gate["over_limit_s"] = "; ".join(f"{start:.6g} to {end:.6g}" for start, end in gate["over_limit_s"])
        entry[f"gate.{name}"] = gate
    return _flat(entry)


def _flat(entry: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    row: dict[str, Any] = {}
    for key, value in entry.items():
        if isinstance(value, dict):
            row |= _flat(value, f"{before}{key}.")
        elif is_interval(key):
            row |= {before + end: one for end, one in zip(end_names(key), value or ("", ""), strict=True)}
        elif key == "warning_codes":
            row[before + key] = "; ".join(warning["code"] for warning in value)
        else:
            row[before + key] = "; ".join(map(str, value)) if isinstance(value, list | tuple) else value
    return row


def _about(a: Assessment) -> dict[str, Any]:
    return {
        "file": a.file,
        "actuator": a.actuator,
        "actuator_number": a.actuator_number,
        "actuator_name": a.actuator_name,
        "part": a.part,
        "target": a.target_name,
        "measured": a.measured_name,
    }


def _frequencies(a: Assessment) -> Iterator[dict[str, Any]]:
    if a.response is None:
        return
    columns = a.response.columns()
    for i in range(a.response.frequency_hz.size):
        yield _about(a) | {name: json_ready(column[i]) for name, column in columns.items()}


def _readings(a: Assessment) -> Iterator[dict[str, Any]]:
    if a.moving is None:
        return
    others = {"trusted": a.trusted_moving, "published": a.published_moving}
    for i, time_s in enumerate(a.moving.time_s):
        row = {name: json_ready(getattr(a.moving, name)[i]) for name in _READING}
        for which, moving in others.items():
            known = moving is not None
            row |= {f"{which}_{name}": json_ready(getattr(moving, name)[i]) if known else None for name in _BESIDE}
        for name, value in row.items():
            # No interval is no pair of missing ends.
            if is_interval(name) and value is not None and None in value:
                row[name] = None
        yield _flat(_about(a) | {"time_s": a.start_s + float(time_s)} | row)


def _write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    fields = list(dict.fromkeys(key for row in rows for key in row))
    with open(path, "w", newline="", encoding="utf-8") as out:
        writer = csv.DictWriter(out, fields, restval="")
        writer.writeheader()
        writer.writerows(rows)
