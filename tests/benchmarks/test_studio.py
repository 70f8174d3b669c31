"""From a change in the studio's form to the new picture, and a long chain in a browser."""

import copy
import json
import time
from pathlib import Path

import numpy as np
import pytest

from blockmech.builders import opened
from blockmech.studio.answers import Answers
from blockmech.studio.mechanism import MechanismView
from blockmech.studio.sheet import Sheet
from tests.doors import linkage_of
from tests.proof import chain
from tests.studio.conftest import browser, page, studio, tab  # noqa: F401
from tests.studio.page import blocks, edit, middle, show

from .results import ROWS, Row

expect = pytest.importorskip("playwright.sync_api", reason="no browser's driver").expect
GRAPHS = Path(__file__).parents[2] / "graphs"


@pytest.mark.parametrize(
    ("name", "block", "length", "most"),
    [("ruiz_fourbar", "dyad", "l_i", 0.15), ("excavator", "bucket", "l_i", 0.4)],
)
def test_a_change_is_seen_at_once(name, block, length, most):
    sheet = Sheet(opened(GRAPHS / f"{name}.json"))
    view = MechanismView(sheet)
    answers = Answers(sheet, view)
    taken = []
    for _ in range(5):
        form = copy.deepcopy(sheet.form)
        form["blocks"][block][length] *= 1.0001
        begun = time.process_time()
        sheet.change(form, length)
        taken.append(time.process_time() - begun)
        assert answers.result.mechanism is sheet.mechanism
    row(f"a change of {name}, without a browser", min(taken), most)


FRAMES = """() => {
    window.frames = []; window.counting = true;
    let last = performance.now();
    const count = (now) => {
        window.frames.push(now - last); last = now;
        if (window.counting) requestAnimationFrame(count);
    };
    requestAnimationFrame(count);
}"""


def frame_times(page, act):  # noqa: F811
    """Median and 95 % of the frame times [s] in the browser while something is done."""
    page.evaluate(FRAMES)
    act()
    page.evaluate("window.counting = false")
    return np.percentile(page.evaluate("window.frames.slice(1)"), [50, 95]) / 1e3


def idle_frames(page):  # noqa: F811
    """Frame times of a page on which nothing happens."""
    page.goto("about:blank")
    return frame_times(page, lambda: page.wait_for_timeout(1000))


def frame_rows(task, measured, idle):
    for share, taken, beside in zip(("median", "95 %"), measured, idle, strict=True):
        against = f"{share} of an idle page"
        ROWS.append(Row(f"{task}: {share} of frames", taken, beside, against, 2.0))


def test_a_chain_of_a_hundred_dyads_opens_and_pans(page, studio):  # noqa: F811
    linkage_of(json.dumps(chain.document(100))).decompose().graph.save(studio[1] / "chain.json")
    page.set_default_timeout(120_000)
    idle = idle_frames(page)
    begun = time.perf_counter()
    show(page, studio, "?open=chain.json")
    blocks(page).nth(101).wait_for(state="attached")
    taken = time.perf_counter() - begun
    canvas = page.locator(".diagram svg").bounding_box()

    def pan():
        page.mouse.move(canvas["x"] + 20, canvas["y"] + 20)
        page.mouse.down()
        for step in range(60):
            page.mouse.move(canvas["x"] + 20 + 4 * step, canvas["y"] + 20 + step)
        page.mouse.up()

    where = page.locator(".diagram .all")
    before = where.get_attribute("transform")
    panned = frame_times(page, pan)
    assert where.get_attribute("transform") != before
    frame_rows("chain of 100 dyads in the studio, panning", panned, idle)
    task = "chain of 100 dyads in the studio"
    ROWS.append(Row(f"{task}: open", taken, 3.0, "3 s", 1.0))


