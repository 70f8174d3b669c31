"""The compiled engine: a traced program as machine code, many samples side by side.

The program's trace becomes LLVM assembly (`blockmech.engines.assembly`), and the optional
package llvmlite compiles that while the process runs, in a tenth of a second. Arithmetic is
that of the scalar engine operation by operation, and sine, cosine and atan2 are the same
library's, so the two say the same to the last bit.

Samples that need an algorithm of their own are flagged by the loop and done again by the
scalar engine. Programs that are more than flat arithmetic are declined: `Untraceable`.
"""

from __future__ import annotations

import ctypes
import functools
import os
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.engines import assembly
from blockmech.engines.assembly import LANES
from blockmech.engines.numpy import Planar, _leaves
from blockmech.engines.scalar import ScalarEngine
from blockmech.engines.trace import Node, Trace, Untraceable, numbers
from blockmech.errors import MissingEngineError, Problem
from blockmech.plan import Program

Array = NDArray[np.float64]
LONGEST = 50_000  # lines of assembly, some ten seconds of compiling: others run longer programs
PARALLEL = 2**16  # samples: some milliseconds of work, of which starting threads is a twentieth


class LlvmEngine:
    """A program compiled to machine code."""

    name = "llvm"

    def __init__(self, program: Program) -> None:
        """Raises `Untraceable` for a program that is more than flat arithmetic, and
        `MissingEngineError` without llvmlite."""
        self.program = program
        trace = Trace(program)
        self.values = trace.values
        wanted = [x for x in _leaves(trace.values) if isinstance(x, Node) and x.op != "input"]
        flag = functools.reduce(lambda a, b: a | b, trace.flags) if trace.flags else None
        rows = list(dict.fromkeys([*wanted, *([] if flag is None else [flag])]))
        self._row = {node: row for row, node in enumerate(rows)}
        self._flag = flag
        self._fill = _compiled(assembly.fill(trace, len(program.inputs), rows)).function
        self._numbers = np.array([*numbers(program.parameters.values()), 0.0])  # never empty
        self._parameters = self._numbers.ctypes.data
        self._scalar = ScalarEngine(program)
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
        lanes = ctypes.c_double * LANES
        given = [lanes(x) for x in inputs]  # the other lanes compute with zeros, for nobody
        places = (ctypes.c_void_p * (len(given) + 1))(*map(ctypes.addressof, given))
        out = np.empty((max(1, len(self._row)), LANES))
        self._fill(places, self._parameters, out.ctypes.data, LANES, LANES)
        row = out[:, 0].tolist()
        if self._flag is not None and row[self._row[self._flag]]:
            return self._scalar.one(inputs)
        found: tuple[Any, ...] = self._read_one(inputs, row)
        return found

    def run(self, inputs: Mapping[str, Any], n: int) -> tuple[Any, ...]:
        """Values of n samples: Python numbers for one, real arrays (n,) or `Planar` pairs of
        them for more."""
        if n == 1:
            return self.one([float(inputs[x][0]) for x in self.program.inputs])
        columns = [np.ascontiguousarray(inputs[x], np.float64) for x in self.program.inputs]
        out = self._filled(columns, n)
        if self._flag is not None:
            self._again(columns, out, np.flatnonzero(out[self._row[self._flag], :n]))

        def read(x: Any) -> Array:
            if not isinstance(x, Node):
                return np.broadcast_to(np.float64(x), (n,))
            return columns[x.args[0]] if x.op == "input" else out[self._row[x], :n]

        return tuple(_mapped(x, read) for x in self.values)

    def _filled(self, columns: list[Array], n: int) -> Array:
        """The rows of numbers (rows, at least n)."""
        blocks = -(-n // LANES)
        # An odd number of cache lines: rows do not fall on the same sets of the cache.
        out = np.empty((max(1, len(self._row)), LANES * (blocks | 1)))
        whole = n - n % LANES
        parts = os.cpu_count() or 1 if n >= PARALLEL else 1
        step = -(-blocks // parts) * LANES
        starts = range(0, whole, step)
        if len(starts) > 1:
            from concurrent.futures import ThreadPoolExecutor

            with ThreadPoolExecutor(len(starts)) as pool:
                list(pool.map(lambda k: self._call(columns, out, k, min(step, whole - k)), starts))
        elif whole:
            self._call(columns, out, 0, whole)
        if whole < n:  # the last samples beside copies of the last one
            missing = (0, blocks * LANES - n)
            rest = [np.pad(c[whole:], missing, mode="edge") for c in columns]
            self._call(rest, out[:, whole:], 0, LANES)
        return out

    def _call(self, columns: list[Array], out: Array, start: int, count: int) -> None:
        places = (ctypes.c_void_p * (len(columns) + 1))(
            *(c.ctypes.data + c.itemsize * start for c in columns)
        )
        first = out.ctypes.data + out.itemsize * start
        stride = out.strides[0] // out.itemsize
        self._fill(places, self._parameters, first, stride, count)

    def _again(self, columns: list[Array], out: Array, samples: NDArray[np.intp]) -> None:
        """Flagged samples by the scalar engine."""
        for i in samples.tolist():
            found = self._scalar.one([float(c[i]) for c in columns])
            for node, x in zip(_leaves(self.values), _parts(found), strict=True):
                if isinstance(node, Node) and node.op != "input":
                    out[self._row[node], i] = x


def _mapped(value: Any, read: Any) -> Any:
    if isinstance(value, tuple):
        parts = [_mapped(x, read) for x in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return Planar(read(value.real), read(value.imag)) if isinstance(value, Planar) else read(value)


def _parts(value: Any) -> list[float]:
    """Real numbers of a (nested) tuple of numbers and vectors, in order."""
    if isinstance(value, tuple):
        return [x for part in value for x in _parts(part)]
    return [value.real, value.imag] if isinstance(value, complex) else [value]


# -- machine code ------------------------------------------------------------------


class _Code(NamedTuple):
    """A compiled module; its function lives as long as what holds it."""

    function: Any
    held: tuple[Any, ...]


@functools.lru_cache
def _compiled(text: str) -> _Code:
    """The function of a module; compiled once for all mechanisms of one structure."""
    if text.count("\n") > LONGEST:
        raise Untraceable(f"it has more than {LONGEST} operations")
    llvm = _package()
    target = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        codemodel="jitdefault",
        jit=True,
    )
    module = llvm.parse_assembly(text)
    how = llvm.create_pipeline_tuning_options(speed_level=2)
    passes = llvm.create_pass_builder(target, how)
    passes.getModulePassManager().run(module, passes)
    engine = llvm.create_mcjit_compiler(module, target)
    engine.finalize_object()
    kind = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3, *[ctypes.c_int64] * 2)
    return _Code(kind(engine.get_function_address("fill")), (engine, target))


@functools.cache
def _package() -> Any:
    """llvmlite's binding, ready for this processor."""
    try:
        import llvmlite.binding as llvm
    except ImportError:
        raise MissingEngineError(
            Problem(
                "missing-engine",
                "engine",
                'engine="llvm" needs llvmlite',
                "",
                'install "blockmech[fast]"',
            )
        ) from None
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    library = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)  # the one of Python's math
    for name in assembly.LIBRARY:
        llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
    return llvm
