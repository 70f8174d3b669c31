"""The assembly modes of every group of a mechanism, and how they connect along a driver.

Each group is asked with the earlier groups standing as the file says. What a mode is
called in the file stands with it: a branch, a home, or the poses of links in a document
of links and joints.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from blockmech.blocks.contract import AssurGroup, Moving
from blockmech.blocks.general import GeneralGroup
from blockmech.errors import Problem, RequestError, close_match, listed
from blockmech.model.structure import MarkerRef
from blockmech.modes.arcs import Followed, GroupArc, OnArc, arcs_of_dyad, arcs_of_triad
from blockmech.modes.closing import TriadMode, triad_modes
from blockmech.modes.dyad import DyadMode, dyad_modes
from blockmech.modes.found import GroupMode, GroupModes, Modes
from blockmech.modes.groups import Outline, outline
from blockmech.modes.supports import supports_of
from blockmech.modes.triad import place_of, size_of
from blockmech.plane import angle
from blockmech.samples import make_samples
from blockmech.typing import LinkPosition

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

TURN = 2 * math.pi
CHOSEN = 1e-6  # of the size: the pose that the file chooses is this mode


def modes(
    mechanism: Compiled,
    at: Any = None,
    *,
    driver: str | None = None,
    groups: Iterable[str] | None = None,
    arcs: bool = True,
) -> Modes:
    """All assembly modes of every group, and the arcs of a driver on which they exist.

    Parameters
    ----------
    at : driver coordinates [rad or m] as in `Compiled.run`; by default where the laws of
        motion, or else the scene's ``initial``, begin
    driver : along which arcs are sought, the others held at the first sample; by default
        the only one
    groups : only these; by default all
    arcs : whether arcs are sought: a tenth of a second a triad

    Raises
    ------
    RequestError for unknown names, and where nothing says where the drivers stand
    """
    taken = make_samples(
        mechanism,
        mechanism.scene,
        _begin(mechanism) if at is None else at,
        rates=dict.fromkeys(mechanism.drivers, 0.0),
    )
    rows = {d: taken.coordinate(i).tolist() for i, d in enumerate(mechanism.drivers)}
    samples = tuple({d: row[n] for d, row in rows.items()} for n in range(taken.n))
    moved = _moved(mechanism, driver) if arcs else ""
    lister = _Lister(mechanism, samples, moved)
    found = tuple(lister.group(name) for name in _wanted(mechanism, groups))
    return Modes(
        {d: tuple(row) for d, row in rows.items()},
        {d: mechanism.driver_joint(d).coordinate_unit for d in mechanism.drivers},
        moved,
        found,
    )


@dataclass(frozen=True)
class _Lister:
    """What all groups share: the mechanism, samples, and the driver along which arcs lie."""

    mechanism: Compiled
    samples: tuple[Mapping[str, float], ...]
    driver: str

    def group(self, name: str) -> GroupModes:
        """All modes of a group."""
        block = self.mechanism.structure.blocks[name]
        kind = f"{block.group_class} {block.kind}"
        said = self.mechanism.said(name)
        if not isinstance(block, GeneralGroup):
            return self._dyad(name, said, kind, block)
        triad, note = outline(block), "only the modes of dyads and triads are listed"
        try:
            if triad is not None:
                return self._triad(name, said, kind, triad)
        except RequestError as error:  # of one group; the others are told all the same
            note = "; ".join(p.found for p in error.problems)
        return GroupModes(said, kind, tuple(() for _ in self.samples), (), note)

    def _dyad(self, name: str, said: str, kind: str, block: Moving) -> GroupModes:
        assert isinstance(block, AssurGroup)
        outer = [joint.name for joint in block.joints.values() if joint.outer]
        supports = supports_of(self.mechanism.of_blocks, name, outer)
        followed = Followed(())
        if self._follows(name):
            held = {d: q for d, q in self.samples[0].items() if d != self.driver}
            followed = arcs_of_dyad(self.mechanism.of_blocks, name, self.driver, held)
        samples = []
        for drivers in self.samples:
            found = dyad_modes(block, [*supports(drivers), *self._driven(name, drivers)])
            stands = self._own(name, drivers)
            samples.append(
                tuple(
                    self._dyad_mode(name, n, m, drivers, followed, stands)
                    for n, m in enumerate(found)
                )
            )
        return GroupModes(said, kind, tuple(samples), self._arcs(followed), followed.note)

    def _triad(self, name: str, said: str, kind: str, group: Outline) -> GroupModes:
        supports = supports_of(self.mechanism.of_blocks, name, group.joints)
        followed = Followed(())
        if self._follows(name):
            held = {d: q for d, q in self.samples[0].items() if d != self.driver}
            also = [s[self.driver] for s in self.samples if self._held(s)]
            try:
                followed = arcs_of_triad(
                    self.mechanism.of_blocks, name, group, self.driver, held, also
                )
            except RequestError as error:
                followed = Followed((), note="; ".join(p.found for p in error.problems))
        samples: list[tuple[GroupMode, ...]] = []
        for drivers in self.samples:
            at = supports(drivers)
            if not all(cmath.isfinite(z) for support in at for z in place_of(support)):
                samples.append(())
                continue
            formed = group.at(self._driven(name, drivers))
            triad = formed.triad
            size, stands = size_of(triad, at), self._own(name, drivers)
            samples.append(
                tuple(
                    self._triad_mode(
                        name, m, drivers, followed, formed.places(at, m.o, m.e), size, stands
                    )
                    for m in triad_modes(triad, at)
                )
            )
        return GroupModes(said, kind, tuple(samples), self._arcs(followed), followed.note)

    def _dyad_mode(
        self,
        name: str,
        number: int,
        mode: DyadMode,
        drivers: Mapping[str, float],
        followed: Followed,
        stands: Mapping[str, LinkPosition],
    ) -> GroupMode:
        on = None
        if self._held(drivers) and not mode.double:
            on = followed.of_branch(mode.branch, drivers[self.driver])
        if on is not None and followed.arcs[on.arc].turns:
            on = on._replace(after_turn=number)
        return GroupMode(
            links=self._poses(name, mode.links),
            margin=mode.margin,
            sign=mode.sign,
            double=mode.double,
            chosen=self._is_same(name, mode.links, stands),
            put=self._put(name, mode.links, drivers, mode.branch),
            **self._on_arc(on, followed),
        )

    def _triad_mode(
        self,
        name: str,
        mode: TriadMode,
        drivers: Mapping[str, float],
        followed: Followed,
        links: Mapping[str, LinkPosition],
        size: float,
        stands: Mapping[str, LinkPosition],
    ) -> GroupMode:
        on = None
        if self._held(drivers) and not mode.double:
            on = followed.of_pose(mode, drivers[self.driver], size)
        return GroupMode(
            links=self._poses(name, links),
            margin=mode.margin,
            sign=mode.sign,
            double=mode.double,
            chosen=self._is_same(name, links, stands),
            put=self._put(name, links, drivers, None),
            residual=mode.residual,
            **self._on_arc(on, followed),
        )

    def _on_arc(self, on: OnArc | None, followed: Followed) -> dict[str, Any]:
        """What is told of a mode's arc."""
        if on is None:
            return {}
        arc, reach = followed.arcs[on.arc], None
        if not arc.turns:
            low, high = sorted(e.q + on.shift for e in (arc.start, arc.end))
            reach = (low, high)
        return {"arc": on.arc, "reach": reach, "after_turn": on.after_turn}

    def _driven(self, name: str, drivers: Mapping[str, float]) -> list[float]:
        """Coordinates of the driven joints inside a group."""
        structure = self.mechanism.structure
        own = structure.drivers_of(name)
        return [structure.coordinate(d).of_joint(drivers[d]) for d in own]

    def _poses(
        self, name: str, links: Mapping[str, LinkPosition]
    ) -> dict[str, tuple[float, float, float]]:
        """Poses of links by the names and in the frames of the file."""
        if self.mechanism.names is not None:
            return dict(self._of_document(name, links))
        return {link: _pose(place) for link, place in links.items()}

    def _put(
        self,
        name: str,
        links: Mapping[str, LinkPosition],
        drivers: Mapping[str, float],
        branch: int | None,
    ) -> dict[str, Any]:
        """What to write into the file to have this mode."""
        poses = {link: list(pose) for link, pose in self._poses(name, links).items()}
        if self.mechanism.names is not None:  # its poses must be of one and the same place
            stand = {link: list(pose) for link, pose in self._standing(drivers)} | poses
            self._turn_to(stand, drivers)
            return {"links": {link: {"pose": pose} for link, pose in stand.items()}}
        if not isinstance(self.mechanism.structure.blocks[name], GeneralGroup):
            return {} if branch is None else {"branch": branch}
        moving = self.mechanism.structure.upstream[name]
        home = {d: drivers[d] for d in self.mechanism.drivers if d in moving}
        return {"home": {"drivers": home, "poses": poses}}

    def _of_document(
        self, name: str, links: Mapping[str, LinkPosition]
    ) -> Iterator[tuple[str, tuple[float, float, float]]]:
        """The document's links in a group, with their poses in their own frames."""
        assert self.mechanism.names is not None
        for said, where in self.mechanism.names.links.items():
            if where.link.block == name:
                place = links[where.link.link]
                at = self._at(where.marker)
                turned = place.e * cmath.exp(1j * where.turn)
                yield said, _pose(LinkPosition(place.o + place.e * at, turned))

    def _at(self, ref: MarkerRef) -> complex:
        """Place [m] of a marker on its link."""
        structure = self.mechanism.structure
        return structure.block(ref.block).place_of(structure.marker(ref))

    def _standing(
        self, drivers: Mapping[str, float]
    ) -> Iterator[tuple[str, tuple[float, float, float]]]:
        """The document's links where the file's modes have them, if they close."""
        for name in self.mechanism.structure.blocks:
            links = self._own(name, drivers)
            if all(cmath.isfinite(z) for place in links.values() for z in place):
                yield from self._of_document(name, links)

    def _turn_to(self, poses: dict[str, list[float]], drivers: Mapping[str, float]) -> None:
        """Count driven links round so that the poses tell the drivers' coordinates."""
        structure, names = self.mechanism.structure, self.mechanism.names
        assert names is not None
        called = {where.link: said for said, where in names.links.items()}
        for driver, ref in structure.driven.items():
            later = called.get(structure.later_link(ref))
            earlier = called.get(structure.earlier_link(ref))
            if not structure.joint(ref).rotary or later not in poses:
                continue
            before = poses[earlier][2] if earlier in poses else 0.0
            q = structure.coordinate(driver).of_joint(drivers[driver])
            poses[later][2] += TURN * round((before + q - poses[later][2]) / TURN)

    def _own(self, name: str, drivers: Mapping[str, float]) -> dict[str, LinkPosition]:
        """How the links of a group stand in the file; NaN where they cannot."""
        links = self.mechanism.structure.blocks[name].link_names
        want = [w for link in links for w in (f"{name}.{link}.p", f"{name}.{link}.angle")]
        rates = dict.fromkeys(drivers, 0.0)
        run = self.mechanism.of_blocks.run(at=dict(drivers), rates=rates, want=want, on_gap="mark")
        return {
            link: LinkPosition(
                run[f"{name}.{link}.p"][0], cmath.exp(1j * run[f"{name}.{link}.angle"][0])
            )
            for link in links
        }

    def _is_same(
        self, name: str, one: Mapping[str, LinkPosition], other: Mapping[str, LinkPosition]
    ) -> bool:
        size = self.mechanism.structure.blocks[name].largest_length() or 1.0
        return all(
            abs(place.e - other[link].e) <= CHOSEN and abs(place.o - other[link].o) <= CHOSEN * size
            for link, place in one.items()
        )  # NaN is not

    def _held(self, drivers: Mapping[str, float]) -> bool:
        """Whether a sample is on the line along which arcs are sought."""
        first = self.samples[0]
        return bool(self.driver) and all(
            q == first[d] for d, q in drivers.items() if d != self.driver
        )

    def _follows(self, name: str) -> bool:
        return self.driver in self.mechanism.structure.upstream[name]

    def _arcs(self, followed: Followed) -> tuple[GroupArc, ...]:
        return followed.arcs


