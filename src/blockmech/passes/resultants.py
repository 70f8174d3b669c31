"""What loads a link, as terms about its own origin; and which blocks carry a load at all.

Sources: [R10] Ruiz, Durango & Calle 2010, Eqs. 2-7.
"""

from __future__ import annotations

from typing import NamedTuple

from blockmech.model.structure import LinkRef
from blockmech.plan.plan import Schedule
from blockmech.plan.values import Value, cross


class Resultant(NamedTuple):
    """The terms of a link's load: forces and moments about the origin."""

    forces: tuple[Value, ...]
    moments: tuple[Value, ...]

    def __add__(self, terms: object) -> Resultant:  # joins two resultants term by term
        assert isinstance(terms, Resultant)
        return Resultant(self.forces + terms.forces, self.moments + terms.moments)

    def __bool__(self) -> bool:
        return bool(self.forces or self.moments)


NOTHING = Resultant((), ())


def moment_of(moment: Value) -> Resultant:
    """A moment as a term of the link's load."""
    return NOTHING if moment.zero else Resultant((), (moment,))


def at_arm(s: Schedule, force: Value, arm: Value, name: str) -> Resultant:
    """A force at an arm as a term of the link's load."""
    return Resultant((force,), ()) + moment_of(s.line(cross(arm, force), f"{name}_M"))


def active(s: Schedule, block: str) -> bool:
    """Whether a block has mass, a load, friction without one, a push, or an active later block."""
    s.ask_first(active, block, lambda b: later_blocks(s, b))
    structure = s.structure
    if s.unit_load is not None:
        on = s.unit_load.marker.block == block
        return on or any(s.ask(active, later) for later in later_blocks(s, block))
    for name in structure.blocks[block].link_names:
        link = LinkRef(block, name)
        properties = structure.properties(link)
        heavy = properties.mass > 0 and s.scene.gravity.z != 0
        if heavy or (properties.massive and not s.static) or structure.loaded[link]:
            return True
        if structure.tensioned_on[link]:
            return True
    if any(ref.block == block for ref in s.friction.pushed):
        return True
    laws = structure.blocks[block].friction.values() if s.friction.method != "none" else ()
    if any(law.drags and law.acts for law in laws):
        return True
    return any(s.ask(active, later) for later in later_blocks(s, block))


def later_blocks(s: Schedule, block: str) -> list[str]:
    """Blocks that a block's links carry or lead, in name order of their joints."""
    structure = s.structure
    links = [LinkRef(block, n) for n in structure.blocks[block].link_names]
    blocks = [joint.block for link in links for joint in structure.carried[link]]
    return blocks + [structure.driven[d].block for x in links for d in structure.coupled_on[x]]
