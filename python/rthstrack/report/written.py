"""Numbers and settings as the page writes them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack._core import settings_table
from rthstrack.report.record import NOT_DETERMINED
from rthstrack.verdict import display

if TYPE_CHECKING:
    from collections.abc import Iterable

#: Settings by the core's labels, and what else the page lists.
_SETTING_NAMES = {row["name"]: row["label"] for row in settings_table("evaluation")} | {
    "moving_s": "Moving windows",
    "hop_s": "One moving window every",
    "rate_source": "Rate from",
    "start_s": "Cut before",
    "end_s": "Cut after",
    "n_filled": "Filled samples",
    "fill": "Fill gaps up to (samples)",
    "resample_hz": "Resampled to",
}


def _number(
    field: str, value: float | None, unit: str = "", factor: float = 1.0, reason: str | None = None, digits: int = 4
) -> str:
    """A number as text with its unit; the machine-readable value beside it is in the unit of the field's name."""
    if value is None or not math.isfinite(value):
        why = f' <span class="reason">({escape(reason)})</span>' if reason else ""
        return f'<span class="absent" data-field="{field}">{NOT_DETERMINED}{why}</span>'
    shown = display.significant(value if isinstance(value, int) else float(value) * factor, digits)
    tail = f'<span class="unit">{"" if unit == "°" else " "}{escape(unit)}</span>' if unit else ""
    exact = value if isinstance(value, int) else repr(float(value))
    return f'<data data-field="{field}" value="{exact}">{shown}{tail}</data>'


def _interval(field: str, interval: Iterable[float], value: float, unit: str = "", factor: float = 1.0) -> str:
    """A 95 % interval as text, to the digits that its width leaves; empty where there is none."""
    low, high = (float(end) for end in interval)
    if not math.isfinite(high - low):
        return ""
    text = display.with_interval(factor * value, (factor * low, factor * high)).partition(" (")[2].rstrip(")")
    ends = f'data-low="{low!r}" data-high="{high!r}"'
    shown = escape(text.replace("-", "\N{MINUS SIGN}") + (f" {unit}" if unit else ""))
    return f'95 %: <span data-field="{field}" {ends}>{shown}</span>'


def flat(settings: Mapping[str, Any], before: str = "") -> list[tuple[str, Any]]:
    rows: list[tuple[str, Any]] = []
    for key, value in settings.items():
        name = f"{before}{key}"
        if isinstance(value, Mapping):
            rows += flat(value, f"{name} · ") if value else [(name, None)]
        else:
            rows.append((name, value))
    return rows


def _setting(name: str, value: Any) -> tuple[str, str]:
    """A setting's name and value in words; the unit is the suffix of the name."""
    unit = next((u for end, u in (("_hz", "Hz"), ("_s", "s"), ("_percent", "%")) if name.endswith(end)), "")
    plain = name.removesuffix("_hz").removesuffix("_percent")
    plain = plain.removesuffix("_s").replace("_", " ")
    first, _, rest = name.partition(" · ")
    label = _SETTING_NAMES.get(first, plain[:1].upper() + plain[1:])
    if rest and first in _SETTING_NAMES:
        label = f"{label}: {rest}"
    if value is None or value == [] or value == ():
        return label, "none"
    if isinstance(value, bool):
        return label, "yes" if value else "no"
    if isinstance(value, list | tuple):
        text = (" to " if len(value) == 2 and unit else ", ").join(_scalar(item) for item in value)
    else:
        text = _scalar(value)
    return label, f"{text} {unit}" if unit else text


def _scalar(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float | np.floating) else str(value)
