"""Friction in the force pass: factors, influences and the solved couples of a group.

Reactions are affine in the friction couples and forces of a group, so the group
needs its kernel once for the loads and once per unit friction load; the solvers do
the rest. Groups are solved one by one in reverse order, because a group's friction
never depends on earlier groups ([R10] Fig. 11).

Sources: [R10] Eqs. 8-13 and 16; prismatic pairs by analogy.
"""

from __future__ import annotations

from collections.abc import Iterable

from blockmech.friction import solvers
from blockmech.model.structure import JointRef, LinkRef
from blockmech.passes.forward import (
    ACTUAL,
    guide_direction,
    link_velocity,
    marker_velocity,
    moves,
    parameters,
    position,
    slip,
)
from blockmech.passes.loads import NOTHING, Resultant, active, at_arm
from blockmech.passes.pairs import slider_arm, transmitted
from blockmech.plan import NOUGHT, REST, ZERO, Schedule
from blockmech.plane import maximum, sign, where
from blockmech.typing import Load, Real

GIVEN = "given"  # method: the friction of every pair is an input of the program


# -- which pairs, and what the program is given ------------------------------------


def friction_joints(s: Schedule, block: str) -> tuple[JointRef, ...]:
    """Joints of a block whose friction is computed."""
    b = s.structure.blocks[block]
    if s.friction.method == "none" or not moves(s, block, ACTUAL) or not s.ask(active, block):
        return ()
    return tuple(JointRef(block, n) for n in b.joints if n in b.friction and b.friction[n].factor)


def coupled_joints(s: Schedule, block: str) -> tuple[JointRef, ...]:
    """Those of them whose friction loads each other.

    Friction in a driven pair only changes what the drive has to give.
    """
    joints = s.ask(friction_joints, block)
    return tuple(ref for ref in joints if not s.structure.joint(ref).driven)


def given_joints(s: Schedule) -> tuple[JointRef, ...]:
    """Joints whose friction is an input of the program, method "given"."""
    return tuple(ref for block in s.structure.blocks for ref in s.ask(friction_joints, block))


def given(s: Schedule, ref: JointRef) -> str:
    """Input with the friction of a pair on its later link: couple [N m] or force [N]."""
    return s.unknown(f"friction_{s.ask(given_joints).index(ref)}")


def given_on(s: Schedule, link: LinkRef) -> Resultant:
    """Given friction in the pairs of a block on one of its links."""
    total = NOTHING
    for ref in s.ask(coupled_joints, link.block):
        if _touches(s, ref, link):
            total += friction_on(s, ref, link, s.ask(given, ref))
    return total


def _touches(s: Schedule, ref: JointRef, link: LinkRef) -> bool:
    joint = s.structure.joint(ref)
    return link.link in (joint.later, *joint.links)


def friction_on(s: Schedule, ref: JointRef, link: LinkRef, t: str) -> Resultant:
    """The load of friction ``t`` in a pair on one of its block's links; t is of the later one."""
    joint = s.structure.joint(ref)
    if link.link != joint.later:
        t = f"(-{t})"
    if joint.kind == "R":
        return Resultant((), (t,))
    force = s.line(f"mul({s.ask(guide_direction, ref)}, {t})", f"{ref}_T")
    return at_arm(s, force, s.ask(slider_arm, ref, link), f"{ref}_T")


# -- Coulomb's factor: its sense from the slip -------------------------------------


def largest(*speeds: Real) -> Real:
    """The largest of several speeds."""
    top = speeds[0]
    for speed in speeds[1:]:
        top = maximum(top, speed)
    return top


def resisting(slip_speed: Real, top: Real, factor: Real, slip_rate: Real, rest: Real) -> Real:
    """Signed factor of Coulomb's law: -sgn(slip) c, and 0 at zero relative speed."""
    return where(slip_speed <= rest * top, 0.0 * slip_speed, -sign(slip_rate) * factor)


