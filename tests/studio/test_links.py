"""Links and joints drawn as a sketch: a document that says the same, and the groups in it."""

import json
import math
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.editor import drawing, sketching
from blockmech.editor.pins import Drawn, outlines_of, pins_of
from blockmech.editor.sheets import link_of
from blockmech.exchange.formats import Order
from blockmech.exchange.outlines import outlines
from tests.studio.hand import Hand

GRAPHS = Path(__file__).parents[2] / "graphs"
JOINTS = sorted(path.stem for path in (GRAPHS / "joints").glob("*.json"))


def sketch(pins=(), *links):
    """A new drawing with pins A, B, ... at these places, and links of these pins."""
    pane = Hand(bm.Linkage("drawn"))
    for z in pins:
        pane.add(z)
    for ends in links:
        pane.act("Link", *ends)
    return pane


def fourbar():
    """The paper's four-bar as it is drawn: four pins, three links, a frame and a driver."""
    pins = [0j, 2 + 0j, 7.607142857142857 + 2.135403697j, 5.5 + 0j]
    pane = sketch(pins, "AB", "BC", "CD")
    pane.act("To the frame", "A", "D")
    pane.act("Driver", "A")
    return pane


def test_a_drawn_four_bar_moves_as_the_file_does():
    pane = fourbar()
    assert pane.problems == ()
    assert "RRR" in pane.said
    motor = pane.mechanism.drivers[0]
    result = pane.mechanism.run(
        at={motor: [0.0, 1.0]}, want=["link.link_3.omega"], friction="none", rates={motor: 10.0}
    )
    file = opened(GRAPHS / "joints" / "ruiz_fourbar.json").run(
        at=[0.0, 1.0], want=["link.rocker.omega"], friction="none"
    )
    length = abs(complex(7.607142857142857, 2.135403697) - 5.5)
    assert length == pytest.approx(3, abs=1e-8)  # how exactly it was drawn
    assert result["link.link_3.omega"] == pytest.approx(file["link.rocker.omega"], rel=1e-7)


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


def test_a_drawing_that_cannot_move_has_its_diagnosis():
    pane = fourbar()
    pane.act("Driver", "A")
    assert pane.mechanism is None
    assert "driver" in pane.said


def test_a_slider_crank_is_drawn():
    pane = sketch([0j, 1 + 0j, 4 + 0j, 4 + 0j], "AB", "BC", "CD")
    pane.act("To the frame", "A", "D")
    pane.act("Slider", "D")
    pane.act("Driver", "A")
    assert "RRP" in pane.said
    result = pane.mechanism.run(at=[1.0], rates=0.0, want=["link.link_3.p"], friction="none")[
        "link.link_3.p"
    ][0]
    exact = math.cos(1.0) + math.sqrt(9 - math.sin(1.0) ** 2)
    assert result == pytest.approx(exact, abs=1e-14)


def test_a_pin_is_moved_and_deleted_in_the_browsers_way():
    pane = fourbar()
    pane.do("move", pins={"A": [0.25, 0.0]})
    assert pane.drawn["A"].z == 0.25
    pane.do("pin", at=[1.23, 2.0])
    assert pane.drawn["E"] == Drawn(1.23 + 2j)
    pane.act("Delete", "A")
    assert "A" not in pane.drawn
    assert "drivers" not in pane.sheet.form


def test_pins_that_no_link_carries_are_kept_in_the_file_and_not_computed_with():
    pane = fourbar()
    before = pane.mechanism.run(at=[1.0], rates=0.0, friction="none").to_csv()
    pane.add(9 + 9j)
    again = bm.Linkage.from_data(pane.sheet.form)
    assert pins_of(again.to_data())["E"].z == 9 + 9j
    assert again.run(at=[1.0], rates=0.0, friction="none").to_csv() == before
    pane.act("Delete", "E")
    assert "view" not in pane.sheet.form


