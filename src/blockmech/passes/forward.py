"""The forward pass: positions, velocities, accelerations along the wires.

A rule here answers with values of the program. Motions are asked in a *mode*:
``ACTUAL`` rates of all drivers, the unit rate of one driver, or ``BIAS``, the
actual rates without driver accelerations. A block that a mode does not move
answers None, and nothing is emitted for it.

Sources: [R10] Fig. 3, [D14] Fig. 2 and section 2 (i).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, NamedTuple, TypeAlias

from blockmech.blocks.contract import BuiltIn
from blockmech.blocks.modes import passed, passed_slide
from blockmech.couplings.contract import Meshing
from blockmech.ground.plane import expi
from blockmech.ground.values import Marker
from blockmech.model.meshing import coupling_numbers
from blockmech.model.structure import FollowedBranch, JointRef, LinkRef, MarkerRef, Structure
from blockmech.plan import values
from blockmech.plan.plan import Entry, Formula, Schedule
from blockmech.plan.values import HALF, NOUGHT, ONE, UNIT, ZERO, Value, dot, imul, mul
from blockmech.typing import Guide, LinkAcceleration, LinkVelocity

ACTUAL = ""
BIAS = "bias"
Terms: TypeAlias = tuple[tuple[str, int], ...]


class Moved(NamedTuple):
    """A link's two values at one stage, e.g. velocity and rate."""

    vector: Value
    scalar: Value


# -- coordinates of drivers ------------------------------------------------------
#
# They are inputs of the program, or functions of others by a coupling. Its argument x is a sum
# of coordinates, so with F the transmission
#
#     q = F(x),    q' = F' x',    q'' = F' x'' + F'' x'^2
#
# in every mode of motion: unit rates give what a coupled link adds to the reduced inertia, and
# unit rates without driver accelerations what F'' adds to its slope.


def signed(s: Schedule, driver: str, value: Value) -> Value:
    """A rate, acceleration or effort of a driven joint from its driver's, or the other way."""
    return value if s.structure.coordinate(driver).sign > 0 else s.line(-value, f"minus_{value}")


def joint_coordinate(s: Schedule, driver: str) -> Value:
    """Coordinate of a driven joint, from its driver's: sign q + offset."""
    q = signed(s, driver, s.ask(coordinate_of, driver))
    if s.structure.coordinate(driver).offset == 0:
        return q
    slot = s.parameter(
        ("offset", driver), lambda st, _: st.coordinate(driver).offset, f"{driver}_offset"
    )
    return s.line(q + slot, f"{driver}_joint")


def coordinate_of(s: Schedule, driver: str) -> Value:
    """Coordinate of a driver."""
    if driver not in s.structure.followers:
        return s.input("q", driver)
    return _counted(s, driver, s.ask(transmission, driver).q, coordinate_of)


def rate_of(s: Schedule, driver: str, mode: str = ACTUAL) -> Value:
    """Rate of a driver in a mode."""
    if driver not in s.structure.followers:
        if mode in (ACTUAL, BIAS):
            return s.input("qd", driver)
        return UNIT if mode == driver else NOUGHT
    x = s.ask(argument, driver, rate_of, mode)
    rate = s.line(s.ask(transmission, driver).slope * x, f"{driver}_rate")
    return _counted(s, driver, rate, rate_of, mode)


def acceleration_of(s: Schedule, driver: str, mode: str = ACTUAL) -> Value:
    """Acceleration of a driver in a mode; unit and bias modes without driver acceleration."""
    if driver not in s.structure.followers:
        return NOUGHT if mode else s.input("qdd", driver)
    x, rate = s.ask(argument, driver, acceleration_of, mode), s.ask(argument, driver, rate_of, mode)
    F = s.ask(transmission, driver)
    value = s.line(F.slope * x + F.curve * rate * rate, f"{driver}_acceleration")
    return _counted(s, driver, value, acceleration_of, mode)


# -- by a coupling -------------------------------------------------------------------


def transmission(s: Schedule, driver: str) -> Value:
    """The coupling's kernel at its argument: coordinate, slope and curve."""
    name = s.structure.followers[driver].coupling
    kernel = s.structure.couplings[name].transmission(s.structure.coupled_pair(name))
    return s.emit(kernel, s.ask(argument, driver), s.ask(numbers, name), name=f"{name}_F")


