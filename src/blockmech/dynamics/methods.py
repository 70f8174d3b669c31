"""Forward dynamics of a reduced system: choose the method, run it, say why.

| loads depend on         | ``auto`` takes                                              |
|-------------------------|-------------------------------------------------------------|
| q only                  | ``energy``                                                  |
| q and q'                | ``spectral``; ``dop853`` where the driver stops on the way   |
| time, or several drivers | ``dop853``; ``lsoda`` for loose targets where the table may serve |

The steady state is a search of its own (`steady`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from blockmech.dynamics.ends import TOO_MANY
from blockmech.dynamics.fixed.fixed_steps import by_euler_q, by_rk4
from blockmech.dynamics.integration.equation import may_be_tabulated
from blockmech.dynamics.integration.in_time import in_time, several_in_time
from blockmech.dynamics.integration.integrate import Method
from blockmech.dynamics.motion import Motion
from blockmech.dynamics.path.energy import energy
from blockmech.dynamics.path.spectral import spectral
from blockmech.dynamics.progress import once
from blockmech.dynamics.rest import at_once, nothing, trouble
from blockmech.dynamics.steady import conserved, steady_motion, steady_motions
from blockmech.dynamics.system.reduced import (
    TURN,
    Cost,
    Metered,
    MeteredSystems,
    ReducedSystem,
    ReducedSystems,
)
from blockmech.dynamics.until import Asked, Progress, Start, Until, Watch
from blockmech.dynamics.watching import watched_motion
from blockmech.errors import Problem, RequestError, close_match, listed

MethodName: TypeAlias = Literal[
    "auto", "energy", "spectral", "dop853", "lsoda", "radau", "rk4", "euler_q"
]
ENDLESS_WAY = "the time to the end of the driver's range does not converge"
INTEGRATED = 1e-12  # [rad or m] what an integrator leaves of the error, over a radian or metre
LOOSE = 1e-6  # target from which on LSODA is the cheaper one


def move(
    system: Metered | ReducedSystem | ReducedSystems,
    start: Start | tuple[Any, Any],
    until: Until | str,
    method: str = "auto",
    accuracy: float | None = None,
    step: float | None = None,
    watch: Sequence[Watch] = (),
    times: Any = (),
    progress: Progress | None = None,
) -> Motion:
    """The motion of the drivers from a start until something ends it.

    Parameters
    ----------
    system : one driver (counted if it comes with its meter) or several
    start : driver coordinate [rad or m], rate and time [s]; with k drivers the rows
        (q0 (k,), rate0 (k,))
    until : what ends the run, or its spelling ("swings=3")
    method : one of `MethodName`; with several drivers "auto" or an integrator
    accuracy : target for the error of q [rad or m], or None for the method's own
    step : of ``rk4`` [s] and ``euler_q`` [rad or m]
    watch : the user's events
    times : times [s] at which the answer is wanted; they count in the error estimate
    progress : told now and then how far the run is; it may raise `KeyboardInterrupt`

    Raises
    ------
    RequestError : a method or goal that does not exist or does not fit the loads.
    """
    until = Until.parse(until) if isinstance(until, str) else until
    wanted = tuple(np.asarray(times, dtype=np.float64).ravel().tolist())
    watches = tuple(watch)
    if isinstance(system, ReducedSystems):
        told = None if progress is None else once(progress)
        asked = Asked(_NOWHERE, until, accuracy, "", wanted, watches, told)
        return _several(system, start, asked, method)
    meter = system if isinstance(system, Metered) else Metered(system)
    if progress is not None:
        progress = meter.progress = once(progress)
    asked = Asked(Start(*start), until, accuracy, "asked for", wanted, watches, progress)
    named = _checked(method, meter.system, until, watches)
    if until.goal == "time" and until.value == 0:
        return _at_once(meter, asked, named)
    if named == "auto":
        return _automatic(meter, asked)
    motion = _by_name(meter, asked, named, step)
    if isinstance(motion, str):
        raise RequestError(
            Problem("method", "method", f'"{named}" cannot do it: {motion}', "", 'use "auto"')
        )
    return motion


def _at_once(meter: Metered, asked: Asked, method: str) -> Motion:
    q, rate, t = asked.start
    reason = trouble(meter.one(q, rate, t))
    if reason:
        return nothing(meter, asked, method, reason)
    return at_once("none" if method == "auto" else method, asked, q, rate, meter.cost)


_NOWHERE = Start(math.nan)


def _several(systems: ReducedSystems, start: tuple[Any, ...], asked: Asked, method: str) -> Motion:
    goal = asked.until.goal
    if goal not in ("time", "event", "steady"):
        raise _refused("until", goal, "it needs one driver", ("time", "event", "steady"))
    chosen = "dop853" if method == "auto" else method
    if chosen not in get_args(Method):
        raise _refused("method", method, "it needs one driver", ("auto", *get_args(Method)))
    q0, qd0 = (np.asarray(x, dtype=np.float64) for x in start[:2])
    t0 = float(start[2]) if len(start) > 2 else 0.0
    why = "several drivers" if method == "auto" else "asked for"
    asked = replace(asked, start=Start(math.nan, math.nan, t0), why=why)
    if goal == "time" and asked.until.value == 0:
        return at_once(chosen, asked, q0, qd0, Cost())
    if goal == "steady":
        return steady_motions(MeteredSystems(systems), q0, qd0, asked, method)
    return several_in_time(MeteredSystems(systems), q0, qd0, asked, chosen)  # type: ignore[arg-type]


def _checked(
    method: str, system: ReducedSystem, until: Until, watches: tuple[Watch, ...]
) -> MethodName:
    """The method, if it exists and fits the loads."""
    names = get_args(MethodName)
    if method not in names:
        raise RequestError(
            Problem(
                "method",
                "method",
                f'there is no method "{method}"',
                f"valid: {listed(names)}",
                close_match(str(method), names),
            )
        )
    depends = system.depends_on
    if method in ("energy", "euler_q") and not depends <= {"q"}:
        found = listed(sorted(depends - {"q"}))
        raise _refused("method", method, f"the loads depend on {found} as well", ("auto",))
    if method == "spectral" and "time" in depends:
        raise _refused("method", method, "the loads depend on time", ("dop853", "lsoda", "radau"))
    if until.goal == "event" and not any(w.terminal for w in watches):
        raise _refused("until", "event", "no event is given that ends the run", ())
    if method in ("rk4", "euler_q") and (until.goal in ("event", "steady") or watches):
        raise _refused("method", method, "it knows no events", ("auto", "dop853"))
    return method  # type: ignore[return-value]


def _refused(where: str, what: str, why: str, valid: Sequence[str]) -> RequestError:
    return RequestError(
        Problem(where, where, f'"{what}": {why}', f"valid: {listed(valid)}" if valid else "")
    )


def _automatic(meter: Metered, asked: Asked) -> Motion:
    depends, goal = meter.system.depends_on, asked.until.goal
    if depends <= {"q"} and goal != "event":
        why = "all loads depend on the driver's coordinate alone"
        system = meter.system
        motion = energy(meter, replace(asked, why=why))
        if goal == "steady":
            return watched_motion(conserved(motion), asked.watches)
        if _endless_way(motion):
            meter.system = system  # what was found on the way is the method's own
            return in_time(meter, replace(asked, why=f"by energy {ENDLESS_WAY}"), "dop853")
        if _may_be_better_in_time(motion):
            meter.system = system
            motion = _better_in_time(meter, asked, motion)
        return watched_motion(motion, asked.watches)
    if goal == "steady":
        follow = listed(sorted(depends - {"q"}))
        found = steady_motion(meter, replace(asked, why=f"the loads depend on {follow}"))
        return watched_motion(found, asked.watches)
    why = "a user's event ends the run" if goal == "event" else "the loads depend on time"
    if "time" not in depends and goal != "event":
        why = "the loads depend on the rate, and the driver does not stop"
        marched = spectral(meter, replace(asked, why=why))
        if not isinstance(marched, str):
            return watched_motion(marched, asked.watches)
        why = f"the loads depend on the rate; {marched}"
    accuracy = asked.accuracy
    loose = accuracy is not None and accuracy >= LOOSE and goal == "time" and not asked.watches
    loose = loose and may_be_tabulated(meter.system)
    # by kernels LSODA may take more of them, and its rounding may miss the target
    chosen: Method = "lsoda" if loose else "dop853"
    motion = in_time(meter, replace(asked, why=why), chosen, instead="dop853")
    if motion.end == TOO_MANY and goal == "time" and not loose:
        return in_time(meter, replace(asked, why=f"{why}; it is stiff"), "radau")
    return motion


def _may_be_better_in_time(motion: Motion) -> bool:
    """Whether the energy method misses the target by more than an integrator does.

    It sums the energy from far away, so its rounding tells where the motion nearly stops;
    an integrator does not come to an end as near. Whether it is tried depends on the error
    that is left, not on the target: a looser one must not cost more.
    """
    way = abs(float(motion.q_end) - float(motion.at(motion.t_start).q))
    swings = sum(event.kind == "standstill" for event in motion.events)
    floor = INTEGRATED * max(1.0, way, TURN * swings)
    return not motion.reached and motion.status == "reached" and motion.error > floor


def _better_in_time(meter: Metered, asked: Asked, motion: Motion) -> Motion:
    """The same motion by DOP853, if its error is smaller."""
    why = f"by energy rounding leaves {motion.error:.1e}"
    other = in_time(meter, replace(asked, why=why), "dop853", INTEGRATED)
    if other.end == motion.end and other.error < motion.error:
        return other
    return replace(motion, cost=other.cost)


def _endless_way(motion: Motion) -> bool:
    """Whether the energy method has come to no result."""
    return motion.method == "energy" and motion.status != "failed" and not motion.error < math.inf


def _by_name(meter: Metered, asked: Asked, method: MethodName, step: float | None) -> Motion | str:
    goal = asked.until.goal
    if method == "energy":
        if goal == "event":
            return "it looks for events after the run, so it needs another end"
        motion = energy(meter, asked)
        if goal == "steady":
            motion = conserved(motion)
        return ENDLESS_WAY if _endless_way(motion) else watched_motion(motion, asked.watches)
    if goal == "steady":
        return watched_motion(steady_motion(meter, asked, method), asked.watches)
    if method == "spectral":
        found = spectral(meter, asked)
        return found if isinstance(found, str) else watched_motion(found, asked.watches)
    if method == "rk4":
        return by_rk4(meter, asked, step)
    if method == "euler_q":
        return by_euler_q(meter, asked, step)
    return in_time(meter, asked, method)  # type: ignore[arg-type]
