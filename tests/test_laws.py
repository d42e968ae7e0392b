"""Restoring forces: against their definitions under a motion known exactly, and their energy in whole runs."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import cumulative_simpson
from scipy.interpolate import make_interp_spline

import dynamics_twin as twin
from loops import STOREYS, loop_of, smooth_motion
from rthstrack.virtual_test import (
    Actuator,
    BaberWen,
    BoucWen,
    Dashpot,
    DelayHistory,
    Element,
    KelvinVoigt,
    Law,
    Maxwell,
    Run,
    ServoHydraulic,
    Spring,
    Structure,
    VirtualTest,
    simulate,
)
from tolerances import physical

RATE = 256.0
FINE = 8 * RATE
FREE = Structure.from_matrices([[1e18]], [[0.0]], [[0.0]])
MOTION = smooth_motion(RATE, 4.0, centre_s=2.0, width_s=0.4, scale=8.0)
PATH = twin.free_motion(MOTION.acceleration_m_s2, RATE)

BOUC_WEN = BoucWen(2e6, 0.004, 0.05, 0.55, 0.45, 2.0)
LAWS: dict[str, Law] = {
    "spring": Spring(2e6),
    "dashpot": Dashpot(3e4),
    "kelvin_voigt": KelvinVoigt(2e6, 3e4),
    "maxwell": Maxwell(2e6, 3e4),
    "maxwell_fast": Maxwell(2e6, 4e3),
    "bouc_wen": BOUC_WEN,
    "bouc_wen_q1": replace(BOUC_WEN, exponent=1.0),
    "bouc_wen_q_between": replace(BOUC_WEN, exponent=1.7, post_yield_ratio=0.0),
    "bouc_wen_hardening": replace(BOUC_WEN, beta=-0.4, gamma=0.6),
    "baber_wen": BaberWen(2e6, 0.004, 0.05, 0.55, 0.45, 2.0, 0.05, 0.1),
    "baber_wen_strength": BaberWen(2e6, 0.004, 0.1, 0.4, 0.6, 1.5, 0.2, 0.0),
    "baber_wen_stiffness": BaberWen(2e6, 0.004, 0.0, 0.5, 0.5, 3.0, 0.0, 0.2),
}


def hysteresis(law: BoucWen | BaberWen) -> twin.Hysteresis:
    assert law.stiffness_n_per_m is not None
    lost = (law.strength_degradation, law.stiffness_degradation) if isinstance(law, BaberWen) else (0.0, 0.0)
    return twin.Hysteresis(
        law.stiffness_n_per_m,
        law.yield_displacement_m,
        law.post_yield_ratio,
        law.beta,
        law.gamma,
        law.exponent,
        *lost,
    )


def defined_force(law: Law, x: twin.Motion, v: twin.Motion, t: twin.Floats) -> twin.Floats:
    """The force of a law under the motion x(t), x'(t), by its definition."""
    if isinstance(law, Spring):
        return law.stiffness_n_per_m * x(t)
    if isinstance(law, Dashpot):
        return law.damping_n_s_per_m * v(t)
    if isinstance(law, KelvinVoigt):
        return law.stiffness_n_per_m * x(t) + law.damping_n_s_per_m * v(t)
    if isinstance(law, Maxwell):
        return twin.series_force(law.stiffness_n_per_m, law.damping_n_s_per_m, v, t)
    return twin.hysteretic(hysteresis(law), x, v, t)[0]


def imposed(actuator: Actuator, stepping: Literal["continuous", "cr"] = "continuous") -> Run:
    """A run in which the computed part, a free mass far heavier than any force, dictates the motion.

    In continuous time at eight times the rate: the internal step follows target and measured, which here need none.
    """
    actuator = replace(actuator, part_of_structure=False)
    rate = FINE if stepping == "continuous" else RATE
    return simulate(VirtualTest(FREE, (actuator,), (), stepping, rate), MOTION)


