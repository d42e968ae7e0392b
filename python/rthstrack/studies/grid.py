"""What data decimation P and frequency decimation Q do to amplitude, delay and computing time, over grids of both.

Beside the grid: P and Q chosen by the program, and key frequencies.

The grids of the paper (sections 3 to 5) are the defaults. Signs and units as in `evaluate`: delay > 0 is a lag.
"""

from __future__ import annotations

import dataclasses
import math
import os
import time
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Unpack

from rthstrack.errors import SettingError, SignalError
from rthstrack.evaluation.factors import choose_factors, key_frequencies
from rthstrack.evaluation.inputs import merged
from rthstrack.evaluation.tracking import Evaluator, Tracking
from rthstrack.said import Said, failed, of_core
from rthstrack.studies.cells import Cell, StudiedSource, Study, _key
from rthstrack.studies.pairs import pairs_of
from rthstrack.studies.settings import StudySettings

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rthstrack.evaluation.settings import Settings
    from rthstrack.studies.pairs import Pair, Source, Truth
    from rthstrack.studies.settings import StudyKeywords

# The best of so many calls, fewer where they take long in all.
_MOST_CALLS, _LEAST_CALLS, _ENOUGH_S = 20, 3, 0.05


def study(
    sources: Source | Sequence[Source] | Mapping[str, Source],
    settings: StudySettings | None = None,
    *,
    truth: Truth | None = None,
    progress: Callable[[int, int], object] | None = None,
    **changes: Unpack[StudyKeywords],
) -> Study:
    """Amplitude, delay, their change and error, and computing time over grids of P and Q, windows and weight powers.

    sources: a `Pair` of arrays, a `Run`, a recorded test or a configuration (.toml, simulated first) by its path;
    several of them, or {name: source}. A source with several actuators is studied one actuator at a time.
    P, Q: powers of two; every P with every Q, but both above 1 only up to `combined` (P, Q). With neither given: the
    paper's, each alone from 1 to 512 and combined up to (64, 32). combined: None for all where P or Q are given.
    truth: as in `Pair`, in place of what the sources say themselves (a `Run` knows its own).
    choose: "P", "Q" or both: also the largest factors within `tolerance` (`choose_factors`); one alone: the other at 1.
    shares: also the key frequencies that hold these shares of the weight, by `key_frequencies`.
    Other settings as in `evaluate`; `StudySettings` in place of keywords.
    timing: also time every cell, one after another when all numbers are there. progress: called with (done, total).

    A cell that leaves nothing to judge by is NaN, with a reason. Raises SettingError, SignalError, RecordingError.
    """
    settings = merged(StudySettings, settings, changes).checked()
    pairs = pairs_of(sources, truth)
    grid, kinds = settings._grid(), settings._kinds()
    extras = [("chosen", math.nan)] * bool(settings.choose) + [("key", share) for share in settings.shares]
    # The changes need P = Q = 1 where the grid lacks it. Pairs of one length share a plan: they follow each other.
    each = dict.fromkeys(one for kind in kinds for one in (kind, *(_at(kind, p, q) for p, q in grid)))
    wanted = {_key(pair.name, one): (pair, one) for one in each for pair in pairs}
    beside = [(pair, kind, *extra) for kind in kinds for extra in extras for pair in pairs]
    n_cells = len(pairs) * len(kinds) * (len(grid) + len(extras))
    steps = _Steps(progress, len(wanted) + len(beside) + settings.timing * n_cells)
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
    if settings.timing:
        per_pair = n_cells // len(pairs)
        for i in sorted(range(n_cells), key=lambda i: i % per_pair):
            if not cells[i].reason:
                cells[i] = dataclasses.replace(
                    cells[i], computing_time_s=_computing_time_s(pairs[i // per_pair], cells[i])
                )
            steps.done()
    studied = (StudiedSource(p.name, p.target_name, p.measured_name, p.rate_hz, p.target.size, p.notes) for p in pairs)
    return Study(tuple(studied), settings, tuple(cells))


class _Steps:
    """Counts what is done, for whoever watches."""

    def __init__(self, watcher: Callable[[int, int], object] | None, total: int) -> None:
        self._watcher, self._total, self._done = watcher, total, 0

    def done(self) -> None:
        self._done += 1
        if self._watcher is not None:
            self._watcher(self._done, self._total)


def _evaluated(pair: Pair, settings: Settings) -> Tracking | Said:
    """The result, or why there is none."""
    try:
        found = Evaluator(pair.target.size, pair.rate_hz, settings).evaluate(pair.target, pair.measured)
    except (SettingError, SignalError) as error:
        return failed(error)
    undetermined = math.isnan(float(found.delay_s)) and found.reason
    values: Any = found.reason_values
    return of_core(str(found.reason), str(found.reason_code), values) if undetermined else found


def _cell(pair: Pair, settings: Settings, found: Tracking | Said, reference: Tracking | Said) -> Cell:
    highest_hz = pair.rate_hz / (2 * settings.data_decimation)
    if isinstance(found, Said):
        return Cell(pair.name, settings, highest_frequency_hz=highest_hz, reason=found.cause, reason_code=found.code)
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
    pair: Pair, kind: Settings, choose: tuple[str, ...], tolerance: float, reference: Tracking | Said
) -> Cell:
    """The cell of the factors that `choose_factors` takes, with its bounds."""
    given: dict[str, Any] = {
        "data_decimation": None if "P" in choose else 1,
        "frequency_decimation": None if "Q" in choose else 1,
    }
    try:
        factors = choose_factors(pair.target, pair.measured, pair.rate_hz, tolerance=tolerance, settings=kind, **given)
    except (SettingError, SignalError) as error:
        return dataclasses.replace(_cell(pair, kind, failed(error), reference), kind="chosen", tolerance=tolerance)
    return dataclasses.replace(
        _cell(pair, factors.settings, _evaluated(pair, factors.settings), reference),
        kind="chosen",
        tolerance=tolerance,
        amplitude_bound=factors.amplitude_bound,
        delay_bound=factors.delay_bound,
        delay_measure=factors.delay_measure,
    )


def _key_cell(pair: Pair, kind: Settings, share: float, reference: Tracking | Said) -> Cell:
    """The cell of the key frequencies of this pair's own target."""
    try:
        key = key_frequencies(pair.target, pair.rate_hz, share, kind)
        cell = _cell(pair, kind, key.evaluate(pair.target, pair.measured), reference)
    except (SettingError, SignalError) as error:
        return dataclasses.replace(_cell(pair, kind, failed(error), reference), kind="key", share=share)
    return dataclasses.replace(cell, kind="key", share=share, highest_frequency_hz=float(key.frequency_hz[-1]))


def _at(kind: Settings, p: int, q: int) -> Settings:
    return dataclasses.replace(kind, data_decimation=p, frequency_decimation=q)


def _relative(value: float, reference: float) -> float:
    return value / reference - 1 if reference else math.nan


def _computing_time_s(pair: Pair, cell: Cell) -> float:
    """The fastest of several calls: whatever else the machine does can only slow a call down."""
    if cell.kind == "key":
        plan: Any = key_frequencies(pair.target, pair.rate_hz, cell.share, cell.settings)
    else:
        plan = Evaluator(pair.target.size, pair.rate_hz, cell.settings)
    best, spent, calls = math.inf, 0.0, 0
    while calls < _LEAST_CALLS or (calls < _MOST_CALLS and spent < _ENOUGH_S):
        start = time.perf_counter()
        plan.evaluate(pair.target, pair.measured)
        seconds = time.perf_counter() - start
        best, spent, calls = min(best, seconds), spent + seconds, calls + 1
    return best
