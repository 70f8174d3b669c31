r"""Nodes of panels: pieces of a motion in one direction, and what is integrated over them.

With v from 0 to 1 and the way from an anchor,

    q = anchor + way v^p,     w = dK/dq,     dt/dv = p |way| v^(p-1) sqrt(J / 2K)

where p = 2 at a standstill or a dead centre, so that all three are smooth in v, else 1. The
kinetic energy K is never a difference of potentials: from the anchor it is an *average* of w,
which keeps its relative accuracy where K goes to zero.

Rows of numbers (n + 2,) are values at the anchor, at n Chebyshev nodes and at v = 1, or n
coefficients of a series in 2 v - 1 and two zeros.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import chebyshev, legendre

from blockmech.engines.kinds import Reals
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import DOUBLE_ROOT
from blockmech.typing import Array, Floats, Real

# Kinds of panels: a plain one, one that begins or ends with a standstill, or ends at a dead centre.
PLAIN, FROM_REST, TO_REST, TO_LIMIT = range(4)
COARSE, FINE = 32, 48  # nodes of a panel: 16 resolve too little, sums of 96 round more
AT_ONCE = 1024  # turns, times or steps that are worked on together: a megabyte or two
SHORT = 8  # a piece is made anew if what happens in it needs no more than this part of it
CLOSE = 4 * EPS  # relative distance of two places that are one, but for rounding of their sum
J, TAU, MARGIN = range(3)  # rows of place data

# A piece of the path: the series of J and tau, of both runs each, in its coordinate; their values
# along the motion; and what tau does from its begin on.
VALUES, OVER_ALL = range(2, 6, 2)
PIECE = OVER_ALL + 1
# A panel: J and tau along it, of both runs each; what tau does from its anchor on; the series of
# dt/dv, times since the anchor, dt/dv; and where it lies.
GAINS, RATE, SINCE, SLOPES, SPAN, PANEL = range(2, 8)
# Of a span: energy [J] at the anchor, or at v = 1 of a dead centre; LEFT at the end; WORK to and
# fro.
BEGIN, END, ENERGY, KIND, TIME, LEFT, WORK, TIME_AT_END = range(8)

Row: TypeAlias = Annotated[Reals, "of.n + 2"]
Square: TypeAlias = Annotated[Reals, "of.n + 2", "of.n + 2"]


class Sizes(NamedTuple):
    """Nodes of both samplings, components of a state."""

    n: int
    k: int
    state: int = 0


class Nodes(NamedTuple):
    """What panels are read and integrated by: rows and matrices that rows are multiplied by.

    v : of both samplings; series : values -> coefficients, of both
    shares, leads : v^p and its derivative, of plain panels and others
    gaps : of v^p to the farther neighbour
    inside, number : 1 at the nodes, 0 at anchor and end; 0, 1, 2 ...
    work : w -> K per unit of way, for each kind of panel; towards a dead centre 2 v w is smooth
    values : coefficients -> values; since : -> times since the anchor
    parts : 1 for the last quarter of the terms, for the one before, for those that the
        second run has
    """

    v: Row
    series: Square
    shares: Row
    leads: Row
    gaps: Row
    inside: Row
    number: Row
    work: Square
    values: Row
    since: Row
    parts: Row


class Rule(NamedTuple):
    """n nodes v (n,) on (0, 1), and values there -> Chebyshev coefficients in 2 v - 1 (n, n)."""

    v: Floats
    to_series: Floats


def basis(v: Real, n: int) -> Array:
    """Chebyshev polynomials (..., n) in 2 v - 1 at v (...); exact beside v = 0.

    Real parts of the powers of a number on the unit circle, whose argument is exact there; each
    half of them is the half before it times one power.
    """
    v = np.asarray(v)
    flat = v.ravel()
    z = (2 * flat - 1) + 2j * np.sqrt(flat * (1 - flat))
    columns = np.empty((n, flat.size), dtype=z.dtype)  # places side by side: most are many
    columns[0] = 1
    count = 1
    while count < n:
        step = min(count, n - count)
        np.multiply(columns[:step], z, out=columns[count : count + step])
        z, count = z * z, 2 * count
    return np.ascontiguousarray(columns.real.T).reshape(*v.shape, n)


def node_places(n: int, kind: type[np.floating] = np.float64) -> Real:
    """n nodes v_i = sin^2((i + 1/2) pi / 2n), small ones to full relative accuracy."""
    return np.sin((np.arange(n) + kind(0.5)) * (2 * np.arctan(kind(1)) / n)) ** 2


def _precise(n: int) -> tuple[Array, Array]:
    """The rule in extended precision, where the machine has it.

    The angle of the polynomial k is rounded k times as much as that of the first.
    """
    v = node_places(n, np.longdouble)
    to_series = basis(v, n).T * (2 / np.longdouble(n))
    to_series[0] /= 2
    return v, to_series


@cache
def rule(n: int) -> Rule:
    """The rule with n nodes."""
    return Rule(*(np.asarray(x, dtype=np.float64) for x in _precise(n)))


@cache
def nodes(n: int, k: int) -> Nodes:
    """Those of panels of n nodes, whose second sampling has k."""
    samplings = [_precise(n), _precise(k)]
    v, to_series = samplings[0]
    ends, (x, weights) = np.append(v, 1)[:, None], _gauss(n + 1)
    s = (x + 1) / 2
    values = basis(ends * s, n)  # (n + 1, gauss, n)
    plain, rest = (
        ends**p * (np.einsum("g,igk->ik", weights / 2 * p * s ** (p - 1), values) @ to_series)
        for p in (1, 2)
    )
    limit = np.vstack([-plain[-1:], plain - plain[-1]]) * (2 * v)
    every, first, inside, terms = slice(n + 2), slice(1, n + 2), slice(1, n + 1), np.arange(n + 2)
    positions = np.concatenate([[0], v, [1]])
    shares, quarter = np.array([positions, positions**2]), n // 4
    gaps = np.diff(shares, axis=1, prepend=0, append=1)
    clock = chebyshev.chebint(np.eye(n), lbnd=-1, axis=1) / 2
    parts = [terms >= n - quarter, terms >= n - 2 * quarter, terms < k]
    rows = (
        _laid(n, *((0, slice(1, len(x) + 1), x) for x, _ in samplings))[:, 0],
        _laid(n, *((slice(1, len(x) + 1), slice(len(x)), m.T) for x, m in samplings)),
        shares,
        np.array([np.ones(n + 2), 2 * positions]),
        np.maximum(gaps[:, 1:], gaps[:, :-1]),
        np.array([(terms > 0) & (terms <= n)]),
        np.array([terms]),
        _laid(n, *((inside, first, x.T) for x in (plain, rest, rest)), (inside, every, limit.T)),
        _laid(n, (slice(n), every, basis(positions, n).T))[0],
        _laid(n, (slice(n), first, clock @ basis(positions[1:], n + 1).T))[0],
        np.array([parts[0] & (terms < n), parts[1] & ~parts[0], parts[2]]),
    )
    return Nodes(*(np.ascontiguousarray(x, dtype=np.float64) for x in rows))


def _laid(n: int, *blocks: tuple[slice | int, slice, Array]) -> Array:
    """Matrices (m, n + 2, n + 2) of zeros but for a block each."""
    matrices = np.zeros((len(blocks), n + 2, n + 2), dtype=np.longdouble)
    for matrix, (rows, columns, block) in zip(matrices, blocks, strict=True):
        matrix[rows, columns] = block
    return matrices


def _gauss(n: int) -> tuple[Array, Array]:
    """Places and weights of Gauss's rule on [-1, 1], by a step of Newton's from NumPy's."""
    p = np.zeros(n + 1, dtype=np.longdouble)
    p[-1] = 1
    x, slope = legendre.leggauss(n)[0].astype(np.longdouble), legendre.legder(p)
    x = x - legendre.legval(x, p) / legendre.legval(x, slope)
    return x, 2 / ((1 - x * x) * legendre.legval(x, slope) ** 2)


def roots(series: Floats) -> Floats:
    """Places v in [0, 1] at which a series in 2 v - 1 is zero, ascending.

    Coefficients that are rounding are left out: they would make roots of their own.
    """
    trimmed = chebyshev.chebtrim(series, EPS * float(np.abs(series).max()))
    if trimmed.size < 2:
        return np.empty(0)
    zeros = chebyshev.chebroots(trimmed)
    real = zeros.real[(np.abs(zeros.imag) <= DOUBLE_ROOT) & (np.abs(zeros.real) <= 1 + DOUBLE_ROOT)]
    return np.sort((np.clip(real, -1.0, 1.0) + 1) / 2)
