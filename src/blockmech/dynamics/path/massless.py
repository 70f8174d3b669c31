"""Places at which the driver has no inertia: a massless crank in line with what it moves.

A motion that comes there with energy gets faster without bound, and rigid bodies have
no answer for what follows. J is zero there to second order, so its root is a kink of the
integrand of the time; the run ends on this side of it, by name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.path.mesh import Mesh, View, places
from blockmech.dynamics.system.reduced import Metered

SUSPECT = 1e-2  # smallest inertia at the nodes, relative to the usual one, that is looked at
NOTHING = 1e-14  # inertia, relative to the usual one, that is none
AROUND = 257  # samples of a way that is looked at
STEPS = 12  # of the search for a zero
NARROWER = 1 / 16  # each against the one before


class NoInertia(Exception):
    """The driver has no inertia at q [rad or m]."""

    def __init__(self, q: float) -> None:
        super().__init__(f"no inertia at {q:.9g}")
        self.q = q


def refuse_no_inertia_inside(view: View, mesh: Mesh) -> None:
    """Raise `NoInertia` with the place nearest the mesh's low end where J is zero.

    Cost: none where the inertia does not come near zero, else some 30 single poses.
    """
    J = mesh.J
    if not float(J.min()) < SUSPECT * float(J.max()):
        return
    x = places(mesh.edges[:-1], mesh.edges[1:], mesh.limits, mesh.nodes).ravel()
    found = first_zero(view, x, J.ravel())
    if found is not None:
        raise NoInertia(view.origin + view.sign * found)


def massless_between(meter: Metered, low: float, high: float) -> list[float]:
    """Driver coordinates between two where J is zero, in order; one batch call."""
    if not low < high:
        return []
    x = np.linspace(0.0, high - low, AROUND)
    view = View(meter, low, 1.0)
    return [low + at for at in zeros(view, x, np.asarray(meter.sample(view.q(x)).J))]


def hollows(
    meter: Metered, q: float, inertia: Callable[[Any], float], least: float
) -> tuple[tuple[float, float], ...]:
    """Ranges of the driver's coordinate [rad or m] with next to no inertia.

    Around places where J is zero, within a period; where nothing repeats, within the length
    over which J changes, to both sides. ``inertia``: that of a state (q, ...), relative [-];
    ``least``: what it has at the ends of each range. Cost: one batch call.
    """
    period = meter.system.period
    low, high = (q, q + period) if period else (q - meter.system.span, q + meter.system.span)
    step = (high - low) / (AROUND - 1)
    x = np.arange(-1.0, AROUND + 1) * step  # a step more: an edge may be the place
    view = View(meter, low, 1.0)
    found = []
    for at in zeros(view, x, np.asarray(meter.sample(view.q(x)).J)):
        beside = max(inertia((low + at + step, 0.0)), least)  # it grows with the square
        half = step * math.sqrt(least / beside)
        found.append((low + at - half, low + at + half))
    return tuple(found)


def first_zero(view: View, x: Floats, J: Floats) -> float | None:
    """The first place where J goes to zero, if it does, from samples J (n,) at places x (n,)."""
    return next(zeros(view, x, J), None)


def zeros(view: View, x: Floats, J: Floats) -> Iterator[float]:
    """Places where J goes to zero, from samples J (n,) at places x (n,); NaN where no pose is."""
    usual = float(np.median(J[np.isfinite(J)])) if np.isfinite(J).any() else 0.0
    limit = SUSPECT * usual  # not of the largest: beside a dead centre it has no bound
    nothing = NOTHING / SUSPECT * limit
    pose = view.meter.pose

    def inertia(at: float) -> float:
        return pose(view.origin + view.sign * at).J

    for at, left in first_touch(x, J, inertia, limit):
        if left <= nothing:
            yield at


def first_touch(
    x: Floats, values: Floats, value: Callable[[float], float], limit: float
) -> Iterator[tuple[float, float]]:
    """Places where a value that is never negative touches zero, or nearly; and what is left.

    From its samples (n,) at places x (n,), beside those that are lowest and below a limit.
    """
    least = (values[1:-1] < limit) & (values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])
    for i in (np.flatnonzero(least) + 1).tolist():
        yield _touch(value, float(x[i - 1]), float(x[i + 1]))


def _touch(value: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Where a value touches zero between two places, and what is left; its root goes straight."""
    best, least = (low + high) / 2, math.inf
    for _ in range(STEPS):
        a, b = (math.sqrt(max(value(at), 0.0)) for at in (low, high))
        middle = (low * b + high * a) / (a + b) if a + b > 0 else (low + high) / 2
        left = max(value(middle), 0.0)
        if left < least:
            best, least = middle, left
        if left == 0 or left >= 0.1 * max(a, b) ** 2 or not low < middle < high:
            break
        half = (high - low) / 2 * NARROWER
        low, high = middle - half, middle + half
    return best, least
