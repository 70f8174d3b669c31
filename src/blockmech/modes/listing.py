"""The assembly modes of every group of a mechanism, and how they connect along a driver.

Each group is asked with the earlier groups standing as the file says. What a mode is
called in the file stands with it: a branch, a home, or the poses of links in a document
of links and joints.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.analysis.arcs import Known
from blockmech.analysis.limits import Limits, limits_of
from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.modes import Mode, branches, dyad_modes
from blockmech.ground.arguments import declared
from blockmech.ground.errors import Problem, RequestError, among, refused
from blockmech.model.joints.layout import Pose
from blockmech.model.laws_of_motion import OverRange
from blockmech.model.structure import JointRef, LinkRef
from blockmech.modes.circuits import CHECKS, Connections, connect
from blockmech.modes.closing import NEAR, NOTE, searched, triad_modes
from blockmech.modes.file_pose import FilePose, Places, file_poses
from blockmech.modes.groups import Outline, outline
from blockmech.modes.report import (
    DEAD,
    EARLIER,
    RANGE,
    TURN,
    WHOLE,
    Arc,
    ArcEnd,
    GroupMode,
    GroupModes,
    Modes,
)
from blockmech.modes.triad import Support
from blockmech.result.samples import make_samples
from blockmech.typing import Coordinates, LinkPosition, Real, Record

if TYPE_CHECKING:
    from blockmech.compiled import Compiled


class _On(NamedTuple):
    """Where a mode is: number of its arc, what to add to its coordinates [rad or m], the mode
    that it is a turn later."""

    arc: int
    shift: float
    later: int | None


@declared
def modes(
    mechanism: Compiled,
    at: Coordinates | None = None,
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
    driver : the driver whose arcs are searched, with the others held at the first sample; by
        default the only one
    groups : only these; by default all
    arcs : whether arcs are searched, which takes some tenths of a second per triad

    Raises
    ------
    RequestError for unknown names, and drivers without a coordinate

    >>> [mode.sign for mode in mech.modes(at=0.5, arcs=False)["dyad"].samples[0]]
    [1, -1]
    """
    drivers, still = mechanism.drivers, dict.fromkeys(mechanism.drivers, 0.0)
    if at is None:
        starts = {d: mechanism.scene.begin(d) for d in drivers}
        reason = "nothing says where this driver stands"
        remedy = "give its coordinate, or a law of motion by coordinate"
        lost = [
            Problem("bad-request", d, reason, "", remedy) for d, q in starts.items() if q is None
        ]
        if lost:
            raise RequestError(lost)
        at = {d: q for d, q in starts.items() if q is not None}
    positions = make_samples(mechanism._coordinate_units, mechanism.scene, at, rates=still)
    rows = {d: tuple(positions.coordinate(i).tolist()) for i, d in enumerate(drivers)}
    among(drivers, "driver", () if driver is None or not arcs else driver)
    moved = (driver or (drivers[0] if len(drivers) == 1 else "")) if arcs else ""
    blocks = mechanism.structure.blocks.items()
    group_of = {mechanism._block_name(name): name for name, block in blocks if block.closes}
    selected = among(group_of, "group", group_of if groups is None else groups)
    samples = [dict(zip(rows, q, strict=True)) for q in zip(*rows.values(), strict=True)]
    lister = _Lister(mechanism, file_poses(mechanism, samples), moved)
    listing = tuple(lister.group(block) for name, block in group_of.items() if name in selected)
    units = dict(mechanism._coordinate_units)
    return Modes(rows, units, moved, listing, mechanism._driver_prefix)


