"""Synthesis: known counts, positions that are met, designs without defects."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest

import blockmech as bm
from blockmech.synthesis import chains, mechanisms, path_generator, saved, three_positions

POINTS = np.array([0.5 + 2.2j, 0.9 + 2.9j, 0.4 + 3.2j, -0.4 + 3.1j, -1.2 + 2.6j, -1.6 + 2.0j])


@pytest.mark.parametrize(("links", "count"), [(4, 1), (6, 2), (8, 16), (10, 230)])
def test_there_are_as_many_chains_as_the_literature_counts(links, count):
    found = chains(links)
    assert len(found) == count
    for chain in found:
        assert chain.number_of_nodes() == links
        assert 2 * chain.number_of_edges() == 3 * links - 4
        assert nx.is_biconnected(chain)


def test_no_two_chains_are_alike():
    found = chains(8)
    assert not any(nx.is_isomorphic(a, b) for i, a in enumerate(found) for b in found[:i])


def test_frames_and_drivers_are_counted_by_symmetry():
    """Watt's chain has 2 inversions, Stephenson's 3 (Norton, table 2-5)."""
    frames = sorted(len({frame for frame, _ in mechanisms(c)}) for c in chains(6))
    assert frames == [2, 3]
    assert mechanisms(chains(4)[0]) == ((0, 1),)


def test_an_odd_number_of_links_is_refused():
    with pytest.raises(bm.RequestError, match="even number from 4 to 10"):
        chains(7)


def passed(design):
    """Places of the coupler point by the whole machinery, at the positions and in between."""
    mech = design.graph.compile()
    way = np.linspace(design.at[0], design.at[-1], 721)
    margin = mech.run(at=way, want="dyad.margin")["dyad.margin"]
    return mech.run(at=design.at, want="dyad.P.p")["dyad.P.p"], margin


def test_a_path_through_six_points_is_met():
    found = path_generator(POINTS, starts=4096)
    assert found[0].miss < 1e-6
    for design in found:
        places, margin = passed(design)
        assert np.abs(places - POINTS) == pytest.approx(design.errors, abs=1e-9)
        assert margin.min() > 0  # no change of circuit or branch on the way
        steps = np.diff(design.at)
        assert (steps > 0).all() or (steps < 0).all()
    assert [d.miss for d in found] == sorted(d.miss for d in found)


def test_a_known_fourbar_is_found_again_from_its_timed_path():
    shape = [np.log(3.0), 0.3, np.log(2.5), np.log(2.8), 1.0, 1.2]
    theta = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    wanted = 0.4 * np.exp(0.7j) * bm.synthesis.coupler_point(shape, theta, 1) + 1 - 2j
    found = path_generator(wanted, theta, starts=2**13)
    assert found[0].miss < 1e-8
    again = path_generator(wanted, theta, starts=2**13)
    assert again[0].miss == found[0].miss  # the same seed


def test_three_positions_are_met():
    positions = [(0.0, 0.0, 0.1), (1.0, 0.5, 0.5), (1.6, 1.4, 1.0)]
    for moving in ([0.2 - 1j, 1.0 - 0.7j], [0.0, 1.0], [0.5 - 2j, 2.0 - 1j]):
        design = three_positions(positions, moving)
        run = design.graph.run(at=design.at, want=["dyad.P.p", "dyad.i.angle"])
        assert run["dyad.P.p"] == pytest.approx([x + 1j * y for x, y, _ in positions], abs=1e-12)
        assert np.diff(run["dyad.i.angle"]) == pytest.approx([0.4, 0.5], abs=1e-12)


def test_positions_on_a_line_have_no_pivot():
    with pytest.raises(bm.RequestError, match="straight line"):
        three_positions([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [0.0, 1.0])


@pytest.mark.parametrize(
    ("points", "angles", "words"),
    [
        ([1.0, 2.0], None, "three points or more"),
        ("abc", None, "points"),
        ([0.0, 1.0, 2j], [0.0, 1.0, 0.5], "rising or falling"),
        ([0.0, 1.0, 2j], [0.0, 1.0], "one for each point"),
    ],
)
def test_what_is_no_path_is_refused(points, angles, words):
    with pytest.raises(bm.RequestError, match=words):
        path_generator(points, angles)


def test_every_candidate_is_a_file(tmp_path):
    found = path_generator(POINTS, starts=1024)
    paths = [*saved(found, tmp_path / "designs")]
    assert len(paths) == len(found)
    for path, design in zip(paths, found, strict=True):
        run = bm.Graph.load(path).run(at=design.at, want="dyad.P.p")
        assert np.abs(run["dyad.P.p"] - POINTS) == pytest.approx(design.errors, abs=1e-9)
