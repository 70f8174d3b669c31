"""A free motion between the coordinates of a joint-based document and those of its graph.

What a user asks is turned into the graph's coordinates, the motion found there is turned
back. Where both count alike nothing is touched.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.motion import Motion, State, Track
from blockmech.dynamics.stops import named
from blockmech.dynamics.until import Until, Watch
from blockmech.model.coordinates import same, signed, to_graph
from blockmech.model.naming import DriverName

Drivers = Mapping[str, DriverName]
Pairs = Mapping[str, tuple[float, float]]


def starts_in_graph(drivers: Drivers, starts: Pairs) -> Pairs:
    """Driver -> (q, rate) of the document, by the graph's drivers in its coordinates."""
    return {
        name.driver: (to_graph(name, starts[d][0]), signed(name, starts[d][1]))
        for d, name in drivers.items()
    }


def stops_in_graph(drivers: Drivers, stops: Pairs) -> Pairs:
    """Driver -> (lowest, highest) coordinate of the document, in that of the graph."""
    found = {}
    for d, ends in stops.items():
        low, high = sorted(to_graph(drivers[d], q) for q in ends)
        found[drivers[d].driver] = (low, high)
    return found


def goal_in_graph(drivers: Drivers, goal: Until) -> Until:
    """The goal of a run; an angle of the only driver is one of the graph's."""
    if goal.goal != "angle" or len(drivers) != 1:
        return goal
    (name,) = drivers.values()
    return replace(goal, value=to_graph(name, goal.value))


def watch_in_graph(drivers: Drivers, watch: Sequence[Watch]) -> tuple[Watch, ...]:
    """The user's events, whose surfaces take coordinates and rates of the document."""
    names = tuple(drivers.values())
    if all(map(same, names)):
        return tuple(watch)
    sign, offset = _columns(names)

    def turned(one: Watch) -> Watch:
        return replace(one, surface=lambda t, q, qd: one.surface(t, sign * q + offset, sign * qd))

    return tuple(map(turned, watch))


def motion_in_document(drivers: Drivers, motion: Motion) -> Motion:
    """The motion in the coordinates of the document."""
    names = tuple(drivers.values())
    if all(map(same, names)) and all(d == name.driver for d, name in drivers.items()):
        return motion
    said = {named(name.driver): named(d) for d, name in drivers.items()}
    events = tuple(e._replace(kind=said.get(e.kind, e.kind)) for e in motion.events)
    motion = replace(motion, end=said.get(motion.end, motion.end), events=events)
    if all(map(same, names)):
        return motion
    sign, offset = _columns(names)
    events = tuple(e._replace(q=sign * e.q + offset, qd=sign * e.qd) for e in events)
    return replace(
        motion,
        q_end=sign * motion.q_end + offset,
        qd_end=sign * motion.qd_end,
        track=_Turned(motion.track, sign, offset),
        events=events,
    )


def accelerations_in_document(drivers: Drivers, columns: Sequence[Any]) -> list[Any]:
    """q'' (n,) of each driver, from those of the graph's drivers in the same order."""
    return [signed(name, qdd) for name, qdd in zip(drivers.values(), columns, strict=True)]


def _columns(names: Sequence[DriverName]) -> tuple[Any, Any]:
    """Signs and offsets: numbers for one driver, arrays (k,) for k."""
    if len(names) == 1:
        return names[0].sign, names[0].offset
    return np.array([n.sign for n in names]), np.array([n.offset for n in names])


@dataclass(frozen=True)
class _Turned:
    """Dense output in the coordinates of the document."""

    track: Track
    sign: Any
    offset: Any

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        q, qd = self.track.state(t)
        return State(self.sign * q + self.offset, self.sign * qd)
