r"""Method ``euler_q``: the scheme of the paper, in equal steps of the driver's coordinate.

Grid q_i = q0 + sg i D. With J and tau on the grid and J one point ahead,

    xi_i = (tau_i - w_i^2/2 (J_{i+1} - J_i)/d) / J_i,     d = sg D           ([D14] Eq. 2)
    w_{i+1}^2 = w_i^2 + 2 xi_i d
    dt = 2 D / (w_i + w_{i+1})

and the last step ends exactly where w^2 reaches zero at constant xi. First order in
energy, in the end angle and in time, whatever is done within a step, because dJ/dq is a
forward difference. After a standstill it starts again there, the other way. Where w^2 falls
below zero though the loads alone would leave energy, J grows without bound: a dead centre is
ahead, and the march ends with its name.

Source: [D14] Durango et al. 2014.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import DEAD_CENTRE, INTERRUPTED
from blockmech.dynamics.integration.dips import NEAR, named_gap, touches_zero
from blockmech.dynamics.motion import State, Status
from blockmech.dynamics.system.reduced import TURN, Metered, feasible
from blockmech.dynamics.until import Start, Until

BLOCKS = (512, 8192)  # grid points sampled at once: at first, at most
MOST_STEPS = 5_000_000
LOOK = 3  # steps: J doubles within one where a dead centre is no farther than two


class Grid(NamedTuple):
    """Grid points passed: times, coordinates, rates (n,), and how it ended."""

    t: Floats
    q: Floats
    qd: Floats
    stops: tuple[int, ...]  # indices of the standstills
    end: str
    status: Status

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]: constant acceleration between grid points."""
        if self.t.size < 2:
            return State(np.full(t.shape, self.q[0]), np.full(t.shape, self.qd[0]))
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, self.t.size - 2)
        h = self.t[i + 1] - self.t[i]
        x = t - self.t[i]
        acceleration = np.where(h > 0, (self.qd[i + 1] - self.qd[i]) / np.where(h > 0, h, 1), 0.0)
        return State(
            self.q[i] + x * (self.qd[i] + x * acceleration / 2), self.qd[i] + x * acceleration
        )


def stepped(meter: Metered, start: Start, until: Until, step: float) -> Grid:
    """March on the grid of spacing ``step`` [rad or m] until the goal."""
    t, q, w2 = start.t, start.q, start.rate**2
    direction = math.copysign(1.0, start.rate or meter.one(start.q, 0.0, start.t).tau)
    times, places, rates, stops = [t], [q], [start.rate], list[int]()
    goal = _Goal(start, until)
    left = MOST_STEPS
    while left > 0:
        into: tuple[list[float], list[float], list[float]] = ([], [], [])
        try:
            swing = _swing(meter, t, q, w2, direction, step, goal, left, into)
        except KeyboardInterrupt:  # what is done so far is kept
            n = len(into[2])  # the last row may be without its rate
            t_rows, q_rows, qd_rows = (column[:n] for column in into)
            swing = _Swing(t_rows, q_rows, qd_rows, INTERRUPTED, "ended")
        left -= len(swing.t) + 1
        times += swing.t
        places += swing.q
        rates += swing.qd
        if swing.end != "standstill":
            return _grid(times, places, rates, stops, swing.end, swing.status)
        stops.append(len(times) - 1)
        if len(stops) >= goal.stops:
            return _grid(times, places, rates, stops, until.goal, "reached")
        if not swing.t:
            return _grid(times, places, rates, stops, "rest", "ended")
        t, q, w2, direction = times[-1], places[-1], 0.0, -direction
    return _grid(times, places, rates, stops, f"more than {MOST_STEPS} steps", "failed")


class _Goal:
    """When the march is over."""

    def __init__(self, start: Start, until: Until) -> None:
        goal, value = until.goal, until.value
        self.name = goal
        self.t_end = start.t + value if goal == "time" else math.inf
        wanted = {"swings": value, "standstill": 1.0}
        self.stops = wanted.get(goal, math.inf)
        self.targets: tuple[float, ...] = ()
        if goal == "angle":
            self.targets = (value,)
        elif goal == "turns":
            self.targets = (start.q - value * TURN, start.q + value * TURN)


class _Swing(NamedTuple):
    t: list[float]
    q: list[float]
    qd: list[float]
    end: str
    status: Status


