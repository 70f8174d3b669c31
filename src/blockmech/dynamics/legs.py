"""A leg: what a motion does in one chart, read in the coordinates of the user's drivers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from blockmech.dynamics.events import PARTS
from blockmech.dynamics.pair_stops import Counted
from blockmech.result.motion import Motion, State
from blockmech.typing import Floats


@dataclass(frozen=True)
class Leg:
    """A motion in one chart, read in the coordinates of the user's drivers.

    chart : a `Chart`
    motion : in the chart's coordinates
    counted : those of the user's drivers, from where the leg begins; None where these lead
    """

    chart: Any
    motion: Motion
    counted: Counted | None

    def state(self, t: Floats) -> State:
        """State of the user's drivers at times (m,) [s] of the leg."""
        if self.counted is None:
            return self.motion.at(t)
        # Between some places over the leg turns are counted.
        times = np.union1d(t, self.motion.times(PARTS + 1))
        self.counted.again()
        states = [self.counted.state(*state) for state in zip(*self.motion.at(times), strict=True)]
        indices = np.searchsorted(times, t)
        return State(*(np.array(x)[indices] for x in zip(*states, strict=True)))

    def accelerations(self, t: Floats, qdd: Floats) -> Floats:
        """Those (m, k) of the user's drivers from those (m, k) of the chart's."""
        if self.counted is None:
            return qdd
        q, qd = (x.reshape(qdd.shape) for x in self.motion.at(t))
        rows = [self.counted.pairs.state(*state)[1:] for state in zip(q, qd, strict=True)]
        return np.array([R @ a + drift for (R, drift), a in zip(rows, qdd, strict=True)])

    def signal_states(self, t: Floats) -> Floats:
        """States (m, n) of signal blocks at times (m,) [s]."""
        return self.motion.signal_states(t)
