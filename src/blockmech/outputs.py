"""Outputs: every name that can be wanted, its unit and its rule.

Names are those of the graph, so the outputs of a mechanism are derived from its
blocks, joints and markers. An output asks rules for the values that it needs and
says how to read them; nothing is computed for outputs that nobody wants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from blockmech.blocks.contract import Joint
from blockmech.loads.contract import Element
from blockmech.model.structure import JointRef, LinkRef, MarkerRef, Structure
from blockmech.passes import energy, forces, forward, loads, pairs, reduction
from blockmech.plan import Output, Schedule
from blockmech.quality import at_most_one


def _same(x: Any) -> Any:
    return x


def _angle(e: Any) -> Any:
    return np.arctan2(e.imag, e.real)


def _ratio_angle(sine: Any, cosine: Any) -> Any:
    return np.arctan2(sine, cosine)


def _asked(rule: Callable[..., str], *key: Any) -> Callable[[Schedule], tuple[str]]:
    """The answer of one rule as an output's only value."""
    return lambda s: (s.ask(rule, *key),)


# -- block by block ------------------------------------------------


def outputs_of(structure: Structure) -> Iterator[Output]:
    """Every output of a mechanism, in formation order."""
    for name, block in structure.blocks.items():
        for driver in structure.drivers_of(name):
            yield from _driver_outputs(structure, driver)
        for link in block.link_names:
            yield from _link_outputs(LinkRef(name, link))
        for marker in structure.markers(name):
            yield from _marker_outputs(marker)
        for joint in block.joints.values():
            yield from _joint_outputs(structure, JointRef(name, joint.name), joint)
        if block.closes:
            yield from _group_outputs(structure, name)
    for marker in structure.markers(structure.frame):
        yield from _marker_outputs(marker)
    for name in structure.elements:
        yield from _element_outputs(structure, name)
    yield from _mechanism_outputs(structure)


def _element_outputs(structure: Structure, name: str) -> Iterator[Output]:
    """What an element gives at each terminal, and its power."""
    for terminal, declared in structure.elements[name].terminals.items():
        ref = JointRef(name, terminal)
        at_point = declared.kind == "point"
        yield Output(
            f"{ref}.force" if at_point else f"{ref}.couple",
            declared.unit,
            "vector" if at_point else "real",
            _asked(loads.terminal_term, ref),
            _same,
            by=name,
            on=str(structure.holds[ref].on),
        )
    yield Output(f"{name}.power", "W", "real", _asked(energy.element_power, name), _same)


def _driver_outputs(structure: Structure, name: str) -> Iterator[Output]:
    ref, joint = structure.driven[name], structure.driver_joint(name)
    q, effort = joint.coordinate_unit, joint.effort_unit
    inertia = "kg m2" if joint.rotary else "kg"

    def given(quantity: str) -> Callable[[Schedule], tuple[str]]:
        return lambda s: (s.input(quantity, name),)

    yield Output(f"{name}.q", q, "real", given("q"), _same)
    yield Output(f"{name}.rate", f"{q}/s", "real", given("qd"), _same)
    yield Output(f"{name}.acceleration", f"{q}/s2", "real", given("qdd"), _same)
    yield Output(
        f"{name}.drive",
        effort,
        "real",
        _asked(forces.drive, name),
        _same,
        by=str(structure.earlier_link(ref)),
        on=str(structure.later_link(ref)),
    )
    yield Output(
        f"{name}.drive_by_reduction",
        effort,
        "real",
        _asked(reduction.drive_by_reduction, name),
        _same,
    )
    yield Output(
        f"{name}.power",
        "W",
        "real",
        lambda s: (s.ask(forces.drive, name), s.input("qd", name)),
        lambda a, b: a * b,
    )
    yield Output(f"{name}.J_red", inertia, "real", _asked(reduction.inertia, name, name), _same)
    yield Output(f"{name}.tau_red", effort, "real", _asked(reduction.reduced_load, name), _same)
    if len(structure.drivers) == 1:
        yield Output(
            f"{name}.dJ_red", f"{inertia}/{q}", "real", _asked(reduction.inertia_slope, name), _same
        )


def _link_outputs(link: LinkRef) -> Iterator[Output]:
    rules = (
        ("angle", "rad", forward.link_position, _angle),
        ("omega", "rad/s", forward.link_velocity, _same),
        ("alpha", "rad/s2", forward.link_acceleration, _same),
    )
    for what, unit, rule, read in rules:
        yield Output(f"{link}.{what}", unit, "real", _scalar(rule, link), read)


def _scalar(rule: Any, link: LinkRef) -> Callable[[Schedule], tuple[str]]:
    """What a rule says of a link's turning."""
    return lambda s: (s.ask(rule, link).scalar,)


def _marker_outputs(marker: MarkerRef) -> Iterator[Output]:
    rules = (
        ("p", "m", forward.marker_place),
        ("v", "m/s", forward.marker_velocity),
        ("a", "m/s2", forward.marker_acceleration),
    )
    for what, unit, rule in rules:
        yield Output(f"{marker}.{what}", unit, "vector", _asked(rule, marker), _same)


