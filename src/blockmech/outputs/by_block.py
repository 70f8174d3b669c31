"""Outputs block by block: every name that can be wanted, its unit and its rule.

Names are those of the graph, so the outputs of a mechanism are derived from its
blocks, joints and markers. An output asks rules for the values that it needs and
says how to read them; nothing is computed for outputs that nobody wants.
"""

from __future__ import annotations

import copy
import fnmatch
import re
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from functools import partial
from itertools import chain
from typing import Any, TypeAlias

import numpy as np

from blockmech.blocks.contract import Joint
from blockmech.ground.errors import RequestError, as_names, listed
from blockmech.ground.forms import form_of
from blockmech.ground.memory import uncollected
from blockmech.model.naming import Names
from blockmech.model.scene import Scene
from blockmech.model.structure import JointRef, LinkRef, MarkerRef, Structure
from blockmech.outputs.by_link import outputs_by_link, readings
from blockmech.outputs.by_owner import ByOwner, Part, unknown_output
from blockmech.passes import (
    energy,
    forces,
    forward,
    friction,
    homotopy,
    loads,
    pairs,
    play,
    reduction,
    signals,
)
from blockmech.plan.plan import REPORTS, STAGES, Friction, Output, Plan, Reader, Schedule
from blockmech.plan.recipes import program_of
from blockmech.plan.values import NOUGHT, ONE, UNIT, ZERO, Value, angle, minimum, planar
from blockmech.result.quality import at_most_one
from blockmech.signals.contract import Signal
from blockmech.typing import Complex, Load, Nested, Real

PARTS = {"x": "real", "y": "imag"}
WILD = re.compile(r"[*?[]")


def _identity(x: Nested) -> Any:
    return x


def _component(read: Reader, which: str, *columns: Nested) -> Real:
    return getattr(read(*columns), which)


def _angle(e: Complex) -> Real:
    return np.arctan2(e.imag, e.real)


def _ratio_angle(sine: Real, cosine: Real) -> Real:
    return np.arctan2(sine, cosine)


def _real(
    name: str,
    unit: str,
    rule: Callable[..., Value],
    *key: Hashable,
    by: str = "",
    on: str = "",
    label: str = "",
) -> Output:
    """An output whose only value is the answer of one rule."""
    return Output(name, unit, "real", lambda s: (s.ask(rule, *key),), _identity, by, on, label)


def _vector(
    name: str, unit: str, rule: Callable[..., Value], *key: Hashable, **declaration: str
) -> Output:
    return _real(name, unit, rule, *key, **declaration)._replace(kind="vector")


IN_PROGRAMS: Mapping[Reader, Callable[..., Value]] = {
    _identity: _identity,
    _angle: lambda e: angle(ONE, e),
    _ratio_angle: lambda sine, cosine: angle(ONE, planar(cosine, sine)),
    at_most_one: lambda margin: minimum(UNIT, margin),
}
"""How arrays are read -> how a program does."""


def in_program(output: Output) -> Callable[..., Value] | None:
    """How a program reads an output: (schedule, *values) -> a value; None where it cannot."""
    reader, part = output.read, ""
    if isinstance(reader, partial) and reader.func is _component:
        reader, part = reader.args
    if output.kind != "real" or reader not in IN_PROGRAMS:
        return None

    def reading(s: Schedule, *values: Value) -> Value:
        value = IN_PROGRAMS[reader](*values)
        return s.line(getattr(value, part) if part else value, output.name)

    return reading


# -- block by block ------------------------------------------------


def outputs_of(structure: Structure) -> Iterator[Part[Output]]:
    """Every output of a mechanism, in formation order, by what it belongs to."""
    loose = {name for name, block in structure.blocks.items() if block.clearance}
    for name, block in structure.blocks.items():
        plays = bool(loose) and not loose.isdisjoint(structure.ancestors(name))
        for driver in structure.drivers_of(name):
            yield driver, _driver_outputs, (structure, driver)
        for link in block.link_names:
            yield f"{name}.{link}", _link_outputs, (LinkRef(name, link),)
        for marker in structure.markers(name):
            yield f"{name}.{marker.name}", _marker_outputs, (marker, plays)
        for joint in block.joints.values():
            ref = JointRef(name, joint.name)
            yield f"{name}.{joint.name}", _joint_outputs, (structure, ref, joint)
        if block.closes:
            yield name, _group_outputs, (structure, name)
    for marker in structure.markers(structure.frame):
        yield str(marker), _marker_outputs, (marker, False)
    for name in structure.elements:
        yield name, _element_outputs, (structure, name)
    for driver, follower in structure.followers.items():
        yield follower.coupling, _coupling_outputs, (structure, driver)
    for name, signal in structure.signals.items():
        yield name, _signal_outputs, (name, signal)
    yield "mechanism", _mechanism_outputs, (structure,)


