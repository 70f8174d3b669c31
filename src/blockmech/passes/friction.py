"""Friction of pairs: which ones have it, and what their laws say at the way they slip.

Sources: [R10] Eqs. 8-10; prismatic pairs by analogy.
"""

from __future__ import annotations

from blockmech.ground.plane import EPS, maximum, sign, where
from blockmech.model.structure import JointRef, LinkRef, Structure
from blockmech.passes.forward import (
    ACTUAL,
    link_velocity,
    marker_velocity,
    moves,
    parameters,
    position,
    slip,
)
from blockmech.passes.resultants import active
from blockmech.passes.signals import STATE
from blockmech.plan import values
from blockmech.plan.plan import Schedule
from blockmech.plan.values import NOUGHT, REST, UNIT, Value, below, hyp
from blockmech.typing import Real

GIVEN = "given"  # method: the friction of every pair is an input of the program


# -- which pairs, and what the program is given ------------------------------------


def friction_joints(s: Schedule, block: str) -> tuple[JointRef, ...]:
    """Joints of a block whose friction is computed."""
    b = s.structure.blocks[block]
    if s.friction.method == "none" or not moves(s, block, ACTUAL) or not s.ask(active, block):
        return ()
    joints = (JointRef(block, n) for n in b.joints if n in b.friction and b.friction[n].acts)
    return (*joints, *(ref for ref in s.structure.meshes if ref.block == block))


def coupled_joints(s: Schedule, block: str) -> tuple[JointRef, ...]:
    """Those of them whose friction loads each other.

    Friction in a driven pair only changes what the drive has to give, unless that is the
    contact with another link, which loads the pair, or a mesh that loses a share of it.
    """
    return tuple(ref for ref in s.ask(friction_joints, block) if rubs(s.structure, ref))


def rubs(structure: Structure, ref: JointRef) -> bool:
    """Whether a pair has friction that loads others: see `coupled_joints`."""
    if ref in structure.meshes:
        return True
    law = structure.blocks[ref.block].friction.get(ref.name)
    if law is None or not law.acts:
        return False
    lossy = any(mesh.block == ref.block for mesh in structure.meshes)
    return lossy or not structure.joint(ref).driven or structure.contact_at(ref) is not None


def input_joints(s: Schedule) -> tuple[JointRef, ...]:
    """Joints whose friction is an input of the program, method "given"."""
    return tuple(ref for block in s.structure.blocks for ref in s.ask(friction_joints, block))


def friction_input(s: Schedule, ref: JointRef) -> Value:
    """Input: the friction of a pair on its later link, couple [N m] or force [N]."""
    return s.unknown(f"friction_{s.ask(input_joints).index(ref)}")


def contacts(structure: Structure, ref: JointRef) -> int:
    """Ways in which a pair is pressed: 0 of a pin, 2 of a guide, 4 of one with a length."""
    if ref in structure.meshes:
        return 2 if structure.separates(ref) or structure.touches(ref) else 4
    if structure.joint(ref).kind == "R":
        return 0
    return 2 if structure.friction_law(ref).edge_distance is None else 4


def knows_existence(structure: Structure, block: str, joints: tuple[JointRef, ...]) -> bool:
    """Whether `blockmech.friction.equations` knows its number with friction in these pairs.

    It does of one pair, and of a dyad but for two guides of which one has a length.
    """
    if len(joints) < 2:
        return len(joints) == 1
    driven = {name for name, joint in structure.blocks[block].joints.items() if joint.driven}
    bodies = len(structure.blocks[block].link_names) - len(driven)
    guides = [n for n in (contacts(structure, ref) for ref in joints) if n]
    plain = len(guides) < 2 or 4 not in guides
    return bodies == 2 and plain and driven.isdisjoint(ref.name for ref in joints)


# -- the law of a pair -----------------------------------------------------------------


def rate(s: Schedule, ref: JointRef) -> Value:
    """Relative rate [rad/s] or [m/s] at which a law is asked: its size, or with its sign."""
    if s.friction.method == GIVEN:
        signed = s.unknown(f"slip_{s.ask(input_joints).index(ref)}")
    else:
        signed = s.ask(slip, ref)
    if s.structure.friction_law(ref).remembers:
        return signed
    return s.line(abs(signed), f"{ref}_slip_rate")


