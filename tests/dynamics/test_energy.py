"""Method ``energy``: quadrature against exact motions, in all regimes."""

from __future__ import annotations

import math
from types import SimpleNamespace

import mpmath as mp
import numpy as np
import pytest

from blockmech.dynamics.request import Start
from tests.dynamics import exact
from tests.dynamics.linkages import FourBar, fourbar, guided, pendulum, watt
from tests.dynamics.synthetic import Synthetic, move
from tests.wiring import recorded

WATT = recorded("watt_sixbar")
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
TURN = 2 * math.pi


def run(system, q, until, rate=0.0, accuracy=1e-12, **options):
    return move(system, Start(q, rate), until, "energy", accuracy, **options)


def truth(system, q, rate, times):
    """An independent integration, to about 1e-12."""
    from scipy.integrate import solve_ivp

    def right(t, y):
        J, tau, dJ, *_ = system.scalar_terms(y[0], y[1], t)
        return [y[1], (tau - dJ * y[1] ** 2 / 2) / J]

    solution = solve_ivp(
        right, (0, times[-1]), [q, rate], "DOP853", t_eval=times, rtol=2.3e-14, atol=1e-15
    )
    return solution.y


# -- the pendulum, exactly -------------------------------------------------------------------

PENDULA = [
    (1.0, 0.0, 40.0),
    (2.9, 0.0, 100.0),
    (-0.3, 1.2, 25.0),
    (0.5, -1.9, 60.0),
    (0.0, 2.5, 30.0),
    (1.0, -3.0, 200.0),
    (1e-5, 0.0, 30.0),
    (math.pi - 1e-2, 0.0, 33.0),
    (math.pi - 1e-4, 0.0, 33.0),
    (math.pi - 1e-6, 0.0, 33.0),
    (0.0, 2.0001, 33.0),
    (0.0, 1.99999999, 33.0),
]


@pytest.mark.parametrize(("q", "rate", "t"), PENDULA)
def test_pendulum_is_exact_and_its_estimate_honest(q, rate, t):
    motion = run(pendulum(), q, f"time={t!r}", rate)
    angle, speed = exact.pendulum(q, rate, t)
    error = abs(float(angle - mp.mpf(motion.q_end)))
    assert error <= motion.error
    if (q, rate, t) in PENDULA[:7]:  # away from separatrices
        assert error <= 1e-15 * max(20.0, t, abs(motion.q_end))
        assert motion.error <= 1e-11
    assert abs(float(speed - mp.mpf(motion.qd_end))) <= 2 * motion.error + 1e-13


def test_period_of_a_swing():
    motion = run(pendulum(), 2.0, "steady")
    assert abs(motion.t_end - float(exact.pendulum_period(2.0))) <= 1e-14 * motion.t_end
    assert motion.facts["period"] == motion.t_end


def test_one_ulp_from_the_separatrix_it_says_that_the_data_do_not_decide():
    motion = run(pendulum(), 0.0, "time=50", 2.0)
    assert motion.status == "failed"
    assert motion.end == "not decided"
    assert any("part after t =" in note for note in motion.notes)


def test_samples_that_are_all_standstills_do_not_hide_how_late_a_motion_is():
    """128 swings: samples at equal times saw no speed, and so no error."""
    even, odd = (run(pendulum(), 1.0, f"swings={n}") for n in (128, 127))
    assert even.error >= odd.error / 2


# -- regimes ---------------------------------------------------------------------------------


def test_regimes_are_named():
    cases = {
        "to a standstill": run(pendulum(), 1.0, "standstill"),
        "libration": run(pendulum(), 1.0, "time=9"),
        "rotation": run(pendulum(), 1.0, "time=9", 3.0),
        "run-up": run(pendulum(couple=1.5), 0.0, "time=9"),
        "run-down": run(pendulum(couple=-0.2), 0.0, "time=9", 6.0),
        "one way": run(pendulum(), 1.0, "time=1"),
        "rest": run(pendulum(), 0.0, "time=1"),
        "end stop": run(pendulum(stops=(-0.5, 2.0)), 1.0, "time=9"),
        "dead centre": run(fourbar(), 0.3, "time=9"),
    }
    assert {name: motion.regime for name, motion in cases.items()} == {n: n for n in cases}


@pytest.mark.parametrize("rate", [6.0, 40.0])
def test_braking_runs_back_the_way_it_came(rate):
    system = pendulum(couple=-0.3)
    stop = run(system, 0.0, "standstill", rate)
    back = run(system, 0.0, f"time={2 * stop.t_end!r}", rate)
    assert abs(back.q_end) <= 1e-9
    assert abs(back.qd_end + rate) <= 1e-9
    assert stop.q_end > TURN


def test_a_hundred_thousand_turns_cost_what_one_turn_costs():
    result = run(pendulum(), 0.0, "turns=1", 3.0)
    many = run(pendulum(), 0.0, "turns=100000", 3.0)
    assert many.cost.evaluations <= 3 * result.cost.evaluations  # one more pair of runs judges it
    assert abs(many.t_end / result.t_end / 1e5 - 1) <= 1e-15
    with mp.workdps(30):
        turn = 4 / mp.mpf(3) * mp.ellipk(mp.mpf(4) / 9)
    assert abs(many.at(float(5e4 * turn)).q - 5e4 * TURN) <= 1e-9


