"""What samples cost by each engine, and when making machine code pays.

The *size* of a program is the length of its kernels' byte code in operations: NumPy's arrays,
Python's numbers, the compiler and machine code take times in proportion to it. A group without
closed form adds linear systems of its links. All say the seconds of one processor; only their
ratios decide. Nothing is measured while the program runs: the same requests in the same
order get the same engines, and with them the same bits.

Nobody knows how often a mechanism will be asked again. Machine code is made once the interpreter
has taken as much longer as making takes: whoever stops then has waited twice as long as needed at
most, and no rule without knowledge of what comes does better.

Source: Karlin, Manasse, Rudolph & Sleator, Competitive snoopy caching, Algorithmica 3, 1988.
"""

from __future__ import annotations

import math
import re
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from types import CodeType, FunctionType
from typing import TYPE_CHECKING

from blockmech.engines.numpy import leaves
from blockmech.ground.errors import BlockmechError
from blockmech.ground.plane import SCALAR_PRIMITIVES
from blockmech.ground.tolerances import DOUBLINGS
from blockmech.plan.plan import Program

if TYPE_CHECKING:
    from blockmech.result.motion import Cost

CALLED = re.compile(r"\b([A-Za-z_]\w*)\(", re.ASCII)
SYSTEMS = ("solve", "solve_transposed", "spread")
OPERATION = 50  # bytes of byte code
# Seconds of a sample by Python's numbers, of a call and a sample by arrays, and by machine code:
# of an operation, and of a linear system for each link. Measured over the gallery.
SCALAR = 0.2e-6, 13e-6
CALL, ARRAY = (1.5e-6, 50e-6), (1.3e-9, 0.7e-6)
FEW = round(CALL[0] / SCALAR[0])  # samples for which arrays only break even
CODE_CALL, CODE = (5e-9, 2e-6), (0.2e-9, 27e-9)
BEGIN, ALONE = 25e-6, 5e-6  # of a call of machine code: with several samples, with one
LINES = 1.75, 60  # of assembly
COMPILER, COMPILING, LOADING = 0.025, (10e-3, 0.055e-3), (1.7e-3, 0.2e-6)  # all, and with each line
STATE = 60e-6  # of a solver in Python beside each state that it asks for
# Of a sample along a path by arrays; of a state in steps of machine code, and lanes left idle.
PANEL, STEP, IDLE = 20e-6, 0.3e-6, 4
USUAL = 2_000  # states of a motion in time


def loops_pay(saved: float, lines: int, is_stored: Callable[[], bool]) -> bool:
    """Whether machine code of loops pays that would have saved so many seconds so far.

    lines : of its text; is_stored : whether its code needs no compiling, as the compiler says
    """
    loaded = "llvmlite.binding" in sys.modules
    budget = saved - (0.0 if loaded else COMPILER)
    if budget <= 0:
        return False
    first, line = LOADING if is_stored() else COMPILING
    return budget > first + line * lines


class Account:
    """What the samples of all programs of one text cost.

    saved : seconds that machine code would have saved so far
    """

    def __init__(self) -> None:
        self.samples, self.saved = 0, 0.0
        self.declined = False
        self.kept: bool | None = None  # whether machine code is there; None where nobody looked
        self._size: tuple[int, int] | None = None

    def by_interpreter(self, program: Program, n: int) -> tuple[float, str]:
        """Seconds of n samples, and whether Python's numbers or arrays take them."""
        return min(
            (self.time(program, SCALAR) * n, "scalar"),
            (self.time(program, CALL) + self.time(program, ARRAY) * n, "numpy"),
        )

    def by_machine_code(self, program: Program, n: int) -> float:
        """Seconds of n samples."""
        begin = BEGIN if n > 1 else ALONE
        return begin + self.time(program, CODE_CALL) + self.time(program, CODE) * n

    def making(self, program: Program) -> float:
        """Seconds until there is machine code: to load the compiler first, then what is kept."""
        lines = self.time(program, LINES)
        if "llvmlite.binding" not in sys.modules and self.saved < COMPILER:
            return COMPILER
        if self.kept is None:
            self.kept = _is_kept(program)
        first, line = LOADING if self.kept else COMPILING
        return first + line * lines

    def choice(self, program: Program, n: int, has_code: bool) -> str:
        """The engine for n samples more; ``has_code`` where the program's machine code is there."""
        if has_code:  # few samples of a short program would save a microsecond at most
            return "llvm"
        if n <= FEW and not self.samples:
            return "scalar"
        time, name = self.by_interpreter(program, n)
        saved = time - self.by_machine_code(program, n)
        if self.declined or saved <= 0:
            return name
        return "llvm" if self.saved + saved > self.making(program) else name

    def count(self, program: Program, n: int) -> None:
        """Note n samples that were interpreted."""
        self.samples += n
        if self._size is not None:
            saved = self.by_interpreter(program, n)[0] - self.by_machine_code(program, n)
            self.saved += max(saved, 0.0)

    def states_pay(self, program: Program, states: float) -> bool:
        """Whether machine code pays for a solver that asks for so many single states, one by one.

        states : those that the mechanism was asked for so far, and are to be expected
        """
        return self.pays(program, states * (STATE + self.time(program, SCALAR)))

    def pays(self, program: Program, seconds: float) -> bool:
        """Whether machine code pays that would have saved so many."""
        first, line = COMPILING
        return seconds > first + line * self.time(program, LINES)

    def time(self, program: Program, cost: tuple[float, float]) -> float:
        """What costs so much for an operation, and for a linear system's link."""
        if self._size is None:
            self._size = size_of(program)
        return cost[0] * self._size[0] + cost[1] * self._size[1]


