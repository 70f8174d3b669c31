"""Loads of the place alone: all panels up to the next standstill at once.

There the kinetic energy along the road is known before the motion: its first zero is the
standstill, and the time is an integral between. Panels whose time is not smooth are halved, all
at the same time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.ahead import ROUGH, At, PanelBuilder
from blockmech.dynamics.panels import FROM_REST, PLAIN, TO_REST, Floats, Panels, Spans, basis, rule
from blockmech.dynamics.place import SHORT, TAU, J
from blockmech.dynamics.road import CLOSE, Piece
from blockmech.plane import EPS


class LibrationSolver:
    """A motion over pieces of the road, from a state to an end or a standstill before it.

    edges : (m + 1,) places where panels begin and end
    pieces : (m,) of the road in which they lie
    stands : whether the last edge is a standstill
    """

    def __init__(self, ahead: PanelBuilder, at: At, pieces: Sequence[Piece], end: float) -> None:
        self.n, self.rounding, self.tolerance = ahead.n, ahead.rounding, ahead.tolerance
        self.at, self.stands = at, False
        self.edges = [at.q, *(p.end(at.sign) for p in pieces[:-1]), end]
        self.pieces = list(pieces)

    def panels(self) -> Panels | None:
        """The panels, or the first ones of them: those that need no shorter road."""
        for _ in range(SHORT.bit_length()):  # whole, and halved to parts in `SHORT`
            panels, J0 = self._over_edges()
            largest = np.array([x.data.largest[TAU] for x in self.pieces])
            good = panels.smooth(J0, self.tolerance, False, largest)
            low = np.flatnonzero(self._used_up(panels).any(axis=1))
            if low.size and not self.stands:
                good = good[: low[0]]
                if not self._stopped(panels, int(low[0])):
                    break
            elif good.all():
                return panels
            self._halved(np.flatnonzero(~good).tolist())
        count = int(np.argmin(np.append(good, False)))
        return panels.first(count) if count else None

    def _used_up(self, panels: Panels) -> NDArray[np.bool_]:
        """Where (m, n + 1) no energy is left, at ends but for rounding."""
        found: NDArray[np.bool_] = panels.K <= 0
        braked = np.maximum(-self.at.sign * panels.w[:, -1], 0.0) * np.abs(panels.spans.way)
        found[:, -1] |= panels.K[:, -1] < math.sqrt(EPS) * braked
        return found

    def _halved(self, which: list[int]) -> None:
        """Two panels each in place of some."""
        for i in reversed(which):
            self.edges.insert(i + 1, (self.edges[i] + self.edges[i + 1]) / 2)
            self.pieces.insert(i, self.pieces[i])

    def _over_edges(self) -> tuple[Panels, Floats]:
        """The panels, and the inertia (m,) at their anchors."""
        n, m = self.n, len(self.pieces)
        edges = np.array(self.edges)
        kind = np.full(m, PLAIN)
        if self.at.K == 0:
            kind[0] = FROM_REST
        if self.stands:
            kind[-1] = TO_REST
        spans = Spans(edges[:-1], edges[1:], np.zeros(m), kind)
        rows = self._rows(spans)
        inertia, w = rows[:, J], rows[:, TAU, :-1]
        gains = spans.way[:, None] * (rule(n).energy[kind] @ w[..., None])[..., 0]
        more = gains[:, -1] + self.rounding * np.abs(spans.way) * np.abs(w).mean(axis=1)
        energy = self.at.K + np.append(0.0, np.cumsum(more[:-1]))
        if self.stands:
            energy[-1] = 0.0
        lies, K = replace(spans, energy=energy), energy[:, None] + gains
        panels = Panels(self.at.t, lies, w, K, inertia[:, :-1], np.zeros((m, n)))
        return panels, inertia[:, -1]

    def _rows(self, spans: Spans) -> Floats:
        """Inertia and effort (m, 2, n + 1) at the nodes and the anchors of panels."""
        rows = np.empty((len(self.pieces), 2, self.n + 1))
        data, parts = [x.data for x in self.pieces], list[int]()
        for i, piece in enumerate(self.pieces):
            plain = spans.kind[i] == PLAIN
            whole = piece.whole(self.edges[i], self.edges[i + 1]) if plain else None
            if whole is None:
                parts.append(i)
            else:
                rows[i] = whole[: TAU + 1]
        if parts:
            low = np.array([self.pieces[i].end(-1) for i in parts])[:, None]
            share = spans.places(rule(self.n).known_first)[parts] - low
            share /= np.array([data[i].length for i in parts])[:, None]
            series = np.array([data[i].series[: TAU + 1].T for i in parts])
            values = basis(np.clip(share, 0.0, 1.0), self.n) @ series
            rows[parts] = np.swapaxes(values, 1, 2)
        rows[:, J] += self.rounding * np.array([x.largest[J] for x in data])[:, None]
        return rows

    def _stopped(self, panels: Panels, i: int) -> bool:
        """Whether a panel was cut at its standstill; not where that needs a shorter road."""
        stop = self._standstill(panels, i)
        if stop is None:
            return False
        self.edges, self.pieces = [*self.edges[: i + 1], stop], self.pieces[: i + 1]
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
        stop = float(at_before + (nodes[j] - at_before) * before / (before - K[j]))
        last = math.inf
        v = np.append(r.v, 1.0)
        while True:
            way = stop - begin
            share = (begin + way * v - piece.data.low - piece.shift) / piece.data.length
            tau = basis(np.clip(share, 0.0, 1.0), self.n) @ piece.data.series[TAU]
            if not sign * tau[-1] < 0:
                return None
            step = (energy + way * float(r.average[-1] @ tau[:-1])) / -float(tau[-1])
            if abs(step) <= EPS * abs(stop) or abs(step) >= last:
                break
            last, stop = abs(step), stop + step
        beyond = sign * (stop - self.edges[i + 1]) > math.sqrt(EPS) * abs(stop - begin)
        rough = abs(tau[-1]) < ROUGH * piece.data.largest[TAU]  # a small part of a long series
        least = piece.data.length / SHORT if rough else CLOSE * abs(stop)
        return None if beyond or sign * (stop - begin) < least else stop
