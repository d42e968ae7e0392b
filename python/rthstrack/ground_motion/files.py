"""Ground motions read from files."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Literal

import numpy as np

from rthstrack.errors import RecordingError, SettingError, SignalError
from rthstrack.ground_motion.motion import GroundMotion
from rthstrack.recording.motion_files import Quantity, read_motion
from rthstrack.recording.readers.at2 import STANDARD_GRAVITY_M_S2, acceleration_unit

# The strongest ground motion ever recorded had less than a fifth of this.
_MOST_M_S2 = 20 * STANDARD_GRAVITY_M_S2


def read_ground_motion(
    path: str | os.PathLike[str],
    *,
    channel: str | None = None,
    unit: str | None = None,
    rate_hz: float | None = None,
    layout: Literal["channels", "values"] = "channels",
) -> GroundMotion:
    """Reads a ground motion from a PEER AT2 file or anything that `read_recording` reads.

    channel: by name, path or #index; by default the only one that is no time, or the only one whose unit, else whose
    name, is an acceleration's. unit: g, gal, cm/s2, m/s2, mm/s2, in/s2 or ft/s2; goes before the file's own, as does
    rate_hz. layout "values": the file holds one record, line after line, several values a line, without a time; it then
    needs unit and rate_hz.
    Raises RecordingError or ChannelError, one line, when the file or one of these is missing or cannot be used.
    """
    file = os.fspath(path)
    read = read_motion(path, ACCELERATION, channel=channel, unit=unit, rate_hz=rate_hz, layout=layout)
    peak = float(np.abs(read.values).max(initial=0.0))
    if read.values.size > 1 and peak == 0:
        raise RecordingError(f"{read.channel}: every value is zero; no ground motion", file=file, code="all_zero")
    if peak > _MOST_M_S2:
        most, found = (f"{value / STANDARD_GRAVITY_M_S2:.4g} g" for value in (_MOST_M_S2, peak))
        raise RecordingError(
            f"{read.channel}: expected at most {most}, found a peak of {found}; is its unit right?",
            file=file,
            code="implausible_peak",
            values=(peak,),
            advice="give {unit}",
        )
    try:
        return GroundMotion(Path(path).stem, read.values, read.rate_hz, read.source, read.notes)
    except SettingError as error:
        raise SettingError(f"{file}: {error}") from None
    except SignalError as error:
        raise RecordingError(f"{read.channel}: {error}", file=file) from None


ACCELERATION = Quantity(
    "acceleration",
    "g, gal, cm/s2, m/s2, mm/s2, in/s2, ft/s2",
    acceleration_unit,
    # By its unit, by `ground` or by `acc` in its name.
    (
        lambda c: acceleration_unit(c.unit or "") is not None,
        lambda c: re.search("ground|quake", c.name, re.IGNORECASE) is not None,
        lambda c: re.search("acc|a_?g$", c.name, re.IGNORECASE) is not None,
    ),
)