def argument(
    s: Schedule, driver: str, rule: Callable[..., Value] = coordinate_of, *mode: str
) -> Value:
    """Argument of a driver's coupling, its rate or its acceleration: by that rule of drivers."""
    return _sum(s, driver, s.structure.followers[driver].terms, rule, *mode)


def meshing(s: Schedule, driver: str) -> Value:
    """Where both sides of a driver's coupling are."""
    structure, follower = s.structure, s.structure.followers[driver]
    ref, leader = structure.driven[driver], follower.leader
    lead = follower.centre.on if leader is None else structure.later_link(leader)
    poses = (s.ask(link_position, link) for link in (lead, structure.later_link(ref)))
    args = [s.ask(guide, follower.centre), s.ask(guide, structure.feeds[ref])]
    args += [s.emit(Guide, *pose, name=f"{driver}_side") for pose in poses]
    args += [s.ask(argument, driver), s.ask(transmission, driver)]
    return s.emit(Meshing, *args, name=f"{follower.coupling}_here")


def guide(s: Schedule, marker: MarkerRef) -> Value:
    """Place and direction of a marker."""
    args = s.ask(marker_place, marker), s.ask(marker_direction, marker)
    return s.emit(Guide, *args, name=f"{marker.block}_{marker.name}_guide")


def numbers(s: Schedule, coupling: str) -> Value:
    """Slot of a coupling's own numbers."""
    return s.parameter(
        ("numbers", coupling), lambda st, _: coupling_numbers(st, coupling), f"P_{coupling}"
    )


def _sum(s: Schedule, driver: str, terms: Terms, rule: Callable[..., Value], *mode: str) -> Value:
    """The sum of terms with their signs, and with the senses in which drivers count."""
    structure, total = s.structure, NOUGHT
    meshes = structure.couplings[structure.followers[driver].coupling].meshes
    for term, sense in terms:
        value = s.ask(rule, term, *mode)
        counted = sense * (structure.coordinate(term).sign if meshes else 1)
        total = total + value if counted > 0 else total - value
    return s.line(total, f"{driver}_x")


def _counted(
    s: Schedule, driver: str, value: Value, rule: Callable[..., Value], *mode: str
) -> Value:
    """A value of the driven pair, the carrier's motion added, as its driver counts it."""
    follower = s.structure.followers[driver]
    carried = _sum(s, driver, follower.added, rule, *mode)
    total = s.sum((value, carried), f"{driver}_whole")
    return signed(s, driver, total) if s.structure.couplings[follower.coupling].meshes else total


# -- positions -----------------------------------------------------------------


def parameters(s: Schedule, block: str) -> Value:
    """The slot of a block's own numbers."""
    return s.parameter(("numbers", block), lambda st, _: st.block(block).parameters(), f"P_{block}")


def position(s: Schedule, block: str) -> Value:
    """Pose of a block, from the places of its supports."""
    s.ask_first(position, block, s.structure.sources)
    b = s.structure.blocks[block]
    args = _read(s, block, joint_position)
    args += [s.ask(joint_coordinate, driver) for driver in s.structure.drivers_of(block)]
    if b.own_form:
        args.append(s.guess(s, block))
    numbers = s.ask(parameters, block)
    args.append(s.ask(followed, block, numbers) if block in s.structure.followed else numbers)
    return s.kernel(Entry(block, "position"), b.kernels.position, *args, name=f"{block}_pose")


def _read(s: Schedule, block: str, reading: Callable[..., Value], *stage: Hashable) -> list[Value]:
    """What the outer joints of a block read at a stage."""
    joints = s.structure.blocks[block].joints.values()
    return [s.ask(reading, JointRef(block, j.name), *stage) for j in joints if j.outer]


def margin(s: Schedule, block: str) -> Value:
    """Margin [-] of a block that closes a loop."""
    pose, kernel = s.ask(position, block), s.structure.blocks[block].kernels.margin
    if kernel is None:
        return pose.margin
    return s.emit(kernel, pose, s.ask(parameters, block), name=f"{block}_margin")


def joint_position(s: Schedule, ref: JointRef) -> Value:
    """What an outer joint reads at the position stage."""
    joint, marker = s.structure.joint(ref), s.structure.feeds[ref]
    p = s.ask(marker_place, marker)
    return p if joint.reads == "point" else s.ask(guide, marker)