@pytest.mark.parametrize("name", JOINTS)
def test_every_document_of_the_gallery_is_shown_as_it_is(name):
    sheet = Hand(opened(GRAPHS / "joints" / f"{name}.json"))
    pins = pins_of(sheet.form)
    drawn = drawing.of_links(sheet.form)
    assert [pin["name"] for pin in drawn["pins"]] == list(pins)
    json.dumps(drawn, allow_nan=False)
    assert set(sheet.form["joints"]) <= set(pins)
    assert set(outlines_of(pins)) <= set(sheet.form["links"])


def test_a_link_gets_a_slider_at_its_free_end():
    pane = sketch([0j, 1 + 0j, 4 + 0j], "AB", "BC")
    pane.act("To the frame", "A")
    pane.act("Slider", "C")
    pane.act("Driver", "A")
    assert "RRP" in pane.said
    result = pane.mechanism.run(at=[1.0], rates=0.0, want=["link.slider.p"])["link.slider.p"]
    exact = math.cos(1.0) + math.sqrt(9 - math.sin(1.0) ** 2)
    assert result[0] == pytest.approx(exact, abs=1e-14)


def test_a_block_slides_on_a_moving_link():
    """The shaper's: a crank's pin on a block in the slot of a rocker."""
    pane = sketch([0j, 1j, -2j], "AB")
    pane.add(0.5 + 0j)  # on the rocker, off the crank
    pane.act("Link", "C", "D")
    pane.act("To the frame", "A", "C")
    pane.act("Slider", "B", angle=math.pi / 2, on="link_2")
    pane.act("Driver", "A")
    assert pane.problems == ()
    result = pane.mechanism.run(at=[0.7], rates=1.0, want=["link.link_2.omega"])
    b = 1j * complex(math.cos(0.7), math.sin(0.7))  # the rocker points from C to B
    assert result["link.link_2.omega"][0] == pytest.approx((1j * b / (b + 2j)).imag, abs=1e-14)


def test_a_pin_and_the_guide_of_its_block_move_together():
    pane = sketch([0j, 1 + 0j], "AB")
    pane.act("Slider", "B")
    for name, z in (("B", 2 + 1j), ("B_guide", 3 + 0j)):
        pane.sheet.change(sketching.moved(pane.sheet.form, {name: z}), "moved")
        assert [pane.drawn[n].z for n in ("B", "B_guide", "A")] == [z, z, 0]


def test_what_a_button_cannot_do_is_said():
    pane = fourbar()
    pane.add(3 + 0j)
    pane.act("To the frame", "E")
    pane.act("Slider", "E")
    assert "choose another link" in pane.said
    pane.act("Link")
    assert "choose pins of a drawing first" in pane.said


@pytest.mark.parametrize(
    "name",
    ["ruiz_fourbar", "engine", "excavator", "valve_engine", "planetary_hoist", "rack_gripper"],
)
def test_blocks_are_drawn_on_as_links_and_joints(name):
    """Every link of the same name, drive and reaction: the document that is made moves alike."""
    pane = Hand(opened(GRAPHS / f"{name}.json"))
    sheet = pane.sheet
    before = pane.mechanism.run(samples=7, want=[f"{d}.drive" for d in pane.mechanism.drivers])
    pane.do("redraw")
    assert "joints" in pane.form
    assert sheet.undoable == "drawn as links and joints"
    drives = [f"driver.{d}.drive" for d in pane.mechanism.drivers]
    after = pane.mechanism.run(samples=7, want=drives)
    for was, now in zip(before, after, strict=True):
        size = abs(before[was]).max() or 1.0
        assert after[now] == pytest.approx(before[was], abs=1e-9 * size)
    sheet.undo()
    assert "blocks" in pane.form


def test_blocks_that_links_and_joints_do_not_say_alike_are_refused():
    pane = Hand(opened(GRAPHS / "n_four_bar.json"))
    pane.do("redraw")
    assert "would stand" in pane.said
    assert "blocks" in pane.form


def test_a_distance_is_typed_and_the_loose_end_moves():
    pane = fourbar()
    pane.do("dimension", ends=["A", "B"], value=2.5)
    assert pane.drawn["B"].z == pytest.approx(2.5)
    pane.do("dimension", ends=["C", "D"], value=2.0)
    assert pane.drawn["D"].z == 5.5
    assert abs(pane.drawn["C"].z - 5.5) == pytest.approx(2.0)


