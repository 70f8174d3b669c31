"""Runge-Kutta of order 4 with a fixed step: for teaching and for checks of order.

Nothing is adapted and nothing refined. The end is met by a last, shorter step, found by
secants on its length; the error estimate is that of halving the number of steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.equation import Equation
from blockmech.dynamics.legs import FINEST
from blockmech.dynamics.motion import INTERRUPTED, State, Status
from blockmech.dynamics.reduced import TURN
from blockmech.dynamics.until import Start, Until

MOST_STEPS = 2_000_000
SECANTS = 30

Y = tuple[float, float, float]
Row = tuple[float, float, float, float]


class Vector(tuple[float, ...]):
    """Three floats that a right-hand side for arrays can read."""

    __slots__ = ()

    def tolist(self) -> tuple[float, ...]:
        """The floats."""
        return self


class Fixed(NamedTuple):
    """Steps of a run: arrays (n,)."""

    t: Floats
    q: Floats
    qd: Floats
    qdd: Floats
    end: str
    status: Status

    def state(self, t: Floats) -> State:
        """State at times (m,) [s] between the steps, by cubic Hermite interpolation."""
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, max(self.t.size - 2, 0))
        if self.t.size < 2:
            return State(np.full(t.shape, self.q[0]), np.full(t.shape, self.qd[0]))
        h = self.t[i + 1] - self.t[i]
        x = (t - self.t[i]) / h
        q = _hermite(x, h, self.q[i], self.q[i + 1], self.qd[i], self.qd[i + 1])
        qd = _hermite(x, h, self.qd[i], self.qd[i + 1], self.qdd[i], self.qdd[i + 1])
        return State(q, qd)


def _hermite(x: Floats, h: Floats, a: Floats, b: Floats, da: Floats, db: Floats) -> Floats:
    left, right = h * da - (b - a), (b - a) - h * db
    return np.asarray(a + x * (b - a) + x * (1 - x) * ((1 - x) * left + x * right))


def stepped(equation: Equation, start: Start, until: Until, h: float) -> Fixed:
    """Fixed steps h [s] from the start to the goal."""
    y = Vector((start.q, start.rate, 0.0))
    rows = [(start.t, y[0], y[1], float(equation.rhs(start.t, y)[1]))]
    end, status = INTERRUPTED, "ended"
    with suppress(KeyboardInterrupt):  # what is done so far is kept
        end, status = _walked(equation.rhs, start, until, h, rows)
    times, q, qd, qdd = (np.array(column) for column in zip(*rows, strict=True))
    return Fixed(times, q, qd, qdd, end, status)  # type: ignore[arg-type]


def _walked(rhs: Any, start: Start, until: Until, h: float, rows: list[Row]) -> tuple[str, Status]:
    """Add a row (t, q, q', q'') for each step; what the walk ended with."""
    t_end = start.t + until.value if until.goal == "time" else math.inf
    surface = _goal(start, until)
    t, y = start.t, Vector((start.q, start.rate, 0.0))
    stops = 0
    for n in range(1, MOST_STEPS + 1):
        here = h if start.t + n * h <= t_end * (1 + 1e-15) else t_end - t
        new = _step(rhs, t, y, here)
        if not math.isfinite(new[1]):
            return "impossible pose", "failed"
        met = surface is not None and n > 1 and surface(y) * surface(new) <= 0 != surface(new)
        if met or (surface is not None and surface(new) == 0):
            assert surface is not None
            here, new = _shortened(rhs, t, y, here, surface)
            stops += 1
            t, y = t + here, new
            if until.goal in ("standstill", "swings"):
                y = Vector((y[0], 0.0, y[2]))
            rows.append((t, y[0], y[1], float(rhs(t, y)[1])))
            wanted = int(until.value) if until.goal == "swings" else 1
            if stops >= wanted:
                return until.goal, "reached"
            continue
        ahead = start.t + n * h if here == h and stops == 0 else t + here
        slope = float(rhs(ahead, new)[1])
        if not math.isfinite(slope):
            return "impossible pose", "failed"
        t, y = ahead, new
        rows.append((t, y[0], y[1], slope))
        if t >= t_end:
            return "time", "reached"
    return f"more than {MOST_STEPS} steps", "failed"


def _goal(start: Start, until: Until) -> Callable[[Any], float] | None:
    goal, value = until.goal, until.value
    if goal in ("standstill", "swings"):
        return lambda y: float(y[1])
    if goal == "angle":
        return lambda y: float(y[0]) - value
    if goal == "turns":
        return lambda y: abs(float(y[0]) - start.q) - value * TURN
    return None


def _step(rhs: Any, t: float, y: Any, h: float) -> Vector:
    a = rhs(t, y)
    b = rhs(t + h / 2, Vector(u + h / 2 * k for u, k in zip(y, a, strict=True)))
    c = rhs(t + h / 2, Vector(u + h / 2 * k for u, k in zip(y, b, strict=True)))
    d = rhs(t + h, Vector(u + h * k for u, k in zip(y, c, strict=True)))
    return Vector(
        u + h / 6 * (k1 + 2 * (k2 + k3) + k4)
        for u, k1, k2, k3, k4 in zip(y, a, b, c, d, strict=True)
    )


def _shortened(
    rhs: Any, t: float, y: Any, h: float, surface: Callable[[Any], float]
) -> tuple[float, Vector]:
    """The step that ends on the surface: Illinois secants on its length."""
    low, high = 0.0, h
    f_low, f_high = surface(y), surface(_step(rhs, t, y, h))
    x, side = h, 0
    for _ in range(SECANTS):
        x = (low * f_high - high * f_low) / (f_high - f_low)
        f = surface(_step(rhs, t, y, x))
        if abs(f) <= FINEST * (abs(f_low) + abs(f_high)):
            break
        if (f > 0) == (f_high > 0):
            high, f_high = x, f
            f_low, side = (f_low / 2 if side == 1 else f_low), 1
        else:
            low, f_low = x, f
            f_high, side = (f_high / 2 if side == -1 else f_high), -1
    return x, _step(rhs, t, y, x)
