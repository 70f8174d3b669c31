"""Extremes and strokes against closed forms of slider-cranks, four-bars and levers."""

from __future__ import annotations

import json
import math
import random
import time

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis.extremes import cycle_of, extremes
from blockmech.analysis.stroke import stroke
from blockmech.analysis.turning_points import Signal, turns_of
from tests.analysis.linkages import fivebar, slider_crank
from tests.gallery import GRAPHS
from tests.machines import fourbar, wire
from tests.wiring import EPS

TURN = 2 * math.pi
PLACE = 1e-13
"""Relative error of the place of an extreme, times |value| / |second derivative|: rounding
of 32 values, magnified by their number and by 1 / width of the interpolant (at least 0.14 rad),
2e-16 * 32 / 0.14 = 5e-14; twice that."""
ROUNDINGS = 16
"""Roundings between the lengths and a place of a dyad on a crank, magnified by
1/sqrt(margin), which is below 2 for the linkages here unless a test says otherwise."""


def apart(q, expected):
    """Distance of two crank angles, whole turns aside."""
    return abs(math.remainder(q - expected, TURN))


# -- slider-cranks ----------------------------------------------------------------------


def reach(l, r, e, sign):
    """Slider's distance with crank and rod in line: (l +- r)^2 = x^2 + e^2."""
    return math.sqrt((l + sign * r - e) * (l + sign * r + e))


def in_line(l, r, e, sign):
    """Crank angle with crank and rod in line: the ray from A to the slider, or its opposite."""
    return math.atan2(sign * e, sign * reach(l, r, e, sign))


@pytest.mark.parametrize("seed", range(6))
def test_offset_slider_crank_obeys_the_stroke_formula_and_returns_quickly(seed):
    chance = random.Random(seed)
    r = chance.uniform(0.5, 2.0)
    l = r * chance.uniform(2.0, 5.0)
    e = chance.uniform(-0.7, 0.7) * (l - r) if seed else 0.0
    stroke = slider_crank(r, l, e).compile().stroke("dyad.C.p")
    assert stroke.path == "straight"
    high, low = reach(l, r, e, 1), reach(l, r, e, -1)
    # The margin is at least 1 - (0.7 (l - r) + r)^2 / l^2 > 0.27, its root above 1/2.
    assert abs(stroke.length - (high - low)) <= ROUNDINGS * EPS * (l + r)
    # x'' at the ends is r (l +- r) / x' s lever: at least r (1 - r/l) / 1, x at most l + r.
    tolerance = PLACE * (l + r) / (r * (1 - r / l) / 2)
    assert apart(stroke.high.at["crank.q"], in_line(l, r, e, 1)) <= tolerance
    assert apart(stroke.low.at["crank.q"], in_line(l, r, e, -1)) <= tolerance
    swing = abs(math.asin(e / (l - r)) - math.asin(e / (l + r)))
    expected = (math.pi + swing) / (math.pi - swing)
    # d(ratio)/d(angle) = 2 pi / (pi - swing)^2, for two angles.
    assert abs(stroke.time_ratio - expected) <= 2 * tolerance * TURN / (math.pi - swing) ** 2
    assert abs(stroke.out + stroke.back - TURN) <= 2 * EPS * TURN


def test_crank_that_runs_backwards_swaps_stroke_and_return():
    forward = bm.motion.ConstantRate(rate=2.0)
    backward = bm.motion.ConstantRate(rate=-2.0, start=0.0, end=-TURN)
    stroke = slider_crank(1.0, 3.0, 0.8, forward).compile().stroke("dyad.C.p")
    reverse = slider_crank(1.0, 3.0, 0.8, backward).compile().stroke("dyad.C.p")
    tolerance = 2 * PLACE * 4.0 / (1.0 - 1 / 3)
    assert abs(stroke.out - stroke.back) > 0.1
    assert abs(stroke.out - reverse.back) <= tolerance
    assert abs(stroke.time_ratio - reverse.time_ratio) <= tolerance


