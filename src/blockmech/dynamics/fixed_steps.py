r"""Schemes of fixed steps as in the textbooks, for comparison: what they share, and ``rk4``.

Steps of time, of the classical order 4, on y' = f(t, y):

    y_{n+1} = y_n + h (k1 + 2 k2 + 2 k3 + k4) / 6

The error is told by a second run with half the step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import DenseOutput, OdeSolver

from blockmech.dynamics.estimate import difference, missed
from blockmech.dynamics.motion import EVALUATIONS, INTERRUPTED, NO_INERTIA, Floats, Motion
from blockmech.dynamics.request import SimulationRequest, bad

MOST_STEPS = 2_000_000  # in a run; half a minute and more
STEP = 1e-3  # [rad], or of the span, of euler_q; of 200 ms, of rk4, where the time is not known
DOUBT = 4.0  # stated error over the difference of step and half step: order 1 differs by half


def checked_step(step: float, whole: float) -> float:
    """The step; refused where it makes more of them than can be made. Both [rad or m, or s]."""
    if math.isfinite(whole) and whole / step > MOST_STEPS:
        found = f"{step:.3g} makes {whole / step:.3g} steps, at most {MOST_STEPS:,} can be made"
        raise bad("step", found, "give a larger one")
    return step


def judged_by_half(
    request: SimulationRequest, step: float, run: Callable[[float], Motion]
) -> Motion:
    """The motion of the step that was asked for, else of one that meets the target."""
    motion, target = run(step), request.accuracy
    while motion.end != INTERRUPTED and motion.status != "failed":
        finer = run(step / 2)
        if finer.end == INTERRUPTED:
            note = "interrupted: the error is not judged by another run"
            return replace(motion, status="ended", end=INTERRUPTED, notes=(*motion.notes, note))
        apart = difference(motion, finer, request.times)
        known = apart.same and motion.end != NO_INERTIA  # of speeds without bound nothing is
        off, late = (DOUBT * x if known else math.inf for x in (apart.q, apart.t))
        late = 0.0 if motion.end == "time" else late + motion.time_error
        motion = replace(motion, error=off, time_error=late)
        enough = request.step is not None or target is None or off <= target
        if enough or finer.status == "failed" or finer.cost.evaluations > EVALUATIONS:
            break
        motion, step = finer, step / 2
    return motion if target is None else missed(motion, target)


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

    def _dense_output_impl(self) -> DenseOutput:
        return Cubic(self.t_old, self.t, *self.begin, self.y, self.slope)


class Cubic(DenseOutput):  # type: ignore[misc]
    """Dense output of a step: the cubic through states and slopes at both ends."""

    def __init__(self, t0: float, t1: float, y0: Any, f0: Any, y1: Any, f1: Any) -> None:
        super().__init__(t0, t1)
        h = t1 - t0
        rise = (y1 - y0) / h
        self.powers = np.array([y0, f0, (3 * rise - 2 * f0 - f1) / h, (f0 + f1 - 2 * rise) / h**2])

    def _call_impl(self, t: Any) -> Floats:
        s = np.asarray(t) - self.t_old
        found: Floats = self.powers.T @ np.array([s**0, s, s**2, s**3])
        return found
