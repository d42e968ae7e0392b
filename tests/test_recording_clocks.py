"""Channels with times of their own: put on one clock, or refused; never compared by index without a word."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest
import scipy.io
from nptdms import ChannelObject, TdmsWriter

import rthstrack
from field_motion import GAIN, measured, table, target
from rthstrack.errors import RecordingError
from rthstrack.recording import on_one_clock, read_recording
from rthstrack.recording.chosen import read_chosen, read_two
from rthstrack.said import coded

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

N = 600
T = np.arange(N) / 100
#: Measured begins 50 ms after target, and is sampled 2.5 times as fast.
LATE = T + 0.05
FAST = np.arange(1400) / 250 + 0.05


def judged(path: Path, **options: Any) -> tuple[float, float, float, list[str]]:
    """Delay in ms, amplitude, rate and the notes' codes."""
    recording, rate_hz, ((asked, answered),), _ = read_chosen(path, **options)
    found = rthstrack.evaluate(
        recording.channel(asked).values,
        recording.channel(answered).values,
        rate_hz,
        estimator="least_squares",
        detrend="mean",
    )
    return 1e3 * float(found.delay_s), float(found.amplitude), rate_hz, [coded(n).code for n in recording.notes]


def stamps(time_s: Any) -> list[str]:
    first = datetime(2024, 3, 1, 10)
    return [f"{first + timedelta(seconds=round(float(t), 6)):%Y-%m-%d %H:%M:%S.%f}" for t in time_s]


LVM = """LabVIEW Measurement\t
Separator\tTab
Decimal_Separator\t.
X_Columns\t{kind}
***End_of_Header***\t
\t
Channels\t2
Samples\t600\t600
Date\t2024/03/01\t2024/03/01
Time\t10:00:00.0\t10:00:0{second}
X_Dimension\tTime\tTime
X0\t0.0000000000000000E+0\t{x0}
Delta_X\t0.010000\t0.010000
***End_of_Header***\t
"""


def lvm(path: Path, kind: str, *, second: str = "0.0", x0: str = "5.0000000000000000E-2", own: Any = LATE) -> Path:
    columns = {"Multi": [T, target(T), own, measured(T)], "One": [T, target(T), measured(T)]}
    names = {"Multi": "X_Value\ttarget\tX_Value\tmeasured", "One": "X_Value\ttarget\tmeasured"}
    rows = np.column_stack(columns.get(kind, [target(T), measured(T)]))
    text = LVM.format(kind=kind, second=second, x0=x0) + names.get(kind, "target\tmeasured") + "\tComment\n"
    path.write_text(text + "".join("\t".join(f"{v:.9g}" for v in row) + "\n" for row in rows))
    return path


def tdms(path: Path, measured_values: Any, *properties: dict[str, Any]) -> Path:
    with TdmsWriter(path) as writer:
        signals = (("A", "target", target(T)), ("B", "measured", measured_values))
        writer.write_segment([
            ChannelObject(group, name, values, properties=own)
            for (group, name, values), own in zip(signals, properties, strict=True)
        ])  # fmt: skip
    return path


def hdf5(path: Path, groups: dict[str, Any], attributes: dict[str, dict[str, float]] | None = None) -> Path:
    with h5py.File(path, "w") as file:
        for name, values in groups.items():
            file[name] = values
        for name, own in (attributes or {}).items():
            (file[name] if name else file).attrs.update(own)
    return path


def mat(path: Path, variables: dict[str, Any]) -> Path:
    scipy.io.savemat(path, variables)
    return path


