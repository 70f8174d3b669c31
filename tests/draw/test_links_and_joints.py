"""Pictures of a document of links and joints show its own names."""

from __future__ import annotations

import cmath

import numpy as np
import pytest

import blockmech as bm
from blockmech.draw.diagram import draw_diagram
from blockmech.draw.mechanism import draw_mechanism, paths_of
from blockmech.draw.motion import moves
from blockmech.draw.shapes import Stage, drive_ways
from blockmech.draw.sketch import line_sign, sketch_of
from blockmech.editor.drawing import of_links
from blockmech.figures.curves import pictures_of
from blockmech.ground.errors import RequestError
from tests.gallery import GRAPHS
from tests.model.documents import DOCUMENTS, flipped, linkage


@pytest.fixture
def crank():
    return linkage(DOCUMENTS["slider_crank"]())


def words(artists):
    return {line for artist in artists for line in artist.get_text().split("\n")}


def test_a_mechanism_has_the_names_of_its_joints_and_links(crank):
    picture = draw_mechanism(crank.compile(), at=0.5)
    names = words(picture.labels)
    assert {"O", "A", "B", "S", "crank", "rod", "piston", "q"} <= names
    captions = [t.get_text() for t in picture.figure.texts if t.get_label() == "caption"]
    assert captions[0].startswith("motor at\u00a028.65°")


def test_a_pin_of_three_links_has_one_name():
    picture = draw_mechanism(linkage(DOCUMENTS["arm"]()).compile())
    names = words(picture.labels)
    assert "knot" in names
    assert {"lift.q", "bend.q"} <= names


def test_paths_are_those_of_the_documents_markers(crank):
    motion = moves(crank.compile(), samples=9)
    assert list(paths_of(motion, None)) == ["link.rod.P"]
    result = paths_of(motion, ["link.rod.P", "joint.B"])
    run = crank.run(samples=9, want=["link.rod.P.p"])
    assert np.abs(result["link.rod.P"] - run["link.rod.P.p"]).max() <= 1e-15
    with pytest.raises(RequestError, match=r"rod_piston\.C.*link\.rod\.P"):
        paths_of(motion, ["rod_piston.C"])