def link_position(s: Schedule, link: LinkRef) -> Moved:
    """Origin and direction of a link."""
    if link == s.structure.frame_link:
        return Moved(ZERO, ONE)
    pose = _field(s, link, s.ask(position, link.block))
    return Moved(pose.o, pose.e)


def _field(s: Schedule, link: LinkRef, motion: Value) -> Value:
    """What the kernel of a link's block says of the link."""
    of_link: Value = getattr(motion, s.structure.blocks[link.block].link_field(link.link))
    return of_link


def marker_arm(s: Schedule, marker: MarkerRef) -> Value:
    """Arm of a marker from its link's origin, in ground axes."""
    declared = s.structure.marker(marker)
    if not isinstance(declared, BuiltIn):
        return arm_of(s, marker.on, lambda st, _: _user_marker(st, marker).at.z, _name(marker))
    if not declared.along:
        return ZERO
    e, at = s.ask(link_position, marker.on).scalar, s.ask(parameters, marker.block)
    return s.line(mul(e, getattr(at, declared.along)), f"{_name(marker)}_arm")


def _user_marker(structure: Structure, marker: MarkerRef) -> Marker:
    declared = structure.marker(marker)
    assert isinstance(declared, Marker)
    return declared


def arm_of(s: Schedule, link: LinkRef, at: Formula, name: str) -> Value:
    """Arm of a place given in a link's frame."""
    z: complex = s.planned(at)
    if z == 0:
        return ZERO
    if link == s.structure.frame_link:
        return s.parameter(("at", link, name), at, f"{name}_arm")
    e = s.ask(link_position, link).scalar
    if z.imag:
        return s.line(e * s.parameter(("at", link, name), at, f"at_{name}"), f"{name}_arm")
    slot = s.parameter(("at", link, name), lambda *design: at(*design).real, f"at_{name}")
    return s.line(mul(e, slot), f"{name}_arm")


def marker_place(s: Schedule, marker: MarkerRef) -> Value:
    """Place of a marker."""
    return point_at(s, marker.on, s.ask(marker_arm, marker), f"{_name(marker)}_p")


def point_at(s: Schedule, link: LinkRef, arm: Value, name: str) -> Value:
    """The place at an arm from a link's origin."""
    return s.line(s.ask(link_position, link).vector + arm, name)


def marker_direction(s: Schedule, marker: MarkerRef) -> Value:
    """Unit direction of a marker."""
    if isinstance(s.structure.marker(marker), BuiltIn):
        return s.ask(link_position, marker.on).scalar
    return _ground(
        s,
        marker.on,
        lambda st, _: _user_marker(st, marker).direction,
        ("dir", marker),
        _name(marker),
    )


def _ground(s: Schedule, link: LinkRef, u: Formula, key: tuple[Hashable, ...], name: str) -> Value:
    """A direction given in a link's frame, in ground axes."""
    e = s.ask(link_position, link).scalar
    if s.planned(u) == 1:
        return e
    slot = s.parameter(key, u, f"dir_{name}")
    return slot if e == ONE else s.line(e * slot, f"{name}_u")


# -- velocities and accelerations -----------------------------------------------


def moves(s: Schedule, block: str, mode: str) -> bool:
    """Whether a block moves in a mode."""
    upstream = s.structure.upstream[block]
    return mode in upstream if mode not in (ACTUAL, BIAS) else bool(upstream)


def velocity(s: Schedule, block: str, mode: str = ACTUAL) -> Value | None:
    """Velocity of a block in a mode; None where it does not move."""
    if not moves(s, block, mode):
        return None
    if mode == BIAS:
        return s.ask(velocity, block, ACTUAL)
    s.ask_first(velocity, block, s.structure.sources, mode)
    drivers = s.structure.drivers_of(block)
    args = [s.ask(position, block), *_read(s, block, joint_motion, mode, LinkVelocity)]
    args += [signed(s, driver, s.ask(rate_of, driver, mode)) for driver in drivers]
    return _motion(s, block, mode, "velocity", args)


def acceleration(s: Schedule, block: str, mode: str = ACTUAL) -> Value | None:
    """Acceleration of a block in a mode; unit and bias modes without driver acceleration."""
    if not moves(s, block, mode):
        return None
    s.ask_first(acceleration, block, s.structure.sources, mode)
    vel = s.ask(velocity, block, mode)
    assert vel is not None  # the block moves in this mode
    drivers = s.structure.drivers_of(block)
    args = [s.ask(position, block), vel, *_read(s, block, joint_motion, mode, LinkAcceleration)]
    args += [signed(s, driver, s.ask(acceleration_of, driver, mode)) for driver in drivers]
    return _motion(s, block, mode, "acceleration", args)


