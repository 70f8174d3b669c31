"""Integration with an honest error: the same run at finer tolerances until two agree.

The estimate is the largest difference between the last two runs (four times it where kinks
interrupt them), at twenty common times and at those asked for; the finer run is the answer.
Half of it would nearly always do, but the coarser run is good by luck now and then. Where
evaluations are counted (kernels), the tolerances are always the same ones, from the coarsest on, so
a looser target never costs more; on the table, where they are cheap, they begin near the
target.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.integrate import INTERRUPTED, TOO_MANY, Method, Run, Task, run
from blockmech.dynamics.legs import FINEST
from blockmech.dynamics.replay import replayed, uninterrupted

RATIO = 1 / 50
COARSEST = 1e-3
COMPARED = 20  # common times
GAIN = {"dop853": 1 / 50, "radau": 1 / 10, "lsoda": 1e-3}  # tolerance for a target, roughly


class Refined(NamedTuple):
    """The finest run, its error and what it took."""

    run: Run
    error: float  # of the coordinate [rad or m]
    time_error: float  # of the end, where an event ended the run [s]
    tolerance: float
    reached: bool


def tolerances(method: Method, accuracy: float, counted: bool) -> Iterator[float]:
    """Tolerances to try, one after the other, down to what SciPy accepts."""
    tolerance = COARSEST
    if not counted:
        tolerance = max(accuracy * GAIN[method], FINEST / RATIO)
    while tolerance > FINEST:
        yield tolerance
        tolerance *= RATIO
    yield FINEST


def refined(task: Task, method: Method, accuracy: float, times: Floats) -> Refined:
    """Runs at finer and finer tolerances until the estimate meets the target."""
    counted = task.equation.source == "kernels"
    once: Callable[[float], Run] = lambda tolerance: run(task, method, tolerance)  # noqa: E731
    if method == "lsoda" and uninterrupted(task):
        once = lambda tolerance: replayed(task, tolerance)  # noqa: E731
    before: Run | None = None
    best = None
    for tolerance in tolerances(method, accuracy, counted):
        now = once(tolerance)
        if now.end == INTERRUPTED:
            return _interrupted(best, before, now, tolerance)
        if before is not None:
            error, time_error = _difference(before, now, times)
            floor = task.equation.table_error
            share = 4.0 if _kinked(task) else 1.0
            error, time_error = share * error, share * time_error
            best = Refined(now, error + floor, time_error, tolerance, error + floor <= accuracy)
            if best.reached or now.end == TOO_MANY:
                return best
        before = now
    if best is None:
        assert before is not None
        best = Refined(before, math.inf, math.inf, FINEST, False)
    return best


def _interrupted(best: Refined | None, before: Run | None, now: Run, tolerance: float) -> Refined:
    """What is left of an interrupted run: the finest whole one, else as far as it came."""
    kept = best or Refined(before or now, math.inf, math.inf, tolerance, False)
    run = kept.run
    if run.end != INTERRUPTED:
        run = replace(run, status="ended", end=INTERRUPTED)
    return kept._replace(run=run, reached=False)


def _kinked(task: Task) -> bool:
    """Whether kinks interrupt the run: landing on them is not better at finer tolerances."""
    return bool(task.time_knots) or (task.system is not None and bool(task.system.knots))


def _difference(coarse: Run, fine: Run, times: Floats) -> tuple[float, float]:
    """Largest difference of the coordinates [rad or m], and of the ends [s]."""
    if coarse.status == "failed" or fine.status == "failed" or coarse.end != fine.end:
        return math.inf, math.inf
    start, end = fine.legs[0].t0, min(coarse.t_end, fine.t_end)
    common = np.linspace(start, end, COMPARED + 1)[1:]
    asked = times[(times >= start) & (times <= end)]
    t = np.concatenate([common, asked])
    a, b = coarse.state(t).q, fine.state(t).q
    difference = float(np.abs(a - b).max())
    k = fine.drivers
    if coarse.t_end != fine.t_end:
        difference = max(difference, float(np.abs(coarse.y_end[:k] - fine.y_end[:k]).max()))
    return difference, abs(coarse.t_end - fine.t_end)
