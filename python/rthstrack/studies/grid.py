"""What data decimation P and frequency decimation Q do to amplitude, delay and computing time, over grids of both.

Beside the grid: P and Q chosen by the program, and key frequencies.

The grids of the paper (sections 3 to 5) are the defaults. Signs and units as in `evaluate`: delay > 0 is a lag.
"""

from __future__ import annotations

import csv
import dataclasses
import math
import os
import re
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from rthstrack.errors import RecordingError, SettingError, SignalError
from rthstrack.evaluation.factors import TOLERANCE, choose_factors, key_frequencies
from rthstrack.evaluation.tracking import Evaluator, Settings, Tracking, _count, _number, _Result, _single, evaluate
from rthstrack.recording.recording import propose_pair, read_recording
from rthstrack.verdict.assessment import json_ready
from rthstrack.virtual_test.configuration import read_configuration
from rthstrack.virtual_test.parts import Run, simulate, true_tracking
from rthstrack.virtual_test.run import read_run_test

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from rthstrack.virtual_test.parts import VirtualTest

#: P and Q of the paper's sections 3 and 4, each with the other at 1.
POWERS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512)
#: The largest P and Q that the paper's section 5 combines.
COMBINED = (64, 32)
WINDOWS = ("boxcar", "hann")
WEIGHT_POWERS = (2,)

# The best of so many calls, fewer where they take long in all.
_MOST_CALLS, _LEAST_CALLS, _ENOUGH_S = 20, 3, 0.05

Truth: TypeAlias = tuple[float, float] | Callable[[float], tuple[float, float] | None]


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """One target with its measured, (n_samples,), at rate_hz; checked when made (SignalError, SettingError).

    truth: (amplitude, delay_s), NaN for what is not known; or a function of frequency in Hz that returns them, or None.
    """

    target: NDArray[np.float64] = field(repr=False)
    measured: NDArray[np.float64] = field(repr=False)
    rate_hz: float
    name: str = ""
    truth: Truth | None = None
    target_name: str = "target"
    measured_name: str = "measured"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        target, measured = _single(self.target, self.measured)
        rate_hz = _number("rate_hz", self.rate_hz)
        try:
            evaluate(target, measured, rate_hz)
        except SignalError as error:
            raise SignalError(f"{self.name}: {error}" if self.name else str(error)) from None
        for name, value in (("target", target), ("measured", measured), ("rate_hz", rate_hz)):
            object.__setattr__(self, name, value)


Source: TypeAlias = Pair | Run | str | Path


@dataclass(frozen=True, slots=True)
class StudiedSource:
    """What was studied, without its samples."""

    name: str
    target_name: str
    measured_name: str
    rate_hz: float
    n_samples: int
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Cell:
    """One evaluation of a study; what could not be determined is NaN, and `reason` says why.

    Changes are relative to P = Q = 1 of the same source, window and weight power: value / reference - 1. The truth is
    that at the cell's own equivalent frequency; errors are value / truth - 1, and `delay_error_s` is delay less true
    delay. `highest_frequency_hz` is rate/(2P). `computing_time_s` is the fastest of several calls of a planned
    `Evaluator`, planning left out.

    `kind` is "grid", "chosen" (P and Q of `choose_factors` within `tolerance`, with its bounds) or "key" (the bins that
    `key_frequencies` takes to hold `share` of the weight, evaluated alone; choosing them is not in the time).
    """

    source: str
    settings: Settings
    amplitude: float = math.nan
    phase_rad: float = math.nan
    delay_s: float = math.nan
    equivalent_frequency_hz: float = math.nan
    n_bins: int = 0
    delta_f_hz: float = math.nan
    highest_frequency_hz: float = math.nan
    amplitude_change: float = math.nan
    delay_change: float = math.nan
    true_amplitude: float = math.nan
    true_delay_s: float = math.nan
    amplitude_error: float = math.nan
    delay_error: float = math.nan
    delay_error_s: float = math.nan
    computing_time_s: float = math.nan
    reason: str = ""
    kind: str = "grid"
    tolerance: float = math.nan
    amplitude_bound: float = math.nan
    delay_bound: float = math.nan
    delay_measure: str = ""
    share: float = math.nan


