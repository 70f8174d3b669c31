"""Scotch yoke on a massless crank, moved by a constant force: its motion in closed form.

With J = m r^2 sin^2 q and the effort F r sin q, K = K0 + F r (cos q0 - cos q), and

    dt = sqrt(J / 2K) |dq| = sqrt(m / 2) / F dK / sqrt(K),

so sqrt(K) grows in proportion to time while the force drives, until the crank is in line
with the slide again (q = -pi): the driver has no inertia there, and runs end by that name.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import GRAPHS, changed, document, mechanism

MASS, RADIUS, FORCE = 2.0, 0.1, 100.0  # [kg], [m], [N], as in the graph
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
FINDER = (-3.607395343535843e-07, -0.02674149778375093)  # a start that showed it wrong
STARTS = [
    FINDER,
    *((-(10.0**-n), -rate) for n in (1, 4) for rate in (1e-3, 1.0, 20.0)),
]


def inertia(q):
    return MASS * (RADIUS * math.sin(q)) ** 2


def root_of_energy(q, rate):
    return math.sqrt(inertia(q) / 2) * abs(rate)


def time_to_the_place(q, rate):
    """[s] until q = -pi."""
    first = root_of_energy(q, rate)
    last = math.sqrt(first**2 + 2 * FORCE * RADIUS * math.cos(q / 2) ** 2)
    return math.sqrt(2 * MASS) / FORCE * (last - first)


def exact(q, rate, t):
    """Coordinate [rad] at times (m,) [s]; from half angles, exact beside q = 0 and q = -pi."""
    first = root_of_energy(q, rate)
    gained = t * FORCE / math.sqrt(2 * MASS)
    share = gained * (gained + 2 * first) / (2 * FORCE * RADIUS)  # of sin^2(q/2), what is added
    low = math.sin(q / 2) ** 2 + share
    high = math.cos(q / 2) ** 2 - share
    return -2 * np.arctan2(np.sqrt(low), np.sqrt(np.maximum(high, 0.0)))


@pytest.fixture(scope="module")
def yoke():
    return mechanism("scotch_yoke")


@pytest.mark.parametrize(("q", "rate"), STARTS)
def test_runs_that_end_at_a_place_without_inertia_tell_their_errors(yoke, q, rate):
    end = time_to_the_place(q, rate)
    for target in TARGETS:
        motion = yoke.simulate(
            f"time={2 * end!r}", method="energy", accuracy=target, start={"crank": (q, rate)}
        ).motion
        assert motion.end == "no inertia"
        assert abs(motion.t_end - end) <= motion.time_error
        t = np.minimum(np.linspace(0.0, motion.t_end, 65), end)
        assert np.abs(motion.at(t).q - exact(q, rate, t)).max() <= motion.error < 1e-3


@pytest.mark.parametrize("q", [0.3, 4.3184])
def test_outputs_up_to_the_place_are_verified(yoke, q):
    """Accelerations grow without bound there, and so does what rounding leaves the idle drive."""
    start = {"crank": (q, 0.0)}
    motion = yoke.simulate("time=0.4", start=start, want=()).motion
    assert motion.end == "no inertia"
    ends = yoke.simulate("time=0.4", start=start, times=[0.0, motion.t_end], want="*")
    report = yoke.verify(ends)
    assert report.ok, report


@pytest.mark.parametrize("share", [0.1, 0.999, 1 - 1e-9])
@pytest.mark.parametrize("method", ["energy", "dop853", "radau"])
def test_runs_that_stop_before_it_are_honest_too(yoke, method, share):
    q, rate = -0.02, -1.0
    span = share * time_to_the_place(q, rate)
    for target in (1e-3, 1e-4 if method == "radau" else 1e-7):  # of order 5: a minute to 1e-9
        motion = yoke.simulate(
            f"time={span!r}", method=method, accuracy=target, start={"crank": (q, rate)}
        ).motion
        if motion.end == "no inertia":  # within the error of the time
            assert span - motion.t_end <= motion.time_error
        t = np.linspace(0.0, motion.t_end, 65)
        assert np.abs(motion.at(t).q - exact(q, rate, t)).max() <= motion.error


@pytest.mark.parametrize("method", ["radau"])
def test_a_long_step_does_not_pass_the_whole_place(method):
    """A motor brings the yoke there at its own speed; LSODA's steps were wider than the place."""
    data = document("scotch_yoke")
    data["blocks"]["motor"] = {
        "type": "load.motor",
        "law": {"kind": "dc", "stall_moment": 15.2, "no_load_speed": 21.8},
    }
    data["wires"] += [
        {"from": "frame.O", "to": "motor.a"},
        {"from": "crank.crank", "to": "motor.b"},
    ]
    driven = changed(data)
    ends = []
    for target in (1e-3, 1e-6):
        motion = driven.simulate(
            "time=0.057", method=method, accuracy=target, start={"crank": (1.86, 33.85)}
        ).motion
        assert motion.end == "no inertia"
        assert motion.error < 10 * target
        ends.append(motion)
    assert abs(ends[0].t_end - ends[1].t_end) <= ends[0].time_error + ends[1].time_error


