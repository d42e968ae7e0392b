"""What commands have in common that run until they are told to end."""

from __future__ import annotations

import contextlib
import signal
import sys
from typing import Any

from rthstrack.errors import printable


class Ended:
    """Whether SIGINT, SIGTERM or the loss of the terminal has asked for the end; within `with`."""

    def __init__(self) -> None:
        self.asked = False
        self._before: dict[Any, Any] = {}

    def __enter__(self) -> Ended:
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            # nohup means what it says.
            if number is None or (name == "SIGHUP" and signal.getsignal(number) == signal.SIG_IGN):
                continue
            # Only the main thread may; elsewhere whoever runs this has its own ways.
            with contextlib.suppress(ValueError):
                self._before[number] = signal.signal(number, self._ask)
        return self

    def _ask(self, *_: object) -> None:
        self.asked = True

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


def say(line: str) -> None:
    """A line on standard error, whatever a sender has put into it. Whoever read it may be gone; the test is not."""
    with contextlib.suppress(OSError, ValueError):
        print(f"rthstrack: {printable(line)}", file=sys.stderr, flush=True)
