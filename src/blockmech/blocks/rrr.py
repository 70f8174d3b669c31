r"""RRR dyad: two links joined by three revolute joints (class II, first type).

          C              links    i = BC,  j = DC
       i / \ j           joints   B, D   outer, fed by earlier links
        /   \                     C      inner
       B     D           branch   +1: C left of the ray B -> D, -1: right

Points, velocities and forces are complex numbers x + iy (SI, radians) of any
batch shape (...). Impossible samples come out as NaN, with margin < 0.

Sources: [R10] Ruiz, Durango & Calle 2010; [D14] Durango et al. 2014.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

from pydantic import Field

from blockmech.blocks.contract import BuiltIn, Kernels, inner_joint, outer_joint
from blockmech.blocks.modes import AnyBranch, BranchHome, TwoModes
from blockmech.blocks.motion import DyadAcceleration, DyadVelocity, Point, branch_of, given_points
from blockmech.ground.plane import cross, dot, hyp, imul, mul, sqrt
from blockmech.ground.values import Length
from blockmech.typing import (
    Complex,
    Data,
    LinkAcceleration,
    LinkPosition,
    LinkVelocity,
    Load,
    Real,
)

Bent: TypeAlias = Any
"""A pose of two pinned links: u = C - B, w = C - D [m], det = cross(u, w) [m2]."""


class RRRPose(NamedTuple):
    """Places of both links, link vectors, determinant and distance to dead centre."""

    i: LinkPosition
    j: LinkPosition
    u: Complex  # (...) [m]  C - B
    w: Complex  # (...) [m]  C - D
    det: Real  # (...) [m2]  cross(u, w), from the factored form
    margin: Real  # (...) [-]  sin^2 of the angle at C


class RRRReactions(NamedTuple):
    """Forces [N] on the dyad at B and D, and of link i on link j at C."""

    B: Complex
    C: Complex
    D: Complex


def position(B: Complex, D: Complex, p: RRR) -> RRRPose:
    """Intersect the circles (B, l_i) and (D, l_j).

    The height of the triangle comes from factored differences, so no digits
    cancel near dead centre.
    """
    u, w, det, margin = triangle(D - B, p.l_i, p.l_j, p.branch)
    return RRRPose(
        LinkPosition(B, mul(u, 1 / p.l_i)), LinkPosition(D, mul(w, 1 / p.l_j)), u, w, det, margin
    )


def triangle(d: Complex, l_i: Real, l_j: Real, branch: Real) -> tuple[Complex, Complex, Real, Real]:
    """Sides u and w = u - d of a triangle over d, cross(u, w), and sin^2 between them."""
    r = hyp(d)
    outer, inner = l_i + l_j, l_i - l_j
    k = 1 / r
    area2 = (outer - r) * (outer + r) * ((r - abs(inner)) * (r + abs(inner)))
    det = branch * sqrt(area2) / 2
    e = mul(d, k)
    u = mul(e, (inner * outer * k + r) / 2) + imul(e, det * k)
    twice = 2 * l_i * l_j
    margin = area2 * (1 / (twice * twice)) * (r * k)  # r k: NaN where B = D
    return u, u - d, det, margin


def rates(pose: Bent, rhs: Complex) -> tuple[Real, Real]:
    """Solve ``i x_i u - i x_j w = rhs``; singular at margin = 0."""
    k = 1 / pose.det
    return dot(rhs, pose.w) * k, dot(rhs, pose.u) * k


def velocity(pose: RRRPose, v_B: Complex, v_D: Complex, p: RRR) -> DyadVelocity:
    """Velocities [m/s] of the links' origins and their rates [rad/s]."""
    om_i, om_j = rates(pose, v_D - v_B)
    return DyadVelocity(LinkVelocity(v_B, om_i), LinkVelocity(v_D, om_j))


def acceleration(
    pose: RRRPose, vel: DyadVelocity, a_B: Complex, a_D: Complex, p: RRR
) -> DyadAcceleration:
    """Accelerations [m/s2] of the links' origins, angular accelerations [rad/s2]."""
    om_i, om_j = vel.i.om, vel.j.om
    al_i, al_j = rates(pose, a_D - a_B + mul(pose.u, om_i * om_i) - mul(pose.w, om_j * om_j))
    return DyadAcceleration(LinkAcceleration(a_B, al_i), LinkAcceleration(a_D, al_j))


def reactions(pose: RRRPose, load_i: Load, load_j: Load, p: RRR) -> RRRReactions:
    """Solve the moment equations of links i and j about C ([R10] Eqs. 2-7)."""
    return RRRReactions(*pin_forces(pose, load_i, load_j))


def pin_forces(pose: Bent, load_i: Load, load_j: Load) -> tuple[Complex, Complex, Complex]:
    """Forces [N] at B, at C (of i on j) and at D; loads are about B and D."""
    (F_i, M_i), (F_j, M_j) = load_i, load_j
    m = M_i - cross(pose.u, F_i)
    k = cross(pose.w, F_j) - M_j - cross(pose.w, F_i + F_j)
    R_B = mul(mul(pose.w, m) - mul(pose.u, k), 1 / pose.det)
    R_C = F_i + R_B
    return R_B, R_C, -(F_j + R_C)


def transmission(pose: RRRPose, p: RRR) -> tuple[Real, Real]:
    """Sine and cosine, up to one factor, of the angle at C."""
    return abs(pose.det), abs(dot(pose.u, pose.w))


class RRR(TwoModes, type="dyad.rrr"):
    """Two links joined at C, closing the loop between joints B and D.

    Parameters
    ----------
    l_i, l_j : float > 0 [m]
        Lengths BC and DC.
    branch : +1 | -1 | "follow"
        Assembly mode, the sign of cross(D - B, C - B).
    home : where ``branch`` is "follow"
        A driver coordinate and the branch there; see `blockmech.blocks.modes`.

    >>> RRR.from_points(B=(2, 0), C=(5, 4), D=(5, 0))
    RRR(links={}, friction={}, l_i=5.0, l_j=4.0, branch=1)
    """

    kind = "RRR"
    B = outer_joint("R", "i")
    C = inner_joint("R", ("i", "j"))
    D = outer_joint("R", "j")
    built_in = {
        "B": BuiltIn("i"),
        "C": BuiltIn("i", "l_i"),
        "D": BuiltIn("j"),
        "Cj": BuiltIn("j", "l_j"),
    }
    lengths = ("l_i", "l_j")
    kernels = Kernels(position, velocity, acceleration, reactions, transmission)

    l_i: Length
    l_j: Length
    branch: AnyBranch = 1
    home: BranchHome | None = Field(default=None, repr=False)

    def reach(self, apart: float, margin: float) -> tuple[str, float, float, float]:
        """Distance of the outer pins: from the difference to the sum of both lengths."""
        low, high = abs(self.l_i - self.l_j), self.l_i + self.l_j
        return "the distance of {} and {}", apart, low, high

    @classmethod
    def from_points(cls, B: Point, C: Point, D: Point, **fields: object) -> RRR:
        """Make the dyad from one pose of its joints [m]; lengths and branch follow.

        Raises `GraphError` where C lies on the line BD: the branch is not defined there.
        """
        return cls(**bent("RRR.from_points", B, C, D), **fields)  # type: ignore[arg-type]


def bent(where: str, B: Point, C: Point, D: Point) -> Data:
    """Lengths and branch of two links from B and D to C."""
    b, c, d = given_points(where, B=B, C=C, D=D)
    branch = branch_of(where, cross(d - b, c - b), "B, C and D lie on one line")
    return {"l_i": abs(c - b), "l_j": abs(d - c), "branch": branch}
