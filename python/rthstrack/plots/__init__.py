"""Figures fit for a journal, drawn with Matplotlib from an `Assessment`; nothing is computed here.

Every function takes `ax=` (one Axes, or a sequence of them where it needs several) and returns it; without `ax` it
makes a figure of its own, one column wide, reachable as `ax.figure`. No pyplot: nothing global stays changed and no
window opens. Colours are Okabe and Ito's, as on the report's page.
"""

from rthstrack.plots.assessment import (
    plot_error,
    plot_frequency_response,
    plot_indices,
    plot_loop,
    plot_moving,
    plot_spectra,
    plot_time_frequency,
    plot_time_history,
)
from rthstrack.plots.page import figure, write_figure, write_figures
from rthstrack.plots.style import (
    BAND,
    DOUBLE_COLUMN_IN,
    DOUBTFUL,
    ERROR,
    LIMIT,
    MEASURED,
    MUTED,
    SECOND,
    SINGLE_COLUMN_IN,
    TARGET,
    THIRD,
    VALUE,
)
from rthstrack.verdict.display import PANELS

__all__ = [
    "BAND",
    "DOUBLE_COLUMN_IN",
    "DOUBTFUL",
    "ERROR",
    "LIMIT",
    "MEASURED",
    "MUTED",
    "PANELS",
    "SECOND",
    "SINGLE_COLUMN_IN",
    "TARGET",
    "THIRD",
    "VALUE",
    "figure",
    "plot_error",
    "plot_frequency_response",
    "plot_indices",
    "plot_loop",
    "plot_moving",
    "plot_spectra",
    "plot_time_frequency",
    "plot_time_history",
    "write_figure",
    "write_figures",
]
