"""Derivatives of the whole gallery and of random mechanisms against differences in 60 digits.

Run with ``python -m tests.campaigns.derivatives [how many] [first seed]``: some minutes. Prints
the worst error of each, relative to the largest of the unit over the conditioning, and fails
above 1e-10. With a first seed the gallery is left out.
"""

from __future__ import annotations

import math
import sys

from blockmech.testing.strategies import EVERY, Options, Seeded, random_mechanism
from tests.engines.derivatives import errors
from tests.engines.test_derivatives import EXACT, request_of
from tests.gallery import GRAPHS, mechanism

OPTIONS = Options(groups=(1, 3), kinds=EVERY, twists=True)


def main(count: int = 200, first: int = -1) -> int:
    """Number of mechanisms with a derivative that is wrong."""
    files = sorted(GRAPHS.glob("*.json")) if first < 0 else []
    cases = [(p.stem, mechanism(p.stem), None) for p in files]
    for seed in range(max(first, 0), max(first, 0) + count):
        case = random_mechanism(Seeded(seed), OPTIONS)
        cases.append((f"random {seed}", case.graph.compile(), case.request))
    wrong = 0
    for name, mech, request in cases:
        found = errors(mech, request or request_of(mech), seed=5, m=1)
        known = [x for x in found if not math.isnan(x)]
        worst = max(known, default=0.0)
        wrong += worst > EXACT
        print(f"{name:30s} {worst:.1e}, {len(known)} values, {len(found) - len(known)} at kinks")
        sys.stdout.flush()
    print(f"{wrong} of {len(cases)} above {EXACT:g}")
    return wrong


if __name__ == "__main__":
    sys.exit(bool(main(*map(int, sys.argv[1:]))))
