"""Steady states under loads of the time, those that do not exist, and what holds for all."""

from __future__ import annotations

import cmath
import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from blockmech.dynamics import flows
from blockmech.dynamics.request import Start
from blockmech.ground.errors import RequestError
from tests.dynamics.linkages import fourbar
from tests.dynamics.scenes import (
    JUDGE,
    LONG,
    LOWEST,
    MULTIPLIER,
    OBSERVED,
    TURN,
    WEIGHT,
    J,
    K,
    M,
    at_rest,
    motor,
    of_rate,
    refused,
    rod,
    slide,
    wave,
)
from tests.dynamics.synthetic import move
from tests.dynamics.test_integrators import double_pendulum
from tests.gallery import changed, document

# -- loads of the time ------------------------------------------------------------------------

F, T = 10.0, 0.7  # of the force on the slide: [N], [s]


@pytest.mark.parametrize("c", [0.05, 3.0, 30.0])
def test_forced_oscillator_has_the_amplitude_phase_and_multipliers_of_the_textbook(c):
    times = np.linspace(0.0, T, 9)
    r = slide(M, K, c, wave(T, F)).simulate("steady", start=at_rest(0.0, "slider"), times=times)
    motion, w = r.motion, TURN / T
    response = F / (K - M * w**2 + 1j * c * w)
    expected = (response * np.exp(1j * w * times)).real
    assert np.abs(r["slider.q"] - expected).max() <= min(motion.error, LONG * abs(response))
    roots = [(-c + sign * cmath.sqrt(c * c - 4 * M * K)) / (2 * M) for sign in (1, -1)]
    multipliers = [cmath.exp(root * T) for root in roots]
    facts = motion.facts
    assert (motion.method, facts["period"]) == ("stroboscopic map", T)
    assert facts["multiplier"] == pytest.approx(abs(multipliers[0]), abs=MULTIPLIER)
    assert facts["multiplier_2"] == pytest.approx(abs(multipliers[1]), abs=MULTIPLIER)
    if multipliers[0].imag:
        angle = facts["multiplier_angle"]
        assert math.cos(angle) == pytest.approx(math.cos(cmath.phase(multipliers[0])), abs=1e-9)


def test_without_damping_the_forced_oscillator_is_neutral_and_at_resonance_there_is_none(
    monkeypatch,
):
    start = at_rest(0.0, "slider")
    motion = slide(M, K, 0.0, wave(T, F)).simulate("steady", start=start).motion
    assert motion.q_end == pytest.approx(F / (K - M * (TURN / T) ** 2), abs=motion.error)
    assert motion.facts["multiplier"] == pytest.approx(1.0, abs=MULTIPLIER)
    assert motion.regime == "neutral periodic motion"
    monkeypatch.setattr(flows, "TIMES", 1)
    monkeypatch.setattr(flows, "PERIODS", (1,))
    natural = TURN / math.sqrt(K / M)
    assert "no periodic motion was found" in refused(
        slide(M, K, 0.0, wave(natural, F)), start=start
    )


def test_loads_of_several_periods_repeat_after_their_common_multiple():
    r = slide(M, K, 3.0, wave(0.6, F)).simulate("steady", start=at_rest(0.0, "slider"))
    assert r.motion.facts["period"] == 0.6
    both = rod(wave(0.6, 2.0), wave(0.9, 2.0), of_rate(-1.0))
    motion = both.simulate("steady", start=at_rest(1.0)).motion
    assert motion.facts["period"] == pytest.approx(1.8, rel=1e-15)
    assert motion.regime == "steady state"


def judged(moment, state, span, knots=()):
    """State of the rod after a while, by SciPy from the formula of its moments."""

    def slope(t, y):
        return [y[1], (moment(y[0], y[1], t) - WEIGHT * math.cos(y[0])) / J]

    t = 0.0
    for station in [k for k in sorted(knots) if 0 < k < span] + [span]:
        state = solve_ivp(slope, (t, station), state, **JUDGE).y[:, -1]
        t = station
    return state


