"""How places on a link move, and the records of motion that kernels share."""

from __future__ import annotations

from typing import NamedTuple

from blockmech.ground.plane import imul, mul
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
