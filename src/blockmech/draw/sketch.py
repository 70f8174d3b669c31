"""What a mechanism looks like, link by link, without saying where the links are.

Every place is given in the frame of its link, so one sketch serves all poses. All is
derived from declarations: joints, guide lines, markers, mass properties, terminals.
"""

from __future__ import annotations

import cmath
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from blockmech.compiled import Compiled
from blockmech.draw.motion import Motion
from blockmech.figures.palette import TEXT
from blockmech.ground.tolerances import BLUR
from blockmech.loads.contract import acts
from blockmech.model.joints.dimensions import Dimension
from blockmech.model.meshing import at_zero, coupling_numbers, sides
from blockmech.model.spots import Spot, guide_spots, marker_place, pin_spot
from blockmech.model.structure import JointRef, LinkRef, MarkerRef, Structure
from blockmech.typing import Floats

CYLINDER = {"barrel": 1.7, "rod": 0.7}  # [-] widths, in usual bars
TUBE, OVERLAP = 0.9, 0.15  # [-] of the shortest length: the barrel, and what stays inside it

LEAD = 0.75 * TEXT  # [pt] of a spring's straight ends
APART = 1.25 * TEXT  # [pt] of the signs of loads between the same places
DASHPOT = (
    *((2, 0), (2, -4), (2, 4)),  # the piston, then the cylinder about it
    *((-7, 4), (7, 4), (7, -4), (-7, -4), (7, -4), (7, 0)),
)

Outline = tuple[complex, ...]


@dataclass(frozen=True)
class Pin:
    """A revolute pair, or a weld; several at one place are drawn once, with all their names."""

    names: tuple[str, ...]
    spot: Spot
    grounded: bool
    welded: bool = False


@dataclass(frozen=True)
class Slider:
    """A prismatic pair: the slider's point, and the guide line that it runs along.

    ``reach`` [m] are the ends of its travel along ``direction`` from the guide's spot.
    """

    name: str
    point: Spot
    guide: Spot
    direction: complex
    reach: tuple[float, float]
    inside: bool  # of a cylinder, which shows no block

    def end(self, which: int, beyond: float = 0.0) -> complex:
        """An end of the travel on the guide's link, or a place beyond it [m]."""
        return self.guide.at + self.direction * (self.reach[which] + (-1, 1)[which] * beyond)


@dataclass(frozen=True)
class Body:
    """A link: its outline (one point, a bar of two, a plate of more) and centre of mass."""

    link: LinkRef
    outline: Outline
    cm: complex | None
    number: int
    name: str = ""  # of a link of a joint-based document
    width: float = 1.0  # [-] of a bar, in usual bars

    @property
    def middle(self) -> Spot:
        """The mean of its corners."""
        return Spot(self.link, sum(self.outline) / len(self.outline))


@dataclass(frozen=True)
class PointMark:
    """A marker of the user on a moving link, where no pin is."""

    name: str
    spot: Spot


@dataclass(frozen=True)
class LoadMark:
    """An element: where it takes hold, and how it is drawn."""

    name: str
    kind: Literal["force", "couple", "spring", "damper", "strut"]
    spots: tuple[Spot, ...]
    unit: str
    offset: float = 0.0  # [pt] to the left of the line, beside others between the same places

    @property
    def is_passive(self) -> bool:
        """Whether it answers a motion, with a sign that no arrows are to hide."""
        return self.kind in ("spring", "damper")

    @property
    def is_line(self) -> bool:
        """Whether it is a line between two places."""
        return self.is_passive or self.kind == "strut"

    def line(self, turns: int = 7) -> Floats:
        """See `line_sign`; (0, 3) where it is none."""
        return line_sign(self.kind, turns, self.offset) if self.is_line else np.empty((0, 3))


