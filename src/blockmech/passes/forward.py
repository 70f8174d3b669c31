"""The forward pass: positions, velocities, accelerations along the wires.

A rule here answers with names of program values. Motions are asked in a *mode*:
``ACTUAL`` rates of all drivers, the unit rate of one driver, or ``BIAS``, the
actual rates without driver accelerations. A block that a mode does not move
answers None, and nothing is emitted for it.

Sources: [R10] Fig. 3, [D14] Fig. 2 and section 2 (i).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from blockmech.blocks.contract import BuiltIn
from blockmech.model.structure import FollowedBranch, JointRef, LinkRef, MarkerRef
from blockmech.plan import Entry, Schedule
from blockmech.plane import EPS, cross, expi, imul, mul, sign, sqrt
from blockmech.typing import Complex, Guide, GuideAcceleration, GuideVelocity, Real

ZERO, ONE = "ZERO", "ONE"  # the constant vectors, named by every engine
ACTUAL = ""
BIAS = "bias"


class Moved(NamedTuple):
    """Names of a link's two values at one stage, e.g. velocity and rate."""

    vector: str
    scalar: str


# -- kinematics of a point on a link: what the core does for every marker ----


def turned(e: Complex, at: Complex) -> Complex:
    """Arm [m] of a place on a link: e at."""
    return e * at


def stretched(e: Complex, at: Real) -> Complex:
    """Arm [m] of a place on the link's x axis."""
    return mul(e, at)


def place(o: Complex, arm: Complex) -> Complex:
    """Place [m] of a marker: o + e at."""
    return o + arm


def point_velocity(v: Complex, om: Real, arm: Complex) -> Complex:
    """Velocity [m/s] of a marker: v + i om (e at)."""
    return v + imul(arm, om)


def point_acceleration(a: Complex, al: Real, om: Real, arm: Complex) -> Complex:
    """Acceleration [m/s2] of a marker: a + (i al - om^2)(e at)."""
    return a + imul(arm, al) - mul(arm, om * om)


def guide(p: Complex, u: Complex) -> Guide:
    """Place and direction of a guide."""
    return Guide(p, u)


def guide_velocity(v: Complex, om: Real) -> GuideVelocity:
    """Velocity of a guide."""
    return GuideVelocity(v, om)


def guide_acceleration(a: Complex, al: Real) -> GuideAcceleration:
    """Acceleration of a guide."""
    return GuideAcceleration(a, al)


# -- a driver's coordinate and its joint's -----------------------------------------


def opposite(x: Real) -> Real:
    """The same, counted the other way."""
    return -x


def shifted(q: Real, offset: Real) -> Real:
    """The same, counted from another place."""
    return q + offset


# -- positions -----------------------------------------------------------------


def parameters(s: Schedule, block: str) -> str:
    """The slot of a block's own numbers."""
    return s.parameter(("numbers", block), s.structure.block(block).parameters(), f"P_{block}")


def position(s: Schedule, block: str) -> str:
    """Pose of a block, from the places of its supports."""
    s.ask_first(position, block, s.structure.supports)
    b = s.structure.blocks[block]
    args = [s.ask(joint_position, JointRef(block, j.name)) for j in b.joints.values() if j.outer]
    args += [s.ask(joint_coordinate, driver) for driver in s.structure.drivers_of(block)]
    if b.own_form:
        args.append(s.guess(s, block))
    numbers = s.ask(parameters, block)
    args.append(s.ask(followed, block, numbers) if block in s.structure.followed else numbers)
    return s.kernel(Entry(block, "position"), b.kernels.position, *args, name=f"{block}_pose")


def joint_coordinate(s: Schedule, driver: str) -> str:
    """Coordinate of a driven joint, from its driver's: sign q + offset."""
    q, offset = signed(s, driver, s.input("q", driver)), s.structure.coordinate(driver).offset
    if offset == 0:
        return q
    slot = s.parameter(("offset", driver), offset, f"{driver}_offset")
    return s.emit(shifted, q, slot, name=f"{driver}_joint")


def signed(s: Schedule, driver: str, value: str) -> str:
    """A rate, acceleration or effort of a driven joint from its driver's, or the other way."""
    if s.structure.coordinate(driver).sign > 0 or value == "0.0":
        return value
    return s.emit(opposite, value, name=f"minus_{value}")


