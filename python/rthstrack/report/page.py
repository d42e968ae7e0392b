"""One self-contained HTML page from one or several assessments.

The page takes what an `Assessment` holds and computes nothing. It loads nothing from a network: style, scripts and
samples are inside, and a content security policy forbids anything else. Texts from files are escaped everywhere.
"""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from html import escape
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack._core import __version__
from rthstrack.errors import SettingError
from rthstrack.verdict import display
from rthstrack.verdict.argument import reason
from rthstrack.verdict.assessment import json_ready, result_entry

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rthstrack.evaluation.tracking import FrequencySlopes, MovingTracking
    from rthstrack.verdict.assessment import Assessment

#: More samples than this are drawn by their extremes.
DRAWN_SAMPLES = 200_000
#: More points of a curve (spectrum, history, moving evaluation) than this are drawn by their extremes.
DRAWN_POINTS = 6_000

NOT_DETERMINED = "not determined"

_ESTIMATORS = {"fei": "published", "aligned": "aligned", "least_squares": "least squares"}

_INDICES = (
    # name, field, unit, factor to the unit shown, field in percent, what it is
    ("MTE", "max_tracking_error", "unit", 1.0, "max_tracking_error_percent", "of the largest {target}"),
    ("RMS error", "rms_error", "unit", 1.0, "rms_error_percent", "of the RMS of {target}"),
    ("TI", "tracking_indicator", "unit2", 1.0, None, "tracking indicator at the end, rises on lag"),
    ("J1", "j1_s", "ms", 1e3, None, "lag of the correlation peak"),
    ("J2", "j2_percent", "%", 1.0, None, "standard deviation of the error over that of {target}"),
    ("J3", "j3_percent", "%", 1.0, None, "peak error over peak {target}"),
    ("Energy error", "energy_error", "", 1.0, None, "work over {measured} less work over {target}"),
)

_SETTING_NAMES = {
    "estimator": "Estimator",
    "data_decimation": "Data decimation P",
    "frequency_decimation": "Frequency decimation Q",
    "decimator": "Decimator",
    "weight_power": "Weight power l",
    "window": "Window",
    "detrend": "Detrend",
    "band_hz": "Band",
    "max_delay_s": "Largest delay looked for",
    "expected_delay_s": "Expected delay",
    "noise": "Noise on measured",
    "noise_ratio": "Noise on target over that on measured",
    "bad_samples": "Bad samples",
    "moving_s": "Moving windows",
    "hop_s": "One moving window every",
    "rate_source": "Rate from",
    "start_s": "Cut before",
    "end_s": "Cut after",
    "n_filled": "Filled samples",
    "fill": "Fill gaps up to (samples)",
    "resample_hz": "Resampled to",
}


def write_report(assessments: Sequence[Assessment], path: str | Path) -> None:
    """Write the HTML report of one or several assessments to `path`.

    Above 200,000 samples a trace is drawn by the extremes of groups of samples, and the page says so; its numbers are
    the assessment's own. Errors: SettingError without an assessment, or where the file cannot be written.
    """
    page = report_html(assessments)
    try:
        Path(path).write_text(page, encoding="utf-8", errors="replace", newline="\n")
    except OSError as error:
        raise SettingError(
            f"{path}: cannot write the report there ({error.strerror}); name a file in an existing, writable folder"
        ) from error


