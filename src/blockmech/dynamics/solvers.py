"""Steps of an `Equation`: of DOP853 and Radau, and of a fixed size as in the textbooks.

Those of the first come many at a time by machine code, else one by one from SciPy. Coefficients,
estimates and control are SciPy's own, but that DOP853's estimate is that of order 5 alone where the
equation has corners (`stages`), and that a run may go by half the steps of another. Whoever makes
steps, they leave one kind of record: states, and series for those between.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.5, II.10;
Hairer & Wanner, Solving Ordinary Differential Equations II, 1996, IV.8.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.dynamics.system import REPORTED
from blockmech.engines.dense import Dense
from blockmech.engines.radau import iteration_tolerance, radau
from blockmech.engines.stages import FAR, THIRD, dop853, halved
from blockmech.typing import Floats

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver

    from blockmech.dynamics.equation import Equation

METHODS = {"dop853": dop853, "radau": radau}
NO_PLAN = np.empty(0)
ANYWHERE = (-math.inf, math.inf)


class AcceptedSteps(NamedTuple):
    """Steps, one after the other.

    t : (m + 1,) [s], y : (m + 1, n) where they begin, and where the last ends
    dense : states (n, ...) at times (...): at one, or (p,)
    calm : in how many, the first ones, nothing happens for sure but standstills
    turns : in which of those the only driver may stand still
    """

    t: Floats
    y: Floats
    dense: Dense
    calm: int = 0
    turns: Sequence[int] = ()

    @classmethod
    def single(cls, t: Sequence[float], y: Sequence[Floats], dense: Dense) -> AcceptedSteps:
        """A step from one time and state to others."""
        return cls(np.array(t), np.array(y), dense)

    def part(self, first: int, end: int) -> AcceptedSteps:
        """Some of them."""
        ends, dense = slice(first, end + 1), self.dense.part(first, end)
        return self._replace(t=self.t[ends], y=self.y[ends], dense=dense)

    def until(self, t: float, y: float | Floats) -> AcceptedSteps:
        """The same, the last to another end."""
        return self._replace(t=np.append(self.t[:-1], t), y=np.vstack([self.y[:-1], y]))


class Solver(ABC):
    """Steps of an equation from a state (t, y) up to a bound [s]."""

    def __init__(self, equation: Equation, t: float, y: Floats, bound: float) -> None:
        self.equation, self.t, self.y, self.bound = equation, t, y, bound

    @abstractmethod
    def steps(
        self, free_range: tuple[float, float] = ANYWHERE, every: bool = True
    ) -> AcceptedSteps | None:
        """The next step, or some at once, the last of which may leave a free_range.

        every : whether a standstill ends a step
        None where there is none to be made.
        """


class AdaptiveSolver(Solver):
    """DOP853 or Radau.

    By machine code nothing of SciPy's is needed: its own solver is made, and the package loaded,
    for a step that cannot be done by that.
    """

    def __init__(
        self, equation: Equation, t: float, y: Floats, bound: float, method: str,
        tolerances: Floats, plan: Floats = NO_PLAN, finer: Floats | None = None,
    ) -> None:  # fmt: skip
        """Tolerances are (2, n) relative and absolute ones; ``finer`` and ``plan`` as
        `CompiledStepper.steps` takes them."""
        super().__init__(equation, t, y, bound)
        self.tolerances, self.finer, self.plan = tolerances, finer, plan
        self.weight = THIRD if equation.system.smooth else 0.0
        self.h, self._scipys = 0.0, None  # [s] to try next, 0 before a first step, which is to fit
        self.method, equation.method = method, METHODS[method]

    def steps(
        self, free_range: tuple[float, float] = ANYWHERE, every: bool = True
    ) -> AcceptedSteps | None:
        """See `Solver`; one step where it is SciPy's."""
        return self._by_machine_code(free_range, every) or self._by_scipy()

    def _by_machine_code(
        self, free_range: tuple[float, float], every: bool
    ) -> AcceptedSteps | None:
        code, by = self.equation.code, self.equation.method()
        if code is None:
            return None
        remaining = (self.equation.limit - self.equation.spent) / by.stages
        limit = int(min(REPORTED, remaining + 1))
        begins = 1 + int(self.h == 0)
        first = min(int(self.plan.searchsorted(self.t, "right")) - 1, len(self.plan) - 2)
        about = self.weight, self.plan[max(first, 0) :]
        options, self.finer = (self.tolerances, limit, every, self.finer, *about), None
        steps = code.steps((self.t, self.y), self.h, self.bound, free_range, *options)
        many = len(steps.series)
        self.equation.know(steps.y[-1], *steps.row[steps.y.shape[1] :][:2])
        self.equation.took(begins + steps.tried * by.states[0] + many * by.states[1])
        if not many:
            return None
        self.t, self.y, self.h = float(steps.t[-1]), steps.y[-1], steps.h
        # Stops of several drivers, and of their pairs, are not seen from its numbers.
        calm = many - steps.doubtful if self.equation.layout.scalar else 0
        turns = [] if every else steps.turns[:calm].nonzero()[0].tolist()
        dense = Dense(steps.t[:-1], steps.t[1:] - steps.t[:-1], steps.series)
        return AcceptedSteps(steps.t, steps.y, dense, calm, turns)

    def _by_scipy(self) -> AcceptedSteps | None:
        solver, y = self._solver_of_scipy(), self.y
        solver.max_step = halved(self.plan, max(len(self.plan) - 1, 0), self.t, math.inf)
        with np.errstate(all="ignore"):
            try:
                solver.step()
            except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
                if error is self.equation.error:  # the mechanism's own, not the solver's
                    raise
                return None
            if solver.status == "failed" or not np.isfinite(solver.y).all():
                return None
            series = series_of(solver.dense_output())
        self.t, self.y, self.h = float(solver.t), solver.y, solver.h_abs
        dense = Dense(np.array([solver.t_old]), np.array([solver.t - solver.t_old]), series[None])
        return AcceptedSteps.single((solver.t_old, solver.t), (y, solver.y), dense)

    def _solver_of_scipy(self) -> OdeSolver:
        """The one of the step before, or one that begins here."""
        if self._scipys is None or self._scipys.t != self.t:
            from scipy.integrate import DOP853, Radau

            (rtol, atol), first = self.tolerances, min(self.h, self.bound - self.t) or None
            about = self.equation, self.t, self.y, self.bound
            if self.method == "radau":  # which takes one relative tolerance
                solver = Radau(*about, rtol=rtol.max(), atol=atol, first_step=first)
                solver.newton_tol = iteration_tolerance(float(solver.rtol))
            else:
                solver = DOP853(*about, rtol=rtol, atol=atol, first_step=first)
                solver.E3 = math.sqrt(self.weight / THIRD) * solver.E3
            self._scipys = solver
        return self._scipys


