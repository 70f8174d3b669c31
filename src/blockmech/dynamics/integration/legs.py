"""What every integrator gives back for one leg, and what it is asked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.integration.equation import Equation
from blockmech.dynamics.integration.surfaces import Surface, leaving

NEXT_TO_NOTHING = 1e-300
FINEST = 2.3e-14  # SciPy refuses smaller relative tolerances


class TooMany(Exception):
    """More evaluations than a run may take."""


class Ask(NamedTuple):
    """One leg: integrate from (t, y) to ``end`` [s], or to a terminal surface."""

    equation: Equation
    rhs: Callable[[float, Any], Any]  # counts its evaluations
    t: float
    y: Floats
    end: float
    surfaces: list[Surface]
    tolerance: float
    longest: float = np.inf  # step [s]


class Hit(NamedTuple):
    """A surface met: where and when."""

    surface: Surface
    t: float
    y: Any


class Leg(NamedTuple):
    """A leg done.

    dense : times (m,) -> states (2k + 1, m)
    hits : in order; a terminal one is the last
    failed : whether the integrator gave up at the end
    turned : [J] largest work on the way
    marks : (n,) [s] times at which steps begin
    halted : why it stopped before its end with all that was done: `INTERRUPTED` by the
        user, or `TOO_MANY` evaluations; else ""
    """

    t0: float
    t1: float
    y1: Floats
    dense: Callable[[Floats], Floats]
    hits: tuple[Hit, ...]
    failed: bool
    turned: float
    marks: Floats
    halted: str = ""

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled without the surfaces that were met, which are functions."""
        return Leg, (*self._replace(hits=()),)


@dataclass(frozen=True)
class Resting:
    """Dense output of a leg whose first step could not be made."""

    y: Floats

    def __call__(self, t: Floats) -> Floats:
        return np.repeat(self.y[:, None], t.size, axis=1)


def scales(equation: Equation, y: Floats, tolerance: float) -> tuple[Floats, Floats]:
    """rtol and atol by component: never relative to an angle, which may grow for ever."""
    k, w = equation.drivers, equation.speed
    rest = max(tolerance, FINEST)
    moving = y.copy()
    moving[k : 2 * k] = w
    energy = max(equation.kinetic(moving), 1e-300)
    rtol = np.array([FINEST] * k + [rest] * (k + 1))
    atol = np.array([rest] * k + [rest * w] * k + [rest * energy])
    return rtol, atol


def directions(ask: Ask) -> list[int]:
    """The direction in which each surface counts on this leg.

    A surface on which the leg starts must not fire at once: it counts only if it is
    crossed on the way back.
    """
    rates = np.asarray(ask.rhs(ask.t, ask.y), dtype=np.float64)
    return [leaving(s, ask.t, ask.y, rates) for s in ask.surfaces]


def first_values(ask: Ask, counts: list[int]) -> list[float]:
    """What the surfaces are at the start of a leg, in which they count in these directions.

    One on which the leg starts is told from the side to which it is left: of a step that goes
    there and comes back, its way back is the crossing, and not its start.
    """
    values = [s.value(ask.t, ask.y) for s in ask.surfaces]
    return [x or -way * NEXT_TO_NOTHING for x, way in zip(values, counts, strict=True)]
