"""SciPy's DOP853 and Radau, many steps at a time by machine code where that is asked.

Coefficients, estimates and control of both are SciPy's own.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.5, II.10;
Hairer & Wanner, Solving Ordinary Differential Equations II, 1996, IV.8.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.integrate import DOP853, Radau

from blockmech.dynamics.equation import Equation
from blockmech.dynamics.system import REPORTED
from blockmech.engines.dense import Dense
from blockmech.engines.radau import radau
from blockmech.engines.stages import Method, dop853
from blockmech.motion import Floats
from blockmech.plane import EPS


class MachineSteps:
    """A method of SciPy's on an `Equation`, whose rates at the start are known.

    By machine code nothing of SciPy's is needed: it is made for the first step that cannot be
    done by that.
    """

    method: ClassVar[Callable[[], Method]]
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
        equation.method = type(self).method

    def step(self) -> str | None:
        """One step, by SciPy."""
        if not self.begun:
            self._begin(*self.tolerances)
            self.begun = True
        failed: str | None = super().step()  # type: ignore[misc]
        return failed

    def _begin(self, rtol: Any, atol: Floats) -> None:
        first = min(self.h_abs, self.t_bound - self.t) or None
        about = self.equation, self.t, self.y, self.t_bound, self.max_step, rtol, atol
        super().__init__(*about, first_step=first)  # type: ignore[call-arg]

    def steps(self, free_range: tuple[float, float], every: bool) -> AcceptedSteps | None:
        """The next steps by machine code, up to one that may leave a free_range; None without any.

        every : whether a standstill ends a step
        """
        code, by = self.equation.code, self.equation.method()
        if code is None:
            return None
        begin, ends = (self.t, self.y), (self.t_bound, self.max_step)
        left = (self.equation.most - self.equation.spent) / by.stages
        most = int(min(REPORTED, left + 1))
        begins = 1 + int(self.h_abs == 0)
        how, self.finer = (self.tolerances, most, every, self.finer), None
        made = code.steps(begin, self.h_abs, ends, free_range, *how)
        many = len(made.series)
        self.equation.took(begins + made.tried * by.states[0] + many * by.states[1])
        if not many:
            return None
        self.t_old, self.t = made.t[-2:].tolist()
        self.y, self.h_abs, self.begun = made.y[-1], made.h, False
        self.status = "finished" if self.t >= self.t_bound else "running"
        calm = many - made.doubtful
        turns = [] if every else made.turns[:calm].nonzero()[0].tolist()
        dense = Dense(made.t[:-1], made.t[1:] - made.t[:-1], made.series)
        return AcceptedSteps(made.t, made.y, dense, calm, turns)


class Dop853(MachineSteps, DOP853):  # type: ignore[misc]
    """The explicit method."""

    method = staticmethod(dop853)


class Radau5(MachineSteps, Radau):  # type: ignore[misc]
    """The method for stiff equations."""

    method = staticmethod(radau)
    newton_tol: float

    def _begin(self, rtol: Any, atol: Floats) -> None:
        """SciPy's, which takes one relative tolerance."""
        super()._begin(rtol.max(), atol)
        # SciPy's iterates to 10 EPS, every step to the same side: no finer run would show it.
        # This falls with the tolerance, to 10 EPS at the finest.
        self.newton_tol = max(self.newton_tol, math.sqrt(EPS / self.rtol))


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
