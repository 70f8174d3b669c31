"""The force pass, in reverse order: reactions and driving efforts.

A block is *active* if it has mass, a load or an active later block. An inactive
block is a structural zero: nothing is computed for it. The friction of groups is solved
one by one, because a group's never depends on earlier groups ([R10] Fig. 11).

Sources: [R10] Eqs. 2-7 and 11-16.
"""

from __future__ import annotations

from collections.abc import Iterable

from blockmech.couplings.contract import Reading
from blockmech.friction import equations, solvers
from blockmech.friction.equations import existence as existence_of
from blockmech.ground.tolerances import DOUBLINGS
from blockmech.model.structure import JointRef, LinkRef
from blockmech.passes import forward, friction
from blockmech.passes.forward import (
    link_position,
    marker_arm,
    marker_place,
    parameters,
    position,
    signed,
)
from blockmech.passes.loads import applied, elements_on, inertial
from blockmech.passes.pairs import (
    contact,
    effort_influence,
    friction_on,
    influence,
    mesh_statics,
    slope_effort,
    statics,
    touches,
    transmitted,
)
from blockmech.passes.resultants import (
    NOTHING,
    Resultant,
    active,
    at_arm,
    later_blocks,
    moment_of,
)
from blockmech.plan.plan import Entry, Schedule
from blockmech.plan.values import NOUGHT, UNIT, ZERO, Value, below, constant, mul, tuple_of
from blockmech.typing import Load


def carried(s: Schedule, link: LinkRef) -> Resultant:
    """What active later blocks pass on to a link, in name order."""
    total = NOTHING
    for ref in s.structure.carried[link]:
        if not s.ask(active, ref.block):
            continue
        force, moment = s.ask(wrench, ref)
        arm = s.ask(marker_arm, s.structure.feeds[ref])
        total += at_arm(s, force, arm, f"{ref}_back") + moment_of(moment)
    return total


def shared(s: Schedule, link: LinkRef) -> Resultant:
    """The applied loads of a link times the input ``load_share`` (1, or 0: none)."""
    load, share = s.ask(applied, link), s.unknown("load_share")
    return Resultant(
        tuple(s.line(mul(force, share), f"{link}_F_share") for force in load.forces),
        tuple(s.line(moment * share, f"{link}_M_share") for moment in load.moments),
    )


def link_load(s: Schedule, link: LinkRef) -> Value:
    """Everything that loads a link, as one resultant about its origin."""
    if s.friction.method == friction.GIVEN:
        loads = s.ask(shared, link) + s.ask(friction_inputs_on, link)
    else:
        loads = s.ask(applied, link)
    loads += s.ask(pushes_on, link)
    total = s.ask(inertial, link) + loads + s.ask(carried, link) + s.ask(coupled, link)
    force, moment = s.sum(total.forces, f"{link}_F", ZERO), s.sum(total.moments, f"{link}_M")
    return s.emit(Load, force, moment, name=f"{link}_load")


def pushes_on(s: Schedule, link: LinkRef) -> Resultant:
    """Given pushes along the coordinates of pairs of a block on one of its links."""
    total = NOTHING
    for ref in s.friction.pushed:
        if ref.block == link.block and touches(s, ref, link):
            total += friction_on(s, ref, link, s.ask(push, ref))
    return total


def push(s: Schedule, ref: JointRef) -> Value:
    """What is given to push along the coordinate of a pair, on its later link [N m or N]."""
    is_pushed = ref in s.friction.pushed and s.unit_load is None
    return s.unknown(f"push_{s.friction.pushed.index(ref)}") if is_pushed else NOUGHT


def friction_inputs_on(s: Schedule, link: LinkRef) -> Resultant:
    """Given friction in the pairs of a block on one of its links."""
    total = NOTHING
    for ref in s.ask(friction.coupled_joints, link.block):
        if ref not in s.structure.meshes and touches(s, ref, link):
            total += friction_on(s, ref, link, s.ask(friction.friction_input, ref))
    return total


def smooth(s: Schedule, block: str) -> Value | None:
    """Reactions of a block to its loads alone; None for a structural zero."""
    if not s.ask(active, block):
        return None
    s.ask_first(smooth, block, lambda b: later_blocks(s, b))
    b = s.structure.blocks[block]
    pose = s.ask(position, block)
    loads = [s.ask(link_load, LinkRef(block, n)) for n in b.link_names]
    args = (pose, *loads, s.ask(parameters, block))
    unit = s.unit_load.name if s.unit_load is not None else ""
    return s.kernel(Entry(block, "force", unit), b.kernels.reactions, *args, name=f"{block}_smooth")


