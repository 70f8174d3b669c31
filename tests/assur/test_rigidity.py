"""Structure alone: mobility, over-constrained and loose links, and why nothing can be placed.

The judge shares nothing with the code: the float rank of a velocity Jacobian at random poses.
"""

from __future__ import annotations

import itertools
import random
from collections import defaultdict
from collections.abc import Collection

import numpy as np
import pytest

from blockmech.assur.diagnosis import diagnose
from blockmech.assur.formation import formation
from blockmech.assur.groups import Pair
from blockmech.assur.rigidity import rigidity
from tests.assur.structures import (
    FOUR_BAR,
    FRAME,
    chain,
    check_units,
    codes,
    conditions,
    null_space,
    random_mechanism,
    random_structure,
)


def test_a_sound_mechanism_has_no_findings() -> None:
    assert not codes(FOUR_BAR, "O")
    state = rigidity(*chain(FOUR_BAR), FRAME)
    assert (state.mobility, state.counted, state.redundant) == (1, 1, 0)
    assert rigidity(*chain(FOUR_BAR), FRAME, ["O"]).determinate


def test_parallelogram_with_three_cranks_is_locked_for_generic_lengths() -> None:
    text = "O:frame-a P:frame-b Q:frame-c A:a-coupler B:b-coupler C:c-coupler"
    assert rigidity(*chain(text), FRAME).mobility == 0
    result = codes(text, "O")
    assert set(result) == {"too-many-drivers", "locked-driver"}
    assert result["locked-driver"] == ("a", "b", "c", "coupler", "frame")
    (o,) = rigidity(*chain(text), FRAME, ["O"]).overconstrained
    assert (o.links, o.drivers, o.excess) == (result["locked-driver"], ("O",), 1)


def test_one_crank_too_many_beside_a_loose_link_hides_in_the_count() -> None:
    text = "O:frame-a P:frame-b Q:frame-c R:frame-d A:a-t B:b-t C:c-t D:d-t X:a-x Y:x-y"
    links, pairs = chain(text)
    state = rigidity(links, pairs, FRAME)
    assert (state.mobility, state.counted) == (2, 1)
    result = codes(text, "X")
    assert result["over-constrained"] == ("a", "b", "c", "d", "frame", "t")
    assert result["too-few-drivers"] == ()
    assert result["loose-links"] == ("y",)


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


def test_names_that_do_not_fit_are_refused() -> None:
    pair = Pair("A", "frame", "a")
    for links, pairs, drivers in (
        ([], [pair], []), (["a"], [pair, pair], []), (["a"], [pair], ["B"]),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"unknown|same name"):
            rigidity(links, pairs, FRAME, drivers)
        with pytest.raises(ValueError, match=r"unknown|same name"):
            formation(links, pairs, FRAME, drivers)


@pytest.mark.parametrize("seed", range(4))
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
        stressed_links = {a for p in pairs if p.name in stressed for a in p.links}
        assert {a for o in state.overconstrained for a in o.links} == stressed_links, case

        for o in state.overconstrained:
            rows = [n in o.pairs for n in names]
            assert null_space(matrix[rows].T).shape[1] >= o.excess, case
            if sum(bool(set(o.pairs) & set(x.pairs)) for x in state.overconstrained) == 1:
                assert null_space(matrix[rows].T).shape[1] == o.excess, case
        twists = motions.reshape(len(links), 3, motions.shape[1])
        twists[:, 0] += origins[:, 1, None] * twists[:, 2]  # of the point at the common origin
        twists[:, 1] -= origins[:, 0, None] * twists[:, 2]
        bodies = [*twists, np.zeros_like(twists[0])]
        together = {frozenset(p) for c in state.clusters for p in itertools.combinations(c, 2)}
        for (a, x), (b, y) in itertools.combinations(
            zip([*links, "frame"], bodies, strict=True), 2
        ):
            assert (frozenset((a, b)) in together) == np.allclose(x, y, atol=1e-8), case

        result = formation(links, pairs, FRAME, drivers)
        assert result.complete == state.determinate, case
        assert result.complete == (not diagnose(links, pairs, FRAME, drivers)), case
        check_units(result.units, pairs, drivers)


def test_spoilt_mechanisms_get_findings_that_the_rank_confirms() -> None:
    """Deleted, doubled and merged joints and moved drivers; each finding checked by ranks."""
    rng, numeric, extra = random.Random(5), np.random.default_rng(5), itertools.count()

    def freedom(links: list[str], pairs: list[Pair], drivers: Collection[str]) -> int:
        return int(null_space(conditions(links, pairs, drivers, numeric)[0]).shape[1])

    for trial in range(100):
        links, pairs, drivers, _ = random_mechanism(rng, shared=0.3)
        for _ in range(rng.randint(1, 3)):
            damage = rng.choice(["delete", "double", "merge", "drive"])
            k = rng.randrange(len(pairs))
            p, q = pairs[k], rng.choice(pairs)
            if damage == "delete" and len(pairs) > 1:
                del pairs[k]
                drivers = [d for d in drivers if d != p.name]
            elif damage == "double":
                pairs.append(Pair(f"again{next(extra)}", p.first, p.second, p.kind))
            elif damage == "merge" and p.kind == q.kind:
                pairs[k] = Pair(p.name, p.first, p.second, p.kind, q.axis)
            elif damage == "drive":
                drivers = [*drivers[1:], p.name] if p.name not in drivers else drivers[1:]
        result = diagnose(links, pairs, FRAME, drivers)
        case = (trial, pairs, drivers, result)
        by_code = defaultdict(list)
        for f in result:
            by_code[f.code].append(f)
        away = {a for f in by_code["unconnected-links"] for a in f.links}
        anchored = [a for a in links if a not in away]
        pairs = [p for p in pairs if not away & set(p.links)]
        drivers = [d for d in drivers if d in {p.name for p in pairs}]
        mobility = freedom(anchored, pairs, ())
        few = sum(f.number for f in by_code["too-few-drivers"])
        many = sum(f.number for f in by_code["too-many-drivers"])
        assert mobility - len(drivers) == few - many, case
        redundant = mobility - 3 * len(anchored) + 2 * len(pairs)
        excess = by_code["over-constrained"] + by_code["turning-held-twice"]
        assert redundant == sum(f.number for f in excess), case
        locked = {d for d in drivers if freedom(anchored, pairs, [d]) == mobility}
        assert locked == {f.pairs[0] for f in by_code["locked-driver"]}, case
        loose = freedom(anchored, pairs, drivers)
        assert loose == sum(f.number for f in by_code["loose-links"]), case
        useless = loose + len(drivers) - mobility - len(locked)
        assert useless == sum(f.number for f in by_code["conflicting-drivers"]), case
