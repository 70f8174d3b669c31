r"""Motions integrated in time by SciPy's integrators, or in the textbooks' fixed steps.

An integration goes in segments, each with a smooth right-hand side (`equation`): kinks of loads
and reversals of pairs with friction end one. A solver's word that it succeeded is not taken:
the state is looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import InitVar, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.dynamics import ends, loads
from blockmech.dynamics.equation import Equation, scales
from blockmech.dynamics.estimate import (
    CORNERED,
    FINER,
    FLOOR,
    LEAST,
    SMOOTH,
    TARGET,
    UNFINISHED,
    halved,
    refined,
)
from blockmech.dynamics.events import (
    PARTS,
    EventDetector,
    EventFunction,
    EventHit,
    driver_at,
    general_rules,
    kink_rules,
    signal_rules,
    turned,
    until_terminal,
)
from blockmech.dynamics.jolt import jolt_of
from blockmech.dynamics.layout import StateLayout
from blockmech.dynamics.request import SimulationRequest, Watch
from blockmech.dynamics.roles import Roles
from blockmech.dynamics.run import EVALUATIONS, GUESSED_AT, HOPELESS, Run, RunEnd
from blockmech.dynamics.singular import AHEAD, PAST, time_left, what_is_ahead
from blockmech.dynamics.solvers import NO_PLAN, AcceptedSteps, Dop853, MachineSteps, Radau5
from blockmech.dynamics.stick_slip import Now, StickSlip, Transition
from blockmech.dynamics.turns import TurnsInTime
from blockmech.engines.dense import Dense
from blockmech.ground.plane import EPS
from blockmech.result.motion import Event, Floats, Impact, Motion, RolesFrom, Slips, State, Still
from blockmech.signals.contract import at_once

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

SOLVERS = {"dop853": Dop853, "radau": Radau5}
FIXED = ("rk4", "euler_q")  # steps of the textbooks
QUICKER = 8  # times as many states may a friction law with a state ask of machine code
CHAIN, CREEP = 4, 1e-6  # blocks in a row that a push may come through; [s] of a step of each
ANYWHERE = (-math.inf, math.inf)
SILENT = frozenset(
    {
        ends.KINK,
        ends.GOAL,
        ends.WHOLE_TURN,
        ends.GUIDE_SIDE,
        ends.SIGNAL_KINK,
        ends.RELEASED,
        ends.DEFLECTION_KINK,
    }
)  # kinds of events that a motion does not list


@dataclass(frozen=True)
class Steps:
    """Dense output of a run: that of its steps, one after the other."""

    layout: StateLayout
    solution: Callable[[Floats], Floats]
    roles: tuple[tuple[float, Roles], ...] = ()  # from times [s] on
    jolts: tuple[Impact, ...] = ()
    standstills: tuple[float, ...] = ()  # [s] of the only driver

    @classmethod
    def of(
        cls, layout: StateLayout, times: Sequence[float], pieces: Sequence[Any], *more: Any
    ) -> Steps:
        """From pieces, each from one of the times [s] to the next."""
        if all(isinstance(piece, Dense) for piece in pieces):
            return cls(layout, Dense.joined(times, pieces), *more)
        from scipy.integrate import OdeSolution

        return cls(layout, OdeSolution(times, pieces), *more)

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]; of drivers with a law as that says, and after jolts."""
        y, at = np.asarray(self.solution(t)), self.layout
        if at.drivers == 1:
            still = np.isin(t, self.standstills) if self.standstills else False
            return State(y[0], np.where(still, 0.0, y[1]))
        q, rate = y[at.q].T, y[at.rate].T
        if self.roles:
            which = np.searchsorted([begin for begin, _ in self.roles], t, "right") - 1
            for i, (_, roles) in enumerate(self.roles):
                some = np.maximum(which, 0) == i
                q[some], rate[some] = roles.motion(q[some], rate[some], t[some])
            for jolt in self.jolts:
                rate[t == jolt.t] = jolt.after
        return State(q, rate)

    def signal_states(self, t: Floats) -> Floats:
        """States (m, n) of signal blocks at times (m,) [s]."""
        return np.asarray(self.solution(t))[self.layout.signals].T


