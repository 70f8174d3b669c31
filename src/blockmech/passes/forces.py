"""The force pass, in reverse order: reactions, friction, driving efforts.

A block is *active* if it has mass, a load or an active later block. An inactive
block is a structural zero: nothing is computed for it. Friction is solved group
by group: reactions are affine in the friction couples and forces, so a group
needs its kernel once for the loads and once per unit friction load.

Sources: [R10] Eqs. 2-16 and Fig. 11; prismatic pairs by analogy.
"""

from __future__ import annotations

from typing import NamedTuple

from blockmech.blocks.contract import DrivingLink, Joint
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
    marker_arm,
    marker_place,
    marker_velocity,
    moves,
    parameters,
    place,
    position,
    slip,
    turned,
)
from blockmech.passes.loads import NOTHING, Resultant, applied, at_arm, elements_on, inertial
from blockmech.plan import Entry, Schedule
from blockmech.plane import cross, dot, hyp, imul, maximum, mul, sign, where
from blockmech.typing import Complex, Load, Real, Slide

REST = 1e-12  # relative speed below this share of the largest speed counts as rest


class PairLoad(NamedTuple):
    """Names of what a pair transmits onto the later link.

    R: ``force``; P: normal force ``N`` and couple ``C`` about the slider's point.
    """

    force: str
    N: str = ""
    C: str = ""


# -- pure functions of the pass ------------------------------------------------


def load(F: Complex, M: Real) -> Load:
    """Resultant of a link for a force kernel."""
    return Load(F, M)


def negated(x: Complex) -> Complex:
    """The opposite: what the earlier link gets."""
    return -x


def normal_force(N: Real, u: Complex) -> Complex:
    """Normal force as a vector: N i u."""
    return imul(u, N)


def couple_at_slider(slide: Slide, arm: Complex, u: Complex) -> Real:
    """Guide couple [N m] about the slider's point; ``arm`` from the later link's origin."""
    return slide.C - slide.N * dot(arm, u)


def guide_force(N: Real, along: Real, u: Complex) -> Complex:
    """Force of a guide on the slider: N n + (T + tau) u."""
    return imul(u, N) + mul(u, along)


def guide_moment(C: Real, arm: Complex, f: Complex) -> Real:
    """Moment on the support about the wire's point: -C - (S - p) x f."""
    return -C - cross(arm, f)


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


def resisting(slip_speed: Real, top: Real, factor: Real, slip_rate: Real) -> Real:
    """Signed factor of Coulomb's law: -sgn(slip) c, and 0 at zero relative speed."""
    return where(slip_speed <= REST * top, 0.0 * slip_speed, -sign(slip_rate) * factor)


def at_rest(slip_speed: Real, top: Real) -> Real:
    """1 where a pair counts as at rest, else 0."""
    return where(slip_speed <= REST * top, 1.0 + 0.0 * slip_speed, 0.0 * slip_speed)


def unit_arm_load(u: Complex, arm: Complex) -> Load:
    """Unit force along u at an arm from the origin, as a load."""
    return Load(u, cross(arm, u))


def unit_load(u: Complex) -> Load:
    """Unit force along u through the origin, as a load."""
    return Load(u, 0.0)


def opposite_load(a: Load) -> Load:
    """The opposite of a load."""
    return Load(-a.F, -a.M)


# -- who takes part ---------------------------------------------------------------


def active(s: Schedule, block: str) -> bool:
    """Whether a block has mass, a load, or an active later block."""
    s.ask_first(active, block, lambda b: _later(s, b))
    structure = s.structure
    for name in structure.blocks[block].link_names:
        link = LinkRef(block, name)
        properties = structure.properties(link)
        heavy = properties.mass > 0 and s.scene.gravity.z != 0
        if heavy or (properties.massive and not s.static) or structure.loaded[link]:
            return True
    return any(s.ask(active, later) for later in _later(s, block))


def _later(s: Schedule, block: str) -> list[str]:
    links = (LinkRef(block, n) for n in s.structure.blocks[block].link_names)
    return [joint.block for link in links for joint in s.structure.carried[link]]


# -- loads of links ------------------------------------------------------------


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


def link_load(s: Schedule, link: LinkRef) -> str:
    """Everything that loads a link, as one resultant about its origin."""
    total = s.ask(inertial, link) + s.ask(applied, link) + s.ask(carried, link)
    force = s.sum(total.forces, f"{link}_F") if total.forces else ZERO
    moment = s.sum(total.moments, f"{link}_M") if total.moments else "0.0"
    return s.emit(load, force, moment, name=f"{link}_load")


# -- reactions without friction -----------------------------------------------


def smooth(s: Schedule, block: str) -> str | None:
    """Reactions of a block to its loads alone; None for a structural zero."""
    if not s.ask(active, block):
        return None
    s.ask_first(smooth, block, lambda b: _later(s, b))
    b = s.structure.blocks[block]
    pose = s.ask(position, block)
    loads = [s.ask(link_load, LinkRef(block, n)) for n in b.link_names]
    args = (pose, *loads, s.ask(parameters, block))
    return s.kernel(Entry(block, "force"), b.kernels.reactions, *args, name=f"{block}_smooth")


def pair_load(s: Schedule, ref: JointRef, reactions: str) -> PairLoad:
    """What a pair transmits according to one set of reactions."""
    joint = s.structure.joint(ref)
    own = f"{reactions}.{ref.name}"
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


# -- friction -----------------------------------------------------------------------


