"""Did the actuator do what the simulation asked?

Frequency-domain evaluation of actuator tracking in real-time hybrid simulation, after Guo, Xu and Chen (2014), and
virtual tests to rehearse it with, whose structures, restoring forces and actuators are in `rthstrack.virtual_test`.
"""

from rthstrack._core import __version__
from rthstrack.errors import (
    ChannelError,
    ConfigurationError,
    RecordingError,
    RthstrackError,
    SettingError,
    SignalError,
    UnstableError,
)
from rthstrack.evaluation.bad_samples import BadSamples
from rthstrack.evaluation.factors import (
    FactorChanges,
    Factors,
    KeyFrequencies,
    WindowedFactors,
    choose_factors,
    key_frequencies,
)
from rthstrack.evaluation.indices import IndexHistories, Indices, index_histories, indices
from rthstrack.evaluation.monitor import Monitor, Readings, causal_decimate
from rthstrack.evaluation.presets import PRESETS, preset
from rthstrack.evaluation.response import FrequencyResponse, FrequencySlopes, frequency_response, frequency_slopes
from rthstrack.evaluation.settings import MonitorSettings, Settings
from rthstrack.evaluation.tracking import Evaluator, MovingTracking, Tracking, evaluate, evaluate_moving
from rthstrack.ground_motion.files import read_ground_motion
from rthstrack.ground_motion.motion import GroundMotion
from rthstrack.ground_motion.records import list_records, record
from rthstrack.ground_motion.synthetic import synthetic_ground_motion
from rthstrack.recording.pairing import propose_pair
from rthstrack.recording.reading import read_recording
from rthstrack.recording.recording import Channel, Recording
from rthstrack.report.page import write_report
from rthstrack.studies.cells import Study
from rthstrack.studies.grid import study
from rthstrack.verdict.assessment import Assessment, assess
from rthstrack.verdict.limits import Limits
from rthstrack.virtual_test.configuration import read_configuration
from rthstrack.virtual_test.parts import VirtualTest
from rthstrack.virtual_test.run import CriticalDelay, Run
from rthstrack.virtual_test.simulation import (
    DelayDamping,
    critical_delay,
    delay_damping,
    simulate,
    simulate_many,
    true_tracking,
)
from rthstrack.virtual_test.target_motion import RecordedTarget, SineTarget, SweepTarget, read_target

__all__ = [
    "PRESETS",
    "Assessment",
    "BadSamples",
    "Channel",
    "ChannelError",
    "ConfigurationError",
    "CriticalDelay",
    "DelayDamping",
    "Evaluator",
    "FactorChanges",
    "Factors",
    "FrequencyResponse",
    "FrequencySlopes",
    "GroundMotion",
    "IndexHistories",
    "Indices",
    "KeyFrequencies",
    "Limits",
    "Monitor",
    "MonitorSettings",
    "MovingTracking",
    "Readings",
    "RecordedTarget",
    "Recording",
    "RecordingError",
    "RthstrackError",
    "Run",
    "SettingError",
    "Settings",
    "SignalError",
    "SineTarget",
    "Study",
    "SweepTarget",
    "Tracking",
    "UnstableError",
    "VirtualTest",
    "WindowedFactors",
    "__version__",
    "assess",
    "causal_decimate",
    "choose_factors",
    "critical_delay",
    "delay_damping",
    "evaluate",
    "evaluate_moving",
    "frequency_response",
    "frequency_slopes",
    "index_histories",
    "indices",
    "key_frequencies",
    "list_records",
    "preset",
    "propose_pair",
    "read_configuration",
    "read_ground_motion",
    "read_recording",
    "read_target",
    "record",
    "simulate",
    "simulate_many",
    "study",
    "synthetic_ground_motion",
    "true_tracking",
    "write_report",
]
