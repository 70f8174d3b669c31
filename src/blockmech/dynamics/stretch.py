r"""All panels of a stretch at once: up to the next standstill, goal or turn.

    dK/dq = w(q, K)

is solved for all panels together. Loads of the place alone need no K: there the kinetic energy
along the path is known before the motion, and its first zero is the standstill. Else Newton's
method solves for w; with a = dw/dK its equation for the change of K is linear and of first order,
so an integrating factor takes the place of a matrix:

    dK' = r + a dK  ->  dK = e^A (dK_0 + integral of e^-A r),   A = integral of a

Panels whose time is not smooth are halved, all at the same time; joint friction, and a standstill
that is not known before, are left to `PanelBuilder`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.ahead import ROUGH, PanelBuilder, PathState
from blockmech.dynamics.panels import (
    FROM_REST,
    PLAIN,
    SMALLEST,
    TO_REST,
    Floats,
    P,
    Panels,
    Spans,
    basis,
    leading,
    rule,
)
from blockmech.dynamics.place import SHORT, TAU, J
from blockmech.dynamics.road import CLOSE, Piece
from blockmech.dynamics.work import FAST, of_rate
from blockmech.plane import EPS

NEXT = EPS ** (2 / 3)  # relative, of a step of Newton's whose square is below rounding
STEPS = 16  # of Newton's method; what needs more is left to panels one by one


def cubic_zero(a: float, b: float, rise: float, fall: float, x: float) -> float:
    """Near x in [0, 1] the zero of the cubic from a to b with these slopes at its ends."""
    c3, c2 = 2 * (a - b) + rise + fall, 3 * (b - a) - 2 * rise - fall
    for _ in range(3):
        slope = (3 * c3 * x + 2 * c2) * x + rise
        x -= (((c3 * x + c2) * x + rise) * x + a) / slope if slope else 0.0
    return min(max(x, 0.0), 1.0)


class Stretch:
    """A motion over pieces of the path, from a state to an end or a standstill before it.

    edges : (m + 1,) places where panels begin and end
    pieces : (m,) of the path in which they lie
    rows : (m,) place data at the nodes and the anchor of each, None where they are not known yet
    stands : whether the last edge is a standstill
    """

    def __init__(
        self, ahead: PanelBuilder, at: PathState, pieces: Sequence[Piece], end: float
    ) -> None:
        self.n, self.rounding, self.tolerance = ahead.n, ahead.rounding, ahead.tolerance
        self.ahead, self.at, self.stands, self.place_only = ahead, at, False, ahead.place_only
        self.edges = [at.q, *(p.end(at.sign) for p in pieces[:-1]), end]
        self.pieces = list(pieces)
        self.rows: list[Floats | None] = [p.over_all(at.sign) for p in pieces]
        for i in {0, len(pieces) - 1}:  # the others are whole pieces
            self.rows[i] = pieces[i].whole(self.edges[i], self.edges[i + 1])
        if at.K == 0:
            self.rows[0] = None

    @np.errstate(all="ignore")  # what is not finite is no panel
    def panels(self) -> Panels | None:
        """The panels, or the first ones of them: those that need no shorter piece of the path."""
        panels, J0, low = self._over_edges()
        if low < len(self.pieces) and self.place_only and self._stopped(panels, low):
            panels, J0, low = self._over_edges()
        count = 0
        for level in reversed(range(SHORT.bit_length())):  # whole, and halved to parts in `SHORT`
            largest = np.array([x.data.largest[TAU] for x in self.pieces[:low]])
            some = panels if low == len(self.pieces) else panels.first(low)
            good = some.smooth(J0[:low], self.tolerance, not self.place_only, largest)
            if good.all() or not level:
                count = leading(good)
                break
            self._halved(np.flatnonzero(~good).tolist())
            panels, J0, low = self._over_edges()
        return panels.first(count) if count else None

    def _halved(self, which: list[int]) -> None:
        """Two panels each in place of some."""
        for i in reversed(which):
            self.edges.insert(i + 1, (self.edges[i] + self.edges[i + 1]) / 2)
            self.pieces.insert(i, self.pieces[i])
            self.rows[i : i + 1] = [None, None]

    def _over_edges(self) -> tuple[Panels, Floats, int]:
        """The panels, the inertia (m,) at their anchors, and how many of them are possible."""
        n, m, at = self.n, len(self.pieces), self.at
        edges = np.array(self.edges)
        kind = np.full(m, PLAIN)
        if at.K == 0:
            kind[0] = FROM_REST
        if self.stands:
            kind[-1] = TO_REST
        spans = Spans(edges[:-1], edges[1:], np.zeros(m), kind)
        rows = self._rows(spans)
        inertia, w, known = rows[:, J], rows[:, TAU, :-1], m
        if self.place_only:
            gains = spans.gains(w)
            energy = self._energies(spans, w, gains)
        else:
            w, gains, energy, known = self._settled(spans, rows[..., :-1])
        if self.stands:
            energy[-1] = 0.0
        spans.energy[:] = energy
        K = energy[:, None] + gains
        panels = Panels(at.t, spans, w, K, inertia[:, :-1], np.zeros((m, n)))
        if not self.stands:
            known = min(known, leading(np.invert(self._used_up(panels).any(axis=1))))
        return panels, inertia[:, -1], known

    def _energies(self, spans: Spans, w: Floats, gains: Floats) -> Floats:
        """[J] (m,) at the begin of each; of a run beside another, some roundings more each."""
        energies = np.empty(len(gains))
        energies[0], energies[1:] = 0.0, gains[:-1, -1]
        if self.rounding:
            energies[1:] += self.rounding * (np.abs(spans.way) * np.abs(w).mean(axis=1))[:-1]
        return self.at.K + np.cumsum(energies)

    def _settled(self, spans: Spans, rows: Floats) -> tuple[Floats, Floats, Floats, int]:
        """dK/dq (m, n), gains (m, n + 1), energies (m,), and of how many panels they are found.

        The slope of what acts by the energy serves while steps fall fast, as in `settled`.
        """
        r, kind, shape = rule(self.n), spans.kind, (len(rows), self.n)
        bends = P[kind][:, None] * r.powers[kind] * spans.way[:, None]
        flat = np.moveaxis(rows, 1, 0).reshape(rows.shape[1], -1)
        acts = of_rate(self.ahead.system, spans.places(r.v).ravel(), flat, self.at.sign)
        w = acts(np.full(rows[:, J].size, self.at.K)).w.reshape(shape)
        for i, kept in enumerate(self.rows):  # a turn is like the one before
            w[i] = self.ahead.solved.get(id(kept), (kept, w[i]))[1]
        last, a, known = np.full(len(w), math.nan), None, 0
        for _ in range(STEPS):
            gains = spans.gains(w)
            energy = self._energies(spans, w, gains)
            K = (energy[:, None] + gains)[:, :-1]
            now = acts(K.ravel()).w.reshape(shape)
            if a is None:
                step = math.sqrt(EPS) * (np.abs(K) + EPS * np.abs(K).max()) + SMALLEST
                a = (acts((K + step).ravel()).w.reshape(shape) - now) / step
                A = (a * bends) @ r.energy[PLAIN].T
                growth, fading = np.exp(A), np.exp(-A[:, :-1])
            rise, begin = spans.gains(fading * (now - w)), np.zeros(len(w))
            for i in range(len(w) - 1):
                begin[i + 1] = growth[i, -1] * (begin[i] + rise[i, -1])
            change = now - w + a * (growth * (begin[:, None] + rise))[:, :-1]
            w = w + change
            size, whole = np.abs(change).max(axis=1), np.abs(w).max(axis=1)
            following = size * (size / last)  # at most, as steps fall faster and faster
            settled = np.fmin(size, following) <= 4 * EPS * whole
            settled |= (size >= last) & (size <= math.sqrt(EPS) * whole)
            known = min(leading(settled), leading(K.min(axis=1) > 0))
            if known == leading(K.min(axis=1) > 0):  # behind a standstill nothing counts
                break
            slow = ~(size[: known + 1] <= FAST * last[: known + 1])
            a, last = None if slow.any() else a, size
        gains = spans.gains(w)
        # With the rows: as long as they are kept no others have their identity.
        pairs = zip(self.rows, w, strict=True)
        self.ahead.solved = {id(rows): (rows, solution) for rows, solution in pairs}
        return w, gains, self._energies(spans, w, gains), known

    def _rows(self, spans: Spans) -> Floats:
        """Place data (m, r, n + 1) at the nodes and the anchors of panels."""
        parts = [i for i, known in enumerate(self.rows) if known is None]
        if parts:
            of = [self.pieces[i] for i in parts]
            low = np.array([x.end(-1) for x in of])[:, None]
            length = np.array([x.data.length for x in of])[:, None]
            v = rule(self.n).known_first
            ways = np.where(spans.kind[parts, None] == PLAIN, v, v * v)
            share = (spans.anchor[parts, None] - low + spans.way[parts, None] * ways) / length
            values = basis(np.minimum(np.maximum(share, 0.0), 1.0), self.n)
            for i, x, at_nodes in zip(parts, of, values, strict=True):
                self.rows[i] = x.data.series @ at_nodes.T
        rows = np.array(self.rows)
        if self.rounding:
            largest = np.array([x.data.largest[J] for x in self.pieces])
            rows[:, J] += self.rounding * largest[:, None]
        return rows

    # -- a standstill, where it is known before the motion ------------------------------

    def _used_up(self, panels: Panels) -> NDArray[np.bool_]:
        """Where (m, n + 1) no energy is left, at ends but for rounding."""
        used_up: NDArray[np.bool_] = panels.K <= 0
        braked = np.maximum(-self.at.sign * panels.w[:, -1], 0.0) * np.abs(panels.spans.way)
        used_up[:, -1] |= panels.K[:, -1] < math.sqrt(EPS) * braked
        return used_up

    def _stopped(self, panels: Panels, i: int) -> bool:
        """Whether a panel was cut at its standstill; not where that needs a shorter piece."""
        stop = self._standstill(panels, i)
        if stop is None:
            return False
        self.edges, self.pieces = [*self.edges[: i + 1], stop], self.pieces[: i + 1]
        self.rows = [*self.rows[:i], None]
        self.stands = True
        if i == 0 and self.at.K == 0:
            self._halved([0])
        return True

    def _standstill(self, panels: Panels, i: int) -> float | None:
        """Where the energy of a panel is used up, by Newton's method; None if not found."""
        r, piece, K = rule(self.n), self.pieces[i], panels.K[i]
        begin, energy, sign = self.edges[i], float(panels.spans.energy[i]), self.at.sign
        j = int(np.argmax(self._used_up(panels)[i]))
        nodes = np.append(panels.spans.places(r.v)[i], self.edges[i + 1])
        before, at_before = (float(K[j - 1]), nodes[j - 1]) if j else (energy, begin)
        share, near = before / (before - float(K[j])), float(nodes[j] - at_before)
        if 0 < j < self.n:  # by the cubic through both, with their slopes
            rise, fall = panels.w[i, j - 1 : j + 1].tolist()
            share = cubic_zero(before, float(K[j]), rise * near, fall * near, share)
        stop = float(at_before + near * share)
        last = math.inf
        v = np.append(r.v, 1.0)
        while True:
            way = stop - begin
            x = (begin + way * v - piece.data.low - piece.shift) / piece.data.length
            tau = basis(np.minimum(np.maximum(x, 0.0), 1.0), self.n) @ piece.data.series[TAU]
            if not sign * tau[-1] < 0:
                return None
            step = (energy + way * float(r.average[-1] @ tau[:-1])) / -float(tau[-1])
            if abs(step) >= last:
                break
            last, stop = abs(step), stop + step
            if last <= EPS * abs(stop) or last <= NEXT * abs(way):
                break
        beyond = sign * (stop - self.edges[i + 1]) > math.sqrt(EPS) * abs(stop - begin)
        rough = abs(tau[-1]) < ROUGH * piece.data.largest[TAU]  # a small part of a long series
        least = piece.data.length / SHORT if rough else CLOSE * abs(stop)
        return None if beyond or sign * (stop - begin) < least else stop
