"""SciPy's DOP853, many steps at a time by machine code where that is asked.

Coefficients (attributes of SciPy's class), estimate and control are SciPy's own.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.5, II.10.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853

from blockmech.dynamics.equation import Equation
from blockmech.dynamics.motion import Floats
from blockmech.dynamics.system import REPORTED
from blockmech.engines.stages import Scheme, Steps


@cache
def scheme() -> Scheme:
    """Twelve stages of the step, the rates at its end, three of its dense output."""
    n, whole = DOP853.n_stages, len(DOP853.D[0])
    A, C = np.zeros((whole, whole)), np.ones(whole)
    A[:n, :n], A[n, :n], A[n + 1 :] = DOP853.A, DOP853.B, DOP853.A_EXTRA
    C[:n], C[n + 1 :] = DOP853.C, DOP853.C_EXTRA
    return Scheme(A, C, np.array([DOP853.E5, DOP853.E3]))


class Dop853(DOP853):  # type: ignore[misc]
    """The method on an `Equation`."""

    t: float
    y: Floats
    f: Floats
    h_abs: float

    def __init__(self, equation: Equation, t0: float, y0: Floats, bound: float, **how: Any) -> None:
        super().__init__(equation, t0, y0, bound, **how)
        self.equation = equation

    def steps(self, road: tuple[float, float]) -> AcceptedSteps | None:
        """The next steps by machine code, up to one that may leave a road; None without any."""
        code, by = self.equation.code, scheme()
        if code is None:
            return None
        tolerances = np.array([self.rtol + 0 * self.y, self.atol + 0 * self.y])
        begin, ends = (self.t, self.y), (self.t_bound, self.max_step)
        left = (self.equation.most - self.equation.spent) / len(by.C)
        most = int(min(REPORTED, left + 1))
        accepted = code.steps(by, begin, self.h_abs, ends, road, tolerances, most)
        many = len(accepted.K)
        more = len(by.C) - self.n_stages - 1
        self.equation.took(1 + accepted.tried * self.n_stages + many * more)
        if not many:
            return None
        self.t_old, self.t = accepted.t[-2:].tolist()
        self.y_old, self.y = accepted.y[-2:]
        self.h_abs, self.f = accepted.h, accepted.K[-1, self.n_stages].copy()
        self.h_previous = self.t - self.t_old
        self.status = "finished" if self.t >= self.t_bound else "running"
        return AcceptedSteps(accepted.t, accepted.y, Dense.of(accepted), accepted.calm)


class AcceptedSteps(NamedTuple):
    """Steps, one after the other.

    t : (m + 1,) [s], y : (m + 1, n) where they begin, and where the last ends
    dense : states (n, ...) at times (...): at one, or (p,)
    calm : in how many, the first ones, nothing happens for sure
    """

    t: Floats
    y: Floats
    dense: Callable[[Any], Any]
    calm: int = 0

    def part(self, first: int, end: int) -> AcceptedSteps:
        """Some of them."""
        return self._replace(t=self.t[first : end + 1], y=self.y[first : end + 1])

    def until(self, t: float, y: Any) -> AcceptedSteps:
        """The same, the last to another end."""
        return self._replace(t=np.append(self.t[:-1], t), y=np.vstack([self.y[:-1], y]))


@dataclass(frozen=True)
class Dense:
    """Dense output: ``series`` (8, m, n) times powers of the share x of a step and of x (1 - x)."""

    t: Floats
    series: Floats

    @classmethod
    def of(cls, steps: Steps) -> Dense:
        """From the rates at their stages."""
        t, y, K = steps[:3]
        h, moved, series = t[1:] - t[:-1], y[1:] - y[:-1], np.empty((8, *y[1:].shape))
        ways = h[:, None] * K[:, [0, DOP853.n_stages]].swapaxes(0, 1)
        series[:4] = h[:, None] * (DOP853.D[::-1] @ K).swapaxes(0, 1)
        series[4:] = 2 * moved - ways[1] - ways[0], ways[0] - moved, moved, y[:-1]
        return cls(t, series)

    def __call__(self, t: Any) -> Floats:
        i = self.t[1:-1].searchsorted(t)
        x = (t - self.t[i]) / (self.t[i + 1] - self.t[i])
        z = x * (1 - x)
        powers = np.array([z * z * z * x, z * z * z, z * z * x, z * z, z * x, z, x, 1 + 0 * x])
        return np.asarray(np.einsum("k...,k...n->n...", powers, self.series[:, i]))
