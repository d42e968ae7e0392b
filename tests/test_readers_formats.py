"""Binary formats: channels, names, units and rates as each format states them; the format is told by content."""

from __future__ import annotations

import io
import math
import os
import struct
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from rthstrack.errors import RecordingError
from rthstrack.recording import Recording, propose_pair, read_recording
from rthstrack.recording.readers import apart

if TYPE_CHECKING:
    from pathlib import Path

T = np.arange(100) / 50
TARGET = np.sin(T)
MEASURED = 0.9 * np.sin(T - 0.02)


def listed(recording: Recording) -> list[tuple[str, str, str | None, int]]:
    return [(c.name, c.path, c.unit, len(c.values)) for c in recording.channels]


def names(recording: Recording) -> list[str]:
    return [c.name for c in recording.channels]


# ---- MATLAB v5 ----


def saved(folder: Path, variables: dict[str, Any], **options: Any) -> Path:
    path = folder / "file.mat"
    scipy.io.savemat(path, variables, **options)
    return path


@pytest.mark.parametrize("options", [{}, {"do_compression": True}, {"format": "4"}])
def test_matlab_vectors_and_matrices_are_channels_in_matlabs_words(tmp_path: Path, options: dict[str, Any]) -> None:
    variables = {
        "tall": np.column_stack([TARGET, MEASURED]),
        "wide": np.vstack([T, TARGET]),
        "row": MEASURED,
        "fs": 50.0,
    }
    recording = read_recording(saved(tmp_path, variables, **options))
    assert names(recording) == ["tall(:,1)", "tall(:,2)", "wide(1,:)", "wide(2,:)", "row"]
    assert np.array_equal(recording["tall(:,2)"].values, MEASURED)
    assert np.array_equal(recording["Wide( 2, : )"].values, TARGET)
    assert np.array_equal(recording["row"].values, MEASURED)
    assert (recording.rate_hz, recording.rate_source) == (50.0, "'fs'")
    assert recording.format == ("MATLAB v4" if options.get("format") == "4" else "MATLAB v5")


def test_nested_structs_struct_arrays_and_cells_are_walked(tmp_path: Path) -> None:
    data = np.empty((1, 2), dtype=[("values", "O"), ("label", "O"), ("unit", "O"), ("raw", "O")])
    data[0, 0] = (np.column_stack([TARGET, MEASURED]), "both", "mm", "")
    data[0, 1] = (TARGET, "target disp", "mm", MEASURED)
    cell = np.empty((1, 2), dtype=object)
    cell[0, 0], cell[0, 1] = TARGET, "text"
    recording = read_recording(
        saved(
            tmp_path, {"data": data, "s": {"disp": {"target": TARGET, "n": 3}}, "c": cell, "dt": 0.02, "note": "hello"}
        )
    )
    assert listed(recording) == [
        ("data(1).values(:,1)", "data(1).values(:,1)", "mm", 100),
        ("data(1).values(:,2)", "data(1).values(:,2)", "mm", 100),
        ("target disp", "data(2).values", "mm", 100),
        ("data(2).raw", "data(2).raw", None, 100),
        ("s.disp.target", "s.disp.target", None, 100),
        ("c{1}", "c{1}", None, 100),
    ]
    assert np.array_equal(recording["data(1).values(:,2)"].values, MEASURED)
    assert np.array_equal(recording["data(2).values"].values, TARGET)
    assert (recording.rate_hz, recording.rate_source) == (50.0, "'dt'")
    assert "'s.disp.n' is a single number, no channel" in recording.notes


def test_simulinks_structure_with_time_is_read(tmp_path: Path) -> None:
    signals = np.empty((1, 2), dtype=[("values", "O"), ("dimensions", "O"), ("label", "O")])
    signals[0, 0] = (TARGET[:, None], 1.0, "target")
    signals[0, 1] = (np.column_stack([MEASURED, TARGET]), 2.0, "")
    recording = read_recording(
        saved(tmp_path, {"simout": {"time": T[:, None], "signals": signals, "blockName": "m/s"}})
    )
    assert names(recording) == [
        "simout.time",
        "target",
        "simout.signals(2).values(:,1)",
        "simout.signals(2).values(:,2)",
    ]
    assert recording["simout.signals(1).values"].name == "target"
    assert (recording.rate_hz, recording.rate_source) == (50.0, "time column 'simout.time'")


