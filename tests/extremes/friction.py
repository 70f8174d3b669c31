"""Joint friction at the extremes: a press with a massless rod, whose balance has a closed form.

The rod carries a force along a line that touches the friction circles of both its pins; the ram
is held by its guide. All is worked out in 60 digits (mpmath), and again with the numbers moved by
half an ulp: what rounding of the data alone leaves.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpmath import mp, mpf

import blockmech as bm
from blockmech import Graph
from blockmech.engines.numpy import PRECISIONS
from tests.wiring import wire

from .precise import DIGITS

SHAKES = 6
LOAD = 10000.0  # [N] on the ram, towards the crank


@dataclass(frozen=True)
class Press:
    """A press: crank and rod [m], radius of the friction circles [m], friction of the guide [-].

    ``q`` [rad] is measured from its dead centre, ``sense`` is the way it turns.
    """

    name: str
    q: float
    sense: int = -1
    rho: float = 0.0
    guide: float = 0.0
    crank: float = 0.1
    rod: float = 0.3

    @property
    def graph(self) -> Graph:
        """The press as blocks; pins of coefficient 1 have friction circles of their radius."""
        g = Graph("press")
        g.add("frame", bm.Frame(markers={"O": 0j, "G": bm.Marker(at=0j, angle=0.0)}))
        pins = {j: bm.Coulomb(coefficient=1.0, radius=self.rho) for j in "ABC" if self.rho}
        own = {j: pins.pop(j) for j in ("A",) if self.rho}
        g.add("crank", bm.Crank(length=self.crank, friction=own))
        if self.guide:
            pins["S"] = bm.Coulomb(coefficient=self.guide)
        g.add("ram", bm.RRP(l=self.rod, h=0.0, branch=1, friction=pins))
        g.add("work", bm.Force(force=(-LOAD, 0.0)))
        return wire(g, "frame.O crank.A", "crank.B ram.B", "frame.G ram.S", "ram.j work.at")

    def moment(self, seed: int | None = None, dtype: Any = np.float64) -> Any:
        """Driving moment [N m] in 60 digits; None where no force balances the load.

        With a seed, lengths and friction are moved by half a unit in the last place.
        """
        dice, half = random.Random(seed), 0 if seed is None else mpf(float(np.finfo(dtype).eps)) / 2
        given = (self.crank, self.rod, self.rho, self.guide)
        numbers = (float(dtype(x)) for x in given)
        r, l, rho, mu = (mpf(x) * (1 + half * dice.choice((-1, 1))) for x in numbers)
        q, way = mpf(self.q), self.sense
        phi = -mp.asin(r * mp.sin(q) / l)
        rod = -r * mp.cos(q) / (l * mp.cos(phi)) * way  # its rate at unit rate of the crank
        ram = -way * mp.sin(q) * r * (1 + r * mp.cos(q) / (l * mp.cos(phi)))
        at_b, at_c = mp.sign(rod - way), mp.sign(-rod)
        aside = (at_c - at_b) * rho / l
        if abs(aside) >= 1:
            return None  # the circles overlap: the rod carries nothing
        along = phi + mp.asin(aside)
        kept = mp.cos(along) - mp.sign(ram) * mu * abs(mp.sin(along))
        if kept <= 0:
            return None  # the guide holds whatever presses it
        size = LOAD / kept
        lever = r * mp.sin(along - q) + (way - at_b) * rho
        return lever * size


def presses() -> Iterator[Press]:
    """Near the dead centre, up to friction that locks, and guides about to jam."""
    for gap in (1e-1, 1e-4, 1e-8, 1e-11):  # nearer the ram counts as at rest
        for rho in (0.0, 0.003, 0.1, 0.149, 0.2):
            yield Press(f"press {gap:.0e} rad before its dead centre, rho {rho}", gap, -1, rho, 0.1)
            yield Press(f"press {gap:.0e} rad beyond it, rho {rho}", gap, 1, rho, 0.1)
    tangent = math.tan(math.asin(0.29 * math.sin(1.2) / 0.3))  # of the rod
    for short in (1e-2, 1e-4, 1e-8, 1e-12, -1e-12, -1e-8, -1e-2):
        name = f"guide {abs(short):.0e} {'short of' if short > 0 else 'beyond'} jamming"
        yield Press(name, 1.2, -1, 0.0, (1 - short) / tangent, crank=0.29)


@dataclass(frozen=True)
class Found:
    """What a press gave, and what it was told.

    error : relative; NaN where there is no truth or no answer
    forced : what half an ulp in the data does to the truth, relative
    balanced : whether a force balances the load at all
    """

    error: float
    forced: float
    balanced: bool
    status: str
    flags: tuple[str, ...]


def found(press: Press, precision: str) -> Found:
    """The driving moment with friction by Newton, against the truth."""
    dtype = PRECISIONS[precision]
    run = press.graph.compile().run(
        at=press.q, rates=float(press.sense), want="crank.drive", static=True,
        engine="numpy", precision=precision, on_gap="mark",
    )  # fmt: skip
    with mp.workdps(DIGITS):
        truth = press.moment()  # what its numbers say, which doubtful friction is computed with
        error = forced = np.nan
        if truth is not None:
            error = float(abs(mpf(float(run["crank.drive"][0])) / truth - 1))
            moved = (press.moment(seed, dtype) for seed in range(SHAKES))
            forced = max(np.inf if m is None else float(abs(m / truth - 1)) for m in moved)
    flags = tuple(flag.code for flag in run.quality.flags)
    return Found(error, forced, truth is not None, run.quality.status[0], flags)
