"""Which channels are likely to be target and measured, by their names or, failing that, by their likeness."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import ChannelError
from rthstrack.recording.copies import is_copy
from rthstrack.recording.likeness import LIKENESS, MOST_SAMPLES, Likeness, likeness, rate_of
from rthstrack.recording.names import FILLERS, GENERIC, quantities, role, words
from rthstrack.said import Said
from rthstrack.units import length_factor, split_unit
from rthstrack.units import quantity as unit_quantity

if TYPE_CHECKING:
    from collections.abc import Sequence

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
# A guess by likeness compares no more channels than this.
_MOST_CHANNELS = 16
# A later channel that is larger than the earlier by more than this is hardly what follows it.
_MOST_GAIN = 1.09
_INPUT = {"input", "in"}
_CHOOSE = "choose: {target}, {measured}"
_NAME = "name them: {target}, {measured}"


@dataclass(frozen=True, slots=True)
class _Named:
    """A channel with what its name says: role (target or measured), rank of the word, quantity, and what is left.

    The quantity may be known by the unit alone, or by a word.
    """

    index: int
    role: str | None
    rank: int
    quantity: str | None
    by_word: bool
    rest: tuple[str, ...]


@np.errstate(all="ignore")  # infinite samples are told where they matter
def propose_pair(recording: Recording) -> tuple[list[tuple[str, str]], Said]:
    """Likely (target, measured) channels, one pair per actuator, and one sentence that says why.

    The channels are given by what selects them: the path, or `#index` where the path is not unique. Names decide
    (target, command, reference, ... and measured, feedback, actual, ...; in several languages), first those of the
    channels, then of what they stand in; a channel named like target goes with the only other one of its kind that
    moves like it. Where no name tells, two channels that move alike in the order of target and measured are a guess,
    and the sentence says so (its code is `pair_guessed`). Exact copies are no pair. Raises ChannelError if nothing is
    likely, or if several fit.
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
            pairs = _by_name(named, recording, copies)
        except ChannelError as error:
            several = several or error
            continue
        if pairs:
            shown = " and ".join(f"'{channels[t].name}' and '{channels[m].name}'" for t, m in pairs[:3])
            shown += ", ..." if len(pairs) > 3 else ""
            why = Said(f"{shown} are named like target and measured", "pair_named")
            return [(_selector(channels, t), _selector(channels, m)) for t, m in pairs], why
    if several is not None:
        raise several
    for of_role in (1, 2, 3):
        pairs = _by_targets_name([_read_name(i, channels[i], of_role, 9) for i in judged], recording)
        if pairs:
            shown = " and ".join(f"only '{channels[m].name}' moves like '{channels[t].name}'" for t, m in pairs[:3])
            why = Said(f"{shown}, named like target", "pair_half_named")
            return [(_selector(channels, t), _selector(channels, m)) for t, m in pairs], why
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
    by_unit = _BY_UNIT.get(unit_quantity(channel.unit) or "")
    # A load cell in volts is one of force.
    kind = kind if kind == "other" or (kind and by_unit == "voltage") else by_unit or kind
    used = {at, *(i for i, _ in kinds)}
    rest = tuple(word for i, word in enumerate(text) if i not in used)
    return _Named(index, found.name, found.rank, kind, bool(kinds), rest)


def _parts(path: str) -> list[str]:
    return [part for part in re.split(r"[/.](?=[^\W\d])", path) if part] or [path]


def _by_name(named: list[_Named], recording: Recording, copies: list[str]) -> list[tuple[int, int]]:
    """Pairs by name, of one quantity and length: displacement where there is any, else what there is."""
    channels = recording.channels
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
        rivals = _rivals(pairs, named, recording)
        if not pairs or rivals:
            raise _several((*targets, *measured, *rivals), channels, recording.file)
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


def _several(found: Sequence[_Named], channels: tuple[Channel, ...], file: str) -> ChannelError:
    listed = ", ".join(f"'{channels[one.index].name}'" for one in found)
    return ChannelError(f"several channels could be target or measured: {listed}", file=file, advice=_CHOOSE)


