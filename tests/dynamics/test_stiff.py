"""Stiff motions: Radau's method as machine code against closed forms, DOP853 and SciPy's."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech import signals
from tests.dynamics.test_friction_laws import HANGING, pendulum
from tests.dynamics.test_friction_states import lugre
from tests.machines import wire
from tests.signals.machines import compiled, data_of, flywheel

pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")


def motor(L, R=0.5, k=0.2, u=12.0, inertia=0.1):
    """A wheel on a motor under a constant voltage; its (angle, rate, current) at a time, exactly.

    J w' = k i and L i' = u - R i - k w are linear, with two real eigenvalues.
    """
    blocks = {"volts": signals.Constant(value=u), "motor": signals.DCMotor(R=R, L=L, k=k)}
    wires = ["volts.y motor.u", "wheel.rate motor.rate", "motor.moment drive.law"]
    mech = flywheel(blocks, [x.split() for x in wires], inertia=inertia).compile()
    half, product = R / L / 2, k * k / (inertia * L)
    fast = -half - math.sqrt(half * half - product)
    slow, final = product / fast, u / k

    def exact(t):
        e, s, apart = math.exp(fast * t), math.exp(slow * t), fast - slow
        angle = final * (t - (fast / slow * (s - 1) - slow / fast * (e - 1)) / apart)
        rate = final * (1 - (fast * s - slow * e) / apart)
        return angle, rate, inertia / k * final * fast * slow * (e - s) / apart

    return mech, exact


@pytest.mark.parametrize(
    ("engine", "L", "accuracy"),
    [("scalar", 1e-3, 1e-4), ("llvm", 1e-3, 1e-9), ("llvm", 1e-7, 1e-4), ("llvm", 1e-7, 1e-9)],
)
def test_a_motor_with_little_inductance(engine, L, accuracy):
    mech, exact = motor(L)
    t = np.array([0.1 * L, 3 * L, 0.01, 0.7, 2.0])
    run = mech.simulate(
        "time=2", times=t, method="radau", engine=engine, accuracy=accuracy,
        want=["wheel.q", "wheel.rate", "motor.current"],
    )  # fmt: skip
    angle, rate, current = (np.array(x) for x in zip(*map(exact, t), strict=True))
    assert run.motion.error <= accuracy
    assert np.abs(run["wheel.q"] - angle).max() <= run.motion.error
    assert np.abs(run["wheel.rate"] - rate).max() <= 100 * accuracy
    assert np.abs(run["motor.current"] - current).max() <= 1000 * accuracy
    assert run.motion.cost.states < 40_000  # stable steps of an explicit method take 1e7 / 3


def oil(mass):
    """A mass in oil on a spring that hardens, under a constant force."""
    g = bm.Graph("oil")
    g.add("frame", bm.Frame(markers={"O": bm.Marker(at=(0.0, 0.0), angle=0.0)}))
    g.add("mass", bm.SlideDrive(links={"slider": bm.Link(mass=mass, inertia=1.0)}))
    g.connect("frame.O", "mass.S")
    lines = {"rate": [0.0, -1.0], "coordinate": [1.0, -2.0, 0.0, -5.0]}
    for of, numbers in lines.items():
        g.add(of, bm.Thrust(law={"kind": "polynomial", "of": of, "coefficients": numbers}))
        wire(g, f"frame.O {of}.a", f"mass.slider {of}.b")
    g.start("mass", -0.5, 3.0)
    return g.compile()


STIFF = {
    "oil": (lambda: oil(1e-3), "time=1"),
    "bristles": (lambda: pendulum(lugre(1e4)), "time=1"),
    "control": (lambda: compiled(data_of("speed_controlled_fourbar")), "time=0.5"),
}


@pytest.mark.parametrize("name", STIFF)
@pytest.mark.parametrize("accuracy", [1e-5, 1e-8])
def test_an_explicit_method_agrees_on_places_and_events(name, accuracy):
    make, until = STIFF[name]
    mech, start = make(), {"crank": (2.0 + HANGING, 0.0)} if name == "bristles" else None
    times = np.linspace(0.0, float(until[5:]), 57)[:-1]
    how = {"times": times, "engine": "llvm", "start": start, "want": [f"{mech.drivers[0]}.q"]}
    truth = mech.simulate(until, method="dop853", accuracy=1e-10, **how)
    run = mech.simulate(until, method="radau", accuracy=accuracy, **how)
    (other, q), error = (x[how["want"][0]] for x in (truth, run)), run.motion.error
    assert error <= accuracy
    assert np.abs(q - other).max() <= error + truth.motion.error
    assert [e.kind for e in run.motion.events] == [e.kind for e in truth.motion.events]
    for one, same in zip(run.motion.events, truth.motion.events, strict=True):
        assert one.t == pytest.approx(same.t, abs=1e2 * accuracy)


def test_what_is_stiff_is_seen_early_and_left_to_radau():
    mech, exact = motor(1e-7)
    motion = mech.simulate("time=2", want=[]).motion
    assert (motion.method, motion.end) == ("radau", "time")
    assert "it is stiff" in motion.why
    assert motion.cost.states < 120_000  # of half a million that are allowed
    assert abs(motion.q_end - exact(2.0)[0]) <= motion.error


def test_what_is_stiff_is_left_to_radau_whatever_the_goal():
    mech = pendulum(lugre(1e5))
    start = {"crank": (2.0 + HANGING, 0.0)}
    motion = mech.simulate("swings=1", want=[], start=start, engine="llvm", accuracy=1e-6).motion
    assert (motion.method, motion.end, motion.status) == ("radau", "swings", "reached")
    assert [e.kind for e in motion.events] == ["standstill"]
    how = {"method": "radau", "accuracy": 1e-8, "engine": "llvm"}
    timed = mech.simulate("time=1.5", want=[], start=start, **how).motion
    assert abs(timed.events[0].t - motion.t_end) <= motion.time_error + 1e-8
