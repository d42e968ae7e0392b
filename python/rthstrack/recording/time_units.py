"""In which unit a column counts the time: what its header says, its magnitude, and what a rig's rate may be."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rthstrack.said import Said
from rthstrack.values import median

if TYPE_CHECKING:
    from numpy.typing import NDArray

# What a rig's rates and the length of its records are taken to be.
_SLOWEST_HZ, _FASTEST_HZ, _SHORTEST_S = 10.0, 20e3, 1.0
# A stated unit is doubted only beyond these.
DOUBTED_SLOW_HZ, _DOUBTED_FAST_HZ = 1.0, 50e3
_FASTEST_KNOWN_HZ = 2e5
_LOOKED_AT = 4096
_DAY_S = 86_400.0
# Stamps of this size count from a fixed day: (least, greatest, size of one in s, what they are).
_EPOCHS = (
    (6.2e17, 6.6e17, 1e-7, "ticks of 100 ns"),
    (9e17, 2.5e18, 1e-9, "ns since 1970"),
    (1.2e17, 1.5e17, 1e-7, "ticks of 100 ns"),
    (9e14, 2.5e15, 1e-6, "µs since 1970"),
    (9e11, 2.5e12, 1e-3, "ms since 1970"),
)
_UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"), (_DAY_S, "days"))


class CountedIn(NamedTuple):
    """How many seconds one is; what is said of it where nobody stated it; why it is not known, if it
    is not, and what else it may be."""

    unit_s: float
    said: Said | None = None
    doubt: str = ""
    else_in: str = "ms"


#: What a column of time counts unless something else is known.
SECONDS = CountedIn(1.0)


def counted_in(stamps: NDArray[np.float64], stated_s: float | None) -> CountedIn:
    """The unit of a column of stamps, of which the file states one (in seconds), or none."""
    # The beginning tells the step.
    sound = stamps[:_LOOKED_AT][np.isfinite(stamps[:_LOOKED_AT])]
    if len(sound) < 4:
        return CountedIn(stated_s or 1.0)
    with np.errstate(all="ignore"):
        step = abs(median(np.diff(sound)))
    if not 0 < step < np.inf:
        return CountedIn(stated_s or 1.0)
    largest, span = float(np.abs(sound).max()), step * (len(stamps) - 1)
    if stated_s is not None:
        return _stated(stated_s, step, span)
    for least, greatest, unit_s, what in _EPOCHS:
        if least <= largest <= greatest:
            return CountedIn(unit_s, Said(f"its values are {what}", "time_unit", [unit_s]))
    hz = 1 / step
    # In seconds nobody writes whole numbers only, unless the rate is low.
    whole = bool(np.all(sound == np.rint(sound)))
    if _FASTEST_KNOWN_HZ >= hz >= (_SLOWEST_HZ if whole else DOUBTED_SLOW_HZ):
        return CountedIn(1.0)
    likely = [(unit_s, name) for unit_s, name in _UNITS if _plausible(unit_s, step, span)]
    if step == 1 and whole:
        return CountedIn(1.0, None, "counts in ones: in s that is 1 Hz, in ms 1000 Hz, and it may count samples")
    if len(likely) == 1:
        unit_s, name = likely[0]
        return CountedIn(
            unit_s,
            Said(
                f"its unit is not stated: taken as {name}, {1 / (step * unit_s):.4g} Hz; in s it would be {hz:.4g} Hz",
                "time_unit_guessed",
                (unit_s, 1 / (step * unit_s)),
                f"if the time is in {name}",
            ),
        )
    readings = " or ".join(f"{1 / (step * unit_s):.6g} Hz (in {name})" for unit_s, name in (likely or _UNITS[:3]))
    return CountedIn(1.0, None, f"does not state its unit: it may be {readings}")


# Where counters of so many bits begin anew.
_WRAPS = (2.0**16, 2.0**24, 2.0**31, 2.0**32)


def unwrapped(stamps: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Stamps of a counter that begins anew counted on, and its range; as they are, and 0, where none does."""
    with np.errstate(all="ignore"):
        steps = np.diff(stamps)
        back = steps < 0
        n_back = np.count_nonzero(back)
        if not n_back or n_back > len(steps) // 4 or not np.isfinite(stamps).all():
            return stamps, 0.0
        step = median(steps[~back])
        for bound in _WRAPS:
            across = steps[back] + bound
            if float(np.ptp(stamps)) < bound and bool(np.all(np.abs(across - step) <= max(0.5 * step, 1))):
                return stamps + bound * np.concatenate([[0.0], np.cumsum(back)]), bound
    return stamps, 0.0


def _stated(stated_s: float, step: float, span: float) -> CountedIn:
    """A stated unit is followed, unless another one makes a rig's record of what it makes none of."""
    hz = 1 / (step * stated_s)
    too_fast = hz > _DOUBTED_FAST_HZ and span * stated_s < _SHORTEST_S
    too_slow = hz < DOUBTED_SLOW_HZ and stated_s == 1.0
    if not (too_fast or too_slow):
        return CountedIn(stated_s)
    others = [(s, name) for s, name in _UNITS[:3] if s != stated_s and _plausible(s, step, span)]
    if len(others) != 1:
        return CountedIn(stated_s)
    other_s, name = others[0]
    own = next((n for s, n in _UNITS if s == stated_s), f"{stated_s:g} s")
    doubt = (
        f"says that it is in {own}, which makes {hz:.6g} Hz and {span * stated_s:.4g} s in all; in {name} it would be "
        f"{1 / (step * other_s):.6g} Hz and {span * other_s:.4g} s"
    )
    return CountedIn(stated_s, None, doubt, name)


def _plausible(unit_s: float, step: float, span: float) -> bool:
    return _SLOWEST_HZ <= 1 / (step * unit_s) <= _FASTEST_HZ and span * unit_s >= _SHORTEST_S


# A rate is known to so many digits; what rounding a step takes from it is more.
_ROUNDED_AWAY = 1e-5
# Rates that laboratories have, beside the powers of two.
_USUAL_HZ = (*(2.0**k for k in range(5, 17)), 30, 60, 120, 240, 300, 600, 1200, 2400, 3000, 6000, 12000)


def rounded_step(hz: float) -> Said | None:
    """That a step such as 0.000977 s may be that of 1024 Hz, rounded before it was added up."""
    step = 1 / hz
    for usual in _USUAL_HZ:
        if not _ROUNDED_AWAY < abs(hz / usual - 1) < 0.01:
            continue
        for decimals in range(3, 8):
            if abs(round(1 / usual, decimals) / step - 1) < _ROUNDED_AWAY:
                words = f"the step of {step:.5g} s makes {hz:.7g} Hz: is it {usual:g} Hz, its step rounded? (--rate)"
                return Said(words, "rounded_step", (hz, usual))
    return None
