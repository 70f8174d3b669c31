"""Linkage: files ``.linkage2``, XML of connectors and links.

Lengths are those of the drawing times its scale, y points up, ``rpm`` counts clockwise. A
connector that slides has two limits, between which its line lies: a slot in the link of both, or
in the frame. On an arc of ``slideradius`` it keeps its distance from the arc's centre, so a link
without mass holds it there. The centre is the one of the two that fits the drawn place; where both
do it lies left of the way from limit to limit if the radius is positive. An actuator is a link that
changes its length. A ratio of type ``gears`` or ``chain`` couples two links that turn on one: sizes
are teeth or radii, what counts is their ratio.

Source: rectorsquid/Linkage, ``LinkageDoc.cpp`` (reading and writing) and its examples.
"""

from __future__ import annotations

import cmath
import math
import re
from typing import NamedTuple

from blockmech.exchange.drawing import FRAME, Drawing, Drive, Pair, Slot, Wheels, direction
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import Record, number, wrong, xml_of
from blockmech.ground.errors import listed
from blockmech.ground.names import numbered_name

RPM = math.tau / 60
ROOM = 9e-4  # by which Linkage keeps the diameter of an arc above the distance of its limits
LOOKS = {"zoom", "xoffset", "yoffset", "draw", "drawcircle", "name", "layer", "color", "linesize"}
LOOKS |= {"measurement", "selected", "solid", "locked", "fillcolor", "usercolor", "labels"}
LOOKS |= {"showlabels", "viewlayers", "editlayers", "smoothdrawing", "showdata", "showdimensions"}
LOOKS |= {"background"}
UNITS = {"millimeters": "mm", "inches": "in"}


class Slide(NamedTuple):
    """A connector that slides between two others, on an arc where the radius is not 0."""

    key: str
    limits: list[str]
    radius: float


def read(text: str, where: str) -> Drawing:
    """The drawing of a file."""
    spaced = re.sub(r'(="[^"<>]*")(?=[A-Za-z_])', r"\1 ", text)  # old files leave spaces out
    root = xml_of(spaced, where)
    if root.tag != "linkage2":
        raise wrong(where, f"the root is <{root.tag}>", "<linkage2>")
    drawing = Drawing("linkage", source="Linkage file")
    scale = 1.0
    for program in root.all("program"):
        scale = number(program.get("scalefactor"), f"{where}, program", 1.0)
        drawing.unit = UNITS.get((program.get("units") or "Millimeters").lower(), "mm")
    slides: list[Slide] = []
    for raw in root.all("connector"):
        _connector(raw, where, scale, drawing, slides)
    for raw in root.all("Link"):
        _link(raw, where, scale, drawing)
    for slide in slides:
        _slot(slide, drawing, where)
    _ratios(root, where, drawing)
    turning = {wheel for pair in drawing.wheels for wheel in (pair.first, pair.second)}
    for name, points in list(drawing.links.items()):
        if len(points) > 1 or name.endswith(("_barrel", "_rod")) or name in turning:
            continue
        if points[0] in drawing.slots:
            first, *rest = drawing.slots[points[0]]
            drawing.slots[points[0]] = [first._replace(rider=first.rider or name), *rest]
        else:
            del drawing.links[name]
            drawing.note(f"{name} has one connector, {points[0]}: left out")
    for sentence in root.unread(LOOKS):
        drawing.note(sentence)
    return drawing


def _ratios(root: Record, where: str, drawing: Drawing) -> None:
    """Gear pairs and chains between links, their sizes as they are written."""
    for k, raw in enumerate(root.below("ratios"), 1):
        kind = raw.get("type", "gears")
        at, name = f"{where}, ratio {k}", f"{kind}_{k}"
        ends = raw.all("link")
        links = [f"link_{end.get('id')}" for end in ends]
        if len(links) != 2 or any(link not in drawing.links for link in links):
            drawing.note(f"{name} joins {listed(links) or 'no links'}: left out")
            continue
        first, second = (number(end.get("size"), at, 1.0) for end in ends)
        if not min(first, second) > 0:
            raise wrong(at, f"sizes {first:g} and {second:g}", "sizes above 0")
        drawing.wheels.append(Wheels(name, links[0], links[1], (first, second), kind == "chain"))


def _is(raw: Record, word: str) -> bool:
    return raw.get(word) == "true"


