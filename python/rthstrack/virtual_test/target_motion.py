"""Predefined targets: a sine, a sweep or a recorded displacement, for actuators without a structure.

`SineTarget`, `SweepTarget` and `RecordedTarget` (`read_target`) are what `simulate` moves actuators along;
`target_from` takes the table [target] of a configuration. All begin and end at zero, at rest. Displacements are in m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from rthstrack.errors import RecordingError, SettingError
from rthstrack.keyed_table import NUMBER, Table, one_of
from rthstrack.recording.motion_files import KEYS, Quantity, file_mistakes, read_motion
from rthstrack.units import is_length, length_factor
from rthstrack.values import Value

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = [
    "RecordedTarget",
    "SineTarget",
    "SweepTarget",
    "TargetMotion",
    "check_target",
    "read_target",
    "target_from",
]

Mistakes = list[tuple[str, str]]

_MOST_SAMPLES = 20_000_000
# Ramps where none is given: a share of the duration, at most so long.
_RAMP_SHARE, _LONGEST_RAMP_S = 0.1, 2.0
_LAWS = ("linear", "logarithmic")


class SampledTarget(NamedTuple):
    """Displacement, velocity and acceleration (n_samples, 3) in m, m/s, m/s2, and what was done to get them."""

    motion: Floats
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SineTarget:
    """a e(t) sin(2 pi f t) for `duration_s`, e rising smoothly from 0 over `ramp_s` and falling to 0 at the end.

    ramp_s: a tenth of the duration and at most 2 s unless given; at most half of it. e is 6 s^5 - 15 s^4 + 10 s^3 with
    s = t / ramp_s, so that neither velocity nor acceleration jumps.
    Raises SettingError naming everything that is wrong.
    """

    frequency_hz: float
    amplitude_m: float
    duration_s: float
    ramp_s: float | None = None

    def __post_init__(self) -> None:
        _refuse(_mistakes(_given(self)))

    @property
    def name(self) -> str:
        """As in tables and figures."""
        return f"sine of {self.frequency_hz:g} Hz, {1e3 * self.amplitude_m:g} mm"

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Where gain and delay are told."""
        return (self.frequency_hz,)

    @property
    def table(self) -> dict[str, Any]:
        """The table [target] that makes it anew."""
        return {"sine": _given(self)}

    def sampled(self, rate_hz: float, duration_s: float | None = None) -> SampledTarget:
        """At i / rate_hz, i = 0 .. round(duration_s rate_hz); zero past its end.

        Raises SettingError where half the rate is not above the frequency.
        """
        omega = 2 * math.pi * self.frequency_hz

        def phase(t: Floats) -> tuple[Floats, Floats, Floats]:
            return omega * t, np.full_like(t, omega), np.zeros_like(t)

        return _swung(self, phase, rate_hz, duration_s)


