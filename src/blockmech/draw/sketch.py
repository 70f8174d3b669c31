"""What a mechanism looks like, link by link, without saying where the links are.

Every shape is given in the frame of its link, so one sketch serves all poses: the
printed picture, the frames of a GIF and the player in a browser. All is derived
from declarations: joints, guide lines, markers, mass properties, terminals.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from blockmech.blocks.contract import Moving
from blockmech.compiled import Compiled
from blockmech.draw.motion import Motion, marker_place
from blockmech.model.structure import JointRef, LinkRef, MarkerRef, Structure
from blockmech.plane import cross

BARREL, ROD = 1.7, 0.7  # [-] widths of a cylinder's links, in usual bars
TUBE, OVERLAP = 0.9, 0.15  # [-] of the shortest length: the barrel, and what stays inside it

LoadKind = Literal["force", "couple", "spring", "strut"]


class Spot(NamedTuple):
    """A place on a link, in the link's frame [m]."""

    link: LinkRef
    at: complex


@dataclass(frozen=True)
class Pin:
    """A revolute pair; several at one place are drawn once, with all their names."""

    names: tuple[str, ...]
    spot: Spot
    grounded: bool
    links: tuple[LinkRef, ...]  # that it joins


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
    inside: bool = False  # of a cylinder, which shows no block

    def end(self, which: int, beyond: float = 0.0) -> complex:
        """An end of the travel on the guide's link, or a place beyond it [m]."""
        return self.guide.at + self.direction * (self.reach[which] + (-1, 1)[which] * beyond)


@dataclass(frozen=True)
class Body:
    """A link: its outline (one point, a bar of two, a plate of more) and centre of mass."""

    link: LinkRef
    outline: tuple[complex, ...]
    cm: complex | None
    number: int
    name: str = ""  # of a link of a joint-based document
    width: float = 1.0  # [-] of a bar, in usual bars


class Cylinder(NamedTuple):
    """Barrel and rod of a driven length: a line in the frame of each link."""

    barrel: LinkRef
    rod: LinkRef
    tube: tuple[complex, complex]
    stem: tuple[complex, complex]


@dataclass(frozen=True)
class LoadMark:
    """An element: where it takes hold, and how it is drawn."""

    name: str
    kind: LoadKind
    spots: tuple[Spot, ...]
    unit: str


@dataclass(frozen=True)
class DriveMark:
    """A driver's coordinate: about the pivot of a crank, or along the guide of a slide.

    ``sense`` is -1 where the coordinate grows against the motion of ``driven``.
    """

    name: str
    rotary: bool
    spot: Spot
    driven: LinkRef
    sense: int = 1


@dataclass(frozen=True)
class Sketch:
    """All shapes of a mechanism."""

    bodies: tuple[Body, ...]
    pins: tuple[Pin, ...]
    sliders: tuple[Slider, ...]
    loads: tuple[LoadMark, ...]
    drives: tuple[DriveMark, ...]


def sketch_of(motion: Motion) -> Sketch:
    """The shapes of a mechanism; ``motion`` tells how far its sliders travel."""
    s = motion.structure
    refs = [JointRef(name, j) for name, block in s.blocks.items() for j in block.joints]
    pins = [(r, spot) for r in refs if s.joint(r).kind == "R" and (spot := _pin_spot(s, r))]
    sliders = tuple(_slider(motion, r, _said(motion, r, refs)) for r in refs if _slides(s, r))
    points: dict[LinkRef, list[complex]] = {link: [] for link in s.links}
    for ref, spot in pins:
        points[spot.link].append(spot.at)
        for link in {s.earlier_link(ref), s.later_link(ref)} - {spot.link}:
            points[link].append(_seen_from(motion, link, spot))
    pairs = dict(zip((r for r in refs if _slides(s, r)), sliders, strict=True))
    cylinders = {r: c for r in pairs if (c := _cylinder(motion, r, points))}
    sliders = tuple(replace(slider, inside=r in cylinders) for r, slider in pairs.items())
    for slider in sliders:
        if not slider.inside:
            points[slider.point.link].append(slider.point.at)
            points[slider.guide.link] += [slider.end(0), slider.end(1)]
    widths: dict[LinkRef, float] = {}
    for c in cylinders.values():
        points[c.barrel], points[c.rod] = list(c.tube), list(c.stem)
        widths |= {c.barrel: BARREL, c.rod: ROD}
    for marker in shown_markers(motion.mechanism):
        points[marker.on].append(marker_place(s, marker))
    names = motion.mechanism.names
    said = {} if names is None else {name.link: link for link, name in names.links.items()}
    bodies = tuple(
        _body(s, link, places, said.get(link, ""), widths.get(link, 1.0))
        for link, places in points.items()
        if link != s.frame_link
    )
    loads = tuple(_load(s, name) for name in s.elements)
    return Sketch(bodies, _merged(motion, pins), sliders, loads, tuple(_drives(motion.mechanism)))


