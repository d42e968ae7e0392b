"""Several runs on one axes: each call of a plot adds one, in a colour of its own, and nothing leaves the view."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib.colors import same_color

from rthstrack.errors import SettingError
from rthstrack.plots.style import MEASURED, SECOND, TARGET, THIRD, VALUE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.typing import ColorType
    from numpy.typing import NDArray

_COLOURS = (VALUE, "#e69f00", SECOND, THIRD, "#56b4e9", MEASURED, TARGET)
#: What is a run's but not its main curve: its target, a second index, its line over frequency.
DASHED = (0, (3, 1.5))
#: Opacity of what is doubtful of one run among others.
FAINT = 0.35


@dataclass(slots=True)
class _Drawn:
    """What earlier calls drew on an axes."""

    unit: str | None
    colours: list[ColorType] = field(default_factory=list)
    targets: list[tuple[NDArray[Any], Line2D]] = field(default_factory=list)
    marks: dict[str, list[float]] = field(default_factory=dict)
    unnamed: list[tuple[Line2D, str]] = field(default_factory=list)
    values: list[float] = field(default_factory=list)


_drawn: WeakKeyDictionary[Axes, _Drawn] = WeakKeyDictionary()


class Run:
    """One run's turn on an axes: whether it is the first, its colour, and what its curves are called."""

    def __init__(
        self, ax: Axes, label: str | None, color: ColorType | None, usual: ColorType, unit: str | None = None
    ) -> None:
        drawn = _drawn.get(ax)
        if drawn is None or not ax.has_data():
            drawn = _drawn[ax] = _Drawn(unit)
        if drawn.unit != unit:
            there, new = drawn.unit or "not stated", unit or "not stated"
            raise SettingError(f"one axes, two units: {there} is drawn, {new} was given; use axes of its own")
        self._ax, self._on, self._label = ax, drawn, label
        self.first = not drawn.colours
        self.alone = self.first and label is None and color is None
        taken = [*drawn.colours, *([usual] if self.alone else ())]
        free = (one for one in _COLOURS[not self.first :] if not any(same_color(one, other) for other in taken))
        self.colour = color if color is not None else usual if self.alone else next(free, usual)
        drawn.colours.append(self.colour)
        if not self.first:
            for line, role in drawn.unnamed:
                line.set_label(_of_run("run 1", role))
            drawn.unnamed.clear()

    def name(self, line: Line2D, role: str, alone: str | None = None) -> None:
        """Names a curve for the legend: its `role` where a run has several, `alone` what it is without other runs."""
        if self.alone:
            line.set_label(role if alone is None else alone)
            self._on.unnamed.append((line, role))
        else:
            line.set_label(_of_run(self._label or f"run {len(self._on.colours)}", role))

    def with_earlier(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values that the axes are to show, with the least and greatest of earlier runs."""
        finite = values[np.isfinite(values)]
        if finite.size:
            self._on.values += [float(finite.min()), float(finite.max())]
        return np.array([*self._on.values])

    def draw_target(
        self,
        x: NDArray[np.float64],
        y: NDArray[np.float64],
        role: str,
        target: NDArray[Any],
    ) -> None:
        """The target's curve, once where runs have one `target` in common."""
        for known, line in self._on.targets:
            if np.array_equal(known, target):
                line.set_label(role)
                return
        how: dict[str, Any] = {"color": TARGET} if self.first else {"color": self.colour}
        how |= {} if self.first else {"linestyle": DASHED, "linewidth": 0.7}
        (line,) = self._ax.plot(x, y, **how)
        self.name(line, role)
        self._on.targets.append((target, line))

    def marks(self, kind: str) -> list[float]:
        """The values that runs have marked, in order; this one's are to be added."""
        return self._on.marks.setdefault(kind, [])

    def show_x(self, low: float, high: float) -> None:
        """Puts a range into view, beside what is in view."""
        if not self.first:
            before = self._ax.get_xlim()
            low, high = min(low, before[0]), max(high, before[1])
        if low < high:
            self._ax.set_xlim(low, high)

    def keep_y(self, before: tuple[float, float]) -> None:
        """Puts back into view what was in it before this run's own range was set."""
        if not self.first:
            low, high = self._ax.get_ylim()
            self._ax.set_ylim(min(low, before[0]), max(high, before[1]))


def _of_run(label: str, role: str) -> str:
    return f"{label}: {role}" if role else label
