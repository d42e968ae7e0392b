"""The exceptions of rthstrack, all under one base class, and what may stand in a message.

Every message is one line: what was wrong, what was expected, what was found, what to do.
"""

from __future__ import annotations

import math
import os
import re
import unicodedata
from typing import TYPE_CHECKING, Any, Self

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

    code: a name of its kind that never changes. values: what it says in numbers. file: of which file it speaks, which
    its text begins with. words: its text without the file. `advice` says what to do; the arguments that it speaks of
    stand in braces, so that a command can name its options.
    """

    code = "error"
    file = ""
    values: tuple[float, ...] = ()
    advice = ""

    def __init__(
        self,
        *words: Any,
        file: str | os.PathLike[str] = "",
        code: str | None = None,
        values: tuple[float, ...] | None = None,
        advice: str = "",
    ) -> None:
        super().__init__(*words)
        self.about(file)
        if code is not None:
            self.code = code
        if values is not None:
            self.values = values
        if advice:
            self.advice = advice

    @property
    def words(self) -> str:
        """What is wrong, without the file."""
        return self._advised({})

    def __str__(self) -> str:
        return f"{self.file}: {self.words}" if self.file else self.words

    def told(self, names: Mapping[str, str], *, with_file: bool = True) -> str:
        """The message with its advice, arguments called as `names` has them."""
        if not self.advice:
            return str(self) if with_file else self.words
        text = self._advised(names)
        return f"{self.file}: {text}" if self.file and with_file else text

    def _advised(self, names: Mapping[str, str]) -> str:
        text = super().__str__()
        if not self.advice:
            return text
        return f"{text}; {re.sub(r'{(.*?)}', lambda found: names.get(found[1], found[1]), self.advice)}"

    def about(self, file: str | os.PathLike[str]) -> Self:
        """The same error; it speaks of this file unless it speaks of one already."""
        self.file = self.file or os.fspath(file)
        return self

    def reworded(self, words: str) -> Self:
        """The same error in other words."""
        self.args = (words,)
        return self


class SignalError(RthstrackError, ValueError):
    """The samples cannot be judged: lengths differ, NaN, constant target, too few samples."""

    code = "signal"


class SettingError(RthstrackError, ValueError):
    """A setting is not possible: P, Q, band, window, rate."""

    code = "setting"


class UnknownSettingError(SettingError, TypeError):
    """There is no setting of this name."""

    code = "unknown_setting"


class ConfigurationError(SettingError):
    """A configuration is wrong: `mistakes` are all (key, message), the text one line each, the file's name first."""

    code = "configuration"

    def __init__(self, file: str | os.PathLike[str], mistakes: Iterable[tuple[str, str]]) -> None:
        self.mistakes = tuple(mistakes)
        super().__init__(os.fspath(file), self.mistakes, file=file)

    @property
    def words(self) -> str:
        """A line a mistake."""
        return "\n".join(": ".join(filter(None, mistake)) for mistake in self.mistakes)

    def __str__(self) -> str:
        return "\n".join(": ".join(filter(None, (self.file, *mistake))) for mistake in self.mistakes)


class UnstableError(RthstrackError):
    """A virtual test left its bounds at `time_s`.

    critical_delay_s: None where it is not known, infinite where no delay is too long.
    """

    code = "unstable"

    def __init__(self, what: str, time_s: float, critical_delay_s: float | None = None) -> None:
        self.time_s = time_s
        self.critical_delay_s = critical_delay_s
        super().__init__(what, time_s, critical_delay_s, values=(time_s,))

    @property
    def words(self) -> str:
        """When and why it left them, and what is known of the critical delay."""
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

    code = "recording"


class ChannelError(RecordingError, LookupError):
    """A channel is unknown, ambiguous, or no target/measured pair can be proposed."""

    code = "channel"
