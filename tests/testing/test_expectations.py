"""The numbers under ``expect``: computed, compared, and never met by silence."""

from __future__ import annotations

import json
import math

import pytest

import blockmech as bm
from blockmech.testing import check_expectations
from tests import machines

ROUNDING = 1e-14  # a few ulps of numbers of size 1 to 10
OWN_SIZE = 1e-11  # of reactions with friction, what the project promises


def expecting(graph, at, want, **settings):
    """The graph with one entry."""
    entry = {"source": "by hand", "at": at, "want": want, **settings}
    graph.extras["expect"] = [*graph.extras.get("expect", []), entry]
    return graph


def only(outcomes):
    assert len(outcomes) == 1
    return outcomes[0]


def test_the_friction_method_of_the_entry_is_used(ruiz, rows):
    at = {"crank": [r["crank"] for r in rows]}
    smooth = {"crank.drive": [r["frictionless_driving_moment"] for r in rows]}
    expecting(ruiz, at, smooth, rtol=OWN_SIZE, friction="none")
    expecting(ruiz, at, smooth, rtol=OWN_SIZE)
    outcomes = check_expectations(ruiz)
    assert all(o.ok for o in outcomes if o.entry == 0)
    assert not any(o.ok for o in outcomes if o.entry == 1)


def test_fixed_iterations_of_the_entry_are_used(ruiz, rows):
    first = rows[0]["iterates"][1]["driving_moment"]
    settings = {"rtol": OWN_SIZE, "friction": "successive", "iterations": 1}
    expecting(ruiz, {"crank": [0.0]}, {"crank.drive": [first]}, **settings)
    assert only(check_expectations(ruiz)).ok


def test_an_outcome_holds_all_that_a_reader_needs(arm):
    expecting(arm, {"crank": [1.0, 0.0]}, {"crank.B.v": [[0.0, 0.0], [0.0, 6.5]]}, atol=0.25)
    first, second = check_expectations(arm)
    assert second.expected == 6.5j
    assert second.got == 6j
    assert (second.unit, second.sample, second.drivers) == ("m/s", 1, {"crank": 0.0})
    assert (second.error, second.tolerance, second.ok) == (0.5, 0.25, False)
    assert second.to_dict() == {
        "output": "crank.B.v",
        "unit": "m/s",
        "sample": 1,
        "drivers": {"crank.q": 0.0},
        "expected": [0.0, 6.5],
        "got": [0.0, 6.0],
        "tolerance": 0.25,
        "error": 0.5,
        "margin": None,
        "ok": False,
    }
    json.dumps(first.to_dict(), allow_nan=False)


def test_the_margin_is_the_smallest_of_the_groups_at_the_sample(short):
    expecting(short, {"crank": [0.0, 1.0]}, {"dyad.C.p": [[0.0, 0.0]] * 2}, atol=10.0)
    margins = [o.margin for o in check_expectations(short)]
    # sin^2 of the angle at C, by the law of cosines with sides 2.5, 2.5 and BD
    cosines = [1 - (34.25 - 22 * math.cos(q)) / 12.5 for q in (0.0, 1.0)]
    assert margins == pytest.approx([1 - c * c for c in cosines], rel=ROUNDING)


# -- tolerances ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rtol", "atol", "met"), [(0.11, 0.0, True), (0.09, 0.0, False), (0.0, 0.4, True)]
)
def test_rtol_is_relative_to_the_expected_number_and_the_larger_tolerance_counts(
    arm, rtol, atol, met
):
    expecting(arm, {"crank": [0.0]}, {"crank.rate": [10 / 3]}, rtol=rtol, atol=atol)
    outcome = only(check_expectations(arm))
    assert outcome.tolerance == pytest.approx(max(rtol * 10 / 3, atol))
    assert outcome.ok is met


def test_a_vector_is_as_large_as_its_length(arm):
    # At q = pi the y of B is 2 sin(pi) = 2.4e-16 in doubles, but 0 by hand.
    expecting(arm, {"crank": [math.pi]}, {"crank.B.p": [[-2.0, 0.0]]}, rtol=ROUNDING)
    assert only(check_expectations(arm)).ok


def test_a_zero_is_as_large_as_the_largest_number_beside_it(arm):
    turn = [0.0, math.pi / 2, math.pi]
    want = {"crank.B.p": [[2.0, 0.0], [0.0, 2.0], [-2.0, 0.0]], "crank.q": turn}
    expecting(arm, {"crank": turn}, want, rtol=ROUNDING)
    outcomes = check_expectations(arm)
    assert all(o.ok for o in outcomes)
    zero = next(o for o in outcomes if o.output == "crank.q" and o.expected == 0)
    assert zero.tolerance == ROUNDING * math.pi


