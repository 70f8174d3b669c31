"""Ratio: any drivers, coupled by a law; the housing stands on both supports.

    q2 = phase + F(q1),   tau1 += F' tau2

What is inside is not looked at: a worm, a linkage, a chain of wheels, an electric shaft. Forces
are those of a black box: an effort on either pair, whose opposite its support takes.

Source: Dresig & Holzweissig, Dynamics of Machinery, 2010, sec. 2.4 (transmission functions).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction

from blockmech.couplings.contract import LossyCoupling, Meshing
from blockmech.couplings.laws import AnyLaw, LawNumbers
from blockmech.ground.values import Number, default
from blockmech.typing import Kernel


class Ratio(LossyCoupling, type="coupling.ratio"):
    """The driven coordinate as a function of the driver's, both as their drivers count them.

    law : "polynomial", "table" or "segments", see `blockmech.couplings.laws`
    phase : [rad or m] added to the value of the law

    >>> law = {"kind": "polynomial", "coefficients": [0.0, 0.5]}
    >>> Ratio(driver="crank", driven="wheel", law=law).phase
    0.0
    """

    meshes = False

    law: AnyLaw
    phase: Number = default(0.0)

    def transmission(self, pair: str) -> Kernel:
        """The law's kernel."""
        return self.law.kernel()

    def numbers(self, pair: str, at_zero: Callable[[], Meshing]) -> LawNumbers:
        """The law's numbers."""
        return self.law.numbers(self.phase)

    def knots(self, low: float, high: float) -> Iterable[float]:
        """The law's."""
        return self.law.within(low, high)

    def advance(self, turns: Fraction) -> Fraction | None:
        """As the law does."""
        return self.law.advance(turns)
