r"""Cylinder: a driven length between two pivots, closed by one more link (mobility 1).

          C              links    barrel and rod, one line from B to C;  j = DC
       q / \ j           joints   B, D   R, outer, fed by earlier links
        /   \                     S      P, inner, driven: the rod in the barrel
       B     D                    C      R, inner
                         driver   q > 0 [m], the length BC
                         branch   +1: C left of the ray B -> D, -1: right

It is the RRR dyad whose link i has the driver's length. Points, velocities and
forces are complex numbers x + iy (SI, radians) of any batch shape (...).

Sources: [R10] Ruiz, Durango & Calle 2010, Eqs. 2-7, with a driven length.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from blockmech.blocks.contract import AssurGroup, BuiltIn, Kernels, Line, inner_joint, outer_joint
from blockmech.blocks.motion import Point
from blockmech.blocks.rrr import bent, pin_forces, rates, transmission, triangle
from blockmech.ground.plane import NAN, cross, dot, hyp, imul, maximum, mul, where
from blockmech.ground.values import Branch, Distance, Length, Sign, default
from blockmech.typing import (
    Complex,
    LinkAcceleration,
    LinkPosition,
    LinkVelocity,
    Load,
    Real,
    Slide,
)


class CylinderPose(NamedTuple):
    """Places of the links, link vectors, determinant and distance to dead centre."""

    barrel: LinkPosition
    rod: LinkPosition
    j: LinkPosition
    u: Complex  # (...) [m]  C - B
    w: Complex  # (...) [m]  C - D
    det: Real  # (...) [m2]  cross(u, w)
    margin: Real  # (...) [-]  sin^2 of the angle at C


class CylinderVelocity(NamedTuple):
    """Velocities of the links and the rate of the length."""

    barrel: LinkVelocity
    rod: LinkVelocity
    j: LinkVelocity
    S: Real  # (...) [m/s] q'


class CylinderAcceleration(NamedTuple):
    """Accelerations of the links."""

    barrel: LinkAcceleration
    rod: LinkAcceleration
    j: LinkAcceleration


class CylinderReactions(NamedTuple):
    """Forces [N] at B and D on the group, of the rod on link j at C; barrel on rod; drive."""

    B: Complex
    S: Slide
    C: Complex
    D: Complex
    tau: Real


def position(B: Complex, D: Complex, q: Real, p: Cylinder) -> CylinderPose:
    """Intersect the circles (B, q) and (D, l_j); a length q <= 0 has no answer."""
    length, q = q, where(q > 0.0, q, NAN)
    u, w, det, margin = triangle(D - B, q, p.l_j, p.branch)
    e = mul(u, 1 / q)
    return CylinderPose(
        LinkPosition(B, e),
        LinkPosition(B + u, e),
        LinkPosition(D, mul(w, 1 / p.l_j)),
        u,
        w,
        det,
        where(length <= 0.0, -1.0, margin),
    )


def velocity(
    pose: CylinderPose, v_B: Complex, v_D: Complex, qd: Real, p: Cylinder
) -> CylinderVelocity:
    """Velocities [m/s] of the links' origins and their rates [rad/s]."""
    growing = mul(pose.barrel.e, qd)
    om, om_j = rates(pose, v_D - v_B - growing)
    return CylinderVelocity(
        LinkVelocity(v_B, om),
        LinkVelocity(v_B + imul(pose.u, om) + growing, om),
        LinkVelocity(v_D, om_j),
        qd,
    )


def acceleration(
    pose: CylinderPose, vel: CylinderVelocity, a_B: Complex, a_D: Complex, qdd: Real, p: Cylinder
) -> CylinderAcceleration:
    """Accelerations [m/s2] of the links' origins, angular accelerations [rad/s2]."""
    om, om_j, e = vel.barrel.om, vel.j.om, pose.barrel.e
    relative = mul(e, qdd) + imul(e, 2 * om * vel.S) - mul(pose.u, om * om)
    al, al_j = rates(pose, a_D - a_B - relative - mul(pose.w, om_j * om_j))
    return CylinderAcceleration(
        LinkAcceleration(a_B, al),
        LinkAcceleration(a_B + imul(pose.u, al) + relative, al),
        LinkAcceleration(a_D, al_j),
    )


def reactions(
    pose: CylinderPose, load_barrel: Load, load_rod: Load, load_j: Load, p: Cylinder
) -> CylinderReactions:
    """The dyad with barrel and rod as one link, then the rod alone.

    Loads are (force [N], moment about the link's origin [N m]); the guide couple is
    about C.
    """
    F_r, M_r = load_rod
    M_i = load_barrel.M + M_r + cross(pose.u, F_r)
    R_B, R_C, R_D = pin_forces(pose, Load(load_barrel.F + F_r, M_i), load_j)
    e, f = pose.barrel.e, R_C - F_r  # f is what the barrel does to the rod
    return CylinderReactions(R_B, Slide(cross(e, f), -M_r, load_barrel.M), R_C, R_D, dot(e, f))


def size(pose: CylinderPose, p: Cylinder) -> Real:
    """The larger of both lengths [m]."""
    return maximum(hyp(pose.u), p.l_j)


class Cylinder(AssurGroup, type="driven.rrr"):
    """A cylinder between joints B and C, and a link from C to joint D.

    Parameters
    ----------
    l_j : float > 0 [m]
        Length DC.
    branch : +1 | -1
        Assembly mode, the sign of cross(D - B, C - B).
    x_S : float [m]
        Place of the rod's point S in the barrel, along the line, from the origin (C
        or B) of the link that owns it.
    offset : float [m]
        Length BC at q = 0.
    sign : +1 | -1
        Sense of q: the length BC is sign q + offset.
    slider : "later" or "j" | "earlier" or "i"
        Whether S, where the normal force acts, moves with the rod or with the barrel.

    >>> Cylinder.from_points(B=(2, 0), C=(5, 4), D=(5, 0))
    Cylinder(links={}, friction={}, l_j=4.0, branch=1, x_S=0.0, offset=0.0, sign=1, slider='later')
    """

    kind = "driven RRR"
    group_class = "II"
    link_names = ("barrel", "rod", "j")
    B = outer_joint("R", "barrel")
    S = inner_joint(
        "P", ("barrel", "rod"), lines={"barrel": Line("x_S"), "rod": Line("x_S")}, driven=True
    )
    C = inner_joint("R", ("rod", "j"))
    D = outer_joint("R", "j")
    built_in = {
        "B": BuiltIn("barrel"),
        "C": BuiltIn("rod"),
        "D": BuiltIn("j"),
        "Cj": BuiltIn("j", "l_j"),
    }
    lengths = ("l_j", "x_S")
    kernels = Kernels(position, velocity, acceleration, reactions, transmission, size)

    l_j: Length
    branch: Branch = 1
    x_S: Distance = default(0.0)
    offset: Distance = default(0.0)
    sign: Sign = 1
    slider: Literal["later", "earlier", "j", "i"] = "later"

    @classmethod
    def from_points(cls, B: Point, C: Point, D: Point, **fields: object) -> Cylinder:
        """Make the group from one pose of its pins [m]; length l_j and branch follow.

        Raises `GraphError` where C lies on the line BD: the branch is not defined there.
        """
        numbers = bent("Cylinder.from_points", B, C, D)
        return cls(l_j=numbers["l_j"], branch=numbers["branch"], **fields)  # type: ignore[arg-type]
