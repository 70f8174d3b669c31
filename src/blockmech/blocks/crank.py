"""Crank: a driving link that turns about a joint (class I).

        B        link     crank = AB, origin A, x axis towards B
       /         joint    A  revolute, driven; fed by any link
      /          driver   q  [rad] from the direction of the fed marker
     A

Sources: [R10] Ruiz, Durango & Calle 2010, Eqs. 14-16; [D14] Durango et al. 2014.
"""

from __future__ import annotations

from typing import NamedTuple

from blockmech.blocks.contract import BuiltIn, DrivingLink, Kernels, outer_joint
from blockmech.ground.plane import expi
from blockmech.ground.values import Angle, Length, Marker, Maybe, Sign, default
from blockmech.typing import (
    Complex,
    Guide,
    LinkAcceleration,
    LinkPosition,
    LinkVelocity,
    Load,
    Real,
)


class CrankPose(NamedTuple):
    """Place of the crank."""

    crank: LinkPosition


class CrankVelocity(NamedTuple):
    """Velocity of the crank."""

    crank: LinkVelocity


class CrankAcceleration(NamedTuple):
    """Acceleration of the crank."""

    crank: LinkAcceleration


class CrankReactions(NamedTuple):
    """Force [N] of the supporting link on the crank at A, driving moment [N m] without friction."""

    A: Complex
    tau: Real


def position(A: Guide, q: Real, p: Crank) -> CrankPose:
    """Turn the marker's direction by the joint's angle [rad]."""
    return CrankPose(LinkPosition(A.p, A.u * expi(q)))


def velocity(pose: CrankPose, A: LinkVelocity, qd: Real, p: Crank) -> CrankVelocity:
    """Add the driver's rate [rad/s] to the rate of the supporting link."""
    return CrankVelocity(LinkVelocity(A.v, A.om + qd))


def acceleration(
    pose: CrankPose, vel: CrankVelocity, A: LinkAcceleration, qdd: Real, p: Crank
) -> CrankAcceleration:
    """Add the driver's acceleration [rad/s2] to that of the supporting link."""
    return CrankAcceleration(LinkAcceleration(A.a, A.al + qdd))


def reactions(pose: CrankPose, load_crank: Load, p: Crank) -> CrankReactions:
    """Balance of the crank: R_A = -F, tau = -M about A ([R10] Eqs. 14-15)."""
    return CrankReactions(-load_crank.F, -load_crank.M)


class Crank(DrivingLink, type="driver.crank"):
    """Driving link with a revolute pair at A.

    Parameters
    ----------
    length : float [m], optional
        Places the marker B at [length, 0]. Without it the crank has only the
        markers that the user adds.
    offset : float [rad]
        Angle of the x axis from the marker's direction at q = 0.
    sign : +1 | -1
        Sense of q: the angle is sign q + offset.

    >>> Crank(length=2.0).parameters()
    CrankNumbers(length=2.0)
    """

    kind = "crank"
    link_names = ("crank",)
    A = outer_joint("R", "crank", reads="guide", driven=True)
    built_in = {"A": BuiltIn("crank"), "B": BuiltIn("crank", "length")}
    lengths = ("length",)
    kernels = Kernels(position, velocity, acceleration, reactions)

    length: Maybe[Length] = default(None)
    offset: Angle = default(0.0)
    sign: Sign = 1

    def own_markers(self) -> dict[str, tuple[str, Marker | BuiltIn]]:
        """The markers that the block brings; B only where the crank has a length."""
        markers = super().own_markers()
        return {k: m for k, m in markers.items() if k != "B" or self.length is not None}
