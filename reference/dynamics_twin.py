"""The virtual tests a second time, as plainly as NumPy and SciPy allow, each by another route than the package's.

Linear loops are solved exactly in the frequency domain; restoring forces by `solve_ivp` under a motion that is known
exactly; the sampled loop by a few lines of NumPy; stability by a scan of the frequencies with `brentq` and by counting
the roots in the right half plane. It follows the definitions and shares no code with the package. Speed is no concern.

    (M s^2 + C s + K + sum over elements b b^T z(s) + sum over actuators b b^T H(s) z(s)) X = -M i A

z(s) is a dynamic stiffness, H(s) = gain e^(-s delay) G(s) is measured over target. SI units; delay > 0: measured lags.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq, root

Floats = NDArray[np.float64]
Complexes = NDArray[np.complexfloating[Any, Any]]
Filter = Callable[[Complexes], Complexes]


# Linear loops ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Answer:
    """Dynamic stiffness k + c s + m s^2 + sum of k_i s / (s + k_i / c_i) of springs and dashpots in series."""

    stiffness: float = 0.0
    damping: float = 0.0
    mass: float = 0.0
    series: tuple[tuple[float, float], ...] = ()

    def __call__(self, s: Complexes) -> Complexes:
        total: Complexes = self.stiffness + self.damping * s + self.mass * s**2
        for k, c in self.series:
            total = total + k * s / (s + k / c)
        return total


@dataclass(frozen=True)
class Rig:
    """A specimen at b, whose motion is H(s) times the target's."""

    place: Floats
    answer: Answer
    gain: float = 1.0
    delay: float = 0.0
    dynamics: Filter = field(default=np.ones_like)

    def tracking(self, s: Complexes) -> Complexes:
        moved: Complexes = self.gain * np.exp(-s * self.delay) * self.dynamics(s)
        return moved


@dataclass(frozen=True)
class Loop:
    """The computed part (without specimens), its elements, the rigs, and M i of the whole structure."""

    mass: Floats
    damping: Floats
    stiffness: Floats
    load: Floats
    rigs: tuple[Rig, ...]
    elements: tuple[tuple[Floats, Answer], ...] = ()

    def computed(self, s: Complexes) -> Complexes:
        """Dynamic stiffness of the computed part, (n_s, n, n)."""
        s = s[:, None, None]
        total: Complexes = self.mass * s**2 + self.damping * s + self.stiffness
        for place, answer in self.elements:
            total = total + np.outer(place, place) * answer(s)
        return total

    def whole(self, s: Complexes, delay: float | None = None) -> Complexes:
        """The same with the specimens; `delay` in place of the rigs' own."""
        total = self.computed(s)
        for rig in self.rigs:
            moved = rig.tracking(s) if delay is None else rig.gain * np.exp(-s * delay)
            total = total + np.outer(rig.place, rig.place) * (moved * rig.answer(s))[:, None, None]
        return total

    def open(self, s: Complexes) -> Complexes:
        """L(s) of the only rig without its delay."""
        (rig,) = self.rigs
        solved = np.linalg.solve(self.computed(s), np.broadcast_to(rig.place[:, None], (len(s), len(rig.place), 1)))
        along: Complexes = rig.gain * rig.answer(s) * (solved[:, :, 0] @ rig.place)
        return along


