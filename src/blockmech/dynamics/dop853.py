"""SciPy's DOP853, many steps at a time by machine code where that is asked.

Coefficients (attributes of SciPy's class), estimate and control are SciPy's own.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.5, II.10.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853

from blockmech.dynamics.equation import Equation
from blockmech.dynamics.system import REPORTED
from blockmech.engines.dense import Dense
from blockmech.engines.stages import scheme
from blockmech.motion import Floats


class Dop853(DOP853):  # type: ignore[misc]
    """The method on an `Equation`, whose rates at the start are known.

    By machine code nothing of SciPy's is needed but its coefficients: the rest is made for the
    first step that it cannot do.
    """

    t: float
    y: Floats
    h_abs: float  # [s] the step to try next; 0 before the first one, which is to fit

    def __init__(
        self,
        equation: Equation,
        t0: float,
        y0: Floats,
        bound: float,
        *,
        rtol: Floats,
        atol: Floats,
        max_step: float,
        finer: Floats | None = None,
    ) -> None:
        """See SciPy's; ``finer`` are tolerances of a run to come, see `CompiledStepper`."""
        self.equation, self.begun, self.h_abs = equation, False, 0.0
        self.t, self.y, self.t_old = t0, y0, None
        self.t_bound, self.max_step, self.status = bound, max_step, "running"
        self.tolerances, self.finer = np.array([rtol, atol]), finer

    def step(self) -> str | None:
        """One step, by SciPy."""
        if not self.begun:
            rtol, atol = self.tolerances
            how = {"rtol": rtol, "atol": atol, "max_step": self.max_step}
            how["first_step"] = min(self.h_abs, self.t_bound - self.t) or None
            super().__init__(self.equation, self.t, self.y, self.t_bound, **how)
            self.begun = True
        failed: str | None = super().step()
        return failed

    def steps(self, free_range: tuple[float, float], every: bool) -> AcceptedSteps | None:
        """The next steps by machine code, up to one that may leave a free_range; None without any.

        every : whether a standstill ends a step
        """
        code, by = self.equation.code, scheme()
        if code is None:
            return None
        begin, ends = (self.t, self.y), (self.t_bound, self.max_step)
        left = (self.equation.most - self.equation.spent) / len(by.C)
        most = int(min(REPORTED, left + 1))
        begins = 1 + (self.h_abs == 0)
        how, self.finer = (self.tolerances, most, every, self.finer), None
        made = code.steps(begin, self.h_abs, ends, free_range, *how)
        many = len(made.series)
        more = len(by.C) - self.n_stages - 1
        self.equation.took(begins + made.tried * self.n_stages + many * more)
        if not many:
            return None
        self.t_old, self.t = made.t[-2:].tolist()
        self.y, self.h_abs = made.y[-1], made.h
        self.status = "finished" if self.t >= self.t_bound else "running"
        calm = many - made.doubtful
        turns = [] if every else made.turns[:calm].nonzero()[0].tolist()
        dense = Dense(made.t[:-1], made.t[1:] - made.t[:-1], made.series)
        return AcceptedSteps(made.t, made.y, dense, calm, turns)


class AcceptedSteps(NamedTuple):
    """Steps, one after the other.

    t : (m + 1,) [s], y : (m + 1, n) where they begin, and where the last ends
    dense : states (n, ...) at times (...): at one, or (p,)
    calm : in how many, the first ones, nothing happens for sure but standstills
    turns : in which of those the only driver may stand still
    """

    t: Floats
    y: Floats
    dense: Callable[[Any], Any]
    calm: int = 0
    turns: Sequence[int] = ()

    def part(self, first: int, end: int) -> AcceptedSteps:
        """Some of them."""
        dense = self.dense.part(first, end) if isinstance(self.dense, Dense) else self.dense
        return self._replace(t=self.t[first : end + 1], y=self.y[first : end + 1], dense=dense)

    def until(self, t: float, y: Any) -> AcceptedSteps:
        """The same, the last to another end."""
        return self._replace(t=np.append(self.t[:-1], t), y=np.vstack([self.y[:-1], y]))
