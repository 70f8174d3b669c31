r"""Two teaching aids: schemes of fixed steps as in the textbooks, for comparison.

``rk4``, steps h of time, of the classical order 4, on y' = f(t, y):

    y_{n+1} = y_n + h (k1 + 2 k2 + 2 k3 + k4) / 6

``euler_q``, steps d of the driver's coordinate, of order 1, the loads taken where they begin:

    xi_i = (tau(q_i, w_i, t_i) - w_i^2 (J_{i+1} - J_i) / (2 d)) / J_i
    w_{i+1}^2 = w_i^2 + 2 xi_i d,    t_{i+1} = t_i + 2 d / (w_i + w_{i+1})

Sources: [D14] Durango et al. 2014, Eq. 2 and Fig. 1, steps ii to v (euler_q).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.integrate import OdeSolver
from scipy.interpolate import CubicHermiteSpline

from blockmech.dynamics.equation import Equation
from blockmech.dynamics.events import NEAR
from blockmech.dynamics.panel_nodes import AT_ONCE
from blockmech.result.motion import Floats

STEP = 1e-3  # [rad] or of the span, of euler_q, so exact is it; of 200 ms, of rk4 without a time


class RungeKutta4(OdeSolver):  # type: ignore[misc]
    """The classical scheme: steps of ``max_step``, the last one shorter."""

    def __init__(self, fun: Any, t0: float, y0: Floats, t_bound: float, max_step: float) -> None:
        super().__init__(fun, t0, y0, t_bound, vectorized=False)
        self.h = max_step
        self.t: float
        self.y: Floats
        self.slope = self.fun(t0, self.y)

    def _step_impl(self) -> tuple[bool, str | None]:
        t, y, k1 = float(self.t), np.asarray(self.y), self.slope
        last = self.t_bound - t <= self.h
        h = self.t_bound - t if last else self.h
        k2 = self.fun(t + h / 2, y + h / 2 * k1)
        k3 = self.fun(t + h / 2, y + h / 2 * k2)
        k4 = self.fun(t + h, y + h * k3)
        self.begin = y, k1
        self.y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        self.t = self.t_bound if last else t + h
        self.slope = self.fun(self.t, self.y)
        possible = bool(np.isfinite(self.slope).all())
        return possible, None if possible else "no pose"

    def _dense_output_impl(self) -> Any:
        return Cubic.of(self)


class Cubic(CubicHermiteSpline):  # type: ignore[misc]
    """Dense output of a step: the cubic through states and slopes at both ends."""

    @classmethod
    def of(cls, step: RungeKutta4 | EulerQ) -> Cubic:
        """That of the last step of a solver."""
        values, slopes = zip(step.begin, (step.y, step.slope), strict=True)
        return cls((step.t_old, step.t), values, slopes)

    def __call__(self, t: Any) -> Floats:
        """States (n,) or (n, k) at times (k,) [s]."""
        return np.asarray(super().__call__(t).T)


class EulerQ(OdeSolver):  # type: ignore[misc]
    """The scheme of the second paper: steps of ``d`` under constant acceleration.

    A step ends where the driver stands still, and where the time is over; y = (q, w, W).
    """

    t: float
    y: Floats

    def __init__(self, equation: Equation, t0: float, y0: Floats, t_bound: float, d: float) -> None:
        super().__init__(equation, t0, y0, t_bound, vectorized=False)
        self.equation, self.d, self.way, self.i = equation, d, 0.0, AT_ONCE
        self.system, self.place_only = equation.system, equation.system.depends_on <= {"q"}

    def _sampled(self, way: float) -> None:
        """Inertia, effort at rest and margin at the next places in a direction."""
        self.way, self.i = way, 0
        places = self.y[0] + way * self.d * np.arange(AT_ONCE + 1.0)  # rounded, but not summed
        terms = self.system.sample(places)
        J = np.where(terms.margin > 0, terms.J, math.nan)
        self.J, self.tau, self.margin = J.tolist(), terms.tau.tolist(), terms.margin.tolist()
        self.places = places.tolist()

    def _effort(self, t: float, q: float, w: float) -> float:
        """Effort of all loads where a step begins: step v of the paper."""
        return self.tau[self.i] if self.place_only else self.system.one(q, w, t).tau

    def _step_impl(self) -> tuple[bool, str | None]:
        self.equation.spend(1)
        t, (q, w, work) = float(self.t), self.y.tolist()
        if self.i == AT_ONCE or not w:
            self._sampled(math.copysign(1.0, w or self.system.one(q, 0.0, t).tau))
        i, d = self.i, self.places[self.i + 1] - q
        J, ahead, tau = self.J[i], self.J[i + 1], self._effort(t, q, w)
        xi = (tau - w * w * (ahead - J) / (2 * d)) / J
        square = w * w + 2 * xi * d
        stands = square <= 0
        if square != square or (stands and self.margin[i + 1] < NEAR**2):
            return False, "no pose"  # or it would bounce off a dead centre
        rate = 0.0 if stands else self.way * math.sqrt(square)
        h = -w / xi if stands else 2 * d / (w + rate)
        end = q - w * w / (2 * xi) if stands else self.places[i + 1]
        if t + h >= self.t_bound:
            h = self.t_bound - t
            end, rate = q + w * h + xi * h * h / 2, w + xi * h
        self.begin = np.array([q, w, work]), np.array([w, xi, tau * w])
        self.y = np.array([end, rate, work + tau * (end - q)])
        self.slope = np.array([rate, xi, tau * rate])
        self.t, self.i = t + h, i + 1
        if self.i < AT_ONCE + 1:
            self.equation.know(end, self.margin[i + 1], ahead)
        return True, None

    def _dense_output_impl(self) -> Any:
        return Cubic.of(self)


STEPPERS = {"rk4": RungeKutta4, "euler_q": EulerQ}
