"""PRP dyad: two slots in closed form, parallel guides, one assembly mode."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from tests.blocks.machines import guide, wired

ROUNDING = 1e-13  # [-] a hundred roundings
HEIGHT, RATE = 0.2, 3.0
ABOVE = np.linspace(0.3, 2.8, 15)
ENGINES = pytest.mark.parametrize("engine", ["scalar", "numpy"])


def two_slots(**more):
    """A pin in a slot of the crank through its pivot, and in a level slot of the frame."""
    return wired(
        "two_slots",
        {
            "frame": bm.Frame(markers={"O": (0.0, 0.0), "G": guide(0.0, HEIGHT, 0.0)}),
            "crank": bm.Crank(links={"crank": bm.Link(markers={"g": guide(0.0, 0.0, 0.0)})}),
            "dyad": bm.PRP(**more),
        },
        ["frame.O crank.A", "crank.g dyad.S1", "frame.G dyad.S2"],
        gravity=0j,
    )


def test_pin_in_two_slots_moves_as_the_cotangent():
    run = two_slots().compile().run(at=ABOVE, rates=RATE)
    x = HEIGHT / np.tan(ABOVE)
    v = -HEIGHT * RATE / np.sin(ABOVE) ** 2
    a = 2 * HEIGHT * RATE**2 * np.cos(ABOVE) / np.sin(ABOVE) ** 3
    for name, wanted in (("p", x + 1j * HEIGHT), ("v", v), ("a", a)):
        found = run[f"dyad.C.{name}"]
        assert np.abs(found - wanted).max() <= ROUNDING * np.abs(wanted).max()
    assert np.abs(run["dyad.S2.slip"] - v).max() <= ROUNDING * np.abs(v).max()
    out = -HEIGHT * RATE * np.cos(ABOVE) / np.sin(ABOVE) ** 2  # rate of HEIGHT / sin q
    assert np.abs(run["dyad.S1.slip"] - out).max() <= ROUNDING * np.abs(out).max()
    assert np.abs(run["dyad.margin"] - np.sin(ABOVE) ** 2).max() <= ROUNDING


def test_offsets_shift_the_slots():
    h1, h2 = 0.03, -0.05
    run = two_slots(h1=h1, h2=h2).compile().run(at=ABOVE, rates=RATE)
    # The pin is h2 below the level slot and h1 to the right of the crank's.
    y = HEIGHT - h2
    x = (y * np.cos(ABOVE) + h1) / np.sin(ABOVE)
    assert np.abs(run["dyad.C.p"] - (x + 1j * y)).max() <= ROUNDING * np.abs(x).max()


@ENGINES
def test_parallel_guides_are_a_dead_centre(engine):
    mech = two_slots().compile()
    with pytest.raises(bm.SingularError) as caught:
        mech.run(at=[1.0, 0.0], rates=RATE, want="dyad.C.p", engine=engine)
    assert caught.value.failure.block == "dyad"
    assert caught.value.failure.samples == [1]
    assert caught.value.failure.margin == 0
    said = str(caught.value)
    assert "its guides are parallel" in said
    assert "crank.q = 0 rad (sample 1 of 2)" in said
    assert "feasible arcs of crank.q: [-3.14159265, 0], [0, 3.14159265] rad" in said


def test_force_on_the_pin_is_split_along_the_two_normals():
    graph = two_slots()
    graph.add("load", bm.Force(force=(5.0, -3.0)))
    graph.connect("dyad.C", "load.at")
    run = graph.compile().run(at=ABOVE, rates=RATE)
    N1 = 5.0 / np.sin(ABOVE)  # the level slot takes no force along x
    assert np.abs(run["dyad.S1.N"] - N1).max() <= ROUNDING * N1.max()
    assert np.abs(run["dyad.S2.N"] - (3.0 - N1 * np.cos(ABOVE))).max() <= ROUNDING * N1.max()
    drive = N1 * HEIGHT / np.sin(ABOVE)
    assert np.abs(run["crank.drive"] - drive).max() <= ROUNDING * drive.max()


def test_branch_is_refused_with_its_reason():
    with pytest.raises(bm.GraphError, match="one assembly mode"):
        bm.PRP(branch=1)


def test_turning_a_guide_round_moves_nothing_but_the_signs():
    one = two_slots().compile().run(at=ABOVE, rates=RATE)
    graph = two_slots()
    graph.blocks["frame"] = bm.Frame(markers={"O": (0.0, 0.0), "G": guide(0.0, HEIGHT, math.pi)})
    other = graph.compile().run(at=ABOVE, rates=RATE)
    assert np.abs(one["dyad.C.p"] - other["dyad.C.p"]).max() <= ROUNDING
    assert np.abs(one["dyad.S2.slip"] + other["dyad.S2.slip"]).max() <= ROUNDING * 10


def test_dyad_made_from_points_closes_there():
    chance = np.random.default_rng(3)
    for _ in range(20):
        C, S1, S2, u1, u2 = (complex(*chance.normal(size=2)) for _ in range(5))
        u1, u2 = u1 / abs(u1), u2 / abs(u2)
        dyad = bm.PRP.from_points(C=C, S1=S1, along1=u1, S2=S2, along2=u2)
        at = (bm.typing.Guide(S1 - 0.4 * u1, u1), bm.typing.Guide(S2 + 0.7 * u2, u2))
        pose = dyad.kernels.position(*at, dyad.parameters())
        allowed = 100 * ROUNDING / math.sqrt(pose.margin)
        assert abs(pose.i.o - C) <= allowed
        assert abs(pose.i.o + pose.i.e * dyad.slider_place("S1", "i") - S1) <= allowed
        assert abs(pose.j.o + pose.j.e * dyad.slider_place("S2", "j") - S2) <= allowed


def test_parallel_guides_make_no_dyad_from_points():
    with pytest.raises(bm.GraphError, match="parallel"):
        bm.PRP.from_points(C=(0, 0), S1=(0, 0), along1=(1, 0), S2=(0, 1), along2=(-1, 0))