def _own(one: _Named) -> set[str]:
    """The words that say which of several alike a channel is."""
    return set(one.rest) - FILLERS


def _of_one_kind(target: _Named, one: _Named, channels: tuple[Channel, ...]) -> bool:
    """Whether what a channel says of quantity and unit leaves it the same as target's."""
    a, b = channels[target.index].unit, channels[one.index].unit
    return (target.quantity is None or one.quantity in (None, target.quantity)) and (a is None or b is None or a == b)


def _alike(recording: Recording, a: int, b: int) -> bool:
    found = likeness(recording, a, b)
    return found is not None and found.correlation >= LIKENESS


def _rivals(pairs: list[tuple[int, int]], named: list[_Named], recording: Recording) -> list[_Named]:
    """Channels without a role that by name and motion may be measured as well as the one that was found.

    A controller calls what it measures by the quantity alone: beside 'LVDT' or 'measured' a bare 'Position' may be
    meant, and beside a bare 'Position', where target says no more than that, any other position.
    """
    channels = recording.channels
    by_index = {one.index: one for one in named}
    found = []
    for t, m in pairs:
        target, measured = by_index[t], by_index[m]
        for one in named:
            if (
                one.role is None
                and one.index != m
                and one.quantity is not None
                and one.quantity == (target.quantity or measured.quantity)
                and _of_one_kind(target, one, channels)
                and (_own(one) <= _own(target) or (measured.role is None and not _own(target)))
                and not any(_same(channels[i], channels[one.index]) for i in (t, m))
                and _alike(recording, t, one.index)
            ):
                found.append(one)
    return found


def _by_targets_name(named: list[_Named], recording: Recording) -> list[tuple[int, int]]:
    """Pairs where only target is named: with the one channel of its kind, degree of freedom and motion.

    That channel says that it is a position (Table Position), shares a word with target (x_p beside x_ref) or is a
    letter (X); 'input' may be the controller's or the actuator's. Raises ChannelError where several channels are that.
    """
    channels = recording.channels
    kinds = (None, "displacement", "rotation")
    if any(one.role == "measured" and one.quantity in kinds for one in named):
        return []
    targets = _once([one for one in named if one.role == "target" and one.quantity in kinds], channels)
    pairs = []
    for rest in dict.fromkeys(one.rest for one in targets):
        target = _best([one for one in targets if one.rest == rest])
        if target is None:
            continue
        ours, alike = _own(target), []
        for one in named:
            theirs = _own(one)
            if (
                one.role is None
                and one.quantity in kinds
                and (one.by_word or ours & theirs or [len(word) for word in one.rest] == [1])
                and not _INPUT & {*one.rest}
                and _of_one_kind(target, one, channels)
                and (ours <= theirs or theirs <= ours)
                and not _same(channels[target.index], channels[one.index])
                and _alike(recording, target.index, one.index)
            ):
                alike.append(one)
        alike = _once(alike, channels)
        if len(alike) > 1:
            raise _several((target, *alike), channels, recording.file)
        pairs += [(target.index, one.index) for one in alike]
    # One channel cannot answer two targets.
    return pairs if len({m for _, m in pairs}) == len(pairs) else []


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