def test_a_forced_pendulum_settles_to_it_at_the_rate_of_its_multipliers():
    period, c = 1.3, 1.5

    def moment(q, rate, t):
        return 2.0 * math.cos(TURN * t / period) - c * rate

    scene = rod(wave(period, 2.0), of_rate(-c))
    motion = scene.simulate("steady", start=at_rest(1.0), accuracy=1e-10).motion
    x = np.array([motion.at(0.0).q, motion.at(0.0).qd]).ravel()
    assert motion.reached
    long = np.array([1.0, 0.0])
    for _ in range(12):  # a period leaves a twentieth of a disturbance
        long = judged(moment, long, period)
    assert np.abs(long - x).max() <= LONG
    h = 1e-4
    columns = [
        (judged(moment, x + h * e, period) - judged(moment, x - h * e, period)) / (2 * h)
        for e in np.eye(2)
    ]
    observed = sorted(np.abs(np.linalg.eigvals(np.column_stack(columns))), reverse=True)
    multipliers = [motion.facts["multiplier"], motion.facts["multiplier_2"]]
    assert np.abs(np.abs(multipliers) - observed).max() <= OBSERVED


@cache
def pump(**law):
    data = document("pump")
    if law:
        data["blocks"]["motor"]["law"] = law
    return changed(data)


def test_a_crank_under_a_table_of_the_time_equals_the_long_run_through_its_kinks():
    rows = {"arguments": (0.0, 0.05, 0.12), "values": (1.0, 9.0, -5.0), "interpolation": "linear"}
    scene = pump(kind="table", of="time", period=0.2, **rows)
    motion = scene.simulate("steady").motion
    long = scene.simulate("time=16", accuracy=1e-10).motion  # 0.69 a period: 1e-13 is left
    at = np.array([0.0, 0.03, 0.11])
    steady, later = motion.at(at), long.at(15.8 + at)
    turns = np.round((later.q - steady.q) / TURN)
    assert np.ptp(turns) == 0
    assert np.abs(later.q - turns * TURN - steady.q).max() <= LONG + long.error
    assert motion.regime == "steady state"


NATURAL = math.sqrt(WEIGHT / J)  # [rad/s]


@pytest.mark.parametrize(
    ("amplitude", "periods", "turns"), [(1.07, 2, 0), (1.35, 1, 1), (1.45, 2, 2)]
)
def test_the_driven_pendulum_doubles_its_period_as_in_the_literature(amplitude, periods, turns):
    # Baker & Gollub, Chaotic Dynamics, 1996, section 3.3: damping 1/2, frequency 2/3
    loads_ = wave(TURN / (NATURAL * 2 / 3), amplitude * WEIGHT), of_rate(-J * NATURAL / 2)
    motion = rod(*loads_).simulate("steady", start=at_rest(LOWEST + 0.2)).motion
    assert motion.facts["periods_of_the_loads"] == periods
    assert motion.regime == "steady state"
    advanced = (motion.q_end - motion.at(0.0).q) / TURN
    assert abs(advanced) == pytest.approx(turns, abs=LONG)


def test_several_drivers_under_loads_of_the_time():
    plain, period = double_pendulum(), 3.0

    def terms(q, qd, t):
        drag = np.array([2 * qd[0] - 0.6 * qd[1], 1.2 * qd[1] - 0.6 * qd[0]])
        push = np.array([0.6 * math.cos(TURN * t / period), 0.0])
        terms = plain.terms(q, qd, t)
        return terms._replace(Q=terms.Q - drag + push)

    scene = plain.but(terms=terms, depends_on=frozenset({"q", "rate", "time"}))
    motion = move(scene, ([1.0, -0.5], [0.3, 0.0]), f"steady={period}")
    many = math.ceil(math.log(1e-6) / math.log(motion.facts["multiplier"]))
    long = move(scene, ([1.0, -0.5], [0.3, 0.0]), f"time={many * period}", accuracy=1e-6)
    assert np.abs(long.q_end - motion.q_end).max() <= 1e-6 + long.error + motion.error
    assert sum(name.startswith("multiplier") and "angle" not in name for name in motion.facts) == 4