def report_html(assessments: Sequence[Assessment]) -> str:
    """The text of the page that `write_report` writes."""
    if not assessments:
        raise SettingError("a report needs at least one assessment, none was given; evaluate a recording first")
    blocks = _Blocks()
    drawing = [_drawing(assessment, blocks) for assessment in assessments]
    version, created = __version__, datetime.now().astimezone()
    results = {
        "program": {"name": "rthstrack", "version": version},
        "created": created.isoformat(timespec="seconds"),
        "results": [result_record(assessment) for assessment in assessments],
    }
    style = "\n".join(_asset(name) for name in ("uPlot.min.css", "charts.css", "report.css"))
    licence = f"/*! uPlot 1.6.32\n{_asset('uPlot.LICENSE').strip()}\n*/\n"
    scripts = [licence + _asset("uPlot.iife.min.js"), _asset("charts.js"), _asset("report.js")]
    policy = (
        f"default-src 'none'; img-src data:; style-src {_digest(style)}; "
        f"script-src {' '.join(_digest(script) for script in scripts)}; base-uri 'none'; form-action 'none'"
    )
    several = len(assessments) > 1
    n_files = len({assessment.file for assessment in assessments})
    title = (
        f"Tracking of {len(assessments)} pairs in {n_files} {'file' if n_files == 1 else 'files'}"
        if several
        else f"Tracking in {_source(assessments[0])}"
    )
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en">',
        "<head>",
        '<meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="color-scheme" content="light dark">',
        f'<meta name="generator" content="rthstrack {escape(version)}">',
        f"<title>{escape(title)}</title>",
        '<link rel="icon" href="data:,">',
        f"<style>{style}</style>",
        "</head>",
        "<body>",
        '<header class="page">',
        f"<h1>{escape(title)}</h1>",
        f'<p class="muted">rthstrack {escape(version)} · '
        f'<time datetime="{results["created"]}">{created:%Y-%m-%d %H:%M}</time></p>',
        "</header>",
        "<main>",
        "<noscript><p>The numbers below are complete; the charts need JavaScript.</p></noscript>",
    ]
    if several:
        parts += [_summary(assessments), _tabs(assessments)]
    for number, (assessment, drawn) in enumerate(zip(assessments, drawing, strict=True)):
        role = f' role="tabpanel" aria-labelledby="tab-{number}"' if several else ""
        opening = f'<section class="assessment" id="assessment-{number}"{role}>'
        parts.append(_section(assessment, drawn, opening, version, created))
    parts += [
        "</main>",
        _footer(),
        _json_block("results", results),
        _json_block("drawing", drawing),
        blocks.html(),
        *(f"<script>{script}</script>" for script in scripts),
        "</body>",
        "</html>",
        "",
    ]
    return "\n".join(parts)


def result_record(assessment: Assessment) -> dict[str, Any]:
    """The numbers of one assessment at full precision, ready for JSON; a number that is not determined is None."""
    a = assessment
    record = result_entry(a) | {
        "part": a.part,
        "start_s": a.start_s,
        "indices": dataclasses.asdict(a.indices),
        "moving": None,
        "trusted_moving": None,
        "response": None,
        "verdict": a.verdict,
        "warnings": a.warnings,
        "limits": dataclasses.asdict(a.limits),
        "exceeded": a.exceeded,
        "not_determined": _reasons(a),
    }
    if a.moving is not None:
        record["moving"] = {
            "window_s": a.moving.window_s,
            "hop_s": a.moving.hop_s,
            "minimum_std_ratio": a.moving.minimum_std_ratio,
            "n_readings": int(a.moving.time_s.size),
            "n_valid": int(np.count_nonzero(a.moving.valid)),
        }
    if a.trusted_moving is not None:
        known = a.trusted_moving.valid
        record["trusted_moving"] = {
            "n_valid": int(np.count_nonzero(known)),
            "n_intervals": int(np.count_nonzero(np.isfinite(a.trusted_moving.delay_interval_s[:, 0]))),
            "reasons": [{"n": n, "first": text} for n, text in display.reasons(a.trusted_moving)],
        }
    if a.response is not None:
        names = ("segment_s", "overlap", "n_segments", "window", "detrend", "align_s", "dispersion")
        record["response"] = {name: getattr(a.response, name) for name in names}
    return {key: json_ready(value) for key, value in record.items()}


# ---------------------------------------------------------------------------------------------------- numbers and texts


def _reasons(a: Assessment) -> dict[str, str]:
    reasons: dict[str, str] = {}
    for name in ("amplitude", "delay_s", "phase_rad", "equivalent_frequency_hz"):
        if not math.isfinite(getattr(a.tracking, name)):
            reasons[name] = _why(reason(a.tracking))
    for index in dataclasses.fields(a.indices):
        value = getattr(a.indices, index.name)
        if value is None:
            needs_force = index.name == "energy_error"
            reasons[index.name] = "needs the measured force" if needs_force else "was not evaluated"
        elif not math.isfinite(value):
            reasons[index.name] = "the evaluation gave no finite number"
    if (text := reason(a.trusted)) is not None:
        reasons["trusted"] = _why(text)
    if a.slopes is None:
        reasons["slopes"] = _why(a.slopes_note)
    if a.moving is None:
        reasons["moving"] = _why(a.moving_note)
    if a.response is None:
        reasons["response"] = _why(a.response_note)
    return reasons


def _why(note: str | None) -> str:
    """A note of the assessment as the reason alone; what it is the reason for is said where it is shown."""
    return (note or "was not evaluated").removeprefix(f"{NOT_DETERMINED}: ")


