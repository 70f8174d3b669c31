"""What acts at an instant of a motion: friction by statics or dynamics, and idle drives."""

import math

import numpy as np
import pytest

import blockmech as bm
from tests import machines

G = 9.81
LAWS = {
    "coulomb": lambda **more: bm.friction.Coulomb(coefficient=0.4, **more),
    "stiction": lambda **more: bm.friction.Stiction(static=0.5, kinetic=0.4, **more),
    "stribeck": lambda **more: bm.friction.Stribeck(
        static=0.5, kinetic=0.4, stribeck_speed=0.5, **more
    ),
}


def incline(law, angle=0.2, beside=False, **start):
    """A slider of 3 kg on an incline; with another driver beside it that it knows nothing of."""
    graph = bm.Graph("incline", gravity=(0.0, -G))
    graph.add("frame", bm.Frame(markers={"G": {"at": (0, 0), "angle": angle}, "H": (0, 0)}))
    graph.add("s", bm.SlideDrive(links={"slider": bm.Link(mass=3.0)}, friction={"S": law}))
    graph.connect("frame.G", "s.S")
    graph.start("s", **start)
    return other(graph) if beside else graph.compile()


def other(graph):
    """The same beside a pendulum that has nothing to do with it."""
    link = bm.Link(mass=1.0, inertia=0.1, cm=(0.5, 0.0))
    graph.add("other", bm.Crank(length=1.0, links={"crank": link}))
    graph.connect("frame.H", "other.A")
    graph.start("other", q=0.4)
    return graph.compile()


def pendulum(coefficient=0.2, beside=False, low=None, **start):
    """Mass 1 kg at 1 m, inertia 0.1 kg m2 about its centre, on a dry pin of 0.1 m."""
    link = bm.Link(mass=1.0, inertia=0.1, cm=(1.0, 0.0))
    dry = bm.friction.Coulomb(coefficient=coefficient, radius=0.1)
    graph = machines.crank(1.0, link, dry, gravity=G, name="arm", H=(2.0, 0.0))
    graph.start("arm", **start)
    if low is not None:
        graph.add_stop("arm", low=low, restitution=0.0)
    return other(graph) if beside else graph.compile()


def fourbar(beside=False, coefficient=3.0, q=1.0, coupler=2.5):
    """A heavy four-bar with dry pins, which its crank leaves at rest."""
    pin = bm.friction.Coulomb(coefficient=coefficient, radius=0.05)
    bodies = [
        bm.Link(mass=1.0, inertia=0.1, cm=(0.02, 0.0)),
        bm.Link(mass=2.0, inertia=0.3, cm=(1.2, 0.1)),
        bm.Link(mass=2.0, inertia=0.3, cm=(0.9, 0.1)),
    ]
    lengths = 1.0, coupler, 2.0, 3.0
    graph = machines.fourbar(*lengths, bodies, pin, gravity=0.4, markers={"H": (5.0, 0.0)})
    graph.start("crank", q=q)
    return other(graph) if beside else graph.compile()


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("method", ["auto", "dop853", "radau", "rk4"])
def test_a_slider_held_on_an_incline_is_held_by_its_friction(law, method):
    mechanism = incline(LAWS[law]())
    if method == "rk4":
        method = bm.FixedStep(method, 0.01)
    want = ["s.S.friction", "s.drive", "s.acceleration"]
    result = mechanism.simulate("time=1", method=method, want=want)
    assert result["s.S.friction"] == pytest.approx(5.846838405298652, rel=1e-14)  # 3 g sin 0.2
    assert np.abs(result["s.drive"]).max() < 1e-14
    assert (result["s.acceleration"] == 0).all()
    assert mechanism.verify(result).ok


@pytest.mark.parametrize("law", LAWS)
def test_a_slider_thrown_up_is_held_where_it_stands(law):
    mechanism = incline(LAWS[law](), q=0.0, rate=2.0)
    rest = mechanism.simulate("time=1").motion.events[-1]
    times = [0.0, rest.t / 2, rest.t + 1e-9, 1.0]
    result = mechanism.simulate("time=1", times=times, want=["s.S.friction", "s.drive"])
    weight, across = 3 * G * math.sin(0.2), 3 * G * math.cos(0.2)
    assert rest.kind == "rest"
    assert result["s.S.friction"][2:] == pytest.approx(weight, rel=1e-13)
    assert (result["s.S.friction"][:2] <= -0.4 * across * (1 - 1e-12)).all()  # against its way
    assert np.abs(result["s.drive"]).max() < 1e-13


