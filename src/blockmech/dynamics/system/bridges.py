r"""Across change points: the reduced system of a mechanism whose dyads follow the motion.

At a change point the determinant of a dyad is zero and rates are 0/0, but their limits
exist, and inertia, effort and damping go through smoothly as functions of the driver.
The nearer a pose, the fewer digits are left: a position loses eps/d and a rate eps/d^2
at the distance d. So near a change point these functions are read from a Chebyshev
series through poses on both sides: the widest one, with the fewest poses, that is smooth.

The margin there is that at the bridge's ends: the motion runs on, it is no dead centre.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.polynomial import chebyshev

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.system.reduced import TURN, OneFunction, ReducedSystem, Sample, feasible
from blockmech.model.structure import Structure

SIZES = (8, 12, 16, 20, 24)  # poses of a series; even, so that none is at the change point
REACH = 1.2  # [rad] or that share of a driver's span / 2 pi: of a series, on either side
SHORTEST = REACH / 64
APART = 0.45  # of the distance to the next change point or knot that a series may cover
ENDED = 1e-12  # end of a series, relative, that is good enough; otherwise it is made shorter
USED = 0.5  # share of the reach within which the series is read


@cache
def _nodes(n: int) -> tuple[Floats, Floats]:
    """Chebyshev nodes (n,) of [-1, 1], and the matrix from values there to their series."""
    x: Floats = np.asarray(np.cos((np.arange(n) + 0.5) * math.pi / n))
    to_series: Floats = np.asarray(np.linalg.inv(chebyshev.chebvander(x, n - 1)))
    return x, to_series


@dataclass(frozen=True)
class Bridge:
    """Series through a change point.

    place : [rad or m] the change point
    reach : [rad or m] of the series on either side
    margin : [-] the smaller one at the ends of the bridge
    rows : (4, nodes) J, tau, dJ/dq and damping at the nodes
    """

    place: float
    reach: float
    margin: float
    rows: Floats

    @property
    def nodes(self) -> Floats:
        """Driver coordinates (nodes,) of the poses that the series goes through."""
        return np.asarray(self.place + self.reach * _nodes(self.rows.shape[1])[0])

    def weights(self, offset: Floats) -> Floats:
        """Weights (m, nodes) of the poses at distances (m,) [rad or m] from the change point."""
        n = self.rows.shape[1]
        return np.asarray(chebyshev.chebvander(offset / self.reach, n - 1) @ _nodes(n)[1])

    @cached_property
    def polynomials(self) -> list[list[float]]:
        """J, tau, dJ/dq and damping in powers of offset / reach, highest first."""
        series = self.rows @ _nodes(self.rows.shape[1])[1].T
        return [chebyshev.cheb2poly(row)[::-1].tolist() for row in series]


def bridged(system: ReducedSystem, structure: Structure) -> ReducedSystem:
    """The system with its change points bridged; itself where no dyad follows the motion.

    With an odd number of change points a turn, the mechanism is the same again only after
    two turns. Where no smooth series is found, the change point stays a dead centre.
    """
    if not structure.followed:
        return system
    period = system.period
    if period is not None and any(len(f.points) % 2 for f in structure.followed.values()):
        period = TURN * math.lcm(2, round(period / TURN))
        system = replace(system, period=period)
    points = sorted({p for f in structure.followed.values() for p in f.points})
    if system.kind == "rotation":
        turns = round((period or TURN) / TURN)
        points = [p + TURN * k for k in range(turns) for p in points]
    found = (_bridge(system, p, points) for p in points)
    bridges = [b for b in found if b is not None]
    return _Bridged(system, bridges).system() if bridges else system


def _bridge(system: ReducedSystem, place: float, points: Sequence[float]) -> Bridge | None:
    """The longest series that is smooth."""
    scale = 1.0 if system.kind == "rotation" else system.span / TURN
    reach = REACH * scale
    obstacles = [p for p in points if p != place] + list(system.knots)
    for other in obstacles:
        d = other - place
        if system.kind == "rotation":
            d = math.remainder(d, system.period or TURN)
        if d:
            reach = min(reach, APART * abs(d))
    while reach >= SHORTEST * scale:
        for n in SIZES:
            found = _series(system, place, reach, n)
            if found is not None:
                return found
        reach /= 2
    return None


def _series(system: ReducedSystem, place: float, reach: float, n: int) -> Bridge | None:
    """The series of one reach through n poses; None where they are too few or not possible."""
    used, (x, to_series) = USED * reach, _nodes(n)
    q = np.concatenate([place + reach * x, [place - used, place + used]])
    with np.errstate(all="ignore"):
        sample = system.sample(q, frozenset({"damping"}) if system.damped else frozenset())
    if not feasible(sample).all():
        return None
    damping = np.zeros(q.size) if sample.damping is None else sample.damping
    rows = np.array([sample.J, sample.tau, sample.J, damping])[:, :n]
    # dJ/dq of the series itself: it loses fewer digits, and a run keeps its energy
    rows[2] = chebyshev.chebval(x, chebyshev.chebder(to_series @ rows[0])) / reach
    series = np.abs(rows[:2] @ to_series.T)
    if (series[:, -2:].max(axis=1) <= ENDED * series.max(axis=1) + 1e-300).all():
        return Bridge(place, reach, float(sample.margin[n:].min()), rows)
    return None


class _Bridged:
    """The functions of a system, read from a bridge near each change point."""

    def __init__(self, under: ReducedSystem, bridges: list[Bridge]) -> None:
        self.under, self.bridges = under, bridges
        self.rotary = under.kind == "rotation"
        self.period = under.period or TURN
        self.plain = under.depends_on <= {"q"} or (
            under.rate_load is None and "time" not in under.depends_on
        )

    def system(self) -> ReducedSystem:
        """The reduced system."""
        under = self.under
        kernels = under.rate_load is not None and under.rate_load_kernels
        return replace(
            under,
            sample=self.sample,
            one=self.one(under.one),
            pose=self.one(under.pose or under.one),
            rate_load=self.rate_load if kernels else under.rate_load,
        )

    def offsets(self, q: Floats, bridge: Bridge) -> Floats:
        """Distances (n,) from a change point, the nearest of its images."""
        d = q - bridge.place
        return d - self.period * np.round(d / self.period) if self.rotary else d

    def sample(self, q: Floats, wanted: frozenset[str]) -> Sample:
        """A batch, as `ReducedSystem.sample` says."""
        found = self.bridges
        offsets = [self.offsets(q, bridge) for bridge in found]
        on = [np.abs(d) < USED * b.reach for d, b in zip(offsets, found, strict=True)]
        away = q.copy()
        for d, mask, bridge in zip(offsets, on, found, strict=True):
            away[mask] += USED * bridge.reach - d[mask]
        given = self.under.sample(away, wanted)
        columns = [None if c is None else np.array(c) for c in given]
        for d, mask, bridge in zip(offsets, on, found, strict=True):
            if mask.any():
                values = bridge.rows @ bridge.weights(d[mask]).T
                J, tau, dJ, damping = values
                new = (J, tau, bridge.margin, dJ, damping)
                for column, value in zip(columns, new, strict=True):
                    if column is not None:
                        column[mask] = value
        return Sample(*columns)  # type: ignore[arg-type]

    def rate_load(self, q: Floats, qd: Floats, t: float) -> Floats:
        """What follows rate and time, as `ReducedSystem.rate_load` says."""
        load = self.under.rate_load
        assert load is not None
        found = np.array(load(q, qd, t))
        for bridge in self.bridges:
            d = self.offsets(q, bridge)
            mask = np.abs(d) < USED * bridge.reach
            m = int(mask.sum())
            if m:
                n = bridge.nodes.size
                at = np.tile(bridge.nodes, m), np.repeat(np.broadcast_to(qd, q.shape)[mask], n)
                values = np.asarray(load(*at, t)).reshape(m, n)
                found[mask] = (values * bridge.weights(d[mask])).sum(axis=1)
        return found

    def one(self, under: OneFunction) -> OneFunction:
        """One state, as `ReducedSystem.one` says."""
        rotary, period, plain = self.rotary, self.period, self.plain
        extra = self.under.rate_load_one
        zones = [(b.place, USED * b.reach, b) for b in self.bridges]
        remainder = math.remainder

        def one(q: float, qd: float, t: float) -> tuple[float, float, float, float]:
            for place, used, bridge in zones:
                d = remainder(q - place, period) if rotary else q - place
                if -used < d < used:
                    if not plain and extra is None:
                        return _mixed(under, bridge, d, qd, t)
                    J, tau, dJ, damping = _horner(bridge.polynomials, d / bridge.reach)
                    tau -= damping * qd
                    if extra is not None:
                        tau += extra(q, qd, t)
                    return J, tau, dJ, bridge.margin
            return under(q, qd, t)

        return one


def _horner(polynomials: list[list[float]], x: float) -> list[float]:
    found = []
    for powers in polynomials:
        total = 0.0
        for c in powers:
            total = total * x + c
        found.append(total)
    return found


def _mixed(
    under: OneFunction, bridge: Bridge, offset: float, qd: float, t: float
) -> tuple[float, float, float, float]:
    """A state between those at the nodes, for loads of which no more is known."""
    weights = bridge.weights(np.array([offset]))[0]
    rows = np.array([under(float(q), qd, t)[:3] for q in bridge.nodes])
    J, tau, dJ = (weights @ rows).tolist()
    return J, tau, dJ, bridge.margin
