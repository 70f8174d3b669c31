r"""Impacts at end stops: a chain of motions, each from one blow to the next.

Newton's law of restitution at the stop of driver i, e its restitution, n the unit row of i:

    q'_i after = -e q'_i before
    dq' = -(1 + e) q'_i M^-1 n / (n M^-1 n),    impulse P = -(1 + e) q'_i / (n M^-1 n)
    loss (1 - e^2) q'_i^2 / (2 n M^-1 n)

Whatever method computes the motion ends it at the stop, the next one starts there with the
rates after. Ever lower bounces are a geometric series once the effort no longer changes over
one: from a height on that is below the accuracy they are closed by their sum, and the driver
lies against its stop as long as the loads push it there.

The impulses in all joints are what the force pass says of the velocity jumps in place of the
accelerations, all else left out (`impulses`).

Sources: Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996, ch. 8; Brach,
Mechanical Impact Dynamics, 1991.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.estimate import TARGET
from blockmech.dynamics.motion import Event, Floats, Impact, Lying, Motion, State, Track
from blockmech.dynamics.request import SimulationRequest, Start, Until
from blockmech.dynamics.rest import first_beyond
from blockmech.dynamics.stops import Stop
from blockmech.errors import refused
from blockmech.loads import Motor, Thrust
from blockmech.loads.contract import Element
from blockmech.model.structure import COORDINATE, JointRef, MarkerRef, Structure
from blockmech.typing import FrictionMethod
from blockmech.values import Marker, Place, Vector, split_address

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.dynamics.system import System
    from blockmech.result import Result

Move: TypeAlias = Callable[["System", SimulationRequest], Motion]
LOW = 0.1  # of the accuracy: the height of a bounce from which on they are summed up
IMPULSES = ("reaction", "N", "C", "drive")  # outputs whose impulses are asked for
STRUCK = "/stop"  # name of what no user can name
MOST = 10_000  # flights of a run
RUBS = "joint friction is left out during impacts: the slips reverse in them"
SUDDEN = 1e12  # by which velocity jumps outweigh what lasts, where both are in one pass


@dataclass(frozen=True)
class Chain:
    """Dense output of motions one after the other; at a blow the rates after it."""

    begins: Floats
    tracks: tuple[Track, ...]

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        q, qd = zip(*self._on_legs(t, lambda track, at: track.state(at)), strict=True)
        return State(np.concatenate(q), np.concatenate(qd))

    def signal_states(self, t: Floats) -> Floats:
        """States (m, n) of signal blocks at times (m,) [s]; a blow leaves them as they are."""
        return np.concatenate(list(self._on_legs(t, lambda track, at: track.signal_states(at))))

    def _on_legs(self, t: Floats, read: Callable[[Any, Floats], Any]) -> Iterator[Any]:
        """What is read of the tracks at times (m,) [s], in their order: leg by leg."""
        leg = np.clip(np.searchsorted(self.begins, t, "right") - 1, 0, len(self.tracks) - 1)
        runs = np.flatnonzero(np.diff(leg)) + 1
        for at, k in zip(np.split(t, runs), leg[[0, *runs]], strict=True):
            yield read(self.tracks[k], at)


@dataclass
class Bounces:
    """A motion between stops that let it bounce, under way."""

    system: System
    request: SimulationRequest
    move: Move
    legs: list[Motion] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    impacts: list[Impact] = field(default_factory=list)
    facts: dict[str, float] = field(default_factory=dict)
    held: dict[int, int] = field(default_factory=dict)
    since: dict[int, float] = field(default_factory=dict)  # [s] that they lie
    lying: list[Lying] = field(default_factory=list)
    flights: float = 0.0  # [s] sum of those to come
    apex: float = math.inf
    height: float = 0.0  # [rad or m] of the flight to come
    unseen: float = 0.0  # of those that were summed up

    def run(self) -> Motion:
        """Go on from blow to blow."""
        at = self.request
        while True:
            leg = self._leg(at)
            self.legs.append(leg)
            where = self._stop_of(leg)
            self.events += [e for e in leg.events if not (where and e.kind == leg.end)]
            if leg.end == ends.LEAVES_STOP:
                after = self._released(leg)
            elif where is not None and len(self.legs) < MOST:
                after = self._struck(leg, *where)
            else:
                return self._whole()
            left = self._left(leg)
            if left is None:
                self.legs[-1] = replace(leg, end="time", status="reached")
                return self._whole(after)
            q = leg.q_end if len(self.system.drivers) > 1 else float(np.asarray(leg.q_end))
            at = replace(at, start=Start(q, after, leg.t_end), until=left, apex=self.apex)
            times = tuple(t for t in at.times if t > leg.t_end)
            at = replace(at, times=times, switched=leg.switched)

    def _leg(self, request: SimulationRequest) -> Motion:
        begin = self.legs[-1].x_end if self.legs else ()
        if self.held and len(self.system.drivers) == 1:
            if not begin:
                return self._lying(request)
            (way,), (q, _, t) = self.held.values(), request.start
            push = self.system.one_of(q, 0.0, t, begin, 0.0)[0].tau
            self.facts["contact"] = -float(push) / self._stop(0, way).slope
        if begin or dict(self.system.held) != self.held:
            self.system = replace(self.system, held=dict(self.held), begin=begin)
        return self.move(self.system, request)

    def _stop_of(self, leg: Motion) -> tuple[int, int] | None:
        """Number of the driver whose stop ended a motion, and which one; None for no bounce."""
        if not leg.end.startswith(ends.END_STOP):
            return None
        driver = leg.end.partition(" of ")[2] or self.system.drivers[0]
        i = self.system.drivers.index(driver)
        low, high = self.system.stops[i]
        q = float(np.atleast_1d(leg.q_end)[i])
        way = 1 if abs(q - high) < abs(q - low) else -1
        return None if self._stop(i, way).restitution is None else (i, way)

    def _stop(self, i: int, way: int) -> Stop:
        """The highest or lowest stop of a driver."""
        stop: Stop = self.request.stops[i][way > 0]
        return stop

    def _left(self, leg: Motion) -> Until | None:
        """What still ends the run; None where its time is over."""
        until, t0 = self.request.until, self.request.start.t
        if until.goal == "swings":
            stood = sum(e.kind == ends.STANDSTILL for e in self.events)
            return replace(until, value=until.value - stood)
        if until.goal != "time":
            return until
        left = until.value - (leg.t_end - t0)
        return replace(until, value=left) if left > 0 else None

    # -- at a stop ------------------------------------------------------------------------

    def _matrix(self, q: Floats, rate: Floats, t: float) -> tuple[Floats, Floats]:
        """Inertia (k, k), and efforts (k,) less what the rates take."""
        x = self.legs[-1].x_end or None
        if len(q) > 1:
            M, c, Q, _ = self.system.terms_of(q, rate, t, x)[0]
            return M, Q - c
        J, tau, dJ, _ = self.system.one_of(float(q[0]), float(rate[0]), t, x)[0]
        return np.array([[J]]), np.array([tau - 0.5 * dJ * rate[0] ** 2])

    def _struck(self, leg: Motion, i: int, way: int) -> Any:
        """The rates after a blow."""
        q, before = (np.array(np.atleast_1d(x), dtype=float) for x in (leg.q_end, leg.qd_end))
        q[i] = self.system.stops[i][way > 0]
        stop = self._stop(i, way)
        e = stop.restitution
        assert e is not None
        M, _ = self._matrix(q, before, leg.t_end)
        row = np.linalg.inv(self._free(M))[:, i]
        speed = float(before[i])
        impulse = -(1 + e) * speed / row[i]
        after = before + impulse * row
        after[i] = -e * speed if e else 0.0
        low, more = self._is_low(q, after, leg.t_end, i, way, e)
        if low:
            self.unseen += self.height
            impulse += more
            after = before - speed * row / row[i]
            after[i], e = 0.0, 0.0
            self.held[i] = way
            self._lies(leg, i, before)
        if speed:
            loss = (1 - e * e) * speed**2 / (2 * row[i])
            along = float(impulse) / stop.slope
            impact = Impact(leg.t_end, stop.name, q, before, after, along, float(loss))
            self.impacts.append(impact)
            self.events.append(Event(ends.IMPACT, leg.t_end, self._plain(q), self._plain(after)))
        self.legs[-1] = replace(leg, q_end=self._plain(q), qd_end=self._plain(after))
        return self._plain(after)

    def _free(self, M: Floats) -> Floats:
        """The inertia with drivers that lie against stops as if they were very heavy."""
        heavy = np.array(M)
        for j in self.held:
            heavy[j, :] = heavy[:, j] = 0.0
            heavy[j, j] = 1.0
        return heavy

    def _is_low(
        self, q: Floats, after: Floats, t: float, i: int, way: int, e: float
    ) -> tuple[bool, float]:
        """Whether all bounces to come are too low to be seen, and their impulses' sum."""
        M, Q = self._matrix(q, after, t)
        push = way * float(np.linalg.solve(self._free(M), Q)[i])
        speed = abs(float(after[i]))
        self.apex = math.inf
        if not push > 0:
            return (speed == 0.0 and push == 0), 0.0
        target = self.request.accuracy or TARGET
        flight, self.height = 2 * speed / push, speed * speed / (2 * push)
        if e == 1.0:
            self.apex = t + flight / 2
            return False, 0.0
        self.flights, self.apex = flight / (1 - e), t + flight / 2
        mass = 1 / float(np.linalg.inv(self._free(M))[i, i])
        total = -way * mass * speed * (1 + e) / (1 - e)
        return self.height <= LOW * target, total

    def _lies(self, leg: Motion, i: int, before: Floats) -> None:
        """A driver comes to rest against its stop."""
        t = leg.t_end + (self.flights if before[i] else 0.0)
        self.facts["rest_time"] = t
        self.since[i] = leg.t_end
        self.events.append(Event(ends.REST, t, leg.q_end, 0 * np.asarray(before)))

    def _lying(self, request: SimulationRequest) -> Motion:
        """The only driver lies against its stop until the loads let it go, or the run ends."""
        (way,), system = self.held.values(), self.system
        stop = self._stop(0, way)
        q, _, t = request.start

        def away(s: float) -> float:
            return -way * float(system.one(q, 0.0, s).tau)

        self.facts["contact"] = away(t) * way / stop.slope
        t_last = t + request.span
        until, _ = first_beyond(system, away, t, t_last)
        still = replace(request.standing, method=self.legs[0].method, regime=ends.REST)
        if until is not None:
            late = math.ulp(until)
            while not away(until) > 0 and late < t_last - until:  # the root is either side of it
                until, late = until + late, 2 * late
            return replace(still, t_end=until, end=ends.LEAVES_STOP, status="ended")
        if math.isfinite(t_last):
            return replace(still, t_end=t_last, end="time")
        return replace(still, end=ends.END_STOP + " at rest", status="ended")

    def _released(self, leg: Motion) -> Any:
        """A driver leaves the stop that it lay against: the one that is pushed away most."""
        q, rate = (np.array(np.atleast_1d(x), dtype=float) for x in (leg.q_end, leg.qd_end))
        if len(q) > 1:
            M, Q = self._matrix(q, rate, leg.t_end)
            force = M @ self.system.accelerations(M, Q) - Q
            i = max(self.held, key=lambda j: self.held[j] * force[j])
        else:
            (i,) = self.held
        del self.held[i]
        self.lying.append(Lying(i, self.since.pop(i), leg.t_end))
        if len(q) > 1:
            self.system = replace(self.system, held=dict(self.held))
        self.events = [e for e in self.events if e.kind != ends.LEAVES_STOP]
        self.events.append(Event(ends.LEAVES_STOP, leg.t_end, leg.q_end, leg.qd_end))
        return leg.qd_end

    def _plain(self, x: Floats) -> Any:
        return float(x[0]) if len(x) == 1 else x

    # -- the whole ------------------------------------------------------------------------

    def _whole(self, rates: Any = None) -> Motion:
        last, legs = self.legs[-1], self.legs
        if len(legs) == 1 and not self.impacts:
            return last
        moving = [leg for leg in legs if leg.t_end > leg.t_start] or legs[-1:]
        facts = {**last.facts, **self.facts}
        rubbed = [leg.facts["friction_work"] for leg in legs if "friction_work" in leg.facts]
        if rubbed:
            facts["friction_work"] = math.fsum(rubbed)
        facts.pop("energy_balance", None)
        facts["impacts"] = float(len(self.impacts))
        facts["impact_loss"] = math.fsum(i.loss for i in self.impacts)
        notes = dict.fromkeys(note for leg in legs for note in leg.notes)
        reverse = any(len(i.q) > 1 or (i.before * i.after < 0).any() for i in self.impacts)
        if self.system.friction is not None and reverse:
            notes[RUBS] = None
        return replace(
            last,
            method=legs[0].method,
            why=legs[0].why,
            regime="with impacts",
            t_start=self.request.start.t,
            qd_end=last.qd_end if rates is None else rates,
            track=Chain(np.array([leg.t_start for leg in moving]), tuple(x.track for x in moving)),
            events=tuple(sorted(self.events, key=lambda e: e.t)),
            impacts=tuple(self.impacts),
            slips=tuple(s for leg in legs for s in leg.slips),
            lying=(*self.lying, *(Lying(i, t, last.t_end) for i, t in self.since.items())),
            error=math.fsum(leg.error for leg in legs) + self.unseen,
            cost=self.system.cost,
            notes=tuple(notes),
            facts=facts,
        )


