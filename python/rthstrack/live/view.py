"""The terminal view: a table of what each actuator does now, the input's health, alarms and what happened last."""

from __future__ import annotations

import contextlib
import math
import os
import select
import sys
import textwrap
from collections import deque
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.live import Live as Screen
from rich.table import Table
from rich.text import Text

from rthstrack.errors import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from types import TracebackType
    from typing import TextIO

# What happened last: so many lines of it.
_EVENTS = 6
# A valid reading may be so much later than its window is long.
_PATIENCE_S = 2.0
# Below so many columns there is no room for intervals.
_FULL_WIDTH = 100
_FAILED = {"unsent": "datagrams could not be sent", "not_written": "readings could not be written"}
_TOTALS = ("received", "lost", "repeated", "reordered", "malformed", "refused", "filled", "restarts")


class View:
    """Draws on a terminal from `__enter__` to `__exit__`, which restores it however the monitor ends.

    window_s: the window's length, from which follows how long an actuator may go without a valid reading.
    """

    def __init__(self, stream: TextIO, about: str, names: Sequence[str], window_s: float) -> None:
        self._about = about
        self._names = names
        self._events: deque[str] = deque(maxlen=_EVENTS)
        self._judged = Judged(len(names), window_s + _PATIENCE_S)
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
        view = shown(
            status,
            self._about,
            self._names,
            self._events,
            with_keys=self._keys.are_read,
            unjudged_s=self._judged.missing_s(status),
            size=self._console.size,
        )
        self._screen.update(view, refresh=True)


class Judged:
    """When each actuator last had a valid reading."""

    def __init__(self, n_actuators: int, longest_s: float) -> None:
        self._longest_s = longest_s
        self._last_s: list[float | None] = [None] * n_actuators

    def missing_s(self, status: Mapping[str, Any]) -> dict[int, float]:
        """For how long each actuator has not been judged that should have been. One that rests is not meant."""
        now_s = status["time_s"]
        if now_s is None:
            return {}
        found = {}
        readings = {reading["actuator"]: reading for reading in status["readings"] if reading is not None}
        for actuator, last_s in enumerate(self._last_s):
            reading = readings.get(actuator)
            fine = reading is not None and (reading["valid"] or reading["reason_code"] == "still")
            if last_s is None or now_s < last_s or fine:
                since_s = reading["time_s"] if fine and reading is not None else now_s
                self._last_s[actuator] = last_s = since_s
            if now_s - last_s > self._longest_s:
                found[actuator] = now_s - last_s
        return found