def _number(
    field: str, value: float | None, unit: str = "", factor: float = 1.0, reason: str | None = None, digits: int = 4
) -> str:
    """A number as text with its unit; the machine-readable value beside it is in the unit of the field's name."""
    if value is None or not math.isfinite(value):
        why = f' <span class="reason">({escape(reason)})</span>' if reason else ""
        return f'<span class="absent" data-field="{field}">{NOT_DETERMINED}{why}</span>'
    shown = display.significant(value if isinstance(value, int) else float(value) * factor, digits)
    tail = f'<span class="unit">{"" if unit == "°" else " "}{escape(unit)}</span>' if unit else ""
    exact = value if isinstance(value, int) else repr(float(value))
    return f'<data data-field="{field}" value="{exact}">{shown}{tail}</data>'


def _interval(field: str, interval: Iterable[float], value: float, unit: str = "", factor: float = 1.0) -> str:
    """A 95 % interval as text, to the digits that its width leaves; empty where there is none."""
    low, high = (float(end) for end in interval)
    if not math.isfinite(high - low):
        return ""
    text = display.with_interval(factor * value, (factor * low, factor * high)).partition(" (")[2].rstrip(")")
    ends = f'data-low="{low!r}" data-high="{high!r}"'
    shown = escape(text.replace("-", "\N{MINUS SIGN}") + (f" {unit}" if unit else ""))
    return f'95 %: <span data-field="{field}" {ends}>{shown}</span>'


def _flat(settings: Mapping[str, Any], before: str = "") -> list[tuple[str, Any]]:
    rows: list[tuple[str, Any]] = []
    for key, value in settings.items():
        name = f"{before}{key}"
        if isinstance(value, Mapping):
            rows += _flat(value, f"{name} · ") if value else [(name, None)]
        else:
            rows.append((name, value))
    return rows


def _setting(name: str, value: Any) -> tuple[str, str]:
    """A setting's name and value in words; the unit is the suffix of the name."""
    unit = next((u for end, u in (("_hz", "Hz"), ("_s", "s"), ("_percent", "%")) if name.endswith(end)), "")
    plain = name.removesuffix("_hz").removesuffix("_percent")
    plain = plain.removesuffix("_s").replace("_", " ")
    first, _, rest = name.partition(" · ")
    label = _SETTING_NAMES.get(first, plain[:1].upper() + plain[1:])
    if rest and first in _SETTING_NAMES:
        label = f"{label}: {rest}"
    if value is None or value == [] or value == ():
        return label, "none"
    if isinstance(value, bool):
        return label, "yes" if value else "no"
    if isinstance(value, list | tuple):
        text = (" to " if len(value) == 2 and unit else ", ").join(_scalar(item) for item in value)
    else:
        text = _scalar(value)
    return label, f"{text} {unit}" if unit else text


def _scalar(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float | np.floating) else str(value)


def _asset(name: str) -> str:
    return (resources.files("rthstrack") / "assets" / name).read_text(encoding="utf-8")


