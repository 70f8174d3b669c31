r"""Motions integrated in time: from segment to segment, and what happens between them.

Each segment (`integration`) has a smooth right-hand side (`equation`): kinks of loads, reversals of
pairs with friction, instants of signals and events that change roles end one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain, count
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics import ends, loads
from blockmech.dynamics.blow import jolt_of
from blockmech.dynamics.contacts import INSTANT
from blockmech.dynamics.ends import RunEnd, TurnsInTime
from blockmech.dynamics.equation import PAST, scales, time_left
from blockmech.dynamics.estimate import (
    FINER,
    FLOOR,
    SMOOTH,
    TARGET,
    UNFINISHED,
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
from blockmech.dynamics.integration import Integration
from blockmech.dynamics.layout import TimeTrack
from blockmech.dynamics.request import SimulationRequest, Watch
from blockmech.dynamics.roles import Roles
from blockmech.dynamics.solvers import STEPPERS, AcceptedSteps
from blockmech.engines.dense import Dense
from blockmech.ground.plane import EPS
from blockmech.result.motion import Impact, Motion, RolesFrom, Still
from blockmech.signals.contract import at_once
from blockmech.typing import Floats

if TYPE_CHECKING:
    from blockmech.dynamics.system import System


@dataclass
class TimeIntegration(Integration):
    """One integration at one tolerance, or with one step, under way."""

    def __post_init__(self, before: Integration | None) -> None:
        super().__post_init__(before)
        self.jolts = list[Impact]()  # of changes of roles
        self.roles = list[tuple[float, Roles]]()  # from times [s] on
        self.fired: EventFunction | None = None  # by which the last segment ended
        self.turns: TurnsInTime | None = None  # where a goal may never be reached
        self.system.roles = self.request.roles
        if self.request.roles is not None:
            self.roles.append((self.t, self.request.roles))
        measures = self.equation.closeness, self.equation.stop_force
        self.general = general_rules(self.system, self.request, *measures)
        if self.system.counted is not None:
            self.system.counted.again()
        self.switched = self.request.switched  # when discrete signal blocks switched last
        self.swing_from = float(self.y[0])

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
        if self.method != self.method_asked and status == "reached":
            self.notes.append(f"{self.method_asked} gave up; {self.method} continued the motion")
        fixed = self.method_asked in STEPPERS
        if not (fixed or self.is_rest):
            self.facts["tolerance"] = self.tolerance
        rests = end == ends.REST or self.is_rest
        motion = self.result(
            method=self.method_asked,
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
        return motion.but(error=0.0) if self.is_rest else motion

    @property
    def is_rest(self) -> bool:
        """Whether it is over without any step: at a finer tolerance it is the same."""
        return not self.moves and self.end not in UNFINISHED

    def _track(self) -> TimeTrack:
        standstills = tuple(e.t for e in self.events if e.kind == ends.STANDSTILL)
        dense = Dense.joined(self.times, self.pieces)
        return TimeTrack(self.layout, dense, tuple(self.roles), tuple(self.jolts), standstills)

    def net_work(self, t: float) -> float:
        """[J] since the start of loads and drives, less what friction and jolts took until then."""
        if not self.pieces:
            return 0.0
        y = self.y if t == self.t else Dense.joined(self.times, self.pieces)(np.array([t]))[:, 0]
        loads, *works = map(float, y[self.layout.works])
        friction = works[0] if self.layout.rubs else 0.0
        drives = works[-1] if self.layout.driven else 0.0
        return loads + drives - friction - math.fsum(x.loss for x in self.jolts if x.t <= t)

    def _balance(self, start: Floats) -> None:
        """What the work of loads and friction leaves unexplained of the kinetic energy."""
        _, *works = self.y[self.layout.works].tolist()
        if self.layout.rubs:
            self.facts["friction_work"] = works[0]
        if self.layout.driven:
            self.facts["drive_work"] = works[-1]
        if self.jolts:
            self.facts["impact_loss"] = math.fsum(jolt.loss for jolt in self.jolts)
        if self.pieces:
            after = self.equation.kinetic(self.y)
            if self.energy is None:
                self.energy = self.equation.kinetic(start)
            before = self.energy
            scale = max(before, after, self.turned)
            balance = abs(after - before - self.net_work(self.t)) / scale if scale > 0 else 0.0
            if math.isfinite(balance):
                self.facts["energy_balance"] = balance

    # -- segments --------------------------------------------------------------------------

    def begin(self) -> RunEnd | None:
        """Give pairs with friction the senses in which they slip first."""
        over = self.settle()
        rests = over is not None or self.t >= self.t_max
        if self.scales is None and not rests:
            self.scales = scales(self.equation, self.t, self.y)
        turns = self.system.period is not None and self.method not in STEPPERS
        if turns and repeats(self.system, self.request):
            self.turns = TurnsInTime(float(self.y[0]), self.t, float(self.y[1]) ** 2)
        return over

    def wait(self, until: float) -> RunEnd | None:
        """See `StickSlip`: no step at all, but a user's events of the time are looked for."""
        y, rules = (self.y, self.y), [rule for rule in self.general if rule.by_user]
        dense = Dense.cubic(self.t, until - self.t or 1.0, y, (0 * self.y,) * 2)
        lookout, hits = EventDetector(rules, PARTS, self.system.spans, self.t), list[EventHit]()
        if until > self.t:
            hits = until_terminal(lookout.within(np.array([self.t, until]), np.array(y), dense))
        over = self._met(hits[-1]) if hits and hits[-1].rule.terminal else None
        end = until if over is None else hits[-1].t
        self.take(AcceptedSteps.single((end, end), y, dense))
        self.note(hits, dense)
        return over

    def _rules(self) -> list[EventFunction]:
        equation, system = self.equation, self.system
        signals = signal_rules(equation.kinks, system.signals.kinks)
        rules = self.general.copy()
        if self.layout.drivers == 1 and not equation.is_fixed:
            rules += kink_rules(float(self.y[0]), system.knots, system.period)
            if self.turns is not None and system.period is not None:
                q, travel = self.turns.coordinate, self.turns.many * system.period
                rules += [driver_at(ends.WHOLE_TURN, x) for x in (q - travel, q + travel)]
        return [*rules, *signals, *self.pair_rules()]

    def _turned(self) -> RunEnd | None:
        """Go on over a whole turn, if the goal may still be ahead."""
        self.fired = None  # where the next one ends is elsewhere
        q, rate = float(self.y[0]), float(self.y[1])
        assert self.turns is not None
        over = self.turns.turned(self.t, q, rate, self.request.accuracy or TARGET)
        may_be_met = any(rate * (goal - q) > 0 for goal in self.request.goals)
        return None if may_be_met else over

    def segment(self) -> RunEnd | None:
        """Go on with one smooth right-hand side to whatever ends it."""
        if self.t_max - self.t <= 2 * EPS * abs(self.t_max):
            self.t = self.t_max
            return RunEnd("time", "reached")
        structure, stops = self.system.compiled.structure, self.system.contacts
        self._switch()
        self._follow()
        if self.system.roles is not None and self.system.roles.over(self.t):
            return RunEnd(ends.LAW_ENDS)
        if any(side * self.equation.stop_force(i, self.t, self.y) > 0 for i, side in stops.items()):
            return RunEnd(ends.LEAVES_STOP)  # what has just switched pulls
        if (pressed := self._pressed()) is not None:
            return RunEnd(pressed)
        fresh = self.settled == self.t
        if self.equation.holds and not fresh and self.excess(self.t, self.y) > 0:  # pushed loose
            return self.settle(self.stuck, True)
        kink = loads.next_time_kink(structure, self.t)
        bound = min(self.t_max, kink, self.system.signals.next_time(self.t))
        if self.system.roles is not None:
            if self.system.roles.turns(self.t) and self.pieces:
                self.settle(self.stuck)
            bound = min(bound, self.system.roles.next_kink(self.t))
        if self.t < self.request.apex:  # a step as long as a flight sees no blow at its end
            bound = min(bound, self.request.apex)
        if at_once(bound, self.t):  # on less than that no solver starts
            self.t = bound
            return None
        parts = 1 if self.method in STEPPERS else PARTS
        # several pairs may reverse at once
        past_events = {(ends.REVERSAL, j) for j in self.zero if self.settled == self.t}
        if self.fired is not None and self.fired.kind != ends.RELEASED:
            past_events.add((self.fired.kind, self.fired.index))
        rules, detector_options = self._rules(), (parts, self.system.spans, self.t, past_events)
        lookouts = [
            EventDetector([r for r in rules if r.by_user is x], *detector_options)
            for x in (False, True)
        ]
        self.fired = None
        hit = self.integrate(bound, *lookouts)
        if isinstance(hit, RunEnd):
            return hit
        return None if hit is None else self._met(hit)

    def _follow(self) -> None:
        """Put drivers with a law where that says they are."""
        if self.system.roles is not None and self.system.roles.prescribed:
            q, rate = self.equation.motion(self.t, self.y)
            self.y[self.layout.q], self.y[self.layout.rate] = q, rate

    def _change_roles(self, watch: Watch) -> RunEnd | None:
        """Give drivers the roles of an event; rates that jump are an impact of their drives."""
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
        return self.settle()

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
        for i in range(self.layout.drivers):
            q, qd = self.y[self.layout.q][i], self.y[self.layout.rate][i]
            side = self.system.at_stop(i, q)
            if qd or not side or i in self.system.contacts:
                continue
            y, push = self.y.copy(), 0.0
            for _ in range(len(self.layout.initial) + 1):  # through as many states at most
                slope = np.asarray(self.equation(self.t, y), dtype=np.float64)
                push = push or slope[self.layout.rate][i]
                y[self.layout.signals] += INSTANT * slope[self.layout.signals]
            if push * side > 0:
                kind = self.system.end_at(i)
                self.happened(kind, *self.layout.motion(self.y))
                return kind
        return None

    # -- what was met ----------------------------------------------------------------------

    def _met(self, hit: EventHit) -> RunEnd | None:
        """Why the run is over by the event that ended a segment, or None."""
        rule = self.fired = hit.rule
        kind, request = rule.kind, self.request
        changes = (w for w in request.watch if w.then and rule.by_user and w.name == kind)
        if (watch := next(changes, None)) is not None:
            return self._change_roles(watch)
        if kind == ends.REVERSAL:
            return self.reverse(rule.index)
        if kind == ends.RELEASED:
            return self.settle(self.stuck, True)
        past = {ends.KINK: self._past_kink, ends.WHOLE_TURN: self._turned}
        past |= {ends.STANDSTILL: self._stood}
        if kind in past:
            return past[kind]()
        if kind in ends.KINKS:
            return None
        if kind in (ends.DEAD_CENTRE, ends.NO_INERTIA):
            return self.short_of(kind, time_left(self.system, kind, *map(float, self.y[:2])))
        if kind == ends.LEAVES_STOP:
            # Go on to where a stop would have to pull: the root is on either side of it.
            slope, late = np.asarray(self.equation(self.t, self.y)), math.ulp(self.t)
            while not rule.value(self.t, self.y) < 0 and late < self.t_max - self.t:
                self.t, self.y, late = self.t + late, self.y + late * slope, 2 * late
        if kind == ends.GOAL:
            return RunEnd(request.until.goal, "reached")
        by_user = any(kind == w.name and w.terminal for w in request.watch)
        return RunEnd(kind, "reached" if by_user else "ended")

    def _stood(self) -> RunEnd | None:
        self.y[1] = 0.0
        swing, self.swing_from = abs(float(self.y[0]) - self.swing_from), float(self.y[0])
        if self.turns is not None:
            self.turns = TurnsInTime(self.swing_from, self.t, 0.0)
        if (over := self.stood()) is not None:
            return over
        short = self.request.standstills < math.inf and swing <= self.rest
        if short and self.system.friction is None:
            return RunEnd(ends.REST)
        return self.settle()

    def _past_kink(self) -> RunEnd | None:
        """Go on to the far side of a kink, if there is one: else the load ends there.

        On the kink itself a load that jumps may be the one before. What happens at the same place,
        as a turn does that begins on a kink, is on one side or the other, and is met here.
        """
        q, rate = float(self.y[0]), float(self.y[1])
        offset = PAST * max(1.0, abs(q))
        if not abs(rate) * (self.t_max - self.t) > offset:
            return None
        short, beyond, late = self.y.copy(), self.y.copy(), offset / abs(rate)
        short[0], beyond[0] = q - math.copysign(offset, rate), q + math.copysign(offset, rate)
        same = [
            EventHit(rule, self.t)
            for rule in self._rules()
            if rule.terminal
            and (rule.by_user or (rule.component == 0 and rule.kind != ends.KINK))
            and turned(
                rule.value(self.t - late, short), rule.value(self.t + late, beyond), rule.direction
            )
        ]
        if same and same[0].rule.kind == ends.GOAL:
            return self._met(same[0])
        if np.isfinite(self.equation(self.t + late, beyond)).all():
            self.y, self.t = beyond, self.t + late
        if not same:
            return None
        self.note(same[:1], lambda t: self.y)
        return self._met(same[0])


def integrate(
    system: System, request: SimulationRequest, method: str, patient: bool = True
) -> Motion:
    """The motion by an integrator, with its estimated error; see `TimeIntegration.patient`."""
    target, smooth = request.accuracy or TARGET, system.smooth and method == "dop853"
    names, last = chain([method], (f"{method}, run {i}" for i in count(2))), None

    def run(tolerance: float, halves: bool) -> Motion:
        nonlocal last
        about = next(names), target, last if halves else None, math.nan
        finer = None if halves else max(tolerance / FINER, FLOOR)
        last = TimeIntegration(system, request, method, tolerance, *about, finer, patient)
        return last.motion()

    # What the iterations of Radau's method leave does not fall with its steps.
    return refined(run, system, target, request.times, SMOOTH if smooth else 1.0)


def repeats(system: System, request: SimulationRequest) -> bool:
    """Whether all that acts is of place and rate, and nothing but its goal ends the motion.

    Then one driver that comes back to a place as fast goes the same way again.
    """
    limited = np.isfinite(system.stops).any() or any(w.terminal or w.then for w in request.watch)
    alike = system.depends_on <= {"q", "rate"} and request.roles is None and not system.remembers
    timed = request.span < math.inf or not system.scalar
    return alike and not limited and not timed
