"""Writes the Python package's settings and docs/settings.md from the core's table of settings (`make settings`)."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rthstrack._core import settings_table

if TYPE_CHECKING:
    from rthstrack._core import _SettingRow

_ROOT = Path(__file__).resolve().parent.parent
SETTINGS = _ROOT / "python/rthstrack/evaluation/settings.py"
DOCUMENT = _ROOT / "docs/settings.md"

#: Wherever P may be chosen for the band.
_AUTOMATIC = "data_decimation"
_TYPES = {"choice": "str", "flag": "bool", "whole": "int", "power_of_two": "int", "band": "tuple[float, float]"}
_HEAD = '''"""How an evaluation, its moving windows and a monitor are set.

Written by `make settings` from the table of settings in the core (crates/core/src/settings.rs, moving.rs, monitor.rs):
a change belongs there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, TypedDict

from rthstrack._core import checked_settings


class _Checked:
    """Each setting is checked by itself and made a plain type; which go together is seen where they are used."""

    __slots__ = ()
    _of: ClassVar[str]

    def __post_init__(self) -> None:
        for name, value in checked_settings(self._of, self).items():
            object.__setattr__(self, name, value)
'''


def _type(row: _SettingRow) -> str:
    return _TYPES.get(row["kind"], "float") + (" | None" if row["optional"] else "")


def _literal(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _choices(row: _SettingRow) -> str:
    *others, last = row["choices"]
    return f"{', '.join(others)} or {last}"


def _about(row: _SettingRow) -> str:
    """A line of help with what it may be."""
    help = f"{row['help'].rstrip('.')}: {_choices(row)}." if row["choices"] else row["help"]
    unit = f", {row['unit']}" if row["unit"] else ""
    return f"{row['name']}{unit}: {help}"


def _wrapped(text: str, indent: int) -> str:
    return "\n".join(textwrap.wrap(text, 120 - indent, initial_indent=" " * indent, subsequent_indent=" " * indent))


def _dataclass(name: str, of: str, what: str, rows: list[_SettingRow], base: str = "_Checked") -> str:
    head = f"class {name}({base}):" if base else f"class {name}:"
    lines = ["@dataclass(frozen=True, slots=True)", head, f'    """{what}', ""]
    lines += [_wrapped(_about(row), 4) for row in rows]
    lines += ["", "    Raises SettingError.", '    """', ""]
    if of:
        lines += [f'    _of: ClassVar[str] = "{of}"', ""]
    # What must be given comes first.
    for row in sorted(rows, key=lambda row: not row["required"]):
        default = "" if row["required"] else f" = {_literal(row['default'])}"
        lines.append(f"    {row['name']}: {_type(row)}{default}")
    return "\n".join(lines)


def _keywords(name: str, what: str, rows: list[_SettingRow], base: str = "TypedDict", automatic: str = "") -> str:
    lines = [f"class {name}({base}, total=False):", f'    """{what}"""', ""]
    for row in rows:
        may_be = f"{_type(row)} | None" if row["name"] == automatic else _type(row)
        lines.append(f"    {row['name']}: {may_be}")
    return "\n".join(lines)


def settings_module() -> str:
    """The text of evaluation/settings.py."""
    evaluation, moving, monitor = (settings_table(of) for of in ("evaluation", "moving", "monitor"))
    own = [row for row in moving if row["name"] not in {other["name"] for other in evaluation}]
    factors = [row for row in evaluation if row["name"].endswith("_decimation")]
    others = [row for row in evaluation if row not in factors]
    # The subject of a study is the published average.
    study = [row.copy() for row in evaluation if row["in_study"]]
    for row in study:
        if row["name"] == "estimator":
            row["default"] = "fei"
    by_keyword = [row for row in monitor if row["name"] not in ("rate_hz", "window_s", "update_hz")]
    of_monitor = "A monitor's settings by name; P may be None, to be chosen for the band."
    parts = [
        _HEAD.rstrip("\n"),
        _dataclass("Settings", "evaluation", "How an evaluation is made.", evaluation),
        _dataclass("MovingSettings", "moving", "How moving windows are made, and each evaluated.", own, "Settings"),
        _dataclass("MonitorSettings", "monitor", "How a stream is evaluated.", monitor),
        _dataclass("StudyMethod", "", "What all cells of a study share.", study, ""),
        _keywords("StudyMethodKeywords", "The same by name.", study),
        _keywords("OtherKeywords", "Settings by name, but P and Q.", others),
        _keywords("EvaluationKeywords", "Settings by name.", factors, "OtherKeywords"),
        _keywords("MovingKeywords", "Settings of moving windows by name.", own, "EvaluationKeywords"),
        _keywords("MonitorKeywords", of_monitor, by_keyword, automatic=_AUTOMATIC),
    ]
    return "\n\n\n".join(parts) + "\n"


def _table(rows: list[_SettingRow]) -> list[str]:
    lines = ["| setting | default | expected | what it does |", "| --- | --- | --- | --- |"]
    for row in rows:
        default = "must be given" if row["required"] else "" if row["default"] is None else f"{row['default']}"
        unit = f" {row['unit']}" if row["unit"] and default and not row["required"] else ""
        may_be = row["expected"] + (", or `None`" if row["optional"] else "")
        cells = (f"`{row['name']}`", f"{default}{unit}", may_be, row["help"].replace("|", "\\|"))
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def document() -> str:
    """The text of docs/settings.md."""
    evaluation, whole_monitor = settings_table("evaluation"), settings_table("monitor")
    usual = {row["name"]: row["default"] for row in evaluation}
    moving = [row for row in settings_table("moving") if row["name"] not in usual]
    monitor = [row for row in whole_monitor if usual.get(row["name"], ...) != row["default"]]

    def listed(rows: list[_SettingRow]) -> str:
        return ", ".join(f"`{row['name']}`" for row in rows)

    shared = listed([row for row in whole_monitor if row["name"] in usual])
    lines = [
        "# Settings",
        "",
        "Written by `make settings` from the table in the core. In Python they are keywords, or a frozen `Settings`,",
        "`MonitorSettings` or `StudySettings` in their place. The command's option is the name without its unit, with",
        "dashes (`max_delay_s` is `--max-delay`), but for `-P` and `-Q`, and `--window-shape` of the monitor.",
        "",
        "## An evaluation",
        "",
        *_table(evaluation),
        "",
        f"A study takes {listed([row for row in evaluation if row['in_study']])} for all its cells.",
        "",
        "## Moving windows, beside these",
        "",
        *_table(moving),
        "",
        "## A monitor",
        "",
        f"Of those of an evaluation: {shared}; where the default is another, it is here.",
        "",
        *_table(monitor),
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    SETTINGS.write_text(settings_module(), encoding="utf-8")
    DOCUMENT.write_text(document(), encoding="utf-8")
