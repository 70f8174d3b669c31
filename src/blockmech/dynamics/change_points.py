"""Across change points: the system of a mechanism whose dyads follow the motion.

At a change point the determinant of a dyad is zero and rates are 0/0, but their limits
exist, and inertia and effort go through smoothly as functions of the driver. The nearer a pose,
the fewer digits are left: a position loses eps/d and a rate eps/d^2 at the distance d. So near a
change point these functions are read from a Chebyshev series through poses on both sides: the
widest one, with the fewest poses, that is smooth.

The margin there is that at the ends of the series: the motion runs on, it is no dead centre.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from blockmech.dynamics.motion import Floats
from blockmech.dynamics.system import One, Sample, Source, System
from blockmech.series import coefficients, nodes

SIZES = (8, 12, 16, 20, 24)  # poses of a series; even, so that none is at the change point
REACH = 1.2  # [rad] or that share of a driver's span / 2 pi: of a series, on either side
SHORTEST = REACH / 64
APART = 0.45  # of the distance to the next change point or kink: both sides keep clear of it
ENDED = 1e-13  # end of a series, relative: what poses a tenth of a radian away leave, eps / d^2
USED = 0.5  # share of the reach within which the series is read: its ends are less exact


@dataclass(frozen=True)
class Series:
    """Inertia and effort at rest through a change point.

    place : [rad or m] the change point
    reach : [rad or m] of the series on either side
    margin : [-] the smaller one at the ends of what is read
    coefficients : (2, n) of J and tau
    """

    place: float
    reach: float
    margin: float
    coefficients: Floats

    @property
    def n(self) -> int:
        """Number of poses."""
        return int(self.coefficients.shape[1])

    @cached_property
    def nodes(self) -> Floats:
        """Driver coordinates (n,) of the poses that the series goes through."""
        return self.place + self.reach * nodes(self.n)

    @cached_property
    def slope(self) -> Floats:
        """Coefficients of dJ/dq: it loses fewer digits than that of poses."""
        return chebyshev.chebder(self.coefficients[0]) / self.reach

    def weights(self, offset: Floats) -> Floats:
        """Weights (m, n) of the poses at distances (m,) [rad or m] from the change point."""
        polynomials = chebyshev.chebvander(offset / self.reach, self.n - 1)
        return np.asarray(polynomials @ coefficients(np.eye(self.n)).T)


def series_through(compiled: Source) -> tuple[Series, ...]:
    """The series of all change points; none where no dyad follows the motion.

    Where no smooth series is found, the change point stays a dead centre.
    """
    followed = compiled.structure.followed
    if not followed or len(compiled.structure.drivers) > 1:
        return ()
    plain = System(compiled)
    points = sorted({p for f in followed.values() for p in f.points})
    if plain.rotary[0]:
        turns = round((period_through(compiled, plain.period) or math.tau) / math.tau)
        points = [p + math.tau * k for k in range(turns) for p in points]
    found = (_longest(plain, p, points) for p in points)
    return tuple(s for s in found if s is not None)


def period_through(compiled: Source, period: float | None) -> float | None:
    """With an odd number of change points a turn, all is the same again only after two."""
    odd = any(len(f.points) % 2 for f in compiled.structure.followed.values())
    if period is None or not odd:
        return period
    return math.tau * math.lcm(2, round(period / math.tau))


def _longest(plain: System, place: float, points: Sequence[float]) -> Series | None:
    """The longest series that is smooth."""
    rotary = plain.rotary[0]
    scale = 1.0 if rotary else plain.span / math.tau
    reach = REACH * scale
    for other in [*points, *plain.knots]:
        d = other - place
        d = math.remainder(d, plain.period or math.tau) if rotary else d
        reach = min(reach, APART * abs(d)) if d else reach
    while reach >= SHORTEST * scale:
        for n in SIZES:
            found = _series(plain, place, reach, n)
            if found is not None:
                return found
        reach /= 2
    return None


def _series(plain: System, place: float, reach: float, n: int) -> Series | None:
    """The series of one reach through n poses; None where they are too few or not possible."""
    used = USED * reach
    sample = plain.sample(np.concatenate([place + reach * nodes(n), [place - used, place + used]]))
    if not sample.possible.all():
        return None
    found = coefficients(np.array([sample.J, sample.tau])[:, :n])
    size = np.abs(found)
    if not (size[:, -2:].max(axis=1) <= ENDED * size.max(axis=1)).all():
        return None
    return Series(place, reach, float(sample.margin[n:].min()), found)


class FollowingSystem(System):
    """A system that reads inertia and effort from series near its change points."""

    table = None

    @property
    def noise(self) -> float:
        """What the series leave out."""
        return ENDED

    @cached_property
    def period(self) -> float | None:
        """Period [rad] of everything that depends on the driver's coordinate."""
        return period_through(self.compiled, super().period)

    @property
    def series(self) -> tuple[Series, ...]:
        """Those of its change points."""
        return self.compiled.once(series_through)

    def _offset(self, q: Any, series: Series) -> Any:
        """Distance from a change point, or from the nearest of its images."""
        d = q - series.place
        whole = self.period or math.tau
        return d - whole * np.round(d / whole) if self.rotary[0] else d

    def sample(self, q: Floats, qd: Any = 0.0, t: float = 0.0) -> Sample:
        """J, tau and margin at states of any shape."""
        flat = q.ravel()
        rates = np.broadcast_to(np.asarray(qd, dtype=np.float64), q.shape).ravel()
        away = flat.copy()
        near = []
        for series in self.series:
            d = self._offset(flat, series)
            mask = np.abs(d) < USED * series.reach
            away[mask] += USED * series.reach - d[mask]
            near.append((series, mask, d[mask]))
        found = [np.array(x) for x in super().sample(away, rates, t)]
        for series, mask, d in near:
            if mask.any():
                tau = self._effort(series, d, rates[mask], t)
                J = chebyshev.chebval(d / series.reach, series.coefficients[0])
                for column, value in zip(found, (J, tau, series.margin), strict=True):
                    column[mask] = value
        return Sample(*(x.reshape(q.shape) for x in found))

    def _effort(self, series: Series, d: Floats, qd: Floats, t: float) -> Floats:
        """tau (m,) at distances from a change point: of rates and times, between the poses."""
        if self.depends_on <= {"q"}:
            return np.asarray(chebyshev.chebval(d / series.reach, series.coefficients[1]))
        nodes = np.tile(series.nodes, d.size)
        there = super().sample(nodes, np.repeat(qd, series.n), t)
        return np.asarray((there.tau.reshape(d.size, -1) * series.weights(d)).sum(axis=1))

    def one(self, q: float, qd: float = 0.0, t: float = 0.0) -> One:
        """One state."""
        for series in self.series:
            d = float(self._offset(q, series))
            if abs(d) < USED * series.reach:
                x = d / series.reach
                J, dJ = (
                    float(chebyshev.chebval(x, c)) for c in (series.coefficients[0], series.slope)
                )
                tau = float(self._effort(series, np.array([d]), np.array([qd]), t)[0])
                return One(J, tau, dJ, series.margin)
        return super().one(q, qd, t)


def system_of(compiled: Source, **given: Any) -> System:
    """The system of a mechanism, across its change points where dyads follow the motion."""
    kind = FollowingSystem if compiled.structure.followed else System
    return kind(compiled, **given)
