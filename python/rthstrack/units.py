"""Units: what a channel's name says of its unit, and how lengths and times convert."""

from __future__ import annotations

import re

_METRES = {
    "m": 1.0,
    "meter": 1.0,
    "meters": 1.0,
    "metre": 1.0,
    "metres": 1.0,
    "mm": 1e-3,
    "millimeter": 1e-3,
    "millimeters": 1e-3,
    "millimetre": 1e-3,
    "millimetres": 1e-3,
    "cm": 1e-2,
    "centimeter": 1e-2,
    "centimeters": 1e-2,
    "um": 1e-6,
    "µm": 1e-6,
    "micron": 1e-6,
    "microns": 1e-6,
    "in": 0.0254,
    "inch": 0.0254,
    "inches": 0.0254,
    '"': 0.0254,
    "ft": 0.3048,
    "foot": 0.3048,
    "feet": 0.3048,
}
_SECONDS = {
    "s": 1.0,
    "sec": 1.0,
    "secs": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "sekunden": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
    "millisecond": 1e-3,
    "milliseconds": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "usec": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "minutes": 60.0,
    "h": 3600.0,
    "hours": 3600.0,
}
_OTHERS = {
    "n",
    "kn",
    "mn",
    "lbf",
    "lb",
    "lbs",
    "kip",
    "kips",
    "kgf",
    "g",
    "gal",
    "v",
    "mv",
    "kv",
    "a",
    "ma",
    "%",
    "deg",
    "°",
    "°c",
    "c",
    "k",
    "rad",
    "mrad",
    "hz",
    "khz",
    "pa",
    "kpa",
    "mpa",
    "gpa",
    "bar",
    "psi",
    "nm",
    "knm",
    "j",
    "w",
    "kw",
    "kg",
    "t",
    "strain",
    "ustrain",
    "µstrain",
    "µε",
    "l",
    "rpm",
    "counts",
    "bit",
}
_BASE = _METRES.keys() | _SECONDS.keys() | _OTHERS
# Suffixes behind an underscore: letters that are units only as written.
_SUFFIX = {
    "m",
    "mm",
    "cm",
    "um",
    "µm",
    "ft",
    "s",
    "ms",
    "us",
    "N",
    "kN",
    "MN",
    "lbf",
    "kip",
    "kips",
    "g",
    "V",
    "mV",
    "A",
    "mA",
    "Hz",
    "kHz",
    "rad",
    "deg",
    "Pa",
    "kPa",
    "MPa",
    "psi",
    "mps",
}


def _plain(unit: str) -> str:
    return unit.strip().strip("[]()").strip().replace("μ", "µ").lower()


def is_unit(text: str) -> bool:
    """Whether a text is a unit: a known symbol, or known symbols with powers, joined by / * . or ^."""
    parts = [part for part in re.split(r"[/*·.^ ]+|(?<=[a-zµ%°])(?=[-²³\d])", _plain(text)) if part]
    known = [part in _BASE for part in parts]
    return any(known) and all(k or re.fullmatch(r"-?[0-9²³]", part) for k, part in zip(known, parts, strict=True))


def length_factor(unit_a: str | None, unit_b: str | None) -> float | None:
    """How many `unit_b` are in one `unit_a`, or None unless both are lengths (m, mm, cm, um, in, ft)."""
    a, b = (_METRES.get(_plain(unit)) if unit else None for unit in (unit_a, unit_b))
    return a / b if a and b else None


def seconds_in(unit: str | None) -> float | None:
    """How many seconds are in one `unit`, or None if it is not a unit of time."""
    return _SECONDS.get(_plain(unit)) if unit else None


def is_length(unit: str | None) -> bool:
    """Whether a unit is a known unit of length."""
    return unit is not None and _plain(unit) in _METRES


def split_unit(name: str) -> tuple[str, str | None]:
    """A channel's name without its unit, and the unit: from `Disp (mm)`, `Disp [mm]`, `Disp, mm` or `disp_mm`."""
    found = re.fullmatch(r"(.*\S)\s*\[([^\[\]]{1,16})\]", name)
    # An index ([:,0]) is no unit.
    if found and re.search(r"[^\W\d_]|[%°-]", found[2]):
        return found[1], found[2].strip()
    found = re.fullmatch(r"(.*\S)\s*\(([^()]{1,16})\)", name) or re.fullmatch(r"(.*\S)\s*,\s+(\S{1,8})", name)
    if found and is_unit(found[2]):
        return found[1], found[2].strip()
    stem, _, suffix = name.rpartition("_")
    if stem and suffix in _SUFFIX:
        return stem, suffix
    if stem and suffix in ("in", "inch") and re.search(r"disp|stroke|pos|cmd|meas|targ|fbk|lvdt", stem.lower()):
        return stem, suffix
    return name, None


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
