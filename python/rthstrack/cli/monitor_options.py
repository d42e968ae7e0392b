"""The options of `rthstrack monitor`, checked: all mistakes at once."""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rthstrack._core import settings_table, usual_detrend
from rthstrack.cli import addresses
from rthstrack.cli.arguments import count, expected_delay_mistake
from rthstrack.cli.quantities import hertz, seconds, seconds_from_zero
from rthstrack.cli.setting_options import SettingOption, setting_options
from rthstrack.errors import ConfigurationError, SettingError, printable
from rthstrack.evaluation.monitor import largest_decimation
from rthstrack.evaluation.settings import MonitorSettings
from rthstrack.live.layout import default_layout, layout_from, read_layout

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from rthstrack.live.layout import Layout, Source

# Settings whose options stand with the input's.
_ELSEWHERE = ("rate_hz", "n_actuators")
_PAGE_PORT = 8765
_HIGHEST_HZ = 32.0
# Of one evaluated sample of one actuator: history, transforms and what the estimators keep of them.
_STATE_BYTES = 256
_MOST_STATE_BYTES = 1 << 30


def add_options(parser: argparse.ArgumentParser, wrong: dict[str, str]) -> None:
    """Adds all options. Values that do not fit go to `wrong`, by option, for all mistakes are told at once."""
    _add_input(parser.add_argument_group("input"), wrong)
    _add_evaluation(parser.add_argument_group("evaluation"), wrong)
    _add_alarms(parser.add_argument_group("alarms (advisory)"), wrong)
    _add_output(parser.add_argument_group("output"), wrong)


@dataclasses.dataclass(frozen=True, slots=True)
class Plan:
    """What `_core.Live` is made of, and what is around it."""

    layout: Layout
    monitor: dict[str, Any]
    source: dict[str, Any]
    alarms: dict[str, Any]
    outputs: dict[str, Any]

    def settings(self) -> dict[str, Any]:
        """What a log says of how it was made."""
        return {"monitor": self.monitor, "source": self.source, "alarms": self.alarms, "names": list(self.layout.names)}


# Options --------------------------------------------------------------------------------------------------------------


def _gathered(wrong: dict[str, str], option: str, read: Callable[[str], Any]) -> Callable[[str], Any]:
    """Reads an option's value; what is wrong with it is noted and the value None."""

    def convert(text: str) -> Any:
        try:
            return read(text)
        except argparse.ArgumentTypeError as error:
            wrong.setdefault(option, str(error))
            return None

    return convert


def _adder(group: argparse._ArgumentGroup, wrong: dict[str, str]) -> Callable[..., None]:
    def add(option: str, read: Callable[[str], Any], metavar: Any, told: str, **more: Any) -> None:
        group.add_argument(option, type=_gathered(wrong, option, read), metavar=metavar, help=told, **more)

    return add


def _add_input(group: argparse._ArgumentGroup, wrong: dict[str, str]) -> None:
    add = _adder(group, wrong)
    add("--listen", _listen, "udp://HOST:PORT|-", "datagrams at this address (port 0: a free one), or - for lines on "
        "standard input")  # fmt: skip
    group.add_argument("--layout", metavar="FILE.toml", help="where counter, target and measured stand in a sample")
    add("--actuators", count, "N", "without --layout: how many actuators a sample has (1)")
    add("--target", _column, "COLUMN", "lines, without --layout: target's name, or its column's number from 0 on; "
        "repeat with --measured for every actuator", action="append")  # fmt: skip
    add("--measured", _column, "COLUMN", "measured's name or number, one for each --target", action="append")
    add("--counter", _column, "COLUMN", "with --target: the counter's name or number ('counter', or 0 beside numbers)")
    group.add_argument("--no-counter", action="store_true", help="without --layout: samples bear no counter; losses "
                       "are then not seen")  # fmt: skip
    add("--rate", hertz, "HZ", "samples a second, of each actuator")
    add("--fill", _whole, "SAMPLES", "longest gap that is filled by a straight line; longer ones restart the window "
        "(5)")  # fmt: skip
    add("--allow", addresses.senders, "SENDER", "take datagrams of this machine only; may be repeated", action="append")
    group.add_argument("--any-pace", action="store_true", help="do not compare the pace of the counter with --rate")


