"""The trace of a plan for C: what an engine asks Python for is in it, as arithmetic and tables.

A group without closed form starts Newton's method from a guess: its pose as the core follows it
from home (`blockmech.passes.homotopy`). Of a group that one driver moves, that is a table: between
two knots of the path a cubic of places and rates, so close that Newton comes to the same pose.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from blockmech.engines import trace
from blockmech.engines.nodes import PARAMETER, Node, Untraceable
from blockmech.engines.numpy import leaves
from blockmech.engines.trace import Trace, maximum, minimum, where
from blockmech.friction.continuation import Outcome
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import ROUNDING
from blockmech.passes.homotopy import BEFORE, MODES, Path
from blockmech.passes.tracking import cubics, slopes
from blockmech.plan.plan import Plan, Program
from blockmech.result.quality import (
    CHANGE_POINT,
    DEAD_CENTRE,
    JAMMED,
    NEAR_CHANGE,
    NO_ASSEMBLY,
    NOT_CONVERGED,
    SELF_LOCKED,
    UNDEFINED,
    WORDS,
)
from blockmech.typing import Floats, Nested, Real, Reals, Record, Values

READINGS: dict[str, Callable[..., Real]] = {
    "arctan2": lambda y, x: _node_of(y, x).trace.node("atan2", y, x),
    "hypot": lambda x, y: _node_of(x, y).trace.node("hypot", x, y),
    "rint": lambda x: x.trace.node("rint", x),
    "absolute": abs,
    "minimum": minimum,
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "negative": lambda a: -a,
}
"""NumPy's functions that outputs are read with, on nodes."""


def _node_of(*x: Real) -> Node:
    return next(value for value in x if isinstance(value, Node))


class ClosedTrace(Trace):
    """A trace that asks Python for nothing. Raises `Untraceable` where that is not to be had.

    ``tables`` are arrays of numbers that it needs beside the program's parameters; their
    places count on behind those.
    """

    def __init__(self, program: Program, eps: float = EPS) -> None:
        self.tables: list[Floats] = []
        self._places = len(leaves(tuple(program.parameters.values())))
        super().__init__(program, eps=eps)

    def _foreign(self, function: Callable[..., Nested]) -> Callable[..., Nested]:
        if not isinstance(function, Path):
            raise Untraceable("a load or law is a function of Python")
        return lambda q: self._guess(function, q)

    def answer(self, function: Callable[..., Nested], arguments: Values, like: Nested) -> Nested:
        """A function of Python that is asked of inputs."""
        raise Untraceable("a load or law is a function of Python")

    def ufunc(self, name: str, *args: Real) -> Real:
        """A function of NumPy, of nodes and numbers."""
        if name not in READINGS:
            raise Untraceable(f"an output is read with NumPy's {name}")
        # A number of NumPy would ask here again what a sum with it is.
        return READINGS[name](*(x.item() if isinstance(x, np.generic) else x for x in args))

    def _table(self, column: Floats) -> tuple[Node, ...]:
        """The numbers of a table as parameters."""
        first = self._places
        self.tables.append(column)
        self._places += len(column)
        return tuple(self._leaf("parameter", first + i, PARAMETER) for i in range(len(column)))

    def _guess(self, path: Path, q: Reals) -> Values:
        """Places of a group's links, and the share of the path: of one driver by a table."""
        if len(q) > 1:
            message = f"{path.block} is a general group that several drivers move"
            raise Untraceable(message)
        if not q:
            return tuple(map(tuple, path.at_home.frames[0, -path.size :].tolist())), 1.0
        home = path.knots.home
        knots, positions, rates = _knots(path)
        table = self._table(knots)
        turns, x = path.knots.turns, q[0]
        if turns:
            where_on = home + trace.modulo(x - home, turns * math.tau)
            reached: Real = 1.0
        else:
            low, high = float(knots[0]), float(knots[-1])
            where_on, reached = _on_the_arc(x, home, low, high, path.knots.rotary)
        rows = cubics(knots, positions, rates)
        links = []
        for k in range(path.size):
            link = []
            for j in range(4):
                powers = tuple(self._table(rows[d, :, k, j]) for d in range(4))
                link.append(trace.piecewise(where_on, table, powers))
            links.append(tuple(link))
        return tuple(links), reached


def _on_the_arc(x: Real, home: float, low: float, high: float, rotary: bool) -> tuple[Real, Real]:
    """Where on an arc a driver stands, and the share of the path.

    As `ContinuationNodes.follow` decides.
    """

    def share(at: Real) -> Real:
        away = at - home
        end = where(away > 0.0, high, low)
        return where((low <= at) & (at <= high), 1.0, minimum((end - home) / away, BEFORE))

    nearest, largest = x, share(x)
    if rotary:
        behind = home + trace.modulo(x - home, math.tau)
        for same in (behind, behind - math.tau):
            reach = share(same)
            nearest, largest = where(reach > largest, same, nearest), maximum(reach, largest)
    return nearest, largest


def _knots(path: Path) -> tuple[Floats, Floats, Floats]:
    """Driver values (k,) in order, places (k, m, 4) of the group's own links, and their slopes."""
    turns = path.knots.turns
    if turns:
        q, positions, rates = path.knots.laid(1, turns * math.tau)
    else:
        reach = MODES * math.tau if path.knots.rotary else math.inf
        up, down = (path.knots.laid(sense, reach) for sense in (1, -1))
        q, positions, rates = (np.concatenate([b[:0:-1], a]) for a, b in zip(up, down, strict=True))
    group = slice(-path.size, None)
    return q, positions[:, group], slopes(positions[:, group], rates[:, group])


def status(plan: Plan, values: Values, judged: Reals, of: Record) -> Real:
    """The number of `WORDS` that says whether a sample has an answer, as a node.

    As `blockmech.result.quality.failures` decides: the first block that fails is blamed. ``judged``
    are the wanted numbers; ``of`` has the blocks ``prismatic`` and ``following``.
    """
    bad: Real = False
    for x in judged:
        bad = bad | _is_not_finite(x)
    word: Real = where(bad, WORDS.index(UNDEFINED), 0)
    for block, indices in reversed([*plan.reports["friction"].items()]):
        outcome = values[indices[3]]
        locked = JAMMED if block in of["prismatic"] else SELF_LOCKED
        for kind in Outcome:
            if not kind.solved:
                failure = NOT_CONVERGED if kind == Outcome.NOT_CONVERGED else locked
                word = where(outcome == float(kind), WORDS.index(failure), word)
    for block, indices in reversed([*plan.reports["margin"].items()]):
        m = values[indices[0]]
        failing = where(m > 0.0, False, where(m == 0.0, bad, True))
        if block in of["following"]:
            failing = failing | ((m > 0.0) & (m < NEAR_CHANGE) & bad)
        lost: Real = where(m >= -ROUNDING, WORDS.index(DEAD_CENTRE), WORDS.index(NO_ASSEMBLY))
        if block in of["following"]:
            lost = where(m < -ROUNDING, WORDS.index(NO_ASSEMBLY), WORDS.index(CHANGE_POINT))
        word = where(failing, lost, word)
    return word


def _is_not_finite(x: Real) -> Real:
    rest = x - x
    return rest != rest if not isinstance(rest, Node) else rest.trace.node("is nan", rest)
