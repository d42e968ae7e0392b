"""Text for people on standard output."""

from __future__ import annotations

import sys
from typing import Any, NoReturn

from rich.console import Console as RichConsole


class Console(RichConsole):
    """As wide as the terminal; into a file or pipe nothing is folded at a terminal's width, unless told otherwise."""

    def __init__(self, **how: Any) -> None:
        usual: dict[str, Any] = {"soft_wrap": True, "width": None if sys.stdout.isatty() else 200}
        super().__init__(highlight=False, **(usual | how))

    def on_broken_pipe(self) -> NoReturn:
        """Whoever read it has had enough: for `main` to end it."""
        self.quiet = True
        raise BrokenPipeError
