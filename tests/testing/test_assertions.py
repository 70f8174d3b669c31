"""``assert_graph``: what holds chains, what does not is said in a sentence."""

from __future__ import annotations

import math
import re

import pytest

import blockmech as bm
from blockmech.testing import assert_graph
from tests.machines import ruiz, wire

OWN_SIZE = 1e-11  # what the project promises of driving efforts with friction
REACH = math.acos(9.25 / 22)  # crank angle at which the dyad of `short` is stretched


def said(call, *arguments, **named):
    """The sentence of an assertion that must fail."""
    with pytest.raises(AssertionError) as caught:
        call(*arguments, **named)
    return str(caught.value)


def test_what_holds_chains(ruiz, rows):
    checked = assert_graph(ruiz)
    assert (
        checked.is_formation_sequence()
        .is_formation_sequence("crank", "dyad")
        .has_mobility(1)
        .closes_on("crank", 0, 2 * math.pi)
        .balances()
        .has_output("dyad.j.omega", at=1.0, value=rows[1]["omega"]["3"], rtol=OWN_SIZE)
    ) is checked


def test_another_formation_sequence_is_named(ruiz):
    assert said(assert_graph(ruiz).is_formation_sequence, "dyad", "crank") == (
        "ruiz_fourbar: expected the formation sequence dyad -> crank, found crank -> dyad"
    )


def test_another_mobility_is_named_with_its_counts(ruiz):
    assert said(assert_graph(ruiz).has_mobility, 2) == (
        "ruiz_fourbar: expected mobility 2, found 1 (3 moving links, 4 pairs)"
    )


def test_an_unfinished_graph_fails_every_question_with_its_problems(arm):
    arm.add("couple", bm.Couple(moment=1.0))
    for question in (
        assert_graph(arm).is_formation_sequence,
        lambda: assert_graph(arm).has_mobility(1),
        lambda: assert_graph(arm).closes_on("crank", 0, 1),
        assert_graph(arm).balances,
    ):
        text = said(question)
        assert text.startswith("arm: expected a valid mechanism, found [unwired-joint] couple.on")


# -- fails_with ------------------------------------------------------------------------------


def waiting_for_each_other():
    """Two dyads that feed each other."""
    g = bm.Graph("waiting")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (3.0, 0.0)}))
    for one, pivot in (("left", "A"), ("right", "D")):
        g.add(one, bm.RRR(l_i=1.0, l_j=1.0))
        g.connect(f"frame.{pivot}", f"{one}.B")
    return wire(g, "left.C right.D", "right.C left.D")


def test_a_problem_that_is_there_passes():
    assert_graph(waiting_for_each_other()).fails_with("cycle").fails_with("cycle", "left, right")


def test_another_problem_is_named():
    text = said(assert_graph(waiting_for_each_other()).fails_with, "unwired-joint", "left.B")
    assert text.startswith(
        'waiting: expected the problem "unwired-joint" at left.B, found [cycle] left, right'
    )


def test_a_valid_mechanism_has_no_problem(arm):
    assert said(assert_graph(arm).fails_with, "cycle") == (
        'arm: expected the problem "cycle", found no problem: the mechanism is valid'
    )


def test_a_file_is_asked_like_a_graph(arm, tmp_path):
    file = tmp_path / "arm.json"
    arm.save(file)
    assert_graph(file).has_mobility(1).has_output("crank.q", at=0.5, value=0.5, atol=0)
    spoiled = file.read_text(encoding="utf-8").replace('"length"', '"lenght"')
    file.write_text(spoiled, encoding="utf-8")
    assert_graph(file).fails_with("unknown-key", "blocks.crank.lenght")
    assert str(file) in said(assert_graph(file).has_mobility, 1)


# -- closes_on -------------------------------------------------------------------------------


@pytest.mark.parametrize("turns", [0, 1, -3])
@pytest.mark.parametrize("way", [1, -1])
def test_a_driver_closes_up_to_the_dead_centre_whatever_the_turn(short, turns, way):
    # REACH is known to an ulp and q = 2 pi turns + REACH to an ulp of its size.
    ends = [2 * math.pi * turns + way * REACH, 2 * math.pi * turns - way * REACH]
    assert_graph(short).closes_on("crank", *ends)


