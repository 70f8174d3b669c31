"""Links and joints drawn as a sketch: a document that says the same, and the groups in it."""

import cmath
import json
import math
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.exchange.formats import Order
from blockmech.exchange.outlines import outlines
from blockmech.studio import sketching
from blockmech.studio.answers import Answers
from blockmech.studio.diagram import Diagram
from blockmech.studio.fields import Shown
from blockmech.studio.links import LinksSheet, drawing_of
from blockmech.studio.mechanism import MechanismView
from blockmech.studio.sheet import Sheet
from blockmech.studio.sketching import outlines_of
from tests.studio.page import drawing, save

GRAPHS = Path(__file__).parents[2] / "graphs"
JOINTS = sorted(path.stem for path in (GRAPHS / "joints").glob("*.json"))


def sketch():
    return LinksSheet(Sheet(bm.Linkage("drawn")))


def act(pane, name, *pins):
    pane.pins.value = list(pins)
    pane.act(name)


def fourbar():
    """The paper's four-bar as it is drawn: four pins, three links, a frame and a driver."""
    pane = sketch()
    for z in (0j, 2 + 0j, 7.607142857142857 + 2.135403697j, 5.5 + 0j):
        pane.add(z)
    for ends in ("AB", "BC", "CD"):
        act(pane, "Link", *ends)
    act(pane, "To the frame", "A", "D")
    act(pane, "Driver", "A")
    return pane


def test_a_drawn_four_bar_moves_as_the_file_does():
    pane = fourbar()
    assert pane.sheet.problems == ()
    assert "RRR" in pane.said.object
    motor = pane.sheet.mechanism.drivers[0]
    drawn = pane.sheet.mechanism.run(
        at={motor: [0.0, 1.0]}, want=["link.link2.omega"], friction="none", rates={motor: 10.0}
    )
    file = opened(GRAPHS / "joints" / "ruiz_fourbar.json").run(
        at=[0.0, 1.0], want=["link.rocker.omega"], friction="none"
    )
    length = abs(complex(7.607142857142857, 2.135403697) - 5.5)
    assert length == pytest.approx(3, abs=1e-8)  # how exactly it was drawn
    assert drawn["link.link2.omega"] == pytest.approx(file["link.rocker.omega"], rel=1e-7)


def test_every_step_of_a_drawing_is_undone():
    pane = fourbar()
    form, steps = pane.sheet.form, 0
    while pane.sheet.undoable:
        pane.sheet.undo()
        steps += 1
    assert pane.sheet.form == bm.Linkage("drawn").to_data()
    while pane.sheet.redoable:
        pane.sheet.redo()
    assert pane.sheet.form == form
    assert steps == 9  # four pins, three links, the frame, the driver


@pytest.mark.parametrize("name", ["joints/excavator", "excavator"])
def test_what_the_hand_did_is_drawn_before_anything_is_computed(name):
    sheet, shown = Sheet(opened(GRAPHS / f"{name}.json")), []
    view = MechanismView(sheet)
    links, diagram = LinksSheet(sheet, view=view), Diagram(sheet, print, print, str)
    drawn = links.canvas if links.ours else diagram.flow
    for part, of in ((view, "motion"), (drawn, "drawing")):
        part.param.watch(lambda event: shown.append(event.name), of)
    if links.ours:
        links.meant({"act": "move", "pins": {"boom_foot": [0.01, 0.0]}})
    else:
        diagram.add("load.spring", None)
    sheet.undo()
    assert shown == ["drawing", "motion"] * 2


def test_a_drawing_that_cannot_move_has_its_diagnosis():
    pane = fourbar()
    act(pane, "Driver", "A")
    assert pane.sheet.mechanism is None
    assert "driver" in pane.said.object


