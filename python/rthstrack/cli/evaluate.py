"""`rthstrack evaluate FILE...`: file in, verdict out."""

from __future__ import annotations

import argparse
import csv
import dataclasses
import json
import math
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rthstrack.cli.arguments import (
    add_method,
    add_signals,
    files_in,
    path,
    positive,
    read_signals,
    together,
    told,
    tolerance,
    two_files,
)
from rthstrack.cli.commands import COMMANDS
from rthstrack.cli.progress import counted
from rthstrack.cli.setting_options import FACTORS, setting_options, settle, with_auto
from rthstrack.errors import RecordingError, RthstrackError, SettingError, SignalError
from rthstrack.evaluation.factors import TOLERANCE
from rthstrack.evaluation.results import NUMBERS, end_names, is_interval, json_ready
from rthstrack.evaluation.tracking import Evaluator
from rthstrack.recording.readers import FORMAT_NAMES
from rthstrack.recording.recording import Recording
from rthstrack.said import Said, coded
from rthstrack.verdict import display
from rthstrack.verdict.assessment import Assessment, assess, trusted_settings, without_trusted
from rthstrack.verdict.display import with_interval
from rthstrack.verdict.entry import OF_TRUSTED, result_entry
from rthstrack.verdict.limits import Limits
from rthstrack.verdict.sentence import reason

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from rich.console import Console
    from rich.table import Table

    from rthstrack.evaluation.settings import Settings
    from rthstrack.evaluation.tracking import MovingTracking

