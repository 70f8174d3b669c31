"""Simulate: a mechanism moves under its loads, and everything else follows from that.

The reduced system carries the motion; the wanted outputs are then computed at the
output times through the same pruned plan as any other run. A request that asks for
the driver's motion alone computes no acceleration and no reaction.

Sources: [D14] Durango et al. 2014, Fig. 1 and section 2.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.knots import time_knots_of
from blockmech.dynamics.methods import move
from blockmech.dynamics.motion import Motion
from blockmech.dynamics.reduced import Metered, ReducedSystem, ReducedSystems
from blockmech.dynamics.reduction import refuse_friction
from blockmech.dynamics.until import Start, Until, Watch
from blockmech.errors import Problem, RequestError, listed
from blockmech.result import Result
from blockmech.samples import Samples

if TYPE_CHECKING:
    from blockmech.mechanism import Mechanism

Array = NDArray[np.float64]
Starts = Mapping[str, tuple[float, float]]
OUTPUTS = 201  # output times where none are named
LATEST = 1e3  # [s] up to which kinks in time are listed for a run without an end in time
SETTINGS = {"friction": "none", "tolerance": None, "iterations": None, "static": False}


def simulate(
    mechanism: Mechanism,
    until: str | Until | None = None,
    *,
    method: str = "auto",
    accuracy: float | None = None,
    step: float | None = None,
    times: Sequence[float] | Array | None = None,
    start: Starts | None = None,
    stops: Mapping[str, tuple[float, float]] | None = None,
    watch: Sequence[Watch] = (),
    want: Iterable[str] | str = ("*.q", "*.rate"),
    friction: str | None = None,
) -> Result:
    """Move a mechanism from its start until something ends the run.

    Parameters
    ----------
    until : "standstill" (default), "swings=3", "turns=3", "time=2", "angle=6.28",
        "steady" or "event"; with ``times`` and without ``until`` the last of them
    method : "auto", "energy", "spectral", "dop853", "lsoda", "radau", "rk4", "euler_q"
    accuracy : target [rad or m] of the driver coordinate at all times
    step : of the fixed-step methods: time [s] for rk4, driver coordinate for euler_q
    times : (n,) output times [s]; by default 201 over the whole run
    start : driver -> (q [rad or m], rate); by default the scene's ``initial``
    stops : the only driver -> (lowest, highest) coordinate, end stops [rad or m]
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
        if friction is not None:
            raise _error("friction", f'"{friction}" is not computed in motion', 'only "none"')
        refuse_friction(mechanism.frictional_joints)
    wanted = _column(times)
    goal = _goal(until, wanted)
    starts = _starts(mechanism, start)
    how = _How(method, accuracy, step, tuple(watch), () if wanted is None else wanted)
    motion = _moved(mechanism, starts, goal, how, stops)
    if wanted is None:
        wanted = motion.times(OUTPUTS if motion.t_end > motion.t_start else 1)
    inside = (wanted >= motion.t_start) & (wanted <= motion.t_end)
    if not inside.all():
        late = int(np.count_nonzero(~inside))
        note = f"{late} of {len(wanted)} times after the end are left out"
        motion = replace(motion, notes=(*motion.notes, note))
        wanted = wanted[inside] if inside.any() else np.array([motion.t_end])
    return result_along(mechanism, motion, wanted, want)


def _goal(until: str | Until | None, times: Array | None) -> Until:
    if until is None:
        return Until("time", float(times.max())) if times is not None else Until("standstill")
    return Until.parse(until) if isinstance(until, str) else until


def _starts(mechanism: Mechanism, start: Starts | None) -> Starts:
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


class _How(NamedTuple):
    """The last arguments of `move`, in its order."""

    method: str
    accuracy: float | None
    step: float | None
    watch: tuple[Watch, ...]
    times: Any


