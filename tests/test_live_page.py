"""The live page in a browser, fed by a monitor that is made up here: what it says, and that nobody can harm it."""

from __future__ import annotations

import http.client
import json
import math
import socket
import threading
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, sync_playwright
from playwright.sync_api import Page as BrowserPage

from rthstrack.errors import SettingError
from rthstrack.live import page as live_page
from rthstrack.live.page import Page, Source

RATE_HZ, UPDATE_HZ, WINDOW_S = 256.0, 64.0, 4.0
PER_READING = int(RATE_HZ / UPDATE_HZ)
LIMIT_DELAY_S, LIMIT_AMPLITUDE = 0.015, 0.1
ALARM_KINDS = [
    {"name": "delay", "title": "Delay", "quantity": "delay", "limit": "delay_s"},
    {"name": "amplitude", "title": "Amplitude", "quantity": "amplitude", "limit": "amplitude"},
    {"name": "critical_delay", "title": "Critical delay", "quantity": "delay", "limit": "critical_delay_s"},
    {"name": "lost", "title": "Lost samples", "quantity": "lost", "limit": "lost"},
    {"name": "silence", "title": "Silence", "quantity": None, "limit": "silence_s"},
    {"name": "unjudged", "title": "Not judged", "quantity": None, "limit": "unjudged_s"},
]