def margin(s: Schedule, block: str) -> str:
    """Margin [-] of a block that closes a loop."""
    pose, kernel = s.ask(position, block), s.structure.blocks[block].kernels.margin
    if kernel is None:
        return f"{pose}.margin"
    return s.emit(kernel, pose, s.ask(parameters, block), name=f"{block}_margin")


def joint_position(s: Schedule, ref: JointRef) -> str:
    """What an outer joint reads at the position stage."""
    joint, marker = s.structure.joint(ref), s.structure.feeds[ref]
    p = s.ask(marker_place, marker)
    if joint.reads == "point":
        return p
    u = s.ask(marker_direction, marker)
    return s.emit(guide, p, u, name=f"{marker.block}_{marker.name}_guide")


def link_position(s: Schedule, link: LinkRef) -> Moved:
    """Origin and direction of a link."""
    if link == s.structure.frame_link:
        return Moved(ZERO, ONE)
    pose = s.ask(position, link.block)
    own = f"{pose}.{s.structure.blocks[link.block].link_field(link.link)}"
    return Moved(f"{own}.o", f"{own}.e")


def marker_arm(s: Schedule, marker: MarkerRef) -> str | None:
    """Arm of a marker from its link's origin, in ground axes; None at the origin."""
    declared = s.structure.marker(marker)
    name = f"{marker.block}_{marker.name}"
    if isinstance(declared, BuiltIn):
        if not declared.along:
            return None
        at: str = f"{s.ask(parameters, marker.block)}.{declared.along}"
        return s.emit(stretched, s.ask(link_position, marker.on).scalar, at, name=f"{name}_arm")
    return s.ask(arm_of, marker.on, declared.at.z, name)


def arm_of(s: Schedule, link: LinkRef, at: complex, name: str) -> str | None:
    """Arm of a place given in a link's frame; None at the origin."""
    if at == 0:
        return None
    if link == s.structure.frame_link:
        return s.parameter(("at", link, name), at, f"{name}_arm")
    e = s.ask(link_position, link).scalar
    if at.imag == 0:
        slot = s.parameter(("at", link, name), at.real, f"at_{name}")
        return s.emit(stretched, e, slot, name=f"{name}_arm")
    slot = s.parameter(("at", link, name), at, f"at_{name}")
    return s.emit(turned, e, slot, name=f"{name}_arm")


def marker_place(s: Schedule, marker: MarkerRef) -> str:
    """Place of a marker."""
    arm = s.ask(marker_arm, marker)
    o = s.ask(link_position, marker.on).vector
    if arm is None:
        return o
    if o == ZERO:
        return arm
    return s.emit(place, o, arm, name=f"{marker.block}_{marker.name}_p")


def marker_direction(s: Schedule, marker: MarkerRef) -> str:
    """Unit direction of a marker."""
    declared = s.structure.marker(marker)
    e = s.ask(link_position, marker.on).scalar
    u = 1 + 0j if isinstance(declared, BuiltIn) else declared.direction
    if u == 1:
        return e
    slot = s.parameter(("dir", marker), u, f"dir_{marker.block}_{marker.name}")
    if marker.on == s.structure.frame_link:
        return slot
    return s.emit(turned, e, slot, name=f"{marker.block}_{marker.name}_u")


# -- velocities ----------------------------------------------------------------


def moves(s: Schedule, block: str, mode: str) -> bool:
    """Whether a block moves in a mode."""
    upstream = s.structure.upstream[block]
    return mode in upstream if mode not in (ACTUAL, BIAS) else bool(upstream)


def velocity(s: Schedule, block: str, mode: str = ACTUAL) -> str | None:
    """Velocity of a block in a mode; None where it does not move."""
    if not moves(s, block, mode):
        return None
    if mode == BIAS:
        return s.ask(velocity, block, ACTUAL)
    s.ask_first(velocity, block, s.structure.supports, mode)
    b = s.structure.blocks[block]
    args = [s.ask(position, block)]
    args += [
        s.ask(joint_velocity, JointRef(block, j.name), mode) for j in b.joints.values() if j.outer
    ]
    args += [s.ask(joint_rate, driver, mode) for driver in s.structure.drivers_of(block)]
    args.append(s.ask(parameters, block))
    stage = "unit velocity" if mode else "velocity"
    name = f"{block}_vel{_suffix(mode)}"
    return s.kernel(Entry(block, stage, mode), b.kernels.velocity, *args, name=name)


