"""Branches of dyads that follow the motion through change points.

One factor +1 or -1 a change point: the side of it on which the driver is. For a crank
the side is the sign of sin((q - q_c)/2), which changes at q_c and one turn further on,
and so on: an odd number of change points a turn gives another mode on every other turn.

At the distance d [rad] from a change point a place has lost eps/d, a rate eps/d^2, an
acceleration or a reaction eps/d^3 (measured on a rhombus: 3e-13, 3e-9 and 6e-7 at d = 1e-4,
1e-4 and 1e-3), and dyads in a row pass on what they have lost. So nearer than eps^(1/4),
1.2e-4 rad in double precision, there is no answer: the branch is NaN, and with it the dyad.

Sources: Hunt, Kinematic Geometry of Mechanisms, 1978 (uncertainty configurations).
"""

from __future__ import annotations

from blockmech.ground.plane import EPS, cross, expi, sign, sqrt
from blockmech.model.structure import FollowedBranch
from blockmech.plan import values
from blockmech.plan.plan import Schedule
from blockmech.plan.values import HALF, Value
from blockmech.typing import Complex, Real


def side_of(x: Real, scale: Real) -> Real:
    """+1 or -1 by the sign of a distance; NaN where it is too small to tell anything."""
    return sign(x) * sqrt(sign(abs(x) - scale * sqrt(sqrt(EPS))))


def passed(branch: Real, half: Complex, point: Complex, scale: Real) -> Real:
    """The branch on this side of a change point; ``half``, ``point`` at half the angles."""
    return branch * side_of(cross(point, half), 0.5 * scale)


def passed_slide(branch: Real, q: Real, point: Real, scale: Real) -> Real:
    """The branch on this side of a change point of a slide; ``scale`` is a length of it [m]."""
    return branch * side_of(q - point, scale)


def followed(s: Schedule, block: str, numbers: Value) -> Value:
    """The block's numbers with the branch that follows the motion."""
    branch = s.ask(branch_along, s.structure.followed[block])
    return s.line(numbers.replaced(branch=branch), f"P_{block}_here")


def branch_along(s: Schedule, change: FollowedBranch) -> Value:
    """The branch as a function of the driver; dyads that change together share it."""
    branch = s.parameter(("branch", change.first), lambda *_: change.first, "branch")
    if not change.points:
        return branch
    q = s.input("q", change.driver)
    rotary = s.structure.driver_joint(change.driver).rotary
    coordinate = s.line(values.expi(HALF * q), "half_turned") if rotary else q
    passing = passed if rotary else passed_slide
    scale = s.parameter(("scale", change.scale), lambda *_: change.scale, "scale")
    for point in change.points:
        value = expi(0.5 * point) if rotary else point
        slot = s.parameter(("change point", point), lambda *_, x=value: x, "change_point")
        branch = s.emit(passing, branch, coordinate, slot, scale, name="branch")
    return branch
