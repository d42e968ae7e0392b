"""Lines and small tables for people on standard output: what `evaluate` prints, without waiting for rich."""

from __future__ import annotations

import os
import re
import sys
import unicodedata
from itertools import zip_longest
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Sequence

#: A text, or one with its style.
Piece: TypeAlias = "str | tuple[str, str]"

_CODES = {"bold": "1", "dim": "2", "red": "31", "green": "32", "yellow": "33"}
_BETWEEN = "  "
# As rich has it, of whatever is no terminal.
_PIPE_WIDTH = 200


class Lines:
    """Standard output: lines are left to the terminal to fold, tables are folded to its width, or to 200 in a pipe."""

    def __init__(self) -> None:
        self._is_terminal = sys.stdout.isatty()
        self.width = self.told_width() if self._is_terminal else _PIPE_WIDTH
        plain = os.environ.get("NO_COLOR") or os.environ.get("TERM", "").lower() in ("dumb", "unknown")
        # An older console of Windows shows codes as they are.
        self._styled = self._is_terminal and not plain and (os.name != "nt" or "WT_SESSION" in os.environ)

    def told_width(self) -> int:
        """What COLUMNS says, or else the terminal's width."""
        told = os.environ.get("COLUMNS", "")
        if told.isascii() and told.isdigit() and int(told):
            return int(told)
        try:
            return os.get_terminal_size(sys.__stdout__.fileno()).columns or 80  # type: ignore[union-attr]
        except (AttributeError, ValueError, OSError):
            return 80

    def line(self, *pieces: Piece) -> None:
        """Prints them as one line."""
        print("".join(self._shown(piece) for piece in pieces))

    def table(self, rows: Sequence[Sequence[str]], head: Sequence[str] = ()) -> None:
        """Prints rows whose first cell is a label; the widest of the others are folded where there is no room."""
        every = [*([head] if head else []), *rows]
        widths = [max(map(cells, column)) for column in zip(*every, strict=True)]
        room = self.width - len(_BETWEEN) * (len(widths) - 1)
        while sum(widths) > room and max(widths[1:]) > _LEAST:
            widths[max(range(1, len(widths)), key=widths.__getitem__)] -= 1
        for row in every:
            first_style, style = ("bold", "bold") if row is head else ("dim", "")
            for parts in zip_longest(*map(_folded, row, widths), fillvalue=""):
                label, *others = (part + " " * (width - cells(part)) for part, width in zip(parts, widths, strict=True))
                self.line((label, first_style), *(piece for one in others for piece in (_BETWEEN, (one, style))))

    def _shown(self, piece: Piece) -> str:
        text, style = (piece, "") if isinstance(piece, str) else piece
        if not (self._styled and style and text):
            return text
        return f"\x1b[{';'.join(_CODES[word] for word in style.split())}m{text}\x1b[0m"


# No column is folded to less.
_LEAST = 16


def cells(text: str) -> int:
    """How many places of a terminal a text takes."""
    if text.isascii():
        return len(text)
    wide = sum(unicodedata.east_asian_width(one) in "WF" for one in text)
    return len(text) + wide - sum(map(bool, map(unicodedata.combining, text)))


def _folded(text: str, width: int) -> list[str]:
    """The text as lines of no more places than `width`, between words where that can be."""
    lines: list[str] = []
    for paragraph in text.split("\n"):
        line = ""
        for word in re.findall(r"\s*\S+\s*", paragraph):
            if line and cells(line) + cells(word.rstrip()) > width:
                lines.append(line.rstrip())
                line = ""
            rest = word
            while cells(rest.rstrip()) > width:
                n = next(i for i in range(len(rest), 0, -1) if i == 1 or cells(rest[:i]) <= width)
                lines.append(rest[:n])
                rest = rest[n:]
            line += rest
        lines.append(line.rstrip())
    return lines
