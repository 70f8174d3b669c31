"""A traced program as LLVM assembly: one function over all samples.

    fill(x, numbers, out, stride, n, slots, designs):
        for each design, with its slots of the numbers:
            what hangs on parameters alone
            for each block of its n samples:
                sines and cosines of inputs alone: those of the first design are all designs'
                flat arithmetic on LANES samples side by side
                a loop for each `blockmech.ground.plane.repeat`, until every lane has stopped
                rows of out, a design's samples behind those of the one before, or designs of rows
    returns a sum of all that it wrote: finite only where every number is

No operation is fused or re-associated, and a lane never depends on another. The text
says all that is compiled but the numbers of the mechanism, so designs of one structure
share it.

How near a matrix is to a singular one, its extreme singular values, is a loop of its own. Mirrors
from the left and the right leave two diagonals, whose squares q and e are those of the matrix's
singular values. Laguerre's method comes to the smallest and to the largest of them from outside,
each step one way through the factors of B^T B - x, which keep small ones exact:

    D_i = q_i + s_i,    s_1 = -x,    s_{i+1} = s_i e_i / D_i - x

Sources: LLVM Language Reference Manual; Golub & Van Loan, Matrix Computations, 2013, 5.4.8 (two
diagonals); Fernando & Parlett, Accurate singular values and differential qd algorithms, Numer.
Math. 67 (1994), sec. 4 and 5.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Annotated, NamedTuple

import numpy as np

from blockmech.engines.kinds import Reals
from blockmech.engines.loops import text
from blockmech.engines.nodes import LANES, PARAMETER, SAMPLE, Loop, Node, by_depth, is_truth, needed
from blockmech.ground.plane import EPS
from blockmech.typing import Data, Real

ARITHMETIC = {"+": "fadd", "-": "fsub", "*": "fmul", "/": "fdiv", "fmod": "frem"}
COMPARISONS = {"<": "olt", "<=": "ole", ">": "ogt", ">=": "oge", "==": "oeq"}
CALLS = {name: f"llvm.{name}" for name in ("sqrt", "sin", "cos", "exp")} | {"abs": "llvm.fabs"}
OF_TWO = ("atan2", "pow")
LIBRARY = ("sin", "cos", "exp", "fmod", *OF_TWO)  # of the mathematical library, called by name


def piece(knots: Reals, n: int, x: float) -> int:
    """The piece of a table with a number x: bisection, 0 where there is none."""
    low, high = 0, n - 1
    while high - low > 1:
        middle = low + (high - low >> 1)
        if knots[middle] <= x:
            low = middle
        else:
            high = middle
    return low


class Text:
    """The text for so many samples side by side."""

    def __init__(self, lanes: int = LANES) -> None:
        self.lanes = lanes
        self.reals, self.truths = f"<{lanes} x double>", f"<{lanes} x i1>"
        self.head = [
            *(f"declare {self.reals} @{f}.v{lanes}f64({self.reals})" for f in CALLS.values()),
            f"declare i1 @llvm.vector.reduce.or.v{lanes}i1({self.truths})",
            f"declare double @llvm.vector.reduce.fadd.v{lanes}f64(double, {self.reals})",
            *(f"declare double @{f}(double, double)" for f in OF_TWO),
        ]

    def fill(
        self,
        inputs: int,
        rows: Sequence[Node],
        summed: Sequence[Node] = (),
        cached: Sequence[Node] = (),
        loops: Mapping[str, Callable[..., object]] = MappingProxyType({}),
    ) -> str:
        """The text of the module; ``rows`` are what is stored, in the order of ``out``.

        ``loops`` are functions of `blockmech.engines.loops` beside it, which may call it.

        ``summed`` are inputs that are summed with them, ``cached`` nodes of inputs alone. Of
        several designs x points behind the inputs to room for these, which are then computed once
        for all; or to nothing, where each design has samples and rows of its own.
        """
        nodes = needed([*rows, *summed])
        nodes = by_depth(nodes) if loops else nodes
        lines = [
            "define double @fill(ptr %x, ptr noalias %numbers, ptr noalias %out, i64 %stride, "
            "i64 %n, i64 %slots, i64 %designs) {",
            "start:",
        ]
        systems = [node for node in nodes if node.op == "system"]
        for node in systems:  # not in a loop, where they would be made again and again
            count = len(node.args) - 1
            lines += [f"{self._name(node)} = alloca [{count} x {self.reals}], align 64"]
        lines += [
            f"%stack = alloca [{max(len(cached), 1)} x {self.reals}], align 64",
            "%several = icmp sgt i64 %designs, 1",
            f"%cache.at = getelementptr ptr, ptr %x, i64 {inputs}",
            "%cache.safe = select i1 %several, ptr %cache.at, ptr %stack",
            "%cache.room = load ptr, ptr %cache.safe",
            "%cache.is = icmp ne ptr %cache.room, null",
            "%shared = and i1 %several, %cache.is",
            "%cache = select i1 %shared, ptr %cache.room, ptr %stack",
            f"%n.rows = mul i64 %n, {len(rows)}",
            "%d.size = select i1 %shared, i64 %n, i64 %n.rows",
        ]
        for k in range(inputs):
            lines += [
                f"%x{k}.at = getelementptr ptr, ptr %x, i64 {k}",
                f"%x{k} = load ptr, ptr %x{k}.at",
            ]
        lines += [
            "br label %test",
            "test:",
            "%d = phi i64 [ 0, %start ], [ %d.next, %designed ]",
            f"%d.sum = phi {self.reals} [ zeroinitializer, %start ], [ %sum, %designed ]",
            "%d.more = icmp slt i64 %d, %designs",
            "br i1 %d.more, label %design, label %done",
            "design:",
            "%d.slots = mul i64 %d, %slots",
            "%P = getelementptr double, ptr %numbers, i64 %d.slots",
            "%d.first = mul i64 %d, %d.size",
            "%d.samples = mul i64 %d, %n",
            "%d.column = select i1 %shared, i64 0, i64 %d.samples",
        ]
        for node in nodes:
            if node.scope == PARAMETER:
                lines += self._statement(node)
        body, last = self._sample(nodes, cached)
        lines += [
            "br label %sampled",
            "sampled:",
            f"%i = phi i64 [ 0, %design ], [ %i.next, %{last} ]",
            f"%sum = phi {self.reals} [ %d.sum, %design ], [ %sum.next, %{last} ]",
            "%more = icmp slt i64 %i, %n",
            "br i1 %more, label %sample, label %designed",
            "sample:",
            "%place = add i64 %d.first, %i",
            "%column = add i64 %d.column, %i",
            *body,
        ]
        for row, node in enumerate(rows):
            lines += self._stored(row, node)
        lines += [
            *self._summed([*rows, *summed]),
            f"%i.next = add i64 %i, {self.lanes}",
            "br label %sampled",
            "designed:",
            "%d.next = add i64 %d, 1",
            "br label %test",
            "done:",
            f"%all = call double @llvm.vector.reduce.fadd.v{self.lanes}f64"
            f"(double 0.0, {self.reals} %d.sum)",
            "ret double %all",
            "}",
        ]
        helpers: Data = {"piece": piece} if any(n.op == "piece" for n in nodes) else {}
        for node in systems:
            of = Lanes(self.lanes, node.args[0])
            helpers[f"spread{of.n}"] = partial(spread, of=of)
        functions = text(**helpers, **loops).splitlines()
        head = [*self.head, *(line for line in functions if line not in self.head)]
        return "\n".join([*head, *lines]) + "\n"

    def _summed(self, nodes: Sequence[Node]) -> Iterator[str]:
        """Numbers added to the sum of the samples before; what is true or false is finite."""
        total = "%sum"
        for k, node in enumerate(node for node in nodes if not is_truth(node)):
            yield f"%sum{k} = fadd {self.reals} {total}, {self._name(node)}"
            total = f"%sum{k}"
        yield f"%sum.next = fadd {self.reals} {total}, zeroinitializer"

    def _stored(self, row: int, node: Node) -> list[str]:
        lines, name = [], self._name(node)
        if is_truth(node):
            lines = [f"%o{row}.real = uitofp {self.truths} {name} to {self.reals}"]
            name = f"%o{row}.real"
        return [
            *lines,
            f"%o{row}.first = mul i64 %stride, {row}",
            f"%o{row}.number = add i64 %o{row}.first, %place",
            f"%o{row} = getelementptr double, ptr %out, i64 %o{row}.number",
            f"store {self.reals} {name}, ptr %o{row}, align 8",
        ]

    def _sample(self, nodes: Sequence[Node], cached: Sequence[Node]) -> tuple[list[str], str]:
        """What is worked out for a block of samples, and the name of the text's last part."""
        lines: list[str] = []
        part, closed = "sample", set[int]()
        if cached:
            of_inputs = dict.fromkeys(needed(cached))
            lines, part = self._of_inputs(of_inputs, cached), "ready"
            nodes = [node for node in nodes if node not in of_inputs]
        for node in nodes:
            if node.op == "after":
                loop = node.args[0]
                if loop.scope not in closed:
                    closed.add(loop.scope)
                    inside = [n for n in nodes if n.scope == loop.scope and n.op != "state"]
                    lines += self._loop(loop, inside, part)
                    part = f"after{loop.scope}"
            elif node.scope == SAMPLE:
                lines += self._statement(node)
        return lines, part

    def _of_inputs(self, nodes: Iterable[Node], cached: Sequence[Node]) -> list[str]:
        """Nodes of inputs alone, which designs with the same samples take from the first one."""
        later = set(cached)  # a list would compare nodes, which are numbers
        lines = [line for x in nodes if x not in later for line in self._statement(x)]
        lines += [
            "%block = select i1 %shared, i64 %i, i64 0",
            f"%block.first = mul i64 %block, {len(cached)}",
            "%d.later = icmp sgt i64 %d, 0",
            "%again = and i1 %d.later, %shared",
        ]
        for k, node in enumerate(cached):
            address = f"{self._name(node)}.place"
            lines.append(f"{address}.number = add i64 %block.first, {k * self.lanes}")
            lines.append(f"{address} = getelementptr double, ptr %cache, i64 {address}.number")
        lines += ["br i1 %again, label %known, label %new", "new:"]
        for node in cached:
            name = self._name(node)
            (call,) = self._statement(node)
            lines.append(call.replace(name, f"{name}.new", 1))
            lines.append(f"store {self.reals} {name}.new, ptr {name}.place, align 64")
        lines += ["br label %ready", "known:"]
        for node in cached:
            name = self._name(node)
            lines.append(f"{name}.known = load {self.reals}, ptr {name}.place, align 64")
        lines += ["br label %ready", "ready:"]
        for node in cached:
            name = self._name(node)
            lines.append(
                f"{name} = phi {self.reals} [ {name}.new, %new ], [ {name}.known, %known ]"
            )
        return lines

    def _loop(self, loop: Loop, inside: Iterable[Node], before: str) -> list[str]:
        """A loop in which each lane keeps its state from when it has stopped."""
        k, going = loop.scope, self._name(loop.state[-1])
        lines = [f"br label %test{k}", f"test{k}:"]
        both = list(zip(loop.state, loop.first, loop.following, strict=True))
        for state, first, _ in both:
            name, kind = self._name(state), self._kind(state)
            at_first = self._name(first, is_truth(state))
            lines.append(
                f"{name} = phi {kind} [ {at_first}, %{before} ], [ {name}.next, %body{k} ]"
            )
        lines += [
            f"%n{k} = phi i64 [ 0, %{before} ], [ %n{k}.next, %body{k} ]",
            f"%few{k} = icmp slt i64 %n{k}, {loop.cap}",
            f"%some{k} = call i1 @llvm.vector.reduce.or.v{self.lanes}i1({self.truths} {going})",
            f"%more{k} = and i1 %few{k}, %some{k}",
            f"br i1 %more{k}, label %body{k}, label %after{k}",
            f"body{k}:",
        ]
        for node in inside:
            lines += self._statement(node)
        for state, _, following in both:
            name, kind = self._name(state), self._kind(state)
            new = f"{kind} {self._name(following, is_truth(state))}"
            lines.append(f"{name}.next = select {self.truths} {going}, {new}, {kind} {name}")
        return [*lines, f"%n{k}.next = add i64 %n{k}, 1", f"br label %test{k}", f"after{k}:"]

    def _kind(self, x: Real) -> str:
        return self.truths if is_truth(x) else self.reals

    def _name(self, x: Real, truth: bool = False) -> str:
        """Name of a node, or a number as all lanes of a vector."""
        if isinstance(x, Node):
            return (
                f"%s{x.args[0].scope}.{x.args[1]}"
                if x.op in ("state", "after")
                else f"%v{x.number}"
            )
        if truth:
            return f"<{', '.join([f'i1 {int(x)}'] * self.lanes)}>"
        bits = struct.pack(">d", float(x)).hex().upper()
        return f"<{', '.join([f'double 0x{bits}'] * self.lanes)}>"

    def _statement(self, node: Node) -> list[str]:
        """The text of one operation."""
        op, me = node.op, self._name(node)
        if op in ("input", "parameter"):
            return self._loaded(node)
        if op == "system":
            return list(self._system(node))
        if op == "part":
            return [
                f"{me}.at = getelementptr {self.reals}, ptr {self._name(node.args[0])}, "
                f"i64 {node.args[1]}",
                f"{me} = load {self.reals}, ptr {me}.at",
            ]
        if op in ("piece", "entry", *OF_TWO):
            return list(self._by_lane(node))
        truth = op in ("&", "|")
        args = [self._name(x, truth) for x in node.args]
        if op in ARITHMETIC:
            return [f"{me} = {ARITHMETIC[op]} {self.reals} {args[0]}, {args[1]}"]
        if op in COMPARISONS:
            return [f"{me} = fcmp {COMPARISONS[op]} {self.reals} {args[0]}, {args[1]}"]
        if truth:
            return [f"{me} = {'and' if op == '&' else 'or'} {self.truths} {args[0]}, {args[1]}"]
        if op == "where":
            condition, a, b = node.args
            kind = self._kind(node)
            if_true, if_false = (f"{kind} {self._name(x, is_truth(node))}" for x in (a, b))
            chosen = f"{self.truths} {self._name(condition)}, {if_true}, {if_false}"
            return [f"{me} = select {chosen}"]
        if op == "is nan":
            return [f"{me} = fcmp uno {self.reals} {args[0]}, {args[0]}"]
        if op == "neg":
            return [f"{me} = fneg {self.reals} {args[0]}"]
        return [f"{me} = call {self.reals} @{CALLS[op]}.v{self.lanes}f64({self.reals} {args[0]})"]

    def _system(self, node: Node) -> Iterator[str]:
        """The entries of a matrix, and the function that works on them."""
        me, (n, *entries) = self._name(node), node.args
        for k, x in enumerate(entries):
            yield f"{me}.{k} = getelementptr {self.reals}, ptr {me}, i64 {k}"
            yield f"store {self.reals} {self._name(x)}, ptr {me}.{k}"
        yield f"call void @spread{n}(ptr {me})"

    def _loaded(self, node: Node) -> list[str]:
        """An input of each lane, or a parameter in all of them."""
        me, index = self._name(node), node.args[0]
        if node.op == "input":
            return [
                f"{me}.at = getelementptr double, ptr %x{index}, i64 %column",
                f"{me} = load {self.reals}, ptr {me}.at, align 8",
            ]
        first = f"{self.reals} {me}.first, {self.reals} poison"
        return [
            f"{me}.at = getelementptr double, ptr %P, i64 {index}",
            f"{me}.one = load double, ptr {me}.at",
            f"{me}.first = insertelement {self.reals} poison, double {me}.one, i32 0",
            f"{me} = shufflevector {first}, <{self.lanes} x i32> zeroinitializer",
        ]

    def _by_lane(self, node: Node) -> Iterator[str]:
        """What is done lane by lane: functions of two numbers, and numbers of a table."""
        me, before = self._name(node), "poison"
        kind = f"<{self.lanes} x i64>" if node.op == "piece" else self.reals
        scalar = "i64" if node.op == "piece" else "double"
        if node.op == "piece":
            first, last = (knot.args[0] for knot in node.args[1:])
            yield f"{me}.knots = getelementptr double, ptr %P, i64 {first}"
        if node.op == "entry":
            yield f"{me}.row = getelementptr double, ptr %P, i64 {node.args[1].args[0]}"
        for k in range(self.lanes):
            x = f"{me}.x{k}"
            vector = f"<{self.lanes} x i64>" if node.op == "entry" else self.reals
            yield f"{x} = extractelement {vector} {self._name(node.args[0])}, i32 {k}"
            if node.op == "piece":
                n = last - first + 1
                yield f"{me}.y{k} = call i64 @piece(ptr {me}.knots, i64 {n}, double {x})"
            elif node.op == "entry":
                yield f"{me}.at{k} = getelementptr double, ptr {me}.row, i64 {x}"
                yield f"{me}.y{k} = load double, ptr {me}.at{k}"
            else:
                yield f"{x}.b = extractelement {self.reals} {self._name(node.args[1])}, i32 {k}"
                yield f"{me}.y{k} = call double @{node.op}(double {x}, double {x}.b)"
            after = me if k == self.lanes - 1 else f"{me}.{k}"
            yield f"{after} = insertelement {kind} {before}, {scalar} {me}.y{k}, i32 {k}"
            before = after


