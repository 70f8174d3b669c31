"""Special lengths: links that counting holds too often, and that move all the same.

A parallelogram with three equal cranks has no mobility by count and one in fact. What counts
is the rank of the velocity conditions in the closed pose; that it is no dead centre, where a
structure can move for a moment only, is seen after a small step along the motion found.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from blockmech.assur.formation import formation
from blockmech.assur.pairs import Pair
from blockmech.model.joints.closing import Closing, Floats, Poses
from blockmech.model.joints.connections import Connections, structural
from blockmech.model.joints.contents import FRAME
from blockmech.model.joints.matrix import LEAST_SQUARES, SINGULAR

STEP = 1e-3  # [-] of the size and of a radian: shows whether a structure really moves
TAKES_PART = 1e-6  # [-] of the largest; smaller shares of a self-stress are rounding
MOST_TRIES = 50  # links that are taken away to see whether the rest works


@dataclass(frozen=True)
class Layout:
    """Links and joints of a document, as counting and closing see them.

    Attributes
    ----------
    given : the links in the pose that is given
    pairs, axis : joints two by two, and which of them share a pin or a direction
    drivers : driven joint -> driver
    size : of the mechanism [m]
    """

    given: Poses
    pairs: Connections
    axis: Mapping[str, str]
    drivers: Mapping[str, str]
    size: float

    @property
    def links(self) -> Sequence[str]:
        """The moving links."""
        return self.given.links

    @property
    def driven(self) -> Collection[str]:
        """The driven joints."""
        return self.drivers.keys()

    @property
    def counted(self) -> tuple[Pair, ...]:
        """The joints without geometry."""
        return tuple(structural(self.pairs, self.axis))


@dataclass(frozen=True)
class Special:
    """Links that move because of their lengths, against the count.

    Attributes
    ----------
    freedom : freedoms in the pose, drivers not held
    redundant : conditions of joints that others imply in the pose
    links, pairs : those that take part, by name
    spare : a link without which the rest is a mechanism as it should be, with its joints
    """

    freedom: int
    redundant: int
    links: tuple[str, ...]
    pairs: tuple[str, ...]
    spare: tuple[str, tuple[str, ...]] | None


def special_geometry(layout: Layout, mobility: int) -> Special | None:
    """What is special, or None where links move no better than other lengths let them."""
    if 3 * len(layout.links) > LEAST_SQUARES:
        return None
    closing = Closing(layout.links, layout.pairs, (), layout.size)
    poses = closing.refine(layout.given, hold=False)
    if not closing.closed(poses):
        return None
    freedom, motion = closing.freedom(poses)
    if freedom <= mobility or not _keeps_moving(closing, poses, motion, mobility):
        return None
    names, redundant = _stressed(closing, poses)
    links = sorted({link for name in names for link in layout.pairs[name].links})
    spare = _spare(links, layout)
    return Special(freedom, redundant, tuple(links), names, spare)


def _keeps_moving(closing: Closing, poses: Poses, motion: Floats, mobility: int) -> bool:
    """Whether the freedoms are there a step further on as well."""
    step = (motion * STEP / np.abs(motion).max()).reshape(-1, 3)
    o = poses.o + (step[:, 0] + 1j * step[:, 1]) * closing.size
    ahead = closing.refine(Poses(poses.links, o, poses.theta + step[:, 2]), hold=False)
    moved = max(
        float(np.abs(ahead.theta - poses.theta).max()),
        float(np.abs(ahead.o - poses.o).max()) / closing.size,
    )
    return closing.closed(ahead) and moved > STEP / 10 and closing.freedom(ahead)[0] > mobility


def _stressed(closing: Closing, poses: Poses) -> tuple[tuple[str, ...], int]:
    """Joints that can press against each other, and the number of redundant conditions."""
    _, matrix = closing.conditions(poses)
    u, s, _ = np.linalg.svd(matrix.full(), full_matrices=True)
    idle = u[:, int((s > SINGULAR * s.max(initial=0.0)).sum()) :]
    if not idle.size:
        return (), 0
    share = np.abs(idle).max(axis=1).reshape(-1, 2).max(axis=1)
    names = [c.name for c in (*closing.pins, *closing.guides)]
    taking = [n for n, x in zip(names, share, strict=True) if x > TAKES_PART * share.max()]
    return tuple(sorted(taking)), idle.shape[1]


def _spare(links: list[str], layout: Layout) -> tuple[str, tuple[str, ...]] | None:
    """The last link without which, and without its joints, the rest can be put in sequence."""
    for link in sorted(set(links) - {FRAME}, reverse=True)[:MOST_TRIES]:
        own = tuple(name for name, c in layout.pairs.items() if link in c.links)
        if set(own) & set(layout.driven):
            continue
        rest = {name: c for name, c in layout.pairs.items() if name not in own}
        others = [a for a in layout.links if a != link]
        if formation(others, structural(rest, layout.axis), (FRAME,), layout.driven).complete:
            return link, own
    return None
