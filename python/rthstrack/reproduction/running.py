"""The published study in one call: every figure, table and number of Guo, Xu and Chen (2014), beside ours."""

from __future__ import annotations

import dataclasses
import itertools
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from rthstrack.evaluation.response import frequency_slopes
from rthstrack.reproduction import far_field as far_field_set
from rthstrack.reproduction import paper, paper_form
from rthstrack.reproduction.cases import CASES, choose_records, nonlinear, run_case, run_trial, trials
from rthstrack.reproduction.far_field import WINDOWS
from rthstrack.reproduction.results import (
    CHEBYSHEV,
    ESTIMATORS,
    HANN,
    LOWERED,
    SCIPY,
    SPECTRAL,
    TRANSFER,
    TUKEY,
    Results,
)
from rthstrack.studies.grid import study

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rthstrack.reproduction.cases import RecordFile, Trial, UsedRecord
    from rthstrack.reproduction.claims import Claim
    from rthstrack.reproduction.paper_form import Reading, Timing
    from rthstrack.studies.cells import Cell
    from rthstrack.virtual_test.run import Run

_FILTERS = {
    SCIPY: paper_form.second_order_sections,
    LOWERED: paper_form.lowered_order,
    TRANSFER: paper_form.transfer_function,
}

Progress: TypeAlias = Callable[[str, int, int], object]
_Made = TypeVar("_Made")


@dataclass(frozen=True, slots=True, eq=False)
class Reproduction(Results):
    """Everything computed, and every quantitative statement of the paper judged by it."""

    @property
    def claims(self) -> tuple[Claim, ...]:
        """Every quantitative statement of the paper, judged."""
        from rthstrack.reproduction.claims import judge

        return judge(self)


def reproduce(
    out: str | Path | None = None,
    *,
    records: Mapping[str, RecordFile] | None = None,
    progress: Progress | None = None,
) -> Reproduction:
    """Runs the paper's tests, evaluates them as it did, and writes figures, tables and claims to the folder `out`.

    records: files (PEER AT2, or whatever `read_ground_motion` reads) or GroundMotions for CHY101-N, MU2035 and CANOGA;
    where the last two are not given, a named record stands in. out: None writes nothing.
    progress: called with (stage, done, total).
    Needs the extra rthstrack[records] unless all three are given. Raises SettingError, RecordingError.
    """
    begun = time.perf_counter()
    tell = progress or (lambda stage, done, total: None)
    if out is not None:
        from rthstrack.reproduction.writing import prepare

        prepare(Path(out))
    used = choose_records(records or {})
    runs, perfect, tried = _simulate(used, tell)
    studies = {
        decimator: study(runs, windows=("boxcar",), decimator=decimator, progress=_stage(tell, f"{decimator} readings"))
        for decimator in (SPECTRAL, CHEBYSHEV)
    }
    for window in (TUKEY, HANN):
        shape, detrend = WINDOWS[window]
        studies[window] = study(runs, windows=(shape,), detrend=detrend, timing=False)
    paper_readings, decimation = _paper_form(runs, tell)
    components = far_field_set.far_field(_stage(tell, "far-field set"))
    readings: dict[tuple[str, str, int, int], Cell | Reading] = dict(paper_readings)
    for decimator, found in studies.items():
        for cell in found.cells:
            at = (decimator, cell.source, cell.settings.data_decimation, cell.settings.frequency_decimation)
            readings[at] = cell
    chy101 = {key: runs[key] for key in ("linear-chy101-n", "nonlinear-chy101-n")}
    powers = study(chy101, P=(1,), Q=(1,), windows=("boxcar",), weight_powers=(1, 2, 3, 4), timing=False)
    experiment = {key: run for key, run in runs.items() if CASES[key].kind == "experiment"}
    estimators = {
        name: study(experiment, P=(1,), Q=(1,), windows=("boxcar",), estimator=name, timing=False)
        for name in ESTIMATORS
    }
    slopes = {key: frequency_slopes(run.target, run.measured, run.rate_hz) for key, run in experiment.items()}
    result = Reproduction(
        used,
        runs,
        perfect,
        tried,
        studies,
        powers,
        estimators,
        slopes,
        readings,
        decimation,
        components,
        time.perf_counter() - begun,
    )
    if out is not None:
        from rthstrack.reproduction.writing import write

        write(result, Path(out), _stage(tell, "figures and tables"))
    return result


def _simulate(
    used: Mapping[str, UsedRecord], tell: Progress
) -> tuple[dict[str, Run], dict[str, Run], dict[str, Trial]]:
    """The paper's tests, the same without delay and amplitude error, and the trials, on all cores."""
    beside = trials()
    done = itertools.count(1)
    total = 2 * len(CASES) + len(beside)

    def counted(call: Callable[[], _Made]) -> _Made:
        made = call()
        tell("virtual tests", next(done), total)
        return made

    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        runs, perfect = (
            {key: pool.submit(counted, partial(run_case, case, used, as_perfect)) for key, case in CASES.items()}
            for as_perfect in (False, True)
        )
        tried = {
            name: pool.submit(counted, partial(run_trial, test, used[driven_by]))
            for name, (test, driven_by) in beside.items()
        }
        tried["nonlinear, scaled by 0.1"] = pool.submit(partial(run_trial, nonlinear(), used["CHY101-N"], 0.1))
        return (
            {key: future.result() for key, future in runs.items()},
            {key: future.result() for key, future in perfect.items()},
            {name: future.result() for name, future in tried.items()},
        )


def _paper_form(
    runs: Mapping[str, Run], tell: Progress
) -> tuple[dict[tuple[str, str, int, int], Reading], dict[tuple[str, int], Timing]]:
    """The paper's form: all of the paper's P and Q with SciPy's filter, timed, and its P with the two old ones."""

    def call(route: str, key: str, P: int, Q: int) -> Reading:
        run = runs[key]
        return paper_form.evaluate(run.target, run.measured, run.rate_hz, P, Q, _FILTERS[route])

    def decimate(route: str, P: int) -> None:
        run = runs["nonlinear-mu2035"]
        for signal in (run.target, run.measured):
            _FILTERS[route](signal, P)

    jobs = [(SCIPY, key, P, Q) for key in runs for P, Q in _factors()]
    untimed = [(LOWERED, key, P, 1) for key in runs for P in paper.POWERS]
    untimed += [(TRANSFER, "linear-chy101-n", P, 1) for P in paper.POWERS]
    decimations = [(route, P) for route in (SCIPY, LOWERED) for P in paper.POWERS]
    readings = {job: call(*job) for job in jobs + untimed}
    timed = paper_form.measured(
        [partial(call, *job) for job in jobs] + [partial(decimate, *job) for job in decimations],
        _stage(tell, "the paper's form"),
    )
    for job, (time_s, first_s, second_s) in zip(jobs, timed, strict=False):
        readings[job] = dataclasses.replace(
            readings[job], computing_time_s=time_s, first_time_s=first_s, second_time_s=second_s
        )
    return readings, dict(zip(decimations, timed[len(jobs) :], strict=True))


def _factors() -> list[tuple[int, int]]:
    combined = [(P, Q) for P in paper.TABLE_P for Q in paper.TABLE_Q]
    alone = [(P, 1) for P in paper.POWERS] + [(1, Q) for Q in paper.POWERS]
    return list(dict.fromkeys(combined + alone))


def _stage(tell: Progress, name: str) -> Callable[[int, int], object]:
    return lambda done, total: tell(name, done, total)
