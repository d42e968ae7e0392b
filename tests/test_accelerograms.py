"""Records of strong-motion networks: every value, rate and unit as their headers state them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from rthstrack.errors import RecordingError
from rthstrack.ground_motion import read_ground_motion
from rthstrack.recording import read_recording

if TYPE_CHECKING:
    from pathlib import Path

VALUES = [round(-100.0 + 0.37 * i - 0.001 * i * i, 5) for i in range(43)]


def fixed(values: list[float], form: str, n: int) -> str:
    return "".join("".join(format(v, form) for v in values[i : i + n]) + "\n" for i in range(0, len(values), n))


def esm(values: list[float] = VALUES) -> str:
    head = (
        "EVENT_NAME: here\nSAMPLING_INTERVAL_S: 0.005000\n"
        f"NDATA: {len(values)}\nUNITS: cm/s^2\nDATA_TYPE: ACCELERATION\nUSER1:\n"
    )
    return head + "".join(f"{v:.5f}\n" for v in values)


def cosmos(step: str = "5.0", values: list[float] = VALUES) -> str:
    reals = [-999.0] * 100
    reals[33] = float(step)
    head = "Corrected acceleration   (Format v01.20 with 13 text lines)\n" + "text\n" * 12
    head += "  100 Real-header values follow on  20 lines, Format= (5F15.6)\n" + fixed(reals, "15.6f", 5)
    body = (
        f"   {len(values)} acceleration pts, approx {len(values) / 200} secs, units=cm/sec2(04),Format=(8F10.5)\n"
        + fixed(values, "10.5f", 8)
    )
    return head + '   1 Comment line(s) follow, each starting with a "|":\n|\n' + body + "End-of-data for chan 1\n"


def csmip(values: list[float] = VALUES) -> str:
    head = "CORRECTED ACCELEROGRAM  somewhere\n" + "text\n" * 20
    line = f"   {len(values)} points of accel data equally spaced at  .005 sec, in cm/sec2. (8f10.3)\n"
    return head + line + fixed(values, "10.3f", 8)


def smc(values: list[float] = VALUES) -> str:
    integers = [0] * 48
    integers[15], integers[16] = 2, len(values)
    reals = [1.7e38] * 50
    reals[1] = 200.0
    head = "2 CORRECTED ACCELEROGRAM\n" + "*\n" * 10 + fixed([float(i) for i in integers], "10.0f", 8)
    return head + fixed(reals, "15.7E", 5) + "| one\n| two\n" + fixed(values, "10.3E", 8)


def knet(values: list[float] = VALUES) -> str:
    head = "Origin Time       2011/03/11 14:46:00\nStation Code      XXX001\nSampling Freq(Hz) 200Hz\n"
    counts = fixed([float(round(1000 * v)) for v in values], "9.0f", 8)
    return head + "Scale Factor      2000(gal)/2000000\nMax. Acc. (gal)   100\nMemo.\n" + counts


@pytest.mark.parametrize(
    ("text", "form", "tolerance"),
    [
        (esm(), "ESM", 0.0),
        (cosmos(), "V2", 0.0),
        (cosmos("0.005"), "V2", 0.0),
        (csmip(), "V2", 5e-4),
        (smc(), "SMC", 0.05),
        (knet(), "K-NET", 5e-4),
    ],
)
def test_a_record_of_a_network_is_read_whole(tmp_path: Path, text: str, form: str, tolerance: float) -> None:
    path = tmp_path / "record.asc"
    path.write_text(text)
    recording = read_recording(path)
    assert (recording.format, recording.rate_hz) == (f"{form} accelerogram", 200.0)
    assert np.abs(recording["acceleration"].values - VALUES).max() <= tolerance + 1e-12
    motion = read_ground_motion(path)
    assert np.abs(100 * motion.acceleration_m_s2 - VALUES).max() <= tolerance + 1e-9
    # Cut off anywhere, or with a word among the numbers, it is refused in one line.
    lines = text.splitlines()
    for cut in (len(lines) - 2, len(lines) // 2, 2):
        path.write_text("\n".join(lines[:cut]))
        try:
            shorter = read_recording(path)
        except RecordingError as error:
            assert "\n" not in str(error)  # noqa: PT017
        else:
            assert form in ("K-NET", "text") or shorter.format == "text"


def at2(values: list[float], sizes: str) -> str:
    return f"PEER\nhere\nACCELERATION TIME SERIES IN UNITS OF G\n{sizes}\n" + fixed(values, "15.6E", 5)


@pytest.mark.parametrize("sizes", ["DT=  .0050 SEC, NPTS=  43", "DT= .005, NPTS= 43", "NPTS= 43, DT= .0050 SEC"])
def test_at2_states_step_and_number_in_either_order(tmp_path: Path, sizes: str) -> None:
    path = tmp_path / "record.AT2"
    path.write_text(at2(VALUES, sizes))
    recording = read_recording(path)
    assert (recording.rate_hz, len(recording["acceleration"].values)) == (200.0, 43)


def test_of_several_accelerations_the_first_is_read_and_it_is_said(tmp_path: Path) -> None:
    path = tmp_path / "record.v2"
    path.write_text(cosmos() + cosmos(values=[2 * v for v in VALUES]))
    recording = read_recording(path)
    assert list(recording["acceleration"].values) == VALUES
    assert recording.notes[0] == "the file holds 2 accelerations: the first was read"
    assert "the first was read" in " ".join(read_ground_motion(path).notes)
    path.write_text(cosmos())
    assert "the first was read" not in " ".join(read_recording(path).notes)


def test_records_that_cannot_be_are_refused_where_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    for value, code in ((0.0, "all_zero"), (412.0, "implausible_peak")):
        path.write_text("time (s),acc (g)\n" + "".join(f"{i / 100},{value * (i % 2)}\n" for i in range(50)))
        with pytest.raises(RecordingError) as caught:
            read_ground_motion(path)
        assert caught.value.code == code
    path.write_text("time (s),acc (g)\n" + "".join(f"{i / 100},{i % 2}\n" for i in range(50)))
    assert read_ground_motion(path).rate_hz == 100.0
