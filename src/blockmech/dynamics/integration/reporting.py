"""How far an integration is, told now and then from its right-hand side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import Any

from blockmech.dynamics.integration.equation import Equation
from blockmech.dynamics.system.reduced import TURN
from blockmech.dynamics.until import Asked

EVERY = 128  # right-hand sides between two reports, at most
WHILE = 0.05  # [s] after which there is one anyway
NEARLY = 0.9  # share of the way after which a place at its beginning is a new run


def reporting(equation: Equation, asked: Asked, method: str) -> Equation:
    """The equation whose right-hand side tells ``asked.progress`` how far the run is.

    An integration repeated at a finer tolerance begins anew, and says so. Without anyone
    to tell, it is the equation itself.
    """
    progress, right = asked.progress, equation.rhs
    if progress is None:
        return equation
    far, whole = _distance(asked)
    count, repeats, farthest, told = 0, 1, 0.0, perf_counter()

    def rhs(t: float, y: Any) -> Any:
        nonlocal count, repeats, farthest, told
        count += 1
        if count % EVERY == 0 or perf_counter() - told > WHILE:
            told = perf_counter()
            done = float(far(t, y))
            if done < farthest / 2 and farthest > NEARLY * (whole or farthest):
                repeats, farthest = repeats + 1, 0.0
            farthest = max(farthest, done)
            progress(method if repeats == 1 else f"{method}, run {repeats}", done, whole)
        return right(t, y)

    return replace(equation, rhs=rhs)


def _distance(asked: Asked) -> tuple[Callable[[float, Any], float], float | None]:
    """How far a state is on the way to the goal, and the whole way; times [s] if unknown."""
    (q0, _, t0), goal, value = asked.start, asked.until.goal, asked.until.value
    if goal == "turns":
        return lambda t, y: abs(float(y[0]) - q0) / TURN, value
    if goal == "angle":
        return lambda t, y: abs(float(y[0]) - q0), abs(value - q0)
    return lambda t, y: t - t0, value if goal == "time" else None
