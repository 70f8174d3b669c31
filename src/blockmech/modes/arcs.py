"""The arcs of a group's modes along one driver, dyads and triads alike."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from blockmech.analysis.limits import Limits, limits
from blockmech.modes.closing import TriadMode
from blockmech.modes.connection import DEAD, RANGE, WHOLE, ArcEnd, Connections, connect
from blockmech.modes.groups import Outline
from blockmech.modes.supports import supports_of
from blockmech.modes.tracing import Outer, TriadAt
from blockmech.modes.triad import Triad

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

TURN = 2 * math.pi
BESIDE = 1e-4  # [rad or m] of a check point from the place that was asked for
SAME = 1e-4  # of the size: two poses so near to each other at such places are one mode


@dataclass(frozen=True)
class GroupArc:
    """A stretch of the driver over which one mode of a group exists.

    Attributes
    ----------
    start, end : its ends; ``other`` counts arcs of this group from 0
    branch : of a dyad with two modes, else None
    sign : of the determinant
    turns : after how many turns it closes; 0 if it has ends
    change_points : [rad or m] dead centres that it passes
    circuit : number of the circuit it is on
    """

    start: ArcEnd
    end: ArcEnd
    branch: int | None
    sign: int
    turns: int
    change_points: tuple[float, ...]
    circuit: int

    def to_dict(self) -> dict[str, Any]:
        """The arc as a JSON object."""
        return {
            "start": self.start.to_dict(),
            "end": self.end.to_dict(),
            "branch": self.branch,
            "sign": self.sign,
            "turns": self.turns,
            "change_points": list(self.change_points),
            "circuit": self.circuit,
        }


class OnArc(NamedTuple):
    """Where a mode is: the arc's number, what to add to its coordinates, the mode a turn on."""

    arc: int
    shift: float  # [rad or m] whole turns
    after_turn: int | None


@dataclass(frozen=True)
class Followed:
    """The arcs of a group, which arc its modes at given places are on, and what a turn does.

    Attributes
    ----------
    arcs : all arcs of the group
    connections : of a triad, one for each stretch on which earlier groups close
    note : why there are no arcs, if there are none
    rotary : whether the driver turns, so that a coordinate may be a turn away from its arc
    """

    arcs: tuple[GroupArc, ...]
    connections: tuple[Connections, ...] = ()
    note: str = ""
    rotary: bool = True

    def of_branch(self, branch: int | None, q: float) -> OnArc | None:
        """Where a dyad's mode at a driver coordinate [rad or m] is."""
        for n, arc in enumerate(self.arcs):
            place = self._near((arc.start.q + arc.end.q) / 2, q)
            if arc.branch == branch and (arc.turns or arc.start.q <= place <= arc.end.q):
                return OnArc(n, q - place, None)
        return None

    def of_pose(self, mode: TriadMode, q: float, size: float) -> OnArc | None:
        """Where a triad's mode at a coordinate that was asked for is."""
        first = 0
        for found in self.connections:
            for check, place in enumerate(found.checks):
                if abs(self._near(place, q) - place) > BESIDE:
                    continue
                for k, known in enumerate(found.modes[check]):
                    if abs(known.o - mode.o) + size * abs(known.e - mode.e) <= SAME * size:
                        number = found.arc_of(check, k)
                        arc = found.arcs[number]
                        there = arc.places[arc.passes.index((check, k))]
                        then = found.after_turn(check)[k] if found.turn else None
                        return OnArc(first + number, q - there, then)
            first += len(found.arcs)
        return None

    def _near(self, place: float, q: float) -> float:
        """q, or a turn of it, near a place."""
        return place + math.remainder(q - place, TURN) if self.rotary else q


def arcs_of_dyad(
    mechanism: Compiled, group: str, driver: str, held: Mapping[str, float]
) -> Followed:
    """Both branches of a dyad over the stretches where it closes, on the file's earlier groups."""
    found = limits(mechanism, driver, held, blocks=[group])
    two = "branch" in type(mechanism.structure.blocks[group]).model_fields
    arcs: list[GroupArc] = []
    for arc in found.arcs:
        passed = tuple(p.q for p in arc.change_points if p.block == group)
        for branch in (1, -1) if two else (None,):
            n = len(arcs)
            partner = None if branch is None else n + branch
            start, end = (
                ArcEnd(e.q, DEAD, partner)
                if e.block == group
                else ArcEnd(e.q, str(e) if e.block else e.how)
                for e in (arc.start, arc.end)
            )
            meets = bool(passed) or DEAD in (start.how, end.how)
            circuit = n if partner is None or not meets else min(n, partner)
            turns = 1 if found.whole_turn else 0
            arcs.append(GroupArc(start, end, branch, branch or 1, turns, passed, circuit))
    return Followed(tuple(arcs), (), "" if arcs else found.sentence(), found.unit == "rad")


