"""Structure alone: mobility, over-constrained and loose links, formation sequence.

Judges that share nothing with the code: the float rank of a velocity Jacobian at random
poses, and the exact count over all partitions of the links for pairs without shared axes.
"""

from __future__ import annotations

import itertools
import random
import time
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from typing import TypeAlias

import networkx as nx
import numpy as np
import pytest

from blockmech.model.assur import Unit, classify, formation, reseat, waiting
from blockmech.model.rigidity import Pair, diagnose, rigidity

FRAME = ("frame",)


def chain(text: str) -> tuple[list[str], list[Pair]]:
    """Links and pairs from words such as ``O:frame-crank S:frame-slider:P A:a-b:R@pin``."""
    pairs = []
    for word in text.split():
        name, ends, kind, *_ = [*word.split(":"), "R"]
        kind, _, axis = kind.partition("@")
        first, second = ends.split("-")
        assert kind in ("R", "P")
        pairs.append(Pair(name, first, second, "P" if kind == "P" else "R", axis))
    return sorted({a for p in pairs for a in p.links} - {"frame"}), pairs


def codes(text: str, *drivers: str) -> dict[str, tuple[str, ...]]:
    """Findings of a structure on the frame: code -> links."""
    return {f.code: f.links for f in diagnose(*chain(text), FRAME, drivers)}


def sequence(text: str, *drivers: str) -> str:
    """Formation sequence of a structure on the frame, which must be complete."""
    found = formation(*chain(text), FRAME, drivers)
    assert found.complete, found
    return str(found)


FOUR_BAR = "O:frame-crank A:crank-rod B:rod-rocker C:rocker-frame"
TRIAD = "TX:t-x TY:t-y TZ:t-z X:x-crank Y:y-frame Z:z-frame"
CLASS_IV = "K:t-a L:a-u M:u-b N:b-t T:t-frame U:u-crank"


# Formation sequences of known mechanisms.


def test_four_bar_is_a_crank_and_a_dyad() -> None:
    assert sequence(FOUR_BAR, "O") == "I(crank) -> II RRR(rocker, rod)"


def test_watt_six_bar_has_two_dyads_in_order() -> None:
    watt = FOUR_BAR + " D:rocker-e E:e-f F:f-frame"
    assert sequence(watt, "O") == "I(crank) -> II RRR(rocker, rod) -> II RRR(e, f)"


def test_stephenson_six_bar_driven_at_its_dyad_is_a_triad() -> None:
    stephenson = "O:frame-crank A:crank-t B:t-x C:t-y D:x-frame E:y-frame"
    # crank on the ternary link: a dyad cannot be closed before the whole is
    found = formation(
        *chain("O:frame-crank A:crank-x " + "B:x-t C:t-y D:t-z E:y-frame F:z-frame"), FRAME, ["O"]
    )
    assert [(u.kind, u.number) for u in found.units] == [("driver", 1), ("triad", 3)]
    assert found.units[1].links[0] == "t"
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
    found = formation(*chain("O:frame-crank " + TRIAD), FRAME, ["O"])
    assert str(found) == "I(crank) -> III triad(t, x, y, z)"


def test_a_closed_contour_of_four_links_is_class_four() -> None:
    found = formation(*chain("O:frame-crank " + CLASS_IV), FRAME, ["O"])
    assert str(found) == "I(crank) -> IV(a, b, t, u)"
    assert len(found.units[1].outer) == 2


def test_two_joined_ternary_links_are_class_three_of_order_four() -> None:
    text = "A:t-u B:t-a C:t-b D:u-c E:u-d F:a-frame G:b-frame H:c-frame I:d-frame"
    (unit,) = formation(*chain(text), FRAME).units
    assert (unit.kind, unit.number, len(unit.outer)) == ("group", 3, 4)


def test_elliptic_trammel_and_oldham_have_their_dyads() -> None:
    trammel = "S:frame-slider:P A:slider-bar B:bar-shoe T:frame-shoe:P"
    assert sequence(trammel, "S") == "I(slider) -> II RRP(bar, shoe)"
    oldham = "O:frame-left A:left-disc:P B:disc-right:P C:right-frame"
    assert sequence(oldham, "O") == "I(left) -> II RPP(right, disc)"


