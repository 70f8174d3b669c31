r"""Motions integrated in time by SciPy's integrators, or in the textbooks' fixed steps.

An integration goes in segments, each with a smooth right-hand side (`equation`): kinks of loads
and reversals of pairs with friction end one. A solver's word that it succeeded is not taken:
the state is looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.integrate import LSODA, OdeSolution, Radau

from blockmech.dynamics import ends, loads
from blockmech.dynamics.dop853 import Dop853, Step, between
from blockmech.dynamics.equation import Equation, TooMany, scales
from blockmech.dynamics.estimate import COMPARED, TARGET, refined, with_rounding
from blockmech.dynamics.events import (
    PARTS,
    EventRule,
    Hit,
    Lookout,
    friction_rules,
    general_rules,
    kink_rules,
)
from blockmech.dynamics.fixed_steps import (
    STEP,
    EulerQ,
    RungeKutta4,
    checked_step,
    judged_by_half,
)
from blockmech.dynamics.motion import EVALUATIONS, Event, Floats, Motion, State, Status, Still
from blockmech.dynamics.quiet import looked_over
from blockmech.dynamics.request import SimulationRequest
from blockmech.dynamics.rest import released
from blockmech.dynamics.singular import AHEAD, PAST, End, time_left, what_is_ahead
from blockmech.plane import EPS

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

SOLVERS = {"dop853": Dop853, "lsoda": LSODA, "radau": Radau}
STEPPERS = {"rk4": RungeKutta4, "euler_q": EulerQ}
FLOOR = 100 * EPS  # the least relative tolerance that SciPy takes
FINER = 20.0  # a second run is so much finer (numerics 14)
SHORTER = FINER ** (-1 / 8)  # its longest step, at order 8: equal steps would show no error
FOREVER = 1 / EPS  # [s] for goals without a time


class Verdict(NamedTuple):
    """Why a run is over."""

    status: Status
    end: str


class Taken(NamedTuple):
    """A step of SciPy's solvers and its dense output."""

    t_old: float
    t: float
    y: Floats
    dense: Callable[[Any], Any]

    def __call__(self, t: Any) -> Floats:
        """States (n, ...) at times."""
        return np.asarray(self.dense(t))


@dataclass(frozen=True)
class Steps:
    """Dense output of a run: that of its steps, one after the other."""

    drivers: int
    solution: OdeSolution

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        y, k = self._at(t), self.drivers
        return State(y[0], y[1]) if k == 1 else State(y[:k].T, y[k : 2 * k].T)

    def _at(self, t: Floats) -> Floats:
        times, pieces = self.solution.ts, self.solution.interpolants
        which = np.clip(np.searchsorted(times, t) - 1, 0, len(pieces) - 1)
        steps = [pieces[i] for i in which.tolist()]
        at_once = steps and all(isinstance(step, Step) for step in steps)
        return between(steps, t[:, None])[..., 0].T if at_once else np.asarray(self.solution(t))


