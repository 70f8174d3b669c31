"""Racks, belts, cams, Geneva drives and laws, against geometry and Newton's laws of their own."""

from __future__ import annotations

import cmath
import copy
import json
import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.couplings import laws
from blockmech.ground.errors import GraphError
from blockmech.model import meshing
from blockmech.testing.expectations import check_expectations
from tests.gallery import GRAPHS, JOINTS
from tests.independent import newton
from tests.machines import fivebar, load, slider_crank, wire

ROUNDING = 1e-12  # [-] some thousand roundings
ANGLE = math.radians(20.0)
LIFT = {
    "kind": "segments",
    "segments": [
        {"motion": "3-4-5", "over": 1.2, "rise": 0.01},
        {"motion": "dwell", "over": 0.5},
        {"motion": "3-4-5", "over": 1.2, "rise": -0.01},
    ],
}
# Worked out in mpmath, 30 digits: 0.01 m over 1.2 rad, prime circle 0.03 m, offset 0.005 m, 100 N.
CAM = {  # s, s', s'', pressure angle, radius of the pitch curve (positive convex), moment, contact
    0.3: (
        *(0.00103515625, 0.0087890625, 0.0390625),
        *(0.12313650415177, -0.139172162135, 0.87890625, 100.762949324105),
    ),
    0.6: (
        *(0.005, 0.015625, 0.0),
        *(0.298099383623586, 0.0321033812991, 1.5625, 104.613843572184),
    ),
}
# Worked out the same way: psi, psi', psi'' of six slots.
GENEVA = {
    -0.5: (-0.403678951685548, 0.506934589055447, 1.29626088441918),
    0.0: (0.0, 1.0, 0.0),
    1.0471975511: (math.pi / 6, 0.0, -0.57735026919),
}


def cranks(coupling, heavy=True, second="crank", law=None, offset=0.0):
    """Two drivers on the frame, the second on a guide that points upward."""
    g = bm.Graph("pair", gravity=(0.0, -9.81))
    guide = bm.Marker(at=(0.5, 0.1), angle=1.2)
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "E": guide}))
    mass = bm.Link(mass=1.2, inertia=0.1, cm=(0.1, 0.05)) if heavy else bm.Link()
    g.add("one", bm.Crank(links={"crank": mass}))
    if second == "crank":
        g.add("two", bm.Crank(links={"crank": mass}, offset=offset))
    else:
        g.add("two", bm.SlideDrive(links={"slider": mass}, offset=offset))
    g.add("mesh", coupling)
    g.connect("frame.A", "one.A")
    g.connect("frame.E", "two.A" if second == "crank" else "two.S")
    return g


def cam_and_valve(**cam):
    """The cam of the reference numbers under 100 N."""
    g = bm.Graph("cam")
    guide = bm.Marker(at=(0.005, 0.0), dir=(0.0, 1.0))
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "G": guide}))
    g.add("shaft", bm.Crank())
    g.add("valve", bm.SlideDrive())
    g.add("load", bm.Force(force=(0.0, -100.0)))
    fields = {"law": LIFT, "phase": math.sqrt(0.03**2 - 0.005**2)} | cam
    g.add("cam", bm.Cam(driver="shaft", driven="valve", **fields))
    return wire(g, "frame.A shaft.A", "frame.G valve.S", "valve.slider load.at")


# -- reference numbers -----------------------------------------------------------------------


def test_a_345_cam_moves_and_pushes_as_worked_out():
    run = cam_and_valve().compile().run(at=list(CAM), rates=2.0, want="*")
    s, ds, dds, slant, radius, moment, push = np.array(list(CAM.values())).T
    base = math.sqrt(0.03**2 - 0.005**2)
    np.testing.assert_allclose(run["valve.q"], base + s, rtol=ROUNDING)
    np.testing.assert_allclose(run["valve.rate"], 2 * ds, rtol=ROUNDING)
    np.testing.assert_allclose(run["valve.acceleration"], 4 * dds, rtol=ROUNDING, atol=1e-15)
    np.testing.assert_allclose(run["cam.pressure_angle"], slant, rtol=ROUNDING)
    np.testing.assert_allclose(run["cam.curvature_radius"], radius, rtol=1e-11)
    np.testing.assert_allclose(run["shaft.drive"], moment, rtol=ROUNDING)
    np.testing.assert_allclose(run["cam.contact"], push, rtol=ROUNDING)


@pytest.mark.parametrize(("name", "numbers"), [("indexing_table", 23), ("geared_fivebars", 18)])
def test_files_of_couplings_give_what_mpmath_says(name, numbers):
    graph = bm.Graph.load(GRAPHS / "couplings" / f"{name}.json")
    failures = check_expectations(graph)
    assert len(failures) == numbers
    assert [str(x) for x in failures if not x.ok] == []