def _slides(s: Structure, ref: JointRef) -> bool:
    return s.joint(ref).kind == "P"


def _said(motion: Motion, ref: JointRef, refs: list[JointRef]) -> str:
    """A joint's name in the picture: that of a joint-based document, or the shortest."""
    named = motion.mechanism.joint_names.get(str(ref))
    if named is not None:
        return named.split(".")[1]  # a pin of several links has one name
    return ref.name if [r.name for r in refs].count(ref.name) == 1 else str(ref)


def _pin_spot(s: Structure, ref: JointRef) -> Spot | None:
    """Where a revolute pair is: its wired marker, or the own marker of its name."""
    if ref in s.feeds:
        marker = s.feeds[ref]
        return Spot(marker.on, marker_place(s, marker))
    own = {m.name: m for m in s.markers(ref.block)}
    if ref.name not in own:
        return None
    return Spot(own[ref.name].on, marker_place(s, own[ref.name]))


def _seen_from(motion: Motion, link: LinkRef, spot: Spot) -> complex:
    """A spot of another link in a link's frame, at a sample where both are known."""
    z = (motion.at(*spot) - motion.origin[link]) * np.conj(motion.axis[link])
    known = z[np.isfinite(z)]
    return complex(known[0]) if len(known) else 0j


def _merged(motion: Motion, pins: Iterable[tuple[JointRef, Spot]]) -> tuple[Pin, ...]:
    """Pins that stay at one place become one; a name is short where that is clear."""
    s = motion.structure
    groups: list[tuple[Spot, list[JointRef]]] = []
    for ref, spot in pins:
        for other, refs in groups:
            if _together(motion, spot, other):
                refs.append(ref)
                break
        else:
            groups.append((spot, [ref]))
    every = [ref for _, refs in groups for ref in refs]
    found = []
    for spot, refs in groups:
        names = dict.fromkeys(_said(motion, r, every) for r in refs)
        joined = {link for r in refs for link in (s.earlier_link(r), s.later_link(r))}
        grounded = s.frame_link in joined
        found.append(Pin(tuple(names), spot, grounded, tuple(sorted(joined))))
    return tuple(found)


def _together(motion: Motion, one: Spot, other: Spot) -> bool:
    """Whether two spots are the same place at every sample."""
    if one == other:
        return True
    a, b = motion.at(*one), motion.at(*other)
    known = np.isfinite(a) & np.isfinite(b)
    size = float(np.abs(a[known]).max(initial=0.0))
    return bool(known.any() and np.abs(a - b)[known].max() <= 1e-6 * size)


def _slider(motion: Motion, ref: JointRef, name: str) -> Slider:
    s = motion.structure
    block = s.blocks[ref.block]
    joint = block.joints[ref.name]
    later = block.slider_owner(ref.name) == "later"
    if joint.outer:
        own, marker = LinkRef(ref.block, joint.link), s.feeds[ref]
        place, direction = marker_place(s, marker), _direction(s, marker)
        if later:
            point = Spot(own, block.slider_place(ref.name, joint.link))
            guide = Spot(marker.on, place)
        else:
            point = Spot(marker.on, place)
            guide, direction = _own_line(block, ref, joint.link)
    else:
        mover, holder = joint.links[::-1] if later else joint.links
        point = Spot(LinkRef(ref.block, mover), block.slider_place(ref.name, mover))
        guide, direction = _own_line(block, ref, holder)
    travel = (_seen_all(motion, guide.link, point) - guide.at) * np.conj(direction)
    known = travel.real[np.isfinite(travel)]
    reach = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    return Slider(name, point, guide, direction, reach)


