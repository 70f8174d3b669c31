"""Outputs along a motion: the same pruned plan as of any other run, at states of the motion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics import ends
from blockmech.dynamics.change_points import system_of
from blockmech.dynamics.contacts import DEPENDENT, Constraints, constrained
from blockmech.dynamics.friction import Sides
from blockmech.dynamics.pair_stops import lain_against
from blockmech.dynamics.roles import FREE, PRESCRIBED
from blockmech.dynamics.sticking import JointFriction
from blockmech.dynamics.system import System
from blockmech.plan.plan import Friction
from blockmech.plan.settings import friction_asked
from blockmech.result.motion import Motion
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.typing import Array, Data, Floats, FrictionMethod, Indices, M, Record

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

STATIC = {"static": False}


class MotionInputs(Record):
    """Inputs of a program along a motion; what acts is computed when it is asked for.

    ``unknown`` (n,) : samples at which the rates of the drivers say nothing about other links
    """

    def __init__(
        self,
        mechanism: Compiled,
        friction_method: Friction,
        motion: Motion,
        t: Floats,
        unknown: Any,
    ) -> None:
        k = len(mechanism.drivers)
        self.q, self.qd = motion.at(t)
        self.qd[unknown] = np.nan
        self.mechanism, self.how, self.t = mechanism, friction_method, t
        self.pairs = lain_against(mechanism, motion.lying)
        self.lies = motion.held(t, (*mechanism.drivers, *self.pairs.names))
        self.stops = self.lies.shape[1]
        if motion.roles:  # behind the stops
            self.lies = np.hstack([self.lies, motion.role_at(t) != FREE])
        self.role_at = motion.role_at
        self.states = motion.signal_states(t)
        friction = self._friction()
        self.rubs = 0 if friction is None else len(friction.names)
        self.sides = None if friction is None else motion.sides(t)
        self.begins = motion.status != "failed"  # else nothing is known where no motion says it
        self.known = by_column("q", self.q) | by_column("x", self.states)
        if k == 1 or self.sides is None or (self.sides != 0).all():
            self.known |= by_column("qd", self.qd)  # what sticks does not move at all

    def _friction(self) -> JointFriction | None:
        """Joint friction; not kept, as programs do not pickle."""
        if self.how.method == "none":
            return None
        return system_of(self.mechanism, method=self.how).friction_of(self.how.pushed)

    def _contacts(self, q: Floats, qd: Floats, t: Floats, which: Indices) -> Constraints:
        """Rows of stops that it lies against at n states, and of drivers that are not free."""
        stops, bound = which[which < self.stops], which[which >= self.stops] - self.stops
        at = [self.pairs.constraints(*state, stops) for state in zip(q, qd, strict=True)]
        rows, drift = np.array([x.rows for x in at]), np.array([x.drift for x in at])
        constraint = Constraints(rows, drift, at[0].pairs)
        if not bound.size:
            return constraint
        pull = np.zeros((len(t), bound.size))
        for column, i in enumerate(bound):
            some = self.role_at(t)[:, i] == PRESCRIBED
            law = self.mechanism.scene.drive[self.mechanism.drivers[i]] if some.any() else None
            if law is not None:
                pull[some, column] = law.at_times(t[some])[2]
        k, speeds = len(self.mechanism.drivers), qd.reshape(len(t), -1)[:, bound]
        unit = np.broadcast_to(np.eye(k)[bound], (len(t), bound.size, k))
        return constraint.extended(Constraints(unit, -pull, ((-1, 1),) * bound.size, speeds))

    def _pair_stop_inputs(self, pushes: Floats) -> dict[str, Floats]:
        """Inputs of what stops of pairs push with, from that of all stops (n, a)."""
        senses = np.array([float(sense) for _, sense in self.pairs.pairs])
        return by_column("push", senses * pushes[:, len(self.mechanism.drivers) : self.stops])

    def __getitem__(self, name: str) -> Array:
        return self.known[name] if name in self.known else self.acting[name]

    def __iter__(self) -> Iterator[str]:
        yield from self.known
        k, pairs = len(self.mechanism.drivers), self.pairs.names
        computed = [f"{part}_{i}" for part in ("qd", "qdd") for i in range(k)]
        computed += [f"{part}_{j}" for part in ("sticks", "friction") for j in range(self.rubs)]
        computed += [f"push_{j}" for j in range(len(pairs))]
        yield from (name for name in computed if name not in self.known)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    @cached_property
    def acting(self) -> dict[str, Floats]:
        """Accelerations of the drivers, all idle, friction of pairs, and pushes of stops."""
        friction, k = self._friction(), len(self.mechanism.drivers)
        if friction is None or self.sides is None:
            return self._without_friction()
        q, qd = (x.reshape(len(self.t), k) for x in (self.q, self.qd))
        state = q, qd, self.t, self.states
        sides, lain = np.broadcast_to(self.sides, (len(q), self.rubs)), (self.lies, self._contacts)
        response = friction_along(friction, state, sides, *lain, self.begins)
        acting = by_column("qd", response.rates) | by_column("qdd", response.qdd)
        acting |= self._pair_stop_inputs(response.pushes)
        acting |= by_column("sticks", response.stand.astype(float))
        return acting | by_column("friction", response.friction)

    def _without_friction(self) -> dict[str, Floats]:
        """Accelerations from M q'' = Q - c, and what stops push with."""
        mechanism, n = self.mechanism, len(self.t)
        drivers, k = mechanism.drivers, len(mechanism.drivers)
        idle = [mechanism._of_driver(d, "drive_by_reduction") for d in drivers]  # c - Q, q'' = 0
        mass = mechanism._of_driver(drivers[0], "J_red") if k == 1 else "mechanism.M"
        samples = Samples(n, self.known | {f"qdd_{i}": np.zeros(n) for i in range(k)}, self.t)
        result = frictionless(mechanism, (*idle, mass), samples)
        right = -np.stack([result[name] for name in idle], axis=-1)
        M = result[mass].reshape(n, k, k)
        qdd, pushes = np.empty((n, k)), np.zeros(self.lies.shape)
        if k == 1 and not self.lies.any():
            return by_column("qdd", right / M[:, 0])
        for i, lies in enumerate(self.lies):
            which, sample, constraint = np.flatnonzero(lies), slice(i, i + 1), None
            if which.size:
                constraint = self._contacts(
                    self.q[sample], self.qd[sample], self.t[sample], which
                ).first()
            qdd[i], pushes[i, which] = constrained(M[i], right[i], constraint)
        return by_column("qdd", qdd) | self._pair_stop_inputs(pushes)


def by_column(name: str, values: Floats) -> dict[str, Floats]:
    """Inputs by number, of drivers or states, from values (n,) or (n, k)."""
    columns = np.atleast_2d(values.T)
    return {f"{name}_{i}": np.ascontiguousarray(column) for i, column in enumerate(columns)}


class SimulationResult(Result[M]):
    """The result of a simulation: outputs at times, and the ``motion`` that they are read from.

    >>> swing = mech.simulate("time=0.2", start={"crank": (0.0, 5.0)}, times=[0.1, 0.2])
    >>> swing["crank.rate"].round(4)
    array([2.3996, 0.328 ])
    >>> swing.motion.end
    'time'
    """

    motion: Motion


def settings_along(motion: Motion, friction: FrictionMethod | None) -> Data:
    """Settings of joint friction along a motion: its own, if nothing else is said."""
    friction = friction or ("newton" if "friction_work" in motion.facts else "none")
    return {"friction": friction}


def result_in_chart(
    mechanism: Compiled,
    motion: Motion,
    t: Floats,
    want: Iterable[str] | str,
    friction: FrictionMethod | None = None,
    engine: str = "auto",
    chunk: int | None = None,
) -> SimulationResult:
    """The wanted outputs at times (n,) [s] of a motion in one chart.

    Joint friction is that of the motion, if nothing else is said. In a dead centre itself, in
    which a motion ends, there are no rates and forces: there the rate of the driver, mostly
    zero, does not say how fast the others go.
    """
    settings = settings_along(motion, friction)
    method = friction_asked(settings["friction"])
    if method.method != "none":
        method = replace(method, along=True)
    method = replace(method, pushed=lain_against(mechanism, motion.lying).refs)
    plan = mechanism._plan_for(want, method)
    unknown = np.zeros(len(t), bool)
    if motion.end == ends.DEAD_CENTRE:
        margin = System(mechanism).terms(motion.q_end, motion.qd_end).margin
        unknown = (t == motion.t_end) & (margin <= DEPENDENT)
    inputs = MotionInputs(mechanism, method, motion, t, unknown)
    values, engine = mechanism._evaluate(plan, Samples(len(t), inputs, t), engine, chunk=chunk)
    if unknown.any():
        inputs = MotionInputs(mechanism, method, motion, t, slice(0))
        rates = [mechanism._of_driver(d, "rate") for d in mechanism.drivers]
        rate_inputs = {i: f"qd_{n}" for n, r in enumerate(rates) for i in plan.layout.get(r, ())}
        values = tuple(
            inputs[rate_inputs[i]] if i in rate_inputs else x for i, x in enumerate(values)
        )
    samples = Samples(len(t), inputs, t)
    return SimulationResult(mechanism, plan, samples, values, engine, settings | STATIC, motion)


def frictionless(mechanism: Compiled, want: Sequence[str], samples: Samples) -> Result:
    """Outputs at samples, without joint friction."""
    plan = mechanism.plan(want, friction="none")
    values, engine = mechanism._evaluate(plan, samples)
    return Result(mechanism, plan, samples, values, engine, {"friction": "none"} | STATIC)


# -- joint friction ---------------------------------------------------------------------


States: TypeAlias = tuple[Floats, Floats, Floats, Floats]  # (n, k), (n, k), (n,), (n, states)
Bools: TypeAlias = NDArray[np.bool_]
Against: TypeAlias = Callable[[Floats, Floats, Floats, Indices], Constraints]


class Along(NamedTuple):
    """What pairs with friction do at n states of a motion."""

    rates: Floats  # (n, k) without what rounding leaves pairs that stick
    qdd: Floats  # (n, k)
    friction: Floats  # (n, m)
    stand: Bools  # (n, m) which pairs stand
    pushes: Floats  # (n, a) of the stops that it lies against


def friction_along(
    friction: JointFriction,
    states: States,
    sides: Floats,
    lies: Bools,
    against: Against,
    begins: bool = True,
) -> Along:
    """What the pairs do at n states of a motion.

    ``sides`` (n, m), NaN where nothing is known; ``lies`` (n, a) whether it lies against
    each of some stops, ``against`` says which rows those have. Of a pair that only starts or
    turns back the friction is that of the sense in which it goes on. ``begins`` : whether
    sides are completed where no motion says them.
    """
    q, qd, t, x = states
    if begins:
        sides = _completed(friction, states, sides, lies, against)
    rates, qdd, rubbed = qd.copy(), np.full(qd.shape, np.nan), np.full(sides.shape, np.nan)
    stand, pushes = np.zeros(sides.shape, dtype=bool), np.zeros(lies.shape)
    kinds, which = np.unique(np.hstack([sides, lies]), axis=0, return_inverse=True)
    for kind, row in enumerate(kinds):
        if np.isnan(row).any():
            continue
        some = np.flatnonzero(which.ravel() == kind)
        side, those = tuple(row[: sides.shape[1]].tolist()), row[sides.shape[1] :] > 0
        for _ in range(2):  # the second time with rates that are those of what sticks
            state = q[some], rates[some], t[some]
            constraint = against(*state, np.flatnonzero(those)) if any(those) else None
            at = friction.instant(*state, x[some], constraint)
            rates[some] = friction.sticking_rates(at, side)
        response = friction.responses(at, side)
        qdd[some], rubbed[some] = response.qdd, response.t
        pushes[np.ix_(some, those)] = response.pushes
        size = (np.abs(at.S) @ np.abs(at.freedoms[..., None]))[..., 0]
        fast = np.abs(np.hstack([at.w, at.rate])).max(axis=-1, keepdims=True)
        rounded = np.abs(at.w) <= DEPENDENT * np.maximum(size, fast)
        still = (rounded | (at.w * np.array(side) < 0)) & ~friction.signed
        stand[some] = still | (np.array(side) == 0)
    return Along(rates, qdd, rubbed, stand, pushes)


def _completed(
    friction: JointFriction, states: States, sides: Floats, lies: Bools, against: Against
) -> Floats:
    """Sides (n, m) where no motion says them: those with which one begins there."""
    q, qd, t, x = states
    sides, begins = sides.copy(), dict[bytes, float | Sides]()
    open_ = np.isnan(sides).any(axis=1) & np.isfinite(q + qd).all(axis=1)
    if not open_.any():
        return sides
    w = friction.rates(q, qd)
    open_ &= np.isfinite(w).all(axis=1)  # where there is a pose
    moving = open_ & (w != 0).all(axis=1) & ~np.any(lies, axis=1)
    sides[moving] = friction.senses(w[moving])
    for i in np.flatnonzero(open_ & ~moving):
        key = np.array([*q[i], *qd[i], t[i], *x[i], *lies[i]]).tobytes()
        if key not in begins:
            some = slice(i, i + 1)
            state, those = (q[some], qd[some], t[some]), np.flatnonzero(lies[i])
            constraint = against(*state, those).first() if any(lies[i]) else None
            start = friction.from_state(q[i], qd[i], float(t[i]), constraint, x[i])[0]
            begins[key] = np.nan if start.end else start.sides
        sides[i] = begins[key]
    return sides
