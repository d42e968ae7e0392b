"""TDM with TDX, written from the published form: channels in XML, their numbers in blocks of a second file."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from rthstrack.cli import main
from rthstrack.errors import RecordingError
from rthstrack.recording import propose_pair, read_recording
from test_readers_damage import MEASURED, N_DAMAGED_OWN, TARGET, damaged, read_or_error

if TYPE_CHECKING:
    from pathlib import Path

TYPES = {"f8": "eFloat64Usi", "f4": "eFloat32Usi", "i2": "eInt16Usi", "u4": "eUInt32Usi"}
RATE = {"wf_increment": 0.02}


def column(name: str, values: Any = None, **other: Any) -> dict[str, Any]:
    """A channel: its numbers, their type, how they are represented, its unit, its attributes."""
    usual = {"type": "f8", "how": "explicit", "parameters": "", "unit": "", "attributes": {}}
    return {"name": name, "values": values, **usual, **other}


def write_tdm(path: Path, *channels: dict[str, Any], order: str = "<", url: str = "", edit: Any = None) -> Path:
    """A .tdm and its .tdx; edit: what is changed in the XML, (before, after)."""
    blocks, sequences, described, numbers = "", "", "", b""
    for i, one in enumerate(channels):
        content = b"" if one["values"] is None else np.asarray(one["values"]).astype(order + one["type"]).tobytes()
        n = 200 if one["values"] is None else len(one["values"])
        kind = TYPES[one["type"]]
        blocks += f'<block byteOffset="{len(numbers)}" id="inc{i}" length="{n}" valueType="{kind}"/>\n'
        sequences += f'<double_sequence id="usi{i}1"><values external="inc{i}"/></double_sequence>\n'
        attributes = "".join(
            f'<{"time" if isinstance(value, str) else "double"}_attribute name="{key}">{value}'
            f"</{'time' if isinstance(value, str) else 'double'}_attribute>"
            for key, value in one["attributes"].items()
        )
        parameters = f"<generation_parameters>{one['parameters']}</generation_parameters>" if one["parameters"] else ""
        described += (
            f'<tdm_channel id="usi{i}2"><name>{one["name"]}</name><group>#xpointer(id("usi1"))</group>'
            f"<unit_string>{one['unit']}</unit_string><datatype>DT_DOUBLE</datatype>"
            f"<instance_attributes>{attributes}</instance_attributes>"
            f'<local_columns>#xpointer(id("usi{i}4"))</local_columns></tdm_channel>\n'
            f'<submatrix id="usi{i}3"><number_of_rows>{n}</number_of_rows></submatrix>\n'
            f'<localcolumn id="usi{i}4"><submatrix>#xpointer(id("usi{i}3"))</submatrix>'
            f"<sequence_representation>{one['how']}</sequence_representation>{parameters}"
            f'<values>#xpointer(id("usi{i}1"))</values></localcolumn>\n'
        )
        numbers += content
    ordered = "littleEndian" if order == "<" else "bigEndian"
    text = (
        '<?xml version="1.0" encoding="UTF-8" standalone="no" ?>\n'
        '<usi:tdm xmlns:usi="http://www.ni.com/Schemas/USI/1_0" version="1.0">\n<usi:include>'
        f'<file byteOrder="{ordered}" url="{url or path.with_suffix(".tdx").name}">{blocks}</file></usi:include>\n'
        f'<usi:data>{sequences}<tdm_channelgroup id="usi1"><name>DAQ</name></tdm_channelgroup>\n'
        f"{described}</usi:data>\n"
        "</usi:tdm>\n"
    )
    if edit is not None:
        assert edit[0] in text
        text = text.replace(*edit)
    path.write_text(text, encoding="utf-8")
    path.with_suffix(".tdx").write_bytes(numbers)
    return path


@pytest.mark.parametrize("order", ["<", ">"])
def test_channels_are_read_with_group_unit_and_rate(tmp_path: Path, order: str) -> None:
    counts = np.round(1000 * MEASURED)
    path = write_tdm(
        tmp_path / "run.tdm",
        column("Target", TARGET, unit="mm", attributes=RATE),
        column("Measured", counts, type="i2", how="raw_linear", parameters="0.5 0.001", unit="mm", attributes=RATE),
        column("Load", TARGET, type="f4", attributes=RATE),
        column("Time", how="implicit_linear", parameters="10 0.02", unit="s", attributes=RATE),
        order=order,
    )
    recording = read_recording(path)
    assert (recording.format, recording.rate_hz) == ("TDM", 50.0)
    assert [c.path for c in recording.channels] == ["DAQ/Target", "DAQ/Measured", "DAQ/Load", "DAQ/Time"]
    assert [c.unit for c in recording.channels][:2] == ["mm", "mm"]
    assert np.array_equal(recording["Target"].values, TARGET)
    assert np.array_equal(recording["Measured"].values, 0.5 + 0.001 * counts)
    assert np.array_equal(recording["Load"].values, TARGET.astype("f4"))
    assert np.array_equal(recording["Time"].values, 10 + 0.02 * np.arange(200))
    assert propose_pair(recording)[0] == [("DAQ/Target", "DAQ/Measured")]


def test_channels_that_begin_later_say_so(tmp_path: Path) -> None:
    path = write_tdm(
        tmp_path / "run.tdm",
        column("Target", TARGET, attributes={**RATE, "wf_start_time": "2024-05-06T17:20:12.00000000000000000"}),
        column("Measured", MEASURED, attributes={**RATE, "wf_start_time": "2024-05-06T17:20:12.05000000000000000"}),
    )
    starts = [c.time.start_s for c in read_recording(path).channels if c.time is not None]
    assert starts == pytest.approx([0, 0.05])


def test_the_numbers_are_looked_for_beside_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    channels = (column("Target", TARGET, attributes=RATE), column("Measured", MEASURED, attributes=RATE))
    path = write_tdm(tmp_path / "run.tdm", *channels, url="C:\\Data\\before it was called so.tdx")
    assert np.array_equal(read_recording(path)["Target"].values, TARGET)
    with pytest.raises(RecordingError, match=r"run\.tdx: the numbers of a TDM file; give the \.tdm file beside it"):
        read_recording(path.with_suffix(".tdx"))
    # A folder names the numbers once.
    assert main(["channels", str(tmp_path)]) == 0
    assert capsys.readouterr().out.count("likely pair") == 1
    path.with_suffix(".tdx").unlink()
    with pytest.raises(RecordingError, match=r"its numbers are in before it was called so\.tdx, which is not beside"):
        read_recording(path)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (("explicit", "raw_polynomial"), "is filed as raw_polynomial, which is not read"),
        (("explicit", "raw_linear"), "states no parameters"),
        (("eFloat64Usi", "eStringUsi"), "holds no numbers"),
        (("<block ", "<block_bm "), "is filed row by row"),
        (('length="200"', 'length="201"'), "run.tdx: expected 201 values"),
        (('byteOrder="littleEndian"', 'byteOrder="middle"'), "an order of bytes that is not known"),
        (('id="inc0"', 'id="inc9"'), "block inc0 is named, but not described"),
        (("<usi:data>", "<!DOCTYPE a><usi:data>"), "definitions of its own"),
        (("</usi:tdm>", ""), "damaged, or not as its format demands"),
    ],
)
def test_what_cannot_be_read_is_told(tmp_path: Path, edit: tuple[str, str], said: str) -> None:
    path = write_tdm(tmp_path / "run.tdm", column("Target", TARGET), edit=edit)
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("ending", [".tdm", ".tdx"])
def test_damaged_files_end_in_one_line_or_in_a_reading(tmp_path: Path, ending: str) -> None:
    path = write_tdm(tmp_path / "run.tdm", column("Target", TARGET, attributes=RATE), column("Measured", MEASURED))
    broken = path.with_suffix(ending)
    whole = broken.read_bytes()
    chance = random.Random(f"{ending} 2014")
    n_errors = 0
    for _ in range(N_DAMAGED_OWN):
        broken.write_bytes(damaged(whole, chance))
        n_errors += read_or_error(path) is None
    assert n_errors > N_DAMAGED_OWN // 8
