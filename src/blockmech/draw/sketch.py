"""What a mechanism looks like, link by link, without saying where the links are.

Every shape is given in the frame of its link, so one sketch serves all poses: the
printed picture, the frames of a GIF and the player in a browser. All is derived
from declarations: joints, guide lines, markers, mass properties, terminals.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from blockmech.compiled import Compiled
from blockmech.draw.motion import Complex, Motion, Spot, marker_place
from blockmech.model.structure import JointRef, LinkRef, MarkerRef, Structure

BARREL, ROD = 1.7, 0.7  # [-] widths of a cylinder's links, in usual bars
TUBE, OVERLAP = 0.9, 0.15  # [-] of the shortest length: the barrel, and what stays inside it
ONE_PLACE = 1e-6  # [-] of the mechanism's size: rounding of poses, far below a line's width

LoadKind = Literal["force", "couple", "spring", "strut"]
Outline = tuple[complex, ...]


@dataclass(frozen=True)
class Pin:
    """A revolute pair; several at one place are drawn once, with all their names."""

    names: tuple[str, ...]
    spot: Spot
    grounded: bool


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
    outline: Outline
    cm: complex | None
    number: int
    name: str = ""  # of a link of a joint-based document
    width: float = 1.0  # [-] of a bar, in usual bars


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

    @property
    def words(self) -> int:
        """Joints and loads, which have names in a picture."""
        return len(self.pins) + len(self.sliders) + len(self.loads)


def sketch_of(motion: Motion) -> Sketch:
    """The shapes of a mechanism; ``motion`` tells how far its sliders travel."""
    s = motion.structure
    refs = [JointRef(name, j) for name, block in s.blocks.items() for j in block.joints]
    pins = [(r, spot) for r in refs if s.joint(r).kind == "R" and (spot := _pin_spot(s, r))]
    slides = [r for r in refs if s.joint(r).kind == "P"]
    points: dict[LinkRef, list[complex]] = {link: [] for link in s.links}
    for ref, spot in pins:
        points[spot.link].append(spot.at)
        for link in {s.earlier_link(ref), s.later_link(ref)} - {spot.link}:
            points[link].append(motion.seen_once(link, spot))
    cylinders: dict[LinkRef, tuple[Outline, float]] = {}  # their barrels and rods
    sliders = []
    for ref in slides:
        slider = _slider(motion, ref, _name(motion, ref, refs))
        found = _cylinder(motion, ref, points)
        cylinders |= found
        sliders.append(replace(slider, inside=bool(found)))
    for slider in sliders:
        if not slider.inside:
            points[slider.point.link].append(slider.point.at)
            points[slider.guide.link] += [slider.end(0), slider.end(1)]
    points |= {link: list(outline) for link, (outline, _) in cylinders.items()}
    for marker in shown_markers(motion.mechanism):
        points[marker.on].append(marker_place(s, marker))
    names = motion.mechanism.names
    said = {} if names is None else {name.link: link for link, name in names.links.items()}
    bodies = tuple(
        _body(s, link, places, said.get(link, ""), cylinders.get(link, ((), 1.0))[1])
        for link, places in points.items()
        if link != s.frame_link
    )
    loads, drives = (_load(s, name) for name in s.elements), _drives(motion.mechanism)
    return Sketch(bodies, _merged(motion, pins), tuple(sliders), tuple(loads), tuple(drives))


# -- joints ------------------------------------------------------------------------------


def _name(motion: Motion, ref: JointRef, refs: Sequence[JointRef]) -> str:
    """A joint's name in the picture: that of a joint-based document, or the shortest."""
    named = motion.mechanism.joint_names.get(str(ref))
    if named is not None:
        return named.split(".")[1]  # a pin of several links has one name
    return ref.name if [r.name for r in refs].count(ref.name) == 1 else str(ref)


def _pin_spot(s: Structure, ref: JointRef) -> Spot | None:
    """Where a revolute pair is: its wired marker, or the own marker of its name."""
    own = (m for m in s.markers(ref.block) if m.name == ref.name)
    marker = s.feeds[ref] if ref in s.feeds else next(own, None)
    return None if marker is None else Spot(marker.on, marker_place(s, marker))


def _merged(motion: Motion, pins: Iterable[tuple[JointRef, Spot]]) -> tuple[Pin, ...]:
    """Pins that stay at one place become one; a name is short where that is clear."""
    s = motion.structure
    groups: list[tuple[Spot, list[JointRef]]] = []
    for ref, spot in pins:
        same = (refs for other, refs in groups if _together(motion, spot, other))
        found = next(same, None)
        if found is None:
            groups.append((spot, [ref]))
        else:
            found.append(ref)
    every = [ref for _, refs in groups for ref in refs]
    merged = []
    for spot, refs in groups:
        names = dict.fromkeys(_name(motion, r, every) for r in refs)
        joined = {link for r in refs for link in (s.earlier_link(r), s.later_link(r))}
        merged.append(Pin(tuple(names), spot, s.frame_link in joined))
    return tuple(merged)