def test_an_array_with_single_dimensions_between_keeps_its_indices(tmp_path: Path) -> None:
    deep = np.stack([TARGET, MEASURED]).reshape(2, 1, 100)
    recording = read_recording(saved(tmp_path, {"y": deep, "line": TARGET.reshape(1, 1, 100)}))
    assert names(recording) == ["y(1,1,:)", "y(2,1,:)", "line"]
    assert np.array_equal(recording["y(2,1,:)"].values, MEASURED)


def test_what_is_no_channel_in_matlab_is_noted(tmp_path: Path) -> None:
    variables = {
        "x": TARGET,
        "z": TARGET + 1j,
        "cube": np.zeros((3, 4, 5)),
        "map": np.zeros((600, 700)),
        "e": np.zeros((0, 1)),
    }
    recording = read_recording(saved(tmp_path, variables))
    assert names(recording) == ["x"]
    assert set(recording.notes) == {
        "'z' holds complex numbers, no channel",
        "'cube' is 3x4x5 numbers, no channel: expected a vector or a matrix with a short dimension",
        "'map' is 600x700 numbers, no channel: expected a vector or a matrix with a short dimension",
        "'e' is empty, no channel",
    }


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def opaque_file(*variables: bytes) -> bytes:
    """A v5 file by the published layout, with an object as MATLAB stores those of its newer classes."""
    return b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM" + b"".join(variables)


def opaque(name: str, class_name: str) -> bytes:
    numbers = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1)) + element(1, b"")
    metadata = element(14, numbers + element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1)))
    texts = b"".join(element(1, text.encode()) for text in (name, "MCOS", class_name))
    return element(14, element(6, struct.pack("<II", 17, 0)) + texts + metadata)


def test_an_object_of_matlab_is_named_with_the_way_to_save_it(tmp_path: Path) -> None:
    path = tmp_path / "file.mat"
    path.write_bytes(opaque_file(opaque("ts", "timeseries")))
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert "'ts' is a MATLAB object (timeseries), which only MATLAB can read; save ts.Time and ts.Data instead" in str(
        caught.value
    )
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, {"x": TARGET})
    path.write_bytes(buffer.getvalue() + opaque("tab", "table"))
    recording = read_recording(path)
    assert names(recording) == ["x"]
    assert "'tab' is a MATLAB object (table)" in recording.notes[0]


@pytest.mark.parametrize("crash", ["abort", "hang", "memory", "nonsense"])
def test_a_crash_of_the_matlab_reader_is_one_line_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, crash: str
) -> None:
    path = saved(tmp_path, {"x": TARGET})
    # A stand-in for loadmat, found before SciPy's by the reading process.
    fake = tmp_path / "fake" / "scipy" / "io"
    (fake / "matlab").mkdir(parents=True)
    body = {
        "abort": "import os; os.abort()",
        "hang": "import time; time.sleep(60)",
        # Never touched, so that only the limit refuses it: 20 GB.
        "memory": "import numpy; numpy.empty(20 * 10**9, numpy.uint8)",
        "nonsense": "raise RuntimeError('first line\\nsecond line')",
    }[crash]
    (fake / "__init__.py").write_text(f"def loadmat(*args, **kwargs):\n    {body}\n")
    (fake / "matlab" / "__init__.py").write_text("matfile_version = MatlabOpaque = MatlabFunction = None\n")
    (fake.parent / "__init__.py").write_text("")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "fake"), os.environ.get("PYTHONPATH", "")]))
    if crash == "hang":
        monkeypatch.setattr(apart, "TIMEOUT_S", 3.0)
    said = {
        "abort": "it crashed the reading process",
        "hang": "took more than 3 s",
        "memory": "Unable to allocate",
        "nonsense": "first line",
    }[crash]
    with pytest.raises(RecordingError, match=f"the file is damaged.*{said}") as caught:
        read_recording(path)
    assert "\n" not in str(caught.value)


def test_the_ground_motions_of_the_benchmark_are_read(shared: Path) -> None:
    for name, n, peak, rate in (
        ("ElCentro", 2060, 3.1349, 50),
        ("Kobe", 5095, 6.3298, 100),
        ("Maule", 28338, 3.932, 200),
    ):
        recording = read_recording(shared / "records" / f"{name}AccelNoScaling.mat")
        assert names(recording) == [f"{name}Accel(1,:)", f"{name}Accel(2,:)"]
        acceleration = recording[f"{name}Accel(2,:)"].values
        assert len(acceleration) == n
        assert np.abs(acceleration).max() == pytest.approx(peak, abs=1e-4)
        assert recording.rate_hz == rate
        assert "it has no name, but rises evenly" in recording.rate_source


