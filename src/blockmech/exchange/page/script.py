"""A plan as a JavaScript function of arrays: the statements of the C text in another language.

Sine, cosine, arc tangent and hypotenuse are worked out in twice the digits (`numbers.js`): what a
browser has of its own is not rounded as Python's, and differs from browser to browser.

Numbers of a document write down how those of programs follow them: it goes through its
decomposition with such numbers (`blockmech.model.joints.varied`), and what comes out in a program
is arithmetic of what went in.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from blockmech.engines.nodes import Node
from blockmech.engines.numpy import Planar
from blockmech.engines.trace import PRIMITIVES, angle, expi, sqrt
from blockmech.exchange.c.program import CProgram
from blockmech.exchange.c.statements import DOUBLE, Language, Statements, literal
from blockmech.ground.plane import primitives_of
from blockmech.model.joints.varied import Varied, tangents
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.typing import Array, Complex, Real, Record


class Tape:
    """A trace of plain arithmetic: `Node` writes each operation down once."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.constants: dict[float, Node] = {}
        self._made: dict[Any, Node] = {}

    def node(self, op: str, *args: Real) -> Node:
        """An operation; numbers but 0 and 1 are constants, which are no part of a text."""
        operands = tuple(x if isinstance(x, Node) else self._constant(x) for x in args)
        key = (op, *(x.number if isinstance(x, Node) else repr(x) for x in operands))
        if key not in self._made:
            self._made[key] = Node(self, op, operands, 0)
        return self._made[key]

    def _constant(self, x: float) -> Real:
        if abs(x) in (0.0, 1.0) or not math.isfinite(x):
            return float(x)
        if x not in self.constants:
            self.constants[x] = Node(self, "parameter", (len(self.constants),), 0)
        return self.constants[x]

    def input(self, i: int) -> Node:
        """One of the numbers that it is a function of."""
        return Node(self, "input", (i,), 0)

    def varied(self, value: float, seed: Array) -> Recorded:
        """The number that varies where its seed is 1."""
        return Recorded.of(Varied(value, seed), self.input(int(seed.argmax())))


@primitives_of.register(Node)
def _node_primitives(x: object) -> Record:
    return {**PRIMITIVES, "hypot": lambda a, b: sqrt(a * a + b * b)}


class Recorded(Varied):
    """A number with derivatives that also writes down how it came about: ``z`` on a `Tape`.

    Derivatives decide what stays equal; real numbers are nodes, vectors pairs of them.
    """

    z: Complex

    @classmethod
    def of(cls, x: complex, real: Real, imag: Real = 0.0) -> Recorded:
        """A varied number with its parts on the tape."""
        number: Any = cls.__new__(cls, complex(x), tangents(x))
        number.z = real if _is_nought(imag) else Planar(real, imag)
        recorded: Recorded = number
        return recorded

    def __add__(self, x: complex) -> Recorded:
        (a, b), (c, d) = _xy(self), _xy(x)
        return Recorded.of(Varied.__add__(self, x), _sum(a, c), _sum(b, d))

    __radd__ = __add__

    def __neg__(self) -> Recorded:
        return Recorded.of(Varied.__neg__(self), *(-x for x in _xy(self)))

    def __mul__(self, x: complex) -> Recorded:
        (a, b), (c, d) = _xy(self), _xy(x)
        real, imag = _sum(_product(a, c), -_product(b, d)), _sum(_product(a, d), _product(b, c))
        return Recorded.of(Varied.__mul__(self, x), real, imag)

    __rmul__ = __mul__

    def __truediv__(self, x: complex) -> Recorded:
        (a, b), (c, d) = _xy(self), _xy(x)
        if not _is_nought(d):
            return self * x.conjugate() / (x * x.conjugate()).real
        return Recorded.of(Varied.__truediv__(self, x), a / c, 0.0 if _is_nought(b) else b / c)

    def __rtruediv__(self, x: complex) -> Recorded:
        return Recorded.of(Varied(x, 0.0 * self.d), *_xy(x)) / self

    def __abs__(self) -> Recorded:  # type: ignore[override]
        x, y = _xy(self)
        return Recorded.of(Varied.__abs__(self), abs(x) if _is_nought(y) else sqrt(x * x + y * y))

    def conjugate(self) -> Recorded:
        """x - iy."""
        x, y = _xy(self)
        return Recorded.of(Varied.conjugate(self), x, -y)

    @property
    def real(self) -> Recorded:  # type: ignore[override]
        """x."""
        return Recorded.of(Varied.real.fget(self), _xy(self)[0])  # type: ignore[attr-defined]

    @property
    def imag(self) -> Recorded:  # type: ignore[override]
        """y."""
        return Recorded.of(Varied.imag.fget(self), _xy(self)[1])  # type: ignore[attr-defined]

    __hash__ = Varied.__hash__

    def __deepcopy__(self, memo: Any) -> Recorded:
        """Itself: a number does not change, and its tape is one."""
        return self


