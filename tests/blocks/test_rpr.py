"""RPR dyad: quick return and cylinder in closed form, branches, pins that meet."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from tests.blocks.machines import wired

ROUNDING = 1e-13  # [-] a hundred roundings
R, A, RATE = 0.1, 0.25, 3.0
EVERYWHERE = np.linspace(0.05, 6.2, 25)
ENGINES = pytest.mark.parametrize("engine", ["scalar", "numpy"])


def quick_return(distance=A, **more):
    """Crank pin in a slotted lever, the lever's pivot at ``distance`` below the crank's."""
    return wired(
        "quick_return",
        {
            "frame": bm.Frame(markers={"O": (0.0, 0.0), "D": (0.0, -distance)}),
            "crank": bm.Crank(length=R),
            "dyad": bm.RPR(**{"branch": -1} | more),
        },
        ["frame.O crank.A", "crank.B dyad.B", "frame.D dyad.D"],
    )


def test_slotted_lever_turns_as_the_closed_form_says():
    """tan(angle) = (A + R sin q) / (R cos q), and its rate."""
    run = quick_return().compile().run(at=EVERYWHERE, rates=RATE)
    x, y = R * np.cos(EVERYWHERE), A + R * np.sin(EVERYWHERE)
    assert np.abs(run["dyad.j.angle"] - np.arctan2(y, x)).max() <= ROUNDING
    rate = RATE * (R**2 + A * R * np.sin(EVERYWHERE)) / (x**2 + y**2)
    assert np.abs(run["dyad.j.omega"] - rate).max() <= ROUNDING * RATE
    slip = RATE * A * R * np.cos(EVERYWHERE) / np.hypot(x, y)  # of the block along the lever
    assert np.abs(run["dyad.S.slip"] + slip).max() <= ROUNDING * RATE * R


def test_lever_stops_where_the_crank_stands_across_it():
    ends = np.array([-math.asin(R / A), math.pi + math.asin(R / A)])
    run = quick_return().compile().run(at=ends, rates=RATE)
    assert np.abs(run["dyad.j.omega"]).max() <= ROUNDING * RATE
    forward, back = ends[1] - ends[0], 2 * math.pi - (ends[1] - ends[0])
    assert forward / back == pytest.approx(
        (math.pi + 2 * math.asin(R / A)) / (math.pi - 2 * math.asin(R / A))
    )  # the quick return's time ratio


@pytest.mark.parametrize("branch", [1, -1])
def test_branch_says_on_which_side_of_B_the_pin_D_is(branch):
    run = quick_return(branch=branch, h_i=0.03, h_j=-0.02).compile().run(at=EVERYWHERE, rates=RATE)
    u = np.exp(1j * run["dyad.i.angle"])
    d = run["dyad.D.p"] - run["dyad.B.p"]
    ahead = (np.conj(u) * d).real
    assert np.all(np.sign(ahead) == branch)
    assert np.abs((np.conj(u) * d).imag - 0.05).max() <= ROUNDING  # h_i - h_j
    assert np.abs(run["dyad.margin"] - (ahead / abs(d)) ** 2).max() <= ROUNDING


def test_offsets_matter_by_their_difference_only():
    one = quick_return(h_i=0.08, h_j=0.03).compile().run(at=EVERYWHERE, rates=RATE)
    other = quick_return(h_i=0.05, h_j=0.0).compile().run(at=EVERYWHERE, rates=RATE)
    for name in ("dyad.j.angle", "dyad.j.omega", "dyad.S.slip"):
        assert np.abs(one[name] - other[name]).max() <= ROUNDING * RATE


@ENGINES
@pytest.mark.parametrize("h", [0.0, 0.05])
def test_pins_that_meet_have_no_answer_and_no_margin(engine, h):
    graph = quick_return(distance=0.0, h_i=h)
    graph.blocks["crank"] = bm.Crank(
        length=R, links={"crank": bm.Link(markers={"M": (0.0, 0.0), "N": (0.1, 0.0)})}
    )
    for marker, exists in (("M", False), ("N", True)):
        graph.wires = [w for w in graph.wires if w.target != "dyad.B"]
        graph.connect(f"crank.{marker}", "dyad.B")
        run = graph.compile().run(at=[0.3], rates=RATE, engine=engine, on_gap="mark")
        assert np.isfinite(run["dyad.margin"]).all() == exists
        assert np.isfinite(run["dyad.j.angle"]).all() == exists
        assert run.quality.status == ("ok" if exists else "no-assembly",)


def test_lever_with_an_offset_beyond_the_distance_cannot_close():
    mech = quick_return(h_i=0.2).compile()
    with pytest.raises(bm.AssemblyError) as caught:
        mech.run(at=[math.pi / 2, -math.pi / 2], rates=RATE, want="dyad.j.angle")
    assert caught.value.failure.samples == [1]
    assert caught.value.failure.margin == pytest.approx(1 - (0.2 / (A - R)) ** 2, rel=1e-12)


def test_guide_force_of_a_lever_with_a_couple_is_the_couple_over_the_distance():
    graph = quick_return(x_S=0.0, slider="i")
    graph.add("load", bm.Couple(moment=7.0))
    graph.connect("dyad.j", "load.on")
    run = graph.compile().run(at=EVERYWHERE, rates=RATE)
    distance = np.abs(run["dyad.B.p"] - run["dyad.D.p"])
    # Branch -1: D is behind B, so a turn of the lever to the left needs N = -M / distance.
    assert np.abs(run["dyad.S.N"] * distance + 7.0).max() <= 7.0 * ROUNDING
    assert np.abs(run["dyad.S.C"]).max() <= 7.0 * ROUNDING  # the block's pin takes no couple
    turned_by = run["dyad.j.omega"] / RATE
    assert np.abs(run["crank.drive"] + 7.0 * turned_by).max() <= 7.0 * ROUNDING


def test_couple_of_a_slider_on_the_pinned_link_keeps_its_digits_under_large_loads():
    graph = quick_return(x_S=0.0, slider="i")
    for name, moment, link in (("small", 1e-6, "i"), ("large", 1e6, "j")):
        graph.add(name, bm.Couple(moment=moment))
        graph.connect(f"dyad.{link}", f"{name}.on")
    run = graph.compile().run(at=EVERYWHERE, rates=RATE)
    assert np.abs(run["dyad.S.C"] - 1e-6).max() <= 1e-6 * ROUNDING


def test_dyad_made_from_points_closes_there():
    chance = np.random.default_rng(3)
    for slider in ("later", "i"):
        for _ in range(20):
            B, D, S, along = (complex(*chance.normal(size=2)) for _ in range(4))
            dyad = bm.RPR.from_points(B=B, D=D, S=S, along=along, slider=slider)
            pose = dyad.kernels.position(B, D, dyad.parameters())
            owner = "i" if slider == "i" else "j"
            link = getattr(pose, owner)
            assert abs(pose.i.e - along / abs(along)) <= ROUNDING * 10 / abs(D - B)
            assert abs(link.o + link.e * dyad.slider_place("S", owner) - S) <= ROUNDING * 100


def test_branch_is_not_told_by_a_guide_across_the_pins():
    with pytest.raises(bm.GraphError, match="stands across BD"):
        bm.RPR.from_points(B=(0, 0), D=(1, 0), S=(0, 0), along=(0, 1))
