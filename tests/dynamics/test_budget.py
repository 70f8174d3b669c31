"""A request ends when its processor time is spent, says so, and shows its progress before."""

import json
import math

import pytest

import blockmech as bm
from blockmech.dynamics import ends
from tests.doors import graph_of
from tests.dynamics.honesty import GRAPHS


def gallery(name):
    return bm.Graph.load(GRAPHS / f"{name}.json").compile()


@pytest.mark.parametrize(
    ("name", "until", "method"),
    [
        ("pump", "time=1e4", "auto"),
        ("pump", "time=1e4", "radau"),
        ("pump", "time=1e4", "rk4"),
        ("pump", "steady", "auto"),
        ("fivebar_falling", "time=1", "dop853"),
        ("watt_sixbar", "time=2", "energy"),
        ("motions/sticking_slider", "time=1", "auto"),
    ],
)
def test_a_request_ends_when_its_budget_is_spent(name, until, method):
    motion = (
        gallery(name).simulate(until, method=method, engine="scalar", budget=1e-6, want=[]).motion
    )
    assert (motion.status, motion.end) == ("unfinished", "budget")
    assert motion.t_end < 1e4
    assert not math.isfinite(motion.error) or motion.t_end == 0
    assert any("budget=" in note and "--budget" in note for note in motion.notes)


def test_what_is_done_when_the_budget_is_spent_is_kept(monkeypatch):
    """The first ten looks at the clock are in time."""
    looks = iter(range(10_000))
    monkeypatch.setattr(ends.time, "thread_time", lambda: float(next(looks) > 10))
    mech = gallery("pump")
    motion = mech.simulate("time=1", engine="scalar", budget=0.5).motion
    whole = mech.simulate("time=1", accuracy=1e-11, budget=math.inf).motion
    assert motion.end == "budget"
    assert 0 < motion.t_end < 1
    t = motion.times(9)
    assert abs(motion.at(t).q - whole.at(t).q).max() < 1e-6


def test_a_budget_is_spent_once():
    """What is kept of a run is still looked at, which costs time."""
    budget = ends.Budget(-1.0)
    budget.check()  # from now on
    with pytest.raises(ends.BudgetSpent):
        budget.check()
    budget.check()


@pytest.mark.parametrize("budget", [0.0, -1.0, math.nan, "long"])
def test_a_budget_is_a_time(budget):
    with pytest.raises(bm.RequestError, match="budget"):
        gallery("pump").simulate("time=1", budget=budget)


def test_dry_joints_that_lock_in_motion_have_an_answer():
    """No answer in 35 s, and no progress: the steps went to nothing, and a second run crawled."""
    data = json.loads((GRAPHS / "stribeck_slider_crank.json").read_text("utf-8"))
    data["blocks"]["crank"]["length"] = 0.6
    data["blocks"]["ram"]["links"]["i"]["cm"] = [-0.25, 0.01]
    del data["expect"]
    told = []
    mech = graph_of(json.dumps(data)).compile()
    result = mech.simulate("time=0.5", progress=lambda *now: told.append(now), want=[])
    motion = result.motion
    assert f"note: the motion failed after {motion.t_end:.6g} s: {motion.end}" in str(result)
    assert motion.status == "failed"
    assert motion.t_end == pytest.approx(0.417118, abs=1e-6)
    assert len(told) > 20


def test_turns_that_repeat_end_within_the_budget():
    """Gas a million times as strong: a hundred thousand turns gain energy in a millisecond."""
    data = json.loads((GRAPHS / "engine.json").read_text("utf-8"))
    data["blocks"]["gas"]["law"]["values"][1] *= 1e6
    motion = bm.Graph.from_json(json.dumps(data)).compile().simulate("time=0.3", budget=0.5).motion
    assert (motion.end, motion.status) == ("budget", "unfinished")
