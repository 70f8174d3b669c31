"""What `explain` predicts against what is measured, on batches of 1e5.

Every graph of the gallery that has a law of motion, and random mechanisms; the model's weights
come from single array operations (`weights.py`) and, but for the one of samples that need
continuation (read off ruiz_fourbar with larger pins), were fitted to none of them. Processor
time, all requests of a mechanism in turn, the best of several rounds of each: what is left of
the machine's other work after that is a few per cent.
"""

from __future__ import annotations

import fnmatch
import gc
import math
import os
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import blockmech as bm
from blockmech.cost import price
from blockmech.cost.weights import BATCH
from blockmech.mechanism import Mechanism
from blockmech.testing.strategies import KINDS, Options, Seeded, random_mechanism

from .results import SAVINGS, WEIGHTS, Saving

GRAPHS = Path(__file__).parents[2] / "graphs"
WITHIN = 1.5  # what `explain` promises of a saving
FOLLOWED = 2_000  # samples of a general group: a hundred times dearer, and each alike
ROUNDS, MOST_ROUNDS = 2, 10  # more of them where the machine was busy
LONGEST = 16.0  # [s] processor time for one mechanism, if two rounds take no longer
REQUESTS = (
    ("*.p",),
    ("*.p", "*.v"),
    ("*.p", "*.v", "*.a", "*.omega", "*.alpha"),
    ("*.reaction",),
    ("*.drive",),
    ("*.J_red", "*.tau_red"),
)
SEEDS = (1, 2, 3, 4, 6, 7, 8, 9)  # 5 jams, which takes 12 ms a sample to find
RANDOM = Options(kinds=KINDS, groups=(1, 4), drivers=(1, 1))


class Asked(NamedTuple):
    """One request of a mechanism."""

    want: tuple[str, ...]
    friction: str

    @property
    def words(self) -> str:
        return ", ".join(self.want) + (", without friction" if self.friction == "none" else "")


WHOLE = Asked(("*",), "newton")


def from_gallery(name: str) -> tuple[Mechanism, dict[str, Any]]:
    mech = bm.Graph.load(GRAPHS / f"{name}.json").compile()
    followed = any(block.own_form for block in mech.structure.blocks.values())
    return mech, {"samples": FOLLOWED if followed else BATCH}


def at_random(seed: int) -> tuple[Mechanism, dict[str, Any]]:
    """A random mechanism near the pose in which it is sure to close, and a sweep of it."""
    case = random_mechanism(Seeded(seed), RANDOM)
    ((driver, q),) = case.request["at"].items()
    rate = float(np.ravel(case.request["rates"][driver])[0])
    case.graph.start(driver, float(np.ravel(q)[0]), rate)
    near = float(np.ravel(q)[0]) + np.linspace(0.0, 1e-3, BATCH)
    request = {"at": {driver: near}, "rates": {driver: rate}}
    return case.graph.compile(), request


def cases() -> list[Any]:
    """Everything that a law moves, by name; random mechanisms by seed."""
    driven = []
    for path in sorted(GRAPHS.glob("*.json")):
        mech = bm.Graph.load(path).compile()
        if all(d in mech.scene.drive for d in mech.drivers):
            driven.append(pytest.param(from_gallery, path.stem, id=path.stem))
    return driven + [pytest.param(at_random, seed, id=f"random {seed}") for seed in SEEDS]


def requests(mech: Mechanism) -> list[Asked]:
    """What can be asked of it in place of everything."""
    found = []
    for friction in ("newton", "none") if mech.frictional_joints else ("newton",):
        for want in REQUESTS:
            there = tuple(w for w in want if fnmatch.filter(mech.outputs, w))
            if there:
                found.append(Asked(there, friction))
    return found


def seconds(mech: Mechanism, request: dict[str, Any], asked: Asked) -> float:
    """Processor time [s] of one run."""
    gc.collect()
    start = time.process_time()
    mech.run(**request, want=asked.want, friction=asked.friction, on_gap="mark")
    return time.process_time() - start


@pytest.mark.parametrize(("make", "which"), cases())
def test_savings_of_asking_for_less(make, which) -> None:
    mech, request = make(which)
    name = which if make is from_gallery else f"random {which}"
    rows = requests(mech)
    predicted = {r: price(mech, mech.plan(r.want, friction=r.friction)) for r in (WHOLE, *rows)}
    best = dict.fromkeys(predicted, math.inf)

    def quotient(r: Asked) -> float:
        return predicted[WHOLE] / predicted[r] * best[r] / best[WHOLE]

    begun = time.process_time()
    for n in range(MOST_ROUNDS):
        for r in best:
            for _ in range(1 + (n >= ROUNDS)):  # the second finds the memory of the first
                best[r] = min(best[r], seconds(mech, request, r))
        settled = n + 1 >= ROUNDS and all(1 / WITHIN <= quotient(r) <= WITHIN for r in rows)
        if settled or time.process_time() - begun > LONGEST:
            break
    SAVINGS.extend(
        Saving(f"{name}: {r.words}", predicted[WHOLE] / predicted[r], best[WHOLE] / best[r])
        for r in rows
    )
    outside = {r.words: quotient(r) for r in rows if not 1 / WITHIN <= quotient(r) <= WITHIN}
    if outside and crowded():
        pytest.skip(f"others use this machine, so memory costs what they leave: {outside}")
    assert not outside


def crowded() -> bool:
    """Whether more is at work here than there are processors for."""
    return hasattr(os, "getloadavg") and os.getloadavg()[0] > (os.cpu_count() or 1)


def test_weights_are_those_of_single_operations() -> None:
    from . import weights

    WEIGHTS.extend(weights.rows())
    dear = {what: here for what, _, here in WEIGHTS}
    # A busy machine shifts all of them, but not their order.
    assert dear["sin"] > dear["sqrt"] > dear["add"]
