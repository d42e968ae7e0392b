"""`rthstrack reproduce -o DIR`: the published study, figure by figure and number by number."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from rthstrack.cli.commands import COMMANDS
from rthstrack.cli.progress import stages
from rthstrack.errors import SettingError

if TYPE_CHECKING:
    from rthstrack.reproduction import Reproduction

_DESCRIPTION = """\
Runs the virtual tests of Guo, Xu and Chen (2014), Smart Structures and Systems 14(6), 1197-1220,
evaluates them as the paper did, and writes its Figures 1 to 23 and Tables 1 to 3 (PDF, PNG, and
CSV of what is drawn), and every quantitative statement of the paper beside ours (claims.md,
claims.csv). Takes a minute or two; computing times are measured one call at a time, so leave the
machine alone meanwhile.

The ground motions CHY101-N and, in place of MU2035 and Canoga Park, MUL009 and MUL279 come from
the extra rthstrack[records]. Whoever has the paper's records gives them with --record.
"""
_EPILOG = """\
examples:
  rthstrack reproduce -o paper
  rthstrack reproduce -o paper --record MU2035=NORTHR_MU2035.AT2

Files of the same names in DIR are overwritten, no others.
Exit status: 0 done, 1 a record cannot be had or read, or a file not be written, 2 misuse.
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to the command line."""
    parser = subparsers.add_parser(
        "reproduce",
        help=COMMANDS["reproduce"],
        description=_DESCRIPTION,
        epilog=_EPILOG,
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="folder to write; made if need be"
    )
    parser.add_argument("--record", action="append", type=_record, default=[], metavar="NAME=FILE",
                        help="ground motion for CHY101-N, MU2035 or CANOGA: PEER AT2, or text, MAT, ...")  # fmt: skip
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Reproduces the study; returns the exit status."""
    from rthstrack.reproduction import reproduce

    given: dict[str, Path] = {}
    for name, file in args.record:
        if name in given:
            raise SettingError(f"--record {name} is given twice; give every record once")
        given[name] = file
    with stages() as progress:
        result = reproduce(args.output, records=given, progress=progress)
    _print_text(result, args.output)
    return 0


def _record(text: str) -> tuple[str, Path]:
    name, equals, file = text.partition("=")
    if not (name and equals and file):
        raise argparse.ArgumentTypeError(f"expected NAME=FILE, found '{text}'")
    return name, Path(file)


def _print_text(result: Reproduction, out: Path) -> None:
    """What was used, how the statements came out, and where everything is."""
    from rthstrack.reproduction.claims import MEANINGS

    for used in result.records.values():
        print(f"{used.name}: {used.remark or used.motion.source}")
    claims = result.claims
    count = Counter(claim.verdict for claim in claims)
    found = ", ".join(f"{count[verdict]} {verdict}" for verdict in MEANINGS if count[verdict])
    print(f"{len(claims)} statements of the paper: {found}")
    print(f"see {out / 'claims.md'}; figures and tables beside it")
