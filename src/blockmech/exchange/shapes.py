"""Mass and inertia of solid bodies by their shape, about their centre in their own axes.

Source: MuJoCo documentation, geom sizes; Meriam & Kraige, Dynamics, appendix D.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from blockmech.exchange.spatial import Array


def _round(volume: float, axial: float, transverse: float) -> tuple[float, Array]:
    """Volume, and the inertia of a unit mass about z and about what is square to it."""
    return volume, np.diag([transverse, transverse, axial])


def ellipsoid(a: float, b: float, c: float) -> tuple[float, Array]:
    """Half axes [m]."""
    x, y, z = a * a, b * b, c * c
    return 4 / 3 * math.pi * a * b * c, np.diag([y + z, x + z, x + y]) / 5


def sphere(radius: float) -> tuple[float, Array]:
    """Radius [m]."""
    return ellipsoid(radius, radius, radius)


def box(a: float, b: float, c: float) -> tuple[float, Array]:
    """Half edges [m]."""
    x, y, z = a * a, b * b, c * c
    return 8 * a * b * c, np.diag([y + z, x + z, x + y]) / 3


def cylinder(radius: float, half: float) -> tuple[float, Array]:
    """Radius [m] and half of the length [m] along z."""
    square = radius**2
    return _round(2 * math.pi * square * half, square / 2, square / 4 + half**2 / 3)


def capsule(radius: float, half: float) -> tuple[float, Array]:
    """Radius [m], and half of the length [m] along z between the centres of both ends."""
    square, ends = radius**2, 4 / 3 * math.pi * radius**3
    tube = 2 * math.pi * square * half
    axial = tube * square / 2 + ends * square * 2 / 5
    transverse = tube * (square / 4 + half**2 / 3)
    transverse += ends * (square * 2 / 5 + half**2 + 3 / 4 * half * radius)
    volume = tube + ends
    return _round(volume, axial / volume, transverse / volume)


SHAPES: dict[str, tuple[int, Callable[..., tuple[float, Array]]]] = {
    "sphere": (1, sphere),
    "capsule": (2, capsule),
    "cylinder": (2, cylinder),
    "ellipsoid": (3, ellipsoid),
    "box": (3, box),
}
"""Shape -> how many sizes it has, and its volume [m3] and inertia of a unit mass [m2]."""


def solid(kind: str, sizes: Sequence[float]) -> tuple[float, Array] | None:
    """Volume [m3] and inertia of a unit mass [m2] of a shape; None for what is none."""
    count, shape = SHAPES.get(kind, (0, sphere))
    return shape(*sizes[:count]) if count and len(sizes) >= count else None
