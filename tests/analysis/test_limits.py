"""Feasible arcs against the cosine law and other closed forms."""

from __future__ import annotations

import cmath
import itertools
import json
import math
import random
import time

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis.limits import arcs_sentence, limits
from blockmech.testing.strategies import Options, Seeded, random_mechanism
from tests.analysis.linkages import (
    end_error,
    fivebar,
    fourbar_limits,
    slider_crank,
    slotted_lever,
    turning_guide,
)
from tests.gallery import GRAPHS, mechanism
from tests.machines import fourbar, pushed, wire
from tests.wiring import EPS

TURN = 2 * math.pi
ROUNDINGS = 8
"""Roundings between the lengths and the sign of a margin: sine and cosine (2),
two products (2), difference, squares, sum and root of |BD| (3), sum of the lengths (1)."""


def arc_ends(found):
    """Starts and ends of all arcs."""
    return [(a.start.q, a.end.q) for a in found.arcs]


def words(found):
    """How the arcs end."""
    return [(str(a.start), str(a.end)) for a in found.arcs]


# -- four-bars ------------------------------------------------------------------------


def wanted_arcs(a, b, c, d):
    """Arcs by the cosine law: |BD| grows from |a - d| at q = 0 to a + d at q = pi."""
    ends = fourbar_limits(a, b, c, d)
    nearest, farthest = abs(a - d), a + d
    opens, shuts = nearest >= abs(b - c), farthest <= b + c
    if nearest > b + c or farthest < abs(b - c):
        return []
    if opens and shuts:
        return [None]
    if opens:
        return [(-ends[-1], ends[-1])]
    if shuts:
        return [(ends[0], TURN - ends[0])]
    return [(ends[0], ends[1]), (-ends[1], -ends[0])]


def same_arc(arc, expected, tolerance):
    """Whether two arcs are the same, whole turns apart."""
    shift = TURN * round((sum(arc) - sum(expected)) / (2 * TURN))
    return all(abs(x - y - shift) <= tolerance for x, y in zip(arc, expected, strict=True))


def test_random_four_bars_obey_the_cosine_law():
    chance = random.Random(20)
    kinds = {0: 0, 1: 0, 2: 0, "turn": 0}
    for _ in range(250):
        lengths = [math.exp(chance.uniform(-1.5, 1.5)) for _ in range(4)]
        arcs, expected = limits(fourbar(*lengths).compile()), wanted_arcs(*lengths)
        if expected == [None]:
            kinds["turn"] += 1
            assert arcs.whole_turn, lengths
            assert arcs.arcs[0].length == TURN
            continue
        kinds[len(expected)] += 1
        assert not arcs.whole_turn, lengths
        assert len(arcs.arcs) == len(expected), lengths
        for arc in arc_ends(arcs):
            allowed = ROUNDINGS * max(end_error(lengths[0], lengths[3], q) for q in arc)
            assert any(same_arc(arc, w, allowed) for w in expected), (lengths, arc, expected)
    assert min(kinds.values()) > 8, kinds


def test_double_rocker_has_two_arcs_that_end_folded_and_extended():
    limits = fourbar(4.0, 3.0, 2.0, 3.5).compile().limits()
    assert words(limits) == [
        ("dyad extended", "dyad folded"),
        ("dyad folded", "dyad extended"),
    ]
    assert limits.arc_at(1.0) is limits.arcs[1]
    assert limits.arc_at(1.0 - 3 * TURN) is limits.arcs[1]
    assert limits.arc_at(0.0) is None


def test_mechanism_closes_at_both_ends_of_an_arc_and_not_beyond():
    mechanism = fourbar(4.0, 3.0, 2.0, 3.5).compile()
    for start, end in arc_ends(mechanism.limits()):
        margin = mechanism.run(at=[start, end], want="dyad.margin", on_gap="mark")["dyad.margin"]
        assert (margin >= 0).all()
        outside = [start - 1e-12, end + 1e-12]  # far beyond the rounding of an end
        margin = mechanism.run(at=outside, want="dyad.margin", on_gap="mark")["dyad.margin"]
        assert (margin < 0).all()


