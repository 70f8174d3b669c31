"""Where all groups of a mechanism close, along one coordinate.

A group closes where its margin is not negative, and its margin exists where all earlier
groups close. So the groups are taken in formation order, and each cuts the arcs that
the earlier ones leave:

1. the margins are sampled, all in one batch;
2. between samples a margin may still touch zero or pass it twice: every local minimum
   above zero and every local maximum below it that could reach zero is followed;
3. every change of sign is bisected until no number lies between.

Past a dead centre of an earlier group, margins change like the square root of the
distance from it, so a new arc is sampled again, quadratically denser towards its ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from blockmech.analysis.peaks import Floats, last_place, least_place, turning_place

TURN = 2 * math.pi
SEAM = -math.pi / 2  # turns are cut there: arcs of symmetric mechanisms lie about 0 or pi
GRADED = 24  # extra samples towards the end of an arc
DENSE = 4.0  # samples' spacings that they cover
EPS = float(np.finfo(float).eps)
NOISE = 16 * EPS  # rounding of a margin, relative to its size nearby
NEAR = 16  # samples on either side that say how large a margin is
PROBES = (-5, -3, -2, -1, 0, 1, 2, 3, 5)
SAME = 1e-3  # of the samples' spacing, within which places count as one
PROBE = 1e-4  # of that


@dataclass(frozen=True)
class Margins:
    """Margins of the groups as functions of one coordinate.

    Attributes
    ----------
    blocks : the groups in formation order
    batch : (n,) -> (groups, n) [-]
    one : number of a group -> its margin as a function of one place
    passable : whether the mechanism moves on through a place where a group's margin
        touches zero: block, place, distance to look at on both sides
    """

    blocks: tuple[str, ...]
    batch: Callable[[Floats], Floats]
    one: Callable[[int], Callable[[float], float]]
    passable: Callable[[str, float, float], bool]


@dataclass(frozen=True)
class Bound:
    """An end of a piece, or a change point: the place, and the group that makes it."""

    q: float
    block: str = ""  # "" is the end of the search


@dataclass(frozen=True)
class Piece:
    """A stretch of the coordinate where the groups taken so far close.

    ``start`` and ``end`` are None for a turn that closes on itself.
    """

    start: Bound | None
    end: Bound | None
    passes: tuple[Bound, ...]
    nodes: Floats  # (n,)
    margins: Floats  # (groups, n)


@dataclass(frozen=True)
class Nearest:
    """Where nothing closes: the group that fails, and where it comes nearest to closing."""

    block: str
    q: float
    margin: float


def closed_pieces(
    margins: Margins, nodes: Floats, turn: bool
) -> tuple[tuple[Piece, ...], Nearest | None]:
    """All pieces where every group closes, in rising order.

    Parameters
    ----------
    margins : margins of the groups
    nodes : (n,) samples, rising; of a turn without its last one
    turn : whether the coordinate closes on itself after 2 pi

    Returns
    -------
    the pieces, and, where there is none, what comes nearest
    """
    ends = (None, None) if turn else (Bound(float(nodes[0])), Bound(float(nodes[-1])))
    search = _Search(margins, float(np.median(np.diff(nodes))), nodes, turn)
    pieces = [Piece(ends[0], ends[1], (), nodes, margins.batch(nodes))]
    nearest = None
    for k, block in enumerate(margins.blocks):
        before, pieces = pieces, [part for piece in pieces for part in search.cut(piece, k)]
        if not pieces:
            nearest = _nearest(before, k, block)
            break
    pieces.sort(key=lambda p: p.start.q if p.start else 0.0)
    return tuple(pieces), nearest


def _nearest(pieces: Sequence[Piece], k: int, block: str) -> Nearest:
    found = []
    for piece in pieces:
        m = np.where(np.isnan(piece.margins[k]), -np.inf, piece.margins[k])
        i = int(np.argmax(m))
        found.append(Nearest(block, float(piece.nodes[i]), float(m[i])))
    return max(found, key=lambda x: x.margin)


@dataclass(frozen=True)
class _Place:
    """What was found between samples: the place, whether the group closes there."""

    q: float
    closes: bool
    width: float  # within which it is the same place
    touch: bool = False


@dataclass(frozen=True)
class _Search:
    """The samples, and how to look closer."""

    margins: Margins
    spacing: float
    grid: Floats
    turn: bool

    def cut(self, piece: Piece, k: int) -> list[Piece]:
        """The parts of a piece where group k closes as well."""
        q, m = self._without_holes(piece, k)
        size = float(np.abs(m).max(initial=0.0))
        if size <= NOISE:
            return []  # at dead centre everywhere: locked
        found = self._between(piece, q, m, k)
        touches = [p for p in found if p.touch]
        block = self.margins.blocks[k]
        passes = piece.passes + tuple(Bound(p.q, block) for p in touches if p.closes)
        passes = tuple(sorted(passes, key=lambda b: b.q))
        for p in touches:  # one place, also where rounding makes it a dip: it replaces samples
            other = np.abs(q - p.q) > p.width
            q, m = q[other], m[other]
        closes = np.concatenate([m >= 0, [p.closes for p in found]])
        q = np.concatenate([q, [p.q for p in found]])
        order = np.argsort(q)
        q, closes = q[order], closes[order]
        if closes.all():
            return [replace(piece, passes=passes)]
        return self._parts(piece, k, q, closes, passes)

    def _without_holes(self, piece: Piece, k: int) -> tuple[Floats, Floats]:
        """Samples of group k; a sample that falls on an undefined place is moved a little."""
        q, m = piece.nodes.copy(), piece.margins[k].copy()
        one = self.margins.one(k)
        for i in np.flatnonzero(np.isnan(m)).tolist():
            towards = 1 if i + 1 < len(q) else -1
            q[i] += towards * 1e-3 * abs(float(q[i + towards] - q[i]))
            m[i] = one(float(q[i]))
        return q, np.where(np.isnan(m), -1.0, m)

    # -- between the samples -----------------------------------------------------------

    def _between(self, piece: Piece, q: Floats, m: Floats, k: int) -> list[_Place]:
        """Dips below zero and rises above it that the samples do not show."""
        if piece.start is None:
            q = np.concatenate([[q[-1] - TURN], q, [q[0] + TURN]])
            m = np.concatenate([[m[-1]], m, [m[0]]])
        left, right = m[1:-1] - m[:-2], m[1:-1] - m[2:]
        bend = 4 * np.abs(left + right)  # a parabola leaves the middle by an eighth of it
        low = (left <= 0) & (right <= 0) & (m[1:-1] >= -bend) & (m[1:-1] <= bend)
        high = (left >= 0) & (right >= 0) & (m[1:-1] < 0) & (-m[1:-1] <= bend)
        found: list[_Place] = []
        for i in (np.flatnonzero(low | high) + 1).tolist():
            bracket = (float(q[i - 1]), float(q[i + 1]))
            noise = NOISE * max(1.0, float(np.abs(m[max(0, i - NEAR) : i + NEAR]).max()))
            place = self._followed(bracket, k, 1 if high[i - 1] else -1, noise)
            if place is not None and not any(self._same(place, p) for p in found):
                found.append(place)
        return found

    def _same(self, one: _Place, other: _Place) -> bool:
        apart = one.q - other.q
        apart = math.remainder(apart, TURN) if self.turn else apart
        return abs(apart) <= max(one.width, other.width)

    def _followed(
        self, bracket: tuple[float, float], k: int, sign: int, noise: float
    ) -> _Place | None:
        """Follow a local maximum (sign +1) or minimum of margin k, and judge it."""
        one = self.margins.one(k)
        q, _ = least_place(lambda x: -sign * one(x), *bracket)
        width = SAME * (bracket[1] - bracket[0])
        around = np.array([one(q + j * PROBE * width) for j in PROBES])
        around = around[np.isfinite(around)]
        if not len(around):
            return None
        value = float(around.max() if sign > 0 else around.min())
        noise += 4 * float(np.ptp(around))
        if abs(value) > noise:  # beyond doubt; of interest if on the other side of zero
            return _Place(q, sign > 0, width) if value * sign > 0 else None
        q = self._polished(bracket, k, q, sign)
        if sign > 0:
            return _Place(q, True, width)  # it closes at one place only
        passable = self.margins.passable(self.margins.blocks[k], q, width)
        return _Place(q, passable, width, touch=True)

    def _polished(self, bracket: tuple[float, float], k: int, q: float, sign: int) -> float:
        def row(x: Floats) -> Floats:
            return np.asarray(self.margins.batch(x)[k])

        found = turning_place(row, bracket, (-math.inf, math.inf), sign)
        return q if found is None else found.place

    # -- making the parts --------------------------------------------------------------

    def _parts(
        self, piece: Piece, k: int, q: Floats, closes: Floats, passes: tuple[Bound, ...]
    ) -> list[Piece]:
        """Cut a piece at the samples where group k does not close."""
        if piece.start is None:  # open the turn where it is broken
            first = int(np.argmin(closes))
            q = np.concatenate([q[first:], q[: first + 1] + TURN])
            closes = np.concatenate([closes[first:], closes[: first + 1]])
        edges = np.flatnonzero(np.diff(np.concatenate([[0], closes.astype(int), [0]])))
        made = []
        for low, high in zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True):
            turns = 0.0
            if piece.start is None:
                turns = math.floor(((q[low] + q[high]) / 2 - SEAM) / TURN) * TURN
            start = piece.start if low == 0 else self._end(k, q, low, low - 1, turns)
            last = high == len(q) - 1
            end = piece.end if last else self._end(k, q, high, high + 1, turns)
            assert start is not None
            assert end is not None
            made.append(self._piece(start, end, passes))
        return made

    def _end(self, k: int, q: Floats, inside: int, outside: int, turns: float) -> Bound:
        one = self.margins.one(k)
        place = last_place(
            lambda x: one(x) >= 0, float(q[inside]) - turns, float(q[outside]) - turns
        )
        return Bound(place, self.margins.blocks[k])

    def _piece(self, start: Bound, end: Bound, passes: tuple[Bound, ...]) -> Piece:
        a, b = start.q, end.q
        nodes = self._inside(a, b)
        width = min(DENSE * self.spacing, (b - a) / 2)
        graded = width * (np.arange(GRADED) / GRADED) ** 2
        extra = [np.array([a, b])]
        extra += [a + graded] if start.block else []
        extra += [b - graded] if end.block else []
        nodes = np.unique(np.clip(np.concatenate([nodes, *extra]), a, b))
        return Piece(start, end, self._passed(passes, a, b), nodes, self.margins.batch(nodes))

    def _inside(self, a: float, b: float) -> Floats:
        grid = self.grid
        if self.turn:
            grid = np.concatenate([grid - TURN, grid, grid + TURN])
        return grid[(grid > a) & (grid < b)]

    def _passed(self, passes: tuple[Bound, ...], a: float, b: float) -> tuple[Bound, ...]:
        """Change points inside a part; of a turn they may be a turn away."""
        turns = (0.0, -TURN, TURN) if self.turn else (0.0,)
        found = {Bound(p.q + t, p.block) for p in passes for t in turns if a < p.q + t < b}
        return tuple(sorted(found, key=lambda p: p.q))
