"""Links and joints drawn as a sketch: a document that says the same, and the groups in it."""

import math
import re
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.studio import sketching
from blockmech.studio.links import LinksSheet, columns_of, outlines_of
from blockmech.studio.sheet import Sheet
from tests.studio.page import press, save, show

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
    data = {name: list(column) for name, column in pane._pins.data.items()}
    first = data["name"].index("A")
    data["x"][first] += 0.25
    pane.take(data)
    assert pane.drawn["A"].z == 0.25
    data = {name: [*column, ""] for name, column in pane._pins.data.items()}
    data["x"][-1], data["y"][-1] = 1.23456, 2.0
    pane.take(data)
    assert pane.drawn["E"] == sketching.Drawn(1.23 + 2j)
    first = pane._pins.data["name"].index("A")
    data = {n: [*c[:first], *c[first + 1 :]] for n, c in pane._pins.data.items()}
    pane.take(data)
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
    columns = columns_of(pins)
    assert len({len(column) for column in columns.values()}) == 1
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
        pane.sheet.change(sketching.moved(pane.sheet.form, name, z), "moved")
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


def test_a_four_bar_is_drawn_in_the_browser(page, studio):
    show(page, studio, "?new")
    page.get_by_text("Links and joints", exact=True).click()
    press(page, "Begin a drawing of links and joints")
    area = page.locator(".bk-Figure:visible").first.bounding_box()
    pins = page.get_by_label("Pins")
    for name, (x, y) in zip("ABCD", [(0.3, 0.6), (0.35, 0.4), (0.6, 0.3), (0.7, 0.6)], strict=True):
        page.mouse.click(area["x"] + x * area["width"], area["y"] + y * area["height"])
        pins.get_by_text(name, exact=True).wait_for(state="attached")
        page.wait_for_timeout(300)  # two taps at once would be a double one
    steps = [*(("Link", ends) for ends in ("AB", "BC", "CD")), ("To the frame", "AD")]
    for button, ends in (*steps, ("Driver", "A")):
        pins.select_option(list(ends))
        press(page, button)
        done = re.compile(rf"{button}: [{ends}, ]+\.")
        page.get_by_role("status").get_by_text(done).wait_for()
    page.get_by_role("status").get_by_text("RRR").wait_for()
    save(page, "drawn.json")
    made = bm.Linkage.load(studio[1] / "drawn.json")
    assert made.check() == []
    assert sorted(made.to_data()["joints"]) == list("ABCD")
