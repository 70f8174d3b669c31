"""Meshes that lose power, against closed forms and an integration that knows nothing of them.

What comes out is the efficiency times what goes in. Felt by the leader is 1 / eta of what it would
be without losses where power goes to the driven side, eta of it where it comes back.
"""

from __future__ import annotations

import cmath
import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import blockmech as bm
from blockmech.ground.errors import GraphError
from tests import machines
from tests.gallery import GRAPHS

ROUNDING = 1e-12  # [-] some thousand roundings
ETA = 0.8


def machine(markers, mesh, blocks, gravity=(0.0, 0.0)):
    """Blocks on markers of the frame, and what couples them; loads on their first links."""
    g = bm.Graph("machine", gravity=gravity)
    g.add("frame", bm.Frame(markers=markers))
    for name, (block, wire, load) in blocks.items():
        g.add(name, block)
        g.connect(wire, f"{name}.{'S' if isinstance(block, bm.SlideDrive) else 'A'}")
        if load is not None:
            crank = isinstance(load, bm.Couple)
            g.add(f"{name}_load", load)
            link = f"{name}.{'crank' if isinstance(block, bm.Crank) else 'slider'}"
            g.connect(link, f"{name}_load.{'on' if crank else 'at'}")
    for name, coupling in mesh.items():
        g.add(name, coupling)
    return g


def gears(load=0.0, motor=0.0, eta=ETA, rub=0.0, cm=0.0, **options):
    """A pinion of 20 teeth and a wheel of 40, 60 mm from it, maybe with its mass aside."""
    friction = {"A": bm.friction.Coulomb(coefficient=rub, radius=0.01)} if rub else {}
    wheel = bm.Link(mass=0.5 if cm else 0.0, inertia=3e-4, cm=(cm, 0.0))
    options = {"teeth": (20, 40), "pressure_angle": 0.3} | options
    return machine(
        {"A": (0.0, 0.0), "B": (0.06, 0.0)},
        {"mesh": bm.Gear(driver="pinion", driven="wheel", efficiency=eta, **options)},
        {
            "pinion": (
                bm.Crank(links={"crank": bm.Link(inertia=2e-5)}),
                "frame.A",
                bm.Couple(moment=motor),
            ),
            "wheel": (
                bm.Crank(links={"crank": wheel}, friction=friction),
                "frame.B",
                bm.Couple(moment=load),
            ),
        },
        gravity=(0.0, -9.81 if cm else 0.0),
    )


def rack(lead, push=0.0, moment=0.0):
    """A rack under a pinion, either leading."""
    follower = "rack" if lead == "pinion" else "pinion"
    return machine(
        {"A": (0.0, 0.0), "G": bm.Marker(at=(0.1, -0.02), dir=(1.0, 0.0))},
        {"mesh": bm.Rack(driver=lead, driven=follower, radius=0.02, efficiency=ETA)},
        {
            "pinion": (bm.Crank(), "frame.A", bm.Couple(moment=moment)),
            "rack": (bm.SlideDrive(), "frame.G", bm.Force(force=(push, 0.0))),
        },
    )


def belt(moment, **options):
    """A belt from a small wheel to one twice its size."""
    coupling = bm.Belt(driver="one", driven="two", radii=(0.05, 0.1), efficiency=ETA, **options)
    return machine(
        {"A": (0.0, 0.0), "B": (0.3, 0.1)},
        {"mesh": coupling},
        {
            "one": (bm.Crank(), "frame.A", None),
            "two": (bm.Crank(), "frame.B", bm.Couple(moment=moment)),
        },
    )


def planetary(ring, mesh, load, mass=False, suns=((60, 18), (18, 24)), internal=True):
    """Carrier, planet, sun; a ring, or another sun, that is fixed to the frame."""
    links = [{"crank": bm.Link(mass=m, inertia=J)} for m, J in ((0, 3e-4), (0.3, 1e-5), (0, 2e-5))]
    carrier, planet, sun = links if mass else ({}, {}, {})
    first = bm.Gear(
        driver="frame.O", driven="planet", teeth=suns[0], internal=internal, efficiency=ring
    )
    return machine(
        {"O": (0.0, 0.0)},
        {
            "ring": first,
            "mesh": bm.Gear(driver="planet", driven="sun", teeth=suns[1], efficiency=mesh),
        },
        {
            "carrier": (bm.Crank(length=0.042, links=carrier), "frame.O", None),
            "planet": (bm.Crank(links=planet), "carrier.B", None),
            "sun": (bm.Crank(links=sun), "frame.O", bm.Couple(moment=load)),
        },
    )