def _signal_outputs(name: str, signal: Signal) -> Iterator[Output]:
    for port in signal.ports:
        label = f"{'output' if port in signal.outputs else 'state'} of the signal block"
        unit = signal.port_unit(port)
        yield _real(f"{name}.{port}", unit, signals.output, name, port, label=label)


def _coupling_outputs(structure: Structure, driver: str) -> Iterator[Output]:
    """What a coupling does to the driven link, and how fast that follows."""
    ref, name = structure.driven[driver], structure.followers[driver].coupling
    joint, leader = structure.joint(ref), structure.followers[driver].leader
    leading = structure.joint(leader).coordinate_unit if leader is not None else "rad"
    unit = f"{joint.coordinate_unit}/{leading}" if joint.coordinate_unit != leading else ""
    by = str(structure.later_link(leader) if leader else structure.followers[driver].centre.on)
    ends = {"by": by, "on": str(structure.later_link(ref))}

    yield _real(f"{name}.slope", unit, lambda s: s.ask(forward.transmission, driver).slope)
    yield _real(f"{name}.effort", joint.effort_unit, forces.effort_in, ref, **ends)
    for mesh in structure.meshes_of(driver):
        if not structure.separates(mesh):
            yield _real(f"{name}.loss", "W", energy.friction_power, mesh)
    if structure.contact(driver) is not None:

        def load(s: Schedule) -> Any:
            acts = s.ask(forces.smooth, ref.block) is not None
            return s.ask(forces.meshing, driver) if acts else Load(ZERO, NOUGHT)

        yield _vector(f"{name}.force", "N", lambda s: load(s).F, **ends)
        yield _real(f"{name}.moment", "N m", lambda s: load(s).M, **ends)
        readings = structure.couplings[name].readings(structure.coupled_pair(name))
        for quantity, read in readings.items():
            rule, unit = forces.coupling_reading, read.unit
            yield _real(f"{name}.{quantity}", unit, rule, driver, read, **ends, label=read.about)


def _element_outputs(structure: Structure, name: str) -> Iterator[Output]:
    """What an element gives at each terminal, and its power."""
    for terminal, declared in structure.elements[name].terminals.items():
        ref = JointRef(name, terminal)
        ends = {"by": name, "on": str(structure.holds[ref].on)}
        output, effort = (_vector, "force") if declared.kind == "point" else (_real, "couple")
        yield output(f"{ref}.{effort}", declared.unit, loads.terminal_term, ref, **ends)
    if structure.elements[name].line is not None:
        yield _real(f"{name}.length", "m", loads.line_length, name)
        yield _real(f"{name}.tension", "N", loads.line_tension, name)
    yield _real(f"{name}.power", "W", energy.element_power, name)


def _driver_outputs(structure: Structure, name: str) -> Iterator[Output]:
    ref, joint = structure.driven[name], structure.driver_joint(name)
    q, effort = joint.coordinate_unit, joint.effort_unit
    inertia = "kg m2" if joint.rotary else "kg"
    ends = {"by": str(structure.earlier_link(ref)), "on": str(structure.later_link(ref))}
    yield _real(f"{name}.q", q, forward.coordinate_of, name)
    yield _real(f"{name}.rate", f"{q}/s", forward.rate_of, name)
    yield _real(f"{name}.acceleration", f"{q}/s2", forward.acceleration_of, name)
    if name in structure.followers:
        return
    yield _real(f"{name}.drive", effort, forces.drive, name, **ends)
    yield _real(f"{name}.drive_by_reduction", effort, reduction.drive_by_reduction, name)

    def effort_and_rate(s: Schedule) -> tuple[Value, Value]:
        return s.ask(forces.drive, name), s.input("qd", name)

    yield Output(f"{name}.power", "W", "real", effort_and_rate, lambda a, b: a * b)
    yield _real(f"{name}.J_red", inertia, reduction.inertia, name, name)
    yield _real(f"{name}.tau_red", effort, reduction.reduced_load, name)
    if len(structure.drivers) == 1:
        yield _real(f"{name}.dJ_red", f"{inertia}/{q}", reduction.inertia_slope, name)


def _link_outputs(link: LinkRef) -> Iterator[Output]:
    def turning(rule: Callable[..., forward.Moved]) -> Callable[[Schedule], Value]:
        return lambda s: s.ask(rule, link).scalar

    angle = _real(f"{link}.angle", "rad", turning(forward.link_position))
    yield angle._replace(read=_angle, circular=True)
    yield _real(f"{link}.omega", "rad/s", turning(forward.link_velocity))
    yield _real(f"{link}.alpha", "rad/s2", turning(forward.link_acceleration))