def test_a_flat_follower_on_that_cam_is_undercut_where_the_radius_vanishes():
    with pytest.raises(GraphError, match="undercut") as caught:
        cam_and_valve(follower="flat", face=0.0).compile()
    message = str(caught.value)
    begin = float(message.split("cam angle of ")[1].split(" rad")[0])
    u = begin / 1.2
    radius = math.sqrt(0.03**2 - 0.005**2) + 0.01 * (10 * u**3 - 15 * u**4 + 6 * u**5)
    radius += 0.01 / 1.2**2 * (60 * u - 180 * u**2 + 120 * u**3)
    assert radius == pytest.approx(0.0, abs=1e-6)
    assert "enlarge the base circle" in message


@pytest.mark.parametrize("over", [1e-300, 5e-324])
def test_a_cam_that_rises_over_nothing_is_refused_in_words(over):
    rise = {"motion": "3-4-5", "over": over, "rise": 0.01}
    back = {"motion": "3-4-5", "over": 1.2, "rise": -0.01}
    with pytest.raises(GraphError, match="beyond the range of floating-point numbers"):
        cam_and_valve(law={"kind": "segments", "segments": [rise, back]}).compile()


def test_a_geneva_wheel_turns_as_worked_out_and_rests_between():
    g = cranks(bm.Geneva(driver="one", driven="two", slots=6, pin=0.4))
    run = g.compile().run(at=[0.4 + th for th in GENEVA], rates=1.0)
    psi, slope, curve = np.array(list(GENEVA.values())).T
    np.testing.assert_allclose(run["two.q"], -psi, rtol=ROUNDING, atol=1e-10)
    np.testing.assert_allclose(run["two.rate"], -slope, rtol=ROUNDING, atol=1e-9)
    np.testing.assert_allclose(run["two.acceleration"], -curve, rtol=1e-9, atol=1e-15)
    turns = g.compile().run(at=0.4 + math.tau * np.arange(7) + 2.0, rates=1.0)
    np.testing.assert_allclose(np.diff(turns["two.q"]), -math.pi / 3, rtol=ROUNDING)
    assert not turns["two.rate"].any()
    assert g.compile().structure.turns("one") == 6


@pytest.mark.parametrize("slots", [3, 4, 8])
def test_an_internal_geneva_wheel_turns_with_its_driver(slots):
    """The pin seen from the wheel's centre: d + r exp(i th), r = d sin(pi / n)."""
    g = cranks(
        bm.Geneva(driver="one", driven="two", slots=slots, internal=True, pin=0.4, phase=0.1)
    )
    mech, half = g.compile(), math.pi / 2 + math.pi / slots
    th = np.linspace(-0.99, 0.99, 7) * half
    run = mech.run(at=0.4 + th, rates=1.0, want="*")
    z = 1 + math.sin(math.pi / slots) * np.exp(1j * th)
    np.testing.assert_allclose(run["two.q"], 0.1 + np.angle(z), rtol=ROUNDING)
    np.testing.assert_allclose(run["two.rate"], ((z - 1) / z).real, rtol=1e-11)
    turns = mech.run(at=0.4 + math.pi + math.tau * np.arange(slots + 1), rates=1.0)
    np.testing.assert_allclose(np.diff(turns["two.q"]), math.tau / slots, rtol=ROUNDING)
    assert not turns["two.rate"].any()
    assert mech.verify(at=0.4 + th, rates=2.0, accelerations=-3.0).ok
    assert mech.structure.turns("one") == slots


def test_wheels_on_one_centre_and_fixed_wheels_that_follow_are_refused():
    for coupling in (
        bm.Gear(driver="one", driven="two", teeth=(20, 30)),
        bm.Geneva(driver="one", driven="two", slots=4),
    ):
        g = cranks(coupling)
        g.wires = [w for w in g.wires if "two.A" not in str(w)]
        g.connect("frame.A", "two.A")
        with pytest.raises(GraphError, match=r"\[no-room\] mesh: both wheels have one centre"):
            g.compile()
    with pytest.raises(GraphError, match=r"place on a link, not a driver.*fixed leads"):
        cranks(bm.Gear(driver="one", driven="frame.E", teeth=(20, 30))).compile()


@pytest.mark.parametrize("n", [-1, 1, -2])
def test_a_geared_five_bar_stands_where_it_should(n):
    positions = {  # C at q = 1 and 2.5; loop closure in mpmath, 30 digits
        -1: (2.4383909177801 + 1.47175633393964j, 1.14886894849647 + 1.04282673232475j),
        1: (1.11827751472962 + 2.75613666265913j, 0.537425342522421 + 2.08448464219848j),
        -2: (2.53750171462638 + 0.947275151340904j, 0.275081732508941 + 2.28421797316657j),
    }
    g = fivebar(1.0, 2.0, 2.0)
    law = {"kind": "polynomial", "coefficients": [0.5, float(n)]}
    g.add("wheels", bm.Ratio(driver="left", driven="right", law=law))
    run = g.compile().run(at=[1.0, 2.5], rates=1.0)
    np.testing.assert_allclose(run["dyad.C.p"], positions[n], rtol=ROUNDING)


# -- laws --------------------------------------------------------------------------------------

