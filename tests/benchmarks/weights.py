"""What array operations cost: the weights of the cost model, measured one by one.

``python -m tests.benchmarks.weights`` prints them beside those of `blockmech.cost`. Each
operation works on chunks as the NumPy engine's programs do: 32 arrays of a chunk are in use,
so what it reads was left by something else. Processor time, the best of many repeats.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from blockmech.cost import weights as cost
from blockmech.engines.numpy import CHUNK

LIVE = cost.LIVE  # arrays in use
CALLS = 160  # of an operation in a row
REPEATS = 12
FEW, MANY = 20, 123  # columns in memory that is used again, and in new memory
ORDERS, STACK = (6, 12, 21), 512  # of matrices, and how many of them

LINE = [np.linspace(0.1, 2.0, CHUNK) + i for i in range(LIVE)]
MASKS = [x > x.mean() for x in LINE]  # as conditions are: true in a row, then false
KNOTS = np.linspace(0.0, 40.0, 25)  # of a table of some length
PLACES = np.searchsorted(KNOTS, LINE[0], side="right")
OPERATIONS: dict[str, tuple[Callable[..., Any], int, bool]] = {  # function, numbers, masks first
    "add": (np.add, 2, False),
    "multiply": (np.multiply, 2, False),
    "maximum": (np.maximum, 2, False),
    "divide": (np.divide, 2, False),
    "negative": (np.negative, 1, False),
    "absolute": (np.absolute, 1, False),
    "greater": (np.greater, 2, False),
    "sqrt": (np.sqrt, 1, False),
    "sin": (np.sin, 1, False),
    "cos": (np.cos, 1, False),
    "arctan2": (np.arctan2, 2, False),
    "fmod": (np.fmod, 2, False),
    "where": (np.where, 2, True),
    "sign": (np.sign, 1, False),
    "searchsorted": (lambda x: np.searchsorted(KNOTS, x, side="right"), 1, False),
    "take": (lambda x: KNOTS[PLACES], 1, False),
}


def weight(name: str) -> float:
    """Processor time [ns] of an operation for an element of a chunk."""
    function, numbers, masked = OPERATIONS[name]
    best = np.inf
    for _ in range(REPEATS):
        live = [x.copy() for x in LINE]
        start = time.process_time()
        for k in range(CALLS):
            args: list[Any] = [live[(k + 11 * i) % LIVE] for i in range(numbers)]
            if masked:
                args.insert(0, MASKS[k % LIVE])
            found = function(*args)
            if found.dtype == float:  # takes the place of an array that is used no more
                live[k % LIVE] = found
        best = min(best, time.process_time() - start)
    return 1e9 * best / CALLS / CHUNK


def column(columns: int) -> float:
    """Processor time [ns] of an element of one of so many columns of a result."""
    best = np.inf
    whole = cost.BATCH // CHUNK * CHUNK
    for _ in range(REPEATS):
        start = time.process_time()
        rooms = np.empty((columns, cost.BATCH))
        for first in range(0, whole, CHUNK):
            for i in range(columns):
                rooms[i, first : first + CHUNK] = LINE[i % LIVE]
        best = min(best, time.process_time() - start)
        del rooms
    return 1e9 * best / columns / whole


def matrices(run: Callable[[Any], Any], order: int) -> float:
    """Processor time [ns] of something done with each matrix of a stack."""
    stack = np.random.default_rng(0).normal(size=(STACK, order, order))
    best = np.inf
    for _ in range(REPEATS):
        start = time.process_time()
        run(stack)
        best = min(best, time.process_time() - start)
    return 1e9 * best / STACK


def rows() -> list[tuple[str, float, float]]:
    """What, weight of the model [ns], weight measured here [ns]."""
    with np.errstate(all="ignore"):
        found = [(name, cost.WEIGHTS.get(name, cost.ONE), weight(name)) for name in OPERATIONS]
    for columns, model in ((FEW, cost.COLUMN), (MANY, cost.COLUMN + cost.FRESH)):
        found.append((f"a column of {columns}", model, column(columns)))
    for order in ORDERS:
        ones = np.ones((STACK, order, 1))
        solved = matrices(lambda a, b=ones: np.linalg.solve(a, b), order)
        found.append((f"{order} equations, solved", cost.solving(order), solved))
        values = matrices(lambda a: np.linalg.svd(a, compute_uv=False), order)
        found.append((f"{order} singular values", cost.spreading(order), values))
    return found


if __name__ == "__main__":
    for what, model, here in rows():
        print(f"{what:<16} {model:5.2f} ns in the model, {here:5.2f} ns here")
