"""`rthstrack study SOURCE...`: what P and Q do to amplitude, delay and computing time."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rthstrack.cli.arguments import (
    add_method,
    add_signals,
    chosen,
    count,
    files_in,
    read_signals,
    together,
    told,
    tolerance,
    two_files,
)
from rthstrack.cli.commands import COMMANDS
from rthstrack.cli.progress import counted, stage
from rthstrack.cli.quantities import positive, time
from rthstrack.cli.setting_options import setting_options
from rthstrack.errors import RthstrackError, SettingError
from rthstrack.evaluation.inputs import TOLERANCE
from rthstrack.evaluation.presets import PRESETS
from rthstrack.evaluation.results import json_ready
from rthstrack.evaluation.settings import StudyMethod
from rthstrack.recording.readers import FORMAT_NAMES
from rthstrack.studies.cells import Study
from rthstrack.studies.grid import study
from rthstrack.studies.pairs import Pair, pairs_in, read_pairs
from rthstrack.studies.settings import COMBINED, POWERS, WEIGHT_POWERS, WINDOWS, StudySettings, _several

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from rich.console import Console
    from rich.table import Table

    from rthstrack.studies.cells import Cell

FAILED = 1
_METHOD = tuple(one.name for one in dataclasses.fields(StudyMethod))
_DESCRIPTION = f"""\
Evaluates a test over grids of data decimation P and frequency decimation Q: amplitude, delay,
their error against the truth where it is known, their change from P = Q = 1, and the computing
time. By default the grids of Guo, Xu and Chen (2014): P and Q each alone from 1 to 512, and
combined up to P = 64 and Q = 32. A positive delay means that measured lags.

A SOURCE is a recorded test ({", ".join(FORMAT_NAMES)}), a run
that `rthstrack simulate` wrote, or a configuration (.toml), which is simulated first. Runs and
configurations bring the truth with them.
"""
_EPILOG = """\
examples:
  rthstrack study run.h5 -o study
  rthstrack study test.csv --true-delay 0.012 -o study
  rthstrack study run.h5 -P auto -Q auto --tolerance 0.005 --share 0.99,0.999
  rthstrack study test.csv -P 1,4,16 -Q 1,2,4,8 --windows boxcar,tukey --json

