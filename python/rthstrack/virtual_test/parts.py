"""Virtual tests: part of a structure computed, part a specimen moved by an actuator that lags, in one simulation.

    M x'' + C x' + K x + sum of restoring forces = -M i a_g        (relative to the ground; SI units)

`VirtualTest` says what is tested, `simulate` runs it under a ground motion, `critical_delay` says which delay it bears.
Without a structure (`Structure.none()`) the actuators alone follow a target that is given.
Degrees of freedom are numbered from 1; 0 is the ground. delay > 0: measured lags.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import numpy as np

from rthstrack._core import check_test as core_check_test
from rthstrack._core import from_matrices as core_from_matrices
from rthstrack._core import sdof as core_sdof
from rthstrack._core import shear_building as core_shear_building
from rthstrack.errors import ConfigurationError, SettingError
from rthstrack.values import Value

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import ArrayLike, NDArray

    from rthstrack._core import _Matrices as Matrices

    Floats = NDArray[np.float64]


class Mistake(NamedTuple):
    """One thing wrong with a configuration: `key` says where, as `actuator[1].delay_s`, numbered from 1."""

    key: str
    message: str


# Restoring forces -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Spring:
    """r = k x. `stiffness_n_per_m` None: all the stiffness that the structure has at this place."""

    stiffness_n_per_m: float | None = None


@dataclass(frozen=True, slots=True)
class Dashpot:
    """r = c x'."""

    damping_n_s_per_m: float


@dataclass(frozen=True, slots=True)
class KelvinVoigt:
    """r = k x + c x'."""

    stiffness_n_per_m: float | None = None
    damping_n_s_per_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Maxwell:
    """r' = k x' - r k / c: spring and dashpot in series."""

    stiffness_n_per_m: float
    damping_n_s_per_m: float


@dataclass(frozen=True, slots=True)
class BoucWen:
    """Eq 13: r = eta k x + (1 - eta) k x_y z,  x_y z' = x' - gamma |x'| z |z|^(q-1) - beta x' |z|^q."""

    stiffness_n_per_m: float | None = None
    yield_displacement_m: float = 0.01
    post_yield_ratio: float = 0.01
    beta: float = 0.55
    gamma: float = 0.45
    exponent: float = 2.0


@dataclass(frozen=True, slots=True)
class BaberWen:
    """Bouc-Wen that degrades with the energy it has dissipated (Baber and Wen 1981).

    x_y z' = (x' - nu (gamma |x'| z |z|^(q-1) + beta x' |z|^q)) / mu,  nu = 1 + strength_degradation e,
    mu = 1 + stiffness_degradation e,  e' = (1 - eta) z x' / x_y.
    """

    stiffness_n_per_m: float | None = None
    yield_displacement_m: float = 0.01
    post_yield_ratio: float = 0.01
    beta: float = 0.55
    gamma: float = 0.45
    exponent: float = 2.0
    strength_degradation: float = 0.0
    stiffness_degradation: float = 0.0


Law = Spring | Dashpot | KelvinVoigt | Maxwell | BoucWen | BaberWen


# Damping and structure ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ModalDamping:
    """C = M Phi diag(2 zeta omega / m_n) Phi^T M; `ratios` one for all modes, or one a mode."""

    ratios: float | tuple[float, ...]


@dataclass(frozen=True, slots=True)
class RayleighDamping:
    """C = a M + b K with the damping ratios `ratios` in the two modes `modes` (numbered from 1)."""

    ratios: tuple[float, float]
    modes: tuple[int, int] = (1, 2)


