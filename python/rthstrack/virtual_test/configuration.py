"""Configurations: a virtual test and its ground motion or target as a TOML file, and back as a run file's table."""

from __future__ import annotations

import dataclasses
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rthstrack.errors import ConfigurationError, RthstrackError
from rthstrack.ground_motion.table import check_ground_motion, ground_motion_from
from rthstrack.keyed_table import NUMBER, NUMBERS, SQUARE, Table, read_toml
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
    KelvinVoigt,
    Maxwell,
    ModalDamping,
    RayleighDamping,
    ServoHydraulic,
    Spring,
    Structure,
    TransferFunction,
    VirtualTest,
)
from rthstrack.virtual_test.target_motion import check_target, target_from

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping

    from rthstrack.ground_motion.motion import GroundMotion
    from rthstrack.virtual_test.target_motion import TargetMotion

__all__ = ["Configuration", "configuration_from", "read_configuration", "to_table", "virtual_test_from"]

_LAWS: dict[str, type] = {
    "spring": Spring,
    "dashpot": Dashpot,
    "kelvin_voigt": KelvinVoigt,
    "maxwell": Maxwell,
    "bouc_wen": BoucWen,
    "baber_wen": BaberWen,
}
_DYNAMICS: dict[str, type] = {
    "first_order": FirstOrder,
    "transfer_function": TransferFunction,
    "servo_hydraulic": ServoHydraulic,
}
# How a table says which class it is.
_TAGS = {cls: ("law" if known is _LAWS else "kind", name)
         for known in (_LAWS, _DYNAMICS, Compensator.known) for name, cls in known.items()}  # fmt: skip
_TEST = ("stepping", "rate_hz", "tolerance", "bound_m", "seed")
_CONVERTERS = ("command_converter", "displacement_sensor", "force_sensor")
# A number of a degree of freedom beyond this one is a mistake of its own.
_MOST_STAND_IN = 100
_SECTIONS = ("", "test", "structure", "element", "actuator", "ground_motion", "target")
_FORMS = {
    "frequency_hz": ("frequency_hz", "mass_kg", "damping_ratio"),
    "storey_masses_kg with storey_stiffnesses_n_per_m": (
        "storey_masses_kg",
        "storey_stiffnesses_n_per_m",
        "damping_ratio",
        "damping_ratios",
        "rayleigh",
    ),
    "the matrices mass_kg with stiffness_n_per_m": (
        "mass_kg",
        "stiffness_n_per_m",
        "damping_ratio",
        "damping_ratios",
        "rayleigh",
        "damping_n_s_per_m",
        "influence",
    ),
}


class Configuration(NamedTuple):
    """What a configuration says: the test, the table of its ground motion, the duration (None: the motion's own).

    Where the actuators are alone (`test.structure.n_dof` 0), `motion` is the table of their target.
    """

    test: VirtualTest
    motion: dict[str, Any]
    duration_s: float | None

    def motion_from(self, base_dir: str | os.PathLike[str]) -> GroundMotion | TargetMotion:
        """The ground motion or target, its file looked for in `base_dir`; raises what reading it raises."""
        try:
            return (ground_motion_from if self.test.structure.n_dof else target_from)(self.motion, base_dir)
        except RthstrackError as error:
            # The advice speaks of keys of the configuration, which no command calls otherwise.
            words, error.advice = error.words, ""
            raise error.reworded(words) from None


def read_configuration(path: str | os.PathLike[str]) -> Configuration:
    """Reads and checks a TOML file. Raises ConfigurationError with every mistake in it, each with its key."""
    file = Path(path)
    table = read_toml(file)
    return configuration_from(table, file.parent, file)


def configuration_from(
    table: Mapping[str, Any], base_dir: str | os.PathLike[str] | None = None, file: str | os.PathLike[str] = ""
) -> Configuration:
    """Checks a table as `tomllib` or `json` give it; files that it names are looked for in `base_dir`, if given.

    Raises ConfigurationError with every mistake, `file` before each.
    """
    root = Table(table, "", [])
    parts = _parts(root)
    motion = root.table("target" if parts.alone else "ground_motion", required=True)
    if motion is not None and parts.alone:
        rate_hz = parts.settings["rate_hz"]
        root.mistakes += check_target(motion.values, base_dir, rate_hz if rate_hz > 0 else None)
    elif motion is not None:
        root.mistakes += check_ground_motion(motion.values, base_dir)
    if "target" in root.values and not parts.alone:
        beside = [f"[{name}]" for name in ("structure", "ground_motion") if name in root.values]
        root.note("target", f"is for actuators alone: expected nothing beside it, found {' and '.join(beside)}")
    root.close(("target", "ground_motion"))
    test = _checked(parts, root, file)
    return Configuration(test, dict(motion.values) if motion else {}, parts.duration_s)


def virtual_test_from(table: Mapping[str, Any], file: str | os.PathLike[str] = "") -> VirtualTest:
    """The test alone, whatever the table says of the ground motion or target. Raises ConfigurationError as above."""
    root = Table(table, "", [])
    parts = _parts(root)
    root.close(("target", "ground_motion"))
    return _checked(parts, root, file)


