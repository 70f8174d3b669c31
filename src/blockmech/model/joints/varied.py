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
from numpy.typing import NDArray

from blockmech.ground.plane import angle, apply, primitives_of
from blockmech.typing import Record


class Varied(complex):
    """A real number or a planar vector x + iy with its derivatives ``d`` (m,), of the same kind.

    Larger and smaller are those of the values.
    """

    d: NDArray[Any]

    def __new__(cls, value: complex, d: Any) -> Varied:
        made = super().__new__(cls, value)
        made.d = np.asarray(d)
        return made

    def __add__(self, other: complex) -> Varied:
        return Varied(complex(self) + complex(other), self.d + tangents(other))

    __radd__ = __add__

    def __neg__(self) -> Varied:
        return Varied(-complex(self), -self.d)

    def __sub__(self, other: complex) -> Varied:
        return self + -other

    def __rsub__(self, other: complex) -> Varied:
        return -self + other

    def __mul__(self, other: complex) -> Varied:
        a, b = complex(self), complex(other)
        return Varied(a * b, self.d * b + a * tangents(other))

    __rmul__ = __mul__

    def __truediv__(self, other: complex) -> Varied:
        y, b = complex(self) / complex(other), complex(other)
        return Varied(y, (self.d - y * tangents(other)) / b)

    def __abs__(self) -> Varied:  # type: ignore[override]
        z, r = complex(self), abs(complex(self))
        return Varied(r, (z.conjugate() * self.d).real / r)

    def conjugate(self) -> Varied:
        """x - iy."""
        return Varied(complex(self).conjugate(), self.d.conjugate())

    @property
    def real(self) -> Varied:  # type: ignore[override]
        """x."""
        return Varied(complex(self).real, self.d.real)

    @property
    def imag(self) -> Varied:  # type: ignore[override]
        """y."""
        return Varied(complex(self).imag, self.d.imag)

    def __eq__(self, other: object) -> bool:
        same = isinstance(other, int | float | complex) and complex(self) == complex(other)
        return same and bool(np.all(self.d == tangents(other)))

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash(complex(self))

    def __bool__(self) -> bool:
        return self != 0

    def __lt__(self, other: complex) -> bool:
        return complex(self).real < complex(other).real

    def __gt__(self, other: complex) -> bool:
        return complex(self).real > complex(other).real


def tangents(x: Any) -> Any:
    """The derivatives of a number; zero of one that does not vary."""
    return x.d if isinstance(x, Varied) else 0.0


@primitives_of.register(Varied)
def _of_varied(x: object) -> Record:
    return {"planar": _planar, "expi": _expi, "angle": _angle}


def _planar(x: complex, y: complex) -> complex:
    return x + 1j * y


def _expi(t: complex) -> Varied:
    z = complex(math.cos(complex(t).real), math.sin(complex(t).real))
    return Varied(z, 1j * z * tangents(t))


def _angle(a: complex, b: complex) -> Varied:
    x, y = complex(a), complex(b)
    turn = tangents(b) / y - tangents(a) / x  # of logarithms: their imaginary parts are angles
    return Varied(angle(x, y), turn.imag)


def phase(z: complex) -> Any:
    """Angle [rad] of a vector from the x axis."""
    return apply("angle", 1 + 0j, z)


def remainder(x: Any, period: float) -> Any:
    """A number less whole periods, nearest to zero."""
    at = settled(x)
    return math.remainder(at, period) + (x - at)


PLAIN = frozenset({float, complex, int, bool, str, type(None)})


def settled(x: Any) -> Any:
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
