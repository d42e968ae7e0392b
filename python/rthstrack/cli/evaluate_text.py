"""What `rthstrack evaluate` prints."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

from rthstrack.cli.lines import Lines
from rthstrack.cli.setting_options import spoken
from rthstrack.values import quantile
from rthstrack.verdict import display
from rthstrack.verdict.display import with_interval
from rthstrack.verdict.sentence import reason

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rthstrack.evaluation.tracking import MovingTracking, Tracking
    from rthstrack.verdict.assessment import Assessment


_PARTS = {"whole": "", "compensator": "compensator: ", "actuator": "actuator: "}
_COLOURS = {"passed": "bold green", "exceeded": "bold red", "not_judged": "bold yellow"}
# In what least squares as asked for may differ from the trusted estimate.
_APART = {
    "detrend": "detrend",
    "data_decimation": "P =",
    "frequency_decimation": "Q =",
    "decimator": "decimator",
    "weight_power": "weight power",
}


def print_text(results: Sequence[Sequence[Assessment]], n_files: int, n_failed: int, sort: str) -> None:
    """Prints one file's results in full, many files' in a table, and one closing line where limits were given."""
    out = Lines()
    found = [a for one in results for a in one]
    if n_files == 1:
        several = len({a.actuator for a in found}) > 1
        for a in found:
            _print_one(out, a, several=several)
        if several:
            from rthstrack.cli.evaluate_many import print_closing

            print_closing(out, found, [called(a) for a in found], 0)
    elif found:
        from rthstrack.cli.evaluate_many import print_many

        # A table is as wide as it is told to be, in a pipe too.
        if "COLUMNS" in os.environ:
            out.width = out.told_width()
        print_many(out, found, n_failed, sort)


def called(a: Assessment) -> str:
    """An actuator's number and name, as people read them."""
    return f"actuator {a.actuator_number} ({a.actuator_name})"


def _print_one(out: Lines, a: Assessment, *, several: bool) -> None:
    t = a.tracking
    which = f"{called(a)}: " if several else ""
    out.line((f"{which}{_PARTS[a.part]}{a.verdict}", "bold"))
    out.line(spoken(a.argument))
    _print_side_by_side(out, a)
    band = "" if a.tracking.settings.band_hz is None else f", band {t.settings.band_hz}"
    rows = (
        ("file", f"{a.file}, {t.n_samples} samples at {a.rate_hz:g} Hz ({a.settings.get('rate_source', 'given')})"),
        ("target, measured", f"{a.target_name}, {a.measured_name}"),
        ("phase", _number(math.degrees(float(t.phase_rad)), ".5g", " degrees")),
        ("judged at", "the mean frequency of the motion, weighted by its energy (equivalent frequency)"),
        ("frequency bins", f"{t.n_bins}, every {t.delta_f_hz:.4g} Hz{band}"),
        *_reason_rows(a),
        *([("P and Q chosen", a.factors.sentence)] if a.factors else []),
        *([("a larger Q", a.factors.windowed.sentence)] if a.factors and a.factors.windowed else []),
        *_moving_rows(a),
        *_index_rows(a),
        *([("structure", a.loop.sentence)] if a.loop else []),
    )
    out.table(rows)
    for warning in a.warnings:
        out.line((f"warning: {spoken(warning)}", "yellow"))
    if a.outcome is not None:
        out.line((a.conclusion, _COLOURS[a.outcome]))
    out.line()


def _print_side_by_side(out: Lines, a: Assessment) -> None:
    """The judged estimate, the trusted and the published one, with their 95 % intervals as far as there are any."""
    columns: list[Tracking] = []
    for t in (a.tracking, a.trusted, a.published):
        if not any(t is one for one in columns):
            columns.append(t)
    rows = [
        ("amplitude", [_estimate(float(t.amplitude), t.amplitude_interval) for t in columns]),
        (
            "delay",
            [_estimate(1e3 * float(t.delay_s), [1e3 * end for end in t.delay_interval_s], "ms") for t in columns],
        ),
        ("judged at", [_number(float(t.equivalent_frequency_hz), ".5g", " Hz") for t in columns]),
    ]
    out.table([(label, *cells) for label, cells in rows], ("", *(_heading(a, t) for t in columns)))


