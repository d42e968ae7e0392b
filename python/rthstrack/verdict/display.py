"""What the report and the figures share: which points to draw, how to write a number, what a signal is called.

Nothing here changes a result; every function only chooses how a result is shown.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.units import is_length
from rthstrack.values import with_interval as with_interval

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rthstrack.evaluation.tracking import MovingTracking, Tracking

#: Gain and delay are drawn grey where the coherence is below this.
DRAWN_GREY_BELOW = 0.8

#: The part of a record that is shown enlarged, in seconds.
STRONGEST_S = 4.0

#: The panels of a figure.
PANELS = (
    "history", "strongest", "loop", "error", "spectra", "moving", "response", "indices", "time-frequency",
)  # fmt: skip
#: Shortest and longest side of a figure, in inches: less has no room for labels.
FIGURE_IN = (1.5, 50.0)

#: Every estimator, and what it is called beside the others.
ESTIMATORS = {"fei": "published", "aligned": "aligned", "least_squares": "least squares"}

#: The indices as they are shown: short name, field, unit, factor to it, field in percent, what it is, name in a table.
INDICES = (
    ("MTE", "max_tracking_error", "unit", 1.0, "max_tracking_error_percent", "of the largest {target}",
     "max tracking error (MTE)"),
    ("RMS error", "rms_error", "unit", 1.0, "rms_error_percent", "of the RMS of {target}", "rms error"),
    ("TI", "tracking_indicator", "unit2", 1.0, None, "at the end of the record; rises while {measured} lags",
     "tracking indicator (TI)"),
    ("J1", "j1_s", "ms", 1e3, None, "lag at the correlation peak", "J1"),
    ("J2", "j2_percent", "%", 1.0, None, "standard deviation of the error over that of {target}", "J2"),
    ("J3", "j3_percent", "%", 1.0, None, "largest error over largest {target}", "J3"),
    ("Energy error", "energy_error", "", 1.0, None, "work over {measured} less work over {target}", "energy error"),
)  # fmt: skip

_ROLES = {"whole": ("target", "measured"), "compensator": ("target", "command"), "actuator": ("command", "measured")}
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def estimator_in_full(name: str) -> str:
    """What an estimator is called, with its name behind it where that is another: "published (fei)"."""
    called = ESTIMATORS[name]
    return called if called == name.replace("_", " ") else f"{called} ({name})"


def signal_roles(part: str) -> tuple[str, str]:
    """What the two signals of a part are called, for example ("target", "command") for the compensator."""
    return _ROLES.get(part, ("target", "measured"))


def quantity(unit: str | None) -> str:
    """The quantity that a unit measures, as far as it tells: "Displacement" for a length, else "Signal"."""
    return "Displacement" if is_length(unit) else "Signal"


def with_unit(name: str, unit: str | None) -> str:
    """An axis label, "Displacement (mm)"; it says so where the unit is not stated."""
    return f"{name} ({unit if unit else 'unit not stated'})"


def significant(value: float, digits: int = 4) -> str:
    """A number with so many significant digits: 0.7170, 13.51, 1.234×10⁻⁵; whole numbers stay whole."""
    if isinstance(value, int | np.integer):
        return str(int(value))
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = int(exponent)
    if -4 <= power < 6:
        return f"{value:.{max(digits - 1 - power, 0)}f}".replace("-", "\N{MINUS SIGN}")
    mantissa = mantissa.replace("-", "\N{MINUS SIGN}")
    return f"{mantissa}\N{MULTIPLICATION SIGN}10{str(power).translate(SUPERSCRIPTS)}"


def shortened(name: str, width: int) -> str:
    """A name cut in the middle, so that its beginning and its end are seen."""
    if len(name) <= width:
        return name
    first = (width - 3) // 2
    return f"{name[:first]}...{name[len(name) - (width - 3 - first) :]}"


def reasons(moving: MovingTracking) -> list[tuple[int, str]]:
    """Why windows have no number or no interval: how many of each kind, most frequent first, and the first's words."""
    kinds: dict[Any, tuple[int, str]] = {}
    for code, values, reason in zip(moving.reason_code, moving.reason_values, moving.reason, strict=True):
        if code:
            # Measured that does not move has the code of one that does not follow, but no share that does.
            kind = (code, len(values))
            count, first = kinds.get(kind, (0, str(reason)))
            kinds[kind] = (count + 1, first)
    return sorted(kinds.values(), key=lambda found: -found[0])


def fourier_scale(tracking: Tracking) -> float:
    """Factor from the plain DFT to the Fourier amplitude in unit*s: the time between the samples transformed."""
    settings = tracking.settings
    step = settings.data_decimation if settings.decimator == "chebyshev" else 1
    return step / tracking.rate_hz


def strongest_span(target: NDArray[np.float64], rate_hz: float, span_s: float = STRONGEST_S) -> tuple[int, int]:
    """First and one-past-last sample of the `span_s` seconds in which the target varies most about their own mean."""
    n = round(span_s * rate_hz)
    if n < 1 or n >= target.size:
        return 0, target.size
    centred = target - target.mean()
    sums, squares = (np.concatenate(([0.0], np.cumsum(column))) for column in (centred, centred**2))
    variation = squares[n:] - squares[:-n] - (sums[n:] - sums[:-n]) ** 2 / n
    first = int(np.argmax(variation))
    return first, first + n


def judged_range(tracking: Tracking) -> tuple[float, float] | None:
    """Frequencies (Hz) to show first: those of the middle 98.5 % of the weight, with room on both sides."""
    frequency, weights = tracking.frequency_hz, tracking.weights
    if frequency is None or weights is None or frequency.size < 2:
        return None
    share = np.cumsum(weights)
    first, last = np.searchsorted(share, (0.005, 0.99)).clip(max=frequency.size - 1)
    low, high = frequency[first] / 2, max(frequency[last] * 3, 1.5 * float(tracking.equivalent_frequency_hz))
    return float(max(low, frequency[0])), float(min(high, frequency[-1]))


def even_edges(n: int, n_groups: int) -> NDArray[np.intp]:
    """Edges of `n_groups` groups of nearly the same number of points."""
    return np.unique(np.linspace(0, n, n_groups + 1).round().astype(np.intp))


def log_edges(n: int, n_groups: int) -> NDArray[np.intp]:
    """Edges of groups that are about equally wide on a logarithmic axis of the index."""
    return np.unique(np.concatenate(([0], np.geomspace(1, n, n_groups).round())).astype(np.intp))


def extremes(columns: Sequence[NDArray[np.floating]], edges: NDArray[np.intp]) -> NDArray[np.intp]:
    """Indices of the points to draw: both ends, and in every group each column's minimum and maximum.

    A group with NaN keeps the first of them too, so that a gap stays a gap.
    """
    starts, n = edges[:-1], int(edges[-1])
    sizes = np.diff(edges)
    group = np.repeat(np.arange(starts.size), sizes)
    keep = [np.array([0, n - 1])]
    for column in columns:
        column = column[:n]
        missing = np.isnan(column)
        for end, empty in ((np.minimum, np.inf), (np.maximum, -np.inf)):
            values = np.where(missing, empty, column)
            keep.append(_firsts(values == np.repeat(end.reduceat(values, starts), sizes), group))
        if missing.any():
            keep.append(_firsts(missing, group))
    return np.unique(np.concatenate(keep)).astype(np.intp)


def _firsts(hits: NDArray[np.bool_], group: NDArray[np.intp]) -> NDArray[np.intp]:
    """The first hit of every group that has one."""
    places = np.flatnonzero(hits)
    return places[np.unique(group[places], return_index=True)[1]]
