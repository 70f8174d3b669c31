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
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.contacts import DEPENDENT, SETTLED, Held
from blockmech.dynamics.friction import Instant, Response, Sides
from blockmech.dynamics.patterns import affine_patterns
from blockmech.dynamics.responses import PairResponses
from blockmech.ground.plane import EPS
from blockmech.result.motion import Floats

States: TypeAlias = tuple[Floats, Floats, Floats, Any]  # (n, k), (n, k), (n,), (n, states)
Against: TypeAlias = Callable[[Floats, Floats, Floats, Any], Held]

LOCATED = 1000 * SETTLED  # the same where an event was located on a dense output
APART = 10 * LOCATED  # [-] accelerations that differ by more are two
BEYOND = 1e-4  # [rad or m] how far beyond a place the sense of a pair shows
WITHIN = 4 * EPS  # [-] of a time, to which an event is found in it


class Along(NamedTuple):
    """What pairs with friction do at n states of a motion."""

    rates: Floats  # (n, k) without what rounding leaves pairs that stick
    qdd: Floats  # (n, k)
    friction: Floats  # (n, m)
    stand: Any  # (n, m) which pairs stand
    pushes: Floats  # (n, a) of the stops that it lies against


class Settled(NamedTuple):
    """What the pairs do from an instant on.

    response : a `Response`; None where the sides follow without it
    share : [-] of what their laws allow, that pairs which stick need at most
    missed : [-] by how much it misses the laws
    end : why there is no going on; empty where there is
    """

    sides: Sides
    response: Any = None
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


