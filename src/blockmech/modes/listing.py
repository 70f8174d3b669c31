"""The assembly modes of every group of a mechanism, and how they connect along a driver.

Each group is asked with the earlier groups standing as the file says. What a mode is
called in the file stands with it: a branch, a home, or the poses of links in a document
of links and joints.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from blockmech.analysis.limits import limits
from blockmech.blocks.contract import AssurGroup
from blockmech.blocks.general import GeneralGroup
from blockmech.errors import Problem, RequestError, close_match, listed
from blockmech.model.dyad_modes import Mode, branches, dyad_modes
from blockmech.model.structure import JointRef
from blockmech.modes.closing import NEAR, triad_modes
from blockmech.modes.connection import CHECKS, Connections, connect
from blockmech.modes.found import (
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
from blockmech.modes.groups import Outline, outline
from blockmech.modes.triad import Support
from blockmech.modes.words import FilePoses
from blockmech.samples import make_samples
from blockmech.typing import Guide, LinkPosition

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

Supports: TypeAlias = Callable[[Mapping[str, Any]], list[Support]]
"""Driver -> coordinates (n,) [rad or m], to the supports (n,); NaN where they are not placed."""

Located: TypeAlias = tuple[int, float, int | None]
"""Number of an arc, what to add to its coordinates [rad or m], the mode a turn on."""


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
    arcs : whether arcs are sought: some tenths of a second a triad

    Raises
    ------
    RequestError for unknown names, and where nothing says where the drivers stand
    """
    still = dict.fromkeys(mechanism.drivers, 0.0)
    at = _begin(mechanism) if at is None else at
    taken = make_samples(mechanism, mechanism.scene, at, rates=still)
    rows = {d: tuple(taken.coordinate(i).tolist()) for i, d in enumerate(mechanism.drivers)}
    samples = [dict(zip(rows, q, strict=True)) for q in zip(*rows.values(), strict=True)]
    moved = _moved(mechanism, driver) if arcs else ""
    lister = _Lister(mechanism, tuple(samples), moved, FilePoses(mechanism))
    found = tuple(lister.group(name) for name in _wanted(mechanism, groups))
    units = {d: mechanism.driver_joint(d).coordinate_unit for d in mechanism.drivers}
    return Modes(rows, units, moved, found)


class _Found(NamedTuple):
    """The modes of a group at each sample, its arcs, and where each mode is on them."""

    every: Sequence[Sequence[Mode]] = ()
    arcs: tuple[Arc, ...] = ()
    note: str = ""
    located: Sequence[Sequence[Located | None]] = ()


