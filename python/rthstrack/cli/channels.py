"""`rthstrack channels FILE...`: what is in a file."""

from __future__ import annotations

import json
import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.cli.arguments import add_part, files_in, told
from rthstrack.cli.commands import COMMANDS
from rthstrack.errors import ChannelError, RecordingError
from rthstrack.recording.pairing import propose_pair
from rthstrack.recording.readers import FORMAT_NAMES, read_contents
from rthstrack.recording.reading import recording_from
from rthstrack.recording.recording import OwnTime, Recording

if TYPE_CHECKING:
    import argparse


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to the command line."""
    parser = subparsers.add_parser(
        "channels",
        help=COMMANDS["channels"],
        description=f"Lists the channels of recorded files ({', '.join(FORMAT_NAMES)}), their "
        "units, ranges and missing samples, the sampling rate and where it comes from, and the likely "
        "target/measured pair. Exit status: 0 all files were read, 1 some file could not be read, 2 misuse.",
    )
    parser.add_argument("files", nargs="+", metavar="FILE", help="file to list, or a folder of files")
    add_part(parser)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Lists the files; returns the exit status."""
    listed: list[dict[str, Any]] = []
    failures: list[dict[str, str]] = []
    for file in files_in(args.files):
        try:
            listed.append(_listing(file, args.block, args.lines))
        except RecordingError as error:
            failures.append({"file": file, "error": told(error)})
        else:
            if not args.json:
                print(_table(listed[-1]))
    if args.json:
        print(json.dumps({"files": listed, "failures": failures}, indent=2, ensure_ascii=False))
    else:
        for failure in failures:
            print(f"rthstrack: {failure['error']}", file=sys.stderr)
    return 1 if failures else 0


def _listing(file: str, block: int | None, lines: tuple[int, int] | None) -> dict[str, Any]:
    """A file as the JSON shows it. A rate that cannot be settled is told, and no reason not to list the channels."""
    contents = read_contents(file, block=block, lines=lines)
    problem = None
    try:
        recording = recording_from(contents, file)
    except RecordingError as error:
        problem = told(error, with_file=False)
        recording = recording_from(contents, file, rate_hz=1.0)
        recording = Recording(file, recording.format, recording.channels, None, problem, 0.0, contents.notes)
    why: str
    try:
        pairs, why = propose_pair(recording)
    except ChannelError as error:
        pairs, why = [], told(error, with_file=False)
    return {
        "file": file,
        "format": recording.format,
        "rate_hz": recording.rate_hz,
        "rate_source": recording.rate_source,
        "start_s": recording.start_s,
        "channels": [
            {
                "index": i,
                "name": channel.name,
                "path": channel.path,
                "unit": channel.unit,
                "n_samples": len(channel.values),
                **({} if channel.time is None else _own(channel.time)),
                **_range(channel.values),
            }
            for i, channel in enumerate(recording.channels)
        ],
        "proposed": [
            {"actuator_number": number, "target": target, "measured": measured}
            for number, (target, measured) in enumerate(pairs, start=1)
        ],
        "proposal": why,
        "notes": list(recording.notes),
    }


def _own(time: OwnTime) -> dict[str, Any]:
    """A channel's own clock, where a file has several."""
    return {"rate_hz": time.rate_hz, "start_s": time.start_s, "rate_source": time.source}


def _range(values: np.ndarray[Any, np.dtype[np.float64]]) -> dict[str, float | int | None]:
    """Least and greatest finite sample (None if there is none), and how many samples are NaN or infinite."""
    finite = values[np.isfinite(values)] if not np.isfinite(values).all() else values
    n_nan = int(np.count_nonzero(np.isnan(values)))
    return {
        "min": float(finite.min()) if finite.size else None,
        "max": float(finite.max()) if finite.size else None,
        "n_nan": n_nan,
        "n_infinite": len(values) - len(finite) - n_nan,
    }


def _table(listing: dict[str, Any]) -> str:
    """A file as text: one line per channel, then the rate, the proposed pair and the notes."""
    rows = [("", "channel", "unit", "samples", "min", "max", "NaN")]
    for channel in listing["channels"]:
        name = channel["name"] if channel["name"] == channel["path"] else f"{channel['name']}  ({channel['path']})"
        rows.append(
            (
                f"#{channel['index']}",
                name,
                channel["unit"] or "-",
                str(channel["n_samples"]),
                _number(channel["min"]),
                _number(channel["max"]),
                str(channel["n_nan"]) + (f" (+{channel['n_infinite']} inf)" if channel["n_infinite"] else ""),
            )
        )
    widths = [max(len(row[i]) for row in rows) for i in range(7)]
    lines = [f"{listing['file']}: {listing['format']}"]
    for row in rows:
        cells = [
            text.ljust(w) if i in (1, 2) else text.rjust(w) for i, (text, w) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  " + "  ".join(cells).rstrip())
    rate = listing["rate_hz"]
    lines.append(f"  rate: {f'{rate:.10g} Hz, from ' if rate else 'not known: '}{listing['rate_source']}")
    pairs = [f"--target '{p['target']}' --measured '{p['measured']}'" for p in listing["proposed"]]
    if len(pairs) > 1:
        lines.append(f"  likely pairs ({listing['proposal']}):")
        lines += [
            f"    actuator {i} ({p['target']}): {pair}"
            for i, (p, pair) in enumerate(zip(listing["proposed"], pairs, strict=True), start=1)
        ]
    else:
        lines.append(f"  likely pair: {pairs[0]} ({listing['proposal']})" if pairs else f"  {listing['proposal']}")
    lines += [f"  note: {note}" for note in listing["notes"]]
    return "\n".join(lines)


def _number(value: float | None) -> str:
    return "-" if value is None or not math.isfinite(value) else f"{value:.6g}"
