"""Text files: every number has the value that Python's float gives its token, in every spelling of a file."""

from __future__ import annotations

import math
import random
import struct
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rthstrack.cli.arguments import told
from rthstrack.errors import RecordingError, SettingError
from rthstrack.recording import Recording, read_recording
from rthstrack.said import Said

if TYPE_CHECKING:
    from pathlib import Path


def read(folder: Path, content: str | bytes, name: str = "file.csv") -> Recording:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_recording(path)


def columns(recording: Recording) -> dict[str, list[float]]:
    return {channel.name: channel.values.tolist() for channel in recording.channels}


def bits(value: float) -> bytes:
    return struct.pack("<d", value)


def tokens(n: int) -> list[str]:
    """Numbers in the forms that programs print."""
    random.seed(2014)
    made = [
        "0",
        "-0",
        "-0.0",
        "5.",
        ".5",
        "+1.5",
        "1e5",
        "1E-05",
        "-.1219107E-02",
        "9007199254740993",
        "1e-400",
        "1e400",
    ]
    made += ["4.9e-324", "2.2250738585072011e-308", "1.7976931348623157e308", "0.1", "123456789012345678901234567890"]
    while len(made) < n:
        value = random.gauss(0, 1) * 10.0 ** random.randint(-30, 30)
        form = random.choice(["r", ".3f", ".6f", ".17g", ".7e", "g", ".20e"])
        made.append(repr(value) if form == "r" else f"{value:{form}}")
    return made


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "  "])
def test_every_number_has_the_bits_of_pythons_float(tmp_path: Path, delimiter: str) -> None:
    made = tokens(3000)
    rows = [made[i : i + 3] for i in range(0, 3000, 3)]
    recording = read(tmp_path, "a,b,c\n".replace(",", delimiter) + "".join(delimiter.join(r) + "\n" for r in rows))
    for column, channel in enumerate(recording.channels):
        expected = [bits(float(row[column])) for row in rows]
        assert [bits(v) for v in channel.values] == expected


@pytest.mark.parametrize("delimiter", [";", "\t", " "])
def test_decimal_commas_have_the_bits_of_the_same_number_with_a_point(tmp_path: Path, delimiter: str) -> None:
    made = [t for t in tokens(2000) if not t.endswith(".")][:1998]
    rows = [made[i : i + 2] for i in range(0, len(made), 2)]
    text = "".join(delimiter.join(row).replace(".", ",") + "\n" for row in rows)
    recording = read(tmp_path, f"a{delimiter}b\n{text}")
    assert "decimal comma" in recording.format
    for column, channel in enumerate(recording.channels):
        assert [bits(v) for v in channel.values] == [bits(float(row[column])) for row in rows]


@given(st.lists(st.floats(width=64), min_size=2, max_size=20))
def test_any_doubles_come_back_from_their_shortest_form(
    tmp_path_factory: pytest.TempPathFactory, values: list[float]
) -> None:
    folder = tmp_path_factory.mktemp("doubles")
    # A column of numbers, whatever the other holds.
    text = "n,x\n" + "".join(f"{i}.5,{value!r}\n" for i, value in enumerate(values))
    found = read(folder, text)["x"].values
    assert all(bits(a) == bits(b) or (math.isnan(a) and math.isnan(b)) for a, b in zip(found, values, strict=True))


PLAIN = {"t_s": [0.0, 0.5, 1.0], "disp": [1.25, -2.5, 3.0]}
TABLE = "t_s,disp\n0.0,1.25\n0.5,-2.5\n1.0,3\n"


@pytest.mark.parametrize(
    "content",
    [
        TABLE,
        TABLE.rstrip("\n"),
        TABLE.replace("\n", "\r\n"),
        TABLE.replace("\n", "\r"),
        b"\xef\xbb\xbf" + TABLE.encode(),
        TABLE.encode("utf-16"),
        b"\xfe\xff" + TABLE.encode("utf-16-be"),
        TABLE.encode("utf-16-le"),
        TABLE.encode("utf-16-be"),
        TABLE.replace(",", ";"),
        TABLE.replace(",", "\t"),
        TABLE.replace(",", "|"),
        TABLE.replace(",", " , "),
        TABLE.replace(",", "   "),
        TABLE.replace(",", ";").replace(".", ","),
        TABLE.replace(",", "\t").replace(".", ","),
        TABLE.replace(",", " ").replace(".", ","),
        "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in TABLE.split()),
        "\n".join(",".join(f'"{cell.replace(".", ",")}"' for cell in line.split(",")) for line in TABLE.split()),
        "# " + TABLE,
        "% made by hand\n%" + TABLE,
        "// remark\n// " + TABLE,
        '"recorded by hand, 5 runs"\n' + TABLE,
        "Test of a damper, run 5\nOperator: me\n\n" + TABLE,
        TABLE.replace("\n", ",\n"),
        TABLE.replace("1.0,3\n", "1.0,3\n,\n,\n"),
        TABLE.replace("0.5,-2.5\n", "0.5,-2.5\n\n# a remark\n"),
        TABLE + "\x1a",
        "sep=;\n" + TABLE.replace(",", ";"),
    ],
)
def test_the_same_table_comes_out_of_every_spelling(tmp_path: Path, content: str | bytes) -> None:
    assert columns(read(tmp_path, content)) == PLAIN


