"""The format ``page``: one HTML file with drawing, motion, curves and sliders, without a server.

The page also opens links, ``#doc=`` with the same contents deflated, of any other mechanism.

What is drawn follows the numbers: links are outlines through their markers, whose places the
page works out itself. Rails, wheels and blocks lie in the frames of their links.
"""

from __future__ import annotations

import base64
import functools
import hashlib
import html
import itertools
import json
import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

import numpy as np

from blockmech.compiled import Compiled
from blockmech.draw.boxes import graph_of
from blockmech.draw.motion import Motion, effort_names, moves
from blockmech.draw.sketch import Sketch, sketch_of
from blockmech.engines.nodes import Node
from blockmech.engines.numpy import leaves
from blockmech.exchange.c.program import identifier, poses
from blockmech.exchange.c.statements import Statements
from blockmech.exchange.formats import Order, Writer
from blockmech.exchange.page.script import SCRIPT, WEB, Recorded, Script, Tape, compacted
from blockmech.figures.curves import abscissa
from blockmech.figures.palette import LINK_FILLS
from blockmech.ground.errors import refused
from blockmech.ground.files import refuse_spared, writing
from blockmech.ground.runnable import EVERYTHING
from blockmech.ground.tolerances import BLUR
from blockmech.ground.units import shown_in
from blockmech.model.parameters import Parameter, named, parameters_of
from blockmech.model.spots import Spot, marker_place
from blockmech.model.structure import LinkRef
from blockmech.result.quality import WORDS
from blockmech.result.samples import DEFAULT_SAMPLES, Samples
from blockmech.studies.differentiate import without_derivative
from blockmech.studies.family import parameters
from blockmech.studies.variation import Variation, designed
from blockmech.typing import Array, Data, Vectors

FRAMES = DEFAULT_SAMPLES // 2 + 1  # poses of the range: every other one
SECONDS = 3.0  # that a range or a turn is played
FEW = 3  # sliders where none are asked for
FITTED = ("dimensions", "value"), ("joints", "at"), ("links", "markers")
"""Sections and keys of numbers that go through the fit of a drawing to its dimensions."""
IMPORT = re.compile(r'^import \{(.*)\} from "([./\w]+)\.js";$', re.M)


class Link(NamedTuple):
    """What a page or a link holds.

    document : the text of its file
    file : a name for it
    page : programs that move it without Python, see `contents_of`; None where it does not move
    why : it does not
    """

    document: str
    file: str
    page: Data | None
    why: str = ""


def write_page(order: Order, path: Path) -> list[Path]:
    """One page; ``slider`` names the numbers that have a slider when it is opened."""
    contents = contents_of(order)
    document = order.mechanism.document.to_json() if order.mechanism.document else ""
    link = Link(document, f"{path.stem}.json", contents)._asdict()
    script = bundle(WEB / "viewer.js")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    page = Template((WEB / "viewer.html").read_text("utf-8")).substitute(
        title=html.escape(contents["title"]),
        hash=digest,
        contents=embeddable(link),
        script=script,
    )
    refuse_spared(path)
    with writing(path) as stream:
        stream.write(page.encode())
    return [path]


def contents_of(order: Order) -> Data:
    """Programs, numbers, samples and shapes, as `viewer.js` reads them."""
    variation, tape, chosen = _varied(order)
    mechanism, samples = variation.base, samples_of(order)
    curves = Script(variation.general, requested_outputs(order), **order.settings)
    motion = moves(mechanism)
    sketch = sketch_of(motion)
    efforts = {
        load.name: effort_names(mechanism.structure, load.name)
        for load in sketch.loads
        if not load.is_passive and motion.efforts[load.name] is not None
    }
    want = ["*.angle", "*.p", *itertools.chain.from_iterable(efforts.values())]
    drawing = Script(variation.general._of_blocks, want)
    numbers = [m.name for m in curves.parameters if not m.is_array]
    offered = [x for x in numbers if not (x.startswith("size_") or x.endswith("_branch"))]
    axis = abscissa(mechanism._answer(samples, (), {"friction": None, "static": False}))
    return {
        **_picture(drawing, motion, sketch, efforts),
        "title": getattr(mechanism.document, "title", "") or mechanism.name,
        "n": samples.n,
        "curves": _part(curves, mechanism),
        "drawing": _part(drawing, mechanism),
        "sliders": _sliders(variation, tape, chosen, {"curves": curves, "drawing": drawing}),
        "columns": _columns(curves, samples) | _columns(drawing, samples),
        "along": {"words": axis.words, "values": _column(axis.values)},
        "reasons": WORDS,
        "offered": offered,
        "chosen": offered[: FEW * (order.options.get("slider") is None)],
        "seconds": SECONDS,
        "length": shown_in("m", order.computed._display if order.computed else ())[1],
    }


