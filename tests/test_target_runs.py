"""Actuators alone along a predefined target, against what their definitions say of it."""

from __future__ import annotations

import copy
import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy import signal
from scipy.integrate import solve_ivp

import dynamics_twin as twin
import rthstrack
from loops import servo_response, smooth_motion
from rthstrack.cli import main
from rthstrack.errors import ChannelError, ConfigurationError, RecordingError, SettingError, UnstableError
from rthstrack.virtual_test import (
    Actuator,
    BoucWen,
    Converter,
    DelayHistory,
    Element,
    FirstOrder,
    InverseCompensation,
    KelvinVoigt,
    PolynomialExtrapolation,
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
from rthstrack.virtual_test.configuration import configuration_from, read_configuration, to_table, virtual_test_from
from rthstrack.virtual_test.run import read_run_test
from rthstrack.virtual_test.target_motion import RecordedTarget, SineTarget, SweepTarget, read_target, target_from
from tolerances import physical, round_off

RATE = 1024.0
SINE = SineTarget(frequency_hz=5.0, amplitude_m=0.01, duration_s=4.0, ramp_s=1.0)
SWEEP = SweepTarget(from_hz=0.5, to_hz=8.0, amplitude_m=0.01, duration_s=6.0, ramp_s=0.5)
STEPPINGS: tuple[Literal["continuous", "cr"], ...] = ("continuous", "cr")


def alone(*actuators: Actuator, **settings: Any) -> VirtualTest:
    return VirtualTest(Structure.none(), actuators, **{"rate_hz": RATE, **settings})


def rise(t: twin.Floats, ramp_s: float) -> twin.Floats:
    s = np.clip(t / ramp_s, 0, 1)
    return 6 * s**5 - 15 * s**4 + 10 * s**3


def sine_at(t: twin.Floats, target: SineTarget = SINE) -> twin.Floats:
    """a e(t) sin(2 pi f t), as documented, at any time; zero before and after."""
    ramp = target.ramp_s or min(target.duration_s / 10, 2.0)
    envelope = rise(t, ramp) * rise(target.duration_s - t, ramp)
    return target.amplitude_m * envelope * np.sin(2 * np.pi * target.frequency_hz * t)


def times(run: Run) -> twin.Floats:
    return np.arange(run.n_samples) / run.rate_hz


def assert_near(found: twin.Floats, expected: twin.Floats, relative: float) -> None:
    """Within `relative` of the expected signal's peak."""
    peak = float(np.abs(expected).max())
    assert peak > 0
    assert_allclose(found, expected, rtol=0, atol=relative * peak)


def settled(values: twin.Floats, t: twin.Floats, frequency_hz: float) -> complex:
    """The complex amplitude of a sine, over the whole periods from 2 to 3 s; phase as of exp(j 2 pi f t)."""
    inside = (t >= 2.0) & (t < 3.0)
    basis = np.exp(2j * np.pi * frequency_hz * t[inside])
    return complex(2 * np.mean(values[inside] * basis.conj()))


# Targets --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("target", [SINE, SweepTarget(8.0, 0.5, 0.01, 6.0), SineTarget(0.2, 0.1, 12.5)], ids=repr)
def test_a_target_begins_and_ends_at_rest_and_its_derivatives_are_those_of_its_displacement(target: Any) -> None:
    rate = 4096.0
    motion, notes = target.sampled(rate)
    assert notes == ()
    assert len(motion) == round(target.duration_s * rate) + 1
    assert_allclose(motion[[0, -1], :2], 0.0, atol=round_off(1000, 1))
    for order in (1, 2):
        centred = (motion[2:, order - 1] - motion[:-2, order - 1]) * rate / 2
        # A central difference errs by (omega dt)^2 / 6 of the next derivative; ramps bend it more.
        assert_near(centred, motion[1:-1, order], physical(1e-3, "relative"))


def test_a_sine_is_what_its_definition_says() -> None:
    assert_near(SINE.sampled(RATE).motion[:, 0], sine_at(np.arange(4097) / RATE), round_off(100, 1))
    # Unless given a ramp is a tenth of the duration, and at most 2 s.
    for seconds, ramp in ((5.0, 0.5), (60.0, 2.0)):
        given, usual = SineTarget(1.0, 0.01, seconds, ramp), SineTarget(1.0, 0.01, seconds)
        assert_array_equal(given.sampled(RATE).motion, usual.sampled(RATE).motion)


@pytest.mark.parametrize("law", ["linear", "logarithmic"])
@pytest.mark.parametrize(("start", "end"), [(0.5, 8.0), (8.0, 0.5)])
def test_a_sweep_is_scipys_chirp_between_its_ramps(law: Any, start: float, end: float) -> None:
    target = replace(SWEEP, from_hz=start, to_hz=end, law=law)
    t = np.arange(round(6 * RATE) + 1) / RATE
    expected = 0.01 * signal.chirp(t, start, 6.0, end, method=law, phi=-90)
    found = target.sampled(RATE).motion[:, 0]
    assert_near(found, expected * rise(t, 0.5) * rise(6.0 - t, 0.5), physical(1e-11, "relative"))


def test_a_longer_run_rests_at_the_end_and_a_shorter_one_says_that_it_is_cut() -> None:
    motion, notes = SINE.sampled(RATE, 5.0)
    assert notes == ()
    assert not motion[4097:].any()
    motion, notes = SINE.sampled(RATE, 2.0)
    assert notes == ("cut at 2 s, for the target has 4 s",)
    assert_array_equal(motion, SINE.sampled(RATE).motion[: len(motion)])


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: SineTarget(0.0, 0.01, 4.0), "frequency_hz: expected a positive number, found 0.0"),
        (lambda: SineTarget(1.0, -1.0, math.inf), "amplitude_m: expected a positive number, found -1.0; duration_s: "),
        (lambda: SineTarget(1.0, 0.01, 4.0, 3.0), "ramp_s: expected up to half of the duration, 2 s, found 3"),
        (lambda: SineTarget(1.0, 0.01, 4.0, 0.0), "ramp_s: expected a positive number, found 0.0"),
        (
            lambda: SweepTarget(1.0, 1.0, 0.01, 4.0),
            "to_hz: expected another frequency than from_hz, found 1; or a sine",
        ),
        (lambda: SweepTarget(1.0, 2.0, 0.01, 4.0, "log"), "law: expected 'linear' or 'logarithmic', found 'log'"),  # type: ignore[arg-type]
        (lambda: RecordedTarget("r", np.zeros(1), 100.0), "expected at least 2 samples of one displacement"),
        (lambda: RecordedTarget("r", np.array([0, np.nan, 0]), -1.0), "r: rate_hz: expected a positive number"),
        (lambda: RecordedTarget("r", np.array([0, np.nan, 0]), 9.0), "1 of 3 samples are NaN or infinite (first at "),
        (lambda: RecordedTarget("r", np.zeros(9), 9.0).scaled_to_peak(1.0), "zero throughout"),
        (lambda: SINE.sampled(10.0), "frequency_hz: expected below half of the rate, 5 Hz, found 5"),
        (lambda: SINE.sampled(RATE, -1.0), "duration_s: expected a positive number, found -1"),
        (lambda: SINE.sampled(1e9), "expected 1 to 20000000 steps"),
    ],
)
def test_a_wrong_target_is_told(make: Any, said: str) -> None:
    with pytest.raises(SettingError) as caught:
        make()
    assert said in str(caught.value)


