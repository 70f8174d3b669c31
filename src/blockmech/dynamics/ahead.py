"""The next panel of a motion: as long as its road allows, as short as its series asks for.

A panel that holds no standstill begins where the motion is; one that holds it is built
backwards from the standstill, whose place is moved until the energies fit.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.events import STANDSTILL
from blockmech.dynamics.motion import SELF_LOCKED, TOO_MANY
from blockmech.dynamics.panels import SMALLEST, Floats, Panel, Span, basis, roots, rule
from blockmech.dynamics.road import CLOSE, SLIPS, TAU, J, Piece, Road
from blockmech.dynamics.work import STEPS, OfFriction, OfRate, Work, settled
from blockmech.plane import EPS
from blockmech.series import tail

SHORT = 8  # a piece is made anew if what happens in it needs no more than this part of it
ROUGH = 1 / 64  # of a piece's inertia: what is below has two digits less


class At(NamedTuple):
    """Where a motion is: time [s], coordinate, kinetic energy [J] and direction."""

    t: float
    q: float
    K: float
    sign: int


class Obstacle(NamedTuple):
    """Why there is no panel: an end by its name, or "" where the road was made anew."""

    end: str = ""
    note: str = ""
    friction_limit: float = math.nan


class Loaded(NamedTuple):
    """What acts at the nodes of a span: work that follows the energy, or w of the place alone."""

    work: Work | None
    w: Floats | None
    J: Floats
    J0: float  # at the anchor


class Ahead:
    """Panels over a road, with as many nodes and resolved to the same tolerance.

    ``rounding``: what the inertia is made wrong by, relative to the largest of its piece.
    """

    def __init__(self, road: Road, rounding: float = 0.0) -> None:
        self.road, self.n, self.rounding = road, road.n, rounding
        self.system, self.tolerance = road.system, road.tolerance
        self.place_only = self.system.depends_on <= {"q"} and self.system.friction is None
        self.largest = 0.0  # [J] kinetic energy that a panel began with

    def panel(self, at: At, piece: Piece, end: float) -> Panel | Obstacle:
        """The next panel towards a place."""
        q, sign = at.q, at.sign
        self.largest = max(self.largest, at.K)
        while True:
            length = abs(end - q)
            if length <= CLOSE * max(abs(q), abs(end)):
                return self._too_short(at, end)
            span = Span(q, length, sign, at.K, 1 if at.K else 2)
            if piece.data.limit == sign and end == piece.end(sign) and at.K > 0:
                span = Span(end, length, sign, at.K, 2, True, True)
            loaded = self._loaded(piece, span)
            w, K = settled(loaded.work, loaded.w, span, self.n)
            known = bool(np.isfinite(w).all())
            if not known and (locked := self._locked(at)) is not None:
                return locked
            stop = self._standstill(span, w, K) if known else None
            if stop is not None:
                if self._shortened(at, piece, abs(stop - q)):
                    return Obstacle()
                found = self._to_standstill(at, piece, stop) if at.K else None
                if found is not None:
                    return found
                length = min(length, abs(stop - q))
            elif known:
                panel = self._made(at, span, end, w, K, loaded)
                if self._resolved(panel, loaded):
                    return self._until_kink(at, piece, panel, loaded.work)
            end = q + sign * 0.5 * length
            rough = loaded.J.min() < ROUGH * piece.data.rows[J].max()
            if rough and self._shortened(at, piece, 0.5 * length):
                return Obstacle()

    def _shortened(self, at: At, piece: Piece, way: float) -> bool:
        """Whether a way that is short against its piece of the road got one of its own size."""
        if not CLOSE * abs(at.q) < way < piece.data.length / SHORT:
            return False
        self.road.shorten(piece, at.q, at.sign, SHORT / 2 * way)
        return True

    def _loaded(self, piece: Piece, span: Span) -> Loaded:
        """What acts on a span."""
        system, sign = self.system, span.sign
        q = span.places(np.append(rule(self.n).v, 0.0))
        rows = piece.rows(q)
        if self.rounding:  # a series is as exact as its largest value
            rows[J] += self.rounding * float(piece.data.rows[J].max())
        J0, q, rows = float(rows[J, -1]), q[:-1], rows[:, :-1]
        if self.place_only:
            return Loaded(None, sign * rows[TAU], rows[J], J0)
        if system.friction is None:
            return Loaded(OfRate(system, q, rows[J], sign), None, rows[J], J0)
        slips = rows[SLIPS : SLIPS + len(system.friction.names), self.n // 2]
        sides = tuple(int(x) for x in sign * np.sign(slips))
        return Loaded(OfFriction(system.friction, q, rows, sign, sides), None, rows[J], J0)

    def _made(self, at: At, span: Span, end: float, w: Floats, K: Floats, loaded: Loaded) -> Panel:
        """The panel of a solution."""
        lost = None
        if isinstance(loaded.work, OfFriction):
            loaded.work(K[:-1])  # Newton's last step came after it was asked
            lost = loaded.work.lost
        last = float(K[-1])
        return Panel(at.t, at.q, end, at.K, last, span.p, span.backward, w, K[:-1], loaded.J, lost)

    def _resolved(self, panel: Panel, loaded: Loaded) -> bool:
        """Whether time and work of a panel are smooth enough for its nodes."""
        if not ((panel.K > 0).all() and tail(panel.rate) <= self.tolerance):
            return False
        if loaded.work is not None and not tail(panel.work) <= self.tolerance:
            return False
        return panel.begins_known(loaded.J0, self.tolerance)

    def _locked(self, at: At) -> Obstacle | None:
        """Self-locking where the motion is: no acceleration satisfies Coulomb's law there."""
        friction = self.system.friction
        if friction is None:
            return None
        J0 = float(self.system.sample(np.array([at.q])).J[0])
        rate, sides = at.sign * math.sqrt(2 * at.K / J0), friction.sides(at.q, at.sign)
        found = friction.at(at.q, rate, 0.0, sides)
        if found.outcome.solved:
            return None
        note = f"{SELF_LOCKED}: t = {at.t:.9g} s, q = {at.q:.9g}, rate = {rate:.9g}"
        return Obstacle(SELF_LOCKED, note, found.limit)

    def _too_short(self, at: At, end: float) -> Obstacle:
        """No panel is short enough: friction has no solution, or the loads are not smooth."""
        rough = Obstacle(TOO_MANY, f"the loads are not smooth at q = {at.q:.12g}")
        return self._locked(at._replace(q=end)) or rough

    def _standstill(self, span: Span, w: Floats, K: Floats) -> float | None:
        """The first place of a panel at which K is zero, roughly; None where there is none.

        Where K only comes near zero between the nodes, the time is not resolved and the panel
        is made shorter.
        """
        if K.min() > 0:
            if span.limit or K[-1] > -w[-1] * math.sqrt(EPS) * span.length:
                return None  # but a standstill that is at the end but for rounding is in it
            return float(span.anchor + span.sign * (span.length - K[-1] / w[-1]))
        if span.limit:
            return span.anchor - span.sign * 0.5 * span.length  # closer first
        i = int(np.argmax(K <= 0))
        v = np.append(rule(self.n).v, 1.0)
        if span.energy == 0:  # from rest the mean effort K / u is nearly a line
            a, b = (i - 1, i) if i else (0, 1)
            mean = K / v**2
            v2 = v[a] ** 2 - mean[a] * (v[b] ** 2 - v[a] ** 2) / (mean[b] - mean[a])
            return float(span.places(np.sqrt(np.clip(v2, v[0] ** 4, v[b] ** 2))))
        before, at_before = (float(K[i - 1]), v[i - 1]) if i else (span.energy, 0.0)
        share = before / (before - float(K[i]))
        return float(span.places(at_before + share * (v[i] - at_before)))

    def _to_standstill(self, at: At, piece: Piece, guess: float) -> Panel | Obstacle | None:
        """The panel that ends at a standstill; None where it is not resolved.

        Its end is moved until the energy at its other end is that of the motion.
        """
        last, guessed = math.inf, None
        before: tuple[float, float] | None = None  # an end, and what energy that leaves over
        for _ in range(STEPS):
            length = at.sign * (guess - at.q)
            if length <= CLOSE * max(abs(at.q), 1.0) and 1e3 * EPS * self.largest >= at.K:
                return Obstacle(STANDSTILL)
            if length <= 0 or at.sign * (guess - piece.end(at.sign)) > math.sqrt(EPS) * length:
                return None
            span = Span(guess, length, at.sign, 0.0, 2, True)
            loaded = self._loaded(piece, span)
            w, K = settled(loaded.work, guessed if loaded.w is None else loaded.w, span, self.n)
            r = rule(self.n)
            at_rest = float(r.to_series[::2].sum(axis=0) @ w - r.to_series[1::2].sum(axis=0) @ w)
            if not at_rest < 0:
                return None
            left = at.K - float(K[-1])
            slope = -at_rest * at.sign  # of K by the end; with loads of the rate a secant's
            if before is not None and guess != before[0] and left != before[1]:
                slope = (before[1] - left) / (guess - before[0])
            step = left / slope
            if abs(step) <= EPS * abs(guess) or abs(step) >= last:
                break
            before = guess, left
            last, guess, guessed = abs(step), guess + step, w
        else:
            return None
        panel = replace(self._made(at, span, guess, w, K, loaded), K1=0.0)
        if not self._resolved(panel, loaded):
            return None
        return self._until_kink(at, piece, panel, loaded.work)

    # -- kinks of the loads on pairs -------------------------------------------

    def _until_kink(
        self, at: At, piece: Piece, panel: Panel, work: Work | None
    ) -> Panel | Obstacle:
        """The panel, or the part of it up to where the size of a load has a kink."""
        if not isinstance(work, OfFriction):
            return panel
        kink = self._first_kink(panel, work)
        if kink is None or abs(kink - at.q) <= math.sqrt(EPS) * panel.length:
            return panel
        return self.panel(at, piece, kink)

    def _first_kink(self, panel: Panel, work: OfFriction) -> float | None:
        """Where a guide is pressed by another side or edge, or a pin by its other side."""
        found: list[float] = []
        r, near = rule(self.n), math.sqrt(EPS)
        for F, guide in zip(work.loads.T, work.guides, strict=True):
            across, largest = np.zeros(self.n), float(np.abs(F).max())
            if guide:
                N, C = F.real, F.imag
                passing = (N + C, N - C) if np.abs(C).max() > 0 else (N,)
            else:  # along the way that the load takes where it is least
                i = min(max(int(np.abs(F).argmin()), 1), self.n - 2)
                turned = F * np.conj(F[i + 1] - F[i - 1])
                turned /= max(float(np.abs(turned).max()), SMALLEST)
                passing, across, largest = (turned.real,), turned.imag, 1.0
            for part in passing:
                v = roots(r.to_series @ part)
                missed = np.abs(basis(v, self.n) @ (r.to_series @ across))
                v = v[(v > near) & (v < 1 - near) & (missed <= near * largest)]
                way = (panel.q1 - panel.q0) * v**panel.p
                found += (panel.q1 - way if panel.backward else panel.q0 + way).tolist()
        sign = math.copysign(1.0, panel.q1 - panel.q0)
        return min(found, key=lambda x: sign * x) if found else None