def mat5(path: Path, order: str, *variables: tuple[str, Any, bool]) -> Path:
    """A MATLAB v5 file in this byte order by its published form: (name, values, sparse) of double columns."""

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack(f"{order}2I", kind, len(data)) + data + bytes(-len(data) % 8)

    def numbers(kind: int, values: Any, code: str) -> bytes:
        return element(kind, np.asarray(values, f"{order}{code}").tobytes())

    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(f"{order}H", 0x0100) + (b"MI" if order == ">" else b"IM")
    content = head
    for name, values, sparse in variables:
        at = np.flatnonzero(values)
        parts = numbers(6, [5 if sparse else 6, len(at)], "u4") + numbers(5, [len(values), 1], "i4")
        parts += element(1, name.encode())
        parts += numbers(5, at, "i4") + numbers(5, [0, len(at)], "i4") if sparse else b""
        content += element(14, parts + numbers(9, values[at] if sparse else values, "f8"))
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_sparse_matrix_is_named_and_the_rest_is_read(tmp_path: Path, order: str) -> None:
    stiffness = np.eye(5).ravel()
    file = mat5(tmp_path / "a.mat", order, ("x", TARGET, False), ("K", stiffness, True), ("y", MEASURED, False))
    recording = read_recording(file)
    assert np.array_equal(recording["x"].values, TARGET)
    assert np.array_equal(recording["y"].values, MEASURED)
    assert "'K' is a sparse matrix (save what full() makes of it), no channel" in recording.notes
    with pytest.raises(RecordingError, match=r"no channels.*'x' is a sparse matrix \(save what full\(\) makes of it\)"):
        read_recording(mat5(tmp_path / "b.mat", order, ("x", TARGET, True)))


# ---- MATLAB v7.3 ----


def test_a_simulink_log_whose_samples_are_a_stream_is_named_with_what_to_export(tmp_path: Path) -> None:
    def build(file: h5py.File) -> None:
        # As Simulink logs to a file: the samples as bytes apart, and an object that says whose they are.
        stream = file.create_group("#sigstream#/0")
        stream["#data#"] = np.frombuffer(TARGET.tobytes(), np.uint8)
        stream["#length#"], stream["#sampleSize#"] = [len(TARGET)], [8]
        log = file.create_dataset("logsout", data=np.array([[0xDD000000, 2, 1, 1, 1, 1]], dtype=np.uint32))
        log.attrs["MATLAB_class"] = np.bytes_("Simulink.SimulationData.Dataset")
        log.attrs["MATLAB_object_decode"] = np.int32(3)

    with pytest.raises(RecordingError) as caught:
        read_recording(v73(tmp_path / "a.mat", build))
    said = str(caught.value)
    assert "'logsout' is a MATLAB object (Simulink.SimulationData.Dataset)" in said
    assert "save logsout{1}.Values.Time and logsout{1}.Values.Data" in said


def v73(path: Path, build: Any) -> Path:
    """An HDF5 file with MATLAB's header in a user block of 512 bytes."""
    with h5py.File(path, "w", userblock_size=512) as file:
        build(file)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + struct.pack("<H", 0x0200) + b"IM")
    return path


def put(group: h5py.Group, name: str, array: Any, kind: str = "double") -> h5py.Dataset:
    """An array as MATLAB stores it: dimensions reversed, at least two."""
    dataset = group.create_dataset(name, data=np.atleast_2d(np.asarray(array)).T)
    dataset.attrs["MATLAB_class"] = np.bytes_(kind)
    return dataset


def text(group: h5py.Group, name: str, value: str) -> h5py.Dataset:
    return put(group, name, np.array([[ord(c) for c in value]], dtype=np.uint16), "char")