def terms(s: Schedule, ref: JointRef, load: Value | None = None) -> Value:
    """What its law says of a pair that slips: `FrictionTerms`, of a law that reads it at a load.

    The one place at which a law is asked, for runs and for motions.
    """
    law = s.structure.friction_law(ref)
    if law.reads_load and load is None:
        if s.friction.method != GIVEN:
            return s.ask(terms_at_rest, ref)  # to which it tends as the load grows
        load = s.unknown(f"load_{s.ask(input_joints).index(ref)}")
    speed = [s.ask(rate, ref)] if law.reads_speed or law.remembers else []
    speed += [load] if load is not None and law.reads_load else []
    speed += [s.ask(deflection, ref)] if law.remembers else []
    return s.emit(law.kernel(), *speed, s.ask(numbers, ref), name=f"{ref}_law")


def terms_at_rest(s: Schedule, ref: JointRef) -> Value:
    """What its law says of a pair that does not slip: of one with a state at most."""
    law = s.structure.friction_law(ref)
    at_rest = law.kernel_at_rest()
    speed = (NOUGHT,) if at_rest is None and law.reads_speed else ()
    args = *speed, s.ask(numbers, ref)
    return s.emit(at_rest or law.kernel(), *args, name=f"{ref}_law_at_rest")


def terms_standing(s: Schedule, ref: JointRef) -> Value:
    """The same, but of a pair with a state the elastic part: what its deflection carries."""
    law = s.structure.friction_law(ref)
    if not law.remembers:
        return s.ask(terms_at_rest, ref)
    args = NOUGHT, s.ask(deflection, ref), s.ask(numbers, ref)
    return s.emit(law.kernel(), *args, name=f"{ref}_law_elastic")


# -- the state of a law that remembers -----------------------------------------------------


def deflection(s: Schedule, ref: JointRef) -> Value:
    """State of a pair's law [rad] or [m], an input of the program."""
    return s.unknown(f"{STATE}{s.structure.states[ref]}")


def deflection_rates(s: Schedule) -> list[Value]:
    """Those of all pairs, in the order of `Structure.remembering`."""
    return [s.ask(deflection_rate, ref) for ref in s.structure.remembering]


def deflection_rate(s: Schedule, ref: JointRef) -> Value:
    """Its rate; it follows the motion, not the load."""
    args = s.ask(slip, ref), s.ask(deflection, ref), s.ask(numbers, ref)
    return s.emit(s.structure.friction_law(ref).rate_kernel(), *args, name=f"{ref}_bending")


def numbers(s: Schedule, ref: JointRef) -> Value:
    """Slot of a law's numbers."""
    return s.parameter(
        ("law of friction", ref), lambda st, _: st.friction_law(ref).parameters(), f"P_{ref}"
    )


# -- its sense from the slip -----------------------------------------------------------


def largest(*speeds: Real) -> Real:
    """The largest of several speeds."""
    top = speeds[0]
    for speed in speeds[1:]:
        top = maximum(top, speed)
    return top


def resisting(slip_speed: Real, top: Real, size: Real, slip_rate: Real, rest: Real) -> Real:
    """What friction of a size does: -sgn(slip) times it, and 0 at zero relative speed."""
    return where(slip_speed <= rest * top, 0.0 * slip_speed, -sign(slip_rate) * size)


def at_rest(slip_speed: Real, top: Real, rest: Real) -> Real:
    """1 where a pair counts as at rest, else 0; its tangent is the share of the top speed that
    a pair at rest is set to.
    """
    share = slip_speed / maximum(top, EPS)
    return where(slip_speed <= rest * top, 1.0 + share, 0.0 * slip_speed)


def top_speed(s: Schedule, block: str) -> Value:
    """Largest speed of joints and links of a block and its ancestors [m/s]."""
    s.ask_first(top_speed, block, s.structure.supports)
    b = s.structure.blocks[block]
    terms: list[Value] = []
    for support in s.structure.supports(block):
        if support != s.structure.frame and moves(s, support, ACTUAL):
            terms.append(s.ask(top_speed, support))
    for joint in b.joints.values():
        ref = JointRef(block, joint.name)
        if joint.kind == "P":
            terms.append(s.line(abs(s.ask(slip, ref)), f"{ref}_speed"))
        if joint.outer:
            v = s.ask(marker_velocity, s.structure.feeds[ref], ACTUAL)
            if not v.zero:
                terms.append(s.line(hyp(v), f"{ref}_speed"))
    for name in b.link_names:
        om = s.ask(link_velocity, LinkRef(block, name), ACTUAL).scalar
        terms.append(s.line(abs(om) * s.ask(size, block), f"{block}_{name}_speed"))
    return s.emit(largest, *dict.fromkeys(terms), name=f"{block}_top_speed")


