"""What the page computes itself: poses, and the numbers that follow when a pin is dragged.

Two functions of a document are traced and sent as a module of JavaScript. ``poses`` is the plan:
from the numbers of the blocks and the coordinates of the drivers to the places of links.
``numbers`` is the way from the places of pins in the drawing to these numbers: what `moved` makes
of a form, the decomposition, and the formulas of the plan. Nothing is folded in, so that texts
depend on the structure alone and are named by their hash.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from blockmech.builders import Graph, Linkage
from blockmech.compiled import Compiled
from blockmech.editor import sketching
from blockmech.editor.pins import pins_of, standing_at
from blockmech.engines.nodes import Node, Untraceable
from blockmech.engines.numpy import Planar, leaves
from blockmech.engines.trace import PRIMITIVES, angle, expi, sqrt
from blockmech.exchange.c.statements import Statements
from blockmech.exchange.page.script import SCRIPT, Script, numbers
from blockmech.ground.errors import BlockmechError
from blockmech.ground.plane import primitives_of
from blockmech.model.joints.varied import Varied, settled, tangents
from blockmech.model.parameters import number_at, parameters_of
from blockmech.model.spots import marker_place
from blockmech.model.structure import Structure
from blockmech.studies.variation import designed, planned_near
from blockmech.typing import Data, Record

LARGEST = 300_000  # letters of a module; longer ones stay on the server, which then has the poses
KEPT = 64  # modules
FAST = """const { sin, cos, atan2 } = Math;
const hypot = (x, y) => Math.sqrt(x * x + y * y);
"""  # a browser's own functions: 30 times as fast as exact ones, and within 2e-15 of them


class Tape:
    """A trace of plain arithmetic: `Node` writes each operation down once."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.constants: dict[float, Node] = {}
        self._made: dict[Any, Node] = {}

    def node(self, op: str, *args: Any) -> Node:
        """An operation; numbers but 0 and 1 are constants, which are no part of a text."""
        operands = tuple(x if isinstance(x, Node) else self._constant(x) for x in args)
        key = (op, *(x.number if isinstance(x, Node) else repr(x) for x in operands))
        if key not in self._made:
            self._made[key] = Node(self, op, operands, 0)
        return self._made[key]

    def _constant(self, x: float) -> Any:
        if abs(x) in (0.0, 1.0) or not math.isfinite(x):
            return float(x)
        if x not in self.constants:
            self.constants[x] = Node(self, "parameter", (len(self.constants),), 0)
        return self.constants[x]

    def input(self, i: int) -> Node:
        """One of the numbers that it is a function of."""
        return Node(self, "input", (i,), 0)


@primitives_of.register(Node)
def _of_nodes(x: object) -> Record:
    return {**PRIMITIVES, "hypot": lambda a, b: sqrt(a * a + b * b)}


class Recorded(Varied):
    """A number with derivatives that also writes down how it came about: ``z`` on a `Tape`.

    Derivatives decide what stays equal; real numbers are nodes, vectors pairs of them.
    """

    z: Any

    @classmethod
    def of(cls, x: complex, z: Any) -> Recorded:
        """A varied number whose parts on the tape are ``z``."""
        number: Any = cls.__new__(cls, complex(x), tangents(x))
        number.z = z
        recorded: Recorded = number
        return recorded

    def __add__(self, x: complex) -> Recorded:
        a, b = _parts(self), _parts(x)
        return Recorded.of(Varied.__add__(self, x), _pair(_sum(a[0], b[0]), _sum(a[1], b[1])))

    __radd__ = __add__

    def __neg__(self) -> Recorded:
        return Recorded.of(Varied.__neg__(self), _pair(*(-x for x in _parts(self))))

    def __sub__(self, subtrahend: complex) -> Recorded:
        a, b = _parts(self), _parts(subtrahend)
        z = _pair(*(_sum(x, -y) if not _nought(y) else x for x, y in zip(a, b, strict=True)))
        return Recorded.of(Varied.__sub__(self, subtrahend), z)

    def __rsub__(self, x: complex) -> Recorded:
        return -self + x

    def __mul__(self, x: complex) -> Recorded:
        (a, b), (c, d) = _parts(self), _parts(x)
        z = _pair(_sum(_by(a, c), -_by(b, d)), _sum(_by(a, d), _by(b, c)))
        return Recorded.of(Varied.__mul__(self, x), z)

    __rmul__ = __mul__

    def __truediv__(self, x: complex) -> Recorded:
        return Recorded.of(Varied.__truediv__(self, x), _quotient(self, x))

    def __rtruediv__(self, x: complex) -> Recorded:
        return Recorded.of(Varied(x, 0.0 * self.d) / self, _quotient(x, self))

    def __abs__(self) -> Recorded:  # type: ignore[override]
        x, y = _parts(self)
        z = abs(x) if _nought(y) else sqrt(x * x + y * y)
        return Recorded.of(Varied.__abs__(self), z)

    def conjugate(self) -> Recorded:
        """x - iy."""
        x, y = _parts(self)
        return Recorded.of(Varied.conjugate(self), _pair(x, -y))

    @property
    def real(self) -> Recorded:  # type: ignore[override]
        """x."""
        return Recorded.of(Varied.real.fget(self), _parts(self)[0])  # type: ignore[attr-defined]

    @property
    def imag(self) -> Recorded:  # type: ignore[override]
        """y."""
        return Recorded.of(Varied.imag.fget(self), _parts(self)[1])  # type: ignore[attr-defined]

    __hash__ = Varied.__hash__

    def __deepcopy__(self, memo: Any) -> Recorded:
        """Itself: a number does not change, and its tape is one."""
        return self


