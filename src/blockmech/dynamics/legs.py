"""A leg: what a motion does in one chart, read in the coordinates of the user's drivers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from blockmech.dynamics.pair_stops import Counted
from blockmech.result.motion import Floats, Motion, State

MILESTONES = 9  # places over a leg from which turns are counted


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

    @cached_property
    def milestones(self) -> tuple[Floats, list[Any]]:
        """Times [s] over the leg, and what is counted there."""
        assert self.counted is not None
        times = self.motion.times(MILESTONES)
        self.counted.again()
        q = self.motion.at(times).q.reshape(len(times), -1)
        return times, [(self.counted.at(x), self.counted.last)[1] for x in q]

    def state(self, t: Floats) -> State:
        """State of the user's drivers at times (m,) [s] of the leg."""
        if self.counted is None:
            return self.motion.at(t)
        q, qd = (x.reshape(len(t), -1) for x in self.motion.at(t))
        times, last = self.milestones
        places, rates = np.empty_like(q), np.empty_like(q)
        nearest = np.maximum(np.searchsorted(times, t, "right") - 1, 0)
        for i, (x, rate, near) in enumerate(zip(q, qd, nearest.tolist(), strict=True)):
            self.counted.last = last[near]
            places[i] = self.counted.at(x)
            rates[i] = self.counted.last[2] @ rate
        alone = q.shape[1] == 1
        return State(places[:, 0], rates[:, 0]) if alone else State(places, rates)

    def signal_states(self, t: Floats) -> Floats:
        """States (m, n) of signal blocks at times (m,) [s]."""
        return self.motion.signal_states(t)
