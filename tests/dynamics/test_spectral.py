"""Method ``spectral`` against integration and closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics.methods import move
from blockmech.dynamics.system.reduced import ReducedSystem, Sample
from blockmech.dynamics.until import Start
from blockmech.errors import RequestError
from tests.dynamics.linkages import motored

GRAPHS = Path(__file__).resolve().parents[2] / "graphs"

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
    assert motion.method == "dop853"  # of kernels LSODA may take more evaluations
    assert "not declared" in motion.why
    exact = move(motored(), Start(0.5), "time=1", "spectral", 1e-9)
    assert abs(motion.q_end - exact.q_end) <= motion.error


BESIDE = 1.3752169143159671e-07  # [rad] from where the yoke's crank has no inertia


def yoke(method, accuracy, rate):
    """A yoke on a massless crank, beside its dead centre."""
    mech = bm.Graph.load(GRAPHS / "scotch_yoke.json").compile()
    start = {mech.drivers[0]: (BESIDE, rate)}
    return mech.simulate("time=0.06", method=method, accuracy=accuracy, start=start).motion


@pytest.mark.parametrize("accuracy", [1e-3, 1e-7])
def test_a_place_without_inertia_between_the_start_and_the_first_sample_is_seen(accuracy):
    with pytest.raises(RequestError, match="no inertia"):
        yoke("spectral", accuracy, -0.0298)
    assert yoke("spectral", accuracy, 0.0298).end == "time"  # it lies behind


def test_a_looser_target_is_not_dearer_beside_a_place_without_inertia():
    motions = [yoke("auto", accuracy, -0.0298) for accuracy in (1e-3, 1e-6, 1e-9)]
    costs = [motion.cost.evaluations for motion in motions]
    assert costs == sorted(costs)
    assert all(motion.reached for motion in motions)
