"""The page in Chromium, by mouse and by keyboard: where pins land, what is said, what is seen."""

import math
import re
import statistics
from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api", reason="it is no browser's driver")
from playwright.sync_api import expect

import blockmech as bm
from tests.studio.page import FRAMES, Sheet, box_of, heap_around

AXE = Path(__file__).parents[2] / ".ci" / "node_modules" / "axe-core" / "axe.min.js"
DRAWN = {"new": "joints"}


def four_bar(page, studio):
    hand = Sheet(page, studio, DRAWN)
    hand.link(hand.to(0.0, 0.0), hand.to(0.03, 0.05))
    hand.link(hand.pin("B"), hand.to(0.15, 0.09))
    hand.link(hand.pin("C"), hand.to(0.18, 0.0))
    hand.click("A")
    hand.click("D", more=True)
    hand.press("To the frame")
    hand.click("A")
    hand.press("Driver")
    return hand


def test_a_four_bar_is_drawn_moved_live_and_undone(page, studio):
    hand = four_bar(page, studio)
    assert hand.acts <= 9
    made = hand.state
    assert (made["problems"], made["status"]) == ([], "I(link) → II RRR(link_2, link_3)")
    assert hand.places() == {"A": 0, "B": 0.03 + 0.05j, "C": 0.15 + 0.09j, "D": 0.18}
    page.keyboard.press("Escape")
    before, curve = hand.places(), page.locator('.path[data-path="C"]')
    page.locator('.path[data-path="C"]').wait_for(state="attached")
    seen = curve.get_attribute("d")
    hand.hold("C", 40, 30, steps=8)
    live = curve.get_attribute("d")
    assert live != seen  # before anything is released
    hand.changed(page.mouse.up)
    page.wait_for_timeout(200)
    assert hand.places()["C"] != before["C"]
    assert {n: z for n, z in hand.places().items() if n != "C"} == pytest.approx(
        {n: z for n, z in before.items() if n != "C"}
    )
    assert curve.get_attribute("d") == live  # what was seen is what was committed
    page.get_by_role("button", name="Masses").focus()  # keys act on the document all the same
    hand.changed(lambda: page.keyboard.press("Control+z"))
    assert hand.places() == before


def test_typed_lengths_are_taken_in_their_units(page, studio):
    hand = Sheet(page, studio, DRAWN)
    hand.link(hand.at(0.3, 0.7), hand.at(0.4, 0.6), typed="80 mm @ 45")
    places = hand.places()
    off = places["B"] - places["A"]
    assert abs(off) == pytest.approx(0.08, rel=1e-12)
    assert math.atan2(off.imag, off.real) == pytest.approx(math.pi / 4)
    hand.link(hand.pin("B"), hand.at(0.7, 0.5), typed="1/2 in")
    assert abs(hand.places()["C"] - hand.places()["B"]) == pytest.approx(0.0127, rel=1e-12)
    before = hand.state["revision"]
    hand.drag(hand.pin("C"), hand.at(0.8, 0.4), typed="12 apples")
    page.keyboard.press("Escape")
    assert "write a length as 80 mm" in hand.said()
    assert hand.state["revision"] == before


def test_a_slider_crank_aimed_in_line_has_no_offset(page, studio):
    hand = Sheet(page, studio, DRAWN)
    hand.link(hand.at(0.3, 0.6), hand.at(0.35, 0.5))
    hand.link(hand.pin("B"), (hand.at(0.7, 0.6)[0], hand.pin("A")[1] + 3))
    hand.click("A")
    hand.press("To the frame")
    hand.click("C")
    hand.press("Slider")
    hand.click("A")
    hand.press("Driver")
    assert hand.acts <= 9
    assert hand.state["problems"] == []
    places = hand.places()
    assert places["A"].imag == places["C"].imag


def test_what_is_chosen_is_what_the_form_shows(page, studio):
    hand = Sheet(page, studio, {"example": "joints/slider_crank"})
    hand.click("B")
    page.get_by_label("at [mm]", exact=True).wait_for()
    page.locator('[data-link="rod"]').last.click(force=True)
    mass = page.get_by_label("mass [kg]", exact=True)
    hand.changed(lambda: (mass.fill("1500 g"), mass.press("Enter")))
    expect(mass).to_have_value("1.5")
    mass.fill("heavy")
    mass.press("Enter")
    page.get_by_role("alert").filter(has_text="'heavy' is no number").first.wait_for()
    assert mass.input_value() == "heavy"  # what is not sound is not forgotten
    hand.changed(lambda: (mass.fill("2"), mass.press("Enter")))


