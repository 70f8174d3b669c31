"""Forward dynamics of a reduced system: choose the method, run it, say why.

| loads depend on         | ``auto`` takes                                              |
|-------------------------|-------------------------------------------------------------|
| q only                  | ``energy``                                                  |
| q and q'                | ``spectral``; ``dop853`` where the driver stops on the way   |
| time, or several drivers | ``dop853``; ``lsoda`` for loose targets that nothing interrupts |
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from blockmech.dynamics.energy import energy
from blockmech.dynamics.integrate import Method
from blockmech.dynamics.motion import Motion
from blockmech.dynamics.reduced import Metered, MeteredSystems, ReducedSystem, ReducedSystems
from blockmech.dynamics.spectral import spectral, steady_motion
from blockmech.dynamics.stepwise import by_euler_q, by_rk4, in_time, several_in_time
from blockmech.dynamics.until import Start, Until, Watch
from blockmech.dynamics.watching import watched_motion
from blockmech.errors import Problem, RequestError, close_match, listed

MethodName: TypeAlias = Literal[
    "auto", "energy", "spectral", "dop853", "lsoda", "radau", "rk4", "euler_q"
]
LOOSE = 1e-6  # target from which on LSODA is the cheaper one


def simulate(
    system: ReducedSystem,
    start: Start,
    until: Until | str,
    method: str = "auto",
    accuracy: float | None = None,
    *,
    step: float | None = None,
    times: Any = (),
    watches: Sequence[Watch] = (),
) -> Motion:
    """The motion of a system with one driver.

    Parameters
    ----------
    system : the reduced system
    start : driver coordinate [rad or m], rate, time [s]
    until : what ends the run, or its spelling ("swings=3")
    method : one of `MethodName`
    accuracy : target for the error of q [rad or m], or None for the method's own
    step : of ``rk4`` [s] and ``euler_q`` [rad or m]
    times : times [s] at which the answer is wanted; they count in the error estimate
    watches : the user's events

    Raises
    ------
    RequestError : a method or goal that does not exist or does not fit the loads.
    """
    until = Until.parse(until) if isinstance(until, str) else until
    wanted = np.asarray(times, dtype=np.float64).ravel()
    named = _checked(method, system, until, tuple(watches))
    meter = Metered(system)
    if named == "auto":
        return _automatic(meter, start, until, accuracy, wanted, tuple(watches))
    motion = _by_name(meter, start, until, named, accuracy, step, wanted, tuple(watches))
    if isinstance(motion, str):
        raise RequestError(
            Problem("method", "method", f'"{named}" cannot do it: {motion}', "", 'use "auto"')
        )
    return motion


def simulate_several(
    systems: ReducedSystems,
    q0: Any,
    qd0: Any,
    until: Until | str,
    method: str = "auto",
    accuracy: float | None = None,
    *,
    t0: float = 0.0,
    times: Any = (),
    watches: Sequence[Watch] = (),
) -> Motion:
    """The motion of a system with several drivers; q0, qd0 (k,).

    Raises `RequestError` for a goal or a method that only one driver has.
    """
    until = Until.parse(until) if isinstance(until, str) else until
    if until.goal not in ("time", "event"):
        raise _refused("until", until.goal, "it needs one driver", ("time", "event"))
    chosen = "dop853" if method == "auto" else method
    if chosen not in get_args(Method):
        raise _refused("method", method, "it needs one driver", ("auto", *get_args(Method)))
    return several_in_time(
        MeteredSystems(systems),
        np.asarray(q0, dtype=np.float64),
        np.asarray(qd0, dtype=np.float64),
        t0,
        until,
        chosen,  # type: ignore[arg-type]
        accuracy,
        "several drivers" if method == "auto" else "asked for",
        np.asarray(times, dtype=np.float64).ravel(),
        tuple(watches),
    )


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
                close_match(method, names),
            )
        )
    depends = system.depends_on
    if method in ("energy", "euler_q") and not depends <= {"q"}:
        found = listed(sorted(depends - {"q"}))
        raise _refused("method", method, f"the loads depend on {found} as well", ("auto",))
    if (method == "spectral" or until.goal == "steady") and "time" in depends:
        name = method if method == "spectral" else "steady"
        raise _refused("method", name, "the loads depend on time", ("dop853", "lsoda", "radau"))
    if until.goal == "event" and not any(w.terminal for w in watches):
        raise _refused("until", "event", "no event is given that ends the run", ())
    if method in ("rk4", "euler_q") and (until.goal in ("event", "steady") or watches):
        raise _refused("method", method, "it knows no events", ("auto", "dop853"))
    return method  # type: ignore[return-value]


def _refused(where: str, what: str, why: str, valid: Sequence[str]) -> RequestError:
    return RequestError(
        Problem(where, where, f'"{what}": {why}', f"valid: {listed(valid)}" if valid else "")
    )


def _automatic(
    meter: Metered,
    start: Start,
    until: Until,
    accuracy: float | None,
    times: Any,
    watches: tuple[Watch, ...],
) -> Motion:
    depends = meter.system.depends_on
    if depends <= {"q"} and until.goal != "event":
        why = "all loads depend on the driver's coordinate alone"
        motion = energy(meter, start, until, accuracy, why)
        return watched_motion(motion, watches)
    if until.goal == "steady":
        steady = steady_motion(meter, start, accuracy, "a periodic motion is asked for")
        if not isinstance(steady, str):
            return steady
        why = steady
        raise _refused("until", "steady", why, ())
    why = "a user's event ends the run" if until.goal == "event" else "the loads depend on time"
    if "time" not in depends and until.goal != "event":
        why = "the loads depend on the rate, and the driver does not stop"
        motion_or_reason = spectral(meter, start, until, accuracy, why)
        if not isinstance(motion_or_reason, str):
            return watched_motion(motion_or_reason, watches)
        why = f"the loads depend on the rate; {motion_or_reason}"
    loose = accuracy is not None and accuracy >= LOOSE and until.goal == "time" and not watches
    chosen: Method = "lsoda" if loose else "dop853"
    motion = in_time(meter, start, until, chosen, accuracy, why, times, watches)
    if motion.end == "more evaluations than allowed" and chosen == "dop853":
        why += "; it is stiff"
        motion = in_time(meter, start, until, "radau", accuracy, why, times, watches)
    return motion


def _by_name(
    meter: Metered,
    start: Start,
    until: Until,
    method: MethodName,
    accuracy: float | None,
    step: float | None,
    times: Any,
    watches: tuple[Watch, ...],
) -> Motion | str:
    why = "asked for"
    if method == "energy":
        if until.goal == "event":
            return "it looks for events after the run, so it needs another end"
        return watched_motion(energy(meter, start, until, accuracy, why), watches)
    if until.goal == "steady":
        return steady_motion(meter, start, accuracy, why)
    if method == "spectral":
        found = spectral(meter, start, until, accuracy, why)
        return found if isinstance(found, str) else watched_motion(found, watches)
    if method == "rk4":
        return by_rk4(meter, start, until, step, accuracy, why)
    if method == "euler_q":
        return by_euler_q(meter, start, until, step, accuracy, why)
    return in_time(
        meter,
        start,
        until,
        method,  # type: ignore[arg-type]
        accuracy,
        why,
        times,
        watches,
    )