@dataclass(frozen=True, slots=True)
class StudySettings:
    """What a study goes over; the words and defaults are those of `study`."""

    P: tuple[int, ...] | None = None
    Q: tuple[int, ...] | None = None
    combined: tuple[int, int] | None = None
    windows: tuple[str, ...] = WINDOWS
    weight_powers: tuple[int, ...] = WEIGHT_POWERS
    estimator: str = "fei"
    decimator: str = "spectral"
    detrend: str = "none"
    band_hz: tuple[float, float] | None = None
    timing: bool = True
    choose: tuple[str, ...] = ()
    tolerance: float = TOLERANCE
    shares: tuple[float, ...] = ()
    max_delay_s: float = Settings().max_delay_s
    expected_delay_s: float | None = None
    noise: str = "white"
    noise_ratio: float = 0.0
    bad_samples: str = "leave_out"

    def checked(self) -> StudySettings:
        """The same with the defaults filled in; raises SettingError for what is impossible whatever the source."""
        defaults = self.combined is None and self.P is None and self.Q is None
        combined = COMBINED if defaults else _combined(self.combined)
        windows = _several("windows", (self.windows,) if isinstance(self.windows, str) else self.windows)
        powers = tuple(_count("weight_power", power) for power in _several("weight_powers", self.weight_powers))
        base = self._base()._checked()
        _check_band(base.band_hz)
        tolerance = _number("tolerance", self.tolerance)
        if not 0 < tolerance < 1:
            raise SettingError(f"tolerance must be a number between 0 and 1, both excluded, not {tolerance:g}")
        choose, shares = _named_factors(self.choose), _shares(self.shares)
        for what, needed, found in (
            ("spectral decimator", "spectral", base.decimator),
            ("estimator fei", "fei", base.estimator),
        ):
            if (choose or shares) and found != needed:
                raise SettingError(f"P and Q are chosen, and key frequencies taken, for the {what} only, not {found}")
        whole = StudySettings(
            _powers_of_two("P", POWERS if self.P is None else self.P),
            _powers_of_two("Q", POWERS if self.Q is None else self.Q),
            combined,
            windows,
            powers,
            base.estimator,
            base.decimator,
            base.detrend,
            base.band_hz,
            bool(self.timing),
            choose,
            tolerance,
            shares,
            base.max_delay_s,
            base.expected_delay_s,
            base.noise,
            base.noise_ratio,
            base.bad_samples,
        )
        for kind in whole._kinds():
            Evaluator(1024, 1.0, dataclasses.replace(kind, band_hz=None))
        if not whole._grid():
            raise SettingError(
                f"no cell is left: P {_listed(whole.P)} with Q {_listed(whole.Q)}, combined up to {combined}"
            )
        return whole

    def _base(self) -> Settings:
        """What all cells share."""
        return Settings(
            self.estimator,
            decimator=self.decimator,
            detrend=self.detrend,
            band_hz=self.band_hz,
            max_delay_s=self.max_delay_s,
            expected_delay_s=self.expected_delay_s,
            noise=self.noise,
            noise_ratio=self.noise_ratio,
            bad_samples=self.bad_samples,
        )

    def _grid(self) -> list[tuple[int, int]]:
        most_p, most_q = self.combined or (math.inf, math.inf)
        return [(p, q) for p in self.P or () for q in self.Q or () if p == 1 or q == 1 or (p <= most_p and q <= most_q)]

    def _kinds(self) -> list[Settings]:
        """The settings of each window with each weight power, at P = Q = 1."""
        base = self._base()
        return [
            dataclasses.replace(base, window=window, weight_power=power)._checked()
            for window in self.windows
            for power in self.weight_powers
        ]


