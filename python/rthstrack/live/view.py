"""The terminal view: a table of what each actuator does now, the input's health, alarms and what happened last."""

from __future__ import annotations

import contextlib
import math
import os
import re
import select
import sys
from collections import deque
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.live import Live as Screen
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from types import TracebackType
    from typing import TextIO

# What happened last: so many lines of it.
_EVENTS = 6
_TOTALS = ("received", "lost", "repeated", "reordered", "malformed", "refused", "filled", "restarts")


class View:
    """Draws on a terminal from `__enter__` to `__exit__`, which restores it however the monitor ends."""

    def __init__(self, stream: TextIO, about: str, names: Sequence[str]) -> None:
        self._about = about
        self._names = names
        self._events: deque[str] = deque(maxlen=_EVENTS)
        self._console = Console(file=stream, force_terminal=True, highlight=False)
        self._screen = Screen(console=self._console, screen=True, auto_refresh=False)
        self._keys = Keys()

    def __enter__(self) -> View:
        self._screen.start()
        self._keys.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._keys.close()
        # The terminal may be gone.
        with contextlib.suppress(OSError):
            self._screen.stop()

    def keys(self) -> str:
        """The keys pressed since the last call."""
        return self._keys.pressed()

    def draw(self, status: Mapping[str, Any], lines: Sequence[str]) -> None:
        """Shows a status; lines: what has happened since the last one."""
        self._events.extend(lines)
        self._screen.update(
            shown(status, self._about, self._names, self._events, with_keys=self._keys.are_read), refresh=True
        )


def shown(
    status: Mapping[str, Any], about: str, names: Sequence[str], events: Sequence[str], *, with_keys: bool = True
) -> Group:
    """The whole view of a status, as rich draws it."""
    parts: list[Any] = [Text(about, style="bold"), _actuators(status, names), Text(""), *_health(status)]
    for alarm in status["alarms"]:
        if alarm["active"] or alarm["latched"]:
            over = "" if alarm["active"] else " (over, held until it is reset)"
            parts.append(Text(f"ALARM {named(alarm['text'], names)}{over}", style="bold red"))
    parts += [Text(line, style="dim") for line in events]
    if with_keys:
        parts.append(Text("r resets alarms, q quits", style="dim"))
    return Group(*parts)


def named(text: str, names: Sequence[str]) -> str:
    """A text of the monitor with an actuator called by its name."""
    found = re.search(r"\bactuator (\d+):", text)
    if found is None or int(found[1]) >= len(names):
        return text
    return f"{text[: found.start()]}{names[int(found[1])]}:{text[found.end() :]}"


def _actuators(status: Mapping[str, Any], names: Sequence[str]) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("")
    for head in ("A (95 % interval)", "d in ms (95 % interval)", "at Hz"):
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("")
    raised = {alarm["actuator"] for alarm in status["alarms"] if alarm["active"] or alarm["latched"]}
    latest = {reading["actuator"]: reading for reading in status["readings"] if reading is not None}
    for actuator, name in enumerate(names):
        style = "bold red" if actuator in raised else ""
        if actuator in latest:
            cells = _reading(latest[actuator], style)
        else:
            cells = ["-", "-", "-", Text("no reading yet", style="dim")]
        table.add_row(Text(name, style=style), *cells)
    return table


def _reading(reading: Mapping[str, Any], style: str) -> list[str | Text]:
    def number(name: str) -> float:
        return math.nan if reading[name] is None else float(reading[name])

    amplitude = _with_interval(number("amplitude"), reading["amplitude_interval"], 4)
    delay = _with_interval(1e3 * number("delay_s"), reading["delay_interval_s"], 3, 1e3)
    frequency = number("equivalent_frequency_hz")
    said = Text("valid", style="green") if reading["valid"] else Text(reading["reason"] or "not valid", style="yellow")
    if reading["valid"] and reading["reason"]:
        said.append(f": {reading['reason']}", style="dim")
    at = f"{frequency:.4g}" if math.isfinite(frequency) else "-"
    return [Text(amplitude, style=style), Text(delay, style=style), at, said]


def _with_interval(value: float, interval: Sequence[float] | None, places: int, factor: float = 1.0) -> str:
    """Always as many digits: what stands still does not seem to move."""
    if not math.isfinite(value):
        return "-"
    if interval is None:
        return f"{value:.{places}f}"
    low, high = (factor * end for end in interval)
    return f"{value:.{places}f} ({low:.{places}f} to {high:.{places}f})"


def _health(status: Mapping[str, Any]) -> list[Text]:
    health = status["health"]
    state = Text(status["state"], style={"running": "green", "waiting": "yellow"}.get(status["state"], "bold red"))
    time_s, pace_hz = status.get("time_s"), health.get("pace_hz")
    told = [f"{time_s:.1f} s"] if time_s is not None else []
    told += [f"{pace_hz:.6g} Hz arrive"] if pace_hz is not None else []
    told += [f"{health[name]} {name}" for name in _TOTALS if health.get(name) or name in ("received", "lost")]
    state.append(" " + ", ".join(told), style="default")
    log = health.get("log")
    lines = [state]
    if log:
        lost = f", {health['log_dropped']} samples did not fit" if health.get("log_dropped") else ""
        lines.append(Text(f"log: {log}{lost}", style="bold red" if log.startswith("stopped") or lost else "dim"))
    return lines


class Keys:
    """Single keys from the terminal, which is put back as it was; from /dev/tty where standard input brings samples."""

    def __init__(self) -> None:
        self._file: int | None = None
        self._restore: Callable[[], None] | None = None
        self._own = False

    @property
    def are_read(self) -> bool:
        """Whether there is a terminal to read from."""
        return self._file is not None

    def open(self) -> None:
        """From here on keys come at once and are not shown; Ctrl-C stays what it is."""
        try:
            import termios
            import tty
        except ImportError:
            # No POSIX terminal: the view does without keys.
            return
        try:
            file = sys.stdin.fileno() if sys.stdin.isatty() else os.open("/dev/tty", os.O_RDONLY)
        except (OSError, ValueError, AttributeError):
            return
        self._own = not sys.stdin.isatty()
        try:
            before = termios.tcgetattr(file)
            tty.setcbreak(file, termios.TCSANOW)
        except termios.error:
            self._file = file
            self.close()
            return
        self._file = file

        def restore() -> None:
            with contextlib.suppress(termios.error):
                termios.tcsetattr(file, termios.TCSANOW, before)

        self._restore = restore

    def close(self) -> None:
        """The terminal as it was; may be called again."""
        if self._restore is not None:
            self._restore()
            self._restore = None
        if self._file is not None and self._own:
            os.close(self._file)
        self._file = None

    def pressed(self) -> str:
        """What was pressed since the last call, without waiting."""
        if self._file is None:
            return ""
        try:
            if not select.select([self._file], [], [], 0)[0]:
                return ""
            found = os.read(self._file, 64)
        except OSError:
            found = b""
        if not found:
            # The terminal is gone.
            self.close()
        # Arrows and function keys come as sequences.
        return "" if found.startswith(b"\x1b") else found.decode("ascii", "replace")