FAILED, EXCEEDED = 1, 3
_FIGURES = (".png", ".pdf", ".svg")


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to the command line."""
    parser = subparsers.add_parser(
        "evaluate",
        help=COMMANDS["evaluate"],
        description="Judges how well the measured displacement followed the target, in amplitude and in time "
        "(Guo, Xu and Chen 2014). A positive delay means that measured lags. "
        "Exit status: 0 everything was evaluated, 1 some file failed, 2 misuse, 3 a limit was exceeded.",
    )
    parser.add_argument(
        "files", nargs="*", metavar="FILE", help=f"recorded test ({', '.join(FORMAT_NAMES)}), or a folder of them; "
        "none where --target and --measured are each FILE:CHANNEL"
    )  # fmt: skip
    signals = add_signals(parser, "signals (a channel is named by name, path or #index)")
    signals.add_argument("--command", action="append", metavar="C", help="what compensation sends: judged apart")
    method = add_method(parser, trusted=True)
    for option in setting_options("evaluation"):
        (with_auto(option) if option.name in FACTORS else option).add_to(method)
    method.add_argument("--tolerance", type=tolerance, metavar="X",
                        help="auto takes the largest P and Q that change amplitude and delay by at most this share, of "
                        f"the whole record ({TOLERANCE}); moving windows then keep P = Q = 1")  # fmt: skip
    method.add_argument("--moving", type=positive, metavar="S", help="length of a moving window (4 s)")
    method.add_argument("--hop", type=positive, metavar="S", help="from one moving window to the next")
    limits = parser.add_argument_group("limits")
    limits.add_argument("--limit-delay", type=positive, metavar="S", help="largest |delay| allowed, in seconds")
    limits.add_argument("--limit-amplitude", type=positive, metavar="X", help="largest |amplitude - 1| allowed")
    output = parser.add_argument_group("output")
    output.add_argument("--json", action="store_true", help="print JSON instead of text")
    output.add_argument("--report", type=path(".html", ".htm"), metavar="OUT.html", help="write an interactive report")
    output.add_argument(
        "--figure", type=path(*_FIGURES), metavar="OUT.png|pdf|svg", help="write a figure for a journal"
    )
    output.add_argument("--csv", type=path(".csv"), metavar="OUT.csv",
                        help="write a row a result; with --moving also the readings, to OUT_moving.csv")  # fmt: skip
    parser.set_defaults(run=lambda args: run(args, parser.error))


def run(args: argparse.Namespace, misuse: Callable[[str], Any]) -> int:
    """Evaluates the files; returns the exit status."""
    try:
        settle(args)
    except SettingError as impossible:
        misuse(told(impossible))
    args.two = two_files(args, args.files, misuse)
    args.files = files_in(args.files) if args.two is None else [together(args.two)]
    _check(args, misuse)
    results, failures = _evaluate_all(args)
    assessments = [a for found in results for a in found]
    notes = _write_outputs(args, assessments)
    if args.json:
        document = {
            "results": [result_entry(a) for a in assessments],
            "failures": [
                {"file": file, "error": told(error), "code": error.code, "values": json_ready(error.values)}
                for file, error in failures
            ],
        }
        print(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False))
    else:
        _print_text(results, len(args.files))
    for _, error in failures:
        print(f"rthstrack: {told(error)}", file=sys.stderr)
    for note in notes:
        print(note, file=sys.stderr)
    if failures:
        return FAILED
    return EXCEEDED if any(a.exceeded for a in assessments) else 0


def assess_file(file: str, args: argparse.Namespace) -> list[Assessment]:
    """Reads one file and judges each of its pairs.

    Raises RecordingError, ChannelError or SignalError, with the file and the channels named.
    """
    recording, _, pairs, proposal = read_signals(args, file, args.command or ())
    commands: Sequence[str | None] = args.command or [None] * len(pairs)
    if len(commands) != len(pairs):
        raise RecordingError(
            f"{len(commands)} --command for {len(pairs)} proposed pairs: name each --target and --measured", file=file
        )
    found = []
    for actuator, ((target, measured), command) in enumerate(zip(pairs, commands, strict=True)):
        parts = [("whole", target, measured)]
        if command is not None:
            parts += [("compensator", target, command), ("actuator", command, measured)]
        for part, asked, answered in parts:
            found.append(_assess(recording, actuator, part, asked, answered, proposal, args))
    return found


def _assess(
    recording: Recording,
    actuator: int,
    part: str,
    target: str,
    measured: str,
    proposal: Said | None,
    args: argparse.Namespace,
) -> Assessment:
    asked, answered = recording.channel(target), recording.channel(measured)
    assert recording.rate_hz is not None
    origin = {
        "rate_source": recording.rate_source,
        "start_s": args.start,
        "end_s": args.end,
        "scale": dict(args.scale),
        "fill": args.fill,
        "n_filled": {c.name: recording.n_filled.get(c.path, 0) for c in (asked, answered)} if args.fill else {},
        "resample_hz": args.resample,
        "notes": list(recording.notes),
        "channels": proposal or "named by the user",
    }
    try:
        assessment = assess(
            asked.values,
            answered.values,
            recording.rate_hz,
            settings=args.settings,
            choose=args.choose,
            tolerance=args.tolerance or TOLERANCE,
            moving_s=args.moving,
            hop_s=args.hop,
            limits=Limits(args.limit_delay, args.limit_amplitude) if part == "whole" else None,
            file=recording.file,
            actuator=actuator,
            part=part,
            target_name=asked.name,
            measured_name=answered.name,
            unit=asked.unit,
            measured_unit=answered.unit,
            start_s=recording.start_s,
            origin=origin,
        )
    except SignalError as error:
        hint = " (--fill SAMPLES interpolates short gaps)" if error.code == "not_finite" and not args.fill else ""
        channels = f"target '{asked.name}', measured '{answered.name}'"
        raise error.reworded(f"{channels}: {error}{hint}").about(recording.file) from None
    except SettingError as error:
        raise error.about(recording.file) from None
    said = list(assessment.warnings)
    notes = [coded(note) for note in (recording.notes if part == "whole" else ())]
    # What the number stands and falls with comes first.
    said = [note for note in notes if note.code in _GUESSES] + said
    if proposal is not None and part == "whole":
        words = f"no channels were named: judged target '{asked.name}', measured '{answered.name}' ({proposal})"
        said.insert(0, Said(words, "channels_proposed"))
    said += [note for note in notes if note.code not in _GUESSES]
    guessed = [proposal.cause] if proposal is not None and proposal.code == "pair_guessed" else []
    guessed += list(dict.fromkeys(note.cause for note in map(coded, recording.notes) if note.code in _GUESSES))
    guessed += [f"but {warning.cause}" for warning in assessment.warnings if warning.code == "copy"]
    verdict = ", ".join([assessment.verdict, *guessed])
    return dataclasses.replace(assessment, warnings=tuple(said), verdict=verdict)


#: Notes on what is only a guess, which the verdict says too.
_GUESSES = ("time_unit_guessed", "clocks_assumed", "clocks_aligned")


def _check(args: argparse.Namespace, misuse: Callable[[str], Any]) -> None:
    """What argparse cannot see: options that need or exclude each other."""
    targets, measured, commands = (args.target or []), (args.measured or []), (args.command or [])
    if len(targets) != len(measured):
        misuse(f"--target and --measured go in pairs, found {len(targets)} and {len(measured)}")
    if commands and targets and len(commands) != len(targets):
        misuse(f"one --command for each --target is needed, found {len(commands)} for {len(targets)}")
    settings: Settings = args.settings
    if args.tolerance is not None and not args.choose:
        misuse("--tolerance speaks of P and Q that are chosen: give -P auto, -Q auto or both")
    for option, needed, found in (("--decimator", "spectral", settings.decimator),
                                  ("--estimator", "fei", settings.estimator)):  # fmt: skip
        if args.choose and found != needed:
            misuse(f"-P auto and -Q auto need {option} {needed}, found {found}")
    try:
        # Whether P, Q and band leave anything depends on the record; whether they go together does not.
        for one in (without_trusted(settings), trusted_settings(settings, settings.expected_delay_s)):
            few = min(one.data_decimation, 2)
            Evaluator(1024, 1.0, one, data_decimation=few, frequency_decimation=1, band_hz=None)
    except SettingError as error:
        misuse(told(error))
    if args.start is not None and args.end is not None and args.start >= args.end:
        misuse(f"--start must come before --end, found {args.start:g} and {args.end:g}")
    if args.resample and (args.rate):
        misuse("--resample interpolates the file's time stamps and excludes --rate")
    for option in ("report", "figure", "csv"):
        path = getattr(args, option)
        if path is not None and not path.parent.is_dir():
            misuse(f"--{option}: there is no directory {path.parent}")


def _evaluate_all(args: argparse.Namespace) -> tuple[list[list[Assessment]], list[tuple[str, RthstrackError]]]:
    """All files, on all cores; one that fails does not stop the rest."""

    def one(file: str) -> list[Assessment] | RthstrackError:
        try:
            return assess_file(file, args)
        except RthstrackError as error:
            return error.about(file)
        except MemoryError:
            return RecordingError("does not fit into memory", file=file, code="memory")

    files = args.files
    if len(files) == 1:
        found: Iterable[list[Assessment] | RthstrackError] = [one(files[0])]
    else:
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(max_workers=min(len(files), os.cpu_count() or 1)) as pool:
            found = list(counted("evaluating", pool.map(one, files), len(files)))
    results, failures = [], []
    for file, outcome in zip(files, found, strict=True):
        if isinstance(outcome, RthstrackError):
            failures.append((file, outcome))
        else:
            results.append(outcome)
    return results, failures


def _write_outputs(args: argparse.Namespace, assessments: Sequence[Assessment]) -> list[str]:
    """Report, figure and CSV; returns what was written, one line each."""
    if not assessments:
        return []
    notes = []
    try:
        if args.report is not None:
            from rthstrack.report.page import write_report

            write_report(assessments, args.report)
            notes.append(f"report written to {args.report}")
        if args.figure is not None:
            from rthstrack.plots.assessment import write_figure

            for a, path in _figure_paths(args.figure, assessments):
                write_figure(a, path)
                notes.append(f"figure written to {path}")
        if args.csv is not None:
            _write_csv(args.csv, [_flat(result_entry(a)) for a in assessments])
            notes.append(f"results written to {args.csv}")
            if args.moving is not None:
                path = args.csv.with_stem(f"{args.csv.stem}_moving")
                _write_csv(path, [row for a in assessments for row in _readings(a)])
                notes.append(f"readings written to {path}")
    except OSError as error:
        raise RecordingError(f"cannot write {error.filename}: {error.strerror}") from None
    return notes


def _figure_paths(path: Path, assessments: Sequence[Assessment]) -> list[tuple[Assessment, Path]]:
    """One path an assessment: the given one where there is one, else with a number before the ending."""
    if len(assessments) == 1:
        return [(assessments[0], path)]
    return [(a, path.with_stem(f"{path.stem}_{i}")) for i, a in enumerate(assessments, start=1)]


def _flat(entry: dict[str, Any], before: str = "") -> dict[str, Any]:
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


_REASON = ("reason", "reason_code", "reason_values")
_READING = (*NUMBERS[:4], "valid", *(name for name in NUMBERS[4:] if name not in OF_TRUSTED), *_REASON)
_TRUSTED_READING = ("amplitude", "delay_s", "valid", "amplitude_interval", "delay_interval_s", *_REASON)


def _readings(a: Assessment) -> Iterable[dict[str, Any]]:
    if a.moving is None or a.trusted_moving is None:
        return
    about = {"file": a.file, "actuator": a.actuator, "target": a.target_name, "measured": a.measured_name}
    for i, time_s in enumerate(a.moving.time_s):
        row = {name: json_ready(getattr(a.moving, name)[i]) for name in _READING}
        trusted = {f"trusted_{name}": json_ready(getattr(a.trusted_moving, name)[i]) for name in _TRUSTED_READING}
        for name, value in (row | trusted).items():
            # No interval is no pair of missing ends.
            if is_interval(name.removeprefix("trusted_")) and None in value:
                (row if name in row else trusted)[name] = None
        yield _flat(about | {"time_s": a.start_s + float(time_s)} | row | trusted)


def _write_csv(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    fields = list(dict.fromkeys(key for row in rows for key in row))
    with open(path, "w", newline="", encoding="utf-8") as out:
        writer = csv.DictWriter(out, fields, restval="")
        writer.writeheader()
        writer.writerows(rows)


def _print_text(results: Sequence[Sequence[Assessment]], n_files: int) -> None:
    from rich.console import Console

    # Into a file or pipe nothing is folded at a terminal's width.
    console = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 200)
    if n_files == 1:
        for a in (a for found in results for a in found):
            _print_one(console, a)
    elif any(results):
        _print_table_of_all(console, [a for found in results for a in found])


_PARTS = {"whole": "", "compensator": "compensator: ", "actuator": "actuator: "}


def _print_one(console: Console, a: Assessment) -> None:
    from rich.table import Table
    from rich.text import Text

    t = a.tracking
    which = f"actuator {a.actuator}: " if a.actuator else ""
    console.print(Text(f"{which}{_PARTS[a.part]}{a.verdict}", style="bold"))
    console.print(Text(a.argument))
    for text in a.exceeded:
        console.print(Text(f"limit exceeded: {text}", style="bold red"))
    console.print(_side_by_side(a))
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    band = "" if a.tracking.settings.band_hz is None else f", band {t.settings.band_hz}"
    for label, value in (
        ("file", f"{a.file}, {t.n_samples} samples at {a.rate_hz:g} Hz ({a.settings.get('rate_source', 'given')})"),
        ("target, measured", f"{a.target_name}, {a.measured_name}"),
        ("phase", _number(math.degrees(float(t.phase_rad)), ".5g", " degrees")),
        ("bins", f"{t.n_bins}, every {t.delta_f_hz:.4g} Hz{band}"),
        *_reason_rows(a),
        *([("P and Q chosen", a.factors.sentence)] if a.factors else []),
        *([("a larger Q", a.factors.windowed.sentence)] if a.factors and a.factors.windowed else []),
        *_moving_rows(a),
        *_index_rows(a),
    ):
        table.add_row(label, Text(value))
    console.print(table)
    for warning in a.warnings:
        console.print(Text("warning: ", style="yellow") + Text(warning))
    console.print()


def _side_by_side(a: Assessment) -> Table:
    """The estimate asked for and the trusted one, with their 95 % intervals as far as there are any."""
    from rich.table import Table
    from rich.text import Text

    columns = [a.tracking] if a.trusted is a.tracking else [a.tracking, a.trusted]
    table = Table(box=None, pad_edge=False)
    table.add_column("", style="dim", no_wrap=True)
    for t in columns:
        trusted = "trusted (least squares), 95 % interval"
        table.add_column(trusted if t is a.trusted else display.estimator_in_full(t.settings.estimator))
    rows = [
        ("amplitude", [_estimate(float(t.amplitude), t.amplitude_interval) for t in columns]),
        (
            "delay",
            [_estimate(1e3 * float(t.delay_s), [1e3 * end for end in t.delay_interval_s], "ms") for t in columns],
        ),
        ("at", [_number(float(t.equivalent_frequency_hz), ".5g", " Hz") for t in columns]),
    ]
    for label, cells in rows:
        table.add_row(label, *map(Text, cells))
    return table


def _estimate(value: float, interval: Iterable[float], unit: str = "") -> str:
    low, high = interval
    if math.isfinite(value) and not math.isfinite(high - low):
        return f"{value:.6g} {unit}".rstrip()
    return with_interval(value, (low, high), unit)


def _number(value: float, layout: str, unit: str) -> str:
    return f"{value:{layout}}{unit}" if math.isfinite(value) else "not determined"


def _windows_text(a: Assessment, moving: MovingTracking) -> str:
    import numpy as np

    known = moving.valid & np.isfinite(moving.delay_s)
    if not known.any():
        return f"no window could be judged{_most_frequent(moving)}"
    delays, amplitudes = 1e3 * moving.delay_s[known], moving.amplitude[known]
    (low, high), (small, large) = np.quantile(delays, (0.1, 0.9)), np.quantile(amplitudes, (0.1, 0.9))
    return (
        f"of {moving.window_s:g} s{_moving_factors(a, moving)}: delay {low:.4g} to {high:.4g} ms, "
        f"amplitude {small:.4g} to {large:.4g} (10 to 90 % of {known.sum()} readings)"
    )


def _most_frequent(moving: MovingTracking) -> str:
    counted = display.reasons(moving)
    return f": {counted[0][1]}" if counted else ""


def _reason_rows(a: Assessment) -> list[tuple[str, str]]:
    """Why a number or an interval is missing, each reason once."""
    rows = {}
    for t in (a.tracking, a.trusted):
        if why := reason(t):
            rows[why] = ("not determined" if math.isnan(float(t.delay_s)) else "no interval", why.cause)
    return list(rows.values())


def _index_rows(a: Assessment) -> list[tuple[str, str]]:
    """The indices that there are, those of one name in one row."""
    own = {"unit": a.unit, "unit2": f"{a.unit}^2" if a.unit else None}
    rows: dict[str, list[str]] = {}
    for _, field, unit, scale, percent, _, name in display.INDICES:
        value = getattr(a.indices, field)
        if value is None:
            continue
        text = f"{scale * value:{'.3g' if unit == '%' else '.4g'}} {own.get(unit, unit) or ''}".rstrip()
        beside = "" if percent is None else f" ({getattr(a.indices, percent):.3g} %)"
        rows.setdefault(name, []).append(text + beside)
    return [(name, ", ".join(texts)) for name, texts in rows.items()]


def _moving_rows(a: Assessment) -> list[tuple[str, str]]:
    if a.moving is None or a.trusted_moving is None:
        return [("moving windows", a.moving_note or "")]
    rows = [("moving windows", _windows_text(a, a.moving))]
    if a.trusted_moving is not a.moving:
        rows.append(("the same, trusted", _windows_text(a, a.trusted_moving)))
    return rows


def _moving_factors(a: Assessment, moving: MovingTracking) -> str:
    """P and Q of the windows, where others were chosen for the record."""
    if a.factors is None or moving is not a.moving:
        return ""
    s = moving.settings
    return f" at P = {s.data_decimation}, Q = {s.frequency_decimation}"


def _print_table_of_all(console: Console, assessments: Sequence[Assessment]) -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False)
    table.add_column("file", overflow="fold")
    table.add_column("target, measured", overflow="fold")
    for name in ("amplitude", "delay ms", "trusted amplitude", "trusted delay ms", "at Hz", "rms error %"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("")
    for a in assessments:
        t = a.tracking
        remarks = "LIMIT" if a.exceeded else ""
        if a.warnings:
            remarks += f" {len(a.warnings)} warning" + ("s" if len(a.warnings) > 1 else "")
        table.add_row(
            Text(a.file),
            Text(f"{a.target_name}, {a.measured_name}"),
            _number(float(t.amplitude), ".4f", ""),
            _number(1e3 * float(t.delay_s), ".3f", ""),
            _estimate(float(a.trusted.amplitude), a.trusted.amplitude_interval),
            _estimate(1e3 * float(a.trusted.delay_s), [1e3 * end for end in a.trusted.delay_interval_s]),
            _number(float(t.equivalent_frequency_hz), ".3g", ""),
            f"{a.indices.rms_error_percent:.3g}",
            Text(remarks.strip(), style="bold red" if a.exceeded else "yellow"),
        )
    console.print(table)
    for a in assessments:
        for text in (*a.exceeded, a.argument, *a.warnings):
            console.print(Text(f"{a.file}: ", style="yellow") + Text(text))
