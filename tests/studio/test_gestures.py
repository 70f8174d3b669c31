"""Gestures beside the usual ones: a pin lands where a hand aimed, or where it was typed."""

import cmath
import math

import pytest

pytest.importorskip("playwright.sync_api", reason="it is no browser's driver")

from tests.studio.page import Sheet

DRAWN = {"new": "joints"}
PIXEL = 1.5  # px, within which a place without any help is where the pointer was
PMKS = (
    "https://app.pmksplus.com/?j=A,-4.5,-2.1,AB,R,t,0,t%0AB,-3.95,1.94,AB%7CBC,R,f,0,f%0A"
    "C,2.3,3.14,BC%7CCD,R,f,0,f%0AD,2.75,-1.86,CD,R,t,0,f%0A&l=AB,1,1,-4.22,-0.08,A%7CB,,,%0A"
)


@pytest.fixture
def four_bar(page, studio):
    """A four-bar, drawn by hand; a drag moves."""
    hand = Sheet(page, studio, DRAWN)
    hand.link(hand.to(0, 0), hand.to(0.03, 0.05))
    hand.link(hand.pin("B"), hand.to(0.15, 0.09))
    hand.link(hand.pin("C"), hand.to(0.18, 0))
    hand.take("To the frame", "D")
    hand.take("Driver", "A")
    page.keyboard.press("Escape")
    return hand


def links_of(hand):
    return {link["name"]: {*link["ends"]} for link in hand.state["drawing"]["links"]}


def take_hold(hand, name, *positions):
    """Press on a pin, and go on to places [m], each where it is once the one before is drawn."""
    mouse = hand.page.mouse
    mouse.move(*hand.pin(name))
    mouse.down()
    for position in positions:
        mouse.move(*hand.to(*position), steps=4)
    hand.page.wait_for_timeout(50)


TYPED = {  # what is typed -> length [m], angle [deg]
    "1/2 in": (0.0127, None),
    "0.3 m @ 45": (0.3, 45),
    "0.3 @ 45": (0.0003, 45),
    "80": (0.08, None),
    "1,5": (0.0015, None),
    "@30": (None, 30),
    "80 mm @ pi/4 rad": (0.08, 45),
    "1.5 in @ -90 deg": (0.0381, -90),
    "3e1": (0.03, None),
}


def test_what_is_typed_while_a_link_is_drawn(page, studio):
    hand = Sheet(page, studio, DRAWN)
    for text, (length, angle) in TYPED.items():
        hand.link(hand.to(0.1, 0.1), hand.to(0.15, 0.13), typed=text)
        off = hand.places()["B"] - hand.places()["A"]
        if length is not None:
            assert abs(off) == pytest.approx(length, rel=1e-12), text
        if angle is not None:
            assert cmath.phase(off) == pytest.approx(math.radians(angle), abs=1e-9), text
        hand.changed(lambda: page.keyboard.press("Control+z"))
        page.keyboard.press("f")


def test_inches_are_typed_and_shown(page, studio):
    hand = Sheet(page, studio, DRAWN)
    lengths = page.get_by_label("Lengths", exact=True)
    lengths.select_option("inch")
    hand.link(hand.at(0.3, 0.6), hand.at(0.4, 0.45), typed="2")
    hand.link(hand.pin("B"), hand.at(0.7, 0.6), typed="80 mm @ -90")
    pins = hand.places()
    assert abs(pins["B"] - pins["A"]) == pytest.approx(0.0508, rel=1e-12)
    assert pins["C"] - pins["B"] == pytest.approx(-0.08j, abs=1e-15)
    page.get_by_role("button", name="distance A to B 2 inch").wait_for()
    lengths.select_option("mm")
    page.get_by_role("button", name="distance A to B 50.8 mm").wait_for()


