"""Coordinates of pairs, instant centres, ratios and curvature, against differences and geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.ground.errors import RequestError
from tests.gallery import GRAPHS, JOINTS, mechanism

RANGES = {
    "andrews_squeezer": (-0.06, 6.0),
    "ruiz_fourbar": (0.0, 12.0),
    "toggle_press": (0.4, 6.0),
    "whitworth_shaper": (0.0, 12.0),
    "oldham_coupling": (0.0, 12.0),
    "scotch_yoke": (0.0, 12.0),
    "elliptic_trammel": (0.05, 0.1),
    "tangent_generator": (0.9, 1.2),
    "valve_engine": (0.0, 12.0),
    "stephenson_3_triad": (0.0, 6.0),
}


@pytest.mark.parametrize("name", RANGES)
def test_coordinates_of_pairs_change_at_the_rate_of_their_slip(name):
    mech = mechanism(name)
    joints = [o.removesuffix(".coordinate") for o in mech.outputs if o.endswith(".coordinate")]
    assert set(joints) == {o.removesuffix(".slip") for o in mech.outputs if o.endswith(".slip")}
    q = np.linspace(*RANGES[name], 241)
    h = 1e-5
    want = ["*.coordinate", "*.slip"]
    result = mech.run(at=q, rates=1.0, want=want)
    low, high = (mech.run(at=q + s, rates=1.0, want=want) for s in (-h, h))
    for joint in joints:
        coordinate, slip = result.unwrapped(f"{joint}.coordinate"), result[f"{joint}.slip"]
        moved = high[f"{joint}.coordinate"] - low[f"{joint}.coordinate"]
        rate = (moved - math.tau * np.round(moved / math.tau)) / (2 * h)
        scale = max(np.abs(slip).max(), 1e-3)
        np.testing.assert_allclose(rate, slip, atol=1e-5 * scale)
        step = np.abs(np.diff(coordinate)).max()
        assert step <= 3 * np.abs(slip).max() * (q[1] - q[0]) + 1e-9  # no jump of a turn


def test_a_document_has_the_same_coordinates_with_its_own_signs():
    mech = bm.Linkage.load(JOINTS / "slider_crank.json").compile()
    run = mech.run(at=np.linspace(0.0, 7.0, 30), rates=1.0, want=["joint.*.coordinate", "*.p"])
    O, A, B = (run.unwrapped(f"joint.{x}.coordinate") for x in "OAB")
    np.testing.assert_allclose(np.diff(O + A + B), 0.0, atol=1e-12)  # the piston never turns
    coordinate = run["joint.cylinder.coordinate"]
    np.testing.assert_allclose(np.diff(coordinate), np.diff(run["link.piston.p"].real), atol=1e-12)


def test_instant_centres_of_a_four_bar_are_where_its_links_cross():
    mech = mechanism("ruiz_fourbar")
    q = np.linspace(0.3, 6.0, 40)
    run = mech.run(at=q, want=["*.p"])
    A, D, B, C = (run[f"{x}.p"] for x in ("frame.A", "frame.D", "dyad.B", "dyad.C"))
    pole = mech.instant_centre("dyad.i", at=q)
    for start, end in ((A, B), (D, C)):  # on the line of the crank, and of the rocker
        off = (np.conj(end - start) * (pole - start)).imag
        assert np.abs(off / (np.abs(end - start) * np.abs(pole - start))).max() < 1e-11
    # Aronhold and Kennedy: the centre of crank and rocker lies on AD and on BC.
    pole = mech.instant_centre("dyad.j", "crank.crank", at=q)
    for start, end in ((A, D), (B, C)):
        off = (np.conj(end - start) * (pole - start)).imag
        assert np.abs(off / (np.abs(end - start) * np.abs(pole - start))).max() < 1e-10
    np.testing.assert_allclose(mech.instant_centre("crank.crank", at=q), A, atol=1e-12)
    ratio = mech.velocity_ratio("dyad.j", "crank", at=q)
    np.testing.assert_allclose(ratio, np.abs((pole - A) / (pole - D)), rtol=1e-9)
    advantage = mech.mechanical_advantage("dyad.j", "crank", at=q)
    np.testing.assert_allclose(advantage * ratio, 1.0, rtol=1e-12)


def test_a_slider_has_a_force_ratio():
    """A moment of 1 N m at the crank balances a force on the piston that does the same work."""
    m = bm.Linkage("slider_crank")
    for name in ("crank", "rod", "piston"):
        m.add_link(name)
    m.add_joint("O", "R", ["frame", "crank"], point=(0.0, 0.0))
    m.add_joint("A", "R", ["crank", "rod"], point=(0.06, 0.0))
    m.add_joint("B", "R", ["rod", "piston"], point=(0.26, 0.0))
    m.add_joint("G", "P", ["frame", "piston"], point=(0.26, 0.0))
    m.add_driver("motor", "O")
    m.add_load("gas", "force", link="piston", at=(0.26, 0.0), force=(-1.0, 0.0))
    mech, q = m.compile(), np.array([0.4, 1.3, 4.0])
    drive = np.abs(mech.run(at=q, want="driver.motor.drive", static=True)["driver.motor.drive"])
    for piston in ("piston", "joint.B", "joint.B.p.x", "joint.G.coordinate"):
        np.testing.assert_allclose(mech.mechanical_advantage(piston, "motor", at=q), 1 / drive)
        np.testing.assert_allclose(mech.velocity_ratio(piston, "motor", at=q), drive)
    rod = mech.run(at=q, rates=1.0, want="link.rod.omega")["link.rod.omega"]
    np.testing.assert_allclose(mech.velocity_ratio("rod", "link.crank.angle", at=q), np.abs(rod))
    with pytest.raises(RequestError, match='no moving link, point or driver "pistn"'):
        mech.velocity_ratio("pistn", "motor", at=q)


def test_radii_of_paths():
    crank = mechanism("ruiz_fourbar")
    np.testing.assert_allclose(crank.path_radius("dyad.B", at=[0.3, 2.0]), 2.0, rtol=1e-12)
    straight = mechanism("slider_crank")
    assert np.isinf(straight.path_radius("piston.C", at=[0.3, 2.0])).all()
    q, h = 1.1, 1e-3
    a, b, c = crank.run(at=[q - h, q, q + h], want="dyad.S.p")["dyad.S.p"]
    area = ((b - a).conjugate() * (c - a)).imag / 2
    circle = abs(b - a) * abs(c - b) * abs(c - a) / (4 * area)
    assert crank.path_radius("dyad.S", at=q)[0] == pytest.approx(circle, rel=1e-5)


def test_what_is_none_is_refused():
    mech = mechanism("ruiz_fourbar")
    with pytest.raises(RequestError, match=r"dyad\.k"):
        mech.instant_centre("dyad.k", at=0.3)
    with pytest.raises(RequestError, match="2 drivers"):
        mechanism("fivebar_falling").velocity_ratio("dyad.i", "dyad.j", at=0.3)


def test_whole_and_share_of_what_is_reduced_have_texts_that_nobody_mixes_up():
    outputs = bm.Graph.load(GRAPHS / "watt_sixbar.json").compile().outputs
    assert "of the whole mechanism" in outputs["crank.J_red"].about
    assert outputs["first.J_red"].about.startswith("share of this block in crank.J_red")
