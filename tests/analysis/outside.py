"""Free motions by a method that `simulate` does not have, in extended precision.

Gragg's midpoint rule extrapolated (Hairer, Norsett & Wanner, Solving ODEs I, II.9) to order 20
on M q'' = -drive(q, q', 0): the acceleration comes from the force pass, which no method of
`simulate` asks. Where long double is wider than double the answers hold a few digits more than
any of those methods can; `doubt` measures how many, by another step and another order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import blockmech as bm
from blockmech.engines.numpy import NumpyEngine
from blockmech.mechanism import Mechanism
from tests.dynamics import machines

GRAPHS = Path(__file__).parents[2] / "graphs"
REAL = np.longdouble
ORDER = 10  # columns of the extrapolation table; the order is twice that


class Moving(NamedTuple):
    """A free motion of a graph: its end, the judge's steps, and its start if not the file's."""

    until: float  # [s]
    steps: int
    start: tuple[float, float] | None = None

    @property
    def request(self) -> dict[str, Any]:
        """Times at which it is judged, and the end."""
        return {"until": f"time={self.until!r}", "times": self.times}

    @property
    def times(self) -> list[float]:
        """[s]"""
        return [self.until * part for part in (0.2, 0.4, 0.6, 0.8, 1.0)]


MOTIONS = {
    "andrews_squeezer": Moving(0.03, 160),
    "engine": Moving(0.1, 1),
    "excavator": Moving(0.2, 10),
    "fivebar_falling": Moving(0.5, 20),
    "floating_drive_press": Moving(0.02, 10, (0.6, 0.05)),
    "n_four_bar": Moving(0.5, 1),
    "oldham_coupling": Moving(1.0, 5, (0.4, 20.0)),
    "parallelogram_chain": Moving(0.2, 5, (0.4, 3.0)),
    "pump": Moving(0.5, 60),
    "ruiz_fourbar": Moving(1.0, 200, (0.4, 10.0)),
    "scissor_lift": Moving(0.1, 10, (1.8, 0.06)),
    "scotch_yoke": Moving(0.05, 10, (0.4, 10.0)),
    "stephenson_2_class_4": Moving(0.1, 20, (0.4, 10.0)),
    "stephenson_3": Moving(1.0, 40, (0.4, 5.0)),
    "stephenson_3_triad": Moving(0.1, 10, (0.4, 10.0)),
    "toggle_press": Moving(0.03, 100, (0.4, 6.0)),
    "watt_sixbar": Moving(1.0, 20),
}
"""Graphs whose links have inertia; the others cannot move freely."""


@cache
def mechanism(name: str) -> Mechanism:
    """A graph of the gallery, compiled."""
    return bm.Graph.load(GRAPHS / f"{name}.json").compile()


def start(name: str) -> dict[str, tuple[float, float]]:
    """Driver -> (q [rad or m], rate) from which the graph's motion starts."""
    mech = mechanism(name)
    given = MOTIONS[name].start
    if given is not None:
        return {mech.drivers[0]: given}
    if mech.scene.initial:
        return {d: (x.q, x.rate) for d, x in mech.scene.initial.items()}
    return {d: (law.start, law.rate) for d, law in mech.scene.drive.items()}


class Judged(NamedTuple):
    """Coordinates and rates (times, drivers) of a motion, and how sure they are."""

    q: Any
    rate: Any
    doubt: float  # [rad or m], and relative to the largest rate


@cache
def judged(name: str) -> Judged:
    """The motion of a graph at its times, by this module or by the tests' own solver."""
    moving = MOTIONS[name]
    times = moving.times
    if name == "engine":  # its gas force has kinks, at which the tests' solver ends its steps
        found = machines.engine([0.0, *times])
        return Judged(found.q[1:], found.rate[1:], 1e-11)
    if name == "n_four_bar":  # in closed form
        angle, rate = machines.n_four_bar(times)
        return Judged(angle[:, None], rate[:, None], 1e-14)
    slope = acceleration(mechanism(name))
    begin = np.array(list(start(name).values()), dtype=REAL).T
    fine, coarse = (
        extrapolated(slope, begin, times, steps, order)
        for steps, order in ((moving.steps, ORDER), (max(1, round(0.8 * moving.steps)), ORDER - 1))
    )
    gap = np.abs(fine - coarse).max(axis=(0, 2))
    largest = np.abs(fine[:, 1]).max()
    return Judged(fine[:, 0], fine[:, 1], float(max(gap[0], gap[1] / largest)))


