"""The force pass, in reverse order: reactions and driving efforts.

A block is *active* if it has mass, a load or an active later block. An inactive
block is a structural zero: nothing is computed for it.

Sources: [R10] Eqs. 2-7 and 14-16, Fig. 11.
"""

from __future__ import annotations

from blockmech.model.structure import JointRef, LinkRef
from blockmech.passes import friction
from blockmech.passes.forward import (
    ZERO,
    difference,
    guide_direction,
    marker_arm,
    parameters,
    position,
    signed,
)
from blockmech.passes.loads import (
    NOTHING,
    Resultant,
    active,
    applied,
    at_arm,
    elements_on,
    inertial,
    later_blocks,
    load,
)
from blockmech.passes.pairs import PairLoad, from_wire, pair_load
from blockmech.plan import Entry, Schedule
from blockmech.plane import cross, imul, mul
from blockmech.typing import Complex, Real


def negated(x: Complex) -> Complex:
    """The opposite: what the earlier link gets."""
    return -x


def product(x: Real, y: Real) -> Real:
    """x y"""
    return x * y


def guide_force(N: Real, along: Real, u: Complex) -> Complex:
    """Force of a guide on the slider: N n + (T + tau) u."""
    return imul(u, N) + mul(u, along)


def guide_moment(C: Real, arm: Complex, f: Complex) -> Real:
    """Moment on the support about the wire's point: -C - (S - p) x f."""
    return -C - cross(arm, f)


def carried(s: Schedule, link: LinkRef) -> Resultant:
    """What active later blocks pass on to a link, in name order."""
    total = NOTHING
    for ref in s.structure.carried[link]:
        if not s.ask(active, ref.block):
            continue
        force, moment = s.ask(wrench, ref)
        arm = s.ask(marker_arm, s.structure.feeds[ref])
        total += at_arm(s, force, arm, f"{ref}_back")
        if moment != "0.0":
            total += Resultant((), (moment,))
    return total


def shared(s: Schedule, link: LinkRef) -> Resultant:
    """The applied loads of a link times the input ``load_share`` (1, or 0: none)."""
    found, share = s.ask(applied, link), s.unknown("load_share")
    return Resultant(
        tuple(s.emit(mul, force, share, name=f"{link}_F_share") for force in found.forces),
        tuple(s.emit(product, moment, share, name=f"{link}_M_share") for moment in found.moments),
    )


def link_load(s: Schedule, link: LinkRef) -> str:
    """Everything that loads a link, as one resultant about its origin."""
    if s.friction.method == friction.GIVEN:
        loads = s.ask(shared, link) + s.ask(friction.given_on, link)
    else:
        loads = s.ask(applied, link)
    total = s.ask(inertial, link) + loads + s.ask(carried, link)
    force = s.sum(total.forces, f"{link}_F") if total.forces else ZERO
    moment = s.sum(total.moments, f"{link}_M") if total.moments else "0.0"
    return s.emit(load, force, moment, name=f"{link}_load")


def smooth(s: Schedule, block: str) -> str | None:
    """Reactions of a block to its loads alone; None for a structural zero."""
    if not s.ask(active, block):
        return None
    s.ask_first(smooth, block, lambda b: later_blocks(s, b))
    b = s.structure.blocks[block]
    pose = s.ask(position, block)
    loads = [s.ask(link_load, LinkRef(block, n)) for n in b.link_names]
    args = (pose, *loads, s.ask(parameters, block))
    return s.kernel(Entry(block, "force"), b.kernels.reactions, *args, name=f"{block}_smooth")


def solution(s: Schedule, block: str) -> str | None:
    """The solved friction of a block's pairs, driven ones aside: ``t``, and how it went."""
    if s.friction.method == friction.GIVEN or not s.ask(friction.coupled_joints, block):
        return None  # before the reactions are asked for: nothing here needs them
    reactions = s.ask(smooth, block)
    return None if reactions is None else s.ask(friction.solve, block, reactions)


def resisting(s: Schedule, ref: JointRef) -> str:
    """Friction of a pair on the later link: couple [N m] or force [N]."""
    if s.friction.method == friction.GIVEN:
        known = ref in s.ask(friction.friction_joints, ref.block)
        return s.ask(friction.given, ref) if known else "0.0"
    found = s.ask(friction_at, ref)
    return "0.0" if found is None else f"{found[0]}.t[{found[1]}]"


