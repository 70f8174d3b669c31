"""Integration in time, leg by leg: events, knots, dead centres, and honest ends.

A leg is what one call of an integrator covers. It ends at the goal, at a knot of a load
(a kink inside a step would silently cost the order), at a standstill when swings are
counted, or where the mechanism ends: at a stop or a dead centre. An integrator's word
that it succeeded is not taken: the end state is looked at.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from blockmech.dynamics import dop853, wrapped
from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.dips import DEAD, IMPOSSIBLE
from blockmech.dynamics.equation import Equation
from blockmech.dynamics.legs import TOO_MANY, Ask, Hit, Leg, TooMany
from blockmech.dynamics.motion import INTERRUPTED, Event, State
from blockmech.dynamics.reduced import TURN, ReducedSystem
from blockmech.dynamics.surfaces import (
    Surface,
    driver_at,
    near_dead_centre,
    places_around,
    standstill,
    watched,
)
from blockmech.dynamics.until import Until, Watch

Method: TypeAlias = Literal["dop853", "lsoda", "radau"]
Ending: TypeAlias = Literal["reached", "ended", "failed"]

MOST_EVALUATIONS = 400_000
MOST_WITHOUT_TIME = 100_000  # where the goal may never be met
MOST_LEGS = 100_000
FOREVER = 1e9  # [s] for goals without a time
NEAR_DEAD = 1e-3  # margin below which a solver that gives up is at a dead centre
AHEAD = 1e-9  # [rad or m], or relative: how far ahead of where it gives up there is no pose


@dataclass(frozen=True)
class Task:
    """What is to be integrated; the same at every tolerance.

    ``y0`` is (q, q', 0), (2k + 1,); ``system`` is None with several drivers; a swing
    shorter than ``rest`` [rad or m] is none; ``empty`` are places [rad or m] without inertia.
    """

    equation: Equation
    system: ReducedSystem | None
    y0: Floats
    t0: float
    until: Until
    watches: tuple[Watch, ...] = ()
    time_knots: tuple[float, ...] = ()
    rest: float = 1e-9
    empty: tuple[float, ...] = ()

    @property
    def t_max(self) -> float:
        """Latest time [s]."""
        return self.t0 + (self.until.value if self.until.goal == "time" else FOREVER)

    @property
    def stops(self) -> int:
        """Standstills wanted, 0 where they do not end the run."""
        goal = self.until.goal
        return int(self.until.value) if goal == "swings" else int(goal == "standstill")

    def surfaces(self, q: float) -> list[Surface]:
        """Surfaces of a leg that starts at the coordinate q [rad or m]."""
        found = [watched(w, self.equation.drivers) for w in self.watches]
        found += near_dead_centre(self.equation)
        if self.system is None:
            return found
        goal, value = self.until.goal, self.until.value
        found.append(standstill(terminal=self.stops > 0))
        if goal == "angle":
            found.append(driver_at("goal", value))
        if goal == "turns":
            q0 = float(self.y0[0])
            found += [driver_at("goal", q0 + way * value * TURN) for way in (1, -1)]
        ends = zip(self.system.stops, (-1, 1), strict=True)  # a stop is met from inside
        found += [driver_at("end stop", stop, way) for stop, way in ends if math.isfinite(stop)]
        found += places_around("knot", q, self.system.knots, self.system.period)
        return found + places_around("no inertia", q, self.empty, self.system.period)


@dataclass(frozen=True)
class Run:
    """One integration.

    status : "reached", "ended" (by something named) or "failed"
    end : the named reason
    balance : [-] disagreement of kinetic energy and work, relative to the work turned over
    """

    drivers: int
    legs: tuple[Leg, ...]
    events: tuple[Event, ...]
    status: Ending
    end: str
    t_end: float
    y_end: Floats
    evaluations: int
    balance: float = 0.0

    @property
    def steps(self) -> int:
        """Number of steps, roughly: of LSODA without its wrapper that of outputs."""
        return sum(leg.marks.size for leg in self.legs)

    @property
    def longest(self) -> float:
        """Longest step [s]."""
        return max(float(np.diff([*leg.marks, leg.t1]).max(initial=0.0)) for leg in self.legs)

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        k = self.drivers
        y = np.empty((2 * k + 1, t.size))
        starts = np.array([leg.t0 for leg in self.legs])
        which = np.clip(np.searchsorted(starts, t, side="right") - 1, 0, len(self.legs) - 1)
        for i in np.unique(which).tolist():
            mask = which == i
            y[:, mask] = self.legs[i].dense(t[mask])
        if k == 1:
            return State(y[0], y[1])
        return State(y[:k].T, y[k : 2 * k].T)


def run(
    task: Task,
    method: Method,
    tolerance: float,
    most: int | None = None,
    longest: float = math.inf,
) -> Run:
    """Integrate at one tolerance until the goal or whatever ends the motion before.

    Steps are not longer than ``longest`` [s].
    """
    count, given_up = 0, False
    right = task.equation.rhs
    longest = min(longest, _longest(task))
    if most is None:
        most = MOST_EVALUATIONS if task.until.goal == "time" else MOST_WITHOUT_TIME

    def rhs(t: float, y: Any) -> Any:
        nonlocal count, given_up
        count += 1
        if count > most and not given_up:  # once: what is kept of the run is still looked at
            given_up = True
            raise TooMany
        return right(t, y)

    legs: list[Leg] = []
    events: list[Event] = []
    t, y, stops, turned = task.t0, task.y0.copy(), 0, 0.0
    stations = [*sorted(s for s in task.time_knots if task.t0 < s < task.t_max), task.t_max]
    status: Ending | None = None
    end = ""
    while status is None:
        if len(legs) >= MOST_LEGS:
            status, end = "failed", f"more than {MOST_LEGS} legs"
            break
        if not np.isfinite(right(t, y)).all():
            status, end = "failed", "impossible pose"
            break
        station = next(s for s in stations if s > t)
        surfaces = task.surfaces(float(y[0]))
        ask = Ask(task.equation, rhs, t, y, station, surfaces, tolerance, longest)
        try:
            leg = _leg(ask, method)
        except KeyboardInterrupt:  # what is done so far is kept
            status, end = "ended", INTERRUPTED
            break
        if isinstance(leg, str):
            status, end = "failed", leg
            break
        legs.append(leg)
        turned = max(turned, leg.turned)
        events += _events(task, leg)
        before, t, y = y, leg.t1, leg.y1.copy()
        if leg.failed and method == "lsoda" and task.equation.drivers == 1:
            method = "dop853"  # which comes as near as one can to where there is no pose
            continue
        if leg.failed:
            end = _failure(task, t, y)
            status = "ended" if end in (DEAD, IMPOSSIBLE) else "failed"
            break
        if leg.halted:
            status, end = "ended" if leg.halted == INTERRUPTED else "failed", leg.halted
            break
        last = leg.hits[-1] if leg.hits and leg.hits[-1].surface.terminal else None
        if last is not None and last.surface.kind == "standstill":
            stops += 1
            y[1] = 0.0
            if stops < task.stops and abs(y[0] - before[0]) <= task.rest:
                status, end = "ended", "rest"
        if status is None:
            status, end = _verdict(task, last, t, stops)
    return Run(
        drivers=task.equation.drivers,
        legs=tuple(legs) or (_standing(t, y),),
        events=tuple(events),
        status=status,
        end=end,
        t_end=t,
        y_end=y,
        evaluations=count,
        balance=balance(task, y, turned),
    )


def _leg(ask: Ask, method: Method) -> Leg | str:
    """A leg, or why there is none."""
    try:
        if method == "dop853" and ask.equation.drivers == 1:
            leg = dop853.integrate(ask)
        else:
            leg = wrapped.integrate(ask, method)
    except TooMany:
        return TOO_MANY
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        return "impossible pose"
    return leg if np.isfinite(leg.y1).all() else "impossible pose"


def _verdict(task: Task, last: Hit | None, t: float, stops: int) -> tuple[Ending | None, str]:
    """Whether the run is over after a leg, and by what name."""
    kind = last.surface.kind if last else ""
    if last is None:
        return ("reached", "time") if t >= task.t_max else (None, "")
    if kind == "knot" or (kind == "standstill" and stops < task.stops):
        return None, ""
    if kind in ("dead centre", "end stop", "no inertia"):
        return "ended", kind
    return "reached", task.until.goal if kind in ("goal", "standstill") else kind


def _longest(task: Task) -> float:
    """Longest step [s]: a quarter turn where a knot could be passed twice in one."""
    if task.system is None or not task.system.knots:
        return math.inf
    return TURN / 4 / task.equation.speed


def _events(task: Task, leg: Leg) -> list[Event]:
    k = task.equation.drivers
    return [
        Event(
            hit.surface.kind,
            hit.t,
            float(hit.y[0]) if k == 1 else hit.y[:k],
            float(hit.y[1]) if k == 1 else hit.y[k : 2 * k],
        )
        for hit in leg.hits
        if hit.surface.kind not in ("knot", "goal")
    ]


def _standing(t: float, y: Floats) -> Leg:
    def dense(times: Floats) -> Floats:
        return np.repeat(y[:, None], times.size, axis=1)

    return Leg(t, t, y, dense, (), False, 0.0, np.empty(0))


def _failure(task: Task, t: float, y: Floats) -> str:
    """Why a solver gave up: there is no pose ahead, or its own trouble."""
    margin = task.equation.margin
    if margin is not None and not margin(y) > NEAR_DEAD:
        return DEAD
    way = np.sign(task.equation.rhs(t, y))  # of coordinates and rates
    ahead = y + AHEAD * np.maximum(np.abs(y), 1.0) * np.where(np.isfinite(way), way, 0.0)
    if not np.isfinite(task.equation.rhs(t + AHEAD * max(abs(t), 1.0), ahead)).all():
        return IMPOSSIBLE
    return "the solver's step became too small"


def balance(task: Task, y: Floats, turned: float) -> float:
    """Kinetic energy gained minus work of the loads, relative to what was turned over [-]."""
    equation = task.equation
    start, end = equation.kinetic(task.y0), equation.kinetic(y)
    turned = max(start, end, turned)
    return abs(end - start - float(y[-1])) / turned if turned > 0 else 0.0
