"""Loads of links: weight, elements and inertia, each declared once.

The force pass and the reduction pass both read `applied`; only the force pass
adds `inertial`. A resultant is about the link's own origin.

Sources: [R10] Figs. 5 and 8, [D14] section 3.1.
"""

from __future__ import annotations

from typing import Any

from blockmech.loads.contract import Following, Reads, read_by
from blockmech.model.structure import JointRef, LinkRef, Structure
from blockmech.passes.forward import (
    ACTUAL,
    acceleration_at,
    arm_of,
    coordinate_of,
    link_acceleration,
    link_position,
    link_velocity,
    marker_arm,
    marker_place,
    marker_velocity,
    rate_of,
    velocity_at,
)
from blockmech.passes.resultants import NOTHING, Resultant, at_arm, moment_of
from blockmech.passes.signals import signal
from blockmech.plan.plan import Schedule
from blockmech.plan.values import Value, mul
from blockmech.typing import Kernel

# -- mass ------------------------------------------------------------------------


def mass_of(s: Schedule, link: LinkRef) -> Value:
    """Slot of a link's mass [kg]."""
    return s.parameter(("mass", link), lambda st, _: st.properties(link).mass, f"m_{link}")


def inertia_of(s: Schedule, link: LinkRef) -> Value:
    """Slot of a link's moment of inertia [kg m2] about its centre of mass."""
    return s.parameter(("inertia", link), lambda st, _: st.properties(link).inertia, f"J_{link}")


def gravity(s: Schedule) -> Value:
    """Slot of the acceleration of gravity [m/s2]."""
    return s.parameter(("gravity",), lambda _, scene: scene.gravity.z, "gravity")


def cm_arm(s: Schedule, link: LinkRef) -> Value:
    """Arm of a link's centre of mass from its origin."""
    return arm_of(s, link, lambda st, _: st.properties(link).cm.z, f"{link}_cm")


def cm_velocity(s: Schedule, link: LinkRef, mode: str = ACTUAL) -> Value:
    """Velocity [m/s] of a link's centre of mass."""
    return velocity_at(s, link, mode, cm_arm, link, f"{link}_cm")


def cm_acceleration(s: Schedule, link: LinkRef, mode: str = ACTUAL) -> Value:
    """Acceleration [m/s2] of a link's centre of mass."""
    return acceleration_at(s, link, mode, cm_arm, link, f"{link}_cm")


def weight_on(s: Schedule, link: LinkRef) -> Resultant:
    """Weight of a link; nothing without gravity or mass."""
    if s.scene.gravity.z == 0 or s.structure.properties(link).mass == 0:
        return NOTHING
    force = s.line(mul(gravity(s), s.ask(mass_of, link)), f"{link}_weight")
    return at_arm(s, force, s.ask(cm_arm, link), f"{link}_weight")


def inertial(s: Schedule, link: LinkRef) -> Resultant:
    """D'Alembert terms of a link, -m a and -J al; nothing in a static request."""
    properties = s.structure.properties(link)
    total = NOTHING
    if s.static or not properties.massive:
        return total
    a, al = s.ask(link_acceleration, link, ACTUAL)
    if properties.mass and not a.zero:
        at_cm = s.ask(cm_acceleration, link, ACTUAL)
        force = s.line(mul(at_cm, -s.ask(mass_of, link)), f"{link}_inertia_F")
        total += at_arm(s, force, s.ask(cm_arm, link), f"{link}_inertia")
    if properties.inertia and not al.zero:
        total += moment_of(s.line(-s.ask(inertia_of, link) * al, f"{link}_inertia_M"))
    return total


# -- elements --------------------------------------------------------------------


def element_terms(s: Schedule, name: str) -> Value:
    """The call of an element's kernel: one force or couple per terminal."""
    element = s.structure.elements[name]
    by_law = isinstance(element, Following) and element.law is not None
    law = [s.ask(law_value, name)] if by_law else []
    return kernel_on(s, name, element.kernel(), *law, value=f"{name}_load")


