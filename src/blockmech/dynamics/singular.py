"""Where an integration cannot go on: what is there, and how much time is left until then."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.run import RunEnd
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import BLUR as LEAST_MARGIN
from blockmech.typing import Floats

if TYPE_CHECKING:
    from blockmech.dynamics.equation import Equation
    from blockmech.dynamics.system import System

NEAR_DEAD_CENTRE = math.sqrt(LEAST_MARGIN)  # below which a solver that gives up is at one
PAST = 16 * EPS  # relative: so near to a place, and so little beyond it
AHEAD = math.sqrt(EPS)  # relative: how far ahead of where a solver gives up there is no pose


def time_left(system: System, kind: str, q: float, qd: float) -> float:
    """The time left to a dead centre, or to a place without inertia; infinite if not known.

    The margin goes with the square of that time, the inertia with the square of the way. With
    several drivers nothing is known.
    """
    if len(system.drivers) > 1 or not qd:
        return math.inf
    scalar = system.scalar_terms(q)
    if kind == ends.NO_INERTIA:
        return abs(scalar.J / scalar.dJ / qd) if scalar.dJ else math.inf
    h = math.copysign(LEAST_MARGIN * NEAR_DEAD_CENTRE, qd)
    fall = (system.scalar_terms(q - h).margin - scalar.margin) / abs(h) * abs(qd)
    return 2 * scalar.margin / fall if fall > 0 else math.inf


def classify_obstacle(equation: Equation, t: float, y: Floats) -> RunEnd:
    """What is ahead of a state from which a solver found no step."""
    rates = y[equation.layout.rate]
    margin = equation.closeness(y)[0]
    if not margin > NEAR_DEAD_CENTRE:
        is_possible = margin > 0
        q, qd = float(y[0]), float(rates[0])
        remaining_time = time_left(equation.system, ends.DEAD_CENTRE, q, qd) if is_possible else 0.0
        return RunEnd(ends.DEAD_CENTRE, remaining_time=remaining_time)
    direction = np.sign(np.asarray(equation(t, y), dtype=float))
    beyond = y + AHEAD * np.maximum(np.abs(y), 1.0) * np.where(
        np.isfinite(direction), direction, 0.0
    )
    later = t + AHEAD * max(abs(t), 1.0)
    if equation.sides and equation.resisted(later, beyond).locked:
        return RunEnd(ends.SELF_LOCKED)
    if np.isfinite(np.asarray(equation(later, beyond), dtype=float)).all():
        return RunEnd(ends.NO_STEP, "failed")
    rate, reach = float(np.abs(rates[0])), PAST * max(1.0, float(np.abs(y[0])))
    remaining_time = PAST * max(abs(t), EPS)  # it comes so near, and steps so short
    return RunEnd(ends.IMPOSSIBLE, remaining_time=remaining_time + (reach / rate if rate else 0.0))
