"""Options of the command for settings: names, values and help come from the core's table."""

from __future__ import annotations

import argparse
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from rthstrack._core import checked_settings, settings_table
from rthstrack.cli.parser import meant
from rthstrack.cli.quantities import number
from rthstrack.errors import SettingError
from rthstrack.evaluation.inputs import merged
from rthstrack.evaluation.presets import PRESETS
from rthstrack.evaluation.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from rthstrack._core import _SettingRow

#: What the command calls otherwise than the library, but for unit and dashes.
_NAMES = {"data_decimation": "-P", "frequency_decimation": "-Q"}
_METAVARS = {"whole": "N", "power_of_two": "N", "share": "X"}
#: What `choose` of the library calls these.
FACTORS = {"data_decimation": "P", "frequency_decimation": "Q"}


@dataclass(frozen=True, slots=True)
class SettingOption:
    """One option: `name` is the setting's."""

    name: str
    flag: str
    read: Callable[[str], Any]
    metavar: str | tuple[str, str]
    help: str

    def add_to(self, group: argparse._ArgumentGroup) -> None:
        """Adds it; where it is not given, the parsed arguments do not have it."""
        kind: dict[str, Any] = {"nargs": 2} if isinstance(self.metavar, tuple) else {}
        group.add_argument(self.flag, dest=self.name, type=self.read, default=argparse.SUPPRESS,
                           metavar=self.metavar, help=self.help, **kind)  # fmt: skip


def setting_options(
    of: str, *, flags: Mapping[str, str] | None = None, defaults: Mapping[str, str] | None = None
) -> Iterator[SettingOption]:
    """The options of "evaluation" or "monitor"; the command's own flags and defaults are told by the setting's name."""
    for row in settings_table(of):
        name = row["name"]
        flag = (flags or {}).get(name) or option_name(name)
        metavar: str | tuple[str, str] = _metavar(row)
        yield SettingOption(name, flag, _reader(of, row), metavar, _help(row, (defaults or {}).get(name)))


def option_name(setting: str) -> str:
    """The option of a setting: --max-delay of max_delay_s."""
    plain = re.sub(r"_(s|hz)$", "", setting).replace("_", "-")
    return _NAMES.get(setting, f"--{plain}")


def with_auto(option: SettingOption) -> SettingOption:
    """The same, which may be left to the program too: None."""

    def read(text: str) -> Any:
        try:
            return None if text == "auto" else option.read(text)
        except argparse.ArgumentTypeError:
            raise argparse.ArgumentTypeError(
                f"expected a power of two (1, 2, 4, ...) or auto, found '{text}'"
            ) from None

    return replace(option, read=read, help=f"{option.help}; auto: as --tolerance allows")


def spoken(message: str) -> str:
    """A message of the library with the command's options in place of the names of its settings."""
    names = {row["name"] for of in ("evaluation", "monitor", "alarms") for row in settings_table(of)} | {
        "weight_powers"
    }
    return re.sub(
        r"\b(\w+)\b", lambda word: option_name(word[1]) if word[1] in names and "_" in word[1] else word[1], message
    )


def settle(args: argparse.Namespace) -> None:
    """Makes `settings` of preset and options, and `choose` of those factors that are left to the program."""
    given = {one.name: getattr(args, one.name) for one in setting_options("evaluation") if hasattr(args, one.name)}
    args.choose = tuple(letter for name, letter in FACTORS.items() if name in given and given[name] is None)
    given |= {name: 1 for name in FACTORS if name in given and given[name] is None}
    args.settings = merged(Settings, PRESETS.get(args.preset), given)


def _metavar(row: _SettingRow) -> str | tuple[str, str]:
    if row["kind"] == "band":
        return "LO", "HI"
    if row["kind"] == "choice":
        return row["name"][0].upper()
    return _METAVARS.get(row["kind"]) or row["unit"].upper() or "X"


def _reader(of: str, row: _SettingRow) -> Callable[[str], Any]:
    """From a word of the command line, checked by the core; what does not fit says what is expected."""

    def read(text: str) -> Any:
        value = _value(row, text)
        try:
            checked_settings(of, {row["name"]: (value, value) if row["kind"] == "band" else value})
        except SettingError:
            near = meant(text, row["choices"])
            raise argparse.ArgumentTypeError(f"expected {row['expected']}, found '{text}'{near}") from None
        return value

    return read


def _value(row: _SettingRow, text: str) -> str | int | float:
    """What a word is for a setting of this kind; a word that is no whole number stays one."""
    if row["kind"] == "choice":
        return text
    if row["kind"] in ("whole", "power_of_two"):
        return int(text) if text.isascii() and text.isdigit() else text
    return number(text, row["unit"], row["expected"])


def _help(row: _SettingRow, default: str | None) -> str:
    """The line of the table, with choices and default."""
    text = row["help"].rstrip(".")
    text = text if text[:2] in ("P,", "Q,") or text[:2] == "l " else text[:1].lower() + text[1:]
    if row["choices"]:
        usual = row["default"] if default is None else default
        *others, last = (f"{one} (default)" if one == usual else one for one in row["choices"])
        return f"{', '.join(others)} or {last}: {text}".replace("%", "%%")
    if default is None:
        value, unit = row["default"], row["unit"] and f" {row['unit']}"
        default = None if value is None or row["required"] else f"{value:g}{unit}"
    return (text if default is None else f"{text} ({default})").replace("%", "%%")
