"""Dyads with rough guides against the independent multibody solver: where they jam.

Motion and forces of every block are held against it on random mechanisms (`tests.proof`).
How errors are measured: `tests.independent.comparison`.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import blockmech as bm
from tests.blocks.twin import REQUEST, Comparison
from tests.gallery import GRAPHS
from tests.wiring import changed

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


OFF = {"slider": "i", "x_S": 0.1, "h_i": 0.08}  # else a lever's guide does not jam
ROUGH = [
    ("slider_crank", "piston", 6.0, {}),
    ("whitworth_shaper", "lever", 0.5, OFF),
    ("tangent_generator", "block", 0.3, {}),
    ("scotch_yoke", "yoke", 0.3, {}),
]


@pytest.mark.parametrize(("name", "dyad", "mu", "more"), ROUGH, ids=[name for name, *_ in ROUGH])
def test_short_rough_guides_jam_where_the_judge_finds_no_solution(name, dyad, mu, more):
    graph = bm.Graph.load(GRAPHS / f"{name}.json")
    block, shoe = graph.blocks[dyad], bm.friction.Coulomb(coefficient=mu, guide_length=0.03)
    rough = {joint: shoe for joint, declared in block.joints.items() if declared.kind == "P"}
    graph.blocks[dyad] = changed(block, friction=rough, **more)
    counts = Counter()
    for q in np.random.default_rng(7).uniform(0, 2 * np.pi, 20):
        result = compared(graph, q, True)
        (status,) = result.run.quality.status
        counts[status] += 1
        forces = result.judge.forces
        assert forces.converged == (status == "ok"), q
        if status == "ok":
            # Near a limit the friction is as uncertain as its own equations say.
            assert result.wrong(ROUNDING, 1e3 * ROUNDING) == {}, q
        else:
            limits = [f.value for f in result.run.quality.flags if f.where == dyad]
            assert limits[0] == pytest.approx(forces.scale, rel=1e-4), q
    assert min(counts["ok"], counts["jammed"]) >= 3
