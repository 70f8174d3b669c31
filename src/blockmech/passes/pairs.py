"""Statics of a pair: what it transmits, and what friction in it adds to others.

One planar value a pair: the force R of a revolute one, ``N + i C`` of a prismatic one with
its normal force and its couple about the slider's point S. Both are linear in the loads, and
so are their sums. A kernel gives a guide's couple about the origins of its own links; here it is
moved to S, which the block or the user puts on either link; from the origin of the link that
owns S where that is the block's own, for there S is a fixed way along the guide.

Reactions are affine in the friction couples and forces of a group, so the group needs its
kernel once for the loads and once per unit of friction.

Sources: `blockmech.blocks.contract`, rules 6 and 10; [R10] Eqs. 11-13.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, TypeAlias, cast

from blockmech.couplings.contract import LOSSES, relief, rubbed, so_much
from blockmech.ground import plane
from blockmech.model.structure import JointRef, LinkRef, Structure
from blockmech.passes.forward import (
    ACTUAL,
    arm_of,
    guide_direction,
    link_position,
    marker_place,
    meshing,
    moves,
    numbers,
    parameters,
    point_at,
    position,
    touch,
    transmission,
)
from blockmech.passes.resultants import NOTHING, Resultant, at_arm, moment_of
from blockmech.plan.plan import Formula, Schedule
from blockmech.plan.values import (
    MINUS,
    NOUGHT,
    UNIT,
    ZERO,
    Value,
    cross,
    dot,
    hyp,
    imul,
    mul,
    planar,
    sign,
)
from blockmech.typing import Load

Loads: TypeAlias = dict[str, Resultant]
"""Link of a block -> a load on it."""


class Statics(ABC):
    """What a kind of pair does with forces; the reactions of its joints are rules of it.

    What a pair transmits is one planar value; ``edges`` is whether the load that friction
    is of is the larger component of `measure`, or the length of that vector.
    """

    edges: bool = False

    @abstractmethod
    def transmitted(self, s: Schedule, ref: JointRef, answer: Value) -> Value:
        """What it transmits onto its later link; ``answer`` is what the kernel says of it."""

    @abstractmethod
    def load_along(self, s: Schedule, ref: JointRef, link: LinkRef, t: Value) -> Resultant:
        """A load ``t`` [N m or N] along its coordinate on one of its block's links."""

    @abstractmethod
    def unit_loads(self, s: Schedule, ref: JointRef) -> tuple[Loads, Loads]:
        """Unit friction loads: one set, or two whose responses are subtracted."""

    @abstractmethod
    def measure(self, s: Schedule, ref: JointRef, pair: Value) -> Value:
        """The planar vector whose norm is the load that friction is of."""

    @abstractmethod
    def force(self, s: Schedule, ref: JointRef, pair: Value) -> Value:
        """Force [N] on the later link, without what acts along the coordinate."""

    @abstractmethod
    def back(self, s: Schedule, ref: JointRef, pair: Value, t: Value) -> tuple[Value, Value]:
        """Force and moment on the support, about the wire's forward point."""

    @abstractmethod
    def relieved(self, s: Schedule, ref: JointRef, pair: Value, load: Value) -> Value:
        """What it transmits where a load about the wire's forward point acts on the later link."""


class Revolute(Statics):
    """A force R through the pin, and couples along the coordinate."""

    def transmitted(self, s: Schedule, ref: JointRef, answer: Value) -> Value:
        """The force R."""
        return answer

    def load_along(self, s: Schedule, ref: JointRef, link: LinkRef, t: Value) -> Resultant:
        """A couple."""
        return moment_of(t)

    def unit_loads(self, s: Schedule, ref: JointRef) -> tuple[Loads, Loads]:
        """Couples of unit size on either link, so that pairs of one link share their call."""
        joint, couple = s.structure.joint(ref), moment_of(UNIT)
        return {joint.later: couple}, {} if joint.outer else {joint.links[0]: couple}

    def measure(self, s: Schedule, ref: JointRef, pair: Value) -> Value:
        """The force itself."""
        return pair

    def force(self, s: Schedule, ref: JointRef, pair: Value) -> Value:
        """The force R."""
        return pair

    def back(self, s: Schedule, ref: JointRef, pair: Value, t: Value) -> tuple[Value, Value]:
        """The opposites."""
        moment = s.line(-t, f"{ref}_back_M")
        return s.line(-pair, f"{ref}_back_F"), moment

    def relieved(self, s: Schedule, ref: JointRef, pair: Value, load: Value) -> Value:
        """The force less the load's; its moment takes the place of the driving one."""
        return s.line(pair - load.F, f"{ref}_relieved")


