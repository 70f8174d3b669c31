"""Integrals of rates over stretches of time, and how far values gape from them.

By Lobatto's rule, so that what happens at an instant is seen by the node beside it. Where a rate is
no smooth function over a stretch its last Legendre coefficients do not die out: of jumps, kinks and
pulses their sum is at least four times what the rule is off by (tried at 20,000 places of each).

Source: Abramowitz & Stegun, Handbook of Mathematical Functions, 1964, 25.4.32.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import Legendre, legvander

from blockmech.functions.series import NODES as OF_PANEL
from blockmech.ground.plane import EPS
from blockmech.typing import Array

NODES = OF_PANEL // 2  # of a stretch: exact for degree 29
LAST = NODES // 4  # coefficients that tell what is left of a rate
TERM = 1024 * EPS  # of each term of a quadrature and of a dense output
TINY = float(np.finfo(np.float64).tiny)

TOP = Legendre.basis(NODES - 1)
PLACES = np.concatenate([[-1.0], np.sort(TOP.deriv().roots().real), [1.0]])
WEIGHTS = 2 / (NODES * (NODES - 1) * TOP(PLACES) ** 2)
COEFFICIENTS = WEIGHTS[:, None] * legvander(PLACES, NODES - 1) * (np.arange(NODES) + 0.5)


@dataclass(frozen=True)
class Stretches:
    """Stretches of time (m,), each from ``begin`` to ``end`` [s]."""

    begin: Array
    end: Array

    @classmethod
    def between(cls, begin: float, end: float, kinks: Iterable[float], n: int) -> Stretches:
        """Stretches (n,) over a range, each cut off at the kinks beside its middle."""
        edges, half = np.unique([begin, *kinks, end]), (end - begin) / (2 * n)
        middle = begin + (end - begin) * (np.arange(n) + 0.4) / n
        i = np.searchsorted(edges, middle, "right").clip(1, len(edges) - 1)
        return cls(np.maximum(middle - half, edges[i - 1]), np.minimum(middle + half, edges[i]))

    @cached_property
    def length(self) -> Array:
        """[s]."""
        return np.asarray(self.end - self.begin)

    @cached_property
    def nodes(self) -> Array:
        """Times (m, NODES) [s]; the first and last are within the stretch."""
        t: Array = self.begin[:, None] + self.length[:, None] * (1 + PLACES) / 2
        t[:, 0], t[:, -1] = np.nextafter(self.begin, np.inf), np.nextafter(self.end, -np.inf)
        return t

    def size(self, value: Array, rate: Array) -> Array:
        """What a value (m,) is made of: itself, and what its rate makes of a time's rounding."""
        t = np.maximum(np.abs(self.begin), np.abs(self.end))
        return np.asarray(np.abs(value).max(initial=TINY) + np.abs(rate).max(initial=0.0) * t)

    def gap(self, value: Array, rate: Array) -> Array:
        """By how much values (m, NODES) change beside the integral of rates (m,).

        What the quadrature may be off by is left out.
        """
        unsure = np.abs(rate @ COEFFICIENTS[:, -LAST:]).sum(axis=1) * self.length / 2
        change = rate @ WEIGHTS * self.length / 2
        return np.asarray(np.maximum(np.abs(value[:, -1] - value[:, 0] - change) - unsure, 0.0))

    def worst(self, value: Array, rate: Array, size: Array, share: Array) -> tuple[float, float]:
        """The worst gap relative to a size (m,), and the share (m,) of it that is allowed there."""
        error, allowed = self.gap(value, rate) / size, share + TERM
        i = int(np.argmax(error / allowed))
        return float(error[i]), float(allowed[i])
