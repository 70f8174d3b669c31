r"""Motions integrated in time by SciPy's integrators: DOP853, LSODA, Radau.

    one driver       y = (q, q', W),       J q'' = tau_all - J' q'^2 / 2
    k drivers        y = (q, q', W),       M q'' = Q - c,    q and q' of length k

W is the work of all loads since the start, so that the balance of energy is at hand at no cost;
with joint friction it is the work that friction took. An integration goes in segments, each
with a smooth right-hand side: kinks of loads and reversals of pairs with friction end one.
Within a segment the directions of slip are frozen (numerics 8). A solver's word that it
succeeded is not taken: the state is looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853, LSODA, OdeSolution, Radau
from scipy.optimize import brentq

from blockmech.dynamics import loads
from blockmech.dynamics.estimate import missed, refined
from blockmech.dynamics.events import (
    GOAL,
    GUIDE_SIDE,
    KINK,
    REVERSAL,
    STANDSTILL,
    EventRule,
    Hit,
    Looking,
    friction_rules,
    general_rules,
    kink_rules,
)
from blockmech.dynamics.motion import (
    AMBIGUOUS,
    DEAD_CENTRE,
    IMPOSSIBLE,
    INTERRUPTED,
    NO_INERTIA,
    REST,
    SELF_LOCKED,
    TOO_MANY,
    Event,
    Floats,
    Motion,
    State,
    Status,
    Still,
)
from blockmech.dynamics.request import SimulationRequest
from blockmech.plane import EPS

if TYPE_CHECKING:
    from blockmech.dynamics.friction import Resisted
    from blockmech.dynamics.system import System

SOLVERS = {"dop853": DOP853, "lsoda": LSODA, "radau": Radau}
TARGET = 1e-9  # [rad or m] if none is given
FLOOR = 100 * EPS  # the least relative tolerance that SciPy takes
FINER = 20.0  # a second run is so much finer (numerics 14)
SHORTER = FINER ** (-1 / 8)  # its longest step, at order 8: equal steps would show no error
EVALUATIONS = 400_000  # at most in a run; some seconds
EVALUATIONS_WITHOUT_TIME = 100_000  # where the goal may never be met
FOREVER = 1e9  # [s] for goals without a time
NEAR_DEAD_CENTRE = 1e-3  # margin below which a solver that gives up is at a dead centre
AHEAD = 1e-9  # relative: how far ahead of where a solver gives up there is no pose
LOCATED = 1e-3  # of a step: how well dense output locates an event, at least
PAST = 16 * EPS  # relative: beyond a kink, on which a load that jumps may be the one before
LEFT = 1.5  # the time left to a singular place is at most this, relative to what its end tells
AROUND = 7  # poses that tell the size of the inertia
WAITING = 90  # steps of a period of the loads at which a driver at rest is looked at


class TooMany(Exception):
    """More evaluations than allowed."""


# -- the equation --------------------------------------------------------------------------


@dataclass
class Equation:
    """The right-hand side of a system, with directions of slip that are frozen."""

    system: System
    q0: Any
    most: float = math.inf
    sides: tuple[int, ...] = ()
    count: int = 0
    _last: tuple[Any, float, float] = (None, math.nan, math.nan)  # q, margin, J
    _slips: tuple[float, Any] = (math.nan, None)

    @property
    def drivers(self) -> int:
        """Number k of drivers."""
        return len(self.system.drivers)

    def __call__(self, t: float, y: Any) -> Any:
        """y' at a state; NaN where there is no pose."""
        self.count += 1
        if self.count > self.most:
            self.most = math.inf  # once: what is kept of the run is still looked at
            raise TooMany
        if self.drivers > 1:
            return self._several(t, y)
        q, qd = float(y[0]), float(y[1])
        if self.sides:
            found = self.resisted(q, qd, t)
            self._last = q, found.margin, math.nan
            qdd, power, margin = found.qdd, found.power, found.margin
        else:
            J, tau, dJ, margin = self.system.one(q, qd, t)
            self._last = q, margin, J
            qdd = (tau - 0.5 * dJ * qd * qd) / J if J > 0 else math.nan
            power = tau * qd
        return (qd, qdd, power) if margin > 0 else (math.nan,) * 3

    def _several(self, t: float, y: Floats) -> Floats:
        k = self.drivers
        qd = y[k : 2 * k]
        M, c, Q, margin = self.system.terms(y[:k], qd, t)
        self._last = tuple(y[:k]), margin, math.nan
        if not (margin > 0 and np.isfinite(M).all()):
            return np.full(2 * k + 1, math.nan)
        return np.concatenate([qd, np.linalg.solve(M, Q - c), [Q @ qd]])

    def closeness(self, y: Floats) -> tuple[float, float]:
        """Margin, and inertia relative to a typical one (of one driver), at a state."""
        k = self.drivers
        here = float(y[0]) if k == 1 else tuple(y[:k])
        if self._last[0] != here:
            if k == 1:
                one = self.system.one(float(y[0]), 0.0, 0.0)
                self._last = here, one.margin, one.J
            else:
                self._last = here, self.system.terms(y[:k], 0 * y[:k], 0.0).margin, math.nan
        _, margin, J = self._last
        return margin, J / self.typical if k == 1 and not self.sides else 1.0

    @cached_property
    def typical(self) -> float:
        """See `typical_inertia`."""
        return typical_inertia(self.system, self.q0)

    def resisted(self, q: float, qd: float, t: float) -> Resisted:
        """Acceleration and friction of the pairs at a state."""
        assert self.system.friction is not None
        return self.system.friction.at(q, qd, t, self.sides)

    def inertia(self, y: Floats) -> Floats:
        """Inertia (k, k) on the drivers."""
        k = self.drivers
        if k == 1:
            return np.array([[self.system.one(float(y[0])).J]])
        return self.system.terms(y[:k], y[k : 2 * k]).M

    def kinetic(self, y: Floats) -> float:
        """Kinetic energy [J]."""
        qd = y[self.drivers : 2 * self.drivers]
        return 0.5 * float(qd @ self.inertia(y) @ qd)

    def slips(self, q: float) -> Any:
        """Relative rates of the pairs with friction per unit driver rate."""
        if self._slips[0] != q:
            assert self.system.friction is not None
            self._slips = q, self.system.friction.slips(np.array([q]))[0]
        return self._slips[1]

    def pair_loads(self, t: float, y: Floats) -> Any:
        """Loads on the pairs with friction."""
        return self.resisted(float(y[0]), float(y[1]), t).loads