class Prismatic(Statics):
    """A normal force and a couple, N + i C about the slider's point S; forces along the guide."""

    edges = True

    def transmitted(self, s: Schedule, ref: JointRef, answer: Value) -> Value:
        """N + i C, its couple moved from the origins of the block's links to S."""
        owner = _owner(s, ref)
        later = s.structure.later_link(ref)
        couple = answer.C if later == owner or owner.block != ref.block else answer.C_i
        if owner.block != ref.block:
            arm = s.ask(slider_arm, ref, later)
            couple -= answer.N * dot(arm, s.ask(guide_direction, ref))
        elif s.planned(offset := _slider_offset(ref, owner)):
            couple -= answer.N * s.parameter(("along", ref), offset, f"along_{ref}_S")
        return s.line(planar(answer.N, couple), f"{ref}_slide")

    def load_along(self, s: Schedule, ref: JointRef, link: LinkRef, t: Value) -> Resultant:
        """A force along the guide through S."""
        force = s.line(mul(s.ask(guide_direction, ref), t), f"{ref}_T")
        return at_arm(s, force, s.ask(slider_arm, ref, link), f"{ref}_T")

    def unit_loads(self, s: Schedule, ref: JointRef) -> tuple[Loads, Loads]:
        """Opposite forces through S; one call answers both."""
        links = [LinkRef(ref.block, n) for n in s.structure.blocks[ref.block].link_names]
        on = {k.link: friction_on(s, ref, k, UNIT) for k in links if touches(s, ref, k)}
        return on, {}

    def measure(self, s: Schedule, ref: JointRef, pair: Value) -> Value:
        """N and 2 C / L; without a length of the guide N alone."""
        length = s.structure.friction_law(ref).edge_distance
        edges = NOUGHT
        if length is not None:
            slot = s.parameter(
                ("guide", ref),
                lambda st, _: 2 / cast(float, st.friction_law(ref).edge_distance),
                f"two_over_L_{ref}",
            )
            edges = slot * pair.imag
        return s.line(planar(pair.real, edges), f"{ref}_load")

    def force(self, s: Schedule, ref: JointRef, pair: Value) -> Value:
        """N across the guide."""
        return s.line(imul(s.ask(guide_direction, ref), pair.real), f"{ref}_N_vector")

    def back(self, s: Schedule, ref: JointRef, pair: Value, t: Value) -> tuple[Value, Value]:
        """The opposites, moved from S to the marker."""
        u = s.ask(guide_direction, ref)
        f = s.line(imul(u, pair.real) + mul(u, t), f"{ref}_f")
        moment = -pair.imag - _slider_moment(s, ref, f)
        return s.line(-f, f"{ref}_back_F"), s.line(moment, f"{ref}_back_M")

    def relieved(self, s: Schedule, ref: JointRef, pair: Value, load: Value) -> Value:
        """Less the load across the guide and its moment about S; along it no drive acts."""
        across = cross(s.ask(guide_direction, ref), load.F)
        moment = load.M - _slider_moment(s, ref, load.F)
        return s.line(pair - planar(across, moment), f"{ref}_relieved")


def _slider_moment(s: Schedule, ref: JointRef, force: Value) -> Value:
    """Moment of a force at the slider's point about the wire's forward point."""
    point, p = s.ask(slider_point, ref), s.ask(marker_place, s.structure.feeds[ref])
    return NOUGHT if point == p else cross(point - p, force)