def at_rest(slip_speed: Real, top: Real, rest: Real) -> Real:
    """1 where a pair counts as at rest, else 0."""
    return where(slip_speed <= rest * top, 1.0 + 0.0 * slip_speed, 0.0 * slip_speed)


def top_speed(s: Schedule, block: str) -> str:
    """Largest speed of joints and links of a block and its ancestors [m/s]."""
    s.ask_first(top_speed, block, s.structure.supports)
    b = s.structure.blocks[block]
    terms: list[str] = []
    for support in s.structure.supports(block):
        if support != s.structure.frame and moves(s, support, ACTUAL):
            terms.append(s.ask(top_speed, support))
    for joint in b.joints.values():
        ref = JointRef(block, joint.name)
        if joint.kind == "P":
            terms.append(s.line(f"abs({s.ask(slip, ref)})", f"{ref}_speed"))
        if joint.outer:
            v = s.ask(marker_velocity, s.structure.feeds[ref], ACTUAL)
            if v != ZERO:
                terms.append(s.line(f"hyp({v})", f"{ref}_speed"))
    for name in b.link_names:
        om = s.ask(link_velocity, LinkRef(block, name), ACTUAL).scalar
        terms.append(s.line(f"abs({om}) * {s.ask(size, block)}", f"{block}_{name}_speed"))
    return s.emit(largest, *dict.fromkeys(terms), name=f"{block}_top_speed")


def size(s: Schedule, block: str) -> str:
    """The block's largest length [m]; 1 m where it has none.

    A length that the pose says may vanish for a moment; those of the supports then
    keep a turning pair from counting as at rest.
    """
    b = s.structure.blocks[block]
    if b.kernels.size is None:
        return s.parameter(("size", block), b.largest_length() or 1.0, f"size_{block}")
    s.ask_first(size, block, s.structure.supports)
    pose, p = s.ask(position, block), s.ask(parameters, block)
    own = s.emit(b.kernels.size, pose, p, name=f"{block}_size")
    others = [s.ask(size, n) for n in s.structure.supports(block) if n != s.structure.frame]
    return s.emit(largest, own, *others, name=f"{block}_size") if others else own


def slip_speed(s: Schedule, ref: JointRef) -> str:
    """Speed [m/s] that the relative rate of a pair stands for, turning at the block's size."""
    text = f"abs({s.ask(slip, ref)})"
    if s.structure.joint(ref).kind == "R":
        text += f" * {s.ask(size, ref.block)}"
    return s.line(text, f"{ref}_slip_speed")


def factor_slot(s: Schedule, ref: JointRef) -> str:
    """Slot of f' r [m] or mu [-]."""
    law = s.structure.blocks[ref.block].friction[ref.name]
    return s.parameter(("factor", ref), law.factor, f"c_{ref}")


def resistance(s: Schedule, ref: JointRef) -> str:
    """Signed factor of a pair: friction on the later link per newton on the pair."""
    speed, top = s.ask(slip_speed, ref), s.ask(top_speed, ref.block)
    args = (speed, top, s.ask(factor_slot, ref), s.ask(slip, ref), REST)
    return s.emit(resisting, *args, name=f"{ref}_k")


def rest(s: Schedule, ref: JointRef) -> str:
    """1 where a pair is at zero relative speed."""
    speed, top = s.ask(slip_speed, ref), s.ask(top_speed, ref.block)
    return s.emit(at_rest, speed, top, REST, name=f"{ref}_rest")


# -- loads on pairs, and what unit friction adds to them -----------------------------


def measure(s: Schedule, ref: JointRef, pair: str) -> str:
    """The planar vector whose norm is the load on a pair: R, or N and 2 C / L of a guide."""
    if s.structure.joint(ref).kind == "R":
        return pair
    length = s.structure.blocks[ref.block].friction[ref.name].guide_length
    edges = NOUGHT
    if length is not None:
        slot = s.parameter(("guide", ref), 2 / length, f"two_over_L_{ref}")
        edges = f"{slot} * {pair}.imag"
    return s.line(f"planar({pair}.real, {edges})", f"{ref}_load")


