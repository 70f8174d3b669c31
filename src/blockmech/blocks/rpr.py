r"""RPR dyad: two links that slide on each other, each on its own pin (class II, third type).

            __j__D         links    i, j
        [S]/    /          joints   B, D  R, outer; fed by earlier links
     i /   u                        S     P, inner
      B                    branch   +1: D ahead of B along u, -1: behind

u is the guide's direction, common to both links, n = i u. The guide line lies at
h_i along n from B and at h_j from D. Points, velocities and forces are complex
numbers x + iy (SI, radians) of any batch shape (...). Impossible samples come out
as NaN, with margin < 0.

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
    branch_of,
    given_points,
    unit,
)
from blockmech.ground.plane import cross, dot, hyp, imul, mul, sqrt
from blockmech.ground.values import Distance, default
from blockmech.typing import (
    Complex,
    LinkAcceleration,
    LinkPosition,
    LinkVelocity,
    Load,
    Real,
    Slide,
)


class RPRPose(NamedTuple):
    """Places of both links, their common direction, determinant, distance to dead centre."""

    i: LinkPosition
    j: LinkPosition
    d: Complex  # (...) [m]  D - B
    r: Real  # (...) [m]  its length
    det: Real  # (...) [m]  dot(u, D - B), from the factored form
    margin: Real  # (...) [-]  cos^2 of the angle between the guide and BD


class RPRReactions(NamedTuple):
    """Forces [N] on the dyad at B and D, and what link i does to link j in the guide."""

    B: Complex
    S: Slide
    D: Complex


def position(B: Complex, D: Complex, p: RPR) -> RPRPose:
    """Turn the guide so that it passes B and D at its offsets.

    The distance along the guide comes from factored differences, so no digits
    cancel where the guide stands across BD.
    """
    d = D - B
    r = hyp(d)
    h = p.h_i - p.h_j
    k = 1 / r
    det = p.branch * sqrt((r - abs(h)) * (r + abs(h)))
    e = mul(d, k)
    u = mul(e, det * k) - imul(e, h * k)
    margin = (r - abs(h)) * k * ((r + abs(h)) * k) * (r * k)  # r k: NaN where B = D
    return RPRPose(LinkPosition(B, u), LinkPosition(D, u), d, r, det, margin)


def rates(pose: RPRPose, rhs: Complex) -> tuple[Real, Real]:
    """Solve ``i x d + y u = rhs``; singular at margin = 0."""
    k = 1 / pose.det
    return cross(pose.i.e, rhs) * k, dot(rhs, pose.d) * k


def velocity(pose: RPRPose, v_B: Complex, v_D: Complex, p: RPR) -> SlidingVelocity:
    """Velocities [m/s] of the links' origins, their common rate [rad/s], sliding rate [m/s]."""
    om, slide = rates(pose, v_D - v_B)
    return SlidingVelocity(LinkVelocity(v_B, om), LinkVelocity(v_D, om), slide)


def acceleration(
    pose: RPRPose, vel: SlidingVelocity, a_B: Complex, a_D: Complex, p: RPR
) -> DyadAcceleration:
    """Accelerations [m/s2] of the links' origins, their common angular acceleration [rad/s2]."""
    om = vel.i.om
    coriolis = imul(pose.i.e, 2 * om * vel.S)
    al, _ = rates(pose, a_D - a_B + mul(pose.d, om * om) - coriolis)
    return DyadAcceleration(LinkAcceleration(a_B, al), LinkAcceleration(a_D, al))


def reactions(pose: RPRPose, load_i: Load, load_j: Load, p: RPR) -> RPRReactions:
    """Solve the moment equation of both links together, then of each alone.

    Loads are (force [N], moment about the link's origin [N m]); the guide couple is
    about D, and about B.
    """
    (F_i, M_i), (F_j, M_j) = load_i, load_j
    N = (M_i + M_j) / pose.det
    f = imul(pose.i.e, N)
    return RPRReactions(f - F_i, Slide(N, -M_j, M_i), -(F_j + f))


def transmission(pose: RPRPose, p: RPR) -> tuple[Real, Real]:
    """Sine and cosine, up to one factor, of the angle between the guide's normal and BD."""
    return abs(pose.det), abs(cross(pose.i.e, pose.d))


def size(pose: RPRPose, p: RPR) -> Real:
    """The distance BD [m]: no parameter says how long the links are."""
    return pose.r


class RPR(TwoModes, type="dyad.rpr"):
    """Two links on pins at B and D that slide along each other.

    Parameters
    ----------
    h_i, h_j : float [m]
        Offset of the guide line from B and from D, along the guide's normal.
    branch : +1 | -1 | "follow"
        Assembly mode, the sign of dot(u, D - B).
    home : where ``branch`` is "follow"
        A driver coordinate and the branch there; see `blockmech.blocks.modes`.
    x_S : float [m]
        Place of the slider's point S along the guide line, from the origin (foot of
        B or D) of the link that owns it.
    slider : "later" or "j" | "earlier" or "i"
        Whether S, where the normal force acts, moves with link j or with link i.

    >>> RPR.from_points(B=(0, 0), D=(5, 0), S=(5, 1), along=(1, 0))
    RPR(links={}, friction={}, h_i=1.0, h_j=1.0, branch=1, x_S=0.0, slider='later')
    """

    kind = "RPR"
    B = outer_joint("R", "i")
    S = inner_joint(
        "P", ("i", "j"), lines={"i": Line("x_S", offset="h_i"), "j": Line("x_S", offset="h_j")}
    )
    D = outer_joint("R", "j")
    built_in = {"B": BuiltIn("i"), "D": BuiltIn("j")}
    lengths = ("h_i", "h_j", "x_S")
    kernels = Kernels(position, velocity, acceleration, reactions, transmission, size)

    h_i: Distance = default(0.0)
    h_j: Distance = default(0.0)
    branch: AnyBranch = 1
    home: BranchHome | None = Field(default=None, repr=False)
    x_S: Distance = default(0.0)
    slider: Literal["later", "earlier", "j", "i"] = "later"

    def reach(self, apart: float, margin: float) -> tuple[str, float, float, float]:
        """Distance of the outer pins: at least the difference of both offsets."""
        return "the distance of {} and {}", apart, abs(self.h_i - self.h_j), math.inf

    @classmethod
    def from_points(cls, B: Point, D: Point, S: Point, along: Point, **fields: object) -> RPR:
        """Make the dyad from one pose: its joints [m] and the guide's direction.

        S is the slider's point, anywhere on the guide line. Raises `GraphError` where
        the guide stands across BD: the branch is not defined there.
        """
        where = "RPR.from_points"
        b, d, s = given_points(where, B=B, D=D, S=S)
        u = unit(where, along)
        branch = branch_of(where, dot(u, d - b), "the guide stands across BD")
        owner = b if fields.get("slider") in ("earlier", "i") else d
        lines = {"h_i": cross(u, s - b), "h_j": cross(u, s - d), "x_S": dot(u, s - owner)}
        return cls(**lines, branch=branch, **fields)  # type: ignore[arg-type]
