r"""Joint friction in motion: some pairs stick while others slip.

At a state, with q the drivers' coordinates and S_j q'' + b_j the relative acceleration of pair j,

    M q'' = push + S^T t,        F_j = f_j + G_j q'' + sum_i R_ji t_i

    slips one way (side_j = +-1)     t_j = -side_j (c_j |F_j| + d_j)
    sticks (side_j = 0)              S_j q'' + b_j = 0,     |t_j| <= c_j |F_j| + d_j  at rest

A pair whose relative rate is not zero slips in its sense. Of those whose rate is zero, any may
stick or start in either sense: **every pattern of sides that relative accelerations can have is
tried** (`patterns`), and one is right where what sticks is held by no more than its law allows,
and what slips starts in its own sense. A law that holds more at rest than in motion must be
overcome first, so pairs that start are asked for what they say at rest. No right pattern: no
acceleration satisfies the laws; two of them with different accelerations: the start is ambiguous.

Where more pairs stick than balance needs (all pairs of a closed loop), mechanics leaves open what
each takes. They hold where in some distribution none needs more than its law allows; of all that
balance the one whose largest share is least is taken.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics import ends
from blockmech.dynamics.contacts import DEPENDENT, SETTLED, STILL, Constraints
from blockmech.dynamics.friction import InnerStates, Instant, PairFriction, Response, Sides
from blockmech.dynamics.patterns import affine_patterns, rays, signs
from blockmech.engines.numpy import Planar
from blockmech.friction.solvers import Solution
from blockmech.ground.plane import EPS
from blockmech.result.quality import left_undone
from blockmech.typing import Complex, Edges, Floats, Reals, Vectors

LOCATED = 1000 * SETTLED  # the same where an event was located on a dense output
APART = 10 * LOCATED  # [-] accelerations that differ by more are two
BEYOND = EPS**0.25  # [rad or m] how far beyond a place the sense of a pair shows
BALANCED = 200  # iterations of what pairs do at most: any contraction needs fewer, and any impact


class Settled(NamedTuple):
    """What the pairs do from an instant on.

    response : a `Response`; None where the sides follow without it
    share : [-] of what their laws allow, that pairs which stick need at most
    missed : [-] by how much it misses the laws
    end : why there is no going on; empty where there is
    """

    sides: Sides
    response: Response | None = None
    share: float = 0.0
    missed: float = 0.0
    end: str = ""


class Holding(NamedTuple):
    """Efforts (n,) [N m or N] of the only driver between which friction holds it.

    rounding : what is unknown of them
    """

    low: Floats
    high: Floats
    rounding: Floats


class JointFriction(PairFriction):
    """Friction of all pairs of a mechanism."""

    # -- for given sides ---------------------------------------------------------

    @cached_property
    def weights(self) -> Floats:
        """(m,) what a pair holds at rest under a unit load: its part where many stick."""
        m = len(self.names)
        static = np.array(self.static)
        return np.where(static[:m] > 0, static[:m], static[m:])

    def _tangents(self, at: Instant, law: Floats, loads: Floats) -> Floats:
        """A law (..., 2 m), of those that are not linear in the load at loads (..., m)."""
        steepest = np.array(self.program.steepest * 2)
        if not steepest.size:
            return law
        return np.asarray(np.where(steepest > 0, self.law(at.w, None, loads), law))

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
            weighted_rows = weights * S[..., stuck, :]
            back = inverse @ np.swapaxes(weighted_rows, -1, -2)
            drift = weighted_rows @ qdd
            drift[..., 0] += weights[:, 0] * at.b[..., stuck]
            force = -np.linalg.pinv(weighted_rows @ back, rcond=DEPENDENT, hermitian=True) @ drift
            qdd = qdd + back @ force
            t[..., stuck, :] = weights * force
        t[..., 0] += share
        t[..., slips, range(1, 1 + len(slips))] = 1.0
        return qdd, t

    def respond(self, at: Instant, sides: Sides, law: Floats | None = None) -> Response:
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
            return Response(at, math.nan * at.push, math.nan * at.w, math.nan * at.f, math.nan)
        return response

    def _balance(self, at: Instant, sides: Sides, law: Floats, share: Floats) -> Response:
        """The same; ``share`` as of `_linear`."""
        m, slips = len(sides), [j for j, s in enumerate(sides) if s]
        qdd, t = self._linear(at, sides, share)
        F = at.G @ qdd + at.R @ t
        F[..., 0] += at.f
        senses = np.array([sides[j] for j in slips])

        def laws(loads: Floats | None = None) -> tuple[Floats, Floats | None]:
            """Signed factors and drags of what slips, (..., a); ``loads`` are those on it."""
            tangents = law
            if loads is not None:
                all_loads = np.zeros(at.w.shape)
                all_loads[..., slips] = loads
                tangents = self._tangents(at, law, all_loads)
            drag = -senses * tangents[..., [m + j for j in slips]] if self.program.drags else None
            return -senses * tangents[..., slips], drag

        multipliers = np.ones((*at.rate.shape[:-1], 1))
        solution: Solution | None = None
        if slips:
            steepest = [self.program.steepest[j] for j in slips] if self.program.steepest else ()
            guides = [self.guides[j] for j in slips]
            solution = self._solved(laws, steepest, guides, F[..., slips, :])
            multipliers = np.concatenate([multipliers, np.stack(solution.t, axis=-1)], axis=-1)
        qdd, t = ((x @ multipliers[..., None])[..., 0] for x in (qdd, t))
        F = (F @ multipliers[..., None])[..., 0]
        if len(slips) < m:  # what stands has no acceleration
            at_rest = self.fixed(at, sides) & ~at.b.any(axis=-1)
            qdd = np.where(at_rest[..., None], 0.0, qdd)
        if solution is None:
            return Response(at, qdd, t, F)
        misfit = left_undone(solution.residual, solution.contraction)
        return Response(at, qdd, t, F, solution.outcome, misfit)

    def _solved(
        self,
        laws: Callable[..., tuple[Floats, Floats | None]],
        steepest: Reals,
        guides: Edges,
        F: Vectors,
    ) -> Solution:
        """Friction of the pairs that slip, from loads (..., a, 1 + a) as of `_linear`."""
        single = F.ndim == 2

        def vector(z: Vectors) -> Complex:
            return complex(z) if single else Planar(z.real.copy(), z.imag.copy())

        def columns(x: Floats) -> Reals:
            return tuple(np.moveaxis(x, -1, 0).tolist() if single else np.moveaxis(x, -1, 0).copy())

        many = range(F.shape[-2])
        base = tuple(vector(F[..., j, 0]) for j in many)
        rows = tuple(tuple(vector(F[..., j, 1 + i]) for i in many) for j in many)

        def terms(loads: Reals | None = None) -> tuple[Reals, Reals]:
            k, drag = laws(None if loads is None else np.stack(loads, axis=-1))
            return columns(k), () if drag is None else columns(drag)

        with np.errstate(all="ignore"):
            balance = self.balance if single else self.balance_all
            return balance(terms, steepest, tuple(guides), base, rows)

    def sticking_rates(self, at: Instant, sides: Sides) -> Floats:
        """Rates (..., k) of drivers with which what sticks does not move, the nearest by M."""
        return at.of_drivers(self._free_rates(at, sides), shifted=False)

    def _free_rates(self, at: Instant, sides: Sides) -> Floats:
        """Those (..., z) of what is free."""
        stuck = [j for j, s in enumerate(sides) if s == 0]
        if not stuck:
            return at.freedoms
        weighted_rows = self.weights[stuck][:, None] * at.S[..., stuck, :]
        back = np.linalg.inv(at.M) @ np.swapaxes(weighted_rows, -1, -2)
        off = weighted_rows @ at.freedoms[..., None]
        if at.contact is not None:
            off = off + (self.weights * (at.carried + np.zeros(at.b.shape)))[..., stuck, None]
        step = back @ (np.linalg.pinv(weighted_rows @ back, rcond=DEPENDENT, hermitian=True) @ off)
        rate = at.freedoms - step[..., 0]
        # where nothing is left but rounding, nothing is left
        largest_rate = np.abs(rate).max(axis=-1, keepdims=True, initial=0.0)
        rounding = DEPENDENT * np.abs(at.rate).max(axis=-1, keepdims=True)
        return np.where(largest_rate <= rounding, 0.0, rate)

    def fixed(self, at: Instant, sides: Sides) -> NDArray[np.bool_]:
        """Whether what sticks leaves no freedom (...)."""
        stuck = at.S[..., [j for j, s in enumerate(sides) if s == 0], :]
        free = at.S.shape[-1]
        rank = np.linalg.matrix_rank(stuck) if stuck.shape[-2] and free else 0
        return np.asarray(rank == np.full(at.S.shape[:-2], free))

    def share(self, at: Instant, sides: Sides, response: Response) -> float:
        """How much of what they can hold [-] the pairs that stick need at most."""
        stuck = self.stuck(at, sides)
        if any(sides) and self._surplus(at, sides):  # else they have their shares
            return self._shared(at, sides, response)[0]
        return _largest(np.abs(response.t[stuck]), self._breakaway(at, response.loads)[stuck])

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

    def _breakaway(self, at: Instant, loads: Vectors) -> Floats:
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
        senses = np.array(signs(S[stuck], v))
        moved, unmoved = np.array(stuck)[senses != 0], np.array(stuck)[senses == 0]
        senses, work = senses[senses != 0], np.abs(S[moved] @ v)
        slips = [j for j, s in enumerate(sides) if s]
        side = np.array([sides[j] for j in slips])
        required = at.M @ response.free - at.push
        weights = self.weights[unmoved][:, None]
        back = np.linalg.pinv((weights * S[unmoved]).T, rcond=DEPENDENT)
        share, loads = 0.0, response.loads
        for _ in range(BALANCED):
            last, capacity = t.copy(), self._breakaway(at, loads)
            if slips:
                g = at.norms(loads, self.guides)
                law = self._tangents(at, at.law, g)
                t[slips] = -side * (law[slips] * g[slips] + law[[m + j for j in slips]])
            need = required - t[slips] @ S[slips]
            share = float(need @ v) / max(float(work @ capacity[moved]), np.finfo(float).tiny)
            if not share > 0:
                return 0.0, math.inf, response.t
            t[moved] = share * senses * capacity[moved]
            t[unmoved] = weights[:, 0] * (back @ (need - t[moved] @ S[moved]))
            loads = at.f + at.G @ response.free + at.R @ t
            if np.abs(t - last).max() <= 4 * EPS * np.abs(t).max():
                break
        return share, _largest(np.abs(t[unmoved]), self._breakaway(at, loads)[unmoved]), t

    # -- at a state --------------------------------------------------------------

    def power(self, response: Response, sides: Sides) -> float:
        """[W] that friction takes at an instant, less what laws with a state store."""
        slipping = (np.array(sides) != 0) & ~np.array(self.program.separates)
        return -float(response.t[slipping] @ response.at.w[slipping])

    def holding(self, q: Floats, t: float = 0.0, x: InnerStates = None) -> Holding:
        """What holds the only driver at places (n,), infinite where nothing starts it.

        Efforts at which it just starts, back and forth, while no load follows its acceleration. A
        pair whose slip is zero at a place does not help there; bristles help by the most that they
        carry, or, with states ``x`` (states,), by what they do.
        """
        q, still = q[:, None], np.zeros((q.size, 1))
        which = slice(None) if len(q) > 1 else 0  # one by one it is quicker
        at = self.instant(q[which], still[which], t, x, None)
        law = np.broadcast_to(self.static, at.law.shape)
        if x is not None:
            law = np.where(np.tile(self.signed, 2), at.law, law)
        at = at._replace(M=np.ones(at.M.shape), G=0 * at.G, law=law)
        starts, friction_sizes = np.full((2, len(q)), [[-math.inf], [math.inf]]), np.zeros(len(q))
        for sense, start in zip((-1, 1), starts, strict=True):
            senses = self.senses(sense * np.nan_to_num(at.S[..., 0])).reshape(len(q), -1)
            for sides in {tuple(row) for row in senses.astype(int).tolist()}:
                some = np.flatnonzero((senses == sides).all(axis=1))
                part = at if len(q) == 1 else at.part(some)
                response = self._balance(part, sides, part.law, 0.0 * self.weights)
                efforts, good = 0.0 - response.free[..., 0], np.isfinite(response.free[..., 0])
                start[some] = np.where(good, efforts, start[some])
                rubs = np.abs(response.t * part.S[..., 0]).sum(axis=-1)
                friction_sizes[some] += np.where(good, rubs, 0.0)
        low, high = starts
        return Holding(low, high, self._rounding(q)[:, 0] + 8 * EPS * friction_sizes)

    def from_state(
        self, q: Floats, qd: Floats, t: float, constraint: Constraints | None, x: InnerStates = None
    ) -> tuple[Settled, Floats, Floats]:
        """What a motion begins with; accelerations of the drivers (k,), and pushes of stops."""
        at = self.instant(q, qd, t, x, constraint)
        start = self.settled(at, self.sticking_pairs(at, ()))
        response = start.response or self.respond(at, start.sides)
        return start, response.qdd, response.pushes

    def responses(self, at: Instant, sides: Sides) -> Response:
        """What n states respond with."""
        states = [at.part(i) for i in range(len(at.q))]
        if not states or not self._surplus(states[0], sides):
            return self.respond(at, sides)
        responses: dict[bytes, Response] = {}  # where all stands, one state is as the other
        rows = []
        for state in states:
            key = state.f.tobytes() + state.push.tobytes()
            if key not in responses:
                responses[key] = self.respond(state, sides)
            rows.append(responses[key])
        free, t = (np.array([getattr(x, part) for x in rows]) for part in ("free", "t"))
        return rows[0]._replace(at=at, free=free, t=t)

    # -- which sides -------------------------------------------------------------

    def turning(self, at: Instant, some: Sequence[int], t: float = 0.0) -> Instant:
        """The same, where some pairs have no relative rate, with rows of what cannot stick.

        A pair that the freedoms do not move here, as that of a rocker at its dead centre, turns
        while they go on: its row is rounding, by which no rate may be stopped. They do where their
        rates are more than what the rounding of the time ``t`` [s] of an event leaves.
        """
        S, rate = at.S.copy(), at.freedoms
        if not (np.abs(rate) > STILL * abs(t) * np.abs(at.unheld)).any():
            return at
        inverse, energy = np.linalg.inv(at.M), float(rate @ at.M @ rate)
        carried = at.carried + np.zeros(at.b.shape)
        for j in some:
            stopped = (S[j] @ rate) ** 2, float(S[j] @ inverse @ S[j]) * energy
            if stopped[0] > LOCATED**2 * stopped[1] and not carried[j]:
                S[j] = 0.0
        return at._replace(S=S)

    def sticking_pairs(self, at: Instant, some: Sequence[int]) -> list[int]:
        """Pairs without relative rate where ``some`` have none: those, and what goes with them."""
        rate = self._free_rates(at, tuple(0 if j in some else 1 for j in range(len(self.names))))
        off = np.abs(at.S @ rate + at.carried)
        size = np.abs(at.S) @ np.abs(rate) + np.abs(at.carried)
        return [
            j
            for j in range(len(off))
            if j in some or (off[j] <= DEPENDENT * size[j] and not self.signed[j])
        ]

    def sides_at(self, at: Instant, zero: Sequence[int]) -> Sides:
        """Senses of slip, 0 of some; 1 of a pair whose law says its own."""
        return tuple(0 if j in zero else int(s) for j, s in enumerate(self.senses(at.w)))

    def settled(self, at: Instant, zero: Sequence[int], released: bool = False) -> Settled:
        """What the pairs do from here on; those without relative rate are ``zero``.

        ``released`` : not what it did so far: what stuck is pushed beyond what it holds
        """
        sides = self.sides_at(at, zero)
        if not any(at.S[j].any() for j in zero):  # they turn, whatever acts
            turned = {j: int(np.sign(at.b[j])) for j in zero}
            settled = Settled(tuple(turned.get(j, side) for j, side in enumerate(sides)))
            return settled._replace(sides=self._beyond_place(at, settled))
        at, unknown = self._pushed(at)
        tried = self._tried(at, sides, zero, sides if released else None, unknown)
        fit = [x for x in tried if x.missed <= (LOCATED if released else SETTLED)]
        if not fit:
            return Settled(sides, end=ends.SELF_LOCKED)
        best = min(fit, key=lambda x: x.missed)  # of equal ones that with the fewest that slip
        responses = (x.response for x in fit if x.missed <= SETTLED or x is best)
        sure = np.array([response.free for response in responses if response is not None])
        size = max(np.abs(sure).max(initial=0.0), np.abs(at.unheld).max(initial=0.0))
        if np.ptp(sure, axis=0).max(initial=0.0) > APART * size:
            return best._replace(end=ends.AMBIGUOUS)
        return best._replace(sides=self._beyond_place(at, best))

    def _pushed(self, at: Instant) -> tuple[Instant, float]:
        """The same, at rest with the loads that are more than rounding; and their rounding [-]."""
        if at.contact is not None or at.rate.any() or not at.push.any():
            return at, 8 * EPS
        rounding = np.asarray(self._rounding(at.q))
        push = np.where(np.abs(at.push) <= rounding, 0.0, at.push)
        return at._replace(push=push), 8 * EPS + float(np.max(rounding) / np.abs(at.push).max())

    def _tried(
        self, at: Instant, sides: Sides, zero: Sequence[int], but: Sides | None, unknown: float
    ) -> list[Settled]:
        """Patterns of sides but for one, those first in which fewest slip."""
        m, S = len(sides), at.S
        law, those = at.law.copy(), [*zero, *(m + j for j in zero)]
        law[those] = np.array(self.static)[those]
        patterns = sorted(affine_patterns(S[zero], at.b[zero]), key=lambda p: sum(map(abs, p)))
        trials, alone = list[Settled](), S.shape[-1] == 1
        for pattern in reversed(patterns) if alone else patterns:
            if alone and not any(pattern) and any(x.missed <= 0 for x in trials):
                break  # one freedom: rest is between both starts
            chosen = dict(zip(zero, pattern, strict=True))
            trial = tuple(chosen.get(j, side) for j, side in enumerate(sides))
            if trial != but and (response := self.respond(at, trial, law)).solved:
                share = self.share(at, trial, response)
                missed = self._missed(at, trial, zero, response, share, unknown)
                trials.append(Settled(trial, response, share, missed))
        return trials

    def _beyond_place(self, at: Instant, settled: Settled) -> Sides:
        """The sides; of pairs that no driver moves at this place, those just beyond it."""
        of_friction = () if at.contact is None else at.contact.of_t  # nor do stops hold it
        nowhere = [
            j
            for j, side in enumerate(settled.sides)
            if side == 0 and not at.S[j].any() and not any(row[j] for row in of_friction)
        ]
        if not nowhere:
            return settled.sides
        response, rate = settled.response or self.respond(at, settled.sides), at.rate
        qdd = response.qdd if response.solved else 0.0 * rate
        fast, push = float(np.abs(rate).max()), float(np.abs(qdd).max())
        if not fast + push > 0:
            return settled.sides
        h = BEYOND / max(fast, math.sqrt(push * BEYOND / 2))  # [s] for so far
        w = self.rates(at.q + h * rate + h * h / 2 * qdd, rate + h * qdd)
        sides = enumerate(settled.sides)
        return tuple(int(np.sign(w[j])) if j in nowhere else side for j, side in sides)

    def _missed(
        self,
        at: Instant,
        sides: Sequence[int],
        zero: Sequence[int],
        response: Response,
        share: float,
        unknown: float,
    ) -> float:
        """By how much [-] a pattern of sides misses the laws.

        ``unknown`` of the loads [-] says nothing against what sticks, and nothing starts by it.
        """
        size = np.abs(at.S) @ (np.abs(at.unheld) + np.abs(response.free)) + np.abs(at.b)
        u = (at.S @ response.free + at.b) / np.where(size > 0, size, 1.0)
        wrong = [abs(u[j]) if sides[j] == 0 else unknown - sides[j] * u[j] for j in zero]
        return float(max(share * (1.0 - min(unknown, 1.0)) - 1.0, *wrong, 0.0))


def _largest(need: Floats, capacity: Floats) -> float:
    """The largest share; infinite where nothing holds what is needed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nanmax(np.where(need > 0, need / capacity, 0.0), initial=0.0))
