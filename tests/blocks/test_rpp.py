"""RPP dyad: scotch yoke and Oldham coupling in closed form, one assembly mode."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from tests.blocks.machines import guide, wired

ROUNDING = 1e-13  # [-] a hundred roundings
R, RATE, MASS = 0.1, 20.0, 2.0
EVERYWHERE = np.linspace(0.0, 6.2, 25)


def scotch_yoke(beta=math.pi / 2, **more):
    """Crank pin in a slot of the yoke, which slides along the x axis."""
    return wired(
        "scotch_yoke",
        {
            "frame": bm.Frame(markers={"O": (0.0, 0.0), "G": guide(0.0, 0.0, 0.0)}),
            "crank": bm.Crank(length=R),
            "dyad": bm.RPP(**{"beta": beta, "links": {"j": bm.Link(mass=MASS)}} | more),
        },
        ["frame.O crank.A", "crank.B dyad.B", "frame.G dyad.S"],
        gravity=0j,
    )


@pytest.mark.parametrize("beta", [math.pi / 2, 1.1, -2.0])
def test_yoke_moves_harmonically(beta):
    """x = R cos q - R sin q / tan(beta)."""
    run = scotch_yoke(beta).compile().run(at=EVERYWHERE, rates=RATE)
    slope = 1 / math.tan(beta)
    x = R * (np.cos(EVERYWHERE) - slope * np.sin(EVERYWHERE))
    v = -R * RATE * (np.sin(EVERYWHERE) + slope * np.cos(EVERYWHERE))
    for name, wanted in (("p", x), ("v", v), ("a", -(RATE**2) * x)):
        found = run[f"dyad.O.{name}"]
        assert np.abs(found - wanted).max() <= ROUNDING * np.abs(wanted).max()
    assert np.abs(run["dyad.S.slip"] - v).max() <= ROUNDING * R * RATE
    up = R * RATE * np.cos(EVERYWHERE) / math.sin(beta)  # of the block along the slot
    assert np.abs(run["dyad.S1.slip"] + up).max() <= ROUNDING * R * RATE / abs(math.sin(beta))
    assert np.abs(run["dyad.margin"] - math.sin(beta) ** 2).max() <= ROUNDING


def test_yoke_of_mass_drives_the_crank_as_the_closed_form_says():
    run = scotch_yoke().compile().run(at=EVERYWHERE, rates=RATE)
    x = R * np.cos(EVERYWHERE)
    needed = -MASS * RATE**2 * x  # force on the yoke along x
    scale = MASS * RATE**2 * R
    assert np.abs(run["dyad.B.reaction"] - needed).max() <= ROUNDING * scale
    drive = -needed * R * np.sin(EVERYWHERE)  # power needed * v over the crank's rate
    assert np.abs(run["crank.drive"] - drive).max() <= ROUNDING * scale * R
    assert np.abs(run["dyad.S.N"]).max() <= ROUNDING * scale
    couple = -needed * R * np.sin(EVERYWHERE)  # the guide keeps the yoke from turning
    assert np.abs(run["dyad.S.C"] + couple).max() <= ROUNDING * scale * R


def oldham(distance=0.03):
    """Two discs on shafts at a distance, a cross between them in slots at right angles."""
    return wired(
        "oldham",
        {
            "frame": bm.Frame(markers={"O": (0.0, 0.0), "Q": (distance, 0.0)}),
            "disc": bm.Crank(links={"crank": bm.Link(markers={"g": guide(0.0, 0.0, 0.0)})}),
            "dyad": bm.RPP(beta=math.pi / 2, links={"j": bm.Link(mass=1.0)}),
        },
        ["frame.O disc.A", "frame.Q dyad.B", "disc.g dyad.S"],
        gravity=0j,
    )


def test_oldham_coupling_turns_both_shafts_alike_and_its_cross_runs_round_twice():
    d = 0.03
    run = oldham(d).compile().run(at=EVERYWHERE, rates=RATE)
    assert np.abs(run["dyad.i.omega"] - RATE).max() == 0
    assert np.abs(run["dyad.i.alpha"]).max() == 0
    centre = d / 2 * (1 + np.exp(2j * EVERYWHERE))  # on the circle over the shafts' distance
    assert np.abs(run["dyad.O.p"] - centre).max() <= ROUNDING
    speed = np.abs(run["dyad.O.v"])
    assert np.abs(speed - RATE * d).max() <= ROUNDING * RATE * d


def test_friction_of_an_oldham_coupling_is_drive_power():
    graph = oldham()
    graph.blocks["dyad"] = graph.blocks["dyad"].model_copy(
        update={"friction": {n: bm.Coulomb(coefficient=0.1) for n in ("S1", "S")}}
    )
    run = graph.compile().run(at=EVERYWHERE[1:], rates=RATE)
    lost = run["mechanism.friction_power"]
    assert np.all(lost > 0)
    # At constant speed the cross keeps its kinetic energy, so the drive makes up for the loss.
    assert np.abs(run["disc.power"] / lost - 1).max() <= 1e-12


def test_crank_pin_on_the_guide_is_not_taken_for_a_pin_at_rest():
    """There every length of the dyad is zero for a moment."""
    pin = {"B": bm.Coulomb(coefficient=0.2, radius=0.01)}
    graph = scotch_yoke(friction=pin)
    graph.blocks["frame"] = bm.Frame(markers={"O": (0.0, 0.0), "G": guide(R, 0.0, 0.0)})
    run = graph.compile().run(at=[0.0, 1e-13, 1.0], rates=RATE)
    wanted = 0.2 * 0.01 * np.abs(run["dyad.B.reaction"])  # the yoke's block turns back
    assert np.abs(run["dyad.B.friction"] / wanted - 1).max() <= ROUNDING
    assert not any(f.where == "dyad.B" for f in run.quality.flags)


def test_branch_is_refused_with_its_reason():
    with pytest.raises(bm.GraphError, match="one assembly mode"):
        bm.RPP(beta=1.0, branch=1)


@pytest.mark.parametrize("beta", [0.0, math.pi, -math.pi, 3 * math.pi])
def test_parallel_guides_are_refused(beta):
    with pytest.raises(bm.GraphError, match="parallel"):
        bm.RPP(beta=beta)


def test_outer_slider_is_not_on_the_inner_links():
    with pytest.raises(bm.GraphError, match="outer joint S"):
        bm.RPP(beta=1.0, slider={"S": "i"})


def test_couple_of_a_slider_on_the_pinned_link_keeps_its_digits_under_large_loads():
    graph = scotch_yoke(slider={"S1": "i"})
    for name, moment, link in (("small", 1e-6, "i"), ("large", 1e6, "j")):
        graph.add(name, bm.Couple(moment=moment))
        graph.connect(f"dyad.{link}", f"{name}.on")
    run = graph.compile().run(at=EVERYWHERE, rates=RATE)
    assert np.abs(run["dyad.S1.C"] - 1e-6).max() <= 1e-6 * ROUNDING


def test_dyad_made_from_points_closes_there():
    chance = np.random.default_rng(3)
    for owner in ("j", "i"):
        for _ in range(20):
            B, S1, S, u1, u2 = (complex(*chance.normal(size=2)) for _ in range(5))
            u1, u2 = u1 / abs(u1), u2 / abs(u2)
            dyad = bm.RPP.from_points(B=B, S1=S1, along1=u1, S=S, along=u2, slider={"S1": owner})
            pose = dyad.kernels.position(B, bm.typing.Guide(S + 0.7 * u2, u2), dyad.parameters())
            allowed = 1000 * ROUNDING / math.sqrt(pose.margin)
            assert abs(pose.i.e - u1) <= allowed
            link = getattr(pose, owner)
            assert abs(link.o + link.e * dyad.slider_place("S1", owner) - S1) <= allowed
            assert abs(pose.j.o + pose.j.e * dyad.slider_place("S", "j") - S) <= allowed


@pytest.mark.parametrize("word", ["i", "j", "later", "earlier"])
def test_a_word_alone_says_who_owns_the_inner_slider(word):
    assert bm.RPP(beta=1.0, slider=word) == bm.RPP(beta=1.0, slider={"S1": word})
