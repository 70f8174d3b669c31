"""The next panel of a motion: as long as its path allows, as short as its series asks for.

A panel that holds no standstill begins where the motion is; one that holds it is built
backwards from the standstill, whose place is moved until the energies fit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.ends import DEAD_CENTRE, STANDSTILL, TOO_MANY
from blockmech.dynamics.panels import (
    FROM_REST,
    PLAIN,
    TO_LIMIT,
    TO_REST,
    Floats,
    P,
    Panels,
    Spans,
    rule,
    span,
)
from blockmech.dynamics.path_mesh import CLOSE, PathMesh, Piece
from blockmech.dynamics.place_data import SHORT, TAU, J
from blockmech.dynamics.run import RunEnd
from blockmech.ground.plane import EPS

ROUGH = 1 / 64  # of a piece's inertia: what is below has two digits less


class PathState(NamedTuple):
    """Where a motion is: time [s], coordinate, kinetic energy [J] and direction."""

    t: float
    q: float
    K: float
    sign: int


class PanelBuilder:
    """Panels over a mesh of the path, with as many nodes and resolved to the same tolerance.

    ``rounding``: what the inertia is made wrong by, relative to the largest of its piece.
    """

    def __init__(self, mesh: PathMesh, rounding: float = 0.0) -> None:
        self.mesh, self.n, self.rounding = mesh, mesh.n, rounding
        self.system, self.tolerance = mesh.system, mesh.tolerance
        self.longest = math.inf  # [rad or m] that may be smooth: twice what was, if not all

    def panel(self, at: PathState, piece: Piece, end: float) -> Panels | RunEnd:
        """The next panel towards a place."""
        q, sign, whole = at.q, at.sign, abs(end - at.q)
        end, self.longest = q + sign * min(whole, self.longest), math.inf
        stop: float | None = None
        while True:
            if abs(end - q) <= CLOSE * max(abs(q), abs(end)):
                if stop is not None:  # what goes no further than rounding of its place stands
                    return RunEnd(STANDSTILL)
                return RunEnd(TOO_MANY, note=f"the loads are not smooth at q = {at.q:.12g}")
            lies = span(q, end, at.K, PLAIN if at.K else FROM_REST)
            if piece.data.limit == sign and end == piece.end(sign) and at.K > 0:
                lies = span(q, end, at.K, TO_LIMIT)
            rows = self._rows_on(piece, lies)
            w, K = self._energies(rows, lies)
            known = bool(np.isfinite(K).all())
            stop = self._standstill(lies, sign * w, K) if known else None
            if stop is not None:
                way = abs(stop - q)
                if self._shortened(at, piece, way) or self.kept_clear(at, piece, way):
                    return RunEnd("")
                panels = self._to_standstill(at, piece, stop) if at.K else None
                if panels is not None:
                    return panels
                end = q + sign * min(abs(end - q), abs(stop - q))
            elif known:
                panels = self._resolved(at, piece, lies, w, K, rows)
                if panels is not None:
                    self.longest = 2 * abs(end - q) if abs(end - q) < whole else math.inf
                    return panels
            end = q + 0.5 * (end - q)
            rough = rows[J].min() < ROUGH * piece.data.largest[J]
            if rough and self._shortened(at, piece, abs(end - q)):
                return RunEnd("")

    def _shortened(self, at: PathState, piece: Piece, way: float) -> bool:
        """Whether a way that is short against its piece of the path got one of its own size."""
        if not CLOSE * abs(at.q) < way < piece.data.length / SHORT:
            return False
        self.mesh.shorten(piece, at.q, at.sign, SHORT / 2 * way)
        return True

    def kept_clear(self, at: PathState, piece: Piece, way: float) -> bool:
        """Whether a way that ends before a dead centre got a piece that ends before it as well.

        The values of one that does not lose digits there, and its series lose them everywhere.
        """
        left = abs(piece.end(at.sign) - at.q) - way
        if piece.what_ends(at.sign) != DEAD_CENTRE or left <= math.sqrt(EPS) * way:
            return False
        self.mesh.shorten(piece, at.q, at.sign, way + left / 2)
        return True

    def _rows_on(self, piece: Piece, lies: Spans) -> Floats:
        """Place data (r + s, n + 1) at the nodes of a span and at its anchor."""
        (q,) = lies.places(rule(self.n).known_first)
        (begin,), (end,), (kind,) = lies.begin, lies.end, lies.kind
        rows = piece.whole(begin, end) if kind == PLAIN else None
        if rows is None:
            rows = piece.rows(q)
        if self.rounding:
            rows = rows.copy()
            rows[J] += self.rounding * piece.data.largest[J]
        return rows

    def _energies(self, rows: Floats, lies: Spans) -> tuple[Floats, Floats]:
        """dK/dq (n,) on a span and K (n + 1,)."""
        w = rows[TAU, :-1]
        return w, lies.energy[0] + lies.slopes(self.n)[0] @ w

    def _resolved(
        self, at: PathState, piece: Piece, lies: Spans, w: Floats, K: Floats, rows: Floats
    ) -> Panels | None:
        """The panel of a span; None where it is too long."""
        J0, second = rows[J, -1:], rows[None, len(piece.data.rows) :]
        panel = Panels(at.t, lies, w[None], K[None], rows[None, J, :-1], second)
        tolerance = self.tolerance
        if lies.kind[0] == TO_LIMIT:  # no smoother than the inertia is known to be
            tolerance = max(tolerance, piece.data.unknown)
        return panel if panel.smooth(J0, tolerance, piece.data.largest[TAU])[0] else None

    def _standstill(self, lies: Spans, along: Floats, K: Floats) -> float | None:
        """The first place of a panel at which K is zero, roughly; None where there is none.

        ``along`` (n,) is dK/du along the motion. Where K only comes near zero between the
        nodes, the time is not resolved and the panel is made shorter.
        """
        (begin,), (end,), (energy,), (kind,) = lies.begin, lies.end, lies.energy, lies.kind
        if K.min() > 0:
            if kind == TO_LIMIT or K[-1] > -along[-1] * math.sqrt(EPS) * abs(end - begin):
                return None  # but a standstill that is at the end but for rounding is in it
            return float(end - np.sign(end - begin) * K[-1] / along[-1])
        if kind == TO_LIMIT:
            return float(end + 0.5 * (begin - end))  # closer first
        i = int(np.argmax(K <= 0))
        u = np.append(rule(self.n).v, 1.0) ** P[kind]
        if energy == 0:  # from rest the mean effort K / u is nearly a line
            a, b = (i - 1, i) if i else (0, 1)
            mean = K / u
            stop = u[a] - mean[a] * (u[b] - u[a]) / (mean[b] - mean[a])
            return float(begin + (end - begin) * np.clip(stop, u[0] ** 2, u[b]))
        before, at_before = (float(K[i - 1]), u[i - 1]) if i else (energy, 0.0)
        share = before / (before - float(K[i]))
        return float(begin + (end - begin) * (at_before + share * (u[i] - at_before)))

    def _to_standstill(self, at: PathState, piece: Piece, guess: float) -> Panels | RunEnd | None:
        """The panel that ends at a standstill; None where it is not resolved.

        Its end is moved until the energy at its other end is that of the motion.
        """
        last = math.inf
        while True:
            length = at.sign * (guess - at.q)
            if abs(length) <= CLOSE * max(abs(at.q), abs(guess)):
                return RunEnd(STANDSTILL)
            if length <= 0 or at.sign * (guess - piece.end(at.sign)) > math.sqrt(EPS) * length:
                return None
            lies = span(at.q, guess, 0.0, TO_REST)
            rows = self._rows_on(piece, lies)
            w, K = self._energies(rows, lies)
            series = rule(self.n).to_series @ w
            at_rest = float(series[::2].sum() - series[1::2].sum())
            if not at.sign * at_rest < 0:
                return None
            step = (at.K - float(K[-1])) / -at_rest
            if abs(step) <= EPS * abs(guess) or abs(step) >= last:
                return self._resolved(at, piece, lies, w, K, rows)
            last, guess = abs(step), guess + step