def test_a_dimension_is_typed_and_a_wrong_one_refused(page, studio):
    hand = Sheet(page, studio, {"example": "joints/ruiz_fourbar"})
    page.get_by_role("button", name=re.compile("^distance A to B")).click()
    field = page.get_by_label("new distance A to B in mm", exact=True)
    hand.changed(lambda: (field.fill("2,5 m"), field.press("Enter")))
    places = hand.places()
    assert abs(places["B"] - places["A"]) == pytest.approx(2.5)


def test_a_motion_plays_and_its_pose_is_set(page, studio):
    hand = Sheet(page, studio, {"example": "joints/slider_crank"})
    pose = page.get_by_label("Pose", exact=True)
    page.get_by_role("button", name="Play").click()
    page.wait_for_timeout(500)
    assert int(pose.input_value()) > 0
    page.get_by_role("button", name="Pause").click()
    motor = page.get_by_label("motor, coordinate", exact=True)
    motor.fill("90")
    motor.press("Enter")
    page.wait_for_timeout(300)
    assert pose.input_value() == "90"
    page.get_by_label("show", exact=True).select_option("reactions")
    page.locator(".reactions").first.wait_for(state="attached")
    page.get_by_role("button", name="As drawn").click()
    expect(motor).to_have_value("40.107")
    assert hand.state["saved"]


def test_blocks_are_added_wired_refused_and_dragged(page, studio):
    hand = Sheet(page, studio, {"new": "blocks"})
    for word in ("frame", "crank"):
        hand.changed(page.get_by_role("button", name=f"Add {word}", exact=True).click)
    hand.changed(lambda: wire(hand, "frame.frame", "crank.A"))
    assert hand.state["problems"] == []
    page.locator('.wire[data-id="frame.frame -> crank.A"]').wait_for(state="attached")
    block = box_of(page.locator('g.block[data-id="crank"]'))
    before = block["x"]
    hand.changed(
        lambda: hand.drag((block["x"] + 30, block["y"] + 12), (block["x"] + 60, block["y"] + 52))
    )
    crank = """document.querySelector('g.block[data-id="crank"]')"""
    moved = f"x => {crank} && {crank}.getBoundingClientRect().x !== x"
    page.wait_for_function(moved, arg=before)
    page.locator('g.block[data-id="crank"]').focus()
    page.keyboard.press("Enter")
    name = page.get_by_label("Name", exact=True)
    hand.changed(lambda: (name.fill("motor"), name.press("Enter")))
    assert "motor" in [link["name"].split(".")[0] for link in hand.state["drawing"]["links"]]


def wire(hand, source, target):
    def end(side, address):
        block, port = address.split(".")
        return hand.middle(f'.handle.{side}[data-block="{block}"][data-port="{port}"]')

    hand.drag(end("source", source), end("target", target))


def test_a_tool_that_is_chosen_stays_when_it_is_pressed(page, studio):
    """An empty sheet begins with Link; Esc or Move ends it."""
    hand = Sheet(page, studio, DRAWN)
    hand.tool("Link")
    hand.link(hand.to(0.0, 0.0), hand.to(0.03, 0.05))
    assert len(hand.places()) == 2
    hand.tool("Link")
    hand.link(hand.pin("B"), hand.to(0.15, 0.09))
    assert len(hand.places()) == 3
    page.keyboard.press("Escape")
    page.locator('.canvas svg[data-tool=""]').wait_for(state="attached")


def test_pictures_of_the_gallery_in_sight_are_drawn_first(page, studio):
    waiting = []
    svg = '<svg xmlns="http://www.w3.org/2000/svg"/>'
    empty = {"content_type": "image/svg+xml", "body": svg}

    def waiting_for(route):
        waiting.append(route)

    page.route("**/picture/*.svg", waiting_for)
    page.set_viewport_size({"width": 700, "height": 500})
    page.goto(studio[0])
    cards = page.locator("#gallery .card")
    cards.first.wait_for()
    assert cards.first.locator("img").evaluate("x => getComputedStyle(x).visibility") == "visible"
    cards.last.scroll_into_view_if_needed()
    page.wait_for_timeout(300)
    names = []
    while len(names) < 3:
        while not waiting:
            page.wait_for_timeout(20)
        route = waiting.pop()
        names.append(route.request.url.rpartition("/")[2].removesuffix(".svg"))
        route.fulfill(**empty)
    order = cards.locator("b").all_inner_texts()
    assert names[0] == order[0]
    assert order.index(names[1]) > 12
    assert order.index(names[2]) > 12
    page.unroute("**/picture/*.svg", waiting_for)
    for route in waiting:
        route.fulfill(**empty)


