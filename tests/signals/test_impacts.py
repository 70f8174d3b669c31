"""Signals go on through blows, and while a driver lies against its stop."""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from blockmech import signals
from blockmech.loads import laws
from tests.independent.controlled import Stopped
from tests.machines import wire
from tests.signals.machines import flywheel

ROWS = {"arguments": [0.0, 1.0, 2.0, 3.0, 4.0, 9.0], "values": [2.0, 2.0, -1.0, -1.0, 3.0, 3.0]}
WANT = ["wheel.q", "wheel.rate", "pid.integral", "motor.current"]
WIRES = [
    *(("setpoint.y", "error.u0"), ("wheel.q", "error.u1"), ("error.y", "pid.u")),
    *(("pid.y", "motor.u"), ("wheel.rate", "motor.rate"), ("motor.moment", "drive.law")),
]


def led(restitution, sample=None):
    """A wheel whose angle a controller leads against a stop, and away from it again."""
    limits = {} if sample is None else {"limits": (-20.0, 20.0), "sample": sample}
    blocks = {
        "setpoint": signals.Table(interpolation="linear", **ROWS),
        "error": signals.Sum(signs="+-"),
        "pid": signals.Pid(kp=8.0, ki=6.0, **limits),
        "motor": signals.DCMotor(R=1.0, L=0.1, k=1.5),
    }
    g = flywheel(blocks, WIRES)
    g.add_stop("wheel", high=1.0, restitution=restitution)
    return g


@pytest.mark.parametrize("method", ["dop853", "radau"])
@pytest.mark.parametrize("sample", [None, 0.05])
def test_a_controlled_wheel_bounces_lies_and_leaves_as_by_another_integration(method, sample):
    """Bouncing, behind its first rest at the stop and, by one method, behind its second one."""
    times = [0.7, 2.5, 5.5] if method == "dop853" else [0.7, 2.5]
    expected = [Stopped(0.3, sample).run(t) for t in times]
    mech = led(0.3, sample).compile()
    r = mech.simulate(f"time={times[-1]}", times=times, want=WANT, method=method)
    assert r.motion.end == "time"
    states = np.transpose([r[name] for name in WANT])
    np.testing.assert_allclose(states, [state for state, _ in expected], rtol=1e-9, atol=1e-9)
    impacts = np.array([i.t for i in r.motion.impacts])
    for t, (_, blows) in zip(times, expected, strict=True):
        np.testing.assert_allclose(impacts[impacts < t][:7], blows[:7], rtol=1e-9)
    separations = [e.t for e in r.motion.events if e.kind == "leaves its stop"]
    counts = [
        (sum(at < t for at in separations), sum(x.begin < t for x in r.motion.lying)) for t in times
    ]
    assert counts == [(0, 0), (1, 1), (1, 2)][: len(times)]


def test_states_along_a_bouncing_motion_are_those_of_each_flight():
    t = np.array([0.4, 0.6, 0.85, 1.4, 1.9])
    r = led(0.3).compile().simulate("time=2", times=t, want=[*WANT, "wheel.acceleration"])
    expected = np.array([Stopped(0.3).run(x)[0] for x in t])
    np.testing.assert_allclose(np.array([r[n] for n in WANT]).T, expected, rtol=1e-9, atol=1e-9)
    pull = 1.5 * expected[:, 3] / 2.0
    np.testing.assert_allclose(r["wheel.acceleration"], pull * (t != 1.4), rtol=1e-8)


def test_a_controller_that_switches_pulls_the_wheel_off_its_stop_and_counts_once():
    blocks = {"pull": signals.Table(**{**ROWS, "interpolation": "linear"})}
    blocks |= {"hold": signals.Pid(kp=4.0, ki=1.0, sample=0.25)}
    g = flywheel(blocks, [("pull.y", "hold.u"), ("hold.y", "drive.law")])
    g.start("wheel", 1.0, 0.0)
    g.add_stop("wheel", high=1.0, restitution=0.0)
    r = g.compile().simulate("time=3", want=["hold.integral", "hold.y"])
    integral, forces, separation = 0.0, [], None
    for k in range(12):  # the instants before 3 s
        u = np.interp(0.25 * k, ROWS["arguments"], ROWS["values"])
        forces.append(4 * u + integral)
        separation = 0.25 * k if separation is None and forces[-1] < 0 else separation
        integral += 0.25 * u
    assert r["hold.integral"][-1] == pytest.approx(integral, rel=1e-12)
    (leaves,) = [e.t for e in r.motion.events if e.kind == "leaves its stop"]
    assert leaves == pytest.approx(separation, abs=1e-12)


@pytest.mark.parametrize("restitution", [None, 0.0])
def test_a_current_that_begins_at_nothing_does_not_push_through_a_stop(restitution):
    g = led(restitution)
    g.start("wheel", 1.0 - 1e-15, 0.0)
    r = g.compile().simulate("time=0.5", want=WANT)
    assert r.motion.end == ("time" if restitution == 0.0 else "end stop")
    assert r["wheel.q"][-1] == pytest.approx(1.0, abs=1e-14)
    if restitution == 0.0:  # at rest: e = 1, u = 8 + 6 t, L i' = u - R i
        expected = 8 + 6 * 0.5 - 0.6 * (1 - np.exp(-5.0)) - 8 * np.exp(-5.0)
        assert r["motor.current"][-1] == pytest.approx(expected, rel=1e-9)


def test_with_several_drivers_signals_go_on_as_with_one():
    result = led(0.3).compile().simulate("time=2.5", want=WANT)
    g = led(0.3)
    g.blocks["frame"] = bm.Frame(markers={"A": (0.0, 0.0), "E": (1.0, 0.0)})
    g.add("other", bm.Crank(links={"crank": bm.Link(inertia=3.0)}))
    g.connect("frame.E", "other.A")
    g.add("turn", bm.Motor(law=laws.Signal()))
    wire(g, "frame.E turn.a", "other.crank turn.b", "pid.integral turn.law")
    g.start("other")
    two = g.compile().simulate("time=2.5", want=[*WANT, "other.rate"])
    for name in WANT:
        assert two[name][-1] == pytest.approx(result[name][-1], rel=1e-9, abs=1e-9)
    t = np.linspace(0.0, 2.5, 1001)
    run = g.compile().simulate("time=2.5", times=t, want=["pid.integral"])
    spline = np.trapezoid(run["pid.integral"], t) / 3.0
    assert two["other.rate"][-1] == pytest.approx(spline, rel=1e-4)


def test_signals_that_no_load_follows_are_integrated_whatever_the_method():
    g = flywheel({"way": signals.Integrator()}, [("wheel.rate", "way.u")], load=False)
    g.start("wheel", 0.5, 2.0)
    r = g.compile().simulate("time=2", want=["wheel.q", "way.integral"])
    assert r["way.integral"][-1] == pytest.approx(r["wheel.q"][-1] - 0.5, rel=1e-10)
    with pytest.raises(bm.RequestError, match="the loads depend on state"):
        g.compile().simulate("time=2", method="energy")
