"""Virtual tests: part of a structure computed, part a specimen moved by an actuator that lags, in one simulation.

    M x'' + C x' + K x + sum of restoring forces = -M i a_g        (relative to the ground; SI units)

`VirtualTest` says what is tested, `simulate` runs it under a ground motion, `critical_delay` says which delay it bears.
Without a structure (`Structure.none()`) the actuators alone follow a target that is given.
Degrees of freedom are numbered from 1; 0 is the ground. delay > 0: measured lags.
"""

from rthstrack.virtual_test.parts import (
    OF_STRUCTURE,
    Actuator,
    BaberWen,
    BoucWen,
    Compensator,
    Converter,
    Dashpot,
    DelayHistory,
    Element,
    FirstOrder,
    InverseCompensation,
    KelvinVoigt,
    Law,
    Maxwell,
    Mistake,
    ModalDamping,
    PolynomialExtrapolation,
    RayleighDamping,
    ServoHydraulic,
    Spring,
    Structure,
    TransferFunction,
    VirtualTest,
)
from rthstrack.virtual_test.run import CriticalDelay, Run
from rthstrack.virtual_test.simulation import (
    DelayDamping,
    critical_delay,
    delay_damping,
    simulate,
    simulate_many,
    true_tracking,
)

__all__ = [
    "OF_STRUCTURE",
    "Actuator",
    "BaberWen",
    "BoucWen",
    "Compensator",
    "Converter",
    "CriticalDelay",
    "Dashpot",
    "DelayDamping",
    "DelayHistory",
    "Element",
    "FirstOrder",
    "InverseCompensation",
    "KelvinVoigt",
    "Law",
    "Maxwell",
    "Mistake",
    "ModalDamping",
    "PolynomialExtrapolation",
    "RayleighDamping",
    "Run",
    "ServoHydraulic",
    "Spring",
    "Structure",
    "TransferFunction",
    "VirtualTest",
    "critical_delay",
    "delay_damping",
    "simulate",
    "simulate_many",
    "true_tracking",
]
