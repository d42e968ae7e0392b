"""How alike two channels move, at the small lags of an actuator."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rthstrack.errors import RecordingError
from rthstrack.recording.clocks import on_one_clock

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rthstrack.recording.recording import Recording

# What a pair by likeness needs, and how much of the record is looked at.
LIKENESS = 0.9
MOST_SAMPLES = 1 << 16
_LONGEST_LAG_S = 0.25
_MOST_GAIN = 2.0


class Likeness(NamedTuple):
    """The highest correlation of b with a, at which lag (samples that b is later), and the size of b over a."""

    correlation: float
    lag: int
    gain: float


def rate_of(recording: Recording, at: int) -> float | None:
    """The sampling rate of the channel at this place, if it is known."""
    own = recording.channels[at].time
    return recording.rate_hz if own is None else own.rate_hz


@np.errstate(all="ignore")  # infinite samples are told where they matter
def likeness(recording: Recording, a: int, b: int) -> Likeness | None:
    """How alike the channels at two places move, without their means; None where they cannot be compared."""
    one, other = recording.channels[a], recording.channels[b]
    x, y = one.values[:MOST_SAMPLES], other.values[:MOST_SAMPLES]
    if one.time != other.time:
        try:
            moved = on_one_clock(recording, (f"#{a}", f"#{b}")).channels
        except RecordingError:
            return None
        x, y = (moved[i].values[:MOST_SAMPLES] for i in (a, b))
    if len(x) != len(y) or len(x) <= 16 or not (np.isfinite(x).all() and np.isfinite(y).all()):
        return None
    x, y = x - x.mean(), y - y.mean()
    gain = float(np.linalg.norm(y) / np.linalg.norm(x))
    rate = rate_of(recording, a)
    if rate is None or not 1 / _MOST_GAIN < gain < _MOST_GAIN:
        return None
    longest = min(max(1, int(_LONGEST_LAG_S * rate)), len(x) // 4)
    return Likeness(*_correlated(x, y, longest), gain)


def _correlated(x: NDArray[np.float64], y: NDArray[np.float64], longest: int) -> tuple[float, int]:
    """The highest correlation of y(t + lag) with x(t) for |lag| <= longest, and that lag."""
    n = 1 << (len(x) + longest).bit_length()
    product = np.fft.irfft(np.fft.rfft(y, n) * np.conj(np.fft.rfft(x, n)), n)
    lags = np.arange(-longest, longest + 1)
    values = product[lags] / (np.linalg.norm(x) * np.linalg.norm(y))
    at = int(values.argmax())
    return float(values[at]), int(lags[at])