RISES = ["linear", "3-4-5", "4-5-6-7", "cycloidal", "modified_sine", "harmonic"]


@pytest.mark.parametrize("motion", RISES)
def test_rises_join_and_are_differentiated(motion):
    law = laws.Segments(segments=[{"motion": motion, "over": 1.3, "rise": 0.4}], start=0.2)
    kernel, numbers = law.kernel(), law.numbers(0.1)
    assert kernel(0.2, numbers).q == pytest.approx(0.1, abs=1e-15)
    assert kernel(1.5, numbers).q == pytest.approx(0.5, rel=1e-14)
    if motion != "linear":
        assert kernel(0.2 + 1e-12, numbers).slope == pytest.approx(0.0, abs=1e-11)
        assert kernel(1.5, numbers).slope == pytest.approx(0.0, abs=1e-13)
    h = 1e-5
    for x in (0.3, 0.5, 0.85, 1.1, 1.45):
        low, middle, high = (kernel(x + d, numbers) for d in (-h, 0.0, h))
        assert (high.q - low.q) / (2 * h) == pytest.approx(middle.slope, rel=1e-6)
        assert (high.slope - low.slope) / (2 * h) == pytest.approx(middle.curve, rel=1e-6, abs=1e-7)
    turn = kernel(0.9 + math.tau, numbers)
    assert turn.q == pytest.approx(kernel(0.9, numbers).q + 0.4, rel=1e-14)


def test_the_modified_sine_has_its_known_peak():
    law = laws.Segments(segments=[{"motion": "modified_sine", "over": 1.0, "rise": 1.0}])
    numbers = law.numbers(0.0)
    rows = [law.kernel()(x, numbers) for x in np.linspace(0.0, 1.0, 2001)]
    assert max(F.curve for F in rows) == pytest.approx(5.528, abs=5e-4)  # Norton, table 3-2
    assert max(F.slope for F in rows) == pytest.approx(1.760, abs=5e-4)


@pytest.mark.parametrize("interpolation", ["cubic", "quintic"])
def test_tables_go_through_their_rows_and_repeat(interpolation):
    x = np.linspace(0.0, math.tau, 24, endpoint=False) + 0.1
    table = laws.Table(
        arguments=x, values=np.sin(x) + 0.5 * x / math.tau, period=math.tau,
        advance_by=0.5, interpolation=interpolation,
    )  # fmt: skip
    kernel, numbers = table.kernel(), table.numbers(0.0)
    at = np.linspace(-3.0, 9.0, 41)
    off = max(abs(kernel(t, numbers).q - math.sin(t) - 0.5 * t / math.tau) for t in at)
    assert off < (1e-3 if interpolation == "cubic" else 2e-5)
    once = laws.Table(arguments=x, values=np.sin(x), interpolation=interpolation)
    assert math.isnan(once.kernel()(0.0, once.numbers(0.0)).q)


# -- forces by Newton's laws -------------------------------------------------------------------


def bodies_of(run, mass=1.2, inertia=0.1):
    """Both links as free bodies; the centre of mass lies at (0.1, 0.05) in their axes."""
    bodies = {}
    for name, link in (("one", "crank"), ("two", "crank" if "two.A.p" in run else "slider")):
        e = np.exp(1j * run[f"{name}.{link}.angle"][0])
        o, a = (run[f"{name}.{link}.{x}"][0] for x in "pa")
        om, al = (run[f"{name}.{link}.{x}"][0] for x in ("omega", "alpha"))
        arm = (0.1 + 0.05j) * e
        weight = -9.81j * mass
        bodies[name] = newton.Body(
            mass, inertia, o + arm, a + (1j * al - om * om) * arm, al, weight
        )  # fmt: skip
    return bodies


def reactions_agree(mech, contacts, run):
    """Drive, pins or guide, and the contact's force, against one linear system."""
    slides = "two.A.p" not in run
    pushes = newton.pin("frame", "one", 0j, "A") | contacts
    pushes |= {"drive": newton.Push("frame", "one")}
    if slides:
        u = np.exp(1.2j)
        pushes |= {"N": newton.Push("frame", "two", run["two.slider.p"][0], 1j * u)}
        pushes |= {"C": newton.Push("frame", "two")}
    else:
        pushes |= newton.pin("frame", "two", 0.5 + 0.1j, "E")
    result = newton.solved(bodies_of(run), pushes)
    assert run["one.drive"][0] == pytest.approx(result["drive"], rel=ROUNDING)
    force = sum(result[name] * push.way for name, push in contacts.items())
    assert run["mesh.force"][0] == pytest.approx(force, rel=ROUNDING)
    assert run["one.A.reaction"][0] == pytest.approx(
        complex(result["A.x"], result["A.y"]), rel=1e-11
    )
    if slides:
        assert run["two.S.N"][0] == pytest.approx(result["N"], rel=1e-11)
        assert run["two.S.C"][0] == pytest.approx(result["C"], rel=1e-11)
    else:
        pin = complex(result["E.x"], result["E.y"])
        assert run["two.A.reaction"][0] == pytest.approx(pin, rel=1e-11)
    assert mech.verify(at=0.7, rates=2.0, accelerations=-5.0).ok
    return result


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("angle", [0.0, ANGLE])
def test_a_rack_is_pushed_as_newton_says(side, angle):
    rack = bm.Rack(driver="one", driven="two", radius=0.08, side=side, pressure_angle=angle)
    mech = cranks(rack, second="slide").compile()
    run = mech.run(at=0.7, rates=2.0, accelerations=-5.0, want="*")
    u = np.exp(1.2j)
    assert run["two.rate"][0] == pytest.approx(side * 0.08 * 2.0)
    P = -1j * u * side * 0.08
    slide_axis = u * np.sign((run["mesh.force"][0] / u).real)
    across = 1j * u * side * math.sin(angle)
    tooth_normal = slide_axis * math.cos(angle) - across  # from the pinion to the rack
    result = reactions_agree(mech, {"tooth": newton.Push("one", "two", P, tooth_normal)}, run)
    assert result["tooth"] > 0


