r"""Steps in time over one smooth segment, to the first event that ends it.

A solver's word that it succeeded is not taken: the state is looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import InitVar, dataclass, field

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.ends import RunEnd
from blockmech.dynamics.equation import AHEAD, Equation, classify_obstacle
from blockmech.dynamics.estimate import FLOOR
from blockmech.dynamics.events import PARTS, EventDetector, EventHit, until_terminal
from blockmech.dynamics.run import EVALUATIONS, GUESSED_AT, HOPELESS, REMEDY
from blockmech.dynamics.solvers import NO_PLAN, STEPPERS, AcceptedSteps, AdaptiveSolver, Solver
from blockmech.dynamics.stick_slip import StickSlip
from blockmech.ground.plane import EPS
from blockmech.result.motion import Event
from blockmech.typing import Floats, Real

# Kinds of events that a motion does not list.
SILENT = ends.KINK, ends.GOAL, ends.WHOLE_TURN, ends.RELEASED, *ends.KINKS


@dataclass
class Integration(StickSlip):
    """A run in time at one tolerance, or with one step, under way: where it is, and its steps.

    The steps of a run that came ``before`` are its plan: none is longer than half of those.
    """

    method: str
    tolerance: float
    name: str  # for those who follow the progress
    rest: float  # [rad or m]: a swing shorter than this is none
    before: InitVar[Integration | None] = None
    step: float = math.nan  # [s], or [rad or m] of euler_q, of the schemes of fixed steps
    finer: float | None = None  # tolerance of a run that comes after this
    patient: bool = True  # whether too many steps are made before they are known to be
    leaves: Callable[[Real], bool] | None = None  # whether other joints should lead at coordinates
    scales: Floats | None = field(init=False, default=None)  # sizes of the state's components
    energy: float | None = field(init=False, default=None)  # [J] where it starts
    moves: bool = field(init=False, default=False)  # whether any step was made: it may also wait
    turned: float = field(init=False, default=0.0)  # [J] largest work on the way

    def __post_init__(self, before: Integration | None) -> None:
        q, rate, self.t = self.request.start
        self.times, self.grid = [self.t], [self.t]  # [s] where steps begin, and the last ends
        self.method_asked = self.method
        if before is None:
            self.plan, self.equation = NO_PLAN, Equation(self.system, q)
        else:
            self.plan, self.equation = np.array(before.grid), before.equation.again()
            self.scales, self.energy = before.scales, before.energy
        times = HOPELESS if self.system.remembers and self.system.quick_states else 1
        self.equation.limit = EVALUATIONS * times * (1 if before is None else 2)
        if self.method == "rk4" and self.request.until.goal == "time":
            self.equation.limit = math.inf  # its steps are counted beforehand
        self.layout = self.equation.layout
        self.y = self.layout.start(q, rate)
        self.t_max = self.request.start.t + min(self.request.span, 1 / EPS)  # goals without a time

    def solver(self, t: float, y: Floats, bound: float) -> Solver:
        """Steps of the method from a state up to a time [s]."""
        about = self.equation, t, y, bound
        if self.method in STEPPERS:
            return STEPPERS[self.method](*about, self.step)
        first = self.finer is not None and self.method == "dop853" and t == self.request.start.t
        finer = self.tolerances(self.finer or 0.0) if first else None
        tolerances = self.tolerances(self.tolerance)
        return AdaptiveSolver(*about, self.method, tolerances, self.plan, finer)

    def tolerances(self, tolerance: float) -> Floats:
        """Relative and absolute ones (2, n) of the components of the state."""
        assert self.scales is not None
        relative = np.full(self.layout.size, max(tolerance, FLOOR))
        relative[self.layout.q] = FLOOR
        return np.array([relative, tolerance * self.scales])

    def integrate(
        self, bound: float, lookout: EventDetector, user_events: EventDetector
    ) -> EventHit | RunEnd | None:
        """Go on to a terminal event, the bound (None), or where the solver gives up.

        user_events : looks for those of a user
        """
        if not all(map(math.isfinite, self.equation(self.t, self.y))):  # no solver would come back
            return self.give_up()
        solver = self.solver(self.t, self.y, bound)
        every = any(rule.terminal for rule in lookout.rules if rule.kind == ends.STANDSTILL)
        while solver.t < bound:
            steps = solver.steps(lookout.free_range(float(solver.y[0])), every)
            if steps is None:
                return self.give_up()
            if steps.t[-1] > steps.t[0] and (hit := self._over(steps, lookout, user_events, bound)):
                return hit
            if self.leaves is not None and self.leaves(self.y[self.layout.q]):
                return RunEnd(ends.LEAVES_CHART)
        return None

    def _over(
        self, steps: AcceptedSteps, lookout: EventDetector, user_events: EventDetector, bound: float
    ) -> EventHit | None:
        """Go over steps, to the first terminal event in them."""
        hits_in = user_events.within(*steps[:3])
        standing, m = lookout.of(ends.STANDSTILL) if steps.turns else lookout, len(steps.t) - 1
        for i in steps.turns:
            hits_in += standing.within(*steps.part(i, i + 1)[:3])
        for i in range(steps.calm, m):
            hits_in += (hits := lookout.within(*steps.part(i, i + 1)[:3]))
            if any(hit.rule.terminal for hit in hits):
                break
        hits = until_terminal(hits_in)
        if not (hits and hits[-1].rule.terminal):
            self.note(hits, steps.dense)
            self.take(steps)
            return None
        self.note(hits[:-1], steps.dense)
        i = max(int(np.searchsorted(steps.t, hits[-1].t)) - 1, 0)
        if i:
            self.take(steps.part(0, i))
        for exact in self._exactly(hits[-1], steps.part(i, i + 1), bound):
            self.take(exact)
        last = hits[-1]._replace(t=self.t)
        self.note([last], lambda t: self.y)
        return last

    def _exactly(self, hit: EventHit, step: AcceptedSteps, bound: float) -> list[AcceptedSteps]:
        """Steps that end at an event in a step.

        The step beyond it is coarser in between, and has seen what a kink is for.
        """
        t, t0, steps = hit.t, float(step.t[0]), list[AcceptedSteps]()
        coarse = [step.until(t, step.dense(t))]
        if not t > t0:
            return coarse
        solver = self.solver(t0, step.y[0], t)
        while solver.t < t:
            next_steps = solver.steps()
            if next_steps is None:
                return coarse
            steps.append(next_steps)
        y = np.array(solver.y)
        slope, lead = np.asarray(self.equation(t, y), dtype=np.float64), AHEAD * (t - t0)
        value = hit.rule.value(t, y)
        rise = (hit.rule.value(t + lead, y + lead * slope) - value) / lead
        late = min(-value / rise, bound - t) if rise else math.nan
        moved = y + late * slope
        is_close = abs(late) <= (t - t0) / PARTS and np.isfinite(moved).all()
        is_regular = hit.rule.parts > 1 and is_close
        return [*steps[:-1], steps[-1].until(t + late, moved)] if is_regular else steps

    def take(self, steps: AcceptedSteps) -> None:
        """Go on over steps."""
        self.t, self.y = float(steps.t[-1]), np.array(steps.y[-1])
        if self.t > self.times[-1]:
            self.times.append(self.t)
            self.pieces.append(steps.dense)
        self._refuse_stiff()
        self.moves |= bool(steps.t[-1] > steps.t[0])
        self.grid += [t for t in steps.t[1:].tolist() if t > self.grid[-1]]
        self.turned = max(self.turned, float(np.abs(steps.y[1:, self.layout.work]).max()))
        if self.system.progress is not None:
            self.system.progress(self.name, *self._progress())

    def _refuse_stiff(self) -> None:
        """Give up early where the motion is too stiff for an explicit method.

        Bristles in a fast slip forget in so short a time all along, so what is done so far tells;
        of others it is a guess, where another method may go on: that gives up where it is far off.
        """
        if self.patient and not (self.system.remembers and self.method == "dop853"):
            return
        spent, start = self.equation.spent, self.request.start.t
        if self.request.until.goal == "time" and spent > GUESSED_AT:
            projected = spent * (self.t_max - start) / (self.t - start)
            if projected > self.equation.limit * (1 if self.method == "dop853" else HOPELESS):
                evaluations = f"{spent} evaluations of {self.equation.limit}"
                self.notes.append(f"{evaluations} reach {self.t:.3g} s: {REMEDY}")
                raise ends.TooMany

    def _progress(self) -> tuple[float, float | None]:
        """How far the run is on the way to its goal, and the whole way."""
        until = self.request.until
        travel = abs(float(self.y[0]) - float(np.atleast_1d(self.request.start.q)[0]))
        if until.goal == "turns":
            return travel / math.tau, until.value
        if until.goal == "angle":
            return travel, abs(until.value - float(self.request.start.q))
        return self.t - self.request.start.t, until.value if until.goal == "time" else None

    def note(self, hits: list[EventHit], dense: Callable[[Real], Floats]) -> None:
        """List events."""
        for hit in hits:
            if hit.rule.kind in (*SILENT, *[ends.REVERSAL] * (not self.layout.scalar)):
                continue
            y = np.array(dense(hit.t))
            if hit.rule.kind == ends.STANDSTILL:
                y[1] = 0.0
            q, qd = self.layout.motion(y)
            self.events.append(Event(hit.rule.kind, float(hit.t), q, qd))

    def give_up(self) -> RunEnd | None:
        """Why the run is over where a solver gave up; None if another one goes on."""
        if self.method != "dop853":
            self.method = "dop853"  # which comes as near as one can to where there is no pose
            self.equation.limit = min(self.equation.limit, self.equation.spent + EVALUATIONS)
            return None
        end, status, remaining_time, *_ = classify_obstacle(self.equation, self.t, self.y)
        locked = end == ends.SELF_LOCKED and not self.pieces
        return self.short_of(end, remaining_time, "failed" if locked else status)
