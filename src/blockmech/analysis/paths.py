"""Paths of markers: which of them are straight, and along which line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import EQUAL
from blockmech.typing import Vectors


def principal_axes(z: Vectors) -> tuple[Vectors, Vectors, NDArray[np.bool_]]:
    """Lines through the places (m, n) of m markers at n poses.

    Returns a place (m,) on each line, its unit direction (m,), 0 of a marker that does not move,
    and whether the marker stays on it.
    """
    m, first = np.arange(len(z)), z[:, 0]
    middle = (z[m, np.abs(z - first[:, None]).argmax(axis=1)] + first) / 2
    off = z - middle[:, None]
    spread = np.abs(off).max(axis=1)
    moves = spread > EPS * np.abs(z).max(axis=1)
    # the square forgets which way along the axis places lie
    u = np.sqrt(np.where(moves, (off**2).sum(axis=1), 0.0))
    u /= np.where(moves, np.abs(u), 1.0)
    aside = np.abs((off * u.conj()[:, None]).imag).max(axis=1)
    return middle, u, moves & (aside <= EQUAL * spread)
