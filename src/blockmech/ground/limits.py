"""Limits of what is read, compared and searched, so that any file is answered soon.

A second or two of an ordinary computer, or its memory, is what each of them costs at most.
"""

from __future__ import annotations

import sys

LARGEST = 10_000_000  # bytes of a drawing, or of machine code
DEEPEST = 100  # objects, lists or elements in each other; a graph needs nine
MOST = 100_000  # elements of a file, or branches of an answer with all their outputs
COMPARED = 1000  # links, pins or names that are compared with each other
SOLVED = 60  # links or joints whose velocity conditions are solved: for each mobility 10 ms
CHECKED = 24  # poses of a check, by which a fault at one in four is missed once in a thousand
SEARCHED = 24  # groups, or slips of units, that are tried to say more: up to 50 ms each


def read_integer(digits: str) -> int | float:
    """A whole number of JSON; one of more digits than any float is a float as well, infinite."""
    return int(digits) if len(digits) <= sys.float_info.max_10_exp else float(digits)
