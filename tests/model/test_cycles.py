"""Blocks that wait for each other: an answer soon, however many they are."""

import time

import pytest

import blockmech as bm

SOON = 5.0  # [s] in which any graph is answered


def rings(number, size):
    """Rings of dyads, each pinned to the next."""
    g = bm.Graph("rings")
    g.blocks["frame"] = bm.Frame(markers={"A": (0, 0)})
    for r in range(number):
        names = [f"r{r}d{k}" for k in range(size)]
        g.blocks |= dict.fromkeys(names, bm.RRR(l_i=1, l_j=1))
        for one, after in zip(names, names[1:] + names[:1], strict=True):
            g.wires.append(bm.model.diagram.Wire(f"{one}.C", f"{after}.B"))
            g.wires.append(bm.model.diagram.Wire("frame.A", f"{one}.D"))
    return g


@pytest.mark.parametrize(("number", "size"), [(1, 3200), (2000, 2), (1, 490)])
def test_rings_of_dyads_are_told_soon(number, size):
    graph = rings(number, size)
    start = time.process_time()
    problems = graph.check()
    assert time.process_time() - start < SOON
    assert [p.code for p in problems] == ["cycle"] * number
    assert all("the blocks wait for each other" in p.found for p in problems)


def test_a_small_ring_is_said_to_be_a_group_of_a_higher_class():
    (problem,) = rings(1, 4).check()
    assert "one Assur group of class IV" in problem.found
