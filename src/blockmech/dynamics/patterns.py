r"""Sign patterns: how several linear functions can be positive, negative or zero at once.

Rows A (m, k) are functions A_j x of x in R^k. Their hyperplanes A_j x = 0 cut the space into cones;
each cone has one pattern, the signs (m,) of all functions in it. The patterns are far fewer than
3^m: with k = 2 there are 2m sectors, 2m rays and the origin.

Every cone but the lineality space has a ray in its closure, and the cones at a ray are those of the
functions that vanish on it. So the patterns follow from rays alone.

Sources: Björner et al., Oriented Matroids, 1999, ch. 2 (covectors of an arrangement).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from blockmech.dynamics.contacts import SETTLED
from blockmech.typing import Floats


def _unit(rows: Floats) -> Floats:
    """Rows of unit length; those of none stay."""
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(np.divide(rows, size, out=np.zeros_like(rows), where=size > 0))


def rays(rows: Floats) -> Iterator[Floats]:
    """Directions (k,) on which as many independent rows vanish as can, without vanishing all.

    Both senses of each; the rank r of the rows is that of r - 1 of them and one more.
    """
    rows = _unit(rows)
    _, size, basis = np.linalg.svd(rows, full_matrices=False)
    basis = basis[size > SETTLED * max(float(size[0]), 1.0)] if size.size else basis[:0]
    directions: list[Floats] = []
    for some in combinations(range(len(rows)), len(basis) - 1) if len(basis) else ():
        _, size, turned = np.linalg.svd(rows[list(some)] @ basis.T)
        if (size > SETTLED).sum() < len(basis) - 1:
            continue
        x = turned[-1] @ basis
        if all(abs(x @ y) < 1 - SETTLED for y in directions):
            directions.append(x)
            yield from (x, -x)


def signs(rows: Floats, x: Floats) -> tuple[int, ...]:
    """Signs (m,) of all rows on a unit vector; what is rounding is zero."""
    values = _unit(rows) @ x
    return tuple(int(s) for s in np.where(np.abs(values) <= SETTLED, 0, np.sign(values)))


def patterns(rows: Floats) -> set[tuple[int, ...]]:
    """All patterns (m,) of signs of linear functions A_j x.

    >>> import numpy as np
    >>> sorted(patterns(np.array([[1.0], [-2.0]])))
    [(-1, 1), (0, 0), (1, -1)]
    """
    covectors = {(0,) * len(rows)}
    for x in rays(rows):
        on_ray = signs(rows, x)
        zeros = [j for j, s in enumerate(on_ray) if s == 0]
        for part in patterns(rows[zeros]) if zeros else {()}:
            pattern = list(on_ray)
            for j, s in zip(zeros, part, strict=True):
                pattern[j] = s
            covectors.add(tuple(pattern))
    return covectors


def affine_patterns(rows: Floats, shift: Floats) -> set[tuple[int, ...]]:
    """All patterns of signs of A_j x + b_j; ``shift`` is b (m,)."""
    if not shift.any():
        return patterns(rows)
    size = np.abs(shift).max() / (np.abs(rows).max(initial=0.0) or 1.0)  # x of about one
    last = np.eye(1, rows.shape[1] + 1, rows.shape[1])
    homogeneous = patterns(np.vstack([np.column_stack([rows, shift / size]), last]))
    return {pattern[:-1] for pattern in homogeneous if pattern[-1] > 0}
