"""Every dyad against the independent multibody solver: motion, reactions, friction.

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

MACHINES = {
    "slider-crank": (machines.slider_crank(), [0.3, 1.1, 2.0, 2.9, 3.7, 4.8, 5.9]),
    "slider-crank, other branch": (machines.slider_crank(branch=-1), [0.3, 2.0, 3.7, 5.9]),
    "slider-crank, point on the guide": (machines.slider_crank(slider="earlier"), [0.3, 2.0, 3.7]),
    "whitworth": (machines.whitworth(), [0.3, 1.1, 2.0, 2.9, 3.7, 4.8, 5.9]),
    "whitworth, other branch": (machines.whitworth(branch=-1), [0.3, 2.0, 3.7, 5.9]),
    "whitworth, point on the block": (machines.whitworth(slider="i"), [0.3, 2.0, 3.7]),
    "slotted crank": (machines.slotted_crank(), [0.3, 1.1, 2.6, 3.7, 4.2]),
    "slotted crank, points on guides": (
        machines.slotted_crank({"S1": "earlier", "S2": "earlier"}),
        [0.3, 2.6, 3.7],
    ),
    "yoke": (machines.yoke(), [0.3, 1.1, 2.0, 2.9, 3.7, 4.8, 5.9]),
    "yoke, points on the pin and the guide": (
        machines.yoke({"S1": "i", "S": "earlier"}, beta=-1.1),
        [0.3, 2.0, 3.7, 5.9],
    ),
    "shaper": (machines.shaper(), [0.3, 1.1, 2.0, 2.9, 3.7, 4.8, 5.9]),
    "stacked": (machines.stacked(), [(4.0, 0.24), (0.26, 0.11), (5.73, -0.1), (2.2, 0.4)]),
}


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


SAMPLES = [
    pytest.param(g, q, id=f"{name} at {q}") for name, (g, qs) in MACHINES.items() for q in qs
]


@pytest.mark.parametrize(("graph", "q"), SAMPLES)
@pytest.mark.parametrize("friction", [False, True], ids=["smooth", "rough"])
def test_motion_and_forces_are_the_judge_s(graph, q, friction):
    assert_the_judge_agrees(compared(graph, q, friction))


@pytest.mark.parametrize(("graph", "qs"), MACHINES.values(), ids=list(MACHINES))
def test_friction_was_there_to_be_compared(graph, qs):
    found = compared(graph, qs[0], True).judge.forces
    assert sum(float(joint.friction) != 0 for joint in found.joints.values()) >= 3


ROUGH = [
    ("slider-crank", lambda shoe: machines.slider_crank(shoe=shoe, x_S=0.2), 0.4),
    ("whitworth", lambda shoe: machines.whitworth(shoe=shoe), 0.9),
    ("slotted crank", lambda shoe: machines.slotted_crank(shoe=shoe), 0.35),
    ("yoke", lambda shoe: machines.yoke(shoe=shoe), 0.35),
]


@pytest.mark.parametrize(("name", "machine", "mu"), ROUGH, ids=[r[0] for r in ROUGH])
def test_short_rough_guides_jam_where_the_judge_finds_no_solution(name, machine, mu):
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
