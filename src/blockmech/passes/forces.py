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
from blockmech.friction.existence import existence as existence_of
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
from blockmech.passes.resultants import NOTHING, Resultant, active, at_arm, later_blocks
from blockmech.plan.plan import NOUGHT, ZERO, Entry, Schedule
from blockmech.typing import Load


def carried(s: Schedule, link: LinkRef) -> Resultant:
    """What active later blocks pass on to a link, in name order."""
    total = NOTHING
    for ref in s.structure.carried[link]:
        if not s.ask(active, ref.block):
            continue
        force, moment = s.ask(wrench, ref)
        arm = s.ask(marker_arm, s.structure.feeds[ref])
        total += at_arm(s, force, arm, f"{ref}_back")
        if moment != NOUGHT:
            total += Resultant((), (moment,))
    return total


def shared(s: Schedule, link: LinkRef) -> Resultant:
    """The applied loads of a link times the input ``load_share`` (1, or 0: none)."""
    load, share = s.ask(applied, link), s.unknown("load_share")
    return Resultant(
        tuple(s.line(f"mul({force}, {share})", f"{link}_F_share") for force in load.forces),
        tuple(s.line(f"{moment} * {share}", f"{link}_M_share") for moment in load.moments),
    )


def link_load(s: Schedule, link: LinkRef) -> str:
    """Everything that loads a link, as one resultant about its origin."""
    if s.friction.method == friction.GIVEN:
        loads = s.ask(shared, link) + s.ask(given_on, link)
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


def push(s: Schedule, ref: JointRef) -> str:
    """What is given to push along the coordinate of a pair, on its later link [N m or N]."""
    known = ref in s.friction.pushed and s.unit_load is None
    return s.unknown(f"push_{s.friction.pushed.index(ref)}") if known else NOUGHT


def given_on(s: Schedule, link: LinkRef) -> Resultant:
    """Given friction in the pairs of a block on one of its links."""
    total = NOTHING
    for ref in s.ask(friction.coupled_joints, link.block):
        if ref not in s.structure.meshes and touches(s, ref, link):
            total += friction_on(s, ref, link, s.ask(friction.given, ref))
    return total


def smooth(s: Schedule, block: str) -> str | None:
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


def solution(s: Schedule, block: str) -> str | None:
    """The solved friction of a block's pairs, driven ones aside: ``t``, and how it went."""
    if s.friction.method == friction.GIVEN or not s.ask(friction.coupled_joints, block):
        return None  # before the reactions are asked for: nothing here needs them
    reactions = s.ask(smooth, block)
    return None if reactions is None else s.ask(solve, block, reactions)


def solve(s: Schedule, block: str, reactions: str) -> str:
    """The solved friction of a block with these frictionless reactions: ``t``, and how it went."""
    joints = s.ask(friction.coupled_joints, block)
    edges = tuple_of(str(statics(s, j).edges) for j in joints)
    base = tuple_of(
        statics(s, j).measure(s, j, s.ask(transmitted, j, reactions, reactions)) for j in joints
    )
    rows = influences(s, joints, reactions)
    if any(s.structure.friction_law(j).reads_load for j in joints):
        return _by_load(s, block, joints, edges, base, rows)
    k, drag = laws_at(s, joints)
    solved = _solve(s, block, joints, k, drag, edges, base, rows)
    return s.emit(solvers.with_drag, solved, drag, name=f"{block}_friction") if drag else solved


def _solve(
    s: Schedule,
    block: str,
    joints: tuple[JointRef, ...],
    k: str,
    drag: str,
    edges: str,
    base: str,
    rows: str,
) -> str:
    """The solver's answer for signed factors, with loads that drags shift (none: an empty text)."""
    solver, options = solvers.SOLVERS[s.friction.method]
    given = {"tolerance": s.friction.tolerance, "iterations": s.friction.iterations}
    more = [repr(given[o]) for o in options]
    c = s.ask(existence, block)
    more += [] if c is None else [f"{c} < 1.0"]
    if s.friction.along:
        own = tuple_of(s.ask(friction.given, j) for j in joints)
        more += ["False"] if c is None else []
        more += [s.emit(solvers.without_drag, own, drag, name=f"{block}_own") if drag else own]
    if not drag:
        return s.emit(solver, k, edges, base, rows, *more, name=f"{block}_friction")
    base = s.emit(equations.loads, drag, base, rows, name=f"{block}_dragged")
    return s.emit(solver, k, edges, base, rows, *more, name=f"{block}_by_load")


