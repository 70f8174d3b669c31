"""Formulas of time, as assemblies have them: read into a tree and computed, never run as a program.

Sums, products, powers (``^``), functions of one or two arguments, ``pi``; a ``d`` behind a number
is of another language and means nothing.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable

from blockmech.exchange.parsing import wrong
from blockmech.ground.tolerances import EQUAL
from blockmech.typing import Data

MATHS = ["sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "exp", "log", "fabs"]
FUNCTIONS: dict[str, Callable[..., float]] = {name: getattr(math, name) for name in MATHS}
SAME = {"arcsin": "asin", "arccos": "acos", "arctan": "atan", "arctan2": "atan2", "abs": "fabs"}
SIGNS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
LONGEST = 10_000  # characters


class Formula:
    """A formula as a function of its variables; its sines stand apart.

    ``rIJ(self)`` is the variable ``rIJ``.
    """

    def __init__(self, text: str, where: str) -> None:
        """Raises `FormatError` for what is no formula."""
        self.where = where
        self.short = text if len(text) < 60 else f"{text[:57]}..."
        plain = re.sub(r"(\d\.?)d\b", r"\1", text.strip().strip('"')).replace("^", "**")
        try:
            self.root = ast.parse(plain[:LONGEST], mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise wrong(where, f"{self.short} cannot be read", "a formula of time") from None
        calls = [node for node in ast.walk(self.root) if isinstance(node, ast.Call)]
        self.waves = [node for node in calls if _name(node) in ("sin", "cos")]

    def __call__(self, **values: float) -> float:
        """Its value. Raises `FormatError` for names that are none, or where it is no number."""
        return self.value(self.root, values)

    def value(self, node: ast.AST, values: dict[str, float]) -> float:
        """The value of a part of it; that of a sine is ``wave``, where this is given."""
        try:
            number = float(self._value(node, values))
        except (ArithmeticError, ValueError, TypeError, RecursionError, KeyError):
            number = math.nan
        if not math.isfinite(number):
            raise wrong(self.where, f"{self.short} is no number", f"{', '.join(FUNCTIONS)}")
        return number

    def _value(self, node: ast.AST, values: dict[str, float]) -> float:
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                return float(number)
            case ast.Name(id=name):
                return math.pi if name == "pi" else values[name]
            case ast.UnaryOp(op=op, operand=inner):
                return SIGNS[type(op)](self._value(inner, values))
            case ast.BinOp(left=one, op=op, right=two):
                return SIGNS[type(op)](self._value(one, values), self._value(two, values))
            case ast.Call(args=[ast.Name(id="self")]):
                return values[_name(node)]
            case ast.Call(args=arguments, keywords=[]):
                if node in self.waves and "wave" in values:
                    return values["wave"]
                return FUNCTIONS[_name(node)](*(self._value(x, values) for x in arguments))
        raise KeyError


def _name(call: ast.Call) -> str:
    name = call.func.id if isinstance(call.func, ast.Name) else ""
    return SAME.get(name, name)


def law_of(formula: Formula, end: float, turns: bool) -> Data:
    """The law of motion of a formula of ``time``, or a table until ``end`` [s].

    A constant rate that ``turns`` does so once.
    """
    times = (0.0, 0.5, 1.0, 0.31, 1.7)
    q = [formula(time=t) for t in times]
    rate, curve = q[2] - q[0], 4 * (q[0] - 2 * q[1] + q[2])
    size = max(map(abs, q)) or 1.0
    first = rate - curve / 2
    bent = max(abs(q[0] + first * t + curve * t * t / 2 - x) for t, x in zip(times, q, strict=True))
    if bent < EQUAL * size and abs(curve) < EQUAL * size:
        travel = math.copysign(math.tau, rate) if turns and rate else rate * end
        return {"law": "constant_rate", "rate": rate, "from": q[0], "to": q[0] + travel}
    if len(formula.waves) == 1 and (wave := _harmonic(formula)) is not None:
        return wave
    if bent < EQUAL * size:
        to = q[0] + first * end + curve * end * end / 2
        law = {"law": "rate_acceleration", "rate": first, "acceleration": curve}
        return {**law, "from": q[0], "to": to}
    rows = [end * k / 240 for k in range(241)]
    return {"law": "trajectory", "times": rows, "values": [formula(time=t) for t in rows]}


def _harmonic(formula: Formula) -> Data | None:
    """mean + amplitude sin(w t + phase), None for what has other numbers at other times."""
    wave = formula.waves[0]
    times = (0.0, 1.0, 0.37)
    a, b, c = (formula.value(wave.args[0], {"time": t}) for t in times)
    low, high = ([formula(time=t, wave=w) for t in times] for w in (0.0, 1.0))
    w, size = b - a, max(map(abs, [*low, *high])) or 1.0
    bent = max(abs(a + 0.37 * w - c), max(low) - min(low), max(high) - min(high))
    if not w or bent > EQUAL * max(size, abs(a), abs(b)):
        return None
    if _name(wave) == "cos":
        a += math.pi / 2
    amplitude, sign = high[0] - low[0], math.copysign(1.0, w)
    law = {"law": "harmonic", "mean": low[0], "amplitude": sign * amplitude}
    return {**law, "frequency": abs(w) / math.tau, "phase": sign * a}
