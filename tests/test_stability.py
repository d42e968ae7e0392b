"""The delay that a loop bears and what a delay costs in damping, against other routes and against simulation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import eigh

import dynamics_twin as twin
from loops import STOREYS, loop_of, sdof_test, smooth_motion, stiffness_between
from rthstrack.errors import ConfigurationError
from rthstrack.virtual_test import (
    Actuator,
    BoucWen,
    Dashpot,
    DelayHistory,
    Element,
    KelvinVoigt,
    Law,
    Maxwell,
    ModalDamping,
    PolynomialExtrapolation,
    Spring,
    Structure,
    VirtualTest,
    critical_delay,
    delay_damping,
    simulate,
)
from tolerances import physical

K5 = 1000.0 * (2 * math.pi * 5.0) ** 2


# The critical delay ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("frequency_hz", "gain", "milliseconds"), [(5.0, 1.0, 1.27), (1.0, 1.0, 6.4), (5.0, 1.1, 1.16)]
)
def test_the_papers_structures_bear_the_delays_that_the_method_states(
    frequency_hz: float, gain: float, milliseconds: float
) -> None:
    test = sdof_test(Actuator((Spring(),), gain=gain), structure=Structure.sdof(frequency_hz, 0.02))
    found = critical_delay(test)
    assert_allclose(
        found.delay_s, milliseconds * 1e-3, rtol=0, atol=physical(0.05 if milliseconds > 2 else 0.005, "ms")
    )
    assert found.exact
    assert found.gain == gain


def test_for_small_damping_an_sdof_bears_twice_its_damping_over_its_frequency() -> None:
    found = critical_delay(sdof_test(structure=Structure.sdof(5.0, 1e-4)))
    assert_allclose(found.delay_s, 2e-4 / (2 * math.pi * 5.0), rtol=1e-6)
    assert_allclose(found.frequency_hz, 5.0, rtol=1e-6)


def test_a_delayed_spring_on_a_damped_mass_loses_its_balance_where_the_algebra_says() -> None:
    # m s^2 + c s + K k e^(-s tau) = 0 at s = j w: K k cos(w tau) = m w^2, K k sin(w tau) = c w.
    m, c, k = 1000.0, 2 * 0.3 * 1000.0 * 2 * math.pi * 5.0, 1.3 * K5
    w = math.sqrt((-(c**2) + math.sqrt(c**4 + 4 * m**2 * k**2)) / (2 * m**2))
    found = critical_delay(sdof_test(Actuator((Spring(),), gain=1.3), structure=Structure.sdof(5.0, 0.3)))
    assert_allclose(found.delay_s, math.atan2(c * w, m * w**2) / w, rtol=1e-10)
    assert_allclose(found.frequency_hz, w / (2 * math.pi), rtol=1e-10)


@st.composite
def loops(draw: st.DrawFn) -> VirtualTest:
    """A shear building of one to four storeys with one specimen of any linear kind, in it or on top of it."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n = int(rng.integers(1, 5))
    ratios = tuple(rng.uniform(0.005, 0.08, n).tolist())
    structure = Structure.shear_building(
        rng.uniform(1e4, 5e4, n).tolist(), rng.uniform(1e7, 5e7, n).tolist(), ModalDamping(ratios)
    )
    dof = int(rng.integers(1, n + 1))
    from_dof = dof - 1 if rng.random() < 0.7 else 0
    part = bool(rng.random() < 0.5) and from_dof == dof - 1
    k = stiffness_between(structure, dof, dof - 1)
    laws: list[Law] = [Spring(float(k * rng.uniform(0.1, 0.95)))]
    if rng.random() < 0.4:
        laws.append(Dashpot(float(1e4 * rng.uniform(0.1, 1.0) * (1e-3 if part else 1.0))))
    if rng.random() < 0.4:
        laws.append(Maxwell(float(k * rng.uniform(0.05, 0.6)), float(k * rng.uniform(0.002, 0.05))))
    mass = float(rng.uniform(100.0, 5000.0)) if rng.random() < 0.4 and from_dof == 0 else 0.0
    elements: tuple[Element, ...] = ()
    if rng.random() < 0.4:
        at = int(rng.integers(1, n + 1))
        law = Maxwell(float(k * rng.uniform(0.05, 0.3)), float(k * rng.uniform(0.002, 0.05)))
        elements = (Element(law, at, at - 1),)
    gain = float(rng.uniform(0.8, 1.2))
    specimen = Actuator(tuple(laws), dof, from_dof, mass, part, gain)
    return VirtualTest(structure, (specimen,), elements)


