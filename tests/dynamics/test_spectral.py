"""Method ``spectral`` against integration and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from blockmech.dynamics.request import Start
from tests.dynamics.linkages import motored
from tests.dynamics.synthetic import Synthetic, move

TURN = 2 * math.pi


def damped_wheel(inertia=2.0, couple=3.0, damper=0.5):
    """J q'' = M - b q': the closed form is exponential."""

    def one(q, qd, t):
        return inertia, couple - damper * qd, 0.0, 1.0

    return Synthetic(one, depends_on=frozenset({"q", "rate"}))


@pytest.mark.parametrize("rate", [0.0, 1.0, 20.0])
def test_damped_wheel_is_exact(rate):
    motion = move(damped_wheel(), Start(0.0, rate), "time=9", "spectral", 1e-11)
    t, tau, final = np.linspace(0.1, 9, 20), 4.0, 6.0
    fading = np.exp(-t / tau)
    place = final * t + (rate - final) * tau * (1 - fading)
    state = motion.at(t)
    assert np.abs(state.q - place).max() <= min(1e-11, motion.error)
    assert np.abs(state.qd - (final + (rate - final) * fading)).max() <= 1e-11


def test_motor_spring_and_damper_against_integration():
    motion = move(motored(), Start(0.5), "time=1", "auto", 1e-9)
    other = move(motored(), Start(0.5), "time=1", "dop853", 1e-11)
    times = np.linspace(0.1, 1, 15)
    difference = np.abs(motion.at(times).q - other.at(times).q).max()
    assert motion.method == "spectral"
    assert difference <= motion.error + other.error
    assert motion.error <= motion.accuracy


def test_turns_and_angles_are_met_exactly():
    motion = move(motored(), Start(0.5), "turns=2", "spectral", 1e-9)
    assert motion.q_end == pytest.approx(0.5 + 2 * TURN, abs=1e-12)
    other = move(motored(), Start(0.5), "turns=2", "dop853", 1e-11)
    assert abs(motion.t_end - other.t_end) <= 1e-10


def test_a_driver_that_swings_to_rest_is_followed_through_its_standstills():
    system = motored(stall=0.0, damper=0.5)
    motion = move(system, Start(1.0), "time=6", "spectral", 1e-8)
    other = move(system, Start(1.0), "time=6", "dop853", 1e-9)
    assert sum(e.kind == "standstill" for e in motion.events) >= 2
    assert abs(motion.q_end - other.q_end) <= motion.error + other.error