@dataclass(frozen=True, slots=True)
class SweepTarget:
    """a e(t) sin(phi(t)), phi' / 2 pi from `from_hz` to `to_hz` over `duration_s`; e as of a sine.

    law: "linear", f = from + (to - from) t / T, or "logarithmic", f = from (to / from)^(t / T): as long in each octave.
    Raises SettingError naming everything that is wrong.
    """

    from_hz: float
    to_hz: float
    amplitude_m: float
    duration_s: float
    law: Literal["linear", "logarithmic"] = "linear"
    ramp_s: float | None = None

    def __post_init__(self) -> None:
        _refuse(_mistakes(_given(self)))

    @property
    def name(self) -> str:
        """As in tables and figures."""
        return f"{self.law} sweep from {self.from_hz:g} to {self.to_hz:g} Hz, {1e3 * self.amplitude_m:g} mm"

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Where gain and delay are told."""
        return (self.from_hz, self.to_hz)

    @property
    def table(self) -> dict[str, Any]:
        """The table [target] that makes it anew."""
        return {"sweep": _given(self)}

    def sampled(self, rate_hz: float, duration_s: float | None = None) -> SampledTarget:
        """At i / rate_hz, i = 0 .. round(duration_s rate_hz); zero past its end.

        Raises SettingError where half the rate is not above both frequencies.
        """
        start, end, seconds = 2 * math.pi * self.from_hz, 2 * math.pi * self.to_hz, self.duration_s

        def phase(t: Floats) -> tuple[Floats, Floats, Floats]:
            if self.law == "linear":
                slope = (end - start) / seconds
                return start * t + 0.5 * slope * t**2, start + slope * t, np.full_like(t, slope)
            growth = math.log(end / start) / seconds
            omega = start * np.exp(growth * t)
            return start * np.expm1(growth * t) / growth, omega, growth * omega

        return _swung(self, phase, rate_hz, duration_s)


@dataclass(frozen=True, slots=True, eq=False)
class RecordedTarget(Value):
    """A displacement (n_samples,) in m at `rate_hz`, read-only, such as an earlier test's target.

    Between samples it is the cubic spline that rests at both ends. Where it does not begin or end at zero it is led
    there over `ramp_s`, before its first sample and after its last. `source` says where it comes from, `notes` what was
    done to it; `table` is the table [target] that makes it anew, where there is one.
    Raises SettingError for fewer than two samples, samples that are not finite, or wrong numbers.
    """

    name: str
    displacement_m: NDArray[np.float64] = field(repr=False)
    rate_hz: float
    source: str = "given"
    notes: tuple[str, ...] = ()
    ramp_s: float = 1.0
    table: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        settings = {"rate_hz": self.rate_hz, "ramp_s": self.ramp_s}
        mistakes = [(f"{self.name}: {key}", message) for key, message in _not_positive(settings)]
        values = np.array(self.displacement_m, dtype=np.float64)
        if values.ndim != 1 or values.size < 2:
            mistakes.append((self.name, f"expected at least 2 samples of one displacement, found shape {values.shape}"))
        elif n_broken := int((~np.isfinite(values)).sum()):
            first = int(np.argmin(np.isfinite(values)))
            message = f"{n_broken} of {values.size} samples are NaN or infinite (first at sample {first})"
            mistakes.append((self.name, message))
        _refuse(mistakes)
        values.setflags(write=False)
        object.__setattr__(self, "displacement_m", values)

    @property
    def duration_s(self) -> float:
        """From zero to zero, what leads there included."""
        before, after = self._leads_s
        return before + (len(self.displacement_m) - 1) / self.rate_hz + after

    @property
    def peak_m(self) -> float:
        """max |x|."""
        return float(np.abs(self.displacement_m).max())

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Where gain and delay are told: rms velocity over rms displacement without its mean, over 2 pi."""
        spread = float(np.std(self.displacement_m))
        speed = float(np.sqrt(np.mean(np.diff(self.displacement_m) ** 2))) * self.rate_hz
        return (speed / spread / (2 * math.pi),) if spread > 0 else ()

    def scaled(self, factor: float) -> RecordedTarget:
        """Times `factor`, which is finite and not zero."""
        if not (math.isfinite(factor) and factor != 0):
            raise SettingError(f"{self.name}: factor: expected a finite number other than zero, found {factor:g}")
        return self._scaled(factor, f"scaled by {factor:g}")

    def scaled_to_peak(self, peak_m: float) -> RecordedTarget:
        """Scaled so that max |x| is `peak_m`."""
        if not (math.isfinite(peak_m) and peak_m > 0):
            raise SettingError(f"{self.name}: peak_m: expected a positive number, found {peak_m:g}")
        if not self.peak_m > 0:
            raise SettingError(f"{self.name}: zero throughout: no factor scales it to a peak of {peak_m:g} m")
        factor = peak_m / self.peak_m
        return self._scaled(factor, f"scaled by {factor:.6g} to a peak of {1e3 * peak_m:g} mm")

    def sampled(self, rate_hz: float, duration_s: float | None = None) -> SampledTarget:
        """At i / rate_hz, i = 0 .. round(duration_s rate_hz), by the spline; zero past its end."""
        from scipy.interpolate import CubicSpline

        t = _times(self, rate_hz, duration_s)
        (before, after), last = self._leads_s, (len(self.displacement_m) - 1) / self.rate_hz
        at, near = t - before, 1e-9 / self.rate_hz
        spline = CubicSpline(np.arange(len(self.displacement_m)) / self.rate_hz, self.displacement_m, bc_type="clamped")
        motion = np.zeros((len(t), 3))
        if before:
            motion = self.displacement_m[0] * np.column_stack(_rise(t, before))
        if after:
            rise, speed, bend = _rise(last + after - at, after)
            motion[at > last] = self.displacement_m[-1] * np.column_stack((rise, -speed, bend))[at > last]
        else:
            motion[at > last] = 0.0
        inside = (at >= -near) & (at <= last + near)
        for i in range(3):
            motion[inside, i] = spline(np.clip(at[inside], 0, last), i)
        notes = list(self.notes)
        if before or after:
            ends = [f"from zero to its first value over {before:g} s"] * bool(before)
            ends += [f"from its last value to zero over {after:g} s"] * bool(after)
            notes.append(f"led {' and '.join(ends)}")
        if rate_hz != self.rate_hz:
            low_pass = ", without a low-pass" if rate_hz < self.rate_hz else ""
            notes.append(f"interpolated from {self.rate_hz:g} to {rate_hz:g} Hz by a cubic spline{low_pass}")
        return SampledTarget(motion, (*notes, *_cut(self, duration_s)))

    @property
    def _leads_s(self) -> tuple[float, float]:
        first, last = self.displacement_m[0], self.displacement_m[-1]
        return (self.ramp_s if first != 0 else 0.0, self.ramp_s if last != 0 else 0.0)

    def _scaled(self, factor: float, note: str) -> RecordedTarget:
        return replace(self, displacement_m=factor * self.displacement_m, notes=(*self.notes, note), table={})