def test_a_run_up_over_a_thousand_turns_keeps_its_energy():
    system = pendulum(couple=0.5)
    motion = run(system, 0.3, "turns=1000", 4.0)
    gained = 0.5 * TURN * 1000
    assert abs(motion.qd_end**2 / 2 - 8.0 - gained) <= 1e-11 * gained
    assert motion.cost.evaluations <= 800  # four runs, a turn and what begins the next each


def test_end_stop_ends_the_run_with_its_name():
    motion = run(pendulum(stops=(-0.5, 2.0)), 1.0, "time=5")
    assert (motion.status, motion.end) == ("ended", "end stop")
    with mp.workdps(30):
        k = mp.sin(mp.mpf(0.5))
        reached = mp.ellipk(k**2) + mp.ellipf(mp.asin(mp.sin(mp.mpf(0.25)) / k), k**2)
    assert abs(motion.t_end - float(reached)) <= 1e-14
    assert motion.events[-1].kind == "end stop"


def test_dead_centre_is_reached_in_the_exact_time():
    bar = FourBar()
    precise = SimpleNamespace(expi=mp.expj, sqrt=mp.sqrt, hyp=abs, low=min)
    with mp.workdps(30):
        outer = mp.mpf(bar.coupler) + mp.mpf(bar.rocker)
        base, q0 = mp.mpf(bar.base), mp.mpf(0.3)
        stop = -mp.acos((1 + base**2 - outer**2) / (2 * base))
        start = bar.potential(precise, q0)

        def slowness(q):
            J = bar(precise, q, False)[0]
            return mp.sqrt(J / (2 * (start - bar.potential(precise, q))))

        exact_time = float(abs(mp.quad(slowness, [q0, -0.6, stop])))
    motion = run(fourbar(), 0.3, "time=5", accuracy=1e-9)
    assert motion.end == "dead centre"
    assert abs(motion.q_end - float(stop)) <= 1e-15
    assert abs(motion.t_end - exact_time) <= min(motion.time_error, 5e-12)
    assert motion.qd_end == pytest.approx(0.0, abs=1e-12)


# -- drivers without a period ----------------------------------------------------------------


def test_free_fall_and_spring_on_a_guide():
    fall = guided(2.0, lambda q: 3.0 + 0 * q)
    assert run(fall, 0.0, "time=100").q_end == pytest.approx(7500, abs=1e-9)
    assert run(fall, 0.0, "time=10", -20.0).q_end == pytest.approx(-125, abs=1e-11)
    assert run(fall, 0.0, "standstill", -3.0).t_end == pytest.approx(2.0, abs=1e-14)
    assert run(guided(2.0, lambda q: 0 * q), 0.0, "time=7", -3.0).q_end == pytest.approx(-21)
    spring = guided(1.0, lambda q: -q)
    for amplitude in (1e-3, 1.0, 1e4):
        ratio = run(spring, amplitude, "time=10").q_end / amplitude
        assert abs(ratio - math.cos(10)) <= 1e-12


@pytest.mark.parametrize("knots", [(0.0,), ()])
def test_a_kink_in_a_load_costs_no_accuracy(knots):
    kinked = guided(1.0, lambda q: np.where(q < 0, -q, -4.0 * q), knots=knots)
    motion = run(kinked, 1.0, "standstill")
    assert abs(motion.t_end - 0.75 * math.pi) <= 1e-14
    assert abs(motion.q_end + 2) <= 1e-14


def test_a_torsion_spring_on_the_crank_has_no_period():
    base = pendulum()

    def one(q, qd, t):
        J, tau, dJ, margin, _ = base.scalar_terms(q, qd, t)
        return J, tau - 0.05 * q, dJ, margin

    system = Synthetic(one, period=None)
    times = np.linspace(1, 30, 12)
    motion = run(system, 0.0, "time=30", 4.0)
    assert np.abs(motion.at(times).q - truth(system, 0.0, 4.0, times)[0]).max() <= 1e-10
    assert motion.regime == "libration"


# -- what is asked for -----------------------------------------------------------------------


def test_goals_of_a_swinging_pendulum():
    period = float(exact.pendulum_period(1.0))
    assert run(pendulum(), 1.0, "swings=3").t_end == pytest.approx(1.5 * period, rel=1e-15)
    assert run(pendulum(), 1.0, "angle=0").t_end == pytest.approx(period / 4, rel=1e-14)
    third = run(pendulum(), 1.0, "angle=-0.5")
    assert abs(float(exact.pendulum(1.0, 0.0, third.t_end)[0]) + 0.5) <= 1e-14
    never = run(pendulum(), 1.0, "turns=1")
    assert (never.status, never.end) == ("ended", "never reached: libration")
    assert run(pendulum(), 0.0, "angle=-1", 1.5).q_end == -1.0


def test_dense_output_at_many_and_at_single_times_agree():
    motion = run(watt(), math.pi / 3, "time=7")
    times = motion.times(301)
    many = motion.at(times)
    single = np.array([[float(x) for x in motion.at(float(t))] for t in times])
    assert np.abs(many.q - single[:, 0]).max() <= 1e-14
    assert np.abs(many.qd - single[:, 1]).max() <= 1e-12
    assert np.isnan(motion.at(7.1).q)


def test_time_starts_where_the_start_says():
    early = move(pendulum(), Start(1.0, 0.0, 0.0), "time=3", "energy")
    late = move(pendulum(), Start(1.0, 0.0, 100.0), "time=3", "energy")
    assert late.t_end == 103.0
    assert late.at(102.0).q == pytest.approx(early.at(2.0).q, abs=1e-13)