class MadeUp:
    """A monitor of sines: 64 readings a second of every actuator, as long as it is not `silent`."""

    def __init__(self, n_actuators: int = 4, names: list[str] | None = None, rate_hz: float = RATE_HZ) -> None:
        self.rate_hz, self.per_reading = rate_hz, int(rate_hz / UPDATE_HZ)
        self.names = names or [f"actuator {k + 1}" for k in range(n_actuators)]
        self.delay_s = [0.004 + 0.002 * k for k in range(n_actuators)]
        self.amplitude = [0.98 + 0.01 * k for k in range(n_actuators)]
        self.reason: list[str | None] = [None] * n_actuators
        self.silent = self.waiting = False
        self.units: list[str | None] | None = None
        self.health = {"lost": 0, "malformed": 0, "log": "writing", "log_code": "writing"}
        self._alarms: dict[tuple[str, int], dict[str, Any]] = {}
        self._events: list[tuple[int, dict[str, Any]]] = []
        self._readings: list[list[Any]] = []
        self._lock = threading.Lock()
        self._started, self._lost_s, self._n = time.monotonic(), 0.0, 0
        self.frames = 0

    def begin_anew(self) -> None:
        """As if the monitor had been started again, its time at zero."""
        with self._lock:
            self._readings.clear()
            self._started, self._lost_s, self._n = time.monotonic(), 0.0, 0

    def fill(self, seconds: float) -> None:
        """As if it had run so long already."""
        self._started -= seconds

    def hello(self) -> str:
        limits = {
            "delay_s": LIMIT_DELAY_S,
            "amplitude": LIMIT_AMPLITUDE,
            "critical_delay_s": 0.05,
            "critical_fraction": 0.5,
        }
        return json.dumps(
            {
                "version": "0",
                "rate_hz": self.rate_hz,
                "window_s": WINDOW_S,
                "update_hz": UPDATE_HZ,
                "latency_s": 0.0,
                "estimator": "least_squares",
                "band_hz": None,
                "n_actuators": len(self.names),
                "names": self.names,
                "source": "udp 127.0.0.1:5005",
                "limits": limits,
                "alarm_kinds": ALARM_KINDS,
            }
            | ({} if self.units is None else {"units": self.units})
        )

    @staticmethod
    def _event(code: str, time_s: float, text: str) -> dict[str, Any]:
        return {"time_s": time_s, "code": code, "values": {}, "kept_back": 0, "text": text}

    def target(self, t: Any) -> Any:
        return 12 * np.sin(5.1 * t) + 5 * np.sin(14.3 * t + 1) * np.sin(0.31 * t)

    def event(self, text: str) -> None:
        with self._lock:
            self._events.append((self._n, self._event("samples_lost", self._n / self.rate_hz, text)))

    def reset(self) -> None:
        with self._lock:
            self._alarms = {key: alarm | {"latched": False} for key, alarm in self._alarms.items() if alarm["active"]}

    def _advance(self) -> None:
        now = time.monotonic() - self._started - self._lost_s
        if self.silent or self.waiting:
            self._lost_s += max(0.0, now - self._n / self.rate_hz)
            return
        for n in range(self._n // self.per_reading + 1, int(now * UPDATE_HZ) + 1):
            t = n / UPDATE_HZ
            for k in range(len(self.names)):
                self._readings.append(self._reading(n * self.per_reading, t, k))
                self._judge(t, "delay", k, self._readings[-1][5], LIMIT_DELAY_S)
                a = self._readings[-1][4]
                self._judge(t, "amplitude", k, None if a is None else abs(a - 1), LIMIT_AMPLITUDE)
        self._n = max(self._n, int(now * UPDATE_HZ) * self.per_reading)

    def _reading(self, index: int, t: float, k: int) -> list[Any]:
        head = [index, t, t - WINDOW_S / 2, k]
        reason = self.reason[k]
        if reason is not None and reason.startswith("not determined"):
            return [*head, *[None] * 8, False, reason]
        a = self.amplitude[k] + 0.004 * math.sin(1.3 * t + k)
        d = self.delay_s[k] + 0.0004 * math.sin(0.9 * t + 2 * k)
        interval = [a - 0.003, a + 0.003, d - 0.0003, d + 0.0003] if reason is None else [None] * 4
        return [*head, a, d, -5.1 * d, 0.81, *interval, True, reason]

    def _judge(self, t: float, name: str, k: int, value: float | None, limit: float) -> None:
        known = self._alarms.get((name, k))
        if value is not None and value > limit:
            text = f"{name} of {self.names[k]} is {value:.4g}, limit {limit:g}; advisory"
            if known is None or not known["active"]:
                self._alarms[name, k] = {
                    "name": name,
                    "actuator": k,
                    "active": True,
                    "latched": True,
                    "since_s": t,
                    "value": value,
                    "limit": limit,
                    "text": text,
                }
                self._events.append((self._n, self._event("alarm_raised", t, f"raised: {text}")))
        elif known is not None:
            known["active"] = False
            if not known["latched"]:
                del self._alarms[name, k]

    def frame(self, cursor: int) -> tuple[str, int]:
        with self._lock:
            self._advance()
            self.frames += 1
            return self._frame(cursor), self._n

    def _frame(self, cursor: int) -> str:
        n = len(self.names)
        first = bisect_right(self._readings, cursor, key=lambda reading: reading[0])
        since = max(cursor, self._n - int(WINDOW_S * self.rate_hz))
        t = np.arange(since + 1, self._n + 1) / self.rate_hz
        target = [self.target(t + 0.7 * k) for k in range(n)]
        measured = [self.amplitude[k] * self.target(t + 0.7 * k - self.delay_s[k]) for k in range(n)]
        state = "waiting" if self.waiting else "silent" if self.silent else "running"
        return json.dumps(
            {
                "time_s": self._n / self.rate_hz if self._n else None,
                "state": state,
                "health": {
                    "received": self._n,
                    "lost": 0,
                    "repeated": 0,
                    "reordered": 0,
                    "malformed": 0,
                    "refused": 0,
                    "filled": 0,
                    "restarts": 0,
                    "readings": len(self._readings),
                    "pace_hz": self.rate_hz * 0.9996,
                    "age_s": time.monotonic() - self._started - self._lost_s - self._n / self.rate_hz + self._lost_s,
                    "log": None,
                    "log_code": None,
                    "log_dropped": 0,
                }
                | self.health,
                "readings": self._readings[first:],
                "scope": {
                    "rate_hz": self.rate_hz,
                    "end_s": self._n / self.rate_hz,
                    "target": [np.round(x, 6).tolist() for x in target],
                    "measured": [np.round(x, 6).tolist() for x in measured],
                },
                "spectrum": self._spectrum(cursor),
                "alarms": list(self._alarms.values()),
                "events": [event for at, event in self._events if at > cursor or cursor == 0],
            }
        )

    def _spectrum(self, cursor: int) -> dict[str, Any] | None:
        half = int(self.rate_hz / 2)
        if self._n < WINDOW_S * self.rate_hz or (cursor // half == self._n // half and cursor > 0):
            return None
        n = int(WINDOW_S * self.rate_hz)
        t = np.arange(self._n - n + 1, self._n + 1) / self.rate_hz
        noise = np.random.default_rng(1).normal(size=n) * 0.02

        def spectrum(k: int, a: float, d: float) -> list[float]:
            wave = a * self.target(t + 0.7 * k - d) + noise
            amplitude = np.round(2 / n * np.abs(np.fft.rfft(wave * np.hanning(n) * 2)), 7)
            return list(map(float, amplitude))

        every = range(len(self.names))
        return {
            "frequency_hz": np.fft.rfftfreq(n, 1 / self.rate_hz).tolist(),
            "target": [spectrum(k, 1, 0) for k in every],
            "measured": [spectrum(k, self.amplitude[k], self.delay_s[k]) for k in every],
        }


# ---------------------------------------------------------------------------------------------------- the browser

FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]
PATIENCE_S = 90.0


def wait_until(holds: Callable[[], bool]) -> None:
    """Waits for a state, however busy the machine."""
    started = time.monotonic()
    while not holds():
        assert time.monotonic() - started < PATIENCE_S
        time.sleep(0.02)


#: What Chromium itself says of a server that is gone or full, which some tests make it.
UNREACHED = "Failed to load resource"


@dataclass
class Opened:
    """The live page in a browser, and everything that should not have happened there."""

    page: BrowserPage
    trouble: list[str] = field(default_factory=list)

    def value(self, name: str) -> str:
        return self.page.locator(f'[data-value="{name}"]').inner_text()

    def state(self) -> str:
        return str(self.page.evaluate("document.documentElement.dataset.state"))

    def alerts(self) -> list[tuple[str, str]]:
        """Kind and words of every line of the alarm banner."""
        lines = self.page.evaluate(
            "[...document.querySelectorAll('.alerts li')].map((li) => [li.className, li.innerText])"
        )
        return [(kind, words) for kind, words in lines]

    def draws(self) -> int:
        return int(self.page.evaluate("document.documentElement.dataset.frames || '0'"))

    def until(self, condition: str, patience_s: float = PATIENCE_S) -> float:
        """Waits until `condition` holds in the page; how long it took, in seconds."""
        started = time.monotonic()
        while not self.page.evaluate(condition):
            if time.monotonic() - started > patience_s:
                pytest.fail(f"never came true: {condition}; the page says {self.state()}, {self.alerts()}")
            self.page.wait_for_timeout(30)
        return time.monotonic() - started

    def until_state(self, state: str, patience_s: float = PATIENCE_S) -> float:
        return self.until(f"document.documentElement.dataset.state === '{state}'", patience_s)

    def until_alert(self, kind: str) -> float:
        return self.until(f"document.querySelector('.alerts .{kind}') !== null")


@pytest.fixture(scope="module")
def browser(chromium: str) -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def serve() -> Iterator[Callable[..., Page]]:
    """Starts a page of a source; stopped at the end."""
    pages: list[Page] = []

    def start(source: Source, port: int = 0, **options: Any) -> Page:
        page = Page(source, port, **options)
        pages.append(page)
        page.start()
        return page

    yield start
    for page in pages:
        page.stop()


@pytest.fixture
def opened(browser: Browser) -> Iterator[Callable[..., Opened]]:
    """Opens a live page; any error, warning or foreign request of it fails the test."""
    all_opened: list[Opened] = []

    def open_page(page: Page, **options: Any) -> Opened:
        context = browser.new_context(viewport={"width": 1600, "height": 1000}, **options)
        opened = Opened(context.new_page())
        opened.page.on("console", lambda message: opened.trouble.append(f"{message.type}: {message.text}"))
        opened.page.on("pageerror", lambda error: opened.trouble.append(f"error: {error}"))
        opened.page.on("dialog", lambda dialog: opened.trouble.append(f"dialog: {dialog.message}"))
        opened.page.on(
            "request",
            lambda request: (
                None if request.url.startswith((page.url, "data:,")) else opened.trouble.append(request.url)
            ),
        )
        opened.page.goto(page.url)
        opened.until("document.documentElement.dataset.ready === 'true'")
        all_opened.append(opened)
        return opened

    yield open_page
    for one in all_opened:
        assert [words for words in one.trouble if UNREACHED not in words] == []
        one.page.context.close()


def shown_number(text: str) -> float:
    return float(text.replace("\N{MINUS SIGN}", "-"))


def test_the_page_says_what_the_monitor_says(serve: Callable[..., Page], opened: Callable[..., Opened]) -> None:
    source = MadeUp(2, names=["north", "south"])
    source.fill(10)
    source.reason[1] = "not determined: too little motion to judge by"
    source.health |= {"lost": 1234, "log": "stopped: No space left on device", "log_code": "stopped"}
    source.event("sender restarted at counter 0")
    page = opened(serve(source))
    page.until_state("running")
    page.until("document.querySelector('.card.invalid') !== null")
    # 0.98 +- 0.004 and 4 +- 0.4 ms, with their intervals of 0.003 and 0.3 ms to either side
    assert shown_number(page.value("amplitude-0")) == pytest.approx(0.98, abs=0.0046)
    assert shown_number(page.value("delay-0")) == pytest.approx(4.0, abs=0.41)
    low, high = (
        shown_number(words) for words in page.page.locator(".card .interval").nth(1).inner_text().split(" to ")
    )
    assert high - low == pytest.approx(0.6, abs=0.011)
    assert page.value("delay-1") == "\N{EN DASH}"
    assert "not determined: too little motion to judge by" in page.page.locator(".card").nth(1).inner_text()
    health = page.page.locator(".health").inner_text()
    assert "1\u202f234" in health
    assert "No space left on device" in health
    assert "255.9 of 256 Hz" in health
    assert "sender restarted at counter 0" in page.page.locator(".events").inner_text()
    assert "window 4 s" in page.page.locator(".facts").inner_text()
    assert page.alerts() == [("calm", "No alarm.")]


def test_readings_move_and_four_actuators_are_drawn_at_most_twenty_times_a_second(
    serve: Callable[..., Page], opened: Callable[..., Opened]
) -> None:
    source = MadeUp(4)
    source.fill(700)
    page = opened(serve(source))
    page.until("Number(document.documentElement.dataset.frames || 0) > 5")
    seen = {page.value("delay-0")}
    started, before = time.monotonic(), page.draws()
    while len(seen) < 6 and time.monotonic() - started < PATIENCE_S:
        page.page.wait_for_timeout(100)
        seen.add(page.value("delay-0"))
    assert len(seen) >= 6
    # How many a busy machine draws is its own affair; never more than are worth it.
    assert (page.draws() - before) / (time.monotonic() - started) <= 21
    # Ten minutes are drawn from no more points than the chart has room for, four curves and an interval alike.
    page.page.get_by_label("10 min").check()
    chart = "document.querySelector('[data-chart=\"delay\"]')"
    page.until(f"{chart}.chart.u.data[0].length >= {chart}.clientWidth / 2")
    lengths = page.page.evaluate(f"{chart}.chart.u.data.map((c) => c.length)")
    assert len(set(lengths)) == 1
    assert len(lengths) == 7
    assert lengths[0] <= 4 * page.page.evaluate(f"{chart}.clientWidth")
    page.until(f"Number(document.documentElement.dataset.frames) > {page.draws() + 5}")


def test_what_is_drawn_is_what_was_read(serve: Callable[..., Page], opened: Callable[..., Opened]) -> None:
    source = MadeUp(2)
    source.fill(40)
    page = opened(serve(source))
    page.until("Number(document.documentElement.dataset.frames || 0) > 5")
    drawn = page.page.evaluate(
        "['amplitude', 'delay'].map((name) => document.querySelector(`[data-chart=\"${name}\"]`).chart.u.data"
        ".map((column) => Array.from(column)))"
    )
    for name, (times, *columns) in zip(("amplitude", "delay"), drawn, strict=True):
        read = {round(r[1] * UPDATE_HZ): r for r in source._readings if r[3] == 0}
        high, low = columns[2], columns[3]
        position, factor = (4, 1.0) if name == "amplitude" else (5, 1e3)
        ends = (8, 9) if name == "amplitude" else (10, 11)
        for t, value, top, bottom in list(zip(times, columns[0], high, low, strict=True))[::50]:
            reading = read[round(t * UPDATE_HZ)]
            assert value == pytest.approx(factor * reading[position], rel=1e-6)
            assert [bottom, top] == pytest.approx([factor * reading[end] for end in ends], rel=1e-6)
    scope = page.page.evaluate(
        "document.querySelector('[data-chart=\"scope\"]').chart.u.data.map((column) => Array.from(column))"
    )
    times, target, measured = (np.array(column) for column in scope)
    assert times[-1] - times[0] == pytest.approx(WINDOW_S, abs=2 / RATE_HZ)
    np.testing.assert_allclose(target, source.target(times), atol=1e-5)
    np.testing.assert_allclose(measured, 0.98 * source.target(times - 0.004), atol=1e-5)


DELAYS = "Array.from(document.querySelector('[data-chart=\"delay\"]').chart.u.data[1])"


def test_one_reading_that_stands_out_is_seen_among_ten_minutes(
    serve: Callable[..., Page], opened: Callable[..., Opened]
) -> None:
    source = MadeUp(1)
    source.fill(620)
    source.frame(0)
    source._readings[20_000][5] = 0.0123
    page = opened(serve(source))
    page.page.get_by_label("10 min").check()
    page.until(f"{DELAYS}.length > 100 && Math.abs(Math.max(...{DELAYS}) - 12.3) < 1e-5")


def test_no_line_is_drawn_where_there_was_no_reading(serve: Callable[..., Page], opened: Callable[..., Opened]) -> None:
    source = MadeUp(1)
    source.fill(10)
    page = opened(serve(source))
    page.until(f"{DELAYS}.length > 100")
    assert None not in page.page.evaluate(DELAYS)
    with source._lock:
        source._n += int(3 * RATE_HZ)  # three seconds are missing
        source.fill(3)
    page.until(f"{DELAYS}.slice(-10).every((v) => v != null) && {DELAYS}.includes(null)")


def test_a_monitor_that_begins_anew_begins_the_charts_anew(
    serve: Callable[..., Page], opened: Callable[..., Opened]
) -> None:
    source = MadeUp(2)
    source.fill(50)
    first = serve(source)
    page = opened(first)
    page.until(f"{DELAYS}.length > 100")
    first.stop()
    source.begin_anew()
    serve(source, address(first)[1])
    last = "document.querySelector('[data-chart=\"{}\"]').chart.u.data[0].at(-1)"
    page.until(f"{last.format('delay')} > 0.5 && {last.format('delay')} < 20 && {last.format('scope')} < 20")
    times = page.page.evaluate("Array.from(document.querySelector('[data-chart=\"delay\"]').chart.u.data[0])")
    assert times == sorted(times)
    assert times[0] < 1


def test_a_crossed_limit_turns_red_and_latches_until_it_is_reset(
    serve: Callable[..., Page], opened: Callable[..., Opened]
) -> None:
    source = MadeUp(2)
    source.fill(5)
    page = opened(serve(source))
    page.until_state("running")
    colour = "getComputedStyle(document.querySelector('{}')).{}"
    calm = page.page.evaluate(colour.format('[data-value="delay-1"]', "color"))

    source.delay_s[1] = 0.02
    page.until_alert("active")
    ((_, words),) = page.alerts()
    assert "Delay · actuator 2" in words
    assert "advisory" in words
    red = page.page.evaluate(colour.format(".alerts .active", "backgroundColor"))
    assert red == "rgb(179, 21, 31)"
    page.until(f"{colour.format('[data-value=delay-1]', 'color')} === '{red}'")
    assert "ALARM" in page.page.title()

    source.delay_s[1] = 0.006
    page.until_alert("latched")
    ((_, words),) = page.alerts()
    assert "latched — advisory — reset at the terminal or by control datagram" in words
    assert page.page.evaluate(colour.format(".alerts .latched", "borderTopColor")) == red
    assert page.page.evaluate(colour.format(".alerts .latched", "backgroundColor")) != red
    page.until(f"{colour.format('[data-value=delay-1]', 'color')} === '{calm}'")

    source.reset()
    page.until_alert("calm")
    page.until("document.querySelector('.card .after, .card .over') === null")
    assert "ALARM" not in page.page.title()


def test_an_actuator_that_is_not_judged_is_an_alarm_like_the_others(
    serve: Callable[..., Page], opened: Callable[..., Opened]
) -> None:
    source = MadeUp(2)
    source.fill(5)
    source.reason[1] = "not determined: ambiguous"
    alarm = {
        "name": "unjudged",
        "actuator": 1,
        "active": True,
        "latched": True,
        "since_s": 5.0,
        "value": 7.0,
        "limit": 6.0,
    }
    source._alarms["unjudged", 1] = alarm | {"text": "advisory: actuator 2: no valid reading for 7.0 s"}
    page = opened(serve(source))
    page.until_alert("active")
    assert "Not judged · actuator 2" in page.alerts()[0][1]
    page.until("document.querySelectorAll('.card')[1].querySelector('.verdict').textContent === 'alarm'")
    source._alarms["unjudged", 1]["active"] = False
    page.until_alert("latched")
    page.until("document.querySelectorAll('.card')[1].querySelector('.verdict').textContent === 'latched'")


def test_an_alarm_is_spoken_once_whatever_its_numbers_do(
    serve: Callable[..., Page], opened: Callable[..., Opened]
) -> None:
    source = MadeUp(1)
    source.fill(5)
    page = opened(serve(source))
    page.until_state("running")
    page.page.evaluate(
        "window.spoken = []; new MutationObserver((all) => window.spoken.push(all[0].target.textContent))"
        ".observe(document.querySelector('.spoken'), { childList: true, characterData: true, subtree: true })"
    )
    assert page.page.evaluate("document.querySelector('.alerts').closest('[aria-live]')") is None
    assert page.page.evaluate("document.querySelector('.spoken').getAttribute('role')") == "alert"
    source.delay_s[0] = 0.02
    page.until_alert("active")
    for milli in range(21, 25):
        source._alarms["delay", 0]["text"] = f"delay of {milli} ms"
        page.until(f"document.querySelector('.alerts').innerText.includes('delay of {milli} ms')")
    source.delay_s[0] = 0.004
    page.until_alert("latched")
    page.until("window.spoken.length > 1")
    assert page.page.evaluate("window.spoken") == ["Alarm: Delay · actuator 1.", "Latched: Delay · actuator 1."]


def test_axes_bear_the_unit_of_the_chosen_actuator(serve: Callable[..., Page], opened: Callable[..., Opened]) -> None:
    label = "document.querySelector('[data-chart=\"{}\"]').chart.u.axes[{}].label()"
    axes = [("scope", 1), ("loop", 0), ("loop", 1), ("spectrum-log", 1)]
    source = MadeUp(2)
    source.fill(5)
    page = opened(serve(source))
    page.until_state("running")
    named = ["Displacement", "Target", "Measured", "Amplitude"]
    assert [page.page.evaluate(label.format(*axis)) for axis in axes] == named
    source.units = ["mm", None]
    page = opened(serve(source))
    page.until_state("running")
    assert [page.page.evaluate(label.format(*axis)) for axis in axes] == [f"{name} (mm)" for name in named]
    page.page.locator(".card").nth(1).click()
    assert [page.page.evaluate(label.format(*axis)) for axis in axes] == named


def test_what_could_not_be_sent_or_written_is_told_when_there_is_any(
    serve: Callable[..., Page], opened: Callable[..., Opened]
) -> None:
    source = MadeUp(1)
    source.health |= {"unsent": 0}
    source.fill(5)
    page = opened(serve(source))
    page.until("document.querySelector('.health').innerText.includes('readings')")
    assert "not sent" not in page.page.locator(".health").inner_text()
    source.health |= {"unsent": 3, "not_written": 4}
    page.until("/not sent\\s+3\\s+not written\\s+4/.test(document.querySelector('.health').innerText)")


def test_a_lost_connection_shows_within_two_seconds_and_the_page_comes_back_by_itself(
    serve: Callable[..., Page], opened: Callable[..., Opened]
) -> None:
    source = MadeUp(2)
    source.fill(20)
    first = serve(source)
    page = opened(first)
    page.until_state("running")
    started = time.monotonic()
    first.stop()
    assert time.monotonic() - started < 1
    page.until_state("lost")
    assert time.monotonic() - started < 2
    assert page.alerts()[0][0] == "trouble"
    assert "Lost connection" in page.alerts()[0][1]
    assert page.page.evaluate("Number(getComputedStyle(document.querySelector('.card .big')).opacity)") < 0.6

    port = int(first.url.rpartition(":")[2].strip("/"))
    second = serve(source, port)
    assert second.url == first.url
    page.until_state("running")
    before = page.value("delay-0")
    page.until(f"document.querySelector('[data-value=delay-0]').textContent !== '{before}'")


def test_a_browser_that_returns_to_the_same_run_is_sent_only_what_it_missed(serve: Callable[..., Page]) -> None:
    source = MadeUp(1)
    source.fill(60)
    page = serve(source)
    with events(page) as stream:
        name, identity, hello = next(stream)
        assert (name, json.loads(hello)["n_actuators"]) == ("hello", 1)
        name, identity, frame = next(stream)
        assert name == "frame"
        assert len(json.loads(frame)["readings"]) >= 60 * UPDATE_HZ
    with events(page, last=identity) as stream:
        next(stream)
        assert len(json.loads(next(stream)[2])["readings"]) < 3 * UPDATE_HZ
    with events(page, last="other-" + identity.partition("-")[2]) as stream:
        next(stream)
        assert len(json.loads(next(stream)[2])["readings"]) >= 60 * UPDATE_HZ


def test_silence_and_waiting_are_unmistakable(serve: Callable[..., Page], opened: Callable[..., Opened]) -> None:
    source = MadeUp(1)
    source.waiting = True
    page = opened(serve(source))
    page.until_state("waiting")
    page.until("document.querySelector('.alerts').innerText.includes('Waiting for the first sample')")
    assert page.value("delay-0") == "\N{EN DASH}"
    source.waiting = False
    page.until_state("running")
    source.silent = True
    page.until_state("silent")
    page.until("document.querySelector('.alerts .trouble') !== null")
    assert "no sample for" in page.alerts()[0][1]
    # Still connected: nothing is new, but frames go on.
    page.page.wait_for_timeout(2000)
    assert page.state() == "silent"
    source.silent = False
    page.until_state("running")


def test_a_still_actuator_is_drawn_as_a_line(
    serve: Callable[..., Page], opened: Callable[..., Opened], monkeypatch: pytest.MonkeyPatch
) -> None:
    source = MadeUp(1)
    monkeypatch.setattr(source, "target", np.zeros_like)
    source.reason[0] = "not determined: too little motion to judge by"
    source.fill(10)
    page = opened(serve(source))
    page.until("Number(document.documentElement.dataset.frames || 0) > 10")
    scale = "(({min, max}) => [min, max])(document.querySelector('[data-chart=\"scope\"]').chart.u.scales.y)"
    low, high = page.page.evaluate(scale)
    assert low < 0 < high
    assert 0.5 < high - low < 5


def test_a_script_in_a_name_a_reason_or_an_event_is_only_text(
    serve: Callable[..., Page], opened: Callable[..., Opened]
) -> None:
    nasty = "<img src=x onerror=alert(1)><script>alert(2)</script>\u2028</script>"
    source = MadeUp(2, names=[nasty, "b"])
    source.fill(5)
    source.reason[0] = f"not determined: {nasty}"
    source.delay_s[1] = 0.02
    source.event(nasty)
    source.health["log"] = nasty
    page = opened(serve(source))
    page.until_alert("active")
    page.until("document.querySelector('.card.invalid') !== null")
    assert "<script>alert(2)</script>" in page.page.locator(".card").first.inner_text()
    assert "<script>" in page.page.locator(".events").inner_text()
    assert page.page.evaluate("document.querySelectorAll('main img, main script, .alerts *[onerror]').length") == 0


def test_the_page_is_used_by_keyboard(serve: Callable[..., Page], opened: Callable[..., Opened]) -> None:
    source = MadeUp(3)
    source.fill(10)
    page = opened(serve(source))
    page.until_state("running")
    page.page.keyboard.press("Tab")
    for key, chosen in (("ArrowRight", 1), ("ArrowRight", 2), ("ArrowRight", 0), ("End", 2)):
        page.page.keyboard.press(key)
        checked = "[...document.querySelectorAll('.card')].findIndex((c) => c.getAttribute('aria-checked') === 'true')"
        assert page.page.evaluate(checked) == chosen
    assert "actuator 3" in page.page.locator("h2", has_text="Target and measured").inner_text()
    page.page.keyboard.press("Tab")
    page.page.keyboard.press("ArrowRight")
    shown = "document.querySelector('[data-chart=\"delay\"]').chart.u.series.slice(1, 4).map((s) => s.show)"
    assert page.page.evaluate(shown) == [False, False, True]
    page.page.locator('[data-chart="delay"]').focus()
    page.page.keyboard.press("+")
    page.until("!document.querySelector('.follow').hidden")
    page.page.keyboard.press("Escape")
    page.until("document.querySelector('.follow').hidden")


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (1000, "dark"), (1600, "light")])
def test_nothing_sticks_out_at_any_width(
    serve: Callable[..., Page], opened: Callable[..., Opened], width: int, scheme: str
) -> None:
    source = MadeUp(4)
    source.fill(10)
    source.delay_s[3] = 0.02
    source.reason[2] = "not determined: only 3 % of measured follows target; is this the right pair?"
    page = opened(serve(source), color_scheme=scheme)
    page.page.set_viewport_size({"width": width, "height": 900})
    page.until_alert("active")
    page.until("Number(document.documentElement.dataset.frames || 0) > 5")
    assert page.page.evaluate("document.documentElement.scrollWidth") <= width


