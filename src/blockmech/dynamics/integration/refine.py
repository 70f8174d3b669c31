"""Integration with an honest error: the same run at finer tolerances until two agree.

The finer run of the last two is the answer, and their difference at twenty common times, at
those asked for and inside the widest steps tells its error. Usually a fiftieth of it would do,
but now and then the coarser run is good by luck, or steps are so long that the error is larger
between the times compared. Over thousands of runs from random starts the error was at most 4.6
times the first difference, 3.9 times a later one, and 1.6 times at tolerances below 1e-9 (4.2
times by LSODA, at loose ones once 8.1 times); the estimate is 6, 5 and 2 (LSODA: 18, 15, 6)
times the difference, or a fiftieth of the one before if that is more. Where the differences
fall no longer it is the first again. Two runs of the same steps, or of a step or two, would
tell nothing, so each takes shorter ones than the one before, and some. What both share, the
rounding and the table's error, grows near a separatrix and from beside an unstable
equilibrium: that is followed along the run (`disturbance`) and added.

Where evaluations are counted (kernels), the tolerances are always the same ones, from the
coarsest on, so a looser target never costs more; on the table, where they are cheap, they
begin near the target.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import INTERRUPTED, TOO_MANY
from blockmech.dynamics.integration.disturbance import grown
from blockmech.dynamics.integration.integrate import Method, Run, Task, run
from blockmech.dynamics.integration.legs import FINEST
from blockmech.dynamics.integration.replay import replayed, uninterrupted

RATIO = 1 / 50
COARSEST = 1e-3
COMPARED = 20  # common times
WIDEST, WITHIN = 3, 0.4  # of the widest steps, and where in them: no root of an interpolant
FEW = {"dop853": 6, "radau": 10, "lsoda": 10}  # steps
GAIN = {"dop853": 1 / 50, "radau": 1 / 10, "lsoda": 4e-4}  # tolerance for a target, roughly
NEAR = 7  # root of the ratio
# tolerance from which on steps are so long that times between them matter
LOOSE = {"dop853": 1e-9, "radau": 1e-9, "lsoda": 1e-11}
FIRST, LATER = 6.0, 5.0  # times the difference: the error that is stated
DARING = 3.0  # times that for LSODA, whose steps are as long as it dares
TIGHT = {"dop853": 2.0, "radau": 2.0, "lsoda": 6.0}  # the same at tolerances below that
ROUGH = {"dop853": 1.0, "radau": 1.0, "lsoda": 8.0}  # rounding: LSODA differences its past
FALLS = 1 / 50  # of the difference before, which is the error two runs ago
SHORTER = 0.7  # longest step, of that before: from runs of the same steps nothing is learnt
KINKED = 4.0  # times that: landing on kinks is not better at finer tolerances


class Refined(NamedTuple):
    """The finest run, its error and what it took."""

    run: Run
    error: float  # of the coordinate [rad or m]
    time_error: float  # of the end, where an event ended the run [s]
    tolerance: float
    reached: bool
    rounding: float = 0.0  # share of the error that no finer tolerance would remove


def tolerances(method: Method, accuracy: float, counted: bool) -> Iterator[float]:
    """Tolerances to try, one after the other, down to what SciPy accepts."""
    tolerance = COARSEST
    if not counted:
        tolerance = max(accuracy * GAIN[method], 20 * FINEST)
    while tolerance > NEAR * FINEST:  # two runs at almost the same tolerance tell nothing
        yield tolerance
        tolerance *= RATIO
    yield FINEST


def refined(task: Task, method: Method, accuracy: float, times: Floats) -> Refined:
    """Runs at finer and finer tolerances until the estimate meets the target, or one fails."""
    counted = task.equation.source == "kernels"
    before: Run | None = None
    best = None
    apart: list[tuple[float, float, float]] = []
    for tolerance in tolerances(method, accuracy, counted):
        now = _once(task, method, tolerance, before)
        if now.end == INTERRUPTED:
            return _interrupted(best, before, now, tolerance)
        if now.end == TOO_MANY and before is None:  # a finer run would not come as far
            return Refined(now, math.inf, math.inf, tolerance, False)
        if before is not None:
            apart.append(_difference(before, now, times))
            differences, delays, ways = zip(*apart, strict=True)
            error, time_error = (
                _stated(row, task, method, tolerance) for row in (differences, delays)
            )
            # a relative error of the effort acts on the whole way
            error += task.equation.table_error * max(1.0, ways[-1])
            # where evaluations ran out, another method than DOP853 may do it
            given_up = now.status == "failed" and (now.end != TOO_MANY or method == "radau")
            if given_up and best is not None and math.isfinite(best.error):
                return _with_rounding(task, method, best, accuracy)
            best = Refined(now, error, time_error, tolerance, False)
            told = now.steps >= FEW[method]  # two runs of a step or two may be wrong alike
            if (told and error <= accuracy) or now.end == TOO_MANY or tolerance == FINEST:
                best = _with_rounding(task, method, best, accuracy)
                if best.reached or now.end == TOO_MANY or best.rounding > accuracy:
                    return best
        before = now
    if best is None:
        assert before is not None
        best = Refined(before, math.inf, math.inf, FINEST, False)
    return best


def _once(task: Task, method: Method, tolerance: float, before: Run | None) -> Run:
    """A run at one tolerance, in shorter steps than the one before."""
    if method == "lsoda":
        found = replayed(task, tolerance) if uninterrupted(task) else None
        return found or run(task, method, tolerance)
    longest = math.inf if before is None else SHORTER * before.longest or math.inf
    return run(task, method, tolerance, longest=longest)


def _with_rounding(task: Task, method: Method, best: Refined, accuracy: float) -> Refined:
    """The run with what rounding does to it."""
    try:
        more = grown(task.equation, best.run)
    except KeyboardInterrupt:
        run = replace(best.run, status="ended", end=INTERRUPTED)
        return best._replace(run=run, rounding=math.inf)
    place, time = (ROUGH[method] * x for x in more)
    error = best.error + place
    return best._replace(
        error=error,
        time_error=best.time_error + time,
        reached=error <= accuracy,
        rounding=place,
    )


def _interrupted(best: Refined | None, before: Run | None, now: Run, tolerance: float) -> Refined:
    """What is left of an interrupted run: the finest whole one, else as far as it came."""
    kept = best or Refined(before or now, math.inf, math.inf, tolerance, False)
    run = kept.run
    if run.end != INTERRUPTED:
        run = replace(run, status="ended", end=INTERRUPTED)
    return kept._replace(run=run, reached=False)


def _stated(apart: Sequence[float], task: Task, method: Method, tolerance: float) -> float:
    """Error of the last run, at a tolerance, from the differences between runs."""
    before = apart[-2] if len(apart) > 1 and math.isfinite(apart[-2]) else 0.0
    usual = DARING if method == "lsoda" else 1.0
    times = (
        TIGHT[method]
        if tolerance < LOOSE[method]
        else usual * (FIRST if len(apart) == 1 else LATER)
    )
    if before and apart[-1] > before / NEAR:
        times = usual * FIRST
    return (KINKED if _kinked(task) else 1.0) * max(times * apart[-1], FALLS * before)


def _kinked(task: Task) -> bool:
    """Whether kinks interrupt the run."""
    return bool(task.time_knots) or (task.system is not None and bool(task.system.knots))


def _widest(run: Run) -> list[float]:
    """Times [s] within the steps in which a coordinate goes farthest: there it is known least."""
    middles, ways = [], []
    for leg in run.legs:
        edges = np.append(leg.marks, leg.t1)
        states = np.column_stack([leg.dense(leg.marks), leg.y1])  # known, at no cost
        ways += np.abs(np.diff(states[: run.drivers], axis=1)).max(axis=0).tolist()
        middles += (WITHIN * edges[1:] + (1 - WITHIN) * edges[:-1]).tolist()
    return [middles[i] for i in np.argsort(ways)[-WIDEST:].tolist()]


def _difference(coarse: Run, fine: Run, times: Floats) -> tuple[float, float, float]:
    """Largest difference of the coordinates [rad or m], that of the ends [s], and the way."""
    if coarse.status == "failed" or fine.status == "failed" or coarse.end != fine.end:
        return math.inf, math.inf, 0.0
    start, end = fine.legs[0].t0, min(coarse.t_end, fine.t_end)
    common = np.linspace(start, end, COMPARED + 1)[1:]
    asked = times[(times >= start) & (times <= end)]
    t = np.concatenate([common, asked, [x for x in _widest(coarse) if x <= end]])
    found = fine.state(t)
    difference = float(np.abs(coarse.state(t).q - found.q).max())
    way = float(np.abs(found.qd[:COMPARED]).sum()) * (end - start) / COMPARED
    k = fine.drivers
    if coarse.t_end != fine.t_end:
        difference = max(difference, float(np.abs(coarse.y_end[:k] - fine.y_end[:k]).max()))
    if not (math.isfinite(difference) and math.isfinite(way)):
        return math.inf, math.inf, 0.0
    return difference, abs(coarse.t_end - fine.t_end), way