def test_latin_1_names_and_a_split_name_are_read(tmp_path: Path) -> None:
    recording = read(tmp_path, "Zeit (s);Kraft Prüfling (kN)\n0,0;1,5\n0,1;2,5\n".encode("latin-1"))
    assert [(c.name, c.unit) for c in recording.channels] == [("Zeit (s)", "s"), ("Kraft Prüfling (kN)", "kN")]
    assert recording.rate_hz == 10.0
    recording = read(tmp_path, '"Time\n(s)","Disp\n(mm)"\n0.0,1.5\n0.1,2.5\n')
    assert [(c.name, c.unit) for c in recording.channels] == [("Time (s)", "s"), ("Disp (mm)", "mm")]


def test_a_units_row_gives_units_and_is_not_read_as_names(tmp_path: Path) -> None:
    recording = read(tmp_path, "Time\tTarget\tForce\ns\tmm\tkN\n0.00\t1.0\t2.0\n0.01\t1.1\t2.1\n")
    assert [(c.name, c.unit) for c in recording.channels] == [("Time", "s"), ("Target", "mm"), ("Force", "kN")]
    recording = read(tmp_path, "Time,Target\n(sec),[inch]\n\n0.00,1.0\n0.01,1.1\n")
    assert [(c.name, c.unit) for c in recording.channels] == [("Time", "(sec)"), ("Target", "[inch]")]
    assert recording.rate_hz == 100.0


def test_empty_cells_and_words_for_nothing_are_nan_and_stay(tmp_path: Path) -> None:
    recording = read(tmp_path, "t,a,b\n0.0,,1\n0.1,NaN,Inf\n0.2,NA,-inf\n0.3,#N/A,4\n0.4,5,nan\n")
    assert np.isnan(recording["a"].values).tolist() == [True] * 4 + [False]
    assert recording["b"].values[:4].tolist() == [1.0, math.inf, -math.inf, 4.0]


def test_columns_without_names_are_numbered_as_they_stand_in_the_file(tmp_path: Path) -> None:
    recording = read(tmp_path, "1.5 go 2.5\n3.5 on 4.5\n")
    assert columns(recording) == {"column 0": [1.5, 3.5], "column 2": [2.5, 4.5]}
    assert recording["#1"].name == "column 2"
    assert "'column 1' holds text in 2 lines, no channel" in recording.notes


def test_integer_names_are_names(tmp_path: Path) -> None:
    assert columns(read(tmp_path, "Time,1,2\n0.0,5,6\n0.1,7,8\n")) == {
        "Time": [0.0, 0.1],
        "1": [5.0, 7.0],
        "2": [6.0, 8.0],
    }


def test_names_with_blanks_above_columns_divided_by_blanks(tmp_path: Path) -> None:
    recording = read(tmp_path, "Time (s)   Axial Disp (mm)\n 0.0   1.0\n 0.1   2.0\n")
    assert [(c.name, c.unit) for c in recording.channels] == [("Time (s)", "s"), ("Axial Disp (mm)", "mm")]


def test_a_column_of_events_may_be_missing_at_line_ends(tmp_path: Path) -> None:
    recording = read(tmp_path, "t,a,Events\n0.0,1,start\n0.1,2\n0.2,3\n0.3,4,stop\n")
    assert columns(recording) == {"t": [0.0, 0.1, 0.2, 0.3], "a": [1.0, 2.0, 3.0, 4.0]}
    assert "'Events' holds text in 2 lines, no channel" in recording.notes
    recording = read(tmp_path, "t,a,Comment\n0.0,1\n0.1,2\n")
    assert "'Comment' is empty, no channel" in recording.notes