def test_zeros_alone_are_met_exactly_or_say_what_is_missing(arm):
    expecting(arm, {"crank": [0.0]}, {"crank.q": [0.0], "crank.rate": [0.0]}, rtol=1e-3)
    exact, off = check_expectations(arm)
    assert exact.ok
    assert not off.ok
    assert "atol" in off.reason


def test_angles_are_compared_modulo_a_turn_and_driver_coordinates_are_not(arm):
    turned = [-math.pi, 4.0 + 2 * math.pi]
    want = {"crank.crank.angle": turned, "crank.q": turned}
    expecting(arm, {"crank": [math.pi, 4.0]}, want, rtol=1e-12)
    assert [o.ok for o in check_expectations(arm)] == [True, True, False, False]


# -- no answer -------------------------------------------------------------------------------


def test_a_sample_without_an_answer_is_not_met_and_says_why(short):
    expecting(short, {"crank": [0.0, 3.0]}, {"dyad.C.p": [[3.75, 1.8]] * 2}, atol=1e9)
    reached, lost = check_expectations(short)
    assert reached.ok
    assert not lost.ok
    assert (lost.got, lost.error) == (None, None)
    assert lost.reason == "no-assembly (dyad)"
    assert lost.margin < 0


def swinging(times, want, **options):
    """A uniform rod of 1 m that is let go at rest, horizontally."""
    graph = machines.crank(1.0, machines.bar(1.0, 1.0), gravity=9.81)
    graph.start("crank", q=0.0)
    motion = {"source": "closed form", "simulate": {"times": times, **options}, "atol": 1e-9}
    graph.extras["expect"] = [{**motion, "want": want}]
    return check_expectations(graph)


QUARTER = 1.8540746773013719 / math.sqrt(1.5 * 9.81)  # [s] K(k) / w, k^2 = 1/2, of a pendulum


def test_a_free_motion_is_computed_and_compared():
    outcomes = swinging([0.0, QUARTER], {"crank.q": [0.0, -math.pi / 2]})
    assert [o.ok for o in outcomes] == [True, True]


def test_times_after_the_end_of_a_motion_are_not_met():
    times, want = [2 * QUARTER, 9.0, 0.0], {"crank.q": [-math.pi, 0.0, 0.0]}
    outcomes = swinging(times, want, until="standstill")
    assert [o.sample for o in outcomes] == [0, 1, 2]
    assert [o.ok for o in outcomes][1:] == [False, True]
    assert "ended" in outcomes[1].reason
    assert "standstill" in outcomes[1].reason


def test_a_graph_without_expectations_has_no_outcome(arm):
    assert check_expectations(arm) == []


# -- one number a run, structural constants ----------------------------------------------------


def test_a_number_of_the_whole_run_is_one_value(arm):
    arm.blocks["crank"] = bm.Crank(
        length=2.0,
        links={"crank": bm.Link(mass=1.0, cm=(1.0, 0.0))},
    )
    arm.add("load", bm.Couple(moment=-5.0))
    arm.connect("crank.crank", "load.on")
    want = {"mechanism.friction_efficiency": [1.0]}  # nothing rubs
    expecting(arm, {"crank": [0.0, 1.0, 2.0]}, want, rtol=ROUNDING)
    assert only(check_expectations(arm)).ok


# -- wrong entries ---------------------------------------------------------------------------


def test_all_mistakes_of_all_entries_are_named_at_once(arm):
    expecting(arm, {"crank": [0.0]}, {"crank.qq": [0.0], "crank.B.p": [1.0]}, atol=1.0)
    expecting(arm, {"crnk": [0.0]}, {"crank.q": [0.0]}, atol=1.0)
    expecting(arm, {"crank": [0.0]}, {"crank.q": [[0.0, 0.0]], "crank.*": [0.0]}, atol=1.0)
    expecting(arm, {"crank": [0.0, 1.0]}, {"crank.q": [0.0]}, atol=1.0)
    with pytest.raises(bm.RequestError) as caught:
        check_expectations(arm)
    assert [(p.code, p.where) for p in caught.value.problems] == [
        ("unknown-output", 'expect[0].want["crank.qq"]'),
        ("bad-expectation", 'expect[0].want["crank.B.p"]'),
        ("bad-request", "expect[1].at"),
        ("bad-expectation", 'expect[2].want["crank.q"]'),
        ("bad-expectation", 'expect[2].want["crank.*"]'),
        ("bad-expectation", 'expect[3].want["crank.q"]'),
    ]
    assert "crnk" in str(caught.value)


def test_an_entry_written_wrongly_in_python_is_refused_like_one_in_a_file(arm):
    arm.extras["expect"] = [{"source": "by hand", "at": {"crank": [0.0]}, "want": {"crank.q": [0]}}]
    with pytest.raises(bm.FormatError) as caught:
        check_expectations(arm)
    problem = only(caught.value.problems)
    assert (problem.code, problem.where) == ("bad-expectation", "expect[0]")
