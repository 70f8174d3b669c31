"""The moving mechanism: poses as columns, gaps with their sentences, joints that are dragged."""

import copy
import re
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.draw.shapes import Stage
from blockmech.figures import palette
from blockmech.studio.component import script
from blockmech.studio.dragging import dragged, handles_of
from blockmech.studio.film import SHOWN, _under, names_of, scene_of
from blockmech.studio.mechanism import MechanismView
from blockmech.studio.plots import coloured
from blockmech.studio.sheet import Sheet
from blockmech.studio.turn import (
    blamed_blocks,
    dead_centres,
    travel,
    turn,
    what_moves,
)
from tests.studio.page import press, show

GRAPHS = Path(__file__).parents[2] / "graphs"
GALLERY = sorted(path.stem for path in GRAPHS.glob("*.json"))
LONG = ("n_four_bar", "parallelogram_chain")


def sheet_of(name="ruiz_fourbar", **lengths):
    sheet = Sheet(opened(GRAPHS / f"{name}.json"))
    form = copy.deepcopy(sheet.form)
    for key, x in lengths.items():
        form["blocks"]["dyad"][key] = x
    sheet.change(form, "lengths")
    return sheet


EVERY = 40  # so many samples are as good as all


def turned(sheet):
    motion = turn(sheet.mechanism)
    return motion.only(np.arange(0, len(motion.samples), EVERY))


@pytest.mark.parametrize("name", [n for n in GALLERY if n not in LONG])
def test_every_mechanism_of_the_gallery_has_columns_for_every_pose(name):
    motion = turned(sheet_of(name))
    scene = scene_of(motion, SHOWN)
    low, high = scene.bounds
    *layers, names = scene.layers(abs(high - low) / 500)
    for layer in layers:
        assert len(layer.places) in (1, len(motion.samples))
        count = len(layer.looks["name"])
        assert {len(row) for row in layer.looks.values()} == {count}
        starts = layer.starts or range(count + 1)
        assert len(starts) == count + 1
        points = layer.places[0] if layer.offsets is None else layer.offsets
        assert starts[-1] == len(points)
        for i, what in enumerate(layer.looks["name"]):
            if what.startswith(("link", "pin")) and layer.offsets is None:
                assert np.isfinite(layer.places[:, starts[i] : starts[i + 1]]).all()
            assert not what.startswith("gap")
    assert np.isfinite(names.places).all()


def test_links_stand_where_the_run_says():
    view = MechanismView(sheet_of())
    view.pose = 77
    ((shown,),) = places_of(view, "pin:C", 77).values()
    run = view.sheet.mechanism.run(samples=361, want=["dyad.C.p"], friction="none")
    C = run["dyad.C.p"]
    rounding = 8 * np.finfo(float).eps * np.abs(C).max()  # by way of a link's origin and axis
    assert abs(shown - C[77]) <= rounding


def test_colours_are_those_of_the_palette_and_ink_swaps_with_paper_in_the_dark():
    known = {x for x in vars(palette).values() if isinstance(x, str) and x.startswith("#")}
    known |= {*palette.LINK_FILLS, *palette.SERIES, "transparent"}
    for layer in scene_of(turned(sheet_of()), SHOWN).layers(0.01):
        kinds = ("line_color", "fill_color", "text_color")
        used = {colour for kind in kinds for colour in layer.looks.get(kind, ())}
        assert used <= known
    assert coloured(palette.PAPER, dark=True) == palette.INK