@dataclass(frozen=True)
class Wheel:
    """A line that a coupling draws on a link: a pitch circle, a profile, a belt."""

    name: str
    link: LinkRef
    points: Outline
    chain: bool

    @property
    def extent(self) -> float:
        """Its width [m]."""
        return float(np.ptp(np.real(self.points)))

    @property
    def is_closed(self) -> bool:
        """Whether it surrounds a body."""
        return min(abs(z - self.points[-1]) for z in self.points[:-1]) <= BLUR * self.extent


@dataclass(frozen=True)
class DimensionMark:
    """A dimension of a joint-based document, and its points."""

    name: str
    dimension: Dimension
    spots: tuple[Spot, ...]


@dataclass(frozen=True)
class Sketch:
    """All that is drawn of a mechanism."""

    bodies: tuple[Body, ...]
    pins: tuple[Pin, ...]
    sliders: tuple[Slider, ...]
    loads: tuple[LoadMark, ...]
    wheels: tuple[Wheel, ...] = ()
    dimensions: tuple[DimensionMark, ...] = ()
    points: tuple[PointMark, ...] = ()

    @property
    def shows_poses(self) -> bool:
        """Whether poses look different: wheels alone look the same in all."""
        bars = any(len(body.outline) > 1 for body in self.bodies)
        return bars or any(not slider.inside for slider in self.sliders)

    @property
    def words(self) -> int:
        """Joints, points and loads, which have names in a picture."""
        return len(self.pins) + len(self.sliders) + len(self.points) + len(self.loads)

    @property
    def spots(self) -> list[Spot]:
        """What must be on the page."""
        spots = [Spot(body.link, z) for body in self.bodies for z in body.outline]
        spots += [Spot(body.link, body.cm) for body in self.bodies if body.cm is not None]
        spots += [pin.spot for pin in self.pins]
        spots += [Spot(s.guide.link, s.end(k)) for s in self.sliders for k in (0, 1)]
        spots += [Spot(wheel.link, z) for wheel in self.wheels for z in wheel.points]
        return spots + [spot for load in self.loads for spot in load.spots]


def sketch_of(motion: Motion) -> Sketch:
    """The looks of a mechanism; ``motion`` tells how far sliders travel.

    Raises `SampleError` where it closes nowhere.
    """
    if not motion.feasible.any():
        motion.refuse()
    motion = motion.only(motion.feasible)
    s = motion.structure
    refs = [JointRef(name, j) for name, block in s.blocks.items() for j in block.joints]
    pins = [(r, spot) for r in refs if s.joint(r).kind == "R" and (spot := pin_spot(s, r))]
    points: dict[LinkRef, list[complex]] = {link: [] for link in s.links}
    for ref, spot in pins:
        points[spot.link].append(spot.at)
        for link in {s.earlier_link(ref), s.later_link(ref)} - {spot.link}:
            points[link].append(complex(motion.in_frame(link, spot)[0]))
    cylinders: dict[LinkRef, tuple[Outline, float]] = {}  # their barrels and rods
    sliders = []
    for ref in (r for r in refs if s.joint(r).kind == "P"):
        cylinder = _cylinder(motion, ref, points)
        cylinders |= cylinder
        sliders.append(_slider(motion, ref, _name(motion, ref, refs), bool(cylinder)))
    for slider in sliders:
        if not slider.inside:
            points[slider.point.link].append(slider.point.at)
            points[slider.guide.link] += [slider.end(0), slider.end(1)]
    points |= {link: list(outline) for link, (outline, _) in cylinders.items()}
    for marker in shown_markers(motion.mechanism):
        points[marker.on].append(marker_place(s, marker))
    names = motion.mechanism.names
    links_of = {} if names is None else names.of_links
    bodies = tuple(
        _body(s, link, points_of_link, links_of.get(link, ""), cylinders.get(link, ((), 1.0))[1])
        for link, points_of_link in points.items()
        if link != s.frame_link
    )
    loads = [_load(s, name) for name in s.elements]
    lines = [load.spots if load.is_line else () for load in loads]
    offsets = side_by_side(lines)
    loads = [replace(load, offset=x) for load, x in zip(loads, offsets, strict=True)]
    wheels = (wheel for driver in s.followers for wheel in _wheels(motion, driver))
    welds, dimensions = _of_document(motion)
    joints = (*_merged(motion, pins), *welds)
    marks = tuple(_points(motion, joints))
    return Sketch(bodies, joints, tuple(sliders), tuple(loads), tuple(wheels), dimensions, marks)