@pytest.mark.parametrize(
    ("start", "end"), [(0.0, REACH + 1e-9), (-REACH - 1e-9, 0.0), (2.0, 4.0), (0.0, 2 * math.pi)]
)
def test_a_driver_that_passes_a_dead_centre_is_told_where_it_is(short, start, end):
    text = said(assert_graph(short).closes_on, "crank", start, end)
    assert f"from {start:.9g} to {end:.9g} rad" in text
    assert "dyad extended" in text
    assert f"{REACH:.12g}"[:12] in text


# -- balances --------------------------------------------------------------------------------


def test_a_mechanism_that_never_closes_has_nothing_to_balance(short):
    assert said(assert_graph(short).balances, at=[3.0]) == (
        "short: expected balances, found no sample with an answer to balance"
    )


# -- has_output ------------------------------------------------------------------------------


def test_vectors_may_be_complex_or_pairs(arm):
    for value in (2j, [0.0, 2.0], [[0.0, 2.0]], [2j]):
        assert_graph(arm).has_output("crank.B.p", at=math.pi / 2, value=value, rtol=1e-15)
    both = [[2.0, 0.0], [0.0, 2.0]]
    assert_graph(arm).has_output("crank.B.p", at=[0.0, math.pi / 2], value=both, rtol=1e-15)


def test_samples_by_time_and_settings_are_those_of_run(arm):
    assert_graph(arm).has_output("crank.q", times=[0.0, 2.0], value=[0.0, 6.0], rtol=1e-15)
    assert_graph(arm).has_output("crank.rate", at=0.0, rates=7.0, value=7.0, rtol=1e-15)


def test_a_number_that_is_not_met_is_shown_with_all_that_matters(short):
    text = said(
        assert_graph(short).has_output, "dyad.C.p", at=[0.0, 3.0], value=[5.0, 6.0j], atol=1e-6
    )
    head, *table = text.splitlines()
    assert head == "short: expected dyad.C.p within its tolerance, found 2 of 2 not met:"
    heads = "output|sample: drivers [rad, m]|expected|got|error|tolerance|margin"
    assert re.split(" {2,}", table[0]) == heads.split("|")
    assert table[1].startswith("dyad.C.p [m]  1: crank = 3")
    assert "no-assembly (dyad)" in table[1]
    assert table[2].startswith("dyad.C.p [m]  0: crank = 0")
    assert "[3.75, 1.78535710714]" in table[2]  # 1.785... = sqrt(2.5^2 - 1.75^2)
    assert "1e-06" in table[2]


@pytest.mark.parametrize(
    ("request_", "part"),
    [
        ({"name": "crank.q", "value": 0.0, "rtol": 1.0}, "no samples are named"),
        ({"name": "crank.q", "value": 0.0, "at": 0.0}, "no tolerance is given"),
        ({"name": "crank.*", "value": 0.0, "at": 0.0, "rtol": 1.0}, "is a pattern"),
        ({"name": "crank.qq", "value": 0.0, "at": 0.0, "rtol": 1.0}, "no output has that name"),
        ({"name": "crank.q", "value": [0.0, 1.0], "at": 0.0, "rtol": 1.0}, "has 2 values, needs 1"),
        ({"name": "crank.q", "value": 1j, "at": 0.0, "rtol": 1.0}, "the output is a number"),
        ({"name": "crank.B.p", "value": 1.0, "at": 0.0, "rtol": 1.0}, "is a vector [x, y]"),
        ({"name": "crank.q", "value": "1", "at": 0.0, "rtol": 1.0}, "give finite numbers"),
        ({"name": "crank.q", "value": math.nan, "at": 0.0, "rtol": 1.0}, "finite"),
    ],
)
def test_a_question_without_sense_is_refused(arm, request_, part):
    with pytest.raises(bm.RequestError) as caught:
        assert_graph(arm).has_output(**request_)
    assert part in str(caught.value)


# ---- schedules ---------------------------------------------------------------------------


def test_a_schedule_is_what_the_outputs_take_in_an_order_that_works():
    calls = [("crank", "position"), ("dyad", "position")]
    assert_graph(ruiz()).schedules("dyad.C.p", *calls)
    with pytest.raises(AssertionError, match="expected the order dyad position, crank position"):
        assert_graph(ruiz()).schedules("dyad.C.p", *calls[::-1])
    with pytest.raises(AssertionError, match="found crank position, dyad position"):
        assert_graph(ruiz()).schedules("dyad.C.p", calls[0])
