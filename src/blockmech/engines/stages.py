"""The stages of an explicit Runge-Kutta step as machine code.

    stages(x, numbers, K, y, state, A, C, t, h, first, last, dimension, width):
        for stage s from first to last:
            state = y + h sum_j A_sj K_j, and the time t + C_s h behind it
            K_s = the rates there, and what else a program says of the state

The rates are those of a traced program of one lane (`blockmech.engines.assembly`), asked by a
body: they are worked out state by state, hundreds of times in what a call from Python takes.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.1.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.engines.assembly import Text
from blockmech.engines.llvm import FILL, machine_code
from blockmech.engines.nodes import Untraceable
from blockmech.engines.trace import FOLLOWED, Body, Trace, numbers
from blockmech.plan import Program

Floats = NDArray[np.float64]
KIND = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 7, *[ctypes.c_double] * 2, *[ctypes.c_int64] * 5)
STAGES = """
define void @stages(ptr %x, ptr %numbers, ptr %K, ptr %y, ptr %state, ptr %A, ptr %C, double %t,
    double %h, i64 %first, i64 %last, i64 %dimension, i64 %width, i64 %columns) {
start:
  %clock = getelementptr double, ptr %state, i64 %dimension
  br label %stage
stage:
  %s = phi i64 [ %first, %start ], [ %s.next, %known ]
  %s.more = icmp slt i64 %s, %last
  br i1 %s.more, label %place, label %done
place:
  %s.row = mul i64 %s, %columns
  %A.row = getelementptr double, ptr %A, i64 %s.row
  br label %component
component:
  %i = phi i64 [ 0, %place ], [ %i.next, %summed ]
  %i.more = icmp slt i64 %i, %dimension
  br i1 %i.more, label %term, label %known
term:
  %j = phi i64 [ 0, %component ], [ %j.next, %add ]
  %sum = phi double [ 0.0, %component ], [ %sum.next, %add ]
  %j.more = icmp slt i64 %j, %s
  br i1 %j.more, label %add, label %summed
add:
  %a.at = getelementptr double, ptr %A.row, i64 %j
  %a = load double, ptr %a.at
  %j.row = mul i64 %j, %width
  %j.place = add i64 %j.row, %i
  %k.at = getelementptr double, ptr %K, i64 %j.place
  %k = load double, ptr %k.at
  %product = fmul double %a, %k
  %sum.next = fadd double %sum, %product
  %j.next = add i64 %j, 1
  br label %term
summed:
  %way = fmul double %h, %sum
  %y.at = getelementptr double, ptr %y, i64 %i
  %y.old = load double, ptr %y.at
  %y.new = fadd double %y.old, %way
  %state.at = getelementptr double, ptr %state, i64 %i
  store double %y.new, ptr %state.at
  %i.next = add i64 %i, 1
  br label %component
known:
  %c.at = getelementptr double, ptr %C, i64 %s
  %c = load double, ptr %c.at
  %later = fmul double %c, %h
  %time = fadd double %t, %later
  store double %time, ptr %clock
  %K.row = mul i64 %s, %width
  %K.at = getelementptr double, ptr %K, i64 %K.row
  call void @fill(ptr %x, ptr %numbers, ptr %K.at, i64 1, i64 1, i64 0, i64 1)
  %s.next = add i64 %s, 1
  br label %stage
done:
  ret void
}
"""


class Rates:
    """A body of a program, as machine code for one state and for the stages of a step.

    Its inputs are the components of the state, the time, and ``more`` numbers that are given.
    """

    def __init__(self, program: Program, body: Body, dimension: int, more: int) -> None:
        """Raises `Untraceable` for what is more than flat arithmetic, and
        `MissingEngineError` without llvmlite."""
        self.dimension, self.inputs = dimension, dimension + 1 + more
        trace = Trace(program, body, self.inputs)
        if trace.asked:
            raise Untraceable(FOLLOWED)
        self.rows: list[Any] = [*trace.values]
        text = Text(1).fill(self.inputs, self.rows)
        self.at = machine_code(text + STAGES, "fill", FILL)
        self.stages = machine_code(text + STAGES, "stages", KIND)
        self.numbers = np.array([*numbers(program.parameters.values()), 0.0])  # never empty


class Stages:
    """Rates with room of their own: for one run.

    K : (stages, width) the rates at each stage, then what else the program says of its state
    state : (inputs,) the state of the last stage, its time, and the numbers that are given
    """

    def __init__(self, rates: Rates, given: Sequence[float], A: Floats, C: Floats) -> None:
        """``A`` (s, s) and ``C`` (s,) are those of the scheme."""
        self._rates, self._A, self._C = rates, np.ascontiguousarray(A), np.ascontiguousarray(C)
        n = rates.dimension
        self.state = np.array([0.0] * (n + 1) + [*given])
        self.K = np.zeros((len(C), len(rates.rows)))
        first, size = self.state.ctypes.data, self.state.itemsize
        self._x = (ctypes.c_void_p * rates.inputs)(*(first + size * i for i in range(rates.inputs)))
        self._head = self._x, rates.numbers.ctypes.data, self.K.ctypes.data
        self._tail = first, self._A.ctypes.data, self._C.ctypes.data
        self._sizes = n, self.K.shape[1], self._A.shape[1]

    def run(self, first: int, last: int, t: float, y: Floats, h: float) -> None:
        """Work out some stages of a step from t, y (n,)."""
        data = y.ctypes.data
        self._rates.stages.function(*self._head, data, *self._tail, t, h, first, last, *self._sizes)

    def at(self, t: float, y: Sequence[float]) -> list[float]:
        """What the program says of a state."""
        n = self._rates.dimension
        self.state[:n], self.state[n] = y, t
        row = self.K[-1]
        _, numbers, K = self._head
        place = K + row.itemsize * (self.K.size - row.size)
        self._rates.at.function(self._x, numbers, place, 1, 1, 0, 1)
        found: list[float] = row.tolist()
        return found