def test_no_name_stands_on_a_link():
    """It only slides over one where a link drives it to the other side of its joint."""
    motion = turn(sheet_of("watt_sixbar").mechanism)
    motion = motion.only(np.arange(0, len(motion.samples), 3))
    scene = scene_of(motion)
    low, high = scene.bounds
    unit = abs(high - low) / 500
    bad = []
    for name in names_of(Stage(scene.sketch, motion, unit)).places.T:
        on = np.zeros(len(motion.samples), bool)
        for body in scene.sketch.bodies:
            t = np.linspace(0, 1, 50)
            ends = motion.at(body.link, np.array(body.outline))
            for a, b in zip(ends, np.roll(ends, -1, 0), strict=True):
                on |= (np.abs(a + (b - a) * t[:, None] - name) < 3 * unit).any(axis=0)
        bad.append(on.mean())
    assert max(bad) <= 0.1
    assert np.median(bad) <= 0.01


def test_what_lies_under_a_name_is_counted_as_point_by_point():
    """Points of a crowd, some of them nowhere, of which few are within reach of any name."""
    make = np.random.default_rng(0)
    taken = make.normal(size=(60, 7)) * 30 + 1j * make.normal(size=(60, 7)) * 30
    taken[::9, 3] = np.nan
    weights, room = make.integers(1, 5, 60).astype(float), 11 + 5j
    offsets = 20 * np.exp(1j * np.arange(0, 6, 0.4))
    apart = taken[:, None] - offsets[:, None]
    inside = (np.abs(apart.real) < room.real) & (np.abs(apart.imag) < room.imag)
    assert inside.any()
    wanted = np.einsum("p,pof->fo", weights, inside)
    np.testing.assert_array_equal(_under(taken, weights, offsets, room), wanted)


def test_friction_circles_say_how_much_larger_they_are_drawn():
    view = MechanismView(sheet_of())
    view.show = ["friction circles"]
    said = view.figure.words
    many = float(re.fullmatch(r"friction circles (\d+) times as large", said)[1])
    (circle,) = places_of(view, "friction:dyad.C", 0).values()
    drawn = np.ptp(circle.real) / 2
    factor = view.sheet.document.blocks["dyad"].friction["C"].factor
    assert drawn == pytest.approx(many * factor, rel=1e-2)  # a polygon of steps of 0.2 rad


def test_a_gap_has_its_sentence_and_its_mark():
    view = MechanismView(sheet_of(l_i=3.2))
    (gap,) = view.gaps
    first, last, why = gap.first, gap.last, gap.why
    assert (first, last) == (101, 259)
    assert "too large" in why
    for pose, there in ((0, False), (first - 1, False), (first, True), (180, True)):
        view.pose = pose
        assert (why.split(":")[0] in words_of(view)) == there
        assert (marked(view) == {"gap:dyad"}) == there


def words_of(view):
    """The words below the shown pose."""
    return " ".join(words for words, _ in view.figure.picture.said)


def places_of(view, named, k):
    """Where the shapes whose names begin so are drawn in sample k [m]."""
    drawn = {}
    for layer in view.figure.layers:
        row = layer.places[k if len(layer.places) > 1 else 0]
        for i, what in enumerate(layer.looks["name"]):
            span = slice(*layer.starts[i : i + 2]) if layer.starts else slice(i, i + 1)
            if what.startswith(named):
                drawn[what] = row[span] if layer.offsets is None else row[i] + layer.offsets[span]
    return drawn


def marked(view):
    """The gaps that are drawn in the shown pose."""
    drawn = places_of(view, "gap", view.pose)
    return {what for what, places in drawn.items() if np.isfinite(places).all()}


@pytest.mark.parametrize("gone", ["wire", "closing"])
def test_the_part_that_closes_is_drawn(gone):
    sheet = sheet_of(l_i=30.0) if gone == "closing" else sheet_of()
    if gone == "wire":
        form = copy.deepcopy(sheet.form)
        form["wires"] = [w for w in form["wires"] if w["to"] != "dyad.B"]
        sheet.change(form, "cut")
    view = MechanismView(sheet)
    assert [str(link) for link in view.motion.structure.links] == ["frame.frame", "crank.crank"]
    assert ("never closes" if gone == "closing" else "nothing is wired to it") in view.said
    assert marked(view) == ({"gap:dyad"} if gone == "closing" else set())


