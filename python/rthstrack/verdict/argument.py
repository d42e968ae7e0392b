"""What a good engineer would say of the numbers: one sentence, and the warnings that go with it.

Everything here reads results; nothing changes them. The thresholds stand at the top, each with its reason.
"""

from __future__ import annotations

import dataclasses
import math
import re
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.evaluation.tracking import BadSamples
from rthstrack.units import length_factor
from rthstrack.verdict.display import with_interval

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from rthstrack.evaluation.dependence import Dependence, Level, Line
    from rthstrack.evaluation.tracking import FrequencyResponse, FrequencySlopes, MovingTracking, Tracking
    from rthstrack.verdict.assessment import Limits

# An amplitude this near to one is called right: no displacement sensor of a test rig is better.
_RIGHT_AMPLITUDE = 5e-4
# Beyond three eighths of a turn a phase may as well be a turn less.
_WRAP_RAD = 0.75 * math.pi
# Drift: this much of the weight at fewer cycles in the record than a response has.
_DRIFT_SHARE, _DRIFT_CYCLES = 0.05, 4.0
# Offset or residual displacement, in standard deviations of the target, from which drift is blamed on it.
_OFFSET_STD = 0.25
# Energy this far above the equivalent frequency is no structural response.
_HIGH_SHARE, _HIGH_FACTOR = 0.02, 8.0
_LOW_COHERENCE = 0.9
_FEW_LEVELS = 64
# Clipped: so many samples in a row at an extreme so far from the mean, reached at a good part of the highest speed.
_CLIPPED_RUN, _CLIPPED_STD, _CLIPPED_SPEED = 5, 1.5, 0.2
# A quantised peak lasts as long as it takes the motion to change by a few steps of the converter.
_CLIPPED_LEVELS = 10
# A target with less noise than this share of its deviation, and less than would draw a fit by a microsecond, is clean.
_TARGET_NOISE = 5e-4
# Between samples the interpolated noise draws a fit by up to this share of its energy over that of a step.
_PULL = 0.25
_ODD_AMPLITUDE = 3.0
# Spread of the delay over the frequencies that carry the weight, as a share of the delay.
_DELAY_SPREAD = 0.2
# Two estimates this near may stand for each other, however narrow the interval: a thousandth of the delay, a micro-
# second, and the amplitude as above.
_SAME_DELAY, _SAME_DELAY_S = 1e-3, 1e-6
# Without an interval to hold the difference against, one of a hundredth counts.
_NOTABLE = 1e-2
# An interval that reaches further than this share of the delay to either side says little of it.
_WIDE_INTERVAL = 0.1
# A change of one setting is the cause of a difference when it leaves less than this share of it; what is computed from
# the spectrum alone, without a trial, when it leaves less than that.
_EXPLAINED, _FORETOLD = 0.5, 0.2
# Of two causes in one, less than this share of the difference is not told.
_MINOR = 0.25
# A bin that holds so many times what noise leaves in it on average holds motion.
_CLEAR_OF_NOISE = 16.0
# Ends this near to the mean, in standard deviations, are no cause.
_AT_MEAN = 0.1
# A target is still in a band that holds less than this share of its motion, the step of a converter of 20 bits.
_STILL = 1e-6
# An offset of measured is told from this share of target's deviation on.
_STANDS_OFF = 0.25


def sentence(tracking: Tracking, target: str = "target", measured: str = "measured") -> str:
    """The verdict, for example: measured lags target by 13.2 ms and is 1.8 % too large, judged at 0.9 Hz."""
    delay_s, amplitude = float(tracking.delay_s), float(tracking.amplitude)
    if math.isnan(delay_s):
        said = _undetermined(tracking)
        return f"{measured} does not move: it has no delay" if said == _NO_MOTION else f"not determined: {said}"
    milliseconds = f"{1e3 * abs(delay_s):.3g} ms"
    if float(f"{1e3 * abs(delay_s):.3g}") == 0:
        timing = f"{measured} is in time with {target}"
    else:
        timing = f"{measured} {'lags' if delay_s > 0 else 'leads'} {target} by {milliseconds}"
    excess = 100 * (amplitude - 1)
    if abs(amplitude - 1) < _RIGHT_AMPLITUDE:
        size = "has the right amplitude"
    elif amplitude > 2:
        size = f"is {amplitude:.3g} times as large"
    else:
        size = f"is {_percent(abs(excess))} % too {'large' if excess > 0 else 'small'}"
    return f"{timing} and {size}, judged at {float(tracking.equivalent_frequency_hz):.2g} Hz"