def friction_at(s: Schedule, ref: JointRef) -> tuple[str, int] | None:
    """Solved friction that a pair is part of, and its place there; None without friction."""
    if ref not in s.ask(friction.friction_joints, ref.block):
        return None
    if not s.structure.joint(ref).driven:
        solved, joints = s.ask(solution, ref.block), s.ask(friction.coupled_joints, ref.block)
        return None if solved is None else (solved, joints.index(ref))
    pair = s.ask(reaction, ref)
    return None if pair is None else (s.ask(friction.solve_driven, ref, pair), 0)


def reaction(s: Schedule, ref: JointRef) -> PairLoad | None:
    """What a pair transmits, friction included; None for a structural zero."""
    reactions = s.ask(smooth, ref.block)
    if reactions is None:
        return None
    base = pair_load(s, ref, reactions)
    solved = s.ask(solution, ref.block)
    if solved is None:
        return base
    by = [
        s.ask(friction.influence, ref, unit) for unit in s.ask(friction.coupled_joints, ref.block)
    ]
    t = f"{solved}.t"
    if base.force:
        units = friction.tuple_of(pair.force for pair in by)
        return PairLoad(s.emit(friction.affine, base.force, t, units, name=f"{ref}_R"))
    return PairLoad(
        "",
        s.emit(
            friction.affine_real,
            base.N,
            t,
            friction.tuple_of(pair.N for pair in by),
            name=f"{ref}_N",
        ),
        s.emit(
            friction.affine_real,
            base.C,
            t,
            friction.tuple_of(pair.C for pair in by),
            name=f"{ref}_C",
        ),
    )


def drive(s: Schedule, driver: str) -> str:
    """Driving moment [N m] or force [N] by the force pass, friction included."""
    return signed(s, driver, s.ask(effort_in, s.structure.driven[driver]))


def effort_in(s: Schedule, joint: JointRef) -> str:
    """What drives a joint: moment [N m] or force [N] on the later link, friction included."""
    reactions = s.ask(smooth, joint.block)
    if reactions is None:
        return "0.0"
    block = s.structure.blocks[joint.block]
    effort, driver = f"{reactions}.{block.effort_field(joint.name)}", block.driver_name(*joint)
    solved = s.ask(solution, joint.block)
    if solved is not None:
        units = s.ask(friction.coupled_joints, joint.block)
        by = friction.tuple_of(s.ask(friction.effort_influence, joint, unit) for unit in units)
        name = f"{driver}_smooth_drive"
        effort = s.emit(friction.affine_real, effort, f"{solved}.t", by, name=name)
    t = s.ask(resisting, joint)
    if t == "0.0":
        return effort
    return s.emit(difference, effort, t, name=f"{driver}_drive")


def wrench(s: Schedule, ref: JointRef) -> tuple[str, str]:
    """Force and moment on the support of an outer joint, about the wire's forward point."""
    pair = s.ask(reaction, ref)
    if pair is None:
        return ZERO, "0.0"
    along = [s.ask(resisting, ref)]
    if s.structure.joint(ref).driven:
        along.append(s.ask(effort_in, ref))
    along = [x for x in along if x != "0.0"]
    total = s.sum(along, f"{ref}_along") if along else "0.0"
    if pair.force:
        moment = total if total == "0.0" else s.emit(negated, total, name=f"{ref}_back_M")
        return s.emit(negated, pair.force, name=f"{ref}_back_F"), moment
    u = s.ask(guide_direction, ref)
    f = s.emit(guide_force, pair.N, total, u, name=f"{ref}_f")
    force = s.emit(negated, f, name=f"{ref}_back_F")
    return force, s.emit(guide_moment, pair.C, s.ask(from_wire, ref), f, name=f"{ref}_back_M")


def frame_load(s: Schedule) -> Resultant:
    """What the mechanism exerts on the frame, about the frame's origin."""
    link = s.structure.frame_link
    return s.ask(carried, link) + s.ask(elements_on, link)
