"""Joint friction in motion: closed forms, rest and what holds it, reversals, refusals."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from mpmath import mp, mpf

import blockmech as bm
from blockmech.ground.errors import RequestError
from tests import machines
from tests.dynamics.motions import PIN_START, pin_swings
from tests.dynamics.one_chart import in_one_chart
from tests.gallery import changed, document
from tests.independent import released

G = 9.81  # [m/s2]
LOWEST = -math.pi / 2  # [rad] the pendulum hanging
METHODS = pytest.mark.parametrize(("method", "accuracy"), [("auto", 1e-12), ("dop853", 1e-7)])
# numerics 8.5: masses of the paper's linkage, gravity, f' r = 0.05 m in all joints, from 1 rad
REST_ANGLE, REST_TIME = -1.81768323201221, 13.5898794353  # [rad], [s]


def pendulum(coefficient=0.2, radius=0.1, law=None, mass=1.0, length=1.0):
    """A point mass on a pin with friction, of 1 kg at 1 m."""
    point = bm.Link(mass=mass, inertia=0.0, cm=(length, 0.0))
    pin = bm.friction.Coulomb(coefficient=coefficient, radius=radius)
    graph = machines.crank(length, point, pin, gravity=G)
    if law is not None:
        machines.load(graph, "motor", bm.Motor(law=law), a="frame.A", b="crank.crank")
    return graph.compile()


# At 1e-12 the pairs of runs that dop853 estimates its error by leave 3e-12 over 27 half swings.
@pytest.mark.parametrize(("method", "accuracy"), [("auto", 1e-11), ("dop853", 1e-7)])
def test_a_pendulum_on_a_pin_stands_still_where_the_closed_form_says(method, accuracy):
    expected = np.array([float(end) for _, _, end in pin_swings()])
    mech = pendulum()
    motion = mech.simulate(
        "time=100", start={"crank": (PIN_START, 0.0)}, method=method, accuracy=accuracy
    ).motion
    stood = [e.q - LOWEST for e in motion.events if e.kind == "standstill"]
    assert len(stood) == expected.size == 27
    assert np.abs(stood - expected).max() <= motion.error + 4 * np.spacing(1.5)
    assert motion.reached
    assert motion.events[-1].kind == "rest"
    lost = G * (math.cos(expected[-1]) - math.cos(1.5))
    assert motion.facts["friction_work"] == pytest.approx(lost, rel=10 * accuracy)
    low, high = motion.facts["holding_low"], motion.facts["holding_high"]
    assert low < 0 < high


def turned_together(*rubbing, law="coulomb", **numbers):
    """Three links in a triangle that hangs on two pins of one axis: B and C never move."""
    B, C = cmath.rect(0.4, 0.3), cmath.rect(0.5, 1.1)
    rng = np.random.default_rng(5)
    ends = {"l": (0j, B), "m": (B, C), "r": (0j, C)}
    links = {name: released.link(rng, *x) for name, x in ends.items()}
    lengths = {"A": ("frame", "l", 0.0, 0.0), "B": ("l", "m", 0.4, 0.0)}
    lengths |= {"C": ("m", "r", abs(C - B), 0.5), "D": ("frame", "r", 0.0, 0.0)}
    joints = {
        name: released.pin(a, b, [x, 0.0], [y, 0.0]) for name, (a, b, x, y) in lengths.items()
    }
    for name in rubbing:
        joints[name]["friction"] = {"law": law, "radius": 0.02, **(numbers or {"coefficient": 0.3})}
    start = {"motor": (0.3, 0.0)}
    case = released.document(links, joints, {"motor": "A"}, start, "triangle")
    return bm.Linkage.from_data(case).compile()


@pytest.mark.parametrize("q", [-1.5, 0.5, 2.5])
def test_pairs_of_links_that_turn_together_slip_in_no_sense(q):
    """Rounding has no sense: what B and C would rub is nothing, and they never reverse."""
    request = {"until": "time=0.5", "start": {"motor": (q, 1.0)}, "accuracy": 1e-9}
    every, alone = (turned_together(*names).simulate(**request).motion for names in ("BCD", "D"))
    assert all(slips.sides[:2] == (0, 0) for slips in every.slips)
    assert {event.kind for event in every.events} <= {"standstill"}
    assert abs(every.q_end - alone.q_end) <= every.error + alone.error
    work = alone.facts["friction_work"]
    assert every.facts["friction_work"] == pytest.approx(work, rel=1e-8)


def test_pairs_that_never_move_bend_no_bristles_by_machine_code_either():
    """A law that remembers turns at each change of sense: of rounding there were ten thousands."""
    pytest.importorskip("llvmlite", reason="machine code needs the extra fast")
    dahl = {"law": "dahl", "kinetic": 0.3, "stiffness": 30.0}
    request = {"start": {"motor": (0.5, 1.0)}, "accuracy": 1e-9, "engine": "llvm"}
    every, alone = (
        turned_together(*names, **dahl).simulate("time=0.5", **request).motion
        for names in ("BCD", "D")
    )
    assert every.cost.evaluations < 2 * alone.cost.evaluations
    assert abs(every.q_end - alone.q_end) <= every.error + alone.error


@pytest.mark.parametrize(("mass", "length"), [(3.0, 1.0), (1e-6, 1e-4), (1e5, 100.0)])
def test_a_rubbing_pendulum_moves_alike_at_any_mass_and_length(mass, length):
    """J' is nothing but rounding of rows that cancel, whatever the masses' digits."""
    mech = pendulum(radius=0.1 * length, mass=mass, length=length)
    time = 10 * math.sqrt(length)
    request = {"start": {"crank": (0.0, 0.0)}, "accuracy": 1e-10}
    motion = mech.simulate(f"time={time!r}", **request).motion
    reference = pendulum().simulate("time=10", **request).motion
    assert abs(motion.q_end - reference.q_end) <= 1e-12
    assert motion.reached
    assert reference.reached


def test_before_a_dead_centre_friction_ends_the_motion_by_both_integrators():
    graph = bm.Graph("slide under two rods", gravity=(-7.0, -7.0))
    frame = bm.Frame(markers={"A": (0.0, 0.0), "G": bm.Marker(at=(0.0, -0.3), angle=0.0)})
    rod = bm.Link(mass=1.0, inertia=0.08, cm=(0.5, 0.0))
    body = bm.Link(mass=2.0, inertia=0.1, markers={"P": (0.0, 0.0)})
    graph.add("frame", frame)
    friction = {"S": bm.friction.Coulomb(coefficient=0.2)}
    graph.add("slider", bm.SlideDrive(links={"slider": body}, friction=friction))
    graph.add("dyad", bm.RRR(l_i=1.0, l_j=0.8, branch=1, links={"i": rod, "j": rod}))
    machines.wire(graph, "frame.G slider.S", "slider.P dyad.B", "frame.A dyad.D")
    mech, start = graph.compile(), {"slider": (0.9, 0.0)}
    explicit, implicit = (
        in_one_chart(mech, "time=2", start=start, method=m) for m in ("auto", "radau")
    )
    assert (explicit.method, explicit.end, implicit.end) == ("dop853", *["dead centre"] * 2)
    assert abs(explicit.q_end - implicit.q_end) <= explicit.error + implicit.error
    assert abs(explicit.t_end - implicit.t_end) <= 1e-3 * explicit.time_error


def rubbing():
    """The paper's linkage with friction in all joints, without its loads but for gravity."""
    data = document("ruiz_fourbar")
    for block in ("crank", "dyad"):
        for law in data["blocks"][block]["friction"].values():
            law.update(coefficient=1.0, radius=0.05)
    del data["blocks"]["weightlike"], data["blocks"]["couple"], data["wires"][3:]
    data["scene"]["gravity"] = [0.0, -G]
    return changed(data)