class Mesh(Prismatic):
    """A mesh that loses power: what the leader feels without losses, and what it does feel."""

    def transmitted(self, s: Schedule, ref: JointRef, answer: Value) -> Value:
        """Slope times the effort that drives the other side, twice."""
        felt = s.ask(in_argument, s.structure.meshes[ref], answer)
        return s.line(planar(felt, felt), f"{ref}_felt")

    def measure(self, s: Schedule, ref: JointRef, pair: Value) -> Value:
        """The larger one of both."""
        return pair

    def load(self, s: Schedule, driver: str, t: Value) -> Value:
        """Load on the driven link by losses ``t``: what the leader feels is less by it."""
        name = s.structure.followers[driver].coupling
        kernel = LOSSES[s.structure.coupled_pair(name)]
        unit = s.emit(kernel, s.ask(meshing, driver), name=f"{name}_loss")
        return s.emit(Load, mul(unit.F, -t), -t * unit.M, name=f"{name}_lost")

    def by_itself(self, s: Schedule, ref: JointRef) -> Value:
        """What a unit of it adds to what it transmits."""
        return s.line(planar(NOUGHT, MINUS), f"{ref}_by_itself")


class Apart(Mesh):
    """What a contact adds in either sense of the effort, as a force [N] of that much: -t."""

    edges = True

    def transmitted(self, s: Schedule, ref: JointRef, answer: Value) -> Value:
        """The force that the effort stands for, with its sign."""
        unit = s.ask(apart, s.structure.meshes[ref])
        return s.line(planar(hyp(unit.F) * answer, NOUGHT), f"{ref}_of")

    def load(self, s: Schedule, driver: str, t: Value) -> Value:
        """Load on the driven link."""
        unit = s.ask(apart, driver)
        return s.emit(so_much, unit, -t, name=f"{unit}_by")

    def by_itself(self, s: Schedule, ref: JointRef) -> Value:
        """Nothing."""
        return ZERO


class Rub(Mesh):
    """A contact whose links rub on each other: the normal force, by the effort."""

    def transmitted(self, s: Schedule, ref: JointRef, answer: Value) -> Value:
        """The normal force without friction there."""
        at = s.ask(touch, s.structure.meshes[ref])
        return s.line(planar(answer / dot(at.n, at.motion), NOUGHT), f"{ref}_N")

    def load(self, s: Schedule, driver: str, t: Value) -> Value:
        """Load on the driven link."""
        args = s.ask(touch, driver), s.ask(meshing, driver).b.p, t
        return s.emit(rubbed, *args, name=f"{driver}_rubbed")

    def by_itself(self, s: Schedule, ref: JointRef) -> Value:
        """What it takes from the normal force, so that the effort stays."""
        at = s.ask(touch, s.structure.meshes[ref])
        return s.line(planar(-s.emit(relief, at, name=f"{ref}_relief"), NOUGHT), f"{ref}_own")


STATICS: Mapping[str, Statics] = {"R": Revolute(), "P": Prismatic()}
"""The letter of a pair in files -> what it does with forces."""
MESH, APART, RUB = Mesh(), Apart(), Rub()


def statics(s: Schedule, ref: JointRef) -> Statics:
    """What the pair at a joint does with forces."""
    if ref in s.structure.meshes:
        return mesh_statics(s, ref)
    return STATICS[s.structure.joint(ref).kind]


def mesh_statics(s: Schedule, ref: JointRef) -> Mesh:
    """What a mesh does with forces."""
    if s.structure.touches(ref):
        return RUB
    return APART if s.structure.separates(ref) else MESH


def transmitted(s: Schedule, ref: JointRef, reactions: Value, base: Value | None) -> Value:
    """What a pair transmits onto its later link by one set of reactions.

    ``base`` are those to the loads alone, see `contacts.contact`.
    """
    block = s.structure.blocks[ref.block]
    if ref in s.structure.meshes:
        name = s.structure.driven[s.structure.meshes[ref]].name
        return mesh_statics(s, ref).transmitted(
            s, ref, getattr(reactions, block.effort_field(name))
        )
    pair = statics(s, ref).transmitted(s, ref, getattr(reactions, block.joint_field(ref.name)))
    driver = s.structure.contact_at(ref)
    if driver is None:
        return pair
    load = s.ask(contact, driver, getattr(reactions, block.effort_field(ref.name)), base)
    return statics(s, ref).relieved(s, ref, pair, load)


