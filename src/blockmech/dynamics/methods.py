"""Which method computes a motion, and why; what is refused.

``auto`` goes along the path where it can (``energy``), else in time by ``dop853``, by ``radau``
where that is stiff. The steady state is a search of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.contacts import rate_along
from blockmech.dynamics.estimate import TARGET
from blockmech.dynamics.events import watched
from blockmech.dynamics.method_table import METHODS, Method
from blockmech.dynamics.path import along_path
from blockmech.dynamics.request import WATCH, SimulationRequest, check_method
from blockmech.dynamics.rest import balanced, failed_start
from blockmech.dynamics.run import EVALUATIONS, GUESSED_AT, HOPELESS
from blockmech.dynamics.signals import felt
from blockmech.dynamics.system import System
from blockmech.ground.errors import RequestError, listed, refused
from blockmech.result.motion import Event, Floats, Motion, Status

LOOKED_AT = 31  # states of a motion at which iterations of friction are judged
WITHOUT = 'leave it out with friction="none" (--friction none)'


def in_time(
    system: System, request: SimulationRequest, method: str, patient: bool = True
) -> Motion:
    """By an integrator in time."""
    from blockmech.dynamics import time

    return time.in_time(system, request, method, patient)


def in_fixed_steps(system: System, request: SimulationRequest, method: str) -> Motion:
    """By a scheme of the textbooks."""
    from blockmech.dynamics import textbook

    return textbook.in_fixed_steps(system, request, method)


def move(system: System, request: SimulationRequest) -> Motion:
    """The motion of the drivers from a start until something ends it.

    Raises `RequestError` for a method or goal that does not exist or does not fit the loads.
    """
    check(system, request)
    motion = unmoved(system, request)
    if motion is None:
        motion = _moved(system, request)
    elif not motion.x_end:
        motion = replace(motion, x_end=system.signals.initial)
    motion = _with_misfit(system, motion)
    system.remember()
    status: Status = "failed" if motion.end == ends.TOO_MANY else motion.status
    return motion.but(cost=system.cost, status=status)


def _with_misfit(system: System, motion: Motion) -> Motion:
    """The motion with what its way to solve friction leaves undone, which no finer run shows."""
    how = system.method
    if how is None or how.method in ("none", "newton"):
        return motion
    friction = system.friction
    if friction is None or motion.t_end == motion.t_start:
        return motion
    times = np.linspace(motion.t_start, motion.t_end, LOOKED_AT + 2)[1:-1]
    states = zip(*motion.at(times), times.tolist(), strict=True)
    sides = motion.sides(times).tolist()
    left = [
        friction.at(np.atleast_1d(q), np.atleast_1d(qd), t, tuple(side)).misfit
        for (q, qd, t), side in zip(states, sides, strict=True)
    ]
    if not left:
        return motion
    worst = max(left)
    note = (
        f'friction "{how.method}": pairs miss their laws by up to {worst:.1e} of the largest '
        "friction; the estimated error is that of the integration alone"
    )
    facts = {**motion.facts, "friction_misfit": worst}
    return replace(motion, facts=facts, notes=(*motion.notes, note))


# -- refusals ------------------------------------------------------------------------------


def check(system: System, request: SimulationRequest) -> None:
    """Refuse a method that there is not, or that does not fit what moves."""
    name, goal, several = request.method, request.until.goal, len(system.drivers) > 1
    if several and goal not in ("time", "event", "steady"):
        raise _unfitting("until", goal, "it needs one driver", ("time", "event", "steady"))
    if goal == "steady" and request.roles is not None:
        why = "with drivers that are prescribed or locked no steady state is looked for"
        raise _unfitting("until", goal, why, ("time", "event"))
    if goal == "steady" and (why := _no_search(system, request.start.t)):
        raise _unfitting("until", goal, why, ("time", "event"))
    if goal == "event" and not any(w.terminal for w in request.watch):
        remedy = f"give one in Python: watch=[{WATCH}]"
        raise refused("until", '"event": no event is given that ends the run', remedy, code="until")
    if several and goal == "steady" and system.friction is not None:
        why = "with joint friction and several drivers no steady state is looked for"
        raise _unfitting("until", goal, why, ("time", "event"))
    if system.signals.initial and system.friction is not None:
        sensors = system.compiled.once(felt)
        if sensors:
            found = "it follows the friction of joints at once, so no signal in motion reads it"
            raise refused(listed(sensors), found, WITHOUT, code="friction-in-motion")
    check_method(name)
    if name == "auto":
        return
    why = _unfit(METHODS[name], system, request)
    if why:
        fit = (n for n, m in METHODS.items() if not _unfit(m, system, request))
        raise _unfitting("method", name, why, ("auto", *fit))


def _no_search(system: System, t: float) -> str:
    """Why no search for a steady state follows the states of signals; empty where one does."""
    if "state" not in system.depends_on:
        return ""
    if system.remembers:
        return "the loads depend on states of friction laws, which no search for it follows"
    if len(system.drivers) > 1 or "time" in system.depends_on:
        return (
            "states of signals are followed with one driver and loads that do not follow the time"
        )
    if math.isfinite(system.signals.next_time(t)):
        return "blocks that switch at instants do not repeat with the turns of the driver"
    return ""


def _unfit(method: Method, system: System, request: SimulationRequest) -> str:
    """Why a method does not fit; empty where it does."""
    goal, also = request.until.goal, sorted(system.depends_on - method.loads)
    if len(system.drivers) > 1 and not method.several:
        return "it needs one driver"
    if also:
        return f"the loads depend on {listed(also)} as well"
    if system.friction is not None and not method.friction:
        return "the joints have friction"
    if goal == "steady" and not method.finds_steady:
        return "it finds no steady state"
    if goal == "event" and not method.ends_at_events:
        return "it looks for events after the run, so it needs another end"
    return ""


def _unfitting(where: str, what: str, why: str, valid: Iterable[str]) -> RequestError:
    """What does not fit, and what would."""
    return refused(where, f'"{what}": {why}', valid=f"valid: {listed(tuple(valid))}", code=where)


# -- starts from which nothing moves -------------------------------------------------------


def unmoved(system: System, request: SimulationRequest) -> Motion | None:
    """The motion of a start that stays: no time, a stop, an equilibrium, no pose; else None."""
    if request.until.goal == "steady":
        return None
    method = "none" if request.method == "auto" else request.method
    alone = len(system.drivers) == 1
    if (failed := failed_start(system, request)) is not None:
        return replace(failed, method=method)
    if (held := _held_by_stop(system, request)) is not None:
        return held
    if alone and system.held and not system.signals.initial:  # no way for a method along a path
        return in_time(system, request, "dop853")
    if request.span == 0:
        why = request.why or "no time is asked for"
        return replace(request.standing, method=method, why=why)
    if method in ("none", "energy") or not alone or system.friction is not None:
        return None  # but the path method sees to equilibria itself
    q, rate, _ = request.start
    lasting = not system.depends_on & {"time", "state"}
    still = not rate and lasting and balanced(system, q)
    return replace(along_path(system, request), method=method) if still else None


def _held_by_stop(system: System, request: SimulationRequest) -> Motion | None:
    """A start that is pressed against an end stop."""
    start = request.start
    for i, place in enumerate(system.places(start.q).tolist()):
        way = 0 if i in system.held else system.at_stop(i, place)
        if not way:
            continue
        rows, drift = system.rows(start.q, start.rate)
        fast = rate_along(rows[i], start.rate)
        if way * (fast or _push(system, request, rows[i], drift[i])) > 0:
            end = system.end_at(i)
            events = (Event(end, start.t, start.q, start.rate),)
            still = replace(request.standing, why="it starts at an end stop that holds it")
            return replace(still, regime=ends.END_STOP, status="ended", end=end, events=events)
    return None


def _push(system: System, request: SimulationRequest, row: Floats, drift: float) -> float:
    """Which way a coordinate with a row over the drivers would start, that is at rest."""
    q, rate, t = request.start
    if system.friction is not None:
        q, rate = np.atleast_1d(q), np.atleast_1d(rate)
        qdd = system.friction.from_state(q, rate, t, system.against(q, rate, t))[1]
        return float(row @ qdd + drift)
    terms = system.terms(q, rate, t)
    return float(row @ system.accelerations(terms.M, terms.Q - terms.c, q, rate, t)[0] + drift)


# -- running -------------------------------------------------------------------------------


def _moved(system: System, request: SimulationRequest) -> Motion:
    named = request.method != "auto"
    if named:
        request = replace(request, why="asked for")
    if request.until.goal == "steady":
        from blockmech.dynamics.steady import steady_motion

        return steady_motion(system, request)
    if not named:
        return _automatic(system, request)
    method = METHODS[request.method]
    if not method.ends_at_events:
        return watched(along_path(system, request), request.watch)
    run = in_fixed_steps if method.fixed_steps else in_time
    return run(system, request, request.method)


def _automatic(system: System, request: SimulationRequest) -> Motion:
    in_steps = {
        "several drivers": len(system.drivers) > 1,
        "a user's event ends the run": request.until.goal == "event",
        "a friction law has a state": system.remembers,
        "the loads depend on the states of signals": "state" in system.depends_on,
        "the loads depend on the time": "time" in system.depends_on,
        "the joints have friction": system.friction is not None,
        "the loads depend on the rate": "rate" in system.depends_on,
    }
    for why in (why for why, so in in_steps.items() if so):
        return _stiff_or_not(system, request, why)
    why = "all loads depend on the driver's coordinate alone"
    motion = along_path(system, replace(request, why=why))
    unsure = motion.end in (ends.TOO_MANY, ends.UNDECIDED) or not motion.error < math.inf
    unsure |= not motion.reached and motion.error > TARGET
    # A motion that failed because it swings on and on: no other method is quicker.
    swings_on = motion.end == ends.TOO_MANY and motion.status == "failed"
    if unsure and not swings_on and motion.end not in ends.STOPPED:
        known = f", error {motion.error:.1e}" if math.isfinite(motion.error) else ""
        other = _stiff_or_not(system, request, f"along the path: {motion.end}{known}")
        in_vain = other.end == ends.TOO_MANY and known  # nothing is known of what it made
        if other.error < motion.error or (motion.status == "failed" and not in_vain):
            notes = (f"along the path: {note}" for note in motion.notes[:1])
            return replace(other, notes=(*other.notes, *notes))
    return watched(motion, request.watch)


def _stiff_or_not(system: System, request: SimulationRequest, why: str) -> Motion:
    """In time by ``dop853``, or by ``radau`` where that needs too many steps.

    That it needs too many to a given time is a guess: where ``radau`` does as well, all are made,
    unless that is hopeless.
    Other goals may never be reached, which is found out by machine code alone in little time.
    """
    motion = in_time(system, replace(request, why=why), "dop853", patient=False)
    timed = request.until.goal == "time"
    if motion.end == ends.TOO_MANY and (timed or system.quick_states):
        other = in_time(system, replace(request, why=f"{why}; it is stiff"), "radau", False)
        if other.end != ends.TOO_MANY:
            return other
        done = (motion.t_end - request.start.t) / request.span
        if timed and done * HOPELESS * EVALUATIONS > GUESSED_AT:
            motion = in_time(system, replace(request, why=why), "dop853")
    return motion
