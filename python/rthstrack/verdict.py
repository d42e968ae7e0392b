"""What a good engineer would say of the numbers: one sentence, and the warnings that go with it.

Everything here reads results; nothing changes them. The thresholds stand at the top, each with its reason.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.readers.units import length_factor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rthstrack.assessment import Limits
    from rthstrack.tracking import FrequencyResponse, MovingTracking, Tracking

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
_ODD_AMPLITUDE = 3.0
# Spread of the delay over the frequencies that carry the weight, as a share of the delay.
_DELAY_SPREAD = 0.2


def sentence(tracking: Tracking, target: str = "target", measured: str = "measured") -> str:
    """The verdict, for example: measured lags target by 13.2 ms and is 1.8 % too large, judged at 0.9 Hz."""
    delay_s, amplitude = float(tracking.delay_s), float(tracking.amplitude)
    if math.isnan(delay_s):
        return f"{measured} does not move: it has no delay"
    milliseconds = f"{1e3 * abs(delay_s):.3g} ms"
    if float(f"{1e3 * abs(delay_s):.3g}") == 0:
        timing = f"{measured} is in time with {target}"
    else:
        timing = f"{measured} {'lags' if delay_s > 0 else 'leads'} {target} by {milliseconds}"
    excess = 100 * (amplitude - 1)
    if abs(amplitude - 1) < _RIGHT_AMPLITUDE:
        size = "has the right amplitude"
    elif amplitude > 2:
        size = f"is {amplitude:.3g} times too large"
    else:
        size = f"is {_percent(abs(excess))} % too {'large' if excess > 0 else 'small'}"
    return f"{timing} and {size}, judged at {float(tracking.equivalent_frequency_hz):.2g} Hz"


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


def warnings(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    tracking: Tracking,
    moving: MovingTracking | None,
    response: FrequencyResponse | None,
    units: tuple[str | None, str | None] = (None, None),
    names: tuple[str, str] = ("target", "measured"),
) -> tuple[str, ...]:
    """What makes the numbers less trustworthy than they look, most serious first; `tracking` carries its weights."""
    duration_s = tracking.n_samples / tracking.rate_hz
    found = [
        _unlike_units(units, names),
        _wrap(tracking, names),
        _odd_amplitude(tracking, units),
        *(_clipped(signal, name) for signal, name in zip((target, measured), names, strict=True)),
        _drift(target, tracking, duration_s),
        _high_energy(tracking),
        _coherence(tracking, response, names),
        _delay_spread(tracking, response),
        _levels(target, names[0]),
        _quiet(moving, names[0]),
    ]
    return tuple(w for w in found if w)


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
    if abs(phase) < _WRAP_RAD:
        return None
    turn_s = 1 / float(tracking.equivalent_frequency_hz)
    return (
        f"phase {math.degrees(phase):.0f} degrees is near half a turn: the delay may be off by a whole turn "
        f"({1e3 * turn_s:.0f} ms), or {names[1]} has the opposite sign (--scale '{names[1]}=-1')"
    )


def _odd_amplitude(tracking: Tracking, units: tuple[str | None, str | None]) -> str | None:
    amplitude = float(tracking.amplitude)
    if 1 / _ODD_AMPLITUDE < amplitude < _ODD_AMPLITUDE or units[0] != units[1]:
        return None
    return f"amplitude {amplitude:.3g} is far from 1: are both channels displacements in the same unit? (--scale)"


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


def _delay_spread(tracking: Tracking, response: FrequencyResponse | None) -> str | None:
    """Whether the delay at the frequencies that carry the middle nine tenths of the energy is one number."""
    if response is None or tracking.frequency_hz is None:
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


def _clipped(signal: NDArray[np.float64], name: str) -> str | None:
    """A signal that runs into its extreme at speed and stays there; a quantised peak is reached slowly."""
    mean, spread = float(signal.mean()), float(signal.std())
    steps = np.abs(np.diff(signal))
    if not steps.any():
        return None
    fast = _CLIPPED_SPEED * float(steps.max())
    for extreme in (float(signal.max()), float(signal.min())):
        if abs(extreme - mean) < _CLIPPED_STD * spread:
            continue
        at = np.concatenate(([False], signal == extreme, [False]))
        edges = np.flatnonzero(np.diff(at.astype(np.int8)))
        starts, ends = edges[::2], edges[1::2]
        hits = (ends - starts >= _CLIPPED_RUN) & (starts > 0) & (ends < signal.size)
        hits[hits] &= (steps[starts[hits] - 1] > fast) | (steps[ends[hits] - 1] > fast)
        if hits.any():
            n_clipped = int((ends - starts)[hits].sum())
            return f"{name} looks clipped: {n_clipped} samples stay exactly at its extreme {extreme:g}"
    return None


def _levels(target: NDArray[np.float64], name: str) -> str | None:
    # Counting stops as soon as there are enough.
    if np.unique(target[: 20 * _FEW_LEVELS]).size > _FEW_LEVELS or (n := np.unique(target).size) > _FEW_LEVELS:
        return None
    if target.size < 4 * _FEW_LEVELS:
        return None
    return f"{name} is small: it takes only {n} distinct values, so quantisation limits what can be said"


def _quiet(moving: MovingTracking | None, name: str) -> str | None:
    if moving is None or moving.valid.size == 0:
        return None
    share = 1 - float(moving.valid.mean())
    if share < 0.5:
        return None
    return (
        f"{name} is nearly still in {100 * share:.0f} % of the windows: the numbers speak for the rest "
        f"(--start and --end cut the record)"
    )
