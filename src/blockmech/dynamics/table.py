r"""The equation of motion of one driver as polynomials of the place, for integrators in time.

Where all repeats with the driver and loads are straight lines in its rate,

    J(q) q'' = tau_0(q) + tau_1(q) q' - J'(q) q'^2 / 2

is known once J, tau_0 and tau_1 are: on cells of a period, each made from samples and kept if its
series end in rounding. What is not so (kinks, dead centres, no inertia) asks the kernels.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from numpy.polynomial import chebyshev

from blockmech.plane import EPS
from blockmech.series import Floats, coefficients, nodes

NODES = 12  # of a cell
CUTS = (64, 4, 4)  # cells of a period, and what a poor one is cut into again and again
ENDED = 64 * EPS  # of the least inertia or the largest effort: rounding of a sum of ten terms
FAST = 1 / math.sqrt(EPS)  # [rad/s] at which what follows the rate hides the rest
Cell: TypeAlias = tuple[tuple[tuple[float, ...], ...], float]  # of powers falling; least margin


@cache
def to_powers() -> Floats:
    """Chebyshev coefficients of a cell -> coefficients of powers, the highest first."""
    found = np.zeros((NODES, NODES))
    for k in range(NODES):
        found[k, : k + 1] = chebyshev.cheb2poly([0.0] * k + [1.0])
    return found[:, ::-1]


class PlaceTable:
    """J, dJ/dq, tau and a margin at places of a `System`, from polynomials or its kernels."""

    def __init__(self, system: Any, period: float) -> None:
        self._system, self._period = system, period
        self._rates = "rate" in system.depends_on
        self._kinks = np.array([x % period for x in system.knots])
        self._largest = 0.0  # effort
        if "cells" not in system.kept:
            cells = self._made(np.zeros(1), period, CUTS)
            system.kept["cells"] = [*cells, cells[0]]  # rounding may put a place on the end
        self._cells = system.kept["cells"]

    def _made(self, begin: Floats, width: float, cuts: tuple[int, ...]) -> list[Any]:
        """Cells of what begins at some places; of a poor one a list of its parts, or None.

        Its margin is no trouble where it changes by less than itself.
        """
        width /= cuts[0]
        low = (begin[:, None] + width * np.arange(float(cuts[0]))).ravel()
        q = (low[:, None] + width / 2 * (nodes(NODES) + 1)).ravel()
        J, tau, dJ, margins = self._system.with_slopes(q)
        rows = [J, dJ, tau]
        if self._rates:
            rows.append((self._system.sample(q, FAST).tau - tau) / FAST)
        values = np.reshape(rows, (len(rows), low.size, NODES))
        margins = margins.reshape(low.size, NODES)
        margin = margins.min(axis=1)
        self._largest = self._largest or float(np.nanmax(np.abs(tau), initial=0.0))
        scale = np.abs(values).max(axis=2)
        least = values[0].min(axis=1)
        scale[:3] = least, np.maximum(scale[1], least), np.maximum(scale[2], self._largest)
        c = coefficients(values)
        left = np.abs(c[:, :, -(NODES // 4) :]).max(axis=2)
        kinked = (self._kinks >= low[:, None]) & (self._kinks <= low[:, None] + width)
        good = (left <= ENDED * scale).all(axis=0) & (margins.max(axis=1) < 2 * margin)
        good &= ~kinked.any(axis=1)
        parts: Iterator[list[Any]] = iter(())
        if len(cuts) > 1 and not good.all():
            made = self._made(low[~good], width, cuts[1:])
            parts = (made[i : i + cuts[1]] for i in range(0, len(made), cuts[1]))
        series = (tuple(map(tuple, x)) for x in (c @ to_powers()).transpose(1, 2, 0).tolist())
        return [
            (x, m) if ok else next(parts, None)
            for x, m, ok in zip(series, margin.tolist(), good.tolist(), strict=True)
        ]

    def one(self, q: float, qd: float, t: float) -> tuple[float, float, float, float]:
        """J, tau, dJ/dq and a margin at a state, see `System.one`."""
        turns = q / self._period
        if turns - turns != 0.0:
            return math.nan, math.nan, math.nan, math.nan
        x = (turns - math.floor(turns)) * CUTS[0]
        i = int(x)
        cell, x = self._cells[i], x - i
        while type(cell) is list:
            x *= len(cell)
            i = int(x)
            cell, x = cell[i], x - i
        if cell is None:
            J, tau, dJ, margin = self._system.one(q, qd, t)
            return J, tau, dJ, margin
        x = 2.0 * x - 1.0
        J = dJ = tau = damping = 0.0
        if self._rates:
            for a, b, c, d in cell[0]:
                J, dJ, tau, damping = J * x + a, dJ * x + b, tau * x + c, damping * x + d
            return J, tau + damping * qd, dJ, cell[1]
        for a, b, c in cell[0]:
            J, dJ, tau = J * x + a, dJ * x + b, tau * x + c
        return J, tau, dJ, cell[1]