class FixedSteps(Solver):
    """Steps of a size, the last one shorter; between their ends cubics."""

    def __init__(self, equation: Equation, t: float, y: Floats, bound: float, size: float) -> None:
        super().__init__(equation, t, y, bound)
        self.size = size

    def step_to(self, t: float, y: Floats, slope: Floats, end_slope: Floats) -> AcceptedSteps:
        """The step to a time [s] and state, with rates at both ends."""
        dense = Dense.cubic(self.t, t - self.t, (self.y, y), (slope, end_slope))
        step = AcceptedSteps.single((self.t, t), (self.y, y), dense)
        self.t, self.y = t, y
        return step


class RungeKutta4(FixedSteps):
    """The textbooks' scheme of order 4: steps h of time,

    y_{n+1} = y_n + h (k1 + 2 k2 + 2 k3 + k4) / 6 on y' = f(t, y).
    """

    slope: Floats | None = None

    def rates(self, t: float, y: Floats) -> Floats:
        """y' at a state."""
        return np.asarray(self.equation(t, y), dtype=np.float64)

    def steps(self, *_: object) -> AcceptedSteps | None:
        """One step; None to where there is no pose."""
        t, y = self.t, self.y
        k1 = self.rates(t, y) if self.slope is None else self.slope
        last = self.bound - t <= self.size
        h = self.bound - t if last else self.size
        k2 = self.rates(t + h / 2, y + h / 2 * k1)
        k3 = self.rates(t + h / 2, y + h / 2 * k2)
        k4 = self.rates(t + h, y + h * k3)
        end_state = self.bound if last else t + h, y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        self.slope = self.rates(*end_state)
        return self.step_to(*end_state, k1, self.slope) if np.isfinite(self.slope).all() else None