def test_a_slider_crank_is_drawn():
    pane = sketch()
    for z in (0j, 1 + 0j, 4 + 0j, 4 + 0j):
        pane.add(z)
    act(pane, "Link", "A", "B")
    act(pane, "Link", "B", "C")
    act(pane, "Link", "C", "D")
    act(pane, "To the frame", "A", "D")
    act(pane, "Slider", "D")
    act(pane, "Driver", "A")
    assert "RRP" in pane.said.object
    found = pane.sheet.mechanism.run(at=[1.0], rates=0.0, want=["link.link2.p"], friction="none")[
        "link.link2.p"
    ][0]
    exact = math.cos(1.0) + math.sqrt(9 - math.sin(1.0) ** 2)
    assert found == pytest.approx(exact, abs=1e-14)


def test_a_pin_is_moved_and_deleted_in_the_browsers_way():
    pane = fourbar()
    pane.meant({"act": "move", "pins": {"A": [0.25, 0.0]}})
    assert pane.drawn["A"].z == 0.25
    pane.meant({"act": "pin", "at": [1.23, 2.0]})
    assert pane.drawn["E"] == sketching.Drawn(1.23 + 2j)
    pane.meant({"act": "Delete", "pins": ["A"]})
    assert "A" not in pane.drawn
    assert "drivers" not in pane.sheet.form


def test_pins_that_no_link_carries_are_kept_in_the_file_and_not_computed_with():
    pane = fourbar()
    before = pane.sheet.mechanism.run(at=[1.0], rates=0.0, friction="none").to_csv()
    pane.add(9 + 9j)
    again = bm.Linkage.from_data(pane.sheet.form)
    assert sketching.pins_of(again.to_data())["E"].z == 9 + 9j
    assert again.run(at=[1.0], rates=0.0, friction="none").to_csv() == before
    act(pane, "Delete", "E")
    assert "view" not in pane.sheet.form


@pytest.mark.parametrize("name", JOINTS)
def test_every_document_of_the_gallery_is_shown_as_it_is(name):
    sheet = Sheet(opened(GRAPHS / "joints" / f"{name}.json"))
    pins = sketching.pins_of(sheet.form)
    drawing = drawing_of(sheet.form, pins, False, Shown("mm", "deg"))
    assert [pin["name"] for pin in drawing["pins"]] == list(pins)
    json.dumps(drawing, allow_nan=False)
    assert set(sheet.form["joints"]) <= set(pins)
    assert set(outlines_of(pins)) <= set(sheet.form["links"])


def test_a_place_is_typed_and_what_is_no_place_is_said():
    pane = sketch()
    for text in ("0.5, 1.5", "over there"):
        pane.place.value = text
        pane.place.enter_pressed = True
    assert {name: pin.z for name, pin in pane.drawn.items()} == {"A": 0.5 + 1.5j}
    assert "two numbers" in pane.said.object


def test_a_link_gets_a_slider_at_its_free_end():
    pane = sketch()
    for z in (0j, 1 + 0j, 4 + 0j):
        pane.add(z)
    act(pane, "Link", "A", "B")
    act(pane, "Link", "B", "C")
    act(pane, "To the frame", "A")
    act(pane, "Slider", "C")
    act(pane, "Driver", "A")
    assert "RRP" in pane.said.object
    found = pane.sheet.mechanism.run(at=[1.0], rates=0.0, want=["link.slider.p"])["link.slider.p"]
    exact = math.cos(1.0) + math.sqrt(9 - math.sin(1.0) ** 2)
    assert found[0] == pytest.approx(exact, abs=1e-14)


def test_a_block_slides_on_a_moving_link():
    """The shaper's: a crank's pin on a block in the slot of a rocker."""
    pane = sketch()
    for z in (0j, 1j, -2j):
        pane.add(z)
    act(pane, "Link", "A", "B")
    pane.add(0.5 + 0j)  # on the rocker, off the crank
    act(pane, "Link", "C", "D")
    act(pane, "To the frame", "A", "C")
    pane.angle.value = 90.0
    pane.slot.value = "link1"
    act(pane, "Slider", "B")
    act(pane, "Driver", "A")
    assert pane.sheet.problems == ()
    found = pane.sheet.mechanism.run(at=[0.7], rates=1.0, want=["link.link1.omega"])
    b = 1j * complex(math.cos(0.7), math.sin(0.7))  # the rocker points from C to B
    assert found["link.link1.omega"][0] == pytest.approx((1j * b / (b + 2j)).imag, abs=1e-14)


