"""Which channels are likely to be target and measured, by their names or, failing that, by their likeness."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import ChannelError, RecordingError
from rthstrack.recording.clocks import on_one_clock
from rthstrack.recording.copies import is_copy
from rthstrack.recording.names import FILLERS, GENERIC, quantities, role, words
from rthstrack.units import length_factor, split_unit
from rthstrack.units import quantity as unit_quantity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rthstrack.recording.recording import Channel, Recording

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
# An actuator that is left to itself loses so much that the gain is this or less.
_LOSS = 0.92
_CHOOSE = "choose: {target}, {measured}"
_NAME = "name them: {target}, {measured}"


@dataclass(frozen=True, slots=True)
class _Named:
    """A channel with what its name says: role (target or measured), rank of the word, quantity, and what is left."""

    index: int
    role: str | None
    rank: int
    quantity: str | None
    rest: tuple[str, ...]


@np.errstate(all="ignore")  # infinite samples are told where they matter
def propose_pair(recording: Recording) -> tuple[list[tuple[str, str]], str]:
    """Likely (target, measured) channels, one pair per actuator, and one sentence that says why.

    The channels are given by what selects them: the path, or `#index` where the path is not unique. Names decide
    (target, command, reference, ... and measured, feedback, actual, ...; in several languages), first those of the
    channels, then of what they stand in; where no name tells, two channels that move alike with a small lag are a
    guess, and the sentence says so. Exact copies are no pair. Raises ChannelError if nothing is likely, or if several
    fit.
    """
    channels = recording.channels
    judged = [i for i, c in enumerate(channels) if not c.is_time]
    copies: list[str] = []
    several: ChannelError | None = None
    for of_role, of_rest in ((1, 1), (1, 9), (2, 9), (3, 9)):
        named = [_read_name(i, channels[i], of_role, of_rest) for i in judged]
        if of_role > 1 and not {"target", "measured"} <= {one.role for one in named}:
            continue
        try:
            pairs = _by_name(named, channels, recording.file, copies)
        except ChannelError as error:
            several = several or error
            continue
        if pairs:
            shown = " and ".join(f"'{channels[t].name}' and '{channels[m].name}'" for t, m in pairs[:3])
            shown += ", ..." if len(pairs) > 3 else ""
            why = f"{shown} are named like target and measured"
            return [(_selector(channels, t), _selector(channels, m)) for t, m in pairs], why
    if several is not None:
        raise several
    if copies:
        raise ChannelError(
            f"no likely target/measured pair: {'; '.join(dict.fromkeys(copies))}",
            file=recording.file,
            code="copy",
            advice=_NAME,
        )
    named = [_read_name(i, channels[i], 1, 9) for i in judged]
    if any(one.role for one in named):
        raise ChannelError(
            f"no likely target/measured pair: found only {_half(named, channels)}", file=recording.file, advice=_NAME
        )
    target, measured, why = _by_likeness(recording, named)
    return [(_selector(channels, target), _selector(channels, measured))], why


def _half(named: Sequence[_Named], channels: tuple[Channel, ...]) -> str:
    """The channels of the only role that there is, and those that may have the other."""
    found = [one for one in named if one.role]
    said = ", ".join(f"'{channels[one.index].name}' ({one.role})" for one in found[:6])
    kinds = {one.quantity for one in found} - {None}
    others = [f"'{channels[one.index].name}'" for one in named if one.role is None and one.quantity in kinds]
    missing = "measured" if found[0].role == "target" else "target"
    return f"{said}; {missing} may be {' or '.join(others[:4])}" if others else said


def _selector(channels: tuple[Channel, ...], index: int) -> str:
    path = channels[index].path
    alike = sum(path in (channel.path, channel.name) for channel in channels)
    return path if alike == 1 else f"#{index}"


def _read_name(index: int, channel: Channel, of_role: int, of_rest: int) -> _Named:
    """What a channel's name says: of the role in its last `of_role` parts, of which one it is in the last `of_rest`.

    The word in a path is not the word of a channel, so that the role is looked for in the name first.
    """
    stem, unit = split_unit(channel.name)
    if channel.unit is None and unit is not None:
        # Such as disp_m beside disp_t: the suffix was found to be no unit.
        stem = channel.name
    parts = _parts(stem)
    if channel.path != channel.name:
        parts = [*_parts(channel.path)[:-1], parts[-1]]
    spoken = [words(part) for part in parts]
    text = [word for part in spoken[-max(of_role, of_rest) :] for word in part]
    for depth in range(1, of_role + 1):
        within = [word for part in spoken[-depth:] for word in part]
        found = role(within)
        if found.name:
            break
    at = found.at + len(text) - len(within) if found.name else -1
    kinds = quantities(text)
    told = {kind for _, kind in kinds}
    # An error of displacement is no displacement.
    kind = "other" if "other" in told else (kinds[0][1] if kinds else None)
    kind = kind if kind == "other" else _BY_UNIT.get(unit_quantity(channel.unit) or "") or kind
    used = {at, *(i for i, _ in kinds)}
    return _Named(index, found.name, found.rank, kind, tuple(word for i, word in enumerate(text) if i not in used))


def _parts(path: str) -> list[str]:
    return [part for part in re.split(r"[/.](?=[^\W\d])", path) if part] or [path]


def _by_name(named: list[_Named], channels: tuple[Channel, ...], file: str, copies: list[str]) -> list[tuple[int, int]]:
    """Pairs by name, of one quantity and length: displacement where there is any, else what there is."""
    for wanted in (
        ("displacement", None),
        ("force",),
        ("acceleration",),
        ("velocity",),
        ("rotation",),
        ("voltage",),
        # Volts beside millimetres may be a pair, of unlike units.
        ("displacement", "voltage", None),
    ):
        targets = [one for one in named if one.role == "target" and one.quantity in wanted]
        measured = [one for one in named if one.role == "measured" and one.quantity in wanted]
        if targets and not measured:
            measured = _bare(targets, named, channels)
        if not (targets and measured):
            continue
        targets = _once(targets, channels)
        measured, said = _without_copies(targets, measured, channels)
        copies += said
        if not measured:
            measured, _ = _without_copies(targets, _bare(targets, named, channels), channels)
        if not measured:
            continue
        pairs = _matched(targets, measured)
        if not pairs:
            listed = ", ".join(f"'{channels[one.index].name}'" for one in (*targets, *measured))
            raise ChannelError(f"several channels could be target or measured: {listed}", file=file, advice=_CHOOSE)
        return [(t, m) for t, m in pairs if len(channels[t].values) == len(channels[m].values)] or pairs
    return []


def _bare(targets: list[_Named], named: list[_Named], channels: tuple[Channel, ...]) -> list[_Named]:
    """Channels called like a target without its word: 'Weg' beside 'Weg Sollwert'."""
    return [
        one
        for one in named
        if one.role is None
        and any(
            one.rest == target.rest
            and one.quantity == target.quantity
            and (target.quantity is not None or bool(target.rest))
            and channels[one.index].unit == channels[target.index].unit
            for target in targets
        )
    ]


def _same(a: Channel, b: Channel) -> bool:
    """Whether two channels are copies, perhaps in other units."""
    factor = length_factor(b.unit, a.unit) or 1.0
    return is_copy(a.values, b.values if factor == 1 else factor * b.values)


def _once(found: list[_Named], channels: tuple[Channel, ...]) -> list[_Named]:
    """Of copies the one with the best word."""
    kept: list[_Named] = []
    for one in sorted(found, key=lambda one: one.rank):
        if not any(_same(channels[k.index], channels[one.index]) for k in kept):
            kept.append(one)
    return sorted(kept, key=lambda one: one.index)


def _without_copies(
    targets: list[_Named], measured: list[_Named], channels: tuple[Channel, ...]
) -> tuple[list[_Named], list[str]]:
    """Measured channels that are no copy of any target and, of copies among them, the first; and what was left out."""
    kept: list[_Named] = []
    said = []
    for one in measured:
        of = next((t for t in targets if _same(channels[t.index], channels[one.index])), None)
        if of is None:
            kept.append(one)
        else:
            said.append(f"'{channels[one.index].name}' is an exact copy of '{channels[of.index].name}'")
    return _once(kept, channels), said


def _matched(targets: list[_Named], measured: list[_Named]) -> list[tuple[int, int]]:
    """One pair for each set of words that both sides have beside role, quantity and unit (act1, 2, north)."""
    pairs, unclear = [], False
    for rest in dict.fromkeys(one.rest for one in targets):
        best_target = _best([one for one in targets if one.rest == rest])
        best_measured = _only([one for one in measured if one.rest == rest])
        if best_target and best_measured:
            pairs.append((best_target.index, best_measured.index))
        unclear |= best_measured is None and any(one.rest == rest for one in measured)
    if pairs and not unclear:
        return sorted(pairs)
    if unclear:
        return []
    # With other words beside them, there may be one of each only, and not of two degrees of freedom.
    target, one = _best(targets), _only(measured)
    if target is None or one is None:
        return []
    ours, theirs = set(target.rest) - FILLERS, set(one.rest) - FILLERS
    return [(target.index, one.index)] if ours <= theirs or theirs <= ours else []


def _best(candidates: list[_Named]) -> _Named | None:
    """The one with the best word and a stated quantity, or None if that leaves more than one."""
    if not candidates:
        return None
    order = sorted(candidates, key=lambda one: (one.rank, one.quantity is None))
    key = (order[0].rank, order[0].quantity is None)
    return order[0] if sum((one.rank, one.quantity is None) == key for one in order) == 1 else None


def _only(measured: list[_Named]) -> _Named | None:
    """The only one that says what it measures, where any does, else the only one: two sensors may both be meant."""
    stated = [one for one in measured if one.quantity is not None] or measured
    return stated[0] if len(stated) == 1 else None


def _by_likeness(recording: Recording, named: list[_Named]) -> tuple[int, int, str]:
    """The two channels most alike at a small lag, target first, and why they are taken for a pair.

    Who leads does not decide which is target. Raises ChannelError, which names what was found.
    """
    channels = recording.channels
    nothing = "no likely target/measured pair: no name says target, command, measured or feedback"
    candidates, twice = _candidates(channels, named)
    best, n_compared, n_rates = None, 0, 0
    for (a, x), (b, y) in itertools.combinations(candidates[:_MOST_CHANNELS], 2):
        one, other = channels[a.index], channels[b.index]
        if one.time != other.time:
            x, y = _together(recording, a.index, b.index)
        if len(x) != len(y) or len(x) <= 16 or not 0.5 < np.linalg.norm(y) / np.linalg.norm(x) < 2:
            continue
        rate = one.time.rate_hz if one.time is not None else recording.rate_hz
        if rate is None:
            n_rates += 1
            continue
        longest = max(1, int(_LONGEST_LAG_S * rate))
        n_compared += 1
        correlation, lag = _likeness(x, y, min(longest, len(x) // 4))
        if correlation >= _LIKENESS and (best is None or correlation > best[2]):
            best = (a, b, correlation, lag, x, y)
    if best is None:
        copied = next((f", and '{channels[c].name}' is an exact copy of '{channels[o].name}'" for c, o in twice), "")
        said = ", and no two channels move alike" if n_compared else ", and no two channels could be compared"
        if n_rates and not n_compared:
            said = ", and without a sampling rate none were compared"
        raise ChannelError(f"{nothing}{copied or said}", file=recording.file, advice=_NAME)
    a, b, correlation, lag, x, y = best
    names = f"'{channels[a.index].name}' and '{channels[b.index].name}'"
    if _two_of_a_kind(a, b):
        raise ChannelError(
            f"{nothing}; {names} move alike, but may be two degrees of freedom", file=recording.file, advice=_NAME
        )
    by = _which_is_target(a.index, b.index, lag, x, y, {o for _, o in twice})
    if by is None:
        raise ChannelError(
            f"{nothing}; {names} move alike (correlation {correlation:.3f}), but which is target cannot be told",
            file=recording.file,
            code="which_is_target",
            advice=_NAME,
        )
    target, reason = by
    measured = b.index if target == a.index else a.index
    follows = lag if target == a.index else -lag
    when = f"{abs(follows)} samples {'later' if follows >= 0 else 'earlier'}"
    first, second = channels[target].name, channels[measured].name
    why = f"a guess, for no name tells: '{second}' follows '{first}' {when} (correlation {correlation:.3f}), {reason}"
    return target, measured, why


def _together(recording: Recording, a: int, b: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two channels with clocks of their own as they move together, less their means; nothing where they do not."""
    try:
        moved = on_one_clock(recording, (f"#{a}", f"#{b}")).channels
    except RecordingError:
        return np.zeros(0), np.zeros(0)
    x, y = (moved[i].values[:_MOST_SAMPLES] for i in (a, b))
    return (x - x.mean(), y - y.mean()) if np.ptp(x) > 0 and np.ptp(y) > 0 else (np.zeros(0), np.zeros(0))


