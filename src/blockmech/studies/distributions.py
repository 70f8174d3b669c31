"""Distributions of numbers, for tolerances and studies, and samples of them.

>>> import blockmech as bm
>>> bm.dist.Normal(mean=6.0, deviation=1e-4)
Normal(mean=6.0, deviation=0.0001)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from blockmech.ground.arguments import constructed
from blockmech.ground.errors import refused
from blockmech.ground.units import NoQuantity, in_si
from blockmech.ground.values import is_number
from blockmech.typing import Floats, Quantity

__all__ = ["Normal", "Sample", "Uniform"]
__dir__ = __all__.copy  # completion shows these alone


@constructed
@dataclass(frozen=True)
class Normal:
    """Normal distribution of a number: mean and standard deviation, in its unit.

    Raises `RequestError` for invalid numbers.

    >>> Normal("6 m", "0.1 mm").deviation
    0.0001
    """

    mean: float
    deviation: float

    if TYPE_CHECKING:

        def __init__(self, mean: Quantity, deviation: Quantity) -> None: ...

    def __post_init__(self) -> None:
        mean, deviation = _numbers_of(self)
        if not (is_number(mean) and is_number(deviation) and deviation > 0):
            found, remedy = f"({mean!r}, {deviation!r})", "give the mean and a deviation > 0"
            raise refused("Normal", found, remedy)

    def quantile(self, share: Floats) -> Floats:
        """Quantiles of the probabilities (n,)."""
        from scipy.special import ndtri

        return np.asarray(self.mean + self.deviation * ndtri(share))


@constructed
@dataclass(frozen=True)
class Uniform:
    """Uniform distribution of a number between two values, in its unit or as texts with one.

    Raises `RequestError` for invalid numbers.

    >>> Uniform(5.9, 6.1).mean
    6.0
    """

    low: float
    high: float

    if TYPE_CHECKING:

        def __init__(self, low: Quantity, high: Quantity) -> None: ...

    def __post_init__(self) -> None:
        low, high = _numbers_of(self)
        if not (is_number(low) and is_number(high) and low < high):
            remedy = "give the lowest and the highest value"
            raise refused("Uniform", f"({low!r}, {high!r})", remedy)

    def quantile(self, share: Floats) -> Floats:
        """Quantiles of the probabilities (n,)."""
        return np.asarray(self.low + (self.high - self.low) * share)

    @property
    def mean(self) -> float:
        """Expected value."""
        return (self.low + self.high) / 2

    @property
    def deviation(self) -> float:
        """Standard deviation, width / sqrt 12."""
        return (self.high - self.low) / math.sqrt(12.0)


Distribution: TypeAlias = Normal | Uniform
"""How a number scatters."""


def _numbers_of(law: Distribution) -> tuple[float, float]:
    """Both numbers in SI; ``texts`` stay, as it is an address that knows which unit fits."""
    stated = dict(vars(law))
    try:
        first, second = in_si(list(stated.values()))
    except NoQuantity as error:
        raise refused(type(law).__name__, error.found, "", error.valid) from None
    texts = [x for x in stated.values() if isinstance(x, str)]
    vars(law).update(zip(stated, (first, second), strict=True), texts=texts)
    return first, second


@dataclass(frozen=True)
class Sample:
    """Designs that a study draws from distributions.

    Parameters
    ----------
    count : number of designs; of "sobol" a power of two
    method : "latin" (hypercube, default), "sobol" (scrambled) or "random"
    seed : the same seed draws the same designs

    >>> Sample(64, "sobol").seed
    0
    """

    count: int
    method: Literal["latin", "sobol", "random"] = "latin"
    seed: int = 0