def typical_inertia(system: System, q: float) -> float:
    """Usual inertia at a few poses around a place [kg m2 or kg]; it may have no bound."""
    J = system.sample(q + system.span * np.arange(AROUND) / AROUND).J
    good = J[np.isfinite(J) & (J > 0)]
    return float(np.median(good)) if good.size else 1.0


def scales(equation: Equation, t: float, y: Floats) -> tuple[float, float]:
    """A typical speed [rad/s or m/s] and a typical work [J], for the tolerances."""
    k = equation.drivers
    rates, span = y[k : 2 * k], equation.system.span
    slope = np.asarray(equation(t, y), dtype=np.float64)[k : 2 * k]
    push = float(np.nanmax(np.abs(slope), initial=0.0))
    speed = float(np.abs(rates).max()) + math.sqrt(2 * push * min(span, 1.0))
    speed = speed or 1.0
    work = 0.5 * equation.inertia(y).trace() * speed**2
    return speed, work if work > 0 and math.isfinite(work) else 1.0


# -- one run at one tolerance --------------------------------------------------------------


class Verdict(NamedTuple):
    """Why a run is over."""

    status: Status
    end: str


@dataclass(frozen=True)
class Steps:
    """Dense output of a run: that of its steps, one after the other."""

    drivers: int
    solution: OdeSolution

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        y, k = self.solution(t), self.drivers
        return State(y[0], y[1]) if k == 1 else State(y[:k].T, y[k : 2 * k].T)


@dataclass
class Resting:
    """Dense output of a driver at rest."""

    y: Floats

    def __call__(self, t: Any) -> Floats:
        """The same state at all times."""
        return np.multiply.outer(self.y, np.ones_like(np.asarray(t, dtype=np.float64)))


