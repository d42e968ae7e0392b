"""Ground motions: read from a file, taken from the FEMA P695 sets, or made; scaled and resampled.

`read_ground_motion`, `record` and `synthetic_ground_motion` each return a `GroundMotion`; `ground_motion_from` takes
the table [ground_motion] of a configuration. Accelerations are in m/s2.
"""

from rthstrack.ground_motion.files import read_ground_motion
from rthstrack.ground_motion.motion import GroundMotion
from rthstrack.ground_motion.records import RecordEntry, list_records, record
from rthstrack.ground_motion.synthetic import synthetic_ground_motion
from rthstrack.ground_motion.table import check_ground_motion, ground_motion_from
from rthstrack.recording.readers.at2 import STANDARD_GRAVITY_M_S2

__all__ = [
    "STANDARD_GRAVITY_M_S2",
    "GroundMotion",
    "RecordEntry",
    "check_ground_motion",
    "ground_motion_from",
    "list_records",
    "read_ground_motion",
    "record",
    "synthetic_ground_motion",
]