def test_a_labview_measurement_file_is_read_below_its_headers(tmp_path: Path) -> None:
    lines = [
        "LabVIEW Measurement\t",
        "Writer_Version\t2",
        "Separator\tTab",
        "Decimal_Separator\t.",
        "X_Columns\tOne",
        "***End_of_Header***\t",
        "\t",
        "Channels\t2\t\t",
        "Samples\t3\t3\t",
        "Y_Unit_Label\tMillimeters\tNewtons",
        "X_Dimension\tTime\tTime\t",
        "X0\t0.0E+0\t0.0E+0\t",
        "Delta_X\t0.002\t0.002\t",
        "***End_of_Header***\t\t\t",
        "X_Value\tUntitled\tUntitled 1\tComment",
        "0.000000\t1.5\t2.5\tstart",
        "0.002000\t1.6\t2.6",
        "0.004000\t1.7\t2.7",
    ]
    recording = read(tmp_path, "\r\n".join(lines) + "\r\n", "file.lvm")
    assert columns(recording) == {
        "X_Value": [0.0, 0.002, 0.004],
        "Untitled": [1.5, 1.6, 1.7],
        "Untitled 1": [2.5, 2.6, 2.7],
    }
    assert (recording.rate_hz, recording.rate_source) == (500.0, "header 'Delta_X'")
    without_x = [line if i < 15 else "\t" + line.split("\t", 1)[1] for i, line in enumerate(lines)]
    recording = read(tmp_path, "\n".join(without_x).replace("X_Columns\tOne", "X_Columns\tNo"), "file.lvm")
    assert columns(recording) == {"Untitled": [1.5, 1.6, 1.7], "Untitled 1": [2.5, 2.6, 2.7]}
    assert recording.rate_hz == 500.0


def test_the_raw_export_of_a_machine_is_read_whole(shared: Path) -> None:
    path = shared / "records" / "utfsm_15Hz_0A.txt"
    recording = read_recording(path)
    lines = path.read_text().splitlines()[7:]
    assert [c.name for c in recording.channels] == ["Sample Number", "CHANNEL0", "CHANNEL1", "CHANNEL2"]
    for column, name in ((0, "Sample Number"), (2, "CHANNEL0"), (3, "CHANNEL1"), (4, "CHANNEL2")):
        assert recording[name].values.tolist() == [float(line.split(",")[column]) for line in lines]
    assert (recording.rate_hz, recording.rate_source) == (1000.0, "header 'Sampling Rate'")
    assert "'Events' holds text in 2 lines, no channel" in recording.notes


def test_the_other_text_records_are_read_whole(shared: Path) -> None:
    chirp = read_recording(shared / "records" / "utfsm_chirp_0A.csv")
    expected = np.loadtxt(shared / "records" / "utfsm_chirp_0A.csv", delimiter=",", skiprows=1)
    assert np.array_equal(np.column_stack([c.values for c in chirp.channels]), expected)
    assert (chirp.rate_hz, chirp.rate_source) == (1000.0, "time column 't_s'")
    assert [c.unit for c in chirp.channels] == ["s", "mm", "mm", "N"]
    northridge = read_recording(shared / "records" / "northridge_canoga_park.txt")
    expected = np.loadtxt(shared / "records" / "northridge_canoga_park.txt")
    assert np.array_equal(np.column_stack([c.values for c in northridge.channels]), expected)
    assert northridge.rate_hz is None


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "the file is empty"),
        (b"  \n\n \t\n", "the file is empty; expected lines of numbers"),
        (b"\xef\xbb\xbf\n", "the file is empty; expected lines of numbers"),
        (b"t,x,y\n", "no rows of numbers in 1 line(s) of text"),
        (b"Just a letter.\nWithout any table, from 5 of us.\n", "no rows of numbers in 2 line(s)"),
        (b"t,x\n0.0,1.0\n0.1,\x00\n", "byte 0x00 at offset 16; expected lines of numbers, found binary content"),
        (b"\x01\x02\x03garbage,1.0\n", "byte 0x01 at offset 0"),
        (bytes(range(256)) * 4, "not a text file"),
        (b"\xff\xfe" + "t,x\n0,1\n".encode("utf-16-le") + b"\x00\xd8" * 2, "half a character at byte offset 18"),
        (b"t,x,y\n0.0,1,2\n0.1,1\n0.2,1,2\n", "line 3: expected 3 fields, found 2 (the first one missing is 'y')"),
        (b"t,x\n0.0,1\n0.1,1,7\n0.2,1\n", "line 3: expected 2 fields, found 3 (the last column is 'x')"),
        (b"t,x\n0.0,1\n0.1,1O\n0.2,1\n", "line 3, column 'x': expected a number, found '1O'"),
        (b"t,x\n0.0,abc\n0.1,1.5\n0.2,1\n", "line 2, column 'x': expected a number, found 'abc'"),
        (b"0.0,abc,1.5\n0.1,1.5,2\n0.2,1,2\n", "line 1, column 'column 1': expected a number, found 'abc'"),
        (b"t,x,y\n0.0,1.0\n0.1,1.5,2\n0.2,1,2\n", "line 2: expected 3 fields, found 2"),
        (b"t x y\n0.0 1.0\n0.1 1.5 2\n0.2 1 2\n", "line 2: expected 3 fields, found 2 (the first one missing is 'y')"),
        (b"t,x\n0.0,1\n0.1,2\n0.2,", None),
        (b"t,x\n0,001,1\n0,002,2\n", "line 1 names 2 columns, but line 2 has 3 fields"),
        (b"t,x,y\n0.0,1\n0.1,2\n", "line 1 names 3 columns, but line 2 has 2 fields"),
        (b"t,x\n0.0,1_000\n0.1,2\n0.2,3\n0.3,5\n", "line 2, column 'x': expected a number, found '1_000'"),
        (b"t,x\n0.0," + b"9" * 500 + b"x\n0.1,2\n0.2,3\n0.3,4\n", "found '" + "9" * 40 + "...'"),
        (
            b"T,d\n05:46:08.1,1\n05:46:08.2,2\nlater,3\n05:46:08.4,3\n",
            "line 4, column 'T': expected a date or time like those in the other lines, found 'later'",
        ),
    ],
)
def test_what_is_wrong_with_a_text_is_said_in_one_line(tmp_path: Path, content: bytes, said: str | None) -> None:
    if said is None:
        # A cell that the file's end cuts off is an empty cell.
        assert math.isnan(read(tmp_path, content)["x"].values[-1])
        return
    with pytest.raises(RecordingError) as caught:
        read(tmp_path, content)
    message = str(caught.value)
    assert said in message
    assert message.startswith(str(tmp_path / "file.csv"))
    assert "\n" not in message