def _add_evaluation(group: argparse._ArgumentGroup, wrong: dict[str, str]) -> None:
    add = _adder(group, wrong)
    own = {"update_hz": "16 Hz", "data_decimation": "the largest for which HI is at most "
           "rate / 4P", "band_hz": f"0 to {_HIGHEST_HZ:g} Hz, or a quarter of the rate if that is lower"}  # fmt: skip
    for option in setting_options("monitor", flags={"window": "--window-shape"}, defaults=own):
        if option.name not in _ELSEWHERE:
            nargs = {"nargs": 2} if isinstance(option.metavar, tuple) else {}
            add(option.flag, option.read, option.metavar, option.help, dest=option.name, **nargs)


def _add_alarms(group: argparse._ArgumentGroup, wrong: dict[str, str]) -> None:
    add = _adder(group, wrong)
    # 0 watches no silence; a limit of no lost sample at all is refused.
    own = {"silence_s": seconds_from_zero, "limit_lost": count}
    for option in _alarm_options():
        add(option.flag, own.get(option.name, option.read), option.metavar, option.help)
    group.add_argument(
        "--no-latch", action="store_true", help="an alarm that is over is gone; else it waits for a reset"
    )
    add("--alarm-to", addresses.udp, "udp://HOST:PORT", "send a datagram (JSON) when an alarm is raised or over")
    add("--control", addresses.port, "PORT", "take datagrams 'reset' from this machine at this port (a free one)",
        nargs="?", const=0)  # fmt: skip
    group.add_argument("--exit-on-alarm", action="store_true", help="end at the first alarm, with exit status 3")


def _add_output(group: argparse._ArgumentGroup, wrong: dict[str, str]) -> None:
    add = _adder(group, wrong)
    add("--readings", _readings, "FILE.jsonl|udp://HOST:PORT", "readings as lines of JSON, or a datagram each; may be "
        "given twice", action="append")  # fmt: skip
    group.add_argument("--log", type=Path, metavar="FILE.arrows", help="samples, and readings in FILE.readings.arrows, "
                       "as Arrow streams that 'rthstrack evaluate' and pandas read")  # fmt: skip
    add("--page", addresses.port, "PORT", f"a live page for browsers ({_PAGE_PORT}; 0: a free port)", nargs="?",
        const=_PAGE_PORT)  # fmt: skip
    add("--page-host", addresses.host, "HOST", "address that the page is served at (127.0.0.1: this machine only)")
    add("--page-name", addresses.host_name, "HOST", "a name by which browsers call this machine, besides localhost and "
        "its addresses; may be repeated", action="append")  # fmt: skip
    add("--duration", seconds, "S", "end after so long")
    how = group.add_mutually_exclusive_group()
    how.add_argument(
        "--quiet", action="store_true", help="no table, and nothing but alarms and errors on standard error"
    )
    how.add_argument(
        "--view", action="store_true", help="the table, on standard error if standard output is no terminal"
    )


def _column(text: str) -> str | int:
    """A column by its name, or by its number from 0 on."""
    if not text or text != printable(text):
        raise argparse.ArgumentTypeError(f"expected a column's name or its number from 0 on, found '{printable(text)}'")
    return int(text) if text.isascii() and text.isdigit() and len(text) <= 6 else text


def _listen(text: str) -> str:
    return text if text == "-" else addresses.udp_or_any_port(text)


def _readings(text: str) -> str | Path:
    return addresses.udp(text) if text.lower().startswith("udp:") else Path(text)


def _whole(text: str) -> int:
    if not text.isascii() or not text.isdigit() or len(text) > 15:
        raise argparse.ArgumentTypeError(f"expected a whole number from 0 on, found '{text}'")
    return int(text)


