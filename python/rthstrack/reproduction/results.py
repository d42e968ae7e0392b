"""Everything that the study computed, for figures, tables and claims."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rthstrack.reproduction.cases import CASES

if TYPE_CHECKING:
    from rthstrack.evaluation.response import FrequencySlopes
    from rthstrack.reproduction.cases import Trial, UsedRecord
    from rthstrack.reproduction.far_field import Component
    from rthstrack.reproduction.paper_form import Reading, Timing
    from rthstrack.studies.cells import Cell, Study
    from rthstrack.virtual_test.run import Run

#: How a reading was made: ours by bins or by the published filter, or the paper's form in SciPy with one of 3 filters;
#: all these without a window. Ours by bins with a window and the mean removed is called after the window.
SPECTRAL, CHEBYSHEV, SCIPY, LOWERED, TRANSFER = "spectral", "chebyshev", "scipy", "lowered order", "transfer function"
TUKEY, HANN = "tukey", "hann"
#: The route of each of `far_field.WINDOWS`.
ROUTES = {"none": SPECTRAL, "tukey": TUKEY, "hann": HANN}

#: Estimators that judge the experiment, the published one first; another of `Settings.estimator` joins here.
ESTIMATORS = ("fei", "aligned", "least_squares")


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """Everything computed: tests, readings and times. Figures, tables and claims are made from it.

    runs, perfect: by case (`cases.CASES`), as the paper ran it, and with gain 1 and no delay. trials: tests beside the
    paper's. studies: ours, by decimator. weight_powers: CHY101-N at P = Q = 1 with l = 1 to 4. estimators: the
    experiment at P = Q = 1 by each of `ESTIMATORS`; slopes: its `frequency_slopes`. readings: of all routes, by (route,
    case, P, Q). decimation: time that decimating both signals takes, by (filter, P), in the nonlinear case of MU2035.
    far_field: the same tests under 44 components, empty without the extra `records`. seconds: what all this took.
    """

    records: dict[str, UsedRecord]
    runs: dict[str, Run]
    perfect: dict[str, Run]
    trials: dict[str, Trial]
    studies: dict[str, Study]
    weight_powers: Study
    estimators: dict[str, Study]
    slopes: dict[str, FrequencySlopes]
    readings: dict[tuple[str, str, int, int], Cell | Reading]
    decimation: dict[tuple[str, int], Timing]
    far_field: tuple[Component, ...]
    seconds: float

    def cell(self, route: str, case: str, P: int = 1, Q: int = 1) -> Cell | Reading:
        """The reading of a case by one route."""
        return self.readings[route, case, P, Q]

    def remark(self, case: str) -> str:
        """What stands in for the case's record; empty where nothing does."""
        return self.records[CASES[case].record].remark
