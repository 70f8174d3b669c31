"""Memory of large batches is used again, and only when nobody looks at it any more."""

from __future__ import annotations

import copy
import gc
import pickle
import subprocess
import sys
import threading

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


def kept() -> int:
    """Bytes that are kept now."""
    return sum(block.nbytes for block in memory._KEPT.values())


LOOKS = {
    "a row": lambda x: x[1],
    "a transposed view": lambda x: x.T,
    "other numbers of the same bytes": lambda x: x.view(np.int64),
    "a memory view": memoryview,
    "an iterator": lambda x: x.flat,
    "an array that NumPy made of its interface": lambda x: np.asarray(Interface(x)),
    "an exception that holds the frame": lambda x: held(x),
}


class Interface:
    """Something that another library would read memory of."""

    def __init__(self, x: np.ndarray) -> None:
        self.x, self.__array_interface__ = x, x.__array_interface__


def held(values: np.ndarray) -> BaseException:
    """What a run that failed leaves behind: its frame, and the arrays in it."""
    try:
        raise ValueError
    except ValueError as error:
        return error


@pytest.mark.parametrize("how", LOOKS)
def test_memory_is_nobody_elses_as_long_as_anything_looks_at_it(how: str) -> None:
    array = room(LARGE, np.float64)
    array[:] = 7.0
    place = address(array)
    look = LOOKS[how](array)
    del array
    gc.collect()
    other = room(LARGE, np.float64)
    assert address(other) != place
    del look, other
    gc.collect()
    assert place in {address(block) for block in memory._KEPT.values()}


def test_copies_and_pickles_stay_what_they_were() -> None:
    array = room((3, LARGE[1]), np.float64)
    array[:] = 7.0
    copies = [copy.deepcopy(array[:, :99]), copy.copy(array)[:, :99]]
    copies.append(pickle.loads(pickle.dumps(array[:, :99])))
    del array
    room(LARGE, np.float64)[:] = -1.0
    assert all(np.all(c == 7.0) for c in copies)


def test_threads_never_share_a_block() -> None:
    wrong: list[int] = []

    def work(mark: int) -> None:
        for k in range(25):
            array = room(LARGE, np.float64)
            ends = array[0, :64], array[2, -64:]
            for end in ends:
                end[:] = 100 * mark + k
            if any(np.any(end != 100 * mark + k) for end in ends):
                wrong.append(mark)
            if k % 3 == 0:
                cycle: list[object] = [array]
                cycle.append(cycle)  # only the collector of garbage frees it

    threads = [threading.Thread(target=work, args=(mark,)) for mark in range(4)]
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        for t in threads:
            t.start()
        for t in threads:
            t.join()
    finally:
        sys.setswitchinterval(before)
    gc.collect()
    assert not wrong
    assert kept() <= memory.most_kept()


def test_blocks_that_are_freed_while_one_is_looked_for_do_no_harm() -> None:
    class Freeing(dict[int, np.ndarray]):
        """What is kept, where the collector frees another block at every look."""

        def copy(self) -> dict[int, np.ndarray]:
            found = dict(self)
            self[-1 - len(self)] = np.empty(1, np.uint8)
            return found

    mine = Freeing()
    mine[1] = np.empty(HEAP + 8, np.uint8)
    was, memory._KEPT = memory._KEPT, mine
    try:
        assert memory._taken(HEAP + 8).nbytes == HEAP + 8
    finally:
        memory._KEPT = was
    assert 1 not in mine


def test_a_block_larger_than_all_that_may_be_kept_leaves_the_others() -> None:
    place = address(room(LARGE, np.float64))
    room((memory.most_kept() // 8 + 1,), np.float64)
    assert address(room(LARGE, np.float64)) == place


def alone(program: str) -> subprocess.CompletedProcess[str]:
    """A program in an interpreter of its own."""
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=120
    )


def test_the_interpreter_ends_in_silence_whatever_is_still_looked_at() -> None:
    done = alone(
        "import numpy as np\nfrom blockmech.engines.memory import HEAP, room\n"
        "global_one = room((HEAP,), np.float64)\nroom((HEAP,), np.float64)\n"
        "cycle = [room((HEAP,), np.float64)]; cycle.append(cycle); del cycle\n"
        "class Late:\n    def __del__(self): room((HEAP,), np.float64)\n"
        "late = Late()\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are told to Linux here")
def test_what_is_kept_is_given_up_where_there_is_no_other_memory() -> None:
    done = alone(
        "import resource, gc\nimport numpy as np\nfrom blockmech.engines import memory\n"
        "from blockmech.engines.memory import HEAP, room\n"
        "room((4 * HEAP,), np.uint8); assert memory._KEPT\n"
        "used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (used + 2 * HEAP, -1))\n"
        "x = room((5 * HEAP,), np.uint8); x[:] = 1\nassert not memory._KEPT\n"
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_small_machine_keeps_a_small_share(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory.os, "sysconf", {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 2**18}.get,
                        raising=False)  # fmt: skip
    assert memory.most_kept.__wrapped__() == 2**30 // 16
    monkeypatch.delattr(memory.os, "sysconf")
    assert memory.most_kept.__wrapped__() == memory.MOST


def test_a_block_is_not_taken_for_much_less_nor_for_more() -> None:
    place = address(room(LARGE, np.float64))
    more = room((4, LARGE[1]), np.float64)
    less = room((2, LARGE[1]), np.float64)
    assert place not in (address(more), address(less))
    assert address(room(LARGE, np.float64)) == place


def test_no_more_is_kept_than_said() -> None:
    size = 8 * LARGE[0] * LARGE[1]
    rows = [
        room(LARGE, np.float64) for _ in range(memory.most_kept() // size + 3)
    ]  # never written to
    del rows
    assert memory.most_kept() - size <= kept() <= memory.most_kept()


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


def test_a_result_that_is_read_late_or_in_part_is_still_its_own() -> None:
    mech = ruiz().compile()
    q = np.linspace(0.0, 6.0, 60_000)
    first = mech.run(at=q)  # nothing of it is read yet
    for _ in range(2):
        mech.run(at=q + 1.0)
    alone = mech.run(at=q[:100])
    for name in ("crank.drive", "dyad.B.reaction", "dyad.C.p"):
        assert np.array_equal(first[name][:100], alone[name])