_NO_MOTION = "measured does not move"


def reason(tracking: Tracking) -> str | None:
    """Why a number or its interval is missing; None where nothing is, and for the published estimator's intervals."""
    said = str(tracking.reason)
    if not said and math.isnan(float(tracking.delay_s)):
        return f"not determined: {_NO_MOTION}"
    # So wide that the number means nothing but that.
    uncertain = _UNCERTAIN.search(said)
    if uncertain and float(uncertain[1]) > 1e3 * tracking.n_samples / tracking.rate_hz:
        said = said.replace(uncertain[0], "noise hides the delay altogether")
    return said or None


def with_cause(tracking: Tracking, depends: Dependence | None) -> Tracking:
    """The same, its reason with the cause that was found: what noise on target leaves follows target, too."""
    said = str(tracking.reason)
    if _NOT_CONSTANT not in said:
        return tracking
    if depends is not None:
        over = {"amplitude": "amplitude", "frequency": "frequency"}.get(depends.kind, "time")
        said = said.replace("over frequency or time", f"over {over}")
    elif float(tracking.target_noise_std) > 0:
        said = said.replace(_NOT_CONSTANT, ", as noise on target does")
    return dataclasses.replace(tracking, reason=said)


_NOT_CONSTANT = ", so they are not constant over frequency or time"
_UNCERTAIN = re.compile(r"noise leaves the delay uncertain by ([\d.]+) ms either way, more than half a turn")


def still_in_band(target: NDArray[np.float64], tracking: Tracking) -> str | None:
    """That target does not move in the band asked for: then gain and delay there are rounding's. Needs the spectra."""
    band, spectrum = tracking.settings.band_hz, tracking.target_spectrum
    if band is None or spectrum is None:
        return None
    # By Parseval, and the bins that Q leaves out like their neighbours.
    n = tracking.rate_hz / tracking.delta_f_hz * tracking.settings.frequency_decimation
    squares = 2 * tracking.settings.frequency_decimation * float(np.sum(np.abs(spectrum) ** 2)) / n
    if squares > (_STILL * float(target.std())) ** 2 * target.size:
        return None
    return f"not determined: target does not move between {band[0]:.3g} and {band[1]:.3g} Hz"


def _undetermined(tracking: Tracking) -> str | None:
    """Why there is no number; None where there is one."""
    if not math.isnan(float(tracking.delay_s)):
        return None
    return (reason(tracking) or "").removeprefix("not determined: ")


def differ(tracking: Tracking, trusted: Tracking) -> bool:
    """Whether amplitude or delay differ by more than the trusted interval, and by enough to matter."""
    return bool(_differences(tracking, trusted))


def _differences(tracking: Tracking, trusted: Tracking) -> list[str]:
    """Which of "delay_s" and "amplitude" differ."""
    found = []
    for name, interval, share, least in (
        ("delay_s", trusted.delay_interval_s, _SAME_DELAY, _SAME_DELAY_S),
        ("amplitude", trusted.amplitude_interval, _RIGHT_AMPLITUDE, 0.0),
    ):
        ours, theirs = float(getattr(tracking, name)), float(getattr(trusted, name))
        low, high = (float(end) for end in interval)
        if math.isnan(low):
            share = _NOTABLE
        if abs(ours - theirs) > max(share * abs(theirs), least) and not low <= ours <= high:
            found.append(name)
    return found


# What to do where the reason itself does not say.
_ADVICE = {
    "too little motion to judge by": "; are these the right channels?",
    "the iteration did not settle on a delay": "; judge only the frequencies at which target moves (--band)",
    "measured moves against target": " (--scale CHANNEL=-1 turns one round)",
}
_NAMES = {
    "fei": "the published average",
    "aligned": "the aligned average",
    "least_squares": "least squares as asked for",
}


