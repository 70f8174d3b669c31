"""Motions under control against matrix exponentials, quadrature and other formulations."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import blockmech as bm
from blockmech import signals
from blockmech.ground.errors import RequestError
from blockmech.loads import laws
from tests.independent.controlled import Continuous, Sampled
from tests.machines import wire
from tests.signals.machines import CONTROL, compiled, data_of, flywheel, speed_control

EXACT = 1e-9
TIMES = [0.1, 0.25, 0.5, 1.0]
# ../design: machine.md 2.4, from a formulation of its own (DOP853 and Radau agree to 2e-11)
TRIAL = {
    "crank.q": [1.01706593, 1.21689783, 2.21429195, 7.25976765],
    "crank.rate": [0.520161811, 2.22285294, 6.14297878, 9.47079135],
    "pid.integral": [0.982934068, 2.28310217, 3.78570805, 3.74023236],
    "pid.filtered": [9.57289059, 8.02396120, 4.27970225, -0.288851509],
    "motor.current": [158.063606, 206.730344, 187.291542, 38.2759360],
}


@pytest.fixture(scope="module")
def fourbar():
    return compiled(data_of("speed_controlled_fourbar"))


@pytest.mark.parametrize(("method", "engine"), [("dop853", "scalar"), ("dop853", "llvm")])
def test_a_motor_under_pid_moves_a_fourbar_as_the_trial_did(fourbar, method, engine):
    how = {"times": TIMES, "method": method, "engine": engine, "accuracy": 1e-10}
    run = fourbar.simulate("time=1", want=list(TRIAL), **how)
    for name, values in TRIAL.items():
        assert run[name] == pytest.approx(values, rel=4e-9), name
    turned, integral = run["crank.q"], run["pid.integral"]
    assert turned + integral == pytest.approx(1 + 10 * np.array(TIMES), abs=1e-12)


def test_the_trial_agrees_with_lagranges_multipliers(fourbar):
    judge = Continuous(20.0, 40.0, 0.5, 50.0, 10.0).run(1.0, TIMES)
    run = fourbar.simulate("time=1", times=TIMES, want=list(TRIAL), accuracy=1e-11)
    for name, values in zip(
        ("crank.q", "crank.rate", "pid.integral", "pid.filtered", "motor.current"),
        judge,
        strict=True,
    ):
        assert run[name] == pytest.approx(values, rel=1e-10, abs=1e-10), name


@pytest.mark.parametrize("engine", ["scalar", "llvm"])
@pytest.mark.parametrize(
    ("kp", "ki", "limits", "sample"),
    [(20.0, 40.0, (-150.0, 150.0), 0.01), (7.0, 90.0, (-20.0, 120.0), 0.025)],
)
def test_a_sampled_pi_controller_with_limits(kp, ki, limits, sample, engine):
    data = data_of("sampled_fourbar")
    data["blocks"]["pid"] |= {"kp": kp, "ki": ki, "limits": limits, "sample": sample}
    judge = Sampled(kp, ki, 10.0, sample, limits).run(1.0, 0.5)
    mech = compiled(data)
    want = {
        "crank.q": "q",
        "crank.rate": "rate",
        "motor.current": "current",
        "pid.integral": "integral",
        "pid.y": "output",
    }
    run = mech.simulate("time=0.5", times=[0.5], want=list(want), accuracy=1e-11, engine=engine)
    for name, key in want.items():
        assert run[name][0] == pytest.approx(judge[key], rel=1e-10), name


@pytest.mark.parametrize("name", ["speed_controlled_fourbar", "sampled_fourbar"])
def test_the_files_expect_what_the_judge_says(name):
    entry = json.loads((CONTROL / f"{name}.json").read_text("utf-8"))["expect"][0]
    times = entry["simulate"]["times"]
    if name == "sampled_fourbar":
        result = Sampled(20.0, 40.0, 10.0, 0.01, (-150.0, 150.0)).run(1.0, times[-1])
        judge = {"crank.q": result["q"], "motor.current": result["current"]}
        assert all(entry["want"][k] == pytest.approx([x], rel=1e-11) for k, x in judge.items())
    else:
        judge = Continuous(20.0, 40.0, 0.5, 50.0, 10.0).run(1.0, times)
        assert entry["want"]["crank.q"] == pytest.approx(judge[0], rel=1e-11)


# -- one wheel ---------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_a_wheel_under_pid_is_a_matrix_exponential(method):
    J, kp, ki, kd, n, setpoint = 2.0, 3.0, 5.0, 0.4, 30.0, 10.0
    mech = speed_control(signals.Pid(kp=kp, ki=ki, kd=kd, n=n), setpoint, inertia=J).compile()
    names = ["wheel.q", "wheel.rate", "pid.integral", "pid.filtered"]
    # x = (q, w, I, x_f, 1), e = setpoint - w, M = kp e + ki I + kd n (e - x_f)
    e = np.array([0.0, -1.0, 0.0, 0.0, setpoint])
    unit = np.eye(5)
    moment = kp * e + ki * unit[2] + kd * n * (e - unit[3])
    A = np.array([unit[1], moment / J, e, n * (e - unit[3]), 0 * e])
    run = mech.simulate("time=1", times=TIMES, want=names, method=method, accuracy=1e-11)
    for t, row in zip(TIMES, np.transpose([run[x] for x in names]), strict=True):
        assert row == pytest.approx((expm(A * t) @ unit[4])[:4], rel=EXACT, abs=EXACT)


def test_a_sampled_wheel_is_a_product_of_matrix_exponentials():
    J, kp, ki, T, setpoint = 0.5, 2.0, 8.0, 0.05, 10.0
    mech = speed_control(signals.Pid(kp=kp, ki=ki, sample=T), setpoint, inertia=J).compile()
    w, total = 0.0, 0.0
    for _ in range(20):
        e = setpoint - w
        w, total = w + T / J * (kp * e + ki * total), total + T * e
    run = mech.simulate("time=1", times=[1.0], want=["wheel.rate", "pid.integral"])
    assert run["wheel.rate"][0] == pytest.approx(w, rel=1e-11)
    assert run["pid.integral"][0] == pytest.approx(total, rel=1e-11)


def test_an_integrator_of_the_rate_is_the_coordinate():
    data = data_of("speed_controlled_fourbar")
    data["blocks"]["turned"] = {"type": "signal.integrator", "initial": 1.0}
    data["wires"].append({"from": "crank.rate", "to": "turned.u"})
    run = compiled(data).simulate("time=1", want=["crank.q", "turned.y"], accuracy=1e-11)
    assert run["turned.y"] == pytest.approx(run["crank.q"], rel=1e-12)


def test_a_motor_without_inductance_is_the_law_dc():
    R, k, u = 2.0, 0.5, 12.0
    apart = []
    for L in (1e-3, 1e-4, 1e-5):
        blocks = {
            "volts": signals.Constant(value=u),
            "motor": signals.DCMotor(R=R, L=L, k=k),
        }
        wires = [
            ("volts.y", "motor.u"),
            ("wheel.rate", "motor.rate"),
            ("motor.moment", "drive.law"),
        ]
        mech = flywheel(blocks, wires, inertia=0.1).compile()
        apart.append(mech.simulate("time=0.2", accuracy=1e-10, method="radau").motion.q_end)
    limit = flywheel({}, [], inertia=0.1, load=False)
    limit.add("dc", bm.Motor(law=laws.DC(stall_moment=k * u / R, no_load_speed=u / k)))
    wire(limit, "frame.A dc.a", "wheel.crank dc.b")
    exact = limit.compile().simulate("time=0.2", accuracy=1e-10).motion.q_end
    off = np.abs(np.array(apart) - exact)
    assert off[2] < 1e-4 * abs(exact)
    assert off[:-1] / off[1:] == pytest.approx([10.0, 10.0], rel=0.02)  # of the first order in L


def test_a_mirrored_machine_under_control_mirrors_its_motion():
    ways = []
    for sign in (1.0, -1.0):
        g = speed_control(signals.Pid(kp=3.0, ki=5.0), 10.0 * sign)
        ways.append(g.compile().simulate("time=1", accuracy=1e-10).motion.q_end)
    assert ways[0] == -ways[1] != 0.0


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_instants_that_rounding_parts_are_one(method):
    # 3 times 0.1 s is not 0.3 s in binary numbers, and a step comes before the samples
    blocks = {
        "setpoint": signals.Step(value=1.0, time=0.3),
        "fast": signals.TransferFunction(num=[1.0], den=[1.0, 0.0], sample=0.1),
        "slow": signals.Delay(sample=0.3, steps=1),
    }
    wires = [("setpoint.y", "fast.u"), ("setpoint.y", "slow.u"), ("fast.y", "drive.law")]
    mech = flywheel(blocks, wires).compile()
    t = [0.25, 0.35, 0.45, 0.55, 0.65]
    run = mech.simulate(
        "time=0.95", times=t, want=["setpoint.y", "fast.y", "slow.y"], method=method
    )
    assert run["setpoint.y"].tolist() == [0.0, 1.0, 1.0, 1.0, 1.0]
    assert run["fast.y"].tolist() == [0.0, 0.0, 1.0, 1.0, 1.0]
    assert run["slow.y"].tolist() == [0.0, 0.0, 0.0, 0.0, 1.0]
    assert run.motion.end == "time"


def test_a_delay_of_some_samples_changes_the_answer():
    ends = []
    for steps in (1, 3):
        blocks = {
            "setpoint": signals.Constant(value=10.0),
            "error": signals.Sum(signs="+-"),
            "late": signals.Delay(sample=0.05, steps=steps),
            "gain": signals.Gain(k=2.0),
        }
        wires = [
            ("setpoint.y", "error.u0"),
            ("wheel.rate", "error.u1"),
            ("error.y", "late.u"),
            ("late.y", "gain.u"),
            ("gain.y", "drive.law"),
        ]
        mech = flywheel(blocks, wires).compile()
        w, line = 0.0, [0.0] * steps
        for _ in range(20):
            line = [10.0 - w, *line]
            w += 0.05 * 2.0 * line.pop() / 2.0
        run = mech.simulate("time=1", times=[1.0], want=["wheel.rate"])
        assert run["wheel.rate"][0] == pytest.approx(w, rel=1e-11)
        ends.append(w)
    assert ends[0] != pytest.approx(ends[1], rel=1e-4)


@pytest.mark.parametrize("engine", ["scalar", "llvm"])
def test_limits_of_a_continuous_controller_hold_the_integral(engine):
    J, kp, ki, high, setpoint = 2.0, 5.0, 4.0, 6.0, 10.0
    controller = signals.Pid(kp=kp, ki=ki, limits=(-high, high))
    mech = speed_control(controller, setpoint, inertia=J).compile()
    want = ["wheel.rate", "pid.integral", "pid.y"]
    run = mech.simulate("time=8", times=[1.0, 3.0, 8.0], want=want, accuracy=1e-9, engine=engine)

    def rate(t, x):
        e = setpoint - x[0]
        v = kp * e + ki * x[1]
        room = ((high - v) if e > 0 else (v + high)) / (1e-3 * 2 * high)
        return [min(max(v, -high), high) / J, e * min(max(room, 0.0), 1.0)]

    judge = solve_ivp(
        rate, (0.0, 8.0), [0.0, 0.0], method="Radau", rtol=1e-10, atol=1e-12, t_eval=[1.0, 3.0, 8.0]
    ).y
    assert run["pid.y"][0] == high
    assert run["wheel.rate"] == pytest.approx(judge[0], abs=1e-7)
    assert run["pid.integral"] == pytest.approx(judge[1], abs=1e-7)


def test_a_transfer_function_answers_a_step_in_closed_form():
    # 1 / (s^2 + 0.4 s + 4) and 3 s + 1 over s + 2 side by side
    blocks = {
        "one": signals.Step(value=1.0, time=0.25),
        "slow": signals.TransferFunction(num=[1.0], den=[1.0, 0.4, 4.0]),
        "lead": signals.TransferFunction(num=[3.0, 1.0], den=[1.0, 2.0]),
    }
    mech = flywheel(blocks, [("one.y", "slow.u"), ("one.y", "lead.u"), ("slow.y", "drive.law")])
    t = np.array([0.2, 0.5, 1.3, 2.0])
    run = mech.compile().simulate("time=2", times=t, want=["slow.y", "lead.y"], accuracy=1e-11)
    s = np.maximum(t - 0.25, 0.0)
    w = math.sqrt(4 - 0.04)
    slow = (1 - np.exp(-0.2 * s) * (np.cos(w * s) + 0.2 / w * np.sin(w * s))) / 4
    lead = np.where(t > 0.25, 0.5 + 2.5 * np.exp(-2 * s), 0.0)
    assert run["slow.y"] == pytest.approx(slow, abs=1e-11)
    assert run["lead.y"] == pytest.approx(lead, abs=1e-11)


def test_a_sampled_transfer_function_is_that_of_z():
    # y_k = 0.5 y_(k-1) + u_(k-1)
    blocks = {
        "one": signals.Step(value=1.0),
        "filter": signals.TransferFunction(num=[1.0], den=[1.0, -0.5], sample=0.1),
    }
    mech = flywheel(blocks, [("one.y", "filter.u"), ("filter.y", "drive.law")]).compile()
    t = np.array([0.05, 0.15, 0.25, 0.35])
    run = mech.simulate("time=0.5", times=t, want=["filter.y"])
    assert run["filter.y"] == pytest.approx([0.0, 1.0, 1.5, 1.75], abs=1e-15)


def test_signals_without_states_leave_the_method_to_the_loads():
    def controlled(law=None):
        g = speed_control(signals.Gain(k=2.0))
        if law is None:
            return g
        g = flywheel({}, [], load=False)
        g.add("drive", bm.Motor(law=law))
        return wire(g, "frame.A drive.a", "wheel.crank drive.b")

    by_signal = controlled().compile().simulate("time=1", accuracy=1e-10).motion
    by_law = controlled(laws.Polynomial(of="rate", coefficients=[20.0, -2.0])).compile()
    motion = by_law.simulate("time=1", accuracy=1e-10).motion
    assert (by_signal.method, motion.method) == ("dop853", "dop853")
    assert by_signal.q_end == pytest.approx(motion.q_end, rel=1e-11)


def test_a_function_of_python_with_memory_is_the_block_that_it_says():
    expected = speed_control(signals.Pid(kp=3.0, ki=5.0)).compile()

    def control(u, total):
        return 3.0 * u + 5.0 * total, u

    own = speed_control(signals.Python(call=control, memory={"total": 0.0})).compile()
    ends = [m.simulate("time=1", accuracy=1e-10).motion.q_end for m in (expected, own)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)


def test_a_filtered_acceleration_may_be_fed_back():
    # J w' = 2 (10 - w) - 0.5 f, f' = 20 (w' - f)
    blocks = {
        "setpoint": signals.Constant(value=10.0),
        "error": signals.Sum(signs="+-"),
        "gain": signals.Gain(k=2.0),
        "filter": signals.TransferFunction(num=[20.0], den=[1.0, 20.0]),
        "less": signals.Gain(k=0.5),
        "whole": signals.Sum(signs="+-"),
    }
    wires = [
        ("setpoint.y", "error.u0"),
        ("wheel.rate", "error.u1"),
        ("error.y", "gain.u"),
        ("wheel.acceleration", "filter.u"),
        ("filter.y", "less.u"),
        ("gain.y", "whole.u0"),
        ("less.y", "whole.u1"),
        ("whole.y", "drive.law"),
    ]
    mech = flywheel(blocks, wires).compile()
    A = np.array([[-1.0, -0.25, 10.0], [-20.0, -25.0, 200.0], [0.0, 0.0, 0.0]])
    for engine in ("scalar", "llvm"):
        run = mech.simulate(
            "time=1", times=TIMES, want=["wheel.rate"], accuracy=1e-11, engine=engine
        )
        exact = [(expm(A * t) @ [0.0, 0.0, 1.0])[0] for t in TIMES]
        assert run["wheel.rate"] == pytest.approx(exact, rel=1e-10)


def test_several_drivers_each_have_their_controller():
    mech = bm.Graph.load(CONTROL.parent / "fivebar_falling.json")
    for side in ("left", "right"):
        mech.add(f"{side}_drive", bm.Motor(law=laws.Signal()))
        mech.add(f"{side}_pid", signals.Pid(kp=-40.0, ki=-10.0))
        pivot = next(w.source for w in mech.wires if w.target == f"{side}.A")
        mech.connect(pivot, f"{side}_drive.a")
        wire(
            mech,
            f"{side}.crank {side}_drive.b",
            f"{side}.rate {side}_pid.u",
            f"{side}_pid.y {side}_drive.law",
        )
    run = mech.compile().simulate(
        "time=0.2", want=["*.q", "left_pid.integral", "right_pid.integral"], accuracy=1e-10
    )
    for side in ("left", "right"):
        turned = run[f"{side}.q"] - run[f"{side}.q"][0]
        assert run[f"{side}_pid.integral"] == pytest.approx(turned, abs=1e-12)


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_acceleration_of_any_driver_sums_up_to_its_rate(side):
    """Also of the last one alone, and while another one lies against its stop."""
    mech = bm.Graph.load(CONTROL.parent / "fivebar_falling.json")
    data = json.loads(mech.to_json())
    q = data["scene"]["initial"]["right"]["q"]
    data["scene"]["stops"] = {"right": {"from": q - 1.0, "to": q + 0.1, "restitution": 0.0}}
    data["blocks"]["sum"] = {"type": "signal.integrator"}
    data["wires"].append({"from": f"{side}.acceleration", "to": "sum.u"})
    mech = bm.Graph.from_json(json.dumps(data)).compile()
    t = np.linspace(0.0, 0.3, 61)
    run = mech.simulate("time=0.3", times=t, want=["*.rate", "sum.integral"], accuracy=1e-6)
    (blow,) = run.motion.impacts
    assert run.motion.lying
    for some in (t < blow.t, t > blow.t):
        gained = np.ptp(run[f"{side}.rate"][some] - run["sum.integral"][some])
        assert gained <= 1e-5


@pytest.mark.parametrize("name", ["pump", "watt_sixbar", "ruiz_fourbar"])
def test_an_accelerometer_that_no_load_follows_leaves_the_motion_as_it_is(name):
    graph = bm.Graph.load(CONTROL.parent / f"{name}.json")
    start = {"start": dict.fromkeys(graph.compile().drivers, (0.7, 2.0))}
    alone = graph.compile().simulate("time=0.05", **start)
    (driver,) = graph.compile().drivers
    graph.add("sum", signals.Integrator())
    graph.connect(f"{driver}.acceleration", "sum.u")
    run = graph.compile().simulate("time=0.05", want=["*.rate", "sum.integral"], **start)
    assert run.motion.q_end == pytest.approx(alone.motion.q_end, abs=1e-8)
    gained = run[f"{driver}.rate"] - 2.0
    assert run["sum.integral"] == pytest.approx(gained, abs=1e-7 * np.abs(gained).max())


# -- what is refused ---------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["energy", "euler_q"])
def test_methods_along_the_path_refuse_states(fourbar, method):
    with pytest.raises(RequestError, match="the loads depend on state as well"):
        fourbar.simulate("time=0.1", method=method)


def test_a_run_of_given_motions_names_the_states_that_it_lacks(fourbar):
    with pytest.raises(RequestError, match=r"motor.current.*simulate"):
        fourbar.run(at=[1.0], rates=[2.0], want=["crank.drive"])
    assert fourbar.run(at=[1.0], rates=[2.0], want=["crank.q"])["crank.q"][0] == 1.0


def remembering():
    """A PI controller as a closure, which keeps its integral in itself."""
    memory = {"t": 0.0, "total": 0.0}

    def law(rate, time):
        memory["total"] += (10.0 - rate) * max(time - memory["t"], 0.0)
        memory["t"] = time
        return 3.0 * (10.0 - rate) + 5.0 * memory["total"]

    return law


def test_a_law_that_remembers_is_refused_before_anything_is_computed():
    g = flywheel({}, [], load=False)
    g.add("drive", bm.Motor(law=remembering(), driver="wheel"))
    wire(g, "frame.A drive.a", "wheel.crank drive.b")
    with pytest.raises(RequestError, match=r"drive: its function gives another value.*memory"):
        g.compile().simulate("time=1")


def test_a_block_that_remembers_in_itself_is_refused():
    inputs = []

    def control(u):
        inputs.append(u)
        return float(len(inputs))

    mech = speed_control(signals.Python(call=control)).compile()
    with pytest.raises(RequestError, match="pid: its function gives another value"):
        mech.simulate("time=1")


def test_equilibria_refuse_states(fourbar):
    with pytest.raises(RequestError, match="loads follow signals"):
        fourbar.equilibria()


def test_a_controlled_fourbar_turns_as_its_integral_asks_and_its_states_repeat(fourbar):
    """An integral of the error that repeats leaves none in the mean: ten radians a second."""
    period = 2 * math.pi / 10
    want = ["crank.q", "crank.rate", "pid.integral", "motor.current"]
    r = fourbar.simulate("steady", times=[0.0, 0.2, period, 0.2 + period], want=want)
    motion = r.motion
    assert motion.facts["period"] == pytest.approx(period, rel=1e-9)
    assert motion.facts["mean_speed"] == pytest.approx(10.0, rel=1e-9)
    assert 0 < motion.facts["multiplier"] < 1
    assert abs(r["crank.q"][0] - 1.0) < math.pi
    for name in want:
        turn = 2 * math.pi if name == "crank.q" else 0.0
        assert r[name][2:] == pytest.approx(r[name][:2] + turn, rel=1e-8), name
    assert fourbar.verify(r).ok


def test_a_controlled_wheel_settles_with_the_roots_of_its_loop():
    """J q'' = kp e + ki I: disturbances fade by the roots of J s^2 + kp s + ki over a turn."""
    kp, ki = 8.0, 6.0
    mech = speed_control(signals.Pid(kp=kp, ki=ki)).compile()
    inertia = float(mech.run(at=[0.0], want=["wheel.J_red"])["wheel.J_red"][0])
    motion = mech.simulate("steady").motion
    roots = np.roots([inertia, kp, ki])
    fades = np.sort(np.abs(np.exp(roots * motion.facts["period"])))[::-1]
    assert motion.facts["mean_speed"] == pytest.approx(10.0, rel=1e-10)
    result = [motion.facts["multiplier"], motion.facts["multiplier_2"]]
    assert np.abs(result) == pytest.approx(fades, rel=1e-7)


@pytest.mark.parametrize(
    ("controller", "message"),
    [({"sample": 0.01}, "blocks that switch at instants"), ({}, "only turns are looked for")],
)
def test_steady_states_that_no_turn_has_are_refused(controller, message):
    pid = signals.Pid(kp=8.0, ki=6.0, **controller)
    mech = speed_control(pid, setpoint=10.0 if controller else 0.0).compile()
    with pytest.raises(RequestError, match=message):
        mech.simulate("steady")