def test_a_slider_that_slides_from_rest_rubs_from_the_first_instant_on():
    mechanism = incline(bm.friction.Stiction(static=0.5, kinetic=0.3), angle=0.6)
    want = ["s.S.friction", "s.drive", "s.acceleration"]
    result = mechanism.simulate("time=1", times=[0.0, 1e-9, 1.0], want=want)
    rubs = 0.3 * 3 * G * math.cos(0.6)
    assert result["s.S.friction"] == pytest.approx(rubs, rel=1e-13)
    slides = -(G * math.sin(0.6) - rubs / 3)
    assert result["s.acceleration"] == pytest.approx(slides, rel=1e-13)
    assert np.abs(result["s.drive"]).max() < 1e-13


def test_a_pendulum_released_from_rest_has_the_friction_of_its_reaction():
    mechanism = pendulum(q=0.3, rate=0.0)
    want = ["arm.acceleration", "arm.drive", "arm.A.friction", "arm.A.reaction"]
    result = mechanism.simulate("time=0.5", times=[0.0, 1e-9, 0.25], want=want)
    alpha = result["arm.acceleration"][0]
    radial, across = G * math.sin(0.3), alpha + G * math.cos(0.3)  # of R = m (a - g) at rest
    rubs = 0.02 * math.hypot(radial, across)
    assert 1.1 * alpha == pytest.approx(-G * math.cos(0.3) + rubs, rel=1e-13)
    assert result["arm.A.friction"][0] == pytest.approx(rubs, rel=1e-13)
    assert result["arm.A.friction"][1] == pytest.approx(rubs, rel=1e-8)
    assert np.abs(result["arm.drive"]).max() < 1e-14


def test_a_pendulum_that_swings_out_has_no_drive_at_any_standstill_nor_at_rest():
    mechanism = pendulum(q=-0.8)
    events = mechanism.simulate("time=40").motion.events
    times = [e.t for e in events[:-2]] + [events[-1].t + 1e-9, 40.0]
    want = ["arm.drive", "arm.A.friction", "arm.A.reaction", "arm.q"]
    result = mechanism.simulate("time=40", times=times, want=want)
    assert events[-1].kind == "rest"
    assert len(times) > 8
    assert np.abs(result["arm.drive"]).max() < 1e-13
    limits = 0.02 * np.abs(np.asarray(result["arm.A.reaction"]))
    rubs = np.abs(result["arm.A.friction"])
    assert rubs[:-2] == pytest.approx(limits[:-2], rel=1e-12)
    assert (rubs[-2:] < limits[-2:]).all()
    weight = G * np.cos(result["arm.q"][-1])
    assert result["arm.A.friction"][-1] == pytest.approx(weight, rel=1e-12)


def test_four_bar_held_by_its_pins_shares_what_balance_leaves_open():
    mechanism = fourbar()
    result = mechanism.simulate("time=1", want="*")
    pins = ("crank.A", "dyad.B", "dyad.C", "dyad.D")
    rubs = np.array([result[f"{pin}.friction"][-1] for pin in pins])
    limits = np.array([0.15 * abs(result[f"{pin}.reaction"][-1]) for pin in pins])
    assert result.motion.end in ("time", "rest")
    assert abs(result["crank.drive"][-1]) < 1e-13
    assert (np.abs(rubs) <= limits).all()
    shares = np.abs(rubs) / limits  # the least that the largest share can be: all need the same
    assert shares == pytest.approx(shares[0], rel=1e-8)
    assert 0.01 < shares[0] < 1
    assert mechanism.verify(result).ok


MACHINES = {
    "held": (lambda b: incline(LAWS["stiction"](), beside=b), "s", ["s.S.friction"]),
    "thrown": (
        lambda b: incline(LAWS["stribeck"](), beside=b, q=0.0, rate=1.0),
        "s",
        ["s.S.friction"],
    ),
    "pendulum": (lambda b: pendulum(beside=b, q=0.3), "arm", ["arm.A.friction"]),
    "fourbar": (lambda b: fourbar(b), "crank", ["crank.A.friction", "dyad.C.friction"]),
}


