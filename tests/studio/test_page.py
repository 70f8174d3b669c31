"""The studio as a user works with it, in a browser."""

import json
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from blockmech.builders import Graph

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
WIRES = (
    ("frame.A", "crank.A"),
    ("crank.B", "dyad.B"),
    ("frame.D", "dyad.D"),
    ("dyad.S", "weightlike.at"),
    ("dyad.j", "couple.on"),
)


def opened(page, studio, what):
    page.goto(studio[0] + what)
    page.wait_for_selector(".react-flow__pane")
    page.wait_for_function("Bokeh.documents[0].is_idle")
    page.wait_for_timeout(300)


def drop(page, kind, x, y):
    """Drag a kind of block from the palette to a place on the canvas."""
    before = page.locator(".react-flow__node").count()
    canvas = page.locator(".react-flow__pane")
    page.locator(f'button[data-kind="{kind}"]').drag_to(canvas, target_position={"x": x, "y": y})
    page.locator(".react-flow__node").nth(before).wait_for()


def fill(page, label, value):
    field = page.get_by_label(label, exact=True)
    field.fill(value)
    field.press("Enter")


def wire(page, source, target):
    """Draw a wire from a marker to a joint."""
    ends = []
    for end, side in ((source, "source"), (target, "target")):
        block, port = end.split(".")
        handle = f'.react-flow__handle.{side}[data-nodeid="{block}"][data-handleid="{port}"]'
        box = page.locator(handle).bounding_box()
        ends.append((box["x"] + box["width"] / 2, box["y"] + box["height"] / 2))
    page.mouse.move(*ends[0])
    page.mouse.down()
    page.mouse.move(*[(a + b) / 2 for a, b in zip(*ends, strict=True)], steps=3)
    page.locator(f"{handle}.rf-handle-valid").wait_for()  # the server has said that it may be
    page.mouse.move(*ends[1], steps=3)
    before = page.locator(".react-flow__edge").count()
    page.mouse.up()
    page.locator(".react-flow__edge").nth(before).wait_for(state="attached")
    page.get_by_role("status").get_by_text(f"{source} -> {target}").wait_for()
    page.wait_for_timeout(300)  # the handles of both blocks are made again


def test_without_the_token_nothing_is_answered(studio):
    address = studio[0]
    for wrong in (address.rsplit("/", 2)[0] + "/", address[:-3] + "xx/", address[:-3] + "xx/ws"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(wrong)
        assert refused.value.code == 403
        refused.value.close()


def test_the_fourbar_from_an_empty_sheet(page, studio):
    opened(page, studio, "?new")
    drop(page, "frame", 60, 170)
    fill(page, "new in markers", "A")
    fill(page, "A at [m]", "0, 0")
    fill(page, "new in markers", "D")
    fill(page, "D at [m]", "5.5, 0")
    drop(page, "driver.crank", 200, 60)
    fill(page, "length [m]", "2")
    for label, value in (("mass [kg]", "4.8"), ("inertia [kg m2]", "1.7"), ("cm [m]", "1, 0")):
        fill(page, f"crank {label}", value)
    fill(page, "A coefficient", "0.4")
    fill(page, "A radius [m]", "0.0075")
    drop(page, "dyad.rrr", 480, 60)
    for label, value in DYAD.items():
        fill(page, label, value)
    page.get_by_label("branch", exact=True).select_option("1")
    fill(page, "new in i markers", "S")
    fill(page, "i markers S at [m]", "2.5 @ 0.5235987755982988")
    fill(page, "Name", "dyad")
    drop(page, "load.force", 650, 20)
    fill(page, "force [N]", "0, -1000")
    fill(page, "Name", "weightlike")
    drop(page, "load.couple", 650, 250)
    fill(page, "moment [N m]", "-250")
    page.get_by_label("Edit").select_option("mechanism")
    fill(page, "title", "Four-bar of Ruiz, Durango & Calle 2010, Table 1")
    fill(page, "new in drive", "crank")
    fill(page, "crank rate", "10")
    fill(page, "crank from", "0")
    fill(page, "crank to", "6.283185307179586")
    fill(page, "gravity [m/s2]", "0, 0")
    fill(page, "Name", "ruiz_fourbar")
    fit = page.get_by_label("Fit View")
    fit.click()
    page.wait_for_timeout(400)
    for source, target in WIRES:
        wire(page, source, target)
    fill(page, "File", "mine.json")
    page.get_by_role("button", name="Save").click()
    page.get_by_text("wrote mine.json").wait_for()
    made = json.loads((studio[1] / "mine.json").read_text("utf-8"))
    given = json.loads((GRAPHS / "ruiz_fourbar.json").read_text("utf-8"))
    assert made.pop("view").keys() == made["blocks"].keys()
    made["wires"].sort(key=given["wires"].index)
    assert made == given


def test_blocks_are_dropped_and_edited_by_their_forms(page, studio):
    page.goto(f"{studio[0]}?new")
    page.wait_for_selector(".react-flow__pane")
    page.wait_for_function("Bokeh.documents[0].is_idle")
    canvas = page.locator(".react-flow__pane")
    page.locator('button[data-kind="driver.crank"]').drag_to(canvas)
    page.locator(".react-flow__node").first.wait_for()
    field = page.get_by_label("length [m]", exact=True)
    field.fill("-2")
    field.press("Enter")
    page.get_by_text("length must be > 0 m, got -2").first.wait_for()
    assert page.locator(".react-flow__node.bm-driver").count() == 1


def test_the_four_bar_stands_with_its_answers_in_the_chosen_units(page, studio, tmp_path):
    """`examples/studio.png` is this picture; the other one is looked at."""
    for theme in ("dark", "light"):
        opened(page, studio, f"?example=ruiz_fourbar&theme={theme}")
        page.get_by_label("Lengths").select_option("mm")
        page.get_by_label("Angles").select_option("deg")
        axes = "() => [...Bokeh.documents[0]._all_models.values()].filter(m => m.axis_label)"
        page.wait_for_function(f"({axes})().filter(m => m.axis_label == 'crank.q [°]').length == 2")
        page.wait_for_function(f"({axes})().some(m => m.axis_label == 'x [mm]')")
        page.get_by_label("Lengths").select_option("m")
        page.wait_for_function(f"({axes})().every(m => m.axis_label != 'x [mm]')")
        page.get_by_text("crank.q = 0°").wait_for()
        page.wait_for_timeout(500)  # the figure is painted
        page.screenshot(path=tmp_path / f"{theme}.png")
    # metres are as long upwards as they are across, in the browser's own numbers
    scales = page.evaluate(
        """() => [...Bokeh.documents[0]._all_models.values()]
        .filter(m => m.type == "Figure" && m.below[0].axis_label == "x [m]" && m.inner_width)
        .map(m => [(m.x_range.end - m.x_range.start) / m.inner_width,
                   (m.y_range.end - m.y_range.start) / m.inner_height])"""
    )
    assert scales
    assert [across for across, _ in scales] == pytest.approx([up for _, up in scales], rel=1e-9)
    drawn = page.evaluate(
        """() => [...Bokeh.documents[0]._all_models.values()]
        .filter(m => m.type == "ColumnDataSource" && m.data.crank && m.data.x)
        .map(m => Array.from(m.data.crank))[0]"""
    )
    run = Graph.load(GRAPHS / "ruiz_fourbar.json").run(samples=361, want=["crank.drive"])
    assert drawn == pytest.approx(run["crank.drive"] / 1e3, rel=1e-12)
