"""Whether the joints of a pose close, told from declarations and link places alone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.blocks.contract import Joint, Line, Moving
from blockmech.testing.batches import vectors
from blockmech.testing.rig import MarkerMotion, Motions

Array = NDArray[Any]


class Closure:
    """Where a block's own links have the parts of its joints."""

    def __init__(self, block: Moving) -> None:
        self.block = block
        self.slides = [j for j in block.joints.values() if j.kind == "P"]

    def gaps(self, pose: Any, motions: Motions) -> Iterator[tuple[str, Array, str]]:
        """How far the parts of each joint are from each other: what, how far, its unit."""
        for joint in self.block.joints.values():
            if joint.kind == "P":
                yield from self._guide_gaps(pose, joint, motions)
                continue
            pins = self._pins(pose, joint)
            if not pins:
                raise LookupError(f"no built-in marker {joint.name} on a link of the joint")
            if joint.outer:
                pins.append(_marker(motions, joint).p)
            for pin in pins[1:]:
                yield f"gap at joint {joint.name}", abs(pin - pins[0]), "m"

    def _guide_gaps(
        self, pose: Any, joint: Joint, motions: Motions
    ) -> Iterator[tuple[str, Array, str]]:
        point, u = self.line(pose, joint, joint.later)
        base, direction = self.base(pose, joint, motions)
        yield f"gap at joint {joint.name}", abs(((point - base) * np.conj(direction)).imag), "m"
        yield f"angle at joint {joint.name}", abs(u - direction), ""

    def stroke(self, pose: Any, joint: Joint, motions: Motions) -> Array:
        """How far [m] the later link's point has slid on the earlier link's guide."""
        point, _ = self.line(pose, joint, joint.later)
        base, u = self.base(pose, joint, motions)
        stroke: Array = ((point - base) * np.conj(u)).real
        return stroke

    def line(self, pose: Any, joint: Joint, link: str) -> tuple[Array, Array]:
        """A point of a guide line on one of the block's links, and its direction."""
        place, line = getattr(pose, link), joint.lines.get(link, Line())
        e = vectors(place.e)
        turn = float(getattr(self.block, line.turn)) if line.turn else 0.0
        at = self.block.slider_place(joint.name, link)
        return vectors(place.o) + e * at, e * np.exp(1j * turn)

    def base(self, pose: Any, joint: Joint, motions: Motions) -> tuple[Array, Array]:
        """A point of the guide line on the earlier link, and its direction."""
        if not joint.outer:
            return self.line(pose, joint, joint.links[0])
        m = _marker(motions, joint)
        return m.p, np.exp(1j * m.phi)

    def _pins(self, pose: Any, joint: Joint) -> list[Array]:
        """Places of the built-in markers that stand for a revolute joint."""
        found = []
        for name in (joint.name, f"{joint.name}j"):
            marker = self.block.built_in.get(name)
            if marker and marker.link in (joint.link, *joint.links):
                along = (getattr(self.block, marker.along) or 0.0) if marker.along else 0.0
                place = getattr(pose, marker.link)
                found.append(vectors(place.o) + vectors(place.e) * along)
        return found


def _marker(motions: Motions, joint: Joint) -> MarkerMotion:
    found = motions[joint.name]
    assert isinstance(found, MarkerMotion)
    return found
