"""The mechanism at poses as a picture."""

from __future__ import annotations

import cmath
import itertools
import math

import numpy as np
import pytest
from matplotlib.colors import to_hex

import blockmech as bm
from blockmech.draw.labels import Crowd, Label
from blockmech.draw.mechanism import Picture, caption, draw_mechanism, draw_tile
from blockmech.draw.motion import moves, moves_of_result
from blockmech.draw.shapes import Stage, load_ways
from blockmech.draw.sketch import hull, sketch_of
from blockmech.figures import palette
from blockmech.figures.paper import styled
from blockmech.result.tables import table
from tests.draw.scenes import fourbar, quick_return, rocking_slide, slider_crank
from tests.gallery import GRAPHS
from tests.machines import chain, ruiz, toggle, watt, wire

ROUNDING = 1e-9  # of a mechanism's size: positions and angles through cosines and back
PIXEL = 1.5  # [px] of a label's box that may be beside its ink
SCENES = {
    f.__name__: f for f in (ruiz, watt, toggle, fourbar, slider_crank, quick_return, rocking_slide)
}


def artists(picture: Picture, start: str) -> list:
    result = [*picture.axes.lines, *picture.axes.patches]
    return [a for a in result if str(a.get_label()).startswith(start)]


def pins(picture: Picture) -> dict[str, complex]:
    """Names of joints -> places in metres, as drawn."""
    return {
        a.get_label().removeprefix("pin:"): complex(*a.get_xydata()[0])
        for a in artists(picture, "pin:")
    }


@pytest.fixture(params=SCENES)
def picture(request: pytest.FixtureRequest) -> Picture:
    return draw_mechanism(SCENES[request.param]().compile())


def test_no_label_lies_on_another_and_all_are_on_the_page(picture):
    assert picture.axes.get_aspect() == 1
    with styled():
        picture.figure.canvas.draw()
        renderer = picture.figure.canvas.get_renderer()
        boxes = [t.get_window_extent(renderer) for t in picture.labels]
    frame = picture.axes.get_window_extent()
    for a, b in itertools.combinations(boxes, 2):
        apart = min(a.x1, b.x1) - max(a.x0, b.x0) < PIXEL
        assert apart or min(a.y1, b.y1) - max(a.y0, b.y0) < PIXEL
    for box in boxes:
        assert box.x0 >= frame.x0 - PIXEL
        assert box.x1 <= frame.x1 + PIXEL
        assert box.y0 >= frame.y0 - PIXEL
        assert box.y1 <= frame.y1 + PIXEL


def test_arrows_of_forces_end_on_the_page():
    g = slider_crank()
    for name, force in (("pull", (900.0, 0.0)), ("push", (-900.0, 0.0)), ("lift", (0.0, 900.0))):
        g.add(name, bm.Force(force=force))
        g.connect("frame.O" if name == "push" else "crank.B", f"{name}.at")
    picture = draw_mechanism(g.compile(), at=[0.0, 3.0, 1.5])
    (low, high), (bottom, top) = picture.axes.get_xlim(), picture.axes.get_ylim()
    for load in picture.stage.sketch.loads:
        for arrow in load_ways(picture.stage, load):
            tip = arrow[-1]
            assert np.all((low < tip.real) & (tip.real < high))
            assert np.all((bottom < tip.imag) & (tip.imag < top))


def test_a_pin_of_several_joints_is_drawn_once_with_all_names():
    picture = draw_mechanism(watt().compile())
    chained = draw_mechanism(chain(2).compile())
    assert len(artists(picture, "pin:")) == 7
    names = [t.get_text() for t in chained.labels]
    assert "A" in names, "a name that is clear is short"
    assert "dyad00000.B" in names


def test_a_link_of_three_points_is_a_plate_and_one_of_two_a_bar():
    picture = draw_mechanism(ruiz().compile(), at=1.0)
    (plate,) = artists(picture, "link:dyad.i")
    (bar,) = artists(picture, "link:dyad.j")
    assert len(plate.get_xy()) == 3 + 1, "a closed triangle B, C, S"
    assert len(bar.get_xydata()) == 2
    run = ruiz().run(at=1.0, want=["dyad.S.p"])
    assert min(abs(complex(*p) - run["dyad.S.p"][0]) for p in plate.get_xy()) < ROUNDING


