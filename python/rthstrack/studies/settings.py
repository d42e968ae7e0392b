"""What a study runs over."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.errors import SettingError
from rthstrack.evaluation.inputs import TOLERANCE, _count, _number, settled
from rthstrack.evaluation.settings import Settings, StudyMethod, StudyMethodKeywords
from rthstrack.evaluation.tracking import Evaluator

if TYPE_CHECKING:
    from collections.abc import Iterable

#: P and Q of the paper's sections 3 and 4, each with the other at 1.
POWERS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512)
#: The largest P and Q that the paper's section 5 combines.
COMBINED = (64, 32)
WINDOWS = ("boxcar", "hann")
WEIGHT_POWERS = (2,)


_METHOD = tuple(one.name for one in dataclasses.fields(StudyMethod))


class StudyKeywords(StudyMethodKeywords, total=False):
    """Settings of a study by name."""

    P: Iterable[int] | None
    Q: Iterable[int] | None
    combined: tuple[int, int] | None
    windows: Iterable[str]
    weight_powers: Iterable[int]
    timing: bool
    choose: Iterable[str]
    tolerance: float
    shares: Iterable[float]


@dataclass(frozen=True, slots=True)
class StudySettings(StudyMethod):
    """What a study goes over; the words and defaults are those of `study`."""

    P: tuple[int, ...] | None = None
    Q: tuple[int, ...] | None = None
    combined: tuple[int, int] | None = None
    windows: tuple[str, ...] = WINDOWS
    weight_powers: tuple[int, ...] = WEIGHT_POWERS
    timing: bool = True
    choose: tuple[str, ...] = ()
    tolerance: float = TOLERANCE
    shares: tuple[float, ...] = ()

    def checked(self) -> StudySettings:
        """The same with the defaults filled in; raises SettingError for what is impossible whatever the source."""
        defaults = self.combined is None and self.P is None and self.Q is None
        combined = COMBINED if defaults else _combined(self.combined)
        windows = _several("windows", (self.windows,) if isinstance(self.windows, str) else self.windows)
        powers = tuple(_count("weight_powers", power) for power in _several("weight_powers", self.weight_powers))
        base = self._base()
        tolerance = _number("tolerance", self.tolerance)
        if not 0 < tolerance < 1:
            raise SettingError(f"tolerance must be a number between 0 and 1, both excluded, not {tolerance:g}")
        choose, shares = _named_factors(self.choose), _shares(self.shares)
        for what, needed, found in (
            ("spectral decimator", "spectral", base.decimator),
            ("estimator fei", "fei", base.estimator),
        ):
            if (choose or shares) and found != needed:
                raise SettingError(f"P and Q are chosen, and key frequencies taken, for the {what} only, not {found}")
        whole = dataclasses.replace(
            self,
            **{name: getattr(base, name) for name in _METHOD},
            P=_powers_of_two("P", POWERS if self.P is None else self.P),
            Q=_powers_of_two("Q", POWERS if self.Q is None else self.Q),
            combined=combined,
            windows=windows,
            weight_powers=powers,
            timing=bool(self.timing),
            choose=choose,
            tolerance=tolerance,
            shares=shares,
        )
        for kind in whole._kinds():
            Evaluator(1024, 1.0, dataclasses.replace(kind, band_hz=None))
        if not whole._grid():
            raise SettingError(
                f"no cell is left: P {_listed(whole.P)} with Q {_listed(whole.Q)}, combined up to {combined}"
            )
        return whole

    def _base(self) -> Settings:
        """What all cells share."""
        return settled(Settings(**{name: getattr(self, name) for name in _METHOD}))

    def _grid(self) -> list[tuple[int, int]]:
        most_p, most_q = self.combined or (math.inf, math.inf)
        return [(p, q) for p in self.P or () for q in self.Q or () if p == 1 or q == 1 or (p <= most_p and q <= most_q)]

    def _kinds(self) -> list[Settings]:
        """The settings of each window with each weight power, at P = Q = 1."""
        base = self._base()
        return [
            dataclasses.replace(base, window=window, weight_power=power)
            for window in self.windows
            for power in self.weight_powers
        ]


def _several(name: str, values: Iterable[Any]) -> tuple[Any, ...]:
    """The values, at least one and none twice."""
    try:
        listed = tuple(values)
    except TypeError:
        raise SettingError(f"{name} must be a list of values, found {values!r}") from None
    if not listed:
        raise SettingError(f"{name} is empty: give at least one value")
    for value in listed:
        if listed.count(value) > 1:
            raise SettingError(f"{name} holds {value!r} twice: give every value once")
    return listed


def _powers_of_two(name: str, values: Iterable[Any]) -> tuple[int, ...]:
    numbers = []
    for value in _several(name, values):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1 or value & (value - 1):
            raise SettingError(f"{name} must hold powers of two (1, 2, 4, ...), found {value!r}")
        numbers.append(_count(name, value))
    return tuple(sorted(numbers))


def _combined(limits: Any) -> tuple[int, int] | None:
    if limits is None:
        return None
    try:
        most_p, most_q = limits
    except (TypeError, ValueError):
        raise SettingError(
            f"combined must be the largest P and Q taken together, two numbers, not {limits!r}"
        ) from None
    return _count("combined P", most_p), _count("combined Q", most_q)


def _named_factors(choose: Any) -> tuple[str, ...]:
    names = tuple(choose)
    for name in names:
        if name not in ("P", "Q"):
            raise SettingError(f"choose takes P and Q, found {name!r}")
    return tuple(sorted(set(names)))


def _shares(shares: Any) -> tuple[float, ...]:
    numbers = tuple(_number("share", share) for share in shares)
    for share in numbers:
        if not 0 < share <= 1:
            raise SettingError(f"share must be above 0 and at most 1, not {share:g}")
        if numbers.count(share) > 1:
            raise SettingError(f"shares hold {share:g} twice: give every value once")
    return numbers


def _listed(values: Iterable[object] | None) -> str:
    return ", ".join(map(str, values or ()))