def test_slider_that_cannot_turn_has_its_stroke_between_arc_ends():
    # The rod stands across the guide at both ends of the arc, at sin q = -1/2.
    stroke = slider_crank(1.0, 3.0, 2.5).compile().stroke("dyad.C.p")
    low, high = -math.cos(math.asin(0.5)), reach(3.0, 1.0, 2.5, 1)
    # Near the end x = x_end + sqrt(margin) l: an end good to n EPS gives sqrt(n EPS).
    assert abs(stroke.length - (high - low)) <= 3.0 * math.sqrt(ROUNDINGS * EPS)
    assert stroke.time_ratio is None
    assert stroke.low.end
    assert not stroke.high.end


# -- rockers ----------------------------------------------------------------------------


def rocker_angles(a, b, c, d):
    """Rocker's angles from the frame's x axis, folded and extended crank and coupler."""
    angles = []
    for s in (b - a, b + a):
        inside = math.acos((d * d + c * c - s * s) / (2 * c * d))
        crank = math.acos((d * d + s * s - c * c) / (2 * d * s))
        angles.append((math.pi - inside, crank + (math.pi if s == b - a else 0.0)))
    return angles


def crank_rockers(count):
    """Random crank-rockers: the crank is the shortest link and Grashof's sum has room."""
    chance = random.Random(3)
    lengths = []
    while len(lengths) < count:
        a, b, c, d = (chance.uniform(0.5, 3.0) for _ in range(4))
        if a < 0.8 * min(b, c, d) and a + max(b, c, d) < 0.9 * (b + c + d - max(b, c, d)):
            lengths.append((a, b, c, d))
    return lengths


@pytest.mark.parametrize("lengths", crank_rockers(6), ids=str)
def test_rocker_swings_between_crank_and_coupler_in_line(lengths):
    c = lengths[2]
    mechanism = fourbar(*lengths).compile()
    folded, extended = rocker_angles(*lengths)
    extremes = mechanism.extremes("dyad.j.angle")
    # acos loses 1 / sin of its angle, the margin 1 / sqrt: together below 20 here.
    worst = 20 * ROUNDINGS * EPS * math.pi
    swing = folded[0] - extended[0]
    turned = extremes.maximum.value - extremes.minimum.value
    assert abs(abs(swing) - turned) <= worst
    met = {extremes.minimum.at["crank.q"], extremes.maximum.at["crank.q"]}
    for _, crank in (folded, extended):
        assert min(apart(q, crank) for q in met) <= 20 * PLACE * math.pi
    arc = mechanism.stroke("dyad.C.p")
    assert arc.path == "curved"
    assert abs(arc.length - c * turned) <= worst * c
    assert abs(arc.chord - 2 * c * math.sin(turned / 2)) <= worst * c
    slow = math.pi + abs(math.remainder(folded[1] - extended[1] - math.pi, TURN))
    expected = slow / (TURN - slow)
    assert abs(arc.time_ratio - expected) <= 100 * PLACE * expected**2


def test_transmission_angle_is_least_with_the_crank_on_the_frame():
    a, b, c, d = 2.0, 6.0, 3.0, 5.5
    extremes = fourbar(a, b, c, d).compile().extremes("dyad.transmission_angle")
    expected = math.acos((b * b + c * c - (d - a) ** 2) / (2 * b * c))
    assert abs(extremes.minimum.value - expected) <= ROUNDINGS * EPS / math.sin(expected)
    # gamma'' = a d / (b c sin gamma) = 1.5
    assert apart(extremes.minimum.at["crank.q"], 0.0) <= PLACE * expected / 1.5


def test_right_transmission_angle_is_found_at_its_kink():
    a, b, c, d = 2.0, 6.0, 3.0, 5.5
    extremes = fourbar(a, b, c, d).compile().extremes("dyad.transmission_angle")
    q = math.acos((a * a + d * d - b * b - c * c) / (2 * a * d))  # |BD|^2 = b^2 + c^2
    # Both sides slope by a d sin q / (b c) = 0.53 per rad.
    assert abs(extremes.maximum.value - math.pi / 2) <= ROUNDINGS * EPS
    angle = extremes.maximum.at["crank.q"]
    assert min(apart(angle, q), apart(angle, -q)) <= ROUNDINGS * EPS * math.pi / 0.53
    assert len([t for t in extremes.turns if t.kind == "maximum"]) == 2