def _alarm_options() -> list[SettingOption]:
    """The options of alarms but latching, of which only the end has one; for `unjudged_s` there is none."""
    own = {"silence_s": "1; counts for --exit-on-alarm only where it is given; 0: watch none"}
    options = setting_options("alarms", flags={"minimum_duration_s": "--alarm-after"}, defaults=own)
    return [option for option in options if option.name not in ("unjudged_s", "latch")]


def _given(args: argparse.Namespace, option: SettingOption) -> Any:
    return getattr(args, option.flag.lstrip("-").replace("-", "_"))


# Checks ---------------------------------------------------------------------------------------------------------------


def checked_plan(args: argparse.Namespace, wrong: Mapping[str, str]) -> Plan:
    """Raises SettingError with all mistakes, a line each."""
    mistakes = [f"{option}: {message}" for option, message in wrong.items()]
    if args.listen is None and "--listen" not in wrong:
        mistakes.append("--listen is missing: give --listen udp://HOST:PORT for datagrams, or --listen - for lines on "
                        "standard input")  # fmt: skip
    if args.rate is None and "--rate" not in wrong:
        mistakes.append("--rate is missing: give the samples a second, --rate HZ")
    layout = _layout(args, mistakes)
    monitor = _monitor(args, layout.n_actuators, mistakes)
    mistakes += _blind_limits(args, monitor)
    mistakes += _contradictions(args)
    readings = _outputs(args, mistakes)
    if mistakes:
        raise SettingError("\n".join(mistakes))
    is_udp = args.listen != "-"
    source = {
        "kind": "udp" if is_udp else "lines",
        "address": args.listen if is_udp else None,
        "senders": [one for named in args.allow for one in named] if args.allow else None,
        "layout": layout.to_dict(),
        "fill_samples": 5 if args.fill is None else args.fill,
        # A file that is read as lines comes as fast as it can.
        "check_pace": is_udp and not args.any_pace,
        "path": None,
    }
    outputs = {
        **readings,
        "alarm_udp": args.alarm_to,
        "control": None if args.control is None else f"127.0.0.1:{args.control}",
        "log": args.log is not None,
        "page": args.page is not None,
        "names": list(layout.names),
        "units": list(layout.units),
    }
    return Plan(layout, monitor, source, _alarms(args), outputs)


def limits_given(args: argparse.Namespace) -> bool:
    """Whether the user has set any limit for an alarm."""
    limits = (option for option in _alarm_options() if option.name not in ("hysteresis", "minimum_duration_s"))
    return any(_given(args, option) for option in limits)


def _alarms(args: argparse.Namespace) -> dict[str, Any]:
    """The settings of alarms by their names, each with its default where nothing is given."""
    found = {row["name"]: row["default"] for row in settings_table("alarms") if row["name"] != "unjudged_s"}
    given = {option.name: _given(args, option) for option in _alarm_options()}
    found |= {name: value for name, value in given.items() if value is not None}
    return found | {"silence_s": found["silence_s"] or None, "latch": not args.no_latch}


def _layout(args: argparse.Namespace, mistakes: list[str]) -> Layout:
    """The layout; where it is wrong, that of one actuator, so that the rest can be checked."""
    source: Source = "lines" if args.listen == "-" else "udp"
    named = args.target is not None or args.measured is not None
    of_layout = [
        option for option in ("actuators", "target", "measured", "counter") if getattr(args, option) is not None
    ]
    of_layout += ["no_counter"] if args.no_counter else []
    if args.layout is not None and of_layout:
        options = ", ".join(f"--{option.replace('_', '-')}" for option in of_layout)
        speak = "speaks" if len(of_layout) == 1 else "speak"
        mistakes.append(f"{options} {speak} of the default layout, and --layout names another: give one of them")
    try:
        if args.layout is not None:
            return read_layout(args.layout, source)
        if named:
            return _named_layout(args, mistakes)
        if args.counter is not None:
            mistakes.append("--counter speaks of columns: give --target and --measured too")
        return default_layout(source, args.actuators or 1, counted=not args.no_counter)
    except ConfigurationError as error:
        whose = "--target and --measured: " if named else "--actuators: "
        mistakes += [line if args.layout is not None else f"{whose}{line}" for line in str(error).splitlines()]
        return default_layout(source)


