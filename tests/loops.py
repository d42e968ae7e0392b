"""Virtual tests that several files test, and the same loops for the twin, taken apart by the definition."""

from __future__ import annotations

from typing import Any

import numpy as np

import dynamics_twin as twin
from rthstrack.ground_motion import GroundMotion
from rthstrack.virtual_test import (
    Actuator,
    BaberWen,
    BoucWen,
    Dashpot,
    KelvinVoigt,
    Law,
    Maxwell,
    RayleighDamping,
    ServoHydraulic,
    Spring,
    Structure,
    TransferFunction,
    VirtualTest,
)

STOREYS = Structure.shear_building(
    [20000.0, 20000.0, 15000.0], [2.0e7, 1.8e7, 1.5e7], RayleighDamping((0.03, 0.04), (1, 2))
)


def smooth_motion(
    rate_hz: float = 256.0, duration_s: float = 64.0, centre_s: float = 4.0, width_s: float = 0.6, scale: float = 1.0
) -> GroundMotion:
    """Three tones under a bell: band-limited, below 1e-17 at its start, nothing after 2 `centre_s`."""
    t = np.arange(round(duration_s * rate_hz)) / rate_hz
    tones = sum(np.sin(2 * np.pi * f * t + phase) for f, phase in ((1.3, 0.0), (3.1, 1.0), (6.7, 2.0)))
    bell = np.exp(-(((t - centre_s) / width_s) ** 2))
    return GroundMotion("bell", scale * np.where(bell > 1e-19, bell * tones, 0.0), rate_hz, "made")


def tone(frequency_hz: float, rate_hz: float, duration_s: float, rise_s: float = 2.0) -> GroundMotion:
    """A sine of 1 m/s2 that rises smoothly."""
    t = np.arange(round(duration_s * rate_hz)) / rate_hz
    rise = 0.5 - 0.5 * np.cos(np.pi * np.clip(t / rise_s, 0, 1))
    return GroundMotion("tone", rise * np.sin(2 * np.pi * frequency_hz * t), rate_hz, "made")


def sdof_test(actuator: Actuator | None = None, **test: Any) -> VirtualTest:
    """The paper's 5 Hz structure, its spring the specimen, unless told otherwise."""
    made: dict[str, Any] = {"structure": Structure.sdof(5.0, 0.02), "rate_hz": 256.0}
    return VirtualTest(actuators=(actuator or Actuator((Spring(),)),), **(made | test))


def stiffness_between(structure: Structure, dof: int, from_dof: int) -> float:
    """All the stiffness that joins two degrees of freedom, or one to the ground."""
    k = structure.stiffness_n_per_m
    return float(-k[dof - 1, from_dof - 1] if from_dof else k[dof - 1].sum())


def answer_of(laws: tuple[Law, ...], whole: float, mass: float = 0.0) -> twin.Answer:
    """What laws side by side answer, elastic; `whole` is the stiffness meant by None."""
    stiffness, damping, series = 0.0, 0.0, []
    for law in laws:
        if isinstance(law, Maxwell):
            series.append((law.stiffness_n_per_m, law.damping_n_s_per_m))
        if isinstance(law, Spring | KelvinVoigt | BoucWen | BaberWen):
            stiffness += whole if law.stiffness_n_per_m is None else law.stiffness_n_per_m
        if isinstance(law, Dashpot | KelvinVoigt):
            damping += law.damping_n_s_per_m
    return twin.Answer(stiffness, damping, mass, tuple(series))


def place(n: int, dof: int, from_dof: int) -> twin.Floats:
    b = np.zeros(n)
    b[dof - 1] = 1.0
    if from_dof:
        b[from_dof - 1] = -1.0
    return b


def servo_response(servo: ServoHydraulic, specimen: twin.Answer) -> twin.Filter:
    """G(s) = g a1b0 / ((s^2 + b1 s + b2) ((s + a3) z(s) + a2 s) + a1b0), z the specimen with its mass."""

    def response(s: twin.Complexes) -> twin.Complexes:
        valve = s**2 + servo.b1 * s + servo.b2
        found: twin.Complexes = (
            servo.gain * servo.a1b0 / (valve * ((s + servo.a3) * specimen(s) + servo.a2 * s) + servo.a1b0)
        )
        return found

    return response


def loop_of(test: VirtualTest) -> twin.Loop:
    """The linear loop of a test in continuous time: specimens and elements that are part of the structure taken out."""
    structure = test.structure
    mass, damping, stiffness = (
        np.array(m) for m in (structure.mass_kg, structure.damping_n_s_per_m, structure.stiffness_n_per_m)
    )
    n = len(mass)
    rigs, elements = [], []
    for one in (*test.actuators, *test.elements):
        b = place(n, one.dof, one.from_dof)
        whole = stiffness_between(structure, one.dof, one.from_dof)
        if isinstance(one, Actuator):
            answer = answer_of(one.specimen, whole, one.specimen_mass_kg)
            dynamics: twin.Filter = np.ones_like
            if isinstance(one.dynamics, TransferFunction):
                top, bottom = np.array(one.dynamics.numerator), np.array(one.dynamics.denominator)
                dynamics = lambda s, top=top, bottom=bottom: np.polyval(top, s) / np.polyval(bottom, s)  # noqa: E731
            elif isinstance(one.dynamics, ServoHydraulic):
                dynamics = servo_response(one.dynamics, answer)
            assert isinstance(one.delay_s, float)
            rigs.append(twin.Rig(b, answer, one.gain, one.delay_s, dynamics))
        else:
            answer = answer_of((one.law,), whole)
            elements.append((b, answer))
        if one.part_of_structure:
            outer = np.outer(b, b)
            mass = mass - answer.mass * outer
            damping = damping - answer.damping * outer
            stiffness = stiffness - answer.stiffness * outer
    load = structure.mass_kg @ structure.influence
    return twin.Loop(mass, damping, stiffness, load, tuple(rigs), tuple(elements))
