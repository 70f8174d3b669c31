"""A mechanism where its drivers stand: as its file has it, and how its file says a pose."""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.modes import Mode
from blockmech.engines.interpreters import NumpyEngine, ScalarEngine
from blockmech.ground.plane import angle
from blockmech.ground.tolerances import BLUR
from blockmech.model.structure import JointRef, LinkRef
from blockmech.modes.report import TURN
from blockmech.modes.triad import Support
from blockmech.passes.forward import joint_position, link_position
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction
from blockmech.typing import Complex, Data, Guide, LinkPosition, Record, Values

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

Pose: TypeAlias = tuple[float, float, float]
"""x [m], y [m] and angle [rad] of a link's frame in ground axes."""


class Places:
    """Where links stand, and what earlier links hold joints by, at drivers' coordinates."""

    def __init__(
        self, mechanism: Compiled, joints: Iterable[JointRef], links: Iterable[LinkRef] = ()
    ) -> None:
        s = schedule(mechanism.structure, mechanism.scene, Friction("none"))
        values = [value for link in links for value in s.ask(link_position, link)]
        values += [s.ask(joint_position, ref) for ref in joints]
        self.program = s.program(values)
        self._drivers = {f"q_{i}": driver for i, driver in enumerate(mechanism.drivers)}

    def _inputs(self, drivers: Record) -> Data:
        return {name: drivers[self._drivers[name]] for name in self.program.inputs}

    def at(self, samples: Iterable[Mapping[str, float]]) -> Iterator[Values]:
        """Origins [m] and directions of the links, and supports; NaN where they are not placed."""
        engine = ScalarEngine(self.program)
        for drivers in samples:
            yield engine.one(list(self._inputs(drivers).values()))

    def along(self, drivers: Record, n: int) -> list[Support]:
        """The same at n places, as arrays (n,)."""
        columns = {name: np.broadcast_to(q, n) for name, q in self._inputs(drivers).items()}
        return [_of_arrays(value) for value in NumpyEngine(self.program).run(columns, n)]


def _of_arrays(value: Complex) -> Support:
    if isinstance(value, Guide):
        return Guide(*map(_of_arrays, value))
    return np.asarray(value.real) + 1j * np.asarray(value.imag)


@dataclass(frozen=True)
class FilePose:
    """A mechanism at one sample.

    A graph names links by block, a document of links and joints by itself, in frames of
    its own, and the angles of its driven links tell the drivers' coordinates.

    drivers : driver -> coordinate [rad or m]
    links : how the links stand in the mode that the file has; NaN where they cannot
    supports : outer joint -> the place [m], or place and direction, by which it is held
    """

    mechanism: Compiled
    drivers: Mapping[str, float]
    links: Mapping[LinkRef, LinkPosition]
    supports: Mapping[JointRef, Support]

    def in_file_frames(self, group: str, links: Mapping[str, LinkPosition]) -> dict[str, Pose]:
        """Links of a group by the file's names and frames."""
        names, structure = self.mechanism.names, self.mechanism.structure
        if names is None:
            return {link: _pose(*position) for link, position in links.items()}
        poses = {}
        for name, where in names.links.items():
            if where.link.block == group:
                o, e = links[where.link.link]
                at = structure.block(where.marker.block).place_of(structure.marker(where.marker))
                poses[name] = _pose(o + e * at, e * cmath.exp(1j * where.turn))
        return poses

    def has(self, group: str, mode: Mode) -> bool:
        """Whether a mode is the one that the file chooses."""
        size = self.mechanism.structure.blocks[group].largest_length() or 1.0
        positions = {link: self.links[LinkRef(group, link)] for link in mode.links}
        return all(
            abs(at.e - positions[link].e) <= BLUR and abs(at.o - positions[link].o) <= BLUR * size
            for link, at in mode.links.items()
        )  # NaN is not

    def put(self, group: str, mode: Mode) -> Data:
        """What to write into the file to have a mode: keys of the block, or of the document."""
        structure = self.mechanism.structure
        if self.mechanism.names is not None:
            return {"links": {link: {"pose": pose} for link, pose in self._poses(group, mode)}}
        if not isinstance(structure.blocks[group], GeneralGroup):
            return {} if mode.branch is None else {"branch": mode.branch}
        poses = {link: list(pose) for link, pose in self.in_file_frames(group, mode.links).items()}
        drivers_above = [d for d in self.mechanism.drivers if d in structure.upstream[group]]
        return {"home": {"drivers": {d: self.drivers[d] for d in drivers_above}, "poses": poses}}

    def _poses(self, group: str, mode: Mode) -> list[tuple[str, list[float]]]:
        """All links of a document at one and the same place, the driven ones counted round."""
        structure, names = self.mechanism.structure, self.mechanism.names
        assert names is not None
        poses: dict[str, list[float]] = {}
        for name, block in structure.blocks.items():
            links = {link: self.links[LinkRef(name, link)] for link in block.link_names}
            links = dict(mode.links) if name == group else links
            if all(cmath.isfinite(z) for position in links.values() for z in position):
                poses |= {
                    link: list(pose) for link, pose in self.in_file_frames(name, links).items()
                }
        called = names.of_links
        for driver, coordinate in self.drivers.items():  # what couplings drive is as it stands
            ref = structure.driven[driver]
            later = called.get(structure.later_link(ref))
            earlier = called.get(structure.earlier_link(ref))
            if structure.joint(ref).rotary and later in poses:
                before = poses[earlier][2] if earlier in poses else 0.0
                q = structure.coordinate(driver).of_joint(coordinate)
                poses[later][2] += TURN * round((before + q - poses[later][2]) / TURN)
        return list(poses.items())


def file_poses(mechanism: Compiled, samples: Iterable[Mapping[str, float]]) -> tuple[FilePose, ...]:
    """A mechanism at some samples: driver -> coordinate [rad or m]."""
    structure, poses = mechanism.structure, []
    links = [link for link in structure.links if link != structure.frame_link]
    joints = [
        JointRef(name, joint.name)
        for name, block in structure.blocks.items()
        for joint in block.joints.values()
        if block.closes and joint.outer
    ]
    samples = tuple(samples)
    for drivers, values in zip(samples, Places(mechanism, joints, links).at(samples), strict=True):
        supports = dict(zip(joints, values[2 * len(links) :], strict=True))
        placed = dict(zip(links, map(LinkPosition, values[::2], values[1::2]), strict=False))
        poses.append(FilePose(mechanism, drivers, placed, supports))
    return tuple(poses)


def _pose(o: complex, e: complex) -> Pose:
    return float(o.real), float(o.imag), float(angle(1 + 0j, e))
