"""The indices in use: errors, tracking indicator, energy error, J1 to J3."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack._core import index_histories as core_index_histories
from rthstrack._core import indices as core_indices
from rthstrack.evaluation.inputs import _number, _samples, _single
from rthstrack.evaluation.results import _Result

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def _time_s(n_samples: int, rate_hz: float) -> NDArray[np.float64]:
    return np.arange(n_samples) / rate_hz


@dataclass(frozen=True, slots=True, repr=False)
class Indices(_Result):
    """The time-domain indices in use beside the FEI (method section 9). Lag makes `tracking_indicator` positive.

    `energy_error` is None unless the measured force was given.
    """

    max_tracking_error: float
    max_tracking_error_percent: float
    rms_error: float
    rms_error_percent: float
    tracking_indicator: float
    j1_s: float
    j2_percent: float
    j3_percent: float
    energy_error: float | None = None

    def _columns(self) -> dict[str, Any]:
        return {f.name: [getattr(self, f.name)] for f in dataclasses.fields(self)}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class IndexHistories(_Result):
    """Those indices that are histories, at every sample: arrays (n_samples,)."""

    max_tracking_error: NDArray[np.float64]
    rms_error: NDArray[np.float64]
    tracking_indicator: NDArray[np.float64]
    energy_error: NDArray[np.float64] | None
    rate_hz: float

    def _columns(self) -> dict[str, Any]:
        names = ("max_tracking_error", "rms_error", "tracking_indicator", "energy_error")
        columns = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        return {"time_s": _time_s(self.rms_error.size, self.rate_hz)} | columns


def indices(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    *,
    force: ArrayLike | None = None,
    max_lag_s: float = 0.5,
) -> Indices:
    """The time-domain indices of the whole record: MTE, RMS, TI, J1, J2, J3 and, with the force, the energy error.

    MTE = max|O-I|; RMS = sqrt(mean (O-I)^2); TI = (A - TA)/2, see `index_histories`; J1 = lag of the highest Pearson
    correlation, searched within +-max_lag_s and half the record (the RTHS benchmark searches 0 to 49 samples);
    J2 = 100 std(O-I)/std(I); J3 = 100 max|O-I|/max|I|. Percentages of MTE and RMS are over max|I| and rms I.

    One pair, (n_samples,); force likewise, in newton for an energy in unit times newton.
    Lag makes TI and J1 positive. Raises SignalError, SettingError.
    """
    t, m = _single(target, measured)
    f = None if force is None else _samples("force", force)
    found: Any = core_indices(t, m, _number("rate_hz", rate_hz), f, _number("max_lag_s", max_lag_s))
    return Indices(**found)


def index_histories(
    target: ArrayLike, measured: ArrayLike, rate_hz: float, *, force: ArrayLike | None = None
) -> IndexHistories:
    """The running indices, at every sample: MTE and RMS so far, tracking indicator, energy error.

    TI = (A - TA)/2 with A_{i+1} = A_i + (I_{i+1}+I_i)(O_{i+1}-O_i)/2 and TA the same with I and O exchanged (Mercan
    2007); energy error = sum (F_{i+1}+F_i)/2 ((O-I)_{i+1} - (O-I)_i).

    One pair, (n_samples,). Lag makes TI rise. Raises SignalError.
    """
    t, m = _single(target, measured)
    rate_hz = _number("rate_hz", rate_hz)
    f = None if force is None else _samples("force", force)
    return IndexHistories(**core_index_histories(t, m, rate_hz, f), rate_hz=rate_hz)
