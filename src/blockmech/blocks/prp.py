r"""PRP dyad: two sliders pinned to each other, each on its own guide (class II, fourth type).

        \u1                links    i on guide 1, j on guide 2
        [S1]               joints   S1, S2  P, outer; fed by guides of earlier links
          \                         C       R, inner
           C---[S2]--u2    one assembly mode: there is no branch

u1, u2 are the guides' directions, n = i u. Guide line k lies at h_k along its
normal from C. Points, velocities and forces are complex numbers x + iy (SI,
radians) of any batch shape (...). Parallel guides come out as NaN, with margin 0.

Sources: [R10] Ruiz, Durango & Calle 2010, Eqs. 2-7, by analogy; [D14] Durango et
al. 2014, section 2 (groups of the second class).
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from blockmech.blocks.contract import BuiltIn, Kernels, Line, inner_joint, outer_joint
from blockmech.blocks.modes import OneMode
from blockmech.blocks.motion import (
    DyadAcceleration,
    Point,
    acceleration_at,
    dead_centre,
    given_points,
    unit,
    velocity_at,
)
from blockmech.ground.plane import NAN, cross, dot, hyp, imul, maximum, mul, where
from blockmech.ground.values import Distance, default
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


class PRPPose(NamedTuple):
    """Places of both links, arms on both guides, determinant and distance to dead centre."""

    i: LinkPosition
    j: LinkPosition
    arm_1: Complex  # (...) [m]  C - G1, from the marker of guide 1
    arm_2: Complex  # (...) [m]  C - G2
    det: Real  # (...) [-]  cross(u1, u2), NaN where the guides are parallel
    margin: Real  # (...) [-]  sin^2 of the angle between the guides


class PRPVelocity(NamedTuple):
    """Velocities of both links and the sliding rates."""

    i: LinkVelocity
    j: LinkVelocity
    S1: Real  # (...) [m/s] of link i on guide 1
    S2: Real  # (...) [m/s] of link j on guide 2


class PRPReactions(NamedTuple):
    """What the guides do to the sliders, and the force [N] of link i on link j at C."""

    S1: Slide
    C: Complex
    S2: Slide


def position(S1: Guide, S2: Guide, p: PRP) -> PRPPose:
    """Intersect the two guide lines, each shifted by -h along its normal."""
    (G1, u1), (G2, u2) = S1, S2
    d = G2 - G1
    sine = cross(u1, u2)
    det = where(sine == 0.0, NAN, sine)
    arm_1 = mul(u1, (p.h2 - cross(u2, d) - p.h1 * dot(u1, u2)) / det) - imul(u1, p.h1)
    C = G1 + arm_1
    return PRPPose(LinkPosition(C, u1), LinkPosition(C, u2), arm_1, arm_1 - d, det, sine * sine)


def slides(pose: PRPPose, rhs: Complex) -> tuple[Real, Real]:
    """Solve ``x1 u1 + x2 u2 = rhs``; singular at margin = 0."""
    k = 1 / pose.det
    return cross(rhs, pose.j.e) * k, cross(pose.i.e, rhs) * k


def velocity(pose: PRPPose, v_S1: LinkVelocity, v_S2: LinkVelocity, p: PRP) -> PRPVelocity:
    """Velocities [m/s] of the pin, rates [rad/s] of the guides, sliding rates [m/s]."""
    carried_1, carried_2 = velocity_at(v_S1, pose.arm_1), velocity_at(v_S2, pose.arm_2)
    slide_1, back_2 = slides(pose, carried_2 - carried_1)
    v_C = carried_1 + mul(pose.i.e, slide_1)
    return PRPVelocity(LinkVelocity(v_C, v_S1.om), LinkVelocity(v_C, v_S2.om), slide_1, -back_2)


def acceleration(
    pose: PRPPose, vel: PRPVelocity, a_S1: LinkAcceleration, a_S2: LinkAcceleration, p: PRP
) -> DyadAcceleration:
    """Accelerations [m/s2] of the pin, angular accelerations [rad/s2] of the guides.

    What a guide does to its slider by its own motion contains Coriolis' 2 i om s' u.
    """
    om_1, om_2 = vel.i.om, vel.j.om
    carried_1 = acceleration_at(a_S1, om_1, pose.arm_1) + imul(pose.i.e, 2 * om_1 * vel.S1)
    carried_2 = acceleration_at(a_S2, om_2, pose.arm_2) + imul(pose.j.e, 2 * om_2 * vel.S2)
    slide_1, _ = slides(pose, carried_2 - carried_1)
    a_C = carried_1 + mul(pose.i.e, slide_1)
    return DyadAcceleration(LinkAcceleration(a_C, a_S1.al), LinkAcceleration(a_C, a_S2.al))


def reactions(pose: PRPPose, load_i: Load, load_j: Load, p: PRP) -> PRPReactions:
    """Split the whole load along the two normals; each couple is its own link's.

    Loads are (force [N], moment about the link's origin [N m]); the guide couples are
    about C.
    """
    (F_i, M_i), (F_j, M_j) = load_i, load_j
    F, k = F_i + F_j, 1 / pose.det
    N1, N2 = -dot(F, pose.j.e) * k, dot(F, pose.i.e) * k
    R_C = F_i + imul(pose.i.e, N1)
    return PRPReactions(Slide(N1, -M_i), R_C, Slide(N2, -M_j))


def transmission(pose: PRPPose, p: PRP) -> tuple[Real, Real]:
    """Sine and cosine of the angle between the guides."""
    return abs(pose.det), abs(dot(pose.i.e, pose.j.e))


def size(pose: PRPPose, p: PRP) -> Real:
    """The larger distance [m] of C from a guide's marker: no parameter says it."""
    return maximum(hyp(pose.arm_1), hyp(pose.arm_2))


class PRP(OneMode, type="dyad.prp"):
    """Two sliders on two guides, pinned to each other at C.

    Parameters
    ----------
    h1, h2 : float [m]
        Offset of each guide line from C, along the guide's normal.
    x_S1, x_S2 : float [m]
        Place of each slider's point along its guide line, from the foot of C.
    slider : map joint -> "later" | "earlier"
        Whether the point, where the normal force acts, moves with the slider (the
        default) or stays at the guide's marker.

    >>> PRP.from_points(C=(2, 1), S1=(2, 1), along1=(1, 0), S2=(2, 1), along2=(0, 1))
    PRP(links={}, friction={}, h1=0.0, h2=0.0, x_S1=0.0, x_S2=0.0, slider={})
    """

    kind = "PRP"
    S1 = outer_joint("P", "i", line=Line(along="x_S1", offset="h1"))
    C = inner_joint("R", ("i", "j"))
    S2 = outer_joint("P", "j", line=Line(along="x_S2", offset="h2"))
    built_in = {"C": BuiltIn("i"), "Cj": BuiltIn("j")}
    lengths = ("h1", "h2", "x_S1", "x_S2")
    kernels = Kernels(position, velocity, acceleration, reactions, transmission, size)

    h1: Distance = default(0.0)
    h2: Distance = default(0.0)
    x_S1: Distance = default(0.0)
    x_S2: Distance = default(0.0)
    slider: dict[Literal["S1", "S2"], Literal["later", "earlier"]] = {}

    @classmethod
    def from_points(
        cls, C: Point, S1: Point, along1: Point, S2: Point, along2: Point, **fields: object
    ) -> PRP:
        """Make the dyad from one pose: its joints [m] and the guides' directions.

        S1, S2 are the sliders' points, anywhere on the guide lines. Raises `GraphError`
        where the guides are parallel.
        """
        where = "PRP.from_points"
        c, s1, s2 = given_points(where, C=C, S1=S1, S2=S2)
        u1, u2 = unit(where, along1), unit(where, along2)
        if cross(u1, u2) == 0:
            raise dead_centre(where, "the guides are parallel")
        return cls(
            h1=cross(u1, s1 - c),
            x_S1=dot(u1, s1 - c),
            h2=cross(u2, s2 - c),
            x_S2=dot(u2, s2 - c),
            **fields,  # type: ignore[arg-type]
        )