@METHODS
def test_the_papers_linkage_swings_out_where_the_prototype_said(method, accuracy):
    request = {"start": {"crank": (1.0, 0.0)}, "method": method, "accuracy": accuracy}
    motion = rubbing().simulate("time=100", **request).motion
    kinds = [e.kind for e in motion.events]
    assert (kinds.count("standstill"), kinds[-1]) == (9, "rest")
    assert "joint reverses" in kinds
    assert abs(motion.events[-1].q - REST_ANGLE) <= motion.error + 1e-14
    assert abs(motion.events[-1].t - REST_TIME) <= 1e3 * accuracy


@pytest.mark.parametrize("method", ["auto", "dop853"])
def test_what_friction_holds_stays_where_it_is(method):
    mech = pendulum()
    start = {"crank": (LOWEST + 0.5 * 0.02, 0.0)}
    motion = mech.simulate("standstill", start=start, method=method).motion
    assert (motion.status, motion.end, motion.t_end) == ("rest", "rest", 0.0)
    swung = mech.simulate("swings=9", start={"crank": (LOWEST + 0.1, 0.0)}, method=method).motion
    assert (swung.status, swung.end) == ("ended", "rest")
    timed = mech.simulate("time=1", start=start, method=method).motion
    assert (timed.status, timed.end, timed.qd_end) == ("reached", "time", 0.0)
    assert timed.q_end == start["crank"][0]
    # no run at another tolerance would say anything else
    assert (timed.regime, timed.error, timed.cost.states) == ("rest", 0.0, 0)
    assert timed.cost == motion.cost