def test_dyad_that_never_reaches_leaves_no_arc():
    limits = fourbar(1.0, 1.0, 1.0, 10.0).compile().limits()
    assert limits.arcs == ()
    assert not limits.whole_turn
    assert limits.nearest.block == "dyad"
    assert abs(limits.nearest.q) <= TOUCH  # B is nearest to D there
    assert limits.nearest.margin < 0
    assert limits.sentence() == "no feasible arc of crank.q: dyad never closes"
    assert "dyad never closes; it comes nearest at 0 rad" in str(limits)


# -- double roots ---------------------------------------------------------------------

TOUCH = 1e-12
"""[rad] place of a change point: noise 16 EPS of the margin over its curvature (above 0.1
here) and the width of the interpolant (0.14 rad), magnified by its 32 nodes."""


def test_parallelogram_turns_through_two_change_points():
    limits = fourbar(1.0, 3.0, 1.0, 3.0).compile().limits()
    assert limits.whole_turn
    (folded, extended) = limits.arcs[0].change_points
    assert (str(folded), str(extended)) == ("dyad folded", "dyad extended")
    assert abs(folded.q) <= TOUCH
    assert abs(extended.q - math.pi) <= TOUCH


def decimal_linkages(count):
    """Links of decimal lengths and like size, with a + d = b + c but for rounding."""
    chance = random.Random(5)
    lengths = []
    while len(lengths) < count:
        a, b, c = (chance.randint(10, 400) for _ in range(3))
        d = b + c - a
        if d > 0 and 20 * min(a, b, c, d) > max(a, b, c, d):
            lengths.append((a / 100, b / 100, c / 100, d / 100))
    return lengths


@pytest.mark.parametrize("lengths", decimal_linkages(24), ids=str)
def test_change_point_survives_decimal_lengths(lengths):
    a, b, c, d = lengths
    result = limits(fourbar(*lengths).compile())
    points = [str(p) for arc in result.arcs for p in arc.change_points]
    assert "dyad extended" in points  # at pi
    if abs(a - d) > abs(b - c) + 1e-9:  # never folds
        assert result.whole_turn
        assert points == ["dyad extended"]
    elif abs(a - d) < abs(b - c) - 1e-9:  # folds on the way
        assert words(result) == [("dyad folded", "dyad folded")]
    else:
        assert sorted(points) == ["dyad extended", "dyad folded"]


def test_rhombus_cannot_pass_where_its_pins_meet():
    limits = fourbar(2.0, 2.0, 2.0, 2.0).compile().limits()
    assert not limits.whole_turn
    assert words(limits) == [("dyad coincident", "dyad coincident")]
    assert abs(limits.arcs[0].length - TURN) <= 2 * TOUCH
    assert [str(p) for p in limits.arcs[0].change_points] == ["dyad extended"]


def narrow(width, crank=1.0, frame=3.0):
    """A four-bar that opens for ``width`` [rad] about pi only, and its folded distance."""
    q = math.pi - width / 2
    r = math.sqrt(crank**2 + frame**2 - 2 * crank * frame * math.cos(q))
    rocker = 2.5
    return (crank, rocker + r, rocker, frame), q


@pytest.mark.parametrize("width", [1e-3, 1e-6])
@pytest.mark.parametrize("gap", [False, True])
def test_arc_or_gap_far_narrower_than_the_samples_is_found(width, gap):
    (a, b, c, d), start = narrow(width)
    result = limits(fourbar(a, b - 2 * c if gap else b, c, d).compile())
    assert result.spacing > 8 * width
    assert not result.whole_turn
    (arc,) = arc_ends(result)
    # The lengths are rounded as well as what is computed from them, so twice.
    allowed = 2 * ROUNDINGS * end_error(a, d, start)
    assert same_arc(arc, (-start, start) if gap else (start, TURN - start), allowed)


# -- other groups ---------------------------------------------------------------------


def test_slider_crank_is_ended_where_its_rod_stands_across_the_guide():
    limits = slider_crank(1.0, 3.0, 2.5).compile().limits()
    assert words(limits) == [("dyad tangent", "dyad tangent")]
    expected = math.asin(-0.5)  # sin q = (offset - rod) / crank
    # d(sin q) has 4 roundings of numbers below 3; dq = d(sin q) / cos q.
    allowed = 4 * 3 * EPS / math.cos(expected)
    assert same_arc(arc_ends(limits)[0], (expected, math.pi - expected), allowed)