@dataclass
class Run:
    """One integration at one tolerance, or with one step, under way."""

    system: System
    request: SimulationRequest
    method: str
    tolerance: float
    name: str  # told to those who follow the progress
    rest: float  # [rad or m]: a swing shorter than this is none
    max_step: float = math.inf  # [s]
    step: float = math.nan  # [s], or [rad or m] of euler_q, of the schemes of fixed steps
    longest: float = 0.0  # [s] step so far
    t: float = 0.0
    y: Floats = field(default_factory=lambda: np.empty(0))
    times: list[float] = field(default_factory=list)
    pieces: list[Any] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    facts: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    standstills: int = 0
    fired: EventRule | None = None
    turned: float = 0.0  # [J] largest work on the way
    left: float = 0.0  # [s] to a singular place that the run stops short of

    def __post_init__(self) -> None:
        q, rate, self.t = self.request.start
        rubs = self.system.friction is not None
        works = [0.0, 0.0] if rubs else [0.0]
        self.y = np.concatenate([np.atleast_1d(q), np.atleast_1d(rate), works]).astype(float)
        self.times.append(self.t)
        self.equation = Equation(self.system, q, EVALUATIONS)
        if self.method == "rk4" and self.request.until.goal == "time":
            self.equation.most = math.inf  # its steps are counted beforehand
        self.t_max = self.request.start.t + min(self.request.span, FOREVER)
        self.swing_from = float(self.y[0])
        self.asked = self.method

    # -- the whole -------------------------------------------------------------------------

    def motion(self) -> Motion:
        """Integrate until the goal or whatever ends the motion before."""
        start = self.y
        try:
            verdict = self._begun()
            self.scales = scales(self.equation, self.t, self.y)
            while verdict is None:
                verdict = self._segment()
        except KeyboardInterrupt:  # what is done so far is kept
            verdict = Verdict("ended", ends.INTERRUPTED)
        except TooMany:
            verdict = Verdict("failed", ends.TOO_MANY)
        return self._told(start, verdict)

    def _told(self, start: Floats, verdict: Verdict) -> Motion:
        k, y = self.equation.drivers, self.y
        q, qd = (float(y[0]), float(y[1])) if k == 1 else (y[:k], y[k : 2 * k])
        self._balance(start)
        if self.asked == "euler_q" and self.method != self.asked:  # so near it comes itself
            self.left += self.longest
        if verdict.end in (ends.SELF_LOCKED, ends.AMBIGUOUS):
            self.notes.append(f"{verdict.end}: t = {self.t:.9g} s, q = {q:.9g}, rate = {qd:.9g}")
        if self.method != self.asked and verdict.status == "reached":
            self.notes.append(f"{self.asked} gave up on the way, {self.method} went on")
        solution = OdeSolution(self.times, self.pieces) if self.pieces else None
        fixed = self.asked in STEPPERS
        return replace(
            self.request.standing,
            method=self.asked,
            regime="fixed steps" if fixed else "rest" if verdict.end == ends.REST else "integrated",
            status=verdict.status,
            end=verdict.end,
            t_end=self.t,
            q_end=q,
            qd_end=qd,
            track=Still(q, qd) if solution is None else Steps(k, solution),
            events=tuple(self.events),
            error=math.inf,
            time_error=2 * self.left,
            cost=self.system.cost,
            engine=self.system.engine_of_states.name,
            notes=tuple(self.notes),
            facts=self.facts | ({} if fixed else {"tolerance": self.tolerance}),
        )

    def _balance(self, start: Floats) -> None:
        """What the work of loads and friction leaves unexplained of the kinetic energy."""
        k = self.equation.drivers
        worked, *rubbed = self.y[2 * k :].tolist()
        if rubbed:
            self.facts["friction_work"] = rubbed[0]
        if self.pieces:
            before, after = self.equation.kinetic(start), self.equation.kinetic(self.y)
            whole = max(before, after, self.turned)
            balance = abs(after - before - worked + sum(rubbed)) / whole if whole > 0 else 0.0
            if math.isfinite(balance):
                self.facts["energy_balance"] = balance

    # -- segments --------------------------------------------------------------------------

    def _begun(self) -> Verdict | None:
        """Settle directions of slip at the start."""
        if self.system.friction is None:
            return None
        if self.y[1] == 0.0:
            return self._from_rest()
        self.equation.sides = self._sides()
        return None

    def _sides(self) -> tuple[int, ...]:
        assert self.system.friction is not None
        return self.system.friction.sides(float(self.y[0]), 1 if self.y[1] > 0 else -1)

    def _rules(self) -> list[EventRule]:
        equation, system = self.equation, self.system
        rules = general_rules(system, self.request, equation.closeness)
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
        structure = self.system.compiled.structure
        bound = min(self.t_max, loads.next_time_kink(structure, self.t))
        parts = 1 if self.method in STEPPERS else PARTS
        spans = [self.system.span]
        if self.equation.drivers > 1:
            length = loads.largest_length
            spans = [math.tau if turns else length(structure) for turns in self.system.rotary]
        lookout = Lookout.at(self._rules(), parts, spans, self.t, self.y, self._happened())
        self.fired = None
        hit = self._integrated(lookout, bound)
        if isinstance(hit, Verdict):
            return hit
        return None if hit is None else self._met(hit)

    def _happened(self) -> set[tuple[str, int]]:
        """Events (kind, index) at this very place: several pairs may reverse at once."""
        friction, fired = self.system.friction, self.fired
        found = set() if fired is None else {(fired.kind, fired.index)}
        if friction is not None:
            found |= {(ends.REVERSAL, j) for j in friction.reversing(float(self.y[0]))}
        return found

    def _solver(self, bound: float, t: float, y: Floats, longest: float) -> Any:
        if self.method in STEPPERS:
            return STEPPERS[self.method](self.equation, t, y, bound, self.step)
        k, (speed, work) = self.equation.drivers, self.scales
        tol = self.tolerance
        rtol: Any = max(tol, FLOOR)
        if self.method != "radau":  # SciPy's takes one number only
            rtol = np.array([FLOOR] * k + [rtol] * (y.size - k))
        atol = np.array([tol] * k + [tol * speed] * k + [tol * work] * (y.size - 2 * k))
        solver = SOLVERS[self.method](
            self.equation, t, y, bound, rtol=rtol, atol=atol, max_step=longest
        )
        if self.method == "radau":
            # SciPy's iterates to 10 EPS, every step to the same side: no finer run would show it.
            # This falls with the tolerance, to 10 EPS at the finest.
            solver.newton_tol = max(solver.newton_tol, math.sqrt(EPS / rtol))
        return solver

    def _stepped(self, solver: Any) -> Sequence[Any]:
        """One more step, or some of them at once by machine code; empty where there is none."""
        try:
            with np.errstate(all="ignore"):
                if self.method == "dop853" and (found := solver.steps()):
                    return list(found)
                solver.step()
                self.equation.closeness(solver.y)
                good = solver.status != "failed" and np.isfinite(solver.y).all()
                step = solver.t_old, solver.t, solver.y
                return [Taken(*step, solver.dense_output())] if good else []
        except (ValueError, ArithmeticError, np.linalg.LinAlgError):
            return []

    def _integrated(self, lookout: Lookout, bound: float) -> Hit | Verdict | None:
        """Steps up to a terminal event, the bound (None), or where the solver gives up."""
        slope = np.asarray(self.equation(self.t, self.y), dtype=np.float64)
        if not np.isfinite(slope).all():  # from which SciPy's would never come back
            return self._given_up()
        solver = self._solver(bound, self.t, self.y, self.max_step)
        while solver.status == "running":
            steps = self._stepped(solver)
            if not steps:
                return self._given_up()
            met = self._over(steps, lookout) if solver.t > solver.t_old else None
            if met is not None:
                return met
        return None

    def _over(self, steps: Sequence[Any], lookout: Lookout) -> Hit | None:
        """Go over steps, to the first terminal event in them."""
        doubtful, first = [0], 0
        if len(steps) > 1:
            doubtful, states, values = looked_over(lookout, steps)
        for i in (*doubtful, len(steps)):
            if i > first:  # nothing happens up to there
                self._took(steps[i - 1].t, steps[i - 1].y, *steps[first:i])
                lookout.y, lookout.values = states[:, i], values[:, i].tolist()
            for step in steps[i : i + 1]:
                hits = lookout.in_step(step.t_old, step.t, step.y, step)
                self._note(hits, step)
                if hits and hits[-1].rule.terminal:
                    self._took(*self._exactly(hits[-1], step.t_old, self.y, step))
                    return hits[-1]
                self._took(step.t, step.y, step)
            first = i + 1
        return None

    def _exactly(self, hit: Hit, t0: float, y0: Floats, dense: Any) -> tuple[Any, ...]:
        """Time and state of an event, and steps that end there.

        The step beyond it is coarser in between, and has seen what a kink is for.
        """
        t, there, steps = hit.t, np.asarray(dense(hit.t)), list[Any]()
        if not t > t0:
            return t, there, dense
        finer = math.isfinite(self.max_step)  # not the one step of the coarser run again
        solver = self._solver(t, t0, y0, SHORTER * (t - t0) if finer else math.inf)
        while solver.status == "running":
            more = self._stepped(solver)
            if not more:
                return t, there, dense
            steps += more
        y = np.array(solver.y)
        slope, ahead = np.asarray(self.equation(t, y), dtype=np.float64), AHEAD * (t - t0)
        here = hit.rule.value(t, y)
        rise = (hit.rule.value(t + ahead, y + ahead * slope) - here) / ahead
        late = min(-here / rise, dense.t - t) if rise else math.nan  # not beyond its step
        moved = y + late * slope
        known = hit.rule.parts > 1 and abs(late) <= (t - t0) / PARTS and np.isfinite(moved).all()
        return (t + late, moved, *steps) if known else (t, y, *steps)

    def _took(self, t: float, y: Floats, *steps: Any) -> None:
        """Go on to a state, over steps of which an event may cut off the last."""
        if t > self.times[-1]:
            self.times += [*(step.t for step in steps[:-1]), float(t)]
            self.pieces += steps
        self.longest = max(self.longest, *(min(step.t, t) - step.t_old for step in steps))
        self.t, self.y, work = float(t), np.array(y), 2 * self.equation.drivers
        self.turned = max(
            self.turned, *(abs(float(x[work])) for x in (*(s.y for s in steps[:-1]), y))
        )
        if self.system.progress is not None:
            self.system.progress(self.name, *self._far())

    def _far(self) -> tuple[float, float | None]:
        """How far the run is on the way to its goal, and the whole way."""
        goal, value = self.request.until.goal, self.request.until.value
        q0 = float(np.atleast_1d(self.request.start.q)[0])
        if goal == "turns":
            return abs(float(self.y[0]) - q0) / math.tau, value
        if goal == "angle":
            return abs(float(self.y[0]) - q0), abs(value - q0)
        return self.t - self.request.start.t, value if goal == "time" else None

    def _note(self, hits: list[Hit], dense: Any) -> None:
        k = self.equation.drivers
        for hit in hits:
            if hit.rule.kind in (ends.KINK, ends.GOAL, ends.GUIDE_SIDE):
                continue
            y = np.array(dense(hit.t))
            if hit.rule.kind == ends.STANDSTILL:
                y[1] = 0.0
            q, qd = (float(y[0]), float(y[1])) if k == 1 else (y[:k], y[k : 2 * k])
            self.events.append(Event(hit.rule.kind, float(hit.t), q, qd))

    # -- what was met ----------------------------------------------------------------------

    def _met(self, hit: Hit) -> Verdict | None:
        """Why the run is over by the event that ended a segment, or None."""
        rule = self.fired = hit.rule
        if rule.kind == ends.KINK:
            self._past_kink()
        elif rule.kind == ends.REVERSAL:  # and whatever pairs reverse at the same place
            old, beyond = self.equation.sides[rule.index], self._sides()
            self.equation.sides = tuple(
                -old if i == rule.index else s for i, s in enumerate(beyond)
            )
        elif rule.kind == ends.STANDSTILL:
            return self._stood()
        elif rule.kind in (ends.DEAD_CENTRE, ends.NO_INERTIA):
            q, qd = float(self.y[0]), float(self.y[1])
            left = time_left(self.system, rule.kind, q, qd)
            return Verdict("ended", self._met_end(End(rule.kind, left)))
        elif rule.kind == ends.GOAL:
            return Verdict("reached", self.request.until.goal)
        elif rule.kind != ends.GUIDE_SIDE:
            own = any(rule.kind == w.name and w.terminal for w in self.request.watch)
            return Verdict("reached" if own else "ended", rule.kind)
        return None

    def _stood(self) -> Verdict | None:
        self.y[1] = 0.0
        self.standstills += 1
        swing, self.swing_from = abs(float(self.y[0]) - self.swing_from), float(self.y[0])
        if self.standstills >= self.request.standstills:
            return Verdict("reached", self.request.until.goal)
        if self.system.friction is not None:
            return self._from_rest()
        counted = self.request.standstills < math.inf
        return Verdict("ended", ends.REST) if counted and swing <= self.rest else None

    def _past_kink(self) -> None:
        """Go on to the far side of a kink, if there is one: else the load ends there.

        On the kink itself a load that jumps may be the one before.
        """
        q, rate = float(self.y[0]), float(self.y[1])
        way = PAST * max(1.0, abs(q))
        if not abs(rate) * (self.t_max - self.t) > way:
            return
        there, t = self.y.copy(), self.t + way / abs(rate)
        there[0] = q + math.copysign(way, rate)
        if np.isfinite(self.equation(t, there)).all():
            self.y, self.t = there, t

    def _from_rest(self) -> Verdict | None:
        """Which way a driver at rest with friction starts; what ends the run if it does not."""
        friction, q = self.system.friction, float(self.y[0])
        assert friction is not None
        found = friction.rest(q, self.t, self.system.load_size(q))
        low, high = found.holding
        if found.ambiguous:
            return Verdict("failed", ends.AMBIGUOUS)
        if found.rests:
            self.events.append(Event(ends.REST, self.t, q, 0.0))
            self.facts |= {"holding_low": low, "holding_high": high}
            span = self.request.span
            until, (low, high) = released(self.system, q, self.t, self.request.start.t + span)
            if until is None and span == math.inf:
                return Verdict("ended" if self.pieces else "rest", ends.REST)
            until = self.t_max if until is None else until
            still = self.y.copy()
            held = Taken(until, until, still, lambda t: np.multiply.outer(still, np.ones_like(t)))
            self._took(until, still, held)
        self.equation.sides = friction.sides(q, 1 if -high >= low else -1)
        return None

    def _given_up(self) -> Verdict | None:
        """Why the run is over where a solver gave up; None if another one goes on."""
        if self.method != "dop853":
            self.method = "dop853"  # which comes as near as one can to where there is no pose
            return None
        end = self._met_end(what_is_ahead(self.equation, self.t, self.y))
        known = end in (ends.DEAD_CENTRE, ends.IMPOSSIBLE) or (
            end == ends.SELF_LOCKED and self.pieces
        )
        return Verdict("ended" if known else "failed", end)

    def _met_end(self, end: End) -> str:
        """Keep what is known of an end that the run stops short of."""
        self.left = end.left
        if end.kind in (ends.DEAD_CENTRE, ends.NO_INERTIA) and math.isfinite(end.left):
            self.facts[f"{end.kind.replace(' ', '_')}_time"] = self.t + end.left
        return end.kind


