"""How the names of a joint-based document live on in the graph made of it.

Whatever formation order ``decompose`` found, outputs are named, signed and placed as in the
document: every link and joint of the document is mapped here to the link or joint of the
graph that carries it. Drivers have one name and one coordinate in both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from blockmech.model.structure import JointRef, LinkRef, MarkerRef


@dataclass(frozen=True)
class LinkName:
    """A link of the document, found in the graph.

    Attributes
    ----------
    link : block and link in the graph
    marker : at the document link's own origin; its direction is the document's x axis
    turn : [rad] angle of the document's link frame minus that of the block's link frame
    markers : the markers that the document puts on the link
    """

    link: LinkRef
    marker: MarkerRef
    turn: float
    markers: Mapping[str, MarkerRef] = field(default_factory=dict)


@dataclass(frozen=True)
class JointName:
    """A joint of the document, found in the graph.

    Attributes
    ----------
    joint : block and joint in the graph
    flipped : whether the document's first link is the graph's later link: signs change
    turned : whether the graph's guide points against the document's (P joints only)
    others : further pairs, each with its own ``flipped``, whose forces add to that of
        ``joint``: at a pin of three links or more that the graph seats on another link. It
        has no friction
    links : the document's first and second link
    shift : [m] what the document's coordinate counts more than the graph's, which may measure
        from the foot of a link's origin (P joints only)
    """

    joint: JointRef
    flipped: bool
    turned: bool
    others: tuple[tuple[JointRef, bool], ...]
    links: tuple[str, str]
    shift: float = 0.0


@dataclass(frozen=True)
class Names:
    """Everything the document named, found in the graph.

    A pin of three links or more has an entry ``"<joint>.<link>"`` in ``joints`` for each link
    but its first: the pair of the first link with that one. ``links`` holds "frame" too where
    the document puts markers on the fixed link. ``loads`` has the elements of the graph that
    a load became: one, or two whose forces add; ``couplings`` and ``signals`` the blocks of those.
    """

    links: Mapping[str, LinkName]
    joints: Mapping[str, JointName]
    loads: Mapping[str, tuple[str, ...]]
    couplings: Mapping[str, str] = field(default_factory=dict)
    signals: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def of_links(self) -> Mapping[LinkRef, str]:
        """Link of the graph -> that of the document; of several that are welded the first."""
        return {self.links[name].link: name for name in sorted(self.links, reverse=True)}

    @cached_property
    def of_blocks(self) -> Mapping[str, str]:
        """Block -> itself and the document's links in it, e.g. ``"g1 (rod, piston)"``."""
        links_of: dict[str, list[str]] = {}
        for link, where in self.links.items():
            links_of.setdefault(where.link.block, []).append(link)
        return {
            block: f"{block} ({', '.join(links)})" if links != [block] else block
            for block, links in links_of.items()
        }

    @cached_property
    def of_joints(self) -> Mapping[str, str]:
        """Joint of the graph -> ``"joint.<name>"`` of the document."""
        return {str(where.joint): f"joint.{name}" for name, where in self.joints.items()}
