"""Integrators in time: accuracy, honest estimates, events, kinks, dead centres, order."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics import integration as integrators
from blockmech.dynamics.events import crossings
from blockmech.dynamics.programs import Terms
from blockmech.dynamics.request import Start, Until, Watch
from blockmech.dynamics.run import EVALUATIONS
from tests.dynamics.honesty import GRAPHS
from tests.dynamics.linkages import guided, motored, watt
from tests.dynamics.synthetic import Synthetic, move
from tests.wiring import recorded

WATT = recorded("watt_sixbar")
SIXTY = WATT["from_60_degrees"]
TURN = 2 * math.pi


# -- accuracy --------------------------------------------------------------------------------


def test_a_target_that_cannot_be_reached_is_said():
    motion = move(watt(), Start(math.pi / 2), "time=6", "dop853", 1e-15)
    assert not motion.reached
    assert any("accuracy not reached" in note for note in motion.notes)


# -- events and ends -------------------------------------------------------------------------


def test_users_events_are_found_by_integration_and_by_quadrature():
    fast = Watch("fast", lambda t, q, qd: abs(qd) - 8.0)
    by_energy = move(watt(), Start(math.pi / 3), "time=2", "energy", watch=[fast])
    by_steps = move(watt(), Start(math.pi / 3), "event", "dop853", 1e-10, watch=[fast])
    assert by_energy.end == by_steps.end == "fast"
    assert by_energy.t_end == pytest.approx(by_steps.t_end, abs=1e-9)
    assert abs(abs(by_energy.qd_end) - 8.0) <= 1e-12
    noted = replace(fast, terminal=False)
    through = move(watt(), Start(math.pi / 3), "time=2", "energy", watch=[noted])
    assert [e.kind for e in through.events] == ["fast", "fast", "standstill"]


def test_swings_are_counted():
    motion = move(watt(), Start(math.pi / 3), "swings=3", "dop853", 1e-9)
    assert motion.t_end == pytest.approx(3 * SIXTY["time_until_standstill"], abs=1e-8)
    assert [e.kind for e in motion.events] == ["standstill"] * 3


def test_kinks_in_place_do_not_cost_the_order():
    kinked = guided(1.0, lambda q: np.where(q < 0, -q, -4.0 * q), knots=(0.0,))
    motion = move(kinked, Start(1.0), "standstill", "dop853", 1e-9)
    assert abs(motion.t_end - 0.75 * math.pi) <= 1e-9


def test_a_damped_swing_ends_at_rest():
    motion = move(motored(stall=0.0, damper=3.0), Start(-1.2), "swings=500", "dop853", 1e-6)
    assert motion.end == "rest"


# -- several drivers -------------------------------------------------------------------------


def double_pendulum():
    """Two point masses of 1 kg on rods of 1 m, absolute angles from the vertical, g = 1."""

    def terms(q, qd, t):
        a, b = q
        c, s = math.cos(a - b), math.sin(a - b)
        M = np.array([[2.0, c], [c, 1.0]])
        bias = np.array([s * qd[1] ** 2, -s * qd[0] ** 2])
        return Terms(M, bias, np.array([-2 * math.sin(a), -math.sin(b)]), 1.0)

    return Synthetic(terms=terms, k=2)


def test_two_drivers_keep_their_energy_and_agree_with_another_method():
    q0, qd0 = [1.0, -0.5], [0.3, 0.0]
    motion = move(double_pendulum(), (q0, qd0), "time=10", "auto", 1e-9)
    implicit = move(double_pendulum(), (q0, qd0), "time=10", "radau", 1e-6)
    assert motion.method == "dop853"
    assert np.abs(motion.q_end - implicit.q_end).max() <= motion.error + implicit.error

    def energy(q, qd):
        a, b = q.T
        kinetic = qd[:, 0] ** 2 + qd[:, 1] ** 2 / 2 + qd[:, 0] * qd[:, 1] * np.cos(a - b)
        return kinetic - 2 * np.cos(a) - np.cos(b)

    state = motion.at(np.linspace(0, 10, 101))
    assert np.ptp(energy(state.q, state.qd)) <= 1e-9
    assert motion.facts["energy_balance"] <= 1e-10


# -- fixed steps -----------------------------------------------------------------------------


def test_rk4_meets_standstills_and_targets():
    motion = move(watt(), Start(math.pi / 3), "standstill", "rk4", step=1e-3)
    assert abs(motion.t_end - SIXTY["time_until_standstill"]) <= motion.time_error
    timed = move(watt(), Start(math.pi / 3), "time=2", "rk4", 1e-6)
    assert abs(timed.q_end - SIXTY["theta_at_2s"]) <= timed.error <= 1e-6


def test_time_dependent_loads_are_integrated():
    """q'' = cos t from rest: q = 1 - cos t."""

    system = Synthetic(lambda q, qd, t: (1.0, math.cos(t), 0.0, 1.0))
    system = system.but(depends_on=frozenset({"q", "time"}))
    motion = move(system, Start(0.0), "time=7", "auto", 1e-10)
    times = np.linspace(0, 7, 30)
    assert np.abs(motion.at(times).q - (1 - np.cos(times))).max() <= 1e-10


@pytest.mark.parametrize("method", ["dop853", "radau"])
@pytest.mark.parametrize("knot", [0.3, 0.7, 1.0, 1.123248806197458, 2.0])
def test_a_knot_met_at_the_time_asked_ends_the_run_there(method, knot):
    """No leg could follow, or SciPy found no root between ends of steps that both said zero."""
    level = guided(1.0, lambda q: 0 * q, knots=(knot,))
    for rate in (1.0, 2.0, 3.0):
        motion = move(level, Start(0.0, rate), Until("time", knot / rate), method, 1e-6)
        assert (motion.end, motion.t_end) == ("time", knot / rate)
        assert abs(motion.q_end - knot) <= motion.error


def test_between_a_step_and_the_kink_that_cuts_it_the_motion_is_as_exact():
    """Dense output was that of the whole step, which had seen the load beyond: 5e-8."""
    graph = bm.Graph.load(GRAPHS / "motions" / "gas_crank.json").compile()
    request = {"until": "time=0.08", "start": {"crank": (0.0966, 30.3)}}
    steps, exact = (graph.simulate(method=bm.FixedStep(m, h), **request).motion
                    for m, h in (("rk4", 4e-4), ("energy", None)))  # fmt: skip
    times = steps.times(800)
    assert np.abs(steps.at(times).q - exact.at(times).q).max() <= steps.error < 2e-8


@pytest.mark.parametrize("loads", ["rate", "rate and time"])
def test_the_papers_scheme_updates_loads_of_rate_and_time_and_is_of_order_1(loads):
    """[D14] step v; held against ``rk4`` at small steps."""
    shaken = loads == "rate and time"
    system = shaken_motor() if shaken else motored()
    reference = move(system, Start(0.5, 4.0), "time=0.2", "rk4", step=1e-3)
    steps = (4e-3, 2e-3, 1e-3)
    runs = [move(system, Start(0.5, 4.0), "time=0.2", "euler_q", step=h) for h in steps]
    errors = np.abs([run.q_end - reference.q_end for run in runs])
    assert (errors <= [run.error for run in runs]).all()
    assert np.abs(np.log2(errors[:-1] / errors[1:]) - 1).max() < 0.05  # of the next order
    assert errors[-1] > 100 * reference.error


def shaken_motor():
    """(J q'^2 / 2)' = (6 - q' + 2 sin 5 t) q' with an inertia J(q)."""

    def one(q, qd, t):
        return 1.0 + 0.3 * math.cos(q), 6.0 - qd + 2 * math.sin(5 * t), -0.3 * math.sin(q), 1.0

    return Synthetic(one, depends_on=frozenset({"q", "rate", "time"}))


def test_the_papers_scheme_ends_after_as_many_steps_as_it_says(monkeypatch):
    monkeypatch.setattr(integrators, "EVALUATIONS", 2000)
    motion = move(motored(), Start(0.5, 4.0), "time=1e9", "euler_q", step=1e-3)
    assert (motion.status, motion.end) == ("failed", "more evaluations than allowed")
    assert 1990 <= (motion.q_end - 0.5) / 1e-3 <= 2000


@pytest.mark.parametrize(("method", "step"), [("euler_q", 0.5), ("rk4", 0.5)])
def test_a_run_shorter_than_its_step_tells_its_error(method, step):
    graph = bm.Graph.load(GRAPHS / "watt_sixbar.json").compile()
    start = {"crank": (1.0471975511965976, 0.0)}
    runs = [graph.simulate("time=0.1", start=start, method=bm.FixedStep(m, h)).motion
            for m, h in ((method, step), ("energy", None))]  # fmt: skip
    assert abs(runs[0].q_end - runs[1].q_end) <= runs[0].error < math.inf


def test_an_event_that_stops_being_a_number_inside_a_step_is_where_it_does():
    def value(t):
        return -1.0 if t < 0.25 else math.nan if t < 0.75 else 1.0

    (crossing,) = crossings(1, np.array([0.0, 1.0]), [-1.0, 1.0], value)
    assert crossing == pytest.approx(0.25, rel=1e-14)


def test_where_a_coarse_scheme_gives_up_the_one_that_goes_on_is_bounded():
    """Steps of 10 ms leave Andrews' squeezer at 1e13 rad/s."""
    squeezer = bm.read(GRAPHS / "andrews_squeezer.json").compile()
    motion = squeezer.simulate("time=0.2", method=bm.FixedStep("rk4", 0.01)).motion
    assert (motion.status, motion.end) == ("failed", "more evaluations than allowed")
    assert motion.cost.evaluations < 1.1 * EVALUATIONS
