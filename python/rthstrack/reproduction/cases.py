"""The paper's virtual tests: records, structures, loops (sections 3.1.1, 3.1.2 and 3.2; method.md 7 and 8)."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from rthstrack.errors import SettingError, UnstableError
from rthstrack.ground_motion import GroundMotion, read_ground_motion, record
from rthstrack.reproduction import paper
from rthstrack.virtual_test import (
    Actuator,
    BoucWen,
    CriticalDelay,
    Element,
    FirstOrder,
    InverseCompensation,
    KelvinVoigt,
    Run,
    Spring,
    Structure,
    VirtualTest,
    critical_delay,
    simulate,
)

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
    critical_delay: CriticalDelay
    run: Run | None
    unstable_at_s: float | None


def linear(
    frequency_hz: float = 5.0, gain: float = paper.GAIN, delay_s: float = paper.DELAY_S["linear"]
) -> VirtualTest:
    """Section 3.1.1: an elastic structure whose spring is the specimen; the delay uncompensated."""
    actuator = Actuator((Spring(),), gain=gain, delay_s=delay_s)
    return VirtualTest(Structure.sdof(frequency_hz, 0.02), (actuator,), rate_hz=paper.RATE_HZ)


def nonlinear(gain: float = paper.GAIN, delay_s: float = paper.DELAY_S["nonlinear"]) -> VirtualTest:
    """Section 3.1.2: 1 Hz, the specimen Eq 13."""
    structure = Structure.sdof(1.0, 0.02, mass_kg=_YIELDING_STIFFNESS_N_PER_M / (2 * math.pi) ** 2)
    return VirtualTest(structure, (Actuator((BoucWen(),), gain=gain, delay_s=delay_s),), rate_hz=paper.RATE_HZ)


def laboratory(alpha_es: int | None) -> VirtualTest:
    """Section 3.2 as a virtual experiment: a yielding frame with a damper as specimen; None: perfect actuator."""
    actuator = Actuator(
        (_DAMPER,),
        part_of_structure=False,
        dynamics=None if alpha_es is None else FirstOrder(paper.ALPHA),
        compensation=None if alpha_es is None else InverseCompensation(float(alpha_es)),
    )
    frame = Structure.sdof(0.77, 0.02, mass_kg=_FRAME_MASS_KG)
    return VirtualTest(frame, (actuator,), (Element(BoucWen()),), "cr", paper.RATE_HZ)


def choose_records(files: Mapping[str, RecordFile]) -> dict[str, UsedRecord]:
    """The user's files where given, else the far-field set's CHY101-N and stand-ins.

    Raises SettingError for a name that the paper has not, RecordingError for a file or where the records are missing.
    """
    for name in files:
        if name not in RECORDS:
            near = difflib.get_close_matches(name.upper(), RECORDS, 1)
            meant = f"; did you mean {near[0]}?" if near else ""
            raise SettingError(f"the paper has no record '{name}': expected one of {', '.join(RECORDS)}{meant}")
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
        if name == "CANOGA":
            motion = motion.scaled_to_peak(_EXPERIMENT_PEAK_M_S2)
            duration_s = (_EXPERIMENT_SAMPLES - 1) / paper.RATE_HZ
        used[name] = UsedRecord(name, motion, duration_s, remark)
    return used


def run_case(case: Case, records: Mapping[str, UsedRecord], perfect: bool = False) -> Run:
    """The case's virtual test; `perfect`: with gain 1, no delay and no actuator dynamics."""
    used = records[case.record]
    if case.kind == "experiment":
        test = laboratory(None if perfect else case.alpha_es)
    else:
        build = linear if case.kind == "linear" else nonlinear
        test = build(gain=1.0, delay_s=0.0) if perfect else build()
    return simulate(test, used.motion, duration_s=used.duration_s)


def trials() -> dict[str, VirtualTest]:
    """Tests beside the paper's, each for one of its statements on stability, other frequencies or nonlinearity."""
    return {
        "linear, 1 ms, K = 1.1": linear(),
        "linear, 6.4 ms, K = 1": linear(gain=1.0, delay_s=6.4e-3),
        "elastic 1 Hz, 20 ms, K = 1": linear(1.0, gain=1.0, delay_s=20e-3),
        "nonlinear 1 Hz, 20 ms, K = 1": nonlinear(gain=1.0, delay_s=20e-3),
        "elastic 1 Hz, perfect": linear(1.0, gain=1.0, delay_s=0.0),
        **{f"linear, {f:g} Hz": linear(f) for f in OTHER_FREQUENCIES_HZ},
    }


def run_trial(test: VirtualTest, used: UsedRecord) -> Trial:
    """Runs one, to its end or to where it leaves its bounds."""
    critical = critical_delay(test)
    try:
        return Trial(test, critical, simulate(test, used.motion, duration_s=used.duration_s), None)
    except UnstableError as error:
        return Trial(test, critical, None, error.time_s)