def _connector(
    raw: Record, where: str, scale: float, drawing: Drawing, slides: list[Slide]
) -> None:
    key = str(raw.get("id"))
    at = f"{where}, connector {key}"
    if key in drawing.points:
        raise wrong(at, "there are two of this number")
    if raw.get("layer") == "16":
        drawing.note(f"connector {key} is on the drawing layer: left out")
        return
    x, y = number(raw.get("x"), at), number(raw.get("y"), at)
    drawing.points[key] = complex(x, y) * scale
    if _is(raw, "anchor"):
        drawing.fixed.add(key)
    if _is(raw, "input"):
        drawing.drives[key] = Drive(-number(raw.get("rpm"), at, 15.0) * RPM)
    if _is(raw, "slider"):
        limits = [str(x.get("id")) for x in raw.all("slidelimit")]
        slides.append(Slide(key, limits, number(raw.get("slideradius"), at, 0.0) * scale))
    if raw.get("fasten") or raw.all("fastened"):
        drawing.note(f"connector {key} is fastened to another: left out")


def _link(raw: Record, where: str, scale: float, drawing: Drawing) -> None:
    points = [str(x.get("id")) for x in raw.all("connector")]
    points = [p for p in dict.fromkeys(points) if p in drawing.points]
    name = numbered_name(f"link_{raw.get('id')}", drawing.links)
    if raw.all("fastenconnector", "fastenlink"):
        drawing.note(f"{name} is fastened to another part: that was left out")
    if _is(raw, "actuator") and len(points) == 2:
        _actuator(raw, name, points, scale, f"{where}, {name}", drawing)
    elif points:
        drawing.links[name] = points


def _actuator(
    raw: Record, name: str, points: list[str], scale: float, where: str, drawing: Drawing
) -> None:
    """Barrel and rod, each with one of the points; their slide is driven."""
    a, b = (drawing.points[p] for p in points)
    angle, length = direction(a, b, where), abs(b - a)
    throw = number(raw.get("throw"), where, length / 2) * scale
    rate = 2 * throw * number(raw.get("cpm"), where, 1.0) / 60
    barrel, rod = f"{name}_barrel", f"{name}_rod"
    drawing.links[barrel], drawing.links[rod] = [points[0]], [points[1]]
    drive = Drive(rate or throw, length, length + throw)
    drawing.pairs.append(Pair(barrel, rod, a, angle, drive, b))
    drawing.note(f"{name} is an actuator: its stroke is driven once, at a constant rate")


def _slot(slide: Slide, drawing: Drawing, where: str) -> None:
    key, limits = slide.key, slide.limits
    at = f"{where}, connector {key}"
    if len(limits) != 2 or any(p not in drawing.points for p in limits):
        raise wrong(at, "its slide has no two limits", "two slidelimit elements")
    a, b = (drawing.points[p] for p in limits)
    unit = cmath.rect(1.0, direction(a, b, at))
    on = drawing.link_of(limits)
    if on is None:
        drawing.note(f"connector {key} slides between points of two links: left out as a slide")
        return
    members = [name for name, points in drawing.links.items() if key in points]
    if on != FRAME and members == [on]:
        drawing.note(f"connector {key} slides in its own link: left out as a slide")
        return
    position = drawing.points[key]
    if slide.radius:
        half = abs(b - a) / 2
        radius = max(abs(slide.radius), half + ROOM)
        side = 1j * unit * math.copysign(math.sqrt(radius**2 - half**2), slide.radius)
        ends = [(a + b) / 2 + side, (a + b) / 2 - side]
        centre = min(ends, key=lambda c: round(abs(abs(position - c) - radius) / radius, 6))
        drawing.points[key] = centre + (position - centre) / abs(position - centre) * radius
        _arm(key, centre, on, members, drawing)
        return
    off = ((position - a) * unit.conjugate()).imag
    drawing.points[key] -= 1j * unit * off  # drawn on the line to a pixel
    drawing.slots[key] = [Slot(cmath.phase(unit), on)]


def _arm(key: str, centre: complex, on: str, members: list[str], drawing: Drawing) -> None:
    """What holds a connector at its distance from the centre of its arc.

    A link of its own; where a link has slid on the same arc already, that link turns about it.
    """
    same = abs(centre - drawing.points[key]) * 1e-6
    for name in members:
        for arm_end in [p for p in drawing.links[name] if f"arm_{p}" in drawing.links]:
            point = f"centre_{arm_end}"
            if abs(drawing.points[point] - centre) < same:
                del drawing.links[f"arm_{arm_end}"]
                drawing.links[name].append(point)
                drawing.note(
                    f"{name} slides along one arc at {arm_end} and {key}: it turns about {point}"
                )
                return
        if any(p.startswith("centre_") for p in drawing.links[name]):
            return
    point = f"centre_{key}"
    drawing.points[point] = centre
    if on == FRAME:
        drawing.fixed.add(point)
    else:
        drawing.links[on].append(point)
    drawing.links[f"arm_{key}"] = [point, key]
    drawing.note(f"connector {key} slides on an arc: a link without mass turns about its centre")


READER = Reader(
    "Linkage: connectors and links as XML",
    (".linkage2",),
    lambda text: "<linkage2" in text[:2000],
    read,
)
