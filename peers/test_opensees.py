"""Virtual tests without delay beside OpenSees: what to expect comes from OpenSees alone. Run by `make test-peers`."""

from __future__ import annotations

import ctypes
import importlib.util
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np
import pytest

from rthstrack.ground_motion import record, synthetic_ground_motion
from rthstrack.virtual_test import (
    Actuator,
    BaberWen,
    BoucWen,
    Element,
    ModalDamping,
    RayleighDamping,
    Spring,
    Structure,
    VirtualTest,
    simulate,
)
from tolerances import physical

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rthstrack.ground_motion import GroundMotion

    Floats = NDArray[np.float64]
    Stepping = Literal["continuous", "cr"]

# The Linux wheel brings its BLAS, but its own LAPACK does not find it unless it has been loaded before.
_wheel = importlib.util.find_spec("openseespylinux")
if _wheel is not None and _wheel.origin is not None:
    for _library in ("libquadmath.so.0", "libgfortran.so.4", "libblas.so.3"):
        ctypes.CDLL(str(Path(_wheel.origin).parent / "lib" / _library))

import openseespy.opensees as ops  # noqa: E402


class Building(NamedTuple):
    """Storeys from the ground up, each with the law of its restoring force; the first is the specimen."""

    masses_kg: tuple[float, ...]
    storeys: tuple[Spring | BoucWen | BaberWen, ...]
    damping: ModalDamping | RayleighDamping


class Difference(NamedTuple):
    """Of displacements or forces, over OpenSees' peaks: of the peaks, and at any instant."""

    peak: float
    history: float


class Way(NamedTuple):
    """How both are run, and what is held."""

    rate_hz: float
    opensees_steps_per_sample: int
    tolerance: Difference


# The paper's section 3.1: 1 Hz, 2 %, Eq 13.
STIFFNESS: Final = 11.765e6
MASS: Final = STIFFNESS / (2 * np.pi) ** 2
EQ_13: Final = (STIFFNESS, 0.010, 0.01, 0.55, 0.45, 2.0)
MASSES: Final = (20e3, 20e3, 15e3)
SPRINGS: Final = (Spring(2.0e7), Spring(1.8e7), Spring(1.5e7))

BUILDINGS: Final = {
    "Bouc-Wen SDOF": Building((MASS,), (BoucWen(*EQ_13),), ModalDamping(0.02)),
    "Bouc-Wen SDOF that degrades": Building((MASS,), (BaberWen(*EQ_13, 0.02, 0.04),), ModalDamping(0.02)),
    "three elastic storeys, Rayleigh": Building(MASSES, SPRINGS, RayleighDamping((0.03, 0.02))),
    "three elastic storeys, modal": Building(MASSES, SPRINGS, ModalDamping((0.02, 0.03, 0.04))),
    "three storeys, the second yields": Building(
        MASSES, (SPRINGS[0], BoucWen(1.8e7, 0.008, 0.05, 0.7, 0.3, 1.5), SPRINGS[2]), RayleighDamping((0.03, 0.02))
    ),
}
MOTIONS: Final = ("CHY101-N", "MUL009", "synthetic")

# The stated tolerances are 0.5 % (peak) and 1 % (history). A parameter that is 2 % off often moves less than that, so
# less is held: what OpenSees' own steps leave. Newmark errs with their square, the BoucWen material with the step.
ELASTIC: Final = Difference(physical(0.01, "%"), physical(0.02, "%"))
YIELDING: Final = Difference(physical(0.1, "%"), physical(0.1, "%"))
# CR is KR-alpha with rho_inf = 1: in an elastic structure the same recursion, written differently.
SAME_RECURSION: Final = Difference(physical(1e-9, "relative"), physical(1e-9, "relative"))

# (stepping, whether a storey yields). CR elastic: so coarse that it is far from the truth, as a test below shows.
WAYS: Final = {
    ("continuous", False): Way(1024.0, 4, ELASTIC),
    ("continuous", True): Way(1024.0, 8, YIELDING),
    ("cr", False): Way(64.0, 1, SAME_RECURSION),
    ("cr", True): Way(8192.0, 1, YIELDING),
}


@cache
def ground_motion(name: str) -> GroundMotion:
    return synthetic_ground_motion(seed=1) if name == "synthetic" else record(name)


def way_of(name: str, stepping: Stepping) -> Way:
    return WAYS[stepping, any(not isinstance(law, Spring) for law in BUILDINGS[name].storeys)]