# -- any output -------------------------------------------------------------------------


def scotch_yoke():
    """A yoke that moves as r cos q; its marker is ``dyad.O``."""
    g = bm.Graph("scotch_yoke")
    guide = bm.Marker(at=(0.0, 0.0), angle=0.0)
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "G": guide}))
    g.add("crank", bm.Crank(length=0.4))
    g.add("dyad", bm.RPP(beta=math.pi / 2))
    wire(g, "frame.A crank.A", "crank.B dyad.B", "frame.G dyad.S")
    g.drive("crank", bm.motion.ConstantRate(rate=5.0))
    return g.compile()


@pytest.mark.parametrize(
    ("output", "amplitude", "highest", "lowest"),
    [
        ("dyad.O.p.x", 0.4, 0.0, math.pi),
        ("dyad.O.v.x", 0.4 * 5, 1.5 * math.pi, math.pi / 2),
        ("dyad.O.a.x", 0.4 * 25, math.pi, 0.0),
    ],
)
def test_harmonic_motion_turns_where_it_should(output, amplitude, highest, lowest):
    mechanism = scotch_yoke()
    result = mechanism.extremes(output)
    few = extremes(mechanism.run(samples=5, want=output.removesuffix(".x")), output)
    assert abs(few.maximum.value - amplitude) <= 4 * EPS * amplitude  # samples do not limit it
    assert abs(result.maximum.value - amplitude) <= 4 * EPS * amplitude
    assert abs(result.minimum.value + amplitude) <= 4 * EPS * amplitude
    assert apart(result.maximum.at["crank.q"], highest) <= PLACE
    assert apart(result.minimum.at["crank.q"], lowest) <= PLACE
    assert apart(result.maximum.time * 5.0, result.maximum.at["crank.q"]) <= 4 * EPS * TURN
    assert [t.kind for t in result.turns].count("maximum") == 1


def test_vector_has_extremes_of_parts_and_of_its_magnitude():
    extremes = scotch_yoke().extremes("crank.B.p")
    assert extremes.unit == "m"
    assert abs(extremes["x"].maximum.value - 0.4) <= 4 * EPS * 0.4
    assert abs(extremes["y"].minimum.value + 0.4) <= 4 * EPS * 0.4
    assert extremes["magnitude"].turns == ()  # the pin stays on its circle
    assert abs(extremes.maximum.value - extremes.minimum.value) <= 4 * EPS * 0.4
    assert set(extremes.to_dict()) == {"output", "unit", "x", "y", "magnitude", "notes"}


def test_range_that_ends_early_has_its_extreme_at_the_end():
    run = scotch_yoke().run(at=np.linspace(0.2, 1.0, 7), want="dyad.O.p")
    result = extremes(run, "dyad.O.p.x")
    assert result.maximum.end
    assert result.minimum.end
    assert result.maximum.at == {"crank.q": 0.2}
    assert result.minimum.at == {"crank.q": 1.0}
    assert result.turns == ()


def test_a_range_of_too_many_turns_says_how_many_there_may_be():
    graph = fourbar(3.0, 5.0, 4.0, 1.0)
    graph.drive("crank", bm.motion.ConstantRate(rate=10.0, start=0.0, end=4000.0))
    message = r"636\.62 turns take 64 samples each, of 36000 in all\. follow 562 turns at most"
    for ask in (extremes, stroke):
        with pytest.raises(bm.RequestError, match=message):
            ask(graph.compile(), "crank.drive")


def test_full_turning_link_has_no_extreme_of_its_angle_inside():
    extremes = fourbar(3.0, 5.0, 4.0, 1.0).compile().extremes("dyad.j.angle")
    assert extremes.turns == ()
    # One turn more after a turn of the crank.
    assert abs(extremes.maximum.value - extremes.minimum.value - TURN) <= ROUNDINGS * EPS * TURN


