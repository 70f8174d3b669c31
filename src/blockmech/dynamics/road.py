"""The road: place data along the driver's path, made where a motion comes to and kept.

A piece ends where its series would not be smooth: at kinks of loads, end stops, dead centres,
places without inertia. It is halved until its series are resolved, so pieces crowd only where
the mechanism asks for it. In a periodic scene the pieces of one period serve all turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.dynamics.motion import DEAD_CENTRE, END_STOP, IMPOSSIBLE, NO_INERTIA, UNDEFINED_LOAD
from blockmech.dynamics.panels import EPS, NOTHING, Floats, PlaceData, nodes, rule
from blockmech.series import tail

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

PIECES = 4  # of a turn (or of the span of a slide), to begin with; halved where they are too long
PARTS = 16  # a search for the last possible pose asks at that many places at a time
HALVINGS = 60  # of a piece: a double has no more digits
CLOSE = 4 * EPS  # relative distance of two places that are one, but for rounding of their sum
J, TAU, MARGIN, SLIPS = 0, 1, 2, 3  # rows of place data; slips and what follows with friction


@dataclass(frozen=True)
class Piece:
    """Place data in the coordinate of the motion.

    shift : [rad] whole periods between the two
    ends : what ends the road at the low and the high end, "" where it goes on
    cuts : places inside at which a pair with friction reverses, ascending
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

    def holds(self, q: float, sign: int, near: float) -> bool:
        """Whether there is a way ahead of q in it, q a place of the data; no nearer than that."""
        low, high = self.data.low, self.data.high
        if sign > 0:
            return low - near <= q < high - near
        return low + near < q <= high + near


