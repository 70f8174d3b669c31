"""Blocks that wait for each other: an answer soon, however many they are."""

import pytest

import blockmech as bm
from blockmech.model.cycles import waiting
from blockmech.model.diagram import Wire
from tests.assur.structures import FRAME, chain
from tests.soon import answered


def rings(number, size, hub=False):
    """Rings of dyads, each pinned to the next; their feet stand apart or on one hub."""
    g = bm.Graph("rings")
    feet = {f"A{k}": (0 if hub else k, 0) for k in range(size)}
    g.blocks["frame"] = bm.Frame(markers=feet)
    for r in range(number):
        names = [f"r{r}d{k}" for k in range(size)]
        g.blocks |= dict.fromkeys(names, bm.RRR(l_i=1, l_j=1))
        for k, (name, following) in enumerate(zip(names, names[1:] + names[:1], strict=True)):
            g.wires.append(Wire(f"{name}.C", f"{following}.B"))
            g.wires.append(Wire(f"frame.A{k}", f"{name}.D"))
    return g


@pytest.mark.parametrize(
    ("number", "size", "hub"), [(1, 3200, False), (1000, 2, False), (1, 350, True)]
)
def test_rings_of_dyads_are_told_soon(number, size, hub):
    graph = rings(number, size, hub)
    with answered():
        problems = graph.check()
    assert [p.code for p in problems] == ["cycle"] * number
    assert all("the blocks depend on each other" in p.found for p in problems)


def test_a_small_ring_is_said_to_be_a_group_of_a_higher_class():
    (problem,) = rings(1, 4).check()
    assert "one Assur group of class IV" in problem.found


def test_spokes_on_one_hub_make_a_wheel_that_turns():
    # 2n bars, n + 1 pins, the hub fixed: by count nothing moves, but the wheel turns as a whole
    (problem,) = rings(1, 4, hub=True).check()
    links = ", ".join(sorted(f"r0d{k}.{link}" for k in range(4) for link in "ij"))
    assert f"do not form an Assur group; over-constrained: {links}; loose: {links}" in problem.found


def test_two_dyads_that_wait_for_each_other_are_a_group_of_class_four():
    # dyad (a, b) stands on d and the frame, dyad (c, d) on a and the crank: a closed loop
    links, pairs = chain("A:a-frame B:a-b C:b-d D:d-c E:c-a F:d-crank")
    _, text = waiting([a for a in links if a != "crank"], pairs, ["frame", "crank"])
    assert text == "a, b, c, d are one Assur group of class IV with 4 links and 6 pairs"


def test_waiting_dyads_with_an_over_constrained_part_are_named():
    # 3n = 2p, but a, b, c, d is a quadrilateral with a diagonal and x hangs on
    order, text = waiting(*chain("A:a-b B:b-c C:c-a D:a-frame E:b-frame F:c-x"), FRAME)
    assert not order.complete
    assert text.endswith("do not form an Assur group; over-constrained: a, b, c, frame; loose: x")


def test_waiting_links_that_are_several_groups_are_put_in_order():
    order, text = waiting(*chain("A:a-frame B:a-b C:b-frame D:c-a E:c-d F:d-b"), FRAME)
    assert [u.links for u in order.units] == [("a", "b"), ("c", "d")]
    assert text.startswith("the links can be placed in the order II RRR(a, b) -> II")
