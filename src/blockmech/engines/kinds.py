"""Values and operations of the language of `loops`: as Python says them, and as its text does."""

from __future__ import annotations

import ast
import ctypes
import linecache
import math
import struct
from collections.abc import Callable
from functools import cache, partial
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from blockmech.typing import Data, Record

Reals: TypeAlias = NDArray[np.float64]
Counts: TypeAlias = NDArray[np.int64]
ROW = "row"


class First(str):
    """How many blocks an array of a record has; what else says its shape are sizes of a block."""

    __slots__ = ()


REAL, COUNT, TRUTH, PLACE, NOTHING = "double", "i64", "i1", "ptr", "void"
KINDS = {float: REAL, int: COUNT, bool: TRUTH, type(None): NOTHING}
IN_C: Data = {
    REAL: ctypes.c_double,
    COUNT: ctypes.c_int64,
    PLACE: ctypes.c_void_p,
    NOTHING: None,
}
NAMES = {REAL: "a float", COUNT: "an int", TRUTH: "a truth value", PLACE: "an array"}
MATH: dict[Callable[..., object], str] = {
    getattr(math, name): name for name in ("sqrt", "sin", "cos", "exp", "copysign")
}
LANEWISE = MATH | {
    abs: "fabs",
    np.sqrt: "sqrt",
    np.where: "",
    np.any: "vector.reduce.or",
    np.max: "vector.reduce.fmax",
    np.min: "vector.reduce.fmin",
}
OPERATIONS = {
    (REAL, ast.Add): "fadd", (REAL, ast.Sub): "fsub", (REAL, ast.Mult): "fmul",
    (REAL, ast.Div): "fdiv", (COUNT, ast.Add): "add", (COUNT, ast.Sub): "sub",
    (COUNT, ast.Mult): "mul", (COUNT, ast.RShift): "ashr", (TRUTH, ast.BitAnd): "and",
    (REAL, ast.Lt): "fcmp olt", (REAL, ast.LtE): "fcmp ole", (REAL, ast.Gt): "fcmp ogt",
    (REAL, ast.GtE): "fcmp oge", (REAL, ast.Eq): "fcmp oeq", (REAL, ast.NotEq): "fcmp une",
    (COUNT, ast.Lt): "icmp slt", (COUNT, ast.LtE): "icmp sle", (COUNT, ast.Gt): "icmp sgt",
    (COUNT, ast.GtE): "icmp sge", (COUNT, ast.Eq): "icmp eq", (COUNT, ast.NotEq): "icmp ne",
}  # fmt: skip


class Value(NamedTuple):
    """What an expression is in the text: a name or number, and of what kind.

    of : kind of an array's numbers, shape : sizes of a block of it, row : how many a row has
    takes : kinds of a function's arguments, gives : that of its answer
    lanes : numbers of a vector, 0 of one alone
    parts : arrays of a record
    """

    text: str
    kind: str
    of: str = ""
    shape: tuple[int, ...] = ()
    row: int = 0
    takes: tuple[str, ...] = ()
    gives: str = ""
    lanes: int = 0
    parts: tuple[tuple[str, Value], ...] = ()

    @property
    def type(self) -> str:
        """The kind as the text says it."""
        return f"<{self.lanes} x {self.kind}>" if self.lanes else self.kind


def parts_of(function: Callable[..., object]) -> tuple[Callable[..., object], Data]:
    """A function, and what is given of its arguments, see `partial`."""
    return (function.func, function.keywords) if isinstance(function, partial) else (function, {})


def meaning_of(hint: Any, sizes: Record = MappingProxyType({})) -> Value:
    """The kind of value that an annotation means; ``sizes`` are what its blocks are told by."""
    if hint in KINDS:
        return Value("", KINDS[hint])
    if hasattr(hint, "__metadata__"):
        blocks = [x for x in hint.__metadata__ if not isinstance(x, First)]
        shape = tuple(eval(x, {}, dict(sizes)) for x in blocks if sizes and x != ROW)
        row = shape[0] if ROW in blocks and sizes else 0
        return meaning_of(hint.__origin__)._replace(shape=() if row else shape, row=row)
    if hint in (Reals, Counts):
        return Value("", PLACE, REAL if hint == Reals else COUNT)
    if hasattr(hint, "_fields"):
        parts = get_type_hints(hint, include_extras=True).items()
        return Value("", PLACE, parts=tuple((k, meaning_of(x, sizes)) for k, x in parts))
    if get_origin(hint) is not Callable:
        raise TypeError(f"{hint!r} is no kind of argument")
    takes, gives = get_args(hint)
    return Value(
        "", PLACE, takes=tuple(meaning_of(x).kind for x in takes), gives=meaning_of(gives).kind
    )


def arrays_of(record: Any, sizes: Record) -> list[tuple[str, Any, tuple[int, ...]]]:
    """Names, kinds and shapes of a record's arrays, but for those without a size."""
    arrays = []
    for name, hint in get_type_hints(record, include_extras=True).items():
        if metadata := getattr(hint, "__metadata__", ()):
            value = meaning_of(hint, sizes)
            count = [eval(x, {}, dict(sizes)) for x in metadata if isinstance(x, First)]
            shape = (*(count or [value.row]), *value.shape)
            arrays.append((name, np.float64 if value.of == REAL else np.int64, shape))
    return arrays


def number(x: float) -> Value:
    """A number of Python."""
    if isinstance(x, int):
        return Value(str(int(x)), TRUTH if isinstance(x, bool) else COUNT)
    return Value(f"0x{struct.pack('>d', x).hex().upper()}", REAL)


def larger(a: float, b: float) -> float:
    """As max says it."""
    return b if b > a else a


def smaller(a: float, b: float) -> float:
    """As min says it."""
    return b if b < a else a


TRANSLATED: dict[Callable[..., object], Callable[..., float]] = {max: larger, min: smaller}


@cache
def functions_by_line(file: str) -> dict[int, ast.FunctionDef]:
    """Functions of a module by their lines."""
    body = ast.parse("".join(linecache.getlines(file))).body
    return {x.lineno: x for x in body if isinstance(x, ast.FunctionDef)}