@pytest.mark.parametrize("side", [1, -1])
def test_a_pinion_is_pushed_as_newton_says(side):
    g = bm.Graph("driven pinion", gravity=(0.0, -9.81))
    guide = bm.Marker(at=(0.0, 0.0), angle=1.2)
    g.add("frame", bm.Frame(markers={"S": guide, "E": (0.5, 0.1)}))
    heavy = bm.Link(mass=1.2, inertia=0.1, cm=(0.1, 0.05))
    g.add("rack", bm.SlideDrive(links={"slider": heavy}))
    g.add("pinion", bm.Crank(links={"crank": heavy}))
    rack = bm.Rack(driver="rack", driven="pinion", radius=0.08, side=side, pressure_angle=ANGLE)
    g.add("mesh", rack)
    wire(g, "frame.S rack.S", "frame.E pinion.A")
    mech = g.compile()
    run = mech.run(at=0.7, rates=2.0, accelerations=-5.0, want="*")
    u, E = np.exp(1.2j), 0.5 + 0.1j
    assert run["pinion.rate"][0] == pytest.approx(side * 2.0 / 0.08)
    q, rate, al = 0.7 / (side * 0.08), 2.0 / (side * 0.08), -5.0 / (side * 0.08)
    arm = (0.1 + 0.05j) * np.exp(1j * q)
    bodies = {
        "rack": newton.Body(1.2, 0.1, 0.7 * u + (0.1 + 0.05j) * u, -5.0 * u, 0.0, -1.2 * 9.81j),
        "pinion": newton.Body(
            1.2, 0.1, E + arm, (1j * al - rate**2) * arm, al, -1.2 * 9.81j
        ),
    }  # fmt: skip
    P = E - 1j * u * side * 0.08
    slide_axis = u * np.sign((run["mesh.force"][0] / u).real)
    tooth_normal = slide_axis * math.cos(ANGLE) + 1j * u * side * math.sin(ANGLE)
    pushes = {
        "tooth": newton.Push("rack", "pinion", P, tooth_normal),
        "drive": newton.Push("frame", "rack", 0j, u),
    }
    pushes |= newton.pin("frame", "pinion", E, "E")
    pushes |= {
        "N": newton.Push("frame", "rack", 0.7 * u, 1j * u),
        "C": newton.Push("frame", "rack"),
    }
    result = newton.solved(bodies, pushes)
    assert result["tooth"] > 0
    assert run["rack.drive"][0] == pytest.approx(result["drive"], rel=ROUNDING)
    assert run["mesh.force"][0] == pytest.approx(result["tooth"] * tooth_normal, rel=ROUNDING)
    assert run["rack.S.N"][0] == pytest.approx(result["N"], rel=1e-11)
    assert run["rack.S.C"][0] == pytest.approx(result["C"], rel=1e-11)
    assert mech.verify(at=0.7, rates=2.0).ok


def tangent_lines(r1, r2, crossed):
    """Strands as (place on the second wheel, direction to the first), by the tangents' touch."""
    d = -(0.5 + 0.1j)
    step = (r1 + r2 if crossed else r2 - r1) / abs(d)
    for side in (1, -1):
        e = d / abs(d) * (math.sqrt(1 - step**2) + 1j * side * step)
        yield 0.5 + 0.1j - 1j * side * e * r2, e