STEPS = 8 - round(math.log2(EPS))  # of Laguerre's method: six or so; 60 halve a cluster to its end


class Lanes(NamedTuple):
    """Matrices side by side, and their number of rows."""

    lanes: int
    n: int


def spread(of: Lanes, a: Annotated[Reals, "of.lanes"]) -> None:
    """The ratio of the extreme singular values takes the place of the first entry.

    a : (n n, lanes) columns of the matrix one after the other; what was in it is gone
    """
    n = of.n
    for c in range(n):
        mirrored(of, a, c * n + c, 1, n - c, n, n - 1 - c)
        if c < n - 2:
            mirrored(of, a, (c + 1) * n + c, n, n - 1 - c, 1, n - 1 - c)
    total = a[0] * a[0]
    for i in range(n):
        a[i * n + i] *= a[i * n + i]
        if i > 0:
            a[i * n + i - 1] *= a[i * n + i - 1]
            total += a[i * n + i] + a[i * n + i - 1]
    a[1], a[2] = 0.0 * total, total
    extreme(of, a, 1, 1.0)
    extreme(of, a, 2, -1.0)
    a[0] = np.sqrt(a[1] / a[2])


def extreme(of: Lanes, a: Annotated[Reals, "of.lanes"], at: int, side: float) -> None:
    """The smallest (side 1) or largest (-1) square, from what stands at a row."""
    n, x = of.n, a[at] + 0.0
    going, unknown = x >= 0.0, a[2] * 0.0
    for _ in range(STEPS):
        s, s1, s2 = -x, unknown - 1.0, unknown
        slope, bend = unknown, unknown
        for i in range(n):
            inverse = 1.0 / (a[i * n + i] + s)
            part = s1 * inverse
            slope = slope + part
            bend = bend + part * part - s2 * inverse
            if i < n - 1:
                e = a[(i + 1) * n + i] * inverse
                factor = e * a[i * n + i] * inverse
                s, s1, s2 = s * e - x, factor * s1 - 1.0, factor * (s2 - 2.0 * (s1 * part))
        square = n * bend - slope * slope
        root = np.sqrt((n - 1.0) * np.where(square > 0.0, square, unknown))
        step = float(n) / (side * root - slope)
        step = np.where(abs(step) < a[2], step, unknown)
        x = np.where(going, x + step, x)
        going = going & (abs(step) > 4.0 * EPS * x)
        if not np.any(going):
            break
    a[at] = x


def mirrored(
    of: Lanes,
    a: Annotated[Reals, "of.lanes"],
    first: int,
    step: int,
    count: int,
    apart: int,
    images: int,
) -> None:
    """Turn a row or column (every step-th entry) onto its first entry, and others with it."""
    total = a[first] * a[first]
    for i in range(1, count):
        total += a[first + i * step] * a[first + i * step]
    edge = np.sqrt(total)
    edge = np.where(a[first] > 0.0, -edge, edge)
    half = total - edge * a[first]
    share = np.where(half > 0.0, 1.0 / half, 0.0)
    a[first] -= edge
    for k in range(1, images + 1):
        entry = first + k * apart
        factor = a[first] * a[entry]
        for i in range(1, count):
            factor += a[first + i * step] * a[entry + i * step]
        factor *= share
        for i in range(count):
            a[entry + i * step] -= factor * a[first + i * step]
    a[first] = edge