def solution(s: Schedule, block: str) -> Value | None:
    """The solved friction of a block's pairs, driven ones aside: ``t``, and how it went."""
    if s.friction.method == friction.GIVEN or not s.ask(friction.coupled_joints, block):
        return None  # before the reactions are asked for: nothing here needs them
    reactions = s.ask(smooth, block)
    return None if reactions is None else s.ask(solve, block, reactions)


def solve(s: Schedule, block: str, reactions: Value) -> Value:
    """The solved friction of a block with these frictionless reactions: ``t``, and how it went."""
    joints = s.ask(friction.coupled_joints, block)
    edges = tuple_of(constant(statics(s, j).edges) for j in joints)
    base = tuple_of(
        statics(s, j).measure(s, j, s.ask(transmitted, j, reactions, reactions)) for j in joints
    )
    rows = influences(s, joints, reactions)
    if any(s.structure.friction_law(j).reads_load for j in joints):
        return _by_load(s, block, joints, edges, base, rows)
    k, drag = laws_at(s, joints)
    solved = _solve(s, block, joints, k, drag, edges, base, rows)
    return (
        solved if drag.zero else s.emit(solvers.with_drag, solved, drag, name=f"{block}_friction")
    )


def _solve(
    s: Schedule,
    block: str,
    joints: tuple[JointRef, ...],
    k: Value,
    drag: Value,
    edges: Value,
    base: Value,
    rows: Value,
) -> Value:
    """The solver's answer for signed factors, with loads that drags shift."""
    solver, options = solvers.SOLVERS[s.friction.method]
    settings = {"tolerance": s.friction.tolerance, "iterations": s.friction.iterations}
    arguments = [constant(settings[x]) for x in options]
    c = s.ask(existence, block)
    arguments += [] if c is None else [below(c, UNIT)]
    if s.friction.along:
        t = tuple_of(s.ask(friction.friction_input, j) for j in joints)
        arguments += [constant(False)] if c is None else []
        arguments += [
            t if drag.zero else s.emit(solvers.without_drag, t, drag, name=f"{block}_own")
        ]
    if drag.zero:
        return s.emit(solver, k, edges, base, rows, *arguments, name=f"{block}_friction")
    base = s.emit(equations.loads, drag, base, rows, name=f"{block}_dragged")
    return s.emit(solver, k, edges, base, rows, *arguments, name=f"{block}_by_load")


def _by_load(
    s: Schedule, block: str, joints: tuple[JointRef, ...], edges: Value, base: Value, rows: Value
) -> Value:
    """The same with laws that are not linear in the load: by their tangents at the loads.

    The steps of `solvers.balanced`, here as calls of a program.
    """
    g = s.emit(equations.norms, base, edges, name=f"{block}_loads")
    once = s.friction.method == "single"
    t = tuple_of([NOUGHT] * len(joints))
    for _ in range(0 if once else DOUBLINGS):
        k, drag = laws_at(s, joints, g)
        step = s.emit(solvers.tangent_step, t, k, drag, edges, base, rows, name=f"{block}_step")
        t, g = step[0], step[1]
    k, drag = laws_at(s, joints, g)
    solved = _solve(s, block, joints, k, drag, edges, base, rows)
    if not once:
        laws = map(tuple_of, ((k, drag), laws_at(s, joints, solved.g)))
        steepest = tuple_of(s.ask(friction.steepest, j) for j in joints)
        args = (solved, *laws, steepest, edges, rows)
        solved = s.emit(solvers.judged, *args, name=f"{block}_by_tangents")
    return s.emit(solvers.with_drag, solved, drag, name=f"{block}_friction")


def laws_at(s: Schedule, joints: Iterable[JointRef], g: Value | None = None) -> tuple[Value, Value]:
    """Signed factors and drags of several pairs, zero without any; ``g`` are their loads."""
    loads = [(j, *(() if g is None else (g[i],))) for i, j in enumerate(joints)]
    drags = [s.ask(friction.drag, *key) for key in loads]
    k = tuple_of(s.ask(friction.resistance, *key) for key in loads)
    return k, NOUGHT if all(drag.zero for drag in drags) else tuple_of(drags)


def influences(s: Schedule, joints: tuple[JointRef, ...], base: Value) -> Value:
    """What a unit of friction in each pair of a block adds to the loads on all of them."""
    return tuple_of(
        tuple_of(statics(s, j).measure(s, j, s.ask(influence, j, unit, base)) for unit in joints)
        for j in joints
    )


