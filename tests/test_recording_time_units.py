"""In which unit a time column counts: stated, known by its size, guessed and said so, or asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from field_motion import GAIN, measured, table, target
from rthstrack.cli import main
from rthstrack.errors import RecordingError, SettingError
from rthstrack.recording import read_recording
from rthstrack.recording.chosen import read_chosen
from rthstrack.said import coded

if TYPE_CHECKING:
    from pathlib import Path

N = 600
I = np.arange(N)
T = I / 100


def written(folder: Path, name: str | None, stamps: Any, layout: str = "%.15g") -> Path:
    head = None if name is None else [name, "target", "measured"]
    return table(folder / "a.csv", head, [stamps, target(T), measured(T)], layout)


@pytest.mark.parametrize(
    ("name", "stamps", "code"),
    [
        ("time", I * 10, "time_unit_guessed"),
        ("time", I * 10_000, "time_unit_guessed"),
        (None, I * 10, "time_unit_guessed"),
        ("Time", I * 5 * 2 + 3000, "time_unit_guessed"),
        ("Time", T / 86_400, "time_unit_guessed"),
        ("Time", 45_000.4 + T / 86_400, "time_unit_guessed"),
        ("Date", 45_000.4 + T / 86_400, "time_unit_guessed"),
        ("timestamp", 1.7e12 + I * 10, "time_unit"),
        ("timestamp", 1.7e15 + I * 10_000, "time_unit"),
        ("timestamp", 1.7e9 + T, None),
        ("time_us", I * 10_000, None),
        ("Time (ms)", I * 10, None),
        ("time", T, None),
    ],
)
def test_time_is_counted_in_what_makes_it_a_rigs_record_and_a_guess_is_said(
    tmp_path: Path, name: str | None, stamps: Any, code: str | None
) -> None:
    recording = read_chosen(written(tmp_path, name, stamps)).recording
    assert recording.rate_hz == pytest.approx(100, rel=1e-6)
    codes = [coded(note).code for note in recording.notes]
    assert [one for one in codes if one.startswith("time_unit")] == ([code] if code else [])


@pytest.mark.parametrize(
    ("name", "stamps", "said"),
    [
        ("Time (ms)", T, r"says that it is in ms, which makes 100000 Hz and 0.00599 s in all; in s it would be 100 Hz"),
        ("Time (s)", I * 10, r"says that it is in s, which makes 0.1 Hz and 5990 s in all; in ms it would be 100 Hz"),
        ("time", I, r"counts in ones: in s that is 1 Hz, in ms 1000 Hz, and it may count samples"),
        ("time", I * 100, r"does not state its unit: it may be 10 Hz \(in ms\) or 10000 Hz \(in µs\)"),
    ],
)
def test_where_it_can_be_either_it_is_asked(tmp_path: Path, name: str, stamps: Any, said: str) -> None:
    n = N if name != "time" or stamps[1] != 100 else 20_000
    stamps = np.arange(n) * (stamps[1] - stamps[0])
    path = table(tmp_path / "a.csv", [name, "target", "measured"], [stamps, np.sin(stamps), np.cos(stamps)], "%.15g")
    with pytest.raises(RecordingError, match=said) as caught:
        read_chosen(path)
    assert caught.value.code == "time_unit"
    assert read_chosen(path, units={name: "s"} if name == "Time (ms)" else {name: "ms"}).rate_hz > 9


def test_a_step_without_a_unit_that_makes_no_rigs_rate_is_asked_about(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", dt=10.0, target=T, measured=T)
    (tmp_path / "a.csv").write_text("Sampling period: 10\ntarget,measured\n1,2\n2,3\n3,5\n")
    for name in ("a.npz", "a.csv"):
        with pytest.raises(RecordingError, match=r"states no unit: in s .* 0\.1 Hz, in ms .* 100 Hz") as caught:
            read_recording(tmp_path / name)
        assert caught.value.code == "time_unit"
        assert read_recording(tmp_path / name, rate_hz=100).rate_hz == 100
    (tmp_path / "a.csv").write_text("Sampling period: 10 s\ntarget,measured\n1,2\n2,3\n3,5\n")
    assert read_recording(tmp_path / "a.csv").rate_hz == 0.1


@pytest.mark.parametrize(("bound", "first"), [(2**16, 62000), (2**32, 2**32 - 3000), (2**16, -2000)])
def test_a_counter_that_begins_anew_is_counted_on(tmp_path: Path, bound: int, first: int) -> None:
    low = -bound // 2 if first < 0 else 0
    ms = low + (first - low + 10 * I + (bound // 2 if first < 0 else 0)) % bound
    assert (np.diff(ms) < 0).sum() == 1
    recording = read_recording(written(tmp_path, "Time (ms)", ms, "%d"))
    assert recording.rate_hz == 100.0
    assert "begins anew at" in recording.rate_source
    # A second acquisition that begins at zero is no counter.
    with pytest.raises(RecordingError, match="1 step"):
        read_recording(written(tmp_path, "Time (ms)", 10 * (I % 300), "%d"))


def test_dates_that_are_rounded_say_which_rates_they_allow(tmp_path: Path) -> None:
    rows = "".join(f"10:00:{i // 100:02d},{i % 7},{i % 5}\n" for i in range(800))
    (tmp_path / "a.csv").write_text("Time,target,measured\n" + rows)
    (told,) = [note for note in map(coded, read_recording(tmp_path / "a.csv").notes) if note.code == "rounded_time"]
    low_hz, high_hz = told.values
    assert low_hz < 100 < high_hz


def test_the_verdict_says_that_the_unit_is_a_guess(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", str(written(tmp_path, "time", I * 10))]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("measured lags target by 12 ms")
    assert first.endswith(", if the time is in ms")


@pytest.mark.parametrize(("name", "selector"), [("time", "time"), (None, "#0")])
def test_a_scale_or_a_unit_of_a_time_column_is_followed(tmp_path: Path, name: str | None, selector: str) -> None:
    path = written(tmp_path, name, I * 10)
    for options in ({"scale": {selector: 0.001}}, {"units": {selector: "ms"}}):
        found = read_chosen(path, **options)
        assert found.rate_hz == 100
        assert not any(coded(note).code == "time_unit_guessed" for note in found.recording.notes)
    assert read_chosen(path, scale={selector: 0.0005}).rate_hz == 200


def test_a_guess_is_told_of_a_channels_own_time_too(tmp_path: Path) -> None:
    fast = np.arange(1500) * 4
    columns = [I * 10, target(T), fast + 50, measured(fast / 1000)]
    path = table(tmp_path / "a.csv", ["t", "target", "t", "measured"], columns, "%.15g")
    notes = [coded(note) for note in read_chosen(path).recording.notes]
    told = [note for note in notes if note.code == "time_unit_guessed"]
    assert sorted(note.values for note in told) == [(1e-3, pytest.approx(100)), (1e-3, pytest.approx(250))]
    doubted = table(tmp_path / "b.csv", ["t", "target", "t", "measured"], [T, target(T), I, measured(T)], "%.15g")
    with pytest.raises(RecordingError, match="counts in ones"):
        read_chosen(doubted)


def test_a_step_that_was_rounded_before_it_was_added_up_is_asked_about(tmp_path: Path) -> None:
    notes = [coded(note) for note in read_chosen(written(tmp_path, "time", I * 0.000977)).recording.notes]
    (note,) = [note for note in notes if note.code == "rounded_step"]
    assert note.values == pytest.approx((1 / 0.000977, 1024), rel=1e-5)
    assert "is it 1024 Hz, its step rounded?" in note
    for step in (0.001, 1 / 1024, 0.003, 0.0025):
        notes = [coded(note) for note in read_chosen(written(tmp_path, "time", I * step)).recording.notes]
        assert not any(note.code == "rounded_step" for note in notes)


@pytest.mark.parametrize(
    ("name", "stamps", "said"),
    [
        (None, (I * 0.01) % 4.0, "'column 0', which may be the time, is not uniform: 1 step"),
        (None, np.cumsum(0.01 + 0.004 * np.sin(I)), "'column 0', which may be the time, is not uniform: .* odd length"),
        ("T", np.where(I > 300, T - 1, T), "'T', which may be the time, is not uniform: 1 step"),
        ("ticks", I * 655 % 65_536, "'ticks', which may be the time, is not uniform: 5 step"),
        ("ticks", I * 655, "'ticks' rises evenly by 655, but no name or unit says that it is the time"),
        (None, np.where(I == 7, np.inf, T), "'column 0', which may be the time, has 1 of 600 stamps missing"),
    ],
)
def test_a_column_that_is_nearly_a_time_is_named_with_its_defect(
    tmp_path: Path, name: str | None, stamps: Any, said: str
) -> None:
    with pytest.raises(RecordingError, match=said):
        read_chosen(written(tmp_path, name, stamps))


@pytest.mark.filterwarnings("error")
def test_infinite_samples_make_no_noise(tmp_path: Path) -> None:
    x, y = measured(T), np.full(N, np.inf)
    x[100:103], x[200] = np.inf, -np.inf
    columns = [np.where(I > 596, np.inf, T), target(T), x, y]
    path = table(tmp_path / "a.csv", ["T", "target", "measured", "load"], columns)
    with pytest.raises(RecordingError, match="no sampling rate"):
        read_chosen(path)
    assert read_chosen(path, rate_hz=100, fill=5).pairs == [("target", "measured")]


# ---- units of channels ----


def lengths(folder: Path, names: list[str], factors: tuple[float, float]) -> Path:
    return table(folder / "a.csv", ["time", *names], [T, factors[0] * target(T), factors[1] * measured(T)], "%.15g")


def test_a_channel_is_found_without_its_unit_or_with_it_in_another_form(tmp_path: Path) -> None:
    recording = read_chosen(lengths(tmp_path, ["target (mm)", "measured_mm"], (1, 1))).recording
    for selector in ("target", "Target [mm]", "target_mm", "target, mm"):
        assert recording[selector].name == "target (mm)"
        assert recording[selector].unit == "mm"
    assert recording["measured"].name == "measured_mm"
    with pytest.raises(RecordingError, match=r"no channel 'target \[kN\]'"):
        recording["target [kN]"]
    both = read_chosen(lengths(tmp_path, ["disp (mm)", "disp (kN)"], (1, 1)), targets=["#1"], measured=["#2"]).recording
    with pytest.raises(RecordingError, match="'disp' names 2 channels"):
        both["disp"]
    assert both["disp [kN]"].name == "disp (kN)"


@pytest.mark.parametrize(("names", "factors"), [
    (["target (mm)", "measured (m)"], (1, 1e-3)),
    (["target (m)", "measured (mm)"], (1e-3, 1)),
    (["target (in)", "measured (mm)"], (1 / 25.4, 1)),
])  # fmt: skip
def test_stated_units_are_converted_to_those_of_target_and_said(
    tmp_path: Path, names: list[str], factors: tuple[float, float]
) -> None:
    recording = read_chosen(lengths(tmp_path, names, factors)).recording
    assert recording[names[1]].values == pytest.approx(factors[0] * measured(T), rel=1e-12, abs=1e-15)
    assert recording[names[1]].unit == recording[names[0]].unit
    assert "converted" in [coded(note).code for note in recording.notes]


@pytest.mark.parametrize("form", ["{} / {}", "{}, {}", "{} {}"])
def test_a_unit_stands_behind_a_slash_a_comma_or_a_blank_too(tmp_path: Path, form: str) -> None:
    names = ["Time", form.format("target", "mm"), form.format("measured", "cm")]
    path = table(tmp_path / "a.tsv", names, [T, target(T), measured(T)])
    path.write_text(path.read_text().replace(", ", "\x00").replace(",", "\t").replace("\x00", ", "))
    recording = read_chosen(path, targets=["target"], measured=["measured"]).recording
    assert [c.unit for c in recording.channels] == [None, "mm", "mm"]
    assert recording.channels[2].values == pytest.approx(10 * measured(T), abs=1e-6)


def test_a_channel_that_is_scaled_is_not_converted(tmp_path: Path) -> None:
    path = lengths(tmp_path, ["target (mm)", "measured (m)"], (1, 1e-3))
    recording = read_chosen(path, scale={"measured": 1000.0}).recording
    assert recording["measured"].values == pytest.approx(measured(T), rel=1e-12, abs=1e-15)
    assert "converted" not in [coded(note).code for note in recording.notes]


def test_units_are_given_for_channels_that_state_none(tmp_path: Path) -> None:
    path = lengths(tmp_path, ["target", "measured"], (1, 1))
    recording = read_chosen(path, units={"": "mm"}).recording
    assert [c.unit for c in recording.channels] == [None, "mm", "mm"]
    path = lengths(tmp_path, ["target", "measured"], (1, 1e-3))
    recording = read_chosen(path, units={"target": "mm", "measured": "m"}).recording
    assert recording["measured"].values == pytest.approx(measured(T), rel=1e-12, abs=1e-15)
    with pytest.raises(SettingError, match=r"expected a unit .* found 'furlong'"):
        read_chosen(path, units={"": "furlong"})


def test_units_that_differ_by_a_thousand_without_being_stated_are_asked_about(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = lengths(tmp_path, ["target", "measured"], (1, 1e-3))
    assert main(["evaluate", str(path)]) == 0
    assert f"amplitude {GAIN / 1000:.3g}: is target in mm and measured in m?" in capsys.readouterr().out
    assert main(["evaluate", str(path), "--unit", "target=mm", "--unit", "measured=m"]) == 0
    assert "is target in mm" not in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["evaluate", str(path), "--unit", "measured=furlong"])
    assert "expected a unit" in capsys.readouterr().err
