"""Which channels are likely to be target and measured, by their names or, failing that, by their likeness."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import ChannelError
from rthstrack.units import quantity as unit_quantity
from rthstrack.units import split_unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rthstrack.recording.recording import Channel, Recording

# In order of preference: what the simulation asks comes before what the controller is sent.
_ROLES = {
    "target": (
        {"target", "targ", "tgt", "calculated", "calc", "desired", "des", "xt"},
        {"reference", "ref", "setpoint", "sp", "demand", "soll", "sollwert", "consigne"},
        {"command", "cmd", "commanded", "dcmd", "xc"},
    ),
    "measured": (
        {"measured", "meas", "measure", "msd", "mes", "xm", "ist", "istwert"},
        {"feedback", "fbk", "fdbk", "fb", "actual", "act", "achieved", "lvdt", "encoder", "temposonic"},
        {"response", "resp", "sensor"},
    ),
}
_QUANTITIES = {
    "displacement": {
        "disp",
        "displ",
        "displacement",
        "pos",
        "position",
        "stroke",
        "lvdt",
        "xt",
        "xm",
        "xc",
        "dcmd",
        "weg",
    },
    "force": {"force", "load", "frc", "kraft", "fuerza", "loadcell"},
    "acceleration": {"acc", "accel", "acceleration", "ag"},
    "velocity": {"vel", "velocity"},
    "voltage": {"volt", "voltage", "current", "valve", "spool", "servo"},
    "other": {
        "temp",
        "temperature",
        "pressure",
        "strain",
        "error",
        "err",
        "time",
        "clock",
        "counter",
        "sample",
        "index",
        "trigger",
        "event",
    },
}
# x_t and x_m, disp_t and disp_m, ...: a letter behind the quantity.
_LETTERS = {"t": ("target", 0), "d": ("target", 0), "r": ("target", 1), "c": ("target", 2), "m": ("measured", 0)}
_BEFORE_LETTER = {"x", "u", "d", "f", "disp", "displ", "displacement", "pos", "position", "force", "frc"}
# What a channel is by what its unit measures.
_BY_UNIT = {
    "length": "displacement",
    "time": "other",
    "force": "force",
    "acceleration": "acceleration",
    "velocity": "velocity",
    "voltage": "voltage",
    "current": "voltage",
}
# What a guess by likeness needs: correlation, lag, gain, and how much of the record is looked at.
_LIKENESS = 0.9
_LONGEST_LAG_S = 0.25
_MOST_SAMPLES = 1 << 16
_MOST_CHANNELS = 16


@dataclass(frozen=True, slots=True)
class _Named:
    """A channel with what its name says: role (target or measured), rank of the word, quantity, and what is left."""

    index: int
    role: str | None
    rank: int
    quantity: str | None
    rest: tuple[str, ...]


def propose_pair(recording: Recording) -> tuple[list[tuple[str, str]], str]:
    """Likely (target, measured) channels, one pair per actuator, and one sentence that says why.

    The channels are given by what selects them: the path, or `#index` where the path is not unique. Names decide
    (target, command, reference, ... and measured, feedback, actual, ...); where no name tells, two channels that move
    alike with a small lag are a guess, and the sentence says so. Raises ChannelError if nothing is likely.
    """
    channels = recording.channels
    named = [_read_name(i, channel) for i, channel in enumerate(channels)]
    pairs = _by_name(named, channels, recording.file)
    if pairs:
        shown = " and ".join(f"'{channels[t].name}' and '{channels[m].name}'" for t, m in pairs[:3])
        shown += ", ..." if len(pairs) > 3 else ""
        why = f"{shown} are named like target and measured"
    elif any(one.role for one in named):
        roles = ", ".join(f"'{channels[one.index].name}' ({one.role})" for one in named if one.role)
        raise ChannelError(
            f"no likely target/measured pair: found only {roles}",
            file=recording.file,
            advice="name them: {target}, {measured}",
        )
    else:
        guess = _by_likeness(recording, named)
        if guess is None:
            raise ChannelError(
                "no likely target/measured pair: no name says target, command, measured or "
                "feedback, and no two channels move alike",
                file=recording.file,
                advice="name them: {target}, {measured}",
            )
        (target, measured), correlation, lag = guess
        pairs = [(target, measured)]
        a, b = channels[target].name, channels[measured].name
        why = f"a guess, for no name tells: '{b}' follows '{a}' {lag} samples later (correlation {correlation:.3f})"
    return [(_selector(channels, t), _selector(channels, m)) for t, m in pairs], why


def _selector(channels: tuple[Channel, ...], index: int) -> str:
    path = channels[index].path
    alike = sum(path in (channel.path, channel.name) for channel in channels)
    return path if alike == 1 else f"#{index}"


def _words(name: str) -> list[str]:
    """The words of a name in lower case: divided at signs, at capitals and around numbers; two-part ones joined."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    text = " ".join(re.findall(r"[^\W\d_]+|\d+", spaced.lower()))
    return re.sub(r"\b(set|load|feed|soll|ist) (point|cell|back|wert)\b", r"\1\2", text).split()