def _marker_outputs(marker: MarkerRef, plays: bool) -> Iterator[Output]:
    yield _vector(f"{marker}.p", "m", forward.marker_place, marker)
    yield _vector(f"{marker}.v", "m/s", forward.marker_velocity, marker)
    yield _vector(f"{marker}.a", "m/s2", forward.marker_acceleration, marker)
    if plays:
        yield _vector(f"{marker}.play", "m", play.play, marker)
        yield _vector(f"{marker}.play_bound", "m", play.play_bound, marker)


def _joint_outputs(structure: Structure, ref: JointRef, joint: Joint) -> Iterator[Output]:
    by, on = str(structure.earlier_link(ref)), str(structure.later_link(ref))

    def pair(s: Schedule) -> Value:
        reaction = s.ask(forces.reaction, ref)
        return ZERO if reaction is None else reaction

    def across(s: Schedule) -> Value:
        reaction = pair(s)
        return reaction if reaction.zero else pairs.statics(s, ref).force(s, ref, reaction)

    yield _vector(f"{ref}.reaction", "N", across, by=by, on=on)
    if joint.pair.reads == "guide":
        yield _real(f"{ref}.N", "N", lambda s: pair(s).real, by=by, on=on)
        yield _real(f"{ref}.C", "N m", lambda s: pair(s).imag, by=by, on=on)
    if joint.outer:
        yield _vector(f"{ref}.wrench_F", "N", lambda s: s.ask(forces.wrench, ref)[0], by=on, on=by)
        yield _real(f"{ref}.wrench_M", "N m", lambda s: s.ask(forces.wrench, ref)[1], by=on, on=by)
    yield _real(f"{ref}.friction", joint.effort_unit, forces.resisting, ref, by=by, on=on)
    yield _coordinate(structure, ref, by, on)
    yield _real(f"{ref}.slip", f"{joint.coordinate_unit}/s", forward.slip, ref)
    yield _real(f"{ref}.friction_power", "W", energy.friction_power, ref)
    if ref in structure.remembering:
        yield _real(f"{ref}.deflection", joint.coordinate_unit, friction.deflection, ref)
        yield _real(f"{ref}.stored_power", "W", energy.stored_power, ref)


def _coordinate(structure: Structure, ref: JointRef, by: str, on: str) -> Output:
    """Coordinate of a pair: of a driven one the driver's, else from the places of both links."""
    joint, name = structure.joint(ref), f"{ref}.coordinate"
    if joint.driven:
        driver = structure.blocks[ref.block].driver_name(*ref)
        ask = forward.joint_coordinate, driver
        return _real(name, joint.coordinate_unit, *ask, by=by, on=on)
    if not joint.rotary:
        return _real(name, joint.coordinate_unit, pairs.position_along, ref, by=by, on=on)

    def directions(s: Schedule) -> tuple[Value, Value]:
        ends = structure.earlier_link(ref), structure.later_link(ref)
        earlier, later = (s.ask(forward.link_position, link).scalar for link in ends)
        return earlier, later

    return Output(name, "rad", "real", directions, _signed_angle, by, on, circular=True)


def _signed_angle(first: Complex, second: Complex) -> Real:
    """Angle [rad] from one direction to the other, between -pi and pi."""
    cross = first.real * second.imag - first.imag * second.real
    return np.arctan2(cross, first.real * second.real + first.imag * second.imag)


def _group_outputs(structure: Structure, name: str) -> Iterator[Output]:
    yield _real(f"{name}.margin", "", forward.margin, name)._replace(read=at_most_one)
    if structure.blocks[name].kernels.transmission is not None:
        angle = f"{name}.transmission_angle"
        yield Output(angle, "rad", "real", lambda s: energy.transmission(s, name), _ratio_angle)
    joints = [JointRef(name, joint) for joint in structure.blocks[name].joints]
    rubbing = tuple(ref for ref in joints if friction.rubs(structure, ref))
    if friction.knows_existence(structure, name, rubbing):
        yield _real(f"{name}.existence", "", lambda s: s.ask(forces.existence, name) or NOUGHT)
    if len(structure.drivers) != 1 or name in structure.drivers:
        return  # under a driver's name stands its sum over all blocks
    driver = structure.drivers[0]
    head = structure.driver_joint(driver)
    inertia = "kg m2" if head.rotary else "kg"
    label = f"share of this block in {driver}.{{}}; those of all blocks add up to it"
    share = reduction.share_of_inertia, name, driver, driver
    yield _real(f"{name}.J_red", inertia, *share, label=label.format("J_red"))
    load = reduction.share_of_load, name, driver
    yield _real(f"{name}.tau_red", head.effort_unit, *load, label=label.format("tau_red"))