def argument(
    target: NDArray[np.float64],
    tracking: Tracking,
    trusted: Tracking,
    depends: Dependence | None,
    slopes: FrequencySlopes | None,
    variants: Mapping[str, Tracking],
    found: Mapping[str, str],
    unit: str | None = None,
    start_s: float = 0.0,
) -> tuple[str, str | None]:
    """In one sentence, which number to use and why; and the name of that warning of `found` which it says itself.

    `tracking` is the estimate asked for, with weights; `variants` are the same with one setting changed. `unit` is
    target's; `start_s` the time of the first sample.
    """
    if (missing := _undetermined(trusted)) is not None:
        said = "no number can be trusted here" if _undetermined(tracking) is None else "there is no number to use"
        return f"{said}: {_advised(missing, trusted)}", None
    if (missing := _undetermined(tracking)) is not None:
        asked_for = _NAMES[tracking.settings.estimator]
        return f"use the trusted estimate: {asked_for} is not determined: {missing}", None
    if depends is not None and (varying := _varying(depends, unit, start_s)) is not None:
        name, text = varying
        return f"{text}; {_averages(tracking, trusted, name)}", "delay spread"
    if depends is None or depends.kind == "frequency":
        slowly = _varying_slowly(slopes)
    else:
        said = _in_words(depends, unit, start_s, _MINOR_CHANGE)
        slowly = f"; {said}" if said else ""
    if tracking is trusted:
        interval = "with its interval" if not trusted.reason else f"for which there is {trusted.reason}"
        return f"this is the trusted estimate, {interval}{slowly}", None
    ours = _NAMES[tracking.settings.estimator]
    which = _differences(tracking, trusted)
    if not which:
        return f"{ours} agrees with the trusted estimate {_how_well(tracking, trusted)}{slowly}", None
    causes = [_cause(target, tracking, trusted, name, variants, found) for name in which]
    if len({change for change, _, _ in causes}) == 1:
        # One cause, told of the number that is off by most.
        at = max(range(len(which)), key=lambda i: _relative(which[i], tracking, trusted))
        gaps = [f"{' and '.join(_gap(name, tracking, trusted) for name in which)}, {causes[at][2]}"]
    else:
        gaps = [f"{_gap(name, tracking, trusted)}, {text}" for name, (_, _, text) in zip(which, causes, strict=True)]
    # What follows the target is told by how gain and delay change.
    without = f"; {trusted.reason}" if trusted.reason and "follows target" not in str(trusted.reason) else ""
    told = next((warning for _, warning, _ in causes if warning is not None), None)
    return f"use the trusted estimate: {ours} is {', and '.join(gaps)}{slowly}{without}", told


def _advised(missing: str, trusted: Tracking) -> str:
    """Why there is no number, with what to do about it in the command's words."""
    settings, quarter_s = trusted.settings, trusted.n_samples / trusted.rate_hz / 4
    if missing.startswith("the delay seems to lie beyond"):
        if settings.max_delay_s < quarter_s:
            most = min(2 * settings.max_delay_s, quarter_s)
            return f"the delay seems to lie beyond max_delay_s, {settings.max_delay_s:g} s: try --max-delay {most:.3g}"
        return f"the delay seems to lie beyond a quarter of the record, {quarter_s:.3g} s: a longer one is needed"
    return missing + next((advice for known, advice in _ADVICE.items() if missing.startswith(known)), "")


def _how_well(tracking: Tracking, trusted: Tracking) -> str:
    if trusted.reason:
        return f"to a hundredth ({trusted.reason})"
    inside = all(
        low <= ours <= high
        for ours, (low, high) in (
            (float(tracking.delay_s), trusted.delay_interval_s),
            (float(tracking.amplitude), trusted.amplitude_interval),
        )
    )
    if not inside:
        return "to a thousandth"
    low, high = (1e3 * float(end) for end in trusted.delay_interval_s)
    if (high - low) / 2 > _WIDE_INTERVAL * 1e3 * abs(float(trusted.delay_s)):
        return f"within its interval, but that is wide: {low:.2g} to {high:.2g} ms"
    return "within its interval"


def _averages(tracking: Tracking, trusted: Tracking, name: str = "delay_s") -> str:
    """What single numbers are worth where gain or delay change."""

    def text(t: Tracking) -> str:
        value = float(getattr(t, name))
        return f"{1e3 * value:.3g} ms" if name == "delay_s" else f"{value:.3g}"

    if tracking is trusted or name not in _differences(tracking, trusted):
        return f"{text(trusted)} is an average of it"
    which = {"fei": "published", "aligned": "aligned"}.get(tracking.settings.estimator, "as asked for")
    return f"{text(tracking)} ({which}) and {text(trusted)} (trusted) are two averages of it"


def _gap(name: str, tracking: Tracking, trusted: Tracking) -> str:
    """How far the estimate is from the trusted one: 0.026 ms below, 1.2 % above."""
    ours, theirs = float(getattr(tracking, name)), float(getattr(trusted, name))
    where = "above" if ours > theirs else "below"
    if name == "delay_s":
        return f"{_percent(1e3 * abs(ours - theirs))} ms {where}"
    return f"{_percent(100 * abs(ours / theirs - 1))} % {where} in amplitude"