def acceleration(mech: Mechanism) -> Callable[[Any], Any]:
    """q'' (drivers, m) of an idle mechanism at m states (2, drivers, m), in extended precision."""
    drivers = mech.drivers
    mass = f"{drivers[0]}.J_red" if len(drivers) == 1 else "mechanism.M"
    plan = mech.plan([*(f"{d}.drive" for d in drivers), mass], friction="none")
    engine = NumpyEngine(plan.program, "clongdouble")
    n = len(drivers)

    def slope(state: Any) -> Any:
        many = state.shape[-1]
        given = {"t": np.zeros(many)}
        for i in range(n):
            given |= {f"q_{i}": state[0, i], f"qd_{i}": state[1, i]}
            given[f"qdd_{i}"] = np.zeros(many, dtype=REAL)
        values = engine.run(given, many)
        drive = [values[plan.layout[f"{d}.drive"][0]] for d in drivers]
        M = [values[i] for i in plan.layout[mass]]
        return solved(M, [-x for x in drive])

    return slope


def solved(M: Sequence[Any], b: Sequence[Any]) -> Any:
    """M x = b for a symmetric positive matrix, its rows one after another; by elimination."""
    n = len(b)
    A, x = [list(M[n * i : n * (i + 1)]) for i in range(n)], list(b)
    for p in range(n):
        for i in range(p + 1, n):
            share = A[i][p] / A[p][p]
            A[i] = [a - share * c for a, c in zip(A[i], A[p], strict=True)]
            x[i] = x[i] - share * x[p]
    for p in reversed(range(n)):
        for k in range(p + 1, n):
            x[p] = x[p] - A[p][k] * x[k]
        x[p] = x[p] / A[p][p]
    return np.array(x, dtype=REAL)


def extrapolated(
    slope: Callable[[Any], Any], begin: Any, times: Sequence[float], steps: int, order: int
) -> Any:
    """States (times, 2, drivers) from a beginning (2, drivers), so many steps in all."""
    h_wanted = times[-1] / steps

    counts = np.array([2 * j for j in range(1, order + 1)], dtype=REAL)

    def rate(y: Any) -> Any:
        return np.array([y[1], slope(y)], dtype=REAL)

    def midpoints(y: Any, h: Any) -> list[Any]:
        """The end of the step by 2, 4, 6 ... midpoint steps, all of them side by side."""
        small = h / counts
        a = np.repeat(y[:, :, None], order, axis=2)
        b = a + small * rate(y[:, :, None])
        for n in range(1, 2 * order):
            more = n // 2  # the first sequence that is longer than n
            x = b[:, :, more:].copy()
            b[:, :, more:] = a[:, :, more:] + 2 * small[more:] * rate(x)
            a[:, :, more:] = x
        return [b[:, :, j] for j in range(order)]

    def ahead(y: Any, h: Any) -> Any:
        table: list[list[Any]] = []
        for j, end in enumerate(midpoints(y, h), 1):
            row = [end]
            for k, before in enumerate(table[-1] if table else [], 1):
                row.append(row[-1] + (row[-1] - before) / ((REAL(j) / (j - k)) ** 2 - 1))
            table.append(row)
        return table[-1][-1]

    y, t, out = begin, REAL(0), []
    for wanted in times:
        n = math.ceil(float(wanted - t) / h_wanted * (1 - 1e-9))
        h = (REAL(wanted) - t) / n
        for _ in range(n):
            y = ahead(y, h)
        t = REAL(wanted)
        out.append(y)
    return np.array(out)


def error(name: str, run: bm.result.Result) -> float:
    """Error of the coordinates of a run at the motion's times [rad or m]; infinite if it ended."""
    wanted = judged(name)
    if run.n != len(wanted.q):
        return math.inf
    found = np.array([run[f"{d}.q"] for d in mechanism(name).drivers]).T
    return float(np.abs(found - wanted.q).max())


def error_of_all(name: str, run: bm.result.Result) -> float:
    """The same, and of the rates relative to the largest of each driver."""
    wanted = judged(name)
    coordinates = error(name, run)
    if not math.isfinite(coordinates):
        return coordinates
    found = np.array([run[f"{d}.rate"] for d in mechanism(name).drivers]).T
    largest = np.abs(wanted.rate).max(axis=0)
    return max(coordinates, float((np.abs(found - wanted.rate) / largest).max()))