def build_v73(file: h5py.File) -> None:
    put(file, "tall", np.column_stack([TARGET, MEASURED]))
    put(file, "wide", np.vstack([T, TARGET]))
    put(file, "fs", 50.0)
    put(file, "empty", np.array([0, 0], dtype=np.uint64)).attrs["MATLAB_empty"] = np.uint8(1)
    put(file, "flag", np.array([1, 0, 1], dtype=np.uint8), "logical")
    struct_one = file.create_group("s")
    struct_one.attrs["MATLAB_class"] = np.bytes_("struct")
    put(struct_one, "data", MEASURED)
    text(struct_one, "name", "measured")
    text(struct_one, "units", "mm")
    refs = file.create_group("#refs#")
    first, second = put(refs, "a", TARGET), put(refs, "b", np.column_stack([TARGET, MEASURED]))
    label = text(refs, "c", "hello")
    array = file.create_group("data")
    array.attrs["MATLAB_class"] = np.bytes_("struct")
    array.create_dataset("values", data=np.array([[first.ref], [second.ref]], dtype=h5py.ref_dtype))
    cell = file.create_dataset("c", data=np.array([[label.ref], [first.ref]], dtype=h5py.ref_dtype))
    cell.attrs["MATLAB_class"] = np.bytes_("cell")
    objects = file.create_dataset("ts", data=np.array([[0xDD000000, 2, 1, 1, 1, 1]], dtype=np.uint32))
    objects.attrs["MATLAB_class"] = np.bytes_("timeseries")
    objects.attrs["MATLAB_object_decode"] = np.int32(3)


def test_matlab_v73_is_read_in_matlabs_order_and_words(tmp_path: Path) -> None:
    recording = read_recording(v73(tmp_path / "file.mat", build_v73))
    assert recording.format == "MATLAB v7.3"
    assert names(recording) == [
        "c{2}",
        "data(1).values",
        "data(2).values(:,1)",
        "data(2).values(:,2)",
        "flag",
        "measured",
        "tall(:,1)",
        "tall(:,2)",
        "wide(1,:)",
        "wide(2,:)",
    ]
    assert np.array_equal(recording["tall(:,2)"].values, MEASURED)
    assert np.array_equal(recording["wide(2,:)"].values, TARGET)
    assert np.array_equal(recording["data(2).values(:,2)"].values, MEASURED)
    assert (recording["s.data"].name, recording["s.data"].unit) == ("measured", "mm")
    assert (recording.rate_hz, recording.rate_source) == (50.0, "'fs'")
    assert "'ts' is a MATLAB object (timeseries), which only MATLAB can read" in recording.notes[0]
    assert "'empty' is empty, no channel" in recording.notes


def test_references_that_lead_back_to_themselves_end(tmp_path: Path) -> None:
    def build(file: h5py.File) -> None:
        put(file, "x", TARGET)
        loop = file.create_dataset("loop", shape=(1, 1), dtype=h5py.ref_dtype)
        loop.attrs["MATLAB_class"] = np.bytes_("cell")
        loop[0, 0] = loop.ref

    recording = read_recording(v73(tmp_path / "file.mat", build))
    assert names(recording) == ["x"]
    assert any("nested too deep" in note for note in recording.notes)


# ---- HDF5 ----


def test_hdf5_datasets_are_channels_with_their_paths_units_and_rate(tmp_path: Path) -> None:
    path = tmp_path / "file.h5"
    with h5py.File(path, "w") as file:
        file.attrs["sample_rate"] = 50.0
        file["run/target"] = TARGET
        file["run/target"].attrs["units"] = "mm"
        file["run/measured"] = MEASURED.astype(np.float32)
        file["run/measured"].attrs["Unit"] = np.bytes_("mm")
        file["both"] = np.column_stack([TARGET, MEASURED])
        file["rows"] = np.vstack([TARGET, MEASURED])
        file["table"] = np.array([(1.0, 2), (3.0, 4)], dtype=[("a", "f8"), ("b", "i4")])
        file["comment"] = "by hand"
        file["n"] = 7
    recording = read_recording(path)
    assert listed(recording) == [
        ("both[:,0]", "both[:,0]", None, 100),
        ("both[:,1]", "both[:,1]", None, 100),
        ("rows[0,:]", "rows[0,:]", None, 100),
        ("rows[1,:]", "rows[1,:]", None, 100),
        ("run/measured", "run/measured", "mm", 100),
        ("run/target", "run/target", "mm", 100),
        ("table/a", "table/a", None, 2),
        ("table/b", "table/b", None, 2),
    ]
    assert np.array_equal(recording["run/measured"].values, MEASURED.astype(np.float32).astype(float))
    assert np.array_equal(recording["rows[1,:]"].values, MEASURED)
    assert (recording.rate_hz, recording.rate_source) == (50.0, "attribute 'sample_rate'")
    assert propose_pair(recording)[0] == [("run/target", "run/measured")]