With -o DIR: study.csv (a row a cell with every setting in it; a cell that leaves nothing to judge
by has empty numbers and a reason) and, of each source, the figures data_decimation,
frequency_decimation, computing_time and combined_WINDOW_lPOWER as PDF and PNG. With several
sources their names begin with the source's number and name. Files of these names in DIR are
overwritten, no others.
Times are the fastest of several calls of a planned evaluator, one call at a time; planning is
left out.
Exit status: 0 every source was studied, 1 some source failed, 2 misuse.
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to the command line."""
    parser = subparsers.add_parser(
        "study",
        help=COMMANDS["study"],
        description=_DESCRIPTION,
        epilog=_EPILOG,
    )
    parser.add_argument("sources", nargs="*", metavar="SOURCE",
                        help="recorded test, run file or configuration (.toml), or a folder of them; none where "
                        "--target and --measured are each FILE:CHANNEL")  # fmt: skip
    grid = parser.add_argument_group("grid (lists with commas)")
    powers = f"{POWERS[0]},{POWERS[1]},...,{POWERS[-1]}"
    grid.add_argument(
        "-P",
        metavar="LIST",
        default=argparse.SUPPRESS,
        help=f"data decimations, powers of two (default: {powers})"
        "; auto among them adds the one that --tolerance allows",
    )
    grid.add_argument(
        "-Q",
        metavar="LIST",
        default=argparse.SUPPRESS,
        help=f"frequency decimations, powers of two (default: {powers}); auto likewise",
    )
    grid.add_argument("--combined", nargs=2, type=count, metavar=("P", "Q"),
                      help="largest P and Q taken together; each alone goes as far as its list (default: "
                      f"{COMBINED[0]} {COMBINED[1]}, or every P with every Q where -P or -Q is given)")  # fmt: skip
    grid.add_argument(
        "--windows",
        default=argparse.SUPPRESS,
        metavar="LIST",
        help=f"of boxcar, hann, hamming, blackman, flattop, tukey (default: {','.join(WINDOWS)})",
    )
    grid.add_argument("--weight-powers", metavar="LIST",
                      help=f"bins weigh |target|^L, 1 to 16 (default: {','.join(map(str, WEIGHT_POWERS))}; "
                      "2 for least_squares, which knows no other)")  # fmt: skip
    grid.add_argument("--tolerance", type=tolerance, metavar="X",
                      help="auto takes the largest P and Q that change amplitude and delay by at most this share "
                      f"({TOLERANCE}); with auto for one of them the other is 1")  # fmt: skip
    grid.add_argument(
        "--share",
        metavar="LIST",
        help="also the fewest bins that hold this share of the weight, such as 0.999, evaluated alone",
    )
    add_signals(parser, "signals of recorded tests (a channel is named by name, path or #index)")
    truth = parser.add_argument_group("truth, in place of what a run or configuration says itself")
    truth.add_argument("--true-amplitude", type=positive, metavar="X", help="measured over target")
    truth.add_argument("--true-delay", type=time, metavar="S", help="in seconds; positive: measured lags")
    method = add_method(parser)
    for option in setting_options("evaluation"):
        if option.name in _METHOD:
            option.add_to(method)
    method.add_argument("--no-timing", action="store_true", help="measure no computing times")
    output = parser.add_argument_group("output")
    output.add_argument("-o", "--output", type=Path, metavar="DIR", help="write CSV and figures there; made if need be")
    output.add_argument("--no-figures", action="store_true", help="write the CSV only")
    output.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.set_defaults(run=lambda args: run(args, parser.error))


def run(args: argparse.Namespace, misuse: Callable[[str], Any]) -> int:
    """Studies the sources; returns the exit status."""
    _take_preset(args)
    args.two = two_files(args, args.sources, misuse, "SOURCE")
    if len(args.target or []) != len(args.measured or []):
        misuse(f"--target and --measured go in pairs, found {len(args.target or [])} and {len(args.measured or [])}")
    if args.resample and args.rate:
        misuse("--resample interpolates the file's time stamps and excludes --rate")
    if args.start is not None and args.end is not None and args.start >= args.end:
        misuse(f"--start must come before --end, found {args.start:g} and {args.end:g}")
    if args.no_figures and args.output is None:
        misuse("--no-figures speaks of what -o DIR writes: give -o DIR")
    p, q = _grid_list(args.P), _grid_list(args.Q)
    choose = tuple(name for name, given in (("P", args.P), ("Q", args.Q)) if given and "auto" in _items(given))
    if args.tolerance is not None and not choose:
        misuse("--tolerance speaks of P and Q that are chosen: give -P auto, -Q auto or both")
    method = {name: getattr(args, name) for name in _METHOD if hasattr(args, name)}
    settings = StudySettings(
        **method,
        P=p,
        Q=q,
        combined=args.combined and tuple(args.combined),
        windows=_items(args.windows),
        weight_powers=_weight_powers(args),
        timing=not args.no_timing,
        choose=choose,
        tolerance=args.tolerance or TOLERANCE,
        shares=() if args.share is None else _several("share", _items(args.share)),
    ).checked()
    _make(args.output)
    pairs, failures = _read_all(args)
    found = None
    if pairs:
        with stage("studying") as progress:
            found = study(pairs, settings, truth=_truth(args), progress=progress)
    written = _write(found, args) if found is not None else []
    if args.json:
        document = {
            "study": None if found is None else json_ready(found.to_dict()),
            "failures": [{"file": file, "error": error} for file, error in failures],
        }
        print(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False))
    elif found is not None:
        _print_text(found)
    for _, error in failures:
        print(f"rthstrack: {error}", file=sys.stderr)
    for note in written:
        print(note, file=sys.stderr)
    return FAILED if failures else 0


def _take_preset(args: argparse.Namespace) -> None:
    """What was not given is the preset's: its factors beside none."""
    usual: dict[str, Any] = {"P": None, "Q": None, "windows": ",".join(WINDOWS)}
    if args.preset is not None:
        preset = PRESETS[args.preset]
        p, q = ("1" if one == 1 else f"1,{one}" for one in (preset.data_decimation, preset.frequency_decimation))
        usual = {name: getattr(preset, name) for name in _METHOD} | {"P": p, "Q": q, "windows": preset.window}
    for name, value in usual.items():
        if not hasattr(args, name):
            setattr(args, name, value)


