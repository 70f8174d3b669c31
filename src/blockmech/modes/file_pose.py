"""A mechanism where its drivers stand: as its file has it, and how its file says a pose."""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.modes import Mode
from blockmech.model.structure import JointRef, LinkRef, Structure
from blockmech.modes.report import TURN
from blockmech.modes.triad import Support
from blockmech.plane import angle
from blockmech.typing import Guide, LinkPosition

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.result import Result
    from blockmech.samples import Samples

Pose: TypeAlias = tuple[float, float, float]
"""x [m], y [m] and angle [rad] of a link's frame in ground axes."""

PLACES = {"friction": "none", "tolerance": None, "iterations": None, "static": True}
CHOSEN = 1e-6  # of the size: the pose that the file chooses is this mode


def supports_read(structure: Structure, joints: Iterable[JointRef]) -> Iterator[str]:
    """Outputs that `supports` of some outer joints reads."""
    for ref in joints:
        feed = structure.feeds[ref]
        yield f"{feed}.p"
        if structure.joint(ref).reads == "guide" and feed.on != structure.frame_link:
            yield f"{feed.on}.angle"


def supports(run: Result, joints: Iterable[JointRef]) -> list[Support]:
    """Where earlier links hold some outer joints, at all samples of a run: arrays (n,)."""
    structure = run.mechanism.structure
    places: list[Support] = []
    for ref in joints:
        feed = structure.feeds[ref]
        p, e = run[f"{feed}.p"], getattr(structure.marker(feed), "direction", 1 + 0j)
        if structure.joint(ref).reads == "guide":
            turned = feed.on != structure.frame_link
            e = e * (np.exp(1j * run[f"{feed.on}.angle"]) if turned else np.ones_like(p))
        places.append(Guide(p, e) if structure.joint(ref).reads == "guide" else p)
    return places


@dataclass(frozen=True)
class FilePose:
    """A mechanism at one sample: driver -> coordinate [rad or m].

    A graph names links by block, a document of links and joints by itself, in frames of
    its own, and the angles of its driven links tell the drivers' coordinates.

    ``run`` has the places of all links and supports at samples, of which this is number ``n``.
    """

    mechanism: Compiled
    drivers: Mapping[str, float]
    run: Result
    n: int

    @cached_property
    def links(self) -> Mapping[LinkRef, LinkPosition]:
        """How the links stand in the mode that the file has; NaN where they cannot."""
        run, n, structure = self.run, self.n, self.mechanism.structure
        return {
            ref: LinkPosition(run[f"{ref}.p"][n], cmath.exp(1j * run[f"{ref}.angle"][n]))
            for ref in structure.links
            if ref != structure.frame_link
        }

    def in_file_frames(self, group: str, links: Mapping[str, LinkPosition]) -> dict[str, Pose]:
        """Links of a group by the file's names and frames."""
        names, structure = self.mechanism.names, self.mechanism.structure
        if names is None:
            return {link: _pose(*place) for link, place in links.items()}
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
        own = {link: self.links[LinkRef(group, link)] for link in mode.links}
        return all(
            abs(at.e - own[link].e) <= CHOSEN and abs(at.o - own[link].o) <= CHOSEN * size
            for link, at in mode.links.items()
        )  # NaN is not

    def put(self, group: str, mode: Mode) -> dict[str, Any]:
        """What to write into the file to have a mode: keys of the block, or of the document."""
        structure = self.mechanism.structure
        if self.mechanism.names is not None:
            return {"links": {link: {"pose": pose} for link, pose in self._poses(group, mode)}}
        if not isinstance(structure.blocks[group], GeneralGroup):
            return {} if mode.branch is None else {"branch": mode.branch}
        poses = {link: list(pose) for link, pose in self.in_file_frames(group, mode.links).items()}
        known = [d for d in self.mechanism.drivers if d in structure.upstream[group]]
        return {"home": {"drivers": {d: self.drivers[d] for d in known}, "poses": poses}}

    def _poses(self, group: str, mode: Mode) -> list[tuple[str, list[float]]]:
        """All links of a document at one and the same place, the driven ones counted round."""
        structure, names = self.mechanism.structure, self.mechanism.names
        assert names is not None
        poses: dict[str, list[float]] = {}
        for name, block in structure.blocks.items():
            links = {link: self.links[LinkRef(name, link)] for link in block.link_names}
            links = dict(mode.links) if name == group else links
            if all(cmath.isfinite(z) for place in links.values() for z in place):
                poses |= {
                    link: list(pose) for link, pose in self.in_file_frames(name, links).items()
                }
        called = names.of_links
        for driver, ref in structure.driven.items():
            later = called.get(structure.later_link(ref))
            earlier = called.get(structure.earlier_link(ref))
            if structure.joint(ref).rotary and later in poses:
                before = poses[earlier][2] if earlier in poses else 0.0
                q = structure.coordinate(driver).of_joint(self.drivers[driver])
                poses[later][2] += TURN * round((before + q - poses[later][2]) / TURN)
        return list(poses.items())


def file_poses(mechanism: Compiled, taken: Samples) -> tuple[FilePose, ...]:
    """A mechanism at some samples, where links that cannot stand are NaN."""
    structure = mechanism.structure
    refs = [
        JointRef(name, joint.name)
        for name, block in structure.blocks.items()
        if block.closes
        for joint in block.joints.values()
        if joint.outer
    ]
    moving = [link for link in structure.links if link != structure.frame_link]
    want = [f"{link}.{what}" for link in moving for what in ("p", "angle")]
    run = run_of_places(mechanism, taken, dict.fromkeys((*want, *supports_read(structure, refs))))
    rows = zip(*(taken.coordinate(i).tolist() for i in range(len(mechanism.drivers))), strict=True)
    drivers = (dict(zip(mechanism.drivers, q, strict=True)) for q in rows)
    return tuple(FilePose(mechanism, q, run, n) for n, q in enumerate(drivers))


def run_of_places(mechanism: Compiled, taken: Samples, want: Iterable[str]) -> Result:
    """Places at samples, NaN at gaps."""
    return mechanism.of_blocks.answer(taken, want, PLACES)


def _pose(o: complex, e: complex) -> Pose:
    return float(o.real), float(o.imag), float(angle(1 + 0j, e))
