"""Numbers of a document that vary: they carry their derivatives into the numbers of its graph.

From a document to its graph is arithmetic of the plane; what is decided on the way (which
places coincide, which mode stands nearest) is decided for the design an infinitesimal step
aside: two varied numbers are equal if they stay equal. So one pass gives the graph that holds
for all near designs, and the derivatives of all its numbers, exact to rounding.

Source: Griewank & Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, ch. 3 (forward mode).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import is_dataclass, replace
from operator import is_
from typing import Any

import numpy as np

from blockmech.ground.plane import angle, apply, primitives_of
from blockmech.typing import Array, Complex, Real, Record


class Varied(complex):
    """A real number or a planar vector x + iy with its derivatives ``d`` (m,), of the same kind.

    Larger and smaller are those of the values. A number that is handed on, by itself or as a part
    of a vector, remains the same object; one that follows from it by arithmetic is another.
    """

    d: Array
    parts: tuple[complex, ...] = ()  # x and y of a vector of which they were given

    def __new__(cls, value: complex, d: Real) -> Varied:
        number = super().__new__(cls, value)
        number.d = np.asarray(d)
        return number

    def __add__(self, operand: complex) -> Varied:
        if not operand:
            return self
        return Varied(complex(self) + complex(operand), self.d + tangents(operand))

    __radd__ = __add__

    def __neg__(self) -> Varied:
        return Varied(-complex(self), -self.d)

    def __sub__(self, operand: complex) -> Varied:
        return self + -operand

    def __rsub__(self, operand: complex) -> Varied:
        return -self + operand

    def __mul__(self, operand: complex) -> Varied:
        if operand == 1:
            return self
        a, b = complex(self), complex(operand)
        return Varied(a * b, self.d * b + a * tangents(operand))

    __rmul__ = __mul__

    def __truediv__(self, operand: complex) -> Varied:
        y, b = complex(self) / complex(operand), complex(operand)
        return Varied(y, (self.d - y * tangents(operand)) / b)

    def __rtruediv__(self, operand: complex) -> Varied:
        return Varied(operand, 0.0) / self

    def __abs__(self) -> Varied:  # type: ignore[override]
        x, y = self.parts or (0.0, 0.0)
        if isinstance(x, Varied) and not y and x > 0:
            return x
        z, r = complex(self), abs(complex(self))
        return Varied(r, (z.conjugate() * self.d).real / r)

    def conjugate(self) -> Varied:
        """x - iy."""
        return Varied(complex(self).conjugate(), self.d.conjugate())

    @property
    def real(self) -> Any:
        """x."""
        return self.parts[0] if self.parts else Varied(complex(self).real, self.d.real)

    @property
    def imag(self) -> Any:
        """y."""
        return self.parts[1] if self.parts else Varied(complex(self).imag, self.d.imag)

    def __eq__(self, operand: object) -> bool:
        same = isinstance(operand, int | float | complex) and complex(self) == complex(operand)
        return same and bool(np.all(self.d == tangents(operand)))

    def __ne__(self, operand: object) -> bool:
        return not self == operand

    def __hash__(self) -> int:
        return hash(complex(self))

    def __bool__(self) -> bool:
        return self != 0

    def __lt__(self, operand: complex) -> bool:
        return complex(self).real < complex(operand).real

    def __gt__(self, operand: complex) -> bool:
        return complex(self).real > complex(operand).real


def tangents(x: Real) -> Real:
    """The derivatives of a number; zero of one that does not vary."""
    return x.d if isinstance(x, Varied) else 0.0


@primitives_of.register(Varied)
def _of_varied(x: object) -> Record:
    return {"planar": _planar, "expi": _expi, "angle": _angle}


def _planar(x: complex, y: complex) -> complex:
    z = 1j * y + x
    assert isinstance(z, Varied)
    vector = Varied(z, z.d)
    vector.parts = x, y
    return vector


def _expi(t: complex) -> Varied:
    z = complex(math.cos(complex(t).real), math.sin(complex(t).real))
    return Varied(z, 1j * z * tangents(t))


def _angle(a: complex, b: complex) -> Varied:
    x, y = complex(a), complex(b)
    turn = tangents(b) / y - tangents(a) / x  # of logarithms: their imaginary parts are angles
    return Varied(angle(x, y), turn.imag)


def phase(z: complex) -> Complex:
    """Angle [rad] of a vector from the x axis."""
    return apply("angle", 1 + 0j, z)


def remainder(x: Real, period: float) -> Real:
    """A number less whole periods, nearest to zero."""
    at = settled(x)
    return math.remainder(at, period) + (x - at)


PLAIN = frozenset({float, complex, int, bool, str, type(None)})


def settled(x: Real) -> Real:
    """Numbers without derivatives, also inside records, lists and mappings.

    What holds none with derivatives is given back itself.
    """
    if isinstance(x, Varied):
        z = complex(x)
        return z if z.imag else z.real
    if isinstance(x, list | tuple):
        parts = [item if type(item) in PLAIN else settled(item) for item in x]
        if all(map(is_, parts, x)):
            return x
        return type(x)(*parts) if hasattr(x, "_fields") else type(x)(parts)
    fields = x if isinstance(x, Mapping) else vars(x) if is_dataclass(x) else {}
    inside = {key: settled(item) for key, item in fields.items() if type(item) not in PLAIN}
    changed = {key: item for key, item in inside.items() if item is not fields[key]}
    if not changed:
        return x
    return {**x, **changed} if isinstance(x, Mapping) else replace(x, **changed)
