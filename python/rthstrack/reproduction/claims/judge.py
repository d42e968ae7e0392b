"""All statements, in the paper's order."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rthstrack.reproduction.claims import (
    combined,
    conclusions,
    data_decimation,
    experiment,
    formulation,
    frequency_decimation,
)

if TYPE_CHECKING:
    from rthstrack.reproduction.claims.rows import Claim
    from rthstrack.reproduction.results import Results

_SECTIONS = (
    formulation.introduction,
    formulation.formulation,
    data_decimation.general,
    data_decimation.linear_structure,
    data_decimation.linear_by_p,
    data_decimation.nonlinear_structure,
    data_decimation.nonlinear_by_p,
    experiment.experiment,
    experiment.by_p,
    frequency_decimation.general,
    frequency_decimation.linear_by_q,
    frequency_decimation.nonlinear_by_q,
    experiment.by_q,
    combined.simulations,
    combined.tables,
    experiment.combined,
    conclusions.conclusions,
    conclusions.future_work,
)


def judge(r: Results) -> tuple[Claim, ...]:
    """All statements, in the paper's order."""
    return tuple(claim for section in _SECTIONS for claim in section(r))
