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
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.contacts import DEPENDENT, SETTLED, STILL, Held
from blockmech.dynamics.friction import (
    FrictionState,
    PairFriction,
    Sides,
    State,
    least,
)
from blockmech.dynamics.patterns import affine_patterns, rays, signs
from blockmech.engines.numpy import Planar
from blockmech.friction.continuation import Outcome
from blockmech.ground.plane import EPS
from blockmech.result.motion import Floats
from blockmech.result.quality import left_undone

States: TypeAlias = tuple[Floats, Floats, Floats, Any]  # (n, k), (n, k), (n,), (n, states)
Against: TypeAlias = Callable[[Floats, Floats, Floats, Any], Held]

LOCATED = 1e-6  # [-] the same where an event was located on a dense output
APART = 1e-5  # [-] accelerations that differ by more are two
BEYOND = 1e-4  # [rad or m] how far beyond a place the sense of a pair shows
WITHIN = 4 * EPS  # [-] of a time, to which an event is found in it
BALANCED = 200  # iterations of the shares of pairs that stick, of which any contraction needs fewer


class Contact(NamedTuple):
    """What stops that something lies against leave free: q'' = basis z'' + shift; see `Held`.

    Their pushes are an affine function of z'' and of the friction of the pairs. Drivers that are
    not free stand among them.
    """

    basis: Floats  # (..., k, z)
    shift: Floats  # (..., k)
    push: Floats  # (..., a)
    of_z: Floats  # (..., a, z)
    of_t: Floats  # (..., a, m)
    carried: Any = 0.0  # (..., k) rates that drivers have which are not free


class Instant(NamedTuple):
    """What loads, accelerations and friction do at a state, or at n of them (leading axis).

    From M on it is about the z freedoms that stops leave, of the k: all, where nothing lies
    against one (``contact`` None).
    """

    q: Floats  # (..., k)
    rate: Floats  # (..., k)
    M: Floats  # (..., z, z)
    push: Floats  # (..., z) efforts of the loads, less what the rates take
    S: Floats  # (..., m, z) relative rate of a pair per rate of a freedom
    b: Floats  # (..., m) relative acceleration without any of the freedoms'
    w: Floats  # (..., m) relative rate
    f: Any  # (..., m) loads on the pairs without accelerations of freedoms and without friction
    G: Any  # (..., m, z)
    R: Any  # (..., m, m)
    law: Floats  # (..., 2 m) factors and drags at these rates
    margin: Any
    contact: Contact | None = None
    carried: Any = 0.0  # (..., m) relative rates by drivers that are not free

    def against(self, held: Held, loads: Any, lasting: bool = True) -> Instant:
        """The same while it lies against stops, of which a unit push adds ``loads`` (..., m, a).

        ``lasting`` : pairs that stops alone leave no freedom do not move; in a blow they may
        """
        Z, shift, back = held.free()
        at_shift = self.push - (self.M @ shift[..., None])[..., 0]
        push = -(back @ at_shift[..., None])[..., 0]
        of_z, of_t = back @ self.M @ Z, -back @ np.swapaxes(self.S, -1, -2)
        G, turned = self.G + loads @ back @ self.M, np.swapaxes(Z, -1, -2)
        shifted = (self.G @ shift[..., None] + loads @ push[..., None])[..., 0]
        S, b = self.S @ Z, self.b + (self.S @ shift[..., None])[..., 0]
        tied = np.abs(S).max(axis=-1, initial=0.0) <= DEPENDENT * np.abs(self.S).max(axis=-1)
        still = tied & lasting
        rates: Any = 0.0
        carried: Any = 0.0
        if held.speeds is not None:
            rates = (np.swapaxes(back, -1, -2) @ held.speeds[..., None])[..., 0]
            carried = (self.S @ rates[..., None])[..., 0]
            size = np.abs(self.b) + (np.abs(self.S) @ np.abs(shift)[..., None])[..., 0]
            still &= np.abs(b) <= DEPENDENT * size  # a law moves those that it alone moves
        return self._replace(
            M=turned @ self.M @ Z,
            push=(turned @ at_shift[..., None])[..., 0],
            S=np.where(tied[..., None], 0.0, S),
            b=np.where(still, 0.0, b),
            f=self.f + shifted,
            G=G @ Z,
            R=self.R + loads @ of_t,
            contact=Contact(Z, shift, push, of_z, of_t, rates),
            carried=carried,
        )

    def part(self, which: Any) -> Instant:
        """That at one of n states, or those at some, where it lies against nothing."""
        return Instant._make([*(x[which] for x in self[:-3]), self.margin, None, 0.0])

    @property
    def freedoms(self) -> Floats:
        """Rates (..., z) of what is free."""
        if self.contact is None:
            return self.rate
        return (np.swapaxes(self.contact.basis, -1, -2) @ self.rate[..., None])[..., 0]

    @property
    def unheld(self) -> Floats:
        """Accelerations (z,) by the loads alone."""
        return np.asarray(np.linalg.inv(self.M) @ self.push)

    def of_drivers(self, x: Floats, shifted: bool = True) -> Floats:
        """Accelerations (..., k) of the drivers by those of what is free, or rates."""
        if self.contact is None:
            return x
        of_q = (self.contact.basis @ x[..., None])[..., 0]
        return of_q + (self.contact.shift if shifted else self.contact.carried)

    def pushes(self, response: Response) -> Floats:
        """What stops that it lies against give [N m or N] (..., a)."""
        if self.contact is None:
            return np.zeros((*self.push.shape[:-1], 0))
        push, of_z, of_t = self.contact[2:5]
        more = of_z @ response.qdd[..., None] + of_t @ response.t[..., None]
        return np.asarray(push + more[..., 0])

    def norms(self, loads: Any, guides: Sequence[bool]) -> Floats:
        """Loads (..., m) as friction is of them [N]."""
        larger = np.maximum(np.abs(loads.real), np.abs(loads.imag))
        return np.asarray(np.where(guides, larger, np.abs(loads)))