@settings(max_examples=60)
@given(loops())
def test_the_critical_delay_of_any_building_is_where_a_scan_finds_it_and_roots_cross_there(test: VirtualTest) -> None:
    assert test.check() == ()
    found, loop = critical_delay(test), loop_of(test)
    assert twin.right_half_roots(loop, 0.0) == 0
    delay, omega = twin.first_crossing(loop)
    if math.isinf(delay):
        assert math.isinf(found.delay_s)
        assert math.isnan(found.frequency_hz)
        assert [twin.right_half_roots(loop, tau) for tau in (0.01, 0.3)] == [0, 0]
        return
    assert_allclose(found.delay_s, delay, rtol=1e-9)
    assert_allclose(found.frequency_hz, omega / (2 * math.pi), rtol=1e-9)
    assert twin.right_half_roots(loop, 0.98 * delay) == 0
    assert twin.right_half_roots(loop, 1.02 * delay) >= 2


def test_without_damping_no_delay_is_short_enough() -> None:
    assert critical_delay(sdof_test(structure=Structure.sdof(5.0, 0.0))).delay_s == 0.0
    building = Structure.shear_building([1000.0] * 3, [1e6] * 3, ModalDamping((0.0, 0.02, 0.02)))
    assert critical_delay(sdof_test(structure=building)).delay_s == 0.0


def test_a_specimen_softer_than_the_damping_makes_up_for_never_rings() -> None:
    # |k_e / (k - m w^2 + j c w)| stays below k_e / (2 zeta sqrt(1 - zeta^2) k_N): below 1 for k_e < 0.0998 k_N.
    for share, finite in ((0.0995, False), (0.1003, True)):
        specimen = Actuator((Spring(share * K5),), part_of_structure=False)
        found = critical_delay(sdof_test(specimen, structure=Structure.sdof(5.0, 0.05)))
        assert math.isfinite(found.delay_s) is finite
        assert found.exact


def test_a_specimen_heavier_than_the_rest_rings_however_short_the_delay() -> None:
    for share, least in ((0.49, 1e-6), (0.51, 0.0)):
        found = critical_delay(sdof_test(Actuator((Spring(),), specimen_mass_kg=1000.0 * share)))
        assert (found.delay_s > least) if least else (found.delay_s == 0.0)


def test_what_yields_counts_with_its_elastic_stiffness_and_says_so() -> None:
    yields, elastic = (critical_delay(sdof_test(Actuator((law,)))) for law in (BoucWen(), Spring()))
    assert yields.delay_s == elastic.delay_s
    assert not yields.exact
    beside = sdof_test(Actuator((Spring(0.5 * K5),)), elements=(Element(BoucWen(0.5 * K5)),))
    assert not critical_delay(beside).exact


def test_compensation_and_the_delay_itself_leave_the_critical_delay_alone() -> None:
    bare = sdof_test(stepping="cr")
    specimen = replace(bare.actuators[0], delay_s=0.001, compensation=PolynomialExtrapolation(2, 0.001))
    assert critical_delay(replace(bare, actuators=(specimen,))) == critical_delay(bare)
    varied = replace(bare.actuators[0], delay_s=DelayHistory((0.0, 1.0), (0.001, 0.002)))
    assert critical_delay(replace(bare, actuators=(varied,))) == critical_delay(bare)


def test_several_actuators_have_no_critical_delay() -> None:
    two = VirtualTest(STOREYS, (Actuator((Spring(1e6),)), Actuator((Spring(1e6),), 2, 1)))
    with pytest.raises(ConfigurationError, match="one actuator"):
        critical_delay(two)
    with pytest.raises(ConfigurationError, match="one actuator"):
        delay_damping(two, 0.001)
    assert simulate(two, smooth_motion(duration_s=8.0)).critical_delay is None


