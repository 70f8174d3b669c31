"""The mesh of the path: place data along the driver's path, made where a motion comes to and kept.

A piece ends where its series would not be smooth: at kinks of loads, dead centres,
places without inertia. It is halved until its series are resolved, so pieces crowd only where
the mechanism asks for it. In a periodic scene the pieces of one period serve all turns and all
runs of a mechanism; they are made at once.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics import ends
from blockmech.dynamics.panel_nodes import CLOSE, COARSE, FINE, MARGIN, TAU, J
from blockmech.dynamics.path_loops import DIGITS
from blockmech.dynamics.place_data import (
    NOTHING,
    PlaceData,
    coordinate_at,
    mesh,
    piece_data,
    possible,
    sampled,
)
from blockmech.ground.plane import EPS
from blockmech.typing import Floats

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

PIECES = 4  # of a turn (or of the span of a slide), to begin with; halved where they are too long


@dataclass(frozen=True)
class Piece:
    """Place data in the coordinate of the motion.

    ends : what ends the path at the low and the high end, "" where it goes on
    shift : [rad] whole periods between the two coordinates
    """

    data: PlaceData
    ends: tuple[str, str] = ("", "")
    shift: float = 0.0

    def end(self, sign: int) -> float:
        """The end in a direction of motion."""
        return (self.data.high if sign > 0 else self.data.low) + self.shift

    def obstacle(self, sign: int) -> str:
        """What ends the path there, or nothing."""
        return self.ends[sign > 0]

    def shifted(self, by: float) -> Piece:
        """The same some periods further on."""
        return replace(self, shift=self.shift + by) if by else self


class Course(NamedTuple):
    """Pieces (k,) ahead of a place, at most a turn, up to what ends the path.

    blocks : of all that are kept, see `PlaceData.block`; which : those ahead
    bounds : (k, 6) low and high end [rad or m], direction of a dead centre, what the series of
        its inertia leave out, largest inertia and effort
    """

    pieces: tuple[Piece, ...]
    blocks: Floats
    which: NDArray[np.intp]
    bounds: Floats


class PieceRow:
    """Pieces of the path by place, rising."""

    def __init__(self, pieces: Sequence[Piece], period: float | None) -> None:
        self.pieces, self.period = sorted(pieces, key=lambda x: x.end(-1)), period
        self.lows = [x.end(-1) for x in self.pieces]
        self._courses: dict[tuple[int, int], Course] = {}
        self._blocks: dict[int, Floats] = {}

    def index(self, q: float, sign: int, tolerance: float) -> int | None:
        """Which piece is ahead of a place, ``tolerance`` [rad or m] from its own end or begin."""
        lower, upper = bisect_left(self.lows, q - tolerance), bisect_right(self.lows, q + tolerance)
        i = upper if sign > 0 else lower
        if not i:
            return None
        piece = self.pieces[i - 1]
        remaining = sign * (piece.end(sign) - q)
        return i - 1 if tolerance < remaining <= piece.data.length + tolerance else None

    def course(self, first: int, sign: int) -> Course:
        """The pieces from one on; one at a dead centre, or that ends the path, stands alone."""
        if (first, sign) in self._courses:
            return self._courses[first, sign]
        m, pieces, which = len(self.pieces), list[Piece](), list[int]()
        for k in range(m + 1):
            turns, i = divmod(first + sign * k, m)
            if turns and self.period is None:
                break
            piece = self.pieces[i].shifted(turns * self.period if self.period else 0.0)
            if pieces:
                tolerance = 2 * CLOSE * max(abs(pieces[-1].end(sign)), abs(piece.end(-sign)))
                apart = abs(pieces[-1].end(sign) - piece.end(-sign)) > tolerance
                if apart or piece.data.limit or piece.obstacle(sign) or pieces[-1].data.limit:
                    break
            pieces.append(piece)
            which.append(i)
            if piece.obstacle(sign):
                break
        if sign not in self._blocks:
            self._blocks[sign] = np.array([x.data.block(sign) for x in self.pieces])
        bounds = [
            (x.end(-1), x.end(1), x.data.limit, x.data.unknown, *x.data.largest[:MARGIN])
            for x in pieces
        ]
        course = Course(tuple(pieces), self._blocks[sign], np.array(which), np.array(bounds))
        self._courses[first, sign] = course
        return course


@dataclass
class PathMesh:
    """The pieces of a system's path about a start: n nodes each, resolved to a tolerance.

    Those of `FINE` nodes are sampled a second time at `COARSE` others, for the estimate of what
    the samples leave unknown.

    ``off``: share by which the ends that the mechanism has are off
    ``rounding``: what the second sampling's inertia has more, relative to the largest of its piece
    """

    system: System
    start: float
    n: int
    tolerance: float
    off: float = 0.0
    rounding: float = 0.0
    limits: list[tuple[float, int, str]] = field(default_factory=list)  # place, direction, what

    @cached_property
    def row(self) -> PieceRow:
        """The pieces that are there: to begin with, of a period those that are kept."""
        period, cache = self.system.period, self.system.cache
        if period is None:
            return PieceRow([], None)
        key = "mesh", self.n
        base, first, _ = cache.get(key, (None, math.nan, None))
        if base is None:
            base = self.over(self._edges_from(self._half_a_period_before(0.0)))
        if first != self.first:  # most starts lie in the same period
            turns = [math.ceil((self.first - x) / period - CLOSE) for x in base.lows]
            pieces = [x.shifted(n * period) for x, n in zip(base.pieces, turns, strict=True)]
            cache[key] = base, self.first, PieceRow(pieces, period) if any(turns) else base
        row: PieceRow = cache[key][2]
        return row

    def over(self, edges: Floats) -> PieceRow:
        """Pieces between edges, but where there is no pose and no inertia."""
        pieces = mesh(self._values, edges, self.n, self.tolerance, self.second_count)
        return PieceRow([self._piece(data) for data in pieces], self.system.period)

    @property
    def second_count(self) -> int:
        """Nodes of the second sampling."""
        return COARSE if self.n == FINE else 0

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

    def _with(self, pieces: Sequence[Piece]) -> None:
        """The same path with other pieces, in this run alone."""
        self.row = PieceRow(pieces, self.system.period)

    def course(self, q: float, sign: int, length: float = math.inf) -> tuple[Course, float] | str:
        """The pieces ahead of a place, and how far they are shifted [rad]; or why there are none.

        ``length`` [rad or m] of the first one, at most, if it is new.
        """
        shift, tolerance = self.turn(q, sign)
        i = self.row.index(q - shift, sign, tolerance)
        if i is None:
            begin = next((x for x in self._edges if abs(x - (q - shift)) <= tolerance), q - shift)
            piece = self._new_piece(begin, sign, length)
            if isinstance(piece, str):
                return piece
            self._with([*self.row.pieces, piece])
            i = next(i for i, x in enumerate(self.row.pieces) if x is piece)
        return self.row.course(i, sign), shift

    def shorten(self, piece: Piece, q: float, sign: int, length: float) -> None:
        """A shorter piece from a place on instead of one that is too long for what happens."""
        self._with([p for p in self.row.pieces if p.data is not piece.data])
        self.course(q, sign, length)

    def turn(self, q: float, sign: int) -> tuple[float, float]:
        """Whole periods [rad] to the kept one, and a distance that is none but for rounding."""
        period, tolerance = self.system.period, CLOSE * max(abs(q), abs(self.start))
        if period is None:
            return 0.0, tolerance
        shift = period * math.floor((q + sign * tolerance - self.first) / period)
        return shift, tolerance + CLOSE * abs(shift)

    # -- making a piece ------------------------------------------------------------

    def _new_piece(self, q: float, sign: int, length: float) -> Piece | str:
        """A resolved piece from q on."""
        end, obstacle = self._reach(q, sign, length)
        limit = sign * (obstacle == ends.DEAD_CENTRE)  # runs into it in its own variable
        for _ in range(DIGITS):
            if end == q:
                return obstacle or self._unresolved(q)
            low, high = (q, end) if sign > 0 else (end, q)
            v = sampled(self.n, self.second_count)
            rows = self._rows(low, high, limit, v)
            data, bad = piece_data(low, high, limit, rows, self.n), ~possible(rows)
            if not limit and bad.any():
                nearest = min(coordinate_at(low, high, 0, v)[bad], key=lambda x: sign * x)
                end, obstacle = self._last_possible(q, float(nearest))
                end -= sign * self.off * abs(end) if end != q else 0.0
                self.limits.append((end, sign, obstacle))
                limit = sign * (obstacle == ends.DEAD_CENTRE)
                continue
            touched = self._touched(data, sign)
            if touched is not None and abs(touched[0] - end) > math.sqrt(EPS) * data.length:
                end, obstacle, limit = *touched, 0
            elif data.tail <= self.tolerance:
                return self._piece(data, ("", obstacle) if sign > 0 else (obstacle, ""))
            else:
                end, obstacle, limit = (q + end) / 2, "", 0
        return self._unresolved(q)

    def _unresolved(self, q: float) -> str:
        """What ends the path where no piece is short enough: no pose, or series without an end."""
        sample = self.system.sample(np.array([q]))
        good = bool(sample.possible[0]) and sample.margin[0] > math.sqrt(EPS)
        return ends.UNDECIDED if good else ends.IMPOSSIBLE

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

    def _reach(self, q: float, sign: int, length: float) -> tuple[float, str]:
        """The farthest place that a new piece may reach, and what ends the path there."""
        piece_ends = [p.end(-sign) for p in self.row.pieces] + self._edges
        usual = (self.system.period or self.system.span) / PIECES
        bounds = [x for p in self.row.pieces for x in (p.data.low, p.data.high)]
        if self.system.period is None and bounds:  # along a guide they double
            usual = max(usual, max(bounds) - min(bounds))
        ends = [(x, obstacle) for x, direction, obstacle in self.limits if direction == sign]
        ends += [(x, "") for x in piece_ends]
        if self.system.period is None or length < usual:
            ends.append((q + sign * min(length, usual), ""))
        tolerance = CLOSE * max(abs(q), abs(self.start))
        farther = [x for x in ends if sign * (x[0] - q) > tolerance]
        return min(farther, key=lambda x: sign * x[0], default=(q + sign * usual, ""))

    def _rows(self, low: float, high: float, limit: int, v: Floats) -> Floats:
        """Values of a piece at its nodes."""
        rows = self._values(coordinate_at(low, high, limit, v))
        if limit:  # J and tau grow without bound there
            rows[J] *= v * v
            rows[TAU] *= v
        return rows

    def _values(self, q: Floats) -> Floats:
        *terms, size = self.system.sample(q)
        rows, unknown = np.array(terms), self.system.rounding(q) if size is None else 8 * EPS * size
        rows[TAU, np.abs(rows[TAU]) <= unknown] = 0.0
        return rows

    def _last_possible(self, q: float, limit: float) -> tuple[float, str]:
        """The last place from q on at which there is a pose and a load, and what ends there."""
        good, bad = q, limit
        if not self.system.sample(np.array([q])).possible[0]:
            return q, self._why(q, q)
        for _ in range(DIGITS):
            x = np.linspace(good, bad, self.n + 1)[1:]
            x = x[(x != good) & (x != bad)]
            if not x.size:
                break
            possible = self.system.sample(x).possible
            if not possible.all():
                first = int(np.argmin(possible))
                bad = float(x[first])
                x = x[:first]
            if x.size:
                good = float(x[-1])
        return good, self._why(good, bad)

    def _why(self, good: float, bad: float) -> str:
        """What ends the path between a possible place and the next that is not."""
        sample = self.system.sample(np.array([good, bad]))
        margins = sample.margin
        if margins[1] > 0 and np.isfinite(sample.J[1]):
            return ends.NO_INERTIA if np.isfinite(sample.tau[1]) else ends.UNDEFINED_LOAD
        return ends.DEAD_CENTRE if margins[0] <= math.sqrt(EPS) else ends.IMPOSSIBLE

    def _touched(self, data: PlaceData, sign: int) -> tuple[float, str] | None:
        """Where a margin or the inertia touches zero inside a piece; None if neither does."""
        if data.limit:
            return None
        touches = []
        for row, obstacle in ((MARGIN, ends.DEAD_CENTRE), (J, ends.NO_INERTIA)):
            if data.tails[row] <= self.tolerance:
                nothing = NOTHING * float(np.abs(data.rows[row]).max())
                touches += [(q, obstacle) for q in data.touches(row, nothing)]
        return min(touches, key=lambda x: sign * x[0]) if touches else None

    def _piece(self, data: PlaceData, obstacles: tuple[str, str] = ("", "")) -> Piece:
        rows, second = data.rows.copy(), data.second.copy()
        (second if len(second) else rows)[J] += self.rounding * data.largest[J]
        return Piece(replace(data, rows=rows, second=second), obstacles)
