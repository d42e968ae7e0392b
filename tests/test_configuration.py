"""Configurations of virtual tests: what a file says is what is tested, and every mistake in it is told at once."""

from __future__ import annotations

import copy
import json
import pickle
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rthstrack.errors import ConfigurationError, SettingError
from rthstrack.virtual_test import (
    Actuator,
    BaberWen,
    BoucWen,
    Converter,
    Dashpot,
    DelayHistory,
    Element,
    FirstOrder,
    InverseCompensation,
    KelvinVoigt,
    Maxwell,
    PolynomialExtrapolation,
    ServoHydraulic,
    Spring,
    TransferFunction,
    VirtualTest,
)
from rthstrack.virtual_test.configuration import configuration_from, read_configuration, to_table, virtual_test_from
from tolerances import round_off

PLAIN = """
[structure]
frequency_hz = 5.0
damping_ratio = 0.02
mass_kg = 1000.0
[[actuator]]
specimen = { law = "spring" }
gain = 1.1
delay_s = 0.001
[ground_motion]
synthetic = { seed = 1, duration_s = 10.0 }
"""

EVERYTHING = """
[test]
stepping = "cr"
rate_hz = 2048
tolerance = 1e-7
duration_s = 12.5
seed = 7
bound_m = 0.4

[structure]
storey_masses_kg = [2000, 1500.0]
storey_stiffnesses_n_per_m = [4.0e6, 3.0e6]
damping_ratios = [0.02, 0.03]

[[element]]
law = "bouc_wen"
dof = 2
from_dof = 1
stiffness_n_per_m = 1.0e6
yield_displacement_m = 0.02
post_yield_ratio = 0.1
beta = 0.6
gamma = 0.4
exponent = 1.5

[[element]]
law = "maxwell"
stiffness_n_per_m = 1.0e5
damping_n_s_per_m = 2.0e3
part_of_structure = false

[[actuator]]
dof = 1
delay_s = { time_s = [0.0, 5.0], delay_s = [0.001, 0.002] }
dynamics = { kind = "first_order", alpha = 2.5 }
compensation = { kind = "inverse", alpha = 3.5 }
command_converter = { limit = 0.5, quantum = 1e-6 }
displacement_sensor = { noise_density = 1e-14 }
force_sensor = { noise_density = 1e-4, limit = 1e5, quantum = 0.5 }
force_delay_samples = 1
[[actuator.specimen]]
law = "baber_wen"
stiffness_n_per_m = 1.0e6
strength_degradation = 0.01
stiffness_degradation = 0.02
[[actuator.specimen]]
law = "dashpot"
damping_n_s_per_m = 300.0

[[actuator]]
dof = 2
from_dof = 1
gain = 0.9
specimen_mass_kg = 20.0
part_of_structure = false
specimen = { law = "kelvin_voigt", stiffness_n_per_m = 5.0e5, damping_n_s_per_m = 100.0 }
dynamics = { kind = "transfer_function", numerator = [100.0], denominator = [1.0, 100.0] }
compensation = { kind = "extrapolation", order = 2, delay_s = 0.01 }

[[actuator]]
dof = 2
specimen = { law = "spring", stiffness_n_per_m = 2.0e5 }
specimen_mass_kg = 30.0
part_of_structure = false
dynamics = { kind = "servo_hydraulic", gain = 1.0 }

[ground_motion]
synthetic = { seed = 2, duration_s = 10.0 }
peak_m_s2 = 1.0
"""


def read(text: str) -> tuple[VirtualTest, dict[str, Any], float | None]:
    return configuration_from(tomllib.loads(text))


def mistakes(text: str) -> dict[str, str]:
    """Messages by key; every key may be complained of once only."""
    with pytest.raises(ConfigurationError) as caught:
        read(text)
    found = caught.value.mistakes
    assert len({key for key, _ in found}) == len(found), found
    return dict(found)


def assert_same(one: VirtualTest, other: VirtualTest) -> None:
    for name in ("actuators", "elements", "stepping", "rate_hz", "tolerance", "bound_m", "seed"):
        assert getattr(one, name) == getattr(other, name)
    for name in ("mass_kg", "damping_n_s_per_m", "stiffness_n_per_m", "influence"):
        np.testing.assert_array_equal(getattr(one.structure, name), getattr(other.structure, name))


