"""Signals and joint friction: states go on while the driver rests, and start it again."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

import blockmech as bm
from blockmech import signals
from blockmech.ground.errors import RequestError
from blockmech.loads import laws
from tests.machines import wire
from tests.signals.machines import compiled, data_of, flywheel

J, R, L, K, U = 0.5, 2.0, 0.4, 1.5, 12.0
MASS, RADIUS, MU, G = 20.0, 0.05, 0.3, 9.81


def rubbing(blocks, wires, rate=0.0):
    """A heavy wheel on a dry pin, its moment what is wired to ``drive.law``."""
    g = flywheel(blocks, wires, start=(0.0, rate))
    g.gravity = (0.0, -G)
    friction = {"A": bm.friction.Coulomb(coefficient=MU, radius=RADIUS)}
    link = bm.Link(mass=MASS, inertia=J)
    g.blocks["wheel"] = bm.Crank(links={"crank": link}, friction=friction)
    return g.compile()


def held_moment(mech):
    """What the pin holds at rest [N m]: the law's factor times the weight."""
    idle = rubbing({"none": signals.Constant(value=0.0)}, [("none.y", "drive.law")])
    motion = idle.simulate("time=1").motion
    low, high = motion.facts["holding_low"], motion.facts["holding_high"]
    assert low == pytest.approx(-high)
    return high


def motor():
    blocks = {"volts": signals.Step(value=U), "motor": signals.DCMotor(R=R, L=L, k=K)}
    wires = [("volts.y", "motor.u"), ("wheel.rate", "motor.rate"), ("motor.moment", "drive.law")]
    return rubbing(blocks, wires)


@pytest.mark.parametrize("engine", ["scalar", "llvm"])
@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_a_current_that_rises_at_rest_starts_the_wheel(method, engine):
    mech = motor()
    breakaway = held_moment(mech)
    assert 0.1 * K * U / R < breakaway < 0.9 * K * U / R
    begin = -L / R * math.log(1 - breakaway * R / (K * U))
    t = np.array([0.5 * begin, begin + 0.1, begin + (0.2 if method == "radau" else 0.7)])
    want = ["wheel.rate", "wheel.q", "motor.current"]
    options = {"method": method, "engine": engine, "accuracy": 1e-10}
    run = mech.simulate(f"time={float(t[-1])!r}", times=t, want=want, **options)
    A = np.zeros((4, 4))  # q, w, i, 1
    A[0, 1] = 1.0
    A[1, 2:] = K / J, -breakaway / J
    A[2, 1:] = -K / L, -R / L, U / L
    start = np.array([0.0, 0.0, breakaway / K, 1.0])
    exact = [[0.0, 0.0, U / R * (1 - math.exp(-R / L * t[0]))]]
    exact += [(expm(A * (s - begin)) @ start)[:3] for s in t[1:]]
    result = np.transpose([run["wheel.q"], run["wheel.rate"], run["motor.current"]])
    assert result == pytest.approx(np.array(exact), rel=1e-8, abs=1e-9)
    assert next(event.kind for event in run.motion.events) == "rest"


def test_a_sampled_controller_lets_it_go_at_an_instant():
    # u = 1, 2, 3, ... at instants: the integral of 1 with a period of 0.1 s
    blocks = {
        "one": signals.Constant(value=10.0),
        "ramp": signals.Pid(ki=1.0, sample=0.1),
    }
    mech = rubbing(blocks, [("one.y", "ramp.u"), ("ramp.y", "drive.law")])
    breakaway = held_moment(mech)
    first = math.floor(breakaway) + 1  # the moment is k at the instant 0.1 k
    t = 0.1 * first
    run = mech.simulate(f"time={t + 0.05}", times=[t, t + 0.05], want=["wheel.rate"])
    assert run["wheel.rate"] == pytest.approx([0.0, 0.05 * (first - breakaway) / J], abs=1e-12)


def test_a_position_controller_stops_where_friction_holds_it():
    blocks = {"pd": signals.Pid(kp=-40.0, kd=-4.0, n=200.0)}
    mech = rubbing(blocks, [("wheel.q", "pd.u"), ("pd.y", "drive.law")], rate=3.0)
    breakaway = held_moment(mech)
    run = mech.simulate("time=4", want=["wheel.q", "wheel.rate", "drive.b.couple"])
    assert run["wheel.rate"][-1] == 0.0
    assert abs(run["drive.b.couple"][-1]) <= breakaway
    balance = run.motion.facts["energy_balance"]
    assert balance < 1e-9


def test_machine_code_says_the_same_of_a_controlled_linkage_that_rubs():
    data = data_of("speed_controlled_fourbar")
    pin = {"coefficient": 0.1, "radius": 0.1}
    data["blocks"]["crank"]["friction"] = {"A": pin}
    data["blocks"]["dyad"]["friction"] = {"B": pin, "D": pin}
    ends = [compiled(data).simulate("time=0.2", engine=e).motion for e in ("scalar", "llvm")]
    assert ends[0].q_end == pytest.approx(ends[1].q_end, rel=1e-12)
    assert ends[1].engine == "llvm"


def test_friction_itself_is_no_sensor_where_joints_rub():
    blocks = {"felt": signals.TransferFunction(num=[1.0], den=[0.1, 1.0])}
    mech = rubbing(blocks, [("wheel.A.friction", "felt.u"), ("felt.y", "drive.law")])
    with pytest.raises(RequestError, match=r"wheel\.A\.friction"):
        mech.simulate("time=0.1")
    assert mech.simulate("time=0.1", friction="none").motion.end == "time"


def test_signals_without_states_rub_as_a_law_does():
    by_signal = rubbing(
        {"p": signals.Gain(k=-2.0)}, [("wheel.rate", "p.u"), ("p.y", "drive.law")], 5.0
    )
    g = flywheel({}, [], load=False, start=(0.0, 5.0))
    g.gravity = (0.0, -G)
    friction = {"A": bm.friction.Coulomb(coefficient=MU, radius=RADIUS)}
    g.blocks["wheel"] = bm.Crank(links={"crank": bm.Link(mass=MASS, inertia=J)}, friction=friction)
    g.add("drive", bm.Motor(law=laws.Polynomial(of="rate", coefficients=[0.0, -2.0])))
    wire(g, "frame.A drive.a", "wheel.crank drive.b")
    ends = [m.simulate("standstill").motion for m in (by_signal, g.compile())]
    assert ends[0].q_end == pytest.approx(ends[1].q_end, rel=1e-10)
    assert ends[0].t_end == pytest.approx(ends[1].t_end, rel=1e-10)