def test_scotch_yoke_is_a_prp_dyad_on_the_crank_pin() -> None:
    yoke = "O:frame-crank A:crank-block B:block-yoke:P C:yoke-frame:P"
    assert sequence(yoke, "O") == "I(crank) -> II RPP(block, yoke)"


def test_two_drivers_of_a_five_bar_come_first() -> None:
    five = "O:frame-a A:a-b B:b-c C:c-d D:d-frame"
    assert sequence(five, "O", "D") == "I(a) -> I(d) -> II RRR(b, c)"


def test_cylinder_between_two_pivots() -> None:
    links, pairs = chain("B:frame-barrel S:barrel-rod:P C:rod-boom D:boom-frame")
    for order in (pairs, [Pair("S", "rod", "barrel", "P"), *pairs[:1], *pairs[2:]]):
        (unit,) = formation(links, order, FRAME, ["S"]).units
        assert (unit.kind, unit.number, unit.driven) == ("cylinder", 2, ("S",))
        assert unit.links == ("barrel", "rod", "boom")


def test_driver_on_a_moving_link_is_a_plain_driver() -> None:
    text = "O:frame-arm A:arm-fore"
    assert sequence(text, "O", "A") == "I(arm) -> I(fore)"


def test_driver_between_moving_links_sits_inside_a_group() -> None:
    # a four-bar driven at its coupler's pin: 3 links, 4 pairs, one driven
    found = formation(*chain(FOUR_BAR), FRAME, ["A"])
    (unit,) = found.units
    assert (unit.kind, unit.driven) == ("group", ("A",))
    assert 3 * len(unit.links) == 2 * len(unit.pairs) + 1
    assert unit.number == 2  # crank and rod welded: a dyad


def test_driver_named_from_the_later_link_still_places_it() -> None:
    found = formation(["a"], [Pair("O", "a", "frame")], FRAME, ["O"])
    assert str(found) == "I(a)"


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


# What is wrong with a structure.


def test_a_sound_mechanism_has_no_findings() -> None:
    assert not codes(FOUR_BAR, "O")
    state = rigidity(*chain(FOUR_BAR), FRAME)
    assert (state.mobility, state.counted, state.redundant) == (1, 1, 0)
    assert rigidity(*chain(FOUR_BAR), FRAME, ["O"]).determinate


def test_parallelogram_with_three_cranks_is_locked_for_generic_lengths() -> None:
    text = "O:frame-a P:frame-b Q:frame-c A:a-coupler B:b-coupler C:c-coupler"
    assert rigidity(*chain(text), FRAME).mobility == 0
    found = codes(text, "O")
    assert set(found) == {"too-many-drivers", "locked-driver"}
    assert found["locked-driver"] == ("a", "b", "c", "coupler", "frame")
    (o,) = rigidity(*chain(text), FRAME, ["O"]).overconstrained
    assert (o.links, o.drivers, o.excess) == (found["locked-driver"], ("O",), 1)


def test_one_crank_too_many_beside_a_loose_link_hides_in_the_count() -> None:
    text = "O:frame-a P:frame-b Q:frame-c R:frame-d A:a-t B:b-t C:c-t D:d-t X:a-x Y:x-y"
    links, pairs = chain(text)
    state = rigidity(links, pairs, FRAME)
    assert (state.mobility, state.counted) == (2, 1)
    found = codes(text, "X")
    assert found["over-constrained"] == ("a", "b", "c", "d", "frame", "t")
    assert found["too-few-drivers"] == ()
    assert found["loose-links"] == ("y",)


def test_two_pairs_between_two_links_are_over_constrained() -> None:
    found = codes(FOUR_BAR + " X:crank-rod", "O")
    assert found["over-constrained"] == ("crank", "rod")
    assert found["locked-driver"] == ("crank", "frame", "rocker", "rod")