def _by_load(
    s: Schedule, block: str, joints: tuple[JointRef, ...], edges: str, base: str, rows: str
) -> str:
    """The same with laws that are not linear in the load: by their tangents at the loads.

    The steps of `solvers.by_tangents`, here as calls of a program.
    """
    g = s.emit(equations.norms, base, edges, name=f"{block}_loads")
    once = s.friction.method == "single"
    t = tuple_of([NOUGHT] * len(joints))
    for _ in range(0 if once else solvers.TANGENTS):
        k, drag = laws_at(s, joints, g)
        found = s.emit(solvers.tangent_step, t, k, drag, edges, base, rows, name=f"{block}_step")
        t, g = f"{found}[0]", f"{found}[1]"
    law = laws_at(s, joints, g)
    solved = _solve(s, block, joints, *law, edges, base, rows)
    if once:
        return s.emit(solvers.with_drag, solved, law[1], name=f"{block}_friction")
    there = laws_at(s, joints, f"{solved}.g")
    most = tuple_of(s.ask(friction.steepest, j) for j in joints)
    args = (solved, tuple_of(law), tuple_of(there), most, edges, rows)
    judged = s.emit(solvers.judged, *args, name=f"{block}_by_tangents")
    return s.emit(solvers.with_drag, judged, law[1], name=f"{block}_friction")


def laws_at(s: Schedule, joints: Iterable[JointRef], g: str = "") -> tuple[str, str]:
    """Signed factors and drags of several pairs, no text without drags; ``g`` are their loads."""
    loads = [(j, *((f"{g}[{i}]",) if g else ())) for i, j in enumerate(joints)]
    drags = [s.ask(friction.drag, *key) for key in loads]
    k = tuple_of(s.ask(friction.resistance, *key) for key in loads)
    return k, tuple_of(drags) if any(drag != NOUGHT for drag in drags) else ""


def influences(s: Schedule, joints: tuple[JointRef, ...], base: str) -> str:
    """What a unit of friction in each pair of a block adds to the loads on all of them."""
    return tuple_of(
        tuple_of(statics(s, j).measure(s, j, s.ask(influence, j, unit, base)) for unit in joints)
        for j in joints
    )


def existence(s: Schedule, block: str) -> str | None:
    """The number that is below 1 where a block's friction has a solution for every load.

    None without friction, and for a group of which it is not known.
    """
    joints = s.ask(friction.coupled_joints, block)
    reactions = s.ask(smooth, block) if joints else None
    if reactions is None or not friction.knows_existence(s.structure, block, joints):
        return None
    contacts = str(tuple(friction.contacts(s.structure, ref) for ref in joints))
    args = (laws_at(s, joints)[0], contacts, influences(s, joints, reactions))
    return s.emit(existence_of, *args, name=f"{block}_existence")


def solve_driven(s: Schedule, ref: JointRef, pair: str) -> str:
    """The friction of a driven pair, which does not change what the pair transmits."""
    edges, base = f"({statics(s, ref).edges},)", f"({statics(s, ref).measure(s, ref, pair)},)"
    g = ""
    if s.structure.friction_law(ref).reads_load:
        g = s.emit(equations.norms, base, edges, name=f"{ref}_loads")
    k, drag = laws_at(s, (ref,), g)
    if not drag:
        return s.emit(solvers.direct, k, edges, base, name=f"{ref}_friction")
    solved = s.emit(solvers.direct, k, edges, base, name=f"{ref}_by_load")
    return s.emit(solvers.with_drag, solved, drag, name=f"{ref}_friction")


def tuple_of(items: Iterable[str]) -> str:
    """Text of a tuple of values."""
    return f"({''.join(f'{item}, ' for item in items)})"


def resisting(s: Schedule, ref: JointRef) -> str:
    """Friction of a pair on the later link: couple [N m] or force [N]."""
    if s.friction.method == friction.GIVEN:
        known = ref in s.ask(friction.friction_joints, ref.block)
        return s.ask(friction.given, ref) if known else NOUGHT
    solution = s.ask(friction_at, ref)
    return NOUGHT if solution is None else f"{solution[0]}.t[{solution[1]}]"


def friction_at(s: Schedule, ref: JointRef) -> tuple[str, int] | None:
    """Solved friction that a pair is part of, and its place there; None without friction."""
    if ref not in s.ask(friction.friction_joints, ref.block):
        return None
    if ref in s.ask(friction.coupled_joints, ref.block):
        solved, joints = s.ask(solution, ref.block), s.ask(friction.coupled_joints, ref.block)
        return None if solved is None else (solved, joints.index(ref))
    pair = s.ask(reaction, ref)
    return None if pair is None else (s.ask(solve_driven, ref, pair), 0)


def reaction(s: Schedule, ref: JointRef) -> str | None:
    """What a pair transmits, R or N + i C, friction included; None for a structural zero."""
    reactions = s.ask(smooth, ref.block)
    if reactions is None:
        return None
    total = s.ask(transmitted, ref, reactions, s.loaded.ask(smooth, ref.block))
    solved = s.ask(solution, ref.block)
    if solved is not None:
        units = enumerate(s.ask(friction.coupled_joints, ref.block))
        rubs = [(unit, f"{solved}.t[{k}]") for k, unit in units]
    else:  # given friction of pairs loads the links; that of a mesh goes from link to link
        meshes = s.structure.meshes if s.friction.method == friction.GIVEN else {}
        joints = s.ask(friction.friction_joints, ref.block)
        rubs = [(unit, s.ask(friction.given, unit)) for unit in joints if unit in meshes]
    for unit, t in rubs:
        total += f" + mul({s.ask(influence, ref, unit, reactions)}, {t})"
    return s.line(total, f"{ref}_R") if rubs else total