def test_an_hdf5_dataset_may_state_its_own_step(tmp_path: Path) -> None:
    path = tmp_path / "file.h5"
    with h5py.File(path, "w") as file:
        file["target"], file["slow"] = TARGET, TARGET
        file["target"].attrs["dt"] = 0.02
    assert read_recording(path).rate_hz == 50.0
    with h5py.File(path, "a") as file:
        file["slow"].attrs["dt"] = 0.5
    recording = read_recording(path)
    assert recording.rate_hz is None
    assert "the channels have different sampling rates" in recording.rate_source
    assert read_recording(path, rate_hz=50).rate_hz == 50


def test_an_hdf5_time_dataset_gives_the_rate(tmp_path: Path) -> None:
    path = tmp_path / "file.h5"
    with h5py.File(path, "w") as file:
        file["run/time"], file["run/x"], file["short/time"] = T, TARGET, T[:3] * 7
    assert read_recording(path).rate_source == "time column 'run/time'"
    with h5py.File(path, "a") as file:
        file["other/time"], file["other/x"] = T * 2, TARGET
    recording = read_recording(path)
    assert recording.rate_hz is None
    assert recording.rate_source == ("time column 'other/time' says 25 Hz, but time column 'run/time' 50 Hz")
    assert read_recording(path, time="run/time").rate_hz == 50.0


def test_a_dataset_that_claims_more_than_the_file_holds_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "file.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("x", shape=(1 << 40,), chunks=(1024,), dtype="f8")
    with pytest.raises(RecordingError, match=r"damaged: '/x' claims 1099511627776 values in 0 stored bytes"):
        read_recording(path)


