"""The compiled engine: a traced program as machine code, many samples side by side.

The program's trace becomes LLVM assembly (`blockmech.engines.assembly`), and llvmlite compiles
that while the process runs, a four-bar with friction in some 50 ms. Mechanisms of one structure
share what was compiled, in memory and on disk (`blockmech.engines.code_cache`). Arithmetic is that
of the scalar engine operation by operation, and sine, cosine and atan2 are the same library's,
so the two say the same to the last bit.

What is no kernel (a group followed from its home, a user's function) is asked
beforehand, if inputs alone say it: its answers are inputs. Programs that are more than flat
arithmetic are declined: `Untraceable`.
"""

from __future__ import annotations

import ast
import ctypes
import functools
import math
import os
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from blockmech.engines import assembly, code_cache
from blockmech.engines.code_cache import key_of
from blockmech.engines.interpreters import ScalarEngine
from blockmech.engines.nodes import LANES, Node, Untraceable, needed, of_inputs
from blockmech.engines.numpy import CHUNK, Planar, Whole, leaves
from blockmech.engines.trace import Trace, filled
from blockmech.ground.errors import MissingEngineError, refused
from blockmech.ground.errors import needed as package
from blockmech.ground.memory import Recent
from blockmech.plan.plan import Program
from blockmech.typing import Floats, Nested, Real, Reals, Record, Values

LONGEST = 50_000  # lines of assembly, two seconds of compiling: others run longer programs
LINE = LANES * ctypes.sizeof(ctypes.c_double)  # bytes of a block of samples
FILL = ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_void_p] * 3, *[ctypes.c_int64] * 4)
PARALLEL = 2**17  # samples: some five milliseconds of work, beside which starting threads is little


class Traced(NamedTuple):
    """What a trace says of all programs of one structure.

    inputs : of the program, and answers behind them
    rows : numbers that are worked out, shared : sines and cosines of inputs alone
    questions : names of functions that answer, each with places of its arguments among the inputs
    constants : numbers of the text among the values
    values : an expression for the values, by inputs ``x`` and the ``row`` of numbers and constants
    """

    inputs: int
    rows: int
    shared: int
    questions: tuple[tuple[Any, Values], ...]
    constants: tuple[str, ...]
    values: str


class Code(NamedTuple):
    """Machine code of a structure: ``fill``, constants, and readers of one sample and of many."""

    traced: Traced
    fill: Any
    constants: Floats
    read_sample: Callable[..., Values]
    read_batch: Callable[..., Values]


_CODES = Recent[str | None, Code]()  # by the keys of their structures


def code_of(program: Program) -> Code:
    """The machine code of a program's structure: in memory, on disk, or made.

    Raises `Untraceable` for a program that is more than flat arithmetic, and
    `MissingEngineError` without llvmlite.
    """
    key = key_of(program)
    code = _CODES.get(key)
    if code is None:
        stored = None if key is None else code_cache.load(_on_this_machine(key))
        if stored is None:
            traced, text = _traced(program)
            data = _compiled(text)
            if key is not None:
                head = repr(tuple(traced)).encode()
                code_cache.keep(_on_this_machine(key), head + b"\n" + data)
        else:
            head, _, data = stored.partition(b"\n")
            traced = Traced(*ast.literal_eval(head.decode()))
        (fill,) = _linked(data, ("fill", FILL))
        constants = np.array([*map(float, traced.constants)])
        code = Code(traced, fill, constants, *_readers(traced.values))
    return code if key is None else _CODES.renew(key, code)


def is_kept(program: Program) -> bool:
    """Whether machine code of a program's structure needs no compiling."""
    key = key_of(program)
    return key in _CODES or (key is not None and code_cache.has(_on_this_machine(key)))


def has_code(key: str) -> bool:
    """Whether `machine_code` of a key needs no compiling."""
    return code_cache.has(_on_this_machine(key))


def _traced(program: Program) -> tuple[Traced, str]:
    """What the trace of a program says of its structure, and its text."""
    trace = Trace(program)
    parts = leaves(trace.values)
    nodes = list(dict.fromkeys(x for x in parts if isinstance(x, Node)))
    rows = [x for x in nodes if x.op != "input"]
    summed = [x for x in nodes if x.op == "input"]
    shared = of_inputs(needed([*rows, *summed]))
    inputs = len(program.inputs) + trace.answers
    names = {id(f): name for name, f in program.functions.items()}
    questions = tuple((names.get(id(f), f), indices) for f, indices in trace.asked)
    constants = dict.fromkeys(str(float(x)) for x in parts if not isinstance(x, Node))
    numbers: list[Node | str] = [*rows, *constants]
    row = {x: k for k, x in enumerate(numbers)}
    values = _expression(trace.values, row)
    traced = Traced(inputs, len(rows), len(shared), questions, tuple(constants), values)
    return traced, assembly.Text().fill(inputs, rows, summed, shared)


