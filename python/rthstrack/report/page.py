"""One self-contained HTML page from one or several assessments.

The page takes what an `Assessment` holds and computes nothing. It loads nothing from a network: style, scripts and
samples are inside, and a content security policy forbids anything else. Texts from files are escaped everywhere.
"""

from __future__ import annotations

import dataclasses
import json
import math
import re
from collections import Counter
from datetime import datetime
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack._core import __version__
from rthstrack.assets import asset, digest
from rthstrack.errors import SettingError
from rthstrack.report.drawing import Blocks, _signal, drawings
from rthstrack.report.record import NOT_DETERMINED, _reasons, _why, result_record
from rthstrack.report.written import _interval, _number, _setting, flat
from rthstrack.verdict import display
from rthstrack.verdict.assessment import Assessment
from rthstrack.verdict.limits import CONCLUSIONS
from rthstrack.verdict.order import HAPPENED, in_order
from rthstrack.verdict.sentence import reason

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence


def write_report(assessments: Assessment | Sequence[Assessment], path: str | Path) -> None:
    """Write the HTML report of one or several assessments to `path`.

    Above 200,000 samples a trace is drawn by the extremes of groups of samples, and the page says so; several records
    share 120,000. The page's numbers are the assessments' own. Errors: SettingError without an assessment, or where the
    file cannot be written.
    """
    page = report_html(assessments)
    try:
        Path(path).write_text(page, encoding="utf-8", errors="replace", newline="\n")
    except OSError as error:
        raise SettingError(
            f"{path}: cannot write the report there ({error.strerror}); name a file in an existing, writable folder"
        ) from error


def report_html(assessments: Assessment | Sequence[Assessment]) -> str:
    """The text of the page that `write_report` writes."""
    if isinstance(assessments, Assessment):
        assessments = [assessments]
    if not assessments:
        raise SettingError("a report needs at least one assessment, none was given; evaluate a recording first")
    blocks = Blocks()
    drawing = drawings(assessments, blocks)
    version, created = __version__, datetime.now().astimezone()
    results = {
        "program": {"name": "rthstrack", "version": version},
        "created": created.isoformat(timespec="seconds"),
        "results": [result_record(assessment) for assessment in assessments],
    }
    style = "\n".join(asset(name) for name in ("uPlot.min.css", "charts.css", "report.css"))
    licence = f"/*! uPlot 1.6.32\n{asset('uPlot.LICENSE').strip()}\n*/\n"
    scripts = [licence + asset("uPlot.iife.min.js"), asset("charts.js"), asset("report.js")]
    policy = (
        f"default-src 'none'; img-src data:; style-src {digest(style)}; "
        f"script-src {' '.join(digest(script) for script in scripts)}; base-uri 'none'; form-action 'none'"
    )
    several = len(assessments) > 1
    title = _title(assessments)
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


def _title(assessments: Sequence[Assessment]) -> str:
    """What became of the limits where there are some, and the judged numbers: of one pair, or the range of several."""
    outcomes = Counter(a.outcome for a in assessments if a.outcome is not None)
    worst = next((state for state in HAPPENED if outcomes[state]), None)
    opening = "" if worst is None else f"{CONCLUSIONS[worst]} \N{MIDDLE DOT} "
    amplitude, delay = (
        _range([factor * float(getattr(a.tracking, name)) for a in assessments], unit)
        for name, factor, unit in (("amplitude", 1.0, ""), ("delay_s", 1e3, " ms"))
    )
    numbers = f"delay {delay}, amplitude {amplitude}"
    if len(assessments) == 1:
        return f"{opening}{Path(_source(assessments[0])).name}: {numbers}"
    n_files = len({a.file for a in assessments})
    what = f"{len(assessments)} pairs in {n_files} {'file' if n_files == 1 else 'files'}"
    told = ", ".join(
        f"{outcomes[state]} {words[outcomes[state] > 1]}" for state, words in HAPPENED.items() if outcomes[state]
    )
    return f"{opening}{what}: {told or numbers}"


def _range(values: Sequence[float], unit: str) -> str:
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return NOT_DETERMINED
    ends = dict.fromkeys(display.significant(value) for value in (min(known), max(known)))
    return f"{' to '.join(ends)}{unit}"