def _swing(
    meter: Metered,
    t: float,
    q0: float,
    w2: float,
    direction: float,
    step: float,
    goal: _Goal,
    most: int,
    into: tuple[list[float], list[float], list[float]],
) -> _Swing:
    """From one standstill (or the start) to the next, or to the goal; rows go to ``into``."""
    times, places, rates = into

    def done(end: str, status: Status) -> _Swing:
        return _Swing(times, places, rates, end, status)

    d = direction * step
    first, block = 0, BLOCKS[0]
    q = q0
    while first < most:
        grid = np.asarray(q0 + d * np.arange(first, first + block + 1), dtype=np.float64)
        sample = meter.sample(grid)
        good = feasible(sample)
        J, tau = sample.J.tolist(), sample.tau.tolist()
        touching = _touching(meter, grid, sample.margin)
        good[1:-1] &= ~touching
        count = block if good.all() else max(int(np.argmin(good)) - 1, 0)
        for i in range(count):
            xi = (tau[i] - w2 / 2 * (J[i + 1] - J[i]) / d) / J[i]
            new = w2 + 2 * xi * d
            if new <= 0:
                length = -w2 / (2 * xi) if xi else 0.0
                if J[i] * w2 / 2 + tau[i] * d > 0:  # no load stops it, but J that grows
                    name = _ahead(meter, q, d)
                    if name:
                        return done(name, "ended")
                if w2 <= 0:
                    return done("standstill", "reached")
                times.append(t + 2 * abs(length) / math.sqrt(w2))
                places.append(q + length)
                rates.append(0.0)
                if times[-1] > goal.t_end:
                    return _cut(done("time", "reached"), t, q, direction * math.sqrt(w2), xi, goal)
                return done("standstill", "reached")
            before = t, q, direction * math.sqrt(w2)
            t += 2 * step / (math.sqrt(w2) + math.sqrt(new))
            w2 = new
            q = q0 + d * (first + i + 1)
            times.append(t)
            places.append(q)
            rates.append(direction * math.sqrt(w2))
            if t >= goal.t_end:
                return _cut(done("time", "reached"), *before, xi, goal)
            for target in goal.targets:
                if (before[1] - target) * (q - target) <= 0 and before[1] != target:
                    return _landed(done(goal.name, "reached"), *before, xi, target)
        if not good.all():
            first = int(np.argmin(good))
            if 0 < first <= touching.size and touching[first - 1]:
                return done(DEAD_CENTRE, "ended")
            return done(named_gap(_margin(meter), q, float(grid[first])), "ended")
        first, block = first + block, min(2 * block, BLOCKS[1])
    return done(f"more than {MOST_STEPS} steps", "failed")


def _margin(meter: Metered) -> Callable[[float], float]:
    """The margin of a coordinate, NaN where the mechanism does not close."""

    def margin(q: float) -> float:
        one = meter.pose(q)
        closes = one.margin > 0 and one.J > 0 and math.isfinite(one.J) and math.isfinite(one.tau)
        return one.margin if closes else math.nan

    return margin


def _touching(meter: Metered, grid: Floats, margin: Floats) -> NDArray[np.bool_]:
    """Inner grid points (n - 2,) beside which the margin goes to zero and comes back."""
    lowest = (margin[1:-1] < NEAR) & (margin[1:-1] <= margin[:-2]) & (margin[1:-1] <= margin[2:])
    for i in np.flatnonzero(lowest).tolist():
        low, high = sorted((float(grid[i]), float(grid[i + 2])))
        lowest[i] = touches_zero(_margin(meter), low, high)
    return np.asarray(lowest)


def _ahead(meter: Metered, q: float, d: float) -> str:
    """What ends the motion within the next steps, if anything does."""
    margin = _margin(meter)
    for i in range(1, LOOK + 1):
        if not margin(q + i * d) > 0:
            return named_gap(margin, q + (i - 1) * d, q + i * d)
    return ""


def _cut(swing: _Swing, t: float, q: float, w: float, xi: float, goal: _Goal) -> _Swing:
    """The last step, ended at the time asked for at its constant acceleration."""
    x = goal.t_end - t
    swing.t[-1], swing.q[-1] = goal.t_end, q + x * (w + x * xi / 2)
    swing.qd[-1] = w + x * xi
    return swing


def _landed(swing: _Swing, t: float, q: float, w: float, xi: float, target: float) -> _Swing:
    """The last step, ended at the coordinate asked for."""
    rate = math.copysign(math.sqrt(max(w * w + 2 * xi * (target - q), 0.0)), w or target - q)
    swing.t[-1] = t + 2 * (target - q) / (w + rate)
    swing.q[-1], swing.qd[-1] = target, rate
    return swing


def _grid(
    t: list[float], q: list[float], qd: list[float], stops: list[int], end: str, status: Status
) -> Grid:
    return Grid(np.array(t), np.array(q), np.array(qd), tuple(stops), end, status)
