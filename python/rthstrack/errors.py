"""The exceptions of rthstrack, all under one base class, and what may stand in a message.

Every message is one line: what was wrong, what was expected, what was found, what to do.
"""

from __future__ import annotations

import math
import os
import re
import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


def printable(text: str) -> str:
    """A text of somebody else's with what would command a terminal, or hide in a line, written as an escape."""
    if text.isprintable():
        return text
    harmful = ("Cc", "Cf", "Cs", "Zl", "Zp")
    return "".join(c.encode("unicode_escape").decode() if unicodedata.category(c) in harmful else c for c in text)


class RthstrackError(Exception):
    """Base class of every error that rthstrack raises on purpose.

    `advice` says what to do; the arguments that it speaks of stand in braces, so that a command can name its options.
    """

    def __init__(self, *args: object, advice: str = "") -> None:
        self.advice = advice
        super().__init__(*args)

    def __str__(self) -> str:
        return self.told({}) if self.advice else super().__str__()

    def told(self, names: Mapping[str, str]) -> str:
        """The message with its advice, arguments called as `names` has them."""
        if not self.advice:
            return str(self)
        return f"{self.args[0]}; {re.sub(r'{(.*?)}', lambda found: names.get(found[1], found[1]), self.advice)}"


class SignalError(RthstrackError, ValueError):
    """The samples cannot be judged: lengths differ, NaN, constant target, too few samples."""


class SettingError(RthstrackError, ValueError):
    """A setting is not possible: P, Q, band, window, rate."""


class ConfigurationError(SettingError):
    """A configuration is wrong: `mistakes` are all (key, message), the text one line each, the file's name first."""

    def __init__(self, file: str | os.PathLike[str], mistakes: Iterable[tuple[str, str]]) -> None:
        self.file = os.fspath(file)
        self.mistakes = tuple(mistakes)
        super().__init__(self.file, self.mistakes)

    def __str__(self) -> str:
        return "\n".join(": ".join(filter(None, (self.file, *mistake))) for mistake in self.mistakes)


class UnstableError(RthstrackError):
    """A virtual test left its bounds at `time_s`.

    critical_delay_s: None where it is not known, infinite where no delay is too long.
    """

    def __init__(self, what: str, time_s: float, critical_delay_s: float | None = None) -> None:
        self.time_s = time_s
        self.critical_delay_s = critical_delay_s
        super().__init__(what, time_s, critical_delay_s)

    def __str__(self) -> str:
        critical = self.critical_delay_s
        if critical is None:
            told = "its critical delay is not known"
        elif critical == 0:
            told = "it is unstable without any delay"
        else:
            told = (
                f"its critical delay is {1e3 * critical:.4g} ms"
                if math.isfinite(critical)
                else "no delay alone does that"
            )
        return f"unstable: {self.args[0]} after {self.time_s:.4g} s; {told}"


class RecordingError(RthstrackError):
    """A file cannot be read as a recording, or what was asked of it is not in it."""


class ChannelError(RecordingError, LookupError):
    """A channel is unknown, ambiguous, or no target/measured pair can be proposed."""
