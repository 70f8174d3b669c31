"""Assembly modes of the dyads: the closed forms of the blocks with each branch.

RRR, RRP and RPR have two modes, told apart by the sign of their determinant (`branch`),
PRP and RPP have one. Both modes of a dyad have the same margin, so they exist at the same
places, and where it is zero they merge.
Source: the kernels of `blockmech.blocks`.
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from blockmech.blocks.contract import AssurGroup
from blockmech.typing import LinkPosition


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
    found: list[Mode] = []
    for branch in branches(dyad):
        one = dyad if branch is None else dyad.model_copy(update={"branch": branch})
        try:
            pose = one.kernels.position(*supports, one.parameters())
        except ZeroDivisionError:  # two pivots on each other, parallel guides: no pose, or any
            continue
        links = {name: getattr(pose, name) for name in dyad.link_names}
        finite = all(cmath.isfinite(z) for link in links.values() for z in link)
        double = pose.margin == 0
        if pose.margin >= 0 and finite and not any(mode.double for mode in found):
            sign = 0 if double else branch or 1
            found.append(Mode(links, float(pose.margin), sign, double, branch))
    return tuple(found)
