"""Damaged files of every format: a one-line error or a reading, never anything else."""

from __future__ import annotations

import os
import random
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from nptdms import TdmsWriter

from rthstrack.errors import RecordingError, printable
from rthstrack.recording import Recording, read_recording
from test_accelerograms import at2, cosmos, csmip, esm, knet, smc
from test_readers_formats import build_v73, v73, waveform
from workbooks import write_workbook

if TYPE_CHECKING:
    from collections.abc import Callable

T = np.arange(200) / 50
TARGET, MEASURED = np.sin(T), 0.9 * np.sin(T - 0.02)
# More of them with RTHSTRACK_FUZZ=10000, say.
N_DAMAGED = int(os.environ.get("RTHSTRACK_FUZZ", "240"))
# Of parsers that are ours.
N_DAMAGED_OWN = int(os.environ.get("RTHSTRACK_FUZZ_OWN", N_DAMAGED))
# Each needs a process of its own.
N_DAMAGED_APART = max(8, N_DAMAGED // 40)


def write_csv(path: Path) -> None:
    rows = "".join(f"{t:.2f};{x:.6f};{y:.6f}\n".replace(".", ",") for t, x, y in zip(T, TARGET, MEASURED, strict=True))
    path.write_text("Sampling Rate: 50\nTime (s);Target (mm);Measured (mm)\n" + rows)


def write_v73(path: Path) -> None:
    v73(path, build_v73)


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("run/target", data=TARGET, compression="gzip", chunks=(64,))
        file["run/measured"] = MEASURED
        file["table"] = np.array([(1.0, 2), (3.0, 4)], dtype=[("a", "f8"), ("b", "i4")])
        file.attrs["rate_hz"] = 50.0
        file["run/target"].attrs["unit"] = "mm"


def write_tdms(path: Path) -> None:
    with TdmsWriter(path) as writer:
        for _ in range(3):
            writer.write_segment([waveform("DAQ", "Target", TARGET[:50]), waveform("DAQ", "Measured", MEASURED[:50])])


def write_parquet(path: Path) -> None:
    stamps = np.datetime64("2022-05-25T17:46:08") + np.arange(200) * np.timedelta64(20, "ms")
    pq.write_table(pa.table({"when": stamps, "target": TARGET, "measured": MEASURED, "word": ["x"] * 200}), path)


def arrow_table() -> pa.Table:
    fields = [pa.field(name, pa.float64(), metadata={"unit": "mm"}) for name in ("target", "measured")]
    schema = pa.schema([pa.field("time_s", pa.float64()), *fields, pa.field("filled", pa.bool_())], {"rate_hz": "50.0"})
    return pa.table([T, TARGET, MEASURED, np.zeros(200, bool)], schema=schema)


def write_arrow_stream(path: Path) -> None:
    table = arrow_table()
    with pa.ipc.new_stream(path, table.schema) as writer:
        writer.write_table(table, max_chunksize=40)


def write_arrow_file(path: Path) -> None:
    table = arrow_table()
    with pa.ipc.new_file(path, table.schema) as writer:
        writer.write_table(table, max_chunksize=40)


def write_npz(path: Path) -> None:
    np.savez_compressed(path, target=TARGET, measured=MEASURED, rate_hz=50.0)


def write_npy(path: Path) -> None:
    np.save(path, np.column_stack([TARGET, MEASURED]))


def write_mat(path: Path) -> None:
    data = np.empty((1, 2), dtype=[("values", "O"), ("label", "O")])
    data[0, 0], data[0, 1] = (TARGET, "target"), (MEASURED, "measured")
    scipy.io.savemat(path, {"data": data, "x": np.vstack([T, TARGET]), "fs": 50.0})


def write_xlsx(path: Path) -> None:
    rows = [[t, x, y] for t, x, y in zip(T.tolist(), TARGET.tolist(), MEASURED.tolist(), strict=True)]
    write_workbook(path, {"Run": [["time", "target", "measured"], *rows]})


def accelerogram(text: Callable[[list[float]], str]) -> Callable[[Path], None]:
    """A writer of the target as acceleration in this form."""

    def write(path: Path) -> None:
        path.write_text(text(TARGET.tolist()))

    return write


WRITERS: dict[str, Callable[[Path], None]] = {
    "csv": write_csv,
    "mat73.mat": write_v73,
    "h5": write_hdf5,
    "tdms": write_tdms,
    "parquet": write_parquet,
    "arrows": write_arrow_stream,
    "arrow": write_arrow_file,
    "npz": write_npz,
    "npy": write_npy,
    "mat": write_mat,
    "xlsx": write_xlsx,
    "asc": accelerogram(esm),
    "cosmos.v2": accelerogram(lambda values: cosmos(values=values)),
    "csmip.v2": accelerogram(csmip),
    "smc": accelerogram(smc),
    "knet.ew": accelerogram(knet),
    "at2": accelerogram(lambda values: at2(values, f"NPTS= {len(values)}, DT= .0050 SEC")),
}
# As printed.
TOLERANCES = {"csv": 5e-7, "asc": 5e-6, "cosmos.v2": 5e-6, "csmip.v2": 5e-4, "smc": 5e-4, "knet.ew": 5e-4, "at2": 5e-7}


# Read in a process of its own.
APART = ("mat", "xlsx")
# What was written piece by piece is read as far as its pieces are whole.
TOLERANT = ("arrows", "arrow")
OWN = ("asc", "cosmos.v2", "csmip.v2", "smc", "knet.ew", "at2")
# Its header does not say how many values follow.
UNCOUNTED = ("knet.ew",)


def damaged(whole: bytes, chance: random.Random) -> bytes:
    """The bytes cut off, with some of them changed, removed, doubled or overwritten by zeros."""
    content = bytearray(whole)
    if chance.random() < 0.3:
        del content[chance.randrange(len(content)) :]
    for _ in range(chance.choice([0, 1, 1, 2, 4, 16])):
        if not content:
            break
        at = chance.randrange(len(content))
        length = min(chance.choice([1, 1, 2, 4, 8, 64]), len(content) - at)
        kind = chance.randrange(5)
        if kind == 0:
            content[at] ^= 1 << chance.randrange(8)
        elif kind == 1:
            content[at : at + length] = chance.randbytes(length)
        elif kind == 2:
            del content[at : at + length]
        elif kind == 3:
            content[at:at] = content[at : at + length]
        else:
            content[at : at + length] = bytes(length) if chance.random() < 0.5 else b"\xff" * length
    return bytes(content)


def read_or_error(path: Path) -> Recording | None:
    try:
        return read_recording(path)
    except RecordingError as error:
        message = str(error)
        assert message.startswith(f"{path}: ")
        assert message == printable(message)
        assert len(message) <= 1000
        return None


@pytest.mark.parametrize("ending", WRITERS)
def test_the_whole_file_is_read(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"file.{ending}"
    WRITERS[ending](path)
    expected = np.tile(TARGET[:50], 3) if ending == "tdms" else TARGET
    tolerance = 1.001 * TOLERANCES.get(ending, 0.0)
    found = [c.values for c in read_recording(path).channels if len(c.values) == len(expected)]
    assert any(np.abs(values - expected).max() <= tolerance for values in found) or ending == "mat73.mat"


@pytest.mark.parametrize("ending", WRITERS)
def test_damaged_files_end_in_one_line_or_in_a_reading(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"file.{ending}"
    WRITERS[ending](path)
    whole = path.read_bytes()
    chance = random.Random(f"{ending} 2014")
    n_errors = 0
    n = N_DAMAGED_APART if ending in APART else N_DAMAGED_OWN if ending in OWN else N_DAMAGED
    for _ in range(n):
        path.write_bytes(damaged(whole, chance))
        recording = read_or_error(path)
        if recording is None:
            n_errors += 1
        else:
            assert recording.channels
            assert all(channel.values.dtype == np.float64 for channel in recording.channels)
    # Otherwise the damage was none. Whole batches of an Arrow stream are read whatever comes behind them.
    assert n_errors > n // (16 if ending in TOLERANT else 8)


@pytest.mark.parametrize(
    "ending", [ending for ending in WRITERS if ending not in ("csv", *APART, *TOLERANT, *UNCOUNTED)]
)
def test_files_cut_off_anywhere_are_an_error(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"file.{ending}"
    WRITERS[ending](path)
    whole = path.read_bytes()
    for length in np.linspace(0, len(whole) - 1, 60).astype(int):
        path.write_bytes(whole[:length])
        recording = read_or_error(path)
        # A TDMS file cut between two segments is a shorter file; an HDF5 file may end in unused bytes.
        if recording is not None:
            assert ending == "tdms" or length > len(whole) - 1024


@pytest.mark.parametrize("ending", TOLERANT)
def test_an_arrow_stream_cut_off_anywhere_is_read_to_its_last_whole_batch(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"file.{ending}"
    WRITERS[ending](path)
    whole = path.read_bytes()
    lengths = []
    for length in [*range(1, len(whole) - 8, 7), *range(len(whole) - 8, len(whole))]:
        path.write_bytes(whole[:length])
        recording = read_or_error(path)
        if recording is None:
            lengths.append(0)
            continue
        values = recording["target"].values
        lengths.append(len(values))
        assert np.array_equal(values, TARGET[: len(values)])
        assert recording.rate_hz == 50.0
        assert any("cut off" in note or "no end marker" in note or "end is missing" in note for note in recording.notes)
    assert lengths == sorted(lengths)
    assert set(lengths) == {0, 40, 80, 120, 160, 200}


def test_bytes_without_any_meaning_are_an_error(tmp_path: Path) -> None:
    chance = random.Random(5)
    for i in range(200):
        path = tmp_path / f"file.{list(WRITERS)[i % len(WRITERS)]}"
        path.write_bytes(chance.randbytes(chance.choice([30, 100, 1000])))
        assert read_or_error(path) is None
