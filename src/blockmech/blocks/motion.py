"""How places on a link move, the records of motion that kernels share, and points as users write
them.
"""

from __future__ import annotations

import cmath
from typing import NamedTuple, TypeAlias

from pydantic_core import PydanticCustomError

from blockmech.ground.errors import GraphError, Problem
from blockmech.ground.plane import imul, mul
from blockmech.ground.values import Vector
from blockmech.typing import Complex, LinkAcceleration, LinkVelocity, Real


class DyadVelocity(NamedTuple):
    """Velocities of both links."""

    i: LinkVelocity
    j: LinkVelocity


class SlidingVelocity(NamedTuple):
    """Velocities of both links and the sliding rate."""

    i: LinkVelocity
    j: LinkVelocity
    S: Real  # (...) [m/s] of link j on its guide


class DyadAcceleration(NamedTuple):
    """Accelerations of both links."""

    i: LinkAcceleration
    j: LinkAcceleration


def velocity_at(link: LinkVelocity, arm: Complex) -> Complex:
    """Velocity [m/s] of the place at an arm from where a link's velocity is known."""
    return link.v + imul(arm, link.om)


def acceleration_at(link: LinkAcceleration, om: Real, arm: Complex) -> Complex:
    """Acceleration [m/s2] of that place on a link with the rate ``om``: a + (i al - om^2) arm."""
    return link.a + imul(arm, link.al) - mul(arm, om * om)


Point: TypeAlias = complex | tuple[float, float]
"""A place [m] or a direction, as ``x + iy`` or ``(x, y)``."""


def given_points(where: str, **points: Point) -> list[complex]:
    """The points as complex numbers. Raises `GraphError`, all wrong ones at once."""
    parsed, problems = [], []
    for name, point in points.items():
        try:
            parsed.append(Vector.parse(point).z)
        except PydanticCustomError as error:
            problems.append(Problem("bad-point", f"{where}: {name}", error.message()))
    GraphError.raise_for(problems)
    return parsed


def unit(where: str, along: Point) -> complex:
    """Unit vector in a direction. Raises `GraphError` for the zero vector."""
    (z,) = given_points(where, along=along)
    if z == 0:
        raise GraphError(Problem("bad-point", f"{where}: along", "a direction must not be [0, 0]"))
    return z / abs(z)


def angle_between(a: complex, b: complex) -> float:
    """Angle [rad] from one unit vector to another."""
    return cmath.phase(b * a.conjugate())


def branch_of(where: str, determinant: float, why: str) -> int:
    """The assembly mode, +1 or -1. Raises `GraphError` at a dead centre, which has none."""
    if determinant == 0:
        raise dead_centre(where, f"{why}, so the branch is not defined")
    return 1 if determinant > 0 else -1


def dead_centre(where: str, why: str) -> GraphError:
    """The pose is a dead centre, so it does not tell the parameters."""
    return GraphError(
        Problem("dead-centre", where, why, "", "give another pose, or the parameters themselves")
    )
