"""Energy, power and what the mechanism does to the frame and to its user.

Sources: [R10] Eq. 1 (efficiency) and Fig. 13 (friction power), [D14] Eq. 8.
"""

from __future__ import annotations

import numpy as np

from blockmech.model.structure import JointRef, LinkRef
from blockmech.passes import forces, forward, friction, loads
from blockmech.passes.forward import ACTUAL
from blockmech.plan.plan import Schedule, Undefined
from blockmech.plan.values import NOUGHT, TWO, ZERO, Value, dot
from blockmech.typing import Array, Real

ROUNDINGS = 8  # of the sum of absolute powers; one at most in whole turns of rough four-bars


def _links(s: Schedule) -> list[LinkRef]:
    return [link for link in s.structure.links if link != s.structure.frame_link]


def kinetic(s: Schedule) -> Value:
    """Kinetic energy [J]."""
    terms = []
    for link in _links(s):
        properties = s.structure.properties(link)
        v = s.ask(loads.cm_velocity, link, ACTUAL) if properties.mass else ZERO
        if not v.zero:
            terms.append(s.line(s.ask(loads.mass_of, link) * dot(v, v) / TWO, f"{link}_T"))
        om = s.ask(forward.link_velocity, link, ACTUAL).scalar if properties.inertia else NOUGHT
        if not om.zero:
            terms.append(s.line(s.ask(loads.inertia_of, link) * om * om / TWO, f"{link}_T"))
    return s.sum(terms, "kinetic")


def potential(s: Schedule) -> Value:
    """Potential energy [J] of weights and springs; weights count from the frame's origin."""
    terms = []
    for link in _links(s):
        if s.structure.properties(link).mass and s.scene.gravity.z != 0:
            p = forward.point_at(s, link, s.ask(loads.cm_arm, link), f"{link}_cm_p")
            m = s.ask(loads.mass_of, link)
            terms.append(s.line(-m * dot(loads.gravity(s), p), f"{link}_V"))
    for name, element in s.structure.elements.items():
        stored = element.energy()
        if stored is not None:
            terms.append(loads.kernel_on(s, name, stored, value=f"{name}_V"))
    return s.sum(terms, "potential")


def friction_power(s: Schedule, ref: JointRef) -> Value:
    """Power [W] that friction of a pair takes: heat, but for what a law with a state stores."""
    if s.structure.separates(ref):
        return NOUGHT
    t = s.ask(forces.resisting, ref)
    return t if t.zero else s.line(-t * s.ask(forward.slip, ref), f"{ref}_loss")


def stored_power(s: Schedule, ref: JointRef) -> Value:
    """Power [W] of it that goes into the deflection of a pair whose law has a state.

    It may come back; what is left of the power of friction is heat.
    """
    solution = s.ask(forces.friction_at, ref)
    if solution is None:
        return NOUGHT
    elastic, rate = s.ask(friction.terms_standing, ref), s.ask(friction.deflection_rate, ref)
    effort = elastic.factor * solution[0].g[solution[1]] + elastic.drag
    return s.line(effort * rate, f"{ref}_stored")


def total_friction_power(s: Schedule) -> Value:
    """Power [W] that friction of all pairs takes."""
    joints = (ref for b in s.structure.blocks for ref in s.ask(friction.friction_joints, b))
    return s.sum((s.ask(friction_power, ref) for ref in joints), "friction_power")


def drive_power(s: Schedule) -> Value:
    """Power [W] of all drives."""
    terms = (
        s.line(s.ask(forces.drive, driver) * s.input("qd", driver), f"{driver}_P")
        for driver in s.structure.drivers
    )
    return s.sum(terms, "drive_power")


def element_power(s: Schedule, name: str) -> Value:
    """Power [W] that an element gives to the links."""
    terms = []
    for terminal, declared in s.structure.elements[name].terminals.items():
        ref = JointRef(name, terminal)
        marker, load = s.structure.holds[ref], s.ask(loads.terminal_term, ref)
        if declared.kind == "link":
            om = s.ask(forward.link_velocity, marker.on, ACTUAL).scalar
            terms.append(s.line(load * om, f"{ref}_P"))
        else:
            v = s.ask(forward.marker_velocity, marker, ACTUAL)
            terms.append(s.line(dot(load, v), f"{ref}_P"))
    return s.sum(terms, f"{name}_power")


def useful_power(s: Schedule) -> Value:
    """Power [W] that the useful loads take from the mechanism."""
    names = [n for n, e in s.structure.elements.items() if e.useful]
    return s.line(-s.sum([s.ask(element_power, n) for n in names], "useful"), "useful_power")


