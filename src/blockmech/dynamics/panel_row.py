r"""A row of panels, all at once: up to the next standstill, goal or turn.

The kinetic energy along the path is known before the motion, and its first zero is the standstill.
Panels whose time is not smooth are halved, all at the same time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.panel_builder import ROUGH, PanelBuilder, PathState
from blockmech.dynamics.panels import (
    FROM_REST,
    PLAIN,
    ROOT,
    TO_REST,
    Floats,
    Ints,
    Panels,
    Spans,
    basis,
    begin_energies,
    leading,
    rule,
    to_and_fro,
)
from blockmech.dynamics.path_mesh import CLOSE, Course
from blockmech.dynamics.place_data import SHORT, TAU, J
from blockmech.ground.plane import EPS

NEXT = EPS ** (2 / 3)  # relative, of a step of Newton's whose square is below rounding


def series_value(c: list[float], v: float) -> float:
    """A Chebyshev series in 2 v - 1 at a place, by Clenshaw's rule: quicker than arrays for one."""
    y, b, d = 4 * v - 2, 0.0, 0.0
    for term in reversed(c):
        b, d = term + y * b - d, b
    return b - y / 2 * d


class PanelRow:
    """A motion over pieces of the path, from a state to an end or a standstill before it.

    Arrays (m, ...) of its panels; those of whole pieces are the ones kept with the path.

    which, low, length : (m,) the piece of each in the row, its low end and length [rad or m]
    edges : (m + 1,) places where panels begin and end
    values : (m, r + s, n + 1) place data at the nodes of each, and at its anchor
    gains : (m, n + 1) [J] by which loads at rest raise K from its anchor
    kept : (m,) whether it is a whole piece
    stands : whether the last edge is a standstill
    """

    def __init__(
        self,
        builder: PanelBuilder,
        at: PathState,
        course: Course,
        count: int,
        shift: float,
        end: float,
    ) -> None:
        self.builder, self.at, self.stands = builder, at, False
        self.n, self.rounding, self.tolerance = builder.n, builder.rounding, builder.tolerance
        self.row, self.which = course.row.whole(at.sign), course.which[:count]
        self.low, high = course.low[:count] + shift, course.high[:count] + shift
        self.length = high - self.low
        ends, begin = (high, self.low[0]) if at.sign > 0 else (self.low, high[0])
        self.edges = np.empty(count + 1)
        self.edges[0], self.edges[1:-1], self.edges[-1] = at.q, ends[:-1], end
        self.kept = np.ones(count, bool)
        near = CLOSE * max(abs(at.q), abs(end))
        self.kept[0] = at.K > 0 and abs(at.q - begin) <= near
        self.kept[-1] &= abs(end - ends[-1]) <= near
        self.values, self.gains = self.row.values[self.which], self.row.gains[self.which]

    @classmethod
    def ahead(cls, builder: PanelBuilder, at: PathState, goal: float) -> PanelRow | None:
        """As far as whole pieces are known, at most a turn, and to a goal; None where none are."""
        course, shift = builder.mesh.course(at.q, at.sign)
        if course is None:
            return None
        sign, ends = at.sign, course.ends + shift
        reached = sign * (ends - goal) >= 0
        count = len(ends)
        end = float(ends[-1]) if count else goal
        if reached.any():
            count, end = int(reached.argmax()) + 1, goal
        return cls(builder, at, course, count, shift, end) if count else None

    @np.errstate(all="ignore")  # what is not finite is no panel
    def panels(self) -> Panels | None:
        """The panels, or the first ones of them: those that need no shorter piece of the path."""
        self._to_standstill()
        self._fill((~self.kept).nonzero()[0])
        panels, J0, low = self._over_edges()
        count = 0
        for level in reversed(range(SHORT.bit_length())):  # whole, and halved to parts in `SHORT`
            largest = self.row.largest[self.which[:low], TAU]
            some = panels if low == len(self.which) else panels.first(low)
            good = some.smooth(J0[:low], self.tolerance, largest)
            if good.all() or not level:
                count = leading(good)
                break
            self._fill(self._halved((~good).nonzero()[0]))
            panels, J0, low = self._over_edges()
        return panels.first(count) if count else None

    def _halved(self, some: Ints) -> Ints:
        """Two panels each in place of some; which these are."""
        m = len(self.which)
        twice = np.ones(m, int)
        twice[some] = 2
        of = np.repeat(np.arange(m), twice)
        self.edges = np.insert(self.edges, some + 1, (self.edges[some] + self.edges[some + 1]) / 2)
        self._take(of)
        first = some + np.arange(len(some))
        halves = np.sort(np.concatenate([first, first + 1]))
        self.kept[halves] = False
        return halves

    def _take(self, of: Any) -> None:
        """Go on with the panels of indices or of a slice."""
        for name in ("which", "low", "length", "values", "gains", "kept"):
            setattr(self, name, getattr(self, name)[of])

    @property
    def kind(self) -> Ints:
        """(m,) kinds of the panels."""
        kind = np.full(len(self.which), PLAIN)
        if self.at.K == 0:
            kind[0] = FROM_REST
        if self.stands:
            kind[-1] = TO_REST
        return kind

    def _fill(self, some: Ints) -> None:
        """Place data, and gains at rest, of panels that are no whole pieces."""
        if not some.size:
            return
        begin, end, kind = self.edges[some], self.edges[some + 1], self.kind[some]
        spans = Spans(begin, end, np.zeros(len(some)), kind)
        ways = spans.way[:, None] * rule(self.n).shares[kind]
        share = (spans.anchor - self.low[some])[:, None] + ways
        share = np.minimum(np.maximum(share / self.length[some, None], 0.0), 1.0)
        series = self.row.series[self.which[some]]
        values = series @ basis(share, self.n).transpose(0, 2, 1)
        self.values[some] = values
        self.gains[some] = spans.gains(values[:, TAU, :-1])

    def _over_edges(self) -> tuple[Panels, Floats, int]:
        """The panels, the inertia (m,) at their anchors, and how many of them are possible."""
        spans = Spans(self.edges[:-1], self.edges[1:], np.zeros(len(self.which)), self.kind)
        inertia, w, known = self.values[:, J], self.values[:, TAU, :-1], len(self.which)
        if self.rounding:
            inertia = inertia + self.rounding * self.row.largest[self.which, J, None]
        energy = begin_energies(self.at.K, self.gains, self._more(spans.way, w))
        if self.stands:
            energy[-1] = 0.0
        spans.energy[:] = energy
        K = energy[:, None] + self.gains
        second = self.values[:, self.row.largest.shape[1] :]
        panels = Panels(self.at.t, spans, w, K, inertia[:, :-1], second)
        if not self.stands:
            known = min(known, leading(np.invert(self._used_up(w, K).any(axis=1))))
        return panels, inertia[:, -1], known

    def _more(self, way: Floats, w: Floats) -> Any:
        """[J] (m,) what a second run has more at the end of each: some roundings."""
        return self.rounding * to_and_fro(way, w) if self.rounding else 0.0

    # -- a standstill, where it is known before the motion ------------------------------

    def _used_up(self, w: Floats, K: Floats) -> NDArray[np.bool_]:
        """Where (m, n + 1) no energy is left, at ends but for rounding."""
        used_up: NDArray[np.bool_] = K <= 0
        braked = np.maximum(-self.at.sign * w[:, -1], 0.0) * np.abs(
            self.edges[1:] - self.edges[:-1]
        )
        used_up[:, -1] |= K[:, -1] < ROOT * braked
        return used_up

    def _to_standstill(self) -> None:
        """Cut the panel that holds a standstill there; not where that needs a shorter piece.

        It is looked for at the nodes of whole pieces, of which the first may begin further back.
        """
        w, way = self.values[:, TAU, :-1], self.edges[1:] - self.edges[:-1]
        sign, behind = self.at.sign, 0.0 if self.kept[0] else self._work(0)[1](self.at.q)
        energies = begin_energies(self.at.K - behind, self.gains, self._more(way, w))
        K = energies[:, None] + self.gains
        used_up = self._used_up(w, K)
        if not self.kept[0]:
            used_up[0] &= sign * (self._nodes(0) - self.at.q) > 0
        if not used_up.any():
            return
        i, j = divmod(int(used_up.argmax()), self.n + 1)
        stop = self._standstill(i, j, float(energies[i]), K[i])
        if stop is None:
            return
        self.edges, self.stands = np.append(self.edges[: i + 1], stop), True
        self._take(slice(i + 1))
        self.kept[i] = False
        if i == 0 and self.at.K == 0:
            self._halved(np.array([0]))

    def _nodes(self, i: int) -> Floats:
        """Places (n + 1,) of a whole piece at its nodes and at its end."""
        v = rule(self.n).leads[TO_REST, 1:]
        low, length = self.low[i], self.length[i]
        return np.asarray(low + length * v if self.at.sign > 0 else low + length * (1.0 - v))

    def _work(self, i: int) -> tuple[Callable[[float], float], Callable[[float], float]]:
        """The effort at a place of a piece, and the work of loads from its begin to there.

        Both as of a way along the motion, so that mirrored motions have the same bits.
        """
        sign, length = self.at.sign, float(self.length[i])
        begin = float(self.low[i]) if sign > 0 else float(self.low[i]) + length
        series, r = self.row.series[self.which[i], TAU], rule(self.n)
        series = series if sign > 0 else -series * r.at_zero
        effort, work = series.tolist(), (length * r.clock @ series).tolist()

        def share(q: float) -> float:
            return min(max(sign * (q - begin) / length, 0.0), 1.0)

        return lambda q: series_value(effort, share(q)), lambda q: series_value(work, share(q))

    def _standstill(self, i: int, j: int, energy: float, K: Floats) -> float | None:
        """Where the energy of a panel is used up, before node j of its piece, by Newton's method.

        ``energy`` [J] at the begin of the piece, ``K`` (n + 1,) at its nodes and its end. None if
        it is not found.
        """
        effort, work = self._work(i)
        begin, sign, nodes = float(self.edges[i]), self.at.sign, self._nodes(i)
        energy, done = energy if i else self.at.K, work(begin)
        before, at_before = (float(K[j - 1]), float(nodes[j - 1])) if j else (energy, begin)
        if sign * (begin - at_before) >= 0:
            before, at_before = energy, begin
        share = before / (before - float(K[j]))
        stop, last = at_before + share * (float(nodes[j]) - at_before), math.inf
        while True:
            tau = effort(stop)
            if not tau < 0:
                return None
            step = sign * (energy + work(stop) - done) / -tau
            if abs(step) >= last:
                break
            last, stop = abs(step), stop + step
            if last <= EPS * abs(stop) or last <= NEXT * abs(stop - begin):
                break
        beyond = sign * (stop - self.edges[i + 1]) > ROOT * abs(stop - begin)
        rough = abs(tau) < ROUGH * self.row.largest[self.which[i], TAU]  # of a long series
        least = float(self.length[i]) / SHORT if rough else CLOSE * abs(stop)
        return None if beyond or sign * (stop - begin) < least else stop