@lru_cache(512)
def _account(source: str) -> Account:
    return Account()


def account(program: Program) -> Account:
    """The account of all programs of a text, whatever their numbers."""
    return _account(program.source)


def _is_kept(program: Program) -> bool:
    try:
        from blockmech.engines.llvm import is_kept

        return is_kept(program)
    except BlockmechError:  # without llvmlite
        return False


def size_of(program: Program) -> tuple[int, int]:
    """Operations of a program, those of its loops once, and linear systems by their links."""
    calls, total, systems = Counter(CALLED.findall(program.source)), 0, DOUBLINGS
    for name, f in program.functions.items():
        if isinstance(f, FunctionType):
            length, solving = _length(f.__code__, f.__module__)
            total += calls[name] * length
            systems += calls[name] * solving
    links = sum(len(leaves(getattr(f, "answer", ()))) // 4 for f in program.functions.values())
    return total // OPERATION + 2 * program.source.count("\n"), links * systems


@cache
def _length(code: CodeType, module: str) -> tuple[int, int]:
    """Bytes of a kernel's byte code with that of the kernels that it calls, each once; systems."""
    waiting, reached, systems = [(code, module)], dict[CodeType, int](), 0
    while waiting:
        code, module = waiting.pop()
        if code in reached:
            continue
        reached[code] = len(code.co_code)
        waiting += [(part, module) for part in code.co_consts if isinstance(part, CodeType)]
        space = vars(sys.modules[module])
        for name in code.co_names:
            callee = space.get(name)
            if isinstance(callee, FunctionType) and callee is not SCALAR_PRIMITIVES.get(name):
                waiting.append((callee.__code__, callee.__module__))
            systems += name in SYSTEMS
    return sum(reached.values()), systems


@dataclass
class Routes:
    """What a motion that is asked for again costs along its path by arrays, and in time.

    by_path : [s] of the last time along the path; NaN before, and 0 of the first, which samples it
    states : of the last time in time
    saved : [s] that those along the path would have taken less in time by machine code, so far
    """

    by_path: float = math.nan
    states: float = USUAL
    saved: float = 0.0

    def in_time(self, program: Program) -> float:
        """[s] in time."""
        return self.states * (STEP + IDLE * account(program).time(program, CODE))

    def save_in_time(self, program: Program, compiled: bool) -> bool:
        """Whether it takes less in time by machine code that is there, or pays."""
        saves = self.by_path > self.in_time(program)
        return saves and (compiled or account(program).pays(program, self.saved))

    def count_along(self, program: Program, cost: Cost) -> None:
        """Note one along the path; what machine code does, or is kept, has no samples."""
        if math.isnan(self.by_path) or not cost.samples:
            self.by_path = 0.0
            return
        calls, samples = account(program).time(program, CALL), account(program).time(program, ARRAY)
        self.by_path = cost.samples * (PANEL + samples) + cost.calls * calls
        self.saved += max(self.by_path - self.in_time(program), 0.0)