@dataclass(frozen=True)
class _Lister:
    """What all groups share: the mechanism, samples, and the driver along which arcs lie."""

    mechanism: Compiled
    samples: tuple[Mapping[str, float], ...]
    driver: str
    file: FilePoses

    def group(self, name: str) -> GroupModes:
        """All modes of a group."""
        block = self.mechanism.structure.blocks[name]
        triad = outline(block) if isinstance(block, GeneralGroup) else None
        try:
            if triad is not None:
                found = self._triad(name, triad)
            elif isinstance(block, GeneralGroup):
                found = _Found(note="only the modes of dyads and triads are listed")
            else:
                assert isinstance(block, AssurGroup)
                found = self._dyad(name, block)
        except RequestError as error:  # of one group; the others are told all the same
            found = _Found(note=_told(error))
        samples = []
        for drivers, every, located in zip_longest(self.samples, found.every, found.located):
            at = located or [None] * len(every or ())
            told = zip(every or (), at, strict=True)
            samples.append(tuple(self._mode(name, m, drivers, found.arcs, on) for m, on in told))
        kind = f"{block.group_class} {block.kind}"
        return GroupModes(self.mechanism.said(name), kind, tuple(samples), found.arcs, found.note)

    def _mode(
        self,
        name: str,
        mode: Mode,
        drivers: Mapping[str, float],
        arcs: Sequence[Arc],
        located: Located | None,
    ) -> GroupMode:
        number, shift, then = located or (None, 0.0, None)
        reach = None
        if number is not None and not arcs[number].turns:
            reach = (arcs[number].start.q + shift, arcs[number].end.q + shift)
        return GroupMode(
            links=self.file.told(name, mode.links),
            margin=mode.margin,
            sign=mode.sign,
            double=mode.double,
            chosen=self.file.has(name, mode, drivers),
            put=self.file.put(name, mode, drivers),
            arc=number,
            reach=reach,
            after_turn=then,
            residual=mode.residual,
        )

    # -- dyads -----------------------------------------------------------------------------

    def _dyad(self, name: str, block: AssurGroup) -> _Found:
        """Both branches, and the arcs of each where the dyad closes."""
        supports = self._supports(name, [j.name for j in block.joints.values() if j.outer])
        every: list[Sequence[Mode]] = []
        for drivers in self.samples:
            held = [_first(support) for support in supports(drivers)]
            every.append(dyad_modes(block, [*held, *self._driven(name, drivers)]))
        if not self._follows(name):
            return _Found(every)
        around = limits(self.mechanism.of_blocks, self.driver, self._fixed, blocks=[name])
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
        located = [
            [self._of_branch(arcs, m, k, drivers) for k, m in enumerate(modes)]
            for modes, drivers in zip(every, self.samples, strict=True)
        ]
        return _Found(every, tuple(arcs), "" if arcs else around.sentence(), located)

    def _of_branch(
        self, arcs: Sequence[Arc], mode: Mode, k: int, drivers: Mapping[str, float]
    ) -> Located | None:
        """Where mode k of a dyad is."""
        for number, arc in enumerate(arcs if self._held(drivers) and not mode.double else ()):
            place = self._near((arc.start.q + arc.end.q) / 2, drivers[self.driver])
            here = bool(arc.turns) or arc.start.q <= place <= arc.end.q
            if arc.branch == mode.branch and here:
                return number, drivers[self.driver] - place, k if arc.turns else None
        return None

    # -- triads ----------------------------------------------------------------------------

    def _triad(self, name: str, group: Outline) -> _Found:
        """All modes, connected over the stretches of the driver where earlier groups close."""
        supports = self._supports(name, group.joints)
        every: list[Sequence[Mode]] = []
        for drivers in self.samples:
            at = [_first(support) for support in supports(drivers)]
            modes: list[Mode] = []
            if all(np.isfinite(support).all() for support in at):
                formed = group.at(self._driven(name, drivers))
                modes = [
                    Mode(formed.places(at, m.o, m.e), m.margin, m.sign, m.double, None, m.residual)
                    for m in triad_modes(formed.triad, at)
                ]
            every.append(modes)
        if not self._follows(name):
            return _Found(every)
        try:
            return self._connected(name, group, supports, every)
        except RequestError as error:
            return _Found(every, note=_told(error))

    def _connected(
        self, name: str, group: Outline, supports: Supports, every: list[Sequence[Mode]]
    ) -> _Found:
        stretches, note = self._stretches(name)
        arcs: list[Arc] = []
        located: list[list[Located | None]] = [[None] * len(modes) for modes in every]
        for low, high, ends in stretches:
            also = {
                n: self._near((low + high) / 2, drivers[self.driver])
                for n, drivers in enumerate(self.samples)
                if self._held(drivers)
            }
            also = {n: q for n, q in also.items() if low <= q <= high}
            found = connect(
                lambda q: group.at(self._driven(name, self._fixed | {self.driver: q})).triad,
                lambda q: supports(self._fixed | {self.driver: q}),
                low,
                high,
                ends=ends,
                also=tuple(also.values()),
            )
            for node, n in enumerate(also, start=CHECKS):
                own = [(m.links[group.platform], m.sign) for m in every[n]]
                at = _located(found, node, own, self.samples[n][self.driver])
                located[n] = [on and (on[0] + len(arcs), *on[1:]) for on in at]
            circuits = 1 + max((arc.circuit for arc in arcs), default=-1)
            arcs += [arc.after(len(arcs), circuits) for arc in found.arcs]
        return _Found(every, tuple(arcs), note, located)

    def _stretches(self, name: str) -> tuple[list[tuple[float, float, str]], str]:
        """Where the groups that hold a triad close: low, high, and what ends it; or why nowhere."""
        mechanism, structure = self.mechanism.of_blocks, self.mechanism.structure
        earlier = [block for block in structure.supports(name) if block != structure.frame]
        around = limits(mechanism, self.driver, self._fixed, blocks=earlier)
        if around.whole_turn:
            return [(0.0, TURN, WHOLE)], ""
        law: Any = mechanism.scene.drive.get(self.driver)
        found = []
        for arc in around.arcs:
            low, high, how = arc.start.q, arc.end.q, EARLIER
            if around.unit == "m" and law is not None and law.by_coordinate:
                a, b = sorted((law.start, law.end))
                low, high, how = max(low, a), min(high, b), RANGE
            if not (math.isfinite(low) and math.isfinite(high)):
                told = f"{self.driver}.q has no range: give it a law of motion by coordinate"
                return [], told
            if low < high:
                found.append((low, high, how))
        return found, "" if found else around.sentence()

    # -- where it is asked -----------------------------------------------------------------

    def _follows(self, name: str) -> bool:
        return self.driver in self.mechanism.structure.upstream[name]

    def _near(self, place: float, q: float) -> float:
        """q, or a turn of it, near a place."""
        rotary = self.mechanism.driver_joint(self.driver).rotary
        return place + math.remainder(q - place, TURN) if rotary else q

    def _held(self, drivers: Mapping[str, float]) -> bool:
        """Whether a sample is on the line along which arcs are sought."""
        first = self.samples[0]
        return bool(self.driver) and all(
            q == first[d] for d, q in drivers.items() if d != self.driver
        )

    @cached_property
    def _fixed(self) -> dict[str, float]:
        """Where the other drivers are held."""
        return {d: q for d, q in self.samples[0].items() if d != self.driver}

    def _supports(self, group: str, joints: Sequence[str]) -> Supports:
        """Where earlier links hold joints of a group."""
        structure, mechanism = self.mechanism.structure, self.mechanism.of_blocks
        feeds = [structure.feeds[JointRef(group, joint)] for joint in joints]
        guided = [structure.joint(JointRef(group, joint)).reads == "guide" for joint in joints]
        turning = [
            f"{feed.on}.angle" if guide and feed.on != structure.frame_link else ""
            for feed, guide in zip(feeds, guided, strict=True)
        ]
        want = sorted({f"{feed}.p" for feed in feeds}.union(filter(None, turning)))
        still = dict.fromkeys(mechanism.drivers, 0.0)

        def supports(drivers: Mapping[str, Any]) -> list[Support]:
            n = max((np.size(q) for q in drivers.values()), default=1)
            at = {d: np.broadcast_to(q, n) for d, q in drivers.items()}
            run = mechanism.run(at=at, rates=still, want=want, on_gap="mark")
            found: list[Support] = []
            for feed, guide, turned in zip(feeds, guided, turning, strict=True):
                p = run[f"{feed}.p"]
                e = np.exp(1j * run[turned]) if turned else np.ones_like(p)
                e = e * getattr(structure.marker(feed), "direction", 1 + 0j)
                found.append(Guide(p, e) if guide else p)
            return found

        return supports

    def _driven(self, name: str, drivers: Mapping[str, Any]) -> list[Any]:
        """Coordinates of the driven joints inside a group."""
        structure = self.mechanism.structure
        own = structure.drivers_of(name)
        return [structure.coordinate(d).of_joint(drivers[d]) for d in own]


