"""A stand-in for `rthstrack._core.Live`, in Python: samples come by the clock, all else is what a test sets.

Run as a program it is `rthstrack monitor` around that stand-in.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from typing import Any

import numpy as np

from rthstrack._core import settings_table

HEALTH = {
    "received": 0, "lost": 0, "repeated": 0, "reordered": 0, "malformed": 0, "refused": 0, "filled": 0, "restarts": 0,
    "readings": 0, "pace_hz": None, "age_s": None, "log": None, "log_code": None, "log_dropped": 0,
}  # fmt: skip
MONITOR = {
    "rate_hz", "window_s", "update_hz", "band_hz", "window", "detrend", "estimator", "data_decimation",
    "frequency_decimation", "max_delay_s", "expected_delay_s", "minimum_amplitude", "n_actuators",
}  # fmt: skip
SOURCE = {"kind", "address", "senders", "layout", "fill_samples", "check_pace", "path"}
ALARMS = {setting["name"] for setting in settings_table("alarms") if setting["name"] != "unjudged_s"}
OUTPUTS = {"readings_udp", "readings_file", "alarm_udp", "control", "log", "page", "names", "units"}


def event(code: str, time_s: float | None, text: str, **values: Any) -> dict[str, Any]:
    """An event as the compiled part tells it."""
    return {"time_s": time_s, "code": code, "values": values, "kept_back": 0, "text": text}


class FakeLive:
    """The last one made is `FakeLive.made`; class attributes say how the next ones behave."""

    made: FakeLive
    #: What construction raises.
    refusal: Exception | None = None
    #: Ends by itself so long after the start, with this to say.
    ends_after_s: float | None = None
    end_reason: str | None = None
    #: An alarm so long after the start.
    alarm_after_s: float | None = None
    alarm_name = "delay"
    #: Why readings are not valid.
    reason: str | None = None
    reason_code: str | None = None
    events: tuple[dict[str, Any], ...] = ()
    totals: dict[str, int] = {}  # noqa: RUF012

    def __init__(self, monitor: Any, source: Any, alarms: Any, outputs: Any) -> None:
        if self.refusal is not None:
            raise self.refusal
        # The keys that the compiled part takes, no more and no less.
        assert (set(monitor), set(source), set(alarms)) == (MONITOR, SOURCE, ALARMS)
        assert set(outputs) == OUTPUTS
        type(self).made = self
        self.monitor, self.source, self.alarms, self.outputs = monitor, source, alarms, outputs
        self.rate_hz, self.n_actuators = monitor["rate_hz"], monitor["n_actuators"]
        self.begin_s: float | None = None
        self.stop_s: float | None = None
        self.sample = self.reading = 0
        self.log: list[tuple[str | None, str | None]] = []
        self.resets = 0
        self.ended = threading.Event()

    def _now_s(self) -> float:
        if self.begin_s is None:
            return 0.0
        return (time.monotonic() if self.stop_s is None else self.stop_s) - self.begin_s

    def start(self) -> None:
        self.begin_s = time.monotonic()

    def stop(self) -> None:
        if self.stop_s is None:
            self.stop_s = time.monotonic()
        self.ended.set()

    def wait(self, timeout_s: float) -> bool:
        self.ended.wait(timeout_s)
        return self.ended.is_set() or (self.ends_after_s is not None and self._now_s() >= self.ends_after_s)

    def address(self) -> str:
        return self.source["address"].replace(":0", ":54321")

    def control_address(self) -> str:
        return "127.0.0.1:54322" if self.outputs["control"] else ""

    def fatal(self) -> str | None:
        return self.end_reason

    def reset(self) -> None:
        self.resets += 1
        self.events = (*self.events, event("alarms_reset", 0.0, f"alarms were reset ({self.resets})"))

    def summary(self) -> dict[str, int]:
        keys = ("received", "lost", "repeated", "reordered", "malformed", "readings", "alarms")
        totals = dict.fromkeys((*keys, "filled", "restarts", "refused", "log_dropped"), 0)
        readings = self.totals.get("readings", 1)
        came = {"received": max(1, int(self._now_s() * self.rate_hz)), "readings": readings, "valid": readings}
        return totals | came | self.totals

    def alarmed(self) -> bool:
        return self.alarm_after_s is not None and self._now_s() >= self.alarm_after_s

    def hello(self) -> str:
        return json.dumps({"n_actuators": self.n_actuators})

    def frame(self, cursor: int) -> tuple[str, int]:
        return self.status(), cursor + 1

    def status(self) -> str:
        now_s = self._now_s()
        alarm = {
            "name": self.alarm_name, "actuator": 0, "active": self.alarmed(), "latched": False,
            "since_s": self.alarm_after_s, "value": 0.021, "limit": 0.02,
            "text": "advisory: actuator 1: lag of up to 21.000 ms, limit 20.000 ms",
        }  # fmt: skip
        if self.alarm_name == "silence":
            alarm |= {"actuator": None, "text": "advisory: no sample for more than 1.0 s"}
        reading = {
            "index": 0, "time_s": now_s, "centre_s": now_s - 2, "actuator": 0, "amplitude": 1.02, "delay_s": 0.0123,
            "phase_rad": -0.1, "equivalent_frequency_hz": 2.5, "amplitude_interval": [1.01, 1.03],
            "delay_interval_s": [0.0121, 0.0125], "valid": self.reason is None,
            "reason": self.reason, "reason_code": self.reason_code, "reason_values": None,
        }  # fmt: skip
        of = {"alarm": alarm["name"], "actuator": alarm["actuator"]}
        raised = [event("alarm_raised", self.alarm_after_s, alarm["text"], **of)] if self.alarmed() else []
        state, why = next(iter(self.log[-1:]), (None, None))
        log = {"log": state if why is None else f"{state}: {why}", "log_code": state}
        return json.dumps(
            {
                "time_s": now_s,
                "state": "running",
                "health": HEALTH | {"received": int(now_s * self.rate_hz), "pace_hz": self.rate_hz} | log,
                "readings": [reading, *[None] * (self.n_actuators - 1)],
                "alarms": [alarm],
                "events": [*self.events, *raised],
            }
        )

    def take_samples(self) -> dict[str, Any]:
        end = int(self._now_s() * self.rate_hz)
        index = np.arange(self.sample, end, dtype=np.int64)
        self.sample = end
        values = np.sin(index[:, None] / 50 + np.arange(self.n_actuators))
        return {
            "index": index,
            "time_s": index / self.rate_hz,
            "counter": index + 7,
            "filled": index % 100 == 99,
            "target": values,
            "measured": 0.9 * values,
        }

    def take_readings(self) -> dict[str, Any]:
        end = int(self._now_s() * self.monitor["update_hz"])
        n = end - self.reading
        index = np.arange(self.reading, end, dtype=np.int64)
        self.reading = end
        return {
            "index": index,
            "time_s": index / 16,
            "centre_s": index / 16 - 2,
            "actuator": np.zeros(n, np.int64),
            **{name: np.full(n, 0.5) for name in ("amplitude", "delay_s", "phase_rad", "equivalent_frequency_hz")},
            "amplitude_interval": np.tile([0.4, 0.6], (n, 1)),
            "delay_interval_s": np.full((n, 2), np.nan),
            "valid": np.ones(n, np.bool_),
            "reason": [""] * n,
            "reason_code": [""] * n,
            "reason_values": [()] * n,
            **{name: np.full(n, 3, np.int64) for name in ("received", "lost", "repeated", "reordered", "malformed")},
            "alarms": ["delay"] * n,
        }

    def note_log(self, state: str | None, why: str | None = None) -> None:
        self.log.append((state, why))


if __name__ == "__main__":
    from rthstrack import _core
    from rthstrack.cli import main

    _core.Live = FakeLive  # type: ignore[misc, assignment]
    sys.exit(main(["monitor", *sys.argv[1:]]))
