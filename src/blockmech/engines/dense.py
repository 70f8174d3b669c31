"""Dense output of steps: states at any times, and where one passes a number.

By machine code where a compiler is loaded already: none is for this alone.

A step from t0 on has a series c_0 to c_7 for each component of the state. At a share x of it,
with z = 1 - x,

    y = ((((((c_0 x + c_1) z + c_2) x + c_3) z + c_4) x + c_5) z + c_6) x + c_7

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.6 (6.14).
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from blockmech.engines import loops
from blockmech.engines.kinds import Reals
from blockmech.engines.llvm import machine_code
from blockmech.typing import Floats

# Of an array of one's own, in a third of the time that its attribute ``ctypes`` takes.
PLACE: Any = (ctypes.c_char * 1).from_buffer


def value(series: Reals, n: int, x: float) -> float:
    """A component at a share of a step; its series stands every n numbers (or n arrays)."""
    c, z = series, 1.0 - x
    high = (((c[0] * x + c[n]) * z + c[2 * n]) * x + c[3 * n]) * z + c[4 * n]
    return ((high * x + c[5 * n]) * z + c[6 * n]) * x + c[7 * n]  # type: ignore[no-any-return]


def states(
    begins: Reals,
    lengths: Reals,
    series: Reals,
    times: Reals,
    out: Reals,
    m: int,
    n: int,
    count: int,
) -> None:
    """States (n, count) at times, from the series (m, 8, n) of steps."""
    for k in range(count):
        step, after = 0, m
        while after - step > 1:
            middle = step + (after - step >> 1)
            if begins[middle] < times[k]:
                step = middle
            else:
                after = middle
        x = (times[k] - begins[step]) / lengths[step]
        for i in range(n):
            out[i * count + k] = value(series[step * 8 * n + i :], n, x)


def crossings(
    series: Reals,
    shares: Reals,
    n: int,
    level: float,
    first: float,
    last: float,
    sense: int,
    parts: int,
) -> int:
    """How often a component passes a level in a step, and at which shares of it.

    It is looked at between equal parts, and known to be ``first`` and ``last`` above it at both
    ends; ``sense`` is the sign of the change that counts, 0 for both.
    """
    count, before = 0, first
    for k in range(1, parts + 1):
        low, high = (k - 1.0) / parts, float(k) / parts
        now = last if k == parts else value(series, n, high) - level
        rises = before < 0.0 and now >= 0.0 and sense >= 0
        if rises or (before > 0.0 and now <= 0.0 and sense <= 0):
            while now != 0.0:
                middle = 0.5 * (low + high)
                if middle <= low or middle >= high:
                    break
                if (value(series, n, middle) - level) * before > 0.0:
                    low = middle
                else:
                    high = middle
            shares[count] = high
            count += 1
        before = now
    return count


def code() -> tuple[Any, Any] | None:
    """`states` and `crossings` as machine code; None where no compiler is loaded."""
    return compiled() if "llvmlite.binding" in sys.modules else None


@cache
def compiled() -> tuple[Any, Any]:
    """The same, for all mechanisms."""
    functions = {f.__name__: f for f in (states, crossings)}
    kinds = ((name, loops.signature(f)) for name, f in functions.items())
    code_: tuple[Any, Any] = machine_code(loops.text(**functions), *kinds)
    return code_


@dataclass(frozen=True)
class Dense:
    """Dense output of steps that begin at t (m,) and last h (m,) [s].

    series : (m, 8, n)
    """

    t: Floats
    h: Floats
    series: Floats

    @classmethod
    def cubic(cls, t: float, h: float, ends: Sequence[Floats], slopes: Sequence[Floats]) -> Dense:
        """That of one step from a time on: the cubic through states (n,) and rates at its ends."""
        moved, first, last = ends[1] - ends[0], h * slopes[0], h * slopes[1]
        series = np.zeros((1, 8, len(moved)))
        series[0, 4:] = 2.0 * moved - last - first, first - moved, moved, ends[0]
        return cls(np.array([t]), np.array([h]), series)

    @classmethod
    def joined(cls, times: Sequence[float], pieces: Sequence[Dense]) -> Dense:
        """That of pieces, each from one of the times [s] to the next.

        What a piece knows of steps beyond is left out.
        """
        if len(pieces) == 1:
            return pieces[0]
        segments = []
        for piece, end in zip(pieces, times[1:], strict=True):
            m = max(int(piece.t.searchsorted(end)), 1)
            segments.append((piece.t[:m], piece.h[:m], piece.series[:m]))
        return cls(*map(np.concatenate, zip(*segments, strict=True)))

    def part(self, first: int, end: int) -> Dense:
        """That of some steps."""
        return Dense(self.t[first:end], self.h[first:end], self.series[first:end])

    def __call__(self, t: float | Floats) -> Floats:
        """States (n, ...) at times (...): at one, or (p,)."""
        times, (m, _, n) = np.array(t, np.float64, order="C"), self.series.shape
        if (by := code()) is None:
            step = np.maximum(self.t.searchsorted(times) - 1, 0)
            series, x = np.moveaxis(self.series[step], (-2, -1), (0, 1)), times - self.t[step]
            return np.asarray(value(series, 1, x / self.h[step]))  # type: ignore[arg-type]
        out = np.empty((n, *times.shape))
        if times.size:
            by[0](*map(PLACE, (self.t, self.h, self.series, times, out)), m, n, times.size)
        return out

    def crossings(
        self, i: int, level: float, ends: Sequence[float], sense: int, parts: int
    ) -> list[float]:
        """Times [s] in the first step at which a component passes a level, see `crossings`."""
        shares, row = np.empty(parts), self.series[0].reshape(-1)[i:]
        about = self.series.shape[2], level, *ends, sense, parts
        by = code()
        many = by[1](PLACE(row), PLACE(shares), *about) if by else crossings(row, shares, *about)
        begin, h = float(self.t[0]), float(self.h[0])
        return [begin + x * h for x in shares[:many].tolist()]
