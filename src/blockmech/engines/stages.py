"""Steps of an explicit Runge-Kutta method as machine code, one after the other.

    steps(..., most): of each step, until most are done or the bound is reached:
        K_s = the rates at t + C_s h, y + h sum_j A_sj K_j, for each stage s
        off = norm of h sum_j E_j K_j, in tolerances, of two estimates
        the step is taken where off < 1, else it is tried again with a shorter h

A step in which something may happen is the last: its first component leaves the ``free_range``, or
what is ``watched`` changes its sign at a stage of the step. Of the first two, which may dip to
zero between two stages, a stage that is not `FAR` from zero may not differ from the end by a third
of it either: then none is twice another. The rates are those of a traced program of one lane
(`blockmech.engines.assembly`), asked by a body: they are worked out state by state, hundreds of
times in what a call from Python takes. Components of a state are the parts of one vector, all
sizes numbers of the text.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.1, II.4
(control of the step: safety 0.9, factors from 0.2 to 10 as in SciPy) and II.10 (the estimates).
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.engines.assembly import Text
from blockmech.engines.llvm import FILL, machine_code, row_of
from blockmech.engines.nodes import Untraceable
from blockmech.engines.trace import FOLLOWED, Body, Trace
from blockmech.plan import Program

Floats = NDArray[np.float64]
FLEET = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 13, *[ctypes.c_int64] * 7)
KIND = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 11, *[ctypes.c_int64] * 4)
FAR = 0.125  # of a margin, 21 degrees of a transmission angle; and of inertia, in usual ones
STEPS = """
declare double @llvm.sqrt.f64(double)
declare double @llvm.fabs.f64(double)
declare STATE @llvm.fabs.vSIZEf64(STATE)
declare double @llvm.vector.reduce.fadd.vSIZEf64(double, STATE)
declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)

define internal STATE @weighted(ptr %weights, ptr %K, i64 %count) {
start:
  br label %test
test:
  %j = phi i64 [ 0, %start ], [ %j.next, %add ]
  %sum = phi STATE [ zeroinitializer, %start ], [ %sum.next, %add ]
  %more = icmp slt i64 %j, %count
  br i1 %more, label %add, label %done
add:
  %weight.at = getelementptr double, ptr %weights, i64 %j
  %weight = load double, ptr %weight.at
  %first = insertelement STATE poison, double %weight, i32 0
  %each = shufflevector STATE %first, STATE poison, <SIZE x i32> zeroinitializer
  %place = mul i64 %j, WIDTH
  %k.at = getelementptr double, ptr %K, i64 %place
  %k = load STATE, ptr %k.at, align 8
  %product = fmul STATE %each, %k
  %sum.next = fadd STATE %sum, %product
  %j.next = add i64 %j, 1
  br label %test
done:
  ret STATE %sum
}

define internal void @stages(ptr %x, ptr %numbers, ptr %K, ptr %y, ptr %state, ptr %A, ptr %C,
    double %t, double %h, i64 %begin, i64 %end, i64 %columns) {
start:
  %clock = getelementptr double, ptr %state, i64 SIZE
  %h.first = insertelement STATE poison, double %h, i32 0
  %h.each = shufflevector STATE %h.first, STATE poison, <SIZE x i32> zeroinitializer
  %y.old = load STATE, ptr %y, align 8
  br label %stage
stage:
  %s = phi i64 [ %begin, %start ], [ %s.next, %place ]
  %s.more = icmp slt i64 %s, %end
  br i1 %s.more, label %place, label %done
place:
  %s.row = mul i64 %s, %columns
  %A.row = getelementptr double, ptr %A, i64 %s.row
  %sum = call STATE @weighted(ptr %A.row, ptr %K, i64 %s)
  %way = fmul STATE %h.each, %sum
  %y.new = fadd STATE %y.old, %way
  store STATE %y.new, ptr %state, align 8
  %c.at = getelementptr double, ptr %C, i64 %s
  %c = load double, ptr %c.at
  %later = fmul double %c, %h
  %time = fadd double %t, %later
  store double %time, ptr %clock
  %K.row = mul i64 %s, WIDTH
  %K.at = getelementptr double, ptr %K, i64 %K.row
  call double @fill(ptr %x, ptr %numbers, ptr %K.at, i64 1, i64 1, i64 0, i64 1)
  %s.next = add i64 %s, 1
  br label %stage
done:
  ret void
}