def test_lever_with_offset_guide_is_ended_where_the_pin_comes_too_near():
    crank, frame, h = 1.0, 2.0, 1.5
    limits = slotted_lever(crank, frame, h).compile().limits()
    assert words(limits) == [("dyad tangent", "dyad tangent")]
    cosine = (crank**2 + frame**2 - h**2) / (2 * crank * frame)  # |BD| = h
    q = math.acos(cosine)
    assert same_arc(arc_ends(limits)[0], (q, TURN - q), ROUNDINGS * end_error(crank, frame, q))


def test_crank_pin_through_the_levers_pivot_ends_the_turn():
    assert slotted_lever(1.0, 1.5).compile().limits().whole_turn
    limits = slotted_lever(1.0, 1.0).compile().limits()
    assert words(limits) == [("dyad coincident", "dyad coincident")]


def test_parallel_guides_end_the_arcs_of_a_turning_guide():
    limits = turning_guide(0.4).compile().limits()
    assert words(limits) == [("dyad parallel", "dyad parallel")] * 2
    (before, after) = arc_ends(limits)
    assert same_arc(before, (0.4 - math.pi, 0.4), TOUCH)
    assert same_arc(after, (0.4, 0.4 + math.pi), TOUCH)


def test_slide_is_ended_on_both_sides():
    mechanism = pushed(2.0, 1.5, 3.0 + 1.0j).compile()
    limits = mechanism.limits()
    assert limits.unit == "m"
    assert words(limits) == [("dyad extended", "dyad extended")]
    half = math.sqrt(3.5**2 - 1.0)
    # |BD| = 3.5 with ROUNDINGS of it; dx = |BD| d|BD| / half.
    allowed = ROUNDINGS * EPS * 3.5**2 / half
    (start, end) = arc_ends(limits)[0]
    assert abs(start - (3.0 - half)) <= allowed
    assert abs(end - (3.0 + half)) <= allowed


def test_a_rack_is_searched_for_a_turn_of_its_wheels():
    """Its arcs repeat without end: half a minute went by over 2761 of them."""
    document = bm.Graph.load(GRAPHS / "rack_gripper.json")
    drawing = document.compile().limits()
    assert words(drawing) == [("unlimited", "unlimited")]
    period = math.tau * document.compile().parameters()["upper_mesh.radius"].value
    q = [point.q for point in drawing.arcs[0].change_points]
    assert max(q) - min(q) > period
    limits = document.replace({"frame.E.y": 0.03}).compile().limits()
    assert 1 < len(limits.arcs) < 300
    for arc, repeated in zip(limits.arcs[1:], limits.arcs[3:-1], strict=False):
        assert repeated.start.q - arc.start.q == pytest.approx(period, rel=1e-9)


def test_slide_that_no_group_ends_is_unlimited():
    g = bm.Graph("ram")
    g.add("frame", bm.Frame(markers={"G": bm.Marker(at=(0.0, 0.0), angle=0.0)}))
    g.add("ram", bm.SlideDrive())
    limits = wire(g, "frame.G ram.S").compile().limits()
    assert words(limits) == [("unlimited", "unlimited")]
    assert arc_ends(limits) == [(-math.inf, math.inf)]
    assert limits.to_dict()["arcs"][0]["start"] == {"q": None, "block": "", "how": "unlimited"}


# -- several groups, several drivers --------------------------------------------------


def chain():
    """A full-turning four-bar whose rocker works a second dyad that cannot follow."""
    g = fourbar(2.0, 6.0, 3.0, 5.5)
    frame = bm.Frame(markers={"A": (0.0, 0.0), "D": (5.5, 0.0), "F": (9.0, 0.0)})
    links = {"j": bm.Link(markers={"E": (4.0, 1.0)})}
    g.blocks["frame"] = frame
    g.blocks["dyad"] = bm.RRR(l_i=6.0, l_j=3.0, links=links)
    g.add("last", bm.RRR(l_i=3.5, l_j=2.5))
    return wire(g, "dyad.E last.B", "frame.F last.D")