def test_a_plain_configuration_is_what_it_says_and_the_rest_are_the_defaults() -> None:
    test, motion, duration_s = read(PLAIN)
    assert test.actuators == (Actuator((Spring(),), gain=1.1, delay_s=0.001),)
    assert (test.elements, test.stepping, test.rate_hz, test.seed) == ((), "continuous", 1024.0, 0)
    stiffness = 1000 * (2 * np.pi * 5) ** 2
    assert test.structure.mass_kg == pytest.approx(np.array([[1000.0]]))
    assert test.structure.stiffness_n_per_m == pytest.approx(np.array([[stiffness]]), rel=round_off(4, 1))
    damping = 2 * 0.02 * np.sqrt(stiffness * 1000)
    assert test.structure.damping_n_s_per_m == pytest.approx(np.array([[damping]]), rel=round_off(4, 1))
    assert motion == {"synthetic": {"seed": 1, "duration_s": 10.0}}
    assert duration_s is None


def test_every_key_reaches_the_field_of_its_name() -> None:
    test, motion, duration_s = read(EVERYTHING)
    assert (test.stepping, test.rate_hz, test.tolerance, test.seed, test.bound_m) == ("cr", 2048.0, 1e-7, 7, 0.4)
    assert duration_s == 12.5
    assert motion["peak_m_s2"] == 1.0
    assert test.elements == (
        Element(BoucWen(1.0e6, 0.02, 0.1, 0.6, 0.4, 1.5), dof=2, from_dof=1),
        Element(Maxwell(1.0e5, 2.0e3), part_of_structure=False),
    )
    assert test.actuators == (
        Actuator(
            (BaberWen(1.0e6, strength_degradation=0.01, stiffness_degradation=0.02), Dashpot(300.0)),
            delay_s=DelayHistory((0.0, 5.0), (0.001, 0.002)),
            dynamics=FirstOrder(2.5),
            compensation=InverseCompensation(3.5),
            command_converter=Converter(limit=0.5, quantum=1e-6),
            displacement_sensor=Converter(1e-14),
            force_sensor=Converter(1e-4, 1e5, 0.5),
            force_delay_samples=1,
        ),
        Actuator(
            (KelvinVoigt(5.0e5, 100.0),),
            dof=2,
            from_dof=1,
            specimen_mass_kg=20.0,
            part_of_structure=False,
            gain=0.9,
            dynamics=TransferFunction((100.0,), (1.0, 100.0)),
            compensation=PolynomialExtrapolation(2, 0.01),
        ),
        Actuator(
            (Spring(2.0e5),),
            dof=2,
            specimen_mass_kg=30.0,
            part_of_structure=False,
            dynamics=ServoHydraulic(gain=1.0),
        ),
    )
    np.testing.assert_array_equal(test.structure.mass_kg, np.diag([2000.0, 1500.0]))
    np.testing.assert_array_equal(test.structure.stiffness_n_per_m, [[7.0e6, -3.0e6], [-3.0e6, 3.0e6]])


@pytest.mark.parametrize(
    ("damping", "expected"),
    [
        # M = 2 I: modes 1 and 3 rad/s of K = [[10, -8], [-8, 10]]; C = M Phi diag(2 zeta w / m_n) Phi^T M.
        ("damping_ratio = 0.1", [[0.8, -0.4], [-0.4, 0.8]]),
        ("damping_ratios = [0.1, 0.2]", [[1.4, -1.0], [-1.0, 1.4]]),
        # a / (2 w) + b w / 2 = 0.1 at 1 and 3 rad/s: a = 0.15, b = 0.05.
        ("rayleigh = { ratios = [0.1, 0.1] }", [[0.8, -0.4], [-0.4, 0.8]]),
        ("rayleigh = { ratios = [0.1, 0.2], modes = [1, 2] }", [[1.4, -1.0], [-1.0, 1.4]]),
        ("damping_n_s_per_m = [[3, 1], [1, 2]]", [[3.0, 1.0], [1.0, 2.0]]),
    ],
)
def test_damping_is_told_in_four_ways(damping: str, expected: list[list[float]]) -> None:
    structure = f"[structure]\nmass_kg = [[2, 0], [0, 2]]\nstiffness_n_per_m = [[10, -8], [-8, 10]]\n{damping}\n"
    table = tomllib.loads(structure + PLAIN[PLAIN.index("[[actuator]]") :])
    table["actuator"][0] |= {"part_of_structure": False, "specimen": {"law": "spring", "stiffness_n_per_m": 1.0}}
    test = configuration_from(table).test
    np.testing.assert_allclose(test.structure.damping_n_s_per_m, expected, rtol=0, atol=round_off(100, 2))


