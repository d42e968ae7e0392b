"""Which pair: names of controllers and languages, copies, candidates that both fit; asked for where nothing tells."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from field_motion import GAIN, measured, table, target
from rthstrack.cli import main
from rthstrack.errors import ChannelError
from rthstrack.recording import Channel, Recording, propose_pair
from rthstrack.recording.chosen import read_chosen
from rthstrack.units import units_from_names

if TYPE_CHECKING:
    from numpy.typing import NDArray

T = np.arange(600) / 100
CASES = Path(__file__).resolve().parents[2] / "shared" / "cases"


def recording_of(*names: str, rate_hz: float | None = 100.0, **values: NDArray[np.float64]) -> Recording:
    """A recording with channels of these names, each its own noise unless `values` has it (`c0`, `c1`, ...)."""
    rng = np.random.default_rng(1)
    units = units_from_names(list(names))
    channels = [
        Channel(name, name, units[i], values.get(f"c{i}", rng.standard_normal(len(T)))) for i, name in enumerate(names)
    ]
    return Recording("file.csv", "made", tuple(channels), rate_hz, "--rate", 0.0, ())


@pytest.mark.parametrize("names", [
    # The pair is the first two.
    ("Ch 1 Weg Sollwert", "Ch 1 Weg", "Ch 1 Kraft"),
    ("Sollweg", "Istweg", "Kraft"),
    ("Weg Soll (mm)", "Weg Ist (mm)", "Kraft (kN)"),
    ("Wegsoll", "Wegist"),
    ("Axial Displacement Command", "Axial Displacement", "Axial Force"),
    ("Axial Displacement Command", "Axial Displacement Feedback", "Axial Displacement Error", "Axial Force"),
    ("reference displacement", "displacement", "acceleration"),
    ("consigne (mm)", "mesure (mm)"),
    ("Déplacement consigne", "Déplacement mesuré", "Force mesurée"),
    ("comando", "medido"),
    ("Desplazamiento comandado", "Desplazamiento medido"),
    ("comando (mm)", "misurato (mm)"),
    ("目標変位", "計測変位", "荷重"),
    ("命令位移(mm)", "实测位移(mm)"),
    ("命令", "反馈"),
    ("指令変位", "応答変位"),
    ("목표 변위", "측정 변위"),
    ("Заданное перемещение", "Измеренное перемещение"),
    ("setpoint", "pv"),
    ("SP", "PV"),
    ("xt", "xm", "xc"),
    ("demand", "achieved"),
    ("target position (mm)", "current position (mm)", "motor current (A)"),
    ("cmd.data", "fbk.data"),
    ("Response.target", "Response.measured"),
    ("Command (V)", "LVDT (mm)"),
    ("Disp Cmd 1", "Disp Fbk 1"),
])  # fmt: skip
def test_pairs_are_known_by_the_words_of_controllers_and_languages(names: tuple[str, ...]) -> None:
    assert propose_pair(recording_of(*names))[0] == [names[:2]]


@pytest.mark.parametrize("names", [
    ("X command", "X feedback", "Y command", "Y feedback"),
    ("X.Cmd", "X.Fbk", "Y.Cmd", "Y.Fbk"),
    ("target.x", "measured.x", "target.y", "measured.y"),
    ("Horizontal_Target", "Horizontal_Meas", "Vertical_Target", "Vertical_Meas"),
])  # fmt: skip
def test_each_degree_of_freedom_is_paired_with_itself(names: tuple[str, ...]) -> None:
    assert propose_pair(recording_of(*names))[0] == [names[:2], names[2:]]


@pytest.mark.parametrize(("names", "said"), [
    (("target", "table disp measured", "actuator disp measured"), "'table disp measured', 'actuator disp measured'"),
    (("Target disp (mm)", "Table disp (mm)", "Actuator disp (mm)"), "be 'Table disp (mm)' or 'Actuator disp (mm)'"),
    (("target", "measured", "feedback"), "'target', 'measured', 'feedback'"),
    (("Command", "Table Feedback", "Actuator Feedback"), "'Table Feedback', 'Actuator Feedback'"),
    (("X command", "Y feedback"), "'X command', 'Y feedback'"),
    (("disp 1 cmd", "disp 2 fbk"), "'disp 1 cmd', 'disp 2 fbk'"),
    (("Response.Disp", "Response.Force"), "no two channels could be compared"),
])  # fmt: skip
def test_what_fits_twice_or_not_at_all_is_asked(names: tuple[str, ...], said: str) -> None:
    with pytest.raises(ChannelError) as caught:
        propose_pair(recording_of(*names))
    assert said in str(caught.value)


def test_who_leads_does_not_decide_which_is_target() -> None:
    late, early = measured(T), measured(T, -0.006)
    with pytest.raises(ChannelError, match=r"'a' and 'b' move alike .* but which is target cannot be told"):
        propose_pair(recording_of("a", "b", c0=target(T), c1=early))
    with pytest.raises(ChannelError, match="which is target cannot be told"):
        propose_pair(recording_of("a", "b", c0=late, c1=target(T)))
    # Behind it in the file and late.
    pairs, why = propose_pair(recording_of("a", "b", c0=target(T), c1=late))
    assert pairs == [("a", "b")]
    assert why.startswith("a guess, for no name tells: ")


@pytest.mark.parametrize("names", [("disp 1", "disp 2"), ("x1", "x2"), ("Disp North (mm)", "Disp South (mm)")])
def test_two_degrees_of_freedom_that_move_alike_are_no_pair(names: tuple[str, str]) -> None:
    with pytest.raises(ChannelError, match="may be two degrees of freedom"):
        propose_pair(recording_of(*names, c0=target(T), c1=measured(T)))


def test_what_was_not_compared_is_not_called_unlike() -> None:
    with pytest.raises(ChannelError, match="without a sampling rate none were compared"):
        propose_pair(recording_of("a", "b", rate_hz=None))
    with pytest.raises(ChannelError, match="no two channels could be compared"):
        propose_pair(recording_of("a"))
    with pytest.raises(ChannelError, match="no two channels move alike"):
        propose_pair(recording_of("a", "b"))


# ---- copies ----


def test_a_copy_in_single_precision_is_a_copy(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", time=T, target=target(T), feedback=target(T).astype(np.float32))
    with pytest.raises(ChannelError, match="'feedback' is an exact copy of 'target'"):
        read_chosen(tmp_path / "a.npz")
    # What a sensor adds, however little, is a measurement.
    noise = 1e-4 * np.sin(np.arange(len(T)) ** 2)
    np.savez(tmp_path / "a.npz", time=T, target=target(T), feedback=target(T) + noise)
    assert read_chosen(tmp_path / "a.npz").pairs == [("target", "feedback")]


def test_an_exact_copy_is_never_proposed() -> None:
    x, y = target(T), measured(T)
    with pytest.raises(ChannelError, match="'feedback' is an exact copy of 'command'") as caught:
        propose_pair(recording_of("command", "feedback", c0=x, c1=x))
    assert caught.value.code == "copy"
    assert propose_pair(recording_of("command", "feedback", "actual", c0=x, c1=x, c2=y))[0] == [("command", "actual")]
    assert propose_pair(recording_of("command", "command 2", "feedback", c0=x, c1=x, c2=y))[0] == [
        ("command", "feedback")
    ]
    # A log of a command twice and of what was measured, in any order.
    for order in ((x, x, y), (x, y, x), (y, x, x)):
        values = dict(zip(("c0", "c1", "c2"), order, strict=True))
        ((asked, answered),) = propose_pair(recording_of("a", "b", "c", **values))[0]
        assert values[f"c{'abc'.index(asked)}"] is x
        assert values[f"c{'abc'.index(answered)}"] is y
    # Twice and late: it may be measured that is there twice.
    with pytest.raises(ChannelError, match="which is target cannot be told"):
        propose_pair(recording_of("a", "b", "c", c0=x, c1=y, c2=y))
    inches = recording_of("command (mm)", "feedback (in)", c0=x, c1=x / 25.4)
    with pytest.raises(ChannelError, match="exact copy"):
        propose_pair(inches)
    with pytest.raises(ChannelError, match="'b' is an exact copy of 'a'"):
        propose_pair(recording_of("a", "b", c0=x, c1=x))


def test_a_copy_that_is_named_passes_no_limit_without_a_word(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = table(tmp_path / "a.csv", ["time", "target", "copy", "measured"], [T, target(T), target(T), measured(T)])
    named = ["evaluate", str(path), "--target", "target", "--measured", "copy"]
    assert main([*named, "--json"]) == 0
    (entry,) = json.loads(capsys.readouterr().out)["results"]
    assert entry["warning_codes"][0]["code"] == "copy"
    assert main([*named, "--limit-delay", "0.02", "--limit-amplitude", "0.05"]) == 3
    out = capsys.readouterr().out
    assert "but copy is an exact copy of target" in out.splitlines()[0]
    assert "no limit is passed: copy is an exact copy of target, so nothing was measured" in out
    limits = ["--limit-delay", "0.02", "--limit-amplitude", "0.05"]
    assert main(["evaluate", str(path), "--target", "target", "--measured", "measured", *limits]) == 0


# ---- folders and two files, as commands ----


def test_a_folder_is_taken_as_its_files_and_what_cannot_be_read_is_told_at_the_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = tmp_path / "runs"
    (runs / "more").mkdir(parents=True)
    for name in ("b.csv", "a.csv"):
        table(runs / name, ["time", "target", "measured"], [T, target(T), measured(T)])
    (runs / "0.mat").write_text("nothing\n")
    (runs / ".hidden").write_text("nothing\n")
    (runs / "x.tdms_index").write_bytes(b"TDSh")
    assert main(["evaluate", str(runs), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert [Path(entry["file"]).name for entry in found["results"]] == ["a.csv", "b.csv"]
    assert [Path(one["file"]).name for one in found["failures"]] == ["0.mat"]
    assert main(["channels", str(runs)]) == 1
    out, err = capsys.readouterr()
    assert out.count("likely pair") == 2
    assert err.count("\n") == 1
    assert main(["evaluate", str(runs / "more")]) == 1
    assert "a folder without recordings of its own; expected a file" in capsys.readouterr().err


def test_two_files_are_named_with_their_channels(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    control = table(tmp_path / "control.csv", ["time", "xt"], [T, target(T)])
    daq = table(tmp_path / "daq.csv", ["time", "xm"], [T + 0.05, measured(T + 0.05)])
    named = ["--target", f"{control}:xt", "--measured", f"{daq}:xm"]
    assert main(["evaluate", *named, "--json"]) == 0
    (entry,) = json.loads(capsys.readouterr().out)["results"]
    assert 1e3 * entry["trusted"]["delay_s"] == pytest.approx(12, abs=1e-4)
    assert main(["evaluate", *named]) == 0
    assert capsys.readouterr().out.splitlines()[0].endswith(", if both files count their time from one instant")
    for wrong in (["--target", "xt", "--measured", f"{daq}:xm"], named[:2], [*named, "--command", "c"], []):
        with pytest.raises(SystemExit) as stopped:
            main(["evaluate", *wrong])
        assert stopped.value.code == 2
    with pytest.raises(SystemExit):
        main(["evaluate", str(control), "--align"])


# ---- the shared cases of these kinds ----


@pytest.mark.skipif(not CASES.is_dir(), reason="../shared/cases is not beside the repository")
@pytest.mark.parametrize(("file", "delay_ms"), [
    ("two_time_columns.csv", 62),
    ("tdms_start_offset.tdms", 62),
    ("struct_time_by_majority.mat", 12),
    ("copied_demand_column.csv", 12),
    ("time_in_ms_no_header.txt", 12),
    ("command_named_measured_not.csv", 12),
    ("units_mm_and_m.csv", 12),
])  # fmt: skip
def test_a_shared_case_gives_its_right_value(file: str, delay_ms: float, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", str(CASES / file), "--json"]) == 0
    (entry,) = json.loads(capsys.readouterr().out)["results"]
    assert entry["rate_hz"] == 100
    assert 1e3 * entry["trusted"]["delay_s"] == pytest.approx(delay_ms, abs=2e-3)
    assert entry["trusted"]["amplitude"] == pytest.approx(GAIN, abs=1e-4)