def _by_likeness(recording: Recording, named: list[_Named]) -> tuple[int, int, Said]:
    """The two channels most alike at a small lag, target first, and why they are taken for a pair.

    Who leads does not decide which is target. Raises ChannelError, which names what was found.
    """
    channels = recording.channels
    nothing = "no likely target/measured pair: no name says target, command, measured or feedback"
    candidates, twice = _candidates(channels, named)
    best, n_compared, n_rates = None, 0, 0
    for a, b in itertools.combinations(candidates[:_MOST_CHANNELS], 2):
        found = likeness(recording, a.index, b.index)
        if found is None:
            n_rates += rate_of(recording, a.index) is None
            continue
        n_compared += 1
        if found.correlation >= LIKENESS and (best is None or found.correlation > best[2].correlation):
            best = (a, b, found)
    if best is None:
        copied = next((f", and '{channels[c].name}' is an exact copy of '{channels[o].name}'" for c, o in twice), "")
        said = ", and no two channels move alike" if n_compared else ", and no two channels could be compared"
        if n_rates and not n_compared:
            said = ", and without a sampling rate none were compared"
        raise ChannelError(f"{nothing}{copied or said}", file=recording.file, advice=_NAME)
    a, b, found = best
    names = f"'{channels[a.index].name}' and '{channels[b.index].name}'"
    if _two_of_a_kind(a, b):
        raise ChannelError(
            f"{nothing}; {names} move alike, but may be two degrees of freedom", file=recording.file, advice=_NAME
        )
    deeper = {one.index: _read_name(one.index, channels[one.index], 9, 9).role for one in (a, b)}
    by = _which_is_target(a.index, b.index, found, {o for _, o in twice})
    # A word far up in the path chooses nothing, and forbids the contrary.
    if by is not None and (deeper[by[0]] == "measured" or "target" in {deeper[i] for i in deeper if i != by[0]}):
        by = None
    if by is None:
        raise ChannelError(
            f"{nothing}; {names} move alike (correlation {found.correlation:.3f}), but which is target cannot be told",
            file=recording.file,
            code="which_is_target",
            advice=_NAME,
        )
    target, reason = by
    measured = b.index if target == a.index else a.index
    late = abs(found.lag)
    first, second = channels[target].name, channels[measured].name
    why = (
        f"a guess, for no name tells: '{second}' follows '{first}' {late} sample{'s' if late != 1 else ''} later "
        f"(correlation {found.correlation:.3f}), {reason}"
    )
    return target, measured, Said(why, "pair_guessed", (), f"if '{first}' is target (a guess: no name tells)")


def _candidates(channels: tuple[Channel, ...], named: list[_Named]) -> tuple[list[_Named], list[tuple[int, int]]]:
    """Channels that may be motion, each once; and which are copies of which."""
    found: list[_Named] = []
    twice: list[tuple[int, int]] = []
    for one in named:
        values = channels[one.index].values[:MOST_SAMPLES]
        rising = len(values) > 1 and bool(np.all(np.diff(values) > 0)) if np.isfinite(values).all() else False
        if one.quantity not in (None, "displacement") or len(values) <= 16 or not np.isfinite(values).all() or rising:
            continue
        if not np.ptp(values) > 0:
            continue
        of = next((o.index for o in found if is_copy(channels[o.index].values, channels[one.index].values)), None)
        if of is not None:
            twice.append((one.index, of))
        else:
            found.append(one)
    return found, twice


def _two_of_a_kind(a: _Named, b: _Named) -> bool:
    """Whether names say that two channels are one thing at two places: 'disp north', 'disp south'; 'x1', 'x2'."""
    if a.quantity != b.quantity or a.rest == b.rest or not (a.rest and b.rest):
        return False
    said = [[word for word in one.rest if not word.isdigit() and word not in GENERIC] for one in (a, b)]
    return a.quantity is not None or (said[0] == said[1] != [])


def _which_is_target(a: int, b: int, found: Likeness, copied: set[int]) -> tuple[int, str] | None:
    """Which of two like channels is target: the one that is logged twice, else the first of a file; None if unclear.

    Who leads never chooses. Where that one is the later of both, the choice may be wrong, and nobody is left to tell.
    """
    if (a in copied) != (b in copied):
        target, reason = (a if a in copied else b), "and the other is there twice, as a command that is logged"
    else:
        target, reason = a, "and stands behind it in the file"
    # Of measured after target, and over it.
    lag, gain = (found.lag, found.gain) if target == a else (-found.lag, 1 / found.gain)
    return (target, reason) if lag == 0 or (lag > 0 and gain <= _MOST_GAIN) else None
