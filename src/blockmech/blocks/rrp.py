r"""RRP dyad: a link between two pins, the second of them on a slider (class II, second type).

             C___          links    i = BC,  j = the slider
          i / \__|___u     joints   B  R, outer; fed by an earlier link
           /   [S]-->               C  R, inner
          B                         S  P, outer; fed by a guide of an earlier link
                           branch   +1: C ahead of B along u, -1: behind

u is the guide's direction, n = i u. The guide line lies at h along n from C.
Points, velocities and forces are complex numbers x + iy (SI, radians) of any
batch shape (...). Impossible samples come out as NaN, with margin < 0.

Sources: [R10] Ruiz, Durango & Calle 2010, Eqs. 2-7, by analogy; [D14] Durango et
al. 2014, section 2 (groups of the second class).
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

from pydantic import Field

from blockmech.blocks.contract import BuiltIn, Kernels, Line, inner_joint, outer_joint
from blockmech.blocks.modes import AnyBranch, BranchHome, TwoModes
from blockmech.blocks.motion import (
    DyadAcceleration,
    Point,
    SlidingVelocity,
    acceleration_at,
    branch_of,
    given_points,
    unit,
    velocity_at,
)
from blockmech.ground.plane import cross, dot, imul, mul, sqrt
from blockmech.ground.values import Distance, Length, default
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


class RRPPose(NamedTuple):
    """Places of both links, link vector, determinant and distance to dead centre."""

    i: LinkPosition
    j: LinkPosition
    w: Complex  # (...) [m]  C - B
    arm: Complex  # (...) [m]  C - G, from the guide's marker
    det: Real  # (...) [m]  dot(w, u), from the factored form
    margin: Real  # (...) [-]  cos^2 of the angle between link i and the guide


class RRPReactions(NamedTuple):
    """Forces [N] on the dyad at B, of link i on link j at C, and of the guide on the slider."""

    B: Complex
    C: Complex
    S: Slide


def position(B: Complex, S: Guide, p: RRP) -> RRPPose:
    """Intersect the circle (B, l) with the guide line shifted by -h.

    c is the distance of that line from B. What is left of l along the guide comes
    from factored differences, so no digits cancel where link i stands across it.
    """
    G, u = S
    d = G - B
    c = cross(u, d) - p.h
    reach = (p.l - c) * (p.l + c)
    det = p.branch * sqrt(reach)
    w = mul(u, det) + imul(u, c)
    arm = mul(u, det - dot(u, d)) - imul(u, p.h)
    k = 1 / p.l
    return RRPPose(LinkPosition(B, mul(w, k)), LinkPosition(B + w, u), w, arm, det, reach * (k * k))


def rates(pose: RRPPose, rhs: Complex) -> tuple[Real, Real]:
    """Solve ``i x w - y u = rhs``; singular at margin = 0."""
    k = 1 / pose.det
    return cross(pose.j.e, rhs) * k, -dot(rhs, pose.w) * k


def velocity(pose: RRPPose, v_B: Complex, v_S: LinkVelocity, p: RRP) -> SlidingVelocity:
    """Velocities [m/s] of the links' origins, rates [rad/s], sliding rate [m/s]."""
    om_i, slide = rates(pose, velocity_at(v_S, pose.arm) - v_B)
    v_C = v_B + imul(pose.w, om_i)
    return SlidingVelocity(LinkVelocity(v_B, om_i), LinkVelocity(v_C, v_S.om), slide)


def acceleration(
    pose: RRPPose, vel: SlidingVelocity, a_B: Complex, a_S: LinkAcceleration, p: RRP
) -> DyadAcceleration:
    """Accelerations [m/s2] of the links' origins, angular accelerations [rad/s2].

    The slider's acceleration on its guide contains Coriolis' 2 i om s' u.
    """
    om_i, om_g = vel.i.om, vel.j.om
    carried = acceleration_at(a_S, om_g, pose.arm) + imul(pose.j.e, 2 * om_g * vel.S)
    centripetal = mul(pose.w, om_i * om_i)
    al_i, _ = rates(pose, carried + centripetal - a_B)
    a_C = a_B + imul(pose.w, al_i) - centripetal
    return DyadAcceleration(LinkAcceleration(a_B, al_i), LinkAcceleration(a_C, a_S.al))


def reactions(pose: RRPPose, load_i: Load, load_j: Load, p: RRP) -> RRPReactions:
    """Solve the moment equation of link i about B, with the slider's balance along n.

    Loads are (force [N], moment about the link's origin [N m]); the guide couple is
    about C.
    """
    (F_i, M_i), (F_j, M_j) = load_i, load_j
    N = -(M_i + cross(pose.w, F_j)) / pose.det
    R_C = -(imul(pose.j.e, N) + F_j)
    return RRPReactions(R_C - F_i, R_C, Slide(N, -M_j))


def transmission(pose: RRPPose, p: RRP) -> tuple[Real, Real]:
    """Sine and cosine, up to one factor, of the angle between link i and the guide's normal."""
    return abs(pose.det), abs(cross(pose.j.e, pose.w))


class RRP(TwoModes, type="dyad.rrp"):
    """A link pinned to an earlier link at B and to a slider at C.

    Parameters
    ----------
    l : float > 0 [m]
        Length BC.
    h : float [m]
        Offset of the guide line from C, along the guide's normal.
    branch : +1 | -1 | "follow"
        Assembly mode, the sign of dot(u, C - B).
    home : where ``branch`` is "follow"
        A driver coordinate and the branch there; see `blockmech.blocks.modes`.
    x_S : float [m]
        Place of the slider's point S along the guide line, from the foot of C.
    slider : "later" | "earlier"
        Whether S, where the normal force acts, moves with the slider or stays at the
        guide's marker.

    >>> RRP.from_points(B=(0, 3), C=(4, 0), S=(4, 0), along=(1, 0))
    RRP(links={}, friction={}, l=5.0, h=0.0, branch=1, x_S=0.0, slider='later')
    """

    kind = "RRP"
    B = outer_joint("R", "i")
    C = inner_joint("R", ("i", "j"))
    S = outer_joint("P", "j", line=Line(along="x_S", offset="h"))
    built_in = {"B": BuiltIn("i"), "C": BuiltIn("i", "l"), "Cj": BuiltIn("j")}
    lengths = ("l", "h", "x_S")
    kernels = Kernels(position, velocity, acceleration, reactions, transmission)

    l: Length
    h: Distance = default(0.0)
    branch: AnyBranch = 1
    home: BranchHome | None = Field(default=None, repr=False)
    x_S: Distance = default(0.0)
    slider: Literal["later", "earlier"] = "later"

    def reach(self, apart: float, margin: float) -> tuple[str, float, float, float]:
        """Distance of B from the line on which C slides: at most the length of link i."""
        return "the distance of {} from the line of C", self.l * math.sqrt(1 - margin), 0.0, self.l

    @classmethod
    def from_points(cls, B: Point, C: Point, S: Point, along: Point, **fields: object) -> RRP:
        """Make the dyad from one pose: its joints [m] and the guide's direction.

        S is the slider's point, anywhere on the guide line. Raises `GraphError` where
        link i stands across the guide: the branch is not defined there.
        """
        where = "RRP.from_points"
        b, c, s = given_points(where, B=B, C=C, S=S)
        u = unit(where, along)
        branch = branch_of(where, dot(u, c - b), "link BC stands across the guide")
        foot = {"l": abs(c - b), "h": cross(u, s - c), "x_S": dot(u, s - c)}
        return cls(**foot, branch=branch, **fields)  # type: ignore[arg-type]
