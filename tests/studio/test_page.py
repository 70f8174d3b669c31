"""The studio as a user works with it, in a browser."""

import json
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from blockmech.builders import Graph
from blockmech.ground.errors import BlockmechError
from blockmech.studio.edits import renamed
from blockmech.studio.sharing import KEY, packed, unpacked
from tests.studio.page import (
    add,
    blocks,
    choose,
    drag_block,
    drawing,
    drop,
    edit,
    fill,
    heap_around,
    hidden_wires,
    press,
    rename,
    save,
    show,
    told,
    wire,
)

GRAPHS = Path(__file__).parents[2] / "graphs"

DYAD = {
    "l_i [m]": "6",
    "l_j [m]": "3",
    "i mass [kg]": "30",
    "i inertia [kg m2]": "48.8",
    "i cm [m]": "2.8 @ 0.152",
    "j mass [kg]": "7.2",
    "j inertia [kg m2]": "5.5",
    "j cm [m]": "1.5, 0",
    **{
        f"{joint} {key}": value
        for joint in "BCD"
        for key, value in (("coefficient", "0.4"), ("radius [m]", "0.0075"))
    },
}
MEMORY, SLACK = 100e6, 8e6  # bytes of the page for 1,000 edits, and what a few may leave
WIRES = (
    ("frame.A", "crank.A"),
    ("crank.B", "dyad.B"),
    ("frame.D", "dyad.D"),
    ("dyad.S", "weightlike.at"),
    ("dyad.j", "couple.on"),
)


def shown_drive(page):
    """The driving moment of the crank as its curve has it in the browser [kN m]."""
    return page.evaluate(
        """() => [...Bokeh.documents[0]._all_models.values()]
        .filter(m => m.type == "ColumnDataSource" && m.data.ys && m.data.name?.[0] == "crank")
        .map(m => Array.from(m.data.ys[0]))[0]"""
    )


