"""Figures of a motion: how uneven a rotation is, and what loads give it in each period."""

from __future__ import annotations

import math

import pytest
from scipy.special import ellipk

import blockmech as bm
from tests import machines

MASS, INERTIA, CM, G = 2.0, 0.3, 0.4, 9.81
J = INERTIA + MASS * CM**2  # [kg m2] about the pin
SPEED = 12.0  # [rad/s] at the lowest place
TURN_OVER_FOUR = math.pi / 2  # [rad] the period is 4 K(share) / SPEED
EXACT = 1e-12  # [-] relative: the motion's own error is below 1e-13


def rod(gravity=G, **loads):
    """A rod that turns about a pin, hanging at -90 degrees."""
    graph = machines.crank(1.0, bm.Link(mass=MASS, inertia=INERTIA, cm=(CM, 0.0)), gravity=gravity)
    for name, block in loads.items():
        machines.load(graph, name, block, on="crank.A")
    return graph.compile()


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("turn", [0.0, 0.3, 2.0])
def test_the_fluctuation_of_a_turning_pendulum_is_that_of_elliptic_integrals(turn, sense):
    share = 4 * MASS * G * CM / (J * SPEED**2)
    slowest, mean = SPEED * math.sqrt(1 - share), TURN_OVER_FOUR * SPEED / ellipk(share)
    height = CM * (1 - math.cos(turn))
    rate = sense * math.sqrt(SPEED**2 - 2 * MASS * G * height / J)
    start = {"crank": (-math.pi / 2 + turn, rate)}
    motion = rod().simulate("turns=2", start=start, accuracy=1e-13).motion
    assert motion.regime == "rotation"
    figures = motion.figures()
    assert figures["mean_speed"] == pytest.approx(mean, rel=EXACT)
    assert figures["fluctuation"] == pytest.approx((SPEED - slowest) / mean, rel=EXACT)


def test_the_speed_between_two_times_may_be_asked_for_and_a_swing_does_not_advance():
    motion = rod().simulate("swings=2", start={"crank": (0.0, 0.0)}).motion
    assert motion.fluctuation(0.0, motion.t_end) == math.inf
    first = motion.fluctuation(0.0, motion.t_end / 2)  # from rest through the lowest place to rest
    fastest = math.sqrt(2 * MASS * G * CM / J)
    assert first == pytest.approx(fastest * (motion.t_end / 2) / math.pi, rel=EXACT)
    assert "fluctuation" not in motion.figures()


@pytest.mark.parametrize("sense", [1, -1])
def test_the_work_of_a_period_is_told_in_the_sense_of_the_motion(sense):
    mech = rod(brake=bm.Couple(moment=-0.5))
    motion = mech.simulate("turns=3", start={"crank": (0.1, sense * 30.0)}).motion
    assert motion.regime == ("run-down" if sense > 0 else "run-up")
    assert motion.facts["work_per_period"] == pytest.approx(-sense * math.pi, rel=EXACT)
    assert motion.facts["period_of_loads"] == 2 * math.pi


def test_a_motion_of_one_speed_does_not_fluctuate():
    motion = rod(gravity=0.0).simulate("time=3", start={"crank": (0.0, 5.0)}).motion
    assert motion.figures()["fluctuation"] <= EXACT
