"""The monitor's log: what is in it, and what is left of it when the process is killed or the disk full."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from fake_live import FakeLive
from rthstrack._core import __version__
from rthstrack.cli import main
from rthstrack.errors import RecordingError
from rthstrack.live.log import Log, readings_path
from rthstrack.recording import propose_pair, read_recording
from rthstrack.recording.readers.arrow import END_OF_STREAM

RATE = 2000.0
# More processes killed with RTHSTRACK_KILLS=200, say.
N_KILLS = int(os.environ.get("RTHSTRACK_KILLS", "24"))


def a_live(n_actuators: int = 2) -> FakeLive:
    from fake_live import ALARMS, MONITOR, OUTPUTS, SOURCE

    monitor = dict.fromkeys(MONITOR) | {"rate_hz": RATE, "update_hz": 16.0, "n_actuators": n_actuators}
    return FakeLive(monitor, dict.fromkeys(SOURCE), dict.fromkeys(ALARMS), dict.fromkeys(OUTPUTS))


def a_log(live: Any, path: Path, said: list[str] | None = None) -> Log:
    say = ([] if said is None else said).append
    return Log(
        live,
        path,
        rate_hz=RATE,
        names=("north", "actuator 2"),
        units=("mm", None),
        settings={"monitor": {"window_s": 4.0}},
        say=say,
    )


def logged(path: Path, seconds: float) -> FakeLive:
    live = a_live()
    log = a_log(live, path)
    live.start()
    log.start()
    time.sleep(seconds)
    live.stop()
    log.stop()
    return live


# What is in it --------------------------------------------------------------------------------------------------------


def test_every_sample_and_reading_is_in_the_log_with_units_rate_and_settings(tmp_path: Path) -> None:
    path = tmp_path / "run.arrows"
    live = logged(path, 0.7)
    table = pa.ipc.open_stream(path).read_all()
    roles = ["target_1", "measured_1", "target_2", "measured_2"]
    assert table.column_names == ["index", "time_s", "counter", "filled", *roles]
    index = table["index"].to_numpy()
    np.testing.assert_array_equal(index, np.arange(live.sample))
    np.testing.assert_array_equal(table["counter"].to_numpy(), index + 7)
    np.testing.assert_array_equal(table["time_s"].to_numpy(), index / RATE)
    np.testing.assert_array_equal(table["filled"].to_numpy(), index % 100 == 99)
    for i, role in enumerate(roles):
        expected = np.sin(index / 50 + i // 2) * (0.9 if i % 2 else 1.0)
        np.testing.assert_array_equal(table[role].to_numpy(), expected)
    assert [table.schema.field(role).metadata for role in roles] == [{b"unit": b"mm"}] * 2 + [None] * 2
    metadata = table.schema.metadata
    assert (metadata[b"rate_hz"], metadata[b"program"], metadata[b"version"]) == (
        b"2000.0", b"rthstrack", __version__.encode(),
    )  # fmt: skip
    assert json.loads(metadata[b"settings"]) == {"monitor": {"window_s": 4.0}}
    assert metadata[b"started"].endswith(b"+00:00")
    readings = pa.ipc.open_stream(readings_path(path)).read_all()
    assert readings.num_rows == live.reading > 0
    assert readings.column_names == [
        "index", "time_s", "centre_s", "actuator", "actuator_number", "actuator_name",
        "amplitude", "delay_s", "phase_rad", "equivalent_frequency_hz",
        "amplitude_low", "amplitude_high", "delay_low_s", "delay_high_s", "valid", "reason", "reason_code",
        "reason_values", "received", "lost",
        "repeated", "reordered", "malformed", "alarms",
    ]  # fmt: skip
    assert readings.slice(0, 1).to_pylist()[0] | {"delay_low_s": None, "delay_high_s": None} == {
        "index": 0, "time_s": 0.0, "centre_s": -2.0, "actuator": 0, "actuator_number": 1,
        "actuator_name": "north", "amplitude": 0.5, "delay_s": 0.5, "phase_rad": 0.5,
        "equivalent_frequency_hz": 0.5, "amplitude_low": 0.4, "amplitude_high": 0.6, "delay_low_s": None,
        "delay_high_s": None, "valid": True, "reason": None, "reason_code": None, "reason_values": [],
        "received": 3, "lost": 3, "repeated": 3, "reordered": 3,
        "malformed": 3, "alarms": "delay",
    }  # fmt: skip
    assert live.log == [("writing", None)]


def test_evaluate_and_channels_take_a_log_without_flags(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "run.arrows"
    logged(path, 1.0)
    assert main(["channels", str(path), "--json"]) == 0
    (listing,) = json.loads(capsys.readouterr().out)["files"]
    assert (listing["format"], listing["rate_hz"]) == ("Arrow stream", RATE)
    assert listing["rate_source"] == "metadata 'rate_hz'"
    pairs = [{"actuator_number": i, "target": f"target_{i}", "measured": f"measured_{i}"} for i in (1, 2)]
    assert listing["proposed"] == pairs
    assert {channel["name"]: channel["unit"] for channel in listing["channels"]}["measured_1"] == "mm"
    assert main(["evaluate", str(path), "--json"]) == 0
    results = json.loads(capsys.readouterr().out)["results"]
    assert [result["published"]["amplitude"] for result in results] == pytest.approx([0.9, 0.9])
    assert main(["channels", str(readings_path(path))]) == 0


def test_pandas_reads_a_log(tmp_path: Path) -> None:
    path = tmp_path / "run.arrows"
    live = logged(path, 0.3)
    frame = pa.ipc.open_stream(path).read_pandas()
    assert len(frame) == live.sample
    assert frame["target_1"].dtype == np.float64


def test_a_gap_that_was_not_filled_is_nan_when_the_log_is_read(tmp_path: Path) -> None:
    path = tmp_path / "run.arrows"
    live = a_live()
    taken = live.take_samples

    def with_a_gap() -> dict[str, Any]:
        found = taken()
        return {key: values[(found["index"] < 200) | (found["index"] >= 300)] for key, values in found.items()}

    live.take_samples = with_a_gap  # type: ignore[method-assign]
    log = a_log(live, path)
    live.start()
    log.start()
    time.sleep(0.5)
    live.stop()
    log.stop()
    recording = read_recording(path)
    values = recording["target_1"].values
    assert np.flatnonzero(np.isnan(values)).tolist() == list(range(200, 300))
    np.testing.assert_allclose(values[300:], np.sin(np.arange(300, len(values)) / 50), rtol=1e-12)
    assert recording.rate_hz == RATE
    assert "100 samples in 1 gap(s) are not in the log and are NaN here" in recording.notes
    assert len(propose_pair(recording)[0]) == 2


def a_log_file(path: Path, index: np.ndarray, counter: np.ndarray) -> Path:
    """What a log of one actuator with these samples is."""
    live = a_live(1)
    target = np.sin(index[:, None] / 50)
    live.take_samples = lambda: {  # type: ignore[method-assign]
        "index": index, "time_s": index / RATE, "counter": counter, "filled": np.zeros(len(index), np.bool_),
        "target": target, "measured": 0.9 * target,
    }  # fmt: skip
    log = Log(live, path, rate_hz=RATE, names=("actuator 1",), units=(None,), settings={}, say=[].append)
    log._write()
    log.stop()
    return path


def test_a_pause_much_longer_than_the_test_is_no_damage(tmp_path: Path) -> None:
    # Two seconds, ten minutes of nothing, two seconds.
    index = np.concatenate([np.arange(4000), np.arange(4000) + 4000 + int(600 * RATE)])
    recording = read_recording(a_log_file(tmp_path / "run.arrows", index, index))
    values = recording["target_1"].values
    assert len(values) == index[-1] + 1
    assert np.isnan(values[4000 : 4000 + int(600 * RATE)]).all()
    np.testing.assert_allclose(values[index], np.sin(index / 50), rtol=1e-12)


def test_a_gap_that_no_memory_holds_is_one_line(tmp_path: Path) -> None:
    path = a_log_file(tmp_path / "run.arrows", np.array([0, 1, 1 << 40]), np.arange(3))
    with pytest.raises(RecordingError, match=r"its index goes from 0 to 1099511627776 in 3 samples: .* GiB"):
        read_recording(path)


def test_where_the_counter_falls_is_told_when_the_log_is_read(tmp_path: Path) -> None:
    index = np.arange(300)
    counter = np.concatenate([np.arange(100), np.arange(150), np.arange(50)])
    notes = read_recording(a_log_file(tmp_path / "run.arrows", index, counter)).notes
    assert any("its counter falls 2 time(s), at row 100, 250 from 0" in note for note in notes)
    notes = read_recording(a_log_file(tmp_path / "other.arrows", index, index)).notes
    assert not any("counter" in note for note in notes)


# Killed ---------------------------------------------------------------------------------------------------------------

CHILDREN = """
import os, sys, time
from pathlib import Path
from test_live_log import a_live, a_log