@dataclass
class TimeIntegration(Run):
    """One integration at one tolerance, or with one step, under way."""

    method: str
    tolerance: float
    name: str  # for those who follow the progress
    rest: float  # [rad or m]: a swing shorter than this is none
    before: InitVar[TimeIntegration | None] = None  # a run of the same by twice the steps
    step: float = math.nan  # [s], or [rad or m] of euler_q, of the schemes of fixed steps
    finer: float | None = None  # tolerance of a run that comes after this
    patient: bool = True  # whether too many steps are made before they are known to be
    leaves: Callable[[Any], bool] | None = None  # whether other joints should lead at coordinates
    scales: Floats | None = None  # typical sizes of the state's components, for the tolerances
    energy: float | None = None  # [J] where it starts
    grid: list[float] = field(default_factory=list)  # [s] where steps begin, and the last ends
    moves: bool = False  # whether any step was made: it may also wait at rest
    bound: float = math.inf  # [s] of the segment
    y: Floats = field(default_factory=lambda: np.empty(0))
    times: list[float] = field(default_factory=list)
    pieces: list[Any] = field(default_factory=list)
    slips: list[Slips] = field(default_factory=list)
    roles: list[tuple[float, Roles]] = field(default_factory=list)  # from times [s] on
    jolts: list[Impact] = field(default_factory=list)  # of changes of roles
    fired: EventFunction | None = None
    turns: TurnsInTime | None = None  # where a goal may never be reached
    turned: float = 0.0  # [J] largest work on the way

    def __post_init__(self, before: TimeIntegration | None) -> None:
        q, rate, self.t = self.request.start
        self.times.append(self.t)
        self.grid.append(self.t)
        self.plan = NO_PLAN if before is None else np.array(before.grid)
        self.system.roles = self.request.roles
        if self.request.roles is not None:
            self.roles.append((self.t, self.request.roles))
        if before is None:
            self.equation = Equation(self.system, q)
            how = self.equation.closeness, self.equation.stop_force
            self.general = general_rules(self.system, self.request, *how)
        else:
            self.equation, self.general = before.equation.again(), before.general
            self.scales, self.energy = before.scales, before.energy
        quick = self.system.remembers and self.system.quick_states
        self.equation.most = EVALUATIONS * (QUICKER if quick else 1) * (1 if before is None else 2)
        self.pairs = StickSlip(self.equation, self.request)
        self.layout = self.equation.layout
        if self.system.counted is not None:
            self.system.counted.again()
        self.y = self.layout.start(q, rate)
        self.switched = self.request.switched  # when discrete signal blocks switched last
        if self.method == "rk4" and self.request.until.goal == "time":
            self.equation.most = math.inf  # its steps are counted beforehand
        self.t_max = self.request.start.t + min(self.request.span, 1 / EPS)  # goals without a time
        self.swing_from = float(self.y[0])
        self.method_wanted = self.method

    # -- the whole -------------------------------------------------------------------------

    def motion(self) -> Motion:
        """Integrate until the goal or whatever ends the motion before."""
        start = self.y
        self.run()
        assert self.over is not None
        end, status = self.over.end, self.over.status
        q, qd = self.layout.motion(self.y)
        self._balance(start)
        if end in (ends.SELF_LOCKED, ends.AMBIGUOUS):
            where = (", ".join(f"{x:.9g}" for x in np.atleast_1d(part)) for part in (q, qd))
            at = "t = {:.9g} s, q = {}, rate = {}".format(self.t, *where)
            self.notes.append(f"{end}: {at}")
        if self.method != self.method_wanted and status == "reached":
            self.notes.append(f"{self.method_wanted} gave up on the way, {self.method} went on")
        fixed = self.method_wanted in FIXED
        if not (fixed or self.stands):
            self.facts["tolerance"] = self.tolerance
        rests = end == ends.REST or self.stands
        motion = self.result(
            method=self.method_wanted,
            regime="fixed steps" if fixed else "rest" if rests else "integrated",
            t_end=self.t,
            q_end=q,
            qd_end=qd,
            x_end=tuple(self.y[self.layout.signals].tolist()),
            switched=self.switched,
            track=self._track() if self.pieces else Still(q, qd),
            roles=tuple(RolesFrom(begin, roles.by_driver()) for begin, roles in self.roles),
            impacts=tuple(self.jolts),
            slips=tuple(self.slips),
            cost=self.system.cost,
            engine=self.system.engine_of_states.name,
        )
        return motion.but(error=0.0) if self.stands else motion

    @property
    def stands(self) -> bool:
        """Whether it is over without any step: at a finer tolerance it is the same."""
        return not self.moves and self.end not in UNFINISHED

    def _track(self) -> Steps:
        standstills = tuple(e.t for e in self.events if e.kind == ends.STANDSTILL)
        changes = tuple(self.roles), tuple(self.jolts), standstills
        return Steps.of(self.layout, self.times, self.pieces, *changes)

    def _balance(self, start: Floats) -> None:
        """What the work of loads and friction leaves unexplained of the kinetic energy."""
        worked, *more = self.y[self.layout.works].tolist()
        taken = math.fsum(jolt.loss for jolt in self.jolts)
        if self.layout.rubs:
            self.facts["friction_work"] = more[0]
            taken += more[0]
        if self.layout.driven:
            self.facts["drive_work"] = more[-1]
            taken -= more[-1]
        if self.jolts:
            self.facts["impact_loss"] = math.fsum(jolt.loss for jolt in self.jolts)
        if self.pieces:
            after = self.equation.kinetic(self.y)
            if self.energy is None:
                self.energy = self.equation.kinetic(start)
            before = self.energy
            whole = max(before, after, self.turned)
            balance = abs(after - before - worked + taken) / whole if whole > 0 else 0.0
            if math.isfinite(balance):
                self.facts["energy_balance"] = balance

    # -- segments --------------------------------------------------------------------------

    @property
    def _now(self) -> Now:
        return Now(self.t, self.y, bool(self.pieces))

    def begin(self) -> RunEnd | None:
        """Give pairs with friction the senses in which they slip first."""
        over = self._becomes(self.pairs.begin(self._now))
        rests = over is not None or self.t >= self.t_max
        if self.scales is None and not rests:
            self.scales = scales(self.equation, self.t, self.y)
        turns = self.system.period is not None and self.method not in FIXED
        if turns and repeats(self.system, self.request):
            self.turns = TurnsInTime(float(self.y[0]), self.t, float(self.y[1]) ** 2)
        return over

    def _becomes(self, change: Transition) -> RunEnd | None:
        """Go on as pairs with friction do."""
        self.events += change.events
        self.facts |= change.facts
        self.slips = [s for s in self.slips if not (change.slips and s.begin == self.t)]
        self.slips += change.slips
        self.y = self.y if change.y is None else change.y
        if change.until is not None:
            self._wait(change.until)
        return change.end

    def _rules(self) -> list[EventFunction]:
        equation, system = self.equation, self.system
        signals = signal_rules(equation.kinks, system.signals.kinks)
        rules = self.general.copy()
        if equation.drivers == 1 and not equation.held:
            rules += kink_rules(float(self.y[0]), system.knots, system.period)
            rules += self._turn_rules()
        return [*rules, *signals, *self.pairs.rules()]

    def _turn_rules(self) -> list[EventFunction]:
        if self.turns is None or self.system.period is None:
            return []
        way, place = self.turns.many * self.system.period, self.turns.place
        return [driver_at(ends.WHOLE_TURN, q) for q in (place - way, place + way)]

    def _turned(self) -> RunEnd | None:
        """Go on over a whole turn, if the goal may still be ahead."""
        self.fired = None  # where the next one ends is elsewhere
        q, rate = float(self.y[0]), float(self.y[1])
        assert self.turns is not None
        over = self.turns.turned(self.t, q, rate, self.request.accuracy or TARGET)
        ahead = any(rate * (place - q) > 0 for place in self.request.places)
        return None if ahead else over

    def segment(self) -> RunEnd | None:
        """Go on with one smooth right-hand side to whatever ends it."""
        if self.t_max - self.t <= 2 * EPS * abs(self.t_max):
            self.t = self.t_max
            return RunEnd("time", "reached")
        structure, held = self.system.compiled.structure, self.system.held
        self._switch()
        self._follow()
        if self.system.roles is not None and self.system.roles.over(self.t):
            return RunEnd(ends.LAW_ENDS)
        if any(way * self.equation.stop_force(i, self.t, self.y) > 0 for i, way in held.items()):
            return RunEnd(ends.LEAVES_STOP)  # what has just switched pulls
        if (pressed := self._pressed()) is not None:
            return RunEnd(pressed)
        if self.pairs.pushed_loose(self._now):
            return self._becomes(self.pairs.release(self._now))
        kink = loads.next_time_kink(structure, self.t)
        bound = min(self.t_max, kink, self.system.signals.next_time(self.t))
        if self.system.roles is not None:
            if self.system.roles.turns(self.t) and self.pieces:
                self._becomes(self.pairs.carried(self._now))
            bound = min(bound, self.system.roles.next_kink(self.t))
        if self.t < self.request.apex:  # a step as long as a flight sees no blow at its end
            bound = min(bound, self.request.apex)
        if at_once(bound, self.t):  # on less than that no solver starts
            self.t = bound
            return None
        parts = 1 if self.method in FIXED else PARTS
        known = self.pairs.known(self._now)
        if self.fired is not None and self.fired.kind != ends.RELEASED:
            known.add((self.fired.kind, self.fired.index))
        rules, here = self._rules(), (parts, self.system.spans, self.t, known)
        lookouts = [EventDetector([r for r in rules if r.own is x], *here) for x in (False, True)]
        self.fired = None
        hit = self._integrated(bound, *lookouts)
        if isinstance(hit, RunEnd):
            return hit
        return None if hit is None else self._met(hit)

    def _follow(self) -> None:
        """Put drivers with a law where that says they are."""
        if self.system.roles is not None and self.system.roles.prescribed:
            q, rate = self.equation.motion(self.t, self.y)
            self.y[self.layout.q], self.y[self.layout.rate] = q, rate

    def _change_roles(self, watch: Watch) -> RunEnd | None:
        """Give drivers the roles of an event; rates that jump are a blow of their drives."""
        before = self.system.roles
        assert before is not None
        roles = before.but(watch.then)
        if roles == before:
            return None
        self._follow()
        jolt, work = jolt_of(self.equation, roles, watch.name, self.t, self.y)
        self.y[self.layout.works.stop - 1] += work
        self.system.roles = roles
        self.roles.append((self.t, roles))
        if jolt is not None:
            self.jolts.append(jolt)
            self.y[self.layout.rate] = jolt.after
        return self._becomes(self.pairs.begin(self._now))

    def _switch(self) -> None:
        """Let the discrete signal blocks that are due at this instant switch.

        Those that read nothing, as a step, switch before; all others read what was before them.
        """
        if self.switched == self.t or self.system.signals.update is None:
            return
        self.switched = self.t
        blocks = self.system.signals.blocks
        due = {name for name, block in blocks.items() if at_once(block.instant(self.t), self.t)}
        sources = {name for name in due if not blocks[name].inputs}
        for names in filter(None, (sources, due - sources)):
            self.y = self.equation.switched(self.t, self.y, names)

    def _pressed(self) -> str | None:
        """The end stop against which signals push a driver that stands at it, if one does.

        A motor's current begins at nothing, so the push may only show a little later.
        """
        begins = self.t in (self.request.start.t, self.switched)
        if not (begins and self.layout.initial) or self.system.friction is not None:
            return None
        for i in range(self.equation.drivers):
            q, qd = self.y[self.layout.q][i], self.y[self.layout.rate][i]
            way = self.system.at_stop(i, q)
            if qd or not way or i in self.system.held:
                continue
            y, push = self.y.copy(), 0.0
            for _ in range(CHAIN):
                slope = np.asarray(self.equation(self.t, y), dtype=np.float64)
                push = push or slope[self.layout.rate][i]
                y[self.layout.signals] += CREEP * slope[self.layout.signals]
            if push * way > 0:
                kind = self.system.end_at(i)
                self.happened(kind, *self.layout.motion(self.y))
                return kind
        return None

    def _tolerances(self, tol: float) -> tuple[Floats, Floats]:
        """Relative and absolute ones of the components of the state."""
        assert self.scales is not None
        rtol = np.full(self.layout.size, max(tol, FLOOR))
        rtol[self.layout.q] = FLOOR
        return rtol, tol * self.scales

    def _solver(self, bound: float, t: float, y: Floats) -> Any:
        if self.method in FIXED:
            from blockmech.dynamics.fixed_steps import STEPPERS

            return STEPPERS[self.method](self.equation, t, y, bound, self.step)
        rtol, atol = self._tolerances(self.tolerance)
        how: dict[str, Any] = {"rtol": rtol, "atol": atol, "plan": self.plan}
        if self.finer is not None and self.method == "dop853" and t == self.request.start.t:
            how["finer"] = np.array(self._tolerances(self.finer))
        return SOLVERS[self.method](self.equation, t, y, bound, **how)

    def _stepped(
        self, solver: Any, free_range: tuple[float, float] = ANYWHERE, every: bool = True
    ) -> AcceptedSteps | None:
        """One more step, or some of them at once by machine code; None where there is none."""
        if isinstance(solver, MachineSteps) and (steps := solver.steps(free_range, every)):
            return steps
        with np.errstate(all="ignore"):
            y = solver.y
            try:
                solver.step()
            except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
                if error is self.equation.error:  # the mechanism's own, not the solver's
                    raise
                return None
            self.equation.closeness(solver.y)
            if solver.status == "failed" or not np.isfinite(solver.y).all():
                return None
            t = np.array([solver.t_old, solver.t])
            return AcceptedSteps(t, np.array([y, solver.y]), solver.dense_output())

    def _integrated(
        self, bound: float, lookout: EventDetector, own: EventDetector
    ) -> EventHit | RunEnd | None:
        """Steps up to a terminal event, the bound (None), or where the solver gives up."""
        self.bound = bound
        slope = self.equation(self.t, self.y)
        if not all(map(math.isfinite, slope)):  # from which SciPy's would never come back
            return self._given_up()
        solver = self._solver(bound, self.t, self.y)
        every = lookout.ends_at_standstill
        while solver.status == "running":
            steps = self._stepped(solver, lookout.free_range(float(solver.y[0])), every)
            if steps is None:
                return self._given_up()
            met = self._over(steps, lookout, own) if solver.t > solver.t_old else None
            if met is not None:
                return met
            if self.leaves is not None and self.leaves(self.y[self.layout.q]):
                return RunEnd(ends.LEAVES_CHART)
        return None

    def _over(
        self, steps: AcceptedSteps, lookout: EventDetector, own: EventDetector
    ) -> EventHit | None:
        """Go over steps, to the first terminal event in them; ``own`` looks for a user's."""
        hits_in = own.within(*steps[:3])
        standing, m = lookout.of_standstills() if steps.turns else lookout, len(steps.t) - 1
        for i in steps.turns:
            hits_in += standing.within(*steps.part(i, i + 1)[:3])
        if steps.calm < m:
            hits_in += lookout.within(*steps.part(m - 1, m)[:3])
        hits = until_terminal(hits_in)
        if not (hits and hits[-1].rule.terminal):
            self._note(hits, steps.dense)
            self._took(steps)
            return None
        self._note(hits[:-1], steps.dense)
        i = max(int(np.searchsorted(steps.t, hits[-1].t)) - 1, 0)
        if i:
            self._took(steps.part(0, i))
        for taken in self._exactly(hits[-1], steps.part(i, i + 1)):
            self._took(taken)
        last = hits[-1]._replace(t=self.t)
        self._note([last], lambda t: self.y)
        return last

    def _exactly(self, hit: EventHit, step: AcceptedSteps) -> list[AcceptedSteps]:
        """Steps that end at an event in a step.

        The step beyond it is coarser in between, and has seen what a kink is for.
        """
        t, t0, y0, steps = hit.t, float(step.t[0]), step.y[0], list[AcceptedSteps]()
        coarse = [step.until(t, step.dense(t))]
        if not t > t0:
            return coarse
        solver = self._solver(t, t0, y0)
        while solver.status == "running":
            more = self._stepped(solver)
            if more is None:
                return coarse
            steps.append(more)
        y = np.array(solver.y)
        slope, ahead = np.asarray(self.equation(t, y), dtype=np.float64), AHEAD * (t - t0)
        here = hit.rule.value(t, y)
        rise = (hit.rule.value(t + ahead, y + ahead * slope) - here) / ahead
        late = min(-here / rise, self.bound - t) if rise else math.nan
        moved = y + late * slope
        known = hit.rule.parts > 1 and abs(late) <= (t - t0) / PARTS and np.isfinite(moved).all()
        return [*steps[:-1], steps[-1].until(t + late, moved)] if known else steps

    def _took(self, steps: AcceptedSteps) -> None:
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
            self.system.progress(self.name, *self._far())

    def _refuse_stiff(self) -> None:
        """Give up early where the motion is too stiff for an explicit method.

        Bristles in a fast slip forget in so short a time all along, so what is done so far tells;
        of others it is a guess, where another method may go on: that gives up where it is far off.
        """
        if self.patient and not (self.system.remembers and self.method == "dop853"):
            return
        spent, start = self.equation.spent, self.request.start.t
        if self.request.until.goal == "time" and spent > GUESSED_AT:
            whole = spent * (self.t_max - start) / (self.t - start)
            if whole > self.equation.most * (1 if self.method == "dop853" else HOPELESS):
                self.notes.append(
                    f"{spent} evaluations reach {self.t:.3g} s, at most {self.equation.most} are "
                    'made: ask for a shorter time, or for what it settles to, "steady"'
                )
                raise ends.TooMany

    def _far(self) -> tuple[float, float | None]:
        """How far the run is on the way to its goal, and the whole way."""
        goal, value = self.request.until.goal, self.request.until.value
        q0 = float(np.atleast_1d(self.request.start.q)[0])
        if goal == "turns":
            return abs(float(self.y[0]) - q0) / math.tau, value
        if goal == "angle":
            return abs(float(self.y[0]) - q0), abs(value - q0)
        return self.t - self.request.start.t, value if goal == "time" else None

    def _note(self, hits: list[EventHit], dense: Any) -> None:
        for hit in hits:
            if hit.rule.kind in SILENT or hit.rule.kind in self.pairs.silent:
                continue
            y = np.array(dense(hit.t))
            if hit.rule.kind == ends.STANDSTILL:
                y[1] = 0.0
            q, qd = self.layout.motion(y)
            self.events.append(Event(hit.rule.kind, float(hit.t), q, qd))

    # -- what was met ----------------------------------------------------------------------

    def _met(self, hit: EventHit) -> RunEnd | None:
        """Why the run is over by the event that ended a segment, or None."""
        rule = self.fired = hit.rule
        changes = (w for w in self.request.watch if w.then and rule.own and w.name == rule.kind)
        if (watch := next(changes, None)) is not None:
            return self._change_roles(watch)
        if rule.kind == ends.KINK:
            return self._past_kink()
        if rule.kind == ends.WHOLE_TURN:
            return self._turned()
        if rule.kind == ends.REVERSAL:
            return self._becomes(self.pairs.reverse(self._now, rule.index))
        if rule.kind == ends.STANDSTILL:
            return self._stood()
        if rule.kind == ends.RELEASED:
            return self._becomes(self.pairs.release(self._now))
        if rule.kind == ends.LEAVES_STOP:
            self._past_contact(rule)
            return RunEnd(rule.kind)
        if rule.kind in (ends.DEAD_CENTRE, ends.NO_INERTIA):
            q, qd = float(self.y[0]), float(self.y[1])
            left = time_left(self.system, rule.kind, q, qd)
            return self.short_of(rule.kind, left)
        if rule.kind == ends.GOAL:
            return RunEnd(self.request.until.goal, "reached")
        if rule.kind not in (ends.GUIDE_SIDE, ends.SIGNAL_KINK, ends.DEFLECTION_KINK):
            own = any(rule.kind == w.name and w.terminal for w in self.request.watch)
            return RunEnd(rule.kind, "reached" if own else "ended")
        return None

    def _stood(self) -> RunEnd | None:
        self.y[1] = 0.0
        swing, self.swing_from = abs(float(self.y[0]) - self.swing_from), float(self.y[0])
        if self.turns is not None:
            self.turns = TurnsInTime(self.swing_from, self.t, 0.0)
        if (over := self.stood()) is not None:
            return over
        short = self.request.standstills < math.inf and swing <= self.rest
        return self._becomes(self.pairs.stand(self._now, short))

    def _past_kink(self) -> RunEnd | None:
        """Go on to the far side of a kink, if there is one: else the load ends there.

        On the kink itself a load that jumps may be the one before. What happens at the same place,
        as a turn does that begins on a kink, is on one side or the other, and is met here.
        """
        q, rate = float(self.y[0]), float(self.y[1])
        way = PAST * max(1.0, abs(q))
        if not abs(rate) * (self.t_max - self.t) > way:
            return None
        short, there, late = self.y.copy(), self.y.copy(), way / abs(rate)
        short[0], there[0] = q - math.copysign(way, rate), q + math.copysign(way, rate)
        same = [
            EventHit(rule, self.t)
            for rule in self._rules()
            if rule.terminal
            and (rule.own or (rule.component == 0 and rule.kind != ends.KINK))
            and turned(
                rule.value(self.t - late, short), rule.value(self.t + late, there), rule.direction
            )
        ]
        if same and same[0].rule.kind == ends.GOAL:
            return self._met(same[0])
        if np.isfinite(self.equation(self.t + late, there)).all():
            self.y, self.t = there, self.t + late
        if not same:
            return None
        self._note(same[:1], lambda t: self.y)
        return self._met(same[0])

    def _past_contact(self, rule: EventFunction) -> None:
        """Go on to where a stop would have to pull: the root is on either side of it."""
        slope, late = np.asarray(self.equation(self.t, self.y)), math.ulp(self.t)
        while not rule.value(self.t, self.y) < 0 and late < self.t_max - self.t:
            self.t, self.y, late = self.t + late, self.y + late * slope, 2 * late

    def _wait(self, until: float) -> None:
        """Stand still until a time [s]."""
        still = self.y.copy()
        times, states = np.array([until, until]), np.array([still, still])  # no step at all
        self._took(
            AcceptedSteps(times, states, lambda t: np.multiply.outer(still, np.ones_like(t)))
        )

    def _given_up(self) -> RunEnd | None:
        """Why the run is over where a solver gave up; None if another one goes on."""
        if self.method != "dop853":
            self.method = "dop853"  # which comes as near as one can to where there is no pose
            return None
        end, status, left, *_ = what_is_ahead(self.equation, self.t, self.y)
        locked = end == ends.SELF_LOCKED and not self.pieces
        return self.short_of(end, left, "failed" if locked else status)