def _part(script: Script, mechanism: Compiled) -> Data:
    """A program with its numbers of a mechanism."""
    units, names = _units(script.mechanism), script.mechanism.names
    values = iter(leaves(script.plan.program.values(mechanism.structure, mechanism.scene)))
    links = {identifier(str(x)): name for x, name in names.of_links.items()} if names else {}

    def label(name: str) -> str:
        """A number with the document's names of links."""
        text = functools.reduce(lambda text, link: text.replace(*link), links.items(), name)
        return text.removeprefix("P_").replace("_", " ")

    return {
        "program": script.compact(),
        "parameters": [
            {
                "name": m.name,
                "label": label(m.name),
                "unit": units.get(m.name) or units.get(m.name.partition("_")[0], ""),
                "numbers": [*itertools.islice(values, len(m.numbers))],
            }
            for m in script.parameters
        ],
        "inputs": [m.name for m in script.inputs],
        "outputs": [{"name": n, "unit": script.unit_of(n)} for n in script.outputs],
    }


def _units(mechanism: Compiled) -> dict[str, str]:
    """Units of a block's numbers by their names in C, of others by the first word."""
    numbers = parameters_of(graph_of(mechanism).sections()).values()
    units = {f"P_{identifier(p.address)}": p.unit for p in numbers}
    letters = {"at": "m", mechanism.structure.frame: "m", "gravity": "m/s2"}
    return units | letters | {"m": "kg", "J": "kg m2"}


def _columns(script: Script, samples: Samples) -> Data:
    """The inputs at the samples, by name."""
    rows = np.array(script.rows(samples))
    return {m.name: _column(x) for m, x in zip(script.inputs, rows.T, strict=True)}


def _column(values: Array) -> Any:
    """Numbers; of equal steps the ends."""
    first, last = float(values[0]), float(values[-1])
    if np.array_equal(values, np.linspace(first, last, len(values))):
        return {"from": first, "to": last}
    return [float(x) for x in values]


