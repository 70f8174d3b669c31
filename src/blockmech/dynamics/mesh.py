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

from dataclasses import dataclass

import numpy as np

from blockmech.dynamics.chebyshev import Floats, rule
from blockmech.dynamics.reduced import Metered, feasible

NODES = 32  # a panel


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


@dataclass(frozen=True)
class Mesh:
    """Panels in order of growing x, with their samples.

    Attributes
    ----------
    edges : (p + 1,) [rad or m] x at the panels' ends
    J, tau : (p, n) samples for the panels' coordinate v, effort along growing x
    length : (p,) length in v
    limits : whether the low end, the high end is a dead centre of the driver
    possible : (p, n) whether the mechanism closes there
    """

    edges: Floats
    J: Floats
    tau: Floats
    length: Floats
    limits: tuple[bool, bool]
    possible: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

    @property
    def panels(self) -> int:
        """Number of panels."""
        return int(self.length.size)


def sampled(
    view: View,
    edges: Floats,
    known: Mesh | None = None,
    limits: tuple[bool, bool] = (False, False),
    n: int = NODES,
) -> Mesh:
    """Samples on the panels between ``edges``; those ``known`` already has are reused.

    Cost: one batch call of n samples for every panel that is new.
    """
    p = edges.size - 1
    length = np.diff(edges)
    if limits[0]:
        length[0] = np.sqrt(length[0])
    if limits[1]:
        length[-1] = np.sqrt(length[-1])
    if known is None:
        J, tau, possible = _samples(view, edges[:-1], edges[1:], limits, n)
        return Mesh(edges, J, tau, length, limits, possible)
    places = _matching(edges, limits, known)
    old = np.flatnonzero(places >= 0)
    new = np.flatnonzero(places < 0)
    J, tau = np.empty((p, n)), np.empty((p, n))
    possible = np.empty((p, n), dtype=bool)
    J[old], tau[old] = known.J[places[old]], known.tau[places[old]]
    possible[old] = known.possible[places[old]]
    if new.size:
        here = (limits[0] and new[0] == 0, limits[1] and new[-1] == p - 1)
        J[new], tau[new], possible[new] = _samples(view, edges[new], edges[new + 1], here, n)
    return Mesh(edges, J, tau, length, limits, possible)


def mirrored(mesh: Mesh, about: float) -> Mesh:
    """The mesh seen from the other side, x -> about - x."""
    return Mesh(
        edges=about - mesh.edges[::-1],
        J=mesh.J[::-1, ::-1],
        tau=-mesh.tau[::-1, ::-1],
        length=mesh.length[::-1],
        limits=mesh.limits[::-1],
        possible=mesh.possible[::-1, ::-1],
    )


def joined(low: Mesh, high: Mesh) -> Mesh:
    """Two meshes that share the edge between them."""
    return Mesh(
        edges=np.concatenate([low.edges, high.edges[1:]]),
        J=np.concatenate([low.J, high.J]),
        tau=np.concatenate([low.tau, high.tau]),
        length=np.concatenate([low.length, high.length]),
        limits=(low.limits[0], high.limits[1]),
        possible=np.concatenate([low.possible, high.possible]),
    )


def bisected(edges: Floats, chosen: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Floats:
    """Edges with the chosen panels cut in two."""
    middle = (edges[:-1] + edges[1:])[chosen] / 2
    return np.sort(np.concatenate([edges, middle]))


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
    view: View, low: Floats, high: Floats, limits: tuple[bool, bool], n: int
) -> tuple[Floats, Floats, np.ndarray[tuple[int, ...], np.dtype[np.bool_]]]:
    r = rule(n)
    x = places(low, high, limits, n)
    sample = view.meter.sample(view.q(x))
    possible = feasible(sample)
    J, tau = np.asarray(sample.J), sample.tau * view.sign
    for at_limit, row, share in ((limits[0], 0, r.low), (limits[1], -1, r.high)):
        if at_limit:
            slope = 2 * np.sqrt(high[row] - low[row]) * share
            J = J.copy()
            J[row] = J[row] * slope**2
            tau[row] = tau[row] * slope
    return J, tau, possible


def _matching(
    edges: Floats, limits: tuple[bool, bool], known: Mesh
) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Index in ``known`` of every panel, -1 where it is new."""
    here = _keys(edges, limits)
    there = {key: i for i, key in enumerate(_keys(known.edges, known.limits))}
    return np.array([there.get(key, -1) for key in here], dtype=np.intp)


def _keys(edges: Floats, limits: tuple[bool, bool]) -> list[tuple[float, float, bool]]:
    e = edges.tolist()
    last = len(e) - 2
    return [
        (e[i], e[i + 1], (limits[0] and i == 0) or (limits[1] and i == last))
        for i in range(last + 1)
    ]
