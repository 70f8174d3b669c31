"""What a user does on the page and what it answers, by mouse and by keyboard."""

import re
import shutil
from contextlib import suppress

import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.studio import edits
from blockmech.studio.files import Filed
from blockmech.studio.looks import DARK, LIGHT
from blockmech.testing.graph_files import gallery
from tests.studio.page import (
    add,
    blocks,
    choose,
    connect,
    drag_wire,
    edit,
    fill,
    hidden_wires,
    port,
    press,
    save,
    show,
    told,
    wire_between,
)

tool = pytest.importorskip("playwright.sync_api", reason="it is no browser's driver")
expect, Error = tool.expect, tool.Error

ODD = '<img src=x onerror="window\u2024hurt=1">\u202e\'a'  # a name has no full stop

FOCUSED = """() => {
  let at = document.activeElement;
  while (at?.shadowRoot?.activeElement) at = at.shadowRoot.activeElement;
  return at?.ariaLabel ?? at?.labels?.[0]?.textContent ?? at?.textContent ?? "";
}"""


def tab_to(page, name):
    """Press the tabulator until what has this name has the focus."""
    for _ in range(150):
        page.keyboard.press("Tab")
        if page.evaluate(FOCUSED) == name:
            return
    pytest.fail(f"the tabulator never comes to {name}")


def test_a_wrong_wire_is_refused_while_it_is_dragged_and_by_the_form(page, studio):
    show(page, studio, "?example=ruiz_fourbar")
    graph = opened(gallery()["ruiz_fourbar"])
    with pytest.raises(bm.GraphError) as refused:
        graph.connect("frame.D", "dyad.B")
    end = drag_wire(page, "frame.D", "dyad.B")
    expect(end).to_have_class(re.compile("refused"))
    expect(page.locator(".tip")).to_have_text(str(refused.value))
    page.mouse.up()
    edit(page, "dyad")
    choose(page, "wire to dyad.B", "dyad.C")
    form = edits.wired(graph.to_data(), None, "dyad.B")
    with pytest.raises(bm.GraphError) as refused:
        bm.Graph.from_data(form).connect("dyad.C", "dyad.B")
    (problem,) = refused.value.problems
    page.get_by_role("alert").get_by_text(problem.found).wait_for()
    wire_between(page, "crank.B", "dyad.B").wait_for(state="attached")


def test_a_closed_loop_is_told_at_its_blocks_and_ports(page, studio):
    show(page, studio, "?new")
    add(page, "II RRR")
    add(page, "II RRR")
    connect(page, "rrr.C", "rrr_2.B")
    connect(page, "rrr_2.C", "rrr.B")
    bad = page.locator(".block.bad")
    expect(bad).to_have_count(2)
    assert sorted(block.get_attribute("data-id") for block in bad.all()) == ["rrr", "rrr_2"]
    said = re.compile("the blocks wait for each other: rrr.C -> rrr_2.B, rrr_2.C -> rrr.B")
    for address in ("rrr.B", "rrr_2.B"):
        expect(port(page, "target", address)).to_have_attribute("aria-label", said)
    expect(page.get_by_label("problems")).to_contain_text(said)


def test_all_is_undone_and_done_again(page, studio):
    show(page, studio, "?new")
    for word in ("frame", "crank"):
        add(page, word)
    fill(page, "length [m]", "2")
    connect(page, "frame.frame", "crank.A")
    save(page, "once.json")
    steps = ["frame added", "crank added", "length", "frame.frame -> crank.A"]
    for name, left in (("Undo", 0), ("Redo", 2)):
        for step in steps[:: 1 if name == "Redo" else -1]:
            press(page, name)
            told(page, f"{name}: {step}")
        expect(page.get_by_role("button", name=name, exact=True)).to_be_disabled()
        expect(blocks(page)).to_have_count(left)
    save(page, "again.json")
    once, again = ((studio[1] / name).read_bytes() for name in ("once.json", "again.json"))
    assert once == again
    assert b'"crank.A"' in once


@pytest.mark.parametrize("name", gallery())
def test_a_sheet_saves_a_gallery_graph_unchanged(tmp_path, name):
    path = tmp_path / "a.json"
    shutil.copy(gallery()[name], path)
    sheet = Filed(None, tmp_path)
    sheet.open("a.json")
    sheet.save("b.json")
    assert (tmp_path / "b.json").read_bytes() == path.read_bytes()


@pytest.mark.parametrize("name", ["engine", "watt_sixbar"])
def test_a_gallery_graph_opens_plays_and_saves_unchanged(page, studio, name):
    given = studio[1] / f"{name}.json"
    shutil.copy(gallery()[name], given)
    show(page, studio, f"?open={given.name}")
    assert hidden_wires(page) == []
    pose = page.get_by_label("Pose", exact=True)
    press(page, "▶ Play")
    page.wait_for_function("at => at.value > 0", arg=pose.element_handle())
    press(page, "❚❚ Pause")
    assert float(pose.input_value()) > 0
    save(page, f"{name}_b.json")
    assert (studio[1] / f"{name}_b.json").read_bytes() == given.read_bytes()


