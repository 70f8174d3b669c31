"""Standstills of a conservative motion: roots and dips of its energy, from the series.

The kinetic energy ahead is K0 plus the integral of the effort. On sampled panels it is a
series, so its roots and the places where it nearly vanishes cost no kernel call.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats, crossing, integral_one, rule, series_one
from blockmech.dynamics.path.mesh import Mesh
from blockmech.dynamics.path.quadrature import ROUNDING

SLOW = 1e-3  # share of the largest energy below which a dip is looked at closely


class Energies(NamedTuple):
    """Kinetic energy along a mesh, from its low end."""

    edges: Floats  # (p + 1,) [J]
    nodes: Floats  # (p, n) [J]
    lost: Floats  # (p + 1,) [J] error from truncation so far
    rounding: Floats  # (p + 1,) [J]
    tails: Floats  # (p,) [J] truncation error of each panel


class Dip(NamedTuple):
    """A place where the motion nearly stops."""

    panel: int
    phi: float
    x: float
    K: float


def energies(mesh: Mesh, K0: float) -> Energies:
    """K on every panel, with its error."""
    r = rule(mesh.nodes)
    half, tau = mesh.length / 2, mesh.tau
    tails = half * mesh.missed[1]
    sums = np.zeros((3, mesh.panels + 1))
    sums[0, 1:] = half * (tau @ r.total)
    sums[1, 1:] = tails
    sums[2, 1:] = (ROUNDING * half) * (np.abs(tau) @ r.total)
    np.add.accumulate(sums, axis=1, out=sums)
    edges, lost, rounding = sums
    edges += K0
    rounding += ROUNDING * K0
    inside = tau @ r.integrate
    inside *= half[:, None]
    inside += edges[:-1, None]
    return Energies(edges, inside, lost, rounding, tails)


def first_panel_too_long(mesh: Mesh, known: Energies) -> float:
    """A shorter end for the first panel, where the motion stops before its first node."""
    if known.nodes[0, 0] > 0 or mesh.limits[0]:
        return 0.0
    place = float(mesh.edges[0] + mesh.length[0] * rule(mesh.nodes).low[0])
    return place if place > mesh.edges[0] else 0.0


class Stop(NamedTuple):
    """The first panel on which the motion stops, and the angle before which it does."""

    panel: int
    before: float


def first_stop(mesh: Mesh, known: Energies) -> tuple[Stop | None, list[Dip]]:
    """Where the energy first goes to zero, roughly, and the dips up to there."""
    stopped = (known.nodes.min(axis=1) <= 0) | (known.edges[1:] <= 0)
    p = int(stopped.argmax())
    if not stopped[p]:
        p = mesh.panels
    dips = _dips(mesh, known, min(p + 1, mesh.panels))
    passed: list[Dip] = []
    for dip in dips:
        if dip.panel > p:
            break
        passed.append(dip)
        if dip.K <= 0:
            return Stop(dip.panel, dip.phi), passed
    return (None if p == mesh.panels else Stop(p, math.pi)), passed


def standstill(mesh: Mesh, known: Energies, stop: Stop) -> float:
    """x at which the energy is zero: Newton's method on the series, bracketed by nodes."""
    p, before = stop
    r = rule(mesh.nodes)
    half, start = float(mesh.length[p]) / 2, float(known.edges[p])
    low, high, K_low, K_high = 0.0, before, start, -1.0
    fall_low, fall_high = 0.0, 0.0  # dK/dphi
    falls = (half * np.sin(r.phi) * mesh.tau[p]).tolist()
    for phi, K, fall in zip(r.phi.tolist(), known.nodes[p].tolist(), falls, strict=True):
        if phi >= before:
            break
        if K <= 0:
            high, K_high, fall_high = phi, K, fall
            break
        low, K_low, fall_low = phi, K, fall
    else:
        K_high = float(known.edges[p + 1])
    s, c = mesh.tau[p] @ r.sine, mesh.tau[p] @ r.cosine
    phi = crossing((K_low, K_high), (low, high), (fall_low, fall_high))
    if not low < phi < high:
        phi = (low + high) / 2
    for _ in range(60):
        K = start + half * integral_one(s, phi)
        if K > 0:
            low = phi
        else:
            high = phi
        slope = half * math.sin(phi) * series_one(c, phi)
        new = phi - K / slope if slope else math.inf
        if not low <= new <= high:
            new = (low + high) / 2
        done = abs(new - phi) <= 1e-9 * phi  # the next step would be its square
        phi = new
        if done:
            break
    return place_in(mesh, p, phi)


