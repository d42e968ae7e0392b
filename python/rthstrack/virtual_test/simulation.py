"""Virtual tests run: a structure under a ground motion, or actuators alone along a target; which delay they bear."""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np

from rthstrack._core import VirtualTest as CoreVirtualTest
from rthstrack.errors import ConfigurationError, SettingError, UnstableError
from rthstrack.values import Value
from rthstrack.virtual_test.parts import CONVERTERS, DelayHistory
from rthstrack.virtual_test.run import CriticalDelay, Run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import ArrayLike, NDArray

    from rthstrack.ground_motion.motion import GroundMotion
    from rthstrack.virtual_test.parts import VirtualTest
    from rthstrack.virtual_test.target_motion import TargetMotion

    Floats = NDArray[np.float64]

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True, repr=False)
class DelayDamping(Value):
    """What a delay does to each mode: damping ratios with and without it, and the first-order estimate.

    `first_order_change` is -(K k_e / k) omega tau / 2 with k_e the real part of the specimen's dynamic stiffness at the
    mode's frequency (its mass takes omega^2 m_e from it). Arrays (n_modes,).
    """

    frequency_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    damping_ratio_without: NDArray[np.float64]
    first_order_change: NDArray[np.float64]


def simulate(
    test: VirtualTest,
    motion: GroundMotion | TargetMotion,
    *,
    duration_s: float | None = None,
    seed: int | None = None,
) -> Run:
    """Runs a virtual test, from rest: a structure under a ground motion, or actuators alone along a target.

    A ground motion is resampled to `test.rate_hz` (linear, zero past its last sample), a target is computed there; the
    run has round(duration_s rate) + 1 samples, by default as long as the motion. `seed` is `test.seed` unless given.
    Raises ConfigurationError with every mistake, UnstableError with the time at which a displacement left its bound.
    """
    from rthstrack.ground_motion.motion import GroundMotion

    test = test if seed is None else replace(test, seed=seed)
    plan = _plan(test)
    acceleration: Floats | None = None
    target_motion, critical = None, None
    if isinstance(motion, GroundMotion):
        if not test.structure.n_dof:
            raise ConfigurationError("", [("structure", "missing: a ground motion needs one; give a target instead")])
        ground = motion.resampled(test.rate_hz, duration_s)
        acceleration, notes = np.ascontiguousarray(ground.acceleration_m_s2), ground.notes
        signals, left = plan.run(acceleration, _noise(test, len(acceleration)))
        critical = CriticalDelay(**plan.critical_delay()) if len(test.actuators) == 1 else None
    else:
        if test.structure.n_dof:
            raise ConfigurationError("", [("structure", "expected none where a target is given: actuators alone")])
        target_motion = motion
        samples, notes = motion.sampled(test.rate_hz, duration_s)
        signals, left = plan.follow(samples, _noise(test, len(samples)))
    if signals is None:
        time_s, bound_m = left or (math.nan, math.nan)
        raise UnstableError(
            f"a displacement exceeded {bound_m:.4g} m", time_s, None if critical is None else critical.delay_s
        )
    names: tuple[Literal["target", "command", "measured", "force"], ...] = ("target", "command", "measured", "force")
    for array in (*(signals[name] for name in names), signals["displacement"]):
        array.flags.writeable = False
    channels = {name: c[:, 0] if (c := signals[name]).shape[1] == 1 else c for name in names}
    return Run(
        test=test,
        rate_hz=test.rate_hz,
        **channels,
        displacement=signals["displacement"],
        ground_motion=acceleration,
        motion_name=motion.name,
        motion_notes=notes,
        steps_per_sample=signals["steps_per_sample"],
        error_estimate=signals["error_estimate"],
        critical_delay=critical,
        target_motion=target_motion,
    )