def test_ends_of_an_arc_that_is_shorter_than_six_samples_are_limits_as_well():
    """A rocker of a millimetre turns about its pivot, while the crank moves by five degrees."""
    arc = fourbar(1.0, 1.001, 1e-3, 2.0).compile().extremes("dyad.C.p.x")
    assert arc.maximum.value == pytest.approx(2.001, abs=1e-9)
    assert arc.minimum.value == pytest.approx(1.999, abs=1e-9)


def test_poses_that_do_not_close_count_in_no_part_of_a_vector():
    """A crank between dead centres drives a slider at a constant height of 2.5 m."""
    height = slider_crank(1.0, 3.0, 2.5).compile().extremes("dyad.C.p.y")
    assert height.minimum.value == height.maximum.value == 2.5


def test_a_closed_signal_within_its_rounding_has_the_extremes_of_its_samples():
    """At a margin of 1e-15 no turn is above rounding."""
    cycle = cycle_of(fourbar(1.0, 3.0, 3.0, 3.0).compile(), friction=None, static=None)
    signal = Signal("crank.q", np.cos, np.cos, lambda s: np.full(len(s), 1e-15))
    low, high, inner, closed = turns_of(cycle, signal)
    assert (inner, closed) == ((), True)
    assert (low.value, high.value) == (-1.0, 1.0)


def test_rates_grow_without_bound_towards_a_dead_centre():
    law = bm.motion.ConstantRate(rate=10.0)
    extremes = slider_crank(1.0, 3.0, 2.5, law).compile().extremes("dyad.i.omega")
    assert {extremes.minimum.value, extremes.maximum.value} == {-math.inf, math.inf}
    end = slider_crank(1.0, 3.0, 2.5).compile().limits().arcs[0].end.q
    assert apart(extremes.maximum.at["crank.q"], end) <= 4 * EPS * TURN
    assert extremes.to_dict()["value"]["maximum"]["value"] is None


@pytest.mark.parametrize(("turns", "followed"), [(100, True), (1e9, False)])
def test_a_range_of_more_turns_than_samples_can_follow_is_refused(turns, followed):
    mech = fourbar(1.0, 3.0, 2.5, 3.0 + 0j).compile()
    ends = mech.run(at=[0.0, math.tau * turns], want="dyad.j.omega", rates=1.0)
    if not followed:
        with pytest.raises(bm.RequestError, match="1e\\+09 turns"):
            extremes(ends, "dyad.j.omega")
        return
    turn = mech.run(at=[0.0, math.tau], want="dyad.j.omega", rates=1.0)
    largest, once = (extremes(run, "dyad.j.omega")[""].maximum.value for run in (ends, turn))
    assert largest == pytest.approx(once, rel=1e-9)


def test_extremes_are_followed_in_time_where_the_law_is_one_of_time():
    law = bm.motion.Harmonic(amplitude=1.0, frequency=2.0)
    g = slider_crank(1.0, 3.0, 0.0, law)
    extremes = g.compile().extremes("crank.rate")
    assert abs(extremes.maximum.value - 4 * math.pi) <= 8 * EPS * 4 * math.pi
    # A cosine through its whole period: the extreme is an end of the range, or half way.
    assert min(abs(extremes.maximum.time - t) for t in (0.0, 0.5)) == 0.0
    assert abs(extremes.minimum.time - 0.25) <= PLACE
    slider = g.compile().extremes("dyad.C.p.x")
    assert abs(slider.maximum.value - 4.0) <= ROUNDINGS * EPS * 4.0


def test_two_drivers_are_followed_along_their_laws():
    g = fivebar()
    g.drive("left", bm.motion.ConstantRate(rate=1.0, start=0.0, end=1.0))
    g.drive("right", bm.motion.ConstantRate(rate=2.0, start=0.0, end=2.0))
    extremes = g.compile().extremes("right.B.p.y")
    assert abs(extremes.maximum.value - 1.0) <= 4 * EPS
    assert abs(extremes.maximum.at["right.q"] - math.pi / 2) <= 2 * PLACE
    assert abs(extremes.maximum.at["left.q"] - math.pi / 4) <= PLACE


