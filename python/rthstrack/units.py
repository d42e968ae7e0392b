"""Units: what a channel's name says of its unit, and how lengths and times convert. The table is the core's."""

from __future__ import annotations

import re

from rthstrack._core import is_unit_suffix
from rthstrack._core import unit as core_unit


def quantity(unit: str | None) -> str | None:
    """What a unit measures ("length", "time", "acceleration", ..., "other"), or None if it is not known."""
    found = core_unit(unit) if unit else None
    return found[0] if found else None


def size_in_si(unit: str | None, measures: str) -> float | None:
    """How many of the SI's unit are in one `unit`, or None unless it measures this."""
    found = core_unit(unit) if unit else None
    return found[1] if found and found[0] == measures else None


def is_unit(text: str) -> bool:
    """Whether a text is a unit: a known symbol, or known symbols with powers, joined by / * . or ^."""
    return core_unit(text) is not None


def length_factor(unit_a: str | None, unit_b: str | None) -> float | None:
    """How many `unit_b` are in one `unit_a`, or None unless both are lengths."""
    a, b = (size_in_si(unit, "length") for unit in (unit_a, unit_b))
    return a / b if a and b else None


def seconds_in(unit: str | None) -> float | None:
    """How many seconds are in one `unit`, or None if it is not a unit of time."""
    return size_in_si(unit, "time")


def is_length(unit: str | None) -> bool:
    """Whether a unit is a known unit of length."""
    return quantity(unit) == "length"


# Brackets as wide as the characters of Chinese and Japanese names.
_WIDE_BRACKETS = str.maketrans("（）［］【】", "()[][]")


def split_unit(name: str) -> tuple[str, str | None]:
    """A name without its unit, and that: `Disp (mm)`, `Disp [mm]`, `Disp, mm`, `Disp / mm`, `Disp mm`, `disp_mm` ..."""
    name = name.translate(_WIDE_BRACKETS)
    found = re.fullmatch(r"(.*\S)\s*\[([^\[\]]{1,16})\]", name)
    # An index ([:,0]) is no unit.
    if found and re.search(r"[^\W\d_]|[%°-]", found[2]):
        return found[1], found[2].strip()
    found = re.fullmatch(r"(.*\S)\s*\(([^()]{1,16})\)", name)
    found = found or re.fullmatch(r"(.*\S)(?:\s*,|\s+/)\s+(\S{1,8})", name)
    if found and is_unit(found[2]):
        return found[1], found[2].strip()
    stem, _, suffix = name.partition("/")
    # A single letter, in and min are rather the last part of a path; before m/s^2 stands a blank.
    if stem and len(suffix) > 1 and suffix not in ("in", "min") and is_unit(suffix) and not is_unit(stem.split()[-1]):
        return stem.rstrip(), suffix.strip()
    found = re.fullmatch(r"(.*\S)\s+(\S{2,4})", name)
    if found and is_unit_suffix(found[2]):
        return found[1], found[2]
    stem, _, suffix = name.rpartition("_")
    if stem and is_unit_suffix(suffix):
        return stem, suffix
    if stem and suffix in ("in", "inch") and re.search(r"disp|stroke|pos|cmd|meas|targ|fbk|lvdt", stem.lower()):
        return stem, suffix
    return name, None


def stem_and_unit(names: list[str]) -> list[tuple[str, str | None]]:
    """Each name without its unit, and the unit; the name whole where it states none."""
    units = units_from_names(names)
    return [(split_unit(name)[0], unit) if unit else (name, None) for name, unit in zip(names, units, strict=True)]


def units_from_names(names: list[str]) -> list[str | None]:
    """The unit that each name states. `x_m` beside `x_t` or `x_c` is measured beside target, not metres."""
    given = set(names)
    units: list[str | None] = []
    for name in names:
        stem, unit = split_unit(name)
        if unit == "m" and name.endswith("_m") and any(f"{stem}_{role}" in given for role in "tcdr"):
            unit = None
        units.append(unit)
    return units
