"""Every spelling of a unit is understood in every place that asks for one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from rthstrack import propose_pair, read_recording
from rthstrack.errors import ChannelError
from rthstrack.ground_motion import read_ground_motion
from rthstrack.recording.recording import Channel, Recording
from rthstrack.units import length_factor, quantity, seconds_in, split_unit
from rthstrack.verdict import display
from rthstrack.virtual_test.target_motion import read_target

if TYPE_CHECKING:
    from pathlib import Path

LENGTHS = {
    1.0: "m meter meters metre metres",
    1e-2: "cm centimeter centimeters centimetre centimetres",
    1e-3: "mm millimeter millimeters millimetre millimetres MM [mm] (mm)",
    1e-6: "um µm μm micron microns",
    0.0254: "in inch inches in.",
    0.3048: "ft foot feet",
}
SECONDS = {
    1.0: "s sec secs second seconds sec. S",
    1e-3: "ms msec millisecond milliseconds",
    1e-6: "us µs μs usec",
    1e-9: "ns",
    60.0: "min minutes",
    3600.0: "h hours",
}
ACCELERATIONS = {
    1.0: "m/s2 m/s^2 m/s² m/s**2 m/s/s m/sec/sec meters/sec2 [m/s2]",
    1e-2: "gal gals cm/s2 cm/sec^2 CM/SEC/SEC",
    1e-3: "mm/s2 mm/s^2 mm/sec/sec",
    0.0254: "in/s2 in/sec^2 inches/sec2",
    0.3048: "ft/s2 ft/sec/sec feet/s^2",
    9.80665: "g G gn",
}
FORCES = "N kN MN lbf lb lbs kip kips kgf"
VELOCITIES = "m/s mm/s cm/sec in/s inches/sec ft/s feet/sec mps"
CURRENTS = "V mV kV A mA"


def each(spellings: dict[float, str]) -> list[tuple[str, float]]:
    return [(one, size) for size, row in spellings.items() for one in row.split()]


def with_units_row(path: Path, units: list[str]) -> Recording:
    rows = "\n".join(",".join(str(value) for value in (f"{i / 100:g}", i % 7, i % 5, i % 3)) for i in range(20))
    path.write_text(f"Time,Target,Measured,Force\n{','.join(units)}\n{rows}\n", encoding="utf-8")
    return read_recording(path)


@pytest.mark.parametrize(("unit", "size"), each(LENGTHS))
def test_a_length_is_one_wherever_it_is_asked(tmp_path: Path, unit: str, size: float) -> None:
    recording = with_units_row(tmp_path / "a.csv", ["sec", unit, unit, "kN"])
    assert [c.name for c in recording.channels] == ["Time", "Target", "Measured", "Force"]
    assert [c.unit for c in recording.channels] == ["sec", unit, unit, "kN"]
    assert recording.rate_hz == 100
    assert length_factor(unit, "m") == pytest.approx(size, rel=1e-15)
    assert display.quantity(unit) == "Displacement"
    assert proposed(unit) == "displacement"
    motion = read_target(tmp_path / "a.csv", channel="Target")
    assert motion.displacement_m.max() == pytest.approx(6 * size, rel=1e-15)


def test_a_length_behind_a_name_is_its_unit() -> None:
    for unit, _ in each(LENGTHS):
        if unit[0] not in "[(":
            assert split_unit(f"Disp ({unit})") == ("Disp", unit)


@pytest.mark.parametrize(("unit", "size"), each(SECONDS))
def test_a_time_is_one_wherever_it_is_asked(tmp_path: Path, unit: str, size: float) -> None:
    assert seconds_in(unit) == size
    recording = with_units_row(tmp_path / "a.csv", [unit, "mm", "mm", "kN"])
    assert recording["Time"].unit == unit
    assert recording.rate_hz == pytest.approx(100 / size, rel=1e-12)
    stated = tmp_path / "stated.csv"
    stated.write_text(f"Sample interval: 0.5 {unit}\na,b\n" + "1.5,2\n3,4\n2,8\n", encoding="utf-8")
    assert read_recording(stated).rate_hz == pytest.approx(2 / size, rel=1e-12)


@pytest.mark.parametrize(("unit", "size"), each(ACCELERATIONS))
def test_an_acceleration_is_one_wherever_it_is_asked(tmp_path: Path, unit: str, size: float) -> None:
    assert proposed(unit) == "acceleration"
    assert with_units_row(tmp_path / "a.csv", ["s", unit, "mm", "kN"])["Target"].unit == unit
    motion = read_ground_motion(tmp_path / "a.csv", channel="Target")
    assert motion.peak_m_s2 == pytest.approx(6 * size, rel=1e-15)


@pytest.mark.parametrize(
    ("units", "kind"), [(FORCES, "force"), (VELOCITIES, "velocity"), (CURRENTS, "voltage"), ("s ms min", None)]
)
def test_what_a_unit_measures_tells_what_a_channel_is(tmp_path: Path, units: str, kind: str | None) -> None:
    for unit in units.split():
        assert proposed(unit) == kind
        assert with_units_row(tmp_path / "a.csv", ["s", "mm", "mm", unit])["Force"].unit == unit


def proposed(unit: str) -> str | None:
    """By which partner a channel of this unit finds, among one of each kind: what it is taken for."""
    kinds = {"displacement": "m", "force": "N", "acceleration": "g", "velocity": "m/s", "voltage": "V"}
    # Volts beside a displacement may be a pair, too: of unlike units.
    kinds = {"voltage": "V"} if unit in CURRENTS.split() else kinds
    rng = np.random.default_rng(1)
    for kind, one in kinds.items():
        units = {"alpha_target": unit, "alpha_measured": one}
        channels = tuple(Channel(name, name, told, rng.standard_normal(50)) for name, told in units.items())
        try:
            propose_pair(Recording("file", "text", channels, 100.0, "given", 0.0, ()))
        except ChannelError:
            continue
        return kind
    return None


def test_a_row_of_names_is_not_a_row_of_units(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("one,two,three\nt,v,a\n0.0,1.5,2\n0.1,2.5,3\n0.2,1.5,4\n", encoding="utf-8")
    assert [c.name for c in read_recording(path).channels] == ["t", "v", "a"]


def test_what_is_no_unit_measures_nothing() -> None:
    assert [quantity(one) for one in (None, "", "furlongs", "a1", "5 mm")] == [None] * 5
