"""`rthstrack evaluate FILE...`: file in, verdict out."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rthstrack.cli.arguments import (
    add_method,
    add_signals,
    files_in,
    panels,
    path,
    read_signals,
    size,
    together,
    told,
    tolerance,
    two_files,
)
from rthstrack.cli.commands import COMMANDS
from rthstrack.cli.evaluate_text import print_text
from rthstrack.cli.progress import counted
from rthstrack.cli.quantities import positive, seconds
from rthstrack.cli.setting_options import FACTORS, setting_options, settle, with_auto
from rthstrack.errors import RecordingError, RthstrackError, SettingError
from rthstrack.evaluation.inputs import TOLERANCE
from rthstrack.evaluation.tracking import Evaluator
from rthstrack.recording.readers import FORMAT_NAMES
from rthstrack.recording.recording import Recording
from rthstrack.verdict.assessment import MOVING_S, trusted_settings, without_trusted
from rthstrack.verdict.display import PANELS
from rthstrack.verdict.limits import EXCEEDED as LIMIT_EXCEEDED
from rthstrack.verdict.limits import NOT_JUDGED, Limits
from rthstrack.verdict.order import SORTED_BY
from rthstrack.verdict.recorded import assess_pair

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from rthstrack.evaluation.settings import Settings
    from rthstrack.said import Said
    from rthstrack.verdict.assessment import Assessment

FAILED, EXCEEDED = 1, 3
_FIGURES = (".png", ".pdf", ".svg")


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to the command line."""
    parser = subparsers.add_parser(
        "evaluate",
        help=COMMANDS["evaluate"],
        usage="rthstrack evaluate FILE ... [options]",
        description="Judges how well the measured displacement followed the target, in amplitude and in time "
        "(Guo, Xu and Chen 2014). A positive delay means that measured lags. "
        "Exit status: 0 everything was evaluated and is within the limits, 1 some file failed, 2 misuse, 3 a limit was "
        "exceeded or cannot be judged. Numbers may have a unit: 20ms, 0.02, 2kHz, 5%.",
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
    method.add_argument("--moving", type=seconds, metavar="S", help="length of a moving window (4 s)")
    method.add_argument("--hop", type=seconds, metavar="S", help="from one moving window to the next")
    limits = parser.add_argument_group(
        "limits", "of the whole record and of each moving window, with their intervals; in doubt they are not passed"
    )
    limits.add_argument("--limit-delay", type=seconds, metavar="S", help="largest |delay| allowed")
    limits.add_argument("--limit-amplitude", type=positive, metavar="X", help="largest |amplitude - 1| allowed")
    limits.add_argument("--critical-delay", type=seconds, metavar="S", help="delay at which the test becomes unstable")
    limits.add_argument("--critical-fraction", type=positive, metavar="X", help="share of it that a lag may reach (1)")
    limits.add_argument("--structure", metavar="CONFIG.toml", help="the tested structure, as 'rthstrack simulate' "
                        "takes it: its critical delay, and the damping that the delay takes away")  # fmt: skip
    output = parser.add_argument_group("output")
    output.add_argument("--json", action="store_true", help="print JSON instead of text")
    output.add_argument("--report", type=path(".html", ".htm"), metavar="OUT.html", help="write an interactive report")
    output.add_argument("--figure", type=path(*_FIGURES), action="append", default=[], metavar="OUT.png|pdf|svg",
                        help="write a figure for a journal; repeat for other formats")  # fmt: skip
    output.add_argument("--panels", type=panels, metavar="NAME,...", help=f"its panels, in order: {', '.join(PANELS)}")
    output.add_argument("--size", type=size, metavar="WIDTH[xHEIGHT]",
                        help="of the figure: 85mm, 85x120mm, 7.2x9in (7.2in, as high as the panels need)")  # fmt: skip
    output.add_argument("--csv", type=path(".csv"), metavar="OUT.csv",
                        help="write a row a result, and curves over frequency to OUT_frequency.csv; with --moving also "
                        "the readings, to OUT_moving.csv")  # fmt: skip
    output.add_argument("--sort", choices=SORTED_BY, default=SORTED_BY[0], metavar="BY",
                        help=f"order of many results: {', '.join(SORTED_BY)} ({SORTED_BY[0]}: failed gates first, then "
                        "the largest rms error)")  # fmt: skip
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
        import json

        from rthstrack.evaluation.results import json_ready
        from rthstrack.verdict.entry import result_entry

        document = {
            "results": [result_entry(a) for a in assessments],
            "failures": [
                {"file": file, "error": told(error), "code": error.code, "values": json_ready(error.values)}
                for file, error in failures
            ],
        }
        print(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False))
    else:
        print_text(results, len(args.files), len(failures), args.sort)
    for _, error in failures:
        print(f"rthstrack: {told(error)}", file=sys.stderr)
    for note in notes:
        print(note, file=sys.stderr)
    if failures:
        return FAILED
    return EXCEEDED if any(a.outcome in (LIMIT_EXCEEDED, NOT_JUDGED) for a in assessments) else 0


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
    origin = {
        "start_s": args.start,
        "end_s": args.end,
        "scale": dict(args.scale),
        "fill": args.fill,
        "n_filled": {c.name: recording.n_filled.get(c.path, 0) for c in (asked, answered)} if args.fill else {},
        "resample_hz": args.resample,
    }
    return assess_pair(
        recording,
        target,
        measured,
        proposal,
        settings=args.settings,
        choose=args.choose,
        tolerance=args.tolerance or TOLERANCE,
        moving_s=args.moving,
        hop_s=args.hop,
        limits=_limits(args) if part == "whole" else None,
        structure=args.test if part == "whole" else None,
        actuator=actuator,
        part=part,
        origin=origin,
    )