# -- what there is none of --------------------------------------------------------------------


def test_loads_without_a_common_period_are_named():
    message = refused(rod(wave(1.3, 2.0), wave(math.sqrt(2), 2.0)), start=at_rest(1.0))
    assert "load0 and load1" in message
    assert "no common multiple" in message


def test_a_load_that_never_repeats_is_named():
    law = {"kind": "polynomial", "of": "time", "coefficients": [0.0, 1.0]}
    assert "load0 follows the time and does not repeat" in refused(rod(law), start=at_rest(1.0))


def push(time):
    return F * math.cos(TURN * time / T)


def test_a_function_of_the_time_needs_its_period_and_then_is_as_good_as_data():
    scene, start = slide(M, K, 3.0, push), at_rest(0.0, "slider")
    assert 'give the period of the loads: "steady=<s>"' in refused(scene, start=start)
    motion = scene.simulate(f"steady={T}", start=start).motion
    reference = slide(M, K, 3.0, wave(T, F)).simulate("steady", start=start).motion
    assert abs(motion.q_end - reference.q_end) <= motion.error + reference.error
    with pytest.raises(RequestError, match="not the same again after"):
        scene.simulate("steady=0.6", start=start)


@pytest.mark.parametrize(
    ("scene", "request_", "part"),
    [
        (lambda: rod(of_rate(0.3)), {"start": at_rest(-1.0)}, "turns that grow without bound"),
        (lambda: slide(M, K, 0.0, of_rate(1.0)), {"start": at_rest(0.1, "slider")},
         "swings or turns that grow without bound"),
        (lambda: slide(2.0, 0.0, 0.0, lambda rate: 5.0 - rate), {"start": at_rest(0.0, "slider")},
         "a way without end"),
        (lambda: pump(), {"stops": {"crank": (-1e9, 100.0)}}, "s: end stop"),
        (lambda: rod(of_rate(-0.5)), {"start": at_rest(1.0), "stops": {"crank": (-1.0, 2.0)}},
         "s: end stop"),
    ],
)  # fmt: skip
def test_where_none_can_be_one_message_says_why(scene, request_, part):
    assert part in refused(scene(), **request_)


def test_a_rocking_linkage_with_a_damper_ends_in_its_dead_centre():
    plain = fourbar()

    def one(q, qd, t):
        J, tau, slope, margin, _ = plain.scalar_terms(q)
        return J, tau - 0.1 * qd, slope, margin

    damped = plain.but(one=one, depends_on=frozenset({"q", "rate"}))
    with pytest.raises(RequestError, match="dead centre"):
        move(damped, Start(1.0), "steady")


# -- of all -----------------------------------------------------------------------------------


def test_a_target_that_is_missed_is_said_to_be_missed():
    motion = rod(wave(1.3, 2.0), of_rate(-1.5)).simulate(
        "steady", start=at_rest(1.0), accuracy=1e-16
    )
    assert not motion.motion.reached
    assert any("accuracy not reached" in note for note in motion.motion.notes)


def test_a_search_that_is_stopped_says_so_and_a_long_one_tells_how_far_it_is():
    reports = []

    def stop(what, done, whole):
        reports.append(what)
        if len(reports) > 5:
            raise KeyboardInterrupt

    r = rod(wave(1.3, 2.0), of_rate(-1.5)).simulate("steady", start=at_rest(1.0), progress=stop)
    assert r.motion.end == "interrupted"
    assert r.motion.notes == ("interrupted before a steady state was found",)
    assert "stroboscopic map" in reports


def test_user_events_happen_on_a_steady_motion():
    from blockmech.dynamics.request import Watch

    level = Watch("level", lambda t, q, qd: math.cos(q - LOWEST) - math.cos(0.1), terminal=False)
    motion = rod(wave(1.3, 2.0), of_rate(-1.5)).simulate(
        "steady", start=at_rest(1.0), watch=[level]
    )
    assert {event.kind for event in motion.motion.events} == {"level"}