# What actuators make of them ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stepping", STEPPINGS)
@pytest.mark.parametrize("delay_s", [0.0, 0.25 / RATE, 7 / RATE, 0.0123])
def test_gain_and_delay_give_the_scaled_and_delayed_target(stepping: Any, delay_s: float) -> None:
    run = simulate(alone(Actuator(gain=1.1, delay_s=delay_s), stepping=stepping), SINE)
    t = times(run)
    assert_near(run.target, sine_at(t), round_off(100, 1))
    assert_array_equal(run.command, run.target)
    # Hermite interpolation of third degree errs by (omega dt)^4 / 384, of fifth by (omega dt)^6 / 46080.
    assert_near(run.measured, 1.1 * sine_at(t - delay_s), physical(1e-8, "relative"))
    assert not run.force.any()
    assert (run.ground_motion, run.critical_delay, run.displacement.shape) == (None, None, (len(t), 0))
    assert (run.motion_name, run.target_motion) == ("sine of 5 Hz, 10 mm", SINE)
    assert not run.measured.flags.writeable


@pytest.mark.parametrize("stepping", STEPPINGS)
def test_a_delay_that_varies_is_that_of_its_time(stepping: Any) -> None:
    history = DelayHistory((1.0, 3.0), (0.004, 0.02))
    run = simulate(alone(Actuator(delay_s=history), stepping=stepping), SINE)
    t = times(run)
    assert_near(run.measured, sine_at(t - np.interp(t, [1.0, 3.0], [0.004, 0.02])), physical(1e-8, "relative"))


