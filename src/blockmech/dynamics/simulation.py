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

from blockmech.dynamics.ends import DEAD_CENTRE, INTERRUPTED, TOO_MANY
from blockmech.dynamics.methods import move
from blockmech.dynamics.motion import Motion, Still
from blockmech.dynamics.request import (
    STOPS,
    goal_of,
    pairs_of,
    size_of,
    starts_of,
    times_of,
    watches_of,
)
from blockmech.dynamics.silent import told_of_loads
from blockmech.dynamics.steady.forcing import forcing_period
from blockmech.dynamics.stops import as_watches, held_at_start, named, stops_of
from blockmech.dynamics.system.knots import time_knots_of
from blockmech.dynamics.system.reduced import Cost, Metered, ReducedSystem, ReducedSystems
from blockmech.dynamics.system.reduction import refuse_friction
from blockmech.dynamics.system.split import period_of
from blockmech.dynamics.until import Progress, Start, Until, Watch
from blockmech.dynamics.watching import stopped_motion
from blockmech.engines.numpy import Planar
from blockmech.errors import Problem, RequestError
from blockmech.result import Result
from blockmech.samples import Samples

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

Array = NDArray[np.float64]
Starts = Mapping[str, tuple[float, float]]
OUTPUTS = 201  # output times where none are named
SINGULAR = 1e-10  # margin of a dead centre itself, but for rounding
PART = 1 << 16  # outputs computed between two places where an interruption keeps what is done
LATEST = 1e3  # [s] up to which kinks in time are listed for a run without an end in time
SETTINGS = {"friction": "none", "tolerance": None, "iterations": None, "static": False}


def simulate(
    mechanism: Compiled,
    until: str | Until | None = None,
    *,
    method: str = "auto",
    accuracy: float | None = None,
    step: float | None = None,
    times: Sequence[float] | Array | None = None,
    start: Starts | None = None,
    stops: Starts | None = None,
    watch: Sequence[Watch] = (),
    want: Iterable[str] | str = ("*.q", "*.rate"),
    friction: str | None = None,
    progress: Progress | None = None,
) -> Result:
    """Move a mechanism from its start until something ends the run.

    Parameters
    ----------
    until : "standstill" (default), "swings=3", "turns=3", "time=2", "angle=360deg",
        "steady" or "event"; with ``times`` and without ``until`` the last of them.
        "steady=<s>" names the period of loads that follow the time by a function
    method : "auto", "energy", "spectral", "dop853", "lsoda", "radau", "rk4", "euler_q"
    accuracy : target [rad or m] of the driver coordinate at all times
    step : of the fixed-step methods: time [s] for rk4, driver coordinate for euler_q
    times : (n,) output times [s]; by default 201 over the whole run
    start : driver -> (q [rad or m], rate); by default the scene's ``initial``
    stops : driver -> (lowest, highest) coordinate [rad or m]; by default the scene's
    watch : the user's events
    want : outputs at the output times
    friction : "none" leaves joint friction out; without it such a scene is refused
    progress : told now and then (what is at work, how far it is, the whole or None)

    Returns
    -------
    Result at the output times, with ``motion``: method and why, error estimate,
    events, cost, and what ended the run. Output times after the end are left out. An
    interrupted run (Ctrl-C) is returned as far as it came; its end is "interrupted".

    Raises
    ------
    RequestError where the scene has no start or one beyond an end stop, no inertia, joint
    friction that is not waived, the method does not apply, or a number cannot be
    """
    if friction != "none":
        if friction is not None:
            raise _error("friction", f'"{friction}" is not computed in motion', 'only "none"')
        refuse_friction(mechanism.frictional_joints)
    if progress is not None and not callable(progress):
        raise _error(
            "progress", f"{progress!r} cannot be called", "give a function, or leave it out"
        )
    wanted = times_of(times)
    goal = goal_of(until, wanted)
    starts = starts_of(mechanism, start)
    shown: Any = () if wanted is None else wanted
    if wanted is None and goal.goal == "time":
        shown = np.linspace(0.0, goal.value, OUTPUTS)  # what will be asked for
    target, size = size_of("accuracy", accuracy), size_of("step", step)
    how = _How(method, target, size, watches_of(watch, goal), shown, progress)
    motion = _moved(mechanism, starts, goal, how, pairs_of("stops", stops, STOPS))
    motion = replace(motion, notes=(*motion.notes, *_remarks(mechanism, motion, goal)))
    if wanted is None:
        wanted = motion.times(OUTPUTS if motion.t_end > motion.t_start else 1)
    inside = (wanted >= motion.t_start) & (wanted <= motion.t_end)
    if not inside.all():
        late = int(np.count_nonzero(~inside))
        note = f"{late} of {len(wanted)} times after the end are left out"
        motion = replace(motion, notes=(*motion.notes, note))
        wanted = wanted[inside] if inside.any() else np.array([motion.t_end])
    return result_along(mechanism, motion, wanted, want)


