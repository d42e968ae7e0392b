"""Recordings: files to named channels with units and one sampling rate, and which of them are target and measured."""

from rthstrack.recording.clocks import on_one_clock
from rthstrack.recording.pairing import propose_pair
from rthstrack.recording.reading import read_recording, recording_from
from rthstrack.recording.recording import Channel, Recording
from rthstrack.units import length_factor

__all__ = [
    "Channel",
    "Recording",
    "length_factor",
    "on_one_clock",
    "propose_pair",
    "read_recording",
    "recording_from",
]