def sampled(signal: twin.Floats) -> twin.Floats:
    """A signal of a continuous run at the times of PATH."""
    return signal[:: round(FINE / RATE)][: len(PATH.x)]


def assert_same(found: twin.Floats, expected: twin.Floats, relative: float, what: str = "") -> None:
    peak = float(np.abs(expected).max())
    assert peak > 0
    assert_allclose(found, expected, rtol=0, atol=physical(relative, "relative") * peak, err_msg=what)


# Under a given motion ---------------------------------------------------------------------------------------------


def test_a_free_mass_moves_as_the_ground_motion_integrated_twice() -> None:
    run = imposed(Actuator((Spring(2e6),)))
    assert_same(sampled(run.target), PATH(PATH.x), 1e-9)


@pytest.mark.parametrize("name", LAWS)
def test_a_law_answers_as_it_is_defined(name: str) -> None:
    run = imposed(Actuator((LAWS[name],)))
    expected = defined_force(LAWS[name], PATH, PATH.derivative(), PATH.x)
    assert_same(sampled(run.force), expected, 1e-5, name)


@pytest.mark.parametrize("name", ["kelvin_voigt", "maxwell", "bouc_wen", "baber_wen"])
def test_a_law_answers_to_the_delayed_and_amplified_motion(name: str) -> None:
    gain, delay = 1.1, 1.37 / RATE
    run = imposed(Actuator((LAWS[name],), gain=gain, delay_s=delay))
    slope = PATH.derivative()

    def x(t: twin.Floats) -> twin.Floats:
        return np.where(t > delay, gain * PATH(np.maximum(t - delay, 0.0)), 0.0)

    def v(t: twin.Floats) -> twin.Floats:
        return np.where(t > delay, gain * slope(np.maximum(t - delay, 0.0)), 0.0)

    assert_same(sampled(run.measured), x(PATH.x), 1e-9)
    assert_same(sampled(run.force), defined_force(LAWS[name], x, v, PATH.x), 1e-5, name)


def test_a_dashpot_feels_that_a_growing_delay_slows_the_motion() -> None:
    history = DelayHistory((1.0, 4.0), (0.002, 0.302))
    run = imposed(Actuator((Dashpot(3e4),), delay_s=history))
    t = PATH.x
    delay = np.interp(t, history.time_s, history.delay_s)
    # At a corner of the history the speed jumps.
    growth = np.where((t > 1.0) & (t < 4.0), 0.1, 0.0)
    smooth = (np.abs(t - 1.0) > 0.01) & (np.abs(t - 4.0) > 0.01)
    expected = 3e4 * (1 - growth) * PATH.derivative()(np.maximum(t - delay, 0.0))
    assert_same(sampled(run.force)[smooth], expected[smooth], 1e-6)


def test_laws_side_by_side_add_up() -> None:
    laws = tuple(LAWS[name] for name in ("spring", "dashpot", "maxwell", "bouc_wen", "baber_wen"))
    together = imposed(Actuator(laws)).force
    assert_same(together, np.sum([imposed(Actuator((law,))).force for law in laws], axis=0), 1e-6)


@pytest.mark.parametrize("name", LAWS)
def test_the_sampled_loop_moves_a_law_in_straight_lines_between_samples(name: str) -> None:
    run = imposed(Actuator((LAWS[name],)), stepping="cr")
    t = np.arange(len(run.measured)) / RATE
    slopes = np.diff(run.measured) * RATE
    law = LAWS[name]

    def x(at: twin.Floats) -> twin.Floats:
        return np.interp(at, t, run.measured)

    if isinstance(law, Spring | Dashpot | KelvinVoigt):
        velocity = np.concatenate(([0.0], slopes))
        k, c = getattr(law, "stiffness_n_per_m", 0.0), getattr(law, "damping_n_s_per_m", 0.0)
        assert_same(run.force, k * run.measured + c * velocity, 1e-9, name)
        return
    expected = twin.along_lines(
        lambda v, y: (
            [law.stiffness_n_per_m * v - y[0] * law.stiffness_n_per_m / law.damping_n_s_per_m, 0.0]
            if isinstance(law, Maxwell)
            else hysteresis(law).rate(v, y[0], y[1])
        ),
        slopes,
        1 / RATE,
    )
    force = expected[:, 0] if isinstance(law, Maxwell) else hysteresis(law).force(run.measured, expected[:, 0])
    # Runge-Kutta over a tenth of the yield displacement.
    assert_same(run.force, force, 1e-4, name)