# -- drivers on whose coordinate nothing depends ------------------------------------------------

STALL, IDLE, MEAN, SWING, BEAT = 5.0, 20.0, 1.0, 2.0, 0.7  # [N m], [rad/s], [N m], [N m], [s]


def test_a_balanced_flywheel_under_a_motor_and_a_pulsating_moment_repeats_its_rate():
    times = np.linspace(0.0, BEAT, 9)
    scene = rod(motor(STALL, IDLE), wave(BEAT, SWING, mean=MEAN), gravity=0.0)
    r = scene.simulate("steady", start={"crank": (0.3, 1.0)}, times=times)
    c, w = STALL / IDLE, TURN / BEAT
    pulse = SWING / (c + 1j * J * w)
    rate = (STALL + MEAN) / c + (pulse * np.exp(1j * w * times)).real
    expected = (STALL + MEAN) / c * times + (pulse * (np.exp(1j * w * times) - 1) / (1j * w)).real
    assert np.abs(r["crank.rate"] - rate).max() <= LONG * IDLE
    assert np.abs(r["crank.q"] - 0.3 - expected).max() <= r.motion.error < LONG
    assert r.motion.facts["multiplier"] == pytest.approx(math.exp(-c * BEAT / J), rel=MULTIPLIER)
    assert "multiplier_2" not in r.motion.facts
    assert any("nothing depends on the coordinate" in note for note in r.motion.notes)


def test_a_slide_without_a_spring_is_shaken_about_the_place_where_it_starts():
    r = slide(M, 0.0, 3.0, wave(T, F)).simulate("steady", start=at_rest(0.2, "slider"))
    swing = F / (-M * (TURN / T) ** 2 + 3.0j * TURN / T)
    expected = 0.2 + ((np.exp(1j * TURN / T * r.time) - 1) * swing).real
    assert np.abs(r["slider.q"] - expected).max() <= r.motion.error < LONG
    assert "mean_speed" not in r.motion.facts


def test_a_flywheel_that_nothing_brakes_repeats_from_every_start_if_the_moment_has_no_mean():
    motion = (
        rod(wave(BEAT, SWING), gravity=0.0).simulate("steady", start={"crank": (0, 4.0)}).motion
    )
    assert motion.facts["multiplier"] == pytest.approx(1.0, abs=MULTIPLIER)
    assert abs(motion.q_end - 4.0 * BEAT) <= motion.error
    scene = rod(wave(BEAT, SWING, mean=MEAN), gravity=0.0)
    message = refused(scene, start=at_rest(0.0))
    assert f"change the rate by {MEAN * BEAT / J:.6g}" in message


def test_a_cyclic_driver_that_goes_on_comes_to_its_end_stop():
    scene = slide(M, 0.0, 3.0, wave(T, F, mean=0.05))
    message = refused(scene, start=at_rest(0.0, "slider"), stops={"slider": (-5.0, 50.0)})
    assert "advances by" in message
    assert "end stop" in message
    message_near_stop = refused(scene, start=at_rest(0.0, "slider"), stops={"slider": (-5.0, 0.06)})
    assert "s: end stop" in message_near_stop


def test_an_unbalanced_flywheel_is_not_cyclic():
    scene = rod(of_rate(-1.0), wave(BEAT, SWING))
    motion = scene.simulate("steady", start=at_rest(LOWEST)).motion
    assert "multiplier_2" in motion.facts


def test_what_depends_on_the_coordinate_alone_attracts_nothing_whatever_the_integrator():
    for method in ("dop853", "radau"):
        assert "every motion is its own" in refused(rod(), start=at_rest(0.0), method=method)


def test_a_period_that_no_load_needs_is_said_not_to_be_used():
    r = rod(of_rate(-1.0)).simulate("steady=0.5", start=at_rest(0.0))
    assert any("0.5 s is not used" in note for note in r.motion.notes)
