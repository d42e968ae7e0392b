"""Workbooks: a sheet is read as the text that data acquisition would have written."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from rthstrack.errors import RecordingError
from rthstrack.recording import read_recording
from rthstrack.said import Said
from workbooks import Cell, write_workbook

if TYPE_CHECKING:
    from pathlib import Path

T = [i / 50 for i in range(60)]
TARGET = [float(np.sin(3 * t)) for t in T]
ROWS: list[list[Cell]] = [[t, x, 0.9 * x] for t, x in zip(T, TARGET, strict=True)]


def test_a_sheet_is_read_with_names_units_and_every_bit(tmp_path: Path) -> None:
    head: list[list[Cell]] = [["Test of a damper"], [], ["Time", "Target", "Weg\tist"], ["sec", "mm", "furlong"]]
    write_workbook(tmp_path / "a.xlsx", {"Run 1": head + ROWS})
    recording = read_recording(tmp_path / "a.xlsx")
    assert (recording.format, recording.rate_hz, recording.notes) == ("Excel, sheet 'Run 1'", 50.0, ())
    assert [(c.name, c.unit) for c in recording.channels] == [("Time", "sec"), ("Target", "mm"), ("Weg ist", "furlong")]
    assert recording["Target"].values.tolist() == TARGET


def test_the_sheet_with_the_most_numbers_is_read_and_another_can_be_chosen(tmp_path: Path) -> None:
    head: list[list[Cell]] = [["time", "target", "measured"]]
    path = tmp_path / "a.xlsx"
    write_workbook(path, {"Notes": [["by hand"]], "Short": head + ROWS[:20], "Long": head + ROWS})
    recording = read_recording(path)
    assert (recording.format, len(recording["target"].values)) == ("Excel, sheet 'Long'", 60)
    assert [(n.code, n.values) for n in recording.notes if isinstance(n, Said)] == [("blocks", (2, 2))]
    assert len(read_recording(path, block=1)["target"].values) == 20
    assert read_recording(path, lines=(11, 40))["time"].values[0] == T[9]
    with pytest.raises(RecordingError, match="expected 1 to 2"):
        read_recording(path, block=3)


def test_empty_cells_footers_and_empty_workbooks(tmp_path: Path) -> None:
    rows = [*ROWS[:5], [T[5], None, 1.0], *ROWS[6:], [None], ["Max", 1.0, 0.9]]
    write_workbook(tmp_path / "a.xlsx", {"Run": [["time", "target", "measured"], *rows]})
    recording = read_recording(tmp_path / "a.xlsx")
    assert np.flatnonzero(np.isnan(recording["target"].values)).tolist() == [5]
    assert [n.code for n in recording.notes if isinstance(n, Said)] == ["left_out"]
    write_workbook(tmp_path / "b.xlsx", {"Run": [["nothing"]]})
    with pytest.raises(RecordingError, match="none of which holds numbers"):
        read_recording(tmp_path / "b.xlsx")


def test_a_sheet_that_claims_every_cell_takes_no_memory_here(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    write_workbook(path, {"Run": [["time", "x"], [0.0, 1.0]]})
    import zipfile

    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    sheet = members["xl/worksheets/sheet1.xml"].replace(
        b"</row></sheetData>", b'</row><row r="1048576"><c r="XFD1048576"><v>1</v></c></row></sheetData>'
    )
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in {**members, "xl/worksheets/sheet1.xml": sheet}.items():
            archive.writestr(name, content)
    with pytest.raises(RecordingError, match="the file is damaged, or no Excel file"):
        read_recording(path)