def rthstrack_history(building: Building, stepping: Stepping, way: Way, motion: GroundMotion) -> tuple[Floats, Floats]:
    """Displacements (n_samples, n_dof) and the force of the specimen: the first storey, without delay, gain 1."""
    stiffnesses = [law.stiffness_n_per_m or 0.0 for law in building.storeys]
    test = VirtualTest(
        Structure.shear_building(building.masses_kg, stiffnesses, building.damping),
        (Actuator((building.storeys[0],)),),
        tuple(Element(law, dof=i + 1, from_dof=i) for i, law in enumerate(building.storeys) if i > 0),
        stepping=stepping,
        rate_hz=way.rate_hz,
    )
    run = simulate(test, motion)
    return run.displacement, run.force


def opensees_material(tag: int, law: Spring | BoucWen | BaberWen) -> None:
    if isinstance(law, Spring):
        ops.uniaxialMaterial("Elastic", tag, law.stiffness_n_per_m)
        return
    # There z is a length, z_o = x_y z, and z_o' = x' (Ao - |z_o|^n (gamma_o + beta_o sgn(x' z_o)) nu) / eta_o.
    # So gamma_o is beta of Eq 13 over x_y^q, and beta_o is its gamma over x_y^q. nu = 1 + deltaNu e_o and
    # eta_o = 1 + deltaEta e_o grow with the energy in joules, e_o = integral of (1 - alpha) k z_o dx = k x_y^2 e.
    x_y, q = law.yield_displacement_m, law.exponent
    joules = (law.stiffness_n_per_m or 0.0) * x_y**2
    strength, stiffness = (law.strength_degradation, law.stiffness_degradation) if isinstance(law, BaberWen) else (0, 0)
    ops.uniaxialMaterial(
        "BoucWen",
        tag,
        law.post_yield_ratio,
        law.stiffness_n_per_m,
        q,
        law.beta / x_y**q,
        law.gamma / x_y**q,
        1.0,  # Ao
        0.0,  # deltaA
        strength / joules,
        stiffness / joules,
        1e-14,  # tolerance of its iteration, m
        50,
    )


def opensees_damping(damping: ModalDamping | RayleighDamping, n_modes: int) -> None:
    omega = np.sqrt(ops.eigen("-fullGenLapack", n_modes))
    if isinstance(damping, ModalDamping):
        ops.modalDamping(*np.broadcast_to(damping.ratios, n_modes).tolist())
    else:
        w = omega[[mode - 1 for mode in damping.modes]]
        mass, stiffness = np.linalg.solve(np.column_stack((0.5 / w, 0.5 * w)), damping.ratios)
        ops.rayleigh(mass, 0.0, stiffness, 0.0)


def opensees_history(building: Building, stepping: Stepping, way: Way, motion: GroundMotion) -> tuple[Floats, Floats]:
    """The same from OpenSees: Newmark's average acceleration in fine steps, or KRAlphaExplicit with rho_inf = 1."""
    rate_hz, n_steps, _ = way
    n = len(building.masses_kg)
    n_samples = round(motion.duration_s * rate_hz) + 1
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(0, 0.0)
    ops.fix(0, 1)
    for i, (mass, law) in enumerate(zip(building.masses_kg, building.storeys, strict=True), 1):
        ops.node(i, 0.0)
        ops.mass(i, mass)
        opensees_material(i, law)
        ops.element("zeroLength", i, i - 1, i, "-mat", i, "-dir", 1, "-doRayleigh", 1)
    opensees_damping(building.damping, n)

    x, force = np.zeros((n_samples, n)), np.zeros(n_samples)
    first, values, path_hz = 1, motion.acceleration_m_s2, motion.rate_hz
    if stepping == "cr":
        # Its first acceleration is zero, not the ground's: with nothing to damp that, begin one sample early, at rest.
        first, path_hz = 0, rate_hz
        grid = np.arange(n_samples) / rate_hz
        at = np.arange(len(values)) / motion.rate_hz
        values = np.concatenate(([0.0], np.interp(grid, at, values, right=0.0)))
    # Linear between its values and zero past the last.
    ops.timeSeries("Path", 1, "-dt", 1 / path_hz, "-values", *values.tolist())
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    if stepping == "cr":
        ops.integrator("KRAlphaExplicit", 1.0, "-updateElemDisp")
        ops.algorithm("Linear")
    else:
        ops.integrator("Newmark", 0.5, 0.25)
        ops.test("NormDispIncr", 1e-13, 20)
        ops.algorithm("Newton")
    ops.analysis("Transient")
    for sample in range(first, n_samples):
        assert ops.analyze(n_steps, 1 / (n_steps * rate_hz)) == 0, f"OpenSees gave up at sample {sample}"
        x[sample] = [ops.nodeDisp(i, 1) for i in range(1, n + 1)]
        force[sample] = ops.eleResponse(1, "material", 1, "stress")[0]
    ops.wipe()
    return x, force


