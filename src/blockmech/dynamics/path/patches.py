"""Stretches of path with what depends on position only, sampled once and used every turn."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats, rule
from blockmech.dynamics.path.mesh import View, places
from blockmech.dynamics.path.survey import panel_edges
from blockmech.dynamics.system.reduced import feasible

SHORTEST = 2.0**-24  # of a turn
SAME = 1e-9  # of a turn: edges nearer than that are one


class Patch(NamedTuple):
    """J, tau and damping at the nodes of one panel, arrays (n,), along growing x.

    ``root``: the panel's coordinate v is sqrt(x - low), not x - low; ``slope`` is dx/dv
    and ``length`` that of v.
    """

    low: float
    high: float
    length: float
    root: bool
    x: Floats
    slope: Floats
    J: Floats
    tau: Floats
    damping: Floats
    possible: bool
    margin: Floats


def sampled(view: View, edges: Floats, n: int, root: bool = False) -> list[Patch]:
    """Patches between edges, the first with a root if wanted; one batch call."""
    r = rule(n)
    low, high = edges[:-1], edges[1:]
    x = places(low, high, (root, False), n)
    wanted = frozenset({"damping"}) if view.meter.system.damped else frozenset()
    sample = view.meter.sample(view.q(x), wanted)
    damping = np.zeros_like(x) if sample.damping is None else sample.damping
    possible = np.asarray(feasible(sample).all(axis=1))
    found = []
    for i in range(low.size):
        rooted = root and i == 0
        length = math.sqrt(high[i] - low[i]) if rooted else float(high[i] - low[i])
        found.append(
            Patch(
                low=float(low[i]),
                high=float(high[i]),
                length=length,
                root=rooted,
                x=x[i],
                slope=2 * length * r.low if rooted else np.ones(n),
                J=sample.J[i],
                tau=view.sign * sample.tau[i],
                damping=damping[i],
                possible=bool(possible[i]),
                margin=sample.margin[i],
            )
        )
    return found


class Path:
    """The patches of a path, made on demand, cut where needed.

    In a periodic scene they are those of one turn; else every window has its own.
    """

    def __init__(self, view: View, n: int, per_turn: int) -> None:
        system = view.meter.system
        self.view, self.n, self.per_turn = view, n, per_turn
        self.periodic = system.period is not None
        rotation = 2 * math.pi if system.kind == "rotation" else system.span
        self.width = system.period or rotation
        self._known: dict[int, list[Patch]] = {}

    def start(self, halvings: int) -> Patch:
        """The first patch of a start from rest, in the root of the distance."""
        edges = np.array([0.0, self.width / self.per_turn / 2**halvings])
        return sampled(self.view, edges, self.n, root=True)[0]

    def at(self, x: float) -> tuple[Patch, float]:
        """The patch that begins at x, and how far (whole turns) it is shifted."""
        window, i, local, shift = self._find(x)
        patch = window[i]
        if local - patch.low > SAME * self.width:
            self._cut(window, i, local)
            patch = window[i + 1]
        return patch, shift

    def halve(self, x: float) -> bool:
        """Cut the patch that begins at x in two; False if it is too short already."""
        window, i, _, _ = self._find(x)
        patch = window[i]
        if patch.high - patch.low < 2 * SHORTEST * self.width:
            return False
        self._cut(window, i, (patch.low + patch.high) / 2)
        return True

    def _find(self, x: float) -> tuple[list[Patch], int, float, float]:
        number = math.floor(x / self.width + SAME)
        base = number * self.width
        key, low = (0, 0.0) if self.periodic else (number, base)
        if key not in self._known:
            edges = panel_edges(self.view, low, low + self.width, self.per_turn)
            self._known[key] = sampled(self.view, edges, self.n)
        window = self._known[key]
        shift = base if self.periodic else 0.0
        local = x - shift
        i = 0
        while i < len(window) - 1 and window[i].high - local <= SAME * self.width:
            i += 1
        return window, i, local, shift

    def _cut(self, window: list[Patch], i: int, at: float) -> None:
        edges = np.array([window[i].low, at, window[i].high])
        window[i : i + 1] = sampled(self.view, edges, self.n)