@pytest.mark.parametrize("machine", MACHINES)
def test_what_acts_is_the_same_beside_an_independent_driver(machine):
    make, driver, rubs = MACHINES[machine]
    want = [f"{driver}.drive", f"{driver}.acceleration", *rubs]
    alone, together = (
        make(b).simulate("time=0.2", times=[0.0], want=want, method="dop853") for b in (False, True)
    )
    for name in want:
        size = max(1.0, float(np.abs(alone[name]).max()))
        assert together[name] == pytest.approx(alone[name], abs=1e-13 * size), name


def test_what_sticks_is_part_of_the_motion_of_one_driver():
    slips = incline(LAWS["coulomb"](), q=0.0, rate=2.0).simulate("time=1").motion.slips
    stop_time = 2 / (G * (math.sin(0.2) + 0.4 * math.cos(0.2)))
    assert [s.sides for s in slips] == [(1,), (0,)]
    assert [s.begin for s in slips] == pytest.approx([0.0, stop_time], rel=1e-12)


def test_a_pendulum_that_lies_against_a_stop_leaves_its_weight_to_it():
    mechanism = pendulum(q=0.5, low=-0.5)
    want = ["arm.drive", "arm.A.friction", "arm.acceleration"]
    result = mechanism.simulate("time=2", times=[0.0, 0.1, 1.0, 2.0], want=want)
    weight = G * math.cos(0.5)  # by what pushes; the pin need not hold, and takes no part
    assert result["arm.drive"] == pytest.approx([0, 0, weight, weight], abs=1e-14, rel=1e-12)
    assert result["arm.A.friction"][2:] == pytest.approx([0, 0], abs=1e-14)
    assert (result["arm.acceleration"][2:] == 0).all()


# -- steppers --------------------------------------------------------------------------------


def two_arms():
    """Two rods in a row on dry pins."""
    dry = bm.friction.Coulomb(coefficient=0.2, radius=0.05)
    return machines.arms({"arm": 1.0, "hand": 0.5}, frictions=[dry, dry], gravity=G).compile()


HANGING = -math.pi / 2
STEPPED = {
    "both slip": (two_arms, {"arm": (0.3, 1.0), "hand": (0.4, -2.0)}, {}),
    "one starts": (two_arms, {"arm": (0.3, 1.0), "hand": (0.4, 0.0)}, {}),
    "both start": (two_arms, {"arm": (0.3, 0.0), "hand": (0.4, 0.0)}, {}),
    "one sticks": (two_arms, {"arm": (HANGING, 0.0), "hand": (0.4, 0.0)}, {}),
    "both stick": (two_arms, {"arm": (HANGING, 0.0), "hand": (0.0, 0.0)}, {}),
    "one is locked": (two_arms, {"hand": (0.4, -2.0)}, {"roles": {"arm": 0.3}}),
    "a slider is held": (lambda: incline(LAWS["stiction"]()), {"s": (0.0, 0.0)}, {}),
    "a slider slides": (lambda: incline(LAWS["stiction"]()), {"s": (0.0, 2.0)}, {}),
}


@pytest.mark.parametrize(("machine", "start", "roles"), STEPPED.values(), ids=STEPPED)
def test_a_stepper_shows_what_acts_in_the_motion(machine, start, roles):
    mechanism = machine()
    want = ["*.q", "*.rate", "*.acceleration", "*.reaction", "*.friction", "*.drive"]
    step = 0.01
    env = mechanism.stepper(want, copies=2, start=start, **roles)
    moved = mechanism.simulate(f"time={step}", times=[0.0, step], start=start, want=want, **roles)
    for at, outputs in enumerate((env.observe(), env.step(step))):
        for name, values in outputs.items():
            assert np.abs(values - moved[name].T[at]).max() <= 1e-8, name
            if name.endswith("drive") and not roles:
                assert np.abs(values).max() <= 1e-12, name


@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_of_a_copy_without_a_pose_a_stepper_knows_nothing(rate):
    env = fourbar(coupler=1.5).stepper(["crank.acceleration", "crank.drive"], copies=2)
    outputs = env.reset(copies=1, start={"crank": (math.pi, rate)})
    assert [bool(np.isnan(x[1])) for x in outputs.values()] == [True, True]
    assert [bool(np.isfinite(x[0])) for x in outputs.values()] == [True, True]
