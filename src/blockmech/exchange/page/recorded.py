"""Numbers that write down how they follow others: of a document's numbers, those of programs.

A document goes through its decomposition with such numbers (`blockmech.model.joints.varied`), and
what comes out in a program is arithmetic of what went in.
"""

from __future__ import annotations

import math
from typing import Any

from blockmech.engines.nodes import Node
from blockmech.engines.numpy import Planar
from blockmech.engines.trace import PRIMITIVES, angle, expi, sqrt
from blockmech.ground.plane import primitives_of
from blockmech.model.joints.varied import Varied, tangents
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
