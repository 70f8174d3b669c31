"""Integration in time, leg by leg: events, knots, dead centres, and honest ends.

A leg is what one call of an integrator covers. It ends at the goal, at a knot of a load
(a kink inside a step would silently cost the order), at a standstill when swings are
counted, or where the mechanism ends: at a stop or a dead centre. An integrator's word
that it succeeded is not taken: the end state is looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import (
    DEAD_CENTRE,
    END_STOP,
    IMPOSSIBLE,
    INTERRUPTED,
    NO_INERTIA,
    TOO_MANY,
)
from blockmech.dynamics.integration import dop853, wrapped
from blockmech.dynamics.integration.equation import Equation, RightSide
from blockmech.dynamics.integration.legs import Ask, Hit, Leg, Resting, TooMany
from blockmech.dynamics.integration.surfaces import (
    Surface,
    driver_at,
    hollows_around,
    knots_around,
    near_dead_centre,
    standstill,
    watched,
)
from blockmech.dynamics.motion import Event, State
from blockmech.dynamics.system.reduced import TURN, ReducedSystem
from blockmech.dynamics.until import Until, Watch

Method: TypeAlias = Literal["dop853", "lsoda", "radau"]
Ending: TypeAlias = Literal["reached", "ended", "failed"]

MOST_EVALUATIONS = 400_000
MOST_WITHOUT_TIME = 100_000  # where the goal may never be met
MOST_LEGS = 100_000
FOREVER = 1e9  # [s] for goals without a time
NEAR_DEAD = 1e-3  # margin below which a solver that gives up is at a dead centre
PAST = 16 * float(np.finfo(np.float64).eps)  # [rad or m], or relative: beyond a kink
AHEAD = 1e-9  # [rad or m], or relative: how far ahead of where it gives up there is no pose


@dataclass(frozen=True)
class Task:
    """What is to be integrated; the same at every tolerance.

    ``y0`` is (q, q', 0), (2k + 1,); ``system`` is None with several drivers; a swing
    shorter than ``rest`` [rad or m] is none; ``hollows`` are ranges [rad or m] without inertia.
    """

    equation: Equation
    system: ReducedSystem | None
    y0: Floats
    t0: float
    until: Until
    watches: tuple[Watch, ...] = ()
    time_knots: tuple[float, ...] = ()
    rest: float = 1e-9
    hollows: tuple[tuple[float, float], ...] = ()

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
        found += [driver_at(END_STOP, stop, way) for stop, way in ends if math.isfinite(stop)]
        period = self.system.period
        found += hollows_around(q, self.hollows, period)
        return found + knots_around(q, self.system.knots, period)


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


class Verdict(NamedTuple):
    """Why a run is over, as in `Run`."""

    status: Ending
    end: str


@dataclass
class _Course:
    """A run under way: where the motion is, and what it has behind it.

    y : (2k + 1,) state at t [s]
    stops : standstills met
    turned : [J] largest work on the way
    """

    task: Task
    method: Method
    t: float
    y: Floats
    legs: list[Leg] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    stops: int = 0
    turned: float = 0.0

    def over(self) -> Verdict | None:
        """Why no leg begins here, or None."""
        if self.t >= self.task.t_max:
            return Verdict("reached", "time")
        if len(self.legs) >= MOST_LEGS:
            return Verdict("failed", f"more than {MOST_LEGS} legs")
        if not np.isfinite(self.task.equation.rhs(self.t, self.y)).all():
            return Verdict("failed", IMPOSSIBLE)
        return None

    def ask(self, rhs: RightSide, tolerance: float, longest: float) -> Ask:
        """The leg from here: to the next knot in time or the latest time, if nothing is met."""
        task, t, y = self.task, self.t, self.y
        end = min((s for s in task.time_knots if t < s < task.t_max), default=task.t_max)
        surfaces = task.surfaces(float(y[0]))
        return Ask(task.equation, rhs, t, y, end, surfaces, tolerance, longest)

    def take(self, leg: Leg) -> Verdict | None:
        """Go to the end of a leg; why the run is over by what was met there, or None."""
        before = self.y
        self.t, self.y = leg.t1, leg.y1.copy()
        self.legs.append(leg)
        self.events += _events(self.task, leg)
        self.turned = max(self.turned, leg.turned)
        if leg.failed:
            return self._given_up()
        if leg.halted:
            return Verdict("ended" if leg.halted == INTERRUPTED else "failed", leg.halted)
        last = leg.hits[-1] if leg.hits and leg.hits[-1].surface.terminal else None
        if last is not None and last.surface.kind == "knot":
            self._past_it()
        if last is not None and last.surface.kind == "standstill":
            self.stops += 1
            self.y[1] = 0.0
            if self.stops < self.task.stops and abs(self.y[0] - before[0]) <= self.task.rest:
                return Verdict("ended", "rest")
        return _met(self.task, last, self.stops)

    def _past_it(self) -> None:
        """Go on to the far side of a kink: on it, a load that jumps may be the one before."""
        q, rate = float(self.y[0]), float(self.y[1])
        way = PAST * max(1.0, abs(q))
        if not abs(rate) * (self.task.t_max - self.t) > way:
            return
        there, t = self.y.copy(), self.t + way / abs(rate)
        there[0] = q + math.copysign(way, rate)
        if np.isfinite(self.task.equation.rhs(t, there)).all():  # else the load ends there
            self.y, self.t = there, t

    def _given_up(self) -> Verdict | None:
        """Why the run is over where a solver gave up; None if another one goes on."""
        if self.method == "lsoda" and self.task.equation.drivers == 1:
            self.method = "dop853"  # which comes as near as one can to where there is no pose
            return None
        end = _failure(self.task, self.t, self.y)
        return Verdict("ended" if end in (DEAD_CENTRE, IMPOSSIBLE) else "failed", end)


def run(
    task: Task,
    method: Method,
    tolerance: float,
    most: int | None = None,
    longest: float = math.inf,
) -> Run:
    """Integrate at one tolerance until the goal or whatever ends the motion before.

    Steps are not longer than ``longest`` [s]; ``most`` evaluations are allowed.
    """
    if most is None:
        most = MOST_EVALUATIONS if task.until.goal == "time" else MOST_WITHOUT_TIME
    rhs, evaluations = _counted(task.equation.rhs, most)
    longest = min(longest, _longest(task))
    course = _Course(task, method, task.t0, task.y0.copy())
    verdict = course.over()
    while verdict is None:
        leg = _leg(course.ask(rhs, tolerance, longest), course.method)
        verdict = leg if isinstance(leg, Verdict) else course.take(leg) or course.over()
    return Run(
        drivers=task.equation.drivers,
        legs=tuple(course.legs) or (_standing(course.t, course.y),),
        events=tuple(course.events),
        status=verdict.status,
        end=verdict.end,
        t_end=course.t,
        y_end=course.y,
        evaluations=evaluations(),
        balance=balance(task, course.y, course.turned),
    )


def _counted(right: RightSide, most: int) -> tuple[RightSide, Callable[[], int]]:
    """A right-hand side that counts, and its count; one above ``most`` raises `TooMany`."""
    count, given_up = 0, False

    def rhs(t: float, y: Any) -> Any:
        nonlocal count, given_up
        count += 1
        if count > most and not given_up:  # once: what is kept of the run is still looked at
            given_up = True
            raise TooMany
        return right(t, y)

    return rhs, lambda: count


def _leg(ask: Ask, method: Method) -> Leg | Verdict:
    """A leg, or why there is none."""
    try:
        if method == "dop853" and ask.equation.drivers == 1:
            leg = dop853.integrate(ask)
        else:
            leg = wrapped.integrate(ask, method)
    except KeyboardInterrupt:  # what is done so far is kept
        return Verdict("ended", INTERRUPTED)
    except TooMany:
        return Verdict("failed", TOO_MANY)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        return Verdict("failed", IMPOSSIBLE)
    return leg if np.isfinite(leg.y1).all() else Verdict("failed", IMPOSSIBLE)


def _met(task: Task, last: Hit | None, stops: int) -> Verdict | None:
    """Why the run is over by the surface on which a leg ended, or None."""
    kind = last.surface.kind if last else ""
    if kind in ("", "knot") or (kind == "standstill" and stops < task.stops):
        return None
    if kind in (DEAD_CENTRE, END_STOP, NO_INERTIA):
        return Verdict("ended", kind)
    return Verdict("reached", task.until.goal if kind in ("goal", "standstill") else kind)


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
    return Leg(t, t, y, Resting(y), (), False, 0.0, np.empty(0))


def _failure(task: Task, t: float, y: Floats) -> str:
    """Why a solver gave up: there is no pose ahead, or its own trouble."""
    margin = task.equation.margin
    if margin is not None and not margin(y) > NEAR_DEAD:
        return DEAD_CENTRE
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