def _digest(text: str) -> str:
    """The text's hash as a content security policy names it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _json_block(name: str, content: Any) -> str:
    """A JSON script block. With every < written as an escape, no text in it can end the block or open another."""
    text = json.dumps(content, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return f'<script type="application/json" id="{name}">{text.replace("<", chr(92) + "u003c")}</script>'


# ---------------------------------------------------------------------------------------------------- what is drawn


class _Blocks:
    """The columns of samples on the page, each once: a channel shared by several assessments is stored once."""

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}

    def column(self, values: NDArray[Any]) -> dict[str, Any]:
        """Store a column in single precision, of the distance from mid-range where that is far from zero."""
        if values.dtype.kind in "iu":
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


def _kept_samples(a: Assessment) -> NDArray[np.intp] | None:
    """The samples drawn, or None for all of them; six extremes a group make at most DRAWN_SAMPLES."""
    if a.target.size <= DRAWN_SAMPLES:
        return None
    columns = (a.target, a.measured, a.measured - a.target)
    return display.extremes(columns, display.even_edges(a.target.size, DRAWN_SAMPLES // 6))


def _kept_points(columns: Sequence[NDArray[np.float64]], logarithmic: bool = False) -> NDArray[np.intp] | None:
    n = columns[0].size
    if n <= DRAWN_POINTS:
        return None
    # On a logarithmic axis the groups at low frequencies are single bins, and most curves peak together.
    edges = display.log_edges(n, DRAWN_POINTS // 2) if logarithmic else display.even_edges(n, DRAWN_POINTS // 6)
    return display.extremes(columns, edges)


def _take(values: NDArray[Any], kept: NDArray[np.intp] | None) -> NDArray[Any]:
    return values if kept is None else values[kept]


def _drawing(a: Assessment, blocks: _Blocks) -> dict[str, Any]:
    drawing = {
        "unit": a.unit or "",
        "amplitude": a.tracking.amplitude,
        "delay_s": a.tracking.delay_s,
        "trusted_amplitude": a.trusted.amplitude,
        "trusted_delay_s": a.trusted.delay_s,
        "equivalent_frequency_hz": a.tracking.equivalent_frequency_hz,
        "limits": dataclasses.asdict(a.limits),
        "time": _time_drawing(a, blocks),
        "histories": _histories_drawing(a, blocks),
        "moving": _moving_drawing(a, blocks),
        "spectrum": _spectrum_drawing(a, blocks),
        "response": _response_drawing(a, blocks),
        "frequency": _frequency_drawing(a),
    }
    plain = json_ready(drawing)
    assert isinstance(plain, dict)
    return plain


def _time_drawing(a: Assessment, blocks: _Blocks) -> dict[str, Any]:
    target_role, measured_role = display.signal_roles(a.part)
    target_label, measured_label = _signal(target_role, a.target_name), _signal(measured_role, a.measured_name)
    kept = _kept_samples(a)
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


def _histories_drawing(a: Assessment, blocks: _Blocks) -> dict[str, Any]:
    h = a.histories
    columns = {
        "max_tracking_error": h.max_tracking_error,
        "rms_error": h.rms_error,
        "tracking_indicator": h.tracking_indicator,
    }
    if h.energy_error is not None:
        columns["energy_error"] = h.energy_error
    kept = _kept_points(list(columns.values()))
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


def _moving_drawing(a: Assessment, blocks: _Blocks) -> dict[str, Any] | None:
    m = a.moving
    if m is None or m.time_s.size == 0:
        return None
    columns = {"amplitude": np.where(m.valid, m.amplitude, np.nan), "delay_s": np.where(m.valid, m.delay_s, np.nan)}
    if a.trusted_moving is not None:
        columns |= _trusted_columns(a.trusted_moving)
    kept = _kept_points(list(columns.values()))
    edges = np.flatnonzero(np.diff(np.concatenate(([True], m.valid, [True])).astype(np.int8)))
    half = m.hop_s / 2
    invalid = [
        [a.start_s + m.time_s[first] - half, a.start_s + m.time_s[end - 1] + half]
        for first, end in zip(edges[::2], edges[1::2], strict=True)
    ]
    return {
        "n": m.time_s.size,
        "drawn": m.time_s.size if kept is None else kept.size,
        "label": f"windows of {m.window_s:.4g} s",
        "name": _ESTIMATORS[m.settings.estimator],
        "both": a.trusted_moving is not a.moving,
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


def _spectrum_drawing(a: Assessment, blocks: _Blocks) -> dict[str, Any] | None:
    t = a.tracking
    if t.frequency_hz is None or t.weights is None or t.target_spectrum is None or t.measured_spectrum is None:
        return None
    scale = display.fourier_scale(t)
    target, measured = np.abs(t.target_spectrum) * scale, np.abs(t.measured_spectrum) * scale
    kept = _kept_points([target, measured, t.weights], logarithmic=True)
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


def _response_drawing(a: Assessment, blocks: _Blocks) -> dict[str, Any] | None:
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
    kept = _kept_points(list(columns.values()), logarithmic=True)
    return {
        "n": frequency.size,
        "drawn": frequency.size if kept is None else kept.size,
        "low_coherence": display.LOW_COHERENCE,
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


# ---------------------------------------------------------------------------------------------------- the page's parts


def _source(a: Assessment) -> str:
    """The file, or words for samples that did not come from one."""
    return a.file or "samples given in Python"


def _name(a: Assessment, several_files: bool = True) -> str:
    parts = [Path(_source(a)).name] if several_files else []
    parts.append(f"actuator {a.actuator}")
    if a.part != "whole":
        parts.append(a.part)
    return " · ".join(parts)


def _summary(assessments: Sequence[Assessment]) -> str:
    """The table of all, one row per assessment."""
    heads = (
        "File",
        "Actuator",
        "Part",
        "Pair",
        "Amplitude",
        "Delay (ms)",
        "f_eq (Hz)",
        "RMS error (%)",
    )
    rows = []
    for number, a in enumerate(assessments):
        t = a.tracking
        state = []
        if a.exceeded:
            state.append('<strong class="exceeded">limit exceeded</strong>')
        elif a.limits.delay_s is not None or a.limits.amplitude is not None:
            state.append("within limits")
        if a.warnings:
            state.append(f"{len(a.warnings)} {'warning' if len(a.warnings) == 1 else 'warnings'}")
        numbers = (
            _number("amplitude", float(t.amplitude)),
            _number("delay_s", float(t.delay_s), factor=1e3),
            _number("equivalent_frequency_hz", float(t.equivalent_frequency_hz)),
            _number("rms_error_percent", a.indices.rms_error_percent),
        )
        rows.append(
            f'<tr data-assessment="{number}">'
            f'<th scope="row"><a href="#assessment-{number}">{escape(_source(a))}</a></th>'
            f"<td>{a.actuator}</td><td>{escape(a.part)}</td>"
            f'<td class="pair">{escape(a.target_name)} → {escape(a.measured_name)}</td>'
            + "".join(f'<td class="number">{text}</td>' for text in numbers)
            + f"<td>{', '.join(state)}</td></tr>"
        )
    head = "".join(
        f'<th scope="col"{" class=number" if at >= 4 else ""}>{escape(text)}</th>' for at, text in enumerate(heads)
    )
    return (
        '<section class="summary"><h2>Summary</h2><div class="scroll"><table>'
        f'<thead><tr>{head}<th scope="col">Remarks</th></tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div></section>"
    )


def _tabs(assessments: Sequence[Assessment]) -> str:
    several_files = len({a.file for a in assessments}) > 1
    tabs = "".join(
        f'<button type="button" role="tab" id="tab-{number}" aria-controls="assessment-{number}" '
        f'aria-selected="{str(number == 0).lower()}" tabindex="{0 if number == 0 else -1}">'
        f"{'<span class=mark aria-label=&quot;limit exceeded&quot;>▲</span> ' if a.exceeded else ''}"
        f"{escape(_name(a, several_files))}</button>"
        for number, a in enumerate(assessments)
    )
    return f'<div class="tabs" role="tablist" aria-label="Evaluated pairs">{tabs}</div>'


def _section(a: Assessment, drawing: Mapping[str, Any], opening: str, version: str, created: datetime) -> str:
    return "\n".join(
        (
            opening,
            _heading(a),
            _key_numbers(a),
            _notice("warnings", ("Warning", "Warnings"), a.warnings),
            _time_charts(a, drawing),
            _frequency_charts(a, drawing),
            _settings_table(a, version, created),
            "</section>",
        )
    )


def _heading(a: Assessment) -> str:
    target_role, measured_role = display.signal_roles(a.part)
    what = {"compensator": "compensator alone", "actuator": "actuator alone"}.get(a.part, "")
    facts = [
        escape(_source(a)),
        f"actuator {a.actuator}" + (f", {what}" if what else ""),
        f"{escape(_signal(target_role, a.target_name))} → {escape(_signal(measured_role, a.measured_name))}",
        f"{_number('n_samples', int(a.target.size))} samples at {a.rate_hz:.6g} Hz",
    ]
    return (
        f'<p class="facts">{" · ".join(facts)}</p>'
        f'<h2 class="verdict" data-field="verdict">{escape(a.verdict)}</h2>'
        f'<p class="argument" data-field="argument">{escape(a.argument)}</p>'
        f"{_trusted_reason(a)}" + _notice("exceeded", ("Limit exceeded", "Limits exceeded"), a.exceeded)
    )


def _trusted_reason(a: Assessment) -> str:
    """Why the trusted estimate or its interval is missing, where the argument does not say so."""
    text = reason(a.trusted)
    if text is None or _why(text) in a.argument:
        return ""
    return f'<p class="argument muted" data-field="trusted_reason">{escape(text)}</p>'


def _key_numbers(a: Assessment) -> str:
    t, reasons = a.tracking, _reasons(a)
    target_role, measured_role = display.signal_roles(a.part)
    amplitude, delay_s = float(t.amplitude), float(t.delay_s)
    phase, f_eq = float(t.phase_rad), float(t.equivalent_frequency_hz)
    sense = "" if not delay_s else f"{measured_role} {'lags' if delay_s > 0 else 'leads'}"
    large = (
        (
            "Amplitude A",
            _number("amplitude", amplitude, reason=reasons.get("amplitude")),
            _beside(a, "amplitude", "1 is perfect"),
            _limit("limit_amplitude", "1 \N{PLUS-MINUS SIGN} ", abs(amplitude - 1), a.limits.amplitude),
        ),
        (
            "Delay d",
            _number("delay_s", delay_s, "ms", 1e3, reasons.get("delay_s")),
            _beside(a, "delay_s", sense if math.isfinite(delay_s) else ""),
            _limit("limit_delay_s", "\N{PLUS-MINUS SIGN}", abs(delay_s), a.limits.delay_s, "ms", 1e3),
        ),
        (
            "Phase",
            _number("phase_rad", phase, "\N{DEGREE SIGN}", 180 / math.pi, reasons.get("phase_rad")),
            "negative on lag",
            "",
        ),
        (
            "Equivalent frequency",
            _number("equivalent_frequency_hz", f_eq, "Hz", reason=reasons.get("equivalent_frequency_hz")),
            f"{_number('n_bins', int(t.n_bins))} bins, {_number('delta_f_hz', float(t.delta_f_hz), 'Hz')} apart",
            "",
        ),
    )
    tiles = "".join(
        f"<div><dt>{name}</dt><dd>{value}<small>{note}</small>{limit}</dd></div>" for name, value, note, limit in large
    )
    return f'<dl class="tiles">{tiles}</dl>{_index_tiles(a, target_role, measured_role, reasons)}'


def _beside(a: Assessment, name: str, note: str) -> str:
    """What the tile's number is, its interval if it has one, and the trusted one with its own."""
    t = a.trusted
    unit, factor = ("ms", 1e3) if name == "delay_s" else ("", 1.0)
    field = "delay_interval_s" if name == "delay_s" else "amplitude_interval"
    parts = [f"{_ESTIMATORS[a.tracking.settings.estimator]}; {note}".removesuffix("; ")]
    own = float(getattr(a.tracking, name))
    if a.tracking.settings.estimator != "fei" and math.isfinite(own):
        parts.append(_interval(field, getattr(a.tracking, field), own, unit, factor) or "no interval")
    if t is not a.tracking:
        value = float(getattr(t, name))
        parts.append(f"trusted: {_number(f'trusted_{name}', value, unit, factor)}")
        between = _interval(f"trusted_{field}", getattr(t, field), value, unit, factor)
        parts.append(between or ("no interval" if math.isfinite(value) else ""))
    return "<br>".join(part for part in parts if part)


