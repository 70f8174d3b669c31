"""Outputs along a motion: the same pruned plan as of any other run, at states of the motion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.change_points import system_of
from blockmech.dynamics.contacts import Held, constrained
from blockmech.dynamics.friction import JointFriction
from blockmech.dynamics.pair_stops import held_by, lain_against
from blockmech.dynamics.sticking import SeveralFriction
from blockmech.dynamics.system import System, solved
from blockmech.motion import Floats, Motion
from blockmech.passes.signals import STATE
from blockmech.plan import Friction
from blockmech.result import Result
from blockmech.samples import Samples
from blockmech.settings import friction_asked
from blockmech.typing import M

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

SINGULAR = 1e-10  # margin of a dead centre itself, but for rounding
STATIC = {"static": False}


class MotionInputs(Mapping[str, Any]):
    """Inputs of a program along a motion; accelerations are found when they are asked for.

    ``unknown`` (n,) : samples at which the rates of the drivers say nothing about other links
    """

    def __init__(
        self, mechanism: Compiled, how: Friction, motion: Motion, t: Floats, unknown: Any
    ) -> None:
        k = len(mechanism.drivers)
        self.q, self.qd = motion.at(t)
        self.qd[unknown] = np.nan
        self.mechanism, self.how, self.t = mechanism, how, t
        self.pairs = lain_against(mechanism, motion.lying)
        names = () if self.pairs is None else self.pairs.names
        self.lies = motion.held(t, (*mechanism.drivers, *names))
        self.states = motion.signal_states(t)
        self.several: dict[str, Floats] = {}
        if k > 1 and how.method != "none":
            self._with_several(motion)
        self.known = _by_driver("q", self.q, k) | _by_driver("qd", self.qd, k)
        self.known |= _by_state(self.states) | self.several

    def _with_several(self, motion: Motion) -> None:
        """Rates and accelerations of several drivers, and friction of pairs that stick."""
        pushed = () if self.pairs is None else self.pairs.refs
        friction = system_of(self.mechanism, method=self.how).friction_of(SeveralFriction, pushed)
        if friction is None:
            return
        if motion.slips:
            sides = motion.sides(self.t)
        elif motion.status != "failed":  # it only begins
            begun, _, _ = friction.from_state(self.q[0], self.qd[0], self.t[0], None)
            sides = np.tile(begun.sides, (len(self.t), 1))
        else:  # before it began: nothing is known
            sides = np.full((len(self.t), len(friction.names)), np.nan)
        along = friction.along(
            self.q, self.qd, self.t, self.states, sides, self.lies, self._against
        )
        self.qd, self.several = along.rates, _by_driver("qdd", along.qdd, along.qdd.shape[1])
        self.several |= self._pushed(along.pushes)
        for j, t in enumerate(np.ascontiguousarray(along.friction.T)):
            stuck = along.stand[:, j]
            self.several |= {f"sticks_{j}": 1.0 * stuck, f"friction_{j}": t}

    def _against(self, q: Floats, qd: Floats, which: Any) -> Held:
        """Rows of stops that it lies against at n states."""
        at = [held_by(self.pairs, *state, which) for state in zip(q, qd, strict=True)]
        return Held(np.array([x.rows for x in at]), np.array([x.drift for x in at]), at[0].pairs)

    def _pushed(self, pushes: Floats) -> dict[str, Floats]:
        """Inputs of what stops of pairs push with, from that of all stops (n, a)."""
        k = len(self.mechanism.drivers)
        pairs = () if self.pairs is None else self.pairs.pairs
        return {f"push_{j}": sense * pushes[:, k + j] for j, (_, sense) in enumerate(pairs)}

    def __getitem__(self, name: str) -> Any:
        return self.known[name] if name in self.known else self.accelerations[name]

    def __iter__(self) -> Iterator[str]:
        yield from self.known
        if "qdd_0" not in self.known:
            yield from (f"qdd_{i}" for i in range(len(self.mechanism.drivers)))
            pairs = self._friction_of_one()
            yield from () if pairs is None else (f"friction_{j}" for j in range(len(pairs.names)))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def _friction_of_one(self) -> JointFriction | None:
        """Joint friction of a mechanism with one driver; not kept, as programs do not pickle."""
        if len(self.mechanism.drivers) > 1:
            return None
        system = system_of(self.mechanism, method=self.how)
        friction: JointFriction | None = system.friction_of(JointFriction, self.how.pushed)
        return friction

    @cached_property
    def accelerations(self) -> dict[str, Floats]:
        """q'' (n,) of each driver, the drives idle, and of one driver the friction of pairs."""
        friction = self._friction_of_one()
        if friction is None:
            return self._without_friction()
        rows = zip(self.q.tolist(), self.qd.tolist(), self.t.tolist(), self.states, strict=True)
        states = np.array([_with_friction(friction, *row) for row in rows])
        qdd, *rubs = np.ascontiguousarray(states.reshape(-1, 1 + len(friction.names)).T)
        more = {} if self.pairs is None else self._without_friction()
        more |= {f"friction_{j}": x for j, x in enumerate(rubs)}
        return {**more, "qdd_0": np.where(self.lies.any(axis=1), 0.0, qdd)}

    def _without_friction(self) -> dict[str, Floats]:
        """Accelerations from M q'' = Q - c, and what stops push with."""
        mechanism, n = self.mechanism, len(self.t)
        drivers, k = mechanism.drivers, len(mechanism.drivers)
        idle = [mechanism.of_driver(d, "drive_by_reduction") for d in drivers]  # c - Q, q'' = 0
        mass = mechanism.of_driver(drivers[0], "J_red") if k == 1 else "mechanism.M"
        samples = Samples(n, self.known | {f"qdd_{i}": np.zeros(n) for i in range(k)}, self.t)
        result = frictionless(mechanism, (*idle, mass), samples)
        right = -np.stack([result[name] for name in idle], axis=-1)
        M = result[mass].reshape(n, k, k)
        qdd, pushes = np.empty((n, k)), np.zeros(self.lies.shape)
        if k == 1 and not self.lies.any():
            return {"qdd_0": right[:, 0] / M[:, 0, 0]}
        for i, lies in enumerate(self.lies):
            if not lies.any():
                qdd[i] = solved(M[i], right[i])
                continue
            which = np.flatnonzero(lies).tolist()
            held = held_by(self.pairs, self.q[i], self.qd[i], which)
            qdd[i], pushes[i, which] = constrained(M[i], right[i], held)
        return _by_driver("qdd", qdd[:, 0] if k == 1 else qdd, k) | self._pushed(pushes)


def states_along(motion: Motion, t: Floats) -> dict[str, Floats]:
    """Inputs of the states of signal blocks at times (n,) of a motion."""
    return _by_state(motion.signal_states(t))


def _by_state(states: Floats) -> dict[str, Floats]:
    return {f"{STATE}{i}": np.ascontiguousarray(states[:, i]) for i in range(states.shape[1])}


def _by_driver(name: str, values: Floats, k: int) -> dict[str, Floats]:
    """Inputs of each driver from values (n,) or (n, k)."""
    columns = [values] if k == 1 else [np.ascontiguousarray(column) for column in values.T]
    return {f"{name}_{i}": column for i, column in enumerate(columns)}


def _with_friction(
    friction: JointFriction, q: float, qd: float, t: float, x: Floats
) -> list[float]:
    """q'' of the only driver, and the friction of pairs, NaN where that holds it."""
    way = (1 if qd > 0 else -1) if qd else friction.rest(q, t, x).moves
    if not way:
        return [0.0, *(np.nan for _ in friction.names)]
    state = friction.at(q, qd, t, friction.sides(q, way), x)
    return [float(state.qdd), *state.friction.tolist()]


class SimulationResult(Result[M]):
    """The result of a simulation: outputs at times, and the ``motion`` that they are read from."""

    motion: Motion


def result_along(
    mechanism: Compiled,
    motion: Motion,
    t: Floats,
    want: Iterable[str] | str,
    friction: str | None = None,
    tolerance: float | None = None,
    iterations: int | None = None,
    engine: str = "auto",
    chunk: int | None = None,
) -> SimulationResult:
    """The wanted outputs at times (n,) [s] of a motion.

    Joint friction is that of the motion, if nothing else is said. In a dead centre itself, in
    which a motion ends, there are no rates and forces: there the rate of the driver, mostly
    zero, does not say how fast the others go.
    """
    friction = friction or ("newton" if "friction_work" in motion.facts else "none")
    settings = {"friction": friction, "tolerance": tolerance, "iterations": iterations}
    how = friction_asked(friction, tolerance, iterations)
    if how.method != "none":
        how = replace(how, along=True)
    if (pairs := lain_against(mechanism, motion.lying)) is not None:
        how = replace(how, pushed=pairs.refs)
    plan = mechanism.planned(want, how)
    unknown = np.zeros(len(t), bool)
    if motion.end == ends.DEAD_CENTRE and _margin_at_end(mechanism, motion) <= SINGULAR:
        unknown = t == motion.t_end
    given = MotionInputs(mechanism, how, motion, t, unknown)
    values, engine = mechanism.evaluate(plan, Samples(len(t), given, t), engine, chunk=chunk)
    if unknown.any():
        given = MotionInputs(mechanism, how, motion, t, slice(0))
        rates = [mechanism.of_driver(d, "rate") for d in mechanism.drivers]
        known = {i: f"qd_{n}" for n, r in enumerate(rates) for i in plan.layout.get(r, ())}
        values = tuple(given[known[i]] if i in known else x for i, x in enumerate(values))
    samples = Samples(len(t), given, t)
    return SimulationResult(mechanism, plan, samples, values, engine, settings | STATIC, motion)


def _margin_at_end(mechanism: Compiled, motion: Motion) -> float:
    return System(mechanism).terms(motion.q_end, motion.qd_end).margin


def frictionless(mechanism: Compiled, want: Sequence[str], samples: Samples) -> Result:
    """Outputs at samples, without joint friction."""
    plan = mechanism.plan(want, friction="none")
    values, engine = mechanism.evaluate(plan, samples)
    return Result(mechanism, plan, samples, values, engine, {"friction": "none"} | STATIC)
