"""A function of one coordinate as Chebyshev series on panels.

Made from values in batches; panels are halved, all at once, until their series end in
rounding. Then the function has a value, a derivative, an integral, roots and extrema, all
by `numpy.polynomial.chebyshev`.

Coefficients that are rounding are cut off: a derivative magnifies the k-th one by k^2.

Source: Trefethen, Approximation Theory and Approximation Practice, 2013, chapters 8 and 18.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import DOUBLE_ROOT, EQUAL, HALVINGS
from blockmech.typing import Floats

NODES = 32  # of a panel: a quarter shows the end of its series; with 16 extrema lose a digit
TOLERANCE = 450 * EPS  # tail of a panel that needs no halving
MOST = 20 * HALVINGS  # panels: a score of corners; what has no series is not halved for ever
# Last quarter of the coefficients over the one before: of noise 1; of a corner, whose
# coefficients fall like 1/k^2, (2/3)^2 = 0.44, and that is to be halved further. Nearer to the
# corner: noise falls below two thirds by chance, and a panel of noise is halved for nothing.
LEVEL = 0.55
STANDS_OUT = 4.0  # times the largest of a quarter: noise hardly ever does
GOLDEN = (3 - math.sqrt(5)) / 2  # share of a spacing that keeps samples off places of symmetry
PATIENCE = 3  # halvings after which what ended on no panel has no series; a smooth one may need two


@cache
def nodes(n: int) -> Floats:
    """Chebyshev points (n,) of [-1, 1], rising."""
    return np.asarray(chebyshev.chebpts1(n))


@cache
def _to_coefficients(n: int) -> Floats:
    # Cosines of whole parts of a turn, which are reduced before they are rounded.
    parts = np.outer(2 * np.arange(n)[::-1] + 1, np.arange(n)) % (4 * n)
    matrix = np.cos(parts * (np.pi / (2 * n))) * (2 / n)
    matrix[:, 0] /= 2
    return np.asarray(matrix)


@np.errstate(invalid="ignore")  # of values without bound, which have none
def coefficients(values: Floats) -> Floats:
    """Chebyshev coefficients (..., n) of values (..., n) at `nodes`."""
    return np.asarray(values @ _to_coefficients(values.shape[-1]))


def tail(c: Floats) -> Floats:
    """What ends a series (..., n), relative to its largest coefficient; 0 if that is rounding.

    The last quarter counts, because of even and odd zeros. Where it no longer falls below
    the quarter before, and is small, it is rounding.
    """
    return relative_tail(*largest(c))


def relative_tail(last: Floats, before: Floats, total: Floats) -> Floats:
    """The same of what is `largest` in series."""
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = np.where(total == 0, 0.0, last / total)
        return np.where((last > LEVEL * before) & (relative < EQUAL), 0.0, relative)


def largest(c: Floats) -> tuple[Floats, Floats, Floats]:
    """The largest coefficients of the last quarter, of the one before, and of all."""
    quarter, size = c.shape[-1] // 4, np.abs(c)
    last, before = size[..., -quarter:], size[..., -2 * quarter : -quarter]
    return last.max(axis=-1), before.max(axis=-1), size.max(axis=-1)


def without_rounding(c: Floats) -> Floats:
    """The series (..., n) without what follows the last coefficient that stands out of its end."""
    last, *_ = largest(c)
    above = np.abs(c) > STANDS_OUT * last[..., None]
    significant = np.flip(np.logical_or.accumulate(np.flip(above, -1), axis=-1), -1)
    return np.where(significant | ~above.any(axis=-1, keepdims=True), c, 0.0)


@dataclass(frozen=True)
class Series:
    """A function on [edges[0], edges[-1]].

    Attributes
    ----------
    edges : (m + 1,) rising
    c : (m, n) Chebyshev coefficients of each panel; NaN where a value was not finite
    resolved : (m,) whether the panel's series ends
    """

    edges: Floats
    c: Floats
    resolved: NDArray[np.bool_]

    def __call__(self, x: Floats) -> Floats:
        """Values (k,) at places (k,)."""
        x = np.asarray(x, dtype=float)
        i = np.clip(np.searchsorted(self.edges, x, "right") - 1, 0, len(self.c) - 1)
        z = np.clip((x - self._middle[i]) / self._half[i], -1.0, 1.0)
        return np.asarray(chebyshev.chebval(z, self.c[i].T, tensor=False))

    @cached_property
    def _half(self) -> Floats:
        return np.diff(self.edges) / 2

    @cached_property
    def _middle(self) -> Floats:
        return self.edges[:-1] + self._half

    def derivative(self) -> Series:
        """The derivative, panel by panel."""
        return replace(self, c=np.asarray(chebyshev.chebder(self.c, axis=1) / self._half[:, None]))

    def integral(self) -> Series:
        """The integral from the first edge."""
        antiderivatives = chebyshev.chebint(self.c, lbnd=-1, axis=1) * self._half[:, None]
        before = np.cumsum(antiderivatives.sum(axis=1)) - antiderivatives.sum(axis=1)  # T_k(1) = 1
        antiderivatives[:, 0] += before
        return replace(self, c=np.asarray(antiderivatives))

    def roots(self) -> Floats:
        """Places of the roots on resolved panels, rising.

        A root of even order counts where rounding leaves it real or nearly so.
        """
        roots = [self._roots_on(i) for i in np.flatnonzero(self.may_vanish()).tolist()]
        x = np.concatenate([np.empty(0), *roots])
        x = np.sort(x[(x >= self.edges[0]) & (x <= self.edges[-1])])
        panel = np.clip(np.searchsorted(self.edges, x) - 1, 0, len(self.c) - 1)
        spacing = 2 * DOUBLE_ROOT * self._half[panel]  # found on both sides of an edge
        return np.asarray(x[np.diff(x, prepend=-np.inf) > spacing])

    def may_vanish(self) -> NDArray[np.bool_]:
        """Whether (m,) resolved panels have room for a zero: their terms outweigh the mean."""
        size = np.abs(self.c)
        return np.asarray(self.resolved & (2 * size[:, 0] <= (1 + DOUBLE_ROOT) * size.sum(axis=1)))

    def _roots_on(self, i: int) -> Floats:
        c = chebyshev.chebtrim(self.c[i])
        if not np.any(c[1:]):
            return np.empty(0)
        z = chebyshev.chebroots(c)
        z = z[(np.abs(z.imag) <= DOUBLE_ROOT) & (np.abs(z.real) <= 1 + DOUBLE_ROOT)].real
        slope = chebyshev.chebval(z, chebyshev.chebder(c))
        step = np.divide(chebyshev.chebval(z, c), slope, out=np.zeros_like(z), where=slope != 0)
        z = z - np.where(np.abs(step) <= DOUBLE_ROOT, step, 0.0)  # Newton: to rounding
        z[np.abs(np.abs(z) - 1) <= 4 * EPS] = np.sign(z[np.abs(np.abs(z) - 1) <= 4 * EPS])
        return np.asarray(self._middle[i] + self._half[i] * z)

    def extrema(self, at_zero: bool = False) -> Floats:
        """Places of the roots of the derivative on resolved panels, rising.

        ``at_zero`` leaves out panels where the function is nowhere zero.
        """
        if not at_zero:
            return self.derivative().roots()
        vanishing = self.may_vanish()
        return (
            replace(self, resolved=vanishing).derivative().roots()
            if vanishing.any()
            else np.empty(0)
        )


def fit(
    function: Callable[[Floats], Floats],
    edges: Floats,
    *,
    n: int = NODES,
    tolerance: float = TOLERANCE,
    floor: float = 0.0,
    levels: int = HALVINGS,
    most: int = MOST,
    divide: Callable[[Floats, Floats, Floats], Floats] | None = None,
) -> Series:
    """The series of a function, fine enough to end on each panel.

    Parameters
    ----------
    function : (k,) -> (k,), values at places; NaN where there is none
    edges : (m + 1,) of the panels to begin with
    n : nodes of a panel
    tolerance : tail that is small enough, relative to the panel's largest coefficient
    floor : tail that is rounding, however small the panel's coefficients
    levels : how often a panel may be halved; a corner is then known to the root of rounding
    most : panels above which none is halved any more
    divide : middles (m,) of panels that do not end, places and values (m, n) there -> where to
        divide them instead

    Returns
    -------
    Series; panels that still do not end are not ``resolved``
    """
    low, high = np.asarray(edges[:-1], dtype=float), np.asarray(edges[1:], dtype=float)
    segments: list[tuple[Floats, Floats, Floats, NDArray[np.bool_]]] = []
    count = 0
    for level in range(levels + 1):
        half = (high - low) / 2
        x = (low + half)[:, None] + half[:, None] * nodes(n)
        y = np.asarray(function(x.ravel()), dtype=float).reshape(x.shape)
        c = coefficients(y)
        good: NDArray[np.bool_] = np.asarray(np.isfinite(c).all(axis=1))
        rounded = EPS * np.abs(edges).max() / half  # of the places, which moves the values
        size, change = np.abs(c).max(axis=1), np.abs(c[:, 1:]).max(axis=1)
        allowed = np.maximum(tolerance * size, floor)
        good[good] = (tail(c) * size <= np.maximum(allowed, rounded * change))[good]
        middle = low + half
        final: NDArray[np.bool_] = np.asarray(good | (middle <= low) | (middle >= high))
        hopeless = level >= PATIENCE and not count and not good.any()
        if level == levels or hopeless or count + 2 * len(low) > most:
            final[:] = True
        segments.append((low[final], high[final], c[final], good[final]))
        count += int(final.sum())
        if final.all():
            break
        low, middle, high = low[~final], middle[~final], high[~final]
        middle = divide(middle, x[~final], y[~final]) if divide else middle
        low, high = np.stack([low, middle], 1).ravel(), np.stack([middle, high], 1).ravel()
    lows, highs, cs, goods = (np.concatenate(part) for part in zip(*segments, strict=True))
    order = np.argsort(lows)
    ends = np.append(lows[order], highs[order][-1])
    return Series(ends, without_rounding(cs[order]), goods[order])


def panels(low: float, high: float, count: int) -> Floats:
    """Edges (count + 1,) of equal panels."""
    return np.linspace(low, high, count + 1)