def test_group_that_ends_an_arc_is_named():
    mechanism = chain().compile()
    limits = mechanism.limits()
    assert words(limits) == [("last extended", "last extended")]
    assert mechanism.limits(blocks=["dyad"]).whole_turn


@pytest.mark.parametrize("seed", range(40))
def test_random_mechanisms_close_on_their_arcs_and_nowhere_else(seed):
    plain = {"masses": False, "loads": False, "springs": False, "friction": False}
    case = random_mechanism(Seeded(seed), Options(groups=(1, 5), **plain))
    mechanism = case.graph.compile()
    for driver in mechanism.drivers:
        home = case.request["at"][driver]
        rest = {d: q for d, q in case.request["at"].items() if d != driver}
        limits = mechanism.limits(driver, rest)
        assert limits.arc_at(home) is not None, case
        about = np.linspace(-math.pi, math.pi, 2001)
        q = about if limits.unit == "rad" else home + 2 * about
        at = {**rest, driver: q}
        rates = dict.fromkeys(at, 0.0)
        run = mechanism.run(at=at, rates=rates, want="*.margin", on_gap="mark")
        closes = np.all([run[name] >= 0 for name in run], axis=0)
        inside = np.array([limits.arc_at(x) is not None for x in q.tolist()])
        assert (closes == inside).all(), case


def test_other_drivers_are_held():
    mechanism = fivebar().compile()
    limits = mechanism.limits("left", at={"right": 0.0})
    # The right pin is at [5, 0]; the left one may be 6 m away: it turns fully, touching pi.
    assert limits.whole_turn
    (point,) = limits.arcs[0].change_points
    assert str(point) == "dyad extended"
    assert abs(point.q - math.pi) <= TOUCH
    assert mechanism.limits("left", at={"right": math.pi}).arcs[0].change_points == ()
    assert mechanism.limits("left", at={"right": "180deg"}).held == {"right": math.pi}
    with pytest.raises(bm.RequestError, match=r"at\[right\].*'180 mm'"):
        mechanism.limits("left", at={"right": "180 mm"})


def test_other_drivers_begin_where_their_laws_do():
    g = fivebar()
    g.drive("right", bm.motion.ConstantRate(rate=1.0, start=math.pi))
    assert g.compile().limits("left").held == {"right": math.pi}
    g = fivebar()
    g.start("right", q=2.0)
    assert g.compile().limits("left").held == {"right": 2.0}


# -- what is said ---------------------------------------------------------------------


def test_limits_are_data():
    limits = fourbar(4.0, 3.0, 2.0, 3.5).compile().limits()
    document = json.loads(json.dumps(limits.to_dict()))
    assert document["driver"] == "crank.q"
    assert document["unit"] == "rad"
    assert document["whole_turn"] is False
    assert [a["end"]["how"] for a in document["arcs"]] == ["folded", "extended"]
    assert [a["end"]["q"] for a in document["arcs"]] == [a.end.q for a in limits.arcs]
    assert str(limits).splitlines()[0] == "crank.q: 2 feasible arcs"
    assert "deg long" in limits.to("deg").text()
    assert str(limits).splitlines()[-1].startswith("  singular poses of the second kind")
    assert "second kind" not in str(fourbar(1.0, 3.0, 2.0, 3.5).compile().limits())


def test_assembly_error_names_the_feasible_arcs():
    mechanism = fourbar(4.0, 3.0, 2.0, 3.5).compile()
    with pytest.raises(bm.AssemblyError) as caught:
        mechanism.run(at=[1.0, 2.0])
    sentence = mechanism.limits().sentence()
    assert sentence.startswith("feasible arcs of crank.q: [-1.45446268, -0.231974804], [0.23197")
    assert f"{sentence}." in str(caught.value)
    assert arcs_sentence(mechanism, {"crank": 2.0}) == sentence


def test_error_of_an_early_group_does_not_blame_a_later_one():
    mechanism = chain().compile()
    with pytest.raises(bm.AssemblyError, match=r"feasible arc of crank\.q"):
        mechanism.run(at=[3.0])
    assert mechanism.run(at=[3.0], want="dyad.margin")["dyad.margin"][0] > 0


