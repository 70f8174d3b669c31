"""Springs, dampers, motors and thrusts on a single arm, where all is known by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from tests.machines import crank, load, wire

ROUNDING = 1e-13  # [-] of the largest: a hundred roundings
RATE = 3.0
Q = np.array([0.3, 1.1, 2.5, 3.3, 4.7, 100.0])
LINKS = ("frame.O e.a", "crank.crank e.b")
POINTS = ("frame.P e.a", "crank.B e.b")
P = 0.2 + 1.0j  # a marker of the frame
ENGINES = pytest.mark.parametrize("engine", ["scalar", "numpy"])


def arm(element, wires):
    """An arm of length 1 on a pivot, with one element."""
    g = crank(O=(0.0, 0.0), P=P)
    g.add("e", element)
    wire(g, *wires)
    g.drive("crank", bm.motion.ConstantRate(rate=RATE))
    return g.compile()


def moment(element, wires, **request):
    """Moment [N m] of the element about the pivot: what the drive must hold."""
    mech = arm(element, wires)
    run = mech.run(**(request or {"at": Q}))
    assert np.allclose(run["crank.drive"], run["crank.drive_by_reduction"], rtol=1e-12, atol=1e-12)
    assert mech.verify(**(request or {"at": Q})).ok
    return -run["crank.drive"]


def close(result, expected):
    return np.abs(result - expected).max() <= ROUNDING * np.abs(expected).max()


def wrapped(angle):
    """The angle in (-pi, pi]."""
    return angle - 2 * math.pi * np.ceil(angle / (2 * math.pi) - 0.5)


def test_torsion_spring_turns_the_shorter_way_back():
    result = moment(bm.TorsionSpring(stiffness=10.0, rest_angle=0.5), LINKS)
    assert np.abs(result + 10 * wrapped(Q - 0.5)).max() <= 10 * math.pi * ROUNDING


@ENGINES
def test_half_a_turn_from_rest_counts_as_positive(engine):
    mech = arm(bm.TorsionSpring(stiffness=1.0), LINKS)
    # exactly opposite directions: cos(pi) = -1, sin(pi) = 1e-16
    run = mech.run(at=[math.pi, -math.pi], want="e.b.couple", engine=engine)
    assert run["e.b.couple"] == pytest.approx([-math.pi, math.pi])
    from blockmech.ground.plane import angle

    assert angle(1 + 0j, -1 + 0j) == angle(-1 + 0j, 1 + 0j) == math.pi


@ENGINES
@pytest.mark.parametrize("free_length", [0.0, 0.4])
def test_damper_whose_ends_meet_resists_their_relative_velocity(engine, free_length):
    damper = bm.Spring(stiffness=0.0, free_length=free_length, damping=5.0)
    g = load(crank(M=(1.0, 0.0)), "e", damper, a="frame.M", b="crank.B")
    run = g.compile().run(at=[0.0], rates=RATE, engine=engine)
    assert run["e.b.force"] == [-5.0j * RATE]
    assert run["crank.drive"] == [5.0 * RATE]


def test_spring_with_a_free_length_whose_ends_meet_has_no_answer():
    mech = arm(bm.Spring(stiffness=1.0, free_length=0.5), ("crank.A e.a", "frame.O e.b"))
    with pytest.raises(bm.SingularError, match="has no value there"):
        mech.run(at=1.0, want="e.a.force")


LAWS = {
    "constant": ({"kind": "constant", "value": 5.0}, lambda x, v: 5.0 + 0 * x),
    "polynomial of the angle": (
        {"kind": "polynomial", "coefficients": [1.0, 2.0]},
        lambda x, v: 1 + 2 * x,
    ),
    "polynomial of the rate": (
        {"kind": "polynomial", "of": "rate", "coefficients": [1.0, 2.0]},
        lambda x, v: 1 + 2 * v,
    ),
    "motor curve": (
        {"kind": "dc", "stall_moment": 2.0, "no_load_speed": 30.0},
        lambda x, v: 2.0 * (1 - v / 30.0),
    ),
}


@pytest.mark.parametrize(("law", "expected"), LAWS.values(), ids=list(LAWS))
def test_motor_follows_its_law_of_relative_angle_or_rate(law, expected):
    result = moment(bm.Motor(law=law), LINKS)
    assert close(result, expected(wrapped(Q), RATE + 0 * Q))


def test_motor_of_a_driver_counts_turns():
    law = {"kind": "polynomial", "coefficients": [1.0, 2.0]}
    assert close(moment(bm.Motor(law=law, driver="crank"), LINKS), 1 + 2 * Q)


def test_motor_follows_the_time():
    law = {"kind": "fourier", "of": "time", "period": 2.0, "sines": [4.0]}
    t = np.array([0.1, 0.7, 1.9])
    result = moment(bm.Motor(law=law), LINKS, times=t)
    assert close(result, 4.0 * np.sin(math.pi * t))
    # Named by coordinate, the constant rate says the time as well.
    assert close(moment(bm.Motor(law=law), LINKS), 4.0 * np.sin(math.pi * Q / RATE))


def test_law_of_time_needs_a_request_with_time():
    law = {"kind": "fourier", "of": "time", "period": 2.0, "sines": [4.0]}
    with pytest.raises(bm.RequestError, match="times="):
        arm(bm.Motor(law=law), LINKS).run(at=Q, rates=1.0, want="crank.drive")
    kinematic = arm(bm.Motor(law=law), LINKS).run(at=Q, rates=1.0, want="crank.B.p")
    assert np.isfinite(kinematic["crank.B.p"]).all()


def test_law_outside_its_table_has_no_answer():
    law = {"kind": "table", "arguments": [0.0, 1.0], "values": [1.0, 2.0]}
    with pytest.raises(bm.SingularError, match="has no value there"):
        arm(bm.Motor(law=law), LINKS).run(at=2.0, want="crank.drive")


THRUSTS = {
    "distance": ({}, "coordinate"),
    "rate of the distance": ({}, "rate"),
    "stroke along a direction": ({"direction": (1.0, 2.0)}, "coordinate"),
    "rate of the stroke": ({"direction": (1.0, 2.0)}, "rate"),
}


@pytest.mark.parametrize(("options", "of"), THRUSTS.values(), ids=list(THRUSTS))
def test_thrust_follows_its_law_of_stroke_or_rate(options, of):
    d = np.exp(1j * Q) - P
    direction = (1 + 2j) / abs(1 + 2j) + 0 * Q if options else d / np.abs(d)
    v = 1j * RATE * np.exp(1j * Q)
    x = ((d if of == "coordinate" else v) * direction.conj()).real
    force = (3.0 - 4.0 * x) * direction
    law = {"kind": "polynomial", "of": of, "coefficients": [3.0, -4.0]}
    result = moment(bm.Thrust(law=law, **options), POINTS)
    assert close(result, (np.exp(-1j * Q) * force).imag)


def test_gas_force_follows_a_table_over_the_crank_angle():
    angles = np.arange(8) * math.pi / 2
    values = [1.0, 30.0, 9.0, 4.0, 1.0, 1.0, 1.0, 0.9]
    law = {
        "kind": "table",
        "arguments": angles.tolist(),
        "values": values,
        "interpolation": "linear",
        "turns": 2,
    }
    gas = bm.Thrust(law=law, driver="crank", direction=(1.0, 0.0))
    result = moment(gas, POINTS)
    size = np.interp(Q % (4 * math.pi), [*angles, 4 * math.pi], [*values, 1.0])
    assert close(result, -size * np.sin(Q))


def test_thrust_on_a_moving_link_presses_it_with_the_opposite_force():
    g = bm.Graph("cylinder")
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0)}))
    guide = bm.Marker(at=(0.5, 0.0), angle=0.0)
    g.add("arm", bm.Crank(links={"crank": bm.Link(markers={"g": guide, "head": (0.2, 0.0)})}))
    g.add("rod", bm.SlideDrive())
    g.add("oil", bm.Thrust(law={"kind": "constant", "value": 70.0}, direction=(1.0, 0.0)))
    wire(g, "frame.O arm.A", "arm.g rod.S", "arm.head oil.a", "rod.S oil.b")
    run = g.compile().run(at={"arm": [0.4, 2.0], "rod": [0.1, 0.3]}, rates={"arm": 1.0})
    assert np.abs(run["rod.drive"] + 70.0).max() <= 70 * ROUNDING
    assert np.abs(run["arm.drive"]).max() <= 70 * ROUNDING  # the forces meet on one line
    assert np.abs(run["arm.A.reaction"]).max() <= 70 * ROUNDING


def test_driver_of_a_law_that_asks_for_none_is_refused():
    with pytest.raises(bm.GraphError, match="constant"):
        bm.Motor(law={"kind": "constant", "value": 1.0}, driver="crank")


def test_what_a_load_depends_on_is_declared():
    law = {"kind": "polynomial", "of": "rate", "coefficients": [1.0]}
    assert bm.Motor(law=law).reads() == {"a": ("om",), "b": ("om",)}
    assert bm.Motor(law=law, driver="crank").reads() == {"driver": ("qd",)}
    timely = {"kind": "polynomial", "of": "time", "coefficients": [1.0]}
    assert bm.Thrust(law=timely).reads() == {"a": ("p",), "b": ("p",), "time": ("t",)}
    assert bm.Motor(law={"kind": "constant", "value": 1.0}).reads() == {}


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_the_coordinate_of_a_thrust_is_measured_along_its_direction(sense):
    g = bm.Graph("press")
    g.add("frame", bm.Frame(markers={"O": bm.Marker(at=(0.0, 0.0), angle=0.0)}))
    g.add("ram", bm.SlideDrive(offset=0.3))
    law = {"kind": "polynomial", "coefficients": [0.0, 100.0]}  # 100 N per metre
    g.add("push", bm.Thrust(law=law, direction=(sense, 0.0)))
    wire(g, "frame.O ram.S", "frame.O push.a", "ram.S push.b")
    # the ram is at 0.5 m: a coordinate of 0.5 m pushes along +x, one of -0.5 m along -(-x)
    assert g.run(at=0.2)["push.b.force"][0] == pytest.approx(50.0)
    for cls in (bm.Thrust, bm.Motor):
        assert "law's coordinate" in cls.__doc__
        assert cls.coordinate_text


def test_a_load_along_a_line_says_its_length_and_its_tension():
    """Of a spring with a damper between two points, and of both along a guide."""
    m = bm.Linkage("press")
    m.add_link("ram", mass=1.0)
    m.add_joint("G", "P", ["frame", "ram"], point=(0.2, 0.0), angle=0.0)
    m.add_driver("drive", "G", bm.motion.ConstantRate(rate="0.5 m/s", end="0.1 m"))
    values = {"stiffness": 100.0, "free_length": 0.25, "damping": 8.0}
    m.add_load("between", "spring", links=["frame", "ram"], at=[(0, 0), (0.2, 0)], **values)
    m.add_load("along", "spring", joint="G", **values | {"free_length": 0.02})
    m.add_load("push", "thrust", joint="G", law=bm.laws.Constant(value=30.0))
    run = m.run(at=[0.0, 0.03, 0.1])
    q = run["joint.G.coordinate"]
    assert run["between.length"] == pytest.approx(0.2 + q)
    assert run["between.tension"] == pytest.approx(100.0 * (0.2 + q - 0.25) + 8.0 * 0.5)
    assert run["between.tension"] == pytest.approx(run["between.a.force"].real)
    assert run["along.length"] == pytest.approx(q)
    assert run["along.tension"] == pytest.approx(100.0 * (q - 0.02) + 8.0 * 0.5)
    assert run["push.tension"] == pytest.approx(-30.0)
    with pytest.raises(bm.RequestError, match=r'did you mean "along\.tension"'):
        m.run(at=0.0, want="along.force")