def _together(motion: Motion, one: Spot, other: Spot) -> bool:
    """Whether two spots are the same place at every sample."""
    a, b = motion.at(*one), motion.at(*other)
    known = np.isfinite(a) & np.isfinite(b)
    size = float(np.abs(a[known]).max(initial=0.0))
    near = bool(known.any() and np.abs(a - b)[known].max() <= ONE_PLACE * size)
    return near or one == other


def _slider(motion: Motion, ref: JointRef, name: str) -> Slider:
    s = motion.structure
    block = s.blocks[ref.block]
    joint = block.joints[ref.name]
    later = block.slider_owner(ref.name) == "later"

    def own_point(link: str) -> Spot:
        return Spot(LinkRef(ref.block, link), block.slider_place(ref.name, link))

    def own_line(link: str) -> tuple[Spot, complex]:
        foot, direction = block.guide_line(ref.name, link)
        return Spot(LinkRef(ref.block, link), foot), direction

    if joint.outer:
        marker = s.feeds[ref]
        other = Spot(marker.on, marker_place(s, marker))
        along = complex(getattr(s.marker(marker), "direction", 1 + 0j))
        point = own_point(joint.link) if later else other
        guide, direction = (other, along) if later else own_line(joint.link)
    else:
        mover, holder = joint.links[::-1] if later else joint.links
        point = own_point(mover)
        guide, direction = own_line(holder)
    travel = ((motion.seen(guide.link, point) - guide.at) * np.conj(direction)).real
    known = travel[np.isfinite(travel)]
    reach = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    return Slider(name, point, guide, direction, reach)


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
    if ref not in s.driven.values() or s.frame_link in (barrel, rod):
        return {}
    (foot, *more), (eye, *others) = pins[barrel] or [0j], pins[rod] or [0j]
    alone = all(z == foot for z in more) and all(z == eye for z in others)
    if not pins[barrel] or not pins[rod] or not alone:
        return {}
    line: Complex = motion.seen(barrel, Spot(rod, eye)) - foot
    length = np.abs(line[np.isfinite(line)])
    if not len(length) or length.min() == 0:
        return {}
    along = line[np.isfinite(line)] / length
    if np.abs(along - along[0]).max() > ONE_PLACE:
        return {}  # off the line, or through the foot
    short, long = float(length.min()), float(length.max())
    stem = min(long - (TUBE - OVERLAP) * short, TUBE * short)
    back = motion.seen_once(rod, Spot(barrel, foot)) - eye
    tube = (foot, complex(foot + along[0] * TUBE * short))
    return {barrel: (tube, BARREL), rod: ((eye, eye + back / abs(back) * stem), ROD)}


# -- links, loads, drives --------------------------------------------------------------------


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


def _body(s: Structure, link: LinkRef, places: list[complex], name: str, width: float) -> Body:
    properties = s.properties(link)
    cm = properties.cm.z if properties.mass > 0 else None
    outline = hull(places)
    if len(outline) == 1 and cm is not None:
        outline = hull([*outline, cm])
    return Body(link, outline or (0j,), cm, s.links[link], name, width)


def hull(places: Iterable[complex]) -> Outline:
    """Convex hull, counter-clockwise: one point, the ends of a bar, or a polygon."""
    from scipy.spatial import ConvexHull

    z = np.array(list(places), dtype=complex)
    close = ONE_PLACE**2 * np.abs(z).max(initial=0.0)
    if not len(z):
        return ()
    far = z[np.argmax(np.abs(z - z[0]))]  # an end of the longest way through the first
    if abs(far - z[0]) <= close:
        return (complex(z[0]),)
    along = (z - far) / (z[0] - far)
    if np.abs(along.imag).max() * abs(z[0] - far) <= close:
        return complex(z[np.argmax(along.real)]), complex(z[np.argmin(along.real)])
    corners = ConvexHull(np.stack([z.real, z.imag], axis=1)).vertices
    return tuple(complex(z[k]) for k in corners)


def _load(s: Structure, name: str) -> LoadMark:
    element = s.elements[name]
    markers = [s.holds[JointRef(name, terminal)] for terminal in element.terminals]
    spots = tuple(Spot(m.on, marker_place(s, m)) for m in markers)
    first = next(iter(element.terminals.values()))
    kind: LoadKind = "couple"
    if first.kind == "point":
        kind = "force" if len(spots) == 1 else "strut" if element.energy() is None else "spring"
    return LoadMark(name, kind, spots, first.unit)


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
