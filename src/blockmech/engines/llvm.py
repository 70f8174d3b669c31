"""The compiled engine: a traced program as machine code, many samples side by side.

The program's trace becomes LLVM assembly (`blockmech.engines.assembly`), and the optional
package llvmlite compiles that while the process runs, in a tenth of a second. Arithmetic is
that of the scalar engine operation by operation, and sine, cosine and atan2 are the same
library's, so the two say the same to the last bit.

What is no kernel (a group followed from its home, a user's function) is asked
beforehand, if inputs alone say it: its answers are inputs. Programs that are more than flat
arithmetic are declined: `Untraceable`.
"""

from __future__ import annotations

import ctypes
import functools
import math
import os
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.engines import assembly, code_cache
from blockmech.engines.assembly import LANES
from blockmech.engines.nodes import Node, Untraceable, needed, of_inputs
from blockmech.engines.numpy import CHUNK, Planar, Whole, each_part, leaves
from blockmech.engines.scalar import ScalarEngine
from blockmech.engines.trace import Trace, filled
from blockmech.errors import MissingEngineError
from blockmech.errors import needed as package
from blockmech.plan import Program

Array = NDArray[np.float64]
LONGEST = 50_000  # lines of assembly, some ten seconds of compiling: others run longer programs
# States for which an integrator in Python takes about as long as compiling: 110 to 150 us each,
# solver and friction included, by 0.2 to 0.35 s, or 0.05 s where machine code is on disk already.
# Who stops there has waited twice as long as needed, nobody longer.
WORTH = 2_000
LINE = LANES * ctypes.sizeof(ctypes.c_double)  # bytes of a block of samples
FILL = ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_void_p] * 3, *[ctypes.c_int64] * 4)
PARALLEL = 2**17  # samples: some five milliseconds of work, beside which starting threads is little


