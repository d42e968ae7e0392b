"""The measured differences, printed as the table of README.md when the tests are done."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable

    from _pytest.terminal import TerminalReporter

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
ROWS = pytest.StashKey[list[str]]()


@pytest.fixture(scope="session")
def row(pytestconfig: pytest.Config) -> Callable[..., None]:
    """Adds a row to the table."""
    rows = pytestconfig.stash.setdefault(ROWS, [])
    return lambda *cells: rows.append(f"| {' | '.join(cells)} |")


def pytest_terminal_summary(terminalreporter: TerminalReporter, config: pytest.Config) -> None:
    rows = config.stash.get(ROWS, [])
    if rows:
        terminalreporter.section("differences from OpenSees, % of its peak")
        terminalreporter.write_line("| structure | stepping | ground motion | peak x | x(t) | peak force | force(t) |")
        terminalreporter.write_line("| --- | --- | --- | ---: | ---: | ---: | ---: |")
    for line in rows:
        terminalreporter.write_line(line)
