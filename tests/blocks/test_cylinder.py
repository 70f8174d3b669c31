"""Cylinder: a driven length between two pivots, in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from tests.blocks.machines import LONG_SHOE, PIN, body, wired
from tests.blocks.test_against_the_judge import ROUNDING

ENGINES = pytest.mark.parametrize("engine", ["scalar", "numpy"])
BASE = 0.8  # [m] between the pivots
ARM = 0.5  # [m]


def boom(friction=True):
    """An arm lifted by a cylinder, all pairs rough, masses off their lines."""
    links = {
        "barrel": body(4.0, 0.05, (0.2, 0.01)),
        "rod": body(2.0, 0.02, (-0.15, -0.005)),
        "j": body(6.0, 0.3, (0.3, 0.04), P=(0.7, 0.1)),
    }
    laws = {"B": PIN, "C": PIN, "D": PIN, "S": LONG_SHOE} if friction else {}
    blocks = {
        "frame": bm.Frame(markers={"B": (0.1, -0.05), "D": (0.1 + BASE, -0.05)}),
        "lift": bm.Cylinder(l_j=ARM, x_S=0.05, links=links, friction=laws),
        "load": bm.Force(force=(150.0, -900.0)),
    }
    return wired("boom", blocks, ["frame.B lift.B", "frame.D lift.D", "lift.P load.at"])


def test_length_is_that_of_a_link_of_an_rrr_dyad():
    q = 0.75
    mech = boom(friction=False).compile()
    run = mech.run(at=q, rates=0.0)
    dyad = bm.RRR(l_i=q, l_j=ARM, links={"j": boom().blocks["lift"].links["j"]})
    a, b = complex(0.1, -0.05), complex(0.1 + BASE, -0.05)
    pose = dyad.kernels.position(a, b, dyad.parameters())
    assert abs(run["lift.C.p"][0] - (a + q * pose.i.e)) <= ROUNDING
    assert run["lift.margin"][0] == pytest.approx(pose.margin, rel=ROUNDING)
    assert run["lift.q"][0] == q


def test_pressure_force_is_the_moment_over_the_lever():
    # Massless, without friction: the cylinder is a bar between its pins.
    links = {"j": bm.Link(markers={"P": (0.7, 0.1)})}
    graph = boom(friction=False)
    graph.blocks["lift"] = bm.Cylinder(l_j=ARM, links=links)
    mech = graph.compile()
    q = np.array([0.5, 0.8, 1.1])
    run = mech.run(at=q, rates=0.1, accelerations=0.5)
    D, B = complex(0.1 + BASE, -0.05), complex(0.1, -0.05)
    C, P = run["lift.C.p"], run["lift.P.p"]
    u = (C - B) / abs(C - B)
    moment = ((P - D).conj() * (150.0 - 900.0j)).imag
    lever = ((C - D).conj() * u).imag
    assert run["lift.drive"] == pytest.approx(-moment / lever, rel=ROUNDING)
    assert np.abs(run["lift.S.N"]).max() <= ROUNDING * np.abs(run["lift.drive"]).max()


@ENGINES
@pytest.mark.parametrize(("q", "margin"), [(0.0, -1.0), (-0.7, -1.0), (0.2, None), (1.4, None)])
def test_lengths_that_cannot_be_have_no_assembly(engine, q, margin):
    mech = boom().compile()
    run = mech.run(at=[0.8, q], rates=0.1, engine=engine, on_gap="mark")
    assert run.quality.status == ("ok", "no-assembly")
    found = run.quality.margin["lift"][1]
    assert found < 0 if margin is None else found == margin
    assert np.isnan(run["lift.C.p"][1])
    assert np.isnan(run["lift.drive"][1])
    with pytest.raises(bm.AssemblyError, match="lift"):
        mech.run(at=q, engine=engine)


def test_feasible_lengths_are_between_both_dead_centres():
    (arc,) = boom().compile().limits().arcs
    assert arc.start.q == pytest.approx(BASE - ARM, abs=1e-10)
    assert arc.end.q == pytest.approx(BASE + ARM, abs=1e-10)
    assert (arc.start.block, arc.end.block) == ("lift", "lift")


@pytest.mark.parametrize("side", [1, -1])
def test_group_made_from_points_closes_there(side):
    chance = np.random.default_rng(4)
    for _ in range(20):
        B, D = (complex(*chance.normal(size=2)) for _ in range(2))
        C = B + (D - B) * complex(chance.uniform(-0.5, 1.5), side * chance.uniform(0.1, 2.0))
        group = bm.Cylinder.from_points(B=B, C=C, D=D)
        assert group.branch == side
        pose = group.kernels.position(B, D, abs(C - B), group.parameters())
        allowed = 100 * ROUNDING / math.sqrt(pose.margin)
        assert abs(pose.rod.o - C) <= allowed
        assert abs(pose.j.o + pose.j.e * group.l_j - C) <= allowed


def test_points_on_one_line_make_no_group():
    with pytest.raises(bm.GraphError, match="on one line"):
        bm.Cylinder.from_points(B=(0, 0), C=(1, 0), D=(3, 0))
