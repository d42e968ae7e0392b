"""Lines and tables of `evaluate`, beside what rich makes of the same."""

from __future__ import annotations

import io
import sys
from typing import TYPE_CHECKING

import pytest
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from rthstrack.cli.lines import Lines, cells

if TYPE_CHECKING:
    from collections.abc import Sequence

LONG = "measured lags target by 12 ms, which is 3 % of its period, and is 2 % too small " * 4
ROWS = [
    ("file", "目標_試験.csv, 60000 samples at 1024 Hz (time column 'Zeit für é')"),
    ("no interval", LONG),
    ("path", "/" + "a" * 150),
    ("", "one\nother"),
]


def of_rich(rows: Sequence[Sequence[str]], width: int) -> str:
    """What was printed before."""
    out = io.StringIO()
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for label, text in rows:
        table.add_row(label, Text(text))
    Console(file=out, width=width, highlight=False).print(table)
    return out.getvalue()


@pytest.mark.parametrize("width", [60, 80, 97, 200])
def test_a_table_is_laid_out_as_rich_lays_it_out(width: int, capsys: pytest.CaptureFixture[str]) -> None:
    lines = Lines()
    lines.width = width
    lines.table(ROWS)
    assert capsys.readouterr().out == of_rich(ROWS, width)


def test_no_line_of_a_table_is_wider_than_it_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    lines = Lines()
    lines.width = 80
    lines.table([("delay", LONG, LONG[:40], "x" * 90)], ("", "one", "other", "third"))
    assert max(map(cells, capsys.readouterr().out.splitlines())) == 80


@pytest.mark.parametrize("text", ["delay", "é e\u0301", "目標", "試験 한국어", "Δ ±"])
def test_places_are_counted_as_rich_counts_them(text: str) -> None:
    assert cells(text) == cell_len(text)


def test_styles_are_for_terminals_alone(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    Lines().line(("warning", "bold yellow"), ": x")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    for name in ("NO_COLOR", "WT_SESSION", "COLUMNS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("WT_SESSION", "1")
    Lines().line(("warning", "bold yellow"), ": x")
    monkeypatch.setenv("NO_COLOR", "1")
    Lines().line(("warning", "bold yellow"), ": x")
    assert capsys.readouterr().out == "warning: x\n\x1b[1;33mwarning\x1b[0m: x\nwarning: x\n"
