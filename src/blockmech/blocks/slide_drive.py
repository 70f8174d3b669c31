"""Slide drive: a driving link that slides along a guide (class I).

     ---[S]---->  u      link     slider, origin S, x axis along the guide
         |->             joint    S  prismatic, driven; fed by a guide of any link
         q               driver   q  [m] from the marker's place along its direction

Sources: [R10] Ruiz, Durango & Calle 2010 (class I, prismatic, by analogy with
Eqs. 14-16).
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from blockmech.blocks.contract import BuiltIn, DrivingLink, Kernels, Line, outer_joint
from blockmech.blocks.motion import acceleration_at, velocity_at
from blockmech.ground.plane import dot, imul, mul
from blockmech.ground.values import Distance, Sign, default
from blockmech.typing import (
    Complex,
    Guide,
    LinkAcceleration,
    LinkPosition,
    LinkVelocity,
    Load,
    Real,
    Slide,
)


class SlidePose(NamedTuple):
    """Place of the slider and its arm from the marker."""

    slider: LinkPosition
    arm: Complex  # (...) [m] from the marker's place to the slider's origin


class SlideVelocity(NamedTuple):
    """Velocity of the slider and its sliding rate."""

    slider: LinkVelocity
    S: Real  # (...) [m/s] q'


class SlideAcceleration(NamedTuple):
    """Acceleration of the slider."""

    slider: LinkAcceleration


class SlideReactions(NamedTuple):
    """Normal force and guide couple on the slider, driving force [N] without friction."""

    S: Slide
    tau: Real


def position(S: Guide, q: Real, p: SlideDrive) -> SlidePose:
    """Move along the guide [m]."""
    arm = mul(S.u, q)
    return SlidePose(LinkPosition(S.p + arm, S.u), arm)


def velocity(pose: SlidePose, S: LinkVelocity, qd: Real, p: SlideDrive) -> SlideVelocity:
    """Velocity of the guide's link at the slider plus the sliding rate [m/s]."""
    v = velocity_at(S, pose.arm) + mul(pose.slider.e, qd)
    return SlideVelocity(LinkVelocity(v, S.om), qd)


def acceleration(
    pose: SlidePose, vel: SlideVelocity, S: LinkAcceleration, qdd: Real, p: SlideDrive
) -> SlideAcceleration:
    """Guide's acceleration at the slider, Coriolis and relative acceleration [m/s2]."""
    om = vel.slider.om
    relative = imul(pose.slider.e, 2 * om * vel.S) + mul(pose.slider.e, qdd)
    return SlideAcceleration(LinkAcceleration(acceleration_at(S, om, pose.arm) + relative, S.al))


def reactions(pose: SlidePose, load_slider: Load, p: SlideDrive) -> SlideReactions:
    """Balance of the slider along n, about S and along u."""
    u = pose.slider.e
    N = -dot(imul(u, 1.0), load_slider.F)
    return SlideReactions(Slide(N, -load_slider.M), -dot(u, load_slider.F))


class SlideDrive(DrivingLink, type="driver.slide"):
    """Driving link with a prismatic pair at S.

    Parameters
    ----------
    offset : float [m]
        Place of the slider along the guide at q = 0.
    sign : +1 | -1
        Sense of q: the position is sign q + offset.
    slider : "later" | "earlier"
        Whether the slider's point, where the normal force acts, moves with the
        slider (its origin) or stays at the marker.

    >>> SlideDrive(offset=0.1).coordinate("S").of_joint(0.5)
    0.6
    """

    kind = "slide"
    link_names = ("slider",)
    S = outer_joint("P", "slider", line=Line(), driven=True)
    built_in = {"S": BuiltIn("slider")}
    kernels = Kernels(position, velocity, acceleration, reactions)

    offset: Distance = default(0.0)
    sign: Sign = 1
    slider: Literal["later", "earlier"] = "later"
