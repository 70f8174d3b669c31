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
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from blockmech.dynamics.panel_nodes import MARGIN, TAU, J, basis, rule
from blockmech.dynamics.place_data import PlaceData, coordinate_at
from blockmech.dynamics.programs import Sample, ScalarTerms
from blockmech.dynamics.source import Source
from blockmech.dynamics.system import System
from blockmech.ground.plane import EPS
from blockmech.typing import Floats, Real

SIZES = (8, 12, 16, 20, 24)  # poses of a series: 8, as two tell its end; even: none at its middle
REACH = 1.2  # [rad] or that share of a driver's span / 2 pi: of a series, on either side
SHORTEST = REACH / 64
APART = 0.45  # of the distance to the next change point or kink: both sides keep clear of it
ENDED = EPS / (REACH / SIZES[-1]) ** 2  # end of a series, relative: eps / d^2, d to the next pose
USED = 0.5  # share of the reach within which the series is read: its ends are less exact


def pieces_through(compiled: Source) -> tuple[PlaceData, ...]:
    """Series through all change points, which are their middles; none where no dyad follows.

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
    return tuple(s for s in (_longest(plain, p, points) for p in points) if s is not None)


def period_through(compiled: Source, period: float | None) -> float | None:
    """With an odd number of change points a turn, all is the same again only after two."""
    needs_two_turns = any(len(f.points) % 2 for f in compiled.structure.followed.values())
    if period is None or not needs_two_turns:
        return period
    return math.tau * math.lcm(2, round(period / math.tau))


def _longest(plain: System, point: float, points: Sequence[float]) -> PlaceData | None:
    """The longest series that is smooth."""
    rotary = plain.rotary[0]
    scale = 1.0 if rotary else plain.span / math.tau
    reach = REACH * scale
    for neighbour in [*points, *plain.knots]:
        d = neighbour - point
        d = math.remainder(d, plain.period or math.tau) if rotary else d
        reach = min(reach, APART * abs(d)) if d else reach
    while reach >= SHORTEST * scale:
        for n in SIZES:
            piece = _piece(plain, point, reach, n)
            if piece is not None:
                return piece
        reach /= 2
    return None


def _piece(plain: System, point: float, reach: float, n: int) -> PlaceData | None:
    """The series of one reach through n poses; None where they are too few or not possible.

    Its rows: J, tau at rest, the least margin at the ends of what is read, and dJ/dq, which loses
    fewer digits than that of poses.
    """
    low, high, used = point - reach, point + reach, USED * reach
    q = coordinate_at(low, high, 0, rule(n).v)
    sample = plain.sample(np.append(q, [point - used, point + used]))
    if not sample.possible.all():
        return None
    rows = np.array([sample.J[:n], sample.tau[:n], np.full(n, sample.margin[n:].min())])
    series = PlaceData(low, high, 0, rows).series
    size = np.abs(series[:MARGIN])
    if not (size[:, -2:].max(axis=1) <= ENDED * size.max(axis=1)).all():
        return None
    slope = basis(rule(n).v, n - 1) @ chebyshev.chebder(series[J]) / reach
    return PlaceData(low, high, 0, np.vstack([rows, slope]))


class FollowingSystem(System):
    """A system that reads inertia and effort from series near its change points."""

    @property
    def noise(self) -> float:
        """What the series leave out."""
        return ENDED

    @cached_property
    def period(self) -> float | None:
        """Period [rad] of everything that depends on the driver's coordinate."""
        return period_through(self.compiled, super().period)

    @cached_property
    def pieces(self) -> tuple[PlaceData, ...]:
        """Series through its change points."""
        return self.compiled._once(pieces_through)

    def _offset(self, q: Real, piece: PlaceData) -> Real:
        """Distance from a change point, or from the nearest of its images, per reach."""
        half = piece.length / 2
        d = q - (piece.low + half)
        turn = self.period or math.tau
        return (d - turn * np.round(d / turn) if self.rotary[0] else d) / half

    def sample(self, q: Floats, qd: Real = 0.0, t: float = 0.0) -> Sample:
        """J, tau and margin at states of any shape."""
        flat = q.ravel()
        rates = np.broadcast_to(np.asarray(qd, dtype=np.float64), q.shape).ravel()
        away, covered = flat.copy(), []
        for piece in self.pieces:
            d = self._offset(flat, piece)
            mask = np.abs(d) < USED
            away[mask] += (USED - d[mask]) * piece.length / 2
            covered.append((piece, mask, d[mask]))
        sampled = np.array(super().sample(away, rates, t)[: MARGIN + 1])
        for piece, mask, d in covered:
            if d.size:
                sampled[:, mask] = self._rows(piece, d, rates[mask], t)[: MARGIN + 1]
        return Sample(*(x.reshape(q.shape) for x in sampled))

    def _rows(self, piece: PlaceData, d: Floats, qd: Floats, t: float) -> Floats:
        """Rows of a piece (4, m); the effort of rates and times is read between its poses."""
        n = piece.rows.shape[1]
        values = basis((d + 1) / 2, n)
        rows: Floats = piece.series @ values.T
        if not self.depends_on <= {"q"}:
            nodes = np.tile(coordinate_at(piece.low, piece.high, 0, rule(n).v), d.size)
            tau = super().sample(nodes, np.repeat(qd, n), t).tau.reshape(d.size, n)
            rows[TAU] = (tau * (values @ rule(n).to_series)).sum(axis=1)
        return rows

    def scalar_terms(
        self, q: float, qd: float = 0.0, t: float = 0.0, *states: Floats | float | None
    ) -> ScalarTerms:
        """One state; of ``states`` there are none."""
        for piece in self.pieces:
            d = float(self._offset(q, piece))
            if abs(d) < USED:
                J, tau, margin, dJ = self._rows(piece, np.array([d]), np.array([qd]), t)[:, 0]
                return ScalarTerms(float(J), float(tau), float(dJ), float(margin))
        return super().scalar_terms(q, qd, t)


def system_of(compiled: Source, **options: Any) -> System:
    """The system of a mechanism, across its change points where dyads follow the motion.

    With signal blocks or friction laws that have states, a motion ends in a change point: states
    are not read between poses.
    """
    structure = compiled.structure
    kind = FollowingSystem if structure.followed and not structure.states else System
    return kind(compiled, **options)
