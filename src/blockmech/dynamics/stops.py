"""End stops of the drivers: where they are, and what they do to a run.

A free motion ends at the first stop it meets. With one driver every method knows its
stops (`reduced`), or the motion is cut afterwards (`watching`); with several drivers a
stop is an event.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from blockmech.dynamics.ends import END_STOP
from blockmech.dynamics.integration.equation import cholesky_solved
from blockmech.dynamics.motion import Event, Motion, Still
from blockmech.dynamics.system.reduced import Cost, ReducedSystem, ReducedSystems
from blockmech.dynamics.until import Watch
from blockmech.errors import Problem, RequestError, listed
from blockmech.model.scene import Scene

Stops = Mapping[str, tuple[float, float]]
ON = 1e-12  # relative distance within which a start counts as on a stop


def stops_of(
    scene: Scene,
    drivers: tuple[str, ...],
    starts: Mapping[str, tuple[float, float]],
    given: Stops | None,
) -> dict[str, tuple[float, float]]:
    """Driver -> (lowest, highest) coordinate [rad or m]: those given, else the scene's.

    Raises `RequestError` for a driver that is none, stops in the wrong order, or a start
    that is not between them.
    """
    found = {d: s.bounds for d, s in scene.stops.items()} if given is None else dict(given)
    problems = []
    for driver, (low, high) in found.items():
        where = scene.address("stops", driver) if given is None else f"stops.{driver}"
        if driver not in drivers:
            problems.append(
                Problem(
                    "unknown-driver", where, f'no driver "{driver}"', f"drivers: {listed(drivers)}"
                )
            )
        elif not low < high:
            found_there = f"the lowest must be below the highest, got {low:.9g} and {high:.9g}"
            problems.append(Problem("bad-value", where, found_there))
        elif not low <= starts[driver][0] <= high:
            problems.append(
                Problem(
                    "start-outside-stops",
                    where,
                    f"the start {driver}.q = {starts[driver][0]:.9g} is not between the end stops",
                    f"{low:.9g} to {high:.9g}",
                    "start between them, or move them",
                )
            )
    if problems:
        raise RequestError(problems)
    return {d: (float(low), float(high)) for d, (low, high) in found.items()}


def as_watches(drivers: tuple[str, ...], stops: Stops) -> tuple[Watch, ...]:
    """Stops of several drivers as events that end the run, each with its driver's name."""
    watches = []
    for driver, bounds in stops.items():
        i = drivers.index(driver)
        for stop, way in zip(bounds, (-1, 1), strict=True):
            if math.isfinite(stop):
                watches.append(Watch(named(driver), _beyond(i, stop, way), direction=1))
    return tuple(watches)


def named(driver: str) -> str:
    """What a run with several drivers ends with at a stop."""
    return f"{END_STOP} of {driver}"


def _beyond(i: int, stop: float, way: int) -> Any:
    return lambda t, q, qd: way * (float(q[i]) - stop)


def held_at_start(
    reduced: ReducedSystem | ReducedSystems,
    starts: Mapping[str, tuple[float, float]],
    stops: Stops,
) -> Motion | None:
    """The motion of no duration of a start that is pressed against a stop; else None."""
    pressed = [
        driver
        for driver, bounds in stops.items()
        for stop, way in zip(bounds, (-1.0, 1.0), strict=True)
        if math.isfinite(stop)
        and abs(starts[driver][0] - stop) <= ON * max(1.0, abs(stop))
        and way * (starts[driver][1] or _push(reduced, starts, driver)) > 0
    ]
    if not pressed:
        return None
    alone = isinstance(reduced, ReducedSystem)
    q, qd = (np.array([pair[i] for pair in starts.values()], dtype=float) for i in (0, 1))
    at: Any = (float(q[0]), float(qd[0])) if alone else (q, qd)
    end = END_STOP if alone else named(pressed[0])
    return Motion(
        method="none",
        why="it starts at an end stop that holds it",
        regime=END_STOP,
        status="ended",
        end=end,
        t_start=0.0,
        t_end=0.0,
        q_end=at[0],
        qd_end=at[1],
        track=Still(*at),
        events=(Event(end, 0.0, *at),),
        error=0.0,
        time_error=0.0,
        accuracy=None,
        cost=Cost(singles=1),
    )


def _push(
    reduced: ReducedSystem | ReducedSystems,
    starts: Mapping[str, tuple[float, float]],
    driver: str,
) -> float:
    """Which way a driver at rest would start: the sign of its acceleration."""
    if isinstance(reduced, ReducedSystem):
        return reduced.one(*starts[driver], 0.0)[1]
    q, qd = (np.array([pair[i] for pair in starts.values()], dtype=float) for i in (0, 1))
    M, c, Q, _ = reduced.terms(q, qd, 0.0)
    return cholesky_solved(M.tolist(), (Q - c).tolist())[list(starts).index(driver)]