class EulerQ(FixedSteps):
    """The second paper's scheme of order 1: steps d of the driver's coordinate.

    The loads are those where a step begins, and its acceleration xi is constant:

        xi_i = (tau(q_i, w_i, t_i) - w_i^2 (J_{i+1} - J_i) / (2 d)) / J_i
        w_{i+1}^2 = w_i^2 + 2 xi_i d,    t_{i+1} = t_i + 2 d / (w_i + w_{i+1})

    A step ends where the driver stands still, and where the time is over; y = (q, w, W).

    Source: [D14] Durango et al. 2014, Eq. 2 and Fig. 1, steps ii to v.
    """

    sense, i = 0.0, REPORTED

    def _sampled(self, sense: float) -> None:
        """Inertia, effort at rest and margin at the next places in a direction."""
        self.sense, self.i = sense, 0
        # Rounded, but not summed.
        coordinates = self.y[0] + sense * self.size * np.arange(REPORTED + 1.0)
        terms = self.equation.system.sample(coordinates)
        J = np.where(terms.margin > 0, terms.J, math.nan)
        self.J, self.tau, self.margin = J.tolist(), terms.tau.tolist(), terms.margin.tolist()
        self.coordinates = coordinates.tolist()

    def _effort(self, t: float, q: float, w: float) -> float:
        """Effort of all loads where a step begins: step v of the paper."""
        system = self.equation.system
        return self.tau[self.i] if system.depends_on <= {"q"} else system.scalar_terms(q, w, t).tau

    def steps(self, *_: object) -> AcceptedSteps | None:
        """One step; None to where there is no pose, or it would bounce off a dead centre."""
        self.equation.spend(1)
        t, (q, w, work) = self.t, self.y.tolist()
        if self.i == REPORTED or not w:
            self._sampled(math.copysign(1.0, w or self.equation.system.scalar_terms(q, 0.0, t).tau))
        i, d = self.i, self.coordinates[self.i + 1] - q
        J, J_next, tau = self.J[i], self.J[i + 1], self._effort(t, q, w)
        xi = (tau - w * w * (J_next - J) / (2 * d)) / J
        square = w * w + 2 * xi * d
        at_rest = square <= 0
        if square != square or (at_rest and self.margin[i + 1] < FAR**2):
            return None
        rate = 0.0 if at_rest else self.sense * math.sqrt(square)
        h = -w / xi if at_rest else 2 * d / (w + rate)
        end, later = q - w * w / (2 * xi) if at_rest else self.coordinates[i + 1], t + h
        if later >= self.bound:
            h, later = self.bound - t, self.bound
            end, rate = q + w * h + xi * h * h / 2, w + xi * h
        self.i = i + 1
        self.equation.know(np.array([end]), self.margin[i + 1], J_next)
        y, slopes = [end, rate, work + tau * (end - q)], ([w, xi, tau * w], [rate, xi, tau * rate])
        return self.step_to(later, np.array(y), *map(np.array, slopes))


STEPPERS: Mapping[str, Callable[..., Solver]] = {"rk4": RungeKutta4, "euler_q": EulerQ}


def series_of(dense: Any) -> Floats:
    """The series (8, n) of a step of SciPy's, see `blockmech.engines.dense`."""
    series = np.zeros((8, len(dense.y_old)))
    if hasattr(dense, "Q"):  # a cubic, by powers of the share of the step
        first, second, third = dense.Q.T
        series[4:7] = -third, -third - second, first + second + third
    else:
        series[:7] = dense.F[::-1]
    series[7] = dense.y_old
    return series