def _limit(field: str, sign: str, found: float, limit: float | None, unit: str = "", factor: float = 1.0) -> str:
    if limit is None:
        return ""
    if not math.isfinite(found):
        state = NOT_DETERMINED
    elif found > limit:
        state = '<strong class="exceeded">\N{BLACK UP-POINTING TRIANGLE} exceeded</strong>'
    else:
        state = "kept"
    allowed = f'<data data-field="{field}" value="{limit!r}">{limit * factor:.4g}{" " if unit else ""}{unit}</data>'
    return f'<small>limit {sign}{allowed}: <span data-field="{field}_state">{state}</span></small>'


def _index_tiles(a: Assessment, target_role: str, measured_role: str, reasons: Mapping[str, str]) -> str:
    units = {"unit": a.unit or "", "unit2": f"{a.unit}²" if a.unit else ""}
    tiles = []
    for name, field, unit, factor, percent, meaning in _INDICES:
        value = _number(field, getattr(a.indices, field), units.get(unit, unit), factor, reasons.get(field))
        note = meaning.format(target=target_role, measured=measured_role)
        if percent is not None:
            note = f"{_number(percent, getattr(a.indices, percent), '%', reason=reasons.get(percent))} {note}"
        tiles.append(f"<div><dt>{name}</dt><dd>{value}<small>{note}</small></dd></div>")
    return f'<dl class="tiles indices">{"".join(tiles)}</dl>'