# ---------------------------------------------------------------------------------------------------- late and foreign


def address(page: Page) -> tuple[str, int]:
    host, _, port = page.url.removeprefix("http://").strip("/").rpartition(":")
    return host.strip("[]"), int(port)


def ask(page: Page, path: str = "/", method: str = "GET", **headers: str | None) -> http.client.HTTPResponse:
    """One request, with headers of choice; None leaves one out."""
    host, port = address(page)
    connection = http.client.HTTPConnection(host, port, timeout=PATIENCE_S)
    names = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.putrequest(method, path, skip_host="Host" in names)
    for name, value in names.items():
        if value is not None:
            connection.putheader(name, value)
    connection.endheaders()
    return connection.getresponse()


@contextmanager
def events(page: Page, last: str | None = None) -> Iterator[Iterator[tuple[str, str, str]]]:
    """The stream's events: name, id, text."""
    answer = ask(page, "/events", **({"Last_Event_ID": last} if last else {}))
    assert answer.status == 200

    def each() -> Iterator[tuple[str, str, str]]:
        known: dict[str, str] = {}
        for raw in answer:
            key, _, value = raw.decode().rstrip("\n").partition(": ")
            if key:
                known[key] = value
            elif "data" in known:
                yield known["event"], known["id"], known["data"]
                known = {}

    try:
        yield each()
    finally:
        answer.close()


