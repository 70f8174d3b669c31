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
    ONE,
    ZERO,
    difference,
    guide_direction,
    link_position,
    link_velocity,
    marker_velocity,
    moves,
    parameters,
    place,
    position,
    slip,
)
from blockmech.passes.loads import NOTHING, Resultant, active, at_arm, load
from blockmech.passes.pairs import PairLoad, pair_load, slider_arm
from blockmech.plan import Schedule
from blockmech.plane import cross, hyp, imul, maximum, mul, sign, where
from blockmech.typing import Complex, Load, Real

GIVEN = "given"  # method: the friction of every pair is an input of the program
REST = "REST"  # share of the largest speed that counts as rest; named by every engine


def edge_measure(N: Real, C: Real, two_over_length: Real, one: Complex) -> Complex:
    """Load measure of a guide with edges: N and 2 C / L as a pair."""
    return mul(one, N) + imul(one, two_over_length * C)


def normal_measure(N: Real, one: Complex) -> Complex:
    """Load measure of a guide without length: N alone."""
    return mul(one, N)


def affine(base: Complex, t: tuple[Real, ...], influence: tuple[Complex, ...]) -> Complex:
    """A reaction force with friction: base + sum of t_k times the influence of unit k."""
    for x, unit in zip(t, influence, strict=True):
        base = base + mul(unit, x)
    return base


def affine_real(base: Real, t: tuple[Real, ...], influence: tuple[Real, ...]) -> Real:
    """The same for a normal force or a couple."""
    for x, unit in zip(t, influence, strict=True):
        base = base + unit * x
    return base


def largest(*speeds: Real) -> Real:
    """The largest of several speeds."""
    top = speeds[0]
    for speed in speeds[1:]:
        top = maximum(top, speed)
    return top


def angular_speed(om: Real, size: Real) -> Real:
    """Speed [m/s] that a rate stands for at a block's largest length."""
    return abs(om) * size


def resisting(slip_speed: Real, top: Real, factor: Real, slip_rate: Real, rest: Real) -> Real:
    """Signed factor of Coulomb's law: -sgn(slip) c, and 0 at zero relative speed."""
    return where(slip_speed <= rest * top, 0.0 * slip_speed, -sign(slip_rate) * factor)


def at_rest(slip_speed: Real, top: Real, rest: Real) -> Real:
    """1 where a pair counts as at rest, else 0."""
    return where(slip_speed <= rest * top, 1.0 + 0.0 * slip_speed, 0.0 * slip_speed)


def unit_arm_load(u: Complex, arm: Complex) -> Load:
    """Unit force along u at an arm from the origin, as a load."""
    return Load(u, cross(arm, u))


def unit_load(u: Complex) -> Load:
    """Unit force along u through the origin, as a load."""
    return Load(u, 0.0)


def opposite_load(a: Load) -> Load:
    """The opposite of a load."""
    return Load(-a.F, -a.M)


def opposite(t: Real) -> Real:
    """What the earlier link gets."""
    return -t


def friction_joints(s: Schedule, block: str) -> tuple[JointRef, ...]:
    """Joints of a block whose friction is computed."""
    b = s.structure.blocks[block]
    off = s.friction.method == "none" or not moves(s, block, ACTUAL) or not s.ask(active, block)
    if off:
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
    """Given friction in the pairs of a block on one of its links.

    Nothing of driven pairs: their friction only changes what the drive has to give.
    """
    total = NOTHING
    for ref in s.ask(coupled_joints, link.block):
        joint = s.structure.joint(ref)
        if link.link != joint.later and (joint.outer or link.link != joint.links[0]):
            continue
        t = s.ask(given, ref)
        if link.link != joint.later:
            t = s.emit(opposite, t, name=f"{ref}_back")
        if joint.kind == "R":
            total += Resultant((), (t,))
            continue
        force = s.emit(mul, s.ask(guide_direction, ref), t, name=f"{ref}_T")
        arm = s.ask(slider_arm, ref)
        if link.link != joint.later:
            later = s.ask(link_position, s.structure.later_link(ref)).vector
            point = later if arm is None else s.emit(place, later, arm, name=f"{ref}_S")
            own = s.ask(link_position, link).vector
            arm = s.emit(difference, point, own, name=f"{ref}_S_on_{link.link}")
        total += at_arm(s, force, arm, f"{ref}_T")
    return total


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
            terms.append(s.emit(abs, s.ask(slip, ref), name=f"{ref}_speed"))
        if joint.outer:
            v = s.ask(marker_velocity, s.structure.feeds[ref], ACTUAL)
            if v != ZERO:
                terms.append(s.emit(hyp, v, name=f"{ref}_speed"))
    for name in b.link_names:
        om = s.ask(link_velocity, LinkRef(block, name), ACTUAL).scalar
        terms.append(s.emit(angular_speed, om, s.ask(size, block), name=f"{block}_{name}_speed"))
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
    """Speed [m/s] that the relative rate of a pair stands for."""
    rate = s.ask(slip, ref)
    if s.structure.joint(ref).kind == "P":
        return s.emit(abs, rate, name=f"{ref}_slip_speed")
    return s.emit(angular_speed, rate, s.ask(size, ref.block), name=f"{ref}_slip_speed")


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


def measure(s: Schedule, ref: JointRef, pair: PairLoad) -> str:
    """The planar vector whose norm is the load on a pair."""
    if s.structure.joint(ref).kind == "R":
        return pair.force
    length = s.structure.blocks[ref.block].friction[ref.name].guide_length
    if length is None:
        return s.emit(normal_measure, pair.N, ONE, name=f"{ref}_load")
    slot = s.parameter(("guide", ref), 2 / length, f"two_over_L_{ref}")
    return s.emit(edge_measure, pair.N, pair.C, slot, ONE, name=f"{ref}_load")


