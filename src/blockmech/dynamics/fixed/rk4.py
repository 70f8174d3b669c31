"""Runge-Kutta of order 4 with a fixed step: for teaching and for checks of order.

Nothing is adapted and nothing refined. The end is met by a last, shorter step, found by
secants on its length; the error estimate is that of halving the number of steps. Only where
a step would end at no pose it is halved: the walk goes on to the dead centre, and names it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import DEAD_CENTRE, END_STOP, IMPOSSIBLE, INTERRUPTED, LEAST_MARGIN
from blockmech.dynamics.integration.dips import Dips, named_gap
from blockmech.dynamics.integration.equation import Equation
from blockmech.dynamics.integration.legs import FINEST
from blockmech.dynamics.motion import State, Status
from blockmech.dynamics.system.reduced import TURN
from blockmech.dynamics.until import Start, Until

MOST_STEPS = 2_000_000
SECANTS = 30
NEARLY = 2 * LEAST_MARGIN  # margin of a state that is at a dead centre
SAME = 1e-9  # of a step: times that are one
SHORTER = 40  # halvings of a step on the way to where there is no pose
SHORT = 1000  # steps that are shorter because of it, within one whole step
STUCK = "the step became too small"
PROBES = 32  # coordinates ahead of where no step can be made

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
        x = (t - self.t[i]) / np.where(h > 0, h, 1.0)
        q = _hermite(x, h, self.q[i], self.q[i + 1], self.qd[i], self.qd[i + 1])
        qd = _hermite(x, h, self.qd[i], self.qd[i + 1], self.qdd[i], self.qdd[i + 1])
        return State(q, qd)


def _hermite(x: Floats, h: Floats, a: Floats, b: Floats, da: Floats, db: Floats) -> Floats:
    left, right = h * da - (b - a), (b - a) - h * db
    return np.asarray(a + x * (b - a) + x * (1 - x) * ((1 - x) * left + x * right))


def stepped(
    equation: Equation,
    start: Start,
    until: Until,
    h: float,
    parts: int = 1,
    stops: tuple[float, float] = (-math.inf, math.inf),
    most: int = MOST_STEPS,
) -> Fixed:
    """Fixed steps h [s] from the start to the goal, or to an end stop (low, high).

    ``most``: steps after which it is given up.

    ``parts``: into how many each step is divided that is shorter because there is no pose
    ahead; runs that are compared have it in proportion to 1/h.
    """
    y = Vector((start.q, start.rate, 0.0))
    rows = [(start.t, y[0], y[1], float(equation.rhs(start.t, y)[1]))]
    end, status = INTERRUPTED, "ended"
    with suppress(KeyboardInterrupt):  # what is done so far is kept
        end, status = _Walk(equation, start, until, h, parts, stops).walked(rows, most)
    times, q, qd, qdd = (np.array(column) for column in zip(*rows, strict=True))
    return Fixed(times, q, qd, qdd, end, status)  # type: ignore[arg-type]


class _Walk:
    """One walk in steps h [s], from a start to a goal or to where there is no pose.

    Before such a place steps are halved until they are possible. What is possible does not
    depend on the step asked for, and runs with other steps would be the same there; so each
    such step is made in ``parts``.
    """

    def __init__(
        self,
        equation: Equation,
        start: Start,
        until: Until,
        h: float,
        parts: int,
        bounds: tuple[float, float],
    ) -> None:
        assert equation.margin is not None
        self.right, self.margin, self.equation = equation.rhs, equation.margin, equation
        self.goal, self.h, self.parts, self.bounds = until.goal, h, parts, bounds
        self.stops = 0
        self.wanted = int(until.value) if until.goal == "swings" else 1
        self.t_end = start.t + until.value if until.goal == "time" else math.inf
        self.surface = _goal(start, until)
        self.known: tuple[float, Any, Any] = (math.nan, None, None)
        self.begin(start.t, Vector((start.q, start.rate, 0.0)))

    def begin(self, t: float, y: Vector) -> None:
        """Begin here: nothing before is looked at any more."""
        self.t0, self.t, self.y, self.n = t, t, y, 0  # n whole steps since t0
        self.last = [(t, y)] * 2  # where the last two steps began
        self.dips = Dips(self.equation, t, y)

    def rhs(self, t: float, y: Any) -> Any:
        """The right-hand side; that of the state last asked for is remembered."""
        if self.known[1] is not y or self.known[0] != t:
            self.known = t, y, self.right(t, y)
        return self.known[2]

    def row(self) -> Row:
        """Where it is now."""
        t, y = self.t, self.y
        return t, y[0], y[1], float(self.rhs(t, y)[1])

    def walked(self, rows: list[Row], most: int) -> tuple[str, str]:
        """Add a row (t, q, q', q'') for each step; what the walk ended with.

        It comes to an end: between two whole steps there are no more than `SHORT` short ones
        and `SHORTER` halvings, each step makes rows, and those are counted.
        """
        longest = self.h  # step that is possible here
        short = 0
        while len(rows) <= most:
            target = self.t0 + (self.n + 1) * self.h
            late = target > self.t_end * (1 + 1e-15)
            target = self.t_end if late else target
            shortened = longest < self.h
            short += shortened
            if short > SHORT:
                return STUCK, "failed"
            if shortened and self.t + longest == self.t:  # as near as one can come
                return self.lies_ahead(), "ended"
            x = self.h if not (late or shortened) else min(longest, target - self.t)
            new = _step(self.rhs, self.t, self.y, x)
            last = target if x >= (target - self.t) * (1 - SAME) else self.t + x
            end = None
            if self.sound(x, new, shortened):
                end = self.in_parts(last, rows) if shortened else self.made(last, new, rows)
            if end is None:
                longest = x / 2
                if longest < self.h / 2**SHORTER or self.margin(self.y) <= NEARLY:
                    return self.lies_ahead(), "ended"
                continue
            if end:
                return end, "reached" if end == self.goal else "ended"
            if self.t >= self.t_end:
                return "time", "reached"
            if self.t >= target:
                self.n, longest, short = self.n + 1, self.h, 0
        return f"more than {most} steps", "failed"

    def sound(self, x: float, new: Vector, shortened: bool) -> bool:
        """Whether a step x [s] from here has come to a pose, and not been thrown there."""
        if not self.possible(self.t + x, new):
            return False
        straight, bent = x * self.y[1], x * x * self.row()[3]
        return not shortened or abs(new[0] - self.y[0] - straight) <= abs(straight) + abs(bent)

    def possible(self, t: float, y: Vector) -> bool:
        """Whether a state is one of the mechanism, and not at a dead centre, or leaves one."""
        good = math.isfinite(y[1]) and math.isfinite(float(self.rhs(t, y)[1]))
        return good and self.margin(y) > min(LEAST_MARGIN, self.margin(self.y))

    def in_parts(self, t: float, rows: list[Row]) -> str | None:
        """Go to a time [s] in parts; what the walk ended with, if it did.

        None where a part is not possible, though the whole is.
        """
        begin, n = self.t, self.n
        for i in range(1, self.parts + 1):
            ahead = begin + (t - begin) * i / self.parts
            new = _step(self.rhs, self.t, self.y, ahead - self.t)
            if not self.possible(ahead, new):
                return None
            end = self.made(ahead, new, rows)
            if end or self.n < n:
                return end
        return ""

    def made(self, ahead: float, new: Vector, rows: list[Row]) -> str:
        """Make a step to a state; what the walk ended with, if it did."""
        t, y = self.t, self.y
        self.last = [self.last[-1], (t, y)]
        dead = self.dips.within(ahead, new, self.state)
        met = [(*_shortened(self.rhs, t, y, ahead - t, f), f) for f in self.met(new)]
        if met:
            x, at, surface = min(met, key=lambda each: each[0])
            if dead is None or t + x < dead.t - SAME * (ahead - t):
                stopped = surface is not self.surface
                if not stopped and self.goal in ("standstill", "swings"):
                    at = Vector((at[0], 0.0, at[2]))
                self.stops += not stopped
                self.begin(t + x, at)
                rows.append(self.row())
                return END_STOP if stopped else self.goal if self.stops >= self.wanted else ""
        if dead is not None:
            while len(rows) > 1 and rows[-1][0] >= dead.t:
                rows.pop()
            ahead, new = dead
        self.t, self.y = ahead, new
        rows.append(self.row())
        return "" if dead is None else DEAD_CENTRE

    def met(self, new: Vector) -> list[Callable[[Any], float]]:
        """The surfaces of goal and end stops that are met on the way to a state."""
        found, value = [], self.surface
        if value is not None:
            after = value(new)
            if after == 0 or (self.t > self.t0 and value(self.y) * after <= 0):
                found.append(value)
        for stop, way in zip(self.bounds, (-1, 1), strict=True):
            if way * (new[0] - stop) > 0 >= way * (self.y[0] - stop):  # met from inside
                found.append(_coordinate(stop))
        return found

    def state(self, t: float) -> Vector:
        """The state at a time within the last two steps."""
        begin, y = self.last[-1 if t >= self.last[-1][0] else 0]
        return _step(self.rhs, begin, y, t - begin)

    def lies_ahead(self) -> str:
        """What is ahead of a state from which no step can be made."""
        q, rate, _ = self.y
        if self.margin(self.y) <= NEARLY:
            return DEAD_CENTRE

        def margin(q: float) -> float:
            there = Vector((q, 0.0, 0.0))
            return self.margin(there) if math.isfinite(self.rhs(self.t, there)[1]) else math.nan

        way = 2 * rate * self.h / PROBES
        for i in range(1, PROBES + 1):
            if not margin(q + i * way) > 0:
                return named_gap(margin, q + (i - 1) * way, q + i * way)
        return IMPOSSIBLE


def _goal(start: Start, until: Until) -> Callable[[Any], float] | None:
    goal, value = until.goal, until.value
    if goal in ("standstill", "swings"):
        return lambda y: float(y[1])
    if goal == "angle":
        return _coordinate(value)
    if goal == "turns":
        return lambda y: abs(float(y[0]) - start.q) - value * TURN
    return None


def _coordinate(q: float) -> Callable[[Any], float]:
    """The driver's distance from a coordinate."""
    return lambda y: float(y[0]) - q


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