def _pose(place: LinkPosition) -> tuple[float, float, float]:
    return float(place.o.real), float(place.o.imag), float(angle(1 + 0j, place.e))


def _begin(mechanism: Compiled) -> dict[str, float]:
    """Where the drivers stand if nothing is said."""
    found, problems = {}, []
    for driver in mechanism.drivers:
        law: Any = mechanism.scene.drive.get(driver)
        initial = mechanism.scene.initial.get(driver)
        if law is not None and law.by_coordinate:
            found[driver] = float(law.start)
        elif initial is not None:
            found[driver] = float(initial.q)
        else:
            problems.append(
                Problem(
                    "bad-request",
                    driver,
                    "nothing says where this driver stands",
                    "",
                    "give its coordinate, or a law of motion by coordinate",
                )
            )
    if problems:
        raise RequestError(problems)
    return found


def _moved(mechanism: Compiled, driver: str | None) -> str:
    """The driver along which arcs are sought: the one named, or the only one; else none."""
    drivers = mechanism.drivers
    if driver is None:
        return drivers[0] if len(drivers) == 1 else ""
    if driver not in drivers:
        valid = f"drivers: {listed(drivers)}" if drivers else ""
        raise RequestError(
            Problem(
                "bad-request",
                driver,
                "there is no such driver",
                valid,
                close_match(driver, drivers),
            )
        )
    return driver


def _wanted(mechanism: Compiled, groups: Iterable[str] | None) -> tuple[str, ...]:
    """Blocks that close, in formation order: all, or the named ones."""
    known = {
        mechanism.said(n): n for n, block in mechanism.structure.blocks.items() if block.closes
    }
    if groups is None:
        return tuple(known.values())
    wanted = set(groups)
    problems = [
        Problem(
            "bad-request",
            name,
            "there is no such group",
            f"groups: {listed(known)}" if known else "",
            close_match(name, known),
        )
        for name in sorted(wanted - set(known))
    ]
    if problems:
        raise RequestError(problems)
    return tuple(block for said, block in known.items() if said in wanted)
