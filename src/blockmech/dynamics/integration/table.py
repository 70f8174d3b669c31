"""The reduced table: what depends on position only, as piecewise polynomials.

A right-hand side that calls the mechanism's kernels costs in proportion to the
mechanism; a polynomial costs 3 us whatever stands behind it. J, J', tau and the damping
are sampled once, on equal panels of one turn, and evaluated by Horner's scheme in plain
Python. The end of the series says how well; a poor table is made again, finer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TypeAlias

import numpy as np

from blockmech.dynamics.chebyshev import Floats, rule
from blockmech.dynamics.system.reduced import TURN, Metered, feasible

NODES = 12
PANELS = (48, 96, 192, 384)
TRUSTED_MARGIN = 1e-2  # margin below which a table is not to be trusted
TRUSTED_INERTIA = 1e-4  # smallest inertia relative to the largest below which it is not either

Row: TypeAlias = tuple[float, ...]
Parts: TypeAlias = Callable[[float], tuple[float, float, float, float]]


@dataclass(frozen=True)
class Table:
    """Polynomials of J, J', tau and damping on equal panels.

    low, width : [rad or m] where it begins, and the width of a panel
    period : [rad or m] after which it repeats, or None
    rows : for each panel the coefficients of the four, lowest degree first
    error : [-] end of the worst series relative to its largest value
    """

    low: float
    width: float
    period: float | None
    rows: tuple[tuple[Row, Row, Row, Row], ...]
    error: float

    def parts(self) -> Parts:
        """q -> (J, dJ/dq, tau, damping), floats; NaN outside a table that does not repeat."""
        low, per, period, rows, count = (
            self.low,
            1 / self.width,
            self.period,
            self.rows,
            len(self.rows),
        )
        floor = math.floor
        nothing = (math.nan,) * 4
        damped = any(row[3] for row in rows)

        def at(q: float) -> tuple[float, float, float, float]:
            u = (q - low) * per
            if u - u != 0.0:
                return nothing  # infinite, or no number
            if period is not None:
                u -= floor(u / count) * count
            if not 0 <= u <= count:
                return nothing
            i = min(int(u), count - 1)
            x = 2 * (u - i) - 1
            J, dJ, tau, damping = rows[i]
            return (
                _horner(J, x),
                _horner(dJ, x),
                _horner(tau, x),
                _horner(damping, x) if damped else 0.0,
            )

        return at


def _horner(row: Row, x: float) -> float:
    a, b, c, d, e, f, g, h, i, j, k, l = row
    return a + x * (
        b
        + x
        * (
            c
            + x * (d + x * (e + x * (f + x * (g + x * (h + x * (i + x * (j + x * (k + x * l))))))))
        )
    )


def tabulated(
    meter: Metered, tolerance: float, low: float = 0.0, high: float = TURN
) -> Table | None:
    """A table of one period (or from ``low`` to ``high`` without one), or None.

    None where the mechanism comes near a dead centre, or where the finest table is poorer
    than ``tolerance``. Cost: 576 samples, twice that for each refinement.
    """
    period = meter.system.period
    if period is not None:
        low, high = 0.0, period
    wanted = frozenset({"dJ", "damping"} if meter.system.damped else {"dJ"})
    r = rule(NODES)
    best = None
    for panels in PANELS:
        edges = np.linspace(low, high, panels + 1)
        x = edges[:-1, None] + (high - low) / panels * r.low
        sample = meter.sample(x, wanted)
        if not feasible(sample).all() or sample.margin.min() < TRUSTED_MARGIN:
            return None
        if sample.J.min() < TRUSTED_INERTIA * sample.J.max():
            return None
        assert sample.dJ is not None
        damping = np.zeros_like(x) if sample.damping is None else sample.damping
        series = [f @ r.cosine for f in (sample.J, sample.dJ, sample.tau, damping)]
        sizes = [float(np.abs(c[:, 0]).max() + np.abs(c[:, 1]).max()) for c in series]
        sizes[1] += sizes[0] / (high - low)  # of J that hardly changes, dJ is rounding only
        count = 4 if sample.damping is not None else 3
        error = max(
            float(np.abs(c[:, -2:]).max()) / size
            for c, size in zip(series[:count], sizes[:count], strict=True)
            if np.abs(c).max() > 0
        )
        rows = [(c @ _monomials(NODES)).tolist() for c in series]
        zero = () if sample.damping is None else None
        best = Table(
            low,
            (high - low) / panels,
            period,
            tuple(
                (tuple(a), tuple(b), tuple(c), tuple(d) if zero is None else ())
                for a, b, c, d in zip(*rows, strict=True)
            ),
            error,
        )
        if error <= tolerance:
            return best
    return best if best is not None and best.error <= 100 * tolerance else None


@cache
def _monomials(n: int) -> Floats:
    """Series in cos(k phi) -> powers of x in [-1, 1], x = -cos(phi) at the nodes: (n, n)."""
    T = np.zeros((n, n))
    T[0, 0] = 1
    if n > 1:
        T[1, 1] = 1
    for k in range(2, n):
        T[k, 1:] = 2 * T[k - 1, :-1]
        T[k] -= T[k - 2]
    return np.asarray(T * (-1.0) ** np.arange(n))  # x = -cos(phi)