@primitives_of.register(Recorded)
def _recorded_primitives(x: object) -> Record:
    plain = primitives_of.dispatch(Varied)(x)

    def planar(a: complex, b: complex) -> Recorded:
        return Recorded.of(plain["planar"](a, b), _xy(a)[0], _xy(b)[0])

    def turned(t: complex) -> Recorded:
        return Recorded.of(plain["expi"](t), *_xy(expi(_xy(t)[0])))

    def between(a: complex, b: complex) -> Recorded:
        return Recorded.of(plain["angle"](a, b), angle(Planar(*_xy(a)), Planar(*_xy(b))))

    return {"planar": planar, "expi": turned, "angle": between}


def _xy(x: Complex) -> tuple[Real, Real]:
    """x and y of a number: nodes, or numbers where they are constant."""
    z = x.z if isinstance(x, Recorded) else x
    return z.real, z.imag


def _is_nought(x: Real) -> bool:
    return not isinstance(x, Node) and x == 0


def _sum(x: Complex, y: Complex) -> Complex:
    return y if _is_nought(x) else x if _is_nought(y) else x + y


def _product(x: Complex, y: Complex) -> Complex:
    return 0.0 if _is_nought(x) or _is_nought(y) else x * y


WEB = Path(__file__).with_name("web")
OWN = {"fmod": "rest", "rint": "even"} | {x: f"Math.{x}" for x in ("sqrt", "abs", "exp", "pow")}
SPECIAL = {"NAN": "NaN", "INFINITY": "Infinity", "-INFINITY": "-Infinity"}


def _literal(x: float) -> str:
    text = literal(x, DOUBLE)
    return SPECIAL.get(text, text)


SCRIPT = Language(
    {"real": "const", "int": "const"},
    {"real": "let", "int": "let"},
    "const {name} = [{entries}]",
    lambda op: OWN.get(op, op),
    _literal,
    {},
)


def numbers() -> str:
    """The functions that scripts call, as text."""
    return (WEB / "numbers.js").read_text("utf-8").partition("\nexport")[0]


class Script(CProgram):
    """The JavaScript text of some outputs of a mechanism.

    ``text(name)`` defines ``name(p, u, out)``: it writes the outputs for parameters and inputs,
    all arrays of numbers in the order of the attributes, and returns 0 or the number of the reason
    why there is no answer. Arguments and errors are those of `CProgram`.
    """

    @property
    def values(self) -> list[float]:
        """The parameters of the mechanism, one after the other."""
        return [x for member in self.parameters for x in member.numbers]

    def text(self, name: str) -> str:
        """The function's text; it needs `numbers`."""
        sizes = [len(member.numbers) for member in self.parameters]
        starts = [0, *accumulate(sizes)]
        tables = {
            first: f"p.slice({first}, {first + size})"
            for first, size, member in zip(starts, sizes, self.parameters, strict=False)
            if member.is_array
        }
        count, arrays = starts[-1], []
        parameters = [f"p[{i}]" for i in range(count)]
        for k, table in enumerate(self._trace.tables):
            tables[count], count = f"{name}_{k}", count + len(table)
            parameters += [f"{name}_{k}[{i}]" for i in range(len(table))]
            arrays.append(f"const {name}_{k} = [{', '.join(map(_literal, table.tolist()))}];\n")
        inputs = [f"u[{i}]" for i in range(len(self.inputs))]
        statements = Statements(inputs, parameters, tables, SCRIPT)
        body = statements.text([*self._results.values(), self._status])
        ends = "".join(
            f"    out[{i}] = {statements.name(self._results[output])};\n"
            for i, output in enumerate(self.outputs)
        )
        end = f"    return Number({statements.name(self._status)});\n}}\n"
        return f"{''.join(arrays)}function {name}(p, u, out) {{\n{body}{ends}{end}"

    def compact(self) -> str:
        """The program for `program.js`, which runs it without eval: its operations, one a line.

        A value has no name; lines after it name it by the distance ``~k``, so that programs of
        equal groups have equal lines, and a program is deflated to a third.
        """
        return compacted(self.text("t").splitlines()[:-1])

    def rows(self, samples: Samples) -> list[list[float]]:
        """The inputs (n, k) at some samples."""
        inputs = samples.given(self.plan.program.inputs)
        columns = [np.broadcast_to(inputs[x], samples.n) for x in self.plan.program.inputs]
        return [[float(column[i]) for column in columns] for i in range(samples.n)]

    def answers(self, result: Result) -> list[list[float]]:
        """What a result of the same outputs has for them, (n, outputs)."""
        rows: list[list[float]] = np.stack(
            [self.column(result, name) for name in self.outputs], axis=1
        ).tolist()
        return rows


def compacted(lines: Iterable[str]) -> str:
    """Statements, whose values are named by how many lines they stand back."""
    texts: list[str] = []
    order: dict[str, int] = {}
    for line in lines:
        defined = re.match(r" *const (x\d+) = (.*);", line)
        text = defined[2] if defined else line.strip()
        texts.append(re.sub(r"\bx\d+", lambda x: f"~{len(order) - order[x[0]]}", text))
        if defined:
            order[defined[1]] = len(order)
    return "\n".join(text for text in texts if not text.startswith("function"))
