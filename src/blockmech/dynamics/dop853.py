"""SciPy's DOP853, many steps at a time by machine code where that is asked.

Coefficients (attributes of SciPy's class), estimate and control are SciPy's own.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.5, II.10.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853

from blockmech.dynamics.equation import Equation
from blockmech.dynamics.motion import Floats
from blockmech.dynamics.system import REPORTED
from blockmech.engines.stages import Scheme


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

    def steps(self) -> list[Step]:
        """The next steps by machine code; none where it has none for the next one."""
        code, by = self.equation.code, scheme()
        if code is None:
            return []
        tolerances = np.array([self.rtol + 0 * self.y, self.atol + 0 * self.y])
        begin, ends = (self.t, self.y, self.f), (self.t_bound, self.max_step)
        left = (self.equation.most - self.equation.spent) / len(by.C)
        most = int(min(REPORTED, left + 1))
        found = code.steps(by, begin, self.h_abs, ends, tolerances, most)
        many = len(found.K)
        self.equation.took(found.tried * (self.n_stages) + many * (len(by.C) - self.n_stages - 1))
        if many:
            self.t_old, self.t = found.t[-2:].tolist()
            self.y_old, self.y = found.y[-2:]
            self.h_abs, self.f = found.h, found.K[-1, self.n_stages]
            self.h_previous = self.t - self.t_old
            self.status = "finished" if self.t >= self.t_bound else "running"
        t = found.t.tolist()
        return [*map(Step, t, t[1:], found.y, found.y[1:], found.K)]


class Step(NamedTuple):
    """A step and its dense output, of which nothing is worked out before it is asked for."""

    t_old: float
    t: float
    y_old: Floats
    y: Floats
    K: Floats

    def __call__(self, t: Any) -> Floats:
        """States (n, ...) at times."""
        times = np.reshape(t, (1, -1))
        return np.asarray(between([self], times)[0].reshape(-1, *np.shape(t)))


def between(steps: Sequence[Step], t: Floats) -> Floats:
    """States (m, n, p) in some steps (m,) at times (m, p), p of each."""
    t_old, t_new, y_old, y, K = map(np.array, zip(*steps, strict=True))
    h, moved = (t_new - t_old)[:, None], y - y_old
    first, last = h * K[:, 0], h * K[:, DOP853.n_stages]
    rest = h * (DOP853.D @ K).swapaxes(0, 1)
    x, total = ((t - t_old[:, None]) / h)[:, None], np.zeros((*y.shape, 1))
    for i, part in enumerate([*rest[::-1], 2 * moved - last - first, first - moved, moved]):
        total = (total + part[..., None]) * (1 - x if i % 2 else x)
    return np.asarray(y_old[..., None] + total)
