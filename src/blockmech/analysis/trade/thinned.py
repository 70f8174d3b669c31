"""Some samples in place of all, where all would cost too much."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from blockmech.samples import Samples


def thinned(taken: Samples, count: int) -> tuple[Samples, NDArray[np.intp]]:
    """At most so many samples, equally spread and ends included, and their numbers (m,)."""
    if taken.n <= count:
        return taken, np.arange(taken.n)
    index = np.unique(np.linspace(0, taken.n - 1, count).round().astype(np.intp))
    inputs = {k: np.ascontiguousarray(np.asarray(v)[index]) for k, v in taken.inputs.items()}
    times = None if taken.times is None else taken.times[index]
    return Samples(len(index), inputs, times, taken.clock), index