def test_a_roller_that_spins_is_loose() -> None:
    found = diagnose(*chain(FOUR_BAR + " R:rocker-roller"), FRAME, ["O"])
    assert {f.code: (f.links, f.number) for f in found} == {
        "too-few-drivers": ((), 1),
        "loose-links": (("roller",), 1),
    }
    assert "roller" in found[-1].text


def test_a_driven_roller_leaves_the_mechanism_loose() -> None:
    found = codes(FOUR_BAR + " R:rocker-roller", "R")
    assert found["loose-links"] == ("crank", "rocker", "rod", "roller")


def test_unconnected_links_are_named_and_kept_out_of_the_count() -> None:
    links, pairs = chain(FOUR_BAR + " X:u-w")
    found = diagnose([*links, "alone"], pairs, FRAME, ["O"])
    assert [(f.code, f.links) for f in found] == [("unconnected-links", ("alone", "u", "w"))]


def test_no_frame_at_all_is_reported() -> None:
    assert [f.code for f in diagnose(["a", "b"], [Pair("A", "a", "b")], [])] == [
        "unconnected-links"
    ]


def test_two_drivers_on_a_four_bar_conflict() -> None:
    found = diagnose(*chain(FOUR_BAR), FRAME, ["O", "C"])
    assert {f.code: (f.pairs, f.number) for f in found} == {
        "too-many-drivers": (("C", "O"), 1),
        "conflicting-drivers": (("C", "O"), 1),
    }


def test_right_number_of_drivers_in_the_wrong_places() -> None:
    five_bar = " P:frame-a Q:a-b R:b-c S:c-d T:d-frame"
    found = codes(FOUR_BAR + five_bar, "O", "C", "P")
    assert found == {
        "conflicting-drivers": ("crank", "frame", "rocker", "rod"),
        "loose-links": ("b", "c", "d"),
    }


def test_a_loop_of_slides_alone_holds_its_turning_twice() -> None:
    wedges = "A:frame-a:P B:a-b:P C:b-frame:P"
    state = rigidity(*chain(wedges), FRAME)
    assert (state.mobility, state.counted) == (1, 0)
    (o,) = state.overconstrained
    assert o.turning_only
    assert (o.links, o.excess) == (("a", "b", "frame"), 1)
    assert set(codes(wedges, "A")) == {"turning-held-twice"}
    assert not formation(*chain(wedges), FRAME, ["A"]).complete
    assert codes("A:frame-a:P B:a-b:P C:b-c:P D:c-frame:P E:a-c:P F:b-frame:P")[
        "turning-held-twice"
    ] == ("a", "b", "c", "frame")


def test_slides_in_a_row_keep_two_freedoms_but_not_three() -> None:
    table = "A:frame-a:P B:a-b:P"
    assert rigidity(*chain(table), FRAME).mobility == 2
    assert rigidity(*chain(table + " C:b-c:P"), FRAME).mobility == 3
    assert rigidity(*chain(table + " C:b-frame:P"), FRAME).mobility == 1


def test_turning_tied_twice_through_separate_parts_is_found() -> None:
    # a1 and b1 rigid by a triangle, a2 and b2 too; slides keep a1 || a3 || a2 and b1 || b2:
    # no connected set of links breaks 2p <= 3n - 3 in its own count
    text = "A:a1-b1 B:b1-x C:x-a1 D:a2-b2 E:b2-y F:y-a2 G:a1-a3:P H:a3-a2:P I:b1-b2:P"
    links, pairs = chain(text)
    state = rigidity(links, pairs, [])
    assert state.redundant == 1
    assert "G" in state.overconstrained[0].pairs


def test_a_pin_of_three_links_is_not_three_separate_axes() -> None:
    # a and c pinned to each other twice; b turns on the same pin and hides it from the count
    apart = rigidity(*chain("A:a-b B:b-c C:c-a"), [])
    on_one = rigidity(*chain("A:a-b:R@pin B:b-c:R@pin C:c-a"), [])
    assert (apart.mobility, apart.redundant) == (3, 0)
    assert (on_one.mobility, on_one.redundant) == (4, 1)
    assert ("a", "c") in on_one.clusters