def _mechanism_outputs(structure: Structure) -> Iterator[Output]:
    def of(quantity: str, unit: str, kind: Any, ask: Any, read: Reader) -> Output:
        return Output(f"mechanism.{quantity}", unit, kind, ask, read)

    yield _real("mechanism.kinetic_energy", "J", energy.kinetic)
    yield _real("mechanism.potential_energy", "J", energy.potential)
    yield _real("mechanism.friction_power", "W", energy.total_friction_power)
    yield _real("mechanism.drive_power", "W", energy.drive_power)
    yield _real("mechanism.useful_power", "W", energy.useful_power)
    yield _real("mechanism.shaking_moment", "N m", energy.shaking_moment)
    yield _vector("mechanism.shaking_force", "N", energy.shaking_force)
    useful = [e for e in structure.elements.values() if e.useful]
    drivers = structure.drivers
    if len(useful) == 1 and len(drivers) == 1:
        # Unit of the mechanical advantage: useful load per driving effort.
        effort = structure.driver_joint(structure.drivers[0]).effort_unit
        load = next(iter(useful[0].terminals.values())).unit
        unit = "" if load == effort else f"{load}/({effort})"
        yield of("mechanical_advantage", unit, "real", energy.advantage, energy.read_advantage)
    if useful and drivers:
        yield of("efficiency", "", "number", energy.efficiency, energy.read_efficiency)
    if drivers:
        ask, read = energy.friction_efficiency, energy.read_friction_efficiency
        yield of("friction_efficiency", "", "number", ask, read)
    if len(drivers) > 1:

        def inertias(s: Schedule) -> list[Value]:
            return [s.ask(reduction.inertia, k, m) for k in drivers for m in drivers]

        def efforts(s: Schedule) -> list[Value]:
            return [s.ask(reduction.reduced_load, k) for k in drivers]

        yield of("M", "SI", "matrix", inertias, _identity)
        yield of("Q", "SI", "matrix", efforts, _identity)


# -- by name, and planned ---------------------------------------------------------------


class Catalogue(Mapping[str, Output]):
    """All outputs of a mechanism by name, each made once and on first use.

    by_owner : those of the graph, or how those of a document are read of them
    """

    def __init__(self, structure: Structure, names: Names | None = None) -> None:
        """With ``names`` the outputs are those of a joint-based document, and no others."""
        self.structure = structure
        self.by_owner: ByOwner[Any] = ByOwner(outputs_of(structure))
        self._made: dict[str, Output] = {}  # those that were asked for, and parts of vectors
        self._more: dict[str, Output] = {}
        self._of_document, self._form = None, form_of([names])
        if names is not None:
            self._of_document = outputs_by_link(structure, names, self.by_owner)
            self.by_owner = ByOwner(readings(structure, names, self.by_owner), narrow=True)

    def __getitem__(self, name: str) -> Output:
        """An output by its name; ``.x`` or ``.y`` behind that of a vector is a part of it."""
        output = self._made.get(name) or self._more.get(name)
        if output is None:
            output = self._made[name] = self._output(name)
        return output

    def _output(self, name: str) -> Output:
        if (item := self.by_owner.get(name)) is not None:
            return item if self._of_document is None else self._of_document(item)
        vector, _, end = name.rpartition(".")
        if end not in PARTS or (of := self[vector]).kind != "vector":
            raise KeyError(name)
        return of._replace(name=name, kind="real", read=partial(_component, of.read, PARTS[end]))

    def __iter__(self) -> Iterator[str]:
        return chain(self.by_owner, self._more)

    def __len__(self) -> int:
        return len(self.by_owner) + len(self._more)

    def __repr__(self) -> str:
        return f"<outputs {listed(self, 8)}>"

    def extended(self, extra: Iterable[Output]) -> Catalogue:
        """The catalogue with more outputs behind its own."""
        catalogue = copy.copy(self)
        catalogue._more = {**self._more, **{output.name: output for output in extra}}
        catalogue._form = None  # what they ask is not known
        return catalogue

    def match(self, want: Iterable[str]) -> tuple[str, ...]:
        """Names that the patterns ask for, in their order, those of one in the catalogue's.

        Raises `RequestError` for a pattern that matches nothing, all at once.
        """
        matched: dict[str, None] = {}
        problems = []
        for pattern in as_names("want", want):
            if pattern in self:
                matched[pattern] = None
                continue
            matches = re.compile(fnmatch.translate(pattern)).match
            start, last = WILD.split(pattern, maxsplit=1)[0], pattern.rpartition(".")[2]
            last = "" if WILD.search(last) else last
            names = [
                n for n in chain(self.by_owner.beginning(start, last), self._more) if matches(n)
            ]
            if not names:
                problems.append(unknown_output(pattern, self, self))
            matched.update(dict.fromkeys(names))
        RequestError.raise_for(problems)
        return tuple(matched)

    def plan(
        self,
        scene: Scene,
        want: Iterable[str],
        how: Friction,
        static: bool = False,
        quality: bool = True,
    ) -> Plan:
        """The plan for some outputs: rules are asked in name order, once each."""
        names = self.match(want)
        question = self._form and (names, how, static, quality, self._form)
        make = partial(self._schedule, scene, names, how, static, quality)
        with uncollected():
            program, plan = program_of(self.structure, scene, question, make)
        return plan(program=program)

    def _schedule(
        self, scene: Scene, names: tuple[str, ...], how: Friction, static: bool, quality: bool
    ) -> tuple[Schedule, Iterable[Value], Callable[..., Plan]]:
        """The schedule of a plan, what its program returns, and the plan but for that."""
        schedule = homotopy.schedule(self.structure, scene, how, static)
        values: dict[str, int] = {}  # the same value under two names is returned once

        def indices(answers: Iterable[Value]) -> tuple[int, ...]:
            return tuple([values.setdefault(v.text, len(values)) for v in answers])

        layout = {name: indices(self[name].ask(schedule)) for name in sorted(names)}
        reports: dict[str, dict[Hashable, tuple[int, ...]]] = {kind: {} for kind in REPORTS}
        for kind, where, answers in _quality(schedule) if quality else ():
            reports[kind][where] = indices(answers)
        order = {b: i for i, b in enumerate(self.structure.blocks)}
        entries = sorted(
            schedule.entries, key=lambda e: (STAGES.index(e.stage), order[e.block], e.driver)
        )
        steps = schedule.lines, schedule.calls
        plan = partial(Plan, names, tuple(entries), steps, layout=layout, reports=reports)
        return schedule, map(Value, values), plan