def test_mechanical_advantage_is_useful_force_over_driving_moment():
    g = slider_crank(0.1, 0.35, 0.0, bm.motion.ConstantRate(rate=2.0))
    g.add("work", bm.Force(force=(-800.0, 0.0), useful=True))
    g.connect("dyad.C", "work.at")
    mechanism = g.compile()
    name = "mechanism.mechanical_advantage"
    assert mechanism.outputs[name].unit == "N/(N m)"
    q = [0.3, 1.0, 2.0, 4.0]
    run = mechanism.run(at=q, want=[name, "dyad.C.v"], friction="none", static=True)
    # No power is lost: |F| |v| = |tau| |rate|.
    product = run[name] * np.abs(run["dyad.C.v"]) / 2.0
    assert np.abs(product - 1).max() <= 2 * ROUNDINGS * EPS
    at_rest = mechanism.run(at=[0.0, 1.0], want=[name], friction="none", static=True)
    assert [(f.sample, f.code, f.where) for f in at_rest.quality.flags] == [(0, "infinite", name)]
    minimum = mechanism.extremes(name, friction="none", static=True).minimum
    fastest = mechanism.extremes("dyad.C.v.x")
    both = (fastest.minimum, fastest.maximum)
    assert abs(minimum.value - 2.0 / fastest.maximum.value) <= 4 * ROUNDINGS * EPS * minimum.value
    # v''/v = 2 about, so the places of both agree to 2 PLACE.
    assert min(apart(minimum.at["crank.q"], f.at["crank.q"]) for f in both) <= 4 * PLACE


def test_rounding_about_zero_is_not_taken_for_a_motion():
    """The pin of a yoke on a guide turned by 0.3 rad: across the guide it does not move."""
    g = bm.Graph("yoke")
    guide = bm.Marker(at=(0.0, 0.0), angle=0.3)
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "G": guide}))
    across = bm.Link(markers={"T": bm.Marker(at=(0.0, 0.0))}, mass=1.0)
    g.add("crank", bm.Crank(length=0.4))
    g.add("dyad", bm.RPP(beta=math.pi / 2, links={"j": across}))
    wire(g, "frame.A crank.A", "crank.B dyad.B", "frame.G dyad.S")
    g.drive("crank", bm.motion.ConstantRate(rate=5.0))
    extremes = g.compile().extremes("dyad.j.angle")
    assert extremes.turns == ()
    omega = g.compile().extremes("dyad.j.omega")
    assert omega.minimum.value == omega.maximum.value == 0.0


# -- what is said -----------------------------------------------------------------------


def test_extremes_and_strokes_are_data_and_text():
    mechanism = slider_crank(1.0, 3.0).compile()
    extremes = mechanism.extremes("dyad.C.p.x")
    assert json.loads(json.dumps(extremes.to_dict()))["value"]["maximum"]["end"] is False
    assert str(extremes).splitlines()[0] == "dyad.C.p.x  minimum 2 m at crank.q = 3.14159265 rad"
    assert extremes.to("deg").text().splitlines()[0].endswith("at crank.q = 180 deg")
    told = mechanism.stroke("dyad.C.p")
    assert json.loads(json.dumps(told.to_dict()))["length"] == told.length
    assert str(told).startswith("dyad.C.p  stroke 2 m, from crank.q = 3.14159265 rad to ")
    assert "singular poses of the first kind" in str(told)
    assert str(told).endswith("; time ratio 1")


WRONG = [
    ("extremes", "dyad.X.p", "no output has that name"),
    ("extremes", "mechanism.friction_efficiency", "it is a number"),
    ("stroke", "crank.B.p", "runs round a closed path"),
    ("stroke", "dyad.C.v", "not the position of a marker"),
    ("stroke", "frame.D.p", "the marker does not move"),
]


