"""The moment or force at another place than the driver, that stands for its drive."""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import GRAPHS

FOURBAR = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").compile()
PRESS = bm.Linkage.load(GRAPHS / "joints/slider_crank.json").compile()
Q = np.array([0.4, 1.3, 2.2, 4.0])
SMOOTH = {"friction": "none"}


def speeds(mechanism, *names):
    """Rates (n,) of outputs at unit rate of the driver: virtual velocities."""
    return [
        mechanism.run(Q, rates=1.0, accelerations=0.0, want=name, **SMOOTH)[name] for name in names
    ]


def test_moment_at_a_pin_does_the_work_of_the_drive():
    """M w = T q' at any rate, w the rate of the second link against the first."""
    (omega,) = speeds(FOURBAR, "dyad.j.omega")  # D joins link j to the frame
    drive = FOURBAR.run(Q, want="crank.drive", **SMOOTH)["crank.drive"]
    moments = bm.design.available(FOURBAR, "dyad.D.moment", 0.0, Q, static=False, **SMOOTH)
    assert moments == pytest.approx(drive / omega, rel=1e-11)
    for q, moment in zip(Q, moments, strict=True):
        (solution,) = FOURBAR.solve({"crank.drive": 0.0}, to="dyad.D.moment", at=q, **SMOOTH)
        assert solution["dyad.D.moment"] == pytest.approx(moment, rel=1e-12)
        (same,) = FOURBAR.solve({"crank.drive": 0.0}, to="dyad.j.moment", at=q, **SMOOTH)
        assert same["dyad.j.moment"] == pytest.approx(moment, rel=1e-12)
    relative = np.subtract(*speeds(FOURBAR, "dyad.j.omega", "dyad.i.omega"))
    inner = bm.design.available(FOURBAR, "dyad.C.moment", 0.0, Q, static=False, **SMOOTH)
    assert inner == pytest.approx(drive / relative, rel=1e-11)


def test_slope_of_an_effort_is_the_ratio_of_speeds():
    (solution,) = FOURBAR.solve({"crank.drive": 0.0}, to="dyad.D.moment", at=Q[0], **SMOOTH)
    (omega,) = speeds(FOURBAR, "dyad.j.omega")
    assert solution.slopes[0, 0] == pytest.approx(-1 / omega[0], rel=1e-12)
    assert solution.units == {"dyad.D.moment": "N m"}


def test_force_at_a_marker_and_along_a_guide():
    v = speeds(PRESS, "link.piston.v")[0]
    drive = PRESS.run(Q, want="driver.motor.drive", **SMOOTH)["driver.motor.drive"]
    for effort in ("joint.cylinder.force", "link.piston.force.x"):
        forces = bm.design.available(PRESS, effort, 0.0, Q, static=False, **SMOOTH)
        assert forces == pytest.approx(drive / v.real, rel=1e-10)
    pressed = PRESS.run(Q[0], want="joint.B.reaction", **SMOOTH)["joint.B.reaction"][0]
    want = {"driver.motor.drive": 0.0, "joint.B.reaction.x": 0.0}
    to = ("link.piston.force.x", "link.crank.moment")
    (solution,) = PRESS.solve(want, to=to, at=Q[0], **SMOOTH)
    assert solution["link.piston.force.x"] == pytest.approx(pressed.real, rel=1e-12)


def test_friction_counts_as_well():
    """With friction of the joints the drive is zero at the moment that is found, by a run."""
    (solution,) = FOURBAR.solve({"crank.drive": 0.0}, to="dyad.D.moment", at=1.3)
    g = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    g.add("effort", bm.Couple(moment=solution["dyad.D.moment"]))
    g.connect("dyad.j", "effort.on")
    unloaded = FOURBAR.run(1.3, want="crank.drive")["crank.drive"][0]
    assert abs(g.compile().run(1.3, want="crank.drive")["crank.drive"][0]) <= 1e-9 * abs(unloaded)


@pytest.mark.parametrize("name", ["dyad.X.moment", "dyad.D.force", "nobody.force.x"])
def test_what_is_no_place_for_an_effort_is_refused(name):
    with pytest.raises(bm.RequestError, match=name.split(".")[0]):
        FOURBAR.solve({"crank.drive": 0.0}, to=name, at=1.0)