@primitives_of.register(Recorded)
def _of_recorded(x: object) -> Record:
    plain = primitives_of.dispatch(Varied)(x)

    def planar(a: complex, b: complex) -> Recorded:
        return Recorded.of(plain["planar"](a, b), _pair(_parts(a)[0], _parts(b)[0]))

    def turned(t: complex) -> Recorded:
        return Recorded.of(plain["expi"](t), expi(_parts(t)[0]))

    def between(a: complex, b: complex) -> Recorded:
        return Recorded.of(plain["angle"](a, b), angle(Planar(*_parts(a)), Planar(*_parts(b))))

    return {"planar": planar, "expi": turned, "angle": between}


def _parts(x: Any) -> tuple[Any, Any]:
    """x and y of a number: nodes, or numbers where they are constant."""
    z = x.z if isinstance(x, Recorded) else x
    return z.real, z.imag


def _pair(x: Any, y: Any) -> Any:
    return x if _nought(y) else Planar(x, y)


def _nought(x: Any) -> bool:
    return not isinstance(x, Node) and x == 0


def _sum(x: Any, y: Any) -> Any:
    return y if _nought(x) else x if _nought(y) else x + y


def _by(x: Any, y: Any) -> Any:
    return 0.0 if _nought(x) or _nought(y) else x * y


def _quotient(x: Any, y: Any) -> Any:
    (a, b), (c, d) = _parts(x), _parts(y)
    if _nought(d):
        return _pair(a / c, 0.0 if _nought(b) else b / c)
    size = _sum(_by(c, c), _by(d, d))
    up = _sum(_by(a, c), _by(b, d)), _sum(_by(b, c), -_by(a, d))
    return _pair(*(0.0 if _nought(part) else part / size for part in up))


# -- a document that is live ---------------------------------------------------------------


@dataclass(frozen=True)
class Live:
    """What the page needs to move a mechanism.

    Attributes
    ----------
    script : the plan: places and angles of links
    links : name of a link as it is drawn -> place among the outputs, -1 for the fixed one
    values : the numbers of the plan, then of each link its seat in the frame of the block's link
    text : of the module
    pins : pins that can be dragged live, by the number of their place
    constants : what ``numbers`` is told beside the places
    """

    script: Script
    links: Mapping[str, int]
    values: tuple[float, ...]
    text: str
    pins: Mapping[str, int] = field(default_factory=dict)
    constants: tuple[float, ...] = ()

    def data(self) -> Data:
        """As the page gets it."""
        return {
            "hash": remember(self.text),
            "p": list(self.values),
            "c": list(self.constants),
            "links": dict(self.links),
            "seated": len(self.values) > sum(len(x.numbers) for x in self.script.parameters),
            "drivers": list(self.script.mechanism.drivers),
            "places": len(self.script.outputs),
            "pins": dict(self.pins),
            "inputs": list(self.script.plan.program.inputs),
        }