def _items(text: str) -> tuple[str, ...]:
    return tuple(item.strip() for item in text.split(",")) if text.strip() else ()


def _numbers(text: str) -> tuple[Any, ...]:
    """Whole numbers; what is none stays text, for the check to name."""
    return tuple(int(item) if item.removeprefix("-").isdecimal() else item for item in _items(text))


def _weight_powers(args: argparse.Namespace) -> tuple[Any, ...]:
    if args.weight_powers is not None:
        return _numbers(args.weight_powers)
    return (2,) if getattr(args, "estimator", None) == "least_squares" else WEIGHT_POWERS


def _grid_list(text: str | None) -> tuple[Any, ...] | None:
    """The numbers of -P or -Q; None, the default, where there are none but auto."""
    if text is None or set(_items(text)) == {"auto"}:
        return None
    return tuple(number for number in _numbers(text) if number != "auto")


def _truth(args: argparse.Namespace) -> tuple[float, float] | None:
    given = (args.true_amplitude, args.true_delay)
    if given == (None, None):
        return None
    amplitude, delay_s = (math.nan if value is None else value for value in given)
    return amplitude, delay_s


def _make(directory: Path | None) -> None:
    """Makes the directory before anything is computed."""
    if directory is None:
        return
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SettingError(f"-o {directory}: cannot make this directory ({error.strerror}); name another") from None


def _read_all(args: argparse.Namespace) -> tuple[list[Pair], list[tuple[str, str]]]:
    """The pairs of all sources, read and simulated on all cores; one that fails does not stop the rest."""

    def one(file: str) -> list[Pair] | str:
        try:
            return read_pairs(file, **chosen(args)) if args.two is None else pairs_in(read_signals(args, file), file)
        except RthstrackError as error:
            return told(error.about(file))
        except MemoryError:
            return f"{file}: does not fit into memory"

    pairs: list[Pair] = []
    failures = []
    files = list(dict.fromkeys(files_in(args.sources))) if args.two is None else [together(args.two)]
    with ThreadPoolExecutor(max_workers=min(len(files), os.cpu_count() or 1)) as pool:
        for file, outcome in zip(files, counted("reading", pool.map(one, files), len(files)), strict=True):
            if isinstance(outcome, str):
                failures.append((file, outcome))
            else:
                pairs += outcome
    return pairs, failures


def _write(found: Study, args: argparse.Namespace) -> list[str]:
    """CSV and figures; returns what was written, one line each."""
    if args.output is None:
        return []
    path = args.output / "study.csv"
    found.to_csv(path)
    notes = [f"cells written to {path}"]
    if not args.no_figures:
        from rthstrack.plots.study import write_study_figures

        figures = write_study_figures(found, args.output)
        notes.append(f"{len(figures)} figures written to {args.output}: {', '.join(p.name for p in figures)}")
    return notes


# ------------------------------------------------------------------------------------------------------------- tables


