"""Starts from which nothing moves: equilibria, and poses that do not exist."""

from __future__ import annotations

import math
from typing import Any

from blockmech.dynamics.ends import IMPOSSIBLE, NO_INERTIA, UNDEFINED_LOAD
from blockmech.dynamics.motion import Event, Motion, Still
from blockmech.dynamics.system.reduced import TURN, Cost, Metered, One
from blockmech.dynamics.until import Asked

STEP = 2e-4  # of a turn: of the difference quotient of the effort


def resting(meter: Metered, asked: Asked, method: str = "energy") -> Motion:
    """A start at an equilibrium: it stays there; stable or not is said.

    Cost: four single poses for d tau/dq.
    """
    start, until = asked.start, asked.until
    system = meter.system
    h = STEP * (system.period or (TURN if system.kind == "rotation" else system.span))
    J = meter.one(start.q).J
    a, b, c, d = (meter.one(start.q + k * h).tau for k in (-2, -1, 1, 2))
    slope = (a - 8 * b + 8 * c - d) / (12 * h)
    facts: dict[str, float] = {}
    notes: tuple[str, ...] = ()
    if a == d == 0:
        kind = "indifferent equilibrium"
    elif slope < 0:
        kind = "stable equilibrium"
        facts["frequency"] = math.sqrt(-slope / J)
    elif slope > 0:
        kind = "unstable equilibrium"
        rate = facts["rate"] = math.sqrt(slope / J)
        notes = (f"it stays there only in theory: any disturbance grows as exp({rate:.6g} t)",)
    else:
        kind = "equilibrium"
    timed = until.goal == "time"
    return Motion(
        method=method,
        why=asked.why,
        regime="rest",
        status="reached" if timed else "rest",
        end="time" if timed else kind,
        t_start=start.t,
        t_end=start.t + (until.value if timed else 0.0),
        q_end=start.q,
        qd_end=0.0,
        track=Still(start.q),
        events=(Event("rest", start.t, start.q, 0.0),),
        error=0.0,
        time_error=0.0,
        accuracy=asked.accuracy,
        cost=meter.cost,
        notes=(kind, *notes),
        facts=facts,
    )


def trouble(one: One) -> str:
    """Why a state is no start of a motion, or an empty string."""
    if not one.margin > 0:
        return IMPOSSIBLE
    if not (one.J > 0 and math.isfinite(one.J)):
        return NO_INERTIA
    return "" if math.isfinite(one.tau) else UNDEFINED_LOAD


def nothing(meter: Metered, asked: Asked, method: str, reason: str) -> Motion:
    """No motion at all, and why."""
    start = asked.start
    return Motion(
        method=method,
        why=asked.why,
        regime="none",
        status="failed",
        end=reason,
        t_start=start.t,
        t_end=start.t,
        q_end=start.q,
        qd_end=start.rate,
        track=Still(start.q),
        events=(),
        error=math.inf,
        time_error=math.inf,
        accuracy=asked.accuracy,
        cost=meter.cost,
        notes=(f"{reason} at the start",),
    )


def at_once(method: str, asked: Asked, q: Any, qd: Any, cost: Cost) -> Motion:
    """The motion of no duration: the time asked for is that of the start.

    ``q``, ``qd``: floats, or arrays (k,) with several drivers.
    """
    return Motion(
        method=method,
        why=asked.why or "no time is asked for",
        regime="none",
        status="reached",
        end="time",
        t_start=asked.start.t,
        t_end=asked.start.t,
        q_end=q,
        qd_end=qd,
        track=Still(q, qd),
        events=(),
        error=0.0,
        time_error=0.0,
        accuracy=asked.accuracy,
        cost=cost,
    )