@dataclass
class Run:
    """One integration at one tolerance, under way."""

    system: System
    request: SimulationRequest
    method: str
    tolerance: float
    name: str  # told to those who follow the progress
    rest: float  # [rad or m]: a swing shorter than this is none
    max_step: float = math.inf  # [s]
    longest: float = 0.0  # [s] step so far
    t: float = 0.0
    y: Floats = field(default_factory=lambda: np.empty(0))
    times: list[float] = field(default_factory=list)
    pieces: list[Any] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    facts: dict[str, float] = field(default_factory=dict)
    standstills: int = 0
    fired: EventRule | None = None
    turned: float = 0.0  # [J] largest work on the way
    left: float = 0.0  # [s] to a singular place that the run stops short of

    def __post_init__(self) -> None:
        q, rate, self.t = self.request.start
        self.y = np.concatenate([np.atleast_1d(q), np.atleast_1d(rate), [0.0]]).astype(float)
        timed = self.request.until.goal == "time"
        most = EVALUATIONS if timed else EVALUATIONS_WITHOUT_TIME
        self.times.append(self.t)
        self.equation = Equation(self.system, q, most)
        self.knots = (
            loads.time_knots_of(self.system.compiled.structure, self.request.t_last)
            if "time" in self.system.depends_on
            else ()
        )
        self.swing_from = float(self.y[0])

    @property
    def t_max(self) -> float:
        """Latest time [s]."""
        return min(self.request.t_last, self.request.start.t + FOREVER)

    def motion(self) -> Motion:
        """Integrate until the goal or whatever ends the motion before."""
        try:
            verdict = self._begun()
            start, self.scales = self.y, scales(self.equation, self.t, self.y)
            while verdict is None:
                verdict = self._segment()
        except KeyboardInterrupt:  # what is done so far is kept
            start, verdict = self.y, Verdict("ended", INTERRUPTED)
        except TooMany:
            verdict = Verdict("failed", TOO_MANY)
        return self._told(start, verdict)

    def _told(self, start: Floats, verdict: Verdict) -> Motion:
        k, y = self.equation.drivers, self.y
        one = k == 1
        q, qd = (float(y[0]), float(y[1])) if one else (y[:k], y[k : 2 * k])
        if self.system.friction is not None:
            self.facts["friction_work"] = float(y[-1])
        elif self.pieces:
            before, after = self.equation.kinetic(start), self.equation.kinetic(y)
            whole = max(before, after, self.turned)
            balance = abs(after - before - float(y[-1])) / whole if whole > 0 else 0.0
            if math.isfinite(balance):
                self.facts["energy_balance"] = balance
        solution = OdeSolution(self.times, self.pieces) if self.pieces else None
        return Motion(
            method=self.method,
            why=self.request.why,
            regime="rest" if verdict.end == REST else "integrated",
            status=verdict.status,
            end=verdict.end,
            t_start=self.request.start.t,
            t_end=self.t,
            q_end=q,
            qd_end=qd,
            track=Still(q, qd) if solution is None else Steps(k, solution),
            events=tuple(self.events),
            error=math.inf,
            time_error=LEFT * self.left,
            accuracy=self.request.accuracy,
            cost=self.system.cost,
            facts={**self.facts, "tolerance": self.tolerance},
        )

    # -- segments --------------------------------------------------------------------------

    def _begun(self) -> Verdict | None:
        """Settle directions of slip at the start."""
        if self.system.friction is None:
            return None
        if self.y[1] == 0.0:
            return self._from_rest()
        self.equation.sides = self.system.friction.sides(
            float(self.y[0]), 1 if self.y[1] > 0 else -1
        )
        return None

    def _rules(self) -> list[EventRule]:
        equation, system = self.equation, self.system
        q0 = float(np.atleast_1d(self.request.start.q)[0])
        rules = general_rules(system, self.request, q0, equation.closeness)
        if equation.drivers == 1:
            rules += kink_rules(float(self.y[0]), system.knots, system.period)
        if system.friction is not None:
            guides = system.friction.program.guides
            rules += friction_rules(equation.slips, equation.pair_loads, guides)
        return rules

    def _segment(self) -> Verdict | None:
        """Go on with one smooth right-hand side to whatever ends it."""
        if self.t >= self.t_max:
            return Verdict("reached", "time")
        bound = min((s for s in self.knots if self.t < s < self.t_max), default=self.t_max)
        looking = Looking.at(self._rules(), self.t, self.y, self.fired)
        self.fired = None
        hit = self._integrated(looking, bound)
        if isinstance(hit, Verdict):
            return hit
        return None if hit is None else self._met(hit)

    def _solver(self, bound: float, t: float, y: Floats, longest: float) -> Any:
        k, (speed, work) = self.equation.drivers, self.scales
        tol = self.tolerance
        rtol: Any = np.array([FLOOR] * k + [max(tol, FLOOR)] * (k + 1))
        if self.method == "radau":  # SciPy's takes one number only
            rtol = max(tol, FLOOR)
        atol = np.array([tol] * k + [tol * speed] * k + [tol * work])
        make = SOLVERS[self.method]
        return make(self.equation, t, y, bound, rtol=rtol, atol=atol, max_step=longest)

    def _integrated(self, looking: Looking, bound: float) -> Hit | Verdict | None:
        """Steps up to a terminal event, the bound (None), or where the solver gives up."""
        try:
            solver = self._solver(bound, self.t, self.y, self.max_step)
        except (ValueError, ArithmeticError, np.linalg.LinAlgError):
            return self._given_up()
        while solver.status == "running":
            try:
                with np.errstate(all="ignore"):
                    solver.step()
                    failed = solver.status == "failed" or not np.isfinite(solver.y).all()
                    self.equation.closeness(solver.y)
                    dense = None if failed else solver.dense_output()
            except (ValueError, ArithmeticError, np.linalg.LinAlgError):
                failed, dense = True, None
            if failed or dense is None:
                return self._given_up()
            if solver.t == solver.t_old:
                continue
            self.longest = max(self.longest, solver.t - solver.t_old)
            hits = looking.in_step(solver.t_old, solver.t, solver.y, dense)
            last = hits[-1] if hits and hits[-1].rule.terminal else None
            if last is not None:
                t, y = self._exactly(last, solver.t_old, self.y, dense)
                self._took(t, y, dense)
            else:
                self._took(solver.t, solver.y, dense)
            self._note(hits, dense)
            if last is not None:
                return last
        return None

    def _exactly(self, hit: Hit, t0: float, y0: Floats, dense: Any) -> tuple[float, Floats]:
        """Time and state of an event, the state by a step up to it: dense output is coarser."""
        t, between = hit.t, np.asarray(dense(hit.t))
        if not t > t0:
            return t, between
        try:
            finer = math.isfinite(self.max_step)  # not the one step of the coarser run again
            solver = self._solver(t, t0, y0, SHORTER * (t - t0) if finer else math.inf)
            while solver.status == "running":
                solver.step()
        except (ValueError, ArithmeticError, np.linalg.LinAlgError):
            return t, between
        y = np.array(solver.y)
        if solver.status == "failed" or not np.isfinite(y).all():
            return t, between
        slope = np.asarray(self.equation(t, y), dtype=np.float64)
        here, ahead = hit.rule.value(t, y), LOCATED * (t - t0)
        rise = (hit.rule.value(t + ahead, y + ahead * slope) - here) / ahead
        late = -here / rise if rise else math.nan
        moved = y + late * slope
        known = hit.rule.within > 1 and abs(late) <= ahead and np.isfinite(moved).all()
        return (t + late, moved) if known else (t, y)

    def _took(self, t: float, y: Floats, dense: Any) -> None:
        if t > self.times[-1]:
            self.times.append(float(t))
            self.pieces.append(dense)
        self.t, self.y = float(t), np.array(y)
        self.turned = max(self.turned, abs(float(y[-1])))
        if self.system.progress is not None:
            self.system.progress(self.name, *self._far())

    def _far(self) -> tuple[float, float | None]:
        """How far the run is on the way to its goal, and the whole way."""
        goal, value = self.request.until.goal, self.request.until.value
        q0 = float(np.atleast_1d(self.request.start.q)[0])
        if goal == "turns":
            return abs(float(self.y[0]) - q0) / loads.TURN, value
        if goal == "angle":
            return abs(float(self.y[0]) - q0), abs(value - q0)
        return self.t - self.request.start.t, value if goal == "time" else None

    def _note(self, hits: list[Hit], dense: Any) -> None:
        k = self.equation.drivers
        for hit in hits:
            if hit.rule.kind in (KINK, GOAL, GUIDE_SIDE):
                continue
            y = np.array(dense(hit.t))
            if hit.rule.kind == STANDSTILL:
                y[1] = 0.0
            q, qd = (float(y[0]), float(y[1])) if k == 1 else (y[:k], y[k : 2 * k])
            self.events.append(Event(hit.rule.kind, float(hit.t), q, qd))

    # -- what was met ----------------------------------------------------------------------

    def _met(self, hit: Hit) -> Verdict | None:
        """Why the run is over by the event that ended a segment, or None."""
        rule, goal = hit.rule, self.request.until.goal
        self.fired = rule
        if rule.kind == KINK:
            self._past_kink()
            return None
        if rule.kind == REVERSAL:
            self._reverse(rule.index)
            return None
        if rule.kind == GUIDE_SIDE:
            return None
        if rule.kind == STANDSTILL:
            return self._stood()
        if rule.kind in (DEAD_CENTRE, NO_INERTIA):
            self._singular(rule.kind)
            return Verdict("ended", rule.kind)
        if rule.kind == GOAL:
            return Verdict("reached", goal)
        own = any(rule.kind == w.name and w.terminal for w in self.request.watch)
        return Verdict("reached" if own else "ended", rule.kind)

    def _stood(self) -> Verdict | None:
        goal, value = self.request.until.goal, self.request.until.value
        self.y[1] = 0.0
        self.standstills += 1
        swing, self.swing_from = abs(float(self.y[0]) - self.swing_from), float(self.y[0])
        wanted = {"standstill": 1, "swings": int(value)}.get(goal, 0)
        if self.standstills == wanted:
            return Verdict("reached", goal)
        if self.system.friction is not None:
            return self._from_rest()
        return Verdict("ended", REST) if wanted and swing <= self.rest else None

    def _reverse(self, index: int) -> None:
        """Flip the side of a pair, and of those that reverse at the same place."""
        assert self.system.friction is not None
        old = self.equation.sides[index]
        beyond = self.system.friction.sides(float(self.y[0]), 1 if self.y[1] > 0 else -1)
        self.equation.sides = tuple(-old if i == index else s for i, s in enumerate(beyond))

    def _past_kink(self) -> None:
        """Go on to the far side of a kink, if there is one: else the load ends there."""
        q, rate = float(self.y[0]), float(self.y[1])
        way = PAST * max(1.0, abs(q))
        if not abs(rate) * (self.t_max - self.t) > way:
            return
        there, t = self.y.copy(), self.t + way / abs(rate)
        there[0] = q + math.copysign(way, rate)
        if np.isfinite(self.equation(t, there)).all():
            self.y, self.t = there, t

    def _singular(self, kind: str) -> None:
        """The time left to a dead centre, or to a place without inertia.

        The margin goes with the square of that time, the inertia with the square of the way.
        """
        q, qd = float(self.y[0]), float(self.y[1]) if self.equation.drivers == 1 else math.nan
        at = math.nan
        if kind == NO_INERTIA:
            one = self.system.one(q, 0.0, 0.0)
            at = self.t + abs(one.J / one.dJ / qd) if one.dJ and qd else math.nan
        elif math.isfinite(qd):
            h = math.copysign(1e-3 * NEAR_DEAD_CENTRE**2, qd)
            here, before = (self.system.one(x, 0.0, 0.0).margin for x in (q, q - h))
            fall = (before - here) / abs(h) * abs(qd)
            at = self.t + 2 * here / fall if fall > 0 else math.nan
        self.left = at - self.t if math.isfinite(at) else math.inf
        if math.isfinite(at):
            self.facts[f"{kind.replace(' ', '_')}_time"] = at

    def _given_up(self) -> Verdict | None:
        """Why the run is over where a solver gave up; None if another one goes on."""
        if self.method != "dop853":
            self.method = "dop853"  # which comes as near as one can to where there is no pose
            return None
        t, y = self.t, self.y
        margin = self.equation.closeness(y)[0]
        if not margin > NEAR_DEAD_CENTRE:
            if margin > 0:
                self._singular(DEAD_CENTRE)
            return Verdict("ended", DEAD_CENTRE)
        way = np.sign(np.asarray(self.equation(t, y), dtype=float))
        ahead = y + AHEAD * np.maximum(np.abs(y), 1.0) * np.where(np.isfinite(way), way, 0.0)
        later = t + AHEAD * max(abs(t), 1.0)
        if self.equation.sides:
            found = self.equation.resisted(float(ahead[0]), float(ahead[1]), later)
            if not found.outcome.solved and found.margin > 0:
                return Verdict("ended", SELF_LOCKED)
        if not np.isfinite(np.asarray(self.equation(later, ahead), dtype=float)).all():
            rate = float(np.abs(y[self.equation.drivers]))
            places = PAST * max(1.0, float(np.abs(y[0])))  # it comes so near, and steps so short
            self.left = PAST * max(abs(t), EPS) + (places / rate if rate else 0.0)
            return Verdict("ended", IMPOSSIBLE)
        return Verdict("failed", "the solver's step became too small")

    # -- rest under joint friction ---------------------------------------------------------

    def _from_rest(self) -> Verdict | None:
        """Which way a driver at rest starts; what ends the run if it does not."""
        friction = self.system.friction
        assert friction is not None
        q = float(self.y[0])
        size = self.system.load_size(q)
        found = friction.rest(q, self.t, size)
        if found.rests:
            self.events.append(Event(REST, self.t, q, 0.0))
            self.facts |= {"holding_low": found.holding[0], "holding_high": found.holding[1]}
            leaves = self._leaves(q, size)
            if leaves is None:
                return self._at_rest()
            self._wait(leaves)
            found = friction.rest(q, math.nextafter(leaves, math.inf), size)
        if found.ambiguous:
            return Verdict("failed", AMBIGUOUS)
        way = found.moves or self._way_out(q, size)
        self.equation.sides = friction.sides(q, way)
        return None

    def _at_rest(self) -> Verdict:
        if self.request.until.goal == "time":
            self._wait(self.t_max)
            return Verdict("reached", "time")
        return Verdict("ended" if self.pieces else "rest", REST)

    def _wait(self, t: float) -> None:
        self._took(t, self.y, Resting(self.y.copy()))

    def _holding(self, q: float, size: float) -> Callable[[float], float]:
        """Time -> positive where the loads push beyond what friction holds."""
        friction = self.system.friction
        assert friction is not None

        def beyond(t: float) -> float:
            low, high = friction.rest(q, t, size).holding
            return max(low, -high)

        return beyond

    def _leaves(self, q: float, size: float) -> float | None:
        """First time [s] at which loads of the time move the driver again, or None."""
        if "time" not in self.system.depends_on:
            return None
        period = loads.time_periods(self.system.compiled.structure)
        shortest = min(period, default=0.0)
        latest = self.t_max
        if latest >= FOREVER:
            latest = self.t + max(period, default=1.0)
        step = shortest / WAITING if shortest else (latest - self.t) / WAITING
        beyond = self._holding(q, size)
        marks = np.union1d(np.arange(self.t, latest, step), [latest, *self.knots])
        marks = marks[(marks >= self.t) & (marks <= latest)]
        for a, b in pairwise(marks.tolist()):
            if beyond(b) > 0:
                return b if beyond(a) >= 0 else float(brentq(beyond, a, b, xtol=EPS, rtol=4 * EPS))
        return None

    def _way_out(self, q: float, size: float) -> int:
        """The direction in which a driver starts that friction just does not hold any more."""
        friction = self.system.friction
        assert friction is not None
        low, high = friction.rest(q, self.t, size).holding
        return -1 if low > -high else 1


# -- the method ----------------------------------------------------------------------------


def in_time(system: System, request: SimulationRequest, method: str) -> Motion:
    """The motion by an integrator, with its estimated error."""
    target = request.accuracy or TARGET
    runs, longest = 0, math.inf

    def run(tolerance: float) -> Motion:
        nonlocal runs, longest
        runs += 1
        name = method if runs == 1 else f"{method}, run {runs}"
        one = Run(system, request, method, tolerance, name, target, SHORTER * longest)
        motion = one.motion()
        longest = one.longest or math.inf
        return motion

    def finer(tolerance: float, apart: float) -> float | None:
        if tolerance <= FLOOR:
            return None
        share = 1 / FINER if not math.isfinite(apart) else min(1 / FINER, 0.3 * target / apart)
        return max(tolerance * share, FLOOR)

    found = refined(run, max(target / 10, FLOOR * FINER), finer, target, request.times)
    found = missed(found, target)
    return replace(found, method=method)
