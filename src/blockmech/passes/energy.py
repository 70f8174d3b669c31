"""Energy, power and what the mechanism does to the frame and to its user.

Sources: [R10] Eq. 1 (efficiency) and Fig. 13 (friction power), [D14] Eq. 8.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.model.structure import JointRef, LinkRef
from blockmech.passes import forces, forward, friction, loads
from blockmech.passes.forward import ACTUAL, ZERO
from blockmech.plan import Schedule
from blockmech.plane import dot
from blockmech.typing import Complex, Real

ROUNDINGS = 8  # of the sum of absolute powers; one at most in whole turns of rough four-bars


def half_square(v: Complex, m: Real) -> Real:
    """m v.v / 2"""
    return m * dot(v, v) / 2


def half_spin(om: Real, J: Real) -> Real:
    """J om^2 / 2"""
    return J * om * om / 2


def fall(p: Complex, g: Complex, m: Real) -> Real:
    """Potential energy of weight: -m g.p, zero at the frame's origin."""
    return -m * dot(g, p)


def lost(t: Real, rate: Real) -> Real:
    """Friction power, positive where energy is lost."""
    return -t * rate


def work_rate(F: Complex, v: Complex) -> Real:
    """F.v"""
    return dot(F, v)


def turn_rate(M: Real, om: Real) -> Real:
    """M om"""
    return M * om


def _links(s: Schedule) -> list[LinkRef]:
    return [link for link in s.structure.links if link != s.structure.frame_link]


def _sum(s: Schedule, terms: list[str], name: str) -> str:
    kept = [t for t in terms if t != "0.0"]
    return s.sum(kept, name) if kept else "0.0"


def kinetic(s: Schedule) -> str:
    """Kinetic energy [J]."""
    terms = []
    for link in _links(s):
        properties = s.structure.properties(link)
        if properties.mass:
            v, m = s.ask(loads.cm_velocity, link, ACTUAL), s.ask(loads.mass_of, link)
            terms.append("0.0" if v == ZERO else s.emit(half_square, v, m, name=f"{link}_T"))
        if properties.inertia:
            om = s.ask(forward.link_velocity, link, ACTUAL).scalar
            J = s.ask(loads.inertia_of, link)
            terms.append("0.0" if om == "0.0" else s.emit(half_spin, om, J, name=f"{link}_T"))
    return _sum(s, terms, "kinetic")


def potential(s: Schedule) -> str:
    """Potential energy [J] of weights and springs; weights count from the frame's origin."""
    terms = []
    for link in _links(s):
        properties = s.structure.properties(link)
        if properties.mass and s.scene.gravity.z != 0:
            g = s.parameter(("gravity",), s.scene.gravity.z, "gravity")
            p, arm = s.ask(forward.link_position, link).vector, s.ask(loads.cm_arm, link)
            if arm is not None:
                p = s.emit(forward.place, p, arm, name=f"{link}_cm_p")
            m = s.ask(loads.mass_of, link)
            terms.append(s.emit(fall, p, g, m, name=f"{link}_V"))
    for name, element in s.structure.elements.items():
        stored = element.energy()
        if stored is None:
            continue
        args = [
            s.ask(loads.terminal_reading, JointRef(name, terminal), what)
            for terminal, reads in element.reads().items()
            for what in reads
            if what in ("p", "e")
        ]
        args.append(s.ask(loads.element_parameters, name))
        terms.append(s.emit(stored, *args, name=f"{name}_V"))
    return _sum(s, terms, "potential")


def friction_power(s: Schedule, ref: JointRef) -> str:
    """Power [W] that friction of a pair turns into heat."""
    t = s.ask(forces.resisting, ref)
    if t == "0.0":
        return "0.0"
    return s.emit(lost, t, s.ask(forward.slip, ref), name=f"{ref}_loss")


def total_friction_power(s: Schedule) -> str:
    """Power [W] lost in all pairs."""
    terms = [
        s.ask(friction_power, ref)
        for block in s.structure.blocks
        for ref in s.ask(friction.friction_joints, block)
    ]
    return _sum(s, terms, "friction_power")


def drive_power(s: Schedule) -> str:
    """Power [W] of all drives."""
    terms = []
    for driver in s.structure.drivers:
        tau = s.ask(forces.drive, driver)
        rate = s.input("qd", driver)
        terms.append("0.0" if tau == "0.0" else s.emit(turn_rate, tau, rate, name=f"{driver}_P"))
    return _sum(s, terms, "drive_power")