def bounced(system: System, request: SimulationRequest, move: Move) -> Motion:
    """The motion between end stops of which some let it bounce; ``move`` goes on to the next.

    Raises `RequestError` for goals that say nothing across a blow.
    """
    goal = request.until.goal
    if goal in ("turns", "steady"):
        remedy = 'ask for "time=<s>", or leave the restitution out'
        raise refused("until", f'"{goal}" with end stops that let it bounce', remedy, code="until")
    return Bounces(system, request, move).run()


def impulses(mechanism: Compiled, impact: Impact) -> dict[str, Any]:
    """What a blow does to every joint: impulses [N s], moments of them [N m s], by output name.

    Parameters
    ----------
    impact : one of `Motion.impacts`

    Returns
    -------
    reactions, guide couples and driving impulses under the names of the outputs; that of the
    driver whose stop was struck is the stop's, the others are nothing. The stop of another pair
    strikes both of its links. Joint friction follows the impulses where a blow takes all of the
    only driver's rate, for then no slip reverses in it; else it is left out
    """
    bare = replace(mechanism.structure, elements={}, holds={})
    at, jump, none = (
        dict(zip(mechanism.drivers, map(float, row), strict=True))
        for row in (impact.q, impact.after - impact.before, 0 * impact.q)
    )

    def run(
        structure: Structure,
        accelerations: Mapping[str, float],
        rates: Mapping[str, float] = none,
        friction: FrictionMethod = "none",
    ) -> Result:
        scene = mechanism.scene.model_copy(update={"gravity": Vector(0j), "stops": {}})
        names = mechanism.names and replace(mechanism.names, loads={})
        alone = type(mechanism)(structure, scene, mechanism.name, names)
        want = [n for n in alone.outputs if n.rpartition(".")[2] in IMPULSES]
        return alone.run(
            at=at, rates=rates, accelerations=accelerations, want=want, friction=friction
        )

    moved, tensioned = run(bare, jump), run(bare, none)
    reactions = {name: moved[name][0] - tensioned[name][0] for name in moved.plan.want}
    if impact.driver in mechanism.drivers:
        if len(impact.q) > 1 or impact.after[0] or not mechanism.frictional_joints:
            return reactions
        before = {impact.driver: float(impact.before[0])}
        sudden = {driver: SUDDEN * x for driver, x in jump.items()}
        rubbed = run(bare, sudden, before, "newton")
        return {name: rubbed[name][0] / SUDDEN for name in reactions}
    struck = run(_struck_at(mechanism, bare, impact.driver), none)
    (driver,) = mechanism.drivers
    drive = mechanism.of_driver(driver, "drive")
    unit = {name: struck[name][0] - tensioned[name][0] for name in reactions}
    size = -reactions[drive] / unit[drive]  # of the impulse that leaves nothing to the driver
    return {name: x + size * unit[name] for name, x in reactions.items()}


