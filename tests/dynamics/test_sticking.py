"""Joint friction with several drivers: closed forms, rest, release, what is told of it."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics.change_points import system_of
from blockmech.dynamics.patterns import affine_patterns, patterns
from blockmech.ground.errors import RequestError
from blockmech.plan.plan import Friction
from tests import machines
from tests.dynamics.motions import PIN_START
from tests.gallery import changed, document

G = 9.81  # [m/s2]
LOWEST = -math.pi / 2  # [rad] hanging
PRESS = {"first": -20.0, "second": 20.0}  # [N m] on links whose knee lies against its stop


def coulomb(arm):
    """Coulomb friction with a friction arm [m]."""
    return bm.friction.Coulomb(coefficient=0.5, radius=2 * arm)


def arm(upper=0.0, fore=0.0, law=None):
    """Two links of 1 kg at 0.5 m and 0.4 m in a row, friction arms [m] of their pins."""
    lengths = {"upper": 0.5, "fore": 0.4}
    bodies = [bm.Link(mass=1.0, inertia=0.02, cm=(x / 2, 0.0)) for x in lengths.values()]
    pins = [coulomb(length) if length else None for length in (upper, fore)]
    graph = machines.arms(lengths, bodies, pins, gravity=G)
    if law is not None:
        machines.load(graph, "motor", bm.Motor(law=law), a="frame.A", b="upper.crank")
    return graph


def fivebar(arms):
    """The falling five-bar with friction arms [m] in its pins."""
    data = document("fivebar_falling")
    for address, length in arms.items():
        block, joint = address.split(".")
        law = {"law": "coulomb", "coefficient": 0.5, "radius": 2 * length}
        data["blocks"][block].setdefault("friction", {})[joint] = law
    return changed(data)


def everywhere(length):
    return dict.fromkeys(("left.A", "dyad.B", "dyad.C", "dyad.D", "right.A"), length)


# -- patterns --------------------------------------------------------------------------------


@pytest.mark.parametrize(("m", "k", "count"), [(5, 2, 21), (6, 3, 123), (4, 1, 3), (7, 2, 29)])
def test_patterns_of_general_rows_are_as_many_as_their_hyperplanes_cut(m, k, count):
    rows = np.random.default_rng(m).normal(size=(m, k))
    sign_patterns = patterns(rows)
    assert len(sign_patterns) == count
    for x in np.random.default_rng(0).normal(size=(2000, k)):
        assert tuple(np.sign(rows @ x).astype(int)) in sign_patterns


def test_patterns_of_rows_that_depend_on_one_another_are_those_that_can_be():
    rows = np.array([[1.0, 2.0], [2.0, 4.0], [-1.0, -2.0], [0.0, 0.0]])
    assert patterns(rows) == {(0, 0, 0, 0), (1, 1, -1, 0), (-1, -1, 1, 0)}
    assert affine_patterns(rows[:1], np.array([-3.0])) == {(1,), (0,), (-1,)}
    assert affine_patterns(rows[3:], np.array([-3.0])) == {(-1,)}


# -- motions ---------------------------------------------------------------------------------


def test_two_pendulums_side_by_side_move_and_rest_as_each_alone():
    """One of them rests as it does by itself while the other swings on."""
    g, alone = (bm.Graph("pendulums", gravity=(0.0, -G)) for _ in range(2))
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0), "P": (3.0, 0.0)}))
    alone.add("frame", bm.Frame(markers={"O": (0.0, 0.0)}))
    for name, marker, friction in (("one", "O", 0.12), ("other", "P", 0.002)):
        link = bm.Link(mass=1.0, cm=(1.0, 0.0))
        crank = bm.Crank(length=1.0, links={"crank": link}, friction={"A": coulomb(friction)})
        for graph in (g, alone) if name == "one" else (g,):
            graph.add(name, crank)
            graph.connect(f"frame.{marker}", f"{name}.A")
    start = {"one": (PIN_START, 0.0), "other": (PIN_START, 0.0)}
    motion = g.compile().simulate("time=6", start=start, accuracy=1e-7, want=()).motion
    single = alone.compile().simulate("time=6", start={"one": start["one"]}, want=()).motion
    stood = [e.q[0] for e in motion.events if e.kind.endswith("one.A")]
    expected = [e.q for e in single.events if e.kind == "standstill"]
    assert len(expected) == 4
    assert np.abs(np.array(stood) - expected).max() <= motion.error + single.error
    assert [e.kind for e in motion.events if e.kind.startswith("sticking")] == ["sticking of one.A"]
    assert abs(motion.qd_end[0]) <= 1e-15 < abs(motion.qd_end[1])
    assert motion.facts["energy_balance"] <= 1e-8


@functools.cache
def falling_arm():
    """The arm that lets itself down, and how by the method that it chooses."""
    mech = arm(0.006, 0.03).compile()
    start = {"upper": (0.0, 0.0), "fore": (0.0, 0.0)}
    return mech, mech.simulate("time=0.8", start=start, accuracy=1e-8, want="*")


@pytest.mark.parametrize("method", ["radau", "rk4"])
def test_all_methods_in_time_agree_within_what_they_say(method):
    mech, result = falling_arm()
    exact = result.motion
    start = {"upper": (0.0, 0.0), "fore": (0.0, 0.0)}
    request = {"start": start, "accuracy": 1e-5, "want": ()}
    motion = mech.simulate("time=0.8", method=method, **request).motion
    assert np.abs(motion.q_end - exact.q_end).max() <= motion.error + exact.error
    assert [e.kind for e in motion.events] == [e.kind for e in exact.events]


def test_an_arm_rests_where_both_pins_hold_it_and_says_how_much_of_that_is_used():
    mech = arm(0.6, 0.4).compile()
    motion = mech.simulate("time=2", start={"upper": (0.3, 0.0), "fore": (0.2, 0.0)}, want="*")
    upper_arm, elbow, fore_arm = 0.25 * math.cos(0.3), 0.5 * math.cos(0.3), 0.2 * math.cos(0.5)
    shares = [
        (upper_arm + elbow + fore_arm) / (2 * 0.6),
        fore_arm / 0.4,
    ]  # of moments over arm times weight
    assert motion.motion.facts["holding_share"] == pytest.approx(max(shares), rel=1e-13)
    assert [e.kind for e in motion.motion.events] == ["rest"]
    assert motion["fore.A.friction"] == pytest.approx(G * fore_arm, rel=1e-12)
    assert motion["upper.drive"] == pytest.approx(0.0, abs=1e-13)
    assert mech.verify(motion).ok
    for standstill in ("event", "time=1"):
        until = {"event": {"watch": [bm.Watch("x", lambda t, q, qd: q[0])]}}.get(standstill, {})
        start = {"upper": (0.3, 0.0), "fore": (0.2, 0.0)}
        assert mech.simulate(standstill, start=start, want=(), **until).motion.q_end[0] == 0.3


def test_events_of_the_time_are_met_at_rest():
    """They were skipped: nothing was looked at until a load let the arm go, or the run was over."""
    start, watch = {"upper": (0.3, 0.0), "fore": (0.2, 0.0)}, []
    for name, t0 in (("tick", 0.2), ("bell", 0.5), ("late", 0.9)):
        watch.append(bm.Watch(name, lambda t, q, qd, t0=t0: t - t0, terminal=name != "tick"))
    motion = arm(0.6, 0.4).compile().simulate("time=2", start=start, watch=watch, want=()).motion
    assert (motion.status, motion.end, motion.t_end) == ("reached", "bell", 0.5)
    assert [(e.kind, e.t) for e in motion.events] == [("rest", 0.0), ("tick", 0.2), ("bell", 0.5)]
    assert (motion.q_end == [0.3, 0.2]).all()


def test_a_load_of_the_time_releases_the_pair_that_it_outgrows():
    """The shoulder holds 2 m g at its arm, hanging at rest; the moment grows by 0.5 N m/s."""
    law = {"kind": "polynomial", "of": "time", "coefficients": [0.0, 0.5]}
    mech = arm(0.02, 0.2, law).compile()
    start = {"upper": (LOWEST, 0.0), "fore": (0.0, 0.0)}
    result = mech.simulate("time=1.2", start=start, accuracy=1e-8, want="*")
    leaves = 0.02 * 2 * G / 0.5
    kinds = [e.kind for e in result.motion.events]
    assert kinds[:2] == ["rest", "slipping of upper.A"]
    assert result.motion.events[1].t == pytest.approx(leaves, rel=1e-12)
    assert (result.motion.at(0.999 * leaves).q == [LOWEST, 0.0]).all()
    assert result.motion.at(1.1 * leaves).q[0] > LOWEST
    assert abs(result.motion.q_end[1]) <= 1e-14  # the elbow holds on
    assert mech.verify(result).ok


def least_share(system, q):
    """Over distributions that balance: by brute force, the least of the largest shares."""
    from scipy.optimize import linprog

    friction = system.friction
    at = friction.instant(q, np.zeros(2), 0.0, None, None)
    t = np.zeros(5)
    for _ in range(300):
        capacity = friction._breakaway(at, at.f + at.R @ t)
        cost = np.append(np.zeros(5), 1.0)
        bounds = np.vstack([np.c_[np.eye(5), -capacity], np.c_[-np.eye(5), -capacity]])
        solution = linprog(
            cost, bounds, np.zeros(10), np.c_[at.S.T, np.zeros(2)], -at.push, (None, None)
        )
        t, last = solution.x[:5], t
        if np.abs(t - last).max() < 1e-13:
            return float(solution.x[5])
    return math.nan


@pytest.mark.parametrize("length", [0.1, 0.2, 0.3])
def test_all_pairs_of_a_loop_hold_it_where_linear_programming_finds_a_distribution(length):
    mech = fivebar(everywhere(length))
    q = np.array([1.2, 2.2])
    share = least_share(system_of(mech, method=Friction()), q)
    assert 0 < share < 3
    start = {"left": (1.2, 0.0), "right": (2.2, 0.0)}
    result = mech.simulate("time=0.05", start=start, want="*")
    rests = [e.kind for e in result.motion.events] == ["rest"]
    assert rests == (share < 1)
    if rests:
        assert result.motion.facts["holding_share"] == pytest.approx(share, rel=1e-9)
    assert mech.verify(result).ok


def test_the_friction_at_which_a_loop_begins_to_slip_is_where_its_share_is_one():
    from scipy.optimize import brentq

    q, start = np.array([1.2, 2.2]), {"left": (1.2, 0.0), "right": (2.2, 0.0)}

    def excess(length):
        return least_share(system_of(fivebar(everywhere(length)), method=Friction()), q) - 1

    edge = brentq(excess, 0.1, 0.4, xtol=1e-10)
    for factor, rests in ((1 + 1e-7, True), (1 - 1e-7, False)):
        motion = fivebar(everywhere(edge * factor)).simulate("time=0.01", start=start).motion
        assert ([e.kind for e in motion.events] == ["rest"]) == rests


# -- what is told ----------------------------------------------------------------------------


def test_where_two_patterns_are_right_the_start_is_ambiguous():
    arms = dict(zip(everywhere(0.0), (0.18, 0.26, 0.14, 0.16, 0.2), strict=True))
    start = {"left": (0.71, 0.0), "right": (2.38, 0.0)}
    motion = fivebar(arms).simulate("time=0.1", start=start, want=()).motion
    assert (motion.status, motion.end) == ("failed", "ambiguous start")
    assert motion.notes[0].startswith("ambiguous start: t = 0 s, q = ")


def test_without_an_acceleration_that_satisfies_the_laws_the_state_is_named():
    """f' r m l / J = 1.2 in one of two pendulums: Painleve's paradox."""
    g = bm.Graph("two", gravity=(0.0, -G))
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0), "P": (3.0, 0.0)}))
    for name, marker, friction in (("one", "O", 1.2), ("other", "P", 0.01)):
        link = bm.Link(mass=1.0, cm=(1.0, 0.0))
        pin = {"A": coulomb(friction)}
        g.add(name, bm.Crank(length=1.0, links={"crank": link}, friction=pin))
        g.connect(f"frame.{marker}", f"{name}.A")
    start = {"one": (0.5, 1.0), "other": (0.5, 1.0)}
    motion = g.compile().simulate("time=1", start=start, want=()).motion
    assert (motion.status, motion.end) == ("failed", "self-locking in motion")


def test_a_steady_state_is_refused_with_what_can_be_asked():
    with pytest.raises(RequestError, match="joint friction and several drivers") as caught:
        arm(0.1, 0.1).compile().simulate("steady", start={"upper": (0, 1), "fore": (0, 0)})
    assert "valid: time, event" in str(caught.value)


def test_outputs_along_the_motion_are_those_of_its_pairs():
    """Sample by sample: what sticks does not slip, what slips has all friction, drives are idle."""
    mech, result = falling_arm()
    load = 0.03 * np.abs(result["fore.A.reaction"])
    slip, t = result["fore.A.slip"], result["fore.A.friction"]
    begin, end = (e.t for e in result.motion.events if e.kind.endswith("ing of fore.A"))
    stuck = (result.time >= begin) & (result.time < end)  # at an event it is what follows
    assert stuck.sum() > 20
    assert np.abs(slip[stuck]).max() <= 1e-14
    assert (np.abs(t[stuck]) < load[stuck]).all()
    assert np.abs(t[~stuck]) == pytest.approx(load[~stuck], rel=1e-9)
    assert max(np.abs(result[f"{d}.drive"]).max() for d in mech.drivers) <= 1e-11
    flags = {f.sample for f in result.quality.flags if f.code == "zero-relative-speed"}
    assert set(np.flatnonzero(stuck).tolist()) <= flags


def test_drivers_that_lie_against_stops_and_bounce_rub_as_well():
    g = arm(0.006, 0.01)
    g.add_stop("upper", -1.0, 1.0, restitution=0.3)
    mech = g.compile()
    start = {"upper": (0.0, 0.0), "fore": (0.0, 0.0)}
    result = mech.simulate("time=1.5", start=start, accuracy=1e-6, want="*")
    assert result.motion.impacts
    assert "their friction is followed through it" in " ".join(result.motion.notes)
    lies = result.motion.held(result.time, ("upper", "fore"))[:, 0]
    assert lies.any()
    assert np.abs(result["upper.q"][lies] + 1.0).max() <= 1e-12
    assert np.abs(result["fore.drive"]).max() <= 1e-9


def test_a_pair_turns_back_while_the_machine_lies_against_a_stop():
    """A five-bar whose knee is pressed against its stop is a four-bar: its rocker's pin D turns."""
    points = {"A": 0j, "B": 0.5 + 0j, "K": 0.775 + 0.533j, "C": 0.8 + 0.85j, "D": 1.1 + 0j}
    ends = {"crank": "AB", "first": "BK", "second": "KC", "rocker": "DC"}

    def machine(knee):
        m = bm.Linkage("knee", gravity=(0.0, -G))
        for link, (a, b) in ends.items():
            middle = (points[a] + points[b]) / 2
            m.add_link(link, mass=1.0, inertia=0.05, cm=(middle.real, middle.imag))
            m.add_load(f"press {link}", "couple", link=link, moment=PRESS.get(link, 0.0))
        pairs = {"A": ("frame", "crank"), "B": ("crank", "first"), "C": ("second", "rocker")}
        for joint, links in (pairs | {"D": ("frame", "rocker"), "K": ("first", "second")}).items():
            point, kind = (points[joint].real, points[joint].imag), knee if joint == "K" else "R"
            pin = {"friction": coulomb(0.005)} if joint == "D" else {}
            m.add_joint(joint, kind, links, point=point, **pin)
        m.add_driver("motor", "A")
        m.start("motor", q=0.0, rate=4.0)
        return m

    four = machine("weld").compile()
    (rate,) = four.run(at=[0.0], rates=4.0, want=["joint.D.slip"])["joint.D.slip"]
    five = machine("R")
    five.add_driver("arm", "D")
    five.start("arm", q=0.0, rate=float(rate))
    five.add_stop("joint.K.coordinate", high=0.0, restitution=0.0)
    runs = [m.simulate(times=[0.01, 0.3, 0.8], want="joint.*") for m in (four, five.compile())]
    assert [event.kind for event in runs[1].motion.events] == ["rest", "reversal of joint.D"]
    for name in ("joint.A.coordinate", "joint.D.friction", "joint.D.reaction"):
        np.testing.assert_allclose(runs[1][name], runs[0][name], rtol=1e-9)
    assert np.ptp(np.sign(runs[0]["joint.D.slip"])) == 2