@pytest.mark.parametrize(
    "test",
    [
        sdof_test(),
        sdof_test(Actuator((Spring(),), gain=1.1)),
        sdof_test(Actuator((Spring(0.5 * K5),), specimen_mass_kg=300.0), structure=Structure.sdof(5.0, 0.005)),
        sdof_test(
            Actuator((Spring(1.2e7), Maxwell(6e6, 2e5)), 2, 1, gain=0.95), structure=STOREYS, elements=(), rate_hz=256.0
        ),
        sdof_test(
            Actuator((Spring(1.6e7),), 1, 0),
            structure=STOREYS,
            elements=(Element(Maxwell(5e6, 1e5), 3, 2, False),),
        ),
        sdof_test(Actuator((Spring(),)), stepping="cr", rate_hz=2048.0),
    ],
    ids=["sdof", "gain", "specimen of mass", "second storey", "with a Maxwell element", "cr"],
)
def test_a_simulated_loop_decays_just_below_its_critical_delay_and_grows_just_above(test: VirtualTest) -> None:
    found = critical_delay(test)
    cycles = 2.0 / found.frequency_hz
    # Time constants of the last per cent or two: compare windows of whole cycles, far apart.
    for factor in (0.97, 1.03):
        actuator = replace(test.actuators[0], delay_s=factor * found.delay_s)
        run = simulate(replace(test, actuators=(actuator,), bound_m=1e9), smooth_motion(duration_s=70.0))
        t = np.arange(len(run.target)) / test.rate_hz
        early, late = (
            float(np.abs(run.target[(t >= start) & (t < start + 5 * cycles)]).max()) for start in (30.0, 65.0)
        )
        assert (late < 0.9 * early) if factor < 1 else (late > 1.1 * early)


# Damping --------------------------------------------------------------------------------------------------------------


@settings(max_examples=40)
@given(loops(), st.floats(0.05, 1.5))
def test_the_damping_that_a_delay_leaves_is_that_of_the_characteristic_roots(test: VirtualTest, share: float) -> None:
    critical = critical_delay(test).delay_s
    delay = share * (critical if math.isfinite(critical) and critical < 0.02 else 0.005)
    found, loop = delay_damping(test, delay), loop_of(test)
    roots = twin.free_roots(loop)
    # In order of their frequencies, whatever the order of the modes.
    ratios = -roots.real / np.abs(roots)
    assert_allclose(np.sort(found.damping_ratio_without), np.sort(ratios), rtol=0, atol=1e-9)
    left = list(zip(found.frequency_hz, found.damping_ratio, found.damping_ratio_without, strict=True))
    for s, ratio in zip(roots, ratios, strict=True):
        for step in range(1, 9):
            # Followed from no delay to the whole one, so that the mode stays the mode.
            s = twin.root_near(loop, s, delay * step / 8)
        mine = min(left, key=lambda one: abs(one[2] - ratio))
        left.remove(mine)
        assert_allclose(mine[:2], [abs(s.imag) / (2 * math.pi), -s.real / abs(s)], rtol=1e-8, atol=1e-9)


def test_at_the_critical_delay_a_mode_has_lost_all_its_damping() -> None:
    test = sdof_test(Actuator((Spring(1.2e7),), 2, 1), structure=STOREYS)
    critical = critical_delay(test)
    found = delay_damping(test, critical.delay_s)
    mode = int(np.argmin(np.abs(found.frequency_hz - critical.frequency_hz)))
    assert_allclose(found.damping_ratio[mode], 0.0, rtol=0, atol=1e-9)
    assert (np.delete(found.damping_ratio, mode) > 0).all()


def test_no_delay_costs_no_damping() -> None:
    found = delay_damping(sdof_test(structure=STOREYS), 0.0)
    assert_allclose(found.damping_ratio, found.damping_ratio_without, rtol=0, atol=1e-12)
    assert (found.first_order_change == 0).all()
    # The structure's own, 3 and 4 per cent in the first two modes.
    assert_allclose(found.damping_ratio[:2], [0.03, 0.04], rtol=1e-3)