def test_what_hangs_on_a_failing_block_goes_with_it():
    form = sheet_of("watt_sixbar").form
    first = next(name for name, block in form["blocks"].items() if block["type"] == "dyad.rrr")
    assert what_moves(form, {first}).structure.formula == "I(crank: 0,1)"
    assert blamed_blocks(form, [bm.Problem("x", f"blocks.{first}.l_i", "")]) == {first}


# -- drivers and dead centres ----------------------------------------------------------------


def test_dead_centres_are_those_of_limits():
    """A rocker as the driver: its arc ends where coupler and follower are in line."""
    sheet = sheet_of(l_i=3.2)
    motion, found = turn(sheet.mechanism), sheet.mechanism.limits()
    q = motion.q["crank"]
    ends = {end.q % (2 * np.pi): str(end) for arc in found.arcs for end in (arc.start, arc.end)}
    passed = dead_centres(motion)
    assert len(passed) == len(ends) == 2
    for place, name in passed:
        at = np.interp(place, np.arange(len(q)), q)
        (near,) = (x for x in ends if abs(x - at) < 1e-9)
        assert ends[near] == name
    view = MechanismView(sheet)
    view.pose = round(passed[0][0])
    assert f"nearest dead centre: {passed[0][1]} at crank.q = " in words_of(view)
    view.margins()
    labels = [x.text for x in view._margins.drawn[0].figure.center if hasattr(x, "text")]
    assert labels == [name for _, name in passed]


def test_each_of_several_drivers_has_a_slider():
    view = MechanismView(sheet_of("excavator"))
    sliders = view.figure.picture.drivers
    assert [slider["name"] for slider in sliders] == ["boom", "arm", "curl"]
    laws = view.motion
    view.pose = 100
    assert [s["values"][100] for s in sliders] == list(view.coordinates.values())
    assert view.motion is laws
    before = view.coordinates
    view.meant({"act": "drive", "driver": "arm", "value": 3.21})
    step = np.ptp(view.motion.q["arm"]) / 360
    assert view.coordinates == before | {"arm": pytest.approx(3.21, abs=step / 2)}
    moved = view.motion
    assert view.along.words == "arm.q [m]"
    view.meant({"act": "drive", "driver": "arm", "value": 3.1})
    assert view.motion is moved
    assert view.coordinates["arm"] == pytest.approx(3.1, abs=step / 2)
    view.turn()
    assert np.ptp(view.motion.q["boom"]) > 0


def test_a_driver_without_a_law_moves_over_its_arc():
    sheet = sheet_of(l_i=3.2)
    form = copy.deepcopy(sheet.form)
    del form["scene"]["drive"]
    sheet.change(form, "free")
    (arc,) = sheet.mechanism.limits().arcs
    assert travel(sheet.mechanism, "crank", {"crank": 0.0}) == (arc.start.q, arc.end.q)
    assert MechanismView(sheet).motion.feasible[1:-1].all()
    small = sheet.graph.replace(
        {name: 1e-3 * p.value for name, p in sheet.mechanism.parameters().items() if p.unit == "m"}
    )
    assert travel(small.compile(), "crank", {"crank": 0.0}) == pytest.approx(
        (arc.start.q, arc.end.q), abs=1e-12
    )


# -- dragging ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ruiz_fourbar", "watt_sixbar"])
@pytest.mark.parametrize("k", [0, 4])
def test_a_dragged_joint_moves_alone(name, k):
    """The other joints stand where they stood, in the pose in which it was dragged."""
    sheet = sheet_of(name)
    motion = turned(sheet)
    handles = handles_of(motion, scene_of(motion).sketch)
    assert len(handles) >= 4
    before = places(sheet.mechanism, motion, k)
    for spot in handles.values():
        old = complex(motion.at(*spot)[k])
        new = old + 0.05 + 0.03j
        made = bm.Graph.from_data(dragged(sheet.form, motion, k, old, new)).compile()
        q = angle_of_crank(made, old, new, motion, k)
        after = places(made, motion, k, q)
        for joint, z in before.items():
            near = new if abs(z - old) < 1e-9 else z
            assert abs(after[joint] - near) < 1e-9, joint


