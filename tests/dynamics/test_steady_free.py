"""Steady states without loads of the time, against closed forms and long integrations."""

from __future__ import annotations

import cmath
import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from blockmech.dynamics.request import Start
from blockmech.ground.errors import RequestError
from tests.dynamics.linkages import fourbar, motored, pendulum
from tests.dynamics.scenes import (
    JUDGE,
    LONG,
    LOWEST,
    MULTIPLIER,
    TURN,
    WEIGHT,
    J,
    K,
    M,
    at_rest,
    motor,
    of_rate,
    refused,
    rod,
    slide,
)
from tests.dynamics.synthetic import move
from tests.dynamics.test_integrators import double_pendulum
from tests.gallery import changed, document

# -- loads of place and rate ------------------------------------------------------------------


@cache
def steady():
    return move(motored(), Start(0.5), "steady", accuracy=1e-10)


def test_steady_rotation_is_what_a_turn_leaves_as_it_is_and_the_start_runs_into():
    motion = steady()
    rate, fading = float(motion.at(0.0).qd), motion.facts["multiplier"]
    again = move(motored(), Start(0.5, rate), "turns=1", accuracy=1e-11)
    assert again.qd_end == pytest.approx(rate, rel=1e-10)
    long = move(motored(), Start(0.5), "turns=6", accuracy=1e-9)
    assert long.qd_end == pytest.approx(rate, rel=2 * fading**6)
    assert motion.q_end == 0.5 + TURN
    assert (motion.method, motion.regime) == ("return map", "steady state")


@pytest.mark.parametrize("method", ["auto", "dop853"])
def test_a_square_drag_has_a_multiplier_in_closed_form(method):
    # d(moment)/d(rate) = -rate/10, so the integral over a turn is -2 pi/10, whatever the motion
    scene = rod(lambda rate: 8.0 - rate * abs(rate) / 20)
    motion = scene.simulate("steady", method=method, start=at_rest(0.0)).motion
    assert motion.facts["multiplier"] == pytest.approx(math.exp(-TURN / 10 / J), abs=MULTIPLIER)


def test_a_rotation_repeats_for_ever():
    motion = steady()
    later = motion.track.state(np.array([0.1, 0.1 + motion.t_end, 0.1 + 1000 * motion.t_end]))
    assert np.abs(np.diff(later.q) / TURN - [1, 999]).max() <= 1e-9
    assert np.ptp(later.qd) <= 1e-8


def test_van_der_pol_swings_are_those_of_an_independent_integration():
    law = of_rate(1.0, 0.0, -1.0)
    r = slide(M, K, 0.0, law).simulate("steady", start=at_rest(0.1, "slider"))
    motion = r.motion

    def slope(t, y):
        return [y[1], (y[1] - y[1] ** 3 - K * y[0]) / M]

    def stands(t, y):
        return y[1]

    stands.direction = 1  # it turns back from the left
    long = solve_ivp(slope, (0, 60), [0.1, 0.0], events=stands, **JUDGE)
    times, coordinates = long.t_events[0], long.y_events[0][:, 0]
    assert motion.facts["period"] == pytest.approx(times[-1] - times[-2], abs=LONG)
    assert np.ptp(motion.at(motion.times(401)).q) / 2 == pytest.approx(-coordinates[-1], rel=1e-4)
    # disturbances fade by the integral of d(force)/d(rate)/m over a period
    orbit = solve_ivp(
        lambda t, y: [*slope(t, y[:2]), (1 - 3 * y[1] ** 2) / M],
        (0, motion.facts["period"]),
        [coordinates[-1], 0.0, 0.0],
        **JUDGE,
    )
    assert motion.facts["multiplier"] == pytest.approx(math.exp(orbit.y[2, -1]), abs=1e-8)


