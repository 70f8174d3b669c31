"""Conservative motion along a line: back and forth, round and round, or once to its end.

A clock hand runs along the line from where the motion starts. At a standstill it turns
back, at an end stop or dead centre it stays. Unfolded, the hand is simply c0 + d t, so
any time is reached at once, however many swings or turns lie before it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.motion import State
from blockmech.dynamics.path.line import Line


@dataclass(frozen=True)
class Conservative:
    """Dense output of a conservative motion.

    Attributes
    ----------
    line : the path
    c0 : clock reading at the start [s]
    heading : +1 if the motion starts along growing x, else -1
    t0 : time of the start [s]
    """

    line: Line
    c0: float
    heading: int
    t0: float = 0.0

    @property
    def turns_low(self) -> bool:
        """Whether the motion turns back at the low end."""
        return self.line.first.low.reflects

    @property
    def turns_high(self) -> bool:
        """Whether the motion turns back at the high end."""
        return not self.line.period and self.line.first.high.reflects

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]; at and after its end the motion stays there."""
        clock, heading = self._folded(t - self.t0)
        found = self.line.place(clock)
        view = self.line.view
        return State(view.q(found.x), view.sign * heading * found.rate)

    def clock(self, t: Floats) -> Floats:
        """Clock readings at times (m,) [s]."""
        return self._folded(t - self.t0)[0]

    def _folded(self, elapsed: Floats) -> tuple[Floats, Floats]:
        """Clock readings and headings after elapsed times."""
        T = self.line.total
        hand = self.c0 + self.heading * elapsed
        if self.turns_low and self.turns_high:
            hand = np.mod(hand, 2 * T)
            back = hand > T
            return np.where(back, 2 * T - hand, hand), np.where(back, -1.0, 1.0)
        if self.turns_high:
            back = hand > T
            return np.maximum(np.where(back, 2 * T - hand, hand), 0.0), np.where(back, -1.0, 1.0)
        heading = np.where(hand < 0, -self.heading, self.heading)
        return np.minimum(np.abs(hand), T), heading.astype(np.float64)

    def end(self) -> float:
        """Time at which the motion meets an end that does not turn it back [s], or inf."""
        T = self.line.total
        if self.turns_low and self.turns_high:
            return math.inf
        if self.turns_high:
            return self.t0 + 2 * T - self.c0
        if self.heading > 0:
            return self.t0 + T - self.c0
        return self.t0 + self.c0 + T

    def standstill(self, n: int) -> float:
        """Time of the n-th standstill after the start [s], inf if there is none (n >= 1)."""
        T = self.line.total
        low, high = self.turns_low, self.turns_high
        ahead = high if self.heading > 0 else low
        first = (T - self.c0) if self.heading > 0 else self.c0
        if not ahead or (n > 1 and not (low and high)):
            return math.inf
        return self.t0 + first + (n - 1) * T if n > 1 else self.t0 + first

    def reaches(self, x: float) -> float:
        """First time after the start at which the motion is at x [s], inf if it never is."""
        line, T = self.line, self.line.total
        if x < line.first.low.x or (not line.period and x > line.first.high.x):
            return math.inf
        at = float(line.when(np.array([x]))[0])
        images = [at]
        if self.turns_low:
            images += [-at]
        if self.turns_high:
            images += [2 * T - at]
        if self.turns_low and self.turns_high:
            images += [at + 2 * T, at - 2 * T, -at - 2 * T, -at + 4 * T]
        tiny = 4 * np.finfo(float).eps * max(self.c0, at)
        elapsed = [(image - self.c0) * self.heading for image in images]
        ahead = [e for e in elapsed if e > tiny]
        return self.t0 + min(ahead) if ahead else math.inf