def test_a_discrete_actuator_and_its_inverse_compensation_follow_their_formulas() -> None:
    actuator = Actuator(dynamics=FirstOrder(12.0), compensation=InverseCompensation(9.0))
    run = simulate(alone(actuator, stepping="cr"), SWEEP)
    before = np.concatenate(([0.0], run.target[:-1]))
    assert_near(run.command, 9.0 * run.target - 8.0 * before, round_off(100, 1))
    # z / (alpha z - (alpha - 1))
    assert_near(run.measured, signal.lfilter([1.0], [12.0, -11.0], run.command), round_off(10_000, 1))


def test_a_polynomial_extrapolation_reads_ahead() -> None:
    run = simulate(alone(Actuator(compensation=PolynomialExtrapolation(2, 0.01)), stepping="cr"), SINE)
    t = times(run)
    expected = 3 * sine_at(t) - 3 * sine_at(t - 0.01) + sine_at(t - 0.02)
    assert_near(run.command, expected, physical(1e-7, "relative"))


def test_a_transfer_function_holds_its_command_once_a_sample() -> None:
    top, bottom = (400.0, 4.0e4), (1.0, 280.0, 4.0e4)
    run = simulate(alone(Actuator(dynamics=TransferFunction(top, bottom)), stepping="cr"), SWEEP)
    b, a, _ = signal.cont2discrete((top, bottom), 1 / RATE, method="zoh")
    assert_near(run.measured, signal.lfilter(np.ravel(b), a, run.command), physical(1e-9, "relative"))


def test_a_transfer_function_in_continuous_time_has_its_response() -> None:
    top, bottom = (4.0e4,), (1.0, 280.0, 4.0e4)
    actuator = Actuator(dynamics=TransferFunction(top, bottom), gain=0.9, delay_s=0.003)
    run = simulate(alone(actuator, tolerance=1e-9), SINE)
    omega = 2 * np.pi * 5.0
    _, (response,) = signal.freqs(top, bottom, [omega])
    expected = 0.9 * response * np.exp(-1j * omega * 0.003)
    t = times(run)
    assert settled(run.measured, t, 5.0) / settled(run.target, t, 5.0) == pytest.approx(expected, rel=1e-8)
    assert run.error_estimate <= 1e-9
    known = true_tracking(run.test, 5.0)
    assert known is not None
    assert known[0] == pytest.approx(abs(expected), rel=1e-12)


@pytest.mark.parametrize("stepping", STEPPINGS)
@pytest.mark.parametrize("stiffness", [0.0, 1.19e6], ids=["free", "with a spring"])
def test_a_servo_hydraulic_actuator_is_coupled_with_what_it_moves(stepping: Any, stiffness: float) -> None:
    specimen = (Spring(stiffness),) if stiffness else ()
    actuator = Actuator(specimen, specimen_mass_kg=29.13, dynamics=ServoHydraulic())
    run = simulate(alone(actuator, stepping=stepping, rate_hz=4096.0), SINE)
    t, omega = times(run), 2 * np.pi * 5.0
    response = complex(servo_response(ServoHydraulic(), twin.Answer(stiffness, 0.0, 29.13))(np.array([1j * omega]))[0])
    held = 1.0
    if stepping == "cr":
        # The command is held over the sample: sinc(omega dt / 2), half a sample late.
        half = omega / 4096.0 / 2
        held = np.exp(-1j * half) * np.sin(half) / half
    measured = settled(run.measured, t, 5.0)
    assert measured / settled(run.target, t, 5.0) == pytest.approx(response * held, rel=1e-6)
    # m x'' + k x = f
    assert settled(run.force, t, 5.0) / measured == pytest.approx(stiffness - 29.13 * omega**2, rel=1e-4)


