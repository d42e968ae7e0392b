"""Arguments that several commands take, and what they may be."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rthstrack.cli.quantities import hertz, number, positive, seconds, seconds_from_zero
from rthstrack.cli.setting_options import spoken
from rthstrack.errors import SettingError
from rthstrack.evaluation.presets import PRESETS
from rthstrack.units import is_unit
from rthstrack.verdict.display import FIGURE_IN, PANELS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rthstrack.errors import RthstrackError
    from rthstrack.recording.chosen import ChosenPairs


def add_signals(parser: argparse.ArgumentParser, title: str) -> argparse._ArgumentGroup:
    """Which channels of a recording are judged, at which rate, from when to when."""
    signals = parser.add_argument_group(title)
    signals.add_argument("--target", action="append", metavar="T", help="what the model asks; repeat with --measured")
    signals.add_argument("--measured", action="append", metavar="M", help="what the sensor says, one for each --target")
    signals.add_argument(
        "--scale", action="append", type=scale, default=[], metavar="CHANNEL=X", help="multiply a channel"
    )
    signals.add_argument(
        "--unit",
        action="append",
        type=unit,
        default=[],
        metavar="[CHANNEL=]U",
        help="unit of a channel (time too), or of all that are judged and state none",
    )
    rate = signals.add_mutually_exclusive_group()
    rate.add_argument("--rate", type=hertz, metavar="HZ", help="sampling rate, where the file does not say")
    rate.add_argument("--time", metavar="T", help="channel that holds the time")
    signals.add_argument("--start", type=seconds_from_zero, metavar="S", help="leave out what comes before, in seconds")
    signals.add_argument("--end", type=seconds, metavar="S", help="leave out what comes after, in seconds")
    signals.add_argument("--fill", type=count, metavar="SAMPLES", help="interpolate gaps of up to so many samples")
    signals.add_argument("--resample", type=hertz, metavar="HZ", help="interpolate uneven time stamps onto this rate")
    signals.add_argument(
        "--align", action="store_true", help="two files without a common clock: align them by correlation"
    )
    add_part(signals)
    return signals


def files_in(paths: Sequence[str]) -> list[str]:
    """The files named, with those of each folder in its place, in order of their names; an empty folder is itself."""
    found = []
    for path in paths:
        inside = sorted(Path(path).iterdir()) if Path(path).is_dir() else []
        inside = [one for one in inside if one.is_file() and not one.name.startswith(".")]
        # LabVIEW's index beside a TDMS file is no recording, and the numbers beside a TDM file are read with it.
        found += [str(one) for one in inside if one.suffix.lower() not in (".tdms_index", ".tdx")] or [path]
    return found


def two_files(
    args: argparse.Namespace, files: Sequence[str], misuse: Callable[[str], Any], what: str = "FILE"
) -> list[tuple[str, str]] | None:
    """(file, channel) of target and of measured where these name files themselves; None where `files` are named."""
    if files:
        if args.align:
            misuse(f"--align speaks of two files: --target FILE:CHANNEL --measured FILE:CHANNEL, and no other {what}")
        return None
    named = [*(args.target or []), *(args.measured or [])]
    if not named:
        misuse(f"the following arguments are required: {what}")
    found = []
    for text in named:
        places = [i for i, c in enumerate(text) if c == ":" and i and Path(text[:i]).is_file() and text[i + 1 :]]
        if not places:
            misuse(f"without a {what} expected --target FILE:CHANNEL and --measured FILE:CHANNEL, found '{text}'")
        else:
            found.append((text[: places[-1]], text[places[-1] + 1 :]))
    if len(args.target or []) != 1 or len(args.measured or []) != 1 or getattr(args, "command", None):
        misuse("of two files one --target and one --measured are taken, and no --command")
    return found


def together(two: Sequence[tuple[str, str]]) -> str:
    """What two files are called as one."""
    return " and ".join(file for file, _ in two)


def read_signals(args: argparse.Namespace, file: str, commands: Sequence[str] = ()) -> ChosenPairs:
    """The channels that `add_signals` asks for: of `file`, or of the two files of `args.two`."""
    from rthstrack.recording.chosen import read_chosen, read_two

    asked = chosen(args)
    if args.two is None:
        return read_chosen(file, **asked, commands=commands)
    return read_two(*args.two, align=args.align, **{k: v for k, v in asked.items() if k not in ("targets", "measured")})


def add_part(parser: argparse._ActionsContainer) -> None:
    """Which part of a text file or workbook is read."""
    part = parser.add_mutually_exclusive_group()
    part.add_argument("--block", type=count, metavar="N", help="block of rows of a text file, or sheet of a workbook")
    part.add_argument("--lines", type=lines, metavar="A:B", help="read only these lines of a text file")


def chosen(args: argparse.Namespace) -> dict[str, Any]:
    """What `add_signals` asks for, as the arguments of `read_chosen`."""
    return {
        "targets": args.target or (),
        "measured": args.measured or (),
        "rate_hz": args.rate,
        "time": args.time,
        "resample_hz": args.resample,
        "units": dict(args.unit),
        "scale": dict(args.scale),
        "fill": args.fill,
        "start_s": args.start,
        "end_s": args.end,
        "block": args.block,
        "lines": args.lines,
    }


#: What the library's arguments are called on the command line.
OPTIONS = {
    "target": "--target",
    "measured": "--measured",
    "rate_hz": "--rate HZ",
    "time": "--time CHANNEL",
    "resample_hz": "--resample HZ",
    "fill": "--fill SAMPLES",
    "filled(SAMPLES)": "--fill SAMPLES",
    "unit": "--unit",
    "channel": "--channel NAME",
    "layout": "--layout",
    "align": "--align",
    "start_s": "--start S",
    "end_s": "--end S",
    "block": "--block N",
    "lines": "--lines A:B",
}


def told(error: RthstrackError, *, with_file: bool = True) -> str:
    """An error's message, its advice and the settings it speaks of in the command's words."""
    message = error.told(OPTIONS, with_file=with_file)
    return spoken(message) if isinstance(error, SettingError) else message


def add_method(parser: argparse.ArgumentParser, *, trusted: bool = False) -> argparse._ArgumentGroup:
    """How an evaluation is made; `trusted`: the trusted estimate is made beside it."""
    method = parser.add_argument_group(
        "evaluation",
        "The trusted estimate beside it takes --expected-delay and --bad-samples too." if trusted else None,
    )
    method.add_argument("--preset", choices=tuple(PRESETS), metavar="NAME",
                        help="paper: estimator fei, Q = 16, Tukey window, mean removed, as Guo, Xu and Chen (2014) "
                        "recommend; paper-fast: P = 16 too; what is given beside it goes before it")  # fmt: skip
    return method


def expected_delay_mistake(expected_delay_s: float | None, max_delay_s: float) -> str | None:
    """What is wrong with an expected delay that is not looked for."""
    if expected_delay_s is None or abs(expected_delay_s) <= max_delay_s:
        return None
    return f"--expected-delay: expected at most --max-delay, {max_delay_s:g} s, found {expected_delay_s:g}"


def count(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 on, found '{text}'")
    return int(text)


def lines(text: str) -> tuple[int, int]:
    first, _, last = text.partition(":")
    if not (first + last).isascii() or not first.isdigit() or not last.isdigit() or not 1 <= int(first) <= int(last):
        raise argparse.ArgumentTypeError(f"expected two line numbers as 6:605, found '{text}'")
    return int(first), int(last)


def tolerance(text: str) -> float:
    if not 0 < (value := number(text)) < 1:
        raise argparse.ArgumentTypeError(f"expected a number between 0 and 1, found '{text}'")
    return value


def scale(text: str) -> tuple[str, float]:
    channel, equals, factor = text.rpartition("=")
    if not equals or not channel:
        raise argparse.ArgumentTypeError(f"expected CHANNEL=X, found '{text}'")
    if (value := number(factor)) == 0:
        raise argparse.ArgumentTypeError(f"expected a factor other than zero, found '{text}'")
    return channel, value


def unit(text: str) -> tuple[str, str]:
    channel, _, found = text.rpartition("=")
    if not is_unit(found):
        raise argparse.ArgumentTypeError(f"expected a unit (mm, m, in, V, ms, ...) or CHANNEL=UNIT, found '{text}'")
    return channel, found


def panels(text: str) -> tuple[str, ...]:
    """Names of panels of a figure, in order."""
    names = tuple(name.strip() for name in text.split(","))
    for name in names:
        if name not in PANELS:
            raise argparse.ArgumentTypeError(f"expected names of {', '.join(PANELS)}, found '{name}'")
    return names


def size(text: str) -> tuple[float, float | None]:
    """Width and height of a figure in inches; the height is None where it is not stated."""
    width, _, height = text.lower().partition("x")
    # 85x120mm: the unit of both.
    unit = "".join(c for c in height if c.isalpha())
    sides = [side + unit if side.strip()[-1:].isdigit() else side for side in (width, height) if side.strip()]
    if not sides or any(side.strip()[-1:].isdigit() for side in sides):
        raise argparse.ArgumentTypeError(f"expected a width and a height in mm or in (85x120mm, 85mm), found '{text}'")
    inches = [positive(side, "m") / 0.0254 for side in sides]
    low, high = FIGURE_IN
    if any(not low <= side <= high for side in inches):
        raise argparse.ArgumentTypeError(f"expected sides from {low:g} to {high:g} in, found '{text}'")
    return inches[0], inches[1] if len(inches) > 1 else None


def path(*endings: str) -> Callable[[str], Path]:
    def check(text: str) -> Path:
        path = Path(text)
        if path.suffix.lower() not in endings:
            raise argparse.ArgumentTypeError(f"expected a name that ends in {' or '.join(endings)}, found '{text}'")
        return path

    return check