def test_a_pin_lands_under_the_pointer_without_help(page, four_bar):
    hand = four_bar
    (x, y), scale = hand.pin("C"), float(hand.svg.get_attribute("data-view").split()[0])
    start = hand.places()["C"]
    page.keyboard.down("Alt")
    hand.changed(lambda: hand.drag((x, y), (x + 37.3, y - 21.6)))
    page.keyboard.up("Alt")
    off = hand.places()["C"] - start - complex(37.3, 21.6) / scale
    assert abs(off) * scale < PIXEL


def test_the_wheel_zooms_while_a_hand_holds_something(page, four_bar):
    hand, before = four_bar, four_bar.places()
    take_hold(hand, "C", (0.14, 0.1))
    page.mouse.wheel(0, -300)
    page.wait_for_timeout(50)
    page.mouse.move(*hand.to(0.12, 0.08), steps=4)
    hand.changed(page.mouse.up)
    assert hand.places() == {**before, "C": 0.12 + 0.08j}
    hand.tool("Link")
    take_hold(hand, "C", (0.14, 0.12))
    page.mouse.wheel(0, 200)
    page.wait_for_timeout(50)
    page.mouse.move(*hand.to(0.16, 0.14), steps=4)
    hand.changed(page.mouse.up)
    assert hand.places() == {**before, "C": 0.12 + 0.08j, "E": 0.16 + 0.14j}


def test_escape_takes_back_and_other_keys_wait(page, four_bar):
    hand, form = four_bar, four_bar.form()
    hand.tool("Link")
    take_hold(hand, "C", (0.2, 0.1))
    page.keyboard.type("50")
    page.keyboard.press("Escape")
    page.mouse.up()
    page.keyboard.press("Escape")
    take_hold(hand, "C", (0.2, 0.1))
    page.keyboard.press("Escape")
    page.mouse.up()
    take_hold(hand, "C")
    page.keyboard.press("Escape")
    page.mouse.up()
    assert hand.form() == form
    take_hold(hand, "C", (0.14, 0.1))
    for key in ("Control+z", "Delete"):  # of what a hand holds nothing is taken away
        page.keyboard.press(key)
    hand.changed(page.mouse.up)
    assert hand.places()["C"] == 0.14 + 0.1j
    assert hand.state["problems"] == []


def test_all_steps_are_undone_and_done_again(page, studio):
    hand = Sheet(page, studio, DRAWN)
    forms = [hand.form()]
    for act in (
        lambda: hand.link(hand.to(0, 0), hand.to(0.03, 0.05)),
        lambda: hand.link(hand.pin("B"), hand.to(0.15, 0.09)),
        lambda: hand.link(hand.pin("C"), hand.to(0.18, 0)),
        lambda: hand.take("To the frame", "D"),
        lambda: hand.take("Driver", "A"),
        lambda: hand.press("Masses"),
    ):
        act()
        forms.append(hand.form())
    for form in forms[-2::-1]:
        hand.changed(lambda: page.keyboard.press("Control+z"))
        assert hand.form() == form
    for k, form in enumerate(forms[1:]):
        key = "Control+y" if k % 2 else "Control+Shift+z"
        hand.changed(lambda key=key: page.keyboard.press(key))
        assert hand.form() == form


def test_what_was_deleted_is_drawn_again(page, four_bar):
    hand, before = four_bar, four_bar.places()
    middle = [sum(x) / 2 for x in zip(hand.pin("B"), hand.pin("C"), strict=True)]
    page.mouse.click(*middle)
    page.locator(".edge.chosen").wait_for(state="attached")
    hand.changed(lambda: page.keyboard.press("Delete"))
    assert hand.places() == before
    hand.tool("Link")
    hand.link(hand.pin("B"), hand.pin("C"))
    assert (hand.places(), hand.state["problems"]) == (before, [])
    page.keyboard.press("Escape")
    hand.click("C")
    hand.changed(lambda: page.keyboard.press("Delete"))
    assert list(links_of(hand).values()) == [{"A", "B"}]  # no link is left with a single pin
    hand.tool("Link")
    hand.link(hand.pin("B"), hand.to(0.15, 0.09))
    hand.link(hand.pin("C"), hand.pin("D"))
    assert (hand.places(), hand.state["problems"]) == (before, [])


