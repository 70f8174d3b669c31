"""Where pairs are: places and guides on the links that they join, by what blocks declare."""

from __future__ import annotations

from typing import NamedTuple

from blockmech.model.structure import JointRef, LinkRef, MarkerRef, Structure


class Spot(NamedTuple):
    """A place on a link, in the link's frame [m]."""

    link: LinkRef
    at: complex


def marker_place(structure: Structure, ref: MarkerRef) -> complex:
    """Place [m] of a marker in the frame of its link."""
    return structure.block(ref.block).place_of(structure.marker(ref))


def pin_spot(s: Structure, ref: JointRef) -> Spot | None:
    """Where a revolute pair is: its wired marker, or the own marker of its name."""
    markers = (m for m in s.markers(ref.block) if m.name == ref.name)
    marker = s.feeds[ref] if ref in s.feeds else next(markers, None)
    return None if marker is None else Spot(marker.on, marker_place(s, marker))


def guide_spots(s: Structure, ref: JointRef) -> tuple[Spot, Spot, complex]:
    """The slider's point of a prismatic pair, its guide, and the guide's direction on its link."""
    block, joint = s.blocks[ref.block], s.joint(ref)
    later = block.slider_owner(ref.name) == "later"

    def point_on(link: str) -> Spot:
        return Spot(LinkRef(ref.block, link), block.slider_place(ref.name, link))

    def line_on(link: str) -> tuple[Spot, complex]:
        foot, direction = block.guide_line(ref.name, link)
        return Spot(LinkRef(ref.block, link), foot), direction

    if joint.outer:
        marker = s.feeds[ref]
        wired = Spot(marker.on, marker_place(s, marker))
        axis = complex(getattr(s.marker(marker), "direction", 1 + 0j))
        point = point_on(joint.link) if later else wired
        guide, direction = (wired, axis) if later else line_on(joint.link)
    else:
        mover, holder = joint.links[::-1] if later else joint.links
        point = point_on(mover)
        guide, direction = line_on(holder)
    return point, guide, direction