def test_further_poses_are_faint():
    picture = draw_mechanism(ruiz().compile(), at=[1.0, 2.0, 3.0])
    assert len(artists(picture, "link:")) == 3
    assert len(artists(picture, "faint:")) == 2 * 3
    (text,) = picture.figure.texts
    title, poses = text.get_text().rsplit("\n", 1)
    assert title == "Four-bar of Ruiz, Durango & Calle 2010, Table 1"
    assert poses == "crank at\u00a057.3° (faintly at 114.6°, 171.9°)"


@pytest.mark.parametrize(("unit", "label"), [("rad", "1\u00a0rad"), ("deg", "57.3°")])
def test_pictures_and_text_say_angles_in_one_unit(unit, label):
    run = ruiz().run(at=[1.0]).to(unit)
    assert caption(moves_of_result(run), [0]).startswith(f"crank at\u00a0{label}")
    assert f"[{unit}]" in table(run)


def test_a_mechanism_is_drawn_in_units_of_choice():
    """Axes, lengths of dimensions and captions; what is drawn stays where it is."""
    mechanism = slider_crank().compile()
    metres, inches = (mechanism.draw(at="40deg", unit=unit) for unit in ("m", ["in", "rad"]))
    axes, scaled = metres.axes[0], inches.axes[0]
    assert (axes.get_xlabel(), scaled.get_xlabel()) == ("x [m]", "x [in]")
    assert scaled.get_xlim() == pytest.approx(np.array(axes.get_xlim()) / 0.0254)
    assert "40°" in metres.texts[0].get_text()
    assert "0.6981\u00a0rad" in inches.texts[0].get_text()
    pins = [
        [x.get_transform().transform(x.get_xydata()) for x in a.lines if "pin" in x.get_label()]
        for a in (axes, scaled)
    ]
    assert np.allclose(*pins, atol=1e-9)
    blocks = ruiz().draw(unit="mm")  # a diagram has no lengths
    assert blocks.axes[0].get_xlabel() == "x [mm]"
    film = bm.draw.animate(mechanism.run(samples=4).to("mm"))
    assert film.page.axes.get_ylabel() == "y [mm]"
    with pytest.raises(bm.RequestError, match='no unit "parsec"'):
        mechanism.draw(at=0.5, unit="parsec")
    with pytest.raises(bm.RequestError, match="takes no unit="):
        mechanism.draw(kind="structure", unit="mm")


def test_a_slider_is_drawn_on_its_guide():
    mechanism = slider_crank().compile()
    picture = draw_mechanism(mechanism, at=0.7)
    (block,) = artists(picture, "slider:S")
    middle = block.get_xy()[:-1].mean(axis=0)
    piston = mechanism.run(at=0.7, want=["rod.C.p"])["rod.C.p"][0]
    assert complex(*middle) == pytest.approx(piston, abs=ROUNDING)
    assert middle[1] == pytest.approx(-0.02, abs=ROUNDING)


def test_a_guide_covers_the_whole_travel_of_its_slider():
    mechanism = slider_crank().compile()
    motion = moves(mechanism, samples=721)
    (slider,) = sketch_of(motion).sliders
    travel = motion.at(*slider.point)
    ends = [slider.end(k).real for k in (0, 1)]
    assert ends[0] == pytest.approx(travel.real.min(), abs=ROUNDING)
    assert ends[1] == pytest.approx(travel.real.max(), abs=ROUNDING)


def test_a_slider_between_moving_links_stays_on_both():
    motion = moves(quick_return().compile(), samples=33)
    (slider,) = sketch_of(motion).sliders
    block = motion.at(*slider.point)
    foot = motion.at(slider.guide.link, slider.guide.at)
    line = motion.axis[slider.guide.link] * slider.direction
    assert ((block - foot) * np.conj(line)).imag == pytest.approx(np.zeros(33), abs=ROUNDING)