def places(mechanism, motion, k, q=None):
    """Places of all revolute joints of a pose."""
    driver = mechanism.drivers[0]
    q = float(motion.q[driver][k]) if q is None else q
    joints = {
        str(ref): marker
        for ref, marker in mechanism.structure.feeds.items()
        if mechanism.structure.joint(ref).kind == "R"
    }
    inner = {f"{n}.C" for n, b in mechanism.structure.blocks.items() if "C" in b.joints}
    want = {*map(str, joints.values()), *inner}
    found = mechanism._of_blocks.run(
        at={driver: q}, rates={driver: 0.0}, want=[f"{n}.p" for n in want], friction="none"
    )
    return {name: complex(found[f"{name}.p"][0]) for name in want}


def angle_of_crank(mechanism, old, new, motion, k):
    """The crank's angle after a joint was dragged: its pin may have moved."""
    driver = mechanism.drivers[0]
    q = float(motion.q[driver][k])
    ref = next(
        r for r in motion.structure.links if r.block == mechanism.structure.driven[driver].block
    )
    A = complex(motion.origin[ref][k])
    B = complex(motion.at(ref, motion.structure.blocks[ref.block].length)[k])
    A2, B2 = (new if abs(z - old) < 1e-9 else z for z in (A, B))
    return q + float(np.angle((B2 - A2) / (B - A)))


@pytest.mark.parametrize("joint", "ABCD")
def test_a_dragged_joint_of_a_linkage_moves_alone(joint):
    sheet = sheet_of("joints/ruiz_fourbar")
    motion, k = turned(sheet), 4
    handles = handles_of(motion, scene_of(motion).sketch)
    old = complex(motion.at(*handles[joint])[k])
    form = dragged(sheet.form, motion, k, old, old + 0.05 + 0.03j)
    q = float(motion.q["motor"][k])
    before, after = (joints_of(f, q) for f in (sheet.form, form))
    for name in "ABCD":
        assert abs(after[name] - before[name] - (0.05 + 0.03j) * (name == joint)) < 1e-9


def joints_of(form, q):
    """Places of the joints of a joint-based form."""
    want = [f"link.{link}.{x}" for link in form["links"] for x in ("p", "angle")]
    found = bm.Linkage.from_data(form).run(at=q, rates=0.0, want=want, friction="none")
    places = {}
    for name, joint in form["joints"].items():
        link, at = joint["links"][1], complex(*joint["at"][1])
        turn = np.exp(1j * found[f"link.{link}.angle"][0])
        places[name] = complex(found[f"link.{link}.p"][0] + turn * at)
    return places


def test_a_drag_is_one_step_that_can_be_undone():
    sheet = sheet_of()
    before = sheet.text()
    view = MechanismView(sheet)
    view.drag("C", 4.0 + 3.0j)
    assert sheet.form["blocks"]["dyad"]["l_j"] == pytest.approx(abs(4 + 3j - 5.5), abs=1e-12)
    assert sheet.undoable == "move C"
    sheet.undo()
    assert sheet.text() == before


@pytest.mark.parametrize("law", [True, False])
def test_a_dragged_crank_is_shown_where_it_was_dragged_to(law):
    """Without a law its start goes with it; with one, the pose does."""
    sheet = sheet_of()
    if not law:
        form = copy.deepcopy(sheet.form)
        del form["scene"]["drive"]
        form["scene"]["initial"] = {"crank": {"q": 0.5}}
        sheet.change(form, "free")
    view = MechanismView(sheet)
    view.pose = 0
    view.drag("B", 1.5j)
    assert sheet.form["blocks"]["crank"]["length"] == pytest.approx(1.5, abs=1e-12)
    half = np.ptp(view.motion.q["crank"]) / 720  # a step from sample to sample
    assert view.coordinates["crank"] == pytest.approx(np.pi / 2, abs=half)
    assert sheet.undoable == "move B"
    if not law:
        assert sheet.form["scene"]["initial"]["crank"]["q"] == pytest.approx(np.pi / 2, abs=1e-12)


