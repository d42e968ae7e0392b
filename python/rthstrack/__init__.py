"""Did the actuator do what the simulation asked?

Frequency-domain evaluation of actuator tracking in real-time hybrid simulation, after Guo, Xu and Chen (2014), and
virtual tests to rehearse it with, whose structures, restoring forces and actuators are in `rthstrack.virtual_test`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rthstrack import configuration as configuration
    from rthstrack import errors as errors
    from rthstrack import evaluation as evaluation
    from rthstrack import ground_motion as ground_motion
    from rthstrack import plots as plots
    from rthstrack import recording as recording
    from rthstrack import report as report
    from rthstrack import reproduction as reproduction
    from rthstrack import studies as studies
    from rthstrack import units as units
    from rthstrack import verdict as verdict
    from rthstrack import virtual_test as virtual_test
    from rthstrack._core import __version__ as __version__
    from rthstrack.errors import ChannelError as ChannelError
    from rthstrack.errors import ConfigurationError as ConfigurationError
    from rthstrack.errors import RecordingError as RecordingError
    from rthstrack.errors import RthstrackError as RthstrackError
    from rthstrack.errors import SettingError as SettingError
    from rthstrack.errors import SignalError as SignalError
    from rthstrack.errors import UnstableError as UnstableError
    from rthstrack.evaluation.bad_samples import BadSamples as BadSamples
    from rthstrack.evaluation.factors import FactorChanges as FactorChanges
    from rthstrack.evaluation.factors import Factors as Factors
    from rthstrack.evaluation.factors import KeyFrequencies as KeyFrequencies
    from rthstrack.evaluation.factors import WindowedFactors as WindowedFactors
    from rthstrack.evaluation.factors import choose_factors as choose_factors
    from rthstrack.evaluation.factors import key_frequencies as key_frequencies
    from rthstrack.evaluation.indices import IndexHistories as IndexHistories
    from rthstrack.evaluation.indices import Indices as Indices
    from rthstrack.evaluation.indices import index_histories as index_histories
    from rthstrack.evaluation.indices import indices as indices
    from rthstrack.evaluation.monitor import Monitor as Monitor
    from rthstrack.evaluation.monitor import Readings as Readings
    from rthstrack.evaluation.monitor import causal_decimate as causal_decimate
    from rthstrack.evaluation.presets import PRESETS as PRESETS
    from rthstrack.evaluation.presets import preset as preset
    from rthstrack.evaluation.response import FrequencyResponse as FrequencyResponse
    from rthstrack.evaluation.response import FrequencySlopes as FrequencySlopes
    from rthstrack.evaluation.response import frequency_response as frequency_response
    from rthstrack.evaluation.response import frequency_slopes as frequency_slopes
    from rthstrack.evaluation.settings import MonitorSettings as MonitorSettings
    from rthstrack.evaluation.settings import Settings as Settings
    from rthstrack.evaluation.tracking import Evaluator as Evaluator
    from rthstrack.evaluation.tracking import MovingTracking as MovingTracking
    from rthstrack.evaluation.tracking import Tracking as Tracking
    from rthstrack.evaluation.tracking import evaluate as evaluate
    from rthstrack.evaluation.tracking import evaluate_moving as evaluate_moving
    from rthstrack.ground_motion.files import read_ground_motion as read_ground_motion
    from rthstrack.ground_motion.motion import GroundMotion as GroundMotion
    from rthstrack.ground_motion.records import list_records as list_records
    from rthstrack.ground_motion.records import record as record
    from rthstrack.ground_motion.synthetic import synthetic_ground_motion as synthetic_ground_motion
    from rthstrack.recording.pairing import propose_pair as propose_pair
    from rthstrack.recording.reading import read_recording as read_recording
    from rthstrack.recording.recording import Channel as Channel
    from rthstrack.recording.recording import Recording as Recording
    from rthstrack.report.page import write_report as write_report
    from rthstrack.studies.cells import Study as Study
    from rthstrack.studies.grid import study as study
    from rthstrack.verdict.assessment import Assessment as Assessment
    from rthstrack.verdict.limits import Limits as Limits
    from rthstrack.verdict.recorded import assess as assess
    from rthstrack.virtual_test.configuration import read_configuration as read_configuration
    from rthstrack.virtual_test.parts import VirtualTest as VirtualTest
    from rthstrack.virtual_test.run import CriticalDelay as CriticalDelay
    from rthstrack.virtual_test.run import Run as Run
    from rthstrack.virtual_test.simulation import DelayDamping as DelayDamping
    from rthstrack.virtual_test.simulation import critical_delay as critical_delay
    from rthstrack.virtual_test.simulation import delay_damping as delay_damping
    from rthstrack.virtual_test.simulation import simulate as simulate
    from rthstrack.virtual_test.simulation import simulate_many as simulate_many
    from rthstrack.virtual_test.simulation import true_tracking as true_tracking
    from rthstrack.virtual_test.target_motion import RecordedTarget as RecordedTarget
    from rthstrack.virtual_test.target_motion import SineTarget as SineTarget
    from rthstrack.virtual_test.target_motion import SweepTarget as SweepTarget
    from rthstrack.virtual_test.target_motion import read_target as read_target

# Nobody waits for what is not asked for (SciPy's filters, a table of records, figures): each name is fetched from its
# module on its first use. Type checkers read the imports above; a test holds the two lists together.
_HOMES = {
    "_core": "__version__",
    "errors": "ChannelError ConfigurationError RecordingError RthstrackError SettingError SignalError UnstableError",
    "evaluation.bad_samples": "BadSamples",
    "evaluation.factors": "FactorChanges Factors KeyFrequencies WindowedFactors choose_factors key_frequencies",
    "evaluation.indices": "IndexHistories Indices index_histories indices",
    "evaluation.monitor": "Monitor Readings causal_decimate",
    "evaluation.presets": "PRESETS preset",
    "evaluation.response": "FrequencyResponse FrequencySlopes frequency_response frequency_slopes",
    "evaluation.settings": "MonitorSettings Settings",
    "evaluation.tracking": "Evaluator MovingTracking Tracking evaluate evaluate_moving",
    "ground_motion.files": "read_ground_motion",
    "ground_motion.motion": "GroundMotion",
    "ground_motion.records": "list_records record",
    "ground_motion.synthetic": "synthetic_ground_motion",
    "recording.pairing": "propose_pair",
    "recording.reading": "read_recording",
    "recording.recording": "Channel Recording",
    "report.page": "write_report",
    "studies.cells": "Study",
    "studies.grid": "study",
    "verdict.assessment": "Assessment",
    "verdict.limits": "Limits",
    "verdict.recorded": "assess",
    "virtual_test.configuration": "read_configuration",
    "virtual_test.parts": "VirtualTest",
    "virtual_test.run": "CriticalDelay Run",
    "virtual_test.simulation": "DelayDamping critical_delay delay_damping simulate simulate_many true_tracking",
    "virtual_test.target_motion": "RecordedTarget SineTarget SweepTarget read_target",
}
_HOME = {name: f"{__name__}.{module}" for module, names in _HOMES.items() for name in names.split()}
_ROOMS = (
    "configuration",
    "errors",
    "evaluation",
    "ground_motion",
    "plots",
    "recording",
    "report",
    "reproduction",
    "studies",
    "units",
    "verdict",
    "virtual_test",
)

__all__ = sorted(_HOME)


if not TYPE_CHECKING:  # a checker is to find names that are not there

    def __getattr__(name: str) -> Any:
        if name in _HOME:
            value = getattr(import_module(_HOME[name]), name)
        elif name in _ROOMS:
            value = import_module(f"{__name__}.{name}")
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME, *_ROOMS})