@dataclass(frozen=True, slots=True, eq=False)
class Structure(Value):
    """The whole structure, elastic: mass, damping, stiffness (n, n), `influence` (n,) of the ground motion.

    What a specimen or a restoring element with `part_of_structure` brings is subtracted from it by the virtual test.
    Made by `sdof`, `shear_building`, `from_matrices` or, for actuators alone, `none`; `description` is the
    configuration's table that makes it anew.
    """

    mass_kg: NDArray[np.float64]
    damping_n_s_per_m: NDArray[np.float64]
    stiffness_n_per_m: NDArray[np.float64]
    influence: NDArray[np.float64]
    natural_frequencies_hz: NDArray[np.float64]
    description: dict[str, object] = field(repr=False)

    @classmethod
    def none(cls) -> Structure:
        """No structure, of no degrees of freedom: what a test of actuators alone has."""
        nothing = np.zeros((0, 0))
        empty: Matrices = {
            "mass_kg": nothing,
            "damping_n_s_per_m": nothing,
            "stiffness_n_per_m": nothing,
            "natural_frequencies_hz": np.zeros(0),
        }
        return cls._built((empty, []), np.zeros(0), {})

    @property
    def n_dof(self) -> int:
        """Degrees of freedom; 0 is no structure."""
        return len(self.mass_kg)

    @classmethod
    def sdof(cls, frequency_hz: float, damping_ratio: float, mass_kg: float = 1000.0) -> Structure:
        """One degree of freedom: k = m (2 pi f)^2, c = 2 zeta m (2 pi f). Raises ConfigurationError."""
        found = core_sdof(float(frequency_hz), float(damping_ratio), float(mass_kg))
        table: dict[str, object] = {"frequency_hz": frequency_hz, "damping_ratio": damping_ratio, "mass_kg": mass_kg}
        return cls._built(found, np.ones(1), table)

    @classmethod
    def shear_building(
        cls,
        storey_masses_kg: Sequence[float],
        storey_stiffnesses_n_per_m: Sequence[float],
        damping: ModalDamping | RayleighDamping,
    ) -> Structure:
        """Storeys from the ground up: the mass of each floor, the stiffness below it. Raises ConfigurationError."""
        masses = [float(m) for m in storey_masses_kg]
        stiffnesses = [float(k) for k in storey_stiffnesses_n_per_m]
        table = {"storey_masses_kg": masses, "storey_stiffnesses_n_per_m": stiffnesses, **_damping_table(damping)}
        return cls._built(core_shear_building(masses, stiffnesses, damping), np.ones(len(masses)), table)

    @classmethod
    def from_matrices(
        cls,
        mass_kg: ArrayLike,
        stiffness_n_per_m: ArrayLike,
        damping: ArrayLike | ModalDamping | RayleighDamping,
        influence: ArrayLike | None = None,
    ) -> Structure:
        """Any symmetric M (positive definite), K and C (n, n); `influence` (n,) is 1 if not given.

        Raises ConfigurationError with all that is wrong.
        """
        mass, stiffness = _matrix(mass_kg), _matrix(stiffness_n_per_m)
        damped = damping if isinstance(damping, ModalDamping | RayleighDamping) else _matrix(damping)
        row = np.ones(len(mass)) if influence is None else np.array(influence, dtype=np.float64, ndmin=1)
        table: dict[str, object] = {"mass_kg": mass.tolist(), "stiffness_n_per_m": stiffness.tolist()}
        table |= {"damping_n_s_per_m": damped.tolist()} if isinstance(damped, np.ndarray) else _damping_table(damped)
        if influence is not None:
            table["influence"] = row.tolist()
        return cls._built(core_from_matrices(mass, stiffness, damped, row.tolist()), row, table)

    @classmethod
    def _built(
        cls,
        found: tuple[Matrices | None, list[tuple[str, str]]],
        influence: Floats,
        table: dict[str, object],
    ) -> Structure:
        matrices, mistakes = found
        if matrices is None:
            raise ConfigurationError("", mistakes)
        arrays: dict[str, Any] = {**matrices, "influence": influence}
        for array in arrays.values():
            array.flags.writeable = False
        return cls(**arrays, description=table)


@dataclass(frozen=True, slots=True)
class Element:
    """A restoring force of the numerical substructure, between `dof` and `from_dof`."""

    law: Law
    dof: int = 1
    from_dof: int = 0
    part_of_structure: bool = True


# Actuator, compensation, converters -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class DelayHistory:
    """A delay that varies: linear between the points, constant outside them."""

    time_s: tuple[float, ...]
    delay_s: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class FirstOrder:
    """z / (alpha z - (alpha - 1)): the command reached in about alpha samples (`cr` stepping only)."""

    alpha: float