def _points(motion: Motion, pins: Iterable[Pin]) -> Iterator[PointMark]:
    """Markers of the user that no pin shows."""
    pinned = [motion.at(*pin.spot) for pin in pins]
    for name, marker in user_markers(motion.mechanism).items():
        spot = Spot(marker.on, marker_place(motion.structure, marker))
        z = motion.at(*spot)
        if all(np.abs(z - pin).max() > BLUR * np.abs(z).max() for pin in pinned):
            yield PointMark(name.rpartition(".")[2], spot)


def _of_document(motion: Motion) -> tuple[list[Pin], tuple[DimensionMark, ...]]:
    """Welds and dimensions, which a joint-based document has and its blocks do not."""
    names, s = motion.mechanism.names, motion.structure
    document: Any = motion.mechanism.document  # its numbers fulfil its dimensions
    if names is None or document is None:
        return [], ()

    def spot(point: str) -> Spot:
        link, _, marker = point.rpartition(".")
        if link:
            at = document.links[link].markers[marker].at
        else:
            sides = zip(document.joints[point].links, document.joints[point].at, strict=True)
            link, at = next(side for side in sides if side[0] in names.links)
        frame = names.links[link]
        return Spot(frame.link, marker_place(s, frame.marker) + cmath.rect(1.0, frame.turn) * at.z)

    welds = [name for name, joint in document.joints.items() if joint.type == "weld"]
    marks = document.dimensions.items()
    return (
        [Pin((name,), spot(name), grounded=False, welded=True) for name in welds],
        tuple(DimensionMark(name, x, tuple(map(spot, x.points))) for name, x in marks),
    )


def _wheels(motion: Motion, driver: str) -> Iterator[Wheel]:
    """The lines of a coupling, on its links."""
    s, follower, ref = motion.structure, motion.structure.followers[driver], None
    ref, leader = s.driven[driver], follower.leader
    if ref not in s.feeds:
        return
    markers = {"driver": follower.centre, "driven": s.feeds[ref], "carrier": s.feeds[ref]}
    links = {"driver": follower.centre.on if leader is None else s.later_link(leader)}
    links |= {"driven": s.later_link(ref), "carrier": s.feeds[ref].on}
    name = follower.coupling
    pair, p = s.coupled_pair(name), coupling_numbers(s, name)
    for curve in s.couplings[name].curves(pair, sides(s, name), p):
        link, marker = links[curve.link], markers[curve.link]
        slides = curve.link != "carrier" and pair[curve.link == "driven"] == "P"
        centre = Spot(marker.on, marker_place(s, marker))
        at = 0j if slides else complex(motion.in_frame(link, centre)[0])
        turn = at_zero(s, link).e.conjugate() if curve.link == "carrier" else 1 + 0j
        points = tuple(at + z * turn for z in curve.points)
        yield Wheel(f"{follower.coupling}:{curve.link}", link, points, curve.chain)


# -- joints ------------------------------------------------------------------------------


def _name(motion: Motion, ref: JointRef, refs: Sequence[JointRef]) -> str:
    """A joint's name in the picture: that of a joint-based document, or the shortest."""
    named = motion.mechanism._joint_names.get(str(ref))
    if named is not None:
        return named.split(".")[1]  # a pin of several links has one name
    return ref.name if [r.name for r in refs].count(ref.name) == 1 else str(ref)


