"""Ground motions made of filtered noise."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.errors import SettingError
from rthstrack.ground_motion.checks import MOST_SAMPLES, not_positive
from rthstrack.ground_motion.motion import GroundMotion
from rthstrack.keyed_table import whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rthstrack.ground_motion.checks import Mistakes


def synthetic_ground_motion(
    seed: int = 1,
    duration_s: float = 40.0,
    rate_hz: float = 100.0,
    peak_m_s2: float = 3.0,
    ground_frequency_hz: float = 2.5,
    ground_damping_ratio: float = 0.6,
    high_pass_hz: float = 0.25,
    high_pass_damping_ratio: float = 0.6,
    rise_s: float | None = None,
    strong_s: float | None = None,
) -> GroundMotion:
    """A motion made of filtered noise under an envelope, the same for the same seed and settings.

    Gaussian white noise times the envelope of Amin and Ang (1968), e(t) = (t/t1)^2 up to t1 = rise_s, 1 up to
    t2 = t1 + strong_s, exp(-c (t - t2)) after it, c such that 1 % is left at the end; then through the ground of Kanai
    (1957) and Tajimi (1960) and the high-pass of Clough and Penzien (1975),

        H(s) = (2 z_g w_g s + w_g^2) / (s^2 + 2 z_g w_g s + w_g^2) * s^2 / (s^2 + 2 z_f w_f s + w_f^2),

    by the bilinear transform. A share of the envelope is subtracted so that the velocity ends at zero, and the whole is
    scaled to the peak. By default firm ground, rise_s = duration_s / 10, strong_s = 3 duration_s / 10.
    Raises SettingError naming everything that is wrong.
    """
    mistakes = synthetic_mistakes(locals())
    if mistakes:
        raise SettingError("; ".join(f"{key}: {message}" for key, message in mistakes))
    from scipy.signal import bilinear, lfilter

    rise = 0.1 * duration_s if rise_s is None else rise_s
    strong = 0.3 * duration_s if strong_s is None else strong_s
    n = round(duration_s * rate_hz)
    t = np.arange(n) / rate_hz
    decay = math.log(100) / (duration_s - rise - strong)
    envelope = np.where(t < rise, (t / rise) ** 2, np.exp(-decay * np.maximum(t - rise - strong, 0)))
    motion = envelope * np.random.Generator(np.random.PCG64(seed)).standard_normal(n)
    ground, high = 2 * math.pi * ground_frequency_hz, 2 * math.pi * high_pass_hz
    damped = 2 * ground_damping_ratio * ground
    for numerator, denominator in (
        ([damped, ground**2], [1, damped, ground**2]),
        ([1, 0, 0], [1, 2 * high_pass_damping_ratio * high, high**2]),
    ):
        motion = lfilter(*bilinear(numerator, denominator, rate_hz), motion)
    motion -= envelope * (np.trapezoid(motion) / np.trapezoid(envelope))
    motion *= peak_m_s2 / np.abs(motion).max()
    source = (
        f"synthetic: Kanai-Tajimi {ground_frequency_hz:g} Hz, {ground_damping_ratio:g}, Clough-Penzien "
        f"{high_pass_hz:g} Hz, {high_pass_damping_ratio:g}, Amin-Ang {rise:g} s, {strong:g} s, seed {seed}, "
        f"peak {peak_m_s2:g} m/s2"
    )
    return GroundMotion(f"synthetic {seed}", motion, float(rate_hz), source)


def synthetic_mistakes(settings: Mapping[str, Any]) -> Mistakes:
    """What is wrong with the arguments of `synthetic_ground_motion`."""
    mistakes: Mistakes = []
    if whole(settings["seed"]) is None:
        mistakes.append(("seed", f"expected a whole number from 0 on, found {settings['seed']!r}"))
    optional = [key for key in ("rise_s", "strong_s") if settings[key] is not None]
    positive = ("duration_s", "rate_hz", "peak_m_s2", "ground_frequency_hz", "ground_damping_ratio")
    mistakes += not_positive(settings, (*positive, "high_pass_hz", "high_pass_damping_ratio", *optional))
    if mistakes:
        return mistakes
    n, duration = settings["duration_s"] * settings["rate_hz"], settings["duration_s"]
    if not 100 <= n <= MOST_SAMPLES:
        mistakes.append(("duration_s", f"expected 100 to {MOST_SAMPLES} samples in all, found {n:g}"))
    if not settings["high_pass_hz"] < settings["ground_frequency_hz"] <= settings["rate_hz"] / 4:
        mistakes.append(
            (
                "ground_frequency_hz",
                f"expected above high_pass_hz = {settings['high_pass_hz']:g} Hz and up to a quarter of the rate, "
                f"{settings['rate_hz'] / 4:g} Hz, found {settings['ground_frequency_hz']:g}",
            )
        )
    rise, strong = (settings[key] or share * duration for key, share in (("rise_s", 0.1), ("strong_s", 0.3)))
    if rise + strong > 0.9 * duration:
        mistakes.append(
            (
                "strong_s",
                f"expected rise_s + strong_s up to 0.9 duration_s = {0.9 * duration:g} s, found {rise + strong:g}",
            )
        )
    return mistakes
