"""What is odd about a pair, in one sentence each."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.evaluation.bad_samples import BadSamples
from rthstrack.recording.copies import is_copy
from rthstrack.said import Said
from rthstrack.units import length_factor
from rthstrack.values import median, n_distinct, quantile
from rthstrack.verdict.difference import _SAME_DELAY_S
from rthstrack.verdict.limits import motion_in_windows
from rthstrack.verdict.sentence import _percent, _undetermined

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rthstrack.evaluation.dependence import Dependence
    from rthstrack.evaluation.response import FrequencyResponse
    from rthstrack.evaluation.tracking import MovingTracking, Tracking

# Beyond three eighths of a turn a phase may as well be a turn less.
_WRAP_RAD = 0.75 * math.pi
# Drift: this much of the weight at fewer cycles in the record than a response has.
_DRIFT_SHARE, _DRIFT_CYCLES = 0.05, 4.0
# Offset or residual displacement, in standard deviations of the target, from which drift is blamed on it.
_OFFSET_STD = 0.25
# Energy this far above the equivalent frequency is no structural response.
_HIGH_SHARE, _HIGH_FACTOR = 0.02, 8.0
_COHERENT = 0.9
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
# A thousand or a thousandth, but for so much, is a question of units.
_THOUSAND = 1.5
# Spread of the delay over the frequencies that carry the weight, as a share of the delay.
_DELAY_SPREAD = 0.2

# An offset of measured is told from this share of target's deviation on.
_STANDS_OFF = 0.25


#: What is said of the published average alone.
OF_PUBLISHED = ("half_turn", "drift", "high_energy")


def warnings(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    tracking: Tracking,
    published: Tracking,
    trusted: Tracking,
    moving: MovingTracking | None,
    response: FrequencyResponse | None,
    rms_error_percent: float,
    depends: Dependence | None = None,
    units: tuple[str | None, str | None] = (None, None),
    names: tuple[str, str] = ("target", "measured"),
) -> dict[str, Said]:
    """What makes the numbers less trustworthy than they look, by code, most serious first.

    `tracking`, the estimate that is judged, and `published` carry their weights.
    """
    duration_s = tracking.n_samples / tracking.rate_hz
    # Of these channels what is clipped or held is told already.
    told = {bad.channel for bad in _of_one(trusted) if bad.kind in ("clipped", "held")}
    found = (
        copied(target, measured, names),
        _unlike_units(units, names),
        _wrap(published, names),
        _odd_amplitude(tracking if math.isnan(float(trusted.amplitude)) else trusted, units),
        _bad_samples(trusted, names),
        _clipped(target, names[0], "clipped_target") if "target" not in told else None,
        _clipped(measured, names[1], "clipped_measured") if "measured" not in told else None,
        _offset(target, measured, trusted, rms_error_percent, units, names),
        _drift(target, published, duration_s),
        _high_energy(published),
        _target_noise(target, trusted, names),
        _coherence(tracking, response, names),
        _delay_spread(tracking, trusted, response) if _by_frequency(depends) else None,
        _levels(target, names[0]),
        _quiet(target, moving, names[0]),
    )
    return {warning.code: warning for warning in found if warning is not None}


def copied(
    target: NDArray[np.float64], measured: NDArray[np.float64], names: tuple[str, str] = ("target", "measured")
) -> Said | None:
    """That both channels hold the same samples, which no sensor makes: nothing was measured."""
    if not is_copy(target, measured):
        return None
    cause = f"{names[1]} is an exact copy of {names[0]}, so nothing was measured"
    return Said(f"{cause}: is the right channel named?", "copy", (), cause)


def _unlike_units(units: tuple[str | None, str | None], names: tuple[str, str]) -> Said | None:
    target, measured = units
    if target is None or measured is None or target == measured:
        return None
    factor = length_factor(measured, target)
    if factor == 1:
        return None
    hint = f" (--scale '{names[1]}={factor:g}' brings it to {target})" if factor else " (use --scale)"
    words = f"unlike units: target is in {target}, measured in {measured}; amplitude is their raw ratio{hint}"
    return Said(words, "unlike_units", [factor] if factor else ())


def _wrap(tracking: Tracking, names: tuple[str, str]) -> Said | None:
    phase = float(tracking.phase_rad)
    if not abs(phase) >= _WRAP_RAD:
        return None
    turn_s = 1 / float(tracking.equivalent_frequency_hz)
    return Said(
        f"phase {math.degrees(phase):.0f} degrees is near half a cycle (180): the delay may be wrong by a whole cycle "
        f"({1e3 * turn_s:.0f} ms), or {names[1]} has the opposite sign (--scale '{names[1]}=-1')",
        "half_turn",
        (phase, turn_s),
    )


def _odd_amplitude(tracking: Tracking, units: tuple[str | None, str | None]) -> Said | None:
    amplitude = float(tracking.amplitude)
    if math.isnan(amplitude) or 1 / _ODD_AMPLITUDE < amplitude < _ODD_AMPLITUDE:
        return None
    if None not in units and units[0] != units[1]:
        return None
    words = f"amplitude {amplitude:.3g} is far from 1: are both channels displacements in the same unit? (--scale)"
    for factor, of, to in ((1e-3, "mm", "m"), (1e3, "m", "mm")):
        if 1 / _THOUSAND < amplitude / factor < _THOUSAND:
            words = f"amplitude {amplitude:.3g}: is target in {of} and measured in {to}? "
            words += f"(--unit CHANNEL={to}, or --scale)"
    return Said(words, "odd_amplitude", [amplitude])


def _by_frequency(depends: Dependence | None) -> bool:
    return depends is not None and depends.kind == "frequency"


def _offset(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    trusted: Tracking,
    rms_error_percent: float,
    units: tuple[str | None, str | None],
    names: tuple[str, str],
) -> Said | None:
    """That measured stands higher or lower than target, by more than gain and delay make it."""
    if _undetermined(trusted) is not None or units[0] != units[1]:
        return None
    # The median, of which a spike is no part.
    off = median(measured - float(trusted.amplitude) * target)
    if abs(off) < _STANDS_OFF * float(target.std()):
        return None
    unit = f" {units[0]}" if units[0] else ""
    where = "higher" if off > 0 else "lower"
    much = f"{rms_error_percent / 100:.3g} times target's rms" if rms_error_percent >= 1000 else ""
    return Said(
        f"{names[1]} stands {abs(off):.4g}{unit} {where} than {names[0]}, which makes the rms error "
        f"{much or _percent(rms_error_percent) + ' %'}",
        "offset",
        (off, rms_error_percent / 100),
    )


def _drift(target: NDArray[np.float64], tracking: Tracking, duration_s: float) -> Said | None:
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
    put = "put" if len(blame) > 1 else "puts"
    cause = f"{' and '.join(blame)} {put} {100 * share:.0f} % of the weight below {edge:.2g} Hz, "
    cause += "where the phase tells little"
    return Said(f"{cause}: try {remedy} or --band", "drift", (share, edge), cause)


def _high_energy(tracking: Tracking) -> Said | None:
    frequency, weights = tracking.frequency_hz, tracking.weights
    if frequency is None or weights is None:
        return None
    edge = _HIGH_FACTOR * float(tracking.equivalent_frequency_hz)
    share = float(weights[frequency > edge].sum())
    if share < _HIGH_SHARE:
        return None
    return Said(
        f"{100 * share:.1f} % of the weight lies above {edge:.3g} Hz, far above the response: "
        f"noise there counts as motion; try --band or -P",
        "high_energy",
        (share, edge),
    )


def _target_noise(target: NDArray[np.float64], trusted: Tracking, names: tuple[str, str]) -> Said | None:
    """That the trusted estimate had to reckon with noise on the target, where that is worth a word."""
    noise, spread = float(trusted.target_noise_std), float(target.std())
    # What is too fast to be read between samples cannot be told from noise.
    if not noise > 0 or trusted.reason_code == "too_fast":
        return None
    steps = max(float(np.mean(np.diff(target) ** 2)) - 2 * noise**2, 0.0)
    if noise < _TARGET_NOISE * spread and _PULL * noise**2 < _SAME_DELAY_S * trusted.rate_hz * steps:
        return None
    return Said(
        f"{names[0]} contains noise, {_percent(100 * noise / spread)} % of its standard deviation: the trusted "
        "estimate takes it into account, the published average does not (--band reduces it)",
        "target_noise",
        [noise / spread],
    )


def _weighted(tracking: Tracking, response: FrequencyResponse) -> NDArray[np.float64]:
    """The target's energy at the response's frequencies, within those that were judged."""
    assert tracking.frequency_hz is not None
    low, high = tracking.frequency_hz[0], tracking.frequency_hz[-1]
    judged = (response.frequency_hz >= low) & (response.frequency_hz <= high) & np.isfinite(response.coherence)
    return np.where(judged, response.target_psd, 0.0)


def _coherence(tracking: Tracking, response: FrequencyResponse | None, names: tuple[str, str]) -> Said | None:
    if response is None or tracking.frequency_hz is None:
        return None
    weight = _weighted(tracking, response)
    if weight.sum() <= 0:
        return None
    coherence = float((weight * np.nan_to_num(response.coherence)).sum() / weight.sum())
    if coherence >= _COHERENT:
        return None
    return Said(
        f"coherence is only {coherence:.2f} at the frequencies of the motion (1 is perfect): "
        f"much of {names[1]} does not come from {names[0]}",
        "coherence",
        [coherence],
    )


def _delay_spread(tracking: Tracking, trusted: Tracking, response: FrequencyResponse | None) -> Said | None:
    """Whether the delay at the frequencies that carry the middle nine tenths of the energy is one number."""
    # A sign or a turn that is not known makes any delay a curve.
    if response is None or tracking.frequency_hz is None or _undetermined(trusted) is not None:
        return None
    weight = np.where(np.nan_to_num(response.coherence) >= _COHERENT, _weighted(tracking, response), 0.0)
    share = np.cumsum(weight)
    if share[-1] <= 0:
        return None
    carrying = (weight > 0) & (share >= 0.05 * share[-1]) & (share <= 0.95 * share[-1])
    delays, frequency = response.delay_s[carrying], response.frequency_hz[carrying]
    if delays.size < 3:
        return None
    low, high = (quantile(delays, share) for share in (0.1, 0.9))
    # Less than a hundredth of a turn at the top is no finding.
    if high - low < max(_DELAY_SPREAD * abs(float(tracking.delay_s)), 0.01 / float(frequency[-1])):
        return None
    return Said(
        f"the delay is not one number: {1e3 * low:.3g} to {1e3 * high:.3g} ms between {frequency[0]:.2g} and "
        f"{frequency[-1]:.2g} Hz; report the curve of delay over frequency beside it",
        "delay_spread",
        (low, high),
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


def _bad_samples(trusted: Tracking, names: tuple[str, str]) -> Said | None:
    """What is wrong with which samples, and from when."""
    said = []
    left_out = False
    for bad in _of_one(trusted):
        name = names[0] if bad.channel == "target" else names[1]
        if bad.kind == "held":
            said.append(f"{name} has a new value only at every {_ordinal(bad.every)} sample: only those are judged")
            continue
        one, many = _BAD_WORDS[bad.kind]
        said.append(f"{name} has {bad.count} {one if bad.count == 1 else many}, the first at {bad.first_s:.6g} s")
        left_out = True
    if not said:
        return None
    cause = "; ".join(said)
    end = "; left out of the trusted estimate but not of the published average (--bad-samples keep keeps them)"
    return Said(cause + (end if left_out else ""), "bad_samples", [bad.count for bad in _of_one(trusted)], cause)


def _ordinal(n: int) -> str:
    ending = "th" if n % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(n % 10, "th")
    return f"{n}{ending}"


def _clipped(signal: NDArray[np.float64], name: str, code: str) -> Said | None:
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
            words = f"{name} looks clipped: {n_clipped} samples stay exactly at its extreme {extreme:g}"
            return Said(words, code, (n_clipped, extreme))
    return None


def _levels(target: NDArray[np.float64], name: str) -> Said | None:
    # Counting stops as soon as there are enough.
    if n_distinct(target[: 20 * _FEW_LEVELS]) > _FEW_LEVELS or (n := n_distinct(target)) > _FEW_LEVELS:
        return None
    if target.size < 4 * _FEW_LEVELS:
        return None
    steps = np.abs(np.diff(target))
    # What jumps through most of its range at once is a square wave.
    if median(steps[steps > 0]) > 0.5 * float(np.ptp(target)):
        return None
    words = f"{name} is small: it takes only {n} distinct values, so quantisation limits the accuracy"
    return Said(words, "few_levels", [n])


def _quiet(target: NDArray[np.float64], moving: MovingTracking | None, name: str) -> Said | None:
    if moving is None or moving.valid.size == 0:
        return None
    share = float(np.mean(motion_in_windows(target, moving) < moving.minimum_std_ratio))
    if share < 0.5:
        return None
    return Said(
        f"{name} is nearly still in {100 * share:.0f} % of the windows: the numbers describe only the rest "
        f"(--start and --end cut the record)",
        "quiet",
        [share],
    )