def _joint_outputs(structure: Structure, ref: JointRef, joint: Joint) -> Iterator[Output]:
    by, on = str(structure.earlier_link(ref)), str(structure.later_link(ref))
    revolute = joint.kind == "R"

    def pair(s: Schedule, what: str) -> str:
        found = s.ask(forces.reaction, ref)
        return "0.0" if found is None else str(getattr(found, what))

    def vector(s: Schedule) -> tuple[str, ...]:
        found = s.ask(forces.reaction, ref)
        if found is None:
            return (forward.ZERO,)
        if revolute:
            return (found.force,)
        u = s.ask(forward.guide_direction, ref)
        return (s.emit(pairs.normal_force, found.N, u, name=f"{ref}_N_vector"),)

    yield Output(f"{ref}.reaction", "N", "vector", vector, _same, by, on)
    if not revolute:
        yield Output(f"{ref}.N", "N", "real", lambda s: (pair(s, "N"),), _same, by, on)
        yield Output(f"{ref}.C", "N m", "real", lambda s: (pair(s, "C"),), _same, by, on)
    if joint.outer:
        back = (on, by)
        yield Output(
            f"{ref}.wrench_F",
            "N",
            "vector",
            lambda s: (s.ask(forces.wrench, ref)[0],),
            _same,
            *back,
        )
        yield Output(
            f"{ref}.wrench_M",
            "N m",
            "real",
            lambda s: (s.ask(forces.wrench, ref)[1],),
            _same,
            *back,
        )
    yield Output(
        f"{ref}.friction",
        "N m" if revolute else "N",
        "real",
        _asked(forces.resisting, ref),
        _same,
        by,
        on,
    )
    yield Output(
        f"{ref}.slip",
        "rad/s" if revolute else "m/s",
        "real",
        _asked(forward.slip, ref),
        _same,
    )
    yield Output(
        f"{ref}.friction_power",
        "W",
        "real",
        _asked(energy.friction_power, ref),
        _same,
    )


def _group_outputs(structure: Structure, name: str) -> Iterator[Output]:
    block = structure.blocks[name]
    yield Output(
        f"{name}.margin",
        "",
        "real",
        _asked(forward.margin, name),
        at_most_one,
    )
    if block.kernels.transmission is not None:
        yield Output(
            f"{name}.transmission_angle",
            "rad",
            "real",
            lambda s: energy.transmission(s, name),
            _ratio_angle,
        )
    if len(structure.drivers) != 1 or name in structure.drivers:
        return  # under a driver's name stands its sum over all blocks
    driver = structure.drivers[0]
    head = structure.driver_joint(driver)
    yield Output(
        f"{name}.J_red",
        "kg m2" if head.rotary else "kg",
        "real",
        _asked(reduction.share_of_inertia, name, driver, driver),
        _same,
    )
    yield Output(
        f"{name}.tau_red",
        head.effort_unit,
        "real",
        _asked(reduction.share_of_load, name, driver),
        _same,
    )


def _mechanism_outputs(structure: Structure) -> Iterator[Output]:

    for what, unit, rule in (
        ("kinetic_energy", "J", energy.kinetic),
        ("potential_energy", "J", energy.potential),
        ("friction_power", "W", energy.total_friction_power),
        ("drive_power", "W", energy.drive_power),
        ("useful_power", "W", energy.useful_power),
        ("shaking_moment", "N m", energy.shaking_moment),
    ):
        yield Output(f"mechanism.{what}", unit, "real", _asked(rule), _same)
    yield Output("mechanism.shaking_force", "N", "vector", _asked(energy.shaking_force), _same)
    useful = [e for e in structure.elements.values() if e.useful]
    if len(useful) == 1 and len(structure.drivers) == 1:
        yield Output(
            "mechanism.mechanical_advantage",
            _advantage_unit(structure, useful[0]),
            "real",
            energy.advantage,
            energy.read_advantage,
        )
    if useful and structure.drivers:
        yield Output(
            "mechanism.efficiency", "", "number", energy.efficiency, energy.read_efficiency
        )
    if structure.drivers:
        yield Output(
            "mechanism.friction_efficiency",
            "",
            "number",
            energy.friction_efficiency,
            energy.read_friction_efficiency,
        )
    drivers = structure.drivers
    if len(drivers) > 1:
        yield Output(
            "mechanism.M",
            "SI",
            "matrix",
            lambda s: [s.ask(reduction.inertia, k, m) for k in drivers for m in drivers],
            _same,
        )
        yield Output(
            "mechanism.Q",
            "SI",
            "matrix",
            lambda s: [s.ask(reduction.reduced_load, k) for k in drivers],
            _same,
        )


def _advantage_unit(structure: Structure, useful: Element) -> str:
    """Unit of the mechanical advantage: useful load per driving effort."""
    effort = structure.driver_joint(structure.drivers[0]).effort_unit
    load = next(iter(useful.terminals.values())).unit
    return "" if load == effort else f"{load}/({effort})"