def test_the_influence_of_the_ground_motion_may_be_given_with_matrices() -> None:
    structure = "[structure]\nmass_kg = [[2, 0], [0, 2]]\nstiffness_n_per_m = [[10, 0], [0, 10]]\ndamping_ratio = 0\n"
    test = read(structure + "influence = [1, 0]\n" + PLAIN[PLAIN.index("[[actuator]]") :])[0]
    np.testing.assert_array_equal(test.structure.influence, [1.0, 0.0])


@pytest.mark.parametrize("text", [PLAIN, EVERYTHING], ids=["plain", "everything"])
def test_the_table_of_a_test_is_read_back_as_the_same_test(text: str) -> None:
    test, motion, duration_s = read(text)
    written = json.dumps(to_table(test, motion, duration_s), allow_nan=False)
    again = configuration_from(json.loads(written))
    assert_same(test, again.test)
    assert (again.motion, again.duration_s) == (motion, duration_s)
    assert_same(test, virtual_test_from(json.loads(written)))


def test_the_table_tells_the_defaults_too_so_that_a_later_version_reads_the_same_test() -> None:
    table = to_table(read(PLAIN)[0], {}, None)
    assert table["test"]["tolerance"] == 1e-6
    assert table["actuator"][0]["force_delay_samples"] == 0


@pytest.mark.parametrize("name", ["paper_linear", "paper_boucwen", "laboratory", "benchmark", "three_storeys"])
def test_every_example_is_read_without_a_complaint(root: Path, name: str) -> None:
    path = root / "examples" / f"{name}.toml"
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    # The paper's records are in an extra that need not be installed.
    table["ground_motion"] = {"synthetic": {"seed": 1}}
    test = configuration_from(table).test
    assert_same(test, virtual_test_from(json.loads(json.dumps(to_table(test, {}, None)))))


# Mistakes -------------------------------------------------------------------------------------------------------------

MANY = """
[test]
steping = "cr"
rate_hz = "fast"
duration_s = -1
seed = 1.5

[structure]
frequency_hz = true
damping_ratio = -0.02
influence = [1]

[[element]]
law = "bouc-wen"

[[element]]
law = "bouc_wen"
yield_displacement = 0.1
beta = nan
exponent = 1000.0

[[actuator]]
delay_s = "5 ms"
specimen = { law = "kelvin_voigt", stiffness_n_per_m = "stiff", damping_n_s_per_m = -1.0 }
gain = 0.0

[[actuator]]
dof = -1
specimen = { law = "bouc_wen", stiffness_n_per_m = 1.0, yield_displacement_m = -0.01 }
dynamics = { kind = "first_order" }

[ground_motion]
recrod = "CHY101-N"

[plot]
"""