def cranks(load, coupling):
    """Two cranks and whatever couples them."""
    return machine(
        {"A": (0.0, 0.0), "B": (0.3, 0.1)},
        {"mesh": coupling},
        {
            "one": (bm.Crank(sign=-1), "frame.A", None),
            "two": (bm.Crank(), "frame.B", bm.Couple(moment=load)),
        },
    )


def box(load, pair="RR", senses=(1, -1)):
    """A black box between cranks or slides, either of which may count the other way."""
    g = bm.Graph("box")
    guide = bm.Marker(at=(0.3, 0.1), angle=0.4)
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "B": guide}))
    for name, kind, sense in zip(("one", "two"), pair, senses, strict=True):
        g.add(name, bm.Crank(sign=sense) if kind == "R" else bm.SlideDrive(sign=sense))
        g.connect(
            "frame.A" if (name, kind) == ("one", "R") else "frame.B", f"{name}.{'AS'[kind == 'P']}"
        )
    g.add(
        "load", bm.Couple(moment=load) if pair[1] == "R" else bm.Force(force=cmath.rect(load, 0.4))
    )
    g.connect(*(("two.crank", "load.on") if pair[1] == "R" else ("two.slider", "load.at")))
    law = {"kind": "polynomial", "coefficients": [0.1, -0.3, 0.2]}
    g.add("mesh", bm.Ratio(driver="one", driven="two", law=law, efficiency=ETA))
    return g


SLOTS = bm.Geneva(driver="one", driven="two", slots=6, pin=0.1, efficiency=ETA)
MACHINES = {
    "geneva": lambda load: cranks(load, SLOTS),
    "box": box,
    "box RP": lambda load: box(load, "RP", (-1, -1)),
    "box PR": lambda load: box(load, "PR", (-1, 1)),
    "box PP": lambda load: box(load, "PP"),
    "gear": lambda load: gears(load),
    "ring": lambda load: gears(load, internal=True),
    "pinion leads": lambda load: rack("pinion", push=load),
    "rack leads": lambda load: rack("rack", moment=load),
    "chain": belt,
    "crossed": lambda load: belt(load, crossed=True),
    "belt": lambda load: belt(load, preload=100.0),
}
BOX = -0.3 + 2 * 0.2 * 0.2  # q = 0.1 - 0.3 x + 0.2 x^2 at x = 0.2
LAM, PIN = 0.5, math.cos(0.2 + 0.1)  # sin(pi / 6); the pin's place on its way back
GENEVA = LAM * (PIN - LAM) / (1 - 2 * LAM * PIN + LAM**2)
SLOPES = {"geneva": GENEVA, "box": -BOX, "box RP": -BOX, "box PR": BOX, "box PP": -BOX}
SLOPES |= {"gear": -0.5, "ring": 0.5, "pinion leads": 0.02, "rack leads": 50.0, "crossed": -0.5}


@pytest.mark.parametrize("rate", [3.0, -3.0])
@pytest.mark.parametrize("load", [2.0, -2.0])
@pytest.mark.parametrize("name", MACHINES)
def test_of_what_goes_in_the_efficiency_comes_out(name, load, rate):
    mech = MACHINES[name](load).compile()
    (lead,) = mech.drivers
    state = {"at": [0.2], "rates": rate}
    ideal = -load * SLOPES.get(name, 0.5)  # effort of the leader without losses
    felt = ideal / ETA if ideal * rate > 0 else ideal * ETA
    for engine in ("numpy", "scalar", "llvm"):
        run = mech.run(**state, engine=engine)
        assert run[f"{lead}.drive"][0] == pytest.approx(felt, rel=ROUNDING)
        assert run["mesh.loss"][0] == pytest.approx((felt - ideal) * rate, rel=ROUNDING)
        assert run["mesh.loss"][0] == run["mechanism.friction_power"][0] > 0
    without = mech.run(**state, friction="none")
    assert without[f"{lead}.drive"][0] == pytest.approx(ideal, rel=ROUNDING)
    assert without["mesh.loss"][0] == 0.0
    for friction in ("none", "newton"):
        assert mech.verify(**state, accelerations=4.0, friction=friction)


