"""A run that is stopped keeps what was done, by any method; a long one tells how far it is."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

import blockmech as bm
from blockmech.cli import terminal
from blockmech.dynamics import integration as integrators
from blockmech.dynamics import repetition
from tests.extremes.motions import slider
from tests.gallery import GRAPHS, mechanism
from tests.machines import wire

PANELS = 1e-9  # [rad] of the path method
COARSE = 1e-2  # [rad] of an integration at its first tolerance
LONG = 50.0  # [s] of the six-bar


class Stopping:
    """Progress that stops the run when it is told for the n-th time, and every time after."""

    def __init__(self, n, activity=""):
        self.n, self.activity, self.reports = n, activity, []

    def __call__(self, activity, position, total):
        self.reports.append((activity, position, total))
        if sum(self.activity in x for x, _, _ in self.reports) >= self.n:
            raise KeyboardInterrupt


CASES = [
    ("watt_sixbar", "dop853", 3, {}, COARSE),  # by machine code its first run tells four times
    ("watt_sixbar", "dop853", 3, {"stops": {"crank": (-9.0, 9.0)}}, COARSE),
    ("watt_sixbar", "radau", 5, {}, COARSE),
    ("watt_sixbar", bm.FixedStep("rk4", 1e-3), 3, {}, COARSE),
    ("pump", "dop853", 5, {}, COARSE),
    ("engine", "energy", 20, {}, PANELS),
    ("engine", "dop853", 5, {}, COARSE),
]


@pytest.mark.parametrize(("name", "method", "n", "more", "tolerance"), CASES)
def test_one_driver_keeps_the_motion_as_far_as_it_came(name, method, n, more, tolerance):
    stop = Stopping(n, {"energy": "moving"}.get(method, str(method)))
    r = mechanism(name).simulate(f"time={LONG}", method=method, progress=stop, **more)
    assert (r.motion.status, r.motion.end) == ("ended", "interrupted")
    assert 0 < r.motion.t_end < LONG
    assert r.time[-1] == r.motion.t_end
    assert np.isfinite(r["crank.q"]).all()
    early = r.time < 0.5
    reference = mechanism(name).simulate(times=r.time[early])["crank.q"]
    assert np.abs(r["crank.q"][early] - reference).max() < tolerance


def test_euler_q_keeps_its_steps():
    stop = Stopping(1500, "euler_q")
    r = mechanism("watt_sixbar").simulate(
        "swings=99", method=bm.FixedStep("euler_q", 1.6e-3), progress=stop
    )
    assert r.motion.end == "interrupted"
    early = r.time < 0.5
    reference = mechanism("watt_sixbar").simulate(times=r.time[early])["crank.q"]
    assert np.abs(r["crank.q"][early] - reference).max() < COARSE
    assert r.motion.t_end > 0.5


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_several_drivers_keep_the_motion_as_far_as_it_came(method):
    falling = mechanism("fivebar_falling")
    r = falling.simulate("time=0.6", method=method, accuracy=1e-11, progress=Stopping(1, method))
    assert (r.motion.status, r.motion.end) == ("ended", "interrupted")
    assert 0 < r.motion.t_end <= 0.6
    reference = falling.simulate(times=r.time)
    for name in ("left.q", "right.q"):
        assert np.abs(r[name] - reference[name]).max() < COARSE


def test_a_whole_run_is_kept_where_only_a_finer_one_was_at_work():
    stop = Stopping(1, "run 2")
    r = mechanism("fivebar_falling").simulate("time=0.6", accuracy=1e-11, progress=stop)
    assert (r.motion.end, r.motion.t_end) == ("interrupted", 0.6)
    reference = mechanism("fivebar_falling").simulate(times=r.time, accuracy=1e-10)
    assert np.abs(r["left.q"] - reference["left.q"]).max() <= r.motion.error + 1e-10
    assert any("interrupted" in note for note in r.motion.notes)


def test_what_is_stopped_before_its_first_step_is_its_start():
    r = mechanism("watt_sixbar").simulate("time=2", progress=Stopping(1))
    assert (r.motion.end, r.motion.t_end, r["crank.q"][0]) == ("interrupted", 0.0, 0.0)


def test_too_many_evaluations_lose_nothing_that_was_computed(monkeypatch):
    monkeypatch.setattr(integrators, "EVALUATIONS", 20_000)
    motion = mechanism("watt_sixbar").simulate("time=3000", method="dop853").motion
    assert motion.end == "more evaluations than allowed"
    assert motion.t_end > 5


# -- progress --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "until", "method", "whole"),
    [
        ("watt_sixbar", "time=30", "dop853", 30.0),
        ("engine", "turns=2", "dop853", 2.0),
        ("engine", "angle=10", "dop853", 10 - 0.3),  # from its start
        ("fivebar_falling", "time=0.6", "auto", 0.6),
        ("pump", "time=4", "dop853", 4.0),
    ],
)
def test_progress_tells_how_far_the_goal_is(name, until, method, whole):
    reports = []
    mechanism(name).simulate(until, method=method, progress=lambda *report: reports.append(report))
    shares = [position / of for _, position, of in reports if of is not None]
    (of,) = {of for _, _, of in reports} - {None}
    assert of == pytest.approx(whole)
    assert 0 <= min(shares) < 0.3
    assert 0.7 < max(shares) < 1.2


def test_a_motion_that_repeats_is_answered_however_long_it_is():
    once = mechanism("watt_sixbar").simulate("swings=3").motion
    long = mechanism("watt_sixbar").simulate("time=1e9").motion
    period = once.facts["period"]
    assert (long.end, long.t_end, long.reached) == ("time", 1e9, True)
    assert 1e-9 < long.error < 1e-3  # rounding of a period, as often as it goes on
    late = long.at(1e9).q - once.at(1e9 % period).q
    assert abs(late) <= long.error + 1e9 / period * once.at(once.times(99)).qd.max() * 1e-15
    assert len(long.events) <= repetition.AT_ONCE + 1
    assert long.events[-1].t == pytest.approx(1e9, abs=period / 2)
    assert any("standstills" in note for note in long.notes)


def test_turns_that_gain_energy_end_by_name_and_tell_how_far_they_are(monkeypatch):
    monkeypatch.setattr(repetition, "MOST_TURNS", 5 * repetition.AT_ONCE)
    reports = []
    collect = lambda *report: reports.append(report)  # noqa: E731
    motion = mechanism("engine").simulate("time=1e9", progress=collect)
    motion = motion.motion
    assert (motion.status, motion.end) == ("failed", "more evaluations than allowed")
    assert any("turns reach no further" in note for note in motion.notes)
    times = [t for activity, t, total in reports if (activity, total) == ("moving", 1e9)]
    assert times == sorted(times)
    assert sum(t > 1 for t in times) >= 5
    assert abs(motion.qd_end) > 10 * abs(motion.at(1.0).qd)


def test_swings_that_take_work_each_are_given_up_early_where_their_goal_is_too_far():
    g = slider()
    g.add("spring", bm.Spring(stiffness=1e12, free_length=0.0, damping=2.0))
    wire(g, "frame.W spring.a", "slider.slider spring.b")
    motion = g.compile().simulate("time=1", start={"slider": (1.0, 0.0)}, accuracy=1e-10).motion
    assert (motion.status, motion.end) == ("failed", "more evaluations than allowed")
    assert motion.cost.evaluations < 100_000  # of 500,000 that each run of each method is allowed
    assert any("steady" in note for note in motion.notes)
    exact = (np.cos(100.0) + 1e-6 * np.sin(100.0)) * np.exp(-1e-4)
    assert motion.at(1e-4).q == pytest.approx(exact, abs=1e-9)


def test_progress_costs_nothing_and_changes_nothing():
    mechanism("watt_sixbar").simulate("time=5", method="dop853")  # what is kept of a mechanism
    plain = mechanism("watt_sixbar").simulate("time=5", method="dop853").motion
    watched = mechanism("watt_sixbar").simulate("time=5", method="dop853", progress=lambda *_: None)
    assert watched.motion.q_end == plain.q_end
    assert watched.motion.cost == plain.cost


class Console:
    """A terminal for errors, as far as a bar asks."""

    def __init__(self, is_terminal):
        self.is_terminal = is_terminal

    def isatty(self):
        return self.is_terminal


def test_the_command_line_shows_no_bar_in_a_pipe(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Console(False))
    with terminal.progress_bar("simulating") as callback:
        assert callback is None
    monkeypatch.setattr(sys, "stderr", None)  # closed
    with terminal.progress_bar("simulating") as callback:
        assert callback is None
    monkeypatch.setattr(sys, "stderr", Console(True))
    with terminal.progress_bar("simulating") as callback:
        assert callback is not None
        callback("dop853", 1.0, 2.0)  # before the bar is there


@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C to a console, not to a process")
def test_ctrl_c_on_the_command_line_prints_what_was_done():
    arguments = ["simulate", str(GRAPHS / "watt_sixbar.json"), "--until", "time=20"]
    arguments += ["--method", "rk4", "--step", "5e-5", "--engine", "scalar"]  # half a minute
    code = f"""
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
signal.signal(signal.SIGVTALRM, lambda *_: signal.raise_signal(signal.SIGINT))
import blockmech.cli.simulate, blockmech.cli, blockmech.dynamics.simulation
from blockmech.cli import main
signal.setitimer(signal.ITIMER_VIRTUAL, 1.5)  # of processor time: the same on a busy machine
sys.exit(main({arguments!r}))
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert run.returncode == 130
    assert "ended: interrupted, after" in run.stdout
    assert "201 samples" in run.stdout
    assert run.stderr.splitlines() == ["interrupted"]


def test_a_path_whose_second_run_is_stopped_is_not_judged():
    watt, request = mechanism("watt_sixbar"), {"until": "angle=-3", "method": "energy"}
    complete = Stopping(10**9)
    watt.simulate(**request, progress=complete)
    last = Stopping(sum(activity == "moving" for activity, _, _ in complete.reports), "moving")
    motion = watt.simulate(**request, progress=last).motion
    assert motion.end == "interrupted"
    assert motion.error == motion.time_error == np.inf
