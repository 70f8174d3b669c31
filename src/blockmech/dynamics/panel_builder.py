"""The next panel of a motion: as long as its path allows, as short as its series asks for.

A panel that holds no standstill begins where the motion is; one that holds it is built
backwards from the standstill, whose place is moved until the energies fit.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics.ends import DEAD_CENTRE, SELF_LOCKED, STANDSTILL, TOO_MANY
from blockmech.dynamics.panels import (
    FROM_REST,
    PLAIN,
    TO_LIMIT,
    TO_REST,
    Floats,
    P,
    Panels,
    Spans,
    basis,
    roots,
    rule,
    span,
)
from blockmech.dynamics.path_equation import (
    EffortFunction,
    Work,
    of_friction,
    of_place,
    of_rate,
    settled,
)
from blockmech.dynamics.path_mesh import CLOSE, PathMesh, Piece, WholePieces
from blockmech.dynamics.place_data import SHORT, SLIPS, TAU, J
from blockmech.dynamics.run import RunEnd
from blockmech.plane import EPS

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
        self.place_only = self.system.depends_on <= {"q"} and self.system.friction is None
        # Whole pieces, and the dK/dq (m, n) found there last; NaN where none did.
        self.solved: tuple[WholePieces, Floats] | None = None
        self.longest = math.inf  # [rad or m] that may be smooth: twice what was, if not all

    def panel(self, at: PathState, piece: Piece, end: float) -> Panels | RunEnd:
        """The next panel towards a place."""
        q, sign, whole = at.q, at.sign, abs(end - at.q)
        end, self.longest = q + sign * min(whole, self.longest), math.inf
        free = self.system.friction is None  # to move on: no self-locking where the motion is
        stop: float | None = None
        while True:
            if abs(end - q) <= CLOSE * max(abs(q), abs(end)):
                # What goes no further than rounding of its place, behind a strong damper, stands.
                return self._too_short(at, end) if stop is None else RunEnd(STANDSTILL)
            lies = span(q, end, at.K, PLAIN if at.K else FROM_REST)
            if piece.data.limit == sign and end == piece.end(sign) and at.K > 0:
                lies = span(q, end, at.K, TO_LIMIT)
            work, rows = self._acting_on(piece, lies, sign)
            acting, K = self._settled(work, lies)
            known = bool(np.isfinite(K).all())
            if not (known or free):
                if (locked := self._locked(at)) is not None:
                    return locked
                free = True
            stop = self._standstill(lies, sign * acting.w, K) if known else None
            if stop is not None:
                way = abs(stop - q)
                if self._shortened(at, piece, way) or self.kept_clear(at, piece, way):
                    return RunEnd("")
                panels = self._to_standstill(at, piece, stop) if at.K else None
                if panels is not None:
                    return panels
                end = q + sign * min(abs(end - q), abs(stop - q))
            elif known:
                panels = self._resolved(at, piece, lies, acting, K, rows)
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

    def _acting_on(self, piece: Piece, lies: Spans, sign: int) -> tuple[Work, Floats]:
        """What acts on a span, and place data (r + s, n + 1) at its nodes and its anchor."""
        friction, (q,) = self.system.friction, lies.places(rule(self.n).known_first)
        (begin,), (end,), (kind,) = lies.begin, lies.end, lies.kind
        rows = piece.whole(begin, end) if kind == PLAIN else None
        if rows is None:
            rows = piece.rows(q)
        if self.rounding:
            rows = rows.copy()
            rows[J] += self.rounding * piece.data.largest[J]
        q, first = q[:-1], rows[: len(piece.data.rows), :-1]
        if self.place_only:
            return of_place(first), rows
        if friction is None:
            return of_rate(self.system, q, first, first[J], sign), rows
        slips = first[SLIPS : SLIPS + len(friction.names), self.n // 2]
        sides = tuple(map(int, friction.senses(sign * slips)))
        return of_friction(friction, q, first, sign, sides), rows

    def _settled(
        self, work: Work, lies: Spans, guess: Floats | None = None
    ) -> tuple[EffortFunction, Floats]:
        if not self.place_only:
            return settled(work, lies, self.n, guess)
        acting = work(np.empty(0))
        return acting, lies.energy[0] + lies.slopes(self.n)[0] @ acting.w

    def _resolved(
        self,
        at: PathState,
        piece: Piece,
        lies: Spans,
        acting: EffortFunction,
        K: Floats,
        rows: Floats,
    ) -> Panels | RunEnd | None:
        """The panel of a solution, or what is before its end; None where it is too long."""
        lost = np.zeros((1, self.n)) + acting.lost
        J0, second = rows[J, -1:], rows[None, len(piece.data.rows) :]
        panel = Panels(at.t, lies, acting.w[None], K[None], rows[None, J, :-1], lost, second)
        effort = piece.data.largest[TAU]
        tolerance = self.tolerance
        if lies.kind[0] == TO_LIMIT:  # no smoother than the inertia is known to be
            tolerance = max(tolerance, piece.data.unknown)
        if not panel.smooth(J0, tolerance, not self.place_only, effort)[0]:
            return None
        return self._until_kink(at, piece, panel, acting)

    def _locked(self, at: PathState) -> RunEnd | None:
        """Self-locking where the motion is: no acceleration satisfies Coulomb's law there."""
        friction = self.system.friction
        if friction is None:
            return None
        J0 = float(self.system.at(at.q).J[0])
        rate = at.sign * math.sqrt(2 * at.K / J0)
        state = friction.at(at.q, rate, 0.0, friction.sides(at.q, at.sign))
        if not state.locked:
            return None
        note = f"{SELF_LOCKED}: t = {at.t:.9g} s, q = {at.q:.9g}, rate = {rate:.9g}"
        known = {} if math.isnan(state.limit) else {"friction_limit": state.limit}
        return RunEnd(SELF_LOCKED, note=note, facts=known)

    def _too_short(self, at: PathState, end: float) -> RunEnd:
        """No panel is short enough: friction has no solution, or the loads are not smooth."""
        rough = RunEnd(TOO_MANY, note=f"the loads are not smooth at q = {at.q:.12g}")
        return self._locked(at._replace(q=end)) or rough

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
        last, guessed = math.inf, None
        before: tuple[float, float] | None = None  # an end, and what energy that leaves over
        while True:
            length = at.sign * (guess - at.q)
            if abs(length) <= CLOSE * max(abs(at.q), abs(guess)):
                return RunEnd(STANDSTILL)
            if length <= 0 or at.sign * (guess - piece.end(at.sign)) > math.sqrt(EPS) * length:
                return None
            lies = span(at.q, guess, 0.0, TO_REST)
            work, rows = self._acting_on(piece, lies, at.sign)
            acting, K = self._settled(work, lies, guessed)
            series = rule(self.n).to_series @ acting.w
            at_rest = float(series[::2].sum() - series[1::2].sum())
            if not at.sign * at_rest < 0:
                return None
            left = at.K - float(K[-1])
            slope = -at_rest  # of K by the end; with loads of the rate a secant's
            if before is not None and guess != before[0] and left != before[1]:
                slope = (before[1] - left) / (guess - before[0])
            step = left / slope
            if abs(step) <= EPS * abs(guess) or abs(step) >= last:
                break
            before = guess, left
            last, guess, guessed = abs(step), guess + step, acting.w
        lies = span(at.q, guess, 0.0, TO_REST)
        return self._resolved(at, piece, lies, acting, K, rows)

    # -- kinks of the loads on pairs -------------------------------------------

    def _until_kink(
        self, at: PathState, piece: Piece, panel: Panels, acting: EffortFunction
    ) -> Panels | RunEnd:
        """The panel, or the part of it up to where the size of a load has a kink."""
        if self.system.friction is None:
            return panel
        kink = self._first_kink(at, panel.spans, acting.loads)
        if kink is None or abs(kink - at.q) <= math.sqrt(EPS) * abs(panel.spans.way[0]):
            return panel
        return self.panel(at, piece, kink)

    def _first_kink(self, at: PathState, lies: Spans, loads: Any) -> float | None:
        """Where a guide is pressed by another side or edge, or a pin by its other side."""
        friction = self.system.friction
        assert friction is not None
        kinks: list[float] = []
        r, (way,) = rule(self.n), lies.way
        near = max(math.sqrt(EPS), CLOSE * abs(at.q / way))  # one at an end, but for rounding
        for load, guide, factor in zip(loads, friction.guides, friction.usual, strict=True):
            if not factor:  # the load does not count
                continue
            F = load.real + 1j * load.imag
            across, largest = np.zeros(self.n), float(np.abs(F).max())
            if guide:
                N, C = F.real, F.imag
                passing = (N + C, N - C) if np.abs(C).max() > 0 else (N,)
            else:  # along the way that the load takes where it is least
                i = min(max(int(np.abs(F).argmin()), 1), self.n - 2)
                turned = F * np.conj(F[i + 1] - F[i - 1])
                if not np.abs(turned).max() > np.finfo(np.float64).tiny:
                    continue  # a load that does not change has no kink
                turned /= np.abs(turned).max()
                passing, across, largest = (turned.real,), turned.imag, 1.0
            for part in passing:
                v = roots(r.to_series @ part)
                missed = np.abs(basis(v, self.n) @ (r.to_series @ across))
                v = v[(v > near) & (v < 1 - near) & (missed <= near * largest)]
                kinks += lies.places(v)[0].tolist()
        return min(kinks, key=lambda x: at.sign * x) if kinks else None
