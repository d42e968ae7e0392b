"""A motion as the cases of the field have it, at any instant: eight sines under an envelope, and what follows it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

GAIN, DELAY_S = 0.97, 0.012
_FREQUENCY = np.array([0.35, 0.6, 0.9, 1.3, 1.9, 2.6, 3.5, 4.6])
_PHASE = np.array([0.5, 1.4, 5.0, 3.6, 0.6, 2.7, 2.9, 4.4])


def target(time_s: Floats) -> Floats:
    """The target at these times, in mm."""
    waves = np.sin(2 * np.pi * _FREQUENCY[:, None] * time_s + _PHASE[:, None]) / (1 + _FREQUENCY[:, None])
    return 10.0 * waves.sum(axis=0) * np.exp(-(((time_s - 3) / 2) ** 2))


def measured(time_s: Floats, delay_s: float = DELAY_S, gain: float = GAIN) -> Floats:
    """What follows it, late and a little too small."""
    return gain * target(time_s - delay_s)


def table(
    path: Path, head: Sequence[str] | None, columns: Sequence[Floats | Sequence[str]], layout: str = "%.9g"
) -> Path:
    """Columns as comma-separated text; the shorter ones end in blanks."""
    lines = [",".join(head)] if head else []
    for i in range(max(map(len, columns))):
        cells = [(c[i] if isinstance(c[i], str) else layout % c[i]) if i < len(c) else "" for c in columns]
        lines.append(",".join(map(str, cells)))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
