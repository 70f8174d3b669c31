"""SciPy's DOP853 and Radau, many steps at a time by machine code where that is asked.

Coefficients, estimates and control of both are SciPy's own, but that DOP853's estimate is that of
order 5 alone where the equation has corners (`stages`), and that a run may go by half the steps of
another.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.5, II.10;
Hairer & Wanner, Solving Ordinary Differential Equations II, 1996, IV.8.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from blockmech.dynamics.equation import Equation
from blockmech.dynamics.system import REPORTED
from blockmech.engines.dense import Dense
from blockmech.engines.radau import left_of, radau
from blockmech.engines.stages import THIRD, Method, dop853, halved
from blockmech.result.motion import Floats

NO_PLAN = np.empty(0)


class MachineSteps(ABC):
    """A method on an `Equation`.

    By machine code nothing of SciPy's is needed: its own solver is made, and the package loaded,
    for a step that cannot be done by that.

    Attributes
    ----------
    t, y : [s] and state reached, t_old : [s] where the last step begins
    h_abs : [s] the step to try next; 0 before the first one, which is to fit
    status : "running", "finished" or "failed"
    """

    method: ClassVar[Callable[[], Method]]
    t_old: float | None = None
    status = "running"
    h_abs = 0.0

    def __init__(
        self,
        equation: Equation,
        t0: float,
        y0: Floats,
        bound: float,
        *,
        rtol: Floats,
        atol: Floats,
        finer: Floats | None = None,
        plan: Floats = NO_PLAN,
    ) -> None:
        """See SciPy's; ``finer`` and ``plan`` as `CompiledStepper.steps` takes them."""
        self.equation, self.t, self.y = equation, t0, y0
        self.t_bound = bound
        self.tolerances, self.finer, self.plan = np.array([rtol, atol]), finer, plan
        self.weight = THIRD if equation.system.smooth else 0.0
        self._own: Any = None
        equation.method = type(self).method

    def step(self) -> None:
        """One step, by SciPy."""
        if self._own is None or self._own.t != self.t:
            first = min(self.h_abs, self.t_bound - self.t) or None
            about = self.equation, self.t, self.y, self.t_bound, math.inf
            self._own = self._made(*about, *self.tolerances, first_step=first)
        own = self._own
        own.max_step = halved(self.plan, max(len(self.plan) - 1, 0), self.t, math.inf)
        own.step()
        self.t_old, self.t, self.y, self.h_abs = own.t_old, own.t, own.y, own.h_abs
        self.status = own.status

    def dense_output(self) -> Any:
        """States in the last step."""
        return self._own.dense_output()

    @abstractmethod
    def _made(self, *about: Any, first_step: float | None) -> Any:
        """SciPy's solver, from arguments in its order."""

    def steps(self, free_range: tuple[float, float], every: bool) -> AcceptedSteps | None:
        """The next steps by machine code, up to one that may leave a free_range; None without any.

        every : whether a standstill ends a step
        """
        code, by = self.equation.code, self.equation.method()
        if code is None:
            return None
        begin = self.t, self.y
        left = (self.equation.most - self.equation.spent) / by.stages
        most = int(min(REPORTED, left + 1))
        begins = 1 + int(self.h_abs == 0)
        first = min(int(self.plan.searchsorted(self.t, "right")) - 1, len(self.plan) - 2)
        about = self.weight, self.plan[max(first, 0) :]
        how, self.finer = (self.tolerances, most, every, self.finer, *about), None
        made = code.steps(begin, self.h_abs, self.t_bound, free_range, *how)
        many = len(made.series)
        self.equation.know(float(made.y[-1, 0]), *made.row[made.y.shape[1] :][:2])
        self.equation.took(begins + made.tried * by.states[0] + many * by.states[1])
        if not many:
            return None
        self.t_old, self.t = made.t[-2:].tolist()
        self.y, self.h_abs = made.y[-1], made.h
        self.status = "finished" if self.t >= self.t_bound else "running"
        calm = many - made.doubtful
        turns = [] if every else made.turns[:calm].nonzero()[0].tolist()
        dense = Dense(made.t[:-1], made.t[1:] - made.t[:-1], made.series)
        return AcceptedSteps(made.t, made.y, dense, calm, turns)


class Dop853(MachineSteps):
    """The explicit method."""

    method = staticmethod(dop853)

    def _made(self, *about: Any, first_step: float | None) -> Any:
        from scipy.integrate import DOP853

        solver = DOP853(*about, first_step=first_step)
        solver.E3 = math.sqrt(self.weight / THIRD) * solver.E3
        return solver


class Radau5(MachineSteps):
    """The method for stiff equations."""

    method = staticmethod(radau)

    def _made(self, *about: Any, first_step: float | None) -> Any:
        """SciPy's, which takes one relative tolerance."""
        from scipy.integrate import Radau

        *begin, rtol, atol = about
        solver = Radau(*begin, rtol.max(), atol, first_step=first_step)
        solver.newton_tol = left_of(float(solver.rtol))
        return solver


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