def test_pivots_and_guides_of_the_frame_have_ground():
    assert len(artists(draw_mechanism(ruiz().compile()), "ground")) == 2 * 2
    assert len(artists(draw_mechanism(slider_crank().compile()), "ground")) == 2 + 1
    assert len(artists(draw_mechanism(quick_return().compile()), "ground")) == 2 * 2


def test_a_force_points_where_it_pushes_and_says_how_hard():
    picture = draw_mechanism(ruiz().compile(), at=1.0)
    (shaft,) = artists(picture, "load:weightlike")
    (start, end) = (complex(*p) for p in shaft.get_xydata())
    assert cmath.phase(end - start) == pytest.approx(-math.pi / 2, abs=ROUNDING)
    assert to_hex(shaft.get_color()) == palette.LOAD.lower()
    assert {"weightlike 1000 N", "couple 250 N m"} <= {t.get_text() for t in picture.labels}


@pytest.mark.parametrize("moment", [-250.0, 250.0])
def test_a_couple_turns_the_way_of_its_sign(moment):
    g = fourbar()
    g.add("couple", bm.Couple(moment=moment))
    g.connect("dyad.j", "couple.on")
    motion = moves(g.compile(), 1.0)
    stage = Stage(sketch_of(motion), motion, 0.01)
    ((arc),) = load_ways(stage, stage.sketch.loads[0])
    arc = arc[:, 0]
    middle = sum(arc) / len(arc)
    turned = sum(cmath.phase((b - middle) / (a - middle)) for a, b in itertools.pairwise(arc))
    assert math.copysign(1, turned) == math.copysign(1, moment)


def test_a_spring_is_a_zigzag_between_its_markers():
    mechanism = rocking_slide().compile()
    picture = draw_mechanism(mechanism)
    (spring,) = artists(picture, "spring:")
    points = [complex(*p) for p in spring.get_xydata()]
    motion = picture.stage.motion
    ends = [complex(motion.at(*spot)[0]) for spot in picture.stage.sketch.loads[1].spots]
    assert points[0] == pytest.approx(ends[0], abs=ROUNDING)
    assert points[-1] == pytest.approx(ends[1], abs=ROUNDING)
    side = [((p - points[0]) / (points[-1] - points[0])).imag for p in points[2:-2]]
    assert all(a * b < 0 for a, b in itertools.pairwise(side))


def test_paths_show_feasible_parts_only():
    mechanism = fourbar(rocker=1.8).compile()
    picture = draw_mechanism(mechanism)
    (path,) = artists(picture, "path of dyad.C")
    visible = np.isfinite(path.get_xydata()[:, 0])
    reached = mechanism.run(samples=len(visible), want=["dyad.C.p"], on_gap="mark")
    assert (visible == np.isfinite(reached["dyad.C.p"])).all()
    assert 0 < visible.sum() < len(visible)


def test_a_mechanism_that_never_closes_and_unknown_markers_are_refused():
    with pytest.raises(bm.RequestError, match="unknown-marker") as error:
        draw_mechanism(ruiz().compile(), trace=["dyad.X", "frame.A", "dyad.C"])
    assert [p.where for p in error.value.problems] == ["dyad.X", "frame.A"]
    with pytest.raises(bm.AssemblyError):
        draw_mechanism(fourbar(rocker=20.0).compile())


def test_without_a_law_it_stands_where_it_starts_and_is_no_film():
    g = fourbar()
    g.scene = g.scene.model_copy(update={"drive": {}})
    g.start("crank", q=1.0)
    named = draw_mechanism(g.compile(), at=1.0)
    standing = draw_mechanism(g.compile())
    assert pins(standing) == pins(named)
    with pytest.raises(bm.RequestError, match="no law of motion says how far its drivers move"):
        bm.draw.animate(g)


def test_gravity_and_its_direction_are_in_the_caption():
    (text,) = draw_mechanism(slider_crank().compile()).figure.texts
    assert "gravity 9.81\u00a0m/s² ↓" in text.get_text().replace("\n", " ")
    assert not [t for t in draw_mechanism(ruiz().compile()).figure.texts if "grav" in t.get_text()]


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(GRAPHS.glob("*.json")), ids=lambda p: p.stem)
def test_every_graph_of_the_gallery_is_drawn(path):
    picture = draw_mechanism(bm.Graph.load(path).compile())
    links = {b.link for b in picture.stage.sketch.bodies}
    moving = set(picture.stage.motion.structure.links) - {picture.stage.motion.structure.frame_link}
    assert links == moving