def test_a_pin_and_the_guide_of_its_block_move_together():
    pane = sketch()
    for z in (0j, 1 + 0j):
        pane.add(z)
    act(pane, "Link", "A", "B")
    act(pane, "Slider", "B")
    for name, z in (("B", 2 + 1j), ("B_guide", 3 + 0j)):
        pane.sheet.change(sketching.moved(pane.sheet.form, {name: z}), "moved")
        assert [pane.drawn[n].z for n in ("B", "B_guide", "A")] == [z, z, 0]


def test_what_a_button_cannot_do_is_said():
    pane = fourbar()
    pane.add(3 + 0j)
    act(pane, "To the frame", "E")
    act(pane, "Slider", "E")
    assert "choose another link" in pane.said.object
    act(pane, "Link")
    assert "choose pins first" in pane.said.object


def test_the_list_of_pins_keeps_its_order():
    pane = fourbar()
    pane.add(3 + 0j)
    assert list(pane.pins.options) == list("ABCDE")


def test_blocks_are_not_drawn_over():
    pane = LinksSheet(Sheet(opened(GRAPHS / "ruiz_fourbar.json")))
    assert "holds blocks" in pane.said.object
    assert all(button.disabled for button in pane.buttons)


@pytest.mark.parametrize("name", ["ruiz_fourbar", "engine", "excavator", "valve_engine"])
def test_blocks_are_drawn_on_as_links_and_joints(name):
    """Every link of the same name, drive and reaction: the document that is made moves alike."""
    sheet = Sheet(opened(GRAPHS / f"{name}.json"))
    before = sheet.mechanism.run(samples=7, want=[f"{d}.drive" for d in sheet.mechanism.drivers])
    pane = LinksSheet(sheet)
    pane.redraw.clicks += 1
    assert pane.ours
    assert sheet.undoable == "drawn as links and joints"
    drives = [f"driver.{d}.drive" for d in sheet.mechanism.drivers]
    after = sheet.mechanism.run(samples=7, want=drives)
    for was, now in zip(before, after, strict=True):
        size = abs(before[was]).max() or 1.0
        assert after[now] == pytest.approx(before[was], abs=1e-9 * size)
    sheet.undo()
    assert not pane.ours


def test_blocks_that_links_and_joints_do_not_say_alike_are_refused():
    pane = LinksSheet(Sheet(opened(GRAPHS / "n_four_bar.json")))
    pane.redraw.clicks += 1
    assert "would stand" in pane.said.object
    assert not pane.ours


def test_a_distance_is_typed_and_the_loose_end_moves():
    pane = fourbar()
    pane.meant({"act": "dimension", "ends": ["A", "B"], "value": 2.5})
    assert pane.drawn["B"].z == pytest.approx(2.5)
    pane.meant({"act": "dimension", "ends": ["C", "D"], "value": 2.0})
    assert pane.drawn["D"].z == 5.5
    assert abs(pane.drawn["C"].z - 5.5) == pytest.approx(2.0)


def test_pins_that_move_together_keep_their_distances():
    """Each goes where it is sent, also where another one stood before."""
    pane = fourbar()
    pane.meant({"act": "move", "pins": {"A": [2.0, 0.0], "B": [4.0, 0.0]}})
    assert [pane.drawn[name].z for name in "AB"] == [2.0, 4.0]


def test_a_machine_with_cylinders_is_moved_as_a_whole():
    """Places that rounded poses do not bring together stay apart, and it runs as before."""
    sheet = Sheet(opened(GRAPHS / "joints" / "excavator.json"))
    places = {name: pin.z + 0.7 - 0.35j for name, pin in sketching.pins_of(sheet.form).items()}
    made = bm.Linkage.from_data(sketching.moved(sheet.form, places)).compile()
    names = [f"link.{name}.omega" for name in ("boom", "arm", "bucket")]
    one, other = (m.run(samples=5, want=names) for m in (sheet.mechanism, made))
    for name in names:
        assert other[name] == pytest.approx(one[name], rel=1e-11)