def test_what_the_hand_does_is_drawn_within_a_frame(page, studio):  # noqa: F811
    """All pins of the excavator are dragged: its links, names and springs are drawn anew."""
    idle = idle_frames(page)
    page.goto(f"{studio[0]}?example=joints/excavator")
    page.locator("[data-pin] .ring").first.wait_for()
    page.wait_for_function("Bokeh.documents[0].is_idle")
    page.locator("svg[role=application]").press("Control+a")
    pin = page.locator('[data-pin="boom_foot"] .ring')
    x, y = middle(pin)

    def drag():
        page.mouse.move(x, y)
        page.mouse.down()
        for step in range(60):
            page.mouse.move(x + step, y - step / 2)

    dragged = frame_times(page, drag)
    assert middle(pin)[0] > x + 40  # drawn where the hand is, before the button is let go
    page.mouse.up()
    frame_rows("excavator dragged in the studio", dragged, idle)


GALLERY = ("ruiz_fourbar", "excavator", "engine", "scissor_lift")
NUMBERED = """() => {
    const all = [...Bokeh.documents[0]._all_models.values()];
    const curve = (one) => one.type === "ColumnDataSource" && one.data.xs?.[0]?.length > 1;
    const numbers = (one) => one.type === "Div" && one.text.includes(" = ");
    return all.some(curve) && all.some(numbers) && Bokeh.documents[0].is_idle;
}"""
BLOCKS_CHANGE = """async ([button, diagram]) => {
    const count = () => diagram.querySelectorAll(".block").length;
    const [begun, before, most] = [performance.now(), count(), 3e4];
    button.click();
    while (count() === before && performance.now() - begun < most)
        await new Promise(requestAnimationFrame);
    return (performance.now() - begun) / 1e3;
}"""
NUMBERS_CHANGE = """async ([field, value]) => {
    const all = [...Bokeh.documents[0]._all_models.values()];
    const numbers = all.find((one) => one.type === "Div" && one.text.includes(".drive = "));
    const [begun, before, most] = [performance.now(), numbers.text, 3e4];
    field.value = value;
    field.dispatchEvent(new Event("input"));
    field.dispatchEvent(new Event("change"));
    while (numbers.text === before && performance.now() - begun < most)
        await new Promise(requestAnimationFrame);
    return (performance.now() - begun) / 1e3;
}"""


def row(task, taken, most):
    """A row whose yardstick is the wanted time."""
    assert 0 < taken < 30.0  # the page did what it was asked for, not only waited for it
    ROWS.append(Row(f"studio: {task}", taken, most, f"{most:g} s", 1.0))


def test_a_page_and_mechanisms_of_the_gallery_open(page, studio):  # noqa: F811
    begun = time.perf_counter()
    page.goto(studio[0])
    page.locator(".cards").wait_for()
    row("first page", time.perf_counter() - begun, 2.5)
    for name in GALLERY:
        taken = []
        for _ in range(3):
            page.goto(studio[0])
            page.locator(".cards").wait_for()
            begun = time.perf_counter()
            page.locator(f'.card[href="?example={name}"]').click()
            blocks(page).first.wait_for()
            page.locator(".caption").get_by_text("=").first.wait_for()  # drawn in its poses
            page.wait_for_function(NUMBERED)
            taken.append(time.perf_counter() - begun)
        row(f"open {name}", min(taken), 1.5)


def test_blocks_are_added_and_undone_and_numbers_follow(page, studio):  # noqa: F811
    for name, block, most in (("ruiz_fourbar", "crank", 0.1), ("excavator", "bucket", 0.25)):
        show(page, studio, f"?example={name}")
        diagram = page.locator(".diagram svg").element_handle()
        for button, wanted in (("Add spring", 0.2), ("Undo", 0.15)):
            pressed = page.get_by_role("button", name=button, exact=True)
            steps = []
            for _ in range(5):
                expect(pressed).to_be_enabled()
                steps.append(page.evaluate(BLOCKS_CHANGE, [pressed.element_handle(), diagram]))
            row(f"{button} in {name}", min(steps), wanted)
        edit(page, block)
        label = "length [m]" if name == "ruiz_fourbar" else "l_i [m]"
        field = page.get_by_label(label, exact=True)
        length = float(field.input_value())
        following = [
            page.evaluate(NUMBERS_CHANGE, [field.element_handle(), str(length * (1 + 1e-4 * k))])
            for k in range(1, 6)
        ]
        row(f"numbers of {name} follow", min(following), most)
