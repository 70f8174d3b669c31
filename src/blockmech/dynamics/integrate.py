"""Integration in time by SciPy, leg by leg: events, knots, dead centres, and honest ends.

A leg is what one call of the solver covers. It ends at the goal, at a knot of a load
(a kink inside a step would silently cost the order), at a standstill when swings are
counted, or where the mechanism ends: at a stop or a dead centre. A solver's word that
it succeeded is not taken: the end state is looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.equation import Equation
from blockmech.dynamics.motion import Event, State
from blockmech.dynamics.reduced import TURN, ReducedSystem
from blockmech.dynamics.surfaces import (
    Surface,
    armed,
    driver_at,
    knots_around,
    near_dead_centre,
    standstill,
    watched,
)
from blockmech.dynamics.until import Until, Watch

Method: TypeAlias = Literal["dop853", "lsoda", "radau"]

SCIPY_NAMES = {"dop853": "DOP853", "lsoda": "LSODA", "radau": "Radau"}
FINEST = 2.3e-14  # SciPy refuses smaller relative tolerances
MOST_EVALUATIONS = 400_000
MOST_LEGS = 100_000
FOREVER = 1e9  # [s] for goals without a time


class Leg(NamedTuple):
    """What one call of the solver covers: dense(t (m,)) -> y (n, m)."""

    t0: float
    t1: float
    dense: Callable[[Floats], Floats]


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
    status: Literal["reached", "ended", "failed"]
    end: str
    t_end: float
    y_end: Floats
    evaluations: int
    balance: float = 0.0

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


@dataclass(frozen=True)
class Task:
    """What is to be integrated; the same at every tolerance."""

    equation: Equation
    system: ReducedSystem | None  # None with several drivers
    y0: Floats
    t0: float
    until: Until
    watches: tuple[Watch, ...] = ()
    time_knots: tuple[float, ...] = ()

    @property
    def t_max(self) -> float:
        """Latest time [s]."""
        return self.t0 + (self.until.value if self.until.goal == "time" else FOREVER)

    def surfaces(self, q: float) -> list[Surface]:
        """Surfaces of a leg that starts at the coordinate q [rad or m]."""
        k = self.equation.drivers
        found = [watched(w, k) for w in self.watches] + near_dead_centre(self.equation)
        if self.system is None:
            return found
        goal, value = self.until.goal, self.until.value
        found.append(standstill(goal in ("standstill", "swings")))
        if goal == "angle":
            found.append(driver_at("goal", value))
        if goal == "turns":
            q0 = float(self.y0[0])
            found += [driver_at("goal", q0 + way * value * TURN) for way in (1, -1)]
        low, high = self.system.stops
        found += [driver_at("end stop", stop) for stop in (low, high) if math.isfinite(stop)]
        return found + knots_around(q, self.system.knots, self.system.period)

    def tolerances(self, tolerance: float) -> tuple[Any, Any]:
        """rtol and atol by component: never relative to an angle that may grow."""
        k, w = self.equation.drivers, self.equation.speed
        rest = max(tolerance, FINEST)
        energy = max(self.equation.kinetic(self.y0), 1e-300)
        rtol = np.array([FINEST] * k + [rest] * (k + 1))
        atol = np.array([rest] * k + [rest * w] * k + [rest * max(energy, w * w * 1e-6)])
        return rtol, atol


class _TooMany(Exception):
    """More evaluations than a run may take."""


def run(task: Task, method: Method, tolerance: float, most: int = MOST_EVALUATIONS) -> Run:
    """Integrate at one tolerance until the goal or whatever ends the motion before."""
    from scipy.integrate import solve_ivp

    count = 0
    right = task.equation.rhs

    def rhs(t: float, y: Any) -> Any:
        nonlocal count
        count += 1
        if count > most:
            raise _TooMany
        return right(t, y)

    rtol, atol = task.tolerances(tolerance)
    if method == "radau":  # takes one relative tolerance only
        rtol = max(tolerance, FINEST)
    turned = 0.0
    legs: list[Leg] = []
    events: list[Event] = []
    t, y, stops = task.t0, task.y0.copy(), 0
    stations = sorted(s for s in task.time_knots if task.t0 < s < task.t_max) + [task.t_max]

    def result(status: Literal["reached", "ended", "failed"], end: str) -> Run:
        return Run(
            drivers=task.equation.drivers,
            legs=tuple(legs) or (_standing(t, y),),
            events=tuple(sorted(events, key=lambda e: e.t)),
            status=status,
            end=end,
            t_end=t,
            y_end=y,
            evaluations=count,
            balance=balance(task, y, turned),
        )

    while len(legs) < MOST_LEGS:
        if not all(math.isfinite(x) for x in right(t, y)):
            return result("failed", "impossible pose")
        surfaces = task.surfaces(float(y[0]))
        functions = [armed(s, task.equation, t, y) for s in surfaces]
        station = next(s for s in stations if s > t)
        step = TURN / 4 / task.equation.speed if task.system and task.system.knots else np.inf
        try:
            solution = solve_ivp(
                rhs,
                (t, station),
                y,
                method=SCIPY_NAMES[method],
                rtol=rtol,
                atol=atol,
                dense_output=True,
                events=functions,
                max_step=step,
            )
        except _TooMany:
            return result("failed", f"more than {most} evaluations")
        except (ValueError, ArithmeticError, np.linalg.LinAlgError):
            return result("failed", "impossible pose")
        end = solution.y[:, -1]
        if not np.isfinite(end).all():
            return result("failed", "impossible pose")
        legs.append(Leg(t, float(solution.t[-1]), solution.sol))
        turned = max(turned, float(np.abs(solution.y[-1]).max()))
        hits = _hits(task, surfaces, solution, t)
        events += [e for e, s in hits if s.kind != "knot" and s.kind != "goal"]
        before, t, y = y, float(solution.t[-1]), end.copy()
        last = next((s for _, s in hits if s.terminal and _.t == t), None)
        if solution.status == -1:
            return result("failed", _failure(task, y))
        if last is None:
            if t >= task.t_max:
                return result("reached", "time")
            continue  # a knot in time
        if last.kind == "goal":
            return result("reached", task.until.goal)
        if last.kind == "dead centre":
            return result("ended", "dead centre")
        if last.kind == "end stop":
            return result("ended", "end stop")
        if last.kind == "standstill":
            stops += 1
            y[1] = 0.0
            if stops >= (task.until.value if task.until.goal == "swings" else 1):
                return result("reached", task.until.goal)
            if abs(y[0] - before[0]) <= 10 * tolerance:
                return result("ended", "rest")
        elif last.kind != "knot":
            return result("reached", last.kind)
    return result("failed", f"more than {MOST_LEGS} legs")


def _standing(t: float, y: Floats) -> Leg:
    return Leg(t, t, lambda times: np.repeat(y[:, None], times.size, axis=1))


def _hits(
    task: Task, surfaces: Sequence[Surface], solution: Any, t0: float
) -> list[tuple[Event, Surface]]:
    """Events of a leg with their surfaces, without those at its very beginning."""
    k = task.equation.drivers
    found = []
    tiny = 4 * np.finfo(float).eps * max(abs(t0), abs(float(solution.t[-1])))
    for surface, times, states in zip(surfaces, solution.t_events, solution.y_events, strict=True):
        for t, y in zip(times, states, strict=True):
            if t - t0 <= tiny:
                continue
            q, qd = (float(y[0]), float(y[1])) if k == 1 else (y[:k], y[k : 2 * k])
            found.append((Event(surface.kind, float(t), q, qd), surface))
    return found


def _failure(task: Task, y: Floats) -> str:
    """Why a solver gave up: a dead centre near by, or its own trouble."""
    margin = task.equation.margin
    if margin is not None and not margin(y) > 1e-3:
        return "dead centre"
    return "the solver's step became too small"


def balance(task: Task, y: Floats, turned: float) -> float:
    """Kinetic energy gained minus work of the loads, relative to what was turned over [-]."""
    equation = task.equation
    start, end = equation.kinetic(task.y0), equation.kinetic(y)
    turned = max(start, end, turned)
    return abs(end - start - float(y[-1])) / turned if turned > 0 else 0.0