TargetMotion = SineTarget | SweepTarget | RecordedTarget


# Motions --------------------------------------------------------------------------------------------------------------


def _times(target: TargetMotion, rate_hz: float, duration_s: float | None) -> Floats:
    seconds = target.duration_s if duration_s is None else duration_s
    for what, value in (("rate_hz", rate_hz), ("duration_s", seconds)):
        if not (math.isfinite(value) and value > 0):
            raise SettingError(f"{target.name}: {what}: expected a positive number, found {value:g}")
    if not 1 <= seconds * rate_hz <= _MOST_SAMPLES:
        raise SettingError(
            f"{target.name}: expected 1 to {_MOST_SAMPLES} steps, found {seconds * rate_hz:g} "
            f"({seconds:g} s at {rate_hz:g} Hz)"
        )
    return np.arange(round(seconds * rate_hz) + 1) / rate_hz


def _cut(target: TargetMotion, duration_s: float | None) -> tuple[str, ...]:
    short = duration_s is not None and duration_s < target.duration_s * (1 - 1e-12)
    return (f"cut at {duration_s:g} s, for the target has {target.duration_s:g} s",) if short else ()


def _rise(t: Floats, seconds: float) -> tuple[Floats, Floats, Floats]:
    """6 s^5 - 15 s^4 + 10 s^3, s = t / seconds, with its first two derivatives, which are 0 where it is 0 and 1."""
    s = np.clip(t / seconds, 0.0, 1.0)
    speed, bend = 30 * s**2 * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)
    return s**3 * (10 - 15 * s + 6 * s**2), speed / seconds, bend / seconds**2


def _swung(
    target: SineTarget | SweepTarget,
    phase: Callable[[Floats], tuple[Floats, Floats, Floats]],
    rate_hz: float,
    duration_s: float | None,
) -> SampledTarget:
    """a e(t) sin(phi(t)) and its derivatives, from those of e and phi."""
    _refuse(rate_mistakes(target, rate_hz))
    t = _times(target, rate_hz, duration_s)
    seconds, ramp = target.duration_s, _ramp_s(target)
    up, down = _rise(t, ramp), _rise(seconds - t, ramp)
    # Ramps do not overlap: where one rises the other is 1.
    e, e1, e2 = up[0] * down[0], up[1] - down[1], up[2] + down[2]
    phi, phi1, phi2 = phase(np.minimum(t, seconds))
    sine, cosine = np.sin(phi), np.cos(phi)
    w, w1, w2 = sine, phi1 * cosine, phi2 * cosine - phi1**2 * sine
    motion = target.amplitude_m * np.column_stack((e * w, e1 * w + e * w1, e2 * w + 2 * e1 * w1 + e * w2))
    return SampledTarget(np.ascontiguousarray(motion), _cut(target, duration_s))


def _ramp_s(target: SineTarget | SweepTarget) -> float:
    return min(_RAMP_SHARE * target.duration_s, _LONGEST_RAMP_S) if target.ramp_s is None else target.ramp_s


def rate_mistakes(target: TargetMotion, rate_hz: float) -> Mistakes:
    """What is wrong with a sine or sweep at this rate; a recording only loses what lies above half of it."""
    if isinstance(target, RecordedTarget):
        return []
    names = ("frequency_hz",) if isinstance(target, SineTarget) else ("from_hz", "to_hz")
    return [
        (name, f"expected below half of the rate, {rate_hz / 2:g} Hz, found {getattr(target, name):g}")
        for name in names
        if not getattr(target, name) < rate_hz / 2
    ]


