"""LSODA without its wrapper: for runs to a given time that nothing interrupts.

`scipy.integrate.odeint` stays in compiled code between evaluations, so a step costs
little more than its right-hand sides. It keeps no dense output; times asked for later
are reached by running again, which gives the same numbers because the steps do not
depend on the outputs: the first one is given, LSODA would fit it to the first output.
Where it gives up, the states it did not come to are no numbers, and the run is left to the
wrapped one.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import INTERRUPTED
from blockmech.dynamics.integration.integrate import Ending, Run, Task, balance
from blockmech.dynamics.integration.legs import FINEST, Leg, scales
from blockmech.dynamics.motion import Event
from blockmech.errors import Problem, RequestError

GRID = 65  # outputs among which standstills are looked for
MOST_STEPS = 100_000  # between two outputs
FIRST = 0.5  # step at first, of that at which its square is the tolerance
MOST_KEPT = 100_000  # times whose states are remembered
LEFT_BEHIND = Problem(
    "left-behind",
    "motion.at",
    "a motion by LSODA was pickled with the states at those times only that had been asked for",
    "",
    'ask motion.at(t) before it is pickled, or simulate with method="dop853"',
)
POLISH = 6  # Newton steps for a standstill


def uninterrupted(task: Task) -> bool:
    """Whether nothing can end the run before its time."""
    system = task.system
    if system is None or task.until.goal != "time" or task.watches or task.time_knots:
        return False
    stopped = any(np.isfinite(stop) for stop in system.stops)
    return not (system.knots or stopped or task.equation.margin is not None)


def replayed(task: Task, tolerance: float) -> Run | None:
    """One LSODA run to the time asked for, or None where LSODA gives up."""
    count, latest = 0, task.t0
    right = task.equation.rhs

    def rhs(t: float, y: Any) -> Any:
        nonlocal count, latest
        count += 1
        latest = t
        return right(t, y)

    def solve(times: Floats) -> Floats:
        return _solved(task, rhs, task.y0, times, tolerance)

    grid = np.linspace(task.t0, task.t_max, GRID)
    ended: tuple[Ending, str] = ("reached", "time")
    try:
        y = solve(grid)
    except KeyboardInterrupt:  # the same again, up to where it came
        grid, ended = np.linspace(task.t0, latest, GRID), ("ended", INTERRUPTED)
        if latest <= task.t0:
            raise
        y = _solved(task, right, task.y0, grid, tolerance)
    evaluations = count
    end = y[-1]
    if not np.isfinite(y).all():
        return None
    dense = _Again(grid, y, solve)
    leg = Leg(task.t0, float(grid[-1]), end, dense, (), False, 0.0, grid[:-1])
    return Run(
        drivers=1,
        legs=(leg,),
        events=tuple(_standstills(task, rhs, grid, y, tolerance)),
        status=ended[0],
        end=ended[1],
        t_end=float(grid[-1]),
        y_end=end,
        evaluations=evaluations,
        balance=balance(task, end, float(np.abs(y[:, -1]).max())),
    )


@dataclass
class _Again:
    """Dense output: states that are known, and others by running again.

    times : (n,) [s] growing
    states : (n, 3) at them
    solve : times (n,) from the first on -> states; None where it was left behind
    """

    times: Floats
    states: Floats
    solve: Callable[[Floats], Floats] | None

    def __call__(self, times: Floats) -> Floats:
        place = np.searchsorted(self.times, times).clip(max=self.times.size - 1)
        if not np.array_equal(self.times[place], times):
            if self.solve is None:
                raise RequestError(LEFT_BEHIND)
            # between outputs it may take so many steps only
            outputs = np.union1d(self.times, times)
            states, place = self.solve(outputs), np.searchsorted(outputs, times)
            if outputs.size <= MOST_KEPT and np.isfinite(states).all():
                self.times, self.states = outputs, states
            return np.asarray(states[place].T)
        return np.asarray(self.states[place].T)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled with what is known: the right-hand side cannot be."""
        return _Again, (self.times, self.states, None)


def _solved(task: Task, rhs: Any, y0: Floats, times: Floats, tolerance: float) -> Floats:
    """States (m, n) at growing times, the first of which is that of y0.

    NaN where LSODA gave up: it leaves what it did not come to as the memory was.
    """
    from scipy.integrate import odeint

    rtol, atol = scales(task.equation, task.y0, tolerance)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the states are looked at instead
        found, info = odeint(
            rhs,
            y0,
            times,
            rtol=rtol,
            atol=atol,
            tfirst=True,
            h0=FIRST * math.sqrt(max(tolerance, FINEST)) / task.equation.speed,
            mxstep=MOST_STEPS,
            full_output=True,
        )
    if info["message"] != "Integration successful.":
        found[1:] = np.nan
    return np.asarray(found)


def _standstills(task: Task, rhs: Any, grid: Floats, y: Floats, tolerance: float) -> list[Event]:
    """Changes of sign of the rate between outputs, by Newton's method in time."""
    found = []
    rate = y[:, 1]
    for i in np.flatnonzero(rate[:-1] * rate[1:] < 0).tolist():
        t, state = float(grid[i]), y[i]
        low, high = t, float(grid[i + 1])
        guess = float(low + (high - low) * rate[i] / (rate[i] - rate[i + 1]))
        for _ in range(POLISH):
            state = _solved(task, rhs, y[i], np.array([low, guess]), tolerance)[-1]
            acceleration = rhs(guess, state)[1]
            step = float(state[1]) / acceleration if acceleration else 0.0
            if not math.isfinite(step):
                break
            t = min(max(guess - step, low), high)
            if abs(t - guess) <= 1e-15 * (1 + abs(t)):
                break
            guess = t
        found.append(Event("standstill", guess, float(state[0]), 0.0))
    return found
