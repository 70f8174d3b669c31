"""RRP dyad: slider-cranks in closed form, branches, reach, dead centre, friction."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from tests.blocks.machines import wired

ROUNDING = 1e-13  # [-] a hundred roundings
R, L, MASS, RATE, GAS = 0.1, 0.3, 1.5, 100.0, -500.0
EVERYWHERE = np.linspace(0.05, 6.2, 25)
ENGINES = pytest.mark.parametrize("engine", ["scalar", "numpy"])


def slider_crank(offset=0.0, angle=0.0, mu=0.0, **more):
    """Massless crank and rod, piston with a gas force; the guide at ``offset`` above the pivot."""
    marker = bm.Marker(at=(0.0, offset), angle=angle)
    shoe = {"S": bm.Coulomb(coefficient=mu)} if mu else {}
    piston = bm.Link(mass=MASS)
    return wired(
        "slider_crank",
        {
            "frame": bm.Frame(markers={"O": (0.0, 0.0), "G": marker}),
            "crank": bm.Crank(length=R),
            "dyad": bm.RRP(**{"l": L, "links": {"j": piston}, "friction": shoe} | more),
            "gas": bm.Force(force=(GAS, 0.0)),
        },
        ["frame.O crank.A", "crank.B dyad.B", "frame.G dyad.S", "dyad.Cj gas.at"],
        gravity=0j,
    )


def closed_form(q, offset, side=1):
    """Piston's place, speed and acceleration at constant crank rate, by hand.

    x = R cos q + side sqrt(L^2 - (R sin q - offset)^2)
    """
    height = R * np.sin(q) - offset
    reach = np.sqrt(L**2 - height**2)
    rise = R * np.cos(q)  # d height / dq
    first = -height * rise / reach
    second = (-(rise**2) + height * R * np.sin(q)) / reach - (height * rise) ** 2 / reach**3
    x = R * np.cos(q) + side * reach
    v = RATE * (-R * np.sin(q) + side * first)
    a = RATE**2 * (-R * np.cos(q) + side * second)
    return x, v, a


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("offset", [0.0, 0.07, -0.12])
def test_piston_moves_as_the_closed_form_says(side, offset):
    mech = slider_crank(offset, branch=side).compile()
    run = mech.run(at=EVERYWHERE, rates=RATE)
    x, v, a = closed_form(EVERYWHERE, offset, side)
    for name, wanted in (("p", x + 1j * offset), ("v", v), ("a", a)):
        found = run[f"dyad.Cj.{name}"]
        assert np.abs(found - wanted).max() <= ROUNDING * np.abs(wanted).max()
    slip = run["dyad.S.slip"]
    assert np.abs(slip - v).max() <= ROUNDING * np.abs(v).max()


@pytest.mark.parametrize("h", [0.05, -0.08])
def test_offset_of_the_guide_on_the_slider_is_offset_of_the_guide_in_the_frame(h):
    one = slider_crank(offset=h, h=h).compile().run(at=EVERYWHERE, rates=RATE)
    x, v, _ = closed_form(EVERYWHERE, 0.0)
    assert np.abs(one["dyad.Cj.p"] - x).max() <= ROUNDING
    assert np.abs(one["dyad.Cj.v"] - v).max() <= ROUNDING * np.abs(v).max()


def test_margin_is_the_squared_cosine_between_rod_and_guide():
    run = slider_crank(offset=0.07).compile().run(at=EVERYWHERE, rates=RATE)
    wanted = np.cos(run["dyad.i.angle"]) ** 2
    assert np.abs(run["dyad.margin"] - wanted).max() <= ROUNDING
    transmission = np.sin(run["dyad.transmission_angle"]) ** 2
    assert np.abs(transmission - wanted).max() <= ROUNDING


@ENGINES
def test_slider_out_of_reach_is_named(engine):
    mech = slider_crank(offset=0.35).compile()
    with pytest.raises(bm.AssemblyError) as caught:
        mech.run(at=[1.0, -1.0], rates=RATE, want="dyad.C.p", engine=engine)
    failure = caught.value.failure
    assert failure.block == "dyad"
    assert failure.samples == [1]
    gap = 0.35 + R * math.sin(1.0)
    assert failure.margin == pytest.approx((L - gap) * (L + gap) / L**2, rel=ROUNDING)


@ENGINES
def test_rod_across_the_guide_is_a_dead_centre(engine):
    mech = slider_crank(offset=L).compile()
    assert mech.run(at=0.0, rates=RATE, want="dyad.C.p", engine=engine)["dyad.C.p"] == [R + 1j * L]
    with pytest.raises(bm.SingularError) as caught:
        mech.run(at=0.0, rates=RATE, want="dyad.C.v", engine=engine)
    assert caught.value.failure.margin == 0


@pytest.mark.parametrize("mu", [0.15, 0.6])
def test_rough_guide_loads_the_crank_as_the_closed_form_says(mu):
    """The rod pushes with Q along itself, at beta below the guide; T = -mu |N| sgn(v)."""
    q = np.array([0.4, 1.3, 2.6, 3.6, 4.9, 5.9])
    run = slider_crank(mu=mu).compile().run(at=q, rates=RATE)
    _, v, a = closed_form(q, 0.0)
    beta = np.arcsin(R * np.sin(q) / L)
    needed = MASS * a - GAS
    Q = needed / (np.cos(beta) - np.sign(v) * mu * np.sign(needed) * np.abs(np.sin(beta)))
    N = Q * np.sin(beta)
    for name, wanted in (
        ("dyad.S.N", N),
        ("dyad.S.friction", -mu * np.abs(N) * np.sign(v)),
        ("crank.drive", -Q * R * np.sin(q + beta)),
        ("dyad.S.friction_power", mu * np.abs(N * v)),
    ):
        assert np.abs(run[name] / wanted - 1).max() <= 1e-12, name  # forces cancel partly


@pytest.mark.parametrize("k", [1, 2, 3])
def test_iterates_of_a_rough_guide_are_those_of_the_papers_steps(k):
    mech = slider_crank(mu=0.6).compile()
    q = np.array([0.4, 1.3, 2.6])
    smooth = mech.run(at=q, rates=RATE, friction="none")
    beta = np.arcsin(R * np.sin(q) / L)
    T = np.zeros(3)
    for _ in range(k):  # N = N_smooth - T tan(beta)
        N = smooth["dyad.S.N"] - T * np.tan(beta)
        T = -0.6 * np.abs(N) * np.sign(smooth["dyad.S.slip"])
    method = {"friction": "single"} if k == 1 else {"friction": "successive", "iterations": k}
    run = mech.run(at=q, rates=RATE, on_gap="mark", **method)
    assert np.abs(run["dyad.S.friction"] / T - 1).max() <= 1e-12


def test_slider_at_rest_has_no_friction_and_says_within_which_limits():
    run = slider_crank(mu=0.2).compile().run(at=[0.0, 1.0], rates=RATE)
    flags = [f for f in run.quality.flags if f.code == "zero-relative-speed"]
    assert [(f.sample, f.where) for f in flags] == [(0, "dyad.S")]
    reach = 0.2 * abs(run["dyad.S.N"][0])
    assert flags[0].interval == pytest.approx((-reach, reach))
    assert run["dyad.S.friction"][0] == 0


def test_dyad_made_from_points_closes_there():
    chance = np.random.default_rng(3)
    for _ in range(20):
        B, C, S, along = (complex(*chance.normal(size=2)) for _ in range(4))
        dyad = bm.RRP.from_points(B=B, C=C, S=S, along=along)
        u = along / abs(along)
        pose = dyad.kernels.position(B, bm.typing.Guide(S + 0.7 * u, u), dyad.parameters())
        assert abs(pose.j.o - C) <= ROUNDING * 10
        point = pose.j.o + pose.j.e * dyad.slider_place("S", "j")
        assert abs(point - S) <= ROUNDING * 10


def test_branch_is_not_told_by_a_rod_across_the_guide():
    with pytest.raises(bm.GraphError, match="stands across the guide"):
        bm.RRP.from_points(B=(0, 0), C=(0, 1), S=(0, 1), along=(1, 0))
