"""The road: place data along the driver's path, made where a motion comes to and kept.

A piece ends where its series would not be smooth: at kinks of loads, dead centres,
places without inertia. It is halved until its series are resolved, so pieces crowd only where
the mechanism asks for it. In a periodic scene the pieces of one period serve all turns and all
runs of a mechanism; they are made at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.panels import HALVINGS, Floats, rule
from blockmech.dynamics.place import (
    DAMPING,
    MARGIN,
    NOTHING,
    SLIPS,
    TAU,
    J,
    PlaceData,
    mesh,
    place,
    possible,
)
from blockmech.plane import EPS
from blockmech.quality import NEAR as LEAST_MARGIN

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

PIECES = 4  # of a turn (or of the span of a slide), to begin with; halved where they are too long
CLOSE = 4 * EPS  # relative distance of two places that are one, but for rounding of their sum


@dataclass(frozen=True)
class Piece:
    """Place data in the coordinate of the motion.

    ends : what ends the road at the low and the high end, "" where it goes on
    cuts : places inside at which a pair with friction reverses
    shift : [rad] whole periods between the two coordinates
    """

    data: PlaceData
    ends: tuple[str, str] = ("", "")
    cuts: tuple[float, ...] = ()
    shift: float = 0.0

    def end(self, sign: int) -> float:
        """The end in a direction of motion."""
        return (self.data.high if sign > 0 else self.data.low) + self.shift

    def what_ends(self, sign: int) -> str:
        """What ends the road there, or nothing."""
        return self.ends[sign > 0]

    def rows(self, q: Floats) -> Floats:
        """Place data (r, m) at places of the motion."""
        return self.data.at(q - self.shift)

    def whole(self, begin: float, end: float) -> Floats | None:
        """Place data (r, n + 1) of a plain panel over all of it, see `PlaceData.forward`.

        They are kept, and not to be written to. None of a panel that is shorter.
        """
        data, low, high = self.data, self.end(-1), self.end(1)
        a, b = (begin, end) if begin < end else (end, begin)
        near = CLOSE * max(abs(a), abs(b))
        if data.limit or abs(a - low) > near or abs(b - high) > near:
            return None
        return self.over_all(1 if begin < end else -1)

    def over_all(self, sign: int) -> Floats:
        """Place data (r, n + 1) of a plain panel over all of it in a direction; see `whole`."""
        return self.data.forward if sign > 0 else self.data.backward

    def shifted(self, by: float) -> Piece:
        """The same some periods further on."""
        cuts = tuple(x + by for x in self.cuts)
        return replace(self, shift=self.shift + by, cuts=cuts) if by else self


@dataclass
class PathMesh:
    """The pieces of a system's path about a start: n nodes each, resolved to a tolerance.

    ``beside``: share by which the ends that the mechanism has are off
    """

    system: System
    start: float
    n: int
    tolerance: float
    beside: float = 0.0
    limits: list[tuple[float, int, str]] = field(default_factory=list)  # place, direction, what

    @cached_property
    def pieces(self) -> list[Piece]:
        """Those that are there, in no order: to begin with, of a period those that are kept."""
        period = self.system.period
        if period is None:
            return []
        kept, key = self.system.kept, ("mesh", self.n, self.system.friction is None)
        if key not in kept:
            edges = self._edges_from(self._half_a_period_before(0.0))
            made = mesh(self._values, edges, self.n, self.tolerance)
            kept[key] = [self._piece(data) for data in made]
        turns = [math.ceil((self.first - x.data.low) / period - CLOSE) for x in kept[key]]
        return [x.shifted(n * period) for x, n in zip(kept[key], turns, strict=True)]

    @cached_property
    def first(self) -> float:
        """Where the period begins whose pieces serve all turns."""
        return self._half_a_period_before(self.start)

    def _half_a_period_before(self, q: float) -> float:
        """An edge of the pieces.

        They keep clear of quarters of a turn, where much that is symmetric is in equilibrium.
        """
        assert self.system.period is not None
        part = self.system.period / PIECES
        return part * (math.floor(q / part - PIECES / 2) + 0.5)

    def known(self, q: float, sign: int) -> Piece | None:
        """The piece ahead of a place; None where none was made yet."""
        shift, near = self._turn(q, sign)
        there = q - shift
        for piece in self.pieces:
            data = piece.data
            ahead = ((data.high if sign > 0 else data.low) + piece.shift - there) * sign
            if near < ahead <= data.length + near:
                return piece.shifted(shift)
        return None

    def ahead(self, q: float, sign: int, length: float = math.inf) -> Piece | str:
        """The piece ahead of a place, no longer than asked if it is new; or why there is none."""
        piece = self.known(q, sign)
        if piece is not None:
            return piece
        shift, near = self._turn(q, sign)
        there = next((x for x in self._edges if abs(x - (q - shift)) <= near), q - shift)
        made = self._made(there, sign, length)
        if isinstance(made, str):
            return made
        self.pieces.append(made)
        return made.shifted(shift)

    def shorten(self, piece: Piece, q: float, sign: int, length: float) -> None:
        """A shorter piece from a place on instead of one that is too long for what happens."""
        self.pieces = [p for p in self.pieces if p.data is not piece.data]
        self.ahead(q, sign, length)

    def _turn(self, q: float, sign: int) -> tuple[float, float]:
        """Whole periods [rad] to the kept one, and a distance that is none but for rounding."""
        period, near = self.system.period, CLOSE * max(abs(q), abs(self.start))
        if period is None:
            return 0.0, near
        shift = period * math.floor((q + sign * near - self.first) / period)
        return shift, near + CLOSE * abs(shift)

    # -- making a piece ------------------------------------------------------------

    def _made(self, q: float, sign: int, length: float) -> Piece | str:
        """A resolved piece from q on."""
        far, what = self._far(q, sign, length)
        limit = self._limit(sign, what)
        for _ in HALVINGS:
            if far == q:
                return what or self._unresolved(q)
            low, high = (q, far) if sign > 0 else (far, q)
            data = PlaceData(low, high, limit, self._rows(low, high, limit))
            bad = ~possible(data.rows)
            if not limit and bad.any():
                nearest = min(place(low, high, 0, rule(self.n).v)[bad], key=lambda x: sign * x)
                far, what = self._last_possible(q, float(nearest))
                far -= sign * self.beside * abs(far) if far != q else 0.0
                self.limits.append((far, sign, what))
                limit = self._limit(sign, what)
                continue
            touched = self._touched(data, sign)
            if touched is not None and abs(touched[0] - far) > math.sqrt(EPS) * data.length:
                far, what, limit = *touched, 0
            elif data.tail <= self.tolerance:
                return self._piece(data, ("", what) if sign > 0 else (what, ""))
            else:
                far, what, limit = (q + far) / 2, "", 0
        return self._unresolved(q)

    def _unresolved(self, q: float) -> str:
        """What ends the road where no piece is short enough: no pose, or series without an end."""
        sample = self.system.sample(np.array([q]))
        good = bool(sample.possible[0]) and sample.margin[0] > math.sqrt(EPS)
        return ends.UNDECIDED if good else ends.IMPOSSIBLE

    def _limit(self, sign: int, what: str) -> int:
        """Direction in which a piece runs into a dead centre in its own variable.

        With friction it does not: what is left of digits there is not enough to solve it. Such a
        road ends at the margin at which integrators end.
        """
        return sign if what == ends.DEAD_CENTRE and self.system.friction is None else 0

    @cached_property
    def _edges(self) -> list[float]:
        """Ends of the first pieces: of a period, or of all that kinks bound."""
        if self.system.period is None:
            return list(self.system.knots)
        return [float(x) for x in self._edges_from(self.first)]

    def _edges_from(self, first: float) -> Floats:
        """Ends of the pieces of a period from a place on."""
        period = self.system.period
        assert period is not None
        ways = {k / PIECES * period for k in range(PIECES + 1)}
        apart = sorted(ways | {(x - first) % period for x in self.system.knots})
        apart = [
            x for x, y in zip(apart, [*apart[1:], math.inf], strict=True) if y - x > CLOSE * period
        ]
        return first + np.array(apart)

    def _far(self, q: float, sign: int, length: float) -> tuple[float, str]:
        """The farthest place that a new piece may reach, and what ends the road there."""
        known_ends = [p.end(-sign) for p in self.pieces] + self._edges
        usual = (self.system.period or self.system.span) / PIECES
        known = [x for p in self.pieces for x in (p.data.low, p.data.high)]
        if self.system.period is None and known:  # along a guide they double
            usual = max(usual, max(known) - min(known))
        ends = [(x, what) for x, way, what in self.limits if way == sign]
        ends += [(x, "") for x in known_ends]
        if self.system.period is None or length < usual:
            ends.append((q + sign * min(length, usual), ""))
        near = CLOSE * max(abs(q), abs(self.start))
        ahead = [x for x in ends if sign * (x[0] - q) > near]
        return min(ahead, key=lambda x: sign * x[0], default=(q + sign * usual, ""))

    def _rows(self, low: float, high: float, limit: int) -> Floats:
        """Values of a piece at its nodes."""
        v = rule(self.n).v
        rows = self._values(place(low, high, limit, v))
        if limit:  # J and tau grow without bound there
            rows[[J, *range(DAMPING, len(rows))]] *= v * v
            rows[TAU] *= v
        return rows

    def _values(self, q: Floats) -> Floats:
        if self.system.friction is not None:
            rows = self.system.friction.rows(q)
            rows[MARGIN] -= self.least
            return rows
        rows = np.array(self.system.sample(q))
        rows[TAU, np.abs(rows[TAU]) <= self.system.rounding(q)] = 0.0
        return np.vstack([rows, self.system.damping(q)]) if self.system.damped else rows

    def _last_possible(self, q: float, far: float) -> tuple[float, str]:
        """The last place from q on at which there is a pose and a load, and what ends there."""
        good, bad = q, far
        if not self._possible_at(np.array([q]))[0]:
            return q, self._why(q, q)
        for _ in HALVINGS:
            x = np.linspace(good, bad, self.n + 1)[1:]
            x = x[(x != good) & (x != bad)]
            if not x.size:
                break
            there = self._possible_at(x)
            if not there.all():
                first = int(np.argmin(there))
                bad = float(x[first])
                x = x[:first]
            if x.size:
                good = float(x[-1])
        return good, self._why(good, bad)

    @property
    def least(self) -> float:
        """Margin at which the road ends."""
        return 0.0 if self.system.friction is None else LEAST_MARGIN

    def _possible_at(self, q: Floats) -> Any:
        sample = self.system.sample(q)
        return sample.possible & (sample.margin > self.least)

    def _why(self, good: float, bad: float) -> str:
        """What ends the road between a possible place and the next that is not."""
        sample = self.system.sample(np.array([good, bad]))
        margins = sample.margin - self.least
        if margins[1] > 0 and np.isfinite(sample.J[1]):
            return ends.NO_INERTIA if np.isfinite(sample.tau[1]) else ends.UNDEFINED_LOAD
        return ends.DEAD_CENTRE if margins[0] <= math.sqrt(EPS) else ends.IMPOSSIBLE

    def _touched(self, data: PlaceData, sign: int) -> tuple[float, str] | None:
        """Where a margin or the inertia touches zero inside a piece; None if neither does."""
        if data.limit:
            return None
        places = []
        for row, what in ((MARGIN, ends.DEAD_CENTRE), (J, ends.NO_INERTIA)):
            if data.tails[row] <= self.tolerance:
                nothing = NOTHING * float(np.abs(data.rows[row]).max())
                places += [(q, what) for q in data.touches(row, nothing)]
        return min(places, key=lambda x: sign * x[0]) if places else None

    def _piece(self, data: PlaceData, what: tuple[str, str] = ("", "")) -> Piece:
        slips = () if self.system.friction is None else self.system.friction.names
        cuts = [x for k in range(len(slips)) for x in data.zeros(SLIPS + k)]
        return Piece(data, what, tuple(x for x in cuts if data.low < x < data.high))
