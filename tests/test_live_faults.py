"""`rthstrack monitor` as it runs in a laboratory, and everything that goes wrong there: each fault a test.

The program is a process of its own, with real sockets, files and browsers; only the laboratory is made up.
"""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from playwright.sync_api import sync_playwright

from live_monitor import (
    COMMAND,
    DELAY_S,
    GAIN,
    PATIENCE_S,
    RATE_HZ,
    all_right,
    frames,
    lines,
    monitored,
    motion,
    readings_in,
    sample,
    sending,
    until,
)
from rthstrack import _core, read_recording
from rthstrack.cli import main
from rthstrack.recording.readers.arrow import END_OF_STREAM

pytestmark = [
    pytest.mark.skipif(not hasattr(_core, "Live"), reason="this build has no rthstrack._core.Live"),
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="signals, limits and /proc are those of Linux"),
]

UPDATE_HZ = 16


# ------------------------------------------------------------------------------------------------------ the sender


def test_a_sender_that_is_killed_and_returns_is_silence_and_then_readings_again(tmp_path: Path) -> None:
    recorded = tmp_path / "test.npz"
    t = np.arange(8 * RATE_HZ) / RATE_HZ
    np.savez(recorded, target=motion(t), measured=GAIN * motion(t - DELAY_S), rate_hz=float(RATE_HZ))

    @contextmanager
    def replaying(port: int) -> Iterator[subprocess.Popen[bytes]]:
        command = [*COMMAND, "replay", str(recorded), "--to", f"udp://127.0.0.1:{port}"]
        with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
            try:
                yield process
            finally:
                process.kill()

    with lines() as readings, lines() as alarms:
        with monitored("--readings", readings.address, "--alarm-to", alarms.address, "--no-latch") as monitor:
            with replaying(monitor.port) as first:
                readings.more_than(8)
                first.kill()
                first.wait()
            before = len(readings.texts)
            until(lambda: alarms.texts, "the alarm of silence")
            raised = alarms.all()[0]["alarm"]
            assert (raised["name"], raised["actuator"], raised["raised"]) == ("silence", None, True)
            assert "advisory" in raised["text"]
            time.sleep(0.5)
            assert len(readings.texts) == before
            with replaying(monitor.port):
                readings.more_than(8)
            status, summary = monitor.end()
        assert [one["alarm"]["raised"] for one in alarms.all()][:2] == [True, False]
        assert all_right(readings.all())
    assert status == 0
    assert (summary["lost"], summary["repeated"], summary["reordered"], summary["malformed"]) == (0, 0, 0, 0)
    # Its second life counts from zero again.
    assert any("the counter started anew at 0: the window starts anew" in line for line in monitor.said)
    assert any("samples again, after" in line for line in monitor.said)


def test_a_sender_that_pauses_and_counts_on_has_lost_what_it_did_not_send(tmp_path: Path) -> None:
    with lines() as readings, monitored("--readings", readings.address, "--silence", "0.5") as monitor:
        with sending(monitor.port, first=100) as sender:
            readings.more_than(8)
            sender.stop()
            time.sleep(0.7)
            sender.skip(359)
            sender.start()
            readings.more_than(24)
            sender.stop()
            status, summary = monitor.end()
        assert status == 0
        assert summary["lost"] == 359
        assert summary["received"] == sender.sent
        assert any("359 samples lost: the window starts anew" in line for line in monitor.said)
        found = readings.all()
        # Not one window goes across the gap, and time has gone on meanwhile.
        assert all_right(found)
        (gap,) = (step for step in np.diff([reading["index"] for reading in found]) if step != RATE_HZ / UPDATE_HZ)
        assert gap > 359 + RATE_HZ


def test_a_counter_that_restarts_in_full_flight_starts_the_window_anew_and_nothing_is_lost() -> None:
    with lines() as readings, monitored("--readings", readings.address) as monitor:
        with sending(monitor.port, first=5000) as sender:
            readings.more_than(8)
            sender.counter = 0
            readings.more_than(24)
            sender.stop()
            status, summary = monitor.end()
        # The motion has gone on without a break: only the window's new start says that two were not mixed.
        assert all_right(readings.all())
        assert max(np.diff([reading["index"] for reading in readings.all()])) > RATE_HZ
    assert status == 0
    assert (summary["received"], summary["lost"]) == (sender.sent, 0)
    assert any("the counter started anew at 0" in line for line in monitor.said)


