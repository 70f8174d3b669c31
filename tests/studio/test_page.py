"""The studio as a user works with it, in a browser."""

import json
import urllib.error
import urllib.request
from pathlib import Path

import pytest

import blockmech as bm

GRAPHS = Path(__file__).parents[2] / "graphs"


def opened(page, studio, what):
    page.goto(studio[0] + what)
    page.wait_for_selector(".react-flow__pane")


def drop(page, kind, x, y):
    """Drag a kind of block from the palette to a place on the canvas."""
    before = page.locator(".react-flow__node").count()
    canvas = page.locator(".react-flow__pane")
    page.locator(f'button[data-kind="{kind}"]').drag_to(canvas, target_position={"x": x, "y": y})
    page.wait_for_function(
        "n => document.querySelectorAll('*').length && true", arg=before
    )
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
    page.wait_for_timeout(60)
    page.mouse.move(*ends[1], steps=3)
    page.wait_for_timeout(120)
    page.mouse.up()


def test_without_the_token_nothing_is_answered(studio):
    address = studio[0]
    for wrong in (address.rsplit("/", 2)[0] + "/", address[:-3] + "xx/", address[:-3] + "xx/ws"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(wrong)
        assert refused.value.code == 403
        refused.value.close()


def test_the_fourbar_from_an_empty_sheet(page, studio):
    opened(page, studio, "?new")
    drop(page, "frame", 60, 120)
    fill(page, "new in markers", "A")
    fill(page, "A at [m]", "0, 0")
    fill(page, "new in markers", "D")
    fill(page, "D at [m]", "5.5, 0")
    drop(page, "driver.crank", 200, 60)
    fill(page, "length [m]", "2")
    for label, value in (("mass [kg]", "4.8"), ("inertia [kg m2]", "1.7"), ("cm [m]", "1, 0")):
        fill(page, f"crank {label}", value)
    fill(page, "A coefficient", "0.4")
    fill(page, "A radius", "0.0075")
    page.screenshot(path="/work/tmp/studio/d.png")
    fill(page, "Name", "crank")
