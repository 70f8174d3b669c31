"""Special lengths: links that counting holds too often, and that move all the same.

A parallelogram with three equal cranks has no mobility by count and one in fact. What counts
is the rank of the velocity conditions in the closed pose; that it is no dead centre, where a
structure can move for a moment only, is seen after a small step along the motion found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from blockmech.assur.formation import formation
from blockmech.model.joints.closing import SINGULAR, Closing, Floats, Layout, Poses
from blockmech.model.joints.contents import FRAME

MOST_LINKS = 60
"""Links whose velocity conditions are judged: singular values of them all take 10 ms."""


@dataclass(frozen=True)
class Special:
    """Links that move because of their lengths, against the count.

    Attributes
    ----------
    freedom : freedoms in the pose, drivers not held
    links : those that take part, by name
    spare : a link without which the rest is a mechanism as it should be, with its joints
    """

    freedom: int
    links: tuple[str, ...]
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
    return Special(freedom, tuple(links), _spare(links, layout))


def _keeps_moving(closing: Closing, poses: Poses, motion: Floats, mobility: int) -> bool:
    """Whether the freedoms are there a step further on as well.

    The step's square, by which a structure at a dead centre gapes, is larger than what is
    taken for nothing.
    """
    step = motion * math.sqrt(10 * SINGULAR) / np.abs(motion).max()
    ahead = closing.refine(poses.moved(closing.links, step, closing.size))
    moved = np.concatenate([ahead.theta - poses.theta, (ahead.o - poses.o) / closing.size])
    far = np.abs(moved).max() > np.abs(step).max() / 10
    return bool(far) and closing.closed(ahead) and closing.freedom(ahead)[0] > mobility


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
