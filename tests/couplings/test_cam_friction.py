"""Friction between cam and follower, against statics of the follower and power.

A knife that rises along y, e beside the cam's centre, with n at the pressure angle a from y:
W = N (cos a - f mu sin a), f the sense of friction along the profile, which the cam turns by at
|z'| = hypot(y, s' - e), a roller's radius less where a roller touches; a flat face passes at h.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.model.meshing import coupling_numbers, sides
from tests.machines import wire

RISE, OVER, MU, WEIGHT, E = 0.01, 1.6, 0.15, 100.0, 0.005
LIFT = {
    "kind": "segments",
    "segments": [
        {"motion": "4-5-6-7", "over": OVER, "rise": RISE},
        {"motion": "dwell", "over": 0.5},
        {"motion": "cycloidal", "over": OVER, "rise": -RISE},
    ],
}
SHAPES = {
    "knife": {"follower": "knife"},
    "roller": {"follower": "roller", "roller": 0.012},
    "flat": {"follower": "flat"},
}


def valve(friction=MU, **cam):
    g = bm.Graph("valve")
    guide = bm.Marker(at=(E, 0.0), dir=(0.0, 1.0))
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "G": guide}))
    g.add("shaft", bm.Crank(links={"crank": bm.Link(inertia=1e-4)}))
    g.add("valve", bm.SlideDrive(links={"slider": bm.Link(mass=0.3)}))
    g.add("load", bm.Force(force=(0.0, -WEIGHT)))
    fields = {"law": LIFT, "phase": 0.05, "friction": friction} | cam
    g.add("cam", bm.Cam(driver="shaft", driven="valve", **fields))
    return wire(g, "frame.A shaft.A", "frame.G valve.S", "valve.slider load.at")


def rocker(friction=MU, **cam):
    """A lever on the cam, its tip or face left of its pivot."""
    g = bm.Graph("rocker")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "B": (0.08, 0.03)}))
    g.add("shaft", bm.Crank(links={"crank": bm.Link(inertia=1e-4)}))
    g.add("valve", bm.Crank(links={"crank": bm.Link(inertia=1e-3)}))
    g.add("load", bm.Couple(moment=3.0))
    turned = [s | {"rise": -8 * s["rise"]} if "rise" in s else s for s in LIFT["segments"]]
    law = LIFT | {"segments": turned}
    fields = {"law": law, "phase": 0.05, "friction": friction, "at": (-0.06, 0.01)} | cam
    g.add("cam", bm.Cam(driver="shaft", driven="valve", **fields))
    return wire(g, "frame.A shaft.A", "frame.B valve.A", "valve.crank load.on")


MACHINES = {f"valve {name}": valve(**shape) for name, shape in SHAPES.items()}
MACHINES |= {f"rocker {x}": rocker(**SHAPES[x]) for x in ("knife", "roller")}
MACHINES["rocker flat"] = rocker(follower="flat", at=(-0.06, 0.03), face=math.pi / 2)


@pytest.mark.parametrize("rate", [3.0, -3.0])
@pytest.mark.parametrize("name", SHAPES)
def test_a_valve_is_pushed_and_turned_as_statics_say(name, rate):
    q = np.array([0.3, 0.7, 1.1])
    u = q / OVER
    s = RISE * (35 * u**4 - 84 * u**5 + 70 * u**6 - 20 * u**7)
    ds = RISE / OVER * (140 * u**3 - 420 * u**4 + 420 * u**5 - 140 * u**6)
    y, r = 0.05 + s, SHAPES[name].get("roller", 0.0)
    size = np.hypot(y, ds - E)
    cos, sin = (1.0, 0.0) if name == "flat" else (y / size, (ds - E) / size)
    passing = y if name == "flat" else size - r
    push = WEIGHT / (cos - np.sign(rate) * MU * sin)
    run = valve(**SHAPES[name]).run(at=q, rates=rate, static=True)
    np.testing.assert_allclose(run["cam.contact"], push, rtol=1e-12)
    np.testing.assert_allclose(run["cam.loss"], MU * push * passing * abs(rate), rtol=1e-12)
    drive = WEIGHT * ds + MU * push * passing * np.sign(rate)
    np.testing.assert_allclose(run["shaft.drive"], drive, rtol=1e-12)
    np.testing.assert_allclose(run["mechanism.friction_power"], run["cam.loss"], rtol=1e-15)


@pytest.mark.parametrize("name", MACHINES)
def test_forces_on_every_link_balance_and_power_goes_where_it_should(name):
    mech = MACHINES[name].compile()
    for rate in (3.0, -3.0):
        ask = {"at": [0.4, 2.9], "rates": rate, "accelerations": 7.0}
        assert mech.verify(**ask).ok
        run, ideal = mech.run(**ask), mech.run(**ask, friction="none")
        lost_power = (run["shaft.drive"] - ideal["shaft.drive"]) * rate
        np.testing.assert_allclose(lost_power, run["cam.loss"], rtol=1e-9)
        assert (run["cam.loss"] > 0).all()


@pytest.mark.parametrize("name", MACHINES)
def test_the_speed_at_the_contact_is_differentiated(name):
    structure = MACHINES[name].compile().structure
    kernel = structure.couplings["cam"].touch(structure.coupled_pair("cam"))
    speeds, p, h = sides(structure, "cam"), coupling_numbers(structure, "cam"), 1e-5
    for x in (0.4, 0.9, 2.9):
        low, at, high = (kernel(speeds(x + d), p) for d in (-h, 0.0, h))
        assert (high.slip - low.slip) / (2 * h) == pytest.approx(at.slope, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", ["valve knife", "rocker roller"])
def test_a_shaft_that_runs_down_stops_alike_by_both_integrators(name):
    g = MACHINES[name]
    g.start("shaft", q=0.2, rate=20.0)
    mech = g.compile()
    implicit, explicit = (mech.simulate("time=0.1", method=m).motion for m in ("radau", "dop853"))
    assert implicit.q_end == pytest.approx(explicit.q_end, abs=1e-8)
    assert implicit.facts["friction_work"] == pytest.approx(
        explicit.facts["friction_work"], rel=1e-8
    )
    assert implicit.qd_end == pytest.approx(0.0, abs=1e-12)  # friction holds it on the rise


def test_a_follower_jams_where_friction_leaves_no_normal_force():
    """cos a <= mu sin a, on the rise alone."""
    mech = valve(friction=12.0).compile()
    marked = mech.run(at=[0.7], rates=1.0, on_gap="mark")
    assert np.isnan(marked["shaft.drive"][0])
    assert mech.run(at=[0.7], rates=-1.0)["cam.contact"][0] > 0
    assert not mech.friction_solutions(at=[0.7], rates=1.0)["shaft.drive"].size