def existence(s: Schedule, block: str) -> Value | None:
    """The number that is below 1 where a block's friction has a solution for every load.

    None without friction, and for a group of which it is not known.
    """
    joints = s.ask(friction.coupled_joints, block)
    reactions = s.ask(smooth, block) if joints else None
    if reactions is None or not friction.knows_existence(s.structure, block, joints):
        return None
    contacts = constant(tuple(friction.contacts(s.structure, ref) for ref in joints))
    args = (laws_at(s, joints)[0], contacts, influences(s, joints, reactions))
    return s.emit(existence_of, *args, name=f"{block}_existence")


def solve_driven(s: Schedule, ref: JointRef, pair: Value) -> Value:
    """The friction of a driven pair, which does not change what the pair transmits."""
    edges = tuple_of([constant(statics(s, ref).edges)])
    base = tuple_of([statics(s, ref).measure(s, ref, pair)])
    g = None
    if s.structure.friction_law(ref).reads_load:
        g = s.emit(equations.norms, base, edges, name=f"{ref}_loads")
    k, drag = laws_at(s, (ref,), g)
    if drag.zero:
        return s.emit(solvers.direct, k, edges, base, name=f"{ref}_friction")
    solved = s.emit(solvers.direct, k, edges, base, name=f"{ref}_by_load")
    return s.emit(solvers.with_drag, solved, drag, name=f"{ref}_friction")


def resisting(s: Schedule, ref: JointRef) -> Value:
    """Friction of a pair on the later link: couple [N m] or force [N]."""
    if s.friction.method == friction.GIVEN:
        has_friction = ref in s.ask(friction.friction_joints, ref.block)
        return s.ask(friction.friction_input, ref) if has_friction else NOUGHT
    solution = s.ask(friction_at, ref)
    return NOUGHT if solution is None else solution[0].t[solution[1]]


def friction_at(s: Schedule, ref: JointRef) -> tuple[Value, int] | None:
    """Solved friction that a pair is part of, and its place there; None without friction."""
    if ref not in s.ask(friction.friction_joints, ref.block):
        return None
    if ref in s.ask(friction.coupled_joints, ref.block):
        solved, joints = s.ask(solution, ref.block), s.ask(friction.coupled_joints, ref.block)
        return None if solved is None else (solved, joints.index(ref))
    pair = s.ask(reaction, ref)
    return None if pair is None else (s.ask(solve_driven, ref, pair), 0)


def reaction(s: Schedule, ref: JointRef) -> Value | None:
    """What a pair transmits, R or N + i C, friction included; None for a structural zero."""
    reactions = s.ask(smooth, ref.block)
    if reactions is None:
        return None
    total: Value = s.ask(transmitted, ref, reactions, s.loaded.ask(smooth, ref.block))
    solved = s.ask(solution, ref.block)
    if solved is not None:
        units = enumerate(s.ask(friction.coupled_joints, ref.block))
        rubs = [(unit, solved.t[k]) for k, unit in units]
    else:  # given friction of pairs loads the links; that of a mesh goes from link to link
        meshes = s.structure.meshes if s.friction.method == friction.GIVEN else {}
        joints = s.ask(friction.friction_joints, ref.block)
        rubs = [(unit, s.ask(friction.friction_input, unit)) for unit in joints if unit in meshes]
    for unit, t in rubs:
        total += mul(s.ask(influence, ref, unit, reactions), t)
    return s.line(total, f"{ref}_R")


def drive(s: Schedule, driver: str) -> Value:
    """Driving moment [N m] or force [N] by the force pass, friction included."""
    return signed(s, driver, s.ask(effort_in, s.structure.driven[driver]))


def effort_in(s: Schedule, joint: JointRef) -> Value:
    """What drives a joint: moment [N m] or force [N] on the later link, friction included."""
    reactions = s.ask(smooth, joint.block)
    if reactions is None:
        return NOUGHT
    effort: Value = getattr(reactions, s.structure.blocks[joint.block].effort_field(joint.name))
    coupled, solved = s.ask(friction.coupled_joints, joint.block), s.ask(solution, joint.block)
    if solved is not None:
        for k, unit in enumerate(coupled):
            effort += s.ask(effort_influence, joint, unit) * solved.t[k]
    if joint not in coupled:
        effort -= s.ask(resisting, joint)
    return s.line(effort, f"{joint}_drive")


def wrench(s: Schedule, ref: JointRef) -> tuple[Value, Value]:
    """Force and moment on the support of an outer joint, about the wire's forward point."""
    pair = s.ask(reaction, ref)
    if pair is None:
        return ZERO, NOUGHT
    joint = s.structure.joint(ref)
    by_support = joint.driven and s.structure.contact_at(ref) is None  # not by another link
    effort = s.ask(effort_in, ref) if by_support else NOUGHT
    effort = s.sum((s.ask(resisting, ref), effort, s.ask(push, ref)), f"{ref}_along")
    return statics(s, ref).back(s, ref, pair, effort)


