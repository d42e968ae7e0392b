"""Words that carry what they say as code and values, so that nobody needs to read them to decide."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rthstrack.errors import RthstrackError


class Said(str):
    """A warning, a reason or a note: a text with a code that never changes and with what it says in numbers (SI units).

    `cause` is the part of the text that another sentence may quote: without its heading and without advice.
    """

    __slots__ = ("cause", "code", "values")

    code: str
    values: tuple[float, ...]
    cause: str

    def __new__(cls, words: str, code: str, values: Iterable[float] = (), cause: str | None = None) -> Said:
        said = super().__new__(cls, words)
        for name, value in (
            ("code", code),
            ("values", tuple(map(float, values))),
            ("cause", str(words) if cause is None else str(cause)),
        ):
            object.__setattr__(said, name, value)
        return said

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"a text cannot be changed: {name}")

    def __reduce__(self) -> tuple[Any, ...]:
        return Said, (str(self), self.code, self.values, self.cause)


def undetermined(why: str, code: str, values: Iterable[float] = ()) -> Said:
    """That something is not determined, and why."""
    return Said(f"not determined: {why}", code, values, why)


def failed(error: RthstrackError) -> Said:
    """That something is not determined, as it was refused."""
    return undetermined(str(error), error.code, error.values)


def of_core(words: str, code: str, values: Iterable[float]) -> Said:
    """A reason of the core, which has a heading: what is missing, then why."""
    return Said(words, code, values, words.partition(": ")[2])


def coded(words: str, code: str = "note") -> Said:
    """A text with its code, or with this one where it has none: a reader's note, or what a caller put there."""
    return words if isinstance(words, Said) else Said(words, code)