def _remarks(mechanism: Compiled, motion: Motion, goal: Until) -> list[str]:
    """What else a reader must know of how a run ended."""
    said = []
    if motion.end == TOO_MANY and goal.goal not in ("time", "steady"):
        met = f"{goal.goal} was not reached in {motion.t_end - motion.t_start:.6g} s"
        said.append(f'{met}, and perhaps never is: ask for "time=<s>" to see how it goes on')
    if goal.forcing and "time" not in mechanism.reduced.depends_on:
        said.append(f"no load follows the time: the period {goal.forcing:.9g} s is not used")
    return said


class _How(NamedTuple):
    """The last arguments of `move`, in its order."""

    method: str
    accuracy: float | None
    step: float | None
    watch: tuple[Watch, ...]
    times: Any
    progress: Progress | None


def _moved(
    mechanism: Compiled, starts: Starts, goal: Until, how: _How, stops: Starts | None
) -> Motion:
    """The motion of the drivers by the method asked for."""
    bounds = stops_of(mechanism.scene, mechanism.drivers, starts, stops)
    return told_of_loads(mechanism.of_blocks, _run(mechanism, starts, goal, how, bounds))


def _run(mechanism: Compiled, starts: Starts, goal: Until, how: _How, bounds: Starts) -> Motion:
    reduced = mechanism.reduced
    if "time" in reduced.depends_on:
        reduced = _timed(mechanism, reduced, goal)
    held = held_at_start(reduced, starts, bounds)
    if held is not None:
        return held
    try:
        if isinstance(reduced, ReducedSystem):
            return _one_moved(reduced, starts, goal, how, bounds)
        return _several_moved(reduced, mechanism.drivers, starts, goal, how, bounds)
    except KeyboardInterrupt:  # before there was anything but the start
        found = _stopped_at_once(starts)
        if goal.goal != "steady":
            return found
        return replace(found, notes=("interrupted before a steady state was found",))


def _timed(
    mechanism: Compiled, reduced: ReducedSystem | ReducedSystems, goal: Until
) -> ReducedSystem | ReducedSystems:
    """With kinks of the loads in time and, for a steady state, the periods of the loads."""
    structure = mechanism.structure
    latest = goal.value if goal.goal == "time" else LATEST
    if goal.goal == "steady":
        latest = forcing_period(structure, goal.forcing)
        reduced = replace(reduced, time_period=latest)
        if isinstance(reduced, ReducedSystems):
            rotary = [structure.driver_joint(d).rotary for d in mechanism.drivers]
            each = zip(mechanism.drivers, rotary, strict=True)
            periods = tuple(period_of(structure, d, turns) or 0.0 for d, turns in each)
            reduced = replace(reduced, periods=periods)
    return replace(reduced, time_knots=time_knots_of(structure, latest))


def _one_moved(
    reduced: ReducedSystem, starts: Starts, goal: Until, how: _How, stops: Starts
) -> Motion:
    ((driver, (q, rate)),) = starts.items()
    if driver not in stops:
        return move(Metered(reduced), Start(q, rate), goal, *how)
    reduced = replace(reduced, stops=stops[driver])
    return stopped_motion(move(Metered(reduced), Start(q, rate), goal, *how), stops[driver])


