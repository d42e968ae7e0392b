"""The published study in one call: every figure, table and number of Guo, Xu and Chen (2014), beside ours."""

from rthstrack.reproduction.results import (
    CHEBYSHEV,
    ESTIMATORS,
    HANN,
    LOWERED,
    ROUTES,
    SCIPY,
    SPECTRAL,
    TRANSFER,
    TUKEY,
)
from rthstrack.reproduction.running import Reproduction, reproduce

__all__ = [
    "CHEBYSHEV",
    "ESTIMATORS",
    "HANN",
    "LOWERED",
    "ROUTES",
    "SCIPY",
    "SPECTRAL",
    "TRANSFER",
    "TUKEY",
    "Reproduction",
    "reproduce",
]