def _limits(args: argparse.Namespace) -> Limits:
    return Limits(args.limit_delay, args.limit_amplitude, args.critical_delay, args.critical_fraction or 1.0)


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
    if args.hop is not None and args.hop > (window_s := args.moving or MOVING_S):
        misuse(f"--hop: expected at most the length of a window, {window_s:g} s, found {args.hop:g}")
    if args.critical_fraction is not None and args.critical_delay is None and args.structure is None:
        misuse("--critical-fraction speaks of the critical delay: give --critical-delay or --structure")
    if args.critical_delay is not None and args.structure is not None:
        misuse("--structure tells the critical delay: give it or --critical-delay")
    try:
        _limits(args).check(settings.max_delay_s, "--max-delay")
    except SettingError as error:
        misuse(told(error))
    args.test = None
    if args.structure is not None:
        from rthstrack.verdict.loop import check_structure
        from rthstrack.virtual_test.configuration import read_virtual_test

        args.test = read_virtual_test(args.structure)
        try:
            check_structure(args.test)
        except SettingError as error:
            misuse(f"--structure {args.structure}: {error}")
    if args.start is not None and args.end is not None and args.start >= args.end:
        misuse(f"--start must come before --end, found {args.start:g} and {args.end:g}")
    if args.resample and (args.rate):
        misuse("--resample interpolates the file's time stamps and excludes --rate")
    if not args.figure and (args.panels is not None or args.size is not None):
        misuse("--panels and --size speak of a figure: give --figure")
    for option in ("report", "figure", "csv"):
        paths = getattr(args, option)
        for out in paths if isinstance(paths, list) else [paths]:
            if out is not None and not out.parent.is_dir():
                misuse(f"--{option}: there is no directory {out.parent}")


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
    notes: list[str] = []

    def write_others() -> None:
        if args.report is not None:
            from rthstrack.report.page import write_report

            write_report(assessments, args.report)
            notes.append(f"report written to {args.report}")
        if args.csv is not None:
            from rthstrack.cli.evaluate_tables import write_tables

            notes.extend(write_tables(args.csv, assessments, moving=args.moving is not None))

    try:
        if not args.figure:
            write_others()
            return notes
        from rthstrack.plots.page import write_figures

        figures = [one for path in args.figure for one in _figure_paths(path, assessments)]
        write_figures(figures, panels=args.panels, size_in=args.size, meanwhile=write_others)
        notes += [f"figure written to {path}" for _, path in figures]
    except OSError as error:
        raise RecordingError(f"cannot write {error.filename}: {error.strerror}") from None
    return notes


def _figure_paths(path: Path, assessments: Sequence[Assessment]) -> list[tuple[Assessment, Path]]:
    """One path an assessment: the given one where there is one, else with a number before the ending."""
    if len(assessments) == 1:
        return [(assessments[0], path)]
    return [(a, path.with_stem(f"{path.stem}_{i}")) for i, a in enumerate(assessments, start=1)]