def _candidates(
    channels: tuple[Channel, ...], named: list[_Named]
) -> tuple[list[tuple[_Named, NDArray[np.float64]]], list[tuple[int, int]]]:
    """Channels that may be motion, each once, less their means; and which are copies of which."""
    found: list[tuple[_Named, NDArray[np.float64]]] = []
    twice: list[tuple[int, int]] = []
    for one in named:
        values = channels[one.index].values[:_MOST_SAMPLES]
        rising = len(values) > 1 and bool(np.all(np.diff(values) > 0)) if np.isfinite(values).all() else False
        if one.quantity not in (None, "displacement") or len(values) <= 16 or not np.isfinite(values).all() or rising:
            continue
        if not np.ptp(values) > 0:
            continue
        of = next((o.index for o, _ in found if is_copy(channels[o.index].values, channels[one.index].values)), None)
        if of is not None:
            twice.append((one.index, of))
        else:
            found.append((one, values - values.mean()))
    return found, twice


def _two_of_a_kind(a: _Named, b: _Named) -> bool:
    """Whether names say that two channels are one thing at two places: 'disp north', 'disp south'; 'x1', 'x2'."""
    if a.quantity != b.quantity or a.rest == b.rest or not (a.rest and b.rest):
        return False
    said = [[word for word in one.rest if not word.isdigit() and word not in GENERIC] for one in (a, b)]
    return a.quantity is not None or (said[0] == said[1] != [])


