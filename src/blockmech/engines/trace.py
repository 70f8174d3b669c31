"""Tracing: a program bound to symbolic numbers becomes a list of flat real operations.

The same operation on the same nodes is made once. Planar vectors are pairs of nodes, numbers
of the text stay Python numbers, and what the program looks at while it is traced (kinds of
pairs, numbers of links) is gone. Nothing is re-associated.

Source: tracing by operator overloading is that of automatic differentiation; Griewank &
Walther, Evaluating Derivatives, 2008, ch. 6.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import cache, partial
from typing import NamedTuple, NoReturn

from blockmech.engines.binding import bind
from blockmech.engines.nodes import PARAMETER, SAMPLE, AsksPython, Loop, Node, Untraceable
from blockmech.engines.numpy import Planar, imul, leaves, mul
from blockmech.engines.numpy import each as each_of
from blockmech.ground.plane import EPS, REST_SHARE, SCALAR_PRIMITIVES, cross, dot
from blockmech.plan.plan import Program
from blockmech.typing import Data, Kernel, Nested, Real, Reals, Values

CONSTANTS = {"ZERO": Planar(0.0, 0.0), "ONE": Planar(1.0, 0.0)}
Body = Callable[..., Values]
FOLLOWED = "it follows a group without closed form from its home"


class Question(NamedTuple):
    """A function that is no kernel, and its arguments: indices among the inputs."""

    function: Callable[..., Nested]
    indices: Values


class Trace:
    """A program in flat operations.

    Attributes
    ----------
    nodes : all operations, each after those that it is made of
    asked : functions of inputs alone, whose answers are more inputs, in order
    values : what the program returns, nodes in the place of batches
    """

    def __init__(
        self, program: Program, body: Body | None = None, inputs: int = 0, eps: float = EPS
    ) -> None:
        """Of the program alone, or of a ``body`` of so many inputs that asks it.

        ``eps`` is the rounding [-] of the numbers that it will run on. Raises `Untraceable`
        where the program is more than flat arithmetic.
        """
        self.asked: list[Question] = []
        self.nodes: list[Node] = []
        self.loops: list[Loop] = []
        self._made: dict[tuple[Hashable, ...], Node] = {}
        self._open = False  # whether a loop is being traced
        count = len(program.inputs) if body is None else inputs
        leafs = [self._leaf("input", i, SAMPLE) for i in range(count)]
        slot_numbers = itertools.count()

        def slot() -> Node:
            return self._leaf("parameter", next(slot_numbers), PARAMETER)

        slots = tuple(filled(value, slot) for value in program.parameters.values())
        self._inputs = self._given = len(leafs)
        constants = {**CONSTANTS, "REST": max(REST_SHARE, eps**0.75)}
        bound = bind(program, _primitives(eps), constants, self._foreign)

        def run(*x: Node) -> Values:
            return bound(*x, slots)

        try:
            self.values: Values = run(*leafs) if body is None else body(run, *leafs)
        except (TypeError, AttributeError) as error:  # what a number can that a node cannot
            raise Untraceable(f"a kernel is more than the primitives ({error})") from error

    def node(self, op: str, *args: Real | Loop) -> Node:
        """The operation on these arguments, nodes or numbers."""
        key = (op, *(x.number if isinstance(x, Node) else (repr(x),) for x in args))
        if key not in self._made:
            scope = max((x.scope for x in args if isinstance(x, Node)), default=PARAMETER)
            self._made[key] = Node(self, op, args, scope)
        return self._made[key]

    @property
    def answers(self) -> int:
        """Number of inputs that are answers."""
        return self._inputs - self._given

    def ufunc(self, name: str, *args: Real) -> NoReturn:
        """A function of NumPy that is asked of nodes: no kernel does, readings of outputs may."""
        raise Untraceable(f"a kernel asks NumPy's {name}")

    def _foreign(self, function: Callable[..., Nested]) -> Callable[..., Nested]:
        """What stands for a function that is no kernel while a program is traced."""

        def answer(*arguments: Nested) -> Nested:
            return self.answer(function, arguments, answer_of(function, arguments))

        return answer

    def answer(self, function: Callable[..., Nested], arguments: Values, like: Nested) -> Nested:
        """What a function of inputs alone says: inputs of their own, worked out beforehand.

        ``like`` is an answer of it, which tells of what parts it is made.
        """
        inputs = leaves(arguments)
        if not all(isinstance(x, Node) and x.op == "input" for x in inputs):
            raise AsksPython("it asks a function of Python of what it computes")
        indices = iter([x.args[0] for x in inputs]).__next__

        def leaf() -> Node:
            self._inputs += 1
            return self._leaf("input", self._inputs - 1, SAMPLE)

        self.asked.append(Question(function, filled(arguments, indices)))
        return filled(like, leaf)

    def _leaf(self, op: str, index: int, scope: int) -> Node:
        return Node(self, op, (index,), scope)

    def loop(self, step: Kernel, state: Values, cap: int, data: Values) -> Nested:
        """The state after a loop: nodes "after" of it."""
        if self._open:
            raise Untraceable("a loop in a loop")
        loop = Loop(self, cap, leaves(state))
        inside = iter(loop.state)
        self._open = True
        loop.following = leaves(step(filled(state, lambda: next(inside)), *data))
        self._open = False
        after = (Node(self, "after", (loop, i), SAMPLE) for i in range(len(loop.state)))
        return filled(state, lambda: next(after))


def filled(value: Nested, fresh: Callable[[], Real], pair: type = Planar) -> Nested:
    """A nested tuple with fresh numbers in the place of its own, and pairs of them as vectors."""
    if isinstance(value, tuple):
        parts = [filled(x, fresh, pair) for x in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return pair(fresh(), fresh()) if isinstance(value, complex | Planar) else fresh()


def answer_of(function: Callable[..., Nested], arguments: Values) -> Nested:
    """An answer of a function that is no kernel, to tell the form of all of them."""
    return getattr(function, "answer", None) or function(*filled(arguments, float))


# -- the primitives of the plane ---------------------------------------------------


def _trace_of(*values: Nested) -> Trace | None:
    return next((x.trace for x in leaves(values) if isinstance(x, Node)), None)


def _flat(name: str, function: Callable[..., float]) -> Callable[..., Real]:
    """A function that is one operation; of plain numbers, a plain number."""

    def operation(*x: Real) -> Real:
        trace = _trace_of(x)
        return function(*x) if trace is None else trace.node(name, *x)

    return operation


sqrt, exp = (_flat(name, SCALAR_PRIMITIVES[name]) for name in ("sqrt", "exp"))
_pow = _flat("pow", SCALAR_PRIMITIVES["power"])
_cos, _sin, _atan2 = _flat("cos", math.cos), _flat("sin", math.sin), _flat("atan2", math.atan2)
_remainder, _is_nan = _flat("fmod", math.fmod), _flat("is nan", math.isnan)


def where(condition: Real, a: Real, b: Real) -> Real:
    """See `blockmech.ground.plane.where`, and so on."""
    if not isinstance(condition, Node):
        return a if condition else b
    return condition.trace.node("where", condition, a, b)


def sign(x: Real) -> Real:
    """-1, 0 or 1 in the sign of a number; NaN for NaN."""
    return where(x > 0.0, 1.0, where(x < 0.0, -1.0, x))


def power(x: Real, y: Real) -> Real:
    """A number that is not negative to a power."""
    return _pow(where(x >= 0.0, x, math.nan), y)


def minimum(a: Real, b: Real) -> Real:
    """The smaller of two numbers; NaN where one of them is."""
    return where((a < b) | _is_nan(a), a, b)


def maximum(a: Real, b: Real) -> Real:
    """The larger of two numbers; NaN where one of them is."""
    return where((a > b) | _is_nan(a), a, b)


def modulo(x: Real, period: Real) -> Real:
    """The rest of x in [0, period)."""
    rest = _remainder(x, period)
    return where(rest < 0.0, rest + period, rest)


def expi(t: Real) -> Planar:
    """exp(i t), from cosine and sine."""
    return Planar(_cos(t), _sin(t))


def hyp(z: Planar) -> Real:
    """The length of a vector."""
    return sqrt(z.real * z.real + z.imag * z.imag)


def angle(a: Planar, b: Planar) -> Real:
    """The angle from a to b, in (-pi, pi]."""
    return _atan2(cross(a, b) + 0.0, dot(a, b))


def piecewise(x: Real, knots: Reals, rows: Sequence[Reals]) -> Real:
    """The piece is looked up; its coefficients are parameters one after the other."""
    trace = _trace_of(x, knots)
    assert trace is not None  # the knots are parameters
    first, last = knots[0], knots[-1]
    inside = (first <= x) & (x <= last)
    piece = trace.node("piece", x, first, last)
    s, total = x - trace.node("entry", piece, first), trace.node("entry", piece, rows[0][0])
    for row in rows[1:]:
        total = total * s + trace.node("entry", piece, row[0])
    return where(inside, total, math.nan)


def repeat(step: Kernel, state: Values, cap: int, *data: Nested) -> Nested:
    """A loop of the trace, or of plain numbers a plain one."""
    trace = _trace_of(state, data)
    if trace is None:
        return SCALAR_PRIMITIVES["repeat"](step, state, cap, *data)
    return trace.loop(step, state, cap, data)


def times(step: Kernel, state: Values, count: int, *data: Nested) -> Nested:
    """A loop that no sample leaves before its end."""
    if _trace_of(state, data) is None:
        return SCALAR_PRIMITIVES["times"](step, state, count, *data)
    after, _ = repeat(lambda s, *data: (step(s[0], *data), True), (state, True), count, *data)
    return after


def each(function: Callable[..., float], *x: Real) -> Real:
    """A function of Python: of inputs alone it is asked beforehand."""
    trace = _trace_of(x)
    return function(*x) if trace is None else trace.answer(partial(each_of, function), x, 0.0)


def matrix(rows: Iterable[Reals]) -> tuple[Reals, ...]:
    """A matrix is its rows."""
    return tuple(map(tuple, rows))


def solve(a: Sequence[Reals], right: Reals) -> tuple[Real, ...]:
    """Gaussian elimination in flat operations, without those on zeros of the matrix's pattern.

    Entries of 1 and -1 are pivots before all others, those first that fill in least: most of what
    pairs say of the places of links. What is left is small and dense; there the largest entry of a
    column comes up row by row, in each lane by itself.

    Source: Golub & Van Loan, Matrix Computations, 2013, 3.4; Duff, Erisman & Reid, Direct Methods
    for Sparse Matrices, 2017, 7.2 (Markowitz's rule).
    """
    rows = [[*row, x] for row, x in zip(a, right, strict=True)]
    columns, pivots = list(range(len(rows))), list[tuple[int, list[Real]]]()
    while columns:
        column, pivot, rows = _pivot(rows, columns)
        columns.remove(column)
        pivots.append((column, pivot))
        filled_columns = [k for k in (*columns, -1) if not _is_zero(pivot[k])]
        for row in rows:
            if not _is_zero(row[column]):
                factor = row[column] / pivot[column]
                for k in filled_columns:
                    row[k] = row[k] - factor * pivot[k]
    solution: list[Real] = [0.0] * len(pivots)
    for n, (column, pivot) in enumerate(reversed(pivots)):
        total = pivot[-1]
        for later, _ in pivots[len(pivots) - n :]:
            if not _is_zero(pivot[later]):
                total = total - pivot[later] * solution[later]
        solution[column] = total / pivot[column]
    return tuple(solution)


def _pivot(rows: list[list[Real]], columns: list[int]) -> tuple[int, list[Real], list[list[Real]]]:
    """The column to eliminate next, its row, and all other rows."""
    wide = [sum(not _is_zero(row[k]) for k in columns) for row in rows]
    high = {k: sum(not _is_zero(row[k]) for row in rows) for k in columns}
    units = (
        ((n - 1) * (high[k] - 1), i, k)
        for i, (row, n) in enumerate(zip(rows, wide, strict=True))
        for k in columns
        if isinstance(row[k], float) and abs(row[k]) == 1.0
    )
    if (best := min(units, default=None)) is not None:
        _, i, column = best
        return column, rows[i], rows[:i] + rows[i + 1 :]
    column = min(columns, key=high.__getitem__)
    pivot, *remaining = sorted(rows, key=lambda row: _is_zero(row[column]))
    for n, row in enumerate(remaining):
        if not _is_zero(row[column]):
            larger = abs(row[column]) > abs(pivot[column])
            swapped = [
                (a, b)
                if _is_zero(a) and _is_zero(b)
                else (where(larger, b, a), where(larger, a, b))
                for a, b in zip(pivot, row, strict=True)
            ]
            pivot, remaining[n] = map(list, zip(*swapped, strict=True))
    return column, pivot, remaining


def _is_zero(x: Real) -> bool:
    """Whether an entry is zero by the matrix's pattern."""
    return isinstance(x, float) and x == 0.0


def solve_transposed(a: Sequence[Reals], right: Reals) -> tuple[Real, ...]:
    """See `blockmech.ground.plane.solve_transposed`."""
    return solve(tuple(zip(*a, strict=True)), right)


def spread(a: Sequence[Reals]) -> Real:
    """See `blockmech.ground.plane.spread`."""
    entries = [x for column in zip(*a, strict=True) for x in column]
    trace = _trace_of(tuple(entries))
    assert trace is not None  # pairs close at places of the sample
    return trace.node("part", trace.node("system", len(a), *entries), 0)


PRIMITIVES: Data = {
    **{f.__name__: f for f in (cross, dot, mul, imul, hyp, expi, angle, where, sign, matrix)},
    **{f.__name__: f for f in (minimum, maximum, power, modulo, piecewise, repeat, times, each)},
    **{f.__name__: f for f in (solve, solve_transposed, spread)},
    "sqrt": sqrt,
    "exp": exp,
    "planar": Planar,
    "EPS": EPS,
}
"""The primitives on symbolic numbers; see `blockmech.ground.plane`."""


@cache
def _primitives(eps: float) -> Data:
    """The primitives for numbers of a rounding: kernels are bound once to each."""
    return {**PRIMITIVES, "EPS": eps}