def test_the_same_swings_are_found_from_inside_outside_and_the_unstable_rest():
    scene = slide(M, K, 0.0, of_rate(1.0, 0.0, -1.0))
    starts = (0.1, 0.8, 0.0)
    one, *others = (scene.simulate("steady", start=at_rest(x, "slider")).motion for x in starts)
    for other in others:
        fastest, as_fast = (np.abs(m.at(m.times(2001)).qd).max() for m in (one, other))
        assert fastest == pytest.approx(as_fast, rel=1e-5)  # of samples of a largest value
        apart = abs(one.facts["period"] - other.facts["period"])
        assert apart <= one.time_error + other.time_error


def test_of_two_steady_states_the_start_decides():
    scene = rod(motor(3.0, 12.0))
    slow = scene.simulate("steady", start=at_rest(-1.0)).motion
    fast = scene.simulate("steady", start={"crank": (-1.0, 9.0)}).motion
    assert (slow.method, fast.method) == ("equilibrium", "return map")
    for start in (at_rest(-1.0), {"crank": (-1.0, 9.0)}):
        long = scene.simulate("time=15", start=start).motion
        settled = slow if start == at_rest(-1.0) else fast
        assert settled.at(0.0).qd == pytest.approx(
            0.0 if settled is slow else settled.facts["mean_speed"], rel=0.2, abs=1e-9
        )
        assert (abs(long.qd_end) > 1) is (settled is fast)


def test_a_stable_swing_beside_a_stable_rest():
    scene = slide(M, K, 0.0, of_rate(-1.0, 0.0, 0.4, 0.0, -0.03))
    small, large = (scene.simulate("steady", start=at_rest(q, "slider")).motion for q in (0.2, 0.8))
    assert (small.method, large.method) == ("equilibrium", "return map")


# -- rest -------------------------------------------------------------------------------------


@pytest.mark.parametrize("c", [0.5, 20.0])
@pytest.mark.parametrize("start", [(1.0, 0.0), (0.0, 4.0)])
def test_a_damped_pendulum_comes_to_rest_where_it_hangs(c, start):
    motion = rod(of_rate(-c)).simulate("steady", start={"crank": start}).motion
    assert (motion.method, motion.regime) == ("equilibrium", "rest")
    away = math.remainder(motion.q_end - LOWEST, TURN)
    assert abs(away) <= motion.error <= 1e-13
    root = (-c + cmath.sqrt(c * c - 4 * J * WEIGHT)) / (2 * J)
    assert motion.facts["decay_rate"] == pytest.approx(-root.real, rel=1e-9)
    assert motion.facts.get("frequency", 0.0) == pytest.approx(root.imag, rel=1e-9)


def test_a_linkage_without_drive_comes_to_rest():
    motion = move(motored(stall=0.0), Start(0.5, 3.0), "steady")
    assert motion.method == "equilibrium"
    assert abs(motored(stall=0.0).scalar_terms(motion.q_end).tau) <= 1e-12
    long = move(motored(stall=0.0), Start(0.5, 3.0), "time=20", accuracy=1e-10)
    away = math.remainder(long.q_end - motion.q_end, TURN)
    # what is left of the swings after so long
    assert abs(away) <= 10 * math.exp(-motion.facts["decay_rate"] * 20) + long.error


def test_a_wheel_in_oil_stops_where_its_momentum_is_used_up():
    drag, rate = 0.5, 3.0
    motion = (
        rod(of_rate(-drag), gravity=0.0).simulate("steady", start={"crank": (0.0, rate)}).motion
    )
    assert abs(motion.q_end - J * rate / drag) <= motion.error <= 1e-11  # integrated in time
    assert "indifferent" in motion.notes[0]


def test_a_start_on_the_top_is_unstable_and_left():
    motion = rod(of_rate(-0.5)).simulate("steady", start=at_rest(-LOWEST)).motion
    assert math.cos(motion.q_end - LOWEST) == pytest.approx(1.0, abs=1e-12)
    assert "unstable equilibrium" in motion.why


