"""Dyads at their edges: out of reach, dead centres, pins that meet, owners of sliders.

How they move and what they carry otherwise is said by closed forms in the gallery's files and
by the independent judge on random mechanisms (`tests.proof`).
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.typing import Guide
from tests.blocks.machines import guide, wired

ROUNDING = 1e-13  # [-] a hundred roundings
R, L, A, HEIGHT, RATE = 0.1, 0.3, 0.25, 0.2, 3.0  # [m] crank, rod, pivots, guide; [rad/s]
EVERYWHERE = np.linspace(0.05, 6.2, 25)
ENGINES = pytest.mark.parametrize("engine", ["scalar", "numpy"])


def machine(dyad, *wires, crank=None, **markers):
    """A crank and a dyad between it and the frame."""
    frame = bm.Frame(markers={"O": (0.0, 0.0), **markers})
    blocks = {"frame": frame, "crank": crank or bm.Crank(length=R), "dyad": dyad}
    return wired("machine", blocks, ["frame.O crank.A", *wires], gravity=0j)


def slider_crank(offset=0.0, **options):
    """Massless crank and rod, a piston; the guide at ``offset`` above the pivot."""
    piston = bm.RRP(l=L, links={"j": bm.Link(mass=1.5)}, **options)
    return machine(piston, "crank.B dyad.B", "frame.G dyad.S", G=guide(0.0, offset, 0.0))


def quick_return(distance=A, **options):
    """Crank pin in a slotted lever, the lever's pivot at ``distance`` below the crank's."""
    lever = bm.RPR(**{"branch": -1} | options)
    return machine(lever, "crank.B dyad.B", "frame.D dyad.D", D=(0.0, -distance))


def two_slots(angle=0.0):
    """A pin in a slot of the crank through its pivot, and in a level slot of the frame."""
    crank = bm.Crank(links={"crank": bm.Link(markers={"g": guide(0.0, 0.0, 0.0)})})
    wires = "crank.g dyad.S1", "frame.G dyad.S2"
    return machine(bm.PRP(), *wires, crank=crank, G=guide(0.0, HEIGHT, angle))


def scotch_yoke(x=0.0, **options):
    """Crank pin in a slot of the yoke, which slides along a guide from x."""
    yoke = bm.RPP(beta=math.pi / 2, links={"j": bm.Link(mass=2.0)}, **options)
    return machine(yoke, "crank.B dyad.B", "frame.G dyad.S", G=guide(x, 0.0, 0.0))


def boom():
    """An arm of 0.5 m lifted by a cylinder, 0.8 m between the pivots."""
    blocks = {
        "frame": bm.Frame(markers={"B": (0.1, -0.05), "D": (0.9, -0.05)}),
        "lift": bm.Cylinder(l_j=0.5, links={"j": bm.Link(mass=6.0, cm=(0.3, 0.04))}),
    }
    return wired("boom", blocks, ["frame.B lift.B", "frame.D lift.D"])


# ---- where there is no answer ------------------------------------------------------------

GAP = L + 0.05 + R * math.sin(1.0)  # [m] of the pin from the guide at -1 rad
NOWHERE = {
    "rod too short": (
        *(slider_crank(L + 0.05), [1.0, -1.0], "dyad.C.p", bm.AssemblyError),
        (L - GAP) * (L + GAP) / L**2,
    ),
    "offset beyond the distance": (
        *(quick_return(h_i=0.2), [math.pi / 2, -math.pi / 2], "dyad.j.angle", bm.AssemblyError),
        1 - (0.2 / (A - R)) ** 2,
    ),
    "rod across the guide": (slider_crank(L), [0.1, 0.0], "dyad.C.v", bm.SingularError, 0.0),
    "parallel guides": (two_slots(), [1.0, 0.0], "dyad.C.p", bm.SingularError, 0.0),
}


@ENGINES
@pytest.mark.parametrize("name", NOWHERE)
def test_a_sample_without_an_answer_is_named_with_its_margin(name, engine):
    graph, at, want, error, margin = NOWHERE[name]
    with pytest.raises(error) as caught:
        graph.run(at=at, rates=RATE, want=want, engine=engine)
    failure = caught.value.failure
    assert (failure.block, list(failure.samples)) == ("dyad", [1])
    assert failure.margin == pytest.approx(margin, rel=1e-12)
    if name == "parallel guides":
        said = str(caught.value)
        assert "its guides are parallel" in said
        assert "crank.q = 0 rad (sample 1 of 2)" in said
        assert "feasible arcs of crank.q: [-3.14159265, 0], [0, 3.14159265] rad" in said


@ENGINES
def test_a_rod_across_its_guide_has_a_place(engine):
    place = slider_crank(L).run(at=0.0, rates=RATE, want="dyad.C.p", engine=engine)["dyad.C.p"]
    assert place == [R + 1j * L]


@ENGINES
@pytest.mark.parametrize("h", [0.0, 0.05])
def test_pins_that_meet_have_no_answer_and_no_margin(engine, h):
    graph = quick_return(distance=0.0, h_i=h)
    markers = {"M": (0.0, 0.0), "N": (0.1, 0.0)}
    graph.blocks["crank"] = bm.Crank(length=R, links={"crank": bm.Link(markers=markers)})
    for marker, exists in (("M", False), ("N", True)):
        graph.wires = [w for w in graph.wires if w.target != "dyad.B"]
        graph.connect(f"crank.{marker}", "dyad.B")
        run = graph.compile().run(at=[0.3], rates=RATE, engine=engine, on_gap="mark")
        assert np.isfinite(run["dyad.margin"]).all() == exists
        assert np.isfinite(run["dyad.j.angle"]).all() == exists
        assert run.quality.status == ("ok" if exists else "no-assembly",)


@ENGINES
@pytest.mark.parametrize(("q", "margin"), [(0.0, -1.0), (-0.7, -1.0), (0.2, None), (1.4, None)])
def test_lengths_of_a_cylinder_that_cannot_be_have_no_assembly(engine, q, margin):
    mech = boom().compile()
    run = mech.run(at=[0.8, q], rates=0.1, engine=engine, on_gap="mark")
    assert run.quality.status == ("ok", "no-assembly")
    result = run.quality.margin["lift"][1]
    assert result < 0 if margin is None else result == margin
    assert np.isnan(run["lift.C.p"][1])
    assert np.isnan(run["lift.drive"][1])
    with pytest.raises(bm.AssemblyError, match="lift"):
        mech.run(at=q, engine=engine)


def test_feasible_lengths_of_a_cylinder_are_between_both_dead_centres():
    (arc,) = boom().compile().limits().arcs
    assert (arc.start.q, arc.end.q) == pytest.approx((0.8 - 0.5, 0.8 + 0.5), abs=1e-10)
    assert (arc.start.block, arc.end.block) == ("lift", "lift")


# ---- branches, margins, signs ------------------------------------------------------------


@pytest.mark.parametrize("branch", [1, -1])
def test_branch_says_on_which_side_of_B_the_pin_D_is(branch):
    run = quick_return(branch=branch, h_i=0.03, h_j=-0.02).run(at=EVERYWHERE, rates=RATE)
    u = np.exp(1j * run["dyad.i.angle"])
    d = run["dyad.D.p"] - run["dyad.B.p"]
    ahead = (np.conj(u) * d).real
    assert np.all(np.sign(ahead) == branch)
    assert np.abs((np.conj(u) * d).imag - 0.05).max() <= ROUNDING  # h_i - h_j
    assert np.abs(run["dyad.margin"] - (ahead / abs(d)) ** 2).max() <= ROUNDING


def test_margin_is_the_squared_cosine_between_rod_and_guide():
    run = slider_crank(offset=0.07).run(at=EVERYWHERE, rates=RATE)
    expected = np.cos(run["dyad.i.angle"]) ** 2
    assert np.abs(run["dyad.margin"] - expected).max() <= ROUNDING
    transmission = np.sin(run["dyad.transmission_angle"]) ** 2
    assert np.abs(transmission - expected).max() <= ROUNDING


def test_turning_a_guide_round_moves_nothing_but_the_signs():
    above = np.linspace(0.3, 2.8, 15)
    one, other = (two_slots(turn).run(at=above, rates=RATE) for turn in (0.0, math.pi))
    assert np.abs(one["dyad.C.p"] - other["dyad.C.p"]).max() <= ROUNDING
    assert np.abs(one["dyad.S2.slip"] + other["dyad.S2.slip"]).max() <= ROUNDING * 10


# ---- forces ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("graph", "couple"),
    [
        (quick_return(x_S=0.0, slider="i"), "dyad.S.C"),
        (scotch_yoke(slider={"S1": "i"}), "dyad.S1.C"),
    ],
)
def test_couple_of_a_slider_on_the_pinned_link_keeps_its_digits_under_large_loads(graph, couple):
    for name, moment, link in (("small", 1e-6, "i"), ("large", 1e6, "j")):
        graph.add(name, bm.Couple(moment=moment))
        graph.connect(f"dyad.{link}", f"{name}.on")
    run = graph.compile().run(at=EVERYWHERE, rates=RATE)
    assert np.abs(run[couple] - 1e-6).max() <= 1e-6 * ROUNDING


@pytest.mark.parametrize("k", [1, 2, 3])
def test_iterates_of_a_rough_guide_are_those_of_the_papers_steps(k):
    mech = slider_crank(friction={"S": bm.friction.Coulomb(coefficient=0.6)}).compile()
    q = np.array([0.4, 1.3, 2.6])
    smooth = mech.run(at=q, rates=RATE, friction="none")
    beta = np.arcsin(R * np.sin(q) / L)
    T = np.zeros(3)
    for _ in range(k):  # N = N_smooth - T tan(beta)
        N = smooth["dyad.S.N"] - T * np.tan(beta)
        T = -0.6 * np.abs(N) * np.sign(smooth["dyad.S.slip"])
    method = {"friction": "single" if k == 1 else bm.friction.Successive(iterations=k)}
    run = mech.run(at=q, rates=RATE, on_gap="mark", **method)
    assert np.abs(run["dyad.S.friction"] / T - 1).max() <= 1e-12


def test_slider_at_rest_has_no_friction_and_says_within_which_limits():
    graph = slider_crank(0.07, friction={"S": bm.friction.Coulomb(coefficient=0.2)})
    stop = math.asin(0.07 / (L + R))  # crank and rod in line
    run = graph.run(at=[stop, 1.0], rates=RATE)
    flags = [f for f in run.quality.flags if f.code == "zero-relative-speed"]
    assert [(f.sample, f.where) for f in flags] == [(0, "dyad.S")]
    reach = 0.2 * abs(run["dyad.S.N"][0])
    assert flags[0].interval == pytest.approx((-reach, reach))
    assert run["dyad.S.friction"][0] == 0


def test_crank_pin_on_the_guide_is_not_taken_for_a_pin_at_rest():
    """There every length of the dyad is zero for a moment."""
    graph = scotch_yoke(R, friction={"B": bm.friction.Coulomb(coefficient=0.2, radius=0.01)})
    run = graph.run(at=[0.0, 1e-13, 1.0], rates=RATE)
    expected = 0.2 * 0.01 * np.abs(run["dyad.B.reaction"])  # the yoke's block turns back
    assert np.abs(run["dyad.B.friction"] / expected - 1).max() <= ROUNDING
    assert not any(f.where == "dyad.B" for f in run.quality.flags)


# ---- made from points --------------------------------------------------------------------


def rrr(B, C, D, *_):
    dyad = bm.RRR.from_points(B=B, C=C, D=D)
    return dyad, (B, D), {("i", dyad.l_i): C, ("j", dyad.l_j): C}


def cylinder(B, C, D, *_):
    group = bm.Cylinder.from_points(B=B, C=C, D=D)
    return group, (B, D, abs(C - B)), {("rod", 0.0): C, ("j", group.l_j): C}


def rrp(B, C, S, u, _):
    dyad = bm.RRP.from_points(B=B, C=C, S=S, along=3.0 * u)
    return dyad, (B, Guide(S + 0.7 * u, u)), {("j", 0.0): C, ("j", dyad.slider_place("S", "j")): S}


def rpr(B, D, S, u, _, owner="j"):
    dyad = bm.RPR.from_points(B=B, D=D, S=S, along=3.0 * u, slider={"j": "later"}.get(owner, owner))
    return dyad, (B, D), {("i", 1.0): B + u, (owner, dyad.slider_place("S", owner)): S}


def prp(C, S1, S2, u, w):
    dyad = bm.PRP.from_points(C=C, S1=S1, along1=u, S2=S2, along2=w)
    guides = Guide(S1 - 0.4 * u, u), Guide(S2 + 0.7 * w, w)
    on = {("i", dyad.slider_place("S1", "i")): S1, ("j", dyad.slider_place("S2", "j")): S2}
    return dyad, guides, {("i", 0.0): C, **on}


def rpp(B, S1, S, u, w, owner="j"):
    dyad = bm.RPP.from_points(B=B, S1=S1, along1=u, S=S, along=w, slider={"S1": owner})
    on = {(owner, dyad.slider_place("S1", owner)): S1, ("j", dyad.slider_place("S", "j")): S}
    return dyad, (B, Guide(S + 0.7 * w, w)), {("i", 1.0): B + u, **on}


MAKERS = (rrr, cylinder, rrp, rpr, lambda *z: rpr(*z, "i"), prp, rpp, lambda *z: rpp(*z, "i"))


@pytest.mark.parametrize("make", MAKERS)
def test_a_group_made_from_points_closes_there(make):
    chance = np.random.default_rng(3)
    for _ in range(20):
        *points, u, w = (complex(*chance.normal(size=2)) for _ in range(5))
        group, ports, places = make(*points, u / abs(u), w / abs(w))
        pose = group.kernels.position(*ports, group.parameters())
        for (name, place), expected in places.items():
            link = getattr(pose, name)
            result = link.o + link.e * place
            assert abs(result - expected) <= 1000 * ROUNDING / math.sqrt(pose.margin)


REFUSED = {
    "on one line": lambda: bm.Cylinder.from_points(B=(0, 0), C=(1, 0), D=(3, 0)),
    "stands across the guide": lambda: bm.RRP.from_points(B=0j, C=1j, S=1j, along=1 + 0j),
    "stands across BD": lambda: bm.RPR.from_points(B=0j, D=1 + 0j, S=0j, along=1j),
    "parallel": lambda: bm.PRP.from_points(C=0j, S1=0j, along1=1 + 0j, S2=1j, along2=-1 + 0j),
    "RPP.*parallel": lambda: bm.RPP(beta=-3 * math.pi),
    "RPP.*one assembly mode": lambda: bm.RPP(beta=1.0, branch=1),
    "PRP.*one assembly mode": lambda: bm.PRP(branch=1),
    "outer joint S": lambda: bm.RPP(beta=1.0, slider={"S": "i"}),
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_makes_no_group_is_refused_with_its_reason(message):
    with pytest.raises(bm.GraphError, match=message):
        REFUSED[message]()


@pytest.mark.parametrize("word", ["i", "j", "later", "earlier"])
def test_a_word_alone_says_who_owns_the_inner_slider(word):
    assert bm.RPP(beta=1.0, slider=word) == bm.RPP(beta=1.0, slider={"S1": word})
