"""The whole path of a conservative motion: a first passage and what repeats after it.

Positions on the path are told by a *clock* [s], the time since its low end if walked
upward. A turn after the first one is a copy: equal in a rotation, with a little more
energy each time in a secular motion, where the driver gains net work every turn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from blockmech.dynamics.chebyshev import Floats, rule
from blockmech.dynamics.path.dense import place, when
from blockmech.dynamics.path.mesh import View
from blockmech.dynamics.path.passage import Passage, Place
from blockmech.dynamics.path.quadrature import Quadrature

TURNS_AT_ONCE = (16, 4096)  # at first, at most
MOST_TURNS = 10_000_000


@dataclass(frozen=True)
class Line:
    """A path along growing x that ends, or goes on turn after turn.

    Attributes
    ----------
    view : the driver seen along the path
    first : the first passage, all of it if nothing repeats
    period : [rad or m] after which the path repeats, 0 if it does not
    later : a turn after the first where gain > 0; its energy is that of the second turn
    gain : [J] net work over a turn, >= 0
    starts : (turns + 1,) [s] clock at which each turn begins, where gain > 0
    later_error : [s] error of the time of the second turn
    gain_error : [-] relative error of the gain
    """

    view: View
    first: Passage
    period: float = 0.0
    later: Quadrature | None = None
    gain: float = 0.0
    starts: Floats | None = None
    later_error: float = 0.0
    gain_error: float = 0.0

    def error(self, clock: float, elapsed: float) -> float:
        """Error of the time up to a clock reading, after some elapsed time [s]."""
        first, T = self.first.error, self.first.total
        if self.starts is None:
            return first * (1 + elapsed / T)
        turn = float(np.searchsorted(self.starts, clock, side="right")) - 1
        if turn < 1:
            return 2 * first
        # turns get shorter with the root of their number, and so do their errors
        return 2 * (first + self.later_error * math.sqrt(turn)) + clock * self.gain_error / 2

    @property
    def total(self) -> float:
        """Clock at the high end [s], infinite if there is none."""
        return np.inf if self.period else self.first.total

    def place(self, clock: Floats) -> Place:
        """Place and speed at clock readings (m,)."""
        if not self.period:
            return self.first.place(clock)
        turn = self._turn_at(clock)
        if self.starts is None or self.later is None:
            found = self.first.place(clock - turn * self.first.total)
            return Place(found.x + turn * self.period, found.rate)
        local = clock - self.starts[turn]
        x, rate = np.empty_like(clock), np.empty_like(clock)
        one = turn == 0
        if one.any():
            x[one], rate[one] = self.first.place(local[one])
        if not one.all():
            rest = ~one
            x[rest], rate[rest] = place(self.later, local[rest], (turn[rest] - 1) * self.gain)
        return Place(x + turn * self.period, rate)

    def when(self, x: Floats) -> Floats:
        """Clock readings at places x (m,)."""
        if not self.period:
            return self.first.when(x)
        turn = np.floor((x - self.first.low.x) / self.period).astype(np.intp)
        local = x - turn * self.period
        if self.starts is None or self.later is None:
            return np.asarray(self.first.when(local) + turn * self.first.total)
        clock = np.empty_like(x)
        one = turn == 0
        if one.any():
            clock[one] = self.first.when(local[one])
        if not one.all():
            rest = ~one
            shift = (turn[rest] - 1) * self.gain
            clock[rest] = self.starts[turn[rest]] + when(self.later, local[rest], shift)
        return clock

    def _turn_at(self, clock: Floats) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        if self.starts is None:
            turn = np.floor(clock / self.first.total)
        else:
            turn = np.searchsorted(self.starts, clock, side="right") - 1.0
        return np.maximum(turn, 0).astype(np.intp)


def turn_starts(first: float, later: Quadrature, gain: float, clock: float, turns: int) -> Floats:
    """Clock at which each turn begins, up to a clock reading and a number of turns.

    One vectorised sum over (turn, panel, node) a chunk; no kernel call.
    """
    r = rule(later.J.shape[1])
    weights = (later.mesh.length / 2)[:, None] * r.total
    half_J = (later.J / 2).ravel()
    weights, K = weights.ravel(), later.K.ravel()
    chunks, done, end = [np.array([0.0, first])], 1, first
    count = min(max(turns, TURNS_AT_ONCE[0]), TURNS_AT_ONCE[1])
    while (end < clock or done < turns) and done < MOST_TURNS:
        more = np.arange(done - 1, done - 1 + count) * gain
        T = np.sqrt(half_J / (K + more[:, None])) @ weights
        chunks.append(end + np.cumsum(T))
        end, done = float(chunks[-1][-1]), done + count
        count = min(2 * count, TURNS_AT_ONCE[1])
    return np.concatenate(chunks)
