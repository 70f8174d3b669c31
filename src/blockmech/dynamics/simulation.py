"""Simulate: a mechanism moves under its loads, and everything else follows from that.

The reduced system carries the motion; the wanted outputs are then computed at the
output times through the same pruned plan as any other run. A request that asks for
the driver's motion alone computes no acceleration and no reaction.

Sources: [D14] Durango et al. 2014, Fig. 1 and section 2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.methods import move
from blockmech.dynamics.motion import Motion
from blockmech.dynamics.reduced import Metered
from blockmech.dynamics.reduction import (
    reduced_system,
    reduced_systems,
    refuse_friction,
    refuse_no_inertia,
)
from blockmech.dynamics.until import Start, Until, Watch
from blockmech.errors import Problem, RequestError, listed
from blockmech.result import Result
from blockmech.samples import Samples

if TYPE_CHECKING:
    from blockmech.mechanism import Mechanism

Array = NDArray[np.float64]
OUTPUTS = 201  # output times where none are named


def simulate(
    mechanism: Mechanism,
    until: str | Until | None = None,
    *,
    method: str = "auto",
    accuracy: float | None = None,
    step: float | None = None,
    times: Sequence[float] | Array | None = None,
    start: Mapping[str, tuple[float, float]] | None = None,
    watch: Sequence[Watch] = (),
    want: Iterable[str] | str = ("*.q", "*.rate"),
    friction: str | None = None,
) -> Result:
    """Move a mechanism from its start until something ends the run.

    Parameters
    ----------
    until : "standstill" (default), "swings=3", "turns=3", "time=2", "angle=6.28",
        "steady" or "event"
    method : "auto", "energy", "spectral", "dop853", "lsoda", "radau", "rk4", "euler_q"
    accuracy : target [rad or m] of the driver coordinate at all times
    step : of the fixed-step methods: time [s] for rk4, driver coordinate for euler_q
    times : (n,) output times [s]; by default 201 over the whole run
    start : driver -> (q [rad or m], rate); by default the scene's ``initial``
    watch : the user's events
    want : outputs at the output times
    friction : "none" leaves joint friction out; without it such a scene is refused

    Returns
    -------
    Result at the output times, with ``motion``: method and why, error estimate,
    events, cost, and what ended the run. Output times after the end are left out.

    Raises
    ------
    RequestError where the scene has no start, no inertia, joint friction that is not
    waived, or the method does not apply
    """
    if friction != "none":
        refuse_friction(mechanism)
    refuse_no_inertia(mechanism)
    wanted = _column(times)
    goal = _goal(until, wanted)
    starts = _starts(mechanism, start)
    motion = _moved(mechanism, starts, goal, method, accuracy, step, watch)
    if wanted is None:
        wanted = motion.times(OUTPUTS if motion.t_end > motion.t_start else 1)
    inside = wanted[(wanted >= motion.t_start) & (wanted <= motion.t_end)]
    return _result(mechanism, motion, inside if len(inside) else wanted[:1] * 0.0, want)


def _goal(until: str | Until | None, times: Array | None) -> Until:
    if until is None:
        return Until("time", float(times.max())) if times is not None else Until("standstill")
    return Until.parse(until) if isinstance(until, str) else until


def _starts(
    mechanism: Mechanism, start: Mapping[str, tuple[float, float]] | None
) -> dict[str, tuple[float, float]]:
    given = {d: (x.q, x.rate) for d, x in mechanism.scene.initial.items()} | dict(start or {})
    missing = [d for d in mechanism.drivers if d not in given]
    unknown = [d for d in given if d not in mechanism.drivers]
    if missing or unknown:
        raise RequestError(
            Problem(
                "no-start",
                "scene.initial",
                f"no start for: {listed(missing)}" if missing else f"unknown: {listed(unknown)}",
                f"driving links: {listed(mechanism.drivers)}",
                'give the scene "initial": {"<driver>": {"q": ..., "rate": ...}}',
            )
        )
    return {d: given[d] for d in mechanism.drivers}


def _moved(
    mechanism: Mechanism,
    starts: Mapping[str, tuple[float, float]],
    goal: Until,
    method: str,
    accuracy: float | None,
    step: float | None,
    watch: Sequence[Watch],
) -> Motion:
    if len(starts) == 1:
        ((q, rate),) = starts.values()
        system = Metered(reduced_system(mechanism))
        return move(system, Start(q, rate), goal, method, accuracy, step, watch)
    q0 = np.array([q for q, _ in starts.values()])
    qd0 = np.array([rate for _, rate in starts.values()])
    return move(reduced_systems(mechanism), (q0, qd0), goal, method, accuracy, step, watch)


def _result(mechanism: Mechanism, motion: Motion, t: Array, want: Iterable[str] | str) -> Result:
    """The wanted outputs along a motion."""
    plan = mechanism.plan(want, friction="none")
    q, qd = motion.at(t)
    inputs: dict[str, Any] = {}
    for i in range(len(mechanism.drivers)):
        inputs[f"q_{i}"] = np.ascontiguousarray(q[:, i] if q.ndim > 1 else q)
        inputs[f"qd_{i}"] = np.ascontiguousarray(qd[:, i] if qd.ndim > 1 else qd)
        inputs[f"qdd_{i}"] = np.zeros(len(t))
    samples = Samples(len(t), inputs, t)
    if any(name.startswith("qdd_") for name in plan.program.inputs):
        samples = _with_accelerations(mechanism, samples)
    values, engine = mechanism.evaluate(plan, samples)
    settings = {"friction": "none", "tolerance": None, "iterations": None, "static": False}
    return Result(mechanism, plan, samples, values, engine, settings, motion)


def _with_accelerations(mechanism: Mechanism, samples: Samples) -> Samples:
    """Driver accelerations from the equation of motion M q'' = Q - c, drives idle."""
    drivers = mechanism.drivers
    idle = [f"{d}.drive_by_reduction" for d in drivers]  # c - Q, at q'' = 0
    masses = [f"{drivers[0]}.J_red"] if len(drivers) == 1 else ["mechanism.M"]
    plan = mechanism.plan((*idle, *masses), friction="none")
    values, engine = mechanism.evaluate(plan, samples)
    settings = {"friction": "none", "tolerance": None, "iterations": None, "static": False}
    found = Result(mechanism, plan, samples, values, engine, settings)
    rest = np.stack([found[name] for name in idle], axis=-1)
    M = found[masses[0]]
    if len(drivers) == 1:
        qdd = -rest / M[:, None]
    else:
        qdd = np.linalg.solve(M, -rest[:, :, None])[:, :, 0]
    inputs = dict(samples.inputs)
    for i in range(len(drivers)):
        inputs[f"qdd_{i}"] = np.ascontiguousarray(qdd[:, i])
    return Samples(samples.n, inputs, samples.times)


def _column(times: Any) -> Array | None:
    if times is None:
        return None
    column = np.atleast_1d(np.asarray(times, dtype=np.float64))
    if column.ndim != 1 or not len(column) or not np.isfinite(column).all() or column.min() < 0:
        raise RequestError(
            Problem(
                "bad-request",
                "times",
                "not a row of finite times from 0 s on",
                "",
                "give times like 0:2:201",
            )
        )
    return column
