"""The on-line monitor: what stands around the compiled `Live`. `page` shows a run in browsers."""

from __future__ import annotations

import unicodedata


def printable(text: str) -> str:
    """A text of somebody else's with what would command a terminal, or hide in a line, written as an escape."""
    if text.isprintable():
        return text
    harmful = ("Cc", "Cf", "Cs", "Zl", "Zp")
    return "".join(c.encode("unicode_escape").decode() if unicodedata.category(c) in harmful else c for c in text)
