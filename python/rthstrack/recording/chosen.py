"""From a file to the signals that are judged: read, propose, fill, scale, cut."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rthstrack.errors import RecordingError, SettingError
from rthstrack.recording.pairing import propose_pair
from rthstrack.recording.reading import read_recording

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rthstrack.recording.recording import Recording


class ChosenPairs(NamedTuple):
    """A recording as it is judged, its rate, (target, measured) as selectors, and why these if they were proposed."""

    recording: Recording
    rate_hz: float
    pairs: list[tuple[str, str]]
    proposal: str | None


def read_chosen(
    path: str | os.PathLike[str],
    *,
    targets: Sequence[str] = (),
    measured: Sequence[str] = (),
    rate_hz: float | None = None,
    time: str | None = None,
    resample_hz: float | None = None,
    scale: Mapping[str, float] | None = None,
    fill: int | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    block: int | None = None,
    lines: tuple[int, int] | None = None,
) -> ChosenPairs:
    """Reads a file, takes the pairs named or proposes them, fills gaps, scales channels and cuts.

    Raises RecordingError, ChannelError, SettingError, with the file named; no sampling rate is an error.
    """
    file = os.fspath(path)
    recording = read_recording(file, rate_hz=rate_hz, time=time, resample_hz=resample_hz, block=block, lines=lines)
    if recording.rate_hz is None:
        why = f"{file}: no sampling rate: {recording.rate_source}"
        raise RecordingError(why, advice="give {rate_hz} or {time}")
    pairs, proposal = list(zip(targets, measured, strict=False)), None
    if len(targets) != len(measured):
        raise SettingError(f"one measured for each target is needed, found {len(measured)} for {len(targets)}")
    if not pairs:
        pairs, proposal = propose_pair(recording)
    if fill:
        recording = recording.filled(fill)
    recording = recording.scaled(scale or {})
    if start_s is not None or end_s is not None:
        recording = recording.cut(start_s, end_s)
    assert recording.rate_hz is not None
    _refuse_blank_ends(recording, [name for pair in pairs for name in pair])
    return ChosenPairs(recording, recording.rate_hz, pairs, proposal)


def _refuse_blank_ends(recording: Recording, selectors: Sequence[str]) -> None:
    """Where a channel begins or ends with nothing, no gap can be filled: what is left is told, to be cut to."""
    for selector in selectors:
        channel = recording.channel(selector)
        known = np.flatnonzero(np.isfinite(channel.values))
        n_before, n_after = (int(known[0]), len(channel.values) - 1 - int(known[-1])) if known.size else (0, 0)
        if not n_before and not n_after:
            continue
        assert recording.rate_hz is not None
        first, end = n_before / recording.rate_hz, (len(channel.values) - n_after) / recording.rate_hz
        where = " and ".join(
            f"{n} sample(s) at the {place}" for n, place in ((n_before, "start"), (n_after, "end")) if n
        )
        cut = " and ".join(
            f"{{{key}}} = {at:g}" for n, key, at in ((n_before, "start_s", first), (n_after, "end_s", end)) if n
        )
        raise RecordingError(
            f"channel '{channel.path}' is blank or not finite in {where}",
            file=recording.file,
            code="blank_ends",
            values=(first, end),
            advice=f"cut there: {cut} s",
        )
