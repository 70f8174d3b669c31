r"""How the end of a motion changes with its beginning: the variational equation.

    Y' = A(t) Y,   Y(0) = 1,      A = df/dx along the motion,      M = Y(T)

is linear, so it is solved panel by panel by collocation at Chebyshev nodes, on panels that
are halved until the series of A have ended. A comes from differences of the right-hand
side at single states: unlike differences of whole motions they are not spoilt by how
strongly a motion bends within them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats, rule
from blockmech.dynamics.integration.integrate import Run
from blockmech.dynamics.steady.flow import Flow

NODES = 12
STEPS = (1.5e-4, 1e-5)  # of difference quotients, in scales; the second near the range's end
PLAIN, EXACT = 1e-5, 1e-11  # end of the series of A, relative: for a step of Newton's, and all
CORRECTIONS = 2  # of the states in a panel
LEVELS = 7  # halvings of the first panels
FALLS, NOISE = 0.3, 1e-6  # share of a series' end that halving leaves if it is noise, and its size
LONGEST = 1 / 4  # of a leg: the first panels


class Variation(NamedTuple):
    """Changes in units of a scale.

    M : (2k, 2k) of the end by the beginning
    fading : [-] det M, by Liouville's formula exp(integral of the trace of A)
    growth : largest change of a coordinate on the way
    """

    M: Floats
    fading: float
    growth: float


def variation(flow: Flow, runs: Sequence[Run], scale: Floats, tail: float) -> Variation:
    """The variation of a motion, given by runs that follow one another.

    Raises `numpy.linalg.LinAlgError` where the right-hand side has no slope.
    """
    k = flow.drivers
    Y = np.eye(2 * k)
    growth, volume = 1.0, 0.0
    exact = tail <= EXACT
    for run in runs:
        for leg in run.legs:
            step = (leg.t1 - leg.t0) * LONGEST
            edges = [leg.t0 + i * step for i in range(round(1 / LONGEST))]
            todo = [(t, t + step, 0, np.inf) for t in reversed(edges)] if step > 0 else []
            x = _states(run, np.array([leg.t0]))[0] if exact else None
            while todo:
                low, high, level, before = todo.pop()
                A, end = _panel(flow, run, (low, high), x, scale)
                left = _tail(A)
                noise = left > FALLS * before and left <= NOISE
                if level < LEVELS and left > tail and not noise:
                    middle = (low + high) / 2
                    todo += [(middle, high, level + 1, left), (low, middle, level + 1, left)]
                    continue
                x = end
                traces = np.trace(A, axis1=1, axis2=2)
                volume += (high - low) / 2 * float(rule(NODES).total @ traces)
                inside, Y = _solved(A, high - low, Y)
                growth = max(growth, float(np.abs(inside[:, :k]).max()))
    return Variation(Y, math.exp(min(volume, 700.0)), growth)


def _states(run: Run, times: Floats) -> Floats:
    return np.column_stack(run.state(times))


def _panel(
    flow: Flow,
    run: Run,
    ends: tuple[float, float],
    x: Floats | None,
    scale: Floats,
) -> tuple[Floats, Floats | None]:
    """A at the nodes of a panel, (n, 2k, 2k), and the state at its end from that at its start.

    Dense output is poorer than the steps of a run, so states at the nodes are corrected by
    the integral equation that holds on the panel; without ``x`` they are not.
    """
    r, half = rule(NODES), (ends[1] - ends[0]) / 2
    times = ends[0] + 2 * half * r.low
    clock = times.tolist()
    states = _states(run, times)
    A = _all_slopes(flow, clock, states, scale)
    if x is None:
        return A, None
    for _ in range(CORRECTIONS):
        rates = _all_rates(flow, clock, states)
        left = (x + half * (rates.T @ r.integrate).T - states) / scale
        states = (
            states + np.linalg.solve(_matrix(A, half), left.ravel()).reshape(left.shape) * scale
        )
    A = _all_slopes(flow, clock, states, scale)
    return A, x + half * (_all_rates(flow, clock, states).T @ r.total)


def _all_slopes(flow: Flow, clock: list[float], states: Floats, scale: Floats) -> Floats:
    flow.count(NODES * 8 * flow.drivers)
    found = np.array([_slopes(flow, t, y, scale) for t, y in zip(clock, states, strict=True)])
    if not np.isfinite(found).all():
        raise np.linalg.LinAlgError("no slope")
    return found


def _all_rates(flow: Flow, clock: list[float], states: Floats) -> Floats:
    flow.count(NODES)
    return np.array([_rates(flow, t, y) for t, y in zip(clock, states, strict=True)])


def _rates(flow: Flow, t: float, x: Floats) -> Floats:
    return np.asarray(flow.equation.rhs(t, np.append(x, 0.0)), dtype=np.float64)[: x.size]


def _slopes(flow: Flow, t: float, x: Floats, scale: Floats) -> Floats:
    """df/dx (2k, 2k) at a state, differences of fourth order."""
    k = flow.drivers
    for step in STEPS:
        A = np.zeros((2 * k, 2 * k))
        A[:k, k:] = np.diag(scale[k:] / scale[:k])
        for i in range(2 * k):
            away = np.zeros(2 * k + 1)
            away[i] = step * scale[i]
            near, far = (
                _acceleration(flow, t, x, m * away) - _acceleration(flow, t, x, -m * away)
                for m in (1, 2)
            )
            A[k:, i] = (8 * near - far) / (12 * step) / scale[k:]
        if np.isfinite(A).all():
            break
    return A


def _acceleration(flow: Flow, t: float, x: Floats, away: Floats) -> Floats:
    k = flow.drivers
    y = np.append(x, 0.0) + away
    return np.asarray(flow.equation.rhs(t, y), dtype=np.float64)[k : 2 * k]


def _tail(A: Floats) -> float:
    """End of the series of A, relative to its largest term."""
    n = len(A)
    series = np.abs(A.reshape(n, -1).T @ rule(n).cosine)
    return float(series[:, -2:].max() / series.max())


def _solved(A: Floats, length: float, Y: Floats) -> tuple[Floats, Floats]:
    """Y at the nodes (n, 2k, 2k) and at the end of a panel."""
    n, d, _ = A.shape
    half = length / 2
    inside = np.linalg.solve(_matrix(A, half), np.tile(Y, (n, 1))).reshape(n, d, d)
    gained = np.asarray(np.einsum("j,jab,jbc->ac", rule(n).total, A, inside))
    return np.asarray(inside), Y + half * gained


def _matrix(A: Floats, half: float) -> Floats:
    """Of the integral equation of a panel, Y less the integral of A Y: (n d, n d)."""
    n, d, _ = A.shape
    integral = np.einsum("ji,jab->iajb", rule(n).integrate, A)
    return np.asarray(np.eye(n * d) - half * integral.reshape(n * d, n * d))
