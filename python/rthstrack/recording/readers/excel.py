"""Workbooks of Excel and its like (xlsx, xlsm, xlsb, xls, ods): a sheet is read as text with tabs between the cells."""

from __future__ import annotations

import json
import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rthstrack.errors import RecordingError
from rthstrack.recording.readers import text
from rthstrack.recording.readers.apart import read_apart
from rthstrack.recording.readers.contents import WHOLE, Part
from rthstrack.said import Said

if TYPE_CHECKING:
    from rthstrack.recording.readers.contents import Contents

_MEMBERS = {"xl/workbook.xml", "xl/workbook.bin"}
_ODS = b"application/vnd.oasis.opendocument.spreadsheet"


def recognised(path: Path) -> bool:
    """Whether a zip archive is a workbook."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = set(archive.namelist())
            return bool(_MEMBERS & names) or ("mimetype" in names and archive.read("mimetype").startswith(_ODS))
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError, RuntimeError):
        return False


def read(path: Path, part: Part = WHOLE) -> Contents:
    """Reads one sheet: the one with the most numbers, or number `block` of those that hold any."""
    with tempfile.TemporaryDirectory(prefix="rthstrack-") as folder:
        out = Path(folder, "sheets.json")
        read_apart("excel_worker", path, str(out), "Excel")
        sheets = json.loads(out.read_text(encoding="utf-8"))
    filled = [(name, n_numbers, cells) for name, n_numbers, cells in sheets if n_numbers]
    if not filled:
        raise RecordingError(f"a workbook of {len(sheets)} sheet(s), none of which holds numbers")
    if part.block is not None and part.block > len(filled):
        raise RecordingError(f"no such sheet; expected 1 to {len(filled)}", code="no_block")
    at = part.block - 1 if part.block else max(range(len(filled)), key=lambda i: (filled[i][1], -i))
    name, _, cells = filled[at]
    found = text.contents_of(cells.encode(), Part(lines=part.lines))
    notes = list(found.notes)
    if len(filled) > 1:
        listed = ", ".join(f"{i + 1} '{name}'" for i, (name, *_) in enumerate(filled[:8]))
        listed += f" and {len(filled) - 8} more" if len(filled) > 8 else ""
        how = "as asked" if part.block else "which holds the most numbers; --block N reads another"
        words = f"the workbook has {len(filled)} sheets with numbers, {listed}: sheet {at + 1} was read, {how}"
        notes.append(Said(words, "blocks", (len(filled), at + 1)))
    return replace(found, format=f"Excel, sheet '{name}'", notes=tuple(notes))