@pytest.mark.parametrize(("ask", "name", "message"), WRONG)
def test_wrong_requests_are_named(ask, name, message):
    mechanism = fourbar(2.0, 6.0, 3.0, 5.5).compile()
    with pytest.raises(bm.RequestError) as caught:
        getattr(mechanism, ask)(name)
    assert message in caught.value.problems[0].found


def test_stroke_of_what_grows_without_bound_is_refused():
    law = bm.motion.ConstantRate(rate=10.0)
    with pytest.raises(bm.RequestError, match="grows without bound"):
        stroke(slider_crank(1.0, 3.0, 2.5, law).compile(), "dyad.i.omega")


def test_mechanism_that_never_closes_fails_by_name():
    with pytest.raises(bm.AssemblyError) as caught:
        fourbar(1.0, 1.0, 1.0, 10.0).compile().extremes("dyad.C.p")
    assert caught.value.failure.block == "dyad"


def test_slide_without_a_range_says_what_to_do():
    g = bm.Graph("ram")
    g.add("frame", bm.Frame(markers={"G": bm.Marker(at=(0.0, 0.0), angle=0.0)}))
    g.add("ram", bm.SlideDrive())
    with pytest.raises(bm.RequestError, match="law of motion"):
        wire(g, "frame.G ram.S").compile().extremes("ram.S.p")


def test_result_with_many_rates_cannot_be_followed():
    run = scotch_yoke().run(at=[0.0, 1.0], rates=[1.0, 2.0], want="dyad.O.v")
    with pytest.raises(bm.RequestError, match="in place of rates"):
        extremes(run, "dyad.O.v.x")


def test_an_extreme_is_at_a_place_that_the_mechanism_reaches():
    """The angle of a slider is its guide's, also where the rod is too short for the guide."""
    law = bm.motion.ConstantRate(rate=1.0, start=0.6, end=3.0)
    result = extremes(slider_crank(crank=2.0, rod=1.0, law=law).compile(), "dyad.j.angle")
    assert result.minimum.at["crank.q"] >= math.pi - math.asin(0.5)


# -- beside change points ----------------------------------------------------------------------


def test_extremes_at_a_toggle_are_its_limits_and_soon_told():
    """The press of Norton's chapter 6: a rod as long as the crank, which works one way only.

    x = 2 r cos q, so its speed at the rate -1 is 2 r sin q, and the work takes F v.
    """
    mechanism = bm.Linkage.load("graphs/exercises/ch06_toggle.json").compile()
    start = time.process_time()
    drive, speed = mechanism.extremes("driver.motor.drive"), mechanism.extremes("joint.R.v")
    assert time.process_time() - start < 60  # thousands of turns of rounding took minutes
    assert drive.minimum.value == pytest.approx(-2000, rel=1e-9)
    assert drive.maximum.value == pytest.approx(2000, rel=1e-9)
    assert speed["x"].maximum.value == pytest.approx(0.4, rel=1e-9)
    assert speed["x"].minimum.value == pytest.approx(-0.4, rel=1e-9)
    assert speed["y"].maximum.value == speed["y"].minimum.value == 0
    assert abs(speed.minimum.value) < 1e-11  # half of the turn the ram rests
    assert len(drive.turns) < 10


@pytest.mark.parametrize("length", [0.2, 0.35, 1.1])
def test_speeds_of_a_rod_as_long_as_its_crank(length):
    g = slider_crank(length, length)
    g.drive("crank", bm.motion.ConstantRate(rate=1.0))
    speeds = g.compile().extremes("dyad.C.v")
    assert speeds["x"].maximum.value == pytest.approx(2 * length, rel=1e-9)
    assert speeds["x"].minimum.value == pytest.approx(-2 * length, rel=1e-9)
    assert speeds["y"].maximum.value == 0


def test_extremes_ask_for_no_remarks(monkeypatch):
    """Forty loops beside their change points would have a million remarks on the samples."""
    monkeypatch.setattr("blockmech.result.result.assess", None)
    row = bm.read(GRAPHS / "n_four_bar.json").compile()
    extremes = row.extremes("crank.drive")
    assert extremes.maximum.value == pytest.approx(-extremes.minimum.value, rel=1e-9)
