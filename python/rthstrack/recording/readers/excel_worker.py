"""Reads a workbook in a process of its own: `python -m rthstrack.recording.readers.excel_worker IN OUT`.

OUT is a JSON text: a list of [sheet, how many numbers it holds, its cells as lines with tabs between].
"""

from __future__ import annotations

import datetime
import json
import sys
from pathlib import Path
from typing import Any

from rthstrack.recording.readers.apart import work

_UNWANTED = str.maketrans("\t\r\n", "   ")


def main(file: str, out: str) -> int:
    """Reads FILE and writes OUT. Returns the exit status."""

    def run() -> None:
        Path(out).write_text(json.dumps(sheets(file)), encoding="utf-8")

    return work(run, Path(file).stat().st_size)


def sheets(file: str) -> list[tuple[str, int, str]]:
    """The sheets of a workbook, in its order."""
    from python_calamine import CalamineWorkbook

    found = []
    with CalamineWorkbook.from_path(file) as book:
        for sheet in book.sheets_metadata:
            if str(sheet.typ).rpartition(".")[2] != "WorkSheet":
                continue
            rows = book.get_sheet_by_name(sheet.name).to_python(skip_empty_area=False)
            n_numbers = sum(
                isinstance(cell, int | float) and not isinstance(cell, bool) for row in rows for cell in row
            )
            found.append((sheet.name, n_numbers, "\n".join("\t".join(map(_text, row)) for row in rows) + "\n"))
    return found


def _text(cell: Any) -> str:
    """A cell as data acquisition would print it: every number by its shortest form."""
    if isinstance(cell, str):
        return cell.translate(_UNWANTED)
    if isinstance(cell, bool):
        return str(int(cell))
    if isinstance(cell, datetime.timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, datetime.datetime):
        return cell.isoformat(sep=" ")
    if isinstance(cell, datetime.date | datetime.time):
        return cell.isoformat()
    return repr(cell)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2]))
