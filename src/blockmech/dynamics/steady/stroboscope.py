"""Periodic motions under loads that follow the time: the state seen once a period of theirs.

The stroboscopic map takes a state to that one period of the loads later. Its fixed points,
or those of two, three or four periods, are the periodic motions; a driver may advance
whole turns on the way, and one on whose place nothing depends by anything (`cyclic`). The
map is iterated from a start until it comes near one; Newton's method (`shooting`) does the
rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.steady.cyclic import coasting, cyclic_drivers, free_of_rates
from blockmech.dynamics.steady.flow import LOOSE, Flow, sampled, size_of, state_at_end
from blockmech.dynamics.steady.outcome import Lost, Spent
from blockmech.dynamics.steady.shooting import Cycle, Guess, closed

TRANSIENT = 24  # periods before Newton's method is tried
FOLLOWED = 400  # periods at most after which a start has to have come near what was found
NEARER = 1 / 8  # share of the distance that is left of a motion that settles slowly
MULTIPLES = (1, 2, 3, 4)  # periods of the loads that one of the motion may take
NEAR = 1e-3  # distance, in scales, at which a motion has settled
OTHER = 12  # periods of a transient from another start
SAME = 1e-6  # distance, in scales, of motions that are one


class Settled(NamedTuple):
    """A periodic motion and whether the start was seen to lead to it, or is on it."""

    cycle: Cycle
    reached: bool
    there: bool = False


@dataclass
class Stroboscope:
    """A search with k drivers.

    T : period of the loads [s]
    turns : (k,) period of the place [rad or m], 0 where a driver has none
    rotary : whether each driver turns
    span : [rad or m] over which things change
    cyclic : drivers on whose coordinate nothing depends, found on the way
    tried : what was done, in words
    """

    flow: Flow
    T: float
    turns: Floats
    rotary: Sequence[bool]
    span: float
    cyclic: tuple[int, ...] = ()
    tried: list[str] = field(default_factory=list)

    def found(self, x: Floats) -> Settled | None:
        """The periodic motion to which that from a state x settles, else one near by.

        Raises `Lost` where that motion ends by itself.
        """
        states, last = self._transient(x, TRANSIENT)
        self.tried.append(
            f"followed the motion from the start for {TRANSIENT} periods of the loads"
        )
        scale = self._size(last)
        seen = np.concatenate([states, last])
        self.cyclic = tuple(cyclic_drivers(self.flow, seen, self.T, self.turns, self.span))
        if len(self.cyclic) == self.flow.drivers and free_of_rates(self.flow, x, self.T):
            return Settled(coasting(self.flow, x, self.T), True, True)
        near = self._near(states, scale)
        if near is None:
            return None
        if not near.stable:
            return Settled(near, False)
        return Settled(near, self._comes(states, near, scale))

    def others(self, starts: Sequence[Floats], known: Sequence[Cycle]) -> list[Cycle]:
        """Further periodic motions that other starts lead to."""
        found = list(known)
        for x in starts:
            try:
                new = self._from(x, found)
            except Spent:
                break
            if new is not None:
                found.append(new)
        return found[len(known) :]

    def _from(self, start: Floats, found: Sequence[Cycle]) -> Cycle | None:
        """A periodic motion from another start, unless it is found already."""
        try:
            states, last = self._transient(start, OTHER)
        except Lost:
            return None
        scale = self._size(last)

        def known(x: Floats) -> bool:
            return any(self._apart(x, old, scale) <= SAME for old in found)

        return closed(self.flow, self._guess(states, 1), self.rotary, self.span, known)

    # -- details -----------------------------------------------------------------------------

    def _transient(self, x: Floats, periods: int) -> tuple[list[Floats], Floats]:
        """States once a period, and those of the last period (m, 2k)."""
        states, t = [x], 0.0
        for _ in range(periods):
            try:
                runs = self.flow.after(states[-1], self.T, LOOSE)
            except Lost as lost:
                raise Lost(lost.end, t + lost.t) from None
            states.append(state_at_end(runs[-1]))
            t += self.T
        return states, sampled(runs, self.T, self.flow.t0)

    def _size(self, last: Floats) -> Floats:
        return size_of(last, self.rotary, self.span)

    def _shift(self, x: Floats, end: Floats) -> Floats:
        """Whole turns nearest to what the drivers advanced, (2k,); of cyclic ones all of it."""
        k = self.flow.drivers
        away = (end - x)[:k]
        with np.errstate(all="ignore"):
            turns = np.where(self.turns > 0, np.round(away / self.turns), 0.0)
        shift = np.nan_to_num(turns) * self.turns
        for i in self.cyclic:
            shift[i] = away[i]
        return np.concatenate([shift, np.zeros(k)])

    def _guess(self, states: list[Floats], count: int) -> Guess:
        x, before = states[-1], states[-1 - count]
        home = x - self._shift(states[0], x)  # without the turns since the start
        return Guess(home, self.T, count, self._shift(before, x), False, self.cyclic)

    def _near(self, states: list[Floats], scale: Floats) -> Cycle | None:
        """The periodic motion near the last state, a stable one by preference."""
        apart = []
        for count in MULTIPLES:
            guess = self._guess(states, count)
            away = states[-1] - states[-1 - count] - guess.shift
            apart.append(float(np.abs(away / scale).max()))
        # a motion that repeats after one period does after four: take the first that is near
        order = sorted(range(len(MULTIPLES)), key=lambda i: (apart[i] > NEAR, i))
        kept: Cycle | None = None
        for i in order:
            self.tried.append(f"Newton's method on {MULTIPLES[i]} periods")
            new = closed(self.flow, self._guess(states, MULTIPLES[i]), self.rotary, self.span)
            if new is None:
                continue
            if new.stable:
                return new
            kept = kept or new
        return kept

    def _comes(self, states: list[Floats], cycle: Cycle, scale: Floats) -> bool:
        """Whether the motion comes near what was found, followed for a while."""
        x = states[-1]
        first = self._apart(x, cycle, scale)
        for _ in range(0, FOLLOWED, cycle.periods):
            if self._apart(x, cycle, scale) <= max(NEAR, NEARER * min(first, 1.0)):
                return True
            try:
                x = state_at_end(self.flow.after(x, self.T, LOOSE, cycle.periods)[-1])
            except (Lost, Spent):
                return False
        return False

    def _apart(self, x: Floats, cycle: Cycle, scale: Floats) -> float:
        """Distance of a state from the nearest of a cycle's, once a period of the loads."""
        rows = [cycle.x, *(state_at_end(run) for run in cycle.runs[:-1])]
        return min(float(np.abs((x - row - self._shift(row, x)) / scale).max()) for row in rows)