def edge_norm(s: Schedule, ref: JointRef) -> str:
    """Whether the load on a pair is the larger component, or the length of the vector."""
    return str(s.structure.joint(ref).kind == "P")


def unit_reactions(s: Schedule, ref: JointRef) -> tuple[str, str]:
    """Reactions to a unit of friction in a pair: those to its later and earlier link.

    The second is empty where the earlier link is not the group's own.
    """
    joint = s.structure.joint(ref)
    if joint.kind == "R":
        later = s.ask(response, ref.block, joint.later)
        earlier = "" if joint.outer else s.ask(response, ref.block, joint.links[0])
        return later, earlier
    return s.ask(sliding_response, ref), ""


def response(s: Schedule, block: str, link: str) -> str:
    """Reactions of a block to a unit couple on one of its links."""
    b = s.structure.blocks[block]
    loads = [
        s.emit(load, ZERO, "1.0" if n == link else "0.0", name=f"unit_{n}") for n in b.link_names
    ]
    args = (s.ask(position, block), *loads, s.ask(parameters, block))
    return s.emit(b.kernels.reactions, *args, name=f"{block}_unit_{link}")


def sliding_response(s: Schedule, ref: JointRef) -> str:
    """Reactions of a group to a unit friction force in one of its prismatic pairs."""
    b, joint = s.structure.blocks[ref.block], s.structure.joint(ref)
    u = s.ask(guide_direction, ref)
    later_o = s.ask(link_position, s.structure.later_link(ref)).vector
    arm = s.ask(slider_arm, ref)
    on: dict[str, str] = {}
    if arm is None:
        on[joint.later] = s.emit(unit_load, u, name=f"{ref}_unit")
    else:
        on[joint.later] = s.emit(unit_arm_load, u, arm, name=f"{ref}_unit")
    if not joint.outer:
        o = s.ask(link_position, s.structure.earlier_link(ref)).vector
        point = later_o if arm is None else s.emit(place, later_o, arm, name=f"{ref}_S")
        back = s.emit(difference, point, o, name=f"{ref}_S_on_{joint.links[0]}")
        unit = s.emit(unit_arm_load, u, back, name=f"{ref}_unit_{joint.links[0]}")
        on[joint.links[0]] = s.emit(opposite_load, unit, name=f"{ref}_unit_{joint.links[0]}")
    zero = s.emit(load, ZERO, "0.0", name="no_load")
    args = [s.ask(position, ref.block), *(on.get(n, zero) for n in b.link_names)]
    args.append(s.ask(parameters, ref.block))
    return s.emit(b.kernels.reactions, *args, name=f"{ref}_response")


def influence(s: Schedule, ref: JointRef, unit: JointRef) -> PairLoad:
    """What a unit of friction in one pair adds to the load of another."""
    later, earlier = s.ask(unit_reactions, unit)
    plus = pair_load(s, ref, later)
    if not earlier:
        return plus
    minus = pair_load(s, ref, earlier)
    if s.structure.joint(ref).kind == "R":
        name = f"{ref}_by_{unit}"
        return PairLoad(s.emit(difference, plus.force, minus.force, name=name))
    return PairLoad(
        "",
        s.emit(difference, plus.N, minus.N, name=f"{ref}_N_by_{unit}"),
        s.emit(difference, plus.C, minus.C, name=f"{ref}_C_by_{unit}"),
    )


def effort_influence(s: Schedule, driven: JointRef, unit: JointRef) -> str:
    """What a unit of friction in one pair adds to the driving effort at another."""
    effort = s.structure.blocks[driven.block].effort_field(driven.name)
    later, earlier = s.ask(unit_reactions, unit)
    if not earlier:
        return f"{later}.{effort}"
    name = f"{driven}_effort_by_{unit}"
    return s.emit(difference, f"{later}.{effort}", f"{earlier}.{effort}", name=name)


def solve(s: Schedule, block: str, reactions: str) -> str:
    """The solved friction of a block with these frictionless reactions: ``t``, and how it went."""
    joints = s.ask(coupled_joints, block)
    k = tuple_of(s.ask(resistance, j) for j in joints)
    edges = tuple_of(s.ask(edge_norm, j) for j in joints)
    base = tuple_of(measure(s, j, pair_load(s, j, reactions)) for j in joints)
    rows = tuple_of(
        tuple_of(measure(s, j, s.ask(influence, j, unit)) for unit in joints) for j in joints
    )
    solver, options = solvers.solver(s.friction.method)
    given = {"tolerance": s.friction.tolerance, "iterations": s.friction.iterations}
    more = [repr(given[o]) for o in options]
    return s.emit(solver, k, edges, base, rows, *more, name=f"{block}_friction")


def solve_driven(s: Schedule, ref: JointRef, pair: PairLoad) -> str:
    """The friction of a driven pair, which does not change what the pair transmits."""
    k, edges = s.ask(resistance, ref), s.ask(edge_norm, ref)
    args = (f"({k},)", f"({edges},)", f"({measure(s, ref, pair)},)")
    return s.emit(solvers.direct, *args, name=f"{ref}_friction")


def tuple_of(items: Iterable[str]) -> str:
    """Text of a tuple of values."""
    parts = list(items)
    return f"({', '.join(parts)}{',' if len(parts) == 1 else ''})"