def _cylinder(
    motion: Motion, ref: JointRef, pins: Mapping[LinkRef, list[complex]]
) -> Cylinder | None:
    """Barrel and rod, if a driven guide joins two links that hang on one pin each, on its line.

    The barrel is nearly as long as the whole is at its shortest, and the rod is so long that
    its end stays inside at the longest.
    """
    s = motion.structure
    barrel, rod = s.earlier_link(ref), s.later_link(ref)
    if ref not in s.driven.values() or s.frame_link in (barrel, rod):
        return None
    (foot, *more), (eye, *others) = pins[barrel] or [0j], pins[rod] or [0j]
    if not pins[barrel] or not pins[rod] or any(z != foot for z in more):
        return None
    line = _seen_all(motion, barrel, Spot(rod, eye)) - foot
    line = line[np.isfinite(line)]
    if not len(line) or any(z != eye for z in others):
        return None
    length, u = np.abs(line), line[0] / abs(line[0]) if line[0] else 1 + 0j
    if length.min() == 0 or np.abs(line / length - u).max() > 1e-6:
        return None  # off the line, or through the foot
    short, long = float(length.min()), float(length.max())
    stem = min(long - (TUBE - OVERLAP) * short, TUBE * short)
    back = _seen_from(motion, rod, Spot(barrel, foot)) - eye
    tube = (foot, complex(foot + u * TUBE * short))
    return Cylinder(barrel, rod, tube, (eye, complex(eye + back / abs(back) * stem)))


def _seen_all(motion: Motion, link: LinkRef, spot: Spot) -> np.ndarray:
    return (motion.at(*spot) - motion.origin[link]) * np.conj(motion.axis[link])


def _direction(s: Structure, marker: MarkerRef) -> complex:
    return complex(getattr(s.marker(marker), "direction", 1 + 0j))


def _own_line(block: Moving, ref: JointRef, link: str) -> tuple[Spot, complex]:
    """A place on the guide line of a block's own link, and its direction."""
    foot, direction = block.guide_line(ref.name, link)
    return Spot(LinkRef(ref.block, link), foot), direction


def shown_markers(mechanism: Compiled) -> list[MarkerRef]:
    """The user's markers on moving links, and those that a force takes hold of."""
    s, names = mechanism.structure, mechanism.names
    if names is None:
        found = [
            MarkerRef(name, link, marker)
            for name, block in s.blocks.items()
            for link, properties in block.links_or_default().items()
            for marker in properties.markers
        ]
    else:
        found = [m for link in names.links.values() for m in link.markers.values()]
        found = [m for m in found if m.on != s.frame_link]
    for terminal, marker in s.holds.items():
        if s.elements[terminal.block].terminals[terminal.name].kind == "point":
            found.append(marker)
    return list(dict.fromkeys(found))


def _body(
    s: Structure, link: LinkRef, places: list[complex], name: str, width: float = 1.0
) -> Body:
    properties = s.properties(link)
    cm = properties.cm.z if properties.mass > 0 else None
    size = max((abs(z) for z in places), default=0.0)
    outline = hull(places, 1e-9 * size)
    if len(outline) == 1 and cm is not None and abs(cm - outline[0]) > 1e-9 * abs(cm):
        outline = (*outline, cm)
    return Body(link, outline or (0j,), cm, s.links[link], name, width)


def hull(places: Iterable[complex], close: float = 0.0) -> tuple[complex, ...]:
    """Convex hull, counter-clockwise: one point, the ends of a bar, or a polygon.

    Points nearer than ``close`` [m] are one, and so are lines.
    Source: Andrew's monotone chain.
    """
    points: list[complex] = []
    for z in sorted(places, key=lambda z: (z.real, z.imag)):
        if all(abs(z - other) > close for other in points):
            points.append(z)
    if len(points) < 3:
        return tuple(points)
    sides = []
    for row in (points, points[::-1]):
        side: list[complex] = []
        for z in row:
            while len(side) > 1 and _right_turn(side[-2], side[-1], z, close):
                side.pop()
            side.append(z)
        sides.append(side[:-1])
    return tuple(sides[0] + sides[1])


def _right_turn(a: complex, b: complex, c: complex, close: float) -> bool:
    return bool(cross(b - a, c - b) <= close * abs(c - a))


def _load(s: Structure, name: str) -> LoadMark:
    element = s.elements[name]
    spots = []
    for terminal in element.terminals:
        marker = s.holds[JointRef(name, terminal)]
        spots.append(Spot(marker.on, marker_place(s, marker)))
    kinds = [t.kind for t in element.terminals.values()]
    kind: LoadKind = "couple"
    if kinds[0] == "point":
        kind = "force" if len(kinds) == 1 else "strut" if element.energy() is None else "spring"
    return LoadMark(name, kind, tuple(spots), next(iter(element.terminals.values())).unit)


def _drives(mechanism: Compiled) -> Iterable[DriveMark]:
    s = mechanism.structure
    for name, ref in s.driven.items():
        joint, sign = s.joint(ref), s.coordinate(name).sign
        own = s.later_link(ref)
        if not joint.rotary:
            at = s.blocks[ref.block].slider_place(ref.name, own.link)
            yield DriveMark(name, False, Spot(own, at), own, sign)
        elif (spot := _pin_spot(s, ref)) is not None:
            yield DriveMark(name, True, spot, own, sign)
