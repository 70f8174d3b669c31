"""Where all groups of a mechanism close, along one coordinate.

A group closes where its margin is not negative, and its margin exists where all earlier
groups close. So the groups are taken in formation order, and each cuts the pieces that
the earlier ones leave: the margin's extrema are found (`blockmech.analysis.scan`), between
two of them it changes sign at most once, and every change of sign is bisected until no
number lies between. Past a dead centre of an earlier group margins change like the square
root of the distance from it, for which a `Span` is made.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from blockmech.analysis.scan import ROUNDED, TURN, Span, bisect, minimize, scan
from blockmech.series import DOUBLE_ROOT, Floats

SEAM = -math.pi / 2  # turns are cut there: arcs of symmetric mechanisms lie about 0 or pi
PROBES = 1e-9 * np.array([-5, -3, -2, -1, 0, 1, 2, 3, 5])  # [rad or m] a parabola stays level there
BESIDE = 1e-5  # [rad], and of a slide's size: looked at on both sides of a touch


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

    span: Span
    start: Bound | None
    end: Bound | None
    passes: tuple[Bound, ...] = ()


@dataclass(frozen=True)
class Nearest:
    """Where nothing closes: the group that fails, and where it comes nearest to closing."""

    block: str
    q: float
    margin: float


def closed_pieces(
    margins: Margins, span: Span, samples: int
) -> tuple[tuple[Piece, ...], Nearest | None]:
    """All pieces where every group closes, in rising order.

    Parameters
    ----------
    margins : margins of the groups
    span : where to search
    samples : of a turn, to begin with

    Returns
    -------
    the pieces, and, where there is none, what comes nearest
    """
    ends = (None, None) if span.turn else (Bound(span.low), Bound(span.high))
    pieces = [Piece(span, *ends)]
    for k, block in enumerate(margins.blocks):
        tiny = [p for p in pieces if _tiny(p)]
        looked = [_Margin(margins, k, p, samples) for p in pieces if p not in tiny]
        pieces = [part for margin in looked for part in margin.parts()]
        pieces += [p for p in tiny if margins.one(k)(p.span.low) >= 0]
        if not pieces:
            found = [m.nearest() for m in looked]
            found += [(p.span.low, margins.one(k)(p.span.low)) for p in tiny]
            return (), Nearest(block, *max(found, key=lambda place: place[1]))
    pieces.sort(key=lambda p: p.start.q if p.start else 0.0)
    return tuple(pieces), None


def _tiny(piece: Piece) -> bool:
    """Whether rounding hides what happens within."""
    return piece.span.high - piece.span.low <= DOUBLE_ROOT


class _Margin:
    """The margin of one group on a piece where the earlier ones close."""

    def __init__(self, margins: Margins, k: int, piece: Piece, samples: int) -> None:
        self.block, self.piece = margins.blocks[k], piece
        self.one, self.passable = margins.one(k), margins.passable
        self.batch, self.k = margins.batch, k
        found = scan(self._row, piece.span, piece.span.panels(samples))
        self.x, self.rough = found.x, found.rough
        self._step_aside(found.y)
        self.y = np.where(np.isnan(found.y), -1.0, found.y)
        for end, beside in ((0, 1), (-1, -2)):  # there an earlier group may just fail
            self.y[end] = self.y[beside] if np.isnan(found.y[end]) else self.y[end]
        self.size = float(np.abs(self.y).max())
        self.noise = np.where(np.isfinite(found.noise), found.noise, 0.0) + ROUNDED  # it is a share
        self._look_closer()

    def _row(self, q: Floats) -> Floats:
        return np.asarray(self.batch(q)[self.k])

    def _step_aside(self, y: Floats) -> None:
        """Values at single undefined places, e.g. where two pins meet, are those beside them."""
        alone = np.isnan(y[1:-1]) & np.isfinite(y[:-2]) & np.isfinite(y[2:])
        i = np.flatnonzero(alone) + 1
        y[i] = self._row(self.x[i] + PROBES[-1])

    def _look_closer(self) -> None:
        """Measure the noise where the margin is small: an earlier group's dead centre raises it."""
        near = np.flatnonzero((np.abs(self.y) <= DOUBLE_ROOT) & ~self.rough)
        around = self._row((self.x[near, None] + PROBES).ravel()).reshape(len(near), len(PROBES))
        spread = np.nanmax(around, axis=1, initial=-1.0) - np.nanmin(around, axis=1, initial=1.0)
        self.noise[near] += 4 * np.maximum(spread, 0.0)

    def nearest(self) -> tuple[float, float]:
        """The place and the value of its maximum."""
        i = int(np.argmax(self.y))
        return float(self.x[i]), float(self.y[i])

    def parts(self) -> list[Piece]:
        """The parts of the piece where the group closes as well."""
        if self.size <= ROUNDED:
            return []  # at dead centre everywhere: locked
        self._corners()
        x, closes, touched = self._signs()
        passes = (*self.piece.passes, *touched)
        if closes.all():
            return [replace(self.piece, passes=tuple(sorted(passes, key=lambda b: b.q)))]
        if self.piece.start is None:  # open the turn where it is broken
            first = int(np.argmin(closes))
            x = np.concatenate([x[first:], x[: first + 1] + TURN])
            closes = np.concatenate([closes[first:], closes[: first + 1]])
        found, last = runs(closes), len(x) - 1
        wide = [r for r in found if x[min(r[1] + 1, last)] - x[max(r[0] - 1, 0)] > DOUBLE_ROOT]
        parts = [self._part(x, low, high, passes) for low, high in wide or found]
        return [p for p in parts if not _tiny(p)] or parts  # slivers beside a part are rounding

    def _corners(self) -> None:
        """Follow the extrema towards zero for which only samples stand."""
        y = self.y
        towards = np.sign(y[1:-1])
        turn = (towards * y[1:-1] <= towards * y[:-2]) & (towards * y[1:-1] <= towards * y[2:])
        bend = np.abs(y[:-2] - 2 * y[1:-1] + y[2:])  # four times how far it may go between
        near = (np.abs(y[1:-1]) > self.noise[1:-1]) & (np.abs(y[1:-1]) <= bend)
        for i in (np.flatnonzero(turn & near & self.rough[1:-1]) + 1).tolist():
            sign = float(np.sign(y[i]))
            q = self._towards_zero(sign, float(self.x[i - 1]), float(self.x[i + 1]))
            value = self.one(q)
            if math.isfinite(value) and sign * value < sign * y[i]:
                self.x[i], self.y[i] = q, value

    def _towards_zero(self, sign: float, low: float, high: float) -> float:
        return minimize(lambda q: sign * self.one(q), low, high)

    def _signs(self) -> tuple[Floats, NDArray[np.bool_], list[Bound]]:
        """Places, whether the group closes there, and the change points.

        A margin within its rounding has no sign. Between two places where it has the same
        sign it touches zero, at one place.
        """
        x, y, noise = self._whole()
        sure = np.abs(y) > noise
        closes = y >= 0
        passes, kept = [], sure.copy()
        if self.piece.start is not None:
            kept[[0, -1]] = True
        for low, high in runs(~sure):
            if low == 0 or high == len(x) - 1 or closes[low - 1] != closes[high + 1]:
                continue
            i = low + int(np.argmin(np.abs(y[low : high + 1])))
            kept[i], closes[i] = True, True
            if closes[low - 1]:  # it closes on both sides
                q = self._wrapped(float(x[i]))
                closes[i] = self._passed(q)
                passes += [Bound(q, self.block)] * bool(closes[i])
        return x[kept], closes[kept], passes

    def _whole(self) -> tuple[Floats, Floats, Floats]:
        """Samples; of a turn from a place whose sign is sure, to the same one a turn later."""
        x, y, noise = self.x, self.y, self.noise
        if self.piece.start is not None:
            return x, y, noise
        first = int(np.argmax(np.abs(y)))
        y, noise = (np.concatenate([v[first:], v[: first + 1]]) for v in (y, noise))
        return np.concatenate([x[first:], x[: first + 1] + TURN]), y, noise

    def _passed(self, q: float) -> bool:
        size = self.piece.span.size
        return self.passable(self.block, q, BESIDE * (1.0 if math.isinf(size) else size))

    def _wrapped(self, q: float) -> float:
        return q if self.piece.start else (q - SEAM) % TURN + SEAM

    def _part(self, x: Floats, low: int, high: int, passes: Iterable[Bound]) -> Piece:
        """The part between samples that are the first and the last one to close."""
        turns = 0.0
        if self.piece.start is None:
            turns = math.floor(((x[low] + x[high]) / 2 - SEAM) / TURN) * TURN
        start = self.piece.start if low == 0 else self._end(x[low] - turns, x[low - 1] - turns)
        last = high == len(x) - 1
        end = self.piece.end if last else self._end(x[high] - turns, x[high + 1] - turns)
        assert start is not None
        assert end is not None
        around = (0.0, -TURN, TURN) if self.piece.start is None else (0.0,)
        shifted = {Bound(p.q + t, p.block) for p in passes for t in around}
        inside = sorted((p for p in shifted if start.q < p.q < end.q), key=lambda p: p.q)
        return Piece(Span(start.q, end.q, size=self.piece.span.size), start, end, tuple(inside))

    def _end(self, inside: float, outside: float) -> Bound:
        return Bound(bisect(lambda q: self.one(q) >= 0, inside, outside), self.block)


def runs(holds: Sequence[bool] | NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of every run of True."""
    padded = np.concatenate([[0], np.asarray(holds).astype(int), [0]])
    edges = np.flatnonzero(np.diff(padded))
    return list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True))
