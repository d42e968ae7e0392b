"""Which of two estimates to use, and why, in one sentence."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rthstrack.verdict.difference import _differences
from rthstrack.verdict.sentence import _percent, _undetermined
from rthstrack.verdict.variation import _MINOR_CHANGE, _in_words, _varying, _varying_slowly

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from rthstrack.evaluation.dependence import Dependence
    from rthstrack.evaluation.response import FrequencySlopes
    from rthstrack.evaluation.tracking import Tracking
    from rthstrack.said import Said

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

# Changes that are tried; another average last, as it costs the most.
_SUSPECTS = ("bad_samples", "detrend", "window", "band")

# What to do where the reason itself does not say, by its code.
_ADVICE = {
    "still": "; are these the right channels?",
    "no_convergence": "; judge only the frequencies at which target moves (--band)",
    "opposite_sign": " (--scale CHANNEL=-1 turns one round)",
}
_ENDS_APART = "the record cuts target and measured at different points of the motion"
_NAMES = {
    "fei": "the published average",
    "aligned": "the aligned average",
    "least_squares": "least squares as asked for",
}


class Argument(NamedTuple):
    """One sentence that says which number to use and why.

    told: the code of that warning which it says itself. is_average: gain or delay are not one number each.
    """

    text: str
    told: str | None = None
    is_average: bool = False


def argument(
    target: NDArray[np.float64],
    judged: Tracking,
    beside: Tracking,
    trusted: Tracking,
    depends: Dependence | None,
    slopes: FrequencySlopes | None,
    variant: Callable[[str], Tracking | None],
    found: Mapping[str, Said],
    unit: str | None = None,
    start_s: float = 0.0,
) -> Argument:
    """Which number to use and why.

    `judged` is the estimate asked for, `beside` what stands beside the trusted one (the same, or the published
    average), with weights; `variant` makes `beside` with one setting changed, None where there is no such suspect.
    `unit` is target's; `start_s` the time of the first sample.
    """
    if (missing := _undetermined(trusted)) is not None:
        said = "no number can be trusted here" if _undetermined(beside) is None else "there is no number to use"
        return Argument(f"{said}: {_advised(missing, trusted)}")
    interval = "with its interval" if not trusted.reason else f"for which there is {trusted.reason}"
    this = f"this is the trusted estimate, {interval}"
    ours = _NAMES[beside.settings.estimator]
    if (missing := _undetermined(beside)) is not None:
        use = this if judged is trusted else "use the trusted estimate"
        return Argument(f"{use}{'; ' if judged is trusted else ': '}{ours} is not determined: {missing}")
    if depends is not None and (varying := _varying(depends, unit, start_s)) is not None:
        name, text = varying
        return Argument(f"{text}; {_averages(beside, trusted, name)}", "delay_spread", is_average=True)
    if depends is None or depends.kind == "frequency":
        slowly = _varying_slowly(slopes)
    else:
        said = _in_words(depends, unit, start_s, _MINOR_CHANGE)
        slowly = f"; {said}" if said else ""
    which = _differences(beside, trusted)
    if not which:
        if judged is trusted:
            return Argument(f"{this}{slowly}; {ours} agrees with it {_how_well(beside, trusted)}")
        without = f" ({trusted.reason})" if trusted.reason else ""
        return Argument(f"{ours} agrees with the trusted estimate {_how_well(beside, trusted)}{without}{slowly}")
    causes = [_cause(target, beside, trusted, name, variant, found) for name in which]
    if len({change for change, _, _ in causes}) == 1:
        # One cause, told of the number that is off by most.
        at = max(range(len(which)), key=lambda i: _relative(which[i], beside, trusted))
        gaps = [f"{' and '.join(_gap(name, beside, trusted) for name in which)}, {causes[at][2]}"]
    else:
        gaps = [f"{_gap(name, beside, trusted)}, {text}" for name, (_, _, text) in zip(which, causes, strict=True)]
    told = next((warning for _, warning, _ in causes if warning is not None), None)
    if judged is trusted:
        return Argument(f"{this}{slowly}; {ours} gives {', and '.join(gaps)}", told)
    # What follows the target is told by how gain and delay change.
    without = f"; {trusted.reason}" if trusted.reason_code not in ("", "residual_follows_target") else ""
    return Argument(f"use the trusted estimate: {ours} gives {', and '.join(gaps)}{slowly}{without}", told)


def _advised(missing: Said, trusted: Tracking) -> str:
    """Why there is no number, with what to do about it in the command's words."""
    settings, quarter_s = trusted.settings, trusted.n_samples / trusted.rate_hz / 4
    if missing.code == "beyond_max_delay":
        if settings.max_delay_s < quarter_s:
            most = min(2 * settings.max_delay_s, quarter_s)
            return f"the delay seems to lie beyond max_delay_s, {settings.max_delay_s:g} s: try --max-delay {most:.3g}"
        return f"the delay seems to lie beyond a quarter of the record, {quarter_s:.3g} s: a longer one is needed"
    return missing + _ADVICE.get(missing.code, "")


