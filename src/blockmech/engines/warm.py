"""One sample at a time, for long: the scalar engine until compiling pays, machine code after.

The two say the same to the last bit, so nobody sees the change but the clock.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from blockmech.engines.scalar import ScalarEngine
from blockmech.errors import MissingEngineError
from blockmech.plan import Program

# Samples that the scalar engine takes as long for as compiling takes, the compiler's loading
# included: 0.3 s by some 20 us. Who stops there has waited twice as long as needed, nobody longer.
WORTH = 15_000


class WarmEngine:
    """A program that is asked for one sample after the other, as an integrator asks."""

    one: Callable[[Sequence[float]], tuple[Any, ...]]
    """Values of one sample; see `ScalarEngine.one`."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self._scalar = ScalarEngine(program)
        self._left = WORTH
        self.one = self._counted

    def _counted(self, inputs: Sequence[float]) -> tuple[Any, ...]:
        self._left -= 1
        if self._left <= 0:
            self.one = self._scalar.one
            self.one = self._compiled()
        return self._scalar.one(inputs)

    def _compiled(self) -> Callable[[Sequence[float]], tuple[Any, ...]]:
        """Machine code where there can be some."""
        from blockmech.engines.llvm import LlvmEngine
        from blockmech.engines.trace import Untraceable

        try:
            return LlvmEngine(self.program).one
        except (Untraceable, MissingEngineError):
            return self._scalar.one