@pytest.mark.parametrize("q", [-1.2, -1.0, -0.8])
def test_a_dry_pin_holds_an_arm_that_its_stop_no_longer_pushes(q):
    """Its acceleration is rounding, which is no push back onto the stop."""
    g = arm(0.2, 0.0, bm.laws.Polynomial(of="time", coefficients=[-12.0, 30.0]))
    g.add_stop("upper", q, q + 2.0, restitution=0.0)
    g.start("upper", q=q)
    g.start("fore", q=0.5)
    motion = g.compile().simulate("time=0.7", want=(), budget=5, accuracy=1e-8).motion
    leaves, slips = motion.events[1:]
    assert (leaves.kind, slips.kind) == ("leaves its stop", "slipping of upper.A")
    assert slips.t > leaves.t + 0.05
    assert slips.q[0] == pytest.approx(q, abs=1e-12)


def test_a_motion_that_only_begins_has_the_friction_of_what_begins():
    mech = arm(0.006, 0.03).compile()
    start = {"upper": (0.2, 0.0), "fore": (0.1, 0.0)}
    start_outputs = mech.simulate(times=[0.0], start=start, want="*")
    later = mech.simulate("time=0.01", times=[0.0], start=start, want="*")
    for name in ("upper.acceleration", "fore.acceleration", "fore.A.friction", "upper.drive"):
        assert start_outputs[name] == pytest.approx(later[name], rel=1e-12, abs=1e-12)
    assert np.abs(start_outputs["fore.A.friction"]) == pytest.approx(
        0.03 * np.abs(start_outputs["fore.A.reaction"]), rel=1e-12
    )


