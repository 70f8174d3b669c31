"""The modes of a mechanism as they are read: by group, by sample, with their arcs."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from blockmech.analysis.scan import shown_place
from blockmech.figures.panels import Bar, bars_figure
from blockmech.figures.paper import Pictured, shown_name
from blockmech.ground.errors import among
from blockmech.ground.report import Facts, with_unit
from blockmech.ground.units import shown_in
from blockmech.typing import Data, Record

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TURN = 2 * math.pi
DEAD, RANGE, WHOLE, LOST, EARLIER = "dead centre", "range", "turn", "lost", "earlier group"


@dataclass(frozen=True)
class ArcEnd:
    """An end of an arc.

    Attributes
    ----------
    q : driver coordinate [rad or m]
    how : "dead centre"; "range" where the range that was asked for ends; "turn" where a
        whole turn begins and ends; "earlier group" where one that holds it closes no
        further; "lost" where the group could not be followed further
    other : at a dead centre, the number of the arc that merges with this one
    """

    q: float
    how: str
    other: int | None = None


@dataclass(frozen=True)
class Arc:
    """A stretch of the driver over which one mode of a group exists.

    Attributes
    ----------
    start, end : its ends, start.q <= end.q; of a whole turn, ``turns`` turns apart
    branch : of a dyad with two modes, else None
    sign : of the determinant along it; 0 where a change point leaves it open
    turns : after how many turns it closes; 0 if it has ends
    change_points : [rad or m] dead centres that it passes
    circuit : number of the circuit; arcs of one connect through dead centres
    """

    start: ArcEnd
    end: ArcEnd
    branch: int | None
    sign: int
    turns: int
    change_points: tuple[float, ...]
    circuit: int

    def after(self, arcs: int, circuits: int) -> Arc:
        """The same arc, numbered after so many arcs and circuits."""
        start, end = (
            replace(e, other=None if e.other is None else e.other + arcs)
            for e in (self.start, self.end)
        )
        return replace(self, start=start, end=end, circuit=self.circuit + circuits)


@dataclass(frozen=True)
class GroupMode(Facts):
    """One mode of a group at one sample. Modes and arcs are numbered from 0.

    Attributes
    ----------
    links : link -> x [m], y [m], angle [rad] of its frame in ground axes
    margin : of the group [-]; of a triad that of its platform, see `TriadMode`
    sign : of the determinant: the branch of a dyad; 0 at a dead centre
    double : whether modes merge here
    chosen : whether it is the mode that the file has
    put : keys to change in the file to choose it: keys of the block, or of the document
    arc : number of its arc, if arcs were requested
    reach : range of driver coordinates [rad or m] around this sample in which it exists;
        None if it rotates fully, or arcs were not requested
    after_turn : number of the mode that it becomes after a turn of the driver; None if it ends
        before, or the driver was not followed over a turn
    residual : of a triad, the largest miss of a leg, relative to its size [-]
    """

    links: Mapping[str, tuple[float, float, float]]
    margin: float
    sign: int
    double: bool
    chosen: bool
    put: Record
    arc: int | None = None
    reach: tuple[float, float] | None = None
    after_turn: int | None = None
    residual: float | None = None

    def to_dict(self) -> Data:
        """The mode as a JSON object; a residual only of triads."""
        data = super().to_dict()
        return (
            data
            if self.residual is not None
            else {k: x for k, x in data.items() if k != "residual"}
        )


@dataclass(frozen=True)
class GroupModes:
    """The modes of one group: at each sample, and their arcs.

    Attributes
    ----------
    group : its name in messages
    kind : e.g. "II RRR", "III triad"
    samples : the modes at each sample; empty where it or an earlier group does not close
    arcs : along the driver
    note : what is missing, and why
    """

    group: str
    kind: str
    samples: tuple[tuple[GroupMode, ...], ...]
    arcs: tuple[Arc, ...] = ()
    note: str = ""


@dataclass(frozen=True, repr=False)
class Modes(Facts, Pictured):
    """The modes of a mechanism's groups.

    Attributes
    ----------
    drivers : driver -> its coordinate [rad or m] at each sample
    units : of their coordinates
    driver : the driver of the arcs, or ""
    groups : in formation order
    prefix : prefix of the driver's outputs, "driver." in a document of links and joints
    """

    FACTS = ("drivers", "units", "driver", "groups")

    drivers: Mapping[str, tuple[float, ...]]
    units: Mapping[str, str]
    driver: str
    groups: tuple[GroupModes, ...]
    prefix: str = ""

    def __getitem__(self, group: str) -> GroupModes:
        """The modes of one group. Raises `RequestError` for an unknown name."""
        groups = {modes.group: modes for modes in self.groups}
        return groups[among(groups, "group", group)[0]]

    def figure(self, ax: Axes | None = None) -> Any:
        """The arcs of all groups as bars, those of a circuit in one colour."""
        bars = [bar for group in self.groups for bar in self._bars(group)]
        caption = "Modes of one colour connect through dead centres; the dot: the file's mode."
        unit, name = self.units.get(self.driver, ""), f"{self.prefix}{self.driver}.q"
        return bars_figure(bars, name, unit, caption, self._display, ax)

    def _bars(self, group: GroupModes) -> Iterator[Bar]:
        at = self.drivers[self.driver] if group.arcs else ()
        for n, arc in enumerate(group.arcs):
            branch = "" if arc.branch is None else f", branch {arc.branch:+d}"
            chosen = (
                q
                for q, modes in zip(at, group.samples, strict=True)
                if any(mode.chosen and mode.arc == n for mode in modes)
            )
            yield Bar(
                f"{shown_name(group.group)}: arc {n + 1}{branch}",
                arc.start.q,
                arc.end.q,
                (arc.start.how, arc.end.how),
                arc.change_points,
                tuple(_nearest_turn(q, arc, self.units[self.driver] == "rad") for q in chosen),
                arc.circuit,
            )

    def lines(self) -> Iterator[str]:
        """All groups: modes by sample, then arcs."""
        for group in self.groups:
            yield f"{group.group}  {group.kind}"
            if group.note:
                yield f"  {group.note}"
            for n, modes in enumerate(group.samples):
                where = ", ".join(
                    f"{self.prefix}{d}.q = {_coordinate(row[n], self.units[d], self._display)}"
                    for d, row in self.drivers.items()
                )
                yield "  " + f"{where}: " * bool(where) + _mode_count(modes, group)
                for k, mode in enumerate(modes, start=1):
                    yield from _mode_lines(k, mode, self)
            if group.arcs:
                yield f"  along {self.prefix}{self.driver}.q:"
                yield from _arc_lines(group, self.units[self.driver], self._display)


# ---- text --------------------------------------------------------------------------------


def _mode_count(modes: tuple[GroupMode, ...], group: GroupModes) -> str:
    if not modes:
        listed = group.arcs or not group.note or any(group.samples)
        return "no mode: it cannot close" if listed else "none listed"
    return f"{len(modes)} mode{'s' if len(modes) > 1 else ''}"


def _mode_lines(number: int, mode: GroupMode, modes: Modes) -> Iterator[str]:
    factor, unit = shown_in("rad", modes._display)
    angles = ", ".join(f"{link} {pose[2] * factor:.6g} {unit}" for link, pose in mode.links.items())
    text = f"margin {mode.margin:.4g}"
    text += ", double: a dead centre" if mode.double else ""
    if mode.arc is not None:
        text += f", arc {mode.arc + 1}"
    if mode.reach is not None:
        low, high = (_coordinate(q, modes.units[modes.driver], modes._display) for q in mode.reach)
        text += f" (here from {low} to {high})"
    if mode.after_turn not in (None, number - 1):
        text += f", after a turn it is mode {(mode.after_turn or 0) + 1}"
    text += ", the file's" if mode.chosen else ""
    yield f"    {number}  {angles}; {text}"
    if mode.put:
        yield f"       {json.dumps(mode.put)[1:-1]}"


def _arc_lines(group: GroupModes, unit: str, display: Iterable[str]) -> Iterator[str]:
    for n, arc in enumerate(group.arcs, start=1):
        branch = "" if arc.branch is None else f" (branch {arc.branch:+d})"
        if arc.start.how == WHOLE:
            turns = "a turn" if arc.turns == 1 else f"{arc.turns} turns"
            span = f"the whole turn, back to itself after {turns}"
        else:
            start, end = (
                (e.how if e.how != DEAD or e.other is None else f"merges with arc {e.other + 1}")
                for e in (arc.start, arc.end)
            )
            low, high = (_coordinate(e.q, unit, display) for e in (arc.start, arc.end))
            span = f"from {low} ({start}) to {high} ({end})"
        yield f"    arc {n}{branch}: {span}"
        for q in arc.change_points:
            yield f"      change point at {_coordinate(q, unit, display)}"


def _coordinate(q: float, unit: str, display: Iterable[str]) -> str:
    return with_unit(shown_place(q), unit, display)


def _nearest_turn(q: float, arc: Arc, rotary: bool) -> float:
    """A coordinate where an arc passes it, which may be whole turns away."""
    middle = (arc.start.q + arc.end.q) / 2
    return q + math.tau * round((middle - q) / math.tau) if rotary else q