def _notice(field: str, heads: tuple[str, str], texts: Sequence[str]) -> str:
    if not texts:
        return ""
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    head = heads[len(texts) > 1]
    return f'<div class="notice {field}" role="note"><h3>{head}</h3><ul data-field="{field}">{items}</ul></div>'


def _chart(name: str, label: str, caption: str = "") -> str:
    text = f"<figcaption>{caption}</figcaption>" if caption else ""
    return (
        f'<figure><div class="chart" data-chart="{name}" role="img" aria-label="{escape(label)}"></div>{text}</figure>'
    )


def _thinned(drawing: Mapping[str, Any], points: str) -> str:
    """What a caption says where not every point is drawn."""
    if drawing["drawn"] >= drawing["n"]:
        return ""
    return f' <span class="thinned">Drawn: {drawing["drawn"]} of {drawing["n"]} {points}, extremes kept.</span>'


def _time_charts(a: Assessment, drawing: Mapping[str, Any]) -> str:
    target_role, measured_role = display.signal_roles(a.part)
    if a.moving is None or drawing["moving"] is None:
        reason = _why(a.moving_note) if a.moving is None else "there is no reading"
        moving = f'<p class="absent" data-field="moving">A(t) and d(t) {NOT_DETERMINED}: {escape(reason)}</p>'
    else:
        m = a.moving
        text = (
            f"{int(np.count_nonzero(m.valid))} of {m.time_s.size} windows of {m.window_s:.4g} s "
            f"judged, one every {m.hop_s:.4g} s, drawn at the window's centre. Grey: not judged, most often as "
            f"{target_role} moves too little in the window (standard deviation below {m.minimum_std_ratio:.3g} of the "
            "record's)."
        )
        moving = _chart("moving-amplitude", "Amplitude over time")
        moving += _chart(
            "moving-delay", "Delay over time", text + _trusted_windows(a) + _thinned(drawing["moving"], "windows")
        )
    histories = drawing["histories"]
    energy = _chart("energy", "Energy error over time") if "energy_error" in histories else ""
    note = _thinned(histories, "samples")
    return (
        '<section class="charts"><div class="head"><h3>Over time</h3><div class="views" data-views="time"></div>'
        '<p class="hint">Drag to zoom, double click to go back. Keys: \N{LEFTWARDS ARROW} \N{RIGHTWARDS ARROW} '
        "move, + \N{MINUS SIGN} zoom, 0 back.</p></div>"
        '<div class="with-loop"><div>'
        + _chart("history", f"{target_role} and {measured_role} over time")
        + _chart("error", f"{measured_role} less {target_role} over time", _thinned(drawing["time"], "samples"))
        + f"{moving}</div><div>"
        + _chart(
            "loop",
            f"{measured_role} against {target_role}",
            f"{measured_role.capitalize()} against {target_role}, over the time shown. Dashed: perfect tracking. "
            "The loop opens by lag or lead; its slope is the amplitude.",
        )
        + _chart("running-errors", "Largest error and RMS error so far")
        + _chart("indicator", "Tracking indicator over time", f"TI rises while {measured_role} lags.{note}")
        + f"{energy}</div></div></section>"
    )