def _merged(motion: Motion, pins: Sequence[tuple[JointRef, Spot]]) -> tuple[Pin, ...]:
    """Pins that stay at one place become one; a name is short where that is clear."""
    s = motion.structure
    positions = np.array([motion.at(*spot) for _, spot in pins])
    close = BLUR * np.abs(positions).max(initial=0.0)
    groups: dict[int, list[int]] = {}  # by the first pin of each
    for i, row in enumerate(positions):
        candidates = np.flatnonzero(np.abs(positions[:i, 0] - row[0]) <= close).tolist()
        together = (
            j for j in candidates if j in groups and np.abs(positions[j] - row).max() <= close
        )
        groups.setdefault(next(together, i), []).append(i)
    every = [ref for ref, _ in pins]
    merged = []
    for group in groups.values():
        refs = [every[i] for i in group]
        names = dict.fromkeys(_name(motion, ref, every) for ref in refs)
        joined = {link for ref in refs for link in (s.earlier_link(ref), s.later_link(ref))}
        merged.append(Pin(tuple(names), pins[group[0]][1], s.frame_link in joined))
    return tuple(merged)


def _slider(motion: Motion, ref: JointRef, name: str, inside: bool) -> Slider:
    point, guide, direction = guide_spots(motion.structure, ref)
    travel = ((motion.in_frame(guide.link, point) - guide.at) * np.conj(direction)).real
    reach = (float(travel.min()), float(travel.max()))
    return Slider(name, point, guide, direction, reach, inside)


def _cylinder(
    motion: Motion, ref: JointRef, pins: Mapping[LinkRef, list[complex]]
) -> dict[LinkRef, tuple[Outline, float]]:
    """Barrel and rod with outline and width, if a driven guide joins two links that hang on
    one pin each, on its line; else nothing.

    The barrel is nearly as long as the whole is at its shortest, and the rod is so long that
    its end never leaves the barrel.
    """
    s = motion.structure
    barrel, rod = s.earlier_link(ref), s.later_link(ref)
    hung = len(set(pins[barrel])) == 1 and len(set(pins[rod])) == 1
    if ref not in s.driven.values() or s.frame_link in (barrel, rod) or not hung:
        return {}
    foot, eye = pins[barrel][0], pins[rod][0]
    line = motion.in_frame(barrel, Spot(rod, eye)) - foot
    short, long = float(np.abs(line).min()), float(np.abs(line).max())
    if short == 0 or np.abs(line / np.abs(line) - line[0] / abs(line[0])).max() > BLUR:
        return {}  # through the foot, or off the line
    axis = line[0] / abs(line[0])
    back = motion.in_frame(rod, Spot(barrel, foot))[0] - eye
    stem = min(long - (TUBE - OVERLAP) * short, TUBE * short)
    tube = (foot, complex(foot + axis * TUBE * short))
    piston = (eye, complex(eye + back / abs(back) * stem))
    return {barrel: (tube, CYLINDER["barrel"]), rod: (piston, CYLINDER["rod"])}


# -- links and loads --------------------------------------------------------------------


def user_markers(mechanism: Compiled) -> dict[str, MarkerRef]:
    """The user's markers on moving links, by link and name."""
    s, names = mechanism.structure, mechanism.names
    if names is None:
        return {
            f"{name}.{link}.{marker}": MarkerRef(name, link, marker)
            for name, block in s.blocks.items()
            for link, properties in block.links_or_default().items()
            for marker in properties.markers
        }
    items = ((link, *item) for link, x in names.links.items() for item in x.markers.items())
    return {f"{link}.{name}": ref for link, name, ref in items if ref.on != s.frame_link}


def shown_markers(mechanism: Compiled) -> list[MarkerRef]:
    """The user's markers on moving links, and those that a force takes hold of."""
    s, markers = mechanism.structure, [*user_markers(mechanism).values()]
    for terminal, marker in s.holds.items():
        if s.elements[terminal.block].terminals[terminal.name].kind == "point":
            markers.append(marker)
    return list(dict.fromkeys(markers))


