"""Derivatives of the whole gallery and of random mechanisms against differences in 60 digits.

Run with ``python -m tests.campaigns.derivatives [how many] [first seed]``: some minutes. Prints
the worst error of each, relative to the largest of the unit over the conditioning, and fails
above 1e-10. With a first seed the gallery is left out. Documents of links and joints, the
gallery's and as many by chance, are against differences of eighth order in double precision,
of the best of three steps: larger ones may pass a kink.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from typing import Any

import blockmech as bm
from blockmech.testing.strategies import EVERY, Options, Seeded, random_mechanism
from tests.engines.derivatives import errors, of_document
from tests.engines.test_derivatives import EXACT, request_of
from tests.gallery import GRAPHS, JOINTS, mechanism
from tests.proof.test_joint_documents import data_of

STEPS = (1e-4, 3e-5, 1e-5)  # of the numbers' sizes
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
        result = errors(mech, request or request_of(mech), seed=5, m=1)
        finite = [x for x in result if not math.isnan(x)]
        worst = max(finite, default=0.0)
        wrong += worst > EXACT
        print(f"{name:30s} {worst:.1e}, {len(finite)} values, {len(result) - len(finite)} at kinks")
        sys.stdout.flush()
    documents = list(documents_from(first, count))
    for name, linkage, request in documents:
        try:
            if linkage.run(**request, on_gap="mark").quality.status[0] in ("jammed", "self-locked"):
                request |= {"friction": "none"}  # with it nothing moves
            linkage.run(**request)
            worst = min(of_document(linkage, request, step) for step in STEPS)
        except (bm.GraphError, bm.AssemblyError) as error:  # too near a dead centre
            print(f"{name:30s} left out: {error.problems[0].code}")
            continue
        wrong += not worst <= EXACT
        print(f"{name:30s} {worst:.1e}")
        sys.stdout.flush()
    print(f"{wrong} of {len(cases) + len(documents)} above {EXACT:g}")
    return wrong


def documents_from(first: int, count: int) -> Iterator[tuple[str, bm.Linkage, dict[str, Any]]]:
    """Documents of the gallery and by chance, each with samples."""
    for path in sorted(JOINTS.glob("*.json")) if first < 0 else []:
        linkage = bm.Linkage.load(path)
        yield f"joints/{path.stem}", linkage, request_of(linkage.compile())
    for seed in range(max(first, 0), max(first, 0) + count):
        data = data_of(seed)
        linkage = bm.Linkage.from_data(data)
        at = {name: [start["q"] + 0.01] for name, start in data["initial"].items()}
        motion = {"rates": {x: [1.3] for x in at}, "accelerations": {x: [-0.7] for x in at}}
        yield f"random document {seed}", linkage, {"at": at, **motion}


if __name__ == "__main__":
    sys.exit(bool(main(*map(int, sys.argv[1:]))))
