"""From a compiled mechanism to the reduced system that forward dynamics integrates.

One plan gives J_red and the reduced loads in batches, the same plan bound to Python
numbers gives single states. What the loads depend on is read from the elements'
declarations; nobody has to say it twice.

Sources: [D14] Eqs. 1-6.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.compiled import Compiled
from blockmech.dynamics.system.bridges import bridged
from blockmech.dynamics.system.knots import knots_of
from blockmech.dynamics.system.reduced import (
    TURN,
    RateLoadOne,
    ReducedSystem,
    ReducedSystems,
    Sample,
    Terms,
)
from blockmech.dynamics.system.split import (
    OwnLoads,
    depends_on,
    load_size,
    lossless,
    own_loads,
    period_of,
    straight,
)
from blockmech.engines import NumpyEngine, ScalarEngine
from blockmech.errors import Problem, RequestError, listed
from blockmech.model.structure import Structure
from blockmech.plan import Plan

Array = NDArray[np.float64]
STATE = ("q_0", "qd_0", "t")
FAST = 2.0**16  # rate [rad/s or m/s] at which damping is told from loads at rest: of straight lines


def frictional_joints(structure: Structure) -> tuple[str, ...]:
    """Names of the joints that have friction."""
    return tuple(
        f"{name}.{joint}"
        for name, block in structure.blocks.items()
        for joint, law in block.friction.items()
        if law.factor
    )


def refuse_friction(joints: Sequence[str]) -> None:
    """Refuse a scene with joint friction: friction in motion is not computed.

    Raises `RequestError` that names the joints.
    """
    if joints:
        raise RequestError(
            Problem(
                "friction-in-motion",
                listed(joints),
                "joint friction is not part of forward motion yet",
                "",
                'leave it out with friction="none" (--friction none)',
            )
        )


class _Values:
    """Values of a plan at driver states: batches by NumPy, single states by Python numbers.

    Planned and bound when they are first asked for: most runs need a part of them only.
    """

    def __init__(self, mechanism: Compiled, want: Iterable[str]) -> None:
        self._mechanism, self._want = mechanism, tuple(want)

    @cached_property
    def plan(self) -> Plan:
        """What is computed."""
        return self._mechanism.plan(self._want, friction="none")

    @cached_property
    def place(self) -> Mapping[str, int]:
        """Output -> index of its value."""
        return {name: i[0] for name, i in self.plan.layout.items() if i}

    @cached_property
    def _batch(self) -> NumpyEngine:
        return NumpyEngine(self.plan.program)

    @cached_property
    def _one(self) -> ScalarEngine:
        return ScalarEngine(self.plan.program)

    @cached_property
    def _margins(self) -> tuple[int, ...]:
        return self.plan.verdicts[0]

    def batch(self, inputs: Mapping[str, Any], n: int) -> tuple[Any, ...]:
        """All values of n states."""
        return self._batch.run(inputs, n)

    def of(self, names: Sequence[str]) -> Callable[..., tuple[Any, ...]]:
        """The values of one state as a function of the inputs in this order."""
        one, own = self._one.one, self.plan.program.inputs
        if own == tuple(names):
            return lambda *given: one(given)
        order = [names.index(name) for name in own]
        return lambda *given: one([given[i] for i in order])

    def margin(self, values: tuple[Any, ...], n: int) -> Array:
        """Smallest margin (n,) over all groups; 1 where there is none."""
        found = np.ones(n)
        for i in self._margins:
            found = np.minimum(found, values[i])  # NaN stays NaN
        return found

    def margin_of_one(self, values: tuple[Any, ...]) -> float:
        """Smallest margin of one state; NaN if one is."""
        found = 1.0
        for i in self._margins:
            m = values[i]
            if not m >= found:
                if m != m:
                    return math.nan
                found = m
        return found


@dataclass(frozen=True)
class _OneDriver:
    """The functions of a `ReducedSystem`, as values of the plans of its driver.

    plain : inertia and effort
    slope : the same and the slope of the inertia
    own : the loads of rate or time, where all of them act on the driver itself
    """

    driver: str
    plain: _Values
    slope: _Values
    own: OwnLoads | None

    @classmethod
    def of(cls, mechanism: Compiled, driver: str, own: OwnLoads | None) -> _OneDriver:
        """Those of a mechanism with one driver."""
        J, tau, dJ = (f"{driver}.{name}" for name in ("J_red", "tau_red", "dJ_red"))
        return cls(driver, _Values(mechanism, (J, tau)), _Values(mechanism, (J, tau, dJ)), own)

    def _at(self, values: _Values, name: str) -> int:
        return values.place[f"{self.driver}.{name}"]

    def sample(self, q: Array, wanted: frozenset[str]) -> Sample:
        """Values at coordinates (n,), at rest and time 0."""
        values = self.slope if "dJ" in wanted else self.plain
        n, rest = q.size, np.zeros(q.size)
        found = values.batch({"q_0": q, "qd_0": rest, "t": rest}, n)
        tau = found[self._at(values, "tau_red")]
        return Sample(
            found[self._at(values, "J_red")],
            tau,
            values.margin(found, n),
            found[self._at(values, "dJ_red")] if "dJ" in wanted else None,
            self._damping(q, tau) if "damping" in wanted else None,
        )

    def _damping(self, q: Array, tau: Array) -> Array:
        """Linear damping (n,) from the effort at a rate less ``tau``, that at rest."""
        probe = FAST if self.own is None else 1.0
        damping = (tau - self._effort(q, np.zeros(q.size) + probe, 0.0)) / probe
        return damping if self.own is None else damping + self.own.one(probe, 0.0)

    def _effort(self, q: Array, qd: Array, t: float) -> Array:
        given = {"q_0": q, "qd_0": qd, "t": np.full(q.shape, t)}
        return np.asarray(self.plain.batch(given, q.size)[self._at(self.plain, "tau_red")])

    @cached_property
    def _single(self) -> tuple[Callable[..., tuple[Any, ...]], int, int, int]:
        J, tau, dJ = (self._at(self.slope, name) for name in ("J_red", "tau_red", "dJ_red"))
        return self.slope.of(STATE), J, tau, dJ

    @cached_property
    def _plainly(self) -> tuple[Callable[..., tuple[Any, ...]], int, int]:
        J, tau = (self._at(self.plain, name) for name in ("J_red", "tau_red"))
        return self.plain.of(STATE), J, tau

    def one(self, q: float, qd: float, t: float) -> tuple[float, float, float, float]:
        """J, tau, dJ/dq and margin of one state."""
        values, i, j, k = self._single
        found = values(q, qd, t)
        return found[i], found[j], found[k], self.slope.margin_of_one(found)

    def pose(self, q: float, qd: float, t: float) -> tuple[float, float, float, float]:
        """The same with NaN for dJ/dq."""
        values, i, j = self._plainly
        found = values(q, qd, t)
        return found[i], found[j], math.nan, self.plain.margin_of_one(found)

    def rate_load(self, q: Array, qd: Array, t: float) -> Array:
        """Effort (n,) at rates and a time, less that at rest and time 0."""
        if self.own is not None:
            return self.own.batch(qd, t)
        return self._effort(q, qd, t) - self._effort(q, 0 * qd, 0.0)

    @property
    def rate_load_one(self) -> RateLoadOne | None:
        """The same of one state; None where it would need a kernel."""
        own = self.own
        return None if own is None else lambda q, qd, t: own.one(qd, t)


def reduced_system(mechanism: Compiled) -> ReducedSystem:
    """The reduced system of a mechanism with one driver.

    Raises `RequestError` where it has not exactly one driver, or no inertia at all.
    """
    if len(mechanism.drivers) != 1:
        found = f"it has {len(mechanism.drivers)} drivers, not one"
        raise RequestError(Problem("drivers", mechanism.name, found))
    refuse_no_inertia(mechanism)
    (driver,) = mechanism.drivers
    structure, scene = mechanism.structure, mechanism.scene
    rotary = structure.driver_joint(driver).rotary
    depends = depends_on(structure)
    period = period_of(structure, driver, rotary)
    span = TURN if rotary else _length(mechanism)
    crooked = not all(map(straight, structure.elements.values()))
    own = own_loads(structure, scene, driver) if crooked else None
    values = _OneDriver.of(mechanism, driver, own)
    system = ReducedSystem(
        sample=values.sample,
        one=values.one,
        kind="rotation" if rotary else "translation",
        period=period,
        depends_on=depends,
        damped="rate" in depends and (own is not None or not crooked),
        rate_load=values.rate_load if crooked else None,
        rate_load_one=values.rate_load_one,
        rate_load_kernels=own is None,
        knots=knots_of(structure, scene, driver, period, span),
        span=span,
        load_size=load_size(structure, scene, driver),
        pose=values.pose,
        lossless=period is not None and lossless(structure),
    )
    return bridged(system, structure)


def _length(mechanism: Compiled) -> float:
    """A length [m] over which things change: the largest that the blocks declare."""
    found = [0.0]
    for block in mechanism.structure.blocks.values():
        for name in ("length", "l_i", "l_j"):
            found.append(float(getattr(block, name, 0.0) or 0.0))
    return max(found) or 1.0


def refuse_no_inertia(mechanism: Compiled) -> None:
    """Refuse a mechanism that cannot be accelerated because nothing has mass."""
    structure = mechanism.structure
    if not any(structure.properties(link).massive for link in structure.links):
        raise RequestError(
            Problem(
                "no-inertia",
                mechanism.name,
                "no link has mass or inertia, so loads set no motion",
                "",
                'give links "mass" and "inertia"',
            )
        )


def reduced_systems(mechanism: Compiled) -> ReducedSystems:
    """The equations of motion of a mechanism with several drivers, M q'' + c = Q."""
    refuse_no_inertia(mechanism)
    drivers = mechanism.drivers
    k = len(drivers)
    idle = tuple(f"{d}.drive_by_reduction" for d in drivers)  # c - Q, at q'' = 0
    values = _Values(mechanism, ("mechanism.M", "mechanism.Q", *idle))
    M_at, Q_at = (values.plan.layout[f"mechanism.{name}"] for name in "MQ")
    idle_at = [values.place[name] for name in idle]
    names = [f"{what}_{i}" for what in ("q", "qd", "qdd") for i in range(k)]
    single = values.of((*names, "t"))
    still = [0.0] * k

    def terms(q: Array, qd: Array, t: float) -> Terms:
        found = single(*map(float, q), *map(float, qd), *still, t)
        M = np.array([float(found[i]) for i in M_at]).reshape(k, k)
        Q = np.array([float(found[i]) for i in Q_at])
        c = Q + np.array([float(found[i]) for i in idle_at])
        return Terms(M, c, Q, values.margin_of_one(found))

    return ReducedSystems(k, terms, depends_on(mechanism.structure))
