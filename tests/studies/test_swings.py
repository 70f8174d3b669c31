"""Designs that are moved along the path by machine code move as each by itself does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from blockmech.studies import swings
from blockmech.studies.family import remade
from tests.dynamics.honesty import mechanism

WANT = ["motion.t_end", "motion.q_end", "motion.error", "motion.time_error"]
CASES = [  # mechanism, what is varied, start
    ("watt_sixbar", "crank.links.crank.mass", (math.pi / 3, 0.0)),
    ("watt_sixbar", "crank.links.crank.mass", (-2.0, -3.0)),
    ("slider_crank", "piston.links.j.mass", (0.5, 0.0)),
]


@pytest.fixture
def batches(monkeypatch):
    """How many designs went along the path, of those asked for."""
    pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")
    counts = []
    moved = swings.FirstSwings.moved

    def counted(self, values, m):
        motions = moved(self, values, m)
        counts.append((int((~motions.alone).sum()), m))
        return motions

    monkeypatch.setattr(swings.FirstSwings, "moved", counted)
    return counts


@pytest.mark.parametrize(("name", "address", "start"), CASES)
def test_designs_move_as_each_by_itself(batches, name, address, start):
    mech = mechanism(name)
    start = {mech.drivers[0]: start}
    mass = np.linspace(0.5, 2.0, 16)
    simulate = {"until": "standstill", "start": start, "method": "energy"}
    study = mech.study({address: mass}, want=WANT, friction="none", simulate=simulate)
    assert batches == [(16, 16)]
    for i in (0, 7, 15):
        single = remade(mech, {address: float(mass[i])})
        motion = single.simulate(friction="none", want=[], **simulate).motion
        q, t = study["motion.q_end"][i], study["motion.t_end"][i]
        assert abs(q - motion.q_end) <= study["motion.error"][i] + motion.error
        assert abs(t - motion.t_end) <= study["motion.time_error"][i] + motion.time_error
        assert motion.error / 10 <= study["motion.error"][i] <= 10 * motion.error


def test_what_never_stands_still_is_left_to_others(batches):
    mech = mechanism("watt_sixbar")
    simulate = {"until": "standstill", "start": {"crank": (0.5, 60.0)}, "method": "energy"}
    mass = np.linspace(0.5, 2.0, 16)
    study = mech.study({"crank.links.crank.mass": mass}, want=WANT, simulate=simulate)
    assert batches == [(0, 16)]
    assert set(study.status) == {"ended-early"}


def test_a_named_integrator_is_obeyed(batches):
    mech = mechanism("watt_sixbar")
    simulate = {"until": "standstill", "start": {"crank": (1.0, 0.0)}, "method": "dop853"}
    mass = np.linspace(0.9, 1.1, 16)
    study = mech.study({"crank.links.crank.mass": mass}, want=WANT, simulate=simulate)
    assert batches == []
    assert set(study.status) == {"ok"}