def test_a_specimen_answers_with_stiffness_damping_and_mass() -> None:
    actuator = Actuator((Spring(2.0e5), KelvinVoigt(1.0e5, 400.0)), specimen_mass_kg=50.0, gain=1.1, delay_s=0.004)
    run = simulate(alone(actuator), SINE)
    t, omega = times(run), 2 * np.pi * 5.0
    measured = settled(run.measured, t, 5.0)
    assert settled(run.force, t, 5.0) / measured == pytest.approx(3e5 + 400j * omega - 50 * omega**2, rel=1e-8)


@pytest.mark.parametrize(("stepping", "relative"), [("continuous", 1e-5), ("cr", 1e-3)])
def test_a_specimen_that_yields_follows_its_law(stepping: Any, relative: float) -> None:
    law = BoucWen(1.0e6, 0.002, 0.05, exponent=2.0)
    run = simulate(alone(Actuator((law,)), stepping=stepping), SINE)

    def speed(t: float) -> float:
        near = np.array([t - 1e-5, t + 1e-5])
        return float(np.diff(sine_at(near))[0] / 2e-5)

    def rate(t: float, z: twin.Floats) -> twin.Floats:
        v = speed(t)
        return (v - 0.45 * abs(v) * z * np.abs(z) - 0.55 * v * z**2) / 0.002

    t = times(run)
    z = solve_ivp(rate, (0.0, t[-1]), [0.0], t_eval=t, rtol=1e-8, atol=1e-10, max_step=0.01).y[0]
    expected = 1.0e6 * (0.05 * sine_at(t) + 0.95 * 0.002 * z)
    assert_near(run.force, expected, physical(relative, "relative"))


def test_converters_work_as_in_a_hybrid_test() -> None:
    coarse = Converter(limit=0.008, quantum=1e-3)
    actuator = Actuator((Spring(1e6),), command_converter=coarse, displacement_sensor=Converter(1e-13))
    run = simulate(alone(actuator, stepping="cr", seed=3), SINE)
    expected = np.round(np.clip(run.target, -0.008, 0.008) / 1e-3) * 1e-3
    assert_near(run.command, expected, round_off(10, 1))
    noise = run.measured - run.command
    # Standard deviation sqrt(density rate); of n samples it is known to 1 / sqrt(2 n).
    assert np.std(noise) == pytest.approx(math.sqrt(1e-13 * RATE), rel=physical(5, "%"))
    assert_near(run.force, 1e6 * run.command, round_off(10, 1))
    again = simulate(replace(run.test, seed=4), SINE)
    assert not np.array_equal(again.measured, run.measured)


def test_several_actuators_follow_one_target() -> None:
    run = simulate(alone(Actuator(delay_s=0.004), Actuator((Spring(1e5),), gain=0.9)), SINE)
    t = times(run)
    assert run.target.shape == run.measured.shape == (4097, 2)
    assert_array_equal(run.target[:, 0], run.target[:, 1])
    assert_near(run.measured[:, 0], sine_at(t - 0.004), physical(1e-8, "relative"))
    assert_near(run.measured[:, 1], 0.9 * sine_at(t), round_off(100, 1))
    assert_near(run.force[:, 1], 0.9e5 * sine_at(t), round_off(100, 1))


def test_many_are_run_at_once() -> None:
    cases = [(alone(Actuator(gain=gain)), SINE) for gain in (0.5, 2.0)]
    peaks = list(simulate_many(cases, lambda run: float(run.measured.max() / run.target.max())))
    assert peaks == pytest.approx([0.5, 2.0])


def test_an_actuator_that_leaves_the_bound_is_unstable() -> None:
    # b1 too small for a1b0: the plant itself oscillates and grows.
    wild = Actuator(specimen_mass_kg=30.0, dynamics=ServoHydraulic(b1=1.0, a1b0=2e14))
    for stepping in STEPPINGS:
        with pytest.raises(UnstableError) as caught:
            simulate(alone(wild, stepping=stepping, rate_hz=4096.0), SINE)
        assert 0 < caught.value.time_s < 4
    with pytest.raises(UnstableError):
        simulate(alone(Actuator(gain=2.0), bound_m=0.015), SINE)


# Recordings -----------------------------------------------------------------------------------------------------------


def recorded(rate_hz: float = 256.0) -> RecordedTarget:
    return RecordedTarget("earlier", sine_at(np.arange(round(4 * rate_hz) + 1) / rate_hz), rate_hz)


