"""The contact problem of an instant, for one driver and for several: laws, rest, turning pairs."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics.change_points import system_of
from blockmech.dynamics.contacts import Constraints, constrained
from blockmech.plan.plan import Friction
from tests import machines
from tests.gallery import changed, document

G = 9.81  # [m/s2]


def friction_of(mech):
    """What joint friction does at instants of a mechanism."""
    return system_of(mech, method=Friction("newton")).friction


def dry(arm):
    """A pin with a friction arm [m]."""
    return {"law": "coulomb", "coefficient": 0.5, "radius": 2 * arm}


def arms(count, arm):
    """Links of 1 kg and 0.4 m in a row, each a driver, with dry pins."""
    link = bm.Link(mass=1.0, inertia=0.02, cm=(0.2, 0.0))
    pin = bm.friction.Coulomb(coefficient=0.5, radius=2 * arm)
    lengths = {f"arm{i}": 0.4 for i in range(count)}
    return machines.arms(lengths, [link] * count, [pin] * count, gravity=G).compile()


def fivebar(arm):
    """The falling five-bar, all of its pins dry."""
    data = document("fivebar_falling")
    for block, joints in (("left", "A"), ("dyad", "BCD"), ("right", "A")):
        data["blocks"][block]["friction"] = {joint: dry(arm) for joint in joints}
    return changed(data)


def fourbar(arm, beside=False):
    """A four-bar that swings, all of its pins dry; ``beside`` it a pendulum of its own."""
    crank = bm.Link(mass=2.0, inertia=0.1, cm=(0.05, 0.0))
    rod = bm.Link(mass=1.0, inertia=0.02, cm=(0.2, 0.0))
    pin = bm.friction.Coulomb(coefficient=0.5, radius=2 * arm)
    lengths, pivot = (0.1, 0.4, 0.3, 0.4), {"E": (3.0, 0.0)}
    graph = machines.fourbar(*lengths, [crank, rod, rod], pin, gravity=G, markers=pivot)
    if beside:
        graph.add("other", bm.Crank(length=0.5, links={"crank": rod}))
        graph.connect("frame.E", "other.A")
    return graph.compile()


def answers(at, static):
    """Accelerations that satisfy the laws at rest: of all patterns of sides, each by itself."""
    m, k = at.S.shape
    solutions = []
    for sides in map(np.array, itertools.product((-1, 0, 1), repeat=m)):
        stuck, t = sides == 0, np.zeros(m)
        S = at.S[stuck]
        matrix = np.block([[at.M, -S.T], [S, np.zeros((len(S), len(S)))]])
        for _ in range(200):
            right = np.append(at.push + t[~stuck] @ at.S[~stuck], np.zeros(len(S)))
            both = np.linalg.lstsq(matrix, right, rcond=1e-12)[0]
            last, t[stuck] = t.copy(), both[k:]
            load = np.abs(at.f + at.G @ both[:k] + at.R @ t)
            t[~stuck] = (-sides * static * load)[~stuck]
            if np.abs(t - last).max() <= 1e-15 * np.abs(t).max():
                break
        starts = sides * (at.S @ both[:k])
        if (starts[~stuck] > 1e-9).all() and (np.abs(t[stuck]) <= (static * load)[stuck]).all():
            solutions.append(both[:k])
    return solutions


MACHINES = {
    "one driver": (lambda: arms(1, 0.03), 1),
    "two arms": (lambda: arms(2, 0.03), 2),
    "three arms": (lambda: arms(3, 0.02), 3),
}


@pytest.mark.parametrize("name", MACHINES)
def test_a_start_from_rest_is_the_one_that_brute_force_finds(name):
    make, k = MACHINES[name]
    friction, rng, kinds = friction_of(make()), np.random.default_rng(5), set()
    for _ in range(12):
        q = rng.uniform(-np.pi, np.pi, k)
        if rng.random() < 0.5:  # all but hanging: some hold
            q = np.append(-np.pi / 2, np.zeros(k - 1)) + rng.normal(0, 0.1, k)
        settled, qdd, _ = friction.from_state(q, np.zeros(k), 0.0, None)
        at = friction.instant(q, np.zeros(k), 0.0, None, None)
        (expected,) = answers(at, np.array(friction.static[: len(friction.names)]))
        assert settled.end == ""
        np.testing.assert_allclose(qdd, expected, rtol=1e-9, atol=1e-9 * np.abs(at.unheld).max())
        kinds.add(settled.sides)
    assert len(kinds) > 1


@pytest.mark.parametrize(("make", "k"), [(fourbar, 1), (fivebar, 2)])
def test_what_a_loop_does_satisfies_laws_and_balance(make, k):
    friction, rng = friction_of(make(0.02)), np.random.default_rng(3)
    m = len(friction.names)
    for rate in (0.0, 1.0):
        for _ in range(6):
            q = np.array([1.2, 2.2])[:k] + rng.normal(0, 0.3, k)
            qd = rate * rng.normal(size=k)
            settled, qdd, _ = friction.from_state(q, qd, 0.0, None)
            at = friction.instant(q, qd, 0.0, None, None)
            response = friction.respond(at, settled.sides)
            sides, t = np.array(settled.sides), response.t
            size = np.abs(at.push).max()
            np.testing.assert_allclose(at.M @ qdd, at.push + t @ at.S, atol=1e-12 * size)
            loads = np.abs(at.f + at.G @ qdd + at.R @ t)
            capacity = np.array(friction.static[:m]) * loads
            slips = sides != 0
            np.testing.assert_allclose(t[slips], (-sides * capacity)[slips], rtol=1e-10)
            assert (np.abs(t[~slips]) <= capacity[~slips] * (1 + 1e-9)).all()
            moves = at.S @ qdd + at.b if not rate else at.w
            assert (sides[slips] * moves[slips] > 0).all()


def test_one_driver_is_several_of_which_the_others_stand_apart():
    alone, both = friction_of(fourbar(0.02)), friction_of(fourbar(0.02, beside=True))
    rng = np.random.default_rng(8)
    for rate in (0.0, 0.0, 2.0, -2.0):
        q, second = rng.uniform(-3, 3, 1), rng.uniform(-3, 3, 1)
        single, qdd, _ = alone.from_state(q, np.array([rate]), 0.0, None)
        two, qdds, _ = both.from_state(np.append(q, second), np.array([rate, 0.7]), 0.0, None)
        assert single.sides == two.sides
        np.testing.assert_allclose(qdds[0], qdd[0], rtol=1e-13)


@pytest.mark.parametrize("beside", [False, True])
def test_a_pair_at_its_dead_centre_turns_and_does_not_stop_the_machine(beside):
    """Where the rocker stands its pin D has no row but rounding: sticking there stops all."""
    mech = fourbar(0.001, beside)
    friction = friction_of(mech)
    j = friction.names.index("dyad.D")
    q = np.linspace(0.2, 0.2 + np.pi, 400)
    row = [
        friction.instant(np.array([x, 0.3][: 1 + beside]), np.zeros(1 + beside), 0.0, None, None).S[
            j, 0
        ]
        for x in q
    ]
    last = float(q[np.flatnonzero(np.diff(np.sign(row)))[0]])
    from scipy.optimize import brentq

    def slip(x):
        state = np.array([x, 0.3][: 1 + beside]), np.array([1.0, 0.0][: 1 + beside])
        return friction.rates(*state)[j]

    dead = brentq(slip, last, last + q[1] - q[0], xtol=1e-15)
    state = np.array([dead + 1e-9, 0.3][: 1 + beside]), np.array([5.0, 1.0][: 1 + beside])
    at = friction.instant(*state, 0.0, None, None)
    assert 0 < abs(at.S[j, 0]) < 1e-7 * np.abs(at.S).max()
    turned = friction.turning(at, [j])
    assert not turned.S[j].any()
    located = at._replace(rate=1e-14 * at.rate)  # all stand: an event is found to rounding
    np.testing.assert_array_equal(friction.turning(located, [j], 0.3).S, at.S)
    settled = friction.settled(turned, [j])
    assert settled.sides[j] == np.sign(at.b[j])
    np.testing.assert_array_equal(friction.sticking_rates(turned, settled.sides), state[1])

    start = {"crank": (0.2, 8.0)} | ({"other": (0.3, 1.0)} if beside else {})
    motion = mech.simulate("time=1", start=start, accuracy=1e-8, want=()).motion
    alone = fourbar(0.001).simulate("time=1", start={"crank": (0.2, 8.0)}, want=()).motion
    assert np.ravel(motion.q_end)[0] == pytest.approx(alone.q_end, abs=motion.error + alone.error)
    turns = [e for e in motion.events if e.kind in ("joint reverses", "reversal of dyad.D")]
    assert 2 <= len(turns) < 40


@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize(("short", "rests"), [(1e-9, False), (1e-12, False), (-1e-12, True)])
def test_a_slope_holds_to_rounding_with_any_number_of_drivers(beside, short, rests):
    """Friction a billionth, and a trillionth, short of holding lets it start; else it rests."""
    slope = math.atan(0.3)
    g = bm.Graph("slope", gravity=(0.0, -G))
    markers = {"G": bm.Marker(at=(0.0, 0.0), angle=slope), "O": (5.0, 0.0)}
    g.add("frame", bm.Frame(markers=markers))
    rough = {"S": bm.friction.Coulomb(coefficient=0.3 * (1 - short))}
    body = bm.Link(mass=3.0)
    g.add("slider", bm.SlideDrive(links={"slider": body}, friction=rough))
    g.connect("frame.G", "slider.S")
    if beside:
        hanging = bm.Link(mass=1.0, cm=(0.0, -0.5))
        dry_pin = {"A": bm.friction.Coulomb(coefficient=0.3, radius=0.02)}
        g.add("other", bm.Crank(length=0.5, links={"crank": hanging}, friction=dry_pin))
        g.connect("frame.O", "other.A")
    mech, still = g.compile(), np.zeros(1 + beside)
    settled, qdds, _ = friction_of(mech).from_state(still, still, 0.0, None)
    qdd = qdds[mech.drivers.index("slider")]
    assert settled.end == ""
    assert any(settled.sides) is not rests
    expected = 0.0 if rests else -G * math.cos(slope) * 0.3 * short
    assert qdd == pytest.approx(expected, rel=1e-3, abs=0.0)


def test_of_one_driver_what_holds_it_is_what_sticking_needs():
    """The share that pairs need at rest is one where the effort that starts it is zero."""
    friction = friction_of(fourbar(0.05))
    low, high, rounding = friction.holding(np.linspace(0.0, 6.0, 40))
    assert (low <= high).all()
    assert (rounding < 1e-12).all()
    for q, a, b in zip(np.linspace(0.0, 6.0, 40), low, high, strict=True):
        settled, qdd, _ = friction.from_state(np.array([q]), np.zeros(1), 0.0, None)
        assert any(settled.sides) is not bool(a <= 0 <= b)
        assert np.sign(qdd[0]) == (0 if a <= 0 <= b else 1 if b < 0 else -1)


def test_where_no_pose_is_nothing_that_lies_against_a_stop_has_an_acceleration():
    """A step may look beyond where links reach: it is taken back, and raises nothing."""
    nowhere = Constraints(np.full((1, 2), np.nan), np.array([np.nan]), ((0, 1),))
    for numbers in constrained(np.eye(2), np.ones(2), nowhere):
        assert np.isnan(numbers).all()
