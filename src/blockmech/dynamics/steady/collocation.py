r"""Steady rotations of a machine with speed-dependent loads, by collocation.

Fourier collocation on one turn: with D the differentiation matrix of n equidistant
nodes,

    (D K)_i = T(x_i, w_i),       w = sqrt(2 K / J),

by Newton's method, started from the constant speed at which the mean power vanishes.
An error of the energy is multiplied every turn by

    exp( integral over the turn of (dT/dw) / (J w) dx ),

the multiplier: below 1 the motion is stable.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.path.march import corrected, effort, effort_slope
from blockmech.dynamics.path.mesh import View
from blockmech.dynamics.path.passage import End, Place
from blockmech.dynamics.path.patches import Patch
from blockmech.dynamics.path.quadrature import EPS
from blockmech.dynamics.system.reduced import feasible

SIZES = (33, 65, 129, 257, 513)
NEWTON_STEPS = 20
STEP = 1e-3  # relative step of the speed for the slopes that make the multiplier
SPEEDS = np.geomspace(1e-3, 1e4, 141)  # [rad/s or m/s] searched for the start


@dataclass(frozen=True)
class Turn:
    """One turn of a periodic motion as Fourier series in x.

    slowness : (n,) 1/w [s/rad or s/m] at equidistant nodes, n odd
    period : [rad or m]
    """

    low: End
    high: End
    period: float
    slowness: Floats
    error: float
    end_error: float = 0.0

    @property
    def total(self) -> float:
        """Time of a turn [s]."""
        return float(self.period * self.slowness.mean())

    @property
    def fastest(self) -> float:
        """Largest speed at the nodes [rad/s or m/s]."""
        return float(1 / self.slowness.min())

    def when(self, x: Floats) -> Floats:
        """Time [s] since x = 0 at places x (m,)."""
        c = np.fft.rfft(self.slowness) / self.slowness.size
        k = np.arange(1, c.size)
        angle = 2 * math.pi / self.period
        waves = np.exp(1j * np.outer(x, k * angle)) - 1
        return np.asarray(c[0].real * x + 2 * (waves @ (c[1:] / (1j * k * angle))).real)

    def place(self, time: Floats) -> Place:
        """Place and speed at times (m,) [s] within the turn."""
        c = np.fft.rfft(self.slowness) / self.slowness.size
        k = np.arange(1, c.size)
        angle = 2 * math.pi / self.period
        grid = np.linspace(0.0, self.period, 2 * self.slowness.size + 1)
        x = np.interp(time, self.when(grid), grid)
        for _ in range(8):
            slowness = self._slowness(x, c, k, angle)
            step = (time - self.when(x)) / slowness
            x = x + step
            if not np.abs(step).max() > 1e-9 * self.period:
                break
        return Place(x, 1 / self._slowness(x, c, k, angle))

    @staticmethod
    def _slowness(x: Floats, c: Any, k: Any, angle: float) -> Floats:
        return np.asarray(c[0].real + 2 * (np.exp(1j * np.outer(x, k * angle)) @ c[1:]).real)


class Rotation(NamedTuple):
    """A periodic rotation found."""

    turn: Turn
    multiplier: float
    start: float  # constant speed it was started from [rad/s or m/s]


def rotations(view: View, accuracy: float) -> list[Rotation]:
    """All periodic motions along growing x that the starts lead to, fastest last."""
    period = view.meter.system.period
    if period is None:
        return []
    patch = _nodes(view, period, SIZES[0])
    if not patch.possible:
        return []
    found: list[Rotation] = []
    for speed in _balanced(view, patch):
        motion = _collocated(view, period, speed, patch, accuracy)
        if motion and all(abs(motion.turn.total / f.turn.total - 1) > 1e-6 for f in found):
            found.append(motion)
    return found


def _nodes(view: View, period: float, n: int) -> Patch:
    x = np.arange(n, dtype=np.float64) * np.float64(period / n)
    wanted = frozenset({"damping"}) if view.meter.system.damped else frozenset()
    sample = view.meter.sample(view.q(x), wanted)
    return Patch(
        low=0.0,
        high=period,
        length=period,
        root=False,
        x=x,
        slope=np.ones(n),
        J=np.asarray(sample.J),
        tau=view.sign * sample.tau,
        damping=np.zeros(n) if sample.damping is None else sample.damping,
        possible=bool(feasible(sample).all()),
        margin=np.asarray(sample.margin),
    )


def _balanced(view: View, patch: Patch) -> list[float]:
    """Constant speeds at which the mean power over a turn vanishes."""

    def power(w: float) -> float:
        return float(effort(view, patch, 0.0, np.full(patch.x.size, w)).mean())

    values = np.array([power(w) for w in SPEEDS.tolist()])
    found = []
    for i in np.flatnonzero(values[:-1] * values[1:] < 0).tolist():
        low, high = float(SPEEDS[i]), float(SPEEDS[i + 1])
        rising = values[i + 1] > 0
        for _ in range(40):
            middle = (low + high) / 2
            if (power(middle) > 0) == rising:
                high = middle
            else:
                low = middle
        found.append((low + high) / 2)
    return found


def _collocated(
    view: View, period: float, speed: float, patch: Patch, accuracy: float
) -> Rotation | None:
    """Newton on n nodes, n growing until the series of 1/w has ended."""
    K = patch.J * speed**2 / 2
    for n in SIZES:
        if n != patch.x.size:
            K = np.maximum(_resampled(K, n), 1e-3 * K.min())
            patch = _nodes(view, period, n)
            if not patch.possible:
                return None
        solved = _newton(view, period, patch, K)
        if solved is None:
            if n == SIZES[0]:
                continue
            return None
        K = solved
        slowness = np.sqrt(patch.J / (2 * K))
        size = np.abs(np.fft.rfft(slowness)) / n
        tail = float(size[-max(2, size.size // 8) :].max())
        turn = Turn(
            End(0.0), End(period), period, slowness, period * (2 * tail + 4 * EPS * size[0])
        )
        if turn.error * turn.fastest <= accuracy or tail <= 1e-15 * size[0]:
            return Rotation(turn, _multiplier(view, period, patch, K), speed)
    return None


def _newton(view: View, period: float, patch: Patch, K: Floats) -> Floats | None:
    D = _derivative(patch.x.size) * (2 * math.pi / period)
    for _ in range(NEWTON_STEPS):
        w = np.sqrt(2 * K / patch.J)
        here = effort(view, patch, 0.0, w)
        gain = effort_slope(view, patch, 0.0, w, here) / (patch.J * w)
        change = np.linalg.solve(D - np.diag(gain), D @ K - here)
        if not np.isfinite(change).all():
            return None
        K, size = corrected(K, change)
        if size < 1e-9:  # the next step, which is not made, would be its square
            return K
    return None


def _multiplier(view: View, period: float, patch: Patch, K: Floats) -> float:
    """What a turn leaves of a disturbance; slopes of the effort by fourth order."""
    w = np.sqrt(2 * K / patch.J)
    near, far = (
        effort(view, patch, 0.0, w * (1 + h)) - effort(view, patch, 0.0, w * (1 - h))
        for h in (STEP, 2 * STEP)
    )
    slope = (8 * near - far) / (12 * STEP * w)
    return math.exp(period * float((slope / (patch.J * w)).mean()))


@cache
def _derivative(n: int) -> Floats:
    """d/dx of trigonometric interpolation on n (odd) nodes of [0, 2 pi): (n, n)."""
    i = np.arange(n)
    distance = (i[:, None] - i) * (math.pi / n)
    with np.errstate(divide="ignore"):
        D = (-1.0) ** (i[:, None] - i) / (2 * np.sin(distance))
    np.fill_diagonal(D, 0.0)
    return np.asarray(D)


def _resampled(f: Floats, n: int) -> Floats:
    """Samples of the trigonometric interpolant on more nodes."""
    return np.asarray(np.fft.irfft(np.fft.rfft(f), n) * (n / f.size))
