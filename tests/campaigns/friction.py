"""All solutions of friction equations against brute force: a script, not a test.

    python -m tests.campaigns.friction [--groups 250] [--starts 600] [--seed 1]

Random dyads by their balances (`tests.independent.dyads`) with friction arms up to 0.05, 0.3, 1
and 3 of the longest distance between pairs. Columns: groups by their number of solutions, groups
with c < 1, groups whose indices sum to something else than (c < 1), those that are not proved to
be complete, and groups in which the search by brute force finds more or fewer.
"""

from __future__ import annotations

import argparse

import numpy as np

from blockmech.friction import enumeration
from tests.friction.test_existence import existence_of
from tests.independent import dyads

ARMS = (0.05, 0.3, 1.0, 3.0)
KINDS = [*((kind, None) for kind in dyads.KINDS), ("RRP", 0.7), ("RPR", 0.7)]


def line(kind: str, length: float | None, arm: float, args: argparse.Namespace) -> str:
    """A row of the table."""
    n = args.groups
    chance = np.random.default_rng(args.seed)
    groups = dyads.random_groups(kind, n, arm, chance, length)
    result = enumeration.enumerated(groups.k, groups.base, groups.rows, groups.contacts)
    counts, total = np.bincount(result.system, minlength=n), np.zeros(n)
    np.add.at(total, result.system, result.signs)
    below = existence_of(groups) < 1
    judged = [
        len(x)
        for i in range(0, n, 25)
        for x in dyads.brute_force(groups.of(slice(i, i + 25)), args.starts, chance)
    ]
    by = " / ".join(map(str, np.bincount(counts, minlength=5)))
    wrong, surplus = int(((total == 1) != below).sum()), int((judged > counts).sum())
    fewer, open_ = int((judged < counts).sum()), int((~result.complete).sum())
    name = f"{kind}{'' if length is None else f', guide {length} m'}"
    counted = f"{below.sum():>6} {wrong:>7} {open_:>6} {surplus:>5} {fewer:>6}"
    return f"{name:<18} {arm:>5} {by:>24} {counted}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--groups", type=int, default=250)
    parser.add_argument("--starts", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    print(f"{'group':<18} {'arm':>5} {'0 / 1 / 2 / 3 / 4':>24}  c < 1 index !=  open  more  fewer")
    for kind, length in KINDS:
        for arm in ARMS:
            print(line(kind, length, arm, args), flush=True)


if __name__ == "__main__":
    main()
