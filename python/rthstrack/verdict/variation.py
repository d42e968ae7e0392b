"""What gain and delay depend on, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rthstrack.verdict.display import with_interval

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rthstrack.evaluation.dependence import Dependence, Level, Line
    from rthstrack.evaluation.response import FrequencySlopes


def _line(value: float, interval: tuple[float, float], factor: float, what: str) -> str:
    """A slope with its interval: falling by 0.42 ms per hertz (0.40 to 0.44)."""
    ends = sorted(factor * abs(end) for end in interval)
    if interval[0] <= 0 <= interval[1]:
        return "curved"
    number, _, between = with_interval(factor * abs(value), ends).partition(" ")
    return f"{'rising' if value > 0 else 'falling'} by {number}{what} per hertz {between}".rstrip()


def _varying_slowly(s: FrequencySlopes | None) -> str:
    """What is added to a number that changes with frequency, but by too little to mislead."""
    if s is None:
        return ""
    changes = []
    if s.delay_varies:
        changes.append(f"the delay is {_line(s.delay_s_per_hz, s.delay_s_per_hz_interval, 1e3, ' ms')}")
    if s.gain_varies:
        changes.append(f"the gain is {_line(s.gain_per_hz, s.gain_per_hz_interval, 1.0, '')}")
    return f"; {' and '.join(changes)}" if changes else ""


# Changes of delay and gain, as shares of them, that are told: beside one number, or in place of it.
_MINOR_CHANGE, _MISLEADING = {"delay": 0.07, "gain": 0.03}, {"delay": 0.08, "gain": 0.08}


def _varying(d: Dependence, unit: str | None, start_s: float) -> tuple[str, str] | None:
    """That delay or gain are not one number, in words, and which of them leads; None where they nearly are."""
    delay, gain = (
        abs(change) > _MISLEADING[name] for name, change in (("delay", d.delay_change), ("gain", d.gain_change))
    )
    if not (delay or gain):
        return None
    return "delay_s" if delay else "amplitude", _in_words(d, unit, start_s, _MISLEADING)


def _in_words(d: Dependence, unit: str | None, start_s: float, least: Mapping[str, float]) -> str:
    said = []
    if abs(d.delay_change) > least["delay"]:
        said.append(f"the delay is not one number: {_course(d, 'delay', unit, start_s)}")
    if abs(d.gain_change) > least["gain"]:
        opening = "nor is the gain" if said else "the gain is not one number"
        said.append(f"{opening}: {_course(d, 'gain', unit, start_s)}")
    return "; ".join(said)


def _course(d: Dependence, what: str, unit: str | None, start_s: float) -> str:
    """How delay or gain change, with the numbers."""
    first, second = d.levels

    def at(level: Level, interval: bool = True) -> str:
        scale, of, ms = (1e3, "delay_s", " ms") if what == "delay" else (1.0, "gain", "")
        ends = level.delay_interval_s if what == "delay" else level.gain_interval
        text = with_interval(scale * getattr(level, of), [scale * end for end in ends], ms.strip())
        return text if interval else text.partition(" (")[0]

    if d.kind == "frequency":
        line = d.delay_line if what == "delay" else d.gain_line
        if line is None:
            return f"{at(first)} at {first.where[0]:.2g} Hz, {at(second)} at {second.where[0]:.2g} Hz"
        beyond = [
            f"{at(level, False)} at {level.where[0]:.2g} Hz"
            for level, end in ((first, line.band_hz[0]), (second, line.band_hz[1]))
            if (level.where[0] - end) * (1 if level is second else -1) > 0.1 * (line.band_hz[1] - line.band_hz[0])
        ]
        return ", and ".join((_along_line(line, what), *beyond))
    if d.kind == "amplitude":
        rises = {"delay": ("longer", "shorter"), "gain": ("larger", "smaller")}[what]
        change = d.delay_change if what == "delay" else d.gain_change
        low, high = (_amplitudes(level, unit) for level in (first, second))
        return (
            f"{at(first)} at {low}; {rises[0 if change > 0 else 1]} where the motion is small: {at(second)} at {high}"
        )
    if d.form == "step":
        assert d.step_s is not None
        return f"{at(first)} until {start_s + d.step_s:.3g} s and {at(second)} from then on: it changes over time"
    if d.form == "course":
        times = [f"{start_s + level.where[0]:.3g} s" for level in d.levels]
        return f"{at(first)} at {times[0]} and {at(second)} at {times[1]}: it changes over time"
    if d.kind == "clock":
        assert d.clock_ppm is not None
        assert d.clock_ppm_interval is not None
        ppm = with_interval(abs(d.clock_ppm), sorted(abs(end) for end in d.clock_ppm_interval), "ppm")
        ends = f"{at(first)} at the start and {at(second)} at the end"
        return f"{ends}, changing evenly over time, as if two clocks differ by {ppm}"
    return f"{at(first)} at the start and {at(second)} at the end: it drifts over time"


def _amplitudes(level: Level, unit: str | None) -> str:
    low, high = level.where
    in_unit = f" {unit}" if unit else ""
    return f"{low:.2g} to {high:.2g}{in_unit}" if high > low else f"{low:.2g}{in_unit}"


def _along_line(line: Line, what: str) -> str:
    scale, ms = (1e3, " ms") if what == "delay" else (1.0, "")
    slope = _line(line.slope_per_hz, line.slope_interval_per_hz, scale, ms)
    value = with_interval(scale * line.value, [scale * (line.value + side * line.misfit) for side in (-1, 1)])
    return (
        f"{value.partition(' (')[0]}{ms} at {line.at_hz:.2g} Hz, {slope} "
        f"from {line.band_hz[0]:.2g} to {line.band_hz[1]:.2g} Hz, within {scale * line.misfit:.2g}{ms} of a line"
    )
