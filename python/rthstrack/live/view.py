"""The terminal view: a table of what each actuator does now, the input's health, alarms and what happened last."""

from __future__ import annotations

import contextlib
import math
import os
import select
import sys
from collections import deque
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.live import Live as Screen
from rich.table import Table
from rich.text import Text

from rthstrack.display import with_interval

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from types import TracebackType
    from typing import TextIO

# What happened last: so many lines of it.
_EVENTS = 6
_TOTALS = ("received", "lost", "repeated", "reordered", "malformed", "refused", "filled", "restarts")
# Places in a reading's row.
_ACTUATOR, _A, _D, _F, _A_LOW, _A_HIGH, _D_LOW, _D_HIGH, _VALID, _REASON = 3, 4, 5, 7, 8, 9, 10, 11, 12, 13


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
    alarms = [alarm for alarm in status["alarms"] if alarm["active"] or alarm["latched"]]
    parts += [Text(f"ALARM {alarm_text(alarm, names)}", style="bold red") for alarm in alarms]
    parts += [Text(line, style="dim") for line in events]
    if with_keys:
        parts.append(Text("r resets alarms, q quits", style="dim"))
    return Group(*parts)


def alarm_text(alarm: Mapping[str, Any], names: Sequence[str]) -> str:
    """An alarm in a line: whose it is, what it says, and whether it is over."""
    actuator = alarm["actuator"]
    which = f"{names[actuator]}: " if isinstance(actuator, int) and actuator < len(names) else ""
    over = " (over, not yet reset)" if not alarm["active"] else ""
    return f"{which}{alarm['text']}{over}"


def _actuators(status: Mapping[str, Any], names: Sequence[str]) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("")
    for head in ("A", "d (95 % interval)", "at Hz"):
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("")
    latest = {row[_ACTUATOR]: row for row in status["readings"]}
    raised = {alarm["actuator"] for alarm in status["alarms"] if alarm["active"] or alarm["latched"]}
    for actuator, name in enumerate(names):
        style = "bold red" if actuator in raised else ""
        row = latest.get(actuator)
        if row is None:
            table.add_row(Text(name, style=style), "-", "-", "-", Text("no reading yet", style="dim"))
            continue
        number = [math.nan if value is None else float(value) for value in row[_A:_VALID]]
        a, d, f, a_low, a_high, d_low, d_high = (number[i - _A] for i in (_A, _D, _F, _A_LOW, _A_HIGH, _D_LOW, _D_HIGH))
        said = Text("valid", style="green") if row[_VALID] else Text(row[_REASON] or "not valid", style="yellow")
        if row[_VALID] and row[_REASON]:
            said.append(f": {row[_REASON]}", style="dim")
        table.add_row(
            Text(name, style=style),
            Text(with_interval(a, (a_low, a_high)), style=style),
            Text(with_interval(1e3 * d, (1e3 * d_low, 1e3 * d_high), "ms"), style=style),
            f"{f:.4g}" if math.isfinite(f) else "-",
            said,
        )
    return table


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
