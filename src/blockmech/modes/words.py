"""How the file says a pose: the names and frames of its links, and what chooses a mode."""

from __future__ import annotations

import cmath
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from blockmech.blocks.general import GeneralGroup
from blockmech.model.dyad_modes import Mode
from blockmech.model.structure import LinkRef
from blockmech.modes.found import TURN
from blockmech.plane import angle
from blockmech.typing import LinkPosition

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

Pose: TypeAlias = tuple[float, float, float]
CHOSEN = 1e-6  # of the size: the pose that the file chooses is this mode


@dataclass(frozen=True)
class FilePoses:
    """Poses of a mechanism's links as its file says them: x [m], y [m], angle [rad].

    A graph names links by block, a document of links and joints by itself, in frames of
    its own, and the angles of its driven links tell the drivers' coordinates.
    """

    mechanism: Compiled

    def told(
        self, group: str, links: Mapping[str, LinkPosition]
    ) -> dict[str, tuple[float, float, float]]:
        """Links of a group by the file's names and frames."""
        names, structure = self.mechanism.names, self.mechanism.structure
        if names is None:
            return {link: _pose(*place) for link, place in links.items()}
        found = {}
        for said, where in names.links.items():
            if where.link.block == group:
                o, e = links[where.link.link]
                at = structure.block(where.marker.block).place_of(structure.marker(where.marker))
                found[said] = _pose(o + e * at, e * cmath.exp(1j * where.turn))
        return found

    def has(self, group: str, mode: Mode, drivers: Mapping[str, float]) -> bool:
        """Whether a mode is the one that the file chooses."""
        own = self._standing(group, drivers)
        size = self.mechanism.structure.blocks[group].largest_length() or 1.0
        return all(
            abs(at.e - own[link].e) <= CHOSEN and abs(at.o - own[link].o) <= CHOSEN * size
            for link, at in mode.links.items()
        )  # NaN is not

    def put(self, group: str, mode: Mode, drivers: Mapping[str, float]) -> dict[str, Any]:
        """What to write into the file to have a mode: keys of the block, or of the document."""
        structure = self.mechanism.structure
        poses = {link: list(pose) for link, pose in self.told(group, mode.links).items()}
        if self.mechanism.names is not None:  # its poses must be of one and the same place
            every: dict[str, list[float]] = {}
            for block in structure.blocks:
                links = self._standing(block, drivers)
                if all(cmath.isfinite(z) for place in links.values() for z in place):
                    every |= {k: list(pose) for k, pose in self.told(block, links).items()}
            every |= poses
            self._count_turns(every, drivers)
            return {"links": {link: {"pose": pose} for link, pose in every.items()}}
        if not isinstance(structure.blocks[group], GeneralGroup):
            return {} if mode.branch is None else {"branch": mode.branch}
        home = {d: drivers[d] for d in self.mechanism.drivers if d in structure.upstream[group]}
        return {"home": {"drivers": home, "poses": poses}}

    def _standing(self, group: str, drivers: Mapping[str, float]) -> dict[str, LinkPosition]:
        """How the links of a group stand in the file; NaN where they cannot."""
        refs = [LinkRef(group, link) for link in self.mechanism.structure.blocks[group].link_names]
        want = [f"{ref}.{what}" for ref in refs for what in ("p", "angle")]
        rates = dict.fromkeys(drivers, 0.0)
        run = self.mechanism.of_blocks.run(at=dict(drivers), rates=rates, want=want, on_gap="mark")
        return {
            ref.link: LinkPosition(run[f"{ref}.p"][0], cmath.exp(1j * run[f"{ref}.angle"][0]))
            for ref in refs
        }

    def _count_turns(self, poses: dict[str, list[float]], drivers: Mapping[str, float]) -> None:
        """Count driven links round so that the poses tell the drivers' coordinates."""
        structure, names = self.mechanism.structure, self.mechanism.names
        assert names is not None
        called = {where.link: said for said, where in names.links.items()}
        for driver, ref in structure.driven.items():
            later = called.get(structure.later_link(ref))
            earlier = called.get(structure.earlier_link(ref))
            if structure.joint(ref).rotary and later in poses:
                before = poses[earlier][2] if earlier in poses else 0.0
                q = structure.coordinate(driver).of_joint(drivers[driver])
                poses[later][2] += TURN * round((before + q - poses[later][2]) / TURN)


def _pose(o: complex, e: complex) -> Pose:
    return float(o.real), float(o.imag), float(angle(1 + 0j, e))