def test_three_browsers_watch_at_once(serve: Callable[..., Page], opened: Callable[..., Opened]) -> None:
    source = MadeUp(4)
    page = serve(source)
    watching = [opened(page) for _ in range(3)]
    for one in watching:
        one.until_state("running")
    for one in watching:
        before = one.draws()
        one.until(f"Number(document.documentElement.dataset.frames) > {before + 5}")


def test_a_browser_that_never_reads_harms_nobody_and_is_dropped(
    serve: Callable[..., Page], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_page._Handler, "timeout", 1.0)
    source = MadeUp(4)
    source.fill(500)  # more than the sockets of one connection hold
    page = serve(source)
    with socket.create_connection(address(page)) as stalled:
        stalled.sendall(f"GET /events HTTP/1.1\r\nHost: {page.url[7:-1]}\r\n\r\n".encode())
        wait_until(lambda: page._server._n_browsers == 1)
        with events(page) as stream:
            for _ in range(62):
                next(stream)
        # The one that reads has left, the one that does not was dropped.
        wait_until(lambda: page._server._n_browsers == 0)


def test_the_seventeenth_browser_is_told_why_it_sees_nothing(
    serve: Callable[..., Page], opened: Callable[..., Opened]
) -> None:
    page = serve(MadeUp(1))
    with ExitStack() as stack:
        for _ in range(16):
            next(stack.enter_context(events(page)))
        refused = ask(page, "/events")
        assert refused.status == 503
        assert refused.read().decode() == (
            "16 browsers are watching already, which is as many as may; close one of them.\n"
        )
        late = ask(page, "/")  # the page itself is there, and says the same
        assert late.status == 200
        late.close()
    deadline = time.monotonic() + 5
    while ask(page, "/events", "HEAD").status == 503 and time.monotonic() < deadline:
        time.sleep(0.05)
    with events(page) as stream:
        assert next(stream)[0] == "hello"


