"""Grids of P and Q, windows and weights over recordings and virtual tests."""

from rthstrack.studies.grid import (
    COMBINED,
    POWERS,
    WEIGHT_POWERS,
    WINDOWS,
    Cell,
    Pair,
    Source,
    StudiedSource,
    Study,
    StudySettings,
    Truth,
    read_pairs,
    study,
)

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