def first_zero(mesh: Mesh, known: Energies) -> tuple[float | None, list[Dip]]:
    """First x at which the energy has gone to zero, and the dips before it."""
    stop, dips = first_stop(mesh, known)
    if stop is None:
        return None, dips
    x = standstill(mesh, known, stop)
    return x, [dip for dip in dips if dip.x < x or dip.K <= 0]


def place_in(mesh: Mesh, p: int, phi: float) -> float:
    """x at the angle phi of panel p, seen from the nearer end."""
    low, high = float(mesh.edges[p]), float(mesh.edges[p + 1])
    power = 4 if _at_limit(mesh, p) else 2
    if power == 4 and p == 0 and mesh.limits[0]:
        return low + (high - low) * math.sin(phi / 2) ** 4
    if power == 4 or phi > math.pi / 2:
        return high - (high - low) * math.cos(phi / 2) ** power
    return low + (high - low) * math.sin(phi / 2) ** 2


def _at_limit(mesh: Mesh, p: int) -> bool:
    return (p == 0 and mesh.limits[0]) or (p == mesh.panels - 1 and mesh.limits[1])


def _dips(mesh: Mesh, known: Energies, panels: int) -> list[Dip]:
    """Places where the effort turns from braking to driving at little energy.

    Looked for between neighbouring nodes, and between the outer nodes and the ends.
    """
    n, r = mesh.nodes, rule(mesh.nodes)
    K = np.empty(panels * n + 2)
    K[0], K[1:-1], K[-1] = known.edges[0], known.nodes[:panels].ravel(), known.edges[panels]
    slow = SLOW * K.max() > K  # none at all as well: an end whose energy is but rounding
    beside = slow[1:] | slow[:-1]
    if not beside.any():
        return []
    tau = np.empty(panels * n + 2)
    tau[0], tau[-1] = mesh.tau[0] @ r.ends[:, 0], mesh.tau[panels - 1] @ r.ends[:, 1]
    tau[1:-1] = mesh.tau[:panels].ravel()
    found = []
    for i in (beside & (tau[:-1] < 0) & (tau[1:] >= 0)).nonzero()[0].tolist():
        if not K[i] > 0:
            continue
        p, j = divmod(i - 1, n) if i else (0, -1)  # between nodes j and j + 1 of panel p
        low = float(r.phi[j]) if j >= 0 else 0.0
        high = float(r.phi[j + 1]) if j + 1 < n else math.pi
        if j + 1 == n and p + 1 < panels and mesh.tau[p] @ r.ends[:, 1] < 0:
            p, low, high = p + 1, 0.0, float(r.phi[0])
        phi = _sign_change(mesh.tau[p] @ r.cosine, low, high)
        half = float(mesh.length[p]) / 2
        depth = float(known.edges[p]) + half * integral_one(mesh.tau[p] @ r.sine, phi)
        found.append(Dip(p, phi, place_in(mesh, p, phi), depth))
    return found


def _sign_change(c: Floats, low: float, high: float) -> float:
    """Where a series turns positive between two angles."""
    for _ in range(80):
        middle = (low + high) / 2
        if not low < middle < high:
            break
        if series_one(c, middle) < 0:
            low = middle
        else:
            high = middle
    return (low + high) / 2