# -- the methods ---------------------------------------------------------------------------


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
        share = min(1 / FINER, 0.3 * target / apart) if 0 < apart < math.inf else 1 / FINER
        return max(tolerance * share, FLOOR)

    first = max(target / 10, FLOOR * FINER)
    found = refined(run, first, finer, target, system.rotary, request.times)
    return with_rounding(system, found, target)


def in_fixed_steps(system: System, request: SimulationRequest, method: str) -> Motion:
    """The motion by a scheme of the textbooks, its error told by a second run of half the step."""
    if method == "rk4":
        whole = request.span
        step = request.step or 5 * STEP * (whole if math.isfinite(whole) else 1.0)
        unit = "time_step"
    else:
        whole = max((abs(q - request.start.q) for q in request.places), default=math.inf)
        step = request.step or STEP * (1.0 if system.rotary[0] else system.span)
        unit = "coordinate_step"
    checked_step(step, whole)

    def run(h: float) -> Motion:
        motion = Run(system, request, method, TARGET, method, 0.0, step=h).motion()
        return replace(motion, facts={**motion.facts, unit: h})

    def way(motion: Motion) -> float:
        if method == "rk4":
            return motion.t_end - motion.t_start
        return float(np.ptp(motion.at(motion.times(COMPARED)).q))

    found = judged_by_half(request, system.rotary, step, run, way)
    return with_rounding(system, found, request.accuracy)
