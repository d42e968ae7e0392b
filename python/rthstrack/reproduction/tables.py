"""Tables 1 to 3: computing times over P and Q, printed, by the paper's form in SciPy, and ours."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, LogNorm
from matplotlib.figure import Figure

from rthstrack.plots.style import DOUBLE_COLUMN_IN, MUTED, _style
from rthstrack.reproduction import paper
from rthstrack.reproduction.cases import CASES
from rthstrack.reproduction.results import CHEBYSHEV, SCIPY, SPECTRAL

if TYPE_CHECKING:
    from rthstrack.reproduction.results import Results

#: The cases of each table; Table 3 was printed without Q = 1.
TABLES = {
    "table-1": ("linear-mu2035", "linear-chy101-n"),
    "table-2": ("nonlinear-mu2035", "nonlinear-chy101-n"),
    "table-3": tuple(f"experiment-{alpha_es}" for alpha_es in paper.ALPHA_ES),
}
_ROUTES = ((SCIPY, "its form in SciPy"), (SPECTRAL, "ours"))
_WHERE = {"CANOGA": "Canoga Park"}
_SHADES = LinearSegmentedColormap.from_list("share", ("#9ecae1", "#ffffff", "#fdae6b"))


def rows(r: Results, name: str) -> Iterator[tuple[str | float, ...]]:
    """A row a case, P and Q, after a header: times in ms, and over that of the table's first cell."""
    routes = (SCIPY, SPECTRAL, CHEBYSHEV)
    header = [f"{what}_{unit}" for what in ("printed", *(route for route in routes)) for unit in ("ms", "ratio")]
    yield ("case", "record_printed", "record_used", "P", "Q", *header)
    for key in TABLES[name]:
        printed = paper.TIMES_MS[key]
        first = (1, min(Q for _, Q in printed))
        used = r.records[CASES[key].record].motion.name
        for P in paper.TABLE_P:
            for Q in paper.TABLE_Q:
                at = printed.get((P, Q))
                cells: list[str | float] = ["", ""] if at is None else [at, at / printed[first]]
                for route in routes:
                    seconds = r.cell(route, key, P, Q).computing_time_s
                    cells += [1e3 * seconds, seconds / r.cell(route, key, *first).computing_time_s]
                yield (key, CASES[key].record, used, P, Q, *cells)


def draw(r: Results, name: str) -> Figure:
    """The table as a figure: times in ms, shaded by their share of the first cell, a row of tables a case."""
    keys = TABLES[name]
    with _style():
        page = Figure(figsize=(DOUBLE_COLUMN_IN, 0.55 + 1.75 * len(keys)), layout="constrained")
        axes = page.subplots(len(keys), 3, squeeze=False)
        for row, key in zip(axes, keys, strict=True):
            printed = paper.TIMES_MS[key]
            first = (1, min(Q for _, Q in printed))
            case = CASES[key]
            used = r.records[case.record]
            where = _WHERE.get(case.record, case.record)
            blocks = [(f"printed (ms), {where}", printed)]
            for route, words in _ROUTES:
                times = {
                    (P, Q): 1e3 * r.cell(route, key, P, Q).computing_time_s
                    for P in paper.TABLE_P
                    for Q in paper.TABLE_Q
                }
                blocks.append((f"{words} (ms), {used.motion.name if used.remark else where}", times))
            for ax, (words, times) in zip(row, blocks, strict=True):
                grid = np.array([[times.get((P, Q), np.nan) for Q in paper.TABLE_Q] for P in paper.TABLE_P])
                ax.imshow(grid / times[first], cmap=_SHADES, norm=LogNorm(0.05, 20), aspect="auto")
                for i, j in np.ndindex(grid.shape):
                    digits = 1 if times is printed else 2 if grid[i, j] >= 1 else 3
                    text = "-" if np.isnan(grid[i, j]) else f"{grid[i, j]:.{digits}f}"
                    ax.text(j, i, text, ha="center", va="center", fontsize=6.5)
                ax.set_xticks(range(len(paper.TABLE_Q)), [str(Q) for Q in paper.TABLE_Q])
                ax.set_yticks(range(len(paper.TABLE_P)), [str(P) for P in paper.TABLE_P])
                ax.tick_params(length=0)
                ax.spines[:].set_visible(False)
                ax.set_title(words, loc="left", pad=3)
                ax.set_xlabel("Q", labelpad=1)
            name_of = rf"$\alpha_{{es}}$ = {case.alpha_es}" if case.alpha_es else case.kind
            row[0].set_ylabel(f"{name_of}\nP")
        said = [f"Shaded by the share of the time at P = 1, Q = {2 if name == 'table-3' else 1}."]
        said += ["CHY101-N as printed is read one line up (see claims)."] if name == "table-1" else []
        said += dict.fromkeys(f"{r.remark(key)}." for key in keys if r.remark(key))
        page.supxlabel(" ".join(said), fontsize=6.5, color=MUTED, wrap=True)
        page.draw_without_rendering()
        page.set_layout_engine("none")
        return page