def test_a_joint_of_blocks_is_dragged_in_the_picture(page, studio):
    hand = Sheet(page, studio, {"example": "watt_sixbar"})
    name = next(p["name"] for p in hand.state["drawing"]["pins"] if p["held"] and not p["ground"])
    x, y = hand.pin(name)
    page.keyboard.down("Alt")
    hand.hold(name, 25, 15, steps=4)
    page.keyboard.up("Alt")
    assert hand.pin(name) == pytest.approx((x + 25, y - 15), abs=1.5)
    hand.changed(page.mouse.up)
    assert f"move {name}" in hand.said()


@pytest.mark.parametrize("cancel", ["Escape", "pointercancel"])
def test_a_drag_that_is_cancelled_leaves_all_as_it_was(page, studio, cancel):
    hand = Sheet(page, studio, {"example": "watt_sixbar"})
    name = next(p["name"] for p in hand.state["drawing"]["pins"] if p["held"] and not p["ground"])
    curves, form = page.locator(".path"), hand.form()
    curves.first.wait_for(state="attached")

    def picture():
        paths = " ".join(curve.get_attribute("d") for curve in curves.all())
        return [float(x) for x in re.findall(r"-?[0-9.]+", paths)], hand.pin(name)

    before = picture()
    hand.hold(name, 25, 15, steps=4)
    assert picture() != before
    if cancel == "Escape":
        page.keyboard.press("Escape")
    else:  # as of a touch that the browser takes for its own
        hand.svg.dispatch_event("pointercancel")
    page.wait_for_timeout(100)
    for now, then in zip(picture(), before, strict=True):
        assert now == pytest.approx(then, abs=1.5)  # px
    page.mouse.up()
    assert hand.form() == form


def test_an_analysis_has_its_title_its_text_and_a_stop(page, studio):
    hand = Sheet(page, studio, {"example": "joints/ruiz_fourbar"})
    page.get_by_role("tab", name="Analyses").click()
    page.get_by_role("button", name="Limits", exact=True).click()
    page.get_by_role("heading", name="Limits: Where does the driver reach?").wait_for()
    page.locator(".answers pre").filter(has_text="turns fully").wait_for()
    page.get_by_alt_text("Limits, as a picture").wait_for()
    page.get_by_role("button", name="Trade", exact=True).click()
    page.get_by_role("button", name="Stop").first.click()
    page.get_by_role("button", name="Stop").first.wait_for(state="hidden")
    assert page.locator(".answers pre").inner_text() in ("", "stopped")
    assert hand.state["saved"]


def test_a_file_is_exported_and_saved(page, studio):
    Sheet(page, studio, {"example": "joints/ruiz_fourbar"})
    page.get_by_label("Export as", exact=True).select_option("numbers .csv")
    with page.expect_download() as loading:
        page.get_by_role("button", name="Export", exact=True).click()
    assert loading.value.suggested_filename.endswith(".csv")
    field = page.get_by_label("File", exact=True)
    field.fill("kept.json")
    page.get_by_role("button", name="Save", exact=True).click()
    page.get_by_role("button", name="Saved", exact=True).wait_for()
    assert bm.Linkage.load(studio[1] / "kept.json").name == "ruiz_fourbar"


def test_two_windows_on_one_sheet(page, browser, studio):
    hand = Sheet(page, studio, {"example": "joints/ruiz_fourbar"})
    other = browser.new_page()
    other.goto(page.url)
    other.locator("html[data-revision]").wait_for(state="attached")
    hand.click("B")
    hand.changed(lambda: page.keyboard.press("ArrowRight"))
    revision = page.locator("html").get_attribute("data-revision")
    other.locator(f'html[data-revision="{revision}"]').wait_for(state="attached")
    other.close()


def test_a_link_holds_the_document(page, studio):
    hand = Sheet(page, studio, {"example": "pump"})
    link = page.request.get(f"{hand.root}/api/documents/{hand.id}/link").json()["link"]
    page.goto(f"{hand.root}/{link}")
    page.locator("html[data-ready]").wait_for(state="attached")
    page.get_by_role("button", name="Copy link").wait_for()
    assert page.title().startswith("pump")


