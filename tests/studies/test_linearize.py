"""Linear models against absolute coordinates, closed forms, and the motion itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

import blockmech as bm
from blockmech import laws, signals
from tests import machines
from tests.analysis.test_equilibria import in_pairs
from tests.gallery import GRAPHS, document
from tests.independent import controlled
from tests.independent import multibody as mb

DIGITS = 1e-9
H = 2e-4  # [rad or m] of fourth-order differences of extended numbers: h^4 = 1.6e-15


def efforts(system, q, qd, qdd):
    """Efforts of all drivers by absolute coordinates, in extended precision."""
    poses = mb.assemble(system, system.home, list(q), follow=True, refine=True)
    rates = mb.rates(system, poses, list(qd))
    result = mb.reactions(
        system, poses, rates, mb.accelerations(system, poses, rates, list(qdd)), friction=False
    )
    return np.array([result.drivers[d] for d in system.drivers], np.longdouble)


def slopes(system, q, qd, which):
    """Derivatives of the efforts by coordinates, rates or accelerations (k, k)."""
    k, columns = len(q), []
    state = [np.array(q, np.longdouble), np.array(qd, np.longdouble), np.zeros(k, np.longdouble)]

    def at(i, h):
        moved = [x.copy() for x in state]
        moved[which][i] += h
        return efforts(system, *moved)

    for i in range(k):
        rise = at(i, -2 * H) - at(i, 2 * H) + 8 * (at(i, H) - at(i, -H))
        columns.append(np.asarray(rise / (12 * H), float))
    return np.column_stack(columns)


CASES = {
    "watt_sixbar": ([1.0], [2.0]),
    "fivebar_falling": ([1.0, 2.0], [0.7, -1.1]),
    "excavator": None,
}


@pytest.mark.parametrize("name", CASES)
def test_matrices_and_modes_are_those_of_absolute_coordinates(name):
    """Also of a two- and a three-driver machine, about a motion."""
    linkage = bm.Linkage.load(GRAPHS / "joints" / f"{name}.json")
    mech, system = linkage.compile(), mb.read(in_pairs(document(f"joints/{name}")))
    if CASES[name] is None:
        q = [mech.scene.begin(d) for d in mech.drivers]
        q = [0.5 if x is None else x for x in q]
        qd = [0.1] * len(q)
    else:
        q, qd = CASES[name]
    at, rates = (dict(zip(mech.drivers, x, strict=True)) for x in (q, qd))
    linear = mech.linearize(at, rates=rates, friction="none")
    order = [list(system.drivers).index(d) for d in mech.drivers]
    K, C, M = (slopes(system, q, qd, w)[np.ix_(order, order)] for w in (0, 1, 2))
    for ours, theirs in ((linear.K, K), (linear.damping, C), (linear.M, M)):
        assert np.abs(ours - theirs).max() <= DIGITS * max(np.abs(theirs).max(), 1.0)
    k = len(M)
    A = np.vstack([np.eye(k, 2 * k, k), -np.hstack([np.linalg.solve(M, K), np.linalg.solve(M, C)])])
    theirs = np.sort_complex(np.linalg.eigvals(A))
    ours = np.sort_complex(linear.eigenvalues)
    assert np.abs(ours - theirs).max() <= 1e-8 * np.abs(theirs).max()


def pendulum(damping=0.0, stiffness=0.0):
    graph = machines.crank(1.0, bm.Link(mass=2.0, inertia=0.1, cm=(0.5, 0.0)), gravity=9.81)
    twist = bm.TorsionSpring(stiffness=stiffness, damping=damping)
    machines.load(graph, "twist", twist, a="frame.frame", b="crank.crank")
    return machines.load(graph, "push", bm.Force(force=(0.0, 0.0)), at="crank.B").compile()


def test_a_pendulum_has_the_frequency_and_damping_of_the_textbook():
    J, k, c = 0.6, 9.81, 0.8  # about the pin; m g l; damping
    linear = pendulum(c).linearize()
    (mode,) = linear.modes
    assert mode.frequency == pytest.approx(math.sqrt(k / J), rel=1e-13)
    assert mode.damping == pytest.approx(c / (2 * math.sqrt(k * J)), rel=1e-13)
    assert linear.stable
    w = np.array([0.1, 3.0, 40.0])
    assert linear.response(w)[:, 0, 0] == pytest.approx(1 / (k - J * w**2 + 1j * c * w), rel=1e-12)


def test_inputs_and_outputs_have_names():
    """A force at the end works with the length of the rod; acceleration follows it at once."""
    linear = pendulum(0.8).linearize(
        inputs=["push.force.x"], outputs=["crank.B.p.x", "crank.acceleration"]
    )
    assert linear.inputs == ("crank.drive", "push.force.x")
    w = np.array([2.0])
    H_ = 1 / (9.81 - 0.6 * w**2 + 1j * 0.8 * w)
    responses = linear.response(w)[0]
    assert responses[0] == pytest.approx(np.array([H_[0], H_[0]]), rel=1e-12)  # hangs: x = l phi
    assert responses[1] == pytest.approx(-(w[0] ** 2) * np.array([H_[0], H_[0]]), rel=1e-12)
    assert linear.units["push.force.x"] == "N"


def test_scipy_takes_the_system():
    from scipy import signal

    linear = pendulum(0.8).linearize()
    space = linear.to_statespace()
    t = np.linspace(0.0, 2.0, 21)
    _, y, _ = signal.lsim(space, 0.0 * t, t, X0=[0.1, 0.0])
    assert y == pytest.approx([(expm(linear.A * s) @ [0.1, 0.0])[0] for s in t], abs=1e-12)


def test_control_takes_the_system_with_its_names():
    linear = pendulum(0.8).linearize(inputs=["push.force.x"])
    space = linear.to_control()
    assert space.input_labels == ["crank_drive", "push_force_x"]
    assert space.output_labels == ["crank_q"]
    assert space(2j) == pytest.approx(linear.response(2.0)[0], rel=1e-12)


def test_small_motions_are_the_linear_ones():
    mech = bm.Graph.load(GRAPHS / "watt_sixbar.json").compile()
    rest = mech.equilibria().stable[0]
    linear, q0, d = mech.linearize(rest), float(rest.q[0]), 1e-5
    t = np.linspace(0.1, 1.5, 8)
    run = mech.simulate(times=t.tolist(), start={"crank": (q0 + d, 0.0)})
    x = np.array([(expm(linear.A * s) @ [d, 0.0])[0] for s in t])
    assert np.abs(run["crank.q"] - q0 - x).max() < 20 * d**2


def test_friction_that_slips_is_in_it():
    """About a motion: differences of the driving moment with friction."""
    mech = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").compile()
    linear, h = mech.linearize(1.0, rates=10.0), 1e-4

    def drive(q, rate):
        return mech.run(q, rates=rate, accelerations=0.0, want="crank.drive")["crank.drive"][0]

    assert linear.effort[0] == pytest.approx(drive(1.0, 10.0), rel=1e-13)
    K = (
        drive(1 - 2 * h, 10) - 8 * drive(1 - h, 10) + 8 * drive(1 + h, 10) - drive(1 + 2 * h, 10)
    ) / (12 * h)
    assert linear.K[0, 0] == pytest.approx(K, rel=DIGITS)


def test_floquet_is_what_the_return_map_tells():
    mech = bm.Graph.load(GRAPHS / "pump.json").compile()
    motion = mech.simulate("steady", friction="none")
    multipliers = bm.design.floquet(mech, motion)
    assert abs(multipliers.multipliers[0] - 1) < 1e-9  # a motion that starts later is the same
    assert multipliers.multipliers[1].real == pytest.approx(
        motion.motion.facts["multiplier"], rel=1e-8
    )
    assert "multiplier" in str(multipliers)
    with pytest.raises(bm.RequestError, match="no period"):
        bm.design.floquet(mech, mech.run(at=1.0))


def test_what_does_not_fit_is_said():
    mech = bm.Graph.load(GRAPHS / "watt_sixbar.json").compile()
    with pytest.raises(bm.RequestError, match=r"it names 2 poses"):
        mech.linearize([1.0, 2.0])
    with pytest.raises(bm.RequestError, match=r"name first.C.p.x"):
        mech.linearize(1.0, outputs="first.C.p")
    two = bm.Graph.load(GRAPHS / "geared_fivebar.json").compile()
    with pytest.raises(bm.RequestError, match=r"2 stable equilibria"):
        two.linearize()
    with pytest.raises(bm.RequestError, match="moves no mass"):
        bm.Graph.load(GRAPHS / "slider_crank.json").compile().linearize(1.0)


def test_pictures(tmp_path):
    linear = (
        bm.Graph.load(GRAPHS / "fivebar_falling.json")
        .compile()
        .linearize({"left": 1.2, "right": 2.0})
    )
    linear.plot(tmp_path / "bode.png")
    assert (tmp_path / "bode.png").stat().st_size > 10_000
    labels = [t.get_text() for t in linear.figure().axes[0].get_legend().get_texts()]
    assert labels[0] == "left.q by left.drive"
    film = linear.animate(0, tmp_path / "mode.html", amplitude=0.05)
    assert film.path.stat().st_size > 1000
    with pytest.raises(bm.RequestError, match="from 0 on"):
        linear.animate(9)


def wheel(sample=None):
    """A wheel whose speed a PID controller keeps."""
    g = bm.Graph("wheel")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0)}))
    g.add("wheel", bm.Crank(links={"crank": bm.Link(inertia=2.0)}))
    g.add("setpoint", signals.Step(value=10.0))
    g.add("error", signals.Sum(signs="+-"))
    g.add("pid", signals.Pid(kp=3.0, ki=5.0, kd=0.4, n=30.0, sample=sample))
    g.add("drive", bm.Motor(law=laws.Signal()))
    machines.wire(
        g,
        "frame.A wheel.A",
        "frame.A drive.a",
        "wheel.crank drive.b",
        "setpoint.y error.u0",
        "wheel.rate error.u1",
        "error.y pid.u",
        "pid.y drive.law",
    )
    g.start("wheel")
    return g


def test_a_controlled_wheel_has_the_transfer_function_of_the_textbook():
    """C(s) = kp + ki/s + kd n s/(s + n) around 1/(J s): T = C G / (1 + C G)."""
    linear = (
        wheel()
        .compile()
        .linearize(
            {"wheel": 0.3},
            rates={"wheel": 10.0},
            inputs=["setpoint.y"],
            outputs=["wheel.rate", "pid.y"],
        )
    )
    assert linear.inputs == ("wheel.drive", "setpoint.y")
    assert dict(linear.states) == pytest.approx({"pid.integral": 0.0, "pid.filtered": 0.0})
    w = np.array([0.01, 1.0, 5.0, 200.0])
    s = 1j * w
    control, plant = 3.0 + 5.0 / s + 0.4 * 30.0 * s / (s + 30.0), 1 / (2.0 * s)
    loop = control * plant
    response = linear.response(w)
    assert response[:, 0, 1] == pytest.approx(loop / (1 + loop), rel=1e-11)
    assert response[:, 0, 0] == pytest.approx(plant / (1 + loop), rel=1e-11)
    assert response[:, 1, 1] == pytest.approx(control / (1 + loop), rel=1e-11)
    space = linear.to_statespace()
    assert space.A.shape == (4, 4)


def test_a_controlled_fourbar_is_that_of_three_angles_and_multipliers():
    """A by fourth-order differences of equations that know nothing of blockmech."""
    mech = bm.Graph.load(GRAPHS / "control/speed_controlled_fourbar.json").compile()
    z0 = np.array([0.4, 3.0, 20.0, 0.3, 2.0])
    states = dict(zip(("motor.current", "pid.integral", "pid.filtered"), z0[2:], strict=True))
    linear = mech.linearize(
        {"crank": 0.4}, rates={"crank": 3.0}, states=states, inputs=["setpoint.y"]
    )
    assert linear.states == states
    linkage, motor = controlled.FourBar(), controlled.Motor()
    kept_up = float(linear.effort[0])  # what else the crank needs to keep its rate

    def rates(z, setpoint=10.0):
        q, w, i, total, filtered = z
        angles = linkage.angles(q)
        al = linkage.accelerations(angles, linkage.rates(angles, w), motor.k * i + kept_up)[0]
        e = setpoint - w
        u = 20.0 * e + 40.0 * total + 0.5 * 50.0 * (e - filtered)
        return np.array(
            [w, al, (u - motor.R * i - motor.k * w) / motor.L, e, 50.0 * (e - filtered)]
        )

    def slope(f, h):
        return (f(-2 * h) - 8 * f(-h) + 8 * f(h) - f(2 * h)) / (12 * h)

    A = np.column_stack([slope(lambda h, e=e: rates(z0 + h * e), 5e-4) for e in np.eye(5)])
    assert np.abs(linear.A - A).max() <= 1e-9 * np.abs(A).max()
    assert linear.A[1] == pytest.approx(A[1], rel=1e-9, abs=1e-9)
    assert linear.B[:, 1] == pytest.approx(slope(lambda h: rates(z0, 10.0 + h), 1e-3), abs=1e-8)


def test_states_at_rest_are_looked_for():
    """A crank that a controller holds against its weight: the integral carries it."""
    data = wheel().to_data()
    data["scene"]["gravity"] = [0.0, -9.81]
    data["blocks"]["wheel"]["links"] = {"crank": {"mass": 1.0, "inertia": 2.0, "cm": [0.5, 0.0]}}
    data["blocks"]["setpoint"]["value"] = 0.3
    for wire in data["wires"]:
        if wire["from"] == "wheel.rate":
            wire["from"] = "wheel.q"
    g = bm.Graph.from_data(data)
    linear = g.compile().linearize({"wheel": 0.3})
    weight = 9.81 * 0.5 * math.cos(0.3)
    assert linear.states["pid.integral"] == pytest.approx(weight / 5.0, rel=1e-12)
    assert linear.effort == pytest.approx([0.0], abs=1e-12)
    assert not linear.notes


def test_signals_that_do_not_fit_are_refused():
    with pytest.raises(bm.RequestError, match="jumps at instants"):
        wheel(sample=0.1).compile().linearize({"wheel": 0.0})
    with pytest.raises(bm.RequestError, match=r"pid\.integral"):
        wheel().compile().linearize({"wheel": 0.0}, states={"pid.integrl": 1.0})
    with pytest.raises(bm.RequestError):
        wheel().compile().linearize({"wheel": 0.0}, inputs=["setpoint.x"])


def test_both_frequencies_of_a_damped_mode_are_named():
    m = bm.Linkage("suspension", gravity=(0, -9.81))
    m.add_link("arm", mass=8, inertia=0.3, cm=(0.3, 0))
    m.add_joint("O", "R", ["frame", "arm"], point=(0, 0))
    m.add_driver("arm", "O")
    spring = bm.Spring(stiffness=20000, free_length=0.3, damping=300)
    m.add_load("spring", spring, links=["frame", "arm"], at=[(0.3, 0.3), (0.3, 0)])
    mechanism = m.compile()
    rest = mechanism.equilibria().stable[0]
    linear = mechanism.linearize(rest)
    assert "driver.arm.drive = 0 N m keeps it up" in str(linear)  # 1.4e-15 N m was printed
    (mode,) = linear.modes
    natural, ratio = mode.frequency, mode.damping
    assert rest.frequencies == pytest.approx([natural])
    assert mode.damped_frequency == pytest.approx(natural * math.sqrt(1 - ratio**2))
    assert f"natural frequency {natural:.6g} rad/s" in str(rest)
    row = str(linear).splitlines()[2]
    assert f"natural frequency {natural:.9g} rad/s ({natural / math.tau:.6g} Hz)" in row
    assert f"damped {mode.damped_frequency:.9g} rad/s, damping ratio {ratio:.4g}" in row