def _struck_at(mechanism: Compiled, structure: Structure, coordinate: str) -> Structure:
    """A structure with a unit load along the coordinate of a pair, on both of its links."""
    pair = coordinate.removesuffix(f".{COORDINATE}")
    ref = JointRef(*split_address(pair, structure.blocks))
    if mechanism.names is not None:
        ref = mechanism.names.joints[pair.partition(".")[2]].joint
    joint, block = structure.joint(ref), structure.blocks[ref.block]
    ends = structure.earlier_link(ref), structure.later_link(ref)
    if joint.driven:
        return structure
    if joint.rotary:
        load: Element = Motor(law={"kind": "constant", "value": 1.0})
        at = tuple(MarkerRef(*link, link.link) for link in ends)
    else:
        links = block.links_or_default()
        own = [e.link for e in ends if e.block == ref.block]
        lines = {link: block.guide_line(joint.name, link) for link in own}
        for link in own:
            place, along = lines[link]
            place = block.slider_place(joint.name, link) if link == joint.later else place
            here = Marker.model_construct(at=Place(place), angle=None, dir=Vector(along))
            marked = {**links[link].markers, STRUCK: here}
            links[link] = links[link].model_copy(update={"markers": marked})
        changed = block.model_copy(update={"links": links})
        structure = replace(structure, blocks={**structure.blocks, ref.block: changed})
        at = tuple(MarkerRef(*link, STRUCK) for link in ends)
        if joint.outer:
            at = structure.feeds[ref], at[1]
        guide = structure.marker(at[0])
        along = guide.direction if isinstance(guide, Marker) else 1 + 0j
        load = Thrust(law={"kind": "constant", "value": 1.0}, direction=(along.real, along.imag))
    holds = dict(zip((JointRef(STRUCK, "a"), JointRef(STRUCK, "b")), at, strict=True))
    return replace(structure, elements={STRUCK: load}, holds=holds)
