"""Special lengths: links that counting holds too often, and that move all the same.

A parallelogram with three equal cranks has no mobility by count and one in fact. What counts
is the rank of the velocity conditions in the closed pose; that it is no dead centre, where a
structure can move for a moment only, is seen after a small step along the motion found.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from blockmech.assur.formation import formation
from blockmech.assur.pairs import Pair
from blockmech.model.joints.closing import FEW, SINGULAR, Closing, Floats, Poses
from blockmech.model.joints.connections import Connections, structural
from blockmech.model.joints.contents import FRAME


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
    links, pairs : those that take part, by name
    spare : a link without which the rest is a mechanism as it should be, with its joints
    """

    freedom: int
    links: tuple[str, ...]
    pairs: tuple[str, ...]
    spare: tuple[str, tuple[str, ...]] | None


def special_geometry(layout: Layout, mobility: int) -> Special | None:
    """What is special, or None where links move no better than other lengths let them."""
    if 3 * len(layout.links) > FEW:
        return None
    closing = Closing(layout.links, layout.pairs, (), layout.size)
    poses = closing.refine(layout.given, hold=False)
    if not closing.closed(poses):
        return None
    freedom, motion = closing.freedom(poses)
    if freedom <= mobility or not _keeps_moving(closing, poses, motion, mobility):
        return None
    names = closing.stressed(poses)
    links = sorted({link for name in names for link in layout.pairs[name].links})
    return Special(freedom, tuple(links), names, _spare(links, layout))


def _keeps_moving(closing: Closing, poses: Poses, motion: Floats, mobility: int) -> bool:
    """Whether the freedoms are there a step further on as well.

    The step's square, by which a structure at a dead centre gapes, is larger than what is
    taken for nothing.
    """
    step = motion * math.sqrt(10 * SINGULAR) / np.abs(motion).max()
    ahead = closing.refine(poses.moved(step, closing.size), hold=False)
    moved = np.concatenate([ahead.theta - poses.theta, (ahead.o - poses.o) / closing.size])
    far = np.abs(moved).max() > np.abs(step).max() / 10
    return bool(far) and closing.closed(ahead) and closing.freedom(ahead)[0] > mobility


def _spare(links: list[str], layout: Layout) -> tuple[str, tuple[str, ...]] | None:
    """The last link without which, and without its joints, the rest can be put in sequence."""
    for link in sorted(set(links) - {FRAME}, reverse=True):
        own = tuple(name for name, c in layout.pairs.items() if link in c.links)
        if set(own) & set(layout.driven):
            continue
        rest = {name: c for name, c in layout.pairs.items() if name not in own}
        others = [a for a in layout.links if a != link]
        if formation(others, structural(rest, layout.axis), (FRAME,), layout.driven).complete:
            return link, own
    return None