@pytest.mark.parametrize("crossed", [False, True])
@pytest.mark.parametrize("preload", [0.0, 400.0])
def test_strands_pull_as_newton_says(crossed, preload):
    belt = bm.Belt(driver="one", driven="two", radii=(0.1, 0.16), crossed=crossed, preload=preload)
    mech = cranks(belt).compile()
    run = mech.run(at=0.7, rates=2.0, accelerations=-5.0, want="*")
    (p, e), (q, f) = tangent_lines(0.1, 0.16, crossed)
    for z, strand, r in ((p, e, 0.16), (q, f, 0.16)):
        assert abs(((z - 0.5 - 0.1j).conjugate() * strand).imag) == pytest.approx(r)  # a tangent
        assert abs((z.conjugate() * strand).imag) == pytest.approx(0.1)  # of both wheels
    pulls = {"left": newton.Push("one", "two", p, e), "right": newton.Push("one", "two", q, f)}
    # Two unknowns in one direction: what is known of their sum closes the system.
    difference = newton.Push("one", "two")  # the couple that they make
    result = newton.solved(
        bodies_of(run),
        newton.pin("frame", "one", 0j, "A") | newton.pin("frame", "two", 0.5 + 0.1j, "E")
        | {"effort": newton.Push("frame", "two"), "drive": newton.Push("frame", "one")},
    )  # fmt: skip
    effort = result["effort"]
    assert run["mesh.effort"][0] == pytest.approx(effort, rel=ROUNDING)
    ratio = (-1 if crossed else 1) * 0.1 / 0.16
    assert run["one.drive"][0] == pytest.approx(result["drive"] + ratio * effort, rel=ROUNDING)
    f0 = effort / 0.16
    tensions = (
        (max(f0, 0.0), max(-f0, 0.0)) if not preload else (preload + f0 / 2, preload - f0 / 2)
    )
    force = tensions[0] * pulls["left"].way + tensions[1] * pulls["right"].way
    assert difference.way is None
    assert run["mesh.force"][0] == pytest.approx(force, rel=ROUNDING)
    pin = complex(result["E.x"], result["E.y"]) - force
    assert run["two.A.reaction"][0] == pytest.approx(pin, rel=1e-11)
    assert mech.verify(at=0.7, rates=2.0, accelerations=-5.0).ok
    if preload:
        assert run["mesh.slack"][0] == pytest.approx(min(tensions), rel=ROUNDING)


def test_a_belt_that_hangs_loose_is_flagged():
    belt = bm.Belt(driver="one", driven="two", radii=(0.1, 0.16), preload=1.0)
    run = cranks(belt).compile().run(at=0.7, rates=2.0, accelerations=-50.0)
    assert "slack-belt" in {f.code for f in run.quality.flags}


SWING = {
    "kind": "segments",
    "segments": [
        {"motion": "4-5-6-7", "over": 2.2, "rise": 0.2},
        {"motion": "cycloidal", "over": 2.0, "rise": -0.2},
    ],
}
RISE = {
    "kind": "segments",
    "segments": [
        {"motion": "4-5-6-7", "over": 2.2, "rise": 0.05},
        {"motion": "modified_sine", "over": 2.0, "rise": -0.05},
    ],
}
FOLLOWERS = {
    "translating knife": ("slide", {"law": RISE, "phase": 0.4}),
    "translating roller": (
        "slide",
        {"law": RISE, "phase": 0.4, "follower": "roller", "roller": 0.05},
    ),
    "translating face": ("slide", {"law": RISE, "phase": 0.4, "follower": "flat", "face": 0.2}),
    "swinging roller": (
        "crank",
        {"law": SWING, "phase": 1.4, "at": (0.45, 0.1), "follower": "roller", "roller": 0.04},
    ),
    "swinging face": (
        "crank",
        {"law": SWING, "phase": 1.4, "at": (0.1, 0.0), "follower": "flat", "face": -math.pi / 2},
    ),
}


STEP = 1e-3  # [rad]; five points, so that a slope is off by its fourth power


def slope(values):
    """Derivative at the middle of five values, a `STEP` from one to the next."""
    return (values[0] - 8 * values[1] + 8 * values[3] - values[4]) / (12 * STEP)


def profile(mech, name, x):
    """Tip of the follower, its normal, and what turns both into the cam's axes, about x."""
    kind, cam = FOLLOWERS[name]
    link = "two.crank" if kind == "crank" else "two.slider"
    grid = x + STEP * np.arange(-2, 3)
    run = mech.run(at=grid, rates=0.0, want=[f"{link}.p", f"{link}.angle"])
    e = np.exp(1j * run[f"{link}.angle"])
    tip = run[f"{link}.p"] + e * complex(*cam.get("at", (0.0, 0.0)))
    return tip, e * np.exp(1j * cam.get("face", 0.0)), np.exp(-1j * grid)