def _expression(value: Nested, row: Mapping[Node | str, int]) -> str:
    """Values as an expression of the inputs ``x`` and the ``row`` of numbers and constants."""
    if isinstance(value, tuple):
        return f"({''.join(f'{_expression(x, row)}, ' for x in value)})"
    if isinstance(value, Planar):
        return f"vector({_expression(value.real, row)}, {_expression(value.imag, row)})"
    if not isinstance(value, Node):
        return f"row[{row[str(float(value))]}]"
    return f"x[{value.args[0]}]" if value.op == "input" else f"row[{row[value]}]"


def _readers(values: str) -> tuple[Callable[..., Values], Callable[..., Values]]:
    """Values of one sample by its inputs ``x`` and ``row`` of numbers, and batches of many."""
    code = compile(f"lambda x, row: {values}", "<values>", "eval")
    return eval(code, {"vector": complex}), eval(code, {"vector": Planar})


class LlvmEngine:
    """A program compiled to machine code."""

    name = "llvm"
    designs_together = PARALLEL  # samples of designs that are best run at once

    def __init__(self, program: Program) -> None:
        """Raises as `code_of` does."""
        self.program = program
        self.code = code_of(program)
        traced = self.code.traced
        self._asked = [(program.functions.get(f, f), indices) for f, indices in traced.questions]
        self._constants: list[float] = self.code.constants.tolist()
        self._numbers = row_of(program)
        self._parameters = self._numbers.ctypes.data
        self._addresses = ctypes.c_void_p * (traced.inputs + 1)  # never empty
        self._room = (ctypes.c_double * (LANES * (traced.inputs + traced.rows)))()
        first = ctypes.addressof(self._room)
        self._out = first + LINE * traced.inputs
        self._in_room = self._addresses(*range(first, self._out, LINE))
        self._alone = threading.Lock()

    def one(self, inputs: Sequence[float]) -> Values:
        """Values of one sample: float or complex each, NaN or infinite where impossible."""
        inputs = self._answered(inputs) if self._asked else inputs
        k = LANES * len(inputs)
        with self._alone:  # inputs, then rows; the other lanes compute with zeros, for nobody
            self._room[0:k:LANES] = list(inputs)
            self.code.fill(self._in_room, self._parameters, self._out, LANES, LANES, 0, 1)
            row = self._room[k::LANES]
        return self.code.read_sample(inputs, row + self._constants)

    def _batch(
        self, columns: list[Floats], lanes: Floats, total: float, shape: tuple[int, ...]
    ) -> Values:
        """Values of a shape (n,) or (m, n), of inputs, numbers (rows, ...) and their sum."""
        constants = self.code.constants.reshape(-1, *(1 for _ in shape))
        fixed = np.broadcast_to(constants, (len(constants), *shape))
        row = [*lanes[: self.code.traced.rows], *fixed]
        values = self.code.read_batch(columns, row)
        return Whole(values) if math.isfinite(total + sum(self._constants)) else values

    def _columns(self, inputs: Reals, n: int) -> list[Floats]:
        """Columns (n,) of the inputs and of what is asked of them, which comes chunk by chunk."""
        columns = [np.ascontiguousarray(x, np.float64) for x in inputs]
        if not self._asked:
            return columns
        columns = [np.broadcast_to(x, n) for x in columns]
        parts = [
            self._answered([x[i : i + CHUNK] for x in columns]) for i in range(0, max(n, 1), CHUNK)
        ]
        return [np.concatenate(column) for column in zip(*parts, strict=True)]

    def _answered(self, inputs: Reals) -> list[Real]:
        """Inputs, numbers or columns, and behind them what functions that are no kernels say."""
        values = [*inputs]
        for function, indices in self._asked:
            argument = iter([inputs[k] for k in leaves(indices)]).__next__
            values += leaves(function(*filled(indices, argument)))
        return values

    def run(self, inputs: Record, n: int) -> Values:
        """Values of n samples: Python numbers for one, real arrays (n,) or `Planar` pairs of
        them for more."""
        if n == 1:
            return self.one([float(inputs[x][0]) for x in self.program.inputs])
        columns = [inputs[x] for x in self.program.inputs]
        return self._together(columns, n, self._numbers[None], (n,))

    def numbers(self, values: Values) -> Floats:
        """Numbers (m, k) of designs as the engine takes them, of those of `Program.values`."""
        return slots_of(values)

    def run_designs(self, inputs: Mapping[str, Floats], numbers: Floats) -> Values:
        """Values of m designs at n samples each, as batches (m, n).

        Inputs are (n,), or (m, n) where designs have samples of their own. A design's numbers are
        those that it has alone.
        """
        columns = [np.atleast_1d(inputs[x]) for x in self.program.inputs]
        n = max((x.shape[-1] for x in columns), default=1)
        if any(x.ndim == 2 for x in columns):
            columns = [np.broadcast_to(x, (len(numbers), n)) for x in columns]
        return self._together(columns, n, numbers, (len(numbers), n))

    def _together(
        self, inputs: Sequence[Floats], n: int, slots: Floats, shape: tuple[int, ...]
    ) -> Values:
        """Values of a shape (n,) or (m, n) at n samples, each with the slots (m, k) of numbers.

        Inputs are (n,), or (m, n) where designs have samples of their own.
        """
        m, blocks = len(slots), -(-n // LANES)
        width, by_design = blocks * LANES, m > 1 and any(np.ndim(x) == 2 for x in inputs)
        columns = self._columns([np.ravel(x) for x in inputs], m * n if by_design else n)
        columns = [_padded(c.reshape(m if by_design else 1, -1)) for c in columns]
        rows = max(1, self.code.traced.rows)
        if by_design:
            out = np.empty((m, rows, width))
        else:  # an odd number of cache lines: rows do not fall on the same sets of the cache
            out = np.empty((rows, LANES * (m * blocks | 1)))

        def part(first: int, last: int) -> float:
            if m > 1:  # of the designs
                designs = slice(first, last)
                inputs = [c[designs] for c in columns] if by_design else columns
                results = out[designs] if by_design else out[:, first * width :]
                return self._call(inputs, results, width, slots[designs])
            block = slice(first * LANES, last * LANES)
            inputs = [c[:, block] for c in columns]
            return self._call(inputs, out[:, block], block.stop - block.start, slots)

        sums = self._threads(part, m if m > 1 else blocks, m * n >= PARALLEL)
        columns = [
            c[0, :n] if len(shape) == 1 else np.broadcast_to(c[:, :n], shape) for c in columns
        ]
        if by_design:
            lanes = out.transpose(1, 0, 2)
        else:
            lanes = out if len(shape) == 1 else out[:, : m * width].reshape(-1, m, width)
        return self._batch(columns, lanes[..., :n], sum(sums), shape)

    def _threads(
        self, part: Callable[[int, int], float], count: int, many: bool
    ) -> Sequence[float]:
        """Do a count of things in parts, side by side where they are many; what each part says."""
        step = -(-count // ((os.cpu_count() or 1) if many else 1))
        if 0 < step < count:
            from concurrent.futures import ThreadPoolExecutor

            with ThreadPoolExecutor() as pool:
                firsts = range(0, count, step)
                return list(pool.map(lambda k: part(k, min(k + step, count)), firsts))
        return [part(0, count)] if count else []

    def _call(self, columns: list[Floats], out: Floats, n: int, slots: Floats) -> float:
        by_design = out.ndim == 3  # each has samples of its own
        stride = out.strides[-2] // out.itemsize
        designs, count = slots.shape
        is_shared = designs > 1 and not by_design
        cache = np.empty(self.code.traced.shared * n + LANES if is_shared else 0)
        # the first place in it at which a block may begin
        room = None if by_design else -(-int(cache.ctypes.data) // LINE) * LINE
        addresses = self._addresses(*(c.ctypes.data for c in columns), room)
        total: float = self.code.fill(
            addresses, slots.ctypes.data, out.ctypes.data, stride, n, count, designs
        )
        return total


def _padded(columns: Floats) -> Floats:
    """Columns (m, n) with copies of their last numbers behind them, up to whole blocks."""
    missing = -columns.shape[1] % LANES
    if not missing:
        return columns
    return np.concatenate([columns, np.repeat(columns[:, -1:], missing, axis=1)], axis=1)


def row_of(program: Program) -> Floats:
    """The numbers of a program in the order of its trace; never none."""
    return np.array([*leaves(tuple(program.parameters.values())), 0.0])


def slots_of(values: Values) -> Floats:
    """The numbers (m, k) of m designs in the order of a trace, as `row_of` has one's."""
    rows = [*leaves(values), 0.0]
    slots = np.empty((max(np.size(x) for x in rows), len(rows)))
    for k, x in enumerate(rows):
        slots[:, k] = x if np.size(x) == 1 else np.ravel(x)
    return slots


def addresses_of(numbers: Floats) -> Any:
    """Where each number of an array (k,) stands: what machine code takes for inputs."""
    first, size = numbers.ctypes.data, numbers.strides[0]
    return (ctypes.c_void_p * numbers.size)(*range(first, first + size * numbers.size, size))


class SingleEvaluator:
    """A program that is asked for one sample after the other, as an integrator asks."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self._scalar = ScalarEngine(program)

    @cached_property
    def _compiled(self) -> ScalarEngine | LlvmEngine:
        """Machine code where there can be some."""
        try:
            return LlvmEngine(self.program)
        except (Untraceable, MissingEngineError):
            return self._scalar

    def engine(self, compiled: bool) -> ScalarEngine | LlvmEngine:
        """The interpreted one, or machine code."""
        return self._compiled if compiled else self._scalar


# -- machine code ------------------------------------------------------------------


@functools.lru_cache
def machine_code(
    text: str | Callable[[], str], *kinds: tuple[str, Any], key: str = ""
) -> tuple[Any, ...]:
    """Functions of a module, by name; compiled once for all mechanisms of one structure.

    Once on a machine, as long as `code_cache` keeps what was compiled, by the text or a ``key`` of
    one that is made where it is needed.
    """
    name = _on_this_machine(key or str(text))
    code = code_cache.load(name)
    if code is None:
        code = _compiled(text() if callable(text) else text)
        code_cache.keep(name, code)
    return _linked(code, *kinds)


def _compiled(text: str) -> bytes:
    """The machine code of a module."""
    if text.count("\n") > LONGEST:
        raise Untraceable(f"it has more than {LONGEST} operations")
    llvm, target, _ = processor()
    module = llvm.parse_assembly(text)
    passes = llvm.create_new_module_pass_manager()
    passes.add_sroa_pass()  # into registers: the rest of -O2 takes longer than it saves
    passes.run(module, llvm.create_pass_builder(target(), llvm.create_pipeline_tuning_options()))
    code: bytes = target().emit_object(module)
    return code


def _linked(code: bytes, *kinds: tuple[str, Any]) -> tuple[Any, ...]:
    """Functions of machine code, by name."""
    llvm, target, _ = processor()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    functions = tuple(kind(engine.get_function_address(name)) for name, kind in kinds)
    for f in functions:
        f.held = engine  # the code lives as long as who may call it, not as the cache
    return functions


def _on_this_machine(text: str) -> str:
    """A text, or key, with what else decides on its machine code: processor and compiler."""
    return f"{processor()[2]}\n{text}"


@functools.cache
def processor() -> tuple[Any, Callable[[], Any], str]:
    """llvmlite's binding, what makes code for this processor, and their names in a word."""
    llvm = package("llvmlite.binding", 'engine="llvm"', "fast")
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    library = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)  # the one of Python's math
    for name in assembly.LIBRARY:
        llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    triple = llvm.Target.from_default_triple()
    options = {"cpu": cpu, "features": features, "opt": 3, "codemodel": "jitdefault", "jit": True}
    version = (sys.modules["llvmlite"].__version__, *llvm.llvm_version_info)
    name = f"{version} {triple.triple} {cpu} {features}"
    return llvm, functools.partial(triple.create_target_machine, **options), name


def compiled_program(program: Program) -> LlvmEngine:
    """A program compiled to machine code.

    Raises `MissingEngineError` without llvmlite, and `RequestError` for a program that is
    more than flat arithmetic.
    """
    try:
        return LlvmEngine(program)
    except Untraceable as why:
        message, remedy = f"the program cannot be compiled: {why}", 'use engine="numpy", or "auto"'
        raise refused("engine", message, remedy, code="not-compiled") from None
