"""Modes of groups of class IV and higher: what a numerical search finds, perhaps not all.

The modes of a triad are the roots of a polynomial. For larger groups none is at hand, so
Newton's method goes from many poses, the same ones every time, to poses that close.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.general.block import InnerPair
from blockmech.blocks.modes import Mode
from blockmech.model.joints.closing import Closing
from blockmech.model.joints.contents import FRAME
from blockmech.model.joints.layout import Connection, Pose, Poses
from blockmech.modes.closing import SAME
from blockmech.modes.triad import Support
from blockmech.typing import Guide, LinkPosition

STARTS = 60  # poses from which is searched: ten for each of a triad's six modes
NOTE = f"what Newton's method finds from {STARTS} poses, dead centres left out: there may be more"


def searched(
    group: GeneralGroup, supports: Mapping[str, Support], q: Sequence[float], first: Poses
) -> list[Mode]:
    """Modes of a group that are found, the one nearest to ``first`` poses first.

    Parameters
    ----------
    supports : outer joint -> place [m], or place and direction, of the earlier link
    q : coordinates [rad or m] of the group's driven joints, in their order
    first : poses of the links from which the search begins; NaN where they are not known

    Cost: a step of Newton's for each start and iteration, a second for five links.
    """
    size, names = group.largest_length() or 1.0, group.link_names
    values, driven = {}, [joint.name for joint in group.driven]
    pairs = list(_pairs(group, supports))
    for joint, x in zip(driven, q, strict=True):
        (c,) = (pair for pair in pairs if pair.name == joint)
        turn = cmath.phase(c.along[0]) - cmath.phase(c.along[1])
        values[joint] = x / size if c.kind == "P" else x + turn
    closing, chance = Closing(names, pairs, size, values), np.random.default_rng(0)
    middle = np.mean([s.p if isinstance(s, Guide) else s for s in supports.values()])
    every: list[Poses] = []
    for k in range(STARTS):
        spot = size * chance.normal(size=(len(names), 2)) @ (1, 1j)
        chosen = zip(names, spot, chance.uniform(-math.pi, math.pi, len(names)), strict=True)
        start = {name: Pose(complex(middle + o), float(angle)) for name, o, angle in chosen}
        start = (
            dict(first) if k == 0 and all(cmath.isfinite(x.o) for x in first.values()) else start
        )
        poses = closing.refine({FRAME: Pose(), **start})
        if closing.closed(poses) and all(
            _apart(poses, previous, names, size) > SAME for previous in every
        ):
            every.append(poses)
    return [mode for poses in every if not (mode := _mode(closing, poses)).double]


def _pairs(group: GeneralGroup, supports: Mapping[str, Support]) -> Iterator[Connection]:
    """The pairs of a group, with its supports on the fixed link."""
    for name, pair in group.pairs.items():
        sides = [(m.at.z, m.direction) for m in pair.sides.values()]
        if isinstance(pair, InnerPair):
            first, second = pair.links
        else:
            first, second, support = FRAME, pair.link, supports[name]
            guide = support if isinstance(support, Guide) else Guide(support, sides[0][1])
            sides.insert(0, (complex(guide.p), complex(guide.u)))
        (a, u), (b, w) = sides
        yield Connection(name, first, second, pair.type, at=(a, b), along=(u, w))


def _apart(first: Poses, second: Poses, names: Sequence[str], size: float) -> float:
    """How far two sets of poses are apart [-], by the size and in directions."""
    distances = [abs(first[n].o - second[n].o) / size for n in names]
    return max(*distances, *(abs(first[n].direction(1) - second[n].direction(1)) for n in names))


def _mode(closing: Closing, poses: Poses) -> Mode:
    """A mode: its places, margin and sign by the Jacobian of the closing."""
    matrix = closing.conditions(poses)[1]
    s = np.linalg.svd(matrix, compute_uv=False)
    margin, double = float((s[-1] / s[0]) ** 2), bool(s[-1] <= SAME * s[0])
    sign = 0 if double else int(np.sign(np.linalg.det(matrix)))
    links = {n: LinkPosition(poses[n].o, poses[n].direction(1)) for n in closing.links}
    return Mode(links, margin, sign, double)