def test_links_to_other_files_are_not_followed(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["secret"] = TARGET
    with h5py.File(tmp_path / "file.h5", "w") as file:
        file["x"] = TARGET
        file["link"] = h5py.ExternalLink("other.h5", "/secret")
    assert names(read_recording(tmp_path / "file.h5")) == ["x"]


# ---- TDMS ----


def tdms(path: Path, *objects: Any) -> Path:
    with TdmsWriter(path) as writer:
        writer.write_segment(list(objects))
    return path


def waveform(group: str, name: str, values: Any, step: float | None = 0.02, unit: str = "mm") -> ChannelObject:
    properties: dict[str, Any] = {"unit_string": unit}
    if step is not None:
        properties["wf_increment"] = step
    return ChannelObject(group, name, np.asarray(values), properties=properties)


def test_tdms_channels_have_group_unit_and_increment(tmp_path: Path) -> None:
    path = tdms(
        tmp_path / "file.tdms",
        RootObject(properties={"author": "me"}),
        GroupObject("DAQ"),
        waveform("DAQ", "Target", TARGET),
        waveform("DAQ", "Measured", (MEASURED * 1000).astype(np.int16)),
        ChannelObject("Log", "Events", ["a", "b"]),
    )
    recording = read_recording(path)
    assert listed(recording) == [("Target", "DAQ/Target", "mm", 100), ("Measured", "DAQ/Measured", "mm", 100)]
    assert np.array_equal(recording["DAQ/measured"].values, (MEASURED * 1000).astype(np.int16).astype(float))
    assert (recording.rate_hz, recording.rate_source) == (50.0, "wf_increment")
    assert "'Log/Events' holds no numbers, no channel" in recording.notes


def test_tdms_channels_of_different_increments_leave_the_rate_open(tmp_path: Path) -> None:
    path = tdms(tmp_path / "file.tdms", waveform("a", "x", TARGET), waveform("b", "y", TARGET[:5], step=1.0))
    recording = read_recording(path)
    assert recording.rate_hz is None
    assert recording.rate_source == (
        "the channels have different sampling rates (wf_increment: 1 Hz for 'b/y', 50 Hz for 'a/x')"
    )


def test_tdms_timestamps_tell_the_time(tmp_path: Path) -> None:
    stamps = np.datetime64("2022-05-25T17:46:08") + np.arange(100) * np.timedelta64(20, "ms")
    path = tdms(
        tmp_path / "file.tdms", ChannelObject("g", "stamp", stamps), waveform("g", "x", TARGET, step=None, unit="")
    )
    recording = read_recording(path)
    assert (recording.rate_hz, recording.rate_source) == (50.0, "date-time column 'g/stamp'")


def test_a_truncated_tdms_file_is_an_error_and_its_index_says_what_it_is(tmp_path: Path) -> None:
    path = tdms(tmp_path / "file.tdms", waveform("a", "x", TARGET))
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(RecordingError, match="truncated: its last segment is incomplete"):
        read_recording(path)
    path.write_bytes(b"TDSh" + path.read_bytes()[4:])
    with pytest.raises(RecordingError, match=r"the index of a TDMS file; give the .tdms file beside it"):
        read_recording(path)


# ---- Parquet ----


def test_parquet_columns_metadata_nulls_and_timestamps(tmp_path: Path) -> None:
    path = tmp_path / "file.parquet"
    stamps = pa.array(np.datetime64("2022-05-25T17:46:08") + np.arange(100) * np.timedelta64(20, "ms"))
    target = pa.array([None if i == 3 else v for i, v in enumerate(TARGET.tolist())])
    schema = pa.schema(
        [
            pa.field("when", stamps.type),
            pa.field("target", pa.float64(), metadata={"unit": "mm"}),
            pa.field("measured", pa.float32()),
            pa.field("n", pa.int32()),
            pa.field("word", pa.string()),
        ]
    )
    columns = [stamps, target, pa.array(MEASURED.astype(np.float32)), pa.array(range(100), pa.int32()), ["x"] * 100]
    pq.write_table(pa.table(columns, schema=schema), path)
    recording = read_recording(path)
    assert listed(recording) == [
        ("target", "target", "mm", 100),
        ("measured", "measured", None, 100),
        ("n", "n", None, 100),
    ]
    assert np.flatnonzero(np.isnan(recording["target"].values)).tolist() == [3]
    assert (recording.rate_hz, recording.rate_source) == (50.0, "date-time column 'when'")
    assert "'word' holds string, no channel" in recording.notes
    pq.write_table(pa.table({"x": TARGET}).replace_schema_metadata({"rate_hz": "200"}), path)
    assert read_recording(path).rate_source == "metadata 'rate_hz'"


# ---- NumPy ----


def test_npz_arrays_and_a_rate(tmp_path: Path) -> None:
    path = tmp_path / "file.npz"
    np.savez(path, target=TARGET, both=np.column_stack([TARGET, MEASURED]), dt=0.02, label="hello")
    recording = read_recording(path)
    assert names(recording) == ["target", "both[:,0]", "both[:,1]"]
    assert np.array_equal(recording["both[:,1]"].values, MEASURED)
    assert (recording.rate_hz, recording.rate_source) == (50.0, "'dt'")
    np.savez_compressed(path, a=np.arange(5), rate_hz=7)
    assert (names(read_recording(path)), read_recording(path).rate_hz) == (["a"], 7.0)


def test_npy_files_hold_one_array(tmp_path: Path) -> None:
    np.save(tmp_path / "pair.npy", np.vstack([TARGET, MEASURED]))
    assert names(read_recording(tmp_path / "pair.npy")) == ["pair[0,:]", "pair[1,:]"]
    np.save(tmp_path / "pair.npy", np.array([(1.0, 2), (3.0, 4)], dtype=[("a", "f8"), ("b", "i4")]))
    assert names(read_recording(tmp_path / "pair.npy")) == ["pair/a", "pair/b"]
    (tmp_path / "pair.npy").write_bytes((tmp_path / "pair.npy").read_bytes() + b"more")
    with pytest.raises(RecordingError, match="there is content behind the array"):
        read_recording(tmp_path / "pair.npy")


def test_pickles_are_never_loaded(tmp_path: Path) -> None:
    np.save(tmp_path / "file.npy", np.array([{"a": 1}, None], dtype=object), allow_pickle=True)
    with pytest.raises(RecordingError, match="Object arrays cannot be loaded when allow_pickle=False"):
        read_recording(tmp_path / "file.npy")
    np.savez(tmp_path / "file.npz", x=TARGET, y=np.array([{"a": 1}, None], dtype=object))
    with pytest.raises(RecordingError, match="array 'y' cannot be read: Object arrays cannot be loaded"):
        read_recording(tmp_path / "file.npz")


def test_the_reference_pairs_are_read(shared: Path) -> None:
    for name in ("chy101n_linear", "chy101n_boucwen"):
        recording = read_recording(shared / "reference" / f"{name}.npz")
        with np.load(shared / "reference" / f"{name}.npz") as arrays:
            assert np.array_equal(recording["target"].values, arrays["target"])
            assert np.array_equal(recording["measured"].values, arrays["measured"])
        assert recording.rate_hz == 1024.0


# ---- told by content ----


def test_a_wrongly_named_file_is_read_for_what_it_is_and_said_so(tmp_path: Path) -> None:
    (tmp_path / "file.npz").write_text("t,x\n0.0,1\n0.5,2\n")
    recording = read_recording(tmp_path / "file.npz")
    assert recording["x"].values.tolist() == [1, 2]
    assert recording.notes == ("named .npz, but the content is text, comma between columns",)
    with (tmp_path / "file.csv").open("wb") as file:
        np.save(file, TARGET)
    assert "named .csv, but the content is NumPy npy" in read_recording(tmp_path / "file.csv").notes
    with h5py.File(tmp_path / "file.mat", "w") as hdf5:
        hdf5["x"] = TARGET
    assert "named .mat, but the content is HDF5" in read_recording(tmp_path / "file.mat").notes


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        (
            "file.h5",
            b"\x00\x01\x02\x03" * 300,
            "named .h5, but it does not begin as HDF5 does, and as text: not a text",
        ),
        (
            "file.parquet",
            b"hello",
            "named .parquet, but it does not begin as Parquet does, and as text: no rows of numbers",
        ),
        ("file.xlsx", b"PK\x05\x06" + b"\0" * 18, "a zip archive; expected NumPy arrays in it"),
        ("file.xls", b"\xd0\xcf\x11\xe0" + b"\0" * 600, "the file is damaged, or no Excel file"),
        ("file.csv.gz", b"\x1f\x8b" + b"\0" * 600, "a gzip archive; unpack it first"),
        (
            "file.mat",
            b"MATLAB 7.3 MAT-file".ljust(512),
            "a MATLAB v7.3 file without the HDF5 content behind its header",
        ),
        ("file.tdms", b"", "the file is empty"),
    ],
)
def test_files_of_other_kinds_say_what_they_are(tmp_path: Path, name: str, content: bytes, said: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError) as caught:
        read_recording(tmp_path / name)
    assert str(caught.value).startswith(f"{tmp_path / name}: {said}")
    assert "\n" not in str(caught.value)


