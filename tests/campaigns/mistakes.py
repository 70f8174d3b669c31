"""Random mechanisms that `verify` must find nothing wrong with: a script, not a test.

    python -m tests.campaigns.mistakes [--seeds 500] [--first 0]

The mechanisms are those of tests/mutations, which holds a part of them in the suite.
"""

from __future__ import annotations

import argparse

from blockmech.testing.strategies import Seeded, random_mechanism
from tests.mutations.test_mutations import ALL


def main() -> None:
    """Verify each, and say which do not pass and how near the others come."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=500)
    parser.add_argument("--first", type=int, default=0)
    asked = parser.parse_args()
    worst, wrong = 0.0, 0
    for seed in range(asked.first, asked.first + asked.seeds):
        case = random_mechanism(Seeded(seed), ALL)
        mechanism = case.graph.compile()
        found = mechanism.verify(**case.request)
        if found.samples == 0:
            found = mechanism.verify(**case.request, friction="none")
        if not found.ok:
            wrong += 1
            print(f"seed {seed}:\n{found}")
        worst = max(worst, *(row.value for row in found.rows))
    print(f"{asked.seeds} mechanisms, {wrong} that do not pass; largest error {worst:.1e}")


if __name__ == "__main__":
    main()