def _read_name(index: int, channel: Channel) -> _Named:
    stem, unit = split_unit(channel.name)
    if channel.unit is None and unit is not None:
        # Such as disp_m beside disp_t: the suffix was found to be no unit.
        stem = channel.name
    words = _words(stem)
    at, role, rank = _role(words)
    quantities = [(i, kind) for i, word in enumerate(words) for kind, known in _QUANTITIES.items() if word in known]
    quantity = _BY_UNIT.get(unit_quantity(channel.unit) or "") or (quantities[0][1] if quantities else None)
    used = {at, *(i for i, _ in quantities)}
    return _Named(index, role, rank, quantity, tuple(word for i, word in enumerate(words) if i not in used))


def _role(words: list[str]) -> tuple[int, str | None, int]:
    """Which word tells the role, the role, and how plainly: (-1, None, 0) if none does."""
    told = [
        (i, role, rank)
        for i, word in enumerate(words)
        for role, levels in _ROLES.items()
        for rank, level in enumerate(levels)
        if word in level
    ]
    # "act1 cmd" is the command of actuator 1; "cmd fbk" is a measured command.
    plain = [one for one in told if words[one[0]] != "act"] or told
    if plain:
        return next((one for one in plain if one[1] == "measured"), plain[0])
    for i, (before, letter) in enumerate(itertools.pairwise(words)):
        if before in _BEFORE_LETTER and letter in _LETTERS:
            return i + 1, *_LETTERS[letter]
    return -1, None, 0


def _by_name(named: list[_Named], channels: tuple[Channel, ...], file: str) -> list[tuple[int, int]]:
    """Pairs by name, of one quantity and length: displacement where there is any, else what there is."""
    for wanted in (("displacement", None), ("force",), ("acceleration",), ("velocity",), ("voltage",)):
        targets = [one for one in named if one.role == "target" and one.quantity in wanted]
        measured = [one for one in named if one.role == "measured" and one.quantity in wanted]
        if targets and measured:
            pairs = _matched(targets, measured)
            if not pairs:
                listed = ", ".join(f"'{channels[one.index].name}'" for one in (*targets, *measured))
                raise ChannelError(
                    f"several channels could be target or measured: {listed}",
                    file=file,
                    advice="choose: {target}, {measured}",
                )
            return [(t, m) for t, m in pairs if len(channels[t].values) == len(channels[m].values)] or pairs
    return []


def _matched(targets: list[_Named], measured: list[_Named]) -> list[tuple[int, int]]:
    """One pair for each set of words that both sides have beside role, quantity and unit (act1, 2, north)."""
    pairs = []
    for rest in dict.fromkeys(one.rest for one in targets):
        best_target = _best([one for one in targets if one.rest == rest])
        best_measured = _best([one for one in measured if one.rest == rest])
        if best_target and best_measured:
            pairs.append((best_target.index, best_measured.index))
    if pairs:
        return sorted(pairs)
    target, one = _best(targets), _best(measured)
    return [(target.index, one.index)] if target and one else []


def _best(candidates: list[_Named]) -> _Named | None:
    """The one with the best word and a stated quantity, or None if that leaves more than one."""
    if not candidates:
        return None
    order = sorted(candidates, key=lambda one: (one.rank, one.quantity is None))
    key = (order[0].rank, order[0].quantity is None)
    return order[0] if sum((one.rank, one.quantity is None) == key for one in order) == 1 else None


def _by_likeness(recording: Recording, named: list[_Named]) -> tuple[tuple[int, int], float, int] | None:
    """The two channels most alike at a small lag, (leading, following), their correlation and the lag in samples.

    None without a rate: what a small lag is then nobody knows.
    """
    channels = recording.channels
    if recording.rate_hz is None:
        return None
    longest = max(1, int(_LONGEST_LAG_S * recording.rate_hz))
    candidates: list[tuple[int, NDArray[np.float64]]] = []
    for one in named:
        values = channels[one.index].values[:_MOST_SAMPLES]
        rising = len(values) > 1 and bool(np.all(np.diff(values) > 0))
        if one.quantity in (None, "displacement") and len(values) > 16 and np.isfinite(values).all() and not rising:
            values = values - values.mean()
            if np.ptp(values) > 0:
                candidates.append((one.index, values))
    best = None
    for (a, x), (b, y) in itertools.combinations(candidates[:_MOST_CHANNELS], 2):
        if len(x) != len(y) or not 0.5 < np.linalg.norm(y) / np.linalg.norm(x) < 2:
            continue
        correlation, lag = _likeness(x, y, min(longest, len(x) // 4))
        if correlation >= _LIKENESS and (best is None or correlation > best[1]):
            best = ((a, b) if lag >= 0 else (b, a), correlation, abs(lag))
    return best


def _likeness(x: NDArray[np.float64], y: NDArray[np.float64], longest: int) -> tuple[float, int]:
    """The highest correlation of y(t + lag) with x(t) for |lag| <= longest, and that lag."""
    n = 1 << (len(x) + longest).bit_length()
    product = np.fft.irfft(np.fft.rfft(y, n) * np.conj(np.fft.rfft(x, n)), n)
    lags = np.arange(-longest, longest + 1)
    values = product[lags] / (np.linalg.norm(x) * np.linalg.norm(y))
    at = int(values.argmax())
    return float(values[at]), int(lags[at])
