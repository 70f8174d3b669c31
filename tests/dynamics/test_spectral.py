"""Method ``spectral`` and the periodic steady state against integration and each other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from blockmech.dynamics.march import march
from blockmech.dynamics.mesh import View
from blockmech.dynamics.methods import move
from blockmech.dynamics.patches import Path
from blockmech.dynamics.reduced import Metered, ReducedSystem, Sample
from blockmech.dynamics.steady import _returned
from blockmech.dynamics.until import Start
from blockmech.errors import RequestError
from tests.dynamics.linkages import motored, pendulum

TURN = 2 * math.pi


def damped_wheel(inertia=2.0, couple=3.0, damper=0.5):
    """J q'' = M - b q': the closed form is exponential."""

    def sample(q, wanted):
        one = np.ones_like(q)
        damping = damper * one if "damping" in wanted else None
        return Sample(inertia * one, couple * one, one, 0 * one, damping)

    def one(q, qd, t):
        return inertia, couple - damper * qd, 0.0, 1.0

    return ReducedSystem(sample, one, depends_on=frozenset({"q", "rate"}), damped=True)


@pytest.mark.parametrize("rate", [0.0, 1.0, 20.0])
def test_damped_wheel_is_exact(rate):
    motion = move(damped_wheel(), Start(0.0, rate), "time=9", "spectral", 1e-11)
    t, tau, final = np.linspace(0.1, 9, 20), 4.0, 6.0
    fading = np.exp(-t / tau)
    place = final * t + (rate - final) * tau * (1 - fading)
    state = motion.at(t)
    assert np.abs(state.q - place).max() <= min(1e-11, motion.error)
    assert np.abs(state.qd - (final + (rate - final) * fading)).max() <= 1e-11


@pytest.mark.parametrize("accuracy", [1e-3, 1e-6, 1e-9])
def test_motor_spring_and_damper_against_integration(accuracy):
    motion = move(motored(), Start(0.5), "time=3", "auto", accuracy)
    other = move(motored(), Start(0.5), "time=3", "dop853", 1e-11)
    times = np.linspace(0.2, 3, 15)
    difference = np.abs(motion.at(times).q - other.at(times).q).max()
    assert motion.method == "spectral"
    assert difference <= motion.error + other.error
    assert motion.error <= accuracy


def test_turns_and_angles_are_met_exactly():
    motion = move(motored(), Start(0.5), "turns=4", "spectral", 1e-9)
    assert motion.q_end == pytest.approx(0.5 + 4 * TURN, abs=1e-12)
    other = move(motored(), Start(0.5), "turns=4", "dop853", 1e-11)
    assert abs(motion.t_end - other.t_end) <= 1e-10


def test_a_looser_target_never_costs_more():
    costs = [
        move(motored(), Start(0.5), "time=3", "spectral", 10.0**-k).cost.evaluations
        for k in range(3, 13)
    ]
    assert costs == sorted(costs)


def test_where_the_driver_stops_auto_hands_over_and_says_so():
    motion = move(motored(stall=0.0, damper=0.5), Start(1.0), "time=6", "auto", 1e-8)
    assert motion.method == "dop853"
    assert "standstill" in motion.why
    with pytest.raises(RequestError, match="standstill"):
        move(motored(stall=0.0, damper=0.5), Start(1.0), "time=6", "spectral", 1e-8)


def test_loads_of_undeclared_dependence_are_left_to_an_integrator():
    hidden = replace(motored(), damped=False, rate_load=None, rate_load_one=None)
    motion = move(hidden, Start(0.5), "time=1", "auto", 1e-6)
    assert motion.method == "lsoda"
    assert "not declared" in motion.why
    exact = move(motored(), Start(0.5), "time=1", "spectral", 1e-9)
    assert abs(motion.q_end - exact.q_end) <= motion.error


# -- the steady state ------------------------------------------------------------------------


def steady(**more):
    return move(motored(), Start(0.5), "steady", "auto", 1e-10, **more)


def test_steady_state_equals_the_long_run():
    motion = steady()
    meter = Metered(motored())
    path = Path(View(meter, 0.5, 1.0), 32, 4)
    with np.errstate(all="ignore"):
        long = march(path, 0.0, 60.0, 1e-13, lambda x, _: x >= 60 * TURN - 1e-6)
    J = meter.one(0.5).J
    assert motion.qd_end == pytest.approx(math.sqrt(2 * long.panels[-1].K_end / J), rel=1e-11)
    assert motion.q_end == 0.5 + TURN
    assert motion.regime == "steady state"


def test_multiplier_is_the_observed_decay():
    meter = Metered(motored())
    path = Path(View(meter, 0.5, 1.0), 32, 4)
    J = meter.one(0.5).J
    K = J * steady().qd_end ** 2 / 2
    with np.errstate(all="ignore"):
        disturbed = march(path, K * (1 + 1e-6), 0.0, 1e-14, lambda x, _: x >= TURN - 1e-9)
    decay = (disturbed.panels[-1].K_end / K - 1) / 1e-6
    assert steady().facts["multiplier"] == pytest.approx(decay, abs=1e-6)


def test_return_map_finds_the_same_motion():
    with np.errstate(all="ignore"):
        other = _returned(View(Metered(motored()), 0.5, 1.0), TURN, 15.0)
    assert other is not None
    assert other.turn.total == pytest.approx(steady().t_end, rel=1e-12)
    assert other.multiplier == pytest.approx(steady().facts["multiplier"], rel=1e-8)


def test_steady_motion_repeats():
    motion = steady()
    later = motion.track.state(np.array([0.1, 0.1 + motion.t_end, 0.1 + 1000 * motion.t_end]))
    assert np.abs(np.diff(later.q) / TURN - [1, 999]).max() <= 1e-9
    assert np.ptp(later.qd) <= 1e-8


def test_a_scene_that_only_slows_down_has_no_steady_state():
    with pytest.raises(RequestError, match="no periodic rotation"):
        move(motored(stall=0.0), Start(0.5, 3.0), "steady")


def test_conservative_scenes_are_periodic_as_they_are():
    assert move(pendulum(), Start(1.0), "steady").method == "energy"
