"""The command `rthstrack`: one file a command, each with `add_parser` and `run`; only the one asked for is loaded."""

from __future__ import annotations

import gc
import os
import sys
from importlib import import_module
from typing import TYPE_CHECKING

# Before NumPy is loaded: its products here are of a few rows, and the threads that BLAS keeps for large ones wait by
# spinning, which costs a core more than they save.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from rthstrack._core import __version__
from rthstrack.cli.commands import COMMANDS
from rthstrack.cli.parser import MISUSE, Parser
from rthstrack.errors import ConfigurationError, RthstrackError, SettingError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

INTERRUPTED, BROKEN_PIPE = 130, 141


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line; returns the exit status: 0 done, 1 some file failed, 2 misuse, 3 a limit was exceeded."""
    try:
        try:
            return _run(sys.argv[1:] if argv is None else argv)
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except BrokenPipeError:
        # Whoever read the output has had enough; nothing more may be written, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except KeyboardInterrupt:
        print("rthstrack: interrupted", file=sys.stderr)
        return INTERRUPTED


def _run(words: Sequence[str]) -> int:
    parser = Parser(
        prog="rthstrack",
        description="Did the actuator do what the simulation asked? Gain and delay of actuator tracking.",
    )
    parser.add_argument("--version", action="version", version=f"rthstrack {__version__}")
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    asked = next((word for word in words if not word.startswith("-")), None)
    for name, line in COMMANDS.items():
        if name == asked:
            _loaded(name).add_parser(subparsers)
        else:
            subparsers.add_parser(name, help=line)
    args = parser.parse_args(words)
    try:
        status: int = args.run(args)
    except RthstrackError as error:
        from rthstrack.cli.arguments import told

        for line in told(error).splitlines():
            print(f"rthstrack: {line}", file=sys.stderr)
        if not isinstance(error, SettingError):
            return 1
        # What a file says wrong is no matter of how the command is used.
        if asked is not None and not isinstance(error, ConfigurationError):
            print(subparsers.choices[asked].hint(), file=sys.stderr)
        return MISUSE
    return status


def _loaded(name: str) -> ModuleType:
    """A command's module. What is loaded stays, so that nothing of it is looked through for garbage, then or later."""
    collected = gc.isenabled()
    gc.disable()
    try:
        return import_module(f"{__name__}.{name}")
    finally:
        if collected:
            gc.freeze()
            gc.enable()
