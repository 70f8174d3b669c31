"""Arrays and primitives that count what is done with them, in the weights' time.

A tally is per sample: an operation on half of the samples counts half.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.cost.weights import CONTINUED, ENTRY, ONE, WEIGHTS, solving, spreading
from blockmech.engines import linear
from blockmech.engines.numpy import Planar, primitives

if TYPE_CHECKING:
    from blockmech.passes.following import Path

TIMED = (64, 576)  # samples on which the following of a group is timed, few and many
ROUNDS = 3  # the best of so many


class Tally:
    """What a line of a program did: operations and their time for a sample."""

    def __init__(self) -> None:
        self.operations: dict[str, float] = {}
        self.other = 0.0  # [ns] what is no operation on a whole array

    def count(self, name: str, share: float = 1.0) -> None:
        """Count an operation on a share of the samples."""
        self.operations[name] = self.operations.get(name, 0.0) + share

    @property
    def number(self) -> float:
        """Operations on arrays."""
        return sum(self.operations.values())

    @property
    def time(self) -> float:
        """[ns] a sample."""
        weighed = sum(WEIGHTS.get(name, ONE) * k for name, k in self.operations.items())
        return self.other + weighed


class Counted(np.ndarray[Any, Any]):
    """An array that counts the operations done to it and to what comes of it."""

    tally = Tally()

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **more: Any) -> Any:
        found = getattr(ufunc, method)(*map(plain, inputs), **more)
        self.tally.count(ufunc.__name__)
        return counted(found)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        found = func(*map(plain, args), **kwargs)
        if func.__name__ in ("where", "searchsorted"):
            self.tally.count(func.__name__)
        return counted(found)

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, np.ndarray):
            self.tally.count("take")
        return counted(plain(self)[plain(key)])


def plain(x: Any) -> Any:
    """A value without counting: arrays, planar vectors, tuples of them."""
    if isinstance(x, Counted):
        return x.view(np.ndarray)
    if isinstance(x, Planar):
        return Planar(plain(x.real), plain(x.imag))
    if isinstance(x, tuple | list):
        parts = [plain(y) for y in x]
        return type(x)(*parts) if hasattr(x, "_fields") else type(x)(parts)
    return x


def counted(x: Any) -> Any:
    """A value whose arrays count; so do those of a tuple, which is a table or a solution."""
    if isinstance(x, tuple):
        parts = [counted(y) for y in x]
        return type(x)(*parts) if hasattr(x, "_fields") else tuple(parts)
    return x.view(Counted) if isinstance(x, np.ndarray) and x.ndim else x


def counting_primitives(dtype: Any) -> dict[str, Any]:
    """The NumPy engine's primitives, counting also where they leave whole arrays."""
    own = primitives(dtype)

    def note(nanoseconds: float) -> None:
        Counted.tally.other += nanoseconds

    def expi(t: Any) -> Planar:
        return Planar(np.cos(t), np.sin(t))  # the engine's own makes plain arrays

    def planar(x: Any, y: Any) -> Planar:
        return Planar(counted(np.asarray(plain(x))), counted(np.asarray(plain(y))))

    def matrix(rows: Any) -> Any:
        note(ENTRY * sum(not isinstance(x, float) for row in rows for x in row))
        return counted(own["matrix"](plain(rows)))

    def solve(a: Any, right: Any) -> Any:
        note(solving(len(right)) + 2 * ENTRY * len(right))
        return counted(linear.solve(plain(a), plain(right)))

    def solve_transposed(a: Any, right: Any) -> Any:
        return solve(np.swapaxes(plain(a), -1, -2), right)

    def spread(a: Any) -> Any:
        note(spreading(np.shape(a)[-1]))
        return counted(linear.spread(plain(a)))

    def repair(condition: Any, one: Any, given: Any, *data: Any) -> Any:
        mask = np.atleast_1d(plain(condition))
        note(CONTINUED * float(np.mean(mask)))
        return counted(own["repair"](mask, one, plain(given), *plain(data)))

    return own | {
        "expi": expi,
        "planar": planar,
        "matrix": matrix,
        "solve": solve,
        "solve_transposed": solve_transposed,
        "spread": spread,
        "repair": repair,
    }


class CountingPath:
    """The following of a group, which is timed: its steps depend on where the samples are.

    The time is told in that of singular values, of which the most of it is made, so that
    the speed of the machine at hand drops out; what a call costs whatever its samples, too.
    """

    def __init__(self, path: Path) -> None:
        self.__name__ = path.__name__
        self._path = path
        self._time = 0.0  # [ns] a sample; 0 before it is taken

    def __call__(self, q: Any) -> Any:
        found = self._path(plain(q))  # lays knots
        self._time = self._time or self._timed(plain(q))
        Counted.tally.other += self._time
        return counted(found)

    def _timed(self, q: tuple[Any, ...]) -> float:
        path, order = self._path, 3 * self._path.own
        few, many = (tuple(np.interp(_share(n), _share(len(x)), x) for x in q) for n in TIMED)
        own = _seconds(lambda: path(many)) - _seconds(lambda: path(few))
        J = np.random.default_rng(0).normal(size=(TIMED[1] - TIMED[0], order, order))
        values = _seconds(lambda: np.linalg.svd(J, compute_uv=False))
        return spreading(order) * max(own, values) / values


def _share(n: int) -> Any:
    return np.linspace(0.0, 1.0, n)


def _seconds(run: Callable[[], Any]) -> float:
    """The least processor time of some runs."""
    best = np.inf
    for _ in range(ROUNDS):
        start = time.process_time()
        run()
        best = min(best, time.process_time() - start)
    return float(best)


def counting(functions: Mapping[str, Any], kept: dict[Any, CountingPath]) -> dict[str, Any]:
    """Functions of a program, those that follow groups exchanged for ones that count."""
    from blockmech.passes.following import Path  # few mechanisms need it

    def exchanged(f: Any) -> Any:
        if not isinstance(f, Path):
            return f
        return kept.setdefault(f, CountingPath(f))

    return {name: exchanged(f) for name, f in functions.items()}