def test_packets_that_come_out_of_order_or_twice_are_counted_each_and_readings_go_on() -> None:
    order = list(range(4 * RATE_HZ))
    swapped, late, twice = range(50, len(order), 100), range(75, len(order), 300), range(90, len(order), 200)
    for i in swapped:
        order[i], order[i + 1] = order[i + 1], order[i]
    for i in late:
        # Three others overtake it.
        order[i : i + 4] = [*order[i + 1 : i + 4], order[i]]
    sequence = [counter for counter in order for _ in range(1 + (counter in twice))]
    with lines() as readings, monitored("--readings", readings.address) as monitor:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            begin = time.monotonic()
            for i, counter in enumerate(sequence):
                if i % 8 == 0:
                    time.sleep(max(0.0, begin + i / RATE_HZ - time.monotonic()))
                sock.sendto(sample(counter), ("127.0.0.1", monitor.port))
        status, summary = monitor.end()
        found = readings.all()
    assert status == 0
    assert summary["received"] == len(order)
    assert summary["lost"] == 0
    assert summary["reordered"] == len(swapped) + len(late)
    assert summary["repeated"] == len(twice)
    # What came late had been filled by a straight line, which at this rate is as good.
    assert all_right(found)
    assert set(np.diff([reading["index"] for reading in found])) == {RATE_HZ // UPDATE_HZ}


# ----------------------------------------------------------------------------------------------------- the browsers


def connections(port: int) -> int:
    """To this port of this machine, and established."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return sum(row[1].endswith(f":{port:04X}") and row[3] == "01" for row in rows)


def test_a_browser_that_is_killed_with_the_page_open_leaves_the_monitor_unharmed(tmp_path: Path, chromium: str) -> None:
    with lines() as readings, monitored("--readings", readings.address, "--page", "0") as monitor:
        with sending(monitor.port) as sender:
            command = [chromium, "--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run",
                       "--disable-background-networking", f"--user-data-dir={tmp_path / 'profile'}",
                       "--remote-debugging-port=0", monitor.page]  # fmt: skip
            browser = subprocess.Popen(
                command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
            )
            try:
                until(lambda: connections(monitor.page_port) >= 1, "the browser's connection")
                readings.more_than(24)
                assert connections(monitor.page_port) >= 1
            finally:
                os.killpg(browser.pid, signal.SIGKILL)
                browser.wait()
            until(lambda: connections(monitor.page_port) == 0, "the end of its connection")
            readings.more_than(24)
            # The next browser is served as the first was.
            assert all(frame["state"] == "running" for frame in frames(monitor.page, 3))
            sender.stop()
            status, summary = monitor.end()
        assert all_right(readings.all())
        assert set(np.diff([reading["index"] for reading in readings.all()])) == {RATE_HZ // UPDATE_HZ}
    assert status == 0
    assert (summary["received"], summary["lost"]) == (sender.sent, 0)
    assert not any("Error" in line for line in monitor.said)


def test_browsers_that_do_not_read_that_are_slow_late_or_too_many_cost_no_sample(tmp_path: Path) -> None:
    log = tmp_path / "run.arrows"
    with ExitStack() as stack:
        readings = stack.enter_context(lines())
        monitor = stack.enter_context(
            monitored("--readings", readings.address, "--page", "0", "--log", log, "--update", "64")
        )
        sender = stack.enter_context(sending(monitor.port))

        def connected(request: str | None) -> socket.socket:
            sock = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            sock.connect(("127.0.0.1", monitor.page_port))
            if request is not None:
                sock.sendall(f"GET {request} HTTP/1.1\r\nHost: 127.0.0.1:{monitor.page_port}\r\n\r\n".encode())
            return sock

        readings.more_than(8)
        # Four that never read, one that says nothing, and one that takes a little now and then.
        for _ in range(4):
            connected("/events")
        connected(None)
        slow = connected("/events")
        slow.settimeout(1)
        end = time.monotonic() + 3
        while time.monotonic() < end:
            slow.recv(512)
            time.sleep(0.05)
        # One that comes late and reads at once has everything.
        late = frames(monitor.page, 31)
        assert late[0]["readings"][0][0] == readings.all()[0]["index"]
        # More than there are places.
        refused = 0
        for _ in range(20):
            sock = connected("/events")
            sock.settimeout(2)
            try:
                refused += b"503" in sock.recv(16)
            except OSError:
                refused += 1
        assert refused > 0
        readings.more_than(64)
        sender.stop()
        status, summary = monitor.end()
    assert status == 0
    assert (summary["received"], summary["lost"], summary["repeated"]) == (sender.sent, 0, 0)
    assert pa.ipc.open_stream(log).read_all().num_rows == sender.sent
    found = readings.all()
    assert all_right(found)
    assert len(found) == summary["readings"]
    assert set(np.diff([reading["index"] for reading in found])) == {RATE_HZ // 64}


def test_the_page_of_the_real_monitor_moves_turns_red_latches_is_reset_and_shows_that_the_monitor_is_gone(
    chromium: str,
) -> None:
    with ExitStack() as stack:
        monitor = stack.enter_context(monitored("--page", "0", "--limit-delay", "0.02", "--control", "0"))
        sender = stack.enter_context(sending(monitor.port))
        playwright = stack.enter_context(sync_playwright())
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page()
        trouble: list[str] = []
        page.on("pageerror", lambda error: trouble.append(str(error)))
        page.goto(monitor.page)

        def wait(condition: str, patience_s: float = PATIENCE_S) -> None:
            end = time.monotonic() + patience_s
            while not page.evaluate(condition):
                assert time.monotonic() < end, f"never came true: {condition}: {page.inner_text('body')[:500]}"
                page.wait_for_timeout(30)

        delay = "document.querySelector('[data-value=delay-0]').textContent"
        state = "document.documentElement.dataset.state"
        alert = "document.querySelector('.alerts .{}') !== null"
        wait(f"{state} === 'running' && Math.abs(Number({delay}) - {1e3 * DELAY_S}) < 0.1")
        wait(alert.format("calm"))
        # Readings move with the actuator.
        sender.delay_s = 0.017
        wait(f"Math.abs(Number({delay}) - 17) < 0.1")
        wait(alert.format("calm"))
        # Beyond the limit all turns red.
        sender.delay_s = 0.030
        wait(alert.format("active"))
        red = page.evaluate("getComputedStyle(document.querySelector('.alerts .active')).backgroundColor")
        assert red == "rgb(179, 21, 31)"
        wait(f"getComputedStyle(document.querySelector('[data-value=delay-0]')).color === '{red}'")
        words = page.inner_text(".alerts")
        assert "Delay" in words
        assert "advisory" in words
        # Back within it, the alarm is held.
        sender.delay_s = DELAY_S
        wait(alert.format("latched"))
        page.wait_for_timeout(1000)
        assert page.evaluate(alert.format("latched"))
        assert any(re.search(r"ALARM at [\d.]+ s: advisory: actuator 1: lag of up to", line) for line in monitor.said)
        # A datagram resets it.
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
            control.sendto(b"rest", ("127.0.0.1", monitor.control_port))
            page.wait_for_timeout(500)
            assert page.evaluate(alert.format("latched"))
            control.sendto(b"reset", ("127.0.0.1", monitor.control_port))
        wait(alert.format("calm"))
        # Killed, it is missed.
        killed = time.monotonic()
        monitor.process.kill()
        wait(f"{state} === 'lost'")
        assert time.monotonic() - killed < PATIENCE_S
        assert "Lost connection" in page.inner_text(".alerts")
        assert trouble == []
        browser.close()


# ------------------------------------------------------------------------------------------------------ disk and files


def test_a_disk_that_fills_up_stops_log_and_file_and_monitoring_goes_on_and_says_so(tmp_path: Path) -> None:
    log, file = tmp_path / "run.arrows", tmp_path / "readings.jsonl"
    outputs = ("--log", log, "--readings", file, "--update", "64", "--page", "0")
    with lines() as readings, monitored(*outputs, "--readings", readings.address) as monitor:
        resource.prlimit(monitor.process.pid, resource.RLIMIT_FSIZE, (60_000, 60_000))
        with sending(monitor.port) as sender:
            assert "monitoring goes on" in monitor.told(rf"the log {re.escape(str(log))} stopped: .*")
            monitor.told("readings are no longer written to .*")
            readings.more_than(64)
            (frame,) = frames(monitor.page, 1)
            assert frame["health"]["log"].startswith("stopped: File too large")
            sender.stop()
            status, summary = monitor.end()
        assert all_right(readings.all())
        assert len(readings.texts) == summary["readings"]
    assert status == 0
    assert (summary["received"], summary["lost"]) == (sender.sent, 0)
    # What is in the files is whole, and nothing else is in them.
    assert main(["channels", str(log)]) == 0
    logged = read_recording(log)
    assert 0 < len(logged.channel("target_1").values) < sender.sent
    np.testing.assert_array_equal(
        logged.channel("target_1").values, motion(np.arange(len(logged.channel("target_1").values)) / RATE_HZ)
    )
    assert 0 < len(readings_in(file)) < summary["readings"]
    assert file.stat().st_size <= 60_000


def test_a_real_disk_that_is_full_is_told_by_its_name_and_monitoring_goes_on(tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    # A disk of 64 KiB that this process alone sees.
    inside = ("unshare", "-rm", "sh", "-c", f'mount -t tmpfs -o size=64k none "{disk}" && exec "$@"', "sh")
    if shutil.which("unshare") is None or subprocess.run([*inside, "true"], capture_output=True).returncode:
        pytest.skip("no disk can be mounted here")
    with lines() as readings:
        outputs = ("--log", disk / "run.arrows", "--readings", readings.address)
        with monitored(*outputs, prefix=inside) as monitor, sending(monitor.port) as sender:
            monitor.told(r"the log .* stopped: No space left on device; what is in it can be read, monitoring goes on")
            readings.more_than(24)
            seen = Path(f"/proc/{monitor.process.pid}/root{disk}/run.arrows")
            copy = shutil.copy(seen, tmp_path / "copy.arrows")
            sender.stop()
            status, summary = monitor.end()
        assert all_right(readings.all())
    assert status == 0
    assert (summary["received"], summary["lost"]) == (sender.sent, 0)
    logged = read_recording(copy).channel("target_1").values
    assert len(logged) > RATE_HZ
    np.testing.assert_array_equal(logged, motion(np.arange(len(logged)) / RATE_HZ))


@pytest.mark.parametrize(
    ("name", "expected", "message"),
    [
        ("/dev/full", 2, "--log: /dev/full: is a pipe or a device"),
        ("/proc/self/run.arrows", 2, "--log: /proc/self/run.arrows: this user may not write there"),
        ("{tmp}/none/run.arrows", 2, "--log: {tmp}/none/run.arrows: there is no directory {tmp}/none"),
        ("{tmp}", 2, "--log: {tmp}: is a directory"),
        ("{tmp}/there.arrows", 2, "is there already and holds something: nothing is overwritten"),
        ("{tmp}/closed/run.arrows", 2, "--log: {tmp}/closed/run.arrows: this user may not write there"),
    ],
)
def test_a_log_that_cannot_be_written_is_told_at_the_start_in_a_line(
    tmp_path: Path, name: str, expected: int, message: str
) -> None:
    (tmp_path / "there.arrows").write_text("of another test")
    (tmp_path / "closed").mkdir(mode=0o500)
    path = name.format(tmp=tmp_path)
    if "closed" in name and os.geteuid() == 0:
        pytest.skip("this user may write everywhere")
    done = refused("--log", path)
    assert (done.returncode, done.stdout) == (expected, "")
    line, *usage = done.stderr.splitlines()
    assert message.format(tmp=tmp_path) in line
    assert len(usage) == 2
    assert (tmp_path / "there.arrows").read_text() == "of another test"


def refused(*arguments: object, listen: str = "udp://127.0.0.1:0") -> subprocess.CompletedProcess[str]:
    command = [*COMMAND, "monitor", "--listen", listen, "--rate", str(RATE_HZ), "--duration", "20"]
    return subprocess.run([*command, *map(str, arguments)], capture_output=True, text=True, timeout=15, check=False)


def test_a_port_in_use_is_a_line_that_names_it_and_nothing_is_left_behind(tmp_path: Path) -> None:
    log, file = tmp_path / "run.arrows", tmp_path / "readings.jsonl"
    with ExitStack() as stack:
        udp = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        udp.bind(("127.0.0.1", 0))
        tcp = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        (udp_port, tcp_port) = (one.getsockname()[1] for one in (udp, tcp))
        for arguments, listen, port in [
            ((), f"udp://127.0.0.1:{udp_port}", udp_port),
            (("--control", udp_port), "udp://127.0.0.1:0", udp_port),
            (("--page", tcp_port), "udp://127.0.0.1:0", tcp_port),
        ]:
            done = refused("--log", log, "--readings", file, *arguments, listen=listen)
            assert (done.returncode, done.stdout) == (1, "")
            (line,) = done.stderr.splitlines()
            assert f"127.0.0.1:{port}" in line
            assert "in use" in line
            # The next try finds its files free.
            assert not log.exists() or log.stat().st_size == 0
            assert not file.exists() or file.stat().st_size == 0


def test_a_second_monitor_at_the_same_port_is_refused_and_the_first_goes_on() -> None:
    with lines() as readings, monitored("--readings", readings.address) as monitor, sending(monitor.port) as sender:
        readings.more_than(4)
        assert refused(listen=f"udp://127.0.0.1:{monitor.port}").returncode == 1
        readings.more_than(8)
        sender.stop()
        status, summary = monitor.end()
    assert status == 0
    assert (summary["received"], summary["lost"]) == (sender.sent, 0)


# ----------------------------------------------------------------------------------------------------------- the clock

STEPPING = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>

static int (*real_gettime)(clockid_t, struct timespec *);
static time_t begin, after;

__attribute__((constructor)) static void start(void) {
    struct timespec t;
    real_gettime = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    real_gettime(CLOCK_MONOTONIC, &t);
    begin = t.tv_sec;
    after = atoi(getenv("STEP_AFTER_S"));
}
int clock_gettime(clockid_t clock, struct timespec *to) {
    struct timespec t;
    if (!real_gettime) start();
    const int status = real_gettime(clock, to);
    if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) {
        real_gettime(CLOCK_MONOTONIC, &t);
        if (t.tv_sec - begin >= after) to->tv_sec -= 3600;
    }
    return status;
}
int gettimeofday(struct timeval *to, void *zone) {
    struct timespec t;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &t);
    to->tv_sec = t.tv_sec;
    to->tv_usec = t.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *to) {
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    if (to) *to = t.tv_sec;
    return t.tv_sec;
}
"""


@pytest.fixture(scope="module")
def stepping_clock() -> Iterator[Callable[[int], dict[str, str]]]:
    """The environment of a process whose clock goes back an hour after so many seconds; the monotonic one does not."""
    if shutil.which("gcc") is None:
        pytest.skip("no gcc: the clock cannot be stepped")
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder) / "clock.c", Path(folder) / "clock.so"
        source.write_text(STEPPING)
        subprocess.run(["gcc", "-O1", "-shared", "-fPIC", "-o", str(library), str(source), "-ldl"], check=True)
        yield lambda after_s: os.environ | {"LD_PRELOAD": str(library), "STEP_AFTER_S": str(after_s)}


