"""Numbers on the command line, with or without their unit: 20ms, 0.02, 2kHz, 5 %. A bare number is in the SI's unit."""

from __future__ import annotations

import argparse
import math
import re

from rthstrack.units import quantity as measures
from rthstrack.units import size_in_si

# By the SI's unit: what it measures, what is expected in words, examples.
_EXPECTED = {
    "s": ("time", "a time", "0.02, 20ms"),
    "Hz": ("frequency", "a frequency", "1024, 2kHz"),
    "m": ("length", "a length", "0.005, 5mm"),
    "": ("", "a number", "0.05, '5 %'"),
}
_PERCENT = frozenset(("%", "percent", "per cent", "pct"))
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*", re.DOTALL)


def number(text: str, unit: str = "", expected: str = "a number") -> float:
    """The number in SI, checked to be finite; `unit` is the SI's unit of what is expected, "" for a bare number.

    expected: what it is, in words, for what is no number.
    """
    found = _NUMBER.fullmatch(text)
    size = _size(found[2], unit, text) if found and found[2] else 1.0
    value = size * (float(found[1]) if found else _word(text, expected))
    if not math.isfinite(value):
        finite = expected if "finite" in expected else expected.replace("a ", "a finite ", 1)
        raise argparse.ArgumentTypeError(f"expected {finite}, found '{text}'")
    return value


def _word(text: str, expected: str) -> float:
    """inf and nan are numbers, though none that is taken."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected {expected}, found '{text}'") from None


def _size(suffix: str, unit: str, text: str) -> float:
    """How many of the SI's unit one of the stated is."""
    wanted, expected, examples = _EXPECTED.get(unit, (unit, f"a number in {unit}", f"0.02, 0.02{unit}"))
    if not unit and suffix.lower() in _PERCENT:
        return 0.01
    if suffix.startswith(",") and suffix[1:2].isdigit():
        raise argparse.ArgumentTypeError(
            f"expected {expected} ({examples}), found '{text}': write a point for the comma"
        )
    size = size_in_si(suffix, wanted) if wanted else None
    if size is None:
        what = measures(suffix)
        is_other = what not in (None, "other", wanted)
        said = f", which is {_article(what or '')}" if is_other else f": the unit '{suffix}' is not known here"
        raise argparse.ArgumentTypeError(f"expected {expected} ({examples}), found '{text}'{said}")
    return size


def _article(what: str) -> str:
    return f"an {what}" if what[0] in "aeiou" else f"a {what}"


def positive(text: str, unit: str = "") -> float:
    """A number above zero."""
    if (value := number(text, unit)) <= 0:
        raise argparse.ArgumentTypeError(f"expected a positive number, found '{text}'")
    return value


def not_negative(text: str, unit: str = "") -> float:
    """Zero or a number above it."""
    if (value := number(text, unit)) < 0:
        raise argparse.ArgumentTypeError(f"expected zero or a positive number, found '{text}'")
    return value


def seconds(text: str) -> float:
    """A time above zero."""
    return positive(text, "s")


def seconds_from_zero(text: str) -> float:
    """Zero or a time above it."""
    return not_negative(text, "s")


def time(text: str) -> float:
    """Any time, negative too."""
    return number(text, "s")


def hertz(text: str) -> float:
    """A frequency above zero."""
    return positive(text, "Hz")