@dataclass
class Road:
    """The pieces of a system's path with n nodes each, resolved to a relative tolerance."""

    system: System
    n: int
    tolerance: float
    pieces: list[Piece] = field(default_factory=list)
    limits: list[tuple[float, int, str]] = field(default_factory=list)  # place, direction, what

    def ahead(self, q: float, sign: int, length: float = math.inf) -> Piece | str:
        """The piece ahead of a place, no longer than asked if it is new; or why there is none."""
        low, high = self.system.stops[0]
        if (q >= high and sign > 0) or (q <= low and sign < 0):
            return END_STOP
        shift = self._shift(q)
        near = CLOSE * max(abs(q), abs(shift))
        for k in (0.0, 1.0, -1.0):  # a place at an edge of a period may be its neighbour's
            move = shift + k * (self.system.period or 0.0)
            for piece in self.pieces:
                if piece.holds(q - move, sign, near):
                    return self._cut_at_stops(Piece(piece.data, piece.ends, piece.cuts, move))
            if self.system.period is None:
                break
        made = self._made(q - shift, sign, length)
        if isinstance(made, str):
            return made
        self.pieces.append(made)
        return self._cut_at_stops(Piece(made.data, made.ends, made.cuts, shift))

    def replace(self, old: Piece, q: float, sign: int, length: float) -> Piece | str:
        """A shorter piece in place of one that was too long for what happens in it."""
        self.pieces = [p for p in self.pieces if p.data is not old.data]
        return self.ahead(q, sign, length)

    def _shift(self, q: float) -> float:
        period = self.system.period
        return 0.0 if period is None else period * math.floor(q / period)

    def _cut_at_stops(self, piece: Piece) -> Piece:
        """End stops are in the motion's coordinate, so they end a turn and not all turns."""
        cuts = [x + piece.shift for x in piece.cuts]
        ends = list(piece.ends)
        for i, stop in enumerate(self.system.stops[0]):
            if piece.data.low + piece.shift < stop < piece.data.high + piece.shift:
                cuts.append(stop)
            elif stop == piece.end(1 if i else -1):
                ends[i] = END_STOP
        return Piece(piece.data, (ends[0], ends[1]), tuple(sorted(cuts)), piece.shift)

    # -- making a piece ------------------------------------------------------------

    def _made(self, q: float, sign: int, length: float) -> Piece | str:
        """A resolved piece from q on."""
        far, what = self._far(q, sign, length)
        limit = self._limit(sign, what)
        for _ in range(HALVINGS):
            if far == q:
                return what or IMPOSSIBLE
            rows = self._rows(*_ordered(q, far), limit)
            if not limit and not _possible(rows).all():
                far, what = self._last_possible(q, far)
                self.limits.append((far, sign, what))
                limit = self._limit(sign, what)
                continue
            data = PlaceData(*_ordered(q, far), limit, rows)
            touched = self._touched(data, sign)
            if touched is not None and abs(touched[0] - far) > math.sqrt(EPS) * data.length:
                far, what, limit = *touched, 0
            elif data.tail <= self.tolerance:
                return self._finished(data, sign, what)
            else:
                far, what, limit = (q + far) / 2, "", 0
        return IMPOSSIBLE

    def _far(self, q: float, sign: int, length: float) -> tuple[float, str]:
        """The farthest place that a new piece may reach, and what ends the road there."""
        system = self.system
        covered = [x for p in self.pieces for x in (p.data.low, p.data.high)]
        usual = (system.period or system.span) / PIECES
        if system.period is None and covered:  # along a guide they double
            usual = max(usual, max(covered) - min(covered))
        far = q + sign * min(length, usual)
        stops = [p.data.low if sign > 0 else p.data.high for p in self.pieces]
        stops += list(system.knots)
        if system.period is not None:
            stops += [x + k * system.period for x in stops for k in (-1, 1)]
        between = [x for x in stops if sign * (x - q) > 0 and sign * (far - x) > 0]
        found = [(x, what) for x, way, what in self.limits if way == sign and sign * (x - q) > 0]
        found += [(x, "") for x in [*between, far]]
        return min(found, key=lambda x: sign * x[0])

    def _rows(self, low: float, high: float, limit: int) -> Floats:
        """Values of a piece at its nodes."""
        q = nodes(low, high, limit, self.n)
        if self.system.friction is not None:
            return self.system.friction.rows(q)
        rows = np.array(self.system.sample(q))
        if limit:  # J and tau grow without bound there
            v = rule(self.n).v
            rows[J] *= v * v
            rows[TAU] *= v
        return rows

    def _limit(self, sign: int, what: str) -> int:
        """Direction in which a piece runs into a dead centre in its own variable.

        With friction it does not: before a dead centre the friction has no solution.
        """
        return sign if what == DEAD_CENTRE and self.system.friction is None else 0

    def _last_possible(self, q: float, far: float) -> tuple[float, str]:
        """The last place from q on at which there is a pose and a load, and what ends there."""
        good, bad = q, far
        if not self._possible_at(np.array([q]))[0]:
            return q, self._why(q, q)
        for _ in range(HALVINGS):
            x = np.linspace(good, bad, PARTS + 1)[1:]
            x = x[(x != good) & (x != bad)] if abs(bad - good) > 4 * EPS * abs(good) else x[:0]
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

    def _possible_at(self, q: Floats) -> Any:
        return self.system.sample(q).possible

    def _why(self, good: float, bad: float) -> str:
        """What ends the road between a possible place and the next that is not."""
        before, beyond = (self.system.sample(np.array([x])) for x in (good, bad))
        closes = beyond.margin[0] > 0 and np.isfinite(beyond.J[0])
        if closes:
            return UNDEFINED_LOAD if not np.isfinite(beyond.tau[0]) else NO_INERTIA
        near = before.margin[0] <= math.sqrt(EPS)
        return DEAD_CENTRE if near else IMPOSSIBLE

    def _touched(self, data: PlaceData, sign: int) -> tuple[float, str] | None:
        """Where a margin or the inertia touches zero inside a piece; None if neither does."""
        if data.limit:
            return None
        found = []
        for row, what in ((MARGIN, DEAD_CENTRE), (J, NO_INERTIA)):
            if tail(data.series[row]) > self.tolerance:
                continue
            nothing = NOTHING * float(np.abs(data.rows[row]).max())
            found += [(q, what) for q in data.touches(row, nothing)]
        return min(found, key=lambda x: sign * x[0]) if found else None

    def _finished(self, data: PlaceData, sign: int, what: str) -> Piece:
        ends = ("", what) if sign > 0 else (what, "")
        if self.system.friction is None:
            return Piece(data, ends)
        m = len(self.system.friction.names)
        cuts = [x for k in range(m) for x in data.zeros(SLIPS + k).tolist()]
        return Piece(data, ends, tuple(sorted(x for x in cuts if data.low < x < data.high)))


def _ordered(a: float, b: float) -> tuple[float, float]:
    return (a, b) if a < b else (b, a)


def _possible(rows: Floats) -> Any:
    return (rows[MARGIN] > 0) & np.isfinite(rows[:MARGIN]).all(axis=0) & (rows[J] > 0)
