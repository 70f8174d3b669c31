"""The scene: gravity, the drivers' given motions and the start of a free motion."""

from __future__ import annotations

from blockmech.model.laws_of_motion import AnyLaw
from blockmech.values import Number, Strictly, Vector, VectorGiven, default


class Initial(Strictly):
    """Start of a free motion: coordinate [rad or m] and rate [rad/s or m/s] of a driver."""

    q: Number = 0.0
    rate: Number = 0.0


class Scene(Strictly):
    """What surrounds the mechanism. Gravity [m/s2] is off unless it is stated."""

    gravity: VectorGiven = default(Vector(0j))
    drive: dict[str, AnyLaw] = {}
    initial: dict[str, Initial] = {}