def test_a_dyad_with_both_feet_on_one_pin_cannot_be_placed() -> None:
    text = "O:frame-crank A:crank-i:R@pin B:i-j C:j-crank:R@pin"
    found = formation(*chain(text), FRAME, ["O"])
    assert ([u.kind for u in found.units], found.rest) == (["driver"], ("i", "j"))


def test_a_pair_between_placed_links_is_left_over() -> None:
    links, pairs = chain(FOUR_BAR + " X:frame-base")
    found = formation(links, pairs, ["frame", "base"], ["O"])
    assert (found.rest, found.spare, found.complete) == ((), ("X",), False)
    (o,) = rigidity(links, pairs, ["frame", "base"], ["O"]).overconstrained
    assert (o.links, o.pairs, o.excess) == (("base", "frame"), ("X",), 2)


def test_names_that_do_not_fit_are_refused() -> None:
    pair = Pair("A", "frame", "a")
    for links, pairs, drivers in (
        ([], [pair], []), (["a"], [pair, pair], []), (["a"], [pair], ["B"]),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"unknown|same name"):
            rigidity(links, pairs, FRAME, drivers)
        with pytest.raises(ValueError, match=r"unknown|same name"):
            formation(links, pairs, FRAME, drivers)


# Links that wait for each other.


def test_two_dyads_that_wait_for_each_other_are_a_group_of_class_four() -> None:
    # dyad (a, b) stands on d and the frame, dyad (c, d) on a and the crank: a closed loop
    links, pairs = chain("A:a-frame B:a-b C:b-d D:d-c E:c-a F:d-crank")
    found = waiting([a for a in links if a != "crank"], pairs, ["frame", "crank"])
    assert found.is_group
    assert found.text == "a, b, c, d are one Assur group of class IV with 4 links and 6 pairs"


def test_waiting_dyads_with_an_over_constrained_part_are_named() -> None:
    # 3n = 2p, but a, b, c, d is a quadrilateral with a diagonal and x hangs on
    links, pairs = chain("A:a-b B:b-c C:c-a D:a-frame E:b-frame F:c-x")
    found = waiting(links, pairs, FRAME)
    assert not found.is_group
    assert found.overconstrained[0].links == ("a", "b", "c", "frame")
    assert found.loose[0].links == ("x",)
    assert "over-constrained: a, b, c, frame; loose: x" in found.text


def test_waiting_links_that_are_several_groups_are_put_in_order() -> None:
    links, pairs = chain("A:a-frame B:a-b C:b-frame D:c-a E:c-d F:d-b")
    found = waiting(links, pairs, FRAME)
    assert not found.is_group
    assert [u.links for u in found.units] == [("a", "b"), ("c", "d")]


def test_reseating_pins_turns_a_false_group_into_dyads() -> None:
    # as in Jansen's leg: two dyads (j, b) and (k, c) share the crank's pin and a fixed pin
    text = (
        "O:frame-crank A:crank-k:R@crankpin B:k-j:R@crankpin "
        "C:frame-b:R@fixed D:b-c:R@fixed E:j-b F:k-c"
    )
    links, pairs = chain(text)
    as_given = formation(links, pairs, FRAME, ["O"])
    assert [u.number for u in as_given.units] == [1, 4]
    seated = reseat(links, pairs, FRAME, ["O"])
    assert str(formation(links, seated, FRAME, ["O"])) == (
        "I(crank) -> II RRR(b, j) -> II RRR(c, k)"
    )
    assert {p.name for p in seated} == {p.name for p in pairs}
    assert {p.name: p for p in seated}["A"] == pairs[1]
    assert rigidity(links, seated, FRAME) == rigidity(links, pairs, FRAME)


# Random structures against the rank of a numeric Jacobian.