def _named_layout(args: argparse.Namespace, mistakes: list[str]) -> Layout:
    """The layout of lines whose columns are named by options."""
    target, measured = args.target or [], args.measured or []
    n_mistakes = len(mistakes)
    if args.listen != "-":
        mistakes.append("--target and --measured name columns of lines: give --listen -, or --layout for datagrams")
    if args.actuators is not None:
        mistakes.append("--actuators speaks of the default layout, and --target names columns: give one of them")
    if args.no_counter and args.counter is not None:
        mistakes.append("--counter names what --no-counter says is not there: give one of them")
    if len(target) != len(measured):
        mistakes.append(f"--measured: expected one for each --target, found {len(measured)} for {len(target)}")
    if len(mistakes) > n_mistakes or None in target or None in measured:
        return default_layout("lines")
    by_number = all(isinstance(column, int) for column in (*target, *measured))
    counter = False if args.no_counter else (0 if by_number else "counter") if args.counter is None else args.counter
    pairs = [{"target": t, "measured": m} for t, m in zip(target, measured, strict=True)]
    return layout_from({"counter": counter, "actuator": pairs}, "lines")


def _monitor(args: argparse.Namespace, n_actuators: int, mistakes: list[str]) -> dict[str, Any]:
    """The monitor's settings: what was given, and the command's own defaults."""
    given = {row["name"]: getattr(args, row["name"], None) for row in settings_table("monitor")}
    given |= {"rate_hz": args.rate, "n_actuators": n_actuators}
    rate = args.rate or 1024.0
    band = given["band_hz"]
    band = (0.0, min(_HIGHEST_HZ, rate / 4)) if band is None or None in band else tuple(band)
    update = given["update_hz"] or min(16.0, rate)
    own = {"rate_hz": rate, "band_hz": band, "update_hz": update,
           "data_decimation": given["data_decimation"] or largest_decimation(rate, band[1], update)}  # fmt: skip
    settings = dataclasses.asdict(MonitorSettings(rate))
    settings |= {name: value for name, value in given.items() if value is not None} | own
    settings["detrend"] = settings["detrend"] or usual_detrend(settings["estimator"])
    p, window = settings["data_decimation"], settings["window_s"]
    if args.rate is not None:
        mistakes += _band_mistakes(rate, band, given["data_decimation"])
        if update > rate / p:
            mistakes.append(f"--update: expected at most the {rate / p:g} samples a second that are evaluated, "
                            f"found {update:g}")  # fmt: skip
        if window * rate < 8:
            mistakes.append(f"--window: expected at least 8 samples, found {window:g} s, {window * rate:.3g} samples")
        if args.fill is not None and args.fill > window * rate:
            mistakes.append(
                f"--fill: expected at most the {window * rate:.0f} samples of the window, found {args.fill}"
            )
        size = n_actuators * window * rate / p * _STATE_BYTES
        if size > (most := _most_bytes()):
            mistakes.append(
                f"--window: {window:g} s of {n_actuators} actuator(s) at {rate / p:g} evaluated samples a second need "
                f"about {size / 2**20:.0f} MiB, expected at most {most / 2**20:.0f} MiB; take a shorter one"
            )
    if mistake := expected_delay_mistake(settings["expected_delay_s"], settings["max_delay_s"]):
        mistakes.append(mistake)
    return settings


def _band_mistakes(rate: float, band: tuple[float, ...], p: int | None) -> Iterator[str]:
    low, high = band
    highest, of_rate = (
        (rate / 2, "half the rate") if p is None or p == 1 else (rate / (4 * p), f"rate / (4 P), P = {p}")
    )
    if low >= high:
        yield f"--band: expected LO below HI, found {low:g} and {high:g}"
    elif high > highest * (1 + 1e-9):
        yield f"--band: expected HI of at most {of_rate}, {highest:g} Hz, found {high:g}"