def test_a_recording_at_its_own_rate_is_followed_as_it_is_and_between_its_samples_by_a_spline() -> None:
    target = recorded()
    motion, notes = target.sampled(256.0)
    assert_near(motion[:, 0], target.displacement_m, round_off(10, 1))
    assert notes == ()
    motion, notes = target.sampled(RATE)
    assert notes == ("interpolated from 256 to 1024 Hz by a cubic spline",)
    # A cubic spline errs by (omega dt)^4 / 384 times 1 to 5.
    assert_near(motion[:, 0], sine_at(np.arange(4097) / RATE), physical(1e-5, "relative"))
    assert target.frequencies_hz[0] == pytest.approx(5.0, rel=physical(2, "%"))


def test_a_recording_off_zero_is_led_there_and_back() -> None:
    t = np.arange(257) / 64.0
    target = RecordedTarget("offset", 0.02 + 0.01 * np.cos(2 * np.pi * t), 64.0, ramp_s=0.5)
    assert target.duration_s == pytest.approx(5.0)
    motion, notes = target.sampled(64.0)
    assert notes == ("led from zero to its first value over 0.5 s and from its last value to zero over 0.5 s",)
    assert_allclose(motion[[0, -1]], 0.0, atol=round_off(10, 1))
    assert_near(motion[32 : 32 + 257, 0], target.displacement_m, round_off(10, 1))
    assert_near(motion[:32, 0], 0.03 * rise(t[:32], 0.5), round_off(100, 1))
    assert_near(motion[-32:, 0], 0.03 * rise(t[31::-1], 0.5), round_off(100, 1))
    fine = target.sampled(4096.0).motion
    assert np.abs(np.diff(fine[:, 0])).max() * 4096.0 == pytest.approx(np.abs(fine[:, 1]).max(), rel=1e-3)


def test_a_recording_is_read_in_its_unit_scaled_and_told(tmp_path: Path) -> None:
    x = recorded()
    rows = np.column_stack(
        (np.arange(len(x.displacement_m)) / 256.0, 1e3 * x.displacement_m, np.ones_like(x.displacement_m))
    )
    path = tmp_path / "earlier.csv"
    np.savetxt(path, rows, delimiter=",", header="time_s,target_mm,force_kN", comments="", fmt="%.12g")
    target = read_target(path)
    assert target.rate_hz == pytest.approx(256.0)
    assert_near(target.displacement_m, x.displacement_m, physical(1e-9, "relative"))
    assert "target_mm" in target.source or "'target'" in target.source
    scaled = target_from({"file": "earlier.csv", "factor": -0.5}, tmp_path)
    assert isinstance(scaled, RecordedTarget)
    assert_near(scaled.displacement_m, -0.5 * x.displacement_m, physical(1e-9, "relative"))
    assert scaled.notes[-1] == "scaled by -0.5"
    largest = target_from({"file": "earlier.csv", "peak_m": 0.05, "channel": "#1"}, tmp_path)
    assert isinstance(largest, RecordedTarget)
    assert largest.peak_m == pytest.approx(0.05)
    inches = read_target(path, unit="in")
    assert_near(inches.displacement_m, 25.4 * x.displacement_m, physical(1e-9, "relative"))
    assert "as given" in inches.notes[-1]
    (tmp_path / "list.txt").write_text("0 1 2\n1 0\n")
    listed = read_target(tmp_path / "list.txt", layout="values", unit="mm", rate_hz=10.0)
    assert_allclose(listed.displacement_m, [0, 0.001, 0.002, 0.001, 0])


def test_a_recording_that_cannot_be_used_is_told_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "two.csv"
    t = np.arange(100) / 50
    np.savetxt(path, np.column_stack((t, np.sin(t), np.cos(t))), delimiter=",", header="time_s,a_mm,b_mm", comments="")
    with pytest.raises(ChannelError, match=r"2 channels may be the displacement: .*choose one with channel"):
        read_target(path)
    with pytest.raises(RecordingError, match=r"expected a unit of displacement \(m, cm, mm, um, in, ft\), found 'kN'"):
        read_target(path, channel="#1", unit="kN")