@dataclass(frozen=True)
class _Lister:
    """What all groups share: the mechanism, samples, and the driver along which arcs lie."""

    mechanism: Compiled
    samples: tuple[FilePose, ...]
    driver: str
    known: Known = field(default_factory=dict)

    def group(self, name: str) -> GroupModes:
        """All modes of a group."""
        block = self.mechanism.structure.blocks[name]
        every: list[Sequence[Mode]] = [()] * len(self.samples)
        arcs: Sequence[Arc] = ()
        on: list[list[_On | None]] | None = None
        note = ""
        try:
            triad = outline(block) if isinstance(block, GeneralGroup) else None
            outer = [joint.name for joint in block.joints.values() if joint.outer]
            every = self._modes(name, triad, triad.joints if triad else outer)
            if isinstance(block, GeneralGroup) and triad is None:
                note = NOTE
            elif self.driver in self.mechanism.structure.upstream[name]:
                arcs, on, note = (
                    self._triad(name, triad, every) if triad else self._dyad(name, block, every)
                )
        except RequestError as error:  # of one group; the others are told all the same
            note = "; ".join(problem.found for problem in error.problems)
        on = on or [[None] * len(modes) for modes in every]
        samples = tuple(
            tuple(_reported(name, stand, *mode, arcs) for mode in zip(modes, at, strict=True))
            for stand, modes, at in zip(self.samples, every, on, strict=True)
        )
        kind = f"{block.group_class} {block.kind}"
        return GroupModes(self.mechanism._block_name(name), kind, samples, tuple(arcs), note)

    def _modes(
        self, name: str, triad: Outline | None, joints: Sequence[str]
    ) -> list[Sequence[Mode]]:
        """The modes of a group at each sample; none where an earlier group does not close."""
        every: list[Sequence[Mode]] = []
        for stand in self.samples:
            supports = {joint: stand.supports[JointRef(name, joint)] for joint in joints}
            closes = all(np.isfinite(support).all() for support in supports.values())
            every.append(self._at(name, triad, supports, stand) if closes else ())
        return every

    def _at(
        self, name: str, triad: Outline | None, supports_of: Mapping[str, Support], stand: FilePose
    ) -> Sequence[Mode]:
        """The modes at one sample: in closed form, of a triad, or those that a search finds."""
        block: Any = self.mechanism.structure.blocks[name]
        driven, supports = self._driven(name, stand.drivers), [*supports_of.values()]
        if triad:
            formed = triad.at(driven)
            return [
                Mode(
                    formed.places(supports, m.o, m.e), m.margin, m.sign, m.double, None, m.residual
                )
                for m in triad_modes(formed.triad, supports)
            ]
        if not isinstance(block, GeneralGroup):
            return dyad_modes(block, [*supports, *driven])
        links = {link: stand.links[LinkRef(name, link)] for link in block.link_names}
        start = {link: Pose(complex(o), cmath.phase(complex(e))) for link, (o, e) in links.items()}
        return searched(block, supports_of, driven, start)

    # -- arcs ------------------------------------------------------------------------------

    def _dyad(
        self, name: str, block: Any, every: Sequence[Sequence[Mode]]
    ) -> tuple[list[Arc], list[list[_On | None]], str]:
        """The arcs of each branch where the dyad closes."""
        around = self._limits([name])
        arcs: list[Arc] = []
        for arc in around.arcs:
            passed = tuple(p.q for p in arc.change_points if p.block == name)
            for branch in branches(block):
                n = len(arcs)
                partner = None if branch is None else n + branch
                start, end = (
                    ArcEnd(e.q, DEAD, partner)
                    if e.block == name
                    else ArcEnd(e.q, str(e) if e.block else e.how)
                    for e in (arc.start, arc.end)
                )
                meets = bool(passed) or DEAD in (start.how, end.how)
                circuit = min(n, partner) if partner is not None and meets else n
                turns = int(around.whole_turn)
                arcs.append(Arc(start, end, branch, branch or 1, turns, passed, circuit))

        def on(stand: FilePose, k: int, mode: Mode) -> _On | None:
            """Where mode k is."""
            q = stand.drivers[self.driver]
            for number, arc in enumerate(arcs if self._held(stand) and not mode.double else ()):
                coordinate = self._near((arc.start.q + arc.end.q) / 2, q)
                inside = bool(arc.turns) or arc.start.q <= coordinate <= arc.end.q
                if arc.branch == mode.branch and inside:
                    return _On(number, q - coordinate, k if arc.turns else None)
            return None

        located = [
            [on(stand, k, mode) for k, mode in enumerate(modes)]
            for stand, modes in zip(self.samples, every, strict=True)
        ]
        return arcs, located, "" if arcs else around.sentence()

    def _triad(
        self, name: str, group: Outline, every: Sequence[Sequence[Mode]]
    ) -> tuple[list[Arc], list[list[_On | None]], str]:
        """All modes connected over the stretches of the driver where earlier groups close."""
        structure, fixed = self.mechanism.structure, self._fixed()
        earlier = [block for block in structure.supports(name) if block != structure.frame]
        around = self._limits(earlier)
        moving = Places(self.mechanism, [JointRef(name, joint) for joint in group.joints])
        arcs: list[Arc] = []
        located: list[list[_On | None]] = [[None] * len(modes) for modes in every]
        stretches = self._stretches(around)
        for low, high, ends in stretches:
            coordinates = {
                n: self._near((low + high) / 2, stand.drivers[self.driver])
                for n, stand in enumerate(self.samples)
                if self._held(stand)
            }
            also = {n: q for n, q in coordinates.items() if low <= q <= high}
            connections = connect(
                lambda q: group.at(self._driven(name, fixed | {self.driver: q})).triad,
                lambda q: moving.along(fixed | {self.driver: q}, len(q)),
                low,
                high,
                ends=ends,
                also=tuple(also.values()),
            )
            for node, n in enumerate(also, start=CHECKS):
                platforms = [(m.links[group.platform], m.sign) for m in every[n]]
                at = _located(connections, node, platforms, self.samples[n].drivers[self.driver])
                located[n] = [on and on._replace(arc=on.arc + len(arcs)) for on in at]
            circuits = 1 + max((arc.circuit for arc in arcs), default=-1)
            arcs += [arc.after(len(arcs), circuits) for arc in connections.arcs]
        return arcs, located, "" if stretches else around.sentence()

    def _limits(self, blocks: Sequence[str]) -> Limits:
        """Where some groups, and those on which they stand, close."""
        return limits_of(self.mechanism._of_blocks, self.driver, self._fixed(), blocks, self.known)

    def _stretches(self, around: Limits) -> list[tuple[float, float, str]]:
        """Where the groups that hold a triad close: low, high, and what ends it."""
        if around.whole_turn:
            return [(0.0, TURN, WHOLE)]
        law = self.mechanism.scene.drive.get(self.driver)
        stretches = []
        for arc in around.arcs:
            low, high, end_reason = arc.start.q, arc.end.q, EARLIER
            if around.unit == "m" and isinstance(law, OverRange):
                a, b = sorted((law.start, law.end))
                low, high, end_reason = max(low, a), min(high, b), RANGE
            if not (math.isfinite(low) and math.isfinite(high)):
                name = self.mechanism._of_driver(self.driver, "q")
                reason = f"{name} has no range: give it a law of motion by coordinate"
                raise refused(self.driver, reason)
            if low < high:
                stretches.append((low, high, end_reason))
        return stretches

    # -- where it is asked -----------------------------------------------------------------

    def _near(self, centre: float, q: float) -> float:
        """q, or a turn of it, near a place."""
        rotary = self.mechanism.structure.driver_joint(self.driver).rotary
        return centre + math.remainder(q - centre, TURN) if rotary else q

    def _fixed(self) -> dict[str, float]:
        """Where the other drivers are held."""
        return {d: q for d, q in self.samples[0].drivers.items() if d != self.driver}

    def _held(self, stand: FilePose) -> bool:
        """Whether a sample is on the line along which arcs are sought."""
        return all(stand.drivers[d] == q for d, q in self._fixed().items())

    def _driven(self, name: str, drivers: Record) -> list[Real]:
        """Coordinates of the driven joints inside a group."""
        structure = self.mechanism.structure
        return [structure.coordinate(d).of_joint(drivers[d]) for d in structure.drivers_of(name)]