def test_a_missing_file_a_directory_and_a_forbidden_file_are_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"none.csv: no such file$"):
        read_recording(tmp_path / "none.csv")
    with pytest.raises(RecordingError, match="a folder without recordings of its own; expected a file"):
        read_recording(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(RecordingError, match="not a regular file"):
        read_recording(tmp_path / "pipe")
    if os.geteuid() != 0:
        (tmp_path / "file.csv").write_text("a,b\n1,2\n")
        (tmp_path / "file.csv").chmod(0)
        with pytest.raises(RecordingError, match="Permission denied"):
            read_recording(tmp_path / "file.csv")


def test_a_name_that_no_file_can_have_is_one_line(tmp_path: Path) -> None:
    for name in ("x" * 300, "a\nb.csv", "a\0b"):
        with pytest.raises(RecordingError) as caught:
            read_recording(f"{tmp_path}/{name}")
        assert "\n" not in str(caught.value).replace(name, "")


def test_channels_of_different_lengths_are_read(tmp_path: Path) -> None:
    np.savez(tmp_path / "file.npz", a=TARGET, b=TARGET[:50], rate_hz=math.nan)
    recording = read_recording(tmp_path / "file.npz")
    assert [len(c.values) for c in recording.channels] == [100, 50]
    assert recording.rate_hz is None


def test_files_read_by_several_threads_leave_the_warning_filters_alone(tmp_path: Path) -> None:
    import warnings
    from concurrent.futures import ThreadPoolExecutor

    paths = []
    for i in range(40):
        path = tmp_path / f"{i}.npz"
        np.savez(path, target=np.arange(10.0), measured=np.arange(10.0), rate_hz=100.0)
        paths.append(path)
    before = list(warnings.filters)
    with ThreadPoolExecutor(8) as pool:
        recordings = list(pool.map(read_recording, paths))
    assert warnings.filters == before
    assert all(r.rate_hz == 100 for r in recordings)
