"""The structural graph of the second paper, and centrodes that roll on each other."""

import numpy as np
import pytest

from blockmech.draw import draw
from blockmech.draw.mechanism import centrodes
from blockmech.draw.structural import draw_structural_graph, structural_graph
from blockmech.ground.errors import RequestError
from tests.gallery import GRAPHS, mechanism
from tests.machines import ruiz, watt


def test_vertices_are_links_and_freedoms_as_in_the_paper():
    graph = structural_graph(watt().compile())
    result = {name: (data["links"], data["freedoms"]) for name, data in graph.nodes(data=True)}
    dyads = [n for n in graph if n not in ("frame", "crank")]
    assert result["frame"] == (("0",), 0)
    assert result["crank"] == (("1",), 1)
    assert [result[n] for n in dyads] == [(("2", "3"), 0), (("4", "5"), 0)]
    pairs = sum(len(pairs) for *_, pairs in graph.edges(data="pairs"))
    assert pairs == 5  # seven of the mechanism, less the two inside of dyads
    figure = draw_structural_graph(watt().compile())
    labels = [text.get_text() for text in figure.axes[0].texts]
    assert {"1,0", "1,1", "2,0", "(2,3)", "(4,5)"} <= set(labels)


@pytest.mark.parametrize("path", sorted(GRAPHS.glob("*.json")), ids=lambda path: path.stem)
def test_freedoms_of_the_vertices_are_the_mobility(path):
    mech = mechanism(path.stem)
    graph = structural_graph(mech)
    assert sum(data["freedoms"] for _, data in graph.nodes(data=True)) == len(mech.drivers)
    assert sum(len(data["links"]) for _, data in graph.nodes(data=True)) == len(
        mech.structure.links
    )


def test_centrodes_of_a_connecting_rod_touch_and_roll():
    mech = ruiz().compile()
    q = np.linspace(0.0, 0.3, 401)
    result = centrodes(mech, "dyad.i", q)
    fixed, moving = result["fixed centrode"], result["moving centrode"]
    assert abs(fixed[0] - moving[0]) < 1e-12  # both hold the instant centre of the first pose
    lengths = [np.abs(np.diff(curve)).sum() for curve in (fixed, moving)]
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-5)  # rolling: equal arcs
    start = [curve[1] - curve[0] for curve in (fixed, moving)]
    assert abs(np.angle(start[1] / start[0])) < 5e-3  # one tangent, to the step of the samples


def test_both_are_kinds_of_pictures(tmp_path):
    draw(watt(), tmp_path / "s.svg", "structure")
    draw(ruiz(), tmp_path / "c.svg", "centrodes", want="dyad.i")
    q = np.linspace(0.9, 1.3, 9)
    draw(ruiz(), tmp_path / "d.svg", "centrodes", q, want="dyad.i")
    assert all((tmp_path / f"{name}.svg").exists() for name in "scd")
    with pytest.raises(RequestError, match="it does not name a link"):
        draw(ruiz(), tmp_path / "c.svg", "centrodes")
    with pytest.raises(RequestError, match='kind "structure" takes no at='):
        draw(watt(), tmp_path / "s.svg", "structure", at=1.0)
