"""`rthstrack monitor`: gain and delay of every actuator while the test runs, with alarms."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
import time
from typing import TYPE_CHECKING, Any

from rthstrack.cli import addresses
from rthstrack.cli.commands import COMMANDS
from rthstrack.cli.monitor_options import Plan, add_options, checked_plan, limits_given
from rthstrack.cli.running import Ended, say
from rthstrack.errors import RthstrackError, SettingError, printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from rthstrack._core import Live
    from rthstrack.live.log import Log

ALARM = 3
_SUMMARY = ("received", "lost", "repeated", "reordered", "malformed", "readings", "alarms")
_IN_WORDS = {
    "filled": "samples filled by a straight line",
    "restarts": "restarts of the window",
    "refused": "datagrams of senders that are not allowed",
    "log_dropped": "samples or readings that the log could not take",
    "not_written": "readings that the file could not take",
    "unsent": "datagrams that could not be sent",
}
_OF_ALARMS = ("alarm_raised", "alarm_over")
# The status is looked at so often.
_PERIOD_S = 0.1

_DESCRIPTION = """\
Evaluates a running test in moving windows: amplitude and delay of every actuator, alarms, a log, a
table in this terminal, a live page. Samples come as UDP datagrams, by default little-endian
doubles counter, target_1, measured_1, target_2, ..., or as lines (CSV or JSON) on standard input.
A positive delay means that measured lags. Alarms are advisory: they stop nothing.
"""
_EPILOG = """\
Exit status: 0 done (SIGINT and SIGTERM end it too), 1 a port is taken, the pace contradicts --rate
or a file cannot be written, 2 misuse or a mistake in the layout, 3 an alarm with --exit-on-alarm.
At exit one line of JSON tells what was received, lost, repeated, reordered, malformed, and how
many readings and alarms there were.
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to the command line."""
    parser = subparsers.add_parser(
        "monitor",
        help=COMMANDS["monitor"],
        usage="rthstrack monitor --listen udp://HOST:PORT|- --rate HZ [options]",
        description=_DESCRIPTION,
        epilog=_EPILOG,
    )
    wrong: dict[str, str] = {}
    add_options(parser, wrong)
    parser.set_defaults(run=lambda args: run(args, wrong))


def run(args: argparse.Namespace, wrong: Mapping[str, str]) -> int:
    """Monitors until the end of the input, of the duration or of the user's patience; returns the exit status."""
    from rthstrack._core import Live

    plan = checked_plan(args, wrong)
    with Ended() as ended:
        try:
            live = Live(plan.monitor, plan.source, plan.alarms, plan.outputs)
        except OSError as error:
            raise RthstrackError(_line(error)) from None
        seen = _Seen(args)
        _monitored(args, plan, live, ended, seen)
        summary = live.summary()
        print(json.dumps({"summary": {name: int(summary[name]) for name in _SUMMARY}}), flush=True)
        others = [f"{summary[name]} {words}" for name, words in _IN_WORDS.items() if summary.get(name)]
        if others:
            say(", ".join(others))
    fatal = live.fatal()
    if fatal is not None:
        raise RthstrackError(printable(fatal))
    nothing = _nothing_judged(plan, live, summary, seen.status)
    if nothing is not None:
        say(nothing)
    return ALARM if args.exit_on_alarm and seen.alarm else 0


class _Seen:
    """What the statuses of a run have shown: the latest one, and whether there was an alarm that ends the run."""

    def __init__(self, args: argparse.Namespace) -> None:
        # A sender that is done falls silent; that is an alarm to end with only for those who asked for it.
        self._silence_counts = bool(args.silence)
        self.status: Mapping[str, Any] = {}
        self.alarm = False

    def take(self, status: Mapping[str, Any]) -> None:
        self.status = status
        # An alarm may have come and gone since the last status; its event has not.
        raised = {alarm["name"] for alarm in status["alarms"] if alarm["active"] or alarm["latched"]}
        raised |= {event["values"]["alarm"] for event in status["events"] if event["code"] == "alarm_raised"}
        self.alarm |= bool(raised if self._silence_counts else raised - {"silence"})


def _nothing_judged(plan: Plan, live: Live, summary: Mapping[str, int], status: Mapping[str, Any]) -> str | None:
    """Why a run said nothing of any actuator; None where it did. Without alarms it would look like a good test."""
    received, readings = summary["received"], summary["readings"]
    if not received:
        what, where = ("line", "standard input") if plan.source["kind"] == "lines" else ("datagram", live.address())
        if wrong := summary["malformed"]:
            return f"no sample came: none of the {wrong} {what}s at {where} was as the layout says"
        others = " but from senders that are not allowed" if summary.get("refused") else ""
        return f"no sample came: no {what} at {where}{others}"
    if not readings:
        return (
            f"nothing was judged: {received} samples came, but never a whole window of {plan.monitor['window_s']:g} s "
            "without a gap that restarts it"
        )
    if summary.get("valid", readings):
        return None
    latest = [reading["reason"] for reading in status.get("readings", ()) if reading is not None and reading["reason"]]
    return f"nothing was judged: none of {readings} readings was valid{f'; the last: {latest[-1]}' if latest else ''}"


def _monitored(args: argparse.Namespace, plan: Plan, live: Live, ended: Ended, seen: _Seen) -> None:
    """The run from start to end, with log and page around it, all of them closed."""
    with contextlib.ExitStack() as cleanup:
        # Whatever fails on the way; once more below, for the order.
        cleanup.callback(live.stop)
        page = None
        if args.page is not None:
            page = _page(live, args.page, args.page_host or "127.0.0.1", args.page_name or ())
            cleanup.callback(page.stop)
        log = _log(args, plan, live)
        if log is not None:
            cleanup.callback(log.stop)
        # What is called last goes first: the input ends, the log takes what is left, then the page.
        cleanup.callback(live.stop)
        live.start()
        if log is not None:
            log.start()
        if page is not None:
            page.start()
        about = _about(plan, live)
        if not args.quiet:
            for line in (f"{about}; Ctrl-C ends", *_addresses(args, plan, live, page)):
                say(line)
        _watch(args, plan, live, _statuses(args, live, ended, seen), ended, about)


