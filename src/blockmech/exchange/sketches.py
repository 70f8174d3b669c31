"""Sketches in DXF and SVG by a convention: a layer or a group is a link, its circles are pins.

* ``frame`` or ``ground`` is the frame; every other layer with circles is a link of its name;
* circles of several layers with one centre are one pin; their size does not matter;
* a circle on the layer ``drive`` marks the pin that is driven;
* a line on the layer ``slot``, or on ``slot NAME`` for one in a link, is a slot: the pins on it
  slide along it;
* everything else is outline and has no meaning.

So an outline that `blockmech.exchange.outlines` writes comes back as the same links. In SVG the
groups have labels (Inkscape's layers) or ids; the y axis points down there, and up here.

Sources: Autodesk, DXF Reference (text, ENTITIES, ``$INSUNITS``); SVG 1.1, 7.6 (transforms).
"""

from __future__ import annotations

import cmath
import math
import re
from dataclasses import dataclass, field

from blockmech.exchange.drawing import FRAME, Drawing, Drive, Slot, direction
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import ROUNDED, Record, number, wrong, xml_of
from blockmech.ground.limits import COMPARED

INSUNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m"}
DRIVES = ("drive", "driver", "motor", "input")
LENGTH = re.compile(r"\s*([0-9.eE+-]+)\s*(mm|cm|in)\s*")
CALL = re.compile(r"\s*,?\s*([A-Za-z]+)\s*\(([^()]*)\)")


@dataclass
class Layer:
    """What is drawn of a link: centres of circles, and lines."""

    circles: list[complex] = field(default_factory=list)
    lines: list[tuple[complex, complex]] = field(default_factory=list)


