"""What a virtual test gave, and the file of it: an HDF5 recording with the configuration that made it inside."""

from __future__ import annotations

import json
import math
import os
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from rthstrack._core import __version__
from rthstrack.errors import ConfigurationError, RecordingError, SignalError
from rthstrack.values import Shown, Value
from rthstrack.virtual_test.configuration import to_table, virtual_test_from

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from rthstrack.virtual_test.parts import VirtualTest
    from rthstrack.virtual_test.target_motion import TargetMotion

PROGRAM = "rthstrack"


def write_run(run: Run, path: str | os.PathLike[str], *, motion: Mapping[str, Any] | None = None) -> None:
    """Writes a run as an HDF5 recording, whole or not at all.

    Channels: target, command, measured, force (target_1, target_2, ... for several actuators), displacement_1, ... of
    the degrees of freedom, ground_motion (neither without a structure); each with its unit. Attributes: rate_hz,
    configuration (JSON; with the table `motion` that ground motion or target were made from, where it is given),
    program, version, what the run says of itself.
    Raises SignalError for samples that are not finite, RecordingError if the file cannot be written.
    """
    channels = _channels(run)
    for name, (values, _) in channels.items():
        if not np.isfinite(values).all():
            raise SignalError(f"{os.fspath(path)}: not written: '{name}' has samples that are NaN or infinite")
    table_of_motion = None if run.target_motion is None else run.target_motion.table
    described = (motion if motion is not None else table_of_motion) or {"name": run.motion_name}
    table = to_table(run.test, described, (run.n_samples - 1) / run.rate_hz)
    what = "ground_motion" if run.ground_motion is not None else "target"
    attributes: dict[str, Any] = {
        "rate_hz": run.rate_hz,
        "program": PROGRAM,
        "version": __version__,
        "configuration": json.dumps(table, allow_nan=False),
        f"{what}_name": run.motion_name,
        f"{what}_notes": "\n".join(run.motion_notes),
        "steps_per_sample": run.steps_per_sample,
    }
    if math.isfinite(run.error_estimate):
        attributes["error_estimate"] = run.error_estimate
    if run.critical_delay is not None:
        attributes["critical_delay_s"] = run.critical_delay.delay_s
    target = Path(path)
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
    try:
        with h5py.File(temporary, "w") as file:
            file.attrs.update(attributes)
            for name, (values, unit) in channels.items():
                file.create_dataset(name, data=values).attrs["unit"] = unit
        temporary.replace(target)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else error
        raise RecordingError(f"cannot be written: {why}", file=target) from None
    finally:
        temporary.unlink(missing_ok=True)


def read_run_test(path: str | os.PathLike[str]) -> VirtualTest | None:
    """The virtual test that made a file; None if the file is no run of rthstrack's.

    Raises RecordingError if the file is not there or its configuration cannot be read.
    """
    file = os.fspath(path)
    if not Path(file).is_file():
        raise RecordingError("no such file", file=file)
    if not h5py.is_hdf5(file):
        return None
    try:
        with h5py.File(file, "r") as opened:
            attributes = {key: opened.attrs.get(key) for key in ("program", "version", "configuration")}
    except OSError:
        return None
    if attributes["program"] != PROGRAM or not isinstance(attributes["configuration"], str):
        return None
    written = f"written by rthstrack {attributes['version']}, this is {__version__}"
    try:
        return virtual_test_from(json.loads(attributes["configuration"]))
    except ConfigurationError as error:
        (key, message), *more = error.mistakes
        others = f" (and {len(more)} more)" if more else ""
        raise RecordingError(
            f"its configuration cannot be used ({written}): {key}: {message}{others}", file=file
        ) from None
    except (ValueError, AttributeError) as error:
        raise RecordingError(f"its configuration is damaged ({written}): {error}", file=file) from None


def _channels(run: Run) -> dict[str, tuple[NDArray[np.float64], str]]:
    """Every channel with its unit, by name."""
    channels: dict[str, tuple[NDArray[np.float64], str]] = {}
    for name, unit in (("target", "m"), ("command", "m"), ("measured", "m"), ("force", "N")):
        values = getattr(run, name)
        columns = {name: values} if values.ndim == 1 else {f"{name}_{i}": v for i, v in enumerate(values.T, start=1)}
        channels |= {key: (column, unit) for key, column in columns.items()}
    channels |= {f"displacement_{i}": (column, "m") for i, column in enumerate(run.displacement.T, start=1)}
    return channels if run.ground_motion is None else channels | {"ground_motion": (run.ground_motion, "m/s^2")}


@dataclass(frozen=True, slots=True, repr=False)
class CriticalDelay(Value):
    """The constant delay at which the loop's first pair of roots reaches the imaginary axis, and its frequency there.

    `delay_s` 0: unstable even without a delay; infinite: no delay makes it unstable. `exact` False: of the elastic
    stiffness of a structure or specimen that yields.
    """

    delay_s: float
    frequency_hz: float
    gain: float
    exact: bool


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Run(Value):
    """A finished virtual test. Signals are (n_samples,) for one actuator, else (n_samples, n_actuators); SI units.

    displacement (n_samples, n_dof) relative to the ground, ground_motion (n_samples,) in m/s2, None for actuators
    alone. `motion_name` and `motion_notes` are of ground motion or target, `target_motion` is the target as given.
    `error_estimate` is the largest change of target and measured (and of the force, without a structure), over their
    peaks, when the internal step is halved (NaN for cr).
    """

    test: VirtualTest
    rate_hz: float
    target: NDArray[np.float64]
    command: NDArray[np.float64]
    measured: NDArray[np.float64]
    force: NDArray[np.float64]
    displacement: NDArray[np.float64]
    ground_motion: NDArray[np.float64] | None
    motion_name: str
    motion_notes: tuple[str, ...]
    steps_per_sample: int
    error_estimate: float
    critical_delay: CriticalDelay | None
    target_motion: TargetMotion | None = None

    def _shown(self) -> Shown:
        peaks = {name: np.abs(getattr(self, name)).max(initial=0.0) for name in ("target", "measured", "force")}
        n = len(self.test.actuators)
        rows = [
            ("motion", self.motion_name),
            ("actuators", str(n)),
            ("target", f"peak {1e3 * peaks['target']:.4g} mm"),
            ("measured", f"peak {1e3 * peaks['measured']:.4g} mm"),
            ("force", f"peak {peaks['force'] / 1e3:.4g} kN"),
        ]
        if self.critical_delay is not None:
            rows.append(("critical delay", f"{1e3 * self.critical_delay.delay_s:.4g} ms"))
        return Shown(f"Run: {self.n_samples} samples at {self.rate_hz:g} Hz", rows)

    @property
    def n_samples(self) -> int:
        """Samples of each signal."""
        return len(self.target)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the HDF5 recording that `read_recording` and `rthstrack evaluate` read."""
        from rthstrack.virtual_test.run import write_run

        write_run(self, path)