def _located(
    found: Connections, node: int, every: Sequence[tuple[LinkPosition, int]], q: float
) -> list[Located | None]:
    """Where the modes of a triad at a sample are, by the same ones at its node or close by."""
    known = found.modes[node]
    same: dict[int, int] = {}  # mode at the node -> at the sample
    for k, (own, sign) in enumerate(every):
        size = max(abs(m.o - own.o) for m in known) if known else 1.0
        for m, other in enumerate(known):
            apart = abs(other.o - own.o) / (size or 1.0) + abs(other.e - own.e)
            if apart <= NEAR and other.sign == sign:
                same[m] = k
    located: list[Located | None] = [None] * len(every)
    for m, k in same.items():
        number = found.arc_of((node, m))
        place = found.places[number][found.passes[number].index((node, m))]
        then = found.after_turn((node, m)) if found.turn else None
        turns = TURN * round((q - place) / TURN)
        located[k] = (number, turns, None if then is None else same.get(then))
    return located


def _first(support: Support) -> Support:
    """A support at the first of n places."""
    if isinstance(support, Guide):
        return Guide(complex(support.p[0]), complex(support.u[0]))
    return complex(support[0])


def _told(error: RequestError) -> str:
    return "; ".join(problem.found for problem in error.problems)


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
            told = "nothing says where this driver stands"
            remedy = "give its coordinate, or a law of motion by coordinate"
            problems.append(Problem("bad-request", driver, told, "", remedy))
    if problems:
        raise RequestError(problems)
    return found


def _moved(mechanism: Compiled, driver: str | None) -> str:
    """The driver along which arcs are sought: the one named, or the only one; else none."""
    drivers = mechanism.drivers
    if driver is None:
        return drivers[0] if len(drivers) == 1 else ""
    _known("driver", [driver], drivers)
    return driver


def _wanted(mechanism: Compiled, groups: Iterable[str] | None) -> tuple[str, ...]:
    """Blocks that close, in formation order: all, or the named ones."""
    blocks = mechanism.structure.blocks.items()
    said = {mechanism.said(name): name for name, block in blocks if block.closes}
    wanted = set(said if groups is None else groups)
    _known("group", sorted(wanted), tuple(said))
    return tuple(block for name, block in said.items() if name in wanted)


def _known(kind: str, wanted: Iterable[str], known: Sequence[str]) -> None:
    """Refuse unknown names."""
    valid = f"{kind}s: {listed(known)}" if known else ""
    problems = [
        Problem("bad-request", name, f"there is no such {kind}", valid, close_match(name, known))
        for name in wanted
        if name not in known
    ]
    if problems:
        raise RequestError(problems)