# Degradation ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stepping", ["continuous", "cr"])
def test_baber_wen_without_degradation_is_bouc_wen(stepping: Literal["continuous", "cr"]) -> None:
    bare = Actuator((BOUC_WEN,), gain=1.1, delay_s=0.003)
    degrading = Actuator((BaberWen(2e6, 0.004, 0.05, 0.55, 0.45, 2.0),), gain=1.1, delay_s=0.003)
    plain, degraded = (imposed(a, stepping) for a in (bare, degrading))
    assert_same(degraded.force, plain.force, 1e-12)


def plateau(law: Law, cycles: int = 8) -> tuple[twin.Floats, twin.Floats]:
    """Displacement and force under equal cycles of ten times the yield displacement, after a smooth start."""
    t = np.arange(round((cycles + 1) * RATE)) / RATE
    rise = np.clip(t, 0, 1)
    amplitude = 0.04 * rise**4 * (35 - 84 * rise + 70 * rise**2 - 20 * rise**3)
    x = amplitude * np.sin(2 * np.pi * t)
    ground = -make_interp_spline(t, x, k=5).derivative(2)(t)
    motion = replace(MOTION, acceleration_m_s2=ground)
    run = simulate(VirtualTest(FREE, (Actuator((law,), part_of_structure=False),), rate_hz=RATE), motion)
    return run.target, run.force


def test_strength_degradation_lowers_the_plateau_as_the_energy_says() -> None:
    law = BaberWen(2e6, 0.004, 0.0, 0.5, 0.5, 2.0, strength_degradation=0.02)
    x, force = plateau(law)
    # On the plateau nu z^2 (beta + gamma) = 1; e is the work over k x_y^2, for eta = 0.
    energy = np.concatenate(([0.0], np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(x)))) / (2e6 * 0.004**2)
    peaks = [
        int(np.argmax(force[round((c + 1) * RATE) : round((c + 2) * RATE)])) + round((c + 1) * RATE) for c in range(7)
    ]
    for at in peaks:
        assert_allclose(force[at] / (2e6 * 0.004), 1 / np.sqrt(1 + 0.02 * energy[at]), rtol=0.01)
    assert force[peaks[-1]] < 0.75 * force[peaks[0]]


def test_stiffness_degradation_softens_the_unloading_and_keeps_the_plateau() -> None:
    law = BaberWen(2e6, 0.004, 0.0, 0.5, 0.5, 2.0, stiffness_degradation=0.02)
    x, force = plateau(law)
    energy = np.concatenate(([0.0], np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(x)))) / (2e6 * 0.004**2)
    for cycle in range(1, 8):
        span = slice(round(cycle * RATE), round((cycle + 1) * RATE))
        # Where the force passes zero, z = 0 and dr/dx = k / mu.
        crossing = span.start + int(np.flatnonzero(np.diff(np.sign(force[span])))[0])
        slope = (force[crossing + 1] - force[crossing]) / (x[crossing + 1] - x[crossing])
        assert_allclose(slope / 2e6, 1 / (1 + 0.02 * energy[crossing]), rtol=0.02)
        assert_allclose(np.abs(force[span]).max(), 2e6 * 0.004, rtol=0.02)


# Energy of whole runs -------------------------------------------------------------------------------------------------