def shaking_force(s: Schedule) -> Value:
    """Force [N] of the mechanism on the frame."""
    return s.sum(s.ask(forces.frame_load).forces, "shaking_force", ZERO)


def shaking_moment(s: Schedule) -> Value:
    """Moment [N m] of the mechanism on the frame, about the frame's origin."""
    return s.sum(s.ask(forces.frame_load).moments, "shaking_moment")


def transmission(s: Schedule, block: str) -> tuple[Value, Value]:
    """Sine and cosine parts of a group's transmission angle."""
    kernel = s.structure.blocks[block].kernels.transmission
    assert kernel is not None
    pose, p = s.ask(forward.position, block), s.ask(forward.parameters, block)
    both = s.emit(kernel, pose, p, name=f"{block}_transmission")
    return both[0], both[1]


# -- figures of merit ----------------------------------------------------------------


def advantage(s: Schedule) -> tuple[Value, Value]:
    """The only useful load and the driving effort, for the mechanical advantage."""
    name = next(n for n, e in s.structure.elements.items() if e.useful)
    terminal = next(iter(s.structure.elements[name].terminals))
    load = s.ask(loads.terminal_term, JointRef(name, terminal))
    return load, s.ask(forces.drive, s.structure.drivers[0])


def read_advantage(load: Array, drive: Array) -> Real:
    """|useful load| / |driving effort|; infinite where the drive rests."""
    with np.errstate(all="ignore"):
        return np.hypot(load.real, load.imag) / np.abs(drive)


def efficiency(s: Schedule) -> tuple[Value, Value]:
    """Powers for the mechanical efficiency ([R10] Eq. 1)."""
    return s.ask(useful_power), s.ask(drive_power)


def read_efficiency(useful: Array, drive: Array, weights: Array) -> float:
    """Work of the useful loads over the drive's work, between 0 and 1, else `Undefined`.

    It is that of a machine whose drive gives all the work. There is none where the drive is
    idle (a free motion: its work is rounding of the useful loads' work), where the useful
    loads give work, or where they take more than the drive gives, as other loads drive too.
    """
    useful_work, drive_work = np.sum(useful * weights), np.sum(drive * weights)
    rounding = _rounding(useful, drive, weights)
    if not drive_work > rounding:
        return _without_work(drive_work, rounding, weights)
    if useful_work < -rounding:
        return Undefined(f"the useful loads do {-useful_work:.6g} J of work in place of taking it")
    if useful_work > drive_work + rounding:
        excess = f"take {useful_work:.6g} J, more than the drive's {drive_work:.6g} J"
        return Undefined(f"the useful loads {excess}: other loads do work too")
    return float(np.clip(useful_work / drive_work, 0.0, 1.0))


def friction_efficiency(s: Schedule) -> tuple[Value, Value]:
    """Powers for the share of the drive's work that friction leaves."""
    return s.ask(total_friction_power), s.ask(drive_power)


def read_friction_efficiency(friction: Array, drive: Array, weights: Array) -> float:
    """1 - friction work / drive work; `Undefined` without positive drive work.

    Zero where rounding is all that is left: over a whole turn without useful loads, friction
    takes all that the drive gives, and the powers may be much larger than what is left of them.
    """
    lost_work, drive_work = np.sum(friction * weights), np.sum(drive * weights)
    rounding = _rounding(friction, drive, weights)
    if not drive_work > rounding:
        return _without_work(drive_work, rounding, weights)
    has_rest = abs(drive_work - lost_work) > rounding
    return float(1.0 - lost_work / drive_work) if has_rest else 0.0


def _without_work(drive_work: float, rounding: float, weights: Array) -> Undefined:
    """Why there is no efficiency where the drive gives no work but for rounding."""
    if np.isnan(weights).any():
        return Undefined("no time passes between the samples: give times, or rates other than 0")
    if np.isnan(drive_work):
        return Undefined("some samples have no answer")
    braking = f"the drive takes {-drive_work:.6g} J of work from the mechanism"
    return Undefined(braking if drive_work < -rounding else "the drive does no work")


def _rounding(power: Array, drive: Array, weights: Array) -> float:
    """What rounding leaves of a sum of the two powers over the samples."""
    eps = np.finfo(np.result_type(drive, power, np.float32)).eps
    return float(ROUNDINGS * eps * np.sum((np.abs(power) + np.abs(drive)) * np.abs(weights)))