def read_virtual_test(path: str | os.PathLike[str]) -> VirtualTest:
    """The test alone of a TOML file, whatever it says of the ground motion or target. Raises ConfigurationError."""
    return virtual_test_from(read_toml(Path(path)), path)


def to_table(test: VirtualTest, motion: Mapping[str, Any], duration_s: float | None) -> dict[str, Any]:
    """The table that `configuration_from` reads as the same test, with every value written out; fit for JSON.

    motion: the table of its ground motion, or of its target where the actuators are alone.
    """
    table: dict[str, Any] = _plain(
        {
            "test": {name: getattr(test, name) for name in _TEST} | {"duration_s": duration_s},
            "structure": test.structure.description,
            "element": test.elements,
            "actuator": test.actuators,
            "ground_motion" if test.structure.n_dof else "target": dict(motion),
        }
    )
    if not test.structure.n_dof:
        del table["structure"], table["element"]
        for actuator in table["actuator"]:
            for name in OF_STRUCTURE:
                del actuator[name]
    return table


def _plain(value: Any) -> Any:
    """Numbers, texts, lists and tables only; what is None or infinite (no limit) is left out."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if dataclasses.is_dataclass(value):
        tag = (_TAGS[type(value)],) if type(value) in _TAGS else ()
        value = dict(tag) | {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        if dataclasses.is_dataclass(value.get("law")):
            value |= _plain(value["law"])
    if isinstance(value, dict):
        told = {key: _plain(one) for key, one in value.items() if one is not None}
        return {key: one for key, one in told.items() if not (isinstance(one, float) and math.isinf(one))}
    return value


@dataclass(frozen=True, slots=True)
class _Parts:
    """A test as far as it could be read; `n_dof` is known where the structure's size is, whatever else is wrong.

    `alone`: there is to be no structure.
    """

    alone: bool
    structure: Structure | None
    n_dof: int | None
    elements: tuple[Element, ...]
    actuators: tuple[Actuator, ...]
    settings: dict[str, Any]
    duration_s: float | None


def _parts(root: Table) -> _Parts:
    about = root.table("test") or Table({}, "test", root.mistakes)
    settings = about.fields(VirtualTest, *_TEST)
    duration_s = about.take("duration_s", NUMBER, None)
    if duration_s is not None and duration_s <= 0:
        about.note("duration_s", f"expected a positive number of seconds, found {duration_s:g}")
    if any(key == "test.stepping" for key, _ in about.mistakes):
        # It forbids least.
        settings["stepping"] = "cr"
    about.close()
    # Beside a structure a target is a mistake, and the rest is checked as if it were not there.
    alone = "target" in root.values and not {"structure", "ground_motion"} & set(root.values)
    structure: Structure | None = Structure.none()
    n_dof: int | None = 0
    if alone:
        if "element" in root.values:
            root.known.append("element")
            root.note("element", "is a part of the structure, and there is none beside [target]")
        elements: tuple[Element, ...] = ()
    else:
        table = root.table("structure", required=True)
        structure, n_dof = (None, None) if table is None else _structure(table)
        elements = tuple(_element(one) for one in root.tables("element"))
    actuators = tuple(_actuator(one, alone) for one in root.tables("actuator"))
    return _Parts(alone, structure, n_dof, elements, actuators, settings, duration_s)


def _structure(table: Table) -> tuple[Structure | None, int | None]:
    """The structure, None where it cannot be made, and how many degrees of freedom it has or would have."""
    values = table.values
    single, storeys, matrices = _FORMS
    found = [single] * ("frequency_hz" in values)
    found += [storeys] * any(name.startswith("storey_") for name in values)
    found += [matrices] * ("stiffness_n_per_m" in values or (not found and "mass_kg" in values))
    every = list(dict.fromkeys(name for names in _FORMS.values() for name in names))
    if len(found) != 1:
        told = f"found {' and '.join(found)}" if found else "found none of them"
        table.mistakes.append((table.key, f"expected one of {'; '.join(_FORMS)}: {told}"))
        table.close(every)
        return None, None
    for name in values:
        if name in every and name not in _FORMS[found[0]]:
            table.note(name, f"does not go with {found[0]}")
            table.known.append(name)
    table.close(_FORMS[found[0]])
    n_mistakes = len(table.mistakes)
    first, second = _FORMS[found[0]][:2]
    make: Callable[..., Structure]
    given: tuple[Any, ...]
    if found[0] == single:
        make, n_dof = Structure.sdof, 1
        given = (table.take(first, NUMBER, stand_in=1.0), table.take("damping_ratio", NUMBER, stand_in=0.0))
        given += (table.take(second, NUMBER, 1000.0),)
    else:
        kind = NUMBERS if found[0] == storeys else SQUARE
        both = table.take(first, kind), table.take(second, kind)
        damping = _damping(table)
        influence = table.take("influence", NUMBERS, None) if found[0] == matrices else None
        n_dof = next((len(one) for one in both if one is not None), 0)
        if not n_dof:
            return None, None
        stand_in = (1.0,) * n_dof if found[0] == storeys else np.eye(n_dof)
        make = Structure.shear_building if found[0] == storeys else Structure.from_matrices
        given = (*(stand_in if one is None else one for one in both), damping)
        given += () if found[0] == storeys else (influence,)
    noted = {key for key, _ in table.mistakes}
    try:
        structure = make(*given)
    except ConfigurationError as error:
        table.mistakes += [one for one in error.mistakes if one[0] not in noted]
    return (structure if len(table.mistakes) == n_mistakes else None), n_dof


def _damping(table: Table) -> Any:
    """ModalDamping, RayleighDamping or a matrix, whichever one the table names; no damping where it is wrong."""
    names = ("damping_ratio", "damping_ratios", "rayleigh", "damping_n_s_per_m")
    found = [name for name in names if name in table.values]
    if len(found) != 1:
        told = f"found {' and '.join(found)}" if found else "found none (damping_ratio = 0 is no damping)"
        table.note("damping_ratio", f"expected one of {', '.join(names)}: {told}")
    elif found[0] == "rayleigh":
        rayleigh = table.table("rayleigh")
        made = rayleigh and rayleigh.made(RayleighDamping)
        if made is not None:
            return made
    elif found[0] == "damping_n_s_per_m":
        matrix = table.take(found[0], SQUARE)
        if matrix is not None:
            return matrix
    else:
        return ModalDamping(table.take(found[0], NUMBER if found[0] == "damping_ratio" else NUMBERS, stand_in=0.0))
    return ModalDamping(0.0)


def _element(table: Table) -> Element:
    places = table.fields(Element, "dof", "from_dof", "part_of_structure")
    return Element(table.one_of("law", _LAWS) or Spring(), **places)


def _actuator(table: Table, alone: bool) -> Actuator:
    """`alone`: without a structure, of which it then says nothing; nor need it have a specimen."""
    apart = ("specimen", "delay_s", "dynamics", "compensation", *_CONVERTERS, *(OF_STRUCTURE if alone else ()))
    values = table.fields(Actuator, *(f.name for f in dataclasses.fields(Actuator) if f.name not in apart))
    for name in OF_STRUCTURE if alone else ():
        if name in table.values:
            table.known.append(name)
            table.note(name, "speaks of a structure, and there is none beside [target]: leave it out")
    several = isinstance(table.values.get("specimen"), list)
    specimen = table.tables("specimen") if several else [table.table("specimen", required=not alone)]
    laws = [one.one_of("law", _LAWS) or Spring() for one in specimen if one is not None]
    if isinstance(table.values.get("delay_s"), dict):
        history = table.table("delay_s")
        values["delay_s"] = (history and history.made(DelayHistory)) or 0.0
    else:
        values["delay_s"] = table.take("delay_s", NUMBER, 0.0)
    for name, known in (("dynamics", _DYNAMICS), ("compensation", Compensator.known)):
        one = table.table(name)
        values[name] = one and one.one_of("kind", known)
    for name in _CONVERTERS:
        one = table.table(name)
        values[name] = Converter() if one is None else one.made(Converter)
    table.close()
    return Actuator(tuple(laws), **values)


# The whole ------------------------------------------------------------------------------------------------------------


def _checked(parts: _Parts, root: Table, file: str | os.PathLike[str]) -> VirtualTest:
    """The test, if neither reading nor `check` found a mistake; else ConfigurationError with all of them."""
    structure = _stand_in(parts) if parts.structure is None else parts.structure
    test = VirtualTest(structure, parts.actuators, parts.elements, **parts.settings)
    noted = {key for key, _ in root.mistakes}
    found = [(one.key, one.message) for one in test.check() if one.key not in noted]
    if noted:
        # Whether the structure holds what is taken out of it cannot be told from what stands in.
        found = [one for one in found if not one[0].startswith("structure")]
    mistakes = root.mistakes + found
    if mistakes:
        raise ConfigurationError(file, sorted(dict.fromkeys(mistakes), key=_place))
    return test


def _place(mistake: tuple[str, str]) -> tuple[int, int]:
    """Where a mistake belongs in the report: the sections in their order, numbered ones by number."""
    section, number = re.fullmatch(r"(\w*)(?:\[(\d+)\])?.*", mistake[0], re.DOTALL).groups()  # type: ignore[union-attr]
    return (_SECTIONS.index(section) if section in _SECTIONS else 0), int(number or 0)


def _stand_in(parts: _Parts) -> Structure:
    """What the rest is checked with where there is no structure: of the right size, stiffness between all places."""
    used = [max(one.dof, one.from_dof) for one in parts.elements]
    used += [max(one.dof, one.from_dof) for one in parts.actuators]
    n_dof = parts.n_dof or max(1, min(max(used, default=1), _MOST_STAND_IN))
    return Structure.from_matrices(np.eye(n_dof), 2 * n_dof * np.eye(n_dof) - 1, ModalDamping(0.0))
