"""Did the actuator do what the simulation asked?

Frequency-domain evaluation of actuator tracking in real-time hybrid simulation, after Guo, Xu and Chen (2014).
"""

from rthstrack._core import __version__
from rthstrack.assessment import Assessment, Limits, assess
from rthstrack.errors import ChannelError, RecordingError, RthstrackError, SettingError, SignalError
from rthstrack.recording import Channel, Recording, propose_pair, read_recording
from rthstrack.report import write_report
from rthstrack.tracking import (
    Evaluator,
    FrequencyResponse,
    IndexHistories,
    Indices,
    MovingTracking,
    Settings,
    Tracking,
    evaluate,
    evaluate_moving,
    frequency_response,
    index_histories,
    indices,
)

__all__ = [
    "Assessment",
    "Channel",
    "ChannelError",
    "Evaluator",
    "FrequencyResponse",
    "IndexHistories",
    "Indices",
    "Limits",
    "MovingTracking",
    "Recording",
    "RecordingError",
    "RthstrackError",
    "SettingError",
    "Settings",
    "SignalError",
    "Tracking",
    "__version__",
    "assess",
    "evaluate",
    "evaluate_moving",
    "frequency_response",
    "index_histories",
    "indices",
    "propose_pair",
    "read_recording",
    "write_report",
]
