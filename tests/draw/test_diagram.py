"""The block diagram as a picture."""

from __future__ import annotations

import hashlib
import itertools
import os
import subprocess
import sys
from xml.etree import ElementTree

import pytest
from matplotlib.colors import to_hex

import blockmech as bm
from blockmech import Graph
from blockmech.draw import svg
from blockmech.draw.diagram import Diagram, draw_diagram
from blockmech.figures import palette
from blockmech.figures.paper import styled
from tests.draw.scenes import cyclic, quick_return, rocking_slide, slider_crank, twelve, unfinished
from tests.machines import chain, ruiz, toggle, watt

TOUCH = 0.3  # [px of 1/72 in] by which boxes of glyphs may be wider than their ink
SVG = "{http://www.w3.org/2000/svg}"
LONG = "a name that goes on and on for much longer than any box should be"


def odd_names() -> Graph:
    """Names that a picture could choke on."""
    g = Graph("odd", title="<script>alert(1)</script> & more \x07 and \x00")
    g.add("frame", bm.Frame(markers={"$A_1$": (0.0, 0.0), "D]]>": (5.0, 0.0)}))
    g.add(LONG, bm.Crank(length=2.0))
    g.add("<dyad>&\"'", bm.RRR(l_i=6.0, l_j=3.0))
    g.add("中文\\n", bm.Force(force=(0.0, -1.0)))
    pairs = (
        ("frame.$A_1$", f"{LONG}.A"),
        (f"{LONG}.B", "<dyad>&\"'.B"),
        ("frame.D]]>", "<dyad>&\"'.D"),
        ("<dyad>&\"'.C", "中文\\n.at"),
    )
    for source, target in pairs:
        g.connect(source, target)
    return g


SCENES = {
    f.__name__: f
    for f in (
        *(ruiz, watt, toggle, twelve, slider_crank, quick_return, rocking_slide),
        *(unfinished, cyclic, odd_names),
    )
}


@pytest.fixture(params=SCENES)
def drawn(request: pytest.FixtureRequest) -> Diagram:
    return draw_diagram(SCENES[request.param]())


def extents(diagram: Diagram, artists) -> list:
    """Bounding boxes in points, y upward, as the renderer sees them."""
    with styled():
        diagram.figure.set_dpi(72)
        diagram.figure.canvas.draw()
        renderer = diagram.figure.canvas.get_renderer()
        return [a.get_window_extent(renderer) for a in artists]