def in_time(
    system: System, request: SimulationRequest, method: str, patient: bool = True
) -> Motion:
    """The motion by an integrator, with its estimated error; see `TimeIntegration.patient`."""
    target, smooth = request.accuracy or TARGET, system.smooth and method == "dop853"
    runs: list[TimeIntegration] = []

    def run(tolerance: float, halves: bool) -> Motion:
        name = f"{method}, run {len(runs) + 1}" if runs else method
        how: dict[str, Any] = {"patient": patient}
        if not halves:
            how["finer"] = max(tolerance / FINER, FLOOR)
        before = runs[-1] if halves else None
        runs.append(
            TimeIntegration(system, request, method, tolerance, name, target, before, **how)
        )
        return runs[-1].motion()

    remainder = SMOOTH if smooth else CORNERED
    first = max(target, LEAST)
    return refined(halved(run), system, first, target, request.times, remainder)


def repeats(system: System, request: SimulationRequest) -> bool:
    """Whether all that acts is of place and rate, and nothing but its goal ends the motion.

    Then one driver that comes back to a place as fast goes the same way again.
    """
    limited = np.isfinite(system.stops).any() or any(w.terminal or w.then for w in request.watch)
    alike = system.depends_on <= {"q", "rate"} and request.roles is None and not system.remembers
    timed = request.span < math.inf or len(system.drivers) > 1
    return alike and not limited and not timed
