"""The paper's virtual tests: records, structures, loops (sections 3.1.1, 3.1.2 and 3.2; method.md 7 and 8)."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, TypeAlias

from rthstrack.errors import SettingError, UnstableError
from rthstrack.ground_motion.files import read_ground_motion
from rthstrack.ground_motion.motion import GroundMotion
from rthstrack.ground_motion.records import record
from rthstrack.reproduction import paper
from rthstrack.virtual_test.parts import (
    Actuator,
    BaberWen,
    BoucWen,
    Element,
    FirstOrder,
    InverseCompensation,
    KelvinVoigt,
    ModalDamping,
    Spring,
    Structure,
    VirtualTest,
)
from rthstrack.virtual_test.run import CriticalDelay, Run
from rthstrack.virtual_test.simulation import critical_delay, simulate

RecordFile: TypeAlias = str | Path | GroundMotion

#: What the paper calls its records, and what stands in where the user gives no file.
RECORDS = {"CHY101-N": "CHY101-N", "MU2035": "MUL009", "CANOGA": "MUL279"}
_WHERE = {"CHY101-N": "CHY101-N", "MU2035": "MU2035", "CANOGA": "Canoga Park (N169E)"}
_STAND_INS = {
    "MUL009": "MUL009 (Northridge 1994, Mulholland Drive; its first 24 s)",
    "MUL279": "MUL279 (Northridge 1994, Mulholland Drive, the nearest far-field station)",
}

_YIELDING_STIFFNESS_N_PER_M = 11.765e6
_FRAME_MASS_KG = 503.4e3
_DAMPER = KelvinVoigt(1.2e6, 9e4)
_EXPERIMENT_SAMPLES = 51160
_EXPERIMENT_PEAK_M_S2 = 0.322
_MU2035_DURATION_S = 24.0

#: The actuator of the experiment: nominally 29 samples (the paper's best estimate), and the value that fits the printed
#: delays in reversed order to 0.04 ms at 0.66 Hz (`claims.experiment`), with which the virtual experiment is run.
NOMINAL_ALPHA, FITTED_ALPHA = 29.0, 28.63

#: Natural frequencies of the linear structure beside the paper's 5 Hz.
OTHER_FREQUENCIES_HZ = (1.0, 2.0, 10.0)


@dataclass(frozen=True, slots=True, eq=False)
class UsedRecord:
    """The ground motion used for one of the paper's records; `remark` is empty unless it stands in for it."""

    name: str
    motion: GroundMotion
    duration_s: float | None
    remark: str = ""

    @property
    def short_remark(self) -> str:
        """The same in few words."""
        return f"{self.motion.name} stands in for {self.name}" if self.remark else ""


@dataclass(frozen=True, slots=True)
class Case:
    """One of the seven pairs that the paper evaluates; `alpha_es` for those of the experiment."""

    key: str
    label: str
    kind: Literal["linear", "nonlinear", "experiment"]
    record: str
    alpha_es: int | None = None

    @property
    def plain_label(self) -> str:
        """The label without TeX, for tables and CSV."""
        return self.label.replace("$", "").replace("\\", "").replace("{", "").replace("}", "")


CASES = {
    case.key: case
    for case in (
        Case("linear-mu2035", "linear, MU2035", "linear", "MU2035"),
        Case("linear-chy101-n", "linear, CHY101-N", "linear", "CHY101-N"),
        Case("nonlinear-mu2035", "nonlinear, MU2035", "nonlinear", "MU2035"),
        Case("nonlinear-chy101-n", "nonlinear, CHY101-N", "nonlinear", "CHY101-N"),
        *(
            Case(f"experiment-{a}", rf"experiment, $\alpha_{{es}}$ = {a}", "experiment", "CANOGA", a)
            for a in paper.ALPHA_ES
        ),
    )
}


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A virtual test run to see whether its loop is stable: the run, or the time at which it left its bounds."""

    test: VirtualTest
    critical_delay: CriticalDelay | None
    run: Run | None
    unstable_at_s: float | None


def linear(
    frequency_hz: float = 5.0, gain: float = paper.GAIN, delay_s: float = paper.DELAY_S["linear"]
) -> VirtualTest:
    """Section 3.1.1: an elastic structure whose spring is the specimen; the delay uncompensated."""
    actuator = Actuator((Spring(),), gain=gain, delay_s=delay_s)
    return VirtualTest(Structure.sdof(frequency_hz, 0.02), (actuator,), rate_hz=paper.RATE_HZ)


def nonlinear(
    gain: float = paper.GAIN, delay_s: float = paper.DELAY_S["nonlinear"], law: BoucWen | BaberWen | None = None
) -> VirtualTest:
    """Section 3.1.2: 1 Hz, the specimen Eq 13; `law`: another."""
    structure = Structure.sdof(1.0, 0.02, mass_kg=_YIELDING_STIFFNESS_N_PER_M / (2 * math.pi) ** 2)
    actuator = Actuator((law or BoucWen(),), gain=gain, delay_s=delay_s)
    return VirtualTest(structure, (actuator,), rate_hz=paper.RATE_HZ)


def laboratory(alpha_es: int | None, alpha: float = NOMINAL_ALPHA, damper: KelvinVoigt | None = None) -> VirtualTest:
    """Section 3.2 as a virtual experiment: a yielding frame with a damper as specimen; alpha_es None: perfect actuator.

    alpha: samples that the actuator takes. damper: another than ours, whose size the capacity of 200 kN allows.
    """
    actuator = Actuator(
        (damper or _DAMPER,),
        part_of_structure=False,
        dynamics=None if alpha_es is None else FirstOrder(alpha),
        compensation=None if alpha_es is None else InverseCompensation(float(alpha_es)),
    )
    frame = Structure.sdof(0.77, 0.02, mass_kg=_FRAME_MASS_KG)
    return VirtualTest(frame, (actuator,), (Element(BoucWen()),), "cr", paper.RATE_HZ)


def checked_name(name: str) -> str:
    """The name of a record of the paper's; SettingError for any other."""
    if name not in RECORDS:
        near = difflib.get_close_matches(name.upper(), RECORDS, 1)
        meant = f"; did you mean {near[0]}?" if near else ""
        raise SettingError(f"the paper has no record '{name}': expected one of {', '.join(RECORDS)}{meant}")
    return name


