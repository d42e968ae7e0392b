"""The exceptions of rthstrack, all under one base class.

Every message is one line: what was wrong, what was expected, what was found, what to do.
"""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from collections.abc import Iterable


class RthstrackError(Exception):
    """Base class of every error that rthstrack raises on purpose.

    code: a name of its kind that never changes. values: what it says in numbers. file: of which file it speaks, which
    its text begins with. words: its text without the file.
    """

    code = "error"
    file = ""
    values: tuple[float, ...] = ()

    def __init__(
        self,
        *words: Any,
        file: str | os.PathLike[str] = "",
        code: str | None = None,
        values: tuple[float, ...] | None = None,
    ) -> None:
        super().__init__(*words)
        self.about(file)
        if code is not None:
            self.code = code
        if values is not None:
            self.values = values

    @property
    def words(self) -> str:
        """What is wrong, without the file."""
        return super().__str__()

    def __str__(self) -> str:
        return f"{self.file}: {self.words}" if self.file else self.words

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
