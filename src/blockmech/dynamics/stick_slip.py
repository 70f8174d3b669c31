"""What pairs with friction do between the segments of an integration: slip, stand, start again.

A segment has fixed senses of slip, those of the equation. Where one ends, `Frictionless`,
`OneDriver` or `SeveralDrivers` gives the equation those of the next, or says why there is none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.equation import Equation
from blockmech.dynamics.events import EventFunction, friction_rules, release_rule
from blockmech.dynamics.friction import JointFriction
from blockmech.dynamics.request import SimulationRequest
from blockmech.dynamics.rest import first_beyond
from blockmech.dynamics.run import RunEnd
from blockmech.dynamics.sticking import SeveralFriction
from blockmech.motion import Event, Floats, Slips
from blockmech.plane import EPS

SOON = 1e-6  # [s] after which a law that begins to move shows in which sense
WITHIN = 4 * EPS  # [-] of a time, to which an event is found in it
Known = set[tuple[str, int]]  # events at a place, by kind and index


class Now(NamedTuple):
    """Where a run is."""

    t: float  # [s]
    y: Floats
    moved: bool  # since its start


class Transition(NamedTuple):
    """What becomes of a run between two segments."""

    end: RunEnd | None = None
    y: Floats | None = None  # the state to go on with, where it is another one
    until: float | None = None  # [s] all stands still until then
    events: tuple[Event, ...] = ()
    slips: tuple[Slips, ...] = ()
    facts: dict[str, float] = {}

    def then(self, later: Transition) -> Transition:
        """Both, one after the other."""
        y = self.y if later.y is None else later.y
        until = self.until if later.until is None else later.until
        events, slips = self.events + later.events, self.slips + later.slips
        return Transition(later.end, y, until, events, slips, self.facts | later.facts)


@dataclass
class Frictionless:
    """No pair has friction."""

    equation: Equation
    request: SimulationRequest

    silent = frozenset[str]()  # kinds of events that transitions keep by another name

    def begin(self, now: Now) -> Transition:
        """Give the senses of slip with which the motion starts."""
        return Transition()

    def rules(self) -> list[EventFunction]:
        """Where the equation of a segment ends."""
        return []

    def known(self, now: Now) -> Known:
        """Events that are at this very place, and are none of the segment that begins."""
        return set()

    def pushed_loose(self, now: Now) -> bool:
        """Whether loads push what stands beyond what friction holds."""
        return False

    def reverse(self, now: Now, j: int) -> Transition:
        """Go on where the relative rate of pair j is zero."""
        return Transition()

    def carried(self, now: Now) -> Transition:
        """Go on where a law of motion begins or ends to move pairs."""
        return Transition()

    def stand(self, now: Now, short: bool) -> Transition:
        """Go on from a standstill, after a swing that was too ``short`` to be one or not."""
        return Transition(RunEnd(ends.REST) if short else None)

    def release(self, now: Now) -> Transition:
        """Start what friction held, in the sense in which it is pushed."""
        return Transition()

    def _excess(self, t: float, y: Floats) -> float:
        """By how much the loads push beyond what joint friction holds at rest."""
        return -math.inf

    def _beyond(self, now: Now) -> float | None:
        """When loads of the time push beyond that, see `first_beyond`."""
        system, t_last = self.equation.system, self.request.t_last
        return first_beyond(system, lambda t: self._excess(t, now.y), now.t, t_last)

    def _states(self, y: Floats) -> Floats | None:
        """States of signal blocks and of laws, None where there are none."""
        layout = self.equation.layout
        return y[layout.signals] if layout.initial else None

    def _stays(self, now: Now, until: float | None) -> Transition:
        """Stand still until loads start it, to the end of the run if they never do."""
        if until is None and self.request.span == math.inf:
            return Transition(RunEnd(ends.REST, "ended" if now.moved else "rest"))
        return Transition(until=self.request.t_last if until is None else until)


@dataclass
class OneDriver(Frictionless):
    """All pairs stand where the driver stands."""

    friction: JointFriction
    rests: bool = False  # while signals go on, which may start it again

    def begin(self, now: Now) -> Transition:
        """Give the senses of slip with which the motion starts."""
        if self.equation.held:  # by a stop
            return Transition(slips=self._standing(now))
        if now.y[1] == 0.0:
            return self._from_rest(now)
        self.equation.sides = self._sides(now.y)
        return Transition(slips=self._slipping(now.t))

    def rules(self) -> list[EventFunction]:
        """Where the equation of a segment ends."""
        if self.rests:
            return [release_rule(self._excess)]
        own, equation = self.friction.program, self.equation
        return friction_rules(equation.slips, equation.pair_loads, own.guides, own.remembers, ())

    def known(self, now: Now) -> Known:
        """Reversals of pairs: several may reverse at once."""
        remembers = self.friction.program.remembers
        kinds = [ends.DEFLECTION_KINK if own else ends.REVERSAL for own in remembers]
        return {(kinds[j], j) for j in self.friction.reversing(float(now.y[0]))}

    def pushed_loose(self, now: Now) -> bool:
        """Whether loads push the driver beyond what friction holds."""
        return self.rests and self._excess(now.t, now.y) > 0

    def reverse(self, now: Now, j: int) -> Transition:
        """Turn pair j, and whatever pairs reverse at the same place."""
        old, beyond = self.equation.sides[j], self._sides(now.y)
        self.equation.sides = tuple(-old if i == j else side for i, side in enumerate(beyond))
        return Transition(slips=self._slipping(now.t))

    def stand(self, now: Now, short: bool) -> Transition:
        """Go on from a standstill."""
        return self._from_rest(now)

    def release(self, now: Now) -> Transition:
        """Start the driver, in the sense in which it is pushed."""
        rest = self.friction.rest(float(now.y[0]), now.t, self._states(now.y))
        if rest.ambiguous:
            return Transition(RunEnd(ends.AMBIGUOUS, "failed"))
        self.rests = self.equation.held = False
        self._start(now.y, rest.holding)
        return Transition(slips=self._slipping(now.t))

    def _standing(self, now: Now) -> tuple[Slips, ...]:
        """What a motion keeps of the pairs while the driver stands."""
        sides = self.friction.senses(np.zeros(len(self.friction.names)))
        return (Slips(now.t, tuple(map(int, sides))),)

    def _slipping(self, t: float) -> tuple[Slips, ...]:
        """What a motion keeps of the pairs while it moves."""
        return (Slips(t, self.equation.sides),)

    def _from_rest(self, now: Now) -> Transition:
        """Which way a driver at rest starts; what ends the run if it does not."""
        q, system = float(now.y[0]), self.equation.system
        rest = self.friction.rest(q, now.t, self._states(now.y))
        low, high = holding = rest.holding
        if rest.ambiguous:
            return Transition(RunEnd(ends.AMBIGUOUS, "failed"))
        stays, begin = Transition(), now.t
        if rest.rests:
            event, facts = (
                Event(ends.REST, now.t, q, 0.0),
                {"holding_low": low, "holding_high": high},
            )
            stays = Transition(events=(event,), slips=self._standing(now), facts=facts)
            if "state" in system.depends_on:
                self.rests = self.equation.held = True
                return stays
            until = self._beyond(now)
            stays = stays.then(self._stays(now, until))
            if until is None:
                return stays
            begin, after = until, math.nextafter(until, math.inf)
            holding = self.friction.rest(q, after).holding
        self._start(now.y, holding)
        return stays.then(Transition(slips=self._slipping(begin)))

    def _start(self, y: Floats, holding: tuple[float, float]) -> None:
        low, high = holding
        self.equation.sides = self.friction.sides(float(y[0]), 1 if -high >= low else -1)

    def _sides(self, y: Floats) -> tuple[int, ...]:
        return self.friction.sides(float(y[0]), 1 if y[1] > 0 else -1)

    def _excess(self, t: float, y: Floats) -> float:
        """By how much [N m or N] the loads push beyond what joint friction holds at rest."""
        low, high = self.friction.rest(float(y[0]), t, self._states(y)).holding
        return max(low, -high)


@dataclass
class SeveralDrivers(Frictionless):
    """Some pairs stick while others slip, see `sticking`."""

    friction: SeveralFriction
    zero: Sequence[int] = ()  # pairs without relative rate when sides were settled last
    settled: float = field(default=math.nan)  # [s] when that was

    silent = frozenset({ends.REVERSAL})

    def begin(self, now: Now) -> Transition:
        """Give the senses of slip with which the motion starts."""
        return self._settle(now, ())

    def rules(self) -> list[EventFunction]:
        """Where the equation of a segment ends."""
        own, equation = self.friction.program, self.equation
        about = own.guides, own.remembers, equation.sides
        rules = friction_rules(equation.relative_rates, equation.pair_loads, *about)
        return rules + ([release_rule(self._excess)] if self._stuck else [])

    def known(self, now: Now) -> Known:
        """Reversals of pairs: several may stand at once."""
        return {(ends.REVERSAL, j) for j in self.zero} if self.settled == now.t else set()

    def pushed_loose(self, now: Now) -> bool:
        """Whether loads push what sticks beyond what it holds."""
        fresh = self.settled == now.t
        return bool(self._stuck) and not fresh and self._excess(now.t, now.y) > 0

    def reverse(self, now: Now, j: int) -> Transition:
        """Settle anew, pair j among those without relative rate.

        So are others whose rate goes through zero at the same time, within rounding of it.
        """
        at, sides = self._instant(now.t, now.y), self.equation.sides
        change = at.S @ self.friction.respond(at, sides).qdd + at.b
        turning = np.abs(at.w) <= WITHIN * abs(now.t) * np.abs(change)
        others = np.flatnonzero(turning & ~self.friction.signed).tolist()
        return self._settle(now, tuple({*self._stuck, *others, j}))

    def carried(self, now: Now) -> Transition:
        """Settle anew where a law of motion begins or ends to move pairs."""
        return self._settle(now, tuple(self._stuck))

    def release(self, now: Now) -> Transition:
        """Settle anew: what stuck is pushed beyond what it holds."""
        return self._settle(now, self._stuck, True)

    @property
    def _stuck(self) -> list[int]:
        return [j for j, side in enumerate(self.equation.sides) if side == 0]

    def _instant(self, t: float, y: Floats, lead: float = 0.0) -> Any:
        q, qd = self.equation.motion(t, y)
        held = self.equation.system.against(q, qd, t, lead)
        return self.friction.instant(q, qd, t, self._states(y), held)

    def _excess(self, t: float, y: Floats) -> float:
        """What loads need beyond all that pairs that stick hold, as a share of it [-]."""
        at, sides = self._instant(t, y), self.equation.sides
        return self.friction.share(at, sides, self.friction.respond(at, sides)) - 1.0

    def _settle(self, now: Now, standing: Sequence[int], released: bool = False) -> Transition:
        """Which pairs stick from here on, and in which sense others slip."""
        friction, system, layout = self.friction, self.equation.system, self.equation.layout
        at, old = self._instant(now.t, now.y, SOON), self.equation.sides
        self.zero, self.settled = friction.without_slip(at, standing), now.t
        found = friction.settled(at, friction.sides_at(at, self.zero), self.zero, released)
        if found.end:
            moved = found.end == ends.SELF_LOCKED and now.moved
            return Transition(RunEnd(found.end, "ended" if moved else "failed"))
        self.equation.sides = sides = found.sides
        events = []
        for j, (before, after) in enumerate(zip(old, sides, strict=False)):
            if before != after:
                kind = ends.REVERSES if before and after else ends.SLIPS if after else ends.STICKS
                name = f"{kind} of {system.pair_name(j)}"
                events.append(Event(name, now.t, *layout.motion(now.y)))
        y = now.y.copy()
        y[layout.rate] = friction.kept(at, sides)
        goes = Transition(None, y, None, tuple(events), (Slips(now.t, sides),))
        if not friction.holds_all(at, sides) or (system.roles and system.roles.prescribed):
            return goes
        facts = {"holding_share": found.share}
        rest = Transition(events=(Event(ends.REST, now.t, *layout.motion(y)),), facts=facts)
        return goes.then(rest).then(self._held(now._replace(y=y)))

    def _held(self, now: Now) -> Transition:
        """Stay where all pairs stick, until loads of the time push beyond what they hold."""
        system = self.equation.system
        if "state" in system.depends_on or (system.held and "time" in system.depends_on):
            return Transition()  # signals go on, or a stop lets go before
        until = self._beyond(now)
        stays = self._stays(now, until)
        return stays if until is None else stays.then(self.release(Now(until, now.y, True)))


def stick_slip(equation: Equation, request: SimulationRequest) -> Frictionless:
    """What the pairs of a system do between segments."""
    friction = equation.system.friction
    if friction is None:
        return Frictionless(equation, request)
    if isinstance(friction, SeveralFriction):
        return SeveralDrivers(equation, request, friction)
    return OneDriver(equation, request, friction)
