"""What methods there are to compute a motion, and what each takes.

`blockmech.dynamics.methods` runs them; this table imports nothing of that.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, get_args

from blockmech.typing import MotionName

Q = frozenset({"q"})
ALL = frozenset({"q", "rate", "time", "state"})


class Method(NamedTuple):
    """A way to compute a motion, and what it is good for.

    line : what it does
    loads : what they may depend on
    friction : whether it takes joint friction
    ends_at_events : whether it follows the motion in time, so that an event can end it
    several : whether it takes several drivers
    finds_steady : whether the search for a steady state takes it; schemes of the textbooks are
        for comparison alone
    compared : accuracies from coarse to fine, of fixed steps how many over a run, at which
        `blockmech.analysis.trade` compares it
    """

    line: str
    loads: frozenset[str] = ALL
    friction: bool = True
    ends_at_events: bool = True
    several: bool = False
    finds_steady: bool = True
    compared: tuple[float, ...] = ()

    @property
    def fixed_steps(self) -> bool:
        """Whether its accuracy is set by a step."""
        return not self.finds_steady


METHODS: Mapping[str, Method] = {
    "energy": Method(
        "quadrature along the path: loads of the place alone, to rounding",
        Q, False, False, compared=(1e-3, 1e-6, 1e-9, 1e-12),
    ),
    "dop853": Method(
        "Runge-Kutta of order 8 in time: any loads, joint friction, any drivers",
        several=True, compared=(1e-3, 1e-6, 1e-9, 1e-11),
    ),
    "radau": Method(
        "implicit Runge-Kutta of order 5 in time: the same, for stiff motions",
        several=True, compared=(1e-3, 1e-6),
    ),
    "rk4": Method(
        "the textbooks' Runge-Kutta of order 4, steps in time, for comparison",
        several=True, finds_steady=False, compared=(100, 200, 400, 800),
    ),
    "euler_q": Method(
        "the second paper's steps of the coordinate, for comparison",
        ALL - {"state"}, False, finds_steady=False, compared=(100, 1000, 10_000),
    ),
}  # fmt: skip
assert ("auto", *METHODS) == get_args(MotionName)  # what checkers of types read