def _slider_offset(ref: JointRef, owner: LinkRef) -> Formula:
    """Way [m] of the slider's point along the guide, from the origin of the link that owns it."""

    def offset(structure: Structure, _: object) -> Any:
        block = structure.blocks[ref.block]
        _, direction = block.guide_line(ref.name, owner.link)
        return plane.dot(block.slider_place(ref.name, owner.link), direction)

    return offset


def slider_arm(s: Schedule, ref: JointRef, link: LinkRef) -> Value:
    """Arm of the slider's point from the origin of one of the block's links."""
    if link == _owner(s, ref):
        return s.ask(_arm_on_owner, ref)
    point, o = s.ask(slider_point, ref), s.ask(link_position, link).vector
    return s.line(point - o, f"{ref}_S_on_{link.link}")


def slider_point(s: Schedule, ref: JointRef) -> Value:
    """Place of the slider's point; that of a slider on the support is the marker's."""
    owner = _owner(s, ref)
    if owner.block != ref.block:
        return s.ask(marker_place, s.structure.feeds[ref])
    return point_at(s, owner, s.ask(_arm_on_owner, ref), f"{ref}_S")


def position_along(s: Schedule, ref: JointRef) -> Value:
    """Position [m] of the later link's point of a slider along the earlier link's guide."""
    u, later = s.ask(guide_direction, ref), s.structure.later_link(ref)

    def on(link: LinkRef) -> Value:
        def at(st: Structure, _: object) -> complex:
            return st.blocks[ref.block].slider_place(ref.name, link.link)

        return point_at(s, link, arm_of(s, link, at, f"{ref}_P_{link.link}"), f"{ref}_P")

    earlier = s.structure.earlier_link(ref)
    outer = s.structure.joint(ref).outer
    start = s.ask(marker_place, s.structure.feeds[ref]) if outer else on(earlier)
    return s.line(dot(on(later) - start, u), f"{ref}_coordinate")


def _arm_on_owner(s: Schedule, ref: JointRef) -> Value:
    owner = _owner(s, ref)
    return arm_of(
        s, owner, lambda st, _: st.blocks[ref.block].slider_place(ref.name, owner.link), f"{ref}_S"
    )


def _owner(s: Schedule, ref: JointRef) -> LinkRef:
    """The link that the slider's point moves with."""
    later = s.structure.blocks[ref.block].slider_owner(ref.name) == "later"
    return s.structure.later_link(ref) if later else s.structure.earlier_link(ref)


# -- what couplings transmit -----------------------------------------------------------
#
# The effort on a coupled pair is what no motor gives there. A contact turns it into a wrench of
# the leading link on the driven one, about the driven pair's marker; the opposite acts on the
# leading link. A black box takes slope times effort from the leading pair, and its housing
# stands on both supports.


def contact(s: Schedule, driver: str, effort: Value, base: Value | None) -> Value:
    """Load on the driven link about the marker of its pair, by an effort along its coordinate.

    ``base`` are the reactions to the loads alone, None without any; the sense of the effort in
    them is that of the contact. Where friction may turn it, the part of either sense is a pair of
    its own, `Apart`, so that what friction adds is linear.
    """
    name, ref = s.structure.followers[driver].coupling, s.structure.driven[driver]
    field = s.structure.blocks[ref.block].effort_field(ref.name)
    sense = UNIT
    if s.structure.couplings[name].sided:
        turned = s.friction.method != "none" and moves(s, ref.block, ACTUAL)
        apart_too = any(map(s.structure.separates, s.structure.meshes_of(driver)))
        is_certain = base is not None and not (turned and apart_too)
        sense = s.line(sign(getattr(base, field)), f"{name}_sense") if is_certain else NOUGHT
    return _contact(s, driver, effort, sense)


def _contact(s: Schedule, driver: str, effort: Value, sense: Value) -> Value:
    name, kernel = s.structure.followers[driver].coupling, s.structure.contact(driver)
    assert kernel is not None
    args: tuple[Value, ...] = s.ask(meshing, driver), effort, sense, s.ask(numbers, name)
    if s.structure.touch(driver) is not None:
        args = s.ask(touch, driver), s.ask(meshing, driver).b.p, effort
    return s.emit(kernel, *args, name=f"{name}_contact")