class Response(NamedTuple):
    """Accelerations and friction at an instant, for some sides."""

    qdd: Floats  # (..., z) of what is free
    t: Floats  # (..., m)
    loads: Any  # (..., m)
    outcome: Any = 0.0
    misfit: Any = 0.0

    @property
    def solved(self) -> bool:
        """Whether it satisfies the laws, of one instant."""
        code = float(self.outcome)
        return code == code and Outcome(int(code)).solved


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


class JointFriction(PairFriction):
    """Friction of all pairs of a mechanism."""

    _last: tuple[Any, Any] = (None, None)

    @cached_property
    def weights(self) -> Floats:
        """(m,) what a pair holds at rest under a unit load: its part where many stick."""
        m = len(self.names)
        static = np.array(self.static)
        return np.where(static[:m] > 0, static[:m], static[m:])

    # -- an instant ------------------------------------------------------------

    def _states(self, qd: Any, t: Any, x: Any, k: int, held: Held | None) -> list[State]:
        """Columns of inputs: loads and rates, a unit of each acceleration, friction and push."""
        still, pairs = State(qd=np.zeros(k), qdd=np.zeros(k)), held.pairs if held else ()
        units = [still._replace(qdd=row) for row in np.eye(k)]
        units += [still._replace(pair=j) for j in range(len(self.names))]
        units += [still._replace(push=j) for j, _ in pairs if j >= 0]
        return [State(qd=qd, qdd=np.zeros(k), share=1.0, t=t, x=x), *units]

    def instant(self, q: Floats, qd: Floats, t: Any, x: Any, held: Held | None) -> Instant:
        """One state, or n; x (..., states) are those of signals and laws, None the initial ones."""
        parts = q, qd, t, x, *(() if held is None else (held.rows, held.drift))
        key = q.ndim, *(None if part is None else np.asarray(part).tobytes() for part in parts)
        if self._last[0] != key:
            self._last = key, self._instant(q, qd, t, x, held)
        instant: Instant = self._last[1]
        return instant

    def _instant(self, q: Floats, qd: Floats, t: Any, x: Any, held: Held | None) -> Instant:
        m, k = len(self.names), qd.shape[-1]
        values = self.values(q, self._states(qd, t, x, k, held))
        drives, loads = values[..., :k].real, values[..., k : k + m]
        slips, rise = (values[..., k + i * m : k + (i + 1) * m].real for i in (1, 2))
        w, law = slips[..., 0, :], self.law(slips[..., 0, :], x)
        margin = least(values[0, k + 3 * m :].real) if q.ndim == 1 else 1.0  # of one state

        def of(x: Any, first: int, count: int) -> Any:
            return np.swapaxes(x[..., first : first + count, :], -1, -2)

        M, S, G, R = of(drives, 1, k), of(rise, 1, k), of(loads, 1, k), of(loads, 1 + k, m)
        S = np.where(np.abs(S) <= STILL * np.abs(S).max(axis=(-1, -2), keepdims=True), 0.0, S)
        push, b, f = -drives[..., 0, :], rise[..., 0, :], loads[..., 0, :]
        at = Instant(q, qd, M, push, S, b, w, f, G, R, law, margin)
        if held is None:
            return at
        return at.against(held, _pressed(held, of(loads, 1 + k + m, values.shape[-2])))

    def _tangents(self, at: Instant, law: Floats, loads: Any) -> Floats:
        """A law (..., 2 m), of those that are not linear in the load at loads (..., m)."""
        most = np.array(self.program.steepest * 2)
        if not most.size:
            return law
        return np.asarray(np.where(most > 0, self.law(at.w, None, loads), law))

    def pressed(self, q: Floats, held: Held) -> Any:
        """What a unit push of each stop adds to the loads (m, a) on the pairs."""
        k, m = len(q), len(self.names)
        still = State(qd=np.zeros(k), qdd=np.zeros(k))
        units = [still, *(still._replace(push=j) for j, _ in held.pairs if j >= 0)]
        return _pressed(held, self.values(q, units)[1:, k : k + m].T)

    def rates(self, q: Floats, qd: Floats) -> Floats:
        """Relative rates (..., m) of the pairs."""
        k, m = q.shape[-1], len(self.names)
        return self.values(q, [State(qd, 0.0 * qd)])[..., 0, k + m : k + 2 * m].real

    def slipping(self, q: Floats, qd: Floats) -> Sides:
        """Senses in which pairs slip at a state."""
        return tuple(int(s) for s in self.senses(self.rates(q, qd)))

    # -- for given sides ---------------------------------------------------------

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
            return Response(math.nan * at.push, math.nan * at.w, math.nan * at.f, math.nan)
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
            return Response(qdd, t, F)
        misfit = left_undone(solution.residual, solution.contraction)
        return Response(qdd, t, F, solution.outcome, misfit)

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

    def at(
        self, q: Floats, qd: Floats, t: float, sides: Sides, x: Any = None, held: Held | None = None
    ) -> FrictionState:
        """One state, while it lies against stops that are held."""
        at = self.instant(q, qd, t, x, held)
        response = self.respond(at, sides)
        slipping = (np.array(sides) != 0) & ~np.array(self.program.separates)
        power = -float(response.t[slipping] @ at.w[slipping])
        qdd, pushes, locked = at.of_drivers(response.qdd), at.pushes(response), not response.solved
        lost = locked and at.margin > 0
        return FrictionState(qdd, power, response.loads, lost, float(response.misfit), pushes)

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
                efforts, good = 0.0 - response.qdd[..., 0], np.isfinite(response.qdd[..., 0])
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
        return begun, at.of_drivers(response.qdd), at.pushes(response)

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
            qdd[some], friction[some] = at.of_drivers(response.qdd), response.t
            pushes[np.ix_(some, those)] = at.pushes(response)
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
        qdd, t = (np.array([getattr(x, part) for x in rows]) for part in ("qdd", "t"))
        return rows[0]._replace(qdd=qdd, t=t)

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
        wanted = at.M @ response.qdd - at.push
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
            loads = at.f + at.G @ response.qdd + at.R @ t
            if np.abs(t - last).max() <= 4 * EPS * np.abs(t).max():
                break
        return share, _largest(np.abs(t[others]), self._held(at, loads)[others]), t

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
        sure = np.array([x.response.qdd for x in fit if x.missed <= SETTLED or x is best])
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
        qdd = at.of_drivers(response.qdd) if response.solved else 0.0 * rate
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
        size = np.abs(at.S) @ (np.abs(at.unheld) + np.abs(response.qdd)) + np.abs(at.b)
        u = (at.S @ response.qdd + at.b) / np.where(size > 0, size, 1.0)
        wrong = [abs(u[j]) if sides[j] == 0 else unknown - sides[j] * u[j] for j in zero]
        return float(max(share * (1.0 - min(unknown, 1.0)) - 1.0, *wrong, 0.0))


def _pressed(held: Held, loads: Any) -> Any:
    """Loads (..., m, a) on the pairs by unit pushes: those (..., m, p) of the stops of pairs."""
    of_pairs = [j >= 0 for j, _ in held.pairs]
    pressed = np.zeros((*loads.shape[:-1], len(of_pairs)), dtype=np.complex128)
    pressed[..., of_pairs] = loads * [sense for j, sense in held.pairs if j >= 0]
    return pressed


def _largest(need: Floats, held: Floats) -> float:
    """The largest share; infinite where nothing holds what is needed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nanmax(np.where(need > 0, need / held, 0.0), initial=0.0))