def _motion(s: Schedule, block: str, mode: str, stage: str, args: list[Value]) -> Value:
    """The kernel call of a stage of motion."""
    entry = Entry(block, f"unit {stage}" if mode else stage, mode)
    kernel = getattr(s.structure.blocks[block].kernels, stage)
    name = f"{block}_{stage[:3]}{_suffix(mode)}"
    return s.kernel(entry, kernel, *args, s.ask(parameters, block), name=name)


def joint_motion(
    s: Schedule, ref: JointRef, mode: str, record: type[LinkVelocity | LinkAcceleration]
) -> Value:
    """What an outer joint reads at the stage of velocities or accelerations."""
    is_velocity, marker = record is LinkVelocity, s.structure.feeds[ref]
    vector = s.ask(marker_velocity if is_velocity else marker_acceleration, marker, mode)
    if s.structure.joint(ref).reads == "point":
        return vector
    motion = s.ask(link_velocity if is_velocity else link_acceleration, marker.on, mode)
    name = f"{_name(marker)}_guide_{record._fields[0]}"
    return s.emit(record, vector, motion.scalar, name=name)


def link_velocity(s: Schedule, link: LinkRef, mode: str = ACTUAL) -> Moved:
    """Velocity of a link's origin and rate of the link."""
    return _moved(s, link, mode, velocity, "v", "om")


def link_acceleration(s: Schedule, link: LinkRef, mode: str = ACTUAL) -> Moved:
    """Acceleration of a link's origin and angular acceleration of the link."""
    return _moved(s, link, mode, acceleration, "a", "al")


def _moved(
    s: Schedule, link: LinkRef, mode: str, rule: Callable[..., Value | None], *fields: str
) -> Moved:
    motion = None if link == s.structure.frame_link else s.ask(rule, link.block, mode)
    if motion is None:
        return Moved(ZERO, NOUGHT)
    of_link = _field(s, link, motion)
    return Moved(*(getattr(of_link, x) for x in fields))


def marker_velocity(s: Schedule, marker: MarkerRef, mode: str = ACTUAL) -> Value:
    """Velocity of a marker."""
    return velocity_at(s, marker.on, mode, marker_arm, marker, _name(marker))


def velocity_at(
    s: Schedule, link: LinkRef, mode: str, arm_rule: Callable[..., Value], of: Any, name: str
) -> Value:
    """Velocity of a place on a link, whose arm a rule says: v + i om arm."""
    v, om = s.ask(link_velocity, link, mode)
    return v if v.zero else s.line(v + imul(s.ask(arm_rule, of), om), f"{name}_v{_suffix(mode)}")


def marker_acceleration(s: Schedule, marker: MarkerRef, mode: str = ACTUAL) -> Value:
    """Acceleration of a marker."""
    return acceleration_at(s, marker.on, mode, marker_arm, marker, _name(marker))


def acceleration_at(
    s: Schedule, link: LinkRef, mode: str, arm_rule: Callable[..., Value], of: Any, name: str
) -> Value:
    """Acceleration of a place on a link, whose arm a rule says: a + (i al - om^2) arm."""
    a, al = s.ask(link_acceleration, link, mode)
    arm = ZERO if a.zero else s.ask(arm_rule, of)
    if arm.zero:
        return a
    om = s.ask(link_velocity, link, mode).scalar
    return s.line(a + imul(arm, al) - mul(arm, om * om), f"{name}_a{_suffix(mode)}")


def _name(marker: MarkerRef) -> str:
    return f"{marker.block}_{marker.name}"


def _suffix(mode: str) -> str:
    return f"_{mode}" if mode else ""


# -- relative motion in a pair -------------------------------------------------