def test_steps_of_the_coordinate_stop_before_it_whatever_lies_behind_the_start(yoke):
    """Another such place just behind the start was taken for the only one."""
    start = {"crank": (-0.0136, 0.0)}
    motion = yoke.simulate("time=0.2", method=bm.FixedStep("euler_q", 1e-2), start=start).motion
    assert motion.end == "no inertia"
    assert abs(motion.q_end + math.pi) <= 1e-2
    t = np.linspace(0.0, motion.t_end, 65)
    assert np.abs(motion.at(t).q - exact(-0.0136, 0.0, t)).max() <= motion.error < math.inf
    assert abs(motion.t_end - time_to_the_place(-0.0136, 0.0)) <= motion.time_error


@pytest.mark.parametrize("coefficient", [0.0, 0.1])
@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_freedoms_that_move_no_mass_together_end_at_the_start(coefficient, rate):
    """One point mass on three arms: three drivers, each of which moves it, and two ways to go."""
    angles, at, links, joints = (0.3, 0.9, 1.7), 0j, {}, {}
    friction = {"law": "coulomb", "coefficient": coefficient, "radius": 0.01}
    for before, name, angle in zip(("frame", "a", "b"), "abc", angles, strict=True):
        links[name] = {"pose": [at.real, at.imag, angle]}
        end = [0.0 if before == "frame" else 1.0, 0.0]
        joints[name.upper()] = {"type": "R", "links": [before, name], "at": [end, [0.0, 0.0]]}
        if coefficient:
            joints[name.upper()]["friction"] = friction
        at += cmath.rect(1.0, angle)
    links["c"] |= {"mass": 1.0, "cm": [1.0, 0.0]}
    drivers = {name: {"joint": name.upper()} for name in "abc"}
    data = {"format": "blockmech/joints", "version": 1, "name": "arms", "links": links}
    arms = bm.Linkage.from_data(data | {"joints": joints, "drivers": drivers}).compile()
    start = {"a": (0.3, 0.0), "b": (0.6, rate), "c": (0.8, 0.0)}
    motion = arms.simulate("time=0.1", start=start).motion
    assert (motion.status, motion.end) == ("failed", "no inertia")
    one = arms.simulate("time=0.1", start=start, roles={"a": "locked"}).motion
    assert one.status == "reached"


@pytest.mark.parametrize("method", ["auto", "energy"])
def test_a_cam_in_its_dwell_has_no_inertia_from_there_on(method):
    """The follower falls freely, F/m = -200 m/s2, until the profile's rise ends.

    Beyond it nothing tells how fast the cam turns: the end is named, not an error of a division.
    """
    cam = bm.read(GRAPHS / "exercises" / "ch08_cycloidal_cam.json").compile()
    start = cam.run(at=3.3, rates=1.0, want=["driver.lift.q", "driver.lift.rate"])
    height, rate = start["driver.lift.q"][0] - 0.05, -start["driver.lift.rate"][0]
    fall = (math.sqrt(rate**2 + 400 * height) - rate) / 200
    motion = cam.simulate("time=1", start={"motor": (3.3, 1.0)}, method=method).motion
    assert motion.end == "no inertia"
    assert motion.t_end == pytest.approx(fall, abs=1e-9)