@pytest.mark.parametrize("method", ["auto", "dop853"])
def test_what_friction_all_but_holds_is_known_to_the_rounding_of_what_cancels(method):
    """On a plane a billionth steeper than its friction: 1e-22 m were said to be known."""
    mu, slope = mpf("0.1"), math.atan(0.1) * (1 + 1e-9)
    graph = bm.Graph("plane", gravity=(0.0, -G))
    graph.add("frame", bm.Frame(markers={"G": bm.Marker(at=(0.0, 0.0), angle=slope)}))
    friction = {"S": bm.friction.Coulomb(coefficient=float(mu))}
    graph.add("slider", bm.SlideDrive(links={"slider": bm.Link(mass=2.0)}, friction=friction))
    graph.connect("frame.G", "slider.S")
    motion = graph.compile().simulate("time=2", start={"slider": (0.0, 0.0)}, method=method).motion
    exact = -2 * mpf(G) * (mp.sin(slope) - mpf(float(mu)) * mp.cos(slope))
    assert abs(motion.q_end - exact) <= motion.error < abs(exact) / 1000


@pytest.mark.parametrize("method", ["auto"])
def test_a_load_of_the_time_starts_a_driver_at_rest_when_it_outgrows_friction(method):
    """The pin holds xi m g = 0.1962 N m at the lowest place; the moment grows by 0.5 N m/s."""
    law = {"kind": "polynomial", "of": "time", "coefficients": [0.0, 0.5]}
    start = {"crank": (LOWEST, 0.0)}
    motion = pendulum(law=law).simulate("time=2", start=start, method=method, accuracy=1e-7).motion
    leaves = 0.02 * G / 0.5
    assert [e.kind for e in motion.events] == ["rest"]
    assert motion.at(0.999 * leaves).q == LOWEST
    assert motion.at(1.05 * leaves).q > LOWEST
    assert motion.facts["holding_high"] == pytest.approx(0.02 * G, rel=1e-12)
    assert motion.facts["energy_balance"] <= 1e-6  # friction's work included
    finer = pendulum(law=law).simulate("time=2", start=start, accuracy=1e-10).motion
    assert abs(motion.q_end - finer.q_end) <= motion.error + finer.error


@pytest.mark.parametrize("method", ["auto", "dop853"])
def test_where_no_acceleration_satisfies_coulombs_law_the_state_is_named(method):
    """f' r m l / J = 1.2: Painleve's paradox (numerics 8.1)."""
    lock = pendulum(coefficient=1.0, radius=1.2)
    motion = lock.simulate("time=1", start={"crank": (0.5, 1.0)}, method=method).motion
    assert (motion.status, motion.end) == ("failed", "self-locking in motion")
    assert "self-locking in motion: t = 0 s, q = 0.5, rate = 1" in motion.notes
    held = lock.simulate("time=1", start={"crank": (0.5, 0.0)}, method=method).motion
    assert (held.q_end, held.facts["holding_low"] < 0 < held.facts["holding_high"]) == (0.5, True)


