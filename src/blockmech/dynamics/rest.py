"""Rest of one driver: equilibria, and starts without a motion."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.place_data import NOTHING
from blockmech.dynamics.request import SimulationRequest
from blockmech.ground.plane import EPS
from blockmech.result.motion import Motion
from blockmech.typing import Floats

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

# [rad] or share of the span, of a fourth-order difference: its error is as large as its rounding.
STEP = EPS ** (1 / 5)


def failed_start(system: System, request: SimulationRequest) -> Motion | None:
    """The motion that cannot start, with the reason; None where it can.

    Of several drivers the loads are not looked at.
    """
    q, rate, t = request.start
    if not system.scalar:
        bound = [] if request.roles is None else request.roles.bound
        terms, free = system.terms(q, rate, t), np.delete(np.arange(len(system.drivers)), bound)
        J, tau, margin = smallest_inertia(terms.M[np.ix_(free, free)]), 0.0, terms.margin
    else:
        J, tau, margin = (float(x[0]) for x in system.at(q, rate, t)[:3])
    if not (margin > 0 and math.isfinite(J)):
        end = ends.IMPOSSIBLE
    elif J > 0 and math.isfinite(tau):
        return None
    else:
        end = ends.UNDEFINED_LOAD if J > 0 else ends.NO_INERTIA
    notes, unknown = (f"{end} at the start",), math.inf
    still = replace(request.standing, error=unknown, time_error=unknown, notes=notes)
    return replace(still, status="failed", end=end)


def smallest_inertia(M: Floats) -> float:
    """Least eigenvalue of a mass matrix whose diagonal is made 1; 0 where that is rounding.

    Freedoms that together move no mass have none, though each of them alone moves some.
    """
    scales = np.sqrt(np.diagonal(M))
    if not M.size or not (scales > 0).all():
        return float(np.min(scales, initial=1.0))
    smallest = float(np.linalg.eigvalsh(M / np.outer(scales, scales))[0])
    return smallest if smallest > NOTHING * len(M) else 0.0


def balanced(system: System, q: float) -> bool:
    """Whether the loads do not push a driver that stands at q."""
    return bool(abs(float(system.at(q).tau[0])) <= system.rounding(q))


def equilibrium(system: System, q: float) -> tuple[str, dict[str, float], tuple[str, ...]]:
    """The kind of an equilibrium at q, its facts and what must be said of it.

    From d tau/dq, by a difference of the effort at rest.
    """
    h = STEP * (1.0 if system.rotary[0] else system.span)
    sample = system.sample(q + h * np.array([-2.0, -1.0, 0.0, 1.0, 2.0]))
    a, b, _, c, d = sample.tau.tolist()
    rise, unknown = (a - 8 * b + 8 * c - d) / 12, system.rounding(q)
    if max(abs(a), abs(d)) <= unknown:
        return "indifferent equilibrium", {}, ()
    slope = rise / h / float(sample.J[2])
    if rise < -unknown:
        return "stable equilibrium", {"frequency": math.sqrt(-slope)}, ()
    if rise > unknown:
        rate = math.sqrt(slope)
        note = f"it stays there only in theory: any disturbance grows as exp({rate:.6g} t)"
        return "unstable equilibrium", {"rate": rate}, (note,)
    return "equilibrium", {}, ()