def meshing(s: Schedule, driver: str) -> Value:
    """What the link that leads does to a coupled one, about the marker of the driven pair."""
    ref = s.structure.driven[driver]
    base = s.loaded.ask(smooth, ref.block)
    parts = [s.ask(contact, driver, s.ask(effort_in, ref), base)]
    for mesh in s.ask(meshes_of, driver):
        parts.append(mesh_statics(s, mesh).load(s, driver, s.ask(resisting, mesh)))
    tension = s.ask(preload, driver)
    parts += [] if tension is None else [tension]
    if len(parts) == 1:
        return parts[0]
    force, moment = (sum((getattr(part, x) for part in parts), NOUGHT) for x in "FM")
    return s.emit(Load, force, moment, name=f"{driver}_meshing")


def meshes_of(s: Schedule, driver: str) -> list[JointRef]:
    """The meshes by which a driver follows, where friction is solved."""
    joints = s.ask(friction.friction_joints, s.structure.driven[driver].block)
    meshes = s.structure.meshes_of(driver)
    return [ref for ref in joints if ref in meshes]


def coupling_reading(s: Schedule, driver: str, read: Reading) -> Value:
    """A further output of a coupling; of its forces, 0 where none act."""
    name, ref = s.structure.followers[driver].coupling, s.structure.driven[driver]
    if read.of_load and s.ask(smooth, ref.block) is None:
        return NOUGHT
    load = [s.ask(meshing, driver)] if read.of_load else []
    if s.structure.touch(driver) is not None:
        args = s.ask(forward.touch, driver), *load
    else:
        args = s.ask(forward.meshing, driver), *load, s.ask(forward.numbers, name)
    return s.emit(read.kernel, *args, name=f"{name}_reading")


def preload(s: Schedule, driver: str) -> Value | None:
    """What a coupling does to the driven link without any effort; None for nothing."""
    name = s.structure.followers[driver].coupling
    kernel = s.structure.couplings[name].tension()
    if kernel is None or s.unit_load is not None:
        return None
    args = s.ask(forward.meshing, driver), s.ask(forward.numbers, name)
    load = s.emit(kernel, *args, name=f"{name}_preload")
    if s.friction.method != friction.GIVEN:
        return load
    share = s.unknown("load_share")
    return s.emit(Load, mul(load.F, share), load.M * share, name=f"{name}_share")


def coupled(s: Schedule, link: LinkRef) -> Resultant:
    """What couplings do to a link that leads, or on whose support a black box stands."""
    total, structure = NOTHING, s.structure
    for driver in structure.tensioned_on[link] if s.unit_load is None else ():
        if link == structure.later_link(structure.driven[driver]):  # the leader's share is below
            total += _about_origin(s, link, driver, s.ask(preload, driver))
    for driver in structure.coupled_on[link]:
        ref, leader = structure.driven[driver], structure.followers[driver].leader
        if not s.ask(active, ref.block):
            continue
        if s.structure.contact_at(ref) is not None:
            total += _about_origin(s, link, driver, s.ask(meshing, driver), back=True)
            continue
        assert leader is not None
        lost = [s.ask(resisting, mesh) for mesh in s.ask(meshes_of, driver)]
        felt = s.ask(slope_effort, driver, s.ask(effort_in, ref), s.sum(lost, f"{driver}_lost"))
        minus = s.line(-felt, f"{driver}_minus_felt")
        if link == structure.later_link(leader):
            total += statics(s, leader).load_along(s, leader, link, minus)
            continue
        force, moment = statics(s, leader).back(s, leader, ZERO, minus)
        hold = s.ask(marker_arm, structure.feeds[leader])
        total += at_arm(s, force, hold, f"{driver}_housing") + moment_of(moment)
    return total


def _about_origin(
    s: Schedule, link: LinkRef, driver: str, load: Value | None, back: bool = False
) -> Resultant:
    """A load about the marker of a driven pair, or its opposite, on a link."""
    if load is None:
        return NOTHING
    o, p = s.ask(link_position, link).vector, s.structure.feeds[s.structure.driven[driver]]
    arm = s.line(s.ask(marker_place, p) - o, f"{driver}_mesh_arm")
    force, moment = (-load.F, -load.M) if back else (load.F, load.M)
    force = s.line(force, f"{driver}_mesh_F")
    turning = moment_of(s.line(moment, f"{driver}_mesh_M"))
    return at_arm(s, force, arm, f"{driver}_mesh") + turning


def frame_load(s: Schedule) -> Resultant:
    """What the mechanism exerts on the frame, about the frame's origin."""
    link = s.structure.frame_link
    return s.ask(carried, link) + s.ask(elements_on, link) + s.ask(coupled, link)