def test_without_the_token_nothing_is_answered(studio):
    address = studio[0]
    for wrong in (address.rsplit("/", 2)[0] + "/", address[:-3] + "xx/", address[:-3] + "xx/ws"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(wrong)
        assert refused.value.code == 403
        refused.value.close()


def visitor(address):
    """Who was let in at the printed address, and the root of the pages."""
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    with opener.open(address) as answer:
        return opener, answer.url.partition("?")[0]


def test_a_mechanism_of_the_gallery_has_a_picture(studio):
    opener, root = visitor(studio[0])
    with opener.open(f"{root}picture/elliptic_trammel.svg") as answer:
        assert answer.read().startswith(b"<?xml")


def test_the_token_leaves_the_address_and_no_other_page_may_use_this_one(studio):
    opener, root = visitor(studio[0])
    token = studio[0].rstrip("/").rpartition("/")[2]
    (processor,) = (h for h in opener.handlers if hasattr(h, "cookiejar"))
    (cookie,) = processor.cookiejar
    assert token not in root
    assert cookie.value == token
    assert cookie.has_nonstandard_attr("HttpOnly")
    assert cookie.get_nonstandard_attr("SameSite") == "Strict"
    for path in ("", "favicon.ico", "static/js/bokeh.min.js", "picture/pump.svg"):
        with opener.open(root + path) as answer:
            assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
            assert answer.headers["Referrer-Policy"] == "no-referrer"
            assert answer.headers["Access-Control-Allow-Origin"] is None
    other = urllib.request.Request(root, headers={"Host": "example.org"})
    with pytest.raises(urllib.error.HTTPError) as refused:
        opener.open(other)
    assert refused.value.code == 403
    refused.value.close()


def test_the_fourbar_from_an_empty_sheet(page, studio, call):
    show(page, studio, "?new")
    drop(page, "frame", 60, 170)
    fill(page, "new in markers", "A")
    fill(page, "A at [m]", "0, 0")
    fill(page, "new in markers", "D")
    fill(page, "D at [m]", "5.5, 0")
    drop(page, "driver.crank", 200, 60)
    fill(page, "length [m]", "2")
    for label, value in (("mass [kg]", "4.8"), ("inertia [kg m2]", "1.7"), ("cm [m]", "1, 0")):
        fill(page, f"crank {label}", value)
    choose(page, "A law", "coulomb")
    fill(page, "A coefficient", "0.4")
    fill(page, "A radius [m]", "0.0075")
    drop(page, "dyad.rrr", 480, 60)
    for joint in "BCD":
        choose(page, f"{joint} law", "coulomb")
    for label, value in DYAD.items():
        fill(page, label, value)
    page.get_by_label("branch", exact=True).select_option("1")
    fill(page, "new in i markers", "S")
    fill(page, "i markers S at [m]", "2.5 @ 0.5235987755982988")
    rename(page, "dyad")
    drop(page, "load.force", 650, 20)
    fill(page, "force [N]", "0, -1000")
    rename(page, "weightlike")
    drop(page, "load.couple", 650, 250)
    fill(page, "moment [N m]", "-250")
    page.get_by_label("Edit").select_option("mechanism")
    fill(page, "title", "Four-bar of Ruiz, Durango & Calle 2010, Table 1")
    fill(page, "new in drive", "crank")
    fill(page, "crank rate [rad/s]", "10")
    fill(page, "crank from [rad]", "0")
    fill(page, "crank to [rad]", "6.283185307179586")
    fill(page, "gravity [m/s2]", "0, 0")
    fill(page, "name", "ruiz_fourbar")
    page.get_by_role("button", name="Lay out").click()  # no block covers a handle of another
    told(page, "laid out")  # then the server has done all that was typed
    for source, target in WIRES:
        wire(page, source, target)
    drag_block(page, "couple")
    save(page, "mine.json")
    mine = studio[1] / "mine.json"
    made = json.loads(mine.read_text("utf-8"))
    given = json.loads((GRAPHS / "ruiz_fourbar.json").read_text("utf-8"))
    assert made.pop("view").keys() == made["blocks"].keys()
    made["wires"].sort(key=given["wires"].index)
    assert made == given
    done = call("run", mine, "--samples", "361", "--want", "crank.drive", "--json")
    run = json.loads(done.out)["outputs"]["crank.drive"]["values"]
    assert shown_drive(page) == pytest.approx(np.array(run) / 1e3, rel=1e-12)


def test_the_four_bar_stands_with_its_answers_in_the_chosen_units(page, studio, tmp_path):
    """`examples/studio.png` is the picture."""
    show(page, studio, "?example=ruiz_fourbar")
    page.get_by_label("Lengths").select_option("mm")
    page.get_by_label("Angles").select_option("deg")
    axes = "() => [...Bokeh.documents[0]._all_models.values()].filter(m => m.axis_label)"
    page.wait_for_function(f"({axes})().filter(m => m.axis_label == 'crank.q [°]').length == 1")
    press(page, "Margins")
    page.wait_for_function(f"({axes})().filter(m => m.axis_label == 'crank.q [°]').length == 2")
    press(page, "Curves")
    page.locator("canvas.picture[data-length=mm]").wait_for()
    page.get_by_label("Lengths").select_option("m")
    page.locator("canvas.picture[data-length=m]").wait_for()
    page.locator(".caption").get_by_text("crank.q = 0°").wait_for()
    page.evaluate("() => new Promise(requestAnimationFrame)")  # the figure is painted
    page.screenshot(path=tmp_path / "studio.png")
    assert hidden_wires(page) == []
    run = Graph.load(GRAPHS / "ruiz_fourbar.json").run(samples=361, want=["crank.drive"])
    assert shown_drive(page) == pytest.approx(run["crank.drive"] / 1e3, rel=1e-12)
    page.get_by_label("Add an output").press_sequentially("c.reac")
    page.keyboard.press("Enter")
    page.get_by_role("checkbox", name="dyad.C.reaction", checked=True).wait_for()


OVERLAPS = """() => {
    const all = (root) => [...root.querySelectorAll("*")]
        .flatMap((one) => [one, ...(one.shadowRoot ? all(one.shadowRoot) : [])]);
    const up = (one) => one.parentElement ?? one.getRootNode().host ?? null;
    const shown = [];
    const kinds = /^(BUTTON|INPUT|SELECT|LABEL)$/;
    for (const one of all(document).filter(({ tagName }) => kinds.test(tagName))) {
        const { visibility, clipPath } = getComputedStyle(one);
        let { left, top, right, bottom } = one.getBoundingClientRect();
        for (let part = up(one); part; part = up(part)) {
            if (getComputedStyle(part).overflowY === "visible") continue;
            const area = part.getBoundingClientRect();
            [left, top] = [Math.max(left, area.left), Math.max(top, area.top)];
            [right, bottom] = [Math.min(right, area.right), Math.min(bottom, area.bottom)];
        }
        const seen = right - left > 2 && bottom - top > 2 && visibility !== "hidden";
        if (seen && clipPath === "none") shown.push({ one, left, top, right, bottom });
    }
    const apart = (a, b) => a.right < b.left + 2 || b.right < a.left + 2 || a.bottom < b.top + 2
        || b.bottom < a.top + 2 || a.one.contains(b.one) || b.one.contains(a.one);
    const name = ({ one }) => one.getAttribute("aria-label") ?? one.innerText ?? one.tagName;
    return shown.flatMap((a, k) => shown.slice(k + 1).filter((b) => !apart(a, b))
        .map((b) => [name(a), name(b)]));
}"""


def test_nothing_overlaps_in_a_small_window(page, studio):
    """Of a machine with three drivers and long names, on all tabs."""
    page.set_viewport_size({"width": 1024, "height": 700})
    page.goto(f"{studio[0]}?example=joints/excavator")
    page.locator("[data-pin] .ring").first.wait_for()
    for tab in ("Motion", "Margins", "Analyses", "Synthesis", "Blocks", "Curves"):
        press(page, tab)
        page.wait_for_function("Bokeh.documents[0].is_idle")
        assert page.evaluate(OVERLAPS) == []
    high = "[document.documentElement.scrollHeight, document.documentElement.scrollWidth]"
    assert page.evaluate(high) == [700, 1024]


@pytest.mark.parametrize("size", [(1280, 800)])
def test_nothing_is_below_the_fold_and_no_two_buttons_share_a_name(page, studio, size):
    """The answer of *Trade* is seen without scrolling, and the mechanism beside it."""
    page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
    show(page, studio, "?example=slider_crank")
    tabs = ("Curves", "Motion", "Margins", "Analyses", "Synthesis")
    for tab in (*tabs, "Links and joints"):
        press(page, tab)
        texts = page.get_by_role("button").evaluate_all(
            "all => all.map(one => one.innerText ?? '')"
        )
        shown = [text.strip() for text in texts if text.strip()]
        assert len({*shown}) == len(shown), shown
    press(page, "Analyses")
    press(page, "Trade")
    answer = page.get_by_text("complex64")
    answer.wait_for()
    page.wait_for_function("Bokeh.documents[0].is_idle")  # it is laid out beside its picture
    lines = answer.bounding_box()
    assert lines["y"] + 60 < size[1]
    play = page.get_by_role("button", name="▶ Play").bounding_box()
    assert play["y"] + play["height"] < lines["y"]


FITS = """(diagram) => {
    const { right } = diagram.getBoundingClientRect();
    const inside = (block) => block.getBoundingClientRect().right <= right;
    return [...diagram.querySelectorAll(".block")].every(inside);
}"""


def test_a_sheet_takes_the_gallerys_place_on_the_same_page(page, studio):
    page.goto(studio[0])
    page.evaluate("window.same = true")
    page.locator('.card[href="?example=slider_crank"]').click()
    blocks(page).first.wait_for()
    assert page.evaluate("window.same")
    sheet = page.url
    assert "?sheet=" in sheet
    page.go_back()
    page.locator(".cards").wait_for()
    page.go_forward()
    blocks(page).first.wait_for()
    assert page.url == sheet
    add(page, "spring")
    count = blocks(page).count()
    page.go_back()  # nobody is asked, and nothing is lost by whatever is opened then
    page.locator('.card[href="?example=ruiz_fourbar"]').click()
    blocks(page).first.wait_for()
    page.go_back()
    page.locator(f'.files a[href="{sheet[sheet.index("?") :]}"]').click()
    blocks(page).nth(count - 1).wait_for()
    assert page.url == sheet
    page.goto(f"{studio[0]}?example=slider_crank")
    blocks(page).first.wait_for()
    page.wait_for_url("**/?sheet=*")
    page.set_viewport_size({"width": 1024, "height": 700})
    page.wait_for_function(FITS, arg=page.locator(".diagram svg").element_handle())


def test_a_link_holds_the_document_and_opens_it_in_any_studio(page, browser, studio):
    show(page, studio, "?example=slider_crank")
    edit(page, "crank")
    fill(page, "length [m]", "0.0625")
    page.get_by_role("button", name="Undo").and_(page.locator(":enabled")).wait_for()
    browser.grant_permissions(["clipboard-read", "clipboard-write"])
    press(page, "Copy link")
    told(page, "the link with the document is copied")
    link = page.evaluate("navigator.clipboard.readText()")
    assert "#doc=" in link
    other = browser.new_page()
    other.goto(studio[0] + link.partition("#")[1] + link.partition("#")[2])
    other.wait_for_selector(".diagram svg")
    assert "#doc" not in other.url
    save(other, "linked.json")
    other.goto(f"{studio[0]}#doc=AAAA")
    other.get_by_role("alert").get_by_text("it holds no document").wait_for()
    other.close()
    assert Graph.load(studio[1] / "linked.json").blocks["crank"].length == 0.0625


@pytest.mark.parametrize("wrong", ["", "AAAA", "=", "\u00e9", "x" * 1000])
def test_a_link_that_holds_no_document_is_refused(wrong):
    with pytest.raises(BlockmechError):
        unpacked(KEY + wrong)


def test_a_link_of_a_large_document_is_unpacked_up_to_a_limit():
    document = Graph.load(GRAPHS / "ruiz_fourbar.json")
    assert unpacked(packed(document.to_json())).to_json() == document.to_json()
    with pytest.raises(BlockmechError, match="larger"):
        unpacked(packed(" " * (5 << 20)))


def test_units_are_kept_by_the_browser_and_files_stay_si(page, studio):
    show(page, studio, "?example=slider_crank")
    for label, unit in (("Lengths", "inch"), ("Rates", "rpm"), ("Forces", "lbf")):
        page.get_by_label(label).select_option(unit)
    edit(page, "crank")
    fill(page, "length [inch]", "2")
    page.get_by_role("button", name="Undo").and_(page.locator(":enabled")).wait_for()
    save(page, "inch.json")
    assert Graph.load(studio[1] / "inch.json").blocks["crank"].length == 2 * 0.0254
    show(page, studio, "?example=slider_crank")
    assert page.get_by_label("Lengths").input_value() == "inch"
    choose(page, "Edit", "gas")
    page.get_by_label("force [lbf]", exact=True).wait_for()
    drawing(page, studio)  # whose grid goes by whole steps of the unit shown
    *steps, unit = page.locator("svg[role=application] .grid text").all_text_contents()
    assert unit == "[inch]"
    assert max(map(len, steps)) <= 4, steps


def test_texts_of_a_hostile_document_run_nothing(page, studio):
    """Opened, its costs told, a simulation and a wire refused: markup in names stays text."""
    hurt = "<img src=x onerror='hurt=1'>"
    data = json.loads((GRAPHS / "ruiz_fourbar.json").read_text("utf-8"))
    data = renamed(renamed(data, "crank", hurt), "dyad", f"{hurt}2") | {"title": hurt * 100}
    (studio[1] / "hostile.json").write_text(json.dumps(data), "utf-8")
    show(page, studio, "?open=hostile.json")
    press(page, "Analyses")
    press(page, "Cost")
    page.get_by_text(f"  position             2  {hurt}, {hurt}2").wait_for()
    press(page, "Motion")
    fill(page, "Simulate until", hurt)
    press(page, "Simulate")
    page.get_by_text("until").and_(page.get_by_text(hurt)).first.wait_for()
    choose(page, "Edit", hurt)
    page.get_by_label("Name", exact=True).fill(f"{hurt}2")
    page.get_by_label("Name", exact=True).press("Enter")
    page.get_by_role("status").get_by_text("taken").wait_for()
    assert page.evaluate("window.hurt") is None


def test_texts_of_a_megabyte_are_opened_and_run_nothing(page, studio):
    """A title and notes of a million letters: markup, quotes, marks from right to left."""
    hurt = "</script><img src=x onerror='hurt=1'>\u202e\"'`${hurt=1}"
    data = json.loads((GRAPHS / "slider_crank.json").read_text("utf-8"))
    data |= {"title": hurt * (1_000_000 // len(hurt)), "notes": [hurt] * 20_000}
    (studio[1] / "long.json").write_text(json.dumps(data), "utf-8")
    show(page, studio, "?open=long.json")
    edit(page, "crank")
    fill(page, "length [m]", "0.06")
    page.get_by_role("button", name="Undo").and_(page.locator(":enabled")).wait_for()
    press(page, "Undo")
    told(page, "Undo: length")
    assert page.evaluate("window.hurt") is None
    assert page.locator("img[src=x]").count() == 0


def test_edits_leave_the_memory_where_it_was(page, studio):
    """Twenty edits; of a thousand, see tests/campaigns/edits.py and docs/studio.md."""
    before, after = heap_around(page, studio, 20)
    assert after - before < MEMORY * 20 / 1000 + SLACK