@pytest.mark.parametrize("arms", [{}, everywhere(0.01)])
def test_a_start_without_a_pose_is_named_and_has_no_outputs(arms):
    start = {"left": (3.0, 0.0), "right": (0.1, 0.0)}  # the cranks point away from each other
    mech = fivebar(arms).compile()
    result = mech.simulate("time=1", start=start, want=["left.drive", "left.acceleration"])
    assert (result.motion.status, result.motion.end) == ("failed", "impossible pose")
    assert result.quality.status == ("no-assembly",)
    assert np.isnan(result["left.drive"]).all()


def test_bristles_and_pairs_that_stick_go_together_with_several_drivers():
    """A LuGre elbow has no reversal and no rest of its own; the shoulder is Coulomb's."""
    bristles = {"stiffness": 1e3, "damping": 1.0, "static": 0.3, "kinetic": 0.2}
    law = bm.friction.LuGre(**bristles, stribeck_speed=0.5, viscous=0.01, radius=0.05)
    g = arm(0.006, 0.03)
    data = g.to_data()
    data["blocks"]["fore"]["friction"] = {"A": law.model_dump(mode="json")}
    mech = bm.Graph.from_data(data).compile()
    start = {"upper": (0.0, 0.0), "fore": (0.0, 0.0)}
    result = mech.simulate("time=0.03", start=start, accuracy=1e-6, want="*")
    assert result.motion.reached
    assert result.motion.facts["energy_balance"] <= 1e-12
    assert mech.verify(result).ok


def test_explain_says_how_often_the_force_pass_is_asked():
    from blockmech.dynamics.simulation import evaluation_cost

    assert evaluation_cost(arm(0.1, 0.1).compile(), None).endswith("5 times")
