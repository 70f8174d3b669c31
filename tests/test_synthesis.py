"""Synthesis: known counts, positions that are met, designs without defects."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest

import blockmech as bm
from blockmech.ground.units import UnitWarning
from blockmech.synthesis import (
    body_guidance,
    burmester_pins,
    chains,
    function_generator,
    mechanisms,
    path_generator,
    saved,
    three_positions,
)
from blockmech.synthesis.fourbar import pose

POINTS = np.array([0.5 + 2.2j, 0.9 + 2.9j, 0.4 + 3.2j, -0.4 + 3.1j, -1.2 + 2.6j, -1.6 + 2.0j])


@pytest.mark.parametrize(("links", "count"), [(4, 1), (6, 2), (8, 16), (10, 230)])
def test_there_are_as_many_chains_as_the_literature_counts(links, count):
    result = chains(links)
    assert len(result) == count
    for chain in result:
        assert chain.number_of_nodes() == links
        assert 2 * chain.number_of_edges() == 3 * links - 4
        assert nx.is_biconnected(chain)


def test_no_two_chains_are_alike():
    result = chains(8)
    assert not any(nx.is_isomorphic(a, b) for i, a in enumerate(result) for b in result[:i])


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
    grid = np.linspace(design.at[0], design.at[-1], 721)
    margin = mech.run(at=grid, want="dyad.margin")["dyad.margin"]
    return mech.run(at=design.at, want="dyad.P.p")["dyad.P.p"], margin


def test_a_path_through_six_points_is_met():
    designs = path_generator(POINTS, starts=4096)
    assert designs[0].miss < 1e-6
    for design in designs:
        positions, margin = passed(design)
        assert np.abs(positions - POINTS) == pytest.approx(design.errors, abs=1e-9)
        assert margin.min() > 0  # no change of circuit or branch on the way
        assert margin.min() == pytest.approx(design.margin, rel=1e-3)
        steps = np.diff(design.at)
        assert (steps > 0).all() or (steps < 0).all()
    assert [d.margin for d in designs] == sorted((d.margin for d in designs), reverse=True)


def test_derivatives_of_the_pose_are_those_of_differences():
    shape = np.array([[1.1, 0.3, 0.9, 1.0, 1.0, 1.2], [1.2, 1.3, 0.8, 0.7, -1.0, 0.2]])
    theta, branch, h = np.array([[0.1, 1.3], [2.0, 2.9]]), np.array([1, -1]), 1e-6
    base = pose(shape, theta, branch)
    for k in range(7):
        a, b = (
            pose(shape + s * h * (np.arange(6) == k), theta + s * h * (k == 6), branch)
            for s in (1, -1)
        )
        for name, by in (("point", "by_point"), ("coupler", "by_coupler"), ("rocker", "by_rocker")):
            slope = (getattr(a, name) - getattr(b, name)) / (2 * h)
            assert getattr(base, by)[..., k] == pytest.approx(slope, abs=1e-8)


def test_a_closed_path_takes_a_full_turn():
    """Ten points of an ellipse, the last the first (Acharyya & Mandal 2009, case 2)."""
    x = [20, 17.66, 11.736, 5, 0.60307, 0.60307, 5, 11.736, 17.66, 20]
    y = [10, 15.142, 17.878, 16.928, 12.736, 7.2638, 3.0718, 2.1215, 4.8577, 10]
    design = path_generator(np.column_stack([x, y]), starts=2**13, count=1)[0]
    assert abs(design.at[-1] - design.at[0]) == pytest.approx(2 * np.pi, abs=1e-12)
    assert design.miss < 0.002
    assert passed(design)[1].min() > 0


def test_a_known_fourbar_is_found_again_from_its_timed_path():
    shape = [np.log(3.0), 0.3, np.log(2.5), np.log(2.8), 1.0, 1.2]
    theta = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    expected = 0.4 * np.exp(0.7j) * bm.synthesis.coupler_point(shape, theta, 1) + 1 - 2j
    designs = path_generator(expected, theta, starts=2**13)
    assert designs[0].miss < 1e-8
    again = path_generator(expected, theta, starts=2**13)
    assert again[0].miss == designs[0].miss  # the same seed


def test_positions_are_read_with_units():
    by_texts = [("0 mm", 0, "0 deg"), ("1 m", "50 cm", "22.5 deg"), (1.6, 1.4, "1 rad")]
    plain = [(0.0, 0.0, 0.0), (1.0, 0.5, np.pi / 8), (1.6, 1.4, 1.0)]
    moving = [0.2 - 1.0j, 1.0 - 0.7j]
    numbers = three_positions(plain, moving).graph.to_data()
    assert three_positions(by_texts, moving).graph.to_data() == numbers
    with pytest.raises(bm.RequestError, match='"1 kg" has another kind of unit'):
        three_positions([*plain[:2], ("1 kg", 0, 0)], moving)


def test_three_positions_are_met():
    positions = [(0.0, 0.0, 0.1), (1.0, 0.5, 0.5), (1.6, 1.4, 1.0)]
    for moving in ([0.2 - 1j, 1.0 - 0.7j], [0.0, 1.0], [0.5 - 2j, 2.0 - 1j]):
        design = three_positions(positions, moving)
        run = design.graph.run(at=design.at, want=["dyad.P.p", "dyad.i.angle"])
        assert run["dyad.P.p"] == pytest.approx([x + 1j * y for x, y, _ in positions], abs=1e-12)
        assert np.diff(run["dyad.i.angle"]) == pytest.approx([0.4, 0.5], abs=1e-12)


def body(angles, shape=(1.0986122886681098, 0.3, 0.9, 1.0, 1.0, 1.2)):
    """Positions of the coupler of a known four-bar."""
    at = pose(np.array(shape), np.asarray(angles), np.array(1))
    return np.column_stack([at.point.real, at.point.imag, at.coupler])


def test_pins_of_five_positions_stay_on_their_circles():
    """Both pins of the four-bar are among them, and there are at most four (Burmester)."""
    rows = body(np.linspace(0.2, 2.0, 5))
    pins = burmester_pins(rows, np.random.default_rng(0))
    assert 2 <= len(pins) <= 4
    centres = np.array([m for _, m in pins])
    assert np.abs(centres).min() < 1e-9  # the crank's pivot
    assert np.abs(centres - 3 * np.exp(0.3j)).min() < 1e-9
    for w, m in pins:
        turn = np.exp(1j * (rows[:, 2] - rows[0, 2]))
        z = rows[:, 0] + 1j * rows[:, 1]
        assert np.ptp(np.abs(z + turn * (w - z[0]) - m)) < 1e-12


@pytest.mark.parametrize("n", [3, 4, 5, 7])
def test_three_and_more_positions_are_met(n):
    rows = body(np.linspace(0.2, 2.0, n))
    designs = body_guidance(rows, tried=8)
    assert len(designs)
    for design in designs:
        run = design.graph.run(at=design.at, want=["dyad.P.p", "dyad.i.angle"])
        assert run["dyad.P.p"] == pytest.approx(rows[:, 0] + 1j * rows[:, 1], abs=1e-9)
        turned = run["dyad.i.angle"] - rows[:, 2]
        assert np.exp(1j * (turned - turned[0])) == pytest.approx(np.ones(n), abs=1e-9)
        assert passed(design)[1].min() > 0


def test_where_five_positions_have_no_fourbar_the_nearest_is_given():
    rows = [(0, 0, 0.0), (1, 0.2, 0.9), (1.2, 1.1, 0.1), (0.4, 1.6, 0.7), (0.1, 2.4, 0.2)]
    designs = body_guidance(rows)
    assert designs[0].miss > 1e-3
    run = designs[0].graph.run(at=designs[0].at, want="dyad.P.p")["dyad.P.p"]
    assert (
        np.abs(run - np.array([x + 1j * y for x, y, _ in rows])) <= designs[0].errors + 1e-9
    ).all()


@pytest.mark.parametrize("n", [3, 5, 9])
def test_a_function_is_followed(n):
    """log x over 1 to 2, crank 60 degrees, rocker 90 (Hartenberg & Denavit, ch. 10)."""
    x = np.linspace(1.0, 2.0, n)
    phi, psi = np.radians(60) * (x - 1), np.radians(90) * np.log2(x)
    design = function_generator(phi, psi)[0]
    assert design.miss < {3: 1e-12, 5: 1e-12, 9: 2e-4}[n]
    run = design.graph.run(at=phi, want="dyad.j.angle")["dyad.j.angle"]
    off = np.abs(np.angle(np.exp(1j * (run - psi))))
    assert off == pytest.approx(design.errors, abs=1e-12)


def test_positions_on_a_line_have_no_pivot():
    with pytest.raises(bm.RequestError, match="straight line"):
        three_positions([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [0.0, 1.0])


@pytest.mark.parametrize(
    ("points", "angles", "message"),
    [
        ([1.0, 2.0], None, "three points or more"),
        ("abc", None, "points"),
        ([0.0, 1.0, 2j], [0.0, 1.0, 0.5], "rising or falling"),
        ([0.0, 1.0, 2j], [0.0, 1.0], "one for each position"),
    ],
)
def test_what_is_no_path_is_refused(points, angles, message):
    with pytest.raises(bm.RequestError, match=message):
        path_generator(points, angles)


@pytest.mark.parametrize(
    ("call", "arguments"),
    [
        (lambda: function_generator([0.0, 1.0], [0.0, 1.0]), "three angles or more"),
        (lambda: function_generator([0.0, 1.0, 0.5], [0.0, 1.0, 2.0]), "rising or falling"),
        (lambda: body_guidance([(0, 0, 0), (1, 0, 0)]), "give 3 or more rows"),
        (lambda: body_guidance([(1, 1, 0.5)] * 4), "positions that differ"),
        (lambda: three_positions([(0, 0, 0)] * 4, [0, 1]), "give 3 rows"),
        (lambda: path_generator(POINTS, starts=0), "2 or more"),
    ],
)
def test_what_is_no_task_is_refused(call, arguments):
    with pytest.raises(bm.RequestError, match=arguments):
        call()


def test_every_candidate_is_a_file(tmp_path):
    designs = path_generator(POINTS, starts=1024)
    paths = [*saved(designs, tmp_path / "designs")]
    assert len(paths) == len(designs)
    for path, design in zip(paths, designs, strict=True):
        run = bm.Graph.load(path).run(at=design.at, want="dyad.P.p")
        assert np.abs(run["dyad.P.p"] - POINTS) == pytest.approx(design.errors, abs=1e-9)


def test_points_and_angles_are_texts_with_units():
    inch = path_generator([["0 in", 0.0], ["1 in", "0.2in"], ["2 in", 0.0]], starts=64, count=1)
    metres = path_generator([[0.0, 0.0], [0.0254, 0.00508], [0.0508, 0.0]], starts=64, count=1)
    assert inch[0].graph.to_json() == metres[0].graph.to_json()
    degrees = function_generator(["0deg", "45deg", "90deg"], [0.0, "9deg", "36deg"], starts=64)
    radians = function_generator(
        np.radians([0.0, 45.0, 90.0]), np.radians([0.0, 9.0, 36.0]), starts=64
    )
    assert degrees[0].graph.to_json() == radians[0].graph.to_json()
    with pytest.warns(UnitWarning, match='"60deg"'):
        function_generator([0, 30, 60], [0.0, 0.2, 0.5], starts=64)
    rows = [(0, 0, "0deg"), (1, "50cm", "10deg"), (2, 1.5, "40deg")]
    texts = three_positions(rows, [("0mm", "0mm"), ("500mm", 0.0)])
    si = [(0, 0, 0.0), (1, 0.5, np.radians(10.0)), (2, 1.5, np.radians(40.0))]
    assert texts.graph.to_json() == three_positions(si, [0, 0.5]).graph.to_json()
    with pytest.raises(bm.RequestError, match=r"points: .*parsec"):
        path_generator([["0 in", 0.0], ["1 parsec", 0.0], ["2 in", 0.0]])
