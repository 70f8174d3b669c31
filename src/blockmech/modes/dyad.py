"""Assembly modes of the dyads: the closed forms of the blocks with each branch.

RRR, RRP and RPR have two modes, told apart by the sign of their determinant (`branch`),
PRP and RPP have one. Both modes of a dyad have the same margin, so they exist at the same
places, and where it is zero they merge.
Source: the kernels of `blockmech.blocks`.
"""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from dataclasses import dataclass

from blockmech.blocks.contract import AssurGroup
from blockmech.modes.triad import Support
from blockmech.typing import LinkPosition


@dataclass(frozen=True)
class DyadMode:
    """One assembly mode of a dyad.

    Attributes
    ----------
    branch : +1 or -1 as the file has it; None for PRP and RPP, which have one mode
    links : link -> its place: origin [m] and unit direction [-]
    margin : of the dyad [-]
    double : whether the two branches coincide here: a dead centre
    """

    branch: int | None
    links: dict[str, LinkPosition]
    margin: float
    double: bool = False

    @property
    def sign(self) -> int:
        """Sign of the determinant: the branch; +1 for a dyad with one mode, 0 if double."""
        return 0 if self.double else self.branch or 1


def branches(dyad: AssurGroup) -> tuple[int | None, ...]:
    """The branches of a dyad, or None where it has one mode."""
    return (1, -1) if "branch" in type(dyad).model_fields else (None,)


def dyad_modes(dyad: AssurGroup, supports: Sequence[Support | float]) -> tuple[DyadMode, ...]:
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
    found: list[DyadMode] = []
    for branch in branches(dyad):
        one = dyad if branch is None else dyad.model_copy(update={"branch": branch})
        try:
            pose = one.kernels.position(*supports, one.parameters())
        except ZeroDivisionError:  # two pivots on each other, parallel guides: no pose, or any
            continue
        links = {name: getattr(pose, name) for name in dyad.link_names}
        finite = all(cmath.isfinite(z) for link in links.values() for z in link)
        if pose.margin >= 0 and finite and not any(mode.double for mode in found):
            found.append(DyadMode(branch, links, float(pose.margin), double=pose.margin == 0))
    return tuple(found)
