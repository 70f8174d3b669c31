"""Operations: what a traced program is made of, and in which order they are done.

A `Node` is one operation on earlier nodes. What it depends on says where it has to be worked
out: parameters alone once for all samples, a `blockmech.ground.plane.repeat` in its loop, all else
once a sample.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NoReturn

import numpy as np

from blockmech.typing import Real, Values

LANES = 8  # one vector register of the widest processors; LLVM splits it on others
PARAMETER, SAMPLE = 0, 1  # scopes: known before the samples, once a sample; loops count on

TRUTHS = ("<", "<=", ">", ">=", "==", "is nan", "&", "|")  # operations that give truth values


ELEMENTARY = ("+", "-", "*", "/", "neg", "sin", "cos")


class Untraceable(Exception):
    """A program that flat arithmetic cannot say, and why."""


class AsksPython(Untraceable):
    """A program that asks a function of Python of what it computes."""


Operation = Callable[..., "Node"]


def _both(op: str) -> tuple[Operation, Operation]:
    """An operator with the node on its left, and on its right."""
    return lambda a, b: a.trace.node(op, a, b), lambda b, a: b.trace.node(op, a, b)


def _of_one(op: str) -> Operation:
    return lambda a: a.trace.node(op, a)


class Node:
    """One real (or truth value) of a program, as an operation on others."""

    __slots__ = ("args", "number", "op", "scope", "trace")
    __hash__ = object.__hash__

    def __init__(self, trace: Any, op: str, args: Values, scope: int) -> None:
        self.trace, self.op, self.args, self.scope = trace, op, args, scope
        self.number = len(trace.nodes)
        trace.nodes.append(self)

    imag = 0.0  # as of any real number

    @property
    def real(self) -> Node:
        """Itself."""
        return self

    def __bool__(self) -> NoReturn:
        raise Untraceable("it branches on a number of the sample")

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *args: Real, **options: Any) -> Any:
        return self.trace.ufunc(ufunc.__name__, *args)

    __add__, __radd__ = _both("+")
    __sub__, __rsub__ = _both("-")
    __mul__, __rmul__ = _both("*")
    __truediv__, __rtruediv__ = _both("/")
    __and__, __rand__ = _both("&")
    __or__, __ror__ = _both("|")
    (__lt__, _), (__le__, _), (__gt__, _), (__ge__, _) = map(_both, ("<", "<=", ">", ">="))
    __eq__ = _both("==")[0]  # type: ignore[assignment]
    __neg__, __abs__ = _of_one("neg"), _of_one("abs")


def is_truth(x: Real) -> bool:
    """Whether a node or number of the text is a truth value."""
    if not isinstance(x, Node):
        return isinstance(x, bool)
    if x.op in ("state", "after"):
        loop, i = x.args
        return is_truth(loop.first[i])
    return x.op in TRUTHS or (x.op == "where" and is_truth(x.args[1]))


class Loop:
    """A `blockmech.ground.plane.repeat`: its state before, in, and after a step, and its cap."""

    def __init__(self, trace: Any, cap: int, first: list[Real]) -> None:
        trace.loops.append(self)
        self.scope = SAMPLE + len(trace.loops)
        self.cap, self.first = cap, first
        self.state = [Node(trace, "state", (self, i), self.scope) for i in range(len(first))]
        self.following: list[Real] = []


def of_inputs(nodes: Iterable[Node]) -> list[Node]:
    """Sines and cosines of inputs alone, of nodes in their order: the same for all designs."""
    alone = set[Node]()
    for node in nodes:
        elementary = node.op == "input" or (node.scope == SAMPLE and node.op in ELEMENTARY)
        if elementary and all(x in alone for x in node.args if isinstance(x, Node)):
            alone.add(node)
    return [node for node in nodes if node in alone and node.op in ("sin", "cos")]


def needed(results: Iterable[Real]) -> list[Node]:
    """The nodes that some nodes are made of, in order."""
    waiting, reached = [x for x in results if isinstance(x, Node)], set[Node]()
    while waiting:
        node = waiting.pop()
        if node in reached:
            continue
        reached.add(node)
        waiting += _operands(node, loops=True)
    return sorted(reached, key=lambda n: n.number)


def by_depth(nodes: Iterable[Node]) -> list[Node]:
    """Nodes in their order by how many others come before them, one after the other.

    Where states come one by one, most of the time is that of the longest such chain: what belongs
    to it is not to wait in line behind what does not.
    """
    depth = dict[Node, int]()
    for node in nodes:
        before = _operands(node, loops=node.op == "after")
        depth[node] = 1 + max((depth[x] for x in before), default=0)
    return sorted(depth, key=lambda node: (depth[node], node.number))


def _operands(node: Node, loops: bool) -> list[Node]:
    """The nodes that one is made of; of a state in a loop also what it is after a step."""
    if node.op in ("after", "state"):
        loop = node.args[0]
        operands = [*loop.first, *(loop.following if loops else ())]
    else:
        operands = list(node.args)
    return [x for x in operands if isinstance(x, Node)]