define i64 @steps(ptr %x, ptr %numbers, ptr %blocks, ptr %states, ptr %state, ptr %A, ptr %C,
    ptr %E, ptr %tolerances, ptr %control, ptr %times, i64 %most, i64 %ends, i64 %all,
    i64 %watched) {
start:
  %bound.at = getelementptr double, ptr %control, i64 1
  %bound = load double, ptr %bound.at
  %longest.at = getelementptr double, ptr %control, i64 2
  %longest = load double, ptr %longest.at
  %tried.at = getelementptr double, ptr %control, i64 3
  %free.low.at = getelementptr double, ptr %control, i64 4
  %free.low = load double, ptr %free.low.at
  %free.high.at = getelementptr double, ptr %control, i64 5
  %free.high = load double, ptr %free.high.at
  %block = mul i64 %all, WIDTH
  %end = sub i64 %ends, 1
  %end.place = mul i64 %end, WIDTH
  %components = sitofp i64 SIZE to double
  %rtol = load STATE, ptr %tolerances, align 8
  %atol.at = getelementptr double, ptr %tolerances, i64 SIZE
  %atol = load STATE, ptr %atol.at, align 8
  %E.third = getelementptr double, ptr %E, i64 %ends
  br label %step
step:
  %m = phi i64 [ 0, %start ], [ %m.next, %kept ]
  %t.at = getelementptr double, ptr %times, i64 %m
  %t = load double, ptr %t.at
  %reached = fcmp oge double %t, %bound
  %full = icmp sge i64 %m, %most
  %over = or i1 %reached, %full
  br i1 %over, label %done, label %begin
begin:
  %K.place = mul i64 %m, %block
  %K = getelementptr double, ptr %blocks, i64 %K.place
  %K.next = getelementptr double, ptr %K, i64 %block
  %y.place = mul i64 %m, SIZE
  %y = getelementptr double, ptr %states, i64 %y.place
  %y.next = getelementptr double, ptr %y, i64 SIZE
  %size = call double @llvm.fabs.f64(double %t)
  %unit = fmul double %size, 0x3CB0000000000000
  %shortest = fmul double %unit, 10.0
  %h.asked = load double, ptr %control
  %h.long = fcmp ogt double %h.asked, %longest
  %h.most = select i1 %h.long, double %longest, double %h.asked
  %h.short = fcmp olt double %h.most, %shortest
  %h.first = select i1 %h.short, double %shortest, double %h.most
  br label %try
try:
  %h.free = phi double [ %h.first, %begin ], [ %h.shorter, %rejected ]
  %grows = phi double [ 10.0, %begin ], [ 1.0, %rejected ]
  %fits = fcmp oge double %h.free, %shortest
  br i1 %fits, label %within, label %done
within:
  %t.free = fadd double %t, %h.free
  %late = fcmp ogt double %t.free, %bound
  %t.new = select i1 %late, double %bound, double %t.free
  %h = fsub double %t.new, %t
  %tried = load double, ptr %tried.at
  %tried.next = fadd double %tried, 1.0
  store double %tried.next, ptr %tried.at
  call void @stages(ptr %x, ptr %numbers, ptr %K, ptr %y, ptr %state, ptr %A, ptr %C, double %t,
    double %h, i64 1, i64 %ends, i64 %all)
  %old = load STATE, ptr %y, align 8
  %old.size = call STATE @llvm.fabs.vSIZEf64(STATE %old)
  %new = load STATE, ptr %state, align 8
  %new.size = call STATE @llvm.fabs.vSIZEf64(STATE %new)
  %grown = fcmp ogt STATE %new.size, %old.size
  %larger = select <SIZE x i1> %grown, STATE %new.size, STATE %old.size
  %share = fmul STATE %larger, %rtol
  %scale = fadd STATE %atol, %share
  %e5 = call STATE @weighted(ptr %E, ptr %K, i64 %ends)
  %q5 = fdiv STATE %e5, %scale
  %p5 = fmul STATE %q5, %q5
  %fifths = call double @llvm.vector.reduce.fadd.vSIZEf64(double 0.0, STATE %p5)
  %e3 = call STATE @weighted(ptr %E.third, ptr %K, i64 %ends)
  %q3 = fdiv STATE %e3, %scale
  %p3 = fmul STATE %q3, %q3
  %thirds = call double @llvm.vector.reduce.fadd.vSIZEf64(double 0.0, STATE %p3)
  %both = fadd double %fifths, %thirds
  %none = fcmp oeq double %both, 0.0
  %hundredth = fmul double %thirds, 0x3F847AE147AE147B
  %mixed = fadd double %fifths, %hundredth
  %spread = fmul double %mixed, %components
  %norm = call double @llvm.sqrt.f64(double %spread)
  %part = fdiv double %fifths, %norm
  %off.some = fmul double %h, %part
  %off = select i1 %none, double 0.0, double %off.some
  %off.2 = call double @llvm.sqrt.f64(double %off)
  %off.4 = call double @llvm.sqrt.f64(double %off.2)
  %off.8 = call double @llvm.sqrt.f64(double %off.4)
  %factor = fdiv double 0x3FECCCCCCCCCCCCD, %off.8
  %good = fcmp olt double %off, 1.0
  br i1 %good, label %accepted, label %rejected
rejected:
  %enough = fcmp ogt double %factor, 0x3FC999999999999A
  %shrinks = select i1 %enough, double %factor, double 0x3FC999999999999A
  %h.shorter = fmul double %h, %shrinks
  br label %try
accepted:
  %much = fcmp ogt double %factor, %grows
  %stretch = select i1 %much, double %grows, double %factor
  %h.next = fmul double %h, %stretch
  store STATE %new, ptr %y.next, align 8
  call void @stages(ptr %x, ptr %numbers, ptr %K, ptr %y, ptr %state, ptr %A, ptr %C, double %t,
    double %h, i64 %ends, i64 %all, i64 %all)
  store double %h.next, ptr %control
  %m.next = add i64 %m, 1
  %t.next = getelementptr double, ptr %times, i64 %m.next
  store double %t.new, ptr %t.next
  %slope = getelementptr double, ptr %K, i64 %end.place
  call void @llvm.memcpy.p0.p0.i64(ptr %K.next, ptr %slope, i64 ROW, i1 0)
  br label %watch
watch:
  %w = phi i64 [ 0, %accepted ], [ %w.next, %calm ]
  %w.more = icmp slt i64 %w, %watched
  %falls = icmp slt i64 %w, 2
  %column = add i64 FIRST, %w
  %last.at = getelementptr double, ptr %slope, i64 %column
  br i1 %w.more, label %scan, label %on.free
scan:
  %s = phi i64 [ 0, %watch ], [ %s.next, %seen ]
  %last = load double, ptr %last.at
  %s.row = mul i64 %s, WIDTH
  %s.place = add i64 %s.row, %column
  %seen.at = getelementptr double, ptr %K, i64 %s.place
  %seen.now = load double, ptr %seen.at
  %apart = fsub double %seen.now, %last
  %apart.size = call double @llvm.fabs.f64(double %apart)
  %thrice = fmul double %apart.size, 3.0
  %like = fcmp olt double %thrice, %last
  %far.now = fcmp ogt double %seen.now, FAR
  %far.last = fcmp ogt double %last, FAR
  %far = and i1 %far.now, %far.last
  %near = or i1 %like, %far
  %signs = fmul double %seen.now, %last
  %same = fcmp ogt double %signs, 0.0
  %zero = fcmp oeq double %seen.now, 0.0
  %alike = or i1 %same, %zero
  %keeps = select i1 %falls, i1 %near, i1 %alike
  br i1 %keeps, label %seen, label %doubtful
seen:
  %s.next = add i64 %s, 1
  %s.more = icmp slt i64 %s.next, %all
  br i1 %s.more, label %scan, label %calm
calm:
  %w.next = add i64 %w, 1
  br label %watch
on.free:
  %place = load double, ptr %y.next
  %above = fcmp ogt double %place, %free.low
  %below = fcmp olt double %place, %free.high
  %inside = and i1 %above, %below
  br i1 %inside, label %kept, label %doubtful
kept:
  br label %step
doubtful:
  %in.doubt = sub i64 0, %m.next
  ret i64 %in.doubt
done:
  ret i64 %m
}