def drive(s: Schedule, driver: str) -> str:
    """Driving moment [N m] or force [N] by the force pass, friction included."""
    return signed(s, driver, s.ask(effort_in, s.structure.driven[driver]))


def effort_in(s: Schedule, joint: JointRef) -> str:
    """What drives a joint: moment [N m] or force [N] on the later link, friction included."""
    reactions = s.ask(smooth, joint.block)
    if reactions is None:
        return NOUGHT
    effort = f"{reactions}.{s.structure.blocks[joint.block].effort_field(joint.name)}"
    solved = s.ask(solution, joint.block)
    units = s.ask(friction.coupled_joints, joint.block) if solved is not None else ()
    for k, unit in enumerate(units):
        if (by := s.ask(effort_influence, joint, unit)) != NOUGHT:
            effort += f" + {by} * {solved}.t[{k}]"
    t = NOUGHT if joint in s.ask(friction.coupled_joints, joint.block) else s.ask(resisting, joint)
    if t != NOUGHT:
        effort += f" - {t}"
    return s.line(effort, f"{joint}_drive") if " " in effort else effort


def wrench(s: Schedule, ref: JointRef) -> tuple[str, str]:
    """Force and moment on the support of an outer joint, about the wire's forward point."""
    pair = s.ask(reaction, ref)
    if pair is None:
        return ZERO, NOUGHT
    joint = s.structure.joint(ref)
    held = (
        joint.driven and s.structure.contact_at(ref) is None
    )  # by the support, not by another link
    effort = s.ask(effort_in, ref) if held else NOUGHT
    along = s.sum((s.ask(resisting, ref), effort, s.ask(push, ref)), f"{ref}_along")
    return statics(s, ref).back(s, ref, pair, along)


def meshing(s: Schedule, driver: str) -> str:
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
    force, moment = (" + ".join(f"{part}.{x}" for part in parts) for x in "FM")
    return s.emit(Load, force, moment, name=f"{driver}_meshing")


def meshes_of(s: Schedule, driver: str) -> list[JointRef]:
    """The meshes by which a driver follows, where friction is solved."""
    joints = s.ask(friction.friction_joints, s.structure.driven[driver].block)
    own = s.structure.meshes_of(driver)
    return [ref for ref in joints if ref in own]


def coupling_reading(s: Schedule, driver: str, read: Reading) -> str:
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


def preload(s: Schedule, driver: str) -> str | None:
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
    return s.emit(Load, f"mul({load}.F, {share})", f"{load}.M * {share}", name=f"{name}_share")


def coupled(s: Schedule, link: LinkRef) -> Resultant:
    """What couplings do to a link that leads, or on whose support a black box stands."""
    total, structure = NOTHING, s.structure
    for driver in structure.tensioned_on[link] if s.unit_load is None else ():
        if link == structure.later_link(structure.driven[driver]):  # the leader's share is below
            total += _about_origin(s, link, driver, s.ask(preload, driver), "")
    for driver in structure.coupled_on[link]:
        ref, leader = structure.driven[driver], structure.followers[driver].leader
        if not s.ask(active, ref.block):
            continue
        if s.structure.contact_at(ref) is not None:
            total += _about_origin(s, link, driver, s.ask(meshing, driver), "-")
            continue
        assert leader is not None
        lost = [s.ask(resisting, mesh) for mesh in s.ask(meshes_of, driver)]
        felt = s.ask(slope_effort, driver, s.ask(effort_in, ref), s.sum(lost, f"{driver}_lost"))
        minus = s.line(f"-{felt}", f"{driver}_minus_felt")
        if link == structure.later_link(leader):
            total += statics(s, leader).along(s, leader, link, minus)
            continue
        force, moment = statics(s, leader).back(s, leader, ZERO, minus)
        hold = s.ask(marker_arm, structure.feeds[leader])
        total += at_arm(s, force, hold, f"{driver}_housing") + Resultant((), (moment,))
    return total


def _about_origin(
    s: Schedule, link: LinkRef, driver: str, load: str | None, minus: str
) -> Resultant:
    """A load about the marker of a driven pair, or its opposite, on a link."""
    o, p = s.ask(link_position, link).vector, s.structure.feeds[s.structure.driven[driver]]
    arm = at = s.ask(marker_place, p)
    if o != ZERO:
        arm = s.line(f"{at} - {o}", f"{driver}_mesh_arm")
    force = s.line(f"{minus}{load}.F", f"{driver}_mesh_F")
    turning = Resultant((), (s.line(f"{minus}{load}.M", f"{driver}_mesh_M"),))
    return at_arm(s, force, arm, f"{driver}_mesh") + turning


def frame_load(s: Schedule) -> Resultant:
    """What the mechanism exerts on the frame, about the frame's origin."""
    link = s.structure.frame_link
    return s.ask(carried, link) + s.ask(elements_on, link) + s.ask(coupled, link)