folder, n = Path(sys.argv[1]), int(sys.argv[2])
for i in range(n):
    if not os.fork():
        live = a_live()
        log = a_log(live, folder / f"{i}.arrows")
        live.start()
        log.start()
        os.write(1, f"{i} {os.getpid()} {live.begin_s!r}\\n".encode())
        time.sleep(60)
        os._exit(0)
time.sleep(60)
"""


def test_after_kill_9_at_any_moment_both_files_open_and_have_lost_at_most_the_last_second(tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", CHILDREN, str(tmp_path), str(N_KILLS)]
    chance = random.Random(9)
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as parent:
        assert parent.stdout is not None
        running = [parent.stdout.readline().split() for _ in range(N_KILLS)]
        # From before the first batch on.
        times = [0.02 + 2.5 * chance.random() ** 2 for _ in running]
        begin = time.monotonic()
        lived = {}
        for after, (name, process, begin_s) in sorted(zip(times, running, strict=True)):
            time.sleep(max(0.0, begin + after - time.monotonic()))
            os.kill(int(process), signal.SIGKILL)
            lived[name] = time.monotonic() - float(begin_s)
        parent.kill()
    assert len(lived) == N_KILLS >= 20
    for name, seconds in lived.items():
        path = tmp_path / f"{name}.arrows"
        for file, rate, column in ((path, RATE, "target_2"), (readings_path(path), 16.0, "amplitude")):
            if seconds <= 1.0 and file.stat().st_size < 4000:
                # Not a row yet; the schema is there.
                assert pa.ipc.open_stream(file).schema.field(column)
                continue
            recording = read_recording(file, rate_hz=rate)
            n = len(recording[column].values)
            assert n >= (seconds - 1.0) * rate
            assert any("no end marker" in note or "cut off" in note for note in recording.notes)
        if seconds > 1.0:
            np.testing.assert_array_equal(read_recording(path)["index"].values, np.arange(len(recording_of(path))))


def recording_of(path: Path) -> np.ndarray:
    return read_recording(path)["target_1"].values


# Not to be written ----------------------------------------------------------------------------------------------------

LIMITED = """
import resource, sys, time
from pathlib import Path
from test_live_log import a_live, a_log

resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))
said = []
live = a_live()
log = a_log(live, Path(sys.argv[1]), said)
live.start()
log.start()
time.sleep(2.0)
before = live.sample
time.sleep(0.5)
assert live.sample > before, "the queue is drained on"
live.stop()
log.stop()
assert live.log == [("writing", None), ("stopped", "File too large")], live.log
assert log.problem == "File too large"
print(len(said), said[0])
"""


def test_a_full_disk_stops_the_log_and_not_the_monitor_and_what_is_written_stays_whole(tmp_path: Path) -> None:
    path = tmp_path / "run.arrows"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(path)],
        capture_output=True,
        text=True,
        env=environment,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"1 the log {path} stopped: File too large; ")
    assert 10_000 < path.stat().st_size <= 60_000
    # What did not fit was taken out again: whole batches only, and room for the end marker or not.
    table = pa.ipc.open_stream(path).read_all()
    assert table["index"].to_numpy().tolist() == list(range(table.num_rows))
    assert table.num_rows > 0


@pytest.fixture
def small_disk(tmp_path: Path) -> Any:
    """A disk of 64 KiB, where this user may mount one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("a disk cannot be mounted here")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_disk_that_is_really_full_is_told_in_one_line(small_disk: Path) -> None:
    said: list[str] = []
    live = a_live()
    log = a_log(live, small_disk / "run.arrows", said)
    live.start()
    log.start()
    time.sleep(1.6)
    live.stop()
    log.stop()
    assert len(said) == 1
    assert "stopped: No space left on device" in said[0]
    assert live.log[-1] == ("stopped", "No space left on device")
    assert pa.ipc.open_stream(small_disk / "run.arrows").read_all().num_rows > 0


def test_a_device_that_is_full_from_the_start_is_an_error_at_the_start() -> None:
    with pytest.raises(OSError, match="No space left"):
        a_log(a_live(), Path("/dev/full"))


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "run.arrows"
    for existing in (path, readings_path(path)):
        existing.write_text("precious")
        with pytest.raises(FileExistsError, match="holds something"):
            a_log(a_live(), path)
        assert existing.read_text() == "precious"
        assert {file.name for file in tmp_path.iterdir()} == {existing.name}
        existing.unlink()


def test_what_cannot_be_written_for_another_reason_stops_the_log_alone(tmp_path: Path) -> None:
    said: list[str] = []
    live = a_live()
    live.take_readings = lambda: {"index": [1]}  # type: ignore[method-assign]
    log = a_log(live, tmp_path / "run.arrows", said)
    live.start()
    log.start()
    time.sleep(0.3)
    live.stop()
    log.stop()
    assert len(said) == 1
    assert live.log[-1][0] == "stopped"
    for file in (tmp_path / "run.arrows", tmp_path / "run.readings.arrows"):
        assert file.read_bytes().endswith(END_OF_STREAM)