def embeddable(data: Data) -> str:
    """JSON that ends no script element, and that JavaScript reads as it is."""
    text = json.dumps(data, allow_nan=False, ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def bundle(entry: Path) -> str:
    """A module with all that it imports as one text, each a function that returns its exports."""
    modules: dict[str, str] = {}

    def add(path: Path) -> None:
        text = path.read_text("utf-8")
        for _, name in IMPORT.findall(text):
            if Path(name).name not in modules:
                add(path.parent / f"{name}.js")
        modules[path.stem] = _module(path.stem, text)

    add(entry)
    return "".join(['"use strict";\n', *modules.values()])


def _module(name: str, text: str) -> str:
    text = IMPORT.sub(lambda match: f"const {{{match[1]}}} = ${Path(match[2]).name};", text)
    exported = re.findall(r"^export (?:async )?(?:const|function|class) (\w+)", text, re.M)
    listed_last = re.search(r"^export (\{.*\});\n", text, re.M)
    exports = listed_last[1] if listed_last else f"{{ {', '.join(exported)} }}"
    body = re.sub(r"^export (?:\{.*\};\n)?", "", text, flags=re.M)
    return f"const ${name} = (() => {{\n{body}return {exports};\n}})();\n"


def requested_outputs(order: Order) -> tuple[str, ...]:
    """What the order wants, or where it says nothing what moves the drivers."""
    if tuple(order.want) != EVERYTHING:
        return tuple(order.want)
    outputs = order.mechanism.outputs
    drives = (order.mechanism._of_driver(d, "drive") for d in order.mechanism.drivers)
    return tuple(name for name in drives if name in outputs)


def samples_of(order: Order) -> Samples:
    """The poses of the order, or where it says nothing those of the laws, or of a turn."""
    return order.samples() or poses(order.mechanism, FRAMES)


def _varied(order: Order) -> tuple[Variation, Tape, list[Parameter]]:
    """The mechanism whose numbers follow those with a slider.

    Raises `RequestError` for addresses of nothing, and for numbers that no formula follows.
    """
    words = filter(None, map(str.strip, (order.options.get("slider") or "").split(",")))
    chosen, tape = list(named(parameters(order.mechanism), dict.fromkeys(words))), Tape()
    dimensioned = bool(getattr(order.mechanism.document, "dimensions", {}))
    for p in chosen:
        why, remedy = without_derivative(p), ""
        if dimensioned and not why and (p.path[0], *p.path[2:3]) in FITTED:
            why, remedy = "a page fits no drawing to its dimensions", "take the dimensions out"
        if why:
            raise refused(f"slider.{p.address}", why, remedy)
    return Variation.of(order.mechanism, chosen, tape.varied), tape, chosen


def _sliders(
    variation: Variation, tape: Tape, chosen: Iterable[Parameter], parts: Mapping[str, Script]
) -> Data:
    """The program of the numbers of the parts that follow those with a slider."""
    follow = {path: x.z for path, x in variation.numbers.items() if isinstance(x, Recorded)}
    design = designed(variation.base, follow)
    nodes = {
        (part, i): x
        for part, script in parts.items()
        for i, x in enumerate(leaves(script.plan.program.values(*design)))
        if isinstance(x, Node)
    }
    inputs = [f"u[{i}]" for i, _ in enumerate(chosen)]
    constants = [f"p[{i}]" for i in range(len(tape.constants))]
    statements = Statements(inputs, constants, {}, SCRIPT)
    lines = statements.text(nodes.values()).splitlines()
    ends = [f"out[{k}] = {statements.name(x)};" for k, x in enumerate(nodes.values())]
    return {
        "program": compacted([*lines, *ends]),
        "constants": [*tape.constants],
        "numbers": [
            {"name": p.address, "label": p.address, "unit": p.unit or "–", "numbers": [p.value]}
            for p in chosen
        ],
        "targets": [*nodes],
    }


def _picture(
    drawing: Script, motion: Motion, sketch: Sketch, efforts: Mapping[str, list[str]]
) -> Data:
    """What is drawn: places are outputs of the drawing, or lie in the frame of a link."""
    at, s = {name: i for i, name in enumerate(drawing.outputs)}, motion.structure
    motion = motion.only(motion.feasible)
    markers = [m for block in (s.frame, *s.blocks) for m in s.markers(block)]
    markers_at = {
        f"{m}.p.x": motion.at(m.on, marker_place(s, m)) for m in markers if f"{m}.p.x" in at
    }
    size = max(float(np.abs(z).max()) for z in markers_at.values()) or 1.0
    pins = {pin.names: motion.at(*pin.spot) for pin in sketch.pins}

    def output(positions: Vectors) -> int | None:
        """The first marker that is always at some places (n,)."""
        same = (x for x, z in markers_at.items() if np.abs(z - positions).max() <= BLUR * size)
        return next((at[name] for name in same), None)

    def frame(link: LinkRef) -> list[int] | None:
        return None if link.block == s.frame else [at[f"{link}.p.x"], at[f"{link}.angle"]]

    def end(link: LinkRef, z: complex) -> Any:
        """A corner of a link: a pin that goes with it, or a place in its frame."""
        positions = motion.at(link, z)
        pinned = any(np.abs(positions - pin).max() <= BLUR * size for pin in pins.values())
        marker = output(positions) if pinned else None
        return {"link": frame(link), "at": [z.real, z.imag]} if marker is None else marker

    def arrow(spot: Spot, effort: str, couple: bool) -> Data:
        """A force at its place, or a couple amid its link."""
        position = end(*(middles.get(spot.link, spot) if couple else spot))
        return {"at": position, "value": at[effort if couple else f"{effort}.x"], "couple": couple}

    middles = {body.link: body.middle for body in sketch.bodies}
    sliders = [x for x in sketch.sliders if not x.inside]
    spots = [(name, pin.spot) for pin in sketch.pins for name in pin.names]
    spots += [(x.name, x.point) for x in sketch.sliders]
    spots += [(body.name, body.middle) for body in sketch.bodies if body.name]
    names: dict[str, Data] = {}  # those of one place beside each other
    for name, spot in spots:
        position = end(*spot)
        names.setdefault(json.dumps(position), {"at": position, "names": []})["names"].append(name)
    return {
        "names": list(names.values()),
        "pins": [{"at": output(pins[x.names]), "ground": x.grounded} for x in sketch.pins],
        "bodies": [
            {
                "ends": [end(body.link, z) for z in body.outline],
                "fill": LINK_FILLS[(body.number - 1) % len(LINK_FILLS)],
            }
            for body in sketch.bodies
        ],
        "rails": [
            {"link": frame(x.guide.link), "ends": [_pair(x.end(k)) for k in (0, 1)]}
            for x in sliders
        ],
        "blocks": [
            {
                "at": end(*x.point),
                "link": frame(x.guide.link),
                "turn": math.atan2(x.direction.imag, x.direction.real),
            }
            for x in sliders
        ],
        "wheels": [
            {"link": frame(wheel.link), "points": [_pair(z) for z in wheel.points]}
            for wheel in sketch.wheels
        ],
        "loads": [
            {
                "name": x.name,
                "ends": [end(*spot) for spot in x.spots],
                "line": x.line().tolist(),
                "arrows": [
                    arrow(spot, effort, x.unit != "N")
                    for spot, effort in zip(x.spots, efforts.get(x.name, ()), strict=False)
                ],
            }
            for x in sketch.loads
        ],
    }


def _pair(z: complex) -> list[float]:
    """A place of a shape, in which a billionth is not seen."""
    return [float(f"{x:.9g}") for x in (z.real, z.imag)]


WRITER = Writer(
    "one HTML page without a server: drawing, motion, curves, sliders for numbers",
    (".html",),
    write_page,
    {"slider": "parameters with a slider, e.g. links.rod.mass,joints.A.at[0].x; by default a few"},
)