def _trusted_windows(a: Assessment) -> str:
    """What the caption says of the trusted estimate: windows with a number and an interval, and why not others."""
    m = a.trusted_moving
    if m is None:
        return ""
    n_intervals = int(np.count_nonzero(np.isfinite(m.delay_interval_s[:, 0])))
    text = (
        f" Trusted (least squares): {int(np.count_nonzero(m.valid))} windows with a number, {n_intervals} of them with "
        "a 95 % interval, drawn as a band."
    )
    counted = display.reasons(m)
    if not counted:
        return text
    items = "".join(f"<li>{n} \N{MULTIPLICATION SIGN} {escape(first)}</li>" for n, first in counted)
    return f'{text} What is missing, and why, in the words of the first:<ul data-field="moving_reasons">{items}</ul>'


def _frequency_charts(a: Assessment, drawing: Mapping[str, Any]) -> str:
    left = right = ""
    if drawing["spectrum"] is not None:
        left = _chart("spectra", "Amplitude spectra") + _chart(
            "weights",
            "Weights of the evaluation over frequency",
            "The share of each bin in the evaluation; all together make 1." + _thinned(drawing["spectrum"], "bins"),
        )
    if drawing["response"] is not None and a.response is not None:
        r = a.response
        text = (
            f"Welch's method: {r.n_segments} segments of {r.segment_s:.4g} s, {escape(r.window)} "
            f"window, aligned by {1e3 * r.align_s:.4g} ms. Grey: coherence below {display.LOW_COHERENCE}, not to be "
            "relied on. Band: 95 % interval, where the data support one. Dotted: A and d of the evaluation."
        )
        text += _slopes_caption(a)
        right = _chart("gain", "Gain over frequency") + _chart("delay", "Delay over frequency")
        right += _chart("coherence", "Coherence over frequency", text + _thinned(drawing["response"], "bins"))
    else:
        reason = _why(a.response_note) if a.response is None else "there is no frequency above zero"
        right = (
            f'<p class="absent" data-field="response">Gain, delay and coherence over frequency {NOT_DETERMINED}: '
            f"{escape(reason)}</p>"
        )
    views = ""
    if drawing["frequency"] is not None:
        views = '<div class="views" data-views="frequency"></div><p class="hint">Shaded: outside what was judged.</p>'
    return (
        f'<section class="charts"><div class="head"><h3>Over frequency</h3>{views}</div>'
        f'<div class="pairs"><div>{left}</div><div>{right}</div></div></section>'
    )


