"""What a pair transmits, read from a group's reactions: forces, couples, sliders.

One planar value a pair: the force R of a revolute one, ``N + i C`` of a prismatic one with
its normal force and its couple about the slider's point S. Both are linear in the loads, and
so are their sums. A kernel gives a guide's couple about the origins of its own links; here it is
moved to S, which the block or the user puts on either link; from the origin of the link that
owns S where that is the block's own, for there S is a fixed way along the guide.

Sources: `blockmech.blocks.contract`, rules 6 and 10.
"""

from __future__ import annotations

from blockmech.model.structure import JointRef, LinkRef
from blockmech.passes.forward import arm_of, guide_direction, link_position, marker_place, place
from blockmech.plan import Schedule


def transmitted(s: Schedule, ref: JointRef, reactions: str) -> str:
    """What a pair transmits onto its later link, R or N + i C, by one set of reactions."""
    own = f"{reactions}.{s.structure.blocks[ref.block].joint_field(ref.name)}"
    if s.structure.joint(ref).kind == "R":
        return own
    owner = _owner(s, ref)
    couple = f"{own}.C" if owner == s.structure.later_link(ref) else f"{own}.C_i"
    if owner.block != ref.block:
        arm = s.ask(slider_arm, ref, s.structure.later_link(ref))
        couple = f"{own}.C - {own}.N * dot({arm}, {s.ask(guide_direction, ref)})"
    elif along := _along(s, ref, owner):
        slot = s.parameter(("along", ref), along, f"along_{ref}_S")
        couple += f" - {own}.N * {slot}"
    return s.line(f"planar({own}.N, {couple})", f"{ref}_slide")


def _along(s: Schedule, ref: JointRef, owner: LinkRef) -> float:
    """Way [m] of the slider's point along the guide, from the origin of the link that owns it."""
    block = s.structure.blocks[ref.block]
    _, direction = block.guide_line(ref.name, owner.link)
    return (block.slider_place(ref.name, owner.link) * direction.conjugate()).real


def slider_arm(s: Schedule, ref: JointRef, link: LinkRef) -> str | None:
    """Arm of the slider's point from the origin of one of the block's links; None for zero."""
    if link == _owner(s, ref):
        return s.ask(_arm_on_owner, ref)
    point, o = s.ask(slider_point, ref), s.ask(link_position, link).vector
    return s.line(f"{point} - {o}", f"{ref}_S_on_{link.link}")


def slider_point(s: Schedule, ref: JointRef) -> str:
    """Place of the slider's point; that of a slider on the support is the marker's."""
    owner = _owner(s, ref)
    if owner.block != ref.block:
        return s.ask(marker_place, s.structure.feeds[ref])
    return place(s, owner, s.ask(_arm_on_owner, ref), f"{ref}_S")


def _arm_on_owner(s: Schedule, ref: JointRef) -> str | None:
    owner = _owner(s, ref)
    at = s.structure.blocks[ref.block].slider_place(ref.name, owner.link)
    return s.ask(arm_of, owner, at, f"{ref}_S")


def _owner(s: Schedule, ref: JointRef) -> LinkRef:
    """The link that the slider's point moves with."""
    later = s.structure.blocks[ref.block].slider_owner(ref.name) == "later"
    return s.structure.later_link(ref) if later else s.structure.earlier_link(ref)
