"""The two links of a dyad in each other's roles give the same numbers."""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from blockmech.testing.strategies import Options, Seeded, random_mechanism

SEEDS = range(15)
SWAPPED = 1e-11  # [-] of the largest: another order of the same sums, margins down to 0.02


def swapped(block):
    """The same dyad with its links called j and i, and the joint names of both."""
    links = {{"i": "j", "j": "i"}[n]: k for n, k in block.links.items()}
    if isinstance(block, bm.RRR):
        names = {"B": "D", "D": "B", "C": "C"}
        numbers = {"l_i": block.l_j, "l_j": block.l_i, "branch": -block.branch}
    elif isinstance(block, bm.RPR):
        # Seen from the other pin, along the guide turned round.
        names = {"B": "D", "D": "B", "S": "S"}
        numbers = {"h_i": block.h_j, "h_j": block.h_i, "branch": -block.branch, "x_S": block.x_S}
        numbers["slider"] = {"later": "i", "earlier": "j"}[block.slider]
    else:
        names = {"S1": "S2", "S2": "S1", "C": "C"}
        numbers = {"h1": block.h2, "h2": block.h1, "x_S1": block.x_S2, "x_S2": block.x_S1}
        numbers["slider"] = {names[n]: owner for n, owner in block.slider.items()}
    friction = {names[n]: law for n, law in block.friction.items()}
    return type(block)(links=links, friction=friction, **numbers), names


def swapped_graph(graph):
    """Every RRR, RPR and PRP dyad with its links in each other's roles."""
    found = bm.Graph(graph.name, gravity=graph.scene.gravity.z)
    joints, markers = {}, {}
    for name, block in graph.blocks.items():
        if isinstance(block, bm.RRR | bm.RPR | bm.PRP):
            block, names = swapped(block)
            joints |= {f"{name}.{a}": f"{name}.{b}" for a, b in names.items()}
            pairs = (("i", "j"), ("B", "D"), ("C", "Cj"))
            for a, b in (*pairs, *((b, a) for a, b in pairs)):
                markers[f"{name}.{a}"] = f"{name}.{b}"
        found.add(name, block)
    for w in graph.wires:
        found.connect(markers.get(w.source, w.source), joints.get(w.target, w.target))
    return found, joints


@pytest.mark.parametrize("seed", SEEDS)
def test_links_of_a_dyad_may_swap_their_roles(seed):
    options = Options(groups=(2, 3), kinds=("dyad.rrr", "dyad.rpr", "dyad.prp"))
    case = random_mechanism(Seeded(seed), options)
    here = case.graph.compile().run(**case.request, on_gap="mark")
    graph, joints = swapped_graph(case.graph)
    there = graph.compile().run(**case.request, on_gap="mark")
    assert here.quality.status == there.quality.status
    if here.quality.status != ("ok",):  # jammed: the same verdict, and no numbers
        return
    scale = max(np.abs(here[n]).max() for n in here if n.endswith(".reaction"))
    for joint, other in joints.items():
        inner = joint == other
        one, two = here[f"{joint}.reaction"], there[f"{other}.reaction"]
        assert np.abs(one - (-two if inner else two)).max() <= SWAPPED * scale, joint
    for driver in case.request["at"]:
        one, two = here[f"{driver}.drive"], there[f"{driver}.drive"]
        assert np.abs(one - two).max() <= SWAPPED * max(scale, np.abs(one).max())