def _print_text(found: Study) -> None:
    from rich.text import Text

    from rthstrack.cli.output import Console

    console = Console()
    if len(found.sources) > 1:
        _print_summary(console, found)
        _print_beside(console, found)
    for source in found.sources:
        if len(found.sources) == 1:
            about = f"{source.target_name}, {source.measured_name}, {source.n_samples} samples at {source.rate_hz:g} Hz"
            console.print(Text(source.name, style="bold") + Text(f": {about}", style="dim"))
            for window in found.settings.windows:
                for power in found.settings.weight_powers:
                    kind: Any = {"source": source.name, "window": window, "weight_power": power}
                    beside = [c for c in found.select(**kind, kind=None) if c.kind != "grid"]
                    _print_grid(console, found, found.select(**kind), beside)
        for note in source.notes:
            console.print(Text(f"{source.name}: ", style="yellow") + Text(note))
    if invalid := [cell for cell in found.cells if cell.reason]:
        count = f"{len(invalid)} of {len(found.cells)} cells could not be determined, the first: "
        console.print(Text(count, style="yellow") + Text(invalid[0].reason))


def _print_grid(console: Console, found: Study, cells: Sequence[Cell], beside: Sequence[Cell]) -> None:
    """P alone, Q alone, chosen factors and key frequencies as one table, the combinations as small ones."""
    from rich.columns import Columns
    from rich.text import Text

    settings = cells[0].settings
    console.print(Text(f"\n{settings.window} window, weight power {settings.weight_power}", style="bold"))
    known = any(math.isfinite(c.true_amplitude) or math.isfinite(c.true_delay_s) for c in cells)
    alone = _table()
    names = [
        "P",
        "Q",
        "A",
        "A error %" if known else "A change %",
        "d ms",
        "d error %" if known else "d change %",
        "at Hz",
    ]
    for name in [*names, *(["time us"] if found.settings.timing else [])]:
        alone.add_column(name, justify="right", no_wrap=True)
    if beside:
        alone.add_column("")
    by_p = [c for c in cells if c.settings.frequency_decimation == 1]
    by_q = [c for c in cells if c.settings.data_decimation == 1]
    sections = [section for section in (by_p, by_q) if len(section) > 1] or [by_p or by_q]
    for section in [*sections, *([beside] if beside else [])]:
        if section is not sections[0]:
            alone.add_row()
        for c in section:
            a, d = (c.amplitude_error, c.delay_error) if known else (c.amplitude_change, c.delay_change)
            alone.add_row(
                *_factors_text(c),
                _text(c.amplitude, ".5f"),
                _text(100 * a, "+.3f"),
                _text(1e3 * c.delay_s, ".4f"),
                _text(100 * d, "+.3f"),
                _text(c.equivalent_frequency_hz, ".4g"),
                *([_text(1e6 * c.computing_time_s, ".1f")] if found.settings.timing else []),
                *([Text(_beside_text(c))] if beside else []),
            )
    if alone.row_count:
        console.print(alone)
    both = [c for c in cells if c.settings.data_decimation > 1 and c.settings.frequency_decimation > 1]
    if both:
        shown = [("A", lambda c: _text(c.amplitude, ".4f")), ("d ms", lambda c: _text(1e3 * c.delay_s, ".3f"))]
        if found.settings.timing:
            shown.append(("time us", lambda c: _text(1e6 * c.computing_time_s, ".0f")))
        console.print(Columns([_matrix(name, cells, both, write) for name, write in shown], padding=(0, 4)))


def _factors_text(c: Cell) -> tuple[str, str]:
    """P and Q; key frequencies have none."""
    if c.kind == "key":
        return "key", ""
    return str(c.settings.data_decimation), str(c.settings.frequency_decimation)


def _beside_text(c: Cell) -> str:
    """Of chosen factors the bound, of key frequencies how many there are; nothing of the grid."""
    if c.kind == "grid" or c.reason:
        return c.reason and "not determined"
    if c.kind == "key":
        return f"{c.n_bins} key frequencies hold {c.share:g} of the weight"
    delay = f"d {100 * c.delay_bound:.2g} %" if c.delay_measure == "relative" else f"phase {c.delay_bound:.2g} rad"
    return f"chosen: changes A by at most {100 * c.amplitude_bound:.2g} %, {delay} (tolerance {100 * c.tolerance:g} %)"


