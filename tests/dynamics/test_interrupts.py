"""A run that is stopped keeps what was done, by any method; a long one tells how far it is."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from blockmech.cli import terminal
from blockmech.dynamics import time as integrators
from tests.gallery import GRAPHS, mechanism

ENERGY, PANELS = 1e-12, 1e-9  # [rad] of the methods that judge themselves as they go
COARSE = 1e-2  # [rad] of an integration at its first tolerance
LONG = 50.0  # [s] of the six-bar


class Stopping:
    """Progress that stops the run when it is told for the n-th time, and every time after."""

    def __init__(self, n, what=""):
        self.n, self.what, self.told = n, what, []

    def __call__(self, what, done, whole):
        self.told.append((what, done, whole))
        if sum(self.what in w for w, _, _ in self.told) >= self.n:
            raise KeyboardInterrupt


CASES = [
    ("watt_sixbar", "dop853", 5, {}, COARSE),
    ("watt_sixbar", "lsoda", 5, {}, COARSE),
    ("watt_sixbar", "lsoda", 3, {"stops": {"crank": (-9.0, 9.0)}}, COARSE),
    ("watt_sixbar", "radau", 5, {}, COARSE),
    ("watt_sixbar", "rk4", 3, {"step": 1e-3}, COARSE),
    ("pump", "spectral", 20, {}, PANELS),
    ("engine", "dop853", 5, {}, COARSE),
]


@pytest.mark.parametrize(("name", "method", "n", "more", "tolerance"), CASES)
def test_one_driver_keeps_the_motion_as_far_as_it_came(name, method, n, more, tolerance):
    stop = Stopping(n, {"spectral": "moving"}.get(method, method))
    r = mechanism(name).simulate(f"time={LONG}", method=method, progress=stop, **more)
    assert (r.motion.status, r.motion.end) == ("ended", "interrupted")
    assert 0 < r.motion.t_end < LONG
    assert r.time[-1] == r.motion.t_end
    assert np.isfinite(r["crank.q"]).all()
    early = r.time < 0.5
    wanted = mechanism(name).simulate(times=r.time[early])["crank.q"]
    assert np.abs(r["crank.q"][early] - wanted).max() < tolerance


def test_euler_q_keeps_its_steps():
    stop = Stopping(6000, "euler_q")
    r = mechanism("watt_sixbar").simulate("swings=99", method="euler_q", step=4e-4, progress=stop)
    assert r.motion.end == "interrupted"
    early = r.time < 0.5
    wanted = mechanism("watt_sixbar").simulate(times=r.time[early])["crank.q"]
    assert np.abs(r["crank.q"][early] - wanted).max() < COARSE
    assert r.motion.t_end > 0.5


@pytest.mark.parametrize("method", ["dop853", "lsoda", "radau"])
def test_several_drivers_keep_the_motion_as_far_as_it_came(method):
    falling = mechanism("fivebar_falling")
    r = falling.simulate("time=0.6", method=method, accuracy=1e-11, progress=Stopping(1, method))
    assert (r.motion.status, r.motion.end) == ("ended", "interrupted")
    assert 0 < r.motion.t_end <= 0.6
    wanted = falling.simulate(times=r.time)
    for name in ("left.q", "right.q"):
        assert np.abs(r[name] - wanted[name]).max() < COARSE


def test_a_whole_run_is_kept_where_only_a_finer_one_was_at_work():
    stop = Stopping(1, "run 2")
    r = mechanism("fivebar_falling").simulate("time=0.6", accuracy=1e-11, progress=stop)
    assert (r.motion.end, r.motion.t_end) == ("interrupted", 0.6)
    wanted = mechanism("fivebar_falling").simulate(times=r.time, accuracy=1e-10)
    assert np.abs(r["left.q"] - wanted["left.q"]).max() <= r.motion.error + 1e-10
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
        ("watt_sixbar", "time=6", "dop853", 6.0),
        ("engine", "turns=2", "dop853", 2.0),
        ("engine", "angle=10", "dop853", 10 - 0.3),  # from its start
        ("fivebar_falling", "time=0.6", "auto", 0.6),
        ("pump", "time=2", "spectral", 2.0),
    ],
)
def test_progress_tells_how_far_the_goal_is(name, until, method, whole):
    told = []
    mechanism(name).simulate(until, method=method, progress=lambda *said: told.append(said))
    shares = [done / of for _, done, of in told if of is not None]
    (of,) = {of for _, _, of in told} - {None}
    assert of == pytest.approx(whole)
    assert 0 <= min(shares) < 0.3
    assert 0.7 < max(shares) < 1.2


def test_progress_costs_nothing_and_changes_nothing():
    plain = mechanism("watt_sixbar").simulate("time=5", method="dop853").motion
    told = mechanism("watt_sixbar").simulate("time=5", method="dop853", progress=lambda *_: None)
    assert told.motion.q_end == plain.q_end
    assert told.motion.cost == plain.cost


class Console:
    """A terminal for errors, as far as a bar asks."""

    def __init__(self, seen):
        self.seen = seen

    def isatty(self):
        return self.seen


def test_the_command_line_shows_no_bar_in_a_pipe(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Console(False))
    with terminal.progress_bar("simulating") as told:
        assert told is None
    monkeypatch.setattr(sys, "stderr", None)  # closed
    with terminal.progress_bar("simulating") as told:
        assert told is None
    monkeypatch.setattr(sys, "stderr", Console(True))
    with terminal.progress_bar("simulating") as told:
        assert told is not None
        told("dop853", 1.0, 2.0)  # before the bar is there


@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C to a console, not to a process")
def test_ctrl_c_on_the_command_line_prints_what_was_done():
    words = ["simulate", str(GRAPHS / "watt_sixbar.json"), "--until", "time=20"]
    words += ["--method", "rk4", "--step", "5e-5"]  # 400,000 steps: half a minute at least
    code = f"""
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
import blockmech.cli.simulate, blockmech.cli, blockmech.dynamics.simulation
from blockmech.cli import main
print("ready", flush=True)
sys.exit(main({words!r}))
"""
    run = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert run.stdout.readline() == "ready\n"
    time.sleep(2.0)
    run.send_signal(signal.SIGINT)
    said, warned = run.communicate(timeout=60)
    assert run.returncode == 130
    assert "ended: interrupted, after" in said
    assert "201 samples" in said
    assert warned.splitlines() == ["interrupted"]