def test_pins_that_move_together_keep_their_distances():
    """Each goes where it is sent, also where another one stood before."""
    pane = fourbar()
    pane.do("move", pins={"A": [2.0, 0.0], "B": [4.0, 0.0]})
    assert [pane.drawn[name].z for name in "AB"] == [2.0, 4.0]


def test_a_machine_with_cylinders_is_moved_as_a_whole():
    """Places that rounded poses do not bring together stay apart, and it runs as before."""
    sheet = Hand(opened(GRAPHS / "joints" / "excavator.json"))
    places = {name: pin.z + 0.7 - 0.35j for name, pin in pins_of(sheet.form).items()}
    mechanism = bm.Linkage.from_data(sketching.moved(sheet.form, places)).compile()
    names = [f"link.{name}.omega" for name in ("boom", "arm", "bucket")]
    one, other = (m.run(samples=5, want=names) for m in (sheet.mechanism, mechanism))
    for name in names:
        assert other[name] == pytest.approx(one[name], rel=1e-11)


def test_a_gesture_that_begins_and_ends_at_pins_joins_them():
    pane = sketch()
    pane.do("draw", **{"tool": "", "from": {"at": [0, 0]}, "to": {"at": [1, 0]}})
    pane.do("draw", **{"tool": "", "from": {"pin": "B"}, "to": {"at": [2, 1]}})
    on_link = {"at": [0.5, 0], "on": "link"}
    pane.do("draw", **{"tool": "Link", "from": {"at": [0.5, 2]}, "to": on_link})
    assert pane.drawn["B"].links == ("link", "link_2")
    assert pane.drawn["E"].links == ("link", "link_3")
    assert [pin.kind for pin in pane.drawn.values()].count("R") == 2


def test_a_cylinder_lifts_an_arm():
    """The law of cosines tells the arm's angle from the cylinder's length."""
    pane = sketch([0j, 2 + 0j, 1 - 1j], "AB")
    pane.act("To the frame", "A")
    pane.act("Cylinder", "C", "B")
    pane.act("To the frame", "C")
    assert pane.problems == ()
    (driver,) = pane.mechanism.drivers
    q = 1.5
    result = pane.mechanism.run(at={driver: [q]}, rates=0.0, want=["joint.B.p"])
    b = result["joint.B.p"][0]
    assert abs(b) == pytest.approx(2, abs=1e-13)
    assert abs(b - (1 - 1j)) == pytest.approx(q, abs=1e-13)


def test_gears_let_one_driver_follow_another():
    pane = sketch([0j, 1 + 0j, 3 + 0j, 4 + 1j], "AB", "CD")
    pane.act("To the frame", "A", "C")
    pane.act("Gears", "A", "C")
    (gear,) = pane.sheet.form["couplings"].values()
    assert [pane.sheet.form["drivers"][gear[key]]["joint"] for key in ("driver", "driven")] == [
        "A",
        "C",
    ]
    assert pane.problems == ()
    assert [wheel["radius"] for wheel in drawing.of_links(pane.form)["wheels"]] == [1.5, 1.5]
    pane.act("Rack", "A", "C")
    assert "joint that slides" in pane.said
    pane.act("Delete", "C")
    assert "couplings" not in pane.sheet.form


def test_a_rack_turns_the_pinion_that_reaches_it():
    """The pinion rolls on the rack: its angle is the way over the drawn radius."""
    pane = sketch([0j, 0.5j, 2 - 0.5j, 3 - 0.5j], "AB", "CD")
    pane.act("To the frame", "A", "C")
    pane.act("Slider", "C")
    pane.act("Rack", "C", "A")
    assert pane.problems == ()
    (rack,) = pane.sheet.form["couplings"].values()
    assert rack["radius"] == 0.5
    assert [wheel["radius"] for wheel in drawing.of_links(pane.form)["wheels"]] == [0.5]
    motor = rack["driver"]
    result = pane.mechanism.run(at={motor: [0.2]}, rates={motor: 1.0}, want=["link.link.omega"])
    v = 1.0  # of the rack along +x; the point of the pinion below its centre moves with it
    assert result["link.link.omega"][0] * 0.5 == pytest.approx(v, rel=1e-12)