def test_the_target_of_a_run_is_run_again(tmp_path: Path) -> None:
    first = simulate(alone(Actuator(delay_s=0.004)), SINE)
    first.write(tmp_path / "first.h5")
    again = simulate(alone(Actuator()), read_target(tmp_path / "first.h5"))
    assert_near(again.target, first.target, round_off(10, 1))


# Configurations -------------------------------------------------------------------------------------------------------

PLAIN = """
[[actuator]]
gain = 1.1
delay_s = 0.005
[target]
sine = { frequency_hz = 5.0, amplitude_m = 0.01, duration_s = 4.0, ramp_s = 1.0 }
"""


def mistakes(text: str, base_dir: Path | None = None) -> dict[str, str]:
    """Messages by key; every key may be complained of once only."""
    with pytest.raises(ConfigurationError) as caught:
        configuration_from(tomllib.loads(text), base_dir)
    found = caught.value.mistakes
    assert len({key for key, _ in found}) == len(found), found
    return dict(found)


def test_a_configuration_with_a_target_is_actuators_alone() -> None:
    configuration = configuration_from(tomllib.loads(PLAIN))
    assert configuration.test == VirtualTest(configuration.test.structure, (Actuator(gain=1.1, delay_s=0.005),))
    assert configuration.test.structure.n_dof == 0
    assert configuration.motion_from(".") == SINE


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ("sine = { frequency_hz = 2, amplitude_m = 0.01, cycles = 10 }", SineTarget(2.0, 0.01, 5.0)),
        ("sweep = { from_hz = 1, to_hz = 9, amplitude_m = 0.01, duration_s = 8 }", SweepTarget(1.0, 9.0, 0.01, 8.0)),
        (
            "sweep = { from_hz = 9, to_hz = 1, amplitude_m = 1e-3, duration_s = 8, law = 'logarithmic', ramp_s = 1 }",
            SweepTarget(9.0, 1.0, 1e-3, 8.0, "logarithmic", 1.0),
        ),
    ],
)
def test_every_form_of_target_is_what_it_says(table: str, expected: Any) -> None:
    text = PLAIN[: PLAIN.index("sine")] + table
    configuration = configuration_from(tomllib.loads(text))
    assert configuration.motion_from(".") == expected
    assert target_from(expected.table, ".") == expected


def test_the_table_of_a_test_is_read_back_as_the_same_test() -> None:
    actuator = Actuator(
        (KelvinVoigt(5e5, 100.0),),
        specimen_mass_kg=30.0,
        dynamics=ServoHydraulic(gain=1.0),
        compensation=InverseCompensation(2.0),
        force_sensor=Converter(1e-4, 1e5, 0.5),
    )
    test = alone(actuator, Actuator(delay_s=DelayHistory((0.0, 1.0), (0.0, 0.1))), stepping="cr", seed=5)
    table = json.loads(json.dumps(to_table(test, SINE.table, 4.0), allow_nan=False))
    assert "structure" not in table
    again = configuration_from(table)
    assert (again.test.actuators, again.test.seed, again.duration_s) == (test.actuators, 5, 4.0)
    assert again.motion_from(".") == SINE
    assert virtual_test_from(table).actuators == test.actuators


def test_every_mistake_is_told_at_once_with_its_key(tmp_path: Path) -> None:
    found = mistakes(
        """
        [test]
        rate_hz = 100
        [[element]]
        law = "spring"
        [[actuator]]
        dof = 2
        part_of_structure = false
        specimen = { law = "spring" }
        delay = 0.1
        gain = 0
        [target]
        sine = { frequency = 5, amplitude_m = -1, cycles = 3, duration_s = 4 }
        channel = "x"
        pek_m = 1
        """
    )
    assert set(found) == {
        "element",
        "actuator[1].dof",
        "actuator[1].part_of_structure",
        "actuator[1].specimen.stiffness_n_per_m",
        "actuator[1].delay",
        "actuator[1].gain",
        "target.sine.frequency",
        "target.sine.frequency_hz",
        "target.sine.amplitude_m",
        "target.sine.duration_s",
        "target.channel",
        "target.pek_m",
    }
    assert found["target.sine.frequency"] == "no such key (did you mean 'frequency_hz'?)"
    assert found["target.pek_m"] == "no such key (did you mean 'peak_m'?)"
    assert "there is no structure whose stiffness" in found["actuator[1].specimen.stiffness_n_per_m"]
    assert list(found)[-1].startswith("target")


