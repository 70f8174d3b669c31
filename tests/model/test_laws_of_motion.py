"""Laws of motion: rate and acceleration are derivatives, ranges are walked from end to end."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blockmech as bm
from blockmech.ground.errors import BlockmechError
from tests import machines

EPS = float(np.finfo(float).eps)
rates = st.floats(0.1, 20.0)
places = st.floats(-5.0, 5.0)

LAWS = {
    "constant rate": bm.motion.ConstantRate(rate=-3.0, start=1.0, end=-2.0),
    "constant acceleration": bm.motion.RateAcceleration(
        rate=2.0, acceleration=-0.7, start=1.0, end=3.0
    ),
    "harmonic": bm.motion.Harmonic(mean=0.3, amplitude=1.2, frequency=0.8, phase=0.4),
    "cycloidal": bm.motion.Cycloidal(start=0.2, end=-1.4, time=2.0),
    "cubic table": bm.motion.Trajectory(times=[0.0, 0.5, 1.1, 2.0], values=[0.0, 1.0, 0.4, 2.0]),
    "linear table": bm.motion.Trajectory(
        times=[0.0, 0.5, 1.1, 2.0], values=[0.0, 1.0, 0.4, 2.0], interpolation="linear"
    ),
}
EACH = pytest.mark.parametrize("name", LAWS)


@EACH
def test_rate_is_the_derivative_of_the_coordinate_and_acceleration_of_the_rate(name):
    t = np.array([0.13, 0.41, 0.77, 1.3, 1.77])
    h = 1e-5
    _, rate, acceleration = LAWS[name].at_times(t)
    after, before = LAWS[name].at_times(t + h), LAWS[name].at_times(t - h)
    # central differences: h^2 / 6 times a third derivative of at most A w^4 = 770 (harmonic)
    for k, derivative in ((0, rate), (1, acceleration)):
        difference = (after[k] - before[k]) / (2 * h)
        assert np.max(np.abs(difference - derivative)) < 2e-8


@given(start=places, rate=rates, sign=st.sampled_from([-1, 1]), t=st.floats(0.0, 10.0))
def test_constant_rate_by_time_and_by_coordinate_agree(start, rate, sign, t):
    law = bm.motion.ConstantRate(rate=sign * rate, start=start, end=start + sign)
    q, qd, qdd = law.at_times(np.array([t]))
    assert law.times(q)[0] == pytest.approx(t, abs=8 * EPS * (1 + abs(start) + 10 * rate) / rate)
    assert (qd[0], qdd[0]) == (sign * rate, 0.0)


@given(
    start=places,
    rate=st.floats(0.0, 10.0),
    acceleration=rates,
    sign=st.sampled_from([-1, 1]),
    t=st.floats(0.01, 10.0),
)
def test_constant_acceleration_by_time_and_by_coordinate_agree(start, rate, acceleration, sign, t):
    law = bm.motion.RateAcceleration(
        rate=sign * rate, acceleration=sign * acceleration, start=start, end=start + sign
    )
    q, qd, qdd = law.at_times(np.array([t]))
    _, back, same = law.at_coordinates(q)
    # rate^2 is a difference of coordinates: rounding of q counts as EPS (|start| + |q|) a
    slack = 16 * EPS * (abs(start) + abs(q[0])) * acceleration / abs(qd[0])
    assert back[0] == pytest.approx(qd[0], rel=1e-13, abs=slack)
    assert same[0] == qdd[0] == sign * acceleration
    assert law.times(q)[0] == pytest.approx(t, rel=1e-12, abs=slack / acceleration + 1e-13)


def test_braking_law_ends_where_it_stands_still():
    law = bm.motion.RateAcceleration(rate=2.0, acceleration=-1.0, start=0.0, end=2.0)
    _, qd, _ = law.at_coordinates(np.array([0.0, 2.0, 2.1]))
    assert qd[:2].tolist() == [2.0, 0.0]
    assert np.isnan(qd[2])
    assert law.duration() == 2.0
    farther = bm.motion.RateAcceleration(rate=2.0, acceleration=-1.0, start=0.0, end=9.0)
    assert farther.duration() == math.inf


def test_start_from_rest_runs_along_the_acceleration():
    law = bm.motion.RateAcceleration(acceleration=-2.0, start=1.0, end=-3.0)
    assert law.at_coordinates(np.array([0.0]))[1].tolist() == [-2.0]
    assert law.duration() == 2.0


def test_durations():
    assert bm.motion.ConstantRate(rate=4.0, start=1.0, end=3.0).duration() == 0.5
    assert bm.motion.ConstantRate(rate=-4.0, start=3.0, end=1.0).duration() == 0.5
    assert bm.motion.ConstantRate(rate=0.0).duration() == math.inf
    assert bm.motion.Harmonic(amplitude=1.0, frequency=4.0).duration() == 0.25
    assert bm.motion.Cycloidal(start=0.0, end=1.0, time=3.0).duration() == 3.0
    table = bm.motion.Trajectory(times=[1.0, 2.0, 4.0], values=[0.0, 1.0, 0.0])
    assert (table.begin(), table.duration()) == (1.0, 3.0)


def test_range_is_walked_from_end_to_end():
    law = bm.motion.ConstantRate(rate=1.0, start=1.0, end=3.0)
    assert law.coordinates(5).tolist() == [1.0, 1.5, 2.0, 2.5, 3.0]
    assert bm.motion.ConstantRate(rate=1.0, start=2.0, end=2.0).coordinates(5).tolist() == [2.0]
    turn = bm.motion.ConstantRate(rate=1.0)
    assert (turn.start, turn.end) == (0.0, 2 * math.pi)


def test_time_runs_forward_at_a_negative_rate():
    # the range is travelled from its upper end
    law = bm.motion.ConstantRate(rate=-2.0, start=1.0, end=5.0)
    assert law.coordinates(3).tolist() == [5.0, 3.0, 1.0]
    assert law.times(np.array([5.0, 3.0, 1.0])).tolist() == [0.0, 1.0, 2.0]
    assert law.at_times(np.array([0.0, 2.0]))[0].tolist() == [5.0, 1.0]
    assert law.duration() == 2.0


def test_cycloid_rises_without_jerk_at_its_ends_and_dwells_outside():
    law = LAWS["cycloidal"]
    q, qd, qdd = law.at_times(np.array([-1.0, 0.0, 1.0, 2.0, 5.0]))
    assert q == pytest.approx([0.2, 0.2, -0.6, -1.4, -1.4], abs=4 * EPS)
    assert qd == pytest.approx([0.0, 0.0, -1.6, 0.0, 0.0], abs=1e-15)
    assert qdd == pytest.approx([0.0] * 5, abs=1e-14)


def test_cubic_table_reproduces_a_cubic():
    # the not-a-knot spline through a cubic is that cubic
    times = [0.0, 0.4, 1.0, 1.7, 2.0]
    law = bm.motion.Trajectory(times=times, values=[t**3 - t for t in times])
    t = np.linspace(0.0, 2.0, 9)
    q, qd, qdd = law.at_times(t)
    assert q == pytest.approx(t**3 - t, abs=1e-14)
    assert qd == pytest.approx(3 * t**2 - 1, abs=1e-13)
    assert qdd == pytest.approx(6 * t, abs=1e-12)


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
def test_table_says_nothing_outside_itself(interpolation):
    law = bm.motion.Trajectory(
        times=[1.0, 2.0, 3.0], values=[0.0, 1.0, 0.5], interpolation=interpolation
    )
    for part in law.at_times(np.array([0.99, 1.0, 3.0, 3.01])):
        assert np.isnan(part).tolist() == [True, False, False, True]


WRONG = {
    "times and values of different length": lambda: bm.motion.Trajectory(
        times=[0.0, 1.0], values=[0.0]
    ),
    "times that do not increase": lambda: bm.motion.Trajectory(times=[0.0, 0.0], values=[0.0, 1.0]),
    "times that go back": lambda: bm.motion.Trajectory(
        times=[0.0, 2.0, 1.0], values=[0.0, 1.0, 2.0]
    ),
    "one row": lambda: bm.motion.Trajectory(times=[0.0], values=[0.0]),
    "not a number": lambda: bm.motion.ConstantRate(rate=math.nan),
    "endless": lambda: bm.motion.ConstantRate(rate=1.0, end=math.inf),
    "no frequency": lambda: bm.motion.Harmonic(amplitude=1.0, frequency=0.0),
    "no duration": lambda: bm.motion.Cycloidal(start=0.0, end=1.0, time=0.0),
    "unknown key": lambda: bm.motion.ConstantRate(rate=1.0, speed=2.0),
    "text": lambda: bm.motion.ConstantRate(rate="1"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_law_is_refused(name):
    with pytest.raises(BlockmechError):
        WRONG[name]()


def test_names_of_the_file_work_in_python_too():
    law = bm.motion.ConstantRate(**{"rate": 1.0, "from": 2.0, "to": 3.0})
    assert (law.start, law.end) == (2.0, 3.0)
    law = bm.motion.Cycloidal(**{"from": 0.0, "to": 1.0, "duration": 2.0})
    assert law.time == 2.0


def test_law_drives_a_mechanism_in_time():
    g = machines.crank(2.0)
    for law in LAWS.values():
        g.drive("crank", law)
        t = np.array([0.1, 0.9])
        r = g.run(times=t)
        q, qd, qdd = law.at_times(t)
        assert np.allclose(r["crank.B.p"], 2 * np.exp(1j * q), rtol=0, atol=4 * EPS)
        assert np.allclose(r["crank.B.v"], 2j * qd * np.exp(1j * q), rtol=0, atol=1e-14)
        expected = 2 * (1j * qdd - qd**2) * np.exp(1j * q)
        assert np.allclose(r["crank.B.a"], expected, rtol=0, atol=1e-12)