Report: TypeAlias = tuple[str, Hashable, tuple[Value, ...]]
"""A kind, of what, and the values; of a push the coupling with the flag's code."""


def _quality(s: Schedule) -> Iterator[Report]:
    """Margins and friction reports of what the plan computes anyway."""
    for entry in list(s.entries):
        if entry.stage == "position" and s.structure.blocks[entry.block].closes:
            yield "margin", entry.block, (s.ask(forward.margin, entry.block),)
            if s.structure.blocks[entry.block].own_form:
                yield "path", entry.block, (s.ask(forward.position, entry.block).reached,)
        if entry.stage == "force":
            for joint in s.structure.blocks[entry.block].clearance:
                ref = JointRef(entry.block, joint)
                R = s.ask(play.pressing, ref)
                yield "pressing", str(ref), (R.real, R.imag)
        if entry.stage == "force" and not entry.driver:
            yield from _friction_quality(s, entry.block)
            yield from _contact_quality(s, entry.block)


def _contact_quality(s: Schedule, block: str) -> Iterator[Report]:
    """What must push in the couplings by which a block is driven."""
    structure = s.structure
    for driver in structure.drivers_of(block):
        if driver not in structure.followers or structure.contact(driver) is None:
            continue
        name = structure.followers[driver].coupling
        for read in structure.couplings[name].readings(structure.coupled_pair(name)).values():
            if read.flag:
                yield "push", (name, read.flag), (s.ask(forces.coupling_reading, driver, read),)


def _friction_quality(s: Schedule, block: str) -> Iterator[Report]:
    """How the friction of a block was solved, and which of its pairs rest."""
    structure, joints = s.structure, s.ask(friction.friction_joints, block)
    contacts = [(ref, *at) for ref in joints if (at := s.ask(forces.friction_at, ref)) is not None]
    if not contacts:
        return
    solved = s.ask(forces.solution, block) or contacts[0][1]
    numbers = ("iterations", "residual", "contraction", "outcome", "limit")
    yield "friction", block, tuple(getattr(solved, x) for x in numbers)
    if (c := s.ask(forces.existence, block)) is not None:
        yield "existence", block, (c,)
    for ref, by, i in contacts:
        if structure.separates(ref):
            continue
        capacity = s.ask(friction.capacity, ref, by.g[i])
        yield "rest", structure.pair_name(ref), (s.ask(friction.rest, ref), capacity)
