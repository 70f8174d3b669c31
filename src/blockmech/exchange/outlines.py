"""Drawings as files: outlines of links in ``dxf`` and ``svg``, pictures and films.

Outlines are to scale, at a pose. A link is the hull of its pins, wider by half a width, with a
hole at each pin; each link has a layer of its own, lengths are millimetres. Guides are not
outlined, pins of the frame are holes. Pictures and films are those of `blockmech.draw`.

Source: Autodesk, DXF Reference R12 (LINE, ARC, CIRCLE in text); SVG 1.1.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

from blockmech.draw import KINDS, animate, draw
from blockmech.draw.sketch import hull
from blockmech.exchange.drawing import UNITS
from blockmech.exchange.formats import Order, Writer, file_writer
from blockmech.exchange.standing import Standing
from blockmech.figures.paper import MOVING, STILL
from blockmech.ground.errors import printable, refused
from blockmech.ground.names import numbered_name
from blockmech.typing import Arguments, Data

MM = 1 / UNITS["mm"]
OPTIONS = {
    "width": "of a link, e.g. 20mm; default an eighth of the longest link",
    "hole": "diameter of its holes, e.g. 5mm; default a third of the width",
}


class Line(NamedTuple):
    """From a to b [mm]."""

    a: complex
    b: complex


class Arc(NamedTuple):
    """About a centre [mm], counter-clockwise from one angle [rad] to the other."""

    centre: complex
    radius: float
    start: float
    stop: float


class Circle(NamedTuple):
    """A whole circle [mm]."""

    centre: complex
    radius: float


Shape = Line | Arc | Circle


def outlines(order: Order) -> dict[str, list[Shape]]:
    """Link -> its outline and holes [mm], in the pose of the first sample."""
    pose, positions = Standing(order), dict[str, list[complex]]()
    s = pose.structure
    for ref in pose.joints:
        if ref in pose.direction:
            continue
        for link in (s.earlier_link(ref), s.later_link(ref)):
            pins = positions.setdefault(pose.called(link), [])
            z = pose.pin(ref) * MM
            if all(abs(z - pin) > 1e-9 for pin in pins):
                pins.append(z)
    if not positions:
        raise refused("outlines", "no link has a pin to go around", "write a picture: --to picture")
    spans = [abs(a - b) for pins in positions.values() for a in pins for b in pins]
    span = (max(spans, default=0.0) or 8.0) / MM  # of links of one pin each
    width = order.positive("width", span / 8, "m", "20mm") * MM
    hole = order.positive("hole", width / MM / 3, "m", "20mm") * MM
    if not 0 < hole < width:
        raise refused("hole", f"{hole:g} mm in a link of {width:g} mm", "make it smaller")
    frame = pose.called(s.frame_link)
    shapes: dict[str, list[Shape]] = {}
    for name, pins in positions.items():
        outline: list[Shape] = [] if name == frame else list(_outline(hull(pins), width / 2))
        shapes[name] = [*outline, *(Circle(z, hole / 2) for z in pins)]
    return shapes


def _outline(corners: Sequence[complex], radius: float) -> Iterator[Shape]:
    """A hull wider by a radius: a line beside each edge, an arc about each corner."""
    if len(corners) == 1:
        yield Circle(corners[0], radius)
        return
    edges = [cmath.phase(b - a) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]
    for k, corner in enumerate(corners):
        before, after = edges[k - 1] - math.pi / 2, edges[k] - math.pi / 2
        yield Arc(corner, radius, before, before + (after - before) % math.tau)
        offset = cmath.rect(radius, after)
        yield Line(corner + offset, corners[(k + 1) % len(corners)] + offset)


# -- DXF ----------------------------------------------------------------------------------


def dxf(shapes: dict[str, list[Shape]]) -> str:
    """R12 text; a layer for each link."""
    layers = _layers(shapes)
    pairs: list[tuple[int, object]] = [
        *((0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1009")),
        *((9, "$INSUNITS"), (70, 4), (9, "$MEASUREMENT"), (70, 1), (0, "ENDSEC")),  # mm, metric
        *((0, "SECTION"), (2, "TABLES"), (0, "TABLE"), (2, "LAYER"), (70, len(layers))),
    ]
    for k, layer in enumerate(layers.values()):
        pairs += [(0, "LAYER"), (2, layer), (70, 0), (62, 1 + k % 7), (6, "CONTINUOUS")]
    pairs += [(0, "ENDTAB"), (0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES")]
    for link, outline in shapes.items():
        for shape in outline:
            pairs += _entity(shape, layers[link])
    pairs += [(0, "ENDSEC"), (0, "EOF")]
    return "".join(f"{code}\n{value}\n" for code, value in pairs)


def _entity(shape: Shape, layer: str) -> list[tuple[int, object]]:
    if isinstance(shape, Line):
        ends = [(10, shape.a.real), (20, shape.a.imag), (11, shape.b.real), (21, shape.b.imag)]
        return [(0, "LINE"), (8, layer), *((c, repr(float(x))) for c, x in ends)]
    numbers = [(10, shape.centre.real), (20, shape.centre.imag), (40, shape.radius)]
    if isinstance(shape, Arc):
        numbers += [(50, math.degrees(shape.start) % 360), (51, math.degrees(shape.stop) % 360)]
    kind = "ARC" if isinstance(shape, Arc) else "CIRCLE"
    return [(0, kind), (8, layer), *((c, repr(float(x))) for c, x in numbers)]


def _layers(shapes: dict[str, list[Shape]]) -> dict[str, str]:
    """Names that R12 takes, each once."""
    layers: dict[str, str] = {}
    for link in shapes:
        name = re.sub(r"[^A-Z0-9_$-]", "_", link.upper())[:28] or "LINK"
        layers[link] = numbered_name(name, layers.values())
    return layers


# -- SVG ----------------------------------------------------------------------------------


def svg(shapes: dict[str, list[Shape]]) -> str:
    """A picture whose units are millimetres; a group for each link."""
    everything = [shape for outline in shapes.values() for shape in outline]
    boxes = [_box(shape) for shape in everything]
    low = complex(min(a.real for a, _ in boxes), min(a.imag for a, _ in boxes)) - (1 + 1j)
    high = complex(max(b.real for _, b in boxes), max(b.imag for _, b in boxes)) + (1 + 1j)
    w, h = (high - low).real, (high - low).imag
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{w!r}mm" height="{h!r}mm"'
        f' viewBox="{low.real!r} {-high.imag!r} {w!r} {h!r}">',
        '<g fill="none" stroke="black" stroke-width="0.1">',
    ]
    for link, outline in shapes.items():
        lines.append(f"<g id={quoteattr(printable(link))}>")
        lines += map(_element, outline)
        lines.append("</g>")
    return "\n".join([*lines, "</g>", "</svg>"]) + "\n"


def _box(shape: Shape) -> tuple[complex, complex]:
    if isinstance(shape, Line):
        a, b = shape
        low = complex(min(a.real, b.real), min(a.imag, b.imag))
        return low, complex(max(a.real, b.real), max(a.imag, b.imag))
    r = complex(shape.radius, shape.radius)
    return shape.centre - r, shape.centre + r


def _element(shape: Shape) -> str:
    """In SVG y points down: places are mirrored."""

    def at(z: complex) -> str:
        return f"{z.real!r} {-z.imag!r}"

    if isinstance(shape, Line):
        return f'<path d="M {at(shape.a)} L {at(shape.b)}"/>'
    if isinstance(shape, Circle):
        x, y = shape.centre.real, -shape.centre.imag
        return f'<circle cx="{x!r}" cy="{y!r}" r="{shape.radius!r}"/>'
    a, b = (shape.centre + cmath.rect(shape.radius, t) for t in (shape.start, shape.stop))
    large, r = int(shape.stop - shape.start > math.pi), shape.radius
    return f'<path d="M {at(a)} A {r!r} {r!r} 0 {large} 0 {at(b)}"/>'


def _writer(about: str, suffix: str, text: Callable[[dict[str, list[Shape]]], str]) -> Writer:
    write = file_writer(lambda order, stream: stream.write(text(outlines(order)).encode("ascii")))
    return Writer(about, (suffix,), write, OPTIONS)


DXF = _writer("outlines of the links to scale, R12, mm", ".dxf", dxf)
SVG = _writer("outlines of the links to scale, mm", ".svg", svg)


TRACE = {"trace": "markers whose paths are drawn"}


def _coordinates(order: Order) -> Data | None:
    """Coordinates of the drivers at the poses that are asked for."""
    poses = order.samples()
    if poses is None:
        return None
    return {d: poses.coordinate(i) for i, d in enumerate(order.mechanism.drivers)}


def _trace(order: Order) -> Any:
    names = order.options.get("trace")
    return names.split(",") if isinstance(names, str) else names


def write_picture(order: Order, path: Path) -> list[Path]:
    """A picture of the kind that is asked for; curves are of the wanted outputs."""
    kind = order.options.get("kind", "mechanism")
    if kind == "curves":
        order.result().plot(path)
    else:
        takes = KINDS[kind].takes if kind in KINDS else ()
        settings: Arguments = {"want": order.want} if "want" in takes else {}
        at = _coordinates(order) if "at" in takes else None
        draw(order.mechanism, path, kind, at, trace=_trace(order), **settings)
    return [path]


def write_film(order: Order, path: Path) -> list[Path]:
    """An animation over the poses, or the range of the laws of motion."""
    animate(order.mechanism, path, _coordinates(order), trace=_trace(order))
    return [path]


PICTURE = Writer(
    "picture: the mechanism at poses, or another kind",
    tuple(s for s in STILL if s != ".svg"),
    write_picture,
    {"kind": f"curves, {', '.join(k for k in KINDS if k != 'animation')}; default mechanism"}
    | TRACE,
)
FILM = Writer("animation over poses", tuple(s for s in MOVING if s != ".html"), write_film, TRACE)