@dataclass(frozen=True, slots=True, eq=False)
class Study(_Result):
    """The cells of a study, by source, window, weight power, P and Q in this order, and what was asked for.

    After each grid come the factors that were chosen and the key frequencies, where these were asked for.
    """

    sources: tuple[StudiedSource, ...]
    settings: StudySettings
    cells: tuple[Cell, ...] = field(repr=False)

    def select(
        self,
        *,
        source: str | None = None,
        window: str | None = None,
        weight_power: int | None = None,
        P: int | None = None,
        Q: int | None = None,
        kind: str | None = "grid",
    ) -> tuple[Cell, ...]:
        """The cells with these settings, in the study's order; None takes all.

        kind: "grid", "chosen" (P and Q chosen by the program) or "key" (key frequencies).
        """
        wanted = (source, window, weight_power, P, Q)
        return tuple(
            cell
            for cell in self.cells
            if kind in (None, cell.kind)
            and all(w is None or w == found for w, found in zip(wanted, _key(cell.source, cell.settings), strict=True))
        )

    def cell(
        self,
        *,
        P: int = 1,
        Q: int = 1,
        window: str | None = None,
        weight_power: int | None = None,
        source: str | None = None,
    ) -> Cell:
        """The one cell of the grid with these settings; source, window, weight power may be left out if there is one.

        Raises SettingError where there is none, or more than one.
        """
        found = self.select(source=source, window=window, weight_power=weight_power, P=P, Q=Q)
        if len(found) == 1:
            return found[0]
        s = self.settings
        asked = {"source": source, "window": window, "weight_power": weight_power, "P": P, "Q": Q}
        named = ", ".join(f"{name} {value!r}" for name, value in asked.items() if value is not None)
        if found:
            there = {"source": self.source_names, "window": s.windows, "weight_power": s.weight_powers}
            more = ", ".join(name for name, values in there.items() if asked[name] is None and len(values) > 1)
            raise SettingError(f"{len(found)} cells have {named}; name also the {more}")
        raise SettingError(
            f"no cell has {named}; the study holds the sources {_listed(self.source_names)}, windows "
            f"{_listed(s.windows)}, weight powers {_listed(s.weight_powers)}, P {_listed(s.P)}, Q {_listed(s.Q)}"
            + (f", combined up to {s.combined}" if s.combined else "")
        )

    @property
    def source_names(self) -> tuple[str, ...]:
        """The names of the sources."""
        return tuple(source.name for source in self.sources)

    def rows(self) -> list[dict[str, Any]]:
        """A dict a cell with every setting in it: the rows of the CSV file and of `to_frame`."""
        about = {source.name: source for source in self.sources}
        return [_row(about[cell.source], cell) for cell in self.cells]

    def to_csv(self, path: str | Path) -> None:
        """Writes a row a cell, with every setting in it; what is NaN stays empty. Raises RecordingError."""
        rows = [{key: json_ready(value) for key, value in row.items()} for row in self.rows()]
        try:
            with open(path, "w", newline="", encoding="utf-8") as out:
                writer = csv.DictWriter(out, list(rows[0]), restval="")
                writer.writeheader()
                writer.writerows(rows)
        except OSError as error:
            raise RecordingError(f"cannot write {path}: {error.strerror}") from None

    def _columns(self) -> dict[str, Any]:
        rows = self.rows()
        return {name: [row[name] for row in rows] for name in rows[0]}


