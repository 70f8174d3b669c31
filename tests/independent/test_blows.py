"""Blows on stops of a slider's way and of a pin's angle, against maximal coordinates."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from tests.independent.blows import CENTRE, GUIDE, INERTIA, MASS, L, R, slider_crank_blow

E = 0.4
STOPS = {"rod.S.coordinate": {"high": 0.38}, "rod.C.coordinate": {"low": 0.1, "high": 0.3}}


def machine(name, restitution=E, **bounds):
    crank, rod, slider = (
        bm.Link(mass=m, inertia=j, cm=c) for m, j, c in zip(MASS, INERTIA, CENTRE, strict=True)
    )
    g = bm.Graph("slider crank")
    g.add("frame", bm.Frame(markers={"A": (0, 0), "G": {"at": (0, GUIDE), "angle": 0.0}}))
    g.add("crank", bm.Crank(length=R, links={"crank": crank}))
    g.add("rod", bm.RRP(l=L, links={"i": rod, "j": slider}))
    g.add("moment", bm.Couple(moment=-3.0))
    for ends in ("frame.A crank.A", "crank.B rod.B", "frame.G rod.S", "crank.crank moment.on"):
        g.connect(*ends.split())
    g.start("crank", q=1.2)
    g.stop(name, restitution=restitution, **bounds)
    return g


@pytest.mark.parametrize("method", ["energy", "dop853"])
@pytest.mark.parametrize("name", STOPS)
def test_impulses_of_a_stop_of_a_slider_or_a_pin_are_those_of_momentum(name, method):
    mech = machine(name, **STOPS[name]).compile()
    motion = mech.simulate("time=0.3", method=method).motion
    blow = motion.impacts[0]
    place = mech.run(at=blow.q, want=[name])[name][0]
    assert min(abs(place - x) for x in STOPS[name].values()) < 1e-13
    wanted = slider_crank_blow(blow.q[0], blow.before[0], E, pin=name.startswith("rod.C"))
    found = mech.impulses(blow)
    size = abs(wanted["P"])
    assert blow.driver == name
    assert blow.impulse == pytest.approx(wanted["P"], rel=1e-9)
    assert blow.after[0] - blow.before[0] == pytest.approx(wanted["jump"], rel=1e-9)
    pairs = {"crank.A": "A", "rod.B": "B", "rod.C": "C"}
    for pair, key in pairs.items():
        assert abs(found[f"{pair}.reaction"] - wanted[key]) <= 1e-9 * size, pair
    assert found["rod.S.N"] == pytest.approx(wanted["N"], abs=1e-9 * size)
    assert found["rod.S.C"] == pytest.approx(wanted["C_guide"], abs=1e-9 * size)
    assert abs(found["crank.drive"]) <= 1e-12 * size


def test_path_and_time_agree_on_a_stop_of_a_slider():
    mech = machine("rod.S.coordinate", high=0.38).compile()
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
    motion = machine("rod.S.coordinate", None, high=0.38).compile().simulate("time=1").motion
    assert motion.end == "end stop"
    assert motion.impacts == ()


def test_what_cannot_be_is_one_message():
    g = machine("rod.S.coordinate", low=0.36)
    with pytest.raises(bm.RequestError, match=r"start-outside-stops.*rod\.S\.coordinate"):
        g.compile().simulate("time=1")
    with pytest.raises(bm.GraphError, match="unknown-driver"):
        machine("rod.X.coordinate", low=0.36).compile()
    two = machine("rod.S.coordinate", high=0.38)
    two.add("other", bm.Crank(length=0.1, links={"crank": bm.Link(inertia=1.0)}))
    two.connect("frame.A", "other.A")
    two.start("other")
    with pytest.raises(bm.RequestError, match="of several drivers each has stops of its own"):
        two.compile().simulate("time=1")
