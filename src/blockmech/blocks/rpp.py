r"""RPP dyad: a link on a pin slides on a link that slides on a guide (class II, fifth type).

          B                links    i on the pin, j the slider between
          | i              joints   B   R, outer; fed by an earlier link
        [S1]_________               S1  P, inner
          |u1   [S]  u2             S   P, outer; fed by a guide of an earlier link
          O____j____|->    one assembly mode: there is no branch

u2 is the outer guide's direction, u1 = u2 turned by beta the inner one's, n = i u.
The inner guide line lies at h_i along n1 from B and at h_j from O, the origin of
link j, which is on the outer guide line. Points, velocities and forces are complex
numbers x + iy (SI, radians) of any batch shape (...).

Sources: [R10] Ruiz, Durango & Calle 2010, Eqs. 2-7, by analogy; [D14] Durango et
al. 2014, section 2 (groups of the second class).
"""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

from pydantic import field_validator

from blockmech.blocks.contract import BuiltIn, Kernels, Line, inner_joint, outer_joint
from blockmech.blocks.modes import OneMode
from blockmech.blocks.motion import (
    DyadAcceleration,
    Point,
    acceleration_at,
    angle_between,
    dead_centre,
    given_points,
    unit,
    velocity_at,
)
from blockmech.ground.plane import EPS, cross, dot, expi, hyp, imul, maximum, mul
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Angle, Distance, default
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

Owner = Literal["later", "earlier", "j", "i"]


class RPPPose(NamedTuple):
    """Places of both links, arms from the guide's marker, determinant, distance to dead centre."""

    i: LinkPosition
    j: LinkPosition
    arm_B: Complex  # (...) [m]  B - G, from the marker of the outer guide
    arm_O: Complex  # (...) [m]  O - G
    det: Real  # [-]  cross(u2, u1) = sin(beta)
    margin: Real  # [-]  sin^2 of the angle between the guides, a constant


class RPPVelocity(NamedTuple):
    """Velocities of both links and the sliding rates."""

    i: LinkVelocity
    j: LinkVelocity
    S1: Real  # (...) [m/s] of link j on link i
    S: Real  # (...) [m/s] of link j on the outer guide


class RPPReactions(NamedTuple):
    """Force [N] on link i at B, what link i does to link j, and the outer guide to link j."""

    B: Complex
    S1: Slide
    S: Slide


def position(B: Complex, S: Guide, p: RPP) -> RPPPose:
    """Move link j along the outer guide until the inner guide passes B at its offset."""
    G, u2 = S
    turn = expi(p.beta)
    u1 = u2 * turn
    sine = turn.imag
    arm_B = B - G
    arm_O = mul(u2, -(cross(u1, arm_B) + (p.h_i - p.h_j)) / sine)
    return RPPPose(
        LinkPosition(B, u1), LinkPosition(G + arm_O, u2), arm_B, arm_O, sine, sine * sine
    )


def slides(pose: RPPPose, rhs: Complex) -> tuple[Real, Real]:
    """Solve ``-x1 u1 + x2 u2 = rhs``."""
    k = 1 / pose.det
    return cross(rhs, pose.j.e) * k, cross(rhs, pose.i.e) * k


def velocity(pose: RPPPose, v_B: Complex, v_S: LinkVelocity, p: RPP) -> RPPVelocity:
    """Velocities [m/s] of the links' origins, the guide's rate [rad/s], sliding rates [m/s]."""
    om = v_S.om
    slide_1, slide = slides(pose, v_B - velocity_at(v_S, pose.arm_B))
    v_O = velocity_at(v_S, pose.arm_O) + mul(pose.j.e, slide)
    return RPPVelocity(LinkVelocity(v_B, om), LinkVelocity(v_O, om), slide_1, slide)


def acceleration(
    pose: RPPPose, vel: RPPVelocity, a_B: Complex, a_S: LinkAcceleration, p: RPP
) -> DyadAcceleration:
    """Accelerations [m/s2] of the links' origins, the guide's angular acceleration [rad/s2].

    What the guide does to the links by its own motion contains Coriolis' 2 i om s' u.
    """
    om, u1, u2 = vel.j.om, pose.i.e, pose.j.e
    coriolis = imul(mul(u2, vel.S) - mul(u1, vel.S1), 2 * om)
    _, slide = slides(pose, a_B - acceleration_at(a_S, om, pose.arm_B) - coriolis)
    a_O = acceleration_at(a_S, om, pose.arm_O) + imul(u2, 2 * om * vel.S) + mul(u2, slide)
    return DyadAcceleration(LinkAcceleration(a_B, a_S.al), LinkAcceleration(a_O, a_S.al))


