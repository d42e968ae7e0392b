"""The samples and curves that the page draws, thinned by their extremes."""

from __future__ import annotations

import base64
import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.evaluation.results import json_ready
from rthstrack.values import stretches
from rthstrack.verdict import display

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rthstrack.evaluation.response import FrequencySlopes
    from rthstrack.evaluation.tracking import MovingTracking
    from rthstrack.verdict.assessment import Assessment

#: More samples than this are drawn by their extremes: of one record, and of several in one report together.
DRAWN_SAMPLES, DRAWN_SAMPLES_OF_ALL = 200_000, 120_000
#: More points of a curve (spectrum, history, moving evaluation) than this, likewise.
DRAWN_POINTS, DRAWN_POINTS_OF_ALL = 6_000, 20_000
#: No record is drawn by fewer.
FEWEST_SAMPLES, FEWEST_POINTS = 3_000, 500


@dataclass(frozen=True, slots=True)
class Budget:
    """How many samples of a record, and how many points of a curve, are drawn."""

    samples: int
    points: int

    @classmethod
    def of(cls, n_records: int) -> Budget:
        """What each of so many records may have, so that a report of many stays small."""
        if n_records == 1:
            return cls(DRAWN_SAMPLES, DRAWN_POINTS)
        return cls(
            max(DRAWN_SAMPLES_OF_ALL // n_records, FEWEST_SAMPLES),
            min(max(DRAWN_POINTS_OF_ALL // n_records, FEWEST_POINTS), DRAWN_POINTS),
        )


class Blocks:
    """The columns of samples on the page, each once: a channel shared by several assessments is stored once."""

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}

    def column(self, values: NDArray[Any]) -> dict[str, Any]:
        """Store a column in single precision, of the distance from mid-range where that is far from zero."""
        if values.dtype.kind in "iu":
            # Indices rise: from one to the next is a small number.
            steps = np.diff(values, prepend=0)
            if steps.size and steps.min() >= 0 and steps.max() < 1 << 16:
                return self._store(steps.astype("<u2"), "steps", 0.0)
            return self._store(values.astype("<u4"), "u4", 0.0)
        finite = values[np.isfinite(values)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
        # Only a true offset is worth it: off a spectrum, or a gain with one wild bin, it would round the rest away.
        offset = (low + high) / 2 if 2 * (high - low) < max(abs(low), abs(high)) else 0.0
        if 1e-30 < high - low < 1e30:
            return self._store((values - offset).astype("<f4"), "f4", offset)
        return self._store(values.astype("<f8"), "f8", 0.0)

    def _store(self, values: NDArray[Any], kind: str, offset: float) -> dict[str, Any]:
        raw = values.tobytes()
        key = f"block-{hashlib.sha256(repr((kind, offset)).encode() + raw).hexdigest()[:16]}"
        self._texts.setdefault(key, base64.b64encode(raw).decode())
        return {"block": key, "type": kind, "offset": offset}

    def html(self) -> str:
        return "\n".join(f'<script type="text/plain" id="{key}">{text}</script>' for key, text in self._texts.items())


def drawings(assessments: Sequence[Assessment], blocks: Blocks) -> list[dict[str, Any]]:
    """What the page draws of each assessment; the parts of one test keep the same samples, so that they share them."""
    records: dict[tuple[Any, ...], list[Assessment]] = {}
    for a in assessments:
        records.setdefault(_record(a), []).append(a)
    budget = Budget.of(len(records))
    kept = {record: _kept_samples(parts, budget) for record, parts in records.items()}
    return [_drawing(a, blocks, budget, kept[_record(a)]) for a in assessments]


def _record(a: Assessment) -> tuple[Any, ...]:
    """What the parts of one test have in common."""
    return a.file, a.actuator, a.start_s, a.rate_hz, a.target.size, None if a.file else id(a)


def _kept_samples(parts: Sequence[Assessment], budget: Budget) -> NDArray[np.intp] | None:
    """The samples drawn of one record, or None for all of them: the extremes of each channel and error in groups."""
    n = parts[0].target.size
    if n <= budget.samples:
        return None
    channels = {id(column): column for a in parts for column in (a.target, a.measured)}
    columns = [*channels.values(), *(a.measured - a.target for a in parts)]
    return display.extremes(columns, display.even_edges(n, max(budget.samples // (2 * len(columns)), 1)))


def _kept_points(
    columns: Sequence[NDArray[np.float64]], budget: Budget, logarithmic: bool = False
) -> NDArray[np.intp] | None:
    n = columns[0].size
    if n <= budget.points:
        return None
    # On a logarithmic axis the groups at low frequencies are single bins, and most curves peak together.
    edges = display.log_edges(n, budget.points // 2) if logarithmic else display.even_edges(n, budget.points // 6)
    return display.extremes(columns, edges)


def _take(values: NDArray[Any], kept: NDArray[np.intp] | None) -> NDArray[Any]:
    return values if kept is None else values[kept]


def _drawing(a: Assessment, blocks: Blocks, budget: Budget, kept: NDArray[np.intp] | None) -> dict[str, Any]:
    drawing = {
        "unit": a.unit or "",
        "amplitude": a.tracking.amplitude,
        "delay_s": a.tracking.delay_s,
        "trusted_amplitude": a.trusted.amplitude,
        "trusted_delay_s": a.trusted.delay_s,
        "equivalent_frequency_hz": a.tracking.equivalent_frequency_hz,
        "limits": {gate.name: gate.limit for gate in a.gates},
        "over": a.over_limit_s(),
        "time": _time_drawing(a, blocks, kept),
        "histories": _histories_drawing(a, blocks, budget),
        "moving": _moving_drawing(a, blocks, budget),
        "spectrum": _spectrum_drawing(a, blocks, budget),
        "response": _response_drawing(a, blocks, budget),
        "both": _both_drawing(a),
        "frequency": _frequency_drawing(a),
    }
    plain = json_ready(drawing)
    assert isinstance(plain, dict)
    return plain


def _time_drawing(a: Assessment, blocks: Blocks, kept: NDArray[np.intp] | None) -> dict[str, Any]:
    target_role, measured_role = display.signal_roles(a.part)
    target_label, measured_label = _signal(target_role, a.target_name), _signal(measured_role, a.measured_name)
    first, end = display.strongest_span(a.target, a.rate_hz)
    whole = end - first == a.target.size
    return {
        "start": a.start_s,
        "step": 1 / a.rate_hz,
        "n": a.target.size,
        "index": None if kept is None else blocks.column(kept),
        "drawn": a.target.size if kept is None else kept.size,
        "target": blocks.column(_take(a.target, kept)),
        "measured": blocks.column(_take(a.measured, kept)),
        "strongest": None if whole else [a.start_s + first / a.rate_hz, a.start_s + (end - 1) / a.rate_hz],
        "strongest_label": f"Strongest {display.STRONGEST_S:g} s",
        "label": display.with_unit(display.quantity(a.unit), a.unit),
        "error_label": display.with_unit("Error", a.unit),
        "error_name": f"{measured_role} \N{MINUS SIGN} {target_role}",
        "target_label": target_label,
        "measured_label": measured_label,
        "x_label": display.with_unit(target_label[0].upper() + target_label[1:], a.unit),
        "y_label": display.with_unit(measured_label[0].upper() + measured_label[1:], a.unit),
    }


def _signal(role: str, name: str) -> str:
    return role if name.lower() == role else f"{role}: {name}"


def _histories_drawing(a: Assessment, blocks: Blocks, budget: Budget) -> dict[str, Any]:
    h = a.histories
    columns = {
        "max_tracking_error": h.max_tracking_error,
        "rms_error": h.rms_error,
        "tracking_indicator": h.tracking_indicator,
    }
    if h.energy_error is not None:
        columns["energy_error"] = h.energy_error
    kept = _kept_points(list(columns.values()), budget)
    n = h.rms_error.size
    return {
        "start": a.start_s,
        "step": 1 / h.rate_hz,
        "n": n,
        "index": None if kept is None else blocks.column(kept),
        "drawn": n if kept is None else kept.size,
        "error_label": display.with_unit("Error", a.unit),
        "indicator_label": f"TI ({a.unit}²)" if a.unit else "TI (unit not stated)",
        **{name: blocks.column(_take(column, kept)) for name, column in columns.items()},
    }


def _moving_drawing(a: Assessment, blocks: Blocks, budget: Budget) -> dict[str, Any] | None:
    m = a.beside_moving
    if m is None or m.time_s.size == 0:
        return None
    columns = {"amplitude": np.where(m.valid, m.amplitude, np.nan), "delay_s": np.where(m.valid, m.delay_s, np.nan)}
    if a.trusted_moving is not None:
        columns |= _trusted_columns(a.trusted_moving)
    kept = _kept_points(list(columns.values()), budget)
    half = m.hop_s / 2
    invalid = [
        [a.start_s + m.time_s[first] - half, a.start_s + m.time_s[end - 1] + half] for first, end in stretches(~m.valid)
    ]
    return {
        "n": m.time_s.size,
        "drawn": m.time_s.size if kept is None else kept.size,
        "label": f"windows of {m.window_s:.4g} s",
        "name": display.ESTIMATORS[m.settings.estimator],
        "time": blocks.column(_take(a.start_s + m.time_s, kept)),
        **{name: blocks.column(_take(column, kept)) for name, column in columns.items()},
        "invalid": invalid,
    }


def _trusted_columns(m: MovingTracking) -> dict[str, NDArray[np.float64]]:
    return {
        "trusted_amplitude": np.where(m.valid, m.amplitude, np.nan),
        "trusted_delay_s": np.where(m.valid, m.delay_s, np.nan),
        "amplitude_low": m.amplitude_interval[:, 0],
        "amplitude_high": m.amplitude_interval[:, 1],
        "delay_low_s": m.delay_interval_s[:, 0],
        "delay_high_s": m.delay_interval_s[:, 1],
    }


def _spectrum_drawing(a: Assessment, blocks: Blocks, budget: Budget) -> dict[str, Any] | None:
    t = a.tracking
    if t.frequency_hz is None or t.weights is None or t.target_spectrum is None or t.measured_spectrum is None:
        return None
    scale = display.fourier_scale(t)
    target, measured = np.abs(t.target_spectrum) * scale, np.abs(t.measured_spectrum) * scale
    kept = _kept_points([target, measured, t.weights], budget, logarithmic=True)
    return {
        "n": t.frequency_hz.size,
        "drawn": t.frequency_hz.size if kept is None else kept.size,
        "frequency": blocks.column(_take(t.frequency_hz, kept)),
        "target": blocks.column(_take(target, kept)),
        "measured": blocks.column(_take(measured, kept)),
        "weights": blocks.column(_take(t.weights, kept)),
        "label": f"Fourier amplitude ({a.unit} s)" if a.unit else "Fourier amplitude (unit not stated)",
        "unit": f"{a.unit} s" if a.unit else "",
    }


def _response_drawing(a: Assessment, blocks: Blocks, budget: Budget) -> dict[str, Any] | None:
    r = a.response
    if r is None:
        return None
    above_zero = r.frequency_hz > 0
    frequency = r.frequency_hz[above_zero]
    if frequency.size == 0:
        return None
    columns = {
        name: column[above_zero]
        for name, column in (
            ("gain", r.gain),
            ("delay_s", r.delay_s),
            ("coherence", r.coherence),
            ("gain_low", r.gain_interval[:, 0]),
            ("gain_high", r.gain_interval[:, 1]),
            ("delay_low_s", r.delay_interval_s[:, 0]),
            ("delay_high_s", r.delay_interval_s[:, 1]),
        )
    }
    kept = _kept_points(list(columns.values()), budget, logarithmic=True)
    return {
        "n": frequency.size,
        "drawn": frequency.size if kept is None else kept.size,
        "low_coherence": display.DRAWN_GREY_BELOW,
        "line": _slope_lines(a.slopes),
        "frequency": blocks.column(_take(frequency, kept)),
        **{name: blocks.column(_take(column, kept)) for name, column in columns.items()},
    }


def _slope_lines(s: FrequencySlopes | None) -> dict[str, Any] | None:
    """The lines of gain and delay over the frequencies that they were fitted to: value + slope (f - at)."""
    if s is None:
        return None
    return {
        "band": s.band_hz,
        "at": s.equivalent_frequency_hz,
        "gain": [s.gain, s.gain_per_hz],
        "delay_s": [s.delay_s, s.delay_s_per_hz],
    }


def _both_drawing(a: Assessment) -> dict[str, Any] | None:
    """Gain and delay over time and frequency, to four digits: colours show no more."""
    found = a.time_frequency()
    if found is None:
        return None

    def rounded(values: NDArray[np.float64]) -> list[float]:
        return [float(f"{value:.4g}") for value in values]

    rows = zip(found.bands, found.known("gain"), found.known("delay_s"), strict=True)
    return {
        "extent": [found.bands[0].low_hz, found.bands[-1].high_hz],
        "least_coherence": found.least_coherence,
        "window_s": [found.bands[-1].window_s, found.bands[0].window_s],
        "bands": [
            {
                "band": [band.low_hz, band.high_hz],
                "first": a.start_s + float(band.time_s[0]),
                "hop": band.hop_s,
                "gain": rounded(gain),
                "delay_s": rounded(delay_s),
            }
            for band, gain, delay_s in rows
        ],
    }


def _frequency_drawing(a: Assessment) -> dict[str, Any] | None:
    """What the frequency axis spans, what it shows first, and the parts that were not judged."""
    judged, welch = a.tracking.frequency_hz, None if a.response is None else a.response.frequency_hz
    axes = [axis[axis > 0] for axis in (judged, welch) if axis is not None]
    axes = [axis for axis in axes if axis.size]
    if not axes:
        return None
    low, high = min(float(axis[0]) for axis in axes), max(float(axis[-1]) for axis in axes)
    if not low < high:
        return None
    outside = []
    if judged is not None and judged.size:
        first, last = float(judged[0]), float(judged[-1])
        outside = [[low, first]] * (first > low) + [[last, high]] * (last < high)
    home = display.judged_range(a.tracking)
    inside = home is not None and low <= home[0] < home[1] <= high
    return {"extent": [low, high], "home": home if inside else [low, high], "outside": outside}
