"""From a compiled mechanism to the reduced system that forward dynamics integrates.

One plan gives J_red and the reduced loads in batches, the same plan bound to Python
numbers gives single states. What the loads depend on is read from the elements'
declarations; nobody has to say it twice.

Sources: [D14] Eqs. 1-6.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.bridges import bridged
from blockmech.dynamics.knots import knots_of
from blockmech.dynamics.reduced import TURN, ReducedSystem, ReducedSystems, Sample, Terms
from blockmech.dynamics.split import depends_on, load_size, lossless, own_loads, period_of, straight
from blockmech.engines import NumpyEngine, ScalarEngine
from blockmech.errors import Problem, RequestError, listed
from blockmech.mechanism import Mechanism
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

    def __init__(self, mechanism: Mechanism, want: Iterable[str]) -> None:
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


def reduced_system(mechanism: Mechanism) -> ReducedSystem:
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
    J, tau, dJ = f"{driver}.J_red", f"{driver}.tau_red", f"{driver}.dJ_red"
    plain, slope = _Values(mechanism, (J, tau)), _Values(mechanism, (J, tau, dJ))
    damped = "rate" in depends and (own is not None or not crooked)
    probe = FAST if own is None else 1.0

    def effort(q: Array, qd: Array, t: float) -> Array:
        given = {"q_0": q, "qd_0": qd, "t": np.full(q.shape, t)}
        return np.asarray(plain.batch(given, q.size)[plain.place[tau]])

    def sample(q: Array, wanted: frozenset[str]) -> Sample:
        values = slope if "dJ" in wanted else plain
        n, rest = q.size, np.zeros(q.size)
        found = values.batch({"q_0": q, "qd_0": rest, "t": rest}, n)
        at = values.place
        damping = None
        if "damping" in wanted:
            damping = (found[at[tau]] - effort(q, rest + probe, 0.0)) / probe
            if own is not None:
                damping = damping + own.one(probe, 0.0)
        return Sample(
            found[at[J]],
            found[at[tau]],
            values.margin(found, n),
            found[at[dJ]] if "dJ" in wanted else None,
            damping,
        )

    @cache
    def single() -> tuple[Callable[..., tuple[Any, ...]], int, int, int]:
        return slope.of(STATE), slope.place[J], slope.place[tau], slope.place[dJ]

    @cache
    def plainly() -> tuple[Callable[..., tuple[Any, ...]], int, int]:
        return plain.of(STATE), plain.place[J], plain.place[tau]

    margin_of, plain_margin = slope.margin_of_one, plain.margin_of_one

    def one(q: float, qd: float, t: float) -> tuple[float, float, float, float]:
        values, i, j, k = single()
        found = values(q, qd, t)
        return found[i], found[j], found[k], margin_of(found)

    def pose(q: float, qd: float, t: float) -> tuple[float, float, float, float]:
        values, i, j = plainly()
        found = values(q, qd, t)
        return found[i], found[j], math.nan, plain_margin(found)

    def rest_of(q: Array, qd: Array, t: float) -> Array:
        if own is not None:
            return own.batch(qd, t)
        return effort(q, qd, t) - effort(q, 0 * qd, 0.0)

    system = ReducedSystem(
        sample=sample,
        one=one,
        kind="rotation" if rotary else "translation",
        period=period,
        depends_on=depends,
        damped=damped,
        rate_load=rest_of if crooked else None,
        rate_load_one=None if own is None else lambda q, qd, t: own.one(qd, t),
        rate_load_kernels=own is None,
        knots=knots_of(structure, scene, driver, period, span),
        span=span,
        load_size=load_size(structure, scene, driver),
        pose=pose,
        lossless=period is not None and lossless(structure),
    )
    return bridged(system, structure)


def _length(mechanism: Mechanism) -> float:
    """A length [m] over which things change: the largest that the blocks declare."""
    found = [0.0]
    for block in mechanism.structure.blocks.values():
        for name in ("length", "l_i", "l_j"):
            found.append(float(getattr(block, name, 0.0) or 0.0))
    return max(found) or 1.0


def refuse_no_inertia(mechanism: Mechanism) -> None:
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


def reduced_systems(mechanism: Mechanism) -> ReducedSystems:
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
