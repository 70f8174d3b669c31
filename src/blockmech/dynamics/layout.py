"""Where what stands in the state y of an integration in time: one place that knows the order."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from blockmech.result.motion import Floats


@dataclass(frozen=True)
class StateLayout:
    """The parts of a state y = (q, q', W[, F][, D][, x]) as named slices.

    Coordinates and rates of the drivers come first, so that a state begins with those of the
    mechanism whatever else is integrated beside them.

    Attributes
    ----------
    drivers : number k of drivers
    rubs : whether the work F that joint friction takes stands there
    driven : whether the work D stands there that drives do which hold or prescribe
    initial : states x of signal blocks and friction laws where the motion starts

    >>> layout = StateLayout(drivers=2, rubs=False)
    >>> layout.rate, layout.work, layout.size
    (slice(2, 4, None), 4, 5)
    """

    drivers: int
    rubs: bool = False
    initial: tuple[float, ...] = ()
    driven: bool = False

    @cached_property
    def q(self) -> slice:
        """Coordinates [rad or m]."""
        return slice(0, self.drivers)

    @cached_property
    def rate(self) -> slice:
        """Their rates [rad/s or m/s]."""
        return slice(self.drivers, 2 * self.drivers)

    @property
    def moving(self) -> int:
        """Number 2k of coordinates and rates."""
        return 2 * self.drivers

    @property
    def work(self) -> int:
        """Work W of the loads [J]."""
        return 2 * self.drivers

    @cached_property
    def works(self) -> slice:
        """All works."""
        return slice(self.work, self.work + 1 + self.rubs + self.driven)

    @cached_property
    def signals(self) -> slice:
        """States of signal blocks and of friction laws, in the order of `Structure.states`."""
        return slice(self.works.stop, self.size)

    @property
    def size(self) -> int:
        """Number of components."""
        return self.work + 1 + self.rubs + self.driven + len(self.initial)

    def start(self, q: Any, rate: Any) -> Floats:
        """The state (size,) from which a motion begins: no work is done yet."""
        y = np.zeros(self.size)
        y[self.q], y[self.rate], y[self.signals] = q, rate, self.initial
        return y

    def motion(self, y: Any) -> tuple[Any, Any]:
        """Coordinates and rates of a state: numbers of one driver, else arrays (k,)."""
        if self.drivers == 1:
            return float(y[0]), float(y[1])
        return y[self.q], y[self.rate]