def simulate_many(
    cases: Iterable[tuple[VirtualTest, GroundMotion | TargetMotion]],
    judge: Callable[[Run], Result],
    *,
    n_workers: int | None = None,
) -> Iterator[Result | UnstableError]:
    """Runs many tests on all cores; yields what `judge` makes of each run, in order, and keeps no run itself.

    An unstable test yields its UnstableError. `n_workers` is the number of processors unless given.
    """

    def one(case: tuple[VirtualTest, GroundMotion | TargetMotion]) -> Result | UnstableError:
        try:
            return judge(simulate(*case))
        except UnstableError as error:
            return error

    with ThreadPoolExecutor(n_workers or os.cpu_count()) as pool:
        yield from pool.map(one, cases)


def critical_delay(test: VirtualTest) -> CriticalDelay:
    """The constant delay that the loop of the only actuator bears, with its gain, without compensation or dynamics.

    Exact for linear systems: 1 + K k_e(s) g(s) e^(-s tau) = 0 first has a root on the imaginary axis. For small damping
    and a specimen that is all of an SDOF's stiffness it is about 2 zeta / omega.
    Raises ConfigurationError, also with several actuators.
    """
    return CriticalDelay(**_plan(test).critical_delay())


def delay_damping(test: VirtualTest, delay_s: float) -> DelayDamping:
    """What a constant delay of the only actuator does to the damping ratio of each mode.

    The roots of the delayed characteristic equation, and the first-order estimate -(K k_e / k) omega tau / 2.
    Raises ConfigurationError, also with several actuators.
    """
    return DelayDamping(**_plan(test).delay_damping(float(delay_s)))


def true_tracking(
    test: VirtualTest, frequency_hz: ArrayLike, actuator: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Amplitude and delay of measured over target as configured, at these frequencies (arrays of their shape).

    From compensation, gain, delay and dynamics; None where they are no one linear filter (a delay that varies, a
    servo-hydraulic plant with a specimen that yields). The phase is unwrapped from zero frequency. `actuator` is the
    index, from 0.
    """
    plan = _plan(test)
    frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    if not 0 <= actuator < len(test.actuators):
        raise SettingError(f"actuator: expected a number from 0 to {len(test.actuators) - 1}, found {actuator}")
    if not (np.isfinite(frequency) & (frequency > 0)).all():
        raise SettingError(f"frequency_hz: expected finite frequencies above 0, found {frequency_hz!r}")
    model = test.actuators[actuator]
    # Unwrapped along a grid that is fine for every delay in play.
    top = max(float(frequency.max(initial=0.0)), 1e-9)
    grid = np.linspace(0.0, top, max(2, math.ceil(64 * top) + 1))
    everywhere = np.concatenate((grid, frequency.ravel()))
    order = np.argsort(everywhere, kind="stable")
    response = plan.true_response(actuator, np.ascontiguousarray(everywhere[order]))
    if response is None:
        return None
    line = float(model.delay_s) if not isinstance(model.delay_s, DelayHistory) else 0.0
    rest = response * np.exp(2j * np.pi * everywhere[order] * line) * np.sign(model.gain)
    phase = np.unwrap(np.angle(rest)) + (0.0 if model.gain > 0 else np.pi) - 2 * np.pi * everywhere[order] * line
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    at = place[len(grid) :]
    with np.errstate(invalid="ignore", divide="ignore"):
        delay = -phase[at] / (2 * np.pi * everywhere[order][at])
    return np.abs(response[at]).reshape(frequency.shape), delay.reshape(frequency.shape)


def _plan(test: VirtualTest) -> CoreVirtualTest:
    mistakes = test.check()
    if mistakes:
        raise ConfigurationError("", [(m.key, m.message) for m in mistakes])
    return CoreVirtualTest(test)


def _noise(test: VirtualTest, n_samples: int) -> list[list[float] | None]:
    """One stream of its own for each noisy channel, so that adding one leaves the others as they were."""
    streams = np.random.SeedSequence(test.seed).spawn(3 * len(test.actuators))
    noise: list[list[float] | None] = []
    for actuator in test.actuators:
        for name in CONVERTERS:
            density = getattr(actuator, name).noise_density
            stream = np.random.Generator(np.random.PCG64(streams[len(noise)]))
            std = math.sqrt(density * test.rate_hz)
            noise.append((std * stream.standard_normal(n_samples)).tolist() if density else None)
    return noise
