"""One motion out of a file, in SI units: a ground acceleration, or a displacement that was recorded or planned."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rthstrack.errors import ChannelError, RecordingError, SettingError
from rthstrack.recording.readers.at2 import decoded, numbers
from rthstrack.recording.readers.stamps import Irregular, examine
from rthstrack.recording.reading import read_recording

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from rthstrack.recording.recording import Channel, Recording

    Floats = NDArray[Any]

#: The keys beside `file` that say how it is read.
KEYS = ("channel", "unit", "rate_hz", "layout")

_NUMBERS_BEGIN = re.compile(r"\s*(?:[-+.\d]|(?:nan|inf)\b)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a file's channel holds: its name, the units' names, a unit's plain spelling and size in SI (None for any
    other), and the signs that a channel is it, the surest first."""

    name: str
    unit_names: str
    unit: Callable[[str], tuple[str, float] | None]
    signs: tuple[Callable[[Channel], bool], ...]


class FileMotion(NamedTuple):
    """A channel in SI units, the rate, where exactly it comes from, and what was noticed."""

    values: Floats
    rate_hz: float
    source: str
    channel: str
    notes: tuple[str, ...]


def read_motion(
    path: str | os.PathLike[str],
    quantity: Quantity,
    *,
    channel: str | None = None,
    unit: str | None = None,
    rate_hz: float | None = None,
    layout: str = "channels",
) -> FileMotion:
    """One channel of anything that `read_recording` reads, or all numbers of a text file (layout "values").

    Raises RecordingError or ChannelError, one line, when the file or one of these is missing or cannot be used.
    """
    file = str(path)
    if layout not in ("channels", "values"):
        raise SettingError(f"layout: expected 'channels' or 'values', found '{layout}'", file=file)
    if layout == "values":
        if channel is not None:
            raise SettingError("channel: a file with the layout 'values' has no channels", file=file)
        values, notes = _in_reading_order(Path(path))
        rate, own_unit, what = rate_hz, None, "values in reading order"
        unknown = "a list of values states no sampling rate"
    else:
        recording = read_recording(path, rate_hz=rate_hz)
        chosen = _likely_channel(recording, quantity) if channel is None else recording.channel(channel)
        values, notes = chosen.values, recording.notes
        rate, own_unit, what = recording.rate_hz, chosen.unit, f"channel '{chosen.path}'"
        unknown = recording.rate_source
    if rate is None:
        raise RecordingError(f"sampling rate not known: {unknown}", file=file, advice="give {rate_hz}")
    given = unit or own_unit
    if given is None:
        raise RecordingError(
            f"{what}: the file does not say its unit",
            file=file,
            advice=f"give {{unit}}, one of {quantity.unit_names}",
        )
    known = quantity.unit(given)
    if known is None:
        raise RecordingError(
            f"{what}: expected a unit of {quantity.name} ({quantity.unit_names}), found '{given}'", file=file
        )
    if unit and own_unit and quantity.unit(own_unit) != known:
        notes = (*notes, f"{what}: the file's unit is {own_unit}, but {known[0]} was followed, as given")
    return FileMotion(known[1] * values, float(rate), f"{file}, {what} in {known[0]}", what, notes)


def file_mistakes(
    table: Mapping[str, Any], base_dir: str | os.PathLike[str] | None, quantity: Quantity
) -> list[tuple[str, str]]:
    """What is wrong with `file` and the keys that go with it; without `base_dir` it is not looked for."""
    mistakes: list[tuple[str, str]] = []
    for key in ("file", "channel", "unit"):
        if key in table and not (isinstance(table[key], str) and table[key]):
            mistakes.append((key, f"expected a text, found {table[key]!r}"))
    if base_dir is not None and not mistakes and not (Path(base_dir) / table["file"]).is_file():
        mistakes.append(("file", f"no such file: {Path(base_dir) / table['file']}"))
    unit = table.get("unit")
    if isinstance(unit, str) and unit and quantity.unit(unit) is None:
        mistakes.append(("unit", f"expected a unit of {quantity.name} ({quantity.unit_names}), found '{unit}'"))
    rate = table.get("rate_hz", 1.0)
    if isinstance(rate, bool) or not (isinstance(rate, int | float | np.number) and 0 < rate < math.inf):
        mistakes.append(("rate_hz", f"expected a positive number, found {rate!r}"))
    layout = table.get("layout", "channels")
    if layout not in ("channels", "values"):
        mistakes.append(("layout", f"expected 'channels' or 'values', found {layout!r}"))
    if layout == "values":
        mistakes += [
            (key, "expected one: the layout 'values' states none") for key in ("unit", "rate_hz") if key not in table
        ]
        if "channel" in table:
            mistakes.append(("channel", "a file with the layout 'values' has no channels"))
    return mistakes


def _in_reading_order(path: Path) -> tuple[Floats, tuple[str, ...]]:
    """All numbers of a text file, line after line, and a note on the lines of words before them."""
    try:
        lines = decoded(path.read_bytes()).splitlines()
        start = next((i for i, line in enumerate(lines) if _NUMBERS_BEGIN.match(line)), 0)
        values = numbers(lines, start)
    except OSError as error:
        raise RecordingError(f"{error.strerror}", file=path) from None
    except RecordingError as error:
        raise RecordingError(f"{error}", file=path) from None
    return values, (f"{start} line(s) of header left out",) if start else ()


def _likely_channel(recording: Recording, quantity: Quantity) -> Channel:
    """The only channel that is no time or count; else the only one by one of the signs."""
    left = [c for c in recording.channels if isinstance(examine(c.values), Irregular)]
    for sign in quantity.signs:
        left = [c for c in left if sign(c)] or left
    if len(left) == 1:
        return left[0]
    listed = ", ".join(f"#{recording.channels.index(c)} '{c.path}'" for c in left[:8])
    listed += f" and {len(left) - 8} more" if len(left) > 8 else ""
    article = "an" if quantity.name[0] in "aeiou" else "a"
    said = f"{len(left)} channels may be the {quantity.name}: {listed}"
    if not left:
        said = f"no channel that may be {article} {quantity.name}"
    nameless = left and all(c.name.startswith("column ") for c in left)
    hint = "; if it is one record, several values a line, the {layout} is 'values'" if nameless else ""
    raise ChannelError(said, file=recording.file, advice=f"choose one with {{channel}}{hint}")
