"""How near the estimates of gain and delay come to the truth, and how often their intervals hold it: `make accuracy`.

Writes docs/accuracy.md and its figures. Every row that was asked for stands in the first table with what was measured,
met or missed. Truth comes from virtual tests; limits from reference/estimate_twin.py. Noise is drawn from one seeded
generator a case, so that the tables are the same at every run.

    python benchmarks/accuracy.py [--short] [--twin] [--draws N] [--only SECTION ...] [--out FOLDER]

--short: few draws and records, for a test. --twin: the estimators of the twin in place of the package's.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import os
import platform
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from matplotlib.figure import Figure
from numpy.typing import NDArray

import rthstrack
from rthstrack import plots
from rthstrack.ground_motion import list_records, record
from rthstrack.reproduction.cases import linear, nonlinear
from rthstrack.virtual_test import VirtualTest, simulate

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared"
for folder in (ROOT / "reference", ROOT / "benchmarks"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import estimate_twin as twin  # noqa: E402 (the folders above are needed for it)
import generic_delay  # noqa: E402
from hostile import unit_noise  # noqa: E402

Floats = NDArray[np.float64]

WINDOW_S, HOP_S = 4.0, 0.25
WINDOWS = ("boxcar", "hann", "hamming", "blackman", "flattop", "tukey")
HANN: dict[str, Any] = {"window": "hann"}
#: The bounds that estimates are held against are those of samples from which nothing is subtracted.
PLAIN: dict[str, Any] = {"detrend": "none"}
#: What is compared, by the names of the tables.
OURS: dict[str, dict[str, Any]] = {
    "`least_squares`": {"estimator": "least_squares"},
    "`least_squares`, Hann": {"estimator": "least_squares", **HANN},
    "`aligned`": {"estimator": "aligned"},
    "`aligned`, Hann": {"estimator": "aligned", **HANN},
    "`fei`": {"estimator": "fei"},
    "`fei`, Hann": {"estimator": "fei", **HANN},
}
JUDGED = "`least_squares`"
DRAWS, SHORT_DRAWS = 1000, 40
CHUNK = 8  # draws of noise that are in memory at once
GENERIC_WINDOWS = 3  # windows of a draw that the generic estimators, which are slow, are given


@dataclass(frozen=True)
class Pair:
    """A target and what was measured of it, with the truth. `name` is for the tables."""

    name: str
    target: Floats
    measured: Floats
    rate_hz: float
    amplitude: float
    delay_s: float

    @property
    def windows(self) -> list[int]:
        """Of the windows that follow each other, those whose target has over 5 % of the record's deviation."""
        W = round(WINDOW_S * self.rate_hz)
        starts = range(0, len(self.target) - W + 1, W)
        least = 0.05 * np.std(self.target)
        return [i for i, s in enumerate(starts) if np.std(self.target[s : s + W]) >= least]

    @cached_property
    def between(self) -> twin.Target:
        """The target, readable between its samples."""
        return twin.Target(self.target, self.rate_hz)

    def limits(self, std: float, coefficient: float = 0.0) -> Floats:
        """Cramer-Rao bounds of (gain, delay), (1 + windows, 2): the whole record, then `windows`.

        `coefficient` of first-order autoregressive noise of standard deviation `std`: whitened, it is white.
        """
        W = round(WINDOW_S * self.rate_hz)
        innovation = std * np.sqrt(1 - coefficient**2)
        whitening = (1.0, -coefficient) if coefficient else (1.0,)
        spans = [(0, len(self.target))] + [(i * W, i * W + W) for i in self.windows]
        cases = [twin.Case(self.between, self.measured, *span, whitening=whitening) for span in spans]
        return np.array([twin.cramer_rao(case, self.amplitude, self.delay_s, innovation) for case in cases])


@dataclass(frozen=True)
class Row:
    """One thing asked for: `met` None where it is only reported. `value` is what a test looks at."""

    case: str
    asked: str
    measured: str
    met: bool | None = None
    value: float = np.nan


