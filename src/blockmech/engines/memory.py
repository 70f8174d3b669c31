"""Memory of batches, used again: first writing to new pages took longer than computing.

A system hands out new pages one by one and zeroed; on a busy machine that made requests
of many columns several times dearer. So freed memory is kept for the next batch.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

HEAP = 31 * 2**20  # [bytes] glibc keeps smaller blocks by itself, once it has learnt to
MOST = 512 * 2**20  # [bytes] in larger blocks that are kept
FITS = 0.7  # share of a kept block that is needed, at least, to take it

_KEPT: dict[int, NDArray[np.uint8]] = {}
"""Larger blocks that no array uses, by identity, the last freed at the end."""


@cache
def keep_freed_memory() -> None:
    """Have the C library hand out freed memory again instead of giving it back.

    glibc gives back what is larger than the largest block that was freed so far. This one
    is never written to; other libraries take no notice.
    """
    np.empty(HEAP, np.uint8)


def room(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """An array to be filled, in one block, so that NumPy asks for large pages."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size <= HEAP:
        return np.empty(shape, dtype)
    block: NDArray[np.uint8] = np.asarray(_Block(_taken(size)))
    found: NDArray[Any] = block[:size].view(dtype).reshape(shape)
    return found


class _Block:
    """Memory that is kept for others when the last array on it has gone."""

    def __init__(self, memory: NDArray[np.uint8]) -> None:
        self._memory = memory
        self.__array_interface__ = memory.__array_interface__

    # Bound names are still there while the interpreter ends.
    def __del__(self, kept: Any = _KEPT, most: int = MOST) -> None:
        kept[id(self._memory)] = self._memory
        while kept and sum(block.nbytes for block in list(kept.values())) > most:
            kept.pop(next(iter(list(kept)), 0), None)


def _taken(size: int) -> NDArray[np.uint8]:
    """A kept block that is large enough but not much too large, or a new one."""
    for key, block in reversed(list(_KEPT.items())):
        if FITS * block.nbytes <= size <= block.nbytes:
            found = _KEPT.pop(key, None)  # another thread may have been faster
            if found is not None:
                return found
    return np.empty(size, np.uint8)