WRONG = [
    ({}, "limits", "the mechanism has 2 drivers"),
    ({"driver": "crank"}, "crank", 'no driver "crank"'),
    ({"driver": "left"}, "right", "nothing says where this driver is held"),
    ({"driver": "left", "at": {"left": 1.0, "right": 1.0}}, "at[left]", "is the one that moves"),
    ({"driver": "left", "at": {"right": math.nan}}, "at[right]", "not a finite number"),
    ({"driver": "left", "at": {"left": 1.0, "x": 1.0}}, "at[x]", "there is no such driver"),
    ({"driver": "left", "at": {"left": 1.0, "x": 1.0}}, "right", "nothing says where"),
    ({"driver": "left", "at": {"right": 1.0}, "samples": 3}, "samples", "got 3"),
]


@pytest.mark.parametrize(("request_", "where", "message"), WRONG)
def test_wrong_requests_are_named(request_, where, message):
    with pytest.raises(bm.RequestError) as caught:
        fivebar().compile().limits(**request_)
    assert any(p.where == where and message in p.found for p in caught.value.problems)


def test_failing_run_is_explained_in_under_50_ms():
    mechanism = fourbar(4.0, 3.0, 2.0, 3.5).compile()
    arcs_sentence(mechanism, {})  # imports and plans once
    spent = []
    for _ in itertools.repeat(None, 5):
        start = time.process_time()
        arcs_sentence(mechanism, {})
        spent.append(time.process_time() - start)
    assert min(spent) < 0.05


def test_assembly_error_of_two_drivers_names_the_arcs_of_each_with_the_other_held():
    a, b = 2.0, math.pi / 2
    with pytest.raises(bm.AssemblyError) as caught:
        fivebar(apart=3.0, rod=1.5).compile().run(at={"left": a, "right": b}, want="dyad.C.p")
    # The pins are at most 3 m apart: |D - e^(i a)| <= 3 and |3 - B + e^(i b)| <= 3.
    D, w = 3 + cmath.exp(1j * b), 3 - cmath.exp(1j * a)
    half = math.acos((abs(D) ** 2 + 1 - 9) / (2 * abs(D)))
    arc_a = [cmath.phase(D) - half, cmath.phase(D) + half]
    half = math.acos((abs(w) ** 2 + 1 - 9) / (2 * abs(w)))
    arc_b = [cmath.phase(-w) + sign * half for sign in (-1, 1)]
    text = str(caught.value)
    for driver, (start, end) in (("left", arc_a), ("right", arc_b)):
        assert f"feasible arc of {driver}.q: [{start:.9g}, {end:.9g}] rad" in text
    assert "each with the others held" in text


def test_every_loop_of_a_long_row_passes_its_two_change_points():
    limits = mechanism("parallelogram_chain").limits()
    assert limits.whole_turn
    angles = [p.q for p in limits.arcs[0].change_points]
    assert len(angles) == 2 * 30
    # Each cell moves the next one's double root.
    allowed = 30 * math.sqrt(EPS)
    assert max(min(abs(q), abs(q - math.pi)) for q in angles) <= allowed


def test_change_points_behind_change_points_are_as_exact_as_the_first():
    """Thirty parallelograms in a row: margins behind a touch have a corner there, and each was
    halved towards it until rounding hid it, 5e-8 rad away."""
    (arc,) = mechanism("parallelogram_chain").limits().arcs
    points = np.array([p.q for p in arc.change_points])
    assert len(points) == 2 * 30
    assert np.abs(np.sin(points)).max() <= 1e-11


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("name", "analysis"), [("floating_drive_press", "limits"), ("n_four_bar", "modes")]
)
def test_labels_leave_room_for_the_bars(name, analysis):
    mechanism = bm.Linkage.load(f"graphs/joints/{name}.json").compile()
    figure = getattr(mechanism, analysis)().figure()
    figure.draw_without_rendering()
    assert figure.axes[0].get_position().width > 0.9


def test_a_link_without_length_says_where_it_closes_without_a_warning():
    document = bm.Graph.load(GRAPHS / "rack_gripper.json").replace({"upper_finger.l_i": 5e-324})
    with pytest.raises(bm.AssemblyError, match="upper_finger"):
        document.compile().run(at=[0.1, 0.7])