def test_a_browser_too_many_gets_its_place_when_one_leaves(
    serve: Callable[..., Page], browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_page, "MOST_BROWSERS", 1)
    page = serve(MadeUp(1))
    context = browser.new_context()
    late = Opened(context.new_page())
    with events(page) as stream:
        next(stream)
        late.page.goto(page.url)
        late.until("document.querySelector('.alerts').innerText.includes('as many browsers as may')")
    late.until_state("running")
    context.close()


def test_connections_that_ask_nothing_are_bounded_and_dropped(
    serve: Callable[..., Page], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_page._Handler, "timeout", 0.5)
    page = serve(MadeUp(1))
    threads = threading.active_count()
    idle = [socket.create_connection(address(page)) for _ in range(100)]
    time.sleep(0.3)
    assert threading.active_count() - threads <= live_page.MOST_CONNECTIONS
    time.sleep(0.6)
    assert ask(page).status == 200
    for one in idle:
        one.close()


@pytest.mark.parametrize(
    ("path", "method", "headers", "status"),
    [
        ("/", "GET", {}, 200),
        ("/", "HEAD", {}, 200),
        ("/events", "HEAD", {}, 200),
        ("/?theme=dark", "GET", {}, 200),
        ("/", "GET", {"Host": "localhost:{port}"}, 200),
        ("/", "GET", {"Host": "[::1]:{port}"}, 200),
        ("/", "GET", {"Origin": "http://127.0.0.1:{port}"}, 200),
        ("/", "GET", {"Sec_Fetch_Site": "cross-site"}, 200),  # a link
        ("/", "POST", {}, 405),
        ("/events", "PUT", {}, 405),
        ("/", "DELETE", {}, 405),
        ("/", "OPTIONS", {}, 405),
        ("/", "BREW", {}, 405),
        ("/favicon.ico", "GET", {}, 404),
        ("/live.js", "GET", {}, 404),
        ("/../pyproject.toml", "GET", {}, 404),
        ("/%2e%2e/%2e%2e/etc/passwd", "GET", {}, 404),
        ("/events/", "GET", {}, 404),
        ("http://rebound.example/", "GET", {}, 403),
        ("/", "GET", {"Host": None}, 403),
        ("/", "GET", {"Host": ""}, 403),
        # The near end of a tunnel has a port of its own.
        ("/", "GET", {"Host": "127.0.0.1"}, 200),
        ("/events", "HEAD", {"Host": "localhost:9000", "Origin": "http://localhost:9000"}, 200),
        ("/", "GET", {"Host": "[::1]:9000"}, 200),
        ("/", "GET", {"Host": "127.0.0.1:x"}, 403),
        ("/", "GET", {"Host": "evil.example@localhost:9000"}, 403),
        ("/", "GET", {"Host": "localhost:9000:9000"}, 403),
        ("/events", "GET", {"Origin": "http://127.0.0.1:9000"}, 403),  # another page of this machine
        ("/", "GET", {"Host": "rebound.example:{port}"}, 403),
        ("/events", "GET", {"Host": "rebound.example:{port}"}, 403),
        ("/", "GET", {"Host": "127.0.0.1.example:{port}"}, 403),
        ("/events", "GET", {"Origin": "http://evil.example"}, 403),
        ("/events", "GET", {"Origin": "null"}, 403),
        ("/events", "GET", {"Origin": "https://127.0.0.1:{port}"}, 403),
        ("/events", "GET", {"Origin": "http://localhost:{port}"}, 403),  # not the host it was asked under
        ("/events", "GET", {"Sec_Fetch_Site": "cross-site"}, 403),  # a picture in a foreign page
    ],
)
def test_what_is_answered_and_what_is_refused(
    serve: Callable[..., Page], path: str, method: str, headers: dict[str, str | None], status: int
) -> None:
    page = serve(MadeUp(1))
    _, port = address(page)
    sent = {name: value and value.format(port=port) for name, value in headers.items()}
    answer = ask(page, path, method, **sent)
    assert answer.status == status
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert answer.headers["X-Frame-Options"] == "DENY"
    assert answer.headers["Cache-Control"] == "no-store"
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    assert "unsafe" not in answer.headers["Content-Security-Policy"]
    if status >= 400 and method != "HEAD":
        words = answer.read().decode()
        assert words.count("\n") == 1
        assert path == "/" or path not in words
    if status == 405:
        assert answer.headers["Allow"] == "GET, HEAD"
    if method == "HEAD":
        assert answer.read() == b""
    answer.close()


