"""What the page computes itself: poses, and the numbers that follow when a pin is dragged.

Two functions of a document are traced and sent as a module of JavaScript. ``poses`` is the plan:
from the numbers of the blocks and the coordinates of the drivers to the places of links.
``numbers`` is the way to these numbers from the places of pins in the drawing (what `moved` makes
of a form, the decomposition, and the formulas of the plan), or of blocks from the place of the
joint that is held (what `dragged` makes of a form). Nothing is folded in, so that texts depend on
the structure alone and are named by their hash.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from blockmech.builders import Graph, Linkage
from blockmech.compiled import Compiled
from blockmech.editor import sketching
from blockmech.editor.dragging import Hold, dragged
from blockmech.editor.fields import DIGITS
from blockmech.editor.pins import pins_of, standing_at
from blockmech.editor.revision import Revision
from blockmech.engines.nodes import Node, Untraceable
from blockmech.engines.numpy import leaves
from blockmech.exchange.c.statements import Statements
from blockmech.exchange.page.script import SCRIPT, Recorded, Script, Tape, numbers
from blockmech.ground.errors import BlockmechError
from blockmech.ground.memory import Recent
from blockmech.model.joints.contents import FRAME
from blockmech.model.joints.varied import Varied, settled, tangents
from blockmech.model.parameters import number_at, parameters_of
from blockmech.model.spots import marker_place
from blockmech.model.structure import Structure
from blockmech.result.samples import DEFAULT_SAMPLES
from blockmech.studies.variation import designed, planned_near
from blockmech.typing import Data, Real, Record

NUMBER = DIGITS + 3  # letters of a number in JSON: digits, sign, point and comma
FAST = """const { sin, cos, atan2 } = Math;
const hypot = (x, y) => Math.sqrt(x * x + y * y);
"""  # a browser's own functions: 30 times as fast as exact ones, and within 2e-15 of them


@dataclass(frozen=True)
class Live:
    """What the page needs to move a mechanism.

    Attributes
    ----------
    script : the plan: places and angles of links
    links : name of a link as it is drawn -> place among the outputs, -1 for the fixed one
    values : the numbers of the plan; then, of links and joints, of each link but the fixed one its
        seat [m, m, rad] in the frame of the block's link, of a joint of blocks that is held the
        drivers' coordinates, what stays positive as long as no dyad turns over, and ``spots``
    text : of the module
    pins : pins that can be dragged live, by the number of their place
    constants : what ``numbers`` is told beside the places
    spots : of blocks, handles by name, and the links in whose frames their places are
    """

    script: Script
    links: Mapping[str, int]
    values: tuple[float, ...]
    text: str
    pins: Mapping[str, int] = field(default_factory=dict)
    constants: tuple[float, ...] = ()
    spots: Mapping[str, str] = field(default_factory=dict)

    def data(self) -> Data:
        """As the page gets it."""
        return {
            "hash": remember(self.text),
            "p": list(self.values),
            "c": list(self.constants),
            "links": dict(self.links),
            "numbers": sum(len(x.numbers) for x in self.script.parameters),
            "drivers": list(self.script.mechanism.drivers),
            "places": len(self.script.outputs),
            "pins": dict(self.pins),
            "spots": dict(self.spots),
            "inputs": list(self.script.plan.program.inputs),
        }


_TEXTS = Recent[str, str]()


def remember(text: str) -> str:
    """The name of a module's text, which is kept for who asks for it."""
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    _TEXTS.renew(name, text)
    return name


def module(name: str) -> str | None:
    """The text of a module, None where it is forgotten."""
    return _TEXTS.get(name)


def live(now: Revision, mechanism: Compiled, hold: tuple[str, Record] | None = None) -> Live | None:
    """The functions of a document; None where its plan is more than arithmetic.

    None also where they are longer than the poses of a motion, which are then sent instead.

    Of links and joints those of all pins at once, of blocks those of a joint that is held at
    coordinates of the drivers.
    """
    document = now.document
    fixed = document.dimensions if isinstance(document, Linkage) else hold is None
    for drags in (False,) if fixed else (True, False):
        with suppress(BlockmechError, Untraceable, ZeroDivisionError):
            if isinstance(document, Linkage):
                return _live_linkage(now, mechanism, drags)
            return _of_blocks(now, mechanism, hold if drags else None)
    return None


def _short(candidate: Live) -> Live | None:
    poses = 3 * NUMBER * DEFAULT_SAMPLES * len(candidate.links)
    return candidate if len(candidate.text) < poses else None


def _script(mechanism: Compiled) -> Script:
    fixed = mechanism.structure.frame_link
    moving = [link for link in mechanism.structure.links if link != fixed]
    script = Script(mechanism, [f"{link}.{part}" for link in moving for part in ("p", "angle")])
    free_inputs = [x for x in script.plan.program.inputs if not x.startswith("q_")]
    if free_inputs:
        raise Untraceable("poses follow more than coordinates")
    return script


def _links_of(s: Structure) -> dict[str, int]:
    """Links by name, with where their x, y and angle are among the outputs."""
    moving = [link for link in s.links if link != s.frame_link]
    return {str(s.frame_link): -1} | {str(link): 3 * k for k, link in enumerate(moving)}


