"""What comes of turns in time: whether others of the kind follow for ever."""

from __future__ import annotations

import math
from dataclasses import dataclass

from blockmech.dynamics import ends
from blockmech.dynamics.ends import RunEnd


@dataclass
class TurnsInTime:
    """Turns without a standstill under loads of place and rate, of which some are looked at.

    Motions of one driver do not cross: one that begins a turn no slower than the last is nowhere
    slower in it. So turns that gain ever more never come to a standstill; nor do those whose
    changes fade out before they count.

    coordinate, t : [rad], [s] where the last one ended; square : [1/s2] of the rate there
    change : [1/s2] of the square in the last one, if that was looked at
    many, passed : turns to the next place to look at, and those before
    """

    coordinate: float
    t: float
    square: float
    change: float = math.nan
    many: int = 1
    passed: int = 0

    def turned(self, t: float, q: float, rate: float, target: float) -> RunEnd | None:
        """Go on to that place; why the run is over where more of the kind follow for ever.

        target : [rad] by which changes may move what follows a turn later
        """
        travel, last, duration = abs(q - self.coordinate), self.change, t - self.t
        change, small = rate**2 - self.square, 2 * travel * target / duration**2
        self.passed += self.many
        self.coordinate, self.t, self.square = q, t, rate**2
        if self.many > 1 or math.isnan(last):  # two in a row tell
            self.change, self.many = math.nan if self.many > 1 else change, 1
            return None
        self.change, self.many = math.nan, self.passed  # and others ever more rarely
        if change**2 <= (abs(last) - abs(change)) * small:  # all that follow, a geometric series
            facts = {"period": duration, "mean_speed": travel / duration}
            return RunEnd(f"{ends.NEVER}: rotation", facts=facts)
        run_up = change >= last > 0 and change > small
        return RunEnd(f"{ends.NEVER}: run-up") if run_up else None