def conditions(
    links: Sequence[str], pairs: Iterable[Pair], drivers: Collection[str], rng: np.random.Generator
) -> tuple[np.ndarray, list[str], np.ndarray]:
    """Velocity Jacobian at a random pose, the pair of each row, and the links' origins.

    Unknowns are the velocity of each link's own origin, placed at random, and its rate.
    """
    origin = {a: rng.normal(size=2) for a in links}
    axes: dict[tuple[str, str], np.ndarray] = {}
    rows, names = [], []
    for p in pairs:
        place = rng.normal(size=2)
        if p.axis:
            place = axes.setdefault((p.kind, p.axis), place)
        along = place / np.linalg.norm(place)
        if p.kind == "R":
            directions = [(1.0, 0.0), (0.0, 1.0)]
        else:
            directions = [(-along[1], along[0])]
        turns = p.kind == "P" or p.name in drivers
        if p.kind == "P" and p.name in drivers:
            directions.append((along[0], along[1]))
        point = place if p.kind == "R" else rng.normal(size=2)
        for kind, direction in [("d", d) for d in directions] + [("t", (0.0, 0.0))] * turns:
            row = np.zeros(3 * len(links))
            for a, sign in ((p.first, 1.0), (p.second, -1.0)):
                if a in origin:
                    k = 3 * links.index(a)
                    arm = point - origin[a]
                    if kind == "t":
                        row[k + 2] += sign
                    else:
                        lever = direction[1] * arm[0] - direction[0] * arm[1]
                        row[k : k + 3] += sign * np.array([*direction, lever])
            rows.append(row)
            names.append(p.name)
    places = np.array([origin[a] for a in links])
    return np.array(rows).reshape(len(rows), 3 * len(links)), names, places


def null_space(matrix: np.ndarray) -> np.ndarray:
    """Orthonormal columns that the matrix takes to zero; the gap in its values is asserted."""
    if not matrix.size:
        return np.eye(matrix.shape[1])
    _, values, right = np.linalg.svd(matrix)
    rank = int(np.sum(values > 1e-9))
    assert not np.any((values > 1e-12) & (values < 1e-9)), values
    return right[rank:].T


def random_structure(rng: random.Random) -> tuple[list[str], list[Pair], list[str]]:
    """A few links with about as many pairs as they need, shared axes and drivers among them."""
    n = rng.randint(1, 9)
    links = [f"l{k}" for k in range(n)]
    near = ["frame", *links]
    pairs = []
    slides = rng.choice([0.0, 0.2, 0.5, 1.0])
    count = max(1, round(1.5 * n) + rng.choice([-2, -1, 0, 0, 0, 1, 2]))
    for k in range(count):
        a = links[k] if k < n else rng.choice(links)  # mostly connected
        b = rng.choice([x for x in near[: links.index(a) + 1] if x != a] if k < n else near)
        if a == b:
            continue
        kind = "P" if rng.random() < slides else "R"
        axis = rng.choice(["x", "y", "", "", "", ""]) if rng.random() < 0.4 else ""
        pairs.append(Pair(f"j{k}", a, b, "P" if kind == "P" else "R", axis))
    rng.shuffle(pairs)
    drivers = [p.name for p in pairs if rng.random() < 0.15]
    return links, pairs, drivers