def test_odd_names_are_text_and_run_nothing(page, studio):
    show(page, studio, "?example=ruiz_fourbar")
    edit(page, "crank")
    fill(page, "Name", ODD)
    page.locator(".block.driver").get_by_text(ODD).wait_for()
    choose(page, "Edit", "mechanism")
    page.get_by_label("title", exact=True).wait_for()
    fill(page, "title", ODD)
    fill(page, "name", "<b>\"'\u202e")
    save(page, "<i>a'b\u202e.json")
    page.goto(studio[0])
    page.get_by_text("<i>a'b\u202e.json").click()
    page.locator(".block.driver").get_by_text(ODD).wait_for()
    assert page.evaluate("window.hurt") is None
    assert page.locator("img[src=x]").count() == 0


def test_a_file_that_another_changed_is_not_overwritten(page, studio):
    path = studio[1] / "shared.json"
    shutil.copy(gallery()["ruiz_fourbar"], path)
    show(page, studio, "?open=shared.json")
    other = Filed(None, studio[1])
    other.open("shared.json")
    other.change({**other.form, "title": "mine"}, "title")
    other.save("shared.json")
    theirs = path.read_bytes()
    fill(page, "title", "yours")
    press(page, "Save")
    page.get_by_role("status").get_by_text("changed by somebody else").wait_for()
    assert path.read_bytes() == theirs
    press(page, "Replace the file")
    told(page, "wrote shared.json")
    assert bm.Graph.load(path).title == "yours"


def test_two_windows_on_one_file_show_one_sheet_that_outlives_a_crash(page, browser, studio):
    """Whoever leaves it unsaved is asked, also in a window that was opened after the change."""
    shutil.copy(gallery()["ruiz_fourbar"], studio[1] / "two.json")
    show(page, studio, "?open=two.json")
    add(page, "spring")
    second = browser.new_page()
    show(second, studio, "?open=two.json")
    expect(blocks(second)).to_have_count(6)
    add(second, "spring")
    expect(blocks(page)).to_have_count(7)
    with second.expect_event("dialog") as asked:
        second.close(run_before_unload=True)
    assert asked.value.type == "beforeunload"
    asked.value.dismiss()
    address = second.url
    with second.expect_event("crash"), suppress(Error):
        second.goto("chrome://crash")
    second.close()
    page.goto(address)
    expect(blocks(page)).to_have_count(7)
    expect(page.get_by_role("button", name="Undo", exact=True)).to_be_enabled()


def test_an_upload_is_checked_as_any_file(page, studio):
    page.goto(studio[0])
    given = gallery()["ruiz_fourbar"].read_text("utf-8")
    upload = page.get_by_label("Upload a file")
    wrong = given.replace('"length": 2', '"length": -2')
    for text, role in ((wrong, "alert"), (given, None)):
        file = {"name": "up.json", "mimeType": "application/json", "buffer": text.encode()}
        upload.set_input_files(file)
        if role:
            page.get_by_role(role).get_by_text("length must be > 0 m, got -2").wait_for()
    blocks(page).nth(4).wait_for()


def test_a_mechanism_is_named_wired_and_saved_by_the_keyboard_alone(page, studio):
    show(page, studio, "?new")
    for word, field, value in (("frame", "new in markers", "A"), ("crank", "length [m]", "2")):
        tab_to(page, f"Add {word}")
        page.keyboard.press("Enter")
        page.get_by_label(field, exact=True).wait_for()
        tab_to(page, field)
        page.keyboard.press("Control+a")
        page.keyboard.type(value)
        page.keyboard.press("Enter")
    tab_to(page, "Name")
    page.keyboard.press("Control+a")
    page.keyboard.type("motor")
    page.keyboard.press("Enter")
    blocks(page).get_by_text("motor").wait_for()
    tab_to(page, "wire to motor.A")
    for key in ("Space", "ArrowDown", "ArrowDown", "Enter"):  # an open list chooses once
        page.keyboard.press(key)
    wire_between(page, "frame.A", "motor.A").wait_for(state="attached")
    for key, count in (("Undo", 0), ("Redo", 1)):
        tab_to(page, key)
        page.keyboard.press("Enter")
        expect(page.locator(".wire")).to_have_count(count)
    tab_to(page, "File")
    page.keyboard.press("Control+a")
    page.keyboard.type("keys.json")
    tab_to(page, "Save")
    page.keyboard.press("Enter")
    told(page, "wrote keys.json")
    made = bm.Graph.load(studio[1] / "keys.json")
    assert [str(wire) for wire in made.wires] == ["frame.A -> motor.A"]
    assert made.blocks["motor"].length == 2


@pytest.mark.parametrize("colours", [LIGHT, DARK], ids=["light", "dark"])
def test_words_stand_out_from_what_is_behind_them(colours):
    """WCAG 2.1, 1.4.3 (words 4.5) and 1.4.11 (outlines of what is used 3)."""
    light = {name: luminance(z) for name, z in re.findall(r"--bm-(\w+): #(\w{6})", colours)}
    behind = ("paper", "frame", "driver", "group", "element")
    for least, words in ((4.5, ("ink", "grey", "alarm")), (4.5, ("blue",)), (3.0, ("line",))):
        for word in words:
            for back in behind if word == "ink" else ("paper",):
                pair = sorted((light[word], light[back]))
                assert (pair[1] + 0.05) / (pair[0] + 0.05) >= least, (word, back)


def luminance(colour):
    """Relative luminance of a colour in hexadecimal digits, WCAG 2.1."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (0, 2, 4)]
    r, g, b = (x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b
