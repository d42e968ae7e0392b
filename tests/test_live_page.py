"""The live page in a browser, fed by a monitor that is made up here: what it says, and that nobody can harm it."""

from __future__ import annotations

import json
import math
import threading
import time
from typing import Any

import numpy as np

RATE_HZ, UPDATE_HZ, WINDOW_S = 256.0, 64.0, 4.0
PER_READING = int(RATE_HZ / UPDATE_HZ)
LIMIT_DELAY_S, LIMIT_AMPLITUDE = 0.015, 0.1


class MadeUp:
    """A monitor of sines: 64 readings a second of every actuator, as long as it is not `silent`."""

    def __init__(self, n_actuators: int = 4, names: list[str] | None = None, rate_hz: float = RATE_HZ) -> None:
        self.rate_hz, self.per_reading = rate_hz, int(rate_hz / UPDATE_HZ)
        self.names = names or [f"actuator {k}" for k in range(n_actuators)]
        self.delay_s = [0.004 + 0.002 * k for k in range(n_actuators)]
        self.amplitude = [0.98 + 0.01 * k for k in range(n_actuators)]
        self.reason: list[str | None] = [None] * n_actuators
        self.silent = self.waiting = False
        self.health = {"lost": 0, "malformed": 0, "log": "writing"}
        self._alarms: dict[tuple[str, int], dict[str, Any]] = {}
        self._events: list[tuple[int, dict[str, Any]]] = []
        self._readings: list[list[Any]] = []
        self._lock = threading.Lock()
        self._started, self._lost_s, self._n = time.monotonic(), 0.0, 0
        self.frames = 0

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
            }
        )

    def target(self, t: Any) -> Any:
        return 12 * np.sin(5.1 * t) + 5 * np.sin(14.3 * t + 1) * np.sin(0.31 * t)

    def event(self, text: str) -> None:
        with self._lock:
            self._events.append((self._n, {"time_s": self._n / self.rate_hz, "text": text}))

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
                self._events.append((self._n, {"time_s": t, "text": f"raised: {text}"}))
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
        first = cursor // self.per_reading * n
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
            return np.round(2 / n * np.abs(np.fft.rfft(wave * np.hanning(n) * 2)), 7).tolist()

        every = range(len(self.names))
        return {
            "frequency_hz": np.fft.rfftfreq(n, 1 / self.rate_hz).tolist(),
            "target": [spectrum(k, 1, 0) for k in every],
            "measured": [spectrum(k, self.amplitude[k], self.delay_s[k]) for k in every],
        }