@pytest.mark.parametrize(
    ("settings", "found"),
    [
        ({"friction": "single"}, -2.94478095),
        ({"friction": bm.friction.Successive(iterations=3)}, -2.94476213),
        ({"friction": "newton"}, -2.94476213),
    ],
)
def test_friction_in_motion_is_solved_by_the_methods_of_a_run(settings, found):
    for method in ("auto", "dop853"):
        motion = (
            pendulum()
            .simulate("time=1", start={"crank": (0.5, 0.0)}, method=method, **settings)
            .motion
        )
        assert motion.q_end == pytest.approx(found, abs=1e-8)
    wrong = bm.friction.Successive(iterations=0)
    with pytest.raises(RequestError, match="at least 1, got 0"):
        pendulum().simulate("time=1", start={"crank": (0.5, 0.0)}, friction=wrong)


def pistons(number):
    """An engine of as many equal pistons on one crankpin, with rough wrist pins."""
    graph = bm.Graph("pistons", gravity=(0.0, -G))
    guide = bm.Marker(at=(0.0, 0.0), angle=0.0)
    graph.add("frame", bm.Frame(markers={"O": (0.0, 0.0), "G": guide}))
    graph.add("crank", bm.Crank(length=0.1, links={"crank": bm.Link(mass=1.0, inertia=0.02)}))
    graph.connect("frame.O", "crank.A")
    rod = bm.Link(mass=0.6 / number, inertia=0.003 / number, cm=(0.15, 0.0))
    links = {"i": rod, "j": bm.Link(mass=0.9 / number)}
    rough = bm.friction.Coulomb(coefficient=0.2, radius=0.03)
    for k in range(number):
        group = bm.RRP(l=0.3, h=0.0, branch=1, links=links, friction={"C": rough})
        graph.add(f"piston{k}", group)
        machines.wire(graph, f"crank.B piston{k}.B", f"frame.G piston{k}.S")
    return graph.compile()


@METHODS
def test_pairs_that_reverse_at_one_place_reverse_once(method, accuracy):
    """Two halves of a piston move as the whole: the second event turned its friction back."""
    request = {"start": {"crank": (1.0, 0.0)}, "method": method, "accuracy": accuracy}
    full, halves = (pistons(n).simulate("time=1", **request).motion for n in (1, 2))
    assert [e.kind for e in halves.events] == [e.kind for e in full.events] == ["joint reverses"]
    assert abs(halves.q_end - full.q_end) <= halves.error + full.error


def test_outputs_along_a_motion_with_friction_need_no_drive():
    mech = pendulum()
    r = mech.simulate(times=[0.2, 0.4], start={"crank": (0.5, 0.0)}, want=["crank.drive"])
    assert np.abs(r["crank.drive"]).max() <= 1e-9 * G


def test_left_out_it_is_the_motion_without():
    start = {"crank": (0.5, 0.0)}
    plain = pendulum(coefficient=0.0).simulate("time=1", start=start).motion
    waived = pendulum().simulate("time=1", start=start, friction="none").motion
    assert waived.q_end == plain.q_end
    assert pendulum().simulate("time=1", start=start).motion.q_end > plain.q_end


@pytest.mark.parametrize("method", ["energy", "euler_q"])
def test_methods_without_friction_refuse_it(method):
    with pytest.raises(RequestError, match="joints have friction"):
        pendulum().simulate("time=1", start={"crank": (0.5, 0.0)}, method=method)


@pytest.mark.parametrize(("coefficient", "time"), [(0.2, 1.0), (0.5, 0.3), (0.7, 1.0), (0.9, 0.1)])
def test_what_friction_takes_is_what_energy_misses_wherever_the_run_ends(coefficient, time):
    mechanism, start = pendulum(1.0, coefficient), (LOWEST, 8.0)
    motion = mechanism.simulate(f"time={time}", start={"crank": start}, accuracy=1e-12).motion
    energy = start[1] ** 2 / 2 - motion.qd_end**2 / 2 - G * (math.sin(motion.q_end) + 1)
    assert motion.facts["friction_work"] == pytest.approx(energy, rel=1e-12)
    implicit = mechanism.simulate(f"time={time}", start={"crank": start}, method="radau").motion
    assert abs(motion.q_end - implicit.q_end) <= motion.error + implicit.error


