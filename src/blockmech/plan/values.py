"""Values of a program: what rules answer, and the one place where they are written as text.

A value is made of others by operators, by the primitives of the plane and as the field of a
record. What is zero by structure leaves nothing behind: no term and no factor of it is written.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

SUM, PRODUCT, SIGN, CALL, NAME = range(5)  # how tightly what is written binds


class Value:
    """A value of a program, as it is written.

    Attributes
    ----------
    text : the expression
    rank : how tightly it binds, `NAME` of what needs no name of its own
    zero : whether it is zero by structure
    """

    __slots__ = ("rank", "text", "zero")
    __iter__ = None  # a record, or a row: nobody knows its length

    def __init__(self, text: str, rank: int = NAME, zero: bool = False) -> None:
        self.text = text
        self.rank = rank
        self.zero = zero

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"Value({self.text})"

    def __eq__(self, value: object) -> bool:
        return isinstance(value, Value) and self.text == value.text

    def __hash__(self) -> int:
        return hash(self.text)

    def __getattr__(self, field: str) -> Value:
        if field[0] == "_":  # a protocol of Python's, which a value has not
            raise AttributeError(field)
        return Value(f"{self.text}.{field}")

    def __getitem__(self, index: int) -> Value:
        return Value(f"{self.text}[{index}]")

    def __add__(self, term: Value) -> Value:
        if self.zero or term.zero:
            return term if self.zero else self
        return Value(f"{self.text} + {term.text if term.rank else term.enclosed}", SUM)

    def __sub__(self, term: Value) -> Value:  # 0 - x stays: -x may be -0
        if term.zero:
            return self
        return Value(f"{self.text} - {term.text if term.rank else term.enclosed}", SUM)

    def __mul__(self, factor: Value) -> Value:
        if self.zero or factor.zero:
            return self if self.zero else factor
        product = self.text if self.rank else self.enclosed
        last = factor.text if factor.rank > PRODUCT else factor.enclosed
        return Value(f"{product} * {last}", PRODUCT)

    def __truediv__(self, divisor: Value) -> Value:
        if self.zero:
            return self
        product = self.text if self.rank else self.enclosed
        last = divisor.text if divisor.rank > PRODUCT else divisor.enclosed
        return Value(f"{product} / {last}", PRODUCT)

    def __neg__(self) -> Value:
        if self.zero:
            return self
        if self == UNIT:
            return MINUS
        return Value(f"-{self.text if self.rank > PRODUCT else self.enclosed}", SIGN)

    def __abs__(self) -> Value:
        return absolute(self)

    def replaced(self, **fields: Value) -> Value:
        """A record with some of its fields replaced."""
        texts = ", ".join([f"{name}={value}" for name, value in fields.items()])
        return Value(f"{self.text}._replace({texts})", CALL)

    @property
    def enclosed(self) -> str:
        """The text as a part of what binds more tightly."""
        return f"({self.text})"


NOUGHT, ZERO = Value("0.0", zero=True), Value("ZERO", zero=True)
UNIT, MINUS, TWO, HALF = map(Value, ("1.0", "-1.0", "2", "0.5"))
ONE, REST = Value("ONE"), Value("REST")  # as ZERO constants that every engine names


@dataclass(frozen=True)
class Primitive:
    """A primitive of the plane, as values call it.

    nothing : what it is of an argument of zero, where that is known
    """

    name: str
    nothing: Value | None = None

    def __call__(self, *args: Value) -> Value:
        texts = []
        for x in args:
            if x.zero and self.nothing is not None:
                return self.nothing
            texts.append(x.text)
        return Value(f"{self.name}({', '.join(texts)})", CALL)


cross, dot, hyp, absolute = (Primitive(n, NOUGHT) for n in ("cross", "dot", "hyp", "abs"))
mul, imul = (Primitive(n, ZERO) for n in ("mul", "imul"))
angle, planar, sign, expi, minimum, maximum, where = map(
    Primitive, ("angle", "planar", "sign", "expi", "minimum", "maximum", "where")
)


def constant(x: object) -> Value:
    """A constant of Python: a number, a switch, a tuple of them."""
    return Value(repr(x))


def below(x: Value, limit: Value) -> Value:
    """Whether a number is below another."""
    return Value(f"{x.text} < {limit.text}", SUM)


def tuple_of(items: Iterable[Value]) -> Value:
    """A tuple of values."""
    return Value(f"({''.join([f'{item.text}, ' for item in items])})")