def size(s: Schedule, block: str) -> Value:
    """The block's largest length [m]; 1 m where it has none.

    A length that the pose says may vanish for a moment; those of the supports then
    keep a turning pair from counting as at rest.
    """
    b = s.structure.blocks[block]
    if b.kernels.size is None:
        return s.parameter(
            ("size", block), lambda st, _: st.blocks[block].characteristic_length(), f"size_{block}"
        )
    s.ask_first(size, block, s.structure.supports)
    pose, p = s.ask(position, block), s.ask(parameters, block)
    length = s.emit(b.kernels.size, pose, p, name=f"{block}_size")
    supports = [s.ask(size, n) for n in s.structure.supports(block) if n != s.structure.frame]
    return s.emit(largest, length, *supports, name=f"{block}_size") if supports else length


def slip_speed(s: Schedule, ref: JointRef) -> Value:
    """Speed [m/s] that the relative rate of a pair stands for, turning at the block's size."""
    speed = abs(s.ask(slip, ref))
    follows = s.structure.meshes.get(ref)
    leads = follows and s.structure.coupled_pair(s.structure.followers[follows].coupling)[0]
    if s.structure.touches(ref):
        leads = "P"
    if (leads or s.structure.joint(ref).kind) == "R":
        speed *= s.ask(size, ref.block)
    return s.line(speed, f"{ref}_slip_speed")


def against_slip(
    s: Schedule, ref: JointRef, part: str, name: str, load: Value | None = None
) -> Value:
    """A part of what a law says, against the slip; 0 at rest, but of one that says its sign."""
    if s.structure.signed(ref):
        return s.line(-getattr(s.ask(terms, ref), part), name)
    speed, top = s.ask(slip_speed, ref), s.ask(top_speed, ref.block)
    law = s.ask(terms, ref, *at(s, ref, load))
    args = (speed, top, getattr(law, part), s.ask(slip, ref), REST)
    value = s.emit(resisting, *args, name=name)
    if not s.friction.along:
        return value
    return s.line(value * (UNIT - s.ask(sticks, ref)), f"{name}_slipping")


def sticks(s: Schedule, ref: JointRef) -> Value:
    """Input: 1 where a pair sticks, else 0."""
    return s.unknown(f"sticks_{s.ask(input_joints).index(ref)}")


def at(s: Schedule, ref: JointRef, load: Value | None) -> tuple[Value, ...]:
    """The load, of a law that reads it: so that rules are asked once for all others."""
    return (load,) if load is not None and s.structure.friction_law(ref).reads_load else ()


def steepest(s: Schedule, ref: JointRef) -> Value:
    """Largest magnitude of what friction of a pair follows its load by, at any load."""
    if not s.structure.friction_law(ref).reads_load:
        return s.ask(resistance, ref)
    return s.ask(numbers, ref).steepest


def resistance(s: Schedule, ref: JointRef, load: Value | None = None) -> Value:
    """Signed factor of a pair: friction on the later link per newton on the pair.

    Of a law that reads the load, of its tangent at one; without any, of a load without bound.
    """
    return s.ask(against_slip, ref, "factor", f"{ref}_k", *at(s, ref, load))


def drag(s: Schedule, ref: JointRef, load: Value | None = None) -> Value:
    """Friction of a pair on the later link, whatever the load: couple [N m] or force [N].

    Of one that sticks it is all that it takes.
    """
    drags = s.structure.friction_law(ref).drags
    args = ref, "drag", f"{ref}_drag", *at(s, ref, load)
    value = s.ask(against_slip, *args) if drags else NOUGHT
    if not s.friction.along:
        return value
    stuck = values.where(below(NOUGHT, s.ask(sticks, ref)), s.ask(friction_input, ref), NOUGHT)
    return s.line(value + s.line(stuck, f"{ref}_sticks"), f"{ref}_drag_or_held")


def capacity(s: Schedule, ref: JointRef, load: Value) -> Value:
    """Largest friction [N m] or [N] that holds a pair at rest under a load [N]."""
    at_rest = s.ask(terms_at_rest, ref)
    drag = at_rest.drag if s.structure.friction_law(ref).drags else NOUGHT
    return s.line(at_rest.factor * load + drag, f"{ref}_held")


def rest(s: Schedule, ref: JointRef) -> Value:
    """1 where a pair is at zero relative speed; of one whose law has a state, where all are."""
    top = s.ask(top_speed, ref.block)
    if s.structure.friction_law(ref).remembers:
        return s.emit(at_rest, top, NOUGHT, REST, name=f"{ref}_rest")
    value = s.emit(at_rest, s.ask(slip_speed, ref), top, REST, name=f"{ref}_rest")
    if not s.friction.along:
        return value
    return s.line(values.maximum(value, s.ask(sticks, ref)), f"{ref}_rests")