define void @fleet(ptr %x, ptr %numbers, ptr %blocks, ptr %states, ptr %state, ptr %A, ptr %C,
    ptr %E, ptr %tolerances, ptr %controls, ptr %times, ptr %given, ptr %counts, i64 %most,
    i64 %ends, i64 %all, i64 %watched, i64 %slots, i64 %more, i64 %designs) {
start:
  %more.bytes = mul i64 %more, 8
  %clock = getelementptr double, ptr %state, i64 SIZE
  %held = getelementptr double, ptr %clock, i64 1
  %rows = add i64 %most, 1
  %states.each = mul i64 %rows, SIZE
  %row.each = mul i64 %all, WIDTH
  %block.each = mul i64 %rows, %row.each
  br label %test
test:
  %d = phi i64 [ 0, %start ], [ %d.next, %one ]
  %go = icmp slt i64 %d, %designs
  br i1 %go, label %one, label %done
one:
  %P.place = mul i64 %d, %slots
  %P = getelementptr double, ptr %numbers, i64 %P.place
  %K.place = mul i64 %d, %block.each
  %K = getelementptr double, ptr %blocks, i64 %K.place
  %y.place = mul i64 %d, %states.each
  %y = getelementptr double, ptr %states, i64 %y.place
  %tol.place = mul i64 %d, TWICE
  %tol = getelementptr double, ptr %tolerances, i64 %tol.place
  %control.place = mul i64 %d, 6
  %control = getelementptr double, ptr %controls, i64 %control.place
  %t.place = mul i64 %d, %rows
  %t = getelementptr double, ptr %times, i64 %t.place
  %given.place = mul i64 %d, %more
  %own = getelementptr double, ptr %given, i64 %given.place
  %y.first = load STATE, ptr %y, align 8
  store STATE %y.first, ptr %state, align 8
  %t.now = load double, ptr %t
  store double %t.now, ptr %clock
  call void @llvm.memcpy.p0.p0.i64(ptr %held, ptr %own, i64 %more.bytes, i1 0)
  call double @fill(ptr %x, ptr %P, ptr %K, i64 1, i64 1, i64 0, i64 1)
  %made = call i64 @steps(ptr %x, ptr %P, ptr %K, ptr %y, ptr %state, ptr %A, ptr %C, ptr %E,
    ptr %tol, ptr %control, ptr %t, i64 %most, i64 %ends, i64 %all, i64 %watched)
  %count.at = getelementptr i64, ptr %counts, i64 %d
  store i64 %made, ptr %count.at
  %d.next = add i64 %d, 1
  br label %test
done:
  ret void
}
"""


class Scheme(NamedTuple):
    """A method of ``ends`` stages up to the end of a step, and more for its dense output.

    A : (s, s), C : (s,) of all stages
    E : (2, ends) of the estimates of orders 5 and 3
    """

    A: Floats
    C: Floats
    E: Floats


class CompiledRhs:
    """A body of a program, as machine code for states and for steps.

    Its inputs are the components of the state, the time, and ``more`` numbers that are given; its
    values their rates, and last what is ``watched``: two that may dip to zero, others, and one
    that need not be looked at.
    """

    def __init__(
        self, program: Program, body: Body, dimension: int, more: int, watched: int
    ) -> None:
        """Raises `Untraceable` for what is more than flat arithmetic, and
        `MissingEngineError` without llvmlite."""
        self.dimension, self.inputs, self.watched = dimension, dimension + 1 + more, watched
        trace = Trace(program, body, self.inputs)
        if trace.asked:
            raise Untraceable(FOLLOWED)
        self.rows: list[Any] = [*trace.values]
        text = Text(1).fill(self.inputs, self.rows) + self._steps_text()
        kinds = ("fill", FILL), ("steps", KIND), ("fleet", FLEET)
        self.at, self.steps, self._fleet = machine_code(text, *kinds)
        self.program = program
        self.numbers = row_of(program)

    def _steps_text(self) -> str:
        """The text of steps, with the sizes of a state and of a row as numbers."""
        n, width = self.dimension, len(self.rows)
        sizes = {"SIZE": n, "TWICE": 2 * n, "WIDTH": width, "ROW": 8 * width}
        numbers = sizes | {"FIRST": width - self.watched, "FAR": FAR}
        text = STEPS.replace("STATE", "<SIZE x double>")
        return re.sub("|".join(numbers), lambda found: str(numbers[found[0]]), text)

    def room_of(self, by: Scheme, most: int) -> int:
        """How many numbers so many steps of a design leave at their stages."""
        return (most + 1) * len(by.C) * len(self.rows)

    def fleet(
        self,
        by: Scheme,
        slots: Floats,
        given: Floats,
        begin: tuple[Floats, Floats],
        control: Floats,
        tolerances: Floats,
        most: int,
        room: Floats,
    ) -> FleetSteps:
        """Steps of m designs, each from its own ``begin`` (t (m,), y (m, n)), at most so many.

        slots : (m, k) numbers of the program, given : (m, p) of the right-hand side
        control : (m, 6) step to try, bound, longest step, 0, and the free_range (`CompiledStepper`)
        tolerances : (m, 2, n) relative and absolute ones
        room : numbers, at least m `room_of` so many steps; what was in it is gone
        """
        m, n, width, stages = len(slots), self.dimension, len(self.rows), len(by.C)
        t, y = np.zeros((m, most + 1)), np.zeros((m, most + 1, n))
        t[:, 0], y[:, 0] = begin
        K = room[: m * self.room_of(by, most)].reshape(m, most + 1, stages, width)
        counts = np.zeros(m, np.int64)
        state = np.zeros(self.inputs)
        size = state.itemsize
        first = state.ctypes.data
        x = (ctypes.c_void_p * self.inputs)(*range(first, first + size * self.inputs, size))
        slots, given, control, tolerances = map(
            np.ascontiguousarray, (slots, given, control, tolerances)
        )
        arrays = slots, K, y, state, by.A, by.C, by.E, tolerances, control, t, given, counts
        ends, own = by.E.shape[1], given.shape[1]
        numbers = most, ends, stages, self.watched, slots.shape[1], own, m
        self._fleet(x, *(a.ctypes.data for a in arrays), *numbers)
        return FleetSteps(t, y, K, np.abs(counts), counts < 0, control[:, 0], control[:, 3])


class FleetSteps(NamedTuple):
    """Steps of m designs.

    t : (m, s + 1) [s], y : (m, s + 1, n) where they begin, and where the last ends
    K : (m, s + 1, stages, r) rows of the program at their stages, until the room is used again;
        of no step that of the start
    made : (m,) how many steps, doubtful : (m,) whether something may happen in the last one
    h : (m,) [s] the step to try next, tried : (m,) how many were tried
    """

    t: Floats
    y: Floats
    K: Floats
    made: NDArray[np.int64]
    doubtful: NDArray[np.bool_]
    h: Floats
    tried: Floats


class Steps(NamedTuple):
    """Some steps, one after the other.

    t : (m + 1,) [s], y : (m + 1, n) where they begin, and where the last ends
    K : (m, s, r) rows of the program at their stages, until the next steps are made
    h : [s] the step to try next
    tried : how many steps were tried
    doubtful : whether something may happen in the last one
    """

    t: Floats
    y: Floats
    K: Floats
    h: float
    tried: int
    doubtful: bool


class CompiledStepper:
    """Rates with numbers that are given."""

    def __init__(self, rates: CompiledRhs, given: Sequence[float]) -> None:
        self._rates = rates
        self._parameters = rates.numbers.ctypes.data
        self._state = np.array([0.0] * (rates.dimension + 1) + [*given])
        self._row = np.zeros(len(rates.rows))
        self._room = np.zeros((0, 0, 0))
        first, count = self._state.ctypes.data, rates.inputs
        size = self._state.itemsize
        self._x = (ctypes.c_void_p * count)(*range(first, first + size * count, size))

    def steps(
        self,
        by: Scheme,
        begin: Any,
        h: float,
        ends: tuple[float, float],
        free_range: tuple[float, float],
        tolerances: Floats,
        most: int,
        every: bool = True,
    ) -> Steps:
        """Steps from ``begin`` (t, y), at most so many.

        ends : [s] where they end, and the longest one
        free_range : between which the first component is to stay
        tolerances : (2, n) relative and absolute ones
        every : whether all that is watched is looked at, or all but the last
        """
        r, n, width = self._rates, self._rates.dimension, self._row.size
        stages, watched = len(by.C), self._rates.watched - (not every)
        if len(self._room) <= most:
            self._room = np.zeros((most + 1, stages, width))
        K, t, y = self._room, np.zeros(most + 1), np.zeros((most + 1, n))
        t[0], y[0] = begin
        K[0, 0] = self.at(*begin)
        control = np.array([h, *ends, 0.0, *free_range])
        arrays = K, y, self._state, by.A, by.C, by.E, tolerances, control, t
        places = (x.ctypes.data for x in arrays)
        count = r.steps(self._x, self._parameters, *places, most, by.E.shape[1], stages, watched)
        m = abs(count)
        h, tried = float(control[0]), int(control[3])
        return Steps(t[: m + 1], y[: m + 1], K[:m], h, tried, count < 0)

    def at(self, t: float, y: Sequence[float]) -> list[float]:
        """What the program says of a state."""
        r, n = self._rates, self._rates.dimension
        self._state[:n], self._state[n] = y, t
        r.at(self._x, self._parameters, self._row.ctypes.data, 1, 1, 0, 1)
        row: list[float] = self._row.tolist()
        return row