@pytest.mark.parametrize("x", [0.7, 3.5])
@pytest.mark.parametrize("name", FOLLOWERS)
def test_cams_push_along_the_normal_of_their_profile(name, x):
    kind, cam = FOLLOWERS[name]
    g = cranks(bm.Cam(driver="one", driven="two", **cam), second=kind)
    mech = g.compile()
    run = mech.run(at=x, rates=2.0, accelerations=-5.0, want="*")
    tip, normal, back = profile(mech, name, x)
    if cam.get("follower") == "flat":
        # The profile is the envelope of the face in the cam's axes: p . n = c and p . n' = c'.
        n, c = normal * back, (tip * np.conj(normal)).real
        dn, dc = slope(n), slope(c)
        rows = [[n[2].real, n[2].imag], [dn.real, dn.imag]]
        at, push_axis = complex(*np.linalg.solve(rows, [c[2], dc])) / back[2], normal[2]
    else:
        tangent = slope(tip * back)
        at, push_axis = tip[2], -1j * tangent / abs(tangent) / back[2]
        push_axis *= np.sign((push_axis * np.conj(tip[2])).real)
    loose = 1e-9
    pushes = newton.pin("frame", "one", 0j, "A") | {
        "push": newton.Push("one", "two", at, push_axis)
    }
    pushes |= {"drive": newton.Push("frame", "one")}
    if kind == "slide":
        u = np.exp(1.2j)
        pushes |= {"N": newton.Push("frame", "two", run["two.slider.p"][0], 1j * u)}
        pushes |= {"C": newton.Push("frame", "two")}
    else:
        pushes |= newton.pin("frame", "two", 0.5 + 0.1j, "E")
    result = newton.solved(bodies_of(run), pushes)
    assert run["mesh.contact"][0] == pytest.approx(result["push"], rel=loose)
    assert run["mesh.force"][0] == pytest.approx(result["push"] * push_axis, rel=loose)
    assert run["one.drive"][0] == pytest.approx(result["drive"], rel=loose)
    if kind == "slide":
        assert run["two.S.C"][0] == pytest.approx(result["C"], rel=loose)
    flagged = "lift-off" in {f.code for f in run.quality.flags}
    assert flagged == (result["push"] < 0)
    assert mech.verify(at=x, rates=2.0, accelerations=-5.0).ok
    across = 1j * (at - 0.5 - 0.1j) if kind == "crank" else np.exp(1.2j)
    slant = abs(np.angle(push_axis / across))
    assert min(slant, math.pi - slant) == pytest.approx(
        abs(run["mesh.pressure_angle"][0]), abs=loose
    )


@pytest.mark.parametrize("name", FOLLOWERS)
def test_radius_of_curvature_is_that_of_the_drawn_profile(name):
    kind, cam = FOLLOWERS[name]
    mech = cranks(bm.Cam(driver="one", driven="two", **cam), second=kind).compile()
    s = mech.structure
    where = meshing.sides(s, "mesh")
    p = meshing.coupling_numbers(s, "mesh")
    pair = s.coupled_pair("mesh")
    mesh = s.couplings["mesh"]
    h = 1e-3
    for x in (0.7, 1.6, 3.5):
        points = []
        for at in map(where, (x - h, x, x + h)):
            z = mesh.touch(pair)(at, p).point
            points.append(z * np.exp(-1j * at.x))
        a, b, c = points
        sides = abs(b - a), abs(c - b), abs(c - a)
        area = ((b - a).conjugate() * (c - a)).imag / 2  # clockwise
        circle = -sides[0] * sides[1] * sides[2] / (4 * area)
        run = mech.run(at=x, want="mesh.curvature_radius")
        assert run["mesh.curvature_radius"][0] == pytest.approx(circle, rel=1e-3)


@pytest.mark.parametrize("name", FOLLOWERS)
def test_a_profile_given_by_points_moves_the_follower_as_the_law_that_made_it(name):
    kind, cam = FOLLOWERS[name]
    first = cranks(bm.Cam(driver="one", driven="two", **cam), second=kind).compile()
    s = first.structure
    (outline, *_) = s.couplings["mesh"].curves(
        "RP" if kind == "slide" else "RR",
        meshing.sides(s, "mesh"),
        meshing.coupling_numbers(s, "mesh"),
    )
    points = [(z.real, z.imag) for z in outline.points[:-1]]
    again = cam | {"law": {"kind": "points", "points": points}}
    second = cranks(bm.Cam(driver="one", driven="two", **again), second=kind).compile()
    q = np.linspace(0.0, 6.0, 13)
    exact, fitted = (m.run(at=q, rates=1.0) for m in (first, second))
    np.testing.assert_allclose(fitted["two.q"], exact["two.q"], atol=2e-7)
    np.testing.assert_allclose(fitted["mesh.slope"], exact["mesh.slope"], atol=2e-5)


# -- properties --------------------------------------------------------------------------------


def test_a_cam_with_a_slider_cranks_own_displacement_needs_the_slider_cranks_drive():
    r, rod = 0.05, 0.15
    x = np.linspace(0.0, math.tau, 360, endpoint=False)
    values = r * np.cos(x) + np.sqrt(rod**2 - (r * np.sin(x)) ** 2)
    law = {"kind": "table", "arguments": x, "values": values, "period": math.tau}
    g = bm.Graph("cam")
    guide = bm.Marker(at=(0.0, 0.0), angle=0.0)
    g.add("frame", bm.Frame(markers={"A": guide}))
    g.add("crank", bm.Crank())
    g.add("piston", bm.SlideDrive(links={"slider": bm.Link(mass=0.8)}))
    g.add("gas", bm.Force(force=(-300.0, 0.0)))
    law |= {"interpolation": "quintic"}
    g.add("cam", bm.Cam(driver="crank", driven="piston", law=law))
    wire(g, "frame.A crank.A", "frame.A piston.S", "piston.slider gas.at")
    s = slider_crank(r, rod, bodies=(None, None, bm.Link(mass=0.8)), branch=1)
    load(s, "gas", bm.Force(force=(-300.0, 0.0)), at="dyad.j")
    ask = {"at": np.linspace(0.3, 6.0, 9), "rates": 20.0, "accelerations": 30.0}
    coupled, direct = g.compile().run(**ask), s.compile().run(**ask)
    np.testing.assert_allclose(coupled["crank.drive"], direct["crank.drive"], rtol=1e-8)
    np.testing.assert_allclose(coupled["crank.J_red"], direct["crank.J_red"], rtol=1e-8)