@cache
def expected(name: str, stepping: Stepping, motion: str) -> tuple[Floats, Floats]:
    return opensees_history(BUILDINGS[name], stepping, way_of(name, stepping), ground_motion(motion))


def difference(found: Floats, expected: Floats) -> Difference:
    """The largest over the degrees of freedom: of the peaks, and at any instant, over OpenSees' peak."""
    found, expected = (np.reshape(signal, (len(signal), -1)) for signal in (found, expected))
    peak = np.abs(expected).max(axis=0)
    of_peaks = np.abs(np.abs(found).max(axis=0) - peak) / peak
    return Difference(float(of_peaks.max()), float((np.abs(found - expected).max(axis=0) / peak).max()))


def differences(building: Building, name: str, stepping: Stepping, motion: str) -> list[Difference]:
    """Of displacement and force between this building here and the one of that name in OpenSees."""
    found = rthstrack_history(building, stepping, way_of(name, stepping), ground_motion(motion))
    return [difference(*pair) for pair in zip(found, expected(name, stepping, motion), strict=True)]


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("stepping", ["continuous", "cr"])
@pytest.mark.parametrize("name", BUILDINGS)
def test_a_structure_without_delay_moves_as_in_opensees(
    name: str, stepping: Stepping, motion: str, row: Callable[..., None]
) -> None:
    way = way_of(name, stepping)
    found = differences(BUILDINGS[name], name, stepping, motion)
    row(name, f"{stepping}, {way.rate_hz:g} Hz", motion, *(f"{100 * value:.2g}" for d in found for value in d))
    for of in found:
        assert of.peak <= way.tolerance.peak
        assert of.history <= way.tolerance.history


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", ["three elastic storeys, Rayleigh", "three elastic storeys, modal"])
def test_the_coarse_steps_of_cr_are_far_from_the_continuous_solution(name: str, motion: str) -> None:
    cr, continuous = way_of(name, "cr"), way_of(name, "continuous")
    coarse = rthstrack_history(BUILDINGS[name], "cr", cr, ground_motion(motion))[0]
    exact = rthstrack_history(BUILDINGS[name], "continuous", continuous, ground_motion(motion))[0]
    exact = exact[:: round(continuous.rate_hz / cr.rate_hz)]
    n = min(len(coarse), len(exact))
    assert difference(coarse[:n], exact[:n]).history > physical(5, "%")


def off_by_two_per_cent(building: Building) -> dict[str, Building]:
    """One parameter at a time."""
    masses, storeys, damping = building
    wrong = {"damping": building._replace(damping=replace(damping, ratios=tuple(1.02 * np.atleast_1d(damping.ratios))))}
    for i in range(len(masses)):
        mass = tuple(1.02 * m if j == i else m for j, m in enumerate(masses))
        wrong[f"mass {i + 1}"] = building._replace(masses_kg=mass)
        for field in storeys[i].__dataclass_fields__:
            law = replace(storeys[i], **{field: 1.02 * getattr(storeys[i], field)})
            wrong[f"{field} {i + 1}"] = building._replace(storeys=(*storeys[:i], law, *storeys[i + 1 :]))
    return wrong


@pytest.mark.parametrize(
    ("name", "parameter"),
    [(name, parameter) for name in BUILDINGS for parameter in off_by_two_per_cent(BUILDINGS[name])],
)
@pytest.mark.parametrize("stepping", ["continuous", "cr"])
def test_a_parameter_that_is_two_per_cent_off_is_seen(name: str, parameter: str, stepping: Stepping) -> None:
    wrong = off_by_two_per_cent(BUILDINGS[name])[parameter]
    displacement, _ = differences(wrong, name, stepping, "synthetic")
    assert displacement.history > way_of(name, stepping).tolerance.history