def test_a_link_drawn_onto_a_body_makes_it_ternary(page, four_bar):
    hand = four_bar
    hand.tool("Link")
    hand.link(hand.to(0.09, 0.07), hand.to(0.1, 0.15))
    assert {"B", "C", "E"} in links_of(hand).values()
    hand.link(hand.pin("F"), hand.to(0.165, 0.045))
    assert {"C", "D", "G"} in links_of(hand).values()
    assert hand.state["problems"] == []


def test_a_pin_is_a_slider_a_weld_and_on_the_frame_by_turns(four_bar):
    hand, form = four_bar, four_bar.form()
    for tool, group in (("Slider", "RRP"), ("Weld", ""), ("To the frame", "")):
        hand.take(tool, "D")
        assert group in hand.state["status"]
        assert hand.form()["joints"].get("D") != form["joints"]["D"]
        if tool == "Weld":
            hand.page.locator('.pin[data-pin="D"] .weld').wait_for(state="attached")
        hand.take(tool, "D")
        assert hand.form()["joints"] == form["joints"]
        assert hand.state["problems"] == []


def test_a_dimension_holds_while_its_pins_are_dragged(page, four_bar):
    hand = four_bar
    hand.tool("Dimension")
    hand.link(hand.pin("B"), hand.pin("C"))
    page.keyboard.press("Escape")
    page.locator("g.stated").wait_for(state="attached")
    number = page.get_by_role("button", name="distance B to C")
    field = page.get_by_label("new distance B to C in mm", exact=True)
    for _ in range(20):  # what is drawn anew under the hand takes no click
        number.click()
        page.wait_for_timeout(500)
        if field.is_visible():
            break
    hand.changed(lambda: (field.fill("120"), field.press("Enter")))
    assert hand.form()["dimensions"]["length"]["value"] == 0.12
    take_hold(hand, "C", (0.19, 0.08))
    page.wait_for_timeout(200)
    assert hand.svg.get_attribute("data-live") == "server"
    hand.changed(page.mouse.up)
    pins = hand.places()
    assert abs(pins["C"] - pins["B"]) == pytest.approx(0.12, rel=1e-12)
    assert abs(pins["C"] - (0.19 + 0.08j)) < 0.02


def test_a_pin_is_dragged_while_another_window_draws(page, browser, four_bar):
    hand = four_bar
    window = browser.new_page()
    window.goto(page.url)
    partner = Sheet.of(window, hand)
    take_hold(hand, "C", (0.15, 0.11))
    partner.changed(lambda: partner.drag(partner.pin("B"), partner.to(0.04, 0.06)))
    page.locator(f'html[data-revision="{hand.state["revision"]}"]').wait_for(state="attached")
    page.mouse.move(*hand.to(0.16, 0.11), steps=3)
    hand.changed(page.mouse.up)
    assert hand.places() == {"A": 0, "B": 0.04 + 0.06j, "C": 0.16 + 0.11j, "D": 0.18}
    window.close()


def test_a_link_of_pmks_plus_is_pasted(page, studio):
    hand, address = Sheet(page, studio, DRAWN), page.url
    page.evaluate(
        """(text) => { const data = new DataTransfer(); data.setData("text", text);
            document.dispatchEvent(new ClipboardEvent("paste", { clipboardData: data })); }""",
        PMKS,
    )
    page.wait_for_url(lambda url: url != address)
    hand.id = page.url.rpartition("=")[2]
    assert hand.state["status"] == "I(AB) → II RRR(BC, CD)"
    assert hand.places()["C"] == pytest.approx(0.023 + 0.0314j)