def _print_beside(console: Console, found: Study) -> None:
    """A line each for the chosen factors and key frequencies of several sources."""
    from rich.text import Text

    cells = [c for c in found.cells if c.kind != "grid"]
    if not cells:
        return
    table = _table()
    table.add_column("source", overflow="fold")
    table.add_column("window")
    for name in ("l", "P", "Q", "A change %", "d change %", *(["time us"] if found.settings.timing else [])):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("")
    for c in cells:
        table.add_row(
            Text(c.source),
            c.settings.window,
            str(c.settings.weight_power),
            *_factors_text(c),
            _text(100 * c.amplitude_change, "+.3f"),
            _text(100 * c.delay_change, "+.3f"),
            *([_text(1e6 * c.computing_time_s, ".1f")] if found.settings.timing else []),
            Text(_beside_text(c)),
        )
    console.print()
    console.print(table)


def _matrix(name: str, cells: Sequence[Cell], both: Sequence[Cell], write: Callable[[Cell], str]) -> Table:
    """P down, Q across, as far as they are combined, with P = 1 and Q = 1 beside."""
    table = _table(title=f"{name}, P down, Q across")
    all_p = sorted({1, *(c.settings.data_decimation for c in both)})
    all_q = sorted({1, *(c.settings.frequency_decimation for c in both)})
    written = {(c.settings.data_decimation, c.settings.frequency_decimation): write(c) for c in cells}
    for head in ("", *map(str, all_q)):
        table.add_column(head, justify="right", no_wrap=True)
    for p in all_p:
        row = [written.get((p, q), "") for q in all_q]
        if any(row):
            table.add_row(str(p), *row)
    return table


def _print_summary(console: Console, found: Study) -> None:
    """A line a source, window and weight power: P = Q = 1, and the largest changes from it."""
    from rich.text import Text

    table = _table()
    table.add_column("source", overflow="fold")
    table.add_column("window")
    heads = ["l", "A", "d ms", "at Hz", "A error %", "d error %", "A change %", "d change %", "not valid"]
    for name in [*heads, *(["time us"] if found.settings.timing else [])]:
        table.add_column(name, justify="right", no_wrap=True)
    for source in found.source_names:
        for window in found.settings.windows:
            for power in found.settings.weight_powers:
                cells = found.select(source=source, window=window, weight_power=power)
                first = cells[0]
                times = [c.computing_time_s for c in cells if math.isfinite(c.computing_time_s)]
                table.add_row(
                    Text(source),
                    window,
                    str(power),
                    _text(first.amplitude, ".5f"),
                    _text(1e3 * first.delay_s, ".4f"),
                    _text(first.equivalent_frequency_hz, ".4g"),
                    _text(100 * first.amplitude_error, "+.3f"),
                    _text(100 * first.delay_error, "+.3f"),
                    _text(100 * _largest(c.amplitude_change for c in cells), ".3f"),
                    _text(100 * _largest(c.delay_change for c in cells), ".3f"),
                    str(sum(bool(c.reason) for c in cells) or ""),
                    *(
                        [f"{1e6 * min(times):.0f} to {1e6 * max(times):.0f}" if times else ""]
                        if found.settings.timing
                        else []
                    ),
                )
    console.print(table)


def _largest(values: Iterable[float]) -> float:
    return max((abs(value) for value in values if math.isfinite(value)), default=math.nan)


def _text(value: float, layout: str) -> str:
    return format(value, layout) if math.isfinite(value) else "-"


def _table(title: str | None = None) -> Table:
    from rich.table import Table

    return Table(box=None, pad_edge=False, title=title, title_justify="left", title_style="dim")