def _body(s: Structure, link: LinkRef, points: list[complex], name: str, width: float) -> Body:
    properties = s.properties(link)
    cm = properties.cm.z if properties.mass > 0 else None
    outline = hull(points)
    if len(outline) == 1 and cm is not None:
        outline = hull([*outline, cm])
    return Body(link, outline or (0j,), cm, s.links[link], name, width)


def hull(vertices: Iterable[complex]) -> Outline:
    """Convex hull, counter-clockwise: one point, the ends of a bar, or a polygon.

    Andrew's monotone chain; what lies closer together than rounding is one point.
    """
    corners = [complex(p) for p in vertices]
    z: list[complex] = []
    direction = max(
        (p - corners[0] for p in corners), key=abs, default=0j
    )  # so that a bar is sorted
    for corner in sorted(corners, key=lambda p: (p * direction.conjugate()).real):
        if all(abs(corner - vertex) > BLUR**2 * abs(corner) for vertex in z):
            z.append(corner)

    def chain(points: Sequence[complex]) -> list[complex]:
        corners: list[complex] = []
        for p in points:
            while len(corners) > 1 and not _turns_left(corners[-2], corners[-1], p):
                corners.pop()
            corners.append(p)
        return corners[:-1]

    return tuple(chain(z) + chain(z[::-1]) or z)


def _turns_left(a: complex, b: complex, c: complex) -> bool:
    turn = ((b - a).conjugate() * (c - b)).imag
    return turn > BLUR**2 * max(map(abs, (a, b, c))) ** 2


def _load(s: Structure, name: str) -> LoadMark:
    element = s.elements[name]
    markers = [s.holds[JointRef(name, terminal)] for terminal in element.terminals]
    spots = tuple(Spot(m.on, marker_place(s, m)) for m in markers)
    first = next(iter(element.terminals.values()))
    if first.kind != "point":
        return LoadMark(name, "couple", spots, first.unit)
    if len(spots) == 1:
        return LoadMark(name, "force", spots, first.unit)
    damped = acts(getattr(element, "damping", 0.0))
    return LoadMark(name, line_kind(element.energy() is not None, damped), spots, first.unit)


def line_kind(elastic: bool, damped: bool) -> Literal["spring", "damper", "strut"]:
    """How a load between two places is drawn; what is neither elastic nor damped is a thrust."""
    return "spring" if elastic else "damper" if damped else "strut"


def side_by_side(lines: Sequence[Sequence[Hashable]]) -> list[float]:
    """How far [pt] to the left of its two ends each load is drawn, so that none hides another.

    lines : the ends of each; no ends of a load that is no line
    """
    pairs = [frozenset(ends) for ends in lines]
    first = dict(zip(pairs[::-1], lines[::-1], strict=True))
    offsets = []
    for i, (pair, ends) in enumerate(zip(pairs, lines, strict=True)):
        count, rank = pairs.count(pair), pairs[:i].count(pair)
        offset = APART * (rank - (count - 1) / 2) if pair else 0.0
        offsets.append(offset if ends == first[pair] else -offset)
    return offsets


def line_sign(kind: str, turns: int = 7, offset: float = 0.0) -> Floats:
    """The stroke (p, 3) of a load from a to b: share of the way, along, to the left.

    Along, to the left and ``offset`` are in points of the page.
    """
    corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    if kind == "spring":
        share, sides = (np.arange(2 * turns) + 0.5) / (2 * turns), np.tile([3.2, -3.2], turns)
        coil = np.column_stack([share, LEAD * (1 - 2 * share), sides])
        corners[1:1] = [[0, LEAD, 0], *coil.tolist(), [1, -LEAD, 0]]
    elif kind == "damper":
        corners[1:1] = [[0.5, *corner] for corner in DASHPOT]
    line = np.add(corners, [0.0, 0.0, offset])
    return np.array([corners[0], *line, corners[-1]]) if offset else line
