"""The flow: where a state is after a while.

States are x = (q, q'), arrays (2k,) for k drivers. Every search for a steady state asks
the flow, so all its evaluations are counted, limited and reported here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import INTERRUPTED, TOO_MANY
from blockmech.dynamics.integration.equation import Equation
from blockmech.dynamics.integration.integrate import Method, Run, Task, run
from blockmech.dynamics.steady.outcome import Lost, Spent
from blockmech.dynamics.system.reduced import ReducedSystem
from blockmech.dynamics.until import Progress, Until, Watch

EVERY = 128  # right-hand sides between two reports
LOOSE = 1e-8  # tolerance of a transient and of the search of a map
ROUGH = 1e-10  # of Newton's method
FINE = 3e-13  # of the run that the finest one is compared with
SAMPLES = 33  # times of a period at which its size is looked at


@dataclass
class Flow:
    """The flow of one scene, and the evaluations that a search may still take.

    how : what the search is called while it reports
    ends : end stops of several drivers; one driver's are its system's
    """

    equation: Equation
    system: ReducedSystem | None
    method: Method
    t0: float
    knots: tuple[float, ...]
    most: int
    how: str
    progress: Progress | None = None
    ends: tuple[Watch, ...] = ()
    used: int = 0

    def __post_init__(self) -> None:
        self.equation = self._reporting(self.equation)

    @property
    def drivers(self) -> int:
        """Number of drivers k."""
        return self.equation.drivers

    def towards(
        self,
        x: Floats,
        until: Until,
        tolerance: float,
        watches: Sequence[Watch] = (),
        most: int | None = None,
    ) -> Run:
        """A run from a state; ``most`` evaluations are not an error but its end."""
        left = self.most - self.used
        if left <= 0:
            raise Spent
        y0 = np.concatenate([x, [0.0]])
        seen = (*watches, *self.ends)
        task = Task(self.equation, self.system, y0, self.t0, until, seen, self.knots, 0.0)
        found = run(task, self.method, tolerance, min(left, most or left))
        self.used += found.evaluations
        if found.end == INTERRUPTED:
            raise KeyboardInterrupt
        if found.end == TOO_MANY and self.used >= self.most:
            raise Spent
        return found

    def after(self, x: Floats, T: float, tolerance: float, count: int = 1) -> tuple[Run, ...]:
        """Runs through ``count`` times T [s], each from the same time on, one after another.

        Raises `Lost` where the motion ends on the way.
        """
        runs: list[Run] = []
        for _ in range(count):
            done = self.towards(x, Until("time", T), tolerance)
            if done.end != "time":
                raise Lost(done.end, done.t_end + len(runs) * T)
            runs.append(done)
            x = state_at_end(done)
        return tuple(runs)

    def count(self, evaluations: int) -> None:
        """Evaluations made elsewhere. Raises `Spent` where there were too many."""
        self.used += evaluations
        if self.used >= self.most:
            raise Spent

    def _reporting(self, equation: Equation) -> Equation:
        progress, right = self.progress, equation.rhs
        if progress is None:
            return equation
        count = 0

        def rhs(t: float, y: Any) -> Any:
            nonlocal count
            count += 1
            if count % EVERY == 0:
                progress(self.how, float(count), None)
            return right(t, y)

        return replace(equation, rhs=rhs)


def state_at_end(done: Run) -> Floats:
    """(2k,) state at the end of a run."""
    return np.asarray(done.y_end[: 2 * done.drivers])


def sampled(runs: Sequence[Run], T: float, t0: float) -> Floats:
    """(m, 2k) states at equidistant times of runs that follow one another."""
    times = t0 + np.linspace(0.0, T, SAMPLES)
    rows = []
    for done in runs:
        q, qd = done.state(times)
        rows.append(np.column_stack([q, qd]))
    return np.concatenate(rows)


def size_of(states: Floats, rotary: Sequence[bool], span: float) -> Floats:
    """(2k,) size of a motion: the range of q, at most a radian, and the largest rate."""
    k = states.shape[1] // 2
    far = np.ptp(states[:, :k], axis=0)
    for i, turns in enumerate(rotary):
        far[i] = min(far[i], 1.0) if turns else far[i]
    far = np.maximum(far, 1e-6 * span)
    fast = np.abs(states[:, k:]).max(axis=0)
    return np.concatenate([far, np.maximum(fast, 1e-9 * max(fast.max(), span))])