def test_bearings_take_what_both_moments_leave():
    """Statics of both wheels: the force across the line of centres is (M1 + M2) / distance."""
    run = gears(2.0).compile().run(at=[0.4], rates=-7.0, want=["mesh.force", "pinion.drive"])
    assert run["mesh.force"][0].imag == pytest.approx((run["pinion.drive"][0] + 2.0) / 0.06)


def test_a_mesh_at_rest_holds_as_teeth_do():
    run = gears(2.0).compile().run(at=[0.4])
    assert [flag.where for flag in run.quality.flags] == ["mesh"]
    assert run["pinion.drive"][0] == pytest.approx(1.0, rel=ROUNDING)


def test_friction_of_the_driven_pin_goes_through_the_mesh():
    run = gears(-2.0, rub=0.1).compile().run(at=[0.0], rates=100.0)
    effort = 2.0 + run["wheel.A.friction"][0] * -1.0
    assert run["mesh.effort"][0] == pytest.approx(effort, rel=ROUNDING)
    assert run["pinion.drive"][0] == pytest.approx(-0.5 * ETA * effort, rel=ROUNDING)
    assert run["wheel.A.friction"][0] == pytest.approx(
        0.1 * 0.01 * abs(run["wheel.A.reaction"][0]), rel=ROUNDING
    )


@pytest.mark.parametrize("rate", [10.0, -10.0])
def test_a_planetary_set_loses_by_the_power_between_its_wheels(rate):
    """Ring fixed, z_r / z_s = 2.5: M_c = -M_s (1 + 2.5 eta0), eta0 of both meshes together.

    Power rolls from the sun to the ring where the sun drives, else back (Mueller, Die
    Umlaufgetriebe, 1998, ch. 5). The carrier leads, so both meshes have its sense.
    """
    mech = planetary(0.97, 0.95, load=-1.0).compile()
    run = mech.run(at=[0.3], rates=rate)
    product = 0.97 * 0.95
    felt = 1 + 2.5 / product if rate > 0 else 1 + 2.5 * product
    assert run["carrier.drive"][0] == pytest.approx(felt, rel=ROUNDING)
    assert run["ring.loss"][0] + run["mesh.loss"][0] == pytest.approx(
        (felt - 3.5) * rate, rel=1e3 * ROUNDING
    )
    assert mech.verify(at=[0.3, 0.8], rates=rate, accelerations=5.0)


# -- motion ------------------------------------------------------------------------------


def acceleration(q, sense, motor, cm):
    """q'' of the pinion by Newton's laws of both wheels, for the sense of power that agrees."""
    m, J1, J2, s = (0.5 if cm else 0.0), 2e-5, 3e-4, -0.5
    J2 = J2 + m * cm**2
    turning = -m * 9.81 * cm * math.cos(s * q)  # of the weight, about the wheel's pin
    solutions = []
    for factor in (1 / ETA, ETA):
        a = (motor + factor * s * turning) / (J1 + factor * s * s * J2)
        out = s * (J2 * s * a - turning) * sense  # power to the wheel, per rate
        if (out > 0) == (factor > 1):
            solutions.append(a)
    (only,) = solutions
    return only


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_a_swinging_wheel_moves_as_newton_says_for_both_wheels(method):
    """From one standstill to another and past it, the sense of power changing on the way."""
    motor, cm, t_end = 0.05, 0.1, 0.6
    g = gears(motor=motor, cm=cm)
    g.start("pinion", q=1.0, rate=0.0)
    legs, t, state, sense = [], 0.0, [1.0, 0.0], 0
    while t < t_end:
        sense = -sense or next(x for x in (1, -1) if x * acceleration(state[0], x, motor, cm) > 0)
        assert sense * acceleration(state[0], sense, motor, cm) > 0  # it does not stay

        def turns(_, y, sense=sense):
            return y[1] * sense

        turns.terminal, turns.direction = True, -1

        def rhs(_, y, sense=sense):
            return [y[1], acceleration(y[0], sense, motor, cm)]

        solution = solve_ivp(
            rhs, (t, t_end), state, "DOP853", events=turns, rtol=1e-12, atol=1e-13, max_step=2e-3
        )
        t, state = float(solution.t[-1]), [float(solution.y[0, -1]), 0.0]
        legs.append(solution)
    assert len(legs) > 1
    motion = g.compile().simulate(f"time={t_end}", method=method, accuracy=1e-9).motion
    assert motion.q_end == pytest.approx(legs[-1].y[0, -1], abs=1e-7)
    assert motion.qd_end == pytest.approx(legs[-1].y[1, -1], abs=1e-5)


