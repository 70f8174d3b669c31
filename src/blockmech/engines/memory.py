"""Memory of batches, used again: first writing to new pages took longer than computing.

A system hands out new pages one by one and zeroed; on a busy machine that made requests
of many columns several times dearer. So freed memory is kept for the next batch: as long
as any array looks at a block, nobody else gets it. What is kept is given up where the
machine has no other memory left.
"""

from __future__ import annotations

import math
import os
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

HEAP = 31 * 2**20  # [bytes] glibc keeps smaller blocks by itself, once it has learnt to
MOST = 2**30  # [bytes] in larger blocks that are kept
SHARE = 1 / 16  # of the machine's memory that is kept at most, where it is small
FITS = 0.7  # share of a kept block that is needed, at least, to take it

_KEPT: dict[int, NDArray[np.uint8]] = {}
"""Larger blocks that no array uses, by identity, the last freed at the end."""


@cache
def keep_freed_memory() -> None:
    """Have the C library hand out freed memory again instead of giving it back.

    glibc gives back what is larger than the largest block that was freed so far. This one
    is never written to; other libraries take no notice.
    """
    with suppress(MemoryError):
        np.empty(HEAP, np.uint8)


@cache
def most_kept() -> int:
    """Bytes that are kept at most on this machine."""
    try:
        whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):  # not a POSIX system
        return MOST
    return min(MOST, int(SHARE * whole)) if whole > 0 else MOST


def room(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """An array to be filled, in one block, so that NumPy asks for large pages."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size <= HEAP:
        return np.empty(shape, dtype)
    block: NDArray[np.uint8] = np.asarray(_Block(_taken(size), most_kept()))
    found: NDArray[Any] = block[:size].view(dtype).reshape(shape)
    return found


class _Block:
    """Memory that is kept for others when the last array on it has gone."""

    def __init__(self, memory: NDArray[np.uint8], most: int) -> None:
        self._memory, self._most = memory, most
        self.__array_interface__ = memory.__array_interface__

    # Bound names are still there while the interpreter ends.
    def __del__(self, kept: Any = _KEPT) -> None:
        if self._memory.nbytes > self._most:
            return  # alone too much: others need not make room for it
        kept[id(self._memory)] = self._memory
        while kept and sum(block.nbytes for block in kept.copy().values()) > self._most:
            kept.pop(next(iter(kept.copy()), 0), None)


# The collector of garbage and other threads may free blocks at any time: what is looked
# through is a copy, which a dict makes in one go.


def _taken(size: int) -> NDArray[np.uint8]:
    """A kept block that is large enough but not much too large, or a new one."""
    fitting = [k for k, b in _KEPT.copy().items() if FITS * b.nbytes <= size <= b.nbytes]
    for key in reversed(fitting):
        found = _KEPT.pop(key, None)  # another thread may have been faster
        if found is not None:
            return found
    try:
        return np.empty(size, np.uint8)
    except MemoryError:
        _KEPT.clear()
        return np.empty(size, np.uint8)
