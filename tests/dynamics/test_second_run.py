"""The second run says of a motion what a run with panels of its own says."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics import ends
from blockmech.dynamics.compiled_path import PathCode
from blockmech.dynamics.estimate import difference
from blockmech.dynamics.panel_nodes import (
    BEGIN,
    COARSE,
    END,
    ENERGY,
    FINE,
    GAINS,
    KIND,
    PANEL,
    PLAIN,
    SPAN,
    TAU,
    TO_REST,
    J,
    rule,
)
from blockmech.dynamics.panels import Panels
from blockmech.dynamics.path import PathRun
from blockmech.dynamics.request import SimulationRequest, Start, Until
from blockmech.dynamics.system import System
from blockmech.dynamics.track import apart, second_run
from tests.dynamics.honesty import GRAPHS, mechanism

RUNS = [  # name, start, end; the third from rest through 80 swings
    ("watt_sixbar", Start(math.pi / 3), Until("time", 2.0)),
    ("andrews_squeezer", Start(-0.0617138900142764496358948458001), Until("time", 0.03)),
    ("watt_sixbar", Start(0.7), Until("swings", 81.0)),
    ("watt_sixbar", Start(1.0, 40.0), Until("turns", 12.5)),
    ("geared_fivebar", Start(1.0, 5.0), Until("time", 0.5)),
    ("engine", Start(0.0, 60.0), Until("time", 0.3)),
]


LOOPS = PathCode.interpreted()


def ended(system: System, request: SimulationRequest, n: int = FINE, **options: object) -> PathRun:
    run = PathRun(system, request, n, PathCode.interpreted(n), **options)
    run.run()
    return run


@pytest.mark.parametrize(("name", "start", "until"), RUNS)
def test_it_differs_as_much_as_a_run_of_its_own(name, start, until):
    system = System(mechanism(name))
    request = SimulationRequest(start, until, method="energy")
    fine, perturbed = ended(system, request), ended(system, request, COARSE, perturbed=True)
    motion = fine.motion()
    by = apart(LOOPS, fine.all_legs, second_run(fine.all_legs), 0.0, motion.t_end, 0.0)
    usual = difference(perturbed.motion(), motion, system.rotary)
    assert usual.agree
    assert usual.q / 10 <= by.q <= 10 * usual.q
    assert by.t >= motion.t_end * (1 - 1e-12)


def test_a_motion_that_hardly_gets_over_the_top_has_nothing_beside_it_that_does():
    pendulum = bm.Graph.load(GRAPHS / "motions" / "pin_pendulum.json").compile()
    system, low, high = System(pendulum), 0.1, 100.0
    for _ in range(60):
        rate = (low + high) / 2
        run = ended(system, SimulationRequest(Start(0.0, rate), Until("turns", 1.0)))
        low, high = (low, rate) if run.end == "turns" else (rate, high)
    motion = pendulum.simulate(
        "turns=1", start={"crank": (0.0, high)}, want=[], friction="none"
    ).motion
    assert motion.end == ends.UNDECIDED
    motion = pendulum.simulate(
        "turns=1", start={"crank": (0.0, high * (1 + 1e-9))}, want=[], friction="none"
    ).motion
    assert motion.reached
    assert motion.time_error > 1e-8 * motion.t_end


@pytest.mark.parametrize(("begin", "end"), [(0.7, 2.0), (2.0, 0.7)])
@pytest.mark.parametrize("kind", [PLAIN, TO_REST])
def test_late_by_dt_is_ahead_by_the_way_in_dt(begin, end, kind):
    """The same panels later are no other motion, and panels elsewhere are by as much."""
    panels = panel(begin, end, kind)
    same = apart(LOOPS, [panels], [panels.second.started_at(3e-9)], 0.5, 0.5 + panels.t1, 1e-10)
    t = np.linspace(0.0, panels.t1, 2001)
    rates = panels.state(t)[1]
    assert same.q == pytest.approx(3e-9 * np.abs(rates).max(), rel=1e-6)
    assert same.late == pytest.approx(3e-9, rel=1e-6)
    assert (same.low, same.high) == pytest.approx((0.7, 2.0))
    unknown = 1e-10 * (0.5 + t) * np.abs(rates)
    assert same.rounding == pytest.approx(float(unknown.max()), rel=1e-3)
    shifted = panel(begin + 4e-12, end + 4e-12, kind).second
    assert apart(LOOPS, [panels], [shifted], 0.0, panels.t1, 0.0).q == pytest.approx(
        4e-12, rel=1e-3
    )


def panel(begin: float, end: float, kind: int) -> Panels:
    """A single one of a unit inertia whose energy grows by 1 J to its other end, if it stands."""
    records = np.zeros((1, PANEL, 2, FINE + 2))
    records[:, :2, J] = 1.0
    records[0, GAINS] = np.concatenate([[0.0], rule(FINE).v, [1.0]]) * (kind == TO_REST)
    for column, value in ((BEGIN, begin), (END, end), (ENERGY, 2.0), (KIND, kind)):
        records[:, SPAN, :, column] = value
    for run in range(2):
        LOOPS.again(records, 1, run, 0.0)
    return Panels(records)


def test_what_samples_leave_unknown_is_in_the_estimate(monkeypatch):
    """Inertia and effort that are off by 1e-10, here and there, as a general group's may be."""
    sample = System.sample

    def rough(self, q, *state):
        true = sample(self, q, *state)
        off = 1 + 1e-10 * np.sin(1e7 * np.asarray(q))
        return true._replace(J=true.J * off, tau=true.tau / off)

    system = System(mechanism("watt_sixbar"))
    request = SimulationRequest(Start(math.pi / 3), Until("time", 2.0), method="energy")
    fine = ended(system, request)
    exact = fine.motion()
    monkeypatch.setattr(System, "sample", rough)
    monkeypatch.setattr(System, "noise", 1e-10)
    system = System(bm.Graph.load(GRAPHS / "watt_sixbar.json").compile())
    fine = ended(system, request)
    motion = fine.motion()
    by = apart(LOOPS, fine.all_legs, second_run(fine.all_legs), 0.0, motion.t_end, 0.0)
    assert abs(motion.q_end - exact.q_end) <= by.q
    assert 1e-12 <= by.q <= 1e-8


@pytest.mark.parametrize(("name", "start", "until"), RUNS[:2])
def test_both_samplings_say_the_same_of_a_panel(name, start, until):
    system = System(mechanism(name))
    run = ended(system, SimulationRequest(start, until, method="energy"))
    for panels in (leg if isinstance(leg, Panels) else leg.panels for leg in run.all_legs):
        first, second = panels.records[:, 0], panels.records[:, 1]
        np.testing.assert_allclose(second[:, J], first[:, J], rtol=1e-12)
        size = np.abs(first[:, TAU]).max()
        np.testing.assert_allclose(second[:, TAU], first[:, TAU], atol=1e-12 * size)
        assert (first[:, J] != second[:, J]).any()