def _log(args: argparse.Namespace, plan: Plan, live: Live) -> Log | None:
    if args.log is None:
        return None
    from rthstrack.live.log import Log

    try:
        return Log(
            live,
            args.log,
            rate_hz=plan.monitor["rate_hz"],
            names=plan.layout.names,
            units=plan.layout.units,
            settings=plan.settings(),
            say=say,
        )
    except OSError as error:
        name = error.filename or args.log
        raise RthstrackError(
            f"--log: {name}: cannot be written: {error.strerror or error}; choose another name"
        ) from None


def _page(live: Live, port: int, host: str, names: Sequence[str]) -> Any:
    from rthstrack.live.page import Page  # type: ignore[import-not-found, unused-ignore]

    try:
        return Page(live, port, host, names)
    except SettingError as error:
        # A port that is taken is no misuse.
        raise RthstrackError(f"--page: {error}") from None


def _watch(
    args: argparse.Namespace, plan: Plan, live: Live, statuses: Iterator[dict[str, Any]], ended: Ended, about: str
) -> None:
    """Shows what happens until the run ends, and ends it."""
    news = _News()
    stream = sys.stdout if sys.stdout.isatty() else sys.stderr
    viewed: list[str] = []
    if _is_viewed(args):
        from rthstrack.live.view import View

        with View(stream, about, plan.layout.names, plan.monitor["window_s"]) as view:
            for status in statuses:
                fresh = list(news.of(status))
                viewed += [text for text, is_alarm in fresh if is_alarm]
                try:
                    view.draw(status, [text for text, _ in fresh])
                except OSError:
                    # The terminal is gone, the test is not.
                    break
                pressed = view.keys()
                if "r" in pressed:
                    live.reset()
                ended.asked |= "q" in pressed
    # The view is gone, and with it what it said.
    for line in viewed:
        say(line)
    for status in statuses:
        for text, is_alarm in news.of(status):
            if is_alarm or not args.quiet:
                say(text)


def _statuses(args: argparse.Namespace, live: Live, ended: Ended, seen: _Seen) -> Iterator[dict[str, Any]]:
    """How all stands, ten times a second until the run ends, and once more when it has been ended."""
    end = time.monotonic() + (args.duration or float("inf"))

    def status() -> dict[str, Any]:
        found: dict[str, Any] = json.loads(live.status())
        seen.take(found)
        return found

    over = False
    while not over:
        over = live.wait(max(0.0, min(_PERIOD_S, end - time.monotonic()))) or time.monotonic() >= end
        found = status()
        over |= ended.asked or (args.exit_on_alarm and seen.alarm)
        yield found
    live.stop()
    yield status()


def _is_viewed(args: argparse.Namespace) -> bool:
    return args.view or (sys.stdout.isatty() and not args.quiet)


class _News:
    """The events of a status that were not in the last one."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, str], None] = {}

    def of(self, status: Mapping[str, Any]) -> Iterator[tuple[str, bool]]:
        """Lines, and whether each is an alarm's."""
        for event in status["events"]:
            key = (event["time_s"], event["text"])
            # What the log says of itself is told where it happens.
            if key in self._known or event["code"] == "log":
                continue
            self._known[key] = None
            head = "ALARM " if event["code"] == "alarm_raised" else ""
            yield f"{head}{_at(event['time_s'])}{event['text']}", event["code"] in _OF_ALARMS
        # A status has recent events only; so many are enough to know them by.
        while len(self._known) > 1024:
            del self._known[next(iter(self._known))]


def _at(time_s: float | None) -> str:
    return "" if time_s is None else f"at {time_s:.2f} s: "


def _about(plan: Plan, live: Live) -> str:
    """The run in a line."""
    monitor = plan.monitor
    source = f"udp {live.address()}" if plan.source["kind"] == "udp" else "lines on standard input"
    low, high = monitor["band_hz"]
    n = monitor["n_actuators"]
    return (
        f"monitoring {source}: {n} actuator{'s' * (n > 1)} at {monitor['rate_hz']:g} Hz, window "
        f"{monitor['window_s']:g} s, {monitor['update_hz']:g} readings a second, "
        f"{low:g} to {high:g} Hz (P = {monitor['data_decimation']}), {monitor['estimator']}"
    )


def _addresses(args: argparse.Namespace, plan: Plan, live: Live, page: Any) -> Iterator[str]:
    if plan.source["kind"] == "udp" and not addresses.is_loopback(args.listen) and args.allow is None:
        yield f"any machine that reaches {live.address()} may send samples: --allow SENDER names those that may"
    if page is not None:
        yield f"live page: {page.url}"
        if not addresses.is_loopback(args.page_host or "127.0.0.1"):
            yield f"the page is open to every machine that reaches {args.page_host}"
    if args.control is not None:
        yield f"a datagram 'reset' to udp://{live.control_address()} resets alarms"
    if args.log is not None:
        yield f"log: {args.log}"
    if limits_given(args) and not (args.no_latch or args.exit_on_alarm or args.control is not None or _is_viewed(args)):
        yield "an alarm stays until the end, for there is no way to reset it: --control [PORT], --view or --no-latch"


def _line(error: OSError) -> str:
    named = f"{error.filename}: " if error.filename else ""
    text = named + (error.strerror or str(error) or repr(error))
    return " ".join(text.splitlines())
