"""What the laws of loads and signals say, a second time, in NumPy and SciPy."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from blockmech.analysis.free_bodies import Array
from blockmech.loads.laws import DC, Constant, Fourier, Polynomial, Signal, Table


def table_of(law: Table, x: Array) -> Array:
    """A table (n,) at its argument (n,), by SciPy's splines; NaN beyond its rows."""
    from scipy.interpolate import CubicSpline

    knots, values = np.asarray(law.arguments), np.asarray(law.values)
    if law.whole:
        knots, values = np.append(knots, knots[0] + law.whole), np.append(values, values[0])
        x = knots[0] + (x - knots[0]) % law.whole
    if law.interpolation == "linear":
        return np.asarray(np.interp(x, knots, values, left=math.nan, right=math.nan))
    ends = "periodic" if law.whole else "not-a-knot"
    return np.asarray(CubicSpline(knots, values, bc_type=ends, extrapolate=False)(x))


def _fourier(law: Fourier, x: Array) -> Array:
    w = math.tau / law.period if law.period else 1 / (law.turns or 1)
    waves = [a * np.cos(k * w * x) for k, a in enumerate(law.cosines, start=1)]
    waves += [b * np.sin(k * w * x) for k, b in enumerate(law.sines, start=1)]
    return np.asarray(law.mean + np.sum([0 * x, *waves], axis=0))


LAWS: Mapping[type, Callable[[Any, Array], Array]] = {
    Constant: lambda law, x: law.value + 0 * x,
    Polynomial: lambda law, x: np.polynomial.polynomial.polyval(x, law.coefficients),
    Table: table_of,
    Fourier: _fourier,
    Signal: lambda law, x: x,
    DC: lambda law, x: law.stall_moment * (1 - x / law.no_load_speed),
}