def test_a_gesture_that_begins_and_ends_at_pins_joins_them():
    pane = sketch()
    pane.meant({"act": "draw", "tool": "", "from": {"at": [0, 0]}, "to": {"at": [1, 0]}})
    pane.meant({"act": "draw", "tool": "", "from": {"pin": "B"}, "to": {"at": [2, 1]}})
    on_link = {"at": [0.5, 0], "on": "link"}
    pane.meant({"act": "draw", "tool": "Link", "from": {"at": [0.5, 2]}, "to": on_link})
    assert pane.drawn["B"].links == ("link", "link1")
    assert pane.drawn["E"].links == ("link", "link2")
    assert [pin.kind for pin in pane.drawn.values()].count("R") == 2


def test_a_cylinder_lifts_an_arm():
    """The law of cosines tells the arm's angle from the cylinder's length."""
    pane = sketch()
    for z in (0j, 2 + 0j, 1 - 1j):
        pane.add(z)
    act(pane, "Link", "A", "B")
    act(pane, "To the frame", "A")
    act(pane, "Cylinder", "C", "B")
    act(pane, "To the frame", "C")
    assert pane.sheet.problems == ()
    (driver,) = pane.sheet.mechanism.drivers
    q = 1.5
    found = pane.sheet.mechanism.run(at={driver: [q]}, rates=0.0, want=["joint.B.p"])
    b = found["joint.B.p"][0]
    assert abs(b) == pytest.approx(2, abs=1e-13)
    assert abs(b - (1 - 1j)) == pytest.approx(q, abs=1e-13)


def test_gears_let_one_driver_follow_another():
    pane = sketch()
    for z in (0j, 1 + 0j, 3 + 0j, 4 + 1j):
        pane.add(z)
    act(pane, "Link", "A", "B")
    act(pane, "Link", "C", "D")
    act(pane, "To the frame", "A", "C")
    act(pane, "Gears", "A", "C")
    (gear,) = pane.sheet.form["couplings"].values()
    assert [pane.sheet.form["drivers"][gear[key]]["joint"] for key in ("driver", "driven")] == [
        "A",
        "C",
    ]
    assert pane.sheet.problems == ()
    assert [wheel["radius"] for wheel in pane.canvas.drawing["wheels"]] == [1.5, 1.5]
    act(pane, "Gears", "A", "B")
    assert "joint that turns" in pane.said.object
    act(pane, "Delete", "C")
    assert "couplings" not in pane.sheet.form


def test_a_rack_turns_the_pinion_that_reaches_it():
    """The pinion rolls on the rack: its angle is the way over the drawn radius."""
    pane = sketch()
    for z in (0j, 0.5j, 2 - 0.5j, 3 - 0.5j):
        pane.add(z)
    act(pane, "Link", "A", "B")
    act(pane, "Link", "C", "D")
    act(pane, "To the frame", "A", "C")
    act(pane, "Slider", "C")
    act(pane, "Rack", "C", "A")
    assert pane.sheet.problems == ()
    (rack,) = pane.sheet.form["couplings"].values()
    assert rack["radius"] == 0.5
    assert [wheel["radius"] for wheel in pane.canvas.drawing["wheels"]] == [0.5]
    motor = rack["driver"]
    found = pane.sheet.mechanism.run(
        at={motor: [0.2]}, rates={motor: 1.0}, want=["link.link.omega"]
    )
    v = 1.0  # of the rack along +x; the point of the pinion below its centre moves with it
    assert found["link.link.omega"][0] * 0.5 == pytest.approx(v, rel=1e-12)


