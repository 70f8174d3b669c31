"""SciPy's DOP853, its stages in machine code once that pays.

Coefficients, estimate and control of the step are SciPy's.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.5, II.10.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import DOP853, DenseOutput
from scipy.integrate._ivp.rk import MAX_FACTOR, MIN_FACTOR, SAFETY

from blockmech.dynamics.equation import Equation
from blockmech.dynamics.motion import Floats
from blockmech.engines.stages import Stages

ESTIMATES = np.array([DOP853.E5, DOP853.E3])  # (2, 13) of the orders 5 and 3


@cache
def scheme() -> tuple[Floats, Floats]:
    """Rows A (16, 16) and times C (16,) of all stages.

    Twelve of the step, the rates at its end, three of its dense output.
    """
    n = DOP853.n_stages
    A, C = np.zeros((len(DOP853.D[0]), len(DOP853.D[0]))), np.ones(len(DOP853.D[0]))
    A[:n, :n], A[n, :n], A[n + 1 :] = DOP853.A, DOP853.B, DOP853.A_EXTRA
    C[:n], C[n + 1 :] = DOP853.C, DOP853.C_EXTRA
    return A, C


class Dop853(DOP853):  # type: ignore[misc]
    """The method on an `Equation`."""

    h_abs: float
    t: float
    y: Floats

    def __init__(self, equation: Equation, t0: float, y0: Floats, bound: float, **how: Any) -> None:
        super().__init__(equation, t0, y0, bound, **how)
        self.equation = equation
        self.stages: Stages | None = None

    def _step_impl(self) -> tuple[bool, str | None]:
        if self.stages is None:
            self._compile()
        if self.stages is None:
            found: tuple[bool, str | None] = super()._step_impl()
            return found
        t, y = float(self.t), self.y
        shortest = 10 * (math.nextafter(t, math.inf) - t)  # as SciPy has it
        h_abs, most = max(min(self.h_abs, self.max_step), shortest), MAX_FACTOR
        while h_abs >= shortest:
            t_new = min(t + h_abs, self.t_bound)
            h = t_new - t
            y_new = self._worked_out(1, self.n_stages + 1, t, y, h)
            scale = self.atol + np.maximum(np.abs(y), np.abs(y_new)) * self.rtol
            off = self._estimate_error_norm(self.K, h, scale)
            factor = SAFETY * off**self.error_exponent if off else MAX_FACTOR
            if off < 1:
                self.h_abs = h * min(most, factor)
                self.h_previous, self.y_old, self.t, self.y = h, y, t_new, y_new
                self.f = self.K[-1].copy()
                return True, None
            h_abs, most = h * max(MIN_FACTOR, factor), 1.0
        return False, self.TOO_SMALL_STEP

    def _compile(self) -> None:
        self.stages = self.equation.stages(*scheme())
        if self.stages is not None:
            self.K_extended = self.stages.K[:, : self.n]
            self.K, self.A_EXTRA = self.K_extended[: self.n_stages + 1], ()

    def _worked_out(self, first: int, last: int, t: float, y: Floats, h: float) -> Floats:
        """The rates at some stages; the state of the last one."""
        assert self.stages is not None
        K, n = self.K_extended, self.n
        K[0] = self.f if first == 1 else K[0]
        self.stages.run(first, last, t, y, h)
        self.equation.took(last - first, self.stages.state, self.stages.K[last - 1])
        return self.stages.state[:n].copy()

    def _estimate_error_norm(self, K: Floats, h: float, scale: Floats) -> float:
        """SciPy's, in a third of the time: it is asked at every step, whatever works it out."""
        fifth, third = (ESTIMATES @ K) / scale
        a, b = float(fifth @ fifth), float(third @ third)
        return h * a / math.sqrt((a + 0.01 * b) * self.n) if a or b else 0.0

    def _dense_output_impl(self) -> Any:
        if self.stages is None:
            return super()._dense_output_impl()
        ends = self.n_stages + 1, len(self.K_extended)
        self._worked_out(*ends, self.t_old, self.y_old, self.h_previous)
        return Step(self.t_old, self.t, self.y_old, self.y, self.K_extended.copy())


class Step(DenseOutput):  # type: ignore[misc]
    """Dense output of a step, of which nothing is worked out before it is asked for."""

    def __init__(self, t_old: float, t: float, y_old: Floats, y: Floats, K: Floats) -> None:
        super().__init__(t_old, t)
        self.y_old, self.y, self.K = y_old, y, K

    def _call_impl(self, t: Any) -> Floats:
        return interpolated([self], np.atleast_1d(t)).reshape(-1, *t.shape)


def interpolated(steps: Sequence[Step], t: Floats) -> Floats:
    """States (n, m) at times (m,), each in a step of its own or all in one."""
    ends = ((s.t_old, s.t) for s in steps)
    t_old, t_new = np.array(list(ends)).T[:, :, None]
    y_old, y = (np.array([getattr(s, name) for s in steps]) for name in ("y_old", "y"))
    K, h, moved = np.array([s.K for s in steps]), t_new - t_old, y - y_old
    first, last = h * K[:, 0], h * K[:, DOP853.n_stages]
    rest = h * np.moveaxis(DOP853.D @ K, 1, 0)
    x, total = (t[:, None] - t_old) / h, np.zeros_like(y_old)
    for i, part in enumerate([*rest[::-1], 2 * moved - last - first, first - moved, moved]):
        total = (total + part) * (1 - x if i % 2 else x)
    return np.asarray((y_old + total).T)