def study(
    sources: Source | Sequence[Source] | Mapping[str, Source],
    *,
    P: Iterable[int] | None = None,
    Q: Iterable[int] | None = None,
    combined: tuple[int, int] | None = None,
    windows: Iterable[str] = WINDOWS,
    weight_powers: Iterable[int] = WEIGHT_POWERS,
    estimator: str = "fei",
    decimator: str = "spectral",
    detrend: str = "none",
    band_hz: tuple[float, float] | None = None,
    truth: Truth | None = None,
    timing: bool = True,
    choose: Iterable[str] = (),
    tolerance: float = TOLERANCE,
    shares: Iterable[float] = (),
    max_delay_s: float = Settings().max_delay_s,
    expected_delay_s: float | None = None,
    noise: str = "white",
    noise_ratio: float = 0.0,
    bad_samples: str = "leave_out",
    progress: Callable[[int, int], object] | None = None,
) -> Study:
    """Amplitude, delay, their change and error, and computing time over grids of P and Q, windows and weight powers.

    sources: a `Pair` of arrays, a `Run`, a recorded test or a configuration (.toml, simulated first) by its path;
    several of them, or {name: source}. A source with several actuators is studied one actuator at a time.
    P, Q: powers of two; every P with every Q, but both above 1 only up to `combined` (P, Q). With neither given: the
    paper's, each alone from 1 to 512 and combined up to (64, 32). combined: None for all where P or Q are given.
    truth: as in `Pair`, in place of what the sources say themselves (a `Run` knows its own).
    choose: "P", "Q" or both: also the largest factors within `tolerance` (`choose_factors`); one alone: the other at 1.
    shares: also the key frequencies that hold these shares of the weight, by `key_frequencies`.
    Other settings as in `evaluate`.
    timing: also time every cell, one after another when all numbers are there. progress: called with (done, total).

    A cell that leaves nothing to judge by is NaN, with a reason. Raises SettingError, SignalError, RecordingError.
    """
    settings = StudySettings(
        P,  # type: ignore[arg-type]
        Q,  # type: ignore[arg-type]
        combined,
        windows,  # type: ignore[arg-type]
        weight_powers,  # type: ignore[arg-type]
        estimator,
        decimator,
        detrend,
        band_hz,
        timing,
        choose,  # type: ignore[arg-type]
        tolerance,
        shares,  # type: ignore[arg-type]
        max_delay_s,
        expected_delay_s,
        noise,
        noise_ratio,
        bad_samples,
    ).checked()
    pairs = _pairs(sources, truth)
    grid, kinds = settings._grid(), settings._kinds()
    extras = [("chosen", math.nan)] * bool(settings.choose) + [("key", share) for share in settings.shares]
    # The changes need P = Q = 1 where the grid lacks it. Pairs of one length share a plan: they follow each other.
    each = dict.fromkeys(one for kind in kinds for one in (kind, *(_at(kind, p, q) for p, q in grid)))
    wanted = {_key(pair.name, one): (pair, one) for one in each for pair in pairs}
    beside = [(pair, kind, *extra) for kind in kinds for extra in extras for pair in pairs]
    n_cells = len(pairs) * len(kinds) * (len(grid) + len(extras))
    steps = _Steps(progress, len(wanted) + len(beside) + timing * n_cells)
    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        found = {}
        for key, result in zip(wanted, pool.map(lambda one: _evaluated(*one), wanted.values()), strict=True):
            found[key] = result
            steps.done()

        def cell_beside(pair: Pair, kind: Settings, what: str, share: float) -> Cell:
            reference = found[_key(pair.name, kind)]
            if what == "key":
                return _key_cell(pair, kind, share, reference)
            return _chosen_cell(pair, kind, settings.choose, settings.tolerance, reference)

        others = {}
        for one, cell in zip(beside, pool.map(lambda one: cell_beside(*one), beside), strict=True):
            others[one[0].name, *one[1:]] = cell
            steps.done()
    cells = []
    for pair in pairs:
        for kind in kinds:
            reference = found[_key(pair.name, kind)]
            for at in (_at(kind, p, q) for p, q in grid):
                cells.append(_cell(pair, at, found[_key(pair.name, at)], reference))
            cells += [others[pair.name, kind, *extra] for extra in extras]
    if timing:
        per_pair = n_cells // len(pairs)
        for i in sorted(range(n_cells), key=lambda i: i % per_pair):
            if not cells[i].reason:
                cells[i] = dataclasses.replace(
                    cells[i], computing_time_s=_computing_time_s(pairs[i // per_pair], cells[i])
                )
            steps.done()
    studied = (StudiedSource(p.name, p.target_name, p.measured_name, p.rate_hz, p.target.size, p.notes) for p in pairs)
    return Study(tuple(studied), settings, tuple(cells))


# ------------------------------------------------------------------------------------------------------------- sources


def read_pairs(
    path: str | Path,
    *,
    targets: Sequence[str] = (),
    measured: Sequence[str] = (),
    rate_hz: float | None = None,
    time: str | None = None,
    resample_hz: float | None = None,
    scale: Mapping[str, float] | None = None,
    fill: int | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
) -> list[Pair]:
    """The pairs of a recorded test, or of a configuration (.toml), which is simulated: one an actuator.

    Without targets and measured a likely pair is proposed, and noted. The other arguments are those of `read_recording`
    and of `Recording`; they do not apply to a configuration.
    Raises RecordingError, ChannelError, SignalError, SettingError.
    """
    file = os.fspath(path)
    if file.lower().endswith(".toml"):
        return _pairs_of_run(_simulated(file), file)
    recording = read_recording(file, rate_hz=rate_hz, time=time, resample_hz=resample_hz)
    sampled_hz = recording.rate_hz
    if sampled_hz is None:
        raise RecordingError(f"{file}: no sampling rate: {recording.rate_source}; give --rate HZ or --time CHANNEL")
    if targets or measured:
        if len(targets) != len(measured):
            raise SettingError(f"one measured for each target is needed, found {len(measured)} for {len(targets)}")
        channels, proposal = list(zip(targets, measured, strict=True)), None
    else:
        channels, proposal = propose_pair(recording)
    if fill:
        recording = recording.filled(fill)
    recording = recording.scaled(scale or {})
    if start_s is not None or end_s is not None:
        recording = recording.cut(start_s, end_s)
    found = []
    for actuator, (asked, answered) in enumerate(channels):
        t, m = recording.channel(asked), recording.channel(answered)
        truth = None if scale else _truth_in_file(file, t.name, m.name)
        notes = list(recording.notes)
        if proposal and truth is None:
            notes.insert(0, f"no channels were named: studied target '{t.name}', measured '{m.name}' ({proposal})")
        if t.unit and m.unit and t.unit != m.unit:
            notes.append(f"target is in {t.unit}, measured in {m.unit}: the amplitude holds the ratio of the units")
        name = _named(file, actuator, len(channels))
        found.append(Pair(t.values, m.values, sampled_hz, name, truth, t.name, m.name, tuple(notes)))
    return found


def _pairs(sources: Source | Sequence[Source] | Mapping[str, Source], truth: Truth | None) -> list[Pair]:
    """Every source as pairs, each with a name of its own."""
    if isinstance(sources, Mapping):
        listed = list(sources.items())
    elif isinstance(sources, Pair | Run | str | Path):
        listed = [("", sources)]
    else:
        listed = [("", source) for source in sources]
    if not listed:
        raise SettingError("there is no source to study: give a Pair, a Run or a file")

    def read(name: str, source: Source) -> list[Pair]:
        if isinstance(source, Pair):
            pairs = [source if source.name else dataclasses.replace(source, name="test")]
        elif isinstance(source, Run):
            pairs = _pairs_of_run(source, source.motion_name)
        elif isinstance(source, str | Path):
            pairs = read_pairs(source)
        else:
            raise SettingError(f"a source must be a Pair, a Run or a file, not {type(source).__name__}")
        if name:
            pairs = [dataclasses.replace(p, name=_named(name, i, len(pairs))) for i, p in enumerate(pairs)]
        return pairs if truth is None else [dataclasses.replace(p, truth=truth) for p in pairs]

    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        pairs = [pair for found in pool.map(read, *zip(*listed, strict=True)) for pair in found]
    names = [pair.name for pair in pairs]
    for name in names:
        if names.count(name) > 1:
            raise SettingError(
                f"{names.count(name)} sources are called '{name}'; give {{name: source}} with other names"
            )
    return pairs


def _named(name: str, actuator: int, n_actuators: int) -> str:
    return name if n_actuators == 1 else f"{name}, actuator {actuator}"


def _pairs_of_run(run: Run, name: str) -> list[Pair]:
    targets, measured = (signal.reshape(len(signal), -1) for signal in (run.target, run.measured))
    n = targets.shape[1]
    return [
        Pair(
            targets[:, i],
            measured[:, i],
            run.rate_hz,
            _named(name, i, n),
            _truth_of(run.test, i),
            notes=run.motion_notes,
        )
        for i in range(n)
    ]


def _truth_of(test: VirtualTest, actuator: int) -> Truth:
    def truth(frequency_hz: float) -> tuple[float, float] | None:
        found = true_tracking(test, frequency_hz, actuator)
        return None if found is None else (found[0].item(), found[1].item())

    return truth


def _truth_in_file(file: str, target: str, measured: str) -> Truth | None:
    """What a virtual test left in its run file, for target and measured of one actuator; None for any other pair."""
    names = [re.fullmatch(rf"{role}(?:_(\d+))?", name) for role, name in (("target", target), ("measured", measured))]
    if not all(names) or len({name and name[1] for name in names}) != 1:
        return None
    test = read_run_test(file)
    number = int((names[0] and names[0][1]) or 1)
    return None if test is None or number > len(test.actuators) else _truth_of(test, number - 1)


def _simulated(file: str) -> Run:
    configuration = read_configuration(file)
    return simulate(
        configuration.test, configuration.motion_from(Path(file).parent), duration_s=configuration.duration_s
    )


# ---------------------------------------------------------------------------------------------------------- the numbers


class _Steps:
    """Counts what is done, for whoever watches."""

    def __init__(self, watcher: Callable[[int, int], object] | None, total: int) -> None:
        self._watcher, self._total, self._done = watcher, total, 0

    def done(self) -> None:
        self._done += 1
        if self._watcher is not None:
            self._watcher(self._done, self._total)


def _evaluated(pair: Pair, settings: Settings) -> Tracking | str:
    """The result, or why there is none."""
    try:
        found = Evaluator(pair.target.size, pair.rate_hz, settings).evaluate(pair.target, pair.measured)
    except (SettingError, SignalError) as error:
        return str(error)
    undetermined = math.isnan(float(found.delay_s)) and found.reason
    return str(found.reason).removeprefix("not determined: ") if undetermined else found


def _cell(pair: Pair, settings: Settings, found: Tracking | str, reference: Tracking | str) -> Cell:
    highest_hz = pair.rate_hz / (2 * settings.data_decimation)
    if isinstance(found, str):
        return Cell(pair.name, settings, highest_frequency_hz=highest_hz, reason=found)
    amplitude, delay_s = float(found.amplitude), float(found.delay_s)
    frequency_hz = float(found.equivalent_frequency_hz)
    known = pair.truth(frequency_hz) if callable(pair.truth) else pair.truth
    true_amplitude, true_delay_s = (math.nan, math.nan) if known is None else map(float, known)
    first = (math.nan, math.nan)
    if isinstance(reference, Tracking):
        first = (float(reference.amplitude), float(reference.delay_s))
    return Cell(
        pair.name,
        settings,
        amplitude,
        float(found.phase_rad),
        delay_s,
        frequency_hz,
        found.n_bins,
        found.delta_f_hz,
        highest_hz,
        _relative(amplitude, first[0]),
        _relative(delay_s, first[1]),
        true_amplitude,
        true_delay_s,
        _relative(amplitude, true_amplitude),
        _relative(delay_s, true_delay_s),
        delay_s - true_delay_s,
    )


def _chosen_cell(
    pair: Pair, kind: Settings, choose: tuple[str, ...], tolerance: float, reference: Tracking | str
) -> Cell:
    """The cell of the factors that `choose_factors` takes, with its bounds."""
    rest = _without_factors(kind)
    given: dict[str, Any] = {
        "data_decimation": None if "P" in choose else 1,
        "frequency_decimation": None if "Q" in choose else 1,
    }
    try:
        factors = choose_factors(pair.target, pair.measured, pair.rate_hz, tolerance=tolerance, **given, **rest)
    except (SettingError, SignalError) as error:
        return dataclasses.replace(_cell(pair, kind, str(error), reference), kind="chosen", tolerance=tolerance)
    return dataclasses.replace(
        _cell(pair, factors.settings, _evaluated(pair, factors.settings), reference),
        kind="chosen",
        tolerance=tolerance,
        amplitude_bound=factors.amplitude_bound,
        delay_bound=factors.delay_bound,
        delay_measure=factors.delay_measure,
    )


def _key_cell(pair: Pair, kind: Settings, share: float, reference: Tracking | str) -> Cell:
    """The cell of the key frequencies of this pair's own target."""
    try:
        key = key_frequencies(pair.target, pair.rate_hz, share, **_without_factors(kind))
        cell = _cell(pair, kind, key.evaluate(pair.target, pair.measured), reference)
    except (SettingError, SignalError) as error:
        return dataclasses.replace(_cell(pair, kind, str(error), reference), kind="key", share=share)
    return dataclasses.replace(cell, kind="key", share=share, highest_frequency_hz=float(key.frequency_hz[-1]))


def _without_factors(settings: Settings) -> dict[str, Any]:
    rest = dataclasses.asdict(settings)
    del rest["data_decimation"], rest["frequency_decimation"]
    return rest


def _at(kind: Settings, p: int, q: int) -> Settings:
    return dataclasses.replace(kind, data_decimation=p, frequency_decimation=q)


def _relative(value: float, reference: float) -> float:
    return value / reference - 1 if reference else math.nan


def _computing_time_s(pair: Pair, cell: Cell) -> float:
    """The fastest of several calls: whatever else the machine does can only slow a call down."""
    if cell.kind == "key":
        plan: Any = key_frequencies(pair.target, pair.rate_hz, cell.share, **_without_factors(cell.settings))
    else:
        plan = Evaluator(pair.target.size, pair.rate_hz, cell.settings)
    best, spent, calls = math.inf, 0.0, 0
    while calls < _LEAST_CALLS or (calls < _MOST_CALLS and spent < _ENOUGH_S):
        start = time.perf_counter()
        plan.evaluate(pair.target, pair.measured)
        seconds = time.perf_counter() - start
        best, spent, calls = min(best, seconds), spent + seconds, calls + 1
    return best


def _key(source: str, settings: Settings) -> tuple[str, str, int, int, int]:
    return (
        source,
        settings.window,
        settings.weight_power,
        settings.data_decimation,
        settings.frequency_decimation,
    )


def _row(source: StudiedSource, cell: Cell) -> dict[str, Any]:
    settings = dataclasses.asdict(cell.settings)
    low_hz, high_hz = settings.pop("band_hz") or (math.nan, math.nan)
    about = {f.name: getattr(source, f.name) for f in dataclasses.fields(source) if f.name not in ("name", "notes")}
    numbers = {f.name: getattr(cell, f.name) for f in dataclasses.fields(cell) if f.name not in ("source", "settings")}
    return {"source": source.name} | about | settings | {"band_low_hz": low_hz, "band_high_hz": high_hz} | numbers


# ------------------------------------------------------------------------------------------------------ what was asked


def _several(name: str, values: Iterable[Any]) -> tuple[Any, ...]:
    """The values, at least one and none twice."""
    try:
        listed = tuple(values)
    except TypeError:
        raise SettingError(f"{name} must be a list of values, found {values!r}") from None
    if not listed:
        raise SettingError(f"{name} is empty: give at least one value")
    for value in listed:
        if listed.count(value) > 1:
            raise SettingError(f"{name} holds {value!r} twice: give every value once")
    return listed


def _powers_of_two(name: str, values: Iterable[Any]) -> tuple[int, ...]:
    numbers = []
    for value in _several(name, values):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1 or value & (value - 1):
            raise SettingError(f"{name} must hold powers of two (1, 2, 4, ...), found {value!r}")
        numbers.append(_count(name, value))
    return tuple(sorted(numbers))


def _combined(limits: Any) -> tuple[int, int] | None:
    if limits is None:
        return None
    try:
        most_p, most_q = limits
    except (TypeError, ValueError):
        raise SettingError(
            f"combined must be the largest P and Q taken together, two numbers, not {limits!r}"
        ) from None
    return _count("combined P", most_p), _count("combined Q", most_q)


def _named_factors(choose: Any) -> tuple[str, ...]:
    names = tuple(choose)
    for name in names:
        if name not in ("P", "Q"):
            raise SettingError(f"choose takes P and Q, found {name!r}")
    return tuple(sorted(set(names)))


def _shares(shares: Any) -> tuple[float, ...]:
    numbers = tuple(_number("share", share) for share in shares)
    for share in numbers:
        if not 0 < share <= 1:
            raise SettingError(f"share must be above 0 and at most 1, not {share:g}")
        if numbers.count(share) > 1:
            raise SettingError(f"shares hold {share:g} twice: give every value once")
    return numbers


def _check_band(band_hz: tuple[float, float] | None) -> None:
    """An impossible band is misuse; one that merely leaves no bin is a result."""
    if band_hz is not None and not 0 <= band_hz[0] <= band_hz[1] < math.inf:
        raise SettingError(f"band_hz must be 0 <= low <= high in Hz, found {band_hz[0]:g} to {band_hz[1]:g}")


def _listed(values: Iterable[object] | None) -> str:
    return ", ".join(map(str, values or ()))