def parts(law: Law, x: twin.Floats, v: twin.Floats, t: twin.Floats) -> tuple[twin.Floats, twin.Floats]:
    """Stored energy, and the power that is lost, of a law by its definition."""
    path, slope = make_interp_spline(t, x, k=5), make_interp_spline(t, v, k=5)
    if isinstance(law, Spring):
        return law.stiffness_n_per_m * x**2 / 2, 0 * x
    if isinstance(law, Dashpot):
        return 0 * x, law.damping_n_s_per_m * v**2
    if isinstance(law, KelvinVoigt):
        return law.stiffness_n_per_m * x**2 / 2, law.damping_n_s_per_m * v**2
    if isinstance(law, Maxwell):
        r = twin.series_force(law.stiffness_n_per_m, law.damping_n_s_per_m, slope, t)
        return r**2 / (2 * law.stiffness_n_per_m), r**2 / law.damping_n_s_per_m
    h = hysteresis(law)
    _, z, e = twin.hysteretic(h, path, slope, t)
    rates = np.array([h.rate(*one)[0] for one in zip(v, z, e, strict=True)])
    stored = h.eta * h.k * x**2 / 2 + (1 - h.eta) * h.k * h.x_y**2 * z**2 / 2
    return stored, (1 - h.eta) * h.k * h.x_y * (z * v - h.x_y * z * rates)


@pytest.mark.parametrize("name", ["spring", "dashpot", "kelvin_voigt", "maxwell", "bouc_wen", "baber_wen"])
@pytest.mark.parametrize("where", ["specimen", "element"])
def test_kinetic_stored_and_lost_energy_are_what_the_ground_put_in(name: str, where: str) -> None:
    law, idle = LAWS[name], Actuator((Spring(0.0),), part_of_structure=False)
    motion = smooth_motion(256.0, 6.0, centre_s=2.5, width_s=0.5, scale=3.0)
    specimen, element = Actuator((law,), 2, 1, part_of_structure=False), Element(law, 2, 1, False)
    rigs, elements = ((specimen,), ()) if where == "specimen" else ((idle,), (element,))
    run = simulate(VirtualTest(STOREYS, rigs, elements, rate_hz=512.0, tolerance=1e-8), motion)
    x, t = run.displacement, np.arange(len(run.displacement)) / 512.0
    path = make_interp_spline(t, x, k=5)
    v, area = path.derivative()(t), path.antiderivative()(t)
    stored, lost = parts(law, x[:, 1] - x[:, 0], v[:, 1] - v[:, 0], t)
    mass, damping, stiffness = STOREYS.mass_kg, STOREYS.damping_n_s_per_m, STOREYS.stiffness_n_per_m
    loss = cumulative_simpson(np.einsum("ti,ij,tj->t", v, damping, v) + lost, x=t, initial=0.0)
    held = (np.einsum("ti,ij,tj->t", v, mass, v) + np.einsum("ti,ij,tj->t", x, stiffness, x)) / 2 + stored
    # The ground motion is linear between samples: integral of v a = [x a] - a' integral of x, in each of them.
    a, pushed, pushed_area = run.ground_motion, x @ mass @ np.ones(3), area @ mass @ np.ones(3)
    pieces = -np.diff(pushed * a) + np.diff(a) * 512.0 * np.diff(pushed_area)
    put_in = np.concatenate(([0.0], np.cumsum(pieces)))
    assert_allclose(held + loss, put_in, rtol=0, atol=physical(2e-6, "relative") * put_in.max())
    assert loss[-1] > 0.5 * put_in[-1]


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("stepping", ["continuous", "cr"])
def test_an_element_and_a_specimen_of_an_ideal_actuator_move_the_structure_alike(name: str, stepping: str) -> None:
    law, idle = LAWS[name], Actuator((Spring(0.0),), part_of_structure=False)
    motion = smooth_motion(512.0, 7.0, centre_s=2.5, width_s=0.5, scale=3.0)
    one = VirtualTest(STOREYS, (Actuator((law,), 2, 1, part_of_structure=False),), rate_hz=512.0, stepping=stepping)
    other = replace(one, actuators=(idle,), elements=(Element(law, 2, 1, False),))
    a, b = simulate(one, motion), simulate(other, motion)
    assert_same(a.displacement, b.displacement, 1e-9 if stepping == "cr" else 2e-6, name)


