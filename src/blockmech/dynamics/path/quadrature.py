r"""Time as a quadrature over panels of the driver's path.

For a conservative scene, with K the kinetic energy,

    dK/dx = tau(x),        dt = sqrt(J / (2 K)) dx,

so both are integrals of smooth samples. K is known at *anchors*: the start, every
standstill (K = 0), the start's image one turn on. Each panel is walked from its
edge on the side of the nearest anchor, so K keeps its relative accuracy where it
is small. Two kinds of panel:

    regular   t(phi) = (L/2) integral of F sin(phi),            F = sqrt(J / 2K)
    ended     t(phi) = (sqrt(L)/2) integral of F cos(phi/2),    F = 2 sqrt(J L sin^2(phi/2) / 2K)

the latter beginning at a standstill, where F stays smooth although K goes to zero.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.chebyshev import Floats, remainder, rule
from blockmech.dynamics.path.mesh import Mesh

EPS = float(np.finfo(np.float64).eps)
MOST_PANELS = 1024
ROUNDING = 2 * EPS  # of a work, relative to the work turned over: kernels, and sums
TIMED = 8  # roundings of dt = sqrt(J / 2K) dx: those of J and tau by the kernels, root, sums
AVERAGED = 0.1  # what rounding of the coordinates of a panel's samples makes, of that of one


class Anchor(NamedTuple):
    """An edge at which the kinetic energy is known."""

    edge: int
    K: float  # [J]


class Quadrature(NamedTuple):
    """Energy and time on the panels of a mesh, each walked from its anchored edge.

    Arrays (p,) or (p, n), samples in the order in which the panel is walked.

    Attributes
    ----------
    mesh : the panels
    mirrored : walked from the high edge
    ended : begins at a standstill
    K_start : [J] energy at the edge where the panel begins
    J, tau, K, F : samples; tau along the walk
    duration : [s] time to cross each panel
    clock : (p + 1,) [s] time at the edges, from the low end
    closure : (anchors - 1,) [J] disagreement between neighbouring anchors
    truncation : (p,) [s] error of the time from the end of each panel's series
    lost : (p,) [J] error of the work over each panel from the end of its series
    rounded : (p,) [J] error of the work over each panel from rounding
    lost_time, rounded_time : [s] what those do to the time
    doubted : (p,) [s] the same of both, on each panel
    owned : (p,) edge from whose anchor the energy of each panel is summed
    fastest : [rad/s or m/s] largest speed of the driver at the nodes
    """

    mesh: Mesh
    mirrored: NDArray[np.bool_]
    ended: NDArray[np.bool_]
    K_start: Floats
    J: Floats
    tau: Floats
    K: Floats
    F: Floats
    duration: Floats
    clock: Floats
    closure: Floats
    truncation: Floats
    lost: Floats
    rounded: Floats
    lost_time: float
    rounded_time: float
    doubted: Floats
    owned: NDArray[np.intp]
    fastest: float

    @property
    def total(self) -> float:
        """Time to cross all panels [s]."""
        return float(self.clock[-1])

    def speeds(self) -> Floats:
        """Largest speed of the driver on each panel [rad/s or m/s]; everywhere beside a limit."""
        if any(self.mesh.limits):
            return np.full(self.mesh.panels, self.fastest)
        return np.asarray(np.sqrt(2 * (self.K / self.J).max(axis=1)))


def quadrature(mesh: Mesh, anchors: list[Anchor], origin: float = 0.0) -> Quadrature:
    """Energy, then time, on every panel.

    ``origin`` [rad or m] is the driver coordinate at x = 0: samples are taken at rounded
    coordinates.
    """
    r = rule(mesh.nodes)
    L, edges = mesh.length, mesh.edges
    half = L / 2
    p = np.arange(L.size)
    edges_of = np.array([a.edge for a in anchors])
    places = edges[edges_of]
    owner = (places[1:] + places[:-1]).searchsorted(edges[1:] + edges[:-1])  # the nearest anchor
    owned = edges_of[owner]
    mirrored = owned > p
    begin = p + mirrored
    both = mesh.both.copy()
    for i in mirrored.nonzero()[0].tolist():
        both[0, i] = mesh.both[0, i, ::-1]
        np.negative(mesh.both[1, i, ::-1], out=both[1, i])
    J, tau = both

    sums = np.empty((2, L.size))
    sums[0] = half * (mesh.tau @ r.total)
    lost = half * mesh.missed[1]
    rounded = (ROUNDING * half) * (np.abs(tau) @ r.total)
    rounded += (AVERAGED * EPS * (abs(origin) + np.abs(edges[1:]))) * np.ptp(tau, axis=1)
    np.add(lost, rounded, out=sums[1])
    spread = np.array([_outward(sums, a.edge) for a in anchors])  # (anchors, 2, p + 1)
    anchored = np.array([a.K for a in anchors])
    known = anchored[:, None] + spread[:, 0]
    closure = np.array([known[i, b.edge] - b.K for i, b in enumerate(anchors[1:])])
    K_start, K_owned = known[owner, begin], anchored[owner]
    ended = (K_owned == 0.0) & (begin == owned)
    K = tau @ r.integrate
    K *= half[:, None]
    K += K_start[:, None]

    F = np.sqrt(J / (K + K))
    duration, truncation = half * (F @ r.total), half
    # how much time a joule less makes; on an ended panel the energy error is its own
    slowing = (half / 2) * ((F / K) @ r.total)
    still = ended.nonzero()[0].tolist()
    if still:
        truncation = half.copy()
    for i in still:
        root = math.sqrt(L[i])
        F[i] *= (2 * root) * r.root
        truncation[i] = root / 2
        duration[i] = root / 2 * (F[i] @ r.total_half)
        slowing[i] = duration[i] / K[i, -1]

    doubt = ROUNDING * K_owned + np.abs(spread[owner, 1, begin + 1 - 2 * mirrored])
    each = slowing * doubt
    doubted = float(np.add.reduce(each))
    missed = float(np.add.reduce(lost) / (np.add.reduce(sums[1]) + 1e-300))
    return Quadrature(
        mesh=mesh,
        mirrored=mirrored,
        ended=ended,
        K_start=K_start,
        J=J,
        tau=tau,
        K=K,
        F=F,
        duration=duration,
        clock=_summed(duration),
        closure=closure,
        truncation=truncation * remainder(F, r),
        lost=lost,
        rounded=rounded,
        lost_time=doubted * missed,
        rounded_time=doubted * (1 - missed),
        doubted=each,
        owned=owned,
        fastest=_fastest(mesh, mirrored, J, K),
    )


def slow_begins(quad: Quadrature, anchors: list[Anchor]) -> Floats:
    """Time that may be lost before each panel's first sample, unseen by its series [s]; (p,).

    A motion that begins slowly, beside an equilibrium or where the driver has next to no
    inertia, may be fast again at the first node. Its energy at the edge is exact, and tells.
    """
    unseen = np.zeros(quad.mesh.panels)
    r = rule(quad.F.shape[1])
    begin = r.ends[:, 0]
    for edge, K in anchors:
        beside = [i for i in (edge - 1, edge) if 0 <= i < unseen.size and quad.owned[i] == edge]
        for i in beside if K > 0 else ():
            J = abs(float(quad.J[i] @ begin)) + TIMED * EPS * float(quad.J[i].max())
            slower = math.sqrt(J / (2 * K)) - float(quad.F[i] @ begin)
            unseen[i] = quad.mesh.length[i] * r.low[0] * max(slower, 0.0)
    return unseen


def _fastest(mesh: Mesh, mirrored: NDArray[np.bool_], J: Floats, K: Floats) -> float:
    """Largest speed of the driver: beside a dead centre samples are those for v, not for x."""
    if any(mesh.limits):
        r, J = rule(mesh.nodes), J.copy()
        for at_limit, row, share in ((mesh.limits[0], 0, r.low), (mesh.limits[1], -1, r.high)):
            if at_limit:
                slope = 2 * mesh.length[row] * share
                J[row] /= (slope[::-1] if mirrored[row] else slope) ** 2
    return largest_speed(J, K)


def largest_speed(J: Floats, K: Floats) -> float:
    """Largest of sqrt(2 K / J); NaN where a sample is none."""
    most = float((K / J).max())
    return math.sqrt(2 * most) if most >= 0 else math.nan


def _summed(steps: Floats) -> Floats:
    """0 and the running sums."""
    sums = np.zeros(steps.size + 1)
    np.add.accumulate(steps, out=sums[1:])
    return sums


def _outward(steps: Floats, edge: int) -> Floats:
    """Sums of ``steps`` (m, p) from an edge to every other one, negative below it: (m, p + 1)."""
    sums = np.zeros((steps.shape[0], steps.shape[1] + 1))
    np.add.accumulate(steps[:, edge:], axis=1, out=sums[:, edge + 1 :])
    if edge:
        sums[:, edge - 1 :: -1] = -np.add.accumulate(steps[:, edge - 1 :: -1], axis=1)
    return sums


def delay(effort: float, slope: float, inertia: float, total: float, span: float) -> float:
    """How much the crossing time changes with the place of a standstill [s/rad or s/m].

    A share of the whole, and the time constant of the equilibrium that may lie near
    over the distance to it: |tau'/tau| sqrt(J/|tau'|).
    """
    near = math.sqrt(abs(inertia * slope)) / abs(effort) if effort else math.inf
    return total / span + near
