"""Plain Python functions of numbers and arrays as LLVM assembly: loops that no trace can say.

A function of a module is written once. Run by Python it is its own reference; translated it has
the same bits, for nothing is fused and nothing re-associated. The subset:

    arguments    float, int, bool, `Reals`, `Counts`, functions ``Callable[[Reals, int], float]``.
                 What is given beforehand, with `partial`, is part of the text: sizes (an int, or
                 a tuple ``of`` of them with names), the name of a function in the text. They
                 may say blocks of an array: ``K: Annotated[Reals, "of.stages", "of.width"]``, or
                 that it is one row: ``h: Annotated[Reals, ROW, "of.lanes"]``.
                 A NamedTuple of arrays is a record, called with `addresses_of` it; made of arrays
                 in a call, ``f(Table(rows, by))``
    statements   assignments (also of tuples, and ``+=``), ``if``, ``while``, ``for`` over a range,
                 ``break``, ``continue``, ``return``, calls
    expressions  + - * / of numbers, >> of ints, comparisons of two, and, or, not,
                 ``a if c else b``, abs, min and max (of two) and `MATH` of floats, ``float(n)``,
                 ``K[m, s, j]`` a number, ``K[m, s]`` a row in the same memory, ``K[m:]`` the array
                 from a block on, ``record.K`` one; other functions of this kind, numbers of their
                 module
    lanes        rows of floats in + - * / and comparisons, with numbers as well: vectors;
                 ``np.sqrt``, abs, ``np.where(test, a, b)``, ``&``, ``np.any(test)``, ``np.max``
                 and ``np.min`` of them; ``a[i] = vector`` writes a row, ``a[:] = vector`` an
                 array that is one, and ``a[i] @ M`` is a row times the rows ``M[j]``

A name keeps the kind of its first value. A division by zero is infinite, or NaN, as of NumPy's
numbers. There is no room but what is given as an argument. All else is a TypeError that names the
line.

    >>> def mean(x: Reals, n: int) -> float:
    ...     total = 0.0
    ...     for i in range(n):
    ...         total += x[i]
    ...     return total / n

    (mean,) = machine_code(text(mean=mean), ("mean", signature(mean)))  # of `engines.llvm`
    mean(x.ctypes.data, x.size)

Source: LLVM Language Reference Manual; what is put on the stack here, its pass mem2reg puts into
registers.
"""

from __future__ import annotations

import ast
import ctypes
import inspect
import itertools
from collections.abc import Callable, Iterable
from functools import partial
from types import FunctionType
from typing import Any, NoReturn, get_type_hints

import numpy as np

from blockmech.engines.kinds import (
    COUNT,
    IN_C,
    LANEWISE,
    NAMES,
    NOTHING,
    OPERATIONS,
    PLACE,
    REAL,
    TRANSLATED,
    TRUTH,
    Counts,
    Reals,
    Value,
    functions_by_line,
    meaning_of,
    number,
    parts_of,
)
from blockmech.engines.nodes import LANES, Untraceable
from blockmech.typing import Arguments

TOGETHER = 2 * LANES  # columns of a product: eight registers at least


def text(**functions: Callable[..., object]) -> str:
    """The text of functions, or partials of them, by their names in the module.

    Raises TypeError, with the line, for what is no part of the language, and `Untraceable` where
    there is no source.
    """
    module = _Module()
    for name, function in functions.items():
        module.add(function, name)
    return "\n".join([*module.declared, *module.parts])


def signature(function: Callable[..., object]) -> Any:
    """How ctypes calls a function, or a partial of one: arrays by their places."""
    target, bound = parts_of(function)
    hints = get_type_hints(target, include_extras=True)
    answer = IN_C[meaning_of(hints.pop("return")).kind]
    kinds = (IN_C[meaning_of(hint).kind] for name, hint in hints.items() if name not in bound)
    return ctypes.CFUNCTYPE(answer, *kinds)


