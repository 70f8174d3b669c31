"""Motions by the textbooks' schemes of fixed steps, their error measured by a better method.

Half the step would not tell it: in front of a singular place no step is small against what is left,
and two runs may agree by chance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from blockmech.dynamics import ends
from blockmech.dynamics.estimate import FINER, TARGET, difference, judged, stopped, with_rounding
from blockmech.dynamics.request import SimulationRequest
from blockmech.dynamics.run import EVALUATIONS
from blockmech.dynamics.time import TimeIntegration, integrate
from blockmech.ground.errors import refused
from blockmech.result.motion import Motion

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

STEP = 1e-3  # [rad] or of the span, of euler_q, so exact is it; of 200 ms, of rk4 without a time
# An error that swings, and grows like the square of time, is seen to a half at some times.
SEEN = 2.0


def in_fixed_steps(system: System, request: SimulationRequest, method: str) -> Motion:
    """The motion by a scheme of the textbooks: of the step asked for, else of one fine enough.

    Its error is its difference from ``dop853``.
    """
    target = request.accuracy
    run, step = _stepping(system, request, method)
    motion = run(step)
    if motion.status == "failed" or motion.end in ends.STOPPED:
        return motion
    finest = TARGET if target is None else min(TARGET, target / FINER)
    exact = integrate(system, replace(request, accuracy=finest), "dop853")
    if exact.end in ends.STOPPED:
        return stopped(exact, motion)
    while True:
        motion = _measured(motion, exact, system, request)
        met = motion.status != "failed" and (target is None or motion.error <= target)
        if met or request.step is not None or motion.cost.evaluations > EVALUATIONS:
            return with_rounding(system, motion, target)
        step /= 2
        finer = run(step)
        if finer.end in ends.STOPPED:
            return stopped(finer, motion)
        if finer.status == "failed":
            return with_rounding(system, motion, target)
        motion = finer


def _stepping(
    system: System, request: SimulationRequest, method: str
) -> tuple[Callable[[float], Motion], float]:
    """Runs of a scheme by their step [s], or [rad or m] of ``euler_q``, and the first step.

    Refused where that makes more of them than can be made.
    """
    if method == "rk4":
        total = request.span
        step = request.step or 5 * STEP * (total if math.isfinite(total) else 1.0)
        unit = "time_step"
    else:
        total = max((abs(q - request.start.q) for q in request.goals), default=math.inf)
        step = request.step or STEP * (1.0 if system.rotary[0] else system.span)
        unit = "coordinate_step"
    if math.isfinite(total) and total / step > EVALUATIONS:
        fault = f"{step:.3g} makes {total / step:.3g} steps, at most {EVALUATIONS:,} can be made"
        raise refused("step", fault, "give a larger one")

    def run(h: float) -> Motion:
        motion = TimeIntegration(system, request, method, TARGET, method, 0.0, step=h).motion()
        return replace(motion, facts={**motion.facts, unit: h})

    return run, step


def _measured(motion: Motion, exact: Motion, system: System, request: SimulationRequest) -> Motion:
    """A motion with its error, from one that is known better."""
    apart = difference(motion, exact, system.rotary, request.times)
    if (motion.end, motion.status) != (exact.end, exact.status):
        return judged(exact, motion, apart, request.times)
    late = 0.0 if motion.end == "time" else SEEN * apart.t + exact.time_error
    return replace(motion, error=SEEN * apart.q + exact.error, time_error=late)
