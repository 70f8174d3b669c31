"""Surfaces in state space at which an integration in time stops or takes note."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import DEAD_CENTRE, LEAST_INERTIA, LEAST_MARGIN, NO_INERTIA
from blockmech.dynamics.integration.equation import Equation
from blockmech.dynamics.until import Watch

Value: TypeAlias = Callable[[float, Any], float]

LOOKED_AT = (1e-7, 1e-5, 1e-3)  # steps, relative: how far it goes to tell where it leaves to
ON = 1e-12  # relative distance within which a state counts as on a surface


@dataclass(frozen=True)
class Surface:
    """A named function of time and state whose sign matters.

    kind : "standstill", "goal", "end stop", "dead centre", "knot", or a user's name
    direction : sign of the change that counts, 0 for both
    terminal : whether the integration stops there
    """

    kind: str
    value: Value
    direction: int = 0
    terminal: bool = True


def driver_at(kind: str, q: float, direction: int = 0) -> Surface:
    """The driver coordinate reaches q [rad or m]."""
    return Surface(kind, lambda t, y: float(y[0]) - q, direction)


def standstill(terminal: bool) -> Surface:
    """The driver stops."""
    return Surface("standstill", lambda t, y: float(y[1]), 0, terminal)


def near_dead_centre(equation: Equation) -> list[Surface]:
    """The margin falls to 1e-6, or the inertia to nothing; none where it never comes near."""
    margin, inertia = equation.margin, equation.inertia
    found = []
    if margin is not None:
        found.append(Surface(DEAD_CENTRE, lambda t, y: margin(y) - LEAST_MARGIN, -1))
    if inertia is not None:
        found.append(Surface(NO_INERTIA, lambda t, y: inertia(y) - LEAST_INERTIA, -1))
    return found


def watched(watch: Watch, k: int) -> Surface:
    """A user's event."""

    def value(t: float, y: Any) -> float:
        if k == 1:
            return watch.surface(t, float(y[0]), float(y[1]))
        return watch.surface(t, y[:k], y[k : 2 * k])

    return Surface(watch.name, value, watch.direction, watch.terminal)


def knots_around(q: float, knots: Sequence[float], period: float | None) -> list[Surface]:
    """The next knots above and below q, and the one it is on."""
    if not knots:
        return []
    if period is not None:
        turn = math.floor(q / period)
        knots = [k % period + period * (turn + n) for k in knots for n in (-1, 0, 1)]
    near = ON * max(1.0, abs(q))
    above = [k for k in knots if k > q + near]
    below = [k for k in knots if k < q - near]
    here = [k for k in knots if abs(k - q) <= near]
    chosen = ([min(above)] if above else []) + ([max(below)] if below else []) + here[:1]
    return [driver_at("knot", k) for k in chosen]


def hollows_around(
    q: float, hollows: Sequence[tuple[float, float]], period: float | None
) -> list[Surface]:
    """Ranges without inertia near q, met from outside: a step may pass the whole of one."""
    shifts = [0.0]
    if period is not None and hollows:
        turn = math.floor((q - hollows[0][0]) / period)
        shifts = [period * (turn + n) for n in (-1, 0, 1)]
    return [
        driver_at(NO_INERTIA, edge + shift, way)
        for shift in shifts
        for pair in hollows
        for edge, way in zip(pair, (1, -1), strict=True)
    ]


def leaving(surface: Surface, t: float, y: Floats, rates: Floats) -> int:
    """Direction that counts for an integration that starts at (t, y) with these rates.

    A surface on which it starts must not fire at once: it counts on the way back only.
    From rest the acceleration tells which way that is.
    """
    here = surface.value(t, y)
    scale = float(np.abs(y).max()) + 1e-300
    if not abs(here) <= ON * scale or not np.isfinite(rates).all():
        return surface.direction
    k = y.size // 2
    bent = np.zeros_like(y)
    bent[:k] = rates[k : 2 * k] / 2
    gone = 0.0
    for far in LOOKED_AT:
        step = far * scale / (float(np.abs(rates).max()) + 1e-300)
        gone = surface.value(t + step, y + step * (rates + step * bent)) - here
        if abs(gone) > ON * scale:
            break
    return -1 if gone > 0 else 1 if gone < 0 else surface.direction


def crosses(before: float, after: float, direction: int) -> bool:
    """Whether a surface's value changes sign in the direction that counts."""
    up, down = before <= 0 <= after and before < after, before >= 0 >= after and before > after
    return (up and direction >= 0) or (down and direction <= 0)