def reactions(pose: RPPPose, load_i: Load, load_j: Load, p: RPP) -> RPPReactions:
    """Split the load of link j along the two normals, then balance link i.

    Loads are (force [N], moment about the link's origin [N m]); the guide couples are
    about O, the inner one also about B.
    """
    (F_i, M_i), (F_j, M_j) = load_i, load_j
    k = 1 / pose.det
    N1, N = dot(F_j, pose.j.e) * k, -dot(F_j, pose.i.e) * k
    C1 = M_i - N1 * dot(pose.arm_O - pose.arm_B, pose.i.e)
    return RPPReactions(imul(pose.i.e, N1) - F_i, Slide(N1, C1, M_i), Slide(N, -M_j - C1))


def transmission(pose: RPPPose, p: RPP) -> tuple[Real, Real]:
    """Sine and cosine of the angle between the guides."""
    return abs(pose.det), abs(dot(pose.i.e, pose.j.e))


def size(pose: RPPPose, p: RPP) -> Real:
    """The larger distance [m] of B and O from the guide's marker: no parameter says it."""
    return maximum(hyp(pose.arm_B), hyp(pose.arm_O))


class RPP(OneMode, type="dyad.rpp"):
    """A link on a pin at B, in a guide of a slider that moves on an outer guide.

    Parameters
    ----------
    beta : float [rad]
        Angle of the inner guide from the outer one, on link j; not a multiple of pi.
    h_i, h_j : float [m]
        Offset of the inner guide line from B and from O, along its normal.
    x_S1 : float [m]
        Place of the inner slider's point along the inner guide line, from the foot of
        the origin of the link that owns it.
    x_S : float [m]
        Place of the outer slider's point along the outer guide line, from O.
    slider : map joint -> "later" | "earlier", of S1 also "j" | "i"
        Which link the point, where the normal force acts, moves with; by default the
        later one. A single word is for the inner joint S1.

    >>> RPP.from_points(B=(2, 1), S1=(2, 1), along1=(0, 1), S=(0, 0), along=(1, 0)).x_S
    -2.0
    """

    kind = "RPP"
    B = outer_joint("R", "i")
    S1 = inner_joint(
        "P",
        ("i", "j"),
        lines={"i": Line("x_S1", offset="h_i"), "j": Line("x_S1", offset="h_j", turn="beta")},
    )
    S = outer_joint("P", "j", line=Line(along="x_S"))
    built_in = {"B": BuiltIn("i"), "O": BuiltIn("j")}
    lengths = ("h_i", "h_j", "x_S1", "x_S")
    kernels = Kernels(position, velocity, acceleration, reactions, transmission, size)

    beta: Angle
    h_i: Distance = default(0.0)
    h_j: Distance = default(0.0)
    x_S1: Distance = default(0.0)
    x_S: Distance = default(0.0)
    slider: dict[Literal["S1", "S"], Owner] = {}

    @field_validator("beta")
    @classmethod
    def _guides_differ(cls, beta: float) -> float:
        if abs(math.sin(beta)) <= 2 * EPS * max(1.0, abs(beta)):
            message = "must not be a multiple of pi rad, for the two guides would be parallel"
            raise mistake("wrong-value", message)
        return beta

    @field_validator("slider", mode="before")
    @classmethod
    def _inner_slider(cls, slider: Any) -> Any:
        return {"S1": slider} if isinstance(slider, str) else slider

    @field_validator("slider")
    @classmethod
    def _outer_slider(cls, slider: dict[str, str]) -> dict[str, str]:
        if slider.get("S") in ("i", "j"):
            raise mistake("wrong-value", 'must say "later" or "earlier" for the outer joint S')
        return slider

    @classmethod
    def from_points(
        cls, B: Point, S1: Point, along1: Point, S: Point, along: Point, **fields: object
    ) -> RPP:
        """Make the dyad from one pose: its joints [m] and the guides' directions.

        S1, S are the sliders' points, anywhere on the inner and on the outer guide
        line. O becomes the point where the lines meet, so that h_j is 0. Raises
        `GraphError` where the guides are parallel.
        """
        where = "RPP.from_points"
        b, s1, s = given_points(where, B=B, S1=S1, S=S)
        u1, u2 = unit(where, along1), unit(where, along)
        sine = cross(u2, u1)
        if sine == 0:
            raise dead_centre(where, "the guides are parallel")
        o = s + u2 * (cross(s1 - s, u1) / sine)
        slider = fields.get("slider")
        owner = slider.get("S1") if isinstance(slider, dict) else ""
        return cls(
            beta=angle_between(u2, u1),
            h_i=cross(u1, s1 - b),
            x_S1=dot(u1, s1 - (b if owner in ("earlier", "i") else o)),
            x_S=dot(u2, s - o),
            **fields,  # type: ignore[arg-type]
        )
