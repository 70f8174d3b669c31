"""SciPy's DOP853, its stages in machine code once that pays.

Coefficients, estimate and control of the step are SciPy's. Stages that machine code leaves to
another algorithm (friction that no certificate covers) are worked out by the equation itself.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.5, II.10.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.integrate._ivp.rk import MAX_FACTOR, MIN_FACTOR, SAFETY

from blockmech.dynamics.equation import Equation
from blockmech.dynamics.motion import Floats
from blockmech.engines.stages import Stages


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
        if self.stages.run(first, last, t, y, h):
            self.equation.took(last - first, self.stages.state, self.stages.K[last - 1])
            return self.stages.state[:n].copy()
        A, C = scheme()
        for s in range(first, last):
            state = y + h * (A[s, :s] @ K[:s])
            K[s] = self.fun(t + C[s] * h, state)
        return state

    def _dense_output_impl(self) -> Any:
        if self.stages is not None:
            ends = self.n_stages + 1, len(self.K_extended)
            self._worked_out(*ends, self.t_old, self.y_old, self.h_previous)
        return super()._dense_output_impl()
