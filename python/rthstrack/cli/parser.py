"""What reads the command line of every command: a mistake first, then how it is used; what may have been meant."""

from __future__ import annotations

import argparse
import re
import sys
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

MISUSE = 2

# argparse looks through the disk for translations of each of its words; all of ours are English.
argparse._ = str  # type: ignore[attr-defined]


class Formatter(argparse.RawDescriptionHelpFormatter):
    """Paragraphs filled to the width, but what is indented, such as examples, as it stands."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        paragraphs = text.strip("\n").split("\n\n")
        return "\n\n".join(
            paragraph
            if any(line.startswith(" ") for line in paragraph.splitlines())
            else argparse.HelpFormatter._fill_text(self, paragraph, width, indent)
            for paragraph in paragraphs
        )


class Parser(argparse.ArgumentParser):
    """As argparse has it, but for what is said of a mistake and for a short usage."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        kwargs.setdefault("formatter_class", Formatter)
        super().__init__(*args, **kwargs)
        # -1e-3 and -5ms are values, too.
        self._negative_number_matcher = re.compile(r"^-\.?\d")

    @property
    def short_usage(self) -> str:
        """How it is used, in a line: what must be given."""
        return self.usage or " ".join([self.prog, *_needed(self._actions)])

    def format_help(self) -> str:
        """The help, with the short usage."""
        self.usage = self.short_usage.replace("%", "%%")
        return super().format_help()

    def error(self, message: str) -> NoReturn:
        """Tells a mistake and how it is used; ends the program."""
        self.exit(MISUSE, f"{self.prog}: error: {message}\n{self.hint()}\n")

    def hint(self) -> str:
        """How it is used, and who tells more."""
        return f"usage: {self.short_usage}\n{self.prog} --help tells more"

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Reads the words; one that is no option of this command is told before anything that follows from it."""
        words = list(sys.argv[1:] if args is None else args)
        self._refuse_unknown(words)
        found, left = super().parse_known_args(words, namespace)
        if left:
            self.error(f"expected nothing more, found {' '.join(map(repr, left))}")
        return found, left

    def _refuse_unknown(self, words: Sequence[str]) -> None:
        options = [option for action in self._actions for option in action.option_strings]
        has_commands = any(isinstance(action, argparse._SubParsersAction) for action in self._actions)
        for word in words:
            if word == "--" or (has_commands and not word.startswith("-")):
                return
            name = word.partition("=")[0]
            if not name.startswith("-") or name == "-" or " " in word or self._negative_number_matcher.match(name):
                continue
            known = options if name.startswith("--") else [option for option in options if not option.startswith("--")]
            # Abbreviated, or with its value behind it: -P16.
            if not any(one.startswith(name) or (len(one) == 2 and name.startswith(one)) for one in known):
                self.error(f"there is no option {name}{meant(name, known)}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        known = list(action.choices)
        near = meant(str(value), known)
        if isinstance(action, argparse._SubParsersAction):
            raise argparse.ArgumentError(None, f"there is no command {value!r}{near}; there are: {', '.join(known)}")
        raise argparse.ArgumentError(action, f"expected one of {', '.join(map(str, known))}, found {value!r}{near}")


def meant(word: str, known: Iterable[str]) -> str:
    """What may have been meant, as the end of a message; that in other letters first."""
    from rthstrack.keyed_table import suggestion

    same = [one for one in known if one.lower() == word.lower()]
    return f" (did you mean {same[0]!r}?)" if same else suggestion(word, known) if len(word) > 2 else ""


def _needed(actions: Sequence[argparse.Action]) -> Iterable[str]:
    """What must be given, as a usage has it, and what may follow."""
    last = "[options]"
    for action in actions:
        if isinstance(action, argparse._SubParsersAction):
            last = "COMMAND ..."
        elif not action.option_strings:
            shown = str(action.metavar)
            yield {"*": f"[{shown} ...]", "+": f"{shown} ..."}.get(str(action.nargs), shown)
    yield from (f"{one.option_strings[0]} {one.metavar}" for one in actions if one.required and one.option_strings)
    yield last