class JointFriction(PairResponses):
    """Friction of all pairs of a mechanism."""

    def at(
        self, q: Floats, qd: Floats, t: float, sides: Sides, x: Any = None, held: Held | None = None
    ) -> Response:
        """One state, while it lies against stops that are held."""
        return self.respond(self.instant(q, qd, t, x, held), sides)

    def power(self, response: Response, sides: Sides) -> float:
        """[W] that friction takes at an instant, less what laws with a state store."""
        slipping = (np.array(sides) != 0) & ~np.array(self.program.separates)
        return -float(response.t[slipping] @ response.at.w[slipping])

    def holding(self, q: Floats, t: float = 0.0, x: Any = None) -> Holding:
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
        starts, taken = np.full((2, len(q)), [[-math.inf], [math.inf]]), np.zeros(len(q))
        for way, start in zip((-1, 1), starts, strict=True):
            senses = self.senses(way * np.nan_to_num(at.S[..., 0])).reshape(len(q), -1)
            for sides in {tuple(row) for row in senses.astype(int).tolist()}:
                some = np.flatnonzero((senses == sides).all(axis=1))
                part = at if len(q) == 1 else at.part(some)
                response = self._balance(part, sides, part.law, 0.0 * self.weights)
                efforts, good = 0.0 - response.free[..., 0], np.isfinite(response.free[..., 0])
                start[some] = np.where(good, efforts, start[some])
                rubs = np.abs(response.t * part.S[..., 0]).sum(axis=-1)
                taken[some] += np.where(good, rubs, 0.0)
        low, high = starts
        return Holding(low, high, self._rounding(q)[:, 0] + 8 * EPS * taken)

    def from_state(
        self, q: Floats, qd: Floats, t: float, held: Held | None, x: Any = None
    ) -> tuple[Settled, Floats, Floats]:
        """What a motion begins with; accelerations of the drivers (k,), and pushes of stops."""
        at = self.instant(q, qd, t, x, held)
        begun = self.settled(at, self.without_slip(at, ()))
        response = begun.response or self.respond(at, begun.sides)
        return begun, response.qdd, response.pushes

    def along(
        self, states: States, sides: Any, lies: Any, against: Against, begins: bool = True
    ) -> Along:
        """What the pairs do at n states of a motion.

        ``sides`` (n, m), NaN where nothing is known; ``lies`` (n, a) whether it lies against
        each of some stops, ``against`` says which rows those have. Of a pair that only starts or
        turns back the friction is that of the sense in which it goes on. ``begins`` : whether
        sides are completed where no motion says them.
        """
        q, qd, t, x = states
        if begins:
            sides = self._completed(states, sides, lies, against)
        rates, qdd, friction = qd.copy(), np.full(qd.shape, np.nan), np.full(sides.shape, np.nan)
        stand, pushes = np.zeros(sides.shape, dtype=bool), np.zeros(lies.shape)
        kinds, which = np.unique(np.hstack([sides, lies]), axis=0, return_inverse=True)
        for kind, row in enumerate(kinds):
            if np.isnan(row).any():
                continue
            some = np.flatnonzero(which.ravel() == kind)
            side, those = tuple(row[: sides.shape[1]].tolist()), row[sides.shape[1] :] > 0
            for _ in range(2):  # the second time with rates that are those of what sticks
                state = q[some], rates[some], t[some]
                held = against(*state, np.flatnonzero(those)) if any(those) else None
                at = self.instant(*state, x[some], held)
                rates[some] = self.kept(at, side)
            response = self._each(at, side)
            qdd[some], friction[some] = response.qdd, response.t
            pushes[np.ix_(some, those)] = response.pushes
            size = (np.abs(at.S) @ np.abs(at.freedoms[..., None]))[..., 0]
            fast = np.abs(np.hstack([at.w, at.rate])).max(axis=-1, keepdims=True)
            stands = (np.abs(at.w) <= DEPENDENT * np.maximum(size, fast)) & ~self.signed
            stand[some] = stands | (np.array(side) == 0)
        return Along(rates, qdd, friction, stand, pushes)

    def _completed(self, states: States, sides: Any, lies: Any, against: Against) -> Any:
        """Sides (n, m) where no motion says them: those with which one begins there."""
        q, qd, t, x = states
        sides, begins = sides.copy(), dict[bytes, Any]()
        open_ = np.isnan(sides).any(axis=1) & np.isfinite(q + qd).all(axis=1)
        if not open_.any():
            return sides
        w = self.rates(q, qd)
        open_ &= np.isfinite(w).all(axis=1)  # where there is a pose
        moving = open_ & (w != 0).all(axis=1) & ~np.any(lies, axis=1)
        sides[moving] = self.senses(w[moving])
        for i in np.flatnonzero(open_ & ~moving):
            key = np.array([*q[i], *qd[i], t[i], *x[i], *lies[i]]).tobytes()
            if key not in begins:
                some = slice(i, i + 1)
                state, those = (q[some], qd[some], t[some]), np.flatnonzero(lies[i])
                held = against(*state, those).first() if any(lies[i]) else None
                begun = self.from_state(q[i], qd[i], float(t[i]), held, x[i])[0]
                begins[key] = np.nan if begun.end else begun.sides
            sides[i] = begins[key]
        return sides

    def _each(self, at: Instant, sides: Sides) -> Response:
        """What n states respond with."""
        states = [at.part(i) for i in range(len(at.q))]
        if not states or not self._surplus(states[0], sides):
            return self.respond(at, sides)
        known: dict[bytes, Response] = {}  # where all stands, one state is as the other
        rows = []
        for state in states:
            key = state.f.tobytes() + state.push.tobytes()
            if key not in known:
                known[key] = self.respond(state, sides)
            rows.append(known[key])
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
        if not (np.abs(rate) > WITHIN * abs(t) * np.abs(at.unheld)).any():
            return at
        inverse, energy = np.linalg.inv(at.M), float(rate @ at.M @ rate)
        carried = at.carried + np.zeros(at.b.shape)
        for j in some:
            stopped = (S[j] @ rate) ** 2, float(S[j] @ inverse @ S[j]) * energy
            if stopped[0] > LOCATED**2 * stopped[1] and not carried[j]:
                S[j] = 0.0
        return at._replace(S=S)

    def without_slip(self, at: Instant, some: Sequence[int]) -> list[int]:
        """Pairs without relative rate where ``some`` have none: those, and what goes with them."""
        rate = self._kept(at, tuple(0 if j in some else 1 for j in range(len(self.names))))
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
        sure = np.array([x.response.free for x in fit if x.missed <= SETTLED or x is best])
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
        held = () if at.contact is None else at.contact.of_t  # nor do stops hold it
        nowhere = [
            j
            for j, side in enumerate(settled.sides)
            if side == 0 and not at.S[j].any() and not any(row[j] for row in held)
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
        some = np.abs(w) > EPS * np.abs(w).max()
        return tuple(
            int(np.sign(w[j])) if j in nowhere and some[j] else side
            for j, side in enumerate(settled.sides)
        )

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