def test_a_cam_lifts_a_valve_as_its_law_says():
    """Half a turn lifts by a tenth of the drawn distance, a whole one puts it back."""
    pane = sketch([0j, 0.3 + 0j, 2j, 3j], "AB", "CD")
    pane.act("To the frame", "A", "C")
    pane.act("Slider", "C", angle=math.pi / 2)
    pane.act("Cam", "A", "C")
    assert pane.problems == ()
    (cam,) = pane.sheet.form["couplings"].values()
    motor = cam["driver"]
    q = [0.0, math.pi / 2, math.pi, 2 * math.pi]
    result = pane.mechanism.run(at={motor: q}, rates={motor: 1.0}, want=["link.link_2.p"])
    height = result["link.link_2.p"].imag - 2.0
    assert height == pytest.approx([0.0, 0.1, 0.2, 0.0], abs=1e-12)
    pane.act("Cam", "C", "A")
    assert "in this order" in pane.said
    made = outlines(Order(pane.mechanism, (), {"at": {motor: 0.0}}))
    assert any(made.values())  # of links that have one pin each, and so no length


def test_an_angle_is_typed_about_a_pin():
    pane = fourbar()
    pane.do("angle", pins=["A", "B"], value=math.pi / 2)
    assert pane.drawn["B"].z == pytest.approx(2j)
    pane.do("angle", pins=["A", "B", "C"], value=math.pi / 2)
    assert (pane.drawn["C"].z - 2j).imag == pytest.approx(0.0, abs=1e-12)
    assert (pane.drawn["C"].z - 2j).real > 0


def test_a_spring_is_at_rest_as_drawn_and_a_force_goes_with_its_link():
    pane = fourbar()
    pane.act("Spring", "A", "C")
    pane.act("Force", "B")
    spring, force = pane.sheet.form["loads"].values()
    assert spring["free_length"] == pytest.approx(abs(7.607142857142857 + 2.135403697j))
    assert force["link"] in pane.drawn["B"].links
    assert pane.problems == ()
    pane.act("Delete", "C", "B")
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
    pane.mechanism.simulate("time=0.1", start={"motor": (0.5, 0.0)})
    before = pane.sheet.form
    pane.act("Masses")
    assert pane.sheet.form == before
    pane = sketch([0j, 3 + 0j, 4j], "ABC")
    pane.act("Masses")
    body = pane.sheet.form["links"]["link"]
    assert body["mass"] == pytest.approx(12.0)
    assert body["cm"] == pytest.approx([(1.5 * 3 + 1.5 * 5) / 12, (2 * 4 + 2 * 5) / 12])


def test_a_copy_is_moved_as_what_it_was_made_of():
    pane = sketch([0j, 1 + 0j], "AB")
    form = pane.sheet.form
    form = {**form, "links": {"link": {**form["links"]["link"], "mass": 2.0}}}
    pane.sheet.change(form, "mass")
    pane.act("Copy", "A", "B")
    assert pane.drawn["D"].z - pane.drawn["C"].z == 1
    assert pane.sheet.form["links"]["link_2"]["mass"] == 2.0
    pane.act("Delete", *"ABCD")
    assert pane.sheet.form["links"] == {} == pane.drawn


def test_an_angle_needs_pins_that_stand_apart():
    pane = sketch()
    pane.add(0j, 1 + 0j)
    pane.act("Link", "A", "B")
    pane.act("Slider", "B")
    form = pane.form
    for pins in (["B_guide", "B", "A"], ["A", "B", "B_guide"], ["B", "B_guide"]):
        pane.act("Dimension", *pins)
        assert "choose pins that stand apart" in pane.said
    assert pane.form == form


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
    pane = fourbar()
    pane.add(9 + 9j)
    form = pane.sheet.form
    pane.act(button, *pins)
    assert why in pane.said
    assert pane.sheet.form == form


