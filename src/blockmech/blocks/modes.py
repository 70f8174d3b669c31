"""Assembly modes of the dyads: which there are, and the one of two that a block has.

RRR, RRP and RPR have two modes, told apart by the sign of their determinant (`branch`),
PRP and RPP have one. Both modes of a dyad have the same margin, so they exist at the same
places, and where it is zero they merge.

At a *change point* the determinant of a dyad touches zero between two places where it
closes: a parallelogram with all its links on one line. There both modes meet. With a
given branch the links turn back from there in a corner; a real mechanism in motion
passes, because its links have inertia. ``"branch": "follow"`` is that: the branch changes
sign at every change point, so that the links' rates stay continuous.

Which mode that is at a coordinate q depends on q alone: the mode at the block's *home*,
times -1 for each change point between home and q along the driver.
"""

from __future__ import annotations

import cmath
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import BeforeValidator, Field, model_validator

from blockmech.blocks.block import refuse
from blockmech.blocks.contract import AssurGroup
from blockmech.ground.errors import shown
from blockmech.ground.plane import EPS, cross, sign, sqrt
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Axis, Branch, Finite, StrictModel, Units
from blockmech.typing import Complex, LinkPosition, Parameters, Real

FOLLOW = "follow"


class BranchHome(StrictModel):
    """A pose of the mechanism, by its driver, and the branch of the dyad in it.

    drivers : the one driver that moves the dyad -> its coordinate [rad or m]
    branch : +1 | -1, the assembly mode there
    """

    refers: ClassVar[tuple[str, ...]] = ("drivers",)

    drivers: Annotated[dict[str, Finite], Field(min_length=1)]
    branch: Branch

    def units(self, axis: Axis) -> Units:
        """The drivers' coordinates."""
        return {"drivers": axis.coordinates}


def _check_branch(raw: Any) -> Any:
    if raw == FOLLOW or (raw in (-1, 1) and not isinstance(raw, bool)):
        return raw
    raise mistake("wrong-value", f'must be -1, 1 or "{FOLLOW}", got {shown(raw)}')


AnyBranch = Annotated[
    Literal[-1, 1, "follow"],
    Field(description="assembly mode, or the one that the motion carries on"),
    BeforeValidator(_check_branch),
]


class Dyad(AssurGroup):
    """An Assur group of class II: two links between two joints of earlier links."""

    group_class = "II"
    link_names = ("i", "j")


class OneMode(Dyad):
    """A dyad with one assembly mode, because its guides fix the pose: it takes no branch."""

    @model_validator(mode="before")
    @classmethod
    def _no_branch(cls, raw: Any) -> Any:
        if isinstance(raw, dict) and "branch" in raw:
            why = "it has one assembly mode, its guides fix the pose"
            message = f'{cls.kind} takes no "branch": {why}'
            refuse(cls.kind, [(("branch",), mistake("unknown-key", message, "", "remove it"))])
        return raw


class TwoModes(Dyad):
    """A dyad with two assembly modes; its subclasses declare ``branch`` and ``home``."""

    if TYPE_CHECKING:
        branch: AnyBranch
        home: BranchHome | None

    @model_validator(mode="after")
    def _home_if_it_follows(self) -> TwoModes:
        if self.branch == FOLLOW and self.home is None:
            raise mistake(
                "missing-key",
                'a branch that follows the motion needs a "home"',
                "",
                'add "home": {"drivers": {"<driver>": <coordinate>}, "branch": 1}',
            )
        if self.branch != FOLLOW and self.home is not None:
            raise mistake(
                "unknown-key", f'"home" has no meaning with branch {self.branch}', "", "remove it"
            )
        return self

    @abstractmethod
    def reach(self, apart: float, margin: float) -> tuple[str, float, float, float]:
        """The length that decides on assembly: description, value, minimum, maximum [m].

        ``apart`` is the distance [m] of the outer pins; each "{}" of the description is one.
        """

    @property
    def follows(self) -> bool:
        """Whether the branch changes at change points."""
        return bool(getattr(self, "branch", None) == FOLLOW)

    def parameters(self) -> Parameters:
        """Parameters of the block; a branch that follows counts as at the home pose."""
        if not self.follows or self.home is None:
            return super().parameters()
        at_home = self.model_copy(update={"branch": self.home.branch, "home": None})
        return at_home.parameters()