def _moved(
    mechanism: Mechanism,
    starts: Starts,
    goal: Until,
    how: _How,
    stops: Mapping[str, tuple[float, float]] | None,
) -> Motion:
    """The motion of the drivers by the method asked for."""
    reduced = mechanism.reduced
    if "time" in reduced.depends_on:
        latest = goal.value if goal.goal == "time" else LATEST
        reduced = replace(reduced, time_knots=time_knots_of(mechanism.structure, latest))
    if isinstance(reduced, ReducedSystem):
        ((driver, (q, rate)),) = starts.items()
        if stops:
            reduced = replace(reduced, stops=_stops(driver, q, stops))
        return move(Metered(reduced), Start(q, rate), goal, *how)
    if stops:
        raise _error("stops", "several drivers have no end stops", "watch= an event in their place")
    assert isinstance(reduced, ReducedSystems)
    q0, qd0 = (np.array([pair[i] for pair in starts.values()], dtype=float) for i in (0, 1))
    return move(reduced, (q0, qd0), goal, *how)


def _stops(driver: str, q: float, stops: Mapping[str, tuple[float, float]]) -> tuple[float, float]:
    if set(stops) != {driver}:
        raise _error("stops", f"for {listed(stops)}", f"the driver is {driver}")
    low, high = stops[driver]
    if not low <= q <= high:
        raise _error("stops", f"the start {q:.9g} is not within [{low:.9g}, {high:.9g}]", "")
    return float(low), float(high)


class Along(Mapping[str, Any]):
    """Inputs of a program along a motion; accelerations are found when they are asked for."""

    def __init__(self, mechanism: Mechanism, motion: Motion, t: Array) -> None:
        q, qd = motion.at(t)
        self._mechanism, self._t = mechanism, t
        self._given: dict[str, Any] = {}
        many = q.ndim > 1
        for i in range(len(mechanism.drivers)):
            self._given[f"q_{i}"] = np.ascontiguousarray(q[:, i]) if many else q
            self._given[f"qd_{i}"] = np.ascontiguousarray(qd[:, i]) if many else qd
        self._names = (*self._given, *(f"qdd_{i}" for i in range(len(mechanism.drivers))))

    def __getitem__(self, name: str) -> Any:
        if name in self._given:
            return self._given[name]
        if name not in self._names:
            raise KeyError(name)
        return self._accelerations[int(name.removeprefix("qdd_"))]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    @cached_property
    def _accelerations(self) -> list[Array]:
        """q'' (n,) of each driver from M q'' = Q - c, the drives idle."""
        mechanism, n = self._mechanism, len(self._t)
        drivers = mechanism.drivers
        rest = {f"qdd_{i}": np.zeros(n) for i in range(len(drivers))}
        idle = [f"{d}.drive_by_reduction" for d in drivers]  # c - Q, at q'' = 0
        mass = f"{drivers[0]}.J_red" if len(drivers) == 1 else "mechanism.M"
        plan = mechanism.plan((*idle, mass), friction="none")
        samples = Samples(n, {**self._given, **rest}, self._t)
        values, engine = mechanism.evaluate(plan, samples)
        found = Result(mechanism, plan, samples, values, engine, SETTINGS)
        if len(drivers) == 1:
            return [-found[idle[0]] / found[mass]]
        right = -np.stack([found[name] for name in idle], axis=-1)
        M = found[mass]
        good = np.isfinite(M).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
        qdd = np.full(right.shape, np.nan)
        qdd[good] = np.linalg.solve(M[good], right[good][:, :, None])[:, :, 0]
        return [np.ascontiguousarray(column) for column in qdd.T]


def result_along(
    mechanism: Mechanism, motion: Motion, t: Array, want: Iterable[str] | str
) -> Result:
    """The wanted outputs at times (n,) [s] of a motion."""
    plan = mechanism.plan(want, friction="none")
    samples = Samples(len(t), Along(mechanism, motion, t), t)
    values, engine = mechanism.evaluate(plan, samples)
    return Result(mechanism, plan, samples, values, engine, SETTINGS, motion)


def _column(times: Any) -> Array | None:
    if times is None:
        return None
    try:
        column = np.atleast_1d(np.asarray(times, dtype=np.float64))
    except (TypeError, ValueError):
        raise _error("times", "not a row of numbers", "give times like 0:2:201") from None
    if column.ndim != 1 or not len(column) or not np.isfinite(column).all() or column.min() < 0:
        found = "not a row of finite times from 0 s on"
        raise _error("times", found, "give times like 0:2:201")
    return column


def _error(where: str, found: str, remedy: str) -> RequestError:
    return RequestError(Problem("bad-request", where, found, "", remedy))