def test_a_cam_lifts_a_valve_as_its_law_says():
    """Half a turn lifts by a tenth of the drawn distance, a whole one puts it back."""
    pane = sketch()
    for z in (0j, 0.3 + 0j, 2j, 3j):
        pane.add(z)
    act(pane, "Link", "A", "B")
    act(pane, "Link", "C", "D")
    act(pane, "To the frame", "A", "C")
    pane.angle.value = 90.0
    act(pane, "Slider", "C")
    act(pane, "Cam", "A", "C")
    assert pane.sheet.problems == ()
    (cam,) = pane.sheet.form["couplings"].values()
    motor = cam["driver"]
    q = [0.0, math.pi / 2, math.pi, 2 * math.pi]
    found = pane.sheet.mechanism.run(at={motor: q}, rates={motor: 1.0}, want=["link.link1.p"])
    height = found["link.link1.p"].imag - 2.0
    assert height == pytest.approx([0.0, 0.1, 0.2, 0.0], abs=1e-12)
    act(pane, "Cam", "C", "A")
    assert "in this order" in pane.said.object
    made = outlines(Order(pane.sheet.mechanism, (), {"at": {motor: 0.0}}))
    assert any(made.values())  # of links that have one pin each, and so no length


def test_a_press_that_is_drawn_closed_is_released_from_a_pose_that_can_move():
    """Its cylinder begins at a dead centre, from which nothing is released."""
    pane = sketch()
    view = MechanismView(pane.sheet)
    answers = Answers(pane.sheet, view)
    for z in (1j, 0.15 + 0.5j, 0j, 1.0 + 0.6j):
        pane.add(z)
    act(pane, "Link", "A", "B")
    act(pane, "Link", "B", "C")
    act(pane, "To the frame", "A", "D")
    pane.angle.value = 90.0
    act(pane, "Slider", "C")
    act(pane, "Cylinder", "B", "D")
    assert pane.sheet.problems == ()
    (q,) = view.coordinates.values()
    assert q > 1.2 * min(view.motion.q["motor"])
    act(pane, "Force", "C")
    answers.until.value = "time=0.1"
    for words in ("[no-inertia]", "reached: time"):
        answers.simulate()
        answers.work.thread.join(30)
        assert answers.said.object.startswith(words)
        assert ("Masses" in answers.said.object) == (words == "[no-inertia]")
        act(pane, "Masses", *pane.drawn)
    for name, words in (("Tolerance", "driver.motor.drive"), ("Verify", "closure of")):
        answers.analyses.run(name)  # of poses that no law says, with lengths and not with poses
        answers.work.thread.join(30)
        assert words in answers.analyses.text.object


def test_an_angle_is_typed_about_a_pin():
    pane = fourbar()
    pane.meant({"act": "angle", "pins": ["A", "B"], "value": math.pi / 2})
    assert pane.drawn["B"].z == pytest.approx(2j)
    pane.meant({"act": "angle", "pins": ["A", "B", "C"], "value": math.pi / 2})
    assert (pane.drawn["C"].z - 2j).imag == pytest.approx(0.0, abs=1e-12)
    assert (pane.drawn["C"].z - 2j).real > 0


def test_a_spring_is_at_rest_as_drawn_and_a_force_goes_with_its_link():
    pane = fourbar()
    act(pane, "Spring", "A", "C")
    act(pane, "Force", "B")
    spring, force = pane.sheet.form["loads"].values()
    assert spring["free_length"] == pytest.approx(abs(7.607142857142857 + 2.135403697j))
    assert force["link"] in pane.drawn["B"].links
    assert pane.sheet.problems == ()
    act(pane, "Delete", "C", "B")
    assert "loads" not in pane.sheet.form or list(pane.sheet.form["loads"]) == ["spring"]