def test_what_cannot_be_dragged_says_why():
    sheet = sheet_of("stephenson_3_triad")
    view = MechanismView(sheet)
    before = sheet.text()
    view.drag("C", 0.1 + 0.1j)
    assert "cannot be dragged" in words_of(view)
    assert sheet.text() == before


def test_forces_that_cannot_be_known_are_told_while_they_are_asked_for():
    view = MechanismView(sheet_of("motions/shaken_slider"))
    view.show = ["reactions"]
    assert "a load follows the time" in words_of(view)
    view.pose = 20
    view.show = ["paths"]
    assert "a load follows the time" not in words_of(view)


# -- files and the browser -------------------------------------------------------------------


def test_a_motion_is_played_round_or_to_and_fro(page, studio):
    """One and a quarter of it: the frames as the browser counts them."""
    page.goto(studio[0])
    found = page.evaluate(
        """async (text) => {
            const blob = new Blob([text], { type: "text/javascript" });
            const { frameAt } = await import(URL.createObjectURL(blob));
            return [[1.25, 361, true], [1.25, 361, false], [0, 1, true]].map((x) => frameAt(...x));
        }""",
        script("mechanism.js"),
    )
    assert found == [90, 269, 0]


def test_a_pose_that_the_page_asked_for_before_a_tap_is_not_shown_after_it():
    view = MechanismView(sheet_of())
    view.meant({"act": "pose", "pose": 12, "seen": 0})
    view.seek(np.pi / 2)
    view.meant({"act": "pose", "pose": 13, "seen": 12})
    assert view.pose == 90


def test_a_mechanism_plays_and_is_dragged_in_the_browser(page, studio):
    """Played, stopped, put to a pose by a tap on a curve, and a joint dragged there."""
    show(page, studio, "?example=ruiz_fourbar")
    pose = page.get_by_label("Pose", exact=True)
    press(page, "▶ Play")
    page.wait_for_function("at => Number(at.value) > 3", arg=pose.element_handle())
    press(page, "❚❚ Pause")
    page.mouse.click(*on_curve(page, "crank.q [rad]", np.pi / 2, 0))
    page.wait_for_function("at => Math.abs(at.value - 90) < 3", arg=pose.element_handle())
    k = int(pose.input_value())
    assert abs(k - 90) < 3
    run = sheet_of().mechanism.run(samples=361, want=["crank.drive", "dyad.C.p"])
    page.get_by_text(f"crank.drive = {run['crank.drive'][k]:.6g} N m").wait_for()
    C = run["dyad.C.p"][k]
    x, y = page.locator("canvas.picture")._evaluate("(it, z) => it.screen(z)", [C.real, C.imag])
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 40, y - 30, steps=3)
    page.mouse.up()
    page.get_by_role("button", name="Undo").and_(page.locator(":enabled")).wait_for()


def on_curve(page, axis, x, y):
    """Where a place of a curve is on the screen [px]."""
    return page.evaluate(
        """([axis, x, y]) => {
            const all = (views) => [...views].flatMap((v) => [v, ...all(v.child_views ?? [])]);
            const view = all(Object.values(Bokeh.index.roots)).findLast(
                ({model}) => model.type === "Figure" && model.below[0].axis_label === axis);
            const area = view.el.getBoundingClientRect();
            const {x_scale, y_scale} = view.frame;
            return [area.x + x_scale.compute(x), area.y + y_scale.compute(y)];
        }""",
        [axis, x, y],
    )