@pytest.mark.parametrize(
    ("kind", "load"),
    [
        ("spring", bm.Spring(stiffness=10.0, damping=1.0)),
        ("damper", bm.Spring(stiffness=0.0, damping=1.0)),
        ("strut", bm.Thrust(law=bm.laws.Constant(value=5.0))),
    ],
)
def test_lines_of_loads_have_one_sign_in_print_and_studio(crank, kind, load):
    crank.add_load("line", load, links=["frame", "piston"], at=[(9.0, 1.0), (0.0, 0.0)])
    picture = draw_mechanism(crank.compile(), at=0.5)
    (line,) = (x for x in picture.axes.lines if x.get_label() == f"{kind}:line")
    z = line.get_xydata() @ [1, 1j]
    sign = line_sign(kind, (len(z) - 4) // 2)
    assert len(z) == len(sign)
    across = (((z - z[0]) / (z[-1] - z[0])).imag * abs(z[-1] - z[0])) / picture.stage.unit
    assert np.abs(across - sign[:, 2]).max() < 1e-9  # points of the page
    assert line_sign(kind).tolist() in [x["line"] for x in of_links(crank.to_data())["loads"]]


def test_loads_between_the_same_places_lie_side_by_side(crank):
    spring, damper = bm.Spring(stiffness=10.0), bm.Spring(stiffness=0.0, damping=1.0)
    crank.add_load("spring", spring, links=["frame", "piston"], at=[(9.0, 1.0), (0.0, 0.0)])
    crank.add_load("damper", damper, links=["piston", "frame"], at=[(0.0, 0.0), (9.0, 1.0)])
    picture = draw_mechanism(crank.compile(), at=0.5)
    lines = {x.get_label(): x.get_xydata() @ [1, 1j] for x in picture.axes.lines}
    z, w = lines["spring:spring"], lines["damper:damper"]
    assert np.abs(np.array([z[0] - w[-1], z[-1] - w[0]])).max() < 1e-12
    across = [((x - z[0]) / (z[-1] - z[0])).imag * abs(z[-1] - z[0]) for x in (z[2:-2], w[2:-2])]
    assert across[0].mean() * across[1].mean() < 0
    assert np.abs(across[0] - across[1].mean()).min() > picture.stage.unit
    signs = [line_sign(kind, offset=-5.0).tolist() for kind in ("spring", "damper")]
    assert [x["line"] for x in of_links(crank.to_data())["loads"][-2:]] == signs


def test_wheels_look_the_same_in_all_poses():
    wheels = bm.Linkage("gears")
    for link, joint, x in (("pinion", "P", 0.0), ("wheel", "W", 0.06)):
        wheels.add_link(link)
        wheels.add_joint(joint, "R", ["frame", link], point=(x, 0.0))
    wheels.add_driver("motor", "P", bm.motion.ConstantRate(rate=100.0))
    wheels.add_driver("out", "W")
    wheels.add_coupling("mesh", "gear", driver="motor", driven="out", teeth=(20, 40))
    picture = draw_mechanism(wheels.compile())
    assert not [x for x in picture.axes.lines if x.get_label().startswith("faint:")]
    assert "faintly" not in picture.figure.texts[0].get_text()


def test_markers_of_the_user_have_a_mark_and_a_name(crank):
    picture = draw_mechanism(crank.compile(), trace="link.rod.P")
    assert [x.get_label() for x in picture.axes.lines if "marker" in x.get_label()] == ["marker:P"]
    assert "P" in words(picture.labels)


def test_an_arrow_shows_where_the_driven_link_goes_however_its_joint_is_named(crank):
    mirrored = linkage(flipped(DOCUMENTS["slider_crank"](), "O"))
    ways = []
    for mechanism in (crank.compile(), mirrored.compile()):
        motion = moves(mechanism, samples=5)
        stage = Stage(sketch_of(motion), motion, 0.01)
        ways.append(drive_ways(stage)["motor"][:, 1])
    assert np.abs(np.subtract(*ways)).max() <= 1e-15


def test_a_diagram_names_joints_and_links_beside_the_blocks(crank):
    mechanism = crank.compile()
    diagram = draw_diagram(crank.decompose().graph, mechanism.names)
    names = words(diagram.labels)
    assert {"II RRP: rod, piston", "I crank: crank", "A (R)", "S (P)", "rod_piston"} <= names
    assert "I(crank) → II RRP(rod, piston)" in names
    assert "B (R)" not in names  # the block's own name for the joint A


def test_curves_of_a_run_are_named_after_joints(crank):
    panels = pictures_of(crank.run(samples=13))
    names = {name for panel in panels["reactions"] for name in panel.curves}
    assert names == {"joint.A", "joint.B", "joint.O", "joint.S"}


def test_links_and_joints_are_drawn_as_the_mechanism_by_default(crank, tmp_path):
    path = tmp_path / "mechanism.svg"
    crank.draw(path, kind="mechanism")
    text = path.read_text("utf-8")
    for subject in (crank, crank.compile()):
        subject.draw(path)
        assert path.read_text("utf-8") == text
    crank.decompose().graph.compile().draw(path)
    assert "rod_piston" in path.read_text("utf-8")
    assert "rod_piston" not in text


def test_a_document_is_drawn_as_a_diagram_of_its_blocks(crank, tmp_path):
    crank.compile().draw(tmp_path / "diagram.svg", kind="diagram")
    text = (tmp_path / "diagram.svg").read_text("utf-8")
    assert "rod_piston" in text
    assert "rod, piston" in text


def welded_and_dimensioned():
    """A crank with an arm welded to it, and the dimensions of both and of the pose."""
    m = bm.Linkage("arm")
    m.add_link("crank", pose=(1.0, 0.0, 0.5))
    m.add_link("arm", pose=(1.0, 0.0, 0.5), markers={"E": (2.0, 1.0)})
    m.add_joint("A", "R", ["frame", "crank"], [(1.0, 0.0), (0.0, 0.0)])
    m.add_joint("W", "weld", ["crank", "arm"], [(2.0, 0.0), (2.0, 0.0)])
    m.add_driver("motor", "A")
    form = m.to_data()
    form["dimensions"] = {
        "stem": {"type": "length", "points": ["A", "W"], "value": 2.0},
        "tip": {"type": "length", "points": ["W", "arm.E"], "value": 1.0},
        "corner": {"type": "perpendicular", "points": ["A", "W", "W", "arm.E"]},
        "start": {"type": "angle", "points": ["A", "W"], "value": 0.5},
    }
    return bm.Linkage.from_data(form).compile()


@pytest.mark.parametrize("q", [0.5, 2.0])
def test_welds_and_the_dimensions_that_hold_in_a_pose_are_drawn(q):
    picture = draw_mechanism(welded_and_dimensioned(), q)
    labels = words(picture.labels)
    assert {"W", "2 m", "1 m", "⊥"} <= labels
    assert ("∠ 28.65°" in labels) == (q == 0.5)
    (weld,) = (a for a in picture.axes.patches if a.get_label() == "weld:W")
    turn = cmath.rect(1.0, q)
    corners = weld.get_xy()[:4] @ (1, 1j)
    assert corners.mean() == pytest.approx(1.0 + 2.0 * turn)
    (line, _) = (a for a in picture.axes.lines if a.get_label() == "dimension:stem")
    x, y = line.get_data()
    direction = complex(x[-1] - x[0], y[-1] - y[0])
    assert abs((direction * turn.conjugate()).imag) < 1e-9 * abs(direction)


def test_wheels_have_bodies_beneath_their_links_the_smaller_on_the_larger():
    picture = draw_mechanism(bm.read(GRAPHS / "joints" / "planetary_hoist.json").compile())
    bodies = {a.get_label(): a for a in picture.axes.patches if a.get_label().startswith("body:")}
    circles = [a for a in picture.axes.lines if a.get_label().startswith("wheel:")]
    assert len(bodies) == len(circles) > 2
    by_order = sorted(bodies.values(), key=lambda body: body.get_zorder())
    widths = [np.ptp(body.get_xy()[:, 0]) for body in by_order]
    assert widths == sorted(widths, reverse=True)
    links = [a.get_zorder() for a in picture.axes.lines if a.get_label().startswith("link:")]
    assert by_order[-1].get_zorder() < min(links)


def test_a_legend_is_read_row_by_row():
    """Entries in the order of the curves: the first ones stand in the first row."""
    run = bm.read(GRAPHS / "joints" / "engine.json").run(samples=5, want="joint.*.reaction")
    figure = run.plot()
    figure.canvas.draw()
    texts = figure.axes[0].get_legend().get_texts()
    at = {t.get_text(): t.get_window_extent().get_points()[0] for t in texts}
    names = [line.get_label() for line in figure.axes[0].lines if line.get_label() in at]
    assert sorted(at, key=lambda name: (-round(at[name][1]), at[name][0])) == names
    assert len({round(y) for _, y in at.values()}) > 1