class Mode(NamedTuple):
    """One assembly mode of a group.

    links : link -> its place: origin [m] and unit direction [-]
    margin : of the dyad, or of the triad's platform [-]
    sign : of the determinant: the branch of a dyad, +1 where it has one mode; 0 if double
    double : whether modes coincide here: a dead centre
    branch : +1 or -1 as the file has it; None for a group that has none
    residual : of a triad, the largest miss of a leg, relative to its size [-]
    """

    links: Mapping[str, LinkPosition]
    margin: float
    sign: int
    double: bool
    branch: int | None = None
    residual: float | None = None


def branches(dyad: AssurGroup) -> tuple[int | None, ...]:
    """The branches of a dyad, or None where it has one mode."""
    return (1, -1) if "branch" in type(dyad).model_fields else (None,)


def dyad_modes(dyad: AssurGroup, supports: Sequence[Any]) -> tuple[Mode, ...]:
    """All assembly modes of a dyad: both branches, one if they coincide, none out of reach.

    Parameters
    ----------
    dyad : a block RRR, RRP, RPR, PRP or RPP, or a cylinder; its own branch does not matter
    supports : what its outer joints read, in the order of declaration: places [m] or guides;
        for a cylinder the driver's length [m] after them

    >>> from blockmech import RRR
    >>> dyad = RRR(l_i=5.0, l_j=5.0)
    >>> [(m.branch, round(m.links["i"].e.imag, 6)) for m in dyad_modes(dyad, [0j, 8 + 0j])]
    [(1, 0.6), (-1, -0.6)]
    """
    modes: list[Mode] = []
    numbers = dyad.parameters()
    for branch in branches(dyad):
        p = numbers if branch is None else numbers._replace(branch=float(branch))
        try:
            pose = dyad.kernels.position(*supports, p)
        except ZeroDivisionError:  # two pivots on each other, parallel guides: no pose, or any
            continue
        links = {name: getattr(pose, name) for name in dyad.link_names}
        finite = all(cmath.isfinite(z) for link in links.values() for z in link)
        double = pose.margin == 0
        if pose.margin >= 0 and finite and not any(mode.double for mode in modes):
            sign = 0 if double else branch or 1
            modes.append(Mode(links, float(pose.margin), sign, double, branch))
    return tuple(modes)


# -- branches through change points ---------------------------------------------------------
#
# One factor +1 or -1 a change point: the side of it on which the driver is. For a crank
# the side is the sign of sin((q - q_c)/2), which changes at q_c and one turn further on,
# and so on: an odd number of change points a turn gives another mode on every other turn.
#
# At the distance d [rad] from a change point a place has lost eps/d, a rate eps/d^2, an
# acceleration or a reaction eps/d^3 (measured on a rhombus: 3e-13, 3e-9 and 6e-7 at d = 1e-4,
# 1e-4 and 1e-3), and dyads in a row pass on what they have lost. So nearer than eps^(1/4),
# 1.2e-4 rad in double precision, there is no answer: the branch is NaN, and with it the dyad.
#
# Sources: Hunt, Kinematic Geometry of Mechanisms, 1978 (uncertainty configurations).


def side_of(x: Real, scale: Real) -> Real:
    """+1 or -1 by the sign of a distance; NaN where it is too small to tell anything."""
    return sign(x) * sqrt(sign(abs(x) - scale * sqrt(sqrt(EPS))))


def passed(branch: Real, half: Complex, point: Complex, scale: Real) -> Real:
    """The branch on this side of a change point; ``half``, ``point`` at half the angles."""
    return branch * side_of(cross(point, half), 0.5 * scale)


def passed_slide(branch: Real, q: Real, point: Real, scale: Real) -> Real:
    """The branch on this side of a change point of a slide; ``scale`` is a length of it [m]."""
    return branch * side_of(q - point, scale)
