"""The moving mechanism: poses as columns, gaps with their sentences, joints that are dragged."""

import copy
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.draw import palette
from blockmech.studio.dragging import dragged, handles_of
from blockmech.studio.film import SHOWN, coloured, names_of, scene_of
from blockmech.studio.mechanism import MechanismView
from blockmech.studio.sheet import Sheet
from blockmech.studio.turn import FRAME, blamed_blocks, closing, gaps_of, turn, what_moves
from tests.studio.page import served, wait_until

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


def turned(sheet):
    motion = turn(sheet.mechanism)
    return motion.only(np.arange(0, len(motion.samples), FRAME))


@pytest.mark.parametrize("name", [n for n in GALLERY if n not in LONG])
def test_every_mechanism_of_the_gallery_has_columns_for_every_frame(name):
    motion = turned(sheet_of(name))
    scene = scene_of(motion, SHOWN)
    low, high = scene.bounds
    unit = abs(high - low) / 500
    for layer in scene.layers(unit):
        assert len(layer.places) in (1, len(motion.samples))
        assert layer.starts[-1] == layer.places.shape[1]
        columns = layer.at(len(motion.samples) // 2)
        assert {len(row) for row in columns.values()} == {len(layer.looks["name"])}
        solid = [
            i for i, what in enumerate(layer.looks["name"]) if what.startswith(("link", "pin"))
        ]
        for i in solid:
            assert np.isfinite(layer.places[:, layer.starts[i] : layer.starts[i + 1]]).all()
    for name in names_of(scene, unit):
        assert np.isfinite(name.places).all()


def test_links_stand_where_the_run_says():
    sheet = sheet_of()
    motion = turned(sheet)
    layers = scene_of(motion).layers(0.01)
    found = {
        what: layer.places[:, layer.starts[i]]
        for layer in layers
        for i, what in enumerate(layer.looks["name"])
        if len(layer.places) > 1
    }
    C = sheet.mechanism.run(samples=361, want=["dyad.C.p"], friction="none")["dyad.C.p"]
    rounding = 8 * np.finfo(float).eps * np.abs(C).max()  # by way of a link's origin and axis
    assert np.abs(found["pin:C"] - C[::FRAME]).max() <= rounding


def test_colours_are_those_of_the_palette_and_ink_swaps_with_paper_in_the_dark():
    known = {x for x in vars(palette).values() if isinstance(x, str) and x.startswith("#")}
    known |= {*palette.LINK_FILLS, *palette.SERIES, "transparent"}
    for layer in scene_of(turned(sheet_of()), SHOWN).layers(0.01):
        used = {*layer.looks["line_color"], *layer.looks.get("fill_color", ())}
        assert used <= known
    assert coloured(palette.PAPER, dark=True) == palette.INK


def test_no_name_stands_on_a_link():
    """It only slides over one where a link drives it to the other side of its joint."""
    motion = turned(sheet_of("watt_sixbar"))
    scene = scene_of(motion)
    low, high = scene.bounds
    unit = abs(high - low) / 500
    bad = []
    for name in names_of(scene, unit):
        on = np.zeros(len(motion.samples), bool)
        for body in scene.sketch.bodies:
            t = np.linspace(0, 1, 50)
            ends = motion.at(body.link, np.array(body.outline))
            for a, b in zip(ends, np.roll(ends, -1, 0), strict=True):
                on |= (np.abs(a + (b - a) * t[:, None] - name.places) < 3 * unit).any(axis=0)
        bad.append(on.mean())
    assert max(bad) <= 0.1
    assert np.median(bad) <= 0.01


def test_a_gap_has_its_sentence():
    sheet = sheet_of(l_i=3.2)
    gaps = gaps_of(closing(turn(sheet.mechanism)))
    ((first, last, why),) = gaps
    assert (first, last) == (101, 259)
    assert "dyad" in why
    assert "too large" in why
    view = MechanismView(sheet)
    assert why.split(":")[0] in view._captions()[60]
    assert why.split(":")[0] not in view._captions()[0]


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


def test_what_hangs_on_a_failing_block_goes_with_it():
    form = sheet_of("watt_sixbar").form
    first = next(name for name, block in form["blocks"].items() if block["type"] == "dyad.rrr")
    assert what_moves(form, {first}).structure.formula == "I(crank: 0,1)"
    assert blamed_blocks(form, [bm.Problem("x", f"blocks.{first}.l_i", "")]) == {first}


# -- dragging ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ruiz_fourbar", "watt_sixbar"])
@pytest.mark.parametrize("k", [0, 40])
def test_a_dragged_joint_moves_alone(name, k):
    """The other joints stand where they stood, in the pose in which it was dragged."""
    sheet = sheet_of(name)
    motion = turned(sheet)
    handles = handles_of(sheet.form, motion, scene_of(motion).sketch)
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
    found = mechanism.of_blocks.run(
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
    motion, k = turned(sheet), 40
    handles = handles_of(sheet.form, motion, scene_of(motion).sketch)
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
    view.drag("C", 0, 4.0 + 3.0j)
    assert sheet.form["blocks"]["dyad"]["l_j"] == pytest.approx(abs(4 + 3j - 5.5), abs=1e-12)
    assert sheet.undoable == "move C"
    sheet.undo()
    assert sheet.text() == before


def test_a_mechanism_plays_in_the_browser_and_a_joint_is_dragged(page):
    views = []

    def make():
        views.append(MechanismView(sheet_of()))
        return views[-1].panel()

    with served(page, make):
        page.get_by_text("Play").click()
        page.wait_for_timeout(600)
        page.get_by_text("Pause").click()
        (view,) = views
        wait_until(page, lambda: view.frame > 0)
        assert view.frame > 0
        page.wait_for_timeout(300)  # the browser draws the frame that it told
        k, length = view.frame, view.sheet.form["blocks"]["dyad"]["l_j"]
        x, y = screen(page, complex(view.frames.at(*view._handles["C"])[k]))
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 40, y - 30, steps=5)
        page.mouse.up()
        wait_until(page, lambda: view.sheet.undoable == "move C")
        assert view.sheet.undoable == "move C"
        assert view.sheet.form["blocks"]["dyad"]["l_j"] != length


def screen(page, z):
    """Where a place of the mechanism is on the screen [px]."""
    return page.evaluate(
        """([x, y]) => {
            const seek = (views) => {
                for (const view of views) {
                    if (view.model.type === "Figure") return view;
                    const found = seek(view.child_views ?? []);
                    if (found) return found;
                }
            };
            const view = seek(Object.values(Bokeh.index.roots));
            const area = view.el.getBoundingClientRect();
            const {x_scale, y_scale} = view.frame;
            return [area.x + x_scale.compute(x), area.y + y_scale.compute(y)];
        }""",
        [z.real, z.imag],
    )
