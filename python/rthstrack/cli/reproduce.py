"""`rthstrack reproduce -o DIR`: the published study, figure by figure and number by number."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rthstrack.cli.commands import COMMANDS
from rthstrack.cli.progress import stages
from rthstrack.cli.quantities import hertz
from rthstrack.errors import SettingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rthstrack.ground_motion import GroundMotion
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

  rthstrack reproduce --record CANOGA=c.txt --layout values --rate 100 --unit g

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
    how = parser.add_argument_group("how these files are read", "Each for all of them, or with NAME= for one.")
    how.add_argument("--layout", action="append", type=_of(_layout), default=[], metavar="[NAME=]LAYOUT",
                     help="channels (default), or values: one record, line after line, without a time")  # fmt: skip
    how.add_argument("--rate", action="append", type=_of(hertz), default=[], metavar="[NAME=]HZ",
                     help="sampling rate, before the file's own")  # fmt: skip
    how.add_argument("--unit", action="append", type=_of(_unit), default=[], metavar="[NAME=]UNIT",
                     help="g, gal, cm/s2, m/s2, mm/s2, in/s2 or ft/s2, before the file's own")  # fmt: skip
    how.add_argument("--channel", action="append", type=_of(str), default=[], metavar="[NAME=]CHANNEL",
                     help="of a file with several: name, path or #index")  # fmt: skip
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Reproduces the study; returns the exit status."""
    from rthstrack.reproduction import reproduce

    given = _motions(args)
    with stages() as progress:
        result = reproduce(args.output, records=given, progress=progress)
    _print_text(result, args.output)
    return 0


def _motions(args: argparse.Namespace) -> dict[str, GroundMotion]:
    """The records that are given as files."""
    from rthstrack.ground_motion import read_ground_motion
    from rthstrack.reproduction.cases import checked_name

    files: dict[str, Path] = {}
    for name, file in args.record:
        checked_name(name)
        if name in files:
            raise SettingError(f"--record {name} is given twice; give every record once")
        files[name] = file
    options: dict[str, dict[str, Any]] = {name: {} for name in files}
    for option, key in (("layout", "layout"), ("rate", "rate_hz"), ("unit", "unit"), ("channel", "channel")):
        # What is said of one record goes before what is said of all.
        for name, value in sorted(getattr(args, option), key=lambda one: one[0] or ""):
            if not files or (name and name not in files):
                of = f" {name}" if name else ""
                raise SettingError(f"--{option} speaks of a file that is not given; give --record{of or ' NAME'}=FILE")
            for one in (name,) if name else files:
                options[one][key] = value
    return {name: read_ground_motion(file, **options[name]) for name, file in files.items()}


def _of(kind: Callable[[str], Any]) -> Callable[[str], tuple[str | None, Any]]:
    """An option's value, of all records or of one: VALUE or NAME=VALUE."""

    def check(text: str) -> tuple[str | None, Any]:
        name, equals, value = text.rpartition("=")
        return (name if equals else None), kind(value)

    return check


def _layout(text: str) -> str:
    if text not in ("channels", "values"):
        raise argparse.ArgumentTypeError(f"expected channels or values, found '{text}'")
    return text


def _unit(text: str) -> str:
    from rthstrack.ground_motion.files import ACCELERATION

    if ACCELERATION.unit(text) is None:
        raise argparse.ArgumentTypeError(f"expected a unit of acceleration ({ACCELERATION.unit_names}), found '{text}'")
    return text


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
