"""Memory of large batches is used again, and only when nobody looks at it any more."""

from __future__ import annotations

import gc

import numpy as np
import pytest

from blockmech.engines import memory
from blockmech.engines.memory import HEAP, room
from tests.wiring import ruiz

LARGE = (3, HEAP // 12)  # numbers; in bytes more than the C library keeps by itself


@pytest.fixture(autouse=True)
def nothing_kept() -> None:
    gc.collect()
    memory._KEPT.clear()


def address(x: np.ndarray) -> int:
    return int(x.__array_interface__["data"][0])


def test_memory_of_a_large_array_is_used_again_once_it_is_free() -> None:
    first = room(LARGE, np.float64)
    place = address(first)
    row = first[1]
    del first
    assert address(room(LARGE, np.float64)) != place  # a row of it is still looked at
    row[:] = 1.0
    del row
    assert address(room(LARGE, np.float64)) == place


def test_a_block_is_not_taken_for_much_less_nor_for_more() -> None:
    place = address(room(LARGE, np.float64))
    more = room((4, LARGE[1]), np.float64)
    less = room((2, LARGE[1]), np.float64)
    assert place not in (address(more), address(less))
    assert address(room(LARGE, np.float64)) == place


def test_no_more_is_kept_than_said() -> None:
    size = 8 * LARGE[0] * LARGE[1]
    rows = [room(LARGE, np.float64) for _ in range(memory.MOST // size + 3)]  # never written to
    del rows
    assert memory.MOST - size <= sum(b.nbytes for b in memory._KEPT.values()) <= memory.MOST


def test_small_arrays_are_left_to_the_c_library() -> None:
    small = room((2, 3), np.float32)
    assert (small.shape, small.dtype) == ((2, 3), np.float32)
    del small
    assert not memory._KEPT


def test_results_of_large_batches_do_not_share_memory() -> None:
    mech = ruiz().compile()
    q = np.linspace(0.0, 6.0, 60_000)
    first = mech.run(at=q)
    drive = first["crank.drive"].copy()
    second = mech.run(at=q + 1.0)
    assert np.array_equal(first["crank.drive"], drive)
    del first, second
    again = mech.run(at=q)
    assert np.array_equal(again["crank.drive"], drive)