def test_several_drivers_come_to_rest():
    plain = double_pendulum()

    def terms(q, qd, t):
        terms = plain.terms(q, qd, t)
        return terms._replace(Q=terms.Q - 0.5 * np.asarray(qd))

    scene = plain.but(terms=terms, depends_on=frozenset({"q", "rate"}))
    motion = move(scene, ([1.0, -0.5], [0.3, 0.0]), "steady")
    assert motion.method == "equilibrium"
    assert np.abs(motion.q_end).max() <= motion.error + 1e-15
    # M s^2 + C s + K with M = [2 1; 1 1], C = 1/2, K = diag(2, 1)
    A = np.block(
        [
            [np.zeros((2, 2)), np.eye(2)],
            [
                -np.linalg.solve([[2.0, 1.0], [1.0, 1.0]], np.diag([2.0, 1.0])),
                -0.5 * np.linalg.inv([[2.0, 1.0], [1.0, 1.0]]),
            ],
        ]
    )
    assert motion.facts["decay_rate"] == pytest.approx(-np.linalg.eigvals(A).real.max(), rel=1e-9)


def held_five_bar():
    """The five-bar of the gallery with springs and heavy dampers at both cranks."""
    data = document("fivebar_falling")
    pivot = "frame." + next(iter(data["blocks"]["frame"]["markers"]))
    for crank, angle in (("left", 1.2), ("right", 2.2)):
        data["blocks"][f"{crank}_drag"] = {"type": "load.motor", "law": of_rate(-60.0)}
        spring = {"type": "load.torsion_spring", "stiffness": 80.0, "rest_angle": angle}
        data["blocks"][f"{crank}_spring"] = spring
        for load in ("drag", "spring"):
            data["wires"].append({"from": pivot, "to": f"{crank}_{load}.a"})
            data["wires"].append({"from": f"{crank}.crank", "to": f"{crank}_{load}.b"})
    return changed(data)


def test_two_cranks_come_to_rest_unless_a_stop_is_in_the_way():
    scene = held_five_bar()
    motion = scene.simulate("steady").motion
    rest = {name: (float(q), 0.0) for name, q in zip(("left", "right"), motion.q_end, strict=True)}
    later = scene.simulate("time=0.5", start=rest, accuracy=1e-10).motion
    assert motion.method == "equilibrium"
    assert np.abs(later.q_end - motion.q_end).max() <= 1e-12
    assert ": end stop of left" in refused(scene, stops={"left": (1.19, 1.3)})


# -- no losses --------------------------------------------------------------------------------


@pytest.mark.parametrize(("start", "regime"), [((1.0, 0.0), "libration"), ((0.0, 3.0), "rotation")])
def test_conservative_scenes_are_periodic_as_they_are(start, regime):
    motion = move(pendulum(), Start(*start), "steady")
    assert (motion.method, motion.regime, motion.end) == ("energy", regime, "steady")
    assert motion.facts["multiplier"] == 1.0
    assert "neither grow nor fade" in motion.notes[-1]
    assert motion.t_end == motion.facts["period"]


@pytest.mark.parametrize(
    ("system", "start", "part"),
    [
        (pendulum(0.5), Start(1.0, 3.0), "do a work of 3.14159265 J"),
        (fourbar(), Start(1.0, 0.0), "dead centre"),
        (fourbar(stops=(0.2, 1.2)), Start(1.0, 0.0), "end stop"),
    ],
)
def test_what_cannot_repeat_says_why(system, start, part):
    with pytest.raises(RequestError, match=part):
        move(system, start, "steady")


def test_several_drivers_without_losses_do_not_repeat_in_general():
    with pytest.raises(RequestError, match="no load dissipates"):
        move(double_pendulum(), ([1.0, -0.5], [0.3, 0.0]), "steady")
    at_ease = move(double_pendulum(), ([0.0, 0.0], [0.0, 0.0]), "steady")
    assert (at_ease.method, at_ease.end) == ("equilibrium", "steady")