def test_masses_of_bars_let_a_drawing_be_simulated():
    """A bar of 1 kg/m; a triangle has the mass of three. The drawn four-bar then falls."""
    pane = fourbar()
    form = {**pane.sheet.form, "gravity": [0.0, -9.81]}
    pane.sheet.change(form, "gravity")
    pane.act("Masses")
    crank = pane.sheet.form["links"]["link"]
    assert [crank["mass"], crank["inertia"], crank["cm"]] == [
        2.0,
        pytest.approx(8 / 12),
        [1.0, 0.0],
    ]
    pane.sheet.mechanism.simulate("time=0.1", start={"motor": (0.5, 0.0)})
    before = pane.sheet.form
    pane.act("Masses")
    assert pane.sheet.form == before
    pane = sketch()
    for z in (0j, 3 + 0j, 4j):
        pane.add(z)
    act(pane, "Link", "A", "B", "C")
    pane.act("Masses")
    body = pane.sheet.form["links"]["link"]
    assert body["mass"] == pytest.approx(12.0)
    assert body["cm"] == pytest.approx([(1.5 * 3 + 1.5 * 5) / 12, (2 * 4 + 2 * 5) / 12])


def test_a_copy_is_moved_as_what_it_was_made_of():
    pane = sketch()
    for z in (0j, 1 + 0j):
        pane.add(z)
    act(pane, "Link", "A", "B")
    form = pane.sheet.form
    form = {**form, "links": {"link": {**form["links"]["link"], "mass": 2.0}}}
    pane.sheet.change(form, "mass")
    act(pane, "Copy", "A", "B")
    assert pane.drawn["D"].z - pane.drawn["C"].z == 1
    assert pane.sheet.form["links"]["link1"]["mass"] == 2.0
    act(pane, "Delete", *"ABCD")
    assert pane.sheet.form["links"] == {} == pane.drawn


@pytest.mark.parametrize(
    ("button", "pins", "why"),
    [
        ("Link", "AB", "on link already"),
        ("Link", "A", "needs two pins"),
        ("Slider", "A", "driver away first"),
        ("Driver", "D", "conflicting-drivers"),
        ("Driver", "E", "joins no two links"),
        ("Spring", "ABC", "choose two pins"),
        ("Force", "E", "no link is there"),
    ],
)
def test_a_wrong_gesture_says_why_and_changes_nothing(button, pins, why):
    pane, told = fourbar(), []
    pane.add(9 + 9j)
    pane.canvas.tell = lambda text: told.append(text)
    form = pane.sheet.form
    act(pane, button, *pins)
    assert why in pane.said.object
    assert why in told[-1]
    assert pane.sheet.form == form


# -- by hand in the browser ------------------------------------------------------------------


def test_a_four_bar_is_drawn_in_the_browser(page, studio):
    hand = drawing(page, studio)
    hand.link(hand.at(0.3, 0.6), hand.at(0.35, 0.4), "B")
    hand.link(hand.pin("B"), hand.at(0.6, 0.3), "C", typed="0.75@0.25")
    x, y = hand.pin("C")
    hand.link(hand.pin("C"), (x + 40, y + 130), "D")
    hand.click("A")
    hand.click("D", modifiers=["Control"])
    hand.press("To the frame", "To the frame: A, D.")
    hand.click("A")
    hand.press("Driver", "RRR")
    assert hand.acts <= 12
    page.get_by_label("distance B to C").click()
    page.keyboard.type("0.8")
    page.keyboard.press("Enter")
    page.get_by_role("status").get_by_text("B to C").wait_for()
    save(page, "drawn.json")
    made = bm.Linkage.load(studio[1] / "drawn.json")
    assert made.check() == []
    pins = sketching.pins_of(made.to_data())
    assert [(pins[name].kind, len(pins[name].links)) for name in "ABCD"] == [("R", 2)] * 4
    assert abs(pins["C"].z - pins["B"].z) == pytest.approx(0.8, rel=1e-12)
    assert cmath.phase(pins["C"].z - pins["B"].z) == pytest.approx(0.25, abs=1e-9)


def refused_at(page, place, why):
    """What is wrong is said where the pointer is."""
    bubble = page.locator(".bubble")
    bubble.get_by_text(why).wait_for()
    box = bubble.bounding_box()
    assert math.dist((box["x"], box["y"]), place) < 40


