"""Dead centres between the ends of steps.

In time the motion through a dead centre is smooth: the driver turns back there, its kinetic
energy all in the other links. Steps that are long enough pass it, and both their ends are
possible poses; the same holds for a change point, where the margin touches zero. So from
step to step the margin is watched, and where it has been lowest between two ends of steps it
is looked at there. At a turning point energy tells: none is left at a standstill.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from blockmech.dynamics.ends import DEAD_CENTRE, IMPOSSIBLE, LEAST_MARGIN
from blockmech.dynamics.integration.equation import Equation
from blockmech.dynamics.integration.legs import Ask, Hit

HIGH = 0.5  # margin from which on nothing is looked for
NEAR = 0.1  # margin of a turning point above which it is a standstill
FOUND = 1e-2  # margin up to which what was found is a dead centre, and not a spoilt step
KEPT = 0.5  # share of the kinetic energy that a standstill does not leave
FINE = 1e-4  # of the interval: where the lowest margin is
HALVINGS = 50

State = Callable[[float], Any]


class Dead(NamedTuple):
    """A dead centre met: when [s], and the state there."""

    t: float
    y: Any


class Dips:
    """Looks for a dead centre after each step; one for each leg.

    Cost: the margin at the end of a step (a pose that is known there), some ten poses where
    the margin has been lowest.
    """

    def __init__(self, equation: Equation, t: float, y: Any) -> None:
        self.drivers = equation.drivers
        margin = equation.margin
        assert margin is not None
        self.margin = margin
        self.energy = equation.kinetic(y) - float(y[-1])  # with the work of the loads, K
        self.ends = [(t, self.margin(y), y)]  # of the last two steps

    def within(self, t: float, y: Any, state: State) -> Dead | None:
        """A dead centre in the last two steps, which end at (t, y); else None.

        ``state`` gives states between; times (float) [s].
        """
        now = self.margin(y)
        ends = [*self.ends, (t, now, y)]
        self.ends = ends[-2:]
        rising = not now <= ends[-2][1]
        if len(ends) == 2:
            falls = rising and self.margin(state(ends[0][0] + FINE * (t - ends[0][0]))) < ends[0][1]
        else:
            falls = ends[-2][1] <= ends[-3][1]
        if not (rising and falls) or min(m for _, m, _ in ends) > HIGH:
            return None
        return self._looked_at(ends[0], ends[-1], state)

    def _looked_at(
        self, low: tuple[float, float, Any], high: tuple[float, float, Any], state: State
    ) -> Dead | None:
        from scipy.optimize import minimize_scalar

        a, b = low[0], high[0]

        def value(t: float) -> float:
            m = self.margin(state(t))
            return m if math.isfinite(m) else 0.0

        t = float(
            minimize_scalar(
                value, bounds=(a, b), method="bounded", options={"xatol": FINE * (b - a)}
            ).x
        )
        if value(t) <= LEAST_MARGIN:
            t = last_above(value, LEAST_MARGIN, a, t)
            return Dead(t, state(t)) if value(t) <= FOUND else None
        if self.drivers > 1 or value(t) > NEAR or low[2][1] * high[2][1] >= 0:
            return None
        left, before, after = (self.energy + float(y[-1]) for y in (state(t), low[2], high[2]))
        if not left > KEPT * max(before, after):
            return None
        sign = math.copysign(1.0, low[2][1])
        t = last_above(lambda x: sign * float(state(x)[1]), 0.0, a, b)
        return Dead(t, state(t))


def last_above(value: Callable[[float], float], least: float, low: float, high: float) -> float:
    """Between a time [s] at which a value is larger than ``least`` and one at which it is not."""
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if not low < middle < high:
            break
        if value(middle) > least:
            low = middle
        else:
            high = middle
    return low


def cut_at(
    dead: Dead | None, ask: Ask, hits: list[Hit], found: list[Hit]
) -> tuple[list[Hit], list[Hit]]:
    """Surfaces met before and in the last step, as far as a dead centre lets the motion come."""
    if dead is None:
        return hits, found
    surface = next(s for s in ask.surfaces if s.kind == DEAD_CENTRE)
    last = dead.t - 1e-9 * (dead.t - ask.t)  # turning there is no standstill
    before = [hit for hit in found if hit.t < last]
    return [hit for hit in hits if hit.t < last], [*before, Hit(surface, dead.t, dead.y)]


def named_gap(margin: Callable[[float], float], good: float, bad: float) -> str:
    """What is between a driver coordinate where the mechanism closes and one where it does not.

    "dead centre" if the margin goes to zero, else "impossible pose". ``margin`` is that of a
    coordinate, NaN where nothing closes.
    """
    for _ in range(2 * HALVINGS):
        middle = (good + bad) / 2
        if middle in (good, bad):
            break
        if margin(middle) > 0:
            good = middle
        else:
            bad = middle
    return DEAD_CENTRE if margin(good) <= LEAST_MARGIN else IMPOSSIBLE


def touches_zero(margin: Callable[[float], float], low: float, high: float) -> bool:
    """Whether the margin goes to zero between two driver coordinates and comes back."""
    from scipy.optimize import minimize_scalar

    fine = {"xatol": FINE * (high - low)}
    found = minimize_scalar(margin, bounds=(low, high), method="bounded", options=fine)
    return not margin(float(found.x)) > LEAST_MARGIN
