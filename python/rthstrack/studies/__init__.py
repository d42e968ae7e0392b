"""Grids of P and Q, windows and weights over recordings and virtual tests."""

from rthstrack.studies.cells import Cell, StudiedSource, Study
from rthstrack.studies.grid import study
from rthstrack.studies.pairs import Pair, Source, Truth, read_pairs
from rthstrack.studies.settings import COMBINED, POWERS, WEIGHT_POWERS, WINDOWS, StudySettings

__all__ = [
    "COMBINED",
    "POWERS",
    "WEIGHT_POWERS",
    "WINDOWS",
    "Cell",
    "Pair",
    "Source",
    "StudiedSource",
    "Study",
    "StudySettings",
    "Truth",
    "read_pairs",
    "study",
]