def _which_is_target(
    a: int, b: int, lag: int, x: NDArray[np.float64], y: NDArray[np.float64], copied: set[int]
) -> tuple[int, str] | None:
    """Which of two like channels is target, never by who leads alone; None where nothing tells.

    A logged copy is mostly of what was sent. An actuator that follows late loses amplitude, and target stands before
    measured in a file: where one of these agrees with the lag, and nothing speaks against it.
    """
    by_motion = _by_motion(a, b, lag, x, y)
    if (a in copied) != (b in copied):
        twice = a if a in copied else b
        if by_motion is None or by_motion[0] == twice:
            return twice, "and the other is there twice, as a command that is logged"
        return None
    return by_motion


def _by_motion(a: int, b: int, lag: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[int, str] | None:
    if lag == 0:
        return a, "and stands behind it in the file"
    # Of the one that is late over the other.
    gain = float(np.linalg.norm(y) / np.linalg.norm(x)) ** (1 if lag > 0 else -1)
    if gain <= _LOSS:
        return (a if lag > 0 else b), f"late and smaller ({gain:.2f}), as an actuator is"
    if lag > 0 and gain < 1 / _LOSS:
        return a, "and stands behind it in the file"
    return None


def _likeness(x: NDArray[np.float64], y: NDArray[np.float64], longest: int) -> tuple[float, int]:
    """The highest correlation of y(t + lag) with x(t) for |lag| <= longest, and that lag."""
    n = 1 << (len(x) + longest).bit_length()
    product = np.fft.irfft(np.fft.rfft(y, n) * np.conj(np.fft.rfft(x, n)), n)
    lags = np.arange(-longest, longest + 1)
    values = product[lags] / (np.linalg.norm(x) * np.linalg.norm(y))
    at = int(values.argmax())
    return float(values[at]), int(lags[at])
