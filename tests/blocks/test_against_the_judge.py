"""Dyads with rough guides against the independent multibody solver: where they jam.

Motion and forces of every block are held against it on random mechanisms (`tests.proof`).
How errors are measured: `tests.independent.comparison`.
"""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from tests.blocks import machines
from tests.blocks.twin import REQUEST, Comparison

ROUNDING = 1e-13  # [-] some hundred roundings of 1e-16, times the condition that is divided out
RATES, ACCELERATIONS = (9.0, -0.4), (40.0, 3.0)


def compared(graph, q, friction):
    """One sample by blockmech and by the judge."""
    mechanism = graph.compile()
    rows = zip(REQUEST, (np.atleast_1d(q), RATES, ACCELERATIONS), strict=True)
    request = {key: dict(zip(mechanism.drivers, x, strict=False)) for key, x in rows}
    return Comparison(mechanism, request, friction)


def assert_the_judge_agrees(found):
    """Motion and forces are the judge's, to rounding."""
    assert found.outcome() == "ok"
    assert found.wrong(ROUNDING, ROUNDING) == {}


ROUGH = [
    (machines.slider_crank, 0.4),
    (machines.whitworth, 0.9),
    (machines.slotted_crank, 0.35),
    (machines.yoke, 0.35),
]


@pytest.mark.parametrize(("machine", "mu"), ROUGH, ids=[made.__name__ for made, _ in ROUGH])
def test_short_rough_guides_jam_where_the_judge_finds_no_solution(machine, mu):
    graph = machine(bm.Coulomb(coefficient=mu, guide_length=0.03))
    chance = np.random.default_rng(7)
    counts = {"ok": 0, "jammed": 0}
    for q in chance.uniform(0, 2 * np.pi, 25):
        found = compared(graph, q, True)
        (status,) = found.run.quality.status
        if status == "no-assembly":
            continue
        counts[status] += 1
        forces = found.judge.forces
        assert forces.converged == (status == "ok"), q
        if status == "ok":
            # Near a limit the friction is as uncertain as its own equations say.
            assert found.wrong(ROUNDING, 1e3 * ROUNDING) == {}, q
        else:
            limits = [f.value for f in found.run.quality.flags if f.where == "dyad"]
            assert limits[0] == pytest.approx(forces.scale, rel=1e-4), q
    assert min(counts.values()) >= 2
