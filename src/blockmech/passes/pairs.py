"""What a pair transmits, read from a group's reactions: forces, couples, sliders.

A kernel gives a guide's couple about the later link's origin; here it is moved to the
slider's point S, which the block or the user puts on either link.

Sources: `blockmech.blocks.contract`, rules 6 and 10.
"""

from __future__ import annotations

from typing import NamedTuple

from blockmech.blocks.contract import Joint
from blockmech.model.structure import JointRef, LinkRef
from blockmech.passes.forward import (
    difference,
    guide_direction,
    link_position,
    marker_place,
    place,
    turned,
)
from blockmech.plan import Schedule
from blockmech.plane import dot, imul
from blockmech.typing import Complex, Real, Slide


class PairLoad(NamedTuple):
    """Names of what a pair transmits onto the later link.

    R: ``force``; P: normal force ``N`` and couple ``C`` about the slider's point.
    """

    force: str
    N: str = ""
    C: str = ""


def normal_force(N: Real, u: Complex) -> Complex:
    """Normal force as a vector: N i u."""
    return imul(u, N)


def couple_at_slider(slide: Slide, arm: Complex, u: Complex) -> Real:
    """Guide couple [N m] about the slider's point; ``arm`` from the later link's origin."""
    return slide.C - slide.N * dot(arm, u)


def pair_load(s: Schedule, ref: JointRef, reactions: str) -> PairLoad:
    """What a pair transmits according to one set of reactions."""
    joint = s.structure.joint(ref)
    own = f"{reactions}.{s.structure.blocks[ref.block].joint_field(ref.name)}"
    if joint.kind == "R":
        return PairLoad(own)
    arm = s.ask(slider_arm, ref)
    couple = f"{own}.C"
    if arm is not None:
        u = s.ask(guide_direction, ref)
        couple = s.emit(couple_at_slider, own, arm, u, name=f"{ref}_C")
    return PairLoad("", f"{own}.N", couple)


def slider_arm(s: Schedule, ref: JointRef) -> str | None:
    """Arm of the slider's point from the later link's origin; None at the origin."""
    joint = s.structure.joint(ref)
    block = s.structure.blocks[ref.block]
    later = s.structure.later_link(ref)
    o = s.ask(link_position, later).vector
    if block.slider_owner(ref.name) == "later":
        return _line_arm(s, ref, later, joint)
    earlier = s.structure.earlier_link(ref)
    if joint.outer:
        point = s.ask(marker_place, s.structure.feeds[ref])
    else:
        arm = _line_arm(s, ref, earlier, joint)
        point = s.ask(link_position, earlier).vector
        if arm is not None:
            point = s.emit(place, point, arm, name=f"{ref}_S")
    return s.emit(difference, point, o, name=f"{ref}_S_arm")


def _line_arm(s: Schedule, ref: JointRef, link: LinkRef, joint: Joint) -> str | None:
    at = s.structure.blocks[ref.block].slider_place(joint.name, link.link)
    if at == 0:
        return None
    slot = s.parameter(("slider", ref, link), at, f"at_{ref}_S")
    e = s.ask(link_position, link).scalar
    return s.emit(turned, e, slot, name=f"{ref}_S_arm")


def from_wire(s: Schedule, ref: JointRef) -> str:
    """Arm of the slider's point from the wire's forward point, S - p."""
    o = s.ask(link_position, s.structure.later_link(ref)).vector
    arm = s.ask(slider_arm, ref)
    point = o if arm is None else s.emit(place, o, arm, name=f"{ref}_S")
    return s.emit(difference, point, s.ask(marker_place, s.structure.feeds[ref]), name=f"{ref}_Sp")
