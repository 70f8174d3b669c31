"""Accelerations and friction of an instant whose pairs slip in given senses, or stick.

M q'' = push + S^T t,    S_j q'' + b_j = 0 of what sticks,    t_j = -side_j (c_j |F_j| + d_j) else
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from blockmech.dynamics.contacts import DEPENDENT, SETTLED
from blockmech.dynamics.friction import Instant, PairFriction, Response, Sides
from blockmech.dynamics.patterns import rays, signs
from blockmech.engines.numpy import Planar
from blockmech.ground.plane import EPS
from blockmech.result.motion import Floats
from blockmech.result.quality import left_undone

BALANCED = 200  # iterations of the shares of pairs that stick, of which any contraction needs fewer


class PairResponses(PairFriction):
    """What instants respond with for given senses of slip."""

    @cached_property
    def weights(self) -> Floats:
        """(m,) what a pair holds at rest under a unit load: its part where many stick."""
        m = len(self.names)
        static = np.array(self.static)
        return np.where(static[:m] > 0, static[:m], static[m:])

    def _tangents(self, at: Instant, law: Floats, loads: Any) -> Floats:
        """A law (..., 2 m), of those that are not linear in the load at loads (..., m)."""
        most = np.array(self.program.steepest * 2)
        if not most.size:
            return law
        return np.asarray(np.where(most > 0, self.law(at.w, None, loads), law))

    def _linear(self, at: Instant, sides: Sides, share: Floats) -> tuple[Floats, Floats]:
        """q'' (..., k, 1 + a) and t (..., m, 1 + a): of loads, and of a unit in each that slips.

        ``share`` (m,) is friction of pairs that stick, beside that of the least squares.
        """
        stuck, slips = ([j for j, s in enumerate(sides) if (s == 0) is x] for x in (True, False))
        S, inverse = at.S, np.linalg.inv(at.M)
        turned = np.swapaxes(S[..., slips, :], -1, -2)
        qdd = inverse @ np.concatenate([(at.push + share @ S)[..., None], turned], axis=-1)
        t = np.zeros((*at.rate.shape[:-1], len(sides), 1 + len(slips)))
        if stuck:
            weights = self.weights[stuck][:, None]
            held = weights * S[..., stuck, :]
            back = inverse @ np.swapaxes(held, -1, -2)
            drift = held @ qdd
            drift[..., 0] += weights[:, 0] * at.b[..., stuck]
            force = -np.linalg.pinv(held @ back, rcond=DEPENDENT, hermitian=True) @ drift
            qdd = qdd + back @ force
            t[..., stuck, :] = weights * force
        t[..., 0] += share
        t[..., slips, range(1, 1 + len(slips))] = 1.0
        return qdd, t

    def respond(self, at: Instant, sides: Sides, law: Any = None) -> Response:
        """Accelerations and friction for some sides; ``law`` (..., 2 m) in place of that there.

        NaN where no numbers come of it.
        """
        law = at.law if law is None else law
        try:
            response = self._balance(at, sides, law, np.zeros(len(sides)))
            if at.q.ndim > 1 or not self._surplus(at, sides):
                return response
            for _ in range(BALANCED):  # friction of what slips may follow what sticks
                last, share = response.t, self._shared(at, sides, response)[1]
                response = self._balance(at, sides, law, np.where(np.array(sides) == 0, share, 0.0))
                off = np.abs(response.t - last).max()
                if not any(sides) or off <= SETTLED * np.abs(response.t).max():
                    break
        except (ArithmeticError, ValueError, np.linalg.LinAlgError):
            qdd, t, loads = (math.nan * x for x in (at.push, at.w, at.f))
            return Response(at, qdd, t, loads, math.nan)
        return response

    def _balance(self, at: Instant, sides: Sides, law: Any, share: Floats) -> Response:
        """The same; ``share`` as of `_linear`."""
        m, slips = len(sides), [j for j, s in enumerate(sides) if s]
        qdd, t = self._linear(at, sides, share)
        F = at.G @ qdd + at.R @ t
        F[..., 0] += at.f
        along = np.array([sides[j] for j in slips])

        def laws(loads: Any = None) -> tuple[Any, Any]:
            """Signed factors and drags of what slips, (..., a); ``loads`` are those on it."""
            tangents = law
            if loads is not None:
                whole = np.zeros(at.w.shape)
                whole[..., slips] = loads
                tangents = self._tangents(at, law, whole)
            drag = -along * tangents[..., [m + j for j in slips]] if self.program.drags else ()
            return -along * tangents[..., slips], drag

        one = np.ones((*at.rate.shape[:-1], 1))
        solution: Any = None
        if slips:
            most = [self.program.steepest[j] for j in slips] if self.program.steepest else ()
            guides = [self.guides[j] for j in slips]
            solution = self._solved(laws, most, guides, F[..., slips, :])
            one = np.concatenate([one, np.stack(solution.t, axis=-1)], axis=-1)
        qdd, t, F = ((x @ one[..., None])[..., 0] for x in (qdd, t, F))
        if len(slips) < m:  # what stands has no acceleration
            stands = self.fixed(at, sides) & ~at.b.any(axis=-1)
            qdd = np.where(stands[..., None], 0.0, qdd)
        if solution is None:
            return Response(at, qdd, t, F)
        misfit = left_undone(solution.residual, solution.contraction)
        return Response(at, qdd, t, F, solution.outcome, misfit)

    def _solved(self, laws: Any, steepest: Any, guides: Sequence[bool], F: Any) -> Any:
        """Friction of the pairs that slip, from loads (..., a, 1 + a) as of `_linear`."""
        single = F.ndim == 2

        def vector(z: Any) -> Any:
            return complex(z) if single else Planar(z.real.copy(), z.imag.copy())

        def columns(x: Any) -> tuple[Any, ...]:
            return tuple(np.moveaxis(x, -1, 0).tolist() if single else np.moveaxis(x, -1, 0).copy())

        many = range(F.shape[-2])
        base = tuple(vector(F[..., j, 0]) for j in many)
        rows = tuple(tuple(vector(F[..., j, 1 + i]) for i in many) for j in many)

        def terms(loads: Any = None) -> tuple[Any, Any]:
            k, drag = laws(None if loads is None else np.stack(loads, axis=-1))
            return columns(k), columns(drag) if len(drag) else ()

        with np.errstate(all="ignore"):
            balance = self.balance if single else self.balance_all
            return balance(terms, steepest, tuple(guides), base, rows)

    def kept(self, at: Instant, sides: Sides) -> Floats:
        """Rates (..., k) of drivers with which what sticks does not move, the nearest by M."""
        return at.of_drivers(self._kept(at, sides), shifted=False)

    def _kept(self, at: Instant, sides: Sides) -> Floats:
        """Those (..., z) of what is free."""
        stuck = [j for j, s in enumerate(sides) if s == 0]
        if not stuck:
            return at.freedoms
        held = self.weights[stuck][:, None] * at.S[..., stuck, :]
        back = np.linalg.inv(at.M) @ np.swapaxes(held, -1, -2)
        off = held @ at.freedoms[..., None]
        if at.contact is not None:
            off = off + (self.weights * (at.carried + np.zeros(at.b.shape)))[..., stuck, None]
        step = back @ (np.linalg.pinv(held @ back, rcond=DEPENDENT, hermitian=True) @ off)
        rate = at.freedoms - step[..., 0]
        # where nothing is left but rounding, nothing is left
        left = np.abs(rate).max(axis=-1, keepdims=True, initial=0.0)
        return np.where(left <= DEPENDENT * np.abs(at.rate).max(axis=-1, keepdims=True), 0.0, rate)

    def fixed(self, at: Instant, sides: Sides) -> Any:
        """Whether what sticks leaves no freedom (...)."""
        stuck = at.S[..., [j for j, s in enumerate(sides) if s == 0], :]
        free = at.S.shape[-1]
        rank = np.linalg.matrix_rank(stuck) if stuck.shape[-2] and free else 0
        return rank == np.full(at.S.shape[:-2], free)

    def share(self, at: Instant, sides: Sides, response: Response) -> float:
        """How much of what they can hold [-] the pairs that stick need at most."""
        stuck = self.stuck(at, sides)
        if any(sides) and self._surplus(at, sides):  # else they have their shares
            return self._shared(at, sides, response)[0]
        return _largest(np.abs(response.t[stuck]), self._held(at, response.loads)[stuck])

    def stuck(self, at: Instant, sides: Sides) -> list[int]:
        """Pairs that stick, where something free moves them."""
        return [j for j, s in enumerate(sides) if s == 0 and at.S[j].any()]

    def _surplus(self, at: Instant, sides: Sides) -> bool:
        """Whether more pairs stick than balance needs."""
        S = at.S[self.stuck(at, sides)]
        return len(S) > 0 and np.linalg.matrix_rank(S, tol=DEPENDENT * np.abs(S).max()) < len(S)

    def _shared(self, at: Instant, sides: Sides, response: Response) -> tuple[float, Floats]:
        """The least that the largest share of pairs that stick can be, and friction (m,) so."""
        stuck = self.stuck(at, sides)
        directions = rays(at.S[stuck])
        tried = [self._share_along(at, sides, response, stuck, v) for v in directions]
        right = [x for x in tried if x[1] <= x[0] * (1 + SETTLED)]
        best = min(right, key=lambda x: x[0]) if right else max(tried, key=lambda x: x[0])
        return best[0], best[2]

    def _held(self, at: Instant, loads: Any) -> Floats:
        """What the pairs hold (m,) at rest under loads."""
        m, static = len(self.names), np.array(self.static)
        return np.asarray(static[:m] * at.norms(loads, self.guides) + static[m:])

    def _share_along(
        self, at: Instant, sides: Sides, response: Response, stuck: list[int], v: Floats
    ) -> tuple[float, float, Floats]:
        """That share where all pairs that a ray moves need the same; what others need; friction.

        The least that the largest share can be is that of the ray of which others need no more:
        there as many pairs are at one share as balance leaves open (linear programming; the loads
        that the shares are of follow from the friction, so both are iterated).
        """
        S, t, m = at.S, response.t.copy(), len(sides)
        way = np.array(signs(S[stuck], v))
        moved, others = np.array(stuck)[way != 0], np.array(stuck)[way == 0]
        way, work = way[way != 0], np.abs(S[moved] @ v)
        slips = [j for j, s in enumerate(sides) if s]
        side = np.array([sides[j] for j in slips])
        wanted = at.M @ response.free - at.push
        weights = self.weights[others][:, None]
        back = np.linalg.pinv((weights * S[others]).T, rcond=DEPENDENT)
        share, loads = 0.0, response.loads
        for _ in range(BALANCED):
            last, held = t.copy(), self._held(at, loads)
            if slips:
                g = at.norms(loads, self.guides)
                law = self._tangents(at, at.law, g)
                t[slips] = -side * (law[slips] * g[slips] + law[[m + j for j in slips]])
            need = wanted - t[slips] @ S[slips]
            share = float(need @ v) / max(float(work @ held[moved]), np.finfo(float).tiny)
            if not share > 0:
                return 0.0, math.inf, response.t
            t[moved] = share * way * held[moved]
            t[others] = weights[:, 0] * (back @ (need - t[moved] @ S[moved]))
            loads = at.f + at.G @ response.free + at.R @ t
            if np.abs(t - last).max() <= 4 * EPS * np.abs(t).max():
                break
        return share, _largest(np.abs(t[others]), self._held(at, loads)[others]), t


def _largest(need: Floats, held: Floats) -> float:
    """The largest share; infinite where nothing holds what is needed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nanmax(np.where(need > 0, need / held, 0.0), initial=0.0))
