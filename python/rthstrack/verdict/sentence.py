"""The verdict in one sentence, and why there is no number."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, cast

import numpy as np

from rthstrack.said import Said, of_core, undetermined

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rthstrack.evaluation.dependence import Dependence
    from rthstrack.evaluation.tracking import Tracking

# An amplitude this near to one is called right: no displacement sensor of a test rig is better.
_RIGHT_AMPLITUDE = 5e-4

# A delay below this is none: no test rig's clocks agree better.
_IN_TIME_S = 1e-7

# A target is still in a band that holds less than this share of its motion, the step of a converter of 20 bits.
_STILL = 1e-6


def sentence(
    tracking: Tracking, target: str = "target", measured: str = "measured", *, on_average: bool = False
) -> str:
    """The verdict, for example: measured lags target by 13.2 ms and is 1.8 % too large, judged at 0.9 Hz.

    `on_average`: gain or delay are not one number.
    """
    delay_s, amplitude = float(tracking.delay_s), float(tracking.amplitude)
    if math.isnan(delay_s):
        said = _undetermined(tracking)
        if said is not None and (said.code, said.values) == _NO_MOTION:
            return f"{measured} does not move: it has no delay"
        return f"not determined: {said}"
    milliseconds = f"{1e3 * abs(delay_s):.3g} ms"
    if abs(delay_s) < _IN_TIME_S:
        timing = f"{measured} is in time with {target}"
    else:
        timing = f"{measured} {'lags' if delay_s > 0 else 'leads'} {target} by {milliseconds}"
    if on_average:
        timing += " on average"
    excess = 100 * (amplitude - 1)
    if abs(amplitude - 1) < _RIGHT_AMPLITUDE:
        size = "has the right amplitude"
    elif amplitude > 2:
        size = f"is {amplitude:.3g} times as large"
    else:
        size = f"is {_percent(abs(excess))} % too {'large' if excess > 0 else 'small'}"
    return f"{timing} and {size}, judged at {float(tracking.equivalent_frequency_hz):.2g} Hz"


# What measured that does not move is called: nothing of it follows target.
_NO_MOTION: tuple[str, tuple[float, ...]] = ("low_coherence", ())
# Of so much uncertainty, in seconds, the core itself says no more than that.
_BOUNDLESS_S = 1.0


def reason(tracking: Tracking) -> Said | None:
    """Why a number or its interval is missing; None where nothing is, and for the published estimator's intervals."""
    code, values = str(tracking.reason_code), tracking.reason_values
    if not tracking.reason:
        return undetermined("measured does not move", *_NO_MOTION) if math.isnan(float(tracking.delay_s)) else None
    # So wide that the number means nothing but that.
    if code == "uncertain" and tracking.n_samples / tracking.rate_hz < values[0] <= _BOUNDLESS_S:
        advice = "take a longer window or a band with less noise"
        return undetermined(f"the noise is too strong to find the delay; {advice}", code, values)
    return of_core(str(tracking.reason), code, values)


def with_cause(tracking: Tracking, depends: Dependence | None) -> Tracking:
    """The same, its reason with the cause that was found; noise on target makes the residual follow target, too."""
    if tracking.reason_code != "residual_follows_target":
        return tracking
    if depends is not None:
        over = {"amplitude": "with amplitude", "frequency": "with frequency"}.get(depends.kind, "over time")
        words = (
            "one gain and one delay do not explain measured (the residual follows target, coherence {:.2f}), so they "
        )
        words += f"change {over}"
    elif float(tracking.target_noise_std) > 0:
        words = "noise on target makes the residual follow target (coherence {:.2f})"
    else:
        return tracking
    (coherence,) = cast("tuple[float]", tracking.reason_values)
    return dataclasses.replace(tracking, reason=f"no interval: {words.format(coherence)}")


def still_in_band(target: NDArray[np.float64], tracking: Tracking) -> Said | None:
    """That target does not move in the band asked for: then gain and delay there are rounding's. Needs the spectra."""
    band, spectrum = tracking.settings.band_hz, tracking.target_spectrum
    if band is None or spectrum is None:
        return None
    # By Parseval, and the bins that Q leaves out like their neighbours.
    n = tracking.rate_hz / tracking.delta_f_hz * tracking.settings.frequency_decimation
    squares = 2 * tracking.settings.frequency_decimation * float(np.sum(np.abs(spectrum) ** 2)) / n
    if squares > (_STILL * float(target.std())) ** 2 * target.size:
        return None
    return undetermined(f"target does not move between {band[0]:.3g} and {band[1]:.3g} Hz", "still_in_band", band)


def no_motion(measured: NDArray[np.float64]) -> Said | None:
    """That measured stands still: what follows nothing has no delay, and is no matter of too little motion."""
    return undetermined("measured does not move", *_NO_MOTION) if measured.min() == measured.max() else None


def _undetermined(tracking: Tracking) -> Said | None:
    """Why there is no number, without a heading; None where there is one."""
    if not math.isnan(float(tracking.delay_s)) or (why := reason(tracking)) is None:
        return None
    return Said(why.cause, why.code, why.values)


def _percent(value: float) -> str:
    """Two digits, and no power of ten: 0.12, 1.8, 44, 100."""
    return f"{value:.0f}" if value >= 9.95 else f"{value:.2g}"