def npz(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


DAY = np.datetime64("2024-03-01T10:00:00")
SHIFTED: dict[str, Callable[[Path], Path]] = {
    "csv, interleaved": lambda p: table(
        p / "a.csv", ["Time", "target", "Time", "measured"], [T, target(T), LATE, measured(T)]
    ),
    "csv, by name": lambda p: table(
        p / "a.csv", ["t_target", "t_measured", "target", "measured"], [T, LATE, target(T), measured(T)]
    ),
    "csv, without names": lambda p: table(p / "a.csv", None, [T, target(T), LATE, measured(T)]),
    "csv, with dates": lambda p: table(
        p / "a.csv", ["when", "target", "when then", "measured"], [stamps(T), target(T), stamps(LATE), measured(T)]
    ),
    "csv, Unix time": lambda p: table(
        p / "a.csv", ["Time", "target", "Time", "measured"], [1.7e9 + T, target(T), 1.7e9 + LATE, measured(T)], "%.6f"
    ),
    "mat, structs": lambda p: mat(
        p / "a.mat", {"cmd": {"time": T, "data": target(T)}, "fbk": {"time": LATE, "data": measured(T)}}
    ),
    "mat, t0": lambda p: mat(
        p / "a.mat", {"fs": 100.0, "cmd": {"t0": 0.0, "data": target(T)}, "fbk": {"t0": 0.05, "data": measured(T)}}
    ),
    "npz": lambda p: npz(p / "a.npz", t_target=T, t_measured=LATE, target=target(T), measured=measured(T)),
    "hdf5, attributes": lambda p: hdf5(
        p / "a.h5",
        {"target": target(T), "measured": measured(T)},
        {"": {"fs": 100.0}, "target": {"t0": 0.0}, "measured": {"t0": 0.05}},
    ),
    "tdms, offset": lambda p: tdms(
        p / "a.tdms",
        measured(T),
        {"wf_increment": 0.01, "wf_start_offset": 0.0},
        {"wf_increment": 0.01, "wf_start_offset": 0.05},
    ),
    "tdms, start": lambda p: tdms(
        p / "a.tdms",
        measured(T),
        {"wf_increment": 0.01, "wf_start_time": DAY},
        {"wf_increment": 0.01, "wf_start_time": DAY + np.timedelta64(50, "ms")},
    ),
    "lvm, a time column each": lambda p: lvm(p / "a.lvm", "Multi"),
    "lvm, one time column": lambda p: lvm(p / "a.lvm", "One"),
    "lvm, none": lambda p: lvm(p / "a.lvm", "No"),
    "lvm, a time column each and another time of day": lambda p: lvm(
        p / "a.lvm", "Multi", second="0.05", x0="0.0000000000000000E+0", own=T
    ),
    "csv, times behind their channels": lambda p: table(
        p / "a.csv", ["measured", "Time", "target", "Time"], [measured(T), LATE, target(T), T]
    ),
    "csv, dates behind their channels": lambda p: table(
        p / "a.csv", ["measured", "when", "target", "when then"], [measured(T), stamps(LATE), target(T), stamps(T)]
    ),
    "csv, dates side by side": lambda p: table(
        p / "a.csv", ["t_target", "t_measured", "target", "measured"], [stamps(T), stamps(LATE), target(T), measured(T)]
    ),
    "lvm, another time of day": lambda p: lvm(p / "a.lvm", "No", second="0.05", x0="0.0000000000000000E+0"),
}


@pytest.mark.parametrize("kind", SHIFTED)
def test_measured_that_begins_later_is_put_on_the_clock_of_target(tmp_path: Path, kind: str) -> None:
    delay_ms, amplitude, rate_hz, codes = judged(SHIFTED[kind](tmp_path))
    assert (delay_ms, amplitude, rate_hz) == (pytest.approx(62, abs=1e-4), pytest.approx(GAIN, abs=1e-5), 100.0)
    assert "one_clock" in codes


FASTER: dict[str, Callable[[Path], Path]] = {
    "csv, without names": lambda p: table(p / "a.csv", None, [T, target(T), FAST[: len(T)], measured(FAST[: len(T)])]),
    "csv, of other length": lambda p: table(
        p / "a.csv", ["Time", "target", "Time", "measured"], [T, target(T), FAST, measured(FAST)]
    ),
    "mat": lambda p: mat(
        p / "a.mat", {"cmd": {"time": T, "data": target(T)}, "fbk": {"time": FAST, "data": measured(FAST)}}
    ),
    "hdf5": lambda p: hdf5(
        p / "a.h5", {"ctrl/time": T, "ctrl/target": target(T), "daq/time": FAST, "daq/measured": measured(FAST)}
    ),
    "mat, fs": lambda p: mat(
        p / "a.mat",
        {"cmd": {"fs": 100.0, "data": target(T)}, "fbk": {"fs": 250.0, "t0": 0.05, "data": measured(FAST)}},
    ),
    "tdms": lambda p: tdms(
        p / "a.tdms",
        measured(FAST),
        {"wf_increment": 0.01, "wf_start_offset": 0.0},
        {"wf_increment": 0.004, "wf_start_offset": 0.05},
    ),
}


@pytest.mark.parametrize("kind", FASTER)
def test_channels_of_other_rates_are_judged_on_the_slower_clock(tmp_path: Path, kind: str) -> None:
    delay_ms, amplitude, rate_hz, codes = judged(FASTER[kind](tmp_path))
    assert (delay_ms, amplitude) == (pytest.approx(12, abs=1e-4), pytest.approx(GAIN, abs=1e-5))
    assert rate_hz == 100.0
    assert "one_clock" in codes


def test_a_shift_by_part_of_a_sample_is_interpolated(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", ["time_cmd", "cmd", "time_fbk", "fbk"], [T, target(T), T + 0.0537, measured(T)])
    delay_ms, amplitude, _, _ = judged(path)
    assert delay_ms == pytest.approx(65.7, abs=1e-3)
    assert amplitude == pytest.approx(GAIN, abs=1e-5)


def test_clocks_that_run_apart_by_their_stamps_are_told_in_ppm(tmp_path: Path) -> None:
    slow = np.arange(N) / 100.02
    path = table(
        tmp_path / "a.csv", ["Time", "target", "Time", "measured"], [T, target(T), slow, measured(slow)], "%.12g"
    )
    recording = read_chosen(path).recording
    (told,) = [note for note in map(coded, recording.notes) if note.code == "clock_rates"]
    assert told.values == pytest.approx([200e-6], rel=1e-6)
    assert "200 ppm faster" in told
    assert judged(path)[0] == pytest.approx(12, abs=1e-3)


def test_whose_time_it_is_must_be_told_where_nothing_tells(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", ["t1", "t2", "target", "measured"], [T, LATE, target(T), measured(T)])
    with pytest.raises(
        RecordingError, match=r"'t1' and time column 't2' begin 50 ms apart, and no name tells"
    ) as caught:
        read_chosen(path)
    assert caught.value.code == "whose_time"
    assert judged(path, time="t1")[0] == pytest.approx(12, abs=1e-4)
    assert "time_not_followed" in judged(path, rate_hz=100)[3]


def test_a_rate_that_is_given_does_not_take_the_channels_begins_away(tmp_path: Path) -> None:
    path = SHIFTED["csv, interleaved"](tmp_path)
    assert judged(path, rate_hz=100)[0] == pytest.approx(62, abs=1e-4)
    # Stamps that say another rate are not followed at all, and that is told.
    delay_ms, _, _, codes = judged(path, rate_hz=200)
    assert delay_ms == pytest.approx(6, abs=1e-4)
    assert codes.count("rate_not_followed") == 2


def test_two_clocks_of_the_same_samples_are_one_and_the_other_is_told(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", ["Time", "Total Time", "target", "measured"], [T, T + 120, target(T), measured(T)])
    delay_ms, _, _, codes = judged(path)
    assert delay_ms == pytest.approx(12, abs=1e-4)
    assert "time_not_followed" in codes


def test_another_kind_of_time_between_the_channels_is_asked_about(tmp_path: Path) -> None:
    columns = [T, target(T), T + 0.5, measured(T)]
    path = table(tmp_path / "a.csv", ["Time", "target", "Total Time", "measured"], columns)
    with pytest.raises(RecordingError, match="may be of the same samples or each of another channel") as caught:
        read_chosen(path)
    assert caught.value.code == "whose_time"
    assert judged(path, time="Time")[0] == pytest.approx(12, abs=1e-4)


def test_dates_of_one_channel_and_seconds_of_another_are_no_common_clock(tmp_path: Path) -> None:
    columns = [stamps(T), target(T), LATE, measured(T)]
    path = table(tmp_path / "a.csv", ["when", "target", "Time", "measured"], columns)
    with pytest.raises(RecordingError, match="may be of the same samples or each of another channel") as caught:
        read_chosen(path)
    assert caught.value.code == "whose_time"
    # Side by side they are of the same samples.
    path = table(tmp_path / "b.csv", ["when", "Time", "target", "measured"], [stamps(T), T, target(T), measured(T)])
    assert judged(path)[0] == pytest.approx(12, abs=1e-4)


def test_one_time_chosen_for_all_is_said_to_pass_over_a_channels_own(tmp_path: Path) -> None:
    path = SHIFTED["csv, by name"](tmp_path)
    notes = [coded(note) for note in read_chosen(path, time="t_target").recording.notes]
    (told,) = [note for note in notes if note.code == "time_not_followed"]
    assert told.values == pytest.approx([0.05])
    assert "'measured' may have time column 't_measured', which begins 50 ms later" in told


def test_times_in_other_groups_that_contradict_each_other_are_told(tmp_path: Path) -> None:
    other = {"a": {"time": T, "load": T**2}, "c": {"time": T / 2, "acc": T**2}}
    path = mat(tmp_path / "a.mat", {**other, "b": {"target": target(T), "measured": measured(T)}})
    with pytest.raises(RecordingError, match=r"'a.time' says 100 Hz, but time column 'c.time' 200 Hz"):
        read_chosen(path)


def test_the_files_rate_is_that_of_channels_without_a_time(tmp_path: Path) -> None:
    spectrum = {"T": np.linspace(0.05, 4, 80), "Sa": np.cos(np.arange(80)), "Sd": np.sin(np.arange(80))}
    path = mat(tmp_path / "a.mat", {**spectrum, "fs": 100.0, "target": target(T), "measured": measured(T)})
    assert judged(path)[0::2][:2] == (pytest.approx(12, abs=1e-4), 100.0)


def test_rates_of_labviews_channels_are_each_its_own(tmp_path: Path) -> None:
    path = lvm(tmp_path / "a.lvm", "No", x0="0.0")
    path.write_text(path.read_text().replace("Delta_X\t0.010000\t0.010000", "Delta_X\t0.010000\t0.020000"))
    assert [c.time.rate_hz for c in read_recording(path).channels if c.time] == [100.0, 50.0]


def test_channels_without_a_time_in_common_are_refused(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", ["Time", "target", "Time", "measured"], [T, target(T), T + 100, measured(T)])
    with pytest.raises(RecordingError, match=r"the channels have no time in common: 'target' 0 to 5\.99 s") as caught:
        read_chosen(path)
    assert caught.value.code == "no_common_time"


def test_an_uneven_clock_is_refused_and_resampled_by_its_own_stamps(tmp_path: Path) -> None:
    uneven = LATE + 0.002 * np.sin(np.arange(N))
    path = table(tmp_path / "a.csv", ["Time", "target", "Time", "measured"], [T, target(T), uneven, measured(uneven)])
    with pytest.raises(RecordingError, match="'measured': time column 'Time' is not uniform"):
        read_chosen(path)
    assert judged(path, resample_hz=100)[0] == pytest.approx(12, abs=1e-2)


def test_a_time_column_is_never_judged(tmp_path: Path) -> None:
    path = table(
        tmp_path / "a.csv", ["t_target", "t_measured", "target", "measured"], [T, LATE, target(T), measured(T)]
    )
    assert read_chosen(path).pairs == [("target", "measured")]
    with pytest.raises(RecordingError, match="'t_target' holds the time, and no motion"):
        read_chosen(path, targets=["t_target"], measured=["measured"])


def test_the_rate_is_that_of_the_time_beside_the_channels(tmp_path: Path) -> None:
    time_s = np.arange(2000) / 200
    for n_periods in (80, 2000, 5000):
        spectrum = {name: np.cos(np.arange(n_periods) ** 1.1) for name in ("Sa", "Sv", "Sd", "S1", "S2")}
        spectrum["T"] = np.linspace(0.02, 4, n_periods)
        response = {"Time": time_s, "target": target(time_s), "measured": measured(time_s)}
        path = mat(tmp_path / "a.mat", {"spectrum": spectrum, "Response": response})
        assert judged(path)[0::2][:2] == (pytest.approx(12, abs=1e-4), 200.0)


def test_the_time_of_other_channels_is_not_followed(tmp_path: Path) -> None:
    path = mat(tmp_path / "a.mat", {"t": T[:300], "load": T[:300] ** 2, "target": target(T), "measured": measured(T)})
    with pytest.raises(RecordingError, match=r"'t' has 300 samples, this channel 600"):
        read_chosen(path)


def test_a_recording_says_that_its_channels_have_clocks_of_their_own(tmp_path: Path) -> None:
    recording = read_recording(SHIFTED["csv, interleaved"](tmp_path))
    assert [coded(note).code for note in recording.notes] == ["own_times"]
    assert [c.time.start_s for c in recording.channels if c.time and not c.is_time] == [0.0, 0.05]
    together = on_one_clock(recording, ("target", "measured"))
    assert together["measured"].values == pytest.approx(measured(T)[:-5], abs=1e-7)
    assert together["target"].values == pytest.approx(target(T)[5:], abs=1e-7)
    assert (together.rate_hz, together.start_s) == (100.0, 0.05)


def test_a_cut_is_made_on_the_common_clock(tmp_path: Path) -> None:
    recording = read_chosen(FASTER["mat"](tmp_path), start_s=1.0, end_s=2.0).recording
    assert recording.start_s == pytest.approx(1.05)
    assert recording["cmd.data"].values == pytest.approx(target(T)[105:205], abs=1e-9)
    assert len(recording["fbk.data"].values) == 100


# ---- two files ----


def test_two_files_are_judged_on_the_clock_they_have_in_common(tmp_path: Path) -> None:
    control = table(tmp_path / "control.csv", ["time", "xt"], [T, target(T)])
    daq = table(tmp_path / "daq.csv", ["Time", "xm"], [FAST, measured(FAST)])
    found = read_two((str(control), "xt"), (str(daq), "xm"))
    assert "clocks_assumed" in [coded(note).code for note in found.recording.notes]
    asked, answered = (found.recording.channel(one).values for one in found.pairs[0])
    tracking = rthstrack.evaluate(asked, answered, found.rate_hz, estimator="least_squares", detrend="mean")
    assert 1e3 * tracking.delay_s == pytest.approx(12, abs=1e-4)
    dated = [table(tmp_path / f"{i}.csv", ["when", "x"], [stamps(t), x]) for i, (t, x) in
             enumerate(((T, target(T)), (T + 0.2, measured(T + 0.2))))]  # fmt: skip
    found = read_two((str(dated[0]), "x"), (str(dated[1]), "x"))
    assert "clocks_assumed" not in [coded(note).code for note in found.recording.notes]
    asked, answered = (found.recording.channel(one).values for one in found.pairs[0])
    tracking = rthstrack.evaluate(asked, answered, found.rate_hz, estimator="least_squares", detrend="mean")
    assert 1e3 * tracking.delay_s == pytest.approx(12, abs=1e-4)
    with pytest.raises(RecordingError, match="the two files have no clock in common") as caught:
        read_two((str(control), "xt"), (str(dated[1]), "x"))
    assert caught.value.code == "no_common_clock"


def test_two_files_without_a_clock_are_aligned_only_on_request(tmp_path: Path) -> None:
    control = table(tmp_path / "control.csv", ["xt", "f"], [target(T), T**2])
    daq = table(tmp_path / "daq.csv", ["xm", "f"], [measured(T + 0.3), T**3])
    two = (str(control), "xt"), (str(daq), "xm")
    with pytest.raises(RecordingError, match="the two files have no clock in common"):
        read_two(*two, rate_hz=100)
    found = read_two(*two, rate_hz=100, align=True)
    assert "clocks_aligned" in [coded(note).code for note in found.recording.notes]
    asked, answered = (found.recording.channel(one).values for one in found.pairs[0])
    # To half a sample; the delay is lost.
    tracking = rthstrack.evaluate(asked, answered, 100, estimator="least_squares", detrend="mean")
    assert abs(tracking.delay_s) <= 0.005
    assert tracking.amplitude == pytest.approx(GAIN, abs=1e-4)