SINE_LINE = PLAIN[PLAIN.index("sine") :]


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        ("", {"target": "expected exactly one of sine, sweep, file, found none"}),
        ("sine = 3", {"target.sine": "expected a table, found 3"}),
        ("file = 'none.csv'", {"target.file": "no such file: "}),
        ("file = 'x.csv'\nfactor = 0", {"target.factor": "expected a finite number other than zero, found 0"}),
        ("file = 'x.csv'\nfactor = 1\npeak_m = 1", {"target.peak_m": "expected at most one of factor, peak_m"}),
        ("file = 'x.csv'\nunit = 'kN'", {"target.unit": "expected a unit of displacement"}),
        ("file = 'x.csv'\nramp_s = -1", {"target.ramp_s": "expected a positive number, found -1"}),
        (
            "file = 'x.csv'\nlayout = 'values'",
            {"target.unit": "expected one: the layout 'values' states none", "target.rate_hz": "expected one: "},
        ),
        (
            "sine = { frequency_hz = 600, amplitude_m = 1, duration_s = 4 }",
            {"target.sine.frequency_hz": "expected below half of the rate, 512 Hz, found 600"},
        ),
        (
            "sweep = { from_hz = 1, to_hz = 1, amplitude_m = 1, duration_s = 4, law = 'log' }",
            {"target.sweep.law": "expected one of 'linear', 'logarithmic', found 'log'"},
        ),
        (
            "sine = { frequency_hz = 5, amplitude_m = 1, cycles = 5, ramp_s = 2 }",
            {"target.sine.ramp_s": "expected up to half of the duration, 0.5 s, found 2"},
        ),
        (
            "sine = { frequency_hz = 5, amplitude_m = 1 }",
            {"target.sine.duration_s": "expected it or cycles, found none"},
        ),
    ],
)
def test_a_wrong_table_of_a_target_is_told(target: str, expected: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("0\n1\n")
    found = mistakes(PLAIN[: PLAIN.index("sine")] + target, tmp_path)
    for key, message in expected.items():
        assert found.pop(key).startswith(message)
    assert set(found) <= {"target.sweep.to_hz"}


def test_a_target_beside_a_structure_is_a_mistake_and_the_rest_is_checked_as_a_hybrid_test() -> None:
    found = mistakes(PLAIN + "[structure]\nfrequency_hz = 5.0\ndamping_ratio = 0.02\n")
    assert found["target"] == "is for actuators alone: expected nothing beside it, found [structure]"
    assert set(found) == {"target", "actuator[1].specimen", "ground_motion"}


def test_what_speaks_of_a_structure_is_refused_without_one() -> None:
    hybrid = VirtualTest(Structure.sdof(5.0, 0.02), (Actuator((Spring(),)),))
    for what, key in (
        (lambda: simulate(hybrid, SINE), "structure"),
        (lambda: simulate(alone(Actuator()), smooth_motion()), "structure"),
        (lambda: critical_delay(alone(Actuator())), "structure"),
        (lambda: simulate(alone(), SINE), "actuator"),
        (lambda: simulate(alone(Actuator((Spring(),))), SINE), "actuator[1].specimen.stiffness_n_per_m"),
        (lambda: simulate(alone(Actuator(from_dof=1)), SINE), "actuator[1].from_dof"),
        (lambda: simulate(alone(Actuator(dof=-1)), SINE), "actuator[1].dof"),
        (
            lambda: simulate(alone(Actuator(force_delay_samples=1), stepping="cr"), SINE),
            "actuator[1].force_delay_samples",
        ),
        (lambda: simulate(alone(Actuator(), elements=(Element(Spring(1.0)),)), SINE), "element"),
        (lambda: simulate(alone(Actuator(dynamics=FirstOrder(2.0))), SINE), "actuator[1].dynamics"),
        (lambda: simulate(alone(Actuator(dynamics=ServoHydraulic())), SINE), "actuator[1].specimen_mass_kg"),
        (lambda: simulate(alone(Actuator(delay_s=5.0)), SINE), "actuator[1].delay_s"),
    ):
        with pytest.raises(ConfigurationError) as caught:
            what()
        assert key in [one for one, _ in caught.value.mistakes], caught.value.mistakes
        assert len(dict(caught.value.mistakes)) == len(caught.value.mistakes)


ANYTHING = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4) | st.lists(st.integers())