def test_a_clock_that_is_set_back_an_hour_changes_nothing(
    tmp_path: Path, stepping_clock: Callable[[int], dict[str, str]]
) -> None:
    # That the clock is set back at all, and just that clock.
    seen = (
        "import time; a, m = time.time(), time.monotonic(); time.sleep(2.5); "
        "print(time.time() - a, time.monotonic() - m)"
    )
    done = subprocess.run(
        [sys.executable, "-c", seen], env=stepping_clock(2), capture_output=True, text=True, timeout=20, check=True
    )
    of_clock, monotonic = map(float, done.stdout.split())
    assert -3600 < of_clock < -3590
    assert 2.5 <= monotonic < 10

    log = tmp_path / "run.arrows"
    step_s = 5
    begin = time.monotonic()
    with lines() as readings, lines() as alarms:
        outputs = ("--readings", readings.address, "--alarm-to", alarms.address, "--page", "0", "--log", log)
        settings = ("--limit-delay", "0.02", "--silence", "0.6")
        run = monitored(*outputs, *settings, "--duration", "12", env=stepping_clock(step_s))
        with run as monitor, sending(monitor.port) as sender:
            until(lambda: time.monotonic() - begin > step_s + 2.5, "two seconds after the step")
            right = readings.all()
            # Readings have come without a break, no later than they should.
            assert all_right(right)
            assert set(np.diff([reading["index"] for reading in right])) == {RATE_HZ // UPDATE_HZ}
            assert max(np.diff(readings.came_s)) < PATIENCE_S
            for frame in frames(monitor.page, 8):
                assert frame["state"] == "running"
                assert 0 <= frame["health"]["age_s"] < PATIENCE_S
                assert frame["health"]["pace_hz"] == pytest.approx(RATE_HZ, rel=0.05)
            # No silence was made up, and an alarm comes as ever.
            assert not alarms.texts
            sender.delay_s = 0.03
            until(lambda: alarms.texts, "the alarm")
            assert alarms.all()[0]["alarm"]["name"] == "delay"
            until(lambda: time.monotonic() - begin > 10, "some more seconds")
            sender.stop()
            status, summary = monitor.end(None)
        assert time.monotonic() - begin < 12 + PATIENCE_S
    assert status == 0
    assert (summary["received"], summary["lost"]) == (sender.sent, 0)
    logged = pa.ipc.open_stream(log).read_all()
    assert logged.num_rows == sender.sent
    np.testing.assert_array_equal(logged["time_s"].to_numpy(), np.arange(sender.sent) / RATE_HZ)


# ------------------------------------------------------------------------------------------------------------- the end


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_whole_files_the_summary_and_status_0(tmp_path: Path, number: signal.Signals) -> None:
    log, file = tmp_path / "run.arrows", tmp_path / "readings.jsonl"
    with lines() as readings:
        outputs = ("--log", log, "--readings", file, "--readings", readings.address, "--page", "0")
        with monitored(*outputs) as monitor, sending(monitor.port) as sender:
            readings.more_than(24)
            # A browser that is watching does not hold it up.
            with urllib.request.urlopen(f"{monitor.page}events", timeout=10) as stream:
                stream.readline()
                told = time.monotonic()
                status, summary = monitor.end(number)
                assert time.monotonic() - told < PATIENCE_S
            sender.stop()
            with pytest.raises(urllib.error.URLError):
                urllib.request.urlopen(monitor.page, timeout=2)
        assert status == 0
        assert summary["lost"] == 0
        assert 0 < summary["received"] <= sender.sent
        for path, n in ((log, summary["received"]), (tmp_path / "run.readings.arrows", summary["readings"])):
            assert path.read_bytes().endswith(END_OF_STREAM)
            assert pa.ipc.open_stream(path).read_all().num_rows == n
        assert file.read_text().endswith("\n")
        assert len(readings_in(file)) == len(readings.texts) == summary["readings"]


def test_after_kill_9_the_log_opens_and_has_lost_at_most_the_last_second(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for attempt in range(3):
        log, file = tmp_path / f"run{attempt}.arrows", tmp_path / f"readings{attempt}.jsonl"
        with (
            lines() as readings,
            monitored("--log", log, "--readings", file, "--readings", readings.address) as monitor,
        ):
            with sending(monitor.port) as sender:
                readings.more_than(24)
                # At another moment of the log's period each time.
                time.sleep(0.07 * attempt)
                sent, n_readings = sender.sent, len(readings.texts)
                monitor.process.kill()
            monitor.process.wait()
        kept = read_recording(log)
        target = kept.channel("target_1").values
        assert sent - RATE_HZ <= len(target) <= sender.sent
        np.testing.assert_array_equal(target, motion(np.arange(len(target)) / RATE_HZ))
        assert kept.rate_hz == RATE_HZ
        judged = read_recording(tmp_path / f"run{attempt}.readings.arrows").channel("delay_s").values
        assert len(judged) >= n_readings - UPDATE_HZ
        whole = [line for line in file.read_text().split("\n")[:-1] if json.loads(line)]
        assert len(whole) >= n_readings - UPDATE_HZ
        assert main(["evaluate", str(log)]) == 0
        assert "12.0" in capsys.readouterr().out


def test_it_needs_nobody_to_listen_to_its_readings_and_alarms() -> None:
    with lines() as gone:
        pass
    outputs = ("--readings", gone.address, "--alarm-to", gone.address)
    with monitored(*outputs, "--limit-delay", "0.005") as monitor, sending(monitor.port) as sender:
        monitor.told("ALARM at")
        time.sleep(1)
        sender.stop()
        status, summary = monitor.end()
    assert status == 0
    assert (summary["received"], summary["lost"]) == (sender.sent, 0)
    assert summary["alarms"] == 1