def sketched(layers: dict[str, Layer], drawing: Drawing, where: str) -> Drawing:
    """The drawing of layers by the convention of this module."""
    count = sum(len(layer.circles) for layer in layers.values())
    if not count:
        raise wrong(where, "no circle is drawn on any layer", "a circle for each pin of a link")
    if count > COMPARED:
        raise wrong(where, f"{count} circles", f"at most {COMPARED}", "leave out what is no pin")
    everything = [z for layer in layers.values() for z in layer.circles]
    size = max(abs(z - everything[0]) for z in everything) or 1.0

    def pin(z: complex) -> str:
        for name, position in drawing.points.items():
            if abs(z - position) <= ROUNDED * size:
                return name
        # A, B, ... Z, A1, B1, ...
        k = len(drawing.points)
        name = chr(ord("A") + k % 26) + (str(k // 26) if k >= 26 else "")
        drawing.points[name] = z
        return name

    special: dict[str, Layer] = {}
    for name, layer in layers.items():
        word = re.split(r"[ ._-]", name.lower(), maxsplit=1)[0]
        if word in DRIVES or word == "slot":
            special[name] = layer
        elif not layer.circles:
            drawing.note(f"layer {name} has no circles: left out")
        elif word in (FRAME, "ground"):
            drawing.fixed.update(map(pin, layer.circles))
        else:
            drawing.links[name] = list(dict.fromkeys(map(pin, layer.circles)))
    for name, layer in special.items():
        if name.lower().startswith("slot"):
            _slots(name, layer, drawing, ROUNDED * size, where)
            continue
        for z in layer.circles:
            matches = [
                p for p, centre in drawing.points.items() if abs(z - centre) <= ROUNDED * size
            ]
            if matches:
                drawing.drives[matches[0]] = Drive()
            else:
                drawing.note(f"a circle on layer {name} is at no pin: left out")
    for name in [n for n, points in drawing.links.items() if len(points) < 2]:
        if not drawing.slots.keys() & set(drawing.links[name]):
            drawing.note(f"layer {name} has one pin: left out")
            del drawing.links[name]
    return drawing


def _slots(name: str, layer: Layer, drawing: Drawing, tolerance: float, where: str) -> None:
    of = re.split(r"[ ._-]", name, maxsplit=1)[1:]
    names = {link.lower(): link for link in drawing.links}
    if of and of[0].lower() not in {*names, FRAME, "ground"}:
        drawing.note(f"layer {name} is a slot of no link: left out")
        return
    on = names.get(of[0].lower(), FRAME) if of else FRAME
    for a, b in layer.lines:
        angle = direction(a, b, f"{where}, layer {name}")
        unit = cmath.rect(1.0, -angle)
        inside, members = [], drawing.fixed if on == FRAME else drawing.links[on]
        for point, z in drawing.points.items():
            if point in members:
                continue
            offset = (z - a) * unit
            inside_ends = -tolerance <= offset.real <= abs(b - a) + tolerance
            if inside_ends and abs(offset.imag) <= tolerance:
                drawing.slots.setdefault(point, []).append(Slot(angle, on))
                inside.append(point)
        if not inside:
            drawing.note(f"no pin is on a line of layer {name}: left out")


# -- DXF ------------------------------------------------------------------------------------


def read_dxf(text: str, where: str) -> Drawing:
    """The drawing of a DXF file: circles and lines of its layers."""
    lines = text.splitlines()
    pairs = [(a.strip(), b.strip()) for a, b in zip(lines[::2], lines[1::2], strict=False)]
    drawing = Drawing(where, source="DXF sketch")
    layers: dict[str, Layer] = {}
    section, variable = "", ""
    kind, values = "", dict[str, str]()
    for k, (code, value) in enumerate(pairs):
        if not re.fullmatch(r"-?\d{1,4}", code):
            raise wrong(f"{where}, line {2 * k + 1}", f'"{code[:20]}" is no group code', "DXF text")
        if code == "0":
            if section == "ENTITIES":
                _entity(kind, values, layers, drawing, where)
            kind, values = value, {}
        elif code == "2" and kind == "SECTION":
            section = value
        elif code == "9":
            variable = value
        elif section == "HEADER" and variable == "$INSUNITS" and code == "70":
            drawing.unit = INSUNITS.get(int(number(value, f"{where}, {variable}")), "")
        else:
            values.setdefault(code, value)
    return sketched(layers, drawing, where)


def _entity(
    kind: str, values: dict[str, str], layers: dict[str, Layer], drawing: Drawing, where: str
) -> None:
    at = f"{where}, {kind}"

    def point(x: str, y: str) -> complex:
        return complex(number(values.get(x), at), number(values.get(y), at))

    if kind in ("CIRCLE", "LINE"):
        layer = layers.setdefault(values.get("8", "0"), Layer())
        if kind == "CIRCLE":
            layer.circles.append(point("10", "20"))
        else:
            layer.lines.append((point("10", "20"), point("11", "21")))
    elif kind == "INSERT":
        drawing.note("blocks that are inserted: left out; explode them")


# -- SVG ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Affine:
    """z -> a z + b conj(z) + c."""

    a: complex = 1 + 0j
    b: complex = 0j
    c: complex = 0j

    def __call__(self, z: complex) -> complex:
        return self.a * z + self.b * z.conjugate() + self.c

    def after(self, m: Affine) -> Affine:
        """The map that applies another one first."""
        return Affine(
            self.a * m.a + self.b * m.b.conjugate(),
            self.a * m.b + self.b * m.a.conjugate(),
            self(m.c),
        )


def read_svg(text: str, where: str) -> Drawing:
    """The drawing of an SVG file: circles and lines of its groups."""
    root = xml_of(text, where)
    if root.tag != "svg":
        raise wrong(where, f"the root is <{root.tag}>", "<svg>")
    drawing = Drawing(where, source="SVG sketch")
    scale = 1.0
    width, box = LENGTH.fullmatch(root.get("width")), root.get("viewBox").split()
    if width and len(box) == 4:
        drawing.unit = width[2]
        scale = number(width[1], f"{where}, width") / (number(box[2], f"{where}, viewBox") or 1.0)
    layers: dict[str, Layer] = {}
    _group(root, Affine(0j, scale + 0j), "", layers, where)  # y points down there
    return sketched(layers, drawing, where)


def _group(element: Record, m: Affine, name: str, layers: dict[str, Layer], where: str) -> None:
    at = f"{where}, {element.tag}"
    m = m.after(_transform(element.get("transform"), at))

    def point(x: str, y: str) -> complex:
        return m(complex(number(element.get(x), at, 0.0), number(element.get(y), at, 0.0)))

    if element.tag == "g":
        name = element.get("inkscape:label") or element.get("id") or name
    elif element.tag in ("circle", "ellipse") and name:
        layers.setdefault(name, Layer()).circles.append(point("cx", "cy"))
    elif element.tag == "line" and name:
        layers.setdefault(name, Layer()).lines.append((point("x1", "y1"), point("x2", "y2")))
    if element.tag != "defs":
        for inner in element.inner:
            _group(inner, m, name, layers, where)


def _transform(text: str, where: str) -> Affine:
    affine, rest = Affine(), 0
    for call in CALL.finditer(text):
        numbers = [number(x, where) for x in re.split(r"[\s,]+", call[2].strip()) if x]
        step = _affine_of(call[1], numbers)
        if step is None or call.start() != rest:
            raise wrong(where, f'transform "{text[:40]}"', "matrix, translate, scale, rotate")
        affine, rest = affine.after(step), call.end()
    if text[rest:].strip():
        raise wrong(where, f'transform "{text[:40]}"', "matrix, translate, scale, rotate")
    return affine


def _affine_of(name: str, x: list[float]) -> Affine | None:
    match name, len(x):
        case "translate", 1 | 2:
            return Affine(c=complex(*x))
        case "scale", 1 | 2:
            u, v = x[0], x[-1]
            return Affine(complex((u + v) / 2), complex((u - v) / 2))
        case "rotate", 1 | 3:
            turn, about = cmath.rect(1.0, math.radians(x[0])), complex(*x[1:])
            return Affine(turn, c=about - turn * about)
        case "matrix", 6:
            i, j = complex(x[0], x[1]), complex(x[2], x[3])
            return Affine((i - 1j * j) / 2, (i + 1j * j) / 2, complex(x[4], x[5]))
    return None


DXF = Reader(
    "DXF: layers as links, circles as pins",
    (".dxf",),
    lambda text: bool(re.match(r"(\s*999\s*\n.*\n)*\s*0\s*\r?\n\s*SECTION", text[:5000])),
    read_dxf,
)
SVG = Reader(
    "SVG: groups as links, circles as pins",
    (".svg",),
    lambda text: "<svg" in text[:2000],
    read_svg,
)
