"""Formation sequences: drivers and minimal Assur groups, classes, waiting links, pins."""

from __future__ import annotations

import random
from collections import defaultdict

import networkx as nx
import pytest

from blockmech.assur.diagnosis import diagnose
from blockmech.assur.formation import formation, reseat
from blockmech.assur.groups import Pair
from blockmech.assur.rigidity import rigidity
from tests.assur.structures import (
    CLASS_IV,
    FOUR_BAR,
    FRAME,
    TRIAD,
    chain,
    check_units,
    dyad_chain,
    random_mechanism,
    sequence,
)
from tests.soon import answered


def test_four_bar_is_a_crank_and_a_dyad() -> None:
    assert sequence(FOUR_BAR, "O") == "I(crank) -> II RRR(rocker, rod)"


def test_stephenson_six_bar_driven_at_its_dyad_is_a_triad() -> None:
    stephenson = "O:frame-crank A:crank-t B:t-x C:t-y D:x-frame E:y-frame"
    # crank on the ternary link: a dyad cannot be closed before the whole is
    result = formation(
        *chain("O:frame-crank A:crank-x " + "B:x-t C:t-y D:t-z E:y-frame F:z-frame"), FRAME, ["O"]
    )
    assert [(u.kind, u.number) for u in result.units] == [("driver", 1), ("triad", 3)]
    assert result.units[1].links[0] == "t"
    assert rigidity(*chain(stephenson), FRAME, ["O"]).redundant == 1


@pytest.mark.parametrize(
    ("kinds", "expected"),
    [
        ("RRR", "RRR"), ("RRP", "RRP"), ("PRR", "RRP"), ("RPR", "RPR"),
        ("PRP", "PRP"), ("RPP", "RPP"), ("PPR", "RPP"),
    ],
)  # fmt: skip
def test_dyads_are_recognised_either_way_round(kinds: str, expected: str) -> None:
    links, pairs = chain(f"B:frame-i:{kinds[0]} C:i-j:{kinds[1]} D:j-frame:{kinds[2]}")
    (unit,) = formation(links, pairs, FRAME).units
    assert unit.kind == expected
    feet = {a: p for p in unit.outer for a in p.links if a != "frame"}
    letters = feet[unit.links[0]].kind + unit.inner[0].kind + feet[unit.links[1]].kind
    assert letters == expected
    assert [p.name for p in unit.outer] == [feet[a].name for a in unit.links]


def test_triad_is_class_three_with_the_ternary_link_first() -> None:
    result = formation(*chain("O:frame-crank " + TRIAD), FRAME, ["O"])
    assert str(result) == "I(crank) -> III triad(t, x, y, z)"


def test_a_closed_contour_of_four_links_is_class_four() -> None:
    result = formation(*chain("O:frame-crank " + CLASS_IV), FRAME, ["O"])
    assert str(result) == "I(crank) -> IV(a, b, t, u)"
    assert len(result.units[1].outer) == 2


def test_two_joined_ternary_links_are_class_three_of_order_four() -> None:
    text = "A:t-u B:t-a C:t-b D:u-c E:u-d F:a-frame G:b-frame H:c-frame I:d-frame"
    (unit,) = formation(*chain(text), FRAME).units
    assert (unit.kind, unit.number, len(unit.outer)) == ("group", 3, 4)


def test_elliptic_trammel_and_oldham_have_their_dyads() -> None:
    trammel = "S:frame-slider:P A:slider-bar B:bar-shoe T:frame-shoe:P"
    assert sequence(trammel, "S") == "I(slider) -> II RRP(bar, shoe)"
    oldham = "O:frame-left A:left-disc:P B:disc-right:P C:right-frame"
    assert sequence(oldham, "O") == "I(left) -> II RPP(right, disc)"


def test_two_drivers_of_a_five_bar_come_first() -> None:
    five = "O:frame-a A:a-b B:b-c C:c-d D:d-frame"
    assert sequence(five, "O", "D") == "I(a) -> I(d) -> II RRR(b, c)"


def test_cylinder_between_two_pivots() -> None:
    links, pairs = chain("B:frame-barrel S:barrel-rod:P C:rod-boom D:boom-frame")
    for order in (pairs, [Pair("S", "rod", "barrel", "P"), *pairs[:1], *pairs[2:]]):
        (unit,) = formation(links, order, FRAME, ["S"]).units
        assert (unit.kind, unit.number, unit.driven) == ("cylinder", 2, ("S",))
        assert unit.links == ("barrel", "rod", "boom")


