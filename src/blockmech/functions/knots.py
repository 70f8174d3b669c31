"""Where a function of one variable is not smooth, and after what it repeats."""

from __future__ import annotations

import math
from collections.abc import Sequence


class Knotted:
    """A function of one variable that is smooth between its knots; without any unless said."""

    @property
    def whole(self) -> float:
        """Period of the argument, 0 where nothing repeats."""
        return 0.0

    @property
    def covers_one_turn(self) -> bool:
        """Whether it repeats after a turn of its argument."""
        return False

    def knots(self) -> Sequence[float]:
        """Arguments at which it, or a derivative of it, jumps: rising, those of one period."""
        return ()

    def rows(self) -> Sequence[float]:
        """The same, of one that repeats with the end of the period."""
        knots = self.knots()
        return [*knots, float(knots[0] + self.whole)] if knots and self.whole else knots

    def within(self, low: float, high: float) -> Sequence[float]:
        """Knots from low to high, repeated as it repeats."""
        knots = self.knots()
        if not knots or not self.whole:
            return [x for x in knots if low <= x <= high]
        first = math.floor((low - knots[-1]) / self.whole)
        last = math.ceil((high - knots[0]) / self.whole)
        repeated = (x + k * self.whole for k in range(first, last + 1) for x in knots)
        return [x for x in repeated if low <= x <= high]

    def next_kink(self, x: float) -> float:
        """The first knot after an argument; infinite for none."""
        last = x + 2 * self.whole if self.whole else math.inf
        return min((y for y in self.within(x, last) if y > x), default=math.inf)

    def kinks_of_angle(self) -> Sequence[float]:
        """Knots in [-pi, pi] of a function of an angle that jumps there."""
        return (*self.within(-math.pi, math.pi), *(() if self.covers_one_turn else (math.pi,)))