def arcs_of_triad(
    mechanism: Compiled,
    group: str,
    found: Outline,
    driver: str,
    held: Mapping[str, float],
    also: Sequence[float],
) -> Followed:
    """All modes of a triad over the stretches where the groups that hold it close."""
    supports = supports_of(mechanism, group, found.joints)

    def outer(q: float) -> Sequence[Any]:
        return supports({**held, driver: q})

    own = mechanism.structure.drivers_of(group)

    def triad(q: float) -> Triad:
        at = {**held, driver: q}
        return found.at([mechanism.structure.coordinate(d).of_joint(at[d]) for d in own]).triad

    stretches, note = _stretches(mechanism, group, driver, held)
    if note:
        return Followed((), (), note)
    done: list[Connections] = []
    for low, high, how in stretches:
        if how == WHOLE:
            done.append(connect(triad, outer, low, high, also=also))
        else:
            done.append(_between(triad, outer, low, high, how, also))
    arcs: list[GroupArc] = []
    for connections in done:
        first, circuits = len(arcs), 1 + max((a.circuit for a in arcs), default=-1)
        for arc in connections.arcs:
            start, end = (
                replace(e, other=None if e.other is None else e.other + first)
                for e in (arc.start, arc.end)
            )
            circuit = circuits + arc.circuit
            arcs.append(GroupArc(start, end, None, arc.sign, arc.turns, arc.change_points, circuit))
    return Followed(tuple(arcs), tuple(done), "", mechanism.driver_joint(driver).rotary)


def _between(
    triad: TriadAt, outer: Outer, low: float, high: float, how: str, also: Sequence[float]
) -> Connections:
    """The connections on a stretch whose ends may be dead centres of earlier groups.

    Supports go with the square root of the distance from such an end; as functions of
    s, q = middle + half sin s, they are smooth.
    """
    middle, half = (low + high) / 2, (high - low) / 2

    def q(s: float) -> float:
        return min(max(middle + half * math.sin(s), low), high)

    inside = [math.asin((x - middle) / half) for x in also if low < x < high]
    got = connect(
        lambda s: triad(q(s)),
        lambda s: outer(q(s)),
        -math.pi / 2,
        math.pi / 2,
        turn=False,
        also=inside,
    )

    def moved(end: ArcEnd) -> ArcEnd:
        return ArcEnd(q(end.q), how if end.how == RANGE else end.how, end.other)

    arcs = tuple(
        replace(
            arc,
            start=moved(arc.start),
            end=moved(arc.end),
            change_points=tuple(map(q, arc.change_points)),
            places=tuple(map(q, arc.places)),
        )
        for arc in got.arcs
    )
    return replace(got, checks=tuple(map(q, got.checks)), arcs=arcs)


def _stretches(
    mechanism: Compiled, group: str, driver: str, held: Mapping[str, float]
) -> tuple[list[tuple[float, float, str]], str]:
    """Where the groups that hold a triad close: low, high, and what ends it; or why nowhere."""
    structure = mechanism.structure
    earlier = [n for n in structure.supports(group) if n != structure.frame]
    around: Limits = limits(mechanism, driver, held, blocks=earlier)
    if around.whole_turn:
        return [(0.0, TURN, WHOLE)], ""
    law: Any = mechanism.scene.drive.get(driver)
    bounded = law is not None and law.by_coordinate
    found = []
    for arc in around.arcs:
        low, high, how = arc.start.q, arc.end.q, "earlier group"
        if around.unit == "m" and bounded:
            a, b = sorted((law.start, law.end))
            low, high, how = max(low, a), min(high, b), RANGE
        if not (math.isfinite(low) and math.isfinite(high)):
            return [], f"{driver}.q has no range: give it a law of motion by coordinate"
        if low < high:
            found.append((low, high, how))
    return found, "" if found else around.sentence()