@dataclass
class Run:
    """What the sections share: the functions under test, how much is computed, and what has been found."""

    tool: Any
    short: bool
    draws: int
    out: Path
    pool: ThreadPoolExecutor
    rows: list[Row] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    def asked(self, case: str, asked: str, measured: str, met: bool | None = None, value: float = np.nan) -> None:
        """A row of the first table."""
        self.rows.append(Row(case, asked, measured, None if met is None else bool(met), float(value)))

    def say(self, *lines: str) -> None:
        """Lines of the text, an empty one after them."""
        self.lines += [*lines, ""]

    def table(self, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """A table: text in the first column, numbers after it."""
        self.say(
            "| " + " | ".join(header) + " |",
            "| --- |" + " ---: |" * (len(header) - 1),
            *("| " + " | ".join(row) + " |" for row in rows),
        )

    def save(self, page: Figure, name: str, caption: str) -> None:
        """A figure beside the text."""
        page.savefig(self.out / f"accuracy-{name}.png", dpi=150)
        self.say(f"![{caption}](accuracy-{name}.png)")

    def evaluate(self, target: Floats, measured: Floats, rate_hz: float, settings: dict[str, Any]) -> Floats:
        """Gain and delay with their intervals, (6,): gain, low, high, delay, low, high; NaN where not determined."""
        return self._numbers(self.tool.evaluate(target, measured, rate_hz, **PLAIN | settings), ())

    def moving(
        self, target: Floats, measured: Floats, rate_hz: float, settings: dict[str, Any], hop_s: float = WINDOW_S
    ) -> Floats:
        """The same of moving windows, (n, 6)."""
        found = self.tool.evaluate_moving(
            target, measured, rate_hz, window_s=WINDOW_S, hop_s=hop_s, minimum_std_ratio=0.05, **PLAIN | settings
        )
        return self._numbers(found, (len(found.time_s),))

    @staticmethod
    def _numbers(found: Any, shape: tuple[int, ...]) -> Floats:
        # The published estimate has no interval.
        no_interval = np.full((*shape, 2), np.nan)
        columns: list[Any] = []
        for value, interval in (("amplitude", "amplitude_interval"), ("delay_s", "delay_interval_s")):
            around = getattr(found, interval, None)
            around = no_interval if around is None else np.asarray(around, dtype=np.float64)
            columns += [np.asarray(getattr(found, value)), around[..., 0], around[..., 1]]
        return np.stack(columns, axis=-1).astype(np.float64)

    def repeat(
        self, seed: int, shape: tuple[int, ...], judge: Callable[[Floats], Floats], coefficient: float = 0.0
    ) -> Floats:
        """What `judge` makes of each draw of noise of unit deviation, (draws, ...)."""
        rng = np.random.Generator(np.random.PCG64(seed))
        found: list[Floats] = []
        while len(found) < self.draws:
            noise = [unit_noise(rng, shape, coefficient) for _ in range(min(CHUNK, self.draws - len(found)))]
            found += self.pool.map(judge, noise)
        return np.array(found)


def moments(draws: Floats) -> tuple[Floats, Floats, Floats]:
    """Mean, standard deviation and root mean square over the draws that are determined; NaN where there are none."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of columns in which no draw is
        mean, std = np.nanmean(draws, axis=0), np.nanstd(draws, axis=0, ddof=1)
        return mean, std, np.sqrt(np.nanmean(draws**2, axis=0))


# What is judged -------------------------------------------------------------------------------------------------------

LINEAR, BOUC_WEN = "linear", "Bouc-Wen"


def tested(kind: str, number: int, component: str) -> Pair:
    """A far-field record through one of the paper's structures; CHY101-N for the paper's 90 s."""
    test: VirtualTest = linear() if kind == LINEAR else nonlinear()
    motion = record(number, component)
    run = simulate(test, motion, duration_s=90.0 if motion.name == "CHY101-N" else None)
    actuator = test.actuators[0]
    assert isinstance(actuator.delay_s, float)
    return Pair(f"{kind}, {motion.name}", run.target, run.measured, run.rate_hz, actuator.gain, actuator.delay_s)


def reference_pair() -> Pair | None:
    """The Bouc-Wen pair kept beside the repository, where it is."""
    path = SHARED / "reference" / "chy101n_boucwen.npz"
    if not path.is_file():
        return None
    with np.load(path) as kept:
        target, measured, rate_hz = kept["target"], kept["measured"], float(kept["rate_hz"])
    return Pair("Bouc-Wen, CHY101-N, reference file", target, measured, rate_hz, 1.1, 0.005)


def chy101n() -> list[Pair]:
    """CHY101-N, Bouc-Wen: simulated here, and the reference file."""
    kept = reference_pair()
    return [tested(BOUC_WEN, 19, "b"), *([kept] if kept else [])]


# Without noise --------------------------------------------------------------------------------------------------------


def whole_records(run: Run) -> None:
    """Section a: the whole record, every window function."""
    run.say("## Whole record, no noise")
    for pair in chy101n():
        run.say(
            f"{pair.name}: gain {pair.amplitude:g}, delay {1e6 * pair.delay_s:g} us. Errors of delay, us, and gain."
        )
        rows = []
        for window in WINDOWS:
            cells = [window]
            for estimator in ("least_squares", "aligned", "fei"):
                found = run.evaluate(
                    pair.target, pair.measured, pair.rate_hz, {"estimator": estimator, "window": window}
                )
                gain, delay = found[0] - pair.amplitude, 1e6 * (found[3] - pair.delay_s)
                cells += [f"{delay:.3g}", f"{gain:.2g}"]
            rows.append(cells)
        names = ("`least_squares`", "gain", "`aligned`", "gain", "`fei`", "gain")
        run.table(["window", *names], rows)
        generic = [
            [name, f"{1e6 * (estimator(pair.target, pair.measured, pair.rate_hz) - pair.delay_s):.3g}"]
            for name, estimator in generic_delay.ESTIMATORS.items()
        ]
        run.table(["generic estimator", "error of delay, us"], generic)
        _asked_of_wholes(run, pair.name, whole_errors(run, pair))


def whole_errors(run: Run, pair: Pair) -> Floats:
    """Largest error of delay, us, and of gain over every window function, `least_squares` and `aligned`, (2,)."""
    settings = [{"estimator": e, "window": w} for e in ("least_squares", "aligned") for w in WINDOWS]
    found = np.array(
        list(run.pool.map(lambda one: run.evaluate(pair.target, pair.measured, pair.rate_hz, one), settings))
    )
    errors = np.abs(np.column_stack([1e6 * (found[:, 3] - pair.delay_s), found[:, 0] - pair.amplitude]))
    return np.asarray(np.max(np.where(np.isnan(errors), np.inf, errors), axis=0))


def window_errors(run: Run, pair: Pair, generic: bool = True) -> tuple[Floats, dict[str, Floats]]:
    """Times of the windows judged and, by estimator, their delay errors over the delay; NaN: not determined."""
    W, H = round(WINDOW_S * pair.rate_hz), round(HOP_S * pair.rate_hz)
    starts = np.arange(0, len(pair.target) - W + 1, H)
    stds = np.array([np.std(pair.target[s : s + W]) for s in starts])
    judged = np.flatnonzero(stds >= 0.05 * np.std(pair.target))

    def ours(settings: dict[str, Any]) -> Floats:
        return np.asarray(run.moving(pair.target, pair.measured, pair.rate_hz, settings, HOP_S)[judged, 3])

    def theirs(estimator: Callable[..., float]) -> Floats:
        cuts = [slice(s, s + W) for s in starts[judged]]
        return np.array([estimator(pair.target[cut], pair.measured[cut], pair.rate_hz) for cut in cuts])

    found = dict(zip(OURS, run.pool.map(ours, OURS.values()), strict=True))
    if generic:
        estimators = generic_delay.ESTIMATORS
        found |= dict(zip(estimators, run.pool.map(theirs, estimators.values()), strict=True))
    time_s = np.asarray((starts[judged] + (W - 1) / 2) / pair.rate_hz, dtype=np.float64)
    return time_s, {n: d / pair.delay_s - 1 for n, d in found.items()}


def _window_table(run: Run, errors: dict[str, Floats], where: Sequence[str]) -> Floats:
    """Shares and worst windows by estimator; returns the judged estimator's (share failing, worst, undetermined)."""
    rows, judged = [], np.zeros(3)
    for name, values in errors.items():
        size = np.abs(values)
        none = np.isnan(size)
        failing = np.mean(~(size <= 0.01))
        worst = int(np.nanargmax(size)) if not none.all() else 0
        rows.append(
            [
                name,
                f"{len(size)}",
                f"{100 * failing:.3g} %",
                f"{100 * np.nanmedian(size):.2g} %",
                f"{100 * size[worst]:.3g} %",
                where[worst],
                f"{none.sum()}",
            ]
        )
        if name == JUDGED:
            judged = np.array([failing, size[worst], none.sum()])
    header = ["estimator", "windows", "over 1 %", "median error", "worst", "where", "not determined"]
    run.table(header, rows)
    return judged


def _asked_of_wholes(run: Run, name: str, worst: Floats) -> None:
    case = f"{name}, whole, any window, no noise"
    run.asked(f"{case}: delay error", "<= 0.5 us", f"{worst[0]:.2g} us", worst[0] <= 0.5)
    run.asked(f"{case}: gain error", "<= 1e-5", f"{worst[1]:.2g}", worst[1] <= 1e-5)


def _asked_of_windows(run: Run, case: str, judged: Floats) -> None:
    failing, worst, undetermined = judged
    run.asked(
        f"{case}: delay error",
        "<= 1 % in every window",
        f"worst {100 * worst:.2g} %, {100 * failing:.3g} % of windows over, {undetermined:.0f} not determined",
        failing == 0,
    )


def short_windows(run: Run) -> None:
    """Sections b and c: every 4 s window, CHY101-N and other records through both structures."""
    run.say(
        "## Windows of 4 s, no noise",
        f"Every window whose target's standard deviation exceeds 5 % of the record's, one every {HOP_S:g} s. A window"
        " that is not determined counts as over 1 %.",
    )
    pairs = chy101n()
    for pair in pairs:
        time_s, errors = window_errors(run, pair)
        run.say(f"### {pair.name}")
        judged = _window_table(run, errors, [f"{t:.1f} s" for t in time_s])
        _asked_of_windows(run, f"{pair.name}, 4 s windows", judged)
        if pair is pairs[0]:
            _windows_figure(run, pair, time_s, errors)
    numbers = [(1, "a"), (1, "b")] + [(n, "a") for n in range(2, 22)]
    if run.short:
        numbers = numbers[:2]
    known = {(r.number, r.component): r.name.rpartition("/")[2] for r in list_records("farfield")}
    for kind in (LINEAR, BOUC_WEN):
        pooled: dict[str, list[Floats]] = {}
        where: list[str] = []
        worst = np.zeros(2)
        for number, component in numbers:
            pair = tested(kind, number, component)
            worst = np.maximum(worst, whole_errors(run, pair))
            time_s, errors = window_errors(run, pair)
            where += [f"{known[number, component]}, {t:.1f} s" for t in time_s]
            for name, values in errors.items():
                pooled.setdefault(name, []).append(values)
        run.say(f"### {kind}, {len(numbers)} records: " + ", ".join(known[n] for n in numbers))
        judged = _window_table(run, {name: np.concatenate(values) for name, values in pooled.items()}, where)
        _asked_of_wholes(run, f"{kind}, {len(numbers)} far-field records", worst)
        _asked_of_windows(run, f"{kind}, {len(numbers)} far-field records, 4 s windows", judged)


def _windows_figure(run: Run, pair: Pair, time_s: Floats, errors: dict[str, Floats]) -> None:
    with plots.style._style():
        page = Figure(figsize=(plots.DOUBLE_COLUMN_IN, 2.6), layout="constrained")
        ax = page.add_subplot()
        shown = (
            ("`fei`", plots.MEASURED, "fei"),
            ("`fei`, Hann", plots.THIRD, "fei, Hann"),
            ("full correlation, parabola", plots.SECOND, "full correlation"),
            (JUDGED, plots.VALUE, "least squares"),
        )
        for name, colour, label in shown:
            ax.semilogy(time_s, np.maximum(100 * np.abs(errors[name]), 1e-4), ".", ms=3, color=colour, label=label)
        ax.axhline(1.0, color=plots.MUTED, linewidth=0.6, linestyle=(0, (5, 3)))
        ax.set_xlabel("Centre of the window (s)")
        ax.set_ylabel("Delay error (%)")
        plots.style._legend(ax, columns=4)
        run.save(page, "windows", f"Delay error in 4 s windows, {pair.name}, at least 1e-4 %; dashed: 1 %")


# Noise on measured ----------------------------------------------------------------------------------------------------


def noise(run: Run) -> None:
    """Section d: bias and standard deviation in white noise beside the Cramer-Rao bound."""
    run.say(
        "## White noise on measured",
        f"{run.draws} draws; the noise's standard deviation is this share of that of the record's measured signal about"
        " its mean, in windows too. Windows follow each other; those whose target has over 5 % of the record's"
        f" deviation count ({GENERIC_WINDOWS} of them for the generic estimators). The limit is the Cramer-Rao bound of"
        " the delay with unknown gain over the same samples. By chance alone the mean of the draws is off by"
        f" {1 / np.sqrt(run.draws):.3f} standard deviations, their standard deviation by"
        f" {100 / np.sqrt(2 * run.draws):.1f} %.",
    )
    pairs = [tested(BOUC_WEN, 19, "b"), tested(BOUC_WEN, 1, "a"), tested(LINEAR, 1, "b")]
    worst = np.zeros((2, 2, 2))  # whole or windows, gain or delay, bias over deviation or deviation over limit
    doubted = []
    for number, pair in enumerate(pairs[1:2] if run.short else pairs):
        for share in (0.01, 0.001):
            seed = 100 + 10 * number + int(share == 0.001)
            found = _noisy_estimates(run, pair, share, seed)
            limits = pair.limits(share * float(np.std(pair.measured)))
            errors = found - np.array([pair.amplitude, pair.delay_s])
            bias, std, _ = moments(errors)
            run.say(f"### {pair.name}, {100 * share:g} %: limit {1e6 * limits[0, 1]:.3g} us, whole record")
            _noise_table(run, errors, bias, std, limits)
            # Of few draws nearly every mean lies so far off.
            if not run.short and np.nanmax(np.abs(bias[0] / std[0])) > 0.1:
                doubted.append((pair, share, seed))
            for i, part in enumerate((slice(0, 1), slice(1, None))):
                ours = np.abs(bias[0, part] / std[0, part]), std[0, part] / limits[part]
                missing = np.isnan(errors[:, 0, part]).any(axis=(0, 1, 2)) if i == 0 else False
                for j, values in enumerate(ours):
                    worst[i, :, j] = np.maximum(worst[i, :, j], np.inf if missing else np.nanmax(values, axis=0))
            if number == 0 and share == 0.01:
                _noise_figure(run, pair, errors[:, :, 0, 1], float(limits[0, 1]))
    for pair, share, seed in doubted:
        # Of a hundred means of 1,000 draws one may lie this far off by chance; more draws tell.
        more = _noisy_estimates(dataclasses.replace(run, draws=8 * run.draws), pair, share, seed, alone=True)
        bias, std, _ = moments(more - np.array([pair.amplitude, pair.delay_s]))
        run.say(
            f"{pair.name}, {100 * share:g} %: `least_squares` has a bias above 0.1 standard deviations somewhere. With"
            f" {8 * run.draws} draws the largest is {np.nanmax(np.abs(bias[0] / std[0])):.3f}."
        )
    for i, where in enumerate(("whole records", "4 s windows")):
        for j, what in ((1, "delay"), (0, "gain")):
            bias_std, std_limit = worst[i, j]
            case = f"white noise of 1 % and 0.1 %, {where}, `least_squares`, boxcar, {what}"
            run.asked(f"{case}: bias over sd", "<= 0.1", f"{bias_std:.3f}", bias_std <= 0.1, bias_std)
            run.asked(f"{case}: sd over Cramer-Rao", "<= 1.1", f"{std_limit:.3f}", std_limit <= 1.1, std_limit)


def _noisy_estimates(run: Run, pair: Pair, share: float, seed: int, alone: bool = False) -> Floats:
    """Gain and delay, (draws, estimators, 1 + windows, 2): the whole record first; NaN for a gain that is not had.

    alone: of the first estimator only.
    """
    std, windows = share * np.std(pair.measured), pair.windows
    W = round(WINDOW_S * pair.rate_hz)
    few = np.unique(np.linspace(0, len(windows) - 1, GENERIC_WINDOWS).round().astype(int))

    def judge(unit: Floats) -> Floats:
        measured = pair.measured + std * unit
        found = np.full((len(OURS) + len(generic_delay.ESTIMATORS), 1 + len(windows), 2), np.nan)
        for row, settings in zip(found[: 1 if alone else None], OURS.values(), strict=False):
            row[0] = run.evaluate(pair.target, measured, pair.rate_hz, settings)[[0, 3]]
            row[1:] = run.moving(pair.target, measured, pair.rate_hz, settings)[windows][:, [0, 3]]
        if alone:
            return found[:1]
        for row, estimator in zip(found[len(OURS) :], generic_delay.ESTIMATORS.values(), strict=True):
            row[0, 1] = estimator(pair.target, measured, pair.rate_hz)
            for i in few:
                cut = slice(windows[i] * W, windows[i] * W + W)
                row[1 + i, 1] = estimator(pair.target[cut], measured[cut], pair.rate_hz)
        return found

    return run.repeat(seed, pair.measured.shape, judge)


def _noise_table(run: Run, errors: Floats, bias: Floats, std: Floats, limits: Floats) -> None:
    rows = []
    for i, name in enumerate([*OURS, *generic_delay.ESTIMATORS]):
        b, s, limit = bias[i, :, 1], std[i, :, 1], limits[:, 1]
        rms = moments(errors[:, i, :, 1])[2] / limit
        some = np.isfinite(s[1:])
        over, ratio = np.abs(b[1:] / s[1:])[some], (s[1:] / limit[1:])[some]
        lost = np.isnan(errors[:, i, 1:, 1])[:, some].mean()
        rows.append(
            [
                name,
                f"{1e6 * b[0]:.2f}",
                f"{1e6 * s[0]:.2f}",
                f"{abs(b[0] / s[0]):.2f}",
                f"{s[0] / limit[0]:.2f}",
                f"{rms[0]:.3g}",
                f"{over.max():.2f}",
                f"{ratio.min():.2f} to {ratio.max():.2f}",
                f"{np.nanmedian(rms[1:]):.3g}",
                f"{100 * lost:.2g} %",
            ]
        )
    run.table(
        [
            "delay by",
            "whole: bias, us",
            "sd, us",
            "bias / sd",
            "sd / limit",
            "rms error / limit",
            f"{len(limits) - 1} windows: largest bias / sd",
            "sd / limit",
            "median rms error / limit",
            "not determined",
        ],
        rows,
    )


def _noise_figure(run: Run, pair: Pair, errors: Floats, limit: float) -> None:
    names = [*OURS, *generic_delay.ESTIMATORS]
    rms = 1e6 * np.sqrt(np.nanmean(errors**2, axis=0))
    with plots.style._style():
        page = Figure(figsize=(plots.DOUBLE_COLUMN_IN, 2.8), layout="constrained")
        ax = page.add_subplot()
        colours = [plots.VALUE] * len(OURS) + [plots.DOUBTFUL] * len(generic_delay.ESTIMATORS)
        ax.hlines(range(len(names)), 1e6 * limit, rms, color=colours, linewidth=0.8)
        ax.scatter(rms, range(len(names)), color=colours, s=14)
        ax.set_yticks(range(len(names)), [name.replace("`", "") for name in names])
        ax.invert_yaxis()
        ax.set_xscale("log")
        ax.axvline(1e6 * limit, color=plots.LIMIT, linewidth=0.8, linestyle=(0, (5, 3)))
        ax.set_xlabel("RMS error of the delay (µs); dashed: Cramér-Rao bound")
        run.save(page, "noise", f"RMS error of the delay, {pair.name}, whole record, 1 % white noise")


# Intervals ------------------------------------------------------------------------------------------------------------

#: What intervals are judged of.
INTERVALS: dict[str, dict[str, Any]] = {
    "`least_squares`, `noise=white`": {"estimator": "least_squares", "noise": "white"},
    "`least_squares`, `noise=coloured`": {"estimator": "least_squares", "noise": "coloured"},
    "`least_squares`, Hann": {"estimator": "least_squares", **HANN},
    "`aligned`": {"estimator": "aligned"},
}
#: Either takes its interval from the noise that is found, so both are asked to hold in either noise.
JUDGED_INTERVALS = tuple(INTERVALS)[:2]


def coverage(run: Run) -> None:
    """Section e: how often 95 % intervals hold the truth."""
    run.say(
        "## Intervals",
        f"{run.draws} draws of noise of 1 %: the share of 95 % intervals that hold the truth, and the estimate's"
        " standard deviation over the Cramer-Rao bound in that noise, its spectrum known. Windows as above: all of them"
        " together, and the lowest and highest. By chance alone a share of 95 % is off by"
        f" {100 * np.sqrt(0.95 * 0.05 / run.draws):.1f} % (one standard deviation), so the lowest of many windows lies"
        " below and the highest above.",
    )
    pairs = [tested(BOUC_WEN, 1, "a")] if run.short else [tested(BOUC_WEN, 19, "b"), tested(BOUC_WEN, 1, "a")]
    shown: dict[tuple[str, float], list[Floats]] = {}
    for number, pair in enumerate(pairs):
        for coefficient in (0.0, 0.9, 0.99):
            found = _intervals(run, pair, coefficient, 200 + 10 * number + int(100 * coefficient) % 7)
            limits = pair.limits(0.01 * float(np.std(pair.measured)), coefficient)
            colour = f"AR(1) {coefficient:g}" if coefficient else "white"
            run.say(f"### {pair.name}, {colour} noise")
            rows = []
            for i, name in enumerate(INTERVALS):
                cells = [name]
                for j, truth in ((1, pair.delay_s), (0, pair.amplitude)):
                    value, low, high = np.moveaxis(found[:, i, :, 3 * j : 3 * j + 3], -1, 0)
                    there = np.isfinite(low) & np.isfinite(high)
                    with np.errstate(invalid="ignore"):
                        held = np.where(there, (low <= truth) & (truth <= high), np.nan)
                    whole, each = 100 * np.nanmean(held[:, 0]), 100 * np.nanmean(held[:, 1:], axis=0)
                    ratio = np.nanstd(value, axis=0, ddof=1) / limits[:, j]
                    cells += [
                        f"{whole:.1f}",
                        f"{np.mean(each):.1f} ({each.min():.1f} to {each.max():.1f})",
                        f"{ratio[0]:.2f}; {np.median(ratio[1:]):.2f}",
                    ]
                    what = ("gain", "delay")[j]
                    if j == 1:
                        shown.setdefault((name, coefficient), []).append(np.concatenate([[whole], each]))
                    if name in JUDGED_INTERVALS:
                        outside = int(np.sum((each < 93) | (each > 97)))
                        lost = 100 * (1 - there.mean())
                        run.asked(
                            f"{pair.name}, {colour} noise, {name}: cover of the {what}'s 95 % interval",
                            "93 to 97 %" if coefficient < 0.99 else "reported",
                            f"whole {whole:.1f} %; windows {np.mean(each):.1f} %, {outside} of {len(each)} outside"
                            f" ({each.min():.1f} to {each.max():.1f} %); {lost:.2g} % without interval",
                            bool(93 <= whole <= 97 and 93 <= np.mean(each) <= 97) if coefficient < 0.99 else None,
                            float(np.mean(each)),
                        )
                rows.append(cells)
            parts = ("whole, %", "windows, %", "sd / limit: whole; windows")
            run.table(
                ["estimator", *(f"delay: {p}" if p == parts[0] else p for p in parts)]
                + [f"gain: {p}" if p == parts[0] else p for p in parts],
                rows,
            )
    _coverage_figure(run, shown)


def _intervals(run: Run, pair: Pair, coefficient: float, seed: int) -> Floats:
    """(draws, estimators, 1 + windows, 6)."""
    std, windows = 0.01 * np.std(pair.measured), pair.windows

    def judge(unit: Floats) -> Floats:
        measured = pair.measured + std * unit
        found = np.empty((len(INTERVALS), 1 + len(windows), 6))
        for row, settings in zip(found, INTERVALS.values(), strict=True):
            row[0] = run.evaluate(pair.target, measured, pair.rate_hz, settings)
            row[1:] = run.moving(pair.target, measured, pair.rate_hz, settings)[windows]
        return found

    return run.repeat(seed, pair.measured.shape, judge, coefficient)


def _coverage_figure(run: Run, shown: dict[tuple[str, float], list[Floats]]) -> None:
    colours = (plots.VALUE, plots.SECOND, plots.THIRD, plots.MEASURED)
    with plots.style._style():
        page = Figure(figsize=(plots.DOUBLE_COLUMN_IN, 2.6), layout="constrained")
        axes = page.subplots(1, 3, sharey=True)
        for ax, coefficient in zip(axes, (0.0, 0.9, 0.99), strict=True):
            ax.axhspan(93, 97, color=plots.DOUBTFUL, alpha=0.4, linewidth=0)
            for x, (name, colour) in enumerate(zip(INTERVALS, colours, strict=True)):
                values = [share for one in shown[name, coefficient] for share in one]
                ax.plot(np.linspace(x - 0.25, x + 0.25, len(values)), values, ".", ms=3, color=colour)
            ax.set_xticks(range(len(INTERVALS)), ["LS\nwhite", "LS\ncoloured", "LS\nHann", "aligned"])
            ax.set_title(f"AR(1) {coefficient:g}" if coefficient else "white noise")
        axes[0].set_ylabel("95 % intervals that hold (%)")
        run.save(
            page, "coverage", "Share of 95 % intervals of the delay that hold the truth: whole records and 4 s windows"
        )


# Noise on both channels -----------------------------------------------------------------------------------------------


def both_noisy(run: Run) -> None:
    """Section f: 5 % noise on target and on measured, errors in variables."""
    run.say(
        "## Noise on both channels",
        f"{run.draws} draws of white noise on target and measured alike, its standard deviation 5 % of that of"
        " measured; `noise_ratio=1`. Whole records. Mean error and standard deviation of the delay in % of the delay."
        " Above 20 Hz there is only noise: a band keeps it out. Taken as exact, a noisy target draws the delay to"
        " between two samples, where reading it smooths its noise.",
    )
    settings: dict[str, dict[str, Any]] = {
        "`least_squares`, `noise_ratio=1`": {"estimator": "least_squares", "noise_ratio": 1.0},
        "the same, 0.1 to 20 Hz": {"estimator": "least_squares", "noise_ratio": 1.0, "band_hz": (0.1, 20.0)},
        "`least_squares`, target taken as exact": {"estimator": "least_squares"},
        "exact, 0.1 to 20 Hz": {"estimator": "least_squares", "band_hz": (0.1, 20.0)},
        "`aligned`": {"estimator": "aligned"},
        "`fei`": {"estimator": "fei"},
        "`fei`, 0.1 to 20 Hz": {"estimator": "fei", "band_hz": (0.1, 20.0)},
    }
    pairs = [tested(BOUC_WEN, 1, "a"), tested(BOUC_WEN, 19, "b"), tested(LINEAR, 1, "b")]
    for number, pair in enumerate(pairs[:1] if run.short else pairs):
        found = _both_noisy_estimates(run, pair, list(settings.values()), 300 + number)
        errors = found / np.array([pair.amplitude, pair.delay_s]) - 1
        mean, std, _ = moments(errors)
        lost = 100 * np.isnan(errors[:, :, 1]).mean(axis=0)
        run.say(f"### {pair.name}")
        run.table(
            ["estimator", "mean error, %", "sd, %", "mean error / sd", "gain: mean error / sd", "not determined"],
            [
                [
                    name,
                    f"{100 * m[1]:.3g}",
                    f"{100 * s[1]:.3g}",
                    f"{abs(m[1] / s[1]):.2f}",
                    f"{abs(m[0] / s[0]):.2f}",
                    f"{none:.2g} %",
                ]
                for name, m, s, none in zip(settings, mean, std, lost, strict=True)
            ],
        )
        for i, band in enumerate(("full band", "0.1 to 20 Hz")):
            over = abs(mean[i, 1] / std[i, 1])
            run.asked(
                f"{pair.name}, 5 % noise on both channels, errors in variables, {band}: mean error of delay over sd",
                "<= 0.1",
                f"{over:.3f} (sd {100 * std[i, 1]:.2g} % of the delay, {lost[i]:.2g} % not determined)",
                bool(over <= 0.1 and lost[i] == 0),
                over,
            )


def _both_noisy_estimates(run: Run, pair: Pair, settings: list[dict[str, Any]], seed: int) -> Floats:
    std = 0.05 * np.std(pair.measured)

    def judge(unit: Floats) -> Floats:
        target, measured = pair.target + std * unit[0], pair.measured + std * unit[1]
        return np.array([run.evaluate(target, measured, pair.rate_hz, one)[[0, 3]] for one in settings])

    return run.repeat(seed, (2, len(pair.target)), judge)


# Large delays ---------------------------------------------------------------------------------------------------------

DELAYS_S = np.arange(-0.1, 0.2001, 0.0125)
WRONG_TURN_S = 0.01
FINE = 8  # the narrow-band motion is computed this much finer, so that its delays are exact


def broad_band(delay_s: float, rate_hz: float = 1024.0, seconds: float = 30.0, gain: float = 0.9) -> Pair:
    """Noise from 0.2 to 20 Hz of which a stretch is seen: a sum of sines, shifted exactly."""
    n, kept = 2**16, round(seconds * rate_hz)
    f = np.fft.rfftfreq(n, 1 / rate_hz)
    rng = np.random.Generator(np.random.PCG64(400))
    spectrum = rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))
    spectrum[(f < 0.2) | (f > 20)] = 0
    late = gain * spectrum * np.exp(-2j * np.pi * f * delay_s)
    target, measured = (np.fft.irfft(x, n)[n // 4 : n // 4 + kept] for x in (spectrum, late))
    return Pair("broad band, 0.2 to 20 Hz", target, measured, rate_hz, gain, delay_s)


def narrow_band(fast: Floats, fast_hz: float, delay_s: float, gain: float = 0.9) -> Pair:
    """Every eighth sample of a response and of the same some samples later: shifted without interpolation."""
    late, margin = round(delay_s * fast_hz), round(0.5 * fast_hz)
    target = fast[margin:-margin:FINE]
    measured = gain * fast[margin - late : len(fast) - margin - late : FINE]
    return Pair("narrow band, 5 Hz", target, measured, fast_hz / FINE, gain, late / fast_hz)


def large_delays(run: Run) -> None:
    """Section g: delays from -100 to +200 ms; a single sine."""
    run.say(
        "## Large delays",
        f"{len(DELAYS_S)} delays from -100 to +200 ms, gain 0.9, no noise: noise from 0.2 to 20 Hz over 30 s, and the"
        " response of the 5 Hz structure to MUL279, whole and in 4 s windows, one every 2 s. A wrong turn is an error"
        f" above {1e3 * WRONG_TURN_S:g} ms.",
    )
    fast_hz = 1024.0 * FINE
    fast = simulate(
        VirtualTest(linear(delay_s=0.0).structure, linear(delay_s=0.0).actuators, rate_hz=fast_hz), record(1, "b")
    )
    delays = DELAYS_S[::4] if run.short else DELAYS_S
    kinds = {"broad": [broad_band(d) for d in delays], "narrow": [narrow_band(fast.target, fast_hz, d) for d in delays]}
    rows, curves = [], {}
    for pairs in kinds.values():
        for name in ("`least_squares`", "`aligned`", "`fei`"):
            settings = OURS[name]
            for where in ("whole", "4 s windows"):

                def errors(pair: Pair, settings: dict[str, Any] = settings, where: str = where) -> Floats:
                    signals = pair.target, pair.measured, pair.rate_hz, settings
                    found = run.evaluate(*signals)[None] if where == "whole" else run.moving(*signals, 2.0)
                    if where != "whole":
                        found = found[_moving_enough(pair, 2.0)]
                    return np.stack([found[:, 0] / pair.amplitude - 1, found[:, 3] - pair.delay_s], axis=1)

                each = list(run.pool.map(errors, pairs))
                gain, delay = np.concatenate(each).T
                wrong, none = int(np.sum(np.abs(delay) > WRONG_TURN_S)), int(np.sum(np.isnan(delay)))
                loss = 100 * float(np.nanmax(np.abs(gain)))
                rows.append(
                    [
                        f"{pairs[0].name}, {where}, {name}",
                        f"{len(delay)}",
                        f"{wrong}",
                        f"{none}",
                        f"{1e6 * np.nanmax(np.abs(delay)):.3g}",
                        f"{loss:.2g}",
                    ]
                )
                if where == "whole":
                    curves[pairs[0].name, name] = np.concatenate(each)
                if name == JUDGED:
                    run.asked(
                        f"{pairs[0].name}, delays of -100 to +200 ms, {where}: wrong turns, gain error",
                        "none, < 0.1 %",
                        f"{wrong}, {loss:.2g} %; {none} of {len(delay)} not determined",
                        wrong == 0 and loss < 0.1 and none == 0,
                    )
    run.table(["case", "estimates", "wrong turns", "not determined", "largest delay error, us", "gain error, %"], rows)
    _delays_figure(run, delays, curves)
    t = np.arange(10240) / 1024.0
    sine = run.tool.evaluate(np.sin(10 * np.pi * t), 0.9 * np.sin(10 * np.pi * (t - 0.03)), 1024.0, **OURS[JUDGED])
    run.say(
        f'A single sine of 5 Hz, 30 ms late: not determined, "{sine.reason}".' if sine.reason else "A sine: determined."
    )
    run.asked("a single sine of 5 Hz", "'ambiguous'", repr(sine.reason), "ambiguous" in sine.reason)


def _moving_enough(pair: Pair, hop_s: float) -> NDArray[np.bool_]:
    W, H = round(WINDOW_S * pair.rate_hz), round(hop_s * pair.rate_hz)
    starts = range(0, len(pair.target) - W + 1, H)
    return np.array([np.std(pair.target[s : s + W]) >= 0.05 * np.std(pair.target) for s in starts])


def _delays_figure(run: Run, delays: Floats, curves: dict[tuple[str, str], Floats]) -> None:
    with plots.style._style():
        page = Figure(figsize=(plots.DOUBLE_COLUMN_IN, 2.4), layout="constrained")
        axes = page.subplots(1, 2, sharey=True)
        for ax, kind in zip(axes, dict.fromkeys(kind for kind, _ in curves), strict=True):
            for name, colour in (("`fei`", plots.MEASURED), ("`aligned`", plots.SECOND), (JUDGED, plots.VALUE)):
                size = np.maximum(1e6 * np.abs(curves[kind, name][:, 1]), 1e-3)
                ax.semilogy(1e3 * delays, size, ".-", color=colour, ms=3, label=name.strip("`"))
            ax.set_xlabel(f"Delay (ms), {kind}")
        axes[0].set_ylabel("Delay error (µs)")
        plots.style._legend(axes[1], columns=3)
        run.save(page, "delays", "Delay error over the delay, whole records, at least 1e-3 us")


# A real machine -------------------------------------------------------------------------------------------------------


def machine_records() -> Iterator[tuple[str, Floats, Floats, float]]:
    """The chirp of the examples, and the other sweep where it is kept beside the repository."""
    columns = np.loadtxt(ROOT / "examples" / "data" / "utfsm_chirp_0A.csv", delimiter=",", skiprows=1)
    yield "utfsm_chirp_0A", np.ascontiguousarray(columns[:, 1]), np.ascontiguousarray(columns[:, 2]), 1000.0
    other = SHARED / "records" / "utfsm_15Hz_0A.txt"
    if other.is_file():
        channels = {c.name: np.array(c.values) for c in rthstrack.read_recording(other).channels}
        yield "utfsm_15Hz_0A", channels["CHANNEL2"], channels["CHANNEL0"], 1000.0


def machine(run: Run) -> None:
    """Section h: what the choice of window and detrending does on a real machine."""
    run.say(
        "## A real machine",
        "Sweeps of an MTS machine with a damper, whose delay varies with frequency: delays in ms, and their spread over"
        " the three ways of detrending, over that of `fei`. Across windows the delay really differs.",
    )
    removed = ("none", "mean", "linear")
    for name, target, measured, rate_hz in machine_records():
        rows = []
        for window in ("boxcar", "hann"):
            plain = np.nan
            for label, estimator in (
                ("`fei`", "fei"),
                ("trusted", "least_squares"),
                ("`least_squares`", "least_squares"),
                ("`aligned`", "aligned"),
            ):
                # The trusted estimate never takes two sensors to share a zero.
                least = "mean" if label == "trusted" else "none"
                found = [
                    run.tool.evaluate(
                        target,
                        measured,
                        rate_hz,
                        estimator=estimator,
                        window=window,
                        detrend=least if detrend == "none" else detrend,
                    )
                    for detrend in removed
                ]
                delays = np.array([float(one.delay_s) for one in found])
                spread = float(np.ptp(delays))
                plain = spread if estimator == "fei" else plain
                why = next((one.reason for one in found if getattr(one, "reason", "")), "")
                rows.append(
                    [
                        f"{window}, {label}",
                        *(f"{1e3 * d:.4f}" for d in delays),
                        f"{1e6 * spread:.3g}",
                        f"{spread / plain:.3f}",
                        why,
                    ]
                )
                if label == "trusted":
                    run.asked(
                        f"{name}, {window}: spread over detrending of the trusted delay over that of `fei`",
                        "<= 0.1",
                        f"{spread / plain:.3f} ({1e6 * spread:.3g} of {1e6 * plain:.3g} us)"
                        + (f", {why}" if why else ""),
                        spread <= 0.1 * plain,
                    )
        run.say(f"### {name}")
        run.table(["window, estimator", *removed, "spread, us", "over `fei`", "reason"], rows)


# The document ---------------------------------------------------------------------------------------------------------

SECTIONS: tuple[Callable[[Run], None], ...] = (
    whole_records,
    short_windows,
    noise,
    coverage,
    both_noisy,
    large_delays,
    machine,
)
SIBLINGS = ("accuracy_factors", "accuracy_response", "accuracy_hostile", "causes")


def computed(
    tool: Any,
    out: Path,
    short: bool,
    draws: int | None = None,
    sections: Sequence[Callable[[Run], None]] = SECTIONS,
) -> Run:
    """All sections, with `tool.evaluate` and `tool.evaluate_moving` under test and so many draws of noise a case."""
    draws = draws or (SHORT_DRAWS if short else DRAWS)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        run = Run(tool, short, draws, out, pool)
        for section in sections:
            begun = time.perf_counter()
            section(run)
            print(f"accuracy: {section.__name__} {time.perf_counter() - begun:.0f} s", file=sys.stderr)
    return run


def document(run: Run, also: Sequence[str]) -> str:
    """The text of docs/accuracy.md."""
    marks = {True: "met", False: "**missed**", None: ""}
    head = [
        "# Accuracy",
        "",
        f"`make accuracy`, {date.today().isoformat()}: {run.draws} draws a case; {platform.machine()}, {os.cpu_count()}"
        f" cores, Python {platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}."
        " delay > 0: measured lags target. sd: standard deviation.",
        "",
        "## What was asked for",
        "",
        "| case | asked | measured | |",
        "| --- | --- | --- | --- |",
        *(f"| {row.case} | {row.asked} | {row.measured} | {marks[row.met]} |" for row in run.rows),
        "",
    ]
    return "\n".join([*head, *run.lines, *also])


def siblings(run: Run) -> list[str]:
    """Sections of other files of this folder, where they are; what was asked of them joins the first table."""
    found = []
    for name in SIBLINGS:
        if (ROOT / "benchmarks" / f"{name}.py").is_file():
            begun = time.perf_counter()
            sibling = importlib.import_module(name)
            found.append(str(sibling.section()))
            run.rows += [Row(*dataclasses.astuple(row)) for row in getattr(sibling, "rows", list)()]
            print(f"accuracy: {name} {time.perf_counter() - begun:.0f} s", file=sys.stderr)
    return found


def main() -> int:
    """Computes, prints the first table and writes the document."""
    parser = argparse.ArgumentParser(description="Writes docs/accuracy.md and its figures.")
    parser.add_argument("--short", action="store_true", help="few draws and records")
    parser.add_argument("--twin", action="store_true", help="the twin's estimators in place of the package's")
    parser.add_argument("--draws", type=int, help=f"draws of noise a case, {DRAWS} if not given")
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="folder to write to")
    parser.add_argument("--only", nargs="*", help="names of the sections to compute")
    arguments = parser.parse_args()
    tool: Any = importlib.import_module("twin_tool") if arguments.twin else rthstrack
    arguments.out.mkdir(parents=True, exist_ok=True)
    chosen = [s for s in SECTIONS if not arguments.only or s.__name__ in arguments.only]
    run = computed(tool, arguments.out, arguments.short, arguments.draws, chosen)
    text = document(run, [] if arguments.short or arguments.only else siblings(run))
    (arguments.out / "accuracy.md").write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