@pytest.mark.parametrize("seed", range(12))
def test_random_structures_agree_with_the_rank_of_a_jacobian(seed: int) -> None:
    rng, numeric = random.Random(seed), np.random.default_rng(seed)
    for trial in range(100):
        links, pairs, drivers = random_structure(rng)
        case = (seed, trial, pairs, drivers)
        state = rigidity(links, pairs, FRAME, drivers)
        matrix, names, origins = conditions(links, pairs, drivers, numeric)
        motions, stresses = null_space(matrix), null_space(matrix.T)

        assert state.mobility == motions.shape[1], case
        assert state.redundant == stresses.shape[1], case
        loose = {
            a
            for k, a in enumerate(links)
            if np.abs(motions[3 * k : 3 * k + 3]).max(initial=0) > 1e-7
        }
        assert {a for part in state.loose for a in part.links} == loose, case
        assert sum(part.freedom for part in state.loose) == state.mobility
        stressed = {
            n for n, row in zip(names, stresses, strict=True) if np.abs(row).max(initial=0) > 1e-7
        }
        assert {n for o in state.overconstrained for n in o.pairs} == stressed, case
        assert sum(o.excess for o in state.overconstrained) == state.redundant
        held = {a for p in pairs if p.name in stressed for a in p.links}
        assert {a for o in state.overconstrained for a in o.links} == held, case

        for o in state.overconstrained:
            own = [n in o.pairs for n in names]
            assert null_space(matrix[own].T).shape[1] >= o.excess, case
            if sum(bool(set(o.pairs) & set(x.pairs)) for x in state.overconstrained) == 1:
                assert null_space(matrix[own].T).shape[1] == o.excess, case
        twists = motions.reshape(len(links), 3, motions.shape[1])
        twists[:, 0] += origins[:, 1, None] * twists[:, 2]  # of the point at the common origin
        twists[:, 1] -= origins[:, 0, None] * twists[:, 2]
        bodies = [*twists, np.zeros_like(twists[0])]
        together = {frozenset(p) for c in state.clusters for p in itertools.combinations(c, 2)}
        for (a, x), (b, y) in itertools.combinations(
            zip([*links, "frame"], bodies, strict=True), 2
        ):
            assert (frozenset((a, b)) in together) == np.allclose(x, y, atol=1e-8), case

        found = formation(links, pairs, FRAME, drivers)
        assert found.complete == state.determinate, case
        assert found.complete == (not diagnose(links, pairs, FRAME, drivers)), case
        check_units(found.units, pairs, drivers)


def check_units(units: Iterable[Unit], pairs: Sequence[Pair], drivers: Collection[str]) -> None:
    """Each unit is balanced, stands on earlier ones, and no part of it is balanced."""
    placed = {"frame"}
    for unit in units:
        own = [p for p in pairs if set(p.links) <= placed | set(unit.links)]
        own = [p for p in own if not set(p.links) <= placed]
        assert sorted(p.name for p in own) == sorted(p.name for p in unit.pairs)
        assert unit.driven == tuple(sorted(p.name for p in own if p.name in drivers))
        if len(unit.links) <= 7:
            for size in range(1, len(unit.links)):
                for part in itertools.combinations(unit.links, size):
                    inside = [p for p in own if set(p.links) <= placed | set(part)]
                    taken = 2 * len(inside) + sum(p.name in drivers for p in inside)
                    assert taken < 3 * size, (unit, part)
        placed |= set(unit.links)


def test_spoilt_mechanisms_get_findings_that_the_rank_confirms() -> None:
    """Deleted, doubled and merged joints and moved drivers; each finding checked by ranks."""
    rng, numeric, extra = random.Random(5), np.random.default_rng(5), itertools.count()

    def freedom(links: list[str], pairs: list[Pair], drivers: Collection[str]) -> int:
        return int(null_space(conditions(links, pairs, drivers, numeric)[0]).shape[1])

    for trial in range(300):
        links, pairs, drivers, _ = random_mechanism(rng, shared=0.3)
        for _ in range(rng.randint(1, 3)):
            what, k = rng.choice(["delete", "double", "merge", "drive"]), rng.randrange(len(pairs))
            p, q = pairs[k], rng.choice(pairs)
            if what == "delete" and len(pairs) > 1:
                del pairs[k]
                drivers = [d for d in drivers if d != p.name]
            elif what == "double":
                pairs.append(Pair(f"again{next(extra)}", p.first, p.second, p.kind))
            elif what == "merge" and p.kind == q.kind:
                pairs[k] = Pair(p.name, p.first, p.second, p.kind, q.axis)
            elif what == "drive":
                drivers = [*drivers[1:], p.name] if p.name not in drivers else drivers[1:]
        found = diagnose(links, pairs, FRAME, drivers)
        case = (trial, pairs, drivers, found)
        by_code = defaultdict(list)
        for f in found:
            by_code[f.code].append(f)
        away = {a for f in by_code["unconnected-links"] for a in f.links}
        near = [a for a in links if a not in away]
        pairs = [p for p in pairs if not away & set(p.links)]
        drivers = [d for d in drivers if d in {p.name for p in pairs}]
        mobility = freedom(near, pairs, ())
        few = sum(f.number for f in by_code["too-few-drivers"])
        many = sum(f.number for f in by_code["too-many-drivers"])
        assert mobility - len(drivers) == few - many, case
        redundant = mobility - 3 * len(near) + 2 * len(pairs)
        held = by_code["over-constrained"] + by_code["turning-held-twice"]
        assert redundant == sum(f.number for f in held), case
        locked = {d for d in drivers if freedom(near, pairs, [d]) == mobility}
        assert locked == {f.pairs[0] for f in by_code["locked-driver"]}, case
        left = freedom(near, pairs, drivers)
        assert left == sum(f.number for f in by_code["loose-links"]), case
        useless = left + len(drivers) - mobility - len(locked)
        assert useless == sum(f.number for f in by_code["conflicting-drivers"]), case


