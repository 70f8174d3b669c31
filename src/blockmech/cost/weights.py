"""What single array operations cost, measured one by one with NumPy 2.4.

``tests/benchmarks/weights.py`` measures them again on any machine. But for the last, which was
read off a four-bar whose friction jams, none is fitted to a mechanism, and none is of the
machine at hand: only ratios of what they add up to are used.
"""

from __future__ import annotations

import math

BATCH = 100_000  # samples of the batches that costs are meant for
TWO, ONE, TRUTH = 0.40, 0.31, 0.1  # [ns] a sum or a product; a sign or a comparison; an "and"
LIVE = 32
WEIGHTS = {  # [ns] an element of a chunk while LIVE arrays are in use; others cost ONE
    "add": TWO, "subtract": TWO, "multiply": TWO, "maximum": TWO, "minimum": TWO,
    "divide": 0.47, "sqrt": 1.3, "sin": 8.3, "cos": 8.3, "arctan2": 2.6, "fmod": 8.9,
    "where": 0.8, "sign": 0.7, "searchsorted": 5.0, "take": 0.85,
    "bitwise_and": TRUTH, "bitwise_or": TRUTH, "logical_or": TRUTH,
}  # fmt: skip
CROWD = 0.03  # [ns] more an operation for every doubling of the arrays in use: fewer are in cache
FEWEST = 8  # arrays below which they all are
COLUMN = 0.6  # [ns] an element of a column of the result, copied out of its chunk
FRESH = 0.7  # [ns] more for an element of a result too large to be kept: its pages are new
SAMPLES = 5.5  # [ns] a sample itself, measured where no kernel is called: its coordinates
DRIVER = 2.6  # [ns] more for each further driver
ENTRY = 1.6  # [ns] an entry of a matrix a sample, put in its place
SOLVE = 8.6  # [ns] N^2 of them solve N equations: a stack of small matrices
SPREAD, SPREAD_POWER = 217.0, 1.5  # [ns] times N to that power: singular values of N x N
CONTINUED = 5e6  # [ns] a sample whose friction is followed by continuation


def solving(n: int) -> float:
    """[ns] a solution of n linear equations, one of a stack."""
    return SOLVE * n * n


def spreading(n: int) -> float:
    """[ns] the singular values of an n x n matrix, one of a stack."""
    return SPREAD * math.pow(n, SPREAD_POWER)