def overlapping(boxes) -> list[tuple[int, int]]:
    return [
        (i, j)
        for (i, a), (j, b) in itertools.combinations(enumerate(boxes), 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > TOUCH and min(a.y1, b.y1) - max(a.y0, b.y0) > TOUCH
    ]


def labelled(diagram: Diagram, start: str) -> list:
    result = [*diagram.axes.patches, *diagram.axes.lines]
    return [a for a in result if str(a.get_label()).startswith(start)]


def test_labels_lie_on_the_page_and_not_on_another_nor_across_the_edge_of_a_box(drawn):
    boxes, labels = extents(drawn, labelled(drawn, "box:")), extents(drawn, drawn.labels)
    result = overlapping(labels)
    assert not [(drawn.labels[i].get_text(), drawn.labels[j].get_text()) for i, j in result]
    width, height = (72 * inches for inches in drawn.figure.get_size_inches())
    for label, text in zip(labels, drawn.labels, strict=True):
        assert min(label.x0, label.y0, width - label.x1, height - label.y1) >= 0
        for box in boxes:
            apart = (
                label.x1 < box.x0 + TOUCH
                or label.x0 > box.x1 - TOUCH
                or label.y1 < box.y0 + TOUCH
                or label.y0 > box.y1 - TOUCH
            )
            inside = label.x0 > box.x0 and label.x1 < box.x1 and label.y0 > box.y0
            assert apart or (inside and label.y1 < box.y1), text.get_text()


def test_every_wire_runs_from_its_marker_to_its_port(drawn):
    ports = {str(a.get_label()).split(":", 1)[1] for a in labelled(drawn, "port:")}
    arrows = {str(a.get_label()).split(":", 1)[1]: a for a in labelled(drawn, "back:")}
    for i, wire in enumerate(drawn.content.wires):
        route, (source, marker, target, port) = drawn.placed.ways[i], wire.ends
        assert (route[0], route[-1]) == drawn.placed.ends(i)
        assert f"{target}.{port}" in ports
        if i not in drawn.placed.made.backward:
            assert f"{source}.{marker} -> {target}.{port}" in arrows


def test_motion_flows_forward_and_force_back_in_two_colours():
    diagram = draw_diagram(ruiz())
    forward, back = labelled(diagram, "forward:"), labelled(diagram, "back:")
    assert {to_hex(a.get_edgecolor()) for a in forward} == {palette.FORWARD.lower()}
    assert {to_hex(a.get_edgecolor()) for a in back} == {palette.BACK.lower()}
    assert len(forward) == 3 + 1, "three joints, and the coordinate of the drive"
    assert len(back) == 5 + 1, "three joints, two loads, and the driving moment"
    texts = {t.get_text() for t in diagram.labels}
    assert {"q [rad]", "τ [N m]"} <= texts


def test_a_load_that_reads_its_marker_gets_motion_forward():
    diagram = draw_diagram(rocking_slide())
    heads = {a.get_label() for a in labelled(diagram, "forward:")}
    assert "forward:dyad.E -> spring.b" in heads
    assert "forward:dyad.j -> couple.on" not in heads


def test_a_joint_without_a_wire_is_red_and_others_are_not():
    diagram = draw_diagram(unfinished())
    red = palette.ALARM.lower()
    unwired = labelled(diagram, "unwired:")
    assert {a.get_label() for a in unwired} == {"unwired:dyad.D", "unwired:load.at"}
    assert {to_hex(a.get_markeredgecolor()) for a in unwired} == {red}
    assert all(to_hex(a.get_markeredgecolor()) != red for a in labelled(diagram, "port:"))
    texts = {t.get_text(): to_hex(t.get_color()) for t in diagram.labels}
    assert texts["D (R)"] == red
    assert texts["A (R)"] != red
    assert not labelled(draw_diagram(ruiz()), "unwired:")


def test_a_block_of_unknown_type_is_hatched_and_keeps_its_wires():
    diagram = draw_diagram(unfinished())
    (rod,) = labelled(diagram, "box:rod")
    assert rod.get_hatch()
    assert [a.get_label() for a in labelled(diagram, "port:rod")] == ["port:rod.X"]
    (crank,) = labelled(diagram, "box:crank")
    assert not crank.get_hatch()


def test_the_wire_that_closes_a_cycle_is_red():
    diagram = draw_diagram(cyclic())
    (wrong,) = labelled(diagram, "cycle:")
    assert to_hex(wrong.get_edgecolor()) == palette.ALARM.lower()


def test_names_come_back_from_the_svg_as_they_are():
    root = ElementTree.fromstring(svg(odd_names().draw()))
    texts = [t.text for t in root.iter(f"{SVG}text")]
    assert "<dyad>&\"'" in texts
    assert "$A_1$" in texts
    assert any(t and t.startswith("<script>") and "\\x07" in t for t in texts)
    assert not list(root.iter(f"{SVG}script"))


def test_the_same_graph_gives_the_same_svg_in_any_process_without_pyplot():
    code = (
        "import sys, hashlib, blockmech.draw\n"
        "from tests.draw.scenes import twelve\n"
        "assert 'matplotlib' not in sys.modules\n"
        "print(hashlib.sha256(blockmech.draw.svg(twelve().draw()).encode()).hexdigest())\n"
        "assert 'matplotlib' in sys.modules and 'matplotlib.pyplot' not in sys.modules"
    )
    seed = {"0": "1"}.get(os.environ.get("PYTHONHASHSEED", ""), "0")
    run = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONHASHSEED": seed},
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.strip() == hashlib.sha256(svg(twelve().draw()).encode()).hexdigest()
    assert "<dc:date>" not in svg(ruiz().draw())


def test_places_that_the_author_gave_are_honoured():
    g = ruiz()
    g.extras["view"] = {"frame": [0, 0], "crank": [150, 40], "dyad": [300, 90]}
    boxes = draw_diagram(g).placed.boxes
    assert boxes["crank"].x - boxes["frame"].x == 150
    assert boxes["dyad"].y - boxes["frame"].y == 90
    assert boxes["couple"].y > boxes["dyad"].y + boxes["dyad"].height, "the others stand below"


def test_a_very_long_chain_is_cut_and_says_so():
    diagram = draw_diagram(chain(100))
    assert len(diagram.content.blocks) == 40
    assert diagram.labels[1].get_text().startswith("first 40 of 102 blocks")
    assert not labelled(diagram, "unwired:")