@dataclass(frozen=True, slots=True)
class TransferFunction:
    """Measured over command, coefficients of falling powers of s."""

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ServoHydraulic:
    """The benchmark problem's servo-valve and actuator, coupled with the specimen that it moves.

    valve a1b0 / (s^2 + b1 s + b2) of the error g u - x; force f' = valve - a3 f - a2 x'; m x'' + r(x, x') = f.
    """

    gain: float = 1.0261
    a1b0: float = 2.1283e13
    a2: float = 4.2297e6
    a3: float = 3.3
    b1: float = 425.0
    b2: float = 9.9976e4


class Compensator:
    """What makes the command of the target (`cr` stepping only): a class for each of the core's, with its numbers."""

    __slots__ = ()
    #: What the core and configurations call it.
    kind: ClassVar[str]
    #: Every class by its kind.
    known: ClassVar[dict[str, type[Compensator]]] = {}

    def __init_subclass__(cls) -> None:
        # Twice for a dataclass with slots: the last is the one that remains.
        Compensator.known[cls.kind] = cls


@dataclass(frozen=True, slots=True)
class InverseCompensation(Compensator):
    """u_n = alpha I_n - (alpha - 1) I_(n-1) (Chen and Ricles)."""

    kind: ClassVar[str] = "inverse"
    alpha: float


@dataclass(frozen=True, slots=True)
class PolynomialExtrapolation(Compensator):
    """The polynomial through order + 1 past targets, `delay_s` apart, read `delay_s` ahead (Horiuchi et al. 1999)."""

    kind: ClassVar[str] = "extrapolation"
    order: Literal[1, 2, 3]
    delay_s: float


@dataclass(frozen=True, slots=True)
class Converter:
    """A channel's way between computer and rig: white noise of this two-sided density, then limit, then quantum.

    Units are the channel's own: m for displacements, N for forces. Standard deviation of the noise: sqrt(density rate).
    """

    noise_density: float = 0.0
    limit: float = math.inf
    quantum: float = 0.0


@dataclass(frozen=True, slots=True)
class Actuator:
    """One actuator and the specimen that it moves: target is x_dof - x_from_dof.

    Measured follows gain * command(t - delay), passed on through `dynamics` where there are any. `specimen` are laws
    side by side. `part_of_structure`: what they bring (mass, elastic stiffness, damping) is taken out of the structure.
    Without a structure there may be no specimen, and nothing may be said of what speaks of the structure.
    """

    specimen: tuple[Law, ...] = ()
    dof: int = 1
    from_dof: int = 0
    specimen_mass_kg: float = 0.0
    part_of_structure: bool = True
    gain: float = 1.0
    delay_s: float | DelayHistory = 0.0
    dynamics: FirstOrder | TransferFunction | ServoHydraulic | None = None
    compensation: Compensator | None = None
    command_converter: Converter = Converter()
    displacement_sensor: Converter = Converter()
    force_sensor: Converter = Converter()
    force_delay_samples: int = 0


