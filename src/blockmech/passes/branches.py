"""The branch of a dyad that follows the motion through change points, as values of a program.

One factor +1 or -1 a change point: the side of it on which the driver is. For a crank
the side is the sign of sin((q - q_c)/2), which changes at q_c and one turn further on,
and so on: an odd number of change points a turn gives another mode on every other turn.
"""

from __future__ import annotations

from typing import Any

from blockmech.model.structure import FollowedBranch
from blockmech.plan import Schedule
from blockmech.plane import cross, expi, sign
from blockmech.typing import Complex, Real


def half_turned(q: Real) -> Complex:
    """Unit vector at half the angle of the driver."""
    return expi(0.5 * q)


def passed(branch: Real, half: Complex, point: Complex) -> Real:
    """The branch on this side of a change point; ``point`` is the unit vector at half of it."""
    return branch * sign(cross(point, half))


def passed_slide(branch: Real, q: Real, point: Real) -> Real:
    """The branch on this side of a change point of a slide."""
    return branch * sign(q - point)


def with_branch(p: Any, branch: Real) -> Any:
    """The block's numbers with the branch of each sample."""
    return p._replace(branch=branch)


def followed(s: Schedule, block: str, numbers: str) -> str:
    """The block's numbers with the branch that follows the motion."""
    there: FollowedBranch = s.structure.followed[block]
    branch = s.ask(branch_along, there)
    return s.emit(with_branch, numbers, branch, name=f"P_{block}_here")


def branch_along(s: Schedule, there: FollowedBranch) -> str:
    """The branch as a function of the driver; dyads that change together share it."""
    branch = s.parameter(("branch", there.first), there.first, "branch")
    if not there.points:
        return branch
    q = s.input("q", there.driver)
    rotary = s.structure.driver_joint(there.driver).rotary
    half = s.emit(half_turned, q, name="half_turned") if rotary else ""
    for point in there.points:
        if rotary:
            slot = s.parameter(("half", point), expi(0.5 * point), "change_point")
            branch = s.emit(passed, branch, half, slot, name="branch")
        else:
            slot = s.parameter(("change point", point), point, "change_point")
            branch = s.emit(passed_slide, branch, q, slot, name="branch")
    return branch
