"""Blows on stops of a slider's way and of a pin's angle, against maximal coordinates."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from tests import machines
from tests.independent.blows import (
    CENTRE,
    GUIDE,
    INERTIA,
    MASS,
    PLACES,
    TURNING,
    WEIGHT,
    L,
    R,
    five_bar_blow,
    slider_crank_blow,
)

E = 0.4
STOPS = {"dyad.S.coordinate": {"high": 0.38}, "dyad.C.coordinate": {"low": 0.1, "high": 0.3}}


def machine(name, restitution=E, **bounds):
    rows = zip(MASS, INERTIA, CENTRE, strict=True)
    bodies = [bm.Link(mass=m, inertia=j, cm=c) for m, j, c in rows]
    graph = machines.slider_crank(R, L, GUIDE, bodies)
    machines.load(graph, "moment", bm.Couple(moment=-3.0), on="crank.crank")
    graph.start("crank", q=1.2)
    graph.add_stop(name, restitution=restitution, **bounds)
    return graph


@pytest.mark.parametrize("method", ["energy", "dop853"])
@pytest.mark.parametrize("name", STOPS)
def test_impulses_of_a_stop_of_a_slider_or_a_pin_are_those_of_momentum(name, method):
    mech = machine(name, **STOPS[name]).compile()
    motion = mech.simulate("time=0.3", method=method).motion
    blow = motion.impacts[0]
    place = mech.run(at=blow.q, want=[name])[name][0]
    assert min(abs(place - x) for x in STOPS[name].values()) < 1e-13
    expected = slider_crank_blow(blow.q[0], blow.before[0], E, pin=name.startswith("dyad.C"))
    impulses = mech.impulses(blow)
    size = abs(expected["P"])
    assert blow.driver == name
    assert blow.impulse == pytest.approx(expected["P"], rel=1e-9)
    assert blow.after[0] - blow.before[0] == pytest.approx(expected["jump"], rel=1e-9)
    pairs = {"crank.A": "A", "dyad.B": "B", "dyad.C": "C"}
    for pair, key in pairs.items():
        assert abs(impulses[f"{pair}.reaction"] - expected[key]) <= 1e-9 * size, pair
    assert impulses["dyad.S.N"] == pytest.approx(expected["N"], abs=1e-9 * size)
    assert impulses["dyad.S.C"] == pytest.approx(expected["C_guide"], abs=1e-9 * size)
    assert abs(impulses["crank.drive"]) <= 1e-12 * size


def test_path_and_time_agree_on_a_stop_of_a_slider():
    mech = machine("dyad.S.coordinate", high=0.38).compile()
    times = np.linspace(0.0, 0.5, 26)
    runs = [mech.simulate("time=0.5", method=m, times=times) for m in ("energy", "dop853")]
    assert np.abs(runs[0]["crank.q"] - runs[1]["crank.q"]).max() < 1e-8
    assert len(runs[0].motion.impacts) == len(runs[1].motion.impacts)
    last = runs[0].motion
    assert math.isfinite(last.facts["rest_time"])
    # at rest against its stop: 3 N m of the moment over the slider's way per radian
    slope = -R * math.sin(last.q_end) + R * math.cos(last.q_end) * math.tan(rod(last.q_end))
    assert last.facts["contact"] == pytest.approx(3.0 / slope, rel=1e-9)


def rod(q):
    """Angle [rad] of the rod."""
    return math.asin((GUIDE - R * math.sin(q)) / L)


def test_without_a_restitution_a_motion_ends_at_the_stop():
    motion = machine("dyad.S.coordinate", None, high=0.38).compile().simulate("time=1").motion
    assert motion.end == "end stop"
    assert motion.impacts == ()


def test_what_cannot_be_is_one_message():
    g = machine("dyad.S.coordinate", low=0.36)
    with pytest.raises(bm.RequestError, match=r"start-outside-stops.*dyad\.S\.coordinate"):
        g.compile().simulate("time=1")
    with pytest.raises(bm.GraphError, match="unknown-driver"):
        machine("dyad.X.coordinate", low=0.36).compile()
    two = machine("dyad.S.coordinate", low=0.36)
    two.add("other", bm.Crank(length=0.1, links={"crank": bm.Link(inertia=1.0)}))
    two.connect("frame.A", "other.A")
    two.start("other")
    with pytest.raises(bm.RequestError, match=r"start-outside-stops.*dyad\.S\.coordinate"):
        two.compile().simulate("time=1")


# -- several drivers ------------------------------------------------------------------------------

ARM = 0.02  # [m] of friction in all pins
ANGLES = {
    "left": ((None, 0), {"high": 1.35}),
    "right": ((None, 1), {"high": 2.88}),
    "dyad.B.coordinate": ((0, 2), {"low": -0.78}),
    "dyad.C.coordinate": ((2, 3), {"high": 0.55}),
}


def five_bar(name, restitution, arm=0.0, **bounds):
    """The five-bar of `blows`, falling from rates, with a stop of some angle."""
    rows = zip(WEIGHT, TURNING, PLACES, strict=True)
    bodies = [bm.Link(mass=m, inertia=j, cm=c) for m, j, c in rows]
    pin = bm.friction.Coulomb(coefficient=arm, radius=1.0)
    pins = dict.fromkeys(("left", "right", "dyad"), pin) if arm else None
    graph = machines.fivebar(1.0, 2.0, 2.0, bodies, pins, gravity=9.81)
    graph.start("left", q=1.2, rate=0.5)
    graph.start("right", q=2.2, rate=1.5)
    graph.add_stop(name, restitution=restitution, **bounds)
    return graph


@pytest.mark.parametrize(("e", "arm"), [(0.5, 0.0), (0.0, ARM), (0.5, ARM)])
@pytest.mark.parametrize("name", ANGLES)
def test_blows_on_any_angle_of_a_five_bar_are_those_of_momentum(name, e, arm):
    links, bounds = ANGLES[name]
    mech = five_bar(name, e, arm, **bounds).compile()
    blow = mech.simulate("time=0.45", accuracy=1e-3).motion.impacts[0]
    expected = five_bar_blow(blow.q, blow.before, e, links, arm)
    size = abs(expected["P"])
    assert blow.driver == name
    assert blow.pushes[name] == pytest.approx(expected["P"], rel=1e-12)
    assert (
        np.abs(blow.after - blow.before - expected["jump"]).max() <= 1e-12 * abs(blow.before).max()
    )
    impulses = mech.impulses(blow)
    pairs = {"left.A": "A", "right.A": "E", "dyad.B": "B", "dyad.C": "C", "dyad.D": "D"}
    for pair, key in pairs.items():
        assert abs(impulses[f"{pair}.reaction"] - expected["pins"][key]) <= 1e-12 * size, pair
    if arm:
        assert np.abs([*blow.friction.values()] - expected["T"]).max() <= 1e-12 * size
    for driver in ("left", "right"):
        given = blow.pushes[name] if driver == name else 0.0
        assert impulses[f"{driver}.drive"] == pytest.approx(given, abs=1e-12 * size)
