"""Evaluations that have a name: what a publication recommends, as settings."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Unpack

from rthstrack.errors import SettingError
from rthstrack.evaluation.inputs import merged
from rthstrack.evaluation.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rthstrack.evaluation.settings import EvaluationKeywords

_PAPER = Settings(estimator="fei", frequency_decimation=16, window="tukey", detrend="mean")

#: `paper`: frequency decimation by 16, as section 5.1 of Guo, Xu and Chen (2014) recommends; `paper-fast`: data
#: decimation by 16 too. Both with the Tukey window and the mean removed, as in Guo, Chen, Xu and Sanchez (2014).
PRESETS: Mapping[str, Settings] = MappingProxyType({"paper": _PAPER, "paper-fast": replace(_PAPER, data_decimation=16)})


def preset(name: str, **changes: Unpack[EvaluationKeywords]) -> Settings:
    """The settings of this name, with changes: `assess(..., settings=preset("paper", band_hz=(0.5, 20.0)))`.

    Raises SettingError for an unknown name or setting, with those that there are.
    """
    if name not in PRESETS:
        from rthstrack.keyed_table import suggestion

        raise SettingError(
            f"preset: expected one of {', '.join(PRESETS)}, found {name!r}{suggestion(str(name), PRESETS)}"
        )
    return merged(Settings, PRESETS[name], changes)
