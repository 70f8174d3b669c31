"""What pairs with friction do between the segments of an integration: slip, stand, start again.

A segment has fixed senses of slip, those of the equation. Where one ends, the equation gets those
of the next, or the run is over.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from blockmech.dynamics import ends, loads
from blockmech.dynamics.contacts import INSTANT, SETTLED, STILL
from blockmech.dynamics.ends import RunEnd
from blockmech.dynamics.equation import Equation
from blockmech.dynamics.events import PARTS, PER_SWING, EventFunction, friction_rules
from blockmech.dynamics.friction import Instant, Sides
from blockmech.dynamics.layout import StateLayout
from blockmech.dynamics.run import Run
from blockmech.dynamics.sticking import JointFriction, Settled
from blockmech.dynamics.system import System
from blockmech.engines.dense import Dense
from blockmech.ground.plane import EPS
from blockmech.result.motion import Slips
from blockmech.typing import Floats


@dataclass
class StickSlip(Run):
    """A run by an equation in time, of which some pairs stick while others slip, see `sticking`.

    Without friction stops alone hold. All pairs that have relative rates stand where the only
    driver does, which tells of all; with several drivers they are told of one by one.

    Attributes
    ----------
    zero : pairs without relative rate when sides were settled last, ``settled`` [s] is when
    moving : whether a pair has a relative rate that is no rounding
    """

    equation: Equation = field(init=False)
    layout: StateLayout = field(init=False)
    y: Floats = field(init=False)
    pieces: list[Dense] = field(init=False, default_factory=list)
    zero: Sequence[int] = field(init=False, default=())
    settled: float = field(init=False, default=math.nan)
    moving: Sequence[bool] = field(init=False, default=())
    slips: list[Slips] = field(init=False, default_factory=list)

    @abstractmethod
    def wait(self, until: float) -> RunEnd | None:
        """Stand still until a time [s]; why the run is over where a user's event ends it before."""

    def pair_rules(self) -> list[EventFunction]:
        """Where pairs with friction end the equation of a segment."""
        equation, friction = self.equation, self.system.friction
        released = EventFunction(ends.RELEASED, self.excess, 1, parts=PARTS // 2, index=0)
        rules = [released] if equation.holds else []
        if friction is not None and not equation.is_fixed:
            sides = [s * x for s, x in zip(equation.sides, self.moving, strict=True)]
            about = friction.program, sides, self.layout.scalar
            rules += friction_rules(equation.slips, equation.pair_loads, *about)
        return rules

    def reverse(self, j: int) -> RunEnd | None:
        """Settle anew, pair j among those without relative rate.

        So are others whose rate goes through zero at the same time, within rounding of it.
        """
        at, signed = self._instant(self.t, self.y), self._rubs.signed
        change = np.abs(at.S) @ np.abs(at.unheld) + np.abs(at.b)
        turning = np.abs(at.w) <= STILL * abs(self.t) * change
        reversing = np.flatnonzero(turning & ~signed).tolist()
        return self.settle(tuple({*self.stuck, *reversing, j}))

    @property
    def stuck(self) -> list[int]:
        """Pairs that stick."""
        return [j for j, side in enumerate(self.equation.sides) if side == 0]

    @property
    def _rubs(self) -> JointFriction:
        assert self.system.friction is not None
        return self.system.friction

    def _instant(self, t: float, y: Floats, lead: float = 0.0) -> Instant:
        q, qd = map(np.atleast_1d, self.equation.motion(t, y))
        constraint = self.system.against(q, qd, t, lead)
        return self._rubs.instant(q, qd, t, self.layout.states(y), constraint)

    def excess(self, t: float, y: Floats) -> float:
        """What loads need beyond all that pairs that stick hold, as a share of it [-]."""
        if not self.equation.holds:
            return -1.0
        at, sides = self._instant(t, y), self.equation.sides
        if at.w[self._unheld(at, sides)].any():
            return 1.0
        return self._rubs.share(at, sides, self._rubs.respond(at, sides)) - 1.0

    def _unheld(self, at: Instant, sides: Sides) -> list[int]:
        """Pairs without slip whose laws hold nothing at rest."""
        return [j for j in self._rubs.stuck(at, sides) if not self._rubs.weights[j]]

    def _sides_soon_after(self, at: Instant, start: Settled) -> Sides:
        """The sides; of pairs that nothing holds and that do not move yet, those soon after."""
        friction, sides = self._rubs, start.sides
        unheld = self._unheld(at, sides)
        if not unheld or friction.fixed(at, sides):
            return sides
        qdd, t = (start.response or friction.respond(at, sides)).qdd, self.t + INSTANT
        q, qd = at.q + INSTANT * (at.rate + INSTANT / 2 * qdd), at.rate + INSTANT * qdd
        constraint = self.system.against(q, qd, t)
        later = friction.instant(q, qd, t, self.layout.states(self.y), constraint)
        rise = np.abs(later.S) @ np.abs(later.unheld) + np.abs(later.b)
        u = later.S @ friction.respond(later, sides).free + later.b
        senses = np.where(np.abs(u) > SETTLED * rise, np.sign(u), 0.0)
        return tuple(int(senses[j]) if j in unheld else side for j, side in enumerate(sides))

    def _wait_for_release(self) -> RunEnd | None:
        """Stay where nothing is free, until loads of the time push beyond what holds it."""
        system, t_last, y = self.system, self.request.t_last, self.y
        if "state" in system.depends_on:
            return None  # signals go on

        def beyond(t: float) -> float:
            pulls = (x * self.equation.stop_force(i, t, y) for i, x in system.contacts.items())
            return max([self.excess(t, y), *pulls])

        until = time_of_release(system, beyond, self.t, t_last)
        if until is None and self.request.span == math.inf:
            end = f"{ends.END_STOP} at rest" if system.contacts else ends.REST
            return RunEnd(end, "ended" if self.pieces or system.contacts else "rest")
        if (over := self.wait(t_last if until is None else until)) is not None:
            return over
        loose = until is not None and self.excess(until, y) >= 0
        return self.settle(self.stuck, True) if loose else None

    def settle(self, standing: Sequence[int] = (), released: bool = False) -> RunEnd | None:
        """Which pairs stick from here on, and in which sense others slip.

        ``standing`` have no relative rate; ``released`` as of `JointFriction.settled`
        """
        equation, system, layout = self.equation, self.system, self.layout
        if (friction := system.friction) is None:  # stops alone may leave no freedom
            q, qd = map(np.atleast_1d, equation.motion(self.t, self.y))
            constraint = None if system.roles else system.against(q, qd, self.t)
            equation.is_fixed = constraint is not None and not constraint.free()[0].size
            return self._wait_for_release() if equation.is_fixed else None
        at, old = self._instant(self.t, self.y, INSTANT), equation.sides
        if not np.isfinite(at.w).all():  # of a chart that has no pose where it should go on
            return RunEnd(ends.IMPOSSIBLE)
        self.moving = (at.S.any(axis=-1) | (at.b != 0) | (at.w != 0)).tolist()
        at = friction.turning(at, standing, self.t)
        self.zero, self.settled = friction.sticking_pairs(at, standing), self.t
        start = friction.settled(at, self.zero, released)
        if start.end:
            moved = start.end == ends.SELF_LOCKED and self.pieces
            return RunEnd(start.end, "ended" if moved else "failed")
        equation.sides = sides = self._sides_soon_after(at, start)
        for j, (before, after) in enumerate(zip(old, sides, strict=False)):
            if before != after and not layout.scalar:
                kind = ends.REVERSES if before and after else ends.SLIPS if after else ends.STICKS
                self.happened(f"{kind} of {system.pair_name(j)}", *layout.motion(self.y))
        self.y = self.y.copy()
        self.y[layout.rate] = friction.sticking_rates(at, sides)
        equation.holds = bool(friction.stuck(at, sides))
        prescribed = system.roles is not None and system.roles.prescribed
        changes = any(x.then for x in self.request.watch)  # of roles, which may set it free
        equation.is_fixed = bool(friction.fixed(at, sides)) and not prescribed and not changes
        self.slips = [*(s for s in self.slips if s.begin != self.t), Slips(self.t, sides)]
        if equation.is_fixed and at.push.size:
            self.happened(ends.REST, *layout.motion(self.y))
            self.facts |= self._facts(start)
        return self._wait_for_release() if equation.is_fixed else None

    def _facts(self, start: Settled) -> dict[str, float]:
        """How firmly friction holds what rests."""
        if not self.layout.scalar:
            return {"holding_share": start.share}
        holding = self._rubs.holding(self.y[:1], self.t, self.layout.states(self.y))
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
    a = t
    while a < latest:
        b = min(a + part, loads.next_time_kink(structure, a), latest)
        if beyond(b) > 0:
            if beyond(a) < 0:
                b = float(brentq(beyond, a, b, xtol=EPS, rtol=4 * EPS))
            late = math.ulp(b)
            while not beyond(b) > 0 and late < latest - b:  # the root is either side of it
                b, late = b + late, 2 * late
            return b
        a = b
    return None
