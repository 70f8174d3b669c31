r"""Impacts at end stops: a chain of motions, each from one blow to the next.

Whatever method computes the motion ends it at the stop, `blow` says what that does, and the next
one starts there with the rates after. Ever lower bounces are a geometric series once the effort no
longer changes over one: from a height on that is below the accuracy they are closed by their sum,
and it lies against the stop as long as the loads push it there.

The impulses in all joints are what the force pass says of the velocity jumps in place of the
accelerations, of the impulses of stops in place of loads, and of those of joint friction
(`impulses`); all else has none.

Sources: Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996, ch. 8; Brach,
Mechanical Impact Dynamics, 1991.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.blow import Before, Blow, blow, impact_of
from blockmech.dynamics.contacts import SETTLED, Constraints, constrained, free_of, rate_along
from blockmech.dynamics.ends import RunEnd
from blockmech.dynamics.estimate import TARGET
from blockmech.dynamics.pair_stops import PairStops, stopped_pairs
from blockmech.dynamics.programs import GIVEN
from blockmech.dynamics.request import SimulationRequest, Start
from blockmech.dynamics.run import Run
from blockmech.dynamics.sticking import JointFriction
from blockmech.dynamics.stops import Stop
from blockmech.dynamics.system import System
from blockmech.ground.errors import refused
from blockmech.ground.values import Vector
from blockmech.passes.friction import input_joints
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction
from blockmech.result.motion import Event, Impact, Lying, Motion, State, Track
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.typing import Data, Floats, Real

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

Move: TypeAlias = Callable[["System", SimulationRequest], Motion]
LOW = 0.1  # of the accuracy: the height of a bounce from which on they are summed up
IMPULSES = ("reaction", "N", "C", "drive")  # outputs whose impulses are asked for
REVERSES = "slips of joints end or turn back inside impacts: their friction is followed through it"
LEFT_OUT = "joint friction is left out of an impact: no impulses satisfy its laws"
GAINED = (
    "a stop gives back up to {:.6g} J more than it takes in an impact: its restitution is too high "
    "for the friction of the joints"
)


@dataclass(frozen=True)
class Chain:
    """Dense output of motions one after the other; at an impact the rates after it."""

    begins: Floats
    tracks: tuple[Track, ...]

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        q, qd = zip(*self._on_legs(t, lambda track, at: track.state(at)), strict=True)
        return State(np.concatenate(q), np.concatenate(qd))

    def signal_states(self, t: Floats) -> Floats:
        """States (m, n) of signal blocks at times (m,) [s]; an impact leaves them as they are."""
        return np.concatenate(list(self._on_legs(t, lambda track, at: track.signal_states(at))))

    def _on_legs(self, t: Floats, read: Callable[[Any, Floats], Any]) -> Iterator[Any]:
        """What is read of the tracks at times (m,) [s], in their order: leg by leg."""
        leg = np.clip(np.searchsorted(self.begins, t, "right") - 1, 0, len(self.tracks) - 1)
        runs = np.flatnonzero(np.diff(leg)) + 1
        for at, k in zip(np.split(t, runs), leg[[0, *runs]], strict=True):
            yield read(self.tracks[k], at)


@dataclass
class Bounces(Run):
    """A motion between stops that let it bounce, under way."""

    move: Move
    legs: list[Motion] = field(default_factory=list)
    impacts: list[Impact] = field(default_factory=list)
    contacts: dict[int, int] = field(default_factory=dict)
    since: dict[int, tuple[float, float]] = field(default_factory=dict)  # [s] lying, push [N, N m]
    struck: dict[int, tuple[float, float]] = field(default_factory=dict)  # [s], speed after it
    worked: float = 0.0  # [J] of drives in blows, which go on at their rates
    gained: float = 0.0  # [J] most that a stop gave
    lying: list[Lying] = field(default_factory=list)
    flights: float = 0.0  # [s] sum of those to come
    apex: float = math.inf
    height: float = 0.0  # [rad or m] of the flight to come
    unseen: float = 0.0  # of those that were summed up

    def begin(self) -> RunEnd | None:
        """Start with what is asked for."""
        self.next = self.request
        return None

    def segment(self) -> RunEnd | None:
        """Go on to the next blow, or to where it leaves a stop."""
        leg = self._leg(self.next)
        self.legs.append(leg)
        where = self._stop_of(leg)
        reported = (leg.end if where else "", ends.LEAVES_STOP)  # these are told below
        self.events += [e for e in leg.events if e.kind not in reported]
        if leg.end == ends.LEAVES_STOP:
            after = self._released(leg)
        elif where is not None:
            after = self._struck(leg, *where)
        else:
            return RunEnd(leg.end, leg.status)
        q, remaining = self.legs[-1].q_end, self.request.remaining_goal(leg.t_end, self.events)
        if remaining.goal == "time" and not remaining.value > 0:
            self.legs[-1] = self.legs[-1].but(qd_end=after)
            return RunEnd("time", "reached")
        if self.system.counted is not None:
            self.system.counted = self.system.counted.restarted(q)
        if self.system.roles is not None:  # as events of the leg have left them
            self.next = replace(self.next, roles=self.system.roles)
        times = tuple(t for t in self.next.times if t > leg.t_end)
        self.next = replace(
            self.next,
            start=Start(q, after, leg.t_end),
            until=remaining,
            apex=self.apex,
            times=times,
            switched=leg.switched,
        )
        return None

    def _leg(self, request: SimulationRequest) -> Motion:
        begin = self.legs[-1].x_end if self.legs else ()
        if begin or dict(self.system.contacts) != self.contacts:
            self.system = replace(self.system, contacts=dict(self.contacts), begin=begin)
        if self.contacts:
            _, pushes = self.system.response(*request.start, np.array(begin) if begin else None)
            for i, push in zip(sorted(self.contacts), pushes.tolist(), strict=False):
                since, contact_force = self.since[i]  # 0 until it comes to lie against it
                slope = self._stop(i, self.contacts[i]).slope
                self.since[i] = since, contact_force or push / slope
                if self.system.scalar:
                    self.facts["contact"] = self.since[i][1]
        return self.move(self.system, request)

    def _stop_of(self, leg: Motion) -> tuple[int, int] | None:
        """Place of the stop that ended a motion, and which end; None for no bounce."""
        if not leg.end.startswith(ends.END_STOP):
            return None
        i = self.system.stopped.index(leg.end.partition(" of ")[2] or self.system.drivers[0])
        low, high = self.system.stops[i]
        coordinate = float(self.system.coordinates(leg.q_end)[i])
        limit = 1 if abs(coordinate - high) < abs(coordinate - low) else -1
        bounces = self._stop(i, limit).restitution is not None
        if self.system.roles is not None and bounces:  # a drive goes on, whatever is in its way
            row = self.system.rows(leg.q_end, leg.qd_end)[0][i]
            bounces = bool((row @ self._free(len(row))).any())
        return (i, limit) if bounces else None

    def _stop(self, i: int, limit: int) -> Stop:
        """A highest or lowest stop."""
        stop: Stop = self.request.stops[i][limit > 0]
        return stop

    # -- at a stop ------------------------------------------------------------------------

    def _matrix(self, q: Floats, rate: Floats, t: float) -> tuple[Floats, Floats]:
        """Inertia (k, k), and efforts (k,) less what the rates take."""
        terms = self.system.terms(q, rate, t, self.legs[-1].x_end or None)
        return terms.M, terms.Q - terms.c

    def _side(self, i: int, limit: int) -> int:
        """+1 where a stop is the highest of its own coordinate, -1 where it is the lowest."""
        return limit if self._stop(i, limit).slope > 0 else -limit

    def _rows(self, struck: dict[int, int], q: Floats, rate: Floats) -> Constraints:
        """Rows of some stops at a state."""
        names = [*self.system.drivers, *self.pairs.names]
        those = [names.index(self._stop(*end).name) for end in struck.items()]
        return self.pairs.constraints(q, rate, those)

    @cached_property
    def pairs(self) -> PairStops:
        """Pairs that have stops."""
        names = [stop.name for between in self.request.stops for stop in between]
        return stopped_pairs(self.system.compiled, names)

    @cached_property
    def friction(self) -> JointFriction | None:
        """Joint friction of blows."""
        return self.system.friction_of(self.pairs.refs)

    def _onto(self, q: Floats, rate: Floats, t: float, struck: dict[int, int]) -> Floats:
        """Coordinates of the drivers with which stops are touched, the nearest by M."""
        those = [*struck]
        target = np.array([self.system.stops[i][limit > 0] for i, limit in struck.items()])
        off = target - self.system.coordinates(q)[those]
        rows = self._rows(struck, q, rate).rows
        Z = self._free(len(q))
        back = Z @ np.linalg.solve(Z.T @ self._matrix(q, rate, t)[0] @ Z, (rows @ Z).T)
        q = q + back @ (np.linalg.pinv(rows @ back) @ off)
        for i, x in zip(those, target, strict=True):
            if i < len(q):
                q[i] = x
        return q

    def _free(self, k: int) -> Floats:
        """Basis (k, z) of the free drivers."""
        roles = self.system.roles
        return np.eye(k) if roles is None else np.delete(np.eye(k), roles.bound, axis=1)

    def _struck(self, leg: Motion, i: int, limit: int) -> Real:
        """The rates after an impact."""
        q, before = (np.array(np.atleast_1d(x), dtype=float) for x in (leg.q_end, leg.qd_end))
        struck = {i: limit} | {j: self.contacts[j] for j in sorted(self.contacts) if j != i}
        q = self._onto(q, before, leg.t_end, struck)
        M, _ = self._matrix(q, before, leg.t_end)
        state = Before(leg.t_end, q, before, M, self._states(leg))
        e, rows = self._stop(i, limit).restitution, self._rows(struck, q, before).rows
        speed = rate_along(rows[0], before)
        assert e is not None
        solution = self._blow(state, struck, e)
        impulse = float(solution.pushes[0])
        low, later_impulses = self._is_low(q, solution.after, leg.t_end, i, limit, speed)
        if low:
            self.unseen += self.height
            solution, impulse = self._blow(state, struck, 0.0), impulse + later_impulses
            self.contacts[i] = limit
        after = solution.after if speed else before
        if i < len(q):
            after[i] = 0.0 if low or not e else -e * before[i]
        for (j, side), row in zip([*struck.items()][1:], rows[1:], strict=True):
            if -side * float(row @ after) > SETTLED * abs(speed):
                self._leaves(j, leg)
        if speed:
            departure_speed = abs(rate_along(rows[0], after))
            self.struck = {i: (leg.t_end, departure_speed)} if departure_speed else {}
            bound = [] if self.system.roles is None else self.system.roles.bound
            names = [self._stop(*end).name for end in struck.items()]
            names += [self.system.drivers[j] for j in bound]
            record, work = impact_of(solution, state, names, bound, self.friction)
            self.worked += work
            self.impacts.append(record._replace(impulse=impulse))
            self.events.append(Event(ends.IMPACT, leg.t_end, self._plain(q), self._plain(after)))
        if low:
            t = leg.t_end + (self.flights if speed else 0.0)
            self.facts["rest_time"], self.since[i] = t, (leg.t_end, 0.0)
            self.events.append(Event(ends.REST, t, leg.q_end, self._plain(after)))
        self.legs[-1] = replace(leg, q_end=self._plain(q), qd_end=self._plain(after))
        return self._plain(after)

    @staticmethod
    def _states(leg: Motion) -> Floats | None:
        """States of signal blocks and friction laws at the end of a leg; None without any."""
        return np.array(leg.x_end) if leg.x_end else None

    def _blow(self, state: Before, struck: dict[int, int], e: float) -> Blow:
        """An impact on the first of some stops; it lies against the others."""
        stops = self._rows(struck, state.q, state.rate)
        back = np.array([e] + [0.0] * (len(struck) - 1))
        sides = np.array([self._side(*stop) for stop in struck.items()])
        roles, bound = self.system.roles, None
        if roles is not None and roles.bound:  # their rates go on
            bound = roles.constraint(state.t)
            bound = bound._replace(drift=0 * bound.drift, speeds=None)
        solution = blow(state, stops, sides, back, self.friction, bound)
        self.notes += [REVERSES] if solution.reverses else [] if solution.solved else [LEFT_OUT]
        self.gained = max(self.gained, solution.gained)
        return solution

    def _is_low(
        self, q: Floats, after: Floats, t: float, i: int, limit: int, before: float
    ) -> tuple[bool, float]:
        """Whether all bounces to come are too low to be seen, and their impulses' sum.

        With joint friction the way up is not as the way down: the last flight says how much is
        left of the speed over one.
        """
        stops, side = self._rows({i: limit}, q, after), self._side(i, limit)
        speed, ratio = abs(rate_along(stops.rows[0], after)), 1.0
        M, Q = self._matrix(q, after, t)
        constraint = self.system.against(q, after, t)
        loads = constrained(M, Q, constraint)[0]
        push = side * float(stops.rows[0] @ loads + stops.drift[0])
        if self.friction is not None:
            rubbed = self.friction.from_state(q, after, t, constraint)[1]
            push = max(push, side * float(stops.rows[0] @ rubbed + stops.drift[0]))
        self.apex = math.inf
        if not push > 0:
            return (speed == 0.0 and push == 0), 0.0
        e = self._stop(i, limit).restitution or 0.0
        target = self.request.accuracy or TARGET
        flight, self.height = 2 * speed / push, speed * speed / (2 * push)
        if e == 1.0 and self.friction is None:
            self.apex = t + flight / 2
            return False, 0.0
        if i in self.struck and self.friction is not None and before:
            last, departure_speed = self.struck[i]
            ratio, flight = abs(before) / departure_speed, (t - last) * speed / departure_speed
        if e * ratio >= 1.0:
            return False, 0.0
        self.flights, self.apex = flight / (1 - e * ratio), t + flight / 2
        Z = free_of(constraint, len(q))
        row = stops.rows[0] @ Z
        mass = 1 / float(row @ np.linalg.solve(Z.T @ M @ Z, row))
        total = -side * mass * speed * ratio * (1 + e) / (1 - e * ratio)
        return self.height <= LOW * target, total

    def _leaves(self, i: int, leg: Motion) -> None:
        """It leaves a stop that it lay against."""
        self.lying.append(self._lain(i, leg.t_end))
        del self.contacts[i], self.since[i]
        self.events.append(Event(ends.LEAVES_STOP, leg.t_end, leg.q_end, leg.qd_end))

    def _released(self, leg: Motion) -> Real:
        """It leaves the stop that would have to pull most."""
        q, rate = (np.array(np.atleast_1d(x), dtype=float) for x in (leg.q_end, leg.qd_end))
        those = sorted(self.contacts)
        _, pushes = self.system.response(q, rate, leg.t_end, self._states(leg))
        pulls = [self.contacts[j] * float(P) for j, P in zip(those, pushes, strict=False)]
        q = self._onto(q, rate, leg.t_end, {j: self.contacts[j] for j in those})
        leg = self.legs[-1] = replace(leg, q_end=self._plain(q))
        self._leaves(those[int(np.argmax(pulls))], leg)
        self.system = replace(self.system, contacts=dict(self.contacts))
        return leg.qd_end

    def _lain(self, i: int, t: float) -> Lying:
        """That it lay against a stop until a time [s]."""
        name = self._stop(i, self.contacts[i]).name
        return Lying(name, self.since[i][0], t, self.since[i][1], self.pairs.by_name.get(name))

    def _plain(self, x: Floats) -> Real:
        return float(x[0]) if self.system.scalar else x

    # -- the whole ------------------------------------------------------------------------

    def motion(self) -> Motion:
        """Go on from blow to blow, and join what is between them."""
        self.run()
        assert self.over is not None
        if not self.legs:  # interrupted
            return self.result()
        legs, last = self.legs, self.legs[-1].but(end=self.over.end, status=self.over.status)
        if len(legs) == 1 and not self.impacts:
            return last
        moving = [leg for leg in legs if leg.t_end > leg.t_start] or legs[-1:]
        facts = {**last.facts, **self.facts}
        jolts = [impact for leg in legs for impact in leg.impacts]  # of changes of roles
        for work in ("friction_work", "drive_work"):
            if parts := [leg.facts[work] for leg in legs if work in leg.facts]:
                facts[work] = math.fsum(parts)
        if "drive_work" in facts:
            facts["drive_work"] += self.worked
        facts.pop("energy_balance", None)
        facts["impacts"] = float(len(self.impacts))
        facts["impact_loss"] = math.fsum(i.loss for i in (*self.impacts, *jolts))
        notes = dict.fromkeys([*(note for leg in legs for note in leg.notes), *self.notes])
        if self.gained > SETTLED * max((i.loss for i in self.impacts), default=0.0):
            notes[GAINED.format(self.gained)] = None
        return replace(
            last,
            method=legs[0].method,
            why=legs[0].why,
            regime="with impacts",
            t_start=self.request.start.t,
            track=Chain(np.array([leg.t_start for leg in moving]), tuple(x.track for x in moving)),
            events=tuple(sorted(self.events, key=lambda e: e.t)),
            impacts=tuple(sorted([*self.impacts, *jolts], key=lambda i: i.t)),
            roles=tuple(r for leg in legs for r in leg.roles),
            slips=tuple(s for leg in legs for s in leg.slips),
            lying=(*self.lying, *(self._lain(i, last.t_end) for i in self.since)),
            error=math.fsum(leg.error for leg in legs) + self.unseen,
            cost=self.system.cost,
            notes=tuple(notes),
            facts=facts,
        )


def bounced(system: System, request: SimulationRequest, move: Move) -> Motion:
    """The motion between end stops of which some let it bounce; ``move`` goes on to the next.

    Raises `RequestError` for goals that say nothing across an impact.
    """
    goal = request.until.goal
    if goal in ("turns", "steady"):
        remedy = 'ask for "time=<s>", or leave the restitution out'
        raise refused("until", f'"{goal}" with end stops that let it bounce', remedy, code="until")
    return Bounces(system, request, move).motion()


def impulses(mechanism: Compiled, impact: Impact) -> Data:
    """Impulses [N s] and [N m s] of an impact in every joint, by output name.

    Parameters
    ----------
    impact : one of `Motion.impacts`

    Returns
    -------
    Impulses of reactions, guide couples and drives by output name, with the joint friction of the
    motion. The impulse of a driver that struck its stop is that of the stop; those of other
    drivers are zero. A stop of another pair acts on both of its links

    >>> g.start("crank", q=0.0, rate=5.0)
    >>> g.add_stop("crank", high=0.3, restitution=0.5)
    >>> mech = g.compile()
    >>> impact = mech.simulate("time=0.2").motion.impacts[0]
    >>> print(mech.impulses(impact)["crank.drive"].round(2))
    -297.21
    """
    if not isinstance(impact, Impact):
        raise refused("impact", f"got {impact!r:.60}", "give one of the impacts of a motion")
    pairs = stopped_pairs(mechanism, tuple(impact.pushes))
    method = GIVEN if impact.friction else Friction("none")
    method = replace(method, pushed=pairs.refs)
    structure = replace(mechanism.structure, elements={}, holds={})  # what lasts has no impulse
    scene = mechanism.scene.model_copy(update={"gravity": Vector(0j), "stops": {}})
    names = mechanism.names and replace(mechanism.names, loads={})
    alone = type(mechanism)(structure, scene, mechanism.name, names)
    want = [n for n in alone.outputs if n.rpartition(".")[2] in IMPULSES]
    plan = alone.outputs.plan(scene, want, method, False, quality=False)
    inputs = dict.fromkeys(plan.program.inputs, np.zeros(2))  # no rates
    blow = np.array([1.0, 0.0])  # beside it what tension of belts does without any
    jump = impact.after - impact.before
    for i, (q, qdd) in enumerate(zip(impact.q, jump, strict=True)):
        inputs |= {f"q_{i}": np.full(2, q), f"qdd_{i}": qdd * blow}
    for j, ref in enumerate(schedule(structure, scene, method).ask(input_joints)):
        inputs[f"friction_{j}"] = impact.friction.get(structure.pair_name(ref), 0.0) * blow
    for j, (name, (_, sense)) in enumerate(pairs.by_name.items()):
        inputs[f"push_{j}"] = sense * impact.pushes[name] * blow
    samples = Samples(2, inputs, np.zeros(2))
    values, engine = alone._evaluate(plan, samples, "numpy")
    settings = {"friction": method.method, "static": False}
    result = Result(alone, plan, samples, values, engine, settings)
    return {name: result[name][0] - result[name][1] for name in want}