def edge_norm(s: Schedule, ref: JointRef) -> str:
    """Whether the load on a pair is the larger component, or the length of the vector."""
    return str(s.structure.joint(ref).kind == "P")


def unit_reactions(s: Schedule, ref: JointRef) -> tuple[str, str]:
    """Reactions to a unit of friction in a pair: those to its later and earlier link.

    The second is empty where one call answers both, or the earlier link is not the group's.
    Couples are of unit size on either link, so pairs of one link share their call.
    """
    joint = s.structure.joint(ref)
    if joint.kind == "R":
        couple = Resultant((), ("1.0",))
        later = _response(s, ref, {joint.later: couple})
        return later, "" if joint.outer else _response(s, ref, {joint.links[0]: couple})
    links = [LinkRef(ref.block, n) for n in s.structure.blocks[ref.block].link_names]
    on = {k.link: friction_on(s, ref, k, "1.0") for k in links if _touches(s, ref, k)}
    return _response(s, ref, on), ""


def _response(s: Schedule, ref: JointRef, on: dict[str, Resultant]) -> str:
    """Reactions of a block to loads on some of its links."""
    b = s.structure.blocks[ref.block]
    loads = (on.get(n, NOTHING) for n in b.link_names)
    sums = [(*(load.forces or (ZERO,)), *(load.moments or (NOUGHT,))) for load in loads]
    given = [s.emit(Load, *each, name="unit") for each in sums]
    args = (s.ask(position, ref.block), *given, s.ask(parameters, ref.block))
    return s.emit(b.kernels.reactions, *args, name=f"{ref.block}_response")


def influence(s: Schedule, ref: JointRef, unit: JointRef) -> str:
    """What a unit of friction in one pair adds to what another transmits."""
    later, earlier = s.ask(unit_reactions, unit)
    plus = s.ask(transmitted, ref, later)
    if not earlier:
        return plus
    return s.line(f"{plus} - {s.ask(transmitted, ref, earlier)}", f"{ref}_by_{unit}")


def effort_influence(s: Schedule, driven: JointRef, unit: JointRef) -> str:
    """What a unit of friction in one pair adds to the driving effort at another."""
    effort = s.structure.blocks[driven.block].effort_field(driven.name)
    later, earlier = s.ask(unit_reactions, unit)
    if not earlier:
        return f"{later}.{effort}"
    return s.line(f"{later}.{effort} - {earlier}.{effort}", f"{driven}_effort_by_{unit}")


# -- solved ------------------------------------------------------------------------


def solve(s: Schedule, block: str, reactions: str) -> str:
    """The solved friction of a block with these frictionless reactions: ``t``, and how it went."""
    joints = s.ask(coupled_joints, block)
    k = tuple_of(s.ask(resistance, j) for j in joints)
    edges = tuple_of(s.ask(edge_norm, j) for j in joints)
    base = tuple_of(measure(s, j, s.ask(transmitted, j, reactions)) for j in joints)
    rows = tuple_of(
        tuple_of(measure(s, j, s.ask(influence, j, unit)) for unit in joints) for j in joints
    )
    solver, options = solvers.SOLVERS[s.friction.method]
    given = {"tolerance": s.friction.tolerance, "iterations": s.friction.iterations}
    more = [repr(given[o]) for o in options]
    return s.emit(solver, k, edges, base, rows, *more, name=f"{block}_friction")


def solve_driven(s: Schedule, ref: JointRef, pair: str) -> str:
    """The friction of a driven pair, which does not change what the pair transmits."""
    k, edges = s.ask(resistance, ref), s.ask(edge_norm, ref)
    args = (f"({k},)", f"({edges},)", f"({measure(s, ref, pair)},)")
    return s.emit(solvers.direct, *args, name=f"{ref}_friction")


def tuple_of(items: Iterable[str]) -> str:
    """Text of a tuple of values."""
    return f"({''.join(f'{item}, ' for item in items)})"
