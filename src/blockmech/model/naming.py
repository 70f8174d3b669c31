"""How the names of a joint-based document live on in the graph made of it.

Whatever formation order ``decompose`` found, outputs are named, signed and placed as in the
document: every link, joint and driver of the document is mapped here to the link, joint or
driver of the graph that carries it. Nothing here computes; the outputs read it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from blockmech.model.structure import JointRef, LinkRef, MarkerRef


@dataclass(frozen=True)
class LinkName:
    """A link of the document, found in the graph."""

    link: LinkRef
    """Block and link in the graph."""

    marker: MarkerRef
    """Marker at the document link's own origin; its direction is the document's x axis."""

    turn: float
    """[rad] Angle of the document's link frame minus angle of the block's link frame."""

    markers: Mapping[str, MarkerRef] = field(default_factory=dict)
    """The markers that the document puts on the link, found in the graph."""


@dataclass(frozen=True)
class JointName:
    """A joint of the document, found in the graph.

    Signs: force vector, couple C and a pin's friction couple and slip change where it is
    ``flipped``; what is measured along a guide (N, friction force and slip of a P joint)
    changes where exactly one of ``flipped`` and ``turned`` is true.
    """

    joint: JointRef
    """Block and joint in the graph."""

    flipped: bool
    """True where the document's first link is the graph's later link: signs change."""

    turned: bool = False
    """True where the graph's guide points against the document's (P joints only)."""

    others: tuple[tuple[JointRef, bool], ...] = ()
    """Further pairs, each with its own ``flipped``, whose forces add to that of ``joint``: at
    a pin of three links or more that the graph seats on another link. It has no friction."""

    links: tuple[str, str] = ("", "")
    """The document's first and second link; where the pin is seated elsewhere (it has no
    friction then), the slip is the difference of their rates."""


@dataclass(frozen=True)
class Names:
    """Everything the document named, found in the graph.

    A pin of three links or more has an entry ``"<joint>.<link>"`` in ``joints`` for each link
    but its first: the pair of the first link with that one. ``links`` holds "frame" too where
    the document puts markers on the fixed link.
    """

    links: Mapping[str, LinkName]
    joints: Mapping[str, JointName]
    loads: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Load -> the elements of the graph that it became; one, or two whose forces add."""
