"""Which method computes a motion, and why; what is refused.

| loads depend on          | ``auto`` takes                                                |
|--------------------------|---------------------------------------------------------------|
| q only                   | ``energy``                                                    |
| q and q', joint friction | ``spectral``                                                  |
| time, or several drivers | ``dop853``; ``radau`` where that needs too many steps (stiff) |

A user's event that ends the run takes an integrator. The steady state is a search of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args

import numpy as np

from blockmech.dynamics.euler_q import euler_q
from blockmech.dynamics.events import ON, watched
from blockmech.dynamics.motion import (
    END_STOP,
    INTERRUPTED,
    TOO_MANY,
    UNDECIDED,
    Cost,
    Event,
    Motion,
    Status,
    Still,
)
from blockmech.dynamics.path import along_path
from blockmech.dynamics.request import SimulationRequest
from blockmech.dynamics.rest import equilibrium, start_failure
from blockmech.dynamics.steady import steady_motion
from blockmech.dynamics.time import SOLVERS, TARGET, in_time, rk4
from blockmech.errors import Problem, RequestError, close_match, listed
from blockmech.plane import EPS

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

MethodName: TypeAlias = Literal[
    "auto", "energy", "spectral", "dop853", "lsoda", "radau", "rk4", "euler_q"
]
BALANCED = 8 * EPS  # of the loads' size: what rounding of a sum of some ten efforts leaves
WITHOUT = 'leave it out with friction="none" (--friction none)'


def move(system: System, request: SimulationRequest) -> Motion:
    """The motion of the drivers from a start until something ends it.

    Raises `RequestError` for a method or goal that does not exist or does not fit the loads.
    """
    method = checked(system, request)
    motion = unmoved(system, request, method)
    if motion is None:
        motion = _automatic(system, request) if method == "auto" else _named(system, request)
    status: Status = "failed" if motion.end == TOO_MANY else motion.status
    return replace(motion, cost=system.cost, status=status)


# -- refusals ------------------------------------------------------------------------------


def checked(system: System, request: SimulationRequest) -> MethodName:
    """The method, if it exists and fits what moves."""
    method, goal, names = request.method, request.until.goal, get_args(MethodName)
    if method not in names:
        hint = close_match(str(method), names)
        found = f'there is no method "{method}"'
        raise RequestError(Problem("method", "method", found, f"valid: {listed(names)}", hint))
    if len(system.drivers) > 1:
        _check_several(system, method, goal)
        return method  # type: ignore[return-value]
    depends = system.depends_on
    rubs = system.friction is not None
    if method in ("energy", "euler_q") and not depends <= {"q"}:
        also = listed(sorted(depends - {"q"}))
        raise refused("method", method, f"the loads depend on {also} as well", ("auto",))
    if method == "spectral" and "time" in depends:
        raise refused("method", method, "the loads depend on time", tuple(SOLVERS))
    if method in ("energy", "rk4", "euler_q") and rubs:
        raise refused("method", method, "the joints have friction", ("auto", *SOLVERS))
    if goal == "event" and not any(w.terminal for w in request.watch):
        raise refused("until", "event", "no event is given that ends the run", ())
    if method in ("rk4", "euler_q") and (goal in ("event", "steady") or request.watch):
        raise refused("method", method, "it knows no events", ("auto", "dop853"))
    if method in ("energy", "spectral") and goal == "event":
        why = "it looks for events after the run, so it needs another end"
        raise refused("method", method, why, ("auto", *SOLVERS))
    return method  # type: ignore[return-value]


def _check_several(system: System, method: str, goal: str) -> None:
    if goal not in ("time", "event", "steady"):
        raise refused("until", goal, "it needs one driver", ("time", "event", "steady"))
    if method != "auto" and method not in SOLVERS:
        raise refused("method", method, "it needs one driver", ("auto", *SOLVERS))
    joints = system.compiled.frictional_joints
    if joints and system.method is not None and system.method.method != "none":
        found = "joint friction in motion needs a mechanism with one driver"
        raise RequestError(Problem("friction-in-motion", listed(joints), found, "", WITHOUT))


def refused(where: str, what: str, why: str, valid: Sequence[str]) -> RequestError:
    """What does not fit, and what would."""
    remedy = f"valid: {listed(valid)}" if valid else ""
    return RequestError(Problem(where, where, f'"{what}": {why}', remedy))


# -- starts from which nothing moves -------------------------------------------------------


def standing(
    request: SimulationRequest, method: str, status: Status, end: str, **more: Any
) -> Motion:
    """A motion that stays at its start."""
    q, qd, t = request.start
    fields: dict[str, Any] = {
        "why": request.why,
        "regime": "none",
        "t_end": t,
        "events": (),
        "error": 0.0,
        "time_error": 0.0,
    }
    return Motion(
        method=method,
        status=status,
        end=end,
        t_start=t,
        q_end=q,
        qd_end=qd,
        track=Still(q, qd),
        accuracy=request.accuracy,
        cost=Cost(),
        **(fields | more),
    )


def unmoved(system: System, request: SimulationRequest, method: str) -> Motion | None:
    """The motion of a start that stays: no time, a stop, an equilibrium, no pose; else None."""
    steady = request.until.goal == "steady"
    name = "none" if method == "auto" else method
    held = _held_by_stop(system, request)
    if held is not None and not steady:
        return held
    alone = len(system.drivers) == 1
    q, rate, t = request.start
    failure = start_failure(system, q, rate, t) if alone else ""
    if failure and not steady:
        notes = (f"{failure} at the start",)
        return standing(
            request, name, "failed", failure, notes=notes, error=math.inf, time_error=math.inf
        )
    if request.until.goal == "time" and request.until.value == 0:
        why = request.why or "no time is asked for"
        return standing(request, name, "reached", "time", why=why)
    if alone and not steady and method in (*SOLVERS, "rk4", "euler_q"):
        return _at_equilibrium(system, request, method)
    return None


def _held_by_stop(system: System, request: SimulationRequest) -> Motion | None:
    """A start that is pressed against an end stop."""
    at, rates = (np.atleast_1d(x) for x in request.start[:2])
    for i, (ends, q, rate) in enumerate(zip(system.stops, at, rates, strict=True)):
        for stop, way in zip(ends, (-1.0, 1.0), strict=True):
            if not (math.isfinite(stop) and abs(q - stop) <= ON * max(1.0, abs(stop))):
                continue
            if way * (rate or _push(system, request, i)) > 0:
                driver = system.compiled.drivers[i]
                end = END_STOP if at.size == 1 else f"{END_STOP} of {driver}"
                event = Event(end, request.start.t, request.start.q, request.start.rate)
                why = "it starts at an end stop that holds it"
                return standing(
                    request, "none", "ended", end, why=why, regime=END_STOP, events=(event,)
                )
    return None


def _push(system: System, request: SimulationRequest, i: int) -> float:
    """Which way a driver at rest would start."""
    if system.friction is not None:
        q = float(request.start.q)
        return system.friction.rest(q, request.start.t, system.load_size(q)).moves
    qdd, _ = system.acceleration(*request.start)
    return float(np.atleast_1d(qdd)[i])


def _at_equilibrium(system: System, request: SimulationRequest, method: str) -> Motion | None:
    """A start at rest at which the loads do not push; the path method sees to its own."""
    q, rate, t = request.start
    if rate or "time" in system.depends_on or system.friction is not None:
        return None
    if abs(system.one(q, 0.0, t).tau) > BALANCED * system.load_size(q):
        return None
    kind, facts, notes = equilibrium(system, q)
    timed = request.until.goal == "time"
    return standing(
        request,
        method,
        "reached" if timed else "rest",
        "time" if timed else kind,
        regime="rest",
        t_end=t + (request.until.value if timed else 0.0),
        events=(Event("rest", t, q, 0.0),),
        notes=(kind, *notes),
        facts=facts,
    )


# -- running -------------------------------------------------------------------------------


def _automatic(system: System, request: SimulationRequest) -> Motion:
    depends, goal = system.depends_on, request.until.goal
    several = len(system.drivers) > 1
    if goal == "steady":
        return steady_motion(system, request)
    if several or "time" in depends or goal == "event":
        why = "a user's event ends the run" if goal == "event" else "the loads depend on time"
        return _in_time(system, replace(request, why="several drivers" if several else why))
    why = "all loads depend on the driver's coordinate alone"
    if system.friction is not None:
        why = "the joints have friction"
    elif "rate" in depends:
        why = "the loads depend on the rate"
    motion = along_path(system, replace(request, why=why))
    unsure = motion.end in (TOO_MANY, UNDECIDED) or not motion.error < math.inf
    unsure |= not motion.reached and motion.error > TARGET
    if unsure and motion.end != INTERRUPTED:
        why = f"along the path: {motion.end}, error {motion.error:.1e}"
        other = _in_time(system, replace(request, why=why), once=True)
        if other.error < motion.error or motion.status == "failed":
            return other
    return watched(motion, request.watch)


def _in_time(system: System, request: SimulationRequest, once: bool = False) -> Motion:
    motion = in_time(system, request, "dop853")
    if motion.end == TOO_MANY and request.until.goal == "time" and not once:
        return in_time(system, replace(request, why=f"{request.why}; it is stiff"), "radau")
    return motion


def _named(system: System, request: SimulationRequest) -> Motion:
    request, method = replace(request, why="asked for"), request.method
    if request.until.goal == "steady":
        return steady_motion(system, request)
    if method in SOLVERS:
        return in_time(system, request, method)
    if method == "rk4":
        return rk4(system, request)
    if method == "euler_q":
        return euler_q(system, request)
    return watched(along_path(system, request), request.watch)
