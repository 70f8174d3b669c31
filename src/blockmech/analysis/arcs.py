"""Where all groups of a mechanism close, along one coordinate.

A group closes where its margin is not negative, and its margin exists where all earlier
groups close. So the groups are taken in formation order, and each cuts the pieces that
the earlier ones leave: the margin's extrema are found (`blockmech.analysis.scan`), between
two of them it changes sign at most once, and every change of sign is bisected until no
number lies between. An extremum within its rounding touches zero: a change point, or an end.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.analysis.closure import Closure
from blockmech.analysis.scan import NODES, ROUNDED, SEAM, TURN, Span, places, runs, scan
from blockmech.functions.roots import last_place
from blockmech.functions.series import fit
from blockmech.ground.tolerances import BLUR, DOUBLE_ROOT
from blockmech.typing import Array, Floats

# [rad or m] Where rounding is measured: a parabola stays level there to its own rounding.
PROBES = DOUBLE_ROOT * np.array([-1, -0.3, -0.05, -0.03, -0.01, 0, 0.01, 0.03, 0.05, 0.3, 1])
BESIDE = 10 * BLUR  # [rad], and of a slide's size: looked at on both sides of a touch
LOCKED = BESIDE**0.5  # the same: no touch is as wide, one of sixth order spans 3e-3 in doubles


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

    span: Span
    start: Bound | None
    end: Bound | None
    passes: tuple[Bound, ...] = ()

    @property
    def tiny(self) -> bool:
        """Whether rounding hides what happens within."""
        return self.span.high - self.span.low <= DOUBLE_ROOT

    @property
    def corners(self) -> Floats:
        """Places (n,) of the change points, those within rounding of each other as one."""
        q = np.array([p.q for p in self.passes])
        return q[np.diff(q, prepend=-math.inf) > DOUBLE_ROOT]


@dataclass(frozen=True)
class Nearest:
    """Where nothing closes: the group that fails, and where it comes nearest to closing."""

    block: str
    q: float
    margin: float


Known: TypeAlias = dict[tuple[str, ...], tuple[list[Piece], Nearest | None]]
"""What is known of groups taken one after the other, along one driver, the others held alike."""


def closed_pieces(
    closure: Closure, span: Span, samples: int, known: Known
) -> tuple[tuple[Piece, ...], Nearest | None]:
    """All pieces where every group closes, in rising order.

    Parameters
    ----------
    closure : the groups' margins
    span : where to search
    samples : of a turn, to begin with
    known : of the first groups, from searches before; more is added

    Returns
    -------
    the pieces, and, where there is none, what comes nearest
    """
    ends = (None, None) if span.turn else (Bound(span.low), Bound(span.high))
    pieces, nearest = [Piece(span, *ends)], None
    for k, block in enumerate(closure.blocks):
        blocks = closure.blocks[: k + 1]
        if blocks not in known:
            looked = [_Margin(closure, k, piece, samples) for piece in pieces]
            parts = [part for margin in looked for part in margin.parts()]
            nearest_pose = None if parts else max((m.nearest() for m in looked), key=lambda m: m[1])
            known[blocks] = parts, nearest_pose and Nearest(block, *nearest_pose)
        pieces, nearest = known[blocks]
        if nearest:
            return (), nearest
    return tuple(sorted(pieces, key=lambda p: p.start.q if p.start else 0.0)), None


class _Margin:
    """The margin of one group on a piece where the earlier ones close.

    Attributes
    ----------
    x : (m,) places between which the margin only rises or only falls; of a turn from where
        it is farthest from zero to the same place a turn later
    y : (m,) its values there
    sure : (m,) whether they are beyond their rounding, and so have a sign
    ends : the last places where it is not negative, of those found on the way
    whole : whether there is no zero on the piece, nor below it; the others are missing then
    """

    def __init__(self, closure: Closure, k: int, piece: Piece, samples: int) -> None:
        self.closure, self.k, self.piece = closure, k, piece
        self.block = closure.blocks[k]
        self.whole = False
        self.ends: list[float] = []
        if piece.tiny:
            self.x = np.array([piece.span.low])
            self.y = self._row(self.x)
            return
        self.edges = piece.span.panels(samples)
        # What stands on a group that touched zero may have a corner at the touch.
        cuts = piece.span.share(piece.corners)
        series = fit(
            lambda u: _bounded(self._row(piece.span.place(u))),
            np.unique([*self.edges, *cuts]) if piece.passes else self.edges,
            n=NODES,
            floor=ROUNDED,
            divide=self._divided,
        )
        self.whole = bool(np.all(series.resolved & ~series.may_vanish() & (series.c[:, 0] > 0)))
        if self.whole:
            return
        x = places(series, piece.span, np.concatenate([cuts, series.extrema(at_zero=True)]))
        y = self._row(x)
        noise = np.full(len(x), ROUNDED)  # a margin is a share of one
        doubtful = np.flatnonzero(~(np.abs(y) > DOUBLE_ROOT))
        around = self._row((x[doubtful, None] + PROBES).ravel()).reshape(len(doubtful), len(PROBES))
        # Undefined at one place, as where two pins meet: what is beside counts. Undefined all
        # round it: an earlier group fails there, within its rounding.
        lost = np.isnan(y[doubtful])
        y[doubtful[lost]] = around[lost, -3]
        spread = np.nanmax(around, axis=1, initial=-1.0) - np.nanmin(around, axis=1, initial=1.0)
        noise[doubtful] += 4 * np.maximum(spread, 0.0)
        for end, neighbour in ((0, 1), (-1, -2)):
            y[end] = y[neighbour] if np.isnan(y[end]) else y[end]
        noise = np.where(np.isnan(y), np.inf, noise)
        self.x, self.y, self.sure = x, np.nan_to_num(y), np.abs(np.nan_to_num(y)) > noise
        if piece.start is None:
            first = int(np.argmax(np.abs(self.y)))
            self.x = _rolled(self.x, first, TURN)
            self.y, self.sure = _rolled(self.y, first), _rolled(self.sure, first)

    def _divided(self, middle: Floats, u: Floats, y: Floats) -> Floats:
        """Where to divide panels that have no series: at the first change of sign, if there is one.

        Beyond its dead centre the margin of a general group is another function, how far it
        misses closing, and is smooth on both sides only.
        """
        span, signs = self.piece.span, np.where(np.abs(y) > ROUNDED, np.sign(y), np.nan)
        for i, j in enumerate(np.argmax(signs[:, 1:] * signs[:, :-1] < 0, axis=1).tolist()):
            if not signs[i, j] * signs[i, j + 1] < 0:
                continue
            sides = span.place(u[i, j : j + 2])[:: int(signs[i, j])].tolist()
            self.ends.append(self._last(*sides))
            middle[i] = np.clip(span.share(np.array(self.ends[-1])), u[i, j], u[i, j + 1])
        return middle

    def _row(self, q: Floats) -> Floats:
        return np.array(self.closure.margins(q)[self.k])

    def _place(self, q: float) -> float:
        return q if self.piece.start else (q - SEAM) % TURN + SEAM

    def nearest(self) -> tuple[float, float]:
        """The place and the value of its maximum."""
        if self.piece.tiny:
            return float(self.x[0]), float(self.y[0])
        x, y = scan(self._row, self.piece.span, self.edges)
        i = int(np.nanargmax(y))
        return self._place(float(x[i])), float(y[i])

    def parts(self) -> list[Piece]:
        """The parts of the piece where the group closes as well."""
        if self.whole:
            return [self.piece]
        if self.piece.tiny:
            return [self.piece] * bool(self.y[0] >= 0)
        x, closes, touched = self._signs()
        passes = (*self.piece.passes, *touched)
        if closes.all():
            return [replace(self.piece, passes=tuple(sorted(passes, key=lambda b: b.q)))]
        if self.piece.start is None:  # open the turn where it is broken
            first = int(np.argmin(closes))
            x, closes = _rolled(x, first, TURN), _rolled(closes, first)
        stretches, last = runs(closes), len(x) - 1
        wide = [r for r in stretches if x[min(r[1] + 1, last)] - x[max(r[0] - 1, 0)] > DOUBLE_ROOT]
        parts = [self._part(x, low, high, passes) for low, high in wide or stretches]
        return [p for p in parts if not p.tiny] or parts  # slivers beside a part are rounding

    def _signs(self) -> tuple[Floats, NDArray[np.bool_], list[Bound]]:
        """Places, whether the group closes there, and the change points.

        Where the margin is not beyond its rounding, it has no sign. Between two places with
        the same sign it touches zero if it is nearer to it than at both.
        """
        x, y, signed, closes = self.x, self.y, self.sure.copy(), self.y >= 0
        passes: list[Bound] = []
        corners = self.piece.corners
        if self.piece.start is not None:
            signed[[0, -1]] = True
        size = self.piece.span.size
        scale = 1.0 if math.isinf(size) else size
        for low, high in runs(~self.sure):
            if x[high] - x[low] > LOCKED * scale:  # at dead centre all along
                signed[low : high + 1], closes[low : high + 1] = True, False
                continue
            if low == 0 or high == len(x) - 1 or closes[low - 1] != closes[high + 1]:
                continue
            i = low + int(np.argmin(np.abs(y[low : high + 1])))
            if abs(y[i]) > min(abs(y[low - 1]), abs(y[high + 1])):
                continue
            signed[i], closes[i] = True, True
            if closes[low - 1]:  # it closes on both sides
                q = self._place(float(x[i]))
                close_corners = corners[np.abs(corners - q) <= DOUBLE_ROOT]  # known to more digits
                q = next(iter(close_corners[np.isfinite(self._row(close_corners))].tolist()), q)
                distance = BESIDE * scale
                closes[i] = self.closure.passable(self.block, q, distance)
                repeated = any(abs(q - p.q) <= distance for p in passes)  # nearer, touches are one
                passes += [Bound(q, self.block)] * bool(closes[i] and not repeated)
        return x[signed], closes[signed], passes

    def _part(self, x: Floats, low: int, high: int, passes: Iterable[Bound]) -> Piece:
        """The part between samples that are the first and the last one to close."""
        closed_turn = self.piece.start is None
        turns = math.floor(((x[low] + x[high]) / 2 - SEAM) / TURN) * TURN if closed_turn else 0.0
        start, end = self.piece.start, self.piece.end
        if low > 0:
            start = self._end(x[low] - turns, x[low - 1] - turns)
        if high < len(x) - 1:
            end = self._end(x[high] - turns, x[high + 1] - turns)
        assert start is not None
        assert end is not None
        around = (0.0, -TURN, TURN) if closed_turn else (0.0,)
        shifted = {Bound(p.q + t, p.block) for p in passes for t in around}
        inside = sorted((p for p in shifted if start.q < p.q < end.q), key=lambda p: p.q)
        return Piece(Span(start.q, end.q, size=self.piece.span.size), start, end, tuple(inside))

    def _end(self, inside: float, outside: float) -> Bound:
        low, high = sorted((inside, outside))
        limit = next((q for q in self.ends if low < q < high), None)
        return Bound(self._last(inside, outside) if limit is None else limit, self.block)

    def _last(self, inside: float, outside: float) -> float:
        return last_place(lambda q: self.closure.margin(self.k, q), inside, outside)


def _bounded(margin: Floats) -> Floats:
    """A margin, at most 2, by another scale: poles, as of a cylinder without length, are smooth."""
    margin = np.maximum(margin, -sys.float_info.max)
    return np.asarray(margin / (3 - margin))


def _rolled(values: Array, first: int, turn: float | None = None) -> Array:
    """Values over a turn from another of its samples on, and that one again a turn later."""
    again = values[: first + 1]
    return np.concatenate([values[first:], again if turn is None else again + turn])
