"""What acts at starts from rest and at rests, in machines of the gallery and at random: a script.

    python -m tests.campaigns.rests [--cases 100] [--first 0]

Each machine is released at rest, where its scene starts or anywhere, with and without dry joints,
and moves for a while. At the start, at all standstills and rests and at the end `verify` must find
that drives of free drivers are idle, that forces balance, that friction obeys its laws and that
energy is what was worked. A line is a machine of which that is not so.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

import numpy as np

import blockmech as bm
from blockmech.ground.errors import BlockmechError
from blockmech.testing.strategies import Options, Seeded, random_mechanism
from tests.dynamics.honesty import GRAPHS, RUNS, mechanism

SPAN = 0.4  # [s]
REST = ("standstill", "rest", "sticking")


def machines(count: int, first: int) -> Iterator[tuple[str, Any, dict[str, Any]]]:
    """Name, mechanism and start of each."""
    if not first:
        for name, (_, runs) in RUNS.items():
            mech = mechanism(name)
            for run in runs:
                yield name, mech, {mech.drivers[0]: (run.q, 0.0)}
        for path in sorted((GRAPHS / "motions").glob("*.json")):
            mech = bm.Graph.load(path).compile()
            yield path.stem, mech, {d: (x.q, 0.0) for d, x in mech.scene.initial.items()}
    for seed in range(first, first + count):
        options = Options(drivers=(1, 2), groups=(1, 3), friction=seed % 3 > 0)
        case = random_mechanism(Seeded(seed), options)
        at = {d: (float(np.ravel(q)[0]), 0.0) for d, q in case.request["at"].items()}
        yield f"random {seed}", case.graph.compile(), at


def wrong(mech: Any, start: dict[str, Any]) -> str:
    """What does not hold at the start and the rests of a motion; empty where all does."""
    until = {"until": f"time={SPAN!r}", "start": start, "accuracy": 1e-9, "budget": 10}
    motion = mech.simulate(want=(), **until).motion
    rests = [e.t for e in motion.events if e.kind.startswith(REST)]
    times = np.unique([0.0, *rests[:20], motion.t_end])
    result = mech.simulate(times=times, want="*", **until)
    report = mech.verify(result)
    return "" if report.ok else f"{len(rests)} rests | {report}"


def main() -> None:
    """Run the cases."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    looked_at = 0
    for name, mech, start in machines(options.cases, options.first):
        try:
            fault = wrong(mech, start)
        except BlockmechError as error:
            print(name, "refused:", str(error)[:120], flush=True)
            continue
        looked_at += 1
        if fault:
            print(name, start, fault, flush=True)
    print(f"{looked_at} machines")


if __name__ == "__main__":
    main()
