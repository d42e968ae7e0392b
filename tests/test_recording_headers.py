"""Which pair, over the headers of `data/controller_headers.txt`: right or asked, never wrong without a word."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from field_motion import measured, target
from rthstrack.errors import ChannelError
from rthstrack.recording import propose_pair, read_recording
from rthstrack.recording.recording import select

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

T = np.arange(600) / 100
HEADERS = Path(__file__).parent / "data" / "controller_headers.txt"
# Measured lags, or leads where compensation does too much.
LAG_S, LEAD_S = 0.012, -0.006
# How many of the headers whose pair the names tell are read without asking; and how many are read right or asked.
READ, RIGHT_OR_ASKED = 0.9, 0.95


class Header(NamedTuple):
    """Where a header comes from, its names, and what each column holds."""

    source: str
    names: tuple[str, ...]
    codes: tuple[str, ...]

    def turned(self) -> Header:
        """The same columns in the opposite order, time first."""
        first = 1 if self.codes[0] == "s" else 0
        return Header(self.source, *((*row[:first], *reversed(row[first:])) for row in (self.names, self.codes)))

    def pairs(self) -> set[tuple[int, int]]:
        """Target and measured of each actuator, as indices of the columns."""
        return {(i, self.codes.index(f"M{code[1:]}")) for i, code in enumerate(self.codes) if code[0] == "T"}


def headers() -> list[Header]:
    """The table's rows."""
    found, source = [], ""
    for line in HEADERS.read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            source = line.strip("[]")
        elif line and not line.startswith("#"):
            cells = [re.fullmatch(r"(.*\S) :(\w+)", cell.strip()) for cell in line.split(" | ")]
            assert all(cells), line
            found.append(Header(source, *zip(*(cell.groups() for cell in cells if cell), strict=True)))
    return found


def column(code: str, name: str, delay_s: float, rng: np.random.Generator) -> Floats:
    """What a column of this code holds; other actuators and sensors move otherwise."""
    # Another actuator's motion is earlier in time.
    at = T + 0.4 * (int(code[1:] or 1) - 1)
    noise = rng.standard_normal(len(T))
    follows = measured(at, delay_s) + 0.002 * noise
    match code[0]:
        case "s":
            unit = 1e6 if "us" in name.lower() else 1e3 if re.search("ms|millis", name) else 1.0
            return T * unit
        case "T" | "t" | "c":
            return target(at)
        case "k":
            return target(at + 0.01)
        case "M" | "m":
            return follows
        case "e":
            return follows - target(at)
        case "v":
            return np.gradient(target(at), 0.01)
        case "w":
            return np.gradient(measured(at, delay_s), 0.01)
        case "a":
            return np.gradient(np.gradient(measured(at, delay_s), 0.01), 0.01)
        case "f":
            return 2.5 * measured(at, delay_s) + 0.1 * noise
        case "g":
            return 2.5 * target(at)
    return noise


def judged(header: Header, delay_s: float, path: Path, **form: str) -> tuple[str, str]:
    """`right`, `asked`, `guessed` (no name tells, and that is said) or `wrong`; and what was proposed or said."""
    rng = np.random.default_rng(7)
    columns = [column(code, name, delay_s, rng) for code, name in zip(header.codes, header.names, strict=True)]
    lines = ["\t".join(header.names), *("\t".join(f"{v:.9g}" for v in row) for row in zip(*columns, strict=True))]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    recording = read_recording(path)
    try:
        proposed, why = propose_pair(recording)
    except ChannelError as error:
        return "asked", str(error)
    known = [(channel.name, channel.path) for channel in recording.channels]
    found = {tuple(select(name, known, recording.file) for name in pair) for pair in proposed}
    said = f"{proposed}: {why}"
    if not header.pairs() and why.code == "pair_guessed":
        return "guessed", said
    return ("right" if found <= header.pairs() else "wrong"), said


def test_the_pair_of_a_controllers_log_is_right_or_asked_for(tmp_path: Path) -> None:
    known = headers()
    assert len({one.names for one in known}) == len(known) >= 100
    counts: Counter[str] = Counter()
    wrong, unread = [], []
    # The names decide, in whatever order they stand, and whoever leads.
    cases = [case for one in known for case in ((one, LAG_S), (one.turned(), LEAD_S))]
    for header, delay_s in cases:
        outcome, said = judged(header, delay_s, tmp_path / "log.txt")
        counts[outcome] += 1
        if outcome == "wrong":
            wrong.append(f"{header.source}: {' | '.join(header.names)}: {said}")
        elif outcome == "asked" and header.pairs():
            unread.append(f"{header.source}: {' | '.join(header.names)}: {said}")
    assert not wrong, "\n".join(wrong)
    n_told = sum(bool(one.pairs()) for one, _ in cases)
    assert n_told - len(unread) >= READ * n_told, "\n".join(unread)
    assert counts["right"] + counts["asked"] >= RIGHT_OR_ASKED * sum(counts.values())