def test_a_mechanism_without_drivers_is_a_truss_and_can_be_drawn():
    g = bm.Graph("truss")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (1.0, 0.0)}))
    g.add("dyad", bm.RRR(l_i=1.0, l_j=1.0))
    wire(g, "frame.A dyad.B", "frame.D dyad.D")
    points = pins(draw_mechanism(g.compile()))
    assert points["C"] == pytest.approx(complex(0.5, math.sqrt(0.75)), abs=ROUNDING)


def test_the_hull_is_convex_and_keeps_no_inner_point():
    square = [0j, 1 + 0j, 1 + 1j, 1j]
    assert set(hull([*square, 0.5 + 0.5j, 0.5 + 0j])) == set(square)
    assert set(hull([0j, 1 + 1j, 2 + 2j])) == {0j, 2 + 2j}
    assert hull([3j, 3j]) == (3j,)


def test_a_label_avoids_what_is_drawn_and_other_labels():
    crowd = Crowd(200 + 100j)
    crowd.add_line([100 + 50j, 200 + 50j], 5.0)
    first, second = (crowd.place(Label(name, [[100 + 50j]])) for name in ("one", "two"))
    apart, reach = first.centre() - second.centre(), first.half + second.half
    assert abs(apart.real) >= reach.real or abs(apart.imag) >= reach.imag
    for label in (first, second):
        below = abs(label.centre().imag - 50) < label.half.imag
        assert not (below and label.centre().real + label.half.real > 100)


def test_a_label_that_moves_avoids_what_is_drawn_in_any_frame():
    crowd = Crowd(200 + 100j, frames=(0, 1))
    crowd.add_line([0 + 53j, 200 + 53j], 5.0, frame=0)
    crowd.add_line([0 + 47j, 200 + 47j], 5.0, frame=1)
    label = crowd.place(Label("one", [[100 + 50j, 90 + 50j]]))
    assert label.centre(1) - label.centre(0) == -10
    for frame, line in enumerate((53, 47)):
        assert abs(label.centre(frame).imag - line) >= label.half.imag


@pytest.mark.parametrize("build", [slider_crank, quick_return])
def test_a_tile_is_a_square_that_holds_the_mechanism_without_words(build):
    mechanism = build().compile()
    figure = draw_tile(mechanism)
    (axes,) = figure.axes
    assert figure.get_figwidth() == figure.get_figheight()
    assert not axes.axison
    assert axes.get_legend() is None
    texts = [text.get_text() for text in (*figure.texts, *axes.texts)]
    assert not any(texts), texts
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    assert right - left == pytest.approx(high - low)
    run = mechanism.run(want="*.*.p")  # a guide's marker of the frame may lie far off
    z = np.concatenate([run[name] for name in run if not name.startswith("frame.")])
    assert ((left < z.real) & (z.real < right) & (low < z.imag) & (z.imag < high)).all()


def test_a_tile_of_a_single_point_has_a_size():
    mechanism = bm.Graph.load(GRAPHS / "motions" / "sticking_slider.json").compile()
    (axes,) = draw_tile(mechanism).axes
    assert np.ptp(axes.get_xlim()) > 0.0


def test_a_legend_of_long_names_stays_on_the_page():
    m = bm.Linkage("press")
    m.add_link("connecting_rod", markers={"guided_point": (0.5, 0.1), "second_point": (0.4, 0.1)})
    m.add_joint("O", "R", ["frame", "connecting_rod"], point=(0.0, 0.0))
    m.add_driver("motor", "O", bm.motion.ConstantRate(rate=1.0))
    names = [f"link.connecting_rod.{x}" for x in ("guided_point", "second_point")]
    figure = draw_mechanism(m.compile(), trace=names).figure
    figure.canvas.draw()
    legend = figure.axes[0].get_legend().get_window_extent()
    assert legend.x0 >= 0.0
    assert legend.x1 <= figure.bbox.width