def _line(value: float, interval: tuple[float, float], factor: float, what: str) -> str:
    """A slope with its interval: falling by 0.42 ms a hertz (0.40 to 0.44)."""
    ends = sorted(factor * abs(end) for end in interval)
    if interval[0] <= 0 <= interval[1]:
        return "bent over the frequencies"
    number, _, between = with_interval(factor * abs(value), ends).partition(" ")
    return f"{'rising' if value > 0 else 'falling'} by {number}{what} a hertz {between}".rstrip()


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
        return f"{at(first)} at the start and {at(second)} at the end, evenly over time, as of two clocks {ppm} apart"
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
        f"from {line.band_hz[0]:.2g} to {line.band_hz[1]:.2g} Hz, give or take {scale * line.misfit:.2g}{ms}"
    )


def _relative(name: str, tracking: Tracking, trusted: Tracking) -> float:
    """By how much a number is off, as a share of the trusted one."""
    known = float(getattr(trusted, name))
    return abs(float(getattr(tracking, name)) / known - 1) if known else math.inf


def _cause(
    target: NDArray[np.float64],
    tracking: Tracking,
    trusted: Tracking,
    name: str,
    variants: Mapping[str, Tracking],
    found: Mapping[str, str],
) -> tuple[str | None, str | None, str]:
    """Why one number misses the trusted one: what is to blame, the warning that says it, and the cause in words.

    Each suspect is tried: what is left of the difference without it?
    """
    ours, theirs = float(getattr(tracking, name)), float(getattr(trusted, name))
    readings = {change: float(getattr(variant, name)) for change, variant in variants.items()}
    if (averaged := _averaged(target, tracking, trusted, name)) is not None:
        # What averaging makes of a constant gain and delay, target's own noise and all, is taken off.
        readings["average"] = ours - averaged[1] + theirs
    remains = {change: abs(reading - theirs) / abs(ours - theirs) for change, reading in readings.items()}
    if remains.get("bad samples", 1.0) < _EXPLAINED and "bad samples" in found:
        # All else that is tried still holds them.
        return "bad samples", "bad samples", f"as {found['bad samples'].partition('; left out')[0]}"
    suspects = [change for change in ("detrend", "window", "band") if remains.get(change, 1.0) < _EXPLAINED]
    if remains.get("average", 1.0) < _FORETOLD:
        suspects.append("average")
    # Another average only tells that the difference is made before averaging, so it is the last to be asked.
    if not suspects and remains.get("estimator", 1.0) < _EXPLAINED:
        suspects = ["estimator"]
    if not suspects:
        return None, None, "which neither drift, window, noise nor wide phases explain alone"
    # Noise on target that is there, and explains it, needs no help by the record's ends.
    noisy = "target noise" in found
    by_bins = "average" in suspects or "band" in suspects
    if noisy and not by_bins and averaged is not None and abs(ours - averaged[1]) < _EXPLAINED * abs(ours - theirs):
        return "target noise", None, "as target's own noise counts as motion"
    first = [name for name in ("average", "band") if name in suspects and (noisy or name == "average")]
    cause = first[0] if first else min(suspects, key=remains.__getitem__)
    by_noise = 0.0
    if cause == "average" and averaged is not None:
        clean = averaged[0]
        by_noise = (averaged[1] - clean) / (averaged[1] - theirs)
        if by_noise > 1 - _MINOR and "band" in suspects:
            cause = "band"  # the same, with a remedy
    if cause == "average":
        noise = "target's own noise counts as motion"
        if by_noise > 1 - _MINOR:
            return "target noise", None, f"as {noise}"
        frequency, weights = _of_motion(target, tracking, trusted)
        low, high = (360 * abs(float(trusted.delay_s)) * edge for edge in _middle(frequency, weights))
        said = f"as it averages phases that spread from {_percent(low)} to {_percent(high)} degrees"
        if low > 180:
            said = f"as it takes phases of {low:.0f} to {high:.0f} degrees for less than half a turn"
        return cause, None, said if by_noise < _MINOR else f"{said}, and {noise}"
    window = tracking.settings.window
    scale, unit = (1e3, " ms") if name == "delay_s" else (1.0, "")
    reading = f"it reads {'d' if unit else 'A'} = {scale * readings[cause]:.4g}{unit}"
    if cause == "estimator":
        where = "its two ends act" if window == "boxcar" else f"the {window} window acts"
        return cause, None, f"as {where} on different points of both motions: with --estimator aligned {reading}"
    if cause == "band":
        low, high = variants["band"].settings.band_hz or (0.0, math.inf)
        warning = "noise" if "noise" in found else None
        return (
            cause,
            warning,
            f"as noise above {high:.3g} Hz counts as motion: with --band {low:g} {high:.3g} {reading}",
        )
    remedy = (
        f"--detrend {variants[cause].settings.detrend}"
        if cause == "detrend"
        else f"--window {variants[cause].settings.window}"
    )
    if cause == "window" and window != "boxcar":
        return cause, None, f"as the {window} window acts on different points of both motions: with {remedy} {reading}"
    if "offset" in found:
        return cause, "offset", f"as {found['offset']}: with {remedy} {reading}"
    if "drift" in found:
        return cause, "drift", f"as {found['drift'].partition(': try')[0]}: with {remedy} {reading}"
    return cause, None, f"as {_ends_apart(target)}: with {remedy} {reading}"


