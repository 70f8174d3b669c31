"""Coordinates of slides inside a dyad, which the block counts from the origins of its links."""

from __future__ import annotations

import cmath

import numpy as np
import pytest

import blockmech as bm

R, D, ON_SLEEVE, ON_ROD = 0.3, 1.0, 0.2, 0.5  # [m] crank, pivot of the sleeve, places on the line
START = 0.5  # [rad]
NAME = "joint.S.coordinate"


def shaper(order=1):
    """A crank whose rod passes a sleeve on a pivot; the slide's links in either order."""
    B = cmath.rect(R, START)
    line_angle = cmath.phase(D - B)
    m = bm.Linkage("shaper")
    m.add_link("crank", pose=(0.0, 0.0, START), inertia=0.1)
    m.add_link("rod", pose=(B.real, B.imag, line_angle), mass=1.0, inertia=0.05)
    m.add_link("sleeve", pose=(D, 0.0, line_angle))
    m.add_joint("A", "R", ["frame", "crank"], at=[(0.0, 0.0), (0.0, 0.0)])
    m.add_joint("B", "R", ["crank", "rod"], at=[(R, 0.0), (0.0, 0.0)])
    m.add_joint("D", "R", ["frame", "sleeve"], at=[(D, 0.0), (0.0, 0.0)])
    ends = [("sleeve", (ON_SLEEVE, 0.0)), ("rod", (ON_ROD, 0.0))][::order]
    m.add_joint("S", "P", [link for link, _ in ends], at=[at for _, at in ends])
    m.add_driver("motor", "A")
    m.start("motor", q=START, rate=2.0)
    return m


def coordinate(q, order=1):
    """From the place on the first link to that on the second, along the line."""
    return order * (ON_ROD - ON_SLEEVE - abs(D - R * np.exp(1j * np.asarray(q))))


@pytest.mark.parametrize("general", ["", "groups"])
@pytest.mark.parametrize("order", [1, -1])
def test_they_count_from_the_places_of_the_document(order, general):
    q = np.linspace(0.0, 6.0, 7)
    result = shaper(order).decompose(general).compile().run(at=q, want=NAME)
    np.testing.assert_allclose(result[NAME], coordinate(q, order), rtol=1e-13)


@pytest.mark.parametrize("order", [1, -1])
def test_their_stops_are_at_those_of_the_document(order):
    bound = float(coordinate(1.2, order))
    linkage = shaper(order)
    linkage.add_stop(NAME, **{"high" if bound > coordinate(START, order) else "low": bound})
    for mechanism in (linkage.compile(), linkage.decompose().graph.compile()):
        motion = mechanism.simulate("time=2").motion
        assert motion.end.startswith("end stop")
        assert motion.q_end == pytest.approx(1.2, rel=1e-10)


def test_their_derivatives_by_the_places():
    derivatives = shaper().compile().sensitivity(NAME, "joints.S.at*.x", at=[1.0])
    assert list(derivatives.parameters) == ["joints.S.at[0].x", "joints.S.at[1].x"]
    np.testing.assert_allclose(derivatives[NAME], [[-1.0], [1.0]], rtol=1e-12)


def test_signals_read_them():
    linkage = shaper()
    linkage.add_signal("gain", "gain", k=1.0)
    linkage.add_load("nothing", "motor", joint="A", law={"kind": "signal"})
    linkage.add_signal("none", "gain", k=0.0)
    linkage.connect(NAME, "gain.u")
    linkage.connect("gain.y", "none.u")
    linkage.connect("none.y", "nothing.law")
    result = linkage.compile().simulate("time=0.5", want=["gain.y", "driver.motor.q"])
    np.testing.assert_allclose(result["gain.y"], coordinate(result["driver.motor.q"]), rtol=1e-12)


def test_a_driver_there_counts_so_where_another_joint_leads():
    """Where crank and line are in line the driven slide stands still, and the crank leads."""
    linkage = shaper()
    drivers = {"drivers": {"push": {"joint": "S"}}, "initial": {}}
    driven = bm.Linkage.from_data(linkage.to_data() | drivers)
    slip = linkage.compile().run(at=[START], rates=2.0, want="joint.S.slip")["joint.S.slip"]
    driven.start("push", q=float(coordinate(START)), rate=float(slip[0]))
    want, times = ["link.crank.angle", "driver.push.q", NAME], np.linspace(0.0, 3.0, 13)
    result = driven.compile().simulate(times=times, want=want, accuracy=1e-10)
    assert ("A",) in [joints for _, joints in result.motion.charts]
    crank = linkage.compile().simulate(times=times, want=want[:1], accuracy=1e-10)[want[0]]
    assert np.abs(np.exp(1j * result[want[0]]) - np.exp(1j * crank)).max() < 1e-8
    for name in want[1:]:
        np.testing.assert_allclose(result[name], coordinate(crank), atol=1e-8)