def test_a_linear_law_that_is_part_of_the_structure_changes_nothing() -> None:
    motion = smooth_motion(512.0, 7.0, centre_s=2.5, width_s=0.5)
    k = float(-STOREYS.stiffness_n_per_m[0, 1])
    bare = VirtualTest(STOREYS, (Actuator((Spring(0.0),)),), rate_hz=512.0, tolerance=1e-9)
    split = replace(bare, elements=(Element(Spring(0.5 * k), 2, 1), Element(KelvinVoigt(0.3 * k, 100.0), 1, 2)))
    assert_same(simulate(split, motion).displacement, simulate(bare, motion).displacement, 1e-8)
    assert_allclose(loop_of(split).computed(np.array([1j])), loop_of(bare).computed(np.array([1j])), rtol=1e-12)


@pytest.mark.parametrize(
    ("exponent", "yield_displacement_m"), [(2.0, 1e-5), (10.0, 1e-4), (64.0, 1e-3)], ids=["friction", "q10", "q64"]
)
@pytest.mark.parametrize("stepping", ["continuous", "cr"])
def test_a_sharp_yield_point_does_not_make_a_test_unstable(
    stepping: str, exponent: float, yield_displacement_m: float
) -> None:
    # A force of 500 N on a frame of 10 t cannot make anything unstable, however suddenly it turns.
    law = BoucWen(500.0 / yield_displacement_m, yield_displacement_m, 0.0, exponent=exponent)
    idle = Actuator((Spring(0.0),), part_of_structure=False)
    frame = Structure.sdof(1.0, 0.02, 10000.0)
    motion = smooth_motion(RATE, 6.0, centre_s=2.5, width_s=0.5)
    free = simulate(VirtualTest(frame, (idle,), rate_hz=RATE, stepping=stepping), motion).displacement
    run = simulate(VirtualTest(frame, (idle,), (Element(law, 1, 0, False),), stepping, RATE, bound_m=10.0), motion)
    # 500 N of friction move it by no more than 500 / k a half cycle less: of the size of the free motion.
    assert 0.3 * np.abs(free).max() < np.abs(run.displacement).max() < np.abs(free).max()


def test_a_friction_damper_that_holds_nearly_rigidly_does_not_shrink_the_bound() -> None:
    # It slips at 10 kN and 1 um; the frame of 100 t then moves like one without it, not like one of 50 Hz.
    damper = Element(BoucWen(1e10, 1e-6, 0.0), part_of_structure=False)
    idle = Actuator((Spring(0.0),), part_of_structure=False)
    test = VirtualTest(Structure.sdof(1.0, 0.02, 1e5), (idle,), (damper,), rate_hz=RATE)
    run = simulate(test, smooth_motion(duration_s=8.0, scale=3.0))
    assert 0.05 < np.abs(run.displacement).max() < 0.3


@pytest.mark.parametrize("stepping", ["continuous", "cr"])
def test_a_sharp_yield_point_does_not_make_a_servo_hydraulic_actuator_unstable(
    stepping: Literal["continuous", "cr"],
) -> None:
    # 500 N of friction, and a dashpot, beneath an actuator that could move a hundred times that.
    laws = (BoucWen(500.0 / 1e-5, 1e-5, 0.0), Dashpot(300.0))
    actuator = Actuator(laws, specimen_mass_kg=29.13, part_of_structure=False, dynamics=ServoHydraulic())
    motion = smooth_motion(4096.0, 1.5, centre_s=0.6, width_s=0.11, scale=3.0)
    test = VirtualTest(Structure.sdof(4.0, 0.05, 50000.0), (actuator,), (), stepping, 4096.0, bound_m=10.0)
    run = simulate(test, motion)
    assert np.abs(run.measured).max() < 2 * np.abs(run.target).max()
