"""How soon a reading of the monitor follows a step and a ramp in delay, and a step in gain, by length of the window.

Writes docs/online-response.md and docs/online-response.png; `docs/online.md` speaks of both.

The target is a stationary random motion of 0.5 to 5 Hz (sixty sines with random phases, so that the delayed motion is
exact); each figure is over 40 of them. 1024 samples and 64 readings a second, P = 8: the decimator's delay of 62.5 ms
is part of every time.
"""

from __future__ import annotations

import datetime
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from rthstrack import Monitor

RATE_HZ = 1024.0
WINDOWS_S = (0.5, 1.0, 2.0, 4.0, 8.0)
ESTIMATORS = ("fei", "least_squares")
N_MOTIONS = 40
SECONDS = 32.0
AT_S = 12.0
FROM_S, TO_S = 0.010, 0.030
RAMP = 0.001
DOCS = Path(__file__).parent.parent / "docs"


class Motion:
    """Sixty sines of equal power per hertz."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.omega = 2 * np.pi * rng.uniform(0.5, 5.0, 60)
        self.phase = rng.uniform(0, 2 * np.pi, 60)

    def __call__(self, t: np.ndarray) -> np.ndarray:
        return sum(np.sin(w * t + p) for w, p in zip(self.omega, self.phase, strict=True))


def readings(window_s: float, estimator: str, delay_s, gain) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """time_s, delays and amplitudes (motions, readings), age_s. Delay and gain are functions of time."""
    t = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ
    delays, amplitudes = [], []
    for seed in range(N_MOTIONS):
        motion = Motion(seed)
        monitor = Monitor(
            RATE_HZ, window_s, 64.0, band_hz=(0, 32), data_decimation=8, estimator=estimator, max_delay_s=0.1
        )
        found = monitor.process(motion(t), gain(t) * motion(t - delay_s(t)))
        delays.append(found.delay_s)
        amplitudes.append(found.amplitude)
    return found.time_s, np.array(delays), np.array(amplitudes), monitor.age_s


def crossing_s(time_s: np.ndarray, values: np.ndarray, share: float) -> float:
    """From the step to where the median over the motions has first come `share` of the way, in seconds."""
    reached = (np.nanmedian(values, axis=0) >= share) & (time_s >= AT_S)
    return float(time_s[np.argmax(reached)] - AT_S) if reached.any() else np.nan


def main() -> None:
    """Measures, writes the table and draws the figure."""
    step = lambda t: np.where(t < AT_S, FROM_S, TO_S)  # noqa: E731
    constant = lambda value: lambda t: np.full_like(t, value)  # noqa: E731
    ramp = lambda t: FROM_S + RAMP * np.maximum(t - AT_S, 0)  # noqa: E731
    figure, axes = plt.subplots(2, 2, figsize=(10, 6), sharex="col", sharey="row", layout="constrained")
    rows, ramps = [], []
    for column, estimator in enumerate(ESTIMATORS):
        for window_s in WINDOWS_S:
            time_s, delays, _, age_s = readings(window_s, estimator, step, constant(1.0))
            way = (delays - FROM_S) / (TO_S - FROM_S)
            after = time_s >= AT_S
            peak = np.nanmedian(np.nanmax(way[:, after], axis=1)) - 1
            steady = time_s < AT_S
            scatter = 1e3 * np.nanstd(delays[:, steady])
            judged = 100 * np.mean(np.isfinite(delays))
            _, _, gains, _ = readings(window_s, estimator, constant(FROM_S), lambda t: np.where(t < AT_S, 1.0, 0.8))
            gain_way = (1.0 - gains) / 0.2
            cells = [crossing_s(time_s, way, share) for share in (0.1, 0.5, 0.9, 0.98)]
            gain_cells = [crossing_s(time_s, gain_way, share) for share in (0.5, 0.9)]
            rows.append(
                f"| {estimator} | {window_s:g} | {age_s:.2f} | "
                + " | ".join(f"{v:.2f}" for v in cells)
                + f" | {100 * peak:.0f} | {scatter:.3f} | {judged:.1f} | "
                + " | ".join(f"{v:.2f}" for v in gain_cells)
                + " |"
            )
            shown = (time_s >= AT_S - 1) & (time_s <= AT_S + 10)
            median = np.nanmedian(delays, axis=0)
            low, high = np.nanpercentile(delays, [5, 95], axis=0)
            for row, value in enumerate((step, ramp)):
                if row:
                    _, delays, _, _ = readings(window_s, estimator, ramp, constant(1.0))
                    median = np.nanmedian(delays, axis=0)
                    low, high = np.nanpercentile(delays, [5, 95], axis=0)
                    settled = time_s > AT_S + window_s + 1
                    behind = (value(time_s) - median)[settled] / RAMP
                    error = 1e3 * (delays - value(time_s - age_s))[:, settled]
                    ramps.append(
                        f"| {estimator} | {window_s:g} | {age_s:.2f} | {np.nanmean(behind):.2f} | "
                        f"{np.nanmean(error):+.3f} | {np.nanstd(error):.3f} |"
                    )
                ax = axes[row, column]
                line = ax.plot(time_s[shown] - AT_S, 1e3 * median[shown], label=f"{window_s:g} s")[0]
                ax.fill_between(
                    time_s[shown] - AT_S, 1e3 * low[shown], 1e3 * high[shown], color=line.get_color(), alpha=0.15
                )
                if window_s == WINDOWS_S[-1]:
                    true = np.linspace(-1, 10, 2000)
                    ax.plot(true, 1e3 * value(true + AT_S), "k--", linewidth=0.9, label="true")
                    ax.grid(alpha=0.3)
        axes[0, column].set_title(estimator)
        axes[1, column].set_xlabel("seconds after the change begins")
        axes[0, column].set_ylim(0, 45)
    axes[0, 0].set_ylabel("delay, ms: step")
    axes[1, 0].set_ylabel("delay, ms: 1 ms a second")
    axes[0, 1].legend(title="window", loc="lower right")
    figure.savefig(DOCS / "online-response.png", dpi=110)
    date = datetime.date.today().isoformat()
    text = f"""# How soon a reading follows

`make online`, {date}. {N_MOTIONS} random motions of 0.5 to 5 Hz, no noise; 1024 samples, 64 readings a second, P = 8,
whose delay of 62.5 ms is in every time. Medians over the motions; the bands of the figure hold 90 % of them.

![Readings after a step and during a ramp](online-response.png)

## A step in delay from 10 to 30 ms, and in gain from 1 to 0.8

Age: `time_s - centre_s`, half the window and the decimator's delay. Seconds from the step until the reading, at its
`time_s`, has come so far; over: the largest reading after the step, in percent of the step, median; scatter of the
delay before the step, where it is constant, in ms (without noise it is the bias of the windows); share of the readings
that are valid.

| estimator | window, s | age, s | d: 10 % | 50 % | 90 % | 98 % | over, % | scatter, ms | valid, % | A: 50 % | 90 % |
| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |
{chr(10).join(rows)}

## A ramp in delay of 1 ms a second

Seconds by which the median reading is behind at its `time_s`; by how much readings miss the true delay at their
`centre_s`, in ms, mean and standard deviation. Least squares speaks for about 0.05 s before `centre_s`: at the newest
samples the target between samples is not known yet, so they are not judged.

| estimator | window, s | age, s | behind, s | error at the centre, ms | its scatter, ms |
| --- | ---: | ---: | ---: | ---: | ---: |
{chr(10).join(ramps)}
"""
    (DOCS / "online-response.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