def partitions(items: Sequence[str]) -> Iterable[list[set[str]]]:
    """All partitions of a few items."""
    if not items:
        yield []
        return
    for rest in partitions(items[1:]):
        yield [{items[0]}, *rest]
        for k in range(len(rest)):
            yield [*rest[:k], rest[k] | {items[0]}, *rest[k + 1 :]]


def classes(parts: list[set[str]], pairs: Iterable[Pair]) -> int:
    """Number of sets of parts that P pairs keep parallel."""
    number = {a: k for k, part in enumerate(parts) for a in part}
    label = list(range(len(parts)))
    for p in pairs:
        if p.kind == "P":
            old, new = label[number[p.first]], label[number[p.second]]
            label = [new if x == old else x for x in label]
    return len(set(label))


def test_mobility_is_the_best_count_over_all_partitions() -> None:
    """Links fall into rigid parts, all parts that slides join turn together:
    mobility = max over partitions of 2 (parts - 1) + (parallel classes - 1) - 2 R - P,
    R and P the pairs between parts (union of three cographic matroids; no shared axes).
    """
    rng = random.Random(7)
    for _ in range(150):
        links, pairs, _ = random_structure(rng)
        links = links[:6]
        pairs = [Pair(p.name, p.first, p.second, p.kind) for p in pairs]
        pairs = [p for p in pairs if {p.first, p.second} <= {"frame", *links}]
        best = 0
        for parts in partitions(["frame", *links]):
            across = [p for p in pairs if not any(set(p.links) <= part for part in parts)]
            count = 2 * len(parts) - 2 + classes(parts, pairs) - 1
            best = max(best, count - sum(2 if p.kind == "R" else 1 for p in across))
        assert rigidity(links, pairs, FRAME).mobility == best, pairs


Mechanism: TypeAlias = tuple[list[str], list[Pair], list[str], list[int]]


def random_mechanism(rng: random.Random, shared: float = 0.0) -> Mechanism:
    """A determinate mechanism made of drivers, dyads, triads and class IV groups.

    Links, pairs, drivers and the numbers of links of the units. ``shared``: how often a
    foot stands on a pin that is already there.
    """
    placed, pairs, drivers, sizes = ["frame"], list[Pair](), list[str](), list[int]()
    pins: list[tuple[str, str]] = []  # a link and a pin on it
    names = iter(rng.sample(range(1000), 600))

    def join(a: str, b: str, kind: str = "R", axis: str = "") -> None:
        ends = (a, b) if rng.random() < 0.5 else (b, a)
        axis = axis or f"pin{next(names)}"
        pairs.append(Pair(f"j{next(names)}", *ends, "P" if kind == "P" else "R", axis))
        if kind == "R":
            new_pins.append((a, axis))

    for _ in range(rng.randint(1, 12)):
        size = rng.choice([1, 1, 2, 2, 2, 4, 5])
        new = [f"l{next(names)}" for _ in range(4 if size == 5 else size)]
        new_pins: list[tuple[str, str]] = []
        feet = [(rng.choice(placed), "") for _ in range(3)]
        if rng.random() < shared and len({axis for _, axis in pins}) >= 3:
            feet = [(a, x) for x, a in rng.sample(sorted({x: a for a, x in pins}.items()), 3)]
        if size == 1:
            kind = rng.choice("RP")
            join(new[0], feet[0][0], kind, feet[0][1] if kind == "R" else "")
            drivers.append(pairs[-1].name)
        elif size == 2:
            letters = rng.choice(["RRR", "RRP", "RPR", "PRP", "RPP"])
            join(new[0], new[1], letters[1])
            for a, (b, axis), kind in zip(new, feet, letters[::2], strict=False):
                join(a, b, kind, axis if kind == "R" else "")
        elif size == 4:
            for leg, (foot, axis) in zip(new[1:], feet, strict=True):
                join(new[0], leg)
                join(leg, foot, "R", axis)
        else:
            for a, b in zip(new, new[1:] + new[:1], strict=True):
                join(a, b)
            join(new[0], feet[0][0], "R", feet[0][1])
            join(new[2], feet[1][0], "R", feet[1][1])
        sizes.append(len(new))
        placed += new
        pins += new_pins
    rng.shuffle(pairs)
    return rng.sample(placed[1:], len(placed) - 1), pairs, drivers, sorted(sizes)