def joint_rate(s: Schedule, driver: str, mode: str) -> str:
    """Rate of a driven joint in a mode."""
    if mode in (ACTUAL, BIAS):
        return signed(s, driver, s.input("qd", driver))
    return f"{s.structure.coordinate(driver).sign:.1f}" if mode == driver else "0.0"


def joint_velocity(s: Schedule, ref: JointRef, mode: str) -> str:
    """What an outer joint reads at the velocity stage."""
    joint, marker = s.structure.joint(ref), s.structure.feeds[ref]
    v = s.ask(marker_velocity, marker, mode)
    if joint.reads == "point":
        return v
    om = s.ask(link_velocity, marker.on, mode).scalar
    return s.emit(guide_velocity, v, om, name=f"{marker.block}_{marker.name}_guide_v")


def link_velocity(s: Schedule, link: LinkRef, mode: str = ACTUAL) -> Moved:
    """Velocity of a link's origin and rate of the link."""
    vel = None if link == s.structure.frame_link else s.ask(velocity, link.block, mode)
    if vel is None:
        return Moved(ZERO, "0.0")
    own = f"{vel}.{s.structure.blocks[link.block].link_field(link.link)}"
    return Moved(f"{own}.v", f"{own}.om")


def marker_velocity(s: Schedule, marker: MarkerRef, mode: str = ACTUAL) -> str:
    """Velocity of a marker."""
    v, om = s.ask(link_velocity, marker.on, mode)
    if v == ZERO:
        return ZERO
    arm = s.ask(marker_arm, marker)
    if arm is None:
        return v
    name = f"{marker.block}_{marker.name}_v{_suffix(mode)}"
    return s.emit(point_velocity, v, om, arm, name=name)


# -- accelerations --------------------------------------------------------------


def acceleration(s: Schedule, block: str, mode: str = ACTUAL) -> str | None:
    """Acceleration of a block in a mode; unit and bias modes without driver acceleration."""
    if not moves(s, block, mode):
        return None
    s.ask_first(acceleration, block, s.structure.supports, mode)
    b = s.structure.blocks[block]
    vel = s.ask(velocity, block, mode)
    assert vel is not None  # the block moves in this mode
    args = [s.ask(position, block), vel]
    args += [
        s.ask(joint_acceleration, JointRef(block, j.name), mode)
        for j in b.joints.values()
        if j.outer
    ]
    for driver in s.structure.drivers_of(block):
        args.append("0.0" if mode else signed(s, driver, s.input("qdd", driver)))
    args.append(s.ask(parameters, block))
    stage = "unit acceleration" if mode else "acceleration"
    name = f"{block}_acc{_suffix(mode)}"
    return s.kernel(Entry(block, stage, mode), b.kernels.acceleration, *args, name=name)


def joint_acceleration(s: Schedule, ref: JointRef, mode: str) -> str:
    """What an outer joint reads at the acceleration stage."""
    joint, marker = s.structure.joint(ref), s.structure.feeds[ref]
    a = s.ask(marker_acceleration, marker, mode)
    if joint.reads == "point":
        return a
    al = s.ask(link_acceleration, marker.on, mode).scalar
    return s.emit(guide_acceleration, a, al, name=f"{marker.block}_{marker.name}_guide_a")


def link_acceleration(s: Schedule, link: LinkRef, mode: str = ACTUAL) -> Moved:
    """Acceleration of a link's origin and angular acceleration of the link."""
    acc = None if link == s.structure.frame_link else s.ask(acceleration, link.block, mode)
    if acc is None:
        return Moved(ZERO, "0.0")
    own = f"{acc}.{s.structure.blocks[link.block].link_field(link.link)}"
    return Moved(f"{own}.a", f"{own}.al")


def marker_acceleration(s: Schedule, marker: MarkerRef, mode: str = ACTUAL) -> str:
    """Acceleration of a marker."""
    a, al = s.ask(link_acceleration, marker.on, mode)
    if a == ZERO:
        return ZERO
    arm = s.ask(marker_arm, marker)
    if arm is None:
        return a
    om = s.ask(link_velocity, marker.on, mode).scalar
    name = f"{marker.block}_{marker.name}_a{_suffix(mode)}"
    return s.emit(point_acceleration, a, al, om, arm, name=name)


# -- relative motion in a pair -------------------------------------------------


def difference(later: Real, earlier: Real) -> Real:
    """Rate of the later link against the earlier one."""
    return later - earlier


