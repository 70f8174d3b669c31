"""Special lengths: links that counting holds too often, and that move all the same.

A parallelogram with three equal cranks has no mobility by count and one in fact. What counts
is the rank of the velocity conditions in the closed pose; that it is no dead centre, where a
structure can move for a moment only, is seen after a small step along the motion found.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from blockmech.assur.formation import formation
from blockmech.model.joints.closing import SINGULAR, Closing, Floats
from blockmech.model.joints.contents import FRAME
from blockmech.model.joints.layout import Layout, Poses

MOST_LINKS = 60
"""Links whose velocity conditions are judged: singular values of them all take 10 ms."""


class Special(NamedTuple):
    """Links that move because of their lengths, against the count.

    freedom : freedoms in the pose, drivers not held
    links : those that take part, by name
    spare : a link without which the rest is a mechanism as it should be, with its joints
    """

    freedom: int
    links: list[str]
    spare: tuple[str, tuple[str, ...]] | None


def special_geometry(layout: Layout, mobility: int) -> Special | None:
    """What is special, or None where links move no better than other lengths let them."""
    closing = Closing(layout.links, tuple(layout.pairs.values()), layout.size, {})
    poses = closing.refine(layout.given)
    if not closing.closed(poses):
        return None
    freedom, motion = closing.freedom(poses)
    if freedom <= mobility or not _keeps_moving(closing, poses, motion, mobility):
        return None
    names = closing.stressed(poses)
    links = sorted({link for name in names for link in layout.pairs[name].links})
    return Special(freedom, links, _spare(links, layout))


def _keeps_moving(closing: Closing, poses: Poses, motion: Floats, mobility: int) -> bool:
    """Whether the freedoms are there a step further on as well.

    The step's square, by which a structure at a dead centre gapes, is larger than what is
    taken for nothing.
    """
    step = motion * math.sqrt(10 * SINGULAR) / np.abs(motion).max()
    ahead = closing.refine(closing.moved(poses, step))
    far = max(
        max(abs(ahead[a].theta - poses[a].theta), abs(ahead[a].o - poses[a].o) / closing.size)
        for a in closing.links
    )
    if not far > np.abs(step).max() / 10:
        return False
    return closing.closed(ahead) and closing.freedom(ahead)[0] > mobility


def _spare(links: list[str], layout: Layout) -> tuple[str, tuple[str, ...]] | None:
    """The last link without which, and without its joints, the rest can be put in sequence."""
    for link in sorted(set(links) - {FRAME}, reverse=True):
        own = tuple(name for name, c in layout.pairs.items() if link in c.links)
        if layout.drivers.keys() & own:
            continue
        others = [a for a in layout.links if a != link]
        rest = [c for name, c in layout.pairs.items() if name not in own]
        if formation(others, rest, (FRAME,), layout.drivers).complete:
            return link, own
    return None