@pytest.mark.parametrize("request_line", [b"\r\n\r\n", b"\x00\xff\r\n\r\n", b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n"])
def test_malformed_requests_end_without_a_word_on_the_terminal(
    serve: Callable[..., Page], capfd: pytest.CaptureFixture[str], request_line: bytes
) -> None:
    page = serve(MadeUp(1))
    with socket.create_connection(address(page), timeout=5) as connection:
        connection.sendall(request_line)
        connection.shutdown(socket.SHUT_WR)
        while connection.recv(4096):
            pass
    with socket.create_connection(address(page), timeout=5) as connection:
        connection.sendall(b"GET /" + b"x" * 100_000)
    assert ask(page).status == 200
    page.stop()
    assert capfd.readouterr() == ("", "")


def test_other_names_are_accepted_only_where_they_are_listed(serve: Callable[..., Page]) -> None:
    page = serve(MadeUp(1), host="0.0.0.0", allowed_hosts=["lab.example"])
    _, port = address(page)
    assert page.url == f"http://127.0.0.1:{port}/"
    assert ask(page, Host=f"lab.example:{port}").status == 200
    assert ask(page, Host=f"LAB.example:{port}").status == 200
    assert ask(page, Host="lab.example:9000").status == 200
    assert ask(page, Host=f"other.example:{port}").status == 403


def test_the_page_listens_at_ipv6_loopback(serve: Callable[..., Page]) -> None:
    if not socket.has_ipv6 or not Path("/proc/net/if_inet6").exists():
        pytest.skip("this machine has no IPv6")
    page = serve(MadeUp(1), host="::1")
    assert page.url.startswith("http://[::1]:")
    assert ask(page).status == 200


def test_a_port_in_use_and_an_impossible_address_are_one_clear_line(serve: Callable[..., Page]) -> None:
    _, port = address(serve(MadeUp(1)))
    with pytest.raises(SettingError, match=rf"^the page cannot listen at 127\.0\.0\.1:{port}: the port is in use; .*$"):
        Page(MadeUp(1), port)
    with pytest.raises(SettingError, match=r"^the page's port is 70000; expected 1 to 65535"):
        Page(MadeUp(1), 70000)
    with pytest.raises(SettingError, match=r"^the page cannot listen at 192\.0\.2\.1:0: this machine does not have"):
        Page(MadeUp(1), 0, host="192.0.2.1")
    with pytest.raises(SettingError, match=r"^the page cannot listen at 'no such host': not an address of this"):
        Page(MadeUp(1), 0, host="no such host")


def test_stop_ends_open_streams_at_once_and_may_be_called_twice() -> None:
    threads = threading.active_count()
    page = Page(MadeUp(4), 0)
    page.start()
    with ExitStack() as stack:
        for _ in range(5):
            next(stack.enter_context(events(page)))
        started = time.monotonic()
        page.stop()
        page.stop()
        assert time.monotonic() - started < 1
    deadline = time.monotonic() + 2
    while threading.active_count() > threads and time.monotonic() < deadline:
        time.sleep(0.02)
    assert threading.active_count() == threads
    never_started = Page(MadeUp(1), 0)
    never_started.stop()