def kernel_on(s: Schedule, name: str, kernel: Kernel, *law: Value, value: str) -> Value:
    """The call of one of an element's kernels on what it reads."""
    args = _readings(s, name, read_by(kernel))
    numbers = s.parameter(
        ("numbers", name), lambda st, _: st.elements[name].parameters(), f"P_{name}"
    )
    return s.emit(kernel, *args, *law, numbers, name=value)


def line_length(s: Schedule, name: str) -> Value:
    """Length [m] of a load along a line."""
    line = s.structure.elements[name].line
    assert line is not None
    return kernel_on(s, name, line[0], value=f"{name}_length")


def line_tension(s: Schedule, name: str) -> Value:
    """Tension [N] of a load along a line."""
    line, force = s.structure.elements[name].line, s.ask(element_terms, name)[0]
    assert line is not None
    return kernel_on(s, name, line[1], force, value=f"{name}_tension")


def law_value(s: Schedule, name: str) -> Value:
    """What an element's law says [N or N m]."""
    element: Any = s.structure.elements[name]
    arguments = [
        _readings(s, name, reads)[0]
        if measure is None
        else kernel_on(s, name, measure, value=f"{name}_argument")
        for measure, reads in element.measures()
    ]
    numbers = s.parameter(("law", name), lambda st, _: _law(st, name).numbers(), f"law_{name}")
    return s.emit(_law(s.structure, name).kernel(), *arguments, numbers, name=f"{name}_law")


def _law(structure: Structure, name: str) -> Any:
    element: Any = structure.elements[name]
    return element.law


def _readings(s: Schedule, name: str, reads: Reads) -> list[Value]:
    """What an element reads, terminal after terminal."""
    return [
        s.ask(terminal_reading, JointRef(name, terminal), quantity)
        for terminal, names in reads.items()
        for quantity in names
    ]


def terminal_reading(s: Schedule, terminal: JointRef, quantity: str) -> Value:
    """What an element reads: p, v, e, om at a terminal, q, qd of its driver, t, a signal."""
    if quantity == "t":
        return s.time()
    if quantity == "signal":
        return s.ask(signal, s.structure.signal_wires[terminal])
    element = s.structure.elements[terminal.block]
    if isinstance(element, Following) and quantity in ("q", "qd"):
        assert element.driver is not None
        return s.ask(coordinate_of if quantity == "q" else rate_of, element.driver)
    marker = s.structure.holds[terminal]
    if quantity == "p":
        return s.ask(marker_place, marker)
    if quantity == "v":
        return s.ask(marker_velocity, marker, ACTUAL)
    return s.ask({"e": link_position, "om": link_velocity}[quantity], marker.on).scalar


def terminal_term(s: Schedule, terminal: JointRef) -> Value:
    """Force or couple of an element at one terminal."""
    index = list(s.structure.elements[terminal.block].terminals).index(terminal.name)
    return s.ask(element_terms, terminal.block)[index]


def elements_on(s: Schedule, link: LinkRef) -> Resultant:
    """Loads of all elements on a link, in name order."""
    total = NOTHING
    for terminal in s.structure.loaded[link]:
        element = s.structure.elements[terminal.block]
        term = s.ask(terminal_term, terminal)
        if element.terminals[terminal.name].kind == "link":
            total += moment_of(term)
        else:
            total += at_arm(s, term, s.ask(marker_arm, s.structure.holds[terminal]), str(terminal))
    return total


def applied(s: Schedule, link: LinkRef) -> Resultant:
    """Weight and elements, which the reduction pass reduces; or a unit load in place of all."""
    if s.unit_load is not None:
        marker = s.unit_load.marker
        if marker.on != link:
            return NOTHING
        return at_arm(s, s.unit_load.force, s.ask(marker_arm, marker), f"{marker}_unit")
    return s.ask(weight_on, link) + s.ask(elements_on, link)
