"""What all results can do: plain values, JSON, rows of a table."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from rthstrack.errors import RthstrackError

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray


class _Result:
    """What all results can do."""

    __slots__ = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain Python values: numbers, strings, lists, dicts; a complex number is [real, imaginary]."""
        return cast("dict[str, Any]", _plain(self))

    def to_frame(self) -> pd.DataFrame:
        """A pandas DataFrame, a row an actuator, reading, frequency or sample; needs pandas."""
        try:
            import pandas as pd
        except ImportError:
            raise RthstrackError(
                "to_frame needs pandas, which is not installed: pip install 'rthstrack[pandas]'"
            ) from None
        return pd.DataFrame(self._columns())

    def _columns(self) -> dict[str, Any]:
        raise NotImplementedError


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, np.ndarray):
        return [_plain(v) for v in value] if value.ndim else _plain(value.item())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    return value


_SPREADS = ("amplitude_std", "delay_std_s", "residual_coherence", "goodness", "target_noise_std")
_INTERVALS = ("amplitude_interval", "delay_interval_s")


def _ends(name: str, interval: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Two columns of an interval (n, 2): its name with _low and _high before the unit."""
    stem, unit = (name[:-2], "_s") if name.endswith("_s") else (name, "")
    return {f"{stem}_low{unit}": interval[:, 0], f"{stem}_high{unit}": interval[:, 1]}


def json_ready(value: Any) -> Any:
    """The value in types that JSON knows; NaN and infinities become None."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, complex | np.complexfloating):
        return [json_ready(value.real), json_ready(value.imag)]
    if isinstance(value, Mapping):
        return {str(key): json_ready(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return json_ready(value.tolist())
    if isinstance(value, list | tuple):
        return [json_ready(item) for item in value]
    return value if value is None or isinstance(value, str) else str(value)
