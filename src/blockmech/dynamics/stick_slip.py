"""What pairs with friction do between the segments of an integration: slip, stand, start again.

A segment has fixed senses of slip, those of the equation. Where one ends, `StickSlip` gives the
equation those of the next, or says why there is none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from blockmech.dynamics import ends, loads
from blockmech.dynamics.contacts import SETTLED, STILL
from blockmech.dynamics.ends import RunEnd
from blockmech.dynamics.equation import Equation
from blockmech.dynamics.events import PARTS, PER_SWING, EventFunction, friction_rules
from blockmech.dynamics.friction import Instant, Sides
from blockmech.dynamics.request import SimulationRequest
from blockmech.dynamics.sticking import JointFriction, Settled
from blockmech.dynamics.system import System
from blockmech.ground.plane import EPS
from blockmech.result.motion import Event, Slips
from blockmech.typing import Floats

SOON = 1e-6  # [s] after which a law that begins to move shows in which sense
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


@dataclass
class StickSlip:
    """Some pairs stick while others slip, see `sticking`; without friction stops alone hold.

    All pairs that have relative rates stand where the only driver does.
    """

    equation: Equation
    request: SimulationRequest
    friction: JointFriction | None = field(init=False)
    zero: Sequence[int] = ()  # pairs without relative rate when sides were settled last
    settled: float = math.nan  # [s] when that was
    holds: bool = False  # whether some of what sticks holds a freedom
    moving: Sequence[bool] = ()  # whether a pair has a relative rate that is no rounding

    def __post_init__(self) -> None:
        self.friction = self.equation.system.friction

    @property
    def silent(self) -> frozenset[str]:
        """Kinds of events that transitions keep by another name."""
        return frozenset({ends.REVERSAL} if self._lists_pairs else ())

    def rules(self) -> list[EventFunction]:
        """Where the equation of a segment ends."""
        equation = self.equation
        released = EventFunction(ends.RELEASED, self._excess, 1, parts=PARTS // 2, index=0)
        rules = [released] if self.holds else []
        if self.friction is not None and not equation.is_fixed:
            sides = [s * x for s, x in zip(equation.sides, self.moving, strict=True)]
            about = self.friction.program, sides, not self._lists_pairs
            rules += friction_rules(equation.slips, equation.pair_loads, *about)
        return rules

    def coincident_events(self, now: Now) -> Known:
        """Reversals of pairs: several may stand at once."""
        return {(ends.REVERSAL, j) for j in self.zero} if self.settled == now.t else set()

    def pushed_loose(self, now: Now) -> bool:
        """Whether loads push what sticks beyond what it holds."""
        fresh = self.settled == now.t
        return self.holds and not fresh and self._excess(now.t, now.y) > 0

    def reverse(self, now: Now, j: int) -> Iterator[Transition]:
        """Settle anew, pair j among those without relative rate.

        So are others whose rate goes through zero at the same time, within rounding of it.
        """
        at, signed = self._instant(now.t, now.y), self._rubs.signed
        change = np.abs(at.S) @ np.abs(at.unheld) + np.abs(at.b)
        turning = np.abs(at.w) <= STILL * abs(now.t) * change
        reversing = np.flatnonzero(turning & ~signed).tolist()
        return self.settle(now, tuple({*self.stuck, *reversing, j}))

    @property
    def stuck(self) -> list[int]:
        """Pairs that stick."""
        return [j for j, side in enumerate(self.equation.sides) if side == 0]

    @property
    def _lists_pairs(self) -> bool:
        """Whether pairs are told of one by one: else standstills of the driver tell of all."""
        return not self.equation.layout.scalar

    @property
    def _rubs(self) -> JointFriction:
        assert self.friction is not None
        return self.friction

    def _states(self, y: Floats) -> Floats | None:
        """States of signal blocks and of laws, None where there are none."""
        layout = self.equation.layout
        return y[layout.signals] if layout.initial else None

    def _instant(self, t: float, y: Floats, lead: float = 0.0) -> Instant:
        q, qd = map(np.atleast_1d, self.equation.motion(t, y))
        constraint = self.equation.system.against(q, qd, t, lead)
        return self._rubs.instant(q, qd, t, self._states(y), constraint)

    def _excess(self, t: float, y: Floats) -> float:
        """What loads need beyond all that pairs that stick hold, as a share of it [-]."""
        if not self.holds:
            return -1.0
        at, sides = self._instant(t, y), self.equation.sides
        if at.w[self._unheld(at, sides)].any():
            return 1.0
        return self._rubs.share(at, sides, self._rubs.respond(at, sides)) - 1.0

    def _unheld(self, at: Instant, sides: Sides) -> list[int]:
        """Pairs without slip whose laws hold nothing at rest."""
        return [j for j in self._rubs.stuck(at, sides) if not self._rubs.weights[j]]

    def _sides_soon_after(self, now: Now, at: Instant, start: Settled) -> Sides:
        """The sides; of pairs that nothing holds and that do not move yet, those soon after."""
        friction, sides = self._rubs, start.sides
        unheld = self._unheld(at, sides)
        if not unheld or friction.fixed(at, sides):
            return sides
        qdd, t = (start.response or friction.respond(at, sides)).qdd, now.t + SOON
        q, qd = at.q + SOON * (at.rate + SOON / 2 * qdd), at.rate + SOON * qdd
        constraint = self.equation.system.against(q, qd, t)
        later = friction.instant(q, qd, t, self._states(now.y), constraint)
        rise = np.abs(later.S) @ np.abs(later.unheld) + np.abs(later.b)
        u = later.S @ friction.respond(later, sides).free + later.b
        senses = np.where(np.abs(u) > SETTLED * rise, np.sign(u), 0.0)
        return tuple(int(senses[j]) if j in unheld else side for j, side in enumerate(sides))

    def _largest_tension(self, t: float, y: Floats) -> float:
        """What a stop that it lies against would have to pull with most [N m or N]."""
        stops, force = self.equation.system.contacts, self.equation.stop_force
        return max((side * force(i, t, y) for i, side in stops.items()), default=-math.inf)

    def _wait_for_release(self, now: Now) -> Iterator[Transition]:
        """Stay where nothing is free, until loads of the time push beyond what holds it."""
        system, t_last = self.equation.system, self.request.t_last
        if "state" in system.depends_on:
            return  # signals go on

        def beyond(t: float) -> float:
            return max(self._excess(t, now.y), self._largest_tension(t, now.y))

        until = time_of_release(system, beyond, now.t, t_last)
        if until is None and self.request.span == math.inf:
            end = f"{ends.END_STOP} at rest" if system.contacts else ends.REST
            yield Transition(RunEnd(end, "ended" if now.moved or system.contacts else "rest"))
            return
        yield Transition(until=t_last if until is None else until)
        if until is not None and self._excess(until, now.y) >= 0:
            yield from self.settle(Now(until, now.y, True), self.stuck, True)

    def settle(
        self, now: Now, standing: Sequence[int] = (), released: bool = False
    ) -> Iterator[Transition]:
        """Which pairs stick from here on, and in which sense others slip.

        ``standing`` have no relative rate; ``released`` as of `JointFriction.settled`
        """
        equation, system, layout = self.equation, self.equation.system, self.equation.layout
        if (friction := self.friction) is None:  # stops alone may leave no freedom
            q, qd = map(np.atleast_1d, equation.motion(now.t, now.y))
            constraint = None if system.roles else system.against(q, qd, now.t)
            equation.is_fixed = constraint is not None and not constraint.free()[0].size
            yield from self._wait_for_release(now) if equation.is_fixed else ()
            return
        at, old = self._instant(now.t, now.y, SOON), equation.sides
        if not np.isfinite(at.w).all():  # of a chart that has no pose where it should go on
            yield Transition(RunEnd(ends.IMPOSSIBLE))
            return
        self.moving = (at.S.any(axis=-1) | (at.b != 0) | (at.w != 0)).tolist()
        at = friction.turning(at, standing, now.t)
        self.zero, self.settled = friction.sticking_pairs(at, standing), now.t
        start = friction.settled(at, self.zero, released)
        if start.end:
            moved = start.end == ends.SELF_LOCKED and now.moved
            yield Transition(RunEnd(start.end, "ended" if moved else "failed"))
            return
        equation.sides = sides = self._sides_soon_after(now, at, start)
        events = []
        for j, (before, after) in enumerate(zip(old, sides, strict=False)):
            if before != after and self._lists_pairs:
                kind = ends.REVERSES if before and after else ends.SLIPS if after else ends.STICKS
                name = f"{kind} of {system.pair_name(j)}"
                events.append(Event(name, now.t, *layout.motion(now.y)))
        y = now.y.copy()
        y[layout.rate] = friction.sticking_rates(at, sides)
        self.holds = bool(friction.stuck(at, sides))
        prescribed = system.roles is not None and system.roles.prescribed
        changes = any(x.then for x in self.request.watch)  # of roles, which may set it free
        equation.is_fixed = bool(friction.fixed(at, sides)) and not prescribed and not changes
        yield Transition(None, y, None, tuple(events), (Slips(now.t, sides),))
        if equation.is_fixed and at.push.size:
            event = Event(ends.REST, now.t, *layout.motion(y))
            yield Transition(events=(event,), facts=self._facts(now, start))
        if equation.is_fixed:
            yield from self._wait_for_release(now._replace(y=y))

    def _facts(self, now: Now, start: Settled) -> dict[str, float]:
        """How firmly friction holds what rests."""
        if self._lists_pairs:
            return {"holding_share": start.share}
        holding = self._rubs.holding(now.y[:1], now.t, self._states(now.y))
        return {"holding_low": float(holding.low[0]), "holding_high": float(holding.high[0])}


def time_of_release(
    system: System, beyond: Callable[[float], float], t: float, t_last: float
) -> float | None:
    """First time [s] after t at which what loads do to a place grows positive.

    None where it does not until ``t_last``, or, if that is infinite, in a period of the loads.
    """
    structure = system.compiled.structure
    periods = loads.time_periods(structure)
    if "time" not in system.depends_on:
        return None
    from scipy.optimize import brentq

    latest = t_last if math.isfinite(t_last) else t + max(periods, default=1.0)
    part = min(periods, default=latest - t) / (2 * PER_SWING)
    a, kink = t, loads.next_time_kink(structure, t)
    while a < latest:
        b = min(a + part, kink, latest)
        if b == kink:
            kink = loads.next_time_kink(structure, kink)
        if beyond(b) > 0:
            if beyond(a) < 0:
                b = float(brentq(beyond, a, b, xtol=EPS, rtol=4 * EPS))
            late = math.ulp(b)
            while not beyond(b) > 0 and late < latest - b:  # the root is either side of it
                b, late = b + late, 2 * late
            return b
        a = b
    return None