@settings(max_examples=200)
@given(st.data())
def test_whatever_stands_in_a_table_it_is_read_or_told(data: st.DataObject) -> None:
    table: Any = copy.deepcopy(tomllib.loads(PLAIN))
    table["target"] |= data.draw(st.dictionaries(st.sampled_from(["file", "factor", "peak_m", "ramp_s"]), ANYTHING))
    place = data.draw(st.sampled_from([table["target"], table["target"]["sine"], table["actuator"][0]]))
    place[data.draw(st.sampled_from([*place, "law", "cycles", "sweep", "specimen"]))] = data.draw(ANYTHING)
    try:
        test, motion, _ = configuration_from(table)
    except ConfigurationError as error:
        told = error.mistakes
    else:
        told = (("", "none"),)
        virtual_test_from(json.loads(json.dumps(to_table(test, motion, None))))
    assert all(message for _, message in told)


# The commands ---------------------------------------------------------------------------------------------------------


def command(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    try:
        status = main([str(one) for one in arguments])
    except SystemExit as stop:
        status = int(stop.code or 0)
    out, err = capsys.readouterr()
    return status, out, err


def test_a_run_is_written_evaluated_and_studied(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    config, path = tmp_path / "alone.toml", tmp_path / "run.h5"
    config.write_text(PLAIN, encoding="utf-8")
    status, out, err = command(capsys, "simulate", config, "-o", path)
    assert status == 0
    assert f"rthstrack evaluate {path}" in err
    lines = {line[:10].strip(): line[10:].strip() for line in out.splitlines() if line[:10].strip()}
    assert lines["test"] == f"{config}: 4097 samples at 1024 Hz (4 s)"
    assert lines["target"] == "sine of 5 Hz, 10 mm"
    assert lines["actuator"] == "gain 1.1, 5 ms lag at 5 Hz, compensation included"
    assert lines["peaks"] == "target 10 mm, measured 11 mm, force 0 kN"
    # a omega
    assert "the target moves by up to 314.2 mm/s" in out
    for word in ("critical", "damping", "structure", "ground"):
        assert word not in out
    with h5py.File(path) as file:
        assert set(file) == {"target", "command", "measured", "force"}
        assert json.loads(file.attrs["configuration"])["target"] == tomllib.loads(PLAIN)["target"]
        assert file.attrs["target_name"] == "sine of 5 Hz, 10 mm"
    test = read_run_test(path)
    assert test is not None
    assert test.actuators == (Actuator(gain=1.1, delay_s=0.005),)
    status, out, _ = command(capsys, "evaluate", path, "--json")
    (result,) = json.loads(out)["results"]
    assert result["amplitude"] == pytest.approx(1.1, rel=physical(1e-4, "relative"))
    assert result["delay_s"] == pytest.approx(0.005, rel=physical(1e-4, "relative"))
    for source in (path, config):
        status, out, _ = command(
            capsys, "study", source, "-P", "1", "-Q", "1", "--windows", "boxcar", "--no-timing", "--json"
        )
        assert status == 0
        cell = json.loads(out)["study"]["cells"][0]
        assert (cell["true_amplitude"], cell["true_delay_s"]) == (pytest.approx(1.1), pytest.approx(0.005))


def test_a_mistake_is_told_with_the_file_and_exit_status_2(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    config = tmp_path / "alone.toml"
    config.write_text(PLAIN.replace("amplitude_m", "amplitud_m"), encoding="utf-8")
    status, _, err = command(capsys, "simulate", config)
    assert status == 2
    assert f"{config}: target.sine.amplitud_m: no such key (did you mean 'amplitude_m'" in err


def test_the_example_is_a_whole_rehearsal(root: Path) -> None:
    configuration = read_configuration(root / "examples" / "actuator_alone.toml")
    run = simulate(configuration.test, configuration.motion_from(root / "examples"))
    response = rthstrack.frequency_response(run.target, run.measured, run.rate_hz)
    inside = (response.frequency_hz > 1.0) & (response.frequency_hz < 8.0)
    true = true_tracking(run.test, response.frequency_hz[inside])
    assert true is not None
    assert_allclose(response.gain[inside], true[0], rtol=physical(2, "%"))