def _heading(a: Assessment, t: Tracking) -> str:
    """What an estimate is called; two of least squares with the settings in which they differ."""
    apart = ""
    if a.tracking.settings.estimator == "least_squares" and t.settings.estimator == "least_squares":
        ours, theirs = a.tracking.settings, a.trusted.settings
        apart = ", ".join(
            f"{label} {getattr(t.settings, name)}"
            for name, label in _APART.items()
            if getattr(ours, name) != getattr(theirs, name)
        )
    if t is a.trusted:
        return f"trusted (least squares{apart and f', {apart}'}), 95 % interval"
    return f"least squares as asked for ({apart})" if apart else display.estimator_in_full(t.settings.estimator)


def _estimate(value: float, interval: Iterable[float], unit: str = "") -> str:
    low, high = interval
    if math.isfinite(value) and not math.isfinite(high - low):
        return f"{value:.6g} {unit}".rstrip()
    return with_interval(value, (low, high), unit)


def _number(value: float, layout: str, unit: str) -> str:
    return f"{value:{layout}}{unit}" if math.isfinite(value) else "not determined"


def _windows_text(a: Assessment, moving: MovingTracking) -> str:
    import numpy as np

    known = moving.valid & np.isfinite(moving.delay_s)
    if not known.any():
        return f"no window could be judged{_most_frequent(moving)}"
    delays, amplitudes = 1e3 * moving.delay_s[known], moving.amplitude[known]
    (low, high), (small, large) = ([quantile(one, share) for share in (0.1, 0.9)] for one in (delays, amplitudes))
    return (
        f"of {moving.window_s:g} s{_moving_factors(a, moving)}: delay {low:.4g} to {high:.4g} ms, "
        f"amplitude {small:.4g} to {large:.4g} (the middle 80 % of {known.sum()} readings)"
    )


def _most_frequent(moving: MovingTracking) -> str:
    counted = display.reasons(moving)
    return f": {counted[0][1]}" if counted else ""


def _reason_rows(a: Assessment) -> list[tuple[str, str]]:
    """Why a number or an interval is missing, each reason once."""
    rows = {}
    for t in (a.tracking, a.trusted, a.published):
        if why := reason(t):
            rows[why] = ("not determined" if math.isnan(float(t.delay_s)) else "no interval", why.cause)
    return list(rows.values())


def _index_rows(a: Assessment) -> list[tuple[str, str]]:
    """The indices that there are, each with a word of what it is."""
    own = {"unit": a.unit, "unit2": f"{a.unit}^2" if a.unit else None}
    target, measured = display.signal_roles(a.part)
    rows = []
    for _, field, unit, scale, percent, meaning, name in display.INDICES:
        value = getattr(a.indices, field)
        if value is None:
            continue
        text = f"{scale * value:{'.3g' if unit == '%' else '.4g'}} {own.get(unit, unit) or ''}".rstrip()
        share = "" if percent is None else f"{getattr(a.indices, percent):.3g} % "
        rows.append((name, f"{text} ({share}{meaning.format(target=target, measured=measured)})"))
    return rows


def _moving_rows(a: Assessment) -> list[tuple[str, str]]:
    if a.moving is None:
        return [("moving windows", a.moving_note or "")]
    rows = [("moving windows", _windows_text(a, a.moving))]
    if a.trusted_moving is not None and a.trusted_moving is not a.moving:
        rows.append(("trusted, in windows", _windows_text(a, a.trusted_moving)))
    return rows


def _moving_factors(a: Assessment, moving: MovingTracking) -> str:
    """P and Q of the windows, where others were chosen for the record."""
    if a.factors is None or moving is not a.moving:
        return ""
    s = moving.settings
    return f" at P = {s.data_decimation}, Q = {s.frequency_decimation}"