def test_what_is_no_row_is_left_out_and_told_with_its_line(tmp_path: Path) -> None:
    found = read(tmp_path, "t,x\n0.0,1\n0.1,2\n0.2,3\n\nMax,3\nend of test\n")
    assert columns(found) == {"t": [0.0, 0.1, 0.2], "x": [1.0, 2.0, 3.0]}
    assert [(note.code, note.values) for note in found.notes if isinstance(note, Said)] == [("left_out", (6.0, 7.0))]


def test_a_part_of_a_file_is_read_and_what_has_no_parts_says_so(tmp_path: Path) -> None:
    (tmp_path / "a.dat").write_text("t,x\n0.0,1\n0.1,2\n0.2,3\n\na,b,c\n1,2,3\n4,5,6\n")
    chosen = [read_recording(tmp_path / "a.dat", block=n, rate_hz=10) for n in (1, 2)]
    assert [[c.name for c in one.channels] for one in chosen] == [["t", "x"], ["a", "b", "c"]]
    by_lines = read_recording(tmp_path / "a.dat", lines=(3, 4), rate_hz=10)
    assert columns(by_lines) == {"t": [0.1, 0.2], "x": [2.0, 3.0]}
    with pytest.raises(RecordingError, match="expected 1 to 2"):
        read_recording(tmp_path / "a.dat", block=3)
    with pytest.raises(SettingError, match="exclude each other"):
        read_recording(tmp_path / "a.dat", block=1, lines=(1, 2))
    np.save(tmp_path / "a.npy", np.zeros((4, 2)))
    with pytest.raises(RecordingError) as caught:
        read_recording(tmp_path / "a.npy", block=1)
    assert caught.value.code == "no_parts"


def test_a_broken_row_names_the_way_out(tmp_path: Path) -> None:
    with pytest.raises(RecordingError) as caught:
        read(tmp_path, "t,x\n0.0,1\n0.1,ERR\n0.2,3\n")
    assert (caught.value.code, caught.value.values) == ("broken_row", (3,))
    assert "--lines A:B" in told(caught.value)


def test_the_line_number_counts_every_line_of_the_file(tmp_path: Path) -> None:
    text = "Rate: 10\r\n\r\n# remark\r\na,b\r\n\r\n1,2\r\n# remark\r\n\r\n3,4\r\n5,x\r\n7,8\r\n"
    with pytest.raises(RecordingError, match="line 10, column 'b'"):
        read(tmp_path, text)


def test_a_bad_line_amid_a_long_file_is_found(tmp_path: Path) -> None:
    rows = [f"{i * 0.001:.3f},{i % 7},{i % 5}" for i in range(60000)]
    rows[41234] = "41.234,3"
    with pytest.raises(RecordingError, match=r"line 41236: expected 3 fields, found 2"):
        read(tmp_path, "t,a,b\n" + "\n".join(rows))
