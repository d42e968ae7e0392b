"""MATLAB's own classes, written by mat-io as MATLAB files them, and what is said where they cannot be read."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import scipy.io

from rthstrack.recording import propose_pair, read_recording
from rthstrack.recording.chosen import read_chosen
from rthstrack.recording.readers import matlab
from rthstrack.said import Said, coded
from test_readers_damage import read_or_error

# Its import sets an option that newer pandas deprecates.
with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from matio import save_to_mat
    from matio.utils import MatlabOpaque

if TYPE_CHECKING:
    from pathlib import Path

    from rthstrack.recording import Recording

T = np.arange(120) / 50
TARGET, MEASURED = np.sin(3 * T), 0.9 * np.sin(3 * T - 0.02)


def text(word: str) -> Any:
    return np.array([word]) if word else np.zeros((0, 0), "U1")


def cells(*values: Any) -> Any:
    found = np.empty((1, len(values)), dtype=object)
    found[0, :] = values
    return found


def struct_of(**fields: Any) -> Any:
    found = np.empty((1, 1), dtype=[(key, "O") for key in fields])
    for key, value in fields.items():
        found[key][0, 0] = value
    return found


def timeseries(values: Any, name: str = "unnamed", *, even: bool = False, storage: bool = False) -> MatlabOpaque:
    """As MATLAB files it: time by its stamps or by start and increment, data in Data_ or in Storage_."""
    none = np.zeros((0, 0))
    step = np.array([[1 / 50]])
    time: dict[str, Any] = {
        "Time_": none if even else T[:, None],
        "Units": text("seconds"),
        "Length": np.array([[120.0]]),
    }
    time |= {"Start_": np.zeros((1, 1)), "Increment_": step} if even else {"Start_": none, "Increment_": none}
    about = MatlabOpaque({"Units": text("mm")}, "tsdata.datametadata")
    held = MatlabOpaque({"Data": values}, "tsdata.storage") if storage else none
    properties = {"Data_": none if storage else values, "Storage_": held, "Name": text(name), "DataInfo": about}
    return MatlabOpaque({**properties, "TimeInfo": MatlabOpaque(time, "tsdata.timemetadata")}, "timeseries")


def table(names: tuple[str, ...] = ("time", "target", "measured"), units: tuple[str, ...] = ()) -> MatlabOpaque:
    about = struct_of(
        useVariableNamesOriginal=np.array([[False]]),
        VariableUnits=cells(*map(text, units)) if units else np.zeros((0, 0), dtype=object),
        versionSavedFrom=np.array([[4.0]]),
    )
    values = cells(*(one[:, None] for one in (T, TARGET, MEASURED)))
    counts = {"nrows": np.array([[120.0]]), "nvars": np.array([[3.0]]), "ndims": np.array([[2.0]])}
    return MatlabOpaque({"data": values, "varnames": cells(*map(text, names)), "props": about, **counts}, "table")


def timetable(*, even: bool) -> MatlabOpaque:
    duration = {"fmt": text("s")}
    stated: Any = MatlabOpaque({"millis": 1e3 * T[:, None], **duration}, "duration")
    if even:
        stated = struct_of(
            origin=MatlabOpaque({"millis": np.zeros((1, 1)), **duration}, "duration"),
            specifiedAsRate=np.array([[True]]),
            stepSize=MatlabOpaque({"millis": np.array([[20.0]]), **duration}, "duration"),
            sampleRate=np.array([[50.0]]),
        )
    filed = struct_of(
        data=cells(TARGET[:, None], MEASURED[:, None]),
        varNames=cells(text("target"), text("measured")),
        dimNames=cells(text("Time"), text("Variables")),
        varUnits=cells(text("mm"), text("mm")),
        rowTimes=stated,
        numRows=np.array([[120.0]]),
        numVars=np.array([[2.0]]),
        versionSavedFrom=np.array([[6.0]]),
    )
    return MatlabOpaque({"any": filed}, "timetable")


def written(folder: Path, version: str = "v7", **variables: Any) -> Path:
    path = folder / "file.mat"
    save_to_mat(path, variables, version=version)
    return path


def checked(recording: Recording) -> None:
    """One pair is found, at 50 Hz, with its numbers to the bit."""
    assert recording.rate_hz == 50.0
    (pair,), _ = propose_pair(recording)
    assert np.array_equal(recording[pair[0]].values, TARGET)
    assert np.array_equal(recording[pair[1]].values, MEASURED)


@pytest.mark.parametrize("version", ["v7", "v7.3"])
@pytest.mark.parametrize(("even", "storage"), [(False, False), (True, False), (False, True), (True, True)])
def test_timeseries_are_read_with_their_time(tmp_path: Path, version: str, even: bool, storage: bool) -> None:
    target, measured = (
        timeseries(v, n, even=even, storage=storage)
        for v, n in ((TARGET[:, None], "xt"), (MEASURED.reshape(1, 1, -1), "xm"))
    )
    recording = read_recording(written(tmp_path, version, cmd=target, fbk=measured))
    checked(recording)
    assert [(c.path.split("(")[0], c.unit) for c in recording.channels] == [
        ("cmd.Time", "s"),
        ("cmd.Data", "mm"),
        ("fbk.Time", "s"),
        ("fbk.Data", "mm"),
    ]
    assert [c.name for c in recording.channels][1::2] == ["xt", "xm"]


@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_tables_and_timetables_are_read_with_their_units(tmp_path: Path, version: str) -> None:
    recording = read_recording(written(tmp_path, version, T=table(units=("s", "mm", "mm"))))
    checked(recording)
    assert [(c.path, c.unit) for c in recording.channels] == [("T.time", "s"), ("T.target", "mm"), ("T.measured", "mm")]
    for even in (False, True):
        recording = read_recording(written(tmp_path, version, TT=timetable(even=even)))
        checked(recording)
        assert [(c.path, c.unit) for c in recording.channels] == [
            ("TT.Time", "s"),
            ("TT.target", "mm"),
            ("TT.measured", "mm"),
        ]


@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_what_holds_objects_is_walked(tmp_path: Path, version: str) -> None:
    output = MatlabOpaque(
        {
            "tout": T[:, None],
            "xt": timeseries(TARGET[:, None]),
            "xm": timeseries(MEASURED[:, None]),
        },
        "Simulink.SimulationOutput",
    )
    checked(read_recording(written(tmp_path, version, out=output)))
    recording = read_recording(
        written(
            tmp_path, version, c=cells(timeseries(TARGET[:, None], "target"), timeseries(MEASURED[:, None], "measured"))
        )
    )
    checked(recording)
    assert recording.channels[3].path == "c{2}.Data"
    recording = read_recording(written(tmp_path, version, run=struct_of(log=table(), note=text("Prüfung 时间"))))
    checked(recording)
    assert recording.channels[0].path == "run.log.time"


def test_dates_of_each_row_are_its_time(tmp_path: Path) -> None:
    # Milliseconds since 1970, and what a double cannot hold of them.
    stamps = 1.6e12 + 1e3 * T[:, None] + 1j * 0.0
    filed = MatlabOpaque({"data": stamps, "tz": text(""), "fmt": text("")}, "datetime")
    path = written(tmp_path, when=filed, target=TARGET[:, None], measured=MEASURED[:, None])
    checked(read_recording(path))


@pytest.mark.parametrize("version", ["v7", "v7.3"])
@pytest.mark.parametrize("late_ms", [60.0, 60.0 + 60j])
def test_channels_with_dates_of_their_own_are_put_on_one_clock(tmp_path: Path, version: str, late_ms: complex) -> None:
    def dates(late_ms: complex) -> MatlabOpaque:
        stamps = 1.7092944e12 + 1e3 * T[:, None] + late_ms
        return MatlabOpaque({"data": stamps, "tz": text(""), "fmt": text("")}, "datetime")

    path = written(
        tmp_path,
        version,
        t_target=dates(0j),
        target=TARGET[:, None],
        t_measured=dates(late_ms),
        measured=MEASURED[:, None],
    )
    recording = read_chosen(path).recording
    (told,) = [note for note in map(coded, recording.notes) if note.code == "one_clock"]
    late_s = (late_ms.real + late_ms.imag) / 1e3
    assert told.values[0] == pytest.approx(late_s, abs=1e-9)
    n = round(50 * late_s)
    assert recording["target"].values == pytest.approx(TARGET[n:], abs=1e-12)
    assert recording["measured"].values == pytest.approx(MEASURED[:-n], abs=1e-12)


def test_what_stays_unreadable_names_the_object_and_what_to_export(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    empty = MatlabOpaque({"Name": text("logsout"), "Storage_": np.zeros((0, 0))}, "Simulink.SimulationData.Dataset")
    recording = read_recording(written(tmp_path, logsout=empty, x=TARGET[:, None]), rate_hz=50)
    (note,) = (note for note in recording.notes if isinstance(note, Said) and note.code == "unread_object")
    assert "'logsout' is a MATLAB object (Simulink.SimulationData.Dataset)" in note
    assert "save logsout{1}.Values.Time and logsout{1}.Values.Data" in note
    monkeypatch.setattr(matlab, "find_spec", lambda name: None)
    without = matlab.contents("MATLAB v5", {"ts": matlab.Opaque("timeseries", True)})
    assert "pip install 'rthstrack[matlab]'" in without.notes[0]
    assert "ts.Time" in without.notes[0]


def test_what_scipy_warns_of_is_no_note(tmp_path: Path) -> None:
    path = written(tmp_path, a=timeseries(TARGET[:, None]), b=timeseries(MEASURED[:, None]), c=np.arange(3.0)[:, None])
    assert read_recording(path).notes == ()


def test_one_variable_that_cannot_be_read_leaves_the_others(tmp_path: Path) -> None:
    path = tmp_path / "file.mat"
    scipy.io.savemat(path, {"x": TARGET, "y": MEASURED, "word": "abcd"})
    whole = bytearray(path.read_bytes())
    # The class of the variable's array becomes one that there is not.
    whole[whole.find(b"word") - 28] = 77
    path.write_bytes(whole)
    recording = read_recording(path, rate_hz=50)
    assert np.array_equal(recording["x"].values, TARGET)
    assert any("'word' cannot be read" in note for note in recording.notes)


def test_characters_of_other_scripts_are_no_damage(tmp_path: Path) -> None:
    path = tmp_path / "file.mat"
    scipy.io.savemat(path, {"x": TARGET, "y": MEASURED, "word": "Prüfstand 时间"})
    assert read_recording(path, rate_hz=50).notes == ()


def test_damaged_objects_end_in_one_line_or_in_a_reading(tmp_path: Path) -> None:
    chance = np.random.default_rng(2014)
    whole = written(tmp_path, T=table(), cmd=timeseries(TARGET[:, None])).read_bytes()
    n_errors = 0
    for _ in range(6):
        content = bytearray(whole)
        for at in chance.integers(128, len(whole), 3):
            content[at] ^= 1 << int(chance.integers(8))
        (tmp_path / "damaged.mat").write_bytes(content)
        n_errors += read_or_error(tmp_path / "damaged.mat") is None
    assert n_errors