def slip(s: Schedule, ref: JointRef, mode: str = ACTUAL) -> Value:
    """Relative rate of a pair: [rad/s] for R, sliding rate [m/s] for P; later on earlier.

    1 of a mesh that separates, which neither reverses nor rests.
    """
    if (follows := s.structure.meshes.get(ref)) is not None:
        if s.structure.separates(ref):
            return UNIT
        x = s.ask(argument, follows, rate_of, mode)
        if x.zero or not s.structure.touches(ref):
            return x
        return s.line(s.ask(touch, follows).slip * x, f"{ref}_slip{_suffix(mode)}")
    block, joint = s.structure.blocks[ref.block], s.structure.joint(ref)
    if joint.driven:
        driver = block.driver_name(*ref)
        return signed(s, driver, s.ask(rate_of, driver, mode))
    if joint.kind == "P":
        vel = s.ask(velocity, ref.block, mode)
        return NOUGHT if vel is None else getattr(vel, block.joint_field(ref.name))
    later = s.ask(link_velocity, s.structure.later_link(ref), mode).scalar
    earlier = s.ask(link_velocity, s.structure.earlier_link(ref), mode).scalar
    return s.line(later - earlier, f"{ref}_slip{_suffix(mode)}")


def slip_acceleration(s: Schedule, ref: JointRef) -> Value:
    """Rate of a pair's relative rate: [rad/s2] for R, [m/s2] along the guide for P.

    A slider's is that of a point of the later link less that of the point of the earlier link
    where it is: Coriolis' acceleration is across the guide.
    """
    if (follows := s.structure.meshes.get(ref)) is not None:
        if s.structure.separates(ref):
            return NOUGHT
        xdd = s.ask(argument, follows, acceleration_of, ACTUAL)
        if not s.structure.touches(ref):
            return xdd
        at, xd = s.ask(touch, follows), s.ask(argument, follows, rate_of, ACTUAL)
        return s.line(at.slip * xdd + at.slope * xd * xd, f"{ref}_slip_a")
    later, earlier = s.structure.later_link(ref), s.structure.earlier_link(ref)
    a, al = s.ask(link_acceleration, later)
    a_support, al_support = s.ask(link_acceleration, earlier)
    if s.structure.joint(ref).kind == "R":
        return s.line(al - al_support, f"{ref}_slip_a")
    if earlier != s.structure.frame_link:
        om = s.ask(link_velocity, earlier).scalar
        o, support = s.ask(link_position, later).vector, s.ask(link_position, earlier).vector
        arm = s.line(o - support, f"{ref}_slip_arm")
        a -= a_support + imul(arm, al_support) - mul(arm, om * om)
    return s.line(dot(a, s.ask(guide_direction, ref)), f"{ref}_slip_a")


def touch(s: Schedule, driver: str) -> Value:
    """How the links of a coupling touch."""
    name, kernel = s.structure.followers[driver].coupling, s.structure.touch(driver)
    assert kernel is not None
    return s.emit(kernel, s.ask(meshing, driver), s.ask(numbers, name), name=f"{name}_touch")


def guide_direction(s: Schedule, ref: JointRef) -> Value:
    """Direction u of a prismatic pair, shared by both links."""
    joint = s.structure.joint(ref)
    if joint.outer:
        return s.ask(marker_direction, s.structure.feeds[ref])
    earlier = LinkRef(ref.block, joint.links[0])
    return _ground(
        s,
        earlier,
        lambda st, _: st.blocks[ref.block].guide_line(ref.name, earlier.link)[1],
        ("guide direction", ref),
        str(ref),
    )


# -- branches that follow the motion ------------------------------------------------------


def followed(s: Schedule, block: str, numbers: Value) -> Value:
    """The block's numbers with the branch that follows the motion."""
    branch = s.ask(branch_along, s.structure.followed[block])
    return s.line(numbers.replaced(branch=branch), f"P_{block}_here")


def branch_along(s: Schedule, change: FollowedBranch) -> Value:
    """The branch as a function of the driver; dyads that change together share it."""
    branch = s.parameter(("branch", change.first), lambda *_: change.first, "branch")
    if not change.points:
        return branch
    q = s.input("q", change.driver)
    rotary = s.structure.driver_joint(change.driver).rotary
    coordinate = s.line(values.expi(HALF * q), "half_turned") if rotary else q
    passing = passed if rotary else passed_slide
    scale = s.parameter(("scale", change.scale), lambda *_: change.scale, "scale")
    for point in change.points:
        value = expi(0.5 * point) if rotary else point
        slot = s.parameter(("change point", point), lambda *_, x=value: x, "change_point")
        branch = s.emit(passing, branch, coordinate, slot, scale, name="branch")
    return branch