@pytest.mark.parametrize("motor", [0.79, 0.81, 1.24, 1.26])
def test_a_mesh_holds_between_its_two_efforts(motor):
    """A load of 2 N m on the wheel asks for 1 N m, so 0.8 to 1.25 N m hold it."""
    g = gears(2.0, motor)
    g.start("pinion", q=0.0)
    motion = g.compile().simulate("time=0.01").motion
    factor = 1 / ETA if motor > 1.25 else ETA
    moves = 0.0 if 0.8 < motor < 1.25 else (motor - factor) / (2e-5 + factor * 3e-4 / 4)
    assert motion.q_end == pytest.approx(moves * 0.01**2 / 2, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("method", ["dop853"])
def test_a_planetary_set_moves_as_newton_says(method):
    """Carrier at a = al_c: moments and forces of planet, sun and carrier, meshes at one sense."""
    g = planetary(0.9, 0.8, load=-1.0, mass=True)
    g.start("carrier", q=0.0, rate=200.0)
    motion = g.compile().simulate("time=0.05", method=method).motion
    r_c = 0.042

    def residual(a):
        # the sun's effort, per unit of the planet's, and so on: powers in the carrier's axes
        sun, planet = 3.5 * a, (1 - 60 / 18) * a
        by_sun = 1.0 + 2e-5 * sun  # what must drive the sun
        down = -18 / 24 * by_sun / 0.8  # felt by the planet: x of the mesh falls while power is out
        by_planet = 1e-5 * planet + down
        up = 60 / 18 * by_planet / 0.9  # felt by the ring
        # all moments about O: the frame gives the ring's, nothing drives the carrier
        return (3e-4 + 0.3 * r_c**2) * a + 1e-5 * planet + 2e-5 * sun + 1.0 - up

    unit, zero = residual(1.0), residual(0.0)
    a = -zero / (unit - zero)
    assert motion.qd_end == pytest.approx(200.0 + 0.05 * a, rel=1e-10)


def test_a_set_of_two_nearly_equal_suns_locks_itself():
    """1 - (51/50)(49/50) = 1/2500: the load on the sun never moves the carrier, either way."""
    suns = (51, 50), (49, 50)
    for load in (1.0, -1.0):
        g = planetary(0.98, 0.98, load, mass=True, suns=suns, internal=False)
        g.start("carrier", q=0.3)
        mech = g.compile()
        for rate in (10.0, -10.0):
            assert mech.run(at=[0.3], rates=rate)["carrier.power"][0] > 0
        assert mech.simulate("time=1").motion.q_end == 0.3
        assert mech.simulate("time=0.01", friction="none").motion.q_end != 0.3


def test_several_drivers_move_as_newton_says():
    """Sun, planet and carrier without a ring, the sun driven by the mesh alone."""
    g = bm.Graph("differential")
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0)}))
    g.add("carrier", bm.Crank(length=0.042, links={"crank": bm.Link(inertia=3e-4)}))
    g.add("planet", bm.Crank(links={"crank": bm.Link(mass=0.3, inertia=1e-5)}))
    g.add("sun", bm.Crank(links={"crank": bm.Link(inertia=2e-5)}))
    g.add("mesh", bm.Gear(driver="planet", driven="sun", teeth=(18, 24), efficiency=ETA))
    g.add("load", bm.Couple(moment=0.3))
    machines.wire(
        g, "frame.O carrier.A", "carrier.B planet.A", "frame.O sun.A", "sun.crank load.on"
    )
    g.start("carrier", q=0.0, rate=10.0)
    g.start("planet", q=0.0, rate=100.0)
    motion = g.compile().simulate("time=0.02").motion
    i, J, load = -18 / 24, 3e-4 + 0.3 * 0.042**2, 0.3

    def accelerations(sense):
        """Of carrier, and planet on it, by sun, planet, and the moments of all about O."""
        for factor in (1 / ETA, ETA):
            # unknown: both, f felt by the planet, Q that drives the sun
            A = np.array(
                [
                    [-2e-5, -2e-5 * i, 0.0, 1.0],
                    [1e-5, 1e-5, 1.0, 0.0],
                    [J + 1e-5, 1e-5, 0.0, 1.0],
                    [0.0, 0.0, 1.0, -factor * i],
                ]
            )
            x = np.linalg.solve(A, [-load, 0.0, 0.0, 0.0])
            if (x[3] * i * sense > 0) == (factor > 1):
                return x[:2]
        raise AssertionError("no sense of power agrees")

    slowing, back = accelerations(1), accelerations(-1)
    turned = -100.0 / slowing[1]  # [s] until the planet turns back on its carrier
    assert 0 < turned < 0.02
    assert back[1] < 0
    expected = np.array([10.0, 100.0]) + turned * slowing + (0.02 - turned) * back
    assert motion.qd_end == pytest.approx(expected, rel=1e-9)