def _how_well(tracking: Tracking, trusted: Tracking) -> str:
    if trusted.reason:
        return "within 1 %"
    inside = all(
        low <= ours <= high
        for ours, (low, high) in (
            (float(tracking.delay_s), trusted.delay_interval_s),
            (float(tracking.amplitude), trusted.amplitude_interval),
        )
    )
    if not inside:
        return "within 0.1 %"
    low, high = (1e3 * float(end) for end in trusted.delay_interval_s)
    if (high - low) / 2 > _WIDE_INTERVAL * 1e3 * abs(float(trusted.delay_s)):
        return f"within its interval, which is wide ({low:.2g} to {high:.2g} ms)"
    return "within its interval"


def _averages(tracking: Tracking, trusted: Tracking, name: str = "delay_s") -> str:
    """What single numbers are worth where gain or delay change."""

    def text(t: Tracking) -> str:
        value = float(getattr(t, name))
        return f"{1e3 * value:.3g} ms" if name == "delay_s" else f"{value:.3g}"

    if tracking is trusted or name not in _differences(tracking, trusted):
        return f"{text(trusted)} is its average"
    which = {"fei": "published", "aligned": "aligned"}.get(tracking.settings.estimator, "as asked for")
    return f"{text(tracking)} ({which}) and {text(trusted)} (trusted) are two different averages of it"


def _gap(name: str, tracking: Tracking, trusted: Tracking) -> str:
    """How far the estimate is from the trusted one: 0.026 ms less, 1.2 % more amplitude."""
    ours, theirs = float(getattr(tracking, name)), float(getattr(trusted, name))
    than = "more" if ours > theirs else "less"
    if name == "delay_s":
        return f"{_percent(1e3 * abs(ours - theirs))} ms {than}"
    return f"{_percent(100 * abs(ours / theirs - 1))} % {than} amplitude"


def _relative(name: str, tracking: Tracking, trusted: Tracking) -> float:
    """By how much a number is off, as a share of the trusted one."""
    known = float(getattr(trusted, name))
    return abs(float(getattr(tracking, name)) / known - 1) if known else math.inf