def test_a_slider_crank_is_drawn_in_the_browser_and_what_cannot_be_is_refused(page, studio):
    hand = drawing(page, studio)
    hand.link(hand.at(0.3, 0.6), hand.at(0.35, 0.4), "B")
    hand.link(hand.pin("B"), hand.at(0.65, 0.6), "C")
    hand.click("C")
    hand.press("Slider", "Slider: C.")
    hand.click("A")
    hand.press("To the frame", "To the frame: A.")
    hand.press("Driver", "RRP")
    assert hand.acts <= 12
    save(page, "slider.json")
    made = bm.Linkage.load(studio[1] / "slider.json")
    assert made.check() == []
    kinds = sorted(joint["type"] for joint in made.to_data()["joints"].values())
    assert kinds == ["P", "R", "R", "R"]
    for name, act, why in (("A", "Slider", "driver away first"), ("B", "Driver", "conflicting")):
        place = hand.pin(name)
        hand.click(name, button="right")
        page.get_by_role("menuitem", name=act).click()
        refused_at(page, place, why)


def test_keys_and_a_wrong_gesture_in_the_browser(page, studio):
    """A box chooses, arrows move, Delete deletes; what cannot be is said at the pointer."""
    hand = drawing(page, studio)
    hand.link(hand.at(0.3, 0.6), hand.at(0.5, 0.4), "B")
    before = hand.pin("A"), hand.pin("B")
    hand.drag(before[0], before[1])
    refused_at(page, before[1], "they are on link already")
    hand.drag(hand.at(0.2, 0.2), hand.at(0.6, 0.8))
    page.keyboard.press("ArrowRight")
    page.get_by_role("status").get_by_text("move A, B").wait_for()
    assert [hand.pin(name)[0] > x for name, (x, _) in zip("AB", before, strict=True)] == [True] * 2
    page.keyboard.press("Control+d")
    page.locator('[data-pin="D"]').wait_for()
    page.locator("svg[role=application]").press("Escape")
    hand.click("D", button="right")
    page.get_by_role("menuitem", name="Delete").click()
    page.locator('[data-pin="D"]').wait_for(state="detached")
    page.locator("svg[role=application]").press("Control+a")
    page.keyboard.press("Delete")
    page.get_by_text("Drag: a link is drawn").wait_for()


DXF = """0
SECTION
2
HEADER
9
$INSUNITS
70
4
0
ENDSEC
2
ENTITIES
0
LINE
10
0
20
0
11
200
21
0
0
CIRCLE
10
200
20
50
40
25
0
EOF
"""


def test_a_picture_is_placed_and_scaled_to_be_traced(page, studio, tmp_path):
    """A DXF in mm has its size; a length of it that is typed is that long afterwards."""
    hand = drawing(page, studio)
    (tmp_path / "plan.dxf").write_text(DXF, "utf-8")
    page.locator("input[type=file][accept*=dxf]").set_input_files(tmp_path / "plan.dxf")
    trace = page.locator("path.trace")
    trace.wait_for()
    drawn = trace.evaluate("it => it.getBoundingClientRect().width")
    scale = 0.225 / drawn  # [m/px]: the line and half of the circle are 225 mm wide
    page.get_by_role("button", name="Scale the picture").click()
    start = hand.at(0.2, 0.5)
    hand.drag(start, (start[0] + 0.1 / scale, start[1]), typed="0.2")
    width = trace.evaluate("it => it.getBoundingClientRect().width")
    assert width == pytest.approx(2 * drawn, rel=0.01)
    page.get_by_role("button", name="Place the picture").click()
    before = trace.evaluate("it => it.getBoundingClientRect().x")
    hand.drag(start, (start[0] + 60, start[1]))
    after = trace.evaluate("it => it.getBoundingClientRect().x")
    assert after - before == pytest.approx(60, abs=12)  # to the grid
    page.get_by_role("button", name="Remove the picture").click()
    trace.wait_for(state="detached")
    assert page.locator("[data-pin]").count() == 0