@pytest.mark.parametrize(
    ("name", "pin"), [("stephenson_3", "P"), ("planetary_hoist", "O"), ("watt_sixbar", "C")]
)
def test_a_deleted_joint_takes_its_marker_with_it(name, pin):
    """Of one name: the joint lies over a marker of one of its links."""
    pane = Hand(opened(GRAPHS / "joints" / f"{name}.json"))
    assert any(pin in link.get("markers", {}) for link in pane.form["links"].values())
    pane.act("Delete", pin)
    assert pin not in pane.drawn


LENGTH = {"type": "length", "points": ["link.A", "link.B"], "value": 1.0}


@pytest.mark.parametrize(
    ("act", "request_", "points"),
    [
        ("To the frame", {"pins": ["A"]}, ["A", "link.B"]),
        ("Driver", {"pins": ["A"]}, ["A", "link.B"]),
        ("Slider", {"pins": ["B"]}, ["link.A", "B"]),
        ("draw", {"from": {"pin": "B"}, "to": {"at": [2, 1]}}, ["link.A", "B"]),
        ("Delete", {"pins": ["B"]}, None),
        ("remove", {"part": ["links", "link"]}, None),
    ],
)
def test_a_dimension_goes_with_its_pins(act, request_, points):
    """A marker is called by its link, a joint is not: a pin is one, then the other."""
    pane = sketch()
    pane.add(0j, 1 + 0j)
    pane.act("Link", "A", "B")
    pane.act("Dimension", "A", "B")
    assert pane.form["dimensions"] == {"length": LENGTH}
    pane.do(act, **request_)
    dimensions = {"length": {**LENGTH, "points": points}} if points else {}
    assert pane.form.get("dimensions", {}) == dimensions


def test_a_dimension_stays_when_a_pin_leaves_the_frame():
    pane = Hand(opened(GRAPHS / "joints" / "ruiz_fourbar.json"))
    pane.act("Dimension", "A", "B")
    assert pane.form["dimensions"]["length"]["points"] == ["A", "B"]
    pane.act("To the frame", "A")
    assert pane.form["dimensions"]["length"]["points"] == ["crank.A", "B"]


def test_a_dimension_of_two_markers_of_one_name_stays():
    pane = fourbar()
    form = pane.form
    markers = {"link": [1.0, 0.0], "link_2": [1.0, 0.5]}
    links = {
        name: {**form["links"][name], "markers": {"M": {"at": at}}} for name, at in markers.items()
    }
    between = {"type": "length", "points": ["link.M", "link_2.M"], "value": 0.7}
    form = {**form, "links": {**form["links"], **links}, "dimensions": {"between": between}}
    pane.sheet.change(form, "markers")
    pane.act("Delete", "D")
    assert pane.form["dimensions"] == {"between": between}
    pane.do("remove", part=["links", "link"])
    assert "dimensions" not in pane.form


def test_a_typed_point_of_a_dimension_that_is_none_is_refused():
    pane = fourbar()
    pane.act("Dimension", "A", "B")
    form, part = pane.form, ["dimensions", "length"]
    pane.do("fields", part=part, edits=[[["points"], '["A", "X"]']])
    assert 'no joint or marker "X"' in pane.said
    assert pane.form == form


def test_what_does_not_close_at_its_start_has_a_link_without_its_motion():
    """A cylinder without a law starts at its length 0, at which nothing meets."""
    pane = Hand(bm.Linkage("bucket"))
    pane.add(0.2, 0.22 + 0.08j, 0.32 + 0.08j, 0.34, 0.04 + 0.1j)
    for pins in ("AB", "BC", "CD"):
        pane.act("Link", *pins)
    pane.act("To the frame", "A", "D", "E")
    pane.act("Cylinder", "E", "B")
    assert pane.problems == ()
    link = link_of(pane.sheet.now, ())
    assert link.page is None
    assert "the group cannot close" in link.why
