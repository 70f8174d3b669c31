"""Balancing and sizing against closed forms, the motion itself, and runs of the answer."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad

import blockmech as bm
from tests import machines
from tests.gallery import GRAPHS


def arm(stiffness=100.0, free_length=0.0, mass=0.9):
    link = bm.Link(mass=mass, inertia=0.02, cm=(0.32, 0.0), markers={"S": (0.1, 0.0)})
    graph = machines.crank(0.4, link, gravity=9.81, name="arm", W=(0.0, 0.12))
    spring = bm.Spring(stiffness=stiffness, free_length=free_length)
    return machines.load(graph, "spring", spring, a="frame.W", b="arm.S").compile()


POSES = np.linspace(-1.0, 1.2, 45)


def test_a_spring_without_free_length_balances_exactly():
    balance = bm.design.balance(arm(), "spring.stiffness", at=POSES)
    k = 0.9 * 9.81 * 0.32 / (0.1 * 0.12)
    assert balance.numbers["spring.stiffness"] == pytest.approx(k, rel=1e-12)
    assert balance.linear
    assert balance.after["arm.tau_red"].largest < 1e-12
    assert balance.mechanism.equilibria().balanced


def test_two_numbers_that_are_not_linear_find_it_too():
    numbers, tried = ["spring.stiffness", "spring.free_length"], []
    balance = bm.design.balance(
        arm(150.0, 0.05), numbers, at=POSES, progress=lambda *state: tried.append(state)
    )
    assert [count for _, count, _ in tried] == [float(n + 1) for n in range(len(tried))]
    assert len(tried) > 1
    assert not balance.linear
    assert balance.after["arm.tau_red"].rms < 1e-6
    assert "not linear" in str(balance)


def test_the_best_stiffness_is_that_of_least_squares():
    balance = bm.design.balance(arm(100.0, 0.05), "spring.stiffness", at=POSES)
    runs = [
        arm(k, 0.05).run(POSES, want="arm.tau_red", static=True)["arm.tau_red"]
        for k in (0.001, 1000.001)
    ]
    slope = (runs[1] - runs[0]) / 1000
    k = 0.001 - (slope @ runs[0]) / (slope @ slope)
    assert balance.numbers["spring.stiffness"] == pytest.approx(k, rel=1e-9)
    name = "arm.tau_red"
    again = balance.mechanism.run(POSES, want=name, static=True)[name]
    assert balance.after[name].largest == np.abs(again).max()
    assert balance.after[name].sample == np.abs(again).argmax()


def test_bounds_hold():
    balance = bm.design.balance(
        arm(), "spring.stiffness", at=POSES, bounds={"spring.stiffness": (0.0, 120.0)}
    )
    assert balance.numbers["spring.stiffness"] == pytest.approx(120.0, rel=1e-6)
    assert balance.at_bounds == ("spring.stiffness",)
    with pytest.raises(bm.RequestError, match="lowest, then highest"):
        bm.design.balance(
            arm(), "spring.stiffness", at=POSES, bounds={"spring.stiffness": (2.0, 1.0)}
        )


def test_a_mass_at_the_pivot_balances_once_its_place_is_a_number_too():
    """No force follows the mass as long as its centre is the pivot."""
    g = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").replace({"crank.links.crank.cm": (0.0, 0.0)})
    mech, shaking = g.compile(), "mechanism.shaking_force"
    mass, centre = "crank.links.crank.mass", "crank.links.crank.cm.x"
    settings = {"want": shaking, "samples": 25, "static": False}
    both = bm.design.balance(mech, [mass, centre], **settings, bounds={centre: ("-1 m", "1 m")})
    assert both.after[shaking].rms < 0.99 * both.before[shaking].rms
    with pytest.raises(bm.RequestError, match="add the numbers with which it acts"):
        bm.design.balance(mech, mass, **settings)


def test_counterweights_calm_the_frame():
    g = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    numbers = ["crank.links.crank.cm.x", "dyad.links.j.cm.x"]
    shaking = "mechanism.shaking_force"
    balance = bm.design.balance(g.compile(), numbers, want=shaking, samples=73, static=False)
    assert balance.after[shaking].rms < 0.9 * balance.before[shaking].rms
    for a in numbers:  # no better place beside it
        for h in (-1e-3, 1e-3):
            moved = g.replace(balance.numbers | {a: balance.numbers[a] + h}).compile()
            force = moved.run(samples=73, want=shaking, friction="none")[shaking]
            assert np.sqrt(np.mean(np.abs(force) ** 2)) > balance.after[shaking].rms


def test_a_flywheel_keeps_the_fluctuation_in_motion():
    """The machine with the wheel on its crank, moved by its own equation of motion."""
    g = bm.Graph.load(GRAPHS / "watt_sixbar.json")
    flywheel = bm.design.flywheel(g.compile(), 20.0, 0.05)
    assert flywheel.fluctuation == pytest.approx(0.05, rel=1e-10)
    assert abs(flywheel.moment) < 1e-12  # weights alone
    heavy = g.replace({"crank.links.crank.inertia": 0.0833 + flywheel.inertia})
    start = {"crank": (float(flywheel.q[0]), float(flywheel.speeds[0]))}
    run = heavy.compile().simulate(
        times=np.linspace(0.0, math.tau / 20.0, 400).tolist(), start=start
    )
    w = run["crank.rate"]
    assert (w.max() - w.min()) / 20.0 == pytest.approx(0.05, rel=1e-4)
    assert run["crank.q"][-1] - run["crank.q"][0] == pytest.approx(math.tau, rel=1e-9)


def test_the_motor_gives_what_the_loads_take():
    mech = bm.Graph.load(GRAPHS / "engine.json").compile()
    flywheel = bm.design.flywheel(mech, 100.0, 0.02)

    def load(q):
        return float(
            mech.run(q, rates=100.0, accelerations=0.0, want="crank.tau_red")["crank.tau_red"][0]
        )

    ends = np.linspace(0.0, 2 * math.tau, 25)  # four strokes: the gas repeats after two turns
    work = sum(quad(load, a, b, epsabs=1e-9)[0] for a, b in itertools.pairwise(ends))
    assert flywheel.moment == pytest.approx(-work / (2 * math.tau), rel=1e-6)
    assert flywheel.without > 0.02


def test_a_flywheel_needs_a_crank_that_turns():
    with pytest.raises(bm.RequestError, match="one crank that turns fully"):
        bm.design.flywheel(bm.Graph.load(GRAPHS / "elliptic_trammel.json").compile(), 10.0, 0.1)


def test_a_gear_of_the_least_rms():
    mech, J = bm.Graph.load(GRAPHS / "watt_sixbar.json").compile(), 1e-3
    t = np.linspace(0.0, 2.0, 400)
    motion = {
        "at": 1.0 - np.cos(3 * t),
        "rates": 3 * np.sin(3 * t),
        "accelerations": 9 * np.cos(3 * t),
    }
    best = bm.design.motor(mech, **motion, inertia=J)
    for ratio in (0.9 * best.ratio, 1.1 * best.ratio):
        assert bm.design.motor(mech, **motion, inertia=J, ratio=ratio).rms > best.rms
    drive = mech.run(**motion, want="crank.drive")["crank.drive"]
    expected = drive / best.ratio + J * best.ratio * motion["accelerations"]
    assert best.moment == pytest.approx(expected)
    assert best.power == pytest.approx(np.abs(expected * best.ratio * motion["rates"]).max())


def test_limits_of_a_motor_are_judged(tmp_path):
    mech = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").compile()
    demand = bm.design.motor(
        mech, samples=91, limits={"rms": "8 kN m", "peak": 9000.0, "speed": 20.0}
    )
    assert not demand.fits
    assert demand.margins["speed"] == pytest.approx(0.5)
    assert "the motor does not fit" in str(demand)
    demand.plot(tmp_path / "motor.png")
    with pytest.raises(bm.RequestError, match="a value does not fit"):
        bm.design.motor(mech, samples=91, limits={"torque": 1.0})


@pytest.mark.parametrize("rates", [None, 10.0])
def test_a_force_at_hand_is_the_inverse_of_the_drive(rates):
    """Also with joint friction, in the sense of the motion."""
    g = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    q = np.linspace(0.3, 6.0, 9)
    options = {} if rates is None else {"rates": rates}
    force = bm.design.available(g.compile(), "weightlike.force.y", 500.0, q, **options)
    for x, f in zip(q, force, strict=True):
        again = g.replace({"weightlike.force.y": float(f)}).compile()
        motion = {} if rates is None else {"rates": rates, "accelerations": 0.0}
        run = again.run(float(x), want="crank.drive", static=True, **motion)
        assert run["crank.drive"][0] == pytest.approx(500.0, rel=1e-11)


def test_no_force_at_a_dead_centre_and_none_that_does_not_count():
    mech = bm.Graph.load(GRAPHS / "slider_crank.json").compile()
    address = next(a for a in mech.parameters() if a.endswith(".force.x"))
    forces = bm.design.available(mech, address, 5.0, [0.0, 1.0], friction="none")
    assert np.isnan(forces[0])
    assert np.isfinite(forces[1])
    with pytest.raises(bm.RequestError, match="no value of it makes"):
        bm.design.available(mech, "frame.O.x", 5.0, [1.0])


def test_pictures(tmp_path):
    bm.design.balance(arm(100.0, 0.05), "spring.stiffness", at=POSES).plot(tmp_path / "a.png")
    engine = bm.Graph.load(GRAPHS / "engine.json").compile()
    bm.design.flywheel(engine, 100.0, 0.02).plot(tmp_path / "b.png")
    for name in ("a.png", "b.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_speeds_and_efforts_are_texts_with_units_as_well():
    engine = bm.read(GRAPHS / "engine.json").compile()
    by_text = bm.design.flywheel(engine, "300rpm", 0.02)
    assert by_text.inertia == bm.design.flywheel(engine, 10 * math.pi, 0.02).inertia
    with pytest.raises(bm.RequestError, match="speed: got '300 mm'"):
        bm.design.flywheel(engine, "300 mm", 0.02)
    mech = bm.read(GRAPHS / "ruiz_fourbar.json").compile()
    request = {"number": "couple.moment", "at": 0.5, "friction": "none"}
    in_text = bm.design.available(mech, effort="-0.5 kN m", **request)
    assert in_text.tolist() == bm.design.available(mech, effort=-500.0, **request).tolist()
    with pytest.raises(bm.RequestError, match="effort: got '2 mm'"):
        bm.design.available(mech, effort="2 mm", **request)


def test_a_flywheel_over_undefined_inertia_is_one_message():
    """SciPy said that the function value at nan is nan."""
    mechanism = bm.Linkage.load("graphs/joints/parallelogram_chain.json").compile()
    with pytest.raises(bm.RequestError, match="undefined at change points"):
        bm.design.flywheel(mechanism, 10.0, 0.02)


def test_a_length_that_makes_the_drive_what_it_shall_be_is_no_traceback():
    """The only length of a block is its size, by which friction is judged."""
    pendulum = bm.read(GRAPHS / "motions/pin_pendulum.json").compile()
    with pytest.raises(bm.BlockmechError, match="no value of it makes"):
        bm.design.available(pendulum, "crank.length", 1.0, at=[0.3])


def test_bounds_are_read_with_units():
    bed = bm.Graph.load("graphs/ruiz_fourbar.json").compile()
    for bounds, message in (
        ({"couple.moment": ("1 N", "2 kN m")}, '"1 N" has another kind of unit'),
        ({"couple.moment": ("2 kN m", "1 N m")}, "lowest, then highest"),
    ):
        with pytest.raises(bm.RequestError, match=message):
            bm.design.balance(bed, "couple.moment", at=["10deg", "50deg"], bounds=bounds)
    best = bm.design.balance(
        bed, "couple.moment", at=["10deg", "50deg"], bounds={"couple.moment": ("1 N m", "2 N m")}
    )
    assert best.at_bounds == ("couple.moment",)


def test_a_constant_force_keeps_no_work_and_needs_no_motor():
    """Over a turn it does as much as it takes, so the moment of the motor is 0, not rounding."""
    m = bm.Linkage("slider_crank")
    m.add_link("crank", mass=0.5, inertia=0.01)
    m.add_link("rod", mass=0.8, inertia=0.004, cm=(0.13, 0.0))
    m.add_link("piston", mass=1.2, cm=(0.26, 0.0))
    m.add_joint("O", "R", ["frame", "crank"], point=(0.0, 0.0))
    m.add_joint("A", "R", ["crank", "rod"], point=(0.06, 0.0))
    m.add_joint("B", "R", ["rod", "piston"], point=(0.26, 0.0))
    m.add_joint("G", "P", ["frame", "piston"], point=(0.26, 0.0))
    m.add_driver("motor", "O")
    m.add_load("gas", "force", link="piston", at=(0.26, 0.0), force=(-3000.0, 0.0))
    flywheel = bm.design.flywheel(m.compile(), speed="300 rpm", fluctuation=0.02)
    assert flywheel.moment == 0.0
    assert "motor 0 N m" in str(flywheel)