def element_power(s: Schedule, name: str) -> str:
    """Power [W] that an element gives to the links."""
    terms = []
    for terminal, declared in s.structure.elements[name].terminals.items():
        ref = JointRef(name, terminal)
        marker = s.structure.holds[ref]
        load = s.ask(loads.terminal_term, ref)
        if declared.kind == "point":
            v = s.ask(forward.marker_velocity, marker, ACTUAL)
            terms.append("0.0" if v == ZERO else s.emit(work_rate, load, v, name=f"{ref}_P"))
        else:
            om = s.ask(forward.link_velocity, marker.on, ACTUAL).scalar
            terms.append("0.0" if om == "0.0" else s.emit(turn_rate, load, om, name=f"{ref}_P"))
    return _sum(s, terms, f"{name}_power")


def weight_power(s: Schedule) -> str:
    """Power [W] of all weights."""
    terms = []
    for link in _links(s):
        force = s.ask(loads.weight_on, link)
        v = s.ask(loads.cm_velocity, link, ACTUAL) if force else ZERO
        if v != ZERO:
            terms.append(s.emit(work_rate, force.forces[0], v, name=f"{link}_weight_P"))
    return _sum(s, terms, "weight_power")


def useful_power(s: Schedule) -> str:
    """Power [W] that the useful loads take from the mechanism."""
    names = [n for n, e in s.structure.elements.items() if e.useful]
    total = _sum(s, [s.ask(element_power, n) for n in names], "useful")
    return total if total == "0.0" else s.emit(forces.negated, total, name="useful_power")


def shaking_force(s: Schedule) -> str:
    """Force [N] of the mechanism on the frame."""
    total = s.ask(forces.frame_load)
    return s.sum(total.forces, "shaking_force") if total.forces else ZERO


def shaking_moment(s: Schedule) -> str:
    """Moment [N m] of the mechanism on the frame, about the frame's origin."""
    total = s.ask(forces.frame_load)
    return s.sum(total.moments, "shaking_moment") if total.moments else "0.0"


def transmission(s: Schedule, block: str) -> tuple[str, str]:
    """Sine and cosine parts of a group's transmission angle."""
    kernel = s.structure.blocks[block].kernels.transmission
    assert kernel is not None
    pose, p = s.ask(forward.position, block), s.ask(forward.parameters, block)
    both = s.emit(kernel, pose, p, name=f"{block}_transmission")
    return f"{both}[0]", f"{both}[1]"


# -- figures of merit ----------------------------------------------------------------


def advantage(s: Schedule) -> tuple[str, str]:
    """The only useful load and the driving effort, for the mechanical advantage."""
    name = next(n for n, e in s.structure.elements.items() if e.useful)
    terminal = next(iter(s.structure.elements[name].terminals))
    load = s.ask(loads.terminal_term, JointRef(name, terminal))
    return load, s.ask(forces.drive, s.structure.drivers[0])


def read_advantage(load: Any, drive: Any) -> Any:
    """|useful load| / |driving effort|; infinite where the drive rests."""
    with np.errstate(all="ignore"):
        return np.hypot(load.real, load.imag) / np.abs(drive)


def efficiency(s: Schedule) -> tuple[str, str]:
    """Powers for the mechanical efficiency ([R10] Eq. 1)."""
    return s.ask(useful_power), s.ask(drive_power)


def read_efficiency(useful: Any, drive: Any, weights: Any) -> float:
    """Work of the useful loads over the drive's work; NaN without positive drive work.

    In a free motion the drive is idle, and its work is rounding of the useful loads' work.
    """
    given = np.sum(drive * weights)
    if given <= _rounding(useful, drive, weights):
        return float("nan")
    return _share(np.sum(useful * weights), given)


def friction_efficiency(s: Schedule) -> tuple[str, str]:
    """Powers for the share of the drive's work that friction leaves."""
    return s.ask(total_friction_power), s.ask(drive_power)


def read_friction_efficiency(friction: Any, drive: Any, weights: Any) -> float:
    """1 - friction work / drive work; NaN without positive drive work.

    Zero where rounding is all that is left: over a whole turn without useful loads, friction
    takes all that the drive gives, and the powers may be much larger than what is left of them.
    """
    taken, given = np.sum(friction * weights), np.sum(drive * weights)
    if given > 0 and abs(given - taken) <= _rounding(friction, drive, weights):
        return 0.0
    return 1.0 - _share(taken, given)


def _rounding(part: Any, whole: Any, weights: Any) -> float:
    """What rounding leaves of a sum of the two powers over the samples."""
    eps = np.finfo(np.result_type(whole, part, np.float32)).eps
    return float(ROUNDINGS * eps * np.sum((np.abs(part) + np.abs(whole)) * np.abs(weights)))


def _share(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else float("nan")