def test_a_wrong_file_yields_one_report_of_all_that_is_wrong_with_it(tmp_path: Path) -> None:
    path = tmp_path / "many.toml"
    path.write_text(MANY, encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        read_configuration(path)
    found = dict(caught.value.mistakes)
    assert list(found) == [key for key, _ in caught.value.mistakes]
    assert set(found) == {
        "plot",
        "test.steping",
        "test.rate_hz",
        "test.duration_s",
        "test.seed",
        "structure.frequency_hz",
        "structure.damping_ratio",
        "structure.influence",
        "element[1].law",
        "element[2].yield_displacement",
        "element[2].beta",
        "element[2].exponent",
        "actuator[1].delay_s",
        "actuator[1].specimen.stiffness_n_per_m",
        "actuator[1].specimen.damping_n_s_per_m",
        "actuator[1].gain",
        "actuator[2].dof",
        "actuator[2].specimen.yield_displacement_m",
        "actuator[2].dynamics.alpha",
        "actuator[2].dynamics",
        "ground_motion.recrod",
        "ground_motion",
    }
    lines = str(caught.value).splitlines()
    assert len(lines) == len(found)
    assert all(line.startswith(f"{path}: ") for line in lines)
    expected = "actuator[2].specimen.yield_displacement_m: expected a positive number, found -0.01"
    assert f"{path}: {expected}" in lines


def test_mistakes_come_in_the_order_of_the_sections() -> None:
    sections = [key.split(".")[0].split("[")[0] for key in mistakes(MANY)]
    order = ["plot", "test", "structure", "element", "actuator", "ground_motion"]
    assert sections == sorted(sections, key=order.index)


def changed(path: str, value: object) -> str:
    """The plain configuration as TOML with one value changed, by its dotted key; None removes it."""
    table = tomllib.loads(PLAIN)
    *way, last = path.split(".")
    place: Any = table
    for step in way:
        place = place[int(step)] if isinstance(place, list) else place.setdefault(step, {})
    if value is None:
        del place[last]
    else:
        place[last] = value
    return json.dumps(table)


@pytest.mark.parametrize(
    ("path", "value", "key", "said"),
    [
        ("structure.mass_kg", -1000.0, "structure.mass_kg", "expected a positive number, found -1000"),
        ("structure.frequency_hz", 0, "structure.frequency_hz", "expected a positive number, found 0"),
        ("structure.damping_ratio", None, "structure.damping_ratio", "missing: expected a finite number"),
        ("structure.dampingratio", 0.1, "structure.dampingratio", "no such key (did you mean 'damping_ratio'?)"),
        ("structure.rayleigh", {"ratios": [0.1, 0.1]}, "structure.rayleigh", "does not go with frequency_hz"),
        ("structure", {}, "structure", "expected one of frequency_hz; storey_masses_kg with"),
        ("structure.storey_masses_kg", [1.0], "structure", "found frequency_hz and storey_masses_kg with"),
        ("structure", 5, "structure", "expected a table, found 5"),
        ("structure", None, "structure", "missing: expected a table"),
        ("test.rate_hz", 0, "test.rate_hz", "expected a positive number, found 0"),
        ("test.rate_hz", True, "test.rate_hz", "expected a finite number, found true"),
        ("test.rate_hz", 10**400, "test.rate_hz", "expected a finite number, found a number of too many digits"),
        ("test.stepping", "CR", "test.stepping", "expected one of 'continuous', 'cr', found 'CR'"),
        ("test.duration_s", 0, "test.duration_s", "expected a positive number of seconds, found 0"),
        ("test.duration_s", float("nan"), "test.duration_s", "expected a finite number, found nan"),
        ("test.tolerance", 0, "test.tolerance", "expected a number from 1e-12 to 0.1, found 0"),
        ("test.bound_m", -1, "test.bound_m", "expected a positive number, found -1"),
        ("test.seed", -1, "test.seed", "expected a whole number from 0 on, found -1"),
        ("test", [], "test", "expected a table, found []"),
        ("actuator", None, "actuator", "expected at least one"),
        ("actuator", {"dof": 1}, "actuator", "expected an array of tables, [[actuator]], found a table"),
        ("actuator.0.dof", 2, "actuator[1].dof", "expected a degree of freedom from 1 to 1, found 2"),
        ("actuator.0.from_dof", 1, "actuator[1].from_dof", "expected another one"),
        ("actuator.0.specimen", None, "actuator[1].specimen", "missing: expected a table"),
        ("actuator.0.specimen", [], "actuator[1].specimen", "expected at least one restoring force, found none"),
        ("actuator.0.specimen", {}, "actuator[1].specimen.law", "missing: expected one of 'spring', 'dashpot'"),
        ("actuator.0.specimen.law", "sprig", "actuator[1].specimen.law", "(did you mean 'spring'?)"),
        ("actuator.0.delay_s", -0.001, "actuator[1].delay_s", "expected a number of at least 0, found -0.001"),
        ("actuator.0.delay_s", {"time_s": [0, 1]}, "actuator[1].delay_s.delay_s", "missing: expected a list"),
        ("actuator.0.delay_s", {"time_s": [0, 1], "delay_s": [0]}, "actuator[1].delay_s", "found 2 and 1"),
        ("actuator.0.delay_s", {"time_s": [0, 1], "delay_s": [0, 2]}, "actuator[1].delay_s.delay_s", "faster growth"),
        ("actuator.0.gain", 0, "actuator[1].gain", "other than 0, found 0"),
        ("actuator.0.dynamics", {"kind": "second_order"}, "actuator[1].dynamics.kind", "did you mean 'first_order'?"),
        ("actuator.0.dynamics", {"kind": "first_order", "alpha": 29.0}, "actuator[1].dynamics", "test.stepping"),
        (
            "actuator.0.dynamics",
            {"kind": "transfer_function", "numerator": [1, 2, 3], "denominator": [1, 2]},
            "actuator[1].dynamics.numerator",
            "found 3",
        ),
        (
            "actuator.0.dynamics",
            {"kind": "transfer_function", "numerator": [1], "denominator": [1, -2]},
            "actuator[1].dynamics.denominator",
            "expected poles left of the imaginary axis",
        ),
        ("actuator.0.displacement_sensor", {"limit": 0}, "actuator[1].displacement_sensor.limit", "found 0"),
        ("actuator.0.displacement_sensor", {"noise": 0}, "actuator[1].displacement_sensor.noise", "'noise_density'"),
        ("ground_motion", None, "ground_motion", "missing: expected a table"),
        ("ground_motion.synthetic.seed", "a", "ground_motion.synthetic.seed", "expected a whole number"),
    ],
)  # fmt: skip
def test_each_mistake_is_told_once_with_its_key_and_what_was_expected(
    path: str, value: object, key: str, said: str
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        configuration_from(json.loads(changed(path, value)))
    assert [k for k, _ in caught.value.mistakes] == [key]
    assert said in caught.value.mistakes[0][1]


def test_the_times_of_a_delay_that_varies_must_rise() -> None:
    text = PLAIN.replace("delay_s = 0.001", "delay_s = { time_s = [1, 0], delay_s = [0, 0] }")
    assert "times that rise" in mistakes(text)["actuator[1].delay_s.time_s"]


def test_a_compensation_of_less_than_one_sample_and_a_first_order_one_need_cr() -> None:
    table = json.loads(changed("test.stepping", "cr"))
    table["actuator"][0] |= {
        "dynamics": {"kind": "first_order", "alpha": 0.5},
        "compensation": {"kind": "inverse", "alpha": 0.9},
    }
    with pytest.raises(ConfigurationError) as caught:
        configuration_from(table)
    assert {key for key, _ in caught.value.mistakes} == {"actuator[1].dynamics.alpha", "actuator[1].compensation.alpha"}


@pytest.mark.parametrize(
    ("structure", "key", "said"),
    [
        ("mass_kg = [[1, 0], [0, 1]]\nstiffness_n_per_m = [[1, 2], [2, 1]]", "structure.stiffness_n_per_m", "indefin"),
        ("mass_kg = [[1, 0], [0, -1]]\nstiffness_n_per_m = [[2, 0], [0, 2]]", "structure.mass_kg", "positive definite"),
        ("mass_kg = [[1, 0], [0, 1]]\nstiffness_n_per_m = [[2, 1], [0, 2]]", "structure.stiffness_n_per_m", "symmet"),
        ("mass_kg = [[1, 0], [0]]\nstiffness_n_per_m = [[2, 0], [0, 2]]", "structure.mass_kg", "a square matrix"),
        ("mass_kg = [[1]]\nstiffness_n_per_m = [[2, 0], [0, 2]]", "structure.stiffness_n_per_m", "found 4"),
        ("mass_kg = 3\nstiffness_n_per_m = [[2]]", "structure.mass_kg", "a square matrix"),
        ("storey_masses_kg = [1, 1]\nstorey_stiffnesses_n_per_m = [1]", "structure.storey_stiffnesses_n_per_m", "(2)"),
        ("storey_masses_kg = [1]\nstorey_stiffnesses_n_per_m = [0]", "structure.storey_stiffnesses_n_per_m", "found 0"),
        ("storey_masses_kg = [1]", "structure.storey_stiffnesses_n_per_m", "missing"),
    ],
)  # fmt: skip
def test_a_structure_that_cannot_be_is_told_alone(structure: str, key: str, said: str) -> None:
    actuator = PLAIN[PLAIN.index("[[actuator]]") :]
    found = mistakes(f"[structure]\n{structure}\ndamping_ratio = 0.02\n{actuator}")
    assert list(found) == [key]
    assert said in found[key]


def test_what_depends_on_a_value_that_is_wrong_is_not_complained_of_too() -> None:
    yields = '{ law = "bouc_wen" }\ndof = 3\nfrom_dof = 1\ndynamics = { kind = "first_order", alpha = 29.0 }'
    text = '[test]\nstepping = "CR"\n' + PLAIN.replace('{ law = "spring" }', yields)
    storeys = "storey_masses_kg = [1, 1, 1]\nstorey_stiffnesses_n_per_m = [1, 1]"
    assert set(mistakes(text.replace("frequency_hz = 5.0", storeys).replace("mass_kg = 1000.0", ""))) == {
        "test.stepping",
        "structure.storey_stiffnesses_n_per_m",
    }
    # Of the structure it is known that it would have three degrees of freedom.
    text = text.replace("dof = 3", "dof = 4").replace("frequency_hz = 5.0", storeys).replace("mass_kg = 1000.0", "")
    assert "from 1 to 3, found 4" in mistakes(text)["actuator[1].dof"]
    # Of this one nothing is.
    assert set(mistakes(text.replace(storeys, ""))) == {"test.stepping", "structure"}


def test_damping_is_told_in_one_way_only() -> None:
    storeys = "[structure]\nstorey_masses_kg = [1]\nstorey_stiffnesses_n_per_m = [1]\n"
    actuator = PLAIN[PLAIN.index("[[actuator]]") :]
    both = mistakes(storeys + "damping_ratio = 0.1\nrayleigh = { ratios = [0.1, 0.1] }\n" + actuator)
    assert both == {
        "structure.damping_ratio": "expected one of damping_ratio, damping_ratios, rayleigh, damping_n_s_per_m: found "
        "damping_ratio and rayleigh"
    }
    assert "damping_ratio = 0 is no damping" in mistakes(storeys + actuator)["structure.damping_ratio"]


def test_a_specimen_stiffer_than_the_structure_that_it_is_part_of_is_a_mistake() -> None:
    text = PLAIN.replace('law = "spring"', 'law = "spring", stiffness_n_per_m = 1.0e9')
    assert "part_of_structure = false" in mistakes(text)["structure.stiffness_n_per_m"]


def test_several_laws_of_one_specimen_are_told_apart_by_their_number() -> None:
    text = PLAIN.replace(
        '{ law = "spring" }', '[{ law = "spring" }, { law = "dashpot", damping_n_s_per_m = "much" }, { law = "x" }]'
    )
    assert set(mistakes(text)) == {
        "actuator[1].specimen[2].damping_n_s_per_m",
        "actuator[1].specimen[3].law",
    }


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"[structure\n", "expected TOML: Expected ']' at the end of a table declaration (at line 1, column 11)"),
        (b"[test]\nrate_hz = 1\nrate_hz = 2\n", "expected TOML: Cannot overwrite a value (at line 3"),
        (b'[test]\nname = "\xff"\n', "expected TOML in UTF-8, found byte 15 to be no text"),
        (b"x = " + b"[" * 5000 + b"]" * 5000, "expected TOML, found it nested too deeply"),
        (b"x = " + b"9" * 5000, "expected TOML: "),
        (b"", "structure: missing: expected a table"),
    ],
    ids=["syntax", "twice", "no text", "deep", "long", "empty"],
)
def test_a_file_that_is_no_configuration_is_told_by_its_name(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "broken.toml"
    path.write_bytes(content)
    with pytest.raises(ConfigurationError) as caught:
        read_configuration(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert said in str(caught.value)


def test_a_file_that_is_not_there_is_a_setting_error(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"none\.toml: cannot be read: No such file or directory"):
        read_configuration(tmp_path / "none.toml")


def test_the_error_survives_being_handed_between_processes() -> None:
    error = ConfigurationError("a.toml", [("test.rate_hz", "expected more"), ("", "and less")])
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.mistakes) == (str(error), error.mistakes)
    assert str(error) == "a.toml: test.rate_hz: expected more\na.toml: and less"


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4) | st.sampled_from(["spring", "cr"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["law", "kind", "alpha"]), inner),
    max_leaves=6,
)


@settings(max_examples=400)
@given(st.data())
def test_whatever_stands_in_a_file_it_is_read_or_told(data: st.DataObject) -> None:
    table: Any = copy.deepcopy(tomllib.loads(EVERYTHING))
    for _ in range(data.draw(st.integers(1, 3))):
        place = table
        while True:
            key = data.draw(st.sampled_from(list(place) if isinstance(place, dict) else list(range(len(place)))))
            if not (isinstance(place[key], dict | list) and place[key]) or data.draw(st.booleans()):
                break
            place = place[key]
        place[key] = data.draw(ANYTHING)
    told = None
    try:
        configuration_from(table, file="any.toml")
    except ConfigurationError as error:
        told = error
    if told is not None:
        assert told.mistakes
        assert all(message for _, message in told.mistakes)
        assert len(str(told).splitlines()) == len(told.mistakes)