class LlvmEngine:
    """A program compiled to machine code."""

    name = "llvm"
    designs_together = PARALLEL  # samples of designs that are best run at once

    def __init__(self, program: Program) -> None:
        """Raises `Untraceable` for a program that is more than flat arithmetic, and
        `MissingEngineError` without llvmlite."""
        self.program = program
        trace = Trace(program)
        self.values = trace.values
        wanted = list(dict.fromkeys(leaves(trace.values)))
        rows = [x for x in wanted if isinstance(x, Node) and x.op != "input"]
        given = [x for x in wanted if isinstance(x, Node) and x.op == "input"]
        self._fixed = sum(x for x in wanted if not isinstance(x, Node))
        self._row = {node: row for row, node in enumerate(rows)}
        self._asked, self._inputs = trace.asked, len(program.inputs) + trace.answers
        kept = of_inputs(needed([*rows, *given]))
        self._kept = len(kept)
        text = assembly.Text().fill(self._inputs, rows, given, kept)
        (self._fill,) = machine_code(text, ("fill", FILL))
        self._numbers = row_of(program)
        self._parameters = self._numbers.ctypes.data
        self._places = ctypes.c_void_p * (self._inputs + 1)  # never empty
        self._room = (ctypes.c_double * (LANES * (self._inputs + len(rows))))()
        first = ctypes.addressof(self._room)
        self._in_room = self._places(*range(first, first + LINE * self._inputs, LINE))
        self._out = first + LINE * self._inputs
        self._alone = threading.Lock()
        self._read_one = eval(f"lambda x, row: {self._text(trace.values)}")

    def _text(self, value: Any) -> str:
        """Values of one sample as an expression of its inputs ``x`` and its ``row`` of numbers."""
        if isinstance(value, tuple):
            return f"({''.join(f'{self._text(x)}, ' for x in value)})"
        if isinstance(value, Planar):
            return f"complex({self._text(value.real)}, {self._text(value.imag)})"
        if not isinstance(value, Node):
            return f"float('{value}')"
        return f"x[{value.args[0]}]" if value.op == "input" else f"row[{self._row[value]}]"

    def one(self, inputs: Sequence[float]) -> tuple[Any, ...]:
        """Values of one sample: float or complex each, NaN or infinite where impossible."""
        inputs = self._answered(inputs) if self._asked else inputs
        k = LANES * len(inputs)
        with self._alone:  # inputs, then rows; the other lanes compute with zeros, for nobody
            self._room[0:k:LANES] = list(inputs)
            self._fill(self._in_room, self._parameters, self._out, LANES, LANES, 0, 1)
            row = self._room[k::LANES]
        values: tuple[Any, ...] = self._read_one(inputs, row)
        return values

    def _columns(self, inputs: Sequence[Any], n: int) -> list[Array]:
        """Columns (n,) of the inputs and of what is asked of them, which comes chunk by chunk."""
        given = [np.ascontiguousarray(x, np.float64) for x in inputs]
        if not self._asked:
            return given
        whole = [np.broadcast_to(x, n) for x in given]
        parts = [
            self._answered([x[i : i + CHUNK] for x in whole]) for i in range(0, max(n, 1), CHUNK)
        ]
        return [np.concatenate(column) for column in zip(*parts, strict=True)]

    def _answered(self, inputs: Sequence[Any]) -> list[Any]:
        """Inputs, numbers or columns, and behind them what functions that are no kernels say."""
        values = [*inputs]
        for function, places in self._asked:
            places_of = iter([inputs[k] for k in leaves(places)]).__next__
            values += leaves(function(*filled(places, places_of)))
        return values

    def run(self, inputs: Mapping[str, Any], n: int) -> tuple[Any, ...]:
        """Values of n samples: Python numbers for one, real arrays (n,) or `Planar` pairs of
        them for more."""
        if n == 1:
            return self.one([float(inputs[x][0]) for x in self.program.inputs])
        values = self._together(inputs, n, self._numbers[None])
        return type(values)(each_part(lambda x: x[0], x) for x in values)

    def run_designs(
        self, inputs: Mapping[str, NDArray[Any]], values: tuple[Any, ...]
    ) -> tuple[Any, ...]:
        """Values of m designs at n samples each, as batches (m, n).

        ``values`` are those of `Program.values`, numbers of designs as columns (m, 1); inputs
        are (n,). A design's numbers are those that it has alone.
        """
        slots = slots_of(values)
        n = max((np.size(inputs[x]) for x in self.program.inputs), default=1)
        return self._together(inputs, n, slots)

    def _together(self, inputs: Mapping[str, Any], n: int, slots: Array) -> tuple[Any, ...]:
        """Values (m, n) at n samples, each with the slots (m, k) of numbers."""
        columns = self._columns([inputs[x] for x in self.program.inputs], n)
        columns = [_whole_blocks(c) for c in columns]
        m, blocks = len(slots), -(-n // LANES)
        width = blocks * LANES
        # An odd number of cache lines: rows do not fall on the same sets of the cache.
        out = np.empty((max(1, len(self._row)), LANES * (m * blocks | 1)))

        def part(first: int, last: int) -> float:
            if m > 1:  # of the designs
                return self._call(columns, out[:, first * width :], width, slots[first:last])
            here = slice(first * LANES, last * LANES)
            given = [c[here] for c in columns]
            return self._call(given, out[:, here], (last - first) * LANES, slots)

        sums = self._threads(part, m if m > 1 else blocks, m * n >= PARALLEL)
        lanes = out[:, : m * width].reshape(-1, m, width)[..., :n]

        def read(x: Any) -> Array:
            if not isinstance(x, Node):
                return np.broadcast_to(np.float64(x), (m, n))
            if x.op == "input":
                return np.broadcast_to(columns[x.args[0]][:n], (m, n))
            return np.asarray(lanes[self._row[x]])

        made = Whole if math.isfinite(sum(sums, self._fixed)) else tuple
        return made(each_part(read, x) for x in self.values)

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

    def _call(self, columns: list[Array], out: Array, n: int, slots: Array) -> float:
        stride = out.strides[0] // out.itemsize
        designs, count = slots.shape
        kept = np.empty(self._kept * n + LANES if designs > 1 else 0)
        places = self._places(*(c.ctypes.data for c in columns), _aligned(kept))
        total: float = self._fill(
            places, slots.ctypes.data, out.ctypes.data, stride, n, count, designs
        )
        return total


def _aligned(room: Array) -> int:
    """The first place in a room of numbers at which a block may begin."""
    return -(-int(room.ctypes.data) // LINE) * LINE


def _whole_blocks(column: Array) -> Array:
    """A column with copies of its last number behind it, up to whole blocks."""
    missing = -column.size % LANES
    return np.concatenate([column, np.full(missing, column[-1])]) if missing else column


def row_of(program: Program) -> Array:
    """The numbers of a program in the order of its trace; never none."""
    return np.array([*leaves(tuple(program.parameters.values())), 0.0])


def slots_of(values: tuple[Any, ...]) -> Array:
    """The numbers (m, k) of m designs in the order of a trace, as `row_of` has one's."""
    rows = [*leaves(values), 0.0]
    slots = np.empty((max(np.size(x) for x in rows), len(rows)))
    for k, x in enumerate(rows):
        slots[:, k] = x if np.size(x) == 1 else np.ravel(x)
    return slots


def addresses_of(numbers: Array) -> Any:
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
def machine_code(text: str, *kinds: tuple[str, Any]) -> tuple[Any, ...]:
    """Functions of a module, by name; compiled once for all mechanisms of one structure.

    Once on a machine, as long as `code_cache` keeps what was compiled.
    """
    if text.count("\n") > LONGEST:
        raise Untraceable(f"it has more than {LONGEST} operations")
    llvm = _package()
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    made = llvm.Target.from_default_triple()
    target = made.create_target_machine(
        cpu=cpu, features=features, opt=3, codemodel="jitdefault", jit=True
    )
    version = (sys.modules["llvmlite"].__version__, *llvm.llvm_version_info)
    whole = f"{version} {made.triple} {cpu} {features}\n{text}"
    code = code_cache.load(whole)
    if code is None:
        module = llvm.parse_assembly(text)
        how = llvm.create_pipeline_tuning_options(speed_level=2)
        passes = llvm.create_pass_builder(target, how)
        passes.getModulePassManager().run(module, passes)
        code = target.emit_object(module)
        code_cache.keep(whole, code)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    functions = tuple(kind(engine.get_function_address(name)) for name, kind in kinds)
    for f in functions:
        f.held = engine, target  # the code lives as long as who may call it, not as the cache
    return functions


@functools.cache
def _package() -> Any:
    """llvmlite's binding, ready for this processor."""
    llvm = package("llvmlite.binding", 'engine="llvm"', "fast")
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    library = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)  # the one of Python's math
    for name in assembly.LIBRARY:
        llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
    return llvm