def exact_response(loop: Loop, ground: Floats, rate_hz: float) -> tuple[Floats, list[tuple[Floats, Floats, Floats]]]:
    """Displacements (n, n_dof) and (target, measured, force) of each rig under a ground motion that repeats.

    The motion is linear between samples: its spectrum is the samples' times sinc^2, beyond half the rate too, whence it
    folds back. What a run from rest computes where the motion fades in and out and everything has died away by its end.
    """
    n = len(ground)
    spectrum = np.fft.rfft(ground)
    moved = np.zeros((n // 2 + 1, len(loop.load)), dtype=complex)
    signals = [np.zeros((3, n // 2 + 1), dtype=complex) for _ in loop.rigs]
    for fold in range(-8, 9):
        frequency = np.fft.rfftfreq(n, 1 / rate_hz) + fold * rate_hz
        s = 2j * np.pi * frequency
        part = -np.linalg.solve(loop.whole(s), np.broadcast_to(loop.load[:, None], (len(s), len(loop.load), 1)))[..., 0]
        part = part * (np.sinc(frequency / rate_hz) ** 2 * spectrum)[:, None]
        moved += part
        for rig, signal in zip(loop.rigs, signals, strict=True):
            target = part @ rig.place
            measured = rig.tracking(s) * target
            signal += np.array([target, measured, rig.answer(s) * measured])
    in_time = [np.fft.irfft(signal, n, axis=1) for signal in signals]
    return np.fft.irfft(moved, n, axis=0), [(one[0], one[1], one[2]) for one in in_time]


def _frequencies(loop: Loop, points: int) -> Floats:
    """Circular frequencies from far below the slowest pole to far above the fastest, crowded around resonances."""
    stiff = [np.linalg.eigvals(np.linalg.solve(loop.mass, loop.stiffness))]
    mass, stiffness = loop.mass.copy(), loop.stiffness.copy()
    for rig in loop.rigs:
        outer = np.outer(rig.place, rig.place)
        mass = mass + rig.gain * rig.answer.mass * outer
        stiffness = stiffness + rig.gain * rig.answer.stiffness * outer
        for k, _ in rig.answer.series:
            stiffness = stiffness + rig.gain * k * outer
    for place, answer in loop.elements:
        for k, _ in answer.series:
            stiffness = stiffness + k * np.outer(place, place)
    stiff.append(np.linalg.eigvals(np.linalg.solve(mass, stiffness)))
    centres = np.sqrt(np.abs(np.concatenate(stiff)))
    top = centres.max()
    spread = np.concatenate((-np.geomspace(1e-7, 0.3, points // 20)[::-1], np.geomspace(1e-7, 0.3, points // 20)))
    near = [w * (1 + spread) for w in centres if w > 1e-6 * top]
    return np.unique(np.concatenate((np.geomspace(1e-5 * top, 1e4 * top, points), *near)))


def first_crossing(loop: Loop, points: int = 8000) -> tuple[float, float]:
    """The least delay with a root of 1 + L(j omega) e^(-j omega tau) on the imaginary axis, and its omega.

    Scans |L| - 1 for changes of sign and closes in with `brentq`. Infinite and NaN where there is none.
    """
    omega = _frequencies(loop, points)
    excess = np.log(np.abs(loop.open(1j * omega)))

    def beyond(w: float) -> float:
        return float(np.log(np.abs(loop.open(np.array([1j * w]))[0])))

    best = (math.inf, math.nan)
    for i in np.flatnonzero(np.sign(excess[1:]) != np.sign(excess[:-1])):
        w = float(brentq(beyond, omega[i], omega[i + 1], xtol=1e-14 * omega[i], rtol=1e-14))
        turn = float(np.angle(loop.open(np.array([1j * w]))[0])) + math.pi
        best = min(best, (turn / w, w))
    return best


def right_half_roots(loop: Loop, delay: float, points: int = 8000) -> int:
    """Number of characteristic roots to the right of the imaginary axis, by the argument principle.

    The determinant over (s + a)^(2 n) turns by -pi for each of them while s goes from 0 to j infinity. Needs
    K_g m_e b^T M^-1 b < 1: beyond that there are infinitely many.
    """
    omega = _frequencies(loop, points)
    # The delay turns the determinant once every 2 pi / delay while |L| > 1, which is over far below the last of them.
    if delay > 0:
        omega = np.unique(np.concatenate((omega, np.arange(0.1 / delay, omega[-1] / 500, 0.1 / delay))))
    scale = math.sqrt(float(np.abs(loop.stiffness).max() / np.abs(loop.mass).max()) + 1.0)
    s = 1j * omega
    value = np.linalg.det(loop.whole(s, delay) / np.abs(loop.mass).max() / (s[:, None, None] + scale) ** 2)
    value = np.concatenate(([abs(value[0]) * np.sign(value[0].real)], value))
    turns = np.angle(value[1:] / value[:-1])
    return round(-float(turns.sum()) / math.pi)


def free_roots(loop: Loop) -> Complexes:
    """The oscillating roots without any delay, rising in size: eigenvalues of the states x, x' and series forces."""
    n = len(loop.load)
    parts = [(place, answer, 1.0) for place, answer in loop.elements]
    parts += [(rig.place, rig.answer, rig.gain) for rig in loop.rigs]
    mass, damping, stiffness = loop.mass.copy(), loop.damping.copy(), loop.stiffness.copy()
    series = []
    for place, answer, gain in parts:
        outer = gain * np.outer(place, place)
        mass = mass + answer.mass * outer
        damping = damping + answer.damping * outer
        stiffness = stiffness + answer.stiffness * outer
        series += [(place, gain * k, k / c) for k, c in answer.series]
    states = np.zeros((2 * n + len(series), 2 * n + len(series)))
    states[:n, n : 2 * n] = np.eye(n)
    states[n : 2 * n, :n] = -np.linalg.solve(mass, stiffness)
    states[n : 2 * n, n : 2 * n] = -np.linalg.solve(mass, damping)
    for i, (place, k, pace) in enumerate(series, 2 * n):
        states[n : 2 * n, i] = -np.linalg.solve(mass, place)
        states[i, n : 2 * n] = k * place
        states[i, i] = -pace
    found = np.linalg.eigvals(states)
    found = found[found.imag > 1e-9 * np.abs(found)]
    roots: Complexes = found[np.argsort(np.abs(found))]
    return roots


def root_near(loop: Loop, start: complex, delay: float) -> complex:
    """The characteristic root that `fsolve`'s hybrid method finds from `start`."""
    size = abs(np.linalg.det(loop.whole(np.array([start * (1 + 0.01j)]), delay))[0])

    def residual(z: Floats) -> list[float]:
        value = np.linalg.det(loop.whole(np.array([complex(z[0], z[1]) * abs(start)]), delay))[0] / size
        return [value.real, value.imag]

    found = root(residual, [start.real / abs(start), start.imag / abs(start)], tol=1e-14)
    return complex(*found.x) * abs(start)


# Restoring forces -----------------------------------------------------------------------------------------------------

Motion = Callable[[Any], Any]
"""A displacement or velocity at a time, or at an array of times."""


def free_motion(ground: Floats, rate_hz: float) -> CubicHermiteSpline:
    """Displacement of a free mass over a ground motion that is linear between samples: cubic between them, exactly."""
    dt = 1 / rate_hz
    velocity = np.concatenate(([0.0], np.cumsum(-dt * (ground[:-1] + ground[1:]) / 2)))
    step = dt * velocity[:-1] - dt**2 * (ground[:-1] / 3 + ground[1:] / 6)
    displacement = np.concatenate(([0.0], np.cumsum(step)))
    return CubicHermiteSpline(np.arange(len(ground)) * dt, displacement, velocity)


@dataclass(frozen=True)
class Hysteresis:
    """Eq 13 with Baber and Wen's degradation by the dissipated energy e' = (1 - eta) z x' / x_y."""

    k: float
    x_y: float
    eta: float
    beta: float
    gamma: float
    q: float
    strength: float = 0.0
    stiffness: float = 0.0

    def rate(self, velocity: float, z: float, e: float) -> tuple[float, float]:
        nu, mu = 1 + self.strength * e, 1 + self.stiffness * e
        yielded = self.gamma * abs(velocity) * z * abs(z) ** (self.q - 1) if z else 0.0
        yielded += self.beta * velocity * abs(z) ** self.q
        return (velocity - nu * yielded) / (mu * self.x_y), (1 - self.eta) * z * velocity / self.x_y

    def force(self, x: Floats, z: Floats) -> Floats:
        return self.eta * self.k * x + (1 - self.eta) * self.k * self.x_y * z


def hysteretic(law: Hysteresis, x: Motion, v: Motion, at: Floats, rtol: float = 1e-8) -> tuple[Floats, Floats, Floats]:
    """Force, z and e at times `at` under the motion x(t), x'(t)."""
    found = solve_ivp(
        lambda t, y: law.rate(v(t), y[0], y[1]),
        (at[0], at[-1]),
        [0.0, 0.0],
        method="DOP853",
        t_eval=at,
        rtol=rtol,
        atol=1e-3 * rtol,
        max_step=0.02,
    )
    return law.force(x(at), found.y[0]), found.y[0], found.y[1]


def series_force(k: float, c: float, v: Motion, at: Floats) -> Floats:
    """r' = k x' - r k / c."""
    found = solve_ivp(
        lambda t, r: v(t) - r * k / c,
        (at[0], at[-1]),
        [0.0],
        method="LSODA",
        t_eval=at,
        rtol=1e-10,
        atol=1e-13,
        max_step=0.02,
    )
    force: Floats = k * found.y[0]
    return force


def along_lines(rate: Callable[[float, Floats], Sequence[float]], slopes: Floats, dt: float) -> Floats:
    """The memory (n + 1, 2) of a law that is moved at these velocities, each for `dt`, from rest."""
    memory = [np.zeros(2)]
    for v in slopes:
        found = solve_ivp(lambda t, y, v=v: rate(v, y), (0.0, dt), memory[-1], method="RK45", rtol=1e-8, atol=1e-10)
        memory.append(found.y[:, -1])
    return np.array(memory)


# The sampled loop -----------------------------------------------------------------------------------------------------


def chen_ricles(
    whole: tuple[Floats, Floats, Floats],
    numerical: tuple[Floats, Floats, Floats],
    load: Floats,
    ground: Floats,
    rate_hz: float,
    answer: Callable[[int, Floats, Floats], Floats],
) -> Floats:
    """Chen and Ricles's integration as the method states it, displacements (n, n_dof).

    v_(n+1) = v_n + dt a1 a_n;  x_(n+1) = x_n + dt v_n + dt^2 a2 a_n;  a1 = a2 = 4 (4 M + 2 dt C + dt^2 K)^-1 M of the
    whole structure. `answer(sample, x, v)` is the force of specimens and elements on the degrees of freedom.
    """
    dt = 1 / rate_hz
    mass, damping, stiffness = whole
    a1 = a2 = 4 * np.linalg.solve(4 * mass + 2 * dt * damping + dt**2 * stiffness, mass)
    x, v, a = np.zeros(len(load)), np.zeros(len(load)), np.zeros(len(load))
    history = np.empty((len(ground), len(load)))
    for sample in range(len(ground)):
        if sample:
            x = x + dt * v + dt**2 * a2 @ a
            v = v + dt * a1 @ a
        force = -load * ground[sample] - numerical[1] @ v - numerical[2] @ x - answer(sample, x, v)
        a = np.linalg.solve(numerical[0], force)
        history[sample] = x
    return history
