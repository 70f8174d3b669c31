"""A traced program as C statements: each operation one constant, each loop of a solver one loop.

Operations keep the order of the trace and none is fused, so a compiler that does not contract
(``-ffp-contract=off``) gives the numbers of the other engines to the last bit. The state of a
loop is the only thing that changes; there is no memory but the stack's.

Source: ISO/IEC 9899:1999, 6.8.5 (loops), 7.12 (mathematics).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from importlib.resources import files
from math import isinf, isnan
from typing import NamedTuple

import numpy as np

from blockmech.engines.nodes import Loop, Node, is_truth
from blockmech.typing import Real

INFIX = {"+": "+", "-": "-", "*": "*", "/": "/", "&": "&", "|": "|"} | {
    x: x for x in ("<", "<=", ">", ">=", "==")
}
CALLS = {"sqrt", "sin", "cos", "exp", "pow", "atan2", "fmod", "hypot", "rint"} | {"abs"}
DOUBLE, FLOAT = "double", "float"
HELPERS = {"piece": "piece.c", "system": "spread.c"}
"""Operations that are functions of their own, and the files with these."""


def literal(x: float, real: str = DOUBLE) -> str:
    """A number as C text that reads back to the same bits."""
    x = float(x) if real == DOUBLE else float(np.float32(x))
    if isnan(x):
        return "NAN"
    if isinf(x):
        return "-INFINITY" if x < 0 else "INFINITY"
    return repr(x) if real == DOUBLE else f"{x!r}f"


class Language(NamedTuple):
    """What tells one language of C's family from another.

    constant, variable : how a number and a truth value (or index) are declared
    array : an array of ``entries`` called ``name``
    call : the name of a function of the mathematical library
    literal : a number as text that reads back to the same bits
    helpers : texts of the functions of operations: ``piece``, and ``system``'s ``spread``
    """

    constant: Mapping[str, str]
    variable: Mapping[str, str]
    array: str
    call: Callable[[str], str]
    literal: Callable[[float], str]
    helpers: Mapping[str, str]


def language_c(real: str) -> Language:
    """C99 with numbers of a type."""
    return Language(
        {kind: f"const {kind}" for kind in ("real", "int")},
        {"real": "real", "int": "int"},
        "real {name}[] = {{{entries}}}",
        lambda op: "FABS" if op == "abs" else op.upper(),
        partial(literal, real=real),
        {op: "\n" + (files(__package__) / file).read_text("utf-8") for op, file in HELPERS.items()},
    )


class Statements:
    """The statements for some nodes.

    ``inputs`` and ``parameters`` are expressions in the order of the trace's; ``tables`` gives
    the array that begins at a parameter.
    """

    def __init__(
        self,
        inputs: Sequence[str],
        parameters: Sequence[str],
        tables: Mapping[int, str],
        language: Language,
    ) -> None:
        self.inputs, self.parameters, self.tables = inputs, parameters, tables
        self.language = language
        self._needed: list[Node] = []
        self._states: dict[Loop, list[int]] = {}

    def text(self, results: Iterable[Real]) -> str:
        """What works the nodes out; `name` reads them afterwards."""
        self._needed, self._states = _reachable(results)
        lines: list[str] = []
        written: set[Loop] = set()
        for node in self._needed:
            if node.op == "after" and node.args[0] not in written:
                written.add(node.args[0])
                lines += self._loop(node.args[0])
            elif node.scope <= 1:  # others stand inside a loop
                lines += self._statement(node, "    ")
        return "".join(f"{line}\n" for line in lines)

    def helpers(self) -> str:
        """The functions that the statements call."""
        operations = {node.op for node in self._needed}
        return "".join(text for op, text in self.language.helpers.items() if op in operations)

    def name(self, x: Real) -> str:
        """A node or a number as an expression without side effects."""
        if not isinstance(x, Node):
            return str(int(x)) if isinstance(x, bool) else self.language.literal(x)
        if x.op == "input":
            return str(self.inputs[x.args[0]])
        if x.op == "parameter":
            return str(self.parameters[x.args[0]])
        if x.op in ("state", "after"):
            return _state(*x.args)
        if x.op == "part":
            return f"{self.name(x.args[0])}[{x.args[1]}]"
        return f"x{x.number}"

    def _statement(self, node: Node, margin: str) -> Iterator[str]:
        if node.op in ("input", "parameter", "state", "after", "part"):
            return
        me = self.name(node)
        if node.op == "system":
            n, *entries = node.args
            numbers = ", ".join(map(self.name, entries))
            yield f"{margin}{self.language.array.format(name=me, entries=numbers)};"
            yield f"{margin}spread({me}, {n});"
            return
        kind = "int" if is_truth(node) or node.op == "piece" else "real"
        yield f"{margin}{self.language.constant[kind]} {me} = {self._expression(node)};"

    def _expression(self, node: Node) -> str:
        op = node.op
        if op == "piece":
            first, last = (knot.args[0] for knot in node.args[1:])
            x = self.name(node.args[0])
            return f"piece({self.tables[first]}, {last - first + 1}, {x})"
        if op == "entry":
            return f"{self.tables[node.args[1].args[0]]}[{self.name(node.args[0])}]"
        args = [self.name(x) for x in node.args]
        if op in INFIX:
            return f" {INFIX[op]} ".join(args)
        if op in CALLS:
            return f"{self.language.call(op)}({', '.join(args)})"
        if op == "neg":
            return f"-({args[0]})"
        if op == "is nan":
            return f"{args[0]} != {args[0]}"
        assert op == "where", op
        return "{} ? {} : {}".format(*args)

    def _loop(self, loop: Loop) -> Iterator[str]:
        states = self._states[loop]
        for i in states:
            kind = "int" if is_truth(loop.state[i]) else "real"
            start = self.name(loop.first[i])
            yield f"    {self.language.variable[kind]} {_state(loop, i)} = {start};"
        going, n = self.name(loop.state[-1]), f"n{loop.scope}"
        index = f"{self.language.variable['int']} {n}"
        yield f"    for ({index} = 0; {n} < {loop.cap} && {going}; ++{n}) {{"
        for node in self._needed:
            if node.scope == loop.scope:
                yield from self._statement(node, "        ")
        following = ((i, loop.following[i]) for i in states)  # all states change at once
        buffered = {i for i, x in following if isinstance(x, Node) and x.op == "state"}
        for i in buffered:
            kind = "int" if is_truth(loop.state[i]) else "real"
            now = self.name(loop.following[i])
            yield f"        {self.language.constant[kind]} {_state(loop, i)}_ = {now};"
        for i in states:
            update = f"{_state(loop, i)}_" if i in buffered else self.name(loop.following[i])
            yield f"        {_state(loop, i)} = {update};"
        yield "    }"


def _state(loop: Loop, i: int) -> str:
    return f"s{loop.scope}_{i}"


def _reachable(results: Iterable[Real]) -> tuple[list[Node], dict[Loop, list[int]]]:
    """The nodes that some are made of, in order, and the states of loops among them: of a
    state only its own value before and after a step, so nothing is named that nobody reads."""
    waiting = [x for x in results if isinstance(x, Node)]
    reached, of_loops = set[Node](), dict[Loop, set[int]]()
    while waiting:
        node = waiting.pop()
        if node in reached:
            continue
        reached.add(node)
        arguments = list(node.args)
        if node.op in ("after", "state"):
            loop, i = node.args
            of_loops.setdefault(loop, {len(loop.first) - 1}).add(i)
            arguments = [x[k] for k in (i, -1) for x in (loop.first, loop.following)]
        waiting += [x for x in arguments if isinstance(x, Node)]
    order = sorted(reached, key=lambda n: n.number)
    return order, {loop: sorted(states) for loop, states in of_loops.items()}