def test_ratios_of_one_and_minus_one_are_mirror_images():
    def pair(ratio, sign):
        law = {"kind": "polynomial", "coefficients": [0.2, ratio]}
        g = cranks(bm.Ratio(driver="one", driven="two", law=law))
        g.blocks["two"] = g.blocks["two"].model_copy(update={"sign": sign})
        return g.compile()

    ask = {"at": np.linspace(0.0, 6.0, 7), "rates": 2.0, "accelerations": 1.0}
    plain, mirrored = pair(1.0, 1).run(**ask), pair(-1.0, -1).run(**ask)
    assert mirrored["two.q"] == pytest.approx(-plain["two.q"] + 0.4)
    law = {"kind": "polynomial", "coefficients": [-0.2, -1.0]}
    three = pair(1.0, 1)
    four = cranks(bm.Ratio(driver="one", driven="two", law=law))
    four.blocks["two"] = four.blocks["two"].model_copy(update={"sign": -1})
    run, four_run = three.run(**ask), four.compile().run(**ask)
    for name in ("one.drive", "one.J_red", "two.crank.angle", "two.A.reaction"):
        np.testing.assert_allclose(run[name], four_run[name], rtol=ROUNDING, atol=1e-14)


COUPLED = {
    "rack": (bm.Rack(driver="one", driven="two", radius=0.08), "slide"),
    "belt": (bm.Belt(driver="one", driven="two", radii=(0.1, 0.16), preload=50.0), "crank"),
    "geneva": (bm.Geneva(driver="one", driven="two", slots=5), "crank"),
    "ratio": (bm.Ratio(driver="one", driven="two", law=RISE), "slide"),
    **{
        name: (bm.Cam(driver="one", driven="two", **cam), kind)
        for name, (kind, cam) in FOLLOWERS.items()
    },
}


@pytest.mark.parametrize("name", COUPLED)
def test_motions_by_two_integrators_agree(name):
    coupling, kind = COUPLED[name]
    mech = cranks(coupling, second=kind).compile()
    ask = {"start": {"one": (0.3, 14.0)}, "want": ["one.q", "one.rate"]}
    implicit, explicit = (mech.simulate("time=0.6", method=m, **ask) for m in ("radau", "dop853"))
    assert implicit["one.q"][-1] > 3.0
    assert implicit["one.q"][-1] == pytest.approx(explicit["one.q"][-1], rel=1e-9)
    assert implicit["one.rate"][-1] == pytest.approx(explicit["one.rate"][-1], rel=1e-9)


@pytest.mark.parametrize("name", COUPLED)
def test_engines_and_derivatives_agree(name):
    coupling, kind = COUPLED[name]
    g = cranks(coupling, second=kind)
    mech, ask = g.compile(), {"at": np.linspace(0.05, 7.0, 23), "rates": 2.0}
    batch = mech.run(**ask, engine="numpy")
    for engine in ("scalar", "llvm"):
        run = mech.run(**ask, engine=engine)
        for output in ("one.drive", "mesh.effort", "two.acceleration"):
            scale = np.abs(batch[output]).max()
            np.testing.assert_allclose(run[output], batch[output], rtol=1e-10, atol=1e-12 * scale)
    at = {"at": 0.75, "rates": 2.0}
    slope = mech.sensitivity("one.drive", ["frame.E.y"], **at)["one.drive", "frame.E.y"][0]
    step, scale = 1e-6, np.abs(batch["one.drive"]).max()
    ends = [
        g.replace({"frame.E.y": 0.1 + h}).compile().run(**at)["one.drive"][0] for h in (-step, step)
    ]
    assert slope == pytest.approx((ends[1] - ends[0]) / (2 * step), abs=1e-6 * scale)


# -- refusals ----------------------------------------------------------------------------------


def problem_of(graph):
    with pytest.raises(GraphError) as caught:
        graph.compile()
    (problem,) = caught.value.problems
    return problem


def test_a_rack_between_two_cranks_is_refused_with_what_it_couples():
    problem = problem_of(cranks(bm.Rack(driver="one", driven="two", radius=0.1)))
    assert (problem.code, problem.where) == ("coupling-mismatch", "mesh.driven")
    assert "revolute with prismatic" in str(problem)


