"""Samples of the reduced system on panels of the driver's path.

The path is walked in a coordinate x, the distance from a place of reference in
one direction: q = origin + sign x. J and tau are sampled at the Chebyshev nodes of
panels. A panel that ends at a dead centre of the driver is sampled in the square
root of the distance to it, where J -> infinity but J (dx/dv)^2 is smooth; the
panel then has its own coordinate v, and ``J`` and ``tau`` are those for v:

    regular      x = x_low + v                          dx/dv = 1
    limit high   x = x_high - (S - v)^2,  S^2 = length   dx/dv = 2 (S - v)
    limit low    x = x_low + v^2                        dx/dv = 2 v
"""

from __future__ import annotations

import itertools
from bisect import bisect_left
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.chebyshev import Floats, part_of, remainder, rule
from blockmech.dynamics.system.reduced import Metered, feasible

NODES = 64  # a panel
RESOLVED = 1e-14  # what a series misses, relative, that is rounding
SLIP = 1e-12  # of a panel: how far beyond its end a part of it may seem to reach
SEEN = 1.0  # margin of panels that are read: that of the whole has been looked at
STRONG = 0.03  # share of a panel's largest effort below which its series is not read


@dataclass(frozen=True)
class View:
    """The driver seen from ``origin`` [rad or m] in direction ``sign``: q = origin + sign x."""

    meter: Metered
    origin: float
    sign: float

    def q(self, x: Floats) -> Floats:
        """Driver coordinate of places x."""
        return self.origin + self.sign * x

    @property
    def mirrored(self) -> View:
        """The same place, looking back."""
        return View(self.meter, self.origin, -self.sign)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled without what is sampled: of a motion that is known, nothing is any more."""
        return View, (None, self.origin, self.sign)


class Mesh(NamedTuple):
    """Panels in order of growing x, with their samples.

    Attributes
    ----------
    edges : (p + 1,) [rad or m] x at the panels' ends
    both : (2, p, n) samples of J and of tau for the panels' coordinate v, along growing x
    missed : (2, p) what their series miss in an integral over the panel, see `remainder`
    length : (p,) length in v
    limits : whether the low end, the high end is a dead centre of the driver
    margin : (p, n) [-] 0 where the mechanism does not close
    """

    edges: Floats
    both: Floats
    missed: Floats
    length: Floats
    limits: tuple[bool, bool]
    margin: Floats

    @property
    def possible(self) -> NDArray[np.bool_]:
        """(p, n) whether the mechanism closes there."""
        return np.asarray(self.margin > 0)

    @property
    def panels(self) -> int:
        """Number of panels."""
        return int(self.length.size)

    @property
    def nodes(self) -> int:
        """Nodes of a panel."""
        return int(self.both.shape[2])

    @property
    def J(self) -> Floats:
        """(p, n) inertia for v."""
        return np.asarray(self.both[0])

    @property
    def tau(self) -> Floats:
        """(p, n) effort for v."""
        return np.asarray(self.both[1])


def sampled(
    view: View,
    edges: Floats,
    known: Mesh | None = None,
    limits: tuple[bool, bool] = (False, False),
) -> Mesh:
    """Samples on the panels between ``edges``; those ``known`` already has are reused.

    Panels that lie within a known one are read from its series where that is as good as
    samples. Cost: one batch call of 64 samples for every other panel that is new.
    """
    p = edges.size - 1
    length = edges[1:] - edges[:-1]
    if limits[0]:
        length[0] = np.sqrt(length[0])
    if limits[1]:
        length[-1] = np.sqrt(length[-1])
    if known is None:
        both, margin = _samples(view, edges[:-1], edges[1:], limits)
        return Mesh(edges, both, remainder(both, rule(NODES)), length, limits, margin)
    there = {key: i for i, key in enumerate(_keys(known.edges, known.limits))}
    found = [there.get(key, -1) for key in _keys(edges, limits)]
    # new ones are overwritten
    both, missed = known.both.take(found, 1, mode="wrap"), known.missed.take(found, 1, mode="wrap")
    margin = known.margin.take(found, 0, mode="wrap")
    new = [i for i, old in enumerate(found) if old < 0]
    if new:
        for i, samples in _read(known, edges, new):
            both[:, i], missed[:, i], margin[i] = samples, 0.0, SEEN
            new.remove(i)
    if new:
        here = (limits[0] and new[0] == 0, limits[1] and new[-1] == p - 1)
        both[:, new], margin[new] = _samples(view, edges[:-1][new], edges[1:][new], here)
        missed[:, new] = remainder(both[:, new], rule(NODES))
    return Mesh(edges, both, missed, length, limits, margin)


def mirrored(mesh: Mesh, about: float) -> Mesh:
    """The mesh seen from the other side, x -> about - x."""
    return Mesh(
        edges=about - mesh.edges[::-1],
        both=mesh.both[:, ::-1, ::-1] * np.array([1.0, -1.0])[:, None, None],
        missed=mesh.missed[:, ::-1],
        length=mesh.length[::-1],
        limits=mesh.limits[::-1],
        margin=mesh.margin[::-1, ::-1],
    )


def joined(low: Mesh, high: Mesh) -> Mesh:
    """Two meshes that share the edge between them."""
    return Mesh(
        edges=np.concatenate([low.edges, high.edges[1:]]),
        both=np.concatenate([low.both, high.both], axis=1),
        missed=np.concatenate([low.missed, high.missed], axis=1),
        length=np.concatenate([low.length, high.length]),
        limits=(low.limits[0], high.limits[1]),
        margin=np.concatenate([low.margin, high.margin]),
    )


def _read(known: Mesh, edges: Floats, new: list[int]) -> list[tuple[int, Floats]]:
    """Panels, and J and tau (2, n) on them, that the series of known panels give.

    A series that has not ended in rounding gives none; nor does one on a panel where the
    effort is much smaller than elsewhere: of that it has lost digits.
    """
    r = rule(NODES)
    last = known.panels - 1
    children: dict[int, list[tuple[int, float, float]]] = {}
    starts, spans = known.edges.tolist(), known.length.tolist()
    places = edges.tolist()
    for i in new:
        low, high = places[i], places[i + 1]
        p = bisect_left(starts, (low + high) / 2) - 1
        limited = (known.limits[0] and p == 0) or (known.limits[1] and p == last)
        if limited or not 0 <= p <= last:
            continue
        start, share = (low - starts[p]) / spans[p], (high - low) / spans[p]
        if start >= 0 and start + share <= 1 + SLIP:
            children.setdefault(p, []).append((i, start, share))
    found = []
    for p, parts in children.items():
        whole = known.both[:, p]
        largest_J, largest = np.maximum.reduce(np.abs(whole), axis=1).tolist()
        missed_J, missed = known.missed[:, p].tolist()
        if not (missed_J <= RESOLVED * largest_J and missed <= RESOLVED * largest):
            continue
        for i, start, share in parts:
            samples = part_of(whole, r, start, share)
            first, final = samples[1, 0], samples[1, -1]
            if min(abs(first), abs(final)) >= STRONG * largest and np.isfinite(samples).all():
                found.append((i, samples))
    return found


def bisected(edges: Floats, chosen: NDArray[np.bool_]) -> Floats:
    """Edges with the chosen panels cut in two."""
    middle = (edges[:-1] + edges[1:])[chosen] / 2
    return np.sort(np.concatenate([edges, middle]))


def cut(edges: Floats, pieces: NDArray[np.intp]) -> Floats:
    """Edges with every panel cut into 1, 2 or 4 equal pieces (any count above 2 is 4)."""
    places = edges.tolist()
    found = places[:1]
    for low, high, many in zip(places[:-1], places[1:], pieces.tolist(), strict=True):
        width = high - low
        if many > 2:
            found += [low + width / 4, low + width / 2, low + width * 0.75]
        elif many > 1:
            found.append(low + width / 2)
        found.append(high)
    return np.array(found)


def places(low: Floats, high: Floats, limits: tuple[bool, bool], n: int = NODES) -> Floats:
    """x at the nodes of panels, seen from the nearer end: (p, n)."""
    r = rule(n)
    length = (high - low)[:, None]
    half = n // 2
    x = low[:, None] + length * r.low
    x[:, half:] = high[:, None] - length * r.high[half:]
    if limits[0]:
        x[0] = low[0] + length[0] * r.low**2
    if limits[1]:
        x[-1] = high[-1] - length[-1] * r.high**2
    return np.asarray(x)


def _samples(
    view: View, low: Floats, high: Floats, limits: tuple[bool, bool]
) -> tuple[Floats, Floats]:
    r = rule(NODES)
    sample = view.meter.sample(view.q(places(low, high, limits)))
    both = np.array([sample.J, view.sign * sample.tau])
    for at_limit, row, share in ((limits[0], 0, r.low), (limits[1], -1, r.high)):
        if at_limit:
            slope = 2 * np.sqrt(high[row] - low[row]) * share
            both[0, row] *= slope**2
            both[1, row] *= slope
    return both, np.where(feasible(sample), sample.margin, 0.0)


def _keys(edges: Floats, limits: tuple[bool, bool]) -> list[tuple[float, float, bool]]:
    e = edges.tolist()
    keys = [(a, b, False) for a, b in itertools.pairwise(e)]
    for at_limit, i in ((limits[0], 0), (limits[1], -1)):
        if at_limit:
            keys[i] = (keys[i][0], keys[i][1], True)
    return keys