@dataclass(frozen=True, slots=True)
class VirtualTest:
    """Everything that is tested but the ground motion or target. `stepping`: `continuous` or `cr`.

    `structure` is `Structure.none()` where the actuators alone are tested; all of them then follow the same target.
    """

    structure: Structure
    actuators: tuple[Actuator, ...]
    elements: tuple[Element, ...] = ()
    stepping: Literal["continuous", "cr"] = "continuous"
    rate_hz: float = 1024.0
    tolerance: float = 1e-6
    bound_m: float | None = None
    seed: int = 0

    def check(self) -> tuple[Mistake, ...]:
        """Everything that is wrong with it, each with its key: `actuator[1].delay_s`, numbered from 1."""
        # The core counts without a sign and knows two names: it is asked about the rest.
        mistakes = [*self._miscounted(), *self._unstructured()]
        told = {m.key.rpartition(".")[0] for m in mistakes if m.key.endswith("dof")}
        if self.stepping not in ("continuous", "cr"):
            mistakes.append(Mistake("test.stepping", f"expected 'continuous' or 'cr', found {self.stepping!r}"))
        for key, message in core_check_test(self._counted() if mistakes else self):
            if not (key.endswith("dof") and key.rpartition(".")[0] in told) and key not in {m.key for m in mistakes}:
                mistakes.append(Mistake(key, message))
        for i, actuator in enumerate(self.actuators, 1):
            for name in CONVERTERS:
                density, key = getattr(actuator, name).noise_density, f"actuator[{i}].{name}.noise_density"
                if not 0 <= density <= 1e30:
                    mistakes.append(Mistake(key, f"expected a number from 0 to 1e30, found {density}"))
                elif density and self.stepping == "continuous" and name != "displacement_sensor":
                    what = "expected 0 with test.stepping = 'continuous', whose loop is not sampled"
                    mistakes.append(Mistake(key, f"{what}, found {density}"))
        if self.seed < 0:
            mistakes.append(Mistake("test.seed", f"expected a whole number of at least 0, found {self.seed}"))
        return tuple(mistakes)

    def _counted(self) -> VirtualTest:
        """The same, counts below their least put there and taking nothing out; in CR steps if they have no name."""

        def placed(item: Element | Actuator) -> dict[str, Any]:
            part = item.part_of_structure and item.dof >= 0 and item.from_dof >= 0
            return {"dof": max(item.dof, 1), "from_dof": max(item.from_dof, 0), "part_of_structure": part}

        actuators = []
        for actuator in self.actuators:
            late = max(actuator.force_delay_samples, 0)
            actuators.append(replace(actuator, force_delay_samples=late, **placed(actuator)))
        stepping = self.stepping if self.stepping in ("continuous", "cr") else "cr"
        elements = tuple(replace(element, **placed(element)) for element in self.elements)
        return replace(self, elements=elements, actuators=tuple(actuators), stepping=stepping)

    def _unstructured(self) -> Iterator[Mistake]:
        """Without a structure: what speaks of one."""
        if self.structure.n_dof:
            return
        for i, actuator in enumerate(self.actuators, 1):
            for name in OF_STRUCTURE:
                found, usual = getattr(actuator, name), _DEFAULTS[name]
                # What is below 0 has been told.
                if found != usual and (isinstance(found, bool) or found >= 0):
                    yield Mistake(
                        f"actuator[{i}].{name}",
                        f"speaks of a structure, and there is none: leave it out, found {found}",
                    )
            for j, law in enumerate(actuator.specimen, 1):
                if getattr(law, "stiffness_n_per_m", 0.0) is None:
                    place = "specimen" if len(actuator.specimen) == 1 else f"specimen[{j}]"
                    yield Mistake(
                        f"actuator[{i}].{place}.stiffness_n_per_m",
                        "missing: expected a number, for there is no structure whose stiffness could be meant",
                    )

    def _miscounted(self) -> Iterator[Mistake]:
        for what, items in (("element", self.elements), ("actuator", self.actuators)):
            for i, item in enumerate(items, 1):
                for name in ("dof", "from_dof", "force_delay_samples"):
                    found = getattr(item, name, 0)
                    if found < 0:
                        yield Mistake(f"{what}[{i}].{name}", f"expected a whole number of at least 0, found {found}")


#: What an actuator says of its place in the structure.
OF_STRUCTURE = ("dof", "from_dof", "part_of_structure", "force_delay_samples")
_DEFAULTS = {one.name: one.default for one in fields(Actuator)}
CONVERTERS = ("command_converter", "displacement_sensor", "force_sensor")


def _matrix(values: ArrayLike) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64, ndmin=2, order="C")
    if array.ndim != 2 or array.shape[0] != array.shape[1]:
        raise SettingError(f"structure: expected a square matrix, found the shape {np.shape(values)}")
    return array


def _damping_table(damping: ModalDamping | RayleighDamping) -> dict[str, object]:
    if isinstance(damping, RayleighDamping):
        return {"rayleigh": {"ratios": list(damping.ratios), "modes": list(damping.modes)}}
    if isinstance(damping.ratios, tuple | list):
        return {"damping_ratios": list(damping.ratios)}
    return {"damping_ratio": damping.ratios}