def test_a_belt_that_has_no_room_is_refused():
    problem = problem_of(
        cranks(bm.Belt(driver="one", driven="two", radii=(0.4, 0.4), crossed=True))
    )
    assert "the centres are 0.5099" in str(problem)


def test_a_face_along_the_guide_is_dead():
    cam = bm.Cam(driver="one", driven="two", law=RISE, phase=0.4, follower="flat", face=math.pi / 2)
    assert problem_of(cranks(cam, second="slide")).code == "dead-face"


def test_a_roller_that_is_too_large_is_refused_with_the_largest_that_fits():
    kind, cam = FOLLOWERS["translating roller"]
    good = cranks(bm.Cam(driver="one", driven="two", **cam), second=kind).compile()
    x = np.linspace(0.0, math.tau, 721)
    radius = good.run(at=x, want="mesh.curvature_radius")["mesh.curvature_radius"] + 0.05
    smallest = radius[radius > 0].min()
    problem = problem_of(
        cranks(bm.Cam(driver="one", driven="two", **cam | {"roller": 1.02 * smallest}), second=kind)
    )
    assert problem.code == "undercut"
    assert float(problem.valid.split("than ")[1].split(" m")[0]) == pytest.approx(
        smallest, rel=1e-3
    )


@pytest.mark.parametrize(
    "change",
    [
        {"law": {"kind": "segments", "segments": [{"motion": "linear", "over": 1.0, "rise": 0.1}]}},
        {"law": {"kind": "polynomial", "coefficients": [0.0, 1.0]}},
        {"law": RISE, "follower": "roller"},
        {"law": RISE, "face": 0.1},
        {},
        {"law": {"kind": "points", "points": [(1.0, 0.0)] * 3}},
    ],
)
def test_cams_without_one_closed_profile_are_refused(change):
    with pytest.raises(GraphError):
        bm.Cam(driver="one", driven="two", **change)


@pytest.mark.parametrize(
    ("table", "remedy"),
    [
        ({"arguments": [0, 2, 4, 6], "values": [0, 1, 1, 0]}, "period"),
        ({"arguments": [0, 120, 240, 300], "values": [0, 1, 1, 0], "period": "360deg"}, "300deg"),
        ({"arguments": [0, 2, 4, 7], "values": [0, 1, 1, 0], "period": "360deg"}, "last row"),
    ],
)
def test_a_table_of_lift_is_led_to_its_period_and_its_unit(table, remedy):
    with pytest.raises(GraphError) as caught:
        bm.Cam(driver="one", driven="two", law={"kind": "table"} | table)
    (problem,) = caught.value.problems
    assert remedy in problem.remedy


def test_a_belt_under_tension_moves_with_friction_by_both_integrators():
    g = cranks(bm.Belt(driver="one", driven="two", radii=(0.1, 0.16), preload=300.0))
    rub = bm.friction.Coulomb(coefficient=0.1, radius=0.02)
    g.blocks["two"] = g.blocks["two"].model_copy(update={"friction": {"A": rub}})
    mech = g.compile()
    ask = {"start": {"one": (0.2, 9.0)}, "want": "*"}
    implicit, explicit = (mech.simulate("time=0.3", method=m, **ask) for m in ("radau", "dop853"))
    assert implicit["one.q"][-1] == pytest.approx(explicit["one.q"][-1], rel=1e-10)
    assert np.abs(implicit["one.drive"]).max() <= 1e-9 * np.abs(implicit["mesh.effort"]).max()
    free = mech.simulate("time=0.3", start={"one": (0.2, 9.0)}, friction="none", want="*")
    assert free["one.q"][-1] > implicit["one.q"][-1]


def test_a_document_names_the_followers_tip_in_its_own_frame_of_the_link():
    """The same valve, its link's frame elsewhere and turned."""
    data = json.loads((JOINTS / "valve_engine.json").read_text("utf-8"))
    data.pop("expect")
    mesh = data["couplings"]["cam"]
    moved = copy.deepcopy(data)
    away, turn = 0.01 - 0.02j, 0.7
    x, y, angle = moved["links"]["valve"]["pose"]
    o = complex(x, y) + away * cmath.exp(1j * angle)
    moved["links"]["valve"]["pose"] = [o.real, o.imag, angle + turn]
    seat = -away * cmath.exp(-1j * turn)
    seat_point = [seat.real, seat.imag]
    moved["links"]["valve"]["cm"] = seat_point
    moved["joints"]["guide"]["at"][1] = seat_point
    moved["joints"]["guide"]["angle"][1] = -turn
    moved["loads"]["spring"]["at"][1] = seat_point
    moved["couplings"]["cam"] = mesh | {"at": seat_point}
    runs = [
        bm.Linkage.from_json(json.dumps(d)).compile().run(at=[0.5, 1.3], rates=120.0)
        for d in (data, moved)
    ]
    for name in ("driver.shaft.drive", "cam.contact", "cam.curvature_radius"):
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=1e-11)