def shown(
    status: Mapping[str, Any],
    about: str,
    names: Sequence[str],
    events: Sequence[str],
    *,
    with_keys: bool = True,
    unjudged_s: Mapping[int, float] | None = None,
    size: tuple[int, int] = (150, 50),
) -> Group:
    """The whole view of a status, as rich draws it: what is wrong first, and no more than `size`, columns and lines."""
    width, height = size
    unjudged_s = unjudged_s or {}
    names = [printable(name) for name in names]
    top = [_line(about, "bold"), *(_cut(line) for line in _health(status))]
    keys = [_line("r resets alarms, q quits", "dim")] if with_keys else []
    room = max(0, height - len(top) - len(keys))
    last = [_line(line, "dim") for line in events]
    # Alarms may take all but a few lines of the table and the latest events.
    alarms = _alarms(status, width, max(room - min(1 + len(names), 5) - min(2, len(last)), (room + 1) // 2))
    room -= len(alarms)
    table = _actuators(status, names, unjudged_s, width, room - min(2, len(last)))
    room -= 0 if table is None else table.row_count + 1
    spaced = [Text("")] if room > len(last) else []
    return Group(*top, *alarms, *([] if table is None else [table]), *spaced, *last[max(0, len(last) - room) :], *keys)


def _line(text: str, style: str) -> Text:
    return _cut(Text(printable(text), style=style))


def _cut(text: Text) -> Text:
    """One line of the terminal, however long it is."""
    text.no_wrap, text.overflow = True, "ellipsis"
    return text


def _raised(status: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """What is raised, what is over its limit now first."""
    raised = [alarm for alarm in status["alarms"] if alarm["active"] or alarm["latched"]]
    return sorted(raised, key=lambda alarm: not alarm["active"])


def _alarms(status: Mapping[str, Any], width: int, most: int) -> list[Text]:
    """Lines of the alarms, at most so many, the last of which says what did not fit."""
    raised = _raised(status)
    # A line each where the width does not do for more, and cut only there.
    lines: list[Text] = []
    for n, alarm in enumerate(raised):
        over = "" if alarm["active"] else " (over, held until it is reset)"
        text = f"ALARM {printable(alarm['text'])}{over}"
        fitting = textwrap.wrap(text, max(width, 20), subsequent_indent="  ")
        is_last = n == len(raised) - 1
        if len(lines) + len(fitting) > most - (not is_last):
            lines = lines[: max(0, most - 1)]
            lines.append(Text(f"and {len(raised) - n} more alarms", style="bold red"))
            break
        lines += [_cut(Text(line, style="bold red")) for line in fitting]
    return lines if most > 0 else []


def _actuators(
    status: Mapping[str, Any], names: Sequence[str], unjudged_s: Mapping[int, float], width: int, most: int
) -> Table | None:
    """The table, in at most so many lines; those with an alarm or long without a reading first where not all fit."""
    if most < 2:
        return None
    with_intervals = width >= _FULL_WIDTH
    table = Table(box=None, pad_edge=False)
    table.add_column("", no_wrap=True, overflow="ellipsis", max_width=max(8, width // 4))
    note = " (95 % interval)" if with_intervals else ""
    for head in (f"A{note}", f"d in ms{note}", "at Hz"):
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("", no_wrap=True, overflow="ellipsis")
    raised = {alarm["actuator"] for alarm in _raised(status)}
    latest = {reading["actuator"]: reading for reading in status["readings"] if reading is not None}
    order = list(range(len(names)))
    if len(names) > most - 1:
        order.sort(key=lambda actuator: (actuator not in raised, actuator not in unjudged_s, actuator))
    kept = order if len(order) <= most - 1 else order[: most - 2]
    for actuator in kept:
        style = "bold red" if actuator in raised else ""
        if actuator in latest:
            cells = _reading(latest[actuator], style, with_intervals=with_intervals)
        else:
            cells = ["-", "-", "-", Text("no reading yet", style="dim")]
        if actuator in unjudged_s:
            why = cells[-1]
            cells[-1] = Text(f"not judged for {unjudged_s[actuator]:.0f} s: ", style="bold red").append(why)
        table.add_row(Text(names[actuator], style=style), *cells)
    if len(kept) < len(order):
        table.add_row(Text(f"and {len(order) - len(kept)} more", style="dim"))
    return table


def _reading(reading: Mapping[str, Any], style: str, *, with_intervals: bool) -> list[str | Text]:
    def number(name: str) -> float:
        return math.nan if reading[name] is None else float(reading[name])

    def interval(name: str) -> Sequence[float] | None:
        found: Sequence[float] | None = reading[name] if with_intervals else None
        return found

    amplitude = _with_interval(number("amplitude"), interval("amplitude_interval"), 4)
    delay = _with_interval(1e3 * number("delay_s"), interval("delay_interval_s"), 3, 1e3)
    frequency = number("equivalent_frequency_hz")
    reason = _short(reading)
    said = Text("valid", style="green") if reading["valid"] else Text(reason or "not valid", style="yellow")
    if reading["valid"] and reason:
        said.append(f": {reason}", style="dim")
    at = f"{frequency:.4g}" if math.isfinite(frequency) else "-"
    return [Text(amplitude, style=style), Text(delay, style=style), at, said]


def _short(reading: Mapping[str, Any]) -> str:
    """A reading's reason in the monitor's own options, where the estimators speak of a caller's arguments."""
    if reading["reason_code"] == "ambiguous":
        one, other = (f"{1e3 * delay_s:.4f}" for delay_s in reading["reason_values"])
        return f"one tone, {one} or {other} ms: choose with --expected-delay S"
    return printable((reading["reason"] or "").removeprefix("not determined: "))


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
    lines = [state]
    failed = [f"{health[name]} {words}" for name, words in _FAILED.items() if health.get(name)]
    if failed:
        lines.append(Text(", ".join(failed), style="bold red"))
    log = health.get("log")
    if log:
        lost = f", {health['log_dropped']} samples did not fit" if health.get("log_dropped") else ""
        is_bad = health["log_code"] == "stopped" or lost
        lines.append(Text(f"log: {printable(log)}{lost}", style="bold red" if is_bad else "dim"))
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