@pytest.mark.parametrize("gain", [1.0, 1.1])
def test_the_first_order_estimate_is_half_the_stiffness_share_times_omega_tau(gain: float) -> None:
    # The specimen is 60 % of the stiffness; with gain it is K 0.6 / (0.4 + K 0.6).
    delay, structure = 2e-4, Structure.sdof(5.0, 0.002)
    found = delay_damping(sdof_test(Actuator((Spring(0.6 * K5),), gain=gain), structure=structure), delay)
    share = 0.6 * gain / (0.4 + 0.6 * gain)
    omega = 2 * math.pi * 5.0 * math.sqrt(0.4 + 0.6 * gain)
    assert_allclose(found.first_order_change, [-share * omega * delay / 2], rtol=1e-9)
    change = found.damping_ratio - found.damping_ratio_without
    assert_allclose(change, found.first_order_change, rtol=0.01)


def test_the_first_order_estimate_follows_each_mode_of_a_building() -> None:
    building = Structure.shear_building([2e4, 2e4, 1.5e4], [2e7, 1.8e7, 1.5e7], ModalDamping(0.001))
    test = sdof_test(Actuator((Spring(0.3 * 1.8e7),), 2, 1), structure=building)
    found = delay_damping(test, 1e-4)
    values, shapes = eigh(building.stiffness_n_per_m, building.mass_kg)
    share = 0.3 * 1.8e7 * (shapes[1] - shapes[0]) ** 2 / values
    assert_allclose(found.first_order_change, -share * np.sqrt(values) * 1e-4 / 2, rtol=1e-9)
    assert_allclose(found.damping_ratio - found.damping_ratio_without, found.first_order_change, rtol=0.01)


@pytest.mark.parametrize(
    ("laws", "mass_kg"),
    [((Spring(0.3 * K5),), 200.0), ((Spring(0.2 * K5), Maxwell(0.3 * K5, 0.05 * K5)), 0.0)],
    ids=["mass", "Maxwell"],
)
def test_the_first_order_estimate_holds_for_small_delays_of_any_specimen(laws: tuple[Law, ...], mass_kg: float) -> None:
    model = Actuator(laws, specimen_mass_kg=mass_kg, part_of_structure=False)
    found = delay_damping(sdof_test(model, structure=Structure.sdof(5.0, 0.001)), 2e-5)
    # The mode's frequency is that without what relaxes.
    change = found.damping_ratio - found.damping_ratio_without
    assert_allclose(change, found.first_order_change, rtol=0.02 if mass_kg else 0.15)


@pytest.mark.parametrize("gain", [0.9, 1.1])
@pytest.mark.parametrize("law", [Spring(0.7 * K5), KelvinVoigt(0.7 * K5, 300.0)], ids=["spring", "kelvin_voigt"])
def test_a_simulated_free_vibration_decays_as_predicted(law: Law, gain: float) -> None:
    delay = 0.0021
    test = sdof_test(Actuator((law,), gain=gain, delay_s=delay), structure=Structure.sdof(5.0, 0.05), tolerance=1e-9)
    run = simulate(test, smooth_motion(duration_s=14.0))
    tail = run.target[round(9.0 * 256) :]
    # One mode obeys x_(n+2) = a x_(n+1) + b x_n (Prony).
    a, b = np.linalg.lstsq(np.column_stack((tail[1:-1], tail[:-2])), tail[2:], rcond=None)[0]
    s = np.log(np.roots([1.0, -a, -b]).astype(complex)[0]) * 256.0
    found = delay_damping(test, delay)
    assert_allclose(-s.real / abs(s), found.damping_ratio[0], rtol=1e-5)
    assert_allclose(abs(s.imag) / (2 * math.pi), found.frequency_hz[0], rtol=1e-6)


@pytest.mark.parametrize("delay", [-0.001, math.nan, math.inf])
def test_a_delay_that_is_no_time_costs_no_damping_but_an_error(delay: float) -> None:
    with pytest.raises(ConfigurationError, match="at least 0"):
        delay_damping(sdof_test(), delay)