def friction_joints(s: Schedule, block: str) -> tuple[JointRef, ...]:
    """Joints of a block whose friction is computed."""
    b = s.structure.blocks[block]
    off = s.friction.method == "none" or not moves(s, block, ACTUAL) or not s.ask(active, block)
    if off:
        return ()
    return tuple(JointRef(block, n) for n in b.joints if n in b.friction and b.friction[n].factor)


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
    """The block's largest length [m]."""
    b = s.structure.blocks[block]
    if b.kernels.size is not None:
        pose, p = s.ask(position, block), s.ask(parameters, block)
        return s.emit(b.kernels.size, pose, p, name=f"{block}_size")
    return s.parameter(("size", block), b.largest_length(), f"size_{block}")


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
    args = (speed, top, s.ask(factor_slot, ref), s.ask(slip, ref))
    return s.emit(resisting, *args, name=f"{ref}_k")


def rest(s: Schedule, ref: JointRef) -> str:
    """1 where a pair is at zero relative speed."""
    speed, top = s.ask(slip_speed, ref), s.ask(top_speed, ref.block)
    return s.emit(at_rest, speed, top, name=f"{ref}_rest")


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


def solution(s: Schedule, block: str) -> str | None:
    """The solved friction of a block: couples and forces ``t``, and how it went."""
    joints = s.ask(friction_joints, block)
    reactions = s.ask(smooth, block)
    if not joints or reactions is None:
        return None
    k = _tuple(s.ask(resistance, j) for j in joints)
    edges = _tuple(s.ask(edge_norm, j) for j in joints)
    base = _tuple(measure(s, j, pair_load(s, j, reactions)) for j in joints)
    if isinstance(s.structure.blocks[block], DrivingLink):
        return s.emit(solvers.direct, k, edges, base, name=f"{block}_friction")
    rows = _tuple(
        _tuple(measure(s, j, s.ask(influence, j, unit)) for unit in joints) for j in joints
    )
    solve, options = solvers.solver(s.friction.method)
    given = {"tolerance": s.friction.tolerance, "iterations": s.friction.iterations}
    more = [repr(given[o]) for o in options]
    return s.emit(solve, k, edges, base, rows, *more, name=f"{block}_friction")


def friction(s: Schedule, ref: JointRef) -> str:
    """Friction of a pair on the later link: couple [N m] or force [N]."""
    joints = s.ask(friction_joints, ref.block)
    solved = s.ask(solution, ref.block)
    if solved is None or ref not in joints:
        return "0.0"
    return f"{solved}.t[{joints.index(ref)}]"


def reaction(s: Schedule, ref: JointRef) -> PairLoad | None:
    """What a pair transmits, friction included; None for a structural zero."""
    reactions = s.ask(smooth, ref.block)
    if reactions is None:
        return None
    base = pair_load(s, ref, reactions)
    solved = s.ask(solution, ref.block)
    if solved is None or isinstance(s.structure.blocks[ref.block], DrivingLink):
        return base
    by = [s.ask(influence, ref, unit) for unit in s.ask(friction_joints, ref.block)]
    t = f"{solved}.t"
    if base.force:
        units = _tuple(pair.force for pair in by)
        return PairLoad(s.emit(affine, base.force, t, units, name=f"{ref}_R"))
    return PairLoad(
        "",
        s.emit(affine_real, base.N, t, _tuple(pair.N for pair in by), name=f"{ref}_N"),
        s.emit(affine_real, base.C, t, _tuple(pair.C for pair in by), name=f"{ref}_C"),
    )


def drive(s: Schedule, driver: str) -> str:
    """Driving moment [N m] or force [N] by the force pass, friction included."""
    reactions = s.ask(smooth, driver)
    if reactions is None:
        return "0.0"
    joint = JointRef(driver, _drive_joint(s, driver))
    t = s.ask(friction, joint)
    if t == "0.0":
        return f"{reactions}.tau"
    return s.emit(difference, f"{reactions}.tau", t, name=f"{driver}_drive")


def _drive_joint(s: Schedule, driver: str) -> str:
    block = s.structure.blocks[driver]
    assert isinstance(block, DrivingLink)
    return block.drive


def wrench(s: Schedule, ref: JointRef) -> tuple[str, str]:
    """Force and moment on the support of an outer joint, about the wire's forward point."""
    pair = s.ask(reaction, ref)
    if pair is None:
        return ZERO, "0.0"
    along = [s.ask(friction, ref)]
    if isinstance(s.structure.blocks[ref.block], DrivingLink):
        along.append(s.ask(drive, ref.block))
    along = [x for x in along if x != "0.0"]
    total = s.sum(along, f"{ref}_along") if along else "0.0"
    if pair.force:
        moment = total if total == "0.0" else s.emit(negated, total, name=f"{ref}_back_M")
        return s.emit(negated, pair.force, name=f"{ref}_back_F"), moment
    u = s.ask(guide_direction, ref)
    f = s.emit(guide_force, pair.N, total, u, name=f"{ref}_f")
    force = s.emit(negated, f, name=f"{ref}_back_F")
    return force, s.emit(guide_moment, pair.C, s.ask(from_wire, ref), f, name=f"{ref}_back_M")


def from_wire(s: Schedule, ref: JointRef) -> str:
    """Arm of the slider's point from the wire's forward point, S - p."""
    o = s.ask(link_position, s.structure.later_link(ref)).vector
    arm = s.ask(slider_arm, ref)
    point = o if arm is None else s.emit(place, o, arm, name=f"{ref}_S")
    return s.emit(difference, point, s.ask(marker_place, s.structure.feeds[ref]), name=f"{ref}_Sp")


def frame_load(s: Schedule) -> Resultant:
    """What the mechanism exerts on the frame, about the frame's origin."""
    link = s.structure.frame_link
    return s.ask(carried, link) + s.ask(elements_on, link)


def _tuple(items: object) -> str:
    parts = list(items)  # type: ignore[call-overload]
    return f"({', '.join(parts)}{',' if len(parts) == 1 else ''})"
