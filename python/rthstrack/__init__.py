"""Did the actuator do what the simulation asked?

Frequency-domain evaluation of actuator tracking in real-time hybrid simulation, after Guo, Xu and Chen (2014).
"""

from rthstrack._core import __version__
from rthstrack.errors import ChannelError, RecordingError, RthstrackError, SettingError, SignalError
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
    "ChannelError",
    "Evaluator",
    "FrequencyResponse",
    "IndexHistories",
    "Indices",
    "MovingTracking",
    "RecordingError",
    "RthstrackError",
    "SettingError",
    "Settings",
    "SignalError",
    "Tracking",
    "__version__",
    "evaluate",
    "evaluate_moving",
    "frequency_response",
    "index_histories",
    "indices",
]