def test_driver_between_moving_links_sits_inside_a_group() -> None:
    # a four-bar driven at its coupler's pin: 3 links, 4 pairs, one driven
    result = formation(*chain(FOUR_BAR), FRAME, ["A"])
    (unit,) = result.units
    assert (unit.kind, unit.driven) == ("group", ("A",))
    assert 3 * len(unit.links) == 2 * len(unit.pairs) + 1
    assert unit.number == 2  # crank and rod welded: a dyad


def test_units_come_in_the_same_order_whatever_the_order_of_the_arguments() -> None:
    rng = random.Random(4)
    links, pairs = chain(FOUR_BAR + " D:rocker-e E:e-f F:f-frame " + TRIAD + " G:frame-h:P")
    expected = formation(links, pairs, FRAME, ["O", "G"])
    state = rigidity(links, pairs[:-2], FRAME, ["O"])
    for _ in range(20):
        rng.shuffle(links)
        shuffled = rng.sample(pairs, len(pairs))
        assert formation(links, shuffled, FRAME, ["G", "O"]) == expected
        fewer = [p for p in shuffled if p not in pairs[-2:]]
        assert rigidity(links, fewer, FRAME, ["O"]) == state


def test_a_dyad_with_both_feet_on_one_pin_cannot_be_placed() -> None:
    text = "O:frame-crank A:crank-i:R@pin B:i-j C:j-crank:R@pin"
    result = formation(*chain(text), FRAME, ["O"])
    assert ([u.kind for u in result.units], result.rest) == (["driver"], ("i", "j"))


def test_a_pair_between_placed_links_is_left_over() -> None:
    links, pairs = chain(FOUR_BAR + " X:frame-base")
    result = formation(links, pairs, ["frame", "base"], ["O"])
    assert (result.rest, result.spare, result.complete) == ((), ("X",), False)
    (o,) = rigidity(links, pairs, ["frame", "base"], ["O"]).overconstrained
    assert (o.links, o.pairs, o.excess) == (("base", "frame"), ("X",), 2)


def test_random_mechanisms_come_apart_into_what_they_were_made_of() -> None:
    rng = random.Random(11)
    for trial in range(120):
        links, pairs, drivers, sizes = random_mechanism(rng, shared=trial % 2 * 0.6)
        result = formation(links, pairs, FRAME, drivers)
        assert result.complete
        assert sorted(len(u.links) for u in result.units) == sizes
        assert "group" not in {u.kind for u in result.units if u.number < 4}
        check_units(result.units, pairs, drivers)
        assert rigidity(links, pairs, FRAME, drivers).determinate


def test_reseated_pins_give_the_smallest_groups_whatever_their_pairs_were() -> None:
    rng, larger = random.Random(3), 0
    for _ in range(80):
        links, pairs, drivers, sizes = random_mechanism(rng, shared=0.7)
        at: dict[str, list[Pair]] = defaultdict(list)
        for p in pairs:
            at[p.axis].append(p)
        mixed = []
        for pin in at.values():  # the same pin, its links joined in another way
            tree = [p for p in pin if p.name in drivers]
            graph = nx.Graph([p.links for p in tree])
            todo = [p.name for p in pin if p.name not in drivers]
            ends = sorted({a for p in pin for a in p.links})
            graph.add_nodes_from(ends)
            while todo:
                a, b = rng.sample(ends, 2)
                if not nx.has_path(graph, a, b):
                    graph.add_edge(a, b)
                    tree.append(Pair(todo.pop(), a, b, pin[0].kind, pin[0].axis))
            mixed += tree
        before = formation(links, mixed, FRAME, drivers)
        seated = reseat(links, mixed, FRAME, drivers)
        after = formation(links, seated, FRAME, drivers)
        assert before.complete
        assert after.complete
        assert sorted(len(u.links) for u in after.units) == sizes
        assert {p.name for p in seated} == {p.name for p in pairs}
        assert reseat(links, seated, FRAME, drivers) == seated
        larger += len(before.units) < len(after.units)
    assert larger > 8  # the mixing did harm, else nothing was shown


def test_a_thousand_dyads_are_taken_apart_soon() -> None:
    links, pairs = dyad_chain(1000, random.Random(1))
    with answered():
        result = formation(links, pairs, FRAME, ["O"])
        assert result.complete
        assert [len(u.links) for u in result.units] == [1] + [2] * 1000
        assert rigidity(links, pairs, FRAME, ["O"]).determinate
        missing = {f.code for f in diagnose(links, pairs[1:], FRAME, ["O"])}
        assert missing == {"too-few-drivers", "loose-links"}
    twice = [Pair(f"X{p.name}", p.first, p.second) for p in pairs[:10]]
    with answered():
        assert diagnose(links, pairs + twice, FRAME, ["O"])