_TEXTS: dict[str, str] = {}


def remember(text: str) -> str:
    """The name of a module's text, which is kept for who asks for it."""
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    _TEXTS.pop(name, None)
    _TEXTS[name] = text
    while len(_TEXTS) > KEPT:
        del _TEXTS[next(iter(_TEXTS))]
    return name


def module(name: str) -> str | None:
    """The text of a module, None where it is forgotten."""
    return _TEXTS.get(name)


def live(document: Any, mechanism: Compiled) -> Live | None:
    """The functions of a document; None where its plan is more than arithmetic, or too long."""
    try:
        if isinstance(document, Linkage):
            try:
                return _of_links(document, mechanism, drags=not document.dimensions)
            except (BlockmechError, Untraceable, ZeroDivisionError):
                return _of_links(document, mechanism, drags=False)
        script = _script(mechanism._of_blocks)
        links = _links_of(mechanism.structure)
        return _small(Live(script, links, tuple(script.values), _module(script)))
    except (BlockmechError, Untraceable):
        return None


def _small(candidate: Live) -> Live | None:
    return candidate if len(candidate.text) < LARGEST else None


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


def _of_links(document: Linkage, mechanism: Compiled, drags: bool = True) -> Live | None:
    """Of links and joints: links are named as there, and their frames are seats on blocks."""
    tape, form = Tape(), document.to_data()
    pins = pins_of(form)
    at = dict[str, int]()
    for name in pins if drags else ():
        if name not in at:
            number = len({*at.values()})
            at |= dict.fromkeys((name, *standing_at(pins, name)), number)
    seeds = np.eye(2 * len({*at.values()}))
    positions = dict[str, Any]()
    for name, i in at.items():
        d = seeds[2 * i] + 1j * seeds[2 * i + 1]
        z = Planar(tape.input(2 * i), tape.input(2 * i + 1))
        positions[name] = next(
            (positions[n] for n, k in at.items() if k == i and n in positions), None
        )
        if positions[name] is None:
            positions[name] = Recorded.of(Varied(pins[name].z, d), z)
    varied = dict[Any, Recorded]()
    if positions:
        changed = sketching.moved(form, positions)
        for p in parameters_of(document.sections()).values():
            x = number_at(changed, p.path)
            if isinstance(x, Recorded) and x.d.any():
                varied[p.path] = x
    decomposition = (document.with_numbers(varied) if varied else document).decompose()
    graph = Graph.from_data(settled(decomposition.data))
    followed = {
        p.path: x
        for p in parameters_of(graph.sections()).values()
        if isinstance(x := number_at(decomposition.data, p.path), Recorded) and x.d.any()
    }
    base = planned_near(type(mechanism)._from_graph(graph)._of_blocks, settled(followed))
    script, names = _script(base), decomposition.names
    traced = {path: x.z for path, x in followed.items()}
    nodes, values = (
        [*leaves(script.plan.program.values(*of)), *_seats(names, of[0], on_tape)]
        for on_tape, of in (
            (True, designed(base, traced)),
            (False, designed(base, settled(followed))),
        )
    )
    links_at = _links_of(base.structure)
    links = {"frame": -1} | {
        name: links_at[str(at.link)] for name, at in names.links.items() if name != "frame"
    }
    follows = any(isinstance(x, Node) for x in nodes)
    text = _module(script) + (_numbers(tape, nodes) if follows else "")
    numbers_now = tuple(float(x) for x in values)
    moved = at if follows else {}
    return _small(Live(script, links, numbers_now, text, moved, tuple(tape.constants)))


def _seats(names: Any, s: Structure, traced: bool) -> Iterable[Any]:
    """Of each link but the fixed one, in order: its origin in the block's frame, its angle."""
    for name, link in names.links.items():
        if name != "frame":
            yield from _parts(marker_place(s, link.marker))
            yield _parts(link.turn)[0] if traced else float(complex(link.turn).real)


def _module(script: Script) -> str:
    """The plan as a module that exports ``poses(p, u, out)``."""
    text = script.text("poses").replace("function poses", "export function poses")
    return FAST + numbers()[numbers().index("function rest(") :] + text


def _numbers(tape: Tape, nodes: list[Any]) -> str:
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