def test_a_balanced_wheel_slows_down_evenly():
    """Its pin carries the weight alone: a load that does not change has no kink."""
    wheel, pin = bm.Link(mass=2.0, inertia=0.5), bm.friction.Coulomb(coefficient=0.2, radius=0.05)
    graph = machines.crank(0.1, wheel, pin, gravity=G)
    motion = graph.compile().simulate("standstill", start={"crank": (0.0, 5.0)}).motion
    assert motion.events[-1].t == pytest.approx(5.0 * 0.5 / (0.2 * 0.05 * 2.0 * G), rel=1e-12)


def test_a_rate_whose_energy_is_below_all_numbers_is_a_start_from_rest():
    free = pendulum(coefficient=0.0)
    swings, still = (
        free.simulate("time=1", start={"crank": (0.0, rate)}, want="crank.q")["crank.q"].tolist()
        for rate in (5e-324, 0.0)
    )
    assert swings == still


def test_of_several_solutions_a_motion_gives_the_one_that_moves_it():
    """At accelerations that are given, the slider group's friction has two: one idles the drive."""
    pin = {"law": "coulomb", "coefficient": 0.2, "radius": 0.02}
    graph = bm.Graph("two solutions", gravity=(0.0, -9.8))
    ground = {"A": ((0.2, 0.1), -1.6), "B": ((0.6, 0.8), 0.0), "S": ((-0.6, 1.1), -2.2)}
    markers = {name: bm.Marker(at=at, angle=angle) for name, (at, angle) in ground.items()}
    graph.add("frame", bm.Frame(markers=markers))
    guide = bm.Marker(at=(-0.6, -0.9), angle=-0.6)
    marker = bm.Marker(at=(-0.9, 0.7), angle=-1.2)
    arm = bm.Link(markers={"one": guide, "two": marker})
    graph.add("crank", bm.Crank(length=1.3, links={"crank": arm}))
    bar = bm.Link(mass=1.1, inertia=0.4, cm=(0.5, -0.1))
    rrp = {"l": 2.1, "h": -0.2, "branch": -1, "x_S": 0.1, "slider": "later"}
    graph.add("rocker", bm.RRP(**rrp, links={"j": bar}, friction={"C": pin}))
    links = {
        "i": bm.Link(mass=2.3, inertia=0.6, cm=(0.7, 0.1)),
        "j": bm.Link(mass=0.9, inertia=0.2, cm=(-0.4, 0.2)),
    }
    sides = {"S1": "later", "S2": "earlier"}
    rubbing = {"S1": {"law": "coulomb", "coefficient": 0.1}, "C": pin}
    prp = {"h1": 0.3, "h2": -0.3, "x_S1": 0.0, "x_S2": -0.2, "slider": sides}
    graph.add("slides", bm.PRP(**prp, links=links, friction=rubbing))
    graph.add("couple", bm.Couple(moment=-127.5))
    graph.add("spring", bm.TorsionSpring(stiffness=21.1, rest_angle=-0.4))
    wires = {
        "frame.A": "crank.A",
        "frame.B": "rocker.B",
        "crank.one": "rocker.S",
        "crank.two": "slides.S1",
        "frame.S": "slides.S2",
        "rocker.Cj": "couple.on",
        "crank.crank": "spring.a",
        "slides.j": "spring.b",
    }
    for start, end in wires.items():
        graph.connect(start, end)
    mech = graph.compile()
    start = {"crank": (0.66, -0.53)}
    moved = mech.simulate("time=0.02", start=start, times=[0.0, 0.02], want="*.drive")
    assert moved.quality.status == ("ok", "ok")
    assert {flag.code for flag in moved.quality.flags} == {"by-continuation", "other-solutions"}
    assert np.abs(moved["crank.drive"]).max() <= 1e-9  # 277 N m of the other solution
    assert mech.verify(moved).ok
