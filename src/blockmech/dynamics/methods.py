"""Which method computes a motion, and why; what is refused.

``auto`` goes along the path (``energy``) where it can and that costs no more, else in time by
``dop853``, by ``radau`` where that is stiff. The steady state is a search of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.contacts import STILL, rate_along
from blockmech.dynamics.estimate import TARGET, spread
from blockmech.dynamics.events import watched
from blockmech.dynamics.method_table import METHODS, Method
from blockmech.dynamics.path import integrate_by_quadrature
from blockmech.dynamics.programs import felt
from blockmech.dynamics.request import WATCH, SimulationRequest
from blockmech.dynamics.rest import balanced, failed_start
from blockmech.dynamics.run import EVALUATIONS, GUESSED_AT, HOPELESS
from blockmech.dynamics.system import System
from blockmech.dynamics.textbook import in_fixed_steps
from blockmech.dynamics.time import integrate
from blockmech.ground.errors import RequestError, listed, refused
from blockmech.result.motion import Event, Motion, Status
from blockmech.typing import Real

WITHOUT = 'leave it out with friction="none" (--friction none)'


def move(
    system: System,
    request: SimulationRequest,
    search: Callable[[System, SimulationRequest], Motion] | None = None,
) -> Motion:
    """The motion of the drivers from a start until something ends it; ``search`` a steady state.

    Raises `RequestError` for a method or goal that does not exist or does not fit the loads.
    """
    check(system, request)
    auto = request.method == "auto"
    try:
        motion = unmoved(system, request)
        if motion is None:
            run = search or (automatic if auto else by_name)
            motion = run(system, request if auto else replace(request, why="asked for"))
            for goal in request.alternatives:
                if motion.end.startswith(ends.NEVER):
                    motion = run(system, replace(request, until=goal, why=motion.end))
        elif not motion.x_end:
            motion = replace(motion, x_end=system.signals.initial)
        motion = _with_misfit(system, motion)
    except KeyboardInterrupt:  # before there was anything but the start
        notes = ("interrupted before a steady state was found",) if search else ()
        return replace(request.standing, status="ended", end=ends.INTERRUPTED, notes=notes)
    except ends.BudgetSpent:
        notes = (system.budget.advice,)
        return replace(request.standing, status="unfinished", end=ends.BUDGET, notes=notes)
    system.remember()
    status: Status = "failed" if motion.end == ends.TOO_MANY else motion.status
    return motion.but(cost=system.cost, status=status)


def _with_misfit(system: System, motion: Motion) -> Motion:
    """The motion with what its way to solve friction leaves undone, which no finer run shows."""
    friction_method = system.method
    if friction_method is None or friction_method.method in ("none", "newton"):
        return motion
    friction = system.friction
    if friction is None or motion.t_end == motion.t_start:
        return motion
    times = spread(motion.t_start, motion.t_end)[1:-1]
    states = zip(*motion.at(times), times.tolist(), strict=True)
    sides = motion.sides(times).tolist()
    misfits = list[Real]()
    for (q, qd, t), side in zip(states, sides, strict=True):
        at = friction.instant(np.atleast_1d(q), np.atleast_1d(qd), t, None, None)
        misfits.append(friction.respond(at, tuple(side)).misfit)
    worst = float(max(misfits))
    note = (
        f'friction "{friction_method.method}": pairs miss their laws by up to {worst:.1e} of the '
        "largest friction; the estimated error is that of the integration alone"
    )
    facts = {**motion.facts, "friction_misfit": worst}
    return replace(motion, facts=facts, notes=(*motion.notes, note))


# -- refusals ------------------------------------------------------------------------------


def check(system: System, request: SimulationRequest) -> None:
    """Refuse a method that there is not, or that does not fit what moves."""
    name, goal, several = request.method, request.until.goal, not system.scalar
    if several and goal not in ("time", "event", "steady"):
        why = "it needs one driver that is free"
        raise _unfitting("until", goal, why, ("time", "event", "steady"))
    if goal == "steady" and (why := _no_search(system, request)):
        raise _unfitting("until", goal, why, ("time", "event"))
    if goal == "event" and not any(w.terminal for w in request.watch):
        remedy = f"give one in Python: watch=[{WATCH}]"
        raise refused("until", '"event": no event is given that ends the run', remedy, code="until")
    if system.signals.initial and system.friction is not None:
        sensors = system.compiled._once(felt)
        if sensors:
            fault = "it follows the friction of joints at once, so no signal in motion reads it"
            raise refused(listed(sensors), fault, WITHOUT, code="friction-in-motion")
    if name == "auto":
        return
    why = _unfit(METHODS[name], system, request)
    if why:
        fit = (n for n, m in METHODS.items() if not _unfit(m, system, request))
        raise _unfitting("method", name, why, ("auto", *fit))


def _no_search(system: System, request: SimulationRequest) -> str:
    """Why no steady state is looked for; empty where one is."""
    depends, several = system.depends_on, len(system.drivers) > 1
    if request.roles is not None:
        return "with drivers that are prescribed or locked no steady state is looked for"
    if "state" in depends:
        if system.remembers:
            return "the loads depend on states of friction laws, which no search for it follows"
        if several or "time" in depends:
            alone = "one driver and loads that do not follow the time"
            return f"states of signals are followed with {alone}"
        if math.isfinite(system.signals.next_time(request.start.t)):
            return "blocks that switch at instants do not repeat with the turns of the driver"
    why = "with joint friction and several drivers no steady state is looked for"
    return why if several and system.friction is not None else ""


def _unfit(method: Method, system: System, request: SimulationRequest) -> str:
    """Why a method does not fit; empty where it does."""
    goal, also = request.until.goal, sorted(system.depends_on - method.loads)
    if not system.scalar and not method.several:
        return "it needs one driver that is free"
    if also:
        return f"the loads depend on {listed(also)} as well"
    if system.friction is not None and not method.friction:
        return "the joints have friction"
    if goal == "steady" and not method.finds_steady:
        return "it finds no steady state"
    if goal == "event" and not method.ends_at_events:
        return "it looks for events after the run, so it needs another end"
    return ""


def _unfitting(where: str, choice: str, why: str, valid: Iterable[str]) -> RequestError:
    """What does not fit, and what would."""
    return refused(where, f'"{choice}": {why}', valid=f"valid: {listed(tuple(valid))}", code=where)


# -- starts from which nothing moves -------------------------------------------------------


def unmoved(system: System, request: SimulationRequest) -> Motion | None:
    """The motion of a start that stays: no time, a stop, an equilibrium, no pose; else None."""
    if request.until.goal == "steady":
        return None
    method = "none" if request.method == "auto" else request.method
    alone = system.scalar
    if (failed := failed_start(system, request)) is not None:
        return replace(failed, method=method)
    if (pressed := _pressed_by_stop(system, request)) is not None:
        return pressed
    if alone and system.contacts and not system.signals.initial:  # no way for a method along a path
        return integrate(system, request, "dop853")
    if request.span == 0:
        return replace(request.standing, method=method, why=request.why or "no time is asked for")
    if method in ("none", "energy") or not alone or system.friction is not None:
        return None  # but the path method sees to equilibria itself
    q, rate, _ = request.start
    lasting = not system.depends_on & {"time", "state"}
    still = not rate and lasting and balanced(system, q)
    return replace(integrate_by_quadrature(system, request), method=method) if still else None


def _pressed_by_stop(system: System, request: SimulationRequest) -> Motion | None:
    """A start that is pressed against an end stop."""
    start = request.start
    for i, coordinate in enumerate(system.coordinates(start.q).tolist()):
        side = 0 if i in system.contacts else system.at_stop(i, coordinate)
        if not side:
            continue
        rows, drift = system.rows(start.q, start.rate)
        fast = rate_along(rows[i], start.rate)
        push = float(rows[i] @ system.response(*start)[0] + drift[i])
        terms = system.terms(*start)
        loose, _ = system.accelerations(terms.M, terms.Q - terms.c, *start)
        size = float(np.abs(rows[i]) @ np.abs(loose) + abs(drift[i]))
        if abs(push) <= STILL * size:  # rounding of an acceleration that friction takes away
            push = 0.0
        if side * (fast or push) > 0:
            end = system.end_at(i)
            events = (Event(end, start.t, start.q, start.rate),)
            still = replace(request.standing, why="it starts at an end stop that holds it")
            return replace(still, regime=ends.END_STOP, status="ended", end=end, events=events)
    return None


# -- running -------------------------------------------------------------------------------


def by_name(system: System, request: SimulationRequest) -> Motion:
    """By the method asked for."""
    method = METHODS[request.method]
    if not method.ends_at_events:
        return watched(integrate_by_quadrature(system, request), request.watch)
    run = in_fixed_steps if method.fixed_steps else integrate
    return run(system, request, request.method)


def automatic(system: System, request: SimulationRequest) -> Motion:
    """Along the path where that can be and costs no more, else in time.

    In time by ``dop853``, or by ``radau`` where that needs too many steps. That it needs too many
    to a given time is a guess: where ``radau`` does as well, all are made, unless that is hopeless.
    Other goals may never be reached, which is found out by machine code alone in little time.
    """
    in_steps = {
        "several drivers": len(system.drivers) > 1,
        "drivers have roles": system.roles is not None,
        "a user's event ends the run": request.until.goal == "event",
        "a friction law has a state": system.remembers,
        "the loads depend on the states of signals": "state" in system.depends_on,
        "the loads depend on the time": "time" in system.depends_on,
        "the joints have friction": system.friction is not None,
        "the loads depend on the rate": "rate" in system.depends_on,
    }
    why, path_motion = next((why for why, so in in_steps.items() if so), ""), None
    if not why:
        why = "all loads depend on the driver's coordinate alone"
        routes = system.routes((request.until, *request.start))
        compiled = system.quick_states and system.compiled_states
        if routes.by_path > 0 and routes.save_in_time(system.equation_program, compiled):
            dearer = f"{why}, but its path goes by arrays, steps in time by machine code"
            motion = integrate(system, replace(request, why=dearer), "dop853", patient=False)
            good = motion.error <= (request.accuracy or TARGET)
            routes.states = system.states if good else math.inf
            if good or motion.end in ends.STOPPED:
                return motion
        path_motion = integrate_by_quadrature(system, replace(request, why=why))
        if system.quick_states:
            routes.count_along(system.equation_program, system.cost)
        undecided = path_motion.end in (ends.TOO_MANY, ends.UNDECIDED)
        unsure = undecided or not path_motion.error < math.inf
        unsure |= not path_motion.reached and path_motion.error > TARGET
        # A motion that failed because it swings on and on: no other method is quicker.
        swings_on = path_motion.end == ends.TOO_MANY and path_motion.status == "failed"
        if not unsure or swings_on or path_motion.end in ends.STOPPED:
            return watched(path_motion, request.watch)
        error = f", error {path_motion.error:.1e}" if math.isfinite(path_motion.error) else ""
        why = f"along the path: {path_motion.end}{error}"
    motion = integrate(system, replace(request, why=why), "dop853", patient=False)
    timed = request.until.goal == "time"
    if motion.end == ends.TOO_MANY and (timed or system.quick_states):
        stiff = replace(request, why=f"{why}; it is stiff")
        radau_motion = integrate(system, stiff, "radau", patient=False)
        progress = (motion.t_end - request.start.t) / request.span
        if radau_motion.end != ends.TOO_MANY:
            motion = radau_motion
        elif timed and progress * HOPELESS * EVALUATIONS > GUESSED_AT:
            motion = integrate(system, replace(request, why=why), "dop853")
    if path_motion is None:
        return motion
    in_vain = motion.end == ends.TOO_MANY and error  # nothing is known of what it made
    if motion.error < path_motion.error or (path_motion.status == "failed" and not in_vain):
        notes = (f"along the path: {note}" for note in path_motion.notes[:1])
        return replace(motion, notes=(*motion.notes, *notes))
    return watched(path_motion, request.watch)