def choose_records(files: Mapping[str, RecordFile]) -> dict[str, UsedRecord]:
    """The user's files where given, else the far-field set's CHY101-N and stand-ins.

    Raises SettingError for a name that the paper has not, RecordingError for a file or where the records are missing.
    """
    for name in files:
        checked_name(name)
    used = {}
    for name, instead in RECORDS.items():
        if name in files:
            given = files[name]
            motion = given if isinstance(given, GroundMotion) else read_ground_motion(given)
            duration_s, remark = None, ""
        else:
            motion = record(instead)
            duration_s = _MU2035_DURATION_S if name == "MU2035" else None
            remark = (
                "" if instead == name else f"{_WHERE[name]} is not freely available: {_STAND_INS[instead]} stands in"
            )
        made = UsedRecord(name, motion, duration_s, remark)
        used[name] = scaled_for_experiment(made) if name == "CANOGA" else made
    return used


def scaled_for_experiment(used: UsedRecord) -> UsedRecord:
    """The record as the experiment takes it: a peak of 0.322 m/s2, 51160 samples."""
    duration_s = (_EXPERIMENT_SAMPLES - 1) / paper.RATE_HZ
    return replace(used, motion=used.motion.scaled_to_peak(_EXPERIMENT_PEAK_M_S2), duration_s=duration_s)


def run_case(case: Case, records: Mapping[str, UsedRecord], perfect: bool = False) -> Run:
    """The case's virtual test; `perfect`: with gain 1, no delay and no actuator dynamics."""
    used = records[case.record]
    if case.kind == "experiment":
        test = laboratory(None if perfect else case.alpha_es, FITTED_ALPHA)
    else:
        build = linear if case.kind == "linear" else nonlinear
        test = build(gain=1.0, delay_s=0.0) if perfect else build()
    return simulate(test, used.motion, duration_s=used.duration_s)


def trials() -> dict[str, tuple[VirtualTest, str]]:
    """Tests beside the paper's, each for one of its statements, with the record that drives them."""
    degrading = BaberWen(stiffness_degradation=0.02, strength_degradation=0.01)
    storeys = Structure.shear_building((1000.0,) * 3, (3.5e6,) * 3, ModalDamping(0.02))
    return {
        name: (test, "CHY101-N")
        for name, test in {
            "linear, 1 ms, K = 1.1": linear(),
            "linear, 6.4 ms, K = 1": linear(gain=1.0, delay_s=6.4e-3),
            "elastic 1 Hz, 20 ms, K = 1": linear(1.0, gain=1.0, delay_s=20e-3),
            "nonlinear 1 Hz, 20 ms, K = 1": nonlinear(gain=1.0, delay_s=20e-3),
            "elastic 1 Hz, perfect": linear(1.0, gain=1.0, delay_s=0.0),
            "elastic 1 Hz, 5 ms": linear(1.0, delay_s=paper.DELAY_S["nonlinear"]),
            **{f"linear, {f:g} Hz": linear(f) for f in OTHER_FREQUENCIES_HZ},
            "linear, 10 Hz, 0.5 ms": linear(10.0, delay_s=0.5e-3),
            "degrading": nonlinear(law=degrading),
            "three storeys": VirtualTest(
                storeys, (Actuator((Spring(),), gain=paper.GAIN, delay_s=1e-3),), rate_hz=paper.RATE_HZ
            ),
        }.items()
    } | {"frame without a damper": (laboratory(None, damper=KelvinVoigt(1.0)), "CANOGA")}


def run_trial(test: VirtualTest, used: UsedRecord, factor: float = 1.0) -> Trial:
    """Runs one, to its end or to where it leaves its bounds; the motion times `factor`."""
    critical = critical_delay(test) if len(test.structure.natural_frequencies_hz) == 1 else None
    try:
        run = simulate(test, used.motion.scaled(factor), duration_s=used.duration_s)
    except UnstableError as error:
        return Trial(test, critical, None, error.time_s)
    return Trial(test, critical, run, None)