def _slopes_caption(a: Assessment) -> str:
    s = a.slopes
    if s is None:
        return f' <span data-field="slopes">No straight line over frequency: {escape(_why(a.slopes_note))}.</span>'
    varying = [name for name, varies in (("gain", s.gain_varies), ("delay", s.delay_varies)) if varies]
    what = f"{' and '.join(varying)} vary with frequency" if varying else "neither gain nor delay varies"
    what = what.replace("vary", "varies") if len(varying) == 1 else what
    slope = _number("delay_s_per_hz", s.delay_s_per_hz, "ms", 1e3)
    between = _interval("delay_s_per_hz_interval", s.delay_s_per_hz_interval, s.delay_s_per_hz, "ms", 1e3)
    return (
        f" Green: straight lines over the frequencies of the energy; {what}; the delay changes by {slope} a hertz"
        f"{f' ({between})' if between else ''}."
    )


def _settings_table(a: Assessment, version: str, created: datetime) -> str:
    settings = {**dataclasses.asdict(a.tracking.settings), **a.settings}
    rows = [
        ("file", "File", _source(a)),
        ("rate", "Rate", f"{a.rate_hz:.6g} Hz"),
        ("first_sample", "First sample at", f"{a.start_s:.6g} s"),
        ("duration", "Duration", f"{a.target.size / a.rate_hz:.6g} s"),
        ("unit", "Unit", a.unit or "not stated"),
    ]
    rows += [(name, *_setting(name, value)) for name, value in _flat(settings)]
    trusted = a.trusted.settings
    nearest = ""
    if trusted.expected_delay_s is not None:
        nearest = f", of turns that fit equally well the one nearest to {trusted.expected_delay_s:g} s"
    rows.append(
        (
            "trusted",
            "Trusted estimate",
            f"least squares, P = Q = 1, {trusted.window}, detrend {trusted.detrend}, {trusted.noise} noise, "
            f"delays up to {trusted.max_delay_s:g} s{nearest}",
        )
    )
    if a.response is not None:
        r = a.response
        text = (
            f"Welch, {r.n_segments} segments of {r.segment_s:.4g} s, overlap {r.overlap:g}, "
            f"{r.window}, detrend {r.detrend}, aligned by {1e3 * r.align_s:.4g} ms"
            f"{', corrected for dispersion' if r.dispersion else ''}"
        )
        rows.append(("response", "Frequency response", text))
    rows += [("program", "Program", f"rthstrack {version}"), ("created", "Written", f"{created:%Y-%m-%d %H:%M %Z}")]
    body = "".join(
        f'<tr><th scope="row">{escape(label)}</th><td data-setting="{escape(name)}">{escape(text)}</td></tr>'
        for name, label, text in rows
    )
    return f'<section class="settings"><h3>Settings</h3><table><tbody>{body}</tbody></table></section>'


def _footer() -> str:
    return """<footer><h2>Signs and words</h2>
<p>A delay above zero means that the measured signal <em>lags</em> the target (its phase is then negative); below zero
it leads. Amplitude is measured over target; 1 is perfect. The evaluation is the frequency-domain one of Guo, Chen, Xu
and Sanchez (2014), Smart Mater. Struct. 23 045042: one complex gain, the mean of measured over target with the weights
|target|<sup>l</sup>, gives the amplitude A and the phase; the delay is d = \N{MINUS SIGN}phase / (2π f_eq) at the
equivalent frequency f_eq, the mean frequency with the same weights. The trusted estimate is the amplitude and the
delay that minimise the squares of measured less the shifted, scaled target; its 95 % interval speaks of noise on the
measured signal, and is withheld where what the fit leaves still follows the target: gain and delay are then not one
number each.</p>
<p class="muted">Numbers here have four significant digits; the block <code>results</code> in the source of this page
holds them in full as JSON. Charts: uPlot 1.6.32, MIT licence, in the source.</p></footer>"""