_POSITIVE = ("frequency_hz", "from_hz", "to_hz", "amplitude_m", "duration_s", "rate_hz", "ramp_s")


def _not_positive(values: Mapping[str, Any]) -> Mistakes:
    return [
        (name, f"expected a positive number, found {values[name]!r}")
        for name in _POSITIVE
        if name in values and not 0 < values[name] < math.inf
    ]


def _mistakes(values: Mapping[str, Any]) -> Mistakes:
    """What is wrong with the numbers of a sine or sweep, as far as they are there."""
    mistakes = _not_positive(values)
    wrong = [name for name, _ in mistakes]
    start, end, ramp, duration = (values.get(name) for name in ("from_hz", "to_hz", "ramp_s", "duration_s"))
    if values.get("law", "linear") not in _LAWS:
        mistakes.append(("law", f"expected 'linear' or 'logarithmic', found {values['law']!r}"))
    if start is not None and start == end and not wrong:
        mistakes.append(("to_hz", f"expected another frequency than from_hz, found {end:g}; or a sine"))
    if ramp is not None and duration is not None and not {"ramp_s", "duration_s"} & set(wrong) and ramp > duration / 2:
        mistakes.append(("ramp_s", f"expected up to half of the duration, {duration / 2:g} s, found {ramp:g}"))
    return mistakes


def _given(target: SineTarget | SweepTarget) -> dict[str, Any]:
    values = {one.name: getattr(target, one.name) for one in fields(target)}
    return {name: value for name, value in values.items() if value is not None}


def _refuse(mistakes: Mistakes) -> None:
    if mistakes:
        raise SettingError("; ".join(f"{key}: {message}" for key, message in mistakes))


# Files ----------------------------------------------------------------------------------------------------------------

_DISPLACEMENT = Quantity(
    "displacement",
    "m, cm, mm, um, in, ft",
    lambda unit: (unit.strip(), length_factor(unit, "m") or 1.0) if is_length(unit) else None,
    (
        lambda c: is_length(c.unit),
        lambda c: "target" in c.name.lower(),
        lambda c: any(word in c.name.lower() for word in ("command", "cmd", "reference", "desired")),
        lambda c: "disp" in c.name.lower(),
    ),
)


def read_target(
    path: str | os.PathLike[str],
    *,
    channel: str | None = None,
    unit: str | None = None,
    rate_hz: float | None = None,
    layout: Literal["channels", "values"] = "channels",
    ramp_s: float = 1.0,
) -> RecordedTarget:
    """Reads a displacement from anything that `read_recording` reads, such as an earlier test.

    channel: by name, path or #index; by default the only one that is no time, or the only one whose unit is a length's,
    else whose name says target, command or displacement. unit: m, cm, mm, um, in or ft; goes before the file's own, as
    does rate_hz. layout "values": the file holds one record, line after line, several values a line, without a time; it
    then needs unit and rate_hz.
    Raises RecordingError or ChannelError, one line, when the file or one of these is missing or cannot be used.
    """
    read = read_motion(path, _DISPLACEMENT, channel=channel, unit=unit, rate_hz=rate_hz, layout=layout)
    options = {"channel": channel, "unit": unit, "rate_hz": rate_hz}
    table = {"file": str(path), **{key: value for key, value in options.items() if value is not None}}
    table |= {"layout": layout, "ramp_s": ramp_s}
    try:
        return RecordedTarget(Path(path).stem, read.values, read.rate_hz, read.source, read.notes, ramp_s, table)
    except SettingError as error:
        raise RecordingError(f"{read.channel}: {error}", file=path) from None


# Configurations -------------------------------------------------------------------------------------------------------

_SOURCES = ("sine", "sweep", "file")
_OF_FILE = (*KEYS, "factor", "peak_m", "ramp_s")


def check_target(
    table: object, base_dir: str | os.PathLike[str] | None = None, rate_hz: float | None = None
) -> Mistakes:
    """Everything wrong with a table [target], as (key, message); nothing if `target_from` can take it.

    base_dir: the configuration's folder; without it, it is not looked whether the file exists. rate_hz: of the test.
    """
    if not isinstance(table, Mapping):
        return [("target", f"expected a table, found {table!r}")]
    root = Table(table, "target", [])
    _read(root, base_dir, rate_hz)
    return root.mistakes