def slip(s: Schedule, ref: JointRef, mode: str = ACTUAL) -> str:
    """Relative rate of a pair: [rad/s] for R, sliding rate [m/s] for P; later on earlier."""
    block, joint = s.structure.blocks[ref.block], s.structure.joint(ref)
    if joint.driven:
        return s.ask(joint_rate, block.driver_name(*ref), mode)
    if joint.kind == "P":
        vel = s.ask(velocity, ref.block, mode)
        return "0.0" if vel is None else f"{vel}.{block.joint_field(ref.name)}"
    later = s.ask(link_velocity, s.structure.later_link(ref), mode).scalar
    earlier = s.ask(link_velocity, s.structure.earlier_link(ref), mode).scalar
    if earlier == "0.0":
        return later
    name = f"{ref.block}_{ref.name}_slip{_suffix(mode)}"
    return s.emit(difference, later, earlier, name=name)


def guide_direction(s: Schedule, ref: JointRef) -> str:
    """Direction u of a prismatic pair, shared by both links."""
    joint = s.structure.joint(ref)
    if joint.outer:
        return s.ask(marker_direction, s.structure.feeds[ref])
    earlier = LinkRef(ref.block, joint.links[0])
    e = s.ask(link_position, earlier).scalar
    u = s.structure.blocks[ref.block].guide_line(ref.name, earlier.link)[1]
    if u == 1:
        return e
    slot = s.parameter(("guide direction", ref), u, f"dir_{ref}")
    return s.emit(turned, e, slot, name=f"{ref}_u")


def _suffix(mode: str) -> str:
    return f"_{mode}" if mode else ""


# -- branches that follow the motion ------------------------------------------------------
#
# The branch of a dyad that follows the motion through change points, as values of a program.
#
# One factor +1 or -1 a change point: the side of it on which the driver is. For a crank
# the side is the sign of sin((q - q_c)/2), which changes at q_c and one turn further on,
# and so on: an odd number of change points a turn gives another mode on every other turn.
#
# At the distance d [rad] from a change point a place has lost eps/d, a rate eps/d^2, an
# acceleration or a reaction eps/d^3 (measured on a rhombus: 3e-13, 3e-9 and 6e-7 at d = 1e-4,
# 1e-4 and 1e-3), and dyads in a row pass on what they have lost. So nearer than eps^(1/4),
# 1.2e-4 rad in double precision, there is no answer: the branch is NaN, and with it the dyad.
#
# Sources: Hunt, Kinematic Geometry of Mechanisms, 1978 (uncertainty configurations).


def side_of(x: Real, scale: Real) -> Real:
    """+1 or -1 by the sign of a distance; NaN where it is too small to tell anything."""
    return sign(x) * sqrt(sign(abs(x) - scale * sqrt(sqrt(EPS))))


def half_turned(q: Real) -> Complex:
    """Unit vector at half the angle of the driver."""
    return expi(0.5 * q)


def passed(branch: Real, half: Complex, point: Complex, scale: Real) -> Real:
    """The branch on this side of a change point; ``point`` is the unit vector at half of it."""
    return branch * side_of(cross(point, half), 0.5 * scale)


def passed_slide(branch: Real, q: Real, point: Real, scale: Real) -> Real:
    """The branch on this side of a change point of a slide; ``scale`` is a length of it [m]."""
    return branch * side_of(q - point, scale)


def with_branch(p: Any, branch: Real) -> Any:
    """The block's numbers with the branch of each sample."""
    return p._replace(branch=branch)


def followed(s: Schedule, block: str, numbers: str) -> str:
    """The block's numbers with the branch that follows the motion."""
    there: FollowedBranch = s.structure.followed[block]
    branch = s.ask(branch_along, there)
    return s.emit(with_branch, numbers, branch, name=f"P_{block}_here")


def branch_along(s: Schedule, there: FollowedBranch) -> str:
    """The branch as a function of the driver; dyads that change together share it."""
    branch = s.parameter(("branch", there.first), there.first, "branch")
    if not there.points:
        return branch
    q = s.input("q", there.driver)
    rotary = s.structure.driver_joint(there.driver).rotary
    along = s.emit(half_turned, q, name="half_turned") if rotary else q
    passing = passed if rotary else passed_slide
    scale = s.parameter(("scale", there.scale), there.scale, "scale")
    for point in there.points:
        place = expi(0.5 * point) if rotary else point
        slot = s.parameter(("change point", point), place, "change_point")
        branch = s.emit(passing, branch, along, slot, scale, name="branch")
    return branch