def test_texts_of_a_hostile_document_are_text(page, studio):
    evil = '<img src=x onerror="document.title=1"><script>document.title=2</script>'
    linkage = bm.Linkage("four")
    linkage.title = evil
    linkage.add_link("link")
    linkage.add_joint("A", "R", ["frame", "link"], point=0j)
    data = linkage.to_data()
    data["joints"] = {evil.replace(".", " ").replace("/", " "): data["joints"]["A"]}
    hand = Sheet(page, studio, {"text": bm.Linkage.from_data(data).to_json(), "name": "evil"})
    page.wait_for_timeout(300)
    assert page.title().startswith("four")
    assert page.locator("img[src=x]").count() == 0
    assert hand.form()["title"] == evil


def test_a_frame_of_a_drag_is_short(page, studio):
    """All poses and all paths of the excavator, in less than two frames of a screen."""
    hand = Sheet(page, studio, {"example": "joints/excavator"})
    page.locator(".path").first.wait_for(state="attached")
    page.evaluate(FRAMES)
    hand.hold("arm_cylinder_foot", 20, 25, steps=30)
    spent = page.evaluate("window.spent")
    page.keyboard.press("Escape")
    page.mouse.up()
    assert len(spent) > 5
    assert statistics.median(spent) < 33


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_finds_nothing_in_any_view(page, studio, theme):
    if not AXE.exists():
        pytest.skip("axe-core is not installed: see .ci/run")
    page.emulate_media(color_scheme=theme)
    found = []
    Sheet(page, studio, {"example": "joints/excavator"})
    found += violations(page, "drawing")
    for tab in ("Motion", "Margins", "Analyses", "Synthesis"):
        page.get_by_role("tab", name=tab).click()
        found += violations(page, tab)
    page.get_by_role("tab", name="Blocks").click()
    page.locator("g.block").first.wait_for()
    found += violations(page, "blocks")
    page.goto(page.url.partition("?")[0])
    page.locator("#gallery .card").first.wait_for()
    found += violations(page, "gallery")
    assert found == []


def violations(page, view):
    """What axe finds that is serious; its script is the test's, not the page's."""
    session = page.context.new_cdp_session(page)
    run = f"(() => {{ {AXE.read_text('utf-8')}; return axe.run() }})()"
    how = {"expression": run, "awaitPromise": True, "returnByValue": True}
    result = session.send("Runtime.evaluate", how)["result"]["value"]
    session.detach()
    return [
        (view, one["id"], node["html"][:120])
        for one in result["violations"]
        for node in one["nodes"]
        if one["impact"] in ("serious", "critical")
    ]


def test_a_machine_is_drawn_by_the_keyboard_alone(page, studio):
    hand = Sheet(page, studio, DRAWN)
    field = page.get_by_label("new pin at", exact=True)
    for place in ("0, 0", "20, 50", "150, 80", "200 mm, 0"):
        field.focus()
        page.keyboard.type(place)
        hand.changed(lambda: page.keyboard.press("Enter"))
    assert list(hand.places().values()) == [0, 0.02 + 0.05j, 0.15 + 0.08j, 0.2]
    hand.svg.focus()
    page.keyboard.press("Control+a")
    page.locator(".pin.chosen").nth(3).wait_for(state="attached")
    page.get_by_role("button", name="Link", exact=True).focus()
    hand.changed(lambda: page.keyboard.press("Enter"))
    assert len(hand.state["drawing"]["links"]) == 1


def test_tools_take_two_lines_of_a_window_of_1280_px(page, studio):
    page.set_viewport_size({"width": 1280, "height": 720})
    Sheet(page, studio, {"example": "joints/excavator"})
    for bar, lines in ((".bar", 1), (".tools:visible", 2)):
        height = box_of(page.get_by_role("button", name="Save"))["height"]
        assert box_of(page.locator(bar))["height"] < (lines + 0.75) * height, bar


def test_a_small_window_and_large_letters_cut_nothing(page, studio):
    Sheet(page, studio, {"example": "joints/excavator"})
    page.set_viewport_size({"width": 640, "height": 400})  # a usual one at 200 %
    page.wait_for_timeout(200)
    wide = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    assert wide[0] <= wide[1]
    page.get_by_role("button", name="Export", exact=True).scroll_into_view_if_needed()
    page.get_by_role("tab", name="Curves").scroll_into_view_if_needed()


def test_edits_leave_the_memory_where_it_was(page, studio):
    before, after = heap_around(page, studio, 20)
    assert before < 20e6
    assert after - before < 2e6