def apart(s: Schedule, driver: str) -> Value:
    """What a contact adds to a unit of effort, and as much to its opposite."""
    pushed, mean = (s.ask(_contact, driver, UNIT, sense) for sense in (UNIT, NOUGHT))
    return s.emit(Load, pushed.F - mean.F, pushed.M - mean.M, name=f"{driver}_apart")


def in_argument(s: Schedule, driver: str, effort: Value) -> Value:
    """Effort along the argument of a transmission; ``effort`` is on the driven pair."""
    meshes = s.structure.couplings[s.structure.followers[driver].coupling].meshes
    slope = s.ask(transmission, driver).slope
    turned = s.structure.coordinate(driver).sign < 0 and not meshes
    return s.line((-slope if turned else slope) * effort, f"{driver}_felt")


def slope_effort(s: Schedule, driver: str, effort: Value, lost: Value) -> Value:
    """Effort that a black box takes from its leading pair, with losses along the argument."""
    follower = s.structure.followers[driver]
    meshes = s.structure.couplings[follower.coupling].meshes
    felt = s.line(s.ask(in_argument, driver, effort) - lost, f"{driver}_felt_with_losses")
    turned = s.structure.coordinate(follower.terms[0][0]).sign < 0 and not meshes
    return s.line(-felt, f"{driver}_turned") if turned else felt


# -- friction in a pair, as a load -----------------------------------------------------


def friction_on(s: Schedule, ref: JointRef, link: LinkRef, t: Value) -> Resultant:
    """The load of friction ``t`` in a pair on one of its block's links; t is of the later one."""
    later = link.link == s.structure.joint(ref).later
    return statics(s, ref).load_along(s, ref, link, t if later else -t)


def touches(s: Schedule, ref: JointRef, link: LinkRef) -> bool:
    """Whether a pair joins one of its block's links."""
    joint = s.structure.joint(ref)
    return link.link in (joint.later, *joint.links)


# -- what unit friction adds to them --------------------------------------------------


def unit_reactions(s: Schedule, ref: JointRef) -> tuple[Value, Value | None]:
    """Reactions to a unit of friction in a pair: those to its later and earlier link.

    The second is None where one call answers both, or the earlier link is not the group's.
    """
    later, earlier = statics(s, ref).unit_loads(s, ref)
    return _response(s, ref, later), _response(s, ref, earlier) if earlier else None


def _response(s: Schedule, ref: JointRef, on: Loads) -> Value:
    """Reactions of a block to loads on some of its links."""
    b = s.structure.blocks[ref.block]
    loads = (on.get(n, NOTHING) for n in b.link_names)
    sums = [(*(load.forces or (ZERO,)), *(load.moments or (NOUGHT,))) for load in loads]
    units = [s.emit(Load, *terms, name="unit") for terms in sums]
    args = (s.ask(position, ref.block), *units, s.ask(parameters, ref.block))
    return s.emit(b.kernels.reactions, *args, name=f"{ref.block}_response")


def influence(s: Schedule, ref: JointRef, unit: JointRef, base: Value) -> Value:
    """What a unit of friction in one pair adds to what another transmits."""
    if (driver := s.structure.meshes.get(unit)) is not None:
        mesh = mesh_statics(s, unit)
        if ref == unit:
            return mesh.by_itself(s, ref)
        if ref != s.structure.driven[driver] or s.structure.contact(driver) is None:
            return ZERO
        return statics(s, ref).relieved(s, ref, ZERO, mesh.load(s, driver, UNIT))
    later, earlier = s.ask(unit_reactions, unit)
    plus = s.ask(transmitted, ref, later, base)
    if earlier is None:
        return plus
    return s.line(plus - s.ask(transmitted, ref, earlier, base), f"{ref}_by_{unit}")


def effort_influence(s: Schedule, driven: JointRef, unit: JointRef) -> Value:
    """What a unit of friction in one pair adds to the driving effort at another."""
    if unit in s.structure.meshes:
        return NOUGHT  # it acts on the leading side
    effort = s.structure.blocks[driven.block].effort_field(driven.name)
    later, earlier = s.ask(unit_reactions, unit)
    by: Value = getattr(later, effort)
    if earlier is not None:
        by -= getattr(earlier, effort)
    return s.line(by, f"{driven}_effort_by_{unit}")