def _blind_limits(args: argparse.Namespace, monitor: Mapping[str, Any]) -> Iterator[str]:
    """Limits that no reading could ever exceed: a delay that is not looked for makes none, so nothing would be said."""
    if monitor["estimator"] == "fei":
        return
    # A window is compared over the half of it that is left at the largest shift to either side.
    most, of_which, larger = min(
        (monitor["max_delay_s"], "--max-delay", "--max-delay"),
        (monitor["window_s"] / 4, "a quarter of --window", "--window"),
    )
    fraction = args.critical_fraction or 0.5
    critical = None if args.critical_delay is None else fraction * args.critical_delay
    limits = [
        ("--limit-delay", args.limit_delay, "", args.limit_delay),
        ("--critical-delay", critical, f", {fraction:g} of it,", args.critical_delay),
    ]
    for option, limit, share, given in limits:
        if limit is None or limit < most:
            continue
        milli = f"; in seconds, {given:g} ms is {given / 1000:g}" if limit / 1000 < most else ""
        yield (
            f"{option}: {limit:g} s{share} can never be exceeded, for {monitor['estimator']} looks for delays of up to "
            f"{of_which}, {most:g} s: expected less, or a larger {larger}{milli}"
        )


def _most_bytes() -> float:
    """What the windows may take: half of the memory that is free, and no more than 1 GiB."""
    try:
        free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return _MOST_STATE_BYTES
    return min(_MOST_STATE_BYTES, free / 2)


def _contradictions(args: argparse.Namespace) -> Iterator[str]:
    """Options that speak of another one that is not there."""
    if args.critical_fraction is not None and args.critical_delay is None:
        yield "--critical-fraction speaks of --critical-delay: give it too"
    for option in ("page_host", "page_name"):
        if getattr(args, option) is not None and args.page is None:
            yield f"--{option.replace('_', '-')} speaks of --page: give it too"
    if args.listen == "-":
        for option in ("allow", "any_pace"):
            if getattr(args, option):
                yield f"--{option.replace('_', '-')} speaks of datagrams, and --listen - takes lines"
    if args.view and not (sys.stdout.isatty() or sys.stderr.isatty()):
        yield "--view: neither standard output nor standard error is a terminal"


def _outputs(args: argparse.Namespace, mistakes: list[str]) -> dict[str, Any]:
    """Where readings go; files that are to be written are looked at before anything starts."""
    found: dict[str, Any] = {"readings_udp": None, "readings_file": None}
    files = {}
    for one in args.readings or []:
        name = "readings_udp" if isinstance(one, str) else "readings_file"
        if one is None:
            continue
        if found[name] is not None:
            mistakes.append("--readings: expected at most one file and one address, found two of a kind")
        found[name] = str(one)
        if isinstance(one, Path):
            files["--readings"] = one
    if args.log is not None:
        from rthstrack.live.log import readings_path

        files["--log"] = args.log
        if args.log.name:
            files["--log, its readings"] = readings_path(args.log)
    told: set[str] = set()
    for option, path in files.items():
        # Lines are written behind what a file holds; a log begins with its schema.
        for problem in _not_writable(path, may_hold_something=option == "--readings"):
            # What is wrong with a folder is wrong for both files of a log.
            if not (option == "--log, its readings" and problem in told):
                mistakes.append(f"{option}: {path}: {problem}")
            told.add(problem)
    logs = [option for option, path in files.items() if path == files.get("--readings") and option != "--readings"]
    mistakes += [f"--readings and {option} name the same file, {files[option]}" for option in logs]
    return found


def _not_writable(path: Path, *, may_hold_something: bool) -> Iterator[str]:
    try:
        if path.is_dir():
            yield "is a directory; expected the name of a file"
        elif path.exists() and not path.is_file():
            # Opening a pipe waits for whoever reads it; the test would not be watched meanwhile.
            yield "is a pipe or a device; expected the name of a file, new or to be added to"
        elif path.is_file() and path.stat().st_size and not may_hold_something:
            yield "is there already and holds something: nothing is overwritten; choose another name"
        elif not path.parent.is_dir():
            yield f"there is no directory {path.parent}"
        elif not os.access(path if path.exists() else path.parent, os.W_OK):
            yield "this user may not write there"
    except OSError as error:
        yield error.strerror or str(error)
