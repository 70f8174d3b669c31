r"""The equation of motion of one driver as polynomials of the place, for integrators in time.

Where all repeats with the driver and loads are straight lines in its rate,

    J(q) q'' = tau_0(q) + tau_1(q) q' - J'(q) q'^2 / 2

is known once J, tau_0 and tau_1 are: on cells of a period, each made from samples and kept if its
series end in rounding. What is not so (kinks, dead centres, no inertia) asks the kernels.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from blockmech.dynamics.place_data import MARGIN, RESOLVED, SLIPS, TAU, J, PlaceData, mesh
from blockmech.series import Floats

CELLS, NODES = 64, 12  # of a period to begin with, of a cell: a hundred operations a state


@cache
def to_powers() -> Floats:
    """Chebyshev coefficients of a cell -> coefficients of powers, the highest first."""
    matrix = np.zeros((NODES, NODES))
    for k in range(NODES):
        matrix[k, : k + 1] = chebyshev.cheb2poly([0.0] * k + [1.0])
    return matrix[:, ::-1]


class PlaceTable:
    """J, dJ/dq, tau and a margin at places of a `System`, from polynomials or its kernels."""

    def __init__(self, system: Any, period: float) -> None:
        self._system, self._period = system, period
        self._rates = "rate" in system.depends_on
        if "cells" not in system.kept:
            kinks = np.array([x % period for x in system.knots])
            edges = np.union1d(np.linspace(0.0, period, CELLS + 1), kinks)
            made = mesh(self._values, edges, NODES, RESOLVED)
            system.kept["cells"] = [x.low for x in made], [self._cell(x) for x in made]
        self._lows, self._cells = system.kept["cells"]

    def _cell(self, piece: PlaceData) -> tuple[float, float, float, Any, float]:
        """Low and high end, half the length, coefficients of powers, the least margin."""
        rows = [J, TAU, *range(SLIPS, len(piece.rows))]
        powers = (piece.series[rows] @ to_powers()).T.tolist()
        return piece.low, piece.high, piece.length / 2, powers, float(piece.rows[MARGIN].min())

    def _values(self, q: Floats) -> Floats:
        J, tau, dJ, margin = self._system.with_slopes(q)
        rows = [J, tau, margin, dJ]
        if self._rates:
            rows.append(self._system.damping(q))
        return np.array(rows)

    def one(self, q: float, qd: float, t: float) -> tuple[float, float, float, float]:
        """J, tau, dJ/dq and a margin at a state, see `System.one`."""
        if q - q != 0.0:
            return math.nan, math.nan, math.nan, math.nan
        x = q - self._period * math.floor(q / self._period)
        i = bisect_right(self._lows, x) - 1
        if i < 0 or x > self._cells[i][1]:
            J, tau, dJ, margin = self._system.one(q, qd, t)
            return J, tau, dJ, margin
        low, _, half, powers, margin = self._cells[i]
        x = (x - low) / half - 1.0
        J = dJ = tau = damping = 0.0
        if self._rates:
            for a, b, c, d in powers:
                J, tau, dJ, damping = J * x + a, tau * x + b, dJ * x + c, damping * x + d
            return J, tau + damping * qd, dJ, margin
        for a, b, c in powers:
            J, tau, dJ = J * x + a, tau * x + b, dJ * x + c
        return J, tau, dJ, margin