def test_random_mechanisms_come_apart_into_what_they_were_made_of() -> None:
    rng = random.Random(11)
    for trial in range(400):
        links, pairs, drivers, sizes = random_mechanism(rng, shared=trial % 2 * 0.6)
        found = formation(links, pairs, FRAME, drivers)
        assert found.complete
        assert sorted(len(u.links) for u in found.units) == sizes
        assert "group" not in {u.kind for u in found.units if u.number < 4}
        check_units(found.units, pairs, drivers)
        assert rigidity(links, pairs, FRAME, drivers).determinate


def test_reseated_pins_give_the_smallest_groups_whatever_their_pairs_were() -> None:
    rng, larger = random.Random(3), 0
    for _ in range(300):
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
    assert larger > 30  # the mixing did harm, else nothing was shown


def dyad_chain(count: int, rng: random.Random) -> tuple[list[str], list[Pair]]:
    """A crank and so many dyads in a row, shuffled."""
    links, pairs, last = ["crank"], [Pair("O", "frame", "crank")], "crank"
    for k in rng.sample(range(count), count):
        links += [f"i{k}", f"j{k}"]
        pairs += [
            Pair(f"B{k}", last, f"i{k}"),
            Pair(f"C{k}", f"i{k}", f"j{k}"),
            Pair(f"D{k}", "frame", f"j{k}"),
        ]
        last = f"j{k}"
    rng.shuffle(pairs)
    return links, pairs


def test_a_thousand_dyads_are_taken_apart(capsys: pytest.CaptureFixture[str]) -> None:
    links, pairs = dyad_chain(1000, random.Random(1))
    lines = []

    def timed(what: str, start: float) -> None:
        lines.append(f"1000 dyads, {what}: {time.perf_counter() - start:.3f} s")

    start = time.perf_counter()
    found = formation(links, pairs, FRAME, ["O"])
    timed("formation", start)
    assert found.complete
    assert [len(u.links) for u in found.units] == [1] + [2] * 1000
    start = time.perf_counter()
    assert rigidity(links, pairs, FRAME, ["O"]).determinate
    timed("rigidity", start)
    start = time.perf_counter()
    assert {f.code for f in diagnose(links, pairs[1:], FRAME, ["O"])} == {
        "too-few-drivers",
        "loose-links",
    }
    timed("diagnosis of a missing pair", start)
    twice = [Pair(f"X{p.name}", p.first, p.second) for p in pairs[:1000]]
    start = time.perf_counter()
    assert diagnose(links, pairs + twice, FRAME, ["O"])
    timed("diagnosis of 1000 doubled pairs", start)
    with capsys.disabled():
        print("\n" + "\n".join(lines))


def test_classifying_alone_does_not_check() -> None:
    unit = classify(*chain("A:a-frame:P B:a-b:P C:b-frame:P"))
    assert (unit.kind, unit.number) == ("group", 2)
    assert not rigidity(unit.links, unit.pairs, FRAME).determinate
