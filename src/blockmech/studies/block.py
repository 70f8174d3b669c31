"""What a study keeps of some designs: their numbers, and why one has no answer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


class Block(NamedTuple):
    """What a study keeps of m designs.

    values : column's label -> (m,), or (m, n) of poses
    word : (m,) index in `blockmech.quality.WORDS`: why a design has no answer, 0 if it has
    place : (m,) the block of the mechanism that fails first
    pose : (m,) the first pose without an answer, -1 without one
    poses : (m,) number of such poses
    """

    values: dict[str, Array]
    word: Array
    place: Array
    pose: Array
    poses: Array

    @staticmethod
    def joined(blocks: list[Block]) -> Block:
        """All their designs, one after the other."""
        labels = blocks[0].values
        values = {label: np.concatenate([b.values[label] for b in blocks]) for label in labels}
        rest = zip(*(b[1:] for b in blocks), strict=True)
        return Block(values, *map(np.concatenate, rest))


class Rows(NamedTuple):
    """Designs at hand: address -> values (m,), and what was kept of them."""

    vary: Mapping[str, Array]
    found: Block
