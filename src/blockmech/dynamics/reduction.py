"""From a compiled mechanism to the reduced system that forward dynamics integrates.

One plan gives J_red and the reduced loads in batches, the same plan bound to Python
numbers gives single states. What the loads depend on is read from the elements'
declarations; nobody has to say it twice.

Sources: [D14] Eqs. 1-6; `numerics.md` is the project's own derivation.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.blocks.contract import DrivingLink
from blockmech.dynamics.reduced import TURN, ReducedSystem, ReducedSystems, Sample, Terms
from blockmech.engines import NumpyEngine, ScalarEngine
from blockmech.errors import Problem, RequestError, listed
from blockmech.loads.contract import VELOCITY_READS
from blockmech.mechanism import Mechanism
from blockmech.plan import Plan

Array = NDArray[np.float64]
RATE_READS = frozenset({*VELOCITY_READS, "qd"})


def depends_on(mechanism: Mechanism) -> frozenset[str]:
    """What the loads of a scene depend on: "q" always, "rate" and "time" where declared."""
    found = {"q"}
    for element in mechanism.structure.elements.values():
        for reads in element.reads().values():
            found |= {"rate"} if RATE_READS & set(reads) else set()
            found |= {"time"} if "t" in reads else set()
    return frozenset(found)


def refuse_friction(mechanism: Mechanism) -> None:
    """Refuse a scene with joint friction: friction in motion is not computed.

    Raises `RequestError` that names the joints.
    """
    joints = [
        f"{name}.{joint}"
        for name, block in mechanism.structure.blocks.items()
        for joint, law in block.friction.items()
        if law.factor
    ]
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
    """Values of a plan at driver states: batches by NumPy, single states by Python numbers."""

    def __init__(self, mechanism: Mechanism, want: Iterable[str]) -> None:
        self.plan: Plan = mechanism.plan(tuple(want), friction="none")
        self._batch = NumpyEngine(self.plan.program)
        self._one = ScalarEngine(self.plan.program)
        self._names = self.plan.program.inputs
        self._margins = self.plan.verdicts[0]
        self.place = {name: i[0] for name, i in self.plan.layout.items() if i}

    def batch(self, inputs: dict[str, Any], n: int) -> tuple[Any, ...]:
        """All values of n states."""
        return self._batch.run({name: inputs[name] for name in self._names}, n)

    def one(self, inputs: dict[str, float]) -> tuple[Any, ...]:
        """All values of one state."""
        return self._one.one([inputs[name] for name in self._names])

    def margin(self, values: tuple[Any, ...], n: int) -> Array:
        """Smallest margin (n,) over all groups; 1 where there is none."""
        found = np.ones(n)
        for i in self._margins:
            found = np.minimum(found, values[i])  # NaN stays NaN
        return found

    def margin_of_one(self, values: tuple[Any, ...]) -> float:
        """Smallest margin of one state."""
        found = 1.0
        for i in self._margins:
            m = float(values[i])
            if not m >= found:
                found = m
        return found


def reduced_system(mechanism: Mechanism) -> ReducedSystem:
    """The reduced system of a mechanism with one driver.

    Raises `RequestError` where it has not exactly one driver, or no inertia at all.
    """
    if len(mechanism.drivers) != 1:
        raise RequestError(
            Problem(
                "drivers",
                mechanism.name,
                f"it has {len(mechanism.drivers)} drivers, not one",
            )
        )
    (driver,) = mechanism.drivers
    block = mechanism.structure.blocks[driver]
    assert isinstance(block, DrivingLink)
    J, tau, dJ = f"{driver}.J_red", f"{driver}.tau_red", f"{driver}.dJ_red"
    plain, slope = _Values(mechanism, (J, tau)), _Values(mechanism, (J, tau, dJ))
    depends = depends_on(mechanism)

    def state(q: Any, qd: Any, t: Any) -> dict[str, Any]:
        return {"q_0": q, "qd_0": qd, "qdd_0": qd, "t": t}

    def sample(q: Array, wanted: frozenset[str]) -> Sample:
        values = slope if "dJ" in wanted else plain
        n, rest = len(q), np.zeros(len(q))
        found = values.batch(state(q, rest, rest), n)
        damping = None
        if "damping" in wanted:
            moved = plain.batch(state(q, rest + 1.0, rest), n)
            damping = found[values.place[tau]] - moved[plain.place[tau]]
        return Sample(
            found[values.place[J]],
            found[values.place[tau]],
            values.margin(found, n),
            found[values.place[dJ]] if "dJ" in wanted else None,
            damping,
        )

    def one(q: float, qd: float, t: float) -> tuple[float, float, float, float]:
        found = slope.one(state(q, qd, t))
        at = slope.place
        numbers = (float(found[at[J]]), float(found[at[tau]]), float(found[at[dJ]]))
        return (*numbers, slope.margin_of_one(found))

    return ReducedSystem(
        sample=sample,
        one=one,
        kind="rotation" if block.rotary else "translation",
        period=TURN if block.rotary else None,
        depends_on=depends,
        damped="rate" in depends,
    )


def refuse_no_inertia(mechanism: Mechanism) -> None:
    """Refuse a mechanism that cannot be accelerated because nothing has mass."""
    links = mechanism.structure.links
    if not any(mechanism.structure.properties(link).massive for link in links):
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
    drivers = mechanism.drivers
    k = len(drivers)
    idle = tuple(f"{d}.drive_by_reduction" for d in drivers)  # c - Q, at q'' = 0
    values = _Values(mechanism, ("mechanism.M", *idle))
    M_at = values.plan.layout["mechanism.M"]
    rest_at = [values.place[name] for name in idle]

    def state(q: Array, qd: Array, t: float) -> dict[str, float]:
        found = {"t": t}
        for i in range(k):
            found |= {f"q_{i}": float(q[i]), f"qd_{i}": float(qd[i]), f"qdd_{i}": 0.0}
        return found

    def terms(q: Array, qd: Array, t: float) -> Terms:
        found = values.one(state(q, qd, t))
        M = np.array([float(found[i]) for i in M_at]).reshape(k, k)
        rest = np.array([float(found[i]) for i in rest_at])
        return Terms(M, rest, np.zeros(k), values.margin_of_one(found))

    return ReducedSystems(k, terms, depends_on(mechanism))