def addresses_of(record: Iterable[Reals | Counts]) -> Any:
    """Where each array of a record stands: what machine code takes for the record."""
    addresses = [array.ctypes.data for array in record]
    return (ctypes.c_void_p * len(addresses))(*addresses)


class _Module:
    """Functions translated so far, each once."""

    def __init__(self) -> None:
        self.declared, self.parts = dict[str, None](), list[str]()
        self.known = dict[Any, Value]()

    def add(self, function: Callable[..., object], name: str = "") -> Value:
        """A function, and those that it calls; how it is called."""
        target, bound = parts_of(function)
        key = name, target, *bound.items()
        if key not in self.known:
            name = name or f"{target.__name__}.{len(self.known)}"
            self.known[key], part = _Translation(self, target, bound, name).translate()
            self.parts.append(part)
        return self.known[key]


class _Translation:
    """One function under way."""

    def __init__(self, module: _Module, function: Any, bound: Arguments, name: str) -> None:
        code, self.module = function.__code__, module
        self.file, self.line = code.co_filename, code.co_firstlineno
        if self.line not in functions_by_line(self.file):
            raise Untraceable(f"no source of {function.__name__}")
        self.body = functions_by_line(self.file)[self.line].body
        self.lines, self.slots, self.count = list[str](), list[str](), itertools.count()
        self.loops = list[tuple[str, str]]()  # labels behind them, and of what is next
        hints = get_type_hints(function, include_extras=True)
        self.gives = meaning_of(hints.pop("return")).kind
        self.given = {k: x for k, x in bound.items() if not isinstance(x, str)}
        self.meanings = function.__globals__ | self.given
        self.known, takes = dict[str, Value](), list[Value]()
        for k, hint in hints.items():
            if k in self.given:
                continue
            value = meaning_of(hint, self.given)._replace(
                text=f"@{bound[k]}" if k in bound else f"%{k}"
            )
            for i, (part, array) in enumerate(value.parts):
                address = self._new(f"getelementptr ptr, ptr {value.text}, i64 {i}", PLACE)
                self.known[f"{k}.{part}"] = self._loaded(array._replace(text=address.text))
            self.known[k] = value if value.gives or value.parts else self._slot(k, value)
            takes += [] if k in bound else [value]
        kinds = tuple(x.kind for x in takes)
        self.value = Value(f"@{name}", PLACE, takes=kinds, gives=self.gives)
        arguments = ", ".join(f"{x.kind} {x.text}" for x in takes)
        scope = "internal " if "." in name else ""
        self.head = f"define {scope}{self.gives} @{name}({arguments}) {{"

    def translate(self) -> tuple[Value, str]:
        """How the function is called, and its text."""
        self._block(self.body)
        if self.gives != NOTHING and not isinstance(self.body[-1], ast.Return):
            self._refuse("a function with an answer ends with a return")
        end = "ret void" if self.gives == NOTHING else "unreachable"
        return self.value, "\n".join([self.head, *self.slots, *self.lines, end, "}"])

    def _refuse(self, reason: str) -> NoReturn:
        raise TypeError(f"{self.file}, line {self.line}: {reason}")

    # -- the text ----------------------------------------------------------------------

    def _new(self, text: str, kind: str, **about: Any) -> Value:
        """A register with what an instruction gives."""
        name = f"%.{next(self.count)}"
        self.lines.append(f"{name} = {text}")
        return Value(name, kind, **about)

    def _labels(self, count: int) -> list[str]:
        return [f"b{next(self.count)}" for _ in range(count)]

    def _leave(self, text: str) -> None:
        """An instruction behind which the text goes on elsewhere; what follows is not reached."""
        self.lines += [text, f"{self._labels(1)[0]}:"]

    def _slot(self, name: str, value: Value) -> Value:
        """A place on the stack for a name, with its first value."""
        slot = value._replace(text=f"%{name}.{next(self.count)}")
        self.slots.append(f"{slot.text} = alloca {value.type}")
        self.lines.append(f"store {value.type} {value.text}, ptr {slot.text}")
        return slot

    def _if(self, test: Value, yes: Callable[[], Any], no: Callable[[], Any]) -> None:
        first, second, after = self._labels(3)
        self.lines += [f"br i1 {test.text}, label %{first}, label %{second}", f"{first}:"]
        yes()
        self.lines += [f"br label %{after}", f"{second}:"]
        no()
        self.lines += [f"br label %{after}", f"{after}:"]

    # -- statements ----------------------------------------------------------------------

    def _block(self, body: Iterable[ast.stmt]) -> None:
        for statement in body:
            self.line = getattr(statement, "lineno", self.line)
            self._statement(statement)

    def _statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Tuple(elts=values)):
                for target, value in zip(targets, [self._value(x) for x in values], strict=True):
                    self._store(target, value)
            case ast.Assign(targets=[target], value=value):
                self._store(target, self._value(value))
            case ast.AugAssign(target=target, op=op, value=value):
                self._store(target, self._both(op, self._value(target), self._value(value)))
            case ast.If(test=test, body=body, orelse=orelse):
                truth = self._as(self._value(test), TRUTH)
                self._if(truth, lambda: self._block(body), lambda: self._block(orelse))
            case ast.While(test=test, body=body, orelse=[]):
                self._while(test, body)
            case ast.For(target=ast.Name(id=name), iter=ast.Call(func=of, args=ends), orelse=[]):
                if self._meaning(of) is not range:
                    self._refuse("a loop goes over a range")
                self._for(name, ends, node.body)
            case ast.Break() | ast.Continue():
                self._leave(f"br label %{self.loops[-1][isinstance(node, ast.Continue)]}")
            case ast.Return(value=None) if self.gives == NOTHING:
                self._leave("ret void")
            case ast.Return(value=ast.expr() as value):
                self._leave(f"ret {self.gives} {self._as(self._value(value), self.gives).text}")
            case ast.Expr(value=ast.Call() as call):
                self._value(call)
            case ast.Expr(value=ast.Constant(value=str())) | ast.Pass():
                pass
            case _:
                self._refuse(f"no statement of this language: {ast.unparse(node)}")

    def _while(
        self, test: ast.expr, body: list[ast.stmt], increment: Iterable[ast.stmt] = ()
    ) -> None:
        again, inside, following, after = self._labels(4)
        self.lines += [f"br label %{again}", f"{again}:"]
        truth = self._as(self._value(test), TRUTH).text
        self.lines += [f"br i1 {truth}, label %{inside}, label %{after}", f"{inside}:"]
        self.loops.append((after, following))
        self._block(body)
        self.loops.pop()
        self.lines += [f"br label %{following}", f"{following}:"]
        self._block(increment)
        self.lines += [f"br label %{again}", f"{after}:"]

    def _for(self, name: str, ends: list[ast.expr], body: list[ast.stmt]) -> None:
        """Over a range, whose ends are worked out once: the name may be assigned inside."""
        first, end, step = [
            [ast.Constant(0), *ends, ast.Constant(1)],
            [*ends, ast.Constant(1)],
            ends,
        ][len(ends) - 1]
        below = not isinstance(step, ast.UnaryOp)  # a step down is written -1
        at, last = (ast.Name(f"{name}.{next(self.count)}") for _ in range(2))
        for target, value in ((at, first), (last, end)):
            self._store(target, self._as(self._value(value), COUNT))
        test = ast.Compare(at, [ast.Lt() if below else ast.Gt()], [last])
        start = ast.Assign([ast.Name(name)], at)
        self._while(test, [start, *body], [ast.AugAssign(at, ast.Add(), step)])

    def _store(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            if value.kind == NOTHING or value.gives or value.parts:
                self._refuse(f"{target.id} is no number and no array")
            if target.id not in self.known:
                self.known[target.id] = self._slot(target.id, value)
                return
            slot = self.known[target.id]
        elif isinstance(target, ast.Subscript):
            slot = self._at(target)
        else:
            self._refuse(f"nothing to assign to: {ast.unparse(target)}")
        if isinstance(target, ast.Subscript) and slot.of:
            value, slot = self._row(value), self._row(slot)._replace(text=slot.text)
        value = self._as(value, slot.kind, slot.lanes)
        if slot[2:5] != value[2:5]:
            self._refuse("an array in the place of another")
        self.lines.append(f"store {value.type} {value.text}, ptr {slot.text}, align 8")

    # -- expressions ---------------------------------------------------------------------

    def _as(self, value: Value, kind: str, lanes: int = 0) -> Value:
        """A value of a kind: an int may stand for a float, and one number for all lanes."""
        if value.kind == COUNT and kind == REAL:
            value = self._new(f"sitofp i64 {value.text} to double", REAL)
        if lanes and not value.lanes and value.kind == kind:
            wide = value._replace(lanes=lanes).type
            first = self._new(f"insertelement {wide} poison, {kind} {value.text}, i32 0", kind)
            every = f"{wide} {first.text}, {wide} poison, <{lanes} x i32> zeroinitializer"
            value = self._new(f"shufflevector {every}", kind, lanes=lanes)
        if (value.kind, value.lanes) != (kind, lanes):
            self._refuse(f"{NAMES.get(value.kind, 'nothing')} where {NAMES[kind]} is to be")
        return value

    def _loaded(self, slot: Value) -> Value:
        register = self._new(f"load {slot.type}, ptr {slot.text}, align 8", slot.kind)
        return slot._replace(text=register.text)

    def _row(self, value: Value) -> Value:
        """A row of an array as a vector; other values as they are."""
        if not value.row or value.of != REAL:
            return value
        return self._loaded(Value(value.text, REAL, lanes=value.row))

    def _value(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant(value=bool() | int() | float() as x):
                return number(x)
            case ast.Name(id=name) if name in self.known:
                slot = self.known[name]
                return slot if slot.gives or slot.parts else self._loaded(slot)
            case ast.Attribute(value=ast.Name(id=name), attr=part) if name in self.known:
                if f"{name}.{part}" not in self.known:
                    self._refuse(f"{name} has no {part}")
                return self.known[f"{name}.{part}"]
            case ast.Name() | ast.Attribute():
                meaning = self._meaning(node)
                if isinstance(meaning, FunctionType):
                    return self.module.add(meaning)
                if not isinstance(meaning, int | float):
                    self._refuse(f"{ast.unparse(node)} is no number")
                return number(meaning)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                row = self._row(self._value(operand))
                negation = f"fneg {row.type}" if row.kind == REAL else "sub i64 0,"
                return self._new(f"{negation} {row.text}", row.kind, lanes=row.lanes)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return self._new(f"xor i1 {self._as(self._value(operand), TRUTH).text}, 1", TRUTH)
            case ast.BinOp(left=left, op=ast.MatMult(), right=right):
                return self._product(self._value(left), self._value(right))
            case ast.BinOp(left=left, op=op, right=right):
                return self._both(op, self._value(left), self._value(right))
            case ast.Compare(left=left, ops=[order], comparators=[right]):
                return self._both(order, self._value(left), self._value(right))
            case ast.BoolOp() | ast.IfExp():
                return self._chosen(node)
            case ast.Subscript():
                slot = self._at(node)
                return slot if slot.of else self._loaded(slot)
            case ast.Call(func=function, args=arguments, keywords=[]):
                return self._called(function, arguments)
        return self._refuse(f"no expression of this language: {ast.unparse(node)}")

    def _meaning(self, node: ast.expr) -> Any:
        """What a name is in the function's module."""
        try:
            return eval(compile(ast.Expression(node), self.file, "eval"), self.meanings)
        except (NameError, AttributeError) as error:
            self._refuse(str(error))

    def _both(self, op: ast.operator | ast.cmpop, a: Value, b: Value) -> Value:
        a, b = self._row(a), self._row(b)
        real = REAL in (a.kind, b.kind) or isinstance(op, ast.Div)
        kind = REAL if real else a.kind
        a, b = (self._as(x, kind, a.lanes or b.lanes) for x in (a, b))
        name = OPERATIONS.get((kind, type(op)))
        if name is None:
            self._refuse(f"no operation of this language: {type(op).__name__} of {NAMES[kind]}")
        text = f"{name} {a.type} {a.text}, {b.text}"
        return self._new(text, TRUTH if "cmp" in name else kind, lanes=a.lanes)

    def _product(self, row: Value, matrix: Value) -> Value:
        """A row times the rows of an array: columns by columns, as many as registers hold."""
        if not (row.lanes or row.row) or len(matrix.shape) != 1:
            self._refuse("@ takes a row and an array of rows")
        if row.lanes:
            row = Value(self._slot("row", row).text, PLACE, REAL, row=row.lanes)
        (columns,), first = matrix.shape, 0
        out = Value(f"%product.{next(self.count)}", REAL, lanes=columns)
        self.slots.append(f"{out.text} = alloca {out.type}")
        x, j = (ast.Name(f"{name}.{next(self.count)}") for name in "xj")
        self.known[x.id] = self._slot(x.id, row)
        while first < columns:
            lanes = min(1 << (columns - first).bit_length() - 1, TOGETHER)
            total, M = (ast.Name(f"{name}.{next(self.count)}") for name in "sM")
            block, target = (
                self._new(f"getelementptr double, ptr {x.text}, i64 {first}", PLACE)
                for x in (matrix, out)
            )
            self.known[M.id] = self._slot(M.id, matrix._replace(text=block.text, row=lanes))
            self._store(total, self._as(number(0.0), REAL, lanes))
            term = ast.BinOp(ast.Subscript(x, j), ast.Mult(), ast.Subscript(M, j))
            self._for(j.id, [ast.Constant(row.row)], [ast.AugAssign(total, ast.Add(), term)])
            value = self._value(total)
            self.lines.append(f"store {value.type} {value.text}, ptr {target.text}, align 8")
            first += lanes
        return self._loaded(out)

    def _chosen(self, node: ast.BoolOp | ast.IfExp) -> Value:
        """One of two values, of which the other is not computed."""
        choice = ast.Name(f"chosen.{next(self.count)}")

        def put(x: ast.expr, kind: str = "") -> None:
            value = self._value(x)
            self._store(choice, self._as(value, kind) if kind else value)

        if isinstance(node, ast.IfExp):
            test = self._as(self._value(node.test), TRUTH)
            self._if(test, lambda: put(node.body), lambda: put(node.orelse))
        else:
            put(node.values[0], TRUTH)
            for x in node.values[1:]:
                both = (lambda x=x: put(x, TRUTH)), (lambda: None)
                self._if(self._value(choice), *both[:: 1 if isinstance(node.op, ast.And) else -1])
        return self._value(choice)

    def _at(self, node: ast.Subscript) -> Value:
        """The place of a number of an array, or the array from there on."""
        array, index = self._value(node.value), node.slice
        rest = isinstance(index, ast.Slice)
        match index:
            case ast.Slice(lower=ast.expr() as first, upper=None, step=None):
                indices = [first]
            case ast.Slice(lower=None, upper=None, step=None) if array.row:
                return array
            case ast.Slice():
                self._refuse("a slice is array[first:]")
            case _:
                indices = index.elts if isinstance(index, ast.Tuple) else [index]
        rank = len(array.shape) + 1 - len(indices)
        if not array.of or rank < 0:
            self._refuse(f"{len(indices)} indices of {ast.unparse(node.value)}")
        counts, at = [self._as(self._value(x), COUNT) for x in indices], number(0)
        for k, size in enumerate((0, *array.shape)):
            at = self._new(f"mul i64 {at.text}, {size}", COUNT)
            if k < len(counts):
                at = self._new(f"add i64 {at.text}, {counts[k].text}", COUNT)
        address = self._new(f"getelementptr {array.of}, ptr {array.text}, i64 {at.text}", PLACE)
        if not rank and not rest:
            return address._replace(kind=array.of)
        shape = array.shape if rest else array.shape[len(indices) :]
        row = (array.row or array.shape[-1]) if array.shape and not shape else 0
        return address._replace(of=array.of, shape=shape, row=row)

    def _called(self, node: ast.expr, arguments: list[ast.expr]) -> Value:
        callee = self.known.get(node.id) if isinstance(node, ast.Name) else None
        function: Any = None if callee else self._meaning(node)
        if function is float and len(arguments) == 1:
            return self._as(self._value(arguments[0]), REAL)
        if function in LANEWISE:
            return self._lanewise(function, [self._row(self._value(x)) for x in arguments])
        if callee is None:
            function = TRANSLATED.get(function, function)
            if hasattr(function, "_fields"):
                return self._record(function, [self._value(x) for x in arguments])
            if not isinstance(function, FunctionType):
                self._refuse(f"no function of this language: {ast.unparse(node)}")
            names = inspect.signature(function).parameters
            bound = {
                k: self.given[x.id]
                for k, x in zip(names, arguments, strict=False)
                if isinstance(x, ast.Name) and x.id in self.given
            }
            callee = self.module.add(partial(function, **bound))
            arguments = [x for k, x in zip(names, arguments, strict=False) if k not in bound]
        if len(arguments) != len(callee.takes):
            self._refuse(f"{ast.unparse(node)} takes {len(callee.takes)} arguments")
        values = [self._value(x) for x in arguments]
        pairs = zip(values, callee.takes, strict=True)
        call = f"call {callee.gives} {callee.text}("
        call += ", ".join(f"{kind} {self._as(x, kind).text}" for x, kind in pairs) + ")"
        if callee.gives == NOTHING:
            self.lines.append(call)
            return Value("", NOTHING)
        return self._new(call, callee.gives)

    def _record(self, kind: Any, arrays: list[Value]) -> Value:
        """A record on the stack."""
        record = Value(f"%record.{next(self.count)}", PLACE, parts=meaning_of(kind).parts)
        self.slots.append(f"{record.text} = alloca ptr, i64 {len(arrays)}")
        if [x.of for x in arrays] != [x.of for _, x in record.parts]:
            self._refuse(f"{kind.__name__} is made of its arrays")
        for i, array in enumerate(arrays):
            address = self._new(f"getelementptr ptr, ptr {record.text}, i64 {i}", PLACE)
            self.lines.append(f"store ptr {array.text}, ptr {address.text}, align 8")
        return record

    def _lanewise(self, function: Any, values: list[Value]) -> Value:
        """A function of each lane, or of numbers; a choice in each; what any or all of them say."""
        lanes, kind = max(x.lanes for x in values), TRUTH if function is np.any else REAL
        reduces = LANEWISE[function].startswith("vector.reduce")
        if function is np.where:
            test, a, b = (
                self._as(x, part, lanes)
                for x, part in zip(values, (TRUTH, REAL, REAL), strict=True)
            )
            text = f"select {test.type} {test.text}, {a.type} {a.text}, {b.type} {b.text}"
            return self._new(text, REAL, lanes=lanes)
        values = [self._as(x, kind, lanes) for x in values]
        ending = f"{f'v{lanes}' if lanes else ''}{'f64' if kind == REAL else 'i1'}"
        name = f"@llvm.{LANEWISE[function]}.{ending}"
        gives = kind if reduces else values[0].type
        self.module.declared[f"declare {gives} {name}({', '.join(x.type for x in values)})"] = None
        call = f"call {gives} {name}({', '.join(f'{x.type} {x.text}' for x in values)})"
        return self._new(call, kind, lanes=0 if reduces else lanes)
