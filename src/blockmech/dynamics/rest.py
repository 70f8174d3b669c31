"""Rest: equilibria of one driver, and starts from which there is no motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics.motion import IMPOSSIBLE, NO_INERTIA, UNDEFINED_LOAD
from blockmech.plane import EPS

if TYPE_CHECKING:
    from blockmech.dynamics.system import Sample, System

# [rad] or share of the span, of a fourth-order difference: its error is as large as its rounding.
STEP = EPS ** (1 / 5)


def start_failure(system: System, q: float, rate: float, t: float = 0.0) -> str:
    """Why nothing can start at a place; empty where it can."""
    return failure_at(system.sample(np.array([q]), rate, t))


def failure_at(start: Sample) -> str:
    """Why nothing can start at a place with that sample; empty where it can."""
    J, tau, margin = (float(x[0]) for x in start)
    if not (margin > 0 and math.isfinite(J)):
        return IMPOSSIBLE
    if not J > 0:
        return NO_INERTIA
    return "" if math.isfinite(tau) else UNDEFINED_LOAD


def equilibrium(system: System, q: float) -> tuple[str, dict[str, float], tuple[str, ...]]:
    """The kind of an equilibrium at q, its facts and what must be said of it.

    From d tau/dq, by a difference of the effort at rest.
    """
    h = STEP * (1.0 if system.rotary[0] else system.span)
    sample = system.sample(q + h * np.array([-2.0, -1.0, 0.0, 1.0, 2.0]))
    a, b, _, c, d = sample.tau.tolist()
    J = float(sample.J[2])
    slope = (a - 8 * b + 8 * c - d) / (12 * h)
    if a == d == 0:
        return "indifferent equilibrium", {}, ()
    if slope < 0:
        return "stable equilibrium", {"frequency": math.sqrt(-slope / J)}, ()
    if slope > 0:
        rate = math.sqrt(slope / J)
        note = f"it stays there only in theory: any disturbance grows as exp({rate:.6g} t)"
        return "unstable equilibrium", {"rate": rate}, (note,)
    return "equilibrium", {}, ()