def target_from(table: Mapping[str, Any], base_dir: str | os.PathLike[str]) -> TargetMotion:
    """The target that a table [target] asks for; paths are relative to `base_dir`.

    Exactly one of sine = {frequency_hz, amplitude_m, duration_s or cycles, ramp_s}, sweep = {from_hz, to_hz,
    amplitude_m, duration_s, law, ramp_s} and file = "path" (with channel, unit, rate_hz, layout, ramp_s: see
    `read_target`, and at most one of factor and peak_m).
    Raises SettingError with every mistake and its key, and what reading raises.
    """
    root = Table(table, "target", [])
    made = _read(root, base_dir, None)
    _refuse(root.mistakes)
    if made is not None:
        return made
    options = {key: table[key] for key in (*KEYS, "ramp_s") if key in table}
    recorded = read_target(Path(base_dir) / table["file"], **options)
    if "factor" in table:
        recorded = recorded.scaled(table["factor"])
    if "peak_m" in table:
        recorded = recorded.scaled_to_peak(table["peak_m"])
    return replace(recorded, table=dict(table))


def _read(
    root: Table, base_dir: str | os.PathLike[str] | None, rate_hz: float | None
) -> SineTarget | SweepTarget | None:
    """The sine or sweep that a table says; None for a file, and where there are mistakes, which are noted."""
    sources = [key for key in _SOURCES if key in root.values]
    if len(sources) != 1:
        found = " and ".join(sources) or "none"
        root.mistakes.append((root.key, f"expected exactly one of {', '.join(_SOURCES)}, found {found}"))
    made = None
    for source, cls in (("sine", SineTarget), ("sweep", SweepTarget)):
        if (table := root.table(source)) is not None:
            made = _oscillating(table, cls, rate_hz)
    if "file" in root.values:
        root.mistakes += [(root.path(key), m) for key, m in file_mistakes(root.values, base_dir, _DISPLACEMENT)]
        _check_scaling(root)
    elif sources:
        for key in _OF_FILE:
            if key in root.values:
                root.note(key, "goes with file, which is not given")
    root.close(("file", *_OF_FILE))
    return made if len(sources) == 1 and not root.mistakes else None


def _oscillating(table: Table, cls: type, rate_hz: float | None) -> SineTarget | SweepTarget | None:
    n_mistakes = len(table.mistakes)
    names = [one.name for one in fields(cls) if one.name not in ("duration_s", "law", "ramp_s")]
    values = {name: table.take(name, NUMBER) for name in names}
    values["ramp_s"] = table.take("ramp_s", NUMBER, None)
    if cls is SweepTarget:
        values["law"] = table.take("law", one_of(*_LAWS), "linear")
        values["duration_s"] = table.take("duration_s", NUMBER)
    elif ("duration_s" in table.values) == ("cycles" in table.values):
        found = "found both" if "cycles" in table.values else "found none"
        table.note("duration_s", f"expected it or cycles, {found}")
        table.known += ("duration_s", "cycles")
    elif "cycles" in table.values:
        cycles = table.take("cycles", NUMBER)
        if cycles is not None and cycles <= 0:
            table.note("cycles", f"expected a positive number, found {cycles:g}")
        elif cycles is not None and values["frequency_hz"]:
            values["duration_s"] = cycles / values["frequency_hz"]
        table.known.append("duration_s")
    else:
        values["duration_s"] = table.take("duration_s", NUMBER)
        table.known.append("cycles")
    table.close()
    given = {name: value for name, value in values.items() if value is not None}
    noted = [key for key, _ in table.mistakes[n_mistakes:]]
    table.mistakes += [
        (table.path(name), message) for name, message in _mistakes(given) if table.path(name) not in noted
    ]
    if len(table.mistakes) > n_mistakes:
        return None
    made: SineTarget | SweepTarget = cls(**given)
    for name, message in () if rate_hz is None else rate_mistakes(made, rate_hz):
        table.note(name, message)
    return made


def _check_scaling(root: Table) -> None:
    if "factor" in root.values and "peak_m" in root.values:
        root.note("peak_m", "expected at most one of factor, peak_m, found both")
    factor = root.take("factor", NUMBER, 1.0)
    if factor == 0:
        root.note("factor", "expected a finite number other than zero, found 0")
    for key in ("peak_m", "ramp_s"):
        value = root.take(key, NUMBER, 1.0)
        if value <= 0:
            root.note(key, f"expected a positive number, found {value:g}")
