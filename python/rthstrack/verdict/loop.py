"""What a delay does to the structure that is tested: how near it is to the critical one, what damping it takes."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.errors import SettingError
from rthstrack.evaluation.results import json_ready
from rthstrack.virtual_test.simulation import critical_delay, delay_damping

if TYPE_CHECKING:
    from rthstrack.evaluation.tracking import Tracking
    from rthstrack.virtual_test.parts import VirtualTest


@dataclass(frozen=True, slots=True)
class LoopEffect:
    """A delay in the loop of a structure with one actuator of the measured gain.

    critical_delay_s: the constant delay at which the loop becomes unstable, infinite where none does; `exact` False
    where it is of the elastic stiffness of what yields. `share` = delay_s / critical_delay_s, a lead negative.
    damping_ratio: of that mode which loses most, `frequency_hz` its frequency; `damping_lost` is what the delay takes
    of damping_ratio_without. Intervals follow from the delay's, NaN where it has none.
    """

    critical_delay_s: float
    critical_frequency_hz: float
    gain: float
    exact: bool
    share: float
    share_interval: tuple[float, float]
    frequency_hz: float
    damping_ratio_without: float
    damping_ratio: float
    damping_lost: float
    damping_lost_interval: tuple[float, float]

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers; None where there is no number."""
        return {name: json_ready(value) for name, value in dataclasses.asdict(self).items()}

    @property
    def sentence(self) -> str:
        """In one sentence."""
        if math.isinf(self.critical_delay_s):
            near = "no constant delay makes the loop unstable"
        else:
            share = _percent(self.share, self.share_interval)
            near = f"the delay is {share} of the critical {1e3 * self.critical_delay_s:.4g} ms"
        if not self.share > 0:
            return "measured does not lag: it comes no nearer to the critical delay and takes no damping away"
        without = 100 * self.damping_ratio_without
        lost = _percent(self.damping_lost, self.damping_lost_interval)
        said = f"{near} and takes away {lost} of critical damping; the structure has {without:.3g} % at "
        said += f"{self.frequency_hz:.3g} Hz"
        return said if self.exact else f"{said} (all members taken as elastic)"


def loop_effect(test: VirtualTest, tracking: Tracking) -> LoopEffect | None:
    """What the delay and gain of a tracking do to the loop of a test's only actuator; None where there is no number.

    Delay, gain, dynamics and compensation of the test itself have no part in it. Raises ConfigurationError with several
    actuators, SettingError without a structure.
    """
    check_structure(test)
    delay_s, gain = float(tracking.delay_s), float(tracking.amplitude)
    if math.isnan(delay_s) or not gain > 0:
        return None
    actuator = dataclasses.replace(test.actuators[0], gain=gain, delay_s=0.0, dynamics=None, compensation=None)
    test = dataclasses.replace(test, actuators=(actuator,))
    critical = critical_delay(test)
    interval = tuple(float(end) for end in tracking.delay_interval_s)
    read = delay_damping(test, max(delay_s, 0.0))
    lost = read.damping_ratio_without - read.damping_ratio
    mode = int(np.argmax(lost))

    def lost_at(end_s: float) -> float:
        if math.isnan(end_s):
            return math.nan
        found = delay_damping(test, max(end_s, 0.0))
        return float(found.damping_ratio_without[mode] - found.damping_ratio[mode])

    def share(at_s: float) -> float:
        return at_s / critical.delay_s if critical.delay_s > 0 else math.inf

    return LoopEffect(
        critical_delay_s=critical.delay_s,
        critical_frequency_hz=critical.frequency_hz,
        gain=gain,
        exact=critical.exact,
        share=share(delay_s),
        share_interval=(share(interval[0]), share(interval[1])),
        frequency_hz=float(read.frequency_hz[mode]),
        damping_ratio_without=float(read.damping_ratio_without[mode]),
        damping_ratio=float(read.damping_ratio[mode]),
        damping_lost=float(lost[mode]),
        damping_lost_interval=(lost_at(interval[0]), lost_at(interval[1])),
    )


def check_structure(test: VirtualTest) -> None:
    """Raises SettingError unless there is a structure with one actuator."""
    if not test.structure.n_dof:
        raise SettingError("structure: the configuration has none; expected [structure] with one [[actuator]]")
    if len(test.actuators) != 1:
        raise SettingError(f"structure: expected one actuator, found {len(test.actuators)}")


def _percent(value: float, interval: tuple[float, float]) -> str:
    low, high = (100 * end for end in interval)
    if not math.isfinite(high - low):
        return f"{100 * value:.3g} %"
    half = (high - low) / 2
    places = 2 if half <= 0 else max(0, min(4, 1 - math.floor(math.log10(half))))
    return f"{100 * value:.{places}f} % ({low:.{places}f} to {high:.{places}f})"