def _of_blocks(now: Revision, mechanism: Compiled, hold: tuple[str, Record] | None) -> Live | None:
    """Of blocks; of a joint that is held also the pose, its sides, and the places of handles."""
    s, links = mechanism.structure, _links_of(mechanism.structure)
    if hold is None:
        script = _script(mechanism._of_blocks)
        return _short(Live(script, links, tuple(script.values), _module(script)))
    if s.followed:
        raise Untraceable("a branch that is continued through change points may lose them")
    (motion, z, handles), tape = Hold.of(now.mechanism, *hold), Tape()
    z = Recorded.of(Varied(z, np.array([1.0, 1j])), tape.input(0), tape.input(1))
    form, q, sides = dragged(now.form, motion, 0, complex(z), z)

    def extras(design: Structure) -> Iterable[Any]:
        yield from (q[driver] for driver in mechanism.drivers)
        yield from (side if side > 0 else -side for side in sides.values())
        for link, at in handles.values():
            markers = (m for m in s.markers(link.block) if m.link == link.link)
            same = [marker_place(design, m) for m in markers if marker_place(s, m) == at]
            z = max((complex(at), *same), key=lambda z: bool(np.any(tangents(z))))
            yield from (z.real, z.imag)

    graph = Graph.from_data(settled(form), (), now.document.file)
    names = {name: name for name in links}
    functions = _following(tape, mechanism, graph, form, names, {hold[0]: 0}, extras)
    spots = {name: str(spot.link) for name, spot in handles.items()}
    return functions and replace(functions, spots=spots)


def _live_linkage(now: Revision, mechanism: Compiled, drags: bool) -> Live | None:
    """Of links and joints: links are named as there, and their frames are seats on blocks."""
    tape, form, at = Tape(), now.form, dict[str, int]()
    document: Any = now.document
    pins, varied = pins_of(form), dict[Any, Recorded]()
    for name in pins if drags else ():
        if name not in at:
            at |= dict.fromkeys((name, *standing_at(pins, name)), len({*at.values()}))
    if at:
        seeds, positions = np.eye(2 * len({*at.values()})), dict[int, Recorded]()
        for name, i in at.items():
            z = Varied(pins[name].z, seeds[2 * i] + 1j * seeds[2 * i + 1])
            if i not in positions:
                positions[i] = Recorded.of(z, tape.input(2 * i), tape.input(2 * i + 1))
        changed = sketching.moved(form, {name: positions[i] for name, i in at.items()})
        varied = _numbers_that_vary(document, changed)
    decomposition = (document.with_numbers(varied) if varied else document).decompose()
    graph, data = Graph.from_data(settled(decomposition.data)), decomposition.data
    links = {name: link for name, link in decomposition.names.links.items() if name != FRAME}

    def seats(s: Structure) -> Iterable[Any]:
        """Of each link but the fixed one, in order: its origin in the block's frame, its angle."""
        for link in links.values():
            z = marker_place(s, link.marker)
            yield from (z.real, z.imag, link.turn)

    names = {name: str(link.link) for name, link in links.items()}
    return _following(tape, mechanism, graph, data, names, at, seats)


def _numbers_that_vary(document: Any, data: Data) -> dict[Any, Recorded]:
    """The numbers of a document that follow places, by their paths."""
    numbers = {p.path: number_at(data, p.path) for p in parameters_of(document.sections()).values()}
    return {path: x for path, x in numbers.items() if isinstance(x, Recorded) and x.d.any()}


def _following(
    tape: Tape,
    mechanism: Compiled,
    graph: Graph,
    data: Data,
    names: Mapping[str, str],
    pins: Mapping[str, int],
    extras: Callable[[Structure], Iterable[Any]],
) -> Live | None:
    """The functions of a graph whose numbers follow the places of pins, and others with them."""
    followed = _numbers_that_vary(graph, data)
    settled_numbers = settled(followed)
    base = planned_near(type(mechanism)._from_graph(graph)._of_blocks, settled_numbers)
    script, outputs = _script(base), _links_of(base.structure)
    links = {FRAME: -1, **{name: outputs[link] for name, link in names.items()}}
    added = list(extras(designed(base, followed)[0]))
    traced = {path: x.z for path, x in followed.items()}
    nodes, values = (
        [*leaves(script.plan.program.values(*designed(base, design))), *added]
        for design in (traced, settled_numbers)
    )
    nodes = [x.z if isinstance(x, Recorded) else x for x in nodes]
    follows = any(isinstance(x, Node) for x in nodes)
    text = _module(script) + (_numbers(tape, nodes) if follows else "")
    numbers_now = tuple(float(complex(x).real) for x in values)
    moved, constants = pins if follows else {}, tuple(tape.constants)
    return _short(Live(script, links, numbers_now, text, moved, constants))


def _module(script: Script) -> str:
    """The plan as a module that exports ``poses(p, u, out)``."""
    text = script.text("poses").replace("function poses", "export function poses")
    return FAST + numbers()[numbers().index("function rest(") :] + text


def _numbers(tape: Tape, nodes: list[Real]) -> str:
    """``numbers(x, c, p)``: writes what follows from the places x, with constants c."""
    count = 1 + max((node.args[0] for node in tape.nodes if node.op == "input"), default=0)
    inputs = [f"x[{i}]" for i in range(count)]
    constants = [f"c[{i}]" for i in range(len(tape.constants))]
    statements = Statements(inputs, constants, {}, SCRIPT)
    body = statements.text(nodes)
    ends = "".join(
        f"    p[{i}] = {statements.name(x)};\n" for i, x in enumerate(nodes) if isinstance(x, Node)
    )
    return f"export function numbers(x, c, p) {{\n{body}{ends}}}\n"