def test_a_motion_needs_no_drive_and_loses_what_the_mesh_takes():
    g = gears(motor=0.05, cm=0.1)
    g.start("pinion", q=1.0, rate=0.0)
    result = g.compile().simulate("time=0.1", want="*", times=np.linspace(0.0, 0.1, 2001))
    assert np.abs(result["pinion.drive"][1:]).max() <= 1e-9 * np.abs(result["mesh.effort"]).max()
    heat = np.trapezoid(result["mesh.loss"], dx=0.1 / 2000)
    assert heat == pytest.approx(result.motion.facts["friction_work"], rel=1e-6)


# -- files and mistakes ------------------------------------------------------------------


@pytest.mark.parametrize("value", [0.0, 1.2, -0.5])
def test_what_is_no_efficiency_is_refused(value):
    with pytest.raises(GraphError, match="efficiency"):
        bm.Gear(driver="a", driven="b", teeth=(20, 40), efficiency=value)


def test_an_efficiency_of_one_is_no_friction():
    mech = gears(2.0, eta=1.0).compile()
    assert mech.frictional_joints == ()
    assert "mesh.loss" not in mech.outputs


def test_studies_and_derivatives_know_it():
    """d/d eta of load / (2 eta)."""
    g = gears(2.0)
    g.drive("pinion", bm.motion.ConstantRate(rate=3.0))
    mech = g.compile()
    study = mech.study({"mesh.efficiency": [0.5, 0.8, 1.0]}, times=[0.0], want="max(pinion.drive)")
    assert study["max(pinion.drive)"] == pytest.approx([2.0, 1.25, 1.0], rel=ROUNDING)
    slope = mech.sensitivity("pinion.drive", ["mesh.efficiency"], times=[0.0])
    assert slope["pinion.drive", "mesh.efficiency"][0] == pytest.approx(-1 / ETA**2, rel=ROUNDING)


def test_a_document_of_links_and_joints_has_it():
    data = json.loads((GRAPHS / "joints" / "rack_gripper.json").read_text(encoding="utf-8"))
    ideal = bm.Linkage.from_json(json.dumps(data)).compile()
    for coupling in data["couplings"].values():
        coupling["efficiency"] = ETA
    mech = bm.Linkage.from_json(json.dumps(data)).compile()
    (lead,) = mech.drivers
    request = {"at": [0.001], "rates": 0.1, "static": True}
    run, without = mech.run(**request), ideal.run(**request)
    losses = sum(run[f"{name}.loss"][0] for name in data["couplings"])
    power = without[f"driver.{lead}.power"][0]
    assert losses == pytest.approx(power * (1 / ETA - 1) if power > 0 else power * (ETA - 1))
    assert run[f"driver.{lead}.power"][0] - power == pytest.approx(losses, rel=1e-9)