def _json_block(name: str, content: Any) -> str:
    """A JSON script block. With every < written as an escape, no text in it can end the block or open another."""
    text = json.dumps(content, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return f'<script type="application/json" id="{name}">{text.replace("<", chr(92) + "u003c")}</script>'


_OUTCOMES = {
    None: "",
    "passed": "within limits",
    "exceeded": '<strong class="exceeded">limit exceeded</strong>',
    "not_judged": '<strong class="not_judged">cannot be judged</strong>',
}


def _source(a: Assessment) -> str:
    """The file, or words for samples that did not come from one."""
    return a.file or "samples given in Python"


# A tab's name of a file is cut to this, in the middle; table and heading have it whole.
_TAB_NAME = 28


def _name(a: Assessment, several_files: bool, several_actuators: bool) -> str:
    parts = [display.shortened(Path(_source(a)).name, _TAB_NAME)] if several_files else []
    if several_actuators or not several_files:
        parts.append(f"actuator {a.actuator_number} ({a.actuator_name})")
    if a.part != "whole":
        parts.append(a.part)
    return " · ".join(parts)


def _always(_: Sequence[Assessment]) -> bool:
    return True


@dataclasses.dataclass(frozen=True, slots=True)
class _Column:
    """A column of the summary: what a row says, what it is sorted by, and of which assessments it says something."""

    head: str
    html: Callable[[Assessment], str]
    key: Callable[[Assessment], float | str]
    is_shown: Callable[[Sequence[Assessment]], bool] = _always
    is_number: bool = True
    css: str = ""


def _number_column(
    head: str,
    field: str,
    of: Callable[[Assessment], float],
    factor: float = 1.0,
    is_shown: Callable[[Sequence[Assessment]], bool] = _always,
    css: str = "",
) -> _Column:
    return _Column(head, lambda a: _number(field, of(a), factor=factor), of, is_shown, css=css)


def _between(a: Assessment) -> str:
    t = a.tracking
    text = _interval("delay_interval_s", t.delay_interval_s, float(t.delay_s), factor=1e3)
    return text.removeprefix("95 %: ") or "none"


def _width(a: Assessment) -> float:
    return float(a.tracking.delay_interval_s[1] - a.tracking.delay_interval_s[0])


def _differs(key: Callable[[Assessment], Any]) -> Callable[[Sequence[Assessment]], bool]:
    """Whether it is not the same in all rows."""
    return lambda found: len({key(a) for a in found}) > 1


_OUTCOME_ORDER = {"exceeded": 0.0, "not_judged": 1.0, "passed": 2.0, None: 3.0}
_COLUMNS = (
    _Column("Outcome", lambda a: _OUTCOMES[a.outcome], lambda a: _OUTCOME_ORDER[a.outcome],
            lambda found: any(a.outcome for a in found), is_number=False),
    _Column("Actuator", lambda a: f"{a.actuator_number} {escape(a.actuator_name)}", lambda a: a.actuator,
            _differs(lambda a: a.actuator), is_number=False),
    _Column("Part", lambda a: escape(a.part), lambda a: a.part, _differs(lambda a: a.part), is_number=False),
    _number_column("Amplitude", "amplitude", lambda a: float(a.tracking.amplitude)),
    _number_column("Delay (ms)", "delay_s", lambda a: float(a.tracking.delay_s), 1e3),
    _Column("95 % interval", _between, _width, lambda found: any(math.isfinite(_width(a)) for a in found),
            css="between"),
    _number_column("Worst window (ms)", "worst_window_delay_s", lambda a: a.largest_delay_s, 1e3,
                   lambda found: any(a.moving is not None for a in found)),
    # What stands beside the judged estimate, where that is another.
    _number_column("Trusted delay (ms)", "trusted_delay_s", lambda a: float(a.trusted.delay_s), 1e3,
                   lambda found: any(a.tracking is not a.trusted for a in found)),
    _number_column("Published delay (ms)", "published_delay_s", lambda a: float(a.published.delay_s), 1e3,
                   lambda found: any(a.tracking is not a.published for a in found)),
    _number_column("At (Hz)", "equivalent_frequency_hz", lambda a: float(a.tracking.equivalent_frequency_hz),
                   css="minor"),
    _number_column("RMS error (%)", "rms_error_percent", lambda a: a.indices.rms_error_percent),
    _Column("Signals", lambda a: f"{escape(a.target_name)} → {escape(a.measured_name)}", lambda a: a.target_name,
            _differs(lambda a: (a.target_name, a.measured_name)), is_number=False, css="minor"),
    _Column("Warnings", lambda a: str(len(a.warnings) or ""), lambda a: len(a.warnings),
            lambda found: any(a.warnings for a in found), css="minor"),
)  # fmt: skip


def _summary(assessments: Sequence[Assessment]) -> str:
    """The table of all, one row an assessment, the worst first; its heads sort it, its field filters it."""
    columns = [column for column in _COLUMNS if column.is_shown(assessments)]
    places: dict[int, list[int]] = {}
    for number, a in enumerate(assessments):
        places.setdefault(id(a), []).append(number)
    names = _short_names(assessments)
    rows = []
    for a in in_order(assessments):
        number = places[id(a)].pop(0)
        cells = "".join(
            f'<td class="{"number" if column.is_number else ""} {column.css}" {_sort_key(column.key(a))}>'
            f"{column.html(a)}</td>"
            for column in columns
        )
        rows.append(
            f'<tr data-assessment="{number}"><th scope="row" {_sort_key(names[number])} title="{escape(_source(a))}">'
            f'<a href="#assessment-{number}">{_breakable(names[number])}</a></th>{cells}</tr>'
        )
    heads = "".join(
        f'<th scope="col" class="{css}"><button type="button">{escape(text)}</button></th>'
        for text, css in (
            ("File", ""), *((column.head, f"{'number' if column.is_number else ''} {column.css}") for column in columns)
        )
    )  # fmt: skip
    return (
        '<section class="summary"><div class="head"><h2>Summary</h2>'
        '<label>Search <input type="search" data-filter aria-controls="summary-rows"></label>'
        f'<output data-matches>{len(rows)} of {len(rows)}</output></div><div class="scroll"><table>'
        f"<caption>Worst first: limits that were not kept, then the largest error. A head sorts.</caption>"
        f'<thead><tr>{heads}</tr></thead><tbody id="summary-rows">{"".join(rows)}</tbody></table></div></section>'
    )


def _sort_key(value: float | str) -> str:
    """What a cell is sorted by; a number that is not determined comes last either way."""
    if isinstance(value, str):
        return f'data-sort="{escape(value)}"'
    return f'data-sort="{float(value)!r}"' if math.isfinite(value) else 'data-sort=""'


def _short_names(assessments: Sequence[Assessment]) -> list[str]:
    """The files without the folder that all are in."""
    files = [_source(a) for a in assessments]
    folders = {str(Path(file).parent) for file in files}
    return [Path(file).name for file in files] if len(folders) == 1 else files


def _breakable(name: str) -> str:
    """A name that may go on in the next line behind its signs, rather than be cut."""
    return re.sub(r"([_\-./\\])", r"\1<wbr>", escape(name))


def _tabs(assessments: Sequence[Assessment]) -> str:
    several_files = len({a.file for a in assessments}) > 1
    several_actuators = len({(a.file, a.actuator) for a in assessments}) > len({a.file for a in assessments})
    tabs = "".join(
        f'<button type="button" role="tab" id="tab-{number}" aria-controls="assessment-{number}" '
        f'aria-selected="{str(number == 0).lower()}" tabindex="{0 if number == 0 else -1}" '
        f'title="{escape(_source(a))}">'
        f"{'<span class=mark aria-label=&quot;limit exceeded&quot;>▲</span> ' if a.exceeded else ''}"
        f"{escape(_name(a, several_files, several_actuators))}</button>"
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
        escape(f"actuator {a.actuator_number} ({a.actuator_name})") + (f", {what}" if what else ""),
        f"{escape(_signal(target_role, a.target_name))} → {escape(_signal(measured_role, a.measured_name))}",
        f"{_number('n_samples', int(a.target.size))} samples at {a.rate_hz:.6g} Hz",
    ]
    return (
        f'<p class="facts">{" · ".join(facts)}</p>'
        f'<h2 class="verdict" data-field="verdict">{escape(a.verdict)}</h2>'
        f'<p class="argument" data-field="argument">{escape(a.argument)}</p>'
        f"{_trusted_reason(a)}{_conclusion(a)}"
    )


def _conclusion(a: Assessment) -> str:
    """The closing line of the limits, and what the delay does to the structure."""
    line = ""
    if a.outcome is not None:
        line = f'<p class="conclusion {a.outcome}" data-field="conclusion">{escape(a.conclusion)}</p>'
    if a.loop is not None:
        line += f'<p class="argument" data-field="loop">Structure: {escape(a.loop.sentence)}.</p>'
    return line


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
            _limit(a, "amplitude", "1 \N{PLUS-MINUS SIGN} "),
        ),
        (
            "Delay d",
            _number("delay_s", delay_s, "ms", 1e3, reasons.get("delay_s")),
            _beside(a, "delay_s", sense if math.isfinite(delay_s) else ""),
            _limit(a, "delay", "\N{PLUS-MINUS SIGN}", "ms", 1e3) + _limit(a, "critical_delay", "critical, ", "ms", 1e3),
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
    """What the tile's number is, its interval if it has one, and what stands beside it with its own."""
    t = a.beside
    which = "trusted" if t is a.trusted else "published"
    unit, factor = ("ms", 1e3) if name == "delay_s" else ("", 1.0)
    field = "delay_interval_s" if name == "delay_s" else "amplitude_interval"
    parts = [f"{display.ESTIMATORS[a.tracking.settings.estimator]}; {note}".removesuffix("; ")]
    own = float(getattr(a.tracking, name))
    if a.tracking.settings.estimator != "fei" and math.isfinite(own):
        parts.append(_interval(field, getattr(a.tracking, field), own, unit, factor) or "no interval")
    value = float(getattr(t, name))
    parts.append(f"{which}: {_number(f'{which}_{name}', value, unit, factor)}")
    if which == "trusted":
        between = _interval(f"trusted_{field}", getattr(t, field), value, unit, factor)
        parts.append(between or ("no interval" if math.isfinite(value) else ""))
    return "<br>".join(part for part in parts if part)


def _limit(a: Assessment, name: str, sign: str, unit: str = "", factor: float = 1.0) -> str:
    """A limit of a tile's number, and what became of it."""
    gate = next((gate for gate in a.gates if gate.name == name), None)
    if gate is None:
        return ""
    field = f"limit_{name}" + ("_s" if unit else "")
    state = {
        "passed": "kept",
        "exceeded": '<strong class="exceeded">\N{BLACK UP-POINTING TRIANGLE} exceeded</strong>',
        "not_judged": '<strong class="not_judged">cannot be judged</strong>',
    }[gate.state]
    limit = gate.limit
    allowed = f'<data data-field="{field}" value="{limit!r}">{limit * factor:.4g}{" " if unit else ""}{unit}</data>'
    return f'<small>limit {sign}{allowed}: <span data-field="{field}_state">{state}</span></small>'


def _index_tiles(a: Assessment, target_role: str, measured_role: str, reasons: Mapping[str, str]) -> str:
    units = {"unit": a.unit or "", "unit2": f"{a.unit}²" if a.unit else ""}
    tiles = []
    for name, field, unit, factor, percent, meaning, _ in display.INDICES:
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
        if any(drawing["over"].values()):
            text += " Orange: over a limit, by the whole interval."
        moving = _chart("moving-amplitude", "Amplitude over time")
        moving += _chart(
            "moving-delay", "Delay over time", text + _trusted_windows(a) + _thinned(drawing["moving"], "windows")
        )
    if drawing["both"] is not None:
        moving += _both_charts(drawing["both"])
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


def _both_charts(both: Mapping[str, Any]) -> str:
    first, last = both["window_s"]
    text = (
        "Gain and delay change over time and frequency: Welch's method in half octaves, on windows of "
        f"{first:.3g} s (high frequencies) to {last:.3g} s (low ones), drawn at their centres. Empty: coherence below "
        f"{both['least_coherence']:g}, or no window."
    )
    return _chart("both-gain", "Gain over time and frequency") + _chart(
        "both-delay", "Delay over time and frequency", text
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
            f"window, aligned by {1e3 * r.align_s:.4g} ms. Grey: coherence below {display.DRAWN_GREY_BELOW}, not to be "
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
    rows += [(name, *_setting(name, value)) for name, value in flat(settings)]
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