def _several_moved(
    reduced: ReducedSystems,
    drivers: tuple[str, ...],
    starts: Starts,
    goal: Until,
    how: _How,
    stops: Starts,
) -> Motion:
    q0, qd0 = (np.array([pair[i] for pair in starts.values()], dtype=float) for i in (0, 1))
    how = how._replace(watch=(*how.watch, *as_watches(drivers, stops)))
    motion = move(reduced, (q0, qd0), goal, *how)
    if motion.end in {named(driver) for driver in stops}:
        motion = replace(motion, status="ended")
    return motion


def _stopped_at_once(starts: Starts) -> Motion:
    """A run that was interrupted before its first step."""
    rows = np.array(list(starts.values()), dtype=float)
    q, qd = (float(rows[0, i]) if len(rows) == 1 else rows[:, i] for i in (0, 1))
    return Motion(
        method="none",
        why="",
        regime="none",
        status="ended",
        end=INTERRUPTED,
        t_start=0.0,
        t_end=0.0,
        q_end=q,
        qd_end=qd,
        track=Still(q, qd),
        events=(),
        error=0.0,
        time_error=0.0,
        accuracy=None,
        cost=Cost(),
    )


class Along(Mapping[str, Any]):
    """Inputs of a program along a motion; accelerations are found when they are asked for.

    ``unknown``: samples at which the rates of the drivers say nothing about other links.
    """

    def __init__(
        self, mechanism: Compiled, motion: Motion, t: Array, unknown: Any = slice(0)
    ) -> None:
        q, qd = motion.at(t)
        qd[unknown] = np.nan
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
        mechanism, n = self._mechanism.of_blocks, len(self._t)
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
    mechanism: Compiled, motion: Motion, t: Array, want: Iterable[str] | str
) -> Result:
    """The wanted outputs at times (n,) [s] of a motion.

    Interrupted, it gives them at the times until then, and says so.
    """
    plan = mechanism.plan(want, friction="none")
    parts: list[tuple[Any, ...]] = []
    engine, done = "numpy", 0
    try:
        for first in range(0, len(t), PART):
            part = t[first : first + PART]
            samples = Samples(len(part), Along(mechanism, motion, part), part)
            values, engine = mechanism.evaluate(plan, samples)
            parts.append(values)
            done += len(part)
    except KeyboardInterrupt:
        if not done:
            raise
        note = f"interrupted: outputs at the first {done} of {len(t)} times"
        motion = replace(motion, status="ended", end=INTERRUPTED, notes=(*motion.notes, note))
    samples = Samples(done, Along(mechanism, motion, t[:done]), t[:done])
    whole = parts[0] if len(parts) == 1 else tuple(map(_joined, zip(*parts, strict=True)))
    result = Result(mechanism, plan, samples, whole, engine, SETTINGS, motion)
    return _without_limits(result, whole) if motion.end == DEAD_CENTRE else result


def _without_limits(result: Result, whole: tuple[Any, ...]) -> Result:
    """The same without rates and forces in a dead centre itself, where the motion ends.

    There the rate of the driver, mostly zero, does not say how fast the others go.
    """
    mechanism, motion, t = result.mechanism, result.motion, result.time
    assert motion is not None
    assert t is not None
    margins = [np.broadcast_to(m, t.shape) for m in result.quality.margin.values()]
    if not margins:
        return result
    there = (t == motion.t_end) & (np.min(margins, axis=0) < SINGULAR)
    if not there.any():
        return result
    samples = Samples(result.n, Along(mechanism, motion, t, there), t)
    values, engine = mechanism.evaluate(result.plan, samples)
    rates = [mechanism.of_driver(d, "rate") for d in mechanism.drivers]
    known = {i for name in rates for i in result.plan.layout.get(name, ())}
    kept = tuple(whole[i] if i in known else x for i, x in enumerate(values))
    given = Samples(result.n, Along(mechanism, motion, t), t)
    return Result(mechanism, result.plan, given, kept, engine, SETTINGS, motion)


def _joined(pieces: tuple[Any, ...]) -> Any:
    """One value of a program from its values at parts of the samples."""
    if isinstance(pieces[0], Planar):
        real, imag = ([getattr(z, part) for z in pieces] for part in ("real", "imag"))
        return Planar(np.concatenate(real), np.concatenate(imag))
    return np.concatenate([np.atleast_1d(x) for x in pieces])


def _error(where: str, found: str, remedy: str) -> RequestError:
    return RequestError(Problem("bad-request", where, found, "", remedy))