def _reported(
    name: str, stand: FilePose, mode: Mode, on: _On | None, arcs: Sequence[Arc]
) -> GroupMode:
    """A mode of a group as the report has it."""
    arc = arcs[on.arc] if on else None
    return GroupMode(
        links=stand.in_file_frames(name, mode.links),
        margin=mode.margin,
        sign=mode.sign,
        double=mode.double,
        chosen=stand.has(name, mode),
        put=stand.put(name, mode),
        arc=on.arc if on else None,
        reach=(arc.start.q + on.shift, arc.end.q + on.shift)
        if on and arc and not arc.turns
        else None,
        after_turn=on.later if on else None,
        residual=mode.residual,
    )


def _located(
    connections: Connections, node: int, every: Sequence[tuple[LinkPosition, int]], q: float
) -> list[_On | None]:
    """Where the modes of a triad at a sample are, by the same ones at its node or close by."""
    node_modes = connections.modes[node]
    same: dict[int, int] = {}  # mode at the node -> at the sample
    for k, (pose, sign) in enumerate(every):
        size = max((abs(m.o - pose.o) for m in node_modes), default=1.0) or 1.0
        for m, mode in enumerate(node_modes):
            apart = abs(mode.o - pose.o) / size + abs(mode.e - pose.e)
            if apart <= NEAR and mode.sign == sign:
                same[m] = k
    located: list[_On | None] = [None] * len(every)
    for m, k in same.items():
        number = connections.arc_of((node, m))
        coordinate = connections.places[number][connections.passes[number].index((node, m))]
        then = connections.after_turn((node, m)) if connections.turn else None
        turns = TURN * round((q - coordinate) / TURN)
        located[k] = _On(number, turns, None if then is None else same.get(then))
    return located