def _middle(frequency: NDArray[np.float64], weights: NDArray[np.float64]) -> tuple[float, float]:
    """The frequencies between which the middle nine tenths of the weight lie."""
    share = np.cumsum(weights)
    first, last = np.searchsorted(share, (0.05 * share[-1], 0.95 * share[-1])).clip(max=share.size - 1)
    return float(frequency[first]), float(frequency[last])


def _ends_apart(target: NDArray[np.float64]) -> str:
    """Where the record starts and ends, in standard deviations of the target from its mean."""
    n = max(1, target.size // 50)
    mean, spread = float(target.mean()), float(target.std())
    first, last = (float(part.mean() - mean) / spread for part in (target[:n], target[-n:]))
    if max(abs(first), abs(last)) < _AT_MEAN:
        return "its two ends act on different points of both motions"
    return (
        f"target does not begin and end at its mean ({first:+.2g} and {last:+.2g} standard deviations), "
        "which acts on it and on measured at different points of the motion"
    )


def _of_motion(
    target: NDArray[np.float64], tracking: Tracking, trusted: Tracking
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The bins' frequencies, and their weights less what the target's own noise, taken for white, adds to each."""
    frequency, weights = tracking.frequency_hz, tracking.weights
    assert frequency is not None
    assert weights is not None
    if not float(trusted.target_noise_std) > 0 or tracking.settings.weight_power != 2:
        return frequency, weights
    share = (float(trusted.target_noise_std) / float(target.std())) ** 2
    noise = share * tracking.delta_f_hz / (tracking.rate_hz / 2)
    return frequency, np.where(weights > _CLEAR_OF_NOISE * noise, weights - noise, 0.0)


def _averaged(
    target: NDArray[np.float64], tracking: Tracking, trusted: Tracking, name: str
) -> tuple[float, float] | None:
    """What the published average makes of the trusted number, were it the same at every frequency.

    Without the target's own noise, and with it: it weighs bins that hold nothing else.
    """
    if tracking.settings.estimator != "fei":
        return None
    frequency, motion = _of_motion(target, tracking, trusted)
    turned = complex((motion * np.exp(-2j * np.pi * float(trusted.delay_s) * frequency)).sum())
    if name == "amplitude":
        noisy = abs(turned) * float(trusted.amplitude)
        return noisy / float(motion.sum()), noisy
    delay = -float(np.angle(turned)) / (2 * math.pi)
    return delay * float(motion.sum() / (motion * frequency).sum()), delay / float(tracking.equivalent_frequency_hz)


def _percent(value: float) -> str:
    """Two digits, and no power of ten: 0.12, 1.8, 44, 100."""
    return f"{value:.0f}" if value >= 9.95 else f"{value:.2g}"


def exceeded(tracking: Tracking, limits: Limits) -> tuple[str, ...]:
    """Each limit that was exceeded, in one sentence."""
    found = []
    delay_s, error = float(tracking.delay_s), abs(float(tracking.amplitude) - 1)
    if limits.delay_s is not None and abs(delay_s) > limits.delay_s:
        found.append(f"|delay| {1e3 * abs(delay_s):.4g} ms exceeds the limit of {1e3 * limits.delay_s:.4g} ms")
    if limits.amplitude is not None and error > limits.amplitude:
        found.append(f"|amplitude - 1| {error:.4g} exceeds the limit of {limits.amplitude:.4g}")
    return tuple(found)


def unchecked(tracking: Tracking, limits: Limits) -> tuple[str, ...]:
    """That a limit could not be checked, as there is no number to hold against it."""
    if (limits.delay_s is None and limits.amplitude is None) or _undetermined(tracking) is None:
        return ()
    return ("no limit was checked: gain and delay are not determined",)


def warnings(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    tracking: Tracking,
    trusted: Tracking,
    moving: MovingTracking | None,
    response: FrequencyResponse | None,
    rms_error_percent: float,
    depends: Dependence | None = None,
    units: tuple[str | None, str | None] = (None, None),
    names: tuple[str, str] = ("target", "measured"),
) -> dict[str, str]:
    """What makes the numbers less trustworthy than they look, by name, most serious first.

    `tracking` carries its weights.
    """
    duration_s = tracking.n_samples / tracking.rate_hz
    # Of these channels what is clipped or held is told already.
    told = {bad.channel for bad in _of_one(trusted) if bad.kind in ("clipped", "held")}
    found = {
        "units": _unlike_units(units, names),
        "wrap": _wrap(tracking, names),
        "amplitude": _odd_amplitude(tracking if math.isnan(float(trusted.amplitude)) else trusted, units),
        "bad samples": _bad_samples(trusted, names),
        "clipped target": _clipped(target, names[0]) if "target" not in told else None,
        "clipped measured": _clipped(measured, names[1]) if "measured" not in told else None,
        "offset": _offset(target, measured, trusted, rms_error_percent, units, names),
        "drift": _drift(target, tracking, duration_s),
        "noise": _high_energy(tracking),
        "target noise": _target_noise(target, trusted, names),
        "coherence": _coherence(tracking, response, names),
        "delay spread": _delay_spread(tracking, trusted, response) if _by_frequency(depends) else None,
        "levels": _levels(target, names[0]),
        "quiet": _quiet(moving, names[0]),
    }
    return {name: text for name, text in found.items() if text}


def _unlike_units(units: tuple[str | None, str | None], names: tuple[str, str]) -> str | None:
    target, measured = units
    if target is None or measured is None or target == measured:
        return None
    factor = length_factor(measured, target)
    if factor == 1:
        return None
    hint = f" (--scale '{names[1]}={factor:g}' brings it to {target})" if factor else " (use --scale)"
    return f"unlike units: target is in {target}, measured in {measured}; amplitude is their raw ratio{hint}"


def _wrap(tracking: Tracking, names: tuple[str, str]) -> str | None:
    phase = float(tracking.phase_rad)
    if not abs(phase) >= _WRAP_RAD:
        return None
    turn_s = 1 / float(tracking.equivalent_frequency_hz)
    return (
        f"phase {math.degrees(phase):.0f} degrees is near half a turn: the delay may be off by a whole turn "
        f"({1e3 * turn_s:.0f} ms), or {names[1]} has the opposite sign (--scale '{names[1]}=-1')"
    )


def _odd_amplitude(tracking: Tracking, units: tuple[str | None, str | None]) -> str | None:
    amplitude = float(tracking.amplitude)
    if math.isnan(amplitude) or 1 / _ODD_AMPLITUDE < amplitude < _ODD_AMPLITUDE or units[0] != units[1]:
        return None
    return f"amplitude {amplitude:.3g} is far from 1: are both channels displacements in the same unit? (--scale)"


def _by_frequency(depends: Dependence | None) -> bool:
    return depends is not None and depends.kind == "frequency"


def _offset(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    trusted: Tracking,
    rms_error_percent: float,
    units: tuple[str | None, str | None],
    names: tuple[str, str],
) -> str | None:
    """That measured stands higher or lower than target, by more than gain and delay make it."""
    if _undetermined(trusted) is not None or units[0] != units[1]:
        return None
    # The median, of which a spike is no part.
    off = float(np.median(measured - float(trusted.amplitude) * target))
    if abs(off) < _STANDS_OFF * float(target.std()):
        return None
    unit = f" {units[0]}" if units[0] else ""
    where = "higher" if off > 0 else "lower"
    much = f"{rms_error_percent / 100:.3g} times target's rms" if rms_error_percent >= 1000 else ""
    return (
        f"{names[1]} stands {abs(off):.4g}{unit} {where} than {names[0]}, which makes the rms error "
        f"{much or _percent(rms_error_percent) + ' %'}"
    )


def _drift(target: NDArray[np.float64], tracking: Tracking, duration_s: float) -> str | None:
    frequency, weights = tracking.frequency_hz, tracking.weights
    if frequency is None or weights is None or tracking.settings.detrend == "linear":
        return None
    edge = _DRIFT_CYCLES / duration_s
    share = float(weights[frequency <= edge].sum())
    if share < _DRIFT_SHARE:
        return None
    spread = float(target.std())
    ends = max(1, target.size // 50)
    first, last = float(target[:ends].mean()), float(target[-ends:].mean())
    offset, residual = abs(float(target.mean())), abs(last - first)
    blame = []
    if tracking.settings.detrend == "none" and offset > _OFFSET_STD * spread:
        blame.append(f"an offset (mean {target.mean():.3g})")
    if residual > _OFFSET_STD * spread:
        blame.append(f"a residual displacement ({last - first:+.3g} from start to end)")
    if not blame:
        return None
    remedy = "--detrend linear" if residual > _OFFSET_STD * spread else "--detrend mean"
    return (
        f"{' and '.join(blame)} puts {100 * share:.0f} % of the weight below {edge:.2g} Hz, where phase says little: "
        f"try {remedy} or --band"
    )


def _high_energy(tracking: Tracking) -> str | None:
    frequency, weights = tracking.frequency_hz, tracking.weights
    if frequency is None or weights is None:
        return None
    edge = _HIGH_FACTOR * float(tracking.equivalent_frequency_hz)
    share = float(weights[frequency > edge].sum())
    if share < _HIGH_SHARE:
        return None
    return (
        f"{100 * share:.1f} % of the weight lies above {edge:.3g} Hz, far above the response: "
        f"noise there counts as motion; try --band or -P"
    )


def _target_noise(target: NDArray[np.float64], trusted: Tracking, names: tuple[str, str]) -> str | None:
    """That the trusted estimate had to reckon with noise on the target, where that is worth a word."""
    noise, spread = float(trusted.target_noise_std), float(target.std())
    # What is too fast to be read between samples cannot be told from noise.
    if not noise > 0 or "too fast" in str(trusted.reason):
        return None
    steps = max(float(np.mean(np.diff(target) ** 2)) - 2 * noise**2, 0.0)
    if noise < _TARGET_NOISE * spread and _PULL * noise**2 < _SAME_DELAY_S * trusted.rate_hz * steps:
        return None
    return (
        f"{names[0]} holds noise of its own, {_percent(100 * noise / spread)} % of its standard deviation: the trusted "
        "estimate takes it into account, the published average does not (--band leaves less of it)"
    )


def _weighted(tracking: Tracking, response: FrequencyResponse) -> NDArray[np.float64]:
    """The target's energy at the response's frequencies, within those that were judged."""
    assert tracking.frequency_hz is not None
    low, high = tracking.frequency_hz[0], tracking.frequency_hz[-1]
    judged = (response.frequency_hz >= low) & (response.frequency_hz <= high) & np.isfinite(response.coherence)
    return np.where(judged, response.target_psd, 0.0)


def _coherence(tracking: Tracking, response: FrequencyResponse | None, names: tuple[str, str]) -> str | None:
    if response is None or tracking.frequency_hz is None:
        return None
    weight = _weighted(tracking, response)
    if weight.sum() <= 0:
        return None
    coherence = float((weight * np.nan_to_num(response.coherence)).sum() / weight.sum())
    if coherence >= _LOW_COHERENCE:
        return None
    return (
        f"coherence is only {coherence:.2f} over the frequencies that carry the weight: "
        f"{names[1]} holds much that does not come from {names[0]}"
    )


def _delay_spread(tracking: Tracking, trusted: Tracking, response: FrequencyResponse | None) -> str | None:
    """Whether the delay at the frequencies that carry the middle nine tenths of the energy is one number."""
    # A sign or a turn that is not known makes any delay a curve.
    if response is None or tracking.frequency_hz is None or _undetermined(trusted) is not None:
        return None
    weight = np.where(np.nan_to_num(response.coherence) >= _LOW_COHERENCE, _weighted(tracking, response), 0.0)
    share = np.cumsum(weight)
    if share[-1] <= 0:
        return None
    carrying = (weight > 0) & (share >= 0.05 * share[-1]) & (share <= 0.95 * share[-1])
    delays, frequency = response.delay_s[carrying], response.frequency_hz[carrying]
    if delays.size < 3:
        return None
    low, high = np.quantile(delays, (0.1, 0.9))
    # Less than a hundredth of a turn at the top is no finding.
    if high - low < max(_DELAY_SPREAD * abs(float(tracking.delay_s)), 0.01 / float(frequency[-1])):
        return None
    return (
        f"the delay is not one number: {1e3 * low:.3g} to {1e3 * high:.3g} ms between {frequency[0]:.2g} and "
        f"{frequency[-1]:.2g} Hz; quote the curve of delay over frequency beside it"
    )


def _of_one(tracking: Tracking) -> tuple[BadSamples, ...]:
    """The bad samples of one pair."""
    return tuple(bad for bad in tracking.bad_samples if isinstance(bad, BadSamples))


_BAD_WORDS = {
    "spike": ("spike", "spikes"),
    "dropout": ("sample of dropouts", "samples of dropouts"),
    "frozen": ("sample in which it is frozen", "samples in which it is frozen"),
    "clipped": ("clipped sample", "clipped samples"),
}


def _bad_samples(trusted: Tracking, names: tuple[str, str]) -> str | None:
    """What is wrong with which samples, and from when."""
    said = []
    left_out = False
    for bad in _of_one(trusted):
        name = names[0] if bad.channel == "target" else names[1]
        if bad.kind == "held":
            said.append(f"{name} is refreshed every {_ordinal(bad.every)} sample only: the fresh ones are judged")
            continue
        one, many = _BAD_WORDS[bad.kind]
        said.append(f"{name} has {bad.count} {one if bad.count == 1 else many}, the first at {bad.first_s:.6g} s")
        left_out = True
    if not said:
        return None
    end = "; left out of the trusted estimate, not of the published average (--bad-samples keep keeps them)"
    return "; ".join(said) + (end if left_out else "")


def _ordinal(n: int) -> str:
    ending = "th" if n % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(n % 10, "th")
    return f"{n}{ending}"


def _clipped(signal: NDArray[np.float64], name: str) -> str | None:
    """A signal that runs into its extreme at speed and stays there; a quantised peak is reached slowly."""
    mean, spread = float(signal.mean()), float(signal.std())
    steps = np.abs(np.diff(signal))
    if not steps.any():
        return None
    fast, level = _CLIPPED_SPEED * float(steps.max()), float(steps[steps > 0].min())
    for extreme in (float(signal.max()), float(signal.min())):
        if abs(extreme - mean) < _CLIPPED_STD * spread:
            continue
        at = np.concatenate(([False], signal == extreme, [False]))
        edges = np.flatnonzero(np.diff(at.astype(np.int8)))
        starts, ends = edges[::2], edges[1::2]
        lengths = ends - starts
        hits = (lengths >= _CLIPPED_RUN) & (starts > 0) & (ends < signal.size)
        hits[hits] &= (steps[starts[hits] - 1] > fast) | (steps[ends[hits] - 1] > fast)
        # As long before or after as it stays, a quantised peak has changed by a few levels only.
        apart = np.maximum(
            np.abs(signal[np.maximum(starts - lengths, 0)] - extreme),
            np.abs(signal[np.minimum(ends - 1 + lengths, signal.size - 1)] - extreme),
        )
        hits &= apart > _CLIPPED_LEVELS * level
        if hits.any():
            n_clipped = int(lengths[hits].sum())
            return f"{name} looks clipped: {n_clipped} samples stay exactly at its extreme {extreme:g}"
    return None


def _levels(target: NDArray[np.float64], name: str) -> str | None:
    # Counting stops as soon as there are enough.
    if np.unique(target[: 20 * _FEW_LEVELS]).size > _FEW_LEVELS or (n := np.unique(target).size) > _FEW_LEVELS:
        return None
    if target.size < 4 * _FEW_LEVELS:
        return None
    steps = np.abs(np.diff(target))
    # What jumps through most of its range at once is a square wave.
    if float(np.median(steps[steps > 0])) > 0.5 * float(np.ptp(target)):
        return None
    return f"{name} is small: it takes only {n} distinct values, so quantisation limits what can be said"


def _quiet(moving: MovingTracking | None, name: str) -> str | None:
    if moving is None or moving.valid.size == 0:
        return None
    share = float(np.mean(["too little motion" in str(why) for why in moving.reason]))
    if share < 0.5:
        return None
    return (
        f"{name} is nearly still in {100 * share:.0f} % of the windows: the numbers speak for the rest "
        f"(--start and --end cut the record)"
    )