def _cause(
    target: NDArray[np.float64],
    tracking: Tracking,
    trusted: Tracking,
    name: str,
    variant: Callable[[str], Tracking | None],
    found: Mapping[str, Said],
) -> tuple[str | None, str | None, str]:
    """Why one number misses the trusted one: what is to blame, the warning that says it, and the cause in words.

    Each suspect is tried: what is left of the difference without it?
    """
    ours, theirs = float(getattr(tracking, name)), float(getattr(trusted, name))
    tried = {change: made for change in _SUSPECTS if (made := variant(change)) is not None}
    readings = {change: float(getattr(made, name)) for change, made in tried.items()}
    if (averaged := _averaged(target, tracking, trusted, name)) is not None:
        # What averaging makes of a constant gain and delay, target's own noise and all, is taken off.
        readings["average"] = ours - averaged[1] + theirs

    def remaining(reading: float) -> float:
        return abs(reading - theirs) / abs(ours - theirs)

    remains = {change: remaining(reading) for change, reading in readings.items()}
    if remains.get("bad_samples", 1.0) < _EXPLAINED and "bad_samples" in found:
        # All else that is tried still holds them.
        return "bad_samples", "bad_samples", f"because {found['bad_samples'].cause}"
    suspects = [change for change in ("detrend", "window", "band") if remains.get(change, 1.0) < _EXPLAINED]
    if remains.get("average", 1.0) < _FORETOLD:
        suspects.append("average")
    # Another average only tells that the difference is made before averaging, so it is the last to be asked.
    if not suspects and (aligned := variant("estimator")) is not None:
        readings["estimator"] = float(getattr(aligned, name))
        remains["estimator"] = remaining(readings["estimator"])
        if remains["estimator"] < _EXPLAINED:
            suspects = ["estimator"]
    if not suspects:
        return None, None, "and no single cause (drift, window, noise or large phases) explains that"
    # Noise on target that is there, and explains it, needs no help by the record's ends.
    noisy = "target_noise" in found
    by_bins = "average" in suspects or "band" in suspects
    if noisy and not by_bins and averaged is not None and abs(ours - averaged[1]) < _EXPLAINED * abs(ours - theirs):
        return "target_noise", None, "because noise on target counts as motion"
    first = [name for name in ("average", "band") if name in suspects and (noisy or name == "average")]
    cause = first[0] if first else min(suspects, key=remains.__getitem__)
    by_noise = 0.0
    if cause == "average" and averaged is not None:
        clean = averaged[0]
        by_noise = (averaged[1] - clean) / (averaged[1] - theirs)
        if by_noise > 1 - _MINOR and "band" in suspects:
            cause = "band"  # the same, with a remedy
    if cause == "average":
        noise = "noise on target counts as motion"
        if by_noise > 1 - _MINOR:
            return "target_noise", None, f"because {noise}"
        frequency, weights = _of_motion(target, tracking, trusted)
        low, high = (360 * abs(float(trusted.delay_s)) * edge for edge in _middle(frequency, weights))
        said = f"because it averages phases from {_percent(low)} to {_percent(high)} degrees"
        if low > 180:
            said = f"because phases of {low:.0f} to {high:.0f} degrees, more than half a cycle, look smaller to it"
        return cause, None, said if by_noise < _MINOR else f"{said}, and {noise}"
    window = tracking.settings.window
    scale, unit = (1e3, " ms") if name == "delay_s" else (1.0, "")
    reading = f"it gives {'d' if unit else 'A'} = {scale * readings[cause]:.4g}{unit}"
    if cause == "estimator":
        where = _ENDS_APART if window == "boxcar" else _window_apart(window)
        return cause, None, f"because {where}: with --estimator aligned {reading}"
    if cause == "band":
        low, high = tried["band"].settings.band_hz or (0.0, math.inf)
        warning = "high_energy" if "high_energy" in found else None
        return (
            cause,
            warning,
            f"because noise above {high:.3g} Hz counts as motion: with --band {low:g} {high:.3g} {reading}",
        )
    remedy = (
        f"--detrend {tried[cause].settings.detrend}"
        if cause == "detrend"
        else f"--window {tried[cause].settings.window}"
    )
    if cause == "window" and window != "boxcar":
        return cause, None, f"because {_window_apart(window)}: with {remedy} {reading}"
    if "offset" in found:
        return cause, "offset", f"because {found['offset'].cause}: with {remedy} {reading}"
    if "drift" in found:
        return cause, "drift", f"because {found['drift'].cause}: with {remedy} {reading}"
    return cause, None, f"because {_ends_apart(target)}: with {remedy} {reading}"


def _window_apart(window: str) -> str:
    return f"the {window} window weighs target and measured at different points of the motion"


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
        return _ENDS_APART
    return (
        f"target does not start and end at its mean ({first:+.2g} and {last:+.2g} standard deviations from it), and "
        "the record cuts measured at other points of the motion"
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
