"""Gear wheels, on the frame and on carriers, against laws that know nothing of couplings."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import blockmech as bm
from blockmech.ground.errors import GraphError
from tests.gallery import GRAPHS, mechanism
from tests.independent import newton
from tests.machines import wire

ROUNDING = 1e-12  # [-] some thousand roundings
ANGLE = math.radians(20.0)
# Worked out in mpmath, 30 digits, by Newton's laws and by the reduced inertia, which agree.
J_SUN = 9.21342403628118e-05
ACCELERATIONS = {"sun": 2790.95867215342, "carrier": 797.416763472406, "planet": -1860.63911476895}
TOOTH = {"mesh": 31.0075344398721, "ring": 29.9738460427783}  # tangential [N]
RADIAL = 11.2858195740976  # [N] of the sun's tooth
PIN = 50.9339292628981  # [N] of the planet, where teeth push along the tangent


def planetary(angle=ANGLE, rub=0.0):
    """Module 2 mm, 24, 18 and 60 teeth; the carrier leads, so that all is linear from it."""
    g = bm.Graph("planetary")
    friction = {"A": bm.friction.Coulomb(coefficient=rub, radius=0.005)} if rub else {}
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0)}))
    g.add("carrier", bm.Crank(length=0.042, links={"crank": bm.Link(inertia=3e-4)}))
    wheel = bm.Link(mass=0.3, inertia=1e-5)
    g.add("planet", bm.Crank(links={"crank": wheel}, friction=friction))
    g.add("sun", bm.Crank(links={"crank": bm.Link(inertia=2e-5)}))
    ring, teeth = {"internal": True, "pressure_angle": angle}, {"pressure_angle": angle}
    g.add("ring", bm.Gear(driver="frame.O", driven="planet", teeth=(60, 18), **ring))
    g.add("mesh", bm.Gear(driver="planet", driven="sun", teeth=(18, 24), **teeth))
    g.add("motor", bm.Couple(moment=0.8))
    g.add("drum", bm.Couple(moment=-1.9))
    return wire(
        g,
        "frame.O carrier.A",
        "carrier.B planet.A",
        "frame.O sun.A",
        "sun.crank motor.on",
        "carrier.crank drum.on",
    )


def pair(teeth, rub=0.0, sense=1, **gear):
    """Two heavy cranks side by side."""
    g = bm.Graph("pair", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "E": (0.5, 0.1)}))
    heavy = {"crank": bm.Link(mass=1.2, inertia=0.1, cm=(0.1, 0.05))}
    friction = {"A": bm.friction.Coulomb(coefficient=rub, radius=0.05)} if rub else {}
    g.add("one", bm.Crank(links=heavy, friction=friction))
    g.add("two", bm.Crank(links=heavy, friction=friction, sign=sense))
    wire(g, "frame.A one.A", "frame.E two.A")
    g.add("mesh", bm.Gear(driver="one", driven="two", teeth=teeth, **gear))
    return g


# -- planetary set ---------------------------------------------------------------------


def test_planetary_set_has_one_freedom_and_reduces_to_the_sun():
    mech = planetary().compile()
    assert mech.drivers == ("carrier",)
    assert mech.structure.mobility == 1
    run = mech.run(at=[0.0, 1.1], rates=2.0)
    assert run["sun.rate"] == pytest.approx(7.0, rel=ROUNDING)
    assert run["planet.crank.omega"] == pytest.approx(-2.0 * 7 / 3, rel=ROUNDING)
    assert run["carrier.J_red"] / 3.5**2 == pytest.approx(J_SUN, rel=ROUNDING)


@pytest.mark.parametrize("method", ["energy", "dop853", "radau"])
def test_planetary_set_accelerates_as_newton_says(method):
    motion = (
        planetary()
        .compile()
        .simulate("time=0.1", start={"carrier": (0.0, 0.0)}, method=method, want="*")
    )
    for name, al in ACCELERATIONS.items():
        rate = motion[f"{name}.crank.omega"][-1]
        assert rate == pytest.approx(0.1 * al, rel=1e-9 if method == "radau" else ROUNDING)


@pytest.mark.parametrize("at", [0.0, 0.3, 2.0])
def test_teeth_of_the_planetary_set_push_as_newton_says(at):
    mech = planetary().compile()
    run = mech.run(at=at, rates=3.0, accelerations=ACCELERATIONS["carrier"])
    assert abs(run["carrier.drive"][0]) <= ROUNDING
    for name, tangential in TOOTH.items():
        tooth_force = tangential / math.cos(ANGLE)
        assert abs(run[f"{name}.force"][0]) == pytest.approx(tooth_force, rel=ROUNDING)
    u = np.exp(1j * at)  # from the sun's centre to the pitch point
    radial = (run["mesh.force"][0] * np.conj(u)).real
    assert radial == pytest.approx(-RADIAL, rel=ROUNDING)  # the sun is pushed to its centre
    assert planetary(0.0).compile().run(at=at, accelerations=ACCELERATIONS["carrier"])[
        "planet.A.reaction"
    ] == pytest.approx(abs_of(PIN, at), rel=1e-9)


def abs_of(size, at):
    """The planet's pin carries the carrier's moment, along the common tangent."""
    carrier = (-1.9 - 3e-4 * ACCELERATIONS["carrier"]) / 0.042
    assert abs(carrier) == pytest.approx(size, rel=ROUNDING)
    return carrier * 1j * np.exp(1j * at)


# -- forces against Newton's laws, link by link --------------------------------------------


@pytest.mark.parametrize("teeth", [(20, 30), (30, 20)])
@pytest.mark.parametrize("internal", [False, True])
@pytest.mark.parametrize("angle", [0.0, ANGLE])
def test_reactions_are_those_of_newtons_laws(teeth, internal, angle):
    mech = pair(teeth, internal=internal, pressure_angle=angle).compile()
    run = mech.run(at=0.7, rates=2.0, accelerations=-5.0)
    ratio = teeth[0] / teeth[1] * (1 if internal else -1)
    A, E = 0j, 0.5 + 0.1j
    P = (A - ratio * E) / (1 - ratio)
    bodies = {}
    turns = (("one", A, 0.7, 2.0, -5.0), ("two", E, *(ratio * x for x in (0.7, 2.0, -5.0))))
    for name, o, q, om, al in turns:
        arm = (0.1 + 0.05j) * np.exp(1j * q)
        bodies[name] = newton.Body(1.2, 0.1, o + arm, (1j * al - om * om) * arm, al, -1.2 * 9.81j)
    effort = run["mesh.effort"][0]
    centre_line = (E - A) / abs(E - A)
    flank = 1j * centre_line * np.sign(effort * ((P - E) / centre_line).real)
    tooth_normal = flank * math.cos(angle) + centre_line * (-1 if internal else 1) * math.sin(angle)
    pushes = newton.pin("frame", "one", A, "A") | newton.pin("frame", "two", E, "E")
    pushes |= {
        "tooth": newton.Push("one", "two", P, tooth_normal),
        "drive": newton.Push("frame", "one"),
    }
    result = newton.solved(bodies, pushes)
    assert result["tooth"] > 0  # a tooth pushes
    assert run["mesh.force"][0] == pytest.approx(result["tooth"] * tooth_normal, rel=ROUNDING)
    assert run["one.drive"][0] == pytest.approx(result["drive"], rel=ROUNDING)
    for name, pin in (("one", "A"), ("two", "E")):
        force = complex(result[f"{pin}.x"], result[f"{pin}.y"])
        assert run[f"{name}.A.reaction"][0] == pytest.approx(force, rel=ROUNDING)


def test_friction_of_a_driven_pin_counts_the_tooth_force():
    mech = pair((20, 30), rub=0.2).compile()
    ask = {"at": [0.1, 0.7, 2.0], "rates": 2.0, "accelerations": -5.0}
    run = mech.run(**ask)
    bound = 0.2 * 0.05 * np.abs(run["two.A.reaction"])
    np.testing.assert_allclose(np.abs(run["two.A.friction"]), bound, rtol=ROUNDING)
    assert mech.verify(**ask, friction="newton").ok
    assert planetary(rub=0.3).compile().verify(**ask, friction="newton").ok


@pytest.mark.parametrize("angle", [0.0, ANGLE])
def test_motion_with_friction_is_where_no_drive_is_needed(angle):
    mech = pair((20, 30), rub=0.1, phase=0.3, pressure_angle=angle).compile()
    ask = {"start": {"one": (0.2, 3.0)}, "want": "*"}
    implicit, explicit = (mech.simulate("time=0.4", method=m, **ask) for m in ("radau", "dop853"))
    assert implicit["one.q"][-1] == pytest.approx(explicit["one.q"][-1], rel=1e-10)
    size = np.abs(implicit["mesh.effort"]).max()
    assert np.abs(implicit["one.drive"]).max() <= 1e-11 * size


# -- motion ----------------------------------------------------------------------------


def test_a_ratio_of_minus_one_is_the_mirror_image_of_a_driver_that_counts_clockwise():
    ask = {"at": np.linspace(0.0, 6.0, 7), "rates": 2.0, "accelerations": 1.0}
    plain, turned = (pair((20, 20), sense=s).compile().run(**ask) for s in (1, -1))
    np.testing.assert_array_equal(plain["two.q"], -plain["one.q"])
    np.testing.assert_array_equal(turned["two.q"], turned["one.q"])
    for name in ("two.crank.angle", "one.drive", "mesh.force", "one.J_red"):
        np.testing.assert_allclose(plain[name], turned[name], rtol=ROUNDING, atol=1e-15)


@pytest.mark.parametrize(("teeth", "turns"), [((20, 20), 1), ((20, 30), 3), ((31, 20), 20)])
def test_poses_repeat_when_all_wheels_are_back(teeth, turns):
    mech = pair(teeth).compile()
    assert mech.structure.turns("one") == turns
    ask = {"start": {"one": (0.3, 40.0)}, "want": "one.rate"}
    explicit, implicit = (mech.simulate("time=0.5", method=m, **ask) for m in ("dop853", "radau"))
    assert implicit["one.rate"][-1] == pytest.approx(explicit["one.rate"][-1], rel=1e-9)


def test_a_run_of_one_turn_says_after_how_many_it_repeats():
    data = json.loads((GRAPHS / "geared_fivebar.json").read_text("utf-8"))
    assert not bm.Graph.from_data(data).compile().run().notes()
    data["blocks"]["mesh"]["teeth"] = [20, 40]
    mech = bm.Graph.from_data(data).compile()
    (note,) = mech.run().notes()
    assert mech.extremes("dyad.C.p.x").notes == mech.stroke("dyad.C.p.x").notes == (note,)
    assert note in mech.draw(trace="dyad.C").texts[0].get_text().replace("\n", " ")
    advice = 'a law of motion with end="2 turns" shows all'
    assert note == f"the mechanism repeats after 2 turns of first: {advice}"
    data["scene"]["drive"]["first"]["to"] = "2 turns"
    path = bm.Graph.from_data(data).compile().run(want="dyad.C.p")["dyad.C.p"]
    assert abs(path[-1] - path[0]) < 1e-12
    assert abs(path[180] - path[0]) > 0.1


def test_engines_agree():
    mech, ask = mechanism("geared_fivebar"), {"at": np.linspace(0.0, 7.0, 30), "rates": 2.0}
    batch = mech.run(**ask, engine="numpy")
    for engine in ("scalar", "llvm"):
        run = mech.run(**ask, engine=engine)
        for name in ("first.drive", "mesh.force", "dyad.C.reaction"):
            np.testing.assert_allclose(run[name], batch[name], rtol=1e-11)


def test_derivatives_by_phase_and_places():
    mech = mechanism("geared_fivebar")
    at = {"at": 0.4, "rates": 2.0}
    slope = mech.sensitivity("first.drive", ["mesh.phase", "frame.E.x"], **at)
    step = 1e-6
    for name, value in (("mesh.phase", 0.5), ("frame.E.x", 2.0)):
        ends = [
            bm.Graph.load(GRAPHS / "geared_fivebar.json").replace({name: value + h}).compile()
            for h in (-step, step)
        ]
        low, high = (e.run(**at)["first.drive"][0] for e in ends)
        assert slope["first.drive", name][0] == pytest.approx((high - low) / (2 * step), rel=1e-6)


# -- refusals --------------------------------------------------------------------------


def problem_of(graph):
    with pytest.raises(GraphError) as caught:
        graph.compile()
    (problem,) = caught.value.problems
    return problem


def test_wheels_without_a_common_carrier_are_refused():
    g = pair((20, 30))
    g.add("arm", bm.Crank(length=1.0))
    g.connect("frame.A", "arm.A")
    g.wires = [w for w in g.wires if w.target not in ("two.A", "one.A")]
    g.connect("arm.B", "two.A")
    g.add("other", bm.Crank(length=1.0))
    wire(g, "frame.E other.A", "other.B one.A")
    problem = problem_of(g)
    assert (problem.code, problem.where) == ("coupling-mismatch", "mesh")
    assert "give both pairs markers of one link" in str(problem)


def test_a_wheel_on_a_coupler_whose_turns_nothing_counts_is_refused():
    g = pair((20, 30))
    g.add("dyad", bm.RRR(l_i=0.6, l_j=0.6, links={"i": bm.Link(markers={"G": (0.1, 0.0)})}))
    wire(g, "one.A dyad.B", "frame.E dyad.D")
    g.blocks["mesh"] = bm.Gear(driver="dyad.G", driven="two", teeth=(20, 30))
    problem = problem_of(g)
    assert problem.code == "coupling-mismatch"
    assert problem.where == "mesh"


def test_wheels_whose_distance_changes_are_refused():
    g = planetary()
    g.blocks["frame"] = bm.Frame(markers={"O": (0.0, 0.0), "P": (0.0, 0.01)})
    g.wires[0] = replace(g.wires[0], source="frame.P")
    problems = g.check()
    assert [p.where for p in problems] == ["mesh", "ring"]
    for problem in problems:
        assert problem.code == "coupling-mismatch"
        assert "carries the one wheel about frame.P" in problem.found


def test_a_loop_through_a_carrier_is_named():
    g = planetary()
    g.blocks["mesh"] = bm.Gear(driver="sun", driven="carrier", teeth=(18, 24))
    g.add("back", bm.Gear(driver="planet", driven="sun", teeth=(18, 24)))
    assert problem_of(g).code == "coupling-loop"


def test_a_load_may_follow_a_driven_wheel():
    g = pair((20, 30))
    law = {"kind": "polynomial", "of": "rate", "coefficients": [0.0, -2.0]}
    g.add("drag", bm.Motor(law=law, driver="two"))
    wire(g, "frame.A drag.a", "two.crank drag.b")
    run = g.compile().run(at=0.3, rates=3.0)
    assert run["drag.b.couple"][0] == pytest.approx(-2.0 * -2.0)


def test_teeth_whose_period_nobody_lives_to_see():
    motion = pair((60, 2**61 + 1)).compile().simulate("time=0.1", start={"one": (0.0, 1.0)}).motion
    assert motion.status == "reached"


@pytest.mark.parametrize("frame", [None, {}, {"markers": {"Q": {"at": [0.0, 0.0]}}}])
def test_a_wheel_without_its_centre_is_named(frame):
    data = json.loads((GRAPHS / "joints" / "planetary_hoist.json").read_text("utf-8"))
    data["links"] |= {"frame": frame}
    if frame is None:
        del data["links"]["frame"]
    with pytest.raises(bm.FormatError) as caught:
        bm.Linkage.from_json(json.dumps(data))
    (problem,) = caught.value.problems
    assert (problem.code, problem.where) == ("unknown-marker", "couplings.ring.driver")
