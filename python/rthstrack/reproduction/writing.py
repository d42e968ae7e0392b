"""The folder that `reproduce` writes: figures, tables, CSV of everything drawn, and the claims."""

from __future__ import annotations

import csv
import math
import platform
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy

from rthstrack._core import __version__
from rthstrack.errors import RecordingError, SettingError
from rthstrack.plots.style import _style
from rthstrack.reproduction import figures, paper, tables
from rthstrack.reproduction.claims import MEANINGS, TERMS, WORDS, Claim, judge
from rthstrack.reproduction.far_field import WINDOWS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rthstrack.reproduction.results import Results

_CLAIM_COLUMNS = ("section", "statement", "printed", "ours", "verdict", "tolerance", "window", "why")


def prepare(out: Path) -> None:
    """Makes the folder, before anything is computed. Raises SettingError."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SettingError(f"{out}: cannot make this folder ({error.strerror}); name another") from None


def write(r: Results, out: Path, progress: Callable[[int, int], object]) -> None:
    """Writes everything. Files of the same names are overwritten, no others. Raises RecordingError."""
    total = len(figures.FIGURES) + len(figures.SUPPLEMENTS) + len(tables.TABLES) + 1
    try:
        for done, plate in enumerate(figures.plates(r), start=1):
            _save(figures.draw(plate), out / plate.name)
            _write_csv(out / f"{plate.name}.csv", figures.rows(plate))
            progress(done, total)
        for done, name in enumerate(tables.TABLES, start=total - len(tables.TABLES)):
            _save(tables.draw(r, name), out / name)
            _write_csv(out / f"{name}.csv", tables.rows(r, name))
            progress(done, total)
        claims = judge(r)
        _write_csv(
            out / "claims.csv", [_CLAIM_COLUMNS, *([getattr(c, name) for name in _CLAIM_COLUMNS] for c in claims)]
        )
        (out / "claims.md").write_text(claims_text(r, claims), encoding="utf-8")
        progress(total, total)
    except OSError as error:
        raise RecordingError(f"cannot write {error.filename}: {error.strerror}") from None


def claims_text(r: Results, claims: Sequence[Claim]) -> str:
    """The claims as Markdown: what was used, what words mean, and a table."""
    count = Counter(claim.verdict for claim in claims)
    lines = [
        "# Statements of the paper, one by one",
        "",
        f"{paper.CITATION}. {len(claims)} statements:",
        "",
        "| verdict | | meaning |",
        "| --- | --- | --- |",
        *(f"| `{verdict}` | {count[verdict]} | {meaning} |" for verdict, meaning in MEANINGS.items()),
        "",
        _by_way(claims),
        "",
        f"rthstrack {__version__}, Python {platform.python_version()}, NumPy {np.__version__}, SciPy "
        f"{scipy.__version__}, {platform.machine()}; {r.seconds:.0f} s for tests, readings and timing.",
        "",
        "Records:",
        "",
    ]
    for name, used in r.records.items():
        lines.append(f"- {name}: {used.remark or used.motion.name} ({used.motion.source})")
    lines += ["", "Words:", "", *(f"- {term}" for term in TERMS), ""]
    lines += [
        "| section | statement | printed | ours | verdict | tolerance | window | why, remarks |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for c in claims:
        verdict = f"**{c.verdict}**" if c.verdict in ("differs", "slip") else c.verdict
        cells = (c.section, c.statement, c.printed, c.ours, verdict, c.tolerance, c.window, c.why)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"


def _by_way(claims: Sequence[Claim]) -> str:
    """With which way of evaluating most statements hold."""
    judged = [dict(claim.by_way) for claim in claims if claim.by_way]
    held = {way: sum(found[way] == "agrees" for found in judged) for way in WINDOWS}
    return (
        f"Of {len(judged)} statements on A and d that were judged in three ways, "
        + ", ".join(f"{count} hold with {WORDS[way]}" for way, count in held.items())
        + "."
    )


def _save(figure: Figure, stem: Path) -> None:
    with _style():
        # Without a date, so that the same numbers make the same file.
        figure.savefig(stem.with_name(f"{stem.name}.pdf"), metadata={"CreationDate": None})
        figure.savefig(stem.with_name(f"{stem.name}.png"), dpi=300)


def _write_csv(path: Path, rows: Iterable[Sequence[str | float]]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as out:
        csv.writer(out).writerows(
            ["" if isinstance(cell, float) and math.isnan(cell) else cell for cell in row] for row in rows
        )
